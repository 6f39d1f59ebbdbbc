//! Sets over the day, and how records weigh.

use std::borrow::Cow;

use helio_calib::diagnosis::told_apart;
use helio_calib::schedule::{HourSet, Schedule, Sets, fit_sets};
use helio_calib::{
    CalibrateOptions, Calibration, CalibrationError, Constraint, Context, Epoch, Fit, FitOptions,
    Mount, Observation, Parameter, Parameters, Start, Uncertainty, beam_errors_mrad,
};
use helio_core::angle::wrap_pi;

use super::{Choice, DoneSet, Exact, OK, RunError};
use crate::calibrated::errors_as_written;
use crate::observations::HeliostatObservations;
use crate::times::degrees_as_written;

/// Noise of records that leave nothing to tell it by, beside priors \[mrad\].
const UNTOLD_NOISE_MRAD: f64 = 1.0;

/// Sets that differ by less are one \[rad, m\]: a thousandth of what moves a beam by a microradian.
const SAME: f64 = 1e-9;

/// True if two sets are one.
fn same(one: &Parameters, other: &Parameters) -> bool {
    let pairs = one.values.iter().zip(&other.values);
    pairs.into_iter().all(|(a, b)| wrap_pi(a - b).abs() < SAME)
}

/// True if nothing states how sure the observations of a heliostat are.
#[must_use]
pub fn without_sigmas(of: &HeliostatObservations) -> bool {
    of.observations.iter().all(|seen| seen.sigma_m.is_none())
}

/// The numbers of a fit.
pub(super) fn fitted(fit: &Fit, uncertainty: &Uncertainty) -> DoneSet {
    // From here on the parameters are what reading the table gives.
    let written = errors_as_written(&fit.parameters.errors());
    let (tilt, lean) = uncertainty.tilt_standard_error(fit);
    let error = |parameter: Parameter| {
        if uncertainty.free.contains(&parameter) {
            uncertainty.standard_errors[parameter as usize]
        } else {
            f64::NAN
        }
    };
    let tilted = uncertainty.free.contains(&Parameter::Tilt1);
    DoneSet {
        errors: [
            written.pedestal_tilt_rad,
            written.pedestal_tilt_azimuth_rad,
            written.axis_nonorthogonality_rad,
            written.mirror_tilt_rad,
            written.azimuth_reference_rad,
            written.elevation_reference_rad,
        ]
        .map(Exact),
        mirror_offset_m: Exact(fit.parameters.mirror_offset_m()),
        free: uncertainty.free.iter().map(|&p| p as u8).collect(),
        sigmas: [
            if tilted { tilt } else { f64::NAN },
            lean.filter(|_| tilted).unwrap_or(f64::NAN),
            error(Parameter::AxisNonorthogonality),
            error(Parameter::MirrorTilt),
            error(Parameter::AzimuthReference),
            error(Parameter::ElevationReference),
            error(Parameter::MirrorOffset),
        ]
        .map(Exact),
        covariance: uncertainty.covariance.map(|row| row.map(Exact)),
        rms_mrad: Exact(fit.rms_mrad),
        beam_rms_mrad: Exact(fit.beam_rms_mrad),
        iterations: fit.iterations,
        condition: Exact(uncertainty.condition),
        rank: uncertainty.rank,
        degrees_of_freedom: uncertainty.degrees_of_freedom,
        sigma: Exact(uncertainty.sigma),
        ..DoneSet::without_result("", "")
    }
}

/// Observations for a fit with priors.
pub(super) struct Weighed<'a> {
    pub of: Cow<'a, HeliostatObservations>,
    /// What is to be said about their weights.
    pub said: Option<String>,
    /// Which prior contradicts them, in words.
    pub contradicted: Option<String>,
}

impl<'a> Weighed<'a> {
    fn as_it_is(of: &'a HeliostatObservations) -> Self {
        Self {
            of: Cow::Borrowed(of),
            said: None,
            contradicted: None,
        }
    }
}

