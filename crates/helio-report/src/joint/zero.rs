//! Zero points over time: small multiples, their table, and the list of jumps.

use std::fmt::Write;

use super::{HeliostatLine, JointPage, RecordLine, TRACKS, evenly, rms, rounded};
use crate::calibration::correlation::shortened;
use crate::calibration::dates;
use crate::calibration::page::figure as framed;
use crate::calibration::plot::{Axis, Canvas, Place, WIDTH, count, mrad, quantile, range};
use crate::svg::{Escaped, Short};

/// Records of one heliostat that are drawn at most; jumps always are.
const MOST_RECORDS: usize = 400;
/// Jumps of one heliostat that are drawn at most.
const MOST_JUMPS: usize = 40;
/// Jumps that are listed at most.
const MOST_LISTED: usize = 100;
/// A heliostat whose records span less than this part of the field's gets a time of its own.
const SHORT: f64 = 0.2;
/// Least time shown \[ns\].
const LEAST_NS: f64 = 600e9;
const COLUMNS: usize = 3;
const LEFT: f64 = 44.0;
const EACH: f64 = 304.0;
const PANEL: (f64, f64) = (256.0, 104.0);
const TOP: f64 = 52.0;

/// Root mean square of the misses one record ahead \[mrad\] after the first few; NaN where there are no more.
fn missed(line: &HeliostatLine) -> f64 {
    rms(line.settled().map(RecordLine::beam_mrad))
}

/// Which heliostats are drawn: all of a small field; else half of them those missed farthest, half evenly
/// chosen among the others; in the order of the field.
pub(super) fn chosen(page: &JointPage) -> Vec<usize> {
    let with: Vec<usize> = (0..page.heliostats.len())
        .filter(|&i| !page.heliostats[i].records.is_empty())
        .collect();
    if with.len() <= TRACKS {
        return with;
    }
    let mut by_miss: Vec<(f64, usize)> = with
        .into_iter()
        .map(|i| (missed(&page.heliostats[i]), i))
        .map(|(miss, i)| {
            (
                if miss.is_nan() {
                    f64::NEG_INFINITY
                } else {
                    miss
                },
                i,
            )
        })
        .collect();
    by_miss.sort_by(|a, b| b.0.total_cmp(&a.0));
    let mut others: Vec<usize> = by_miss
        .split_off(TRACKS / 2)
        .into_iter()
        .map(|(_, i)| i)
        .collect();
    others.sort_unstable();
    let mut all: Vec<usize> = by_miss.into_iter().map(|(_, i)| i).collect();
    all.extend(evenly(others.len(), TRACKS - all.len()).map(|k| others[k]));
    all.sort_unstable();
    all
}

/// Records that are drawn: evenly chosen, and those after jumps.
fn drawn(line: &HeliostatLine) -> Vec<(usize, &RecordLine)> {
    let mut places: Vec<usize> = evenly(line.records.len(), MOST_RECORDS).collect();
    places.extend(
        (0..line.records.len())
            .filter(|&i| line.records[i].jumped != [false; 2])
            .take(MOST_JUMPS),
    );
    places.sort_unstable();
    places.dedup();
    places.into_iter().map(|i| (i, &line.records[i])).collect()
}

