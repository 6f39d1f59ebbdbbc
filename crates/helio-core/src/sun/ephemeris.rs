//! A span of time made ready for many instants.

use alloc::vec::Vec;
use core::f64::consts::PI;

use super::dispatch;
use super::error::SunError;
use super::geocentric::{Slow, sidereal_correction, sidereal_correction_rate, slow};
use super::kernel::{Interval, Job};
use super::position::{Columns, SunPositions};
use super::site::SunSite;
use super::time::{HALF_DAY_NS, HALF_DAY_S, TimeScale, days_from_j2000};
use crate::lanes::SimdLevel;

/// Nodes through which the polynomials of an interval run: three before its middle, three after.
pub(super) const NODES: i64 = 6;

/// Rows that are worth a second thread: below, waking it costs more than it earns.
#[cfg(feature = "std")]
const ROWS_PER_THREAD: usize = 20_000;

/// The sun's path over a span of time, ready for any number of instants and sites.
///
/// Equation of time, declination and parallax depend on TT only and change slowly: SPA is evaluated
/// every twelve hours of TT, and between these nodes a polynomial through the nearest six stands in for
/// it, within 1e-9° from 1900 to 2100. The turn of the earth comes from integer nanoseconds. What
/// remains for each instant, site and refraction, is computed several instants at a time.
///
/// The nodes lie at fixed instants: a sun has the same bits whatever the span, the batch, the number
/// of threads and the instruction set. Making one costs some microseconds per half day.
///
/// ```
/// use helio_core::angle::radians;
/// use helio_core::sun::{SunEphemeris, SunPositions, SunSite};
/// let second = 1_000_000_000;
/// let from = 1_655_769_600 * second; // 2022-06-21T00:00:00Z
/// let day = SunEphemeris::new(from, from + 86_400 * second, None, 0.0)?;
/// let instants: Vec<i64> = (0..8640).map(|k| from + k * 10 * second).collect();
/// let mut suns = SunPositions::default(); // reused from call to call
/// for longitude_deg in [6.38, 94.4] {
///     let site = SunSite::new(radians(40.0), radians(longitude_deg), 1000.0)?;
///     day.positions_into(&site, &instants, None, &mut suns)?;
///     assert_eq!(suns.len(), 8640);
/// }
/// # Ok::<(), helio_core::sun::SunError>(())
/// ```
#[derive(Debug, Clone)]
pub struct SunEphemeris {
    from_unix_ns: i64,
    to_unix_ns: i64,
    origin_unix_ns: i64,
    intervals: Vec<Interval>,
}

impl SunEphemeris {
    /// The span from one instant to another, both included \[ns since 1970, UTC\]; `delta_t_s` and
    /// `ut1_utc_s` as for [`position`](super::position).
    ///
    /// # Errors
    /// [`SunError::EmptySpan`] if it ends before it begins; [`SunError::BadValue`] for a time difference
    /// out of range.
    pub fn new(
        from_unix_ns: i64,
        to_unix_ns: i64,
        delta_t_s: Option<f64>,
        ut1_utc_s: f64,
    ) -> Result<Self, SunError> {
        if to_unix_ns < from_unix_ns {
            return Err(SunError::EmptySpan {
                from_unix_ns,
                to_unix_ns,
            });
        }
        let scale = TimeScale::new(delta_t_s, ut1_utc_s)?;
        let first = scale.instant(from_unix_ns).half_day;
        let last = scale.instant(to_unix_ns).half_day;
        let nodes: Vec<Slow> = (first - 2..=last + 3)
            .map(|half_day| slow(days_from_j2000(half_day)))
            .collect::<Result<_, _>>()?;
        let intervals = nodes
            .windows(NODES as usize)
            .zip(first..=last)
            .map(|(nodes, half_day)| interval(scale, half_day, nodes))
            .collect::<Result<_, _>>()?;
        // May lie before what 64 bits hold; differences from it do not.
        let origin = i128::from(first) * i128::from(HALF_DAY_NS) - i128::from(scale.ut1_utc_ns);
        Ok(Self {
            from_unix_ns,
            to_unix_ns,
            origin_unix_ns: origin as i64,
            intervals,
        })
    }

    /// First instant of the span \[ns since 1970, UTC\].
    #[must_use]
    pub fn from_unix_ns(&self) -> i64 {
        self.from_unix_ns
    }

