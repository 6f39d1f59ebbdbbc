//! Rows of suns and heliostats as tables: the columns that the command line writes.

use helio_core::Status;
use helio_io::output::{Layout, Moment, Moments, Number, Rows, Scale, kept_rows};
use helio_io::{AnglesSun, by_row, degrees_as_written, load_angles, tracked_numbers};
use numpy::{PyReadonlyArrayDyn, PyUntypedArrayMethods};
use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::array::{Numbers, owned, shape_text, wrong_shape};
use crate::failure::Failure;
use crate::field::PyField;
use crate::given;
use crate::guard::guarded;
use crate::pool;
use crate::sun::unix_ns;
use crate::table::{Given, given_back};
use crate::track::direction;

/// What tells the suns of a table apart, one entry each.
pub(crate) enum KeptMoment {
    Times(Vec<i64>),
    SunAngles([Vec<f64>; 2]),
}

impl KeptMoment {
    /// Of the keywords of `to_table`; `suns` is `None` for the one sun of a scalar.
    pub(crate) fn of(
        times: Option<&Bound<'_, PyAny>>,
        sun_azimuth_rad: Option<&Bound<'_, PyAny>>,
        sun_elevation_rad: Option<&Bound<'_, PyAny>>,
        suns: Option<usize>,
    ) -> Result<Self, Failure> {
        let wanted = suns.as_slice();
        let fits = |what: &str, shape: &[usize]| {
            if shape == wanted {
                return Ok(());
            }
            Err(wrong_shape(what, &shape_text(wanted), shape))
        };
        match (times, sun_azimuth_rad, sun_elevation_rad) {
            (Some(times), None, None) => {
                let (times, shape) = unix_ns(times)?;
                fits("times", &shape)?;
                Ok(Self::Times(times.as_slice().map_err(PyErr::from)?.to_vec()))
            }
            (None, Some(azimuth), Some(elevation)) => {
                let angles = |value: &Bound<'_, PyAny>, what: &str| {
                    let numbers = Numbers::of(value, what)?;
                    fits(what, numbers.shape())?;
                    Ok::<Vec<f64>, Failure>(numbers.as_slice()?.to_vec())
                };
                let azimuth = angles(azimuth, "sun_azimuth_rad")?;
                let elevation = angles(elevation, "sun_elevation_rad")?;
                for (row, (azimuth_rad, elevation_rad)) in
                    azimuth.iter().zip(&elevation).enumerate()
                {
                    direction(row, *azimuth_rad, *elevation_rad)?;
                }
                let degrees =
                    |angles: Vec<f64>| angles.into_iter().map(degrees_as_written).collect();
                Ok(Self::SunAngles([azimuth, elevation].map(degrees)))
            }
            _ => Err(Failure::of(
                "OptionError",
                "times",
                "a table says which sun its rows are of: wanted times, or sun_azimuth_rad and sun_elevation_rad",
            )),
        }
    }

    const fn moment(&self) -> Moment {
        match self {
            Self::Times(_) => Moment::Time,
            Self::SunAngles(_) => Moment::SunAngles,
        }
    }

    fn moments(&self) -> Moments<'_> {
        match self {
            Self::Times(unix_ns) => Moments::Times { unix_ns },
            Self::SunAngles([azimuth_deg, elevation_deg]) => Moments::SunAngles {
                azimuth_deg,
                elevation_deg,
            },
        }
    }
}

/// A table of a kind: a row for each sun and heliostat, or for each sun one of the heliostat stated.
pub(crate) fn table<'py>(
    field: &Bound<'py, PyAny>,
    kind: &str,
    moment: &KeptMoment,
    numbers: Vec<Number>,
    columns: &[&[f64]],
    status: &[Status],
    heliostats: Option<&[u32]>,
) -> Result<Bound<'py, PyAny>, Failure> {
    let py = field.py();
    let inner = PyField::of(field)?.get().inner();
    let layout = Layout {
        ids: inner.field().ids().to_vec(),
        moment: moment.moment(),
        numbers,
    };
    let ends: Vec<usize> = (1..=heliostats.map_or(0, <[u32]>::len)).collect();
    let rows = Rows {
        moments: moment.moments(),
        ends: heliostats.map(|_| ends.as_slice()),
        heliostats,
        numbers: columns,
        status,
    };
    let kept = py.detach(|| kept_rows(&layout, &rows))?;
    given_back(py, kept, kind)
}

/// Columns of axis angles of some suns, as Python's arrays.
pub(crate) struct Angles<'py> {
    columns: Vec<Numbers<'py>>,
    status: Vec<Status>,
    /// `None` for the one sun of two numbers.
    suns: Option<usize>,
}

