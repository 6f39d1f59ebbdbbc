//! Axis angles through their drives, and their beams followed back to the target.

use std::borrow::Cow;

use helio_core::drive::Drive;
use helio_core::error::TrackError;
use helio_core::tracking::Prediction;
use helio_core::{EnuUnit, Status, TargetPlane, TrackOptions, Tracker};
use rayon::prelude::*;

use crate::output::{Number, Scale};

/// Rows from which a simple pass is worth a second thread.
const ROWS_PER_TASK: usize = 1 << 15;

/// The numbers of a table of axis angles, in the order of its columns: angles, incidence and excess of limits; with `drives`
/// the steps of both axes; with `leftovers` both corrections and both standard deviations; if `verified` the beam's error.
///
/// ```
/// let numbers = helio_io::tracked_numbers(false, false, true);
/// assert_eq!(numbers[0].name, "azimuth_deg");
/// assert_eq!(numbers[4].name, "beam_error_mrad");
/// ```
#[must_use]
pub fn tracked_numbers(drives: bool, leftovers: bool, verified: bool) -> Vec<Number> {
    let mut numbers = vec![
        Number::degrees("azimuth_deg"),
        Number::degrees("elevation_deg"),
        Number::degrees("incidence_deg"),
        // The one number of a row without an answer: by how much it has none.
        Number::degrees("limit_excess_deg").also(Status::OutsideLimits),
    ];
    if drives {
        numbers.push(Number::new("axis1_steps", Scale::Whole));
        numbers.push(Number::new("axis2_steps", Scale::Whole));
    }
    if leftovers {
        numbers.extend(
            [
                "leftover_axis1_mrad",
                "leftover_axis2_mrad",
                "sigma_axis1_mrad",
                "sigma_axis2_mrad",
            ]
            .map(|name| Number::new(name, Scale::Milliradians)),
        );
    }
    if verified {
        numbers.push(Number::new("beam_error_mrad", Scale::Milliradians));
    }
    numbers
}

/// A number for each row of whole suns from its heliostat's drives and its angle \[rad\]; NaN where there is none. A field
/// without drives has none to state.
pub fn by_row(
    drives: &[[Option<Drive>; 2]],
    angles_rad: &[f64],
    number: impl Fn(&[Option<Drive>; 2], f64) -> Option<f64> + Sync,
) -> Vec<f64> {
    let n = drives.len();
    angles_rad
        .par_iter()
        .enumerate()
        .with_min_len(ROWS_PER_TASK)
        .map(|(row, &angle)| {
            if angle.is_nan() {
                return f64::NAN;
            }
            let drives = if n == 0 { &[None; 2] } else { &drives[row % n] };
            number(drives, angle).unwrap_or(f64::NAN)
        })
        .collect()
}

/// Marks the rows whose angles no steps of their drive lead to; `steps` are those of both axes, as [`by_row`] has them.
pub fn beyond_drives(
    drives: &[[Option<Drive>; 2]],
    steps: [&[f64]; 2],
    status: &mut Cow<'_, [Status]>,
) {
    let n = drives.len().max(1);
    for row in 0..status.len() {
        if steps[0][row].is_nan() || steps[1][row].is_nan() {
            let Some(drives) = drives.get(row % n) else {
                continue;
            };
            let lacks = |axis: usize| drives[axis].is_some() && steps[axis][row].is_nan();
            if status[row] == Status::Ok && (lacks(0) || lacks(1)) {
                status.to_mut()[row] = Status::OutsideLimits;
            }
        }
    }
}

