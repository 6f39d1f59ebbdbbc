//! Generated fields: patterns of heliostats around a tower at the origin.
//!
//! Both keep mirrors from touching however they turn: no two pivots are closer than a mirror's
//! diagonal and a gap. Both leave a circle around the tower empty and go all the way round it.

use alloc::vec::Vec;
use core::f64::consts::{PI, TAU};

use crate::frame::Enu;

/// Free space between two mirrors that face each other edge to edge \[m\].
const GAP_M: f64 = 0.3;
/// Radius of the innermost ring in tower heights.
const INNER_TOWER_HEIGHTS: f64 = 0.75;

/// What a pattern is made for.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Measures {
    /// Number of heliostats.
    pub count: usize,
    /// Height of the target above the pivots \[m\].
    pub tower_height_m: f64,
    /// Width of a mirror \[m\].
    pub mirror_width_m: f64,
    /// Height of a mirror \[m\].
    pub mirror_height_m: f64,
    /// Height of all pivots \[m\].
    pub up_m: f64,
}

impl Measures {
    /// Least distance of two pivots.
    fn spacing_m(&self) -> f64 {
        libm::hypot(self.mirror_width_m, self.mirror_height_m) + GAP_M
    }

    fn inner_radius_m(&self) -> f64 {
        (INNER_TOWER_HEIGHTS * self.tower_height_m).max(self.spacing_m())
    }
}

/// Rings around the tower, the heliostats of each between those of the ring before.
///
/// Rings stand as far apart as DELSOL3 puts them so that mirrors hardly block each other (Kistler
/// 1986, SAND86-8018: a function of the elevation angle of the target). A ring has as many
/// heliostats as the one before until twice as many fit: there a new zone begins.
///
/// ```
/// use helio_core::layout::{Measures, radial_staggered};
/// let measures = Measures {
///     count: 500,
///     tower_height_m: 120.0,
///     mirror_width_m: 11.0,
///     mirror_height_m: 10.0,
///     up_m: 6.0,
/// };
/// assert_eq!(radial_staggered(&measures).len(), 500);
/// ```
#[must_use]
pub fn radial_staggered(measures: &Measures) -> Vec<Enu> {
    let spacing_m = measures.spacing_m();
    let mut pivots = Vec::with_capacity(measures.count);
    let mut radius_m = measures.inner_radius_m();
    let mut in_ring = fitting(radius_m, spacing_m);
    let mut shifted = false;
    while pivots.len() < measures.count {
        let step = TAU / in_ring as f64;
        let start = if shifted { 0.5 * step } else { 0.0 };
        let left = measures.count - pivots.len();
        // A last ring that is not full keeps to the north.
        for i in north_first(in_ring).take(left) {
            let azimuth = start + i as f64 * step;
            let (sin, cos) = libm::sincos(azimuth);
            pivots.push(Enu::new(radius_m * sin, radius_m * cos, measures.up_m));
        }
        let elevation = libm::atan(measures.tower_height_m / radius_m);
        let delsol = 1.44 / libm::tan(elevation) - 1.094 + 3.068 * elevation
            - 1.1256 * elevation * elevation;
        let next_m = radius_m + (delsol * measures.mirror_height_m).max(0.867 * spacing_m);
        shifted = !shifted;
        if fitting(next_m, spacing_m) >= 2 * in_ring {
            // The first ring of a zone cannot stand in the gaps of the last: a whole spacing away.
            radius_m = next_m.max(radius_m + spacing_m);
            in_ring = fitting(radius_m, spacing_m);
            shifted = false;
        } else {
            radius_m = next_m;
        }
    }
    pivots
}

/// Heliostats that fit on a ring with straight distances of at least `spacing_m`.
fn fitting(radius_m: f64, spacing_m: f64) -> usize {
    let half = libm::asin((0.5 * spacing_m / radius_m).min(1.0));
    libm::floor(PI / half * (1.0 + 1e-12)).max(1.0) as usize
}

