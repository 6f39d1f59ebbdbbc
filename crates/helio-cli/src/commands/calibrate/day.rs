//! Sets over the day, and how records weigh.

use std::borrow::Cow;

use helio_calib::schedule::{HourSet, Sets, fit_sets};
use helio_calib::{
    CalibrateOptions, CalibrationError, Constraint, Context, Fit, FitOptions, Mount, Observation,
    Parameter, Parameters, Start, Uncertainty,
};
use helio_io::{HeliostatObservations, errors_as_written};

use super::OK;
use crate::calibration::{Choice, DoneSet, Exact};
use crate::failure::Failure;

/// Noise of records that leave nothing to tell it by, beside priors \[mrad\].
const UNTOLD_NOISE_MRAD: f64 = 1.0;

/// True if nothing states how sure the observations of a heliostat are.
pub(super) fn without_sigmas(of: &HeliostatObservations) -> bool {
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

/// Observations as a fit with priors may weigh them: priors state how sure they are, so where the observations do
/// not, each counts at the noise that a fit without the priors leaves. Also what is to be said about that.
pub(super) fn weighed<'a>(
    of: &'a HeliostatObservations,
    mount: &Mount,
    context: &Context<'_>,
    options: &CalibrateOptions,
) -> Result<(Cow<'a, HeliostatObservations>, Option<String>), Failure> {
    let is_prior = |constraint: &Constraint| matches!(constraint, Constraint::Prior { .. });
    if !options.fit.constraints.iter().any(is_prior) || !without_sigmas(of) {
        return Ok((Cow::Borrowed(of), None));
    }
    let mut free = *options;
    for constraint in free.fit.constraints.iter_mut().filter(|c| is_prior(c)) {
        *constraint = Constraint::Free;
    }
    let found = helio_calib::calibrate(mount, &of.observations, context, &free)?;
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
    Ok((Cow::Owned(of), said))
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
    pub(super) fn divide(&mut self, whole: DoneSet) -> Result<(), Failure> {
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
        let schedule = match fit_sets(self.mount, &kept, &fit, self.asked) {
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
            for (k, set) in schedule.sets.iter().enumerate() {
                let name = match whole.name.as_str() {
                    "" => set.name.clone(),
                    epoch => format!("{epoch} {}", set.name),
                };
                let seen: Vec<Observation> = set.rows.iter().map(|&row| kept[row]).collect();
                let own = self.judged(&seen, set, whole.year_pointing_mrad.0)?;
                let of_its_own = own.is_ok();
                let (own, why) = match own {
                    Ok(own) => (own, String::new()),
                    Err(refused) => (whole.clone(), format!("the common set holds: {refused}")),
                };
                if !of_its_own {
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
        if sets.iter().any(|(of_its_own, _)| *of_its_own) {
            self.sets.extend(sets.into_iter().map(|(_, set)| set));
        } else {
            taken = 1;
            self.sets.push(whole);
        }
        self.choices
            .extend(schedule.choices.iter().map(|choice| Choice {
                sets: choice.sets,
                chosen: choice.sets == taken,
                beam_rms_mrad: Exact(choice.in_sample_beam_rms_mrad),
                unseen_rms_mrad: choice.cross_validated_beam_rms_mrad.map(Exact),
            }));
        Ok(())
    }

    /// A set over the day that has passed the gate, or why it has not; the common set's pointing over the year
    /// is uncertain by `common_mrad`.
    fn judged(
        &self,
        seen: &[Observation],
        set: &HourSet,
        common_mrad: f64,
    ) -> Result<Result<DoneSet, String>, Failure> {
        if seen.is_empty() {
            return Ok(Err("there are no records of these hours".to_owned()));
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
            (_, Some(mrad)) if mrad > limit_mrad => Ok(Err(format!(
                "its own records leave the beam uncertain by {mrad:.1} mrad over the year, at most \
                 {limit_mrad:.1} are allowed"
            ))),
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
