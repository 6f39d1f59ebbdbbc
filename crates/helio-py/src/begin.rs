//! `init`, `schema` and what `Field.check` says: the typed calls are in `helio_py._begin`.

use std::path::PathBuf;
use std::time::{SystemTime, UNIX_EPOCH};

use helio_core::Status;
use helio_io::{CheckError, ExampleError, FieldCheck, write_example_field};
use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::failure::Failure;
use crate::field::PyField;
use crate::guard::guarded;
use crate::watch::watched;

impl From<ExampleError> for Failure {
    fn from(error: ExampleError) -> Self {
        match error {
            ExampleError::Io(error) => error.into(),
            ExampleError::There { ref path } => {
                let path = path.clone();
                let message = format!("{error}; force=True replaces it");
                Self::of("ConflictError", "folder", message).with_path(path)
            }
            ExampleError::NoFolder { ref folder, .. } => {
                let path = folder.clone();
                Self::of("FileError", "folder", error).with_path(path)
            }
            _ => Self::new("FileError", error.to_string()),
        }
    }
}

/// Writes the example field and answers the path of its field.toml.
#[pyfunction]
pub(crate) fn _init(py: Python<'_>, folder: PathBuf, force: bool) -> PyResult<PathBuf> {
    guarded(|| Ok(py.detach(|| write_example_field(&folder, force))?.field))
}

/// The JSON Schema of a kind of file, as the command line prints it.
#[pyfunction]
pub(crate) fn _schema(of: &str) -> PyResult<String> {
    guarded(|| {
        let schema = match of {
            "field" => helio_io::schema(),
            "target" => helio_io::target_schema(),
            "scene" => helio_io::scene_schema(),
            other => {
                let message = format!("wanted field, target or scene, got `{other}`");
                return Err(Failure::of("OptionError", "of", message));
            }
        };
        Ok(format!("{schema:#}\n"))
    })
}

impl From<CheckError> for Failure {
    fn from(error: CheckError) -> Self {
        match error {
            CheckError::Sun(error) => error.into(),
            CheckError::Track(error) => error.into(),
            _ => Self::new("InternalError", error.to_string()),
        }
    }
}

/// What there is to say of a field, at an instant or now.
#[pyfunction]
pub(crate) fn _check_field<'py>(
    py: Python<'py>,
    field: &Bound<'py, PyAny>,
    unix_ns: Option<i64>,
    progress: Option<Py<PyAny>>,
) -> PyResult<Bound<'py, PyDict>> {
    guarded(|| {
        let field = PyField::of(field)?.get().inner();
        let (loaded, files) = (field.loaded(), field.named());
        let unix_ns = unix_ns.unwrap_or_else(now_ns);
        let check = watched(py, progress.as_ref(), |watch| {
            FieldCheck::of(loaded, files, unix_ns, watch)
        })??;
        let ids = |rows: &[usize]| -> Vec<&str> {
            rows.iter()
                .map(|&row| loaded.field.ids()[row].as_str())
                .collect()
        };
        let dict = PyDict::new(py);
        dict.set_item("text", &check.text)?;
        dict.set_item("suns", check.suns)?;
        let counts = PyDict::new(py);
        for (status, count) in check.tally.rows() {
            if count > 0 || status == Status::Ok {
                counts.set_item(status.as_str(), count)?;
            }
        }
        dict.set_item("counts", counts)?;
        dict.set_item("never", ids(&check.never))?;
        dict.set_item("sometimes", ids(&check.sometimes))?;
        Ok(dict)
    })
}

/// Whole seconds, as the command line has them.
fn now_ns() -> i64 {
    let now = SystemTime::now().duration_since(UNIX_EPOCH);
    let seconds = now.map_or(0, |since| since.as_secs().min(4_000_000_000) as i64);
    seconds * 1_000_000_000
}
