//! NumPy arrays in and out.
//!
//! An array that is contiguous float64 already is read where it lies. Of anything else that holds
//! plain real numbers (other dtypes and layouts, lists, whatever converts itself) NumPy makes a copy.

use numpy::{
    IntoPyArray, PyArray, PyArrayDyn, PyArrayMethods, PyReadonlyArrayDyn, PyUntypedArray,
    PyUntypedArrayMethods,
};
use pyo3::prelude::*;
use pyo3::sync::PyOnceLock;
use pyo3::types::PyFloat;

use crate::failure::Failure;
use crate::guard::guarded;

/// Real numbers from Python, contiguous.
pub(crate) struct Numbers<'py> {
    array: PyReadonlyArrayDyn<'py, f64>,
}

impl<'py> Numbers<'py> {
    /// What an argument holds; `what` is its name.
    ///
    /// # Errors
    /// `DataTypeError` for anything but real numbers.
    pub(crate) fn of(value: &Bound<'py, PyAny>, what: &str) -> Result<Self, Failure> {
        if let Ok(array) = value.cast_exact::<PyUntypedArray>()
            && let Ok(array) = array.cast::<PyArrayDyn<f64>>()
            && array.is_c_contiguous()
        {
            // Misaligned memory is refused here, and copied below.
            let array = array.try_readonly();
            if let Ok(array) = array
                && array.as_slice().is_ok()
            {
                return Ok(Self { array });
            }
        }
        let array = converted(value, what)?;
        let array = array.cast_into::<PyArrayDyn<f64>>().map_err(PyErr::from)?;
        Ok(Self {
            array: array.readonly(),
        })
    }

    pub(crate) fn shape(&self) -> &[usize] {
        self.array.shape()
    }

    pub(crate) fn as_slice(&self) -> Result<&[f64], Failure> {
        self.array
            .as_slice()
            .map_err(|e| Failure::new("InternalError", format!("an array is not contiguous: {e}")))
    }

    /// The numbers of a column of `len` rows, or one number for all of them.
    pub(crate) fn column(&self, what: &str, len: usize) -> Result<Column<'_>, Failure> {
        match *self.shape() {
            [] => Ok(Column::All(self.as_slice()?[0])),
            [found] if found == len => Ok(Column::Each(self.as_slice()?)),
            _ => Err(wrong_shape(what, &format!("() or ({len},)"), self.shape())),
        }
    }
}

/// A number for each row, or one for all.
pub(crate) enum Column<'a> {
    All(f64),
    Each(&'a [f64]),
}

impl Column<'_> {
    pub(crate) fn get(&self, row: usize) -> f64 {
        match self {
            Self::All(number) => *number,
            Self::Each(numbers) => numbers[row],
        }
    }
}

/// A float of Python, NumPy's float64 among them: the quick way past [`Numbers`].
#[inline]
pub(crate) fn float(value: &Bound<'_, PyAny>) -> Option<f64> {
    value.cast::<PyFloat>().ok().map(|float| float.value())
}

/// One number.
pub(crate) fn scalar(value: &Bound<'_, PyAny>, what: &str) -> Result<f64, Failure> {
    if let Some(float) = float(value) {
        return Ok(float);
    }
    let numbers = Numbers::of(value, what)?;
    match *numbers.shape() {
        [] => Ok(numbers.as_slice()?[0]),
        _ => Err(wrong_shape(what, "()", numbers.shape())),
    }
}

#[cold]
pub(crate) fn wrong_shape(what: &str, wanted: &str, found: &[usize]) -> Failure {
    let found = shape_text(found);
    Failure::of(
        "ShapeError",
        what,
        format_args!("expected shape {wanted}, got {found}"),
    )
}

/// A shape as Python writes it.
pub(crate) fn shape_text(shape: &[usize]) -> String {
    match shape {
        [one] => format!("({one},)"),
        many => {
            let lengths: Vec<String> = many.iter().map(ToString::to_string).collect();
            format!("({})", lengths.join(", "))
        }
    }
}

/// `helio_py._arrays.real_numbers`, which knows how NumPy names things.
fn converted<'py>(value: &Bound<'py, PyAny>, what: &str) -> Result<Bound<'py, PyAny>, Failure> {
    static CONVERT: PyOnceLock<Py<PyAny>> = PyOnceLock::new();
    let convert = CONVERT.import(value.py(), "helio_py._arrays", "real_numbers")?;
    Ok(convert.call1((value, what))?)
}

/// An array of some shape that owns the numbers.
pub(crate) fn owned<'py, T: numpy::Element>(
    py: Python<'py>,
    numbers: Vec<T>,
    shape: &[usize],
) -> Result<Bound<'py, PyAny>, Failure> {
    let flat: Bound<'py, PyArray<T, numpy::Ix1>> = numbers.into_pyarray(py);
    if shape.len() == 1 {
        return Ok(flat.into_any());
    }
    Ok(flat.reshape(shape)?.into_any())
}

/// The same, but a number of NumPy where the shape is that of one.
pub(crate) fn owned_or_number<'py>(
    py: Python<'py>,
    numbers: Vec<f64>,
    shape: &[usize],
) -> Result<Bound<'py, PyAny>, Failure> {
    let array = owned(py, numbers, shape)?;
    if shape.is_empty() {
        // As NumPy's own functions do: array[()] is a float64.
        return Ok(array.get_item(pyo3::types::PyTuple::empty(py))?);
    }
    Ok(array)
}

/// Where the numbers of an array are read from, for the test that they are not copied.
#[pyfunction]
pub(crate) fn _address_read(value: &Bound<'_, PyAny>) -> PyResult<usize> {
    guarded(|| Ok(Numbers::of(value, "value")?.as_slice()?.as_ptr().addr()))
}
