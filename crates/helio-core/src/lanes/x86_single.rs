//! Singles for AVX2 and AVX-512.
#![allow(unsafe_code)]
// SAFETY of every block in this file: as in `x86`. The types here are the `Singles` of types of that file, and
// are made and used only where those are.

use core::arch::x86_64::*;

use super::Mask;
use super::single::Singles;

/// Eight singles.
#[derive(Debug, Clone, Copy)]
pub(crate) struct S8(__m256);

/// Truth of eight singles: all bits of a lane set or none.
#[derive(Debug, Clone, Copy)]
pub(crate) struct N8(__m256);

/// Sixteen singles.
#[derive(Debug, Clone, Copy)]
pub(crate) struct S16(__m512);

/// Truth of sixteen singles, a bit each.
#[derive(Debug, Clone, Copy)]
pub(crate) struct N16(__mmask16);

macro_rules! call {
    ($e:expr) => {{
        // SAFETY: the types of this file exist only where the probe found their instructions, and
        // the lengths of slices are checked before; see the head of this file.
        unsafe { $e }
    }};
}

impl Mask for N8 {
    const LANES: usize = 8;
    #[inline(always)]
    fn and(self, other: Self) -> Self {
        Self(call!(_mm256_and_ps(self.0, other.0)))
    }
    #[inline(always)]
    fn or(self, other: Self) -> Self {
        Self(call!(_mm256_or_ps(self.0, other.0)))
    }
    #[inline(always)]
    fn not(self) -> Self {
        Self(call!(_mm256_xor_ps(
            self.0,
            _mm256_castsi256_ps(_mm256_set1_epi32(-1))
        )))
    }
    #[inline(always)]
    fn all(self) -> bool {
        self.bits() == 0xff
    }
    #[inline(always)]
    fn bits(self) -> u64 {
        u64::from(call!(_mm256_movemask_ps(self.0)).unsigned_abs())
    }
}

impl Mask for N16 {
    const LANES: usize = 16;
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
        self.0 == 0xffff
    }
    #[inline(always)]
    fn bits(self) -> u64 {
        u64::from(self.0)
    }
}

impl Singles for S8 {
    type Mask = N8;
    const WIDTH: usize = 8;

    #[inline(always)]
    fn splat(value: f32) -> Self {
        Self(call!(_mm256_set1_ps(value)))
    }
    #[inline(always)]
    fn read(source: &[f32]) -> Self {
        assert!(source.len() >= Self::WIDTH);
        Self(call!(_mm256_loadu_ps(source.as_ptr())))
    }
    #[inline(always)]
    fn write(self, target: &mut [f32]) {
        assert!(target.len() >= Self::WIDTH);
        call!(_mm256_storeu_ps(target.as_mut_ptr(), self.0));
    }
    #[inline(always)]
    fn write_whole(self, target: &mut [u32]) {
        assert!(target.len() >= Self::WIDTH);
        call!(_mm256_storeu_si256(
            target.as_mut_ptr().cast(),
            _mm256_cvttps_epi32(self.0)
        ));
    }
    #[inline(always)]
    fn add(self, other: Self) -> Self {
        Self(call!(_mm256_add_ps(self.0, other.0)))
    }
    #[inline(always)]
    fn sub(self, other: Self) -> Self {
        Self(call!(_mm256_sub_ps(self.0, other.0)))
    }
    #[inline(always)]
    fn mul(self, other: Self) -> Self {
        Self(call!(_mm256_mul_ps(self.0, other.0)))
    }
    #[inline(always)]
    fn div(self, other: Self) -> Self {
        Self(call!(_mm256_div_ps(self.0, other.0)))
    }
    #[inline(always)]
    fn min(self, other: Self) -> Self {
        Self(call!(_mm256_min_ps(self.0, other.0)))
    }
    #[inline(always)]
    fn max(self, other: Self) -> Self {
        Self(call!(_mm256_max_ps(self.0, other.0)))
    }
    #[inline(always)]
    fn sqrt(self) -> Self {
        Self(call!(_mm256_sqrt_ps(self.0)))
    }
    #[inline(always)]
    fn mul_add(self, factor: Self, addend: Self) -> Self {
        Self(call!(_mm256_fmadd_ps(self.0, factor.0, addend.0)))
    }
    #[inline(always)]
    fn neg_mul_add(self, factor: Self, addend: Self) -> Self {
        Self(call!(_mm256_fnmadd_ps(self.0, factor.0, addend.0)))
    }
    #[inline(always)]
    fn floor(self) -> Self {
        Self(call!(_mm256_floor_ps(self.0)))
    }
    #[inline(always)]
    fn lt(self, other: Self) -> N8 {
        N8(call!(_mm256_cmp_ps::<_CMP_LT_OQ>(self.0, other.0)))
    }
    #[inline(always)]
    fn le(self, other: Self) -> N8 {
        N8(call!(_mm256_cmp_ps::<_CMP_LE_OQ>(self.0, other.0)))
    }
    #[inline(always)]
    fn select(mask: N8, yes: Self, no: Self) -> Self {
        Self(call!(_mm256_blendv_ps(no.0, yes.0, mask.0)))
    }
}

