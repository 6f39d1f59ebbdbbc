//! One heliostat after another, in parallel.

use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Mutex, MutexGuard, PoisonError};

use helio_calib::schedule::Sets;
use helio_calib::{Context, Finding, Mount, Parameters};
use helio_io::Finished;
use rayon::prelude::*;

use super::day::{Day, Weighed, fitted, weighed};
use super::words::Words;
use super::{OK, Run};
use crate::calibration::{Done, DoneSet, Exact, Left};
use crate::commands::track::stop_on_signals;
use crate::failure::Failure;
use crate::plan;
use crate::printer::{Counted, Grouped, Printer};

/// Heliostats around one whose records may have got among its own.
const NEIGHBOURS: usize = 8;

/// The status of a heliostat whose records say something else than a prior.
const PRIOR_CONTRADICTED: &str = "prior_contradicted";

/// What threads share.
struct Shared {
    part: Option<Finished>,
    done: Vec<Done>,
    progress: crate::printer::Progress,
    failed: Option<Failure>,
}

fn held(shared: &Mutex<Shared>) -> MutexGuard<'_, Shared> {
    shared.lock().unwrap_or_else(PoisonError::into_inner)
}

impl Run<'_> {
    /// Calibrates every heliostat that is not finished, in parallel.
    pub(super) fn all(
        &self,
        part: Option<(Finished, Vec<String>)>,
        printer: &Printer,
    ) -> Result<(Vec<Done>, Option<Finished>), Failure> {
        let all = &self.observations.heliostats;
        let (part, lines) = part.map_or((None, Vec::new()), |(part, lines)| (Some(part), lines));
        let mut done: Vec<Done> = Vec::with_capacity(all.len());
        let mut is_done = vec![false; all.len()];
        for line in &lines {
            // The key is right and the checksum too: the line is one of ours.
            if let Some(one) = Done::from_line(line)
                && one.index < all.len()
                && !std::mem::replace(&mut is_done[one.index], true)
            {
                done.push(one);
            }
        }
        if !done.is_empty() {
            printer.say(format_args!(
                "resumed: {} of {} are finished",
                Grouped(done.len() as u64),
                Counted(all.len(), "heliostat")
            ));
        }
        let todo: Vec<usize> = (0..all.len()).filter(|&index| !is_done[index]).collect();
        let stop = stop_on_signals();
        let give_up = AtomicBool::new(false);
        let shared = Mutex::new(Shared {
            part,
            done,
            progress: printer.progress_of(todo.len() as u64, "heliostats"),
            failed: None,
        });
        todo.par_iter().with_max_len(1).for_each(|&index| {
            if stop.load(Ordering::Relaxed) || give_up.load(Ordering::Relaxed) {
                return;
            }
            let one = self.one(index);
            let mut shared = held(&shared);
            let kept = one.and_then(|one| {
                if let Some(part) = &mut shared.part {
                    part.add(&one.to_line())?;
                }
                shared.done.push(one);
                Ok(())
            });
            if let Err(failure) = kept {
                give_up.store(true, Ordering::Relaxed);
                shared.failed.get_or_insert(failure);
            }
            shared.progress.advance(1);
        });
        let Shared {
            part,
            mut done,
            progress,
            failed,
        } = shared.into_inner().unwrap_or_else(PoisonError::into_inner);
        progress.finish();
        if let Some(failure) = failed {
            return Err(failure);
        }
        if done.len() < all.len() {
            return Err(match part {
                Some(part) => Failure::Paused {
                    done: done.len(),
                    of: all.len(),
                    path: part.path().to_owned(),
                },
                None => Failure::Interrupted { streamed: false },
            });
        }
        // In the order of the field, whoever was first.
        done.sort_by_key(|one| one.index);
        Ok((done, part))
    }

    /// Calibrates one heliostat.
    pub(super) fn one(&self, index: usize) -> Result<Done, Failure> {
        let of = &self.observations.heliostats[index];
        let heliostat = &self.loaded.field.heliostats()[of.row];
        let mount = self.mount(of.row);
        let neighbours = plan::neighbours(&self.loaded.field, of.row, NEIGHBOURS);
        let mounts: Vec<Mount> = neighbours.iter().map(|&row| self.mount(row)).collect();
        let planes: Vec<_> = self.observations.targets.iter().map(|(_, p)| *p).collect();
        let context = Context {
            site_latitude_rad: self.loaded.site.as_ref().map(|site| site.latitude_rad),
            aim: Some(heliostat.aim),
            neighbours: &mounts,
            targets: &planes,
        };
        let field = Parameters::new(&heliostat.errors, heliostat.mirror_offset_m);
        let options = self.asked.of(&field);
        let Weighed {
            of,
            mut said,
            contradicted,
        } = weighed(of, &mount, &context, &options)?;
        if let Some(why) = contradicted {
            return Ok(Done {
                index,
                sets: vec![DoneSet::without_result(PRIOR_CONTRADICTED, &why)],
                rejected: Vec::new(),
                findings: Vec::new(),
                choices: Vec::new(),
            });
        }
        let of = of.as_ref();
        let found = helio_calib::calibrate(&mount, &of.observations, &context, &options)?;

        let words = Words {
            run: self,
            index,
            neighbours: &neighbours,
        };
        let refusing = found.findings.iter().find(|finding| {
            matches!(
                finding,
                Finding::TooFew { .. }
                    | Finding::AllAtOneTime { .. }
                    | Finding::WrongCall { .. }
                    | Finding::Unexplained { .. }
            )
        });
        if let Some(Finding::TooFew { .. }) = refusing {
            said = None; // nothing is fitted that it would be about
        }
        let several = found.epochs.len() > 1;
        let starts: Vec<Option<i64>> = found.epochs.iter().map(|e| e.from_unix_ns).collect();
        let dated = starts.iter().all(Option::is_some);
        let mut day = Day {
            mount: &mount,
            of,
            context: Context {
                neighbours: &[],
                targets: &[],
                ..context
            },
            options: &options,
            asked: self.asked.sets,
            sets: Vec::with_capacity(found.epochs.len().max(1)),
            choices: Vec::new(),
            said: Vec::from_iter(said),
        };
        for (k, epoch) in found.epochs.iter().enumerate() {
            let last = k + 1 == found.epochs.len();
            let (status, why) = match &epoch.verdict {
                _ if several && !dated && !last => (
                    "superseded",
                    "a later epoch follows, and without times nothing tells when".to_owned(),
                ),
                helio_calib::Verdict::Undetermined { why } => match refusing {
                    Some(finding) => (finding.as_str(), words.finding(finding)?),
                    None => ("undetermined", why.clone()),
                },
                helio_calib::Verdict::Determined if !epoch.fit.stop.converged() => (
                    "not_converged",
                    format!("the fit ended with {}", epoch.fit.stop.as_str()),
                ),
                helio_calib::Verdict::Determined => (OK, String::new()),
            };
            let name = if several {
                (k + 1).to_string()
            } else {
                String::new()
            };
            let whole = DoneSet {
                name,
                status: status.to_owned(),
                why,
                valid_from_ns: if k == 0 { None } else { starts[k] },
                valid_to_ns: if last { None } else { starts[k + 1] },
                year_pointing_mrad: Exact(epoch.year_pointing_mrad.unwrap_or(f64::NAN)),
                weakness: epoch.weakness.to_string(),
                rows: epoch.rows.clone(),
                ..fitted(&epoch.fit, &epoch.uncertainty)
            };
            // An epoch that borrows its tilts has too few records to be divided.
            if status == OK && self.asked.sets != Sets::One && !epoch.borrowed {
                day.divide(whole)?;
            } else {
                day.sets.push(whole);
            }
        }
        let Day {
            mut sets,
            choices,
            said,
            ..
        } = day;
        if sets.is_empty() {
            let (status, why) = match refusing.or(found.findings.first()) {
                Some(finding) => (finding.as_str(), words.finding(finding)?),
                None => ("undetermined", String::new()),
            };
            sets.push(DoneSet::without_result(status, &why));
        }
        let rejected: Result<Vec<Left>, Failure> = found
            .rejected
            .iter()
            .map(|rejected| {
                Ok(Left {
                    row: rejected.row,
                    beam_mrad: Exact(rejected.beam_mrad),
                    reason: rejected.reason.as_str().to_owned(),
                    words: words.reason(&rejected.reason)?,
                })
            })
            .collect();
        let findings = found.findings.iter().map(|finding| words.finding(finding));
        let findings: Result<Vec<String>, _> = findings.chain(said.into_iter().map(Ok)).collect();
        Ok(Done {
            index,
            sets,
            rejected: rejected?,
            findings: findings?,
            choices,
        })
    }
}
