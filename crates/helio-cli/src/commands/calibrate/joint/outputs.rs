//! What both ways write: tables, proposals, the page.

use helio_calib::joint::{CommonCause, DAY_NS, FieldState, StepKind, Worth, ZeroPoint};
use helio_calib::{CalibrationError, Candidate, Duty, PlanOptions, Proposal};
use helio_core::TargetPlane;
use helio_io::calibrate::{Rejected, write_rejected};
use helio_io::{CalibratedSet, Observations, Provenance, format_time, write_calibration};
use helio_report::joint::joint_page;
use rayon::prelude::*;

use super::known::Seen;
use super::page::Source;
use super::said::STOPPED;
use super::{Asked, Judged, Run};
use crate::commands::calibrate::changes::changes;
use crate::commands::calibrate::proposals::Proposals;
use crate::commands::calibrate::write_page;
use crate::failure::Failure;
use crate::plan;

/// See [`Found::zeros`].
pub(super) type Zeros<'a> =
    dyn Fn(usize) -> Result<Option<Vec<ZeroPoint>>, CalibrationError> + Sync + 'a;

/// What a run found.
pub(super) struct Found<'a> {
    pub(super) state: &'a FieldState,
    /// Rows of the state's heliostats in the field.
    pub(super) rows: &'a [Option<usize>],
    pub(super) seen: &'a [Seen],
    pub(super) causes: &'a [CommonCause],
    pub(super) worth: Option<&'a [Worth]>,
    pub(super) judged: &'a [Judged],
    /// Zero points of one of the heliostats with observations as all records tell them, where they do.
    pub(super) zeros: Option<&'a Zeros<'a>>,
    pub(super) observations: &'a Observations,
    /// The targets that causes count.
    pub(super) targets: &'a [(String, TargetPlane)],
    pub(super) provenance: &'a Provenance,
    /// Whether the search of the fit ended where no step promised more.
    pub(super) converged: bool,
}

/// What was written.
pub(super) struct Written {
    pub sets: Vec<CalibratedSet>,
    pub changes: Vec<String>,
    pub bytes: u64,
}

impl Run<'_> {
    /// Writes everything but the state, the calibration last.
    pub(super) fn write(&self, asked: Asked, found: &Found<'_>) -> Result<Written, Failure> {
        let (args, observations) = (self.args, found.observations);
        let day = self.day(found.state)?;
        let sets = self.sets(found.state, found.rows, found.seen, &day)?;
        let changes = match &asked.old {
            Some(old) => changes(&self.loaded, observations, old, &sets)?,
            None => Vec::new(),
        };
        if let Some(file) = asked.report {
            let stopped = (!found.converged).then(|| STOPPED.to_owned());
            let page = Source {
                loaded: &self.loaded,
                found,
                findings: stopped.into_iter().chain(changes.clone()).collect(),
            };
            write_page(file, &joint_page(&page.page()?))?;
        }
        if let Some(path) = &args.joint.causes {
            self.write_causes(path, found.causes, found.worth, found.targets)?;
        }
        if let Some(path) = &args.joint.steps {
            self.write_steps(path, found.judged, observations)?;
        }
        if let Some(path) = &args.rejected {
            let rows = rejected(found.judged, observations);
            let format = plan::format(Some(path), None)?;
            let destination = plan::destination(Some(path), format, &[], self.printer)?;
            write_rejected(destination, format, rows, &self.loaded, observations)?;
        }
        let proposals = asked.proposals.as_ref();
        if let Some(proposals) = proposals {
            let rows = self.propose(proposals, found)?;
            proposals.write(&rows, args, &self.loaded, self.printer)?;
        }
        // Proposals take the place of the calibration where both would go to standard output.
        let bytes = if proposals.is_some() && args.plan_out.is_none() && args.out.out.is_none() {
            0
        } else {
            write_calibration(asked.destination, asked.format, &sets, found.provenance)?
        };
        Ok(Written {
            sets,
            changes,
            bytes,
        })
    }

    /// The next observations of every heliostat of the field, with its row.
    fn propose(
        &self,
        asked: &Proposals,
        found: &Found<'_>,
    ) -> Result<Vec<(usize, Proposal)>, Failure> {
        let last_ns = (found.state.last_day().unwrap_or(f64::MIN) * DAY_NS) as i64;
        if asked.candidates.iter().all(|c| c.unix_ns < last_ns) {
            self.printer.warn(format_args!(
                "--plan-date {}: the records go on until {}; zero points are taken as they are then",
                self.args.plan_date.as_deref().unwrap_or_default(),
                format_time(last_ns)
            ));
        }
        // Causes count the targets of the state, candidates those of the field; new ones have no causes.
        let of_state: Vec<usize> = asked
            .targets
            .iter()
            .enumerate()
            .map(|(new, name)| {
                let known = found.targets.iter().position(|(known, _)| known == name);
                known.unwrap_or(found.targets.len() + new)
            })
            .collect();
        let in_state: Vec<Candidate> = asked
            .candidates
            .iter()
            .map(|candidate| Candidate {
                target: of_state[candidate.target],
                ..*candidate
            })
            .collect();
        let mut places: Vec<(usize, usize)> = found
            .rows
            .iter()
            .enumerate()
            .filter_map(|(place, row)| Some(((*row)?, place)))
            .collect();
        places.sort_unstable();
        let min_gap_s = PlanOptions::default().min_gap_s;
        let all: Result<Vec<Vec<Proposal>>, Failure> = places
            .par_iter()
            .map(|&(row, place)| {
                let duty = Duty {
                    suns: &asked.suns,
                    aim: self.loaded.field.heliostats()[row].aim,
                };
                let mount = self.mount(row);
                let next =
                    found
                        .state
                        .plan(place, &mount, &in_state, &duty, asked.count, min_gap_s)?;
                let in_field = |p: Proposal| {
                    let target = of_state.iter().position(|&target| target == p.target)?;
                    Some(Proposal { target, ..p })
                };
                Ok(next.into_iter().filter_map(in_field).collect())
            })
            .collect();
        Ok(places
            .iter()
            .zip(all?)
            .flat_map(|(&(row, _), next)| next.into_iter().map(move |p| (row, p)))
            .collect())
    }
}

/// Records that were not believed, or whose beam should not have met the target.
fn rejected(judged: &[Judged], observations: &Observations) -> Vec<Rejected> {
    let words = |one: &Judged| match one.kind {
        StepKind::Outlier => Some(format!(
            "its spot lies {:.1} mrad from where it was expected to {:.1} mrad, and no jump of a zero point explains it \
             better",
            one.foretold.beam_mrad(),
            one.foretold.expected_mrad()
        )),
        StepKind::Misses => Some("its beam should not meet the target".to_owned()),
        _ => None,
    };
    judged
        .iter()
        .filter_map(|one| {
            let of = &observations.heliostats[one.index];
            Some(Rejected {
                record: of.records[one.observation],
                row: of.row,
                beam_mrad: one.foretold.beam_mrad(),
                reason: one.kind.as_str().to_owned(),
                why: words(one)?,
            })
        })
        .collect()
}
