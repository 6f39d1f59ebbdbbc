//! The page around the figures.

use std::fmt::Write;

use super::{JointPage, RecordLine, SETTLED, causes, field, foretold, rms, rounded, zero};
use crate::calibration::page::{document, facts, sentences};
use crate::calibration::plot::{count, mrad};
use crate::svg::Escaped;

pub(super) fn html(page: &JointPage) -> String {
    let mut html = facts(&page.facts);
    let held = foretold::held(page);
    html.push_str(&sentences(&summary(page, &held)));

    html.push_str("<h2>Causes in common</h2>\n");
    html.extend(causes::figure(&page.causes));
    html.push_str(&causes::table(&page.causes));

    html.push_str("<h2>How records scatter and zero points wander</h2>\n");
    html.push_str(&noise(page));

    html.push_str("<h2>How heliostats differ</h2>\n");
    html.extend(field::figure(page));
    html.push_str(&field::table(page));
    html.extend(field::correlations(page));

    html.push_str("<h2>Foretold and seen</h2>\n");
    if held.is_empty() {
        html.push_str("<p>No record was foretold.</p>\n");
    }
    html.extend(foretold::achieved(&held));
    html.extend(foretold::reliability(&held));
    html.push_str(&foretold::table(&held));

    let chosen = zero::chosen(page);
    html.push_str("<h2>Zero points over time</h2>\n");
    if chosen.is_empty() {
        html.push_str("<p>There are no records.</p>\n");
    }
    html.extend(zero::figure(page, &chosen));
    html.push_str(&zero::table(page, &chosen));
    if !chosen.is_empty() {
        html.push_str("<h2>Jumps</h2>\n");
        html.push_str(&zero::jumps(page));
        html.push_str("<h2>Outliers</h2>\n");
        html.push_str(&foretold::outliers(page));
    }

    if !page.findings.is_empty() {
        html.push_str("<h2>Findings</h2>\n");
        html.push_str(&sentences(&page.findings));
    }

    html.push_str("<h2>What the words mean</h2>\n");
    let words = WORDS.map(|(word, meaning)| (word.to_owned(), meaning.to_owned()));
    html.push_str(&facts(&words));
    document(&page.title, &html, [&page.version, &page.generated_utc])
}

const WORDS: [(&str, &str); 12] = [
    (
        "miss",
        "Angle between the foretold beam and the spot that was seen, seen from the mirror. A mirror turned by 1 mrad turns \
         its beam by up to 2 mrad.",
    ),
    (
        "one record ahead",
        "A record is foretold from the records of its heliostat before it; what is common to the field is taken from all \
         records of the fit.",
    ),
    (
        "expected",
        "Root mean square of the miss that the stated uncertainty leads to, the record's own scatter included.",
    ),
    (
        "ellipse",
        "Where a miss should lie with the stated probability, by its covariance.",
    ),
    (
        "cause",
        "Something that moves the spots of all heliostats, or all spots on one target, by one rule. Of a cause of each \
         heliostat the value is the field's mean.",
    ),
    (
        "evidence",
        "Logarithm of how much likelier all records together are with the cause than without it; 3 is 20 times. A cause \
         without evidence is held at zero.",
    ),
    (
        "turn",
        "How far the cause at its value turns the beam, root mean square over the records.",
    ),
    (
        "worth",
        "By how much farther a fit that does not know of the cause would miss the records: how far its value turns the beam, \
         less what each heliostat's angles at rest can make up for, root mean square over the records.",
    ),
    (
        "zero point",
        "What is added to an encoder's angle. It wanders: a slow and a fast part, each forgotten exponentially, about the \
         heliostat's value at rest.",
    ),
    (
        "jump",
        "A sudden change of one axis' zero point, found where later records agree with it. One in doubt is the likeliest \
         account of the last records, which those to come may yet explain otherwise; it is drawn and listed, not counted.",
    ),
    (
        "outlier",
        "A record that was not believed: its spot lies where neither what was expected nor a jump that later records \
         confirm would put it.",
    ),
    (
        "plain record",
        "Neither an outlier nor the first after a jump. Which records are plain is known only afterwards.",
    ),
];

/// The page in a few sentences.
fn summary(page: &JointPage, held: &[foretold::Held<'_>]) -> Vec<String> {
    let observed = page
        .heliostats
        .iter()
        .filter(|h| h.observations > 0)
        .count();
    let observations = page.heliostats.iter().map(|h| h.observations).sum();
    let records = || page.heliostats.iter().flat_map(|h| &h.records);
    let [mut jumps, mut in_doubt] = [0, 0];
    for [sure, perhaps] in records().map(zero::jumps_of) {
        jumps += sure;
        in_doubt += perhaps;
    }
    let mut all = vec![format!(
        "Heliostats: {}, observed: {}. Records: {}, outliers: {}, jumps: {}{}.",
        count(page.heliostats.len()),
        count(observed),
        count(observations),
        count(records().filter(|r| r.outlier).count()),
        count(jumps),
        match in_doubt {
            0 => String::new(),
            in_doubt => format!(" and {} in doubt", count(in_doubt)),
        },
    )];
    if !page.causes.is_empty() {
        let admitted = page.causes.iter().filter(|c| c.admitted).count();
        all.push(format!(
            "Of {} causes looked for the records speak for {}.",
            count(page.causes.len()),
            count(admitted)
        ));
    }
    let settled = || page.heliostats.iter().flat_map(|h| h.settled());
    let number = settled().count();
    if number > 0 {
        all.push(format!(
            "One record ahead, after a heliostat's first {SETTLED}, the beam missed by {} mrad where {} mrad was expected (root \
             mean square of {} plain records).",
            mrad(rms(settled().map(RecordLine::beam_mrad))),
            mrad(rms(settled().map(RecordLine::expected_mrad))),
            count(number),
        ));
    }
    let plain = || held.iter().map(|h| h.record).filter(|r| r.is_plain());
    if plain().next().is_some() {
        let share = |stated| 100.0 * foretold::share(plain(), stated);
        all.push(format!(
            "Inside the ellipse stated for 50 % lie {:.1} % of misses, for 95 % {:.1} %, for 99 % {:.1} %.",
            share(0.5),
            share(0.95),
            share(0.99)
        ));
    }
    let counted = records().count();
    if counted > 0 && counted < observations {
        let said = format!(
            "The figures and lists of records, and the numbers of outliers and jumps, are those of {} of them.",
            count(counted)
        );
        all.insert(1, said);
    }
    all
}

fn noise(page: &JointPage) -> String {
    if page.noise.is_empty() {
        return "<p>Nothing was learnt.</p>\n".to_owned();
    }
    let mut html = String::from("<table>\n");
    for line in &page.noise {
        // Writing to a string cannot fail.
        let _ = writeln!(
            html,
            "<tr><td>{}</td><td class=\"n\">{}</td><td>{}</td></tr>",
            Escaped(&line.name),
            rounded(line.value, 0.2 * line.value.abs()),
            Escaped(&line.unit)
        );
    }
    html.push_str("</table>\n");
    html
}
