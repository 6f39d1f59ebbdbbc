//! The field as one: fitted together, or followed from a state.

mod batch;
mod files;
mod known;
mod said;
mod update;

use helio_calib::joint::{Foretold, StepKind};
use helio_calib::{CalibrationError, Mount};
use helio_io::{AtomicFile, CalibratedSet, LoadedField, Observations, Provenance, format_time};

use super::changes::median;
use super::resume::{hash_files, hash_text};
use super::{OK, SAID, different_outputs};
use crate::Outcome;
use crate::args::CalibrateArgs;
use crate::failure::Failure;
use crate::plan;
use crate::printer::{Bytes, Counted, Grouped, Printer};

/// Nanoseconds of a day.
const DAY_NS: f64 = 86_400e9;

pub(super) fn run(args: &CalibrateArgs, printer: &Printer) -> Result<Outcome, Failure> {
    let format = plan::format(args.out.out.as_deref(), args.out.format)?;
    different_outputs(args)?;
    for path in [&args.joint.causes, &args.joint.steps]
        .into_iter()
        .flatten()
    {
        plan::format(Some(path), None)?;
    }
    if args.joint.state.as_deref().is_some_and(plan::is_stdout) {
        return Err(Failure::refused(
            "--state: a state is a file; standard output takes the table",
        ));
    }
    let loaded = plan::field(&args.field, printer)?;
    if loaded.site.is_none() {
        return Err(Failure::refused(format!(
            "{}: --joint and --update need the latitude from [site]: the sun's path over the sky",
            args.field.display()
        )));
    }
    let mut inputs = loaded.files.clone();
    inputs.push(args.observations.clone());
    let outputs = [
        &args.out.out,
        &args.joint.causes,
        &args.joint.steps,
        &args.joint.state,
    ];
    // The table's own place is looked at with its destination.
    for path in outputs[1..].iter().copied().flatten() {
        plan::not_an_input(path, &inputs)?;
    }
    let destination = plan::destination(args.out.out.as_deref(), format, &inputs, printer)?;
    let state = args.joint.update.iter();
    for path in outputs.into_iter().flatten().chain(state) {
        if !plan::is_stdout(path) {
            AtomicFile::check(path)?;
        }
    }
    let run = Run {
        args,
        loaded,
        printer,
    };
    match &args.joint.update {
        Some(state) => run.update(state, destination, format),
        None => run.fit(destination, format),
    }
}

/// What both ways have in common.
struct Run<'a> {
    args: &'a CalibrateArgs,
    loaded: LoadedField,
    printer: &'a Printer,
}

/// A record that was held against what was known before it.
struct Judged {
    /// Which of the heliostats with observations, and which observation of that.
    index: usize,
    observation: usize,
    foretold: Foretold,
    kind: StepKind,
    /// Only of records that were followed.
    alarm: Option<bool>,
}

/// A jump of a zero point, for people.
struct JumpFound {
    index: usize,
    unix_ns: Option<i64>,
    axis: usize,
    /// What is known of the zero point after all records less that before them, where that is known.
    size_rad: Option<f64>,
    /// How far the beam of the first record after it was off.
    missed_mrad: Option<f64>,
    /// False while another account of the same records is not yet given up.
    certain: bool,
}

