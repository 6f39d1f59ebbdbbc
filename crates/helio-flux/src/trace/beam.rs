//! An element made ready for rays: where they start, and how they leave it.

use super::kernel::Beam;
use super::rayset::Lap;
use crate::element::Element;
use crate::receiver::Plane;
use crate::vector::{Vector, add, cross, dot, norm, scale, sub};

/// Where on an element rays start.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
#[non_exhaustive]
pub enum Origins {
    /// Evenly all over it: the image of a flat piece is exact.
    #[default]
    Spread,
    /// All at its centroid, as Yan 2022 §2.3 has it: right in the limit of small elements.
    Centroid,
}

/// A parallelogram or a triangle of an element, flat in its plane.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Piece {
    pub corner: Vector,
    pub edge_a: Vector,
    pub edge_b: Vector,
    pub normal: Vector,
    pub is_triangle: bool,
    /// Part of the element's area.
    pub share: f64,
}

/// Corners of a parallelogram close to within this part of their distances.
const PARALLEL: f64 = 1e-9;

/// The pieces of an element: one, or two for a quadrilateral that is no parallelogram.
pub(crate) fn pieces(element: &Element, origins: Origins) -> Vec<Piece> {
    let normal = element.normal();
    let centroid = element.centroid_m();
    let piece = |corner, edge_a, edge_b, is_triangle, share| Piece {
        corner,
        edge_a,
        edge_b,
        normal,
        is_triangle,
        share,
    };
    if origins == Origins::Centroid {
        return vec![piece(centroid, [0.0; 3], [0.0; 3], false, 1.0)];
    }
    // The corners of a bent quadrilateral, moved into its plane: the vector area stays.
    let flat = |p: Vector| {
        let out = dot(sub(p, centroid), normal);
        sub(p, scale(normal, out))
    };
    let corners: Vec<Vector> = element.corners_m().iter().map(|&p| flat(p)).collect();
    match corners[..] {
        [a, b, c, d] => {
            let gap = sub(add(a, c), add(b, d));
            if norm(gap) <= PARALLEL * (norm(sub(c, a)) + norm(sub(d, b))) {
                return vec![piece(a, sub(b, a), sub(d, a), false, 1.0)];
            }
            let area = |a, b, c| 0.5 * dot(cross(sub(b, a), sub(c, a)), normal);
            // Along the diagonal that leaves both triangles the right way round.
            let one = [[a, b, c], [a, c, d]];
            let other = [[b, c, d], [b, d, a]];
            let areas = |[p, q]: [[Vector; 3]; 2]| [p, q].map(|[a, b, c]| area(a, b, c));
            let least = |cut| areas(cut)[0].min(areas(cut)[1]);
            let cut = if least(one) >= least(other) {
                one
            } else {
                other
            };
            let areas = areas(cut).map(|area| area.max(0.0));
            let all = areas[0] + areas[1];
            let triangle = |[a, b, c]: [Vector; 3], area: f64| {
                piece(a, sub(b, a), sub(c, a), true, area / all)
            };
            let both = [triangle(cut[0], areas[0]), triangle(cut[1], areas[1])];
            both.into_iter().filter(|p| p.share > 0.0).collect()
        }
        _ => {
            let (a, b, c) = (corners[0], corners[1], corners[2]);
            vec![piece(a, sub(b, a), sub(c, a), true, 1.0)]
        }
    }
}

/// Two unit vectors square to a unit vector and to each other.
pub(crate) fn across(axis: Vector) -> [Vector; 2] {
    // Duff et al. 2017, Building an orthonormal basis, revisited (JCGT 6(1))
    let [x, y, z] = axis;
    let sign = 1.0_f64.copysign(z);
    let a = -1.0 / (sign + z);
    let b = x * y * a;
    [
        [1.0 + sign * x * x * a, sign * b, -sign * x],
        [b, sign + y * y * a, -y],
    ]
}

