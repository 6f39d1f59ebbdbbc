//! Outlier or jump: what becomes of a record that nobody expected.
//!
//! Several accounts of a heliostat's records are carried side by side: that a record tells the truth, that
//! its spot was found in a wrong place, that a zero point jumped just before it. The records to come decide.

use super::belief::{Belief, REFERENCES, Rates, Room, Surprise, Told};
use super::common::Common;
use super::hyper::Marks;
use super::watch::Lately;

/// How often things go wrong.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Mishaps {
    /// Probability that a record's spot was found in a wrong place.
    pub outlier: f64,
    /// How far off, one standard deviation of either component \[mrad\].
    pub outlier_mrad: f64,
    /// Probability that the zero point of one axis, or of both, jumped before a record.
    pub jump: f64,
    /// How far, one standard deviation \[mrad\].
    pub jump_mrad: f64,
}

impl Default for Mishaps {
    fn default() -> Self {
        Self {
            outlier: 0.02,
            outlier_mrad: 20.0,
            jump: 0.005,
            jump_mrad: 10.0,
        }
    }
}

/// A record nearer than this to what was expected (chi-squared, two degrees of freedom: 5 % lie beyond) is
/// taken as it is.
const DOUBTFUL: f64 = 6.0;
/// What may jump, and how likely it is that this does where something does: encoders lose their references one by
/// one, or together where a drive cabinet loses its power.
const JUMPS: [([bool; 2], f64); 3] = [
    ([true, false], 0.4),
    ([false, true], 0.4),
    ([true, true], 0.2),
];
/// How far, in the size that is stated for jumps, and how likely it is that one is of that size: a drive that loses its
/// reference altogether stands anywhere.
const SIZES: [(f64, f64); 2] = [(1.0, 0.9), (5.0, 0.1)];
/// Variance of what was expected, of that of spots in wrong places, above which a record may be one however near it lies.
const VAGUE: f64 = 0.02;
/// Accounts carried on at most.
pub(super) const MOST: usize = 8;
/// An account less likely than the best by this (logarithm) is given up.
pub(super) const GIVEN_UP: f64 = 12.0;

/// One account of what happened.
#[derive(Debug, Clone, PartialEq)]
pub struct Account {
    /// Less that of the likeliest.
    pub(super) log_likelihood: f64,
    pub(super) belief: Belief<f64>,
    /// What its records tell of what is common, since that was last taken from it.
    pub(super) told: Told<f64>,
    pub(super) marks: Marks,
    pub(super) drift: Drift,
    /// How many of the last records do not fit the others.
    pub(super) lately: Lately,
}

/// Exponentially weighted running mean of the misses of an account in their standard deviations.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(super) struct Drift {
    pub mean: [f64; 2],
    /// Of either component, in a heliostat that does what the model says.
    pub variance: f64,
    /// Records since the last that was believed.
    pub unbelieved: usize,
}

impl Drift {
    fn count(&mut self, weight: f64, deviates: [f64; 2]) {
        for (mean, deviate) in self.mean.iter_mut().zip(deviates) {
            *mean += weight * (deviate - *mean);
        }
        self.unbelieved = 0;
        let kept = 1.0 - weight;
        self.variance = kept * kept * self.variance + weight * weight;
    }

    /// Squared length in standard deviations; none before anything was counted.
    pub fn square(&self) -> f64 {
        let [x, y] = self.mean;
        if self.variance > 0.0 {
            (x * x + y * y) / self.variance
        } else {
            0.0
        }
    }
}

impl Account {
    /// Counts a record that is not believed.
    pub(super) fn unbelieved(&mut self) {
        self.drift.unbelieved += 1;
        self.lately.count(1);
    }

    pub(super) fn new(belief: Belief<f64>) -> Self {
        Self {
            log_likelihood: 0.0,
            told: Told::nothing(belief.shape),
            belief,
            marks: Marks::default(),
            drift: Drift::default(),
            lately: Lately::default(),
        }
    }
}

/// What may have become of a record.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Kind {
    Truth,
    /// Of the first axis, of the second, or of both; how far in the size that is stated for jumps.
    Jump([bool; 2], f64),
    Outlier,
}

