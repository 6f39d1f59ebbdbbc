//! Where a fit begins: anywhere.
//!
//! A beam that misses has no spot, so the sum of squares of spots is of no use far from the truth. The
//! mirror's normal is: each observation says which normal would send the beam to the measured spot, and
//! parameters that give all these normals are close to the optimum. With every other error at its start,
//! the sum over the observations of n·n_wanted is bilinear in (1, cos gamma0, sin gamma0) and
//! (1, cos alpha0, sin alpha0). Nine evaluations give it everywhere; the best alpha0 for a gamma0 is then a
//! closed form, and a scan of gamma0 round the circle finds every place worth descending from.

use core::f64::consts::{PI, TAU};

use helio_core::angle::wrap_pi;

use crate::fit::{Constraint, FitOptions, Loss, Solver, Start};
use crate::loss::robust_scale;
use crate::measures::dot;
use crate::model::{Pose, normal};
use crate::observation::{Mount, Sighting};
use crate::parameters::{COUNT, Parameter, Parameters};
use crate::residual::Normals;
use crate::solver::{LeastSquares, Limits, Outcome, minimise};

/// Places of gamma0 that are looked at. The profile has two maxima at most where C is small, each half a
/// turn wide.
const SCAN: usize = 72;
/// Descents on normals end with a step as short as this: every beam then lands, and spots lead on as fast.
const NEAR_RAD: f64 = 1e-3;
/// A further place is descended from where its sum of squares is within this factor of the best place's: what
/// is looked for lies a few degrees from its place, so that one ten times as far off is none.
const WORTH: f64 = 100.0;
/// And within this factor of what a descent has reached: where normals already agree to a hundredth of what the
/// further place is off by, there is no need.
const SETTLED: f64 = 1e4;
/// A twin is looked for where it is within this many standard errors: in a double well V = b (1 - x²)² it is
/// 4 sqrt(b) of them away, and a pass of b = 16 variances is no low one.
const TWIN_SIGMAS: f64 = 16.0;
/// And descended from where S has risen there by less than this share of what it would have in a single well.
const TWIN: f64 = 0.5;
/// Two places that come as near as this in every parameter lead to one optimum.
const SAME_RAD: f64 = 2e-2;
/// Most iterations of one descent on normals.
const NEAR_ITERATIONS: usize = 30;
/// Rounds of reweighting of the descent on normals.
const ROBUST_ROUNDS: usize = 8;

const GAMMA0: usize = Parameter::AzimuthReference as usize;
const ALPHA0: usize = Parameter::ElevationReference as usize;

/// The values that a fit is asked to begin at.
pub(crate) fn first(mount: &Mount, options: &FitOptions) -> [f64; COUNT] {
    let mut values = [0.0; COUNT];
    values[Parameter::MirrorOffset as usize] = mount.mirror_offset_m;
    match options.start {
        Start::At(parameters) => parameters.values,
        Start::Zeros => values,
        Start::Cold => {
            for (value, constraint) in values.iter_mut().zip(&options.constraints) {
                if let Constraint::Prior { mean, .. } = constraint {
                    *value = *mean;
                }
            }
            values
        }
    }
}

