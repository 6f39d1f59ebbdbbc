//! Which observations to make next: those that lower the predicted pointing uncertainty over the year
//! most.
//!
//! An observation at some sun and target adds two rows B (its Jacobian over its noise) to the
//! information JᵀJ that there is. The year's pointing uncertainty is the mean, over the year's suns, of
//! the beam's variance trace(G C Gᵀ) with C = (JᵀJ)⁻¹ and G the beam's Jacobian there: an I-optimal
//! design (Atkinson, Donev and Tobias 2007, §10.6). It is computed from triangular factors alone: with
//! J = Q R and the year's G = Q' F it is |F R⁻¹|², and an observation lowers it by
//!
//! ```text
//! trace((I + UᵀU)⁻¹ (X U)ᵀ (X U)),   X = F R⁻¹,   U = R⁻ᵀ Bᵀ
//! ```
//!
//! The observations are chosen one after another, each the best beside those before, and then exchanged
//! one by one as long as that helps (Fedorov 1972), from there and from some starts at random; the best is taken.

use helio_core::sun::{self, SunSite};
use helio_core::{Enu, EnuUnit, TargetPlane};

use crate::aiming::encoder_angles_rad;
use crate::error::CalibrationError;
use crate::model::{Pose, landing};
use crate::observation::{Mount, Observation, Sighting};
use crate::parameters::{COUNT, Parameters};
use crate::random::Random;

/// Nanoseconds of a second.
const SECOND_NS: f64 = 1e9;
/// Most rounds of exchanging.
const MAX_ROUNDS: usize = 20;
/// Where exchanging begins: the greedy choice and some at random.
const STARTS: u64 = 8;
/// An exchange must lower the mean variance by more than this share.
const WORTH: f64 = 1e-9;

/// An observation that could be made.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Candidate {
    /// When \[ns since 1970 UTC\].
    pub unix_ns: i64,
    /// Toward the (apparent) sun then.
    pub sun: EnuUnit,
    /// Which target, as the caller numbers them.
    pub target: usize,
    /// Its plane; the heliostat aims at its centre.
    pub plane: TargetPlane,
}

/// An observation that should be made.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Proposal {
    /// When \[ns since 1970 UTC\].
    pub unix_ns: i64,
    /// Toward the (apparent) sun then.
    pub sun: EnuUnit,
    /// Which target, as the caller numbers them.
    pub target: usize,
    /// Predicted pointing uncertainty (one standard deviation of the beam, RMS over the year's suns)
    /// with all observations so far and the proposals before this \[mrad\].
    pub expected_year_pointing_mrad_before: f64,
    /// The same with this one too \[mrad\].
    pub expected_year_pointing_mrad_after: f64,
}

/// What the calibration is for.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Duty<'a> {
    /// Suns under which the heliostat will work, for instance [`year_suns`]; each counts alike.
    pub suns: &'a [EnuUnit],
    /// Where its beam shall go.
    pub aim: Enu,
}

/// What is assumed of observations to come.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PlanOptions {
    /// One standard deviation of either component of a spot, over the slant \[mrad\]; also of observations so
    /// far that state no sigma.
    pub noise_mrad: f64,
    /// What is known of each parameter without any observation: one standard deviation, in the
    /// parameter's unit, in the order of [`Parameter::ALL`](crate::Parameter::ALL); zero for one that is
    /// held. It makes the first observations of a new heliostat comparable and hardly matters later.
    pub prior_sigmas: [f64; COUNT],
    /// Least time between two observations, whatever their targets \[s\].
    pub min_gap_s: f64,
}

impl Default for PlanOptions {
    /// 0.5 mrad of noise, 10 mrad known before of either tilt, non-orthogonality and mirror tilt, 50 mrad of the
    /// encoder references, the mirror offset held, a minute between observations.
    fn default() -> Self {
        Self {
            noise_mrad: 0.5,
            prior_sigmas: [0.01, 0.01, 0.05, 0.01, 0.05, 0.01, 0.0],
            min_gap_s: 60.0,
        }
    }
}