    /// Last instant of the span \[ns since 1970, UTC\].
    #[must_use]
    pub fn to_unix_ns(&self) -> i64 {
        self.to_unix_ns
    }

    /// The sun at many instants, in their order, into a buffer that may be reused.
    ///
    /// Instants in order of time are fastest. With twenty thousand for each, the threads of the current
    /// `rayon` pool share the work, else it stays on the caller's. `level` is the instruction set,
    /// `None` for the best that the processor has. Neither changes a bit of the answer.
    ///
    /// # Errors
    /// [`SunError::OutsideSpan`] names the first row whose instant the ephemeris was not made for,
    /// [`SunError::LevelUnavailable`] an instruction set that this processor lacks; `out` is then as
    /// it was.
    pub fn positions_into(
        &self,
        site: &SunSite,
        unix_ns: &[i64],
        level: Option<SimdLevel>,
        out: &mut SunPositions,
    ) -> Result<(), SunError> {
        let level = match level {
            None => SimdLevel::best(),
            Some(level) if SimdLevel::available().contains(&level) => level,
            Some(level) => return Err(SunError::LevelUnavailable { level }),
        };
        self.check(unix_ns)?;
        out.resize(unix_ns.len());
        self.fill_at(level, site, unix_ns, &mut out.columns(0..unix_ns.len()));
        Ok(())
    }

    fn check(&self, unix_ns: &[i64]) -> Result<(), SunError> {
        let span = self.from_unix_ns..=self.to_unix_ns;
        // without a way out of the loop it is several times faster
        let all = unix_ns
            .iter()
            .fold(true, |all, instant| all & span.contains(instant));
        if all {
            return Ok(());
        }
        match unix_ns.iter().position(|instant| !span.contains(instant)) {
            None => Ok(()),
            Some(row) => Err(SunError::OutsideSpan {
                row,
                unix_ns: unix_ns[row],
                from_unix_ns: self.from_unix_ns,
                to_unix_ns: self.to_unix_ns,
            }),
        }
    }

    /// Instants that lie in the span's half days, known to.
    pub(super) fn fill(&self, site: &SunSite, unix_ns: &[i64], out: &mut Columns<'_>) {
        self.fill_at(SimdLevel::best(), site, unix_ns, out);
    }

    fn fill_at(&self, level: SimdLevel, site: &SunSite, unix_ns: &[i64], out: &mut Columns<'_>) {
        let job = Job::new(&self.intervals, self.origin_unix_ns, site);
        #[cfg(feature = "std")]
        {
            let pieces = (unix_ns.len() / ROWS_PER_THREAD).min(rayon::current_num_threads());
            if pieces > 1 {
                let length = unix_ns.len().div_ceil(pieces).next_multiple_of(64);
                rayon::in_place_scope(|scope| {
                    let mut rest = Columns {
                        azimuth: out.azimuth,
                        apparent: out.apparent,
                        geometric: out.geometric,
                    };
                    for piece in unix_ns.chunks(length) {
                        let (mut columns, others) = rest.split_at(piece.len());
                        rest = others;
                        scope.spawn(move |_| dispatch::run(job, level, piece, &mut columns));
                    }
                });
                return;
            }
        }
        dispatch::run(job, level, unix_ns, out);
    }
}

/// The polynomials of one half day of UT1 from the six nodes of TT around it.
fn interval(scale: TimeScale, half_day: i64, nodes: &[Slow]) -> Result<Interval, SunError> {
    let before_s = scale.delta_t_at_half_day(half_day)?;
    let growth_s = scale.delta_t_at_half_day(half_day + 1)? - before_s;
    let middle_s = before_s + growth_s * 0.5;
    // TT = UT1 + delta T: the nodes' clock is ahead of the interval's
    let ahead = middle_s / HALF_DAY_S;
    let pace = 1.0 + growth_s / HALF_DAY_S;
    let through = |quantity: fn(&Slow) -> f64| {
        let mut values = [0.0; NODES as usize];
        for (value, node) in values.iter_mut().zip(nodes) {
            *value = quantity(node);
        }
        substitute(through_six(values), ahead, pace)
    };
    let mut hour_angle = through(|node| node.equation_of_time);
    let middle = days_from_j2000(half_day) + 0.25;
    // The earth turns by π in half a day; middles are 6 h before noon (even) and after it (odd).
    let since_noon = if half_day % 2 == 0 { -0.5 } else { 0.5 };
    hour_angle[0] += sidereal_correction(middle, middle_s) + since_noon * PI;
    hour_angle[1] += sidereal_correction_rate(middle, growth_s) + PI;
    // 4.3e-5; a straight line between nodes is within 1e-11 of it.
    let parallax = [nodes[2].sin_parallax, nodes[3].sin_parallax];
    let slope = parallax[1] - parallax[0];
    Ok(Interval {
        hour_angle,
        sin_declination: through(|node| node.sin_declination),
        cos_declination: through(|node| node.cos_declination),
        sin_parallax: [
            0.5 * (parallax[0] + parallax[1]) + slope * ahead,
            slope * pace,
        ],
    })
}

