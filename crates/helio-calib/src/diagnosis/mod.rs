//! From the records of one heliostat, as they come, to parameters that can be trusted or are refused.
//!
//! 1. Records that are no numbers or repeat others are set aside; calls that cannot be right are
//!    recognised by their size ([`WrongCall`]).
//! 2. A robust fit finds what most records agree on. It starts from the references that each record
//!    votes for in closed form, goes on by least trimmed squares over subsets and ends with Student's t, all on
//!    the *beam* residual: the reflected direction across the direction to the spot, which no beam misses.
//! 3. Zero-point jumps: the encoder references are constant within an epoch and jump between epochs;
//!    tilt, non-orthogonality and mirror tilt belong to steel and concrete and stay. So one model with
//!    shared geometry and references per epoch is fitted, and its segmentation found by dynamic
//!    programming. Another reading of all records is believed only where such epochs explain them worse.
//! 4. Records that do not fit are set aside with the reason ([`Reason`]).
//! 5. Each epoch is fitted by itself where its records determine that; otherwise with the shared geometry as prior.
//! 6. The gate: an epoch is refused as undetermined when the uncertainty of its parameters moves the beam by
//!    too much over the year's suns, counting errors that neighbouring suns share ([`CalibrateOptions::floor_mrad`]).

mod epochs;
mod finding;
mod gate;
mod joint;
mod reasons;
mod robust;
mod votes;
mod words;

use core::fmt;

pub use finding::{Finding, Reason, Rejected, WrongCall};
use helio_core::{Enu, TargetPlane};
pub use words::{Weakness, told_apart};

use crate::covariance::{Uncertainty, uncertainty};
use crate::error::CalibrationError;
use crate::fit::{Constraint, Fit, FitOptions, Start, all_or_none_stated, fit};
use crate::loss::median;
use crate::measures::beam_slopes;
use crate::model::Pose;
use crate::observation::{Mount, Observation};
use crate::parameters::Parameters;

/// What is known around a heliostat.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Context<'a> {
    /// Latitude of the site \[rad\], north positive: whose year of suns counts.
    pub site_latitude_rad: Option<f64>,
    /// Where the heliostat will aim; without it, the middle of the targets it was observed on.
    pub aim: Option<Enu>,
    /// Other heliostats whose records may have got among these.
    pub neighbours: &'a [Mount],
    /// Other targets on which spots may have been seen.
    pub targets: &'a [TargetPlane],
}

/// How to judge a campaign.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct CalibrateOptions {
    /// The fit of each epoch's kept records.
    pub fit: FitOptions,
    /// Set records aside that do not fit.
    pub reject: bool,
    /// Look for jumps of the zero points.
    pub jumps: bool,
    /// Largest predicted pointing uncertainty over the year \[mrad, RMS of the beam\] that still
    /// counts as determined.
    pub max_year_pointing_mrad: f64,
    /// Beam error that records of neighbouring suns share \[mrad, each direction\]: what a mount
    /// does beyond six angles. Residuals of a short campaign cannot show it. The default was chosen on five recorded
    /// heliostats of Jülich: with it, parameters from a stretch of a few weeks point at the other records as
    /// badly as predicted (RMS of found over predicted 0.94).
    pub floor_mrad: f64,
    /// Seed of the subsets of the robust start: the same seed gives the same bits.
    pub seed: u64,
}

impl Default for CalibrateOptions {
    /// Everything looked for; refused above 2 mrad over the year; 0.8 mrad shared error.
    fn default() -> Self {
        Self {
            fit: FitOptions::default(),
            reject: true,
            jumps: true,
            max_year_pointing_mrad: 2.0,
            floor_mrad: 0.8,
            seed: 1,
        }
    }
}

/// May the parameters be used?
#[derive(Debug, Clone, PartialEq)]
pub enum Verdict {
    /// Yes.
    Determined,
    /// No.
    Undetermined {
        /// In words, with what would help.
        why: String,
    },
}

