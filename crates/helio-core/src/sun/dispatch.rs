//! One body, compiled for each instruction set, and the choice between them.
#![allow(unsafe_code)]

use super::kernel::Job;
use super::position::Columns;
use crate::lanes::SimdLevel;

/// `level` must be available on this processor.
pub(super) fn run(job: Job<'_>, level: SimdLevel, unix_ns: &[i64], out: &mut Columns<'_>) {
    match level {
        #[cfg(target_arch = "x86_64")]
        // SAFETY: `SunEphemeris` accepts a level only if `SimdLevel::available` lists it.
        SimdLevel::Avx512 => unsafe { x86::avx512(job, unix_ns, out) },
        #[cfg(target_arch = "x86_64")]
        // SAFETY: as above.
        SimdLevel::Avx2 => unsafe { x86::avx2(job, unix_ns, out) },
        _ => job.run::<f64, f64>(unix_ns, out),
    }
}

#[cfg(target_arch = "x86_64")]
mod x86 {
    use super::{Columns, Job};
    use crate::lanes::x86::{V4, V8};
    use crate::lanes::{Pack2, Pack4};

    #[target_feature(enable = "avx512f,avx512vl,avx512dq,avx2,fma")]
    pub fn avx512(job: Job<'_>, unix_ns: &[i64], out: &mut Columns<'_>) {
        job.run::<V8, Pack4<V8>>(unix_ns, out);
    }

    #[target_feature(enable = "avx2,fma")]
    pub fn avx2(job: Job<'_>, unix_ns: &[i64], out: &mut Columns<'_>) {
        job.run::<V4, Pack2<V4>>(unix_ns, out);
    }
}
