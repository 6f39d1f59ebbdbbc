//! Heliostats: where they stand and how their linear actuators turn them.

use std::path::Path;

use helio_core::Enu;
use serde_json::Value;

use super::geodesy::Origin;
use super::json::Record;
use crate::error::{IoError, Place, Problem};

/// What an actuator's numbers are called there, and in a table of drives.
pub(super) const ACTUATOR: [(&str, &str); 10] = [
    ("clockwise_axis_movement", "clockwise_axis_movement"),
    ("increment", "increment_steps_per_m"),
    ("offset", "offset_m"),
    ("pivot_radius", "pivot_radius_m"),
    ("initial_stroke_length", "initial_stroke_length_m"),
    ("initial_angle", "initial_angle_rad"),
    ("min_increment", "min_increment_steps"),
    ("max_increment", "max_increment_steps"),
    ("min_movement_angle", "min_movement_angle_rad"),
    ("max_movement_angle", "max_movement_angle_rad"),
];

/// Translations between the joints that a mount here has no place for.
const JOINTS: [&str; 8] = [
    "joint_translation_e_1",
    "joint_translation_n_1",
    "joint_translation_u_1",
    "joint_translation_e_2",
    "joint_translation_n_2",
    "joint_translation_u_2",
    "concentrator_translation_e",
    "concentrator_translation_u",
];

/// A heliostat as a heliostat-properties.json says.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Properties {
    pub(super) pivot: Enu,
    pub(super) mirror_offset_m: f64,
    /// Numbers of both axes' actuators, in the order of [`ACTUATOR`].
    pub(super) actuators: [[f64; ACTUATOR.len()]; 2],
}

impl Properties {
    pub(super) fn read(name: &str, path: &Path, origin: &Origin) -> Result<Self, IoError> {
        let found = Record::read(path)?;
        let of_heliostat = |problem: Problem| {
            let place = Place {
                heliostat: Some(name.to_owned()),
                ..Place::file(path)
            };
            IoError::new(place, problem)
        };
        let place = found.get(&["heliostat_position"])?;
        let pivot = origin.enu_m(found.point("heliostat_position", place)?);
        let kinematics = found.get(&["kinematics_properties"])?;
        let inside = |keys: &[&str]| found.within(kinematics, "kinematics_properties", keys);
        for key in JOINTS {
            let Some(value) = kinematics.get(key) else {
                continue;
            };
            let apart_m = found.number(key, value)?;
            if apart_m != 0.0 {
                let message = format!(
                    "{key} is {apart_m} m; here axes cross and mirrors stand on their normal"
                );
                return Err(of_heliostat(Problem::Conflict { message }));
            }
        }
        // The mirror looks north at rest in PAINT's frame, so that its normal is the second component.
        let key = "concentrator_translation_n";
        let mirror_offset_m = found.number(key, inside(&[key])?)?;
        let both = inside(&["actuators"])?;
        let Some([one, two]) = both.as_array().map(Vec::as_slice) else {
            let what = "kinematics_properties.actuators";
            return Err(found.wrong_kind(what, "a list of two actuators", both));
        };
        let actuator = |axis: usize, value: &Value| -> Result<_, IoError> {
            let part = format!("kinematics_properties.actuators[{axis}]");
            let kind = found.within(value, &part, &["type_axis"])?;
            if kind.as_str() != Some("linear") {
                return Err(found.wrong_kind(&format!("{part}.type_axis"), "\"linear\"", kind));
            }
            let mut numbers = [0.0; ACTUATOR.len()];
            for (number, (key, _)) in numbers.iter_mut().zip(ACTUATOR) {
                let value = found.within(value, &part, &[key])?;
                *number = found.number(&format!("{part}.{key}"), value)?;
            }
            Ok(numbers)
        };
        Ok(Self {
            pivot,
            mirror_offset_m,
            actuators: [actuator(0, one)?, actuator(1, two)?],
        })
    }
}