impl Verdict {
    /// The word for columns.
    #[must_use]
    pub const fn as_str(&self) -> &'static str {
        match self {
            Self::Determined => "determined",
            Self::Undetermined { .. } => "undetermined",
        }
    }

    /// True if the parameters may be used.
    #[must_use]
    pub const fn is_determined(&self) -> bool {
        matches!(self, Self::Determined)
    }
}

impl fmt::Display for Verdict {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Determined => write!(f, "determined"),
            Self::Undetermined { why } => write!(f, "undetermined: {why}"),
        }
    }
}

/// A stretch of time with constant zero points.
#[derive(Debug, Clone, PartialEq)]
pub struct Epoch {
    /// Observations that its fit uses, in order of time.
    pub rows: Vec<usize>,
    /// Time of its first record, in nanoseconds from 1970 UTC, where known.
    pub from_unix_ns: Option<i64>,
    /// Time of its last record.
    pub to_unix_ns: Option<i64>,
    /// Its parameters; residuals and weights are in the order of `rows`.
    pub fit: Fit,
    /// How well the records determine them, as far as the residuals tell.
    pub uncertainty: Uncertainty,
    /// RMS over the year's suns of the beam error that the parameters' uncertainty causes \[mrad\], with
    /// errors that neighbouring suns share ([`CalibrateOptions::floor_mrad`]); `None` without latitude or where the
    /// records do not determine the parameters at all.
    pub year_pointing_mrad: Option<f64>,
    /// May they be used?
    pub verdict: Verdict,
    /// Which combination of parameters is determined worst, and what would help.
    pub weakness: Weakness,
    /// True if tilt, non-orthogonality and mirror tilt were held near those of the whole campaign.
    pub borrowed: bool,
}

/// The answer of [`calibrate`].
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Calibration {
    /// In order of time; empty where nothing could be fitted (see `findings`).
    pub epochs: Vec<Epoch>,
    /// Records left out, in their order.
    pub rejected: Vec<Rejected>,
    /// What was noticed.
    pub findings: Vec<Finding>,
}

/// What a mount does beyond six angles at least \[mrad, each direction of the beam\]: no record is called wrong and no
/// jump found for a few of these.
const QUIET_MRAD: f64 = 0.5;
/// A median beam error above this is no calibration \[mrad\].
const UNEXPLAINED_MRAD: f64 = 5.0;
/// Above this median other readings of the records are tried \[mrad\].
const SUSPECT_MRAD: f64 = 1.0;

/// What part of the error another reading of the records must leave at most. A large error asks for a plain
/// answer; a small one is told from chance by many records.
fn explained(as_given_mrad: f64, records: usize) -> f64 {
    match records {
        _ if as_given_mrad > UNEXPLAINED_MRAD => EXPLAINED,
        40.. => 0.75,
        20..40 => 0.5,
        12..20 => EXPLAINED,
        // six angles fit a dozen numbers whatever they mean
        _ => 0.0,
    }
}

/// Another reading of the records must leave this part of a large error at most.
const EXPLAINED: f64 = 0.25;
/// Other times are named only where at least so many records ...
const TIMES_RECORDS: usize = 12;
/// ... have at most this median beam error with them \[mrad\], refraction and declination being those of the given times.
const TIMES_MRAD: f64 = 2.5;
/// Records of an epoch that may not fit, one in so many: with more, the others' agreement may be chance.
const MOST_REJECTED: usize = 3;
/// No pedestal leans so far \[rad\].
const UPSIDE_DOWN_RAD: f64 = 0.8;
/// Suns nearer to each other than this are at one time \[rad\]: about two minutes.
const ONE_TIME_RAD: f64 = 0.009;

