//! The calibration follows the plant: records one after the other, in bounded memory.

use std::borrow::Cow;
use std::collections::BTreeSet;

use helio_core::{Enu, PoseErrors};
use rayon::prelude::*;

use super::belief::{Belief, REFERENCES, Shape, Told, at, column};
use super::common::{Common, Sum};
use super::foretell::{Foretold, foretold, later, references, shared_values, zero_points};
use super::going::{Going, Progress};
use super::hyper::{Hyper, Marks, Noise, Wander, waited};
use super::hypotheses::{Account, Mishaps, decide, told_by};
use super::rows::{ANGLES, Expansion, MILLI, Rows, Structure, filter_unit, parameters, pole};
use super::terms::{AxisCause, Cause, SpotCause};
use super::watch::{ALARMING, Lately, Spell, Watch, Witness, moves_on, too_late, unfit};
use super::{CommonCause, History, JointFit, NO_TARGET, WANDERING, is_free};
use crate::error::{CalibrationError, in_place};
use crate::field::Campaign;
use crate::parameters::Parameters;

/// When a heliostat's drift is worth an alarm.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Alarm {
    /// Share of the records of a heliostat that does what the model says which raise an alarm all the same.
    pub false_alarm_rate: f64,
    /// What a record counts in the running mean of misses, 0 to 1: less sees smaller drifts, later.
    pub weight: f64,
}

impl Default for Alarm {
    /// One false alarm in a thousand records; a memory of about ten records.
    fn default() -> Self {
        Self {
            false_alarm_rate: 1e-3,
            weight: 0.1,
        }
    }
}

impl Alarm {
    /// Squared length of a standardised running mean that is an alarm: chi-squared with two degrees of freedom.
    #[must_use]
    pub fn threshold(&self) -> f64 {
        -2.0 * libm::log(self.false_alarm_rate)
    }
}

/// A jump of a zero point.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct JumpSeen {
    /// Time of the first record after it \[days since 1970\].
    pub day: f64,
    /// Of the first (0) or second (1) axis.
    pub axis: usize,
}

/// Jumps that are remembered of a heliostat.
const JUMPS_KEPT: usize = 16;

fn last_jumps(mut jumps: Vec<JumpSeen>) -> Vec<JumpSeen> {
    jumps.drain(..jumps.len().saturating_sub(JUMPS_KEPT));
    jumps
}

/// Which of the [`PoseErrors`] a cause is.
fn pose_error(cause: AxisCause) -> usize {
    match cause {
        AxisCause::Axis1Sag => 0,
        AxisCause::Axis2Sag => 1,
        AxisCause::Axis2Eccentricity => 2,
    }
}

/// Records in doubt of a heliostat at most: then its likeliest account is believed.
const MOST_UNDECIDED: usize = 60;
/// Records of a heliostat that are taken in before it is asked whether to go on.
const ASKED_EVERY: usize = 16;
/// Records are made linear anew where the heliostat is now thought to be farther from where they were than this
/// \[rad\].
const MOVED_RAD: f64 = 1e-3;

/// A heliostat that is followed; accounts as the state holds them, or as plain numbers ([`HeliostatParts`]).
///
/// [`HeliostatParts`]: super::HeliostatParts
#[derive(Debug, Clone, PartialEq)]
pub struct Followed<A = Account> {
    /// Its name.
    pub id: String,
    /// Its last record \[days since 1970\], but for those not believed that are a month or more after those that are.
    pub last_day: Option<f64>,
    /// Records so far.
    pub records: u64,
    /// Those of them whose beam should not have met the target, or that tell nothing for another reason.
    pub misses: u64,
    /// Those of them that were not believed.
    pub outliers: u64,
    /// Jumps of a zero point so far that are certain.
    pub jump_count: u64,
    /// The last of them, in time.
    pub jumps: Vec<JumpSeen>,
    /// What may have happened, likeliest first; at least one.
    pub accounts: Vec<A>,
    /// Days of the records that are still in doubt \[since 1970\], and of those that are not believed and a month or more
    /// after the last one.
    pub undecided: Vec<f64>,
}

/// Records of a heliostat are one where their times differ by less: ten milliseconds \[days\].
const SAME_DAY: f64 = 1e-7;

