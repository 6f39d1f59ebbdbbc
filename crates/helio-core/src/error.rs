//! Errors of wrong calls. Rows that cannot be computed have a [`Status`](crate::Status) instead.

use alloc::string::String;

use crate::frame::Enu;

/// A vector that should have given a direction.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum FrameError {
    /// The vector is not finite, or too short.
    #[error("a direction needs a finite vector with a length, got ({}, {}, {})", vector.east, vector.north, vector.up)]
    NoDirection {
        /// What was given.
        vector: Enu,
    },
}

/// A field that cannot be built from what was given.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum FieldError {
    /// A number is NaN, infinite or outside its range.
    #[error("heliostat {id}: {what} must be {wanted}, got {value}")]
    BadValue {
        /// The heliostat.
        id: String,
        /// The quantity, as in the glossary.
        what: &'static str,
        /// The range it must lie in.
        wanted: &'static str,
        /// What was given.
        value: f64,
    },
    /// Two heliostats have one name.
    #[error("heliostat {id}: the id stands twice, in rows {first} and {second} (counted from 0)")]
    DuplicateId {
        /// The name.
        id: String,
        /// Row of the first.
        first: usize,
        /// Row of the second.
        second: usize,
    },
    /// Lower limit above upper limit.
    #[error("heliostat {id}: {axis} limits are empty: from {min_rad} rad to {max_rad} rad")]
    EmptyLimits {
        /// The heliostat.
        id: String,
        /// `axis1` or `axis2`.
        axis: &'static str,
        /// Lower limit.
        min_rad: f64,
        /// Upper limit.
        max_rad: f64,
    },
    /// No heliostat stands in a row.
    #[error("row must be below {count}, the number of heliostats, got {row}")]
    NoSuchRow {
        /// The row asked for, counted from 0.
        row: usize,
        /// How many heliostats there are.
        count: usize,
    },
}

/// A wrong call of a tracking function.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum TrackError {
    /// A column has the wrong number of rows.
    #[error("{what}: expected {expected} rows (one per heliostat), got {got}")]
    LengthMismatch {
        /// The column.
        what: &'static str,
        /// Rows wanted.
        expected: usize,
        /// Rows given.
        got: usize,
    },
    /// An angle is NaN, infinite, or so large that it has no precision left.
    #[error("{what}: row {row} must be finite and within ±{limit} rad, got {value}")]
    BadAngle {
        /// The column.
        what: &'static str,
        /// The row, counted from 0.
        row: usize,
        /// Largest magnitude accepted.
        limit: f64,
        /// What was given.
        value: f64,
    },
    /// A sun that is not a direction: it was made from angles that are not finite.
    #[error("sun {row} (counted from 0) must be a direction, but its angles were not finite")]
    BadSun {
        /// Which of the suns.
        row: usize,
    },
    /// An instruction-set level that this processor does not have was asked for.
    #[error("instruction set {level} is not available on this processor")]
    LevelUnavailable {
        /// The level asked for.
        level: crate::SimdLevel,
    },
    /// The mirror-pivot offset form is out of range.
    #[error("iterated offset: between 1 and {max} iterations, got {got}")]
    Iterations {
        /// Most iterations accepted.
        max: u32,
        /// Iterations asked for.
        got: u32,
    },
}

/// A drive whose numbers do not describe a mechanism.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum DriveError {
    /// A number is NaN, infinite or outside its range.
    #[error("drive: {what} must be {wanted}, got {value}")]
    BadValue {
        /// The quantity, as in the glossary.
        what: &'static str,
        /// The range it must lie in.
        wanted: &'static str,
        /// What was given.
        value: f64,
    },
}

pub use crate::sun::SunError;
