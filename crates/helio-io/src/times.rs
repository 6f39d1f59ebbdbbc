//! Times: text with an offset at the edge, nanoseconds of Unix time inside.

use helio_core::angle::{degrees, radians};
use jiff::{SignedDuration, Timestamp, civil};

use crate::error::{IoError, Place, Problem};

fn refuse(what: &'static str, text: &str, reason: impl Into<String>) -> IoError {
    let problem = Problem::Time {
        what,
        text: text.to_string(),
        reason: reason.into(),
    };
    IoError::new(Place::default(), problem)
}

/// Nanoseconds of Unix time of a time with an offset (RFC 3339, ISO 8601): 1677 to 2262.
///
/// # Errors
/// [`Problem::Time`] if the text is no time, has no offset or lies outside those years.
///
/// ```
/// use helio_io::parse_time;
/// assert_eq!(parse_time("1970-01-01T00:00:01Z")?, 1_000_000_000);
/// assert_eq!(parse_time("1970-01-01T02:00:01.5+02:00")?, 1_500_000_000);
/// assert!(parse_time("1970-01-01T00:00:01").is_err());
/// # Ok::<(), helio_io::IoError>(())
/// ```
pub fn parse_time(text: &str) -> Result<i64, IoError> {
    time(text).map_err(|problem| IoError::new(Place::default(), problem))
}

pub(crate) fn time(text: &str) -> Result<i64, Problem> {
    let bad = |reason: String| Problem::Time {
        what: "time",
        text: text.to_string(),
        reason,
    };
    let trimmed = text.trim();
    if let Ok(timestamp) = trimmed.parse::<Timestamp>() {
        return i64::try_from(timestamp.as_nanosecond())
            .map_err(|_| bad("it must lie between the years 1678 and 2262".into()));
    }
    if let Ok(civil) = trimmed.parse::<civil::DateTime>() {
        let lacks = if trimmed.contains([':', 't', 'T']) {
            "it has no offset from UTC"
        } else {
            "it is a date without a time of day"
        };
        return Err(bad(format!(
            "{lacks}; write {civil}Z for UTC, or {civil}+02:00"
        )));
    }
    let lacks = if trimmed.starts_with(|c: char| c.is_ascii_digit()) {
        "no such time; "
    } else {
        ""
    };
    Err(bad(format!(
        "{lacks}write a date, a time and its offset, such as 2026-06-21T12:00:00Z"
    )))
}

/// A time as files and reports write it: UTC with `Z`, as many decimals as it has.
///
/// ```
/// assert_eq!(helio_io::format_time(1_500_000_000), "1970-01-01T00:00:01.5Z");
/// ```
#[must_use]
pub fn format_time(unix_ns: i64) -> String {
    match Timestamp::from_nanosecond(i128::from(unix_ns)) {
        Ok(timestamp) => timestamp.to_string(),
        // Cannot happen: jiff holds the years -9999 to 9999, these nanoseconds 1677 to 2262.
        Err(_) => format!("{unix_ns} ns"),
    }
}

/// Nanoseconds of a time step such as `10s`, `1min`, `1h 30m` or `PT10S`; above zero.
///
/// # Errors
/// [`Problem::Time`] if the text is no duration, has no unit, or is not above zero. Days and longer
/// are refused: write `24h`.
///
/// ```
/// assert_eq!(helio_io::parse_step("10s")?, 10_000_000_000);
/// assert_eq!(helio_io::parse_step("1min")?, 60_000_000_000);
/// assert!(helio_io::parse_step("10").is_err());
/// # Ok::<(), helio_io::IoError>(())
/// ```
pub fn parse_step(text: &str) -> Result<i64, IoError> {
    let trimmed = text.trim();
    if trimmed.parse::<f64>().is_ok() {
        return Err(refuse(
            "step",
            text,
            "it has no unit; write 10s, 1min or 1h",
        ));
    }
    let Ok(step) = trimmed.parse::<SignedDuration>() else {
        if trimmed.parse::<jiff::Span>().is_ok() {
            return Err(refuse(
                "step",
                text,
                "units longer than an hour vary; write 24h for a day",
            ));
        }
        return Err(refuse(
            "step",
            text,
            "write a number and a unit: 10s, 1min, 1h",
        ));
    };
    match i64::try_from(step.as_nanos()) {
        Ok(ns) if ns > 0 => Ok(ns),
        Ok(_) => Err(refuse("step", text, "it must be above zero")),
        Err(_) => Err(refuse("step", text, "it is too long")),
    }
}

/// Equally spaced times, both ends included where the step meets them.
///
/// A description, not a list: a day at 10 s costs nothing to hold.
///
/// ```
/// let day = helio_io::TimeRange::parse("2026-06-21T04:00:00Z", "2026-06-21T04:00:30Z", "10s")?;
/// assert_eq!(day.len(), 4);
/// assert_eq!(day.iter().map(helio_io::format_time).last().unwrap(), "2026-06-21T04:00:30Z");
/// # Ok::<(), helio_io::IoError>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct TimeRange {
    from_unix_ns: i64,
    step_ns: i64,
    len: usize,
}