impl Singles for S16 {
    type Mask = N16;
    const WIDTH: usize = 16;

    #[inline(always)]
    fn splat(value: f32) -> Self {
        Self(call!(_mm512_set1_ps(value)))
    }
    #[inline(always)]
    fn read(source: &[f32]) -> Self {
        assert!(source.len() >= Self::WIDTH);
        Self(call!(_mm512_loadu_ps(source.as_ptr())))
    }
    #[inline(always)]
    fn write(self, target: &mut [f32]) {
        assert!(target.len() >= Self::WIDTH);
        call!(_mm512_storeu_ps(target.as_mut_ptr(), self.0));
    }
    #[inline(always)]
    fn write_whole(self, target: &mut [u32]) {
        assert!(target.len() >= Self::WIDTH);
        call!(_mm512_storeu_si512(
            target.as_mut_ptr().cast(),
            _mm512_cvttps_epi32(self.0)
        ));
    }
    #[inline(always)]
    fn add(self, other: Self) -> Self {
        Self(call!(_mm512_add_ps(self.0, other.0)))
    }
    #[inline(always)]
    fn sub(self, other: Self) -> Self {
        Self(call!(_mm512_sub_ps(self.0, other.0)))
    }
    #[inline(always)]
    fn mul(self, other: Self) -> Self {
        Self(call!(_mm512_mul_ps(self.0, other.0)))
    }
    #[inline(always)]
    fn div(self, other: Self) -> Self {
        Self(call!(_mm512_div_ps(self.0, other.0)))
    }
    #[inline(always)]
    fn min(self, other: Self) -> Self {
        Self(call!(_mm512_min_ps(self.0, other.0)))
    }
    #[inline(always)]
    fn max(self, other: Self) -> Self {
        Self(call!(_mm512_max_ps(self.0, other.0)))
    }
    #[inline(always)]
    fn sqrt(self) -> Self {
        Self(call!(_mm512_sqrt_ps(self.0)))
    }
    #[inline(always)]
    fn mul_add(self, factor: Self, addend: Self) -> Self {
        Self(call!(_mm512_fmadd_ps(self.0, factor.0, addend.0)))
    }
    #[inline(always)]
    fn neg_mul_add(self, factor: Self, addend: Self) -> Self {
        Self(call!(_mm512_fnmadd_ps(self.0, factor.0, addend.0)))
    }
    #[inline(always)]
    fn floor(self) -> Self {
        const DOWN: i32 = _MM_FROUND_TO_NEG_INF | _MM_FROUND_NO_EXC;
        Self(call!(_mm512_roundscale_ps::<DOWN>(self.0)))
    }
    #[inline(always)]
    fn lt(self, other: Self) -> N16 {
        N16(call!(_mm512_cmp_ps_mask::<_CMP_LT_OQ>(self.0, other.0)))
    }
    #[inline(always)]
    fn le(self, other: Self) -> N16 {
        N16(call!(_mm512_cmp_ps_mask::<_CMP_LE_OQ>(self.0, other.0)))
    }
    #[inline(always)]
    fn select(mask: N16, yes: Self, no: Self) -> Self {
        Self(call!(_mm512_mask_blend_ps(mask.0, no.0, yes.0)))
    }
}
