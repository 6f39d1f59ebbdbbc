//! The direct solution of many rows, in phases.
//!
//! One row is a chain of some 300 cycles of latency; a processor that looks a few hundred instructions
//! ahead cannot fill it with other rows unless the body is short. So the formula is cut into phases, each a
//! short loop over a tile of rows with its results in the nearest cache: the next rows then fill
//! the gaps, and throughput, not latency, is what limits.

use super::limits::LimitSource;
use super::mount::{Pose, alpha, pose};
use super::normal::{Bisector, OffsetSource};
use super::{Job, Rows, SunSource};
use crate::lanes::math::Reduced;
use crate::lanes::{Lanes, Mask};
use crate::status::Status;
use crate::tracking::prepared::{TILE, column};

/// What the phases hand on.
#[repr(align(64))]
pub(super) struct Tile {
    normal: [[f64; TILE]; 3],
    cos_theta: [f64; TILE],
    sin_sq_theta: [f64; TILE],
    reciprocal: [f64; TILE],
    k: [f64; TILE],
    theta: [[f64; TILE]; 2],
    gamma: [[f64; TILE]; 2],
    alpha: [[f64; TILE]; 2],
    c1: [f64; TILE],
    c2: [f64; TILE],
    d1: [f64; TILE],
    d2: [f64; TILE],
    sin_alpha: [f64; TILE],
    level_sq: [f64; TILE],
    /// Per vector, a bit for each row that is plainly ok so far.
    good: [u8; TILE],
}

impl Tile {
    pub fn new() -> Self {
        const ZERO: [f64; TILE] = [0.0; TILE];
        Self {
            normal: [ZERO; 3],
            cos_theta: ZERO,
            sin_sq_theta: ZERO,
            reciprocal: ZERO,
            k: ZERO,
            theta: [ZERO; 2],
            gamma: [ZERO; 2],
            alpha: [ZERO; 2],
            c1: ZERO,
            c2: ZERO,
            d1: ZERO,
            d2: ZERO,
            sin_alpha: ZERO,
            level_sq: ZERO,
            good: [0; TILE],
        }
    }

    /// A bit for each row of a vector that is not plainly ok.
    pub fn open<L: Lanes>(&self, vector: usize) -> u8 {
        !self.good[vector] & (u8::MAX >> (8 - L::WIDTH))
    }

    /// True if every row of the first `vectors` vectors is plainly ok.
    #[inline(always)]
    pub fn all_good<L: Lanes>(&self, vectors: usize) -> bool {
        let all = u8::MAX >> (8 - L::WIDTH);
        self.good[..vectors].iter().fold(all, |sum, bits| sum & bits) == all
    }
}

