//! `spot`: camera frames into places on the target.

use std::collections::HashSet;
use std::io::Read;
use std::path::{Path, PathBuf};
use std::sync::Mutex;
use std::sync::atomic::{AtomicBool, Ordering};

use helio_io::{CameraTarget, IoError, SpotRow, frame_files, load_target, write_spots};
use helio_spot::{
    Corners, FindOptions, Flags, Frame, Gray, Limits, MarkScratch, Plane, RawVideo, RobustOptions,
    Scratch, SpotError, SpotScratch, SpotStatus, StandardOptions, View, decode, find_corners,
    find_spot, standard,
};
use rayon::prelude::*;

use super::track::stop_on_signals;
use crate::Outcome;
use crate::args::{MethodWord, SpotArgs};
use crate::clock::{Clock, gaps};
use crate::failure::Failure;
use crate::overlay::{self, Drawing};
use crate::plan;
use crate::printer::{Bytes, Counted, Grouped, Printer};

/// No camera writes larger files \[bytes\].
const MOST_BYTES: u64 = 1 << 30;

pub(crate) fn run(args: &SpotArgs, printer: &Printer) -> Result<Outcome, Failure> {
    plan::threads(args.out.threads)?;
    let format = plan::format(args.out.out.as_deref(), args.out.format)?;
    let source = Source::of(args, printer)?;
    let target = load_target(&args.target)?;
    let finder = Finder::new(args, &target)?;
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
    let work = |room: &mut Room, (index, job): (usize, Job<'_>)| {
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
        .map_init(Room::default, work)
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
        let mut bytes = Vec::new();
        let read = std::fs::File::open(path)
            .and_then(|file| file.take(MOST_BYTES + 1).read_to_end(&mut bytes));
        match read {
            Err(error) => Err(IoError::read(path, error).problem().to_string()),
            Ok(_) if bytes.len() as u64 > MOST_BYTES => {
                Err(format!("more than {} of file", Bytes(MOST_BYTES)))
            }
            Ok(_) => decode(&bytes, &Limits::default()).map_err(|error| error.to_string()),
        }
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

/// Memory that a thread uses again and again.
#[derive(Default)]
struct Room {
    standard: Scratch,
    robust: SpotScratch,
    marks: MarkScratch,
}

/// What is the same for all frames.
struct Finder<'a> {
    target: &'a CameraTarget,
    method: Method,
}

enum Method {
    Standard(StandardOptions),
    Robust(RobustOptions),
}

impl<'a> Finder<'a> {
    fn new(args: &SpotArgs, target: &'a CameraTarget) -> Result<Self, Failure> {
        let method = match args.method {
            MethodWord::Standard => {
                let other = [
                    ("--expected", args.expected.is_some()),
                    ("--white", args.white.is_some()),
                ];
                if let Some((option, _)) = other.into_iter().find(|(_, typed)| *typed) {
                    return Err(Failure::refused(format!(
                        "{option} is for --method robust; the standard takes the densest square"
                    )));
                }
                Method::Standard(StandardOptions::with_threshold(
                    args.threshold.unwrap_or_default(),
                ))
            }
            MethodWord::Robust if args.threshold.is_some() => {
                return Err(Failure::refused(
                    "--threshold is for --method standard; robust takes its own from the light around the spot",
                ));
            }
            MethodWord::Robust => {
                let mut options = RobustOptions::default();
                let tenth_m = 0.1 * target.board.width_m.min(target.board.height_m);
                options.expected = args
                    .expected
                    .map(|place| (place.u_m, place.v_m, place.sigma_m.unwrap_or(tenth_m)));
                options.white = args.white;
                Method::Robust(options)
            }
        };
        Ok(Self { target, method })
    }

    fn find(
        &self,
        frame: &Frame,
        file: String,
        unix_ns: Option<i64>,
        room: &mut Room,
    ) -> Result<(SpotRow, Drawing), SpotError> {
        match frame {
            Frame::Gray8(picture) => self.find_in(picture.view(), file, unix_ns, room),
            Frame::Gray16(picture) => self.find_in(picture.view(), file, unix_ns, room),
        }
    }

    fn find_in<P: Gray>(
        &self,
        view: View<'_, P>,
        file: String,
        unix_ns: Option<i64>,
        room: &mut Room,
    ) -> Result<(SpotRow, Drawing), SpotError> {
        let size = self.target.refuses_size(view.width(), view.height());
        let found = size.map_or_else(|| self.plane(view, room), Err);
        let (plane, flags) = match found {
            Ok(found) => found,
            Err(reason) => {
                let row = SpotRow {
                    reason,
                    ..SpotRow::without_position(file, unix_ns, Some(SpotStatus::NoTarget))
                };
                return Ok((row, Drawing::default()));
            }
        };
        let mut drawing = Drawing {
            plane: Some(plane),
            ..Drawing::default()
        };
        let row = SpotRow::without_position(file, unix_ns, None);
        let row = match &self.method {
            Method::Standard(options) => {
                of_standard(view, &plane, options, &mut room.standard, row, &mut drawing)?
            }
            Method::Robust(options) => {
                of_robust(view, &plane, options, &mut room.robust, row, &mut drawing)?
            }
        };
        let (mut row, found) = row;
        row.flags = words(found.with(flags));
        if row.status == Some(SpotStatus::NoTarget) {
            row.reason = no_target(&plane, view.width(), view.height());
        }
        Ok((row, drawing))
    }

    /// Where the target is in a picture, or why nobody knows.
    fn plane<P: Gray>(&self, view: View<'_, P>, room: &mut Room) -> Result<(Plane, Flags), String> {
        if let Some(plane) = &self.target.plane {
            return Ok((*plane, Flags::CORNERS_GIVEN));
        }
        let board = self.target.board;
        let of = |corners: Corners| Plane::new(board, corners, self.target.lens);
        let options = FindOptions {
            lens: self.target.lens,
            ..FindOptions::default()
        };
        let found = find_corners(view, &board, &options, &mut room.marks)
            .map(|corners| corners.with_survey(&board, self.target.marks_sigma_m))
            .and_then(|corners| Ok((of(corners)?, corners)));
        let (plane, corners) = found.map_err(|error| error.to_string())?;
        let hidden = !corners.seen.iter().all(|&seen| seen);
        Ok((plane, Flags::none().with_if(hidden, Flags::CORNER_HIDDEN)))
    }
}

/// Why nothing can be made of corners that were given or found.
fn no_target(plane: &Plane, width: usize, height: usize) -> String {
    let whose = if plane.corners().marks.is_some() {
        "found"
    } else {
        "given"
    };
    let picture = format!("the picture has {width} x {height} pixels");
    match about(plane, width, height) {
        None => format!("the corners {whose} lie outside the picture: {picture}"),
        Some([_, _, wide, high]) => format!(
            "too few pixels of the target are seen: {wide} x {high} within the corners {whose}, {picture}"
        ),
    }
}

fn words(flags: Flags) -> String {
    flags.words().collect::<Vec<_>>().join(" ")
}

/// The smallest rectangle of whole pixels about a target (left, top, width, height), within a picture.
fn about(plane: &Plane, width: usize, height: usize) -> Option<[usize; 4]> {
    let corners = &plane.corners().at_px;
    let along = |k: usize, size: usize| {
        let all = corners.iter().map(|at| at[k]);
        let low = all.clone().fold(f64::INFINITY, f64::min).floor().max(0.0);
        let high = all.fold(f64::NEG_INFINITY, f64::max).ceil();
        let high = high.min(size as f64 - 1.0);
        (high >= low).then(|| (low as usize, (high - low) as usize + 1))
    };
    let ((left, wide), (top, high)) = (along(0, width)?, along(1, height)?);
    Some([left, top, wide, high])
}

fn of_standard<P: Gray>(
    view: View<'_, P>,
    plane: &Plane,
    options: &StandardOptions,
    scratch: &mut Scratch,
    row: SpotRow,
    drawing: &mut Drawing,
) -> Result<(SpotRow, Flags), SpotError> {
    let none = |status| SpotRow {
        status: Some(status),
        ..row.clone()
    };
    let rectangle = about(plane, view.width(), view.height());
    let part = rectangle.and_then(|[left, top, wide, high]| {
        let part = view.part(left, top, wide, high)?;
        Some((part, [left as f64, top as f64], [wide as f64, high as f64]))
    });
    let Some((part, [left, top], [wide, high])) = part else {
        return Ok((none(SpotStatus::NoTarget), Flags::none()));
    };
    let spot = standard(part, options, scratch)?;
    drawing.threshold = Some((
        f64::from(spot.threshold),
        [left, top, left + wide - 1.0, top + high - 1.0],
    ));
    let mut row = SpotRow {
        threshold: Some(spot.threshold),
        area_px: Some(spot.area_px),
        window_px: Some(spot.window_px),
        ..none(spot.status)
    };
    if !spot.status.has_position() {
        return Ok((row, spot.flags));
    }
    let at_px = [left + spot.x_px, top + spot.y_px];
    let Some(at_m) = plane.to_target(at_px) else {
        row.status = Some(SpotStatus::NoTarget);
        return Ok((row, spot.flags));
    };
    let half = 0.5 * f64::from(spot.window_px);
    drawing.window = Some([
        at_px[0] - half,
        at_px[1] - half,
        at_px[0] + half,
        at_px[1] + half,
    ]);
    drawing.centre = Some(at_px);
    // The standard knows no noise: what is left is the step of half a pixel of its window, evenly spread, and the way
    // from pixels to metres.
    let covariance_m2 = plane.covariance_m2(at_px);
    let step_m = plane.metres_per_px(at_px).unwrap_or(f64::NAN);
    drawing.covariance_m2 = covariance_m2;
    let sigma_m =
        covariance_m2.map(|[[uu, _], [_, vv]]| (0.5 * (uu + vv) + step_m * step_m / 12.0).sqrt());
    row.row_column = Some([top + spot.row, left + spot.column]);
    row.at_px = Some(at_px);
    row.at_m = Some(at_m);
    row.sigma_m = sigma_m.filter(|sigma_m| sigma_m.is_finite());
    Ok((row, spot.flags))
}

fn of_robust<P: Gray>(
    view: View<'_, P>,
    plane: &Plane,
    options: &RobustOptions,
    scratch: &mut SpotScratch,
    row: SpotRow,
    drawing: &mut Drawing,
) -> Result<(SpotRow, Flags), SpotError> {
    let spot = find_spot(view, plane, options, scratch)?;
    let mut row = SpotRow {
        status: Some(spot.status),
        ..row
    };
    if !spot.status.has_position() {
        return Ok((row, spot.flags));
    }
    let at_px = [spot.x_px, spot.y_px];
    drawing.centre = Some(at_px);
    drawing.covariance_m2 = Some(spot.covariance_with_plane_m2);
    drawing.outline_px.extend(scratch.outline_px());
    row.threshold = Some(spot.threshold.round().max(0.0) as u32);
    row.area_px = Some(spot.area_px.round().max(0.0) as u64);
    row.row_column = Some([spot.y_px, spot.x_px]);
    row.at_px = Some(at_px);
    row.at_m = Some([spot.u_m, spot.v_m]);
    row.sigma_m = Some(spot.sigma_m()).filter(|sigma_m| sigma_m.is_finite());
    Ok((row, spot.flags))
}
