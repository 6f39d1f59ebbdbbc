//! Outliers and jumps among the records of one heliostat, decided once all of them are known: the accounts of
//! [`hypotheses`](super::hypotheses) side by side in lanes.

use helio_core::SimdLevel;
use helio_core::lanes::{BLOCK, Kernel, Lanes, run};

use super::belief::{Belief, REFERENCES, Room, Shape, Surprise, Tied, Told, WANDERING, at, column};
use super::hyper::{Hyper, Marks, waited};
use super::hypotheses::{Candidate, GIVEN_UP, Held, Kind, MOST, Mishaps, chosen};
use crate::field::lane::{Eight, Lane};
use crate::model::Real;

const _: () = assert!(MOST <= BLOCK, "each account has a lane");

/// Records whose determinants are multiplied before a logarithm is taken.
const TOGETHER: usize = 8;

/// What is known before the first record, and how often things go wrong.
#[derive(Debug)]
pub(super) struct Judge<'a> {
    /// Of the records: causes that are held to zero are not in them.
    pub shape: Shape,
    /// Which causes are.
    pub causes: &'a [usize],
    pub hyper: &'a Hyper,
    /// What is common: its mean, and its covariance row by row.
    pub common: (&'a [f64], &'a [f64]),
    pub mishaps: &'a Mishaps,
}

impl Judge<'_> {
    /// Decides about the records of a heliostat, in time: its linearised records one after the other. Once what
    /// came to pass up to record `last` is decided, those after it are taken as they are.
    pub fn marks(&self, level: SimdLevel, rows: &[f64], last: usize) -> Marks {
        run(
            level,
            Records {
                judge: self,
                rows,
                last,
            },
        )
    }
}

/// What was taken to have happened at a record, and before it.
struct Event {
    before: Option<usize>,
    record: usize,
    kind: Kind,
}

struct Records<'a> {
    judge: &'a Judge<'a>,
    rows: &'a [f64],
    last: usize,
}

/// Of the accounts.
struct Likelihood {
    /// Logarithms; minus infinity where a lane has no account.
    logarithm: Eight,
    /// Sum of squares and product of determinants that these do not hold yet.
    square: Eight,
    determinant: Eight,
    waiting: usize,
}

impl Likelihood {
    /// Whether all accounts but one are given up.
    fn decided(&self) -> bool {
        let best = self
            .logarithm
            .iter()
            .fold(f64::NEG_INFINITY, |m, x| m.max(*x));
        let left = self.logarithm.iter().filter(|x| **x > best - GIVEN_UP);
        left.count() == 1
    }

    fn settle(&mut self) {
        for lane in 0..BLOCK {
            if self.logarithm[lane] > f64::NEG_INFINITY {
                let twice = self.square[lane] + libm::log(self.determinant[lane]);
                self.logarithm[lane] -= 0.5 * twice;
            }
        }
        self.square = [0.0; BLOCK];
        self.determinant = [1.0; BLOCK];
        self.waiting = 0;
    }
}

