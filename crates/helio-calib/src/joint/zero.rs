//! Zero points over time, from all records of a heliostat.

use faer::prelude::Solve;
use faer::{Mat, Side};

use super::JointFit;
use super::belief::{REFERENCES, Rates, at, column};
use super::rows::MILLI;
use crate::error::{CalibrationError, in_place};
use crate::field::Campaign;

/// Records that zero points are found from at most, evenly chosen: time goes with the cube of their number.
const MOST: usize = 200;

/// Zero points of a heliostat at one of its records.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ZeroPoint {
    /// Which observation.
    pub observation: usize,
    /// When \[days since 1970\].
    pub day: f64,
    /// References of either axis then, less those at rest after all records \[rad\]: wander, and jumps as steps.
    pub zero_rad: [f64; 2],
    /// One standard deviation of that \[rad\].
    pub sigma_rad: [f64; 2],
}

/// What is expected of the zero points of an axis before any record.
struct Expected<'a> {
    rates: &'a Rates,
    axis: usize,
    days: &'a [f64],
    /// Records before which it jumped.
    jumps: Vec<usize>,
    jump_mrad: f64,
}

impl Expected<'_> {
    /// Covariance at two records \[mrad²\]: wander, and the jumps after both, which lie between them and the end.
    fn covariance(&self, i: usize, j: usize) -> f64 {
        let apart = (self.days[i] - self.days[j]).abs();
        let wander: f64 = [self.axis, self.axis + 2]
            .into_iter()
            .map(|k| self.rates.wander[k] * libm::exp(-apart / self.rates.days[k]))
            .sum();
        let after = self.jumps.iter().filter(|&&jump| jump > i.max(j)).count();
        wander + after as f64 * self.jump_mrad * self.jump_mrad
    }
}

impl JointFit {
    /// Zero points of heliostat `k` at each record of the campaign that was fitted, in time, as all of its believed
    /// records tell them (where there are very many: 200 of them, evenly chosen), what is common taken as found.
    /// Nothing where a number is not finite.
    ///
    /// [`history`](Self::history) knows at each record only those before it, and so shows how angles are learnt
    /// rather than how zero points move.
    ///
    /// # Errors
    /// [`CalibrationError::NoSuchHeliostat`] if there is no heliostat `k`.
    pub fn zero_points(
        &self,
        k: usize,
        campaign: &Campaign<'_>,
    ) -> Result<Option<Vec<ZeroPoint>>, CalibrationError> {
        in_place(&self.heliostats, "k", k)?;
        Ok(self.smoothed(k, campaign))
    }

    fn smoothed(&self, k: usize, campaign: &Campaign<'_>) -> Option<Vec<ZeroPoint>> {
        let shape = self.structure.shape();
        let still = shape.still;
        let (rows, marks) = self.marked(k, campaign);
        let rates = self.hyper.rates();
        let rest = shape.row() - column::REST;
        let expected = [0, 1].map(|axis| Expected {
            rates: &rates,
            axis,
            days: &rows.days,
            jumps: marks
                .jumps
                .iter()
                .filter_map(|&(record, of)| (of == axis).then_some(record))
                .collect(),
            jump_mrad: self.mishaps.jump_mrad,
        });
        // outliers are marked as telling nothing
        let believed: Vec<usize> = (0..rows.len())
            .filter(|&r| rows.row(shape, r)[rest + column::SILENT] == 0.0)
            .collect();
        let count = believed.len().min(MOST);
        let told: Vec<&[f64]> = (0..count)
            .map(|n| rows.row(shape, believed[n * believed.len() / count]))
            .collect();
        let which: Vec<usize> = (0..count)
            .map(|n| believed[n * believed.len() / count])
            .collect();
        // components two by two: what is left beside the field's means and the common causes
        let left = Mat::from_fn(2 * count, 1, |n, _| {
            let (row, c) = (told[n / 2], n % 2);
            let mut left = row[rest + column::SEEN + c];
            for (i, mean) in self.common.mean.iter().enumerate() {
                left -= row[2 * i + c] * mean;
            }
            left
        });
        // spread through the slopes: P Hᵀ
        let pulled: Vec<[f64; 2]> = told
            .iter()
            .flat_map(|row| {
                (0..still).map(move |i| {
                    let mut sum = [0.0; 2];
                    for j in 0..still {
                        let p = self.hyper.spread[at(i.max(j), i.min(j))];
                        sum = [sum[0] + p * row[2 * j], sum[1] + p * row[2 * j + 1]];
                    }
                    sum
                })
            })
            .collect();
        let of_reference = |row: &[f64], axis: usize, c: usize| row[2 * REFERENCES[axis] + c];
        let matrix = Mat::from_fn(2 * count, 2 * count, |m, n| {
            let (m, n) = (m.max(n), m.min(n));
            let (one, other) = (told[m / 2], told[n / 2]);
            let (c, d) = (m % 2, n % 2);
            let mut sum: f64 = (0..still)
                .map(|i| one[2 * i + c] * pulled[n / 2 * still + i][d])
                .sum();
            for (axis, expected) in expected.iter().enumerate() {
                let both = of_reference(one, axis, c) * of_reference(other, axis, d);
                sum += both * expected.covariance(which[m / 2], which[n / 2]);
            }
            if m / 2 == n / 2 {
                sum += rates.sun * one[rest + column::PATH + c] * one[rest + column::PATH + d];
            }
            if m == n {
                sum += rates.beam
                    + rates.spot * one[rest + column::ON_TARGET]
                    + one[rest + column::STATED];
            }
            sum
        });
        let factor = matrix.llt(Side::Lower).ok()?;
        let solved = factor.solve(&left);
        let shared = Mat::from_fn(2 * count, 2 * rows.len(), |n, wanted| {
            let (record, axis) = (wanted / 2, wanted % 2);
            let expected = expected[axis].covariance(record, which[n / 2]);
            of_reference(told[n / 2], axis, n % 2) * expected
        });
        let explained = factor.solve(&shared);
        let zeros: Vec<ZeroPoint> = (0..rows.len())
            .map(|record| {
                let of = |axis: usize, by: &dyn Fn(usize) -> f64| -> f64 {
                    let column = 2 * record + axis;
                    (0..2 * count).map(|n| shared[(n, column)] * by(n)).sum()
                };
                ZeroPoint {
                    observation: rows.of[record],
                    day: rows.days[record],
                    zero_rad: [0, 1].map(|axis| of(axis, &|n| solved[(n, 0)]) / MILLI),
                    sigma_rad: [0, 1].map(|axis| {
                        let known = of(axis, &|n| explained[(n, 2 * record + axis)]);
                        let left = expected[axis].covariance(record, record) - known;
                        libm::sqrt(left.max(0.0)) / MILLI
                    }),
                }
            })
            .collect();
        let finite = |zero: &ZeroPoint| {
            zero.zero_rad
                .iter()
                .chain(&zero.sigma_rad)
                .all(|x| x.is_finite())
        };
        zeros.iter().all(finite).then_some(zeros)
    }
}

