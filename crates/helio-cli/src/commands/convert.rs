//! `convert`: records of others into a field and its observations.

use std::sync::Mutex;
use std::sync::atomic::Ordering;

use helio_io::{Paint, PaintError, PaintFiles};

use super::track::stop_on_signals;
use crate::Outcome;
use crate::args::{Convert, ConvertPaintArgs};
use crate::failure::Failure;
use crate::plan;
use crate::printer::{Counted, Printer};

pub(crate) fn run(what: &Convert, printer: &Printer) -> Result<Outcome, Failure> {
    match what {
        Convert::Paint(args) => paint(args, printer),
    }
}

fn paint(args: &ConvertPaintArgs, printer: &Printer) -> Result<Outcome, Failure> {
    plan::threads(args.threads)?;
    let files = PaintFiles::in_folder(&args.records)?;
    let count = files.heliostats.len() + files.records.values().map(Vec::len).sum::<usize>();
    let stop = stop_on_signals();
    let progress = Mutex::new(printer.progress_of(count as u64, "files"));
    let watch = |more: u64, _: u64| {
        if let Ok(mut progress) = progress.lock() {
            progress.advance(more);
        }
        !stop.load(Ordering::Relaxed)
    };
    let aim = args.aim.as_deref();
    let paint = Paint::read(&args.tower, &files, args.centroid.into(), aim, &watch);
    if let Ok(progress) = progress.into_inner() {
        progress.finish();
    }
    let paint = paint.map_err(|error| match error {
        PaintError::Io(error) => error.into(),
        PaintError::Stopped => Failure::Interrupted { streamed: false },
        PaintError::UnknownAim { .. } => Failure::refused(format!("--aim: {error}")),
        other => Failure::refused(other.to_string()),
    })?;
    let (field, observations) = paint.write(&args.out)?;
    for warning in paint.warnings() {
        printer.warn(warning);
    }
    printer.say(format_args!(
        "{} and {}: {} of {}",
        field.display(),
        observations.file_name().unwrap_or_default().display(),
        Counted(paint.off_plane_m().len(), "record"),
        Counted(paint.heliostats().len(), "heliostat")
    ));
    Ok(if paint.left_aside().is_empty() {
        Outcome::Good
    } else {
        Outcome::SomeRowsFailed
    })
}
