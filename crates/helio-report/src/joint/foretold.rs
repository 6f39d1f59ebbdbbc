//! Whether the stated uncertainty holds: misses expected and seen, and how often they lie inside their
//! ellipses.

use std::fmt::Write;

use super::{HeliostatLine, JointPage, RecordLine, SETTLED, evenly, rms, rounded};
use crate::calibration::dates;
use crate::calibration::page::figure as framed;
use crate::calibration::plot::{Axis, Canvas, Place, WIDTH, count, mrad};
use crate::svg::{Escaped, Short};

/// The stated probabilities that are looked at.
const STATED: [f64; 6] = [0.5, 0.68, 0.8, 0.9, 0.95, 0.99];
/// Records drawn one by one at most.
const MOST_DOTS: usize = 2500;
/// Records that make a mean worth drawing.
const LEAST: usize = 5;
/// Outliers that are listed at most.
const MOST_LISTED: usize = 100;
const PIT_BINS: usize = 20;
const LEFT: [f64; 2] = [66.0, 540.0];
const PANEL: (f64, f64) = (384.0, 320.0);
const TOP: f64 = 30.0;
/// Ends of 95 % intervals, in standard errors.
const TWO_SIGMA: f64 = 1.96;

fn place(column: usize) -> Place {
    Place {
        left: LEFT[column],
        top: TOP,
        width: PANEL.0,
        height: PANEL.1,
    }
}

/// A record that was foretold, and how many its heliostat had before it.
#[derive(Clone, Copy)]
pub(super) struct Held<'a> {
    before: usize,
    pub(super) record: &'a RecordLine,
}

/// All records that were foretold.
pub(super) fn held(page: &JointPage) -> Vec<Held<'_>> {
    let lines = page.heliostats.iter();
    let all = lines.flat_map(|line| (line.before()..).zip(&line.records));
    all.filter(|(_, record)| record.is_foretold())
        .map(|(before, record)| Held { before, record })
        .collect()
}

/// Share of records inside the ellipse of a stated probability; NaN of none.
pub(super) fn share<'a>(records: impl IntoIterator<Item = &'a RecordLine>, stated: f64) -> f64 {
    let (mut inside, mut all) = (0.0, 0.0);
    for record in records {
        all += 1.0;
        inside += f64::from(u8::from(record.inside() <= stated));
    }
    inside / all
}

/// A logarithmic axis; `range` in logarithms to base ten.
fn logarithmic(range: (f64, f64), ends: (f64, f64), name: &str) -> Axis {
    let mut axis = Axis::new(range, ends, name, 2);
    let powers = range.0.floor() as i32..=range.1.ceil() as i32;
    let factors: &[f64] = match range.1 - range.0 {
        span if span > 2.5 => &[1.0],
        span if span > 0.8 => &[1.0, 2.0, 5.0],
        _ => &[1.0, 1.5, 2.0, 3.0, 5.0, 7.0],
    };
    axis.marks = powers
        .flat_map(|power| {
            factors.iter().map(move |factor| {
                let half = i32::from(factor.fract() != 0.0);
                let decimals = (half - power).clamp(0, 9) as usize;
                let text = format!("{:.decimals$}", factor * 10_f64.powi(power));
                (factor.log10() + f64::from(power), text)
            })
        })
        .filter(|(at, _)| axis.contains(*at))
        .collect();
    axis
}

/// Root mean square with its standard error.
fn rms_with_error(values: &[f64]) -> (f64, f64) {
    let n = values.len() as f64;
    let root = rms(values.iter().copied());
    let variance = values
        .iter()
        .map(|v| (v * v - root * root).powi(2))
        .sum::<f64>()
        / (n - 1.0);
    (root, 0.5 * (variance / n).sqrt() / root)
}

/// Expected and seen misses of some records together.
struct Group {
    expected: f64,
    seen: f64,
    error: f64,
    records: usize,
}

