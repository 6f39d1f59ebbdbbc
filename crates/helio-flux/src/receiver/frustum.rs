//! The outside of a cylinder or a cone.

use core::f64::consts::{PI, TAU};

use super::{Hit, bad, check_direction, check_grid, check_length, check_point};
use crate::error::FluxError;
use crate::vector::{Vector, add, cross, dot, scale, sub, unit};

/// The outside of a straight round cylinder, cone or truncated cone.
///
/// Unrolled as someone outside sees it: columns run to the right, which is counterclockwise seen from
/// beyond the axis' end, from the meridian toward `zero`; rows run from the end of the axis to its base.
///
/// ```
/// use helio_flux::{Frustum, Receiver};
/// // A cylinder of 2 m radius, 3 m high, standing on the origin, with four columns from x toward y.
/// let cylinder = Frustum::cylinder([0.0; 3], [0.0, 0.0, 1.0], [1.0, 0.0, 0.0], 2.0, 3.0, [3, 4])?;
/// let receiver = Receiver::Frustum(cylinder);
/// assert!((receiver.area_m2() - 12.0 * std::f64::consts::PI).abs() < 1e-12);
/// let hit = receiver.hit([10.0, 1.0, 2.5], [-1.0, 0.0, 0.0]).ok_or("missed")?;
/// assert_eq!(hit.bin, 0); // the highest row, and between x and y
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Debug, Clone, PartialEq)]
pub struct Frustum {
    pub(super) base_m: Vector,
    /// Toward the meridian of column 0, across it, and along the axis.
    pub(super) axes: [Vector; 3],
    pub(super) base_radius_m: f64,
    pub(super) end_radius_m: f64,
    pub(super) height_m: f64,
    pub(super) rows: usize,
    pub(super) columns: usize,
}

impl Frustum {
    /// A cylinder that stands on `base_m` and extends along `axis` by its height; `zero` (made square to the axis)
    /// points to where the first column begins; `grid` is the number of rows and columns.
    ///
    /// # Errors
    /// [`FluxError::BadValue`] for a radius, height or grid out of range, or directions that are none or
    /// parallel.
    pub fn cylinder(
        base_m: [f64; 3],
        axis: [f64; 3],
        zero: [f64; 3],
        radius_m: f64,
        height_m: f64,
        grid: [usize; 2],
    ) -> Result<Self, FluxError> {
        Self::cone(base_m, axis, zero, [radius_m, radius_m], height_m, grid)
    }

    /// A truncated cone: like [`cylinder`](Self::cylinder), with the radii at the base and at the end of the
    /// axis, of which one may be 0.
    ///
    /// # Errors
    /// As [`cylinder`](Self::cylinder).
    pub fn cone(
        base_m: [f64; 3],
        axis: [f64; 3],
        zero: [f64; 3],
        radii_m: [f64; 2],
        height_m: f64,
        grid: [usize; 2],
    ) -> Result<Self, FluxError> {
        const WHO: &str = "round receiver";
        let [base_radius_m, end_radius_m] = radii_m;
        let [rows, columns] = grid;
        check_point(WHO, "base_m", base_m)?;
        check_length(WHO, "greater radius", base_radius_m.max(end_radius_m))?;
        check_length(WHO, "height_m", height_m)?;
        // Of a number and NaN the least is the number.
        if let Some(&radius_m) = radii_m.iter().find(|r| r.is_nan() || **r < 0.0) {
            return Err(bad(WHO, "smaller radius", "at least 0 m", radius_m));
        }
        check_grid(WHO, rows, columns)?;
        let axis = check_direction(WHO, "axis", axis)?;
        let zero = check_direction(WHO, "zero", zero)?;
        let across = cross(axis, zero);
        let across = unit(across).filter(|_| dot(across, across) > 1e-12);
        let wanted = "away from parallel with the axis";
        let across = across.ok_or_else(|| bad(WHO, "zero", wanted, dot(axis, zero)))?;
        Ok(Self {
            base_m,
            axes: [cross(across, axis), across, axis],
            base_radius_m,
            end_radius_m,
            height_m,
            rows,
            columns,
        })
    }

    /// Rows of the grid.
    #[must_use]
    pub const fn rows(&self) -> usize {
        self.rows
    }

    /// Columns of the grid.
    #[must_use]
    pub const fn columns(&self) -> usize {
        self.columns
    }

