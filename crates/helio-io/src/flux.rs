//! What belongs to flux and to files: maps as tables, pictures with a gauge, and mirrors of structures.

mod map;
mod picture;
mod structure;

pub use map::write_flux_map;
pub use picture::{GrayPicture, PictureError, TargetFlux};
pub use structure::{DeformMethod, DeformedMirror, Structure, StructureFiles};