impl Run<'_> {
    fn mount(&self, row: usize) -> Mount {
        let field = &self.loaded.field;
        Mount::of(field.mode(), &field.heliostats()[row])
    }

    fn latitude_rad(&self) -> f64 {
        // checked before anything else is done
        self.loaded.site.as_ref().map_or(0.0, |s| s.latitude_rad)
    }

    /// Observations that can be put in order.
    fn observations(&self) -> Result<(Observations, String), Failure> {
        let path = &self.args.observations;
        let (observations, hash) = rayon::join(
            || helio_io::load_observations(path, &self.loaded),
            || helio_io::hash_file(path),
        );
        let (observations, hash) = (observations?, hash?);
        for warning in &observations.warnings {
            self.printer.warn(warning);
        }
        self.printer.say(format_args!(
            "{} of {}, of {} in the field",
            Counted(observations.len(), "observation"),
            Counted(observations.heliostats.len(), "heliostat"),
            Grouped(self.loaded.field.len() as u64)
        ));
        if observations.is_empty() {
            return Err(Failure::refused(format!(
                "{}: none of its {} records can be used",
                path.display(),
                observations.records
            )));
        }
        let mut timeless = 0;
        let mut first = None;
        for of in &observations.heliostats {
            for (observation, &record) in of.observations.iter().zip(&of.records) {
                if observation.unix_ns.is_none() {
                    timeless += 1;
                    first.get_or_insert((record, of.row));
                }
            }
        }
        if let Some((record, row)) = first {
            let words = format!(
                "{}: {} no time (first {}, heliostat `{}`)",
                path.display(),
                match timeless {
                    1 => "1 record has".to_owned(),
                    count => format!("{} records have", Grouped(count)),
                },
                observations.position(record),
                self.loaded.field.ids()[row]
            );
            if self.args.joint.update.is_some() {
                return Err(Failure::refused(format!(
                    "{words}, without which --update cannot tell new records from old ones"
                )));
            }
            if timeless == observations.len() as u64 {
                return Err(Failure::refused(format!(
                    "{words}, and --joint needs times: zero points wander"
                )));
            }
            self.printer.warn(format_args!(
                "{words}: each counts as made together with the one before it"
            ));
        }
        Ok((observations, hash))
    }

    fn provenance(&self, how: &str, observations_hash: String) -> Result<Provenance, Failure> {
        Ok(Provenance {
            version: env!("CARGO_PKG_VERSION").to_owned(),
            solver: how.to_owned(),
            residual: "beam".to_owned(),
            robust: "accounts".to_owned(),
            field_hash: hash_files(&self.loaded.files)?,
            observations_hash,
            options_hash: hash_text(&format!("{:?}", self.args.joint.ahead)),
        })
    }

    /// How a state file was refused by the library.
    fn unusable(path: &std::path::Path, error: CalibrationError) -> Failure {
        Failure::refused(format!("{}: not a usable state: {error}", path.display()))
    }

    /// Jumps and outliers in words, at most so many lines.
    fn say_judged(&self, observations: &Observations, judged: &[Judged], jumps: &[JumpFound]) {
        let id = |index: usize| &self.loaded.field.ids()[observations.heliostats[index].row];
        for jump in jumps.iter().take(SAID) {
            let by = jump.size_rad.map_or(String::new(), |size| {
                format!(" by about {:+.1} mrad", 1e3 * size)
            });
            self.printer.say(format_args!(
                "{}: the zero point of axis {} {}{by} before {}{}",
                id(jump.index),
                jump.axis + 1,
                if jump.certain {
                    "jumped"
                } else {
                    "may have jumped"
                },
                jump.unix_ns
                    .map_or("a record without a time".to_owned(), format_time),
                jump.missed_mrad.map_or(String::new(), |mrad| format!(
                    ", whose beam missed by {mrad:.1} mrad"
                ))
            ));
        }
        if jumps.len() > SAID {
            self.printer.say(format_args!(
                "... and {} more; --steps shows all",
                Counted(jumps.len() - SAID, "jump")
            ));
        }
        let count = |kind: StepKind| judged.iter().filter(|one| one.kind == kind).count();
        self.printer.say(format_args!(
            "{}: {} not believed, {} of zero points{}",
            Counted(judged.len(), "record"),
            Grouped(count(StepKind::Outlier) as u64),
            Counted(jumps.len(), "jump"),
            match count(StepKind::Misses) {
                0 => String::new(),
                misses => format!(", {misses} whose beam should not meet the target"),
            }
        ));
    }

    /// The table in a line.
    pub(super) fn say_table(&self, sets: &[CalibratedSet], bytes: u64) -> Outcome {
        let bad = sets.iter().filter(|set| set.status != OK).count();
        let foretold = sets
            .iter()
            .filter_map(|set| Some(set.joint?.foretold_mrad))
            .collect();
        let typical = match median(foretold) {
            Some(mrad) => format!("; beams expected to miss by {mrad:.2} mrad in the middle"),
            None => String::new(),
        };
        let bad_words = match bad {
            0 => String::new(),
            bad => format!(", {} undetermined", Grouped(bad as u64)),
        };
        self.printer.say(format_args!(
            "{}: {} ok{bad_words}{typical}; {}",
            Counted(sets.len(), "row"),
            Grouped((sets.len() - bad) as u64),
            Bytes(bytes)
        ));
        if bad > 0 {
            Outcome::SomeRowsFailed
        } else {
            Outcome::Good
        }
    }
}
