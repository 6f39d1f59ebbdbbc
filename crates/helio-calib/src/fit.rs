//! What a fit is asked and what it answers.

use helio_core::Enu;

use crate::covariance;
use crate::error::CalibrationError;
use crate::loss::robust_scale;
use crate::measures::measures;
use crate::model::{Pose, landing};
use crate::observation::{Mount, Observation, Sighting};
use crate::parameters::{COUNT, Parameter, Parameters};
use crate::residual::{Spots, columns, priors};
use crate::solver::{LeastSquares, Limits, Outcome, System, minimise};
use crate::start;

/// The two least-squares solvers of Guo 2015 §4.4.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Solver {
    /// Gauss-Newton whose step is halved until the sum of squares falls enough.
    #[default]
    HartleyMeyer,
    /// Gauss-Newton whose step length is found by golden section.
    GaussNewton,
}

/// What is made small.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum ResidualForm {
    /// Both components of predicted less observed spot.
    #[default]
    Components,
    /// Their distance, Guo 2015 eq. (38): the same minimum, found more slowly.
    Distance,
    /// Both components across the beam that led to the observed spot: with sigmas in proportion to the
    /// slant, what is made small is `beam_rms_mrad` itself, also where a target is met obliquely.
    Beam,
}

impl ResidualForm {
    /// The form with two rows an observation that has the same minimum.
    pub(crate) fn of_components(self) -> Self {
        match self {
            Self::Beam => Self::Beam,
            Self::Components | Self::Distance => Self::Components,
        }
    }
}

/// How much a large residual counts.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
#[non_exhaustive]
pub enum Loss {
    /// Its square.
    #[default]
    Squares,
    /// Its square up to 1.345 scales, then linearly.
    Huber,
    /// As if errors had Student's distribution with these degrees of freedom.
    StudentT {
        /// Degrees of freedom, positive; 1 is [`Loss::Cauchy`].
        degrees: f64,
    },
    /// log(1 + (r/scale)²).
    Cauchy,
}

/// What is asked of one parameter.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Constraint {
    /// Found from the observations.
    Free,
    /// Kept at its start.
    Held,
    /// Found from the observations and what was known before.
    Prior {
        /// Expected value, in the parameter's unit.
        mean: f64,
        /// Its standard deviation, in the parameter's unit.
        sigma: f64,
    },
}

/// Where a fit begins.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub enum Start {
    /// From anywhere: all errors zero, with a scan of the first axis' reference where zero does not lead to the optimum.
    #[default]
    Cold,
    /// All errors zero and nothing else, as Guo 2015 does.
    Zeros,
    /// From these.
    At(Parameters),
}

/// How to fit one heliostat.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FitOptions {
    /// Which solver.
    pub solver: Solver,
    /// Which residual.
    pub residual: ResidualForm,
    /// How large residuals count.
    pub loss: Loss,
    /// What is asked of each parameter, in the order of [`Parameter::ALL`].
    pub constraints: [Constraint; COUNT],
    /// Where to begin.
    pub start: Start,
    /// Most iterations.
    pub max_iterations: usize,
    /// eps1: a step shorter than this ends the fit \[rad\].
    pub min_step_rad: f64,
    /// eps2: a gradient smaller than this, relative to its scale, ends the fit.
    pub min_gradient: f64,
}

impl Default for FitOptions {
    /// Six angles free, the mirror offset held, Hartley-Meyer with components from a cold start.
    fn default() -> Self {
        let mut constraints = [Constraint::Free; COUNT];
        constraints[Parameter::MirrorOffset as usize] = Constraint::Held;
        Self {
            solver: Solver::default(),
            residual: ResidualForm::default(),
            loss: Loss::default(),
            constraints,
            start: Start::default(),
            max_iterations: 100,
            min_step_rad: 1e-13,
            min_gradient: 1e-14,
        }
    }
}

impl FitOptions {
    /// Parameters that are not held.
    pub fn free(&self) -> impl Iterator<Item = Parameter> + '_ {
        Parameter::ALL
            .into_iter()
            .filter(|&p| self.constraints[p as usize] != Constraint::Held)
    }
}

