//! What the calibration of one heliostat came to, as it is kept between runs.

use helio_core::{MountErrors, PoseErrors};
use helio_io::CalibratedSet;
use serde::{Deserialize, Deserializer, Serialize, Serializer};

/// A double that is kept bit by bit, NaN and all.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Exact(pub(crate) f64);

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
pub(crate) struct Done {
    /// Which of the heliostats with observations.
    pub(crate) index: usize,
    pub(crate) sets: Vec<DoneSet>,
    pub(crate) rejected: Vec<Left>,
    /// In words.
    pub(crate) findings: Vec<String>,
    /// Numbers of sets over the day that were compared, for each epoch in turn.
    pub(crate) choices: Vec<Choice>,
}

/// A number of sets over the day.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub(crate) struct Choice {
    pub(crate) sets: usize,
    pub(crate) chosen: bool,
    pub(crate) beam_rms_mrad: Exact,
    pub(crate) unseen_rms_mrad: Option<Exact>,
}

/// A parameter set.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub(crate) struct DoneSet {
    pub(crate) name: String,
    pub(crate) status: String,
    pub(crate) why: String,
    pub(crate) valid_from_ns: Option<i64>,
    pub(crate) valid_to_ns: Option<i64>,
    pub(crate) hours_rad: Option<[Option<Exact>; 2]>,
    /// In the order of the table's columns \[rad\].
    pub(crate) errors: [Exact; 6],
    pub(crate) mirror_offset_m: Exact,
    /// Numbers of the parameters that were fitted.
    pub(crate) free: Vec<u8>,
    /// In the order of the table's columns \[rad, m\].
    pub(crate) sigmas: [Exact; 7],
    pub(crate) covariance: [[Exact; 7]; 7],
    pub(crate) rms_mrad: Exact,
    pub(crate) beam_rms_mrad: Exact,
    pub(crate) iterations: usize,
    pub(crate) condition: Exact,
    pub(crate) rank: usize,
    pub(crate) degrees_of_freedom: usize,
    pub(crate) sigma: Exact,
    pub(crate) year_pointing_mrad: Exact,
    /// In words.
    pub(crate) weakness: String,
    /// Observations of the heliostat that it is fitted to.
    pub(crate) rows: Vec<usize>,
}

/// A rejected record.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub(crate) struct Left {
    /// Which observation of the heliostat.
    pub(crate) row: usize,
    pub(crate) beam_mrad: Exact,
    /// Its word and its words.
    pub(crate) reason: String,
    pub(crate) words: String,
}

impl Done {
    /// One line of text.
    pub(crate) fn to_line(&self) -> String {
        // Of numbers, texts and lists: nothing here can fail.
        serde_json::to_string(self).unwrap_or_default()
    }

    /// What [`to_line`](Self::to_line) wrote.
    pub(crate) fn from_line(line: &str) -> Option<Self> {
        serde_json::from_str(line).ok()
    }
}

impl DoneSet {
    pub(crate) fn without_result(status: &str, why: &str) -> Self {
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
    pub(crate) fn is_fitted(&self) -> bool {
        self.errors[0].0.is_finite()
    }

    /// `, set NAME` where it has one.
    pub(crate) fn of(&self) -> String {
        if self.name.is_empty() {
            String::new()
        } else {
            format!(", set {}", self.name)
        }
    }

    pub(crate) fn mount_errors(&self) -> MountErrors {
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
    pub(crate) fn to_table(&self, id: &str, pose_errors: PoseErrors) -> CalibratedSet {
        let good = self.status == crate::commands::calibrate::OK;
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
