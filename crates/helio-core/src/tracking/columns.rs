//! Answers in memory of the caller's.

use alloc::boxed::Box;

use super::kernel::{Rows, Scratch};
use super::{Present, TrackOptions, Tracker, check_call, check_len};
use crate::error::TrackError;
use crate::frame::EnuUnit;
use crate::status::Status;

/// Columns that [`Tracker::track_columns`] fills: `suns * heliostats` rows each, sun by sun, heliostats
/// in field order.
#[derive(Debug)]
pub struct TrackingColumns<'a> {
    /// Encoder angle of the first axis \[rad\].
    pub axis1_rad: &'a mut [f64],
    /// Encoder angle of the second axis \[rad\].
    pub axis2_rad: &'a mut [f64],
    /// Half the angle between sun and aim as seen from the pivot \[rad\].
    pub incidence_rad: &'a mut [f64],
    /// How far the better solution lies outside the axis limits \[rad\]. Only rows outside are
    /// written: it must be zero before.
    pub limit_excess_rad: &'a mut [f64],
    /// What became of each row.
    pub status: &'a mut [Status],
}

/// Room that a kernel works in, to be used again by the next call. Nothing is carried from one to the
/// next; making it anew costs a small field several percent.
#[derive(Debug, Clone, Default)]
pub struct TrackScratch(Box<Scratch>);

