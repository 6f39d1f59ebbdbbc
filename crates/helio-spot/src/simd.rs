//! One body, compiled for each instruction set.
//!
//! Everything done in such a body is whole-number arithmetic, so each set gives the same answer.
#![allow(unsafe_code)]

/// Work that gains from wider instructions.
///
/// Mark `run`, and all that it calls in its loops, `#[inline(always)]`: only what is inlined is
/// compiled for the instruction set.
pub(crate) trait Kernel {
    /// What it answers.
    type Output;
    /// Does the work.
    fn run(self) -> Self::Output;
}

/// Instruction sets, slowest first.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) enum Level {
    /// What the build was made for.
    Plain,
    /// x86-64 AVX2.
    #[cfg(target_arch = "x86_64")]
    Avx2,
    /// x86-64 AVX-512 (F, BW, DQ, VL).
    #[cfg(target_arch = "x86_64")]
    Avx512,
}

impl Level {
    /// The fastest that this processor has.
    pub(crate) fn best() -> Self {
        #[cfg(target_arch = "x86_64")]
        {
            use std::arch::is_x86_feature_detected as has;
            if has!("avx2") {
                if has!("avx512f") && has!("avx512bw") && has!("avx512dq") && has!("avx512vl") {
                    return Self::Avx512;
                }
                return Self::Avx2;
            }
        }
        Self::Plain
    }
}

/// Runs a kernel on an instruction set, or on the best there is below it.
pub(crate) fn run_at<K: Kernel>(level: Level, kernel: K) -> K::Output {
    match level.min(Level::best()) {
        #[cfg(target_arch = "x86_64")]
        // SAFETY: `Level::best` found these instructions on this processor.
        Level::Avx512 => unsafe { x86::avx512(kernel) },
        #[cfg(target_arch = "x86_64")]
        // SAFETY: as above.
        Level::Avx2 => unsafe { x86::avx2(kernel) },
        Level::Plain => kernel.run(),
    }
}

#[cfg(target_arch = "x86_64")]
mod x86 {
    use super::Kernel;

    #[target_feature(enable = "avx512f,avx512bw,avx512dq,avx512vl,avx2")]
    pub(super) fn avx512<K: Kernel>(kernel: K) -> K::Output {
        kernel.run()
    }

    #[target_feature(enable = "avx2")]
    pub(super) fn avx2<K: Kernel>(kernel: K) -> K::Output {
        kernel.run()
    }
}
