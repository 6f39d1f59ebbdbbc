//! From the normal to the two axis angles and back (Guo 2015 §3), in lanes.

use core::f64::consts::PI;

use super::pose_errors::{Pair, Turns};
use crate::lanes::math::{Reduced, sin_cos};
use crate::lanes::{Columns, Lanes, Mask};
use crate::tracking::prepared::column;

/// The prepared constants of a block of rows.
pub(crate) type Constants = Columns<{ column::COUNT }>;

/// What both solutions share.
#[derive(Clone, Copy)]
pub(crate) struct Pose<L> {
    pub c1: L,
    pub c2: L,
    /// cos(mu) sin(alpha).
    pub sine: L,
    pub d2: L,
    /// c1² + c2².
    pub level_sq: L,
    /// c1² + c2² - d2²: negative inside a blind cone.
    pub d1_sq: L,
}

/// c = A n without the matrix:
/// with P = (tan(psi_t/2) cos(psi_a), tan(psi_t/2) sin(psi_a)) and z = (1 + cos(psi_t)) (n3 + P·n),
/// c = (n1 - P1 z, n2 - P2 z, z - n3).
#[inline(always)]
fn tilt<L: Lanes>(n: [L; 3], tilt1: L, tilt2: L, factor: L) -> [L; 3] {
    let z = tilt2.mul_add(n[1], tilt1.mul_add(n[0], n[2])).mul(factor);
    [
        tilt1.neg_mul_add(z, n[0]),
        tilt2.neg_mul_add(z, n[1]),
        z.sub(n[2]),
    ]
}

/// Guo 2015 eqs. (19), (22)-(24) up to the sign of d1.
#[inline(always)]
pub(crate) fn pose<L: Lanes>(constants: &Constants, lane: usize, n: [L; 3]) -> Pose<L> {
    let [c1, c2, c3] = tilt(
        n,
        L::load(constants, lane, column::TILT1),
        L::load(constants, lane, column::TILT2),
        L::load(constants, lane, column::TILT_FACTOR),
    );
    let tan_tau1 = L::load(constants, lane, column::TAN_TAU1);
    let sec_tau1 = L::load(constants, lane, column::SEC_TAU1);
    let sin_mu = L::load(constants, lane, column::SIN_MU);
    // cos(mu) sin(alpha) = (c3 - sin(tau1) sin(mu)) / cos(tau1)                             (22)
    let sine = tan_tau1.neg_mul_add(sin_mu, sec_tau1.mul(c3));
    // d2 = (sin(mu) - sin(tau1) c3) / cos(tau1)                                            (24)
    let d2 = tan_tau1.neg_mul_add(c3, sec_tau1.mul(sin_mu));
    let level_sq = c2.mul_add(c2, c1.mul(c1));
    Pose {
        c1,
        c2,
        sine,
        d2,
        level_sq,
        d1_sq: d2.neg_mul_add(d2, level_sq),
    }
}

impl<L: Lanes> Pose<L> {
    /// gamma for either sign of d1: atan2(c2 d1 - c1 d2, c1 d1 + c2 d2).                     (25)-(27)
    #[inline(always)]
    pub fn gamma(&self, d1: L) -> Reduced<L> {
        let [cosine, sine] = self.long_gamma_pair(d1);
        Reduced::full(cosine, sine, L::splat(1.0).div(self.level_sq))
    }

    /// Cosine and sine of gamma times c1² + c2².
    #[inline(always)]
    fn long_gamma_pair(&self, d1: L) -> Pair<L> {
        let sine = self.d2.neg_mul_add(self.c1, self.c2.mul(d1));
        let cosine = self.d2.mul_add(self.c2, self.c1.mul(d1));
        [cosine, sine]
    }

    /// Cosine and sine of gamma for either sign of d1.
    #[inline(always)]
    pub fn gamma_pair(&self, d1: L) -> Pair<L> {
        let per = L::splat(1.0).div(self.level_sq);
        let [cosine, sine] = self.long_gamma_pair(d1);
        [cosine.mul(per), sine.mul(per)]
    }

    /// Cosine and sine of alpha for either sign of d1.
    #[inline(always)]
    pub fn alpha_pair(&self, constants: &Constants, lane: usize, d1: L) -> Pair<L> {
        let sec_mu = L::load(constants, lane, column::SEC_MU);
        [d1.mul(sec_mu), self.sine.mul(sec_mu)]
    }