/// Observations as a fit with priors may weigh them: priors state how sure they are, so where the observations do
/// not, each counts at the noise that a fit without the priors leaves. That fit also tells whether a prior is wrong.
pub(super) fn weighed<'a>(
    of: &'a HeliostatObservations,
    mount: &Mount,
    context: &Context<'_>,
    options: &CalibrateOptions,
) -> Result<Weighed<'a>, RunError> {
    let is_prior = |constraint: &Constraint| matches!(constraint, Constraint::Prior { .. });
    if !options.fit.constraints.iter().any(is_prior) {
        return Ok(Weighed::as_it_is(of));
    }
    let mut free = *options;
    for constraint in free.fit.constraints.iter_mut().filter(|c| is_prior(c)) {
        *constraint = Constraint::Free;
    }
    let found = helio_calib::calibrate(mount, &of.observations, context, &free)?;
    let contradicted = contradicted(&found, &options.fit.constraints);
    if contradicted.is_some() || !without_sigmas(of) {
        return Ok(Weighed {
            contradicted,
            ..Weighed::as_it_is(of)
        });
    }
    let (mut sum, mut freedom) = (0.0, 0.0);
    for epoch in found.epochs.iter().filter(|epoch| !epoch.borrowed) {
        let known = &epoch.uncertainty;
        if known.sigma.is_finite() {
            sum += known.sigma * known.sigma * known.degrees_of_freedom as f64;
            freedom += known.degrees_of_freedom as f64;
        }
    }
    let told_m = (sum / freedom).sqrt();
    let (sigma_m, said) = if told_m.is_finite() && told_m > 0.0 {
        (told_m, None)
    } else {
        let slants = of.observations.iter();
        let slants = slants.map(|seen| (seen.plane.centre - mount.pivot).norm());
        let slant_m = slants.sum::<f64>() / of.observations.len().max(1) as f64;
        let said = format!(
            "too few records to tell their noise by: beside the prior each counts as known to \
             {UNTOLD_NOISE_MRAD} mrad; sigma_m states it"
        );
        (1e-3 * UNTOLD_NOISE_MRAD * slant_m, Some(said))
    };
    let mut of = of.clone();
    for seen in &mut of.observations {
        seen.sigma_m = Some(sigma_m);
    }
    Ok(Weighed {
        of: Cow::Owned(of),
        said,
        contradicted: None,
    })
}

/// A prior farther from what the records say by themselves than so many standard deviations of both is wrong.
const CONTRADICTS: f64 = 10.0;

/// The first prior that contradicts what every epoch of a fit without priors says, in words.
fn contradicted(found: &Calibration, constraints: &[Constraint]) -> Option<String> {
    let told = |epoch: &&Epoch| {
        epoch.verdict.is_determined() && epoch.fit.stop.converged() && !epoch.borrowed
    };
    Parameter::ALL.into_iter().find_map(|parameter| {
        let k = parameter as usize;
        let Constraint::Prior { mean, sigma } = constraints[k] else {
            return None;
        };
        let is_length = parameter == Parameter::MirrorOffset;
        // The epoch that contradicts least: references jump.
        let (off, value, error) = found
            .epochs
            .iter()
            .filter(told)
            .map(|epoch| {
                let value = epoch.fit.parameters.values[k];
                let error = epoch.uncertainty.standard_errors[k];
                let way = value - mean;
                let way = if is_length { way } else { wrap_pi(way) };
                (way.abs() / sigma.hypot(error), value, error)
            })
            .min_by(|a, b| a.0.total_cmp(&b.0))?;
        if off <= CONTRADICTS || !off.is_finite() {
            return None;
        }
        let (unit, scaled): (&str, fn(f64) -> f64) = if is_length {
            ("m", |length_m| length_m)
        } else {
            ("degrees", degrees_as_written)
        };
        let (value, error) = (scaled(value), scaled(error));
        // Two digits of the standard error.
        let digits = (1.0 - error.log10().floor()).clamp(0.0, 9.0) as usize;
        Some(format!(
            "the prior on the {} contradicts the records: they say {value:.digits$} ± {error:.digits$} {unit}, \
             the prior {} ± {}",
            parameter.in_words(),
            scaled(mean),
            scaled(sigma)
        ))
    })
}

