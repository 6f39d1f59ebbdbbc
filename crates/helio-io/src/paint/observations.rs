//! Calibration records: motor steps, sun, and where a spot was.

use std::collections::BTreeMap;
use std::path::Path;

use helio_core::Enu;

use super::PaintCentroid;
use super::geodesy::Origin;
use super::json::Record;
use super::tower::Plane;
use crate::error::IoError;

/// A record that says all that an observation wants.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Seen {
    pub(super) heliostat: String,
    pub(super) record: String,
    /// From north, clockwise.
    pub(super) sun_azimuth_deg: f64,
    pub(super) sun_elevation_deg: f64,
    pub(super) steps: [f64; 2],
    pub(super) target: String,
    pub(super) spot: Enu,
    /// How far the spot lies before the plane of its target.
    pub(super) off_plane_m: f64,
}

/// What a record is, or why it is left aside.
pub(super) fn read(
    heliostat: &str,
    path: &Path,
    origin: &Origin,
    targets: &BTreeMap<String, Plane>,
    centroid: PaintCentroid,
) -> Result<Result<Seen, String>, IoError> {
    let found = Record::read(path)?;
    let spots = found.get(&["focal_spot"])?;
    let target = found.get(&["target_name"])?;
    let (Some(azimuth), Some(elevation)) =
        (found.maybe("sun_azimuth"), found.maybe("sun_elevation"))
    else {
        return Ok(Err("no sun".to_owned()));
    };
    let word = centroid.as_str();
    let Some(spot) = spots.get(word).filter(|spot| !spot.is_null()) else {
        return Ok(Err(format!("no centroid of {word}")));
    };
    let Some((target, plane)) = target.as_str().and_then(|name| targets.get_key_value(name)) else {
        let name = target.as_str().map_or(target.to_string(), str::to_owned);
        return Ok(Err(format!("target `{name}` is no plane of the tower")));
    };
    let spot = origin.enu_m(found.point(&format!("focal_spot.{word}"), spot)?);
    let motors = found.get(&["motor_position"])?;
    let steps = |key: &str, early: &str| -> Result<f64, IoError> {
        // Early records have the names of the plant's data base.
        let key = if motors.get(early).is_some() {
            early
        } else {
            key
        };
        let value = found.within(motors, "motor_position", &[key])?;
        found.number(&format!("motor_position.{key}"), value)
    };
    let name = path.file_name().unwrap_or_default().to_string_lossy();
    Ok(Ok(Seen {
        heliostat: heliostat.to_owned(),
        record: name.strip_suffix(super::RECORD).unwrap_or(&name).to_owned(),
        // Azimuths there count from south, toward east.
        sun_azimuth_deg: 180.0 - found.number("sun_azimuth", azimuth)?,
        sun_elevation_deg: found.number("sun_elevation", elevation)?,
        steps: [
            steps("axis_1_motor_position", "Axis1MotorPosition")?,
            steps("axis_2_motor_position", "Axis2MotorPosition")?,
        ],
        target: target.clone(),
        spot,
        off_plane_m: (spot - plane.centre).dot(plane.normal),
    }))
}
