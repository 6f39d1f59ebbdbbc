//! `convert_paint`: the typed call is in `helio_py._paint`.

use std::collections::BTreeMap;
use std::path::PathBuf;

use helio_io::{Paint, PaintCentroid, PaintError, PaintFiles};
use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::array::owned;
use crate::failure::Failure;
use crate::guard::guarded;
use crate::watch::watched;

impl From<PaintError> for Failure {
    fn from(error: PaintError) -> Self {
        match error {
            PaintError::Io(error) => error.into(),
            PaintError::UnknownAim { .. } => Self::of("OptionError", "aim", error),
            PaintError::WithoutProperties { .. } => Self::of("OptionError", "heliostats", error),
            other => Self::new("InternalError", other.to_string()),
        }
    }
}

/// Files as the keywords of `convert_paint` have them.
#[derive(FromPyObject)]
#[pyo3(from_item_all)]
pub(crate) struct PaintAsked {
    tower: PathBuf,
    /// A folder in PAINT's own order, unless files are named one by one.
    folder: Option<PathBuf>,
    heliostats: BTreeMap<String, PathBuf>,
    records: BTreeMap<String, Vec<PathBuf>>,
    out: PathBuf,
    centroid: String,
    aim: Option<String>,
}

/// Converts records of PAINT.
#[pyfunction]
pub(crate) fn _convert_paint<'py>(
    py: Python<'py>,
    asked: PaintAsked,
    progress: Option<Py<PyAny>>,
) -> PyResult<Bound<'py, PyDict>> {
    guarded(|| {
        let word = asked.centroid.as_str();
        let known = PaintCentroid::ALL.into_iter();
        let centroid = known.clone().find(|centroid| centroid.as_str() == word);
        let centroid = centroid.ok_or_else(|| {
            let known = known.map(PaintCentroid::as_str).collect::<Vec<_>>();
            let message = format!("wanted {}, got `{word}`", known.join(" or "));
            Failure::of("OptionError", "centroid", message)
        })?;
        let (paint, field, observations) = watched(py, progress.as_ref(), |watch| {
            let files = match asked.folder {
                Some(folder) => PaintFiles::in_folder(&folder)?,
                None => PaintFiles {
                    heliostats: asked.heliostats,
                    records: asked.records,
                },
            };
            let aim = asked.aim.as_deref();
            let paint = Paint::read(&asked.tower, &files, centroid, aim, watch)?;
            let (field, observations) = paint.write(&asked.out)?;
            Ok::<_, Failure>((paint, field, observations))
        })??;
        let dict = PyDict::new(py);
        dict.set_item("field_toml", field)?;
        dict.set_item("observations_csv", observations)?;
        dict.set_item("heliostats", paint.heliostats())?;
        let off_plane_m = paint.off_plane_m();
        let records = off_plane_m.len();
        dict.set_item("records", records)?;
        dict.set_item("off_plane_m", owned(py, off_plane_m, &[records])?)?;
        dict.set_item("left_aside", paint.left_aside())?;
        dict.set_item("warnings", paint.warnings())?;
        Ok(dict)
    })
}