impl TimeRange {
    /// From one time to another.
    ///
    /// # Errors
    /// [`Problem::Time`] if the step is not above zero, and [`Problem::Conflict`] if the range runs
    /// backwards.
    pub fn new(from_unix_ns: i64, to_unix_ns: i64, step_ns: i64) -> Result<Self, IoError> {
        if step_ns <= 0 {
            return Err(refuse(
                "step",
                &format!("{step_ns} ns"),
                "it must be above zero",
            ));
        }
        if to_unix_ns < from_unix_ns {
            let (from, to) = (format_time(from_unix_ns), format_time(to_unix_ns));
            let message = format!("the range ends before it begins: from {from} to {to}");
            return Err(IoError::new(
                Place::default(),
                Problem::Conflict { message },
            ));
        }
        let steps = (i128::from(to_unix_ns) - i128::from(from_unix_ns)) / i128::from(step_ns);
        let len = usize::try_from(steps + 1).map_err(|_| refuse("step", "", "it is too short"))?;
        Ok(Self {
            from_unix_ns,
            step_ns,
            len,
        })
    }

    /// From texts, as [`parse_time`] and [`parse_step`] read them.
    ///
    /// # Errors
    /// As those two, and as [`new`](Self::new).
    pub fn parse(from: &str, to: &str, step: &str) -> Result<Self, IoError> {
        Self::new(parse_time(from)?, parse_time(to)?, parse_step(step)?)
    }

    /// Number of times; at least one.
    #[must_use]
    pub fn len(&self) -> usize {
        self.len
    }

    /// Never: a range holds at least its beginning.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.len == 0
    }

    /// First time \[ns\].
    #[must_use]
    pub fn from_unix_ns(&self) -> i64 {
        self.from_unix_ns
    }

    /// Last time \[ns\], on the grid of steps.
    #[must_use]
    pub fn last_unix_ns(&self) -> i64 {
        self.at(self.len - 1)
    }

    /// Step \[ns\].
    #[must_use]
    pub fn step_ns(&self) -> i64 {
        self.step_ns
    }

    /// The times \[ns\], in order.
    pub fn iter(&self) -> impl ExactSizeIterator<Item = i64> + use<> {
        let range = *self;
        (0..range.len).map(move |index| range.at(index))
    }

    /// Fits: index < len, so the product is at most the distance between two i64.
    fn at(&self, index: usize) -> i64 {
        let offset = i128::from(self.step_ns) * index as i128;
        (i128::from(self.from_unix_ns) + offset) as i64
    }
}

/// Degrees whose conversion gave these radians, as somebody would have written them.
///
/// A tenth of a degree is no double, so that degrees → radians → degrees may end a digit beside
/// where it began; of what is converted to the same radians the shortest is meant.
#[must_use]
pub fn degrees_as_written(angle_rad: f64) -> f64 {
    let exact = degrees(angle_rad);
    let short = (exact * 1e9).round() / 1e9;
    if radians(short) == angle_rad {
        short
    } else {
        exact
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_offset_is_understood() {
        let noon = parse_time("2026-06-21T12:00:00Z").unwrap();
        for same in [
            "2026-06-21T12:00Z",
            "2026-06-21 12:00:00Z",
            "2026-06-21T14:00:00+02:00",
            "2026-06-21T14:00:00+02",
            "2026-06-21T03:00:00.000-09:00",
            " 2026-06-21t12:00:00z ",
        ] {
            assert_eq!(parse_time(same).unwrap(), noon, "{same}");
        }
    }

    #[test]
    fn times_survive_the_way_out_and_back() {
        for ns in [0, 1, -1, i64::MAX, i64::MIN, 1_782_043_200_123_456_789] {
            assert_eq!(parse_time(&format_time(ns)).unwrap(), ns);
        }
    }

    #[test]
    fn what_is_no_time_is_refused() {
        for bad in [
            "",
            "now",
            "12:00",
            "2026-13-01T00:00:00Z",
            "2026-06-21T25:00:00Z",
            "3000-01-01T00:00:00Z",
            "2026-06-21",
            "1718971200",
            "2026-06-21T12:00:00",
        ] {
            assert!(parse_time(bad).is_err(), "{bad}");
        }
        for bad in [
            "",
            "10",
            "s",
            "-10s",
            "0s",
            "1 day",
            "10 parsecs",
            "1y",
            "9999999999999h",
        ] {
            assert!(parse_step(bad).is_err(), "{bad}");
        }
    }

    #[test]
    fn ranges_stop_at_their_end() {
        let range =
            TimeRange::parse("2026-06-21T00:00:00Z", "2026-06-21T00:00:25Z", "10s").unwrap();
        assert_eq!(range.len(), 3);
        assert_eq!(format_time(range.last_unix_ns()), "2026-06-21T00:00:20Z");
        assert_eq!(TimeRange::new(5, 5, 1).unwrap().len(), 1);
        assert!(TimeRange::new(5, 4, 1).is_err());
        assert!(TimeRange::new(0, 1, 0).is_err());
        let all = TimeRange::new(i64::MIN, i64::MAX, i64::MAX).unwrap();
        assert_eq!(all.iter().collect::<Vec<_>>(), [i64::MIN, -1, i64::MAX - 1]);
    }

    #[test]
    fn degrees_come_back_as_written() {
        for tenths in -3600..=3600 {
            let written = f64::from(tenths) / 10.0;
            assert_eq!(degrees_as_written(radians(written)), written);
        }
        let odd = 123.456_789_012_345_67;
        assert!((degrees_as_written(radians(odd)) - odd).abs() < 1e-13);
    }
}
