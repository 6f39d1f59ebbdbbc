//! `calibrate`: the angular errors of every heliostat from observations of its spot.

use std::borrow::Cow;
use std::collections::HashMap;
use std::io::Write;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Mutex, MutexGuard, PoisonError};

use helio_calib::aiming::hour_angle_rad;
use helio_calib::plan::year_suns;
use helio_calib::schedule::{HourSet, Sets, fit_sets};
use helio_calib::{
    CalibrateOptions, CalibrationError, Constraint, Context, Finding, Fit, FitOptions, Loss, Mount,
    Observation, Parameter, Parameters, Reason, ResidualForm, Solver, Start, Uncertainty,
    WrongCall,
};
use helio_calib::{Candidate, Duty, PlanOptions, Proposal};
use helio_core::EnuUnit;
use helio_core::angle::{degrees, radians};
use helio_io::output::{Cells, write_columns};
use helio_io::{
    AtomicFile, CalibratedSet, Finished, HeliostatObservations, IoError, LeftAsideReason,
    LoadedField, Observations, Provenance, Sha256, errors_as_written, format_time, hash_file,
    load_calibration, load_observations, write_calibration,
};
use helio_report::calibration::calibration_page;
use rayon::prelude::*;

use super::track::stop_on_signals;
use crate::Outcome;
use crate::args::{CalibrateArgs, FitArgs, ResidualWord, RobustWord, SetsWord, SolverWord, word};
use crate::calibration::{Choice, Done, DoneSet, Exact, Left};
use crate::calibration_page::Source;
use crate::comparison::Change;
use crate::failure::Failure;
use crate::plan;
use crate::printer::{Bytes, Grouped, Printer};

/// Heliostats around one whose records may have got among its own.
const NEIGHBOURS: usize = 8;
/// Lines of findings that a terminal shows.
const SAID: usize = 40;

pub(crate) fn run(args: &CalibrateArgs, printer: &Printer) -> Result<Outcome, Failure> {
    plan::threads(args.out.threads)?;
    let format = plan::format(args.out.out.as_deref(), args.out.format)?;
    let loaded = plan::field(&args.field, printer)?;
    let asked = Asked::new(&args.fit)?;
    if asked.sets != Sets::One && loaded.site.is_none() {
        return Err(Failure::refused(
            "--sets: sets over the day go by the sun's hour angle, which needs the latitude from [site]",
        ));
    }
    let mut inputs = loaded.files.clone();
    inputs.push(args.observations.clone());
    inputs.extend(args.compare.clone());
    different_outputs(args)?;
    for path in [&args.rejected, &args.report, &args.plan_out]
        .into_iter()
        .flatten()
    {
        plan::not_an_input(path, &inputs)?;
    }
    let destination = plan::destination(args.out.out.as_deref(), format, &inputs, printer)?;
    for path in [&args.rejected, &args.plan_out].into_iter().flatten() {
        plan::format(Some(path), None)?;
    }
    // What cannot be written is better known before a long run than after it.
    for path in [&args.out.out, &args.rejected, &args.plan_out]
        .into_iter()
        .flatten()
        .filter(|path| !plan::is_stdout(path))
    {
        AtomicFile::check(path)?;
    }
    let proposals = Proposals::new(args, &loaded)?;
    let old = match &args.compare {
        Some(path) => Some(earlier(path, &loaded)?),
        None => None,
    };
    let report = match &args.report {
        Some(path) => Some(report_file(path)?),
        None => None,
    };
    let resumable = args.out.out.as_deref().filter(|path| is_plain(path));
    // Each goes through a whole file.
    let ((observations, hash), build) = rayon::join(
        || {
            rayon::join(
                || load_observations(&args.observations, &loaded),
                || hash_file(&args.observations),
            )
        },
        || resumable.map(|_| build_hash(std::env::current_exe())),
    );
    let (observations, observations_hash) = (observations?, hash?);
    for warning in &observations.warnings {
        printer.warn(warning);
    }
    printer.say(format_args!(
        "{} observations of {} heliostats, of {} in the field",
        Grouped(observations.len() as u64),
        Grouped(observations.heliostats.len() as u64),
        Grouped(loaded.field.len() as u64)
    ));
    if observations.is_empty() {
        return Err(Failure::refused(format!(
            "{}: none of its {} records can be used",
            args.observations.display(),
            observations.records
        )));
    }
    let provenance = Provenance {
        version: env!("CARGO_PKG_VERSION").to_owned(),
        solver: word(args.fit.solver),
        residual: word(args.fit.residual),
        robust: word(args.fit.robust),
        field_hash: hash_files(&loaded.files)?,
        observations_hash,
        options_hash: hash_text(&format!("{:?}", args.fit)),
    };
    let part = match resumable.zip(build) {
        Some((out, build)) => Some(finished(out, args.resume, &provenance, build)?),
        None if args.resume => {
            return Err(Failure::refused("--resume needs --out FILE"));
        }
        None => None,
    };
    if !args.fit.prior.is_empty() && observations.heliostats.iter().any(without_sigmas) {
        printer.note(format_args!(
            "--prior without sigma_m: how much records count beside it is told by what a fit without it leaves"
        ));
    }
    let run = Run {
        loaded: &loaded,
        observations: &observations,
        asked: &asked,
    };
    let (done, part) = run.all(part, printer)?;

    let sets: Vec<CalibratedSet> = done.iter().flat_map(|done| run.sets(done)).collect();
    let changes = match &old {
        Some(old) => run.changes(old, &sets),
        None => Vec::new(),
    };
    if let Some(mut file) = report {
        let page = Source {
            loaded: &loaded,
            observations: &observations,
            done: &done,
            provenance: &provenance,
            findings: changes.clone(),
        };
        let path = file.path().to_owned();
        file.write_all(calibration_page(&page.page()).as_bytes())
            .map_err(|error| IoError::write(&path, error))?;
        file.finish()?;
    }
    if let Some(path) = &args.rejected {
        run.write_rejected(path, &done, printer)?;
    }
    if let Some(proposals) = &proposals {
        let bytes = run.propose(proposals, &done, args, printer)?;
        printer.say(format_args!("proposed observations: {}", Bytes(bytes)));
    }
    // Proposals take the place of the calibration where both would go to standard output.
    let bytes = if proposals.is_some() && args.plan_out.is_none() && args.out.out.is_none() {
        0
    } else {
        write_calibration(destination, format, &sets, &provenance)?
    };
    if let Some(part) = part {
        part.remove()?;
    }
    run.say(&done, &sets, bytes, printer);
    for change in &changes {
        printer.say(format_args!("{change}"));
    }
    Ok(if sets.iter().any(|set| set.status != OK) {
        Outcome::SomeRowsFailed
    } else {
        Outcome::Good
    })
}

