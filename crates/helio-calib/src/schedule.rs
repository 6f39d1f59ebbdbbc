//! Parameter sets over the day.
//!
//! Six angles do not say everything about a heliostat: gravity bends it otherwise in the morning than in
//! the afternoon. Guo 2015 §6 therefore gives each half of the day its own six. [`fit_sets`] fits one set,
//! two, or as many as predict unseen days best, and lays them side by side.
//!
//! # Bounds
//! Sets are bounded by the sun's hour angle: two at solar noon, more at equal shares of the records. The first
//! set begins and the last ends at midnight. Around a bound the tracker passes from one set to the next
//! linearly over [`BLEND_RAD`]; a set is therefore fitted to the records of that stretch on either side too.
//!
//! # Little data
//! Half a day's records determine six angles worse than a whole day's, or not at all. Each set is
//! therefore fitted as the common set and a departure from it, with a prior on the departure of each angle whose
//! standard deviation is [`DEPARTURE`] times what the common set leaves (its beam RMS). What the set's own
//! records determine better than that hardly notices; what they do not determine stays that of the common
//! set, and a set without any record is the common set.
//!
//! # Cross-validation
//! Records of one day share that day's wind, backlash and sun path, so whole days are left out, not single
//! records: [`FOLDS`] folds of days (drawn by a fixed seed), or each day by itself where there are fewer. The
//! parameters of the others predict the days left out, blended as the tracker blends. Records without a time
//! take no part in this. Bounds are those of all records: they depend on hours alone, not on spots.

use core::f64::consts::PI;

use helio_core::angle::wrap_pi;

use crate::error::CalibrationError;
use crate::fit::{Constraint, Fit, FitOptions, Start, Stop, fit};
use crate::measures::{beam_errors_mrad, measures};
use crate::observation::{Mount, Observation};
use crate::parameters::{COUNT, Parameter, Parameters};
use crate::random::Random;

/// Stretch of hour angle over which neighbouring sets blend \[rad\]: the 5° that tracking takes where a field
/// says nothing else.
pub const BLEND_RAD: f64 = 5.0 * (PI / 180.0);

/// Standard deviation of a set's departure from the common set, over what the common set leaves.
pub const DEPARTURE: f64 = 1.0;

/// Folds of cross-validation, where there are as many days.
pub const FOLDS: usize = 10;

/// A greater number of sets must lower the sum of squares on unseen days by so many standard errors.
const SURE: f64 = 2.0;
/// And by this share of itself.
const WORTH: f64 = 0.05;
/// Fits of each set, the prior weighed anew by what the one before left.
const ROUNDS: usize = 3;
/// Of the folds.
const SEED: u64 = 20_150_606;
/// Records of one day lie within so much of the solar noon \[ns\].
const HALF_DAY_NS: i64 = 43_200_000_000_000;

/// How many parameter sets a day has.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Sets {
    /// One.
    #[default]
    One,
    /// Morning and afternoon, as Guo 2015 §6.
    Two,
    /// As many as predict unseen days best, but no more than needed: a greater number is taken
    /// only where it lowers the mean square on the days left out by more than two standard errors of the difference,
    /// and by more than a twentieth of itself: less is not worth the sets.
    Auto {
        /// Most sets tried.
        max: usize,
    },
}

/// The parameters of some hours.
#[derive(Debug, Clone, PartialEq)]
pub struct HourSet {
    /// Empty for a single set; `morning` and `afternoon`; `1`, `2`, `3` …
    pub name: String,
    /// From which hour angle of the sun \[rad\], west positive; -π for the first.
    pub hour_angle_from_rad: f64,
    /// To which hour angle \[rad\]; π for the last.
    pub hour_angle_to_rad: f64,
    /// Observations it was fitted to, those within half a blend of its bounds included.
    pub rows: Vec<usize>,
    /// Its parameters; residuals and weights are in the order of `rows`. Without rows, or where no beam of
    /// the set's own fit lands, the parameters and RMS of the common set.
    pub fit: Fit,
    /// For [`uncertainty`](crate::uncertainty) of a set that has rows: the options of its fit, with the prior on
    /// its departure from the common set, without which few records would be refused.
    pub options: FitOptions,
}

