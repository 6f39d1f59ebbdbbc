//! Synthetic fields whose truth is known: own angles from a distribution, causes in common, zero points that
//! wander and jump, records that scatter as [`Noise`] says.
//!
//! Where a beam lands is the formula of [`crate::model`]; how an axis is turned by its causes is solved here
//! for every record, and the sun that shines is computed for the time that shone: nothing of the joint fit's
//! linearised records goes in. The same seed gives the same bits everywhere, and each heliostat, each kind of
//! chance and each record has random numbers of its own: fields that differ in one option are comparable.

use helio_core::sun::{self, SunSite};
use helio_core::{Enu, EnuUnit, MountAxes, PoseErrors, TargetPlane, TrackingMode};
use rayon::prelude::*;

use super::rows::ANGLES;
use super::{Noise, Wander};
use crate::aiming::{encoder_angles_rad, hour_angle_rad};
use crate::error::CalibrationError;
use crate::field::Campaign;
use crate::model::{Pose, landing, torque, turned_on};
use crate::observation::{Mount, Observation, Sighting};
use crate::parameters::{COUNT, Parameter, Parameters};
use crate::random::Random;
use crate::simulate::Aiming;

const SECOND_NS: i64 = 1_000_000_000;
const DAY_S: i64 = 86_400;
/// Times drawn for one record before it is given up.
const MAX_TRIES: usize = 5_000;

/// Causes that the field has in common.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct FieldCauses {
    /// Sag of either axis of every mount; the mean over the field of their eccentricity.
    pub pose_errors: PoseErrors,
    /// One standard deviation of heliostats about the mean eccentricity \[rad\].
    pub axis2_eccentricity_spread_rad: f64,
    /// How far right and down of where they are the targets' spots are recorded \[m\], in the order of the targets; those
    /// not listed are where they should be.
    pub target_shift_m: Vec<[f64; 2]>,
    /// How much later than recorded the sun shone \[s\].
    pub sun_time_s: f64,
}

/// What field to simulate.
#[derive(Debug, Clone, PartialEq)]
pub struct FieldOptions {
    /// Of all random numbers.
    pub seed: u64,
    /// How many.
    pub heliostats: usize,
    /// How their mounts stand. A spinning axis points to the first target.
    pub mode: TrackingMode,
    /// Pivot to mirror centre along the normal \[m\].
    pub mirror_offset_m: f64,
    /// Least and greatest distance of pivots from the tower's foot, the origin \[m\]; as many to each square metre.
    pub distance_m: [f64; 2],
    /// Heliostats stand within this azimuth of north \[rad\].
    pub within_azimuth_rad: f64,
    /// Where the spots are seen.
    pub targets: Vec<TargetPlane>,
    /// Where the sun is seen from.
    pub site: SunSite,
    /// Mean of heliostats' angles \[rad\], the first six of [`Parameter::ALL`].
    pub mean_rad: [f64; ANGLES],
    /// Their covariance \[rad²\].
    pub covariance_rad2: [[f64; ANGLES]; ANGLES],
    /// What they have in common.
    pub causes: FieldCauses,
    /// How records scatter. None of it is stated with the records.
    pub noise: Noise,
    /// How zero points wander.
    pub wander: Wander,
    /// Probability that the zero point of one axis, each as likely, jumped before a record.
    pub jump_probability: f64,
    /// How far \[rad\]: evenly from this to twice this, to either side.
    pub jump_rad: f64,
    /// Days in which a jump is forgotten by a factor e; infinite where it stays.
    pub jump_days: f64,
    /// Probability that a record's spot was found in a wrong place.
    pub outlier_probability: f64,
    /// By how much, over the slant \[mrad\]: evenly from this to twice this, in any direction.
    pub outlier_mrad: f64,
    /// Records of each heliostat.
    pub records: usize,
    /// Records on one day; the last day has the rest.
    pub records_a_day: usize,
    /// Records of the day after the last, which every heliostat has.
    pub next_day_records: usize,
    /// First day's beginning \[ns since 1970 UTC\], local midnight rather than Greenwich's.
    pub from_unix_ns: i64,
    /// Days over which the records spread; each heliostat has its own.
    pub days: usize,
    /// The sun's (apparent) centre is at least so high \[rad\].
    pub min_sun_elevation_rad: f64,
    /// How heliostats find the target. Nobody who aims knows of causes, zero points and jumps.
    pub aiming: Aiming,
}

