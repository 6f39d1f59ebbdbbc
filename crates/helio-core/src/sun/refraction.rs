//! Refraction of the air, SPA's formula (Bennett's, after Meeus).

use core::f64::consts::PI;

use super::site::SunSite;
use crate::lanes::Lanes;
use crate::lanes::math::sin_cos;

const DEGREE: f64 = PI / 180.0;

/// Geometric elevation \[rad\] at and below which SPA takes refraction as zero: -(0.26667° + 0.5667°), the
/// upper limb on the horizon.
const CUTOFF_RAD: f64 = -0.833_37 * DEGREE;

/// The 10.3 and 5.11 of the formula, for an elevation in radians instead of degrees.
const PHASE_NUMERATOR: f64 = 10.3 * DEGREE * DEGREE;
const PHASE_SHIFT: f64 = 5.11 * DEGREE;

/// Refraction \[rad\] in air of this pressure and temperature where the tangent below is 1.
fn strength_rad(pressure_hpa: f64, temperature_c: f64) -> f64 {
    (pressure_hpa / 1010.0) * (283.0 / (273.0 + temperature_c)) * (1.02 / 60.0 * DEGREE)
}

/// Refraction to add to the geometric elevation of the sun \[rad\].
///
/// `geometric_elevation_rad` is counted from the horizon, parallax included; `pressure_hpa` is
/// the yearly mean at the site (not reduced to the sea), `temperature_c` likewise.
///
/// Source: Reda & Andreas (2004), NREL/TP-560-34302, eq. 42. Zero once the whole disc is below the
/// horizon (elevation not above -0.83337°): there refraction jumps by 0.6°.
///
/// ```
/// use helio_core::angle::{degrees, radians};
/// use helio_core::sun::refraction_rad;
/// let up = refraction_rad(radians(39.872046), 820.0, 11.0); // site and hour of appendix A.5
/// assert!((degrees(up) - 0.016332).abs() < 5e-7);
/// assert_eq!(refraction_rad(radians(-1.0), 820.0, 11.0), 0.0);
/// ```
#[must_use]
pub fn refraction_rad(geometric_elevation_rad: f64, pressure_hpa: f64, temperature_c: f64) -> f64 {
    if geometric_elevation_rad <= CUTOFF_RAD {
        return 0.0;
    }
    // Δε = strength / tan(ε + 10.3 / (ε + 5.11)), degrees
    let phase_rad =
        geometric_elevation_rad + PHASE_NUMERATOR / (geometric_elevation_rad + PHASE_SHIFT);
    strength_rad(pressure_hpa, temperature_c) / libm::tan(phase_rad)
}

/// [`refraction_rad`] of a site, ready for the lanes.
#[derive(Debug, Clone, Copy)]
pub(super) struct Refraction {
    strength_rad: f64,
}

impl Refraction {
    pub fn of(site: &SunSite) -> Self {
        Self {
            strength_rad: strength_rad(site.pressure_hpa(), site.temperature_c()),
        }
    }

    #[inline(always)]
    pub fn lanes<L: Lanes>(self, geometric: L) -> L {
        let cutoff = L::splat(CUTOFF_RAD);
        let above = cutoff.lt(geometric);
        // Below the cut-off the formula has a pole; the answer there is zero anyway.
        let elevation = geometric.max(cutoff);
        let phase =
            elevation.add(L::splat(PHASE_NUMERATOR).div(elevation.add(L::splat(PHASE_SHIFT))));
        let (sine, cosine) = sin_cos(phase);
        let refraction = L::splat(self.strength_rad).mul(cosine).div(sine);
        L::select(above, refraction, L::splat(0.0))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lanes_and_scalar_agree() {
        let site = SunSite::new(0.7, 0.1, 500.0).unwrap();
        let lanes = Refraction::of(&site);
        for step in -9000..=9000 {
            let elevation = f64::from(step) * 0.01 * DEGREE;
            let want = refraction_rad(elevation, site.pressure_hpa(), site.temperature_c());
            let got = lanes.lanes(elevation);
            assert!((got - want).abs() < 1e-16, "{step}: {got} {want}");
        }
    }

    #[test]
    fn nan_stays_nan() {
        assert!(refraction_rad(f64::NAN, 1000.0, 10.0).is_nan());
    }
}