impl Group {
    fn of(records: &[Held<'_>]) -> Self {
        let seen: Vec<f64> = records.iter().map(|h| h.record.beam_mrad()).collect();
        let (seen, error) = rms_with_error(&seen);
        Self {
            expected: rms(records.iter().map(|h| h.record.expected_mrad())),
            seen,
            error,
            records: records.len(),
        }
    }
}

/// Expected against seen misses, and both by how many records there were before; nothing where nothing was
/// foretold.
pub(super) fn achieved(all: &[Held<'_>]) -> Option<String> {
    let plain: Vec<Held<'_>> = all
        .iter()
        .copied()
        .filter(|h| h.record.is_plain())
        .collect();
    if plain.is_empty() {
        return None;
    }
    let mut canvas = Canvas::new(TOP + PANEL.1 + 44.0);
    let settled: Vec<Held<'_>> = plain
        .iter()
        .copied()
        .filter(|h| h.before >= SETTLED)
        .collect();
    let settled = if settled.len() < LEAST {
        &plain
    } else {
        &settled
    };
    against(&mut canvas, place(0), settled);
    by_records(&mut canvas, place(1), &plain);
    let mut caption = String::from(
        "Left: misses one record ahead against those expected, logarithmic; dots are records, circles the root mean square of \
         those with about the same expectation, with 95 % bars. On the line the stated uncertainty is right, above it misses \
         are larger than stated.",
    );
    if settled.len() < plain.len() {
        let _ = write!(
            caption,
            " Heliostats' first {SETTLED} records are in the right panel alone."
        );
    }
    caption.push_str(
        " Right: the same by how many records the heliostat had before; the first is foretold from the field alone. Outliers \
         and records just after a jump are left out.",
    );
    let total = Group::of(settled);
    let description = format!(
        "Expected {} mrad, seen {} mrad, root mean square over {} records.",
        mrad(total.expected),
        mrad(total.seen),
        total.records
    );
    Some(framed(
        &canvas.element("Expected and seen misses", &description),
        &caption,
    ))
}

fn against(canvas: &mut Canvas, place: Place, plain: &[Held<'_>]) {
    canvas.text(place.left, TOP - 10.0, "name", "Expected and seen");
    let mut sorted = plain.to_vec();
    sorted.retain(|h| h.record.expected_mrad() > 0.0);
    sorted.sort_by(|a, b| {
        a.record
            .expected_mrad()
            .total_cmp(&b.record.expected_mrad())
    });
    let (Some(first), Some(last)) = (sorted.first(), sorted.last()) else {
        canvas.nothing(place, "nothing was expected");
        return;
    };
    let low = first.record.expected_mrad().log10();
    let high = last.record.expected_mrad().log10();
    let seen = sorted
        .iter()
        .map(|h| h.record.beam_mrad().max(1e-12).log10());
    let mut misses: Vec<f64> = seen.collect();
    misses.sort_by(f64::total_cmp);
    // One in a hundred may lie at the lower edge, none beyond the upper.
    let floor = misses[misses.len() / 100].clamp(low - 1.3, low);
    let ceiling = misses[misses.len() - 1].clamp(high, high + 1.5);
    let (middle, half) = (0.5 * (low + high), (0.5 * (high - low) + 0.06).max(0.15));
    let across = logarithmic(
        (middle - half, middle + half),
        (place.left, place.left + place.width),
        "expected miss, mrad",
    );
    let up = logarithmic(
        (floor - 0.06, ceiling + 0.1),
        (place.top + place.height, place.top),
        "seen miss, mrad",
    );
    canvas.frame(place, &across, &up);
    let dots: Vec<(f64, f64)> = evenly(sorted.len(), MOST_DOTS)
        .map(|k| sorted[k].record)
        .map(|r| {
            (
                across.pixel(r.expected_mrad().log10()),
                up.pixel_inside(r.beam_mrad().max(1e-12).log10()),
            )
        })
        .collect();
    let diameter = if dots.len() > 400 { 2.2 } else { 3.2 };
    canvas.dots(diameter, &dots, "class=\"dots none\"");
    canvas.clipped(place, |canvas| {
        let ends = [across.min, across.max].map(|at| (across.pixel(at), up.pixel(at)));
        canvas.line(ends[0], ends[1], "was");
    });
    // Steps of equal ratio; those with too few records go with the next, the last ones with those before.
    let bins = (((across.max - across.min) / 0.09).ceil() as usize).clamp(4, 14);
    let each = (high - low).max(1e-9) / bins as f64;
    let mut bounds = vec![0];
    for bin in 1..bins {
        let end = low + each * bin as f64;
        let to = sorted.partition_point(|h| h.record.expected_mrad().log10() < end);
        if bounds.last().is_some_and(|from| to >= from + LEAST) {
            bounds.push(to);
        }
    }
    if bounds.len() > 1
        && bounds
            .last()
            .is_some_and(|from| sorted.len() < from + LEAST)
    {
        bounds.pop();
    }
    bounds.push(sorted.len());
    for pair in bounds.windows(2) {
        let group = Group::of(&sorted[pair[0]..pair[1]]);
        let x = across.pixel(group.expected.log10());
        point(canvas, &up, x, &group, "s0");
    }
}

/// A root mean square with its bar, where there are records enough for one.
fn point(canvas: &mut Canvas, up: &Axis, x: f64, group: &Group, class: &str) {
    if group.seen <= 0.0 {
        return;
    }
    let y = Short(up.pixel_inside(group.seen.log10()));
    if group.records >= LEAST && group.error.is_finite() {
        let low = (group.seen - TWO_SIGMA * group.error).max(1e-12).log10();
        let high = (group.seen + TWO_SIGMA * group.error).log10();
        let ends = [low, high].map(|v| up.pixel_inside(v));
        canvas.line((x, ends[0]), (x, ends[1]), &format!("bar {class}"));
    }
    canvas.raw(format_args!(
        "<circle cx=\"{}\" cy=\"{y}\" r=\"4\" class=\"open {class}\" stroke-width=\"1.8\"><title>{} records: expected {} \
         mrad, seen {} mrad</title></circle>",
        Short(x),
        group.records,
        mrad(group.expected),
        mrad(group.seen)
    ));
}

fn by_records(canvas: &mut Canvas, place: Place, plain: &[Held<'_>]) {
    let steps = [0, 1, 2, 3, 6, 12, 24, 48, 96, usize::MAX];
    let groups: Vec<(String, Group)> = steps
        .windows(2)
        .filter_map(|pair| {
            let some: Vec<Held<'_>> = plain
                .iter()
                .copied()
                .filter(|h| (pair[0]..pair[1]).contains(&h.before))
                .collect();
            let name = match pair {
                [from, usize::MAX] => format!("{from}+"),
                [from, to] if from + 1 == *to => from.to_string(),
                [from, to] => format!("{from}–{}", to - 1),
                _ => String::new(),
            };
            (!some.is_empty()).then(|| (name, Group::of(&some)))
        })
        .collect();
    canvas.text(place.left, TOP - 10.0, "name", "By records before");
    let legend = place.left + place.width - 150.0;
    canvas.line((legend, TOP - 14.0), (legend + 20.0, TOP - 14.0), "was");
    canvas.text(legend + 26.0, TOP - 10.0, "", "expected");
    let dot = legend + 100.0;
    canvas.raw(format_args!(
        "<circle cx=\"{}\" cy=\"{}\" r=\"4\" class=\"open s0\" stroke-width=\"1.8\"/>",
        Short(dot),
        Short(TOP - 14.0)
    ));
    canvas.text(dot + 10.0, TOP - 10.0, "", "seen");
    let values = || {
        groups
            .iter()
            .flat_map(|(_, g)| [g.expected, g.seen])
            .filter(|v| *v > 0.0)
    };
    let low = values().fold(f64::INFINITY, f64::min).log10();
    let high = values().fold(0.0, f64::max).log10();
    if !(low.is_finite() && high.is_finite()) {
        canvas.nothing(place, "nothing was missed or expected");
        return;
    }
    let mut across = Axis::new(
        (0.0, groups.len() as f64),
        (place.left, place.left + place.width),
        "records of the heliostat before",
        1,
    );
    across.marks.clear();
    let up = logarithmic(
        (low - 0.15, high + 0.2),
        (place.top + place.height, place.top),
        "root mean square miss, mrad",
    );
    canvas.frame(place, &across, &up);
    for (number, (name, group)) in groups.iter().enumerate() {
        let [left, x, right] = [0.15, 0.5, 0.85].map(|part| across.pixel(number as f64 + part));
        canvas.text(x, place.top + place.height + 15.0, "m", name);
        if group.expected > 0.0 {
            let y = up.pixel(group.expected.log10());
            canvas.line((left, y), (right, y), "was");
        }
        point(canvas, &up, x, group, "s0");
    }
}

/// The reliability diagram and the histogram of the places in the distribution; nothing where nothing was
/// foretold.
pub(super) fn reliability(all: &[Held<'_>]) -> Option<String> {
    let mut plain: Vec<f64> = all
        .iter()
        .filter(|h| h.record.is_plain())
        .map(|h| h.record.inside())
        .collect();
    if plain.is_empty() {
        return None;
    }
    plain.sort_by(f64::total_cmp);
    let mut every: Vec<f64> = all.iter().map(|h| h.record.inside()).collect();
    every.sort_by(f64::total_cmp);
    let mut canvas = Canvas::new(TOP + PANEL.1 + 44.0);
    diagram(&mut canvas, place(0), &plain, &every);
    pit(&mut canvas, place(1), &plain);
    let caption = "Left: share of misses inside the ellipse of the stated probability, with binomial 95 % bars; on the line the \
                   statement is right, below it too bold. Right: where in its stated distribution each miss lies; all columns \
                   alike mean that the distribution is right, higher at the right that misses are larger than stated, at the \
                   left smaller. The band holds 95 % of columns of a right distribution. The common causes, the scatter and \
                   the field's distribution come from all records, so this is a test of the fit, not of unseen records.";
    let inside = plain.partition_point(|p| *p <= 0.95) as f64 / plain.len() as f64;
    let description = format!(
        "{:.1} % of misses lie inside the ellipse of 95 %.",
        100.0 * inside
    );
    Some(framed(
        &canvas.element("Reliability of the stated uncertainty", &description),
        caption,
    ))
}

fn diagram(canvas: &mut Canvas, place: Place, plain: &[f64], every: &[f64]) {
    let percent = |values: &[f64], stated: f64| {
        100.0 * values.partition_point(|p| *p <= stated) as f64 / values.len() as f64
    };
    let axis = |ends, name| Axis::new((0.0, 100.0), ends, name, 10);
    let across = axis((place.left, place.left + place.width), "stated, %");
    let up = axis((place.top + place.height, place.top), "inside, %");
    canvas.text(place.left, TOP - 10.0, "name", "Inside the stated ellipse");
    canvas.frame(place, &across, &up);
    let corner = |at: f64| (across.pixel(at), up.pixel(at));
    canvas.line(corner(0.0), corner(100.0), "was");
    let curves = [(every, "s1"), (plain, "s0")];
    for (values, class) in &curves {
        let mut path = String::new();
        for step in 0..=100 {
            let letter = if step == 0 { 'M' } else { 'L' };
            let stated = f64::from(step);
            let y = up.pixel(percent(values, stated / 100.0));
            // Writing to a string cannot fail.
            let _ = write!(path, "{letter}{} {}", Short(across.pixel(stated)), Short(y));
        }
        canvas.raw(format_args!(
            "<path d=\"{path}\" class=\"{class}\" stroke-opacity=\"0.6\"/>"
        ));
    }
    for stated in STATED {
        let share = percent(plain, stated);
        let error = 100.0 * TWO_SIGMA * (stated * (1.0 - stated) / plain.len() as f64).sqrt();
        let x = across.pixel(100.0 * stated);
        let ends = [share - error, share + error].map(|v| up.pixel_inside(v));
        canvas.line((x, ends[0]), (x, ends[1]), "bar s0");
        for end in ends {
            canvas.line((x - 3.0, end), (x + 3.0, end), "bar s0");
        }
        canvas.raw(format_args!(
            "<circle cx=\"{}\" cy=\"{}\" r=\"3.5\" class=\"f0\"/>",
            Short(x),
            Short(up.pixel(share))
        ));
    }
    let x = place.left + 0.46 * place.width;
    let names = ["plain records", "with outliers and jumps"];
    for (row, ((_, class), name)) in curves.iter().rev().zip(names).enumerate() {
        let y = place.top + place.height - 42.0 + 20.0 * row as f64;
        canvas.line((x, y - 4.0), (x + 22.0, y - 4.0), &format!("bar {class}"));
        canvas.text(x + 30.0, y, "", name);
    }
}

fn pit(canvas: &mut Canvas, place: Place, plain: &[f64]) {
    let mut bins = [0_usize; PIT_BINS];
    for p in plain {
        bins[((p * PIT_BINS as f64) as usize).min(PIT_BINS - 1)] += 1;
    }
    let part = 1.0 / PIT_BINS as f64;
    let expected = plain.len() as f64 * part;
    let band = TWO_SIGMA * (expected * (1.0 - part)).sqrt();
    let tallest = bins.iter().copied().max().unwrap_or(0) as f64;
    let most = 1.08 * tallest.max(expected + band);
    let across = Axis::new(
        (0.0, 1.0),
        (place.left, place.left + place.width),
        "place in the stated distribution",
        6,
    );
    let bottom = place.top + place.height;
    let mut up = Axis::new((0.0, most), (bottom, place.top), "records", 6);
    up.marks.retain(|(at, _)| at.fract() == 0.0);
    for (at, text) in &mut up.marks {
        *text = count(*at as usize);
    }
    canvas.text(
        place.left,
        TOP - 10.0,
        "name",
        "Places of misses in their distributions",
    );
    canvas.frame(place, &across, &up);
    let width = place.width * part;
    for (bin, &number) in bins.iter().enumerate().filter(|(_, n)| **n > 0) {
        let y = up.pixel(number as f64);
        let x = place.left + width * bin as f64 + 0.5;
        canvas.rect(
            x,
            y,
            (width - 1.0, bottom - y),
            format_args!("class=\"f0\" fill-opacity=\"0.75\""),
        );
    }
    let [low, high] = [expected - band, expected + band].map(|v| up.pixel_inside(v));
    canvas.rect(
        place.left,
        high,
        (place.width, low - high),
        format_args!("class=\"f1\" fill-opacity=\"0.18\""),
    );
    let y = up.pixel(expected);
    canvas.line((place.left, y), (place.left + place.width, y), "was");
}

/// The shares in numbers.
pub(super) fn table(all: &[Held<'_>]) -> String {
    if all.is_empty() {
        return String::new();
    }
    let plain = || all.iter().map(|h| h.record).filter(|r| r.is_plain());
    let number = plain().count();
    let mut html = format!(
        "<table><thead><tr><th class=\"n\">stated</th><th class=\"n\">inside, of {} plain records</th>\
         <th class=\"n\">of all {}</th></tr></thead>\n",
        count(number),
        count(all.len())
    );
    for stated in STATED {
        let error = 100.0 * (stated * (1.0 - stated) / number as f64).sqrt();
        let percent = |share: f64| format!("{} %", rounded(100.0 * share, error.max(0.05)));
        let of_plain = share(plain(), stated);
        let bar = if of_plain.is_nan() {
            String::new()
        } else {
            format!(" ± {}", rounded(error, error))
        };
        let _ = writeln!(
            html,
            "<tr><td class=\"n\">{:.0} %</td><td class=\"n\">{}{bar}</td><td class=\"n\">{}</td></tr>",
            100.0 * stated,
            percent(of_plain),
            percent(share(all.iter().map(|h| h.record), stated)),
        );
    }
    html.push_str("</table>\n");
    html
}

/// The latest records that were not believed.
pub(super) fn outliers(page: &JointPage) -> String {
    let mut all: Vec<(&HeliostatLine, &RecordLine)> = Vec::new();
    for line in &page.heliostats {
        all.extend(line.records.iter().filter(|r| r.outlier).map(|r| (line, r)));
    }
    if all.is_empty() {
        return "<p>Every record was believed.</p>\n".to_owned();
    }
    all.sort_by_key(|(_, record)| std::cmp::Reverse(record.unix_ns));
    let mut html = String::from(
        "<table><thead><tr><th>heliostat</th><th>time (UTC)</th><th>record</th><th class=\"n\">missed, mrad</th>\
         <th class=\"n\">expected, mrad</th></tr></thead>\n",
    );
    for (line, record) in all.iter().take(MOST_LISTED) {
        let _ = writeln!(
            html,
            "<tr><td>{}</td><td class=\"t\">{}</td><td>{}</td><td class=\"n\">{}</td><td class=\"n\">{}</td></tr>",
            Escaped(&line.id),
            record.unix_ns.map_or_else(|| "–".to_owned(), dates::minute),
            Escaped(&record.label),
            mrad(record.beam_mrad()),
            mrad(record.expected_mrad()),
        );
    }
    html.push_str("</table>\n");
    if all.len() > MOST_LISTED {
        let _ = writeln!(
            html,
            "<p>{} earlier ones are not listed.</p>",
            count(all.len() - MOST_LISTED)
        );
    }
    html
}

const _: () = assert!(LEFT[1] + PANEL.0 < WIDTH);
