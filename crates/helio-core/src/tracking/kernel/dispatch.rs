//! One body, compiled for each instruction set, and the choice between them.
#![allow(unsafe_code)]

use super::limits::{LimitSource, Limits, PerHeliostat, Uniform, Unlimited};
use super::normal::{Approximate, Exact, Iterated, OffsetSource};
use super::pose_errors::{NoPoseErrors, PoseErrorSource, WithPoseErrors};
use super::{AnySun, Job, PresentRows, Rows, Scratch, SunSource};
use crate::frame::EnuUnit;
use crate::lanes::math::sin_cos;
use crate::lanes::{BLOCK, Kernel, Lanes, SimdLevel, run};
use crate::offset::OffsetForm;
use crate::tracking::prepared::Prepared;

/// Some rows of a field, for one sun.
pub(crate) struct Call<'a> {
    pub prepared: &'a Prepared,
    /// Row of the field at which the answer begins: a multiple of [`BLOCK`].
    pub first: usize,
    /// Present axis angles of the same rows.
    pub present: Option<PresentRows<'a>>,
    /// Must be available on this processor.
    pub level: SimdLevel,
    /// Write past the caches; the answer's columns are aligned to 64 bytes.
    pub stream: bool,
}

impl Call<'_> {
    /// Computes all rows of `out`. True if one lies outside its limits.
    pub(crate) fn track(
        &self,
        form: OffsetForm,
        sun: EnuUnit,
        scratch: &mut Scratch,
        out: &mut Rows<'_>,
    ) -> bool {
        match form {
            OffsetForm::Exact => self.with_offset(Exact, sun, scratch, out),
            OffsetForm::Approximate => self.with_offset(Approximate, sun, scratch, out),
            OffsetForm::Iterated(count) => self.with_offset(Iterated(count), sun, scratch, out),
            OffsetForm::None => self.with_offset(Iterated(0), sun, scratch, out),
        }
    }

    fn with_offset<O: OffsetSource>(
        &self,
        offset: O,
        sun: EnuUnit,
        scratch: &mut Scratch,
        out: &mut Rows<'_>,
    ) -> bool {
        match &self.prepared.limits {
            Limits::None => self.with_limits(offset, Unlimited, NoPoseErrors, sun, scratch, out),
            Limits::Uniform(values) => {
                self.with_limits(offset, Uniform(values), NoPoseErrors, sun, scratch, out)
            }
            Limits::PerHeliostat(columns) if self.prepared.pose_errors.is_empty() => self
                .with_limits(
                    offset,
                    PerHeliostat(columns),
                    NoPoseErrors,
                    sun,
                    scratch,
                    out,
                ),
            Limits::PerHeliostat(columns) => {
                let pose_errors = WithPoseErrors(&self.prepared.pose_errors);
                self.with_limits(
                    offset,
                    PerHeliostat(columns),
                    pose_errors,
                    sun,
                    scratch,
                    out,
                )
            }
        }
    }

    fn with_limits<O: OffsetSource, M: LimitSource, G: PoseErrorSource>(
        &self,
        offset: O,
        limits: M,
        pose_errors: G,
        sun: EnuUnit,
        scratch: &mut Scratch,
        out: &mut Rows<'_>,
    ) -> bool {
        let prepared = self.prepared;
        let constants = &prepared.constants;
        match self.prepared.sun(sun) {
            AnySun::Shared(sun) => self.run(
                Job {
                    prepared,
                    constants,
                    offset,
                    limits,
                    sun,
                    pose_errors,
                },
                scratch,
                out,
            ),
            AnySun::Turned(sun) => self.run(
                Job {
                    prepared,
                    constants,
                    offset,
                    limits,
                    sun,
                    pose_errors,
                },
                scratch,
                out,
            ),
        }
    }

    fn run<O: OffsetSource, M: LimitSource, S: SunSource, G: PoseErrorSource>(
        &self,
        job: Job<'_, O, M, S, G>,
        scratch: &mut Scratch,
        out: &mut Rows<'_>,
    ) -> bool {
        match (self.level, self.stream) {
            #[cfg(target_arch = "x86_64")]
            // SAFETY: `Tracker` accepts a level only if `SimdLevel::available` lists it.
            (SimdLevel::Avx512, false) => unsafe {
                x86::avx512(job, self.first, self.present, scratch, out)
            },
            #[cfg(target_arch = "x86_64")]
            // SAFETY: as above.
            (SimdLevel::Avx512, true) => unsafe {
                x86::avx512_stream(job, self.first, self.present, scratch, out)
            },
            #[cfg(target_arch = "x86_64")]
            // SAFETY: as above.
            (SimdLevel::Avx2, _) => unsafe {
                x86::avx2(job, self.first, self.present, scratch, out)
            },
            _ => job.run::<f64, false>(self.first, self.present, scratch, out),
        }
    }
}

