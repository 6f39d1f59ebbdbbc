//! Where beams land, from the rows of a table of axis angles.

use std::ops::Range;

use helio_calib::aiming::hour_angle_rad;
use helio_core::error::{FieldError, TrackError};
use helio_core::tracking::Prediction;
use helio_core::{EnuUnit, Field, OffsetForm, TargetPlane, TrackOptions, Tracker};

use crate::error::IoError;
use crate::field::LoadedField;
use crate::small::Angles;

/// Predicts the rows of a table of axis angles, those of one sun that follow each other at once.
///
/// ```no_run
/// use helio_core::{EnuUnit, TrackOptions};
/// let loaded = helio_io::load_field("field.toml".as_ref())?;
/// let angles = helio_io::load_angles("angles.csv".as_ref() as &std::path::Path, &loaded)?;
/// let mut predictor = helio_io::RowPredictor::new(&loaded, TrackOptions::default())?;
/// let sun = EnuUnit::from_azimuth_elevation(3.0, 0.8);
/// let mut start = 0;
/// while start < angles.heliostat.len() {
///     let end = predictor.group_end(&angles, start, |_, _| true);
///     let landed = predictor.predict(&angles, start..end, sun, None)?;
///     for &heliostat in &angles.heliostat[start..end] {
///         println!("{} {}", landed.u_m[heliostat], landed.v_m[heliostat]);
///     }
///     start = end;
/// }
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Debug)]
pub struct RowPredictor<'a> {
    loaded: &'a LoadedField,
    tracker: Tracker,
    /// A field that is brought up to date for each sun, and its latitude.
    changing: Option<(Field, f64)>,
    options: TrackOptions,
    planes: Vec<TargetPlane>,
    /// Where the group begins that each heliostat was last seen in.
    seen: Vec<usize>,
    axis1_rad: Vec<f64>,
    axis2_rad: Vec<f64>,
    prediction: Prediction,
}

/// Why rows cannot be predicted.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum RowPredictorError {
    /// A calibration of the hour of a field without a site.
    #[error(
        "the calibration changes with the hour angle of the sun, which needs the latitude from \
         [site]"
    )]
    NoLatitude,
    /// The field cannot be tracked.
    #[error(transparent)]
    Field(#[from] FieldError),
    /// An angle has no precision left.
    #[error(transparent)]
    Track(#[from] TrackError),
    /// The calibration has none for a time.
    #[error(transparent)]
    Calibration(#[from] IoError),
}

impl<'a> RowPredictor<'a> {
    /// For a field.
    ///
    /// # Errors
    /// [`RowPredictorError`].
    pub fn new(loaded: &'a LoadedField, options: TrackOptions) -> Result<Self, RowPredictorError> {
        let n = loaded.field.len();
        let planes: Result<_, _> = (0..n).map(|row| loaded.plane_for(row)).collect();
        let changing = match (&loaded.schedule, &loaded.site) {
            (Some(_), Some(site)) => Some((loaded.field.clone(), site.latitude_rad)),
            (Some(_), None) => return Err(RowPredictorError::NoLatitude),
            (None, _) => None,
        };
        Ok(Self {
            loaded,
            // Forward needs no offset form: the mirror's centre lies where it lies.
            tracker: Tracker::new(&loaded.field, OffsetForm::Exact)?,
            changing,
            options,
            planes: planes?,
            seen: vec![usize::MAX; n],
            axis1_rad: vec![f64::NAN; n],
            axis2_rad: vec![f64::NAN; n],
            prediction: Prediction::default(),
        })
    }

    /// The end of the rows from `start` on that have the same sun and name each heliostat once. Groups are asked for one
    /// after another.
    pub fn group_end(
        &mut self,
        angles: &Angles,
        start: usize,
        same: impl Fn(usize, usize) -> bool,
    ) -> usize {
        let mut end = start;
        while end < angles.heliostat.len() && same(start, end) {
            // A mark that is this group's own start needs no clearing between groups.
            let mark = &mut self.seen[angles.heliostat[end]];
            if *mark == start {
                break;
            }
            *mark = start;
            end += 1;
        }
        end
    }

    /// Where the beams of a group's rows land under its sun, an entry for each heliostat of the field.
    ///
    /// # Errors
    /// [`RowPredictorError`].
    pub fn predict(
        &mut self,
        angles: &Angles,
        rows: Range<usize>,
        sun: EnuUnit,
        unix_ns: Option<i64>,
    ) -> Result<&Prediction, RowPredictorError> {
        if let (Some(schedule), Some((field, latitude_rad))) =
            (&self.loaded.schedule, &mut self.changing)
        {
            let hour_rad = hour_angle_rad(sun, *latitude_rad);
            if schedule.update(field, unix_ns, hour_rad)? {
                self.tracker = Tracker::new(field, OffsetForm::Exact)?;
            }
        }
        self.axis1_rad.fill(f64::NAN);
        self.axis2_rad.fill(f64::NAN);
        for row in rows {
            self.axis1_rad[angles.heliostat[row]] = angles.axis1_rad[row];
            self.axis2_rad[angles.heliostat[row]] = angles.axis2_rad[row];
        }
        let p = &mut self.prediction;
        let (axis1, axis2) = (&self.axis1_rad, &self.axis2_rad);
        self.tracker
            .predict_into(sun, axis1, axis2, &self.planes, &self.options, p)?;
        Ok(&self.prediction)
    }
}
