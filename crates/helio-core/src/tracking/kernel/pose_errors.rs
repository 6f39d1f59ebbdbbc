//! Pose errors, in lanes: see [`PoseErrors`](crate::PoseErrors) for the formula.
//!
//! They are those of the true angles. So from the normal they are a product or two, all cosines and
//! sines being at hand (Guo 2015 §3), and only from the encoders do they have to be solved for.

use crate::lanes::{BLOCK, Columns, Lanes, prefetch};
use crate::mount::{MountAxes, PoseErrors};

/// Columns of what a heliostat's pose errors are made of.
pub(crate) const COUNT: usize = 6;

/// Of one heliostat: kappa1 (g1, g2), kappa2 (g1, g2, g3), e, with g the world's up along the axes.
pub(crate) fn constants(of: PoseErrors, axes: &MountAxes) -> [f64; COUNT] {
    [
        of.axis1_sag_rad * axes.axis1.up,
        of.axis1_sag_rad * axes.axis2.up,
        of.axis2_sag_rad * axes.axis1.up,
        of.axis2_sag_rad * axes.axis2.up,
        of.axis2_sag_rad * axes.axis3.up,
        of.axis2_eccentricity_rad,
    ]
}

/// Cosine and sine of an angle.
pub(crate) type Pair<L> = [L; 2];

/// How a kernel gets at the pose errors; chosen once per call, so that a field without any pays nothing.
pub(crate) trait PoseErrorSource: Copy {
    const ANY: bool;
    fn load<L: Lanes>(self, block: usize, lane: usize) -> Turns<L>;
    /// The numbers of one row.
    fn row(self, row: usize) -> [f64; COUNT];
    /// Asks for the memory of a block, if there is one.
    #[inline(always)]
    fn prefetch(self, _block: usize) {}
}

/// No heliostat has any.
#[derive(Clone, Copy)]
pub(crate) struct NoPoseErrors;

impl PoseErrorSource for NoPoseErrors {
    const ANY: bool = false;
    #[inline(always)]
    fn load<L: Lanes>(self, _block: usize, _lane: usize) -> Turns<L> {
        Turns([L::splat(0.0); COUNT])
    }
    #[inline(always)]
    fn row(self, _row: usize) -> [f64; COUNT] {
        [0.0; COUNT]
    }
}

/// Turns as columns.
#[derive(Clone, Copy)]
pub(crate) struct WithPoseErrors<'a>(pub &'a [Columns<COUNT>]);

impl PoseErrorSource for WithPoseErrors<'_> {
    const ANY: bool = true;
    #[inline(always)]
    fn load<L: Lanes>(self, block: usize, lane: usize) -> Turns<L> {
        Turns::load(&self.0[block], lane)
    }
    #[inline(always)]
    fn row(self, row: usize) -> [f64; COUNT] {
        core::array::from_fn(|k| self.0[row / BLOCK].0[k][row % BLOCK])
    }
    #[inline(always)]
    fn prefetch(self, block: usize) {
        if let Some(columns) = self.0.get(block) {
            let mut column = 0;
            while column < COUNT {
                prefetch(columns, 0, column);
                column += 1;
            }
        }
    }
}

/// The constants of some heliostats.
#[derive(Clone, Copy)]
pub(crate) struct Turns<L>([L; COUNT]);

/// Newton steps from the unloaded pose: each squares the error, which is 0.1 rad at most to begin with.
const STEPS: usize = 4;

impl<L: Lanes> Turns<L> {
    #[inline(always)]
    pub fn load(columns: &Columns<COUNT>, lane: usize) -> Self {
        Self([
            L::load(columns, lane, 0),
            L::load(columns, lane, 1),
            L::load(columns, lane, 2),
            L::load(columns, lane, 3),
            L::load(columns, lane, 4),
            L::load(columns, lane, 5),
        ])
    }

