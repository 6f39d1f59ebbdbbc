//! AVX2 and AVX-512.
#![allow(unsafe_code)]
// SAFETY of every block in this file: the types here are made and used only inside the functions of
// the `dispatch` modules and of `run`, which are entered after the probe (`has_avx2`, `has_avx512`) found their
// instructions on this processor; loads and stores take slices, whose length is checked first.

use core::arch::x86_64::*;

use super::{Lanes, Mask};

/// True if the processor, and the operating system's saving of registers, allow [`V4`].
pub(crate) fn has_avx2() -> bool {
    #[cfg(feature = "std")]
    {
        std::arch::is_x86_feature_detected!("avx2") && std::arch::is_x86_feature_detected!("fma")
    }
    #[cfg(not(feature = "std"))]
    {
        cfg!(all(target_feature = "avx2", target_feature = "fma"))
    }
}

/// True if the processor, and the operating system's saving of registers, allow [`V8`].
pub(crate) fn has_avx512() -> bool {
    #[cfg(feature = "std")]
    {
        has_avx2()
            && std::arch::is_x86_feature_detected!("avx512f")
            && std::arch::is_x86_feature_detected!("avx512vl")
            && std::arch::is_x86_feature_detected!("avx512dq")
    }
    #[cfg(not(feature = "std"))]
    {
        has_avx2()
            && cfg!(all(
                target_feature = "avx512f",
                target_feature = "avx512vl",
                target_feature = "avx512dq"
            ))
    }
}

/// Four doubles.
#[derive(Debug, Clone, Copy)]
pub(crate) struct V4(__m256d);

/// Truth of four lanes: all bits of a lane set or none.
#[derive(Debug, Clone, Copy)]
pub(crate) struct M4(__m256d);

/// Eight doubles.
#[derive(Debug, Clone, Copy)]
pub(crate) struct V8(__m512d);

/// Truth of eight lanes, a bit each.
#[derive(Debug, Clone, Copy)]
pub(crate) struct M8(__mmask8);

macro_rules! call {
    ($e:expr) => {{
        // SAFETY: the types of this file exist only where the probe found their instructions, and
        // the lengths of slices are checked before; see the head of this file.
        unsafe { $e }
    }};
}

impl Mask for M4 {
    const LANES: usize = 4;
    #[inline(always)]
    fn and(self, other: Self) -> Self {
        Self(call!(_mm256_and_pd(self.0, other.0)))
    }
    #[inline(always)]
    fn or(self, other: Self) -> Self {
        Self(call!(_mm256_or_pd(self.0, other.0)))
    }
    #[inline(always)]
    fn not(self) -> Self {
        Self(call!(_mm256_xor_pd(
            self.0,
            _mm256_castsi256_pd(_mm256_set1_epi64x(-1))
        )))
    }
    #[inline(always)]
    fn all(self) -> bool {
        self.bits() == 0b1111
    }
    #[inline(always)]
    fn bits(self) -> u64 {
        u64::from(call!(_mm256_movemask_pd(self.0)).unsigned_abs())
    }
}

impl Mask for M8 {
    const LANES: usize = 8;
    #[inline(always)]
    fn and(self, other: Self) -> Self {
        Self(self.0 & other.0)
    }
    #[inline(always)]
    fn or(self, other: Self) -> Self {
        Self(self.0 | other.0)
    }
    #[inline(always)]
    fn not(self) -> Self {
        Self(!self.0)
    }
    #[inline(always)]
    fn all(self) -> bool {
        self.0 == 0xff
    }
    #[inline(always)]
    fn bits(self) -> u64 {
        u64::from(self.0)
    }
}

impl Lanes for V4 {
    type Mask = M4;
    type Singles = super::x86_single::S8;
    const WIDTH: usize = 4;

