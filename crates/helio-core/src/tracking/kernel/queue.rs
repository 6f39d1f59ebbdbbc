//! Rows to which something happens, collected so that they fill vectors too.

use alloc::vec::Vec;

use super::Rows;
use super::limits::{AxisEnds, AxisRange};
use super::mount::pose;
use super::normal::{MIN_COS_INCIDENCE, OffsetSource, Rays};
use super::pose_errors::{self, PoseErrorSource, Turns};
use crate::lanes::math::Reduced;
use crate::lanes::{BLOCK, Columns, Lanes, Mask};
use crate::status::Status;
use crate::tracking::prepared::{LIMIT_TOLERANCE_RAD, column, repeat_row};

/// Rows from which a queue is emptied: a few vectors, still in the nearest cache.
const ENOUGH: usize = 64;

/// Where a queue's own columns stand after the prepared constants.
mod own {
    use super::column;
    pub const HALF_SUN: usize = column::COUNT;
    pub const RANGE1: usize = HALF_SUN + 3;
    pub const RANGE2: usize = RANGE1 + 2;
    pub const ENDS1: usize = RANGE2 + 2;
    pub const ENDS2: usize = ENDS1 + 2;
    pub const PRESENT: usize = ENDS2 + 2;
    pub const COUNT: usize = PRESENT + 2 - column::COUNT;
}

/// One row's inputs.
pub(super) struct Entry {
    /// Row of the answer.
    pub out_row: usize,
    pub constants: [f64; column::COUNT],
    pub half_sun: [f64; 3],
    pub ranges: [AxisRange<f64>; 2],
    pub ends: [AxisEnds<f64>; 2],
    /// NaN where not known.
    pub present: [f64; 2],
}

/// Some rows, in blocks like the field's.
#[derive(Clone)]
pub(super) struct Queue {
    constants: Vec<Columns<{ column::COUNT }>>,
    own: Vec<Columns<{ own::COUNT }>>,
    /// As long as rows with pose errors were ever pushed.
    pose_errors: Vec<Columns<{ pose_errors::COUNT }>>,
    out_rows: Vec<usize>,
    len: usize,
}

impl Queue {
    pub fn new() -> Self {
        Self {
            constants: Vec::new(),
            own: Vec::new(),
            pose_errors: Vec::new(),
            out_rows: Vec::new(),
            len: 0,
        }
    }

    pub fn push(&mut self, entry: Entry) {
        let (block, lane) = (self.len / BLOCK, self.len % BLOCK);
        if self.constants.len() <= block {
            self.constants.push(Columns([[0.0; BLOCK]; column::COUNT]));
            self.own.push(Columns([[0.0; BLOCK]; own::COUNT]));
            self.out_rows.resize((block + 1) * BLOCK, 0);
        }
        for (column, value) in self.constants[block].0.iter_mut().zip(entry.constants) {
            column[lane] = value;
        }
        let [range1, range2] = entry.ranges.map(|r| [r.middle, r.reach]);
        let [ends1, ends2] = entry.ends.map(|e| [e.low, e.high]);
        let limits = range1.iter().chain(&range2).chain(&ends1).chain(&ends2);
        let own = entry.half_sun.iter().chain(limits).chain(&entry.present);
        for (column, value) in self.own[block].0.iter_mut().zip(own) {
            column[lane] = *value;
        }
        self.out_rows[self.len] = entry.out_row;
        self.len += 1;
    }

    /// Those of the row pushed last: for every row of a field with pose errors, and for none of another.
    pub fn push_pose_errors(&mut self, values: [f64; pose_errors::COUNT]) {
        let row = self.len - 1;
        if self.pose_errors.len() <= row / BLOCK {
            self.pose_errors
                .push(Columns([[0.0; BLOCK]; pose_errors::COUNT]));
        }
        for (column, value) in self.pose_errors[row / BLOCK].0.iter_mut().zip(values) {
            column[row % BLOCK] = value;
        }
    }

    pub fn wants_emptying(&self) -> bool {
        self.len >= ENOUGH
    }

