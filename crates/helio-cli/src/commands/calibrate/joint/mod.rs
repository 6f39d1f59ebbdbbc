//! The field as one: fitted together, or followed from a state.

mod batch;
mod files;
mod known;
mod leftovers;
mod outputs;
mod page;
mod said;
mod update;

use helio_calib::joint::{DAY_NS, Foretold, Spell, StepKind, too_late};
use helio_calib::{CalibrationError, Mount, Observation};
use helio_io::calibrate::OK;
use helio_io::output::{Destination, Format};
use helio_io::{
    AtomicFile, CalibratedSet, KeptMount, LoadedField, Observations, Provenance, format_time,
};

use super::changes::{earlier, median};
use super::proposals::Proposals;
use super::resume::{hash_files, hash_text};
use super::{SAID, different_outputs, observed, report_file};
use crate::Outcome;
use crate::args::CalibrateArgs;
use crate::failure::Failure;
use crate::plan;
use crate::printer::{Bytes, Counted, Grouped, Printer};
use outputs::Written;

/// Options of a fit heliostat by heliostat that the field as one has no use for, each with the reason.
const NOT_AS_ONE: [(&str, &str); 8] = [
    (
        "solver",
        "the field as one is filtered record by record, and there is one way to do that",
    ),
    (
        "residual",
        "the field as one makes the miss across the beam small, by the scatter that it finds",
    ),
    (
        "robust",
        "the field as one decides of each record whether it is believed, by those after it",
    ),
    (
        "sets",
        "in the field as one what changes over the day are causes in common, and what changes over days the zero points",
    ),
    (
        "fit_mirror_offset",
        "the field as one takes the mirror offset from the layout",
    ),
    (
        "hold",
        "in the field as one all six angles are found, few records leaning on those of all others",
    ),
    (
        "prior",
        "the field as one learns from all heliostats what is to be expected of one",
    ),
    (
        "resume",
        "the field as one is fitted in one piece, and nothing of it is finished before the end",
    ),
];

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
    for id in ["keep_all", "no_jumps"] {
        if args.joint.update.is_some() && args.typed.contains(&id) {
            return refused(
                id,
                "a state goes on as the --joint that began it was told to",
            );
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
    if loaded.site.is_none() {
        return Err(Failure::refused(format!(
            "{}: --joint and --update need the latitude from [site]: the sun's path over the sky",
            args.field.display()
        )));
    }
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
        proposals: Proposals::new(args, &loaded)?,
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
    let run = Run {
        args,
        loaded,
        printer,
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

/// When a spell was, in words.
fn days_of(spell: &Spell) -> String {
    let [first, last] = spell.days.map(|day| {
        let time = format_time((day * DAY_NS) as i64);
        time.split('T').next().unwrap_or_default().to_owned()
    });
    match spell.lasts {
        true => format!("since {first}"),
        false if first == last => format!("on {first}"),
        false => format!("from {first} to {last}"),
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
    /// Zero points after it less those at rest (of the heliostat as it was before the run, where it is followed)
    /// \[rad\], and one standard deviation of them.
    zero_rad: [f64; 2],
    zero_sigma_rad: [f64; 2],
    /// Whether the zero point of either axis is taken to have jumped before it.
    jumped: [bool; 2],
    /// Whether other accounts of it are not yet given up.
    in_doubt: bool,
    /// Whether it raised an alarm, and whether as the third in a row that is not believed; only of records that were
    /// followed.
    alarm: Option<[bool; 2]>,
}

/// A jump of a zero point, for people.
struct JumpFound {
    index: usize,
    unix_ns: Option<i64>,
    axis: usize,
    /// What is known of the zero point after it (in a followed field after all records of the run) less that before.
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

    /// What of a row's mount and drives must not change while it is followed.
    fn kept_mount(&self, row: usize) -> KeptMount {
        KeptMount::of(&self.mount(row), &self.loaded.drives[row])
    }

    fn latitude_rad(&self) -> f64 {
        // checked before anything else is done
        self.loaded.site.as_ref().map_or(0.0, |s| s.latitude_rad)
    }

    /// Observations that can be put in order.
    fn observations(&self) -> Result<(Observations, String), Failure> {
        let path = &self.args.observations;
        let (observations, hash) = observed(self.args, &self.loaded, self.printer)?;
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
                observations.position(record)?,
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
            options_hash: hash_text(&format!(
                "{:?} {} {}",
                self.args.joint.ahead, self.args.fit.keep_all, self.args.fit.no_jumps
            )),
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

    /// Records whose time is hardly theirs: more than a month after those of almost all heliostats of the table, as each
    /// heliostat and observation; said aloud.
    fn too_late(&self, observations: &Observations, so: &str) -> Result<f64, Failure> {
        let day = |o: &Observation| o.unix_ns.map(|ns| ns as f64 / DAY_NS);
        let last_days: Vec<f64> = observations
            .heliostats
            .iter()
            .filter_map(|of| of.observations.iter().filter_map(day).reduce(f64::max))
            .collect();
        let limit = too_late(&last_days);
        let mut late = 0;
        let mut first = None;
        for of in &observations.heliostats {
            for (observation, &record) in of.observations.iter().zip(&of.records) {
                if day(observation).is_some_and(|day| day > limit) {
                    late += 1;
                    first.get_or_insert((record, of.row, observation.unix_ns));
                }
            }
        }
        if let Some((record, row, ns)) = first {
            self.printer.warn(format_args!(
                "{}: {} more than 30 days after those of the other heliostats (first {}, heliostat `{}`, {}): {so}",
                observations.path.display(),
                match late {
                    1 => "1 record is dated".to_owned(),
                    late => format!("{} records are dated", Grouped(late)),
                },
                observations.position(record)?,
                self.loaded.field.ids()[row],
                ns.map_or(String::new(), format_time)
            ));
        }
        Ok(limit)
    }

    /// When the field as a whole was off, from a day on; whether it was.
    fn say_spells(&self, spells: &[Spell], from: f64) -> bool {
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
        !said.is_empty()
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
