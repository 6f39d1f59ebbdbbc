//! The two solvers of Guo 2015 §4.4 on one rank-revealing step.

mod gauss_newton;
mod hartley_meyer;

use faer::{Col, ColRef, Mat};

use crate::fit::{FitOptions, Solver, Stop};
use crate::parameters::COUNT;

/// Singular values below this share of the largest count as zero (columns scaled).
pub(crate) const RANK_TOLERANCE: f64 = 1e-11;

/// A step that promises to lower S by this share and lowers it by none is no end of a descent.
const STUCK_SHARE: f64 = 1e-6;
/// Singular values below this share of the largest are left out of a careful step.
const BADLY_DETERMINED: f64 = 0.02;
/// A step of which less than this part can be taken is compared with a careful one.
const SHORT_PART: f64 = 0.2;
/// Steps one after the other that neither lower S nor become shorter before a fit ends: what is left is rounding.
const IDLE_STEPS: usize = 3;
/// A step counts as shorter if it is by this factor than every one before.
const SHORTER: f64 = 0.5;

/// A sum of squares to make small.
pub(crate) trait LeastSquares {
    /// S; infinite where it is not defined.
    fn sum(&self, values: &[f64; COUNT]) -> f64;
    /// Fills the residuals and their Jacobian at a place where S is finite, and returns S.
    fn linearise(&self, values: &[f64; COUNT], system: &mut System) -> f64;
    /// Sum of squares of the residuals' rounding errors.
    fn rounding(&self) -> f64;
}

/// Residuals and their Jacobian by the free parameters.
#[derive(Debug, Clone)]
pub(crate) struct System {
    /// Which of the seven parameters each column belongs to.
    pub columns: Vec<usize>,
    /// Rows by columns.
    pub jacobian: Mat<f64>,
    /// One per row.
    pub residuals: Vec<f64>,
}

impl System {
    pub fn new(rows: usize, columns: Vec<usize>) -> Self {
        Self {
            jacobian: Mat::zeros(rows, columns.len()),
            residuals: vec![0.0; rows],
            columns,
        }
    }

    /// Writes a row: a residual and its slopes by all seven parameters, both times `factor`.
    pub fn set(&mut self, row: usize, residual: f64, slopes: &[f64; COUNT], factor: f64) {
        self.residuals[row] = residual * factor;
        for (k, &column) in self.columns.iter().enumerate() {
            self.jacobian[(row, k)] = slopes[column] * factor;
        }
    }

    /// The columns made of unit length, and their lengths; a column of zeros stays with length 1.
    pub fn scaled(&self) -> (Mat<f64>, Vec<f64>) {
        let lengths: Vec<f64> = (0..self.columns.len())
            .map(|k| {
                let length = self.jacobian.col(k).norm_l2();
                if length > 0.0 { length } else { 1.0 }
            })
            .collect();
        let scaled = Mat::from_fn(self.jacobian.nrows(), lengths.len(), |i, k| {
            self.jacobian[(i, k)] / lengths[k]
        });
        (scaled, lengths)
    }
}

/// A Gauss-Newton step.
#[derive(Debug, Clone, Copy)]
struct Step {
    /// By all seven parameters.
    values: [f64; COUNT],
    /// dx·g with g = Jᵀr, half the slope of S along the step: negative.
    descent: f64,
    /// Length over the free parameters \[rad, metres for the mirror offset\].
    length: f64,
    /// Largest cosine between the residuals and a column of J.
    gradient: f64,
}

impl Step {
    /// The step that makes |r + J dx| least, of all those the shortest in scaled parameters. Column-pivoted
    /// QR where J has full rank, singular values where it has not.
    fn of(system: &System) -> Self {
        let (scaled, lengths) = system.scaled();
        let columns = lengths.len();
        let right = Col::from_fn(system.residuals.len(), |i| system.residuals[i]);
        let norm = right.norm_l2();
        let along = scaled.transpose() * &right;
        let gradient = if norm > 0.0 {
            (0..columns).fold(0.0_f64, |most, k| most.max(along[k].abs())) / norm
        } else {
            0.0
        };
        let solution =
            full_rank(&scaled, &right).unwrap_or_else(|| shortest(&scaled, &right, RANK_TOLERANCE));
        Self::new(system, &lengths, &solution, along.as_ref(), gradient)
    }

    /// The same without the combinations that the observations determine badly: shorter, and less of a fall.
    fn careful(system: &System) -> Self {
        let (scaled, lengths) = system.scaled();
        let right = Col::from_fn(system.residuals.len(), |i| system.residuals[i]);
        let along = scaled.transpose() * &right;
        let solution = shortest(&scaled, &right, BADLY_DETERMINED);
        Self::new(system, &lengths, &solution, along.as_ref(), 1.0)
    }

    fn new(
        system: &System,
        lengths: &[f64],
        solution: &[f64],
        along: ColRef<'_, f64>,
        gradient: f64,
    ) -> Self {
        let mut values = [0.0; COUNT];
        let (mut descent, mut square) = (0.0, 0.0);
        for (k, &column) in system.columns.iter().enumerate() {
            values[column] = -solution[k] / lengths[k];
            descent -= solution[k] * along[k];
            square += values[column] * values[column];
        }
        Self {
            values,
            descent,
            length: libm::sqrt(square),
            gradient,
        }
    }

