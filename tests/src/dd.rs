//! Double-double arithmetic: some 31 digits, so that a truth has no rounding of its own to speak of
//! (Dekker 1971; Joldes, Muller, Popescu 2017).

use core::ops::{Add, Div, Mul, Neg, Sub};

/// An unevaluated sum of two doubles.
#[derive(Debug, Clone, Copy)]
pub struct Dd {
    /// The sum, rounded.
    pub hi: f64,
    /// What rounding left.
    pub lo: f64,
}

fn quick_two_sum(a: f64, b: f64) -> Dd {
    let hi = a + b;
    Dd {
        hi,
        lo: b - (hi - a),
    }
}

fn two_sum(a: f64, b: f64) -> Dd {
    let hi = a + b;
    let part = hi - a;
    Dd {
        hi,
        lo: (a - (hi - part)) + (b - part),
    }
}

fn split(a: f64) -> (f64, f64) {
    let t = 134_217_729.0 * a; // 2^27 + 1
    let high = t - (t - a);
    (high, a - high)
}

fn two_product(a: f64, b: f64) -> Dd {
    let hi = a * b;
    let (ah, al) = split(a);
    let (bh, bl) = split(b);
    Dd {
        hi,
        lo: ((ah * bh - hi) + ah * bl + al * bh) + al * bl,
    }
}

impl Dd {
    /// A double.
    #[must_use]
    pub const fn new(value: f64) -> Self {
        Self { hi: value, lo: 0.0 }
    }

    /// Rounded to a double.
    #[must_use]
    pub fn value(self) -> f64 {
        self.hi + self.lo
    }

    /// Square root.
    #[must_use]
    pub fn sqrt(self) -> Self {
        if self.hi <= 0.0 {
            return Self::new(if self.hi == 0.0 { 0.0 } else { f64::NAN });
        }
        let root = Self::new(self.hi.sqrt());
        root + (self - root * root) / Self::new(2.0 * root.hi)
    }
}

/// Sine and cosine of an angle of moderate size \[rad\].
#[must_use]
pub fn sin_cos(angle: Dd) -> (Dd, Dd) {
    const HALF_PI: [f64; 3] = [
        core::f64::consts::FRAC_PI_2,
        6.123_233_995_736_766e-17,
        -1.497_384_904_859_169_8e-33,
    ];
    let quarter = (angle.hi / HALF_PI[0]).round();
    let mut x = angle;
    for part in HALF_PI {
        x = x - two_product(quarter, part);
    }
    let minus_square = -(x * x);
    let (mut sin, mut cos) = (x, Dd::new(1.0));
    let (mut sin_term, mut cos_term) = (x, Dd::new(1.0));
    for k in 1..14 {
        let k = f64::from(k);
        cos_term = cos_term * minus_square / Dd::new((2.0 * k - 1.0) * (2.0 * k));
        sin_term = sin_term * minus_square / Dd::new((2.0 * k) * (2.0 * k + 1.0));
        cos = cos + cos_term;
        sin = sin + sin_term;
    }
    match quarter.rem_euclid(4.0) as u8 {
        0 => (sin, cos),
        1 => (cos, -sin),
        2 => (-sin, -cos),
        _ => (-cos, sin),
    }
}

impl From<f64> for Dd {
    fn from(value: f64) -> Self {
        Self::new(value)
    }
}

impl Add for Dd {
    type Output = Self;
    fn add(self, o: Self) -> Self {
        let s = two_sum(self.hi, o.hi);
        let t = two_sum(self.lo, o.lo);
        let s = quick_two_sum(s.hi, s.lo + t.hi);
        quick_two_sum(s.hi, s.lo + t.lo)
    }
}

impl Neg for Dd {
    type Output = Self;
    fn neg(self) -> Self {
        Self {
            hi: -self.hi,
            lo: -self.lo,
        }
    }
}

impl Sub for Dd {
    type Output = Self;
    fn sub(self, o: Self) -> Self {
        self + -o
    }
}

impl Mul for Dd {
    type Output = Self;
    fn mul(self, o: Self) -> Self {
        let p = two_product(self.hi, o.hi);
        quick_two_sum(p.hi, p.lo + (self.hi * o.lo + self.lo * o.hi))
    }
}

impl Div for Dd {
    type Output = Self;
    fn div(self, o: Self) -> Self {
        let first = self.hi / o.hi;
        let rest = self - o * Self::new(first);
        let second = rest.hi / o.hi;
        let rest = rest - o * Self::new(second);
        let third = rest.hi / o.hi;
        let sum = quick_two_sum(first, second);
        sum + Self::new(third)
    }
}

