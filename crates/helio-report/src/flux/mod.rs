//! Figures of flux: maps of receivers with contours and profiles, slope errors on the mirror, and how errors fall.
//!
//! [`receiver_figure`] draws what `helio_flux` computed, whatever the receiver; [`grid_map`] and [`grid_profiles`] do
//! so from plain columns, and [`face_map`] colours the faces of a mesh. [`slope_figure`] shows what a load does to a
//! mirror, [`convergence`] and [`series_plot`] draw series of numbers, and [`page`] puts figures and the account of
//! the power on one HTML page.
//!
//! Metres, W/m² and milliradians go in; a map says kW or MW where that reads better. Colours go from nothing to the
//! peak in viridis, signed values from blue by white to red. What has more than a few thousand cells becomes an
//! embedded raster, so that the size of a file does not follow the number of bins.

mod contours;
mod faces;
mod grid;
mod labels;
mod page;
mod plot;
mod profiles;
mod raster;
mod receiver;
mod scale;
mod series;
mod slopes;
mod units;
mod view;

pub use faces::{FaceMap, face_map};
pub use grid::{GridMap, MapText, Surface, grid_map};
pub use page::{FluxPage, Table, page};
pub use profiles::grid_profiles;
pub use receiver::{receiver_figure, receiver_map};
pub use series::{Convergence, Series, SeriesPlot, convergence, series_plot};
pub use slopes::{SlopeColumn, slope_figure, slope_map};

use crate::FigureError;

/// Width of every figure of this module, in pixels of its own.
const WIDTH: f64 = 860.0;
/// Where drawings begin: numbers and a name stand left of it.
const LEFT: f64 = 76.0;
const TITLE: &str = "font-size=\"16\" font-weight=\"600\"";
const SOFT: &str = "fill=\"#555\"";

/// Refuses what is not above 0 and finite.
fn check_length(what: &'static str, value: f64) -> Result<(), FigureError> {
    if value > 0.0 && value.is_finite() {
        return Ok(());
    }
    Err(FigureError::BadValue {
        what,
        wanted: "above 0 m and finite",
        row: None,
        value,
    })
}
