//! What is said of it all.

use helio_io::CalibratedSet;
use helio_io::calibrate::{Choice, Done, Left, OK, Run, median};

use super::SAID;
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

/// What was found, in words.
pub(super) fn say(
    run: &Run<'_>,
    done: &[Done],
    sets: &[CalibratedSet],
    bytes: u64,
    printer: &Printer,
) {
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
        let id = run.id(one.index);
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
            let all = run.observations.heliostats[one.index].observations.len();
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
    let unseen = run.loaded.field.len() - done.len();
    if unseen > 0 {
        printer.note(format_args!(
            "{} of the field without observations and without a row",
            Counted(unseen, "heliostat")
        ));
    }
}
