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
mod going;
mod group;
mod hyper;
mod hypotheses;
mod judge;
mod leftovers;
mod parts;
mod plan;
mod reopen;
mod rows;
pub mod simulate;
mod terms;
mod watch;
mod worth;
mod zero;

use std::borrow::Cow;
use std::collections::{BTreeMap, BTreeSet};

use helio_core::SimdLevel;
use helio_core::lanes::BLOCK;
use rayon::prelude::*;

use crate::error::CalibrationError;
use crate::field::{Campaign, FieldFitOptions, fit_field};
use crate::observation::Observation;
use belief::{Belief, Shape, WANDERING};
use common::{Common, Sum};
pub use follow::{Alarm, FieldState, Followed, JumpSeen, Known, Step, StepKind};
use foretell::shared_values;
pub use foretell::{Foretold, History};
use going::Going;
pub use going::Progress;
use group::{Beliefs, Group, Prior, Sample, Total};
use hyper::{
    EXPECTED_NOISE, EXPECTED_SPREAD_MRAD, EXPECTED_WANDER, Free, HELD_VARIANCE, Hyper, Marks,
    Search, expected_covariance, learn, minus_log_likelihood, without,
};
pub use hyper::{Noise, Part, Wander};
pub use hypotheses::Mishaps;
use judge::Judge;
pub use leftovers::{Leftover, LeftoverOptions, LeftoverParts, Leftovers};
pub use parts::{AccountParts, HeliostatParts, StateParts};
use parts::{check_latitude, check_mishaps, demand};
pub use plan::NO_TARGET;
use reopen::Open;
pub use rows::DAY_NS;
use rows::{ANGLES, MILLI, Structure, filter_unit, in_time, pole, usable};
pub use terms::{AxisCause, Cause, Description, Scope, SpotCause};
use watch::moves_on;
pub use watch::{Lately, Spell, Watch, too_late};
pub use worth::Worth;
pub use zero::ZeroPoint;

/// How to fit a field together.
#[derive(Debug, Clone, PartialEq)]
pub struct JointOptions {
    /// Latitude of the site \[rad\]: the sun's path.
    pub site_latitude_rad: f64,
    /// Causes that turn mirrors about their axes and may be found in the field.
    pub axis_causes: Vec<AxisCause>,
    /// Causes that move spots and may be found in the field: for each target, or for all.
    pub spot_causes: Vec<SpotCause>,
    /// How much likelier (logarithm) the whole field's records must be with a cause than without it; minus infinity
    /// admits all causes, infinity none.
    pub least_log_evidence: f64,
    /// How often things go wrong.
    pub mishaps: Mishaps,
    /// Parts of the model that are left out.
    pub left_out: Vec<Part>,
    /// Noise and wander are learnt from at most so many heliostats, evenly chosen; at least one.
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
            spot_causes: SpotCause::ALL.to_vec(),
            least_log_evidence: 5.0,
            mishaps: Mishaps::default(),
            left_out: Vec::new(),
            learnt_from: 128,
            expansions: 3,
        }
    }

    fn check(&self) -> Result<(), CalibrationError> {
        check_latitude(self.site_latitude_rad)?;
        check_mishaps(&self.mishaps)?;
        let least = self.least_log_evidence;
        demand("least_log_evidence", !least.is_nan(), "a number", least)?;
        let count = self.learnt_from;
        demand("learnt_from", count >= 1, "at least 1", count as f64)
    }
}

/// A cause that the field may have in common.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct CommonCause {
    /// Which.
    pub cause: Cause,
    /// Its value (for a cause of each heliostat: the field's mean), in its own unit; zero where it is not admitted.
    pub value: f64,
    /// One standard deviation of that; where it is not admitted, of what would be known of it if it were. NaN
    /// where that is not known.
    pub sigma: f64,
    /// Standard deviation of heliostats about it, in its own unit.
    pub spread: f64,
    /// How much likelier (logarithm) the records are with it; NaN in a followed field, which does not carry it on.
    pub log_evidence: f64,
    /// Whether the field's records speak for it.
    pub admitted: bool,
}

