//! The field calibrated as one: what heliostats share, how they differ, how their zero points move.
//!
//! Every heliostat has six angles (and causes of its own) drawn from a distribution of the field, zero points
//! that wander about them, and the causes that all heliostats, or all spots on a target, have in common.
//! Records scatter across the beam, on the target, and along the sun's path. All of it is found together:
//! the common unknowns from the Schur complement of each heliostat's records, noise, wander and distribution
//! from their likelihood over the field, causes by what the whole field says for them.

#![allow(
    clippy::needless_range_loop,
    reason = "triangles of matrices are written by their indices"
)]

mod belief;
mod common;
mod follow;
mod foretell;
mod hyper;
mod hypotheses;
mod parts;
mod rows;
pub mod simulate;
mod terms;

use rayon::prelude::*;

use crate::error::CalibrationError;
use crate::field::{Campaign, FieldFitOptions, fit_field};
use belief::{Belief, REFERENCES, Shape, WANDERING};
use common::{Common, Sum};
pub use follow::{Alarm, FieldState, Followed, JumpSeen, Known, Step, StepKind};
pub use foretell::{Foretold, History};
use hyper::{
    EXPECTED_NOISE, EXPECTED_SPREAD_MRAD, EXPECTED_WANDER, Hyper, Marks, expected_covariance,
    filter, learn, minus_log_likelihood,
};
pub use hyper::{Noise, Wander};
pub use hypotheses::Mishaps;
use hypotheses::judge;
pub use parts::{AccountParts, HeliostatParts, StateParts};
use rows::{ANGLES, Expansion, MILLI, Rows, Structure, filter_unit, pole};
pub use terms::{AxisCause, Cause, Description, Scope};

/// How to fit a field together.
#[derive(Debug, Clone, PartialEq)]
pub struct JointOptions {
    /// Latitude of the site \[rad\]: the sun's path.
    pub site_latitude_rad: f64,
    /// Causes that turn mirrors about their axes and may be found in the field.
    pub axis_causes: Vec<AxisCause>,
    /// Whether targets may be shifted.
    pub target_shifts: bool,
    /// Whether the sun's time may be off.
    pub sun_time: bool,
    /// How much likelier (logarithm) the whole field's records must be with a cause than without it.
    pub least_log_evidence: f64,
    /// How often things go wrong.
    pub mishaps: Mishaps,
    /// Noise and wander are learnt from at most so many heliostats, evenly chosen.
    pub learnt_from: usize,
    /// Times that the formula is made linear anew.
    pub expansions: usize,
}

impl JointOptions {
    /// All causes of the list, at a site.
    #[must_use]
    pub fn new(site_latitude_rad: f64) -> Self {
        Self {
            site_latitude_rad,
            axis_causes: AxisCause::ALL.to_vec(),
            target_shifts: true,
            sun_time: true,
            least_log_evidence: 3.0,
            mishaps: Mishaps::default(),
            learnt_from: 128,
            expansions: 3,
        }
    }
}

/// A cause that the field may have in common.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct CommonCause {
    /// Which.
    pub cause: Cause,
    /// Its value (for a cause of each heliostat: the field's mean), in its own unit; zero where it is not admitted.
    pub value: f64,
    /// One standard deviation of that.
    pub sigma: f64,
    /// Standard deviation of heliostats about it, in its own unit.
    pub spread: f64,
    /// How much likelier (logarithm) the records are with it.
    pub log_evidence: f64,
    /// Whether the field's records speak for it.
    pub admitted: bool,
}

/// What the joint fit says of one heliostat.
#[derive(Debug, Clone, PartialEq)]
pub struct Posterior {
    /// Its six angles at rest \[rad\], then the causes of its own \[rad\].
    pub still: Vec<f64>,
    /// Its wandering zero points after its last record \[rad\]: slow of either axis, fast of either axis.
    pub wandering: [f64; WANDERING],
    /// Covariance of all of these \[rad²\], row by row; what is common is part of it.
    pub covariance: Vec<f64>,
    /// Its last record \[days since 1970\].
    pub last_day: Option<f64>,
    /// Observations that were not believed.
    pub outliers: Vec<usize>,
    /// Observations before which the zero point of an axis (0 or 1) jumped.
    pub jumps: Vec<(usize, usize)>,
    /// How many observations it had.
    pub records: usize,
    belief: Belief<f64>,
}