fn same_day(one: f64, other: f64) -> bool {
    (one - other).abs() < SAME_DAY
}

impl<A> Followed<A> {
    /// Whether a record of a day \[since 1970\] is one of those in doubt.
    fn knows(&self, day: f64) -> bool {
        self.undecided.iter().any(|known| same_day(*known, day))
    }

    /// Whether a record of a day \[since 1970\] is taken in already: none comes before the last one, and one that was not
    /// believed and is much later than the others is known too.
    #[must_use]
    pub fn has_taken(&self, day: f64) -> bool {
        self.last_day.is_some_and(|last| day <= last) || self.knows(day)
    }

    /// The same with its accounts in another form.
    pub(super) fn with<B>(&self, accounts: Vec<B>) -> Followed<B> {
        Followed {
            id: self.id.clone(),
            last_day: self.last_day,
            records: self.records,
            misses: self.misses,
            outliers: self.outliers,
            jump_count: self.jump_count,
            jumps: self.jumps.clone(),
            accounts,
            undecided: self.undecided.clone(),
        }
    }
}

/// What became of a record.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum StepKind {
    /// Believed.
    Believed,
    /// Taken for an outlier, at least for now.
    Outlier,
    /// The zero point of the first axis, of the second, or of both is taken to have jumped before it, at least for now.
    Jump([bool; 2]),
    /// Its beam does not meet the target: it tells nothing.
    Misses,
}

impl StepKind {
    /// The word for columns.
    #[must_use]
    pub const fn as_str(self) -> &'static str {
        match self {
            Self::Believed => "believed",
            Self::Outlier => "outlier",
            Self::Jump([true, true]) => "jump_axes",
            Self::Jump([true, false]) => "jump_axis1",
            Self::Jump(_) => "jump_axis2",
            Self::Misses => "misses_target",
        }
    }
}

/// A record on its way into the state.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Step {
    /// Which observation of its campaign.
    pub observation: usize,
    /// How it had been foretold.
    pub foretold: Foretold,
    /// What became of it.
    pub kind: StepKind,
    /// References of either axis as known after it, zero points included \[rad\].
    pub references_rad: [f64; 2],
    /// One standard deviation of them \[rad\].
    pub references_sigma_rad: [f64; 2],
    /// Whether the running mean of misses is an alarm after it, or it is one of those [in a row](Self::unbelieved).
    pub alarm: bool,
    /// Whether it is the third record in a row, or a later one, that is not believed or misses its target.
    pub unbelieved: bool,
}

/// All that is known of a field that is followed: bounded, whatever the number of records.
///
/// What is common to the field is known as normal equations; each heliostat as a linear function of it, under
/// every account of its last doubtful records that is not yet given up.
#[derive(Debug, Clone, PartialEq)]
pub struct FieldState {
    /// How records scatter.
    pub noise: Noise,
    /// How zero points wander.
    pub wander: Wander,
    /// How often things go wrong.
    pub mishaps: Mishaps,
    /// When a drift is worth an alarm.
    pub alarm: Alarm,
    /// Latitude of the site \[rad\].
    pub site_latitude_rad: f64,
    pub(super) structure: Structure,
    pub(super) prior_sigma: Vec<f64>,
    pub(super) spread: Vec<f64>,
    pub(super) told: Sum,
    pub(super) common: Common,
    pub(super) watch: Watch,
    pub(super) heliostats: Vec<Followed>,
}

/// What is known of a heliostat now.
#[derive(Debug, Clone, PartialEq)]
pub struct Known {
    /// Six angles at the time asked for \[rad\], zero points included, then causes of its own \[rad\].
    pub values: Vec<f64>,
    /// Covariance of the six angles and own causes \[rad²\], row by row.
    pub covariance: Vec<f64>,
    /// Zero points of either axis less those at rest \[rad\].
    pub zero_rad: [f64; 2],
    /// One standard deviation of them \[rad\].
    pub zero_sigma_rad: [f64; 2],
    /// What its mount's pose errors are found to be, of its own and of the field; zero where not admitted.
    pub pose_errors: PoseErrors,
    /// One standard deviation of them \[rad\], in the order of [`PoseErrors`].
    pub pose_sigmas_rad: [f64; 3],
}