    /// The middle of the axis \[m\].
    #[must_use]
    pub fn centre_m(&self) -> [f64; 3] {
        add(self.base_m, scale(self.axes[2], 0.5 * self.height_m))
    }

    /// Area of the lit side, without the ends \[m²\]: π (r0 + r1) √(h² + (r0 - r1)²).
    #[must_use]
    pub fn area_m2(&self) -> f64 {
        PI * (self.base_radius_m + self.end_radius_m) * self.slant_m()
    }

    /// Area of a bin of a row \[m²\].
    #[must_use]
    pub fn bin_area_m2(&self, row: usize) -> f64 {
        let middle_m = self.radius_m(self.up_m(row as f64 + 0.5));
        let slant_m = self.slant_m() / self.rows as f64;
        TAU * middle_m * slant_m / self.columns as f64
    }

    pub(super) fn outer_radius_m(&self) -> f64 {
        libm::hypot(
            0.5 * self.height_m,
            self.base_radius_m.max(self.end_radius_m),
        )
    }

    /// How far the cylinder around it reaches from its middle along a unit vector \[m\].
    pub(super) fn half_extent_m(&self, along: Vector) -> f64 {
        let [x, y, up] = self.to_local(along);
        let radius_m = self.base_radius_m.max(self.end_radius_m);
        0.5 * self.height_m * up.abs() + radius_m * libm::hypot(x, y)
    }

    /// Radius in the middle \[m\], its growth along the axis, and the height \[m\].
    pub(crate) fn shape(&self) -> (f64, f64, f64) {
        let middle_m = self.radius_m(0.5 * self.height_m);
        (middle_m, self.growth(), self.height_m)
    }

    /// Radii at the base and at the end of the axis \[m\].
    #[must_use]
    pub const fn radii_m(&self) -> [f64; 2] {
        [self.base_radius_m, self.end_radius_m]
    }

    /// From the base to the end along the surface \[m\].
    #[must_use]
    pub fn slant_m(&self) -> f64 {
        libm::hypot(self.height_m, self.base_radius_m - self.end_radius_m)
    }

    /// Growth of the radius along the axis.
    fn growth(&self) -> f64 {
        (self.end_radius_m - self.base_radius_m) / self.height_m
    }

    fn radius_m(&self, up_m: f64) -> f64 {
        self.base_radius_m + self.growth() * up_m
    }

    /// Height over the base at a row; whole numbers are edges of bins.
    fn up_m(&self, row: f64) -> f64 {
        self.height_m * (1.0 - row / self.rows as f64)
    }

    /// How much larger the area around a row is than the mean of its bin.
    pub(crate) fn share_at(&self, row: f64) -> f64 {
        let middle_m = self.radius_m(self.up_m(row.floor() + 0.5));
        self.radius_m(self.up_m(row)) / middle_m
    }

    /// The point at a row and a column \[m\]; whole numbers are edges of bins.
    #[must_use]
    pub fn point_m(&self, row: f64, column: f64) -> [f64; 3] {
        let (sin, cos) = libm::sincos(TAU * column / self.columns as f64);
        let up_m = self.up_m(row);
        let radius_m = self.radius_m(up_m);
        let local = [radius_m * cos, radius_m * sin, up_m];
        add(self.base_m, self.to_world(local))
    }

    /// Unit vector out of the lit side at a column.
    #[must_use]
    pub fn normal(&self, column: f64) -> [f64; 3] {
        let (sin, cos) = libm::sincos(TAU * column / self.columns as f64);
        let (out, along) = (
            self.height_m / self.slant_m(),
            -self.growth() * self.height_m / self.slant_m(),
        );
        self.to_world([out * cos, out * sin, along])
    }

    fn to_world(&self, local: Vector) -> Vector {
        let [x, y, z] = self.axes;
        add(
            scale(x, local[0]),
            add(scale(y, local[1]), scale(z, local[2])),
        )
    }

    pub(crate) fn to_local(&self, world: Vector) -> Vector {
        self.axes.map(|axis| dot(axis, world))
    }