/// What one number of sets comes to.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SetChoice {
    /// How many sets.
    pub sets: usize,
    /// RMS beam error on days that the parameters had not seen \[mrad\]; `None` without times, with less than two
    /// days, or where a fold could not be fitted.
    pub cross_validated_beam_rms_mrad: Option<f64>,
    /// RMS beam error on the observations themselves \[mrad\], blended as the tracker does.
    pub in_sample_beam_rms_mrad: f64,
    /// How many numbers were fitted.
    pub parameters: usize,
}

/// The sets of a day, and the others that were tried.
#[derive(Debug, Clone, PartialEq)]
pub struct Schedule {
    /// In order of hour angle, without gaps.
    pub sets: Vec<HourSet>,
    /// Every number of sets that was tried, one first.
    pub choices: Vec<SetChoice>,
    /// Days on which the observations with a known time were made.
    pub days: usize,
}

impl Schedule {
    /// The parameters at an hour angle of the sun \[rad\], west positive: those of its set, or a blend of two
    /// near a bound, just as tracking does it with the calibration table.
    #[must_use]
    pub fn at(&self, hour_angle_rad: f64) -> Parameters {
        let bounds: Vec<f64> = self.sets[1..]
            .iter()
            .map(|set| set.hour_angle_from_rad)
            .collect();
        let sets: Vec<Parameters> = self.sets.iter().map(|set| set.fit.parameters).collect();
        at(&bounds, &sets, hour_angle_rad)
    }
}

/// Fits the parameter sets of a day.
///
/// All choices up to the number of sets taken (or up to the greatest one tried) are compared in
/// [`Schedule::choices`].
///
/// # Errors
/// As [`fit`](crate::fit()) of all observations together; [`CalibrationError::BadValue`] for an observation
/// without hour angle where more than one set is asked for; [`CalibrationError::BadOption`] for a greatest
/// number of no sets, or more than 24.
///
/// ```
/// use helio_calib::schedule::{Sets, fit_sets};
/// use helio_calib::simulate::{SimulateOptions, simulate};
/// use helio_calib::{FitOptions, Mount, Parameters};
/// use helio_core::sun::SunSite;
/// use helio_core::{Enu, EnuUnit, MountAxes, PoseErrors, TargetPlane, TrackingMode};
/// let mount = Mount {
///     axes: MountAxes::of(TrackingMode::AzimuthElevation, EnuUnit::UP),
///     pivot: Enu::new(20.0, 120.0, 2.0),
///     mirror_offset_m: 0.2,
///     pose_errors: PoseErrors::NONE,
/// };
/// let north = EnuUnit::try_new(Enu::new(0.0, 1.0, 0.0))?;
/// let target = TargetPlane::level(Enu::new(0.0, 0.0, 40.0), north);
/// let site = SunSite::new(0.889, 0.111, 90.0)?;
/// let truth = Parameters { values: [0.001, 0.0, 0.002, 0.0, 0.0, 0.001, 0.2] };
/// let campaign = simulate(&mount, &truth, &[target], &site, &SimulateOptions::default())?;
/// let options = FitOptions::default();
/// let schedule = fit_sets(&mount, &campaign.observations, &options, Sets::Auto { max: 3 })?;
/// // The same errors all day: one set is enough.
/// assert_eq!(schedule.sets.len(), 1);
/// assert_eq!(schedule.choices.len(), 3);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn fit_sets(
    mount: &Mount,
    observations: &[Observation],
    options: &FitOptions,
    how: Sets,
) -> Result<Schedule, CalibrationError> {
    let most = match how {
        Sets::One => 1,
        Sets::Two => 2,
        Sets::Auto { max } => max,
    };
    if !(1..=24).contains(&most) {
        return Err(CalibrationError::BadOption {
            what: "most parameter sets a day",
            wanted: "between 1 and 24",
            value: most as f64,
        });
    }
    let hours = hours(observations, most)?;
    let days = days(observations);
    let count_of_days = days.iter().flatten().max().map_or(0, |last| last + 1);
    let folds = folds(&days, count_of_days);
    let mut choices = Vec::with_capacity(most);
    let mut squares = Vec::with_capacity(most);
    let mut kept: Option<(Vec<f64>, Vec<Part>)> = None;
    let mut best = 0;
    for sets in 1..=most {
        let bounds = bounds(&hours, sets);
        let all: Vec<usize> = (0..observations.len()).collect();
        let parts = fit_parts(mount, observations, &hours, &all, options, &bounds)?;
        let unseen = folds
            .as_ref()
            .and_then(|folds| cross_validate(mount, observations, &hours, folds, options, &bounds));
        let errors = errors_mrad(mount, observations, &hours, &all, &bounds, &parts);
        choices.push(SetChoice {
            sets,
            cross_validated_beam_rms_mrad: unseen
                .as_deref()
                .map(|squares| root_mean(squares.iter().flatten().copied())),
            in_sample_beam_rms_mrad: root_mean(errors.iter().map(|error| error * error)),
            parameters: sets * options.free().count(),
        });
        squares.push(unseen);
        let take = match how {
            Sets::One | Sets::Two => sets == most,
            Sets::Auto { .. } => {
                sets == 1 || better(&squares[best], &squares[sets - 1], &days, count_of_days)
            }
        };
        if take {
            best = sets - 1;
            kept = Some((bounds, parts));
        }
    }
    let Some((bounds, parts)) = kept else {
        return Err(CalibrationError::NothingFree); // one of 1..=most was taken
    };
    let count = parts.len();
    let sets = parts
        .into_iter()
        .enumerate()
        .map(|(k, part)| HourSet {
            name: name(k, count),
            hour_angle_from_rad: if k == 0 { -PI } else { bounds[k - 1] },
            hour_angle_to_rad: bounds.get(k).copied().unwrap_or(PI),
            rows: part.rows,
            fit: part.fit,
            options: part.stated,
        })
        .collect();
    Ok(Schedule {
        sets,
        choices,
        days: count_of_days,
    })
}

