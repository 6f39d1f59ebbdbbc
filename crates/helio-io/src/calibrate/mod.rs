//! Calibrating a field heliostat by heliostat: from its files and observations to the rows of the calibration table.
//!
//! What the command line and the Python package share: [`FitWords`] are what a user asks for, [`Run`] calibrates the
//! heliostats one by one, in any order and on any thread, and makes their rows of the table.
//!
//! ```
//! use helio_io::calibrate::{Asked, FitWords};
//! let words = FitWords { solver: "newton".into(), ..FitWords::default() };
//! let refused = Asked::new(&words).unwrap_err().to_string();
//! assert_eq!(refused, "--solver: unknown word `newton`; known are hartley-meyer, gauss-newton");
//! ```

mod asked;
mod changes;
mod comparison;
mod day;
mod done;
pub mod joint;
mod proposals;
mod rejected;
mod residuals;
mod words;

use helio_calib::schedule::Sets;
use helio_calib::{CalibrationError, Context, Finding, Mount, Parameters};
use helio_core::Field;
use helio_core::error::FieldError;
use helio_core::sun::SunError;

pub use self::asked::{Asked, FitWords};
pub use self::changes::{CHANGES_TOLD, Changes, earlier, median};
pub use self::comparison::Change;
pub use self::day::without_sigmas;
use self::day::{Day, Weighed, fitted, weighed};
pub use self::done::{Choice, Done, DoneSet, Exact, Left};
pub use self::proposals::Proposals;
pub use self::rejected::{Rejected, write_rejected};
pub use self::residuals::{Residual, predicted_spots};
use self::words::Words;
use crate::IoError;
use crate::calibrated::CalibratedSet;
use crate::field::LoadedField;
use crate::observations::Observations;

/// Why a run cannot be done.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum RunError {
    /// A file; the message names it.
    #[error(transparent)]
    Io(#[from] IoError),
    /// What the library says.
    #[error(transparent)]
    Calibration(#[from] CalibrationError),
    /// No position of the sun can be computed.
    #[error(transparent)]
    Sun(#[from] SunError),
    /// Errors that no mount has.
    #[error(transparent)]
    Field(#[from] FieldError),
    /// What was asked for makes no sense; the whole sentence, which names options as the command line does.
    #[error("{0}")]
    Refused(String),
}

impl RunError {
    fn refused(message: impl Into<String>) -> Self {
        Self::Refused(message.into())
    }
}

/// Worth knowing where records that state no `sigma_m` stand beside a prior.
pub const PRIOR_WITHOUT_SIGMAS: &str = "--prior without sigma_m: how much records count beside it is told by what a fit \
                                        without it leaves";

/// The status of a set that tracking may use.
pub const OK: &str = "ok";

/// Lowest sun of an observation or of a pointing that counts \[rad\].
pub const LOWEST_SUN_RAD: f64 = 0.1745;

/// How far beyond the clock a record may be dated \[ns\]: a day, as clocks and offsets from UTC are set wrong. What is
/// dated later is better left aside: zero points would wander on to that day, and what is fitted would be taken to hold
/// from it.
pub const AHEAD_NS: i64 = 86_400_000_000_000;

/// Heliostats around one whose records may have got among its own.
const NEIGHBOURS: usize = 8;

/// The status of a heliostat whose records say something else than a prior.
const PRIOR_CONTRADICTED: &str = "prior_contradicted";

/// Everything that calibrating one heliostat after another needs.
#[derive(Debug, Clone, Copy)]
pub struct Run<'a> {
    /// The field.
    pub loaded: &'a LoadedField,
    /// Its observations.
    pub observations: &'a Observations,
    /// How to fit.
    pub asked: &'a Asked,
}

impl Run<'_> {
    /// Calibrates one of the heliostats with observations.
    ///
    /// # Errors
    /// [`RunError`] where the library refuses the options, or the observations are not those of their file.
    pub fn one(&self, index: usize) -> Result<Done, RunError> {
        let of = &self.observations.heliostats[index];
        let heliostat = &self.loaded.field.heliostats()[of.row];
        let mount = self.mount(of.row);
        let neighbours = neighbours(&self.loaded.field, of.row, NEIGHBOURS);
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
            asked: self.asked.sets(),
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
            if status == OK && self.asked.sets() != Sets::One && !epoch.borrowed {
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
        let rejected: Result<Vec<Left>, RunError> = found
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

    /// The mount of a row of the field.
    #[must_use]
    pub fn mount(&self, row: usize) -> Mount {
        let field = &self.loaded.field;
        Mount::of(field.mode(), &field.heliostats()[row])
    }

    /// The name of one of the heliostats with observations.
    #[must_use]
    pub fn id(&self, index: usize) -> &str {
        &self.loaded.field.ids()[self.observations.heliostats[index].row]
    }

    /// The rows of the table for a heliostat.
    #[must_use]
    pub fn sets(&self, done: &Done) -> Vec<CalibratedSet> {
        let of = &self.observations.heliostats[done.index];
        let id = self.id(done.index);
        let pose_errors = self.loaded.field.heliostats()[of.row].pose_errors;
        let used: usize = done.sets.iter().map(|set| set.rows.len()).sum();
        // Sets over the day share the records of the hours in which they blend.
        let rejected = of.observations.len().saturating_sub(used);
        let one = done.sets.len() == 1;
        done.sets
            .iter()
            .map(|set| {
                let times = || {
                    set.rows
                        .iter()
                        .filter_map(|&row| of.observations[row].unix_ns)
                };
                // A rejected record belongs to the stretch of time in which it was made.
                let inside = |row: usize| match of.observations[row].unix_ns {
                    Some(ns) => {
                        set.valid_from_ns.is_none_or(|from| from <= ns)
                            && set.valid_to_ns.is_none_or(|to| ns < to)
                    }
                    None => false,
                } && match (set.hours_rad, of.observations[row].hour_angle_rad) {
                    (Some([from, to]), Some(hour)) => {
                        from.is_none_or(|from| from.0 <= hour) && to.is_none_or(|to| hour < to.0)
                    }
                    _ => true,
                };
                CalibratedSet {
                    rejected: if one {
                        rejected
                    } else {
                        done.rejected.iter().filter(|left| inside(left.row)).count()
                    },
                    observed_ns: times().min().zip(times().max()),
                    ..set.to_table(id, pose_errors)
                }
            })
            .collect()
    }
}

/// Rows of the heliostats nearest to one.
///
/// # Panics
/// If `row` is not in the field.
#[must_use]
pub fn neighbours(field: &Field, row: usize, most: usize) -> Vec<usize> {
    let heliostats = field.heliostats();
    let here = heliostats[row].pivot;
    let mut others: Vec<(f64, usize)> = heliostats
        .iter()
        .enumerate()
        .filter(|(other, _)| *other != row)
        .map(|(other, heliostat)| ((heliostat.pivot - here).norm(), other))
        .collect();
    let nearer = |a: &(f64, usize), b: &(f64, usize)| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1));
    if others.len() > most {
        others.select_nth_unstable_by(most, nearer);
        others.truncate(most);
    }
    others.sort_by(nearer);
    others.into_iter().map(|(_, other)| other).collect()
}
