//! How records scatter, how zero points wander and how heliostats differ, and how likely that makes what was seen.

use super::belief::{Rates, Shape, WANDERING, at};
use super::common::{Common, Sum};
use super::going::Going;
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

fn expected() -> Hyper {
    Hyper {
        noise: EXPECTED_NOISE,
        wander: EXPECTED_WANDER,
        spread: Vec::new(),
    }
}

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
        let pairs = self.logarithms().into_iter().zip(expected().logarithms());
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

impl Marks {
    /// How often each of so many records is odd: not believed or one that tells nothing, or after a jump of each axis.
    pub fn odd(&self, count: usize, silent: &[usize]) -> Vec<usize> {
        let mut odd = vec![0; count];
        let jumped = self.jumps.iter().map(|(k, _)| k);
        for &k in self.outliers.iter().chain(silent).chain(jumped) {
            odd[k] += 1;
        }
        odd
    }

    /// Those of records before one.
    pub fn until(&self, end: usize) -> Self {
        end.checked_sub(1)
            .map_or_else(Self::default, |last| self.before(last))
    }

    /// Those of one record and the ones after it.
    pub fn from(&self, first: usize) -> Self {
        let outliers = self.outliers.iter().filter(|k| **k >= first);
        let jumps = self.jumps.iter().filter(|(k, _)| *k >= first);
        Self {
            outliers: outliers.copied().collect(),
            jumps: jumps.copied().collect(),
        }
    }

    /// The same with records counted otherwise: of each its number there.
    pub fn numbered(&self, numbers: &[usize]) -> Self {
        let jumps = self.jumps.iter();
        Self {
            outliers: self.outliers.iter().map(|&k| numbers[k]).collect(),
            jumps: jumps.map(|&(k, axis)| (numbers[k], axis)).collect(),
        }
    }

    /// With those of later records.
    pub fn and(mut self, later: Self) -> Self {
        self.outliers.extend(later.outliers);
        self.jumps.extend(later.jumps);
        self
    }

    /// Those of records up to one.
    pub fn before(&self, last: usize) -> Self {
        let outliers = self.outliers.iter().filter(|k| **k <= last);
        let jumps = self.jumps.iter().filter(|(k, _)| *k <= last);
        Self {
            outliers: outliers.copied().collect(),
            jumps: jumps.copied().collect(),
        }
    }
}

/// What is left of the wandering zero points after some days, and what is new.
pub(super) fn waited(rates: &Rates, days: f64) -> ([f64; WANDERING], [f64; WANDERING]) {
    let [slow, fast] = [rates.days[0], rates.days[2]].map(|of| libm::exp(-days.max(0.0) / of));
    let kept = [slow, slow, fast, fast];
    let added = core::array::from_fn(|k| rates.wander[k] * (1.0 - kept[k] * kept[k]));
    (kept, added)
}

/// Minus the logarithm of the likelihood of all records, what is common integrated out.
pub(super) fn minus_log_likelihood(sample: &Sample, hyper: &Hyper, prior_sigma: &[f64]) -> f64 {
    minus_log(&sample.filter(hyper).1, prior_sigma)
}

fn minus_log(sum: &Sum, prior_sigma: &[f64]) -> f64 {
    Common::new(sum, prior_sigma).map_or(f64::INFINITY, |common| common.minus_log_likelihood)
}

/// Farthest that a searched logarithm moves at once.
const WIDEST: f64 = 0.8;
/// Half the distance over which the first curvatures are taken.
const FIRST_REACH: f64 = 0.1;
/// Distance over which slopes are taken: the minimum is off by half of it.
const REACH: f64 = 1e-4;
/// Times that noise, wander and spread are bettered.
const ROUNDS: usize = 24;
/// Search is over where a round gains less than the larger of these (logarithm of the likelihood): altogether, and for
/// each heliostat.
const ENOUGH: f64 = 0.01;
const ENOUGH_EACH: f64 = 1e-3;
/// Farthest that a searched logarithm moves from what is expected: where records have no noise, likelihood has no end.
const FARTHEST: f64 = 7.0;
/// Times that a step which does not gain is halved.
const HALVED: usize = 4;

type Logarithms = [f64; SEARCHED];

/// What was learnt of the likelihood's shape over noise and wander: the inverse of its second derivatives.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Search {
    inverse: [Logarithms; SEARCHED],
}

