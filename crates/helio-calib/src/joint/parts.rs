//! A followed field as plain numbers, for its file; what such numbers, and options, must be.

use std::collections::HashSet;

use super::belief::{Belief, Shape, Told, at};
use super::common::{Common, Sum};
use super::follow::{Alarm, FieldState, Followed};
use super::hyper::{Hyper, Marks, Noise, Wander};
use super::hypotheses::{Account, Drift, Mishaps};
use super::rows::Structure;
use super::terms::{AxisCause, Cause};
use super::watch::{Lately, Watch};
use crate::error::CalibrationError;

/// [`FieldState`] as plain numbers: angles in mrad, everything else in its own unit. Triangles are lower ones,
/// row by row.
#[derive(Debug, Clone, PartialEq)]
pub struct StateParts {
    /// As in [`FieldState`].
    pub noise: Noise,
    /// As in [`FieldState`].
    pub wander: Wander,
    /// As in [`FieldState`].
    pub mishaps: Mishaps,
    /// As in [`FieldState`].
    pub alarm: Alarm,
    /// As in [`FieldState`].
    pub site_latitude_rad: f64,
    /// Causes of which each heliostat has its own value; with the six angles its unknowns at rest.
    pub own: Vec<AxisCause>,
    /// Causes in common; with the means of the unknowns at rest before them the common unknowns.
    pub shared: Vec<Cause>,
    /// Standard deviation of each common unknown before any record.
    pub prior_sigma: Vec<f64>,
    /// Triangle of the field's covariance of unknowns at rest.
    pub spread: Vec<f64>,
    /// Triangle of the normal equations of the common unknowns.
    pub matrix: Vec<f64>,
    /// Their right side.
    pub vector: Vec<f64>,
    /// Sum of squares with all common unknowns zero.
    pub square: f64,
    /// Logarithm of the determinants of all records' covariances.
    pub log_determinant: f64,
    /// The field as a whole, held against what was foretold.
    pub watch: Watch,
    /// Each heliostat.
    pub heliostats: Vec<HeliostatParts>,
}

/// [`Followed`] as plain numbers.
pub type HeliostatParts = Followed<AccountParts>;

/// One account of what happened.
#[derive(Debug, Clone, PartialEq)]
pub struct AccountParts {
    /// Logarithm of its likelihood less that of the likeliest.
    pub log_likelihood: f64,
    /// Running mean of the misses in their standard deviations.
    pub drift: [f64; 2],
    /// Variance of either component of that in a heliostat that does what the model says.
    pub drift_variance: f64,
    /// Records since the last that was believed.
    pub unbelieved: usize,
    /// How many of the last records do not fit the others.
    pub lately: Lately,
    /// Unknowns at rest, then wandering zero points, where all common unknowns are zero.
    pub mean: Vec<f64>,
    /// Their derivatives by the common unknowns, row by row.
    pub gain: Vec<f64>,
    /// Triangle of their covariance with the common unknowns given.
    pub spread: Vec<f64>,
    /// Triangle of what the records in doubt tell of the common unknowns; empty for nothing.
    pub matrix: Vec<f64>,
    /// The right side of that; empty for nothing.
    pub vector: Vec<f64>,
    /// Sum of squares of that.
    pub square: f64,
    /// Records in doubt that this account takes for outliers, by their place in `undecided`.
    pub outliers: Vec<usize>,
    /// Those before which it takes the zero point of an axis to have jumped.
    pub jumps: Vec<(usize, usize)>,
}

impl FieldState {
    /// Everything it knows.
    #[must_use]
    pub fn parts(&self) -> StateParts {
        StateParts {
            noise: self.noise,
            wander: self.wander,
            mishaps: self.mishaps,
            alarm: self.alarm,
            site_latitude_rad: self.site_latitude_rad,
            own: self.structure.own.clone(),
            shared: self.structure.shared.clone(),
            prior_sigma: self.prior_sigma.clone(),
            spread: self.spread.clone(),
            matrix: self.told.told.matrix.clone(),
            vector: self.told.told.vector.clone(),
            square: self.told.told.square,
            log_determinant: self.told.log_determinant,
            watch: self.watch.clone(),
            heliostats: self.heliostats.iter().map(HeliostatParts::of).collect(),
        }
    }

