//! The section of one heliostat.

use std::fmt::Write;

use super::plot::{count, mrad};
use super::{CalibrationPage, HeliostatSection, SetChoice, SetRow, dates};
use super::{correlation, page, parameters, residuals, target};
use crate::svg::Escaped;

/// More rejected records than this are only counted.
const MOST_REJECTED: usize = 100;
/// Epochs past this many have no table of their own.
const MOST_TABLES: usize = 16;

pub(super) fn section(all: &CalibrationPage, number: usize, section: &HeliostatSection) -> String {
    let mut html = format!(
        "<section class=\"heliostat\" id=\"h{number}\">\n<h2>Heliostat {} {}</h2>\n",
        Escaped(&section.id),
        page::badge(section.verdict)
    );
    html.push_str(&page::sentences(&section.words));
    let rejected = section
        .records
        .iter()
        .filter(|r| r.rejected.is_some())
        .count();
    let mut facts = vec![
        (
            "records".to_owned(),
            format!(
                "{}, of which {} rejected",
                count(section.records.len()),
                count(rejected)
            ),
        ),
        (
            "RMS of the beam".to_owned(),
            format!(
                "{} mrad before, {} mrad after the fit",
                mrad(section.before_rms_mrad),
                mrad(section.after_rms_mrad)
            ),
        ),
    ];
    let times = || section.records.iter().filter_map(|r| r.unix_ns);
    if let (Some(from), Some(to)) = (times().min(), times().max()) {
        let text = format!("{} to {} UTC", dates::minute(from), dates::minute(to));
        facts.push(("time".to_owned(), text));
    }
    facts.extend(section.facts.iter().cloned());
    html.push_str(&page::facts(&facts));

    if section.records.is_empty() {
        html.push_str("<p>There are no records of this heliostat.</p>\n");
    }
    html.extend(target::figure(section, &all.targets));
    html.extend(residuals::figure(section));
    if section.epochs.len() > 1 {
        html.push_str(&epoch_table(section));
    }
    html.extend(parameters::figure(section));
    for (i, epoch) in section.epochs.iter().enumerate().take(MOST_TABLES) {
        if section.epochs.len() > 1 {
            let _ = writeln!(html, "<h3>{} {}</h3>", capital(section.part()), i + 1);
        }
        html.push_str(&parameters::table(&epoch.parameters));
        if section.epochs.len() == 1 && !epoch.words.is_empty() {
            let _ = writeln!(html, "<p>{}</p>", Escaped(&epoch.words));
        }
        let mut facts = epoch.facts.clone();
        if let Some(sigma) = epoch.year_pointing_mrad {
            let text = format!(
                "{} mrad, one standard deviation, from the uncertainty of the parameters",
                mrad(sigma)
            );
            facts.insert(0, ("pointing over a year".to_owned(), text));
        }
        html.push_str(&page::facts(&facts));
    }
    html.extend(correlation::figure(section));
    html.push_str(&sets_table(&section.sets));
    html.push_str(&rejected_table(section, rejected));
    html.push_str("</section>\n");
    html
}

fn capital(part: &str) -> &str {
    if part == "set" { "Set" } else { "Epoch" }
}

fn epoch_table(section: &HeliostatSection) -> String {
    let epochs = &section.epochs;
    let (part, name, n) = (section.part(), capital(section.part()), epochs.len());
    let what = if part == "set" {
        format!("{n} parts of the day have parameters of their own.")
    } else {
        format!("The zero points jumped: {n} stretches of time were fitted by themselves.")
    };
    let mut html = format!(
        "<h3>{name}s</h3>\n<p>{what}</p>\n\
         <table><thead><tr><th>{part}</th><th>from (UTC)</th><th>to (UTC)</th><th class=\"n\">records</th>\
         <th class=\"n\">RMS, mrad</th><th class=\"n\">over a year, mrad</th><th>verdict</th></tr></thead>\n"
    );
    let time = |t: Option<i64>| t.map_or_else(|| "–".to_owned(), dates::minute);
    for (i, epoch) in epochs.iter().enumerate() {
        let year = epoch
            .year_pointing_mrad
            .map_or_else(|| "–".to_owned(), mrad);
        let colon = if epoch.words.is_empty() { "" } else { " " };
        let _ = writeln!(
            html,
            "<tr><td>{}</td><td class=\"t\">{}</td><td class=\"t\">{}</td><td class=\"n\">{}</td><td class=\"n\">{}</td>\
             <td class=\"n\">{year}</td><td>{}{colon}{}</td></tr>",
            i + 1,
            time(epoch.from_unix_ns),
            time(epoch.to_unix_ns),
            count(epoch.observations),
            mrad(epoch.beam_rms_mrad),
            page::badge(epoch.verdict),
            Escaped(&epoch.words)
        );
    }
    html.push_str("</table>\n");
    html
}

