//! Zero-point jumps: where in time the encoder references change.

use super::joint::{Frame, Model, REFERENCES, Record, squares};
use super::robust::{scale_of, student};
use crate::model::Pose;

/// Fewest records of an epoch: two wrong records in a row are no epoch.
pub const SHORTEST: usize = 3;
/// A record costs at most this many scales squared, so that a wrong one makes no epoch.
const MOST: f64 = 16.0;
/// A change that lowers a cost by less than this many scales squared is at its best.
const SETTLED: f64 = 1e-4;
/// A record that is nearer to its spot than this many scales asks for no other references.
const EXACT_SCALES: f64 = 1e-4;
/// Cost of a change: this many times the logarithm of the number of records, in scales squared.
const PENALTY: f64 = 6.0;
/// A change must be larger than this many of its standard deviations ...
const SIGMAS: f64 = 4.0;
/// ... and than this many systematic floors \[beam\].
const FLOORS: f64 = 4.0;
/// A linear drive whose zero point jumps moves its axis by nearly, not exactly, the same angle everywhere: this
/// share of the change may be missing from a record.
const UNEVEN: f64 = 0.03;
/// Records of a block whose least cost is known beforehand.
const BLOCK: usize = 8;
/// The cost of an epoch is found from two starts and may be this much too large, in scales squared.
const SLACK: f64 = 5.0;
/// Most boundaries that are looked at exactly.
const EXACT: usize = 260;

/// Epochs as first records; the first is 0.
pub type Cuts = Vec<usize>;

pub fn epoch_of(cuts: &[usize], count: usize) -> Vec<usize> {
    let mut epochs = vec![0; count];
    for (i, epoch) in epochs.iter_mut().enumerate() {
        *epoch = cuts.partition_point(|&c| c <= i) - 1;
    }
    epochs
}

/// What a change of the references does to a residual, both over the scale.
#[derive(Clone, Copy)]
struct Linear {
    r: [f64; 2],
    g: [[f64; 2]; 2],
}

impl Linear {
    /// What a change does to the beam, in scales.
    fn effect(&self, d: [f64; 2]) -> [f64; 2] {
        self.g.map(|g| g[0] * d[0] + g[1] * d[1])
    }

    fn square(&self, d: [f64; 2]) -> f64 {
        let effect = self.effect(d);
        let left = [self.r[0] + effect[0], self.r[1] + effect[1]];
        length2(left) / (1.0 + UNEVEN * UNEVEN * length2(effect))
    }
}

fn length2(x: [f64; 2]) -> f64 {
    x[0] * x[0] + x[1] * x[1]
}

/// Sums for the best change of some records.
#[derive(Clone, Copy, Default)]
struct Normal {
    a: [f64; 3],
    b: [f64; 2],
}

impl Normal {
    fn add(&mut self, l: &Linear, weight: f64) {
        for k in 0..2 {
            let [p, q] = l.g[k];
            self.a[0] += weight * p * p;
            self.a[1] += weight * p * q;
            self.a[2] += weight * q * q;
            self.b[0] -= weight * p * l.r[k];
            self.b[1] -= weight * q * l.r[k];
        }
    }

    fn solve(&self) -> [f64; 2] {
        // a held reference has no slope: its change is zero
        let a = [self.a[0] + 1e-9, self.a[1], self.a[2] + 1e-9];
        let determinant = a[0] * a[2] - a[1] * a[1];
        [
            (a[2] * self.b[0] - a[1] * self.b[1]) / determinant,
            (a[0] * self.b[1] - a[1] * self.b[0]) / determinant,
        ]
    }
}

/// Capped cost of some records with one change of the references, from the better of two starts.
fn capped(records: &[Linear], warm: [f64; 2]) -> (f64, [f64; 2]) {
    let total = |d: [f64; 2]| -> f64 { records.iter().map(|l| l.square(d).min(MOST)).sum() };
    let mut all = Normal::default();
    for l in records {
        all.add(l, 1.0);
    }
    let plain = all.solve();
    let mut best = (total(warm), warm);
    let cost = total(plain);
    if cost < best.0 {
        best = (cost, plain);
        if records.iter().all(|l| l.square(plain) < MOST) {
            return best;
        }
    }
    for _ in 0..3 {
        let mut near = Normal::default();
        for l in records {
            let square = l.square(best.1);
            // Tukey's bisquare, the smooth form of the cap
            let z = 1.0 - square / (2.0 * MOST);
            if z > 0.0 {
                near.add(l, z * z);
            }
        }
        let d = near.solve();
        let cost = total(d);
        if cost >= best.0 {
            break;
        }
        let settled = best.0 - cost < SETTLED;
        best = (cost, d);
        if settled {
            break;
        }
    }
    best
}