    pub(crate) fn hit(&self, origin_m: Vector, direction: Vector) -> Option<Hit> {
        let (along, p) = self.meets(origin_m, direction, 1.0)?;
        let turn = libm::atan2(p[1], p[0]) * (1.0 / TAU);
        let turn = if turn < 0.0 { turn + 1.0 } else { turn };
        let column = (turn * self.columns as f64) as usize;
        let row = ((1.0 - p[2] / self.height_m) * self.rows as f64) as usize;
        let (row, column) = (row.min(self.rows - 1), column.min(self.columns - 1));
        Some(Hit {
            bin: row * self.columns + column,
            point_m: add(self.base_m, self.to_world(p)),
            along,
        })
    }

    /// Where a ray comes to it from within, through an open end, in lengths of its direction.
    pub(super) fn back(&self, origin_m: Vector, direction: Vector) -> Option<f64> {
        self.meets(origin_m, direction, -1.0).map(|found| found.0)
    }

    /// Where a ray first meets it from outside (`side` 1) or from within (-1), along the ray and in its own frame.
    fn meets(&self, origin_m: Vector, direction: Vector, side: f64) -> Option<(f64, Vector)> {
        let o = self.to_local(sub(origin_m, self.base_m));
        let d = self.to_local(direction);
        let k = self.growth();
        // |across|² = radius²: a t² + 2 b t + c = 0
        let radius_m = self.radius_m(o[2]);
        let a = d[0] * d[0] + d[1] * d[1] - k * k * d[2] * d[2];
        let b = o[0] * d[0] + o[1] * d[1] - k * d[2] * radius_m;
        let c = o[0] * o[0] + o[1] * o[1] - radius_m * radius_m;
        let discriminant = b * b - a * c;
        if discriminant.is_nan() || discriminant < 0.0 {
            return None;
        }
        // the two roots without cancellation
        let q = -(b + discriminant.sqrt().copysign(b));
        let (mut first, mut second) = (q / a, c / q);
        if second < first {
            (first, second) = (second, first);
        }
        [first, second].into_iter().find_map(|along| {
            let p: Vector = core::array::from_fn(|i| o[i] + along * d[i]);
            let radius_m = self.radius_m(p[2]);
            let toward = p[0] * d[0] + p[1] * d[1] - k * radius_m * d[2];
            let lit = along > 0.0
                && along.is_finite()
                && (0.0..=self.height_m).contains(&p[2])
                && radius_m >= 0.0
                && side * toward < 0.0;
            lit.then_some((along, p))
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Receiver;
    use crate::vector::norm;

    fn cones() -> [Frustum; 3] {
        let (base, axis, zero) = ([1.0, -2.0, 5.0], [0.1, 0.2, 1.0], [1.0, 1.0, 0.0]);
        [[2.0, 2.0], [3.0, 1.0], [0.0, 2.5]]
            .map(|radii| Frustum::cone(base, axis, zero, radii, 4.0, [6, 20]).unwrap())
    }

    #[test]
    fn bins_add_up_to_the_closed_form() {
        for cone in cones() {
            let receiver = Receiver::Frustum(cone);
            let sum: f64 = (0..receiver.bins()).map(|b| receiver.bin_area_m2(b)).sum();
            assert!((sum / receiver.area_m2() - 1.0).abs() < 1e-14);
        }
    }

    // A ray from outside to a point of the surface meets it there if the point is turned to the ray.
    #[test]
    fn rays_to_points_of_the_surface_meet_them() {
        for cone in cones() {
            let receiver = Receiver::Frustum(cone.clone());
            let (mut lit, mut dark) = (0, 0);
            for bin in 0..receiver.bins() {
                let (row, column) = (bin / 20, bin % 20);
                let to = cone.point_m(row as f64 + 0.3, column as f64 + 0.7);
                for from in [[30.0, 0.0, 5.0], [-20.0, 9.0, 40.0], [3.0, -40.0, -20.0]] {
                    let direction = sub(to, from);
                    let hit = receiver.hit(from, direction);
                    if dot(direction, cone.normal(column as f64 + 0.7)) < 0.0 {
                        let hit = hit.unwrap();
                        assert_eq!(hit.bin, bin);
                        assert!(
                            norm(sub(hit.point_m, to)) < 1e-9 && (hit.along - 1.0).abs() < 1e-9
                        );
                        lit += 1;
                    } else {
                        // the point is on the far side: the ray met the near side, or came by the ends
                        assert!(hit.is_none_or(|hit| hit.along < 1.0));
                        dark += 1;
                    }
                }
            }
            assert!(lit > 50 && dark > 50, "{lit} {dark}");
        }
    }
}
