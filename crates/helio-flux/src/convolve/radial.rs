//! A cone of light as a function of the angle from its middle, and how much of it a polygon holds.

use core::f64::consts::TAU;

use crate::sunshape::SunShape;

/// Knots of a table. Between two the light within a radius is taken as straight in the square of the radius: less than
/// 1e-5 off for the shapes there are.
const KNOTS: usize = 1024;

/// The light of a cone within a radius, in the plane of tangents of its angles.
///
/// Tabulated as light over squared radius, which is smooth where the light itself begins at 0: up to a knee,
/// over the squared radius; beyond it (the aureole), the light itself over the radius. Of a cone that is not round the
/// light is that of a thin sector toward an angle φ, over the sector's part of the turn: a sum of cosines of even
/// multiples of φ, `terms` numbers for each knot.
#[derive(Debug, Clone)]
pub(super) struct Radial {
    knee_squared: f64,
    knots_per_square: f64,
    over_square: Vec<f64>,
    terms: usize,
    /// Numbers of a knot: powers of the cosine where it is 4, else multiples of the angle; and the last knot but one.
    stride: usize,
    last: usize,
    /// The whole light of a sector.
    whole: Vec<f64>,
    knee: f64,
    knots_per_radius: f64,
    beyond: Vec<f64>,
    /// Where it ends, and its square.
    pub end: f64,
    end_squared: f64,
    /// Within which half of the light is.
    pub half: f64,
    /// By what the first coordinate (in the plane of incidence) is multiplied before it is asked, so that the cone
    /// is nearly as wide there as across.
    pub squeeze: f64,
}

impl Radial {
    /// A sun shape as it is.
    pub(super) fn of_sun(sun: &SunShape) -> Self {
        let (knee, end) = (libm::tan(sun.knee_rad()), libm::tan(sun.extent_rad()));
        let light = |radius: f64| sun.cumulative(libm::atan(radius));
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
        let end = if is_far { end } else { knee };
        Self {
            half: libm::tan(sun.quantile_rad(0.5)),
            knee_squared: knee * knee,
            knots_per_square: KNOTS as f64 / (knee * knee),
            over_square,
            terms: 1,
            stride: 1,
            last: KNOTS - 1,
            whole: vec![1.0],
            knee,
            knots_per_radius: KNOTS as f64 / (end - knee),
            beyond,
            end,
            end_squared: end * end,
            squeeze: 1.0,
        }
    }

    /// From the light within even steps of the squared radius over that square, `terms` cosines a knot; the first of
    /// the last knot is all the light.
    pub(super) fn of_table(
        end: f64,
        squeeze: f64,
        terms: usize,
        mut over_square: Vec<f64>,
    ) -> Self {
        let knots = over_square.len() / terms - 1;
        let square = end * end;
        let all = over_square[knots * terms] * square;
        for value in &mut over_square {
            *value /= all;
        }
        let light = |knot: usize| over_square[knot * terms] * square * knot as f64 / knots as f64;
        let middle = (0..=knots).find(|&knot| light(knot) >= 0.5);
        let middle = middle.unwrap_or(knots).max(1);
        let (low, high) = (light(middle - 1), light(middle));
        let at = (middle - 1) as f64 + (0.5 - low) / (high - low);
        let whole = over_square[knots * terms..].iter().map(|v| v * square);
        Self {
            half: (at / knots as f64).sqrt() * end,
            whole: whole.collect(),
            knee_squared: square,
            knots_per_square: knots as f64 / square,
            stride: if terms == 1 { 1 } else { terms.max(4) },
            last: knots - 1,
            over_square: if (2..=4).contains(&terms) {
                over_square.chunks(terms).flat_map(powers).collect()
            } else {
                over_square
            },
            terms,
            knee: end,
            knots_per_radius: 1.0,
            beyond: Vec::new(),
            end,
            end_squared: square,
            squeeze,
        }
    }

