//! Sun and aim in, axis angles out, for a whole field; and back.

mod aligned;
mod columns;
mod forward;
pub(crate) mod kernel;
pub(crate) mod prepared;

use alloc::boxed::Box;
use alloc::vec::Vec;
use core::ops::Range;

use aligned::AlignedColumn;
pub use columns::{TrackScratch, TrackingColumns};
pub use forward::Prediction;
use kernel::{PresentRows, Rows, Scratch};
use prepared::{Prepared, TILE};

use crate::error::TrackError;
use crate::field::Field;
use crate::frame::EnuUnit;
use crate::lanes::SimdLevel;
use crate::lanes::math::MAX_ANGLE_RAD;
use crate::offset::{MAX_ITERATIONS, OffsetForm};
use crate::status::Status;

/// Rows that are worth a second thread: below, waking it costs more than it earns.
const ROWS_PER_THREAD: usize = 24 * 1024;

/// Heliostats whose constants stay in the nearest caches while several suns pass over them.
const ROWS_PER_PASS: usize = 512;

/// Output bytes from which an answer will not stay in the caches anyway and is written past them.
const STREAM_BYTES: usize = 12 << 20;

/// How a batch is computed. Nothing here changes a bit of the answer.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct TrackOptions {
    /// Most threads to use; 0 for as many as the thread pool has. Small fields stay on one.
    pub threads: usize,
    /// Instruction set; `None` for the best that the processor has.
    pub level: Option<SimdLevel>,
}

/// Where the axes stand now, one entry per heliostat \[rad, encoder angles\]; NaN where not known.
#[derive(Debug, Clone, Copy)]
pub struct Present<'a> {
    /// First axis.
    pub axis1_rad: &'a [f64],
    /// Second axis.
    pub axis2_rad: &'a [f64],
}

/// Axis angles of a field for one or more suns, as columns.
///
/// Every column has `suns() * heliostats()` rows: sun by sun, heliostats in field order. A row whose
/// status is not [`Status::Ok`] keeps its place and has NaN for angles and incidence.
#[derive(Debug, Clone, Default)]
pub struct Tracking {
    suns: usize,
    heliostats: usize,
    axis1: AlignedColumn,
    axis2: AlignedColumn,
    incidence: AlignedColumn,
    limit_excess: AlignedColumn,
    status: Vec<Status>,
    /// True if a row of `limit_excess` is not zero.
    any_outside: bool,
    /// Kept with the buffer: clearing it anew would cost a small field several percent.
    scratch: Option<Box<Scratch>>,
}

impl Tracking {
    /// Number of suns.
    #[must_use]
    pub fn suns(&self) -> usize {
        self.suns
    }

    /// Number of heliostats.
    #[must_use]
    pub fn heliostats(&self) -> usize {
        self.heliostats
    }

    /// Encoder angle of the first axis \[rad\].
    #[must_use]
    pub fn axis1_rad(&self) -> &[f64] {
        self.axis1.as_slice()
    }

    /// Encoder angle of the second axis \[rad\].
    #[must_use]
    pub fn axis2_rad(&self) -> &[f64] {
        self.axis2.as_slice()
    }

    /// Half the angle between sun and aim as seen from the pivot \[rad\].
    #[must_use]
    pub fn incidence_rad(&self) -> &[f64] {
        self.incidence.as_slice()
    }

    /// How far the better solution lies outside the axis limits \[rad\]: the larger excess of its two
    /// axes; zero unless the status is [`Status::OutsideLimits`].
    #[must_use]
    pub fn limit_excess_rad(&self) -> &[f64] {
        self.limit_excess.as_slice()
    }

    /// What became of each row.
    #[must_use]
    pub fn status(&self) -> &[Status] {
        &self.status
    }

    /// Rows of one sun.
    #[must_use]
    pub fn rows_of_sun(&self, sun: usize) -> Range<usize> {
        sun * self.heliostats..(sun + 1) * self.heliostats
    }