/// Sums over whole blocks of what their records cost at least, whatever the epochs: entry k is of the first k.
fn least(records: &[Linear]) -> Vec<f64> {
    let mut sum = 0.0;
    let of = |block: &[Linear]| {
        let all = capped(block, [0.0; 2]).0;
        if all < MOST {
            return all;
        }
        // some are far off: each may be the one to start from
        let starts = block.iter().map(|l| {
            let mut own = Normal::default();
            own.add(l, 1.0);
            capped(block, own.solve()).0
        });
        starts.fold(all, f64::min)
    };
    let blocks = records.chunks_exact(BLOCK).map(|block| {
        sum += of(block);
        sum
    });
    core::iter::once(0.0).chain(blocks).collect()
}

/// What is known of epochs from one start on.
#[derive(Clone, Copy)]
struct From {
    /// Record after the last that was looked at.
    to: usize,
    cost: f64,
    change: [f64; 2],
}

/// Optimal segmentation (Jackson et al. 2005) with the bounded cost of Fearnhead and Rigaill 2019.
///
/// Epochs only become dearer as they grow, by no less than their new blocks cost by themselves: an epoch that
/// cannot be the cheapest is not computed.
fn segment(records: &[Linear], boundaries: &[usize]) -> Cuts {
    let n = records.len();
    let penalty = PENALTY * libm::log(n as f64);
    let least = least(records);
    // boundaries: ascending, first 0, last n
    let m = boundaries.len();
    let mut costs = vec![f64::INFINITY; m];
    let mut from = vec![0; m];
    costs[0] = 0.0;
    let mut known: Vec<From> = boundaries
        .iter()
        .map(|&to| From {
            to,
            cost: 0.0,
            change: [0.0; 2],
        })
        .collect();
    for end in 1..m {
        let last = boundaries[end];
        // the likeliest first
        for start in [from[end - 1], 0].into_iter().chain((1..end).rev()) {
            let first = boundaries[start];
            if last < first + SHORTEST || !costs[start].is_finite() {
                continue;
            }
            let before = costs[start] + if start > 0 { penalty } else { 0.0 };
            let of = &mut known[start];
            let blocks = of.to.div_ceil(BLOCK)..last / BLOCK;
            let grown = if blocks.is_empty() {
                0.0
            } else {
                least[blocks.end] - least[blocks.start]
            };
            if before + of.cost + grown >= costs[end] + SLACK {
                continue;
            }
            let (cost, change) = capped(&records[first..last], of.change);
            *of = From {
                to: last,
                cost,
                change,
            };
            if before + cost < costs[end] {
                (costs[end], from[end]) = (before + cost, start);
            }
        }
    }
    let mut cuts = Vec::new();
    let mut at = m - 1;
    while at > 0 {
        at = from[at];
        cuts.push(boundaries[at]);
    }
    cuts.reverse();
    if cuts.is_empty() { vec![0] } else { cuts }
}

/// Each record near the references that it asks for by itself, where a change that suits it is exact; all
/// changes count from the first epoch's references.
fn linear(records: &[Record], epochs: &[usize], model: &Model, scale: f64) -> Vec<Linear> {
    let poses = model.poses();
    let base = model.references[0];
    records
        .iter()
        .zip(epochs)
        .map(|(record, &epoch)| {
            let factor = record.precision / scale;
            let at = |pose: &Pose<f64>| {
                let (r, slopes) = record.linearised(pose);
                Linear {
                    r: r.map(|x| factor * x),
                    g: slopes.map(|s| REFERENCES.map(|k| factor * s[k])),
                }
            };
            let mut here = model.references[epoch];
            let mut best = at(&poses[epoch]);
            for _ in 0..4 {
                let mut own = Normal::default();
                own.add(&best, 1.0);
                let d = own.solve();
                let there = [here[0] + d[0], here[1] + d[1]];
                let mut parameters = model.parameters(epoch);
                for (k, value) in REFERENCES.into_iter().zip(there) {
                    parameters.values[k] = value;
                }
                let next = at(&Pose::of(&parameters));
                if length2(next.r) >= length2(best.r) {
                    break;
                }
                (here, best) = (there, next);
                if length2(best.r) < EXACT_SCALES * EXACT_SCALES {
                    break;
                }
            }
            let back = [base[0] - here[0], base[1] - here[1]];
            Linear {
                r: [0, 1].map(|c| best.r[c] + best.g[c][0] * back[0] + best.g[c][1] * back[1]),
                g: best.g,
            }
        })
        .collect()
}

/// The change between two epochs with the standard deviations and size that the records give it.
fn change(before: &[Linear], after: &[Linear], floors: f64) -> f64 {
    let (_, d0) = capped(before, [0.0; 2]);
    let (_, d1) = capped(after, [0.0; 2]);
    let d = [d1[0] - d0[0], d1[1] - d0[1]];
    // mean squared effect on the beams of both sides, in scales
    let all = before.len() + after.len();
    let effect: f64 = before
        .iter()
        .chain(after)
        .map(|l| length2(l.effect(d)))
        .sum::<f64>()
        / all as f64;
    // two directions; each epoch's mean has its own noise and a shared error that does not average out
    let noise = 2.0 * (1.0 / before.len() as f64 + 1.0 / after.len() as f64);
    let shared = 2.0 * floors * floors;
    libm::sqrt(effect / (SIGMAS * SIGMAS * noise + FLOORS * FLOORS * shared))
}

