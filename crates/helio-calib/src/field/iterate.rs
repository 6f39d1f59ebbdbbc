//! Gauss-Newton with halved steps (Hartley-Meyer) for eight heliostats at once.

use helio_core::lanes::{BLOCK, Kernel, Lanes, Mask, math};

use super::formula::{Chunk, Sums, circular_sums, ending, lands, sums};
use super::group::Group;
use super::lane::{Eight, Lane, any};
use super::solve::Factor;
use super::start::references;
use crate::model::Real;
use crate::parameters::{COUNT, Parameter};

/// What is asked of every heliostat of a field.
#[derive(Debug, Clone)]
pub(super) struct Settings {
    pub free: [bool; COUNT],
    /// 1/sigma² and mean of what was known before.
    pub prior: [Option<[f64; 2]>; COUNT],
    /// Where to begin; the references are looked for if they are free and the start is cold.
    pub start: [f64; COUNT],
    pub cold: bool,
    /// The mirror offset begins at the mount's.
    pub offset_of_mount: bool,
    pub max_iterations: usize,
    pub tolerance: f64,
    pub covariance: bool,
}

/// How it ended in a lane.
pub(super) mod code {
    pub const SMALL_STEP: f64 = 1.0;
    pub const NO_DESCENT: f64 = 2.0;
    pub const MAX_ITERATIONS: f64 = 3.0;
    /// A beam misses at the end.
    pub const MISS: f64 = 4.0;
    /// A pivot that is not safe, or numbers that are none.
    pub const UNSAFE: f64 = 5.0;
}

/// The answers of eight lanes.
#[derive(Debug, Clone, Default)]
pub(super) struct Answers {
    pub values: [Eight; COUNT],
    pub code: Eight,
    pub iterations: Eight,
    pub sum_of_squares: Eight,
    pub square_m2: Eight,
    /// Lower triangle, for errors of size one.
    pub covariance: [[Eight; COUNT]; COUNT],
}

/// Eight fits.
pub(super) struct Job<'a> {
    pub group: &'a mut Group,
    pub settings: &'a Settings,
    pub answers: &'a mut Answers,
}

impl Kernel for Job<'_> {
    type Output = ();

    #[inline(always)]
    fn run<L: Lanes>(self) {
        let mut lane = 0;
        while lane < BLOCK {
            if self.settings.free[Parameter::MirrorOffset as usize] {
                fit::<L, 7>(self.group, self.settings, lane, self.answers);
            } else {
                fit::<L, 6>(self.group, self.settings, lane, self.answers);
            }
            lane += L::WIDTH;
        }
    }
}

#[inline(always)]
fn begin<L: Lanes>(group: &Group, settings: &Settings, lane: usize) -> [Lane<L>; COUNT] {
    let mut x = [Lane::<L>::splat(0.0); COUNT];
    for (x, start) in x.iter_mut().zip(&settings.start) {
        *x = Lane::splat(*start);
    }
    if settings.offset_of_mount {
        x[Parameter::MirrorOffset as usize] = Lane::read(&group.offset_m, lane);
    }
    if settings.cold {
        let sums = circular_sums(&group.rows, &group.segments, lane);
        let places = [
            Parameter::AzimuthReference as usize,
            Parameter::ElevationReference as usize,
        ];
        let mut held = [None; 2];
        for (held, place) in held.iter_mut().zip(places) {
            if !settings.free[place] {
                let (sine, cosine) = x[place].sin_cos();
                *held = Some([cosine, sine]);
            }
        }
        let [first, second] = references(&sums, held[0], held[1]);
        for (place, found) in places.into_iter().zip([first, second]) {
            if settings.free[place] {
                x[place] = Lane::angle_of(found);
            }
        }
    }
    x
}

/// Adds what was known before; makes held parameters stand still.
#[inline(always)]
fn constrain<L: Lanes, const P: usize>(
    sums: &mut Sums<L, P>,
    settings: &Settings,
    x: &[Lane<L>; COUNT],
) {
    let zero = Lane::splat(0.0);
    for k in 0..P {
        if let Some([weight, mean]) = settings.prior[k] {
            let (weight, apart) = (Lane::splat(weight), x[k] - Lane::splat(mean));
            sums.matrix[k][k] = sums.matrix[k][k] + weight;
            sums.gradient[k] = weight.mul_add(apart, sums.gradient[k]);
            sums.sum_of_squares = (weight * apart).mul_add(apart, sums.sum_of_squares);
        }
        if !settings.free[k] {
            for j in 0..k {
                sums.matrix[k][j] = zero;
            }
            for i in k + 1..P {
                sums.matrix[i][k] = zero;
            }
            sums.matrix[k][k] = Lane::splat(1.0);
            sums.gradient[k] = zero;
        }
    }
}

/// Longest move \[rad\] that is learnt from: over a longer one J itself changes by as much as what it leaves out.
const LONGEST_LEARNT: f64 = 0.002;

/// Steps are not trusted to shrink faster.
const LEAST_RATE: f64 = 0.1;

