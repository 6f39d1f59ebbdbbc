//! What was typed for `accuracy` and `simulate campaign`.

use std::path::PathBuf;

use clap::{Args as ClapArgs, ValueEnum};

use super::{any_mrad, number, positive_m, share};

/// Tracking accuracy of a heliostat from a campaign of spots and the weather: the report of T/GRLM 02-2014
///
/// Reads a table of spots as spot writes it (file, time, u_m, v_m, sigma_m, status and more) and a weather record (time,
/// wind_m_s or wind_half_height_m_s, wind_full_height_m_s, wind_above_m_s, dni_w_m2, air_temperature_c), and writes
/// what they say as JSON: verdict, shares of frames within 3.5 mrad at 4, 8 and 11 m/s of wind with their intervals,
/// accuracy, precision, bias, what was left out and why, and the standard clause by clause. --report makes a page of it
/// to sign.
///
/// Frames that are left out, by light, air or quality or because the weather record has a gap, are counted by reason;
/// with any of them the exit status is 1.
#[derive(Debug, ClapArgs)]
#[command(
    after_help = "Example:\n  helio-rs simulate campaign --minutes 20 --spots spots.csv --weather weather.csv\n  \
                  helio-rs accuracy --spots spots.csv --weather weather.csv --slant-m 100 --report accuracy.html \
                  --out accuracy.json"
)]
pub(crate) struct AccuracyArgs {
    /// Table of spots
    #[arg(long, value_name = "FILE")]
    pub(crate) spots: PathBuf,
    /// Weather record; without it there is neither wind nor verdict
    #[arg(long, value_name = "FILE")]
    pub(crate) weather: Option<PathBuf>,
    /// Distance from the heliostat's centre of rotation to the aim point, in metres
    #[arg(long, value_name = "M", value_parser = positive_m)]
    pub(crate) slant_m: f64,
    /// Aim point on the target, in metres right and down of its centre
    #[arg(long, value_name = "U,V", default_value = "0,0", allow_hyphen_values = true, value_parser = point)]
    pub(crate) aim: Two,
    /// Where the heliostat stands as seen from the aim point: degrees right of and below the target's normal, right as
    /// a camera facing the target sees it; for the angle as clause 3.2 defines it
    #[arg(long, value_name = "RIGHT,BELOW", allow_hyphen_values = true, value_parser = direction)]
    pub(crate) heliostat_at_deg: Option<Two>,
    /// Limits of another guideline, as TOML [default: those of T/GRLM 02-2014]
    #[arg(long, value_name = "FILE")]
    pub(crate) limits: Option<PathBuf>,
    /// What is to be said of laboratory, instruments and their uncertainty, as TOML
    #[arg(long, value_name = "FILE")]
    pub(crate) campaign: Option<PathBuf>,
    /// Frames within so much of a limit's wind are judged by it, in m/s
    #[arg(long, value_name = "M/S", default_value = "1", value_parser = half_width)]
    pub(crate) bin_half_width_m_s: f64,
    /// Width of the bins of figure 3, in m/s
    #[arg(long, value_name = "M/S", default_value = "1", value_parser = step)]
    pub(crate) histogram_step_m_s: f64,
    /// How often intervals hold the truth
    #[arg(long, value_name = "SHARE", default_value = "0.95", value_parser = confidence)]
    pub(crate) confidence: f64,
    /// Longest time between weather rows that frames between them may use, in seconds
    #[arg(long, value_name = "S", default_value = "60", value_parser = gap)]
    pub(crate) weather_gap_s: f64,
    /// Statuses besides ok whose spots count, separated by commas
    #[arg(long, value_name = "STATUSES", value_delimiter = ',')]
    pub(crate) accept: Vec<AcceptWord>,
    /// The report to look at and to sign; .html
    #[arg(long, value_name = "FILE")]
    pub(crate) report: Option<PathBuf>,
    /// Table of every frame with its error, wind and status; .csv, .parquet, .json or .jsonl
    #[arg(long, value_name = "FILE")]
    pub(crate) frames: Option<PathBuf>,
    /// File for what was found; .json [default: standard output]
    #[arg(long, value_name = "FILE")]
    pub(crate) out: Option<PathBuf>,
    /// Say nothing but errors
    #[arg(short, long)]
    pub(crate) quiet: bool,
}

