//! The tables of the page.

use std::fmt::Write;

use helio_spot::accuracy::{BinOutcome, ClauseOutcome, Figure, FrameStatus};

use super::AccuracyPage;
use super::page::sentence;
use crate::calibration::dates::minute;
use crate::calibration::plot::{count, mrad};
use crate::svg::Escaped;

/// A share in per cent; so many that are near 0 or 1 need more decimals.
pub(super) fn percent(share: f64, decimals: usize) -> String {
    if !share.is_finite() {
        return "–".to_owned();
    }
    format!("{:.decimals$}\u{202f}%", 100.0 * share)
}

fn interval(ends: [f64; 2]) -> String {
    let [low, high] = ends.map(|end| 100.0 * end);
    format!("{low:.2} to {high:.2}\u{202f}%")
}

fn whole(value: f64) -> String {
    if value < 9.95 {
        format!("{value:.1}")
    } else {
        count(value.round() as usize)
    }
}

pub(super) fn shares(page: &AccuracyPage<'_>) -> String {
    let mut html = format!(
        "<div class=\"scroll\"><table><thead><tr><th class=\"n\">wind, m/s</th><th class=\"n\">frames</th>\
         <th class=\"n\">independent</th><th class=\"n\">without spot</th><th class=\"n\">within {} mrad</th>\
         <th>{} interval</th><th class=\"n\">limit</th><th>interval is</th><th>share is</th></tr></thead>\n",
        page.limits.angle_mrad,
        percent(page.options.confidence, 0)
    );
    for judged in &page.evaluation.judged {
        let bin = &judged.bin;
        let (class, word) = match judged.outcome {
            BinOutcome::Above => ("good", "above"),
            BinOutcome::Below => ("wrong", "below"),
            BinOutcome::Open => ("warn", "open"),
        };
        let printed = match judged.printed {
            Some(true) => "above",
            Some(false) => "not above",
            None => "–",
        };
        // Writing to a string cannot fail.
        let _ = writeln!(
            html,
            "<tr><td class=\"n\">{} ± {}</td><td class=\"n\">{}</td><td class=\"n\">{}</td><td class=\"n\">{}</td>\
             <td class=\"n\">{}</td><td class=\"t\">{}</td><td class=\"n\">&gt;\u{202f}{}</td>\
             <td><b class=\"badge {class}\">{word}</b></td><td class=\"t\">{printed}</td></tr>",
            judged.limit.wind_m_s,
            page.options.bin_half_width_m_s,
            count(bin.frames),
            whole(bin.independent_frames),
            count(bin.lost),
            percent(bin.share.unwrap_or(f64::NAN), 2),
            interval(bin.interval),
            percent(judged.limit.share, 0)
        );
    }
    html.push_str("</table></div>\n");
    for judged in &page.evaluation.judged {
        if judged.outcome != BinOutcome::Open {
            continue;
        }
        let at = judged.limit.wind_m_s;
        let text = match judged.frames_to_decide {
            Some(wanted) if wanted > judged.bin.independent_frames => format!(
                "At {at} m/s a share like this one would be told from the limit by about {} independent frames, \
                 {:.1} times as many as there are.",
                whole(wanted),
                wanted / judged.bin.independent_frames.max(1.0)
            ),
            Some(_) => format!(
                "At {at} m/s there are frames enough: what keeps the interval open are the instruments, or the frames \
                 without a spot."
            ),
            None if judged.bin.frames == 0 => format!("At {at} m/s no frame is counted."),
            None => format!("At {at} m/s the share is too close to the limit to be told from it."),
        };
        let _ = writeln!(html, "<p>{}</p>", Escaped(&text));
    }
    html
}

