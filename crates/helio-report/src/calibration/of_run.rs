//! The page of a calibration, from what the heliostats came to.

use helio_calib::{Mount, Observation, Parameter, Parameters, student_t95};
use helio_core::MountErrors;
use helio_core::angle::degrees;
use helio_io::calibrate::{Done, DoneSet, OK, Run, predicted_spots};
use helio_io::{IoError, LoadedField, Observations};

use super::{
    CalibrationPage, EpochSection, HeliostatSection, HeliostatSummary, ParameterRow, ParameterUnit,
    Record, SECTIONS, SetChoice, SetRow, TargetOutline, Verdict, most_in_need,
};
use crate::run::{AboutRun, facts, site_name};

/// What a page is made of.
struct Source<'a> {
    loaded: &'a LoadedField,
    observations: &'a Observations,
    done: &'a [Done],
}

impl CalibrationPage {
    /// The page of a run, heliostat by heliostat, from what they came to in the order of the field.
    ///
    /// # Errors
    /// [`IoError`] if the observations are not those of their file.
    ///
    /// ```
    /// use std::path::Path;
    ///
    /// use helio_io::calibrate::{Asked, FitWords, Run};
    /// use helio_report::AboutRun;
    /// use helio_report::calibration::{CalibrationPage, calibration_page};
    ///
    /// let examples = Path::new("../../examples");
    /// let loaded = helio_io::load_field(&examples.join("field.toml"))?;
    /// let seen = helio_io::load_observations(&examples.join("observations.csv"), &loaded)?;
    /// let run = Run {
    ///     loaded: &loaded,
    ///     observations: &seen,
    ///     asked: &Asked::new(&FitWords::default())?,
    /// };
    /// let done: Result<Vec<_>, _> = (0..seen.heliostats.len()).map(|index| run.one(index)).collect();
    /// let about = AboutRun {
    ///     provenance: &helio_io::Provenance::default(),
    ///     generated_utc: "2026-06-21T12:00:00Z".into(),
    ///     changes: Vec::new(),
    /// };
    /// let page = CalibrationPage::of_run(&run, &done?, about)?;
    /// assert_eq!((page.field.len(), page.heliostats.len()), (500, 4)); // those with records have a section
    /// assert!(calibration_page(&page).starts_with("<!DOCTYPE html>"));
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn of_run(run: &Run<'_>, done: &[Done], about: AboutRun<'_>) -> Result<Self, IoError> {
        let source = Source {
            loaded: run.loaded,
            observations: run.observations,
            done,
        };
        source.page(about)
    }
}

fn verdict_of(set: &DoneSet) -> Verdict {
    match set.status.as_str() {
        OK => Verdict::Determined,
        _ if set.is_fitted() => Verdict::Undetermined,
        _ => Verdict::Failed,
    }
}

