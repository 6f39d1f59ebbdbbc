//! What is known of every heliostat, as rows of the calibration table.

use helio_calib::aiming::encoder_angles_rad;
use helio_calib::joint::{DAY_NS, FieldState, Followed, Foretold, Known, NO_TARGET, Spell};
use helio_calib::plan::year_suns;
use helio_calib::{
    Campaign, Duty, Mount, Observation, Parameter, Parameters, Sighting, tilt_standard_error,
};
use helio_core::sun::positions;
use helio_core::{EnuUnit, TargetPlane};
use rayon::prelude::*;

use super::{JointFound, JointRun, days_of};
use crate::calibrate::{LOWEST_SUN_RAD, OK, RunError};
use crate::calibrated::{CalibratedSet, JointColumns, errors_as_written};

/// Hours of the day at which its sun is looked at, from half a day before.
const HOURS: i64 = 24;
/// Camera's scatter on the target of a spot that no camera sees \[m\].
const NO_CAMERA_M: f64 = 1e-9;
/// A row rests on times when the field was off where more than one in so many of its records are of them.
const MUCH_OFF: usize = 8;
/// Of the suns of a year so many-th are looked at: at other hours on each of its days.
const YEAR_STEP: usize = 41;

/// What the records of this run say of a heliostat.
#[derive(Debug, Clone, Copy, Default)]
pub struct Seen {
    /// Of the misses of records that are believed the sum of squares \[mrad²\]: of the beam, over the distance from
    /// pivot to target, and of the beam as it was expected.
    squares: [f64; 3],
    count: usize,
    /// Records while the field as a whole was off that a fit rests on, and all that it rests on.
    pub(super) off: [usize; 2],
    /// First and last \[ns of Unix time\].
    pub times_ns: Option<(i64, i64)>,
}

impl Seen {
    /// Counts a record in.
    pub(super) fn add(&mut self, foretold: &Foretold, mount: &Mount, seen: &Observation) {
        let beam_mrad = foretold.beam_mrad();
        if beam_mrad.is_finite() {
            let all = [
                beam_mrad,
                on_target_mrad(foretold.miss_mrad, mount, seen),
                foretold.expected_mrad(),
            ];
            for (sum, mrad) in self.squares.iter_mut().zip(all) {
                *sum += mrad * mrad;
            }
            self.count += 1;
        }
    }

    /// Roots of the means \[mrad\].
    fn rms_mrad(&self) -> [f64; 3] {
        self.squares.map(|sum| root_mean(sum, self.count))
    }
}

fn root_mean(sum: f64, count: usize) -> f64 {
    match count {
        0 => f64::NAN,
        count => (sum / count as f64).sqrt(),
    }
}

/// A miss across the beam as one on the target's plane, over the distance from pivot to target centre \[mrad\].
fn on_target_mrad(miss_mrad: [f64; 2], mount: &Mount, seen: &Observation) -> f64 {
    let sighting = Sighting::new(mount, seen);
    let [u, v] = sighting.spot_m;
    let slant_m = u.hypot(v).hypot(sighting.centre_along_normal_m);
    let [[a, b], [c, d]] = sighting.across_beam();
    let [x, y] = miss_mrad.map(|mrad| mrad * slant_m / (a * d - b * c));
    (d * x - b * y).hypot(a * y - c * x) / (seen.plane.centre - mount.pivot).norm()
}

/// The day that a table is for.
#[derive(Debug, Clone)]
pub struct Day {
    /// \[days since 1970\].
    pub day: f64,
    /// Its suns.
    suns: Vec<EnuUnit>,
    /// Some of a year.
    year: Vec<EnuUnit>,
}

