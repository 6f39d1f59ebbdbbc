//! `simulate images`: synthetic camera frames with their truth.

use std::collections::HashMap;
use std::path::Path;
use std::sync::Mutex;
use std::sync::atomic::Ordering;

use helio_core::angle::radians;
use helio_io::output::{Cells, Destination, Format, write_columns};
use helio_io::{
    IoError, ObservationLog, Sha256, hash_file, load_observation_log, target_toml, write_file,
    write_frame,
};
use helio_spot::simulate::{
    Beam, BeamShape, Camera, Daylight, Depth, Pose, Scene, Sensor, Shadow, Truth,
};
use helio_spot::{Board, Lens, LensValues, Marks};
use rayon::prelude::*;

use super::track::stop_on_signals;
use crate::Outcome;
use crate::args::{MarksWord, ShapeWord, SimulateImagesArgs};
use crate::failure::Failure;
use crate::plan;
use crate::printer::{Counted, Printer};

pub(crate) fn run(args: &SimulateImagesArgs, printer: &Printer) -> Result<Outcome, Failure> {
    plan::threads(args.threads)?;
    let (scene, lens) = scene(args)?;
    let log = args
        .observations
        .as_deref()
        .map(load_observation_log)
        .transpose()?;
    let frames = log
        .as_ref()
        .map_or(args.frames, |log| log.spots_m.len() as u32);
    let folder = args.out.as_path();
    let earlier = check_folder(folder, frames, log.is_some())?;
    std::fs::create_dir_all(folder).map_err(|error| IoError::write(folder, error))?;
    for name in &earlier.more {
        let path = folder.join(name);
        std::fs::remove_file(&path).map_err(|error| IoError::write(&path, error))?;
    }
    let stop = stop_on_signals();
    let progress = Mutex::new(printer.progress_of(u64::from(frames), "frames"));
    let truths = (1..=frames)
        .into_par_iter()
        .map(|number| {
            if stop.load(Ordering::Relaxed) {
                return Err(Failure::Interrupted { streamed: false });
            }
            let spot_m = log.as_ref().map(|log| log.spots_m[number as usize - 1]);
            let truth = frame(args, &scene, number, spot_m, folder)?;
            if let Ok(mut progress) = progress.lock() {
                progress.advance(1);
            }
            Ok(truth)
        })
        .collect::<Vec<Result<Truth, Failure>>>()
        .into_iter()
        .collect::<Result<Vec<Truth>, Failure>>()?;
    write_truth(folder, &truths)?;
    if let Some(log) = &log {
        write_log(folder, log)?;
    }
    let mut text = target_toml(
        &scene.board,
        &truths[0].corners_px,
        args.size.into(),
        lens.as_ref(),
    );
    if args.find_marks {
        text = text
            .lines()
            .filter(|line| !line.starts_with("corners_px") && !line.starts_with('#'))
            .map(|line| match line.starts_with("corners_sigma_px") {
                true => "marks_sigma_m = 0.0",
                false => line,
            })
            .fold(String::new(), |text, line| text + line + "\n");
    }
    let text = sums(folder, log.is_some() || earlier.log, &text)? + &text;
    write_file(&folder.join(TARGET), text.as_bytes())?;
    printer.say(format_args!(
        "{} with {}truth.csv and target.toml in {}",
        Counted(truths.len(), "frame"),
        if log.is_some() { "log.csv, " } else { "" },
        folder.display()
    ));
    Ok(Outcome::Good)
}

const TARGET: &str = "target.toml";
const TRUTH: &str = "truth.csv";
const LOG: &str = "log.csv";

/// The first line of a target.toml that this program may write over.
const OURS: &str = "# Written by helio-rs simulate images, which replaces what it wrote as long as these sums (SHA-256) hold:";
/// What the last of the sums is of.
const REST: &str = "the lines below";

/// The lines that tell next time what was written: the sums of the tables, and of the text they stand before.
fn sums(folder: &Path, log: bool, text: &str) -> Result<String, Failure> {
    let mut lines = format!("{OURS}\n");
    for name in [Some(TRUTH), log.then_some(LOG)].into_iter().flatten() {
        let sum = hash_file(&folder.join(name))?;
        lines.push_str(&format!("# {sum} {name}\n"));
    }
    lines.push_str(&format!("# {} {REST}\n", sum_of(text)));
    Ok(lines)
}

fn sum_of(text: &str) -> String {
    let mut sum = Sha256::default();
    sum.update(text.as_bytes());
    sum.finish()
}