impl<'py> Angles<'py> {
    /// Of arrays of one shape, (n,) or (m, n) for a field of n; the first is called `what`.
    ///
    /// # Errors
    /// `ShapeError` for other shapes, `DataTypeError` for no numbers, `OptionError` for no statuses.
    pub(crate) fn of(
        columns: &[Bound<'py, PyAny>],
        status: &Bound<'py, PyAny>,
        heliostats: usize,
        what: &str,
    ) -> Result<Self, Failure> {
        let columns = columns.iter().map(|column| Numbers::of(column, what));
        let columns = columns.collect::<Result<Vec<_>, _>>()?;
        let codes: PyReadonlyArrayDyn<'py, u8> = status.extract().map_err(|_| {
            Failure::of("DataTypeError", what, "expected statuses as uint8 numbers")
        })?;
        let shape = codes.shape();
        let suns = match *shape {
            [found] if found == heliostats => None,
            [suns, found] if found == heliostats => Some(suns),
            _ => {
                let wanted = format!("({heliostats},) or (m, {heliostats})");
                return Err(wrong_shape(what, &wanted, shape));
            }
        };
        if let Some(other) = columns.iter().find(|column| column.shape() != shape) {
            return Err(wrong_shape(what, &shape_text(shape), other.shape()));
        }
        let known = codes
            .as_array()
            .iter()
            .map(|&code| status_of(code))
            .collect::<Result<_, _>>()?;
        Ok(Self {
            columns,
            status: known,
            suns,
        })
    }

    pub(crate) fn columns(&self) -> Result<Vec<&[f64]>, Failure> {
        self.columns.iter().map(Numbers::as_slice).collect()
    }

    pub(crate) fn status(&self) -> &[Status] {
        &self.status
    }

    pub(crate) const fn suns(&self) -> Option<usize> {
        self.suns
    }

    /// The shape of every column.
    pub(crate) fn shape(&self, heliostats: usize) -> Vec<usize> {
        self.suns.into_iter().chain([heliostats]).collect()
    }
}

/// A table of axis angles: `columns` are both angles, incidence and excess of limits, then where `leftovers` both corrections
/// and both standard deviations, then where `verified` the beam's error.
pub(crate) fn table_of_angles<'py>(
    field: &Bound<'py, PyAny>,
    kind: &str,
    moment: &KeptMoment,
    columns: &[&[f64]],
    status: &[Status],
    [leftovers, verified]: [bool; 2],
) -> Result<Bound<'py, PyAny>, Failure> {
    let inner = PyField::of(field)?.get().inner();
    let loaded = inner.loaded();
    let numbers = tracked_numbers(loaded.has_drives(), leftovers, verified);
    let steps = match loaded.has_drives() {
        true => {
            let drives = &loaded.drives;
            let steps = || {
                [0, 1].map(|axis| by_row(drives, columns[axis], |of, angle| of[axis]?.steps(angle)))
            };
            field.py().detach(|| pool::run(steps))?.to_vec()
        }
        false => Vec::new(),
    };
    let (first, rest) = columns.split_at(4.min(columns.len()));
    let columns = first.iter().copied();
    let columns = columns.chain(steps.iter().map(Vec::as_slice));
    let columns: Vec<&[f64]> = columns.chain(rest.iter().copied()).collect();
    table(field, kind, moment, numbers, &columns, status, None)
}

/// Axis angles that were corrected or verified as a table of a kind.
#[pyfunction]
pub(crate) fn _tracked_table<'py>(
    field: &Bound<'py, PyAny>,
    columns: Vec<Bound<'py, PyAny>>,
    status: &Bound<'py, PyAny>,
    parts: [bool; 2],
    kind: &Bound<'py, PyAny>,
    times: Option<&Bound<'py, PyAny>>,
    sun_azimuth_rad: Option<&Bound<'py, PyAny>>,
    sun_elevation_rad: Option<&Bound<'py, PyAny>>,
) -> PyResult<Bound<'py, PyAny>> {
    guarded(|| {
        let kind = given::text(kind, "kind")?;
        let n = PyField::of(field)?.get().inner().len();
        let angles = Angles::of(&columns, status, n, "field")?;
        let moment = KeptMoment::of(times, sun_azimuth_rad, sun_elevation_rad, angles.suns())?;
        let columns = angles.columns()?;
        table_of_angles(field, &kind, &moment, &columns, angles.status(), parts)
    })
}

