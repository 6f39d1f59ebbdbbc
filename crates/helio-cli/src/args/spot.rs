//! What was typed for `spot` and `simulate images`.

use std::path::PathBuf;

use clap::{Args as ClapArgs, ValueEnum};
use helio_io::{RawFrames, parse_raw, parse_size, parse_threshold};
use helio_spot::Threshold;

use super::{OutArgs, number, positive_m};

/// Where the spot of each camera frame is on the target
///
/// Reads PNG, TIFF (8 and 16 bit), PNM and JPEG, or raw gray video on standard input, and writes a row for each frame
/// in the order given: file, time (with --start), threshold, area_px, window_px, row, column (the standard's centre),
/// x_px, y_px, u_m, v_m (right and down of the target's centre), sigma_m, flags, status, reason. A frame that
/// cannot be read is a row with the status unreadable and the reason. target.toml says how large the target is, and
/// where a fixed camera sees its corners or which marks to look for in every frame.
#[derive(Debug, ClapArgs)]
#[command(
    after_help = "Example:\n  helio-rs simulate images --frames 3 --seed 1 --out frames\n  \
                  helio-rs spot frames --target frames/target.toml --overlay seen --out spots.csv"
)]
pub(crate) struct SpotArgs {
    /// Frames: files, directories, quoted patterns such as 'run/*.png', @LIST (a file with a path a line), or - for
    /// raw video on standard input
    #[arg(value_name = "FILES", required = true)]
    pub(crate) files: Vec<PathBuf>,
    /// The target.toml
    #[arg(long, value_name = "FILE")]
    pub(crate) target: PathBuf,
    /// How the spot is found
    #[arg(long, value_name = "METHOD", default_value = "robust")]
    pub(crate) method: MethodWord,
    /// Threshold of --method standard: otsu, triangle, fixed:N (a gray value) or multi:N (the brightest of
    /// N classes, 2 to 4) [default: otsu]
    #[arg(long, value_name = "THRESHOLD", value_parser = parse_threshold)]
    pub(crate) threshold: Option<Threshold>,
    /// Where the spot is expected on the target, in metres right and down of its centre, and how closely (one standard
    /// deviation; a tenth of the target unless given): ranks several spots of a frame
    #[arg(long, value_name = "U,V[,SIGMA]", allow_hyphen_values = true, value_parser = expected)]
    pub(crate) expected: Option<ExpectedPlace>,
    /// Gray value from which on the camera cannot tell more [default: 255 or 65535]
    #[arg(long, value_name = "GRAY", value_parser = clap::value_parser!(u32).range(1..=65_535))]
    pub(crate) white: Option<u32>,
    /// Size and format of raw video: WIDTHxHEIGHT, of 8 bit unless :gray16le follows
    #[arg(long, value_name = "WIDTHxHEIGHT[:FORMAT]", value_parser = parse_raw)]
    pub(crate) raw: Option<RawFrames>,
    /// Frames per second, for the times of the rows: each frame, read or not, by its place in the list
    #[arg(long, value_name = "RATE", requires = "start", value_parser = rate)]
    pub(crate) fps: Option<f64>,
    /// Time of the first frame, with its offset from UTC
    #[arg(long, value_name = "TIME", requires = "fps")]
    pub(crate) start: Option<String>,
    /// Take the times of files from the numbers in their names instead (the last digits before the suffix; the first
    /// file is at --start), so that frames which are missing shift none
    #[arg(long, requires = "fps")]
    pub(crate) numbered: bool,
    /// Folder for a picture of each frame with marks, threshold, window and centre drawn in; made if it
    /// does not exist
    #[arg(long, value_name = "DIR")]
    pub(crate) overlay: Option<PathBuf>,
    #[command(flatten)]
    pub(crate) out: OutArgs,
}

/// How a spot is found.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum MethodWord {
    /// Centre of mass of the light that the spot adds to the target
    Robust,
    /// Appendix A of T/GRLM 02-2014 as printed, within the rectangle about the target
    Standard,
}

/// Where a spot is expected \[m\], and one standard deviation.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct ExpectedPlace {
    pub(crate) u_m: f64,
    pub(crate) v_m: f64,
    pub(crate) sigma_m: Option<f64>,
}