/// What is missing of the curvature along a move, over the curvature met there, between which it is believed.
const LEAST_BELIEVED: f64 = -10.0;
const MOST_BELIEVED: f64 = 0.9;

/// What Gauss-Newton leaves out of the second derivatives, Σ r ∂²r: lower triangle.
///
/// Where the observations say little about some combination of parameters it is not small, and steps
/// shrink by the same factor for ever. It is learnt from how the gradient changed, as in NL2SOL (Dennis,
/// Gay, Welsch 1981, eq. 3.2, without its sizing), and makes the fit converge faster than linearly.
struct Bend<L, const P: usize>([[Lane<L>; P]; P]);

impl<L: Lanes, const P: usize> Default for Bend<L, P> {
    #[inline(always)]
    fn default() -> Self {
        Self([[Lane::splat(0.0); P]; P])
    }
}

impl<L: Lanes, const P: usize> Bend<L, P> {
    #[inline(always)]
    fn added_to(&self, matrix: &[[Lane<L>; P]; P]) -> [[Lane<L>; P]; P] {
        let mut sum = *matrix;
        for i in 0..P {
            for j in 0..=i {
                sum[i][j] = sum[i][j] + self.0[i][j];
            }
        }
        sum
    }

    /// After a move from where the gradient was `before`. What is learnt changes the curvature along the move
    /// to what was met there, and is not believed if that is far from the one expected.
    #[inline(always)]
    fn learn(
        &mut self,
        lanes: L::Mask,
        sums: &Sums<L, P>,
        moved: &[Lane<L>; P],
        before: &[Lane<L>; P],
        matrix: &[[Lane<L>; P]; P],
    ) {
        let zero = Lane::splat(0.0);
        let mut hessian = self.0;
        for i in 0..P {
            for j in 0..=i {
                let mean = (sums.matrix[i][j] + matrix[i][j]) * Lane::splat(0.5);
                hessian[i][j] = hessian[i][j] + mean;
            }
        }
        let mut change = [zero; P];
        let mut missing = [zero; P];
        let mut curvature = zero;
        let mut lack = zero;
        for i in 0..P {
            change[i] = sums.gradient[i] - before[i];
            let mut expected = zero;
            for j in 0..P {
                let h = if j <= i { hessian[i][j] } else { hessian[j][i] };
                expected = h.mul_add(moved[j], expected);
            }
            missing[i] = change[i] - expected;
            curvature = change[i].mul_add(moved[i], curvature);
            lack = missing[i].mul_add(moved[i], lack);
        }
        let per_curvature = Lane::splat(1.0) / curvature;
        let share = lack * per_curvature;
        let believed = lanes
            .and(zero.lt(curvature))
            .and(Lane::splat(LEAST_BELIEVED).lt(share))
            .and(share.lt(Lane::splat(MOST_BELIEVED)));
        for i in 0..P {
            // half of what the diagonal would get twice
            missing[i] =
                (share * Lane::splat(0.5)).neg_mul_add(change[i], missing[i]) * per_curvature;
        }
        for i in 0..P {
            for j in 0..=i {
                let new =
                    missing[i].mul_add(change[j], change[i].mul_add(missing[j], self.0[i][j]));
                self.0[i][j] = Lane::select(believed, new, self.0[i][j]);
            }
        }
    }
}

