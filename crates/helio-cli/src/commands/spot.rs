//! `spot`: camera frames into places on the target.

use std::path::{Path, PathBuf};
use std::sync::Mutex;
use std::sync::atomic::{AtomicBool, Ordering};

use helio_io::{
    CameraTarget, FinderRoom, FrameClock, FrameNumberError, OverlayError, OverlayFolder, RawFrames,
    SpotFinder, SpotMethod, SpotRow, SpotWords, frame_files, frame_gap, load_target, parse_time,
    read_frame, write_spots,
};
use helio_spot::{Frame, Limits, RawVideo, SpotStatus};
use rayon::prelude::*;

use super::track::stop_on_signals;
use crate::Outcome;
use crate::args::{MethodWord, SpotArgs};
use crate::failure::Failure;
use crate::plan;
use crate::printer::{Bytes, Counted, Grouped, Printer};

pub(crate) fn run(args: &SpotArgs, printer: &Printer) -> Result<Outcome, Failure> {
    plan::threads(args.out.threads)?;
    let format = plan::format(args.out.out.as_deref(), args.out.format)?;
    let source = Source::of(args, printer)?;
    let target = load_target(&args.target)?;
    let finder = SpotFinder::new(&target, method(args, &target)?);
    let clock = clock(args, source.files())?;
    if clock.is_some()
        && !args.numbered
        && let Some(gap) = frame_gap(source.files())
    {
        printer.warn(format_args!(
            "{gap}: --numbered takes times from the numbers"
        ));
    }
    let mut inputs = vec![args.target.clone()];
    inputs.extend(source.files().iter().cloned());
    let destination = plan::destination(args.out.out.as_deref(), format, &inputs, printer)?;
    let overlay = match &args.overlay {
        Some(folder) => {
            let overlay = OverlayFolder::new(folder, source.files(), &inputs);
            Some(overlay.map_err(|error| match error {
                OverlayError::Io(error) => error.into(),
                other => Failure::refused(format!("--overlay: {other}")),
            })?)
        }
        None => None,
    };

    let stop = stop_on_signals();
    let progress = Mutex::new(printer.progress_of(source.files().len() as u64, "frames"));
    let work = |room: &mut FinderRoom, (index, job): (usize, Job<'_>)| {
        let unix_ns = clock.as_ref().map(|clock| clock.at(index));
        let file = job.name(index);
        let (row, frame, drawing) = match job.frame() {
            Err(reason) => (SpotRow::unreadable(file, unix_ns, reason), None, None),
            Ok(frame) => {
                let (row, drawing) = finder.find(&frame, file, unix_ns, room)?;
                (row, Some(frame), Some(drawing))
            }
        };
        if let (Some(overlay), Some(frame), Some(drawing)) = (&overlay, &frame, &drawing) {
            overlay.write_frame(index, frame, drawing)?;
        }
        if let Ok(mut progress) = progress.lock() {
            progress.advance(1);
        }
        Ok::<_, Failure>((index, row))
    };
    // Each thread asks for the next frame when it is done with one: no more are in memory than threads.
    let mut rows = source
        .jobs(stop)?
        .enumerate()
        .par_bridge()
        .map_init(FinderRoom::default, work)
        .collect::<Vec<Result<(usize, SpotRow), Failure>>>()
        .into_iter()
        .collect::<Result<Vec<_>, _>>()?;
    if stop.load(Ordering::Relaxed) {
        return Err(plan::interrupted(&args.out));
    }
    rows.sort_unstable_by_key(|(index, _)| *index);
    let rows: Vec<SpotRow> = rows.into_iter().map(|(_, row)| row).collect();
    if rows.is_empty() {
        return Err(Failure::refused(
            "standard input: no frame of video; wanted raw gray pixels as --raw says",
        ));
    }
    let bytes = write_spots(destination, format, &rows)?;
    let took_s = match progress.into_inner() {
        Ok(progress) => progress.finish().as_secs_f64(),
        Err(_) => 0.0,
    };
    printer.say(format_args!(
        "{}: {}; {} in {took_s:.2} s",
        Counted(rows.len(), "frame"),
        Words(&rows),
        Bytes(bytes)
    ));
    if let Some(row) = rows.iter().find(|row| !row.reason.is_empty()) {
        printer.note(format_args!(
            "{} of {} frames have a reason in the last column, first {}: {}",
            rows.iter().filter(|row| !row.reason.is_empty()).count(),
            rows.len(),
            row.file,
            row.reason
        ));
    }
    Ok(
        if rows.iter().all(|row| row.status == Some(SpotStatus::Ok)) {
            Outcome::Good
        } else {
            Outcome::SomeRowsFailed
        },
    )
}