#[cfg(target_arch = "x86_64")]
mod x86 {
    use super::{
        Job, LimitSource, OffsetSource, PoseErrorSource, PresentRows, Rows, Scratch, SunSource,
    };
    use crate::lanes::x86::{V4, V8};

    #[target_feature(enable = "avx512f,avx512vl,avx512dq,avx2,fma")]
    pub fn avx512<O: OffsetSource, M: LimitSource, S: SunSource, G: PoseErrorSource>(
        job: Job<'_, O, M, S, G>,
        first: usize,
        present: Option<PresentRows<'_>>,
        scratch: &mut Scratch,
        out: &mut Rows<'_>,
    ) -> bool {
        job.run::<V8, false>(first, present, scratch, out)
    }

    #[target_feature(enable = "avx512f,avx512vl,avx512dq,avx2,fma")]
    pub fn avx512_stream<O: OffsetSource, M: LimitSource, S: SunSource, G: PoseErrorSource>(
        job: Job<'_, O, M, S, G>,
        first: usize,
        present: Option<PresentRows<'_>>,
        scratch: &mut Scratch,
        out: &mut Rows<'_>,
    ) -> bool {
        let any_outside = job.run::<V8, true>(first, present, scratch, out);
        core::arch::x86_64::_mm_sfence();
        any_outside
    }

    #[target_feature(enable = "avx2,fma")]
    pub fn avx2<O: OffsetSource, M: LimitSource, S: SunSource, G: PoseErrorSource>(
        job: Job<'_, O, M, S, G>,
        first: usize,
        present: Option<PresentRows<'_>>,
        scratch: &mut Scratch,
        out: &mut Rows<'_>,
    ) -> bool {
        job.run::<V4, false>(first, present, scratch, out)
    }
}

/// Normals along the mount's axes for encoder angles, one entry per heliostat.
pub(crate) fn forward_rows(
    prepared: &Prepared,
    level: SimdLevel,
    axis1: &[f64],
    axis2: &[f64],
    out: &mut [[f64; 3]],
) {
    let axes = [axis1, axis2];
    if prepared.pose_errors.is_empty() {
        let pose_errors = NoPoseErrors;
        run(
            level,
            Forward {
                prepared,
                pose_errors,
                axes,
                out,
            },
        );
    } else {
        let pose_errors = WithPoseErrors(&prepared.pose_errors);
        run(
            level,
            Forward {
                prepared,
                pose_errors,
                axes,
                out,
            },
        );
    }
}

struct Forward<'a, G> {
    prepared: &'a Prepared,
    pose_errors: G,
    axes: [&'a [f64]; 2],
    out: &'a mut [[f64; 3]],
}

impl<G: PoseErrorSource> Kernel for Forward<'_, G> {
    type Output = ();

    #[inline(always)]
    fn run<L: Lanes>(self) {
        let Self {
            prepared,
            pose_errors,
            axes: [axis1, axis2],
            out,
        } = self;
        let mut start = 0;
        while start < out.len() {
            let count = L::WIDTH.min(out.len() - start);
            let mut side = [[0.0; BLOCK]; 2];
            for (lane, row) in (start..start + count).enumerate() {
                let [reference1, reference2] = prepared.references[row];
                side[0][lane] = axis1[row] - reference1;
                side[1][lane] = axis2[row] - reference2;
            }
            let (block, lane) = (start / BLOCK, start % BLOCK);
            let (sin_gamma, cos_gamma) = sin_cos(L::read(&side[0]));
            let (sin_alpha, cos_alpha) = sin_cos(L::read(&side[1]));
            let mut angles = [[cos_gamma, sin_gamma], [cos_alpha, sin_alpha]];
            if G::ANY {
                let [gamma, alpha] = angles;
                angles = pose_errors.load::<L>(block, lane).settle(gamma, alpha);
            }
            let normal = super::mount::forward::<L>(&prepared.constants[block], lane, angles);
            let mut columns = [[0.0; BLOCK]; 3];
            for (component, column) in normal.into_iter().zip(&mut columns) {
                component.write(column);
            }
            for (lane, row) in out[start..start + count].iter_mut().enumerate() {
                *row = [columns[0][lane], columns[1][lane], columns[2][lane]];
            }
            start += count;
        }
    }
}
