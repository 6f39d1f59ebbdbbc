//! A cone of light as a function of the angle from its middle, and how much of it a polygon holds.

use core::f64::consts::TAU;

use crate::sunshape::SunShape;

/// Knots of a table. Between two the light within a radius is taken as straight in the square of the radius: less than
/// 1e-5 off for the shapes there are.
const KNOTS: usize = 1024;

/// The light of a cone within a radius, in the plane of tangents of its angles.
///
/// Tabulated as light over squared radius, which is smooth where the light itself begins at 0: up to a knee,
/// over the squared radius; beyond it (the aureole), the light itself over the radius.
#[derive(Debug, Clone)]
pub(super) struct Radial {
    knee_squared: f64,
    knots_per_square: f64,
    over_square: Vec<f64>,
    knee: f64,
    knots_per_radius: f64,
    beyond: Vec<f64>,
    /// Where it ends, and its square.
    pub end: f64,
    end_squared: f64,
    /// Within which half of the light is.
    pub half: f64,
}

impl Radial {
    /// A sun shape, made wider by a Gaussian of `sigma` per axis (0 for none).
    pub(super) fn new(sun: &SunShape, sigma: f64) -> Self {
        let tangent = |angle: f64| libm::tan(angle);
        if sigma > 0.0 {
            return Self::widened(sun, sigma);
        }
        let (knee, end) = (tangent(sun.knee_rad()), tangent(sun.extent_rad()));
        Self::of(knee, end, |radius| sun.cumulative(libm::atan(radius)))
    }

    fn of(knee: f64, end: f64, light: impl Fn(f64) -> f64) -> Self {
        let all = light(end);
        let over_square = (0..=KNOTS)
            .map(|knot| {
                // the limit at the middle, from a radius where it has settled
                let at = (knot as f64).max(1e-3) / KNOTS as f64 * knee * knee;
                light(at.sqrt()) / all / at
            })
            .collect();
        let is_far = end > knee * (1.0 + 1e-9);
        let radius = |knot: usize| knee + (end - knee) * knot as f64 / KNOTS as f64;
        let beyond = if is_far {
            (0..=KNOTS).map(|knot| light(radius(knot)) / all).collect()
        } else {
            Vec::new()
        };
        // by halves
        let (mut low, mut high) = (0.0, end);
        for _ in 0..40 {
            let middle = 0.5 * (low + high);
            if light(middle) < 0.5 * all {
                low = middle;
            } else {
                high = middle;
            }
        }
        Self {
            half: high,
            knee_squared: knee * knee,
            knots_per_square: KNOTS as f64 / (knee * knee),
            over_square,
            knee,
            knots_per_radius: KNOTS as f64 / (end - knee),
            beyond,
            end: if is_far { end } else { knee },
            end_squared: if is_far { end * end } else { knee * knee },
        }
    }

    /// The sun cut into rings of equal light, each blurred by the Gaussian: a ring of radius r has at a distance ρ the
    /// density exp(-(ρ² + r²) / 2σ²) I0(ρ r / σ²) / 2πσ² (Rice 1945).
    fn widened(sun: &SunShape, sigma: f64) -> Self {
        const RINGS: usize = 96;
        let rings: Vec<f64> = (0..RINGS)
            .map(|k| libm::tan(sun.quantile_rad((k as f64 + 0.5) / RINGS as f64)))
            .collect();
        let end = libm::tan(sun.extent_rad()) + 6.0 * sigma;
        let density = |radius: f64| -> f64 {
            let ring = |&r: &f64| {
                let apart = (radius - r) / sigma;
                libm::exp(-0.5 * apart * apart) * scaled_bessel_i0(radius * r / (sigma * sigma))
            };
            rings.iter().map(ring).sum::<f64>() / (RINGS as f64 * TAU * sigma * sigma)
        };
        // Light within: Simpson's rule in the squared radius, π b d(ρ²).
        let step = end * end / KNOTS as f64;
        let at = |k: f64| density((k * step).sqrt());
        let mut within = Vec::with_capacity(KNOTS + 1);
        let mut sum = 0.0;
        let mut left = at(0.0);
        within.push(0.0);
        for knot in 0..KNOTS {
            let k = knot as f64;
            let right = at(k + 1.0);
            sum += 0.25 * TAU * step / 3.0 * (left + 4.0 * at(k + 0.5) + right);
            within.push(sum);
            left = right;
        }
        let middle = 0.5 * TAU * at(0.0);
        let light = |radius: f64| {
            let at = radius * radius / step;
            let knot = (at as usize).min(KNOTS - 1);
            if at < 0.5 {
                return middle * radius * radius;
            }
            within[knot] + (within[knot + 1] - within[knot]) * (at - knot as f64)
        };
        Self::of(end, end, light)
    }