    /// Computes the rows and puts them in their places. True if one lies outside its limits.
    #[inline(always)]
    pub fn empty<V: Lanes, O: OffsetSource, G: PoseErrorSource>(
        &mut self,
        offset: O,
        out: &mut Rows<'_>,
    ) -> bool {
        let mut any_outside = false;
        // The rest of the last block repeats a row: padding must not take a path of its own.
        for row in self.len..self.len.next_multiple_of(BLOCK) {
            repeat_row(&mut self.constants, self.len - 1, row);
            repeat_row(&mut self.own, self.len - 1, row);
            if G::ANY {
                repeat_row(&mut self.pose_errors, self.len - 1, row);
            }
        }
        let mut first = 0;
        while first < self.len {
            let answer = self.full_group::<V, O, G>(offset, first);
            for lane in 0..V::WIDTH.min(self.len - first) {
                let row = self.out_rows[first + lane];
                let status = Status::from_code(answer.status[lane] as u8).unwrap_or_default();
                out.axis1[row] = answer.axis1[lane];
                out.axis2[row] = answer.axis2[lane];
                out.incidence[row] = answer.incidence[lane];
                out.status[row] = status;
                if status == Status::OutsideLimits {
                    out.limit_excess[row] = answer.limit_excess[lane];
                    any_outside = true;
                }
            }
            first += V::WIDTH;
        }
        self.len = 0;
        any_outside
    }

    #[inline(always)]
    fn own<L: Lanes>(&self, row: usize, which: usize) -> L {
        L::load(&self.own[row / BLOCK], row % BLOCK, which - column::COUNT)
    }

    #[inline(always)]
    fn range<L: Lanes>(&self, row: usize, first: usize) -> AxisRange<L> {
        AxisRange {
            middle: self.own(row, first),
            reach: self.own(row, first + 1),
        }
    }

    #[inline(always)]
    fn ends<L: Lanes>(&self, row: usize, first: usize) -> AxisEnds<L> {
        AxisEnds {
            low: self.own(row, first),
            high: self.own(row, first + 1),
        }
    }

    /// Rows to which anything may happen.
    #[inline(always)]
    fn full_group<L: Lanes, O: OffsetSource, G: PoseErrorSource>(
        &self,
        offset: O,
        row: usize,
    ) -> Answer {
        let splat = L::splat;
        let nan = splat(f64::NAN);
        let half_t = [
            L::load(&self.constants[row / BLOCK], row % BLOCK, column::HALF_AIM),
            L::load(
                &self.constants[row / BLOCK],
                row % BLOCK,
                column::HALF_AIM + 1,
            ),
            L::load(
                &self.constants[row / BLOCK],
                row % BLOCK,
                column::HALF_AIM + 2,
            ),
        ];
        let half_s = [
            self.own::<L>(row, own::HALF_SUN),
            self.own::<L>(row, own::HALF_SUN + 1),
            self.own::<L>(row, own::HALF_SUN + 2),
        ];
        let ratio = L::load(&self.constants[row / BLOCK], row % BLOCK, column::RATIO);
        let ranges = [
            self.range::<L>(row, own::RANGE1),
            self.range::<L>(row, own::RANGE2),
        ];
        let ends = [
            self.ends::<L>(row, own::ENDS1),
            self.ends::<L>(row, own::ENDS2),
        ];
        let present = [
            self.own::<L>(row, own::PRESENT),
            self.own::<L>(row, own::PRESENT + 1),
        ];

        let rays = Rays {
            half_t,
            half_s,
            ratio,
        };
        let bisector = offset.bisector(&rays);
        let k = offset.lean::<L, true>(ratio, &bisector);
        let normal = offset.normal::<L, true>(&rays, &bisector, k);
        let pose = pose::<L>(&self.constants[row / BLOCK], row % BLOCK, normal.n);
        let [mut direct, mut over] = pose.both(&self.constants[row / BLOCK], row % BLOCK);

        let free1 = pose.on_fixed_axis();
        if G::ANY {
            let (block, lane) = (row / BLOCK, row % BLOCK);
            // Where the first axis may stand anywhere, the second sags by where it does stand.
            let shift1 = L::load(&self.constants[block], lane, column::SHIFT1);
            let free_gamma = stay(ranges[0].window(shift1), &ends[0], present[0]).sub(shift1);
            let turns = Turns::load(&self.pose_errors[block], lane);
            let [of_direct, of_over] = pose.turns(&self.constants[block], lane, &turns, free_gamma);
            direct = [direct[0].sub(of_direct[0]), direct[1].sub(of_direct[1])];
            over = [over[0].sub(of_over[0]), over[1].sub(of_over[1])];
        }
        let direct = Choice::of(direct, free1, &ranges, &ends, present);
        let over = Choice::of(over, free1, &ranges, &ends, present);
        // Without any limit the direct solution is the answer; see AxisLimits::NONE.
        let infinite = splat(f64::INFINITY);
        let limited = ends[0]
            .low
            .max(ends[1].low)
            .le(splat(f64::NEG_INFINITY))
            .and(infinite.le(ends[0].high.min(ends[1].high)))
            .not();
        let shorter = direct.fits.and(over.travel.lt(direct.travel)).and(limited);
        let take_over = over.fits.and(direct.fits.not().or(shorter));

        let ok = code::<L>(Status::Ok);
        let fits = direct.fits.or(over.fits);
        let mut status = L::select(fits, ok, code::<L>(Status::OutsideLimits));
        let reachable = splat(0.0).le(pose.d1_sq);
        status = L::select(reachable, status, code::<L>(Status::Unreachable));
        let lit = splat(MIN_COS_INCIDENCE).lt(normal.cos_incidence);
        status = L::select(lit, status, code::<L>(Status::SunOpposesAim));
        status = L::select(ratio.le(splat(1.0)), status, code::<L>(Status::AimAtPivot));

        let good = status.le(ok);
        let mut answer = Answer::default();
        L::select(
            good,
            L::select(take_over, over.angles[0], direct.angles[0]),
            nan,
        )
        .write(&mut answer.axis1);
        L::select(
            good,
            L::select(take_over, over.angles[1], direct.angles[1]),
            nan,
        )
        .write(&mut answer.axis2);
        let incidence = Reduced::acute(bisector.cos_theta, bisector.sin_sq_theta.sqrt()).angle();
        L::select(good, incidence, nan).write(&mut answer.incidence);
        let excess = direct
            .excess
            .min(over.excess)
            .add(splat(LIMIT_TOLERANCE_RAD));
        excess.write(&mut answer.limit_excess);
        status.write(&mut answer.status);
        answer
    }
}

