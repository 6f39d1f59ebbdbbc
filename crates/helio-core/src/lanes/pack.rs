//! Several vectors in lockstep: latency, not throughput, is the wall of a kernel that has one.

use super::{Lanes, Mask};

macro_rules! pack {
    ($name:ident, $count:literal, $($i:literal),+) => {
        /// Vectors that go through a kernel side by side.
        #[derive(Debug, Clone, Copy)]
        pub(crate) struct $name<L>([L; $count]);

        impl<M: Mask> Mask for $name<M> {
            const LANES: usize = $count * M::LANES;
            #[inline(always)]
            fn and(self, other: Self) -> Self {
                Self([$(self.0[$i].and(other.0[$i])),+])
            }
            #[inline(always)]
            fn or(self, other: Self) -> Self {
                Self([$(self.0[$i].or(other.0[$i])),+])
            }
            #[inline(always)]
            fn not(self) -> Self {
                Self([$(self.0[$i].not()),+])
            }
            #[inline(always)]
            fn all(self) -> bool {
                $(self.0[$i].all())&+
            }
            #[inline(always)]
            fn bits(self) -> u64 {
                $((self.0[$i].bits() << ($i * M::LANES)))|+
            }
        }

        impl<L: Lanes> Lanes for $name<L> {
            type Mask = $name<L::Mask>;
            type Singles = L::Singles;
            const WIDTH: usize = $count * L::WIDTH;

            #[inline(always)]
            fn splat(value: f64) -> Self {
                Self([L::splat(value); $count])
            }
            #[inline(always)]
            fn read(source: &[f64]) -> Self {
                Self([$(L::read(&source[$i * L::WIDTH..])),+])
            }
            #[inline(always)]
            fn read_singles(source: &[f32]) -> Self {
                Self([$(L::read_singles(&source[$i * L::WIDTH..])),+])
            }
            #[inline(always)]
            fn write(self, target: &mut [f64]) {
                $(self.0[$i].write(&mut target[$i * L::WIDTH..]);)+
            }
            #[inline(always)]
            fn stream(self, target: &mut [f64]) {
                $(self.0[$i].stream(&mut target[$i * L::WIDTH..]);)+
            }
            pack!(@binary add sub mul div min max or copysign xor_sign; $($i)+);
            #[inline(always)]
            fn sqrt(self) -> Self {
                Self([$(self.0[$i].sqrt()),+])
            }
            #[inline(always)]
            fn mul_add(self, factor: Self, addend: Self) -> Self {
                Self([$(self.0[$i].mul_add(factor.0[$i], addend.0[$i])),+])
            }
            #[inline(always)]
            fn neg_mul_add(self, factor: Self, addend: Self) -> Self {
                Self([$(self.0[$i].neg_mul_add(factor.0[$i], addend.0[$i])),+])
            }
            #[inline(always)]
            fn floor(self) -> Self {
                Self([$(self.0[$i].floor()),+])
            }
            #[inline(always)]
            fn round(self) -> Self {
                Self([$(self.0[$i].round()),+])
            }
            #[inline(always)]
            fn sign_bits(self) -> u64 {
                $((self.0[$i].sign_bits() << ($i * L::WIDTH)))|+
            }
            #[inline(always)]
            fn abs(self) -> Self {
                Self([$(self.0[$i].abs()),+])
            }
            #[inline(always)]
            fn neg_if(self, mask: Self::Mask) -> Self {
                Self([$(self.0[$i].neg_if(mask.0[$i])),+])
            }
            #[inline(always)]
            fn lt(self, other: Self) -> Self::Mask {
                $name([$(self.0[$i].lt(other.0[$i])),+])
            }
            #[inline(always)]
            fn le(self, other: Self) -> Self::Mask {
                $name([$(self.0[$i].le(other.0[$i])),+])
            }
            #[inline(always)]
            fn select(mask: Self::Mask, yes: Self, no: Self) -> Self {
                Self([$(L::select(mask.0[$i], yes.0[$i], no.0[$i])),+])
            }
        }
    };
    (@binary $($op:ident)+; $($i:literal)+) => {
        pack!(@each ($($op)+) ($($i)+));
    };
    (@each ($op:ident $($rest:ident)*) ($($i:literal)+)) => {
        #[inline(always)]
        fn $op(self, other: Self) -> Self {
            Self([$(self.0[$i].$op(other.0[$i])),+])
        }
        pack!(@each ($($rest)*) ($($i)+));
    };
    (@each () ($($i:literal)+)) => {};
}

pack!(Pack2, 2, 0, 1);
pack!(Pack4, 4, 0, 1, 2, 3);
