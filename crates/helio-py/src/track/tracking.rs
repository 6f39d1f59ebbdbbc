//! `Tracking`: the answer of `track`.

use std::ffi::{c_int, c_void};
use std::sync::atomic::{AtomicBool, Ordering};

use helio_core::Status;
use numpy::npyffi::{NPY_ARRAY_CARRAY, NpyTypes, PY_ARRAY_API, get_type_object};
use numpy::{Element, PyArrayDescrMethods, PyUntypedArray};
use pyo3::prelude::*;
use pyo3::types::PyTuple;

use crate::array::{Numbers, shape_text, wrong_shape};
use crate::failure::Failure;
use crate::field::PyField;
use crate::given;
use crate::guard::guarded;
use crate::rows::{KeptMoment, table_of_angles};
use crate::slab::{Double, Slab};

/// Axis angles of a field for one sun or many, as columns.
///
/// Every column has the shape (n,) for the n heliostats and the one sun of two numbers, (m, n) for m suns. A
/// row whose status is not ok keeps its place and has NaN for angles and incidence.
///
/// Each access makes a new array that looks into this answer's memory, which lives as long as any of
/// them; `track(..., out=answer)` writes it over.
#[pyclass(frozen, name = "Tracking", module = "helio_py")]
pub(crate) struct PyTracking {
    slab: Slab,
    /// `None` for the one sun of a scalar.
    suns: Option<usize>,
    heliostats: usize,
    busy: AtomicBool,
}

/// Keeps other calls from writing to an answer.
pub(crate) struct Busy<'a>(&'a AtomicBool);

impl Drop for Busy<'_> {
    fn drop(&mut self) {
        self.0.store(false, Ordering::Release);
    }
}

impl PyTracking {
    pub(crate) fn new((suns, heliostats): (Option<usize>, usize)) -> Result<Self, Failure> {
        // A product too large for this is too large for memory, which says so.
        let rows = suns.unwrap_or(1).saturating_mul(heliostats);
        Ok(Self {
            slab: Slab::new(rows)?,
            suns,
            heliostats,
            busy: AtomicBool::new(false),
        })
    }

    /// An answer to be written over.
    pub(crate) fn reused<'a, 'py>(
        out: &'a Bound<'py, PyAny>,
        (suns, heliostats): (Option<usize>, usize),
    ) -> Result<&'a Bound<'py, Self>, Failure> {
        let Ok(tracking) = out.cast::<Self>() else {
            let found = out.get_type();
            return Err(Failure::of(
                "DataTypeError",
                "out",
                format_args!("expected a Tracking, got {found}"),
            ));
        };
        let this = tracking.get();
        if (this.suns, this.heliostats) != (suns, heliostats) {
            let (wanted, count) = lengths(suns, heliostats);
            let (found, of) = this.lengths();
            return Err(wrong_shape(
                "out",
                &shape_text(&wanted[..count]),
                &found[..of],
            ));
        }
        Ok(tracking)
    }

    pub(crate) fn slab(&self) -> &Slab {
        &self.slab
    }

    /// # Errors
    /// `BusyError` if another thread's call is writing to it.
    pub(crate) fn occupy(&self) -> Result<Busy<'_>, Failure> {
        if self.busy.swap(true, Ordering::Acquire) {
            let message = "this Tracking is being written to by another thread's call; give each \
                           thread its own";
            return Err(Failure::new("BusyError", message));
        }
        Ok(Busy(&self.busy))
    }

    /// Where the last rows with status ok left the axes.
    pub(crate) fn last_place(&self, heliostats: usize) -> Result<[Vec<f64>; 2], Failure> {
        if self.heliostats != heliostats {
            let wanted = format!("({heliostats},) or (m, {heliostats})");
            let (found, of) = self.lengths();
            return Err(wrong_shape("present", &wanted, &found[..of]));
        }
        let _busy = self.occupy()?;
        let mut place = [(); 2].map(|()| vec![f64::NAN; heliostats]);
        let statuses: Vec<u8> = self.statuses();
        let columns = [Double::Axis1, Double::Axis2].map(|column| self.copied(column));
        for (row, &status) in statuses.iter().enumerate() {
            if status == Status::Ok.code() {
                place[0][row % heliostats] = columns[0][row];
                place[1][row % heliostats] = columns[1][row];
            }
        }
        Ok(place)
    }

    fn copied(&self, column: Double) -> Vec<f64> {
        // SAFETY: initialised, and as long as that; whoever writes to it from Python was told not to.
        #[allow(unsafe_code)]
        unsafe {
            std::slice::from_raw_parts(self.slab.doubles(column), self.slab.rows()).to_vec()
        }
    }

    fn statuses(&self) -> Vec<u8> {
        // SAFETY: as above.
        #[allow(unsafe_code)]
        unsafe {
            std::slice::from_raw_parts(self.slab.statuses(), self.slab.rows()).to_vec()
        }
    }

    /// The shape's numbers, and how many of them count.
    fn lengths(&self) -> ([usize; 2], usize) {
        lengths(self.suns, self.heliostats)
    }
}

