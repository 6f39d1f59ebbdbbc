//! The direct solution of many rows, in phases.
//!
//! One row is a chain of some 300 cycles of latency; a processor that looks a few hundred instructions
//! ahead cannot fill it with other rows unless the body is short. So the formula is cut into phases, each a
//! short loop over a tile of rows with its results in the nearest cache: the next rows then fill
//! the gaps, and throughput, not latency, is what limits.

use super::limits::LimitSource;
use super::mount::{Constants, Pose, alpha, pose};
use super::normal::{Bisector, OffsetSource, doubt};
use super::pose_errors::PoseErrorSource;
use super::{Job, Rows, SunSource};
use crate::lanes::math::Reduced;
use crate::lanes::{BLOCK, Lanes, prefetch};
use crate::status::Status;
use crate::tracking::prepared::{TILE, column};

type Column = [f64; BLOCK];

/// What the phases hand on, for one block of rows: columns by [`slot`].
#[derive(Clone, Copy)]
#[repr(C, align(64))]
struct Between([Column; slot::COUNT]);

/// Columns of [`Between`]. What a phase leaves takes the place of what it was the last to read: half
/// the memory, and so less of the nearest cache.
mod slot {
    pub const COS_THETA: usize = 0;
    pub const SIN_SQ_THETA: usize = 1;
    pub const INVERSE_COS: usize = 2;
    pub const K: usize = 3;
    /// Two: base and component.
    pub const THETA: usize = 4;
    /// Three.
    pub const NORMAL: usize = 6;

    pub const C1: usize = NORMAL;
    pub const C2: usize = NORMAL + 1;
    pub const D2: usize = NORMAL + 2;
    pub const SINE: usize = THETA;
    pub const LEVEL_SQ: usize = THETA + 1;
    pub const D1: usize = INVERSE_COS;
    pub const DOUBT: usize = SIN_SQ_THETA;

    /// Two: base and component.
    pub const GAMMA: usize = C1;
    /// Two: base and component.
    pub const ALPHA: usize = SINE;
    pub const TURN1: usize = D1;
    pub const TURN2: usize = D2;

    pub const COUNT: usize = 9;
}

const BLOCKS: usize = TILE / BLOCK;

/// What the phases hand on, for a tile.
#[derive(Clone)]
pub(super) struct Tile {
    blocks: [Between; BLOCKS],
    /// A bit for each row that is plainly ok so far.
    good: [u8; BLOCKS],
}

impl Tile {
    pub fn new() -> Self {
        let zero = Between([[0.0; BLOCK]; slot::COUNT]);
        Self {
            blocks: [zero; BLOCKS],
            good: [0; BLOCKS],
        }
    }

    /// A bit for each of the first `count` rows that is not plainly ok.
    #[inline(always)]
    pub fn open(&self, count: usize) -> u64 {
        !u64::from_le_bytes(self.good) & (u64::MAX >> (64 - count))
    }
}

