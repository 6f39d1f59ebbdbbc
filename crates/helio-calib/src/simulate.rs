//! Synthetic campaigns: what a camera would have seen of a heliostat whose errors are known.
//!
//! [`simulate`] draws times while the sun is up, lets the heliostat aim at one of its targets with the
//! parameters that it believes in, computes where the beam of the true ones lands, and adds noise,
//! outliers, jumps of the encoder references and records of something else, as asked. The same seed
//! gives the same bits everywhere ([`Random`]), and what is drawn for one observation does not depend on
//! the noise or the faults asked for: campaigns that differ in one option are comparable.

use helio_core::sun::{self, SunSite};
use helio_core::{EnuUnit, MountErrors, TargetPlane};

use crate::aiming::{encoder_angles_rad, hour_angle_rad};
use crate::error::CalibrationError;
use crate::model::{Pose, landing};
use crate::observation::{Mount, Observation, Sighting};
use crate::parameters::{Parameter, Parameters};
use crate::random::Random;

/// Nanoseconds of a second.
const SECOND_NS: i64 = 1_000_000_000;
/// Times drawn for one observation before it is given up.
const MAX_TRIES: usize = 5_000;

/// From some instant on the encoder references are others, as after a motor was exchanged.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Jump {
    /// When \[ns since 1970 UTC\]; observations at this instant or later have it.
    pub unix_ns: i64,
    /// What is added to the first axis' reference \[rad\].
    pub azimuth_reference_rad: f64,
    /// What is added to the second axis' reference \[rad\].
    pub elevation_reference_rad: f64,
}

/// How the heliostat finds the target.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub enum Aiming {
    /// At the target's centre as if it had no errors at all, as a plant does before calibration: the
    /// beam wanders over the board.
    #[default]
    Uncalibrated,
    /// At the target's centre with these parameters, for instance those of an earlier calibration.
    Believed(Parameters),
    /// Somebody steers the beam onto the board: anywhere on it is equally likely. Needed where the
    /// encoder references are far off.
    Board {
        /// Half the board's width \[m\].
        half_width_m: f64,
        /// Half the board's height \[m\].
        half_height_m: f64,
    },
}

/// What to simulate.
#[derive(Debug, Clone, PartialEq)]
pub struct SimulateOptions {
    /// Of all random numbers.
    pub seed: u64,
    /// How many observations.
    pub count: usize,
    /// None earlier than this \[ns since 1970 UTC\].
    pub from_unix_ns: i64,
    /// All earlier than this \[ns since 1970 UTC\].
    pub to_unix_ns: i64,
    /// On so many days only, chosen at random; `None` for any.
    pub days: Option<usize>,
    /// Local solar time, from and to \[hours of 0 to 24\]; noon is 12.
    pub hours: [f64; 2],
    /// The sun's (apparent) centre is at least so high \[rad\].
    pub min_sun_elevation_rad: f64,
    /// One standard deviation of either component of the spot, over the slant from pivot to target
    /// \[mrad\]. It is stated with each observation as its sigma, unless zero.
    pub noise_mrad: f64,
    /// Share of the observations whose spot is found in a wrong place, 0 to 1; where that is no whole number of them, one
    /// more by chance.
    pub outlier_share: f64,
    /// By how much, over the slant \[mrad\]: evenly from this to twice this, in any direction.
    pub outlier_mrad: f64,
    /// Changes of the encoder references, each added to those before.
    pub jumps: Vec<Jump>,
    /// Share of the observations whose encoders and spot are a neighbour's, 0 to 1.
    pub wrong_heliostat_share: f64,
    /// The neighbours: each aims as this heliostat does, and has its own errors.
    pub neighbours: Vec<(Mount, Parameters)>,
    /// Share of the observations that name another target than the one lit, 0 to 1.
    pub wrong_target_share: f64,
    /// How the heliostat finds the target.
    pub aiming: Aiming,
    /// Spots farther from the target's centre than this, to the side or up and down \[m\], are not seen;
    /// `None` where the wall around the target shows them too.
    pub board_half_m: Option<[f64; 2]>,
}

impl Default for SimulateOptions {
    /// 50 observations over the year 2025, sun above 10°, 0.5 mrad of noise and nothing wrong.
    fn default() -> Self {
        Self {
            seed: 1,
            count: 50,
            from_unix_ns: 1_735_689_600 * SECOND_NS,
            to_unix_ns: 1_767_225_600 * SECOND_NS,
            days: None,
            hours: [0.0, 24.0],
            min_sun_elevation_rad: core::f64::consts::PI / 18.0,
            noise_mrad: 0.5,
            outlier_share: 0.0,
            outlier_mrad: 10.0,
            jumps: Vec::new(),
            wrong_heliostat_share: 0.0,
            neighbours: Vec::new(),
            wrong_target_share: 0.0,
            aiming: Aiming::default(),
            board_half_m: None,
        }
    }
}

