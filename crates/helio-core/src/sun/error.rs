//! What can be wrong with a call.

use crate::SimdLevel;

/// A sun position that cannot be computed.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum SunError {
    /// A number is NaN, infinite or outside its range.
    #[error("sun position: {what} must be {wanted}, got {value}")]
    BadValue {
        /// The quantity, as in the glossary.
        what: &'static str,
        /// The range it must lie in.
        wanted: &'static str,
        /// What was given.
        value: f64,
    },
    /// A span that ends before it begins.
    #[error(
        "sun ephemeris: the span must not end before it begins, got from {from_unix_ns} ns to \
         {to_unix_ns} ns since 1970"
    )]
    EmptySpan {
        /// First instant asked for.
        from_unix_ns: i64,
        /// Last instant asked for.
        to_unix_ns: i64,
    },
    /// An instant that the ephemeris was not made for.
    #[error(
        "sun position: row {row} (counted from 0) must lie between {from_unix_ns} ns and \
         {to_unix_ns} ns since 1970, the ephemeris's span, got {unix_ns} ns"
    )]
    OutsideSpan {
        /// The row, counted from 0.
        row: usize,
        /// The instant.
        unix_ns: i64,
        /// First instant of the ephemeris.
        from_unix_ns: i64,
        /// Last instant of the ephemeris.
        to_unix_ns: i64,
    },
    /// An instruction-set level that this processor does not have was asked for.
    #[error("instruction set {level} is not available on this processor")]
    LevelUnavailable {
        /// The level asked for.
        level: SimdLevel,
    },
    /// The algorithm refused an instant. No instant that 64 bits of nanoseconds hold is refused.
    #[error(
        "sun position: the algorithm holds for the years -2000 to 6000, got day {days} from 2000-01-01T12"
    )]
    OutsideModel {
        /// Days from 2000-01-01T12:00.
        days: f64,
    },
}