/// What the joint fit found.
#[derive(Debug, Clone, PartialEq)]
pub struct JointFit {
    /// Causes that were asked for.
    pub causes: Vec<CommonCause>,
    /// Mean of heliostats' own unknowns \[rad\].
    pub field_mean: Vec<f64>,
    /// Their covariance over the field \[rad²\], row by row.
    pub field_covariance: Vec<f64>,
    /// How records scatter.
    pub noise: Noise,
    /// How zero points wander.
    pub wander: Wander,
    /// Minus the logarithm of the likelihood of the heliostats that noise and wander were learnt from.
    pub minus_log_likelihood: f64,
    /// In the order of the campaigns.
    pub heliostats: Vec<Posterior>,
    structure: Structure,
    hyper: Hyper,
    common: Common,
    told: Sum,
    prior_sigma: Vec<f64>,
    mishaps: Mishaps,
    site_latitude_rad: f64,
}

/// Standard deviation of the field's means before anything was seen \[mrad\].
const EXPECTED_MEAN_MRAD: [f64; ANGLES] = [20.0, 20.0, 20.0, 5.0, 20.0, 20.0];
/// Fewest records from which a heliostat's own fit is a good place to begin.
const BEGIN_WITH_FIT: usize = 6;
/// Farthest beginning that is taken from a heliostat's own fit \[rad\].
const BEGIN_WITHIN_RAD: f64 = 0.5;
/// A record farther than this from what was expected (chi-squared, two degrees of freedom) has the
/// heliostat's records judged.
const JUDGED: f64 = 16.0;
/// What holds a cause that is not admitted to zero, in its expected size.
const HELD: f64 = 1e-9;

struct Work<'a> {
    campaigns: &'a [Campaign<'a>],
    options: &'a JointOptions,
    structure: Structure,
    shape: Shape,
    pole: helio_core::Enu,
    prior_sigma: Vec<f64>,
    expected_spread: Vec<f64>,
    spread_free: Vec<bool>,
    hyper: Hyper,
    common: Common,
    told: Sum,
}