/// What is wrong with a simulated observation.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
#[non_exhaustive]
pub enum Fault {
    /// Nothing.
    #[default]
    None,
    /// The spot was found in a wrong place.
    Outlier,
    /// Encoders and spot are those of this neighbour.
    WrongHeliostat(usize),
    /// This target was lit, not the one named.
    WrongTarget(usize),
}

impl Fault {
    /// The word for columns.
    #[must_use]
    pub const fn as_str(self) -> &'static str {
        match self {
            Self::None => "none",
            Self::Outlier => "outlier",
            Self::WrongHeliostat(_) => "wrong_heliostat",
            Self::WrongTarget(_) => "wrong_target",
        }
    }
}

/// What was true when an observation was made.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Truth {
    /// Of this heliostat, jumps included.
    pub parameters: Parameters,
    /// What is wrong with the observation.
    pub fault: Fault,
}

/// A synthetic campaign, in the order of time.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Simulated {
    /// What was seen.
    pub observations: Vec<Observation>,
    /// What was true, row by row.
    pub truth: Vec<Truth>,
}

/// Simulates the observations of one heliostat.
///
/// `errors` is the truth, mirror offset included; `mount.mirror_offset_m` is what the plant believes
/// where it aims [`Aiming::Uncalibrated`]. Every target is as likely as the others. Times are whole
/// seconds after `from_unix_ns`, no two the same. The sun is `helio_core::sun`'s apparent one.
///
/// # Errors
/// [`CalibrationError::BadOption`] for an option outside its range, and where the dates, hours and
/// targets leave too little room: nothing seen in 5,000 draws for some observation.
///
/// ```
/// use helio_calib::simulate::{SimulateOptions, simulate};
/// use helio_calib::{Mount, Parameters};
/// use helio_core::sun::SunSite;
/// use helio_core::{Enu, EnuUnit, MountAxes, MountErrors, PoseErrors, TargetPlane, TrackingMode};
/// let mount = Mount {
///     axes: MountAxes::of(TrackingMode::AzimuthElevation, EnuUnit::UP),
///     pivot: Enu::new(20.0, 120.0, 2.0),
///     mirror_offset_m: 0.2,
///     pose_errors: PoseErrors::NONE,
/// };
/// let errors = MountErrors { pedestal_tilt_rad: 0.004, ..MountErrors::default() };
/// let north = EnuUnit::try_new(Enu::new(0.0, 1.0, 0.0))?;
/// let target = TargetPlane::level(Enu::new(0.0, 0.0, 40.0), north);
/// let site = SunSite::new(0.889, 0.111, 90.0)?;
/// let options = SimulateOptions { count: 20, ..SimulateOptions::default() };
/// let truth = Parameters::new(&errors, 0.2);
/// let campaign = simulate(&mount, &truth, &[target], &site, &options)?;
/// assert_eq!(campaign.observations.len(), 20);
/// assert!(campaign.observations.is_sorted_by_key(|o| o.unix_ns));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn simulate(
    mount: &Mount,
    errors: &Parameters,
    targets: &[TargetPlane],
    site: &SunSite,
    options: &SimulateOptions,
) -> Result<Simulated, CalibrationError> {
    simulate_while(mount, errors, targets, site, options, &|| true)
}