    fn resize(&mut self, suns: usize, heliostats: usize) {
        let len = suns * heliostats;
        if self.any_outside || self.limit_excess.as_slice().len() != len {
            self.limit_excess.clear_to(len);
            self.any_outside = false;
        }
        (self.suns, self.heliostats) = (suns, heliostats);
        self.axis1.resize(len);
        self.axis2.resize(len);
        self.incidence.resize(len);
        self.status.resize(len, Status::Ok);
    }

    fn rows(&mut self) -> Rows<'_> {
        Rows {
            axis1: self.axis1.as_mut_slice(),
            axis2: self.axis2.as_mut_slice(),
            incidence: self.incidence.as_mut_slice(),
            limit_excess: self.limit_excess.as_mut_slice(),
            status: &mut self.status,
        }
    }
}

/// A field made ready for tracking: the constants of every heliostat, computed once.
///
/// ```
/// use helio_core::{Enu, EnuUnit, Field, Heliostat, OffsetForm, Status, Tracker, TrackingMode};
/// let mut field = Field::new(TrackingMode::AzimuthElevation);
/// // 100 m north of a receiver 80 m above its pivot, mirror 20 cm in front of the axes
/// let mut heliostat = Heliostat::new(Enu::new(0.0, 100.0, 0.0), Enu::new(0.0, 0.0, 80.0));
/// heliostat.mirror_offset_m = 0.2;
/// field.push("A1", heliostat)?;
/// let tracker = Tracker::new(&field, OffsetForm::Exact)?;
/// let sun = EnuUnit::from_azimuth_elevation(180_f64.to_radians(), 45_f64.to_radians());
/// let tracking = tracker.track(sun);
/// assert_eq!(tracking.status(), [Status::Ok]);
/// // Sun and aim both stand in the south: so does the normal.
/// assert!((tracking.axis1_rad()[0].to_degrees() - 180.0).abs() < 1e-12);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Debug, Clone)]
pub struct Tracker {
    prepared: Prepared,
    offset: OffsetForm,
}

impl Tracker {
    /// Computes the constants of every heliostat of a field (Guo 2015 §3.2: A, L, t).
    ///
    /// # Errors
    /// [`TrackError::Iterations`] for an iterated offset form with none or too many iterations.
    pub fn new(field: &Field, offset: OffsetForm) -> Result<Self, TrackError> {
        if let OffsetForm::Iterated(got) = offset
            && !(1..=MAX_ITERATIONS).contains(&got)
        {
            let max = MAX_ITERATIONS;
            return Err(TrackError::Iterations { max, got });
        }
        Ok(Self {
            prepared: Prepared::new(field),
            offset,
        })
    }

    /// Number of heliostats.
    #[must_use]
    pub fn len(&self) -> usize {
        self.prepared.len
    }

    /// True if there is none.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// How the mirror offset is taken into account.
    #[must_use]
    pub fn offset(&self) -> OffsetForm {
        self.offset
    }

    /// Axis angles of every heliostat for one sun. See [`track_into`](Self::track_into); a sun made
    /// from angles that are not finite counts as below the horizon here.
    #[must_use]
    pub fn track(&self, sun: EnuUnit) -> Tracking {
        let mut out = Tracking::default();
        let options = TrackOptions::default();
        self.fill_tracking(&[sun], None, SimdLevel::best(), options.threads, &mut out);
        out
    }

    /// Axis angles of every heliostat for each of some suns, into a buffer that may be reused.
    ///
    /// Of the two solutions the direct one is given where it lies within the axis limits, else the
    /// one over the top; an angle that may be reached by several turns is given nearest to the
    /// middle of its limits. With `present`, of all that lie within the limits the one is given
    /// for which the axis that travels farther has the shortest way, first from `present`, then
    /// from one sun to the next; a row that is not ok leaves its heliostat where it was, and an axis
    /// whose place is not known (NaN) counts as having no way to go. A heliostat without any limit
    /// keeps to the direct solution and turns on beyond a full turn. Where the normal stands on the
    /// fixed axis of a perfect mount, and any angle of axis 1 will do, it stays where it is.
    ///
    /// A sun below the horizon (its given direction points below) makes all its rows
    /// [`Status::SunBelowHorizon`].
    ///
    /// # Errors
    /// [`TrackError::LengthMismatch`] if `present` has another length than the field,
    /// [`TrackError::BadAngle`] if an angle of it is infinite or beyond ±1e5 rad,
    /// [`TrackError::BadSun`] for a sun made from angles that are not finite,
    /// [`TrackError::LevelUnavailable`] for an instruction set that this processor lacks.
    pub fn track_into(
        &self,
        suns: &[EnuUnit],
        present: Option<Present<'_>>,
        options: &TrackOptions,
        out: &mut Tracking,
    ) -> Result<(), TrackError> {
        let level = check_call(self, suns, present, options)?;
        self.fill_tracking(suns, present, level, options.threads, out);
        Ok(())
    }