/// Coefficients of the polynomial through values at -5/2, -3/2, -1/2, 1/2, 3/2 and 5/2.
fn through_six(y: [f64; 6]) -> [f64; 6] {
    // The even part is a polynomial in z = x², so is the odd part over x: Newton's form through
    // z = 1/4, 9/4, 25/4.
    let even = quadratic([
        (y[3] + y[2]) * 0.5,
        (y[4] + y[1]) * 0.5,
        (y[5] + y[0]) * 0.5,
    ]);
    let odd = quadratic([y[3] - y[2], (y[4] - y[1]) / 3.0, (y[5] - y[0]) / 5.0]);
    [even[0], odd[0], even[1], odd[1], even[2], odd[2]]
}

/// Coefficients of the parabola through values at 1/4, 9/4 and 25/4.
fn quadratic(y: [f64; 3]) -> [f64; 3] {
    let first = (y[1] - y[0]) / 2.0;
    let second = ((y[2] - y[1]) / 4.0 - first) / 6.0;
    [
        y[0] - 0.25 * first + 0.5625 * second,
        first - 2.5 * second,
        second,
    ]
}

/// Coefficients of p(ahead + pace · t) in t.
fn substitute(p: [f64; 6], ahead: f64, pace: f64) -> [f64; 6] {
    let mut q = [0.0; 6];
    for &coefficient in p.iter().rev() {
        // q ← q · (ahead + pace · t) + coefficient
        for k in (1..q.len()).rev() {
            q[k] = q[k] * ahead + q[k - 1] * pace;
        }
        q[0] = q[0] * ahead + coefficient;
    }
    q
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn six_values_of_a_quintic_give_its_coefficients() {
        let want = [0.3, -1.0, 2.0, 0.7, -0.4, 0.05];
        let value = |x: f64| want.iter().rev().fold(0.0, |sum, c| sum * x + c);
        let got = through_six([-2.5, -1.5, -0.5, 0.5, 1.5, 2.5].map(value));
        let moved = substitute(got, 0.1, 1.5);
        for (g, w) in got.iter().zip(want) {
            assert!((g - w).abs() < 1e-14, "{got:?}");
        }
        let at = |t: f64| moved.iter().rev().fold(0.0, |sum, c| sum * t + c);
        assert!((at(0.4) - value(0.7)).abs() < 1e-14);
    }

    #[cfg(feature = "std")]
    #[test]
    fn the_number_of_threads_changes_no_bit() {
        let site = SunSite::new(0.9, 0.1, 0.0).unwrap();
        let instants: Vec<i64> = (0..70_001).map(|k| k * 77_777_777_777).collect();
        let ephemeris = SunEphemeris::new(0, instants[70_000], None, 0.1).unwrap();
        let run = |threads| {
            let pool = rayon::ThreadPoolBuilder::new()
                .num_threads(threads)
                .build()
                .unwrap();
            let mut out = SunPositions::default();
            pool.install(|| ephemeris.positions_into(&site, &instants, None, &mut out))
                .unwrap();
            let bits = |column: &[f64]| column.iter().map(|x| x.to_bits()).collect::<Vec<_>>();
            [
                bits(&out.azimuth_rad),
                bits(&out.apparent_elevation_rad),
                bits(&out.geometric_elevation_rad),
            ]
        };
        let one = run(1);
        for threads in [2, 3, 7, 16] {
            assert!(run(threads) == one, "{threads} threads");
        }
    }
}
