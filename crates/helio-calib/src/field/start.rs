//! Where to begin when nothing is known: both references by closed forms.
//!
//! With all other errors zero the agreement of the measured normals h_i with those of the encoder angles,
//! E = Σ h_i·n(gamma_i - gamma0, alpha_i - alpha0), is linear in (cos gamma0, sin gamma0) and, apart, in
//! (cos alpha0, sin alpha0): either best reference follows from the other by one arctangent, from six
//! sums over the observations. A few turns of that from four values of alpha0, and the greatest E, need
//! no scan and hold for references of any size.

use helio_core::lanes::Lanes;

use super::lane::Lane;
use crate::model::Real;

const TURNS: usize = 4;

/// A reference that is looked for, or one that is held, by its cosine and sine.
pub(super) type Reference<L> = Option<[Lane<L>; 2]>;

/// Of length one; (1, 0) where there is no direction.
#[inline(always)]
fn unit<L: Lanes>([x, y]: [Lane<L>; 2]) -> [Lane<L>; 2] {
    let square = y.mul_add(y, x * x);
    let there = Lane::splat(1e-60).lt(square);
    let per_length = Lane::splat(1.0) / square.sqrt();
    [
        Lane::select(there, x * per_length, Lane::splat(1.0)),
        Lane::select(there, y * per_length, Lane::splat(0.0)),
    ]
}

/// What E is linear in for one reference, given the other: Σ.
#[inline(always)]
fn for_first<L: Lanes>(sums: &[Lane<L>; 6], [c, s]: [Lane<L>; 2]) -> [Lane<L>; 2] {
    let [cos_p, cos_q, sin_p, sin_q, ..] = *sums;
    [s.mul_add(sin_p, c * cos_p), s.mul_add(sin_q, c * cos_q)]
}

#[inline(always)]
fn for_second<L: Lanes>(sums: &[Lane<L>; 6], [c, s]: [Lane<L>; 2]) -> [Lane<L>; 2] {
    let [cos_p, cos_q, sin_p, sin_q, sin_z, cos_z] = *sums;
    [
        s.mul_add(cos_q, c.mul_add(cos_p, sin_z)),
        s.mul_add(sin_q, c.mul_add(sin_p, -cos_z)),
    ]
}

/// Both references as cosine and sine, from [`circular_sums`](super::formula::circular_sums).
#[inline(always)]
pub(super) fn references<L: Lanes>(
    sums: &[Lane<L>; 6],
    held1: Reference<L>,
    held2: Reference<L>,
) -> [[Lane<L>; 2]; 2] {
    let (zero, one) = (Lane::splat(0.0), Lane::splat(1.0));
    let mut best = [[one, zero], [one, zero]];
    let mut most = Lane::splat(f64::NEG_INFINITY);
    for begin in [[one, zero], [-one, zero], [zero, one], [zero, -one]] {
        let mut second = held2.unwrap_or(begin);
        let mut first = held1.unwrap_or([one, zero]);
        for _ in 0..TURNS {
            if held1.is_none() {
                first = unit(for_first(sums, second));
            }
            if held2.is_none() {
                second = unit(for_second(sums, first));
            }
        }
        let [along, across] = for_second(sums, first);
        let agreement = second[1].mul_add(across, second[0] * along);
        let better = most.lt(agreement);
        most = Lane::select(better, agreement, most);
        for (kept, new) in best.iter_mut().zip([first, second]) {
            for (kept, new) in kept.iter_mut().zip(new) {
                *kept = Lane::select(better, new, *kept);
            }
        }
    }
    best
}