fn lengths(suns: Option<usize>, heliostats: usize) -> ([usize; 2], usize) {
    match suns {
        None => ([heliostats, 0], 1),
        Some(suns) => ([suns, heliostats], 2),
    }
}

/// An array that looks into an answer's memory and keeps it alive.
#[allow(unsafe_code)]
fn view<'py, T: Element>(
    this: &Bound<'py, PyTracking>,
    data: *mut T,
) -> PyResult<Bound<'py, PyUntypedArray>> {
    let py = this.py();
    let (lengths, dimensions) = this.get().lengths();
    let mut lengths = lengths.map(|length| length as isize);
    // SAFETY: `data` is a column of `this`, initialised, aligned and as long as the shape says; the new
    // array takes the reference to `this` as its base, also where setting it fails.
    unsafe {
        let array = PY_ARRAY_API.PyArray_NewFromDescr(
            py,
            get_type_object(py, NpyTypes::PyArray_Type),
            T::get_dtype(py).into_dtype_ptr(),
            dimensions as c_int,
            lengths.as_mut_ptr(),
            std::ptr::null_mut(),
            data.cast::<c_void>(),
            NPY_ARRAY_CARRAY,
            std::ptr::null_mut(),
        );
        let array = Bound::from_owned_ptr_or_err(py, array)?;
        let base = this.clone().into_ptr();
        if PY_ARRAY_API.PyArray_SetBaseObject(py, array.as_ptr().cast(), base) != 0 {
            return Err(PyErr::fetch(py));
        }
        Ok(array.cast_into_unchecked())
    }
}

