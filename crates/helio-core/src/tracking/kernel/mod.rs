//! The arithmetic of a batch. The callers have checked the arguments; this trusts them.
//!
//! Rows go through [`Job::tile`]. A row that is not plainly ok goes into the [`Queue`] and, with others
//! of its kind, through the same formula with everything that can happen to a row; it gives the
//! same bits where the fast path would have done.

pub(crate) mod dispatch;
pub(crate) mod limits;
pub(crate) mod mount;
pub(crate) mod normal;
pub(crate) mod pose_errors;
mod queue;
mod tile;

use limits::{AxisEnds, LimitSource};
use mount::Constants;
use normal::{OffsetSource, Rays};
use pose_errors::PoseErrorSource;
use queue::Queue;
use tile::Tile;

use super::prepared::{Base, Prepared, TILE, column};
use crate::lanes::{BLOCK, Columns, Lanes};
use crate::status::Status;

/// The answer's columns for consecutive rows of one sun.
pub(crate) struct Rows<'a> {
    pub axis1: &'a mut [f64],
    pub axis2: &'a mut [f64],
    pub incidence: &'a mut [f64],
    pub limit_excess: &'a mut [f64],
    pub status: &'a mut [Status],
}

impl<'a> Rows<'a> {
    /// The part from `start`, `len` long.
    pub fn part(&mut self, start: usize, len: usize) -> Rows<'_> {
        let range = start..start + len;
        Rows {
            axis1: &mut self.axis1[range.clone()],
            axis2: &mut self.axis2[range.clone()],
            incidence: &mut self.incidence[range.clone()],
            limit_excess: &mut self.limit_excess[range.clone()],
            status: &mut self.status[range],
        }
    }

    /// Divides at a row.
    pub fn split_at(self, row: usize) -> (Rows<'a>, Rows<'a>) {
        let (axis1, axis1_rest) = self.axis1.split_at_mut(row);
        let (axis2, axis2_rest) = self.axis2.split_at_mut(row);
        let (incidence, incidence_rest) = self.incidence.split_at_mut(row);
        let (limit_excess, limit_excess_rest) = self.limit_excess.split_at_mut(row);
        let (status, status_rest) = self.status.split_at_mut(row);
        (
            Rows {
                axis1,
                axis2,
                incidence,
                limit_excess,
                status,
            },
            Rows {
                axis1: axis1_rest,
                axis2: axis2_rest,
                incidence: incidence_rest,
                limit_excess: limit_excess_rest,
                status: status_rest,
            },
        )
    }

    pub fn len(&self) -> usize {
        self.status.len()
    }

    /// True if the columns that may be streamed begin on cache lines.
    pub fn are_aligned(&self) -> bool {
        [&self.axis1, &self.axis2, &self.incidence]
            .iter()
            .all(|column| column.as_ptr().addr().is_multiple_of(64))
    }
}

/// Sun along the mount's axes, for some rows of the field.
pub(crate) trait SunSource: Copy {
    /// Half the unit vector to the sun.
    fn half_sun<L: Lanes>(self, block: usize, lane: usize) -> [L; 3];
}

/// One base rotation for the whole field.
#[derive(Clone, Copy)]
pub(crate) struct SharedSun([f64; 3]);

impl SunSource for SharedSun {
    #[inline(always)]
    fn half_sun<L: Lanes>(self, _block: usize, _lane: usize) -> [L; 3] {
        [
            L::splat(self.0[0]),
            L::splat(self.0[1]),
            L::splat(self.0[2]),
        ]
    }
}

/// A base rotation per heliostat.
#[derive(Clone, Copy)]
pub(crate) struct TurnedSun<'a> {
    half_enu: [f64; 3],
    axes: &'a [Columns<9>],
}

impl SunSource for TurnedSun<'_> {
    #[inline(always)]
    fn half_sun<L: Lanes>(self, block: usize, lane: usize) -> [L; 3] {
        let [east, north, up] = self.half_enu;
        let half = [L::splat(east), L::splat(north), L::splat(up)];
        let axes = &self.axes[block];
        [
            along(axes, lane, 0, half),
            along(axes, lane, 1, half),
            along(axes, lane, 2, half),
        ]
    }
}

/// The component of half the sun along one of the mount's axes.
#[inline(always)]
fn along<L: Lanes>(axes: &Columns<9>, lane: usize, axis: usize, half: [L; 3]) -> L {
    let east = L::load(axes, lane, 3 * axis).mul(half[0]);
    let level = L::load(axes, lane, 3 * axis + 1).mul_add(half[1], east);
    L::load(axes, lane, 3 * axis + 2).mul_add(half[2], level)
}

/// Present axis angles of the same rows; NaN where they are not known.
#[derive(Clone, Copy)]
pub(crate) struct PresentRows<'a> {
    pub axis1: &'a [f64],
    pub axis2: &'a [f64],
}

/// Everything a kernel needs of one sun.
#[derive(Clone, Copy)]
pub(crate) struct Job<'a, O, M, S, G> {
    pub prepared: &'a Prepared,
    pub constants: &'a [Constants],
    pub offset: O,
    pub limits: M,
    pub sun: S,
    pub pose_errors: G,
}

