//! From the centre of the earth to the site: parallax, horizon, refraction, for one instant.
//!
//! NREL/TP-560-34302 sections 3.11 to 3.14 as one vector: its angles Δα, δ', H' are those of the vector
//! from site to sun, so its components give azimuth and elevation without them, and without an
//! arcsine that has no digits near the zenith.

use super::geocentric::Place;
use super::position::SunPosition;
use super::refraction::refraction_rad;
use super::site::SunSite;
use crate::angle::wrap_tau;

pub(super) fn position(site: &SunSite, place: &Place) -> SunPosition {
    let observer = &site.observer;
    let (sin_hour, cos_hour) = libm::sincos(place.greenwich_hour_angle + site.longitude_rad());
    // v = sun - site: in the meridian, to the west, along the earth's axis
    let meridian = place.cos_declination * cos_hour - observer.axis_distance * place.sin_parallax;
    let west = place.cos_declination * sin_hour;
    let axis = place.sin_declination - observer.equator_height * place.sin_parallax;
    let up = observer.cos_latitude * meridian + observer.sin_latitude * axis;
    let north = observer.cos_latitude * axis - observer.sin_latitude * meridian;
    let geometric_elevation_rad = libm::atan2(up, libm::sqrt(west * west + north * north));
    let refraction = refraction_rad(
        geometric_elevation_rad,
        site.pressure_hpa(),
        site.temperature_c(),
    );
    SunPosition {
        azimuth_rad: wrap_tau(libm::atan2(-west, north)),
        apparent_elevation_rad: geometric_elevation_rad + refraction,
        geometric_elevation_rad,
    }
}
