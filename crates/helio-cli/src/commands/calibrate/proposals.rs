//! The next observations.

use helio_calib::plan::year_suns;
use helio_calib::{Candidate, Duty, Parameters, PlanOptions, Proposal};
use helio_core::EnuUnit;
use helio_core::angle::degrees;
use helio_io::LoadedField;
use helio_io::calibrate::{Done, Run};
use helio_io::output::{Cells, write_columns};
use rayon::prelude::*;

use super::LOWEST_SUN_RAD;
use crate::args::CalibrateArgs;
use crate::failure::Failure;
use crate::plan;
use crate::printer::{Bytes, Printer};

/// What is asked of the next observations.
pub(super) struct Proposals {
    pub count: usize,
    pub candidates: Vec<Candidate>,
    pub suns: Vec<EnuUnit>,
    /// Names of the targets that candidates count.
    pub targets: Vec<String>,
}

/// Time between the suns that are looked at for the next observations \[s\].
const PLAN_STEP_S: f64 = 600.0;

impl Proposals {
    pub(super) fn new(args: &CalibrateArgs, loaded: &LoadedField) -> Result<Option<Self>, Failure> {
        let (Some(count), Some(date)) = (args.plan, &args.plan_date) else {
            return Ok(None);
        };
        let Some(site) = &loaded.site else {
            return Err(Failure::refused(
                "--plan: there is no [site], which the suns of that day need",
            ));
        };
        let date: jiff::civil::Date = date.trim().parse().map_err(|_| {
            Failure::refused(format!(
                "--plan-date {date}: wanted a day, such as 2026-06-21"
            ))
        })?;
        let midnight = date
            .to_zoned(jiff::tz::TimeZone::UTC)
            .map_err(|error| Failure::refused(format!("--plan-date {date}: {error}")))?;
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
            return Err(Failure::refused(format!(
                "--plan-date {date}: the sun never stands 10 degrees high on that day"
            )));
        }
        Ok(Some(Self {
            count: usize::from(count),
            candidates,
            suns: year_suns(site.latitude_rad, LOWEST_SUN_RAD),
            targets,
        }))
    }

    /// Writes proposals, each with the row of its heliostat in the field; the number of bytes.
    pub(super) fn write(
        &self,
        rows: &[(usize, Proposal)],
        args: &CalibrateArgs,
        loaded: &LoadedField,
        printer: &Printer,
    ) -> Result<u64, Failure> {
        let format = plan::format(args.plan_out.as_deref(), None)?;
        let destination = plan::destination(args.plan_out.as_deref(), format, &[], printer)?;
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
        let bytes = write_columns(destination, format, &columns)?;
        printer.say(format_args!("proposed observations: {}", Bytes(bytes)));
        Ok(bytes)
    }
}

/// The proposed observations of every heliostat, with its row in the field.
pub(super) fn propose(
    run: &Run<'_>,
    asked: &Proposals,
    done: &[Done],
) -> Result<Vec<(usize, Proposal)>, Failure> {
    let all: Result<Vec<Vec<Proposal>>, Failure> = done
        .par_iter()
        .map(|one| {
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
