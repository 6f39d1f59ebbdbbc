//! Where the sun stands: NREL's Solar Position Algorithm (SPA), for one instant or for millions.
//!
//! Source: Reda & Andreas (2004), *Solar position algorithm for solar radiation applications*,
//! NREL/TP-560-34302, in the implementation of crate `solar-positioning`; its own uncertainty is
//! 0.0003°.
//!
//! - [`position`] evaluates the algorithm for one instant: the reference.
//! - [`SunEphemeris`] evaluates it every twelve hours only and interpolates what changes slowly:
//!   a few nanoseconds an instant, within 1e-8° of [`position`]. [`positions`] does both steps.
//!
//! # Time
//!
//! Instants are integer nanoseconds since 1970-01-01T00:00:00Z without leap seconds (POSIX time,
//! `jiff::Timestamp::as_nanosecond`). A Julian date in one double has steps of 40 µs, in which the
//! hour angle jumps by 1.7e-7°; here day and fraction stay apart and nothing is lost.
//!
//! The earth's turn follows UT1 = UTC + `ut1_utc_s`. That difference is published by the IERS
//! and stays below 0.9 s; leaving it at 0 costs up to 0.9 s · 15″/s = 0.0038° of hour angle.
//! The sun's path follows TT = UT1 + `delta_t_s`. `None` takes the crate's estimate
//! ([`estimated_delta_t_s`]); an error of a second costs 1.2e-5°.
//!
//! # Elevations
//!
//! The *geometric* elevation is that of the sun's centre without air. The *apparent* one adds
//! refraction ([`refraction_rad`]): it is what a heliostat sees, and the sun is below the horizon
//! where the apparent centre is.

mod dispatch;
mod ephemeris;
mod error;
mod geocentric;
mod kernel;
mod position;
mod refraction;
mod site;
mod time;
mod topocentric;

pub use ephemeris::SunEphemeris;
pub use error::SunError;
pub use position::{SunPosition, SunPositions};
pub use refraction::refraction_rad;
pub use site::{DEFAULT_TEMPERATURE_C, SunSite, standard_pressure_hpa};
pub use time::{MAX_DELTA_T_S, MAX_UT1_UTC_S, estimated_delta_t_s};

use time::TimeScale;

/// The sun at one instant, by direct evaluation of the algorithm: some microseconds.
///
/// `unix_ns` is UTC in nanoseconds since 1970 (1677 to 2262), `delta_t_s` is TT - UT1 \[s\] or `None`
/// for [`estimated_delta_t_s`], `ut1_utc_s` is UT1 - UTC \[s\], 0 if not known (see
/// [the module](self)).
///
/// Source: Reda & Andreas (2004), NREL/TP-560-34302, section 3.
///
/// # Errors
/// [`SunError::BadValue`] for a `delta_t_s` beyond ±[`MAX_DELTA_T_S`] or a `ut1_utc_s` beyond
/// ±[`MAX_UT1_UTC_S`].
///
/// ```
/// use helio_core::angle::{degrees, radians};
/// use helio_core::sun::{SunSite, position};
/// // the report's example (appendix A.5): Golden, Colorado, 2003-10-17T12:30:30-07:00
/// let site = SunSite::new(radians(39.742476), radians(-105.1786), 1830.14)?
///     .with_pressure_hpa(820.0)?
///     .with_temperature_c(11.0)?;
/// let sun = position(&site, 1_066_419_030_000_000_000, Some(67.0), 0.0)?;
/// assert!((degrees(sun.azimuth_rad) - 194.34024).abs() < 5e-6);
/// assert!((90.0 - degrees(sun.apparent_elevation_rad) - 50.11162).abs() < 5e-6);
/// # Ok::<(), helio_core::sun::SunError>(())
/// ```
pub fn position(
    site: &SunSite,
    unix_ns: i64,
    delta_t_s: Option<f64>,
    ut1_utc_s: f64,
) -> Result<SunPosition, SunError> {
    let scale = TimeScale::new(delta_t_s, ut1_utc_s)?;
    let instant = scale.instant(unix_ns);
    let delta_t_s = scale.delta_t_s(instant)?;
    let place = geocentric::at_ut1(instant, delta_t_s)?;
    Ok(topocentric::position(site, &place))
}

/// The sun at many instants, in their order, which may be any.
///
/// The arguments are those of [`position`], the numbers those of a [`SunEphemeris`]. Whoever asks
/// again for the same span keeps a [`SunEphemeris`] instead: making it is most of the work here
/// unless a day holds thousands of instants.
///
/// # Errors
/// As [`position`].
///
/// ```
/// use helio_core::angle::{degrees, radians};
/// use helio_core::sun::{SunSite, positions};
/// let site = SunSite::new(radians(50.9134), radians(6.3878), 87.0)?;
/// // 2022-06-21, every hour
/// let hours: Vec<i64> = (0..24).map(|h| (1_655_769_600 + h * 3600) * 1_000_000_000).collect();
/// let suns = positions(&site, &hours, None, 0.0)?;
/// let highest = suns.apparent_elevation_rad.iter().copied().fold(f64::MIN, f64::max);
/// assert!((degrees(highest) - 62.2).abs() < 0.4); // culmination at 62.5°
/// # Ok::<(), helio_core::sun::SunError>(())
/// ```
pub fn positions(
    site: &SunSite,
    unix_ns: &[i64],
    delta_t_s: Option<f64>,
    ut1_utc_s: f64,
) -> Result<SunPositions, SunError> {
    let mut out = SunPositions::default();
    let scale = TimeScale::new(delta_t_s, ut1_utc_s)?;
    let (Some(&first), Some(&last)) = (unix_ns.iter().min(), unix_ns.iter().max()) else {
        return Ok(out);
    };
    let half_days = scale.instant(last).half_day - scale.instant(first).half_day + 1;
    // An interval alone needs NODES evaluations, one beside others needs one.
    if half_days <= ephemeris::NODES * unix_ns.len() as i64 {
        let ephemeris = SunEphemeris::new(first, last, delta_t_s, ut1_utc_s)?;
        ephemeris.positions_into(site, unix_ns, None, &mut out)?;
        return Ok(out);
    }
    // Few instants far apart: the intervals in which they lie, one after another.
    out.resize(unix_ns.len());
    let mut start = 0;
    while let Some(&instant) = unix_ns.get(start) {
        let half_day = scale.instant(instant).half_day;
        let run = unix_ns[start..]
            .iter()
            .take_while(|&&t| scale.instant(t).half_day == half_day)
            .count();
        let ephemeris = SunEphemeris::new(instant, instant, delta_t_s, ut1_utc_s)?;
        ephemeris.fill(
            site,
            &unix_ns[start..start + run],
            &mut out.columns(start..start + run),
        );
        start += run;
    }
    Ok(out)
}