fn name(index: usize, count: usize) -> String {
    match (index, count) {
        (_, 1) => String::new(),
        (0, 2) => "morning".into(),
        (_, 2) => "afternoon".into(),
        _ => (index + 1).to_string(),
    }
}

/// Hour angles of the observations; zeros where one set needs none.
fn hours(observations: &[Observation], most: usize) -> Result<Vec<f64>, CalibrationError> {
    observations
        .iter()
        .enumerate()
        .map(|(row, observation)| match observation.hour_angle_rad {
            Some(hour) if hour.is_finite() => Ok(wrap_pi(hour)),
            _ if most == 1 => Ok(0.0),
            hour => Err(CalibrationError::BadValue {
                row,
                what: "hour_angle_rad",
                wanted: "known where the day has more than one parameter set",
                value: hour.unwrap_or(f64::NAN),
            }),
        })
        .collect()
}

/// Bounds between sets: noon for two, equal shares of the records for more.
fn bounds(hours: &[f64], sets: usize) -> Vec<f64> {
    if sets == 2 {
        return vec![0.0];
    }
    let mut sorted = hours.to_vec();
    sorted.sort_by(f64::total_cmp);
    let mut bounds: Vec<f64> = (1..sets)
        .map(|k| {
            let place = k * sorted.len() / sets;
            let at = |place: usize| sorted.get(place).copied().unwrap_or(0.0);
            0.5 * (at(place.saturating_sub(1)) + at(place))
        })
        .collect();
    // Sets no narrower than a blend, or the blends would run into each other.
    for k in 1..bounds.len() {
        bounds[k] = bounds[k].max(bounds[k - 1] + BLEND_RAD);
    }
    bounds
}

/// One set, not yet named.
struct Part {
    rows: Vec<usize>,
    fit: Fit,
    /// Priors at the sigmas they mean, as the uncertainty counts them.
    stated: FitOptions,
}

