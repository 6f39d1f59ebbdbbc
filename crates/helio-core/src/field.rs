//! A field of heliostats, as columns.

use alloc::collections::BTreeMap;
use alloc::string::{String, ToString};
use alloc::vec::Vec;

use crate::error::FieldError;
use crate::frame::Enu;
use crate::mount::{AxisLimits, MountErrors, PoseErrors, TrackingMode};

/// Everything about one heliostat that its axis angles depend on.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Heliostat {
    /// Crossing of the two axes \[m\].
    pub pivot: Enu,
    /// The point its beam is to hit \[m\].
    pub aim: Enu,
    /// Pivot to mirror centre along the normal \[m\], Hz; negative if the mirror lies behind the pivot.
    pub mirror_offset_m: f64,
    /// Departures from the ideal mount.
    pub errors: MountErrors,
    /// How far its axes stand from their encoders' angles, by the pose.
    pub pose_errors: PoseErrors,
    /// How far the axes turn.
    pub limits: AxisLimits,
}

impl Heliostat {
    /// A perfect, unlimited heliostat without mirror offset.
    #[must_use]
    pub const fn new(pivot: Enu, aim: Enu) -> Self {
        Self {
            pivot,
            aim,
            mirror_offset_m: 0.0,
            errors: MountErrors {
                pedestal_tilt_rad: 0.0,
                pedestal_tilt_azimuth_rad: 0.0,
                axis_nonorthogonality_rad: 0.0,
                mirror_tilt_rad: 0.0,
                azimuth_reference_rad: 0.0,
                elevation_reference_rad: 0.0,
            },
            pose_errors: PoseErrors::NONE,
            limits: AxisLimits::NONE,
        }
    }
}

/// Heliostats of one tracking mode, in the order in which every answer comes.
///
/// ```
/// use helio_core::{Enu, Field, Heliostat, TrackingMode};
/// let mut field = Field::new(TrackingMode::AzimuthElevation);
/// field.push("A1", Heliostat::new(Enu::new(10.0, 80.0, 4.0), Enu::new(0.0, 0.0, 60.0)))?;
/// assert_eq!(field.len(), 1);
/// assert_eq!(field.row_of("A1"), Some(0));
/// # Ok::<(), helio_core::error::FieldError>(())
/// ```
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Field {
    mode: TrackingMode,
    ids: Vec<String>,
    rows: BTreeMap<String, usize>,
    heliostats: Vec<Heliostat>,
}

impl Field {
    /// An empty field.
    #[must_use]
    pub fn new(mode: TrackingMode) -> Self {
        Self {
            mode,
            ..Self::default()
        }
    }

    /// Adds a heliostat at the end.
    ///
    /// # Errors
    /// [`FieldError`] if a number is not finite or out of range, limits are empty, or the id is taken.
    pub fn push(&mut self, id: &str, heliostat: Heliostat) -> Result<(), FieldError> {
        check(id, &heliostat)?;
        if let Some(&first) = self.rows.get(id) {
            let second = self.len();
            return Err(FieldError::DuplicateId {
                id: id.to_string(),
                first,
                second,
            });
        }
        self.rows.insert(id.to_string(), self.len());
        self.ids.push(id.to_string());
        self.heliostats.push(heliostat);
        Ok(())
    }

    /// Replaces a heliostat by another, for instance after calibration.
    ///
    /// # Errors
    /// [`FieldError`] as for [`push`](Self::push), or if `row` is not in the field.
    pub fn replace(&mut self, row: usize, heliostat: Heliostat) -> Result<(), FieldError> {
        let count = self.len();
        let id = self.ids.get(row);
        let id = id.ok_or(FieldError::NoSuchRow { row, count })?;
        check(id, &heliostat)?;
        self.heliostats[row] = heliostat;
        Ok(())
    }

    /// Number of heliostats.
    #[must_use]
    pub fn len(&self) -> usize {
        self.heliostats.len()
    }

    /// True if there is none.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.heliostats.is_empty()
    }

    /// How the heliostats track.
    #[must_use]
    pub fn mode(&self) -> TrackingMode {
        self.mode
    }

    /// Names, in field order.
    #[must_use]
    pub fn ids(&self) -> &[String] {
        &self.ids
    }

    /// Heliostats, in field order.
    #[must_use]
    pub fn heliostats(&self) -> &[Heliostat] {
        &self.heliostats
    }

    /// Row of a heliostat by name.
    #[must_use]
    pub fn row_of(&self, id: &str) -> Option<usize> {
        self.rows.get(id).copied()
    }
}

