//! What most records agree on, and which do not fit.

use faer::Mat;

use super::joint::{Columns, Frame, Judge, Model, Record, solve, squares};
use crate::loss::median;
use crate::parameters::Parameters;
use crate::random::Random;

/// Subsets tried by least trimmed squares.
const SUBSETS: usize = 100;
/// Subsets that are followed to their end.
const FOLLOWED: usize = 6;
/// Records of a subset: two equations each, one more than six angles need.
const SUBSET: usize = 4;
/// Records farther than this many scales stick out; ...
const STICKING_OUT: f64 = 4.5;
/// ... one in so many is few.
const FEW: usize = 5;
/// Median of the length of two unit normal deviates.
const MEDIAN_RADIUS: f64 = 1.177_41;
/// Degrees of freedom of a scale from the median, over those of one from the sum of squares. Records have longer
/// tails than the normal distribution; the median does not take them for noise.
const MEDIAN_EFFICIENCY: f64 = 0.5;
/// No record nearer than this many systematic floors is left out for what the median says: most records may
/// be of one day, and another day differs by what a mount does beyond six angles.
const MEDIAN_FLOORS: f64 = 8.0;
/// Chance that a clean campaign loses a record to the test.
const FALSE_REJECTION: f64 = 0.01;
/// No record nearer than this many systematic floors is left out.
const NEAREST_FLOORS: f64 = 3.0;

/// Scale per direction \[mrad\] of squared residuals around a model of `parameters` parameters.
pub fn scale_of(squares: &[f64], parameters: usize, least: f64) -> f64 {
    let equations = 2.0 * squares.len() as f64;
    let lost = (equations / (equations - parameters as f64).max(1.0)).min(4.0);
    let middle = median(squares.iter().map(|s| libm::sqrt(*s)).collect());
    (libm::sqrt(lost) * middle / MEDIAN_RADIUS).max(least)
}

/// Student's t from a start, with the scale estimated between rounds.
pub fn student(
    frame: &Frame,
    records: &[Record],
    epochs: &[usize],
    marks: &[bool],
    start: Model,
    least: f64,
) -> (Model, f64) {
    let parameters = Columns::new(frame, start.references.len()).count();
    let mut model = start;
    let scale = |model: &Model| {
        let used: Vec<f64> = squares(records, epochs, model)
            .into_iter()
            .zip(marks)
            .filter_map(|(s, &m)| m.then_some(s))
            .collect();
        scale_of(&used, parameters, least)
    };
    let mut now = scale(&model);
    for _ in 0..12 {
        model = solve(
            frame,
            records,
            epochs,
            model,
            Judge::Student(marks, now),
            15,
        )
        .0;
        let next = scale(&model);
        let settled = (next - now).abs() < 0.01 * now;
        now = next;
        if settled {
            break;
        }
    }
    (model, now)
}

fn smallest(values: &[f64], count: usize) -> (Vec<bool>, f64) {
    let mut order: Vec<usize> = (0..values.len()).collect();
    order.sort_by(|&i, &j| values[i].total_cmp(&values[j]).then(i.cmp(&j)));
    let mut marks = vec![false; values.len()];
    let mut sum = 0.0;
    for &i in &order[..count] {
        marks[i] = true;
        sum += values[i];
    }
    (marks, sum)
}

