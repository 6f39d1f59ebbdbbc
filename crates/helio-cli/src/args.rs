//! What was typed: degrees, paths, text. Nothing is opened or computed here.

use std::path::PathBuf;
use std::sync::LazyLock;

use clap::{Args as ClapArgs, Parser, Subcommand, ValueEnum};
use helio_core::offset::MAX_ITERATIONS;
use helio_core::{OffsetForm, SimdLevel};
use helio_io::output::Format;

/// Said wherever somebody might expect it.
pub(crate) const NO_SHADING: &str = "Shading and blocking are not computed.";

/// Axis angles of whole heliostat fields.
#[derive(Debug, Parser)]
#[command(
    name = "helio-rs",
    version = version(),
    propagate_version = false,
    subcommand_required = true,
    arg_required_else_help = true,
    after_help = "Files: field.toml describes a field and names the table of its heliostats; \
                  `helio-rs init DIR` writes one to start from, `helio-rs schema` lists its keys.\n\
                  Data goes to standard output or --out, talk to standard error.\n\
                  Exit status: 0 good, 1 some rows have a status other than ok or \
                  sun_below_horizon, 2 refused.\n\
                  Shading and blocking are not computed."
)]
pub(crate) struct Args {
    #[command(subcommand)]
    pub(crate) verb: Verb,
}

/// Name, version, kind of build and what the processor offers.
fn version() -> &'static str {
    static VERSION: LazyLock<String> = LazyLock::new(|| {
        let profile = if cfg!(debug_assertions) {
            "debug"
        } else {
            "release"
        };
        let (arch, os) = (std::env::consts::ARCH, std::env::consts::OS);
        let level = SimdLevel::best();
        format!(
            "{} ({profile} build for {arch}-{os}, instruction set {level})",
            env!("CARGO_PKG_VERSION")
        )
    });
    &VERSION
}

#[derive(Debug, Subcommand)]
pub(crate) enum Verb {
    Init(InitArgs),
    Check(CheckArgs),
    Track(TrackArgs),
    Predict(PredictArgs),
    /// Make synthetic fields
    Simulate {
        #[command(subcommand)]
        what: Simulate,
    },
    /// Print the JSON Schema of field.toml
    #[command(after_help = "Example:\n  helio-rs schema > field.schema.json")]
    Schema,
}

impl Verb {
    pub(crate) fn is_quiet(&self) -> bool {
        match self {
            Self::Init(init) => init.quiet,
            Self::Check(check) => check.quiet,
            Self::Track(track) => track.out.quiet,
            Self::Predict(predict) => predict.out.quiet,
            Self::Simulate {
                what: Simulate::Field(field),
            } => field.quiet,
            Self::Schema => false,
        }
    }
}

/// Write a commented field.toml with a generated layout
#[derive(Debug, ClapArgs)]
#[command(after_help = "Example:\n  helio-rs init my-field\n  \
                        helio-rs track --field my-field/field.toml --time 2026-06-21T12:00:00Z")]
pub(crate) struct InitArgs {
    /// Folder for field.toml and heliostats.csv; made if it does not exist
    #[arg(value_name = "DIR")]
    pub(crate) dir: PathBuf,
    /// Replace files that are there
    #[arg(long)]
    pub(crate) force: bool,
    /// Say nothing
    #[arg(short, long)]
    pub(crate) quiet: bool,
}

/// Read everything, and say what is there and whether it can work
///
/// Prints counts, ranges, tracking mode, drives, where the sun stands now, and which rows the
/// heliostats can reach over a year of sun positions.
#[derive(Debug, ClapArgs)]
#[command(after_help = "Example:\n  helio-rs check --field examples/field.toml")]
pub(crate) struct CheckArgs {
    /// The field.toml
    #[arg(long, value_name = "FILE")]
    pub(crate) field: PathBuf,
    /// Say nothing but the report
    #[arg(short, long)]
    pub(crate) quiet: bool,
}

/// Axis angles of every heliostat, for one sun or many
///
/// Rows come sun by sun, heliostats in field order, as CSV, Parquet, JSON or JSON lines. The sun is
/// that of --time, of a range of times, or given by its angles; given angles win over a time.
/// Without any of them it is the sun of now. Shading and blocking are not computed.
#[derive(Debug, ClapArgs)]
#[command(after_help = "Example:\n  helio-rs track --field examples/field.toml \
                        --time 2026-06-21T12:00:00Z --out angles.csv")]