/// Synthetic camera frames of a target with a spot on it, and where the spot truly is
///
/// Writes 000001.png, …, truth.csv (file, u_m, v_m, x_px, y_px, share_on_target, on_target_u_m, on_target_v_m) and
/// target.toml into a folder. u_m, v_m is the centre of mass of the whole beam, on_target_… that of the light
/// that falls on the target. Places are drawn at random over the middle of the target; the same options give
/// the same frames. With --observations each record's frame shows its spot, and log.csv has the records with the frames'
/// names in place of the spots.
#[derive(Debug, ClapArgs)]
#[command(
    after_help = "Example:\n  helio-rs simulate images --frames 2 --seed 7 --shape facets \
                        --shadow 0.3 --out frames"
)]
pub(crate) struct SimulateImagesArgs {
    /// Folder for frames, truth.csv and target.toml; made if it does not exist
    #[arg(long, value_name = "DIR")]
    pub(crate) out: PathBuf,
    /// Number of frames
    #[arg(long, value_name = "N", default_value = "10", value_parser = clap::value_parser!(u32).range(1..=1_000_000))]
    pub(crate) frames: u32,
    /// Table of observations (CSV, as simulate observations writes it) whose spots are to be seen, a frame each
    #[arg(long, value_name = "FILE", conflicts_with_all = ["frames", "empty_every"])]
    pub(crate) observations: Option<PathBuf>,
    /// Of all random numbers
    #[arg(long, value_name = "N", default_value = "1")]
    pub(crate) seed: u64,
    /// Pixels of a frame
    #[arg(long, value_name = "WIDTHxHEIGHT", default_value = "768x576", value_parser = parse_size)]
    pub(crate) size: (usize, usize),
    /// Bits of a gray value
    #[arg(long, value_name = "BITS", default_value = "8", value_parser = ["8", "16"])]
    pub(crate) bits: String,
    /// Width of the target, in metres
    #[arg(long, value_name = "M", default_value = "8", value_parser = positive_m)]
    pub(crate) width_m: f64,
    /// Height of the target, in metres
    #[arg(long, value_name = "M", default_value = "7", value_parser = positive_m)]
    pub(crate) height_m: f64,
    /// Marks of the target
    #[arg(long, value_name = "MARKS", default_value = "four-corners")]
    pub(crate) marks: MarksWord,
    /// Shape of the beam
    #[arg(long, value_name = "SHAPE", default_value = "gaussian")]
    pub(crate) shape: ShapeWord,
    /// Standard deviation of the beam, or radius of a flat top, in metres
    #[arg(long, value_name = "M", default_value = "0.6", value_parser = positive_m)]
    pub(crate) beam_m: f64,
    /// What the beam's brightest place adds, in parts of white
    #[arg(long, value_name = "PART", default_value = "0.35", value_parser = part)]
    pub(crate) peak: f64,
    /// Daylight on the target, in parts of white
    #[arg(long, value_name = "PART", default_value = "0.5", value_parser = part)]
    pub(crate) daylight: f64,
    /// Relative change of the daylight over the width of the target
    #[arg(long, value_name = "PART", default_value = "0", value_parser = share)]
    pub(crate) gradient: f64,
    /// Share of the daylight that a shadow with a slanting edge takes
    #[arg(long, value_name = "PART", default_value = "0", value_parser = share)]
    pub(crate) shadow: f64,
    /// Relative depth of the fabric's folds
    #[arg(long, value_name = "PART", default_value = "0.01", value_parser = share)]
    pub(crate) texture: f64,
    /// Standard deviation of the noise of a pixel, in parts of white
    #[arg(long, value_name = "PART", default_value = "0.005", value_parser = share)]
    pub(crate) noise: f64,
    /// How far the camera stands to the left, as an angle at the target
    #[arg(long, value_name = "DEG", default_value = "0", allow_hyphen_values = true, value_parser = slant)]
    pub(crate) turn_deg: f64,
    /// How far the camera stands below, as an angle at the target
    #[arg(long, value_name = "DEG", default_value = "0", allow_hyphen_values = true, value_parser = slant)]
    pub(crate) tilt_deg: f64,
    /// How far the picture is turned clockwise
    #[arg(long, value_name = "DEG", default_value = "0", allow_hyphen_values = true, value_parser = slant)]
    pub(crate) roll_deg: f64,
    /// Radial distortion k1 of the lens, whose focal length is the picture's width
    #[arg(long, value_name = "K1", default_value = "0", allow_hyphen_values = true, value_parser = distortion)]
    pub(crate) distortion: f64,
    /// A second beam, with so much of the light of the first
    #[arg(long, value_name = "PART", default_value = "0", value_parser = part)]
    pub(crate) second: f64,
    /// Stray light beyond the right edge, in parts of white at its brightest
    #[arg(long, value_name = "PART", default_value = "0", value_parser = part)]
    pub(crate) stray: f64,
    /// Frames in which there is no beam: every N-th
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..))]
    pub(crate) empty_every: Option<u32>,
    /// Leave the corners out of target.toml, so that marks are looked for
    #[arg(long)]
    pub(crate) find_marks: bool,
    /// Say nothing but errors
    #[arg(short, long)]
    pub(crate) quiet: bool,
    /// Threads to use [default: all processors]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=1024))]
    pub(crate) threads: Option<u16>,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum MarksWord {
    FourCorners,
    TwoPanelUpper,
    TwoPanelLower,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum ShapeWord {
    Gaussian,
    /// Twice as long as wide, slanting
    Ellipse,
    FlatTop,
    /// Sixteen images that do not quite meet
    Facets,
}

fn expected(text: &str) -> Result<ExpectedPlace, String> {
    let wanted = "wanted two or three numbers of metres, such as 0.5,-0.2 or 0.5,-0.2,0.3";
    let parts: Vec<f64> = text
        .split(',')
        .map(|part| number(part.trim(), -1e4, 1e4, "metres").map_err(|_| wanted.to_owned()))
        .collect::<Result<_, _>>()?;
    match parts[..] {
        [u_m, v_m] => Ok(ExpectedPlace {
            u_m,
            v_m,
            sigma_m: None,
        }),
        [u_m, v_m, sigma_m] if sigma_m > 0.0 => Ok(ExpectedPlace {
            u_m,
            v_m,
            sigma_m: Some(sigma_m),
        }),
        _ => Err(format!("{wanted}; the third above 0")),
    }
}

fn rate(text: &str) -> Result<f64, String> {
    number(text, 1e-6, 1e6, "frames per second")
}

fn part(text: &str) -> Result<f64, String> {
    number(text, 0.0, 1e3, "parts of white")
}

fn share(text: &str) -> Result<f64, String> {
    number(text, 0.0, 1.0, "parts of one")
}

fn slant(text: &str) -> Result<f64, String> {
    number(text, -60.0, 60.0, "degrees")
}

fn distortion(text: &str) -> Result<f64, String> {
    number(text, -0.5, 0.5, "r²")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn words_are_read_or_refused_with_what_is_wanted() {
        assert_eq!(expected("0.5,-0.2").map(|e| e.v_m), Ok(-0.2));
        for text in ["1", "1,2,0", "1,2,3,4", "1,nan", "a,b"] {
            assert!(expected(text).is_err(), "{text}");
        }
    }
}