/// How many frames have each status.
struct Words<'a>(&'a [SpotRow]);

impl std::fmt::Display for Words<'_> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let mut separator = "";
        let all = SpotStatus::ALL.into_iter().map(Some);
        for status in all.chain([None]) {
            let mut of = self.0.iter().filter(|row| row.status == status);
            if let Some(first) = of.next() {
                let count = Grouped(1 + of.count() as u64);
                write!(f, "{separator}{count} {}", first.status_word())?;
                separator = ", ";
            }
        }
        Ok(())
    }
}

/// Where frames come from.
enum Source {
    Files(Vec<PathBuf>),
    Video(RawFrames),
}

impl Source {
    fn of(args: &SpotArgs, printer: &Printer) -> Result<Self, Failure> {
        let stdin = args.files.iter().any(|path| plan::is_stdout(path));
        match args.raw {
            Some(raw) if stdin && args.files.len() == 1 => Ok(Self::Video(raw)),
            Some(_) => Err(Failure::refused(
                "--raw is for raw video on standard input: wanted - and no other file",
            )),
            None if stdin => Err(Failure::refused(
                "-: raw video on standard input wants --raw WIDTHxHEIGHT[:gray8|gray16le]",
            )),
            None => {
                let files = frame_files(&args.files)?;
                if let Some(again) = files.warning() {
                    printer.warn(format_args!("{again}"));
                }
                Ok(Self::Files(files.paths))
            }
        }
    }

    fn files(&self) -> &[PathBuf] {
        match self {
            Self::Files(files) => files,
            Self::Video(_) => &[],
        }
    }

    /// The frames one after another, until somebody wants an end.
    fn jobs<'a>(
        &'a self,
        stop: &'static AtomicBool,
    ) -> Result<Box<dyn Iterator<Item = Job<'a>> + Send + 'a>, Failure> {
        let going = move |_: &Job<'a>| !stop.load(Ordering::Relaxed);
        Ok(match self {
            Self::Files(files) => {
                Box::new(files.iter().map(|path| Job::File(path)).take_while(going))
            }
            Self::Video(raw) => {
                let video = RawVideo::new(
                    std::io::stdin(),
                    raw.width,
                    raw.height,
                    raw.format,
                    &Limits::default(),
                )
                .map_err(|error| Failure::refused(format!("--raw: {error}")))?;
                let frames = video.map(|frame| Job::Video(frame.map_err(|e| e.to_string())));
                Box::new(frames.take_while(going))
            }
        })
    }
}

/// A frame to be looked at.
enum Job<'a> {
    File(&'a Path),
    Video(Result<Frame, String>),
}

impl Job<'_> {
    fn name(&self, index: usize) -> String {
        match self {
            Self::File(path) => path.to_string_lossy().into_owned(),
            Self::Video(_) => format!("frame {index}"),
        }
    }

    /// The frame, or why there is none.
    fn frame(self) -> Result<Frame, String> {
        let path = match self {
            Self::Video(frame) => return frame,
            Self::File(path) => path,
        };
        read_frame(path)
    }
}

/// When frames were taken, if that is told.
fn clock(args: &SpotArgs, files: &[PathBuf]) -> Result<Option<FrameClock>, Failure> {
    let (Some(start), Some(fps)) = (&args.start, args.fps) else {
        return Ok(None);
    };
    let start_ns =
        parse_time(start).map_err(|error| Failure::refused(format!("--start: {error}")))?;
    let clock = FrameClock::new(start_ns, fps);
    if !args.numbered {
        return Ok(Some(clock));
    }
    let numbered = clock.numbered(files).map_err(|error| match error {
        FrameNumberError::NoFiles => Failure::refused(format!("--numbered is for files; {error}")),
        other => Failure::refused(format!("--numbered: {other}")),
    })?;
    Ok(Some(numbered))
}

/// How spots are found.
fn method(args: &SpotArgs, target: &CameraTarget) -> Result<SpotMethod, Failure> {
    let words = SpotWords {
        threshold: args.threshold,
        expected: args
            .expected
            .map(|place| (place.u_m, place.v_m, place.sigma_m)),
        white: args.white,
    };
    let method = match args.method {
        MethodWord::Standard => SpotMethod::standard(&words),
        MethodWord::Robust => SpotMethod::robust(&words, &target.board),
    };
    method.map_err(|error| Failure::refused(error.to_string()))
}