impl Known {
    /// As parameters of a mount.
    #[must_use]
    pub fn parameters(&self, mirror_offset_m: f64) -> Parameters {
        parameters(&self.values, mirror_offset_m)
    }
}

impl JointFit {
    /// Goes on from here record by record; `ids` name the heliostats in the order of the campaigns.
    ///
    /// # Errors
    /// [`CalibrationError::BadOption`] if their number is another.
    pub fn follow(&self, ids: &[String]) -> Result<FieldState, CalibrationError> {
        if ids.len() != self.heliostats.len() {
            return Err(CalibrationError::BadOption {
                what: "ids",
                wanted: "one for each heliostat of the fit",
                value: ids.len() as f64,
            });
        }
        let heliostats = ids
            .iter()
            .zip(&self.heliostats)
            .enumerate()
            .map(|(k, (id, posterior))| {
                let (accounts, mut undecided) = match self.open.get(&k) {
                    Some(open) => (open.accounts.clone(), open.days.clone()),
                    None => {
                        let mut account = Account::new(self.belief(k));
                        account.drift.unbelieved = posterior.unbelieved_last;
                        account.lately = posterior.lately;
                        (vec![account], Vec::new())
                    }
                };
                for &day in self.aside.get(&k).into_iter().flatten() {
                    if !undecided.iter().any(|known| same_day(*known, day)) {
                        undecided.push(day);
                    }
                }
                // those in doubt are the likeliest account's to count
                let in_doubt = accounts.first().map(|account| &account.marks);
                let [outliers, jumps] =
                    in_doubt.map_or([0; 2], |marks| [marks.outliers.len(), marks.jumps.len()]);
                let outliers = posterior.outliers.len() - outliers;
                let certain = &posterior.jumps[..posterior.jumps.len() - jumps];
                Followed {
                    id: id.clone(),
                    last_day: posterior.last_day,
                    records: posterior.records as u64,
                    misses: posterior.misses.len() as u64,
                    outliers: outliers as u64,
                    jump_count: certain.len() as u64,
                    jumps: last_jumps(certain.iter().map(|(_, jump)| *jump).collect()),
                    accounts,
                    undecided,
                }
            })
            .collect();
        Ok(FieldState {
            noise: self.noise,
            wander: self.wander,
            mishaps: self.mishaps,
            alarm: Alarm::default(),
            site_latitude_rad: self.site_latitude_rad,
            structure: self.structure.clone(),
            prior_sigma: self.prior_sigma.clone(),
            spread: self.hyper.spread.clone(),
            told: self.told.clone(),
            common: self.common.clone(),
            watch: Watch::default(),
            heliostats,
        })
    }
}

impl FieldState {
    /// The heliostats, in the order in which they came.
    #[must_use]
    pub fn heliostats(&self) -> &[Followed] {
        &self.heliostats
    }

    /// The last day of the field \[days since 1970\]: that of its heliostats, but for few that are
    /// [too late](super::too_late). None before any record.
    #[must_use]
    pub fn last_day(&self) -> Option<f64> {
        let days: Vec<f64> = self.heliostats.iter().filter_map(|h| h.last_day).collect();
        let late = too_late(&days);
        days.into_iter().filter(|day| *day <= late).reduce(f64::max)
    }

    /// Where a heliostat stands.
    #[must_use]
    pub fn position(&self, id: &str) -> Option<usize> {
        self.heliostats.iter().position(|h| h.id == id)
    }

    pub(super) fn hyper(&self) -> Hyper {
        Hyper {
            noise: self.noise,
            wander: self.wander,
            spread: self.spread.clone(),
        }
    }

    /// A heliostat without records: it is as the field is.
    pub fn add(&mut self, id: &str) -> usize {
        let belief = Belief::of_field(self.structure.shape(), &self.spread, &self.hyper().rates());
        self.heliostats.push(Followed {
            id: id.to_owned(),
            last_day: None,
            records: 0,
            misses: 0,
            outliers: 0,
            jump_count: 0,
            jumps: Vec::new(),
            accounts: vec![Account::new(belief)],
            undecided: Vec::new(),
        });
        self.heliostats.len() - 1
    }