/// An earlier calibration to compare with.
fn earlier(path: &Path, loaded: &LoadedField) -> Result<Vec<CalibratedSet>, Failure> {
    let old = load_calibration(path)?;
    let by_hour = |set: &CalibratedSet| set.hour_angle_from_rad.or(set.hour_angle_to_rad).is_some();
    if loaded.site.is_none() && old.iter().any(by_hour) {
        return Err(Failure::refused(format!(
            "--compare {}: its sets change with the hour angle of the sun, which needs the latitude from [site]",
            path.display()
        )));
    }
    Ok(old)
}

/// What of the run is finished already. Two builds of one version may differ in the last digit, so a run
/// is resumed by the program that began it.
fn finished(
    out: &Path,
    resume: bool,
    provenance: &Provenance,
    build: Result<String, String>,
) -> Result<(Finished, Vec<String>), Failure> {
    if let (Err(why), true) = (&build, resume && Finished::path_of(out).exists()) {
        return Err(Failure::refused(format!(
            "{}: not resumed: whether this program is the one that began it cannot be told ({why}); remove \
             the file to begin anew",
            Finished::path_of(out).display()
        )));
    }
    let key = hash_text(&format!(
        "{} {} {} {} {}",
        provenance.version,
        build.as_deref().unwrap_or("unknown"),
        provenance.field_hash,
        provenance.observations_hash,
        provenance.options_hash
    ));
    Ok(if resume {
        Finished::resume(out, &key)?
    } else {
        (Finished::begin(out, &key)?, Vec::new())
    })
}

/// SHA-256 of the running program, or why there is none.
fn build_hash(program: std::io::Result<PathBuf>) -> Result<String, String> {
    let path = program.map_err(|error| format!("its own path is not known: {error}"))?;
    hash_file(&path).map_err(|error| error.to_string())
}

/// True if nothing states how sure the observations of a heliostat are.
fn without_sigmas(of: &HeliostatObservations) -> bool {
    of.observations.iter().all(|seen| seen.sigma_m.is_none())
}

/// Noise of records that leave nothing to tell it by, beside priors \[mrad\].
const UNTOLD_NOISE_MRAD: f64 = 1.0;

/// The status of a set that `track` may use.
pub(crate) const OK: &str = "ok";

/// Refuses outputs that would replace each other.
fn different_outputs(args: &CalibrateArgs) -> Result<(), Failure> {
    let outputs = [
        ("--out", args.out.out.as_deref()),
        ("--report", args.report.as_deref()),
        ("--rejected", args.rejected.as_deref()),
        ("--plan-out", args.plan_out.as_deref()),
    ];
    for (k, (one, path)) in outputs.iter().enumerate() {
        for (other, again) in &outputs[..k] {
            plan::not_the_same((other, *again), (one, *path))?;
        }
    }
    Ok(())
}

/// The file of a report, begun early so that a place that cannot be written is known at once.
fn report_file(path: &Path) -> Result<AtomicFile, Failure> {
    let suffix = path.extension().map(|suffix| suffix.to_ascii_lowercase());
    if suffix.is_none_or(|suffix| suffix != "html" && suffix != "htm") {
        return Err(Failure::refused(format!(
            "{}: --report writes a page; wanted a name that ends in .html",
            path.display()
        )));
    }
    Ok(AtomicFile::create(path)?)
}

/// What is asked of the next observations.
struct Proposals {
    count: usize,
    candidates: Vec<Candidate>,
    suns: Vec<EnuUnit>,
}

/// Time between the suns that are looked at for the next observations \[s\].
const PLAN_STEP_S: f64 = 600.0;
/// Lowest sun of an observation or of a pointing that counts \[rad\].
const LOWEST_SUN_RAD: f64 = 0.1745;

impl Proposals {
    fn new(args: &CalibrateArgs, loaded: &LoadedField) -> Result<Option<Self>, Failure> {
        let (Some(count), Some(date)) = (args.plan, &args.plan_date) else {
            return Ok(None);
        };
        let Some(site) = &loaded.site else {
            return Err(Failure::refused(
                "--plan: there is no [site], which the suns of that day need",
            ));
        };
        let date: jiff::civil::Date = date.trim().parse().map_err(|_| {
            Failure::refused(format!(
                "--plan-date {date}: wanted a day, such as 2026-06-21"
            ))
        })?;
        let midnight = date
            .to_zoned(jiff::tz::TimeZone::UTC)
            .map_err(|error| Failure::refused(format!("--plan-date {date}: {error}")))?;
        // From local solar midnight to the next.
        let day_s = 86_400.0;
        let east_s = site.longitude_rad / std::f64::consts::TAU * day_s;
        let from_s = midnight.timestamp().as_second() - east_s.round() as i64;
        let planes: Vec<_> = loaded
            .targets
            .values()
            .filter_map(|target| target.area.map(|area| area.plane))
            .collect();
        let from_ns = from_s.saturating_mul(1_000_000_000);
        let candidates = helio_calib::plan::candidates(
            &site.sun_site()?,
            from_ns,
            from_ns.saturating_add(day_s as i64 * 1_000_000_000),
            PLAN_STEP_S,
            LOWEST_SUN_RAD,
            &planes,
        )?;
        if candidates.is_empty() {
            return Err(Failure::refused(format!(
                "--plan-date {date}: the sun never stands 10 degrees high on that day"
            )));
        }
        Ok(Some(Self {
            count: usize::from(count),
            candidates,
            suns: year_suns(site.latitude_rad, LOWEST_SUN_RAD),
        }))
    }
}

