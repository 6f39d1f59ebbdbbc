//! `--update`: new records on top of a state.

use std::collections::{BTreeSet, HashMap};
use std::path::{Path, PathBuf};
use std::sync::OnceLock;

use helio_calib::joint::{DAY_NS, FieldState, JumpSeen, Known, StepKind};
use helio_calib::{Campaign, Observation, Parameter};
use helio_core::TargetPlane;
use rayon::prelude::*;

use super::known::Seen;
use super::{JointFound, JointRun, Judged, JumpFound, Remark, Say, kept_mount, mount, needs_site};
use crate::calibrate::RunError;
use crate::field::LoadedField;
use crate::state::{KeptMount, StateFile};
use crate::words::{Counted, Grouped};

/// New records of a heliostat.
struct Fresh {
    place: usize,
    /// Which of the heliostats with observations.
    index: usize,
    observations: Vec<Observation>,
    /// Which each is among all that the file has of the heliostat.
    of: Vec<usize>,
}

/// What was known of a heliostat before its new records.
struct Before {
    jumps: Vec<JumpSeen>,
    references_rad: [f64; 2],
    /// The same at rest.
    rest_rad: [f64; 2],
}

/// Both zero points \[rad\], their wandering included.
fn references(known: &Known) -> [f64; 2] {
    [Parameter::AzimuthReference, Parameter::ElevationReference].map(|p| known.values[p as usize])
}

/// A field that is followed, before new records: what a state knows, and which rows of a field its heliostats are.
#[derive(Debug)]
pub struct Following {
    path: PathBuf,
    checksum: String,
    state: FieldState,
    rows: Vec<Option<usize>>,
    targets: Vec<(String, TargetPlane)>,
    site_longitude_rad: f64,
    mounts: Vec<KeptMount>,
}

impl Following {
    /// Holds a state that was read (`path` is what messages call it) against a field, whose new heliostats it takes in.
    ///
    /// # Errors
    /// [`RunError`] where the state is none, or of another field.
    pub fn begin(
        path: &Path,
        (file, checksum): (StateFile, String),
        loaded: &LoadedField,
        say: Say<'_>,
    ) -> Result<Self, RunError> {
        needs_site(loaded)?;
        let rows = file.rows(path, loaded)?;
        let state = FieldState::from_parts(file.parts).map_err(|error| {
            RunError::refused(format!("{}: not a usable state: {error}", path.display()))
        })?;
        let gone = rows.iter().filter(|row| row.is_none()).count();
        if gone > 0 {
            say(Remark::Warning(format!(
                "{}: not in the field: {} of it; what is known stays in the state and gets no row",
                path.display(),
                Counted(gone, "heliostat")
            )));
        }
        let mut following = Self {
            path: path.to_owned(),
            checksum,
            state,
            rows,
            targets: file.targets,
            site_longitude_rad: file.site_longitude_rad,
            mounts: file.mounts,
        };
        following.add_new(loaded, say);
        Ok(following)
    }

    /// Checksum of the state that it began with.
    #[must_use]
    pub fn checksum(&self) -> &str {
        &self.checksum
    }

    /// Adds the heliostats of the field that the state does not have.
    fn add_new(&mut self, loaded: &LoadedField, say: Say<'_>) {
        let field = &loaded.field;
        let mut has = vec![false; field.len()];
        for &row in self.rows.iter().flatten() {
            has[row] = true;
        }
        let new: Vec<usize> = (0..field.len()).filter(|&row| !has[row]).collect();
        for &row in &new {
            self.state.add(&field.ids()[row]);
            self.rows.push(Some(row));
            self.mounts.push(kept_mount(loaded, row));
        }
        if let Some(&first) = new.first() {
            say(Remark::Note(format!(
                "{} new to the state, of which only the field is known (first `{}`)",
                Counted(new.len(), "heliostat"),
                field.ids()[first]
            )));
        }
    }
}