/// A status whose spots have a position.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum AcceptWord {
    Cut,
    Saturated,
    Ambiguous,
}

/// Two numbers.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Two(pub(crate) [f64; 2]);

/// A synthetic campaign: what accuracy reads
///
/// The heliostat swings about its mean, the more the stronger the wind, which goes up and down between 0 and 15 m/s; the
/// sky is clear. The same options give the same campaign.
#[derive(Debug, ClapArgs)]
#[command(
    after_help = "Example:\n  helio-rs simulate campaign --minutes 60 --gust-mrad 1.4 --spots spots.csv \
                  --weather weather.csv"
)]
pub(crate) struct SimulateCampaignArgs {
    /// File for the spots; its suffix chooses the format
    #[arg(long, value_name = "FILE")]
    pub(crate) spots: PathBuf,
    /// File for the weather record; its suffix chooses the format
    #[arg(long, value_name = "FILE")]
    pub(crate) weather: PathBuf,
    /// Of all random numbers
    #[arg(long, value_name = "N", default_value = "1")]
    pub(crate) seed: u64,
    /// How long
    #[arg(long, value_name = "N", default_value = "60", value_parser = clap::value_parser!(u32).range(1..=10_000))]
    pub(crate) minutes: u32,
    /// Frames per second
    #[arg(long, value_name = "N", default_value = "15", value_parser = clap::value_parser!(u16).range(1..=1000))]
    pub(crate) frames_per_s: u16,
    /// Distance of the heliostat, in metres
    #[arg(long, value_name = "M", default_value = "100", value_parser = positive_m)]
    pub(crate) slant_m: f64,
    /// Swing of either component without wind, one standard deviation
    #[arg(long, value_name = "MRAD", default_value = "0.5", value_parser = any_mrad)]
    pub(crate) calm_mrad: f64,
    /// What a wind of 10 m/s adds to it; grows with the wind's square
    #[arg(long, value_name = "MRAD", default_value = "1", value_parser = any_mrad)]
    pub(crate) gust_mrad: f64,
    /// Time in which a swing is forgotten but for 1/e, in seconds
    #[arg(long, value_name = "S", default_value = "0.3", value_parser = gap)]
    pub(crate) memory_s: f64,
    /// Share of frames without a spot, 0 to 1
    #[arg(long, value_name = "SHARE", default_value = "0", value_parser = share)]
    pub(crate) empty: f64,
    /// Say nothing but errors
    #[arg(short, long)]
    pub(crate) quiet: bool,
}

fn two(text: &str, most: f64, unit: &str) -> Result<Two, String> {
    let wanted =
        || format!("wanted two numbers of {unit} in -{most}..={most} with a comma between them");
    let (first, second) = text.split_once(',').ok_or_else(wanted)?;
    let one = |text: &str| number(text.trim(), -most, most, unit).map_err(|_| wanted());
    Ok(Two([one(first)?, one(second)?]))
}

fn point(text: &str) -> Result<Two, String> {
    two(text, 1000.0, "metres")
}

fn direction(text: &str) -> Result<Two, String> {
    two(text, 89.0, "degrees")
}

fn half_width(text: &str) -> Result<f64, String> {
    number(text, 0.01, 20.0, "m/s")
}

fn step(text: &str) -> Result<f64, String> {
    number(text, 0.1, 20.0, "m/s")
}

fn confidence(text: &str) -> Result<f64, String> {
    number(text, 0.5, 0.9999, "parts of one")
}

fn gap(text: &str) -> Result<f64, String> {
    number(text, 0.0, 86_400.0, "seconds")
}