impl<O: OffsetSource, M: LimitSource, S: SunSource> Job<'_, O, M, S> {
    /// The direct solution of `vectors` vectors from row `first` of the field.
    ///
    /// Work of the three angles is dealt out so that no loop is all square roots.
    #[inline(always)]
    pub(super) fn tile<L: Lanes, const STREAM: bool>(
        &self,
        first: usize,
        vectors: usize,
        tile: &mut Tile,
        out: &mut Rows<'_>,
    ) {
        let end = vectors * L::WIDTH;
        // Each loop asks for a few cache lines of the next tile, fourteen in all.
        let ahead = first + TILE;
        let mut row = 0;
        while row < end {
            let rays = self.rays::<L>(first + row);
            let bisector = self.offset.bisector(&rays);
            bisector.cos_theta.write(&mut tile.cos_theta[row..]);
            bisector.sin_sq_theta.write(&mut tile.sin_sq_theta[row..]);
            bisector.reciprocal.write(&mut tile.reciprocal[row..]);
            L::prefetch(self.constants, ahead + row, 4);
            L::prefetch(self.constants, ahead + row, 5);
            row += L::WIDTH;
        }
        let mut row = 0;
        while row < end {
            let ratio = L::load(self.constants, first + row, column::RATIO);
            let bisector = tile.bisector::<L>(row);
            self.offset.lean::<L, false>(ratio, &bisector).write(&mut tile.k[row..]);
            Reduced::acute(bisector.cos_theta, bisector.sin_sq_theta.sqrt())
                .write(&mut tile.theta, row);
            L::prefetch(self.constants, ahead + row, 6);
            L::prefetch(self.constants, ahead + row, 7);
            L::prefetch(self.constants, ahead + row, 8);
            row += L::WIDTH;
        }
        let mut row = 0;
        while row < end {
            let rays = self.rays::<L>(first + row);
            let normal =
                self.offset.normal(&rays, &tile.bisector::<L>(row), L::read(&tile.k[row..]));
            for (component, column) in normal.n.into_iter().zip(&mut tile.normal) {
                component.write(&mut column[row..]);
            }
            let good = normal.lit.and(self.offset.fast(rays.ratio));
            tile.good[row / L::WIDTH] = good.bits() as u8;
            let theta = Reduced::<L>::read(&tile.theta, row).angle();
            store::<L, STREAM>(theta, &mut out.incidence[row..row + L::WIDTH]);
            L::prefetch(self.constants, ahead + row, 9);
            L::prefetch(self.constants, ahead + row, 10);
            row += L::WIDTH;
        }
        let mut row = 0;
        while row < end {
            let [n1, n2, n3] = &tile.normal;
            let n = [L::read(&n1[row..]), L::read(&n2[row..]), L::read(&n3[row..])];
            let pose = pose::<L>(self.constants, first + row, n);
            pose.c1.write(&mut tile.c1[row..]);
            pose.c2.write(&mut tile.c2[row..]);
            pose.d2.write(&mut tile.d2[row..]);
            pose.sin_alpha.write(&mut tile.sin_alpha[row..]);
            pose.level_sq.write(&mut tile.level_sq[row..]);
            pose.d1_sq.sqrt().write(&mut tile.d1[row..]);
            tile.good[row / L::WIDTH] &= L::splat(0.0).lt(pose.d1_sq).bits() as u8;
            L::prefetch(self.constants, ahead + row, 11);
            self.limits.prefetch::<L>(ahead + row);
            row += L::WIDTH;
        }
        let mut row = 0;
        while row < end {
            let d1 = L::read(&tile.d1[row..]);
            let pose = Pose {
                c1: L::read(&tile.c1[row..]),
                c2: L::read(&tile.c2[row..]),
                d2: L::read(&tile.d2[row..]),
                level_sq: L::read(&tile.level_sq[row..]),
                sin_alpha: L::read(&tile.sin_alpha[row..]),
                d1_sq: L::splat(0.0),
            };
            pose.gamma(d1).write(&mut tile.gamma, row);
            alpha(self.constants, first + row, d1, pose.sin_alpha).write(&mut tile.alpha, row);
            L::prefetch(self.constants, ahead + row, 12);
            L::prefetch(self.constants, ahead + row, 13);
            L::prefetch(self.constants, ahead + row, 0);
            row += L::WIDTH;
        }
        let mut row = 0;
        while row < end {
            let gamma = Reduced::<L>::read(&tile.gamma, row).angle();
            let alpha = Reduced::<L>::read(&tile.alpha, row).angle();
            let reference1 = L::load(self.constants, first + row, column::REFERENCE1);
            let reference2 = L::load(self.constants, first + row, column::REFERENCE2);
            let range1 = self.limits.range::<L>(first + row, 0);
            let axis1 = range1.home(gamma.add(reference1));
            let mut axis2 = alpha.add(reference2);
            if M::LIMITED {
                let range2 = self.limits.range::<L>(first + row, 1);
                axis2 = range2.home(axis2);
                let good = range1.holds(axis1).and(range2.holds(axis2));
                tile.good[row / L::WIDTH] &= good.bits() as u8;
            }
            store::<L, STREAM>(axis1, &mut out.axis1[row..row + L::WIDTH]);
            store::<L, STREAM>(axis2, &mut out.axis2[row..row + L::WIDTH]);
            L::prefetch(self.constants, ahead + row, 1);
            L::prefetch(self.constants, ahead + row, 2);
            L::prefetch(self.constants, ahead + row, 3);
            row += L::WIDTH;
        }
        out.status[..end].fill(Status::Ok);
    }
}

impl Tile {
    #[inline(always)]
    fn bisector<L: Lanes>(&self, row: usize) -> Bisector<L> {
        Bisector {
            cos_theta: L::read(&self.cos_theta[row..]),
            sin_sq_theta: L::read(&self.sin_sq_theta[row..]),
            reciprocal: L::read(&self.reciprocal[row..]),
        }
    }
}

impl<L: Lanes> Reduced<L> {
    #[inline(always)]
    fn write(self, columns: &mut [[f64; TILE]; 2], row: usize) {
        self.base.write(&mut columns[0][row..]);
        self.component.write(&mut columns[1][row..]);
    }

    #[inline(always)]
    fn read(columns: &[[f64; TILE]; 2], row: usize) -> Self {
        Self { base: L::read(&columns[0][row..]), component: L::read(&columns[1][row..]) }
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