impl<'a> JointRun<'a> {
    /// Takes new records into a state; `none_will_do` where it makes sense without any. The observations were
    /// [looked at](Self::check_times).
    ///
    /// # Errors
    /// [`RunError`] where no record is new, for observations that are not those of their file, and where it is stopped.
    pub fn update(
        &self,
        following: Following,
        none_will_do: bool,
    ) -> Result<JointFound<'a>, RunError> {
        let Following {
            path,
            mut state,
            rows,
            mut targets,
            site_longitude_rad,
            mounts,
            ..
        } = following;
        let known = (&state, &rows[..]);
        let fresh = self.fresh(&path, known, &mut targets, none_will_do)?;
        let before: Result<HashMap<usize, Before>, RunError> = fresh
            .par_iter()
            .map(|one| {
                let followed = &state.heliostats()[one.place];
                let known = state.known(one.place, followed.last_day.unwrap_or_default())?;
                let references_rad = references(&known);
                let before = Before {
                    jumps: followed.jumps.clone(),
                    references_rad,
                    rest_rad: std::array::from_fn(|axis| {
                        references_rad[axis] - known.zero_rad[axis]
                    }),
                };
                Ok((one.index, before))
            })
            .collect();
        let before = before?;
        let campaigns: Vec<(usize, Campaign<'_>)> = fresh
            .iter()
            .filter_map(|one| {
                let campaign = Campaign {
                    mount: self.mount(rows[one.place]?),
                    observations: &one.observations,
                };
                Some((one.place, campaign))
            })
            .collect();
        let steps = state.update_watched(&campaigns, self.watch)?;

        let parts = state.parts();
        let mut seen = vec![Seen::default(); rows.len()];
        let mut judged = Vec::new();
        let mut jumps = Vec::new();
        for (one, steps) in fresh.iter().zip(&steps) {
            let of_one = &mut seen[one.place];
            let times = || one.observations.iter().filter_map(|o| o.unix_ns);
            let after = &parts.heliostats[one.place];
            // of the record itself where it is one of these: days are rounded
            let of_run = |day: f64| times().find(|&ns| ns as f64 / DAY_NS == day);
            of_one.times_ns = times().min().zip(times().max());
            let before = &before[&one.index];
            let mount = rows[one.place].map(|row| mount(self.loaded, row));
            for step in steps {
                if let (StepKind::Believed, Some(mount)) = (step.kind, &mount) {
                    of_one.add(&step.foretold, mount, &one.observations[step.observation]);
                }
                judged.push(Judged {
                    index: one.index,
                    observation: one.of[step.observation],
                    foretold: step.foretold,
                    kind: step.kind,
                    zero_rad: std::array::from_fn(|axis| {
                        step.references_rad[axis] - before.rest_rad[axis]
                    }),
                    zero_sigma_rad: step.references_sigma_rad,
                    jumped: match step.kind {
                        StepKind::Jump(axes) => axes,
                        _ => [false; 2],
                    },
                    in_doubt: one.observations[step.observation]
                        .unix_ns
                        .is_some_and(|ns| after.undecided.contains(&(ns as f64 / DAY_NS))),
                    alarm: Some([step.alarm, step.unbelieved]),
                });
            }
            let certain = after
                .jumps
                .iter()
                .filter(|jump| !before.jumps.contains(jump));
            let doubted = after.accounts[0]
                .jumps
                .iter()
                .map(|&(k, axis)| (after.undecided[k], axis, false));
            // those of earlier runs that are still in doubt were said then
            let doubted = doubted.filter(|(day, ..)| of_run(*day).is_some());
            let certain = certain.map(|j| (j.day, j.axis, true));
            let found: Vec<(f64, usize, bool)> = certain.chain(doubted).collect();
            if found.is_empty() {
                continue;
            }
            let last = state.known(one.place, after.last_day.unwrap_or_default())?;
            for (day, axis, certain) in found {
                jumps.push(JumpFound {
                    index: one.index,
                    unix_ns: of_run(day).or(Some(to_milliseconds(day))),
                    axis,
                    // of an earlier run's record the zero points before it are no longer known
                    size_rad: of_run(day)
                        .map(|_| references(&last)[axis] - before.references_rad[axis]),
                    missed_mrad: None,
                    certain,
                });
            }
        }
        let spells = state.spells();
        let file = StateFile {
            parts,
            version: env!("CARGO_PKG_VERSION").to_owned(),
            targets: targets.clone(),
            site_longitude_rad,
            mounts,
        };
        Ok(JointFound {
            causes: state.causes(),
            state,
            rows,
            seen,
            worth: None,
            judged,
            jumps,
            // one that is over was learnt from no more than its rows say
            off: spells.iter().any(|spell| spell.lasts),
            spells,
            targets,
            fit: None,
            site_longitude_rad,
            mounts: Vec::new(), // in the file
            file: OnceLock::from(file),
        })
    }

