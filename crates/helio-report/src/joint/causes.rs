//! What a field has in common: causes with their error bars and what each is worth.

use std::fmt::Write;

use super::{CauseLine, rounded};
use crate::calibration::page::figure as framed;
use crate::calibration::plot::{Axis, Canvas, WIDTH, count, mrad};
use crate::svg::Escaped;

/// More causes than this are only counted.
const MOST: usize = 60;
/// More than this are not drawn.
const MOST_DRAWN: usize = 30;
const MOST_LETTERS: usize = 46;
const NAMES: f64 = 290.0;
const VALUES: f64 = 424.0;
const LEFT: f64 = 446.0;
const BARS: f64 = 400.0;
const ROW: f64 = 24.0;
const TOP: f64 = 26.0;

/// A number of a cause that was admitted, else NaN.
fn admitted(cause: &CauseLine, number: Option<f64>) -> f64 {
    let number = number.filter(|x| cause.admitted && x.is_finite());
    number.unwrap_or(f64::NAN)
}

fn worth(cause: &CauseLine) -> f64 {
    admitted(cause, cause.worth_mrad)
}

/// Those admitted first, by what they are worth.
fn sorted(causes: &[CauseLine]) -> Vec<&CauseLine> {
    let mut all: Vec<&CauseLine> = causes.iter().collect();
    let key = |c: &CauseLine| if worth(c).is_nan() { -1.0 } else { worth(c) };
    all.sort_by(|a, b| {
        let admitted = b.admitted.cmp(&a.admitted);
        admitted.then(key(b).total_cmp(&key(a)))
    });
    all
}

/// A value with its standard deviation.
fn value(cause: &CauseLine) -> String {
    if !cause.value.is_finite() {
        return "–".to_owned();
    }
    let number = rounded(cause.value, cause.sigma);
    if cause.sigma.is_finite() {
        format!(
            "{number} ± {} {}",
            rounded(cause.sigma, cause.sigma),
            cause.unit
        )
    } else {
        format!("{number} {}", cause.unit)
    }
}

/// Bars of what the admitted causes are worth, or nothing where none was admitted or nobody knows.
pub(super) fn figure(causes: &[CauseLine]) -> Option<String> {
    let mut rows = sorted(causes);
    rows.retain(|c| !worth(c).is_nan());
    let all = rows.len();
    rows.truncate(MOST_DRAWN);
    let error = |c: &CauseLine| (worth(c) * c.sigma / c.value).abs();
    let end = |c: &CauseLine| {
        let error = error(c);
        worth(c) + if error.is_finite() { error } else { 0.0 }
    };
    let most = rows.iter().map(|c| end(c)).fold(f64::NAN, f64::max);
    // A cause found to be nothing still gets an axis.
    let most = if most > 0.0 { 1.02 * most } else { 0.1 };
    if rows.is_empty() || !most.is_finite() {
        return None;
    }
    let bottom = TOP + ROW * rows.len() as f64;
    let mut canvas = Canvas::new(bottom + 40.0);
    canvas.text(VALUES, TOP - 10.0, "e soft", "value");
    canvas.text(LEFT, TOP - 10.0, "soft", "worth, mrad of the beam");
    let across = Axis::new((0.0, most), (LEFT, LEFT + BARS), "", 8);
    for (at, text) in &across.marks {
        let x = across.pixel(*at);
        canvas.line((x, TOP), (x, bottom), "grid");
        canvas.text(x, bottom + 16.0, "m", text);
    }
    for (number, cause) in rows.iter().enumerate() {
        let y = TOP + ROW * (number as f64 + 0.5);
        let name = crate::calibration::correlation::shortened(&cause.name, MOST_LETTERS);
        canvas.text(NAMES, y + 4.0, "e", &name);
        canvas.text(VALUES, y + 4.0, "e soft", &value(cause));
        let to = across.pixel(worth(cause));
        canvas.rect(
            LEFT,
            y - 7.0,
            (to - LEFT, 14.0),
            format_args!("class=\"f0\" fill-opacity=\"0.75\""),
        );
        let error = error(cause);
        let mut free = to;
        if error.is_finite() {
            let ends = [worth(cause) - error, worth(cause) + error].map(|w| across.pixel_inside(w));
            canvas.line((ends[0], y), (ends[1], y), "bar");
            for end in ends {
                canvas.line((end, y - 4.0), (end, y + 4.0), "bar");
            }
            free = ends[1];
        }
        canvas.text(free + 10.0, y + 4.0, "", &mrad(worth(cause)));
    }
    canvas.line((LEFT, TOP), (LEFT, bottom), "axis");
    let mut caption = "By how much farther a fit that does not know of a cause would miss, root mean square over the records. \
                       Error bars: one standard deviation."
        .to_owned();
    if all > rows.len() {
        let _ = write!(caption, " The largest {} of {}.", rows.len(), count(all));
    }
    let description = rows.first().map_or_else(String::new, |c| {
        format!("The largest is {}: {} mrad.", c.name, mrad(worth(c)))
    });
    Some(framed(
        &canvas.element("Worth of the common causes", &description),
        &caption,
    ))
}

