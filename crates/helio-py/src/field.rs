//! `Field`: the heliostats.

mod again;
mod columns;
mod inner;
mod surroundings;
mod through;

use std::path::PathBuf;

use numpy::PyArray2;
use pyo3::prelude::*;
use pyo3::sync::PyOnceLock;
use pyo3::types::{PyDict, PyList, PyTuple};

use crate::array::{owned, shape_text, wrong_shape};
use crate::failure::Failure;
use crate::given;
use crate::guard::guarded;
use crate::sun::Clock;
use crate::table::of_columns;
use again::changed;
pub(crate) use inner::Inner;

/// Heliostats of one tracking mode, in the order in which every answer comes.
///
/// World frame: right-handed east, north, up, in metres; azimuth clockwise from north. A field does not change:
/// make another to change one.
///
/// Parameters
/// ----------
/// position_enu_m : array of shape (n, 3)
///     Crossing of the axes of each heliostat, its pivot [m].
/// aim_enu_m : array of shape (n, 3) or (3,), optional
///     What its beam is to hit [m]; one point may serve for all.
/// aim : str or sequence of str, optional
///     The targets that heliostats aim at, in the place of points: one for all, or one for each.
/// ids : sequence of str, optional
///     Names, each once; by default the row numbers from "0" on.
/// mirror_offset_m : float or array of shape (n,), default 0
///     Pivot to mirror centre along the normal [m].
/// pedestal_tilt_rad, pedestal_tilt_azimuth_rad : float or array of shape (n,), default 0
///     Lean of the fixed axis and where it leans to [rad].
/// axis_nonorthogonality_rad : float or array of shape (n,), default 0
///     Moving axis away from square to the fixed axis [rad].
/// mirror_tilt_rad : float or array of shape (n,), default 0
///     Mirror plane away from parallel with the moving axis [rad].
/// azimuth_reference_rad, elevation_reference_rad : float or array of shape (n,), default 0
///     Encoder readings are the true angles plus these [rad].
/// axis1_sag_rad, axis2_sag_rad, axis2_eccentricity_rad : float or array of shape (n,), default 0
///     How far an axis gives way where the mirror pulls it round hardest, and how far the second turns beyond its
///     encoder a quarter turn from its zero [rad].
/// axis1_min_rad, axis1_max_rad, axis2_min_rad, axis2_max_rad : float or array of shape (n,)
///     Limits on encoder angles [rad]; infinite (no limit) by default.
/// mode : str, default "azimuth-elevation"
///     Or "spinning-elevation", "pitch-roll" (with `axis_azimuth_rad`), "polar" (with `latitude_rad`).
/// axis_azimuth_rad : float, optional
///     Where the fixed axis of a pitch-roll mount points [rad]; π/2 is east.
/// latitude_rad : float, optional
///     Of the site of a polar mount [rad], north positive; by default that of `site`.
/// site : mapping, optional
///     Where the field lies, by the keys of `[site]` in a field.toml: `latitude_deg`, `longitude_deg`, `elevation_m`,
///     optionally `name`, `pressure_hpa`, `temperature_c`, `delta_t_s`, `ut1_utc_s`.
/// targets : mapping, optional
///     What can be aimed at and what spots are seen on: names, and mappings of the keys of `[targets.NAME]`:
///     `centre_enu_m` and, of a plane, `normal_enu`, `width_m`, `height_m`, optionally `right_enu`.
/// drives : pair or sequence of n pairs, optional
///     A ``Drive`` or None for either axis: a pair for all, or one for each. Limits are what those stated and the reach
///     of the drives have in common.
///
/// Raises
/// ------
/// FieldError, ShapeError, DataTypeError, OptionError, MissingError, UnknownNameError, FileError
///     The last three of `site` and `targets`, whose places are then those of a field.toml that says the same.
///
/// Examples
/// --------
/// >>> import helio_py as hp
/// >>> field = hp.Field([[0, 90, 6], [30, 90, 6]], [0, 0, 120], ids=["A1", "A2"], mirror_offset_m=0.3)
/// >>> field
/// <Field of 2 heliostats, azimuth-elevation>
/// >>> field.mirror_offset_m
/// array([0.3, 0.3])
///
/// With a site and targets it is all that a field read from files is:
///
/// >>> board = {"centre_enu_m": [0, 8, 70], "normal_enu": [0, 1, 0], "width_m": 14, "height_m": 12}
/// >>> field = hp.Field(
/// ...     [[0, 90, 6], [30, 90, 6]],
/// ...     aim="board",
/// ...     targets={"board": board},
/// ...     site={"latitude_deg": 37.4, "longitude_deg": -6.25, "elevation_m": 20},
/// ... )
/// >>> float(field.sun_position("2026-06-21T12:00:00Z").elevation_rad.round(3))
/// 1.307
/// >>> seen = hp.simulate_observations(field, count=20)
/// >>> hp.calibrate(field, seen.to_table()).status
/// ['ok', 'ok']
#[pyclass(frozen, name = "Field", module = "helio_py")]
pub(crate) struct PyField {
    inner: Inner,
    /// Columns of the calibration that took the place of the files', for pickle.
    calibration: Option<Py<PyList>>,
}

