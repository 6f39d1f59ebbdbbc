//! The next observations.

use helio_calib::plan::year_suns;
use helio_calib::{CalibrationError, Candidate, Duty, Parameters, PlanOptions, Proposal};
use helio_core::EnuUnit;
use helio_core::angle::degrees;
use rayon::prelude::*;

use super::{Done, LOWEST_SUN_RAD, Run, RunError};
use crate::error::IoError;
use crate::field::LoadedField;
use crate::output::{Cells, Destination, Format, write_columns};

/// What is asked of the next observations.
#[derive(Debug, Clone)]
pub struct Proposals {
    /// How many for each heliostat.
    pub count: usize,
    /// Their day, as it was written.
    pub date: String,
    /// What there is to choose from.
    pub candidates: Vec<Candidate>,
    /// Suns of a year.
    pub suns: Vec<EnuUnit>,
    /// Names of the targets that candidates count.
    pub targets: Vec<String>,
}

/// Time between the suns that are looked at for the next observations \[s\].
const PLAN_STEP_S: f64 = 600.0;

impl Proposals {
    /// So many on a day, such as 2026-06-21.
    ///
    /// # Errors
    /// [`RunError`] for what is no day, one on which the sun never stands high, and without a site.
    pub fn new(count: usize, date: &str, loaded: &LoadedField) -> Result<Self, RunError> {
        let Some(site) = &loaded.site else {
            return Err(RunError::refused(
                "--plan: there is no [site], which the suns of that day need",
            ));
        };
        let day: jiff::civil::Date = date.trim().parse().map_err(|_| {
            RunError::refused(format!(
                "--plan-date {date}: wanted a day, such as 2026-06-21"
            ))
        })?;
        let midnight = day
            .to_zoned(jiff::tz::TimeZone::UTC)
            .map_err(|error| RunError::refused(format!("--plan-date {date}: {error}")))?;
        // From local solar midnight to the next.
        let day_s = 86_400.0;
        let east_s = site.longitude_rad / std::f64::consts::TAU * day_s;
        let from_s = midnight.timestamp().as_second() - east_s.round() as i64;
        let (targets, planes): (Vec<_>, Vec<_>) = loaded
            .targets
            .iter()
            .filter_map(|(name, target)| Some((name.clone(), target.area?.plane)))
            .unzip();
        let from_ns = from_s.saturating_mul(1_000_000_000);
        let candidates = helio_calib::plan::candidates(
            &site.sun_site()?,
            from_ns,
            from_ns.saturating_add(day_s as i64 * 1_000_000_000),
            PLAN_STEP_S,
            LOWEST_SUN_RAD,
            &planes,
        )?;
        if candidates.is_empty() {
            return Err(RunError::refused(format!(
                "--plan-date {date}: the sun never stands 10 degrees high on that day"
            )));
        }
        Ok(Self {
            count,
            date: date.to_owned(),
            candidates,
            suns: year_suns(site.latitude_rad, LOWEST_SUN_RAD),
            targets,
        })
    }

    /// Writes proposals, each with the row of its heliostat in the field; the number of bytes.
    ///
    /// # Errors
    /// [`IoError`] if they cannot be written.
    pub fn write(
        &self,
        rows: &[(usize, Proposal)],
        loaded: &LoadedField,
        destination: Destination,
        format: Format,
    ) -> Result<u64, IoError> {
        let ids: Vec<String> = rows
            .iter()
            .map(|(row, _)| loaded.field.ids()[*row].clone())
            .collect();
        let times: Vec<Option<i64>> = rows.iter().map(|(_, p)| Some(p.unix_ns)).collect();
        let numbers =
            |of: fn(&Proposal) -> f64| -> Vec<f64> { rows.iter().map(|(_, p)| of(p)).collect() };
        let azimuths = numbers(|p| degrees(p.sun.azimuth_rad()));
        let elevations = numbers(|p| degrees(p.sun.elevation_rad()));
        let before = numbers(|p| p.expected_year_pointing_mrad_before);
        let after = numbers(|p| p.expected_year_pointing_mrad_after);
        let targets: Vec<String> = rows
            .iter()
            .map(|(_, p)| self.targets[p.target].clone())
            .collect();
        let columns = [
            ("id", Cells::Text(&ids)),
            ("time", Cells::Times(&times)),
            ("sun_azimuth_deg", Cells::Numbers(&azimuths)),
            ("sun_elevation_deg", Cells::Numbers(&elevations)),
            ("target", Cells::Text(&targets)),
            ("year_pointing_before_mrad", Cells::Numbers(&before)),
            ("year_pointing_after_mrad", Cells::Numbers(&after)),
        ];
        write_columns(destination, format, &columns)
    }
}

impl Run<'_> {
    /// The proposed observations of every heliostat, with its row in the field; `go_on` is asked heliostat by heliostat.
    ///
    /// # Errors
    /// [`RunError`] where the library refuses, and where it is stopped.
    pub fn propose(
        &self,
        asked: &Proposals,
        done: &[Done],
        go_on: &(dyn Fn() -> bool + Sync),
    ) -> Result<Vec<(usize, Proposal)>, RunError> {
        let run = self;
        let all: Result<Vec<Vec<Proposal>>, RunError> = done
            .par_iter()
            .map(|one| {
                if !go_on() {
                    return Err(CalibrationError::Stopped.into());
                }
                let of = &run.observations.heliostats[one.index];
                let heliostat = &run.loaded.field.heliostats()[of.row];
                let mount = run.mount(of.row);
                let latest = one.sets.iter().rev().find(|set| set.is_fitted());
                let (parameters, so_far) = match latest {
                    Some(set) => (
                        Parameters::new(&set.mount_errors(), set.mirror_offset_m.0),
                        set.rows.iter().map(|&row| of.observations[row]).collect(),
                    ),
                    None => (
                        Parameters::new(&heliostat.errors, heliostat.mirror_offset_m),
                        Vec::new(),
                    ),
                };
                // Boards that face away are no use.
                let facing: Vec<Candidate> = asked
                    .candidates
                    .iter()
                    .filter(|candidate| {
                        let toward = mount.pivot - candidate.plane.centre;
                        candidate.plane.normal.as_enu().dot(toward) > 0.0
                    })
                    .copied()
                    .collect();
                let duty = Duty {
                    suns: &asked.suns,
                    aim: heliostat.aim,
                };
                let options = PlanOptions::default();
                let proposals = helio_calib::plan(
                    &mount,
                    &parameters,
                    &so_far,
                    &facing,
                    &duty,
                    asked.count,
                    &options,
                );
                Ok(proposals?)
            })
            .collect();
        Ok(done
            .iter()
            .zip(all?)
            .flat_map(|(one, proposals)| {
                let row = run.observations.heliostats[one.index].row;
                proposals.into_iter().map(move |p| (row, p))
            })
            .collect())
    }
}
