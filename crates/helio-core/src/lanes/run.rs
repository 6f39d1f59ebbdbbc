//! A kernel of another crate, compiled for each instruction set, and the choice between them.
#![allow(unsafe_code)]

use super::{Lanes, SimdLevel};

/// Work in lanes: one body for every instruction set.
///
/// Mark `run`, and all that it calls with lanes, `#[inline(always)]`: only what is inlined into the
/// function that was entered for an instruction set is compiled for it.
pub trait Kernel {
    /// What it answers.
    type Output;
    /// Does the work. Lanes must not outlive this call.
    fn run<L: Lanes>(self) -> Self::Output;
}

/// Runs a kernel at a level; one that this processor lacks is lowered to the best that it has.
///
/// The types of lanes that need instructions have no public name: outside this crate they exist only as
/// the `L` of a kernel that is entered here, after the probe.
#[inline]
pub fn run<K: Kernel>(level: SimdLevel, kernel: K) -> K::Output {
    match level.min(SimdLevel::best()) {
        #[cfg(target_arch = "x86_64")]
        // SAFETY: `SimdLevel::best` found the instructions of this level on this processor.
        SimdLevel::Avx512 => unsafe { x86::avx512(kernel) },
        #[cfg(target_arch = "x86_64")]
        // SAFETY: as above.
        SimdLevel::Avx2 => unsafe { x86::avx2(kernel) },
        _ => kernel.run::<f64>(),
    }
}

#[cfg(target_arch = "x86_64")]
mod x86 {
    use super::Kernel;
    use crate::lanes::x86::{V4, V8};

    #[target_feature(enable = "avx512f,avx512vl,avx512dq,avx2,fma")]
    pub fn avx512<K: Kernel>(kernel: K) -> K::Output {
        kernel.run::<V8>()
    }

    #[target_feature(enable = "avx2,fma")]
    pub fn avx2<K: Kernel>(kernel: K) -> K::Output {
        kernel.run::<V4>()
    }
}