    /// Light within a radius over the radius squared, up to the knee; `cosine` is that of twice the angle.
    fn over_square(&self, squared: f64, cosine: f64) -> f64 {
        let at = squared * self.knots_per_square;
        let knot = (at as usize).min(self.last);
        let part = at - knot as f64;
        if self.terms == 1 {
            let (low, high) = (self.over_square[knot], self.over_square[knot + 1]);
            return low + (high - low) * part;
        }
        let pair = &self.over_square[knot * self.stride..(knot + 2) * self.stride];
        let (low, high) = pair.split_at(self.stride);
        if let (&[a, b, c, d], &[p, q, r, s]) = (low, high) {
            let [a, b, c, d] = [(a, p), (b, q), (c, r), (d, s)].map(|(l, h)| l + (h - l) * part);
            return a + cosine * (b + cosine * (c + cosine * d));
        }
        // Clenshaw 1955
        let (mut one, mut two) = (0.0, 0.0);
        for (a, b) in low.iter().zip(high).skip(1).rev() {
            (one, two) = (a + (b - a) * part + 2.0 * cosine * one - two, one);
        }
        low[0] + (high[0] - low[0]) * part + cosine * one - two
    }

    /// Light within a radius, beyond the knee.
    fn beyond(&self, radius: f64) -> f64 {
        let at = (radius - self.knee) * self.knots_per_radius;
        let knot = (at as usize).min(KNOTS - 1);
        let (low, high) = (self.beyond[knot], self.beyond[knot + 1]);
        low + (high - low) * (at - knot as f64)
    }

    /// The part of the cone's light in a convex polygon, given around the middle of the cone; its first coordinate
    /// multiplied by [`squeeze`](Self::squeeze).
    ///
    /// Green's theorem: over each edge ∫ C(ρ, φ) dφ / 2π, with C the light within ρ (for a disc the classic sum of
    /// triangles and sectors).
    pub(super) fn within(&self, polygon: &[[f64; 2]]) -> f64 {
        let mut inside = true;
        let mut edges = [Edge::default(); 8];
        let mut orientation = 0.0;
        let count = polygon.len().min(8);
        for (k, edge) in edges.iter_mut().enumerate().take(count) {
            let (p, q) = (polygon[k], polygon[(k + 1) % count]);
            orientation += p[0] * q[1] - p[1] * q[0];
            *edge = Edge::new(p, q);
        }
        if orientation == 0.0 {
            return 0.0;
        }
        let edges = edges[..count].iter().filter(|edge| edge.to > edge.from);
        for edge in edges.clone() {
            // counterclockwise
            let side = edge.side.copysign(edge.side * orientation);
            if side <= -self.end {
                return 0.0;
            }
            inside &= side >= self.end;
        }
        if inside {
            return 1.0;
        }
        let sum: f64 = edges.map(|edge| self.along(edge)).sum();
        (sum.copysign(sum * orientation) / TAU).clamp(0.0, 1.0)
    }

    /// ∫ C dφ over an edge.
    fn along(&self, edge: &Edge) -> f64 {
        let height = edge.side.abs();
        if height == 0.0 || edge.to <= edge.from {
            return 0.0;
        }
        let height_squared = height * height;
        let mut sum = 0.0;
        // where the edge leaves the table
        let mut inner = 0.0;
        if height_squared < self.knee_squared {
            inner = (self.knee_squared - height_squared).sqrt();
            let (from, to) = (edge.from.max(-inner), edge.to.min(inner));
            // dφ = height dt / ρ², and C / ρ² is smooth
            let light = |t: f64| {
                let squared = height_squared + t * t;
                let cosine = if self.terms == 1 {
                    0.0
                } else {
                    let [x, y] = edge.at(t);
                    (x * x - y * y) / squared
                };
                self.over_square(squared, cosine)
            };
            for pair in CUTS.windows(2) {
                let (from, to) = (from.max(pair[0] * self.half), to.min(pair[1] * self.half));
                if from < to {
                    sum += height * gauss(from, to, light);
                }
            }
        }
        let mut outer = inner;
        if !self.beyond.is_empty() && height_squared < self.end_squared {
            outer = (self.end_squared - height_squared).sqrt();
            let light = |angle: f64| {
                let radius = height / libm::cos(angle);
                self.beyond(radius.clamp(self.knee, self.end))
            };
            for (from, to) in edge.outside(inner) {
                let (from, to) = (from.max(-outer), to.min(outer));
                if from < to {
                    sum += gauss(libm::atan2(from, height), libm::atan2(to, height), light);
                }
            }
        }
        for (from, to) in edge.outside(outer) {
            if from < to {
                sum += libm::atan2(to, height) - libm::atan2(from, height);
                if self.terms > 1 {
                    let turned = self.turned(edge.at(to)) - self.turned(edge.at(from));
                    sum += turned.copysign(turned * edge.side);
                }
            }
        }
        sum.copysign(sum * edge.side)
    }

