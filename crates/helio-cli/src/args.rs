//! What was typed: degrees, paths, text. Nothing is opened or computed here.

mod accuracy;
mod convert;
mod flux;
mod spot;

use std::path::PathBuf;
use std::sync::LazyLock;

use clap::parser::ValueSource;
use clap::{Args as ClapArgs, CommandFactory, FromArgMatches, Parser, Subcommand, ValueEnum};
use helio_core::offset::MAX_ITERATIONS;
use helio_core::{OffsetForm, SimdLevel};
use helio_io::output::Format;
pub(crate) use spot::{MarksWord, MethodWord, ShapeWord, SimulateImagesArgs, SpotArgs};

pub(crate) use accuracy::{AcceptWord, AccuracyArgs, SimulateCampaignArgs};
pub(crate) use convert::{Convert, ConvertPaintArgs};
pub(crate) use flux::{DeformWord, FluxArgs, InsteadArgs};

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
                  Shading and blocking are computed by flux alone."
)]
pub(crate) struct Args {
    #[command(subcommand)]
    pub(crate) verb: Verb,
}

impl Args {
    /// What was typed; ends the program where that is nothing to go on.
    pub(crate) fn typed() -> Self {
        let matches = Self::command().get_matches();
        let mut args = Self::from_arg_matches(&matches).unwrap_or_else(|error| error.exit());
        if let Verb::Calibrate(calibrate) = &mut args.verb
            && let Some(matches) = matches.subcommand_matches("calibrate")
        {
            let typed = |id: &&str| matches.value_source(id) == Some(ValueSource::CommandLine);
            calibrate.typed = OF_ONE_BY_ONE.into_iter().filter(typed).collect();
        }
        args
    }
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
    Calibrate(CalibrateArgs),
    Accuracy(Box<AccuracyArgs>),
    Spot(Box<SpotArgs>),
    Flux(Box<FluxArgs>),
    /// Make synthetic fields, observations and camera frames
    Simulate {
        #[command(subcommand)]
        what: Simulate,
    },
    /// Turn records of others into a field and its observations
    Convert {
        #[command(subcommand)]
        what: Convert,
    },
    /// Print the JSON Schema of field.toml, of target.toml, or of scene.toml
    #[command(after_help = "Example:\n  helio-rs schema > field.schema.json\n  \
                            helio-rs schema target > target.schema.json\n  \
                            helio-rs schema scene > scene.schema.json")]
    Schema {
        /// Which file
        #[arg(value_name = "FILE", default_value = "field")]
        of: SchemaWord,
    },
}

