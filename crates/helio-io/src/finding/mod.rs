//! The spot in a camera's frame, as a row of the table of spots.

mod clock;
mod method;
mod overlay;
mod raw;
mod rows;

use std::io::Read;
use std::path::Path;

use helio_spot::{
    Corners, FindOptions, Flags, Frame, Gray, Limits, MarkScratch, Plane, Scratch, SpotError,
    SpotScratch, SpotStatus, View, decode, find_corners,
};

use crate::error::IoError;
use crate::spots::SpotRow;
use crate::target::CameraTarget;

pub use clock::{FrameClock, FrameGap, FrameNumberError, frame_gap};
pub use method::{SpotMethod, SpotWords, UselessOption, parse_threshold};
pub use overlay::{OverlayError, OverlayFolder};
pub use raw::{RawFrames, parse_raw, parse_size};

/// No camera writes larger files \[bytes\].
const MOST_BYTES: u64 = 1 << 30;

/// Reads a frame, whose colours become gray.
///
/// # Errors
/// Why there is none, in words: what the column `reason` says of a frame that cannot be read.
pub fn read_frame(path: &Path) -> Result<Frame, String> {
    frame_of_file(path).unwrap_or_else(|error| Err(error.problem().to_string()))
}

/// Reads a frame, and tells a file that cannot be read from one that is no picture: `Ok(Err(_))`, with the reason.
///
/// # Errors
/// [`IoError`] for a file that cannot be read.
///
/// ```
/// let folder = tempfile::tempdir()?;
/// let path = folder.path().join("a.png");
/// assert!(helio_io::frame_of_file(&path).is_err());
/// std::fs::write(&path, "nothing")?;
/// assert!(helio_io::frame_of_file(&path)?.is_err());
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn frame_of_file(path: &Path) -> Result<Result<Frame, String>, IoError> {
    let mut bytes = Vec::new();
    std::fs::File::open(path)
        .and_then(|file| file.take(MOST_BYTES + 1).read_to_end(&mut bytes))
        .map_err(|error| IoError::read(path, error))?;
    if bytes.len() as u64 > MOST_BYTES {
        return Ok(Err("more than 1.07 GB of file".to_owned()));
    }
    Ok(decode(&bytes, &Limits::default()).map_err(|error| error.to_string()))
}

/// Memory that a thread uses again and again.
#[derive(Debug, Default)]
pub struct FinderRoom {
    standard: Scratch,
    robust: SpotScratch,
    marks: MarkScratch,
}

/// What was seen on the way to a spot; positions in pixels, x right and y down.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct SeenInFrame {
    /// The target, where it was found or given.
    pub plane: Option<Plane>,
    /// Gray value above which light counts, and the rectangle (left, top, right, bottom) within which it does.
    pub threshold: Option<(f64, [f64; 4])>,
    /// Pieces of the outline of what counted, where the method tells it.
    pub outline_px: Vec<[[f64; 2]; 2]>,
    /// Left, top, right, bottom of the window.
    pub window: Option<[f64; 4]>,
    /// Centre of the spot.
    pub centre: Option<[f64; 2]>,
    /// Covariance of its place on the target \[m²\].
    pub covariance_m2: Option<[[f64; 2]; 2]>,
}

/// Finds spots on a target: what is the same for all frames.
///
/// ```
/// use helio_io::{FinderRoom, SpotFinder, SpotMethod, SpotWords, target_of_text};
/// use helio_spot::{SpotStatus, View};
/// let text = "width_m = 8\nheight_m = 6\ncorners_px = [[0, 0], [79, 0], [79, 59], [0, 59]]";
/// let target = target_of_text("target".as_ref(), text)?;
/// let method = SpotMethod::robust(&SpotWords::default(), &target.board)?;
/// let gray = vec![90_u8; 80 * 60];
/// let view = View::new(&gray, 80, 60)?;
/// let finder = SpotFinder::new(&target, method);
/// let (row, seen) = finder.find_in(view, "even.png".into(), None, &mut FinderRoom::default())?;
/// assert_eq!(row.status, Some(SpotStatus::Empty));
/// assert!(seen.plane.is_some() && seen.centre.is_none());
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Debug)]
pub struct SpotFinder<'a> {
    target: &'a CameraTarget,
    method: SpotMethod,
}

impl<'a> SpotFinder<'a> {
    /// For spots on a target.
    #[must_use]
    pub const fn new(target: &'a CameraTarget, method: SpotMethod) -> Self {
        Self { target, method }
    }

    /// The spot in a frame of 8 or 16 bit, called `file`; see [`find_in`](Self::find_in).
    ///
    /// # Errors
    /// As [`find_in`](Self::find_in).
    pub fn find(
        &self,
        frame: &Frame,
        file: String,
        unix_ns: Option<i64>,
        room: &mut FinderRoom,
    ) -> Result<(SpotRow, SeenInFrame), SpotError> {
        match frame {
            Frame::Gray8(picture) => self.find_in(picture.view(), file, unix_ns, room),
            Frame::Gray16(picture) => self.find_in(picture.view(), file, unix_ns, room),
        }
    }

    /// The spot in gray values. A frame without a spot or a target is a row with the status and, of a target that is not
    /// found, the reason.
    ///
    /// # Errors
    /// [`SpotError`] for a picture of too many pixels and for options that make no sense.
    pub fn find_in<P: Gray>(
        &self,
        view: View<'_, P>,
        file: String,
        unix_ns: Option<i64>,
        room: &mut FinderRoom,
    ) -> Result<(SpotRow, SeenInFrame), SpotError> {
        let size = self.target.refuses_size(view.width(), view.height());
        let found = size.map_or_else(|| self.plane(view, room), Err);
        let (plane, flags) = match found {
            Ok(found) => found,
            Err(reason) => {
                let row = SpotRow {
                    reason,
                    ..SpotRow::without_position(file, unix_ns, Some(SpotStatus::NoTarget))
                };
                return Ok((row, SeenInFrame::default()));
            }
        };
        let mut seen = SeenInFrame {
            plane: Some(plane),
            ..SeenInFrame::default()
        };
        let row = SpotRow::without_position(file, unix_ns, None);
        let (mut row, found) = match &self.method {
            SpotMethod::Standard(options) => {
                rows::of_standard(view, &plane, options, &mut room.standard, row, &mut seen)?
            }
            SpotMethod::Robust(options) => {
                rows::of_robust(view, &plane, options, &mut room.robust, row, &mut seen)?
            }
        };
        row.flags = rows::words(found.with(flags));
        if row.status == Some(SpotStatus::NoTarget) {
            row.reason = rows::no_target(&plane, view.width(), view.height());
        }
        Ok((row, seen))
    }

    /// Where the target is in a picture, or why nobody knows.
    fn plane<P: Gray>(
        &self,
        view: View<'_, P>,
        room: &mut FinderRoom,
    ) -> Result<(Plane, Flags), String> {
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