/// Heading and cells of a column of the table.
type Column<'a> = (&'static str, &'a dyn Fn(&CauseLine) -> String);

/// All causes in numbers.
pub(super) fn table(causes: &[CauseLine]) -> String {
    if causes.is_empty() {
        return "<p>No causes were looked for.</p>\n".to_owned();
    }
    let shown: Vec<&CauseLine> = sorted(causes).into_iter().take(MOST).collect();
    let dash = || "–".to_owned();
    let evidence = |c: &CauseLine| match c.log_evidence {
        nats if nats.is_finite() => format!("{nats:.1}").replace('-', "\u{2212}"),
        _ => dash(),
    };
    let spread = |c: &CauseLine| match admitted(c, c.spread) {
        spread if spread.is_finite() => format!("{} {}", rounded(spread, 0.3 * spread), c.unit),
        _ => dash(),
    };
    let columns: [Column<'_>; 4] = [
        ("differ by", &spread),
        ("evidence", &evidence),
        ("turn, mrad", &|c| mrad(admitted(c, c.turn_mrad))),
        ("worth, mrad", &|c| mrad(worth(c))),
    ];
    // Where nobody knows, as of the evidence in a followed field, there is no column.
    let columns: Vec<(&str, Vec<String>)> = columns
        .into_iter()
        .map(|(name, of)| (name, shown.iter().map(|c| of(c)).collect::<Vec<_>>()))
        .filter(|(_, cells)| cells.iter().any(|cell| *cell != dash()))
        .collect();
    let mut html = String::from(
        "<div class=\"scroll\"><table><thead><tr><th>cause</th><th>scope</th><th class=\"n\">value</th>",
    );
    for (name, _) in &columns {
        // Writing to a string cannot fail.
        let _ = write!(html, "<th class=\"n\">{name}</th>");
    }
    html.push_str("</tr></thead>\n");
    for (number, cause) in shown.iter().enumerate() {
        let found = if cause.admitted {
            format!("<td class=\"n\">{}</td>", Escaped(&value(cause)))
        } else {
            "<td class=\"n\"><b class=\"badge soft\">not admitted</b></td>".to_owned()
        };
        let _ = write!(
            html,
            "<tr><td>{}</td><td>{}</td>{found}",
            Escaped(&cause.name),
            Escaped(&cause.scope),
        );
        for (_, cells) in &columns {
            let _ = write!(html, "<td class=\"n\">{}</td>", Escaped(&cells[number]));
        }
        html.push_str("</tr>\n");
    }
    html.push_str("</table></div>\n");
    if causes.len() > MOST {
        let _ = writeln!(
            html,
            "<p>{} more are not listed.</p>",
            count(causes.len() - MOST)
        );
    }
    html
}

const _: () = assert!(LEFT + BARS + 70.0 < WIDTH);
