//! The direct solution of many rows, in phases.
//!
//! One row is a chain of some 300 cycles of latency; a processor that looks a few hundred instructions
//! ahead cannot fill it with other rows unless the body is short. So the formula is cut into phases, each a
//! short loop over a tile of rows with its results in the nearest cache: the next rows then fill
//! the gaps, and throughput, not latency, is what limits.

use super::limits::{LimitSource, within_half_turn};
use super::mount::{Constants, Pose, alpha, pose};
use super::normal::{Bisector, OffsetSource, doubt};
use super::{Job, Rows, SunSource};
use crate::lanes::math::Reduced;
use crate::lanes::{BLOCK, Lanes};
use crate::status::Status;
use crate::tracking::prepared::{TILE, column};

type Column = [f64; BLOCK];

/// What the phases hand on, for one block of rows.
#[derive(Clone, Copy)]
#[repr(C, align(64))]
struct Between {
    cos_theta: Column,
    sin_sq_theta: Column,
    inverse_cos: Column,
    k: Column,
    normal: [Column; 3],
    theta: [Column; 2],
    c1: Column,
    c2: Column,
    d1: Column,
    d2: Column,
    sin_alpha: Column,
    level_sq: Column,
    doubt: Column,
    gamma: [Column; 2],
    alpha: [Column; 2],
}

const BLOCKS: usize = TILE / BLOCK;

/// What the phases hand on, for a tile.
pub(super) struct Tile {
    blocks: [Between; BLOCKS],
    /// A bit for each row that is plainly ok so far.
    good: [u8; BLOCKS],
}

