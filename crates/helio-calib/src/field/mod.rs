//! A whole field: eight heliostats in eight lanes, and as many threads as wanted.

#![allow(
    clippy::needless_range_loop,
    reason = "triangles of matrices are written by their indices; closures are not inlined into lanes"
)]

mod formula;
mod group;
mod iterate;
pub(crate) mod lane;
mod solve;
mod start;

use core::cmp::Reverse;
use core::f64::consts::FRAC_PI_2;
use core::sync::atomic::{AtomicUsize, Ordering};

use helio_core::SimdLevel;
use helio_core::angle::wrap_pi;
use helio_core::lanes::{BLOCK, run};

use crate::covariance::uncertainty;
use crate::error::CalibrationError;
use crate::fit::{Constraint, FitOptions, Start, Stop, check, fit};
use crate::observation::{Mount, Observation};
use crate::parameters::{COUNT, Parameter, Parameters};
use group::{Group, ask_for_first};
use iterate::{Answers, Job, Settings, code};

/// One heliostat and what was seen of it.
#[derive(Debug, Clone, Copy)]
pub struct Campaign<'a> {
    /// What is known of it.
    pub mount: Mount,
    /// What was seen.
    pub observations: &'a [Observation],
}

/// How to fit a field. Squares of both components of the residual are made small.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FieldFitOptions {
    /// What is asked of each parameter, in the order of [`Parameter::ALL`].
    pub constraints: [Constraint; COUNT],
    /// Where to begin. A cold start finds references of any size.
    pub start: Start,
    /// Most iterations.
    pub max_iterations: usize,
    /// The fit ends where what is left of every angle \[rad\] (of the offset \[m\]), judged by how fast steps
    /// shrink, is less than this.
    pub tolerance_rad: f64,
    /// Most threads to use; 0 for as many as the thread pool has. No bit of the answer depends on it.
    pub threads: usize,
    /// Instruction set; `None` for the best that the processor has. No bit of the answer depends on it.
    pub level: Option<SimdLevel>,
    /// Compute the covariance.
    pub with_covariance: bool,
}

impl Default for FieldFitOptions {
    /// Six angles free, the mirror offset held, a cold start, no covariance, all threads.
    fn default() -> Self {
        let mut constraints = [Constraint::Free; COUNT];
        constraints[Parameter::MirrorOffset as usize] = Constraint::Held;
        Self {
            constraints,
            start: Start::Cold,
            max_iterations: 100,
            tolerance_rad: 1e-10,
            threads: 0,
            level: None,
            with_covariance: false,
        }
    }
}

/// The fit of one heliostat of a field.
#[derive(Debug, Clone, PartialEq)]
pub struct FieldFit {
    /// The optimum, in canonical form.
    pub parameters: Parameters,
    /// Why it ended.
    pub stop: Stop,
    /// Iterations.
    pub iterations: usize,
    /// S: sum of squares of all residuals divided by their sigma, priors included; in m² where no sigma is
    /// stated.
    pub sum_of_squares: f64,
    /// sqrt(mean of du² + dv²) \[m\].
    pub rms_m: f64,
    /// Covariance of the parameters for the estimated size of errors, S/(residuals - parameters), where
    /// asked for; zero in the rows of those held.
    pub covariance: Option<Box<[[f64; COUNT]; COUNT]>>,
    /// How many observations it had.
    pub observations: usize,
}