/// True for a path that is or will be a regular file.
fn is_plain(path: &Path) -> bool {
    !plan::is_stdout(path) && std::fs::metadata(path).map_or(true, |found| found.is_file())
}

fn hash_text(text: &str) -> String {
    let mut hash = Sha256::default();
    hash.update(text.as_bytes());
    hash.finish()
}

fn hash_files(files: &[PathBuf]) -> Result<String, IoError> {
    let hashes: Result<Vec<String>, IoError> = files.iter().map(|path| hash_file(path)).collect();
    Ok(hash_text(&hashes?.join(" ")))
}

/// What the options mean.
#[derive(Debug)]
struct Asked {
    options: CalibrateOptions,
    sets: Sets,
    hold: [bool; 7],
}

/// Most sets over the day that are tried.
const MOST_SETS: usize = 4;

/// The names of parameters on the command line.
const NAMES: [(&str, &[Parameter]); 6] = [
    ("pedestal_tilt", &[Parameter::Tilt1, Parameter::Tilt2]),
    ("axis_nonorthogonality", &[Parameter::AxisNonorthogonality]),
    ("mirror_tilt", &[Parameter::MirrorTilt]),
    ("azimuth_reference", &[Parameter::AzimuthReference]),
    ("elevation_reference", &[Parameter::ElevationReference]),
    ("mirror_offset", &[Parameter::MirrorOffset]),
];

fn named(option: &str, name: &str) -> Result<&'static [Parameter], Failure> {
    let bare = name.trim();
    let bare = bare.strip_suffix("_deg").unwrap_or(bare);
    let bare = bare.strip_suffix("_m").unwrap_or(bare);
    let found = NAMES.iter().find(|(known, _)| *known == bare);
    found.map(|(_, parameters)| *parameters).ok_or_else(|| {
        let known: Vec<&str> = NAMES.iter().map(|(known, _)| *known).collect();
        Failure::refused(format!(
            "{option}: unknown parameter `{name}`; known are {}",
            known.join(", ")
        ))
    })
}

impl Asked {
    fn new(args: &FitArgs) -> Result<Self, Failure> {
        let mut fit = FitOptions {
            solver: match args.solver {
                SolverWord::HartleyMeyer => Solver::HartleyMeyer,
                SolverWord::GaussNewton => Solver::GaussNewton,
            },
            residual: match args.residual {
                ResidualWord::Components => ResidualForm::Components,
                ResidualWord::Distance => ResidualForm::Distance,
                ResidualWord::Beam => ResidualForm::Beam,
            },
            loss: match args.robust {
                RobustWord::None => Loss::Squares,
                RobustWord::Huber => Loss::Huber,
                RobustWord::StudentT => Loss::StudentT { degrees: 4.0 },
                RobustWord::Cauchy => Loss::Cauchy,
            },
            // The distance of eq. (38) may need many, theory §6.
            max_iterations: match args.residual {
                ResidualWord::Components | ResidualWord::Beam => 100,
                ResidualWord::Distance => 300,
            },
            ..FitOptions::default()
        };
        let mut hold = [false; 7];
        if args.fit_mirror_offset {
            fit.constraints[Parameter::MirrorOffset as usize] = Constraint::Free;
        }
        for name in &args.hold {
            for &parameter in named("--hold", name)? {
                if parameter == Parameter::MirrorOffset && args.fit_mirror_offset {
                    return Err(Failure::refused(
                        "--hold mirror_offset and --fit-mirror-offset contradict each other",
                    ));
                }
                fit.constraints[parameter as usize] = Constraint::Held;
                hold[parameter as usize] = true;
            }
        }
        for prior in &args.prior {
            let (parameters, mean, sigma) = prior_of(prior)?;
            for &parameter in parameters {
                if hold[parameter as usize] {
                    return Err(Failure::refused(format!(
                        "--prior {prior}: the parameter is held by --hold"
                    )));
                }
                fit.constraints[parameter as usize] = Constraint::Prior { mean, sigma };
            }
        }
        if fit.free().next().is_none() {
            return Err(Failure::refused("--hold: every parameter is held"));
        }
        Ok(Self {
            options: CalibrateOptions {
                fit,
                reject: !args.keep_all,
                jumps: !args.no_jumps,
                max_year_pointing_mrad: args.max_year_pointing_mrad,
                ..CalibrateOptions::default()
            },
            sets: match args.sets {
                SetsWord::One => Sets::One,
                SetsWord::Two => Sets::Two,
                SetsWord::Auto => Sets::Auto { max: MOST_SETS },
            },
            hold,
        })
    }

    /// The options for a heliostat with these parameters in the field.
    fn of(&self, field: &Parameters) -> CalibrateOptions {
        let mut options = self.options;
        if self.hold.contains(&true) {
            let mut start = Parameters::default();
            for parameter in Parameter::ALL {
                let k = parameter as usize;
                start.values[k] = match options.fit.constraints[k] {
                    Constraint::Prior { mean, .. } => mean,
                    _ if self.hold[k] || parameter == Parameter::MirrorOffset => field.values[k],
                    _ => 0.0,
                };
            }
            options.fit.start = Start::At(start);
        }
        options
    }
}

