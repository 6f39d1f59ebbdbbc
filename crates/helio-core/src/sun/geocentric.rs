//! The sun as seen from the centre of the earth: the slow part, taken from the crate.

use core::f64::consts::PI;

use solar_positioning::time::JulianDate;
use solar_positioning::{Location, SolarPositions};

use super::error::SunError;
use super::time::{Instant, days_from_j2000};

const DEGREE: f64 = PI / 180.0;
const J2000_JD: f64 = 2_451_545.0;

/// What the mean sidereal time at Greenwich gains on the sun in a day of UT1 \[deg\]
/// (NREL/TP-560-34302 eq. 28: 360.98564736629 less a whole turn).
const SIDEREAL_GAIN_DEG: f64 = 0.985_647_366_29;

/// What depends on TT only.
#[derive(Debug, Clone, Copy)]
pub(super) struct Slow {
    /// Apparent sidereal time at Greenwich less right ascension less 360° times the days since noon, all
    /// at UT1 = TT \[rad\]: the equation of time. It stays within ±4.3° and never wraps.
    pub equation_of_time: f64,
    pub sin_declination: f64,
    pub cos_declination: f64,
    /// Sine of the equatorial horizontal parallax, eq. 33.
    pub sin_parallax: f64,
}

/// The sun relative to the centre of the earth at one instant.
#[derive(Debug, Clone, Copy)]
pub(super) struct Place {
    /// Local hour angle at Greenwich, west positive, any turn \[rad\].
    pub greenwich_hour_angle: f64,
    pub sin_declination: f64,
    pub cos_declination: f64,
    pub sin_parallax: f64,
}

/// Evaluates SPA at a number of TT days from 2000-01-01T12 TT.
pub(super) fn slow(tt_days: f64) -> Result<Slow, SunError> {
    let refused = SunError::OutsideModel { days: tt_days };
    // UT1 is held at J2000, where the mean sidereal time is one constant, and delta T carries the
    // instant: everything but the mean sidereal time depends on TT alone.
    let delta_t_s = tt_days * 86_400.0;
    let date = JulianDate::new(J2000_JD, delta_t_s).map_err(|_| refused)?;
    // The crate adds up in one double. Counting from the day it arrives at leaves of that
    // rounding (2e-10 d) only the drift of the equation of time.
    let tt_days = date.julian_ephemeris_day() - J2000_JD;
    let spa = SolarPositions::new()
        .for_time_from_julian(date)
        .map_err(|_| refused)?;
    // At the pole the parallax has no azimuth: azimuth = 180° + sidereal time - right ascension.
    let pole = Location {
        latitude: 90.0,
        longitude: 0.0,
    };
    let hour_angle_deg = spa.at(pole, 0.0, None).map_err(|_| refused)?.azimuth() - 180.0;
    let equation_deg = half_turn_deg(hour_angle_deg + turns_deg(SIDEREAL_GAIN_DEG, tt_days));
    let (sin_declination, cos_declination) = libm::sincos(spa.declination() * DEGREE);
    let radius_au = spa.earth_radius_vector().ok_or(refused)?;
    Ok(Slow {
        equation_of_time: equation_deg * DEGREE,
        sin_declination,
        cos_declination,
        sin_parallax: libm::sin(8.794 / (3600.0 * radius_au) * DEGREE),
    })
}

/// What the hour angle at UT1 = TT - delta T has besides the turn of the earth and
/// [`Slow::equation_of_time`] \[rad\], `ut1_days` from 2000-01-01T12: eq. 28's linear term goes by
/// UT1 where the equation of time took TT, and its square and cube were left out there.
pub(super) fn sidereal_correction(ut1_days: f64, delta_t_s: f64) -> f64 {
    let t = ut1_days / 36_525.0;
    let higher_deg = t * t * (0.000_387_933 - t / 38_710_000.0);
    (higher_deg - SIDEREAL_GAIN_DEG / 86_400.0 * delta_t_s) * DEGREE
}

/// Direct evaluation at a UT1 instant.
pub(super) fn at_ut1(instant: Instant, delta_t_s: f64) -> Result<Place, SunError> {
    let ut1_days = days_from_j2000(instant.half_day) + instant.fraction() * 0.5;
    let slow = slow(ut1_days + delta_t_s / 86_400.0)?;
    // Half days begin at midnight (even) and at noon (odd).
    let since_noon = instant.fraction() - if instant.half_day % 2 == 0 { 1.0 } else { 0.0 };
    Ok(Place {
        greenwich_hour_angle: since_noon * PI
            + (slow.equation_of_time + sidereal_correction(ut1_days, delta_t_s)),
        sin_declination: slow.sin_declination,
        cos_declination: slow.cos_declination,
        sin_parallax: slow.sin_parallax,
    })
}

