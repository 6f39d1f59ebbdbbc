//! `simulate_images`: the typed call and its answer are in `helio_py._images`.

use std::path::PathBuf;
use std::sync::Arc;

use helio_io::output::{Destination, Format, KeptColumns};
use helio_io::{
    FramePixels, ImageBeam, ImagePlan, ImagesError, SimulatedImages, load_observation_log,
};
use helio_spot::simulate::Depth;
use helio_spot::{Board, LensValues, Marks, SpotError};
use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::array::owned;
use crate::failure::Failure;
use crate::guard::guarded;
use crate::table::{Given, handed_out};
use crate::watch::watched_or_left;

/// What is photographed, as the keywords of `simulate_images` have it.
#[derive(FromPyObject)]
#[pyo3(from_item_all)]
pub(crate) struct ImagesAsked {
    frames: u32,
    seed: u64,
    size: [usize; 2],
    bits: u8,
    width_m: f64,
    height_m: f64,
    marks: String,
    shape: String,
    beam_m: f64,
    peak: f64,
    daylight: f64,
    gradient: f64,
    shadow: f64,
    texture: f64,
    noise: f64,
    turn_deg: f64,
    tilt_deg: f64,
    roll_deg: f64,
    distortion: f64,
    second: f64,
    stray: f64,
    empty_every: Option<u32>,
    find_marks: bool,
}

impl ImagesAsked {
    fn plan(self) -> Result<ImagePlan, Failure> {
        let all = [
            Marks::FourCorners,
            Marks::TwoPanelUpper,
            Marks::TwoPanelLower,
        ];
        Ok(ImagePlan {
            frames: self.frames,
            seed: self.seed,
            size_px: self.size,
            depth: match self.bits {
                16 => Depth::Bits16,
                _ => Depth::Bits8,
            },
            board: Board {
                width_m: self.width_m,
                height_m: self.height_m,
                marks: word(&all, Marks::as_str, &self.marks, "marks")?,
            },
            shape: word(&ImageBeam::ALL, ImageBeam::as_str, &self.shape, "shape")?,
            beam_m: self.beam_m,
            peak: self.peak,
            daylight: self.daylight,
            gradient: self.gradient,
            shadow: self.shadow,
            texture: self.texture,
            noise: self.noise,
            turn_deg: self.turn_deg,
            tilt_deg: self.tilt_deg,
            roll_deg: self.roll_deg,
            distortion: self.distortion,
            second: self.second,
            stray: self.stray,
            empty_every: self.empty_every,
            find_marks: self.find_marks,
        })
    }
}

/// What a word stands for.
fn word<T: Copy>(
    all: &[T],
    as_str: impl Fn(T) -> &'static str,
    found: &str,
    what: &str,
) -> Result<T, Failure> {
    let of_word = all.iter().find(|one| as_str(**one) == found);
    of_word.copied().ok_or_else(|| {
        let known: Vec<&str> = all.iter().map(|one| as_str(*one)).collect();
        let message = format!("wanted one of {}, got `{found}`", known.join(", "));
        Failure::of("OptionError", what, message)
    })
}

impl From<ImagesError> for Failure {
    fn from(error: ImagesError) -> Self {
        match error {
            ImagesError::Io(error) => error.into(),
            ImagesError::Spot(SpotError::BadOption { what, .. }) if what.contains("pixels") => {
                Self::of("OptionError", "size", error)
            }
            ImagesError::Spot(error) => error.into(),
            ImagesError::Lens(error) => Self::of("OptionError", "distortion", error),
            ImagesError::Held { ref folder, .. } => {
                let path = folder.clone();
                Self::of("ConflictError", "out", error).with_path(path)
            }
            ImagesError::TooMany { .. } => Self::of("OptionError", "frames", error),
            _ => Self::new("InternalError", error.to_string()),
        }
    }
}

/// Frames in a folder or, without one, in memory; their truth, names and target.
#[pyfunction]
pub(crate) fn _simulate_images<'py>(
    py: Python<'py>,
    observations: Option<&Bound<'py, PyAny>>,
    asked: ImagesAsked,
    out: Option<PathBuf>,
    progress: Option<Py<PyAny>>,
) -> PyResult<Bound<'py, PyDict>> {
    guarded(|| {
        let find_marks = asked.find_marks;
        let plan = asked.plan()?;
        let (board, [width, height]) = (plan.board, plan.size_px);
        let given = observations.map(|o| Given::of(o, "observations"));
        let given = given.transpose()?;
        let images = py.detach(|| -> Result<SimulatedImages, Failure> {
            let images = SimulatedImages::new(plan)?;
            Ok(match &given {
                Some(given) => images.with_log(load_observation_log(given.source())?),
                None => images,
            })
        })?;
        let images = Arc::new(images);
        let theirs = Arc::clone(&images);
        // One large frame takes longer than anybody waits who wants an end.
        let made = watched_or_left(py, progress.as_ref(), move |watch| match &out {
            Some(folder) => theirs.write(folder, watch).map(|truths| (None, truths)),
            None => theirs
                .pixels(watch)
                .map(|(pixels, truths)| (Some(pixels), truths)),
        })?;
        let (pixels, truths) = made?;
        let (truth, log) = (KeptColumns::default(), KeptColumns::default());
        images.write_truth(Destination::Columns(truth.clone()), Format::Csv, &truths)?;
        images.write_log(Destination::Columns(log.clone()), Format::Csv)?;
        let shape = [images.len(), height, width];
        let frames = match pixels {
            Some(FramePixels::Bits8(pixels)) => Some(owned(py, pixels, &shape)?),
            Some(FramePixels::Bits16(pixels)) => Some(owned(py, pixels, &shape)?),
            None => None,
        };
        let corners_px = images.corners_px()?;
        let target = PyDict::new(py);
        target.set_item("width_m", board.width_m)?;
        target.set_item("height_m", board.height_m)?;
        target.set_item("marks", board.marks.as_str())?;
        target.set_item("frame_width_px", width)?;
        target.set_item("frame_height_px", height)?;
        if find_marks {
            target.set_item("marks_sigma_m", 0.0)?;
        } else {
            target.set_item("corners_px", corners_px.map(Vec::from).to_vec())?;
            target.set_item("corners_sigma_px", 0.1)?;
        }
        if let Some(lens) = images.lens() {
            target.set_item("camera", camera(py, lens.values())?)?;
        }
        let dict = PyDict::new(py);
        dict.set_item("names", images.names())?;
        dict.set_item("truth", handed_out(py, truth.take())?)?;
        dict.set_item("log", handed_out(py, log.take())?)?;
        dict.set_item("frames", frames)?;
        dict.set_item("target", target)?;
        Ok(dict)
    })
}

/// The keys of a lens.
fn camera<'py>(py: Python<'py>, values: &LensValues) -> PyResult<Bound<'py, PyDict>> {
    let camera = PyDict::new(py);
    for (key, value) in [
        ("fx_px", values.fx_px),
        ("fy_px", values.fy_px),
        ("cx_px", values.cx_px),
        ("cy_px", values.cy_px),
        ("k1", values.k1),
        ("k2", values.k2),
        ("p1", values.p1),
        ("p2", values.p2),
        ("k3", values.k3),
    ] {
        camera.set_item(key, value)?;
    }
    Ok(camera)
}
