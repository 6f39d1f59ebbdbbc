//! What the tests of this crate share. Nothing here calls the crate's own geometry.
#![allow(dead_code)]

use helio_flux::{Element, FluxMap, OpticalError, Plane, Receiver, Scene, SunShape};

pub type V = [f64; 3];

pub fn dot(a: V, b: V) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

pub fn combine(a: V, x: f64, b: V) -> V {
    [a[0] + x * b[0], a[1] + x * b[1], a[2] + x * b[2]]
}

pub fn cross(a: V, b: V) -> V {
    [
        a[1] * b[2] - a[2] * b[1],
        a[2] * b[0] - a[0] * b[2],
        a[0] * b[1] - a[1] * b[0],
    ]
}

pub fn unit(a: V) -> V {
    a.map(|x| x / dot(a, a).sqrt())
}

/// A rectangle about a point, by its two half edges.
pub fn rectangle(centre: V, half_a: V, half_b: V) -> Element {
    let corner = |x: f64, y: f64| combine(combine(centre, x, half_a), y, half_b);
    Element::quadrilateral([
        corner(-1.0, -1.0),
        corner(1.0, -1.0),
        corner(1.0, 1.0),
        corner(-1.0, 1.0),
    ])
    .unwrap()
}

/// A flat mirror of 7 m by 6 m in the origin, facing along z.
pub fn facet() -> Element {
    rectangle([0.0; 3], [3.5, 0.0, 0.0], [0.0, 3.0, 0.0])
}

/// A screen of 15 m by 15 m that faces down to the origin from 100 m above.
pub fn screen(bins: usize) -> Receiver {
    let down = [0.0, 0.0, -1.0];
    let size = [15.0, 15.0];
    Receiver::Plane(
        Plane::new([0.0, 0.0, 100.0], down, [1.0, 0.0, 0.0], size, [bins, bins]).unwrap(),
    )
}

/// Mirrors without errors under a sun of 1000 W/m² overhead.
pub fn scene<'a>(
    elements: &'a [Element],
    receiver: &'a Receiver,
    sun_shape: &'a SunShape,
) -> Scene<'a> {
    Scene {
        elements,
        receiver,
        sun: [0.0, 0.0, 1.0],
        dni_w_m2: 1000.0,
        sun_shape,
        optical_error: OpticalError::NONE,
    }
}

/// Root mean square of the differences, over the greatest of the second.
pub fn relative_rms(got: &[f64], want: &[f64]) -> f64 {
    assert_eq!(got.len(), want.len());
    let sum: f64 = got.iter().zip(want).map(|(g, w)| (g - w) * (g - w)).sum();
    (sum / got.len() as f64).sqrt() / want.iter().copied().fold(0.0, f64::max)
}

/// Slope of a straight line through logarithms: the rate at which errors fall.
pub fn rate(counts: &[f64], errors: &[f64]) -> f64 {
    let n = counts.len() as f64;
    let x: Vec<f64> = counts.iter().map(|c| c.ln()).collect();
    let y: Vec<f64> = errors.iter().map(|e| e.ln()).collect();
    let (mx, my) = (x.iter().sum::<f64>() / n, y.iter().sum::<f64>() / n);
    let xy: f64 = x.iter().zip(&y).map(|(x, y)| (x - mx) * (y - my)).sum();
    let xx: f64 = x.iter().map(|x| (x - mx) * (x - mx)).sum();
    xy / xx
}

/// The middle of the light on a plane \[m\], right and down of its centre.
pub fn centroid_m(map: &FluxMap, size_m: [f64; 2]) -> [f64; 2] {
    let (mut sum, mut right, mut down) = (0.0, 0.0, 0.0);
    for row in 0..map.rows() {
        for (column, &flux) in map.row_w_m2(row).iter().enumerate() {
            sum += flux;
            right += flux * ((column as f64 + 0.5) / map.columns() as f64 - 0.5) * size_m[0];
            down += flux * ((row as f64 + 0.5) / map.rows() as f64 - 0.5) * size_m[1];
        }
    }
    [right / sum, down / sum]
}

