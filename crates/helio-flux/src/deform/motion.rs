//! A rigid motion: a rotation about a point, and where that point goes.

use crate::vector::{Vector, add, cross, dot, norm, scale, sub};

/// Rows of a rotation matrix.
pub(crate) type Rotation = [Vector; 3];

pub(crate) const IDENTITY: Rotation = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];

pub(crate) fn apply(rotation: &Rotation, a: Vector) -> Vector {
    [
        dot(rotation[0], a),
        dot(rotation[1], a),
        dot(rotation[2], a),
    ]
}

/// First `first`, then `second`.
pub(crate) fn compose(second: &Rotation, first: &Rotation) -> Rotation {
    let column = |k: usize| apply(second, [first[0][k], first[1][k], first[2][k]]);
    let [a, b, c] = [column(0), column(1), column(2)];
    [[a[0], b[0], c[0]], [a[1], b[1], c[1]], [a[2], b[2], c[2]]]
}

/// Turn about a unit axis by an angle, right-handed.
pub(crate) fn about(axis: Vector, angle_rad: f64) -> Rotation {
    // Rodrigues: R = cos φ I + sin φ [n]× + (1 - cos φ) n nᵀ, with 1 - cos φ = 2 sin² φ/2 for small angles
    let (s, c) = (libm::sin(angle_rad), libm::cos(angle_rad));
    let half = libm::sin(0.5 * angle_rad);
    let versine = 2.0 * half * half;
    let [x, y, z] = axis;
    [
        [
            c + versine * x * x,
            versine * x * y - s * z,
            versine * x * z + s * y,
        ],
        [
            versine * x * y + s * z,
            c + versine * y * y,
            versine * y * z - s * x,
        ],
        [
            versine * x * z - s * y,
            versine * y * z + s * x,
            c + versine * z * z,
        ],
    ]
}

/// A rigid motion: x ↦ q + R (x - p).
///
/// ```
/// use helio_flux::deform::RigidMotion;
/// // A quarter turn about the vertical through (1, 0, 0), and 2 m up.
/// let motion = RigidMotion::turn([1.0, 0.0, 0.0], [0.0, 0.0, 5.0], std::f64::consts::FRAC_PI_2)?
///     .and_shift([0.0, 0.0, 2.0]);
/// let [x, y, z] = motion.point_m([2.0, 0.0, 0.0]);
/// assert!((x - 1.0).abs() < 1e-15 && (y - 1.0).abs() < 1e-15 && z == 2.0);
/// # Ok::<(), helio_flux::deform::DeformError>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RigidMotion {
    rotation: Rotation,
    from_m: Vector,
    to_m: Vector,
}

impl RigidMotion {
    pub(crate) const fn new(rotation: Rotation, from_m: Vector, to_m: Vector) -> Self {
        Self {
            rotation,
            from_m,
            to_m,
        }
    }

    /// A turn about an axis (of any length) through a point \[m\], right-handed \[rad\].
    ///
    /// # Errors
    /// [`DeformError::BadAxis`](super::DeformError::BadAxis) for an axis without a direction.
    pub fn turn(
        through_m: [f64; 3],
        axis: [f64; 3],
        angle_rad: f64,
    ) -> Result<Self, super::DeformError> {
        let Some(unit) = crate::vector::unit(axis) else {
            let why = "which has no direction".to_owned();
            return Err(super::DeformError::BadAxis { axis, why });
        };
        Ok(Self::new(about(unit, angle_rad), through_m, through_m))
    }

    /// The same, and then a shift \[m\].
    #[must_use]
    pub fn and_shift(self, by_m: [f64; 3]) -> Self {
        Self {
            to_m: add(self.to_m, by_m),
            ..self
        }
    }

    /// Where a point goes \[m\].
    #[must_use]
    pub fn point_m(&self, at_m: [f64; 3]) -> [f64; 3] {
        add(self.to_m, apply(&self.rotation, sub(at_m, self.from_m)))
    }

    /// Where a direction goes.
    #[must_use]
    pub fn direction(&self, direction: [f64; 3]) -> [f64; 3] {
        apply(&self.rotation, direction)
    }

    /// Rows of the rotation matrix.
    #[must_use]
    pub const fn rotation(&self) -> &[[f64; 3]; 3] {
        &self.rotation
    }

    /// The rotation as an axis times an angle \[rad\], the angle in [0, π].
    #[must_use]
    pub fn rotation_vector_rad(&self) -> [f64; 3] {
        let r = &self.rotation;
        // 2 sin φ n, and 1 + 2 cos φ = tr R
        let twice = [r[2][1] - r[1][2], r[0][2] - r[2][0], r[1][0] - r[0][1]];
        let sine = 0.5 * norm(twice);
        let cosine = 0.5 * (r[0][0] + r[1][1] + r[2][2] - 1.0);
        let angle_rad = libm::atan2(sine, cosine);
        if sine > 1e-8 || cosine > 0.0 {
            // φ / sin φ goes to one.
            let factor = if sine > 0.0 { angle_rad / sine } else { 1.0 };
            return scale(twice, 0.5 * factor);
        }
        // Half a turn: R = 2 n nᵀ - I, whose longest column gives the axis.
        let column = |k: usize| {
            let mut column = [r[0][k], r[1][k], r[2][k]];
            column[k] += 1.0;
            column
        };
        let longest = [column(0), column(1), column(2)]
            .into_iter()
            .fold([0.0; 3], |a, b| if norm(b) > norm(a) { b } else { a });
        scale(longest, angle_rad / norm(longest))
    }
}

/// A unit vector across a given one.
pub(crate) fn across(a: Vector) -> Vector {
    // Across the coordinate axis that it leans to least.
    let least = (0..3).fold(0, |k, j| if a[j].abs() < a[k].abs() { j } else { k });
    let mut axis = [0.0; 3];
    axis[least] = 1.0;
    let across = cross(a, axis);
    scale(across, 1.0 / norm(across))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rotation_vectors_come_back() {
        for angle in [
            0.0,
            1e-12,
            1e-6,
            0.3,
            2.0,
            3.0,
            std::f64::consts::PI - 1e-4,
            std::f64::consts::PI,
        ] {
            for axis in [[1.0, 0.0, 0.0], [0.0, 0.6, -0.8], [0.48, 0.6, 0.64]] {
                let found = RigidMotion::turn([0.0; 3], axis, angle)
                    .unwrap()
                    .rotation_vector_rad();
                let wanted = scale(axis, angle);
                let off = norm(sub(found, wanted)).min(if angle > 3.1 {
                    // Half a turn is the same about the opposite axis.
                    norm(add(found, wanted))
                } else {
                    f64::MAX
                });
                assert!(off < 1e-9 * angle + 1e-16, "{angle} {axis:?} {found:?}");
            }
        }
    }

    #[test]
    fn turns_compose() {
        let axis = [0.48, 0.6, 0.64];
        let both = compose(&about(axis, 0.7), &about(axis, 0.4));
        let once = about(axis, 1.1);
        for (a, b) in both.iter().flatten().zip(once.iter().flatten()) {
            assert!((a - b).abs() < 1e-15);
        }
        assert_eq!(compose(&IDENTITY, &once), once);
        for a in [[0.0, 0.0, 2.0], [-3.0, 1.0, 0.1]] {
            assert!(dot(across(a), a).abs() < 1e-15);
        }
    }
}
