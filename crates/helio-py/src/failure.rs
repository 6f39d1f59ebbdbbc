//! Errors of Rust as exceptions of Python.
//!
//! The classes are Python's own (`helio_py/_errors.py`), which carries their documentation; this module
//! says which case is which class, and what its attributes are. Messages are those of Rust.

use std::fmt::Display;
use std::path::PathBuf;

use helio_core::error::{DriveError, FieldError, TrackError};
use helio_core::sun::SunError;
use helio_flux::FluxError;
use helio_flux::deform::DeformError;
use helio_flux::mesh::{MeshError, ReadError};
use helio_io::{IoError, PictureError, Problem};
use pyo3::prelude::*;
use pyo3::types::PyType;

/// Why a call is refused.
#[derive(Debug)]
pub(crate) enum Failure {
    /// An error of ours.
    Ours(Box<Case>),
    /// One that Python raised while we asked it something, `KeyboardInterrupt` among them.
    Python(PyErr),
}

/// One case: its class, its message, its attributes.
#[derive(Debug)]
pub(crate) struct Case {
    class: &'static str,
    message: String,
    attributes: Vec<(&'static str, Attribute)>,
}

#[derive(Debug)]
enum Attribute {
    Text(String),
    Whole(usize),
    Number(f64),
    Path(PathBuf),
}

impl Failure {
    #[cold]
    pub(crate) fn new(class: &'static str, message: impl Into<String>) -> Self {
        Self::Ours(Box::new(Case {
            class,
            message: message.into(),
            attributes: Vec::new(),
        }))
    }

    /// A failure of an argument or quantity, which `field` names.
    #[cold]
    pub(crate) fn of(class: &'static str, field: &str, message: impl Display) -> Self {
        Self::new(class, format!("{field}: {message}")).with("field", Attribute::Text(field.into()))
    }

    fn with(mut self, name: &'static str, value: Attribute) -> Self {
        if let Self::Ours(case) = &mut self {
            case.attributes.push((name, value));
        }
        self
    }

    fn with_id(self, id: String) -> Self {
        self.with("id", Attribute::Text(id))
    }

    /// With the argument it is of, where it does not name one.
    pub(crate) fn or_of(self, field: &str) -> Self {
        match &self {
            Self::Ours(case) if case.attributes.iter().all(|(name, _)| *name != "field") => {
                self.with_field(field)
            }
            _ => self,
        }
    }

    pub(crate) fn with_field(self, field: &str) -> Self {
        self.with("field", Attribute::Text(field.to_string()))
    }

    pub(crate) fn with_path(self, path: PathBuf) -> Self {
        self.with("path", Attribute::Path(path))
    }

    pub(crate) fn with_row(self, row: usize) -> Self {
        self.with("row", Attribute::Whole(row))
    }