/// NAME=MEAN:SD
fn prior_of(text: &str) -> Result<(&'static [Parameter], f64, f64), Failure> {
    let refuse = |why: String| Failure::refused(format!("--prior {text}: {why}"));
    let parts = text
        .split_once('=')
        .and_then(|(name, rest)| Some((name, rest.split_once(':')?)));
    let Some((name, (mean, sigma))) = parts else {
        return Err(refuse(
            "wanted NAME=MEAN:SD, such as mirror_tilt=0:0.1".into(),
        ));
    };
    let parameters = named("--prior", name)?;
    let number = |text: &str, what: &str| match text.trim().parse::<f64>() {
        Ok(number) if number.is_finite() => Ok(number),
        _ => Err(refuse(format!("{what} `{text}` is no finite number"))),
    };
    let (mean, sigma) = (
        number(mean, "the mean")?,
        number(sigma, "the standard deviation")?,
    );
    if sigma <= 0.0 {
        return Err(refuse("the standard deviation must be above zero".into()));
    }
    if parameters == [Parameter::MirrorOffset] {
        return Ok((parameters, mean, sigma));
    }
    if parameters.len() > 1 && mean != 0.0 {
        return Err(refuse(
            "the tilt's direction is not known, so its mean must be 0".into(),
        ));
    }
    Ok((parameters, radians(mean), radians(sigma)))
}

/// The numbers of a fit.
fn fitted(fit: &Fit, uncertainty: &Uncertainty) -> DoneSet {
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
fn weighed<'a>(
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
struct Day<'a> {
    mount: &'a Mount,
    of: &'a HeliostatObservations,
    context: Context<'a>,
    options: &'a CalibrateOptions,
    asked: Sets,
    sets: Vec<DoneSet>,
    choices: Vec<Choice>,
    /// In words.
    said: Vec<String>,
}

impl Day<'_> {
    /// Divides an epoch where more sets do better than the one that it has. Each set passes the gate that the
    /// common one has passed; in the hours of one that does not, the common set holds.
    fn divide(&mut self, whole: DoneSet) -> Result<(), Failure> {
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

/// Everything that calibrating one heliostat after another needs.
pub(crate) struct Run<'a> {
    loaded: &'a LoadedField,
    observations: &'a Observations,
    asked: &'a Asked,
}

/// What threads share.
struct Shared {
    part: Option<Finished>,
    done: Vec<Done>,
    progress: crate::printer::Progress,
    failed: Option<Failure>,
}

fn held(shared: &Mutex<Shared>) -> MutexGuard<'_, Shared> {
    shared.lock().unwrap_or_else(PoisonError::into_inner)
}

