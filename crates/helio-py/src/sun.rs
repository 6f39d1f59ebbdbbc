//! `sun_position`: where the sun stands.

use helio_core::angle::radians;
use helio_core::sun::{SunSite, positions};
use numpy::{PyArrayDyn, PyArrayMethods, PyReadonlyArrayDyn, PyUntypedArrayMethods};
use pyo3::prelude::*;
use pyo3::sync::PyOnceLock;

use crate::array::{owned_or_number, scalar};
use crate::failure::Failure;
use crate::given;
use crate::guard::guarded;
use crate::pool;

/// Instants computed between two looks at whether the user wants to stop: some hundredths of a second.
const INSTANTS_PER_LOOK: usize = 1 << 20;

/// A place and how its clock runs.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Clock {
    pub(crate) site: SunSite,
    pub(crate) delta_t_s: Option<f64>,
    pub(crate) ut1_utc_s: f64,
}

/// Where the sun stands, by NREL's Solar Position Algorithm.
///
/// Parameters
/// ----------
/// times : datetime64, datetime, str, or an array, Series or list of them
///     Instants between 1678 and 2262. NumPy's datetime64 is UTC; everything else must carry a zone or an
///     offset: naive times are refused.
/// latitude_deg, longitude_deg : float
///     Geodetic, north and east positive [deg].
/// elevation_m : float, default 0
///     Above the sea [m]; gives the air's pressure where that is not given.
/// pressure_hpa : float, optional
///     Yearly mean at the site [hPa], not reduced to the sea; 0 for no refraction. By default that of the
///     standard atmosphere.
/// temperature_c : float, optional
///     Yearly mean [°C]; by default 12.
/// delta_t_s : float, optional
///     Terrestrial time minus UT1 [s]; by default an estimate from the date.
/// ut1_utc_s : float, default 0
///     UT1 minus UTC [s]; leaving it at 0 costs at most 0.004° of hour angle.
///
/// Returns
/// -------
/// SunPosition
///     `azimuth_rad` (clockwise from north, in [0, 2π)), `elevation_rad` (apparent, refraction included:
///     what `track` takes) and `geometric_elevation_rad` (without air), each of the shape of `times`.
///
/// Raises
/// ------
/// TimeError, SunError, DataTypeError
///
/// Notes
/// -----
/// Within 1e-8° of direct evaluation of the algorithm (Reda & Andreas 2004, NREL/TP-560-34302), whose own
/// uncertainty is 0.0003°.
///
/// Examples
/// --------
/// >>> import helio_py as hp
/// >>> import numpy as np
/// >>> sun = hp.sun_position("2026-06-21T12:00:00+02:00", 37.4, -6.25, elevation_m=20)
/// >>> print(np.degrees(sun.elevation_rad).round(4))
/// 55.6979
#[pyfunction]
#[pyo3(signature = (times, latitude_deg, longitude_deg, *, elevation_m=None, pressure_hpa=None, temperature_c=None, delta_t_s=None, ut1_utc_s=None),
    text_signature = "(times, latitude_deg, longitude_deg, *, elevation_m=0.0, pressure_hpa=None, temperature_c=None, delta_t_s=None, ut1_utc_s=0.0)")]
pub(crate) fn sun_position<'py>(
    py: Python<'py>,
    times: &Bound<'py, PyAny>,
    latitude_deg: &Bound<'py, PyAny>,
    longitude_deg: &Bound<'py, PyAny>,
    elevation_m: Option<&Bound<'py, PyAny>>,
    pressure_hpa: Option<&Bound<'py, PyAny>>,
    temperature_c: Option<&Bound<'py, PyAny>>,
    delta_t_s: Option<&Bound<'py, PyAny>>,
    ut1_utc_s: Option<&Bound<'py, PyAny>>,
) -> PyResult<Bound<'py, PyAny>> {
    guarded(|| {
        let given = |value: Option<&Bound<'py, PyAny>>, what| match value {
            Some(value) => scalar(value, what).map(Some),
            None => Ok(None),
        };
        let mut site = SunSite::new(
            radians(scalar(latitude_deg, "latitude_deg")?),
            radians(scalar(longitude_deg, "longitude_deg")?),
            given(elevation_m, "elevation_m")?.unwrap_or(0.0),
        )?;
        if let Some(pressure_hpa) = given(pressure_hpa, "pressure_hpa")? {
            site = site.with_pressure_hpa(pressure_hpa)?;
        }
        if let Some(temperature_c) = given(temperature_c, "temperature_c")? {
            site = site.with_temperature_c(temperature_c)?;
        }
        let clock = Clock {
            site,
            delta_t_s: given(delta_t_s, "delta_t_s")?,
            ut1_utc_s: given(ut1_utc_s, "ut1_utc_s")?.unwrap_or(0.0),
        };
        clock.positions(py, times)
    })
}

impl Clock {
    /// A `SunPosition` of the shape of `times`.
    pub(crate) fn positions<'py>(
        &self,
        py: Python<'py>,
        times: &Bound<'py, PyAny>,
    ) -> Result<Bound<'py, PyAny>, Failure> {
        static CLASS: PyOnceLock<Py<PyAny>> = PyOnceLock::new();
        let (times, shape) = unix_ns(times)?;
        let instants = times.as_slice().map_err(PyErr::from)?;
        // What is wrong with the clock is wrong without any instants, too.
        positions(&self.site, &[0], self.delta_t_s, self.ut1_utc_s)?;
        let mut columns = [(); 3].map(|()| Vec::with_capacity(instants.len()));
        for (block, instants) in instants.chunks(INSTANTS_PER_LOOK).enumerate() {
            if block > 0 {
                py.check_signals()?;
            }
            // Always on our own threads: the core asks whatever pool it finds itself in how large it is.
            let suns = py.detach(|| {
                pool::run(|| positions(&self.site, instants, self.delta_t_s, self.ut1_utc_s))
            })??;
            columns[0].extend(suns.azimuth_rad);
            columns[1].extend(suns.apparent_elevation_rad);
            columns[2].extend(suns.geometric_elevation_rad);
        }
        let [azimuth, apparent, geometric] = columns.map(|c| owned_or_number(py, c, &shape));
        let class = CLASS.import(py, "helio_py._sun", "SunPosition")?;
        Ok(class.call1((azimuth?, apparent?, geometric?))?)
    }
}

/// Nanoseconds of Unix time, contiguous, and the shape they came in.
pub(crate) fn unix_ns<'py>(
    times: &Bound<'py, PyAny>,
) -> Result<(PyReadonlyArrayDyn<'py, i64>, Vec<usize>), Failure> {
    static CONVERT: PyOnceLock<Py<PyAny>> = PyOnceLock::new();
    let convert = CONVERT.import(times.py(), "helio_py._times", "unix_ns")?;
    let found = convert.call1((times,))?;
    let array = found.cast_into::<PyArrayDyn<i64>>().map_err(PyErr::from)?;
    let shape = array.shape().to_vec();
    Ok((array.readonly(), shape))
}

/// Nanoseconds of Unix time of a time with an offset, as files have it.
#[pyfunction]
pub(crate) fn _parse_time(text: &Bound<'_, PyAny>) -> PyResult<i64> {
    guarded(|| Ok(helio_io::parse_time(&given::text(text, "times")?)?))
}
