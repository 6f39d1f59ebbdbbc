//! Wrapping and conversion of angles, and nothing else.

use core::f64::consts::{PI, TAU};

/// Wraps an angle into [0, 2π).
///
/// The last branch matters: `(-1e-20_f64).rem_euclid(TAU)` *is* `TAU`, outside the half-open interval.
///
/// ```
/// use helio_core::angle::wrap_tau;
/// assert_eq!(wrap_tau(-1e-20), 0.0);
/// assert_eq!(wrap_tau(7.0), 7.0 - std::f64::consts::TAU);
/// ```
#[must_use]
pub fn wrap_tau(angle_rad: f64) -> f64 {
    let remainder = libm::fmod(angle_rad, TAU);
    let wrapped = if remainder < 0.0 {
        remainder + TAU
    } else {
        remainder
    };
    if wrapped < TAU { wrapped } else { 0.0 }
}

/// Wraps an angle into [-π, π).
///
/// ```
/// use helio_core::angle::wrap_pi;
/// assert!((wrap_pi(6.0) - (6.0 - std::f64::consts::TAU)).abs() < 1e-15);
/// ```
#[must_use]
pub fn wrap_pi(angle_rad: f64) -> f64 {
    if (-PI..PI).contains(&angle_rad) {
        return angle_rad; // by way of 2π a small angle would lose digits
    }
    let wrapped = wrap_tau(angle_rad);
    if wrapped < PI { wrapped } else { wrapped - TAU }
}

/// Degrees to radians: the one conversion used at every edge where people write degrees.
///
/// ```
/// use helio_core::angle::radians;
/// assert_eq!(radians(180.0), std::f64::consts::PI);
/// ```
#[must_use]
pub fn radians(angle_deg: f64) -> f64 {
    angle_deg * (PI / 180.0)
}

/// Radians to degrees, the inverse of [`radians`].
///
/// ```
/// use helio_core::angle::degrees;
/// assert_eq!(degrees(std::f64::consts::FRAC_PI_2), 90.0);
/// ```
#[must_use]
pub fn degrees(angle_rad: f64) -> f64 {
    angle_rad * (180.0 / PI)
}
