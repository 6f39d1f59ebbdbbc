//! Axis limits and wrap-around, in lanes.

use alloc::vec::Vec;
use core::f64::consts::{PI, TAU};

use crate::lanes::{BLOCK, Columns, Lanes, Mask};
use crate::tracking::prepared::column;

/// Limits of a field, per axis: middle of the window in which its angle is given, and greatest distance
/// from there (see [`AxisRange`]). What only a present position needs is kept apart.
#[derive(Debug, Clone)]
pub(crate) enum Limits {
    /// No heliostat is limited.
    None,
    /// All heliostats have the same: no memory is read.
    Uniform([f64; 4]),
    /// Six columns.
    PerHeliostat(Vec<Columns<4>>),
}

impl Limits {
    pub fn new(unlimited: bool, rows: &[[f64; 4]], blocks: usize) -> Self {
        let Some(first) = rows.first() else { return Self::None };
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

/// Start of the full turn \[rad\] in which an axis' angle is given: centred on the limits where there
/// are two, else moved no farther from `default` than the one limit asks for.
pub(crate) fn window_start(min_rad: f64, max_rad: f64, default: f64) -> f64 {
    match (min_rad.is_finite(), max_rad.is_finite()) {
        (true, true) => 0.5 * (min_rad + max_rad) - PI,
        (true, false) => default.max(min_rad),
        (false, true) => default.min(max_rad - TAU),
        (false, false) => default,
    }
}

/// Where an axis' angle is given: in the full turn about `middle`, where it must not be farther from
/// the middle than `reach`.
///
/// With two limits their middle is meant. A single limit moves the window but excludes no
/// direction, since some number of turns always leads inside.
#[derive(Clone, Copy)]
pub(crate) struct AxisRange<L> {
    pub middle: L,
    pub reach: L,
}

/// Least and greatest angle of one axis, widened by the tolerance.
#[derive(Clone, Copy)]
pub(crate) struct AxisEnds<L> {
    pub low: L,
    pub high: L,
}

/// How a kernel gets at its limits; chosen once per call, so that the loop has no branch.
pub(crate) trait LimitSource: Copy {
    const LIMITED: bool;
    /// Range of axis 1 (0) or 2 (1) for the rows from `row`.
    fn range<L: Lanes>(self, row: usize, axis: usize) -> AxisRange<L>;
    /// Asks for the memory of the rows from `row`.
    #[inline(always)]
    fn prefetch<L: Lanes>(self, _row: usize) {}
}

/// No heliostat is limited: axis 1 in [0, 2π), axis 2 as it comes.
#[derive(Clone, Copy)]
pub(crate) struct Unlimited<'a>(pub &'a [Columns<{ column::COUNT }>]);

impl LimitSource for Unlimited<'_> {
    const LIMITED: bool = false;
    #[inline(always)]
    fn range<L: Lanes>(self, row: usize, axis: usize) -> AxisRange<L> {
        let middle = if axis == 0 {
            L::splat(PI)
        } else {
            L::load(self.0, row, column::REFERENCE2)
        };
        AxisRange { middle, reach: L::splat(f64::INFINITY) }
    }
}

/// The same limits everywhere.
#[derive(Clone, Copy)]
pub(crate) struct Uniform<'a>(pub &'a [f64; 4]);

impl LimitSource for Uniform<'_> {
    const LIMITED: bool = true;
    #[inline(always)]
    fn range<L: Lanes>(self, _row: usize, axis: usize) -> AxisRange<L> {
        AxisRange { middle: L::splat(self.0[2 * axis]), reach: L::splat(self.0[2 * axis + 1]) }
    }
}

/// Limits as columns.
#[derive(Clone, Copy)]
pub(crate) struct PerHeliostat<'a>(pub &'a [Columns<4>]);

impl LimitSource for PerHeliostat<'_> {
    const LIMITED: bool = true;
    #[inline(always)]
    fn range<L: Lanes>(self, row: usize, axis: usize) -> AxisRange<L> {
        AxisRange {
            middle: L::load(self.0, row, 2 * axis),
            reach: L::load(self.0, row, 2 * axis + 1),
        }
    }
    #[inline(always)]
    fn prefetch<L: Lanes>(self, row: usize) {
        L::prefetch(self.0, row, 0);
        L::prefetch(self.0, row, 1);
        L::prefetch(self.0, row, 2);
        L::prefetch(self.0, row, 3);
    }
}

/// An encoder reference, moved by whole turns only if it must, so that reference plus any angle from
/// `least_rad` to `greatest_rad` is at most a turn away from the window that begins at `start_rad`.
pub(crate) fn near_window(
    reference_rad: f64,
    start_rad: f64,
    least_rad: f64,
    greatest_rad: f64,
) -> f64 {
    let low = start_rad - TAU - least_rad;
    let high = start_rad + 2.0 * TAU - greatest_rad;
    if reference_rad >= low && reference_rad < high {
        return reference_rad;
    }
    let turns = libm::floor((reference_rad - (0.5 * (low + high) - PI)) / TAU);
    reference_rad - turns * TAU
}

impl<L: Lanes> AxisRange<L> {
    /// The representative in [middle - π, middle + π) of an angle at most a turn away from there;
    /// the references are prepared so that every solution is ([`near_window`]).
    #[inline(always)]
    pub fn home(&self, angle: L) -> L {
        let (pi, tau) = (L::splat(PI), L::splat(TAU));
        let angle = L::select(angle.lt(self.middle.sub(pi)), angle.add(tau), angle);
        L::select(self.middle.add(pi).le(angle), angle.sub(tau), angle)
    }

    /// True where an angle lies within the limits.
    #[inline(always)]
    pub fn holds(&self, angle: L) -> L::Mask {
        angle.sub(self.middle).abs().le(self.reach)
    }

    /// How far an angle lies outside; negative inside.
    #[inline(always)]
    pub fn excess(&self, angle: L) -> L {
        angle.sub(self.middle).abs().sub(self.reach)
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
        let inside = self.low.le(near).and(near.le(self.high));
        L::select(inside, near, home)
    }
}
