//! Errors of wrong calls. A fit that stopped early is no error: see [`Stop`](crate::Stop).

use crate::parameters::Parameter;

/// A wrong call of a calibration function.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum CalibrationError {
    /// A number of an observation is NaN, infinite or outside its range.
    #[error("observation {row}: {what} must be {wanted}, got {value}")]
    BadValue {
        /// Which observation, counted from 0.
        row: usize,
        /// The quantity, as in the glossary.
        what: &'static str,
        /// The range it must lie in.
        wanted: &'static str,
        /// What was given.
        value: f64,
    },
    /// Some observations state their standard deviation, others do not.
    #[error(
        "observation {row} states no sigma_m, but observation {stated} does: state it for all or for none"
    )]
    SigmaMissing {
        /// The first that does not, counted from 0.
        row: usize,
        /// The first that does.
        stated: usize,
    },
    /// Fewer observations than the parameters that are to be found need.
    #[error(
        "{found} observations cannot give {parameters} parameters: at least {wanted} are needed"
    )]
    TooFew {
        /// How many there are.
        found: usize,
        /// How many are needed.
        wanted: usize,
        /// How many parameters are free.
        parameters: usize,
    },
    /// An option that makes no sense.
    #[error("{what} must be {wanted}, got {value}")]
    BadOption {
        /// The option.
        what: &'static str,
        /// The range it must lie in.
        wanted: &'static str,
        /// What was given.
        value: f64,
    },
    /// A prior that makes no sense.
    #[error("prior of {}: its mean must be finite and its standard deviation positive, got {mean} and {sigma}", parameter.as_str())]
    BadPrior {
        /// Of which parameter.
        parameter: Parameter,
        /// Its mean.
        mean: f64,
        /// Its standard deviation.
        sigma: f64,
    },
    /// No heliostat stands in a place.
    #[error("{what} must be below {count}, the number of heliostats, got {place}")]
    NoSuchHeliostat {
        /// The argument.
        what: &'static str,
        /// How many heliostats there are.
        count: usize,
        /// What was given, counted from 0.
        place: usize,
    },
    /// Whoever watched it asked it to stop.
    #[error("stopped before its end")]
    Stopped,
    /// Nothing is free.
    #[error("every parameter is held: there is nothing to fit")]
    NothingFree,
}

/// What stands in a heliostat's place; `what` names the argument that says which.
pub(crate) fn in_place<'a, T>(
    all: &'a [T],
    what: &'static str,
    place: usize,
) -> Result<&'a T, CalibrationError> {
    let count = all.len();
    all.get(place)
        .ok_or(CalibrationError::NoSuchHeliostat { what, count, place })
}
