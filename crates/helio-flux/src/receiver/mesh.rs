//! A receiver of triangles.

use super::{Hit, check_point};
use crate::bvh::{Aabb, Bvh};
use crate::element::Element;
use crate::error::FluxError;
use crate::vector::{Vector, add, cross, dot, norm, scale, sub};

/// A receiver of any shape: triangles, each a bin, lit on the side from which their corners run
/// counterclockwise.
///
/// ```
/// use helio_flux::{MeshReceiver, Receiver};
/// let corners_m = [[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];
/// let receiver = Receiver::Mesh(MeshReceiver::new(&[corners_m])?);
/// assert_eq!((receiver.bins(), receiver.area_m2()), (1, 0.5));
/// assert!(receiver.hit([0.2, 0.2, 9.0], [0.0, 0.0, -1.0]).is_some());
/// assert!(receiver.hit([0.6, 0.6, 9.0], [0.0, 0.0, -1.0]).is_none());
/// # Ok::<(), helio_flux::FluxError>(())
/// ```
#[derive(Debug, Clone, PartialEq)]
pub struct MeshReceiver {
    triangles: Vec<Element>,
    tree: Bvh,
    bounds: Aabb,
    /// From the middle of its bounds to its farthest corner.
    radius_m: f64,
    /// The plane that all corners lie in: its normal and a point.
    flat: Option<(Vector, Vector)>,
}

/// Corners within this part of a mesh's radius of one plane are in it: files round their numbers.
const FLAT: f64 = 1e-6;

impl MeshReceiver {
    /// A receiver of at least one triangle.
    ///
    /// # Errors
    /// [`FluxError::NoTriangles`] if there is none, [`FluxError::BadTriangle`] for one without an area or with
    /// a corner that is not finite.
    pub fn new(triangles_m: &[[[f64; 3]; 3]]) -> Result<Self, FluxError> {
        if triangles_m.is_empty() {
            return Err(FluxError::NoTriangles);
        }
        let mut triangles = Vec::with_capacity(triangles_m.len());
        for (row, &corners_m) in triangles_m.iter().enumerate() {
            let why = |why| FluxError::BadTriangle {
                row,
                why: Box::new(why),
            };
            for corner_m in corners_m {
                check_point("mesh receiver", "corner", corner_m).map_err(why)?;
            }
            triangles.push(Element::triangle(corners_m).map_err(why)?);
        }
        let boxes: Vec<_> = triangles_m.iter().map(|t| Aabb::around(t)).collect();
        let bounds = Aabb::around(&triangles_m.concat());
        let corners = || triangles_m.iter().flatten();
        let from_middle = |corner: &Vector| sub(*corner, bounds.middle());
        let radius_m = corners().fold(0.0_f64, |most, c| most.max(norm(from_middle(c))));
        // the plane of the greatest triangle, which rounding turns least
        let greatest = triangles
            .iter()
            .max_by(|a, b| a.area_m2().total_cmp(&b.area_m2()));
        let flat = greatest.and_then(|greatest| {
            let (normal, point) = (greatest.normal(), greatest.centroid_m());
            corners()
                .all(|c| dot(sub(*c, point), normal).abs() <= FLAT * radius_m)
                .then_some((normal, point))
        });
        Ok(Self {
            tree: Bvh::new(&boxes),
            triangles,
            bounds,
            radius_m,
            flat,
        })
    }

    /// Number of triangles.
    #[must_use]
    pub fn triangles(&self) -> usize {
        self.triangles.len()
    }

    /// Area of all \[m²\].
    #[must_use]
    pub fn area_m2(&self) -> f64 {
        self.triangles.iter().map(Element::area_m2).sum()
    }

    /// The corners of a triangle \[m\].
    #[must_use]
    pub fn corners_m(&self, triangle: usize) -> Option<&[[f64; 3]]> {
        self.triangles.get(triangle).map(Element::corners_m)
    }

    pub(crate) fn outer_radius_m(&self) -> f64 {
        self.radius_m
    }

    /// The plane that all of it lies in, if there is one: its normal and a point.
    pub(super) const fn plane(&self) -> Option<(Vector, Vector)> {
        self.flat
    }

    /// How far it reaches at most from its middle along a unit vector \[m\].
    pub(super) fn half_extent_m(&self, along: Vector) -> f64 {
        let half_m = scale(sub(self.bounds.high, self.bounds.low), 0.5);
        dot(along.map(f64::abs), half_m).min(self.radius_m)
    }

    pub(crate) fn centre_m(&self) -> Vector {
        self.bounds.middle()
    }

    pub(crate) fn area_of_m2(&self, triangle: usize) -> f64 {
        self.triangles[triangle].area_m2()
    }

    pub(crate) fn centroid_m(&self, triangle: usize) -> Vector {
        self.triangles[triangle].centroid_m()
    }

    pub(crate) fn normal(&self, triangle: usize) -> Vector {
        self.triangles[triangle].normal()
    }

