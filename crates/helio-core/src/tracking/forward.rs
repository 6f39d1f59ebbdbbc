//! From axis angles to the normal, the reflected beam and the spot on the target.

use alloc::vec::Vec;

use super::prepared::Base;
use super::{TrackOptions, Tracker, check_len, checked_level, kernel};
use crate::error::TrackError;
use crate::frame::{Enu, EnuUnit, TargetPlane};
use crate::mount::MountAxes;
use crate::status::Status;

/// Where beams land, as columns with one row per heliostat.
///
/// Numbers of a row that is not [`Status::Ok`] are NaN.
#[derive(Debug, Clone, Default)]
pub struct Prediction {
    /// On the target, to the right as a camera facing it sees it \[m\].
    pub u_m: Vec<f64>,
    /// On the target, down as a camera facing it sees it \[m\].
    pub v_m: Vec<f64>,
    /// The spot in the world \[m\].
    pub east_m: Vec<f64>,
    /// The spot in the world \[m\].
    pub north_m: Vec<f64>,
    /// The spot in the world \[m\].
    pub up_m: Vec<f64>,
    /// Angle at the mirror's centre between the beam and the heliostat's aim \[rad\].
    pub beam_error_rad: Vec<f64>,
    /// [`Status::Ok`], [`Status::SunBelowHorizon`] or [`Status::MissesTarget`].
    pub status: Vec<Status>,
}

impl Prediction {
    fn clear(&mut self) {
        for column in [
            &mut self.u_m,
            &mut self.v_m,
            &mut self.east_m,
            &mut self.north_m,
            &mut self.up_m,
            &mut self.beam_error_rad,
        ] {
            column.clear();
        }
        self.status.clear();
    }

    fn push(&mut self, spot: Result<Spot, Status>) {
        let nan = Enu::new(f64::NAN, f64::NAN, f64::NAN);
        let (spot, status) = match spot {
            Ok(spot) => (spot, Status::Ok),
            Err(status) => (
                Spot {
                    u_m: f64::NAN,
                    v_m: f64::NAN,
                    point: nan,
                    beam_error_rad: f64::NAN,
                },
                status,
            ),
        };
        self.u_m.push(spot.u_m);
        self.v_m.push(spot.v_m);
        self.east_m.push(spot.point.east);
        self.north_m.push(spot.point.north);
        self.up_m.push(spot.point.up);
        self.beam_error_rad.push(spot.beam_error_rad);
        self.status.push(status);
    }
}

struct Spot {
    u_m: f64,
    v_m: f64,
    point: Enu,
    beam_error_rad: f64,
}

impl Tracker {
    /// Mirror normals for encoder angles \[rad\], one entry per heliostat (Guo 2015 eq. 29).
    ///
    /// ```
    /// use helio_core::{Enu, Field, Heliostat, OffsetForm, Tracker, TrackingMode};
    /// let mut field = Field::new(TrackingMode::AzimuthElevation);
    /// field.push("A1", Heliostat::new(Enu::default(), Enu::new(0.0, 90.0, 0.0)))?;
    /// let tracker = Tracker::new(&field, OffsetForm::Exact)?;
    /// let normals = tracker.forward(&[90_f64.to_radians()], &[0.0])?;
    /// assert!((normals[0].as_enu().east - 1.0).abs() < 1e-15);
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    ///
    /// # Errors
    /// [`TrackError`] if a column has another length than the field, or an angle is not finite or
    /// beyond ±1e5 rad.
    pub fn forward(
        &self,
        axis1_rad: &[f64],
        axis2_rad: &[f64],
    ) -> Result<Vec<EnuUnit>, TrackError> {
        let level = checked_level(None)?;
        self.check_angles(axis1_rad, axis2_rad)?;
        Ok(self.normals(axis1_rad, axis2_rad, level))
    }