impl Kernel for Records<'_> {
    type Output = Marks;
    #[inline(always)]
    fn run<L: Lanes>(self) -> Marks {
        let Judge {
            shape,
            causes,
            hyper,
            common: (common, common_covariance),
            mishaps,
        } = *self.judge;
        let rates = hyper.rates();
        let alone = Shape {
            still: shape.still,
            causes: 0,
            tied: Tied::Nothing,
        };
        let zero = Lane::<L>::splat(0.0);
        let mut first = Belief::<Lane<L>>::of_field(alone, &hyper.spread, &rates);
        for i in 0..shape.still {
            first.mean[i] = Lane::splat(common[i]);
            for j in 0..=i {
                let mean = Lane::splat(common_covariance[i * common.len() + j]);
                first.set_covariance(i, j, first.covariance(i, j) + mean);
            }
        }
        let chunks = BLOCK / L::WIDTH;
        let mut beliefs = vec![first; chunks];
        let mut rooms = vec![Room::of(alone); chunks];
        let mut surprises: Vec<Surprise<Lane<L>>> = Vec::with_capacity(chunks);
        let mut told = Told::nothing(alone);
        let mut likelihood = Likelihood {
            logarithm: [f64::NEG_INFINITY; BLOCK],
            square: [0.0; BLOCK],
            determinant: [1.0; BLOCK],
            waiting: 0,
        };
        likelihood.logarithm[0] = 0.0;
        let mut events: Vec<Event> = Vec::new();
        let mut last: [Option<usize>; BLOCK] = [None; BLOCK];
        let mut candidates = Vec::new();
        let rest = shape.row() - column::REST;
        let mut row = vec![zero; alone.row()];
        let rest_alone = alone.row() - column::REST;
        for (k, numbers) in self.rows.chunks_exact(shape.row()).enumerate() {
            for (to, from) in row.iter_mut().zip(&numbers[..rest_alone]) {
                *to = Lane::splat(*from);
            }
            for (to, from) in row[rest_alone..].iter_mut().zip(&numbers[rest..]) {
                *to = Lane::splat(*from);
            }
            for i in 0..2 {
                let mut seen = numbers[rest + column::SEEN + i];
                for (n, cause) in causes.iter().enumerate() {
                    seen -= numbers[2 * (shape.still + n) + i] * common[shape.still + cause];
                }
                row[rest_alone + column::SEEN + i] = Lane::splat(seen);
            }
            let (kept, added) = waited(&rates, numbers[rest + column::DAYS]);
            let mut kept_lanes = [zero; WANDERING];
            let mut added_lanes = [zero; WANDERING];
            for i in 0..WANDERING {
                kept_lanes[i] = Lane::splat(kept[i]);
                added_lanes[i] = Lane::splat(added[i]);
            }
            let silent = numbers[rest + column::SILENT] != 0.0;
            surprises.clear();
            let mut squares = [0.0; BLOCK];
            let mut determinants = [1.0; BLOCK];
            for (chunk, (belief, room)) in beliefs.iter_mut().zip(&mut rooms).enumerate() {
                belief.wait(kept_lanes, added_lanes);
                if !silent {
                    let surprise = belief.weigh(&row, &rates, &[], room);
                    surprise.square().write(&mut squares, chunk * L::WIDTH);
                    surprise
                        .determinant()
                        .write(&mut determinants, chunk * L::WIDTH);
                    surprises.push(surprise);
                }
            }
            if silent {
                continue;
            }
            let doubtful = |logarithm: &Eight| {
                (0..BLOCK).any(|lane| {
                    logarithm[lane] > f64::NEG_INFINITY
                        && mishaps.doubts(squares[lane], determinants[lane])
                })
            };
            if !doubtful(&likelihood.logarithm) {
                for ((belief, room), surprise) in beliefs.iter_mut().zip(&mut rooms).zip(&surprises)
                {
                    belief.believe(surprise, room, &mut told);
                }
                for lane in 0..BLOCK {
                    likelihood.square[lane] += squares[lane];
                    likelihood.determinant[lane] *= determinants[lane];
                }
                likelihood.waiting += 1;
                if likelihood.waiting == TOGETHER {
                    likelihood.settle();
                    if k > self.last && likelihood.decided() {
                        break;
                    }
                }
                continue;
            }
            likelihood.settle();
            let slopes = REFERENCES.map(|i| [numbers[2 * i], numbers[2 * i + 1]]);
            let held = held_by(&surprises);
            candidates.clear();
            for lane in 0..BLOCK {
                let of = (lane, likelihood.logarithm[lane]);
                if of.1 > f64::NEG_INFINITY {
                    mishaps.accounts(of, (&held[lane], squares[lane]), slopes, &mut candidates);
                }
            }
            chosen(&mut candidates);
            let mut jumped = [[0.0; BLOCK]; 2];
            let mut live = [1.0; BLOCK];
            let before = last;
            likelihood.logarithm = [f64::NEG_INFINITY; BLOCK];
            for (lane, candidate) in candidates.iter().enumerate() {
                likelihood.logarithm[lane] = candidate.log_likelihood;
                last[lane] = before[candidate.parent];
                match candidate.kind {
                    Kind::Truth => continue,
                    Kind::Outlier => live[lane] = 0.0,
                    Kind::Jump(axes, size) => {
                        for (to, variance) in jumped.iter_mut().zip(mishaps.jumped(axes, size)) {
                            to[lane] = variance;
                        }
                    }
                }
                events.push(Event {
                    before: last[lane],
                    record: k,
                    kind: candidate.kind,
                });
                last[lane] = Some(events.len() - 1);
            }
            rearrange(&mut beliefs, &candidates);
            for (chunk, (belief, room)) in beliefs.iter_mut().zip(&mut rooms).enumerate() {
                let lane = chunk * L::WIDTH;
                belief.loosen([Lane::read(&jumped[0], lane), Lane::read(&jumped[1], lane)]);
                let mut surprise = belief.weigh(&row, &rates, &[], room);
                surprise.mute(Lane::read(&live, lane));
                belief.believe(&surprise, room, &mut told);
            }
        }
        likelihood.settle();
        let mut best = 0;
        for lane in 1..BLOCK {
            if likelihood.logarithm[lane] > likelihood.logarithm[best] {
                best = lane;
            }
        }
        let mut marks = Marks::default();
        let mut next = last[best];
        while let Some(event) = next.map(|n| &events[n]) {
            match event.kind {
                Kind::Truth => {}
                Kind::Outlier => marks.outliers.push(event.record),
                Kind::Jump(axes, _) => {
                    let each = [1, 0].into_iter().filter(|&axis| axes[axis]);
                    marks.jumps.extend(each.map(|axis| (event.record, axis)));
                }
            }
            next = event.before;
        }
        marks.outliers.reverse();
        marks.jumps.reverse();
        marks
    }
}