impl Tracker {
    /// What [`track_into`](Self::track_into) computes, bit for bit, into columns of the caller's, for
    /// languages whose arrays live elsewhere. Columns that begin at multiples of 64 bytes are written
    /// faster when they are long. True if any row lies outside its limits, so that
    /// `limit_excess_rad` is not all zero.
    ///
    /// ```
    /// use helio_core::tracking::{TrackScratch, TrackingColumns};
    /// use helio_core::{Enu, EnuUnit, Field, Heliostat, OffsetForm, Status, Tracker, TrackingMode};
    /// let mut field = Field::new(TrackingMode::AzimuthElevation);
    /// field.push("A1", Heliostat::new(Enu::default(), Enu::new(0.0, 90.0, 30.0)))?;
    /// let tracker = Tracker::new(&field, OffsetForm::Exact)?;
    /// let sun = EnuUnit::from_azimuth_elevation(3.0, 0.8);
    /// let (mut axis1, mut axis2, mut incidence, mut excess) = ([0.0], [0.0], [0.0], [0.0]);
    /// let mut status = [Status::Ok];
    /// let columns = TrackingColumns {
    ///     axis1_rad: &mut axis1,
    ///     axis2_rad: &mut axis2,
    ///     incidence_rad: &mut incidence,
    ///     limit_excess_rad: &mut excess,
    ///     status: &mut status,
    /// };
    /// let mut scratch = TrackScratch::default();
    /// assert!(!tracker.track_columns(&[sun], None, &Default::default(), &mut scratch, columns)?);
    /// assert_eq!(axis1, tracker.track(sun).axis1_rad());
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    ///
    /// # Errors
    /// As [`track_into`](Self::track_into), and [`TrackError::LengthMismatch`] if a column has another
    /// length than `suns.len() * self.len()`.
    pub fn track_columns(
        &self,
        suns: &[EnuUnit],
        present: Option<Present<'_>>,
        options: &TrackOptions,
        scratch: &mut TrackScratch,
        out: TrackingColumns<'_>,
    ) -> Result<bool, TrackError> {
        let level = check_call(self, suns, present, options)?;
        let rows = suns.len() * self.len();
        for (what, got) in [
            ("axis1_rad", out.axis1_rad.len()),
            ("axis2_rad", out.axis2_rad.len()),
            ("incidence_rad", out.incidence_rad.len()),
            ("limit_excess_rad", out.limit_excess_rad.len()),
            ("status", out.status.len()),
        ] {
            check_len(what, rows, got)?;
        }
        let rows = Rows {
            axis1: out.axis1_rad,
            axis2: out.axis2_rad,
            incidence: out.incidence_rad,
            limit_excess: out.limit_excess_rad,
            status: out.status,
        };
        Ok(self.fill(suns, present, level, options.threads, &mut scratch.0, rows))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{AxisLimits, Enu, Field, Heliostat, OffsetForm, Tracking, TrackingMode};

    fn field(len: usize) -> Field {
        let mut field = Field::new(TrackingMode::AzimuthElevation);
        for row in 0..len {
            let east = 3.0 * row as f64 - 40.0;
            let mut heliostat = Heliostat::new(Enu::new(east, 80.0, 0.0), Enu::new(0.0, 0.0, 50.0));
            heliostat.mirror_offset_m = 0.3;
            if row % 5 == 0 {
                heliostat.limits = AxisLimits {
                    axis1_min_rad: 0.0,
                    axis1_max_rad: 3.0,
                    axis2_min_rad: 0.0,
                    axis2_max_rad: 1.0,
                };
            }
            field.push(&row.to_string(), heliostat).unwrap();
        }
        field
    }

    // 40,000 rows for three suns are streamed and shared among threads where memory is aligned; memory
    // that begins beside a cache line must come out the same.
    #[test]
    fn columns_anywhere_in_memory_have_the_bits_of_track_into() {
        for len in [0, 1, 7, 100, 40_000] {
            let tracker = Tracker::new(&field(len), OffsetForm::Exact).unwrap();
            let suns = [2.8, 3.3, 4.0].map(|a| EnuUnit::from_azimuth_elevation(a, 0.7));
            let options = TrackOptions::default();
            let mut want = Tracking::default();
            tracker
                .track_into(&suns, None, &options, &mut want)
                .unwrap();
            for offset in [0, 1, 3] {
                let rows = suns.len() * len;
                let mut columns = [(); 4].map(|()| alloc::vec![0.0; rows + offset]);
                let mut status = alloc::vec![Status::Ok; rows];
                let [axis1, axis2, incidence, excess] = &mut columns;
                let out = TrackingColumns {
                    axis1_rad: &mut axis1[offset..],
                    axis2_rad: &mut axis2[offset..],
                    incidence_rad: &mut incidence[offset..],
                    limit_excess_rad: &mut excess[offset..],
                    status: &mut status,
                };
                let mut scratch = TrackScratch::default();
                let outside = tracker
                    .track_columns(&suns, None, &options, &mut scratch, out)
                    .unwrap();
                assert_eq!(outside, want.status().contains(&Status::OutsideLimits));
                assert_eq!(status, want.status());
                for (got, want) in columns.iter().zip([
                    want.axis1_rad(),
                    want.axis2_rad(),
                    want.incidence_rad(),
                    want.limit_excess_rad(),
                ]) {
                    let bits = |v: &[f64]| v.iter().map(|x| x.to_bits()).collect::<Vec<_>>();
                    assert_eq!(bits(&got[offset..]), bits(want));
                }
            }
        }
    }

    #[test]
    fn columns_of_another_length_are_refused() {
        let tracker = Tracker::new(&field(2), OffsetForm::Exact).unwrap();
        let (mut a, mut b, mut c, mut d) = ([0.0; 2], [0.0; 2], [0.0; 1], [0.0; 2]);
        let mut status = [Status::Ok; 2];
        let out = TrackingColumns {
            axis1_rad: &mut a,
            axis2_rad: &mut b,
            incidence_rad: &mut c,
            limit_excess_rad: &mut d,
            status: &mut status,
        };
        let options = TrackOptions::default();
        let refused = tracker.track_columns(
            &[EnuUnit::UP],
            None,
            &options,
            &mut TrackScratch::default(),
            out,
        );
        let wanted = "incidence_rad: expected 2 rows (one per heliostat), got 1";
        assert_eq!(refused.unwrap_err().to_string(), wanted);
    }
}