/// What the joint fit says of one heliostat. Of its last six records more than one account may be left: values and
/// covariance are then those of all accounts together, outliers and jumps those of the likeliest.
#[derive(Debug, Clone, PartialEq)]
pub struct Posterior {
    /// Its six angles at rest \[rad\], then the causes of its own \[rad\].
    pub still: Vec<f64>,
    /// Its wandering zero points after its last record \[rad\]: slow of either axis, fast of either axis.
    pub wandering: [f64; WANDERING],
    /// Covariance of all of these \[rad²\], row by row; what is common is part of it.
    pub covariance: Vec<f64>,
    /// Its last record with a time \[days since 1970\], but for those not believed that are a month or more after those
    /// that are; none where no record has one: those then count as made
    /// together with the first that comes after them.
    pub last_day: Option<f64>,
    /// Observations that were not believed.
    pub outliers: Vec<usize>,
    /// Observations before which the zero point of an axis jumped, in time.
    pub jumps: Vec<(usize, JumpSeen)>,
    /// Records at the end that are not believed or tell nothing, one after the other.
    pub unbelieved_last: usize,
    /// Observations that tell nothing: their beam should not meet their target, or a number of theirs cannot be.
    pub misses: Vec<usize>,
    /// How many of its last records do not fit the others.
    pub lately: Lately,
    /// How many observations it had.
    pub records: usize,
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
    /// Whether the search for noise, wander and distribution ended where no step promised more. False where its
    /// rounds ran out or a number was not finite: everything here is then what was found until then.
    pub converged: bool,
    /// In the order of the campaigns.
    pub heliostats: Vec<Posterior>,
    /// What is known of them as a function of what is common, eight by eight in another order.
    known: Vec<Beliefs>,
    /// Those of whose last records more than one account is left, or another than their group's.
    open: BTreeMap<usize, Open>,
    /// Days of records that are not believed and much later than the last one of those that have such \[since 1970\].
    aside: BTreeMap<usize, Vec<f64>>,
    /// Where each stands there: group times eight, and lane.
    place: Vec<usize>,
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
/// Heliostats that are fitted by themselves before it is asked whether to go on: a multiple of eight.
const FITTED_AT_ONCE: usize = 4096;
/// Farthest beginning that is taken from a heliostat's own fit \[rad\].
const BEGIN_WITHIN_RAD: f64 = 0.5;
/// What was decided about a heliostat's records holds if the place where the formula is made linear then moves by
/// no more \[rad\].
const DECIDED_WITHIN_RAD: f64 = 0.01;
/// A record farther than this from what was expected (chi-squared, two degrees of freedom) has the
/// heliostat's records judged.
const JUDGED: f64 = 16.0;
/// The same where it is held against the heliostat's own fit.
const CLEARLY: f64 = 30.0;
/// So far off, between two that are not far off at all, that only a spot in a wrong place explains it.
const FAR_OFF: f64 = 100.0;
const NOT_FAR_OFF: f64 = 9.0;
/// What holds a cause that is not admitted to zero, in its expected size.
const HELD: f64 = 1e-9;

/// What records hold: no causes in common that are held to zero.
struct Live {
    structure: Structure,
    /// Those that are left, by their place in the whole structure.
    causes: Vec<usize>,
}

struct Work<'a> {
    campaigns: &'a [Campaign<'a>],
    options: &'a JointOptions,
    going: &'a Going<'a>,
    structure: Structure,
    live: Live,
    shape: Shape,
    pole: helio_core::Enu,
    prior_sigma: Vec<f64>,
    expected_spread: Vec<f64>,
    free: Free,
    hyper: Hyper,
    search: Option<Search>,
    common: Common,
    told: Sum,
    /// How much likelier the records are with each common unknown that is a cause, as last looked at.
    log_evidence: Vec<f64>,
    /// Whether in this pass noise and wander were found, and what is common each time.
    converged: bool,
    /// One standard deviation of each common unknown, as it last was free.
    sigma: Vec<f64>,
    level: SimdLevel,
    /// All heliostats, those with most records first: eight of them go side by side.
    order: Vec<usize>,
}

/// Whether a common unknown is found from the records, by its standard deviation before them; if not it is held to
/// zero.
fn is_free(prior_sigma: f64) -> bool {
    prior_sigma > 1e-6
}

/// Groups of eight that are summed before others are added.
const CHUNK: usize = 8;

/// What was decided about the records of heliostats, by their number; nothing was found wrong where none is.
type Decided = BTreeMap<usize, Marks>;

/// Where the formula is made linear: radians, metres, seconds.
struct Places {
    /// Unknowns at rest, heliostat by heliostat.
    still: Vec<f64>,
    shared: Vec<f64>,
}

