//! What a calibration changed of one heliostat against an earlier one.

use helio_calib::aiming::encoder_angles_rad;
use helio_calib::model::{Pose, normal};
use helio_calib::{Mount, Observation, Parameter, Parameters, Sighting, pointing_sigma_mrad};
use helio_core::angle::wrap_pi;
use helio_core::error::FieldError;
use helio_core::{EnuUnit, Heliostat, PoseErrors, TargetPlane};

use crate::calibrated::CalibratedSet;
use crate::field::CalibrationSchedule;

/// What changed between two calibrations of one heliostat.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Change {
    /// RMS over suns of how far apart the beams are that both calibrations predict \[mrad\].
    pub beam_mrad: f64,
    /// Chi-square of the difference against both covariances and its degrees of freedom, of the two
    /// sets that differ most surely among those that hold at the same hours.
    pub chi_square: Option<(f64, usize)>,
    /// True if some of those stand on other pose errors, of which no covariance tells; there is then no chi-square.
    pub other_pose_errors: bool,
    /// How many pairs of sets hold at the same hours.
    pub pairs: usize,
}

/// Chi-square that chance exceeds in one case of twenty, by degrees of freedom 1 to 7: of one pair of sets, and the
/// greatest of 2 to 8 pairs (Bonferroni).
#[rustfmt::skip]
const BY_CHANCE: [[f64; 7]; 8] = [
    [3.841, 5.991, 7.815, 9.488, 11.070, 12.592, 14.067],
    [5.024, 7.378, 9.348, 11.143, 12.833, 14.449, 16.013],
    [5.731, 8.189, 10.236, 12.094, 13.839, 15.506, 17.115],
    [6.239, 8.764, 10.861, 12.762, 14.544, 16.245, 17.885],
    [6.635, 9.210, 11.345, 13.277, 15.086, 16.812, 18.475],
    [6.960, 9.575, 11.739, 13.695, 15.527, 17.272, 18.954],
    [7.237, 9.883, 12.071, 14.048, 15.898, 17.659, 19.356],
    [7.477, 10.150, 12.359, 14.353, 16.217, 17.993, 19.702],
];

impl Change {
    /// True if chance would hardly make such a difference; `None` where no covariance tells.
    #[must_use]
    pub fn is_significant(&self) -> Option<bool> {
        let (chi_square, freedom) = self.chi_square?;
        Some(chi_square > by_chance(self.pairs, freedom)?)
    }

