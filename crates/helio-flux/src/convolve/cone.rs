//! The cones that mirrors reflect: the sun's, widened by the errors of the surface, by the angle of incidence.

use core::f64::consts::{PI, TAU};
use std::collections::BTreeMap;

use rayon::iter::{IntoParallelIterator, ParallelIterator};

use super::radial::Radial;
use crate::optics::OpticalError;
use crate::sunshape::SunShape;

/// Incidences share a cone where the variance across the plane of incidence differs by half of this part at most: its
/// width by 0.1 %, and so a peak.
const STEP: f64 = 4e-3;

/// Knots of a table over the squared radius, and of one with an aureole.
const KNOTS: [usize; 2] = [512, 1024];

/// Sectors of a quarter turn for which a table is made; as many cosines can be told apart. The first is enough where the
/// last cosine of it is small.
const SECTORS: [usize; 2] = [6, 16];

/// Light of a sector that cosines left out may amount to, of all.
const LEFT_OUT: f64 = 1e-4;

/// Where a Gaussian ends, in standard deviations: 2e-9 of its light is left out.
const TAIL: f64 = 6.0;

/// The cones of all incidences that there are.
pub(super) struct Cones<'a> {
    sun: &'a SunShape,
    slope: f64,
    scatter: f64,
    /// Variance of the sun's disc per axis, as told by the half of its light.
    of_sun: f64,
    cones: BTreeMap<i64, Radial>,
}

impl<'a> Cones<'a> {
    /// For mirrors that the sun meets at these cosines of incidence.
    pub(super) fn new(
        sun: &'a SunShape,
        error: &OpticalError,
        cosines: impl Iterator<Item = f64>,
    ) -> Self {
        let half = libm::tan(sun.quantile_rad(0.5));
        let mut cones = Self {
            sun,
            slope: error.slope_rms_rad(),
            scatter: error.specularity_rms_rad(),
            of_sun: half * half / (2.0 * core::f64::consts::LN_2),
            cones: BTreeMap::new(),
        };
        let mut keys: Vec<i64> = cosines.map(|cosine| cones.key(cosine)).collect();
        keys.sort_unstable();
        keys.dedup();
        let made: Vec<Radial> = keys
            .clone()
            .into_par_iter()
            .map(|k| cones.make(k))
            .collect();
        cones.cones = keys.into_iter().zip(made).collect();
        cones
    }

    /// Variances of the errors in the plane of incidence and across.
    fn variances(&self, cosine: f64) -> [f64; 2] {
        let turned = 4.0 * self.slope * self.slope;
        [turned, turned * cosine * cosine].map(|slope| slope + self.scatter * self.scatter)
    }

    fn key(&self, cosine: f64) -> i64 {
        let across = self.of_sun + self.variances(cosine)[1];
        (libm::log(across / (self.of_sun + self.variances(1.0)[1])) / STEP).round() as i64
    }

    fn make(&self, key: i64) -> Radial {
        let [along, most] = self.variances(1.0);
        let across = (self.of_sun + most) * libm::exp(key as f64 * STEP) - self.of_sun;
        let across = across.clamp(self.variances(0.0)[1], most);
        if along == 0.0 {
            return Radial::of_sun(self.sun);
        }
        let squeeze = ((self.of_sun + across) / (self.of_sun + along)).sqrt();
        widened(self.sun, along.sqrt(), across.sqrt(), squeeze)
    }

    /// The cone of an incidence; `None` for one that was not among those it was made for.
    pub(super) fn of(&self, cosine: f64) -> Option<&Radial> {
        self.cones.get(&self.key(cosine))
    }
}

