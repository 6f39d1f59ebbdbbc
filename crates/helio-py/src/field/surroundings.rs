//! Where a field of columns lies and what it aims at.

use std::collections::BTreeMap;
use std::path::Path;

use helio_core::Enu;
use helio_core::angle::degrees;
use helio_io::{Site, Target, surroundings_of_text};
use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::failure::Failure;

/// What a field.toml would say of a site and targets given as mappings.
pub(super) fn text(
    py: Python<'_>,
    site: Option<&Bound<'_, PyAny>>,
    targets: Option<&Bound<'_, PyAny>>,
) -> Result<String, Failure> {
    if site.is_none() && targets.is_none() {
        return Ok(String::new());
    }
    let made = py.import("helio_py._toml")?.getattr("surroundings")?;
    Ok(made.call1((site, targets))?.extract()?)
}

/// The site and the targets of such a text.
pub(super) fn read(text: &str) -> Result<(Option<Site>, BTreeMap<String, Target>), Failure> {
    surroundings_of_text(Path::new("field"), text).map_err(|error| {
        let lines = text.lines().enumerate();
        let of_targets = |&(_, line): &(usize, &str)| line.starts_with("[targets");
        let targets_from = lines.map(|(at, line)| (at + 1, line)).find(of_targets);
        let of_site = match (error.place().line, targets_from) {
            (Some(line), Some((from, _))) => line < from,
            _ => targets_from.is_none(),
        };
        Failure::from(error).or_of(if of_site { "site" } else { "targets" })
    })
}

/// A site by the keys of `[site]`.
pub(super) fn site<'py>(py: Python<'py>, site: &Site) -> PyResult<Bound<'py, PyDict>> {
    let keys = PyDict::new(py);
    if let Some(name) = &site.name {
        keys.set_item("name", name)?;
    }
    for (key, number) in [
        ("latitude_deg", Some(degrees(site.latitude_rad))),
        ("longitude_deg", Some(degrees(site.longitude_rad))),
        ("elevation_m", Some(site.elevation_m)),
        ("pressure_hpa", site.pressure_hpa),
        ("temperature_c", site.temperature_c),
        ("delta_t_s", site.delta_t_s),
        ("ut1_utc_s", site.ut1_utc_s),
    ] {
        if let Some(number) = number {
            keys.set_item(key, number)?;
        }
    }
    Ok(keys)
}

/// Targets by their names and the keys of `[targets.NAME]`.
pub(super) fn targets<'py>(
    py: Python<'py>,
    targets: &BTreeMap<String, Target>,
) -> PyResult<Bound<'py, PyDict>> {
    let list = |enu: Enu| vec![enu.east, enu.north, enu.up];
    let named = PyDict::new(py);
    for (name, target) in targets {
        let keys = PyDict::new(py);
        keys.set_item("centre_enu_m", list(target.centre))?;
        if let Some(area) = &target.area {
            keys.set_item("normal_enu", list(area.plane.normal.as_enu()))?;
            keys.set_item("width_m", area.width_m)?;
            keys.set_item("height_m", area.height_m)?;
            keys.set_item("right_enu", list(area.plane.right.as_enu()))?;
        }
        named.set_item(name, keys)?;
    }
    Ok(named)
}
