//! One row at a time: the oracle of the wider paths, and the only path without SIMD.

use super::{Lanes, Mask};

impl Mask for bool {
    const LANES: usize = 1;
    #[inline(always)]
    fn and(self, other: Self) -> Self {
        self & other
    }
    #[inline(always)]
    fn or(self, other: Self) -> Self {
        self | other
    }
    #[inline(always)]
    fn not(self) -> Self {
        !self
    }
    #[inline(always)]
    fn all(self) -> bool {
        self
    }
    #[inline(always)]
    fn bits(self) -> u64 {
        u64::from(self)
    }
}

impl Lanes for f64 {
    type Mask = bool;
    type Singles = f32;
    const WIDTH: usize = 1;

    #[inline(always)]
    fn splat(value: f64) -> Self {
        value
    }
    #[inline(always)]
    fn read(source: &[f64]) -> Self {
        source[0]
    }
    #[inline(always)]
    fn read_singles(source: &[f32]) -> Self {
        f64::from(source[0])
    }
    #[inline(always)]
    fn write(self, target: &mut [f64]) {
        target[0] = self;
    }
    #[inline(always)]
    fn add(self, other: Self) -> Self {
        self + other
    }
    #[inline(always)]
    fn sub(self, other: Self) -> Self {
        self - other
    }
    #[inline(always)]
    fn mul(self, other: Self) -> Self {
        self * other
    }
    #[inline(always)]
    fn div(self, other: Self) -> Self {
        self / other
    }
    #[inline(always)]
    fn sqrt(self) -> Self {
        libm::sqrt(self)
    }
    #[cfg(feature = "std")]
    #[inline(always)]
    fn mul_add(self, factor: Self, addend: Self) -> Self {
        f64::mul_add(self, factor, addend)
    }
    #[cfg(not(feature = "std"))]
    #[inline(always)]
    fn mul_add(self, factor: Self, addend: Self) -> Self {
        libm::fma(self, factor, addend)
    }
    #[inline(always)]
    fn neg_mul_add(self, factor: Self, addend: Self) -> Self {
        Lanes::mul_add(-self, factor, addend)
    }
    #[inline(always)]
    fn floor(self) -> Self {
        libm::floor(self)
    }
    #[inline(always)]
    fn round(self) -> Self {
        libm::rint(self)
    }
    #[inline(always)]
    fn or(self, other: Self) -> Self {
        f64::from_bits(self.to_bits() | other.to_bits())
    }
    #[inline(always)]
    fn sign_bits(self) -> u64 {
        self.to_bits() >> 63
    }
    #[inline(always)]
    fn abs(self) -> Self {
        f64::abs(self)
    }
    #[inline(always)]
    fn copysign(self, sign: Self) -> Self {
        f64::copysign(self, sign)
    }
    #[inline(always)]
    fn xor_sign(self, sign: Self) -> Self {
        f64::from_bits(self.to_bits() ^ (sign.to_bits() & (1 << 63)))
    }
    #[inline(always)]
    fn neg_if(self, mask: bool) -> Self {
        if mask { -self } else { self }
    }
    #[inline(always)]
    fn lt(self, other: Self) -> bool {
        self < other
    }
    #[inline(always)]
    fn le(self, other: Self) -> bool {
        self <= other
    }
    #[inline(always)]
    fn select(mask: bool, yes: Self, no: Self) -> Self {
        if mask { yes } else { no }
    }
}
