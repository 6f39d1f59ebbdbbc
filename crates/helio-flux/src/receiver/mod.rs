//! What the light falls on: its shape, its grid of bins, and where a ray meets it.

mod frustum;
mod mesh;
mod numbers;
mod plane;

pub use frustum::Frustum;
pub use mesh::MeshReceiver;
pub use plane::Plane;

use crate::error::FluxError;
use crate::vector::{dot, norm, sub, unit};

/// Most bins of a grid: its whole numbers are counted in singles, which are exact up to 2²⁴.
const MAX_BINS: usize = 1 << 23;

/// Where a ray meets a receiver.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Hit {
    /// The bin, row by row from the first.
    pub bin: usize,
    /// The point \[m\].
    pub point_m: [f64; 3],
    /// How far along the ray, in lengths of its direction.
    pub along: f64,
}

/// A receiver: it is lit on one side, and light that comes to the other passes.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub enum Receiver {
    /// A rectangle.
    Plane(Plane),
    /// The outside of a cylinder or a cone.
    Frustum(Frustum),
    /// Triangles, each a bin.
    Mesh(MeshReceiver),
}

impl Receiver {
    /// Rows of the grid.
    #[must_use]
    pub fn rows(&self) -> usize {
        match self {
            Self::Plane(plane) => plane.rows(),
            Self::Frustum(frustum) => frustum.rows(),
            Self::Mesh(_) => 1,
        }
    }

    /// Columns of the grid; of a mesh, its triangles.
    #[must_use]
    pub fn columns(&self) -> usize {
        match self {
            Self::Plane(plane) => plane.columns(),
            Self::Frustum(frustum) => frustum.columns(),
            Self::Mesh(mesh) => mesh.triangles(),
        }
    }

    /// Rows times columns. Bins are counted row by row.
    #[must_use]
    pub fn bins(&self) -> usize {
        self.rows() * self.columns()
    }

    /// True area of a bin \[m²\].
    ///
    /// # Panics
    /// If there is no such bin.
    #[must_use]
    pub fn bin_area_m2(&self, bin: usize) -> f64 {
        assert!(bin < self.bins(), "no bin {bin}");
        match self {
            Self::Plane(plane) => plane.bin_area_m2(),
            Self::Frustum(frustum) => frustum.bin_area_m2(bin / frustum.columns()),
            Self::Mesh(mesh) => mesh.area_of_m2(bin),
        }
    }

    /// The middle of a bin \[m\].
    ///
    /// # Panics
    /// If there is no such bin.
    #[must_use]
    pub fn bin_centre_m(&self, bin: usize) -> [f64; 3] {
        assert!(bin < self.bins(), "no bin {bin}");
        let (row, column) = (bin / self.columns(), bin % self.columns());
        match self {
            Self::Plane(plane) => plane.point_m(row as f64 + 0.5, column as f64 + 0.5),
            Self::Frustum(frustum) => frustum.point_m(row as f64 + 0.5, column as f64 + 0.5),
            Self::Mesh(mesh) => mesh.centroid_m(bin),
        }
    }

    /// Unit vector out of the lit side at the middle of a bin.
    ///
    /// # Panics
    /// If there is no such bin.
    #[must_use]
    pub fn bin_normal(&self, bin: usize) -> [f64; 3] {
        assert!(bin < self.bins(), "no bin {bin}");
        match self {
            Self::Plane(plane) => plane.normal(),
            Self::Frustum(frustum) => frustum.normal((bin % frustum.columns()) as f64 + 0.5),
            Self::Mesh(mesh) => mesh.normal(bin),
        }
    }

    /// Where the middle of a bin is on the receiver laid flat \[m\]: `u` to the right and `v` down, as a camera facing
    /// it sees them. On a plane both count from its centre; on a cylinder or cone `u` is the arc from where the first
    /// column begins, at the bin's own height, and `v` runs along the side from its upper edge. `None` for a mesh.
    ///
    /// ```
    /// use helio_flux::{Plane, Receiver};
    /// let plane = Plane::new([5.0, 0.0, 9.0], [0.0, 0.0, -1.0], [1.0, 0.0, 0.0], [2.0, 1.0], [1, 4])?;
    /// assert_eq!(Receiver::Plane(plane).bin_uv_m(3), Some([0.75, 0.0]));
    /// # Ok::<(), helio_flux::FluxError>(())
    /// ```
    ///
    /// # Panics
    /// If there is no such bin.
    #[must_use]
    pub fn bin_uv_m(&self, bin: usize) -> Option<[f64; 2]> {
        assert!(bin < self.bins(), "no bin {bin}");
        let part = |k: usize, count: usize| (k as f64 + 0.5) / count as f64;
        let across = part(bin % self.columns(), self.columns());
        let down = part(bin / self.columns(), self.rows());
        match self {
            Self::Plane(plane) => {
                let [width_m, height_m] = plane.size_m();
                Some([(across - 0.5) * width_m, (down - 0.5) * height_m])
            }
            Self::Frustum(round) => {
                let side = sub(
                    round.point_m(0.0, 0.0),
                    round.point_m(round.rows() as f64, 0.0),
                );
                let slant_m = norm(side);
                // around at the bin's height: its area over its height, times the columns
                let around_m = round.bin_area_m2(bin / round.columns())
                    * (round.rows() * round.columns()) as f64
                    / slant_m;
                Some([across * around_m, down * slant_m])
            }
            Self::Mesh(_) => None,
        }
    }