/// What may be learnt.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Free {
    pub logarithms: [bool; SEARCHED],
    /// Of each unknown at rest, whether heliostats differ in it.
    pub spread: Vec<bool>,
    /// Whether how heliostats differ is learnt at all.
    pub pooled: bool,
}

impl Free {
    fn searched(&self) -> impl Iterator<Item = usize> {
        let free = self.logarithms;
        (0..SEARCHED).filter(move |&k| free[k])
    }
}

/// A part of the model that can be left out, to see what it is worth.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Part {
    /// Noise across the beam, [`Noise::beam_mrad`].
    BeamNoise,
    /// Noise on the target, [`Noise::spot_m`].
    SpotNoise,
    /// Noise along the sun's path, [`Noise::sun_path_s`].
    SunPathNoise,
    /// The slow part of wandering zero points.
    SlowWander,
    /// The fast part of wandering zero points.
    FastWander,
    /// That heliostats are alike: every one may then be anything.
    Pooling,
}

impl Part {
    /// All of them.
    pub const ALL: &'static [Self] = &[
        Self::BeamNoise,
        Self::SpotNoise,
        Self::SunPathNoise,
        Self::SlowWander,
        Self::FastWander,
        Self::Pooling,
    ];

    /// The words for people.
    #[must_use]
    pub const fn in_words(self) -> &'static str {
        match self {
            Self::BeamNoise => "noise across the beam",
            Self::SpotNoise => "noise on the target",
            Self::SunPathNoise => "noise along the sun's path",
            Self::SlowWander => "slow wander",
            Self::FastWander => "fast wander",
            Self::Pooling => "likeness of heliostats",
        }
    }

    /// Logarithms that say how large it is, and those that then have no meaning.
    const fn logarithms(self) -> (&'static [usize], &'static [usize]) {
        match self {
            Self::BeamNoise => (&[0], &[]),
            Self::SpotNoise => (&[1], &[]),
            Self::SunPathNoise => (&[2], &[]),
            Self::SlowWander => (&[3, 4], &[5]),
            Self::FastWander => (&[6, 7], &[8]),
            Self::Pooling => (&[], &[]),
        }
    }
}

/// Next to nothing, in mrad, m or s: as large as a part that is left out.
const NOTHING: f64 = 1e-6;
/// One standard deviation of every angle of a heliostat of which nothing is known \[mrad\].
const ANYTHING_MRAD: f64 = 100.0;

/// Leaves parts out; what is still to be learnt.
pub(super) fn without(parts: &[Part], still: usize, hyper: &mut Hyper) -> Free {
    let mut free = Free {
        logarithms: [true; SEARCHED],
        spread: vec![true; still],
        pooled: true,
    };
    let mut logarithms = hyper.logarithms();
    for part in parts {
        let (sizes, meaningless) = part.logarithms();
        for &k in sizes {
            logarithms[k] = libm::log(NOTHING);
        }
        for &k in sizes.iter().chain(meaningless) {
            free.logarithms[k] = false;
        }
        if *part == Part::Pooling {
            free.pooled = false;
            for i in 0..ANGLES {
                for j in 0..=i {
                    let square = ANYTHING_MRAD * ANYTHING_MRAD;
                    hyper.spread[at(i, j)] = square * f64::from(u8::from(i == j));
                }
            }
        }
    }
    hyper.set_logarithms(&logarithms);
    free
}

fn dot(a: &Logarithms, b: &Logarithms) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

fn plus(a: &Logarithms, by: f64, b: &Logarithms) -> Logarithms {
    let mut out = *a;
    for (a, b) in out.iter_mut().zip(b) {
        *a += by * b;
    }
    out
}

impl Search {
    /// From curvatures along each logarithm; those that are not free never move.
    fn of(curvatures: &Logarithms, free: &[bool; SEARCHED]) -> Self {
        let mut inverse = [[0.0; SEARCHED]; SEARCHED];
        for (k, curvature) in curvatures.iter().enumerate().filter(|(k, _)| free[*k]) {
            // no less than what stands against it before anything was seen
            inverse[k][k] = 1.0 / curvature.max(1.0 / (WIDTH[k] * WIDTH[k]));
        }
        Self { inverse }
    }

    /// As known once so many times as many heliostats curve the likelihood.
    pub fn seen_by_more(&mut self, times: f64) {
        for x in self.inverse.as_flattened_mut() {
            *x /= times;
        }
    }

    /// Downhill, no farther than [`WIDEST`].
    fn step(&self, slope: &Logarithms) -> Logarithms {
        let step = self.inverse.map(|line| -dot(&line, slope));
        let widest = step.iter().fold(0.0, |m: f64, x| m.max(x.abs()));
        step.map(|x| x * (WIDEST / widest).min(1.0))
    }