pub(super) fn figures(page: &AccuracyPage<'_>) -> String {
    let Some(figures) = &page.evaluation.figures else {
        return "<p>No frame was counted.</p>\n".to_owned();
    };
    let mut html = String::from(
        "<div class=\"scroll\"><table><thead><tr><th>mrad</th><th class=\"n\">accuracy</th><th class=\"n\">precision</th>\
         <th class=\"n\">bias</th></tr></thead>\n\
         <tr><td></td><td class=\"n soft\">RMS about<br/>the aim point</td><td class=\"n soft\">RMS about<br/>the mean spot</td>\
         <td class=\"n soft\">mean spot from<br/>the aim point</td></tr>\n",
    );
    let three = [&figures.accuracy, &figures.precision, &figures.bias];
    let mut row = |name: &str, of: Option<&dyn Fn(&Figure) -> f64>, bold: bool| {
        let _ = write!(html, "<tr><td class=\"t\">{name}</td>");
        let Some(of) = of else {
            html.push_str("<td colspan=\"3\">not stated, counts as nothing</td></tr>\n");
            return;
        };
        for figure in three {
            let value = of(figure);
            let _ = if bold {
                write!(html, "<td class=\"n\"><b>{value:.3}</b></td>")
            } else if value.is_finite() {
                write!(html, "<td class=\"n\">{value:.3}</td>")
            } else {
                write!(html, "<td class=\"n\">unknown</td>")
            };
        }
        html.push_str("</tr>\n");
    };
    row("by formula (1)", Some(&|f| f.mrad), true);
    row(
        "one standard deviation",
        Some(&Figure::uncertainty_mrad),
        false,
    );
    row(
        "… from the number of frames",
        Some(&|f| f.sampling_mrad),
        false,
    );
    let unsure = page.setup.uncertainty;
    for (name, stated, of) in [
        (
            "distance",
            unsure.slant_m.is_some(),
            (|f| f.slant_mrad) as fn(&Figure) -> f64,
        ),
        ("pixel scale", unsure.scale.is_some(), |f| f.scale_mrad),
        ("survey of the target", unsure.survey_m.is_some(), |f| {
            f.survey_mrad
        }),
        (
            "centres of the spots",
            figures.centre_noise_mrad > 0.0,
            |f| f.camera_mrad,
        ),
    ] {
        let of: Option<&dyn Fn(&Figure) -> f64> = if stated { Some(&of) } else { None };
        row(&format!("… from the {name}"), of, false);
    }
    match figures.defined_mrad {
        Some(three) => {
            html.push_str("<tr><td class=\"t\">angle as 3.2 and 3.3 define it</td>");
            for angle in three {
                let _ = write!(html, "<td class=\"n\">{angle:.3}</td>");
            }
            html.push_str("</tr>\n");
        }
        None => html.push_str(
            "<tr><td class=\"t\">angle as 3.2 and 3.3 define it</td><td colspan=\"3\">not computed</td></tr>\n",
        ),
    }
    html.push_str("</table></div>\n");
    let _ = writeln!(
        html,
        "<p>Errors are those of formula (1), the distance of the spot from the aim point on the target over the \
         distance of the heliostat; the angles which clauses 3.2 and 3.3 define are smaller where the \
         target is not square to the line from the heliostat. Accuracy² = precision² + bias². The {} counted frames \
         tell the accuracy as {} independent ones would.</p>",
        count(page.evaluation.counts.first().map_or(0, |(_, n)| *n)),
        whole(figures.independent_frames)
    );
    html
}

pub(super) fn frames(page: &AccuracyPage<'_>) -> String {
    let found = page.evaluation;
    let all = found.frames.len().max(1) as f64;
    let mut html = String::from(
        "<table><thead><tr><th>status</th><th>meaning</th><th class=\"n\">frames</th><th class=\"n\">share</th></tr></thead>\n",
    );
    for &(status, number) in &found.counts {
        let reason = if status == FrameStatus::Ok {
            "counted".to_owned()
        } else {
            format!("left out: {}", status.reason())
        };
        let _ = writeln!(
            html,
            "<tr><td>{}</td><td>{}</td><td class=\"n\">{}</td><td class=\"n\">{}</td></tr>",
            status.as_str(),
            Escaped(&reason),
            count(number),
            percent(number as f64 / all, 2)
        );
    }
    html.push_str("</table>\n");
    if let Some([from, to]) = found.counted_ns {
        let step = found.step_s.map_or_else(String::new, |step| {
            format!("; {:.3} s from frame to frame in the median", step)
        });
        let _ = writeln!(
            html,
            "<p>Counted from {} to {} UTC{step}.</p>",
            minute(from),
            minute(to)
        );
    }
    html
}

pub(super) fn clauses(page: &AccuracyPage<'_>) -> String {
    let mut html = String::from(
        "<div class=\"scroll\"><table><thead><tr><th>clause</th><th></th><th>found</th></tr></thead>\n",
    );
    for clause in &page.evaluation.clauses {
        let class = match clause.outcome {
            ClauseOutcome::Met => "good",
            ClauseOutcome::NotStated => "soft",
            ClauseOutcome::Deviates => "warn",
        };
        let _ = writeln!(
            html,
            "<tr><td>{} {}</td><td><b class=\"badge {class}\">{}</b></td><td class=\"found\">{}</td></tr>",
            clause.number,
            clause.title,
            clause.outcome.as_str(),
            Escaped(&sentence(&clause.words.join("; ")))
        );
    }
    html.push_str("</table></div>\n");
    html
}

