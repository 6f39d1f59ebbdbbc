//! What the calibration of one heliostat came to, as it is kept between runs.

use helio_core::{MountErrors, PoseErrors};
use serde::{Deserialize, Deserializer, Serialize, Serializer};

use super::OK;
use crate::calibrated::CalibratedSet;

/// A double that is kept bit by bit, NaN and all.
#[derive(Debug, Clone, Copy)]
pub struct Exact(
    /// The double.
    pub f64,
);

impl Serialize for Exact {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.serialize_u64(self.0.to_bits())
    }
}

impl<'de> Deserialize<'de> for Exact {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        u64::deserialize(deserializer).map(|bits| Self(f64::from_bits(bits)))
    }
}

/// A calibrated heliostat.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct Done {
    /// Which of the heliostats with observations.
    pub index: usize,
    /// Its parameter sets.
    pub sets: Vec<DoneSet>,
    /// Records set aside.
    pub rejected: Vec<Left>,
    /// In words.
    pub findings: Vec<String>,
    /// Numbers of sets over the day that were compared, for each epoch in turn.
    pub choices: Vec<Choice>,
}

/// A number of sets over the day.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct Choice {
    /// The number.
    pub sets: usize,
    /// Whether it was taken.
    pub chosen: bool,
    /// RMS error of the beam in the records \[mrad\].
    pub beam_rms_mrad: Exact,
    /// The same on days left out of the fit.
    pub unseen_rms_mrad: Option<Exact>,
}

/// A parameter set.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct DoneSet {
    /// Empty where there is but one.
    pub name: String,
    /// `ok`, or what is wrong.
    pub status: String,
    /// What is wrong, in words.
    pub why: String,
    /// First instant at which it holds \[ns of Unix time\].
    pub valid_from_ns: Option<i64>,
    /// First instant at which it holds no longer.
    pub valid_to_ns: Option<i64>,
    /// Hour angles between which it holds \[rad\].
    pub hours_rad: Option<[Option<Exact>; 2]>,
    /// In the order of the table's columns \[rad\].
    pub errors: [Exact; 6],
    /// Pivot to mirror centre \[m\].
    pub mirror_offset_m: Exact,
    /// Numbers of the parameters that were fitted.
    pub free: Vec<u8>,
    /// In the order of the table's columns \[rad, m\].
    pub sigmas: [Exact; 7],
    /// In the order of [`helio_calib::Parameter::ALL`].
    pub covariance: [[Exact; 7]; 7],
    /// Residual over the distance from pivot to target \[mrad\].
    pub rms_mrad: Exact,
    /// Residual as seen from the mirror \[mrad\].
    pub beam_rms_mrad: Exact,
    /// Steps of the last fit.
    pub iterations: usize,
    /// Condition of its scaled normal matrix.
    pub condition: Exact,
    /// Parameters that the records determine.
    pub rank: usize,
    /// Components less parameters.
    pub degrees_of_freedom: usize,
    /// Standard deviation of a residual of weight one.
    pub sigma: Exact,
    /// Uncertainty of the pointing over the year \[mrad\].
    pub year_pointing_mrad: Exact,
    /// In words.
    pub weakness: String,
    /// Observations of the heliostat that it is fitted to.
    pub rows: Vec<usize>,
}

/// A rejected record.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct Left {
    /// Which observation of the heliostat.
    pub row: usize,
    /// How far the beam was off \[mrad\].
    pub beam_mrad: Exact,
    /// Its word.
    pub reason: String,
    /// Its words.
    pub words: String,
}

impl Done {
    /// One line of text.
    #[must_use]
    pub fn to_line(&self) -> String {
        // Of numbers, texts and lists: nothing here can fail.
        serde_json::to_string(self).unwrap_or_default()
    }

    /// What [`to_line`](Self::to_line) wrote.
    #[must_use]
    pub fn from_line(line: &str) -> Option<Self> {
        serde_json::from_str(line).ok()
    }
}

impl DoneSet {
    /// A heliostat or a stretch of time without a fit, and why.
    #[must_use]
    pub fn without_result(status: &str, why: &str) -> Self {
        const NONE: Exact = Exact(f64::NAN);
        Self {
            name: String::new(),
            status: status.to_owned(),
            why: why.to_owned(),
            valid_from_ns: None,
            valid_to_ns: None,
            hours_rad: None,
            errors: [NONE; 6],
            mirror_offset_m: NONE,
            free: Vec::new(),
            sigmas: [NONE; 7],
            covariance: [[Exact(0.0); 7]; 7],
            rms_mrad: NONE,
            beam_rms_mrad: NONE,
            iterations: 0,
            condition: NONE,
            rank: 0,
            degrees_of_freedom: 0,
            sigma: NONE,
            year_pointing_mrad: NONE,
            weakness: String::new(),
            rows: Vec::new(),
        }
    }

    /// True if there was a fit.
    #[must_use]
    pub fn is_fitted(&self) -> bool {
        self.errors[0].0.is_finite()
    }

    /// `, set NAME` where it has one.
    #[must_use]
    pub fn of(&self) -> String {
        if self.name.is_empty() {
            String::new()
        } else {
            format!(", set {}", self.name)
        }
    }

    /// Its errors.
    #[must_use]
    pub fn mount_errors(&self) -> MountErrors {
        let [tilt, lean, skew, mirror, azimuth, elevation] = self.errors.map(|e| e.0);
        MountErrors {
            pedestal_tilt_rad: tilt,
            pedestal_tilt_azimuth_rad: lean,
            axis_nonorthogonality_rad: skew,
            mirror_tilt_rad: mirror,
            azimuth_reference_rad: azimuth,
            elevation_reference_rad: elevation,
        }
    }

    /// Its row of the table; the parameters only if they may be used, with the pose errors that they were fitted
    /// with.
    #[must_use]
    pub fn to_table(&self, id: &str, pose_errors: PoseErrors) -> CalibratedSet {
        let good = self.status == OK;
        let offset = self
            .free
            .contains(&(helio_calib::Parameter::MirrorOffset as u8));
        let finite = self.covariance.iter().flatten().all(|e| e.0.is_finite());
        let [from, to] = self.hours_rad.unwrap_or_default();
        CalibratedSet {
            set: self.name.clone(),
            errors: good.then(|| self.mount_errors()),
            pose_errors_rad: CalibratedSet::stated(if good {
                pose_errors
            } else {
                PoseErrors::NONE
            }),
            mirror_offset_m: (good && offset).then_some(self.mirror_offset_m.0),
            valid_from_ns: self.valid_from_ns,
            valid_to_ns: self.valid_to_ns,
            hour_angle_from_rad: from.map(|e| e.0),
            hour_angle_to_rad: to.map(|e| e.0),
            sigmas: self.sigmas.map(|e| e.0),
            covariance: (self.is_fitted() && finite)
                .then(|| self.covariance.map(|row| row.map(|e| e.0))),
            rms_mrad: self.rms_mrad.0,
            beam_rms_mrad: self.beam_rms_mrad.0,
            observations: self.rows.len(),
            iterations: self.is_fitted().then_some(self.iterations),
            condition: self.condition.0,
            year_pointing_mrad: self.year_pointing_mrad.0,
            ..CalibratedSet::without_result(id, &self.status, &self.why)
        }
    }
}
