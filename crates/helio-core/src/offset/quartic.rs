//! The closed form, as a cross-check.

/// tau \[rad\] by the closed solution of the quartic, Guo 2015 eqs. (10) and (11).
///
/// `theta_rad` is half the sun-aim angle, in (0, π/2); `slant_ratio` is L/Hz, at least 1.5, below
/// which the printed choice of root is not the right one. It ends in the arccosine of a number
/// near one and so loses about half the digits of a small tau: use it to check, not to track.
///
/// `None` outside that range, or where a root of the resolvent is not real.
///
/// ```
/// use helio_core::offset::tau_by_quartic_rad;
/// let tau_rad = tau_by_quartic_rad(70_f64.to_radians(), 15.0).unwrap();
/// // it solves eq. (9): (L/Hz) sin(2 tau) = sin(theta + tau)
/// let residual = 15.0 * (2.0 * tau_rad).sin() - (70_f64.to_radians() + tau_rad).sin();
/// assert!(residual.abs() < 1e-12);
/// ```
#[must_use]
pub fn tau_by_quartic_rad(theta_rad: f64, slant_ratio: f64) -> Option<f64> {
    if !(slant_ratio >= 1.5 && slant_ratio.is_finite()) {
        return None;
    }
    if !(theta_rad > 0.0 && theta_rad < core::f64::consts::FRAC_PI_2) {
        return None;
    }
    let b0 = slant_ratio;
    let cos_theta = libm::cos(theta_rad);
    // (10): a t⁴ + b t³ + c t² + d t + e = 0, t = cos(tau)
    let a = 4.0 * b0 * b0;
    let b = -4.0 * b0 * cos_theta;
    let c = 1.0 - 4.0 * b0 * b0;
    let d = 4.0 * b0 * cos_theta;
    let e = -cos_theta * cos_theta;
    // (11)
    let delta0 = c * c - 3.0 * b * d + 12.0 * a * e;
    let delta1 =
        2.0 * c * c * c - 9.0 * b * c * d + 27.0 * b * b * e + 27.0 * a * d * d - 72.0 * a * c * e;
    let p = (8.0 * a * c - 3.0 * b * b) / (8.0 * a * a);
    let q = (b * b * b - 4.0 * a * b * c + 8.0 * a * a * d) / (8.0 * a * a * a);
    let discriminant = 4.0 * delta0 * delta0 * delta0 - delta1 * delta1;
    let angle =
        (core::f64::consts::PI + libm::atan(libm::sqrt(discriminant.max(0.0)) / delta1)) / 3.0;
    let s =
        0.5 * libm::sqrt(-2.0 * p / 3.0 + 2.0 * libm::sqrt(delta0) * libm::cos(angle) / (3.0 * a));
    let u = -b / (4.0 * a);
    let v = 0.5 * libm::sqrt(-4.0 * s * s - 2.0 * p - q / s);
    let cos_tau = u + s + v;
    if !cos_tau.is_finite() {
        return None;
    }
    Some(libm::acos(cos_tau.min(1.0)))
}
