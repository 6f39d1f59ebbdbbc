//! Rows of suns and heliostats as tables: the columns that the command line writes.

use helio_core::Status;
use helio_io::output::{Layout, Moment, Moments, Number, Rows, Scale, kept_rows};
use helio_io::{AnglesSun, degrees_as_written, load_angles};
use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::array::{Numbers, owned, shape_text, wrong_shape};
use crate::failure::Failure;
use crate::field::PyField;
use crate::guard::guarded;
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

/// Statuses of numbers that Python has.
fn statuses(codes: &Numbers<'_>) -> Result<Vec<Status>, Failure> {
    let status = |&code: &f64| {
        Status::from_code(code as u8).ok_or_else(|| {
            let message = format!("no status has number {code}");
            Failure::of("OptionError", "status", message)
        })
    };
    codes.as_slice()?.iter().map(status).collect()
}

/// Where beams land as a table of a kind.
#[pyfunction]
pub(crate) fn _landed_table<'py>(
    field: &Bound<'py, PyAny>,
    landed: Vec<Bound<'py, PyAny>>,
    kind: &str,
    times: Option<&Bound<'py, PyAny>>,
    sun_azimuth_rad: Option<&Bound<'py, PyAny>>,
    sun_elevation_rad: Option<&Bound<'py, PyAny>>,
    heliostats: Option<Vec<u32>>,
) -> PyResult<Bound<'py, PyAny>> {
    guarded(|| {
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
            kind,
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
        let read = py.detach(|| load_angles(given.source(), inner.loaded()))?;
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