/// A diagonal covariance \[rad²\] from standard deviations \[rad\].
#[must_use]
pub fn uncorrelated(sigma_rad: [f64; ANGLES]) -> [[f64; ANGLES]; ANGLES] {
    core::array::from_fn(|i| {
        core::array::from_fn(|j| {
            if i == j {
                sigma_rad[i] * sigma_rad[i]
            } else {
                0.0
            }
        })
    })
}

impl FieldOptions {
    /// Sixty heliostats north of a tower in Jülich with three targets, fifty records each over two hundred days, six
    /// a day; noise and wander of some tenths of a milliradian, nothing in common and nothing wrong.
    ///
    /// # Errors
    /// None: the site is a good one.
    pub fn new(seed: u64) -> Result<Self, CalibrationError> {
        let site = SunSite::new(0.888_6, 0.111_5, 88.0).map_err(|_| bad_site())?;
        let north = EnuUnit::from_azimuth_elevation(0.0, 0.0);
        let targets = [(0.0, 43.1), (0.0, 35.9), (-17.6, 52.0)]
            .map(|(east, up)| TargetPlane::level(Enu::new(east, -3.2, up), north));
        Ok(Self {
            seed,
            heliostats: 60,
            mode: TrackingMode::AzimuthElevation,
            mirror_offset_m: 0.18,
            distance_m: [35.0, 220.0],
            within_azimuth_rad: 0.8,
            targets: targets.to_vec(),
            site,
            mean_rad: [2e-3, -1e-3, 3e-3, 1e-3, -4e-3, 2e-3],
            covariance_rad2: uncorrelated([6e-3, 6e-3, 5e-3, 2e-3, 6e-3, 5e-3]),
            causes: FieldCauses::default(),
            noise: Noise {
                beam_mrad: 0.3,
                spot_m: 0.02,
                sun_path_s: 4.0,
            },
            wander: Wander {
                slow_mrad: [0.4, 0.4],
                slow_days: 60.0,
                fast_mrad: [0.3, 0.3],
                fast_days: 0.3,
            },
            jump_probability: 0.0,
            jump_rad: 3e-3,
            jump_days: f64::INFINITY,
            outlier_probability: 0.0,
            outlier_mrad: 10.0,
            records: 50,
            records_a_day: 6,
            next_day_records: 0,
            from_unix_ns: 1_740_787_200 * SECOND_NS,
            days: 200,
            min_sun_elevation_rad: 0.2,
            aiming: Aiming::default(),
        })
    }
}

/// What was true when a record was made.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RecordTruth {
    /// Wandering zero points \[rad\]: slow of either axis, fast of either axis.
    pub wandering_rad: [f64; 4],
    /// What is left of all jumps so far \[rad\], of either axis.
    pub jumped_rad: [f64; 2],
    /// Whether the spot was found in a wrong place.
    pub outlier: bool,
    /// The axis whose zero point jumped just before (0 or 1).
    pub jump: Option<usize>,
}

/// One heliostat of a synthetic field.
#[derive(Debug, Clone, PartialEq)]
pub struct SimulatedHeliostat {
    /// What a plant knows of it.
    pub mount: Mount,
    /// What was seen, in the order of time; the next day's records last.
    pub observations: Vec<Observation>,
    /// Six angles at rest \[rad\].
    pub angles_rad: [f64; ANGLES],
    /// Eccentricity of its second axis \[rad\].
    pub axis2_eccentricity_rad: f64,
    /// What was true, record by record.
    pub truth: Vec<RecordTruth>,
}

impl SimulatedHeliostat {
    /// Its first records, as a fit takes them; all where there are fewer.
    #[must_use]
    pub fn first(&self, records: usize) -> Campaign<'_> {
        Campaign {
            mount: self.mount,
            observations: &self.observations[..records.min(self.observations.len())],
        }
    }

    /// The records after those.
    #[must_use]
    pub fn after(&self, records: usize) -> Campaign<'_> {
        Campaign {
            mount: self.mount,
            observations: &self.observations[records.min(self.observations.len())..],
        }
    }
}

/// A synthetic field.
#[derive(Debug, Clone, PartialEq)]
pub struct SimulatedField {
    /// Its heliostats.
    pub heliostats: Vec<SimulatedHeliostat>,
}

impl SimulatedField {
    /// The first records of every heliostat.
    #[must_use]
    pub fn first(&self, records: usize) -> Vec<Campaign<'_>> {
        self.heliostats.iter().map(|h| h.first(records)).collect()
    }
}