/// Like [`simulate`], for as long as somebody wants it: `goes_on` is asked before every observation.
///
/// # Errors
/// Those of [`simulate`], and [`CalibrationError::Stopped`].
pub fn simulate_while(
    mount: &Mount,
    errors: &Parameters,
    targets: &[TargetPlane],
    site: &SunSite,
    options: &SimulateOptions,
    goes_on: &dyn Fn() -> bool,
) -> Result<Simulated, CalibrationError> {
    check(errors, targets, options)?;
    let faults = faults(options, targets.len());
    let clock = Clock::new(site, options)?;
    let mut times = std::collections::BTreeSet::new();
    let mut rows = Vec::with_capacity(options.count);
    for (row, fault) in faults.into_iter().enumerate() {
        if !goes_on() {
            return Err(CalibrationError::Stopped);
        }
        let mut random = Random::stream(options.seed, row as u64 + 1);
        // Drawn first, so that they do not depend on how often a time is drawn.
        let noise = random.normal_pair();
        let away = options.outlier_mrad * random.between(1.0, 2.0);
        let whither = random.between(0.0, core::f64::consts::TAU);
        let mut seen = None;
        for _ in 0..MAX_TRIES {
            let Some((unix_ns, sun)) = clock.draw(&mut random, options)? else {
                continue;
            };
            let target = random.below(targets.len());
            let spot = [random.between(-1.0, 1.0), random.between(-1.0, 1.0)];
            if times.contains(&unix_ns) {
                continue;
            }
            let truth = Truth {
                parameters: at(errors, &options.jumps, unix_ns),
                fault,
            };
            let (who, whose) = match fault {
                Fault::WrongHeliostat(index) => options.neighbours[index],
                _ => (*mount, truth.parameters),
            };
            let Some(mut observation) =
                look(&who, &whose, options, sun, (target, &targets[target]), spot)
            else {
                continue;
            };
            observation.unix_ns = Some(unix_ns);
            observation.hour_angle_rad = Some(hour_angle_rad(sun, site.latitude_rad()));
            seen = Some((observation, truth));
            times.insert(unix_ns);
            break;
        }
        let Some((mut observation, truth)) = seen else {
            return Err(CalibrationError::BadOption {
                what: "number of observations that dates, hours, sun elevation and targets allow",
                wanted: "the count asked for",
                value: row as f64,
            });
        };
        let slant_m = 1e-3 * (observation.plane.centre - mount.pivot).norm();
        observation.u_m += options.noise_mrad * slant_m * noise[0];
        observation.v_m += options.noise_mrad * slant_m * noise[1];
        if options.noise_mrad > 0.0 {
            observation.sigma_m = Some(options.noise_mrad * slant_m);
        }
        match fault {
            Fault::Outlier => {
                let (sine, cosine) = libm::sincos(whither);
                observation.u_m += away * slant_m * cosine;
                observation.v_m += away * slant_m * sine;
            }
            Fault::WrongTarget(step) => {
                // `step` is a way to another target; from here on it is the target that was lit.
                let lit = observation.target;
                observation.target = (lit + step) % targets.len();
                observation.plane = targets[observation.target];
                let fault = Fault::WrongTarget(lit);
                rows.push((observation, Truth { fault, ..truth }));
                continue;
            }
            Fault::None | Fault::WrongHeliostat(_) => {}
        }
        rows.push((observation, truth));
    }
    rows.sort_by_key(|(observation, _)| observation.unix_ns);
    let (observations, truth) = rows.into_iter().unzip();
    Ok(Simulated {
        observations,
        truth,
    })
}

/// The parameters at an instant.
fn at(errors: &Parameters, jumps: &[Jump], unix_ns: i64) -> Parameters {
    let mut parameters = *errors;
    for jump in jumps.iter().filter(|jump| jump.unix_ns <= unix_ns) {
        parameters.values[Parameter::AzimuthReference as usize] += jump.azimuth_reference_rad;
        parameters.values[Parameter::ElevationReference as usize] += jump.elevation_reference_rad;
    }
    parameters
}

/// One look at a target, without noise; `None` if nothing is to be seen. `spot` is the place on the board
/// from -1 to 1, for [`Aiming::Board`].
fn look(
    mount: &Mount,
    truth: &Parameters,
    options: &SimulateOptions,
    sun: EnuUnit,
    (target, plane): (usize, &TargetPlane),
    spot: [f64; 2],
) -> Option<Observation> {
    let believed = Parameters::new(&MountErrors::default(), mount.mirror_offset_m);
    let [axis1_rad, axis2_rad] = match options.aiming {
        Aiming::Uncalibrated => encoder_angles_rad(mount, &believed, sun, plane.centre)?,
        Aiming::Believed(believed) => encoder_angles_rad(mount, &believed, sun, plane.centre)?,
        Aiming::Board {
            half_width_m,
            half_height_m,
        } => {
            let point = plane.point(half_width_m * spot[0], half_height_m * spot[1]);
            encoder_angles_rad(mount, truth, sun, point)?
        }
    };
    let mut observation = Observation::new(sun, axis1_rad, axis2_rad, *plane, 0.0, 0.0);
    observation.target = target;
    let landing = landing(&Pose::of(truth), &Sighting::new(mount, &observation));
    [observation.u_m, observation.v_m] = landing.residual_m;
    let seen = options
        .board_half_m
        .is_none_or(|[u, v]| observation.u_m.abs() <= u && observation.v_m.abs() <= v);
    (landing.hits() && seen).then_some(observation)
}

