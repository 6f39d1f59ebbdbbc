//! Why a run was refused or broke off.

use std::error::Error;
use std::fmt;
use std::path::PathBuf;

use helio_calib::CalibrationError;
use helio_core::error::{FieldError, FrameError, TrackError};
use helio_core::sun::SunError;
use helio_flux::FluxError;
use helio_flux::deform::DeformError;
use helio_flux::mesh::MeshError;
use helio_io::{IoError, PictureError};
use helio_report::FigureError;
use helio_spot::SpotError;

/// Why a run ended before its end.
#[derive(Debug, thiserror::Error)]
pub(crate) enum Failure {
    /// A file, a time or a table; the message names it and says why.
    #[error(transparent)]
    Io(#[from] IoError),
    #[error(transparent)]
    Track(#[from] TrackError),
    #[error(transparent)]
    Field(#[from] FieldError),
    #[error(transparent)]
    Frame(#[from] FrameError),
    #[error(transparent)]
    Sun(#[from] SunError),
    #[error(transparent)]
    Figure(#[from] FigureError),
    /// A wrong option of the search for spots, or of a simulated frame.
    #[error(transparent)]
    Spot(#[from] SpotError),
    /// A scene that cannot be traced.
    #[error(transparent)]
    Flux(#[from] FluxError),
    /// A part that the mesh does not have.
    #[error(transparent)]
    Mesh(#[from] MeshError),
    /// A mirror whose deformation cannot be told.
    #[error(transparent)]
    Deform(#[from] DeformError),
    /// A file that is no picture.
    #[error(transparent)]
    Picture(#[from] PictureError),
    /// What was asked for cannot be done; the whole sentence.
    #[error("{0}")]
    Refused(String),
    #[error(transparent)]
    Calibration(#[from] CalibrationError),
    /// The user stopped it, and what was done is kept.
    #[error(
        "interrupted; {done} of {of} heliostats are finished in {}: repeat the command with --resume", path.display()
    )]
    Paused {
        /// Heliostats finished.
        done: usize,
        /// Heliostats to do.
        of: usize,
        /// Where they are kept.
        path: PathBuf,
    },
    /// A result could not be written at the end, and what was done is kept.
    #[error(
        "{failure}; what is finished is kept in {}: once that is mended, repeat the command with \
         --resume", path.display()
    )]
    AtEnd {
        /// What went wrong.
        failure: Box<Failure>,
        /// Where it is kept.
        path: PathBuf,
    },
    /// The user stopped it.
    #[error("interrupted; {}", written(*.streamed))]
    Interrupted {
        /// True if rows went to standard output as they came.
        streamed: bool,
    },
}

fn written(streamed: bool) -> &'static str {
    if streamed {
        "the rows on standard output are not all"
    } else {
        "nothing was written"
    }
}

impl From<helio_io::calibrate::RunError> for Failure {
    fn from(error: helio_io::calibrate::RunError) -> Self {
        use helio_io::calibrate::RunError;
        match error {
            RunError::Io(error) => error.into(),
            RunError::Calibration(error) => error.into(),
            RunError::Sun(error) => error.into(),
            RunError::Field(error) => error.into(),
            refused => Self::Refused(refused.to_string()),
        }
    }
}

impl Failure {
    pub(crate) fn refused(message: impl Into<String>) -> Self {
        Self::Refused(message.into())
    }

    /// True if the reader of our output has gone.
    pub(crate) fn is_closed_pipe(&self) -> bool {
        matches!(self, Self::Io(e) if e.io_kind() == Some(std::io::ErrorKind::BrokenPipe))
    }

    pub(crate) fn exit_code(&self) -> u8 {
        match self {
            // As shells report a program that ended by this signal.
            Self::Interrupted { .. } | Self::Paused { .. } => 130,
            _ => 2,
        }
    }

    /// The failure and what caused it, in one line (and the lines that quote a file).
    pub(crate) fn chain(&self) -> impl fmt::Display {
        let mut text = self.to_string();
        // Errors of files say in their own words what the system said.
        if !matches!(self, Self::Io(_)) {
            let mut cause = self.source();
            while let Some(error) = cause {
                text.push_str(": ");
                text.push_str(&error.to_string());
                cause = error.source();
            }
        }
        text
    }
}
