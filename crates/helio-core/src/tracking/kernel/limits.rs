//! Axis limits and wrap-around, in lanes.

use alloc::vec::Vec;
use core::f64::consts::{PI, TAU};

use crate::lanes::{BLOCK, Lanes, Mask, SingleColumns, prefetch};
use crate::mount::AxisLimits;
use crate::tracking::prepared::LIMIT_TOLERANCE_RAD;

/// Limits of a field, per axis: middle of the window in which its angle is given, and greatest distance
/// from there (see [`AxisRange`]). What only a present position needs is kept apart.
#[derive(Debug, Clone)]
pub(crate) enum Limits {
    /// No heliostat is limited.
    None,
    /// All heliostats have the same, as [`AxisRange::narrowed`]: no memory is read.
    Uniform([AxisRange<f64>; 2]),
    /// Middle and reach of either axis, as [`AxisRange::narrowed`].
    PerHeliostat(Vec<SingleColumns<4>>),
}

impl Limits {
    /// With `apart` always [`PerHeliostat`](Self::PerHeliostat): one kernel less to compile.
    pub fn new(unlimited: bool, apart: bool, rows: &[[AxisRange<f64>; 2]], blocks: usize) -> Self {
        let Some(first) = rows.first() else {
            return Self::None;
        };
        if unlimited && !apart {
            return Self::None;
        }
        if !apart && rows.iter().all(|row| row == first) {
            return Self::Uniform(first.map(AxisRange::narrowed));
        }
        let mut columns = alloc::vec![SingleColumns([[0.0; BLOCK]; 4]); blocks];
        for row in 0..blocks * BLOCK {
            let [axis1, axis2] = rows[row.min(rows.len() - 1)].map(AxisRange::narrowed);
            let values = [axis1.middle, axis1.reach, axis2.middle, axis2.reach];
            let SingleColumns(block) = &mut columns[row / BLOCK];
            for (column, value) in block.iter_mut().zip(values) {
                // exact: narrowed to singles
                column[row % BLOCK] = value as f32;
            }
        }
        Self::PerHeliostat(columns)
    }
}

/// Reach of a window that excludes nothing.
const EVERYWHERE: f64 = f64::MAX;

/// Far above the roundings of an angle, far below an encoder step.
const NARROWER_RAD: f64 = 1e-9;

/// Where an axis' angle is given: in the full turn about `middle`, where it must not be farther from
/// the middle than `reach`. Kernels count angles from the middle until the end.
///
/// With two limits their middle is meant. A single limit moves the window but excludes no
/// direction, since some number of turns always leads inside: its reach is [`EVERYWHERE`]. An infinite reach
/// is that of an angle which is not wrapped at all.
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
        match (min_rad.is_finite(), max_rad.is_finite()) {
            (true, true) => {
                let half_rad = 0.5 * (max_rad - min_rad);
                Self {
                    middle: 0.5 * (min_rad + max_rad),
                    reach: if half_rad >= PI {
                        EVERYWHERE
                    } else {
                        half_rad + LIMIT_TOLERANCE_RAD
                    },
                }
            }
            (true, false) => Self {
                middle: default_middle.max(min_rad + PI),
                reach: EVERYWHERE,
            },
            (false, true) => Self {
                middle: default_middle.min(max_rad - PI),
                reach: EVERYWHERE,
            },
            (false, false) => Self {
                middle: default_middle,
                reach: EVERYWHERE,
            },
        }
    }

    /// In single precision, and drawn in so far that what is inside it is certainly inside this
    /// one, in the same turn. Kernels judge by it what is plainly inside; the rest is judged by this one.
    fn narrowed(self) -> Self {
        let middle = f64::from(self.middle as f32);
        let mut reach = self.reach;
        if reach.is_finite() {
            reach = reach.min(PI) - (middle - self.middle).abs() - NARROWER_RAD;
        }
        Self {
            middle,
            reach: f64::from((reach as f32).next_down()),
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
    fn prefetch(self, _block: usize) {}
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
pub(crate) struct Uniform<'a>(pub &'a [AxisRange<f64>; 2]);

impl LimitSource for Uniform<'_> {
    const LIMITED: bool = true;
    #[inline(always)]
    fn range<L: Lanes>(self, _block: usize, _lane: usize, axis: usize) -> AxisRange<L> {
        AxisRange {
            middle: L::splat(self.0[axis].middle),
            reach: L::splat(self.0[axis].reach),
        }
    }
}