/// The small multiples, or nothing where there are no records.
pub(super) fn figure(page: &JointPage, chosen: &[usize]) -> Option<String> {
    if chosen.is_empty() {
        return None;
    }
    let lines: Vec<&HeliostatLine> = chosen.iter().map(|&i| &page.heliostats[i]).collect();
    let times = lines.iter().flat_map(|line| times(line));
    let shared = range(times, 0.02, LEAST_NS);
    let down = PANEL.1 + 50.0;
    let mut canvas = Canvas::new(TOP + down * lines.len().div_ceil(COLUMNS) as f64 - 6.0);
    legend(&mut canvas);
    let mut edges = false;
    for (number, line) in lines.iter().enumerate() {
        let place = Place {
            left: LEFT + EACH * (number % COLUMNS) as f64,
            top: TOP + down * (number / COLUMNS) as f64,
            width: PANEL.0,
            height: PANEL.1,
        };
        let name = shortened(&line.id, 16);
        canvas.text(place.left, place.top - 7.0, "name", &name);
        let (across, in_time) = time_axis(place, shared, line);
        let number = line.records.len();
        let plural = if number == 1 { "" } else { "s" };
        let records = format!("{} record{plural}{}", count(number), across.name);
        let right = place.left + place.width;
        canvas.text(right, place.top - 7.0, "e soft small", &records);
        edges |= panel(&mut canvas, place, &across, line, in_time);
    }
    let of = if page.followed {
        "as known after each record, less those at rest before the first"
    } else {
        "as all records tell them, less those at rest after the last"
    };
    let mut caption = format!(
        "Zero points {of}, mrad of the mirror, with one standard deviation. All panels show the same time but those that \
         say otherwise; each has its own scale of mrad."
    );
    if edges {
        caption.push_str(" Squares at an edge lie beyond it; the list of jumps has their numbers.");
    }
    let with = page
        .heliostats
        .iter()
        .filter(|h| !h.records.is_empty())
        .count();
    if chosen.len() < with {
        let _ = write!(
            caption,
            " {} of {} heliostats: the {} missed farthest one record ahead, and others evenly chosen.",
            chosen.len(),
            count(with),
            TRACKS / 2
        );
    }
    if lines.iter().any(|line| line.records.len() > MOST_RECORDS) {
        let _ = write!(
            caption,
            " Of more than {MOST_RECORDS} records some are drawn, evenly chosen."
        );
    }
    Some(framed(
        &canvas.element(
            "Zero points over time",
            "One panel a heliostat; the table below has the last ones.",
        ),
        &caption,
    ))
}

fn times(line: &HeliostatLine) -> impl Iterator<Item = f64> {
    line.records
        .iter()
        .filter_map(|r| r.unix_ns)
        .map(|t| t as f64)
}

/// The time that all panels share, or the heliostat's own where that is short; without times the order of
/// the records, and false. The name says which.
fn time_axis(place: Place, shared: Option<(f64, f64)>, line: &HeliostatLine) -> (Axis, bool) {
    let ends = (place.left, place.left + place.width);
    let own = range(times(line), 0.04, LEAST_NS);
    let (Some(shared), Some(own)) = (shared, own) else {
        let last = line.records.len() as f64;
        let mut across = Axis::new((0.5, last + 0.5), ends, " in order, no times known", 5);
        across.marks.retain(|(at, _)| at.fract() == 0.0);
        return (across, false);
    };
    let is_short = own.1 - own.0 < SHORT * (shared.1 - shared.0);
    let bounds = if is_short { own } else { shared };
    let (marks, name) = dates::ticks(bounds.0 as i64, bounds.1 as i64);
    let name = match name.starts_with("time") {
        _ if !is_short => String::new(),
        // Its labels are hours.
        true => format!(", from {} (UTC)", dates::day(bounds.0 as i64)),
        false => ", own dates".to_owned(),
    };
    let mut across = Axis::new(bounds, ends, &name, 1);
    // Labels are up to ten letters wide.
    let letters: usize = marks.iter().map(|(_, label)| label.len() + 2).sum();
    let every = letters.div_ceil(36).max(1);
    let few = marks
        .into_iter()
        .enumerate()
        .filter(|(i, _)| i % every == 0);
    across.marks = few.map(|(_, (t, l))| (t as f64, l)).collect();
    (across, true)
}

fn legend(canvas: &mut Canvas) {
    let y = 16.0;
    let mut x = LEFT;
    for axis in 0..2 {
        canvas.line((x + 6.0, y - 9.0), (x + 6.0, y + 1.0), &format!("s{axis}"));
        canvas.dots(
            5.0,
            &[(x + 6.0, y - 4.0)],
            &format!("class=\"dots s{axis}\""),
        );
        canvas.text(x + 16.0, y, "", &format!("axis {}", axis + 1));
        x += 76.0;
    }
    for axis in 0..2 {
        canvas.line(
            (x + 6.0, y - 10.0),
            (x + 6.0, y + 2.0),
            &format!("jump s{axis}"),
        );
        canvas.text(x + 14.0, y, "", &format!("axis {} jumped", axis + 1));
        x += 112.0;
    }
    canvas.crosses(3.0, &[(x + 6.0, y - 4.0)], "bad");
    canvas.text(x + 16.0, y, "", "outlier (drawn at the bottom)");
}

/// Ends of the middle part of some values, far enough for most; all of them where that is not much more.
fn scale(values: &[f64]) -> Option<(f64, f64)> {
    let all = range(values.iter().copied(), 0.06, 1.0)?;
    let [low, high] = [0.12, 0.88].map(|share| quantile(values.iter().copied(), share));
    let most = range([low?, high?], 0.5, 1.0)?;
    Some(if all.1 - all.0 > 2.0 * (most.1 - most.0) {
        most
    } else {
        all
    })
}