#[inline(always)]
fn fit<L: Lanes, const P: usize>(
    group: &mut Group,
    settings: &Settings,
    lane: usize,
    answers: &mut Answers,
) {
    let (zero, one) = (Lane::<L>::splat(0.0), Lane::<L>::splat(1.0));
    let [greatest, least] = group.prepare::<L>(lane);
    let usable = greatest
        .le(Lane::splat(math::MAX_ANGLE_RAD))
        .and(zero.lt(least));
    let group = &*group;
    let (rows, segments) = (&group.rows[..], &group.segments[..]);

    let mut trial = begin::<L>(group, settings, lane);
    // where it stands, and what is known of that place
    let mut base = trial;
    let mut square = Lane::splat(f64::INFINITY);
    let mut landed = Lane::<L>::nowhere();
    let mut step = [zero; P];
    // nothing is known yet of how fast steps shrink: any quotient with zero counts as one
    let mut length = zero;
    let mut share = one;
    let mut gradient = [zero; P];
    let mut bend = Bend::default();
    let mut matrix = [[zero; P]; P];
    let mut iterations = zero;
    let mut code = Lane::select(usable, zero, Lane::splat(code::UNSAFE));
    let mut active = usable;
    let mut chunk = Chunk::new();
    for iteration in 0..settings.max_iterations {
        let mut sums = sums::<L, P>(rows, segments, lane, &trial, &mut chunk);
        constrain(&mut sums, settings, &trial);
        iterations = iterations + Lane::select(active, one, zero);

        // Rounding may raise the sum at the optimum.
        let allowed = square * Lane::splat(1.0 + 1e-12);
        let lands_now = lands(sums.misses);
        let accepted = active
            .and(sums.sum_of_squares.le(allowed))
            .and(sums.sum_of_squares.lt(Lane::splat(f64::INFINITY)))
            .and(lands_now.or(landed.not()));
        let refused = active.and(accepted.not());
        for (base, trial) in base.iter_mut().zip(&trial) {
            *base = Lane::select(accepted, *trial, *base);
        }
        square = Lane::select(accepted, sums.sum_of_squares, square);
        landed = landed.or(accepted.and(lands_now));
        if iteration > 0 {
            let mut moved = step;
            for moved in &mut moved {
                *moved = share * *moved;
            }
            let near = accepted.and((share * length).lt(Lane::splat(LONGEST_LEARNT)));
            bend.learn(near, &sums, &moved, &gradient, &matrix);
        }
        let (new_factor, safe) = Factor::new(&bend.added_to(&sums.matrix));
        let new_step = new_factor.solve_negative(&sums.gradient);
        let mut new_length = zero;
        for k in 0..P {
            gradient[k] = Lane::select(accepted, sums.gradient[k], gradient[k]);
            step[k] = Lane::select(accepted, new_step[k], step[k]);
            new_length = new_step[k].abs().max(new_length);
        }
        for i in 0..P {
            for j in 0..=i {
                matrix[i][j] = Lane::select(accepted, sums.matrix[i][j], matrix[i][j]);
            }
        }
        share = Lane::select(refused, share * Lane::splat(0.5), one);

        // What is left after this step is the next ones: less than a tenth of it, or than the rate at which
        // steps shrink. That rate alone says too little before the slowest direction shows.
        let rate = (new_length / length).min(one).max(Lane::splat(LEAST_RATE));
        let done = accepted.and((new_length * rate).le(Lane::splat(settings.tolerance)));
        length = Lane::select(accepted, new_length, length);
        let unsafe_now = if iteration == 0 {
            accepted.and(safe).not().and(active)
        } else {
            accepted.and(safe.not())
        };
        let stuck = refused.and((share * length).le(Lane::splat(settings.tolerance * 1e-3)));
        for k in 0..P {
            let moved = share.mul_add(step[k], base[k]);
            trial[k] = Lane::select(active.and(stuck.not()), moved, trial[k]);
            trial[k] = Lane::select(stuck, base[k], trial[k]);
        }
        code = Lane::select(done, Lane::splat(code::SMALL_STEP), code);
        code = Lane::select(stuck, Lane::splat(code::NO_DESCENT), code);
        code = Lane::select(unsafe_now, Lane::splat(code::UNSAFE), code);
        active = active
            .and(done.not())
            .and(stuck.not())
            .and(unsafe_now.not());
        if !any(active) {
            break;
        }
    }
    for (trial, base) in trial.iter_mut().zip(&base) {
        *trial = Lane::select(active, *base, *trial);
    }
    code = Lane::select(active, Lane::splat(code::MAX_ITERATIONS), code);
    // The last step lowers S by what its model says: steps are by then so short that the rest is rounding.
    let mut gain = zero;
    for k in 0..P {
        gain = gradient[k].mul_add(trial[k] - base[k], gain);
    }
    let mut sum_of_squares = (square + gain).max(zero);
    let mut square_m2 = sum_of_squares;
    let mut weighted = zero.lt(Lane::read(&group.stated, lane));
    if settings.prior.iter().any(Option::is_some) {
        weighted = zero.lt(one);
    }
    if any(weighted) {
        let mut end = ending::<L>(rows, segments, lane, &trial);
        for (trial, prior) in trial.iter().zip(&settings.prior) {
            if let Some([weight, mean]) = *prior {
                let apart = *trial - Lane::splat(mean);
                let square = (Lane::splat(weight) * apart).mul_add(apart, end.sum_of_squares);
                end.sum_of_squares = square;
            }
        }
        square_m2 = Lane::select(weighted, end.square_m2, square_m2);
        sum_of_squares = Lane::select(weighted, end.sum_of_squares, sum_of_squares);
    }
    code = Lane::select(landed, code, Lane::splat(code::MISS));
    let finite = sum_of_squares.lt(Lane::splat(f64::INFINITY));
    code = Lane::select(finite, code, Lane::splat(code::UNSAFE));

    for (value, to) in trial.iter().zip(&mut answers.values) {
        value.write(to, lane);
    }
    code.write(&mut answers.code, lane);
    iterations.write(&mut answers.iterations, lane);
    sum_of_squares.write(&mut answers.sum_of_squares, lane);
    square_m2.write(&mut answers.square_m2, lane);
    if settings.covariance {
        let (factor, safe) = Factor::new(&matrix);
        Lane::select(safe, code, Lane::splat(code::UNSAFE)).write(&mut answers.code, lane);
        let covariance = factor.covariance();
        for i in 0..P {
            for j in 0..=i {
                covariance[i][j].write(&mut answers.covariance[i][j], lane);
            }
        }
    }
}
