//! `simulate observations`: synthetic campaigns of camera observations.

use helio_calib::simulate::{Aiming, ErrorSpread, Jump, SimulateOptions};
use helio_core::angle::radians;
use helio_io::{ObservationPlan, SimulateError, SimulatedObservations, parse_time};

use crate::Outcome;
use crate::args::SimulateObservationsArgs;
use crate::failure::Failure;
use crate::plan;
use crate::printer::{Bytes, Counted, Grouped, Printer};

pub(crate) fn run(args: &SimulateObservationsArgs, printer: &Printer) -> Result<Outcome, Failure> {
    plan::threads(args.out.threads)?;
    let format = plan::format(args.out.out.as_deref(), args.out.format)?;
    let loaded = plan::field(&args.field, printer)?;
    let truth_format = match &args.truth {
        Some(path) => Some((path, plan::format(Some(path), None)?)),
        None => None,
    };
    plan::not_the_same(
        ("--out", args.out.out.as_deref()),
        ("--truth", args.truth.as_deref()),
    )?;
    let destination = plan::destination(args.out.out.as_deref(), format, &loaded.files, printer)?;
    let truth_destination = match truth_format {
        Some((path, format)) => Some((
            plan::destination(Some(path), format, &loaded.files, printer)?,
            format,
        )),
        None => None,
    };
    let plan = plan_of(args)?;
    let seen = SimulatedObservations::of(&loaded, &plan, &|_, _| true);
    let seen = seen.map_err(|error| refused(args, &error))?;
    if !seen.unseen.is_empty() {
        printer.warn(format_args!(
            "{} heliostats are faced by none of the targets and have no observations (first {})",
            Grouped(seen.unseen.len() as u64),
            seen.unseen[0]
        ));
    }
    let bytes = seen.write(destination, format)?;
    if let Some((destination, format)) = truth_destination {
        seen.write_truth(&loaded, destination, format)?;
    }
    printer.say(format_args!(
        "{} of {}; {}",
        Counted(seen.heliostat_ids.len(), "observation"),
        Counted(seen.rows.len() - seen.unseen.len(), "heliostat"),
        Bytes(bytes)
    ));
    Ok(Outcome::Good)
}

/// The failure, with the option that it is about.
fn refused(args: &SimulateObservationsArgs, error: &SimulateError) -> Failure {
    Failure::refused(match error {
        SimulateError::NoSite => format!("{}: {error}", args.field.display()),
        SimulateError::UnknownHeliostat { .. } => format!("--ids: {error}"),
        SimulateError::UnknownTarget { .. } | SimulateError::TargetWithoutPlane { .. } => {
            format!("--target: {error}")
        }
        SimulateError::NoneFaced => format!("{error} by --target"),
        SimulateError::NoSteps { .. } => format!("--steps: {error}"),
        _ => error.to_string(),
    })
}

fn plan_of(args: &SimulateObservationsArgs) -> Result<ObservationPlan, Failure> {
    let time = |option: &str, text: &str| {
        parse_time(text).map_err(|e| Failure::refused(format!("{option}: {e}")))
    };
    let mut jumps = Vec::new();
    for jump in &args.jump {
        let parts: Vec<&str> = jump.split(',').collect();
        let [at, one, two] = parts[..] else {
            return Err(Failure::refused(format!(
                "--jump {jump}: wanted TIME,AXIS1_MRAD,AXIS2_MRAD"
            )));
        };
        let mrad = |text: &str| {
            let number = text.trim().parse::<f64>().ok().filter(|v| v.is_finite());
            number.ok_or_else(|| {
                Failure::refused(format!("--jump {jump}: `{text}` is no finite number"))
            })
        };
        jumps.push(Jump {
            unix_ns: time("--jump", at)?,
            azimuth_reference_rad: 1e-3 * mrad(one)?,
            elevation_reference_rad: 1e-3 * mrad(two)?,
        });
    }
    let options = SimulateOptions {
        seed: args.seed,
        count: args.count as usize,
        from_unix_ns: time("--from", &args.from)?,
        to_unix_ns: time("--to", &args.to)?,
        days: args.days.map(|days| days as usize),
        hours: args.hours.0,
        min_sun_elevation_rad: radians(args.min_sun_elevation_deg),
        noise_mrad: args.noise_mrad,
        outlier_share: args.outliers,
        outlier_mrad: args.outlier_mrad,
        jumps,
        wrong_target_share: args.wrong_target,
        aiming: Aiming::Uncalibrated,
        ..SimulateOptions::default()
    };
    Ok(ObservationPlan {
        heliostats: args.heliostats.map(|count| count as usize),
        ids: args.ids.clone(),
        targets: args.target.clone(),
        options,
        wrong_heliostat_share: args.wrong_heliostat,
        spread: args.random_errors.then(ErrorSpread::default),
        steps: args.steps,
    })
}