/// Follows beams back to the target: through whole motor steps where there is a drive, then forward.
///
/// ```
/// use helio_core::{
///     Enu, EnuUnit, Field, Heliostat, OffsetForm, Status, TargetPlane, TrackOptions, Tracker, TrackingMode,
/// };
/// let aim = Enu::new(0.0, 0.0, 40.0);
/// let mut field = Field::new(TrackingMode::AzimuthElevation);
/// field.push("A1", Heliostat::new(Enu::new(0.0, 50.0, 2.0), aim))?;
/// let tracker = Tracker::new(&field, OffsetForm::Exact)?;
/// let sun = EnuUnit::from_azimuth_elevation(3.0, 0.8);
/// let tracking = tracker.track(sun);
/// let toward = EnuUnit::try_new(Enu::new(0.0, 50.0, -38.0))?;
/// let planes = vec![TargetPlane::level(aim, toward)];
/// let mut back = helio_io::BeamsBack::new(&[], planes, TrackOptions::default());
/// let [axis1_rad, axis2_rad] = back.angles_rad([tracking.axis1_rad(), tracking.axis2_rad()], None);
/// let (mut status, mut errors_rad) = ([Status::Ok], Vec::new());
/// back.sun(&tracker, sun, [&axis1_rad, &axis2_rad], &mut status, &mut errors_rad)?;
/// assert!(errors_rad[0] < 1e-9);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Debug)]
pub struct BeamsBack<'a> {
    drives: &'a [[Option<Drive>; 2]],
    planes: Vec<TargetPlane>,
    options: TrackOptions,
    prediction: Prediction,
}

impl<'a> BeamsBack<'a> {
    /// For a field with these drives (none, or a pair for each heliostat) and a plane for each heliostat.
    #[must_use]
    pub fn new(
        drives: &'a [[Option<Drive>; 2]],
        planes: Vec<TargetPlane>,
        options: TrackOptions,
    ) -> Self {
        Self {
            drives,
            planes,
            options,
            prediction: Prediction::default(),
        }
    }

    /// The angles \[rad\] of whole suns to which the nearest whole steps lead, corrections by pose taken out again: followed
    /// back through the angles alone, these would look like errors. NaN where a drive has no such step.
    #[must_use]
    pub fn angles_rad(
        &self,
        axes_rad: [&[f64]; 2],
        turns_rad: Option<[&[f64]; 2]>,
    ) -> [Vec<f64>; 2] {
        [0, 1].map(|axis| {
            let mut angles = by_row(self.drives, axes_rad[axis], |drives, angle| {
                match &drives[axis] {
                    Some(drive) => drive.quantised_rad(angle),
                    None => Some(angle),
                }
            });
            if let Some(turns) = turns_rad {
                for (angle, turn) in angles.iter_mut().zip(turns[axis]) {
                    *angle -= if turn.is_nan() { 0.0 } else { *turn };
                }
            }
            angles
        })
    }

    /// Adds the angle of each heliostat's beam off its aim \[rad\] under one sun, from what
    /// [`angles_rad`](Self::angles_rad) gave for it; NaN where there is none. A row that was ok has another status then:
    /// `misses_target`, or `outside_limits` where the whole step nearest to an end of the drive lies beyond it.
    ///
    /// # Errors
    /// [`TrackError`] for angles that have no precision left.
    pub fn sun(
        &mut self,
        tracker: &Tracker,
        toward: EnuUnit,
        [axis1_rad, axis2_rad]: [&[f64]; 2],
        status: &mut [Status],
        errors_rad: &mut Vec<f64>,
    ) -> Result<(), TrackError> {
        let Self {
            planes,
            options,
            prediction,
            ..
        } = self;
        tracker.predict_into(toward, axis1_rad, axis2_rad, planes, options, prediction)?;
        for (row, status) in status.iter_mut().enumerate() {
            let mut error_rad = f64::NAN;
            if *status == Status::Ok {
                if axis1_rad[row].is_nan() || axis2_rad[row].is_nan() {
                    *status = Status::OutsideLimits;
                } else if prediction.status[row] == Status::Ok {
                    error_rad = prediction.beam_error_rad[row];
                } else {
                    *status = Status::MissesTarget;
                }
            }
            errors_rad.push(error_rad);
        }
        Ok(())
    }
}
