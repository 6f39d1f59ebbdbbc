//! Axis limits and wrap-around, in lanes.

use alloc::vec::Vec;
use core::f64::consts::{PI, TAU};

use crate::lanes::{BLOCK, Columns, Lanes, Mask};
use crate::mount::AxisLimits;
use crate::tracking::prepared::LIMIT_TOLERANCE_RAD;

/// Limits of a field, per axis: middle of the window in which its angle is given, and greatest distance
/// from there (see [`AxisRange`]). What only a present position needs is kept apart.
#[derive(Debug, Clone)]
pub(crate) enum Limits {
    /// No heliostat is limited.
    None,
    /// All heliostats have the same: no memory is read.
    Uniform([f64; 4]),
    /// Columns: middle and reach of either axis.
    PerHeliostat(Vec<Columns<4>>),
}

impl Limits {
    pub fn new(unlimited: bool, rows: &[[f64; 4]], blocks: usize) -> Self {
        let Some(first) = rows.first() else {
            return Self::None;
        };
        if unlimited {
            return Self::None;
        }
        if rows.iter().all(|row| row == first) {
            return Self::Uniform(*first);
        }
        let mut columns = alloc::vec![Columns([[0.0; BLOCK]; 4]); blocks];
        for row in 0..blocks * BLOCK {
            let values = rows[row.min(rows.len() - 1)];
            let Columns(block) = &mut columns[row / BLOCK];
            for (column, value) in block.iter_mut().zip(values) {
                column[row % BLOCK] = value;
            }
        }
        Self::PerHeliostat(columns)
    }
}

/// Where an axis' angle is given: in the full turn about `middle`, where it must not be farther from
/// the middle than `reach`. Kernels count angles from the middle until the end.
///
/// With two limits their middle is meant. A single limit moves the window but excludes no
/// direction, since some number of turns always leads inside.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct AxisRange<L> {
    pub middle: L,
    pub reach: L,
}

impl AxisRange<f64> {
    /// Of the first axis: [0, 2π) without limits.
    pub fn of_axis1(limits: &AxisLimits) -> Self {
        Self::new(limits.axis1_min_rad, limits.axis1_max_rad, PI)
    }

    /// Of the second axis. Without limits its angle is not wrapped at all and counts from zero.
    pub fn of_axis2(limits: &AxisLimits, reference_rad: f64) -> Self {
        let (min_rad, max_rad) = (limits.axis2_min_rad, limits.axis2_max_rad);
        if min_rad.is_infinite() && max_rad.is_infinite() {
            return Self {
                middle: 0.0,
                reach: f64::INFINITY,
            };
        }
        Self::new(min_rad, max_rad, reference_rad)
    }

    fn new(min_rad: f64, max_rad: f64, default_middle: f64) -> Self {
        let infinite = f64::INFINITY;
        match (min_rad.is_finite(), max_rad.is_finite()) {
            (true, true) => Self {
                middle: 0.5 * (min_rad + max_rad),
                reach: 0.5 * (max_rad - min_rad) + LIMIT_TOLERANCE_RAD,
            },
            (true, false) => Self {
                middle: default_middle.max(min_rad + PI),
                reach: infinite,
            },
            (false, true) => Self {
                middle: default_middle.min(max_rad - PI),
                reach: infinite,
            },
            (false, false) => Self {
                middle: default_middle,
                reach: infinite,
            },
        }
    }
}

/// Least and greatest angle of one axis, widened by the tolerance; not of a window.
#[derive(Clone, Copy)]
pub(crate) struct AxisEnds<L> {
    pub low: L,
    pub high: L,
}

/// How a kernel gets at its limits; chosen once per call, so that the loop has no branch.
pub(crate) trait LimitSource: Copy {
    const LIMITED: bool;
    /// Range of axis 1 (0) or 2 (1) for the rows from `lane` of block `block`.
    fn range<L: Lanes>(self, block: usize, lane: usize, axis: usize) -> AxisRange<L>;
    /// Asks for the memory of a block, if there is one.
    #[inline(always)]
    fn prefetch<L: Lanes>(self, _block: usize) {}
}

/// No heliostat is limited: axis 1 in [0, 2π), axis 2 as it comes.
#[derive(Clone, Copy)]
pub(crate) struct Unlimited;