    /// Light within a radius over the radius squared, up to the knee.
    fn over_square(&self, squared: f64) -> f64 {
        let at = squared * self.knots_per_square;
        let knot = (at as usize).min(KNOTS - 1);
        let (low, high) = (self.over_square[knot], self.over_square[knot + 1]);
        low + (high - low) * (at - knot as f64)
    }

    /// Light within a radius, beyond the knee.
    fn beyond(&self, radius: f64) -> f64 {
        let at = (radius - self.knee) * self.knots_per_radius;
        let knot = (at as usize).min(KNOTS - 1);
        let (low, high) = (self.beyond[knot], self.beyond[knot + 1]);
        low + (high - low) * (at - knot as f64)
    }

    /// The part of the cone's light in a convex polygon, given around the middle of the cone.
    ///
    /// Green's theorem: over each edge ∫ C(ρ) dφ / 2π, with C the light within ρ (for a disc the classic sum of
    /// triangles and sectors).
    pub(super) fn within(&self, polygon: &[[f64; 2]]) -> f64 {
        let mut inside = true;
        let mut edges = [(0.0, 0.0, 0.0); 8];
        let mut orientation = 0.0;
        for (k, edge) in edges.iter_mut().enumerate().take(polygon.len()) {
            let (p, q) = (polygon[k], polygon[(k + 1) % polygon.len()]);
            let along = [q[0] - p[0], q[1] - p[1]];
            let squared = along[0] * along[0] + along[1] * along[1];
            if squared == 0.0 {
                continue;
            }
            let inverse = 1.0 / squared.sqrt();
            let side = (p[0] * q[1] - p[1] * q[0]) * inverse;
            *edge = (
                side,
                (p[0] * along[0] + p[1] * along[1]) * inverse,
                (q[0] * along[0] + q[1] * along[1]) * inverse,
            );
            orientation += side / inverse;
        }
        // counterclockwise from here on
        for (side, _, _) in &mut edges[..polygon.len()] {
            *side = side.copysign(*side * orientation);
            if *side <= -self.end {
                return 0.0;
            }
            inside &= *side >= self.end;
        }
        if inside {
            return 1.0;
        }
        let mut sum = 0.0;
        for &(side, from, to) in &edges[..polygon.len()] {
            let height = side.abs();
            let part = self.along_edge(height, to) - self.along_edge(height, from);
            sum += part.copysign(part * side);
        }
        (sum / TAU).clamp(0.0, 1.0)
    }

    /// ∫ C dφ over an edge at a distance, from its foot to a place along it; odd in the place.
    fn along_edge(&self, height: f64, place: f64) -> f64 {
        let place_squared = place * place;
        let height_squared = height * height;
        let length = place.abs();
        let angle = |to: f64| libm::atan2(to, height);
        let mut sum = 0.0;
        let mut from = 0.0;
        if height_squared < self.knee_squared {
            let to = length.min((self.knee_squared - height_squared).sqrt());
            // dφ = height dt / ρ², and C / ρ² is smooth
            sum += height * gauss(0.0, to, |t| self.over_square(height_squared + t * t));
            from = to;
        }
        if from < length && height_squared < self.end_squared && !self.beyond.is_empty() {
            let to = length.min((self.end_squared - height_squared).sqrt());
            if to > from {
                let light = |angle: f64| {
                    let radius = height / libm::cos(angle);
                    self.beyond(radius.clamp(self.knee, self.end))
                };
                sum += gauss(angle(from), angle(to), light);
                from = to;
            }
        }
        if place_squared > from * from {
            sum += angle(length) - angle(from);
        }
        sum.copysign(place)
    }
}