/// A record as every account has it.
#[inline(always)]
fn held_by<L: Lanes>(surprises: &[Surprise<Lane<L>>]) -> [Held; BLOCK] {
    let mut covariance = [[0.0; BLOCK]; 3];
    let mut left = [[0.0; BLOCK]; 2];
    for (chunk, surprise) in surprises.iter().enumerate() {
        let (s, y) = surprise.plain();
        for i in 0..3 {
            s[i].write(&mut covariance[i], chunk * L::WIDTH);
        }
        for i in 0..2 {
            y[i].write(&mut left[i], chunk * L::WIDTH);
        }
    }
    let mut held = [Held {
        covariance: [1.0, 0.0, 1.0],
        left: [0.0; 2],
    }; BLOCK];
    for lane in 0..BLOCK {
        held[lane] = Held {
            covariance: [
                covariance[0][lane],
                covariance[1][lane],
                covariance[2][lane],
            ],
            left: [left[0][lane], left[1][lane]],
        };
    }
    held
}

/// Brings to each lane what its candidate's parent knows.
#[inline(always)]
fn rearrange<L: Lanes>(beliefs: &mut [Belief<Lane<L>>], candidates: &[Candidate]) {
    if candidates
        .iter()
        .enumerate()
        .all(|(lane, candidate)| candidate.parent == lane)
    {
        return;
    }
    let own = beliefs.first().map_or(0, |b| b.shape.own());
    let mut columns = vec![[0.0; BLOCK]; own + Shape::triangle(own)];
    for (chunk, belief) in beliefs.iter().enumerate() {
        let lane = chunk * L::WIDTH;
        for i in 0..own {
            belief.mean[i].write(&mut columns[i], lane);
            for j in 0..=i {
                belief
                    .covariance(i, j)
                    .write(&mut columns[own + at(i, j)], lane);
            }
        }
    }
    for column in &mut columns {
        let old = *column;
        for (to, candidate) in column.iter_mut().zip(candidates) {
            *to = old[candidate.parent];
        }
    }
    for (chunk, belief) in beliefs.iter_mut().enumerate() {
        let lane = chunk * L::WIDTH;
        for i in 0..own {
            belief.mean[i] = Lane::read(&columns[i], lane);
            for j in 0..=i {
                belief.set_covariance(i, j, Lane::read(&columns[own + at(i, j)], lane));
            }
        }
    }
}