impl Run<'_> {
    /// Calibrates every heliostat that is not finished, in parallel.
    fn all(
        &self,
        part: Option<(Finished, Vec<String>)>,
        printer: &Printer,
    ) -> Result<(Vec<Done>, Option<Finished>), Failure> {
        let all = &self.observations.heliostats;
        let (part, lines) = part.map_or((None, Vec::new()), |(part, lines)| (Some(part), lines));
        let mut done: Vec<Done> = Vec::with_capacity(all.len());
        let mut is_done = vec![false; all.len()];
        for line in &lines {
            // The key is right and the checksum too: the line is one of ours.
            if let Some(one) = Done::from_line(line)
                && one.index < all.len()
                && !std::mem::replace(&mut is_done[one.index], true)
            {
                done.push(one);
            }
        }
        if !done.is_empty() {
            printer.say(format_args!(
                "resumed: {} of {} heliostats are finished",
                Grouped(done.len() as u64),
                Grouped(all.len() as u64)
            ));
        }
        let todo: Vec<usize> = (0..all.len()).filter(|&index| !is_done[index]).collect();
        let stop = stop_on_signals();
        let give_up = AtomicBool::new(false);
        let shared = Mutex::new(Shared {
            part,
            done,
            progress: printer.progress_of(todo.len() as u64, "heliostats"),
            failed: None,
        });
        todo.par_iter().with_max_len(1).for_each(|&index| {
            if stop.load(Ordering::Relaxed) || give_up.load(Ordering::Relaxed) {
                return;
            }
            let one = self.one(index);
            let mut shared = held(&shared);
            let kept = one.and_then(|one| {
                if let Some(part) = &mut shared.part {
                    part.add(&one.to_line())?;
                }
                shared.done.push(one);
                Ok(())
            });
            if let Err(failure) = kept {
                give_up.store(true, Ordering::Relaxed);
                shared.failed.get_or_insert(failure);
            }
            shared.progress.advance(1);
        });
        let Shared {
            part,
            mut done,
            progress,
            failed,
        } = shared.into_inner().unwrap_or_else(PoisonError::into_inner);
        progress.finish();
        if let Some(failure) = failed {
            return Err(failure);
        }
        if done.len() < all.len() {
            return Err(match part {
                Some(part) => Failure::Paused {
                    done: done.len(),
                    of: all.len(),
                    path: part.path().to_owned(),
                },
                None => Failure::Interrupted { streamed: false },
            });
        }
        // In the order of the field, whoever was first.
        done.sort_by_key(|one| one.index);
        Ok((done, part))
    }

    fn mount(&self, row: usize) -> Mount {
        let field = &self.loaded.field;
        Mount::of(field.mode(), &field.heliostats()[row])
    }

    /// Calibrates one heliostat.
    fn one(&self, index: usize) -> Result<Done, Failure> {
        let of = &self.observations.heliostats[index];
        let heliostat = &self.loaded.field.heliostats()[of.row];
        let mount = self.mount(of.row);
        let neighbours = plan::neighbours(&self.loaded.field, of.row, NEIGHBOURS);
        let mounts: Vec<Mount> = neighbours.iter().map(|&row| self.mount(row)).collect();
        let planes: Vec<_> = self.observations.targets.iter().map(|(_, p)| *p).collect();
        let context = Context {
            site_latitude_rad: self.loaded.site.as_ref().map(|site| site.latitude_rad),
            aim: Some(heliostat.aim),
            neighbours: &mounts,
            targets: &planes,
        };
        let field = Parameters::new(&heliostat.errors, heliostat.mirror_offset_m);
        let options = self.asked.of(&field);
        let (of, said) = weighed(of, &mount, &context, &options)?;
        let of = of.as_ref();
        let found = helio_calib::calibrate(&mount, &of.observations, &context, &options)?;

        let words = Words {
            run: self,
            index,
            neighbours: &neighbours,
        };
        let refusing = found.findings.iter().find(|finding| {
            matches!(
                finding,
                Finding::TooFew { .. }
                    | Finding::AllAtOneTime { .. }
                    | Finding::WrongCall { .. }
                    | Finding::Unexplained { .. }
            )
        });
        let several = found.epochs.len() > 1;
        let starts: Vec<Option<i64>> = found.epochs.iter().map(|e| e.from_unix_ns).collect();
        let dated = starts.iter().all(Option::is_some);
        let mut day = Day {
            mount: &mount,
            of,
            context: Context {
                neighbours: &[],
                targets: &[],
                ..context
            },
            options: &options,
            asked: self.asked.sets,
            sets: Vec::with_capacity(found.epochs.len().max(1)),
            choices: Vec::new(),
            said: Vec::from_iter(said),
        };
        for (k, epoch) in found.epochs.iter().enumerate() {
            let last = k + 1 == found.epochs.len();
            let (status, why) = match &epoch.verdict {
                _ if several && !dated && !last => (
                    "superseded",
                    "a later epoch follows, and without times nothing tells when".to_owned(),
                ),
                helio_calib::Verdict::Undetermined { why } => match refusing {
                    Some(finding) => (finding.as_str(), words.finding(finding)),
                    None => ("undetermined", why.clone()),
                },
                helio_calib::Verdict::Determined if !epoch.fit.stop.converged() => (
                    "not_converged",
                    format!("the fit ended with {}", epoch.fit.stop.as_str()),
                ),
                helio_calib::Verdict::Determined => (OK, String::new()),
            };
            let name = if several {
                (k + 1).to_string()
            } else {
                String::new()
            };
            let whole = DoneSet {
                name,
                status: status.to_owned(),
                why,
                valid_from_ns: if k == 0 { None } else { starts[k] },
                valid_to_ns: if last { None } else { starts[k + 1] },
                year_pointing_mrad: Exact(epoch.year_pointing_mrad.unwrap_or(f64::NAN)),
                weakness: epoch.weakness.to_string(),
                rows: epoch.rows.clone(),
                ..fitted(&epoch.fit, &epoch.uncertainty)
            };
            // An epoch that borrows its tilts has too few records to be divided.
            if status == OK && self.asked.sets != Sets::One && !epoch.borrowed {
                day.divide(whole)?;
            } else {
                day.sets.push(whole);
            }
        }
        let Day {
            mut sets,
            choices,
            said,
            ..
        } = day;
        if sets.is_empty() {
            let (status, why) = match refusing.or(found.findings.first()) {
                Some(finding) => (finding.as_str(), words.finding(finding)),
                None => ("undetermined", String::new()),
            };
            sets.push(DoneSet::without_result(status, &why));
        }
        Ok(Done {
            index,
            sets,
            rejected: found
                .rejected
                .iter()
                .map(|rejected| Left {
                    row: rejected.row,
                    beam_mrad: Exact(rejected.beam_mrad),
                    reason: rejected.reason.as_str().to_owned(),
                    words: words.reason(&rejected.reason),
                })
                .collect(),
            findings: found
                .findings
                .iter()
                .map(|finding| words.finding(finding))
                .chain(said)
                .collect(),
            choices,
        })
    }

    fn id(&self, index: usize) -> &str {
        &self.loaded.field.ids()[self.observations.heliostats[index].row]
    }

    /// The rows of the table for a heliostat.
    fn sets(&self, done: &Done) -> Vec<CalibratedSet> {
        let of = &self.observations.heliostats[done.index];
        let id = self.id(done.index);
        let used: usize = done.sets.iter().map(|set| set.rows.len()).sum();
        // Sets over the day share the records of the hours in which they blend.
        let rejected = of.observations.len().saturating_sub(used);
        let one = done.sets.len() == 1;
        done.sets
            .iter()
            .map(|set| {
                let times = || {
                    set.rows
                        .iter()
                        .filter_map(|&row| of.observations[row].unix_ns)
                };
                // A rejected record belongs to the stretch of time in which it was made.
                let inside = |row: usize| match of.observations[row].unix_ns {
                    Some(ns) => {
                        set.valid_from_ns.is_none_or(|from| from <= ns)
                            && set.valid_to_ns.is_none_or(|to| ns < to)
                    }
                    None => false,
                } && match (set.hours_rad, of.observations[row].hour_angle_rad) {
                    (Some([from, to]), Some(hour)) => {
                        from.is_none_or(|from| from.0 <= hour) && to.is_none_or(|to| hour < to.0)
                    }
                    _ => true,
                };
                CalibratedSet {
                    rejected: if one {
                        rejected
                    } else {
                        done.rejected.iter().filter(|left| inside(left.row)).count()
                    },
                    observed_ns: times().min().zip(times().max()),
                    ..set.to_table(id)
                }
            })
            .collect()
    }

    fn write_rejected(&self, path: &Path, done: &[Done], printer: &Printer) -> Result<(), Failure> {
        let format = plan::format(Some(path), None)?;
        let destination = plan::destination(Some(path), format, &[], printer)?;
        let mut rows: Vec<(usize, usize, f64, String, String)> = Vec::new();
        for one in done {
            let of = &self.observations.heliostats[one.index];
            for left in &one.rejected {
                let record = of.records[left.row];
                rows.push((
                    record,
                    of.row,
                    left.beam_mrad.0,
                    left.reason.clone(),
                    left.words.clone(),
                ));
            }
        }
        for aside in &self.observations.left_aside {
            let why = match aside.reason {
                LeftAsideReason::Duplicate { of } => {
                    format!("it is {} again", self.observations.position(of))
                }
                LeftAsideReason::SunBelowHorizon => "at its time the sun was down".to_owned(),
                _ => "it has no spot".to_owned(),
            };
            let reason = aside.reason.as_str().to_owned();
            rows.push((aside.record, aside.heliostat, f64::NAN, reason, why));
        }
        rows.sort_by_key(|row| row.0);
        let ids: Vec<String> = rows
            .iter()
            .map(|row| self.loaded.field.ids()[row.1].clone())
            .collect();
        let records: Vec<String> = rows
            .iter()
            .map(|row| self.observations.record_id(row.0).unwrap_or("").to_owned())
            .collect();
        let lines: Vec<Option<i64>> = rows
            .iter()
            .map(|row| i64::try_from(self.observations.line(row.0)).ok())
            .collect();
        let beams: Vec<f64> = rows.iter().map(|row| row.2).collect();
        let reasons: Vec<String> = rows.iter().map(|row| row.3.clone()).collect();
        let whys: Vec<String> = rows.iter().map(|row| row.4.clone()).collect();
        let mut columns = vec![("id", Cells::Text(&ids)), ("line", Cells::Whole(&lines))];
        if records.iter().any(|record| !record.is_empty()) {
            columns.push(("record_id", Cells::Text(&records)));
        }
        columns.extend([
            ("beam_mrad", Cells::Numbers(&beams)),
            ("reason", Cells::Text(&reasons)),
            ("why", Cells::Text(&whys)),
        ]);
        write_columns(destination, format, &columns)?;
        Ok(())
    }

    /// What changed against an earlier calibration, in sentences.
    fn changes(&self, old: &[CalibratedSet], sets: &[CalibratedSet]) -> Vec<String> {
        let suns: Vec<(EnuUnit, f64)> = match &self.loaded.site {
            Some(site) => year_suns(site.latitude_rad, LOWEST_SUN_RAD)
                .into_iter()
                .map(|sun| (sun, hour_angle_rad(sun, site.latitude_rad)))
                .collect(),
            // No set goes by the hour then.
            None => self
                .observations
                .heliostats
                .iter()
                .flat_map(|of| of.observations.iter().map(|o| (o.sun, 0.0)))
                .take(1000)
                .collect(),
        };
        let (before, after) = (by_heliostat(old), by_heliostat(sets));
        let field = &self.loaded.field;
        let mut found: Vec<(&str, Change)> = (0..field.len())
            .into_par_iter()
            .filter_map(|row| {
                let id = field.ids()[row].as_str();
                let change = Change::between(
                    before.get(id)?,
                    after.get(id)?,
                    &field.heliostats()[row],
                    &self.mount(row),
                    &suns,
                    self.loaded.blend_rad,
                )?;
                Some((id, change))
            })
            .collect();
        let beams: Vec<f64> = found.iter().map(|(_, change)| change.beam_mrad).collect();
        let significant = |c: &Change| c.is_significant() == Some(true);
        let count = found
            .iter()
            .filter(|(_, change)| significant(change))
            .count();
        let mut said = Vec::new();
        match median(beams) {
            Some(mrad) => said.push(format!(
                "compared: {} heliostats have an earlier calibration, {count} of them changed significantly; \
                 in the middle the beams move by {mrad:.3} mrad over the year",
                found.len()
            )),
            None => said.push("compared: no heliostat has an earlier calibration".to_owned()),
        }
        let fresh = after.keys().filter(|id| !before.contains_key(*id)).count();
        if fresh > 0 && !found.is_empty() {
            said.push(format!(
                "compared: {fresh} heliostats have no earlier calibration"
            ));
        }
        let gone = before.keys().filter(|id| !after.contains_key(*id)).count();
        if gone > 0 {
            said.push(format!(
                "compared: {gone} heliostats have an earlier calibration and no new one"
            ));
        }
        found.sort_by(|a, b| b.1.beam_mrad.total_cmp(&a.1.beam_mrad));
        let shown = found.len().min(SAID);
        for (name, change) in &found[..shown] {
            let of = match change.pairs {
                0 | 1 => String::new(),
                pairs => format!(", the greatest of {pairs} pairs of sets"),
            };
            let test = match (change.chi_square, change.is_significant()) {
                (Some((chi, freedom)), Some(true)) => {
                    format!("significantly (chi-square {chi:.1} on {freedom}{of})")
                }
                (Some((chi, freedom)), Some(false)) => {
                    format!("not significantly (chi-square {chi:.1} on {freedom}{of})")
                }
                _ => "whether significantly is not known: there is no covariance".to_owned(),
            };
            said.push(format!(
                "{name}: changed by {:.3} mrad over the year, {test}",
                change.beam_mrad
            ));
        }
        if found.len() > shown {
            said.push(format!(
                "... and {} heliostats that changed less",
                found.len() - shown
            ));
        }
        said
    }

    /// Writes the proposed observations of every heliostat.
    fn propose(
        &self,
        asked: &Proposals,
        done: &[Done],
        args: &CalibrateArgs,
        printer: &Printer,
    ) -> Result<u64, Failure> {
        let format = plan::format(args.plan_out.as_deref(), None)?;
        let destination = plan::destination(args.plan_out.as_deref(), format, &[], printer)?;
        let all: Result<Vec<Vec<Proposal>>, Failure> = done
            .par_iter()
            .map(|one| {
                let of = &self.observations.heliostats[one.index];
                let heliostat = &self.loaded.field.heliostats()[of.row];
                let mount = self.mount(of.row);
                let latest = one.sets.iter().rev().find(|set| set.is_fitted());
                let (parameters, so_far) = match latest {
                    Some(set) => (
                        Parameters::new(&set.mount_errors(), set.mirror_offset_m.0),
                        set.rows.iter().map(|&row| of.observations[row]).collect(),
                    ),
                    None => (
                        Parameters::new(&heliostat.errors, heliostat.mirror_offset_m),
                        Vec::new(),
                    ),
                };
                // Boards that face away are no use.
                let facing: Vec<Candidate> = asked
                    .candidates
                    .iter()
                    .filter(|candidate| {
                        let toward = mount.pivot - candidate.plane.centre;
                        candidate.plane.normal.as_enu().dot(toward) > 0.0
                    })
                    .copied()
                    .collect();
                let duty = Duty {
                    suns: &asked.suns,
                    aim: heliostat.aim,
                };
                let options = PlanOptions::default();
                let proposals = helio_calib::plan(
                    &mount,
                    &parameters,
                    &so_far,
                    &facing,
                    &duty,
                    asked.count,
                    &options,
                );
                Ok(proposals?)
            })
            .collect();
        let rows: Vec<(usize, Proposal)> = done
            .iter()
            .zip(all?)
            .flat_map(|(one, proposals)| proposals.into_iter().map(|p| (one.index, p)))
            .collect();
        let ids: Vec<String> = rows
            .iter()
            .map(|(index, _)| self.id(*index).to_owned())
            .collect();
        let times: Vec<Option<i64>> = rows.iter().map(|(_, p)| Some(p.unix_ns)).collect();
        let numbers =
            |of: fn(&Proposal) -> f64| -> Vec<f64> { rows.iter().map(|(_, p)| of(p)).collect() };
        let azimuths = numbers(|p| degrees(p.sun.azimuth_rad()));
        let elevations = numbers(|p| degrees(p.sun.elevation_rad()));
        let before = numbers(|p| p.expected_year_pointing_mrad_before);
        let after = numbers(|p| p.expected_year_pointing_mrad_after);
        let targets: Vec<String> = rows
            .iter()
            .map(|(_, p)| self.observations.targets[p.target].0.clone())
            .collect();
        let columns = [
            ("id", Cells::Text(&ids)),
            ("time", Cells::Times(&times)),
            ("sun_azimuth_deg", Cells::Numbers(&azimuths)),
            ("sun_elevation_deg", Cells::Numbers(&elevations)),
            ("target", Cells::Text(&targets)),
            ("year_pointing_before_mrad", Cells::Numbers(&before)),
            ("year_pointing_after_mrad", Cells::Numbers(&after)),
        ];
        Ok(write_columns(destination, format, &columns)?)
    }

    /// What was found, in words.
    fn say(&self, done: &[Done], sets: &[CalibratedSet], bytes: u64, printer: &Printer) {
        let mut said = 0;
        let mut left_out = 0;
        let mut line = |text: std::fmt::Arguments<'_>| {
            if said < SAID {
                printer.say(text);
                said += 1;
            } else {
                left_out += 1;
            }
        };
        for one in done {
            let id = self.id(one.index);
            for finding in &one.findings {
                line(format_args!("{id}: {finding}"));
            }
            for set in one.sets.iter().filter(|set| set.status != OK) {
                if !one.findings.contains(&set.why) {
                    line(format_args!(
                        "{id}{}: {}: {}",
                        set.of(),
                        set.status,
                        set.why
                    ));
                }
            }
            if !one.choices.is_empty() {
                let words: Vec<String> = one.choices.iter().map(choice_words).collect();
                line(format_args!(
                    "{id}: sets over the day: {}",
                    words.join("; ")
                ));
            }
            if !one.rejected.is_empty() {
                let count = one.rejected.len();
                let all = self.observations.heliostats[one.index].observations.len();
                line(format_args!(
                    "{id}: {count} of {all} records rejected ({})",
                    reasons(&one.rejected)
                ));
            }
        }
        if left_out > 0 {
            printer.say(format_args!(
                "... and {} lines more; --report and --rejected show all",
                Grouped(left_out)
            ));
        }
        let good: Vec<f64> = sets
            .iter()
            .filter(|set| set.status == OK)
            .map(|set| set.beam_rms_mrad)
            .collect();
        let mut words = Vec::new();
        let mut statuses: Vec<(&str, u64)> = Vec::new();
        for set in sets {
            match statuses.iter_mut().find(|(word, _)| *word == set.status) {
                Some((_, count)) => *count += 1,
                None => statuses.push((&set.status, 1)),
            }
        }
        statuses.sort_by_key(|(word, _)| (*word != OK, *word));
        for (word, count) in &statuses {
            words.push(format!("{} {word}", Grouped(*count)));
        }
        let typical = match median(good) {
            Some(mrad) => format!("; beam RMS {mrad:.2} mrad in the middle"),
            None => String::new(),
        };
        printer.say(format_args!(
            "{} rows: {}{typical}; {}",
            Grouped(sets.len() as u64),
            words.join(", "),
            Bytes(bytes)
        ));
        let unseen = self.loaded.field.len() - done.len();
        if unseen > 0 {
            printer.note(format_args!(
                "{} heliostats of the field have no observations and no row",
                Grouped(unseen as u64)
            ));
        }
    }
}