/// Fits the sets to some of the observations.
fn fit_parts(
    mount: &Mount,
    observations: &[Observation],
    hours: &[f64],
    rows: &[usize],
    options: &FitOptions,
    bounds: &[f64],
) -> Result<Vec<Part>, CalibrationError> {
    let pick = |rows: &[usize]| -> Vec<Observation> {
        rows.iter().map(|&row| observations[row]).collect()
    };
    let common = fit(mount, &pick(rows), options)?;
    if bounds.is_empty() || common.stop == Stop::NoLanding {
        let whole = |_| Part {
            rows: rows.to_vec(),
            fit: common.clone(),
            stated: *options,
        };
        return Ok((0..=bounds.len()).map(whole).collect());
    }
    let freedom = |records: usize, sets: usize| {
        (2 * records)
            .saturating_sub(sets * options.free().count())
            .max(1) as f64
    };
    let slants = rows
        .iter()
        .map(|&row| (observations[row].plane.centre - mount.pivot).norm());
    let slant_m = slants.sum::<f64>() / rows.len() as f64;
    // The fit weighs priors against residuals over their sigmas, whatever those are worth: what the sets
    // leave says that. Before there are sets, what the common one leaves.
    let mut scale =
        libm::sqrt(weighted_squares(observations, rows, &common) / freedom(rows.len(), 1));
    let stated = departing(&common, slant_m, 1.0, options);
    let mut parts = Vec::new();
    for _ in 0..ROUNDS {
        let options = departing(&common, slant_m, scale, options);
        parts.clear();
        for k in 0..=bounds.len() {
            let from = if k == 0 {
                f64::NEG_INFINITY
            } else {
                bounds[k - 1] - 0.5 * BLEND_RAD
            };
            let to = bounds
                .get(k)
                .map_or(f64::INFINITY, |bound| bound + 0.5 * BLEND_RAD);
            let own: Vec<usize> = rows
                .iter()
                .copied()
                .filter(|&row| (from..=to).contains(&hours[row]))
                .collect();
            let fit = fit_part(mount, &pick(&own), &common, &options)?;
            parts.push(Part {
                rows: own,
                fit,
                stated,
            });
        }
        let squares = parts
            .iter()
            .map(|part| weighted_squares(observations, &part.rows, &part.fit));
        let records = parts.iter().map(|part| part.rows.len()).sum();
        scale = libm::sqrt(squares.sum::<f64>() / freedom(records, parts.len()));
    }
    Ok(parts)
}

/// One set; the common one where it has no records, or none of them can be reached.
fn fit_part(
    mount: &Mount,
    observations: &[Observation],
    common: &Fit,
    options: &FitOptions,
) -> Result<Fit, CalibrationError> {
    if !observations.is_empty() {
        let fit = fit(mount, observations, options)?;
        if fit.stop != Stop::NoLanding {
            return Ok(fit);
        }
    }
    let residuals_m = if observations.is_empty() {
        Vec::new()
    } else {
        measures(mount, observations, &common.parameters).0
    };
    Ok(Fit {
        weights: vec![1.0; residuals_m.len()],
        residuals_m,
        ..common.clone()
    })
}

/// Sum of squares of a fit's residuals over their sigmas, without priors; misses do not count.
fn weighted_squares(observations: &[Observation], rows: &[usize], fit: &Fit) -> f64 {
    rows.iter()
        .zip(fit.residuals_m.iter().zip(&fit.weights))
        .map(|(&row, ([du, dv], weight))| {
            let sigma = observations[row].sigma_m.unwrap_or(1.0);
            weight * (du * du + dv * dv) / (sigma * sigma)
        })
        .filter(|square| square.is_finite())
        .sum()
}

/// Options of a set: near the common one, by a prior on what may depart; `scale` is what a residual over its
/// sigma really is.
fn departing(common: &Fit, slant_m: f64, scale: f64, options: &FitOptions) -> FitOptions {
    let mut near = *options;
    near.start = Start::At(common.parameters);
    let departure_rad = DEPARTURE * 1e-3 * common.beam_rms_mrad;
    let sensible = |value: f64| value.is_finite() && value > 0.0;
    if !(sensible(departure_rad) && sensible(scale)) {
        return near; // nothing is left to explain
    }
    for parameter in Parameter::ALL {
        let k = parameter as usize;
        if near.constraints[k] == Constraint::Held {
            continue;
        }
        let departure = match parameter {
            Parameter::MirrorOffset => departure_rad * slant_m,
            _ => departure_rad,
        };
        near.constraints[k] = Constraint::Prior {
            mean: common.parameters.values[k],
            sigma: departure / scale,
        };
    }
    near
}