impl Source<'_> {
    fn page(&self, about: AboutRun<'_>) -> Result<CalibrationPage, IoError> {
        let field = &self.loaded.field;
        let mut lines: Vec<HeliostatSummary> = field
            .ids()
            .iter()
            .zip(field.heliostats())
            .map(|(id, heliostat)| HeliostatSummary {
                id: id.clone(),
                east_m: heliostat.pivot.east,
                north_m: heliostat.pivot.north,
                beam_rms_mrad: f64::NAN,
                ..HeliostatSummary::default()
            })
            .collect();
        let mut of_row: Vec<Option<usize>> = vec![None; field.len()];
        for (place, one) in self.done.iter().enumerate() {
            let of = &self.observations.heliostats[one.index];
            of_row[of.row] = Some(place);
            let line = &mut lines[of.row];
            line.verdict = worst(&one.sets);
            line.observations = of.observations.len();
            line.rejected = one.rejected.len();
            line.epochs = one.sets.len();
            // Of the worst set, as long as any has a number.
            line.beam_rms_mrad = one
                .sets
                .iter()
                .map(|set| set.beam_rms_mrad.0)
                .fold(f64::NAN, f64::max);
            line.remark = one
                .sets
                .iter()
                .find(|set| set.status != OK)
                .map_or(String::new(), |set| set.status.clone());
        }
        let sections: Result<_, IoError> = most_in_need(&lines, SECTIONS, &[])
            .into_iter()
            .filter_map(|row| Some(self.section(&self.done[of_row[row]?])))
            .collect();
        let centres = self.loaded.targets.values().map(|target| target.centre);
        let n = self.loaded.targets.len() as f64;
        let tower = centres.fold([0.0; 2], |sum, c| [sum[0] + c.east, sum[1] + c.north]);
        Ok(CalibrationPage {
            title: format!("Calibration of {}", site_name(self.loaded)),
            generated_utc: about.generated_utc,
            version: format!("helio-rs {}", about.provenance.version),
            facts: facts(self.loaded, self.observations, about.provenance),
            findings: about.changes,
            field: lines,
            tower_m: (n > 0.0).then(|| tower.map(|sum| sum / n)),
            targets: self
                .loaded
                .targets
                .iter()
                .filter_map(|(name, target)| {
                    let area = target.area?;
                    Some(TargetOutline {
                        name: name.clone(),
                        size_m: Some([area.width_m, area.height_m]),
                    })
                })
                .collect(),
            heliostats: sections?,
        })
    }

    fn section(&self, one: &Done) -> Result<HeliostatSection, IoError> {
        let of = &self.observations.heliostats[one.index];
        let heliostat = &self.loaded.field.heliostats()[of.row];
        let mount = Mount::of(self.loaded.field.mode(), heliostat);
        let before = Parameters::new(&heliostat.errors, heliostat.mirror_offset_m);
        let count = of.observations.len();
        let mut epoch_of: Vec<Option<usize>> = vec![None; count];
        let mut why: Vec<Option<String>> = vec![None; count];
        for (epoch, set) in one.sets.iter().enumerate() {
            for &row in &set.rows {
                epoch_of[row].get_or_insert(epoch);
            }
        }
        for left in &one.rejected {
            why[left.row] = Some(left.words.clone());
            epoch_of[left.row] = one.sets.iter().position(|set| {
                let Some(ns) = of.observations[left.row].unix_ns else {
                    return false;
                };
                set.is_fitted()
                    && set.valid_from_ns.is_none_or(|from| from <= ns)
                    && set.valid_to_ns.is_none_or(|to| ns < to)
            });
        }
        let (before_m, before_mrad) = predicted_spots(&mount, &of.observations, &before);
        let mut after_m = vec![[f64::NAN; 2]; count];
        let mut after_mrad = vec![f64::NAN; count];
        for (epoch, set) in one
            .sets
            .iter()
            .enumerate()
            .filter(|(_, set)| set.is_fitted())
        {
            let parameters = Parameters::new(&set.mount_errors(), set.mirror_offset_m.0);
            let (spots_m, mrad) = predicted_spots(&mount, &of.observations, &parameters);
            for row in (0..count).filter(|&row| epoch_of[row] == Some(epoch)) {
                after_m[row] = spots_m[row];
                after_mrad[row] = mrad[row];
            }
        }
        let rms = |mrad: &[f64]| {
            let kept: Vec<f64> = (0..count)
                .filter(|&row| why[row].is_none() && mrad[row].is_finite())
                .map(|row| mrad[row] * mrad[row])
                .collect();
            // NaN where there is none.
            (kept.iter().sum::<f64>() / kept.len() as f64).sqrt()
        };
        let records: Result<_, IoError> = (0..count)
            .map(|row| {
                let observation = &of.observations[row];
                let record = of.records[row];
                let place = self.observations.position(record)?;
                let name = self.observations.record_id(record);
                let (target, _) = &self.observations.targets[observation.target];
                Ok(Record {
                    label: name.map_or(place.clone(), |name| format!("{name} ({place})")),
                    target: target.clone(),
                    unix_ns: observation.unix_ns,
                    hour_angle_deg: observation.hour_angle_rad.map(degrees),
                    sun_azimuth_deg: degrees(observation.sun.azimuth_rad()),
                    sun_elevation_deg: degrees(observation.sun.elevation_rad()),
                    measured_m: [observation.u_m, observation.v_m],
                    before_m: before_m[row],
                    after_m: after_m[row],
                    before_mrad: before_mrad[row],
                    after_mrad: after_mrad[row],
                    epoch: epoch_of[row],
                    rejected: why[row].clone(),
                })
            })
            .collect();
        let mut words = one.findings.clone();
        for set in &one.sets {
            if set.status != OK && !words.contains(&set.why) {
                words.push(format!("{}{}: {}", set.status, set.of(), set.why));
            }
        }
        Ok(HeliostatSection {
            id: self.loaded.field.ids()[of.row].clone(),
            verdict: worst(&one.sets),
            words,
            before_rms_mrad: rms(&before_mrad),
            after_rms_mrad: rms(&after_mrad),
            facts: Vec::new(),
            records: records?,
            epochs: one
                .sets
                .iter()
                .filter(|set| set.is_fitted())
                .map(|set| {
                    epoch(
                        set,
                        &heliostat.errors,
                        heliostat.mirror_offset_m,
                        &of.observations,
                    )
                })
                .collect(),
            sets: one
                .choices
                .iter()
                .map(|choice| SetChoice {
                    chosen: choice.chosen,
                    beam_rms_mrad: choice.beam_rms_mrad.0,
                    unseen_rms_mrad: choice.unseen_rms_mrad.map(|e| e.0),
                    sets: if choice.chosen {
                        one.sets.iter().map(set_row).collect()
                    } else {
                        vec![SetRow::default(); choice.sets]
                    },
                })
                .collect(),
        })
    }
}