pub(super) fn instruments(page: &AccuracyPage<'_>) -> String {
    let mut html = String::new();
    if page.instruments.is_empty() {
        html.push_str("<p>No instrument is named.</p>\n");
    } else {
        html.push_str(
            "<div class=\"scroll\"><table><thead><tr><th></th><th>name</th><th>maker</th><th>serial number</th>\
             <th>calibrated</th></tr></thead>\n",
        );
        for [role, rest @ ..] in &page.instruments {
            let _ = write!(html, "<tr><td>{}</td>", Escaped(role));
            for text in rest {
                let text = if text.is_empty() { "–" } else { text };
                let _ = write!(html, "<td>{}</td>", Escaped(text));
            }
            html.push_str("</tr>\n");
        }
        html.push_str("</table></div>\n");
    }
    let unsure = page.setup.uncertainty;
    html.push_str(
        "<table class=\"facts\"><thead><tr><th>One standard deviation of</th><th></th></tr></thead>\n",
    );
    let stated = |value: Option<f64>, factor: f64, unit: &str| match value {
        // rounded to what a double can tell after a change of unit
        Some(v) => format!("{} {unit}", (v * factor * 1e9).round() / 1e9),
        None => "not stated, counts as nothing".to_owned(),
    };
    for (name, text) in [
        ("distance", stated(unsure.slant_m, 1.0, "m")),
        ("pixel scale", stated(unsure.scale, 100.0, "%")),
        (
            "survey of the target",
            stated(unsure.survey_m, 1e3, "mm per component"),
        ),
        (
            "centre of a spot",
            match &page.evaluation.figures {
                Some(figures) if figures.centre_noise_mrad > 0.0 => format!(
                    "{} mrad in the mean, by the frames' own statements",
                    mrad(figures.centre_noise_mrad)
                ),
                _ => stated(unsure.centre_m, 1e3, "mm per component"),
            },
        ),
    ] {
        let _ = writeln!(html, "<tr><th>{name}</th><td>{}</td></tr>", Escaped(&text));
    }
    html.push_str("</table>\n");
    html
}

pub(super) fn limits(page: &AccuracyPage<'_>) -> String {
    let (limits, options) = (page.limits, page.options);
    let shares: Vec<String> = limits
        .shares
        .iter()
        .map(|limit| format!("{} at {} m/s", percent(limit.share, 0), limit.wind_m_s))
        .collect();
    let accepted: Vec<&str> = options.accepted.iter().map(|s| s.as_str()).collect();
    let rows = [
        ("guideline", limits.name.clone()),
        ("angle", format!("{} mrad", limits.angle_mrad)),
        ("share of frames within it, more than", shares.join(", ")),
        (
            "irradiance, more than",
            format!("{} W/m²", limits.least_dni_w_m2),
        ),
        (
            "air",
            format!(
                "{} to {} °C",
                limits.air_temperature_c[0], limits.air_temperature_c[1]
            ),
        ),
        (
            "wind to cover",
            format!("{} to {} m/s", limits.wind_m_s[0], limits.wind_m_s[1]),
        ),
        (
            "frames of a wind speed",
            format!("within ± {} m/s of it", options.bin_half_width_m_s),
        ),
        (
            "weather of a frame",
            format!(
                "on a straight line between neighbouring rows at most {} s apart",
                options.weather_gap_s
            ),
        ),
        ("spots that count", format!("of status {}", accepted.join(", "))),
        (
            "interval",
            format!(
                "Clopper and Pearson at {}, for the number of independent frames by autocorrelation; widened by the \
                 instruments in squares, and by frames without a spot, which may have been within or not",
                percent(options.confidence, 0)
            ),
        ),
        (
            "verdict",
            "qualified: all intervals above their limits; not qualified: one below; else not enough data".to_owned(),
        ),
    ];
    let rows = rows.map(|(name, text)| (name.to_owned(), text));
    crate::calibration::page::facts(&rows)
}

pub(super) fn files(page: &AccuracyPage<'_>) -> String {
    let mut html = String::from("<table><thead><tr><th>file</th><th>SHA-256</th></tr></thead>\n");
    for (name, hash) in &page.files {
        let _ = writeln!(
            html,
            "<tr><td>{}</td><td class=\"hash\">{}</td></tr>",
            Escaped(name),
            Escaped(hash)
        );
    }
    html.push_str("</table>\n");
    html
}