    #[inline(always)]
    fn splat(value: f64) -> Self {
        Self(call!(_mm256_set1_pd(value)))
    }
    #[inline(always)]
    fn read(source: &[f64]) -> Self {
        assert!(source.len() >= Self::WIDTH);
        Self(call!(_mm256_loadu_pd(source.as_ptr())))
    }
    #[inline(always)]
    fn read_singles(source: &[f32]) -> Self {
        assert!(source.len() >= Self::WIDTH);
        Self(call!(_mm256_cvtps_pd(_mm_loadu_ps(source.as_ptr()))))
    }
    #[inline(always)]
    fn write(self, target: &mut [f64]) {
        assert!(target.len() >= Self::WIDTH);
        call!(_mm256_storeu_pd(target.as_mut_ptr(), self.0));
    }
    #[inline(always)]
    fn stream(self, target: &mut [f64]) {
        assert!(target.len() >= Self::WIDTH && target.as_ptr().addr().is_multiple_of(32));
        call!(_mm256_stream_pd(target.as_mut_ptr(), self.0));
    }
    #[inline(always)]
    fn add(self, other: Self) -> Self {
        Self(call!(_mm256_add_pd(self.0, other.0)))
    }
    #[inline(always)]
    fn sub(self, other: Self) -> Self {
        Self(call!(_mm256_sub_pd(self.0, other.0)))
    }
    #[inline(always)]
    fn mul(self, other: Self) -> Self {
        Self(call!(_mm256_mul_pd(self.0, other.0)))
    }
    #[inline(always)]
    fn div(self, other: Self) -> Self {
        Self(call!(_mm256_div_pd(self.0, other.0)))
    }
    #[inline(always)]
    fn sqrt(self) -> Self {
        Self(call!(_mm256_sqrt_pd(self.0)))
    }
    #[inline(always)]
    fn mul_add(self, factor: Self, addend: Self) -> Self {
        Self(call!(_mm256_fmadd_pd(self.0, factor.0, addend.0)))
    }
    #[inline(always)]
    fn neg_mul_add(self, factor: Self, addend: Self) -> Self {
        Self(call!(_mm256_fnmadd_pd(self.0, factor.0, addend.0)))
    }
    #[inline(always)]
    fn floor(self) -> Self {
        Self(call!(_mm256_floor_pd(self.0)))
    }
    #[inline(always)]
    fn round(self) -> Self {
        const NEAREST: i32 = _MM_FROUND_TO_NEAREST_INT | _MM_FROUND_NO_EXC;
        Self(call!(_mm256_round_pd::<NEAREST>(self.0)))
    }
    #[inline(always)]
    fn or(self, other: Self) -> Self {
        Self(call!(_mm256_or_pd(self.0, other.0)))
    }
    #[inline(always)]
    fn sign_bits(self) -> u64 {
        M4(self.0).bits()
    }
    #[inline(always)]
    fn abs(self) -> Self {
        Self(call!(_mm256_andnot_pd(_mm256_set1_pd(-0.0), self.0)))
    }
    #[inline(always)]
    fn copysign(self, sign: Self) -> Self {
        let bit = call!(_mm256_and_pd(_mm256_set1_pd(-0.0), sign.0));
        Self(call!(_mm256_or_pd(self.abs().0, bit)))
    }
    #[inline(always)]
    fn xor_sign(self, sign: Self) -> Self {
        let bit = call!(_mm256_and_pd(_mm256_set1_pd(-0.0), sign.0));
        Self(call!(_mm256_xor_pd(self.0, bit)))
    }
    #[inline(always)]
    fn neg_if(self, mask: M4) -> Self {
        Self(call!(_mm256_xor_pd(
            self.0,
            _mm256_and_pd(mask.0, _mm256_set1_pd(-0.0))
        )))
    }
    #[inline(always)]
    fn min(self, other: Self) -> Self {
        Self(call!(_mm256_min_pd(self.0, other.0)))
    }
    #[inline(always)]
    fn max(self, other: Self) -> Self {
        Self(call!(_mm256_max_pd(self.0, other.0)))
    }
    #[inline(always)]
    fn lt(self, other: Self) -> M4 {
        M4(call!(_mm256_cmp_pd::<_CMP_LT_OQ>(self.0, other.0)))
    }
    #[inline(always)]
    fn le(self, other: Self) -> M4 {
        M4(call!(_mm256_cmp_pd::<_CMP_LE_OQ>(self.0, other.0)))
    }
    #[inline(always)]
    fn select(mask: M4, yes: Self, no: Self) -> Self {
        Self(call!(_mm256_blendv_pd(no.0, yes.0, mask.0)))
    }
}

impl Lanes for V8 {
    type Mask = M8;
    type Singles = super::x86_single::S16;
    const WIDTH: usize = 8;

