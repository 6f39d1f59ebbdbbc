//! `find_spot`, `find_spots`: the typed calls and their answers are in `helio_py._spots`.

use std::path::{Path, PathBuf};

mod raw;

use helio_io::output::{Destination, Format, KeptColumns};
use helio_io::{
    CameraTarget, FinderRoom, FrameClock, FrameNumberError, OverlayError, OverlayFolder,
    SeenInFrame, SpotFinder, SpotMethod, SpotRow, SpotWords, UselessOption, frame_files, frame_gap,
    frame_of_file, load_target, parse_threshold, target_of_text, write_spots,
};
use helio_spot::{Frame, Gray, Picture, SpotError, View};
use numpy::{PyReadonlyArrayDyn, PyUntypedArrayMethods};
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyList};
use rayon::prelude::*;

use crate::array::owned;
use crate::failure::Failure;
use crate::guard::guarded;
use crate::table::handed_out;
use crate::watch::watched;
pub(crate) use raw::_find_raw_spots;

/// Target and options as the keywords of `find_spots` have them.
#[derive(FromPyObject)]
#[pyo3(from_item_all)]
pub(crate) struct SpotsAsked {
    path: PathBuf,
    text: Option<String>,
    method: String,
    threshold: Option<String>,
    expected: Option<(f64, f64, Option<f64>)>,
    white: Option<u32>,
    /// A folder for pictures of what was found.
    overlay: Option<PathBuf>,
}

impl SpotsAsked {
    /// The folder for pictures of frames that are called so, none of which may be one that is read.
    fn overlay(
        &self,
        called: &[PathBuf],
        read: impl Iterator<Item = PathBuf>,
    ) -> Result<Option<OverlayFolder>, Failure> {
        let Some(folder) = &self.overlay else {
            return Ok(None);
        };
        let target = self.text.is_none().then(|| self.path.clone());
        let inputs: Vec<PathBuf> = read.chain(target).collect();
        let overlay = OverlayFolder::new(folder, called, &inputs);
        Ok(Some(overlay.map_err(|error| match error {
            OverlayError::Io(error) => Failure::from(error).or_of("overlay"),
            other => Failure::of("OptionError", "overlay", other),
        })?))
    }

    fn target(&self) -> Result<CameraTarget, Failure> {
        Ok(match &self.text {
            Some(text) => target_of_text(&self.path, text)?,
            None => load_target(&self.path)?,
        })
    }

    fn method(&self, target: &CameraTarget) -> Result<SpotMethod, Failure> {
        let threshold = self.threshold.as_deref().map(parse_threshold).transpose();
        let words = SpotWords {
            threshold: threshold.map_err(|wanted| {
                let found = self.threshold.as_deref().unwrap_or_default();
                Failure::of(
                    "OptionError",
                    "threshold",
                    format!("{wanted}, got `{found}`"),
                )
            })?,
            expected: self.expected,
            white: self.white,
        };
        match self.method.as_str() {
            "robust" => Ok(SpotMethod::robust(&words, &target.board)?),
            "standard" => Ok(SpotMethod::standard(&words)?),
            other => {
                let message = format!("wanted robust or standard, got `{other}`");
                Err(Failure::of("OptionError", "method", message))
            }
        }
    }
}

impl From<UselessOption> for Failure {
    fn from(error: UselessOption) -> Self {
        let UselessOption {
            option,
            method,
            why,
        } = error;
        let message = format!("it is for the method {method}; {why}");
        Self::of("OptionError", option, message)
    }
}

impl From<SpotError> for Failure {
    fn from(error: SpotError) -> Self {
        let class = match error {
            SpotError::BadOption { .. } => "OptionError",
            _ => "ImageError",
        };
        Self::new(class, error.to_string())
    }
}

