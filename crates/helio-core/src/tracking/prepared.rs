//! Per-heliostat constants, computed once.

use alloc::vec::Vec;
use core::f64::consts::{PI, TAU};

use super::kernel::limits::{AxisRange, Limits};
use super::kernel::normal::MAX_SERIES_RATIO;
use super::kernel::pose_errors;
use crate::field::Field;
use crate::frame::{Enu, EnuUnit};
use crate::lanes::{BLOCK, Columns};
use crate::mount::{AxisLimits, MountAxes, TrackingMode};

/// Rows that go through the phases of a kernel together; fields are padded to a multiple of it.
pub(crate) const TILE: usize = 64;

/// Distance beyond the axis limits that still counts as inside \[rad\]: rounding, far below any encoder step.
pub(crate) const LIMIT_TOLERANCE_RAD: f64 = 1e-12;

/// Columns of the prepared constants.
pub(crate) mod column {
    /// Half the unit vector pivot → aim, in mount axes (three columns).
    pub const HALF_AIM: usize = 0;
    /// Hz/L; [`AT_PIVOT`](super::AT_PIVOT) where the aim is at the pivot.
    pub const RATIO: usize = 3;
    /// tan(psi_t/2) cos(psi_a).
    pub const TILT1: usize = 4;
    /// tan(psi_t/2) sin(psi_a).
    pub const TILT2: usize = 5;
    /// 1 + cos(psi_t).
    pub const TILT_FACTOR: usize = 6;
    /// tan(tau1).
    pub const TAN_TAU1: usize = 7;
    /// 1/cos(tau1).
    pub const SEC_TAU1: usize = 8;
    /// sin(mu).
    pub const SIN_MU: usize = 9;
    /// 1/cos(mu); negative to mark a row that is not for the fast path.
    pub const SEC_MU: usize = 10;
    /// gamma0, within half a turn of its window's middle.
    pub const SHIFT1: usize = 11;
    /// alpha0; where the second axis is wrapped, within half a turn of its window's middle.
    pub const SHIFT2: usize = 12;
    /// How many there are.
    pub const COUNT: usize = 13;
}

/// Where the fixed axes point.
#[derive(Debug, Clone)]
pub(crate) enum Base {
    /// The same axes for the whole field: the sun is turned once.
    Shared(MountAxes),
    /// Rows of R per heliostat, in (east, north, up) components: nine columns.
    PerHeliostat(Vec<Columns<9>>),
}

/// The constants of a field.
#[derive(Debug, Clone)]
pub(crate) struct Prepared {
    pub len: usize,
    pub constants: Vec<Columns<{ column::COUNT }>>,
    pub base: Base,
    /// Of every heliostat if one has any, else empty. Limits are then kept per heliostat.
    pub pose_errors: Vec<Columns<{ pose_errors::COUNT }>>,
    pub limits: Limits,
    /// To the last digit, for the rows that are not plainly ok.
    pub ranges: Vec<[AxisRange<f64>; 2]>,
    /// Limits as given, for shortest travel.
    pub axis_limits: Vec<AxisLimits>,
    /// Encoder references as given.
    pub references: Vec<[f64; 2]>,
    /// Geometry that only the forward direction needs: pivot and aim.
    pub pivots: Vec<Enu>,
    pub aims: Vec<Enu>,
    pub mirror_offsets_m: Vec<f64>,
}

