//! How much a record counts (robust losses by iteratively reweighted least squares).

use crate::fit::Loss;

/// Huber's constant: 95 % efficiency for errors that are normal.
const HUBER: f64 = 1.345;
/// Median of the length of a vector with two standard normal components: sqrt(2 ln 2).
const RAYLEIGH_MEDIAN: f64 = 1.177_410_022_515_474_7;

impl Loss {
    /// Weight, 0 to 1, of a record whose spot lies `distance` scales from where it was predicted.
    ///
    /// ```
    /// use helio_calib::Loss;
    /// assert_eq!(Loss::Huber.weight(1.0), 1.0);
    /// assert_eq!(Loss::Huber.weight(2.69), 0.5);
    /// assert_eq!(Loss::Cauchy.weight(3.0), Loss::StudentT { degrees: 1.0 }.weight(3.0));
    /// ```
    #[must_use]
    pub fn weight(self, distance: f64) -> f64 {
        match self {
            Self::Squares => 1.0,
            Self::Huber => {
                if distance <= HUBER {
                    1.0
                } else {
                    HUBER / distance
                }
            }
            Self::StudentT { degrees } => 1.0 / (1.0 + distance * distance / degrees),
            Self::Cauchy => 1.0 / (1.0 + distance * distance),
        }
    }

    /// Mean slope of a component of weight(|z|) z over both directions: w + |z| w'/2.
    pub(crate) fn mean_slope(self, distance: f64) -> f64 {
        let weight = self.weight(distance);
        let square = distance * distance;
        match self {
            Self::Squares => 1.0,
            Self::Huber if distance <= HUBER => 1.0,
            Self::Huber => 0.5 * weight,
            Self::StudentT { degrees } => weight - square / degrees * weight * weight,
            Self::Cauchy => weight - square * weight * weight,
        }
    }
}

/// The middle value; NaN of nothing.
pub(crate) fn median(mut values: Vec<f64>) -> f64 {
    let [below, above] = middle(&mut values);
    0.5 * (below + above)
}

/// The two values about the middle, which are one where their number is odd; NaN of nothing.
pub(crate) fn middle(values: &mut [f64]) -> [f64; 2] {
    if values.is_empty() {
        return [f64::NAN; 2];
    }
    let half = values.len() / 2;
    let odd = values.len() % 2 == 1;
    let (before, &mut above, _) = values.select_nth_unstable_by(half, f64::total_cmp);
    let below = before.iter().copied().max_by(f64::total_cmp);
    [below.filter(|_| !odd).unwrap_or(above), above]
}

/// One standard deviation per component from the median of the records' distances: up to half of the
/// records may be anything. `free` parameters have been fitted to both components of every record.
/// Zero for no records.
pub(crate) fn robust_scale(distances: &[f64], free: usize) -> f64 {
    let known: Vec<f64> = distances.iter().copied().filter(|d| !d.is_nan()).collect();
    if known.is_empty() {
        return 0.0;
    }
    let rows = 2.0 * known.len() as f64;
    let left = (rows - free as f64).max(1.0);
    median(known) / RAYLEIGH_MEDIAN * libm::sqrt(rows / left)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_mean_slope_is_the_slope_of_the_weighted_residual() {
        let losses = [
            Loss::Squares,
            Loss::Huber,
            Loss::StudentT { degrees: 4.0 },
            Loss::Cauchy,
        ];
        for loss in losses {
            for z in [0.3, 1.2, 1.5, 4.0] {
                let step = 1e-6;
                let value = |z: f64| loss.weight(z) * z;
                let radial = (value(z + step) - value(z - step)) / (2.0 * step);
                let mean = 0.5 * (radial + loss.weight(z));
                assert!(
                    (mean - loss.mean_slope(z)).abs() < 1e-9,
                    "{loss:?} at {z}: {mean} {}",
                    loss.mean_slope(z)
                );
            }
        }
    }

    #[test]
    fn the_scale_of_a_rayleigh_sample_is_its_sigma() {
        // quantiles of a Rayleigh distribution with sigma 3
        let sample: Vec<f64> = (0..1001)
            .map(|i| 3.0 * (-2.0 * (1.0 - (f64::from(i) + 0.5) / 1001.0).ln()).sqrt())
            .collect();
        assert!((robust_scale(&sample, 0) - 3.0).abs() < 0.01);
        assert_eq!(robust_scale(&[f64::NAN], 0), 0.0);
        // four wild records of nine change it little
        let wild = [1.0, 1.1, 0.9, 1.05, 1.2, 1e3, 1e4, 1e5, 1e6];
        assert!(robust_scale(&wild, 0) < 1.1);
    }
}