/// Why a fit ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum Stop {
    /// The step became shorter than asked: converged.
    SmallStep,
    /// The gradient became smaller than asked: converged.
    SmallGradient,
    /// No shorter step lowers the sum of squares by more than rounding: converged as far as doubles go.
    NoDescent,
    /// No part of the step lowers the sum of squares though its slope says that it should: a beam misses just
    /// beside, or distances are at their kink. Not converged.
    Stuck,
    /// The greatest number of iterations was reached.
    MaxIterations,
    /// From no start does every beam reach its target.
    NoLanding,
}

impl Stop {
    /// True if the optimum was reached.
    #[must_use]
    pub const fn converged(self) -> bool {
        matches!(
            self,
            Self::SmallStep | Self::SmallGradient | Self::NoDescent
        )
    }

    /// The word for columns.
    #[must_use]
    pub const fn as_str(self) -> &'static str {
        match self {
            Self::SmallStep => "small_step",
            Self::SmallGradient => "small_gradient",
            Self::NoDescent => "no_descent",
            Self::Stuck => "stuck",
            Self::MaxIterations => "max_iterations",
            Self::NoLanding => "no_landing",
        }
    }
}

/// The answer of a fit.
#[derive(Debug, Clone, PartialEq)]
pub struct Fit {
    /// The optimum, in canonical form.
    pub parameters: Parameters,
    /// Why it ended.
    pub stop: Stop,
    /// Iterations of the solver, all starts together.
    pub iterations: usize,
    /// S: sum of squares of all residuals divided by their sigma, priors included; in m² where no sigma is
    /// stated. With a robust loss, of the weighted residuals.
    pub sum_of_squares: f64,
    /// Predicted less observed spot of each observation, right and down \[m\]; NaN where the beam misses.
    pub residuals_m: Vec<[f64; 2]>,
    /// Weight that the loss gave each observation, 0 to 1; 1 for [`Loss::Squares`].
    pub weights: Vec<f64>,
    /// Estimated scale of the residuals over their sigma (metres where none is stated).
    pub scale: f64,
    /// sqrt(mean of du² + dv²) \[m\].
    pub rms_m: f64,
    /// RMS of each distance over pivot-to-target-centre distance, as GRLM (1) \[mrad\].
    pub rms_mrad: f64,
    /// RMS angle, seen from the mirror centre, between predicted beam and measured spot \[mrad\].
    pub beam_rms_mrad: f64,
}

/// A reweighted fit ends with a step as short as this \[rad\]: weights settle slowly, and no observation knows
/// an angle to this.
const REWEIGHTED_STEP_RAD: f64 = 1e-10;
/// Rounds of reweighting in which the scale is estimated anew; it is then kept, so that they settle.
const SCALE_ROUNDS: usize = 20;
/// A second start is tried where its normals fit within this factor of the first one's sum of squares.
const RIVAL: f64 = 9.0;

