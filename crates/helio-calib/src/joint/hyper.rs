//! How records scatter, how zero points wander and how heliostats differ, and how likely that makes what was seen.

use super::belief::{Rates, Shape, WANDERING, at};
use super::common::Common;
use super::group::Sample;
use super::rows::ANGLES;

/// How records scatter.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Noise {
    /// One standard deviation of either component across the beam \[mrad\].
    pub beam_mrad: f64,
    /// One standard deviation of either component on the target \[m\], where a record states none.
    pub spot_m: f64,
    /// One standard deviation of the time for which the sun was computed \[s\]: scatter along its path.
    pub sun_path_s: f64,
}

/// How the zero points of the axes wander: each the sum of a slow and a fast process that forget
/// exponentially (Ornstein and Uhlenbeck).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Wander {
    /// One standard deviation of the slow part, of either axis \[mrad\].
    pub slow_mrad: [f64; 2],
    /// Days in which it is forgotten by a factor e.
    pub slow_days: f64,
    /// One standard deviation of the fast part, of either axis \[mrad\].
    pub fast_mrad: [f64; 2],
    /// Days in which it is forgotten by a factor e.
    pub fast_days: f64,
}

/// All of them.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Hyper {
    pub noise: Noise,
    pub wander: Wander,
    /// Lower triangle of the covariance of heliostats' own unknowns at rest \[mrad²\].
    pub spread: Vec<f64>,
}

/// Logarithms that are searched.
pub(super) const SEARCHED: usize = 9;

/// What is expected of a field before anything was seen.
pub(super) const EXPECTED_NOISE: Noise = Noise {
    beam_mrad: 0.3,
    spot_m: 0.02,
    sun_path_s: 5.0,
};
pub(super) const EXPECTED_WANDER: Wander = Wander {
    slow_mrad: [0.4, 0.4],
    slow_days: 60.0,
    fast_mrad: [0.3, 0.3],
    fast_days: 0.3,
};
/// Standard deviations of six angles over a field before anything was seen \[mrad\]: tilts, azimuth reference less
/// mirror tilt, non-orthogonality, elevation reference, mirror tilt.
pub(super) const EXPECTED_SPREAD_MRAD: [f64; ANGLES] = [20.0, 20.0, 5.0, 3.0, 10.0, 10.0];

/// One standard deviation of each searched logarithm about what is expected.
const WIDTH: [f64; SEARCHED] = [0.5, 0.7, 0.5, 0.7, 0.7, 0.7, 0.7, 0.7, 0.7];

impl Hyper {
    pub fn rates(&self) -> Rates {
        let (n, w) = (&self.noise, &self.wander);
        let square = |x: f64| x * x;
        Rates {
            beam: square(n.beam_mrad),
            spot: square(n.spot_m),
            sun: square(n.sun_path_s),
            wander: [
                square(w.slow_mrad[0]),
                square(w.slow_mrad[1]),
                square(w.fast_mrad[0]),
                square(w.fast_mrad[1]),
            ],
            days: [w.slow_days, w.slow_days, w.fast_days, w.fast_days],
        }
    }

    pub fn logarithms(&self) -> [f64; SEARCHED] {
        let (n, w) = (&self.noise, &self.wander);
        [
            n.beam_mrad,
            n.spot_m,
            n.sun_path_s,
            w.slow_mrad[0],
            w.slow_mrad[1],
            w.slow_days,
            w.fast_mrad[0],
            w.fast_mrad[1],
            w.fast_days,
        ]
        .map(libm::log)
    }

    pub fn set_logarithms(&mut self, logarithms: &[f64; SEARCHED]) {
        let [
            beam,
            spot,
            sun,
            slow0,
            slow1,
            slow_days,
            fast0,
            fast1,
            fast_days,
        ] = logarithms.map(libm::exp);
        self.noise = Noise {
            beam_mrad: beam,
            spot_m: spot,
            sun_path_s: sun,
        };
        self.wander = Wander {
            slow_mrad: [slow0, slow1],
            slow_days,
            fast_mrad: [fast0, fast1],
            fast_days,
        };
    }

    /// What stands against the searched logarithms before anything was seen.
    pub fn penalty(&self) -> f64 {
        let expected = Self {
            noise: EXPECTED_NOISE,
            wander: EXPECTED_WANDER,
            spread: Vec::new(),
        };
        let pairs = self.logarithms().into_iter().zip(expected.logarithms());
        pairs
            .zip(WIDTH)
            .map(|((is, expected), width)| {
                let z = (is - expected) / width;
                0.5 * z * z
            })
            .sum()
    }
}

/// What was decided about the records of a heliostat.
#[derive(Debug, Clone, PartialEq, Default)]
pub(super) struct Marks {
    /// Records that are not believed.
    pub outliers: Vec<usize>,
    /// Records before which a zero point jumped, and of which axis.
    pub jumps: Vec<(usize, usize)>,
}

/// What is left of the wandering zero points after some days, and what is new.
pub(super) fn waited(rates: &Rates, days: f64) -> ([f64; WANDERING], [f64; WANDERING]) {
    let kept: [f64; WANDERING] =
        core::array::from_fn(|k| libm::exp(-days.max(0.0) / rates.days[k]));
    let added = core::array::from_fn(|k| rates.wander[k] * (1.0 - kept[k] * kept[k]));
    (kept, added)
}