fn sets_table(choices: &[SetChoice]) -> String {
    let mut html = String::new();
    if choices.is_empty() {
        return html;
    }
    html.push_str(
        "<h3>Sets over the day</h3>\n<table><thead><tr><th class=\"n\">sets</th><th class=\"n\">RMS, mrad</th>\
         <th class=\"n\">unseen records, mrad</th><th></th><th>parts of the day (solar time)</th></tr></thead>\n",
    );
    for choice in choices {
        let unseen = choice.unseen_rms_mrad.map_or_else(|| "–".to_owned(), mrad);
        // Of choices that were not taken only the number of sets may be known.
        let known = choice.sets.iter().filter(|set| set.observations > 0);
        let parts: Vec<String> = known.map(part).collect();
        let chosen = if choice.chosen {
            "<b class=\"badge good\">chosen</b>"
        } else {
            ""
        };
        let _ = writeln!(
            html,
            "<tr><td class=\"n\">{}</td><td class=\"n\">{}</td><td class=\"n\">{unseen}</td><td>{chosen}</td><td>{}</td></tr>",
            choice.sets.len(),
            mrad(choice.beam_rms_mrad),
            Escaped(&parts.join("; "))
        );
    }
    html.push_str("</table>\n");
    html
}

fn part(set: &SetRow) -> String {
    let clock = |deg: f64| {
        let minutes = (720.0 + 4.0 * deg).round().clamp(0.0, 1440.0) as u32;
        format!("{:02}:{:02}", minutes / 60, minutes % 60)
    };
    let when = match (set.hour_angle_from_deg, set.hour_angle_to_deg) {
        (None, None) => "all day".to_owned(),
        (None, Some(to)) => format!("to {}", clock(to)),
        (Some(from), None) => format!("from {}", clock(from)),
        (Some(from), Some(to)) => format!("{} to {}", clock(from), clock(to)),
    };
    let (records, rms) = (count(set.observations), mrad(set.beam_rms_mrad));
    format!("{when}: {records} records, {rms} mrad")
}

fn rejected_table(section: &HeliostatSection, rejected: usize) -> String {
    let mut html = String::new();
    if rejected == 0 {
        return html;
    }
    html.push_str(
        "<h3>Rejected records</h3>\n<table><thead><tr><th>record</th><th>time (UTC)</th><th>target</th>\
         <th class=\"n\">off by, mrad</th><th>why</th></tr></thead>\n",
    );
    let records = section
        .records
        .iter()
        .filter_map(|r| Some((r, r.rejected.as_ref()?)));
    for (record, why) in records.take(MOST_REJECTED) {
        let time = record.unix_ns.map_or_else(|| "–".to_owned(), dates::minute);
        let _ = writeln!(
            html,
            "<tr><td>{}</td><td class=\"t\">{time}</td><td>{}</td><td class=\"n\">{}</td><td>{}</td></tr>",
            Escaped(&record.label),
            Escaped(&record.target),
            mrad(record.after_mrad),
            Escaped(why)
        );
    }
    html.push_str("</table>\n");
    if rejected > MOST_REJECTED {
        let _ = writeln!(
            html,
            "<p>{} more are not listed.</p>",
            count(rejected - MOST_REJECTED)
        );
    }
    html
}