    /// Makes room for a target of which no record has been taken in: its shifts are as unknown as those of every target
    /// before any record, and are learnt from those to come. [`update`](Self::update) does so by itself; what is
    /// foretold before it of records on such a target otherwise takes it to be where it was surveyed. Nothing happens
    /// where the state has the target, or asks for shifts of none.
    pub fn add_target(&mut self, target: usize) {
        let known = |of: &dyn Fn(Cause) -> bool| self.structure.shared.iter().any(|&c| of(c));
        if target == NO_TARGET || known(&|cause| cause.target() == Some(target)) {
            return;
        }
        let of_targets =
            |cause: SpotCause| known(&|c| matches!(c, Cause::Target(other, _) if other == cause));
        let new: Vec<Cause> = SpotCause::ALL
            .iter()
            .filter(|&&cause| of_targets(cause))
            .filter_map(|cause| cause.of(Some(target)))
            .collect();
        for cause in new {
            self.structure.shared.push(cause);
            self.prior_sigma
                .push(cause.description().expected * filter_unit(cause));
        }
        let shape = self.structure.shape();
        self.told.told.grow(shape);
        self.common.grow(&self.prior_sigma);
        // as a state that is read back has it, to the last bit
        if let Some(common) = Common::new(&self.told, &self.prior_sigma) {
            self.common = common;
        }
        for account in self.heliostats.iter_mut().flat_map(|h| &mut h.accounts) {
            account.belief.grow(shape);
            account.told.grow(shape);
        }
    }

