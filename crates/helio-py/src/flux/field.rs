//! The heliostats of a field as they track.

use helio_calib::aiming::hour_angle_rad;
use helio_core::{EnuUnit, Field};
use helio_flux::field_mirrors;
use helio_io::SceneOf;
use pyo3::prelude::*;

use super::map::PyFlux;
use super::scene::SceneAsked;
use crate::failure::Failure;
use crate::field::{Inner, PyField};
use crate::guard::guarded;
use crate::track::direction;
use crate::watch::watched;

/// The flux of a field under one sun.
#[pyfunction]
pub(crate) fn _flux_field(
    py: Python<'_>,
    field: &Bound<'_, PyAny>,
    scene: SceneAsked,
    sun_azimuth_rad: f64,
    sun_elevation_rad: f64,
    unix_ns: Option<i64>,
    progress: Option<Py<PyAny>>,
) -> PyResult<PyFlux> {
    guarded(|| {
        let field = PyField::of(field)?.clone().unbind();
        let sun = direction(0, sun_azimuth_rad, sun_elevation_rad)?;
        watched(py, progress.as_ref(), |watch| {
            let inner = field.get().inner();
            let of = match inner.is_bare() {
                true => SceneOf::Heliostats,
                false => SceneOf::Field(inner.loaded()),
            };
            let scene = scene.read(of)?;
            let Some(mirror) = scene.mirror.heliostat else {
                // A scene of heliostats has one.
                return Err(Failure::new("MissingError", "the scene has no [mirror]"));
            };
            let up_to_date = up_to_date(inner, unix_ns, sun)?;
            let mirrors = field_mirrors(&up_to_date, sun, &mirror)?;
            let enu = sun.as_enu();
            let toward = [enu.east, enu.north, enu.up];
            let map = scene.light(&mirrors.elements, toward, 0, watch)?;
            let map = map.ok_or_else(stopped)?;
            Ok(PyFlux::of_field(scene, map, mirrors.status))
        })?
    })
}

/// What is left where work ended early, and nobody raised anything.
pub(super) fn stopped() -> Failure {
    Failure::new("InternalError", "flux: stopped before its end")
}

/// The field with the calibration that holds at a time.
fn up_to_date(inner: &Inner, unix_ns: Option<i64>, sun: EnuUnit) -> Result<Field, Failure> {
    let mut field = inner.field().clone();
    if let Some((schedule, site)) = inner.schedule() {
        let Some(site) = site else {
            let message = "the calibration changes with the hour angle of the sun, which needs the \
                           latitude from [site]";
            return Err(Failure::new("MissingError", message));
        };
        let hour_rad = hour_angle_rad(sun, site.latitude_rad);
        schedule.update(&mut field, unix_ns, hour_rad)?;
    }
    Ok(field)
}