/// Brings the places that are worth it near to the observations by their normals; best first.
pub(crate) fn approach(
    sightings: &[Sighting<f64>],
    options: &FitOptions,
    places: &[[f64; COUNT]],
) -> Vec<Outcome> {
    let Some(offset) = places.first().map(|p| p[Parameter::MirrorOffset as usize]) else {
        return Vec::new();
    };
    // normals know nothing of the mirror offset
    let mut constraints = options.constraints;
    constraints[Parameter::MirrorOffset as usize] = Constraint::Held;
    let mut problem = Normals::new(sightings, &constraints, offset);
    let plain = problem.factors.clone();
    let mut system = problem.system();
    let limits = Limits {
        max_iterations: NEAR_ITERATIONS,
        min_step: NEAR_RAD,
        min_gradient: 1e-9,
    };
    let mut ranked: Vec<_> = places.iter().map(|p| (problem.sum(p), p)).collect();
    ranked.sort_by(|a, b| a.0.total_cmp(&b.0));
    let worth = ranked.first().map_or(0.0, |best| WORTH * best.0);
    let mut found: Vec<Outcome> = Vec::with_capacity(places.len());
    for (sum, place) in ranked {
        let reached = found.iter().map(|f| f.sum).fold(f64::INFINITY, f64::min);
        if sum > worth || sum > SETTLED * reached {
            break;
        }
        problem.factors.clone_from(&plain);
        let mut near = minimise(&problem, Solver::HartleyMeyer, place, &mut system, limits);
        if options.loss != Loss::Squares {
            let free = system.columns.len();
            for _ in 0..ROBUST_ROUNDS {
                let lengths = problem.lengths(&near.values);
                let scale = robust_scale(&lengths, free);
                if scale <= 0.0 {
                    break;
                }
                for ((factor, plain), length) in
                    problem.factors.iter_mut().zip(&plain).zip(&lengths)
                {
                    *factor = plain * libm::sqrt(Loss::Cauchy.weight(length / scale));
                }
                let next = minimise(
                    &problem,
                    Solver::HartleyMeyer,
                    &near.values,
                    &mut system,
                    Limits {
                        max_iterations: 1,
                        ..limits
                    },
                );
                near = Outcome {
                    iterations: near.iterations + next.iterations,
                    ..next
                };
            }
        }
        found.push(near);
    }
    found.sort_by(|a, b| a.sum.total_cmp(&b.sum));
    found
}

/// The other of two optima that differ in the sign of d2 = (sin(mu) - sin(tau1) c3)/cos(tau1), brought near; only
/// where `standard_errors` say that the mirror tilt is little known.
///
/// The normal depends on d2 in two ways (Guo 2015 eq. 23-25): as a turn about the fixed axis by about
/// d2/cos(alpha), and through the root of 1 - d2², to second order. Where alpha hardly varies the azimuth
/// reference makes up for the turn, and d2 and -d2 are two minima with a low pass between them. So the mirror
/// tilt (the non-orthogonality where that is held) is turned round and kept while all else comes near.
pub(crate) fn twin(
    sightings: &[Sighting<f64>],
    options: &FitOptions,
    values: &[f64; COUNT],
    standard_errors: &[f64; COUNT],
    scale: f64,
) -> Option<Outcome> {
    let turned = [Parameter::MirrorTilt, Parameter::AxisNonorthogonality]
        .map(|parameter| parameter as usize)
        .into_iter()
        .find(|&k| options.constraints[k] != Constraint::Held)?;
    let sigmas = 2.0 * values[turned].abs() / standard_errors[turned];
    if sigmas > TWIN_SIGMAS {
        return None;
    }
    let mut other = *values;
    other[turned] = -other[turned];
    let mut kept = *options;
    kept.constraints[turned] = Constraint::Held;
    kept.free().next()?;
    let found = approach(sightings, &kept, &[other]).into_iter().next()?;
    let offset = values[Parameter::MirrorOffset as usize];
    let problem = Normals::new(sightings, &options.constraints, offset);
    let rise = problem.sum(&found.values) - problem.sum(values);
    (rise < TWIN * sigmas * sigmas * scale * scale).then_some(found)
}

/// True if two places are one mount within a degree.
pub(crate) fn same(a: &[f64; COUNT], b: &[f64; COUNT]) -> bool {
    let [a, b] = [a, b].map(|values| Parameters { values: *values }.canonical().values);
    (0..COUNT).all(|k| wrap_pi(a[k] - b[k]).abs() < SAME_RAD)
}

