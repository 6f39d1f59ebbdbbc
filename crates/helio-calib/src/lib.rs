#![doc = include_str!("../README.md")]

pub mod error;
pub mod fit;
pub mod model;
pub mod observation;
pub mod parameters;

pub use error::CalibrationError;
pub use fit::{Constraint, Fit, FitOptions, Loss, ResidualForm, Solver, Start, Stop};
pub use observation::{Mount, Observation, Sighting};
pub use parameters::{Parameter, Parameters};
