//! `find_spots` of raw video: a file, memory, or whatever Python reads bytes from.

use std::fs::File;
use std::io::{self, BufReader, Read};
use std::path::PathBuf;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};

use helio_io::{
    CameraTarget, FinderRoom, FrameClock, IoError, OverlayFolder, RawFrames, SeenInFrame,
    SpotFinder, SpotMethod, SpotRow, parse_raw,
};
use helio_spot::{Limits, RawFormat, RawVideo};
use numpy::PyReadonlyArrayDyn;
use pyo3::prelude::*;
use pyo3::types::{PyBytes, PyDict};

use super::{Called, Finding, SpotsAsked, answer};
use crate::failure::Failure;
use crate::guard::guarded;
use crate::pool;
use crate::watch::{watched_alone, watched_alone_or_left};

/// Bytes asked of Python at once.
const CHUNK: usize = 1 << 20;
/// Frames that may wait to be looked at: of so many bytes together, one at least and so many at most.
const WAITING: (u64, u64) = (1 << 28, 16);

/// How the frames of a video are looked at.
struct Video {
    target: CameraTarget,
    method: SpotMethod,
    overlay: Option<OverlayFolder>,
    frames: RawFrames,
    clock: Option<FrameClock>,
}

/// The spots of raw video from a path, an array of bytes, or an object with `read`.
#[pyfunction]
pub(crate) fn _find_raw_spots<'py>(
    py: Python<'py>,
    source: &Bound<'py, PyAny>,
    raw: &str,
    clock: Option<(i64, f64)>,
    asked: SpotsAsked,
    progress: Option<Py<PyAny>>,
) -> PyResult<Bound<'py, PyDict>> {
    guarded(|| {
        let refused = |message: String| Failure::of("OptionError", "raw", message);
        let frames = parse_raw(raw).map_err(|wanted| refused(format!("{wanted}, got `{raw}`")))?;
        let target = asked.target()?;
        let path: Option<PathBuf> = source.extract().ok();
        let video = Video {
            method: asked.method(&target)?,
            target,
            overlay: asked.overlay(&[], path.clone().into_iter())?,
            frames,
            clock: clock.map(|(start_ns, fps)| FrameClock::new(start_ns, fps)),
        };
        video
            .of(io::empty())
            .map_err(|error| refused(error.to_string()))?;
        let found = if let Ok(bytes) = source.extract::<PyReadonlyArrayDyn<'py, u8>>() {
            let bytes = bytes.as_slice().map_err(PyErr::from)?;
            let total = (bytes.len() as u64).div_ceil(video.frame_bytes());
            watched_alone(py, progress.as_ref(), |watch| {
                video.spots(bytes, Some(total), watch)
            })??
        } else if let Some(path) = path {
            let file = opened(&path)?;
            let length = file.metadata().ok().filter(|of| of.is_file());
            let total = length.map(|of| of.len().div_ceil(video.frame_bytes()));
            // Reading may take as long as whoever writes into a pipe.
            watched_alone_or_left(py, progress.as_ref(), move |watch| {
                video.spots(file, total, watch)
            })??
        } else {
            let raised = Arc::new(Mutex::new(None));
            let file = Object {
                file: source.clone().unbind(),
                raised: Arc::clone(&raised),
            };
            let file = BufReader::with_capacity(CHUNK, file);
            let found = watched_alone_or_left(py, progress.as_ref(), move |watch| {
                video.spots(file, None, watch)
            })?;
            let raised = raised.lock().unwrap_or_else(PoisonError::into_inner).take();
            match raised {
                Some(error) => return Err(error),
                None => found?,
            }
        };
        if found.is_empty() {
            let message = "no frame of video; wanted raw gray pixels as raw says";
            return Err(Failure::of("ImageError", "images", message));
        }
        answer(py, found)
    })
}

fn opened(path: &PathBuf) -> Result<File, Failure> {
    let file = File::open(path).map_err(|error| IoError::read(path, error))?;
    if path.is_dir() {
        let error = io::Error::from(io::ErrorKind::IsADirectory);
        return Err(IoError::read(path, error).into());
    }
    Ok(file)
}

impl Video {
    fn frame_bytes(&self) -> u64 {
        let of_pixel = match self.frames.format {
            RawFormat::Gray8 => 1,
            RawFormat::Gray16Le => 2,
        };
        self.frames.width as u64 * self.frames.height as u64 * of_pixel
    }

    fn of<R: Read>(&self, reader: R) -> Result<RawVideo<R>, helio_spot::DecodeError> {
        let RawFrames {
            width,
            height,
            format,
            ..
        } = self.frames;
        RawVideo::new(reader, width, height, format, &Limits::default())
    }

