//! Errors of wrong calls about deformed mirrors.

/// A wrong call: points or a mirror from which no pose or slope follows.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum DeformError {
    /// The mirror has no displacements.
    #[error("the mirror has no displacements: give the mesh those that the solver wrote")]
    NoDisplacements,
    /// Points that leave the rotation about a line open.
    #[error(
        "a pose needs three points that are not on a line, got {points} whose extent across their \
         longest direction is {across:.0e} of that along it"
    )]
    OnALine {
        /// How many points.
        points: usize,
        /// Their extent across a line relative to that along it.
        across: f64,
    },
    /// Columns of different lengths.
    #[error("{what}: expected {expected}, one per point before the load, got {found}")]
    WrongLength {
        /// The column.
        what: &'static str,
        /// How many were wanted.
        expected: usize,
        /// How many there are.
        found: usize,
    },
    /// A coordinate that is NaN or infinite.
    #[error("{what} {row} (counted from 0) must be finite, got ({}, {}, {})", at_m[0], at_m[1], at_m[2])]
    NotFinite {
        /// The column.
        what: &'static str,
        /// Its row.
        row: usize,
        /// What was found \[m\].
        at_m: [f64; 3],
    },
    /// An axis along which no slope can be told.
    #[error("axis must be a finite vector across the normals of the mirror, got ({}, {}, {}), {why}", axis[0], axis[1], axis[2])]
    BadAxis {
        /// What was given.
        axis: [f64; 3],
        /// What is wrong with it.
        why: String,
    },
}
