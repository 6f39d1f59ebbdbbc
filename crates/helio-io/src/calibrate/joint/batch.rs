//! `--joint`: all records of a field at once.

use std::sync::OnceLock;

use helio_calib::Campaign;
use helio_calib::joint::{
    FieldState, History, JointFit, JointOptions, LeftoverOptions, Leftovers, StepKind,
    fit_joint_watched,
};
use rayon::prelude::*;

use super::known::Seen;
use super::{
    Day, JUMPS_SIZED, JointFound, JointRun, Judged, JumpFound, kept_mount, mount, needs_site,
};
use crate::calibrate::RunError;
use crate::observations::Observations;

/// Rows of a field, the state's heliostats in its order.
type Rows = Vec<Option<usize>>;

impl<'a> JointRun<'a> {
    /// Fits the field as one. The observations were [looked at](Self::check_times).
    ///
    /// # Errors
    /// [`RunError`] without a site, for observations that are not those of their file, and where it is stopped.
    pub fn fit(&self) -> Result<JointFound<'a>, RunError> {
        needs_site(self.loaded)?;
        let observations = self.observations;
        let so = "if their times are wrong, so is what is taken from them";
        self.too_late(so)?;
        let campaigns: Vec<Campaign<'a>> = observations
            .heliostats
            .iter()
            .map(|of| Campaign {
                mount: self.mount(of.row),
                observations: &of.observations,
            })
            .collect();
        let mut options = JointOptions::new(self.latitude_rad());
        if self.asked.keep_all {
            options.mishaps.outlier = 0.0;
        }
        if self.asked.no_jumps {
            options.mishaps.jump = 0.0;
        }
        let fit = fit_joint_watched(&campaigns, &options, self.watch)?;
        let worth = fit.worth(&campaigns)?;
        self.go_on()?;
        let histories: Result<Vec<Vec<History>>, RunError> = campaigns
            .par_iter()
            .enumerate()
            .map(|(k, campaign)| {
                self.go_on()?;
                Ok(fit.history(k, campaign)?)
            })
            .collect();
        let histories = histories?;
        let (mut state, rows) = self.followed(&fit, observations)?;
        let (judged, jumps, mut seen) = self.told(&histories, observations, &state);
        let jumps: Result<Vec<JumpFound>, RunError> = jumps
            .into_iter()
            .enumerate()
            .map(|(n, (observation, jump))| {
                if n >= JUMPS_SIZED {
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
        let site = self.loaded.site.as_ref();
        Ok(JointFound {
            mounts: rows
                .iter()
                .flatten()
                .map(|&row| kept_mount(self.loaded, row))
                .collect(),
            state,
            rows,
            seen,
            causes: fit.causes.clone(),
            worth: Some(worth),
            judged,
            jumps,
            off: !spells.is_empty(),
            spells,
            targets: observations.targets.clone(),
            fit: Some((fit, campaigns)),
            site_longitude_rad: site.map_or(0.0, |s| s.longitude_rad),
            file: OnceLock::new(),
        })
    }

    /// What is left of the misses by pose, on a day; none where the field was followed.
    ///
    /// # Errors
    /// [`RunError`] where it is stopped.
    pub fn leftovers(
        &self,
        found: &JointFound<'_>,
        day: &Day,
    ) -> Result<Option<(LeftoverOptions, Leftovers)>, RunError> {
        let Some((fit, campaigns)) = &found.fit else {
            return Ok(None);
        };
        let options = LeftoverOptions {
            day: Some(day.day),
            ..LeftoverOptions::default()
        };
        let leftovers = fit.leftovers_watched(campaigns, &options, &|_, _| (self.watch)(0, 0))?;
        Ok(Some((options, leftovers)))
    }

    /// The state after the fit, with every heliostat of the field: first those with observations.
    fn followed(
        &self,
        fit: &JointFit,
        observations: &Observations,
    ) -> Result<(FieldState, Rows), RunError> {
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
            let mount = mount(self.loaded, of.row);
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
                    let (first, last) = of_one.times_ns.unwrap_or((ns, ns));
                    of_one.times_ns = Some((first.min(ns), last.max(ns)));
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
