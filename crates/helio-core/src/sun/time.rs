//! Instants without loss: half days and nanoseconds, UT1, TT.

use solar_positioning::delta_t;

use super::error::SunError;
use super::site::check;

/// Largest magnitude of TT - UT1 accepted \[s\], that of the SPA report.
pub const MAX_DELTA_T_S: f64 = 8000.0;

/// Largest magnitude of UT1 - UTC accepted \[s\]; it stays below 0.9 while there are leap seconds.
pub const MAX_UT1_UTC_S: f64 = 10.0;

/// Nanoseconds of half a day.
pub(super) const HALF_DAY_NS: i64 = 43_200_000_000_000;

/// Seconds of half a day.
pub(super) const HALF_DAY_S: f64 = 43_200.0;

/// A UT1 instant: half days since 1970-01-01T00:00, and nanoseconds into the half day.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Instant {
    pub half_day: i64,
    pub ns: i64,
}

impl Instant {
    /// Fraction of the half day, in [0, 1).
    pub fn fraction(self) -> f64 {
        self.ns as f64 / HALF_DAY_NS as f64
    }
}

/// Days from 2000-01-01T12:00 to the beginning of a half day; exact.
pub(super) fn days_from_j2000(half_day: i64) -> f64 {
    half_day as f64 * 0.5 - 10_957.5
}

/// How UTC, UT1 and TT differ in one call.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct TimeScale {
    delta_t_s: Option<f64>,
    /// UT1 - UTC.
    pub ut1_utc_ns: i64,
}

impl TimeScale {
    pub fn new(delta_t_s: Option<f64>, ut1_utc_s: f64) -> Result<Self, SunError> {
        if let Some(value) = delta_t_s {
            check(
                "delta_t_s",
                value,
                -MAX_DELTA_T_S,
                MAX_DELTA_T_S,
                "within ±8000 s",
            )?;
        }
        check(
            "ut1_utc_s",
            ut1_utc_s,
            -MAX_UT1_UTC_S,
            MAX_UT1_UTC_S,
            "within ±10 s",
        )?;
        Ok(Self {
            delta_t_s,
            ut1_utc_ns: libm::round(ut1_utc_s * 1e9) as i64,
        })
    }

    pub fn instant(self, unix_ns: i64) -> Instant {
        let ut1_ns = i128::from(unix_ns) + i128::from(self.ut1_utc_ns);
        let half = i128::from(HALF_DAY_NS);
        // The quotient of 64 bits and a little by 4e13 fits easily.
        Instant {
            half_day: ut1_ns.div_euclid(half) as i64,
            ns: ut1_ns.rem_euclid(half) as i64,
        }
    }

    /// TT - UT1 \[s\] at the beginning of a half day.
    pub fn delta_t_at_half_day(self, half_day: i64) -> Result<f64, SunError> {
        match self.delta_t_s {
            Some(value) => Ok(value),
            None => {
                let days = days_from_j2000(half_day);
                // 2000-01-01T00:00 is day -0.5
                delta_t::estimate(2000.0 + (days + 0.5) / 365.25)
                    .map_err(|_| SunError::OutsideModel { days })
            }
        }
    }

    pub fn delta_t_s(self, instant: Instant) -> Result<f64, SunError> {
        let before = self.delta_t_at_half_day(instant.half_day)?;
        let after = self.delta_t_at_half_day(instant.half_day + 1)?;
        Ok(before + (after - before) * instant.fraction())
    }
}

/// TT - UT1 \[s\] as estimated where none is given: the polynomials of `solar_positioning::delta_t`
/// (Espenak and Meeus, updated 2026) at every half day, straight lines between.
///
/// So it is continuous; the polynomials themselves jump by up to 0.2 s where they meet.
/// `unix_ns` is in nanoseconds since 1970, UT1 or, no matter here, UTC. Within some tenths of a second
/// of the observations (1900 to 2026), a guess later.
///
/// # Errors
/// [`SunError::OutsideModel`], for no instant that `i64` holds.
///
/// ```
/// let delta_t_s = helio_core::sun::estimated_delta_t_s(1_577_836_800_000_000_000)?; // 2020
/// assert!((delta_t_s - 69.38).abs() < 0.01);
/// # Ok::<(), helio_core::sun::SunError>(())
/// ```
pub fn estimated_delta_t_s(unix_ns: i64) -> Result<f64, SunError> {
    let scale = TimeScale {
        delta_t_s: None,
        ut1_utc_ns: 0,
    };
    scale.delta_t_s(scale.instant(unix_ns))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn instants_of_all_sizes_divide_into_half_days() {
        let scale = TimeScale::new(None, -0.25).unwrap();
        assert_eq!(scale.ut1_utc_ns, -250_000_000);
        for unix_ns in [i64::MIN, -1, 0, 249_999_999, 250_000_000, i64::MAX] {
            let Instant { half_day, ns } = scale.instant(unix_ns);
            assert!((0..HALF_DAY_NS).contains(&ns));
            let back = i128::from(half_day) * i128::from(HALF_DAY_NS) + i128::from(ns);
            assert_eq!(back, i128::from(unix_ns) - 250_000_000);
            assert!(scale.delta_t_s(scale.instant(unix_ns)).is_ok());
        }
        assert_eq!(scale.instant(0).half_day, -1);
    }
}