    #[inline(always)]
    fn splat(value: f64) -> Self {
        Self(call!(_mm512_set1_pd(value)))
    }
    #[inline(always)]
    fn read(source: &[f64]) -> Self {
        assert!(source.len() >= Self::WIDTH);
        Self(call!(_mm512_loadu_pd(source.as_ptr())))
    }
    #[inline(always)]
    fn read_singles(source: &[f32]) -> Self {
        assert!(source.len() >= Self::WIDTH);
        Self(call!(_mm512_cvtps_pd(_mm256_loadu_ps(source.as_ptr()))))
    }
    #[inline(always)]
    fn write(self, target: &mut [f64]) {
        assert!(target.len() >= Self::WIDTH);
        call!(_mm512_storeu_pd(target.as_mut_ptr(), self.0));
    }
    #[inline(always)]
    fn stream(self, target: &mut [f64]) {
        assert!(target.len() >= Self::WIDTH && target.as_ptr().addr().is_multiple_of(64));
        call!(_mm512_stream_pd(target.as_mut_ptr(), self.0));
    }
    #[inline(always)]
    fn add(self, other: Self) -> Self {
        Self(call!(_mm512_add_pd(self.0, other.0)))
    }
    #[inline(always)]
    fn sub(self, other: Self) -> Self {
        Self(call!(_mm512_sub_pd(self.0, other.0)))
    }
    #[inline(always)]
    fn mul(self, other: Self) -> Self {
        Self(call!(_mm512_mul_pd(self.0, other.0)))
    }
    #[inline(always)]
    fn div(self, other: Self) -> Self {
        Self(call!(_mm512_div_pd(self.0, other.0)))
    }
    #[inline(always)]
    fn sqrt(self) -> Self {
        Self(call!(_mm512_sqrt_pd(self.0)))
    }
    #[inline(always)]
    fn mul_add(self, factor: Self, addend: Self) -> Self {
        Self(call!(_mm512_fmadd_pd(self.0, factor.0, addend.0)))
    }
    #[inline(always)]
    fn neg_mul_add(self, factor: Self, addend: Self) -> Self {
        Self(call!(_mm512_fnmadd_pd(self.0, factor.0, addend.0)))
    }
    #[inline(always)]
    fn floor(self) -> Self {
        const DOWN: i32 = _MM_FROUND_TO_NEG_INF | _MM_FROUND_NO_EXC;
        Self(call!(_mm512_roundscale_pd::<DOWN>(self.0)))
    }
    #[inline(always)]
    fn round(self) -> Self {
        const NEAREST: i32 = _MM_FROUND_TO_NEAREST_INT | _MM_FROUND_NO_EXC;
        Self(call!(_mm512_roundscale_pd::<NEAREST>(self.0)))
    }
    #[inline(always)]
    fn or(self, other: Self) -> Self {
        Self(call!(_mm512_or_pd(self.0, other.0)))
    }
    #[inline(always)]
    fn sign_bits(self) -> u64 {
        u64::from(call!(_mm512_movepi64_mask(_mm512_castpd_si512(self.0))))
    }
    #[inline(always)]
    fn abs(self) -> Self {
        Self(call!(_mm512_abs_pd(self.0)))
    }
    #[inline(always)]
    fn copysign(self, sign: Self) -> Self {
        let bit = call!(_mm512_and_pd(_mm512_set1_pd(-0.0), sign.0));
        Self(call!(_mm512_or_pd(self.abs().0, bit)))
    }
    #[inline(always)]
    fn xor_sign(self, sign: Self) -> Self {
        let bit = call!(_mm512_and_pd(_mm512_set1_pd(-0.0), sign.0));
        Self(call!(_mm512_xor_pd(self.0, bit)))
    }
    #[inline(always)]
    fn neg_if(self, mask: M8) -> Self {
        Self(call!(_mm512_mask_xor_pd(
            self.0,
            mask.0,
            self.0,
            _mm512_set1_pd(-0.0)
        )))
    }
    #[inline(always)]
    fn min(self, other: Self) -> Self {
        Self(call!(_mm512_min_pd(self.0, other.0)))
    }
    #[inline(always)]
    fn max(self, other: Self) -> Self {
        Self(call!(_mm512_max_pd(self.0, other.0)))
    }
    #[inline(always)]
    fn lt(self, other: Self) -> M8 {
        M8(call!(_mm512_cmp_pd_mask::<_CMP_LT_OQ>(self.0, other.0)))
    }
    #[inline(always)]
    fn le(self, other: Self) -> M8 {
        M8(call!(_mm512_cmp_pd_mask::<_CMP_LE_OQ>(self.0, other.0)))
    }
    #[inline(always)]
    fn select(mask: M8, yes: Self, no: Self) -> Self {
        Self(call!(_mm512_mask_blend_pd(mask.0, no.0, yes.0)))
    }
}