/// The sums that a target.toml of this program begins with, by what they are of; none if it is somebody else's or was
/// changed.
fn sums_of(text: &str) -> Option<HashMap<&str, &str>> {
    let mut rest = text.strip_prefix(OURS)?.strip_prefix('\n')?;
    let mut sums = HashMap::new();
    while !sums.contains_key(REST) {
        let (line, after) = rest.split_once('\n')?;
        let (sum, of) = line.strip_prefix("# ")?.split_once(' ')?;
        sums.insert(of, sum);
        rest = after;
    }
    (sums.get(REST).copied() == Some(sum_of(rest).as_str())).then_some(sums)
}

/// What an earlier run left that this one does not replace.
#[derive(Default)]
struct Earlier {
    /// Whether there is a log.csv.
    log: bool,
    /// Frames beyond those of this run, which would be taken for some of it.
    more: Vec<String>,
}

/// Refuses a folder with a file that would be lost and that this program did not write, or that was changed since.
fn check_folder(folder: &Path, frames: u32, log: bool) -> Result<Earlier, Failure> {
    let refuse = |name: &str| -> Result<Earlier, Failure> {
        Err(Failure::refused(format!(
            "--out: {} holds {name}, which simulate images did not write or which was changed since, and would lose it; \
             wanted another folder",
            folder.display()
        )))
    };
    let text = std::fs::read_to_string(folder.join(TARGET)).unwrap_or_default();
    let sums = sums_of(&text).unwrap_or_default();
    if folder.join(TARGET).exists() && sums.is_empty() {
        return refuse(TARGET);
    }
    let mut earlier = Earlier::default();
    for (name, replaced) in [(TRUTH, true), (LOG, log)] {
        let path = folder.join(name);
        if !path.exists() {
            continue;
        }
        let own = sums.get(name).copied() == Some(hash_file(&path)?.as_str());
        if replaced && !own {
            return refuse(name);
        }
        earlier.log |= own && name == LOG;
    }
    // frames that the truth names are ours
    let truth = std::fs::read_to_string(folder.join(TRUTH)).unwrap_or_default();
    let ours = truth.lines().skip(1).count();
    let exists = |name: &String| folder.join(name).exists();
    if let Some(name) = (ours + 1..=frames as usize).map(name).find(exists) {
        return refuse(&name);
    }
    earlier.more = (frames as usize + 1..=ours)
        .map(name)
        .filter(exists)
        .collect();
    Ok(earlier)
}

fn name(number: usize) -> String {
    format!("{number:06}.png")
}

/// What is the same in all frames.
fn scene(args: &SimulateImagesArgs) -> Result<(Scene, Option<Lens>), Failure> {
    let board = Board {
        width_m: args.width_m,
        height_m: args.height_m,
        marks: match args.marks {
            MarksWord::FourCorners => Marks::FourCorners,
            MarksWord::TwoPanelUpper => Marks::TwoPanelUpper,
            MarksWord::TwoPanelLower => Marks::TwoPanelLower,
        },
    };
    let (width, height) = args.size;
    let plain = Scene::plain(board, width, height)?;
    let straight = Camera::of_pose(width, height, &{
        let [left, _] = plain.camera.pixel(-0.5 * board.width_m, 0.0);
        let [right, _] = plain.camera.pixel(0.5 * board.width_m, 0.0);
        let distance_m = 40.0 * board.width_m.max(board.height_m);
        Pose {
            distance_m,
            focal_px: (right - left) / board.width_m * distance_m,
            turn_rad: radians(args.turn_deg),
            tilt_rad: radians(args.tilt_deg),
            roll_rad: radians(args.roll_deg),
        }
    })?;
    let lens = if args.distortion == 0.0 {
        None
    } else {
        let values = LensValues {
            fx_px: width as f64,
            fy_px: width as f64,
            cx_px: 0.5 * (width as f64 - 1.0),
            cy_px: 0.5 * (height as f64 - 1.0),
            k1: args.distortion,
            ..LensValues::default()
        };
        Some(Lens::new(values).map_err(|error| Failure::refused(error.to_string()))?)
    };
    let shadow = (args.shadow > 0.0).then_some(Shadow {
        through_m: [0.1 * board.width_m, 0.0],
        into_rad: 0.6,
        depth: args.shadow,
        penumbra_m: 0.02 * board.width_m,
    });
    let mut others = Vec::new();
    if args.stray > 0.0 {
        others.push(Beam {
            shape: BeamShape::Gaussian {
                sigma_m: 0.1 * board.width_m,
            },
            u_m: 0.62 * board.width_m,
            v_m: -0.1 * board.height_m,
            peak: args.stray,
        });
    }
    let scene = Scene {
        texture: args.texture,
        daylight: Daylight {
            level: args.daylight,
            gradient_per_m: [args.gradient / board.width_m, 0.0],
            shadow,
        },
        others,
        camera: match lens {
            Some(lens) => straight.with_lens(lens),
            None => straight,
        },
        sensor: Sensor {
            depth: if args.bits == "16" {
                Depth::Bits16
            } else {
                Depth::Bits8
            },
            white_electrons: f64::INFINITY,
            read_noise: args.noise,
            ..plain.sensor
        },
        ..plain
    };
    Ok((scene, lens))
}