/// One fault for each observation, at random places: the shares asked for, and where one is no whole number of
/// observations, the rest of it by chance.
fn faults(options: &SimulateOptions, targets: usize) -> Vec<Fault> {
    let mut random = Random::stream(options.seed, 0);
    // a stream that neither an observation nor the days have
    let mut rest = Random::stream(options.seed, u64::MAX - 1);
    let mut count = |share: f64| {
        let wanted = share * options.count as f64;
        // shares are decimal fractions, which doubles are not
        let whole = libm::floor(wanted + 1e-9);
        whole as usize + usize::from(rest.uniform() < wanted - whole)
    };
    let mut faults = Vec::with_capacity(options.count);
    faults.resize(count(options.outlier_share), Fault::Outlier);
    for _ in 0..count(options.wrong_heliostat_share) {
        faults.push(Fault::WrongHeliostat(
            random.below(options.neighbours.len()),
        ));
    }
    for _ in 0..count(options.wrong_target_share) {
        faults.push(Fault::WrongTarget(1 + random.below(targets - 1)));
    }
    faults.resize(options.count, Fault::None);
    random.shuffle(&mut faults);
    faults
}

/// Where times come from.
struct Clock<'a> {
    site: &'a SunSite,
    /// First second of each stretch, and how many seconds it has; all equally long but the last.
    stretches: Vec<(i64, usize)>,
}

impl<'a> Clock<'a> {
    fn new(site: &'a SunSite, options: &SimulateOptions) -> Result<Self, CalibrationError> {
        const DAY_S: i64 = 86_400;
        let seconds = (options.to_unix_ns - options.from_unix_ns - 1) / SECOND_NS + 1;
        let Some(days) = options.days else {
            return Ok(Self {
                site,
                stretches: vec![(0, seconds as usize)],
            });
        };
        // Days of local mean time, cut off where the span begins and ends.
        let local = options.from_unix_ns.div_euclid(SECOND_NS)
            + (site.longitude_rad() / core::f64::consts::TAU * DAY_S as f64) as i64;
        let mut start = -local.rem_euclid(DAY_S);
        let mut stretches = Vec::new();
        while start < seconds {
            let (from, to) = (start.max(0), (start + DAY_S).min(seconds));
            if to > from {
                stretches.push((from, (to - from) as usize));
            }
            start += DAY_S;
        }
        if days == 0 || days > stretches.len() {
            return Err(CalibrationError::BadOption {
                what: "days",
                wanted: "at least 1 and no more than lie between from_unix_ns and to_unix_ns",
                value: days as f64,
            });
        }
        // A stream that no observation has.
        Random::stream(options.seed, u64::MAX).shuffle(&mut stretches);
        stretches.truncate(days);
        Ok(Self { site, stretches })
    }

    /// An instant and its sun, or none if the sun or the hour is not as asked.
    fn draw(
        &self,
        random: &mut Random,
        options: &SimulateOptions,
    ) -> Result<Option<(i64, EnuUnit)>, CalibrationError> {
        let (first, seconds) = self.stretches[random.below(self.stretches.len())];
        let second = first + random.below(seconds) as i64;
        let unix_ns = options.from_unix_ns + second * SECOND_NS;
        let position = sun::position(self.site, unix_ns, None, 0.0).map_err(|_| {
            CalibrationError::BadOption {
                what: "from_unix_ns",
                wanted: "an instant whose sun can be computed",
                value: unix_ns as f64,
            }
        })?;
        let toward = position.direction();
        let hour = 12.0
            + hour_angle_rad(toward, self.site.latitude_rad()) * (12.0 / core::f64::consts::PI);
        let wanted = position.apparent_elevation_rad >= options.min_sun_elevation_rad
            && position.apparent_elevation_rad > 0.0
            && (options.hours[0]..=options.hours[1]).contains(&hour);
        Ok(wanted.then_some((unix_ns, toward)))
    }
}