    /// Takes in new records: of each campaign the heliostat's place and its observations. Each heliostat's are
    /// taken in time; one older than its last record counts as made then. What is common is learnt anew after
    /// all of them, from every heliostat whose records leave no doubt.
    ///
    /// The same records in the same calls give the same bits, whatever the number of threads.
    ///
    /// # Errors
    /// [`CalibrationError::NoSuchHeliostat`] if a place is not one of [`heliostats`](Self::heliostats),
    /// [`CalibrationError::BadOption`] if it stands twice.
    pub fn update(
        &mut self,
        campaigns: &[(usize, Campaign<'_>)],
    ) -> Result<Vec<Vec<Step>>, CalibrationError> {
        self.update_watched(campaigns, &|_, _| true)
    }

    /// [`update`](Self::update), watched: it tells how far it is, and ends early when it is told to. Of a state whose
    /// update was stopped nobody knows what it has taken in: it is to be given up.
    ///
    /// # Errors
    /// Those of [`update`](Self::update), and [`CalibrationError::Stopped`].
    pub fn update_watched(
        &mut self,
        campaigns: &[(usize, Campaign<'_>)],
        progress: Progress<'_>,
    ) -> Result<Vec<Vec<Step>>, CalibrationError> {
        let mut asked: Vec<Option<usize>> = vec![None; self.heliostats.len()];
        for (n, &(place, _)) in campaigns.iter().enumerate() {
            if in_place(&asked, "place", place)?.is_some() {
                return Err(CalibrationError::BadOption {
                    what: "place",
                    wanted: "stated once",
                    value: place as f64,
                });
            }
            asked[place] = Some(n);
        }
        let targets: BTreeSet<usize> = campaigns
            .iter()
            .flat_map(|(_, campaign)| campaign.observations)
            .map(|observation| observation.target)
            .collect();
        for target in targets {
            self.add_target(target);
        }
        let rates = self.hyper().rates();
        let going = Going::new(progress, campaigns.len());
        let context = Context {
            going: &going,
            structure: &self.structure,
            shape: self.structure.shape(),
            rates: &rates,
            mishaps: &self.mishaps,
            alarm: &self.alarm,
            common: &self.common,
            shared: shared_values(&self.structure, &self.common),
            pole: pole(self.site_latitude_rad),
        };
        let done: Vec<(usize, Taken)> = self
            .heliostats
            .par_iter_mut()
            .zip(&asked)
            .enumerate()
            .filter_map(|(place, (heliostat, asked))| {
                let n = (*asked)?;
                Some((n, heliostat.take_in(&context, place, &campaigns[n].1)))
            })
            .collect();
        going.check()?;
        let mut steps = vec![Vec::new(); campaigns.len()];
        let mut witnesses = Vec::new();
        for (n, taken) in done {
            steps[n] = taken.steps;
            witnesses.extend(taken.witnesses);
            if let Some(told) = taken.told {
                self.told.add(&told);
            }
        }
        self.watch.take(witnesses);
        if let Some(common) = Common::new(&self.told, &self.prior_sigma) {
            self.common = common;
        }
        Ok(steps)
    }

    /// Holds the field as a whole against what was foretold, from how the records that a fit used had been, heliostat by
    /// heliostat in the order of the state: once, before anything is taken in. [`update`](Self::update) goes on by
    /// itself.
    pub fn look_back(&mut self, histories: &[Vec<History>]) {
        let mut witnesses = Vec::new();
        for (place, history) in histories.iter().enumerate() {
            let (mut lately, mut odd, mut in_a_row) = (Lately::default(), 0, 0);
            for (records, one) in history.iter().enumerate() {
                let square = one.foretold.square();
                let missed = one.outlier || square.is_nan();
                let jumps = one.jumped.into_iter().filter(|it| *it).count();
                if !lately.unexplained(records as u64, odd, in_a_row) {
                    witnesses.push(Witness {
                        day: one.day,
                        place,
                        square: (!missed && jumps == 0).then_some(square),
                    });
                }
                let count = if missed { 1 } else { jumps };
                lately.count(count);
                odd += count as u64;
                in_a_row = if missed { in_a_row + 1 } else { 0 };
            }
        }
        self.watch.take(witnesses);
    }

    /// When the field as a whole did not do what was foretold of it, in time: the middle heliostat of eight or more
    /// missed by far more than expected. A clock, a target, a tracking table or a camera is then likelier to be wrong
    /// than each heliostat.
    #[must_use]
    pub fn spells(&self) -> Vec<Spell> {
        self.watch.spells()
    }

    /// Holds observations of a heliostat against what is foretold of them, without taking them in; in their
    /// order.
    ///
    /// # Errors
    /// [`CalibrationError::NoSuchHeliostat`] if there is no heliostat in that place.
    pub fn foretell(
        &self,
        place: usize,
        campaign: &Campaign<'_>,
    ) -> Result<Vec<Foretold>, CalibrationError> {
        let shape = self.structure.shape();
        let heliostat = in_place(&self.heliostats, "place", place)?;
        let belief = heliostat.belief(&self.common);
        let rates = self.hyper().rates();
        let at = Expansion {
            still: self.common.mean_of(&belief)[..shape.still]
                .iter()
                .map(|x| x / MILLI)
                .collect(),
            shared: shared_values(&self.structure, &self.common),
        };
        let rows = Rows::of(&self.structure, campaign, &at, pole(self.site_latitude_rad));
        let last = heliostat.last_day;
        Ok(later(&belief, last, &rows, &rates, &self.common))
    }

    /// What a heliostat is believed to be at a time \[days since 1970\], not before its last record.
    pub(super) fn belief_at(
        &self,
        place: usize,
        day: f64,
    ) -> Result<Belief<f64>, CalibrationError> {
        let heliostat = in_place(&self.heliostats, "place", place)?;
        let mut belief = heliostat.belief(&self.common).into_owned();
        if let Some(last) = heliostat.last_day {
            let (kept, added) = waited(&self.hyper().rates(), day - last);
            belief.wait(kept, added);
        }
        Ok(belief)
    }

    /// What is known of a heliostat at a time \[days since 1970\], not before its last record.
    ///
    /// # Errors
    /// [`CalibrationError::NoSuchHeliostat`] if there is no heliostat in that place.
    pub fn known(&self, place: usize, day: f64) -> Result<Known, CalibrationError> {
        let belief = self.belief_at(place, day)?;
        let shape = belief.shape;
        let (own, still) = (shape.own(), shape.still);
        let mean = self.common.mean_of(&belief);
        let covariance = self.common.covariance_of(&belief);
        let [zero_rad, zero_sigma_rad] = zero_points(&belief, &self.common);
        let members = |i: usize| -> Vec<usize> {
            let zeros = REFERENCES.iter().position(|&r| r == i);
            core::iter::once(i)
                .chain(
                    zeros
                        .into_iter()
                        .flat_map(|axis| (axis..WANDERING).step_by(2).map(move |k| still + k)),
                )
                .collect()
        };
        let values: Vec<f64> = (0..still)
            .map(|i| members(i).iter().map(|&k| mean[k]).sum::<f64>() / MILLI)
            .collect();
        let mut out = vec![0.0; still * still];
        for i in 0..still {
            for j in 0..still {
                for k in members(i) {
                    for l in members(j) {
                        out[i * still + j] += covariance[k * own + l] / (MILLI * MILLI);
                    }
                }
            }
        }
        let mut pose_errors = [(0.0, 0.0); 3];
        for (k, cause) in self.axis_causes() {
            if is_free(self.prior_sigma[k]) {
                pose_errors[pose_error(cause)] = if k < still {
                    (values[k], libm::sqrt(out[k * still + k].max(0.0)))
                } else {
                    (self.common.mean[k] / MILLI, self.common.sigma(k) / MILLI)
                };
            }
        }
        Ok(Known {
            values,
            covariance: out,
            zero_rad,
            zero_sigma_rad,
            pose_errors: PoseErrors::from_array(pose_errors.map(|(value, _)| value)),
            pose_sigmas_rad: pose_errors.map(|(_, sigma)| sigma),
        })
    }

    /// Six angles at rest and causes of its own of a heliostat \[rad\], and one standard deviation of each.
    ///
    /// # Errors
    /// [`CalibrationError::NoSuchHeliostat`] if there is no heliostat in that place.
    pub fn at_rest(&self, place: usize) -> Result<(Vec<f64>, Vec<f64>), CalibrationError> {
        let belief = &*in_place(&self.heliostats, "place", place)?.belief(&self.common);
        let (own, still) = (belief.shape.own(), belief.shape.still);
        let covariance = self.common.covariance_of(belief);
        let sigma = |i: usize| libm::sqrt(covariance[i * own + i].max(0.0)) / MILLI;
        let mean = self.common.mean_of(belief);
        let values = mean[..still].iter().map(|x| x / MILLI).collect();
        Ok((values, (0..still).map(sigma).collect()))
    }

    /// Mean of heliostats' own unknowns at rest \[rad\], six angles and then causes of their own.
    #[must_use]
    pub fn field_mean(&self) -> Vec<f64> {
        let still = self.structure.shape().still;
        self.common.mean[..still]
            .iter()
            .map(|x| x / MILLI)
            .collect()
    }

    /// Their covariance over the field \[rad²\], row by row, as the joint fit found it.
    #[must_use]
    pub fn field_covariance(&self) -> Vec<f64> {
        let still = self.structure.shape().still;
        (0..still * still)
            .map(|k| {
                let (i, j) = (k / still, k % still);
                self.spread[at(i.max(j), i.min(j))] / (MILLI * MILLI)
            })
            .collect()
    }

    /// Causes that turn axes, each with its place among the common unknowns.
    fn axis_causes(&self) -> impl Iterator<Item = (usize, AxisCause)> {
        let own = self.structure.own.iter().enumerate();
        let still = self.structure.shape().still;
        let shared = self.structure.shared.iter().enumerate();
        own.map(|(k, &cause)| (ANGLES + k, cause))
            .chain(shared.filter_map(move |(k, &cause)| match cause {
                Cause::Axis(cause) => Some((still + k, cause)),
                _ => None,
            }))
    }

    /// The causes in common as now known: those of each heliostat first.
    #[must_use]
    pub fn causes(&self) -> Vec<CommonCause> {
        let still = self.structure.shape().still;
        let own = self.structure.own.iter().map(|&cause| Cause::Axis(cause));
        own.chain(self.structure.shared.iter().copied())
            .enumerate()
            .map(|(k, cause)| {
                let (k, unit) = (ANGLES + k, filter_unit(cause));
                let admitted = is_free(self.prior_sigma[k]);
                let only_if = |value: f64| if admitted { value } else { 0.0 };
                CommonCause {
                    cause,
                    value: only_if(self.common.mean[k] / unit),
                    sigma: if admitted {
                        self.common.sigma(k) / unit
                    } else {
                        f64::NAN
                    },
                    spread: if k < still {
                        only_if(libm::sqrt(self.spread[at(k, k)]) / unit)
                    } else {
                        0.0
                    },
                    log_evidence: f64::NAN,
                    admitted,
                }
            })
            .collect()
    }
}

/// Records of a heliostat that were taken in.
struct Taken {
    steps: Vec<Step>,
    /// By which the field is judged.
    witnesses: Vec<Witness>,
    /// What they tell of what is common.
    told: Option<Sum>,
}

struct Context<'a> {
    going: &'a Going<'a>,
    structure: &'a Structure,
    shape: Shape,
    rates: &'a super::belief::Rates,
    mishaps: &'a Mishaps,
    alarm: &'a Alarm,
    common: &'a Common,
    shared: Vec<f64>,
    pole: Enu,
}

impl Followed {
    /// Records at the end that are not believed or miss their targets, one after the other: more than one or two are no
    /// accident.
    #[must_use]
    pub fn unbelieved_last(&self) -> usize {
        self.accounts.first().map_or(0, |a| a.drift.unbelieved)
    }

    /// Records so far that are not believed, those in doubt as the likeliest account has them.
    #[must_use]
    pub fn unbelieved(&self) -> u64 {
        let in_doubt = self.accounts.first().map_or(0, |a| a.marks.outliers.len());
        self.outliers + in_doubt as u64
    }

    /// How many of its last records do not fit the others, as the likeliest account has it.
    #[must_use]
    pub fn lately(&self) -> Lately {
        self.accounts
            .first()
            .map_or_else(Lately::default, |a| a.lately)
    }

    /// Records that are not believed, miss their target or come after a jump.
    fn odd(&self) -> u64 {
        let in_doubt = self.accounts.first().map_or(0, |a| a.marks.jumps.len());
        self.unbelieved() + self.misses + self.jump_count + in_doubt as u64
    }

    /// Whether so many of its records do not fit the others, or only after a jump, that it says nothing of what is common:
    /// more than a quarter of all or of the last ones.
    #[must_use]
    pub fn unfit(&self) -> bool {
        unfit(self.records, self.odd(), &self.lately())
    }

    /// Whether what is known of it should not be believed now: more than a quarter of its last records, of eight or
    /// more, are odd ([`Lately`]); or more than a quarter of all and an eighth of the last; or the last three or more are
    /// not believed or miss their targets.
    #[must_use]
    pub fn unexplained(&self) -> bool {
        let lately = self.lately();
        lately.unexplained(self.records, self.odd(), self.unbelieved_last())
    }

    /// Records that are believed, those in doubt as the likeliest account has them.
    #[must_use]
    pub fn believed(&self) -> u64 {
        self.records.saturating_sub(self.unbelieved() + self.misses)
    }

    /// Takes in records; what they tell of what is common once no doubt is left.
    fn take_in(&mut self, context: &Context<'_>, place: usize, campaign: &Campaign<'_>) -> Taken {
        let shape = context.shape;
        let rest = shape.row() - column::REST;
        let mut settled: Option<Sum> = None;
        let timed = campaign.observations.iter().any(|o| o.unix_ns.is_some());
        let mut at = self.place(context);
        let mut rows = Rows::of(context.structure, campaign, &at, context.pole);
        let mut steps = Vec::with_capacity(rows.len());
        let mut witnesses = Vec::with_capacity(rows.len());
        for k in 0..rows.len() {
            if k % ASKED_EVERY == 0 && !context.going.is_on() {
                break;
            }
            let understood = !self.unexplained();
            let here = self.place(context);
            let moved = here.still.iter().zip(&at.still);
            if moved
                .map(|(a, b)| (a - b).abs())
                .fold(0.0, f64::max)
                .gt(&MOVED_RAD)
            {
                at = here;
                rows = Rows::of(context.structure, campaign, &at, context.pole);
            }
            let row = rows.row(shape, k);
            let day = rows.days[k];
            let days = self.last_day.map_or(0.0, |last| (day - last).max(0.0));
            let (kept, added) = waited(context.rates, days);
            if days > 0.0 {
                for account in &mut self.accounts {
                    account.belief.wait(kept, added);
                }
            }
            self.records += 1;
            let before = self.belief(context.common);
            let before = foretold(shape, row, context.rates, &before, context.common);
            let mut kind = StepKind::Misses;
            if row[rest + column::SILENT] != 0.0 {
                self.misses += 1;
                for account in &mut self.accounts {
                    account.unbelieved();
                }
            }
            if row[rest + column::SILENT] == 0.0 {
                let number = self.undecided.len();
                self.undecided.push(day);
                self.accounts = told_by(
                    core::mem::take(&mut self.accounts),
                    number,
                    row,
                    context.rates,
                    context.mishaps,
                    context.common,
                    context.alarm.weight,
                );
                let marks = &self.accounts[0].marks;
                kind = if marks.outliers.last() == Some(&number) {
                    StepKind::Outlier
                } else {
                    match [0, 1].map(|axis| marks.jumps.contains(&(number, axis))) {
                        [false, false] => StepKind::Believed,
                        axes => StepKind::Jump(axes),
                    }
                };
                decide(&mut self.accounts, number);
                if self.undecided.len() >= MOST_UNDECIDED {
                    self.accounts.truncate(1);
                }
                let aside = self.set_aside(day);
                if let Some(told) = self.settle(shape) {
                    settled
                        .get_or_insert_with(|| Sum::nothing(shape))
                        .add(&told);
                }
                if self.undecided.is_empty() {
                    self.undecided = aside;
                }
            }
            let believed = !matches!(kind, StepKind::Outlier | StepKind::Misses);
            if timed {
                self.last_day = moves_on(self.last_day, day, believed);
                if !believed && self.last_day.is_some_and(|last| last < day) && !self.knows(day) {
                    self.undecided.push(day);
                }
            }
            if understood {
                witnesses.push(Witness {
                    day,
                    place,
                    square: (kind == StepKind::Believed).then(|| before.square()),
                });
            }
            let [references_rad, references_sigma_rad] =
                references(&self.belief(context.common), context.common);
            let unbelieved = self.unbelieved_last() >= ALARMING;
            steps.push(Step {
                observation: rows.of[k],
                foretold: before,
                kind,
                references_rad,
                references_sigma_rad,
                alarm: unbelieved || self.accounts[0].drift.square() > context.alarm.threshold(),
                unbelieved,
            });
        }
        context.going.on_after(1);
        Taken {
            steps,
            witnesses,
            told: settled,
        }
    }

    /// Where its records are made linear.
    fn place(&self, context: &Context<'_>) -> Expansion {
        let mean = context.common.mean_of(&self.belief(context.common));
        Expansion {
            still: mean[..context.shape.still]
                .iter()
                .map(|x| x / MILLI)
                .collect(),
            shared: context.shared.clone(),
        }
    }

    /// What is believed under all accounts together, by their likelihood: with its mean and its covariance.
    pub(super) fn belief(&self, common: &Common) -> Cow<'_, Belief<f64>> {
        mixture_of(&self.accounts, common)
    }

    /// Days of records that are not believed and much later than those that are, but for that of this day: they are kept,
    /// so that nobody takes them in again.
    fn set_aside(&self, day: f64) -> Vec<f64> {
        let days = self.undecided.iter().copied();
        let later = |known: &f64| self.last_day.is_some_and(|last| last < *known);
        days.filter(|known| *known != day && later(known)).collect()
    }

    /// Where one account alone is left, what was undecided is decided.
    fn settle(&mut self, shape: Shape) -> Option<Sum> {
        let [only] = &mut self.accounts[..] else {
            return None;
        };
        let marks = core::mem::take(&mut only.marks);
        let Marks { outliers, jumps } = marks;
        self.outliers += outliers.len() as u64;
        self.jump_count += jumps.len() as u64;
        for (k, axis) in jumps {
            let day = self.undecided[k];
            self.jumps.push(JumpSeen { day, axis });
        }
        self.jumps = last_jumps(core::mem::take(&mut self.jumps));
        self.undecided.clear();
        let told = core::mem::replace(&mut only.told, Told::nothing(shape));
        (!self.unfit()).then(|| Sum::new(told, 0.0))
    }
}

/// What is believed under all accounts together, by their likelihood: with its mean and its covariance.
pub(super) fn mixture_of<'a>(accounts: &'a [Account], common: &Common) -> Cow<'a, Belief<f64>> {
    if let [only] = accounts {
        return Cow::Borrowed(&only.belief);
    }
    let beliefs: Vec<&Belief<f64>> = accounts.iter().map(|a| &a.belief).collect();
    let likelihoods = accounts.iter().map(|a| libm::exp(a.log_likelihood));
    let likelihoods: Vec<f64> = likelihoods.collect();
    Cow::Owned(common.mixture(&beliefs, &likelihoods))
}
