//! Synthetic fields, campaigns and camera frames, as tables and files.

mod campaign;
mod image_folder;
mod images;
mod layout;
mod observations;

pub use campaign::SimulatedCampaign;
pub use images::{FramePixels, ImageBeam, ImagePlan, ImagesError, SimulatedImages};
pub use layout::{LayoutPattern, SimulatedLayout};
pub use observations::{ObservationPlan, SimulateError, SimulatedObservations};