/// The parameters at an hour angle, as tracking blends them: linearly, the tilt by its components, the references
/// the short way round.
fn at(bounds: &[f64], sets: &[Parameters], hour_angle_rad: f64) -> Parameters {
    let hour = wrap_pi(hour_angle_rad);
    let mut before = f64::NEG_INFINITY;
    for (k, &middle) in bounds.iter().enumerate() {
        let after = bounds.get(k + 1).copied().unwrap_or(f64::INFINITY);
        let half = (0.5 * BLEND_RAD)
            .min(0.5 * (middle - before))
            .min(0.5 * (after - middle));
        if hour < middle - half {
            return sets[k];
        }
        if hour < middle + half {
            let weight = (hour - (middle - half)) / (2.0 * half);
            return blend(&sets[k], &sets[k + 1], weight);
        }
        before = middle;
    }
    sets[bounds.len()]
}

fn blend(from: &Parameters, to: &Parameters, weight: f64) -> Parameters {
    let mut values = [0.0; COUNT];
    for parameter in Parameter::ALL {
        let k = parameter as usize;
        let way = to.values[k] - from.values[k];
        let way = match parameter {
            Parameter::AzimuthReference | Parameter::ElevationReference => wrap_pi(way),
            _ => way,
        };
        values[k] = from.values[k] + weight * way;
    }
    Parameters { values }
}

/// Beam errors of some rows with the parameters of their hours \[mrad\]; infinite on a miss.
fn errors_mrad(
    mount: &Mount,
    observations: &[Observation],
    hours: &[f64],
    rows: &[usize],
    bounds: &[f64],
    parts: &[Part],
) -> Vec<f64> {
    let sets: Vec<Parameters> = parts.iter().map(|part| part.fit.parameters).collect();
    rows.iter()
        .map(|&row| {
            let parameters = at(bounds, &sets, hours[row]);
            let error = beam_errors_mrad(mount, &observations[row..=row], &parameters)[0];
            if error.is_nan() { f64::INFINITY } else { error }
        })
        .collect()
}

/// Squares of the beam errors of every row that has a fold, predicted from the others; `None` if a fold
/// could not be fitted or a beam misses.
fn cross_validate(
    mount: &Mount,
    observations: &[Observation],
    hours: &[f64],
    folds: &[Option<usize>],
    options: &FitOptions,
    bounds: &[f64],
) -> Option<Vec<Option<f64>>> {
    let count = folds.iter().flatten().max()? + 1;
    let mut squares = vec![None; observations.len()];
    for fold in 0..count {
        let rows = |out: bool| -> Vec<usize> {
            let of = |&row: &usize| folds[row].is_some_and(|own| (own == fold) == out);
            (0..observations.len()).filter(of).collect()
        };
        let (out, kept) = (rows(true), rows(false));
        let parts = fit_parts(mount, observations, hours, &kept, options, bounds).ok()?;
        let errors = errors_mrad(mount, observations, hours, &out, bounds, &parts);
        for (row, error) in out.into_iter().zip(errors) {
            squares[row] = Some(error * error);
        }
    }
    let all_hit = squares.iter().flatten().all(|square| square.is_finite());
    all_hit.then_some(squares)
}