/// Fits a field together.
///
/// A record tells nothing, and keeps its place, where its beam does not meet its target, a number of it is not finite
/// or its `sigma_m` is not positive.
///
/// # Errors
/// [`CalibrationError::BadOption`] where an option makes no sense: a latitude beyond ±π/2; probabilities of mishaps
/// that are negative or sum to 1 or more; sizes of mishaps that are not positive and finite; `least_log_evidence` NaN;
/// `learnt_from` 0.
pub fn fit_joint(
    campaigns: &[Campaign<'_>],
    options: &JointOptions,
) -> Result<JointFit, CalibrationError> {
    fit_joint_watched(campaigns, options, &|_, _| true)
}

/// [`fit_joint`], watched: it tells how far it is, and ends early when it is told to.
///
/// # Errors
/// Those of [`fit_joint`], and [`CalibrationError::Stopped`].
///
/// ```
/// use helio_calib::CalibrationError;
/// use helio_calib::joint::{JointOptions, fit_joint_watched};
/// # use helio_calib::joint::simulate::{FieldOptions, simulate_field};
/// # let options = FieldOptions { heliostats: 6, records: 8, ..FieldOptions::new(1)? };
/// # let field = simulate_field(&options)?;
/// # let campaigns = field.first(8);
/// let options = JointOptions::new(options.site.latitude_rad());
/// let stopped = fit_joint_watched(&campaigns, &options, &|_more, _of| false);
/// assert_eq!(stopped, Err(CalibrationError::Stopped));
/// # Ok::<(), CalibrationError>(())
/// ```
pub fn fit_joint_watched(
    campaigns: &[Campaign<'_>],
    options: &JointOptions,
    progress: Progress<'_>,
) -> Result<JointFit, CalibrationError> {
    fit_at(campaigns, options, SimdLevel::best(), progress)
}

/// Of the heliostats that noise and wander are learnt from one in so many gives a first guess at them.
const FIRST_SHARE: usize = 4;

fn fit_at(
    campaigns: &[Campaign<'_>],
    options: &JointOptions,
    level: SimdLevel,
    progress: Progress<'_>,
) -> Result<JointFit, CalibrationError> {
    let expansions = options.expansions.max(1);
    // where noise and wander are learnt from some heliostats, the first expansion is that of some of these alone
    let some = campaigns.len() > options.learnt_from && expansions > 1;
    let going = Going::new(progress, campaigns.len() * (expansions - usize::from(some)));
    let mut work = Work::new(campaigns, options, level, &going)?;
    let mut places = work.beginnings();
    going.check()?;
    let mut decided = Decided::new();
    let mut pass = 0;
    loop {
        work.leave_out_held();
        let first = pass == 0 && some;
        let most = options
            .learnt_from
            .div_ceil(if first { FIRST_SHARE } else { 1 });
        let sample = work.sample(&places, most, pass == 0, &mut decided);
        going.check()?;
        work.learn(&sample);
        going.check()?;
        if pass == 0 {
            work.meet(&sample);
        }
        if pass > 0 || expansions == 1 {
            work.admit_own(&sample);
        }
        pass += 1;
        if first {
            let known = sample.filter(&work.hyper).0;
            work.move_on(&mut places, &known, &sample.members, &mut decided);
            if let Some(search) = &mut work.search {
                search.seen_by_more(FIRST_SHARE as f64);
            }
            continue;
        }
        let known = work.believe(&places, &mut decided);
        going.check()?;
        if pass > 1 || expansions == 1 {
            work.admit();
        }
        if pass == expansions {
            let likelihood = minus_log_likelihood(&sample, &work.hyper, &work.prior_sigma);
            let fit = work.finish(&places, known, decided, likelihood);
            going.check()?;
            return Ok(fit);
        }
        let order = core::mem::take(&mut work.order);
        work.move_on(&mut places, &known, &order, &mut decided);
        work.order = order;
    }
}

/// Records of a heliostat that lie clearly off its own fit.
enum Suspects {
    None,
    /// Each far off between two that are not.
    Alone(Vec<usize>),
    /// Some others too, up to this one.
    UpTo(usize),
}

fn suspects(misses: &[[f64; BLOCK]], lane: usize) -> Suspects {
    let off = |record: usize| misses.get(record).map_or(f64::INFINITY, |m| m[lane]);
    let clearly: Vec<usize> = (0..misses.len()).filter(|&k| off(k) > CLEARLY).collect();
    let Some(&last) = clearly.last() else {
        return Suspects::None;
    };
    let alone = |&k: &usize| {
        let before = k.checked_sub(1).map_or(f64::INFINITY, off);
        off(k) > FAR_OFF && before < NOT_FAR_OFF && off(k + 1) < NOT_FAR_OFF
    };
    if clearly.iter().all(alone) {
        Suspects::Alone(clearly)
    } else {
        Suspects::UpTo(last)
    }
}

/// Those with as many records side by side.
fn alike(campaigns: &[Campaign<'_>], heliostats: &mut [usize]) {
    heliostats.sort_by_key(|&k| core::cmp::Reverse(campaigns[k].observations.len()));
}

impl JointFit {
    /// What is known of heliostat `k` as a function of what is common.
    fn belief(&self, k: usize) -> Belief<f64> {
        if let Some(open) = self.open.get(&k) {
            return open.belief.clone();
        }
        let (group, lane) = (self.place[k] / BLOCK, self.place[k] % BLOCK);
        self.known[group].belief(self.structure.shape(), lane)
    }
}

impl<'a> Work<'a> {
    fn new(
        campaigns: &'a [Campaign<'a>],
        options: &'a JointOptions,
        level: SimdLevel,
        going: &'a Going<'a>,
    ) -> Result<Self, CalibrationError> {
        options.check()?;
        let targets = campaigns
            .par_iter()
            .fold(BTreeSet::new, |mut targets, campaign| {
                for observation in campaign.observations {
                    if !targets.contains(&observation.target) && usable(observation) {
                        targets.insert(observation.target);
                    }
                }
                targets
            })
            .reduce(BTreeSet::new, |mut all, some| {
                all.extend(some);
                all
            });
        let (own, shared): (Vec<AxisCause>, Vec<AxisCause>) = options
            .axis_causes
            .iter()
            .partition(|cause| cause.description().expected_spread > 0.0);
        let mut shared: Vec<Cause> = shared.into_iter().map(Cause::Axis).collect();
        let of_spots = |target| options.spot_causes.iter().filter_map(move |c| c.of(target));
        for target in targets {
            shared.extend(of_spots(Some(target)).filter(|cause| cause.target().is_some()));
        }
        shared.extend(of_spots(None));
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
        let mut hyper = Hyper {
            noise: EXPECTED_NOISE,
            wander: EXPECTED_WANDER,
            spread: expected_covariance(&expected_spread),
        };
        let free = without(&options.left_out, shape.still, &mut hyper);
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
        let mut order: Vec<usize> = (0..campaigns.len()).collect();
        alike(campaigns, &mut order);
        Ok(Self {
            campaigns,
            options,
            going,
            level,
            order,
            free,
            live: Live {
                structure: structure.clone(),
                causes: (0..shape.causes).collect(),
            },
            structure,
            shape,
            pole: pole(options.site_latitude_rad),
            prior_sigma,
            expected_spread,
            hyper,
            search: None,
            common,
            told: Sum::nothing(shape),
            log_evidence: vec![0.0; n],
            converged: true,
            sigma: vec![f64::NAN; n],
        })
    }

    /// Where each heliostat's own fit leads, if it has records enough for one.
    fn beginnings(&self) -> Places {
        let options = FieldFitOptions {
            level: Some(self.level),
            ..FieldFitOptions::default()
        };
        // such a fit takes no records but those that can be used, and a sigma of all of them or of none
        let used: Vec<Cow<'_, [Observation]>> = self
            .campaigns
            .par_iter()
            .map(|campaign| {
                let all = campaign.observations;
                let stated = all.iter().any(|o| o.sigma_m.is_some());
                if all
                    .iter()
                    .all(|o| usable(o) && o.sigma_m.is_some() == stated)
                {
                    return Cow::Borrowed(all);
                }
                let with_sigma = |o: &Observation| Observation {
                    sigma_m: stated.then(|| o.sigma_m.unwrap_or(EXPECTED_NOISE.spot_m)),
                    ..*o
                };
                let used = all.iter().filter(|o| usable(o));
                used.map(with_sigma).collect()
            })
            .collect();
        let campaigns: Vec<Campaign<'_>> = used
            .iter()
            .zip(self.campaigns)
            .map(|(observations, campaign)| Campaign {
                observations,
                ..*campaign
            })
            .collect();
        let mut places = Places {
            still: vec![0.0; self.campaigns.len() * self.shape.still],
            shared: vec![0.0; self.shape.causes],
        };
        // side by side as all at once would be, and now and then a question whether to go on
        let mut order: Vec<usize> = (0..campaigns.len()).collect();
        alike(&campaigns, &mut order);
        for some in order.chunks(FITTED_AT_ONCE) {
            if !self.going.is_on() {
                break;
            }
            let chosen: Vec<Campaign<'_>> = some.iter().map(|&k| campaigns[k]).collect();
            for (fit, &k) in fit_field(&chosen, &options).into_iter().zip(some) {
                let still = &mut places.still[k * self.shape.still..];
                if let Ok(fit) = fit
                    && campaigns[k].observations.len() >= BEGIN_WITH_FIT
                    && fit.parameters.values[..ANGLES]
                        .iter()
                        .all(|x| x.abs() < BEGIN_WITHIN_RAD)
                {
                    still[..ANGLES].copy_from_slice(&fit.parameters.values[..ANGLES]);
                }
            }
        }
        places
    }

    /// Linearises the records of up to eight heliostats.
    fn linearise(&self, group: &mut Group, members: &[usize], places: &Places) {
        let still = self.shape.still;
        let heliostats = members.iter().map(|&k| {
            (
                &self.campaigns[k],
                &places.still[k * still..(k + 1) * still],
            )
        });
        let Live { structure, causes } = &self.live;
        let shared: Vec<f64> = causes.iter().map(|&k| places.shared[k]).collect();
        group.linearise(self.level, structure, &shared, heliostats, self.pole);
    }

    /// Outliers and jumps of a heliostat, written into its records.
    fn judge(&self, group: &mut Group, lane: usize, k: usize, last: usize) -> Marks {
        let mishaps = &self.options.mishaps;
        let judge = Judge {
            shape: self.live.structure.shape(),
            causes: &self.live.causes,
            hyper: &self.hyper,
            common: (&self.common.mean, &self.common.covariance),
            mishaps,
        };
        let count = self.campaigns[k].observations.len();
        let rows = group.records_of(judge.shape, lane, 0..count);
        let marks = judge.marks(self.level, &rows, last);
        group.mark(judge.shape, lane, &marks, mishaps.jump_mrad);
        marks
    }

    /// Heliostats that noise and wander are learnt from, evenly spaced among those with records, and what was
    /// decided about the records of each: of all where `all`, else where one lies far from what was expected.
    fn sample(&self, places: &Places, most: usize, all: bool, decided: &mut Decided) -> Sample {
        let with: Vec<usize> = (0..self.campaigns.len())
            .filter(|&k| self.campaigns[k].observations.len() > 1)
            .collect();
        let count = with.len().min(most.max(1));
        let mut chosen: Vec<usize> = (0..count).map(|k| with[k * with.len() / count]).collect();
        alike(self.campaigns, &mut chosen);
        let causes = &self.live.causes;
        let prior = Prior::new(self.shape, &self.hyper, &self.common.mean, causes);
        let each: Vec<(Group, Decided)> = chosen
            .par_chunks(BLOCK)
            .map(|members| {
                let mut group = Group::default();
                if !self.going.is_on() {
                    return (group, Decided::new());
                }
                self.linearise(&mut group, members, places);
                let mut known = Beliefs::default();
                if !all {
                    group.filter(self.level, &prior, &mut known);
                }
                let mut decided = Decided::new();
                for (lane, &k) in members.iter().enumerate() {
                    let marks = if all || known.farthest[lane] > JUDGED {
                        self.judge(&mut group, lane, k, usize::MAX)
                    } else {
                        Marks::default()
                    };
                    if self.unfit(k, &marks) {
                        group.silence(self.live.structure.shape(), lane);
                    }
                    decided.insert(k, marks);
                }
                (group, decided)
            })
            .collect();
        let mut groups = Vec::with_capacity(each.len());
        for (group, of_group) in each {
            decided.extend(of_group);
            groups.push(group);
        }
        Sample {
            shape: self.shape,
            level: self.level,
            groups,
            members: chosen,
            about: self.common.mean.clone(),
            causes: self.live.causes.clone(),
        }
    }

    /// Whether so many records of a heliostat do not fit the others that it says nothing of what is common, nor of
    /// how records scatter.
    fn unfit(&self, k: usize, marks: &Marks) -> bool {
        if *marks == Marks::default() {
            return false;
        }
        let count = self.campaigns[k].observations.len();
        let lately = Lately::of(&marks.odd(count, &[]));
        let odd = marks.outliers.len() + marks.jumps.len();
        watch::unfit(count as u64, odd as u64, &lately)
    }

    fn learn(&mut self, sample: &Sample) {
        self.converged = learn(
            sample,
            &mut self.hyper,
            &self.prior_sigma,
            &self.expected_spread,
            &self.free,
            &mut self.search,
            self.going,
        );
    }

    /// What the sample alone says of what is common.
    fn meet(&mut self, sample: &Sample) {
        let (_, told) = sample.filter(&self.hyper);
        self.take(Common::new(&told, &self.prior_sigma));
    }

    fn take(&mut self, common: Option<Common>) {
        match common {
            Some(common) => self.common = common,
            None => self.converged = false,
        }
    }

    /// What is known of all heliostats, eight by eight in the order of `order`, and what is common. Records
    /// about which nothing was decided yet are judged where one lies far from what was expected.
    fn believe(&mut self, places: &Places, decided: &mut Decided) -> Vec<Beliefs> {
        let causes = &self.live.causes;
        let prior = Prior::new(self.shape, &self.hyper, &self.common.mean, causes);
        let (work, before) = (&*self, &*decided);
        let each: Vec<(Vec<Beliefs>, Decided, Total)> = self
            .order
            .par_chunks(CHUNK * BLOCK)
            .map_init(Group::default, |group, heliostats| {
                work.believe_some(group, heliostats, places, &prior, before)
            })
            .collect();
        let mut total = Total::nothing(self.shape);
        let mut known = Vec::with_capacity(self.order.len().div_ceil(BLOCK));
        for (of_chunk, found, of_total) in each {
            total.add(&of_total);
            known.extend(of_chunk);
            decided.extend(found);
        }
        self.told = total.sum(self.shape, &self.common.mean);
        self.meet_all();
        known
    }

    /// What is known of some heliostats, eight by eight; what was newly decided about records; what they tell.
    fn believe_some(
        &self,
        group: &mut Group,
        heliostats: &[usize],
        places: &Places,
        prior: &Prior<'_>,
        before: &Decided,
    ) -> (Vec<Beliefs>, Decided, Total) {
        let jump_mrad = self.options.mishaps.jump_mrad;
        let rows = self.live.structure.shape();
        let mut total = Total::nothing(self.shape);
        let mut found = Decided::new();
        let mut all = Vec::with_capacity(heliostats.len().div_ceil(BLOCK));
        let mut unexpected = Vec::new();
        for (n, members) in heliostats.chunks(BLOCK).enumerate() {
            if !self.going.on_after(members.len()) {
                return (Vec::new(), found, total);
            }
            self.linearise(group, members, places);
            let misses = group.misses(rows, prior);
            let silent = core::array::from_fn(|lane| {
                let of = members.get(lane);
                let count = of.map_or(0, |&k| self.campaigns[k].observations.len());
                (0..count).filter(|&r| misses[r][lane].is_nan()).collect()
            });
            let mut judged = [false; BLOCK];
            for (lane, k) in members.iter().enumerate() {
                if let Some(marks) = before.get(k) {
                    group.mark(rows, lane, marks, jump_mrad);
                    continue;
                }
                let count = self.campaigns[*k].observations.len();
                // most of those that the filter would find, before it has to run twice
                match suspects(&misses[..count], lane) {
                    Suspects::None => {}
                    Suspects::Alone(outliers) => {
                        let marks = Marks {
                            outliers,
                            jumps: Vec::new(),
                        };
                        group.mark(rows, lane, &marks, jump_mrad);
                        found.insert(*k, marks);
                    }
                    Suspects::UpTo(last) => {
                        judged[lane] = true;
                        found.insert(*k, self.judge(group, lane, *k, last));
                    }
                }
            }
            let mut known = Beliefs {
                silent,
                ..Beliefs::default()
            };
            let mut of_group = group.filter(self.level, prior, &mut known);
            for (lane, k) in members.iter().enumerate() {
                let decided = before.contains_key(k) || judged[lane];
                if known.farthest[lane] > JUDGED && !decided {
                    let mut marks = self.judge(group, lane, *k, usize::MAX);
                    if let Some(alone) = found.remove(k) {
                        marks.outliers.extend(alone.outliers);
                        marks.outliers.sort_unstable();
                    }
                    found.insert(*k, marks);
                    of_group.leave_out(lane);
                    unexpected.push(n * BLOCK + lane);
                }
            }
            for (lane, k) in members.iter().enumerate() {
                let marks = before.get(k).or_else(|| found.get(k));
                if marks.is_some_and(|marks| self.unfit(*k, marks)) {
                    of_group.leave_out(lane);
                }
            }
            total.add(&of_group);
            all.push(known);
        }
        // those once more, side by side
        for some in unexpected.chunks(BLOCK) {
            let members: Vec<usize> = some.iter().map(|&n| heliostats[n]).collect();
            self.linearise(group, &members, places);
            for (lane, k) in members.iter().enumerate() {
                group.mark(rows, lane, &found[k], jump_mrad);
            }
            let mut again = Beliefs::default();
            let mut of_group = group.filter(self.level, prior, &mut again);
            for (lane, k) in members.iter().enumerate() {
                if self.unfit(*k, &found[k]) {
                    of_group.leave_out(lane);
                }
            }
            total.add(&of_group);
            for (lane, &n) in some.iter().enumerate() {
                all[n / BLOCK].take(n % BLOCK, &again, lane);
            }
        }
        (all, found, total)
    }

    fn meet_all(&mut self) {
        self.take(Common::new(&self.told, &self.prior_sigma));
    }

    /// Causes that stand or fall together: all shifts of targets, which together are nearly a turn of all
    /// heliostats; each of the others by itself.
    fn group(&self, k: usize) -> Vec<usize> {
        let still = self.shape.still;
        let shift = |k: &usize| {
            let cause = k.checked_sub(still).map(|k| self.structure.shared[k]);
            matches!(cause, Some(Cause::Target(..)))
        };
        if shift(&k) {
            (still..self.shape.common()).filter(shift).collect()
        } else {
            vec![k]
        }
    }

    /// Holds to zero mean and spread of those causes of each heliostat that the sample's records do not speak for.
    fn admit_own(&mut self, sample: &Sample) {
        let still = self.shape.still;
        for k in ANGLES..still {
            if !self.is_free(k) {
                continue;
            }
            let mut hyper = self.hyper.clone();
            let mut prior_sigma = self.prior_sigma.clone();
            prior_sigma[k] *= HELD;
            for i in 0..still {
                hyper.spread[belief::at(i.max(k), i.min(k))] = 0.0;
            }
            hyper.spread[belief::at(k, k)] = HELD_VARIANCE;
            let evidence = minus_log_likelihood(sample, &hyper, &prior_sigma)
                - minus_log_likelihood(sample, &self.hyper, &self.prior_sigma);
            self.log_evidence[k] = evidence;
            self.sigma[k] = self.common.sigma(k);
            if evidence < self.options.least_log_evidence {
                self.hyper = hyper;
                self.prior_sigma = prior_sigma;
                self.free.spread[k] = false;
            }
        }
    }

    /// Holds to zero, the weakest first, the causes in common that the field's records do not speak for.
    fn admit(&mut self) {
        let still = self.shape.still;
        loop {
            let mut weakest: Option<(f64, Vec<usize>)> = None;
            for k in still..self.shape.common() {
                if !self.is_free(k) {
                    continue;
                }
                let group = self.group(k);
                let evidence = self.common.log_evidence(&group, &self.prior_sigma);
                self.log_evidence[k] = evidence;
                self.sigma[k] = self.common.sigma(k);
                if weakest.as_ref().is_none_or(|(least, _)| evidence < *least) {
                    weakest = Some((evidence, group));
                }
            }
            match weakest {
                Some((evidence, group)) if evidence < self.options.least_log_evidence => {
                    for k in group {
                        self.prior_sigma[k] *= HELD;
                    }
                    self.meet_all();
                }
                _ => break,
            }
        }
    }

    /// Leaves causes in common that are held to zero out of records that are linearised from now on.
    fn leave_out_held(&mut self) {
        let free = |cause: &usize| self.is_free(self.shape.still + cause);
        let causes: Vec<usize> = (0..self.shape.causes).filter(free).collect();
        self.live = Live {
            structure: Structure {
                own: self.structure.own.clone(),
                shared: causes.iter().map(|&k| self.structure.shared[k]).collect(),
            },
            causes,
        };
    }

    fn is_free(&self, k: usize) -> bool {
        is_free(self.prior_sigma[k])
    }

    /// Where the formula is made linear next for some heliostats, eight by eight.
    fn move_on(
        &self,
        places: &mut Places,
        known: &[Beliefs],
        heliostats: &[usize],
        decided: &mut Decided,
    ) {
        let still = self.shape.still;
        places.shared = shared_values(&self.structure, &self.common);
        for (known, members) in known.iter().zip(heliostats.chunks(BLOCK)) {
            for (lane, &k) in members.iter().enumerate() {
                let values = known.still(self.shape, lane, &self.common.mean);
                let mut farthest: f64 = 0.0;
                for (to, value) in places.still[k * still..].iter_mut().zip(values) {
                    let value = value / MILLI;
                    farthest = farthest.max((value - *to).abs());
                    *to = value;
                }
                if farthest > DECIDED_WITHIN_RAD {
                    decided.remove(&k);
                }
            }
        }
    }

    fn finish(
        self,
        places: &Places,
        known: Vec<Beliefs>,
        mut marks: Decided,
        likelihood: f64,
    ) -> JointFit {
        let Shape { still, .. } = self.shape;
        let open = self.reopen(places, &known, &marks);
        for (&k, open) in &open {
            marks.insert(k, open.marks.clone());
        }
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
                sigma: if admitted {
                    self.common.sigma(k)
                } else {
                    self.sigma[k]
                } / unit,
                spread,
                log_evidence: self.log_evidence[k],
                admitted,
            }
        };
        let own = self.structure.own.iter().enumerate().map(|(k, &cause)| {
            let k = ANGLES + k;
            common_cause(
                k,
                Cause::Axis(cause),
                if self.is_free(k) {
                    libm::sqrt(spread[k * still + k])
                } else {
                    0.0
                },
            )
        });
        let shared = self.structure.shared.iter().enumerate();
        let shared = shared.map(|(k, &cause)| common_cause(still + k, cause, 0.0));
        let causes = own.chain(shared).collect();
        let mut heliostats: Vec<Option<Posterior>> = Vec::new();
        heliostats.resize_with(self.campaigns.len(), || None);
        let each: Vec<Vec<Posterior>> = known
            .par_iter()
            .zip(self.order.par_chunks(BLOCK))
            .map(|(known, members)| self.posteriors(known, members))
            .collect();
        let mut place = vec![0; self.campaigns.len()];
        for (n, &k) in self.order.iter().enumerate() {
            place[k] = n;
        }
        for (posteriors, members) in each.into_iter().zip(self.order.chunks(BLOCK)) {
            for (posterior, &k) in posteriors.into_iter().zip(members) {
                heliostats[k] = Some(posterior);
            }
        }
        let mut heliostats: Vec<Posterior> = heliostats.into_iter().flatten().collect();
        for (&k, open) in &open {
            let mean = self.common.mean_of(&open.belief);
            let covariance = self.common.covariance_of(&open.belief);
            let posterior = &mut heliostats[k];
            for (to, from) in posterior.still.iter_mut().zip(&mean) {
                *to = from / MILLI;
            }
            for (to, from) in posterior.wandering.iter_mut().zip(&mean[still..]) {
                *to = from / MILLI;
            }
            posterior.covariance = covariance.iter().map(|x| x / square).collect();
        }
        let mut aside = BTreeMap::new();
        for (k, posterior) in heliostats.iter_mut().enumerate() {
            let marks = marks.remove(&k).unwrap_or_default();
            if marks != Marks::default() || !posterior.misses.is_empty() {
                let (of, days) = in_time(&self.campaigns[k]);
                posterior.outliers = marks.outliers.iter().map(|&r| of[r]).collect();
                let believed =
                    |r: &usize| !marks.outliers.contains(r) && !posterior.misses.contains(r);
                let from_the_end = (0..of.len()).rev();
                posterior.unbelieved_last = from_the_end.take_while(|r| !believed(r)).count();
                posterior.lately = Lately::of(&marks.odd(of.len(), &posterior.misses));
                posterior.last_day = posterior.last_day.and_then(|_| {
                    let each = days.iter().enumerate();
                    each.fold(None, |last, (r, &day)| moves_on(last, day, believed(&r)))
                });
                let later = |day: &f64| posterior.last_day.is_some_and(|last| last < *day);
                let late: Vec<f64> = days.iter().copied().filter(later).collect();
                if !late.is_empty() {
                    aside.insert(k, late);
                }
                for record in &mut posterior.misses {
                    *record = of[*record];
                }
                let jump = |&(r, axis): &(usize, usize)| (of[r], JumpSeen { day: days[r], axis });
                posterior.jumps = marks.jumps.iter().map(jump).collect();
            }
        }
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
            converged: self.converged && likelihood.is_finite(),
            heliostats,
            known,
            open,
            aside,
            place,
            structure: self.structure,
            hyper: self.hyper,
            common: self.common,
            told: self.told,
            prior_sigma: self.prior_sigma,
            mishaps: self.options.mishaps,
            site_latitude_rad: self.options.site_latitude_rad,
        }
    }

    /// Of up to eight heliostats, but for outliers and jumps.
    fn posteriors(&self, known: &Beliefs, members: &[usize]) -> Vec<Posterior> {
        let Shape { still, .. } = self.shape;
        let own = self.shape.own();
        let settled = known.settle(self.level, self.shape, &self.common, false);
        let posterior = |lane: usize, k: usize| {
            let observations = self.campaigns[k].observations;
            let covariance = (0..own * own).map(|p| {
                let (i, j) = ((p / own).max(p % own), (p / own).min(p % own));
                settled.covariance[belief::at(i, j)][lane] / (MILLI * MILLI)
            });
            let mean = |i: usize| settled.mean[i][lane] / MILLI;
            let last_ns = observations.iter().filter_map(|o| o.unix_ns).max();
            Posterior {
                still: (0..still).map(mean).collect(),
                wandering: core::array::from_fn(|i| mean(still + i)),
                covariance: covariance.collect(),
                last_day: last_ns.map(|ns| ns as f64 / DAY_NS),
                outliers: Vec::new(),
                jumps: Vec::new(),
                unbelieved_last: 0,
                misses: known.silent[lane].clone(),
                lately: Lately::of(&vec![0; observations.len()]),
                records: observations.len(),
            }
        };
        members
            .iter()
            .enumerate()
            .map(|(lane, &k)| posterior(lane, k))
            .collect()
    }
}

