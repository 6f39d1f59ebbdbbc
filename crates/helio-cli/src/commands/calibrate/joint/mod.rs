//! The field as one: fitted together, or followed from a state.

mod batch;
mod leftovers;
mod outputs;
mod said;
mod update;

use helio_calib::joint::{Spell, StepKind};
use helio_io::calibrate::joint::{
    JointAsked, JointRun, Judged, JumpFound, NOT_ANEW, NOT_AS_ONE, Remark, days_of, jump_words,
    needs_site,
};
use helio_io::calibrate::{OK, Proposals, earlier, median};
use helio_io::output::{Destination, Format};
use helio_io::{AtomicFile, CalibratedSet, LoadedField, Observations, Provenance};

use super::proposals::proposals_of;
use super::resume::hash_files;
use super::{SAID, different_outputs, observed, report_file};
use crate::Outcome;
use crate::args::CalibrateArgs;
use crate::failure::Failure;
use crate::plan;
use crate::printer::{Bytes, Counted, Grouped, Printer};
use outputs::Written;

/// Refuses options that make no sense here.
fn refuse(args: &CalibrateArgs) -> Result<(), Failure> {
    let way = if args.joint.joint {
        "--joint"
    } else {
        "--update"
    };
    let refused = |id: &str, why: &str| {
        let option = id.replace('_', "-");
        Err(Failure::refused(format!("--{option} with {way}: {why}")))
    };
    for (id, why) in NOT_AS_ONE {
        if args.typed.contains(&id) {
            return refused(id, why);
        }
    }
    if args.joint.update.is_some() {
        for (id, why) in NOT_ANEW {
            if args.typed.contains(&id) {
                return refused(id, why);
            }
        }
    }
    Ok(())
}

pub(super) fn run(args: &CalibrateArgs, printer: &Printer) -> Result<Outcome, Failure> {
    let format = plan::format(args.out.out.as_deref(), args.out.format)?;
    refuse(args)?;
    different_outputs(args)?;
    let tables = [
        &args.joint.causes,
        &args.joint.steps,
        &args.joint.leftovers,
        &args.rejected,
        &args.plan_out,
    ];
    for path in tables.into_iter().flatten() {
        plan::format(Some(path), None)?;
    }
    if let Some(path) = &args.joint.leftovers {
        leftovers::format(path)?;
    }
    if args.joint.state.as_deref().is_some_and(plan::is_stdout) {
        return Err(Failure::refused(
            "--state: a state is a file; standard output takes the table",
        ));
    }
    let loaded = plan::field(&args.field, printer)?;
    needs_site(&loaded)?;
    let mut inputs = loaded.files.clone();
    inputs.push(args.observations.clone());
    inputs.extend(args.compare.clone());
    inputs.extend(args.spots.clone());
    let others = [&args.joint.state, &args.report];
    // The table's own place is looked at with its destination.
    for path in tables.into_iter().chain(others).flatten() {
        plan::not_an_input(path, &inputs)?;
    }
    let destination = plan::destination(args.out.out.as_deref(), format, &inputs, printer)?;
    // What cannot be written is better known before a long run than after it.
    let written = [&args.out.out, &args.joint.state, &args.joint.update];
    for path in tables.into_iter().chain(written).flatten() {
        if !plan::is_stdout(path) {
            AtomicFile::check(path)?;
        }
    }
    let asked = Asked {
        proposals: proposals_of(args, &loaded)?,
        old: match &args.compare {
            Some(path) => Some(earlier(path, &loaded)?),
            None => None,
        },
        report: match &args.report {
            Some(path) => Some(report_file(path)?),
            None => None,
        },
        destination,
        format,
    };
    let limit_mrad = args.fit.max_year_pointing_mrad;
    let limited = args.typed.contains(&"max_year_pointing_mrad");
    let run = Run {
        args,
        loaded,
        printer,
        how: JointAsked {
            keep_all: args.fit.keep_all,
            no_jumps: args.fit.no_jumps,
            ahead_days: args.joint.ahead,
            max_year_pointing_mrad: limited.then_some(limit_mrad),
        },
    };
    match &args.joint.update {
        Some(state) => run.update(state, asked),
        None => run.fit(asked),
    }
}

/// What is to be written, opened before anything is fitted.
struct Asked {
    proposals: Option<Proposals>,
    old: Option<Vec<CalibratedSet>>,
    report: Option<AtomicFile>,
    destination: Destination,
    format: Format,
}

/// What both ways have in common.
struct Run<'a> {
    args: &'a CalibrateArgs,
    loaded: LoadedField,
    printer: &'a Printer,
    how: JointAsked,
}

