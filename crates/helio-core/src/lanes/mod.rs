//! Several heliostats at once: the few vector operations that the kernels are written in.
//!
//! A kernel is one `#[inline(always)]` body, generic over [`Lanes`], compiled again for each
//! instruction set. Every operation here is an IEEE 754 operation with one correct result (add,
//! multiply, divide, square root, fused multiply-add, comparison, bit operations), so each
//! instruction set gives the same bits and the scalar path, [`f64`] itself, is the oracle.
//!
//! Hidden, and no part of the stable interface: for the kernels of this project's other crates, which
//! write theirs as a [`Kernel`] and get their lanes from `run::run`.

pub mod math;
mod pack;
mod prefetch;
mod run;
mod scalar;
mod single;
#[cfg(target_arch = "x86_64")]
pub(crate) mod x86;
#[cfg(target_arch = "x86_64")]
mod x86_single;

pub(crate) use pack::{Pack2, Pack4};
pub use prefetch::prefetch;
pub use run::{Kernel, run};
pub use single::Singles;

/// Rows of a block of prepared constants; the widest vector holds as many.
pub const BLOCK: usize = 8;

/// Truth values, one per lane.
pub trait Mask: Copy {
    const LANES: usize;
    fn and(self, other: Self) -> Self;
    fn or(self, other: Self) -> Self;
    fn not(self) -> Self;
    fn all(self) -> bool;
    /// One bit per lane, lane 0 lowest.
    fn bits(self) -> u64;
}

/// A vector of doubles. `WIDTH` divides [`BLOCK`] or is a multiple of it.
pub trait Lanes: Copy {
    type Mask: Mask;
    /// Singles in registers of the same instruction set.
    type Singles: Singles;
    const WIDTH: usize;

    fn splat(value: f64) -> Self;
    /// Column `column` of rows `lane..lane + WIDTH` of a block.
    #[inline(always)]
    fn load<const N: usize>(block: &Columns<N>, lane: usize, column: usize) -> Self {
        Self::read(&block.0[column][lane..])
    }
    /// The first `WIDTH` numbers of a slice.
    fn read(source: &[f64]) -> Self;
    /// The first `WIDTH` numbers of a slice of singles, exactly.
    fn read_singles(source: &[f32]) -> Self;
    /// To the first `WIDTH` places of a slice.
    fn write(self, target: &mut [f64]);
    /// Like [`write`](Self::write), past the caches where the target is aligned to 64 bytes.
    fn stream(self, target: &mut [f64]) {
        self.write(target);
    }

    fn add(self, other: Self) -> Self;
    fn sub(self, other: Self) -> Self;
    fn mul(self, other: Self) -> Self;
    fn div(self, other: Self) -> Self;
    fn sqrt(self) -> Self;
    /// self · factor + addend, rounded once.
    fn mul_add(self, factor: Self, addend: Self) -> Self;
    /// addend - self · factor, rounded once.
    fn neg_mul_add(self, factor: Self, addend: Self) -> Self;
    fn floor(self) -> Self;
    /// To the nearest whole number, halves to the even one.
    fn round(self) -> Self;
    /// The sign bits of either.
    fn or(self, other: Self) -> Self;
    /// One bit per lane, set where the sign bit is.
    fn sign_bits(self) -> u64;
    fn abs(self) -> Self;
    /// The magnitude of `self` with the sign of `sign`.
    fn copysign(self, sign: Self) -> Self;
    /// Negated where `sign` is negative (has its sign bit set).
    fn xor_sign(self, sign: Self) -> Self;
    /// Negated where the mask is true.
    fn neg_if(self, mask: Self::Mask) -> Self;

    /// Ordered comparisons: false where either side is NaN.
    fn lt(self, other: Self) -> Self::Mask;
    fn le(self, other: Self) -> Self::Mask;
    /// `self` where the mask is true, else `other`.
    fn select(mask: Self::Mask, yes: Self, no: Self) -> Self;

    /// `self` if below `other`, else `other` (also where one is NaN, or both are zero): one
    /// instruction where the processor's own rule is this one.
    #[inline(always)]
    fn min(self, other: Self) -> Self {
        Self::select(self.lt(other), self, other)
    }
    /// `self` if above `other`, else `other` (also where one is NaN).
    #[inline(always)]
    fn max(self, other: Self) -> Self {
        Self::select(other.lt(self), self, other)
    }
}

/// `N` columns of [`BLOCK`] rows, next to each other in memory: one stream for the prefetcher.
#[derive(Debug, Clone, Copy)]
#[repr(C, align(64))]
pub struct Columns<const N: usize>(pub [[f64; BLOCK]; N]);

/// [`Columns`] of half the size, for what need not be known to the last digit.
#[derive(Debug, Clone, Copy)]
#[repr(C, align(64))]
pub struct SingleColumns<const N: usize>(pub [[f32; BLOCK]; N]);

/// Instruction sets that the kernels are compiled for; they differ in speed and never in a bit.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
#[non_exhaustive]
pub enum SimdLevel {
    /// One heliostat at a time with the target's plain instructions. Where those lack a fused
    /// multiply-add (x86-64 before 2013, and any build for plain x86-64 without the standard
    /// library's run-time choice) it is emulated: correct, and some ten times slower.
    Scalar,
    /// Four doubles at a time, x86-64 AVX2 with FMA.
    Avx2,
    /// Eight doubles at a time, x86-64 AVX-512 (F, VL, DQ).
    Avx512,
}

impl SimdLevel {
    /// The levels that this processor has, slowest first.
    ///
    /// Without the standard library only what the build was targeted at is known.
    ///
    /// ```
    /// use helio_core::SimdLevel;
    /// assert_eq!(SimdLevel::available()[0], SimdLevel::Scalar);
    /// ```
    #[must_use]
    pub fn available() -> &'static [Self] {
        const ALL: [SimdLevel; 3] = [SimdLevel::Scalar, SimdLevel::Avx2, SimdLevel::Avx512];
        let count = match Self::best() {
            Self::Scalar => 1,
            Self::Avx2 => 2,
            Self::Avx512 => 3,
        };
        &ALL[..count]
    }

    /// The fastest level that this processor has.
    #[must_use]
    pub fn best() -> Self {
        #[cfg(target_arch = "x86_64")]
        {
            if x86::has_avx512() {
                return Self::Avx512;
            }
            if x86::has_avx2() {
                return Self::Avx2;
            }
        }
        Self::Scalar
    }

    /// The word for messages and `--version`.
    #[must_use]
    pub const fn as_str(self) -> &'static str {
        match self {
            Self::Scalar => "scalar",
            Self::Avx2 => "avx2",
            Self::Avx512 => "avx512",
        }
    }
}

impl core::fmt::Display for SimdLevel {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        f.write_str(self.as_str())
    }
}
