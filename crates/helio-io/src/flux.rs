//! What belongs to flux and to files: maps as tables, and pictures with a gauge.

mod map;
mod picture;

pub use map::write_flux_map;
pub use picture::{GrayPicture, PictureError, TargetFlux};
