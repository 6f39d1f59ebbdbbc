//! What a calibration changed of a field against an earlier one.

use std::collections::HashMap;

use helio_calib::aiming::hour_angle_rad;
use helio_calib::plan::year_suns;
use helio_calib::{CalibrationError, Mount};
use helio_core::EnuUnit;
use rayon::prelude::*;

use super::comparison::Change;
use super::{LOWEST_SUN_RAD, RunError};
use crate::calibrated::{CalibratedSet, load_calibration};
use crate::error::IoError;
use crate::field::LoadedField;
use crate::observations::Observations;
use crate::output::{Cells, Destination, Format, write_columns};
use crate::table::TableSource;
use crate::words::Counted;

/// Heliostats whose change people are told of, one in a line.
pub const CHANGES_TOLD: usize = 40;

/// Most records whose suns stand for those of a year where there is no site to tell these.
const SUNS_OF_RECORDS: usize = 1000;

/// Reads an earlier calibration of a field, to compare with.
///
/// # Errors
/// [`RunError`] for what is no calibration table, and for one that changes with the hour of a field without a site.
pub fn earlier<'a>(
    table: impl Into<TableSource<'a>>,
    loaded: &LoadedField,
) -> Result<Vec<CalibratedSet>, RunError> {
    let table = table.into();
    let old = load_calibration(table)?;
    let by_hour = |set: &CalibratedSet| set.hour_angle_from_rad.or(set.hour_angle_to_rad).is_some();
    if loaded.site.is_none() && old.iter().any(by_hour) {
        return Err(RunError::refused(format!(
            "--compare {}: its sets change with the hour angle of the sun, which needs the latitude from [site]",
            table.path().display()
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

/// The middle of those values that are finite, the upper of two; none of none.
#[must_use]
pub fn median(mut values: Vec<f64>) -> Option<f64> {
    values.retain(|value| value.is_finite());
    values.sort_by(f64::total_cmp);
    values.get(values.len() / 2).copied()
}

/// The suns at which beams are compared, each with its hour angle \[rad\]: those of a year, or of the records.
fn compared_suns(loaded: &LoadedField, observations: &Observations) -> Vec<(EnuUnit, f64)> {
    match &loaded.site {
        Some(site) => year_suns(site.latitude_rad, LOWEST_SUN_RAD)
            .into_iter()
            .map(|sun| (sun, hour_angle_rad(sun, site.latitude_rad)))
            .collect(),
        // No set goes by the hour then.
        None => observations
            .heliostats
            .iter()
            .flat_map(|of| of.observations.iter().map(|o| (o.sun, 0.0)))
            .take(SUNS_OF_RECORDS)
            .collect(),
    }
}

/// What changed of a field against an earlier calibration.
///
/// ```
/// use std::path::Path;
///
/// use helio_io::calibrate::{Asked, Changes, FitWords, Run};
///
/// let examples = Path::new("../../examples");
/// let loaded = helio_io::load_field(&examples.join("field.toml"))?;
/// let seen = helio_io::load_observations(&examples.join("observations.csv"), &loaded)?;
/// let run = Run {
///     loaded: &loaded,
///     observations: &seen,
///     asked: &Asked::new(&FitWords::default())?,
/// };
/// let sets = run.sets(&run.one(0)?);
/// let none = Changes::between(&loaded, &seen, &sets, &sets, &|| true)?;
/// assert_eq!(
///     none.sentences(1)[1],
///     "H001: changed by 0.000 mrad over the year, not significantly (chi-square 0.0 on 6)"
/// );
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Debug, Clone, PartialEq)]
pub struct Changes {
    /// The heliostats that both calibrations know, each with what changed of it; the greatest change first.
    pub heliostats: Vec<(String, Change)>,
    /// Heliostats without an earlier calibration.
    pub fresh: usize,
    /// Heliostats with an earlier calibration and no new one.
    pub gone: usize,
}

impl Changes {
    /// Between an earlier calibration, which [`earlier`] reads, and a new one; `go_on` is asked heliostat by heliostat.
    ///
    /// # Errors
    /// [`RunError`] for errors that no mount has, and where it is stopped.
    pub fn between(
        loaded: &LoadedField,
        observations: &Observations,
        old: &[CalibratedSet],
        new: &[CalibratedSet],
        go_on: &(dyn Fn() -> bool + Sync),
    ) -> Result<Self, RunError> {
        let suns = compared_suns(loaded, observations);
        let (before, after) = (by_heliostat(old), by_heliostat(new));
        let field = &loaded.field;
        let found: Result<Vec<(String, Change)>, RunError> = (0..field.len())
            .into_par_iter()
            .filter_map(|row| {
                let id = field.ids()[row].as_str();
                let (old, new) = (before.get(id)?, after.get(id)?);
                if !go_on() {
                    return Some(Err(CalibrationError::Stopped.into()));
                }
                let heliostat = &field.heliostats()[row];
                let mount = Mount::of(field.mode(), heliostat);
                let change = Change::between(old, new, heliostat, &mount, &suns, loaded.blend_rad);
                let named = |change| (id.to_owned(), change);
                change
                    .map_err(RunError::from)
                    .transpose()
                    .map(|change| change.map(named))
            })
            .collect();
        let mut heliostats = found?;
        heliostats.sort_by(|a, b| b.1.beam_mrad.total_cmp(&a.1.beam_mrad));
        Ok(Self {
            heliostats,
            fresh: after.keys().filter(|id| !before.contains_key(*id)).count(),
            gone: before.keys().filter(|id| !after.contains_key(*id)).count(),
        })
    }

    /// The changes in sentences: of all heliostats together, then of `most` of them one by one.
    #[must_use]
    pub fn sentences(&self, most: usize) -> Vec<String> {
        let found = &self.heliostats;
        let beams = found.iter().map(|(_, change)| change.beam_mrad).collect();
        let mut said = Vec::new();
        match median(beams) {
            Some(mrad) => said.push(format!(
                "compared: {} with an earlier calibration, {}; in the middle the beams move by {mrad:.3} mrad over the year",
                Counted(found.len(), "heliostat"),
                self.significant_words()
            )),
            None => said.push("compared: no heliostat has an earlier calibration".to_owned()),
        }
        if self.fresh > 0 && !found.is_empty() {
            said.push(format!(
                "compared: {} without an earlier calibration",
                Counted(self.fresh, "heliostat")
            ));
        }
        if self.gone > 0 {
            said.push(format!(
                "compared: {} with an earlier calibration and no new one",
                Counted(self.gone, "heliostat")
            ));
        }
        let shown = found.len().min(most);
        said.extend(
            found[..shown]
                .iter()
                .map(|(id, change)| in_words(id, change)),
        );
        if found.len() > shown {
            said.push(format!(
                "... and {} that changed less",
                Counted(found.len() - shown, "heliostat")
            ));
        }
        said
    }

    fn significant_words(&self) -> String {
        let known = || {
            self.heliostats
                .iter()
                .filter_map(|(_, change)| change.is_significant())
        };
        match known().count() {
            0 => "of none it is known whether it changed significantly".to_owned(),
            _ => format!(
                "{} of them changed significantly",
                known().filter(|is| *is).count()
            ),
        }
    }

    /// Writes a row for each heliostat that both calibrations know, the greatest change first; the number of bytes.
    /// `significant` is `yes`, `no` or `unknown`, and `why` says why it is not known.
    ///
    /// # Errors
    /// [`IoError`] if they cannot be written.
    pub fn write(&self, destination: Destination, format: Format) -> Result<u64, IoError> {
        let all = || self.heliostats.iter().map(|(_, change)| change);
        let ids: Vec<String> = self.heliostats.iter().map(|(id, _)| id.clone()).collect();
        let beams: Vec<f64> = all().map(|change| change.beam_mrad).collect();
        let chi_squares = all().map(|change| change.chi_square.map_or(f64::NAN, |(sum, _)| sum));
        let chi_squares: Vec<f64> = chi_squares.collect();
        let whole = |number: usize| i64::try_from(number).ok();
        let freedom: Vec<Option<i64>> = all()
            .map(|change| change.chi_square.and_then(|(_, freedom)| whole(freedom)))
            .collect();
        let pairs: Vec<Option<i64>> = all().map(|change| whole(change.pairs)).collect();
        let significant: Vec<String> = all()
            .map(|change| match change.is_significant() {
                Some(true) => "yes".to_owned(),
                Some(false) => "no".to_owned(),
                None => "unknown".to_owned(),
            })
            .collect();
        let why: Vec<String> = all()
            .map(|change| match change.is_significant() {
                Some(_) => String::new(),
                None => why_unknown(change).to_owned(),
            })
            .collect();
        let columns = [
            ("id", Cells::Text(&ids)),
            ("beam_mrad", Cells::Numbers(&beams)),
            ("chi_square", Cells::Numbers(&chi_squares)),
            ("degrees_of_freedom", Cells::Whole(&freedom)),
            ("pairs", Cells::Whole(&pairs)),
            ("significant", Cells::Text(&significant)),
            ("why", Cells::Text(&why)),
        ];
        write_columns(destination, format, &columns)
    }
}

/// Why it is not known whether a change is significant.
const fn why_unknown(change: &Change) -> &'static str {
    if change.other_pose_errors {
        "its pose errors are others"
    } else {
        "there is no covariance"
    }
}

fn in_words(id: &str, change: &Change) -> String {
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
        _ => format!(
            "whether significantly is not known: {}",
            why_unknown(change)
        ),
    };
    format!(
        "{id}: changed by {:.3} mrad over the year, {test}",
        change.beam_mrad
    )
}