#[cfg(test)]
mod tests {
    use super::simulate::{FieldOptions, simulate_field};
    use super::*;

    const UNWATCHED: Progress<'_> = &|_, _| true;

    fn bits(fit: &JointFit) -> Vec<u64> {
        let mut bits = vec![fit.minus_log_likelihood.to_bits()];
        bits.extend(fit.causes.iter().map(|cause| cause.value.to_bits()));
        for posterior in &fit.heliostats {
            let numbers = posterior.still.iter().chain(&posterior.wandering);
            bits.extend(numbers.chain(&posterior.covariance).map(|x| x.to_bits()));
            bits.extend(posterior.outliers.iter().map(|&k| k as u64));
        }
        bits
    }

    /// Also where some records state their sigma and others do not.
    #[test]
    fn heliostats_begin_with_their_own_fit() {
        let options = FieldOptions {
            heliostats: 10,
            records: 20,
            ..FieldOptions::new(7).unwrap()
        };
        let mut field = simulate_field(&options).unwrap();
        let begun = |field: &simulate::SimulatedField| {
            let campaigns = field.first(20);
            let how = JointOptions::new(options.site.latitude_rad());
            let going = Going::new(UNWATCHED, 0);
            let work = Work::new(&campaigns, &how, SimdLevel::best(), &going).unwrap();
            work.beginnings().still
        };
        let none = begun(&field);
        for heliostat in &mut field.heliostats {
            for o in heliostat.observations.iter_mut().step_by(3) {
                o.sigma_m = Some(0.02);
            }
        }
        let mixed = begun(&field);
        let still = none.len() / 10;
        let mut largest: f64 = 0.0;
        for (none, mixed) in none.chunks(still).zip(mixed.chunks(still)) {
            for (none, mixed) in none.iter().zip(mixed) {
                largest = largest.max(none.abs());
                assert!((none - mixed).abs() < 1e-9, "{none} {mixed}");
            }
        }
        assert!(largest > 1e-3, "{largest}");
    }

    #[test]
    fn neither_instruction_set_nor_threads_change_a_bit() {
        let options = FieldOptions {
            heliostats: 21,
            records: 12,
            ..FieldOptions::new(5).unwrap()
        };
        let field = simulate_field(&options).unwrap();
        let mut campaigns = field.first(12);
        // of different lengths
        campaigns[3].observations = &campaigns[3].observations[..5];
        campaigns[8].observations = &[];
        let options = JointOptions {
            learnt_from: 6,
            ..JointOptions::new(options.site.latitude_rad())
        };
        let best = bits(&fit_joint(&campaigns, &options).unwrap());
        for &level in SimdLevel::available() {
            let fit = fit_at(&campaigns, &options, level, UNWATCHED).unwrap();
            assert_eq!(bits(&fit), best, "{level}");
        }
        for threads in [1, 3] {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads);
            let fit = pool
                .build()
                .unwrap()
                .install(|| fit_joint(&campaigns, &options));
            assert_eq!(bits(&fit.unwrap()), best, "{threads} threads");
        }
    }
}