impl<O: OffsetSource, M: LimitSource, S: SunSource, G: PoseErrorSource> Job<'_, O, M, S, G> {
    /// The first phase of a block: sun and aim.
    #[inline(always)]
    fn open_block<L: Lanes>(&self, c: &Constants, block: usize, t: &mut Between) {
        let mut lane = 0;
        while lane < BLOCK {
            let bisector = self.offset.bisector(&self.rays::<L>(c, block, lane));
            bisector.cos_theta.write(&mut t.0[slot::COS_THETA][lane..]);
            bisector
                .sin_sq_theta
                .write(&mut t.0[slot::SIN_SQ_THETA][lane..]);
            bisector
                .inverse_cos
                .write(&mut t.0[slot::INVERSE_COS][lane..]);
            bisector.first_k.write(&mut t.0[slot::K][lane..]);
            lane += L::WIDTH;
        }
    }

    /// The last phase of a block: both angles. Bits of the rows that are plainly ok.
    #[inline(always)]
    fn close_block<L: Lanes, const STREAM: bool>(
        &self,
        c: &Constants,
        block: usize,
        t: &Between,
        [out1, out2]: [&mut [f64]; 2],
    ) -> u8 {
        let mut doubtful = 0;
        let mut lane = 0;
        while lane < BLOCK {
            let gamma = Reduced::<L>::read(t, slot::GAMMA, lane).angle();
            let alpha = Reduced::<L>::read(t, slot::ALPHA, lane).angle();
            let mut doubt = L::read(&t.0[slot::DOUBT][lane..]);
            let range1 = self.limits.range::<L>(block, lane, 0);
            let mut axis1 = gamma.add(L::load(c, lane, column::SHIFT1));
            let mut axis2 = alpha.add(L::load(c, lane, column::SHIFT2));
            if G::ANY {
                axis1 = axis1.sub(L::read(&t.0[slot::TURN1][lane..]));
                axis2 = axis2.sub(L::read(&t.0[slot::TURN2][lane..]));
            }
            if M::LIMITED {
                let range2 = self.limits.range::<L>(block, lane, 1);
                axis1 = range1.nearest_turn(axis1);
                doubt = doubt.or(range1.margin(axis1)).or(range2.margin(axis2));
            } else {
                axis1 = range1.window(axis1);
            }
            doubtful |= (doubt.sign_bits() as u8) << lane;
            store::<L, STREAM>(axis1, &mut out1[lane..]);
            store::<L, STREAM>(axis2, &mut out2[lane..]);
            lane += L::WIDTH;
        }
        !doubtful
    }

    /// The first phase of the tile at block `first`; [`tile`](Self::tile) does the rest of it, and the
    /// first phase of the next.
    #[inline(always)]
    pub(super) fn open_tile<L: Lanes>(&self, first: usize, blocks: usize, tile: &mut Tile) {
        let constants = &self.constants[first..first + blocks];
        for (index, (c, t)) in constants.iter().zip(&mut tile.blocks).enumerate() {
            self.open_block::<L>(c, first + index, t);
        }
    }

    /// The direct solution of `blocks` blocks from block `first` of the field, which are opened; then
    /// opens the next `next_blocks`.
    ///
    /// Work of the three angles is dealt out so that no loop is all square roots: for the same
    /// reason the last phase, all multiplications, shares its loop with the next tile's first.
    #[inline(always)]
    pub(super) fn tile<L: Lanes, const STREAM: bool>(
        &self,
        first: usize,
        blocks: usize,
        next_blocks: usize,
        tile: &mut Tile,
        out: &mut Rows<'_>,
    ) {
        let constants = &self.constants[first..first + blocks];
        let between = &mut tile.blocks[..blocks];
        let good = &mut tile.good[..blocks];
        for (c, t) in constants.iter().zip(between.iter_mut()) {
            let mut lane = 0;
            while lane < BLOCK {
                let ratio = L::load(c, lane, column::RATIO);
                let bisector = t.bisector::<L>(lane);
                self.offset
                    .lean::<L, false>(ratio, &bisector)
                    .write(&mut t.0[slot::K][lane..]);
                Reduced::acute(bisector.cos_theta, bisector.sin_sq_theta.sqrt()).write(
                    t,
                    slot::THETA,
                    lane,
                );
                lane += L::WIDTH;
            }
            ahead(c, [4, 5, 6]);
        }
        let incidences = out.incidence.chunks_exact_mut(BLOCK);
        let rows = constants.iter().zip(between.iter_mut()).zip(incidences);
        for (index, ((c, t), incidence)) in rows.enumerate() {
            let mut lane = 0;
            while lane < BLOCK {
                let rays = self.rays::<L>(c, first + index, lane);
                let k = L::read(&t.0[slot::K][lane..]);
                let normal = self.offset.normal::<L, false>(&rays, &t.bisector(lane), k);
                for (component, column) in normal.n.into_iter().zip(&mut t.0[slot::NORMAL..]) {
                    component.write(&mut column[lane..]);
                }
                let theta = Reduced::<L>::read(t, slot::THETA, lane).angle();
                store::<L, STREAM>(theta, &mut incidence[lane..]);
                lane += L::WIDTH;
            }
            ahead(c, [7, 8]);
        }
        for (index, (c, t)) in constants.iter().zip(between.iter_mut()).enumerate() {
            let mut lane = 0;
            while lane < BLOCK {
                let n = [
                    L::read(&t.0[slot::NORMAL][lane..]),
                    L::read(&t.0[slot::NORMAL + 1][lane..]),
                    L::read(&t.0[slot::NORMAL + 2][lane..]),
                ];
                let pose = pose::<L>(c, lane, n);
                // A factor with the sign bit set marks a row that is never for this path.
                let marked = L::load(c, lane, column::SEC_MU);
                let doubt = doubt(L::read(&t.0[slot::COS_THETA][lane..]))
                    .or(pose.doubt())
                    .or(marked);
                pose.c1.write(&mut t.0[slot::C1][lane..]);
                pose.c2.write(&mut t.0[slot::C2][lane..]);
                pose.d2.write(&mut t.0[slot::D2][lane..]);
                pose.sine.write(&mut t.0[slot::SINE][lane..]);
                pose.level_sq.write(&mut t.0[slot::LEVEL_SQ][lane..]);
                pose.d1_sq.sqrt().write(&mut t.0[slot::D1][lane..]);
                doubt.write(&mut t.0[slot::DOUBT][lane..]);
                lane += L::WIDTH;
            }
            ahead(c, [9, 10]);
            self.limits.prefetch(first + index + BLOCKS);
            self.pose_errors.prefetch(first + index + BLOCKS);
        }
        for (index, (c, t)) in constants.iter().zip(between.iter_mut()).enumerate() {
            let mut lane = 0;
            while lane < BLOCK {
                let d1 = L::read(&t.0[slot::D1][lane..]);
                let pose = Pose {
                    c1: L::read(&t.0[slot::C1][lane..]),
                    c2: L::read(&t.0[slot::C2][lane..]),
                    d2: L::read(&t.0[slot::D2][lane..]),
                    level_sq: L::read(&t.0[slot::LEVEL_SQ][lane..]),
                    sine: L::read(&t.0[slot::SINE][lane..]),
                    d1_sq: L::splat(0.0),
                };
                let gamma = pose.gamma(d1);
                alpha(c, lane, d1, pose.sine).write(t, slot::ALPHA, lane);
                gamma.write(t, slot::GAMMA, lane);
                if G::ANY {
                    let turns = self.pose_errors.load::<L>(first + index, lane);
                    let [turn1, turn2] =
                        turns.at(pose.gamma_pair(d1), pose.alpha_pair(c, lane, d1));
                    turn1.write(&mut t.0[slot::TURN1][lane..]);
                    turn2.write(&mut t.0[slot::TURN2][lane..]);
                }
                lane += L::WIDTH;
            }
            ahead(c, [11, 12]);
        }
        let axes = out
            .axis1
            .chunks_exact_mut(BLOCK)
            .zip(out.axis2.chunks_exact_mut(BLOCK));
        let both = next_blocks.min(blocks);
        let next = &self.constants[first + blocks..first + blocks + both];
        let mut rows = constants
            .iter()
            .zip(between.iter_mut())
            .zip(good.iter_mut())
            .zip(axes);
        for (index, (next, (((c, t), good), (out1, out2)))) in
            next.iter().zip(rows.by_ref()).enumerate()
        {
            *good = self.close_block::<L, STREAM>(c, first + index, t, [out1, out2]);
            self.open_block::<L>(next, first + blocks + index, t);
            ahead_of(next);
        }
        for (index, (((c, t), good), (out1, out2))) in rows.enumerate() {
            let block = first + both + index;
            *good = self.close_block::<L, STREAM>(c, block, t, [out1, out2]);
        }
        out.status[..blocks * BLOCK].fill(Status::Ok);
    }
}

