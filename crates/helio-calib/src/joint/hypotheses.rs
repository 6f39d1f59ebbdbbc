//! Outlier or jump: what becomes of a record that nobody expected.
//!
//! Several accounts of a heliostat's records are carried side by side: that a record tells the truth, that
//! its spot was found in a wrong place, that a zero point jumped just before it. The records to come decide.

use super::belief::{Belief, Rates, Shape, Surprise, Told, column};
use super::hyper::{Hyper, Marks, waited};
use super::rows::Rows;

/// How often things go wrong.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Mishaps {
    /// Probability that a record's spot was found in a wrong place.
    pub outlier: f64,
    /// How far off, one standard deviation of either component \[mrad\].
    pub outlier_mrad: f64,
    /// Probability that the zero point of one axis jumped before a record.
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
pub(super) const DOUBTFUL: f64 = 6.0;
/// Variance of what was expected, of that of spots in wrong places, above which a record may be one however near it lies.
const VAGUE: f64 = 0.02;
/// Accounts carried on at most.
const MOST: usize = 8;
/// An account less likely than the best by this (logarithm) is given up.
const GIVEN_UP: f64 = 12.0;

/// One account of what happened.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Account {
    /// Less that of the likeliest.
    pub log_likelihood: f64,
    pub belief: Belief<f64>,
    /// What its records tell of what is common, since that was last taken from it.
    pub told: Told<f64>,
    pub marks: Marks,
}

impl Account {
    pub fn new(belief: Belief<f64>) -> Self {
        Self {
            log_likelihood: 0.0,
            told: Told::nothing(belief.shape),
            belief,
            marks: Marks::default(),
        }
    }
}

fn log_density(surprise: &Surprise<f64>) -> f64 {
    -0.5 * (surprise.square + surprise.log_determinant())
}

/// Decides about every record of a heliostat, in time, the common unknowns taken as known.
pub(super) fn judge(
    shape: Shape,
    rows: &Rows,
    hyper: &Hyper,
    (common, common_covariance): (&[f64], &[f64]),
    mishaps: &Mishaps,
) -> Marks {
    let rates = hyper.rates();
    let alone = Shape {
        tied: false,
        ..shape
    };
    let mut belief = Belief::of_field(alone, &hyper.spread, &rates);
    belief.mean[..shape.still].copy_from_slice(&common[..shape.still]);
    for i in 0..shape.still {
        for j in 0..=i {
            belief.spread[super::belief::at(i, j)] += common_covariance[i * common.len() + j];
        }
    }
    let mut accounts = vec![Account::new(belief)];
    let rest = shape.row() - column::REST;
    let mut row = vec![0.0; shape.row()];
    for k in 0..rows.len() {
        row.copy_from_slice(rows.row(shape, k));
        for cause in 0..shape.causes {
            let value = common[shape.still + cause];
            for i in 0..2 {
                row[rest + column::SEEN + i] -= row[2 * shape.still + 2 * cause + i] * value;
            }
        }
        let (kept, added) = waited(&rates, row[rest + column::DAYS]);
        for account in &mut accounts {
            account.belief.wait(kept, added);
        }
        if row[rest + column::SILENT] == 0.0 {
            accounts = told_by(accounts, k, &row, &rates, mishaps, &[]);
        }
    }
    accounts
        .into_iter()
        .next()
        .map(|best| best.marks)
        .unwrap_or_default()
}

/// The accounts after record number `k`, likeliest first. Where beliefs are tied to what is common, that is
/// taken as `common` to judge by.
pub(super) fn told_by(
    accounts: Vec<Account>,
    k: usize,
    row: &[f64],
    rates: &Rates,
    mishaps: &Mishaps,
    common: &[f64],
) -> Vec<Account> {
    let truth = libm::log(1.0 - mishaps.outlier - mishaps.jump);
    let scatter = mishaps.outlier_mrad * mishaps.outlier_mrad;
    let mut after: Vec<Account> = Vec::with_capacity(accounts.len() * 4);
    for mut account in accounts {
        let as_it_is = account.belief.weigh(row, rates, 0.0, common);
        let unexpected = as_it_is.square > DOUBTFUL;
        // Where so little is known that a spot in a wrong place would not stand out, it may be one all the same.
        let vague = 0.5 * as_it_is.log_determinant() > libm::log(VAGUE * scatter);
        if unexpected || vague {
            for axis in (0..2).filter(|_| unexpected) {
                let mut jumped = account.clone();
                let mut variances = [0.0; 2];
                variances[axis] = mishaps.jump_mrad * mishaps.jump_mrad;
                jumped.belief.loosen(variances);
                let surprise = jumped.belief.weigh(row, rates, 0.0, common);
                jumped.log_likelihood += libm::log(0.5 * mishaps.jump) + log_density(&surprise);
                jumped.belief.believe(&surprise, &mut jumped.told);
                jumped.marks.jumps.push((k, axis));
                after.push(jumped);
            }
            let mut wrong = account.clone();
            let surprise = wrong.belief.weigh(row, rates, scatter, common);
            wrong.log_likelihood += libm::log(mishaps.outlier) + log_density(&surprise);
            wrong.marks.outliers.push(k);
            after.push(wrong);
            // weighed anew: the room of the belief holds the last record weighed
            account.belief.weigh(row, rates, 0.0, common);
        }
        account.log_likelihood += truth + log_density(&as_it_is);
        account.belief.believe(&as_it_is, &mut account.told);
        after.push(account);
    }
    after.sort_by(|a, b| b.log_likelihood.total_cmp(&a.log_likelihood));
    let best = after.first().map_or(0.0, |a| a.log_likelihood);
    after.retain(|a| a.log_likelihood > best - GIVEN_UP);
    after.truncate(MOST);
    for account in &mut after {
        account.log_likelihood -= best;
    }
    after
}