    /// What the pose errors turn both axes by, in both solutions, direct and over the top. `free_gamma` is
    /// gamma where it may be anything.
    #[inline(always)]
    pub fn turns(
        &self,
        constants: &Constants,
        lane: usize,
        turns: &Turns<L>,
        free_gamma: L,
    ) -> [[L; 2]; 2] {
        let zero = L::splat(0.0);
        let d1 = self.d1_sq.max(zero).sqrt();
        let vertical = self.on_fixed_axis();
        let here = Self {
            level_sq: L::select(vertical, L::splat(1.0), self.level_sq),
            ..*self
        };
        let (free_sine, free_cosine) = sin_cos(free_gamma);
        let mut both = [[zero; 2]; 2];
        let mut solution = 0;
        while solution < 2 {
            let d1 = if solution == 0 { d1 } else { zero.sub(d1) };
            let [cosine, sine] = here.gamma_pair(d1);
            let gamma = [
                L::select(vertical, free_cosine, cosine),
                L::select(vertical, free_sine, sine),
            ];
            both[solution] = turns.at(gamma, here.alpha_pair(constants, lane, d1));
            solution += 1;
        }
        both
    }

    /// Encoder angles of both solutions, not wrapped: direct and over the top. Valid also on the edge of a blind cone, where the two meet, and face up on a perfect
    /// mount, where axis 1 may be anything and is taken as its zero.
    #[inline(always)]
    pub fn both(&self, constants: &Constants, lane: usize) -> [[L; 2]; 2] {
        let zero = L::splat(0.0);
        let d1 = self.d1_sq.max(zero).sqrt();
        let vertical = self.on_fixed_axis();
        let here = Self {
            level_sq: L::select(vertical, L::splat(1.0), self.level_sq),
            ..*self
        };
        let shift1 = L::load(constants, lane, column::SHIFT1);
        let shift2 = L::load(constants, lane, column::SHIFT2);
        let gamma = here.gamma(d1).angle().add(shift1);
        let over_gamma = here.gamma(zero.sub(d1)).angle().add(shift1);
        let alpha = alpha(constants, lane, d1, self.sine).angle();
        // Over the top alpha is the supplement, 180° - alpha.
        let over_alpha = L::splat(PI).sub(alpha).add(shift2);
        [
            [L::select(vertical, shift1, gamma), alpha.add(shift2)],
            [L::select(vertical, shift1, over_gamma), over_alpha],
        ]
    }

    /// True where the normal stands on the fixed axis of a perfect mount: any angle of the first axis
    /// points it there.
    #[inline(always)]
    pub fn on_fixed_axis(&self) -> L::Mask {
        L::splat(MIN_LEVEL_SQ).lt(self.level_sq).not()
    }

    /// Sign bit set unless the row lies clearly outside a blind cone and is not face up.
    #[inline(always)]
    pub fn doubt(&self) -> L {
        self.d1_sq.sub(L::splat(MIN_LEVEL_SQ))
    }
}

/// c1² + c2² below which the normal counts as standing on the fixed axis.
const MIN_LEVEL_SQ: f64 = 1e-280;

/// alpha of the solution with d1 >= 0; d1 = cos(mu) cos(alpha), `sine` as in [`Pose`].            (23)
#[inline(always)]
pub(crate) fn alpha<L: Lanes>(constants: &Constants, lane: usize, d1: L, sine: L) -> Reduced<L> {
    Reduced::half(d1, sine, L::load(constants, lane, column::SEC_MU))
}

/// The normal along the mount's axes for the cosines and sines of gamma and alpha, Guo 2015 eq. (29).
#[inline(always)]
pub(crate) fn forward<L: Lanes>(
    constants: &Constants,
    lane: usize,
    angles: [Pair<L>; 2],
) -> [L; 3] {
    let [[cos_gamma, sin_gamma], [cos_alpha, sin_alpha]] = angles;
    // (22)-(24) the other way
    let tan_tau1 = L::load(constants, lane, column::TAN_TAU1);
    let sec_tau1 = L::load(constants, lane, column::SEC_TAU1);
    let sin_mu = L::load(constants, lane, column::SIN_MU);
    let sec_mu = L::load(constants, lane, column::SEC_MU).abs();
    let c3 = tan_tau1
        .mul_add(sin_mu, sin_alpha.div(sec_mu))
        .div(sec_tau1);
    let d1 = cos_alpha.div(sec_mu);
    let d2 = tan_tau1.neg_mul_add(c3, sec_tau1.mul(sin_mu));
    let c1 = sin_gamma.neg_mul_add(d2, cos_gamma.mul(d1));
    let c2 = sin_gamma.mul_add(d1, cos_gamma.mul(d2));
    // the transpose of a tilt is the tilt the other way
    let zero = L::splat(0.0);
    tilt(
        [c1, c2, c3],
        zero.sub(L::load(constants, lane, column::TILT1)),
        zero.sub(L::load(constants, lane, column::TILT2)),
        L::load(constants, lane, column::TILT_FACTOR),
    )
}