/// A vector of them: east, north, up.
#[derive(Debug, Clone, Copy)]
pub struct Dd3(pub [Dd; 3]);

impl Dd3 {
    /// From doubles.
    #[must_use]
    pub fn new(v: crate::V3) -> Self {
        Self([v.0.into(), v.1.into(), v.2.into()])
    }

    /// Scalar product.
    #[must_use]
    pub fn dot(self, o: Self) -> Dd {
        self.0[0] * o.0[0] + self.0[1] * o.0[1] + self.0[2] * o.0[2]
    }

    /// Scaled.
    #[must_use]
    pub fn scaled(self, f: Dd) -> Self {
        Self(self.0.map(|x| x * f))
    }

    /// Sum.
    #[must_use]
    pub fn plus(self, o: Self) -> Self {
        Self(core::array::from_fn(|k| self.0[k] + o.0[k]))
    }

    /// Difference.
    #[must_use]
    pub fn minus(self, o: Self) -> Self {
        Self(core::array::from_fn(|k| self.0[k] - o.0[k]))
    }

    /// Length.
    #[must_use]
    pub fn norm(self) -> Dd {
        self.dot(self).sqrt()
    }

    /// The direction.
    #[must_use]
    pub fn unit(self) -> Self {
        self.scaled(Dd::new(1.0) / self.norm())
    }

    /// Rounded.
    #[must_use]
    pub fn value(self) -> crate::V3 {
        crate::V3(self.0[0].value(), self.0[1].value(), self.0[2].value())
    }

    /// Right-handed cross product.
    #[must_use]
    pub fn cross(self, o: Self) -> Self {
        let (a, b) = (self.0, o.0);
        Self([
            a[1] * b[2] - a[2] * b[1],
            a[2] * b[0] - a[0] * b[2],
            a[0] * b[1] - a[1] * b[0],
        ])
    }

    /// The other way.
    #[must_use]
    pub fn reversed(self) -> Self {
        Self(self.0.map(|x| -x))
    }

    /// Rodrigues' rotation about a unit axis, right-handed.
    #[must_use]
    pub fn rotated(self, axis: Self, angle_rad: impl Into<Dd>) -> Self {
        let (sin, cos) = sin_cos(angle_rad.into());
        let along = axis.scaled(axis.dot(self) * (Dd::new(1.0) - cos));
        self.scaled(cos)
            .plus(axis.cross(self).scaled(sin))
            .plus(along)
    }

    /// How far a vector of doubles lies from this one.
    #[must_use]
    pub fn distance_to(self, o: crate::V3) -> f64 {
        self.minus(Self::new(o)).value().norm()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn thirty_digits() {
        let third = Dd::new(1.0) / Dd::new(3.0);
        let one = third + third + third - Dd::new(1.0);
        assert!(one.value().abs() < 1e-31);
        let root = Dd::new(2.0).sqrt();
        // sqrt(2) = 1.4142135623730950488016887242097
        assert_eq!(root.hi, core::f64::consts::SQRT_2);
        assert!((root.lo - -9.667_293_313_452_913e-17).abs() < 1e-31);
        // sin(1), cos(1), sin(-5.5) to 32 digits
        let (sin, cos) = sin_cos(Dd::new(1.0));
        assert_eq!(
            (sin.hi, cos.hi),
            (0.841_470_984_807_896_5, 0.540_302_305_868_139_8)
        );
        let mut rng = crate::Rng::new(1);
        for _ in 0..10_000 {
            let (x, y) = (Dd::new(rng.within(7.0)), Dd::new(rng.within(7.0)));
            let ((sx, cx), (sy, cy)) = (sin_cos(x), sin_cos(y));
            let (sum, _) = sin_cos(x + y);
            assert!((sum - sx * cy - cx * sy).value().abs() < 1e-30);
            assert!((sx * sx + cx * cx - Dd::new(1.0)).value().abs() < 1e-30);
            assert!((sx.value() - x.hi.sin()).abs() < 2e-16);
            assert!((cx.value() - x.hi.cos()).abs() < 2e-16);
        }
        for _ in 0..10_000 {
            let x = Dd {
                hi: rng.range(0.1, 9.0),
                lo: 0.0,
            } / Dd::new(rng.range(0.1, 9.0));
            let y = x.sqrt();
            assert!(((y * y - x).value() / x.value()).abs() < 3e-31);
        }
    }
}