#[cfg(test)]
mod tests {
    use super::super::simulate::{FieldOptions, simulate_field};
    use super::super::{JointOptions, fit_joint};

    /// Known wander and jumps: found within their stated uncertainty, and far better than record by record.
    #[test]
    fn true_zero_points_are_found_within_their_uncertainty() {
        let options = FieldOptions {
            heliostats: 40,
            jump_probability: 0.01,
            jump_rad: 5e-3,
            outlier_probability: 0.01,
            ..FieldOptions::new(31).unwrap()
        };
        let field = simulate_field(&options).unwrap();
        let campaigns = field.first(options.records);
        let how = JointOptions {
            axis_causes: Vec::new(),
            spot_causes: Vec::new(),
            ..JointOptions::new(options.site.latitude_rad())
        };
        let fit = fit_joint(&campaigns, &how).unwrap();
        let mut jumps = 0;
        let (mut squares, mut sigmas, mut misses, mut learnt, mut count) =
            (0.0, 0.0, 0.0, 0.0, 0.0);
        for (k, campaign) in campaigns.iter().enumerate() {
            let truth = &field.heliostats[k].truth;
            let last = truth[options.records - 1];
            // Where jumps were missed or misdated the truth is another model.
            let mut found: Vec<(usize, usize)> = fit.heliostats[k]
                .jumps
                .iter()
                .map(|(at, jump)| (*at, jump.axis))
                .collect();
            found.sort_unstable();
            let happened: Vec<(usize, usize)> = truth[..options.records]
                .iter()
                .enumerate()
                .filter_map(|(record, t)| Some((record, t.jump?)))
                .collect();
            if found != happened {
                continue;
            }
            jumps += happened.len();
            let history = fit.history(k, campaign).unwrap();
            let zeros = fit.zero_points(k, campaign).unwrap().unwrap();
            assert_eq!(zeros.len(), options.records);
            for (zero, then) in zeros.iter().zip(&history) {
                assert_eq!(zero.observation, then.observation);
                let t = &truth[zero.observation];
                for axis in 0..2 {
                    let wander = t.wandering_rad[axis] + t.wandering_rad[axis + 2];
                    let jumped = t.jumped_rad[axis] - last.jumped_rad[axis];
                    let off = zero.zero_rad[axis] - wander - jumped;
                    squares += (off / zero.sigma_rad[axis]).powi(2);
                    sigmas += zero.sigma_rad[axis].powi(2);
                    misses += off * off;
                    learnt += (then.zero_rad[axis] - wander - jumped).powi(2);
                    count += 1.0;
                }
            }
        }
        let rms = |sum: f64| (sum / count).sqrt();
        println!(
            "{count} zero points, {jumps} jumps: off by {:.3} mrad, stated {:.3} (in those units {:.3}); record by record {:.3}",
            1e3 * rms(misses),
            1e3 * rms(sigmas),
            rms(squares),
            1e3 * rms(learnt)
        );
        assert!(count > 1000.0 && jumps > 5);
        assert!((0.8..1.25).contains(&rms(squares)), "{}", rms(squares));
        assert!(rms(misses) < 0.5 * rms(learnt));
    }
}