/// 0, 1, -1, 2, -2, … each place of a ring once.
fn north_first(count: usize) -> impl Iterator<Item = i64> {
    (0..count as i64).map(|k| if k % 2 == 1 { k / 2 + 1 } else { -(k / 2) })
}

/// A spiral of golden angles whose density falls with the distance (Noone, Torrilhon and Mitsos 2012,
/// Solar Energy 86, eqs. 1-2: r = a k^b with b = 0.65). The tower stands at the origin.
#[must_use]
pub fn fermat_spiral(measures: &Measures) -> Vec<Enu> {
    const GROWTH: f64 = 0.65;
    /// Least distance of two heliostats over the square root of the area of the innermost: at least
    /// 0.958 wherever between k = 1 and 10,000 the spiral begins.
    const CLOSEST: f64 = 0.95;
    let golden = 0.5 * (1.0 + libm::sqrt(5.0));
    let turn = TAU / (golden * golden);
    // The area of each is 2 π b r² / k; at the inner edge it must leave the spacing.
    let inner_m = measures.inner_radius_m();
    let area_m2 = libm::pow(measures.spacing_m() / CLOSEST, 2.0);
    let first = TAU * GROWTH * inner_m * inner_m / area_m2;
    let scale_m = inner_m / libm::pow(first, GROWTH);
    (0..measures.count)
        .map(|i| {
            let k = first + i as f64;
            let radius_m = scale_m * libm::pow(k, GROWTH);
            // The angle from the whole number alone: it stays exact however many there are.
            let (sin, cos) = libm::sincos(i as f64 * turn);
            Enu::new(radius_m * sin, radius_m * cos, measures.up_m)
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use std::collections::HashMap;

    use super::*;

    /// Least distance of any two pivots.
    fn closest_m(pivots: &[Enu], cell_m: f64) -> f64 {
        let cell = |p: &Enu| {
            (
                (p.east / cell_m).floor() as i64,
                (p.north / cell_m).floor() as i64,
            )
        };
        let mut cells: HashMap<(i64, i64), Vec<Enu>> = HashMap::new();
        for pivot in pivots {
            cells.entry(cell(pivot)).or_default().push(*pivot);
        }
        let mut closest_m = f64::INFINITY;
        for pivot in pivots {
            let (x, y) = cell(pivot);
            for near in (-1..=1).flat_map(|dx| (-1..=1).map(move |dy| (x + dx, y + dy))) {
                for other in cells
                    .get(&near)
                    .into_iter()
                    .flatten()
                    .filter(|&o| o != pivot)
                {
                    closest_m = closest_m.min((*other - *pivot).norm());
                }
            }
        }
        closest_m
    }

    #[test]
    fn no_two_mirrors_can_touch_and_the_number_is_right() {
        for (width, height, tower) in [(6.0, 5.0, 120.0), (12.8, 9.4, 150.0), (2.0, 1.0, 40.0)] {
            for count in [1, 7, 500, 30_000] {
                let measures = Measures {
                    count,
                    tower_height_m: tower,
                    mirror_width_m: width,
                    mirror_height_m: height,
                    up_m: 3.0,
                };
                let patterns: [fn(&Measures) -> Vec<Enu>; 2] = [radial_staggered, fermat_spiral];
                for pattern in patterns {
                    let pivots = pattern(&measures);
                    assert_eq!(pivots.len(), count);
                    let wanted = measures.spacing_m();
                    let closest = closest_m(&pivots, 1.01 * wanted);
                    assert!(
                        closest >= wanted * (1.0 - 1e-9),
                        "{width} {count}: {closest} {wanted}"
                    );
                    let inner = |p: &Enu| p.east.hypot(p.north) >= 0.75 * tower - 1e-9;
                    assert!(pivots.iter().all(inner));
                }
            }
        }
    }
}