/// An account and what became of the record under it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Candidate {
    pub parent: usize,
    pub kind: Kind,
    pub log_likelihood: f64,
}

/// A record held against an account.
#[derive(Debug, Clone, Copy)]
pub(super) struct Held {
    /// S: first, mixed, second \[mrad²\].
    pub covariance: [f64; 3],
    /// What is left \[mrad\].
    pub left: [f64; 2],
}

impl Held {
    /// S of a record is what is known of the heliostat with the common unknowns given; that these are known to some
    /// covariance only comes to it. `slopes` are h.
    fn of(surprise: &Surprise<f64>, slopes: &[[f64; 2]], common: &Common) -> Self {
        let (mut covariance, left) = surprise.plain();
        let n = common.mean.len();
        for (h, line) in slopes.iter().zip(common.covariance.chunks_exact(n)) {
            let mut through = [0.0; 2];
            for (v, other) in line.iter().zip(slopes) {
                through = [through[0] + v * other[0], through[1] + v * other[1]];
            }
            covariance[0] += h[0] * through[0];
            covariance[1] += h[0] * through[1];
            covariance[2] += h[1] * through[1];
        }
        Self { covariance, left }
    }

    fn determinant(&self) -> f64 {
        let [a, b, c] = self.covariance;
        a * c - b * b
    }

    /// Chi-squared with two degrees of freedom.
    fn square(&self) -> f64 {
        let [a, b, c] = self.covariance;
        let [x, y] = self.left;
        (x * x * c - 2.0 * x * y * b + y * y * a) / self.determinant()
    }

    /// What is left as two independent standard deviates.
    fn deviates(&self) -> [f64; 2] {
        let [a, b, _] = self.covariance;
        let [x, y] = self.left;
        let mixed = b / a;
        let second = self.determinant() / a;
        [x / libm::sqrt(a), (y - mixed * x) / libm::sqrt(second)]
    }

    /// Logarithm of the density, but for what all have in common.
    fn log_density(&self) -> f64 {
        -0.5 * (self.square() + libm::log(self.determinant()))
    }

    /// Where a change of variance `variance` may have come by `slope`.
    fn loosened(&self, slope: [f64; 2], variance: f64) -> Self {
        let [a, b, c] = self.covariance;
        let covariance = [
            a + variance * slope[0] * slope[0],
            b + variance * slope[0] * slope[1],
            c + variance * slope[1] * slope[1],
        ];
        Self {
            covariance,
            ..*self
        }
    }
}

impl Mishaps {
    /// Whether a record is to be doubted: chi-squared of what is left, and the determinant of S. Where so little
    /// is known that a spot in a wrong place would not stand out, it may be one however near it lies.
    pub(super) fn doubts(&self, square: f64, determinant: f64) -> bool {
        let vague = VAGUE * self.outlier_mrad * self.outlier_mrad;
        square > DOUBTFUL || determinant > vague * vague
    }

    /// Variances by which zero points are known the less after a jump \[mrad²\].
    pub(super) fn jumped(&self, axes: [bool; 2], size: f64) -> [f64; 2] {
        let far = size * self.jump_mrad;
        axes.map(|it| if it { far * far } else { 0.0 })
    }

    /// What may have become of a record under one account; `slopes` are those of the references.
    pub(super) fn accounts(
        &self,
        (parent, log_likelihood): (usize, f64),
        (held, square): (&Held, f64),
        slopes: [[f64; 2]; 2],
        out: &mut Vec<Candidate>,
    ) {
        let candidate = |kind: Kind, prior: f64, held: &Held| Candidate {
            parent,
            kind,
            log_likelihood: log_likelihood + libm::log(prior) + held.log_density(),
        };
        let [a, b, c] = held.covariance;
        if self.doubts(square, held.determinant()) {
            if square > DOUBTFUL {
                for (axes, share) in JUMPS {
                    // of either size: the likelier one stands for both
                    let each = SIZES.map(|(size, of_size)| {
                        let mut jumped = *held;
                        for (slope, variance) in slopes.into_iter().zip(self.jumped(axes, size)) {
                            jumped = jumped.loosened(slope, variance);
                        }
                        let prior = share * of_size * self.jump;
                        candidate(Kind::Jump(axes, size), prior, &jumped)
                    });
                    let [near, far] = each;
                    let farther = far.log_likelihood > near.log_likelihood;
                    out.push(if farther { far } else { near });
                }
            }
            let scatter = self.outlier_mrad * self.outlier_mrad;
            let anywhere = Held {
                covariance: [a + scatter, b, c + scatter],
                left: held.left,
            };
            out.push(candidate(Kind::Outlier, self.outlier, &anywhere));
        }
        out.push(candidate(Kind::Truth, 1.0 - self.outlier - self.jump, held));
    }
}