    /// Where the beam of each heliostat lands on its plane for encoder angles \[rad\] (Guo 2015 §4.2,
    /// eqs. 30-36). Rows with a NaN angle (a row that had no answer) are [`Status::MissesTarget`].
    ///
    /// # Errors
    /// [`TrackError`] if a column has another length than the field, an angle is infinite or beyond
    /// ±1e5 rad, or the instruction set is not available.
    pub fn predict_into(
        &self,
        sun: EnuUnit,
        axis1_rad: &[f64],
        axis2_rad: &[f64],
        planes: &[TargetPlane],
        options: &TrackOptions,
        out: &mut Prediction,
    ) -> Result<(), TrackError> {
        let level = checked_level(options.level)?;
        super::check_suns(&[sun])?;
        check_len("planes", self.len(), planes.len())?;
        let finite = |column: &[f64]| -> Vec<f64> {
            column
                .iter()
                .map(|&angle| if angle.is_nan() { 0.0 } else { angle })
                .collect()
        };
        let (axis1, axis2) = (finite(axis1_rad), finite(axis2_rad));
        self.check_angles(&axis1, &axis2)?;
        let normals = self.normals(&axis1, &axis2, level);
        out.clear();
        for row in 0..self.len() {
            let known = !(axis1_rad[row].is_nan() || axis2_rad[row].is_nan());
            let spot = if !super::is_up(sun) {
                Err(Status::SunBelowHorizon)
            } else if known {
                self.spot(row, sun, normals[row], &planes[row])
            } else {
                Err(Status::MissesTarget)
            };
            out.push(spot);
        }
        Ok(())
    }

    /// The spot of one beam. With P = pivot, all vectors from P:
    /// r = -s + 2 (s·n) n; lambda = ((nt·t0) - Hz (nt·n)) / (nt·r); OT = Hz n + lambda r.
    fn spot(
        &self,
        row: usize,
        sun: EnuUnit,
        normal: EnuUnit,
        plane: &TargetPlane,
    ) -> Result<Spot, Status> {
        let (s, n, nt) = (sun.as_enu(), normal.as_enu(), plane.normal.as_enu());
        let offset_m = self.prepared.mirror_offsets_m[row];
        let pivot = self.prepared.pivots[row];
        let cos_incidence = s.dot(n); // (30)
        let beam = n * (2.0 * cos_incidence) - s; // (31)
        let facing = nt.dot(beam);
        let centre = plane.centre - pivot;
        let lambda_m = (nt.dot(centre) - offset_m * nt.dot(n)) / facing; // (32)
        if !(cos_incidence > 0.0 && facing < 0.0 && lambda_m > 0.0 && lambda_m.is_finite()) {
            return Err(Status::MissesTarget);
        }
        let from_pivot = n * offset_m + beam * lambda_m; // (33)
        let on_plane = from_pivot - centre; // (34)
        let to_aim = self.prepared.aims[row] - pivot - n * offset_m;
        let beam_error_rad = libm::atan2(beam.cross(to_aim).norm(), beam.dot(to_aim));
        Ok(Spot {
            u_m: on_plane.dot(plane.right.as_enu()), // (35)
            v_m: on_plane.dot(plane.down.as_enu()),  // (36)
            point: pivot + from_pivot,
            beam_error_rad,
        })
    }

    fn normals(
        &self,
        axis1_rad: &[f64],
        axis2_rad: &[f64],
        level: crate::SimdLevel,
    ) -> Vec<EnuUnit> {
        let mut columns = alloc::vec![[0.0; 3]; self.len()];
        kernel::dispatch::forward_rows(&self.prepared, level, axis1_rad, axis2_rad, &mut columns);
        let world = |axes: &MountAxes, n: [f64; 3]| {
            axes.axis1 * n[0] + axes.axis2 * n[1] + axes.axis3 * n[2]
        };
        columns
            .iter()
            .enumerate()
            .map(|(row, &n)| {
                let vector = match &self.prepared.base {
                    Base::Shared(axes) => world(axes, n),
                    Base::PerHeliostat(blocks) => world(&axes_of_row(blocks, row), n),
                };
                EnuUnit::of_unit_length(vector)
            })
            .collect()
    }

    fn check_angles(&self, axis1_rad: &[f64], axis2_rad: &[f64]) -> Result<(), TrackError> {
        for (what, column) in [("axis1_rad", axis1_rad), ("axis2_rad", axis2_rad)] {
            check_len(what, self.len(), column.len())?;
            super::check_angles(what, column, false)?;
        }
        Ok(())
    }
}

fn axes_of_row(blocks: &[crate::lanes::Columns<9>], row: usize) -> MountAxes {
    use crate::lanes::BLOCK;
    let at = |column: usize| blocks[row / BLOCK].0[column][row % BLOCK];
    let axis = |k: usize| Enu::new(at(3 * k), at(3 * k + 1), at(3 * k + 2));
    MountAxes {
        axis1: axis(0),
        axis2: axis(1),
        axis3: axis(2),
    }
}