/// Least trimmed squares (Rousseeuw, Van Driessen 2006): the one-epoch model that somewhat more than half of the records fit best.
fn trimmed(frame: &Frame, records: &[Record], start: &Parameters, seed: u64) -> Model {
    let n = records.len();
    let epochs = vec![0; n];
    // one record more than half, and for each two parameters another half
    let half = ((n + 1 + frame.count().div_ceil(2)) / 2).clamp(1, n);
    let start = Model::single(start);
    let mut random = Random::new(seed);
    let mut tried: Vec<(f64, usize, Model)> = Vec::new();
    let concentrate = |model: Model, iterations: usize| {
        let (marks, _) = smallest(&squares(records, &epochs, &model), half);
        let model = solve(
            frame,
            records,
            &epochs,
            model,
            Judge::Marked(&marks),
            iterations,
        )
        .0;
        let (_, sum) = smallest(&squares(records, &epochs, &model), half);
        (sum, model)
    };
    for subset in 0..SUBSETS {
        let mut marks = vec![false; n];
        let mut left = SUBSET.min(n);
        while left > 0 {
            let i = random.below(n);
            if !marks[i] {
                marks[i] = true;
                left -= 1;
            }
        }
        let first = records
            .iter()
            .zip(&marks)
            .filter_map(|(r, &m)| m.then_some(*r))
            .collect::<Vec<_>>();
        let few = vec![true; first.len()];
        let (model, _) = solve(
            frame,
            &first,
            &epochs[..first.len()],
            start.clone(),
            Judge::Marked(&few),
            4,
        );
        let (sum, model) = concentrate(model, 2);
        tried.push((sum, subset, model));
    }
    tried.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
    tried
        .into_iter()
        .take(FOLLOWED)
        .map(|(mut sum, _, mut model)| {
            for _ in 0..20 {
                let (next, better) = concentrate(model.clone(), 6);
                if next >= sum * (1.0 - 1e-6) {
                    break;
                }
                (sum, model) = (next, better);
            }
            (sum, model)
        })
        .min_by(|a, b| a.0.total_cmp(&b.0))
        .map_or(start, |(_, model)| model)
}

/// A one-epoch model that wrong records do not spoil, and its scale per direction \[mrad\].
pub fn start(
    frame: &Frame,
    records: &[Record],
    elected: &Parameters,
    seed: u64,
    least: f64,
) -> (Model, f64) {
    let epochs = vec![0; records.len()];
    let marks = vec![true; records.len()];
    let plain = student(
        frame,
        records,
        &epochs,
        &marks,
        Model::single(elected),
        least,
    );
    let far = (STICKING_OUT * plain.1) * (STICKING_OUT * plain.1);
    let sticking_out = squares(records, &epochs, &plain.0)
        .into_iter()
        .filter(|&square| square > far)
        .count();
    // Most records agree closely and the others stick out: subsets would find the same.
    if plain.1 < 6.0 * least && sticking_out * FEW <= records.len() {
        return plain;
    }
    let model = trimmed(frame, records, elected, seed);
    student(frame, records, &epochs, &marks, model, least)
}

/// Which records fit: alternately a least-squares fit of those that do, and a test of every record against it.
///
/// A kept record is judged by its residual over what the fit leaves it, a left-out one over what the
/// fit predicts for it, so that a record far from the others is not blamed for the others' ignorance.
pub fn sift(
    frame: &Frame,
    records: &[Record],
    epochs: &[usize],
    start: Model,
    scale: f64,
    floor_mrad: f64,
) -> (Model, Vec<bool>, f64) {
    let parameters = Columns::new(frame, start.references.len()).count();
    let nearest = NEAREST_FLOORS * floor_mrad;
    let first = squares(records, epochs, &start);
    let mut keep: Vec<bool> = first
        .iter()
        .zip(records)
        .map(|(square, r)| {
            let radius = libm::sqrt(*square);
            radius < (4.0 * scale).max(nearest * r.precision)
        })
        .collect();
    let mut model = start;
    let mut sigma = scale;
    let mut seen: Vec<Vec<bool>> = Vec::new();
    for _ in 0..10 {
        let kept = keep.iter().filter(|&&k| k).count();
        model = solve(frame, records, epochs, model, Judge::Marked(&keep), 20).0;
        let now = squares(records, epochs, &model);
        let sum: f64 = now
            .iter()
            .zip(&keep)
            .filter_map(|(s, &k)| k.then_some(*s))
            .sum();
        let freedom = (2 * kept) as f64 - parameters as f64;
        if freedom < 2.0 {
            break;
        }
        sigma = libm::sqrt(sum / freedom);
        let tested = outside(frame, records, epochs, &model, &keep);
        let chance = FALSE_REJECTION / records.len() as f64;
        let of_kept: Vec<f64> = now
            .iter()
            .zip(&keep)
            .filter_map(|(s, &k)| k.then_some(*s))
            .collect();
        let least = 0.5 * floor_mrad;
        let middle = scale_of(&of_kept, parameters, least);
        let next: Vec<bool> = (0..records.len())
            .map(|i| {
                let d = if keep[i] { freedom - 2.0 } else { freedom }.max(1.0);
                // a left-out record is not in the sum; a kept one is taken out
                let others = if keep[i] {
                    (sum - tested[i]).max(0.0) / d
                } else {
                    sum / d
                };
                let far = MEDIAN_FLOORS * floor_mrad;
                let by_median = middle * middle * tail(chance, MEDIAN_EFFICIENCY * d);
                let limit =
                    (others.max(least * least) * tail(chance, d)).min(by_median.max(far * far));
                tested[i] <= limit || libm::sqrt(now[i]) < nearest * records[i].precision
            })
            .collect();
        if next == keep || seen.contains(&next) {
            break;
        }
        seen.push(core::mem::replace(&mut keep, next));
    }
    (model, keep, sigma)
}