impl Prepared {
    pub fn new(field: &Field) -> Self {
        let len = field.len();
        let blocks = len.div_ceil(TILE) * TILE / BLOCK;
        let mut constants = alloc::vec![Columns([[0.0; BLOCK]; column::COUNT]); blocks];
        let mut axes = Vec::new();
        let shared = match field.mode() {
            TrackingMode::SpinningElevation => {
                axes = alloc::vec![Columns([[0.0; BLOCK]; 9]); blocks];
                None
            }
            mode => Some(MountAxes::of(mode, EnuUnit::UP)),
        };
        let mut ranges = Vec::with_capacity(len);
        let any_pose_error = field.heliostats().iter().any(|h| !h.pose_errors.is_none());
        let mut pose_errors = alloc::vec![Columns([[0.0; BLOCK]; pose_errors::COUNT]); if any_pose_error { blocks } else { 0 }];
        for (row, h) in field.heliostats().iter().enumerate() {
            let to_aim = h.aim - h.pivot;
            let slant_m = to_aim.norm();
            let at_pivot = !(slant_m > h.mirror_offset_m.abs() && slant_m >= MIN_SLANT_M);
            // The axes of a target-oriented mount point there all the same.
            let direction = EnuUnit::try_new(to_aim).unwrap_or(EnuUnit::UP);
            let ratio = if at_pivot {
                AT_PIVOT
            } else {
                h.mirror_offset_m / slant_m
            };
            let mount = match shared {
                Some(mount) => mount,
                None => {
                    let mount = MountAxes::of(field.mode(), direction);
                    for (k, axis) in [mount.axis1, mount.axis2, mount.axis3]
                        .into_iter()
                        .enumerate()
                    {
                        let Columns(block) = &mut axes[row / BLOCK];
                        block[3 * k][row % BLOCK] = axis.east;
                        block[3 * k + 1][row % BLOCK] = axis.north;
                        block[3 * k + 2][row % BLOCK] = axis.up;
                    }
                    mount
                }
            };
            let t = direction.as_enu();
            let e = &h.errors;
            let range1 = AxisRange::of_axis1(&h.limits);
            let range2 = AxisRange::of_axis2(&h.limits, e.elevation_reference_rad);
            let mut shift1 = e.azimuth_reference_rad;
            let mut shift2 = e.elevation_reference_rad;
            let mut fast = ratio.abs() <= MAX_SERIES_RATIO;
            shift1 -= TAU * libm::rint((shift1 - range1.middle) / TAU);
            if range2.reach.is_finite() {
                shift2 -= TAU * libm::rint((shift2 - range2.middle) / TAU);
                // The fast path does not wrap the second axis: it has the rows that need none.
                fast &= (shift2 - range2.middle).abs() <= PI / 2.0 - h.pose_errors.axis2_most_rad();
            }
            let (sin_tilt, cos_tilt) = libm::sincos(e.pedestal_tilt_rad);
            let tan_half_tilt = sin_tilt / (1.0 + cos_tilt);
            let (sin_tilt_azimuth, cos_tilt_azimuth) = libm::sincos(e.pedestal_tilt_azimuth_rad);
            let (sin_tau1, cos_tau1) = libm::sincos(e.axis_nonorthogonality_rad);
            let (sin_mu, cos_mu) = libm::sincos(e.mirror_tilt_rad);
            let values = [
                0.5 * mount.axis1.dot(t),
                0.5 * mount.axis2.dot(t),
                0.5 * mount.axis3.dot(t),
                ratio,
                tan_half_tilt * cos_tilt_azimuth,
                tan_half_tilt * sin_tilt_azimuth,
                1.0 + cos_tilt,
                sin_tau1 / cos_tau1,
                1.0 / cos_tau1,
                sin_mu,
                if fast { 1.0 / cos_mu } else { -1.0 / cos_mu },
                shift1,
                shift2,
            ];
            let Columns(block) = &mut constants[row / BLOCK];
            for (column, value) in block.iter_mut().zip(values) {
                column[row % BLOCK] = value;
            }
            if let Some(Columns(block)) = pose_errors.get_mut(row / BLOCK) {
                for (column, value) in block
                    .iter_mut()
                    .zip(pose_errors::constants(h.pose_errors, &mount))
                {
                    column[row % BLOCK] = value;
                }
            }
            ranges.push([range1, range2]);
        }
        // The padding repeats the last heliostat: whatever path it takes, so do its neighbours.
        if let Some(last) = len.checked_sub(1) {
            for row in len..blocks * BLOCK {
                repeat_row(&mut constants, last, row);
                if !axes.is_empty() {
                    repeat_row(&mut axes, last, row);
                }
                if any_pose_error {
                    repeat_row(&mut pose_errors, last, row);
                }
            }
        }
        let unlimited = field.heliostats().iter().all(|h| h.limits.is_none());
        Self {
            len,
            constants,
            base: shared.map_or(Base::PerHeliostat(axes), Base::Shared),
            pose_errors,
            limits: Limits::new(unlimited, any_pose_error, &ranges, blocks),
            ranges,
            references: field
                .heliostats()
                .iter()
                .map(|h| {
                    [
                        h.errors.azimuth_reference_rad,
                        h.errors.elevation_reference_rad,
                    ]
                })
                .collect(),
            axis_limits: field.heliostats().iter().map(|h| h.limits).collect(),
            pivots: field.heliostats().iter().map(|h| h.pivot).collect(),
            aims: field.heliostats().iter().map(|h| h.aim).collect(),
            mirror_offsets_m: field
                .heliostats()
                .iter()
                .map(|h| h.mirror_offset_m)
                .collect(),
        }
    }
}

/// Stands for Hz/L where the aim is at the pivot: no heliostat has it, and no kernel chokes on it.
pub(crate) const AT_PIVOT: f64 = 1e30;

/// Nearest an aim may be to a pivot \[m\].
const MIN_SLANT_M: f64 = 1e-6;

pub(crate) fn repeat_row<const N: usize>(blocks: &mut [Columns<N>], from: usize, to: usize) {
    for column in 0..N {
        let value = blocks[from / BLOCK].0[column][from % BLOCK];
        blocks[to / BLOCK].0[column][to % BLOCK] = value;
    }
}