/// Derivative of [`sidereal_correction`] per half day, for a delta T that grows by `growth_s` in it.
pub(super) fn sidereal_correction_rate(ut1_days: f64, growth_s: f64) -> f64 {
    sidereal_correction(ut1_days + 0.25, growth_s) - sidereal_correction(ut1_days - 0.25, 0.0)
}

/// gain · days less whole turns, to the last digit of the fraction \[deg\].
fn turns_deg(gain_deg: f64, days: f64) -> f64 {
    let product = gain_deg * days;
    let rounding = libm::fma(gain_deg, days, -product);
    libm::remainder(product, 360.0) + rounding
}

/// The same angle in [-180, 180].
fn half_turn_deg(angle_deg: f64) -> f64 {
    libm::remainder(angle_deg, 360.0)
}

#[cfg(test)]
mod tests {
    use super::super::time::TimeScale;
    use super::super::{SunSite, position};
    use super::*;
    use crate::angle::{degrees, radians, wrap_pi};

    // NREL/TP-560-34302 table A5.1; UT1 = UTC there
    #[test]
    fn the_reports_intermediate_values_come_out() {
        let scale = TimeScale::new(Some(67.0), 0.0).unwrap();
        let place = at_ut1(scale.instant(1_066_419_030_000_000_000), 67.0).unwrap();
        let declination = degrees(libm::atan2(place.sin_declination, place.cos_declination));
        assert!((declination - -9.31434).abs() < 5e-6, "{declination}");
        let hour_angle = degrees(wrap_pi(place.greenwich_hour_angle)) - 105.1786;
        assert!((hour_angle - 11.105900).abs() < 5e-6, "{hour_angle}");
        let date = JulianDate::new(2_452_930.312_847, 67.0).unwrap();
        let crate_place = SolarPositions::new().for_time_from_julian(date).unwrap();
        assert!((crate_place.right_ascension() - 202.22741).abs() < 5e-6);
        let radius_au = radians(8.794 / 3600.0) / libm::asin(place.sin_parallax);
        assert!((radius_au - 0.996_542_297_4).abs() < 5e-11, "{radius_au}");
    }

    /// The crate at a Julian date in one double: its steps of 40 µs are all that differs.
    #[test]
    fn the_crate_differs_by_the_jitter_of_its_julian_date() {
        let (latitude_deg, longitude_deg, elevation_m) = (50.9134, 6.3878, 87.0);
        let site =
            SunSite::new(radians(latitude_deg), radians(longitude_deg), elevation_m).unwrap();
        let place = Location {
            latitude: latitude_deg,
            longitude: longitude_deg,
        };
        let (mut worst_azimuth, mut worst_elevation) = (0.0_f64, 0.0_f64);
        let mut sum_sq = 0.0;
        let count = 20_000;
        for k in 0..count {
            // 1950 to 2050, never on a round second
            let unix_ns = -631_152_000_000_000_000 + k * 157_788_012_345_678;
            let sun = position(&site, unix_ns, Some(65.0), 0.0).unwrap();
            let date = JulianDate::new(2_440_587.5 + unix_ns as f64 / 86_400e9, 65.0).unwrap();
            let other = SolarPositions::new()
                .at_from_julian(date, place, elevation_m, None)
                .unwrap();
            let elevation = degrees(sun.geometric_elevation_rad) - other.elevation_angle();
            let azimuth = half_turn_deg(degrees(sun.azimuth_rad) - other.azimuth())
                * libm::cos(sun.geometric_elevation_rad);
            worst_azimuth = worst_azimuth.max(azimuth.abs());
            worst_elevation = worst_elevation.max(elevation.abs());
            sum_sq += azimuth * azimuth + elevation * elevation;
        }
        let rms = libm::sqrt(sum_sq / count as f64);
        let seen = (worst_azimuth, worst_elevation, rms);
        assert!(worst_azimuth < 5e-7 && worst_elevation < 5e-7, "{seen:?}");
        // and they are there: this is why day and fraction stay apart
        assert!(worst_azimuth > 5e-8 && rms > 2e-8, "{seen:?}");
    }
}