/// Fits one heliostat.
///
/// Guo 2015 §4.3-4.4: the sum of squares S of predicted less observed spots, each over its sigma where one is
/// stated, is made least over the parameters that are not held. The tilt is solved in its two components, where
/// the Jacobian is regular at zero; the step comes from column-pivoted QR, or from the singular values where
/// J has not full rank (the shortest step is then taken). Where less than a fifth of a step can be gone, one
/// without the badly determined combinations is tried beside it.
///
/// [`Start::Cold`] finds the optimum from nothing, whatever the encoder references; where elevations vary so
/// little that opposite mirror tilts fit alike, both are tried and the better one is taken. With [`Start::Zeros`] and
/// [`Start::At`] the fit begins where it is told if every beam reaches its target from there; if not, it is
/// first brought near by the normals the spots ask for, but no other reference is tried.
///
/// A robust loss is found by reweighting, with the scale estimated from the median distance; observations
/// whose predicted beam misses then have weight 0. With plain squares such an observation ends the fit with
/// [`Stop::NoLanding`] where no start avoids it.
///
/// Priors count beside the observations at their sigmas: state `sigma_m`, or all observations count as known to
/// 1 m.
///
/// # Errors
/// A number of an observation that is not finite or out of range, a sigma stated for some observations only, too few observations for the parameters
/// asked for, options or priors that make no sense.
pub fn fit(
    mount: &Mount,
    observations: &[Observation],
    options: &FitOptions,
) -> Result<Fit, CalibrationError> {
    check(observations, options)?;
    let sightings: Vec<_> = observations
        .iter()
        .map(|observation| Sighting::new(mount, observation))
        .collect();
    let mut problem = Spots {
        factors: sightings.iter().map(|s| s.weight).collect(),
        sightings: &sightings,
        form: options.residual,
        constraints: &options.constraints,
    };
    let mut system = problem.system();
    let first = start::first(mount, options);
    let direct = options.start != Start::Cold && all_hit(&sightings, &first);
    let mut near = Vec::new();
    let begin = if direct {
        first
    } else {
        let places = match options.start {
            Start::Cold => start::scan(&sightings, &options.constraints, &first),
            Start::Zeros | Start::At(_) => vec![first],
        };
        near = start::approach(&sightings, options, &places);
        near.first().map_or(first, |place| place.values)
    };
    let mut iterations: usize = near.iter().map(|place| place.iterations).sum();
    let mut best = descend(&mut problem, &mut system, &begin, options);
    iterations += best.outcome.iterations;
    let mut attempt = |best: &mut Descent, place: &[f64; COUNT]| {
        let found = descend(&mut problem, &mut system, place, options);
        iterations += found.outcome.iterations;
        if found.merit() < best.merit() {
            *best = found;
        }
    };
    for (i, place) in near.iter().enumerate().skip(1) {
        let rival = place.sum <= RIVAL * near[0].sum || !best.outcome.sum.is_finite();
        let known = |n: &Outcome| start::same(&n.values, &place.values);
        if rival && !near[..i].iter().any(known) {
            attempt(&mut best, &place.values);
        }
    }
    if options.start == Start::Cold && best.outcome.stop.converged() {
        let errors = standard_errors(&sightings, options, &best);
        let twin = start::twin(
            &sightings,
            options,
            &best.outcome.values,
            &errors,
            best.scale,
        );
        if let Some(twin) = twin {
            attempt(&mut best, &twin.values);
            iterations += twin.iterations;
        }
    }
    Ok(answer(
        mount,
        observations,
        &sightings,
        options,
        &best,
        iterations,
    ))
}

/// Refuses what no fit can be made of.
pub(crate) fn check(
    observations: &[Observation],
    options: &FitOptions,
) -> Result<(), CalibrationError> {
    for (row, observation) in observations.iter().enumerate() {
        check_observation(row, observation)?;
    }
    all_or_none_stated(observations.iter().enumerate())?;
    for parameter in Parameter::ALL {
        if let Constraint::Prior { mean, sigma } = options.constraints[parameter as usize]
            && !(mean.is_finite() && sigma.is_finite() && sigma > 0.0)
        {
            return Err(CalibrationError::BadPrior {
                parameter,
                mean,
                sigma,
            });
        }
    }
    let option = |what, wanted, value, good: bool| {
        if good {
            Ok(())
        } else {
            Err(CalibrationError::BadOption {
                what,
                wanted,
                value,
            })
        }
    };
    let step = options.min_step_rad;
    option("min_step_rad", "zero or more", step, step >= 0.0)?;
    let gradient = options.min_gradient;
    option("min_gradient", "zero or more", gradient, gradient >= 0.0)?;
    let most = options.max_iterations;
    option("max_iterations", "at least 1", most as f64, most >= 1)?;
    if let Loss::StudentT { degrees } = options.loss {
        let good = degrees > 0.0 && degrees.is_finite();
        option("degrees of freedom", "finite and positive", degrees, good)?;
    }
    if let Start::At(parameters) = options.start {
        for value in parameters.values {
            option(
                "start",
                "finite in every parameter",
                value,
                value.is_finite(),
            )?;
        }
    }
    let parameters = columns(&options.constraints).len();
    if parameters == 0 {
        return Err(CalibrationError::NothingFree);
    }
    let each = match options.residual {
        ResidualForm::Components | ResidualForm::Beam => 2,
        ResidualForm::Distance => 1,
    };
    let wanted = (parameters - priors(&options.constraints))
        .div_ceil(each)
        .max(1);
    if observations.len() < wanted {
        return Err(CalibrationError::TooFew {
            found: observations.len(),
            wanted,
            parameters,
        });
    }
    Ok(())
}

