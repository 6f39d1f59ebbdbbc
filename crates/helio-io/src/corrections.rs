//! Axis angles corrected by what a joint calibration left by pose.

use std::fmt::{self, Display, Formatter};
use std::path::PathBuf;

use helio_calib::joint::Leftover;
use helio_calib::{Mount, Parameters};
use helio_core::{AxisLimits, Field, Status};
use rayon::prelude::*;

use crate::error::IoError;
use crate::field::CalibrationSchedule;
use crate::leftovers::load_leftovers;
use crate::table::TableSource;
use crate::words::Grouped;

/// Angles that differ by more than this are not those that leftovers were written for \[rad\].
const SAME_RAD: f64 = 1e-9;

/// What is left by pose, heliostat by heliostat of a field.
///
/// ```
/// use helio_calib::joint::{Leftover, LeftoverParts};
/// use helio_core::{Enu, Field, Heliostat, Status, TrackingMode};
/// use helio_io::output::{Destination, Format};
/// let mut field = Field::new(TrackingMode::AzimuthElevation);
/// field.push("A1", Heliostat::new(Enu::new(0.0, 50.0, 2.0), Enu::new(0.0, 0.0, 40.0)))?;
/// let parts = LeftoverParts {
///     length_rad: 0.3,
///     amplitude_rad: [3e-4; 2],
///     most_rad: 1e-3,
///     poses_rad: vec![[3.1, 0.8]],
///     turns_rad: vec![[2e-4, -1e-4]],
///     angles_rad: [0.0; 6],
///     causes: Vec::new(),
///     moved_rad: vec![0.0; 6],
///     covariance: vec![0.0; 36],
/// };
/// let folder = tempfile::tempdir()?;
/// let path = folder.path().join("left.csv");
/// let left = [Leftover::from_parts(parts)?];
/// helio_io::write_leftovers(Destination::File(path.clone()), Format::Csv, &["A1".into()], &left)?;
/// let corrections = helio_io::Corrections::load(&path, &field, None)?;
/// let corrected = corrections.correct(&[3.1], &[0.8], &[Status::Ok]);
/// assert!((corrected.turns_rad[0][0] - 2e-4).abs() < 1e-6);
/// assert!(corrections.of_another_calibration().is_none());
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Debug)]
pub struct Corrections {
    of: Vec<Option<Known>>,
    others: Option<OtherCalibration>,
}

/// A heliostat whose leftovers are known.
#[derive(Debug)]
struct Known {
    leftover: Leftover,
    mount: Mount,
    parameters: Parameters,
    limits: AxisLimits,
}

/// Axis angles with their corrections, a row for each of the angles given \[rad\].
#[derive(Debug, Clone, Default, PartialEq)]
#[non_exhaustive]
pub struct Corrected {
    /// Angles of both axes, corrected where something is known.
    pub axes_rad: [Vec<f64>; 2],
    /// The corrections that are in them; NaN where none is known.
    pub turns_rad: [Vec<f64>; 2],
    /// One standard deviation of what is still wrong; NaN where no correction is known.
    pub sigmas_rad: [Vec<f64>; 2],
}

/// Why nothing can be corrected.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum CorrectionsError {
    /// Corrections stand on the angles of one calibration.
    #[error(
        "{} belongs to one calibration, and that of the field changes with the hour or the date",
        path.display()
    )]
    Changing {
        /// The table of leftovers.
        path: PathBuf,
    },
    /// The table cannot be read.
    #[error(transparent)]
    Table(#[from] IoError),
}

/// Heliostats of another calibration than their leftovers were written for; says so up to how that is mended.
#[derive(Debug, Clone, PartialEq, Eq)]
#[non_exhaustive]
pub struct OtherCalibration {
    /// The table of leftovers.
    pub path: PathBuf,
    /// How many heliostats there are.
    pub heliostats: usize,
    /// Name of the first.
    pub first: String,
}