    fn fill_tracking(
        &self,
        suns: &[EnuUnit],
        present: Option<Present<'_>>,
        level: SimdLevel,
        threads: usize,
        out: &mut Tracking,
    ) {
        out.resize(suns.len(), self.len());
        if self.is_empty() || suns.is_empty() {
            return;
        }
        let mut scratch = out.scratch.take().unwrap_or_default();
        out.any_outside = self.fill(suns, present, level, threads, &mut scratch, out.rows());
        out.scratch = Some(scratch);
    }

    /// True if any row lies outside its limits.
    fn fill(
        &self,
        suns: &[EnuUnit],
        present: Option<Present<'_>>,
        level: SimdLevel,
        threads: usize,
        scratch: &mut Scratch,
        rows: Rows<'_>,
    ) -> bool {
        let n = self.len();
        if n == 0 || suns.is_empty() {
            return false;
        }
        let mut call = Call {
            tracker: self,
            level,
            stream: false,
        };
        if let Some(present) = present {
            return call.continuous(suns, present, scratch, rows);
        }
        // Streaming wants every sun's columns to begin on a cache line.
        let aligned = rows.are_aligned() && (suns.len() == 1 || n.is_multiple_of(8));
        call.stream = aligned && n * suns.len() * 3 * size_of::<f64>() >= STREAM_BYTES;
        let pieces = pieces(n * suns.len(), threads);
        if suns.len() >= pieces {
            return in_parallel(
                pieces,
                suns.len(),
                1,
                n,
                scratch,
                rows,
                &|range: Range<usize>, scratch, rows| call.suns(&suns[range], 0, n, scratch, rows),
            );
        }
        let mut rest = rows;
        let mut any_outside = false;
        for &sun in suns {
            let (rows, others) = rest.split_at(n);
            rest = others;
            any_outside |= in_parallel(
                pieces,
                n,
                TILE,
                1,
                scratch,
                rows,
                &|range: Range<usize>, scratch, rows| {
                    call.suns(&[sun], range.start, range.len(), scratch, rows)
                },
            );
        }
        any_outside
    }
}

/// One batch, on one thread.
#[derive(Clone, Copy)]
struct Call<'a> {
    tracker: &'a Tracker,
    level: SimdLevel,
    stream: bool,
}

impl Call<'_> {
    /// `count` heliostats from `first` for some suns; `rows` holds them sun by sun.
    fn suns(
        &self,
        suns: &[EnuUnit],
        first: usize,
        count: usize,
        scratch: &mut Scratch,
        mut rows: Rows<'_>,
    ) -> bool {
        let mut any_outside = false;
        let per_pass = if suns.len() == 1 {
            count
        } else {
            ROWS_PER_PASS
        };
        let mut start = 0;
        while start < count {
            let len = per_pass.min(count - start);
            for (index, &sun) in suns.iter().enumerate() {
                let part = rows.part(index * count + start, len);
                any_outside |= self.one(sun, first + start, None, scratch, part);
            }
            start += len;
        }
        any_outside
    }

    fn one(
        &self,
        sun: EnuUnit,
        first: usize,
        present: Option<PresentRows<'_>>,
        scratch: &mut Scratch,
        mut rows: Rows<'_>,
    ) -> bool {
        if !is_up(sun) {
            for column in [&mut rows.axis1, &mut rows.axis2, &mut rows.incidence] {
                column.fill(f64::NAN);
            }
            rows.status.fill(Status::SunBelowHorizon);
            return false;
        }
        let Tracker { prepared, offset } = self.tracker;
        let Self { level, stream, .. } = *self;
        let call = kernel::dispatch::Call {
            prepared,
            first,
            present,
            level,
            stream,
        };
        call.track(*offset, sun, scratch, &mut rows)
    }

    /// Each sun from where the one before left the axes.
    fn continuous(
        &self,
        suns: &[EnuUnit],
        present: Present<'_>,
        scratch: &mut Scratch,
        mut rows: Rows<'_>,
    ) -> bool {
        let n = self.tracker.len();
        let mut axis1 = present.axis1_rad.to_vec();
        let mut axis2 = present.axis2_rad.to_vec();
        let mut any_outside = false;
        for (index, &sun) in suns.iter().enumerate() {
            let here = PresentRows {
                axis1: &axis1,
                axis2: &axis2,
            };
            any_outside |= self.one(sun, 0, Some(here), scratch, rows.part(index * n, n));
            let done = rows.part(index * n, n);
            for row in 0..n {
                if done.status[row] == Status::Ok {
                    axis1[row] = done.axis1[row];
                    axis2[row] = done.axis2[row];
                }
            }
        }
        any_outside
    }
}