/// Asks for columns of the same rows of the next tile: a few cache lines in each loop, all in all.
#[inline(always)]
fn ahead<const N: usize>(constants: &Constants, columns: [usize; N]) {
    let mut index = 0;
    while index < N {
        prefetch(constants, BLOCKS, columns[index]);
        index += 1;
    }
}

/// Asks for what [`Job::open_block`] will read of the tile after the next.
#[inline(always)]
fn ahead_of(next: &Constants) {
    ahead(next, [0, 1, 2, 3]);
}

impl Between {
    #[inline(always)]
    fn bisector<L: Lanes>(&self, lane: usize) -> Bisector<L> {
        Bisector {
            cos_theta: L::read(&self.0[slot::COS_THETA][lane..]),
            sin_sq_theta: L::read(&self.0[slot::SIN_SQ_THETA][lane..]),
            inverse_cos: L::read(&self.0[slot::INVERSE_COS][lane..]),
            first_k: L::read(&self.0[slot::K][lane..]),
        }
    }
}

impl<L: Lanes> Reduced<L> {
    #[inline(always)]
    fn write(self, between: &mut Between, first: usize, lane: usize) {
        self.base.write(&mut between.0[first][lane..]);
        self.component.write(&mut between.0[first + 1][lane..]);
    }

    #[inline(always)]
    fn read(between: &Between, first: usize, lane: usize) -> Self {
        Self {
            base: L::read(&between.0[first][lane..]),
            component: L::read(&between.0[first + 1][lane..]),
        }
    }
}

#[inline(always)]
fn store<L: Lanes, const STREAM: bool>(value: L, target: &mut [f64]) {
    if STREAM {
        value.stream(target);
    } else {
        value.write(target);
    }
}
