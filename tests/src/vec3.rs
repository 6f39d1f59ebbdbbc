//! Three numbers: east, north, up.

use core::ops::{Add, Mul, Neg, Sub};

use helio_core::{Enu, EnuUnit};

/// East, north, up.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct V3(pub f64, pub f64, pub f64);

impl V3 {
    /// Scalar product.
    #[must_use]
    pub fn dot(self, o: Self) -> f64 {
        self.0 * o.0 + self.1 * o.1 + self.2 * o.2
    }

    /// Right-handed cross product.
    #[must_use]
    pub fn cross(self, o: Self) -> Self {
        Self(
            self.1 * o.2 - self.2 * o.1,
            self.2 * o.0 - self.0 * o.2,
            self.0 * o.1 - self.1 * o.0,
        )
    }

    /// Length.
    #[must_use]
    pub fn norm(self) -> f64 {
        self.dot(self).sqrt()
    }

    /// The direction.
    #[must_use]
    pub fn unit(self) -> Self {
        self * (1.0 / self.norm())
    }

    /// Any unit vector square to this one.
    #[must_use]
    pub fn any_square(self) -> Self {
        let (x, y, z) = (self.0.abs(), self.1.abs(), self.2.abs());
        let other = if x <= y && x <= z {
            Self(1.0, 0.0, 0.0)
        } else if y <= z {
            Self(0.0, 1.0, 0.0)
        } else {
            Self(0.0, 0.0, 1.0)
        };
        self.cross(other).unit()
    }

    /// Angle to another vector \[rad\], good at both ends.
    #[must_use]
    pub fn angle_to(self, o: Self) -> f64 {
        self.cross(o).norm().atan2(self.dot(o))
    }

    /// Rodrigues' rotation about a unit axis, right-handed.
    #[must_use]
    pub fn rotated(self, axis: Self, angle_rad: f64) -> Self {
        let (sin, cos) = angle_rad.sin_cos();
        let half = (0.5 * angle_rad).sin();
        // 1 - cos = 2 sin²(half): no cancellation
        self * cos + axis.cross(self) * sin + axis * (axis.dot(self) * (2.0 * half * half))
    }

    /// As the crate's point.
    #[must_use]
    pub fn enu(self) -> Enu {
        Enu::new(self.0, self.1, self.2)
    }
}

impl From<Enu> for V3 {
    fn from(v: Enu) -> Self {
        Self(v.east, v.north, v.up)
    }
}

impl From<EnuUnit> for V3 {
    fn from(v: EnuUnit) -> Self {
        v.as_enu().into()
    }
}

impl Add for V3 {
    type Output = Self;
    fn add(self, o: Self) -> Self {
        Self(self.0 + o.0, self.1 + o.1, self.2 + o.2)
    }
}

impl Sub for V3 {
    type Output = Self;
    fn sub(self, o: Self) -> Self {
        Self(self.0 - o.0, self.1 - o.1, self.2 - o.2)
    }
}

impl Mul<f64> for V3 {
    type Output = Self;
    fn mul(self, f: f64) -> Self {
        Self(self.0 * f, self.1 * f, self.2 * f)
    }
}

impl Neg for V3 {
    type Output = Self;
    fn neg(self) -> Self {
        self * -1.0
    }
}