/// Fits every heliostat of a field by itself; answers in the order of the campaigns.
///
/// The same optimum as [`fit`](crate::fit()) finds with [`Loss::Squares`](crate::Loss::Squares) and components,
/// to 1e-9 rad, for a small part of the time: eight heliostats go through the formula side by side, with the
/// six by six normal equations solved there. Heliostats that this is not fit for (normal equations that are
/// nearly singular, beams that miss, no end in sight, or mounts with pose errors) go through [`fit`](crate::fit()) itself. The time is
/// linear in observations and heliostats. Neither threads nor instruction set nor a heliostat's neighbours
/// change a bit of its answer.
///
/// ```
/// use helio_calib::{Campaign, FieldFitOptions, Mount, Observation, fit_field};
/// use helio_core::{Enu, EnuUnit, Heliostat, TargetPlane, TrackingMode};
/// let centre = Enu::new(0.0, 0.0, 40.0);
/// let plane = TargetPlane::level(centre, EnuUnit::try_new(Enu::new(0.0, 1.0, 0.0))?);
/// let heliostat = Heliostat::new(Enu::new(20.0, 100.0, 2.0), centre);
/// let mount = Mount::of(TrackingMode::AzimuthElevation, &heliostat);
/// let sun = EnuUnit::from_azimuth_elevation(3.0, 0.7);
/// let observations = [Observation::new(sun, 3.1, 0.4, plane, 0.2, -0.1)];
/// let campaigns = [Campaign { mount, observations: &observations }];
/// let fits = fit_field(&campaigns, &FieldFitOptions::default());
/// assert!(fits[0].is_err()); // one observation cannot give six angles
/// # Ok::<(), helio_core::error::FrameError>(())
/// ```
///
/// # Errors
/// Of a heliostat: what [`fit`](crate::fit()) says of its observations; of all: what it says of the options.
#[must_use]
pub fn fit_field(
    campaigns: &[Campaign<'_>],
    options: &FieldFitOptions,
) -> Vec<Result<FieldFit, CalibrationError>> {
    let single = FitOptions {
        constraints: options.constraints,
        start: options.start,
        max_iterations: options.max_iterations,
        ..FitOptions::default()
    };
    let least = match least_observations(&single, options) {
        Ok(least) => least,
        Err(error) => return campaigns.iter().map(|_| Err(error.clone())).collect(),
    };
    let field = Field {
        campaigns,
        options,
        settings: settings(options),
        level: options.level.unwrap_or_else(SimdLevel::best),
        single,
        least,
    };
    // Alike lengths side by side.
    let mut order: Vec<usize> = (0..campaigns.len()).collect();
    order.sort_by_key(|&k| Reverse(campaigns[k].observations.len()));
    let groups: Vec<&[usize]> = order.chunks(BLOCK).collect();
    let available = if options.threads == 0 {
        rayon::current_num_threads()
    } else {
        options.threads
    };
    let pieces = available.clamp(1, groups.len().div_ceil(GROUPS_PER_THREAD).max(1));
    let next = AtomicUsize::new(0);
    let mut all: Vec<Vec<Numbered>> = (0..pieces).map(|_| Vec::new()).collect();
    match &mut all[..] {
        [only] => *only = field.work(&groups, &next),
        several => rayon::scope(|scope| {
            for one in several {
                scope.spawn(|_| *one = field.work(&groups, &next));
            }
        }),
    }
    let mut answers: Vec<Option<Answer>> = (0..campaigns.len()).map(|_| None).collect();
    for (k, answer) in all.into_iter().flatten() {
        answers[k] = Some(answer);
    }
    answers
        .into_iter()
        .enumerate()
        .map(|(k, answer)| answer.unwrap_or_else(|| field.alone(&campaigns[k])))
        .collect()
}

/// Groups that are worth a second thread.
const GROUPS_PER_THREAD: usize = 4;

/// From so many iterations on a heliostat lies in so flat a valley that there may be two optima in it: the
/// single fit, which begins from several places, is asked too.
const SLOW_ITERATIONS: usize = 11;

/// By how much of itself S must be lower to count as another optimum.
const LOWER_SHARE: f64 = 1e-9;

type Answer = Result<FieldFit, CalibrationError>;
type Numbered = (usize, Answer);

/// How many observations a fit needs.
fn least_observations(
    single: &FitOptions,
    options: &FieldFitOptions,
) -> Result<usize, CalibrationError> {
    let tolerance = options.tolerance_rad;
    if !(tolerance > 0.0 && tolerance.is_finite()) {
        return Err(CalibrationError::BadOption {
            what: "tolerance_rad",
            wanted: "finite and positive",
            value: tolerance,
        });
    }
    match check(&[], single) {
        Err(CalibrationError::TooFew { wanted, .. }) => Ok(wanted),
        Err(error) => Err(error),
        Ok(()) => Ok(1),
    }
}

/// A call.
struct Field<'a> {
    campaigns: &'a [Campaign<'a>],
    options: &'a FieldFitOptions,
    settings: Settings,
    level: SimdLevel,
    /// For those that go alone.
    single: FitOptions,
    least: usize,
}