pub(crate) struct TrackArgs {
    /// The field.toml
    #[arg(long, value_name = "FILE")]
    pub(crate) field: PathBuf,
    #[command(flatten)]
    pub(crate) sun: SunArgs,
    /// First of a range of times; needs --to and --step
    #[arg(long, value_name = "TIME", requires_all = ["to", "step"], conflicts_with = "time")]
    pub(crate) from: Option<String>,
    /// Last of a range of times
    #[arg(long, value_name = "TIME", requires = "from")]
    pub(crate) to: Option<String>,
    /// Step of a range of times, such as 10s, 1min or 1h
    #[arg(
        long,
        value_name = "STEP",
        requires = "from",
        allow_hyphen_values = true
    )]
    pub(crate) step: Option<String>,
    /// Table of suns: columns azimuth_deg, elevation_deg
    #[arg(long, value_name = "FILE", conflicts_with_all = ["sun_azimuth_deg", "sun_elevation_deg"])]
    pub(crate) suns: Option<PathBuf>,
    /// How the mirror's offset from the pivot is taken into account: exact, approximate,
    /// iterated:N or none
    #[arg(long, value_name = "FORM", default_value = "exact", value_parser = offset)]
    pub(crate) offset: OffsetForm,
    /// Where the axes stand now (columns id, axis1_deg, axis2_deg): the shortest travel from there,
    /// and from one sun to the next
    #[arg(long, value_name = "FILE")]
    pub(crate) present: Option<PathBuf>,
    /// The shortest travel from one sun to the next, beginning anywhere
    #[arg(long)]
    pub(crate) continuous: bool,
    /// Follow each beam back to the target, through whole motor steps where there is a drive: adds
    /// the column beam_error_mrad
    #[arg(long)]
    pub(crate) verify: bool,
    /// Draw the field from above (at the highest of several suns) and, for several suns, angle
    /// curves; .svg or .html
    #[arg(long, value_name = "FILE")]
    pub(crate) plot: Option<PathBuf>,
    /// What colours the heliostats of the plot
    #[arg(
        long,
        value_name = "WHAT",
        default_value = "azimuth",
        requires = "plot"
    )]
    pub(crate) plot_colour: PlotColour,
    /// Heliostats whose angle curves are drawn, separated by commas [default: four of the field]
    #[arg(long, value_name = "IDS", value_delimiter = ',', requires = "plot")]
    pub(crate) plot_heliostats: Option<Vec<String>>,
    #[command(flatten)]
    pub(crate) out: OutArgs,
}

/// Where each beam lands, from axis angles or motor steps
///
/// Reads a table with id and axis1_deg, axis2_deg (or azimuth_deg, elevation_deg; or axis1_steps,
/// axis2_steps with a drive) and, optionally, time or sun_azimuth_deg, sun_elevation_deg: what track
/// writes can be read back. Beams land on the heliostat's target, on its own aim point's plane if
/// it has none: u_m to the right and v_m down as a camera facing the target sees them. The whole
/// table is held in memory; cut very long ones into several.
/// Shading and blocking are not computed.
#[derive(Debug, ClapArgs)]
#[command(
    after_help = "Example:\n  helio-rs predict --field examples/field.toml --angles angles.csv"
)]
pub(crate) struct PredictArgs {
    /// The field.toml
    #[arg(long, value_name = "FILE")]
    pub(crate) field: PathBuf,
    /// Table of axis angles or motor steps
    #[arg(long, value_name = "FILE")]
    pub(crate) angles: PathBuf,
    #[command(flatten)]
    pub(crate) sun: SunArgs,
    #[command(flatten)]
    pub(crate) out: OutArgs,
}

/// One sun.
#[derive(Debug, ClapArgs)]
pub(crate) struct SunArgs {
    /// Time with its offset from UTC, such as 2026-06-21T12:00:00Z or 2026-06-21T14:00+02:00
    #[arg(long, value_name = "TIME")]
    pub(crate) time: Option<String>,
    /// Azimuth of the sun, clockwise from north, in degrees
    #[arg(long, value_name = "DEG", allow_hyphen_values = true, requires = "sun_elevation_deg",
          value_parser = azimuth)]
    pub(crate) sun_azimuth_deg: Option<f64>,
    /// Apparent elevation of the sun above the horizon, in degrees
    #[arg(long, value_name = "DEG", allow_hyphen_values = true, requires = "sun_azimuth_deg",
          value_parser = elevation)]
    pub(crate) sun_elevation_deg: Option<f64>,
}

#[derive(Debug, ClapArgs)]
pub(crate) struct OutArgs {
    /// File for the rows; its suffix chooses the format [default: standard output, CSV]
    #[arg(long, value_name = "FILE")]
    pub(crate) out: Option<PathBuf>,
    /// Format of the rows, whatever the suffix
    #[arg(long, value_name = "FORMAT")]
    pub(crate) format: Option<FormatWord>,
    /// Say nothing but errors
    #[arg(short, long)]
    pub(crate) quiet: bool,
    /// Threads to use [default: all processors]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=1024))]
    pub(crate) threads: Option<u16>,
}

