//! What was typed for `convert`.

use std::path::PathBuf;

use clap::{Args as ClapArgs, Subcommand, ValueEnum};
use helio_io::PaintCentroid;

#[derive(Debug, Subcommand)]
pub(crate) enum Convert {
    Paint(ConvertPaintArgs),
}

/// Records of PAINT, the data base of the solar tower in Jülich, into a field and its observations
///
/// Writes field.toml with its tables heliostats.csv and drives.csv, and observations.csv, which calibrate reads. Records
/// without a sun (some published revisions have none), without the centre asked for, or of a target that is no plane
/// are left aside and counted; with any of them the exit status is 1.
#[derive(Debug, ClapArgs)]
#[command(
    after_help = "Example:\n  helio-rs convert paint --tower examples/paint/tower.json --records examples/paint --out plant\n  \
                  helio-rs calibrate --field plant/field.toml --observations plant/observations.csv --out fit.csv"
)]
pub(crate) struct ConvertPaintArgs {
    /// The tower-measurements.json: the plant's place and its targets
    #[arg(long, value_name = "FILE")]
    pub(crate) tower: PathBuf,
    /// Folder of heliostats in PAINT's own order: AA39/Properties/AA39-heliostat-properties.json and
    /// AA39/Calibration/...-calibration-properties.json
    #[arg(long, value_name = "DIR")]
    pub(crate) records: PathBuf,
    /// Folder to write into; made if it does not exist, and what an earlier conversion wrote there is replaced
    #[arg(long, value_name = "DIR")]
    pub(crate) out: PathBuf,
    /// Which of the published centres is the spot
    #[arg(
        long,
        value_name = "CENTRE",
        default_value = "HeliOS",
        ignore_case = true
    )]
    pub(crate) centroid: CentroidWord,
    /// Target that the heliostats aim at [default: the first by name]
    #[arg(long, value_name = "NAME")]
    pub(crate) aim: Option<String>,
    /// Say nothing but errors
    #[arg(short, long)]
    pub(crate) quiet: bool,
    /// Threads to use [default: all processors]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=1024))]
    pub(crate) threads: Option<u16>,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum CentroidWord {
    /// The plant's own
    #[value(name = "HeliOS")]
    Helios,
    /// That of a network
    #[value(name = "UTIS")]
    Utis,
}

impl From<CentroidWord> for PaintCentroid {
    fn from(word: CentroidWord) -> Self {
        match word {
            CentroidWord::Helios => Self::Helios,
            CentroidWord::Utis => Self::Utis,
        }
    }
}