impl Field<'_> {
    /// Takes groups from those that are left until there are none.
    fn work(&self, groups: &[&[usize]], next: &AtomicUsize) -> Vec<Numbered> {
        let mut group = Group::default();
        let mut answers = Answers::default();
        let mut found = Vec::new();
        while let Some(&members) = groups.get(next.fetch_add(1, Ordering::Relaxed)) {
            // Sorted by length: those too short are the last of all.
            let long = members
                .iter()
                .take_while(|&&k| self.campaigns[k].observations.len() >= self.least)
                .count();
            if let Some(&first) = members[..long].first() {
                // Lanes that are left over repeat the first.
                let chosen: [&Campaign<'_>; BLOCK] = core::array::from_fn(|lane| {
                    &self.campaigns[*members[..long].get(lane).unwrap_or(&first)]
                });
                let for_lanes = group.fill(&chosen);
                // Most likely this thread's next: on its way while the lanes are busy.
                if let Some(soon) = groups.get(next.load(Ordering::Relaxed)) {
                    ask_for_first(soon.iter().map(|&k| &self.campaigns[k]));
                }
                let job = Job {
                    group: &mut group,
                    settings: &self.settings,
                    answers: &mut answers,
                };
                run(self.level, job);
                for (lane, &k) in members[..long].iter().enumerate() {
                    // the lanes' formula knows no pose errors
                    let fit_for = for_lanes[lane] && chosen[lane].mount.pose_errors.is_none();
                    let lanes = fit_for.then(|| self.answer(&answers, lane, chosen[lane]));
                    let answer = match lanes.flatten() {
                        Some(fit) if fit.iterations < SLOW_ITERATIONS => Ok(fit),
                        Some(fit) => self.better(fit, chosen[lane]),
                        None => self.alone(chosen[lane]),
                    };
                    found.push((k, answer));
                }
            }
            for &k in &members[long..] {
                found.push((k, self.alone(&self.campaigns[k])));
            }
        }
        found
    }

    /// What a lane found, if it is to be trusted.
    fn answer(&self, answers: &Answers, lane: usize, campaign: &Campaign<'_>) -> Option<FieldFit> {
        let stop = match answers.code[lane] {
            code::SMALL_STEP => Stop::SmallStep,
            code::NO_DESCENT => Stop::NoDescent,
            _ => return None,
        };
        let parameters = canonical(core::array::from_fn(|k| answers.values[k][lane]))?;
        let count = campaign.observations.len();
        let sum_of_squares = answers.sum_of_squares[lane];
        let mut covariance = None;
        if self.options.with_covariance {
            let free = self.settings.free.iter().filter(|free| **free).count();
            // priors count at their own sigma, no freedom leaves none: not here
            let freedom = (2 * count).checked_sub(free).filter(|f| *f > 0)?;
            if self.settings.prior.iter().any(Option::is_some) {
                return None;
            }
            let variance = sum_of_squares / freedom as f64;
            let mut full = Box::new([[0.0; COUNT]; COUNT]);
            for i in 0..COUNT {
                for j in 0..=i {
                    if self.settings.free[i] && self.settings.free[j] {
                        let value = variance * answers.covariance[i][j][lane];
                        full[i][j] = value;
                        full[j][i] = value;
                    }
                }
            }
            covariance = Some(full);
        }
        Some(FieldFit {
            parameters,
            stop,
            iterations: answers.iterations[lane] as usize,
            sum_of_squares,
            rms_m: libm::sqrt(answers.square_m2[lane] / count as f64),
            covariance,
            observations: count,
        })
    }

    /// The lower of two optima.
    #[cold]
    fn better(&self, found: FieldFit, campaign: &Campaign<'_>) -> Answer {
        let other = self.alone(campaign)?;
        let lower = other.stop.converged()
            && other.sum_of_squares < found.sum_of_squares * (1.0 - LOWER_SHARE);
        Ok(if lower { other } else { found })
    }

    /// The single fit.
    #[cold]
    fn alone(&self, campaign: &Campaign<'_>) -> Answer {
        let Campaign {
            mount,
            observations,
        } = campaign;
        let found = fit(mount, observations, &self.single)?;
        let covariance = if self.options.with_covariance {
            let uncertainty = uncertainty(mount, observations, &found, &self.single)?;
            Some(Box::new(uncertainty.covariance))
        } else {
            None
        };
        Ok(FieldFit {
            parameters: found.parameters,
            stop: found.stop,
            iterations: found.iterations,
            sum_of_squares: found.sum_of_squares,
            rms_m: found.rms_m,
            covariance,
            observations: observations.len(),
        })
    }
}

/// The canonical form of parameters that need only their references wrapped for it.
fn canonical(mut values: [f64; COUNT]) -> Option<Parameters> {
    let [tilt1, tilt2, .., mirror_tilt, _] = values;
    let nonorthogonality = values[Parameter::AxisNonorthogonality as usize];
    let small = tilt1 * tilt1 + tilt2 * tilt2 < 9.0
        && nonorthogonality.abs() < FRAC_PI_2
        && mirror_tilt.abs() < FRAC_PI_2;
    for reference in [Parameter::AzimuthReference, Parameter::ElevationReference] {
        let value = &mut values[reference as usize];
        *value = wrap_pi(*value);
    }
    small.then_some(Parameters { values })
}

fn settings(options: &FieldFitOptions) -> Settings {
    let (start, offset_of_mount) = match options.start {
        Start::At(parameters) => (parameters.values, false),
        Start::Cold | Start::Zeros => ([0.0; COUNT], true),
    };
    Settings {
        free: options.constraints.map(|c| c != Constraint::Held),
        prior: options.constraints.map(|c| match c {
            Constraint::Prior { mean, sigma } => Some([1.0 / (sigma * sigma), mean]),
            Constraint::Free | Constraint::Held => None,
        }),
        start,
        cold: options.start == Start::Cold,
        offset_of_mount,
        max_iterations: options.max_iterations,
        tolerance: options.tolerance_rad,
        covariance: options.with_covariance,
    }
}