/// The observations that could be made of some targets from one instant to another \[ns since 1970
/// UTC, the end excluded\], every `step_s` seconds while the sun's apparent centre stands at least
/// `min_sun_elevation_rad` high.
///
/// # Errors
/// [`CalibrationError::BadOption`] for a step that is not positive, or dates without a sun position.
///
/// ```
/// use helio_calib::plan::candidates;
/// use helio_core::sun::SunSite;
/// use helio_core::{Enu, EnuUnit, TargetPlane};
/// let north = EnuUnit::try_new(Enu::new(0.0, 1.0, 0.0))?;
/// let target = TargetPlane::level(Enu::new(0.0, 0.0, 40.0), north);
/// let site = SunSite::new(0.889, 0.111, 90.0)?;
/// let day = 1_750_464_000_000_000_000; // 2025-06-21
/// let all = candidates(&site, day, day + 86_400_000_000_000, 1800.0, 0.17, &[target])?;
/// assert_eq!(all.len(), 28); // 14 hours above 10 degrees
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn candidates(
    site: &SunSite,
    from_unix_ns: i64,
    to_unix_ns: i64,
    step_s: f64,
    min_sun_elevation_rad: f64,
    targets: &[TargetPlane],
) -> Result<Vec<Candidate>, CalibrationError> {
    let step_ns = step_s * SECOND_NS;
    if !(step_ns.is_finite() && (1.0..1e18).contains(&step_ns)) {
        return Err(CalibrationError::BadOption {
            what: "step_s",
            wanted: "between 1e-9 and 1e9 s",
            value: step_s,
        });
    }
    let mut out = Vec::new();
    let mut unix_ns = from_unix_ns;
    while unix_ns < to_unix_ns {
        let position =
            sun::position(site, unix_ns, None, 0.0).map_err(|_| CalibrationError::BadOption {
                what: "from_unix_ns",
                wanted: "an instant whose sun can be computed",
                value: unix_ns as f64,
            })?;
        let elevation_rad = position.apparent_elevation_rad;
        if elevation_rad > 0.0 && elevation_rad >= min_sun_elevation_rad {
            let sun = position.direction();
            out.extend(
                targets
                    .iter()
                    .enumerate()
                    .map(|(target, &plane)| Candidate {
                        unix_ns,
                        sun,
                        target,
                        plane,
                    }),
            );
        }
        let Some(next) = unix_ns.checked_add(step_ns as i64) else {
            break;
        };
        unix_ns = next;
    }
    Ok(out)
}

/// Suns of a year over a latitude \[rad, north positive\]: on 24 days evenly spaced along the ecliptic, every
/// quarter hour of solar time while the (geometric) sun stands at least `min_elevation_rad` high.
///
/// ```
/// use helio_calib::plan::year_suns;
/// let suns = year_suns(0.889, 0.17);
/// let highest = suns.iter().map(|s| s.elevation_rad()).fold(0.0, f64::max);
/// assert!((highest.to_degrees() - (90.0 - 50.94 + 23.44)).abs() < 0.1);
/// ```
#[must_use]
pub fn year_suns(latitude_rad: f64, min_elevation_rad: f64) -> Vec<EnuUnit> {
    /// Mean obliquity of the ecliptic in 2025 \[rad\].
    const OBLIQUITY_RAD: f64 = 0.409_034;
    const DAYS: u32 = 24;
    const QUARTERS: u32 = 96;
    let turn = |k: u32, of: u32| core::f64::consts::TAU * f64::from(k) / f64::from(of);
    let (sin_latitude, cos_latitude) = libm::sincos(latitude_rad);
    let sin_least = libm::sin(min_elevation_rad);
    let mut suns = Vec::new();
    for day in 0..DAYS {
        let sin_declination = libm::sin(OBLIQUITY_RAD) * libm::sin(turn(day, DAYS));
        let cos_declination = libm::sqrt(1.0 - sin_declination * sin_declination);
        for quarter in 0..QUARTERS {
            let (sin_hour, cos_hour) =
                libm::sincos(turn(quarter, QUARTERS) - core::f64::consts::PI);
            let toward = Enu::new(
                -cos_declination * sin_hour,
                sin_declination * cos_latitude - cos_declination * cos_hour * sin_latitude,
                sin_declination * sin_latitude + cos_declination * cos_hour * cos_latitude,
            );
            if toward.up > 0.0
                && toward.up >= sin_least
                && let Ok(sun) = EnuUnit::try_new(toward)
            {
                suns.push(sun);
            }
        }
    }
    suns
}