/// Those that are carried on, likeliest first, with their likelihood against it.
pub(super) fn chosen(candidates: &mut Vec<Candidate>) {
    candidates.sort_by(|a, b| b.log_likelihood.total_cmp(&a.log_likelihood));
    let best = candidates.first().map_or(0.0, |c| c.log_likelihood);
    candidates.retain(|c| c.log_likelihood > best - GIVEN_UP);
    candidates.truncate(MOST);
    for candidate in candidates {
        candidate.log_likelihood -= best;
    }
}

/// Records after which what an account says of one is no longer in question.
pub(super) const DECIDED_AFTER: usize = 6;

/// Gives up accounts that say otherwise than the likeliest, which is the first, of records that are long past;
/// `k` is the last.
pub(super) fn decide(accounts: &mut Vec<Account>, k: usize) {
    let Some(past) = k.checked_sub(DECIDED_AFTER) else {
        return;
    };
    let Some(best) = accounts.first().map(|best| best.marks.before(past)) else {
        return;
    };
    accounts.retain(|account| account.marks.before(past) == best);
}

/// The accounts after record number `k`, likeliest first, judged by what is known of what is common; a record that is
/// believed counts `weight` in the drift.
pub(super) fn told_by(
    mut accounts: Vec<Account>,
    k: usize,
    row: &[f64],
    rates: &Rates,
    mishaps: &Mishaps,
    common: &Common,
    weight: f64,
) -> Vec<Account> {
    let slopes = REFERENCES.map(|i| [row[2 * i], row[2 * i + 1]]);
    let mut candidates = Vec::new();
    let mut surprises = Vec::with_capacity(accounts.len());
    for (parent, account) in accounts.iter_mut().enumerate() {
        let mut room = Room::of(account.belief.shape);
        let surprise = account.belief.weigh(row, rates, &common.mean, &mut room);
        let held = Held::of(&surprise, room.by_common(), common);
        let of = (parent, account.log_likelihood);
        mishaps.accounts(of, (&held, held.square()), slopes, &mut candidates);
        surprises.push((surprise, room, held.deviates()));
    }
    chosen(&mut candidates);
    let mut accounts: Vec<Option<Account>> = accounts.into_iter().map(Some).collect();
    let mut after: Vec<Account> = Vec::with_capacity(candidates.len());
    for (n, candidate) in candidates.iter().enumerate() {
        let &Candidate {
            parent,
            kind,
            log_likelihood,
        } = candidate;
        let again = candidates[n + 1..].iter().any(|c| c.parent == parent);
        let account = if again {
            accounts[parent].clone()
        } else {
            accounts[parent].take()
        };
        let Some(mut account) = account else { continue };
        account.log_likelihood = log_likelihood;
        match kind {
            Kind::Truth => {
                let (surprise, room, deviates) = &mut surprises[parent];
                account.drift.count(weight, *deviates);
                account.lately.count(0);
                account.belief.believe(surprise, room, &mut account.told);
            }
            Kind::Outlier => {
                account.unbelieved();
                account.marks.outliers.push(k);
            }
            Kind::Jump(axes, size) => {
                account.belief.loosen(mishaps.jumped(axes, size));
                let mut room = Room::of(account.belief.shape);
                let surprise = account.belief.weigh(row, rates, &common.mean, &mut room);
                let told = &mut account.told;
                account.belief.believe(&surprise, &mut room, told);
                let each = [0, 1].into_iter().filter(|&axis| axes[axis]);
                account.marks.jumps.extend(each.map(|axis| (k, axis)));
                // what came before it says nothing of what comes after
                account.drift = Drift::default();
                account
                    .lately
                    .count(axes.into_iter().filter(|it| *it).count());
            }
        }
        after.push(account);
    }
    after
}