    /// The corners of a bin \[m\], counterclockwise as seen from the lit side: three of a mesh's triangle, else four. On
    /// a cylinder or cone they lie on it, so that the flat piece between them is a chord's.
    ///
    /// # Panics
    /// If there is no such bin.
    #[must_use]
    pub fn bin_corners_m(&self, bin: usize) -> Vec<[f64; 3]> {
        assert!(bin < self.bins(), "no bin {bin}");
        let (row, column) = ((bin / self.columns()) as f64, (bin % self.columns()) as f64);
        let corners = [(1.0, 0.0), (1.0, 1.0), (0.0, 1.0), (0.0, 0.0)];
        let corners = corners.map(|(down, right)| (row + down, column + right));
        match self {
            Self::Plane(plane) => corners.map(|(r, c)| plane.point_m(r, c)).to_vec(),
            Self::Frustum(round) => corners.map(|(r, c)| round.point_m(r, c)).to_vec(),
            Self::Mesh(mesh) => mesh.corners_m(bin).unwrap_or_default().to_vec(),
        }
    }

    /// Area of the lit side \[m²\].
    #[must_use]
    pub fn area_m2(&self) -> f64 {
        match self {
            Self::Plane(plane) => plane.area_m2(),
            Self::Frustum(frustum) => frustum.area_m2(),
            Self::Mesh(mesh) => mesh.area_m2(),
        }
    }

    /// A point in the middle of it \[m\].
    #[must_use]
    pub fn centre_m(&self) -> [f64; 3] {
        match self {
            Self::Plane(plane) => plane.centre_m(),
            Self::Frustum(frustum) => frustum.centre_m(),
            Self::Mesh(mesh) => mesh.centre_m(),
        }
    }

    /// Radius of a sphere about [`centre_m`](Self::centre_m) that holds all of it \[m\].
    #[must_use]
    pub fn radius_m(&self) -> f64 {
        match self {
            Self::Plane(plane) => 0.5 * libm::hypot(plane.size_m()[0], plane.size_m()[1]),
            Self::Frustum(frustum) => frustum.outer_radius_m(),
            Self::Mesh(mesh) => mesh.outer_radius_m(),
        }
    }

    /// The plane that all of it lies in, if there is one: its normal and a point.
    pub(crate) fn plane(&self) -> Option<([f64; 3], [f64; 3])> {
        match self {
            Self::Plane(plane) => Some((plane.normal(), plane.centre_m())),
            Self::Frustum(_) => None,
            Self::Mesh(mesh) => mesh.plane(),
        }
    }

    /// How far it reaches at most from [`centre_m`](Self::centre_m) along a unit vector, and back \[m\].
    pub(crate) fn half_extent_m(&self, along: [f64; 3]) -> f64 {
        match self {
            Self::Plane(plane) => {
                let [width_m, height_m] = plane.size_m();
                let (across, down) = (dot(along, plane.right()), dot(along, plane.down()));
                0.5 * (width_m * across.abs() + height_m * down.abs())
            }
            Self::Frustum(frustum) => frustum.half_extent_m(along),
            Self::Mesh(mesh) => mesh.half_extent_m(along),
        }
    }

    /// Where a ray comes to the back of the lit side, in lengths of its direction; `None` if it does not, or meets the
    /// lit side before.
    pub(crate) fn back_first(&self, origin_m: [f64; 3], direction: [f64; 3]) -> Option<f64> {
        let back = match self {
            Self::Plane(plane) => plane.back(origin_m, direction),
            Self::Frustum(frustum) => frustum.back(origin_m, direction),
            Self::Mesh(mesh) => mesh.back(origin_m, direction),
        }?;
        let lit = self.hit(origin_m, direction);
        lit.is_none_or(|lit| back < lit.along).then_some(back)
    }

    /// Where a ray first meets the lit side, ahead of its origin; `None` if it misses.
    ///
    /// `direction` may have any length.
    #[must_use]
    pub fn hit(&self, origin_m: [f64; 3], direction: [f64; 3]) -> Option<Hit> {
        match self {
            Self::Plane(plane) => plane.hit(origin_m, direction),
            Self::Frustum(frustum) => frustum.hit(origin_m, direction),
            Self::Mesh(mesh) => mesh.hit(origin_m, direction),
        }
    }
}

