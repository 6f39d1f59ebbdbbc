//! A smooth function of the pose by its values at a few poses.

/// Poses are added until what the rest leave unknown of the function at every one, in parts of its variance, is
/// less than this.
const LEFT_UNKNOWN: f64 = 1e-3;

/// The function's correlation at two poses [axis 1, axis 2] \[rad\]: squared exponential in the chord of either
/// angle, the same after every full turn.
///
/// MacKay 1998, Introduction to Gaussian processes, eq. (47), for two angles.
fn correlation(length_rad: f64, a: [f64; 2], b: [f64; 2]) -> f64 {
    let half = |k: usize| libm::sin(0.5 * (a[k] - b[k]));
    let (first, second) = (half(0), half(1));
    libm::exp(-2.0 * (first * first + second * second) / (length_rad * length_rad))
}

/// Poses that stand for all that were seen. The function is φ(pose)·w, w of as many independent standard normal
/// numbers, and what the poses leave unknown of it.
#[derive(Debug, Clone, PartialEq, Default)]
pub(super) struct Seen {
    length_rad: f64,
    /// \[rad\].
    pub poses: Vec<[f64; 2]>,
    /// Lower triangle of the Cholesky factor of their correlations.
    root: Vec<f64>,
}

impl Seen {
    /// The poses themselves, in their order.
    pub fn new(length_rad: f64, poses: impl IntoIterator<Item = [f64; 2]>) -> Self {
        let mut seen = Self {
            length_rad,
            ..Self::default()
        };
        for pose in poses {
            seen.add(pose);
        }
        seen
    }

    /// Chosen from poses by a Cholesky factorisation with pivots (Harbrecht, Peters and Schneider 2012): the next is always the one
    /// that those before it leave most unknown, `most` of them at the most.
    pub fn chosen(length_rad: f64, from: &[[f64; 2]], most: usize) -> Self {
        let mut seen = Self::new(length_rad, []);
        while seen.poses.len() < most {
            let mut next: Option<([f64; 2], f64)> = None;
            for &pose in from {
                let unknown = seen.unknown(&seen.features(pose));
                if next.is_none_or(|(_, most_unknown)| unknown > most_unknown) {
                    next = Some((pose, unknown));
                }
            }
            match next {
                Some((pose, unknown)) if unknown > LEFT_UNKNOWN => seen.add(pose),
                _ => break,
            }
        }
        seen
    }

    fn add(&mut self, pose: [f64; 2]) {
        let features = self.features(pose);
        let last = libm::sqrt(self.unknown(&features).max(1e-12));
        self.root.extend(features);
        self.root.push(last);
        self.poses.push(pose);
    }

    /// φ: the correlations with the poses through the inverse of their factor. A pose that is no pose, an angle of it
    /// not being finite, is far from all others.
    pub fn features(&self, pose: [f64; 2]) -> Vec<f64> {
        if !pose.iter().all(|angle| angle.is_finite()) {
            return vec![0.0; self.poses.len()];
        }
        let with = self
            .poses
            .iter()
            .map(|&of| correlation(self.length_rad, of, pose));
        self.through(with)
    }

    /// Forward substitution: w of the function that has these values at the poses.
    pub fn through(&self, values: impl Iterator<Item = f64>) -> Vec<f64> {
        let mut out: Vec<f64> = Vec::with_capacity(self.poses.len());
        for (i, value) in values.enumerate() {
            let line = &self.root[i * (i + 1) / 2..];
            let known: f64 = out.iter().zip(line).map(|(x, l)| x * l).sum();
            out.push((value - known) / line[i]);
        }
        out
    }

    /// Variance of the function that the poses leave, in parts of its own.
    pub fn unknown(&self, features: &[f64]) -> f64 {
        (1.0 - features.iter().map(|x| x * x).sum::<f64>()).max(0.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn correlations_are_kept_and_poses_are_few() {
        let grid: Vec<[f64; 2]> = (0..400)
            .map(|k| [3.0 + 0.05 * f64::from(k % 20), 0.04 * f64::from(k / 20)])
            .collect();
        let seen = Seen::chosen(0.5, &grid, 64);
        assert!(seen.poses.len() < 20, "{}", seen.poses.len());
        let mut worst: f64 = 0.0;
        for a in grid.iter().step_by(7) {
            for b in grid.iter().step_by(11) {
                let (x, y) = (seen.features(*a), seen.features(*b));
                let got: f64 = x.iter().zip(&y).map(|(x, y)| x * y).sum();
                worst = worst.max((got - correlation(0.5, *a, *b)).abs());
            }
        }
        // Cauchy and Schwarz: no more than the variance that is left unknown
        assert!(worst <= LEFT_UNKNOWN, "{worst}");
        let turned = seen.features([grid[7][0] + core::f64::consts::TAU, grid[7][1]]);
        for (a, b) in turned.iter().zip(seen.features(grid[7])) {
            assert!((a - b).abs() < 1e-12);
        }
        // far away nothing is known
        let away = seen.features([3.0 + core::f64::consts::PI, 0.4]);
        assert!(seen.unknown(&away) > 0.999);
    }
}