/// The day of every observation, counted from 0 in order of time: those about one solar noon. `None` where the
/// time is not known.
fn days(observations: &[Observation]) -> Vec<Option<usize>> {
    let mut noons: Vec<(i64, usize)> = observations
        .iter()
        .enumerate()
        .filter_map(|(row, observation)| {
            let hour = observation.hour_angle_rad.filter(|hour| hour.is_finite())?;
            let since_noon_ns = (wrap_pi(hour) / PI * HALF_DAY_NS as f64) as i64;
            Some((observation.unix_ns?.saturating_sub(since_noon_ns), row))
        })
        .collect();
    noons.sort_unstable();
    let mut days = vec![None; observations.len()];
    let mut day = 0;
    for (k, &(noon, row)) in noons.iter().enumerate() {
        if k > 0 && noon.saturating_sub(noons[k - 1].0) > HALF_DAY_NS {
            day += 1;
        }
        days[row] = Some(day);
    }
    days
}

/// The fold of every observation whose day is known; `None` if there is only one day.
fn folds(days: &[Option<usize>], count: usize) -> Option<Vec<Option<usize>>> {
    if count < 2 {
        return None;
    }
    let mut order: Vec<usize> = (0..count).collect();
    Random::new(SEED).shuffle(&mut order);
    let mut fold_of_day = vec![0; count];
    for (place, day) in order.into_iter().enumerate() {
        fold_of_day[day] = place % FOLDS.min(count);
    }
    Some(days.iter().map(|day| Some(fold_of_day[(*day)?])).collect())
}

/// Squares of the rows that took part in a cross-validation; none if it failed.
type Unseen = Option<Vec<Option<f64>>>;

/// True if the second number of sets predicts unseen days better, by more than two standard errors of the
/// difference over days and by more than it takes to be worth it.
fn better(now: &Unseen, then: &Unseen, days: &[Option<usize>], count: usize) -> bool {
    let (Some(now), Some(then)) = (now, then) else {
        return false;
    };
    let mut gains = vec![0.0; count];
    let mut before = 0.0;
    for ((now, then), day) in now.iter().zip(then).zip(days) {
        if let (Some(now), Some(then), Some(day)) = (now, then, day) {
            gains[*day] += now - then;
            before += now;
        }
    }
    let sum: f64 = gains.iter().sum();
    let days = count as f64;
    let spread: f64 = gains.iter().map(|gain| (gain - sum / days).powi(2)).sum();
    // standard error of a sum over days
    sum > WORTH * before && sum > SURE * libm::sqrt(spread * days / (days - 1.0))
}

