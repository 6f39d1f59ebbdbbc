//! What is known of every heliostat, as rows of the calibration table.

use helio_calib::aiming::encoder_angles_rad;
use helio_calib::joint::{AxisCause, Cause, FieldState, Known};
use helio_calib::{Campaign, Observation, Parameter, Parameters};
use helio_core::{EnuUnit, PoseErrors, TargetPlane};
use helio_io::{CalibratedSet, JointColumns, errors_as_written};
use rayon::prelude::*;

use super::{DAY_NS, OK, Run};
use crate::commands::calibrate::LOWEST_SUN_RAD;
use crate::failure::Failure;
use crate::plan::{SunClock, toward};

/// Hours of the day at which its sun is looked at, from half a day before.
const HOURS: i64 = 24;
/// A cause that is known this well in parts of what is expected of it is held at zero.
const HELD: f64 = 1e-8;
/// Camera's scatter on the target of a spot that no camera sees \[m\].
const NO_CAMERA_M: f64 = 1e-9;
/// Standard deviations from which a tilt has an azimuth, as in `helio_calib::covariance`.
const TILT_SIGMAS: f64 = 5.0;
/// A target that no cause belongs to.
const NO_TARGET: usize = usize::MAX;

/// What the records of this run say of a heliostat.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Seen {
    /// Sum of squares of the misses of records that are believed \[mrad²\], and how many.
    pub squares: f64,
    pub count: usize,
    /// First and last \[ns of Unix time\].
    pub times: Option<(i64, i64)>,
}

impl Seen {
    pub(super) fn add(&mut self, beam_mrad: f64) {
        if beam_mrad.is_finite() {
            self.squares += beam_mrad * beam_mrad;
            self.count += 1;
        }
    }
}

/// The day that a table is for.
pub(super) struct Day {
    /// \[days since 1970\].
    pub day: f64,
    /// Its suns.
    pub suns: Vec<EnuUnit>,
}

impl Run<'_> {
    /// The day `--ahead` of the last record of the state.
    pub(super) fn day(&self, state: &FieldState) -> Result<Day, Failure> {
        let last = state.heliostats().iter().filter_map(|h| h.last_day);
        let day = last.fold(f64::MIN, f64::max) + self.args.joint.ahead;
        let middle = (day * DAY_NS) as i64;
        let hour_ns = 3_600_000_000_000;
        let times: Vec<i64> = (0..HOURS)
            .map(|hour| middle.saturating_add((hour - HOURS / 2) * hour_ns))
            .collect();
        let (azimuth_rad, elevation_rad) = SunClock::needed(&self.loaded)?.suns(&times)?;
        let suns = toward(&azimuth_rad, &elevation_rad);
        let high = elevation_rad.iter().map(|e| *e > LOWEST_SUN_RAD);
        let suns = suns.into_iter().zip(high);
        Ok(Day {
            day,
            suns: suns.filter_map(|(sun, high)| high.then_some(sun)).collect(),
        })
    }

    /// A row for each heliostat of the state that is in the field, in the order of the field.
    pub(super) fn sets(
        &self,
        state: &FieldState,
        rows: &[Option<usize>],
        seen: &[Seen],
        day: &Day,
    ) -> Vec<CalibratedSet> {
        let shared = SharedPose::of(state);
        let mut places: Vec<(usize, usize)> = rows
            .iter()
            .enumerate()
            .filter_map(|(place, row)| Some(((*row)?, place)))
            .collect();
        places.sort_unstable();
        places
            .into_par_iter()
            .map(|(row, place)| self.set(state, row, place, &seen[place], day, &shared))
            .collect()
    }

    fn set(
        &self,
        state: &FieldState,
        row: usize,
        place: usize,
        seen: &Seen,
        day: &Day,
        shared: &SharedPose,
    ) -> CalibratedSet {
        let id = &self.loaded.field.ids()[row];
        let followed = &state.heliostats()[place];
        let known = state.known(place, day.day);
        let last = state.known(place, followed.last_day.unwrap_or(day.day));
        if !known
            .values
            .iter()
            .chain(&known.covariance)
            .all(|x| x.is_finite())
        {
            let why = "the joint fit gave no finite numbers";
            return CalibratedSet::without_result(id, "undetermined", why);
        }
        let mut mount = self.mount(row);
        let parameters = known.parameters(mount.mirror_offset_m);
        let (pose_errors, pose_sigmas_rad) = shared.with(&known);
        mount.pose_errors = pose_errors;
        let covariance = seven(&known);
        let aim = self.loaded.field.heliostats()[row].aim;
        let plane = TargetPlane::level(
            aim,
            EnuUnit::try_new(mount.pivot - aim).unwrap_or(EnuUnit::UP),
        );
        let poses: Vec<Observation> = day
            .suns
            .iter()
            .filter_map(|&sun| {
                let [axis1, axis2] = encoder_angles_rad(&mount, &parameters, sun, aim)?;
                Some(Observation {
                    target: NO_TARGET,
                    sigma_m: Some(NO_CAMERA_M),
                    unix_ns: Some((day.day * DAY_NS) as i64),
                    ..Observation::new(sun, axis1, axis2, plane, 0.0, 0.0)
                })
            })
            .collect();
        let campaign = Campaign {
            mount,
            observations: &poses,
        };
        let squares: Vec<f64> = state
            .foretell(place, &campaign)
            .iter()
            .map(|foretold| foretold.expected_mrad().powi(2))
            .filter(|square| square.is_finite())
            .collect();
        let root_mean = |sum: f64, count: usize| match count {
            0 => f64::NAN,
            count => (sum / count as f64).sqrt(),
        };
        CalibratedSet {
            errors: Some(errors_as_written(&parameters.errors())),
            pose_errors_rad: pose_errors.to_array().map(Some),
            sigmas: sigmas(&parameters, &covariance),
            covariance: Some(covariance),
            beam_rms_mrad: root_mean(seen.squares, seen.count),
            observations: (followed.records - followed.outliers.min(followed.records)) as usize,
            rejected: followed.outliers as usize,
            observed_ns: seen.times,
            joint: Some(JointColumns {
                pose_sigmas_rad,
                jumps: followed.jumps.len(),
                zero_rad: last.zero_rad,
                zero_sigma_rad: last.zero_sigma_rad,
                foretold_mrad: root_mean(squares.iter().sum(), squares.len()),
            }),
            ..CalibratedSet::without_result(id, OK, "")
        }
    }
}

