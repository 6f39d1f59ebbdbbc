//! `simulate images`: synthetic camera frames with their truth.

use std::sync::Mutex;
use std::sync::atomic::Ordering;

use helio_io::{ImageBeam, ImagePlan, ImagesError, SimulatedImages, load_observation_log};
use helio_spot::simulate::Depth;
use helio_spot::{Board, Marks};

use super::track::stop_on_signals;
use crate::Outcome;
use crate::args::{MarksWord, ShapeWord, SimulateImagesArgs};
use crate::failure::Failure;
use crate::plan;
use crate::printer::{Counted, Printer, Progress};

pub(crate) fn run(args: &SimulateImagesArgs, printer: &Printer) -> Result<Outcome, Failure> {
    plan::threads(args.threads)?;
    let mut images = SimulatedImages::new(plan_of(args))?;
    if let Some(path) = &args.observations {
        images = images.with_log(load_observation_log(path)?);
    }
    let stop = stop_on_signals();
    // From the first frame on: a folder that is refused has no progress.
    let progress: Mutex<Option<Progress>> = Mutex::default();
    let watch = |more: u64, all: u64| {
        if let Ok(mut progress) = progress.lock() {
            let progress = progress.get_or_insert_with(|| printer.progress_of(all, "frames"));
            if more > 0 {
                progress.advance(more);
            }
        }
        !stop.load(Ordering::Relaxed)
    };
    let truths = images.write(&args.out, &watch)?;
    printer.say(format_args!(
        "{} with {}truth.csv and target.toml in {}",
        Counted(truths.len(), "frame"),
        if args.observations.is_some() {
            "log.csv, "
        } else {
            ""
        },
        args.out.display()
    ));
    Ok(Outcome::Good)
}

impl From<ImagesError> for Failure {
    fn from(error: ImagesError) -> Self {
        match error {
            ImagesError::Io(error) => error.into(),
            ImagesError::Spot(error) => error.into(),
            ImagesError::Held { .. } => Self::refused(format!("--out: {error}")),
            ImagesError::Stopped => Self::Interrupted { streamed: false },
            _ => Self::refused(error.to_string()),
        }
    }
}

fn plan_of(args: &SimulateImagesArgs) -> ImagePlan {
    ImagePlan {
        frames: args.frames,
        seed: args.seed,
        size_px: args.size.into(),
        depth: if args.bits == "16" {
            Depth::Bits16
        } else {
            Depth::Bits8
        },
        board: Board {
            width_m: args.width_m,
            height_m: args.height_m,
            marks: match args.marks {
                MarksWord::FourCorners => Marks::FourCorners,
                MarksWord::TwoPanelUpper => Marks::TwoPanelUpper,
                MarksWord::TwoPanelLower => Marks::TwoPanelLower,
            },
        },
        shape: match args.shape {
            ShapeWord::Gaussian => ImageBeam::Gaussian,
            ShapeWord::Ellipse => ImageBeam::Ellipse,
            ShapeWord::FlatTop => ImageBeam::FlatTop,
            ShapeWord::Facets => ImageBeam::Facets,
        },
        beam_m: args.beam_m,
        peak: args.peak,
        daylight: args.daylight,
        gradient: args.gradient,
        shadow: args.shadow,
        texture: args.texture,
        noise: args.noise,
        turn_deg: args.turn_deg,
        tilt_deg: args.tilt_deg,
        roll_deg: args.roll_deg,
        distortion: args.distortion,
        second: args.second,
        stray: args.stray,
        empty_every: args.empty_every,
        find_marks: args.find_marks,
    }
}