/// A frame from Python, kept as long as it is looked at.
enum Given<'py> {
    File(PathBuf),
    Gray8(PyReadonlyArrayDyn<'py, u8>),
    Gray16(PyReadonlyArrayDyn<'py, u16>),
}

/// The same for threads without the interpreter: gray values or colours where they lie, with rows and columns.
enum Job<'a> {
    File(&'a Path),
    Bits8(&'a [u8], [usize; 2]),
    Bits16(&'a [u16], [usize; 2]),
}

impl<'py> Given<'py> {
    /// A path, or an array that `helio_py._spots` has made contiguous.
    fn of(value: &Bound<'py, PyAny>) -> Result<Self, Failure> {
        if let Ok(array) = value.extract() {
            return Ok(Self::Gray8(array));
        }
        if let Ok(array) = value.extract() {
            return Ok(Self::Gray16(array));
        }
        Ok(Self::File(value.extract()?))
    }

    fn job(&self) -> Result<Job<'_>, Failure> {
        let not_contiguous =
            |e: numpy::AsSliceError| Failure::new("InternalError", format!("a frame: {e}"));
        Ok(match self {
            Self::File(path) => Job::File(path),
            Self::Gray8(array) => {
                let pixels = array.as_slice().map_err(not_contiguous)?;
                Job::Bits8(pixels, sides(array.shape()))
            }
            Self::Gray16(array) => {
                let pixels = array.as_slice().map_err(not_contiguous)?;
                Job::Bits16(pixels, sides(array.shape()))
            }
        })
    }
}

/// Rows and columns.
fn sides(shape: &[usize]) -> [usize; 2] {
    [0, 1].map(|k| shape.get(k).copied().unwrap_or(0))
}

/// What is the same for all frames: how spots are found, and where pictures of them go.
struct Finding<'a> {
    finder: SpotFinder<'a>,
    overlay: Option<OverlayFolder>,
    /// Whether a file that cannot be read is a wrong call rather than a row.
    alone: bool,
}

/// A frame's place in the list, what it is called, when it was taken.
struct Called {
    index: usize,
    file: String,
    unix_ns: Option<i64>,
}

impl Finding<'_> {
    fn in_view<P: Gray>(
        &self,
        view: View<'_, P>,
        called: Called,
        room: &mut FinderRoom,
    ) -> Result<(SpotRow, SeenInFrame), Failure> {
        let Called {
            index,
            file,
            unix_ns,
        } = called;
        let found = self.finder.find_in(view, file, unix_ns, room)?;
        if let Some(overlay) = &self.overlay {
            overlay.write(index, view, &found.1)?;
        }
        Ok(found)
    }

    fn in_frame(
        &self,
        frame: Result<Frame, String>,
        called: Called,
        room: &mut FinderRoom,
    ) -> Result<(SpotRow, SeenInFrame), Failure> {
        match frame {
            Ok(Frame::Gray8(picture)) => self.in_view(picture.view(), called, room),
            Ok(Frame::Gray16(picture)) => self.in_view(picture.view(), called, room),
            Err(reason) => {
                let row = SpotRow::unreadable(called.file, called.unix_ns, reason);
                Ok((row, SeenInFrame::default()))
            }
        }
    }

    fn in_job(
        &self,
        job: &Job<'_>,
        called: Called,
        room: &mut FinderRoom,
    ) -> Result<(SpotRow, SeenInFrame), Failure> {
        match *job {
            Job::File(path) => {
                let frame = match frame_of_file(path) {
                    Err(error) if self.alone => return Err(error.into()),
                    Err(error) => Err(error.problem().to_string()),
                    Ok(frame) => frame,
                };
                self.in_frame(frame, called, room)
            }
            // Three samples a pixel are colours.
            Job::Bits8(samples, [rows, columns]) if samples.len() > rows * columns => {
                let picture = Picture::<u8>::of_rgb(samples, columns, rows)?;
                self.in_view(picture.view(), called, room)
            }
            Job::Bits8(pixels, [rows, columns]) => {
                self.in_view(View::new(pixels, columns, rows)?, called, room)
            }
            Job::Bits16(samples, [rows, columns]) if samples.len() > rows * columns => {
                let picture = Picture::<u16>::of_rgb(samples, columns, rows)?;
                self.in_view(picture.view(), called, room)
            }
            Job::Bits16(pixels, [rows, columns]) => {
                self.in_view(View::new(pixels, columns, rows)?, called, room)
            }
        }
    }
}

/// Files that paths stand for, folders, patterns and lists as the command line takes them; and what is to be said of them.
#[pyfunction]
pub(crate) fn _frame_files(paths: Vec<PathBuf>) -> PyResult<(Vec<PathBuf>, Option<String>)> {
    guarded(|| {
        let files = frame_files(&paths)?;
        let warning = files.warning();
        Ok((files.paths, warning))
    })
}

/// When frames were taken, by their place or by the numbers in what they are called; and what is to be said of the numbers.
#[pyfunction]
pub(crate) fn _frame_times(
    called: Vec<PathBuf>,
    frames: usize,
    start_ns: i64,
    fps: f64,
    numbered: bool,
) -> PyResult<(Vec<i64>, Option<String>)> {
    guarded(|| {
        let mut clock = FrameClock::new(start_ns, fps);
        let mut warning = None;
        if numbered && frames > 0 {
            clock = clock.numbered(&called).map_err(|error| {
                let error = match error {
                    FrameNumberError::NoFiles => "arrays have no names: give them".to_owned(),
                    other => other.to_string(),
                };
                Failure::of("OptionError", "numbered", error)
            })?;
        } else {
            let gap = frame_gap(&called);
            warning = gap.map(|gap| format!("{gap}: numbered=True takes times from the numbers"));
        }
        Ok(((0..frames).map(|index| clock.at(index)).collect(), warning))
    })
}

