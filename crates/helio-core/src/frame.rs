//! Points, directions and target planes in the world frame: right-handed east, north, up, metres.
//!
//! Guo 2015 computes in left-handed north-east-up. The components are the same three numbers in
//! another order, so they are stored and passed *by name* here and never by a bare index.

use crate::error::FrameError;

/// A point or displacement in the world frame \[m\].
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Enu {
    /// Toward east.
    pub east: f64,
    /// Toward north.
    pub north: f64,
    /// Away from the centre of the earth.
    pub up: f64,
}

impl Enu {
    /// A point from its three components, in the order of the name.
    #[must_use]
    pub const fn new(east: f64, north: f64, up: f64) -> Self {
        Self { east, north, up }
    }

    /// Scalar product.
    #[must_use]
    pub fn dot(self, other: Self) -> f64 {
        self.east * other.east + self.north * other.north + self.up * other.up
    }

    /// Cross product, right-handed in east, north, up.
    #[must_use]
    pub fn cross(self, other: Self) -> Self {
        Self {
            east: self.north * other.up - self.up * other.north,
            north: self.up * other.east - self.east * other.up,
            up: self.east * other.north - self.north * other.east,
        }
    }

    /// Length.
    #[must_use]
    pub fn norm(self) -> f64 {
        libm::sqrt(self.dot(self))
    }

    /// True if no component is NaN or infinite.
    #[must_use]
    pub fn is_finite(self) -> bool {
        self.east.is_finite() && self.north.is_finite() && self.up.is_finite()
    }
}

impl core::ops::Add for Enu {
    type Output = Self;
    fn add(self, other: Self) -> Self {
        Self::new(
            self.east + other.east,
            self.north + other.north,
            self.up + other.up,
        )
    }
}

impl core::ops::Sub for Enu {
    type Output = Self;
    fn sub(self, other: Self) -> Self {
        Self::new(
            self.east - other.east,
            self.north - other.north,
            self.up - other.up,
        )
    }
}

impl core::ops::Mul<f64> for Enu {
    type Output = Self;
    fn mul(self, factor: f64) -> Self {
        Self::new(self.east * factor, self.north * factor, self.up * factor)
    }
}

/// A direction: an [`Enu`] of unit length, checked when it is made.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct EnuUnit(Enu);

impl EnuUnit {
    /// Toward the zenith.
    pub const UP: Self = Self(Enu::new(0.0, 0.0, 1.0));

    /// The direction of a vector of any length.
    ///
    /// # Errors
    /// [`FrameError::NoDirection`] if a component is not finite or the vector has no length.
    ///
    /// ```
    /// use helio_core::frame::{Enu, EnuUnit};
    /// let west = EnuUnit::try_new(Enu::new(-3.0, 0.0, 0.0))?;
    /// assert_eq!(west.as_enu().east, -1.0);
    /// assert!(EnuUnit::try_new(Enu::default()).is_err());
    /// # Ok::<(), helio_core::error::FrameError>(())
    /// ```
    pub fn try_new(vector: Enu) -> Result<Self, FrameError> {
        let norm = vector.norm();
        if !(norm.is_finite() && norm > 1e-150) {
            return Err(FrameError::NoDirection { vector });
        }
        Ok(Self(Enu::new(
            vector.east / norm,
            vector.north / norm,
            vector.up / norm,
        )))
    }

    /// The direction at an azimuth (clockwise from north) and elevation (up from the horizon) \[rad\],
    /// Guo 2015 eq. (1).
    ///
    /// ```
    /// use helio_core::frame::EnuUnit;
    /// let east = EnuUnit::from_azimuth_elevation(90_f64.to_radians(), 0.0);
    /// assert!((east.as_enu().east - 1.0).abs() < 1e-15);
    /// ```
    /// Angles that are not finite give a direction that no function accepts.
    #[must_use]
    pub fn from_azimuth_elevation(azimuth_rad: f64, elevation_rad: f64) -> Self {
        let (sin_azimuth, cos_azimuth) = libm::sincos(azimuth_rad);
        let (sin_elevation, cos_elevation) = libm::sincos(elevation_rad);
        Self(Enu::new(
            cos_elevation * sin_azimuth,
            cos_elevation * cos_azimuth,
            sin_elevation,
        ))
    }

    /// A vector that is of unit length by construction.
    pub(crate) const fn of_unit_length(vector: Enu) -> Self {
        Self(vector)
    }