/// Calibrates one heliostat from its records as they come; see the [module](self) for how.
///
/// Nothing about the records but the last of these is an error: what is wrong with them is in the answer.
///
/// ```
/// # use helio_calib::{Mount, Observation, Parameters};
/// # use helio_core::{Enu, EnuUnit, MountAxes, PoseErrors, TargetPlane, TrackingMode};
/// use helio_calib::diagnosis::{CalibrateOptions, Context, calibrate};
/// # let north = EnuUnit::try_new(Enu::new(0.0, 1.0, 0.0))?;
/// # let mount = Mount {
/// #     axes: MountAxes::of(TrackingMode::AzimuthElevation, north),
/// #     pivot: Enu::new(0.0, 100.0, 0.0),
/// #     mirror_offset_m: 0.0,
/// #     pose_errors: PoseErrors::NONE,
/// # };
/// let records: Vec<Observation> = Vec::new();
/// let answer = calibrate(&mount, &records, &Context::default(), &CalibrateOptions::default())?;
/// assert!(answer.epochs.is_empty());
/// assert_eq!(answer.findings[0].as_str(), "too_few");
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
///
/// # Errors
/// [`CalibrationError`] for options that make no sense, a mount whose place is not finite, or records of which some
/// state a sigma and others none.
pub fn calibrate(
    mount: &Mount,
    observations: &[Observation],
    context: &Context<'_>,
    options: &CalibrateOptions,
) -> Result<Calibration, CalibrationError> {
    check(mount, options)?;
    let mut answer = Calibration::default();
    let rows = usable(observations, &mut answer.rejected);
    all_or_none_stated(rows.iter().map(|&row| (row, &observations[row])))?;
    let frame = joint::Frame::new(mount, &options.fit);
    let free = options.fit.free().count();
    let wanted = match options.fit.residual {
        crate::fit::ResidualForm::Components | crate::fit::ResidualForm::Beam => free.div_ceil(2),
        crate::fit::ResidualForm::Distance => free,
    };
    if rows.len() < wanted.max(1) {
        answer.findings.push(Finding::TooFew {
            found: rows.len(),
            wanted: wanted.max(1),
        });
        return Ok(answer);
    }
    let mut refused: Option<String> = None;
    let mut refuse = |finding: Finding, answer: &mut Calibration| {
        refused.get_or_insert_with(|| finding.to_string());
        answer.findings.push(finding);
    };
    let spread_rad = spread_rad(observations, &rows);
    if spread_rad < ONE_TIME_RAD {
        refuse(Finding::AllAtOneTime { spread_rad }, &mut answer);
    }
    if let Some(call) = votes::by_size(observations, &rows) {
        answer.findings.push(Finding::WrongCall {
            call,
            as_given_mrad: f64::NAN,
            corrected_mrad: f64::NAN,
        });
        return Ok(answer);
    }

    let mut records = joint::records(mount, observations, &rows);
    let (elected, _) = votes::elect(&frame, &records);
    let (model, scale) = robust::start(&frame, &records, &elected, options.seed, 0.5 * QUIET_MRAD);
    let one = vec![0; records.len()];
    let middle = median(
        joint::squares(&records, &one, &model)
            .into_iter()
            .map(libm::sqrt)
            .collect(),
    );
    let mut sound = true;
    let mut unexplained = false;
    let mut jumped = None;
    // A mount on its head fits records of one whose first axis counts the other way.
    let tilt_rad = libm::hypot(model.shared[0], model.shared[1]);
    if middle > SUSPECT_MRAD || tilt_rad > UPSIDE_DOWN_RAD {
        let as_given_mrad = votes::quick(&frame, &records).min(middle);
        let reading = votes::reread(
            mount,
            context.neighbours,
            context.targets,
            observations,
            &rows,
            &frame,
        );
        let plain = reading.filter(|reading| {
            reading.error_mrad < UNEXPLAINED_MRAD
                && (reading.error_mrad < explained(as_given_mrad, rows.len()) * as_given_mrad
                    || (tilt_rad > UPSIDE_DOWN_RAD && reading.call == WrongCall::Axis1Flipped))
        });
        let times = context.site_latitude_rad.and_then(|latitude_rad| {
            let share = match rows.len() {
                40.. => 0.6,
                20..40 => 0.4,
                TIMES_RECORDS..20 => 0.15,
                _ => return None,
            };
            let limit_mrad = TIMES_MRAD.min(share * as_given_mrad);
            let best = |half_hours| {
                votes::other_times(mount, latitude_rad, observations, &rows, &frame, half_hours)
            };
            // a small error is of a small offset, and half an hour nearer to the truth leaves less of it
            if as_given_mrad < UNEXPLAINED_MRAD && best(-1..=1)?.error_mrad > as_given_mrad {
                return None;
            }
            best(-23..=24).filter(|reading| reading.error_mrad < limit_mrad)
        });
        // of two that explain the records, the plainer one unless it explains them much less
        let named = match (plain, times) {
            (Some(plain), Some(times)) if times.error_mrad > 0.5 * plain.error_mrad => Some(plain),
            (plain, times) => times.or(plain),
        };
        let divided = named
            .as_ref()
            .filter(|_| options.jumps)
            .and_then(|reading| {
                let start = (model.clone(), scale);
                divided(&frame, &records, start, &reading.records, options.seed)
            });
        match named {
            Some(reading) if divided.is_none() => {
                sound = false;
                refuse(
                    Finding::WrongCall {
                        call: reading.call,
                        as_given_mrad,
                        corrected_mrad: reading.error_mrad,
                    },
                    &mut answer,
                );
            }
            // jumps may explain it yet
            _ => unexplained = middle > UNEXPLAINED_MRAD,
        }
        jumped = divided;
    }

    let (cuts, model, scale) = match jumped {
        Some((divided, epochs)) => {
            records = divided;
            epochs
        }
        None if options.jumps && sound => {
            epochs::find(&frame, &mut records, model, scale, QUIET_MRAD)
        }
        None => (vec![0], model, scale),
    };
    let epoch_of = epochs::epoch_of(&cuts, records.len());
    let (model, keep, sigma_mrad) = if options.reject && sound {
        robust::sift(&frame, &records, &epoch_of, model, scale, QUIET_MRAD)
    } else {
        (model, vec![true; records.len()], scale)
    };
    if unexplained {
        let median_mrad = median(
            joint::squares(&records, &epoch_of, &model)
                .into_iter()
                .map(libm::sqrt)
                .collect(),
        );
        if median_mrad > UNEXPLAINED_MRAD {
            refuse(Finding::Unexplained { median_mrad }, &mut answer);
        }
    }

    let campaign = Campaign {
        mount,
        observations,
        context,
        options,
        frame,
        records,
        epoch_of,
        keep,
        model,
        sigma_mrad: sigma_mrad.max(1e-3),
    };
    campaign.reject(&mut answer);
    campaign.jumps(&mut answer);
    campaign.epochs(refused.as_deref(), &mut answer)?;
    answer.rejected.sort_by_key(|r| r.row);
    Ok(answer)
}

