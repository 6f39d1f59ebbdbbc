//! A flat rectangle.

use super::{Hit, check_direction, check_grid, check_length, check_point};
use crate::error::FluxError;
use crate::vector::{Vector, add, cross, dot, norm, scale, sub};

/// A flat rectangular receiver with a grid of equal bins.
///
/// Columns run to the right and rows down as a camera facing it sees them, like pixels of its picture.
///
/// ```
/// use helio_flux::{Plane, Receiver};
/// // 2 m wide, 1 m high, facing up, with x to the right.
/// let plane = Plane::new([0.0; 3], [0.0, 0.0, 1.0], [1.0, 0.0, 0.0], [2.0, 1.0], [1, 4])?;
/// let receiver = Receiver::Plane(plane);
/// let hit = receiver.hit([0.9, 0.0, 5.0], [0.0, 0.0, -1.0]).ok_or("missed")?;
/// assert_eq!((hit.bin, hit.point_m, hit.along), (3, [0.9, 0.0, 0.0], 5.0));
/// assert!(receiver.hit([0.9, 0.0, -5.0], [0.0, 0.0, 1.0]).is_none()); // its back
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Debug, Clone, PartialEq)]
pub struct Plane {
    pub(super) centre_m: Vector,
    pub(super) normal: Vector,
    pub(super) right: Vector,
    pub(super) down: Vector,
    pub(super) width_m: f64,
    pub(super) height_m: f64,
    pub(super) rows: usize,
    pub(super) columns: usize,
}

impl Plane {
    /// A rectangle about `centre_m` that faces along `normal`, with `right` (made square to the normal) along
    /// its width; `size_m` is width and height, `grid` the number of rows and columns.
    ///
    /// # Errors
    /// [`FluxError::BadValue`] for a size or a grid out of range, or directions that are none or parallel.
    pub fn new(
        centre_m: [f64; 3],
        normal: [f64; 3],
        right: [f64; 3],
        size_m: [f64; 2],
        grid: [usize; 2],
    ) -> Result<Self, FluxError> {
        const WHO: &str = "plane receiver";
        let [width_m, height_m] = size_m;
        let [rows, columns] = grid;
        check_point(WHO, "centre_m", centre_m)?;
        check_length(WHO, "width_m", width_m)?;
        check_length(WHO, "height_m", height_m)?;
        check_grid(WHO, rows, columns)?;
        let normal = check_direction(WHO, "normal", normal)?;
        let right = check_direction(WHO, "right", right)?;
        let in_plane = sub(right, scale(normal, dot(right, normal)));
        let length = norm(in_plane);
        if length < 1e-6 {
            let wanted = "away from parallel with the normal; its length across it";
            return Err(super::bad(WHO, "right", wanted, length));
        }
        let right = scale(in_plane, 1.0 / length);
        Ok(Self {
            centre_m,
            normal,
            right,
            down: cross(right, normal),
            width_m,
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

    /// The middle \[m\].
    #[must_use]
    pub const fn centre_m(&self) -> [f64; 3] {
        self.centre_m
    }

    /// Unit vector out of the lit side.
    #[must_use]
    pub const fn normal(&self) -> [f64; 3] {
        self.normal
    }

    /// Unit vector along a row.
    #[must_use]
    pub const fn right(&self) -> [f64; 3] {
        self.right
    }

    /// Unit vector along a column.
    #[must_use]
    pub const fn down(&self) -> [f64; 3] {
        self.down
    }

    /// Width and height \[m\].
    #[must_use]
    pub const fn size_m(&self) -> [f64; 2] {
        [self.width_m, self.height_m]
    }

    /// Width times height \[m²\].
    #[must_use]
    pub const fn area_m2(&self) -> f64 {
        self.width_m * self.height_m
    }

    /// Area of a bin \[m²\].
    #[must_use]
    pub const fn bin_area_m2(&self) -> f64 {
        self.area_m2() / (self.rows * self.columns) as f64
    }

    /// Width and height of a bin \[m\].
    pub(crate) const fn bin_m(&self) -> [f64; 2] {
        [
            self.width_m / self.columns as f64,
            self.height_m / self.rows as f64,
        ]
    }

    /// The point at a row and a column \[m\]; whole numbers are edges of bins.
    #[must_use]
    pub fn point_m(&self, row: f64, column: f64) -> [f64; 3] {
        let u = (column / self.columns as f64 - 0.5) * self.width_m;
        let v = (row / self.rows as f64 - 0.5) * self.height_m;
        add(
            self.centre_m,
            add(scale(self.right, u), scale(self.down, v)),
        )
    }

    pub(crate) fn hit(&self, origin_m: Vector, direction: Vector) -> Option<Hit> {
        (dot(direction, self.normal) < 0.0)
            .then(|| self.crossing(origin_m, direction))
            .flatten()
    }

    /// Where a ray comes to its back, in lengths of its direction.
    pub(super) fn back(&self, origin_m: Vector, direction: Vector) -> Option<f64> {
        let crossing = || self.crossing(origin_m, direction);
        let found = (dot(direction, self.normal) > 0.0).then(crossing).flatten();
        found.map(|hit| hit.along)
    }

    /// Where a ray goes through it, from either side.
    fn crossing(&self, origin_m: Vector, direction: Vector) -> Option<Hit> {
        let toward = dot(direction, self.normal);
        let along = -dot(sub(origin_m, self.centre_m), self.normal) / toward;
        if along.is_nan() || along <= 0.0 {
            return None;
        }
        let point_m = add(origin_m, scale(direction, along));
        let from_centre = sub(point_m, self.centre_m);
        let column = (dot(from_centre, self.right) / self.width_m + 0.5) * self.columns as f64;
        let row = (dot(from_centre, self.down) / self.height_m + 0.5) * self.rows as f64;
        let inside =
            column >= 0.0 && row >= 0.0 && column < self.columns as f64 && row < self.rows as f64;
        inside.then(|| Hit {
            bin: row as usize * self.columns + column as usize,
            point_m,
            along,
        })
    }
}