/// Makes a frame.
fn frame(
    args: &SimulateImagesArgs,
    scene: &Scene,
    number: u32,
    spot_m: Option<[f64; 2]>,
    folder: &Path,
) -> Result<Truth, Failure> {
    let mut scene = scene.clone();
    let seed = helio_calib::random::Random::stream(args.seed, u64::from(number)).next_u64();
    let mut random = helio_calib::random::Random::new(seed);
    let (wide, high) = (0.3 * args.width_m, 0.3 * args.height_m);
    let mut beam = |peak: f64| Beam {
        shape: shape(args.shape, args.beam_m),
        u_m: random.between(-wide, wide),
        v_m: random.between(-high, high),
        peak,
    };
    let mut first = beam(args.peak);
    if let Some([u_m, v_m]) = spot_m {
        (first.u_m, first.v_m) = (u_m, v_m);
    }
    let second = beam(args.peak * args.second);
    let empty = args
        .empty_every
        .is_some_and(|every| number.is_multiple_of(every));
    if !empty {
        scene.beam = Some(first);
    }
    if args.second > 0.0 {
        scene.others.push(second);
    }
    let simulated = scene.render(seed)?;
    write_frame(&folder.join(name(number as usize)), &simulated.frame)?;
    Ok(simulated.truth)
}

fn shape(word: ShapeWord, beam_m: f64) -> BeamShape {
    match word {
        ShapeWord::Gaussian => BeamShape::Gaussian { sigma_m: beam_m },
        ShapeWord::Ellipse => BeamShape::Ellipse {
            along_m: beam_m * std::f64::consts::SQRT_2,
            across_m: beam_m / std::f64::consts::SQRT_2,
            angle_rad: 0.7,
        },
        ShapeWord::FlatTop => BeamShape::FlatTop {
            radius_m: beam_m,
            edge_m: 0.15 * beam_m,
        },
        ShapeWord::Facets => BeamShape::Facets {
            count: 16,
            sigma_m: 0.6 * beam_m,
            spread_m: 0.7 * beam_m,
        },
    }
}

fn write_log(folder: &Path, log: &ObservationLog) -> Result<(), Failure> {
    let files: Vec<String> = (1..=log.spots_m.len()).map(name).collect();
    let of_file = ("file", Cells::Text(&files));
    let others = log.columns.iter();
    let others = others.map(|(name, cells)| (name.as_str(), Cells::Text(cells)));
    let columns: Vec<_> = others.chain([of_file]).collect();
    let destination = Destination::File(folder.join(LOG));
    write_columns(destination, Format::Csv, &columns)?;
    Ok(())
}

fn write_truth(folder: &Path, truths: &[Truth]) -> Result<(), Failure> {
    let files: Vec<String> = (1..=truths.len()).map(name).collect();
    let number = |of: fn(&helio_spot::simulate::BeamTruth) -> f64| -> Vec<f64> {
        truths
            .iter()
            .map(|truth| truth.beam.as_ref().map_or(f64::NAN, of))
            .collect()
    };
    let (u_m, v_m) = (number(|b| b.u_m), number(|b| b.v_m));
    let (x_px, y_px) = (number(|b| b.x_px), number(|b| b.y_px));
    let share = number(|b| b.share_on_target);
    let seen_u_m = number(|b| b.on_target_m.map_or(f64::NAN, |at| at[0]));
    let seen_v_m = number(|b| b.on_target_m.map_or(f64::NAN, |at| at[1]));
    let columns = [
        ("file", Cells::Text(&files)),
        ("u_m", Cells::Numbers(&u_m)),
        ("v_m", Cells::Numbers(&v_m)),
        ("x_px", Cells::Numbers(&x_px)),
        ("y_px", Cells::Numbers(&y_px)),
        ("share_on_target", Cells::Numbers(&share)),
        ("on_target_u_m", Cells::Numbers(&seen_u_m)),
        ("on_target_v_m", Cells::Numbers(&seen_v_m)),
    ];
    let destination = Destination::File(folder.join(TRUTH));
    write_columns(destination, Format::Csv, &columns)?;
    Ok(())
}