/// Says a remark when it comes.
fn say(printer: &Printer, remark: Remark) {
    match remark {
        Remark::Warning(words) => printer.warn(words),
        Remark::Note(words) => printer.note(format_args!("{words}")),
    }
}

impl Run<'_> {
    /// The observations, and their hash.
    fn observations(&self) -> Result<(Observations, String), Failure> {
        observed(self.args, &self.loaded, self.printer)
    }

    /// Does something with the field and its observations, once these are known to have times.
    fn with<T>(
        &self,
        observations: &Observations,
        work: impl FnOnce(&JointRun<'_>) -> Result<T, Failure>,
    ) -> Result<T, Failure> {
        let say = |remark| say(self.printer, remark);
        let run = JointRun {
            loaded: &self.loaded,
            observations,
            asked: &self.how,
            say: &say,
            watch: &|_, _| true,
        };
        run.check_times(self.args.joint.update.is_some())?;
        work(&run)
    }

    fn provenance(&self, how: &str, observations_hash: String) -> Result<Provenance, Failure> {
        Ok(Provenance {
            version: env!("CARGO_PKG_VERSION").to_owned(),
            solver: how.to_owned(),
            residual: "beam".to_owned(),
            robust: "accounts".to_owned(),
            field_hash: hash_files(&self.loaded.files)?,
            observations_hash,
            options_hash: self.how.hash(),
        })
    }

    /// Jumps and outliers in words, at most so many lines.
    fn say_judged(&self, observations: &Observations, judged: &[Judged], jumps: &[JumpFound]) {
        let id = |index: usize| &self.loaded.field.ids()[observations.heliostats[index].row];
        for jump in jumps.iter().take(SAID) {
            let words = jump_words(jump);
            self.printer
                .say(format_args!("{}: {words}", id(jump.index)));
        }
        if jumps.len() > SAID {
            self.printer.say(format_args!(
                "... and {} more; --steps shows all",
                Counted(jumps.len() - SAID, "jump")
            ));
        }
        let count = |kind: StepKind| judged.iter().filter(|one| one.kind == kind).count();
        let certain = jumps.iter().filter(|jump| jump.certain).count();
        self.printer.say(format_args!(
            "{}: {} not believed, {} of zero points{}{}",
            Counted(judged.len(), "record"),
            Grouped(count(StepKind::Outlier) as u64),
            Counted(certain, "jump"),
            match jumps.len() - certain {
                0 => String::new(),
                in_doubt => format!(" and {} in doubt", Grouped(in_doubt as u64)),
            },
            match count(StepKind::Misses) {
                0 => String::new(),
                misses => format!(", {misses} whose beam should not meet the target"),
            }
        ));
    }

    /// When the field as a whole was off, from a day on.
    fn say_spells(&self, spells: &[Spell], from: f64) {
        let now = |spell: &&Spell| spell.lasts || spell.days[1] >= from;
        let said: Vec<&Spell> = spells.iter().filter(now).collect();
        for spell in said.iter().take(SAID) {
            self.printer.warn(format_args!(
                "{} the field as a whole was off: more than half of {} at a time missed by far more than was expected of \
                 them. Rather than each of them, a clock, the name or the survey of a target, the table of angles or a \
                 camera is wrong",
                days_of(spell),
                Counted(spell.heliostats, "heliostat")
            ));
        }
        if said.len() > SAID {
            let more = said.len() - SAID;
            self.printer.warn(format_args!(
                "... and {} in which it was",
                Counted(more, "more spell")
            ));
        }
    }

    /// The table in a line; `off` where the field as a whole is not to be believed.
    fn say_table(&self, written: &Written, off: bool) -> Outcome {
        let sets = &written.sets;
        let bad = sets.iter().filter(|set| set.status != OK).count();
        let foretold = sets
            .iter()
            .filter_map(|set| Some(set.joint?.foretold_mrad))
            .collect();
        let typical = match median(foretold) {
            Some(mrad) => format!("; beams expected to miss by {mrad:.2} mrad in the middle"),
            None => String::new(),
        };
        let mut bad_words = String::new();
        for status in ["undetermined", "unexplained"] {
            let count = sets.iter().filter(|set| set.status == status).count();
            if count > 0 {
                bad_words += &format!(", {} {status}", Grouped(count as u64));
            }
        }
        self.printer.say(format_args!(
            "{}: {} ok{bad_words}{typical}; {}",
            Counted(sets.len(), "row"),
            Grouped((sets.len() - bad) as u64),
            Bytes(written.bytes)
        ));
        for change in &written.changes {
            self.printer.say(format_args!("{change}"));
        }
        if bad > 0 || off {
            Outcome::SomeRowsFailed
        } else {
            Outcome::Good
        }
    }
}