fn bad(who: &'static str, what: &'static str, wanted: &'static str, value: f64) -> FluxError {
    FluxError::BadValue {
        who,
        what,
        wanted,
        value,
    }
}

fn check_length(who: &'static str, what: &'static str, value_m: f64) -> Result<(), FluxError> {
    if value_m > 0.0 && value_m <= 1e6 {
        return Ok(());
    }
    Err(bad(who, what, "above 0 and at most 1e6 m", value_m))
}

fn check_grid(who: &'static str, rows: usize, columns: usize) -> Result<(), FluxError> {
    for (what, count) in [("rows", rows), ("columns", columns)] {
        if !(1..=1 << 20).contains(&count) {
            return Err(bad(who, what, "within 1..=1048576", count as f64));
        }
    }
    if (rows + 2) * (columns + 2) > MAX_BINS {
        let bins = (rows * columns) as f64;
        let wanted = "so few that with a frame of one there are at most 2²³";
        return Err(bad(who, "bins", wanted, bins));
    }
    Ok(())
}

fn check_point(who: &'static str, what: &'static str, point_m: [f64; 3]) -> Result<(), FluxError> {
    for value in point_m {
        if value.is_nan() || value.abs() > 1e9 {
            return Err(bad(who, what, "finite and within ±1e9 m", value));
        }
    }
    Ok(())
}

/// The direction of a vector; its length is the value of the error.
pub(crate) fn check_direction(
    who: &'static str,
    what: &'static str,
    vector: [f64; 3],
) -> Result<[f64; 3], FluxError> {
    let none = || bad(who, what, "a finite vector with a length", norm(vector));
    unit(vector).ok_or_else(none)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::element::Element;
    use core::f64::consts::PI;

    fn all() -> [Receiver; 4] {
        let plane = Plane::new(
            [1.0, 2.0, 3.0],
            [0.3, -0.2, -1.0],
            [1.0, 0.1, 0.0],
            [2.0, 1.0],
            [3, 5],
        );
        let (up, x) = ([0.0, 0.0, 1.0], [1.0, 0.0, 0.0]);
        let cylinder = Frustum::cylinder([0.0; 3], up, x, 2.0, 3.0, [3, 60]);
        let cone = Frustum::cone([0.0; 3], [0.0, 1.0, 0.2], x, [3.0, 1.0], 4.0, [4, 60]);
        let mesh = MeshReceiver::new(&[[[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]]);
        [
            Receiver::Plane(plane.unwrap()),
            Receiver::Frustum(cylinder.unwrap()),
            Receiver::Frustum(cone.unwrap()),
            Receiver::Mesh(mesh.unwrap()),
        ]
    }

    // The flat piece between the corners has the bin's area and faces where it does, but for the arc over the chord.
    #[test]
    fn corners_run_round_the_lit_side() {
        for receiver in all() {
            for bin in 0..receiver.bins() {
                let piece = match receiver.bin_corners_m(bin)[..] {
                    [a, b, c, d] => Element::quadrilateral([a, b, c, d]),
                    [a, b, c] => Element::triangle([a, b, c]),
                    _ => panic!("no corners"),
                };
                let piece = piece.unwrap();
                let area_m2 = receiver.bin_area_m2(bin);
                assert!((piece.area_m2() / area_m2 - 1.0).abs() < 2e-3, "{bin}");
                assert!(norm(sub(piece.normal(), receiver.bin_normal(bin))) < 2e-3);
            }
        }
    }

    #[test]
    fn places_on_a_receiver_laid_flat() {
        let [plane, cylinder, cone, mesh] = all();
        // 2 m by 1 m in 5 by 3 bins: the first and the middle one
        let uv = plane.bin_uv_m(0).unwrap();
        assert!((uv[0] + 0.8).abs() < 1e-12 && (uv[1] + 1.0 / 3.0).abs() < 1e-12);
        assert_eq!(plane.bin_uv_m(7), Some([0.0, 0.0]));
        // an arc of half a bin of 60, and half a metre down
        let uv = cylinder.bin_uv_m(0).unwrap();
        assert!((uv[0] - 2.0 * PI / 60.0).abs() < 1e-12 && (uv[1] - 0.5).abs() < 1e-12);
        // the last row of four is an eighth from the base: radius 2.75, and 7/8 of the side down
        let uv = cone.bin_uv_m(3 * 60).unwrap();
        assert!((uv[0] - 2.75 * PI / 60.0).abs() < 1e-12, "{uv:?}");
        assert!((uv[1] - 0.875 * 20_f64.sqrt()).abs() < 1e-12, "{uv:?}");
        assert_eq!(mesh.bin_uv_m(0), None);
    }
}