    /// The components.
    #[must_use]
    pub const fn as_enu(self) -> Enu {
        self.0
    }

    /// Azimuth \[rad\], clockwise from north, in [0, 2π); zero for the zenith and the nadir.
    #[must_use]
    pub fn azimuth_rad(self) -> f64 {
        crate::angle::wrap_tau(libm::atan2(self.0.east, self.0.north))
    }

    /// Elevation \[rad\] above the horizon, in [-π/2, π/2].
    #[must_use]
    pub fn elevation_rad(self) -> f64 {
        libm::atan2(self.0.up, libm::hypot(self.0.east, self.0.north))
    }
}

/// A flat target: its centre, the way it faces, and axes on it to measure spots by.
///
/// `u` runs to the right and `v` down *as a camera facing the target sees it*, like pixel columns
/// and rows (Guo 2015 fig. 6: xi, eta). For a target facing north, right is west.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TargetPlane {
    /// Centre of the target.
    pub centre: Enu,
    /// Out of the target, toward the field.
    pub normal: EnuUnit,
    /// Direction of growing `u`, in the plane.
    pub right: EnuUnit,
    /// Direction of growing `v`, in the plane.
    pub down: EnuUnit,
}

impl TargetPlane {
    /// A target whose right edge direction is level (Guo 2015 §4.2).
    ///
    /// For a target that faces straight up or down every edge is level: right is then west,
    /// as it is for the limit of a north-facing target.
    ///
    /// ```
    /// use helio_core::frame::{Enu, EnuUnit, TargetPlane};
    /// let facing_north = EnuUnit::try_new(Enu::new(0.0, 1.0, 0.0))?;
    /// let target = TargetPlane::level(Enu::new(0.0, 0.0, 40.0), facing_north);
    /// assert_eq!(target.right.as_enu().east, -1.0);
    /// assert_eq!(target.down.as_enu().up, -1.0);
    /// # Ok::<(), helio_core::error::FrameError>(())
    /// ```
    #[must_use]
    pub fn level(centre: Enu, normal: EnuUnit) -> Self {
        let n = normal.as_enu();
        // right = up x normal, level by construction; down = right x normal in the camera's view.
        let right = EnuUnit::try_new(Enu::new(-n.north, n.east, 0.0))
            .unwrap_or(EnuUnit(Enu::new(-1.0, 0.0, 0.0)));
        Self::from_axes(centre, normal, right)
    }

    /// A target whose edge is not level: `right` is made square to `normal`.
    ///
    /// # Errors
    /// [`FrameError::NoDirection`] if `right` is parallel to `normal`.
    pub fn with_right(centre: Enu, normal: EnuUnit, right: EnuUnit) -> Result<Self, FrameError> {
        let n = normal.as_enu();
        let r = right.as_enu();
        let in_plane = r - n * r.dot(n);
        if in_plane.norm() < 1e-6 {
            return Err(FrameError::NoDirection { vector: in_plane });
        }
        Ok(Self::from_axes(centre, normal, EnuUnit::try_new(in_plane)?))
    }

    fn from_axes(centre: Enu, normal: EnuUnit, right: EnuUnit) -> Self {
        // Seen from the field, right x down points away from the camera: down = right x (normal) in ENU.
        let down = EnuUnit(normal.as_enu().cross(right.as_enu()) * -1.0);
        Self {
            centre,
            normal,
            right,
            down,
        }
    }

    /// The point of the plane at `u`, `v` \[m\].
    #[must_use]
    pub fn point(&self, u_m: f64, v_m: f64) -> Enu {
        self.centre + self.right.as_enu() * u_m + self.down.as_enu() * v_m
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    // theory: xi, eta, nt left-handed in north-east-up is right x down = -normal in east-north-up.
    #[test]
    fn a_target_facing_anywhere_has_level_right_and_downward_down() {
        for azimuth_deg in [0.0_f64, 10.0, 90.0, 200.0, 359.0] {
            let normal = EnuUnit::from_azimuth_elevation(azimuth_deg.to_radians(), -0.2);
            let plane = TargetPlane::level(Enu::default(), normal);
            assert!(plane.right.as_enu().up.abs() < 1e-15);
            assert!(plane.down.as_enu().up < -0.9);
            let out = plane.right.as_enu().cross(plane.down.as_enu()) + normal.as_enu();
            assert!(out.norm() < 1e-15, "{azimuth_deg}: {out:?}");
        }
    }
}