impl PyField {
    /// An argument that must be a field.
    pub(crate) fn of<'a, 'py>(
        value: &'a Bound<'py, PyAny>,
    ) -> Result<&'a Bound<'py, Self>, Failure> {
        value.cast::<Self>().map_err(|_| {
            let found = value.get_type();
            Failure::of(
                "DataTypeError",
                "field",
                format_args!("expected a Field, got {found}"),
            )
        })
    }

    pub(crate) fn inner(&self) -> &Inner {
        &self.inner
    }

    fn column<'py>(&self, py: Python<'py>, name: &str) -> PyResult<Bound<'py, PyAny>> {
        guarded(|| {
            owned(
                py,
                columns::column(self.inner.field(), name),
                &[self.inner.len()],
            )
        })
    }
}

#[pymethods]
impl PyField {
    #[new]
    #[pyo3(
        signature = (position_enu_m, aim_enu_m=None, *, aim=None, ids=None, mode=None, axis_azimuth_rad=None, latitude_rad=None, site=None, targets=None, drives=None, **columns),
        text_signature = "(position_enu_m, aim_enu_m=None, *, aim=None, ids=None, mirror_offset_m=0.0, pedestal_tilt_rad=0.0, pedestal_tilt_azimuth_rad=0.0, axis_nonorthogonality_rad=0.0, mirror_tilt_rad=0.0, azimuth_reference_rad=0.0, elevation_reference_rad=0.0, axis1_sag_rad=0.0, axis2_sag_rad=0.0, axis2_eccentricity_rad=0.0, axis1_min_rad=None, axis1_max_rad=None, axis2_min_rad=None, axis2_max_rad=None, mode='azimuth-elevation', axis_azimuth_rad=None, latitude_rad=None, site=None, targets=None, drives=None)"
    )]
    #[allow(clippy::too_many_arguments)] // the call's own
    fn new(
        position_enu_m: &Bound<'_, PyAny>,
        aim_enu_m: Option<&Bound<'_, PyAny>>,
        aim: Option<&Bound<'_, PyAny>>,
        ids: Option<&Bound<'_, PyAny>>,
        mode: Option<&Bound<'_, PyAny>>,
        axis_azimuth_rad: Option<&Bound<'_, PyAny>>,
        latitude_rad: Option<&Bound<'_, PyAny>>,
        site: Option<&Bound<'_, PyAny>>,
        targets: Option<&Bound<'_, PyAny>>,
        drives: Option<&Bound<'_, PyAny>>,
        columns: Option<&Bound<'_, PyDict>>,
    ) -> PyResult<Self> {
        guarded(|| {
            let surroundings = surroundings::text(position_enu_m.py(), site, targets)?;
            let around = surroundings::read(&surroundings)?;
            let given = columns::Given {
                position_enu_m,
                aim_enu_m,
                aim,
                ids,
                mode: columns::mode(mode, axis_azimuth_rad, latitude_rad, around.0.as_ref())?,
                drives,
                quantities: columns,
            };
            let parts = columns::parts(&given, around)?;
            Ok(Self {
                inner: Inner::of_columns(parts, surroundings, None)?,
                calibration: None,
            })
        })
    }

    /// Reads a field.toml and the tables that it names, as the command line does.
    ///
    /// Parameters
    /// ----------
    /// path : str or path
    ///     The field.toml.
    ///
    /// Raises
    /// ------
    /// FileError
    ///     With `path`, `line`, `column`, `row`, `id` and `field` as far as they are known.
    #[staticmethod]
    fn from_toml(path: &Bound<'_, PyAny>) -> PyResult<Self> {
        guarded(|| {
            let py = path.py();
            let path = given::path(path, "path")?;
            let inner = py.detach(|| Inner::load(&path))?;
            Ok(Self {
                inner,
                calibration: None,
            })
        })
    }

    fn __len__(&self) -> usize {
        self.inner.len()
    }

    fn __repr__(&self) -> String {
        let plural = if self.inner.len() == 1 { "" } else { "s" };
        let mode = self.inner.field().mode().as_str();
        format!("<Field of {} heliostat{plural}, {mode}>", self.inner.len())
    }

    /// Names of the heliostats, in field order.
    #[getter]
    fn ids<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyList>> {
        PyList::new(py, self.inner.field().ids())
    }

    /// Row of a heliostat by name, counted from 0; None if there is none of that name.
    fn row_of(&self, id: &Bound<'_, PyAny>) -> PyResult<Option<usize>> {
        guarded(|| {
            let id = given::text(id, "id")?;
            Ok(self.inner.field().row_of(&id))
        })
    }

    /// How the heliostats track: the word of the files.
    #[getter]
    fn mode(&self) -> &'static str {
        self.inner.field().mode().as_str()
    }

    /// Where the fixed axis of a pitch-roll mount points [rad]; None for other modes.
    #[getter]
    fn axis_azimuth_rad(&self) -> Option<f64> {
        columns::axis_azimuth_rad(self.inner.field())
    }

    /// Latitude that a polar mount stands at [rad]; None for other modes.
    #[getter]
    fn latitude_rad(&self) -> Option<f64> {
        columns::latitude_rad(self.inner.field())
    }

    /// Crossing of the axes of each heliostat [m], east, north, up: a copy of shape (n, 3).
    #[getter]
    fn position_enu_m<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        columns::points(py, self.inner.field(), |heliostat| heliostat.pivot)
    }

    /// What each beam is to hit [m], east, north, up: a copy of shape (n, 3).
    #[getter]
    fn aim_enu_m<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        columns::points(py, self.inner.field(), |heliostat| heliostat.aim)
    }

    /// Pivot to mirror centre along the normal [m]: a copy.
    #[getter]
    fn mirror_offset_m<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        self.column(py, "mirror_offset_m")
    }

    /// Lean of the fixed axis [rad]: a copy.
    #[getter]
    fn pedestal_tilt_rad<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        self.column(py, "pedestal_tilt_rad")
    }

    /// Where the fixed axis leans to [rad]: a copy.
    #[getter]
    fn pedestal_tilt_azimuth_rad<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        self.column(py, "pedestal_tilt_azimuth_rad")
    }

    /// Moving axis away from square to the fixed axis [rad]: a copy.
    #[getter]
    fn axis_nonorthogonality_rad<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        self.column(py, "axis_nonorthogonality_rad")
    }

    /// Mirror plane away from parallel with the moving axis [rad]: a copy.
    #[getter]
    fn mirror_tilt_rad<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        self.column(py, "mirror_tilt_rad")
    }

    /// Reference of the first axis' encoder [rad]: a copy.
    #[getter]
    fn azimuth_reference_rad<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        self.column(py, "azimuth_reference_rad")
    }

    /// Reference of the second axis' encoder [rad]: a copy.
    #[getter]
    fn elevation_reference_rad<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        self.column(py, "elevation_reference_rad")
    }

    /// Most that the first axis sags [rad]: a copy.
    #[getter]
    fn axis1_sag_rad<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        self.column(py, "axis1_sag_rad")
    }

    /// Most that the second axis sags [rad]: a copy.
    #[getter]
    fn axis2_sag_rad<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        self.column(py, "axis2_sag_rad")
    }

    /// How far the second axis turns beyond its encoder a quarter turn from its zero [rad]: a copy.
    #[getter]
    fn axis2_eccentricity_rad<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        self.column(py, "axis2_eccentricity_rad")
    }

    /// Least encoder angle of the first axis [rad], -inf for none: a copy.
    #[getter]
    fn axis1_min_rad<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        self.column(py, "axis1_min_rad")
    }

    /// Greatest encoder angle of the first axis [rad], inf for none: a copy.
    #[getter]
    fn axis1_max_rad<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        self.column(py, "axis1_max_rad")
    }

    /// Least encoder angle of the second axis [rad], -inf for none: a copy.
    #[getter]
    fn axis2_min_rad<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        self.column(py, "axis2_min_rad")
    }

    /// Greatest encoder angle of the second axis [rad], inf for none: a copy.
    #[getter]
    fn axis2_max_rad<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        self.column(py, "axis2_max_rad")
    }

    /// Drives of both axes of each heliostat, as a list of pairs; None where an axis has none.
    #[getter]
    fn drives<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyList>> {
        columns::pairs(py, &self.inner.loaded().drives)
    }

    /// Where the field lies, as the mapping that `site` takes; None if nothing says so.
    #[getter]
    fn site<'py>(&self, py: Python<'py>) -> PyResult<Option<Bound<'py, PyDict>>> {
        let site = self.inner.site();
        site.map(|site| surroundings::site(py, site)).transpose()
    }

    /// What can be aimed at, as the mapping that `targets` takes.
    #[getter]
    fn targets<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        surroundings::targets(py, &self.inner.loaded().targets)
    }

    /// Name of the target that each heliostat aims at, in field order; None for one that aims at a point of its own.
    #[getter]
    fn aim<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyList>> {
        let loaded = self.inner.loaded();
        let names: Vec<&str> = loaded.targets.keys().map(String::as_str).collect();
        let each = loaded.target_of.iter();
        PyList::new(py, each.map(|number| number.map(|number| names[number])))
    }

    /// Motor steps of both axes, not rounded, for encoder angles [rad] of shape (n,) or (m, n); NaN where there
    /// is no drive, no angle, or no steps that lead there.
    #[pyo3(signature = (azimuth_rad, elevation_rad))]
    fn steps<'py>(
        &self,
        py: Python<'py>,
        azimuth_rad: &Bound<'py, PyAny>,
        elevation_rad: &Bound<'py, PyAny>,
    ) -> PyResult<(Bound<'py, PyAny>, Bound<'py, PyAny>)> {
        let given = [
            (azimuth_rad, "azimuth_rad"),
            (elevation_rad, "elevation_rad"),
        ];
        self.through_drives(py, given, |drive, angle| drive.steps(angle))
    }

    /// Encoder angles of both axes [rad] for motor steps of shape (n,) or (m, n); NaN where there is no drive or
    /// its mechanism cannot be.
    #[pyo3(signature = (axis1_steps, axis2_steps))]
    fn angles_rad<'py>(
        &self,
        py: Python<'py>,
        axis1_steps: &Bound<'py, PyAny>,
        axis2_steps: &Bound<'py, PyAny>,
    ) -> PyResult<(Bound<'py, PyAny>, Bound<'py, PyAny>)> {
        let given = [(axis1_steps, "axis1_steps"), (axis2_steps, "axis2_steps")];
        self.through_drives(py, given, |drive, steps| drive.angle_rad(steps))
    }

    /// Where the sun stands over the site of the field's file at `times`: as `helio_py.sun_position`, with the
    /// file's numbers to the last bit.
    fn sun_position<'py>(
        &self,
        py: Python<'py>,
        times: &Bound<'py, PyAny>,
    ) -> PyResult<Bound<'py, PyAny>> {
        guarded(|| {
            let Some(site) = self.inner.site() else {
                let message = "there is no [site], which the sun's position at a time needs; use \
                               helio_py.sun_position with a latitude and a longitude";
                return Err(Failure::new("MissingError", message));
            };
            let clock = Clock {
                site: site.sun_site()?,
                delta_t_s: site.delta_t_s,
                ut1_utc_s: site.ut1_utc_s.unwrap_or(0.0),
            };
            clock.positions(py, times)
        })
    }

    /// What the files of the field say, and whether it can work: every heliostat is tracked through a sample of the
    /// suns of a year.
    ///
    /// Parameters
    /// ----------
    /// time : datetime64, datetime or str, optional
    ///     The instant that is called now; by default the clock's.
    /// progress : callable or True, optional
    ///     Called with suns done and in all; True for a bar of tqdm.
    ///
    /// Returns
    /// -------
    /// FieldCheck
    ///     Printed it is what ``helio-rs check`` prints.
    ///
    /// Raises
    /// ------
    /// MissingError, TimeError, DataTypeError, OptionError
    ///
    /// Examples
    /// --------
    /// >>> import helio_py as hp
    /// >>> check = hp.Field.from_toml("examples/field.toml").check("2026-06-21T12:00:00Z")
    /// >>> check.counts, check.never
    /// ({'ok': 448000}, [])
    #[pyo3(signature = (time=None, *, progress=None))]
    fn check<'py>(
        slf: &Bound<'py, Self>,
        time: Option<&Bound<'py, PyAny>>,
        progress: Option<&Bound<'py, PyAny>>,
    ) -> PyResult<Bound<'py, PyAny>> {
        static CHECKED: PyOnceLock<Py<PyAny>> = PyOnceLock::new();
        let checked = CHECKED.import(slf.py(), "helio_py._begin", "checked")?;
        checked.call1((slf, time, progress))
    }

    /// Things worth saying about the files read, that stop nothing.
    #[getter]
    fn warnings(&self) -> Vec<String> {
        self.inner.loaded().warnings.clone()
    }

    /// Every file read, field.toml first; none for a field of columns.
    #[getter]
    fn files(&self) -> Vec<PathBuf> {
        self.inner.loaded().files.clone()
    }

    /// A field of columns is pickled as its columns, one of files as their names and hashes: it is read again,
    /// and refused if they have changed.
    fn __reduce__<'py>(slf: &Bound<'py, Self>) -> PyResult<Bound<'py, PyTuple>> {
        let py = slf.py();
        let inner = slf.get().inner();
        let class = slf.get_type();
        if let Some((path, hashes)) = inner.read_from() {
            let again = class.getattr("_read_again")?;
            let calibration = slf.get().calibration.as_ref();
            return (again, (path, hashes, calibration)).into_pyobject(py);
        }
        let columns = columns::arguments(py, &inner.parts())?;
        let others = (inner.surroundings(), slf.get().calibration.as_ref());
        (
            class.getattr("_from_columns")?,
            (columns, others.0, others.1),
        )
            .into_pyobject(py)
    }

    /// Itself: a field does not change.
    fn __copy__(slf: Py<Self>) -> Py<Self> {
        slf
    }

    /// Itself.
    fn __deepcopy__(slf: Py<Self>, _memo: &Bound<'_, PyAny>) -> Py<Self> {
        slf
    }

    /// The field of a dict of arguments, for pickle.
    #[staticmethod]
    #[pyo3(signature = (arguments, surroundings="", calibration=None))]
    fn _from_columns(
        arguments: &Bound<'_, PyDict>,
        surroundings: &str,
        calibration: Option<Py<PyList>>,
    ) -> PyResult<Self> {
        guarded(|| Self::from_columns(arguments, surroundings, calibration))
    }

    /// The field of files that must not have changed, for pickle.
    #[staticmethod]
    #[pyo3(signature = (path, hashes, calibration=None))]
    fn _read_again(
        py: Python<'_>,
        path: PathBuf,
        hashes: Vec<String>,
        calibration: Option<Py<PyList>>,
    ) -> PyResult<Self> {
        guarded(|| {
            let table = match &calibration {
                Some(columns) => Some(of_columns(columns.bind(py), "calibration")?),
                None => None,
            };
            let inner = py.detach(|| match &table {
                Some(table) => Inner::load_calibrated(&path, table),
                None => Inner::load(&path),
            })?;
            if inner.read_from().is_none_or(|(_, found)| found != hashes) {
                return Err(changed(&path, "pickled"));
            }
            Ok(Self { inner, calibration })
        })
    }

    /// This field with another calibration, as columns of the table.
    fn _calibrated(&self, py: Python<'_>, calibration: Py<PyList>) -> PyResult<Self> {
        guarded(|| self.with_calibration(py, calibration))
    }
}

/// A shape that must be that of points.
fn not_points(what: &str, wanted: &str, found: &[usize]) -> Failure {
    wrong_shape(what, &format!("{wanted} (east, north, up)"), found)
}

/// A row count in words, for messages.
fn rows(len: usize) -> String {
    shape_text(&[len])
}