/// Proposes the next `n` observations of a heliostat, of those that could be made; fewer where the
/// candidates (or the gaps between them) do not suffice. The first proposal is worth most, and so on; put
/// them in order of time to carry them out.
///
/// `parameters` is the best that is known now (all zero for a new heliostat). Candidates under whose
/// sun the heliostat cannot light the target are left out, as are suns of its duty under which it cannot work.
///
/// # Errors
/// [`CalibrationError::BadOption`] for a noise that is not positive, a negative prior or gap, no parameter
/// to learn about, or a duty under none of whose suns the heliostat can work.
pub fn plan(
    mount: &Mount,
    parameters: &Parameters,
    so_far: &[Observation],
    candidates: &[Candidate],
    duty: &Duty<'_>,
    n: usize,
    options: &PlanOptions,
) -> Result<Vec<Proposal>, CalibrationError> {
    let design = Design::new(mount, parameters, so_far, candidates, duty, options)?;
    let (chosen, variances) = design.search(n);
    Ok(chosen
        .iter()
        .zip(variances.windows(2))
        .map(|(&index, pair)| {
            let candidate = &candidates[design.offers[index].candidate];
            Proposal {
                unix_ns: candidate.unix_ns,
                sun: candidate.sun,
                target: candidate.target,
                expected_year_pointing_mrad_before: 1e3 * libm::sqrt(pair[0]),
                expected_year_pointing_mrad_after: 1e3 * libm::sqrt(pair[1]),
            }
        })
        .collect())
}

/// Predicted pointing uncertainty \[mrad\] over a heliostat's duty after some observations: the number
/// that [`plan`] makes small. One standard deviation of the beam, RMS over the duty's suns and both directions
/// together.
///
/// # Errors
/// As [`plan`].
pub fn expected_pointing_mrad(
    mount: &Mount,
    parameters: &Parameters,
    so_far: &[Observation],
    duty: &Duty<'_>,
    options: &PlanOptions,
) -> Result<f64, CalibrationError> {
    let design = Design::new(mount, parameters, so_far, &[], duty, options)?;
    Ok(1e3 * libm::sqrt(design.state(&[]).variance))
}

type Row = [f64; COUNT];
type Square = [Row; COUNT];

/// A candidate and its two rows.
struct Offer {
    candidate: usize,
    unix_ns: i64,
    rows: [Row; 2],
}

/// Everything in parameters over their prior sigmas, so that columns are comparable and what is known
/// before is the identity.
struct Design {
    /// Triangular factor of what is known so far.
    known: Square,
    /// Triangular factor of the duty's beams, so that the mean variance of the beam is |F R⁻¹|² \[rad²\].
    duty: Square,
    offers: Vec<Offer>,
    min_gap_ns: i64,
}

/// What some observations give.
struct State {
    /// R.
    factor: Square,
    /// F R⁻¹.
    leverage: Square,
    /// Mean variance of the beam \[rad²\].
    variance: f64,
}