/// Simulates a field and its records.
///
/// # Errors
/// [`CalibrationError::BadOption`] for an option outside its range, and where dates and targets leave too little
/// room: nothing seen in 5,000 draws for some record.
///
/// ```
/// use helio_calib::joint::simulate::{FieldOptions, simulate_field};
/// let options = FieldOptions { heliostats: 3, records: 8, ..FieldOptions::new(1)? };
/// let field = simulate_field(&options)?;
/// assert_eq!(field.heliostats[2].observations.len(), 8);
/// # Ok::<(), helio_calib::CalibrationError>(())
/// ```
pub fn simulate_field(options: &FieldOptions) -> Result<SimulatedField, CalibrationError> {
    let root = check(options)?;
    let heliostats = (0..options.heliostats)
        .into_par_iter()
        .map(|k| heliostat(options, &root, k))
        .collect::<Result<_, _>>()?;
    Ok(SimulatedField { heliostats })
}

/// Kinds of chance, each with random numbers of its own.
#[derive(Clone, Copy)]
enum Chance {
    Mount,
    Days,
    Time,
    Noise,
    Wander,
    Mishap,
    Outlier,
    /// How many.
    Count,
}

/// Random numbers of a heliostat, for a kind of chance and a record.
fn chance(options: &FieldOptions, heliostat: usize, kind: Chance, record: usize) -> Random {
    let mut of_heliostat = Random::stream(options.seed, heliostat as u64);
    let seed = of_heliostat.next_u64();
    Random::stream(
        seed,
        (record * Chance::Count as usize + kind as usize) as u64,
    )
}

fn heliostat(
    options: &FieldOptions,
    root: &[[f64; ANGLES]; ANGLES],
    k: usize,
) -> Result<SimulatedHeliostat, CalibrationError> {
    let mut random = chance(options, k, Chance::Mount, 0);
    let [near, far] = options.distance_m;
    let distance = libm::sqrt(random.between(near * near, far * far));
    let azimuth = random.between(-options.within_azimuth_rad, options.within_azimuth_rad);
    let (east, north) = libm::sincos(azimuth);
    let pivot = Enu::new(distance * east, distance * north, random.between(1.5, 2.5));
    let to_aim =
        EnuUnit::try_new(options.targets[0].centre - pivot).map_err(|_| bad_distance(options))?;
    let mount = Mount {
        axes: MountAxes::of(options.mode, to_aim),
        pivot,
        mirror_offset_m: options.mirror_offset_m,
        pose_errors: PoseErrors::NONE,
    };
    let normal: [f64; ANGLES] = core::array::from_fn(|_| random.normal());
    let angles_rad: [f64; ANGLES] = core::array::from_fn(|i| {
        let by = root[i].iter().zip(normal).map(|(r, z)| r * z).sum::<f64>();
        options.mean_rad[i] + by
    });
    let causes = &options.causes;
    let axis2_eccentricity_rad = causes.pose_errors.axis2_eccentricity_rad
        + causes.axis2_eccentricity_spread_rad * random.normal();
    let mut values = [options.mirror_offset_m; COUNT];
    values[..ANGLES].copy_from_slice(&angles_rad);
    let own = Parameters { values };

    let mut aimed = times(options, k)?
        .into_iter()
        .enumerate()
        .map(|(record, of_day)| draw(options, &mount, &own, k, record, of_day))
        .collect::<Result<Vec<_>, _>>()?;
    aimed.sort_by_key(|o| o.unix_ns);
    let truth = zero_points(options, k, &aimed);
    for (record, (observation, truth)) in aimed.iter_mut().zip(&truth).enumerate() {
        let mut noise = chance(options, k, Chance::Noise, record);
        let mut outlier = chance(options, k, Chance::Outlier, record);
        let at = see(
            options,
            (&mount, &own, axis2_eccentricity_rad),
            observation,
            truth,
            &mut noise,
            &mut outlier,
        );
        [observation.u_m, observation.v_m] = at.ok_or(CalibrationError::BadOption {
            what: "truth of a simulated record",
            wanted: "one whose beam meets its target",
            value: record as f64,
        })?;
    }
    Ok(SimulatedHeliostat {
        mount,
        observations: aimed,
        angles_rad,
        axis2_eccentricity_rad,
        truth,
    })
}