    /// From its parts: bit for bit the state that they were taken from.
    ///
    /// # Errors
    /// [`CalibrationError::BadOption`] where lengths do not fit each other, a number is not finite or not what it can
    /// be (such as a negative variance, a probability above 1, a third axis), or two heliostats share a name.
    pub fn from_parts(parts: StateParts) -> Result<Self, CalibrationError> {
        check_latitude(parts.site_latitude_rad)?;
        check_mishaps(&parts.mishaps)?;
        check_rates(&parts.noise, &parts.wander)?;
        share("alarm.false_alarm_rate", parts.alarm.false_alarm_rate)?;
        share("alarm.weight", parts.alarm.weight)?;
        finite("square", parts.square)?;
        finite("log_determinant", parts.log_determinant)?;
        let structure = Structure {
            own: parts.own,
            shared: parts.shared,
        };
        let shape = structure.shape();
        let common = shape.common();
        let right = [
            ("prior_sigma", &parts.prior_sigma, common),
            ("spread", &parts.spread, Shape::triangle(shape.still)),
            ("matrix", &parts.matrix, Shape::triangle(common)),
            ("vector", &parts.vector, common),
        ];
        for (what, numbers, length) in right {
            check(what, numbers, length)?;
        }
        for &sigma in &parts.prior_sigma {
            not_negative("prior_sigma", sigma)?;
        }
        check_diagonal("variance in spread", &parts.spread, shape.still)?;
        check_diagonal("diagonal of matrix", &parts.matrix, common)?;
        check_watch(&parts.watch, parts.heliostats.len())?;
        let mut ids = HashSet::new();
        for (k, heliostat) in parts.heliostats.iter().enumerate() {
            let new = ids.insert(heliostat.id.as_str());
            demand(
                "heliostat by its place",
                new,
                "of a name of its own",
                k as f64,
            )?;
        }
        let mut told = Told::nothing(shape);
        told.matrix = parts.matrix;
        told.vector = parts.vector;
        told.square = parts.square;
        let told = Sum::new(told, parts.log_determinant);
        let common = Common::new(&told, &parts.prior_sigma).ok_or(CalibrationError::BadOption {
            what: "matrix",
            wanted: "that of normal equations",
            value: f64::NAN,
        })?;
        let hyper = Hyper {
            noise: parts.noise,
            wander: parts.wander,
            spread: parts.spread,
        };
        let empty = Belief::of_field(shape, &hyper.spread, &hyper.rates());
        let heliostats = parts
            .heliostats
            .into_iter()
            .map(|h| h.followed(&empty))
            .collect::<Result<_, _>>()?;
        Ok(Self {
            noise: hyper.noise,
            wander: hyper.wander,
            mishaps: parts.mishaps,
            alarm: parts.alarm,
            site_latitude_rad: parts.site_latitude_rad,
            structure,
            prior_sigma: parts.prior_sigma,
            spread: hyper.spread,
            told,
            common,
            watch: parts.watch,
            heliostats,
        })
    }
}

/// Refuses what is not as it must be.
pub(super) fn demand(
    what: &'static str,
    holds: bool,
    wanted: &'static str,
    value: f64,
) -> Result<(), CalibrationError> {
    if holds {
        return Ok(());
    }
    Err(CalibrationError::BadOption {
        what,
        wanted,
        value,
    })
}

pub(super) fn finite(what: &'static str, value: f64) -> Result<(), CalibrationError> {
    demand(what, value.is_finite(), "finite", value)
}

fn not_negative(what: &'static str, value: f64) -> Result<(), CalibrationError> {
    let holds = value.is_finite() && value >= 0.0;
    demand(what, holds, "finite and not negative", value)
}

pub(super) fn positive(what: &'static str, value: f64) -> Result<(), CalibrationError> {
    let holds = value.is_finite() && value > 0.0;
    demand(what, holds, "finite and above 0", value)
}

fn share(what: &'static str, value: f64) -> Result<(), CalibrationError> {
    demand(what, (0.0..=1.0).contains(&value), "within 0 to 1", value)
}

fn check_diagonal(
    what: &'static str,
    triangle: &[f64],
    length: usize,
) -> Result<(), CalibrationError> {
    (0..length).try_for_each(|i| not_negative(what, triangle[at(i, i)]))
}

fn check_watch(watch: &Watch, heliostats: usize) -> Result<(), CalibrationError> {
    let days = watch.spells.iter().flat_map(|spell| &spell.days);
    for &day in watch.days.iter().chain(days) {
        finite("watch.days", day)?;
    }
    let middles = watch.spells.iter().map(|spell| &spell.middle);
    for &square in watch.waiting.values().chain(middles) {
        not_negative("chi-squared of the watch", square)?;
    }
    for &place in watch.waiting.keys() {
        let holds = place < heliostats;
        demand(
            "watch.waiting",
            holds,
            "one of the heliostats",
            place as f64,
        )?;
    }
    Ok(())
}

fn check_axis(axis: usize) -> Result<(), CalibrationError> {
    demand("axis of a jump", axis < 2, "0 or 1", axis as f64)
}

pub(super) fn check_latitude(latitude_rad: f64) -> Result<(), CalibrationError> {
    let holds = latitude_rad.abs() <= core::f64::consts::FRAC_PI_2;
    demand("site_latitude_rad", holds, "within ±π/2", latitude_rad)
}

pub(super) fn check_mishaps(mishaps: &Mishaps) -> Result<(), CalibrationError> {
    not_negative("mishaps.outlier", mishaps.outlier)?;
    not_negative("mishaps.jump", mishaps.jump)?;
    let sum = mishaps.outlier + mishaps.jump;
    demand("mishaps.outlier + mishaps.jump", sum < 1.0, "below 1", sum)?;
    positive("mishaps.outlier_mrad", mishaps.outlier_mrad)?;
    positive("mishaps.jump_mrad", mishaps.jump_mrad)
}