/// How many pieces a batch is worth.
fn pieces(rows: usize, threads: usize) -> usize {
    let most = (rows / ROWS_PER_THREAD).max(1);
    if most == 1 {
        return 1;
    }
    #[cfg(feature = "std")]
    let available = if threads == 0 {
        rayon::current_num_threads()
    } else {
        threads
    };
    #[cfg(not(feature = "std"))]
    let available = threads.min(1);
    most.min(available.max(1))
}

/// Runs `work` on `pieces` consecutive ranges of `0..count`, each but the last a multiple of
/// `multiple` long; entry i owns rows `i * width..(i + 1) * width`. True if any piece says so.
fn in_parallel(
    pieces: usize,
    count: usize,
    multiple: usize,
    width: usize,
    scratch: &mut Scratch,
    rows: Rows<'_>,
    work: &(dyn Fn(Range<usize>, &mut Scratch, Rows<'_>) -> bool + Sync),
) -> bool {
    #[cfg(feature = "std")]
    if pieces > 1 {
        use core::sync::atomic::{AtomicBool, Ordering};
        let any = AtomicBool::new(false);
        let length = count.div_ceil(pieces).next_multiple_of(multiple);
        rayon::in_place_scope(|scope| {
            let (mine, mut rest) = rows.split_at(length.min(count) * width);
            let mut start = length.min(count);
            while start < count {
                let end = count.min(start + length);
                let (piece, others) = rest.split_at((end - start) * width);
                rest = others;
                let any = &any;
                scope.spawn(move |_| {
                    if work(start..end, &mut Scratch::default(), piece) {
                        any.store(true, Ordering::Relaxed);
                    }
                });
                start = end;
            }
            if work(0..length.min(count), scratch, mine) {
                any.store(true, Ordering::Relaxed);
            }
        });
        return any.load(Ordering::Relaxed);
    }
    let _ = (pieces, multiple, width);
    work(0..count, scratch, rows)
}

/// Refuses a wrong call; the instruction set to use otherwise.
fn check_call(
    tracker: &Tracker,
    suns: &[EnuUnit],
    present: Option<Present<'_>>,
    options: &TrackOptions,
) -> Result<SimdLevel, TrackError> {
    let level = checked_level(options.level)?;
    check_suns(suns)?;
    if let Some(present) = present {
        for (what, column) in [
            ("present axis1_rad", present.axis1_rad),
            ("present axis2_rad", present.axis2_rad),
        ] {
            check_len(what, tracker.len(), column.len())?;
            check_angles(what, column, true)?;
        }
    }
    Ok(level)
}

fn checked_level(level: Option<SimdLevel>) -> Result<SimdLevel, TrackError> {
    match level {
        None => Ok(SimdLevel::best()),
        Some(level) if SimdLevel::available().contains(&level) => Ok(level),
        Some(level) => Err(TrackError::LevelUnavailable { level }),
    }
}

/// True for a sun on or above the horizon; false for one that is no direction at all.
fn is_up(sun: EnuUnit) -> bool {
    sun.as_enu().is_finite() && sun.as_enu().up >= 0.0
}

fn check_suns(suns: &[EnuUnit]) -> Result<(), TrackError> {
    match suns.iter().position(|sun| !sun.as_enu().is_finite()) {
        None => Ok(()),
        Some(row) => Err(TrackError::BadSun { row }),
    }
}

/// Refuses angles that are infinite or too large to have a direction; NaN only if it may stand for
/// "not known".
fn check_angles(what: &'static str, column: &[f64], nan_allowed: bool) -> Result<(), TrackError> {
    let good = |angle: &f64| angle.abs() <= MAX_ANGLE_RAD || (nan_allowed && angle.is_nan());
    match column.iter().position(|angle| !good(angle)) {
        None => Ok(()),
        Some(row) => Err(TrackError::BadAngle {
            what,
            row,
            limit: MAX_ANGLE_RAD,
            value: column[row],
        }),
    }
}

#[cold]
fn length_mismatch(what: &'static str, expected: usize, got: usize) -> TrackError {
    TrackError::LengthMismatch {
        what,
        expected,
        got,
    }
}

fn check_len(what: &'static str, expected: usize, got: usize) -> Result<(), TrackError> {
    if expected == got {
        Ok(())
    } else {
        Err(length_mismatch(what, expected, got))
    }
}

#[cfg(test)]
mod tests {
    use core::f64::consts::TAU;

    use super::*;
    use crate::field::Heliostat;
    use crate::frame::Enu;
    use crate::mount::{AxisLimits, TrackingMode};

    /// A perfect mount under its aim, with axis 1 limited.
    fn face_up(min_rad: f64, max_rad: f64) -> Tracker {
        let mut heliostat = Heliostat::new(Enu::default(), Enu::new(0.0, 0.0, 50.0));
        heliostat.limits.axis1_min_rad = min_rad;
        heliostat.limits.axis1_max_rad = max_rad;
        let mut field = Field::new(TrackingMode::AzimuthElevation);
        field.push("A", heliostat).unwrap();
        Tracker::new(&field, OffsetForm::Exact).unwrap()
    }

    #[test]
    fn face_up_on_a_perfect_mount_the_first_axis_stays_or_goes_just_inside() {
        let tracker = face_up(1.0, 2.0);
        let got = tracker.track(EnuUnit::UP);
        assert_eq!(got.status(), [Status::Ok]);
        assert!((1.0..=2.0).contains(&got.axis1_rad()[0]));
        for (now, want) in [(1.7, 1.7), (2.5, 2.0), (-9.0, 1.0)] {
            let present = Present {
                axis1_rad: &[now],
                axis2_rad: &[1.5],
            };
            let mut out = Tracking::default();
            let options = TrackOptions::default();
            tracker
                .track_into(&[EnuUnit::UP], Some(present), &options, &mut out)
                .unwrap();
            assert_eq!(out.status(), [Status::Ok]);
            assert!(
                (out.axis1_rad()[0] - want).abs() < 2e-12,
                "{now}: {}",
                out.axis1_rad()[0]
            );
        }
    }

    #[test]
    fn a_sun_that_is_no_direction_is_refused_and_never_answered() {
        let tracker = face_up(f64::NEG_INFINITY, f64::INFINITY);
        for (azimuth, elevation) in [(f64::NAN, 0.3), (0.3, f64::NAN), (f64::INFINITY, 0.3)] {
            let sun = EnuUnit::from_azimuth_elevation(azimuth, elevation);
            let options = TrackOptions::default();
            let mut out = Tracking::default();
            let refused = tracker.track_into(&[EnuUnit::UP, sun], None, &options, &mut out);
            assert_eq!(refused, Err(TrackError::BadSun { row: 1 }));
            assert_eq!(tracker.track(sun).status(), [Status::SunBelowHorizon]);
        }
    }

    #[test]
    fn an_axis_whose_place_is_not_known_counts_as_having_no_way_to_go() {
        let mut heliostat = Heliostat::new(Enu::default(), Enu::new(0.0, 100.0, 30.0));
        heliostat.limits = AxisLimits {
            axis1_min_rad: -4.0,
            axis1_max_rad: 4.0,
            axis2_min_rad: -0.5,
            axis2_max_rad: 3.5,
        };
        let mut field = Field::new(TrackingMode::AzimuthElevation);
        field.push("A", heliostat).unwrap();
        let tracker = Tracker::new(&field, OffsetForm::Exact).unwrap();
        let sun = EnuUnit::from_azimuth_elevation(0.3, 0.6);
        let direct = tracker.track(sun);
        let (axis1, axis2) = (direct.axis1_rad()[0], direct.axis2_rad()[0]);
        // Where the other solution stands: half a turn on, over the top.
        let over = [axis1 + core::f64::consts::PI, core::f64::consts::PI - axis2];
        for present in [[over[0], f64::NAN], [f64::NAN, over[1]], over] {
            let mut out = Tracking::default();
            let present = Present {
                axis1_rad: &present[..1],
                axis2_rad: &present[1..],
            };
            let options = TrackOptions::default();
            tracker
                .track_into(&[sun], Some(present), &options, &mut out)
                .unwrap();
            assert!((out.axis2_rad()[0] - over[1]).abs() < 1e-9, "{present:?}");
        }
    }

    // Beside a limited heliostat an unlimited one goes by another path. Reference: that of a field of
    // its own; every angle lies in [0, 2π), as near to its ends as can be.
    #[test]
    fn a_free_axis_is_given_the_same_beside_a_limited_one() {
        let sun = EnuUnit::from_azimuth_elevation(2.1, 0.6);
        let mut free = Heliostat::new(Enu::default(), Enu::new(30.0, 100.0, 30.0));
        free.errors.mirror_tilt_rad = 0.01;
        let mut limited = free;
        limited.limits.axis1_min_rad = -1.0;
        limited.limits.axis1_max_rad = 5.5;
        let track = |heliostats: &[Heliostat]| {
            let mut field = Field::new(TrackingMode::AzimuthElevation);
            for (number, heliostat) in heliostats.iter().enumerate() {
                field.push(&number.to_string(), *heliostat).unwrap();
            }
            Tracker::new(&field, OffsetForm::Exact).unwrap().track(sun)
        };
        let from_zero = track(&[free]).axis1_rad()[0];
        for exponent in 0..=40 {
            for turns in [0.0, -3.0, 50.0, 1e3, -2e4, 3e6] {
                for sign in [-1.0, 0.0, 1.0] {
                    let apart = sign * 10_f64.powf(-0.4 * f64::from(exponent));
                    free.errors.azimuth_reference_rad = turns * TAU + apart - from_zero;
                    let alone = track(&[free]);
                    let beside = track(&[limited, free]);
                    assert_eq!(beside.status()[1], Status::Ok);
                    let angle = beside.axis1_rad()[1];
                    assert_eq!(
                        angle.to_bits(),
                        alone.axis1_rad()[0].to_bits(),
                        "{turns} {apart:e}"
                    );
                    assert!((0.0..TAU).contains(&angle), "{turns} {apart:e}");
                }
            }
        }
        // Limits on one side, or a whole turn apart, that begin where the angle is: nothing is excluded.
        free.errors.azimuth_reference_rad = 0.0;
        for turns in [0.0, 3.0, 50.0, 1e3, 1.5e4] {
            for ulps in -20..=20_i64 {
                let begin = from_zero + turns * TAU;
                let begin = f64::from_bits(begin.to_bits().wrapping_add_signed(ulps));
                for (min_rad, max_rad) in [
                    (begin, f64::INFINITY),
                    (f64::NEG_INFINITY, begin),
                    (begin, begin + TAU * (1.0 + f64::EPSILON) + 1e-10),
                ] {
                    let mut one = free;
                    one.limits.axis1_min_rad = min_rad;
                    one.limits.axis1_max_rad = max_rad;
                    let got = track(&[one, limited]);
                    assert_eq!(got.status()[0], Status::Ok, "{min_rad} {max_rad}");
                    let angle = got.axis1_rad()[0];
                    let rounding = 4.0 * f64::EPSILON * angle.abs();
                    assert!(
                        min_rad - rounding <= angle && angle <= max_rad + rounding,
                        "{angle}: {min_rad} {max_rad}"
                    );
                }
            }
        }
    }
}