/// The day of each record.
fn times(options: &FieldOptions, k: usize) -> Result<Vec<i64>, CalibrationError> {
    let wanted = options.records.div_ceil(options.records_a_day.max(1));
    if wanted > options.days {
        return Err(CalibrationError::BadOption {
            what: "days",
            wanted: "at least records over records_a_day",
            value: options.days as f64,
        });
    }
    let mut days: Vec<i64> = (0..options.days as i64).collect();
    chance(options, k, Chance::Days, 0).shuffle(&mut days);
    let of_records = (0..options.records).map(|r| days[r / options.records_a_day.max(1)]);
    let next = core::iter::repeat_n(options.days as i64, options.next_day_records);
    Ok(of_records.chain(next).collect())
}

/// When a record was made, of which target and how the heliostat stood.
fn draw(
    options: &FieldOptions,
    mount: &Mount,
    own: &Parameters,
    k: usize,
    record: usize,
    day: i64,
) -> Result<Observation, CalibrationError> {
    let mut random = chance(options, k, Chance::Time, record);
    for _ in 0..MAX_TRIES {
        let second = day * DAY_S + random.below(DAY_S as usize) as i64;
        let target = random.below(options.targets.len());
        let spot = [random.between(-1.0, 1.0), random.between(-1.0, 1.0)];
        let unix_ns = options.from_unix_ns + second * SECOND_NS;
        let position =
            sun::position(&options.site, unix_ns, None, 0.0).map_err(|_| bad_time(unix_ns))?;
        if position.apparent_elevation_rad < options.min_sun_elevation_rad {
            continue;
        }
        let sun = position.direction();
        let plane = &options.targets[target];
        let encoders = match options.aiming {
            Aiming::Uncalibrated => {
                let mut believed = Parameters::default();
                believed.values[Parameter::MirrorOffset as usize] = options.mirror_offset_m;
                encoder_angles_rad(mount, &believed, sun, plane.centre)
            }
            Aiming::Believed(believed) => encoder_angles_rad(mount, &believed, sun, plane.centre),
            Aiming::Board {
                half_width_m,
                half_height_m,
            } => {
                let point = plane.point(half_width_m * spot[0], half_height_m * spot[1]);
                encoder_angles_rad(mount, own, sun, point)
            }
        };
        let Some([axis1_rad, axis2_rad]) = encoders else {
            continue;
        };
        let mut observation = Observation::new(sun, axis1_rad, axis2_rad, *plane, 0.0, 0.0);
        observation.target = target;
        observation.unix_ns = Some(unix_ns);
        observation.hour_angle_rad = Some(hour_angle_rad(sun, options.site.latitude_rad()));
        if landing(&Pose::of(own), &Sighting::new(mount, &observation)).hits() {
            return Ok(observation);
        }
    }
    Err(CalibrationError::BadOption {
        what: "number of records that dates, sun elevation and targets allow",
        wanted: "the count asked for",
        value: record as f64,
    })
}

/// Zero points and mishaps of the records of a heliostat, in time.
fn zero_points(options: &FieldOptions, k: usize, records: &[Observation]) -> Vec<RecordTruth> {
    let wander = &options.wander;
    let sigma_rad = [
        wander.slow_mrad[0],
        wander.slow_mrad[1],
        wander.fast_mrad[0],
        wander.fast_mrad[1],
    ]
    .map(|mrad| 1e-3 * mrad);
    let forgotten_days = [
        wander.slow_days,
        wander.slow_days,
        wander.fast_days,
        wander.fast_days,
    ];
    let mut drifted = [0.0; 4];
    let mut jumped = [0.0; 2];
    let mut before_ns = None;
    let step = |(record, observation): (usize, &Observation)| {
        let mut random = chance(options, k, Chance::Wander, record);
        let new: [f64; 4] = core::array::from_fn(|_| random.normal());
        let now_ns = observation.unix_ns.unwrap_or_default();
        // no time before the first record: nothing is left of nothing, and all is new
        let days = before_ns.map_or(f64::INFINITY, |before: i64| {
            (now_ns - before) as f64 / (DAY_S * SECOND_NS) as f64
        });
        before_ns = Some(now_ns);
        for i in 0..4 {
            let kept = if forgotten_days[i] > 0.0 {
                libm::exp(-days / forgotten_days[i])
            } else {
                0.0
            };
            let fresh = sigma_rad[i] * libm::sqrt(1.0 - kept * kept);
            drifted[i] = kept * drifted[i] + fresh * new[i];
        }
        let mut random = chance(options, k, Chance::Mishap, record);
        let [jumps, errs] = [random.uniform(), random.uniform()];
        let axis = random.below(2);
        let side = if random.uniform() < 0.5 { -1.0 } else { 1.0 };
        let far = side * options.jump_rad * random.between(1.0, 2.0);
        if options.jump_days.is_finite() {
            let kept = libm::exp(-days / options.jump_days);
            jumped = jumped.map(|x| kept * x);
        }
        // nobody can tell a jump before the first record
        let jump = (record > 0 && jumps < options.jump_probability).then_some(axis);
        if let Some(axis) = jump {
            jumped[axis] += far;
        }
        RecordTruth {
            wandering_rad: drifted,
            jumped_rad: jumped,
            outlier: errs < options.outlier_probability,
            jump,
        }
    };
    records.iter().enumerate().map(step).collect()
}