fn root_mean(squares: impl Iterator<Item = f64>) -> f64 {
    let (sum, count) = squares.fold((0.0, 0.0), |(sum, count), square| {
        (sum + square, count + 1.0)
    });
    libm::sqrt(sum / count)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::simulate::{Aiming, SimulateOptions, simulate};
    use helio_core::sun::SunSite;
    use helio_core::{Enu, EnuUnit, MountAxes, PoseErrors, TargetPlane, TrackingMode};

    fn mount() -> Mount {
        Mount {
            axes: MountAxes::of(TrackingMode::AzimuthElevation, EnuUnit::UP),
            pivot: Enu::new(30.0, 140.0, 2.0),
            mirror_offset_m: 0.2,
            pose_errors: PoseErrors::NONE,
        }
    }

    #[test]
    fn a_gain_is_taken_that_is_sure_and_worth_its_sets() {
        let days: Vec<Option<usize>> = (0..40).map(|row| Some(row / 4)).collect();
        let now: Unseen = Some(vec![Some(1.0); 40]);
        // steady from day to day, or of one day only
        let steady = |gain: f64| -> Unseen { Some(vec![Some(1.0 - gain); 40]) };
        assert!(!better(&now, &steady(0.04), &days, 10));
        assert!(better(&now, &steady(0.06), &days, 10));
        let of_a_day = (0..40).map(|row| Some(if row < 4 { 0.1 } else { 1.0 }));
        assert!(!better(&now, &Some(of_a_day.collect()), &days, 10));
        assert!(!better(&now, &None, &days, 10));
    }

    const MORNING: [f64; COUNT] = [0.002, -0.001, 0.004, 0.001, -0.003, 0.002, 0.2];

    fn seen(values: [f64; COUNT], options: &SimulateOptions) -> Vec<Observation> {
        let north = EnuUnit::try_new(Enu::new(0.0, 1.0, 0.0)).unwrap();
        let targets = [(0.0, 40.0), (-18.0, 50.0)]
            .map(|(east, up)| TargetPlane::level(Enu::new(east, -3.0, up), north));
        let site = SunSite::new(0.8886, 0.1115, 88.0).unwrap();
        let options = SimulateOptions {
            aiming: Aiming::Board {
                half_width_m: 4.0,
                half_height_m: 3.5,
            },
            noise_mrad: 0.4,
            ..options.clone()
        };
        simulate(&mount(), &Parameters { values }, &targets, &site, &options)
            .unwrap()
            .observations
    }

    /// A heliostat that has other errors in the afternoon; nothing is seen while sets blend.
    fn bent(by: f64, count: usize, seed: u64) -> Vec<Observation> {
        let half = |hours, seed| SimulateOptions {
            seed,
            count: count / 2,
            hours,
            days: Some(count / 6),
            ..SimulateOptions::default()
        };
        let mut afternoon = MORNING;
        afternoon[0] += by;
        afternoon[4] -= by;
        let mut all = seen(MORNING, &half([6.0, 11.8], seed));
        all.extend(seen(afternoon, &half([12.2, 18.0], seed + 1)));
        all
    }

    #[test]
    fn a_heliostat_that_bends_gets_two_sets_and_a_straight_one_keeps_one() {
        let (mut two, mut one) = (0, 0);
        for seed in 0..20 {
            let options = FitOptions::default();
            let how = Sets::Auto { max: 2 };
            let schedule = fit_sets(&mount(), &bent(0.002, 80, 2 * seed), &options, how).unwrap();
            two += usize::from(schedule.sets.len() == 2);
            let schedule = fit_sets(&mount(), &bent(0.0, 80, 2 * seed), &options, how).unwrap();
            one += usize::from(schedule.sets.len() == 1);
            let [single, double] = schedule.choices[..] else {
                panic!("{:?}", schedule.choices);
            };
            assert!(double.in_sample_beam_rms_mrad <= single.in_sample_beam_rms_mrad * 1.01);
            assert_eq!((single.parameters, double.parameters), (6, 12));
        }
        println!("of 20: bent ones with two sets {two}, straight ones with one {one}");
        assert_eq!(two, 20);
        assert!(one >= 17, "{one}");
    }

    #[test]
    fn two_sets_find_both_truths() {
        let options = FitOptions::default();
        let observations = bent(0.003, 400, 5);
        let schedule = fit_sets(&mount(), &observations, &options, Sets::Two).unwrap();
        let names: Vec<&str> = schedule.sets.iter().map(|set| set.name.as_str()).collect();
        assert_eq!(names, ["morning", "afternoon"]);
        assert_eq!(schedule.sets[0].hour_angle_from_rad, -PI);
        assert_eq!(schedule.sets[0].hour_angle_to_rad, 0.0);
        assert_eq!(schedule.sets[1].hour_angle_to_rad, PI);
        // Half a day determines the beam, not each angle: on suns that nobody has seen it goes where it shall.
        let one = fit(&mount(), &observations, &options).unwrap().parameters;
        let mut squares = [0.0; 2];
        let unseen = bent(0.003, 600, 77);
        for observation in &unseen {
            let hour = observation.hour_angle_rad.unwrap();
            let mut truth = MORNING;
            if hour > 0.0 {
                truth[0] += 0.003;
                truth[4] -= 0.003;
            }
            // a spot without its noise
            let mut seen = *observation;
            let values = Parameters { values: truth };
            let off = measures(&mount(), &[seen], &values).0[0];
            seen.u_m += off[0];
            seen.v_m += off[1];
            assert!(beam_errors_mrad(&mount(), &[seen], &values)[0] < 1e-6);
            for (sum, parameters) in squares.iter_mut().zip([schedule.at(hour), one]) {
                *sum += beam_errors_mrad(&mount(), &[seen], &parameters)[0].powi(2) / 600.0;
            }
        }
        let [two, one] = squares.map(f64::sqrt);
        println!("beam error on unseen suns: two sets {two:.3} mrad, one {one:.3}");
        // 0.4 sqrt(2) mrad of noise, twelve numbers from 400 observations: 0.07 mrad
        assert!(two < 0.14 && one > 1.0, "{two} {one}");
        let tilt = |set: usize| schedule.sets[set].fit.parameters.get(Parameter::Tilt1);
        // Half way at the bound, and nothing but the sets themselves outside the blend.
        let middle = schedule.at(0.0).get(Parameter::Tilt1);
        assert!((middle - 0.5 * (tilt(0) + tilt(1))).abs() < 1e-15);
        assert_eq!(
            schedule.at(-0.6 * BLEND_RAD),
            schedule.sets[0].fit.parameters
        );
        assert_eq!(
            schedule.at(0.6 * BLEND_RAD),
            schedule.sets[1].fit.parameters
        );
    }

    #[test]
    fn a_half_day_without_records_borrows_from_the_other() {
        let morning = SimulateOptions {
            count: 30,
            hours: [7.0, 11.0],
            ..SimulateOptions::default()
        };
        let mut observations = seen(MORNING, &morning);
        let options = FitOptions::default();
        let schedule = fit_sets(&mount(), &observations, &options, Sets::Two).unwrap();
        let one = fit(&mount(), &observations, &options).unwrap();
        assert!(schedule.sets[1].rows.is_empty());
        assert_eq!(schedule.sets[1].fit.parameters, one.parameters);
        // One record of the afternoon tells two numbers of six; the rest stays near.
        let afternoon = SimulateOptions {
            seed: 3,
            count: 1,
            hours: [14.0, 15.0],
            ..SimulateOptions::default()
        };
        observations.extend(seen(MORNING, &afternoon));
        let schedule = fit_sets(&mount(), &observations, &options, Sets::Two).unwrap();
        let set = &schedule.sets[1];
        assert_eq!(set.rows, [30]);
        let known = crate::uncertainty(&mount(), &observations[30..], &set.fit, &set.options);
        assert!(known.unwrap().covariance[0][0] > 0.0);
        let [first, second] = [0, 1].map(|k| schedule.sets[k].fit.parameters);
        for k in 0..6 {
            let off = second.values[k] - first.values[k];
            assert!(off.abs() < 0.002, "{k}: {off}");
        }
    }

    #[test]
    fn days_are_those_of_the_sun() {
        // Two observations of one afternoon in the far west, either side of midnight UTC, and one next day.
        let mut observations = seen(
            MORNING,
            &SimulateOptions {
                count: 3,
                ..SimulateOptions::default()
            },
        );
        let hour = 3_600_000_000_000;
        for (k, (at, angle)) in [(23, 1.0), (25, 1.5236), (47, 1.0)].into_iter().enumerate() {
            observations[k].unix_ns = Some(1_750_000_000_000_000_000 + at * hour);
            observations[k].hour_angle_rad = Some(angle);
        }
        assert_eq!(days(&observations), [Some(0), Some(0), Some(1)]);
        observations[0].unix_ns = None;
        assert_eq!(days(&observations), [None, Some(0), Some(1)]);
        let folds = folds(&days(&observations), 2).unwrap();
        assert!(folds[0].is_none() && folds[1] != folds[2]);
    }

    #[test]
    fn what_cannot_be_is_refused() {
        let options = FitOptions::default();
        let mut observations = bent(0.0, 24, 1);
        observations[3].hour_angle_rad = None;
        let message = |how| {
            let error = fit_sets(&mount(), &observations, &options, how).unwrap_err();
            error.to_string()
        };
        assert_eq!(
            message(Sets::Two),
            "observation 3: hour_angle_rad must be known where the day has more than one parameter set, got NaN"
        );
        assert_eq!(
            message(Sets::Auto { max: 0 }),
            "most parameter sets a day must be between 1 and 24, got 0"
        );
        // One set needs no hours.
        let schedule = fit_sets(&mount(), &observations, &options, Sets::One).unwrap();
        assert_eq!((schedule.sets.len(), schedule.choices.len()), (1, 1));
        assert_eq!(schedule.sets[0].name, "");
    }
}
