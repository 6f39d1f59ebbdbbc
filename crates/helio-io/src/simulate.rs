//! Synthetic fields and campaigns of observations, as tables.

mod layout;
mod observations;

pub use layout::{LayoutPattern, SimulatedLayout};
pub use observations::{ObservationPlan, SimulateError, SimulatedObservations};