impl<O: OffsetSource, M: LimitSource, S: SunSource, G: PoseErrorSource> Job<'_, O, M, S, G> {
    #[inline(always)]
    fn rays<L: Lanes>(&self, constants: &Constants, block: usize, lane: usize) -> Rays<L> {
        Rays {
            half_t: [
                L::load(constants, lane, column::HALF_AIM),
                L::load(constants, lane, column::HALF_AIM + 1),
                L::load(constants, lane, column::HALF_AIM + 2),
            ],
            half_s: self.sun.half_sun::<L>(block, lane),
            ratio: L::load(constants, lane, column::RATIO),
        }
    }

    /// All rows of `out`, which begin at row `first` of the field, a multiple of
    /// [`BLOCK`](crate::lanes::BLOCK). True if a row lies outside its limits.
    #[inline(always)]
    pub fn run<L: Lanes, const STREAM: bool>(
        &self,
        first: usize,
        present: Option<PresentRows<'_>>,
        scratch: &mut Scratch,
        out: &mut Rows<'_>,
    ) -> bool {
        let Scratch { tile, side, queue } = scratch;
        let mut any_outside = false;
        let mut start = 0;
        let blocks_from = |start: usize, len: usize| TILE.min(len - start).div_ceil(BLOCK);
        if present.is_none() && out.len() > 0 {
            self.open_tile::<L>(first / BLOCK, blocks_from(0, out.len()), tile);
        }
        while start < out.len() {
            let count = TILE.min(out.len() - start);
            // With a present position every row has a choice to make.
            let mut open = u64::MAX >> (64 - count);
            if present.is_none() {
                // The rows of the last tile go by way of one on the side, which has room to spare.
                let whole = count == TILE;
                let len = out.len();
                let mut target = if whole {
                    out.part(start, TILE)
                } else {
                    side.rows()
                };
                self.tile::<L, STREAM>(
                    (first + start) / BLOCK,
                    blocks_from(start, len),
                    blocks_from(start + count, len),
                    tile,
                    &mut target,
                );
                if !whole {
                    side.copy_to(&mut out.part(start, count));
                }
                open = tile.open(count);
            }
            while open != 0 {
                let row = start + open.trailing_zeros() as usize;
                self.enqueue(queue, first + row, row, present);
                open &= open - 1;
            }
            start += count;
            if queue.wants_emptying() || start >= out.len() {
                any_outside |= queue.empty::<L, O, G>(self.offset, out);
            }
        }
        any_outside
    }

    /// Copies a row's inputs to the end of the queue.
    fn enqueue(
        &self,
        queue: &mut Queue,
        field_row: usize,
        out_row: usize,
        present: Option<PresentRows<'_>>,
    ) {
        let present = present.map(|p| [p.axis1[out_row], p.axis2[out_row]]);
        let (block, lane) = (field_row / BLOCK, field_row % BLOCK);
        let constants = &self.constants[block];
        let mut row_constants: [f64; column::COUNT] =
            core::array::from_fn(|which| constants.0[which][lane]);
        row_constants[column::SEC_MU] = row_constants[column::SEC_MU].abs();
        queue.push(queue::Entry {
            out_row,
            constants: row_constants,
            half_sun: self.sun.half_sun::<f64>(block, lane),
            ranges: self.prepared.ranges[field_row],
            ends: AxisEnds::of(&self.prepared.axis_limits[field_row]),
            present: present.unwrap_or([f64::NAN; 2]),
        });
        if G::ANY {
            queue.push_pose_errors(self.pose_errors.row(field_row));
        }
    }
}

/// What a kernel needs room for; nothing is carried from one call to the next.
#[derive(Clone)]
pub(crate) struct Scratch {
    tile: Tile,
    side: SideColumns,
    queue: Queue,
}

impl core::fmt::Debug for Scratch {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        f.write_str("Scratch")
    }
}

impl Default for Scratch {
    fn default() -> Self {
        Self {
            tile: Tile::new(),
            side: SideColumns::new(),
            queue: Queue::new(),
        }
    }
}

/// Room for one tile that is not whole; aligned for streaming stores.
#[derive(Clone)]
#[repr(align(64))]
struct SideColumns {
    columns: [[f64; TILE]; 4],
    status: [Status; TILE],
}

impl SideColumns {
    #[inline(always)]
    fn new() -> Self {
        Self {
            columns: [[0.0; TILE]; 4],
            status: [Status::Ok; TILE],
        }
    }

    #[inline(always)]
    fn rows(&mut self) -> Rows<'_> {
        let [axis1, axis2, incidence, limit_excess] = &mut self.columns;
        Rows {
            axis1,
            axis2,
            incidence,
            limit_excess,
            status: &mut self.status,
        }
    }

    fn copy_to(&self, out: &mut Rows<'_>) {
        let count = out.len();
        out.axis1.copy_from_slice(&self.columns[0][..count]);
        out.axis2.copy_from_slice(&self.columns[1][..count]);
        out.incidence.copy_from_slice(&self.columns[2][..count]);
        out.status.copy_from_slice(&self.status[..count]);
    }
}

/// The sun along the mount's axes, by the field's base.
pub(crate) enum AnySun<'a> {
    Shared(SharedSun),
    Turned(TurnedSun<'a>),
}

impl Prepared {
    pub(crate) fn sun(&self, sun: crate::frame::EnuUnit) -> AnySun<'_> {
        let half = sun.as_enu() * 0.5;
        match &self.base {
            Base::Shared(axes) => AnySun::Shared(SharedSun([
                axes.axis1.dot(half),
                axes.axis2.dot(half),
                axes.axis3.dot(half),
            ])),
            Base::PerHeliostat(axes) => AnySun::Turned(TurnedSun {
                half_enu: [half.east, half.north, half.up],
                axes,
            }),
        }
    }
}