/// The rule of Gauss and Legendre with five nodes: polynomials up to degree nine exactly.
fn gauss(from: f64, to: f64, f: impl Fn(f64) -> f64) -> f64 {
    const NODES: [(f64, f64); 2] = [
        (0.538_469_310_105_683_1, 0.478_628_670_499_366_5),
        (0.906_179_845_938_664, 0.236_926_885_056_189_08),
    ];
    let (middle, half) = (0.5 * (from + to), 0.5 * (to - from));
    let mut sum = 0.568_888_888_888_888_9 * f(middle);
    for (node, weight) in NODES {
        sum += weight * (f(middle - half * node) + f(middle + half * node));
    }
    half * sum
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

    const POINTS: u64 = 100_000;

    /// Many points of a cone.
    fn points(sun: &SunShape, sigma: f64) -> Vec<[f64; 2]> {
        let point = |k: u64| {
            let u = |d| part(hash(k, d));
            let radius = libm::tan(sun.quantile_rad((k as f64 + 0.5) / POINTS as f64));
            let spread = sigma * (-2.0 * (1.0 - u(2)).ln()).sqrt();
            let (s, c) = libm::sincos(TAU * u(1));
            let (s2, c2) = libm::sincos(TAU * u(3));
            [radius * c + spread * c2, radius * s + spread * s2]
        };
        (0..POINTS).map(point).collect()
    }

    fn counted(points: &[[f64; 2]], polygon: &[[f64; 2]]) -> f64 {
        let inside = |&&[x, y]: &&[f64; 2]| {
            (0..polygon.len()).all(|k| {
                let (p, q) = (polygon[k], polygon[(k + 1) % polygon.len()]);
                (q[0] - p[0]) * (y - p[1]) - (q[1] - p[1]) * (x - p[0]) >= 0.0
            })
        };
        points.iter().filter(inside).count() as f64 / POINTS as f64
    }

    #[test]
    fn polygons_hold_as_much_as_is_counted() {
        let suns = [
            (SunShape::pillbox(4.65e-3).unwrap(), 0.0),
            (SunShape::limb_darkened(4.65e-3).unwrap(), 0.0),
            (SunShape::gaussian(2.5e-3).unwrap(), 0.0),
            (SunShape::buie(0.3).unwrap(), 0.0),
            (SunShape::pillbox(4.65e-3).unwrap(), 2e-3),
            (SunShape::buie(0.1).unwrap(), 1e-3),
        ];
        for (number, (sun, sigma)) in suns.iter().enumerate() {
            let radial = Radial::new(sun, *sigma);
            let points = points(sun, *sigma);
            let mut some = 0;
            for case in 0..12 {
                let u = |d| part(hash(1000 + case, d));
                let (x, y, size) = (8e-3 * (u(1) - 0.5), 8e-3 * (u(2) - 0.5), 1e-3 + 8e-3 * u(3));
                let polygon = [
                    [x - size, y - 0.7 * size],
                    [x + size, y - size],
                    [x + 0.8 * size, y + size * u(4)],
                    [x - size, y + size],
                ];
                let got = radial.within(&polygon);
                let want = counted(&points, &polygon);
                // four standard errors of the count, at most 0.0064
                assert!(
                    (got - want).abs() < 6.4e-3,
                    "{number}, {case}: {got} {want}"
                );
                let turned: Vec<_> = polygon.iter().rev().copied().collect();
                assert!((radial.within(&turned) - got).abs() < 1e-12);
                some += usize::from(got > 0.02 && got < 0.98);
            }
            assert!(some > 5);
            let wide = [[-0.2, -0.2], [0.2, -0.2], [0.2, 0.2], [-0.2, 0.2]];
            assert_eq!(radial.within(&wide), 1.0);
            assert_eq!(radial.within(&wide.map(|[x, y]| [x + 0.5, y])), 0.0);
        }
    }

    // Of the disc exactly: half planes and quarters, and a square inside.
    #[test]
    fn a_disc_is_cut_exactly() {
        let radial = Radial::new(&SunShape::pillbox(4.65e-3).unwrap(), 0.0);
        let r = libm::tan(4.65e-3);
        let cut = |x: f64, y: f64| radial.within(&[[x, y], [1.0, y], [1.0, 1.0], [x, 1.0]]);
        assert!((cut(0.0, 0.0) - 0.25).abs() < 1e-6);
        assert!((cut(0.0, -1.0) - 0.5).abs() < 1e-6);
        // beyond a chord at r/2: (π/3 - √3/4) / π
        let segment = 1.0 / 3.0 - 3_f64.sqrt() / (4.0 * core::f64::consts::PI);
        assert!((cut(0.5 * r, -1.0) - segment).abs() < 1e-5);
        let square = radial.within(&[[0.0, 0.0], [1e-3, 0.0], [1e-3, 1e-3], [0.0, 1e-3]]);
        assert!((square - 1e-6 / (core::f64::consts::PI * r * r)).abs() < 1e-6);
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
