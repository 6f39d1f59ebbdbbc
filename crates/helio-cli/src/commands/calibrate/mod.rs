//! `calibrate`: the angular errors of every heliostat from observations of its spot.

mod heliostats;
mod joint;
mod proposals;
mod resume;
mod words;

use std::io::Write;
use std::path::{Path, PathBuf};
use std::time::{SystemTime, UNIX_EPOCH};

use helio_calib::schedule::Sets;
use helio_io::calibrate::{
    AHEAD_NS, Asked, CHANGES_TOLD, Changes, FitWords, OK, PRIOR_WITHOUT_SIGMAS, Run, earlier,
    without_sigmas, write_rejected,
};
use helio_io::{
    AtomicFile, CalibratedSet, IoError, LoadedField, Observations, Provenance, hash_file,
    load_observations_with_spots, load_spots, write_calibration,
};
use helio_report::AboutRun;
use helio_report::calibration::{CalibrationPage, calibration_page};

use crate::args::{CalibrateArgs, FitArgs, word};
use crate::failure::Failure;
use crate::printer::{Counted, Grouped, Printer};
use crate::{Outcome, plan};
use proposals::{proposals_of, write_proposals};
use resume::{build_hash, finished, hash_files, hash_text, is_plain};

impl From<&FitArgs> for FitWords {
    fn from(args: &FitArgs) -> Self {
        Self {
            solver: word(args.solver),
            residual: word(args.residual),
            robust: word(args.robust),
            sets: word(args.sets),
            fit_mirror_offset: args.fit_mirror_offset,
            hold: args.hold.clone(),
            prior: args.prior.clone(),
            keep_all: args.keep_all,
            no_jumps: args.no_jumps,
            max_year_pointing_mrad: args.max_year_pointing_mrad,
        }
    }
}

/// Lines of findings that a terminal shows.
const SAID: usize = 40;

pub(crate) fn run(args: &CalibrateArgs, printer: &Printer) -> Result<Outcome, Failure> {
    plan::threads(args.out.threads)?;
    if args.joint.joint || args.joint.update.is_some() {
        return joint::run(args, printer);
    }
    let format = plan::format(args.out.out.as_deref(), args.out.format)?;
    let loaded = plan::field(&args.field, printer)?;
    let words = FitWords::from(&args.fit);
    let asked = Asked::new(&words)?;
    if asked.sets() != Sets::One && loaded.site.is_none() {
        return Err(Failure::refused(
            "--sets: sets over the day go by the sun's hour angle, which needs the latitude from [site]",
        ));
    }
    let mut inputs = loaded.files.clone();
    inputs.push(args.observations.clone());
    inputs.extend(args.compare.clone());
    inputs.extend(args.spots.clone());
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
    let proposals = proposals_of(args, &loaded)?;
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
    let (read, build) = rayon::join(
        || observed(args, &loaded, printer),
        || resumable.map(|_| build_hash(std::env::current_exe())),
    );
    let (observations, observations_hash) = read?;
    let provenance = Provenance {
        version: env!("CARGO_PKG_VERSION").to_owned(),
        solver: words.solver.clone(),
        residual: words.residual.clone(),
        robust: words.robust.clone(),
        field_hash: hash_files(&loaded.files)?,
        observations_hash,
        options_hash: words.hash(),
    };
    let part = match resumable.zip(build) {
        Some((out, build)) => {
            let used = observations.len();
            Some(finished(out, args.resume, &provenance, used, build)?)
        }
        None if args.resume => {
            return Err(Failure::refused("--resume needs --out FILE"));
        }
        None => None,
    };
    if !args.fit.prior.is_empty() && observations.heliostats.iter().any(without_sigmas) {
        printer.note(format_args!("{PRIOR_WITHOUT_SIGMAS}"));
    }
    let run = Run {
        loaded: &loaded,
        observations: &observations,
        asked: &asked,
    };
    let (done, part) = heliostats::all(&run, part, printer)?;

    // What is finished stays in its file unless everything is written.
    let kept = part.as_ref().map(|part| part.path().to_owned());
    let at_end = |failure: Failure| match kept {
        Some(path) => Failure::AtEnd {
            failure: Box::new(failure),
            path,
        },
        None => failure,
    };
    let all = || -> Result<(Vec<CalibratedSet>, Vec<String>, u64), Failure> {
        let sets: Vec<CalibratedSet> = done.iter().flat_map(|done| run.sets(done)).collect();
        let changes = match &old {
            Some(old) => changes(&loaded, &observations, old, &sets)?,
            None => Vec::new(),
        };
        if let Some(file) = report {
            let about = AboutRun {
                provenance: &provenance,
                generated_utc: plan::made_at(),
                changes: changes.clone(),
            };
            let page = CalibrationPage::of_run(&run, &done, about)?;
            write_page(file, &calibration_page(&page))?;
        }
        if let Some(path) = &args.rejected {
            let format = plan::format(Some(path), None)?;
            let destination = plan::destination(Some(path), format, &[], printer)?;
            let rows = run.rejected(&done);
            write_rejected(destination, format, rows, &loaded, &observations)?;
        }
        if let Some(proposals) = &proposals {
            let rows = run.propose(proposals, &done, &|| true)?;
            write_proposals(proposals, &rows, args, &loaded, printer)?;
        }
        // Proposals take the place of the calibration where both would go to standard output.
        let bytes = if proposals.is_some() && args.plan_out.is_none() && args.out.out.is_none() {
            0
        } else {
            write_calibration(destination, format, &sets, &provenance)?
        };
        Ok((sets, changes, bytes))
    };
    let (sets, changes, bytes) = all().map_err(at_end)?;
    if let Some(part) = part {
        part.remove()?;
    }
    words::say(&run, &done, &sets, bytes, printer);
    for change in &changes {
        printer.say(format_args!("{change}"));
    }
    Ok(if sets.iter().any(|set| set.status != OK) {
        Outcome::SomeRowsFailed
    } else {
        Outcome::Good
    })
}

