//! What changed against an earlier calibration.

use std::collections::HashMap;
use std::path::Path;

use helio_calib::Mount;
use helio_calib::aiming::hour_angle_rad;
use helio_calib::plan::year_suns;
use helio_core::EnuUnit;
use helio_io::calibrate::LOWEST_SUN_RAD;
use helio_io::{CalibratedSet, LoadedField, Observations, load_calibration};
use rayon::prelude::*;

use super::SAID;
use crate::comparison::Change;
use crate::failure::Failure;
use crate::printer::Counted;

/// An earlier calibration to compare with.
pub(super) fn earlier(path: &Path, loaded: &LoadedField) -> Result<Vec<CalibratedSet>, Failure> {
    let old = load_calibration(path)?;
    let by_hour = |set: &CalibratedSet| set.hour_angle_from_rad.or(set.hour_angle_to_rad).is_some();
    if loaded.site.is_none() && old.iter().any(by_hour) {
        return Err(Failure::refused(format!(
            "--compare {}: its sets change with the hour angle of the sun, which needs the latitude from [site]",
            path.display()
        )));
    }
    Ok(old)
}

/// The sets with errors of each heliostat.
fn by_heliostat(sets: &[CalibratedSet]) -> HashMap<&str, Vec<&CalibratedSet>> {
    let mut of: HashMap<&str, Vec<&CalibratedSet>> = HashMap::new();
    for set in sets.iter().filter(|set| set.errors.is_some()) {
        of.entry(&set.id).or_default().push(set);
    }
    of
}

pub(super) fn median(mut values: Vec<f64>) -> Option<f64> {
    values.retain(|value| value.is_finite());
    values.sort_by(f64::total_cmp);
    values.get(values.len() / 2).copied()
}

/// What changed against an earlier calibration, in sentences.
pub(super) fn changes(
    loaded: &LoadedField,
    observations: &Observations,
    old: &[CalibratedSet],
    sets: &[CalibratedSet],
) -> Result<Vec<String>, Failure> {
    let suns: Vec<(EnuUnit, f64)> = match &loaded.site {
        Some(site) => year_suns(site.latitude_rad, LOWEST_SUN_RAD)
            .into_iter()
            .map(|sun| (sun, hour_angle_rad(sun, site.latitude_rad)))
            .collect(),
        // No set goes by the hour then.
        None => observations
            .heliostats
            .iter()
            .flat_map(|of| of.observations.iter().map(|o| (o.sun, 0.0)))
            .take(1000)
            .collect(),
    };
    let (before, after) = (by_heliostat(old), by_heliostat(sets));
    let field = &loaded.field;
    let found: Result<Vec<(&str, Change)>, _> = (0..field.len())
        .into_par_iter()
        .filter_map(|row| {
            let id = field.ids()[row].as_str();
            let change = Change::between(
                before.get(id)?,
                after.get(id)?,
                &field.heliostats()[row],
                &Mount::of(field.mode(), &field.heliostats()[row]),
                &suns,
                loaded.blend_rad,
            );
            Some(change.transpose()?.map(|change| (id, change)))
        })
        .collect();
    let mut found = found?;
    let beams: Vec<f64> = found.iter().map(|(_, change)| change.beam_mrad).collect();
    let significant = |c: &Change| c.is_significant() == Some(true);
    let count = found
        .iter()
        .filter(|(_, change)| significant(change))
        .count();
    let mut said = Vec::new();
    match median(beams) {
        Some(mrad) => said.push(format!(
            "compared: {} with an earlier calibration, {}; in the middle the beams move by {mrad:.3} mrad over the year",
            Counted(found.len(), "heliostat"),
            if found.iter().any(|(_, c)| c.is_significant().is_some()) {
                format!("{count} of them changed significantly")
            } else {
                "of none it is known whether it changed significantly".to_owned()
            }
        )),
        None => said.push("compared: no heliostat has an earlier calibration".to_owned()),
    }
    let fresh = after.keys().filter(|id| !before.contains_key(*id)).count();
    if fresh > 0 && !found.is_empty() {
        said.push(format!(
            "compared: {} without an earlier calibration",
            Counted(fresh, "heliostat")
        ));
    }
    let gone = before.keys().filter(|id| !after.contains_key(*id)).count();
    if gone > 0 {
        said.push(format!(
            "compared: {} with an earlier calibration and no new one",
            Counted(gone, "heliostat")
        ));
    }
    found.sort_by(|a, b| b.1.beam_mrad.total_cmp(&a.1.beam_mrad));
    let shown = found.len().min(SAID);
    for (name, change) in &found[..shown] {
        let of = match change.pairs {
            0 | 1 => String::new(),
            pairs => format!(", the greatest of {pairs} pairs of sets"),
        };
        let test = match (change.chi_square, change.is_significant()) {
            (Some((chi, freedom)), Some(true)) => {
                format!("significantly (chi-square {chi:.1} on {freedom}{of})")
            }
            (Some((chi, freedom)), Some(false)) => {
                format!("not significantly (chi-square {chi:.1} on {freedom}{of})")
            }
            _ if change.other_pose_errors => {
                "whether significantly is not known: its pose errors are others".to_owned()
            }
            _ => "whether significantly is not known: there is no covariance".to_owned(),
        };
        said.push(format!(
            "{name}: changed by {:.3} mrad over the year, {test}",
            change.beam_mrad
        ));
    }
    if found.len() > shown {
        said.push(format!(
            "... and {} that changed less",
            Counted(found.len() - shown, "heliostat")
        ));
    }
    Ok(said)
}