fn check(
    errors: &Parameters,
    targets: &[TargetPlane],
    options: &SimulateOptions,
) -> Result<(), CalibrationError> {
    let bad = |what, wanted, value| {
        Err(CalibrationError::BadOption {
            what,
            wanted,
            value,
        })
    };
    if let Some(value) = errors.values.into_iter().find(|value| !value.is_finite()) {
        return bad("true errors", "finite", value);
    }
    if targets.is_empty() {
        return bad("number of targets", "at least 1", 0.0);
    }
    if options.to_unix_ns <= options.from_unix_ns
        || options
            .to_unix_ns
            .checked_sub(options.from_unix_ns)
            .is_none()
    {
        let value = options.to_unix_ns as f64;
        return bad(
            "to_unix_ns",
            "after from_unix_ns, by 292 years at most",
            value,
        );
    }
    let [from, to] = options.hours;
    for (what, value) in [("hours from", from), ("hours to", to)] {
        if !(0.0..=24.0).contains(&value) {
            return bad(what, "within 0 to 24", value);
        }
    }
    if from >= to {
        return bad("hours to", "after hours from", to);
    }
    let elevation = options.min_sun_elevation_rad;
    if !(-core::f64::consts::FRAC_PI_2..core::f64::consts::FRAC_PI_2).contains(&elevation) {
        return bad("min_sun_elevation_rad", "within ±π/2", elevation);
    }
    for (what, value) in [
        ("noise_mrad", options.noise_mrad),
        ("outlier_mrad", options.outlier_mrad),
    ] {
        if !(value.is_finite() && value >= 0.0) {
            return bad(what, "finite and not negative", value);
        }
    }
    let shares = [
        ("outlier_share", options.outlier_share),
        ("wrong_heliostat_share", options.wrong_heliostat_share),
        ("wrong_target_share", options.wrong_target_share),
    ];
    for (what, value) in shares {
        if !(0.0..=1.0).contains(&value) {
            return bad(what, "within 0 to 1", value);
        }
    }
    let sum = shares.iter().map(|(_, share)| share).sum::<f64>();
    if sum > 1.0 {
        return bad("sum of the shares of wrong observations", "at most 1", sum);
    }
    if options.wrong_heliostat_share > 0.0 && options.neighbours.is_empty() {
        let wanted = "0 where no neighbours are given";
        return bad(
            "wrong_heliostat_share",
            wanted,
            options.wrong_heliostat_share,
        );
    }
    if options.wrong_target_share > 0.0 && targets.len() < 2 {
        let wanted = "0 where there is one target only";
        return bad("wrong_target_share", wanted, options.wrong_target_share);
    }
    for jump in &options.jumps {
        for (what, value) in [
            ("jump of azimuth_reference_rad", jump.azimuth_reference_rad),
            (
                "jump of elevation_reference_rad",
                jump.elevation_reference_rad,
            ),
        ] {
            if !value.is_finite() {
                return bad(what, "finite", value);
            }
        }
    }
    Ok(())
}

/// How large the errors of the heliostats of a field are: greatest magnitudes, each value below
/// equally likely.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ErrorSpread {
    /// Of the pedestal's tilt \[rad\], in any direction.
    pub pedestal_tilt_rad: f64,
    /// Of the axes' non-orthogonality \[rad\].
    pub axis_nonorthogonality_rad: f64,
    /// Of the mirror's tilt \[rad\].
    pub mirror_tilt_rad: f64,
    /// Of the first axis' reference \[rad\].
    pub azimuth_reference_rad: f64,
    /// Of the second axis' reference \[rad\].
    pub elevation_reference_rad: f64,
}

impl Default for ErrorSpread {
    /// A field set up with care: some milliradians each.
    fn default() -> Self {
        Self {
            pedestal_tilt_rad: 0.005,
            axis_nonorthogonality_rad: 0.003,
            mirror_tilt_rad: 0.003,
            azimuth_reference_rad: 0.01,
            elevation_reference_rad: 0.01,
        }
    }
}

impl ErrorSpread {
    /// The errors of one heliostat.
    ///
    /// ```
    /// use helio_calib::random::Random;
    /// use helio_calib::simulate::ErrorSpread;
    /// let errors = ErrorSpread::default().draw(&mut Random::new(1));
    /// assert!(errors.pedestal_tilt_rad <= 0.005);
    /// ```
    #[must_use]
    pub fn draw(&self, random: &mut Random) -> MountErrors {
        let mut either = |most: f64| random.between(-most, most);
        let errors = MountErrors {
            axis_nonorthogonality_rad: either(self.axis_nonorthogonality_rad),
            mirror_tilt_rad: either(self.mirror_tilt_rad),
            azimuth_reference_rad: either(self.azimuth_reference_rad),
            elevation_reference_rad: either(self.elevation_reference_rad),
            ..MountErrors::default()
        };
        MountErrors {
            pedestal_tilt_rad: random.between(0.0, self.pedestal_tilt_rad),
            pedestal_tilt_azimuth_rad: random.between(0.0, core::f64::consts::TAU),
            ..errors
        }
        .canonical()
    }
}