impl Verb {
    pub(crate) fn is_quiet(&self) -> bool {
        match self {
            Self::Init(init) => init.quiet,
            Self::Check(check) => check.quiet,
            Self::Track(track) => track.out.quiet,
            Self::Predict(predict) => predict.out.quiet,
            Self::Calibrate(calibrate) => calibrate.out.quiet,
            Self::Accuracy(accuracy) => accuracy.quiet,
            Self::Simulate {
                what: Simulate::Field(field),
            } => field.quiet,
            Self::Simulate {
                what: Simulate::Campaign(campaign),
            } => campaign.quiet,
            Self::Simulate {
                what: Simulate::Observations(observations),
            } => observations.out.quiet,
            Self::Simulate {
                what: Simulate::Images(images),
            } => images.quiet,
            Self::Spot(spot) => spot.out.quiet,
            Self::Flux(flux) => flux.quiet,
            Self::Convert {
                what: Convert::Paint(paint),
            } => paint.quiet,
            Self::Schema { .. } => false,
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
    /// Correct by what calibrate --joint --leftovers wrote along with the field's calibration: adds the
    /// corrections and one standard deviation of what then is still wrong, per axis
    #[arg(long, value_name = "FILE")]
    pub(crate) leftovers: Option<PathBuf>,
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

/// Angular errors of every heliostat from camera observations of its spot
///
/// Reads a table of observations: heliostat_id, time (or sun_azimuth_deg, sun_elevation_deg),
/// axis1_deg, axis2_deg (or azimuth_deg, elevation_deg; or axis1_steps, axis2_steps with a drive),
/// target, u_m, v_m (or spot_east_m, spot_north_m, spot_up_m) and, optionally, sigma_m. Writes a row
/// for each heliostat with observations (and each set of parameters): the six errors, how well each
/// is known, and how well the beams are told; field.toml takes the table as
/// heliostats.calibration. Rows that are not ok have no numbers, so that the layout's errors stay.
///
/// Finished heliostats are kept in OUT.part until the table is written: an interrupted run goes on
/// from there with --resume, to the same bytes.
///
/// With --joint the field is fitted as one, and with --update it is followed from day to day: then every
/// heliostat of the layout has a row, those without observations as the field is, with how far their
/// beams may miss in foretold_mrad.
#[derive(Debug, ClapArgs)]
#[command(
    after_help = "Example:\n  helio-rs simulate observations --field examples/field.toml \
                        --heliostats 3 --out seen.csv\n  \
                        helio-rs calibrate --field examples/field.toml --observations \
                        seen.csv --out calibration.csv\n  \
                        helio-rs calibrate --field examples/field.toml --observations \
                        seen.csv --joint --state s.parquet\n  \
                        helio-rs simulate observations --field examples/field.toml --to \
                        2027-01-01T00:00Z --out new.csv\n  \
                        helio-rs calibrate --field examples/field.toml --observations \
                        new.csv --update s.parquet"
)]
pub(crate) struct CalibrateArgs {
    /// The field.toml
    #[arg(long, value_name = "FILE")]
    pub(crate) field: PathBuf,
    /// Table of observations
    #[arg(long, value_name = "FILE")]
    pub(crate) observations: PathBuf,
    /// Spots as spot writes them, where the table of observations has none of its own: it then names the frame of
    /// each record in a column file, or goes by the frames' times
    #[arg(long, value_name = "FILE")]
    pub(crate) spots: Option<PathBuf>,
    #[command(flatten)]
    pub(crate) joint: JointArgs,
    #[command(flatten)]
    pub(crate) fit: FitArgs,
    /// A page to look at: before and after, residuals, parameters, rejected records; .html
    #[arg(long, value_name = "FILE")]
    pub(crate) report: Option<PathBuf>,
    /// An earlier calibration table: say what changed, by how many mrad over the year, and whether
    /// significantly
    #[arg(long, value_name = "FILE")]
    pub(crate) compare: Option<PathBuf>,
    /// File for the list of rejected records
    #[arg(long, value_name = "FILE")]
    pub(crate) rejected: Option<PathBuf>,
    /// Propose the next N observations of each heliostat, those that lower its predicted pointing
    /// uncertainty most; to --plan-out, or to standard output instead of the calibration
    #[arg(long, value_name = "N", requires = "plan_date", value_parser = clap::value_parser!(u16).range(1..=1000))]
    pub(crate) plan: Option<u16>,
    /// Day of the proposed observations, such as 2026-06-21
    #[arg(long, value_name = "DATE", requires = "plan")]
    pub(crate) plan_date: Option<String>,
    /// File for the proposed observations
    #[arg(long, value_name = "FILE", requires = "plan")]
    pub(crate) plan_out: Option<PathBuf>,
    /// Go on with an interrupted run of the same inputs and options
    #[arg(long, requires = "out")]
    pub(crate) resume: bool,
    #[command(flatten)]
    pub(crate) out: OutArgs,
    /// Which of [`OF_ONE_BY_ONE`] were typed.
    #[arg(skip)]
    pub(crate) typed: Vec<&'static str>,
}

/// Options of a fit heliostat by heliostat that may not hold, or not always, for the field as one.
pub(crate) const OF_ONE_BY_ONE: [&str; 11] = [
    "solver",
    "residual",
    "robust",
    "sets",
    "fit_mirror_offset",
    "hold",
    "prior",
    "keep_all",
    "no_jumps",
    "max_year_pointing_mrad",
    "resume",
];

/// The field as one.
#[derive(Debug, ClapArgs)]
pub(crate) struct JointArgs {
    /// Fit the field as one: what heliostats share, how they differ, how their zero points move; a row
    /// for every heliostat of the layout
    #[arg(long, group = "as_one")]
    pub(crate) joint: bool,
    /// Take new observations into a state that --state wrote; a row for every heliostat
    #[arg(long, value_name = "STATE", group = "as_one")]
    pub(crate) update: Option<PathBuf>,
    /// File for the state, from which --update goes on [default with --update: the same file]
    #[arg(long, value_name = "STATE", requires = "as_one")]
    pub(crate) state: Option<PathBuf>,
    /// File for what the field has in common: sags, shifts of targets, time of the sun
    #[arg(long, value_name = "FILE", requires = "as_one")]
    pub(crate) causes: Option<PathBuf>,
    /// File with a row for each record: how its spot was foretold, and what became of it
    #[arg(long, value_name = "FILE", requires = "as_one")]
    pub(crate) steps: Option<PathBuf>,
    /// File for what is left of the misses as a smooth function of the pose, which track --leftovers takes; looked
    /// for only if asked
    #[arg(
        long,
        value_name = "FILE",
        requires = "joint",
        conflicts_with = "update"
    )]
    pub(crate) leftovers: Option<PathBuf>,
    /// Days after the last record of the field that the rows are for
    #[arg(long, value_name = "DAYS", default_value = "1", requires = "as_one", value_parser = days)]
    pub(crate) ahead: f64,
}