type Divided = (Vec<joint::Record>, (epochs::Cuts, joint::Model, f64));

/// Records as given, divided at jumps of the zero points, unless another reading of them, divided likewise, explains
/// them better: what jumps leave around one set of references may look better mirrored, or as a neighbour's.
fn divided(
    frame: &joint::Frame,
    given: &[joint::Record],
    (model, scale): (joint::Model, f64),
    reading: &[joint::Record],
    seed: u64,
) -> Option<Divided> {
    let price = |(cuts, _, scale): &(epochs::Cuts, joint::Model, f64)| {
        epochs::price(given.len(), cuts, *scale)
    };
    let mut records = given.to_vec();
    let found = epochs::find(frame, &mut records, model, scale, QUIET_MRAD);
    let (cuts, model, _) = &found;
    if cuts.len() == 1 || libm::hypot(model.shared[0], model.shared[1]) > UPSIDE_DOWN_RAD {
        return None;
    }
    let mut theirs = reading.to_vec();
    let (elected, _) = votes::elect(frame, &theirs);
    let (model, scale) = robust::start(frame, &theirs, &elected, seed, 0.5 * QUIET_MRAD);
    let other = epochs::find(frame, &mut theirs, model, scale, QUIET_MRAD);
    (price(&found) <= price(&other)).then_some((records, found))
}

