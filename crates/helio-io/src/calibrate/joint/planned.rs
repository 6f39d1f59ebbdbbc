//! The next observations of a field that is known as one.

use helio_calib::joint::DAY_NS;
use helio_calib::{Candidate, Duty, PlanOptions, Proposal};
use rayon::prelude::*;

use super::{JointFound, JointRun};
use crate::calibrate::{Proposals, RunError};
use crate::times::format_time;

impl JointRun<'_> {
    /// The next observations of every heliostat of the field, with its row.
    ///
    /// # Errors
    /// [`RunError`] where it is stopped.
    pub fn propose(
        &self,
        asked: &Proposals,
        found: &JointFound<'_>,
    ) -> Result<Vec<(usize, Proposal)>, RunError> {
        let last_ns = (found.state.last_day().unwrap_or(f64::MIN) * DAY_NS) as i64;
        if asked.candidates.iter().all(|c| c.unix_ns < last_ns) {
            self.warn(format!(
                "--plan-date {}: the records go on until {}; zero points are taken as they are then",
                asked.date,
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
        let places = found.places();
        let min_gap_s = PlanOptions::default().min_gap_s;
        let all: Result<Vec<Vec<Proposal>>, RunError> = places
            .par_iter()
            .map(|&(row, place)| {
                self.go_on()?;
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
