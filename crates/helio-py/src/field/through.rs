//! Angles and steps through the drives of a field.

use pyo3::prelude::*;

use super::PyField;
use crate::array::{Numbers, owned, wrong_shape};
use crate::guard::guarded;

impl PyField {
    /// Two columns of angles or steps, each of shape (n,) or (m, n), through every heliostat's drives.
    pub(super) fn through_drives<'py>(
        &self,
        py: Python<'py>,
        given: [(&Bound<'py, PyAny>, &str); 2],
        convert: impl Fn(&helio_core::drive::Drive, f64) -> Option<f64> + Sync,
    ) -> PyResult<(Bound<'py, PyAny>, Bound<'py, PyAny>)> {
        guarded(|| {
            let n = self.inner.len();
            let one = |axis: usize| {
                let (value, what) = given[axis];
                let numbers = Numbers::of(value, what)?;
                if !matches!(*numbers.shape(), [found] | [_, found] if found == n) {
                    let wanted = format!("({n},) or (m, {n})");
                    return Err(wrong_shape(what, &wanted, numbers.shape()));
                }
                let slice = numbers.as_slice()?;
                let done: Vec<f64> = py.detach(|| {
                    let rows = slice.iter().enumerate();
                    let through = rows.map(|(row, &number)| {
                        let drive = self.inner.drives(row % n)[axis];
                        drive.and_then(|drive| convert(&drive, number))
                    });
                    through.map(|found| found.unwrap_or(f64::NAN)).collect()
                });
                owned(py, done, numbers.shape())
            };
            Ok((one(0)?, one(1)?))
        })
    }
}
