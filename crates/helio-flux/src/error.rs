//! Errors of wrong calls.

/// A wrong call of a function of this crate.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum FluxError {
    /// A corner of an element is NaN or infinite.
    #[error("element: corner {corner} (counted from 0) must be finite, got ({}, {}, {})", at[0], at[1], at[2])]
    BadCorner {
        /// Which corner.
        corner: usize,
        /// What was given \[m\].
        at: [f64; 3],
    },
    /// The corners of an element lie on a line or at a point.
    #[error(
        "element: its corners must span an area, got {area_m2:e} m² for a largest extent of {extent_m} m"
    )]
    NoArea {
        /// The area found \[m²\].
        area_m2: f64,
        /// Largest distance between two corners \[m\].
        extent_m: f64,
    },
    /// A number is NaN, infinite or outside its range.
    #[error("{who}: {what} must be {wanted}, got {value}")]
    BadValue {
        /// What it was given to.
        who: &'static str,
        /// The quantity, as in the glossary.
        what: &'static str,
        /// The range it must lie in.
        wanted: &'static str,
        /// What was given.
        value: f64,
    },
    /// A mesh receiver without a triangle.
    #[error("mesh receiver: wants at least one triangle, got none")]
    NoTriangles,
    /// A triangle of a mesh receiver that is none.
    #[error("mesh receiver: triangle {row} (counted from 0): {why}")]
    BadTriangle {
        /// Which.
        row: usize,
        /// What is wrong with it.
        why: Box<FluxError>,
    },
    /// An instruction-set level that this processor does not have was asked for.
    #[error("instruction set {level} is not available on this processor")]
    LevelUnavailable {
        /// The level asked for.
        level: helio_core::SimdLevel,
    },
    /// A bin so coarse that no affordable number of points finds the images of the mirrors.
    #[error(
        "convolution: bin {bin} (counted from 0) wants {found} points or more along each side to see the images of the \
         mirrors, wanted fewer than {most}: take finer bins, or rays"
    )]
    BinsTooCoarse {
        /// Which bin, row by row.
        bin: usize,
        /// Points that it wants along each side, at least.
        found: usize,
        /// Points that are too many.
        most: usize,
    },
    /// Bins so coarse for the images of the mirrors that their integral did not settle.
    #[error(
        "convolution: {found:e} of the reflected power still changes or is too much after {evaluations} evaluations, wanted {wanted:e}: \
         take finer bins, more points, or rays"
    )]
    NotSettled {
        /// Last change of the power of the bins, or what is received beyond all that is reflected, as part of the
        /// reflected power; 1 if not even one pass was affordable.
        found: f64,
        /// What it may be.
        wanted: f64,
        /// How often a mirror was seen from a point.
        evaluations: u64,
    },
    /// Rays that were made for another scene.
    #[error("rays: made for another sun shape, optical error or seed than asked for")]
    OtherRays,
    /// A field that cannot be tracked as asked.
    #[error(transparent)]
    Tracking(#[from] helio_core::error::TrackError),
    /// A picture whose size and number of gray values do not go together.
    #[error(
        "a picture of {rows} rows and {columns} columns wants at least one pixel and as many gray values, found {found}"
    )]
    WrongSize {
        /// Rows.
        rows: usize,
        /// Columns.
        columns: usize,
        /// Gray values given.
        found: usize,
    },
}