/// The directions in which a piece reflects: `middle` + dx `along_x` + dy `along_y` + gx `slope_x` + gy `slope_y`,
/// dx and dy offsets of the sun from its middle, gx and gy slopes.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Cone {
    pub sun: Vector,
    pub sun_along: [Vector; 2],
    pub middle: Vector,
    pub along: [Vector; 2],
    pub slope: [Vector; 2],
}

impl Cone {
    /// `sun_across` are unit vectors square to the sun's.
    pub(crate) fn new(normal: Vector, sun: Vector, sun_across: [Vector; 2], lap: &Lap) -> Self {
        let reflect = |d: Vector| sub(scale(normal, 2.0 * dot(normal, d)), d);
        let turn = |[x, y]: [Vector; 2], [sin, cos]: [f64; 2]| {
            [
                add(scale(x, cos), scale(y, sin)),
                sub(scale(y, cos), scale(x, sin)),
            ]
        };
        let sun_across = turn(sun_across, lap.sun_turn);
        let on_mirror = turn(across(normal), lap.slope_turn);
        // The normal turned by g: r = 2 (n·s) n - s changes by 2 ((s·n) g + (s·g) n), to first order.
        let slope = |g: Vector| {
            let (along_g, along_n) = (2.0 * dot(sun, normal), 2.0 * dot(sun, g));
            add(scale(g, along_g), scale(normal, along_n))
        };
        Self {
            sun,
            sun_along: sun_across,
            middle: reflect(sun),
            along: sun_across.map(reflect),
            slope: on_mirror.map(slope),
        }
    }
}

/// What the fast kernel wants for a plane; `None` if a ray may start behind it or run along it.
///
/// `reach` is how far rays stray: offsets of the sun, and slopes.
pub(crate) fn onto_plane(
    plane: &Plane,
    piece: &Piece,
    cone: &Cone,
    lap: &Lap,
    reach: [f64; 2],
) -> Option<Beam> {
    let out = plane.normal();
    let middle_w = dot(cone.middle, out);
    let stray = |pair: [Vector; 2]| libm::hypot(dot(pair[0], out), dot(pair[1], out));
    let most = reach[0] * stray(cone.along) + reach[1] * stray(cone.slope);
    // Half as much again: singles round, and a ray that hardly descends would land anywhere.
    if middle_w >= -1.5 * most {
        return None;
    }
    let from_centre = |p: Vector| sub(p, plane.centre_m());
    let corner = from_centre(piece.corner);
    let height = dot(corner, out);
    let (rise_a, rise_b) = (dot(piece.edge_a, out), dot(piece.edge_b, out));
    if !(height > 0.0
        && height + rise_a > 0.0
        && height + rise_b > 0.0
        && height + rise_a + rise_b > 0.0)
    {
        return None;
    }
    let [bin_u, bin_v] = plane.bin_m();
    let lean_u = dot(cone.middle, plane.right()) / middle_w;
    let lean_v = dot(cone.middle, plane.down()) / middle_w;
    let sheared = |p: Vector| {
        let w = dot(p, out);
        [
            (dot(p, plane.right()) - w * lean_u) / bin_u,
            (dot(p, plane.down()) - w * lean_v) / bin_v,
            w,
        ]
    };
    let single = |p: Vector| p.map(|x| x as f32);
    let mut corner = sheared(corner);
    corner[0] += 0.5 * plane.columns() as f64 + 1.0;
    corner[1] += 0.5 * plane.rows() as f64 + 1.0;
    Some(Beam {
        corner: single(corner),
        edge_a: single(sheared(piece.edge_a)),
        edge_b: single(sheared(piece.edge_b)),
        shift: lap.shift.map(|x| x as f32),
        middle_w: middle_w as f32,
        along: cone.along.map(|p| single(sheared(p))),
        slope: cone.slope.map(|p| single(sheared(p))),
    })
}
