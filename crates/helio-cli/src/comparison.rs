//! What a calibration changed against an earlier one.

use helio_calib::{Mount, Parameter, Parameters, pointing_sigma_mrad};
use helio_core::angle::wrap_pi;
use helio_core::{Enu, EnuUnit};
use helio_io::CalibratedSet;

/// What changed between two sets of one heliostat.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Change {
    /// RMS over suns of how far apart the beams are that both sets predict \[mrad\].
    pub(crate) beam_mrad: f64,
    /// Chi-square of the difference against both covariances and its degrees of freedom.
    pub(crate) chi_square: Option<(f64, usize)>,
}

/// Chi-square that chance exceeds in one of twenty, by degrees of freedom 1 to 7.
const BY_CHANCE: [f64; 7] = [3.841, 5.991, 7.815, 9.488, 11.070, 12.592, 14.067];

impl Change {
    /// True if chance would hardly make such a difference; `None` where no covariance tells.
    pub(crate) fn is_significant(&self) -> Option<bool> {
        let (chi_square, freedom) = self.chi_square?;
        Some(chi_square > *BY_CHANCE.get(freedom.checked_sub(1)?)?)
    }

    /// The difference of two sets with errors, as seen over some suns by a heliostat that aims somewhere.
    pub(crate) fn between(
        old: &CalibratedSet,
        new: &CalibratedSet,
        mount: &Mount,
        suns: &[EnuUnit],
        aim: Enu,
    ) -> Option<Self> {
        let of = |set: &CalibratedSet| {
            let offset_m = set.mirror_offset_m.unwrap_or(mount.mirror_offset_m);
            Some(Parameters::new(set.errors.as_ref()?, offset_m))
        };
        let (before, after) = (of(old)?, of(new)?);
        let mut step = [0.0; 7];
        for (k, value) in step.iter_mut().enumerate() {
            *value = after.values[k] - before.values[k];
            let reference = [Parameter::AzimuthReference, Parameter::ElevationReference];
            if reference.iter().any(|&p| p as usize == k) {
                *value = wrap_pi(*value);
            }
        }
        // What moves the beams by a known step is the uncertainty of rank one that it would be.
        let outer = step.map(|a| step.map(|b| a * b));
        let squares: Vec<f64> = suns
            .iter()
            .filter_map(|&sun| pointing_sigma_mrad(mount, &after, &outer, sun, aim))
            .map(|mrad| mrad * mrad)
            .collect();
        let spread = |set: &CalibratedSet| set.covariance.unwrap_or([[0.0; 7]; 7]);
        let (one, other) = (spread(old), spread(new));
        let sum = std::array::from_fn(|a| std::array::from_fn(|b| one[a][b] + other[a][b]));
        Some(Self {
            beam_mrad: (squares.iter().sum::<f64>() / squares.len() as f64).sqrt(),
            chi_square: chi_square(&step, &sum),
        })
    }
}

/// δᵀ C⁺ δ over the parameters that have a variance, by Cholesky with pivoting of the correlation matrix;
/// directions in which C knows nothing count nothing.
fn chi_square(step: &[f64; 7], covariance: &[[f64; 7]; 7]) -> Option<(f64, usize)> {
    let known: Vec<usize> = (0..7).filter(|&k| covariance[k][k] > 0.0).collect();
    let n = known.len();
    let scale: Vec<f64> = known.iter().map(|&k| covariance[k][k].sqrt()).collect();
    let mut rest: Vec<Vec<f64>> = (0..n)
        .map(|a| {
            (0..n)
                .map(|b| covariance[known[a]][known[b]] / (scale[a] * scale[b]))
                .collect()
        })
        .collect();
    let mut left: Vec<f64> = (0..n).map(|a| step[known[a]] / scale[a]).collect();
    let mut open: Vec<usize> = (0..n).collect();
    let (mut sum, mut rank) = (0.0, 0);
    while let Some(place) =
        (0..open.len()).max_by(|&a, &b| rest[open[a]][open[a]].total_cmp(&rest[open[b]][open[b]]))
    {
        let pivot = open.swap_remove(place);
        let variance = rest[pivot][pivot];
        if variance < 1e-9 {
            break;
        }
        // What this parameter says, and what it leaves for the others to say.
        sum += left[pivot] * left[pivot] / variance;
        rank += 1;
        for &a in &open {
            let share = rest[a][pivot] / variance;
            left[a] -= share * left[pivot];
            for &b in &open {
                let less = share * rest[pivot][b];
                rest[a][b] -= less;
            }
        }
    }
    (rank > 0).then_some((sum, rank))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn chi_square_is_the_quadratic_form() {
        // diag(1, 4) and a rotation of it by 30 degrees: known by hand.
        let mut covariance = [[0.0; 7]; 7];
        (covariance[0][0], covariance[1][1]) = (1.0, 4.0);
        let mut step = [0.0; 7];
        (step[0], step[1]) = (2.0, 2.0);
        let (sum, freedom) = chi_square(&step, &covariance).unwrap();
        assert!((sum - 5.0).abs() < 1e-14 && freedom == 2);
        let (sin, cos) = 30.0_f64.to_radians().sin_cos();
        covariance[0][0] = cos * cos + 4.0 * sin * sin;
        covariance[1][1] = sin * sin + 4.0 * cos * cos;
        covariance[0][1] = -3.0 * sin * cos;
        covariance[1][0] = covariance[0][1];
        (step[0], step[1]) = (2.0 * cos - 2.0 * sin, 2.0 * sin + 2.0 * cos);
        // Rotating both leaves the form as it was; the off-diagonal sign follows the rotation.
        let (sum, _) = chi_square(&step, &covariance).unwrap();
        assert!((sum - 5.0).abs() < 1e-12, "{sum}");
    }

    #[test]
    fn directions_without_variance_say_nothing() {
        let mut covariance = [[0.0; 7]; 7];
        assert!(chi_square(&[1.0; 7], &covariance).is_none());
        // Fully correlated: one degree of freedom.
        for row in &mut covariance[..2] {
            row[..2].fill(1.0);
        }
        let (sum, freedom) = chi_square(&[3.0, 3.0, 9.0, 0.0, 0.0, 0.0, 0.0], &covariance).unwrap();
        assert!((sum - 9.0).abs() < 1e-12 && freedom == 1);
    }
}
