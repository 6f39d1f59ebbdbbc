//! Parameters with their error bars, one strip each, one row an epoch; and their table.

use std::fmt::Write;

use super::plot::{Axis, Canvas, Place, WIDTH, range};
use super::{HeliostatSection, ParameterRow, ParameterUnit, Verdict};
use crate::svg::{Escaped, Short};

/// More epochs than this are not drawn.
const MOST_EPOCHS: usize = 16;
const LEFT: [f64; 2] = [62.0, 532.0];
const STRIP: f64 = 390.0;
const ROW: f64 = 15.0;

impl ParameterUnit {
    fn sign(self) -> &'static str {
        match self {
            Self::Degrees => "°",
            Self::Metres => " m",
        }
    }

    fn name(self) -> &'static str {
        match self {
            Self::Degrees => "°",
            Self::Metres => "m",
        }
    }
}

impl ParameterRow {
    /// Everything of it that is to be seen.
    fn bounds(&self) -> [f64; 2] {
        match self.interval95 {
            Some([low, high]) if low.is_finite() && high.is_finite() => [low, high],
            _ => [self.value; 2],
        }
    }

    /// Decimals that show the standard error with two figures.
    fn decimals(&self) -> usize {
        let error = self.standard_error.filter(|e| e.is_finite() && *e > 0.0);
        error.map_or(4, |e| (1.0 - e.log10().floor()).clamp(0.0, 9.0) as usize)
    }

    fn number(&self, value: f64) -> String {
        if !value.is_finite() {
            return "–".to_owned();
        }
        let (decimals, sign) = (self.decimals(), self.unit.sign());
        format!("{value:.decimals$}{sign}").replace('-', "\u{2212}")
    }
}

/// The figure of all parameters, or nothing where nothing was fitted.
pub(super) fn figure(section: &HeliostatSection) -> Option<String> {
    let epochs = &section.epochs[..section.epochs.len().min(MOST_EPOCHS)];
    // One that was held throughout has no error bar to show; the table names it.
    let fitted: Vec<usize> = (0..epochs.first()?.parameters.len())
        .filter(|&i| {
            let mut rows = epochs.iter().filter_map(|e| e.parameters.get(i));
            rows.any(|row| !row.held)
        })
        .collect();
    if fitted.is_empty() {
        return None;
    }
    let height = ROW * epochs.len() as f64 + 8.0;
    let each = height + 66.0;
    let mut canvas = Canvas::new(each * fitted.len().div_ceil(2) as f64 + 4.0);
    for (number, i) in fitted.into_iter().enumerate() {
        let rows: Vec<Option<Row<'_>>> = epochs
            .iter()
            .map(|e| Some((e.parameters.get(i)?, e.verdict == Verdict::Determined)))
            .collect();
        let place = Place {
            left: LEFT[number % 2],
            top: 24.0 + each * (number / 2) as f64,
            width: STRIP,
            height,
        };
        strip(&mut canvas, place, &rows);
    }
    let mut caption = "Parameters with their 95 % intervals".to_owned();
    if epochs.len() > 1 {
        let _ = write!(caption, ", one row for each {}", section.part());
    }
    caption.push_str(". Each strip has its own scale.");
    let any = |of: fn(&ParameterRow) -> bool| {
        let mut rows = epochs.iter().flat_map(|e| &e.parameters);
        rows.any(of)
    };
    if epochs.len() > 1 && epochs.iter().any(|e| e.verdict != Verdict::Determined) {
        caption.push_str(" Orange: undetermined; a triangle points to a value outside.");
    }
    if any(|row| row.held) {
        caption.push_str(" Held parameters are left out, or open where another row fitted them.");
    }
    if any(|row| row.before.is_some()) {
        caption.push_str(" Short upright line: before the fit, where it is in the picture.");
    }
    if epochs.len() < section.epochs.len() {
        let _ = write!(
            caption,
            " The first {} of {} {}s.",
            epochs.len(),
            section.epochs.len(),
            section.part()
        );
    }
    let title = format!("Heliostat {}: parameters", section.id);
    let description = "The table below has the same numbers.";
    Some(super::page::figure(
        &canvas.element(&title, description),
        &caption,
    ))
}

/// A parameter, and whether its epoch is determined.
type Row<'a> = (&'a ParameterRow, bool);