    pub(crate) fn hit(&self, origin_m: Vector, direction: Vector) -> Option<Hit> {
        let (along, bin) = self.nearest(origin_m, direction, 1.0)?;
        Some(Hit {
            bin,
            point_m: add(origin_m, scale(direction, along)),
            along,
        })
    }

    /// Where a ray meets the first of the triangles whose back it comes to, in lengths of its direction.
    pub(super) fn back(&self, origin_m: Vector, direction: Vector) -> Option<f64> {
        self.nearest(origin_m, direction, -1.0).map(|found| found.0)
    }

    /// The nearest triangle that a ray meets on its lit side (`side` 1) or its back (-1), and how far along.
    fn nearest(&self, origin_m: Vector, direction: Vector, side: f64) -> Option<(f64, usize)> {
        let inverse = direction.map(|x| 1.0 / x);
        let nearest = core::cell::Cell::new((f64::INFINITY, usize::MAX));
        self.tree.visit(
            |bounds| bounds.is_met(origin_m, inverse, 0.0, nearest.get().0),
            |k| {
                let triangle = &self.triangles[k];
                if let Some(along) = meets(triangle.corners_m(), origin_m, direction)
                    && side * dot(direction, triangle.normal()) < 0.0
                    && (along, k) < nearest.get()
                {
                    nearest.set((along, k));
                }
            },
        );
        let (along, bin) = nearest.get();
        (bin < self.triangles.len()).then_some((along, bin))
    }
}

/// Where a ray meets a triangle, ahead of its origin, in lengths of its direction (Möller and Trumbore 1997).
pub(crate) fn meets(corners_m: &[Vector], origin_m: Vector, direction: Vector) -> Option<f64> {
    let (ab, ac) = (
        sub(corners_m[1], corners_m[0]),
        sub(corners_m[2], corners_m[0]),
    );
    let p = cross(direction, ac);
    let determinant = dot(ab, p);
    let inverse = 1.0 / determinant;
    let from = sub(origin_m, corners_m[0]);
    let u = dot(from, p) * inverse;
    let q = cross(from, ab);
    let v = dot(direction, q) * inverse;
    let along = dot(ac, q) * inverse;
    // no number (a ray in the plane) fails all of these
    (u >= 0.0 && v >= 0.0 && u + v <= 1.0 && along > 0.0 && along.is_finite()).then_some(along)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Frustum, Receiver};

    // The nearest of many triangles against all of them one by one; a sphere of triangles against its radius.
    #[test]
    fn the_first_triangle_is_met() {
        let mut triangles = Vec::new();
        let at = |i: usize, j: usize| {
            let (s, c) = libm::sincos(i as f64 * core::f64::consts::PI / 20.0);
            let (sj, cj) = libm::sincos(j as f64 * core::f64::consts::TAU / 40.0);
            [s * cj, s * sj, c]
        };
        for i in 0..20 {
            for j in 0..40 {
                let [a, b, c, d] = [at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)];
                for triangle in [[a, b, c], [a, c, d]] {
                    if Element::triangle(triangle).is_ok() {
                        triangles.push(triangle);
                    }
                }
            }
        }
        let mesh = MeshReceiver::new(&triangles).unwrap();
        for k in 0..500 {
            let part = |n| crate::sampling::part(crate::sampling::hash(k, n));
            let direction = [part(1) - 0.5, part(2) - 0.5, part(3) - 0.5];
            let origin = scale(direction, -9.0 / norm(direction));
            let origin = add(origin, [0.0, 0.5 * part(4), 0.0]);
            let hit = mesh.hit(origin, direction);
            let one_by_one = triangles
                .iter()
                .filter_map(|t| meets(t, origin, direction))
                .fold(f64::INFINITY, f64::min);
            assert_eq!(hit.map_or(f64::INFINITY, |hit| hit.along), one_by_one);
            if let Some(hit) = hit {
                let radius = norm(hit.point_m);
                assert!((0.985..=1.0 + 1e-12).contains(&radius), "{radius}");
            }
        }
    }

    #[test]
    fn bad_triangles_are_named() {
        assert_eq!(MeshReceiver::new(&[]).unwrap_err(), FluxError::NoTriangles);
        let good = [[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];
        let error = MeshReceiver::new(&[good, [[1.0; 3]; 3]]).unwrap_err();
        let text = error.to_string();
        assert!(
            text.starts_with("mesh receiver: triangle 1 (counted from 0): element:"),
            "{text}"
        );
        let far = [[0.0; 3], [f64::INFINITY, 0.0, 0.0], [0.0, 1.0, 0.0]];
        assert!(MeshReceiver::new(&[far]).is_err());
        let frustum =
            Frustum::cylinder([0.0; 3], [0.0, 0.0, 1.0], [0.0, 0.0, 2.0], 1.0, 1.0, [1, 1]);
        assert!(frustum.is_err());
        let _ = Receiver::Mesh(MeshReceiver::new(&[good]).unwrap());
    }
}