/// The sun with a Gaussian over it, `along` wide in the plane of incidence and `across` (no more) across.
///
/// A Gaussian as wide as `across` all round leaves the sun round; what is left to do in the plane of incidence is a sum of
/// shifted ones of these.
fn widened(sun: &SunShape, along: f64, across: f64, squeeze: f64) -> Radial {
    let profile = Profile::new(sun, across);
    let shifts = shifts((along * along - across * across).max(0.0).sqrt(), across);
    let density = |x: f64, y: f64| -> f64 {
        let one = |&(shift, weight): &(f64, f64)| weight * profile.at(libm::hypot(x - shift, y));
        shifts.iter().map(one).sum()
    };
    let sun_end = libm::tan(sun.extent_rad());
    let end = (sun_end + TAIL * across).max(squeeze * (sun_end + TAIL * along));
    let is_far = sun.extent_rad() > sun.knee_rad() * (1.0 + 1e-9);
    let knots = KNOTS[usize::from(is_far)];
    let step = end * end / knots as f64;
    // cosines of twice the angles: those at which a sum of cosines is told best (Chebyshev's)
    let cosines_of = |sectors: usize| -> Vec<Vec<f64>> {
        let tables: Vec<Vec<f64>> = (0..sectors)
            .map(|sector| {
                let angle = 0.5 * PI * (sector as f64 + 0.5) / sectors as f64;
                let (sine, cosine) = libm::sincos(angle);
                let at = |k: f64| {
                    let radius = (k * step).sqrt();
                    density(radius * cosine / squeeze, radius * sine) / squeeze
                };
                light_over_square(at, step, knots)
            })
            .collect();
        (0..sectors).map(|m| of_cosine(&tables, m)).collect()
    };
    let is_small = |values: &Vec<f64>| {
        let light = |(k, v): (usize, &f64)| v.abs() * k as f64 * step;
        values.iter().enumerate().map(light).fold(0.0, f64::max) < LEFT_OUT
    };
    let mut cosines = cosines_of(if shifts.len() == 1 { 1 } else { SECTORS[0] });
    if cosines.len() > 1 && !cosines.last().is_some_and(is_small) {
        cosines = cosines_of(SECTORS[1]);
    }
    // what is small is left out, from the end
    while cosines.len() > 1 && cosines.last().is_some_and(is_small) {
        cosines.pop();
    }
    let terms = cosines.len();
    let table = (0..=knots).flat_map(|knot| cosines.iter().map(move |values| values[knot]));
    Radial::of_table(end, squeeze, terms, table.collect())
}

/// Light within every knot of the squared radius, over that square: π ∫ b d(ρ²) by Simpson's rule.
fn light_over_square(density: impl Fn(f64) -> f64, step: f64, knots: usize) -> Vec<f64> {
    let mut left = density(0.0);
    let mut table = vec![PI * left];
    let mut sum = 0.0;
    for knot in 0..knots {
        let k = knot as f64;
        let right = density(k + 1.0);
        sum += PI * step / 6.0 * (left + 4.0 * density(k + 0.5) + right);
        table.push(sum / ((k + 1.0) * step));
        left = right;
    }
    table
}

/// How much of the cosine of `2 m φ` there is in each knot of the sectors' tables.
fn of_cosine(tables: &[Vec<f64>], m: usize) -> Vec<f64> {
    let count = tables.len() as f64;
    let weight = if m == 0 { 1.0 / count } else { 2.0 / count };
    let cosine: Vec<f64> = (0..tables.len())
        .map(|sector| weight * libm::cos(m as f64 * PI * (sector as f64 + 0.5) / count))
        .collect();
    (0..tables[0].len())
        .map(|knot| tables.iter().zip(&cosine).map(|(t, c)| t[knot] * c).sum())
        .collect()
}

/// A Gaussian in one direction as shifts and weights: the rule of trapezoids, whose error for what is at least as smooth as a
/// Gaussian of `smooth` is 1e-8 at these steps, and else one step of a hundred.
fn shifts(sigma: f64, smooth: f64) -> Vec<(f64, f64)> {
    if sigma < 1e-3 * smooth {
        return vec![(0.0, 1.0)];
    }
    let step = smooth.max(0.1 * sigma).min(0.5 * sigma);
    let most = (5.0 * sigma / step).ceil() as i32;
    let weight = |k: i32| {
        let at = f64::from(k) * step / sigma;
        libm::exp(-0.5 * at * at)
    };
    let all: f64 = (-most..=most).map(weight).sum();
    (-most..=most)
        .map(|k| (f64::from(k) * step, weight(k) / all))
        .collect()
}

/// Density over the radius of a sun widened all round.
struct Profile {
    per_radius: f64,
    density: Vec<f64>,
}

impl Profile {
    /// The sun cut into rings, each blurred by the Gaussian: a ring of radius r has at a distance ρ the
    /// density exp(-(ρ² + r²) / 2σ²) I0(ρ r / σ²) / 2πσ² (Rice 1945).
    fn new(sun: &SunShape, sigma: f64) -> Self {
        let light = |radius: f64| sun.cumulative(libm::atan(radius));
        let sun_end = libm::tan(sun.extent_rad());
        let end = sun_end + TAIL * sigma;
        let step = end / (2 * KNOTS[1]) as f64;
        let rings = if sigma > step {
            rings(sun, sigma)
        } else {
            Vec::new()
        };
        let at = |knot: usize| {
            let radius = knot as f64 * step;
            if rings.is_empty() {
                // finer than the table: what lies between knots
                let (from, to) = ((radius - 0.5 * step).max(0.0), radius + 0.5 * step);
                return (light(to) - light(from)) / (PI * (to * to - from * from));
            }
            let first = rings.partition_point(|(r, _)| *r < radius - 7.0 * sigma);
            let near = rings[first..].iter();
            let near = near.take_while(|(r, _)| *r <= radius + 7.0 * sigma);
            let ring = |&(r, light): &(f64, f64)| {
                let apart = (radius - r) / sigma;
                let around = scaled_bessel_i0(radius * r / (sigma * sigma));
                light * libm::exp(-0.5 * apart * apart) * around
            };
            near.map(ring).sum::<f64>() / (TAU * sigma * sigma)
        };
        Self {
            per_radius: 1.0 / step,
            density: (0..=2 * KNOTS[1]).map(at).collect(),
        }
    }