    /// ∫ of the whole light over the angle, less the angle itself.
    fn turned(&self, [x, y]: [f64; 2]) -> f64 {
        let squared = x * x + y * y;
        let (cosine, sine) = ((x * x - y * y) / squared, 2.0 * x * y / squared);
        // sin 2mφ from the two before
        let (mut before, mut now, mut sum) = (0.0, sine, 0.0);
        for (m, whole) in self.whole.iter().enumerate().skip(1) {
            sum += whole * now / (2 * m) as f64;
            (before, now) = (now, 2.0 * cosine * now - before);
        }
        sum
    }
}

/// Of up to four cosines of multiples of an angle, the powers of its cosine.
fn powers(of: &[f64]) -> [f64; 4] {
    let mut all = [0.0; 4];
    all[..of.len()].copy_from_slice(of);
    let [a, b, c, d] = all;
    [a - c, b - 3.0 * d, 2.0 * c, 4.0 * d]
}

/// A directed edge of an outline: how far from the middle of the cone it passes (positive if that lies to its left),
/// and where it begins and ends, from its foot.
#[derive(Clone, Copy, Default)]
struct Edge {
    side: f64,
    from: f64,
    to: f64,
    foot: [f64; 2],
    along: [f64; 2],
}

impl Edge {
    fn new(p: [f64; 2], q: [f64; 2]) -> Self {
        let along = [q[0] - p[0], q[1] - p[1]];
        let squared = along[0] * along[0] + along[1] * along[1];
        if squared == 0.0 {
            return Self::default();
        }
        let inverse = 1.0 / squared.sqrt();
        let along = [along[0] * inverse, along[1] * inverse];
        let side = p[0] * along[1] - p[1] * along[0];
        Self {
            side,
            from: p[0] * along[0] + p[1] * along[1],
            to: q[0] * along[0] + q[1] * along[1],
            foot: [side * along[1], -side * along[0]],
            along,
        }
    }

    fn at(&self, t: f64) -> [f64; 2] {
        [0, 1].map(|k| self.foot[k] + t * self.along[k])
    }

    /// Its parts farther than `inner` from its foot.
    fn outside(&self, inner: f64) -> [(f64, f64); 2] {
        [
            (self.from, self.to.min(-inner)),
            (self.from.max(inner), self.to),
        ]
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

/// Where an edge is cut for that rule, as parts of the radius that half of the light is in: light over squared radius
/// is a bell of that width.
const CUTS: [f64; 7] = [f64::NEG_INFINITY, -3.5, -1.4, 0.0, 1.4, 3.5, f64::INFINITY];

#[cfg(test)]
mod tests {
    use super::super::cone::Cones;
    use super::*;
    use crate::optics::OpticalError;
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
            let error = OpticalError::new(0.0, *sigma).unwrap();
            let cones = Cones::new(sun, &error, core::iter::once(1.0));
            let radial = cones.of(1.0).unwrap();
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
        let radial = Radial::of_sun(&SunShape::pillbox(4.65e-3).unwrap());
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
}
