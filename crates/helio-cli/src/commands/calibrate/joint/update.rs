//! `--update`: new records on top of a state.

use std::collections::{BTreeSet, HashMap};
use std::path::Path;

use helio_calib::joint::{DAY_NS, FieldState, JumpSeen, Known, StepKind};
use helio_calib::{Campaign, Observation, Parameter};
use helio_io::{
    KeptMount, Observations, StateFile, format_time, read_state, state_bytes, write_file,
};
use rayon::prelude::*;

use super::known::Seen;
use super::outputs::Found;
use super::{Asked, Judged, JumpFound, Run};
use crate::Outcome;
use crate::commands::calibrate::SAID;
use crate::failure::Failure;
use crate::printer::{Bytes, Counted, Grouped};

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

impl Run<'_> {
    pub(super) fn update(&self, path: &Path, asked: Asked) -> Result<Outcome, Failure> {
        let printer = self.printer;
        let (mut file, checksum) = read_state(path)?;
        let mut rows = file.rows(path, &self.loaded)?;
        let mut state =
            FieldState::from_parts(file.parts).map_err(|error| Self::unusable(path, error))?;
        let gone = rows.iter().filter(|row| row.is_none()).count();
        if gone > 0 {
            printer.warn(format_args!(
                "{}: not in the field: {} of it; what is known stays in the state and gets no row",
                path.display(),
                Counted(gone, "heliostat")
            ));
        }
        self.add_new(&mut state, &mut rows, &mut file.mounts);
        let (observations, hash) = self.observations()?;
        let mut provenance = self.provenance("joint-update", hash)?;
        provenance.options_hash = checksum;

        let fresh = self.fresh(path, &state, &rows, &mut file.targets, &observations)?;
        let before: Result<HashMap<usize, Before>, Failure> = fresh
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
        let steps = state.update(&campaigns)?;

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
            of_one.times = times().min().zip(times().max());
            let before = &before[&one.index];
            let mount = rows[one.place].map(|row| self.mount(row));
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
        let file = StateFile {
            parts,
            version: env!("CARGO_PKG_VERSION").to_owned(),
            targets: file.targets,
            site_longitude_rad: file.site_longitude_rad,
            mounts: file.mounts,
        };
        let found = Found {
            state: &state,
            rows: &rows,
            seen: &seen,
            causes: &state.causes(),
            worth: None,
            judged: &judged,
            zeros: None,
            observations: &observations,
            targets: &file.targets,
            provenance: &provenance,
            converged: true,
        };
        let place = self.args.joint.state.as_deref().unwrap_or(path);
        let (written, bytes) =
            rayon::join(|| self.write(asked, &found), || state_bytes(place, &file));
        let written = written?;
        // The state goes last: where anything failed, the same records can be given again.
        let bytes = bytes?;
        write_file(place, &bytes)?;
        let written_bytes = bytes.len() as u64;
        self.say_judged(&observations, &judged, &jumps);
        self.say_alarms(&state, &observations, &judged);
        printer.say(format_args!(
            "state of {}: {}",
            Counted(rows.len(), "heliostat"),
            Bytes(written_bytes)
        ));
        let times = seen.iter().filter_map(|one| one.times);
        let from_ns = times.map(|(first, _)| first).min().unwrap_or(i64::MAX);
        let from = (from_ns as f64 / DAY_NS).floor();
        let spells = state.spells();
        self.say_spells(&spells, from);
        // one that is over was learnt from no more than its rows say
        let off = spells.iter().any(|spell| spell.lasts);
        Ok(self.say_table(&written, off))
    }

    /// Adds the heliostats of the field that the state does not have.
    fn add_new(
        &self,
        state: &mut FieldState,
        rows: &mut Vec<Option<usize>>,
        mounts: &mut Vec<KeptMount>,
    ) {
        let field = &self.loaded.field;
        let mut has = vec![false; field.len()];
        for &row in rows.iter().flatten() {
            has[row] = true;
        }
        let new: Vec<usize> = (0..field.len()).filter(|&row| !has[row]).collect();
        for &row in &new {
            state.add(&field.ids()[row]);
            rows.push(Some(row));
            mounts.push(self.kept_mount(row));
        }
        if let Some(&first) = new.first() {
            self.printer.note(format_args!(
                "{} new to the state, of which only the field is known (first `{}`)",
                Counted(new.len(), "heliostat"),
                field.ids()[first]
            ));
        }
    }

    /// The records that the state has not taken in, by heliostat; targets that are new to it come after those it has.
    fn fresh(
        &self,
        path: &Path,
        state: &FieldState,
        rows: &[Option<usize>],
        targets: &mut Vec<(String, helio_core::TargetPlane)>,
        observations: &Observations,
    ) -> Result<Vec<Fresh>, Failure> {
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
        let late = self.too_late(observations, so)?;
        let mut seen_on = BTreeSet::new();
        let mut old = 0;
        let mut first_old = None;
        let mut fresh = Vec::new();
        for (index, of) in observations.heliostats.iter().enumerate() {
            let Some(&place) = place_of.get(&of.row) else {
                continue;
            };
            let last = state.heliostats()[place].last_day;
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
                if last.is_some_and(|last| day <= last) {
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
            self.printer.note(format_args!(
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
            if fresh.is_empty() && self.args.plan_date.is_none() {
                return Err(Failure::refused(format!(
                    "{words}, and none is newer: it seems to be taken in already; nothing was written"
                )));
            }
            self.printer.warn(format_args!(
                "{words}: left aside, as taken in already; records that came late are counted by a new --joint"
            ));
        }
        Ok(fresh)
    }

    fn say_alarms(&self, state: &FieldState, observations: &Observations, judged: &[Judged]) {
        let id = |index: usize| &self.loaded.field.ids()[observations.heliostats[index].row];
        // what each heliostat first raised one for
        let mut first: Vec<(usize, i64, [bool; 2])> = Vec::new();
        for one in judged {
            let Some(alarm) = one.alarm.filter(|alarm| *alarm != [false; 2]) else {
                continue;
            };
            if first.last().is_none_or(|last| last.0 != one.index) {
                let of = &observations.heliostats[one.index].observations;
                let unix_ns = of[one.observation].unix_ns.unwrap_or_default();
                first.push((one.index, unix_ns, alarm));
            }
        }
        for (index, unix_ns, [_, unbelieved]) in first.iter().take(SAID) {
            let why = match unbelieved {
                true => "its last three records in a row are not believed",
                false => "it misses to one side by more than what is known of it explains",
            };
            let (id, time) = (id(*index), format_time(*unix_ns));
            self.printer
                .say(format_args!("{id}: alarm at {time}: {why}"));
        }
        if first.len() > SAID {
            let more = first.len() - SAID;
            self.printer.say(format_args!(
                "... and {}; --steps shows all",
                Counted(more, "alarm")
            ));
        }
        let rate = state.alarm.false_alarm_rate;
        self.printer.say(format_args!(
            "alarms: {} of {}; of the records of heliostats without drift some {} % raise one",
            Grouped(first.len() as u64),
            Counted(observations.heliostats.len(), "heliostat"),
            100.0 * rate
        ));
    }
}

/// A day as nanoseconds since 1970, to the millisecond: as well as a day is known.
fn to_milliseconds(day: f64) -> i64 {
    (day * DAY_NS / 1e6).round() as i64 * 1_000_000
}