/// The sets over the day of a heliostat, epoch by epoch.
pub(super) struct Day<'a> {
    pub mount: &'a Mount,
    pub of: &'a HeliostatObservations,
    pub context: Context<'a>,
    pub options: &'a CalibrateOptions,
    pub asked: Sets,
    pub sets: Vec<DoneSet>,
    pub choices: Vec<Choice>,
    /// In words.
    pub said: Vec<String>,
}

impl Day<'_> {
    /// Divides an epoch where more sets do better than the one that it has. Each set passes the gate that the
    /// common one has passed; in the hours of one that does not, the common set holds.
    pub(super) fn divide(&mut self, whole: DoneSet) -> Result<(), RunError> {
        let kept: Vec<Observation> = whole
            .rows
            .iter()
            .map(|&row| self.of.observations[row])
            .collect();
        let start = Parameters::new(&whole.mount_errors(), whole.mirror_offset_m.0);
        let fit = FitOptions {
            start: Start::At(start),
            ..self.options.fit
        };
        let mut schedule = match fit_sets(self.mount, &kept, &fit, self.asked) {
            Ok(schedule) => schedule,
            // Too few for more than the one set that there is.
            Err(CalibrationError::TooFew { .. }) => {
                self.sets.push(whole);
                return Ok(());
            }
            Err(error) => return Err(error.into()),
        };
        let mut taken = schedule.sets.len();
        let mut sets = Vec::with_capacity(taken);
        if taken > 1 {
            for (k, set) in schedule.sets.iter_mut().enumerate() {
                let name = match whole.name.as_str() {
                    "" => set.name.clone(),
                    epoch => format!("{epoch} {}", set.name),
                };
                let seen: Vec<Observation> = set.rows.iter().map(|&row| kept[row]).collect();
                let own = self.judged(&seen, set, &start, whole.year_pointing_mrad.0)?;
                let of_its_own = own.is_ok();
                let (own, why) = match own {
                    Ok(own) => (own, String::new()),
                    Err(refused) => (whole.clone(), format!("the common set holds: {refused}")),
                };
                if !of_its_own {
                    set.fit.parameters = start;
                    self.said.push(format!("set {name}: {why}"));
                }
                sets.push((
                    of_its_own,
                    DoneSet {
                        name,
                        status: OK.to_owned(),
                        why,
                        valid_from_ns: whole.valid_from_ns,
                        valid_to_ns: whole.valid_to_ns,
                        hours_rad: Some([
                            (k > 0).then_some(Exact(set.hour_angle_from_rad)),
                            (k + 1 < taken).then_some(Exact(set.hour_angle_to_rad)),
                        ]),
                        rows: set.rows.iter().map(|&row| whole.rows[row]).collect(),
                        ..own
                    },
                ));
            }
        }
        let as_fitted = sets.iter().all(|(of_its_own, _)| *of_its_own);
        if sets.iter().any(|(of_its_own, _)| *of_its_own) {
            self.sets.extend(sets.into_iter().map(|(_, set)| set));
        } else {
            taken = 1;
            self.sets.push(whole);
        }
        for choice in &schedule.choices {
            let chosen = choice.sets == taken;
            // Where the common set holds in some hours, what the library found is of another schedule.
            let (seen_mrad, unseen_mrad) = if chosen && !as_fitted && taken > 1 {
                (self.beam_rms_mrad(&kept, &schedule), None)
            } else {
                (
                    choice.in_sample_beam_rms_mrad,
                    choice.cross_validated_beam_rms_mrad,
                )
            };
            self.choices.push(Choice {
                sets: choice.sets,
                chosen,
                beam_rms_mrad: Exact(seen_mrad),
                unseen_rms_mrad: unseen_mrad.map(Exact),
            });
        }
        Ok(())
    }

    /// RMS beam error of observations with the parameters of their hours \[mrad\]; infinite on a miss.
    fn beam_rms_mrad(&self, kept: &[Observation], schedule: &Schedule) -> f64 {
        let squares = kept.iter().map(|seen| {
            let parameters = schedule.at(seen.hour_angle_rad.unwrap_or(0.0));
            let error = beam_errors_mrad(self.mount, std::slice::from_ref(seen), &parameters)[0];
            if error.is_nan() {
                f64::INFINITY
            } else {
                error * error
            }
        });
        (squares.sum::<f64>() / kept.len() as f64).sqrt()
    }

    /// A set over the day that has passed the gate, or why it has not; the common set's pointing over the year
    /// is uncertain by `common_mrad`.
    fn judged(
        &self,
        seen: &[Observation],
        set: &HourSet,
        common: &Parameters,
        common_mrad: f64,
    ) -> Result<Result<DoneSet, String>, RunError> {
        if seen.is_empty() {
            return Ok(Err("there are no records of these hours".to_owned()));
        }
        if seen.len() == 1 {
            return Ok(Err("there is but one record of these hours".to_owned()));
        }
        if same(&set.fit.parameters, common) {
            return Ok(Err("its own records ask for no other".to_owned()));
        }
        let uncertainty = helio_calib::uncertainty(self.mount, seen, &set.fit, &set.options)?;
        // The prior on the departure states how sure it is, so the records must too.
        let mut seen = seen.to_vec();
        if uncertainty.sigma.is_finite() && uncertainty.sigma > 0.0 {
            for seen in &mut seen {
                seen.sigma_m = Some(seen.sigma_m.unwrap_or(1.0) * uncertainty.sigma);
            }
        }
        let options = CalibrateOptions {
            fit: set.options,
            reject: false,
            jumps: false,
            ..*self.options
        };
        let found = helio_calib::calibrate(self.mount, &seen, &self.context, &options)?;
        let epoch = match (found.epochs.into_iter().next(), found.findings.first()) {
            (Some(epoch), _) => epoch,
            (None, Some(finding)) => return Ok(Err(finding.to_string())),
            (None, None) => return Ok(Err("its records determine nothing".to_owned())),
        };
        // It departs from the common set: what that does not know, the set does not know either in as far
        // as the prior determines it and not its own records; and it is not better known at all.
        let by_records = (2 * seen.len()).saturating_sub(uncertainty.degrees_of_freedom);
        let borrowed = 1.0 - by_records as f64 / uncertainty.free.len().max(1) as f64;
        let year_mrad = epoch.year_pointing_mrad.map(|own_mrad| {
            own_mrad
                .hypot(borrowed.clamp(0.0, 1.0) * common_mrad)
                .max(common_mrad)
        });
        let limit_mrad = self.options.max_year_pointing_mrad;
        match (epoch.verdict, year_mrad) {
            // What would help the whole day is not said of a part of it.
            (_, Some(mrad)) if mrad > limit_mrad => {
                let (mrad, limit_mrad) = told_apart(mrad, limit_mrad);
                Ok(Err(format!(
                    "its own records leave the beam uncertain by {mrad} mrad over the year, at most \
                     {limit_mrad} are allowed"
                )))
            }
            (helio_calib::Verdict::Undetermined { why }, _) => Ok(Err(why)),
            _ if !set.fit.stop.converged() => {
                Ok(Err(format!("its fit ended with {}", set.fit.stop.as_str())))
            }
            (helio_calib::Verdict::Determined, _) => Ok(Ok(DoneSet {
                year_pointing_mrad: Exact(year_mrad.unwrap_or(f64::NAN)),
                ..fitted(&set.fit, &uncertainty)
            })),
        }
    }
}
