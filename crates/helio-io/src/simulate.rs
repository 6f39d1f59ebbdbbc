//! Synthetic fields, campaigns and camera frames, as tables and files.

mod campaign;
mod image_folder;
mod image_plan;
mod images;
mod layout;
mod observations;

pub use campaign::SimulatedCampaign;
pub use image_plan::{ImageBeam, ImagePlan};
pub use images::{FramePixels, ImagesError, SimulatedImages};
pub use layout::{LayoutPattern, SimulatedLayout};
pub use observations::{ObservationPlan, SimulateError, SimulatedObservations};
