//! A mirror as the points of the receiver see it.

use super::radial::Radial;
use crate::element::Element;
use crate::receiver::Receiver;
use crate::trace::across;
use crate::vector::{Vector, add, dot, norm, scale, sub};

/// A place on the receiver, and the way it faces.
pub(super) struct Point {
    pub at: Vector,
    pub normal: Vector,
}

/// The point of a bin at parts of its row and column (of a triangle: of its area), each within 0..=1.
pub(super) fn point_of(receiver: &Receiver, bin: usize, v: f64, u: f64) -> Point {
    let (row, column) = (bin / receiver.columns(), bin % receiver.columns());
    let (row, column) = (row as f64, column as f64);
    match receiver {
        Receiver::Plane(plane) => Point {
            at: plane.point_m(row + v, column + u),
            normal: receiver.bin_normal(bin),
        },
        Receiver::Frustum(round) => Point {
            at: round.point_m(row + v, column + u),
            normal: round.normal(column + u),
        },
        Receiver::Mesh(mesh) => {
            let corners = mesh.corners_m(bin).unwrap_or_default();
            // even over a triangle (Osada et al. 2002)
            let root = v.sqrt();
            let parts = [1.0 - root, root * (1.0 - u), root * u];
            let mut at = [0.0; 3];
            for (corner, part) in corners.iter().zip(parts) {
                at = add(at, scale(*corner, part));
            }
            Point {
                at,
                normal: receiver.bin_normal(bin),
            }
        }
    }
}

/// An element as the receiver sees it: its corners in axes across and along the middle ray.
pub(super) struct Outline {
    axes: [Vector; 3],
    corners: [Vector; 4],
    count: usize,
    middle: Vector,
    radius_m: f64,
    /// Least width of the outline as the receiver sees it \[m\].
    narrow_m: f64,
    pub step: usize,
    strength: f64,
    normal: Vector,
    centroid: Vector,
}

impl Outline {
    pub(super) fn new(element: &Element, sun: Vector, step: usize, strength: f64) -> Self {
        let normal = element.normal();
        let along = sub(scale(normal, 2.0 * dot(normal, sun)), sun);
        let [x, y] = across(along);
        let axes = [x, y, along];
        let local = |p: Vector| axes.map(|axis| dot(axis, p));
        let centroid = element.centroid_m();
        // a bent quadrilateral, moved into its plane
        let flat = |p: Vector| sub(p, scale(normal, dot(sub(p, centroid), normal)));
        let mut corners = [[0.0; 3]; 4];
        let mut radius_m = 0.0_f64;
        for (to, &from) in corners.iter_mut().zip(element.corners_m()) {
            *to = local(flat(from));
            radius_m = radius_m.max(norm(sub(from, centroid)));
        }
        let count = element.corners_m().len();
        Self {
            axes,
            corners,
            narrow_m: narrowest(&corners[..count]),
            count,
            middle: local(centroid),
            radius_m,
            step,
            strength,
            normal,
            centroid,
        }
    }

    /// Irradiance at a point of the receiver \[W/m²\].
    pub(super) fn flux_at(&self, point: &Point, cone: &Radial) -> f64 {
        let facing = -dot(point.normal, self.axes[2]);
        if facing <= 0.0 || dot(sub(point.at, self.centroid), self.normal) <= 0.0 {
            return 0.0;
        }
        let [x, y, z] = self.axes.map(|axis| dot(axis, point.at));
        // far from the middle ray nothing of the sun shows
        let (dx, dy, far) = (self.middle[0] - x, self.middle[1] - y, z - self.middle[2]);
        let reach = self.radius_m + cone.end * (far + self.radius_m);
        if far <= 0.0 || dx * dx + dy * dy > reach * reach {
            return 0.0;
        }
        let mut seen = [[0.0; 2]; 4];
        for (to, corner) in seen.iter_mut().zip(&self.corners[..self.count]) {
            let distance = z - corner[2];
            if distance <= 0.0 {
                return 0.0;
            }
            let inverse = 1.0 / distance;
            *to = [(corner[0] - x) * inverse, (corner[1] - y) * inverse];
        }
        self.strength * facing * cone.within(&seen[..self.count])
    }

    /// Whether the light of the outline can reach a ball, and how far along its middle ray the ball begins \[m\].
    pub(super) fn reaches(&self, ball: &Ball, cone: &Radial) -> Option<f64> {
        let [x, y, z] = self.axes.map(|axis| dot(axis, ball.centre));
        let (dx, dy, far) = (self.middle[0] - x, self.middle[1] - y, z - self.middle[2]);
        let end = far + ball.radius_m;
        let reach = ball.radius_m + self.radius_m + cone.end * (end + self.radius_m);
        (end > 0.0 && dx * dx + dy * dy <= reach * reach).then_some(far - ball.radius_m)
    }

    /// Width of the image at a distance \[m\]: of the mirror, or of the disc that half of the sun's light is in.
    pub(super) fn width_m(&self, far_m: f64, cone: &Radial) -> f64 {
        self.narrow_m.max(2.0 * cone.half * far_m.max(0.0))
    }
}

/// A ball around a part of the receiver.
pub(super) struct Ball {
    pub centre: Vector,
    pub radius_m: f64,
}

/// Least width of a convex polygon across the third axis, square to one of its sides.
fn narrowest(corners: &[Vector]) -> f64 {
    let mut least = f64::INFINITY;
    for (k, p) in corners.iter().enumerate() {
        let q = corners[(k + 1) % corners.len()];
        let (x, y) = (q[0] - p[0], q[1] - p[1]);
        let length = x.hypot(y);
        if length > 0.0 {
            let away = |r: &Vector| ((r[1] - p[1]) * x - (r[0] - p[0]) * y).abs() / length;
            least = least.min(corners.iter().map(away).fold(0.0, f64::max));
        }
    }
    if least.is_finite() { least } else { 0.0 }
}