/// Pose errors that all heliostats share, and where a heliostat's own stand among its values.
struct SharedPose {
    values: [(f64, f64); 3],
    own: Vec<AxisCause>,
}

/// Which of the pose errors a cause is.
fn number(cause: AxisCause) -> usize {
    match cause {
        AxisCause::Axis1Sag => 0,
        AxisCause::Axis2Sag => 1,
        AxisCause::Axis2Eccentricity => 2,
    }
}

impl SharedPose {
    fn of(state: &FieldState) -> Self {
        let mut values = [(0.0, 0.0); 3];
        let mut own = Vec::new();
        for (cause, value, sigma) in state.causes() {
            let Cause::Axis(cause) = cause else { continue };
            let description = cause.description();
            if description.expected_spread > 0.0 {
                own.push(cause);
            } else if sigma > HELD * description.expected {
                values[number(cause)] = (value, sigma);
            }
        }
        Self { values, own }
    }

    fn with(&self, known: &Known) -> (PoseErrors, [f64; 3]) {
        let mut values = self.values;
        let still = known.values.len();
        for (k, &cause) in self.own.iter().enumerate() {
            let k = still - self.own.len() + k;
            let sigma = known.covariance[k * still + k].max(0.0).sqrt();
            values[number(cause)] = (known.values[k], sigma);
        }
        (
            PoseErrors::from_array(values.map(|v| v.0)),
            values.map(|v| v.1),
        )
    }
}

/// Covariance of the seven parameters; the mirror offset is as the field states it.
fn seven(known: &Known) -> [[f64; 7]; 7] {
    let still = known.values.len();
    std::array::from_fn(|i| {
        std::array::from_fn(|j| {
            if i < 6 && j < 6 {
                known.covariance[i * still + j]
            } else {
                0.0
            }
        })
    })
}

/// Standard errors in the order of the table's columns.
fn sigmas(parameters: &Parameters, covariance: &[[f64; 7]; 7]) -> [f64; 7] {
    let of = |parameter: Parameter| {
        let k = parameter as usize;
        covariance[k][k].max(0.0).sqrt()
    };
    let [x, y] = [Parameter::Tilt1, Parameter::Tilt2].map(|p| parameters.get(p));
    let tilt = (x * x + y * y).sqrt();
    let (cosine, sine) = if tilt > 0.0 {
        (x / tilt, y / tilt)
    } else {
        (1.0, 0.0)
    };
    let deviation = |u: f64, w: f64| {
        let c = covariance;
        (u * u * c[0][0] + 2.0 * u * w * c[0][1] + w * w * c[1][1])
            .max(0.0)
            .sqrt()
    };
    let (along, across) = (deviation(cosine, sine), deviation(-sine, cosine));
    let lean = if tilt > TILT_SIGMAS * along.max(across) {
        across / tilt
    } else {
        f64::NAN
    };
    [
        along,
        lean,
        of(Parameter::AxisNonorthogonality),
        of(Parameter::MirrorTilt),
        of(Parameter::AzimuthReference),
        of(Parameter::ElevationReference),
        f64::NAN,
    ]
}