/// How to fit.
#[derive(Debug, ClapArgs)]
pub(crate) struct FitArgs {
    /// Least-squares solver of Guo 2015
    #[arg(long, value_name = "SOLVER", default_value = "hartley-meyer")]
    pub(crate) solver: SolverWord,
    /// What is made small: both components of each spot, or their distance as in the paper
    #[arg(long, value_name = "FORM", default_value = "components")]
    pub(crate) residual: ResidualWord,
    /// How much large residuals count in the last fit
    #[arg(long, value_name = "LOSS", default_value = "none")]
    pub(crate) robust: RobustWord,
    /// Parameter sets over the day: one, two (morning and afternoon), or as many as predict unseen
    /// days best
    #[arg(long, value_name = "SETS", default_value = "1")]
    pub(crate) sets: SetsWord,
    /// Fit the mirror offset as a seventh parameter
    #[arg(long)]
    pub(crate) fit_mirror_offset: bool,
    /// Parameters to keep as the field states them, separated by commas: pedestal_tilt,
    /// axis_nonorthogonality, mirror_tilt, azimuth_reference, elevation_reference, mirror_offset
    #[arg(long, value_name = "NAMES", value_delimiter = ',')]
    pub(crate) hold: Vec<String>,
    /// What is known of a parameter: NAME=MEAN:SD, degrees (metres for mirror_offset); may be
    /// repeated
    #[arg(long, value_name = "NAME=MEAN:SD", allow_hyphen_values = true)]
    pub(crate) prior: Vec<String>,
    /// Keep every record that is a number
    #[arg(long)]
    pub(crate) keep_all: bool,
    /// Do not look for jumps of the encoder references
    #[arg(long)]
    pub(crate) no_jumps: bool,
    /// Refuse parameters whose predicted pointing uncertainty over the year is larger, in mrad
    #[arg(long, value_name = "MRAD", default_value = "2", value_parser = mrad)]
    pub(crate) max_year_pointing_mrad: f64,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum SolverWord {
    HartleyMeyer,
    GaussNewton,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum ResidualWord {
    Components,
    Distance,
    /// Components across the beam, as beam_rms_mrad counts them
    Beam,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum RobustWord {
    None,
    Huber,
    StudentT,
    Cauchy,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum SetsWord {
    #[value(name = "1")]
    One,
    #[value(name = "2")]
    Two,
    Auto,
}

/// The word that somebody types for a value.
pub(crate) fn word(value: impl ValueEnum) -> String {
    value
        .to_possible_value()
        .map_or(String::new(), |value| value.get_name().to_owned())
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
    Observations(Box<SimulateObservationsArgs>),
    Campaign(Box<SimulateCampaignArgs>),
    Images(Box<SimulateImagesArgs>),
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum SchemaWord {
    /// field.toml
    Field,
    /// target.toml
    Target,
    /// scene.toml
    Scene,
}

/// Synthetic camera observations of a field: what calibrate reads
///
/// Each heliostat is seen on the targets that have a plane and face it, at random times. Its true
/// errors are those of the field, or drawn at random with --random-errors; --truth writes them
/// down. The same options give the same observations.
#[derive(Debug, ClapArgs)]
#[command(
    after_help = "Example:\n  helio-rs simulate observations --field examples/field.toml \
                        --heliostats 3 --out seen.csv"
)]
pub(crate) struct SimulateObservationsArgs {
    /// The field.toml
    #[arg(long, value_name = "FILE")]
    pub(crate) field: PathBuf,
    /// Heliostats to observe, evenly over the field [default: all]
    #[arg(long, value_name = "N", conflicts_with = "ids", value_parser = clap::value_parser!(u32).range(1..))]
    pub(crate) heliostats: Option<u32>,
    /// Heliostats to observe, separated by commas
    #[arg(long, value_name = "IDS", value_delimiter = ',')]
    pub(crate) ids: Option<Vec<String>>,
    /// Targets to see spots on, separated by commas [default: all that have a plane]
    #[arg(long, value_name = "NAMES", value_delimiter = ',')]
    pub(crate) target: Option<Vec<String>>,
    /// Observations of each heliostat
    #[arg(long, value_name = "N", default_value = "50", value_parser = clap::value_parser!(u32).range(1..=1_000_000))]
    pub(crate) count: u32,
    /// Of all random numbers
    #[arg(long, value_name = "N", default_value = "1")]
    pub(crate) seed: u64,
    /// No observation is earlier
    #[arg(long, value_name = "TIME", default_value = "2025-01-01T00:00:00Z")]
    pub(crate) from: String,
    /// All observations are earlier
    #[arg(long, value_name = "TIME", default_value = "2026-01-01T00:00:00Z")]
    pub(crate) to: String,
    /// On so many days only, chosen at random
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=100_000))]
    pub(crate) days: Option<u32>,
    /// Local solar time from and to, in hours, such as 9-15
    #[arg(long, value_name = "HOURS", default_value = "0-24", value_parser = hours)]
    pub(crate) hours: Hours,
    /// Lowest sun, in degrees
    #[arg(long, value_name = "DEG", default_value = "10", value_parser = elevation)]
    pub(crate) min_sun_elevation_deg: f64,
    /// One standard deviation of either component of the spot, as seen from the heliostat
    #[arg(long, value_name = "MRAD", default_value = "0.5", value_parser = any_mrad)]
    pub(crate) noise_mrad: f64,
    /// Share of observations whose spot is found in a wrong place, 0 to 1
    #[arg(long, value_name = "SHARE", default_value = "0", value_parser = share)]
    pub(crate) outliers: f64,
    /// By how much: from this to twice this
    #[arg(long, value_name = "MRAD", default_value = "10", value_parser = any_mrad)]
    pub(crate) outlier_mrad: f64,
    /// Share of observations that are a neighbour's, 0 to 1
    #[arg(long, value_name = "SHARE", default_value = "0", value_parser = share)]
    pub(crate) wrong_heliostat: f64,
    /// Share of observations that name another target than the one lit, 0 to 1
    #[arg(long, value_name = "SHARE", default_value = "0", value_parser = share)]
    pub(crate) wrong_target: f64,
    /// A jump of the encoder references, TIME,AXIS1_MRAD,AXIS2_MRAD; may be repeated
    #[arg(long, value_name = "JUMP", allow_hyphen_values = true)]
    pub(crate) jump: Vec<String>,
    /// Draw the true errors at random instead of taking the field's: some milliradians each
    #[arg(long)]
    pub(crate) random_errors: bool,
    /// Write motor steps instead of angles, where there is a drive
    #[arg(long)]
    pub(crate) steps: bool,
    /// File for the true errors, as a calibration table
    #[arg(long, value_name = "FILE")]
    pub(crate) truth: Option<PathBuf>,
    #[command(flatten)]
    pub(crate) out: OutArgs,
}

/// Local solar time, from and to \[h\].
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Hours(pub(crate) [f64; 2]);

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

fn any_mrad(text: &str) -> Result<f64, String> {
    number(text, 0.0, 1e6, "milliradians")
}

fn share(text: &str) -> Result<f64, String> {
    number(text, 0.0, 1.0, "parts of one")
}

fn hours(text: &str) -> Result<Hours, String> {
    let wanted = "wanted two hours of the day with - between them, such as 9-15";
    let (from, to) = text.split_once('-').ok_or(wanted)?;
    let hour = |text: &str| number(text.trim(), 0.0, 24.0, "hours").map_err(|_| wanted.to_owned());
    let (from, to) = (hour(from)?, hour(to)?);
    if from < to {
        Ok(Hours([from, to]))
    } else {
        Err(wanted.to_owned())
    }
}

fn days(text: &str) -> Result<f64, String> {
    number(text, 0.0, 366.0, "days")
}

fn mrad(text: &str) -> Result<f64, String> {
    number(text, 1e-6, 1e6, "milliradians")
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
