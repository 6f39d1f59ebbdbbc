//! Single arguments as what they have to be, or an error that names them: PyO3's own conversion would raise a `TypeError`
//! that is none of ours.

use std::path::PathBuf;

use pyo3::exceptions::PyKeyboardInterrupt;
use pyo3::prelude::*;

use crate::array::scalar;
use crate::failure::Failure;

/// A real number.
pub(crate) fn number(given: &Bound<'_, PyAny>, what: &str) -> Result<f64, Failure> {
    scalar(given, what)
}

/// True or false.
pub(crate) fn flag(given: &Bound<'_, PyAny>, what: &str) -> Result<bool, Failure> {
    extracted(given, what, "True or False")
}

/// A text.
pub(crate) fn text(given: &Bound<'_, PyAny>, what: &str) -> Result<String, Failure> {
    extracted(given, what, "str")
}

/// A text, or what stands for none.
pub(crate) fn text_or(
    given: Option<&Bound<'_, PyAny>>,
    what: &str,
    default: &str,
) -> Result<String, Failure> {
    given.map_or_else(|| Ok(default.to_string()), |given| text(given, what))
}

/// The path of a file.
pub(crate) fn path(given: &Bound<'_, PyAny>, what: &str) -> Result<PathBuf, Failure> {
    extracted(given, what, "a path")
}

fn extracted<'a, 'py, T>(
    given: &'a Bound<'py, PyAny>,
    what: &str,
    wanted: &str,
) -> Result<T, Failure>
where
    T: FromPyObject<'a, 'py>,
{
    given.extract().map_err(|error: T::Error| {
        let error: PyErr = error.into();
        let py = given.py();
        if error.is_instance_of::<PyKeyboardInterrupt>(py) {
            return Failure::Python(error);
        }
        let found = match given.is_none() {
            true => "nothing".to_string(),
            false => given
                .get_type()
                .name()
                .map_or_else(|_| "something else".to_string(), |name| name.to_string()),
        };
        Failure::of(
            "DataTypeError",
            what,
            format_args!("expected {wanted}, got {found}"),
        )
    })
}