#[pymethods]
impl PyTracking {
    /// Encoder angle of the first axis [rad]: the azimuth of an azimuth-elevation mount.
    #[getter]
    fn azimuth_rad<'py>(slf: &Bound<'py, Self>) -> PyResult<Bound<'py, PyUntypedArray>> {
        view(slf, slf.get().slab.doubles(Double::Axis1))
    }

    /// Encoder angle of the second axis [rad]: the elevation of an azimuth-elevation mount.
    #[getter]
    fn elevation_rad<'py>(slf: &Bound<'py, Self>) -> PyResult<Bound<'py, PyUntypedArray>> {
        view(slf, slf.get().slab.doubles(Double::Axis2))
    }

    /// The neutral name of `azimuth_rad`.
    #[getter]
    fn axis1_rad<'py>(slf: &Bound<'py, Self>) -> PyResult<Bound<'py, PyUntypedArray>> {
        Self::azimuth_rad(slf)
    }

    /// The neutral name of `elevation_rad`.
    #[getter]
    fn axis2_rad<'py>(slf: &Bound<'py, Self>) -> PyResult<Bound<'py, PyUntypedArray>> {
        Self::elevation_rad(slf)
    }

    /// Half the angle between sun and aim as seen from the pivot [rad].
    #[getter]
    fn incidence_rad<'py>(slf: &Bound<'py, Self>) -> PyResult<Bound<'py, PyUntypedArray>> {
        view(slf, slf.get().slab.doubles(Double::Incidence))
    }

    /// How far the better solution lies outside the axis limits [rad]: the larger excess of its two axes;
    /// zero unless the status is `OUTSIDE_LIMITS`, NaN where only the drive is at its end.
    #[getter]
    fn limit_excess_rad<'py>(slf: &Bound<'py, Self>) -> PyResult<Bound<'py, PyUntypedArray>> {
        view(slf, slf.get().slab.doubles(Double::LimitExcess))
    }

    /// What became of each row: uint8 numbers of `Status`.
    #[getter]
    fn status<'py>(slf: &Bound<'py, Self>) -> PyResult<Bound<'py, PyUntypedArray>> {
        view(slf, slf.get().slab.statuses())
    }

    /// The words of `status`, as files and the command line have them: an array of text.
    #[getter]
    fn status_words<'py>(slf: &Bound<'py, Self>) -> PyResult<Bound<'py, PyAny>> {
        let py = slf.py();
        let words = py.import("helio_py._status")?.getattr("status_words")?;
        words.call1((Self::status(slf)?,))
    }

    /// The shape of every column.
    #[getter]
    fn shape<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyTuple>> {
        let (lengths, dimensions) = self.lengths();
        PyTuple::new(py, &lengths[..dimensions])
    }

    fn __repr__(&self) -> String {
        let mut counts = [0_usize; 256];
        for code in self.statuses() {
            counts[usize::from(code)] += 1;
        }
        let statuses: Vec<String> = Status::ALL
            .iter()
            .filter(|status| counts[usize::from(status.code())] > 0)
            .map(|status| format!("{} {status}", counts[usize::from(status.code())]))
            .collect();
        let (lengths, dimensions) = self.lengths();
        let shape = shape_text(&lengths[..dimensions]);
        if statuses.is_empty() {
            return format!("<Tracking {shape}>");
        }
        format!("<Tracking {shape}: {}>", statuses.join(", "))
    }

    /// The table that `helio-rs track` writes, a row for each sun and heliostat, sun by sun.
    ///
    /// Columns `time` (or `sun_azimuth_deg, sun_elevation_deg`), `id, azimuth_deg, elevation_deg, incidence_deg,
    /// limit_excess_deg`, with drives also `axis1_steps, axis2_steps`, and `status`.
    ///
    /// Parameters
    /// ----------
    /// field : Field
    ///     The one that was tracked.
    /// kind : str, default "dict"
    ///     "dict" (of arrays), "pandas", "polars" or "pyarrow".
    /// times : optional
    ///     When each sun was seen, as for `sun_position`; or else
    /// sun_azimuth_rad, sun_elevation_rad : float or array of shape (m,), optional
    ///     where, as `track` was given it [rad].
    #[pyo3(
        signature = (field, kind=None, *, times=None, sun_azimuth_rad=None, sun_elevation_rad=None),
        text_signature = "($self, field, kind='dict', *, times=None, sun_azimuth_rad=None, sun_elevation_rad=None)"
    )]
    fn to_table<'py>(
        &self,
        field: &Bound<'py, PyAny>,
        kind: Option<&Bound<'py, PyAny>>,
        times: Option<&Bound<'py, PyAny>>,
        sun_azimuth_rad: Option<&Bound<'py, PyAny>>,
        sun_elevation_rad: Option<&Bound<'py, PyAny>>,
    ) -> PyResult<Bound<'py, PyAny>> {
        guarded(|| {
            let kind = given::text_or(kind, "kind", "dict")?;
            let inner = PyField::of(field)?.get().inner();
            if inner.len() != self.heliostats {
                let wanted = shape_text(&[self.heliostats]);
                return Err(wrong_shape("field", &wanted, &[inner.len()]));
            }
            let moment = KeptMoment::of(times, sun_azimuth_rad, sun_elevation_rad, self.suns)?;
            let _busy = self.occupy()?;
            let columns = [
                Double::Axis1,
                Double::Axis2,
                Double::Incidence,
                Double::LimitExcess,
            ];
            let columns = columns.map(|column| self.copied(column));
            let status = self.statuses().into_iter();
            // Codes are our own.
            let status: Vec<Status> = status.filter_map(Status::from_code).collect();
            let columns = columns.each_ref().map(Vec::as_slice);
            table_of_angles(field, &kind, &moment, &columns, &status, [false, false])
        })
    }

    fn __reduce__<'py>(slf: &Bound<'py, Self>) -> PyResult<Bound<'py, PyAny>> {
        let py = slf.py();
        let again = slf.get_type().getattr("_from_columns")?;
        let columns = (
            Self::azimuth_rad(slf)?,
            Self::elevation_rad(slf)?,
            Self::incidence_rad(slf)?,
            Self::limit_excess_rad(slf)?,
            Self::status(slf)?,
        );
        Ok((again, columns).into_pyobject(py)?.into_any())
    }

    /// An answer with these columns, for pickle.
    #[staticmethod]
    fn _from_columns(
        azimuth_rad: &Bound<'_, PyAny>,
        elevation_rad: &Bound<'_, PyAny>,
        incidence_rad: &Bound<'_, PyAny>,
        limit_excess_rad: &Bound<'_, PyAny>,
        status: &Bound<'_, PyAny>,
    ) -> PyResult<Self> {
        guarded(|| {
            let first = Numbers::of(azimuth_rad, "azimuth_rad")?;
            let shape = match *first.shape() {
                [heliostats] => (None, heliostats),
                [suns, heliostats] => (Some(suns), heliostats),
                _ => return Err(wrong_shape("azimuth_rad", "(n,) or (m, n)", first.shape())),
            };
            let this = Self::new(shape)?;
            // SAFETY: nobody has seen this answer yet.
            #[allow(unsafe_code)]
            let columns = unsafe {
                this.slab.begin();
                this.slab.columns(0..this.slab.rows())
            };
            let fill = |to: &mut [f64], from: &Bound<'_, PyAny>, what: &str| {
                let from = Numbers::of(from, what)?;
                if from.shape() != first.shape() {
                    let wanted = shape_text(first.shape());
                    return Err(wrong_shape(what, &wanted, from.shape()));
                }
                to.copy_from_slice(from.as_slice()?);
                Ok(())
            };
            fill(columns.axis1_rad, azimuth_rad, "azimuth_rad")?;
            fill(columns.axis2_rad, elevation_rad, "elevation_rad")?;
            fill(columns.incidence_rad, incidence_rad, "incidence_rad")?;
            fill(
                columns.limit_excess_rad,
                limit_excess_rad,
                "limit_excess_rad",
            )?;
            this.slab.excess_written();
            let codes = Numbers::of(status, "status")?;
            if codes.shape() != first.shape() {
                let wanted = shape_text(first.shape());
                return Err(wrong_shape("status", &wanted, codes.shape()));
            }
            for (to, &code) in columns.status.iter_mut().zip(codes.as_slice()?) {
                *to = Status::from_code(code as u8).ok_or_else(|| {
                    Failure::of(
                        "OptionError",
                        "status",
                        format_args!("no status has number {code}"),
                    )
                })?;
            }
            Ok(this)
        })
    }
}
