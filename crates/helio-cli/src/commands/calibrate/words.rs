//! What is said of it all.

use helio_calib::{Finding, Reason, WrongCall};
use helio_io::{CalibratedSet, IoError, format_time};

use super::changes::median;
use super::{OK, Run, SAID};
use crate::calibration::{Choice, Done, Left};
use crate::printer::{Bytes, Counted, Grouped, Printer};

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
pub(super) fn reasons(rejected: &[Left]) -> String {
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
pub(super) struct Words<'a> {
    pub run: &'a Run<'a>,
    pub index: usize,
    pub neighbours: &'a [usize],
}

impl Words<'_> {
    pub(super) fn heliostat(&self, neighbour: usize) -> String {
        let row = self.neighbours.get(neighbour);
        row.map_or(String::new(), |&row| {
            self.run.loaded.field.ids()[row].clone()
        })
    }

    pub(super) fn target(&self, target: usize) -> &str {
        let targets = &self.run.observations.targets;
        targets.get(target).map_or("", |(name, _)| name)
    }

    pub(super) fn position(&self, row: usize) -> Result<String, IoError> {
        let of = &self.run.observations.heliostats[self.index];
        self.run.observations.position(of.records[row])
    }

    pub(super) fn reason(&self, reason: &Reason) -> Result<String, IoError> {
        Ok(match reason {
            Reason::WrongHeliostat { neighbour } => {
                format!(
                    "it fits the mount of heliostat {}",
                    self.heliostat(*neighbour)
                )
            }
            Reason::WrongTarget { target } => {
                format!("its spot fits target {}", self.target(*target))
            }
            Reason::Duplicate { of } => format!("it is {} again", self.position(*of)?),
            other => other.to_string(),
        })
    }

    pub(super) fn finding(&self, finding: &Finding) -> Result<String, IoError> {
        Ok(match finding {
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
                        self.position(*last_before)?,
                        self.position(*first_after)?
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
        })
    }
}

impl Run<'_> {
    /// What was found, in words.
    pub(super) fn say(&self, done: &[Done], sets: &[CalibratedSet], bytes: u64, printer: &Printer) {
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
            "{}: {}{typical}; {}",
            Counted(sets.len(), "row"),
            words.join(", "),
            Bytes(bytes)
        ));
        let unseen = self.loaded.field.len() - done.len();
        if unseen > 0 {
            printer.note(format_args!(
                "{} of the field without observations and without a row",
                Counted(unseen, "heliostat")
            ));
        }
    }
}
