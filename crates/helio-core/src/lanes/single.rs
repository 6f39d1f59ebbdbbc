//! Vectors of singles, twice as many to an instruction: for what need not be known to the last digit of
//! a double, such as the rays of a cone.

use super::Mask;

/// A vector of singles, with the operations of [`Lanes`](super::Lanes) that a tracer of rays wants. Each has
/// one correct result, so every instruction set gives the same bits.
pub trait Singles: Copy {
    type Mask: Mask;
    const WIDTH: usize;

    fn splat(value: f32) -> Self;
    /// The first `WIDTH` numbers of a slice.
    fn read(source: &[f32]) -> Self;
    /// To the first `WIDTH` places of a slice.
    fn write(self, target: &mut [f32]);
    /// Whole numbers from 0 up to below 2³¹, to the first `WIDTH` places of a slice; of others, some number.
    fn write_whole(self, target: &mut [u32]);

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
    /// `self` if below `other`, else `other` (also where one is NaN, or both are zero).
    fn min(self, other: Self) -> Self;
    /// `self` if above `other`, else `other` (also where one is NaN, or both are zero).
    fn max(self, other: Self) -> Self;

    /// Ordered comparisons: false where either side is NaN.
    fn lt(self, other: Self) -> Self::Mask;
    fn le(self, other: Self) -> Self::Mask;
    /// `self` where the mask is true, else `other`.
    fn select(mask: Self::Mask, yes: Self, no: Self) -> Self;
}

impl Singles for f32 {
    type Mask = bool;
    const WIDTH: usize = 1;

    #[inline(always)]
    fn splat(value: f32) -> Self {
        value
    }
    #[inline(always)]
    fn read(source: &[f32]) -> Self {
        source[0]
    }
    #[inline(always)]
    fn write(self, target: &mut [f32]) {
        target[0] = self;
    }
    #[inline(always)]
    fn write_whole(self, target: &mut [u32]) {
        target[0] = self as u32;
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
        libm::sqrtf(self)
    }
    #[cfg(feature = "std")]
    #[inline(always)]
    fn mul_add(self, factor: Self, addend: Self) -> Self {
        f32::mul_add(self, factor, addend)
    }
    #[cfg(not(feature = "std"))]
    #[inline(always)]
    fn mul_add(self, factor: Self, addend: Self) -> Self {
        libm::fmaf(self, factor, addend)
    }
    #[inline(always)]
    fn neg_mul_add(self, factor: Self, addend: Self) -> Self {
        Singles::mul_add(-self, factor, addend)
    }
    #[inline(always)]
    fn floor(self) -> Self {
        libm::floorf(self)
    }
    #[inline(always)]
    fn min(self, other: Self) -> Self {
        if self < other { self } else { other }
    }
    #[inline(always)]
    fn max(self, other: Self) -> Self {
        if self > other { self } else { other }
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

#[cfg(all(test, feature = "std"))]
mod tests {
    use super::*;
    use crate::SimdLevel;
    use crate::lanes::{Kernel, Lanes, run};

    const COUNT: usize = 2048;

    /// Every operation on the same numbers: bits of the answers, one after another.
    struct Everything<'a>(&'a [f32], &'a [f32], &'a [f32]);

    impl Kernel for Everything<'_> {
        type Output = Vec<u32>;
        #[inline(always)]
        fn run<L: Lanes>(self) -> Vec<u32> {
            let Everything(x, y, z) = self;
            let width = <L::Singles as Singles>::WIDTH;
            let mut out = Vec::new();
            for at in (0..COUNT).step_by(width) {
                let [x, y, z] = [x, y, z].map(|c| L::Singles::read(&c[at..]));
                let picked = L::Singles::select;
                let below = L::Singles::splat(1000.0);
                for (k, answer) in [
                    x.add(y),
                    x.sub(y),
                    x.mul(y),
                    x.div(y),
                    x.sqrt(),
                    x.mul_add(y, z),
                    x.neg_mul_add(y, z),
                    x.floor(),
                    x.min(y),
                    x.max(y),
                    picked(x.lt(y), z, y),
                    picked(x.le(y).and(y.lt(z).not()), z, x),
                ]
                .into_iter()
                .enumerate()
                {
                    let place = k * COUNT + at;
                    out.resize(out.len().max(13 * COUNT), 0);
                    let mut singles = [0.0; 16];
                    answer.write(&mut singles);
                    for (to, single) in out[place..place + width].iter_mut().zip(singles) {
                        // which NaN an operation gives is not defined
                        *to = if single.is_nan() { 1 } else { single.to_bits() };
                    }
                }
                let whole = x.max(L::Singles::splat(0.0)).min(below);
                whole
                    .floor()
                    .write_whole(&mut out[12 * COUNT + at..][..width]);
            }
            out
        }
    }

    #[test]
    fn singles_have_the_same_bits_at_every_level() {
        let mut state = 1_u32;
        let mut next = || {
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            match state >> 27 {
                0 => [0.0, -0.0, f32::INFINITY, f32::NAN][(state >> 8) as usize % 4],
                1 => f32::from_bits(state),
                _ => (state >> 8) as f32 / 65536.0 - 100.0,
            }
        };
        let [x, y, z] = [(); 3].map(|()| (0..COUNT).map(|_| next()).collect::<Vec<_>>());
        let want = run(SimdLevel::Scalar, Everything(&x, &y, &z));
        for &level in SimdLevel::available() {
            let got = run(level, Everything(&x, &y, &z));
            for (place, (got, want)) in got.iter().zip(&want).enumerate() {
                assert_eq!(got, want, "{level}: operation {}", place / COUNT);
            }
        }
    }
}