/// What changed against an earlier calibration, in the sentences that people are told.
fn changes(
    loaded: &LoadedField,
    observations: &Observations,
    old: &[CalibratedSet],
    sets: &[CalibratedSet],
) -> Result<Vec<String>, Failure> {
    let changes = Changes::between(loaded, observations, old, sets, &|| true)?;
    Ok(changes.sentences(CHANGES_TOLD))
}

/// The observations that can be used, which are some, and a hash of them and of their spots. What is dated later than the clock
/// is left aside: zero points would wander on to that day, and what is fitted would be taken to hold from it.
fn observed(
    args: &CalibrateArgs,
    loaded: &LoadedField,
    printer: &Printer,
) -> Result<(Observations, String), Failure> {
    let path = &args.observations;
    let spots = match &args.spots {
        Some(path) => Some((load_spots(path)?, hash_file(path)?)),
        None => None,
    };
    let (observations, hash) = rayon::join(
        || load_observations_with_spots(path, spots.as_ref().map(|(table, _)| table), loaded),
        || hash_file(path),
    );
    let (mut observations, mut hash) = (observations?, hash?);
    if let Some((_, of_spots)) = spots {
        hash = hash_text(&format!("{hash} {of_spots}"));
    }
    let now = SystemTime::now().duration_since(UNIX_EPOCH);
    let now_ns = now.map_or(0, |since| {
        i64::try_from(since.as_nanos()).unwrap_or(i64::MAX)
    });
    observations.leave_aside_after(now_ns.saturating_add(AHEAD_NS))?;
    for warning in &observations.warnings {
        printer.warn(warning);
    }
    printer.say(format_args!(
        "{} of {}, of {} in the field",
        Counted(observations.len(), "observation"),
        Counted(observations.heliostats.len(), "heliostat"),
        Grouped(loaded.field.len() as u64)
    ));
    if observations.is_empty() {
        return Err(Failure::refused(format!(
            "{}: none of its {} records can be used",
            path.display(),
            observations.records
        )));
    }
    Ok((observations, hash))
}

/// True for standard output under any of its names.
fn means_stdout(path: &Path) -> bool {
    let names = ["/dev/stdout", "/dev/fd/1", "/proc/self/fd/1"];
    plan::is_stdout(path) || names.iter().any(|name| path == Path::new(name))
}

/// Refuses outputs that would replace each other, or run into each other.
fn different_outputs(args: &CalibrateArgs) -> Result<(), Failure> {
    let outputs = [
        ("--out", args.out.out.as_deref()),
        ("--report", args.report.as_deref()),
        ("--rejected", args.rejected.as_deref()),
        ("--plan-out", args.plan_out.as_deref()),
        ("--causes", args.joint.causes.as_deref()),
        ("--steps", args.joint.steps.as_deref()),
        ("--leftovers", args.joint.leftovers.as_deref()),
        ("--state", args.joint.state.as_deref()),
        ("--update", args.joint.update.as_deref()),
    ];
    let printed = |path: &Option<PathBuf>| path.as_deref().is_some_and(means_stdout);
    // Without --out the calibration goes there, or the proposals in its place if they too have no file.
    let proposals = args.plan.is_some() && args.plan_out.is_none();
    let to_stdout: Vec<&str> = [
        (
            "--out (which is standard output where it is not given)",
            printed(&args.out.out) || (args.out.out.is_none() && !proposals),
        ),
        ("--rejected", printed(&args.rejected)),
        ("--causes", printed(&args.joint.causes)),
        ("--steps", printed(&args.joint.steps)),
        ("--leftovers", printed(&args.joint.leftovers)),
        (
            "--plan-out (which is standard output where it is not given)",
            printed(&args.plan_out) || proposals,
        ),
    ]
    .into_iter()
    .filter_map(|(option, there)| there.then_some(option))
    .collect();
    if let [one, other, ..] = to_stdout[..] {
        return Err(Failure::refused(format!(
            "{one} and {other} both name standard output, which takes one table; give one of them a file"
        )));
    }
    for (k, (one, path)) in outputs.iter().enumerate() {
        for (other, again) in &outputs[..k] {
            // A state may be written back under its own name said twice.
            if [*other, *one] != ["--state", "--update"] {
                plan::not_the_same((other, *again), (one, *path))?;
            }
        }
    }
    Ok(())
}

/// The file of a report, begun early so that a place that cannot be written is known at once.
pub(crate) fn report_file(path: &Path) -> Result<AtomicFile, Failure> {
    let suffix = path.extension().map(|suffix| suffix.to_ascii_lowercase());
    if suffix.is_none_or(|suffix| suffix != "html" && suffix != "htm") {
        return Err(Failure::refused(format!(
            "{}: --report writes a page; wanted a name that ends in .html",
            path.display()
        )));
    }
    Ok(AtomicFile::create(path)?)
}

pub(crate) fn write_page(mut file: AtomicFile, page: &str) -> Result<(), Failure> {
    let path = file.path().to_owned();
    file.write_all(page.as_bytes())
        .map_err(|error| IoError::write(&path, error))?;
    file.finish()?;
    Ok(())
}