    fn at(&self, radius: f64) -> f64 {
        let at = radius * self.per_radius;
        let knot = at as usize;
        if knot + 1 >= self.density.len() {
            return 0.0;
        }
        let (low, high) = (self.density[knot], self.density[knot + 1]);
        low + (high - low) * (at - knot as f64)
    }
}

/// Rings of a sun, two for each half of a Gaussian's width at most: their radii and light.
fn rings(sun: &SunShape, sigma: f64) -> Vec<(f64, f64)> {
    let (knee, end) = (libm::tan(sun.knee_rad()), libm::tan(sun.extent_rad()));
    let mut rings = Vec::new();
    for (from, to, least) in [(0.0, knee, 48.0), (knee, end, 32.0)] {
        let count = ((to - from) / (0.5 * sigma)).max(least).ceil();
        if to <= from * (1.0 + 1e-9) {
            continue;
        }
        let edge = |k: f64| from + (to - from) * k / count;
        let within = |squared: f64| sun.cumulative(libm::atan(squared.sqrt()));
        for k in 0..count as usize {
            let (low, high) = (edge(k as f64).powi(2), edge(k as f64 + 1.0).powi(2));
            let (inner, outer) = (within(low), within(high));
            let light = outer - inner;
            if light > 0.0 {
                // the mean of the squared radius: by parts, and Simpson's rule
                let mean = (inner + 4.0 * within(0.5 * (low + high)) + outer) / 6.0;
                let squared = high - (high - low) * ((mean - inner) / light).clamp(0.0, 1.0);
                // two of half its light, as far from it as gives an even ring's spread too
                let away = (high - low) / 12_f64.sqrt();
                let away = away.min(squared - low).min(high - squared);
                for squared in [squared - away, squared + away] {
                    rings.push((squared.sqrt(), 0.5 * light));
                }
            }
        }
    }
    rings
}

