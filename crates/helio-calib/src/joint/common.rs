//! What the whole field has in common: the small dense end of the arrow.

use faer::prelude::Solve;
use faer::{Mat, Side};

use super::belief::{Belief, Shape, Told, at};

/// What records of any number of heliostats tell.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Sum {
    pub told: Told<f64>,
    pub log_determinant: f64,
}

impl Sum {
    pub fn new(told: Told<f64>, log_determinant: f64) -> Self {
        Self {
            told,
            log_determinant,
        }
    }

    pub fn nothing(shape: Shape) -> Self {
        Self::new(Told::nothing(shape), 0.0)
    }

    pub fn add(&mut self, other: &Self) {
        let add = |to: &mut [f64], from: &[f64]| {
            for (a, b) in to.iter_mut().zip(from) {
                *a += b;
            }
        };
        add(&mut self.told.matrix, &other.told.matrix);
        add(&mut self.told.vector, &other.told.vector);
        self.told.square += other.told.square;
        self.log_determinant += other.log_determinant;
    }
}

/// Distribution of what is common after the records.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Common {
    pub mean: Vec<f64>,
    /// Row by row.
    pub covariance: Vec<f64>,
    pub minus_log_likelihood: f64,
}

impl Common {
    /// From records and what was expected: zero, with these standard deviations. `None` where the numbers are
    /// not finite.
    pub fn new(sum: &Sum, prior_sigma: &[f64]) -> Option<Self> {
        let n = prior_sigma.len();
        // in units of the prior's sigma: I + D Λ D, never worse conditioned than the records make it
        let matrix = Mat::from_fn(n, n, |i, j| {
            let (i, j) = (i.max(j), i.min(j));
            let unit = f64::from(u8::from(i == j));
            unit + prior_sigma[i] * prior_sigma[j] * sum.told.matrix[at(i, j)]
        });
        let factor = matrix.llt(Side::Lower).ok()?;
        let vector = Mat::from_fn(n, 1, |i, _| prior_sigma[i] * sum.told.vector[i]);
        let solved = factor.solve(&vector);
        let covariance = factor.solve(Mat::<f64>::identity(n, n));
        let mean: Vec<f64> = (0..n).map(|i| prior_sigma[i] * solved[(i, 0)]).collect();
        let explained: f64 = (0..n).map(|i| vector[(i, 0)] * solved[(i, 0)]).sum();
        let root = factor.L();
        let log_determinant: f64 = (0..n).map(|i| 2.0 * libm::log(root[(i, i)])).sum();
        let minus_log_likelihood =
            0.5 * (sum.told.square - explained + log_determinant + sum.log_determinant);
        let covariance = (0..n * n)
            .map(|k| prior_sigma[k / n] * prior_sigma[k % n] * covariance[(k / n, k % n)])
            .collect();
        minus_log_likelihood.is_finite().then_some(Self {
            mean,
            covariance,
            minus_log_likelihood,
        })
    }

    /// Takes in more unknowns, of which nothing but these standard deviations about zero is known.
    pub fn grow(&mut self, prior_sigma: &[f64]) {
        let (before, n) = (self.mean.len(), prior_sigma.len());
        self.mean.resize(n, 0.0);
        let mut covariance = vec![0.0; n * n];
        for (to, from) in covariance.chunks_mut(n).zip(self.covariance.chunks(before)) {
            to[..before].copy_from_slice(from);
        }
        for k in before..n {
            covariance[k * n + k] = prior_sigma[k] * prior_sigma[k];
        }
        self.covariance = covariance;
    }

    /// Mean of a heliostat's own unknowns.
    pub fn mean_of(&self, belief: &Belief<f64>) -> Vec<f64> {
        let by_common = |i: usize| -> f64 {
            let pairs = self.mean.iter().enumerate();
            pairs.map(|(k, b)| belief.gain(i, k) * b).sum()
        };
        let means = belief.mean.iter().enumerate();
        means.map(|(i, m)| m + by_common(i)).collect()
    }