fn set_row(set: &DoneSet) -> SetRow {
    let [from, to] = set.hours_rad.unwrap_or_default();
    SetRow {
        hour_angle_from_deg: from.map(|e| degrees(e.0)),
        hour_angle_to_deg: to.map(|e| degrees(e.0)),
        observations: set.rows.len(),
        beam_rms_mrad: set.beam_rms_mrad.0,
    }
}

/// The verdict in most need of attention.
fn worst(sets: &[DoneSet]) -> Verdict {
    sets.iter().map(verdict_of).min().unwrap_or(Verdict::Failed)
}

fn epoch(
    set: &DoneSet,
    before: &MountErrors,
    before_offset_m: f64,
    seen: &[Observation],
) -> EpochSection {
    let factor = student_t95(set.degrees_of_freedom);
    let is_free = |p: Parameter| set.free.contains(&(p as u8));
    let names = [
        ("pedestal tilt", before.pedestal_tilt_rad, Parameter::Tilt1),
        (
            "pedestal tilt azimuth",
            before.pedestal_tilt_azimuth_rad,
            Parameter::Tilt2,
        ),
        (
            "axis non-orthogonality",
            before.axis_nonorthogonality_rad,
            Parameter::AxisNonorthogonality,
        ),
        ("mirror tilt", before.mirror_tilt_rad, Parameter::MirrorTilt),
        (
            "azimuth reference",
            before.azimuth_reference_rad,
            Parameter::AzimuthReference,
        ),
        (
            "elevation reference",
            before.elevation_reference_rad,
            Parameter::ElevationReference,
        ),
    ];
    let row = |name: &str, value: f64, before: f64, error: f64, held: bool, unit| {
        let standard_error = (error.is_finite() && !held).then_some(error);
        ParameterRow {
            name: name.to_owned(),
            unit,
            value,
            before: Some(before),
            standard_error,
            interval95: standard_error
                .filter(|_| factor.is_finite())
                .map(|error| [value - factor * error, value + factor * error]),
            held,
        }
    };
    let mut parameters: Vec<ParameterRow> = names
        .iter()
        .zip(set.errors)
        .zip(set.sigmas)
        .map(|(((name, before, parameter), value), sigma)| {
            let held = !is_free(*parameter);
            let [value, before, sigma] = [value.0, *before, sigma.0].map(degrees);
            row(name, value, before, sigma, held, ParameterUnit::Degrees)
        })
        .collect();
    if is_free(Parameter::MirrorOffset) {
        parameters.push(row(
            Parameter::MirrorOffset.in_words(),
            set.mirror_offset_m.0,
            before_offset_m,
            set.sigmas[6].0,
            false,
            ParameterUnit::Metres,
        ));
    }
    let free: Vec<usize> = (0..7).filter(|&k| set.free.contains(&(k as u8))).collect();
    let of = |a: usize, b: usize| set.covariance[a][b].0;
    let times = || set.rows.iter().filter_map(|&row| seen[row].unix_ns);
    EpochSection {
        from_unix_ns: times().min(),
        to_unix_ns: times().max(),
        observations: set.rows.len(),
        beam_rms_mrad: set.beam_rms_mrad.0,
        verdict: verdict_of(set),
        words: match set.status.as_str() {
            OK if set.why.is_empty() => set.weakness.clone(),
            _ => set.why.clone(),
        },
        year_pointing_mrad: Some(set.year_pointing_mrad.0).filter(|mrad| mrad.is_finite()),
        parameters,
        correlation: free
            .iter()
            .map(|&a| {
                free.iter()
                    .map(|&b| of(a, b) / (of(a, a) * of(b, b)).sqrt())
                    .collect()
            })
            .collect(),
        correlation_names: free
            .iter()
            .map(|&k| short_name(Parameter::ALL[k]).to_owned())
            .collect(),
        facts: vec![
            ("condition".to_owned(), format!("{:.0}", set.condition.0)),
            ("rank".to_owned(), format!("{} of {}", set.rank, free.len())),
            (
                "degrees of freedom".to_owned(),
                set.degrees_of_freedom.to_string(),
            ),
            ("iterations".to_owned(), set.iterations.to_string()),
        ],
    }
}

fn short_name(parameter: Parameter) -> &'static str {
    match parameter {
        Parameter::Tilt1 => "tilt 1",
        Parameter::Tilt2 => "tilt 2",
        Parameter::AzimuthReference => "azimuth ref.",
        Parameter::AxisNonorthogonality => "non-orth.",
        Parameter::ElevationReference => "elevation ref.",
        Parameter::MirrorTilt => "mirror tilt",
        Parameter::MirrorOffset => "offset",
    }
}