    /// True angle less that of the encoder, of both axes, in a loaded pose.
    ///
    /// Exactly +0 for a heliostat without any: what it is taken from keeps its bits.
    #[inline(always)]
    pub fn at(&self, [cos_gamma, sin_gamma]: Pair<L>, [cos_alpha, sin_alpha]: Pair<L>) -> [L; 2] {
        let [g11, g12, g21, g22, g23, e] = self.0;
        let zero = L::splat(0.0);
        let across1 = cos_gamma.neg_mul_add(g12, sin_gamma.mul(g11));
        let level2 = sin_gamma.mul_add(g22, cos_gamma.mul_add(g21, e));
        [
            cos_alpha.mul_add(across1, zero),
            sin_alpha.mul_add(level2, cos_alpha.neg_mul_add(g23, zero)),
        ]
    }

    /// The true pose for angles less their references, as cosines and sines of both.
    #[inline(always)]
    pub fn settle(&self, gamma: Pair<L>, alpha: Pair<L>) -> [Pair<L>; 2] {
        let [g11, g12, g21, g22, g23, e] = self.0;
        let zero = L::splat(0.0);
        let one = L::splat(1.0);
        let (mut turn1, mut turn2) = (zero, zero);
        let (mut g, mut a) = (gamma, alpha);
        for _ in 0..STEPS {
            let ([cos_gamma, sin_gamma], [cos_alpha, sin_alpha]) = (g, a);
            let [all1, all2] = self.at(g, a);
            let (left1, left2) = (all1.sub(turn1), all2.sub(turn2));
            let level1 = sin_gamma.mul_add(g12, cos_gamma.mul(g11));
            let across1 = cos_gamma.neg_mul_add(g12, sin_gamma.mul(g11));
            let level2 = sin_gamma.mul_add(g22, cos_gamma.mul_add(g21, e));
            let across2 = cos_gamma.neg_mul_add(g22, sin_gamma.mul(g21));
            // the identity less the derivatives of both turns by gamma and alpha
            let m11 = cos_alpha.neg_mul_add(level1, one);
            let m12 = sin_alpha.mul(across1);
            let m21 = sin_alpha.mul(across2);
            let m22 = sin_alpha.neg_mul_add(g23, cos_alpha.neg_mul_add(level2, one));
            let per = one.div(m12.neg_mul_add(m21, m11.mul(m22)));
            turn1 = m12.neg_mul_add(left2, m22.mul(left1)).mul_add(per, turn1);
            turn2 = m21.neg_mul_add(left1, m11.mul(left2)).mul_add(per, turn2);
            g = turned(gamma, turn1);
            a = turned(alpha, turn2);
        }
        // A sign of zero may have changed on the way where there is none.
        let none = g11
            .abs()
            .add(g12.abs())
            .add(g21.abs().add(g22.abs()).add(g23.abs()).add(e.abs()))
            .le(zero);
        [
            [
                L::select(none, gamma[0], g[0]),
                L::select(none, gamma[1], g[1]),
            ],
            [
                L::select(none, alpha[0], a[0]),
                L::select(none, alpha[1], a[1]),
            ],
        ]
    }
}

/// A pair turned on by an angle of no more than 0.11 rad, to the last digit.
#[inline(always)]
fn turned<L: Lanes>([cosine, sine]: Pair<L>, angle: L) -> Pair<L> {
    let z = angle.mul(angle);
    let c = L::splat;
    let s = z.mul_add(c(1.0 / 362_880.0), c(-1.0 / 5040.0));
    let s = s.mul_add(z, c(1.0 / 120.0)).mul_add(z, c(-1.0 / 6.0));
    let s = s.mul(z).mul_add(angle, angle);
    // 1 - cos(angle)
    let v = z.mul_add(c(-1.0 / 40320.0), c(1.0 / 720.0));
    let v = v.mul_add(z, c(-1.0 / 24.0)).mul_add(z, c(0.5)).mul(z);
    [
        cosine.sub(sine.mul_add(s, cosine.mul(v))),
        cosine.mul_add(s, v.neg_mul_add(sine, sine)),
    ]
}
