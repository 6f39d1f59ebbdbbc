//! Geodetic points (WGS 84) into east, north, up of one of them.

use helio_core::angle::radians;
use helio_core::{Enu, EnuUnit};

/// Semi-major axis of WGS 84 \[m\].
const A_M: f64 = 6_378_137.0;
/// Flattening of WGS 84.
const FLATTENING: f64 = 1.0 / 298.257_223_563;

/// A point that is 0, 0, 0.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Origin {
    /// Latitude and longitude \[deg\], height \[m\].
    pub(super) geodetic: [f64; 3],
    east: Enu,
    north: Enu,
    up: Enu,
    centred: Enu,
}

impl Origin {
    pub(super) fn new(geodetic: [f64; 3]) -> Self {
        let up = upright(geodetic);
        let east = EnuUnit::from_azimuth_elevation(radians(geodetic[1]), 0.0).as_enu();
        // As a vector of the earth: x where longitude is 0, y 90 degrees east of it, z to the pole.
        let east = Enu::new(-east.east, east.north, 0.0);
        Self {
            geodetic,
            east,
            north: up.cross(east),
            up,
            centred: earth_centred_m(geodetic),
        }
    }

    /// A point \[m\] by the full rotation: up is square to the ellipsoid at the origin.
    pub(super) fn enu_m(&self, geodetic: [f64; 3]) -> Enu {
        let away = earth_centred_m(geodetic) - self.centred;
        Enu::new(away.dot(self.east), away.dot(self.north), away.dot(self.up))
    }
}

/// Square to the ellipsoid, as a vector of the earth.
fn upright([latitude_deg, longitude_deg, _]: [f64; 3]) -> Enu {
    let unit = EnuUnit::from_azimuth_elevation(radians(longitude_deg), radians(latitude_deg));
    let Enu { east, north, up } = unit.as_enu();
    Enu::new(north, east, up)
}

fn earth_centred_m(geodetic: [f64; 3]) -> Enu {
    let up = upright(geodetic);
    let square = FLATTENING * (2.0 - FLATTENING);
    let radius = A_M / (1.0 - square * up.up * up.up).sqrt();
    let across = radius + geodetic[2];
    Enu::new(
        across * up.east,
        across * up.north,
        (radius * (1.0 - square) + geodetic[2]) * up.up,
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Against what the ellipsoid says by itself; places of a real plant against PROJ are in the tests of Python.
    #[test]
    fn points_lie_where_they_lie_for_others() {
        // Poles, equator: known without any formula.
        let pole = earth_centred_m([90.0, 0.0, 0.0]);
        let semi_minor_m = A_M * (1.0 - FLATTENING);
        assert!((pole.up - semi_minor_m).abs() < 1e-8 && pole.east.abs() < 1e-8);
        let equator = earth_centred_m([0.0, 90.0, 100.0]);
        assert!((equator.north - (A_M + 100.0)).abs() < 1e-8 && equator.east.abs() < 1e-8);
        // A degree of latitude on the equator's meridian radius a (1 - e^2), and up above the origin.
        let origin = Origin::new([0.0, 6.4, 20.0]);
        let square = FLATTENING * (2.0 - FLATTENING);
        let near = origin.enu_m([1e-4, 6.4, 20.0]);
        let arc_m = (A_M * (1.0 - square) + 20.0) * radians(1e-4);
        assert!((near.north - arc_m).abs() < 1e-6, "{near:?}");
        let east = origin.enu_m([0.0, 6.4 + 1e-4, 20.0]);
        assert!((east.east - (A_M + 20.0) * radians(1e-4)).abs() < 1e-6);
        let above = origin.enu_m([0.0, 6.4, 120.0]);
        assert!((above.up - 100.0).abs() < 1e-8 && above.east.abs() < 1e-8);
    }
}