    /// What the axes are told at some suns (each with its hour angle \[rad\]) by the latest sets of two
    /// calibrations of a heliostat. Nothing where either has no errors.
    pub(super) fn between(
        old: &[&CalibratedSet],
        new: &[&CalibratedSet],
        heliostat: &Heliostat,
        mount: &Mount,
        suns: &[(EnuUnit, f64)],
        blend_rad: f64,
    ) -> Result<Option<Self>, FieldError> {
        let known = |sets: &[&CalibratedSet]| sets.iter().any(|set| set.errors.is_some());
        if !(known(old) && known(new)) {
            return Ok(None);
        }
        let sets = [old.to_vec(), new.to_vec()];
        let schedule = CalibrationSchedule::of_sets(vec![*heliostat; 2], &sets, blend_rad);
        let mut squares = Vec::with_capacity(suns.len());
        let mut pairs: Vec<[&str; 2]> = Vec::new();
        for &(sun, hour_rad) in suns {
            let of = |row| schedule.heliostat_at(row, None, hour_rad);
            let told = [of(0)?, of(1)?];
            let [before, after] =
                told.map(|told| Parameters::new(&told.errors, told.mirror_offset_m));
            let mount = Mount {
                pose_errors: told[1].pose_errors,
                ..*mount
            };
            let mut step = step(&before, &after);
            if told[0].pose_errors != told[1].pose_errors {
                let further = further_turned(told, &mount, &after, sun);
                // further turned is less reference
                step[Parameter::AzimuthReference as usize] -= further[0];
                step[Parameter::ElevationReference as usize] -= further[1];
            }
            // What moves the beams by a known step is the uncertainty of rank one that it would be.
            let outer = step.map(|a| step.map(|b| a * b));
            if let Some(mrad) = pointing_sigma_mrad(&mount, &after, &outer, sun, heliostat.aim) {
                squares.push(mrad * mrad);
            }
            let holding = |row| schedule.set_at(row, None, hour_rad);
            if let (Some(one), Some(other)) = (holding(0)?, holding(1)?) {
                // Mostly those of the sun before, by the same names in memory.
                let is_last = |[before, after]: &[&str; 2]| {
                    std::ptr::eq(*before, one) && std::ptr::eq(*after, other)
                };
                if !pairs.last().is_some_and(is_last) && !pairs.contains(&[one, other]) {
                    pairs.push([one, other]);
                }
            }
        }
        let surely = |(chi_square, freedom): (f64, usize)| {
            chi_square / by_chance(pairs.len(), freedom).unwrap_or(f64::INFINITY)
        };
        let together: Vec<_> = pairs
            .iter()
            .filter_map(|[one, other]| {
                Some((named(old, one, heliostat)?, named(new, other, heliostat)?))
            })
            .collect();
        let other_pose_errors = together
            .iter()
            .any(|(before, after)| before.pose_errors != after.pose_errors);
        let chi_square = together
            .iter()
            .filter(|_| !other_pose_errors)
            .filter_map(|(before, after)| {
                let (one, other) = (&before.covariance, &after.covariance);
                let sum = std::array::from_fn(|a| std::array::from_fn(|b| one[a][b] + other[a][b]));
                chi_square(&step(&before.parameters, &after.parameters), &sum)
            })
            .max_by(|&a, &b| surely(a).total_cmp(&surely(b)));
        Ok(Some(Self {
            beam_mrad: (squares.iter().sum::<f64>() / squares.len() as f64).sqrt(),
            chi_square,
            other_pose_errors,
            pairs: pairs.len(),
        }))
    }
}

fn by_chance(pairs: usize, freedom: usize) -> Option<f64> {
    let row = &BY_CHANCE[pairs.clamp(1, BY_CHANCE.len()) - 1];
    row.get(freedom.checked_sub(1)?).copied()
}

/// How much further either axis turns by the second's pose errors than by the first's \[rad\], where the second
/// sends the sun to the aim: to the first order, as a step of the parameters is. Zero where it cannot.
fn further_turned(
    told: [Heliostat; 2],
    mount: &Mount,
    parameters: &Parameters,
    sun: EnuUnit,
) -> [f64; 2] {
    let aim = told[1].aim;
    let Some([axis1, axis2]) = encoder_angles_rad(mount, parameters, sun, aim) else {
        return [0.0; 2];
    };
    // only its angles count
    let seen = Observation::new(sun, axis1, axis2, TargetPlane::level(aim, sun), 0.0, 0.0);
    let turns = normal(&Pose::of(parameters), &Sighting::new(mount, &seen)).turns;
    let [before, after] = told.map(|told| told.pose_errors.to_array());
    let by: [f64; 3] = std::array::from_fn(|k| turns[k] * (after[k] - before[k]));
    [by[0], by[1] + by[2]]
}

/// What a set says of one heliostat.
struct Named {
    parameters: Parameters,
    /// Zero where it has none.
    covariance: [[f64; 7]; 7],
    pose_errors: PoseErrors,
}

fn named(sets: &[&CalibratedSet], name: &str, heliostat: &Heliostat) -> Option<Named> {
    let set = sets
        .iter()
        .find(|set| set.set == name && set.errors.is_some())?;
    let offset_m = set.mirror_offset_m.unwrap_or(heliostat.mirror_offset_m);
    Some(Named {
        parameters: Parameters::new(set.errors.as_ref()?, offset_m),
        covariance: set.covariance.unwrap_or([[0.0; 7]; 7]),
        pose_errors: set.pose_errors(heliostat.pose_errors),
    })
}

/// From some parameters to others, the references the short way round.
fn step(before: &Parameters, after: &Parameters) -> [f64; 7] {
    let references = [Parameter::AzimuthReference, Parameter::ElevationReference];
    std::array::from_fn(|k| {
        let step = after.values[k] - before.values[k];
        if references.iter().any(|&reference| reference as usize == k) {
            wrap_pi(step)
        } else {
            step
        }
    })
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