#[derive(Debug, Subcommand)]
pub(crate) enum Simulate {
    Field(SimulateFieldArgs),
}

/// A generated layout: a table of heliostats
///
/// Radial-staggered rings or a Fermat spiral around a tower at the origin, without two heliostats
/// closer than they can turn. The same options give the same field.
#[derive(Debug, ClapArgs)]
#[command(after_help = "Example:\n  helio-rs simulate field --heliostats 1000 \
                        --layout fermat-spiral --out heliostats.csv")]
pub(crate) struct SimulateFieldArgs {
    /// Number of heliostats
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=100_000_000))]
    pub(crate) heliostats: u32,
    /// Pattern
    #[arg(long, value_name = "PATTERN", default_value = "radial-staggered")]
    pub(crate) layout: LayoutWord,
    /// Height of the target above the pivots, in metres
    #[arg(long, value_name = "M", default_value = "120", value_parser = positive_m)]
    pub(crate) tower_height_m: f64,
    /// Width of a mirror, in metres
    #[arg(long, value_name = "M", default_value = "11", value_parser = positive_m)]
    pub(crate) mirror_width_m: f64,
    /// Height of a mirror, in metres
    #[arg(long, value_name = "M", default_value = "10", value_parser = positive_m)]
    pub(crate) mirror_height_m: f64,
    /// Height of the pivots above the ground, in metres
    #[arg(long, value_name = "M", default_value = "6", value_parser = positive_m)]
    pub(crate) pivot_height_m: f64,
    /// File for the table: .csv, .parquet, .json or .jsonl [default: standard output, CSV]
    #[arg(long, value_name = "FILE")]
    pub(crate) out: Option<PathBuf>,
    /// Format of the table, whatever the suffix
    #[arg(long, value_name = "FORMAT")]
    pub(crate) format: Option<FormatWord>,
    /// Say nothing but errors
    #[arg(short, long)]
    pub(crate) quiet: bool,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum LayoutWord {
    RadialStaggered,
    FermatSpiral,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum PlotColour {
    Azimuth,
    Elevation,
    Incidence,
    Status,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum FormatWord {
    Csv,
    Parquet,
    Json,
    Jsonl,
}

impl From<FormatWord> for Format {
    fn from(word: FormatWord) -> Self {
        match word {
            FormatWord::Csv => Self::Csv,
            FormatWord::Parquet => Self::Parquet,
            FormatWord::Json => Self::Json,
            FormatWord::Jsonl => Self::JsonLines,
        }
    }
}

fn offset(text: &str) -> Result<OffsetForm, String> {
    match text {
        "exact" => Ok(OffsetForm::Exact),
        "approximate" => Ok(OffsetForm::Approximate),
        "none" => Ok(OffsetForm::None),
        _ => match text.strip_prefix("iterated:").map(str::parse) {
            Some(Ok(times)) if (1..=MAX_ITERATIONS).contains(&times) => {
                Ok(OffsetForm::Iterated(times))
            }
            Some(_) => Err(format!(
                "iterated: wants a number of iterations in 1..={MAX_ITERATIONS}, such as iterated:2"
            )),
            None => Err("wanted exact, approximate, iterated:N or none".into()),
        },
    }
}

fn azimuth(text: &str) -> Result<f64, String> {
    number(text, -360.0, 360.0, "degrees")
}

fn elevation(text: &str) -> Result<f64, String> {
    number(text, -90.0, 90.0, "degrees")
}

fn positive_m(text: &str) -> Result<f64, String> {
    number(text, 0.01, 10_000.0, "metres")
}

fn number(text: &str, min: f64, max: f64, unit: &str) -> Result<f64, String> {
    let wanted = format!("wanted a number of {unit} in {min}..={max}");
    let value: f64 = text.parse().map_err(|_| wanted.clone())?;
    if (min..=max).contains(&value) {
        Ok(value)
    } else {
        Err(wanted)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use clap::CommandFactory;

    #[test]
    fn the_command_line_is_consistent() {
        Args::command().debug_assert();
    }

    #[test]
    fn offsets_and_numbers_are_read() {
        assert_eq!(offset("iterated:3"), Ok(OffsetForm::Iterated(3)));
        assert!(
            ["iterated:", "iterated:0", "fast"]
                .iter()
                .all(|text| offset(text).is_err())
        );
        assert_eq!(azimuth("-90.5"), Ok(-90.5));
        assert!(azimuth("NaN").is_err() && elevation("90.1").is_err() && azimuth("inf").is_err());
    }
}
