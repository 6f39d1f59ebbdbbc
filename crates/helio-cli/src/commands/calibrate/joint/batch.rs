//! `--joint`: all records of a field at once.

use helio_calib::Campaign;
use helio_calib::joint::{
    FieldState, History, JointFit, JointOptions, JumpSeen, StepKind, fit_joint,
};
use helio_io::output::{Destination, Format};
use helio_io::{KeptMount, Observations, StateFile, write_calibration, write_state};
use rayon::prelude::*;

use super::known::Seen;
use super::{Judged, JumpFound, Run};
use crate::Outcome;
use crate::failure::Failure;
use crate::printer::{Bytes, Counted};

/// Jumps that a state remembers of a heliostat.
const JUMPS_KEPT: usize = 16;

impl Run<'_> {
    pub(super) fn fit(&self, destination: Destination, format: Format) -> Result<Outcome, Failure> {
        let (observations, hash) = self.observations()?;
        let provenance = self.provenance("joint", hash)?;
        let campaigns: Vec<Campaign<'_>> = observations
            .heliostats
            .iter()
            .map(|of| Campaign {
                mount: self.mount(of.row),
                observations: &of.observations,
            })
            .collect();
        let fit = fit_joint(&campaigns, &JointOptions::new(self.latitude_rad()))?;
        let histories: Vec<Vec<History>> = campaigns
            .par_iter()
            .enumerate()
            .map(|(k, campaign)| fit.history(k, campaign))
            .collect();
        let (judged, jumps, mut seen) = told(&histories, &observations);
        let (state, rows) = self.followed(&fit, &observations, &jumps)?;
        seen.resize(rows.len(), Seen::default());
        let day = self.day(&state)?;
        let sets = self.sets(&state, &rows, &seen, &day);

        let joint = &self.args.joint;
        if let Some(path) = &joint.causes {
            self.write_causes(path, &fit.causes, &observations)?;
        }
        if let Some(path) = &joint.steps {
            self.write_steps(path, &judged, &observations)?;
        }
        let bytes = write_calibration(destination, format, &sets, &provenance)?;
        if let Some(path) = &joint.state {
            let file = StateFile {
                parts: state.parts(),
                targets: observations.targets.clone(),
                mounts: rows
                    .iter()
                    .flatten()
                    .map(|&row| KeptMount::of(&self.mount(row)))
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
        self.say_fit(&fit, &observations);
        self.say_judged(&observations, &judged, &jumps);
        Ok(self.say_table(&sets, bytes))
    }

    /// The state after the fit, with every heliostat of the field: first those with observations.
    fn followed(
        &self,
        fit: &JointFit,
        observations: &Observations,
        jumps: &[JumpFound],
    ) -> Result<(FieldState, Vec<Option<usize>>), Failure> {
        let field = &self.loaded.field;
        let mut rows: Vec<usize> = observations.heliostats.iter().map(|of| of.row).collect();
        let ids: Vec<String> = rows.iter().map(|&row| field.ids()[row].clone()).collect();
        let mut parts = fit.follow(&ids)?.parts();
        for jump in jumps {
            parts.heliostats[jump.index].jumps.push(JumpSeen {
                day: jump.unix_ns.unwrap_or_default() as f64 / super::DAY_NS,
                axis: jump.axis,
            });
        }
        for heliostat in &mut parts.heliostats {
            let surplus = heliostat.jumps.len().saturating_sub(JUMPS_KEPT);
            heliostat.jumps.drain(..surplus);
        }
        let mut state = FieldState::from_parts(parts)?;
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
}

/// What became of every record.
fn told(
    histories: &[Vec<History>],
    observations: &Observations,
) -> (Vec<Judged>, Vec<JumpFound>, Vec<Seen>) {
    let mut judged = Vec::new();
    let mut jumps = Vec::new();
    let mut seen = Vec::with_capacity(histories.len());
    for (index, history) in histories.iter().enumerate() {
        let mut of_one = Seen::default();
        for (record, one) in history.iter().enumerate() {
            let observed = &observations.heliostats[index].observations[one.observation];
            let unix_ns = observed.unix_ns;
            let jumped = one.jumped.iter().position(|jumped| *jumped);
            let kind = if one.outlier {
                StepKind::Outlier
            } else if let Some(axis) = jumped {
                StepKind::Jump(axis)
            } else if one.foretold.beam_mrad().is_finite() {
                // the first are foretold of a heliostat that nobody knows yet
                if record >= history.len() / 2 {
                    of_one.add(one.foretold.beam_mrad());
                }
                StepKind::Believed
            } else {
                StepKind::Misses
            };
            if let Some(axis) = jumped {
                jumps.push(JumpFound {
                    index,
                    unix_ns,
                    axis,
                    size_rad: None,
                    missed_mrad: Some(one.foretold.beam_mrad()),
                    certain: true,
                });
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
                alarm: None,
            });
        }
        seen.push(of_one);
    }
    (judged, jumps, seen)
}