/// Every pair of references worth descending from, with all else as in `values`.
pub(crate) fn scan(
    sightings: &[Sighting<f64>],
    constraints: &[Constraint; COUNT],
    values: &[f64; COUNT],
) -> Vec<[f64; COUNT]> {
    let held = |k: usize| constraints[k] == Constraint::Held;
    if held(GAMMA0) && held(ALPHA0) {
        return vec![*values];
    }
    let by = bilinear(sightings, constraints, values);
    let with = |gamma0: f64| {
        let (sine, cosine) = libm::sincos(gamma0);
        let [constant, cos_part, sin_part]: [f64; 3] =
            core::array::from_fn(|k| by[0][k] + cosine * by[1][k] + sine * by[2][k]);
        let alpha0 = if held(ALPHA0) {
            values[ALPHA0]
        } else {
            libm::atan2(sin_part, cos_part)
        };
        let (sine, cosine) = libm::sincos(alpha0);
        (constant + cosine * cos_part + sine * sin_part, alpha0)
    };
    let place = |gamma0: f64| {
        let mut place = *values;
        place[GAMMA0] = near(&constraints[GAMMA0], gamma0);
        place[ALPHA0] = near(&constraints[ALPHA0], with(gamma0).1);
        place
    };
    if held(GAMMA0) {
        let mut place = place(values[GAMMA0]);
        place[GAMMA0] = values[GAMMA0];
        return vec![place];
    }
    let angles: [f64; SCAN] = core::array::from_fn(|i| TAU * i as f64 / SCAN as f64 - PI);
    let agreement = angles.map(|gamma0| with(gamma0).0);
    let mut places = Vec::new();
    for i in 0..SCAN {
        let before = agreement[(i + SCAN - 1) % SCAN];
        let after = agreement[(i + 1) % SCAN];
        if agreement[i] > before && agreement[i] >= after {
            let mut place = place(angles[i]);
            if held(ALPHA0) {
                place[ALPHA0] = values[ALPHA0];
            }
            places.push(place);
        }
    }
    if places.is_empty() {
        places.push(*values); // every reference is as good
    }
    places
}

/// The representative of an angle that is nearest to its prior.
fn near(constraint: &Constraint, angle: f64) -> f64 {
    match constraint {
        Constraint::Prior { mean, .. } => angle + TAU * libm::round((mean - angle) / TAU),
        _ => angle,
    }
}

/// Coefficients of the sum of n·n_wanted in (1, cos, sin) of gamma0 and (1, cos, sin) of alpha0, from its
/// values at three by three angles.
fn bilinear(
    sightings: &[Sighting<f64>],
    constraints: &[Constraint; COUNT],
    values: &[f64; COUNT],
) -> [[f64; 3]; 3] {
    let offset = values[Parameter::MirrorOffset as usize];
    let problem = Normals::new(sightings, constraints, offset);
    let nodes: [f64; 3] = core::array::from_fn(|i| TAU * i as f64 / 3.0);
    let transform = |f: [f64; 3]| {
        let mut sums = [0.0; 3];
        for (value, node) in f.iter().zip(nodes) {
            let (sine, cosine) = libm::sincos(node);
            sums[0] += value / 3.0;
            sums[1] += 2.0 / 3.0 * value * cosine;
            sums[2] += 2.0 / 3.0 * value * sine;
        }
        sums
    };
    let by_alpha: [[f64; 3]; 3] = nodes.map(|gamma0| {
        transform(nodes.map(|alpha0| {
            let mut at = *values;
            at[GAMMA0] = gamma0;
            at[ALPHA0] = alpha0;
            let pose = Pose::new(at);
            let mut sum = 0.0;
            for (sighting, (wanted, factor)) in sightings
                .iter()
                .zip(problem.wanted.iter().zip(&problem.factors))
            {
                sum += factor * factor * dot(normal(&pose, sighting).n, *wanted);
            }
            sum
        }))
    });
    let columns: [[f64; 3]; 3] =
        core::array::from_fn(|k| transform([by_alpha[0][k], by_alpha[1][k], by_alpha[2][k]]));
    core::array::from_fn(|g| core::array::from_fn(|a| columns[a][g]))
}