impl Design {
    fn new(
        mount: &Mount,
        parameters: &Parameters,
        so_far: &[Observation],
        candidates: &[Candidate],
        duty: &Duty<'_>,
        options: &PlanOptions,
    ) -> Result<Self, CalibrationError> {
        check(options)?;
        let pose = Pose::of(parameters);
        let sigmas = &options.prior_sigmas;
        let scaled = |slopes: [Row; 2], sigma: f64| {
            slopes.map(|row| core::array::from_fn(|k| row[k] * sigmas[k] / sigma))
        };
        let noise =
            |plane: &TargetPlane| 1e-3 * options.noise_mrad * (plane.centre - mount.pivot).norm();
        let mut known: Square =
            core::array::from_fn(|i| core::array::from_fn(|k| if i == k { 1.0 } else { 0.0 }));
        for observation in so_far {
            let landing = landing(&pose, &Sighting::new(mount, observation));
            if !landing.hits() {
                continue; // it says nothing near these parameters
            }
            let sigma = observation
                .sigma_m
                .unwrap_or_else(|| noise(&observation.plane));
            for row in scaled(landing.slopes, sigma) {
                add_row(&mut known, row);
            }
        }
        let lit = |sun: EnuUnit, plane: &TargetPlane| {
            let [axis1_rad, axis2_rad] = encoder_angles_rad(mount, parameters, sun, plane.centre)?;
            let observation = Observation::new(sun, axis1_rad, axis2_rad, *plane, 0.0, 0.0);
            let landing = landing(&pose, &Sighting::new(mount, &observation));
            landing.hits().then_some(landing)
        };
        let mut work: Square = [[0.0; COUNT]; COUNT];
        let mut suns = 0_u32;
        for &sun in duty.suns {
            // A plane that faces the pivot: the beam meets it at right angles but for Hz/L, whose square counts.
            let Ok(facing) = EnuUnit::try_new(mount.pivot - duty.aim) else {
                continue;
            };
            let Some(landing) = lit(sun, &TargetPlane::level(duty.aim, facing)) else {
                continue;
            };
            for row in scaled(landing.slopes, landing.beam_m) {
                add_row(&mut work, row);
            }
            suns += 1;
        }
        if suns == 0 {
            return Err(CalibrationError::BadOption {
                what: "number of the duty's suns under which the heliostat can work",
                wanted: "at least 1",
                value: 0.0,
            });
        }
        let per_sun = libm::sqrt(f64::from(suns)).recip();
        for value in work.iter_mut().flatten() {
            *value *= per_sun;
        }
        let offers = candidates
            .iter()
            .enumerate()
            .filter_map(|(candidate, c)| {
                let landing = lit(c.sun, &c.plane)?;
                Some(Offer {
                    candidate,
                    unix_ns: c.unix_ns,
                    rows: scaled(landing.slopes, noise(&c.plane)),
                })
            })
            .collect();
        Ok(Self {
            known,
            duty: work,
            offers,
            min_gap_ns: (options.min_gap_s * SECOND_NS) as i64,
        })
    }

    /// With some of the offers taken.
    fn state(&self, taken: &[usize]) -> State {
        let mut factor = self.known;
        for &index in taken {
            for row in self.offers[index].rows {
                add_row(&mut factor, row);
            }
        }
        let leverage = self.duty.map(|row| solve_transposed(&factor, row));
        let variance = leverage.iter().flatten().map(|x| x * x).sum();
        State {
            factor,
            leverage,
            variance,
        }
    }

    /// By how much an offer lowers the mean variance.
    fn gain(&self, state: &State, offer: usize) -> f64 {
        let u = self.offers[offer]
            .rows
            .map(|row| solve_transposed(&state.factor, row));
        let dot = |a: &Row, b: &Row| a.iter().zip(b).map(|(x, y)| x * y).sum::<f64>();
        let (mut aa, mut ab, mut bb) = (0.0, 0.0, 0.0);
        for row in &state.leverage {
            let (a, b) = (dot(row, &u[0]), dot(row, &u[1]));
            aa += a * a;
            ab += a * b;
            bb += b * b;
        }
        let (s, t, v) = (
            1.0 + dot(&u[0], &u[0]),
            dot(&u[0], &u[1]),
            1.0 + dot(&u[1], &u[1]),
        );
        (v * aa - 2.0 * t * ab + s * bb) / (s * v - t * t)
    }