/// Minus the logarithm of the likelihood of all records, what is common integrated out.
pub(super) fn minus_log_likelihood(sample: &Sample, hyper: &Hyper, prior_sigma: &[f64]) -> f64 {
    let (_, sum) = sample.filter(hyper);
    Common::new(&sum, prior_sigma).map_or(f64::INFINITY, |common| common.minus_log_likelihood)
}

/// Widest step of a searched logarithm.
const FIRST_STEP: f64 = 0.4;
/// Times that each logarithm is searched.
const SWEEPS: usize = 6;

/// Makes the likelihood large over noise and wander, one logarithm after the other by parabolas, and over the
/// heliostats' spread by expectation and maximisation in between.
pub(super) fn learn(
    sample: &Sample,
    hyper: &mut Hyper,
    prior_sigma: &[f64],
    expected_spread: &[f64],
    spread_free: &[bool],
) -> f64 {
    let mut best = f64::INFINITY;
    let value = |hyper: &Hyper| minus_log_likelihood(sample, hyper, prior_sigma) + hyper.penalty();
    let mut steps = [FIRST_STEP; SEARCHED];
    for _ in 0..SWEEPS {
        for _ in 0..2 {
            learn_spread(sample, hyper, prior_sigma, expected_spread, spread_free);
        }
        best = value(hyper);
        for k in 0..SEARCHED {
            let from = hyper.logarithms();
            let mut look = |by: f64| {
                let mut logarithms = from;
                logarithms[k] += by;
                hyper.set_logarithms(&logarithms);
                value(hyper)
            };
            let step = steps[k];
            let (below, above) = (look(-step), look(step));
            let bend = below + above - 2.0 * best;
            let slope = 0.5 * (above - below);
            let by = if bend > 0.0 {
                (-slope / bend).clamp(-2.0, 2.0) * step
            } else if slope > 0.0 {
                -2.0 * step
            } else {
                2.0 * step
            };
            let candidates = [(by, look(by)), (-step, below), (step, above)];
            let mut chosen = (0.0, best);
            for candidate in candidates {
                if candidate.1 < chosen.1 {
                    chosen = candidate;
                }
            }
            let mut logarithms = from;
            logarithms[k] += chosen.0;
            hyper.set_logarithms(&logarithms);
            best = chosen.1;
            steps[k] = (step * 0.5).max(chosen.0.abs()).min(FIRST_STEP);
        }
    }
    best
}

/// Variance of heliostats in what they are not to differ in \[mrad²\]: none, but one that can be divided by.
pub(super) const HELD_VARIANCE: f64 = 1e-8;
/// How stiffly correlations are held to none, in heliostats.
const STIFFNESS: f64 = 20.0;
/// What the expected spread counts, in heliostats.
const EXPECTED_COUNTS: f64 = 2.0;

/// One step of expectation and maximisation for the covariance of heliostats' own unknowns. The azimuth
/// reference is taken less the mirror tilt: where a field was set up by pointing at something near the
/// horizon, one makes up for the other.
fn learn_spread(
    sample: &Sample,
    hyper: &mut Hyper,
    prior_sigma: &[f64],
    expected_spread: &[f64],
    free: &[bool],
) {
    let (known, sum) = sample.filter(hyper);
    let Some(common) = Common::new(&sum, prior_sigma) else {
        return;
    };
    let still = sample.shape.still;
    let total = sample.moments(&known, &common);
    let count = sample.count as f64;
    let turned = turn(still, &total, -1.0);
    let scale: Vec<f64> = (0..still)
        .map(|i| {
            let expected = expected_spread[i] * expected_spread[i];
            let variance = turned[i * still + i] + EXPECTED_COUNTS * expected;
            libm::sqrt(variance / (count + EXPECTED_COUNTS))
        })
        .collect();
    let mut shrunk = vec![0.0; still * still];
    for i in 0..still {
        for j in 0..still {
            if free[i] && free[j] {
                let unit = f64::from(u8::from(i == j));
                let correlation = turned[i * still + j] / (scale[i] * scale[j]);
                shrunk[i * still + j] =
                    scale[i] * scale[j] * (STIFFNESS * unit + correlation) / (STIFFNESS + count);
            }
        }
    }
    for i in 0..still {
        if !free[i] {
            shrunk[i * still + i] = HELD_VARIANCE;
        }
    }
    let spread = turn(still, &shrunk, 1.0);
    for i in 0..still {
        for j in 0..=i {
            hyper.spread[at(i, j)] = spread[i * still + j];
        }
    }
}

/// Expected covariance of heliostats' own unknowns, lower triangle.
pub(super) fn expected_covariance(sigma: &[f64]) -> Vec<f64> {
    let still = sigma.len();
    let mut diagonal = vec![0.0; still * still];
    for i in 0..still {
        diagonal[i * still + i] = sigma[i] * sigma[i];
    }
    let full = turn(still, &diagonal, 1.0);
    let mut lower = vec![0.0; Shape::triangle(still)];
    for i in 0..still {
        for j in 0..=i {
            lower[at(i, j)] = full[i * still + j];
        }
    }
    lower
}

/// Adds `by` times the mirror tilt to the azimuth reference, in a covariance.
fn turn(still: usize, matrix: &[f64], by: f64) -> Vec<f64> {
    const REFERENCE: usize = 2;
    const MIRROR: usize = 5;
    let mut out = matrix.to_vec();
    for j in 0..still {
        out[REFERENCE * still + j] += by * out[MIRROR * still + j];
    }
    for i in 0..still {
        out[i * still + REFERENCE] += by * out[i * still + MIRROR];
    }
    out
}