/// Refuses observations of which some state a sigma: the others would count as known to 1 m.
pub(crate) fn all_or_none_stated<'a>(
    observations: impl Iterator<Item = (usize, &'a Observation)> + Clone,
) -> Result<(), CalibrationError> {
    let mut without = observations.clone().filter(|(_, o)| o.sigma_m.is_none());
    let mut with = observations.filter(|(_, o)| o.sigma_m.is_some());
    match (without.next(), with.next()) {
        (Some((row, _)), Some((stated, _))) => Err(CalibrationError::SigmaMissing { row, stated }),
        _ => Ok(()),
    }
}

fn check_observation(row: usize, observation: &Observation) -> Result<(), CalibrationError> {
    let numbers = [
        ("axis1_rad", observation.axis1_rad),
        ("axis2_rad", observation.axis2_rad),
        ("u_m", observation.u_m),
        ("v_m", observation.v_m),
    ];
    let bad = |what, wanted, value| CalibrationError::BadValue {
        row,
        what,
        wanted,
        value,
    };
    for (what, value) in numbers {
        if !value.is_finite() {
            return Err(bad(what, "finite", value));
        }
    }
    if let Some(sigma) = observation.sigma_m
        && !(sigma.is_finite() && sigma > 0.0)
    {
        return Err(bad("sigma_m", "finite and positive", sigma));
    }
    let plane = &observation.plane;
    let vectors: [(&'static str, Enu); 5] = [
        ("sun", observation.sun.as_enu()),
        ("target centre", plane.centre),
        ("target normal", plane.normal.as_enu()),
        ("target right", plane.right.as_enu()),
        ("target down", plane.down.as_enu()),
    ];
    for (what, vector) in vectors {
        for value in [vector.east, vector.north, vector.up] {
            if !value.is_finite() {
                return Err(bad(what, "finite", value));
            }
        }
    }
    Ok(())
}

fn all_hit(sightings: &[Sighting<f64>], values: &[f64; COUNT]) -> bool {
    let pose = Pose::new(*values);
    sightings.iter().all(|s| landing(&pose, s).hits())
}

/// Standard errors at an optimum, for plain use: sqrt(diagonal of (JᵀJ)⁻¹) times the scale.
fn standard_errors(
    sightings: &[Sighting<f64>],
    options: &FitOptions,
    found: &Descent,
) -> [f64; COUNT] {
    let roots = found.weights.iter().map(|w| libm::sqrt(*w));
    let problem = Spots {
        sightings,
        factors: sightings
            .iter()
            .zip(roots)
            .map(|(s, w)| s.weight * w)
            .collect(),
        form: options.residual.of_components(),
        constraints: &options.constraints,
    };
    let mut system = problem.system();
    problem.linearise(&found.outcome.values, &mut system);
    let covariance = covariance::of(&system, 2 * sightings.len(), found.scale);
    core::array::from_fn(|k| libm::sqrt(covariance[k][k]))
}

/// Where a descent on spots ended.
struct Descent {
    outcome: Outcome,
    weights: Vec<f64>,
    scale: f64,
}

impl Descent {
    /// What the better of two places has less of. Sums with different robust weights cannot be compared.
    fn merit(&self) -> f64 {
        if self.outcome.sum.is_finite() {
            self.scale
        } else {
            f64::INFINITY
        }
    }
}

/// From a place to the optimum next to it.
fn descend(
    problem: &mut Spots<'_>,
    system: &mut System,
    place: &[f64; COUNT],
    options: &FitOptions,
) -> Descent {
    let count = problem.sightings.len();
    if options.loss == Loss::Squares {
        let outcome = minimise(
            &*problem,
            options.solver,
            place,
            system,
            Limits::from(options),
        );
        let rows = 2 * count + priors(&options.constraints);
        let left = rows.saturating_sub(system.columns.len()).max(1);
        return Descent {
            scale: libm::sqrt(outcome.sum / left as f64),
            weights: vec![1.0; count],
            outcome,
        };
    }
    let one = Limits {
        max_iterations: 1,
        ..Limits::from(options)
    };
    let free = system.columns.len();
    let mut found = Descent {
        outcome: Outcome {
            values: *place,
            sum: f64::INFINITY,
            iterations: 0,
            stop: Stop::MaxIterations,
        },
        weights: vec![0.0; count],
        scale: 0.0,
    };
    for round in 0..options.max_iterations {
        let distances = scaled_distances(problem.sightings, &found.outcome.values);
        let landed = distances.iter().filter(|d| !d.is_nan()).count();
        if 2 * landed + priors(&options.constraints) < free {
            found.outcome.stop = Stop::NoLanding;
            found.outcome.sum = f64::INFINITY;
            break;
        }
        if round < SCALE_ROUNDS {
            found.scale = robust_scale(&distances, free);
        }
        for (i, distance) in distances.iter().enumerate() {
            found.weights[i] = if distance.is_nan() {
                0.0
            } else if found.scale > 0.0 {
                options.loss.weight(distance / found.scale)
            } else {
                1.0
            };
            problem.factors[i] = problem.sightings[i].weight * libm::sqrt(found.weights[i]);
        }
        let next = minimise(
            &*problem,
            options.solver,
            &found.outcome.values,
            system,
            one,
        );
        let moved = (0..COUNT)
            .map(|k| (next.values[k] - found.outcome.values[k]).abs())
            .fold(0.0, f64::max);
        found.outcome.iterations += next.iterations;
        found.outcome.values = next.values;
        found.outcome.sum = next.sum;
        if next.stop != Stop::MaxIterations {
            found.outcome.stop = next.stop;
            break;
        }
        if moved < REWEIGHTED_STEP_RAD {
            found.outcome.stop = Stop::SmallStep;
            break;
        }
    }
    found
}

/// Distance of each predicted spot from the observed one, over its sigma; NaN on a miss.
fn scaled_distances(sightings: &[Sighting<f64>], values: &[f64; COUNT]) -> Vec<f64> {
    let pose = Pose::new(*values);
    sightings
        .iter()
        .map(|sighting| {
            let land = landing(&pose, sighting);
            if land.hits() {
                let [du, dv] = land.residual_m;
                sighting.weight * libm::hypot(du, dv)
            } else {
                f64::NAN
            }
        })
        .collect()
}

/// The canonical form of what was found, with everything that is reported.
fn answer(
    mount: &Mount,
    observations: &[Observation],
    sightings: &[Sighting<f64>],
    options: &FitOptions,
    found: &Descent,
    iterations: usize,
) -> Fit {
    let raw = Parameters {
        values: found.outcome.values,
    };
    let parameters = canonical(raw, &options.constraints);
    let (residuals_m, measures) = measures(mount, observations, &parameters);
    let mut sum_of_squares = found.outcome.sum;
    if sum_of_squares.is_finite() {
        // of the canonical parameters, to the bit; the priors know only the raw ones
        let mut spots = 0.0;
        for ((residual, weight), sighting) in residuals_m.iter().zip(&found.weights).zip(sightings)
        {
            if *weight > 0.0 {
                let [du, dv] = residual;
                spots += weight * sighting.weight * sighting.weight * (du * du + dv * dv);
            }
        }
        let priors = crate::residual::prior_sum(&options.constraints, &raw.values);
        if spots.is_finite() {
            sum_of_squares = spots + priors;
        }
    }
    Fit {
        parameters,
        stop: found.outcome.stop,
        iterations,
        sum_of_squares,
        residuals_m,
        weights: found.weights.clone(),
        scale: found.scale,
        rms_m: measures.rms_m,
        rms_mrad: measures.rms_mrad,
        beam_rms_mrad: measures.beam_rms_mrad,
    }
}

/// The canonical form, with held parameters to the bit where it keeps them.
fn canonical(raw: Parameters, constraints: &[Constraint; COUNT]) -> Parameters {
    let mut parameters = raw.canonical();
    let pairs = parameters.values.iter_mut().zip(raw.values);
    for ((value, raw_value), constraint) in pairs.zip(constraints) {
        if (*value - raw_value).abs() < 1e-12 {
            *value = raw_value; // no change but rounding
        } else if *constraint != Constraint::Free {
            return raw; // another name for the same mount would not be what was held or known before
        }
    }
    parameters
}