/// e^(-x) I0(x) for x >= 0, to 2e-7 (Abramowitz and Stegun 1964, 9.8.1 and 9.8.2).
fn scaled_bessel_i0(x: f64) -> f64 {
    let horner = |t: f64, c: &[f64]| c.iter().rev().fold(0.0, |sum, &c| sum * t + c);
    if x <= 3.75 {
        let t = (x / 3.75) * (x / 3.75);
        let c = [
            1.0,
            3.515_622_9,
            3.089_942_4,
            1.206_749_2,
            0.265_973_2,
            0.036_076_8,
            0.004_581_3,
        ];
        return libm::exp(-x) * horner(t, &c);
    }
    let c = [
        0.398_942_28,
        0.013_285_92,
        0.002_253_19,
        -0.001_575_65,
        0.009_162_81,
        -0.020_577_06,
        0.026_355_37,
        -0.016_476_33,
        0.003_923_77,
    ];
    horner(3.75 / x, &c) / x.sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sampling::{hash, part};

    fn erf_part(from: f64, to: f64, sigma: f64) -> f64 {
        let at = |x: f64| libm::erf(x / (sigma * 2_f64.sqrt()));
        0.5 * (at(to) - at(from))
    }

    // A Gaussian sun under Gaussian errors is a Gaussian: of a rectangle, the product of two error functions.
    #[test]
    fn gaussian_cones_are_products_of_error_functions() {
        let sun_sigma = 2.5e-3;
        let sun = SunShape::gaussian(sun_sigma).unwrap();
        let mut worst = 0.0_f64;
        for (slope, scatter, degrees) in [
            (0.0, 1e-3, 0.0_f64),
            (1e-3, 0.0, 0.0),
            (1e-3, 5e-4, 30.0),
            (2e-3, 0.0, 60.0),
            (4e-3, 0.0, 75.0),
            (1e-2, 1e-3, 85.0),
            (1e-4, 0.0, 80.0),
        ] {
            let cosine = degrees.to_radians().cos();
            let error = OpticalError::new(slope, scatter).unwrap();
            let cones = Cones::new(&sun, &error, core::iter::once(cosine));
            let cone = cones.of(cosine).unwrap();
            let width = |factor: f64| {
                let turned = 2.0 * slope * factor;
                (sun_sigma * sun_sigma + turned * turned + scatter * scatter).sqrt()
            };
            let [x_sigma, y_sigma] = [width(1.0), width(cosine)];
            for case in 0..200 {
                let u = |d| part(hash(case, d));
                let x = 4.0 * x_sigma * (u(0) - 0.5);
                let y = 4.0 * y_sigma * (u(1) - 0.5);
                let (w, h) = (3.0 * x_sigma * u(2), 3.0 * y_sigma * u(3) * u(4));
                let corners = [[x, y], [x + w, y], [x + w, y + h], [x, y + h]];
                let want = erf_part(x, x + w, x_sigma) * erf_part(y, y + h, y_sigma);
                let got = cone.within(&corners.map(|[x, y]| [x * cone.squeeze, y]));
                worst = worst.max((got - want).abs());
                assert!((got - want).abs() < 4e-4, "{slope} {degrees}: {got} {want}");
            }
        }
        assert!(worst < 4e-4, "{worst}");
    }

    // Any sun, oblique: a polygon against the light counted at random.
    #[test]
    fn oblique_cones_hold_as_much_as_is_counted() {
        const POINTS: u64 = 200_000;
        for (sun, slope, scatter, degrees) in [
            (SunShape::pillbox(4.65e-3).unwrap(), 2e-3, 0.0, 75.0_f64),
            (SunShape::pillbox(4.65e-3).unwrap(), 1e-2, 0.0, 84.0),
            (SunShape::limb_darkened(4.65e-3).unwrap(), 1e-3, 1e-4, 60.0),
            (SunShape::limb_darkened(4.65e-3).unwrap(), 2e-5, 0.0, 50.0),
            (SunShape::buie(0.2).unwrap(), 1.5e-3, 5e-4, 70.0),
        ] {
            let cosine = degrees.to_radians().cos();
            let error = OpticalError::new(slope, scatter).unwrap();
            let cones = Cones::new(&sun, &error, core::iter::once(cosine));
            let cone = cones.of(cosine).unwrap();
            let points: Vec<[f64; 2]> = (0..POINTS)
                .map(|k| {
                    let u = |d| part(hash(k, d));
                    let radius = libm::tan(sun.quantile_rad((k as f64 + 0.5) / POINTS as f64));
                    let (s, c) = libm::sincos(TAU * u(1));
                    let normal = |d: u64, sigma: f64| {
                        let spread = sigma * (-2.0 * (1.0 - u(d)).ln()).sqrt();
                        let (s, c) = libm::sincos(TAU * u(d + 1));
                        [spread * c, spread * s]
                    };
                    let (g, p) = (normal(2, slope), normal(4, scatter));
                    [
                        radius * c + 2.0 * g[0] + p[0],
                        radius * s + 2.0 * cosine * g[1] + p[1],
                    ]
                })
                .collect();
            for case in 0..24 {
                let u = |d| part(hash(5000 + case, d));
                let (x, y) = (8e-3 * (u(1) - 0.5), 6e-3 * (u(2) - 0.5));
                let (w, h) = (6e-3 * u(3), 4e-3 * u(4));
                let inside = |&&[px, py]: &&[f64; 2]| (px - x).abs() < w && (py - y).abs() < h;
                let want = points.iter().filter(inside).count() as f64 / POINTS as f64;
                let corners = [
                    [x - w, y - h],
                    [x + w, y - h],
                    [x + w, y + h],
                    [x - w, y + h],
                ];
                let got = cone.within(&corners.map(|[x, y]| [x * cone.squeeze, y]));
                // four standard errors of the count, at most 0.0045
                let bound = 4.0 * (want * (1.0 - want) / POINTS as f64).sqrt() + 2e-4;
                assert!((got - want).abs() < bound, "{degrees} {case}: {got} {want}");
            }
        }
    }

    // Against Maclaurin's series, and values to 9 digits from the handbook's table 9.8.
    #[test]
    fn the_bessel_function_is_that_of_the_handbook() {
        for (x, want) in [(0.0, 1.0), (1.0, 0.465_759_607_6), (5.0, 0.183_540_812_6)] {
            assert!((scaled_bessel_i0(x) - want).abs() < 2e-7, "{x}");
        }
        for k in 0..60 {
            let x = 0.1 * f64::from(k);
            let (mut term, mut sum) = (1.0, 1.0);
            for n in 1..60 {
                term *= (0.5 * x / f64::from(n)).powi(2);
                sum += term;
            }
            assert!((scaled_bessel_i0(x) - sum * (-x).exp()).abs() < 2e-7, "{x}");
        }
    }
}