impl Tile {
    pub fn new() -> Self {
        const ZERO: Column = [0.0; BLOCK];
        let zero = Between {
            cos_theta: ZERO,
            sin_sq_theta: ZERO,
            inverse_cos: ZERO,
            k: ZERO,
            normal: [ZERO; 3],
            theta: [ZERO; 2],
            c1: ZERO,
            c2: ZERO,
            d1: ZERO,
            d2: ZERO,
            sin_alpha: ZERO,
            level_sq: ZERO,
            doubt: ZERO,
            gamma: [ZERO; 2],
            alpha: [ZERO; 2],
        };
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

impl<O: OffsetSource, M: LimitSource, S: SunSource> Job<'_, O, M, S> {
    /// The first phase of a block: sun and aim.
    #[inline(always)]
    fn open_block<L: Lanes>(&self, c: &Constants, block: usize, t: &mut Between) {
        let mut lane = 0;
        while lane < BLOCK {
            let bisector = self.offset.bisector(&self.rays::<L>(c, block, lane));
            bisector.cos_theta.write(&mut t.cos_theta[lane..]);
            bisector.sin_sq_theta.write(&mut t.sin_sq_theta[lane..]);
            bisector.inverse_cos.write(&mut t.inverse_cos[lane..]);
            bisector.first_k.write(&mut t.k[lane..]);
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
            let gamma = Reduced::<L>::read(&t.gamma, lane).angle();
            let alpha = Reduced::<L>::read(&t.alpha, lane).angle();
            let mut doubt = L::read(&t.doubt[lane..]);
            let range1 = self.limits.range::<L>(block, lane, 0);
            let axis1 = within_half_turn(gamma.add(L::load(c, lane, column::SHIFT1)));
            let mut axis2 = alpha.add(L::load(c, lane, column::SHIFT2));
            if M::LIMITED {
                let range2 = self.limits.range::<L>(block, lane, 1);
                doubt = doubt
                    .or(range1.reach.sub(axis1.abs()))
                    .or(range2.reach.sub(axis2.abs()));
                axis2 = axis2.add(range2.middle);
            }
            doubtful |= (doubt.sign_bits() as u8) << lane;
            store::<L, STREAM>(axis1.add(range1.middle), &mut out1[lane..]);
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
                    .write(&mut t.k[lane..]);
                Reduced::acute(bisector.cos_theta, bisector.sin_sq_theta.sqrt())
                    .write(&mut t.theta, lane);
                lane += L::WIDTH;
            }
            ahead::<L, _>(c, [4, 5, 6]);
        }
        let incidences = out.incidence.chunks_exact_mut(BLOCK);
        let rows = constants.iter().zip(between.iter_mut()).zip(incidences);
        for (index, ((c, t), incidence)) in rows.enumerate() {
            let mut lane = 0;
            while lane < BLOCK {
                let rays = self.rays::<L>(c, first + index, lane);
                let k = L::read(&t.k[lane..]);
                let normal = self.offset.normal::<L, false>(&rays, &t.bisector(lane), k);
                for (component, column) in normal.n.into_iter().zip(&mut t.normal) {
                    component.write(&mut column[lane..]);
                }
                let theta = Reduced::<L>::read(&t.theta, lane).angle();
                store::<L, STREAM>(theta, &mut incidence[lane..]);
                lane += L::WIDTH;
            }
            ahead::<L, _>(c, [7, 8]);
        }
        for (index, (c, t)) in constants.iter().zip(between.iter_mut()).enumerate() {
            let mut lane = 0;
            while lane < BLOCK {
                let [n1, n2, n3] = &t.normal;
                let n = [
                    L::read(&n1[lane..]),
                    L::read(&n2[lane..]),
                    L::read(&n3[lane..]),
                ];
                let pose = pose::<L>(c, lane, n);
                // A factor with the sign bit set marks a row that is never for this path.
                let marked = L::load(c, lane, column::COSINE_FACTOR);
                let doubt = doubt(L::read(&t.cos_theta[lane..]))
                    .or(pose.doubt())
                    .or(marked);
                pose.c1.write(&mut t.c1[lane..]);
                pose.c2.write(&mut t.c2[lane..]);
                pose.d2.write(&mut t.d2[lane..]);
                pose.sin_alpha.write(&mut t.sin_alpha[lane..]);
                pose.level_sq.write(&mut t.level_sq[lane..]);
                pose.d1_sq.sqrt().write(&mut t.d1[lane..]);
                doubt.write(&mut t.doubt[lane..]);
                lane += L::WIDTH;
            }
            ahead::<L, _>(c, [9, 10, 11]);
            self.limits.prefetch::<L>(first + index + BLOCKS);
        }
        for (c, t) in constants.iter().zip(between.iter_mut()) {
            let mut lane = 0;
            while lane < BLOCK {
                let d1 = L::read(&t.d1[lane..]);
                let pose = Pose {
                    c1: L::read(&t.c1[lane..]),
                    c2: L::read(&t.c2[lane..]),
                    d2: L::read(&t.d2[lane..]),
                    level_sq: L::read(&t.level_sq[lane..]),
                    sin_alpha: L::read(&t.sin_alpha[lane..]),
                    d1_sq: L::splat(0.0),
                };
                pose.gamma(d1).write(&mut t.gamma, lane);
                alpha(c, lane, d1, pose.sin_alpha).write(&mut t.alpha, lane);
                lane += L::WIDTH;
            }
            ahead::<L, _>(c, [12, 13]);
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
            ahead_of::<L>(next);
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
fn ahead<L: Lanes, const N: usize>(constants: &Constants, columns: [usize; N]) {
    let mut index = 0;
    while index < N {
        L::prefetch(constants, BLOCKS, columns[index]);
        index += 1;
    }
}

/// Asks for what [`Job::open_block`] will read of the tile after the next.
#[inline(always)]
fn ahead_of<L: Lanes>(next: &Constants) {
    ahead::<L, _>(next, [0, 1, 2, 3]);
}

impl Between {
    #[inline(always)]
    fn bisector<L: Lanes>(&self, lane: usize) -> Bisector<L> {
        Bisector {
            cos_theta: L::read(&self.cos_theta[lane..]),
            sin_sq_theta: L::read(&self.sin_sq_theta[lane..]),
            inverse_cos: L::read(&self.inverse_cos[lane..]),
            first_k: L::read(&self.k[lane..]),
        }
    }
}

impl<L: Lanes> Reduced<L> {
    #[inline(always)]
    fn write(self, columns: &mut [Column; 2], lane: usize) {
        self.base.write(&mut columns[0][lane..]);
        self.component.write(&mut columns[1][lane..]);
    }

    #[inline(always)]
    fn read(columns: &[Column; 2], lane: usize) -> Self {
        Self {
            base: L::read(&columns[0][lane..]),
            component: L::read(&columns[1][lane..]),
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
