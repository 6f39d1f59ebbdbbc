#![doc = include_str!("../README.md")]

pub mod aiming;
pub mod covariance;
pub mod diagnosis;
pub mod error;
pub mod field;
pub mod fit;
pub mod joint;
pub mod loss;
pub mod measures;
pub mod model;
pub mod observation;
pub mod parameters;
pub mod plan;
pub mod random;
mod residual;
pub mod schedule;
pub mod simulate;
mod solver;
mod start;

pub use covariance::{Uncertainty, student_t95, tilt_standard_error, uncertainty};
pub use diagnosis::{
    CalibrateOptions, Calibration, Context, Epoch, Finding, Reason, Rejected, Verdict, Weakness,
    WrongCall, calibrate,
};
pub use error::CalibrationError;
pub use field::{Campaign, FieldFit, FieldFitOptions, fit_field};
pub use fit::{Constraint, Fit, FitOptions, Loss, ResidualForm, Solver, Start, Stop, fit};
pub use measures::{Measures, beam_errors_mrad, measures, pointing_sigma_mrad};
pub use observation::{Mount, Observation, Sighting};
pub use parameters::{Parameter, Parameters};
pub use plan::{Candidate, Duty, PlanOptions, Proposal, plan};
pub use schedule::{HourSet, Schedule, SetChoice, Sets, fit_sets};
pub use simulate::{SimulateOptions, Simulated, simulate};