fn check(mount: &Mount, options: &CalibrateOptions) -> Result<(), CalibrationError> {
    for (what, value) in [
        ("pivot east", mount.pivot.east),
        ("pivot north", mount.pivot.north),
        ("pivot up", mount.pivot.up),
        ("mirror_offset_m", mount.mirror_offset_m),
    ] {
        if !value.is_finite() {
            return Err(CalibrationError::BadOption {
                what,
                wanted: "finite",
                value,
            });
        }
    }
    for (what, value) in [
        ("max_year_pointing_mrad", options.max_year_pointing_mrad),
        ("floor_mrad", options.floor_mrad),
    ] {
        if !(value > 0.0 && value.is_finite()) {
            return Err(CalibrationError::BadOption {
                what,
                wanted: "positive",
                value,
            });
        }
    }
    if options.fit.free().next().is_none() {
        return Err(CalibrationError::NothingFree);
    }
    Ok(())
}

/// Rows that can be computed with, in order of time; the others are rejected.
fn usable(observations: &[Observation], rejected: &mut Vec<Rejected>) -> Vec<usize> {
    let numbers = |o: &Observation| {
        let (s, c) = (o.sun.as_enu(), o.plane.centre);
        [
            s.east,
            s.north,
            s.up,
            o.axis1_rad,
            o.axis2_rad,
            o.u_m,
            o.v_m,
            c.east,
            c.north,
            c.up,
        ]
    };
    // equal numbers have equal bits, but for the sign of zero
    let key = |o: &Observation| numbers(o).map(|x| (x + 0.0).to_bits());
    let mut seen = std::collections::HashMap::new();
    let mut rows = Vec::new();
    for (row, observation) in observations.iter().enumerate() {
        let finite = numbers(observation).iter().all(|x| x.is_finite())
            && observation
                .sigma_m
                .is_none_or(|sigma_m| sigma_m > 0.0 && sigma_m.is_finite());
        let reason = if finite {
            match seen.entry(key(observation)) {
                std::collections::hash_map::Entry::Vacant(entry) => {
                    entry.insert(row);
                    None
                }
                std::collections::hash_map::Entry::Occupied(entry) => {
                    Some(Reason::Duplicate { of: *entry.get() })
                }
            }
        } else {
            Some(Reason::NotFinite)
        };
        match reason {
            None => rows.push(row),
            Some(reason) => rejected.push(Rejected {
                row,
                beam_mrad: f64::NAN,
                reason,
            }),
        }
    }
    // A record without a time stands after the one before it.
    let mut last = i64::MIN;
    let mut keyed: Vec<(i64, usize)> = rows
        .iter()
        .map(|&row| {
            last = observations[row].unix_ns.unwrap_or(last);
            (last, row)
        })
        .collect();
    keyed.sort_unstable();
    keyed.into_iter().map(|(_, row)| row).collect()
}

/// Largest angle between the first sun and any other \[rad\].
fn spread_rad(observations: &[Observation], rows: &[usize]) -> f64 {
    let Some(&first) = rows.first() else {
        return 0.0;
    };
    let first = observations[first].sun.as_enu();
    rows.iter()
        .map(|&row| {
            let sun = observations[row].sun.as_enu();
            libm::atan2(first.cross(sun).norm(), first.dot(sun))
        })
        .fold(0.0, f64::max)
}

/// A campaign that has been looked through.
struct Campaign<'a> {
    mount: &'a Mount,
    observations: &'a [Observation],
    context: &'a Context<'a>,
    options: &'a CalibrateOptions,
    frame: joint::Frame,
    records: Vec<joint::Record>,
    epoch_of: Vec<usize>,
    keep: Vec<bool>,
    model: joint::Model,
    /// Of the kept records around the model, per direction.
    sigma_mrad: f64,
}

