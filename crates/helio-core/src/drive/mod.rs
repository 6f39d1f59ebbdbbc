//! Drives: from axis angles to motor steps and back.
//!
//! Angles here are encoder angles of an axis \[rad\], as [`Tracker`](crate::Tracker) returns them.

mod encoder;
mod triangle;

pub use encoder::EncoderDrive;
pub use triangle::{ScrewGeometry, TriangleDrive, TriangleGeometry};

/// The mechanism that turns one axis.
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
pub enum Drive {
    /// Steps proportional to the angle.
    Encoder(EncoderDrive),
    /// A screw that closes a triangle: Guo's linear screw, or the Jülich actuator.
    Triangle(TriangleDrive),
}

impl Drive {
    /// Steps, not rounded, that bring the axis to an angle; `None` where the mechanism cannot.
    #[must_use]
    pub fn steps(&self, angle_rad: f64) -> Option<f64> {
        match self {
            Self::Encoder(drive) => drive.steps(angle_rad),
            Self::Triangle(drive) => drive.steps(angle_rad),
        }
    }

    /// Angle \[rad\] of the axis at a number of steps; `None` where the mechanism cannot be.
    #[must_use]
    pub fn angle_rad(&self, steps: f64) -> Option<f64> {
        match self {
            Self::Encoder(drive) => drive.angle_rad(steps),
            Self::Triangle(drive) => drive.angle_rad(steps),
        }
    }

    /// Least and greatest angle \[rad\] that the mechanism reaches; infinite where it has no end.
    #[must_use]
    pub fn range_rad(&self) -> (f64, f64) {
        match self {
            Self::Encoder(drive) => drive.range_rad(),
            Self::Triangle(drive) => drive.range_rad(),
        }
    }

    /// The angle \[rad\] after rounding to whole steps; `None` where the mechanism cannot be.
    #[must_use]
    pub fn quantised_rad(&self, angle_rad: f64) -> Option<f64> {
        self.angle_rad(libm::rint(self.steps(angle_rad)?))
    }
}
