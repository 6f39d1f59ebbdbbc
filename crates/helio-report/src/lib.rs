//! Figures of helio-rs as SVG, and self-contained HTML pages that hold them.
//!
//! [`field_map`] draws a field from above, each heliostat coloured by an angle or by its status;
//! [`angle_curves`] draws axis angles and incidence of a few heliostats over time. Both give a
//! [`Figure`], which [`Figure::to_svg`] turns into a file, [`stack`] puts under another, and
//! [`Page`] shows in HTML. [`calibration`] makes the page of a calibration heliostat by heliostat,
//! [`joint`] that of a field calibrated as one, [`flux`] maps, profiles and slope errors of loaded
//! mirrors. A figure needs nothing from outside: no script, no font, no style sheet; with the
//! feature `png`, `Figure::to_png` paints it with a font of its own.
//!
//! Units at this edge are those printed: metres and degrees. Colours are safe for colour-blind
//! readers: viridis for values, a darkened twilight (cyclic) for azimuths, and the palette of Okabe
//! and Ito for statuses.

pub mod accuracy;
pub mod calibration;
mod curves;
pub mod flux;
mod html;
pub mod joint;
mod map;
mod palette;
#[cfg(feature = "png")]
mod png;
mod run;
mod svg;
mod ticks;

pub use curves::{AngleCurves, Curve, CurveAxis, angle_curves};
pub use html::Page;
pub use map::{FieldMap, MapColour, field_map};
pub use run::AboutRun;
pub use svg::{Figure, stack};

/// A figure that cannot be drawn.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub enum FigureError {
    /// Two columns of one figure differ in length.
    LengthMismatch {
        /// The column.
        what: &'static str,
        /// Entries wanted.
        expected: usize,
        /// Entries given.
        got: usize,
    },
    /// There is nothing to draw.
    Empty {
        /// What is missing.
        what: &'static str,
    },
    /// A number that has no place in the figure.
    BadValue {
        /// The column or the option.
        what: &'static str,
        /// What it may be.
        wanted: &'static str,
        /// Its row, counted from 0, in a column.
        row: Option<usize>,
        /// What it is.
        value: f64,
    },
    /// Pixels that a library did not take.
    Pixels {
        /// What the library says.
        why: String,
    },
}

impl std::fmt::Display for FigureError {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::LengthMismatch {
                what,
                expected,
                got,
            } => {
                write!(f, "figure: {what}: expected {expected} entries, got {got}")
            }
            Self::Empty { what } => write!(f, "figure: there is no {what} to draw"),
            Self::BadValue {
                what,
                wanted,
                row,
                value,
            } => {
                write!(f, "figure: {what}: expected {wanted}, got {value}")?;
                match row {
                    Some(row) => write!(f, " in row {row} (counted from 0)"),
                    None => Ok(()),
                }
            }
            Self::Pixels { why } => write!(f, "figure: pixels: {why}"),
        }
    }
}

impl std::error::Error for FigureError {}

pub(crate) fn equal(what: &'static str, expected: usize, got: usize) -> Result<(), FigureError> {
    if expected == got {
        return Ok(());
    }
    Err(FigureError::LengthMismatch {
        what,
        expected,
        got,
    })
}
