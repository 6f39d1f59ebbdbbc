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
    /// Bins that cut the sharp image of an element so often that its light cannot be shared out among them.
    #[error(
        "convolution: element {element} (counted from 0): {found:.1e} of its light may be in wrong bins, wanted {wanted:.1e}: \
         its image is too sharp for the receiver's bins, or grazes too much of it: take fewer bins, or rays"
    )]
    NotSettled {
        /// Which element.
        element: usize,
        /// The part of its reflected power that may be in wrong bins.
        found: f64,
        /// What it may be.
        wanted: f64,
    },
    /// A mesh receiver that stands in its own light, of which an integral knows nothing.
    #[error(
        "convolution: triangle {bin} (counted from 0) of the receiver, or a part of it, lies behind triangle {by}: take rays"
    )]
    HiddenBin {
        /// Which triangle.
        bin: usize,
        /// What it lies behind.
        by: usize,
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