    /// True if an offer is among some, or too soon before or after one.
    fn too_near(&self, index: usize, taken: &[usize]) -> bool {
        taken.iter().any(|&other| {
            let gap = self.offers[other]
                .unix_ns
                .saturating_sub(self.offers[index].unix_ns);
            other == index || gap.saturating_abs() < self.min_gap_ns
        })
    }

    /// The best offer beside some; `None` if there is none left. The earliest of equals.
    fn best(&self, state: &State, taken: &[usize]) -> Option<(usize, f64)> {
        let mut best = None;
        for index in 0..self.offers.len() {
            if self.too_near(index, taken) {
                continue;
            }
            let gain = self.gain(state, index);
            if best.is_none_or(|(_, most)| gain > most) {
                best = Some((index, gain));
            }
        }
        best
    }

    /// The offers to take, the most useful first, and the mean variance before and after each.
    fn search(&self, n: usize) -> (Vec<usize>, Vec<f64>) {
        let mut greedy = Vec::with_capacity(n.min(self.offers.len()));
        self.fill(&mut greedy, n);
        let mut best = self.exchange(greedy, n);
        // One start may lead into a corner, where every single exchange makes things worse.
        for start in 1..STARTS {
            let mut random = Random::stream(0, start);
            let mut taken: Vec<usize> = Vec::with_capacity(n);
            for _ in 0..n.min(self.offers.len()) {
                let index = random.below(self.offers.len());
                if !self.too_near(index, &taken) {
                    taken.push(index);
                }
            }
            let (taken, variance) = self.exchange(taken, n);
            if taken.len() > best.0.len()
                || (taken.len() == best.0.len() && variance < best.1 * (1.0 - WORTH))
            {
                best = (taken, variance);
            }
        }
        self.in_order(best.0)
    }

    /// Takes the best offers until there are `n`, or none left.
    fn fill(&self, taken: &mut Vec<usize>, n: usize) {
        while taken.len() < n
            && let Some((index, _)) = self.best(&self.state(taken), taken)
        {
            taken.push(index);
        }
    }

    /// Exchanges one offer after another as long as that helps; and the mean variance then.
    fn exchange(&self, mut taken: Vec<usize>, n: usize) -> (Vec<usize>, f64) {
        self.fill(&mut taken, n);
        let mut variance = self.state(&taken).variance;
        for _ in 0..MAX_ROUNDS {
            let mut exchanged = false;
            for place in 0..taken.len() {
                let mut others = taken.clone();
                others.remove(place);
                let state = self.state(&others);
                let Some((index, gain)) = self.best(&state, &others) else {
                    continue;
                };
                if index != taken[place] && state.variance - gain < variance * (1.0 - WORTH) {
                    taken[place] = index;
                    variance = self.state(&taken).variance;
                    exchanged = true;
                }
            }
            if !exchanged {
                break;
            }
        }
        (taken, variance)
    }

    /// The most useful first.
    fn in_order(&self, mut left: Vec<usize>) -> (Vec<usize>, Vec<f64>) {
        let mut taken: Vec<usize> = Vec::with_capacity(left.len());
        let mut state = self.state(&taken);
        let mut variances = vec![state.variance];
        while !left.is_empty() {
            let mut best = (0, f64::NEG_INFINITY);
            for (place, &index) in left.iter().enumerate() {
                let gain = self.gain(&state, index);
                if gain > best.1 {
                    best = (place, gain);
                }
            }
            taken.push(left.remove(best.0));
            state = self.state(&taken);
            variances.push(state.variance);
        }
        (taken, variances)
    }
}

/// Adds a row to the least-squares problem whose triangular factor is `factor`, by Givens rotations.
fn add_row(factor: &mut Square, mut row: Row) {
    for k in 0..COUNT {
        if row[k] == 0.0 {
            continue;
        }
        let radius = libm::hypot(factor[k][k], row[k]);
        let (cosine, sine) = (factor[k][k] / radius, row[k] / radius);
        for j in k..COUNT {
            let (above, below) = (factor[k][j], row[j]);
            factor[k][j] = cosine * above + sine * below;
            row[j] = cosine * below - sine * above;
        }
    }
}

