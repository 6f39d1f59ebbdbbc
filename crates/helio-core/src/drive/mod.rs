//! Drives: from axis angles to motor steps and back.
//!
//! Angles here are encoder angles of an axis \[rad\], as [`Tracker`](crate::Tracker) returns them.

mod encoder;
mod triangle;

pub use encoder::EncoderDrive;
pub use triangle::{ScrewGeometry, TriangleDrive, TriangleGeometry};

use alloc::vec::Vec;

use crate::error::DriveError;

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
    /// Everything that makes it what it is, as numbers for [`from_numbers`](Self::from_numbers): five of an encoder, ten
    /// of a triangle. To carry a drive elsewhere, not to be read by people.
    ///
    /// ```
    /// use helio_core::drive::{Drive, EncoderDrive};
    /// let drive = Drive::Encoder(EncoderDrive::new(1000.0, 5.0, -1.0)?.with_range(0.0, 900.0)?);
    /// assert_eq!(Drive::from_numbers(&drive.numbers())?, Some(drive));
    /// assert_eq!(Drive::from_numbers(&[1.0])?, None);
    /// # Ok::<(), helio_core::error::DriveError>(())
    /// ```
    #[must_use]
    pub fn numbers(&self) -> Vec<f64> {
        match self {
            Self::Encoder(drive) => drive.numbers().to_vec(),
            Self::Triangle(drive) => drive.numbers().to_vec(),
        }
    }

    /// The drive of these numbers; `None` where they are too many or too few for any.
    ///
    /// # Errors
    /// [`DriveError::BadValue`] where they describe no mechanism.
    pub fn from_numbers(numbers: &[f64]) -> Result<Option<Self>, DriveError> {
        if let Ok([steps_per_rad, zero_steps, sign, min_steps, max_steps]) =
            <[f64; 5]>::try_from(numbers)
        {
            let drive = EncoderDrive::new(steps_per_rad, zero_steps, sign)?;
            return Ok(Some(Self::Encoder(drive.with_range(min_steps, max_steps)?)));
        }
        let Ok(numbers) = <[f64; 10]>::try_from(numbers) else {
            return Ok(None);
        };
        Ok(Some(Self::Triangle(TriangleDrive::from_numbers(numbers)?)))
    }

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
