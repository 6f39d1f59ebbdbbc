//! The page around tables and figures.

use helio_spot::accuracy::{BinOutcome, ClauseOutcome, Verdict};

use super::{AccuracyPage, figures, tables};
use crate::calibration::page::{document, facts, sentences};
use crate::svg::Escaped;

pub(super) fn html(page: &AccuracyPage<'_>) -> String {
    let mut html = verdict(page);
    html.push_str(&facts(&page.facts));
    html.push_str("<h2>Shares by wind speed</h2>\n");
    html.push_str(&tables::shares(page));
    html.push_str(&figures::by_wind(page));
    html.push_str("<h2>Accuracy, precision, bias</h2>\n");
    html.push_str(&tables::figures(page));
    html.push_str(&figures::scatter(page));
    html.push_str(&figures::over_time(page));
    html.push_str(&figures::histogram(page));
    html.push_str("<h2>Frames</h2>\n");
    html.push_str(&tables::frames(page));
    let warnings: Vec<String> = page
        .evaluation
        .warnings
        .iter()
        .map(|warning| sentence(&warning.to_string()))
        .collect();
    if !warnings.is_empty() {
        html.push_str("<h2>To be borne in mind</h2>\n");
        html.push_str(&sentences(&warnings));
    }
    html.push_str("<h2>The standard, clause by clause</h2>\n");
    html.push_str(&tables::clauses(page));
    html.push_str("<h2>Instruments</h2>\n");
    html.push_str(&tables::instruments(page));
    html.push_str("<h2>Limits and counting</h2>\n");
    html.push_str(&tables::limits(page));
    html.push_str("<h2>Raw data</h2>\n");
    html.push_str(&tables::files(page));
    if !page.notes.is_empty() {
        html.push_str("<h2>Notes</h2>\n");
        html.push_str(&sentences(&page.notes));
    }
    html.push_str("<section class=\"sign\">\n<h2>Signatures</h2>\n");
    for role in ["Measured by", "Evaluated by", "Approved by"] {
        html.push_str(&format!(
            "<div><p>{role}</p><p><span>name</span></p><p><span>date</span></p><p><span>signature</span></p></div>\n"
        ));
    }
    html.push_str("</section>\n");
    document(&page.title, &html, [&page.version, &page.generated_utc])
}

/// A sentence with its capital and its full stop.
pub(super) fn sentence(text: &str) -> String {
    let mut chars = text.chars();
    let first = chars.next().map(char::to_uppercase);
    let mut text: String = first.into_iter().flatten().chain(chars).collect();
    if !text.ends_with('.') {
        text.push('.');
    }
    text
}

fn verdict(page: &AccuracyPage<'_>) -> String {
    let found = page.evaluation;
    let class = match found.verdict {
        Verdict::Qualified => "good",
        Verdict::NotQualified => "wrong",
        Verdict::NotEnoughData => "warn",
    };
    let confidence = tables::percent(page.options.confidence, 0);
    let of = |outcome: BinOutcome| {
        let winds: Vec<String> = found
            .judged
            .iter()
            .filter(|judged| judged.outcome == outcome)
            .map(|judged| format!("{} m/s", judged.limit.wind_m_s))
            .collect();
        match winds.as_slice() {
            [] => None,
            [one] => Some(one.clone()),
            [all @ .., last] => Some(format!("{} and {last}", all.join(", "))),
        }
    };
    let why = match found.verdict {
        Verdict::Qualified => format!(
            "At all wind speeds the {confidence} interval of the share of frames within {} mrad lies above the limit.",
            page.limits.angle_mrad
        ),
        Verdict::NotQualified => format!(
            "At {} the {confidence} interval of the share of frames within {} mrad lies below the limit.",
            of(BinOutcome::Below).unwrap_or_default(),
            page.limits.angle_mrad
        ),
        Verdict::NotEnoughData => format!(
            "At {} the {confidence} interval of the share of frames within {} mrad holds the limit: these data cannot \
             tell.",
            of(BinOutcome::Open).unwrap_or_default(),
            page.limits.angle_mrad
        ),
    };
    let printed = match found.printed_verdict {
        Some(true) => {
            "The printed rule, which compares the shares themselves with the limits, reads: qualified."
        }
        Some(false) => {
            "The printed rule, which compares the shares themselves with the limits, reads: not qualified."
        }
        None => {
            "The printed rule, which compares the shares themselves with the limits, cannot be read: at a wind speed \
             no frame is counted."
        }
    };
    let count = |outcome| {
        found
            .clauses
            .iter()
            .filter(|clause| clause.outcome == outcome)
            .count()
    };
    let (deviates, unstated) = (
        count(ClauseOutcome::Deviates),
        count(ClauseOutcome::NotStated),
    );
    let followed = if deviates + unstated == 0 {
        "All clauses of the standard are met.".to_owned()
    } else {
        format!(
            "Of {} clauses of the standard, {deviates} {} from and {unstated} {} not stated; see below.",
            found.clauses.len(),
            if deviates == 1 {
                "is departed"
            } else {
                "are departed"
            },
            if unstated == 1 { "is" } else { "are" },
        )
    };
    format!(
        "<div class=\"verdict {class}\"><p><b>{}</b> by {}</p></div>\n<p>{} {printed} {}</p>\n",
        Escaped(&sentence(found.verdict.as_str()).replace('.', "")),
        Escaped(&page.limits.name),
        Escaped(&why),
        Escaped(&followed)
    )
}
