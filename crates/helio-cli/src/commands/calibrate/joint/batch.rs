//! `--joint`: all records of a field at once.

use helio_calib::Campaign;
use helio_calib::joint::{FieldState, History, JointFit, JointOptions, StepKind, fit_joint};
use helio_io::{Observations, StateFile, write_state};
use rayon::prelude::*;

use super::known::Seen;
use super::outputs::Found;
use super::{Asked, Judged, JumpFound, Run, SAID};
use crate::Outcome;
use crate::failure::Failure;
use crate::printer::{Bytes, Counted};

impl Run<'_> {
    pub(super) fn fit(&self, asked: Asked) -> Result<Outcome, Failure> {
        let (observations, hash) = self.observations()?;
        let provenance = self.provenance("joint", hash)?;
        let so = "if their times are wrong, so is what is taken from them";
        self.too_late(&observations, so)?;
        let campaigns: Vec<Campaign<'_>> = observations
            .heliostats
            .iter()
            .map(|of| Campaign {
                mount: self.mount(of.row),
                observations: &of.observations,
            })
            .collect();
        let mut options = JointOptions::new(self.latitude_rad());
        if self.args.fit.keep_all {
            options.mishaps.outlier = 0.0;
        }
        if self.args.fit.no_jumps {
            options.mishaps.jump = 0.0;
        }
        let fit = fit_joint(&campaigns, &options)?;
        let worth = fit.worth(&campaigns)?;
        let histories: Result<Vec<Vec<History>>, _> = campaigns
            .par_iter()
            .enumerate()
            .map(|(k, campaign)| fit.history(k, campaign))
            .collect();
        let histories = histories?;
        let (mut state, rows) = self.followed(&fit, &observations)?;
        let (judged, jumps, mut seen) = self.told(&histories, &observations, &state);
        let jumps: Result<Vec<JumpFound>, Failure> = jumps
            .into_iter()
            .enumerate()
            .map(|(n, (observation, jump))| {
                if n >= SAID {
                    return Ok(jump);
                }
                let zeros = fit.zero_points(jump.index, &campaigns[jump.index])?;
                let size_rad = zeros.and_then(|zeros| {
                    let after = zeros.iter().position(|z| z.observation == observation)?;
                    let before = zeros.get(after.checked_sub(1)?)?;
                    Some(zeros[after].zero_rad[jump.axis] - before.zero_rad[jump.axis])
                });
                Ok(JumpFound { size_rad, ..jump })
            })
            .collect();
        let jumps = jumps?;
        state.look_back(&histories);
        let spells = state.spells();
        for (of_one, history) in seen.iter_mut().zip(&histories) {
            let off = |one: &&History| spells.iter().any(|spell| spell.holds(one.day));
            of_one.off = [history.iter().filter(off).count(), history.len()];
        }
        seen.resize(rows.len(), Seen::default());
        let found = Found {
            state: &state,
            rows: &rows,
            seen: &seen,
            causes: &fit.causes,
            worth: Some(&worth),
            judged: &judged,
            zeros: Some(&|k| fit.zero_points(k, &campaigns[k])),
            observations: &observations,
            targets: &observations.targets,
            provenance: &provenance,
            converged: fit.converged,
        };
        let left = match &self.args.joint.leftovers {
            Some(path) => Some((path, self.left(&fit, &campaigns, &self.day(&state)?)?)),
            None => None,
        };
        let written = self.write(asked, &found)?;
        if let Some((path, left)) = &left {
            self.write_left(path, left, &observations)?;
        }
        if let Some(path) = &self.args.joint.state {
            let file = StateFile {
                parts: state.parts(),
                targets: observations.targets.clone(),
                site_longitude_rad: self.loaded.site.as_ref().map_or(0.0, |s| s.longitude_rad),
                mounts: rows
                    .iter()
                    .flatten()
                    .map(|&row| self.kept_mount(row))
                    .collect(),
                version: env!("CARGO_PKG_VERSION").to_owned(),
            };
            let bytes = write_state(path, &file)?;
            self.printer.say(format_args!(
                "state of {}: {}",
                Counted(rows.len(), "heliostat"),
                Bytes(bytes)
            ));
        }
        self.say_fit(&fit, &worth, &observations.targets);
        self.say_judged(&observations, &judged, &jumps);
        let off = self.say_spells(&spells, f64::NEG_INFINITY);
        if off {
            self.printer
                .note(format_args!("what was found rests on these records too: mend them or leave them out, and fit again"));
        }
        Ok(self.say_table(&written, off))
    }

    /// The state after the fit, with every heliostat of the field: first those with observations.
    fn followed(
        &self,
        fit: &JointFit,
        observations: &Observations,
    ) -> Result<(FieldState, Vec<Option<usize>>), Failure> {
        let field = &self.loaded.field;
        let mut rows: Vec<usize> = observations.heliostats.iter().map(|of| of.row).collect();
        let ids: Vec<String> = rows.iter().map(|&row| field.ids()[row].clone()).collect();
        let mut state = fit.follow(&ids)?;
        let mut has = vec![false; field.len()];
        for &row in &rows {
            has[row] = true;
        }
        for row in (0..field.len()).filter(|&row| !has[row]) {
            state.add(&field.ids()[row]);
            rows.push(row);
        }
        Ok((state, rows.into_iter().map(Some).collect()))
    }

    /// What became of every record; jumps each with its observation.
    fn told(
        &self,
        histories: &[Vec<History>],
        observations: &Observations,
        state: &FieldState,
    ) -> (Vec<Judged>, Vec<(usize, JumpFound)>, Vec<Seen>) {
        let mut judged = Vec::new();
        let mut jumps = Vec::new();
        let mut seen = Vec::with_capacity(histories.len());
        for (index, history) in histories.iter().enumerate() {
            let of = &observations.heliostats[index];
            let mount = self.mount(of.row);
            let mut of_one = Seen::default();
            let undecided = &state.heliostats()[index].undecided;
            for (record, one) in history.iter().enumerate() {
                let observed = &of.observations[one.observation];
                let unix_ns = observed.unix_ns;
                let in_doubt = undecided.contains(&one.day);
                let kind = if one.outlier {
                    StepKind::Outlier
                } else if one.jumped != [false; 2] {
                    StepKind::Jump(one.jumped)
                } else if one.foretold.beam_mrad().is_finite() {
                    // the first are foretold of a heliostat that nobody knows yet
                    if record >= history.len() / 2 {
                        of_one.add(&one.foretold, &mount, observed);
                    }
                    StepKind::Believed
                } else {
                    StepKind::Misses
                };
                for axis in (0..2).filter(|&axis| one.jumped[axis]) {
                    let jump = JumpFound {
                        index,
                        unix_ns,
                        axis,
                        size_rad: None,
                        missed_mrad: Some(one.foretold.beam_mrad()),
                        certain: !in_doubt,
                    };
                    jumps.push((one.observation, jump));
                }
                if let Some(ns) = unix_ns {
                    let (first, last) = of_one.times.unwrap_or((ns, ns));
                    of_one.times = Some((first.min(ns), last.max(ns)));
                }
                judged.push(Judged {
                    index,
                    observation: one.observation,
                    foretold: one.foretold,
                    kind,
                    zero_rad: one.zero_rad,
                    zero_sigma_rad: one.zero_sigma_rad,
                    jumped: one.jumped,
                    in_doubt,
                    alarm: None,
                });
            }
            seen.push(of_one);
        }
        (judged, jumps, seen)
    }
}
