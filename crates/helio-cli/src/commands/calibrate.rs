//! `calibrate`: the angular errors of every heliostat from observations of its spot.

use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Mutex, MutexGuard, PoisonError};

use helio_calib::{
    CalibrateOptions, Constraint, Context, Finding, FitOptions, Loss, Mount, Parameter, Parameters,
    Reason, ResidualForm, Solver, Start, WrongCall,
};
use helio_core::angle::radians;
use helio_io::output::{Cells, write_columns};
use helio_io::{
    CalibratedSet, Finished, IoError, LeftAsideReason, LoadedField, Observations, Provenance,
    Sha256, errors_as_written, format_time, hash_file, load_observations, write_calibration,
};
use rayon::prelude::*;

use super::track::stop_on_signals;
use crate::Outcome;
use crate::args::{CalibrateArgs, FitArgs, ResidualWord, RobustWord, SolverWord, word};
use crate::calibration::{Done, DoneSet, Exact, Left};
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
    let mut inputs = loaded.files.clone();
    inputs.push(args.observations.clone());
    inputs.extend(args.compare.clone());
    different_outputs(args)?;
    for path in [&args.rejected, &args.report].into_iter().flatten() {
        plan::not_an_input(path, &inputs)?;
    }
    let destination = plan::destination(args.out.out.as_deref(), format, &inputs, printer)?;
    // Both go through the whole file.
    let (observations, hash) = rayon::join(
        || load_observations(&args.observations, &loaded),
        || hash_file(&args.observations),
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
    let key = hash_text(&format!(
        "{} {} {} {}",
        provenance.version,
        provenance.field_hash,
        provenance.observations_hash,
        provenance.options_hash
    ));

    let part = match args.out.out.as_deref().filter(|path| is_plain(path)) {
        Some(out) if args.resume => Some(Finished::resume(out, &key)?),
        Some(out) => Some((Finished::begin(out, &key)?, Vec::new())),
        None if args.resume => {
            return Err(Failure::refused("--resume needs --out FILE"));
        }
        None => None,
    };
    let run = Run {
        loaded: &loaded,
        observations: &observations,
        asked: &asked,
    };
    let (done, part) = run.all(part, printer)?;

    let sets: Vec<CalibratedSet> = done.iter().flat_map(|done| run.sets(done)).collect();
    if let Some(path) = &args.rejected {
        run.write_rejected(path, &done, printer)?;
    }
    let bytes = write_calibration(destination, format, &sets, &provenance)?;
    if let Some(part) = part {
        part.remove()?;
    }
    run.say(&done, &sets, bytes, printer);
    Ok(if sets.iter().any(|set| set.status != OK) {
        Outcome::SomeRowsFailed
    } else {
        Outcome::Good
    })
}

/// The status of a set that `track` may use.
pub(crate) const OK: &str = "ok";

/// Refuses outputs that would replace each other.
fn different_outputs(args: &CalibrateArgs) -> Result<(), Failure> {
    let outputs = [
        ("--out", args.out.out.as_deref()),
        ("--report", args.report.as_deref()),
        ("--rejected", args.rejected.as_deref()),
    ];
    for (k, (one, path)) in outputs.iter().enumerate() {
        for (other, again) in &outputs[..k] {
            plan::not_the_same((other, *again), (one, *path))?;
        }
    }
    Ok(())
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
    hold: [bool; 7],
}

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
            },
            loss: match args.robust {
                RobustWord::None => Loss::Squares,
                RobustWord::Huber => Loss::Huber,
                RobustWord::StudentT => Loss::StudentT { degrees: 4.0 },
                RobustWord::Cauchy => Loss::Cauchy,
            },
            // The distance of eq. (38) may need many, theory §6.
            max_iterations: match args.residual {
                ResidualWord::Components => 100,
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
        let mut sets = Vec::with_capacity(found.epochs.len().max(1));
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
            // From here on the parameters are what reading the table gives.
            let written = errors_as_written(&epoch.fit.parameters.errors());
            let parameters = Parameters::new(&written, epoch.fit.parameters.mirror_offset_m());
            let uncertainty = &epoch.uncertainty;
            let (tilt, lean) = uncertainty.tilt_standard_error(&epoch.fit);
            let error = |parameter: Parameter| {
                if uncertainty.free.contains(&parameter) {
                    uncertainty.standard_errors[parameter as usize]
                } else {
                    f64::NAN
                }
            };
            let tilted = uncertainty.free.contains(&Parameter::Tilt1);
            sets.push(DoneSet {
                name: if several {
                    (k + 1).to_string()
                } else {
                    String::new()
                },
                status: status.to_owned(),
                why,
                valid_from_ns: if k == 0 { None } else { starts[k] },
                valid_to_ns: if last { None } else { starts[k + 1] },
                hours_rad: None,
                errors: [
                    written.pedestal_tilt_rad,
                    written.pedestal_tilt_azimuth_rad,
                    written.axis_nonorthogonality_rad,
                    written.mirror_tilt_rad,
                    written.azimuth_reference_rad,
                    written.elevation_reference_rad,
                ]
                .map(Exact),
                mirror_offset_m: Exact(parameters.mirror_offset_m()),
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
                rms_mrad: Exact(epoch.fit.rms_mrad),
                beam_rms_mrad: Exact(epoch.fit.beam_rms_mrad),
                iterations: epoch.fit.iterations,
                condition: Exact(uncertainty.condition),
                rank: uncertainty.rank,
                degrees_of_freedom: uncertainty.degrees_of_freedom,
                sigma: Exact(uncertainty.sigma),
                year_pointing_mrad: Exact(epoch.year_pointing_mrad.unwrap_or(f64::NAN)),
                weakness: epoch.weakness.to_string(),
                rows: epoch.rows.clone(),
            });
        }
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
                .collect(),
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
        let rejected = of.observations.len() - used;
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

fn median(mut values: Vec<f64>) -> Option<f64> {
    values.retain(|value| value.is_finite());
    values.sort_by(f64::total_cmp);
    values.get(values.len() / 2).copied()
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