    /// What is in each frame, in their order, until `watch` wants an end.
    ///
    /// The caller's thread reads, so that threads of the pool, which others want too, wait for no stream.
    fn spots<R: Read + Send>(
        &self,
        reader: R,
        total: Option<u64>,
        watch: &(dyn Fn(u64, u64) -> bool + Sync),
    ) -> Result<Vec<(SpotRow, SeenInFrame)>, Failure> {
        let video = self.of(reader);
        let video = video.map_err(|error| Failure::of("OptionError", "raw", error))?;
        let finding = Finding {
            finder: SpotFinder::new(&self.target, self.method.clone()),
            overlay: self.overlay.clone(),
            alone: false,
        };
        let most = (WAITING.0 / self.frame_bytes()).clamp(1, WAITING.1) as usize;
        let desk = Desk::default();
        let read = AtomicU64::new(0);
        let all = || total.unwrap_or_else(|| read.load(Ordering::Relaxed));
        pool::handing_out(|scope| {
            for (index, frame) in video.enumerate() {
                read.fetch_add(1, Ordering::Relaxed);
                if !watch(0, all()) || !desk.takes_one(most) {
                    break;
                }
                let (finding, desk, all) = (&finding, &desk, &all);
                scope.spawn(move |_| {
                    let place = Place(desk);
                    let called = Called {
                        index,
                        file: format!("frame {index}"),
                        unix_ns: self.clock.as_ref().map(|clock| clock.at(index)),
                    };
                    let mut room = desk.locked().rooms.pop().unwrap_or_default();
                    let frame = frame.map_err(|error| error.to_string());
                    let found = finding.in_frame(frame, called, &mut room);
                    let mut kept = desk.locked();
                    kept.failed |= found.is_err();
                    kept.rooms.push(room);
                    kept.done.push((index, found));
                    drop(kept);
                    watch(1, all());
                    drop(place);
                });
            }
        })?;
        watch(0, all());
        let mut done = std::mem::take(&mut desk.locked().done);
        done.sort_unstable_by_key(|(index, _)| *index);
        // Of several failures the first, whoever came to it first.
        done.into_iter().map(|(_, found)| found).collect()
    }
}

/// What was found in a frame.
type Found = Result<(SpotRow, SeenInFrame), Failure>;

/// Where frames wait to be looked at, and what was found in them.
#[derive(Default)]
struct Desk {
    kept: Mutex<Kept>,
    fewer: Condvar,
}

#[derive(Default)]
struct Kept {
    waiting: usize,
    failed: bool,
    rooms: Vec<FinderRoom>,
    done: Vec<(usize, Found)>,
}

impl Desk {
    fn locked(&self) -> MutexGuard<'_, Kept> {
        self.kept.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Takes a frame when there is a place; false where one failed, and no more are wanted.
    fn takes_one(&self, most: usize) -> bool {
        let full = |kept: &mut Kept| kept.waiting >= most && !kept.failed;
        let kept = self.fewer.wait_while(self.locked(), full);
        let mut kept = kept.unwrap_or_else(PoisonError::into_inner);
        kept.waiting += 1;
        !kept.failed
    }
}

/// A frame's place on the desk, free again whatever happens to it.
struct Place<'a>(&'a Desk);

impl Drop for Place<'_> {
    fn drop(&mut self) {
        self.0.locked().waiting -= 1;
        self.0.fewer.notify_one();
    }
}

/// An object of Python's that bytes are read from.
struct Object {
    file: Py<PyAny>,
    /// What Python raised, of which a reader can only say that there was something.
    raised: Arc<Mutex<Option<Failure>>>,
}

impl Read for Object {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        let read = Python::attach(|py| {
            let found = self.file.bind(py).call_method1("read", (buffer.len(),))?;
            let wrong = |found: String| {
                let message =
                    format!("expected a file opened for bytes, but its read gave {found}");
                Failure::of("DataTypeError", "images", message)
            };
            let Ok(bytes) = found.cast::<PyBytes>() else {
                return Err(wrong(found.get_type().name()?.to_string()));
            };
            let bytes = bytes.as_bytes();
            match buffer.get_mut(..bytes.len()) {
                Some(part) => part.copy_from_slice(bytes),
                None => return Err(wrong(format!("{} bytes for {}", bytes.len(), buffer.len()))),
            }
            Ok(bytes.len())
        });
        read.map_err(|error: Failure| {
            *self.raised.lock().unwrap_or_else(PoisonError::into_inner) = Some(error);
            io::Error::other("what Python raised")
        })
    }
}