    /// The records that the state has not taken in, by heliostat; targets that are new to it come after those it has.
    fn fresh(
        &self,
        path: &Path,
        (state, rows): (&FieldState, &[Option<usize>]),
        targets: &mut Vec<(String, TargetPlane)>,
        none_will_do: bool,
    ) -> Result<Vec<Fresh>, RunError> {
        let observations = self.observations;
        let place_of: HashMap<usize, usize> = rows
            .iter()
            .enumerate()
            .filter_map(|(place, row)| Some(((*row)?, place)))
            .collect();
        // Causes count the targets of the state, observations those of the field now.
        let mut target_of: Vec<Option<usize>> = observations
            .targets
            .iter()
            .map(|(name, _)| targets.iter().position(|(known, _)| known == name))
            .collect();
        let so = "left aside; if that is right, give them in a table of their own";
        let late = self.too_late(so)?;
        let mut seen_on = BTreeSet::new();
        let mut old = 0;
        let mut first_old = None;
        let mut fresh = Vec::new();
        for (index, of) in observations.heliostats.iter().enumerate() {
            let Some(&place) = place_of.get(&of.row) else {
                continue;
            };
            let followed = &state.heliostats()[place];
            let mut one = Fresh {
                place,
                index,
                observations: Vec::with_capacity(of.observations.len()),
                of: Vec::with_capacity(of.observations.len()),
            };
            for (k, observation) in of.observations.iter().enumerate() {
                let day = observation.unix_ns.unwrap_or_default() as f64 / DAY_NS;
                if day > late {
                    continue;
                }
                if followed.has_taken(day) {
                    old += 1;
                    first_old.get_or_insert((of.records[k], of.row));
                    continue;
                }
                let target = *target_of[observation.target].get_or_insert_with(|| {
                    targets.push(observations.targets[observation.target].clone());
                    targets.len() - 1
                });
                seen_on.insert(target);
                one.observations.push(Observation {
                    target,
                    ..*observation
                });
                one.of.push(k);
            }
            if !one.of.is_empty() {
                fresh.push(one);
            }
        }
        for target in state.causes().iter().filter_map(|c| c.cause.target()) {
            seen_on.remove(&target);
        }
        for target in seen_on {
            self.note(format!(
                "target `{}` is new to the state: how its spots are shifted is learnt from here on",
                targets[target].0
            ));
        }
        if let Some((record, row)) = first_old {
            let words = format!(
                "{}: {} at or before the last record of their heliostat in {} (first {}, heliostat `{}`)",
                observations.path.display(),
                match old {
                    1 => "1 record is".to_owned(),
                    old => format!("{} records are", Grouped(old as u64)),
                },
                path.display(),
                observations.position(record)?,
                self.loaded.field.ids()[row]
            );
            // what to see next can be asked of a state at any time
            if fresh.is_empty() && !none_will_do {
                return Err(RunError::refused(format!(
                    "{words}, and none is newer: it seems to be taken in already; nothing was written"
                )));
            }
            self.warn(format!(
                "{words}: left aside, as taken in already; records that came late are counted by a new --joint"
            ));
        }
        Ok(fresh)
    }
}

/// A day as nanoseconds since 1970, to the millisecond: as well as a day is known.
fn to_milliseconds(day: f64) -> i64 {
    (day * DAY_NS / 1e6).round() as i64 * 1_000_000
}