/// Fixed-point steps to the pose under load: each leaves the causes' size, some milliradians, of the error.
const LOADING_STEPS: usize = 12;

/// Where the spot of a record is found \[m\]; `None` where the beam misses.
fn see(
    options: &FieldOptions,
    (mount, own, eccentricity_rad): (&Mount, &Parameters, f64),
    record: &Observation,
    truth: &RecordTruth,
    noise: &mut Random,
    outlier: &mut Random,
) -> Option<[f64; 2]> {
    let causes = &options.causes;
    let [across1, across2] = noise.normal_pair();
    let [right, down] = noise.normal_pair();
    // the sun that shone, the angles read before the zero points moved
    let late_s = causes.sun_time_s + options.noise.sun_path_s * noise.normal();
    let mut shone = *record;
    let unix_ns = record.unix_ns? + libm::rint(late_s * SECOND_NS as f64) as i64;
    shone.sun = sun::position(&options.site, unix_ns, None, 0.0)
        .ok()?
        .direction();
    let [slow1, slow2, fast1, fast2] = truth.wandering_rad;
    shone.axis1_rad -= slow1 + fast1 + truth.jumped_rad[0];
    shone.axis2_rad -= slow2 + fast2 + truth.jumped_rad[1];
    let mut sighting = Sighting::new(mount, &shone);
    // true angle = read angle - reference, turned by what the causes do in the true pose
    let reference = [
        own.get(Parameter::AzimuthReference),
        own.get(Parameter::ElevationReference),
    ];
    let unloaded = [
        shone.axis1_rad - reference[0],
        shone.axis2_rad - reference[1],
    ];
    let mut turn = [0.0; 2];
    for _ in 0..LOADING_STEPS {
        let (sin_gamma, cos_gamma) = libm::sincos(unloaded[0] + turn[0]);
        let (sin_alpha, cos_alpha) = libm::sincos(unloaded[1] + turn[1]);
        let [torque1, torque2] =
            torque(sighting.up, [cos_gamma, sin_gamma], [cos_alpha, sin_alpha]);
        turn = [
            causes.pose_errors.axis1_sag_rad * torque1,
            causes.pose_errors.axis2_sag_rad * torque2 + eccentricity_rad * sin_alpha,
        ];
    }
    sighting.axis1 = turned_on(sighting.axis1, turn[0]);
    sighting.axis2 = turned_on(sighting.axis2, turn[1]);
    let landed = landing(&Pose::of(own), &sighting);
    if !landed.hits() {
        return None;
    }
    let [mut u_m, mut v_m] = landed.residual_m;
    // across the beam that came to this spot, back onto the plane
    let spot = [sighting.spot_m[0] + u_m, sighting.spot_m[1] + v_m];
    let slant_m = libm::hypot(
        libm::hypot(spot[0], spot[1]),
        sighting.centre_along_normal_m,
    );
    let across_m = options.noise.beam_mrad * 1e-3 * slant_m;
    let [a, b] = Sighting {
        spot_m: spot,
        ..sighting
    }
    .across_beam();
    let per = 1.0 / (a[0] * b[1] - a[1] * b[0]);
    u_m += across_m * per * (b[1] * across1 - a[1] * across2);
    v_m += across_m * per * (a[0] * across2 - b[0] * across1);
    u_m += options.noise.spot_m * right;
    v_m += options.noise.spot_m * down;
    if let Some([right_m, down_m]) = causes.target_shift_m.get(record.target) {
        u_m += right_m;
        v_m += down_m;
    }
    if truth.outlier {
        let far_m = 1e-3 * slant_m * options.outlier_mrad * outlier.between(1.0, 2.0);
        let (sine, cosine) = libm::sincos(outlier.between(0.0, core::f64::consts::TAU));
        u_m += far_m * cosine;
        v_m += far_m * sine;
    }
    Some([u_m, v_m])
}