impl Display for OtherCalibration {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        write!(f, "{}: ", self.path.display())?;
        match self.heliostats {
            1 => f.write_str("1 heliostat is")?,
            many => write!(f, "{} heliostats are", Grouped(many as u64))?,
        }
        write!(
            f,
            " now of another calibration than these leftovers were written for (first `{}`)",
            self.first
        )
    }
}

impl Corrections {
    /// Reads what is left by pose of a field's heliostats; `schedule` is what the field's calibration changes by.
    ///
    /// # Errors
    /// [`CorrectionsError::Changing`] where there is a schedule, and as [`load_leftovers`].
    pub fn load<'a>(
        table: impl Into<TableSource<'a>>,
        field: &Field,
        schedule: Option<&CalibrationSchedule>,
    ) -> Result<Self, CorrectionsError> {
        let table = table.into();
        let path = table.path().to_path_buf();
        if schedule.is_some() {
            return Err(CorrectionsError::Changing { path });
        }
        let mut others = Vec::new();
        let mut of = Vec::with_capacity(field.len());
        for (row, leftover) in load_leftovers(table, field)?.into_iter().enumerate() {
            let heliostat = &field.heliostats()[row];
            let parameters = Parameters::new(&heliostat.errors, heliostat.mirror_offset_m);
            let known = leftover.map(|leftover| {
                let wanted = leftover.parts().angles_rad;
                let mut pairs = wanted.iter().zip(&parameters.values);
                if pairs.any(|(a, b)| (a - b).abs() > SAME_RAD) {
                    others.push(row);
                }
                Known {
                    leftover,
                    mount: Mount::of(field.mode(), heliostat),
                    parameters,
                    limits: heliostat.limits,
                }
            });
            of.push(known);
        }
        let others = others.first().map(|&first| OtherCalibration {
            path,
            heliostats: others.len(),
            first: field.ids()[first].clone(),
        });
        Ok(Self { of, others })
    }

    /// What is to be warned of: heliostats that have another calibration than the one that their leftovers stand on.
    #[must_use]
    pub const fn of_another_calibration(&self) -> Option<&OtherCalibration> {
        self.others.as_ref()
    }

    /// Corrects the angles \[rad\] of whole suns, the field's heliostats one after another, where the status is ok.
    /// Limits are kept: a correction ends at them.
    #[must_use]
    pub fn correct(&self, axis1_rad: &[f64], axis2_rad: &[f64], status: &[Status]) -> Corrected {
        let rows: Vec<[f64; 6]> = (0..status.len())
            .into_par_iter()
            .map(|row| {
                let [one, two] = [axis1_rad[row], axis2_rad[row]];
                match &self.of[row % self.of.len()] {
                    Some(known) if status[row] == Status::Ok => known.correct(one, two),
                    _ => [one, two, f64::NAN, f64::NAN, f64::NAN, f64::NAN],
                }
            })
            .collect();
        let column = |k: usize| rows.iter().map(|row| row[k]).collect();
        Corrected {
            axes_rad: [0, 1].map(column),
            turns_rad: [2, 3].map(column),
            sigmas_rad: [4, 5].map(column),
        }
    }
}

impl Known {
    fn correct(&self, axis1_rad: f64, axis2_rad: f64) -> [f64; 6] {
        let turn = self.leftover.turn_rad(axis1_rad, axis2_rad);
        let limits = &self.limits;
        let corrected = [
            (axis1_rad + turn[0])
                .max(limits.axis1_min_rad)
                .min(limits.axis1_max_rad),
            (axis2_rad + turn[1])
                .max(limits.axis2_min_rad)
                .min(limits.axis2_max_rad),
        ];
        let sigma = self
            .leftover
            .sigma_rad(&self.mount, &self.parameters, axis1_rad, axis2_rad);
        [
            corrected[0],
            corrected[1],
            corrected[0] - axis1_rad,
            corrected[1] - axis2_rad,
            sigma[0],
            sigma[1],
        ]
    }
}