/// Fits a field together.
///
/// # Errors
/// [`CalibrationError::BadOption`] where an option makes no sense.
pub fn fit_joint(
    campaigns: &[Campaign<'_>],
    options: &JointOptions,
) -> Result<JointFit, CalibrationError> {
    let mut work = Work::new(campaigns, options)?;
    let mut expansions = work.beginnings();
    let mut beliefs = Vec::new();
    let mut rows = Vec::new();
    let mut marks = Vec::new();
    for pass in 0..options.expansions.max(1) {
        rows = work.rows(&expansions);
        marks = work.judge(&mut rows, pass == 0);
        work.learn(&rows);
        beliefs = work.believe(&rows);
        if pass > 0 {
            work.admit(&rows);
            beliefs = work.believe(&rows);
        }
        expansions = work.expansions(&beliefs);
    }
    let likelihood = minus_log_likelihood(
        work.shape,
        &work.sample(&rows),
        &work.hyper,
        &work.prior_sigma,
    );
    Ok(work.finish(beliefs, &rows, marks, likelihood))
}

impl<'a> Work<'a> {
    fn new(
        campaigns: &'a [Campaign<'a>],
        options: &'a JointOptions,
    ) -> Result<Self, CalibrationError> {
        let latitude = options.site_latitude_rad;
        if latitude.is_nan() || latitude.abs() > core::f64::consts::FRAC_PI_2 {
            return Err(CalibrationError::BadOption {
                what: "site_latitude_rad",
                wanted: "within ±π/2",
                value: latitude,
            });
        }
        let targets = campaigns
            .iter()
            .flat_map(|c| c.observations)
            .map(|o| o.target + 1)
            .max()
            .unwrap_or(0);
        let (own, shared): (Vec<AxisCause>, Vec<AxisCause>) = options
            .axis_causes
            .iter()
            .partition(|cause| cause.description().expected_spread > 0.0);
        let mut shared: Vec<Cause> = shared.into_iter().map(Cause::Axis).collect();
        if options.target_shifts {
            for target in 0..targets {
                shared.extend([Cause::TargetRight(target), Cause::TargetDown(target)]);
            }
        }
        if options.sun_time {
            shared.push(Cause::SunTime);
        }
        let structure = Structure { own, shared };
        let shape = structure.shape();
        let of_own = |of: fn(Description) -> f64| {
            let own = structure.own.iter();
            own.map(move |cause| of(cause.description()) * MILLI)
                .collect::<Vec<_>>()
        };
        let mut prior_sigma = EXPECTED_MEAN_MRAD.to_vec();
        prior_sigma.extend(of_own(|d| d.expected));
        prior_sigma.extend(
            structure
                .shared
                .iter()
                .map(|&cause| cause.description().expected * filter_unit(cause)),
        );
        let mut expected_spread = EXPECTED_SPREAD_MRAD.to_vec();
        expected_spread.extend(of_own(|d| d.expected_spread));
        let hyper = Hyper {
            noise: EXPECTED_NOISE,
            wander: EXPECTED_WANDER,
            spread: expected_covariance(&expected_spread),
        };
        let n = prior_sigma.len();
        let mut covariance = vec![0.0; n * n];
        for k in 0..n {
            covariance[k * n + k] = prior_sigma[k] * prior_sigma[k];
        }
        let common = Common {
            mean: vec![0.0; n],
            covariance,
            minus_log_likelihood: 0.0,
        };
        Ok(Self {
            campaigns,
            options,
            spread_free: vec![true; shape.still],
            structure,
            shape,
            pole: pole(latitude),
            prior_sigma,
            expected_spread,
            hyper,
            common,
            told: Sum::nothing(shape),
        })
    }

    /// Where each heliostat's own fit leads, if it has records enough for one.
    fn beginnings(&self) -> Vec<Expansion> {
        let fits = fit_field(self.campaigns, &FieldFitOptions::default());
        let shared = vec![0.0; self.shape.causes];
        fits.into_iter()
            .zip(self.campaigns)
            .map(|(fit, campaign)| {
                let mut still = vec![0.0; self.shape.still];
                if let Ok(fit) = fit
                    && campaign.observations.len() >= BEGIN_WITH_FIT
                    && fit.parameters.values[..ANGLES]
                        .iter()
                        .all(|x| x.abs() < BEGIN_WITHIN_RAD)
                {
                    still[..ANGLES].copy_from_slice(&fit.parameters.values[..ANGLES]);
                }
                Expansion {
                    still,
                    shared: shared.clone(),
                }
            })
            .collect()
    }

    fn rows(&self, expansions: &[Expansion]) -> Vec<Rows> {
        self.campaigns
            .par_iter()
            .zip(expansions)
            .map(|(campaign, at)| Rows::of(&self.structure, campaign, at, self.pole))
            .collect()
    }

    /// Outliers and jumps, written into the rows.
    fn judge(&self, rows: &mut [Rows], all: bool) -> Vec<Marks> {
        rows.par_iter_mut()
            .map(|rows| {
                let mut doubtful = all;
                if !all {
                    filter(
                        self.shape,
                        rows,
                        &self.hyper,
                        &self.common.mean,
                        |_, square| {
                            doubtful |= square > JUDGED;
                        },
                    );
                }
                if !doubtful {
                    return Marks::default();
                }
                let common = (&self.common.mean[..], &self.common.covariance[..]);
                let mishaps = &self.options.mishaps;
                let marks = judge(self.shape, rows, &self.hyper, common, mishaps);
                rows.mark(self.shape, &marks, mishaps.jump_mrad);
                marks
            })
            .collect()
    }

    /// Heliostats that noise and wander are learnt from: evenly spaced among those with records.
    fn sample(&self, rows: &[Rows]) -> Vec<Rows> {
        let with: Vec<&Rows> = rows.iter().filter(|r| r.len() > 1).collect();
        let count = with.len().min(self.options.learnt_from.max(1));
        (0..count)
            .map(|k| with[k * with.len() / count].clone())
            .collect()
    }

    fn learn(&mut self, rows: &[Rows]) {
        let sample = self.sample(rows);
        learn(
            self.shape,
            &sample,
            &mut self.hyper,
            &self.prior_sigma,
            &self.expected_spread,
            &self.spread_free,
        );
    }

    /// All heliostats' beliefs, and what is common.
    fn believe(&mut self, rows: &[Rows]) -> Vec<Belief<f64>> {
        let each: Vec<(Belief<f64>, Sum)> = rows
            .par_iter()
            .map(|rows| filter(self.shape, rows, &self.hyper, &[], |_, _| {}))
            .collect();
        let mut sum = Sum::nothing(self.shape);
        for (_, of_one) in &each {
            sum.add(of_one);
        }
        if let Some(common) = Common::new(&sum, &self.prior_sigma) {
            self.common = common;
        }
        self.told = sum;
        each.into_iter().map(|(belief, _)| belief).collect()
    }

    /// Holds to zero, one after the other, the causes that the field's records do not speak for.
    fn admit(&mut self, rows: &[Rows]) {
        let still = self.shape.still;
        loop {
            let weakest = (0..self.shape.causes)
                .filter(|&k| self.is_free(still + k))
                .map(|k| {
                    (
                        self.common
                            .log_evidence(still + k, self.prior_sigma[still + k]),
                        k,
                    )
                })
                .min_by(|a, b| a.0.total_cmp(&b.0));
            match weakest {
                Some((evidence, k)) if evidence < self.options.least_log_evidence => {
                    self.prior_sigma[still + k] *= HELD;
                    self.believe(rows);
                }
                _ => break,
            }
        }
    }

    fn is_free(&self, k: usize) -> bool {
        self.prior_sigma[k] > 1e-6
    }

    fn expansions(&self, beliefs: &[Belief<f64>]) -> Vec<Expansion> {
        let shared: Vec<f64> = self
            .structure
            .shared
            .iter()
            .zip(&self.common.mean[self.shape.still..])
            .map(|(&cause, value)| value / filter_unit(cause))
            .collect();
        beliefs
            .iter()
            .map(|belief| Expansion {
                still: self.common.mean_of(belief)[..self.shape.still]
                    .iter()
                    .map(|x| x / MILLI)
                    .collect(),
                shared: shared.clone(),
            })
            .collect()
    }

    fn finish(
        self,
        beliefs: Vec<Belief<f64>>,
        rows: &[Rows],
        marks: Vec<Marks>,
        likelihood: f64,
    ) -> JointFit {
        let Shape { still, .. } = self.shape;
        let square = MILLI * MILLI;
        let spread: Vec<f64> = (0..still * still)
            .map(|k| {
                let (i, j) = ((k / still).max(k % still), (k / still).min(k % still));
                self.hyper.spread[belief::at(i, j)] / square
            })
            .collect();
        let common_cause = |k: usize, cause: Cause, spread: f64| {
            let unit = filter_unit(cause);
            let admitted = self.is_free(k);
            CommonCause {
                cause,
                value: if admitted {
                    self.common.mean[k] / unit
                } else {
                    0.0
                },
                sigma: self.common.sigma(k) / unit,
                spread,
                log_evidence: self.common.log_evidence(k, self.prior_sigma[k]),
                admitted,
            }
        };
        let own = self.structure.own.iter().enumerate().map(|(k, &cause)| {
            let k = ANGLES + k;
            common_cause(k, Cause::Axis(cause), libm::sqrt(spread[k * still + k]))
        });
        let shared = self.structure.shared.iter().enumerate();
        let shared = shared.map(|(k, &cause)| common_cause(still + k, cause, 0.0));
        let causes = own.chain(shared).collect();
        let heliostats = beliefs
            .into_iter()
            .zip(rows)
            .zip(marks)
            .map(|((belief, rows), marks)| {
                let mean = self.common.mean_of(&belief);
                let covariance = self.common.covariance_of(&belief);
                Posterior {
                    still: mean[..still].iter().map(|x| x / MILLI).collect(),
                    wandering: core::array::from_fn(|k| mean[still + k] / MILLI),
                    covariance: covariance.iter().map(|x| x / square).collect(),
                    last_day: rows.days.last().copied(),
                    outliers: marks.outliers.iter().map(|&k| rows.of[k]).collect(),
                    jumps: marks
                        .jumps
                        .iter()
                        .map(|&(k, axis)| (rows.of[k], axis))
                        .collect(),
                    records: rows.len(),
                    belief,
                }
            })
            .collect();
        JointFit {
            causes,
            field_mean: self.common.mean[..still]
                .iter()
                .map(|x| x / MILLI)
                .collect(),
            field_covariance: spread,
            noise: self.hyper.noise,
            wander: self.hyper.wander,
            minus_log_likelihood: likelihood,
            heliostats,
            structure: self.structure,
            hyper: self.hyper,
            common: self.common,
            told: self.told,
            prior_sigma: self.prior_sigma,
            mishaps: self.options.mishaps,
            site_latitude_rad: self.options.site_latitude_rad,
        }
    }
}