/// Area that a circle of radius `r` about (x, y) has in common with the rectangle |x| <= a, |y| <= b:
/// the sum over its corners of the area of a quarter plane.
pub fn circle_in_rectangle(x: f64, y: f64, r: f64, a: f64, b: f64) -> f64 {
    // Area of the circle about the origin where x' <= p and y' <= q.
    let half_plane = |p: f64| {
        let p = p.clamp(-r, r);
        r * r * (p / r).asin() + p * (r * r - p * p).sqrt() + 0.5 * std::f64::consts::PI * r * r
    };
    // ∫ √(r² - t²) dt from 0
    let arc = |t: f64| {
        0.5 * (t * (r * r - t * t).max(0.0).sqrt() + r * r * (t / r).clamp(-1.0, 1.0).asin())
    };
    let quarter = |p: f64, q: f64| -> f64 {
        let p = p.min(r);
        if p <= -r || q <= -r {
            return 0.0;
        }
        if q >= r {
            return half_plane(p);
        }
        // ∫ from -r to p of min(q, √) + √ where q > -√, that is: the strip below y' = q.
        let edge = (r * r - q * q).sqrt();
        let piece = |from: f64, to: f64, inside: bool| -> f64 {
            let to = to.min(p);
            if to <= from {
                return 0.0;
            }
            let arcs = arc(to) - arc(from);
            if inside {
                q * (to - from) + arcs
            } else if q > 0.0 {
                2.0 * arcs
            } else {
                0.0
            }
        };
        piece(-r, -edge, false) + piece(-edge, edge, true) + piece(edge, r, false)
    };
    quarter(a - x, b - y) - quarter(-a - x, b - y) - quarter(a - x, -b - y)
        + quarter(-a - x, -b - y)
}

/// Random numbers of the tests' own tracer (PCG32, O'Neill 2014), other than the crate's sequence.
pub struct Pcg(pub u64);

impl Pcg {
    pub fn uniform(&mut self) -> f64 {
        let mut word = || {
            let old = self.0;
            self.0 = old
                .wrapping_mul(6_364_136_223_846_793_005)
                .wrapping_add(1_442_695_040_888_963_407);
            let shifted = (((old >> 18) ^ old) >> 27) as u32;
            u64::from(shifted.rotate_right((old >> 59) as u32))
        };
        let bits = (word() << 21) ^ word();
        (bits & ((1 << 53) - 1)) as f64 / (1_u64 << 53) as f64
    }

    pub fn normal(&mut self) -> [f64; 2] {
        let radius = (-2.0 * (1.0 - self.uniform()).ln()).sqrt();
        let (sin, cos) = (std::f64::consts::TAU * self.uniform()).sin_cos();
        [radius * cos, radius * sin]
    }
}

/// A tracer of the tests' own: one random ray after another, doubles, the normal turned exactly and the ray
/// reflected in it. `corner`, `edge_a`, `edge_b` are a parallelogram; `hit` gives the bin of a ray.
pub struct BruteForce {
    pub sun: V,
    pub half_angle: f64,
    pub slope: f64,
    pub specularity: f64,
}

impl BruteForce {
    /// Rays in every bin, and those that missed.
    pub fn trace(
        &self,
        [corner, edge_a, edge_b]: [V; 3],
        rays: usize,
        bins: usize,
        hit: impl Fn(V, V) -> Option<usize>,
        random: &mut Pcg,
    ) -> (Vec<u64>, u64) {
        let (mut counts, mut missed) = (vec![0; bins], 0);
        let normal = unit(cross(edge_a, edge_b));
        let sideways = |axis: V| {
            let helper = if axis[0].abs() < 0.6 {
                [1.0, 0.0, 0.0]
            } else {
                [0.0, 1.0, 0.0]
            };
            let x = unit(cross(helper, axis));
            [x, cross(axis, x)]
        };
        let (sun_x, sun_y) = (sideways(self.sun)[0], sideways(self.sun)[1]);
        let [n_x, n_y] = sideways(normal);
        for _ in 0..rays {
            let (u, v) = (random.uniform(), random.uniform());
            let origin = combine(combine(corner, u, edge_a), v, edge_b);
            // uniform over the solid angle of the disc
            let cos = 1.0 - random.uniform() * (1.0 - self.half_angle.cos());
            let sin = (1.0 - cos * cos).sqrt();
            let (s, c) = (std::f64::consts::TAU * random.uniform()).sin_cos();
            let from = combine(
                combine(self.sun.map(|x| cos * x), sin * c, sun_x),
                sin * s,
                sun_y,
            );
            let [gx, gy] = random.normal().map(|g| self.slope * g);
            let turned = unit(combine(combine(normal, gx, n_x), gy, n_y));
            let out = combine(from.map(|x| -x), 2.0 * dot(from, turned), turned);
            let [ox, oy] = sideways(out);
            let [px, py] = random.normal().map(|g| self.specularity * g);
            let out = combine(combine(out, px, ox), py, oy);
            match hit(origin, out) {
                Some(bin) => counts[bin] += 1,
                None => missed += 1,
            }
        }
        (counts, missed)
    }
}