impl JointRun<'_> {
    /// The day that is as far ahead of the last day of the state as is asked.
    ///
    /// # Errors
    /// [`RunError`] where no sun can be computed, or without a site.
    pub fn day(&self, state: &FieldState) -> Result<Day, RunError> {
        let day = state.last_day().unwrap_or(f64::MIN) + self.asked.ahead_days;
        let middle = (day * DAY_NS) as i64;
        let hour_ns = 3_600_000_000_000;
        let times: Vec<i64> = (0..HOURS)
            .map(|hour| middle.saturating_add((hour - HOURS / 2) * hour_ns))
            .collect();
        super::needs_site(self.loaded)?;
        let mut suns = Vec::with_capacity(times.len());
        if let Some(site) = &self.loaded.site {
            let ut1_utc_s = site.ut1_utc_s.unwrap_or(0.0);
            let all = positions(&site.sun_site()?, &times, site.delta_t_s, ut1_utc_s)?;
            let each = all.azimuth_rad.iter().zip(&all.apparent_elevation_rad);
            suns.extend(
                each.filter(|(_, elevation)| **elevation > LOWEST_SUN_RAD)
                    .map(|(&azimuth, &elevation)| {
                        EnuUnit::from_azimuth_elevation(azimuth, elevation)
                    }),
            );
        }
        Ok(Day {
            day,
            suns,
            year: year_suns(self.latitude_rad(), LOWEST_SUN_RAD)
                .into_iter()
                .step_by(YEAR_STEP)
                .collect(),
        })
    }

    /// A row for each heliostat of the state that is in the field, in the order of the field.
    ///
    /// # Errors
    /// [`RunError`] where it is stopped.
    pub fn sets(&self, found: &JointFound<'_>, day: &Day) -> Result<Vec<CalibratedSet>, RunError> {
        found
            .places()
            .into_par_iter()
            .map(|(row, place)| {
                self.go_on()?;
                let seen = &found.seen[place];
                self.set(&found.state, row, place, seen, (day, &found.spells))
            })
            .collect()
    }

    fn set(
        &self,
        state: &FieldState,
        row: usize,
        place: usize,
        seen: &Seen,
        (day, spells): (&Day, &[Spell]),
    ) -> Result<CalibratedSet, RunError> {
        let id = &self.loaded.field.ids()[row];
        let followed = &state.heliostats()[place];
        let known = state.known(place, day.day)?;
        let last = state.known(place, followed.last_day.unwrap_or(day.day))?;
        if !known
            .values
            .iter()
            .chain(&known.covariance)
            .all(|x| x.is_finite())
        {
            let why = "the joint fit gave no finite numbers";
            return Ok(CalibratedSet::without_result(id, "undetermined", why));
        }
        let mut mount = self.mount(row);
        let parameters = known.parameters(mount.mirror_offset_m);
        let covariance = seven(&known);
        let aim = self.loaded.field.heliostats()[row].aim;
        let duty = Duty {
            suns: &day.year,
            aim,
        };
        let year_mrad = state.pointing_mrad(place, &mount, day.day, &duty)?;
        let year_pointing_mrad = year_mrad.unwrap_or(f64::NAN);
        let exceeded = self
            .asked
            .max_year_pointing_mrad
            .filter(|limit| year_pointing_mrad.is_nan() || year_pointing_mrad > *limit);
        let refused = exceeded.map(|limit_mrad| {
            format!(
                "its pointing is uncertain by {year_pointing_mrad:.2} mrad over the year, more than the \
                 {limit_mrad} of --max-year-pointing-mrad"
            )
        });
        mount.pose_errors = known.pose_errors;
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
            .foretell(place, &campaign)?
            .iter()
            .map(|foretold| foretold.expected_mrad().powi(2))
            .filter(|square| square.is_finite())
            .collect();
        let [beam_rms_mrad, rms_mrad, expected_mrad] = seen.rms_mrad();
        let refused = match unexplained(followed, seen, spells) {
            Some(why) => Some(("unexplained", why)),
            None => refused.map(|why| ("undetermined", why)),
        };
        let good = refused.is_none();
        Ok(CalibratedSet {
            errors: good.then(|| errors_as_written(&parameters.errors())),
            pose_errors_rad: known
                .pose_errors
                .to_array()
                .map(|error| good.then_some(error)),
            sigmas: sigmas(&parameters, &covariance),
            covariance: Some(covariance),
            rms_mrad,
            beam_rms_mrad,
            year_pointing_mrad,
            observations: followed.believed() as usize,
            rejected: (followed.records - followed.believed()) as usize,
            observed_ns: seen.times_ns,
            joint: Some(JointColumns {
                pose_sigmas_rad: known.pose_sigmas_rad,
                jumps: followed.jump_count as usize,
                zero_rad: last.zero_rad,
                zero_sigma_rad: last.zero_sigma_rad,
                foretold_mrad: root_mean(squares.iter().sum(), squares.len()),
                expected_mrad,
            }),
            ..match &refused {
                None => CalibratedSet::without_result(id, OK, ""),
                Some((status, why)) => CalibratedSet::without_result(id, status, why),
            }
        })
    }
}

/// Why a heliostat is not to be believed now, if it is not.
fn unexplained(followed: &Followed, seen: &Seen, spells: &[Spell]) -> Option<String> {
    let (unbelieved, misses) = (followed.unbelieved(), followed.misses);
    if followed.unexplained() {
        let missing = match misses {
            0 => String::new(),
            misses => format!(", {misses} should not meet their targets at all"),
        };
        let in_a_row = match followed.unbelieved_last() {
            0 | 1 => String::new(),
            last => format!(", the last {last} one after the other"),
        };
        return Some(format!(
            "of its {} records {unbelieved} do not fit the others{missing}{in_a_row}, and its zero points jumped {} times, \
             without those in doubt; of its last records {:.0} % are odd so",
            followed.records,
            followed.jump_count,
            100.0 * followed.lately().share().min(1.0)
        ));
    }
    let last = followed.last_day?;
    if let Some(spell) = spells.iter().find(|spell| spell.holds(last)) {
        return Some(format!(
            "its last record is of a time when the field as a whole was off, {}",
            days_of(spell)
        ));
    }
    let [off, all] = seen.off;
    (MUCH_OFF * off > all).then(|| {
        format!("{off} of its {all} records are of times when the field as a whole was off")
    })
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
    let (tilt, lean) = tilt_standard_error(parameters, covariance);
    [
        tilt,
        lean.unwrap_or(f64::NAN),
        of(Parameter::AxisNonorthogonality),
        of(Parameter::MirrorTilt),
        of(Parameter::AzimuthReference),
        of(Parameter::ElevationReference),
        f64::NAN,
    ]
}