    pub(crate) fn with_value(self, value: f64) -> Self {
        self.with("value", Attribute::Number(value))
    }
}

impl From<PyErr> for Failure {
    fn from(error: PyErr) -> Self {
        Self::Python(error)
    }
}

impl From<TrackError> for Failure {
    fn from(error: TrackError) -> Self {
        let message = error.to_string();
        match error {
            TrackError::LengthMismatch { what, .. } => {
                Self::new("ShapeError", message).with_field(what)
            }
            TrackError::BadAngle {
                what, row, value, ..
            } => Self::new("AngleError", message)
                .with_field(what)
                .with_row(row)
                .with_value(value),
            TrackError::BadSun { row } => Self::new("SunDirectionError", message).with_row(row),
            TrackError::Iterations { .. } => Self::new("OptionError", message).with_field("offset"),
            _ => Self::new("TrackError", message),
        }
    }
}

impl From<FieldError> for Failure {
    fn from(error: FieldError) -> Self {
        let message = error.to_string();
        match error {
            FieldError::BadValue {
                id, what, value, ..
            } => Self::new("FieldValueError", message)
                .with_id(id)
                .with_field(what)
                .with_value(value),
            FieldError::DuplicateId { id, second, .. } => Self::new("DuplicateIdError", message)
                .with_id(id)
                .with_row(second),
            FieldError::EmptyLimits { id, axis, .. } => Self::new("EmptyLimitsError", message)
                .with_id(id)
                .with_field(axis),
            FieldError::NoSuchRow { row, .. } => Self::new("NoSuchRowError", message).with_row(row),
            _ => Self::new("FieldError", message),
        }
    }
}

impl From<SunError> for Failure {
    fn from(error: SunError) -> Self {
        let message = error.to_string();
        match error {
            SunError::BadValue { what, value, .. } => Self::new("SunError", message)
                .with_field(what)
                .with_value(value),
            SunError::OutsideSpan { row, .. } => Self::new("SunError", message).with_row(row),
            _ => Self::new("SunError", message),
        }
    }
}

impl From<DriveError> for Failure {
    fn from(error: DriveError) -> Self {
        let message = error.to_string();
        match error {
            DriveError::BadValue { what, value, .. } => Self::new("DriveError", message)
                .with_field(what)
                .with_value(value),
            _ => Self::new("DriveError", message),
        }
    }
}

impl From<IoError> for Failure {
    fn from(error: IoError) -> Self {
        let class = match error.problem() {
            Problem::Unreadable { .. } | Problem::Reference { .. } => "FileUnreadableError",
            Problem::NotUtf8 { .. } | Problem::Syntax { .. } | Problem::Ragged { .. } => {
                "FileSyntaxError"
            }
            Problem::Unknown { .. } => "UnknownNameError",
            Problem::Missing { .. } | Problem::Empty { .. } => "MissingError",
            Problem::WrongKind { .. }
            | Problem::NotFinite { .. }
            | Problem::OutOfRange { .. }
            | Problem::TooLong { .. } => "FileValueError",
            Problem::Duplicate { .. } => "DuplicateNameError",
            Problem::Conflict { .. } => "ConflictError",
            Problem::Time { .. } => "TimeError",
            _ => "FileError",
        };
        let mut failure = Self::new(class, error.to_string());
        let place = error.place();
        if let Some(path) = &place.path {
            failure = failure.with("path", Attribute::Path(path.clone()));
        }
        for (name, number) in [
            ("line", place.line),
            ("column", place.column),
            ("row", place.row),
        ] {
            if let Some(number) = number {
                failure = failure.with(name, Attribute::Whole(number));
            }
        }
        if let Some(id) = &place.heliostat {
            failure = failure.with_id(id.clone());
        }
        let named = match error.problem() {
            Problem::Unknown { name, .. } => Some(name.as_str()),
            // "the column `time`", or a key
            Problem::Missing { what, .. } if !what.contains(' ') => Some(what.as_str()),
            Problem::Missing { what, .. } => what.split('`').nth(1),
            Problem::WrongKind { what, .. }
            | Problem::NotFinite { what, .. }
            | Problem::OutOfRange { what, .. } => {
                Some(what.as_str()).filter(|what| !what.is_empty())
            }
            _ => None,
        };
        if let Some(field) = place.field.as_deref().or(named) {
            failure = failure.with_field(field);
        }
        failure
    }
}

impl From<FluxError> for Failure {
    fn from(error: FluxError) -> Self {
        let message = error.to_string();
        match error {
            FluxError::BadValue { what, value, .. } => Self::new("FluxError", message)
                .with_field(what)
                .with_value(value),
            FluxError::Tracking(error) => error.into(),
            _ => Self::new("FluxError", message),
        }
    }
}

impl From<MeshError> for Failure {
    fn from(error: MeshError) -> Self {
        Self::new("MeshError", error.to_string())
    }
}

impl From<ReadError> for Failure {
    fn from(error: ReadError) -> Self {
        Self::new("MeshError", error.to_string())
    }
}

impl From<DeformError> for Failure {
    fn from(error: DeformError) -> Self {
        Self::new("MeshError", error.to_string())
    }
}

impl From<PictureError> for Failure {
    fn from(error: PictureError) -> Self {
        match error {
            PictureError::Unreadable(error) => error.into(),
            other => Self::new("ImageError", other.to_string()),
        }
    }
}

impl From<Failure> for PyErr {
    fn from(failure: Failure) -> Self {
        match failure {
            Failure::Python(error) => error,
            Failure::Ours(case) => {
                Python::attach(|py| case.raised(py).unwrap_or_else(|error| error))
            }
        }
    }
}

impl Case {
    fn raised(&self, py: Python<'_>) -> PyResult<PyErr> {
        let classes = py.import("helio_py._errors")?;
        let class = classes.getattr(self.class)?.cast_into::<PyType>()?;
        let error = class.call1((self.message.as_str(),))?;
        for (name, value) in &self.attributes {
            match value {
                Attribute::Text(text) => error.setattr(*name, text)?,
                Attribute::Whole(whole) => error.setattr(*name, whole)?,
                Attribute::Number(number) => error.setattr(*name, number)?,
                Attribute::Path(path) => error.setattr(*name, path)?,
            }
        }
        Ok(PyErr::from_value(error))
    }
}