    /// After a step, the slope changed by this (Broyden, Fletcher, Goldfarb and Shanno).
    fn learn(&mut self, step: &Logarithms, change: &Logarithms) {
        let along = dot(step, change);
        if along <= 1e-12 {
            return;
        }
        let through = self.inverse.map(|line| dot(&line, change));
        let scale = (1.0 + dot(change, &through) / along) / along;
        for i in 0..SEARCHED {
            for j in 0..SEARCHED {
                self.inverse[i][j] += scale * step[i] * step[j]
                    - (through[i] * step[j] + step[i] * through[j]) / along;
            }
        }
    }
}

/// Makes the likelihood large over noise and wander by quasi-Newton steps, and over the heliostats' spread by
/// expectation and maximisation in between. Whether that ended where no step promises more, and not because rounds
/// ran out (as where no step gains what it promised) or a number was not finite.
pub(super) fn learn(
    sample: &Sample,
    hyper: &mut Hyper,
    prior_sigma: &[f64],
    expected_spread: &[f64],
    free: &Free,
    search: &mut Option<Search>,
    going: &Going<'_>,
) -> bool {
    let values = |hyper: &Hyper, places: &[Logarithms]| -> Vec<f64> {
        let there = |logarithms: &Logarithms| {
            let mut there = hyper.clone();
            there.set_logarithms(logarithms);
            there
        };
        let each: Vec<Hyper> = places.iter().map(there).collect();
        let told = sample.tell(&each);
        let value = |(sum, hyper): (&Sum, &Hyper)| minus_log(sum, prior_sigma) + hyper.penalty();
        told.iter().zip(&each).map(value).collect()
    };
    // along each logarithm that is free
    let along = |from: &Logarithms, by: f64| -> Vec<Logarithms> {
        let moved = |k: usize| {
            let mut out = *from;
            out[k] += by;
            out
        };
        free.searched().map(moved).collect()
    };
    let enough = ENOUGH.max(ENOUGH_EACH * sample.members.len() as f64);
    let expected = expected().logarithms();
    let mut before: Option<(f64, Logarithms, Logarithms)> = None;
    for _ in 0..ROUNDS {
        if !going.is_on() {
            return false;
        }
        for _ in (0..2).filter(|_| free.pooled) {
            learn_spread(sample, hyper, prior_sigma, expected_spread, &free.spread);
        }
        let from = hyper.logarithms();
        let reach = if search.is_some() { REACH } else { FIRST_REACH };
        let mut places = along(&from, reach);
        places.push(from);
        let mut above = values(hyper, &places);
        let here = above.pop().unwrap_or(f64::INFINITY);
        if !here.is_finite() {
            return false;
        }
        let mut slope = [0.0; SEARCHED];
        let known = match search {
            Some(known) => {
                for (k, above) in free.searched().zip(above) {
                    slope[k] = (above - here) / REACH;
                }
                if let Some((_, last, last_slope)) = &before {
                    known.learn(&plus(&from, -1.0, last), &plus(&slope, -1.0, last_slope));
                }
                known
            }
            None => {
                let mut curvatures = [0.0; SEARCHED];
                let below = values(hyper, &along(&from, -FIRST_REACH));
                for (k, (above, below)) in free.searched().zip(above.into_iter().zip(below)) {
                    slope[k] = (above - below) / (2.0 * FIRST_REACH);
                    curvatures[k] = (above + below - 2.0 * here) / (FIRST_REACH * FIRST_REACH);
                }
                search.insert(Search::of(&curvatures, &free.logarithms))
            }
        };
        let gained = before.map_or(f64::INFINITY, |(last, ..)| last - here);
        let step = known.step(&slope);
        let promised = -0.5 * dot(&step, &slope);
        if promised < enough && gained < enough {
            return true;
        }
        let mut by = 1.0;
        for _ in 0..HALVED {
            if !going.is_on() {
                return false;
            }
            let mut there = plus(&from, by, &step);
            for k in free.searched() {
                there[k] = there[k].clamp(expected[k] - FARTHEST, expected[k] + FARTHEST);
            }
            if values(hyper, &[there]).iter().all(|value| *value < here) {
                hyper.set_logarithms(&there);
                break;
            }
            by *= 0.5;
        }
        before = Some((here, from, slope));
    }
    false
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
    let count = sample.members.len() as f64;
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