impl Campaign<'_> {
    fn reject(&self, answer: &mut Calibration) {
        let left: Vec<usize> = (0..self.records.len()).filter(|&i| !self.keep[i]).collect();
        let rows: Vec<(usize, Parameters)> = left
            .iter()
            .map(|&i| (self.records[i].row, self.model.parameters(self.epoch_of[i])))
            .collect();
        let judge = reasons::Fitted {
            mount: self.mount,
            observations: self.observations,
            neighbours: self.context.neighbours,
            targets: self.context.targets,
            limit_mrad: 4.0 * self.sigma_mrad.max(QUIET_MRAD),
        };
        let poses = self.model.poses();
        for (&i, reason) in left.iter().zip(judge.reasons(&rows)) {
            answer.rejected.push(Rejected {
                row: self.records[i].row,
                beam_mrad: self.records[i].beam_mrad(&poses[self.epoch_of[i]]),
                reason,
            });
        }
    }

    /// Kept records of an epoch, as places in `records`.
    fn of_epoch(&self, epoch: usize) -> Vec<usize> {
        (0..self.records.len())
            .filter(|&i| self.epoch_of[i] == epoch && self.keep[i])
            .collect()
    }

    fn jumps(&self, answer: &mut Calibration) {
        let epochs: Vec<(usize, Vec<usize>)> = (0..self.model.references.len())
            .map(|epoch| (epoch, self.of_epoch(epoch)))
            .filter(|(_, members)| !members.is_empty())
            .collect();
        for pair in epochs.windows(2) {
            let [(earlier, before), (epoch, after)] = pair else {
                continue;
            };
            let (Some(&last), Some(&first)) = (before.last(), after.first()) else {
                continue;
            };
            let (last_before, first_after) = (self.records[last].row, self.records[first].row);
            let of = |k: usize| {
                1e3 * (self.model.references[*epoch][k] - self.model.references[*earlier][k])
            };
            answer.findings.push(Finding::Jump {
                last_before,
                first_after,
                after_unix_ns: self.observations[last_before].unix_ns,
                before_unix_ns: self.observations[first_after].unix_ns,
                axis1_mrad: of(0),
                axis2_mrad: of(1),
            });
        }
    }

    fn aim(&self) -> Enu {
        self.context.aim.unwrap_or_else(|| {
            let mut sum = Enu::default();
            for record in &self.records {
                sum = sum + self.observations[record.row].plane.centre;
            }
            sum * (1.0 / self.records.len().max(1) as f64)
        })
    }

    fn epochs(
        &self,
        refused: Option<&str>,
        answer: &mut Calibration,
    ) -> Result<(), CalibrationError> {
        let observed: Vec<_> = self
            .records
            .iter()
            .zip(&self.keep)
            .filter_map(|(r, &keep)| keep.then_some(self.observations[r.row].sun))
            .collect();
        let suns = match self.context.site_latitude_rad {
            Some(latitude_rad) => gate::year(latitude_rad),
            None => {
                answer.findings.push(Finding::NoLatitude);
                gate::sky(&observed)
            }
        };
        let count = self.model.references.len();
        for epoch in 0..count {
            let members = self.of_epoch(epoch);
            if members.is_empty() {
                continue;
            }
            let own = self.own(epoch, &members, &suns)?;
            let chosen = match own {
                Some(own) if own.verdict.is_determined() || count == 1 => Some(own),
                own => match self.borrow(epoch, &members, &suns)? {
                    Some(borrowed) => {
                        answer.findings.push(Finding::Borrowed {
                            epoch: answer.epochs.len(),
                        });
                        Some(borrowed)
                    }
                    None => own,
                },
            };
            match chosen {
                Some(mut chosen) => {
                    let all = self.epoch_of.iter().filter(|&&e| e == epoch).count();
                    let left = all - members.len();
                    if let Some(why) = refused {
                        chosen.verdict = Verdict::Undetermined {
                            why: why.to_owned(),
                        };
                    } else if left * MOST_REJECTED > all {
                        chosen.verdict = Verdict::Undetermined {
                            why: format!(
                                "{left} of {all} records do not fit: with more than one in \
                                 {MOST_REJECTED}, the others may agree by chance"
                            ),
                        };
                    }
                    answer.epochs.push(chosen);
                }
                None => answer.findings.push(Finding::TooFew {
                    found: members.len(),
                    wanted: self.options.fit.free().count().div_ceil(2),
                }),
            }
        }
        Ok(())
    }

    /// An epoch's own fit; `None` if it has too few records for one.
    fn own(
        &self,
        epoch: usize,
        members: &[usize],
        suns: &[helio_core::EnuUnit],
    ) -> Result<Option<Epoch>, CalibrationError> {
        let records: Vec<_> = members.iter().map(|&i| self.records[i]).collect();
        let epochs = vec![0; records.len()];
        let keep = vec![true; records.len()];
        let start = self.model.parameters(epoch);
        let options = FitOptions {
            start: Start::At(start),
            ..self.options.fit
        };
        let observations: Vec<Observation> =
            records.iter().map(|r| self.observations[r.row]).collect();
        let Some(fit) = few_is_none(fit(self.mount, &observations, &options))? else {
            return Ok(None);
        };
        let model = joint::Model::single(&fit.parameters);
        let sum: f64 = joint::squares(&records, &epochs, &model).iter().sum();
        let freedom = (2 * records.len()) as f64 - self.frame.count() as f64;
        let own_mrad = libm::sqrt(sum / freedom.max(1.0));
        // A few records fit themselves too well: an epoch has the noise of the whole campaign at least.
        let sigma_mrad = if self.model.references.len() > 1 {
            own_mrad.max(self.sigma_mrad)
        } else {
            own_mrad
        };
        let covariance = gate::covariance(
            &self.frame,
            &records,
            &epochs,
            &keep,
            &model,
            0,
            sigma_mrad,
            self.options.floor_mrad,
        );
        self.judge(
            &records,
            observations,
            fit,
            &options,
            covariance,
            suns,
            false,
        )
    }

    /// An epoch with the geometry of the whole campaign as prior.
    fn borrow(
        &self,
        epoch: usize,
        members: &[usize],
        suns: &[helio_core::EnuUnit],
    ) -> Result<Option<Epoch>, CalibrationError> {
        let covariance = gate::covariance(
            &self.frame,
            &self.records,
            &self.epoch_of,
            &self.keep,
            &self.model,
            epoch,
            self.sigma_mrad,
            self.options.floor_mrad,
        );
        let Some(covariance) = covariance else {
            return Ok(None);
        };
        let records: Vec<_> = members.iter().map(|&i| self.records[i]).collect();
        let whole = self.model.parameters(epoch);
        let mut options = FitOptions {
            start: Start::At(whole),
            ..self.options.fit
        };
        for k in joint::GEOMETRY {
            if matches!(options.constraints[k], Constraint::Free) {
                options.constraints[k] = Constraint::Prior {
                    mean: whole.values[k],
                    sigma: libm::sqrt(covariance[k][k]).max(1e-6),
                };
            }
        }
        // A prior has a standard deviation, so the records need one too.
        let stated = records
            .iter()
            .all(|r| self.observations[r.row].sigma_m.is_some());
        let observations: Vec<Observation> = records
            .iter()
            .map(|r| {
                let o = self.observations[r.row];
                let slant_m = (o.plane.point(o.u_m, o.v_m) - self.mount.pivot).norm();
                let sigma_mrad = self.sigma_mrad.max(self.options.floor_mrad);
                Observation {
                    sigma_m: if stated {
                        o.sigma_m
                    } else {
                        Some(1e-3 * sigma_mrad * slant_m)
                    },
                    ..o
                }
            })
            .collect();
        let Some(fit) = few_is_none(fit(self.mount, &observations, &options))? else {
            return Ok(None);
        };
        self.judge(
            &records,
            observations,
            fit,
            &options,
            Some(covariance),
            suns,
            true,
        )
    }

    #[allow(clippy::too_many_arguments)]
    fn judge(
        &self,
        records: &[joint::Record],
        observations: Vec<Observation>,
        fit: Fit,
        options: &FitOptions,
        covariance: Option<[[f64; crate::parameters::COUNT]; crate::parameters::COUNT]>,
        suns: &[helio_core::EnuUnit],
        borrowed: bool,
    ) -> Result<Option<Epoch>, CalibrationError> {
        let Some(uncertainty) = few_is_none(uncertainty(self.mount, &observations, &fit, options))?
        else {
            return Ok(None);
        };
        let aim = self.aim();
        let limit_mrad = self.options.max_year_pointing_mrad;
        let pose = Pose::of(&fit.parameters);
        let (tracked, slopes): (Vec<_>, Vec<_>) = suns
            .iter()
            .filter_map(|&sun| {
                let slopes = beam_slopes(self.mount, &fit.parameters, &pose, sun, aim)?;
                Some((sun, slopes))
            })
            .unzip();
        let pointing = covariance
            .as_ref()
            .and_then(|covariance| gate::pointing_mrad(covariance, &slopes));
        let along = |m: &[[f64; crate::parameters::COUNT]; crate::parameters::COUNT]| {
            let w = &uncertainty.weakest;
            let mut sum = 0.0;
            for (a, row) in m.iter().enumerate() {
                for (b, value) in row.iter().enumerate() {
                    sum += w[a] * value * w[b];
                }
            }
            libm::sqrt(sum.max(0.0))
        };
        let observed: Vec<_> = observations.iter().map(|o| o.sun).collect();
        let weakness = words::weakness(
            &uncertainty.weakest,
            covariance.as_ref().map_or(f64::INFINITY, along),
            &observed,
            &tracked,
            &slopes,
        );
        let verdict = if !fit.stop.converged() {
            Verdict::Undetermined {
                why: format!("the fit did not converge: {}", fit.stop.as_str()),
            }
        } else {
            match pointing {
                None => Verdict::Undetermined {
                    why: format!(
                        "{} records do not determine {} parameters; {weakness}",
                        records.len(),
                        uncertainty.free.len()
                    ),
                },
                Some(mrad) if mrad > limit_mrad => {
                    let (mrad, limit_mrad) = told_apart(mrad, limit_mrad);
                    Verdict::Undetermined {
                        why: format!(
                            "the beam would be uncertain by {mrad} mrad over the year, at most \
                             {limit_mrad} are allowed; {weakness}"
                        ),
                    }
                }
                Some(_) => Verdict::Determined,
            }
        };
        let times = |mut rows: Box<dyn Iterator<Item = usize> + '_>| {
            rows.find_map(|row| self.observations[row].unix_ns)
        };
        Ok(Some(Epoch {
            rows: records.iter().map(|r| r.row).collect(),
            from_unix_ns: times(Box::new(records.iter().map(|r| r.row))),
            to_unix_ns: times(Box::new(records.iter().rev().map(|r| r.row))),
            fit,
            uncertainty,
            year_pointing_mrad: pointing.filter(|_| self.context.site_latitude_rad.is_some()),
            verdict,
            weakness,
            borrowed,
        }))
    }
}

/// Too few records for a fit are no wrong call here.
fn few_is_none<T>(result: Result<T, CalibrationError>) -> Result<Option<T>, CalibrationError> {
    match result {
        Ok(value) => Ok(Some(value)),
        Err(CalibrationError::TooFew { .. }) => Ok(None),
        Err(error) => Err(error),
    }
}