/// The sets with errors of each heliostat.
fn by_heliostat(sets: &[CalibratedSet]) -> HashMap<&str, Vec<&CalibratedSet>> {
    let mut of: HashMap<&str, Vec<&CalibratedSet>> = HashMap::new();
    for set in sets.iter().filter(|set| set.errors.is_some()) {
        of.entry(&set.id).or_default().push(set);
    }
    of
}

fn median(mut values: Vec<f64>) -> Option<f64> {
    values.retain(|value| value.is_finite());
    values.sort_by(f64::total_cmp);
    values.get(values.len() / 2).copied()
}

/// A number of sets and how well it does.
fn choice_words(choice: &Choice) -> String {
    let unseen = choice.unseen_rms_mrad.map_or(String::new(), |unseen| {
        format!(" ({:.2} on days left out)", unseen.0)
    });
    let chosen = if choice.chosen { ", taken" } else { "" };
    format!(
        "{} {:.2} mrad{unseen}{chosen}",
        choice.sets, choice.beam_rms_mrad.0
    )
}

/// Each reason with its number, the commonest first.
fn reasons(rejected: &[Left]) -> String {
    let mut counts: Vec<(&str, usize)> = Vec::new();
    for left in rejected {
        match counts.iter_mut().find(|(word, _)| *word == left.reason) {
            Some((_, count)) => *count += 1,
            None => counts.push((&left.reason, 1)),
        }
    }
    counts.sort_by(|a, b| b.1.cmp(&a.1).then(a.0.cmp(b.0)));
    let words: Vec<String> = counts
        .iter()
        .map(|(word, n)| format!("{n} {word}"))
        .collect();
    words.join(", ")
}

