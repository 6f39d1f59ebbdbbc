//! The tower: where the plant lies, and the planes on which spots are seen.

use std::collections::BTreeMap;
use std::path::Path;

use helio_core::Enu;
use serde_json::Value;

use super::geodesy::Origin;
use super::json::Record;
use crate::error::{IoError, Problem};

const PLANT: &str = "power_plant_properties";

/// A plane through four corners.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Plane {
    pub(super) centre: Enu,
    pub(super) normal: Enu,
    pub(super) right: Enu,
    pub(super) width_m: f64,
    pub(super) height_m: f64,
}

/// What a tower-measurements.json says.
pub(super) struct Tower {
    pub(super) origin: Origin,
    /// By name.
    pub(super) targets: BTreeMap<String, Plane>,
    /// What is no plane.
    pub(super) others: Vec<String>,
}

impl Tower {
    pub(super) fn read(path: &Path) -> Result<Self, IoError> {
        let tower = Record::read(path)?;
        let place = tower.get(&[PLANT, "coordinates"])?;
        let origin = Origin::new(tower.point(&format!("{PLANT}.coordinates"), place)?);
        let (mut targets, mut others) = (BTreeMap::new(), Vec::new());
        for (name, target) in tower.entries().filter(|(name, _)| *name != PLANT) {
            if target.get("type").and_then(Value::as_str) == Some("planar") {
                let plane = Plane::of(&tower, name, target, &origin)?;
                targets.insert(name.to_owned(), plane);
            } else {
                others.push(name.to_owned());
            }
        }
        if targets.is_empty() {
            return Err(tower.error(Problem::Missing {
                what: "a planar target".to_owned(),
                wanted: "spots are seen on planes".to_owned(),
            }));
        }
        Ok(Self {
            origin,
            targets,
            others,
        })
    }
}

impl Plane {
    fn of(tower: &Record, name: &str, target: &Value, origin: &Origin) -> Result<Self, IoError> {
        let corner = |which: &str| -> Result<Enu, IoError> {
            let at = tower.within(target, name, &["coordinates", which])?;
            let what = format!("{name}.coordinates.{which}");
            Ok(origin.enu_m(tower.point(&what, at)?))
        };
        let [upper_left, upper_right] = [corner("upper_left")?, corner("upper_right")?];
        let [lower_right, lower_left] = [corner("lower_right")?, corner("lower_left")?];
        let facing = tower.within(target, name, &["normal_vector"])?;
        let facing = tower.three(&format!("{name}.normal_vector"), facing)?;
        let facing = Enu::new(facing[0], facing[1], facing[2]);
        // The edges through the middle: the corners make no exact rectangle.
        let across = (upper_right - upper_left + (lower_right - lower_left)) * 0.5;
        let down = (lower_left - upper_left + (lower_right - upper_right)) * 0.5;
        let normal = down.cross(across);
        let (width_m, height_m) = (across.norm(), down.norm());
        let area_m2 = normal.norm();
        let spans = area_m2 > 1e-9 * width_m * height_m && area_m2.is_finite();
        if !spans {
            return Err(tower.conflict(format!("{name}: its corners span no plane")));
        }
        let normal = normal * (1.0 / area_m2);
        if normal.dot(facing) <= 0.0 {
            return Err(tower.conflict(format!(
                "{name}: its corners run the other way round than its normal_vector wants"
            )));
        }
        Ok(Self {
            centre: (upper_left + upper_right + lower_right + lower_left) * 0.25,
            normal,
            right: across * (1.0 / width_m),
            width_m,
            height_m,
        })
    }
}
