//! What a fit is asked and what it answers.

use crate::parameters::{COUNT, Parameter, Parameters};

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