    /// Covariance of a heliostat's own unknowns, row by row: P + G V Gᵀ.
    pub fn covariance_of(&self, belief: &Belief<f64>) -> Vec<f64> {
        let (own, common) = (belief.shape.own(), self.mean.len());
        let mut through = vec![0.0; own * common];
        for i in 0..own {
            for k in 0..common {
                let g = belief.gain(i, k);
                if g != 0.0 {
                    for l in 0..common {
                        through[i * common + l] += g * self.covariance[k * common + l];
                    }
                }
            }
        }
        let mut out = vec![0.0; own * own];
        for i in 0..own {
            for j in 0..=i {
                let mut value = belief.covariance(i, j);
                for l in 0..common {
                    value += through[i * common + l] * belief.gain(j, l);
                }
                out[i * own + j] = value;
                out[j * own + i] = value;
            }
        }
        out
    }

    /// One belief in place of several that have these likelihoods: with the mean and the covariance of them together.
    pub fn mixture(&self, beliefs: &[&Belief<f64>], likelihoods: &[f64]) -> Belief<f64> {
        let total: f64 = likelihoods.iter().sum();
        let mut out = beliefs[0].clone();
        let (own, common) = (out.shape.own(), out.shape.common());
        let sum = |of: &dyn Fn(usize) -> f64| -> f64 {
            let each = likelihoods.iter().enumerate();
            each.map(|(n, likelihood)| likelihood * of(n)).sum::<f64>() / total
        };
        let means: Vec<Vec<f64>> = beliefs.iter().map(|b| self.mean_of(b)).collect();
        let mean: Vec<f64> = (0..own).map(|i| sum(&|n| means[n][i])).collect();
        for i in 0..own {
            out.mean[i] = sum(&|n| beliefs[n].mean[i]);
            for k in 0..common {
                out.set_gain(i, k, sum(&|n| beliefs[n].gain(i, k)));
            }
        }
        // accounts differ in how they go with what is common too, which is known to a covariance V: they add
        // (G - mean G) V (G - mean G)ᵀ
        let gains: Vec<Vec<f64>> = beliefs
            .iter()
            .map(|belief| {
                let gain = |p: usize| {
                    belief.gain(p / common, p % common) - out.gain(p / common, p % common)
                };
                (0..own * common).map(gain).collect()
            })
            .collect();
        let by_common: Vec<Vec<f64>> = gains
            .iter()
            .map(|gain| {
                let times = |p: usize| -> f64 {
                    let (i, k) = (p / common, p % common);
                    let row = &gain[i * common..(i + 1) * common];
                    let column = &self.covariance[k * common..(k + 1) * common];
                    row.iter().zip(column).map(|(g, v)| g * v).sum()
                };
                (0..own * common).map(times).collect()
            })
            .collect();
        let through = |n: usize, i: usize, j: usize| -> f64 {
            let (left, right) = (&by_common[n][i * common..], &gains[n][j * common..]);
            left[..common].iter().zip(right).map(|(a, b)| a * b).sum()
        };
        for i in 0..own {
            for j in 0..=i {
                let apart = |n: usize| (means[n][i] - mean[i]) * (means[n][j] - mean[j]);
                let value = sum(&|n| beliefs[n].covariance(i, j) + apart(n) + through(n, i, j));
                out.set_covariance(i, j, value);
            }
        }
        out
    }

    /// One standard deviation of a common unknown.
    pub fn sigma(&self, k: usize) -> f64 {
        libm::sqrt(self.covariance[k * self.mean.len() + k])
    }

    /// Logarithm of how much likelier the records are with these unknowns than with all of them held at zero (Savage
    /// and Dickey): densities at zero before and after.
    pub fn log_evidence(&self, group: &[usize], prior_sigma: &[f64]) -> f64 {
        let (n, all) = (group.len(), self.mean.len());
        let matrix = Mat::from_fn(n, n, |i, j| {
            let (i, j) = (group[i.max(j)], group[i.min(j)]);
            self.covariance[i * all + j] / (prior_sigma[i] * prior_sigma[j])
        });
        let Ok(factor) = matrix.llt(Side::Lower) else {
            return f64::NEG_INFINITY;
        };
        let mean = Mat::from_fn(n, 1, |i, _| self.mean[group[i]] / prior_sigma[group[i]]);
        let solved = factor.solve(&mean);
        let root = factor.L();
        (0..n)
            .map(|i| 0.5 * mean[(i, 0)] * solved[(i, 0)] + libm::log(root[(i, i)]))
            .sum()
    }
}