fn check_rates(noise: &Noise, wander: &Wander) -> Result<(), CalibrationError> {
    // without it a record could be exact
    positive("noise.beam_mrad", noise.beam_mrad)?;
    not_negative("noise.spot_m", noise.spot_m)?;
    not_negative("noise.sun_path_s", noise.sun_path_s)?;
    for mrad in wander.slow_mrad {
        not_negative("wander.slow_mrad", mrad)?;
    }
    for mrad in wander.fast_mrad {
        not_negative("wander.fast_mrad", mrad)?;
    }
    positive("wander.slow_days", wander.slow_days)?;
    positive("wander.fast_days", wander.fast_days)
}

fn check(what: &'static str, numbers: &[f64], length: usize) -> Result<(), CalibrationError> {
    if numbers.len() != length {
        return Err(CalibrationError::BadOption {
            what,
            wanted: "as long as the unknowns of the state ask for",
            value: numbers.len() as f64,
        });
    }
    match numbers.iter().find(|x| !x.is_finite()) {
        Some(&value) => Err(CalibrationError::BadOption {
            what,
            wanted: "finite",
            value,
        }),
        None => Ok(()),
    }
}

impl HeliostatParts {
    fn of(followed: &Followed) -> Self {
        followed.with(followed.accounts.iter().map(AccountParts::of).collect())
    }

    fn followed(mut self, empty: &Belief<f64>) -> Result<Followed, CalibrationError> {
        for &day in self.last_day.iter().chain(&self.undecided) {
            finite("day of a record", day)?;
        }
        for jump in &self.jumps {
            finite("day of a jump", jump.day)?;
            check_axis(jump.axis)?;
        }
        let undecided = self.undecided.len();
        let accounts: Vec<Account> = core::mem::take(&mut self.accounts)
            .into_iter()
            .map(|account| account.account(empty, undecided))
            .collect::<Result<_, _>>()?;
        if accounts.is_empty() {
            return Err(CalibrationError::BadOption {
                what: "accounts",
                wanted: "at least one a heliostat",
                value: 0.0,
            });
        }
        Ok(self.with(accounts))
    }
}

impl AccountParts {
    fn of(account: &Account) -> Self {
        let belief = &account.belief;
        let nothing = account.told.square == 0.0 && account.told.vector.iter().all(|x| *x == 0.0);
        let (matrix, vector) = if nothing {
            (Vec::new(), Vec::new())
        } else {
            (account.told.matrix.clone(), account.told.vector.clone())
        };
        Self {
            log_likelihood: account.log_likelihood,
            drift: account.drift.mean,
            drift_variance: account.drift.variance,
            unbelieved: account.drift.unbelieved,
            lately: account.lately,
            mean: belief.mean.clone(),
            gain: belief.gain_by_rows(),
            spread: belief.triangle(),
            matrix,
            vector,
            square: account.told.square,
            outliers: account.marks.outliers.clone(),
            jumps: account.marks.jumps.clone(),
        }
    }

    fn account(self, empty: &Belief<f64>, undecided: usize) -> Result<Account, CalibrationError> {
        let shape = empty.shape;
        let (own, common) = (shape.own(), shape.common());
        check("mean", &self.mean, own)?;
        check("gain", &self.gain, own * common)?;
        check("spread", &self.spread, Shape::triangle(own))?;
        check_diagonal("variance in spread", &self.spread, own)?;
        finite("log_likelihood", self.log_likelihood)?;
        finite("square", self.square)?;
        for drift in self.drift {
            finite("drift", drift)?;
        }
        not_negative("drift_variance", self.drift_variance)?;
        for &(_, axis) in &self.jumps {
            check_axis(axis)?;
        }
        not_negative("lately.odd", self.lately.odd)?;
        not_negative("lately.records", self.lately.records)?;
        let belief = Belief::of_parts(shape, self.mean, &self.gain, &self.spread);
        let mut account = Account::new(belief);
        account.log_likelihood = self.log_likelihood;
        account.drift = Drift {
            mean: self.drift,
            variance: self.drift_variance,
            unbelieved: self.unbelieved,
        };
        account.lately = self.lately;
        if !(self.matrix.is_empty() && self.vector.is_empty()) {
            check("matrix", &self.matrix, Shape::triangle(common))?;
            check("vector", &self.vector, common)?;
            check_diagonal("diagonal of matrix", &self.matrix, common)?;
            account.told.matrix = self.matrix;
            account.told.vector = self.vector;
            account.told.square = self.square;
        }
        let marked = self
            .outliers
            .iter()
            .chain(self.jumps.iter().map(|(k, _)| k));
        if let Some(&beyond) = marked.clone().find(|k| **k >= undecided) {
            return Err(CalibrationError::BadOption {
                what: "record in doubt",
                wanted: "one of those undecided",
                value: beyond as f64,
            });
        }
        account.marks = Marks {
            outliers: self.outliers,
            jumps: self.jumps,
        };
        Ok(account)
    }
}
