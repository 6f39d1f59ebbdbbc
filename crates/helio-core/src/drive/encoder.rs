//! Steps proportional to the axis angle.

use crate::error::DriveError;

/// An encoder or stepper: steps = zero + sign · angle · ratio.
///
/// ```
/// use helio_core::drive::EncoderDrive;
/// let drive = EncoderDrive::new(1000.0_f64.to_degrees(), 500.0, 1.0)?; // 1000 steps per degree
/// let steps = drive.steps(2_f64.to_radians()).unwrap();
/// assert!((steps - 2500.0).abs() < 1e-9);
/// assert!((drive.angle_rad(steps).unwrap().to_degrees() - 2.0).abs() < 1e-12);
/// # Ok::<(), helio_core::error::DriveError>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct EncoderDrive {
    steps_per_rad: f64,
    zero_steps: f64,
    sign: f64,
    range_steps: (f64, f64),
}

impl EncoderDrive {
    /// A drive of `steps_per_rad` (positive), reading `zero_steps` at angle zero; `sign` is 1, or -1
    /// for one that counts down as the angle grows.
    ///
    /// # Errors
    /// [`DriveError::BadValue`] if a number is not finite, the ratio not positive or the sign not ±1.
    pub fn new(steps_per_rad: f64, zero_steps: f64, sign: f64) -> Result<Self, DriveError> {
        super::triangle::positive("steps_per_rad", steps_per_rad)?;
        super::triangle::finite("zero_steps", zero_steps)?;
        super::triangle::unit_sign(sign)?;
        let range_steps = (f64::NEG_INFINITY, f64::INFINITY);
        Ok(Self {
            steps_per_rad,
            zero_steps,
            sign,
            range_steps,
        })
    }

    /// The same drive with an end at each side \[steps\].
    ///
    /// # Errors
    /// [`DriveError::BadValue`] if the range is empty or NaN.
    pub fn with_range(mut self, min_steps: f64, max_steps: f64) -> Result<Self, DriveError> {
        super::triangle::ordered("max_steps", min_steps, max_steps)?;
        self.range_steps = (min_steps, max_steps);
        Ok(self)
    }

    pub(super) fn numbers(&self) -> [f64; 5] {
        let (min_steps, max_steps) = self.range_steps;
        let Self {
            steps_per_rad,
            zero_steps,
            sign,
            ..
        } = *self;
        [steps_per_rad, zero_steps, sign, min_steps, max_steps]
    }

    /// See [`Drive::steps`](super::Drive::steps).
    #[must_use]
    pub fn steps(&self, angle_rad: f64) -> Option<f64> {
        let steps = self.zero_steps + self.sign * angle_rad * self.steps_per_rad;
        super::triangle::within(steps, self.range_steps)
    }

    /// See [`Drive::angle_rad`](super::Drive::angle_rad).
    #[must_use]
    pub fn angle_rad(&self, steps: f64) -> Option<f64> {
        let steps = super::triangle::within(steps, self.range_steps)?;
        Some(self.sign * (steps - self.zero_steps) / self.steps_per_rad)
    }

    /// See [`Drive::range_rad`](super::Drive::range_rad).
    #[must_use]
    pub fn range_rad(&self) -> (f64, f64) {
        let a = self.sign * (self.range_steps.0 - self.zero_steps) / self.steps_per_rad;
        let b = self.sign * (self.range_steps.1 - self.zero_steps) / self.steps_per_rad;
        (a.min(b), a.max(b))
    }
}