impl LimitSource for Unlimited {
    const LIMITED: bool = false;
    #[inline(always)]
    fn range<L: Lanes>(self, _block: usize, _lane: usize, axis: usize) -> AxisRange<L> {
        let middle = L::splat(if axis == 0 { PI } else { 0.0 });
        AxisRange {
            middle,
            reach: L::splat(f64::INFINITY),
        }
    }
}

/// The same limits everywhere.
#[derive(Clone, Copy)]
pub(crate) struct Uniform<'a>(pub &'a [f64; 4]);

impl LimitSource for Uniform<'_> {
    const LIMITED: bool = true;
    #[inline(always)]
    fn range<L: Lanes>(self, _block: usize, _lane: usize, axis: usize) -> AxisRange<L> {
        AxisRange {
            middle: L::splat(self.0[2 * axis]),
            reach: L::splat(self.0[2 * axis + 1]),
        }
    }
}

/// Limits as columns.
#[derive(Clone, Copy)]
pub(crate) struct PerHeliostat<'a>(pub &'a [Columns<4>]);

impl LimitSource for PerHeliostat<'_> {
    const LIMITED: bool = true;
    #[inline(always)]
    fn range<L: Lanes>(self, block: usize, lane: usize, axis: usize) -> AxisRange<L> {
        AxisRange {
            middle: L::load(&self.0[block], lane, 2 * axis),
            reach: L::load(&self.0[block], lane, 2 * axis + 1),
        }
    }
    #[inline(always)]
    fn prefetch<L: Lanes>(self, block: usize) {
        if let Some(limits) = self.0.get(block) {
            L::prefetch(limits, 0, 0);
            L::prefetch(limits, 0, 1);
            L::prefetch(limits, 0, 2);
            L::prefetch(limits, 0, 3);
        }
    }
}

/// The representative within half a turn of an angle counted from a middle. The upper end is drawn in
/// by a few roundings' width and the lower one kept, so that a middle of π gives [0, 2π).
#[inline(always)]
pub(crate) fn within_half_turn<L: Lanes>(from_middle: L) -> L {
    const DRAWN_IN: f64 = 2.0 * f64::EPSILON;
    let turns = from_middle
        .mul_add(L::splat(1.0 / TAU), L::splat(DRAWN_IN))
        .round();
    turns
        .neg_mul_add(L::splat(TAU), from_middle)
        .max(L::splat(-PI))
}

impl AxisEnds<f64> {
    /// Of both axes.
    pub fn of(l: &AxisLimits) -> [Self; 2] {
        [
            [l.axis1_min_rad, l.axis1_max_rad],
            [l.axis2_min_rad, l.axis2_max_rad],
        ]
        .map(|[low, high]| Self {
            low: low - LIMIT_TOLERANCE_RAD,
            high: high + LIMIT_TOLERANCE_RAD,
        })
    }
}

impl<L: Lanes> AxisEnds<L> {
    /// The representative of an angle that is nearest to `present` and within the limits; `home`
    /// where there is none, or `present` is NaN.
    #[inline(always)]
    pub fn nearest(&self, home: L, present: L) -> L {
        let per_turn = L::splat(1.0 / TAU);
        let wanted = present.sub(home).mul(per_turn).add(L::splat(0.5)).floor();
        // -floor(-x) is the ceiling
        let least = L::splat(0.0).sub(home.sub(self.low).mul(per_turn).floor());
        let most = self.high.sub(home).mul(per_turn).floor();
        let turns = wanted.max(least).min(most);
        let near = turns.mul_add(L::splat(TAU), home);
        let known = present.le(L::splat(f64::INFINITY));
        let inside = self.low.le(near).and(near.le(self.high)).and(known);
        L::select(inside, near, home)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::angle::wrap_tau;

    // Against the one wrapping that is written for people, within rounding and on the circle.
    #[test]
    fn a_middle_of_half_a_turn_gives_the_full_turn_from_zero() {
        let mut angles: Vec<f64> = (-40_000..40_000).map(|k| f64::from(k) * 5e-4).collect();
        for turn in -3..=3 {
            for ulps in -40..=40 {
                angles.push(f64::from(turn) * PI + f64::from(ulps) * 1.1e-16);
            }
        }
        for angle in angles {
            let wrapped = within_half_turn(angle - PI) + PI;
            assert!((0.0..TAU).contains(&wrapped), "{angle:e}: {wrapped:e}");
            let apart = (wrapped - wrap_tau(angle)).abs();
            assert!(apart.min(TAU - apart) < 8e-15, "{angle}: {wrapped}");
        }
    }
}
