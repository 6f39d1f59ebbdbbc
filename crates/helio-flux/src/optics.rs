//! What a mirror's surface does to the cone that it reflects.

use crate::error::FluxError;

/// Errors of a mirror's surface that are known by their statistics only, and the same everywhere on it.
///
/// The field's convention: a Gaussian slope error turns the *normal*, and with it the beam by twice as
/// much in the plane of incidence and by 2 cos(incidence) across it; the specularity error turns the reflected
/// ray itself. Face on, the variance of the beam per axis is 4 slope² + specularity².
///
/// ```
/// use helio_flux::OpticalError;
/// let error = OpticalError::new(1.5e-3, 0.4e-3)?;
/// assert!((error.beam_rms_rad() - 3.0265e-3).abs() < 1e-7);
/// # Ok::<(), helio_flux::FluxError>(())
/// ```
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct OpticalError {
    slope_rms_rad: f64,
    specularity_rms_rad: f64,
}

/// Rays turn to first order in the slopes; at this bound the beam is 1 % off by that.
const MAX_RMS_RAD: f64 = 0.05;

impl OpticalError {
    /// A perfect mirror.
    pub const NONE: Self = Self {
        slope_rms_rad: 0.0,
        specularity_rms_rad: 0.0,
    };

    /// Root mean squares per axis \[rad\] of the slopes and of the reflected rays' own scatter.
    ///
    /// # Errors
    /// [`FluxError::BadValue`] unless both lie in 0..=0.05.
    pub fn new(slope_rms_rad: f64, specularity_rms_rad: f64) -> Result<Self, FluxError> {
        for (what, value) in [
            ("slope_rms_rad", slope_rms_rad),
            ("specularity_rms_rad", specularity_rms_rad),
        ] {
            if !(0.0..=MAX_RMS_RAD).contains(&value) {
                return Err(FluxError::BadValue {
                    who: "optical error",
                    what,
                    wanted: "within 0..=0.05 rad",
                    value,
                });
            }
        }
        Ok(Self {
            slope_rms_rad,
            specularity_rms_rad,
        })
    }

    /// Root mean square of the slopes, per axis \[rad\].
    #[must_use]
    pub const fn slope_rms_rad(&self) -> f64 {
        self.slope_rms_rad
    }

    /// Root mean square of the scatter of reflected rays, per axis \[rad\].
    #[must_use]
    pub const fn specularity_rms_rad(&self) -> f64 {
        self.specularity_rms_rad
    }

    /// Root mean square of a beam that falls square on the mirror, per axis \[rad\].
    #[must_use]
    pub fn beam_rms_rad(&self) -> f64 {
        let (slope, scatter) = (2.0 * self.slope_rms_rad, self.specularity_rms_rad);
        (slope * slope + scatter * scatter).sqrt()
    }
}