fn status_of(code: u8) -> Result<Status, Failure> {
    Status::from_code(code).ok_or_else(|| {
        let message = format!("no status has number {code}");
        Failure::of("OptionError", "status", message)
    })
}

/// Statuses of numbers that Python has.
fn statuses(codes: &Numbers<'_>) -> Result<Vec<Status>, Failure> {
    let codes = codes.as_slice()?.iter();
    codes.map(|&code| status_of(code as u8)).collect()
}

/// Where beams land as a table of a kind.
#[pyfunction]
pub(crate) fn _landed_table<'py>(
    field: &Bound<'py, PyAny>,
    landed: Vec<Bound<'py, PyAny>>,
    kind: &Bound<'py, PyAny>,
    times: Option<&Bound<'py, PyAny>>,
    sun_azimuth_rad: Option<&Bound<'py, PyAny>>,
    sun_elevation_rad: Option<&Bound<'py, PyAny>>,
    heliostats: Option<Vec<u32>>,
) -> PyResult<Bound<'py, PyAny>> {
    guarded(|| {
        let kind = given::text(kind, "kind")?;
        let names = ["u_m", "v_m", "point_enu_m", "beam_error_rad", "status"];
        let arrays = names.iter().zip(&landed);
        let arrays: Vec<Numbers<'_>> = arrays
            .map(|(what, array)| Numbers::of(array, what))
            .collect::<Result<_, _>>()?;
        let [u_m, v_m, point, beam, codes] = arrays.as_slice() else {
            return Err(Failure::new(
                "InternalError",
                "a prediction of other columns",
            ));
        };
        let n = PyField::of(field)?.get().inner().len();
        let suns = match (u_m.shape(), &heliostats) {
            (&[rows], Some(_)) => Some(rows),
            (&[found], None) if found == n => None,
            (&[suns, found], None) if found == n => Some(suns),
            _ => return Err(wrong_shape("field", &format!("({n},)"), u_m.shape())),
        };
        let moment = KeptMoment::of(times, sun_azimuth_rad, sun_elevation_rad, suns)?;
        let point = point.as_slice()?;
        let [east_m, north_m, up_m] = [0, 1, 2].map(|axis| {
            point
                .iter()
                .skip(axis)
                .step_by(3)
                .copied()
                .collect::<Vec<f64>>()
        });
        let numbers = ["u_m", "v_m", "east_m", "north_m", "up_m"]
            .map(|name| Number::new(name, Scale::Plain))
            .into_iter()
            .chain([Number::new("beam_error_mrad", Scale::Milliradians)]);
        let columns = [
            u_m.as_slice()?,
            v_m.as_slice()?,
            &east_m,
            &north_m,
            &up_m,
            beam.as_slice()?,
        ];
        let status = statuses(codes)?;
        let numbers = numbers.collect();
        table(
            field,
            &kind,
            &moment,
            numbers,
            &columns,
            &status,
            heliostats.as_deref(),
        )
    })
}

/// A table of axis angles: for each row its heliostat, both angles, and its sun if it states one.
#[pyfunction]
pub(crate) fn _angles<'py>(
    py: Python<'py>,
    field: &Bound<'py, PyAny>,
    angles: &Bound<'py, PyAny>,
) -> PyResult<Bound<'py, PyDict>> {
    guarded(|| {
        let inner = PyField::of(field)?.get().inner();
        let given = Given::of(angles, "azimuth_rad")?;
        let read = py.detach(|| load_angles(given.source(), inner.loaded()));
        let read = read.map_err(|error| Failure::from(error).or_of("azimuth_rad"))?;
        let rows = read.heliostat.len();
        let dict = PyDict::new(py);
        let heliostats: Vec<i64> = read.heliostat.iter().map(|&h| h as i64).collect();
        dict.set_item("heliostat", owned(py, heliostats, &[rows])?)?;
        dict.set_item("azimuth_rad", owned(py, read.axis1_rad, &[rows])?)?;
        dict.set_item("elevation_rad", owned(py, read.axis2_rad, &[rows])?)?;
        match read.sun {
            AnglesSun::Times { unix_ns } => {
                dict.set_item("unix_ns", owned(py, unix_ns, &[rows])?)?;
            }
            AnglesSun::Angles(suns) => {
                dict.set_item("sun_azimuth_rad", owned(py, suns.azimuth_rad, &[rows])?)?;
                dict.set_item("sun_elevation_rad", owned(py, suns.elevation_rad, &[rows])?)?;
            }
            _ => {}
        }
        Ok(dict)
    })
}