fn strip(canvas: &mut Canvas, place: Place, rows: &[Option<Row<'_>>]) {
    let Some((first, _)) = rows.iter().copied().flatten().next() else {
        return;
    };
    let name = format!("{}, {}", first.name, first.unit.name());
    canvas.text(place.left, place.top - 7.0, "name", &name);
    // An epoch that says nothing about a parameter must not squeeze those that do.
    let bounds = |all: bool| {
        let some = rows.iter().flatten().filter(move |row| all || row.1);
        range(some.flat_map(|row| row.0.bounds()), 0.25, 1e-6)
    };
    let Some((mut min, mut max)) = bounds(false).or_else(|| bounds(true)) else {
        canvas.nothing(place, "no finite numbers");
        return;
    };
    // Zero, and the value before, are shown where they do not squeeze the rest.
    let width = max - min;
    let before = rows.iter().flatten().filter_map(|row| row.0.before);
    for extra in before.chain([0.0]).filter(|v| v.is_finite()) {
        let (low, high) = (min.min(extra - 0.05 * width), max.max(extra + 0.05 * width));
        if high - low <= 3.0 * width {
            (min, max) = (low, high);
        }
    }
    let across = Axis::new((min, max), (place.left, place.left + place.width), "", 5);
    let bottom = place.top + place.height;
    for (at, text) in &across.marks {
        let x = across.pixel(*at);
        canvas.line((x, place.top), (x, bottom), "grid");
        canvas.text(x, bottom + 15.0, "m", text);
    }
    if across.contains(0.0) {
        let x = across.pixel(0.0);
        canvas.line((x, place.top), (x, bottom), "axis");
    }
    canvas.rect(
        place.left,
        place.top,
        (place.width, place.height),
        format_args!("class=\"frame\""),
    );
    for (i, row) in rows.iter().enumerate() {
        let y = place.top + 4.0 + ROW * (i as f64 + 0.5);
        if rows.len() > 1 {
            canvas.text(place.left - 6.0, y + 4.0, "e soft", &(i + 1).to_string());
        }
        let Some((row, determined)) = row.filter(|row| row.0.value.is_finite()) else {
            continue;
        };
        if let Some(before) = row.before.filter(|b| across.contains(*b)) {
            let x = across.pixel(before);
            canvas.line((x, y - 6.0), (x, y + 6.0), "was");
        }
        let number = usize::from(!determined);
        let interval = row.interval95.filter(|e| e.iter().all(|e| e.is_finite()));
        if let Some([low, high]) =
            interval.filter(|[low, high]| *low <= across.max && *high >= across.min)
        {
            let mut path = String::new();
            // An end that lies outside gets no cap.
            for end in [low, high] {
                if across.contains(end) {
                    let _ = write!(path, "M{} {}v8", Short(across.pixel(end)), Short(y - 4.0));
                }
            }
            let (a, b) = (across.pixel_inside(low), across.pixel_inside(high));
            let (a, b, y) = (Short(a), Short(b), Short(y));
            canvas.raw(format_args!(
                "<path d=\"{path}M{a} {y}H{b}\" class=\"bar s{number}\"/>"
            ));
        }
        let (x, y) = (Short(across.pixel_inside(row.value)), Short(y));
        if !across.contains(row.value) {
            let toward = if row.value < across.min { 7 } else { -7 };
            canvas.raw(format_args!(
                "<path d=\"M{x} {y}l{toward} -4v8z\" class=\"mark f{number}\"/>"
            ));
            continue;
        }
        let class = if row.held {
            format!("open s{number}")
        } else {
            format!("f{number}")
        };
        canvas.raw(format_args!(
            "<circle cx=\"{x}\" cy=\"{y}\" r=\"3.5\" class=\"{class}\"/>"
        ));
    }
}

/// The table of one epoch's parameters.
pub(super) fn table(rows: &[ParameterRow]) -> String {
    let mut html = String::new();
    if rows.is_empty() {
        return html;
    }
    html.push_str(
        "<table><thead><tr><th>parameter</th><th class=\"n\">value</th><th class=\"n\">95 % interval</th>\
         <th class=\"n\">standard error</th><th class=\"n\">before</th><th class=\"n\">change</th></tr></thead>\n",
    );
    for row in rows {
        let interval = match row.interval95 {
            Some([low, high]) if low.is_finite() && high.is_finite() => {
                format!("{} … {}", row.number(low), row.number(high))
            }
            _ if row.held => "held".to_owned(),
            _ => "–".to_owned(),
        };
        let error = match (row.standard_error.filter(|e| e.is_finite()), row.unit) {
            // A direction may be known to degrees only.
            (Some(e), ParameterUnit::Degrees) if e < 1.0 => {
                format!("{} mrad", super::plot::mrad(e.to_radians() * 1e3))
            }
            (Some(e), _) => row.number(e),
            (None, _) => "–".to_owned(),
        };
        let before = row.before.map_or_else(|| "–".to_owned(), |b| row.number(b));
        let change = row
            .before
            .map_or_else(|| "–".to_owned(), |b| row.number(row.value - b));
        let _ = writeln!(
            html,
            "<tr><th>{}</th><td class=\"n\">{}</td><td class=\"n\">{interval}</td><td class=\"n\">{error}</td>\
             <td class=\"n\">{before}</td><td class=\"n\">{change}</td></tr>",
            Escaped(&row.name),
            row.number(row.value)
        );
    }
    html.push_str("</table>\n");
    html
}

const _: () = assert!(LEFT[1] + STRIP < WIDTH);
