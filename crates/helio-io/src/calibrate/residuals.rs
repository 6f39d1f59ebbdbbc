//! What is left of each record once its heliostat is calibrated.

use helio_calib::{Mount, Observation, Parameters, beam_errors_mrad, measures};

use super::{Done, OK, Run};

/// Where the beams of observations should land with some parameters \[m\], and how far off that is as angles \[mrad\].
#[must_use]
pub fn predicted_spots(
    mount: &Mount,
    seen: &[Observation],
    parameters: &Parameters,
) -> (Vec<[f64; 2]>, Vec<f64>) {
    let (residuals_m, _) = measures(mount, seen, parameters);
    let spots_m = residuals_m
        .iter()
        .zip(seen)
        .map(|(r, o)| [o.u_m + r[0], o.v_m + r[1]])
        .collect();
    (spots_m, beam_errors_mrad(mount, seen, parameters))
}

/// A record, and where its beam should have landed.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Residual {
    /// Which record of the table.
    pub record: usize,
    /// Row of its heliostat in the field.
    pub row: usize,
    /// Which of [`Observations::targets`](crate::Observations::targets).
    pub target: usize,
    /// When \[ns of Unix time\].
    pub unix_ns: Option<i64>,
    /// Spot seen: right and down of the target's centre \[m\].
    pub seen_m: [f64; 2],
    /// Spot with the calibrated errors; NaN for a record that no calibration that holds is fitted to.
    pub predicted_m: [f64; 2],
    /// Angle between both as seen from the mirror \[mrad\]; NaN likewise.
    pub beam_mrad: f64,
    /// Spot with the errors of the field before.
    pub before_m: [f64; 2],
    /// Angle to it \[mrad\].
    pub before_mrad: f64,
}

impl Run<'_> {
    /// Every record of a calibrated heliostat, in the order of the table. One in several sets is told by the first.
    #[must_use]
    pub fn residuals(&self, done: &Done) -> Vec<Residual> {
        let of = &self.observations.heliostats[done.index];
        let heliostat = &self.loaded.field.heliostats()[of.row];
        let mount = self.mount(of.row);
        let before = Parameters::new(&heliostat.errors, heliostat.mirror_offset_m);
        let (before_m, before_mrad) = predicted_spots(&mount, &of.observations, &before);
        let mut residuals: Vec<Residual> = of
            .observations
            .iter()
            .enumerate()
            .map(|(k, seen)| Residual {
                record: of.records[k],
                row: of.row,
                target: seen.target,
                unix_ns: seen.unix_ns,
                seen_m: [seen.u_m, seen.v_m],
                predicted_m: [f64::NAN; 2],
                beam_mrad: f64::NAN,
                before_m: before_m[k],
                before_mrad: before_mrad[k],
            })
            .collect();
        for set in done.sets.iter().rev().filter(|set| set.status == OK) {
            let parameters = Parameters::new(&set.mount_errors(), set.mirror_offset_m.0);
            let (spots_m, mrad) = predicted_spots(&mount, &of.observations, &parameters);
            for &k in &set.rows {
                residuals[k].predicted_m = spots_m[k];
                residuals[k].beam_mrad = mrad[k];
            }
        }
        residuals
    }
}
