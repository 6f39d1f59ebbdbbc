//! Panics: there should be none, and if there is one it reaches Python as an ordinary exception.

use std::any::Any;
use std::panic::{AssertUnwindSafe, catch_unwind};

use pyo3::prelude::*;

use crate::failure::Failure;

/// Runs what an entry point does. A panic, which PyO3 would turn into an exception that `except Exception`
/// does not catch, becomes `helio_py.InternalError`.
pub(crate) fn guarded<T>(work: impl FnOnce() -> Result<T, Failure>) -> PyResult<T> {
    match catch_unwind(AssertUnwindSafe(work)) {
        Ok(Ok(done)) => Ok(done),
        Ok(Err(failure)) => Err(failure.into()),
        Err(panic) => Err(internal(panic.as_ref()).into()),
    }
}

#[cold]
fn internal(panic: &(dyn Any + Send)) -> Failure {
    let said = panic
        .downcast_ref::<&str>()
        .map(ToString::to_string)
        .or_else(|| panic.downcast_ref::<String>().cloned())
        .unwrap_or_else(|| "no message".to_string());
    let message = format!("a fault of helio-rs itself, please report it: {said}");
    Failure::new("InternalError", message)
}

/// Panics, for the test of what becomes of panics.
#[pyfunction]
pub(crate) fn _panic() -> PyResult<()> {
    guarded(|| {
        let nothing: [u8; 0] = [];
        let row = std::hint::black_box(7);
        // The one panic of this crate, wanted.
        let _ = nothing[row];
        Ok(())
    })
}