/// What an explanation of some records costs, to compare it with others: the less its epochs leave the better, but
/// each change has to earn as much as where it was found.
pub fn price(records: usize, cuts: &Cuts, scale: f64) -> f64 {
    let n = records as f64;
    2.0 * n * libm::log(scale) + PENALTY * libm::log(n) * (cuts.len() - 1) as f64
}

/// Epochs of records in order of time, and the model with references for each.
pub fn find(
    frame: &Frame,
    records: &mut [Record],
    start: Model,
    scale: f64,
    floor_mrad: f64,
) -> (Cuts, Model, f64) {
    let n = records.len();
    let precisions: Vec<f64> = records.iter().map(|r| r.precision).collect();
    let mut cuts: Cuts = vec![0];
    let mut model = start;
    let mut scale = scale;
    if n < 2 * SHORTEST + 1 || !frame.references_free() {
        return (cuts, model, scale);
    }
    let coarse: Vec<usize> = {
        let step = n.div_ceil(EXACT);
        (0..n).step_by(step).chain([n]).collect()
    };
    let marks = vec![true; n];
    for _ in 0..6 {
        for (record, &precision) in records.iter_mut().zip(&precisions) {
            record.precision = precision;
        }
        let flat = linear(records, &epoch_of(&cuts, n), &model, scale);
        let mut next = segment(&flat, &coarse);
        if n > EXACT {
            // every record near a coarse boundary, nothing elsewhere
            let step = n.div_ceil(EXACT);
            let mut fine: Vec<usize> = vec![0, n];
            for &cut in &next {
                fine.extend(cut.saturating_sub(step)..=(cut + step).min(n));
            }
            fine.sort_unstable();
            fine.dedup();
            next = segment(&flat, &fine);
        }
        prune(&flat, &mut next, floor_mrad / scale);
        let same = next == cuts;
        if same && cuts.len() == 1 {
            // one epoch, as the model has it
            let squares = squares(records, &vec![0; n], &model);
            scale = scale_of(&squares, frame.count(), floor_mrad).max(scale);
            break;
        }
        // references of each new epoch start from the best change
        let base = model.references[0];
        let ends = next.iter().skip(1).copied().chain([n]);
        let references = next
            .iter()
            .zip(ends)
            .map(|(&first, last)| {
                let (_, d) = capped(&flat[first..last], [0.0; 2]);
                [base[0] + d[0], base[1] + d[1]]
            })
            .collect();
        cuts = next;
        model = Model {
            shared: model.shared,
            references,
        };
        let epochs = epoch_of(&cuts, n);
        forgive(records, &epochs, &model, scale);
        let (better, now) = student(frame, records, &epochs, &marks, model, 0.5 * floor_mrad);
        model = better;
        let columns = frame.count() + 2 * (cuts.len() - 1);
        scale = scale_of(&squares(records, &epochs, &model), columns, floor_mrad).max(now);
        if same {
            break;
        }
    }
    (cuts, model, scale)
}

/// Lets records count less whose zero points jumped far from those of the longest epoch ([`UNEVEN`]).
fn forgive(records: &mut [Record], epochs: &[usize], model: &Model, scale: f64) {
    let mut counts = vec![0; model.references.len()];
    for &epoch in epochs {
        counts[epoch] += 1;
    }
    let longest = (0..counts.len())
        .rev()
        .max_by_key(|&k| counts[k])
        .unwrap_or(0);
    let poses = model.poses();
    for (record, &epoch) in records.iter_mut().zip(epochs) {
        let (_, slopes) = record.linearised(&poses[epoch]);
        let d = [0, 1].map(|k| model.references[epoch][k] - model.references[longest][k]);
        let effect = slopes.map(|s| {
            record.precision / scale * (s[REFERENCES[0]] * d[0] + s[REFERENCES[1]] * d[1])
        });
        record.precision /= libm::sqrt(1.0 + UNEVEN * UNEVEN * length2(effect));
    }
}

/// Takes changes out, least significant first, until all are significant.
fn prune(records: &[Linear], cuts: &mut Cuts, floors: f64) {
    while cuts.len() > 1 {
        let end = |k: usize| cuts.get(k + 1).copied().unwrap_or(records.len());
        let weakest = (1..cuts.len())
            .map(|k| {
                let before = &records[cuts[k - 1]..cuts[k]];
                let after = &records[cuts[k]..end(k)];
                (k, change(before, after, floors))
            })
            .min_by(|a, b| a.1.total_cmp(&b.1));
        match weakest {
            Some((k, size)) if size < 1.0 => {
                cuts.remove(k);
            }
            _ => break,
        }
    }
}
