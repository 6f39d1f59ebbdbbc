//! Numbers of eight heliostats, written like one.

use core::ops::{Add, Div, Mul, Neg, Sub};

use helio_core::lanes::{BLOCK, Lanes, Mask, math};

use crate::model::Real;

/// Lanes with operators.
#[derive(Clone, Copy)]
pub(crate) struct Lane<L>(pub L);

/// One number of each of eight heliostats.
pub(crate) type Eight = [f64; BLOCK];

impl<L: Lanes> Lane<L> {
    #[inline(always)]
    pub fn read(from: &Eight, lane: usize) -> Self {
        Self(L::read(&from[lane..]))
    }
    #[inline(always)]
    pub fn write(self, to: &mut Eight, lane: usize) {
        self.0.write(&mut to[lane..]);
    }
    #[inline(always)]
    pub fn select(mask: L::Mask, yes: Self, no: Self) -> Self {
        Self(L::select(mask, yes.0, no.0))
    }
    /// addend - self · factor, rounded once.
    #[inline(always)]
    pub fn neg_mul_add(self, factor: Self, addend: Self) -> Self {
        Self(self.0.neg_mul_add(factor.0, addend.0))
    }
    #[inline(always)]
    pub fn sqrt(self) -> Self {
        Self(self.0.sqrt())
    }
    #[inline(always)]
    pub fn abs(self) -> Self {
        Self(self.0.abs())
    }
    #[inline(always)]
    pub fn max(self, other: Self) -> Self {
        Self(self.0.max(other.0))
    }
    #[inline(always)]
    pub fn min(self, other: Self) -> Self {
        Self(self.0.min(other.0))
    }
    /// False where either is NaN.
    #[inline(always)]
    pub fn lt(self, other: Self) -> L::Mask {
        self.0.lt(other.0)
    }
    /// False where either is NaN.
    #[inline(always)]
    pub fn le(self, other: Self) -> L::Mask {
        self.0.le(other.0)
    }
    /// Whose sign bit is set where that of either is.
    #[inline(always)]
    pub fn either_negative(self, other: Self) -> Self {
        Self(self.0.or(other.0))
    }
    /// Of a vector of length one.
    #[inline(always)]
    pub fn angle_of([cosine, sine]: [Self; 2]) -> Self {
        Self(math::angle_full(cosine.0, sine.0, L::splat(1.0)))
    }
    /// True nowhere.
    #[inline(always)]
    pub fn nowhere() -> L::Mask {
        L::splat(1.0).lt(L::splat(0.0))
    }
}

macro_rules! operator {
    ($($name:ident $function:ident),+) => {$(
        impl<L: Lanes> $name for Lane<L> {
            type Output = Self;
            #[inline(always)]
            fn $function(self, other: Self) -> Self {
                Self(self.0.$function(other.0))
            }
        }
    )+};
}
operator!(Add add, Sub sub, Mul mul, Div div);

impl<L: Lanes> Neg for Lane<L> {
    type Output = Self;
    #[inline(always)]
    fn neg(self) -> Self {
        Self(self.0.xor_sign(L::splat(-0.0)))
    }
}

impl<L: Lanes> Real for Lane<L> {
    #[inline(always)]
    fn splat(value: f64) -> Self {
        Self(L::splat(value))
    }
    #[inline(always)]
    fn mul_add(self, factor: Self, addend: Self) -> Self {
        Self(self.0.mul_add(factor.0, addend.0))
    }
    #[inline(always)]
    fn sin_cos(self) -> (Self, Self) {
        let (sine, cosine) = math::sin_cos(self.0);
        (Self(sine), Self(cosine))
    }
}

/// True if any lane is.
#[inline(always)]
pub(crate) fn any<M: Mask>(mask: M) -> bool {
    mask.bits() != 0
}