/// Squared length, in squared scales, that two normal deviates exceed with this chance when the scale was
/// estimated with d degrees of freedom: F(2, d) has a tail in closed form, (1 + 2 f/d)^(-d/2).
fn tail(chance: f64, d: f64) -> f64 {
    d * (libm::pow(chance, -2.0 / d) - 1.0)
}

/// For each record the square of its residual in the metric of what is expected of it: (I - H)⁻¹ for a
/// kept one, (I + H)⁻¹ for a left-out one, with H its 2×2 part of the hat matrix.
fn outside(
    frame: &Frame,
    records: &[Record],
    epochs: &[usize],
    model: &Model,
    keep: &[bool],
) -> Vec<f64> {
    let columns = Columns::new(frame, model.references.len());
    let n = columns.count();
    let poses = model.poses();
    let mut all = Mat::<f64>::zeros(2 * records.len(), n);
    let mut used = Mat::<f64>::zeros(2 * records.len(), n);
    let mut residuals = Vec::with_capacity(records.len());
    for (i, (record, &epoch)) in records.iter().zip(epochs).enumerate() {
        let (r, slopes) = record.linearised(&poses[epoch]);
        residuals.push(r.map(|x| x * record.precision));
        for (c, slopes) in slopes.iter().enumerate() {
            columns.place(epoch, slopes, |column, value| {
                let value = record.precision * value;
                all[(2 * i + c, column)] = value;
                if keep[i] {
                    used[(2 * i + c, column)] = value;
                }
            });
        }
    }
    let plain = || {
        residuals
            .iter()
            .map(|r| r[0] * r[0] + r[1] * r[1])
            .collect()
    };
    let Ok(svd) = used.thin_svd() else {
        return plain();
    };
    let (v, s) = (svd.V(), svd.S().column_vector());
    let rank = (0..n).filter(|&k| s[k] > 1e-9 * s[0]).count();
    let scaled = &all * v;
    (0..records.len())
        .map(|i| {
            let mut h = [[0.0; 2]; 2];
            for k in 0..rank {
                let l = [scaled[(2 * i, k)] / s[k], scaled[(2 * i + 1, k)] / s[k]];
                for a in 0..2 {
                    for b in 0..2 {
                        h[a][b] += l[a] * l[b];
                    }
                }
            }
            let sign = if keep[i] { -1.0 } else { 1.0 };
            let m = [
                [1.0 + sign * h[0][0], sign * h[0][1]],
                [sign * h[1][0], 1.0 + sign * h[1][1]],
            ];
            let r = residuals[i];
            let determinant = m[0][0] * m[1][1] - m[0][1] * m[1][0];
            if determinant <= 1e-6 {
                // the record alone determines something: the fit cannot judge it
                return 0.0;
            }
            (r[0] * (m[1][1] * r[0] - m[0][1] * r[1]) + r[1] * (m[0][0] * r[1] - m[1][0] * r[0]))
                / determinant
        })
        .collect()
}