fn bad_site() -> CalibrationError {
    CalibrationError::BadOption {
        what: "site",
        wanted: "one whose sun can be computed",
        value: f64::NAN,
    }
}

fn bad_time(unix_ns: i64) -> CalibrationError {
    CalibrationError::BadOption {
        what: "from_unix_ns",
        wanted: "an instant whose sun can be computed",
        value: unix_ns as f64,
    }
}

fn bad_distance(options: &FieldOptions) -> CalibrationError {
    CalibrationError::BadOption {
        what: "distance_m",
        wanted: "away from the first target",
        value: options.distance_m[0],
    }
}

/// Refuses what cannot be; the root of the covariance (Cholesky), rows of directions without spread zero.
fn check(options: &FieldOptions) -> Result<[[f64; ANGLES]; ANGLES], CalibrationError> {
    let bad = |what, wanted, value| CalibrationError::BadOption {
        what,
        wanted,
        value,
    };
    if options.targets.is_empty() {
        return Err(bad("number of targets", "at least 1", 0.0));
    }
    let [near, far] = options.distance_m;
    if !(near > 0.0 && far >= near && far.is_finite()) {
        return Err(bad("distance_m", "above 0 and in order", near));
    }
    let (noise, wander) = (&options.noise, &options.wander);
    let sizes = [
        ("noise.beam_mrad", noise.beam_mrad),
        ("noise.spot_m", noise.spot_m),
        ("noise.sun_path_s", noise.sun_path_s),
        ("wander.slow_mrad", wander.slow_mrad[0]),
        ("wander.slow_mrad", wander.slow_mrad[1]),
        ("wander.slow_days", wander.slow_days),
        ("wander.fast_mrad", wander.fast_mrad[0]),
        ("wander.fast_mrad", wander.fast_mrad[1]),
        ("wander.fast_days", wander.fast_days),
        ("jump_rad", options.jump_rad),
        ("outlier_mrad", options.outlier_mrad),
        (
            "axis2_eccentricity_spread_rad",
            options.causes.axis2_eccentricity_spread_rad,
        ),
    ];
    for (what, value) in sizes {
        if !(value.is_finite() && value >= 0.0) {
            return Err(bad(what, "finite and not negative", value));
        }
    }
    let shares = [
        ("jump_probability", options.jump_probability),
        ("outlier_probability", options.outlier_probability),
    ];
    for (what, value) in shares {
        if !(0.0..=1.0).contains(&value) {
            return Err(bad(what, "within 0 to 1", value));
        }
    }
    if options.jump_days.is_nan() || options.jump_days <= 0.0 {
        return Err(bad("jump_days", "above 0", options.jump_days));
    }
    let causes = &options.causes;
    let values = [
        ("axis1_sag_rad", causes.pose_errors.axis1_sag_rad),
        ("axis2_sag_rad", causes.pose_errors.axis2_sag_rad),
        (
            "axis2_eccentricity_rad",
            causes.pose_errors.axis2_eccentricity_rad,
        ),
    ];
    for (what, value) in values {
        // turns beyond this leave the series of `turned_on`
        if value.is_nan() || value.abs() > 0.05 {
            return Err(bad(what, "within ±0.05", value));
        }
    }
    let shifts = causes.target_shift_m.iter().flatten().copied();
    let finite = shifts.chain([causes.sun_time_s]).chain(options.mean_rad);
    for value in finite {
        if !value.is_finite() {
            return Err(bad("causes and mean_rad", "finite", value));
        }
    }
    let mut root = [[0.0; ANGLES]; ANGLES];
    for i in 0..ANGLES {
        for j in 0..=i {
            let before: f64 = (0..j).map(|l| root[i][l] * root[j][l]).sum();
            let left = options.covariance_rad2[i][j] - before;
            let negligible = 1e-12 * options.covariance_rad2[i][i];
            if i == j {
                if left.is_nan() || left < -negligible {
                    return Err(bad("covariance_rad2", "positive semidefinite", left));
                }
                root[i][i] = libm::sqrt(left.max(0.0));
            } else if root[j][j] > 0.0 {
                root[i][j] = left / root[j][j];
            }
        }
    }
    Ok(root)
}
