//! `spot`: camera frames into places on the target.

use std::collections::HashSet;
use std::path::{Path, PathBuf};
use std::sync::Mutex;
use std::sync::atomic::{AtomicBool, Ordering};

use helio_io::{
    CameraTarget, FinderRoom, IoError, SpotFinder, SpotMethod, SpotRow, SpotWords, frame_files,
    load_target, read_frame, write_spots,
};
use helio_spot::{Frame, Limits, RawVideo, SpotStatus};
use rayon::prelude::*;

use super::track::stop_on_signals;
use crate::Outcome;
use crate::args::{MethodWord, SpotArgs};
use crate::clock::{Clock, gaps};
use crate::failure::Failure;
use crate::overlay;
use crate::plan;
use crate::printer::{Bytes, Counted, Grouped, Printer};

pub(crate) fn run(args: &SpotArgs, printer: &Printer) -> Result<Outcome, Failure> {
    plan::threads(args.out.threads)?;
    let format = plan::format(args.out.out.as_deref(), args.out.format)?;
    let source = Source::of(args, printer)?;
    let target = load_target(&args.target)?;
    let finder = SpotFinder::new(&target, method(args, &target)?);
    let clock = Clock::of(args, source.files())?;
    if clock.is_some()
        && !args.numbered
        && let Some(gap) = gaps(source.files())
    {
        let [before, after] = &gap.between;
        printer.warn(format_args!(
            "the numbers in the names leave some out: after {} comes {} ({}); times go by the place in the list, so that \
             frames which are missing shift those after them: --numbered takes times from the numbers",
            before.display(),
            after.display(),
            Counted(gap.count, "such place")
        ));
    }
    let mut inputs = vec![args.target.clone()];
    inputs.extend(source.files().iter().cloned());
    let destination = plan::destination(args.out.out.as_deref(), format, &inputs, printer)?;
    let overlay = match &args.overlay {
        Some(folder) => Some(Overlay::new(folder, source.files(), &inputs)?),
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
            overlay::write(&overlay.path(index), frame, drawing)?;
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
    Video(crate::args::Raw),
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
                if let Some(first) = files.again.first() {
                    printer.warn(format_args!(
                        "{} named more than once and taken once, first {}",
                        Counted(files.again.len(), "file"),
                        first.display()
                    ));
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

/// Where pictures of what was found go.
struct Overlay {
    folder: PathBuf,
    /// Name of each file without its suffix; none for video.
    stems: Vec<String>,
    /// Whether frames are numbered because names stand several times.
    numbered: bool,
}

impl Overlay {
    fn new(folder: &Path, files: &[PathBuf], inputs: &[PathBuf]) -> Result<Self, Failure> {
        let stem = |path: &PathBuf| {
            let stem = path.file_stem().unwrap_or(path.as_os_str());
            stem.to_string_lossy().into_owned()
        };
        let stems: Vec<String> = files.iter().map(stem).collect();
        let different: HashSet<&String> = stems.iter().collect();
        let overlay = Self {
            folder: folder.to_path_buf(),
            numbered: different.len() < stems.len(),
            stems,
        };
        if folder.exists() && !folder.is_dir() {
            return Err(Failure::refused(format!(
                "--overlay: {} is a file; wanted a folder for the pictures",
                folder.display()
            )));
        }
        std::fs::create_dir_all(folder).map_err(|error| IoError::write(folder, error))?;
        // A frame must not be replaced by what is drawn over it.
        let inputs: HashSet<PathBuf> = inputs
            .iter()
            .filter_map(|p| p.canonicalize().ok())
            .collect();
        for index in 0..overlay.stems.len() {
            let path = overlay.path(index);
            if path
                .canonicalize()
                .is_ok_and(|there| inputs.contains(&there))
            {
                return Err(Failure::refused(format!(
                    "--overlay: {} is a frame that this run reads; wanted another folder",
                    path.display()
                )));
            }
        }
        Ok(overlay)
    }

    fn path(&self, index: usize) -> PathBuf {
        let name = match self.stems.get(index) {
            None => format!("frame-{index:06}.png"),
            Some(stem) if self.numbered => format!("{index:06}-{stem}.png"),
            Some(stem) => format!("{stem}.png"),
        };
        self.folder.join(name)
    }
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