/// Says whether anything lies beyond its edges.
fn panel(
    canvas: &mut Canvas,
    place: Place,
    across: &Axis,
    line: &HeliostatLine,
    in_time: bool,
) -> bool {
    let timed: Vec<(f64, &RecordLine)> = drawn(line)
        .into_iter()
        .filter_map(|(number, record)| {
            let at = if in_time {
                record.unix_ns? as f64
            } else {
                (number + 1) as f64
            };
            Some((across.pixel(at), record))
        })
        .collect();
    let ends: Vec<f64> = timed
        .iter()
        .flat_map(|(_, r)| {
            [0, 1].map(|axis| {
                let (zero, sigma) = (r.zero_mrad[axis], r.zero_sigma_mrad[axis]);
                [zero - sigma, zero + sigma]
            })
        })
        .flatten()
        .collect();
    let Some(bounds) = scale(&ends) else {
        canvas.nothing(place, "no finite numbers");
        return false;
    };
    let bottom = place.top + place.height;
    let up = Axis::new(bounds, (bottom, place.top), "", 4);
    for (at, text) in &across.marks {
        let x = across.pixel(*at);
        canvas.line((x, place.top), (x, bottom), "grid");
        canvas.text(x, bottom + 14.0, "m small", text);
    }
    for (at, text) in &up.marks {
        let y = up.pixel(*at);
        canvas.line((place.left, y), (place.left + place.width, y), "grid");
        canvas.text(place.left - 5.0, y + 4.0, "e small", text);
    }
    if up.contains(0.0) {
        let y = up.pixel(0.0);
        canvas.line((place.left, y), (place.left + place.width, y), "axis");
    }
    let jumped = timed.iter().filter(|(_, r)| r.jumped != [false; 2]);
    for &(x, record) in jumped.take(MOST_JUMPS) {
        for axis in 0..2 {
            if record.jumped[axis] {
                canvas.line((x, place.top), (x, bottom), &format!("jump s{axis}"));
            }
        }
    }
    let diameter = if timed.len() > 120 { 2.6 } else { 3.6 };
    let mut edges = false;
    for axis in 0..2 {
        let mut bars = String::new();
        let (mut dots, mut beyond) = (Vec::with_capacity(timed.len()), Vec::new());
        for &(x, record) in &timed {
            let (zero, sigma) = (record.zero_mrad[axis], record.zero_sigma_mrad[axis]);
            if !up.contains(zero) {
                // Neither end of the range is one that is not a number.
                let edge = up.pixel_inside(zero);
                beyond.extend(zero.is_finite().then_some((x, edge)));
                continue;
            }
            dots.push((x, up.pixel(zero)));
            if sigma.is_finite() {
                let ends = [zero - sigma, zero + sigma].map(|v| Short(up.pixel_inside(v)));
                // Writing to a string cannot fail.
                let _ = write!(bars, "M{} {}V{}", Short(x), ends[0], ends[1]);
            }
        }
        canvas.raw(format_args!(
            "<path d=\"{bars}\" class=\"s{axis}\" stroke-opacity=\"0.35\"/>"
        ));
        canvas.dots(diameter, &dots, &format!("class=\"dots s{axis}\""));
        canvas.dots(3.6, &beyond, &format!("class=\"squares s{axis}\""));
        edges |= !beyond.is_empty();
    }
    let outliers: Vec<(f64, f64)> = timed
        .iter()
        .filter(|(_, r)| r.outlier)
        .map(|(x, _)| (*x, bottom - 5.0))
        .collect();
    canvas.crosses(2.6, &outliers, "bad");
    canvas.rect(
        place.left,
        place.top,
        (place.width, place.height),
        format_args!("class=\"frame\""),
    );
    edges
}