/// Limits as columns.
#[derive(Clone, Copy)]
pub(crate) struct PerHeliostat<'a>(pub &'a [SingleColumns<4>]);

impl LimitSource for PerHeliostat<'_> {
    const LIMITED: bool = true;
    #[inline(always)]
    fn range<L: Lanes>(self, block: usize, lane: usize, axis: usize) -> AxisRange<L> {
        AxisRange {
            middle: L::read_singles(&self.0[block].0[2 * axis][lane..]),
            reach: L::read_singles(&self.0[block].0[2 * axis + 1][lane..]),
        }
    }
    #[inline(always)]
    fn prefetch(self, block: usize) {
        if let Some(limits) = self.0.get(block) {
            prefetch(limits, 0, 0);
            prefetch(limits, 0, 1);
        }
    }
}

impl<L: Lanes> AxisRange<L> {
    /// The whole turns that lead an angle into the window, taken off.
    ///
    /// The window's upper end is drawn in by a few roundings' width, so that what lies there by rounding
    /// comes out at the lower one.
    #[inline(always)]
    pub fn nearest_turn(&self, angle: L) -> L {
        const DRAWN_IN: f64 = 2.0 * f64::EPSILON;
        let turns = angle
            .sub(self.middle)
            .mul_add(L::splat(1.0 / TAU), L::splat(DRAWN_IN))
            .round();
        turns.neg_mul_add(L::splat(TAU), angle)
    }

    /// The representative of an angle in the window, not below its lower end by a rounding: a middle of π
    /// gives [0, 2π).
    #[inline(always)]
    pub fn window(&self, angle: L) -> L {
        self.nearest_turn(angle).max(self.middle.sub(L::splat(PI)))
    }

    /// How far inside the reach an angle is; negative outside.
    #[inline(always)]
    pub fn margin(&self, angle: L) -> L {
        self.reach.sub(angle.sub(self.middle).abs())
    }
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
        let range = AxisRange::of_axis1(&AxisLimits::NONE);
        let mut angles: Vec<f64> = (-40_000..40_000).map(|k| f64::from(k) * 5e-4).collect();
        for turn in -3..=3 {
            for ulps in -40..=40 {
                angles.push(f64::from(turn) * PI + f64::from(ulps) * 1.1e-16);
            }
        }
        for angle in angles {
            let wrapped = range.window(angle);
            assert!((0.0..TAU).contains(&wrapped), "{angle:e}: {wrapped:e}");
            let apart = (wrapped - wrap_tau(angle)).abs();
            assert!(apart.min(TAU - apart) < 8e-15, "{angle}: {wrapped}");
        }
    }

    // What the narrow range takes for inside is inside the true one, in the same turn.
    #[test]
    fn what_is_inside_a_narrowed_range_is_inside_the_range() {
        let mut inside = 0;
        for step in 0..20_000_u32 {
            let unit = |k: u32| f64::from((step * 7919 + k * 104_729) % 10_007) / 10_007.0;
            let middle = (unit(1) - 0.5) * if step % 3 == 0 { 2000.0 } else { 10.0 };
            let reach = unit(2) * 4.0;
            let limits = AxisLimits {
                axis1_min_rad: middle - reach,
                axis1_max_rad: middle + reach,
                ..AxisLimits::NONE
            };
            let range = AxisRange::of_axis1(&limits);
            let narrow = range.narrowed();
            // about its ends and about those of the turn
            let end = if step % 2 == 0 { reach } else { PI };
            let near = 10_f64.powf(-13.0 * unit(3)) * if step % 5 < 2 { -1.0 } else { 1.0 };
            let angle = middle
                + if step % 7 < 3 {
                    end + near
                } else {
                    -end - near
                };
            let turned = narrow.nearest_turn(angle);
            if narrow.margin(turned) >= 0.0 {
                inside += 1;
                assert!(range.margin(turned) > 0.0, "{range:?} {angle}");
                assert_eq!(range.window(angle).to_bits(), turned.to_bits());
                assert!((turned - middle).abs() < PI);
            }
        }
        assert!(inside > 5_000, "{inside}");
    }
}