/// x of Rᵀ x = row, by substitution.
fn solve_transposed(factor: &Square, row: Row) -> Row {
    let mut x = row;
    for k in 0..COUNT {
        for j in 0..k {
            x[k] -= factor[j][k] * x[j];
        }
        x[k] /= factor[k][k];
    }
    x
}

fn check(options: &PlanOptions) -> Result<(), CalibrationError> {
    let bad = |what, wanted, value| {
        Err(CalibrationError::BadOption {
            what,
            wanted,
            value,
        })
    };
    if !(options.noise_mrad.is_finite() && options.noise_mrad > 0.0) {
        return bad("noise_mrad", "finite and positive", options.noise_mrad);
    }
    if !(0.0..=1e9).contains(&options.min_gap_s) {
        return bad("min_gap_s", "within 0 to 1e9 s", options.min_gap_s);
    }
    for sigma in options.prior_sigmas {
        if !(sigma.is_finite() && sigma >= 0.0) {
            return bad("prior_sigmas", "finite and not negative", sigma);
        }
    }
    if options.prior_sigmas == [0.0; COUNT] {
        return bad("prior_sigmas", "positive for one parameter at least", 0.0);
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use helio_core::{MountAxes, MountErrors, PoseErrors, TrackingMode};

    fn site() -> SunSite {
        SunSite::new(0.8886, 0.1115, 88.0).unwrap()
    }

    fn targets() -> Vec<TargetPlane> {
        let north = EnuUnit::try_new(Enu::new(0.0, 1.0, 0.0)).unwrap();
        [(0.0, 43.1), (-17.6, 52.0)]
            .map(|(east, up)| TargetPlane::level(Enu::new(east, -3.2, up), north))
            .to_vec()
    }

    struct Case {
        mount: Mount,
        parameters: Parameters,
        so_far: Vec<Observation>,
        offers: Vec<Candidate>,
        suns: Vec<EnuUnit>,
    }

    const AIM: Enu = Enu::new(0.0, -0.5, 55.2);

    /// A heliostat with some observations of one morning and those that another day offers.
    fn case(seed: u64, so_far: usize, step_s: f64) -> Case {
        let mut random = Random::stream(seed, 9);
        let modes = [
            TrackingMode::AzimuthElevation,
            TrackingMode::PitchRoll {
                axis_azimuth_rad: core::f64::consts::FRAC_PI_2,
            },
        ];
        let mount = Mount {
            axes: MountAxes::of(modes[random.below(2)], EnuUnit::UP),
            pivot: Enu::new(
                random.between(-100.0, 100.0),
                random.between(20.0, 240.0),
                1.7,
            ),
            mirror_offset_m: 0.175,
            pose_errors: PoseErrors::NONE,
        };
        let mut parameters = Parameters::new(&MountErrors::default(), 0.175);
        for value in &mut parameters.values[..6] {
            *value = random.between(-0.005, 0.005);
        }
        let start = |day: i64| (1_735_689_600 + 86_400 * day) * 1_000_000_000;
        let day = random.below(365) as i64;
        let all = |day: i64, step_s: f64| {
            let from = start(day);
            candidates(
                &site(),
                from,
                from + start(1) - start(0),
                step_s,
                0.15,
                &targets(),
            )
            .unwrap()
        };
        let pose = Pose::of(&parameters);
        let mut so_far_rows = Vec::new();
        let past = all((day + 300) % 365, 600.0);
        for c in past.iter().take(so_far) {
            let [axis1_rad, axis2_rad] =
                encoder_angles_rad(&mount, &Parameters::default(), c.sun, c.plane.centre).unwrap();
            let mut seen = Observation::new(c.sun, axis1_rad, axis2_rad, c.plane, 0.0, 0.0);
            let spot = landing(&pose, &Sighting::new(&mount, &seen));
            assert!(spot.hits());
            [seen.u_m, seen.v_m] = spot.residual_m;
            so_far_rows.push(seen);
        }
        Case {
            mount,
            parameters,
            so_far: so_far_rows,
            offers: all(day, step_s),
            suns: year_suns(0.8886, 0.15),
        }
    }

    impl Case {
        fn design(&self, options: &PlanOptions) -> Design {
            let duty = Duty {
                suns: &self.suns,
                aim: AIM,
            };
            let Self {
                mount,
                parameters,
                so_far,
                offers,
                ..
            } = self;
            Design::new(mount, parameters, so_far, offers, &duty, options).unwrap()
        }
    }

    /// trace(G C Gᵀ) the naive way, by normal equations in plain arithmetic.
    fn naive_variance(case: &Case, options: &PlanOptions, chosen: &[Candidate]) -> f64 {
        let pose = Pose::of(&case.parameters);
        let free = 6;
        let mut normal = vec![vec![0.0; 2 * free]; free];
        for (k, row) in normal.iter_mut().enumerate() {
            row[k] = options.prior_sigmas[k].powi(-2);
            row[free + k] = 1.0;
        }
        let mut rows = Vec::new();
        for seen in &case.so_far {
            let slant_m = (seen.plane.centre - case.mount.pivot).norm();
            rows.push((*seen, 1e-3 * options.noise_mrad * slant_m));
        }
        let aimed = |sun, plane: TargetPlane| {
            let [axis1_rad, axis2_rad] =
                encoder_angles_rad(&case.mount, &case.parameters, sun, plane.centre).unwrap();
            Observation::new(sun, axis1_rad, axis2_rad, plane, 0.0, 0.0)
        };
        for c in chosen {
            let slant_m = (c.plane.centre - case.mount.pivot).norm();
            rows.push((aimed(c.sun, c.plane), 1e-3 * options.noise_mrad * slant_m));
        }
        for (seen, sigma) in rows {
            for slopes in landing(&pose, &Sighting::new(&case.mount, &seen)).slopes {
                for i in 0..free {
                    for k in 0..free {
                        normal[i][k] += slopes[i] * slopes[k] / (sigma * sigma);
                    }
                }
            }
        }
        // Gauss and Jordan
        for pivot in 0..free {
            let by = normal[pivot][pivot];
            for value in &mut normal[pivot] {
                *value /= by;
            }
            for other in 0..free {
                if other != pivot {
                    let factor = normal[other][pivot];
                    let by = normal[pivot].clone();
                    for (value, by) in normal[other].iter_mut().zip(by) {
                        *value -= factor * by;
                    }
                }
            }
        }
        let facing = EnuUnit::try_new(case.mount.pivot - AIM).unwrap();
        let plane = TargetPlane::level(AIM, facing);
        let mut sum = 0.0;
        for &sun in &case.suns {
            let spot = landing(&pose, &Sighting::new(&case.mount, &aimed(sun, plane)));
            for slopes in spot.slopes {
                for i in 0..free {
                    for k in 0..free {
                        sum += slopes[i] * normal[i][free + k] * slopes[k] / spot.beam_m.powi(2);
                    }
                }
            }
        }
        sum / case.suns.len() as f64
    }

    #[test]
    fn variances_and_gains_are_those_of_the_normal_equations() {
        for seed in 0..20 {
            let case = case(seed, seed as usize, 1800.0);
            let options = PlanOptions::default();
            let design = case.design(&options);
            let before = design.state(&[]);
            let naive = naive_variance(&case, &options, &[]);
            assert!((before.variance / naive - 1.0).abs() < 1e-8, "{seed}");
            for index in (0..design.offers.len()).step_by(7) {
                let after = design.state(&[index]).variance;
                let chosen = case.offers[design.offers[index].candidate];
                let naive = naive_variance(&case, &options, &[chosen]);
                assert!((after / naive - 1.0).abs() < 1e-7, "{seed}");
                let gain = design.gain(&before, index);
                assert!((gain - (before.variance - after)).abs() < 1e-9 * before.variance);
            }
        }
    }

    #[test]
    fn search_finds_what_trying_all_finds_to_a_few_per_cent() {
        let mut worst = 1.0_f64;
        for seed in 0..40 {
            // an observation each hour; sets of three
            let case = case(seed, [0, 3, 6, 12][seed as usize % 4], 3600.0);
            let options = PlanOptions::default();
            let design = case.design(&options);
            let offers = design.offers.len();
            let mut least = f64::INFINITY;
            for i in 0..offers {
                for j in 0..i {
                    for k in 0..j {
                        let time = |index: usize| design.offers[index].unix_ns;
                        if time(i) != time(j) && time(j) != time(k) && time(i) != time(k) {
                            least = least.min(design.state(&[i, j, k]).variance);
                        }
                    }
                }
            }
            let (chosen, variances) = design.search(3);
            assert_eq!(chosen.len(), 3);
            assert!(variances[3] >= least * (1.0 - 1e-9));
            worst = worst.max((variances[3] / least).sqrt());
        }
        println!("greatest pointing uncertainty over that of the best three: {worst}");
        assert!(worst < 1.03, "{worst}");
    }

    #[test]
    fn proposals_are_in_order_of_use_and_keep_their_gaps() {
        let case = case(5, 4, 300.0);
        let options = PlanOptions {
            min_gap_s: 1200.0,
            ..PlanOptions::default()
        };
        let duty = Duty {
            suns: &case.suns,
            aim: AIM,
        };
        let proposals = plan(
            &case.mount,
            &case.parameters,
            &case.so_far,
            &case.offers,
            &duty,
            6,
            &options,
        )
        .unwrap();
        assert_eq!(proposals.len(), 6);
        let first =
            expected_pointing_mrad(&case.mount, &case.parameters, &case.so_far, &duty, &options)
                .unwrap();
        assert_eq!(proposals[0].expected_year_pointing_mrad_before, first);
        for pair in proposals.windows(2) {
            let [a, b] = pair else { unreachable!() };
            assert_eq!(
                a.expected_year_pointing_mrad_after,
                b.expected_year_pointing_mrad_before
            );
            assert!(b.expected_year_pointing_mrad_after < b.expected_year_pointing_mrad_before);
        }
        let mut times: Vec<i64> = proposals.iter().map(|p| p.unix_ns).collect();
        times.sort_unstable();
        assert!(times.windows(2).all(|p| p[1] - p[0] >= 1_200_000_000_000));
        // Nothing to choose from, nothing proposed.
        let none = plan(
            &case.mount,
            &case.parameters,
            &case.so_far,
            &[],
            &duty,
            6,
            &options,
        );
        assert!(none.unwrap().is_empty());
    }

    #[test]
    fn what_cannot_be_is_refused() {
        let case = case(1, 4, 3600.0);
        let ask = |options: &PlanOptions, suns: &[EnuUnit]| {
            let duty = Duty { suns, aim: AIM };
            plan(
                &case.mount,
                &case.parameters,
                &case.so_far,
                &case.offers,
                &duty,
                1,
                options,
            )
            .unwrap_err()
            .to_string()
        };
        let base = PlanOptions::default();
        let noiseless = PlanOptions {
            noise_mrad: 0.0,
            ..base
        };
        assert_eq!(
            ask(&noiseless, &case.suns),
            "noise_mrad must be finite and positive, got 0"
        );
        let sure = PlanOptions {
            prior_sigmas: [0.0; COUNT],
            ..base
        };
        assert_eq!(
            ask(&sure, &case.suns),
            "prior_sigmas must be positive for one parameter at least, got 0"
        );
        assert_eq!(
            ask(&base, &[]),
            "number of the duty's suns under which the heliostat can work must be at least 1, got 0"
        );
    }
}