/// Findings with the names and places that only this program knows.
struct Words<'a> {
    run: &'a Run<'a>,
    index: usize,
    neighbours: &'a [usize],
}

impl Words<'_> {
    fn heliostat(&self, neighbour: usize) -> String {
        let row = self.neighbours.get(neighbour);
        row.map_or(String::new(), |&row| {
            self.run.loaded.field.ids()[row].clone()
        })
    }

    fn target(&self, target: usize) -> &str {
        let targets = &self.run.observations.targets;
        targets.get(target).map_or("", |(name, _)| name)
    }

    fn position(&self, row: usize) -> String {
        let of = &self.run.observations.heliostats[self.index];
        self.run.observations.position(of.records[row])
    }

    fn reason(&self, reason: &Reason) -> String {
        match reason {
            Reason::WrongHeliostat { neighbour } => {
                format!(
                    "it fits the mount of heliostat {}",
                    self.heliostat(*neighbour)
                )
            }
            Reason::WrongTarget { target } => {
                format!("its spot fits target {}", self.target(*target))
            }
            Reason::Duplicate { of } => format!("it is {} again", self.position(*of)),
            other => other.to_string(),
        }
    }

    fn finding(&self, finding: &Finding) -> String {
        match finding {
            Finding::Jump {
                last_before,
                first_after,
                after_unix_ns,
                before_unix_ns,
                axis1_mrad,
                axis2_mrad,
            } => {
                let at = match (after_unix_ns, before_unix_ns) {
                    (Some(after), Some(before)) => {
                        format!("{} and {}", format_time(*after), format_time(*before))
                    }
                    _ => format!(
                        "{} and {}",
                        self.position(*last_before),
                        self.position(*first_after)
                    ),
                };
                format!(
                    "the encoder references jumped between {at}, by {axis1_mrad:+.1} mrad on the first \
                     axis and {axis2_mrad:+.1} mrad on the second"
                )
            }
            Finding::WrongCall { call, .. } => {
                let text = finding.to_string();
                match call {
                    WrongCall::OtherHeliostat { neighbour } => text.replace(
                        &format!("neighbour {neighbour}"),
                        &format!("heliostat {}", self.heliostat(*neighbour)),
                    ),
                    WrongCall::OtherTarget { target } => text.replace(
                        &format!("target {target}"),
                        &format!("target {}", self.target(*target)),
                    ),
                    _ => text,
                }
            }
            other => other.to_string(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_program_that_cannot_be_read_is_not_the_one_that_began() {
        let unknown = build_hash(Err(std::io::ErrorKind::NotFound.into()));
        assert!(unknown.unwrap_err().contains("its own path is not known"));
        let folder = tempfile::tempdir().unwrap();
        let gone = build_hash(Ok(folder.path().join("helio-rs (deleted)")));
        assert!(gone.unwrap_err().contains("cannot be read"));
        let own = build_hash(std::env::current_exe()).unwrap();
        assert_eq!(own.len(), 64);

        let out = folder.path().join("c.csv");
        let (provenance, lost) = (Provenance::default(), || Err("gone".to_owned()));
        // Without parts there is nothing to mix, with parts they stay as they are.
        drop(finished(&out, true, &provenance, lost()).unwrap());
        let part = std::fs::read(Finished::path_of(&out)).unwrap();
        for (resume, said) in [
            (true, "(gone); remove the file"),
            (false, "--resume goes on"),
        ] {
            let refused = finished(&out, resume, &provenance, lost()).unwrap_err();
            assert!(refused.to_string().contains(said), "{refused}");
        }
        let refused = finished(&out, true, &provenance, Ok(own)).unwrap_err();
        assert!(refused.to_string().contains("another build"), "{refused}");
        assert_eq!(std::fs::read(Finished::path_of(&out)).unwrap(), part);
    }
}
