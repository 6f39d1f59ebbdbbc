//! Errors of wrong calls and of images that cannot be read.

/// A wrong call of a function of this crate.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum SpotError {
    /// An image whose size and number of pixels do not go together, or that has no pixel.
    #[error(
        "an image of {width} x {height} pixels wants {wanted} of them, row by row, found {found}"
    )]
    WrongSize {
        /// Pixels in a row.
        width: usize,
        /// Rows.
        height: usize,
        /// How many pixels that makes, at least one.
        wanted: usize,
        /// How many there are.
        found: usize,
    },
    /// An image of too many pixels to be counted.
    #[error("an image of {width} x {height} pixels is too large: at most {most} pixels")]
    TooLarge {
        /// Pixels in a row.
        width: usize,
        /// Rows.
        height: usize,
        /// The most there may be.
        most: u32,
    },
    /// An option that makes no sense.
    #[error("{what} must be {wanted}, got {value}")]
    BadOption {
        /// The option.
        what: &'static str,
        /// What it must be.
        wanted: &'static str,
        /// What was given.
        value: f64,
    },
}
