//! Normal equations in lanes: H = L D Lᵀ, which a scaling of the columns changes by nothing but that
//! scaling, so that none is needed: a pivot over its own diagonal element, 1 less the squared multiple
//! correlation of that column with those before it, says how safe it is in any unit.

use helio_core::lanes::{Lanes, Mask};

use super::lane::Lane;
use crate::model::Real;

/// Least pivot over diagonal element that counts as safe: columns then keep half of their digits.
const SAFE_PIVOT: f64 = 1e-9;

/// L (below the diagonal) and 1/D (on it).
#[derive(Clone, Copy)]
pub(super) struct Factor<L, const P: usize> {
    pub rows: [[Lane<L>; P]; P],
}

impl<L: Lanes, const P: usize> Factor<L, P> {
    /// Of a matrix of which only the lower triangle is read; and where every pivot is safe.
    #[inline(always)]
    pub fn new(matrix: &[[Lane<L>; P]; P]) -> (Self, L::Mask) {
        let zero = Lane::splat(0.0);
        let one = Lane::splat(1.0);
        let mut rows = *matrix;
        let mut safe = zero.lt(one);
        for j in 0..P {
            // row j of L D, then of L
            let mut scaled = [zero; P];
            scaled[..j].copy_from_slice(&rows[j][..j]);
            let mut pivot = matrix[j][j];
            for k in 0..j {
                let factor = scaled[k] * rows[k][k];
                pivot = factor.neg_mul_add(scaled[k], pivot);
                rows[j][k] = factor;
            }
            safe = safe.and((matrix[j][j] * Lane::splat(SAFE_PIVOT)).lt(pivot));
            rows[j][j] = one / pivot;
            for i in j + 1..P {
                let mut value = matrix[i][j];
                for k in 0..j {
                    // rows[i][k] still holds L D of the rows below
                    value = rows[i][k].neg_mul_add(rows[j][k], value);
                }
                rows[i][j] = value;
            }
        }
        (Self { rows }, safe)
    }

    /// x with H x = -g.
    #[inline(always)]
    pub fn solve_negative(&self, g: &[Lane<L>; P]) -> [Lane<L>; P] {
        let mut x = *g;
        for i in 0..P {
            let mut value = -x[i];
            for k in 0..i {
                value = self.rows[i][k].neg_mul_add(x[k], value);
            }
            x[i] = value;
        }
        for i in 0..P {
            x[i] = x[i] * self.rows[i][i];
        }
        for i in (0..P).rev() {
            let mut value = x[i];
            for k in i + 1..P {
                value = self.rows[k][i].neg_mul_add(x[k], value);
            }
            x[i] = value;
        }
        x
    }

    /// Lower triangle of U D⁻¹ Uᵀ with U = L⁻ᵀ: the covariance of the parameters for errors of size one.
    #[inline(always)]
    pub fn covariance(&self) -> [[Lane<L>; P]; P] {
        let zero = Lane::splat(0.0);
        // L⁻¹, below its diagonal of ones
        let mut inverse = [[zero; P]; P];
        for i in 0..P {
            for j in 0..i {
                let mut value = -self.rows[i][j];
                for k in j + 1..i {
                    value = self.rows[i][k].neg_mul_add(inverse[k][j], value);
                }
                inverse[i][j] = value;
            }
        }
        let mut covariance = [[zero; P]; P];
        for i in 0..P {
            for j in 0..=i {
                // the term k = i has L⁻¹[i][i] = 1
                let own = self.rows[i][i];
                let mut value = if i == j { own } else { inverse[i][j] * own };
                for k in i + 1..P {
                    value = (inverse[k][i] * self.rows[k][k]).mul_add(inverse[k][j], value);
                }
                covariance[i][j] = value;
            }
        }
        covariance
    }
}