/// The heliostats drawn, in numbers.
pub(super) fn table(page: &JointPage, chosen: &[usize]) -> String {
    if chosen.is_empty() {
        return String::new();
    }
    let mut html = String::from(
        "<div class=\"scroll\"><table><thead><tr><th>heliostat</th><th class=\"n\">records</th><th class=\"n\">outliers</th>\
         <th class=\"n\">jumps</th><th class=\"n\">last zero of axis 1, mrad</th><th class=\"n\">of axis 2, mrad</th>\
         <th class=\"n\">expected, mrad</th><th class=\"n\">missed, mrad</th></tr></thead>\n",
    );
    for line in chosen.iter().map(|&i| &page.heliostats[i]) {
        let records = &line.records;
        let last = records.last();
        let zero = |axis: usize| {
            last.map_or_else(String::new, |r| {
                let (zero, sigma) = (r.zero_mrad[axis], r.zero_sigma_mrad[axis]);
                format!("{} ± {}", rounded(zero, sigma), rounded(sigma, sigma))
            })
        };
        let jumps: usize = records.iter().map(|r| jumps_of(r)[0]).sum();
        let _ = writeln!(
            html,
            "<tr><td>{}</td><td class=\"n\">{}</td><td class=\"n\">{}</td><td class=\"n\">{}</td><td class=\"n\">{}</td>\
             <td class=\"n\">{}</td><td class=\"n\">{}</td><td class=\"n\">{}</td></tr>",
            Escaped(&line.id),
            count(records.len()),
            count(records.iter().filter(|r| r.outlier).count()),
            count(jumps),
            zero(0),
            zero(1),
            mrad(rms(line.settled().map(RecordLine::expected_mrad))),
            mrad(missed(line)),
        );
    }
    html.push_str("</table></div>\n");
    html
}

/// How many zero points jumped just before a record: without a doubt, and perhaps.
pub(super) fn jumps_of(record: &RecordLine) -> [usize; 2] {
    let jumps = record.jumped.iter().filter(|jumped| **jumped).count();
    if record.in_doubt {
        [0, jumps]
    } else {
        [jumps, 0]
    }
}

/// All jumps, the latest first: which heliostat, before which record, of which axis.
fn found(page: &JointPage) -> Vec<(usize, usize, usize)> {
    let mut all: Vec<(usize, usize, usize)> = Vec::new();
    for (number, line) in page.heliostats.iter().enumerate() {
        for (i, record) in line.records.iter().enumerate() {
            all.extend(
                (0..2)
                    .filter(|&axis| record.jumped[axis])
                    .map(|axis| (number, i, axis)),
            );
        }
    }
    all.sort_by_key(|&(number, i, _)| {
        std::cmp::Reverse(page.heliostats[number].records[i].unix_ns)
    });
    all
}

/// The heliostats of the jumps that are listed, each once.
pub(super) fn listed(page: &JointPage) -> Vec<usize> {
    let all = found(page).into_iter().take(MOST_LISTED);
    let mut heliostats: Vec<usize> = all.map(|(number, _, _)| number).collect();
    heliostats.sort_unstable();
    heliostats.dedup();
    heliostats
}

/// The latest jumps.
pub(super) fn jumps(page: &JointPage) -> String {
    let all = found(page);
    if all.is_empty() {
        return "<p>No zero point was found to have jumped.</p>\n".to_owned();
    }
    let mut html = String::from(
        "<table><thead><tr><th>heliostat</th><th>found at (UTC)</th><th>record</th><th class=\"n\">axis</th>\
         <th class=\"n\">from, mrad</th><th class=\"n\">to, mrad</th><th class=\"n\">by, mrad</th></tr></thead>\n",
    );
    for &(number, i, axis) in all.iter().take(MOST_LISTED) {
        let line = &page.heliostats[number];
        let record = &line.records[i];
        let before = i.checked_sub(1).map(|i| &line.records[i]);
        let zero = |r: &RecordLine| rounded(r.zero_mrad[axis], r.zero_sigma_mrad[axis]);
        let by = before.map_or(f64::NAN, |b| record.zero_mrad[axis] - b.zero_mrad[axis]);
        let _ = writeln!(
            html,
            "<tr><td>{}</td><td class=\"t\">{}</td><td>{}</td><td class=\"n\">{}{}</td><td class=\"n\">{}</td>\
             <td class=\"n\">{} ± {}</td><td class=\"n\">{}</td></tr>",
            Escaped(&line.id),
            record.unix_ns.map_or_else(|| "–".to_owned(), dates::minute),
            Escaped(&record.label),
            axis + 1,
            if record.in_doubt { " (in doubt)" } else { "" },
            before.map_or_else(|| "–".to_owned(), zero),
            zero(record),
            rounded(record.zero_sigma_mrad[axis], record.zero_sigma_mrad[axis]),
            rounded(by, record.zero_sigma_mrad[axis]),
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

const _: () = assert!(LEFT + EACH * (COLUMNS - 1) as f64 + PANEL.0 < WIDTH);