/// Where the pixels of an array are read from, for the test that they are not copied.
#[pyfunction]
pub(crate) fn _pixels_read(image: &Bound<'_, PyAny>) -> PyResult<usize> {
    guarded(|| {
        let given = Given::of(image)?;
        Ok(match given.job()? {
            Job::File(_) => 0,
            Job::Bits8(pixels, _) => pixels.as_ptr().addr(),
            Job::Bits16(pixels, _) => pixels.as_ptr().addr(),
        })
    })
}

/// The spots of frames, in their order; `names` and `times` are as many as these. Pictures of them are called as
/// `pictures` says. A frame that is `alone` must be there.
#[pyfunction]
pub(crate) fn _find_spots<'py>(
    py: Python<'py>,
    frames: Vec<Bound<'py, PyAny>>,
    names: Vec<String>,
    times: Option<Vec<i64>>,
    asked: SpotsAsked,
    pictures: Vec<PathBuf>,
    alone: bool,
    progress: Option<Py<PyAny>>,
) -> PyResult<Bound<'py, PyDict>> {
    guarded(|| {
        let target = asked.target()?;
        let given: Vec<Given<'py>> = frames.iter().map(Given::of).collect::<Result<_, _>>()?;
        let jobs: Vec<Job<'_>> = given.iter().map(Given::job).collect::<Result<_, _>>()?;
        let read = jobs.iter().filter_map(|job| match job {
            Job::File(path) => Some(path.to_path_buf()),
            _ => None,
        });
        let finding = Finding {
            finder: SpotFinder::new(&target, asked.method(&target)?),
            overlay: asked.overlay(&pictures, read)?,
            alone,
        };
        let total = jobs.len() as u64;
        let one = |room: &mut FinderRoom, index: usize| {
            let called = Called {
                index,
                file: names.get(index).cloned().unwrap_or_default(),
                unix_ns: times.as_ref().and_then(|t| t.get(index)).copied(),
            };
            finding.in_job(&jobs[index], called, room)
        };
        type Found = Result<Option<(SpotRow, SeenInFrame)>, Failure>;
        let found: Vec<Found> = if jobs.len() == 1 && progress.is_none() {
            py.detach(|| vec![one(&mut FinderRoom::default(), 0).map(Some)])
        } else {
            watched(py, progress.as_ref(), |watch| {
                let each = |room: &mut FinderRoom, index: usize| {
                    if !watch(0, total) {
                        return Ok(None); // the user's signal is what is raised
                    }
                    let found = one(room, index)?;
                    watch(1, total);
                    Ok(Some(found))
                };
                (0..jobs.len())
                    .into_par_iter()
                    .with_max_len(1)
                    .map_init(FinderRoom::default, each)
                    .collect()
            })?
        };
        // Of several failures the first, whoever came to it first.
        let found = found.into_iter().collect::<Result<Vec<_>, _>>()?;
        answer(py, found.into_iter().flatten().collect())
    })
}

fn answer(
    py: Python<'_>,
    found: Vec<(SpotRow, SeenInFrame)>,
) -> Result<Bound<'_, PyDict>, Failure> {
    let (rows, seen): (Vec<SpotRow>, Vec<SeenInFrame>) = found.into_iter().unzip();
    let columns = KeptColumns::default();
    write_spots(Destination::Columns(columns.clone()), Format::Csv, &rows)?;
    let corners: Vec<f64> = seen
        .iter()
        .flat_map(|seen| match &seen.plane {
            Some(plane) => plane.corners().at_px,
            None => [[f64::NAN; 2]; 4],
        })
        .flatten()
        .collect();
    let covariance: Vec<f64> = seen
        .iter()
        .flat_map(|seen| seen.covariance_m2.unwrap_or([[f64::NAN; 2]; 2]))
        .flatten()
        .collect();
    let dict = PyDict::new(py);
    let table: Bound<'_, PyList> = handed_out(py, columns.take())?;
    dict.set_item("table", table)?;
    dict.set_item("corners_px", owned(py, corners, &[rows.len(), 4, 2])?)?;
    dict.set_item("covariance_m2", owned(py, covariance, &[rows.len(), 2, 2])?)?;
    Ok(dict)
}