    /// The place a part of the way along.
    fn from(&self, values: &[f64; COUNT], part: f64) -> [f64; COUNT] {
        core::array::from_fn(|k| values[k] + part * self.values[k])
    }
}

/// Least squares by column-pivoted QR; nothing where the rank is not full.
fn full_rank(matrix: &Mat<f64>, right: &Col<f64>) -> Option<Vec<f64>> {
    let columns = matrix.ncols();
    if matrix.nrows() < columns {
        return None;
    }
    let qr = matrix.col_piv_qr();
    let r = qr.thin_R();
    let largest = r[(0, 0)].abs();
    if !(0..columns).all(|k| r[(k, k)].abs() > RANK_TOLERANCE * largest) {
        return None;
    }
    let q = qr.compute_thin_Q();
    let turned = q.transpose() * right;
    let mut solved = vec![0.0; columns];
    for i in (0..columns).rev() {
        let mut rest = turned[i];
        for k in i + 1..columns {
            rest -= r[(i, k)] * solved[k];
        }
        solved[i] = rest / r[(i, i)];
    }
    let mut solution = vec![0.0; columns];
    for (place, &column) in qr.P().arrays().0.iter().enumerate() {
        solution[column] = solved[place];
    }
    Some(solution)
}

/// The shortest least-squares solution by singular values; zero where they cannot be found.
fn shortest(matrix: &Mat<f64>, right: &Col<f64>, tolerance: f64) -> Vec<f64> {
    let columns = matrix.ncols();
    let mut solution = vec![0.0; columns];
    let Ok(svd) = matrix.thin_svd() else {
        return solution;
    };
    let singular = svd.S().column_vector();
    let turned = svd.U().transpose() * right;
    for i in 0..singular.nrows() {
        if singular[i] > tolerance * singular[0] {
            let along = turned[i] / singular[i];
            for (k, value) in solution.iter_mut().enumerate() {
                *value += svd.V()[(k, i)] * along;
            }
        }
    }
    solution
}

/// Where a part of a step leads.
#[derive(Debug, Clone, Copy)]
struct Trial {
    part: f64,
    sum: f64,
}

/// When to stop.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Limits {
    pub max_iterations: usize,
    pub min_step: f64,
    pub min_gradient: f64,
}

impl From<&FitOptions> for Limits {
    fn from(options: &FitOptions) -> Self {
        Self {
            max_iterations: options.max_iterations,
            min_step: options.min_step_rad,
            min_gradient: options.min_gradient,
        }
    }
}

/// What a solver found.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Outcome {
    pub values: [f64; COUNT],
    pub sum: f64,
    pub iterations: usize,
    pub stop: Stop,
}

/// Makes a sum of squares small from a place on.
pub(crate) fn minimise(
    problem: &impl LeastSquares,
    solver: Solver,
    start: &[f64; COUNT],
    system: &mut System,
    limits: Limits,
) -> Outcome {
    let mut best = Outcome {
        values: *start,
        sum: problem.sum(start),
        iterations: 0,
        stop: Stop::MaxIterations,
    };
    if !best.sum.is_finite() {
        best.stop = Stop::NoLanding;
        return best;
    }
    let (mut values, mut sum, mut idle) = (best.values, best.sum, 0);
    let mut shortest = f64::INFINITY;
    while best.iterations < limits.max_iterations {
        problem.linearise(&values, system);
        let mut step = Step::of(system);
        let promise = -step.descent;
        if step.gradient <= limits.min_gradient {
            best.stop = Stop::SmallGradient;
            break;
        }
        best.iterations += 1;
        // |r + dr|² - |r|² is at most 2 |r| |dr| + |dr|²
        let rounding = problem.rounding();
        let tolerance = 2.0 * libm::sqrt(sum * rounding) + rounding;
        let last = step.length < limits.min_step;
        let search = |step: &Step| {
            let sum_of = |part: f64| problem.sum(&step.from(&values, part));
            match solver {
                Solver::HartleyMeyer => hartley_meyer::search(sum_of, sum, step.descent, tolerance),
                Solver::GaussNewton => gauss_newton::search(sum_of, sum, tolerance),
            }
        };
        let mut trial = if last {
            // not worth a search
            let sum = problem.sum(&step.from(&values, 1.0));
            (sum <= best.sum + tolerance).then_some(Trial { part: 1.0, sum })
        } else {
            search(&step)
        };
        if !last && trial.is_none_or(|t| t.part < SHORT_PART) {
            let other = Step::careful(system);
            let found = search(&other);
            if let Some(better) = found
                && trial.is_none_or(|t| better.sum < t.sum)
            {
                trial = found;
                step = other;
            }
        }
        if let Some(trial) = trial {
            values = step.from(&values, trial.part);
            let shorter = step.length < SHORTER * shortest;
            let lower = trial.sum < best.sum;
            idle = if lower || shorter { 0 } else { idle + 1 };
            if shorter {
                shortest = step.length;
            }
            if lower || shorter || last {
                best.values = values;
                best.sum = trial.sum;
            }
            sum = trial.sum;
        }
        if last {
            best.stop = Stop::SmallStep;
            break;
        }
        if trial.is_none() || idle == IDLE_STEPS {
            let promised = promise > STUCK_SHARE * sum + tolerance;
            best.stop = if promised {
                Stop::Stuck
            } else {
                Stop::NoDescent
            };
            break;
        }
    }
    best
}