fn check(id: &str, heliostat: &Heliostat) -> Result<(), FieldError> {
    let bad = |what, wanted, value| FieldError::BadValue {
        id: id.to_string(),
        what,
        wanted,
        value,
    };
    let h = heliostat;
    let e = &h.errors;
    let finite = [
        ("pivot east_m", h.pivot.east),
        ("pivot north_m", h.pivot.north),
        ("pivot up_m", h.pivot.up),
        ("aim_east_m", h.aim.east),
        ("aim_north_m", h.aim.north),
        ("aim_up_m", h.aim.up),
        ("mirror_offset_m", h.mirror_offset_m),
        ("pedestal_tilt_rad", e.pedestal_tilt_rad),
        ("pedestal_tilt_azimuth_rad", e.pedestal_tilt_azimuth_rad),
        ("axis_nonorthogonality_rad", e.axis_nonorthogonality_rad),
        ("mirror_tilt_rad", e.mirror_tilt_rad),
        ("azimuth_reference_rad", e.azimuth_reference_rad),
        ("elevation_reference_rad", e.elevation_reference_rad),
    ];
    for (what, value) in finite {
        if !(value.is_finite() && value.abs() <= 1e9) {
            return Err(bad(what, "finite and within ±1e9", value));
        }
    }
    // The formula divides by their cosines; a mount anywhere near these is not one of this kind.
    for (what, value) in [
        ("axis_nonorthogonality_rad", e.axis_nonorthogonality_rad),
        ("mirror_tilt_rad", e.mirror_tilt_rad),
    ] {
        if value.abs() > MAX_SKEW_RAD {
            return Err(bad(what, "within ±1.4 rad (80°)", value));
        }
    }
    for (what, value) in [
        ("axis1_sag_rad", h.pose_errors.axis1_sag_rad),
        ("axis2_sag_rad", h.pose_errors.axis2_sag_rad),
        (
            "axis2_eccentricity_rad",
            h.pose_errors.axis2_eccentricity_rad,
        ),
    ] {
        if value.is_nan() || value.abs() > PoseErrors::MAX_RAD {
            return Err(bad(what, "within ±0.05 rad (2.86°)", value));
        }
    }
    if e.pedestal_tilt_rad.abs() > MAX_TILT_RAD {
        let wanted = "within ±3 rad (about ±172°)";
        return Err(bad("pedestal_tilt_rad", wanted, e.pedestal_tilt_rad));
    }
    let l = &h.limits;
    for (axis, min_rad, max_rad) in [
        ("axis1", l.axis1_min_rad, l.axis1_max_rad),
        ("axis2", l.axis2_min_rad, l.axis2_max_rad),
    ] {
        let too_far = |limit: f64| limit.is_finite() && limit.abs() > MAX_LIMIT_RAD;
        for value in [min_rad, max_rad] {
            if too_far(value) {
                return Err(bad(axis, "limits within ±1e5 rad, or infinite", value));
            }
        }
        if min_rad.is_nan()
            || max_rad.is_nan()
            || min_rad > max_rad
            || min_rad == f64::INFINITY
            || max_rad == f64::NEG_INFINITY
        {
            return Err(FieldError::EmptyLimits {
                id: id.to_string(),
                axis,
                min_rad,
                max_rad,
            });
        }
    }
    Ok(())
}

/// Largest non-orthogonality and mirror tilt accepted \[rad\].
const MAX_SKEW_RAD: f64 = 1.4;
/// Largest finite limit accepted \[rad\]: some 16,000 turns, beyond which angles lose their digits.
const MAX_LIMIT_RAD: f64 = 1e5;
/// Largest pedestal tilt accepted \[rad\]: at π the parametrisation by lean and direction ends.
const MAX_TILT_RAD: f64 = 3.0;

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rows_beyond_the_end_are_refused() {
        let heliostat = Heliostat::new(Enu::new(10.0, 80.0, 4.0), Enu::new(0.0, 0.0, 60.0));
        let mut field = Field::new(TrackingMode::AzimuthElevation);
        for row in [0, usize::MAX] {
            let error = field.replace(row, heliostat).unwrap_err();
            let wanted = format!("row must be below 0, the number of heliostats, got {row}");
            assert_eq!(error.to_string(), wanted);
        }
        field.push("A1", heliostat).unwrap();
        field.replace(0, heliostat).unwrap();
        let error = field.replace(1, heliostat).unwrap_err();
        assert_eq!(error, FieldError::NoSuchRow { row: 1, count: 1 });
        assert_eq!(field.heliostats(), [heliostat]);
    }
}