#[inline(always)]
fn code<L: Lanes>(status: Status) -> L {
    L::splat(f64::from(status.code()))
}

/// Columns of up to a block's answers.
#[derive(Default)]
struct Answer {
    axis1: [f64; BLOCK],
    axis2: [f64; BLOCK],
    incidence: [f64; BLOCK],
    limit_excess: [f64; BLOCK],
    status: [f64; BLOCK],
}

/// Where any angle will do an axis stays, or moves no farther than into its limits.
#[inline(always)]
fn stay<L: Lanes>(home: L, ends: &AxisEnds<L>, present: L) -> L {
    let tolerance = L::splat(LIMIT_TOLERANCE_RAD);
    L::select(present.le(L::splat(f64::INFINITY)), present, home)
        .max(ends.low.add(tolerance))
        .min(ends.high.sub(tolerance))
}

/// One of the two solutions, by the turns that suit the limits and the present position.
#[derive(Clone, Copy)]
struct Choice<L: Lanes> {
    angles: [L; 2],
    /// How far outside its limits the worse axis is, less the tolerance.
    excess: L,
    fits: L::Mask,
    /// Way of the axis that has the longer one; none for an axis whose present is not known.
    travel: L,
}

impl<L: Lanes> Choice<L> {
    /// `free1` is true where any angle of the first axis will do.
    #[inline(always)]
    fn of(
        solution: [L; 2],
        free1: L::Mask,
        ranges: &[AxisRange<L>; 2],
        ends: &[AxisEnds<L>; 2],
        present: [L; 2],
    ) -> Self {
        // A second axis without limits is not wrapped.
        let infinite = L::splat(f64::INFINITY);
        let known = [present[0].le(infinite), present[1].le(infinite)];
        let unlimited2 = ends[1]
            .low
            .le(L::splat(f64::NEG_INFINITY))
            .and(infinite.le(ends[1].high));
        let home = [
            ranges[0].window(solution[0]),
            L::select(unlimited2, solution[1], ranges[1].window(solution[1])),
        ];
        let excess1 = L::select(
            free1,
            L::splat(-1.0),
            L::splat(0.0).sub(ranges[0].margin(home[0])),
        );
        let excess2 = L::splat(0.0).sub(ranges[1].margin(home[1]));
        let excess = excess1.max(excess2);
        let fits = excess.le(L::splat(0.0));
        let angles = [
            L::select(
                free1,
                stay(home[0], &ends[0], present[0]),
                ends[0].nearest(home[0], present[0]),
            ),
            ends[1].nearest(home[1], present[1]),
        ];
        let zero = L::splat(0.0);
        let travel1 = L::select(known[0], angles[0].sub(present[0]).abs(), zero);
        let travel2 = L::select(known[1], angles[1].sub(present[1]).abs(), zero);
        let travel = travel1.max(travel2);
        Self {
            angles,
            excess,
            fits,
            travel,
        }
    }
}
