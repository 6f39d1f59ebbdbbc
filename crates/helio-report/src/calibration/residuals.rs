//! What the fit leaves, against the hour, the sun's elevation and the date.

use super::dates;
use super::plot::{Axis, Canvas, Place, WIDTH, count, mrad, quantile, range};
use super::{HeliostatSection, Record};

const PANEL: f64 = 170.0;
const TOP: f64 = 40.0;
const LEFT: f64 = 62.0;
const HALF: f64 = 390.0;
const SECOND: f64 = 532.0;
const FULL: f64 = SECOND + HALF - LEFT;
/// The third panel leaves a line for the names of epochs.
const LOWER: f64 = TOP + PANEL + 76.0;

/// What the fit leaves of one record: right and down, seen from the mirror \[mrad\].
fn residual(record: &Record) -> Option<[f64; 2]> {
    let [x, y] = [0, 1].map(|i| record.after_m[i] - record.measured_m[i]);
    let length = x.hypot(y);
    if !(length.is_finite() && record.after_mrad.is_finite()) {
        return None;
    }
    let per_metre = if length > 0.0 {
        record.after_mrad / length
    } else {
        0.0
    };
    Some([x * per_metre, y * per_metre])
}

/// The figure, or nothing where no record has a residual.
pub(super) fn figure(section: &HeliostatSection) -> Option<String> {
    let points: Vec<(&Record, [f64; 2])> = section
        .records
        .iter()
        .filter_map(|r| Some((r, residual(r)?)))
        .collect();
    if points.is_empty() {
        return None;
    }
    let used = points.iter().filter(|(r, _)| r.rejected.is_none());
    let magnitudes = || used.clone().flat_map(|(_, m)| m.map(f64::abs));
    // Where every record was rejected they are what there is to see.
    let most = quantile(magnitudes(), 1.0)
        .or_else(|| quantile(points.iter().flat_map(|(_, m)| m.map(f64::abs)), 0.9))
        .unwrap_or(0.0);
    let most = if most > 0.0 { 1.1 * most } else { 0.1 };

    let mut canvas = Canvas::new(LOWER + PANEL + 44.0);
    legend(&mut canvas, used.clone().count() < points.len());
    let up = |top: f64| {
        Axis::new(
            (-most, most),
            (top + PANEL, top),
            "residual of the beam, mrad",
            5,
        )
    };
    let place = |left, top, width| Place {
        left,
        top,
        width,
        height: PANEL,
    };

    let upper_left = place(LEFT, TOP, HALF);
    match hours(&points, upper_left) {
        Some((across, x)) => {
            draw(&mut canvas, upper_left, &across, &up(TOP), &points, &x);
            set_bounds(&mut canvas, upper_left, &across, section);
        }
        None => canvas.nothing(upper_left, "neither hour angles nor azimuths are known"),
    }

    let upper_right = place(SECOND, TOP, HALF);
    let elevations: Vec<f64> = points.iter().map(|(r, _)| r.sun_elevation_deg).collect();
    match range(elevations.iter().copied(), 0.04, 2.0) {
        Some(bounds) => {
            let ends = (SECOND, SECOND + HALF);
            let across = Axis::new(bounds, ends, "elevation of the sun, °", 7);
            draw(
                &mut canvas,
                upper_right,
                &across,
                &up(TOP),
                &points,
                &elevations,
            );
        }
        None => canvas.nothing(upper_right, "no elevations are known"),
    }

    let lower = place(LEFT, LOWER, FULL);
    let (across, x) = date_axis(&points, lower);
    draw(&mut canvas, lower, &across, &up(LOWER), &points, &x);
    epochs(&mut canvas, lower, &across, section);

    let title = format!("Heliostat {}: residuals", section.id);
    let description = format!(
        "Residuals of {} records against hour, elevation of the sun and date; RMS {} mrad.",
        points.len(),
        mrad(section.after_rms_mrad)
    );
    let mut caption = "Predicted less measured, as angles of the beam seen from the mirror, against the hour, the sun's \
         elevation and the date."
        .to_owned();
    if section.records.iter().any(|r| r.rejected.is_some()) {
        caption.push_str(" Rejected records are crosses; one at an edge lies beyond it.");
    }
    let without = section.records.len() - points.len();
    if without > 0 {
        caption.push_str(&format!(" {} without a residual left out.", count(without)));
    }
    Some(super::page::figure(
        &canvas.element(&title, &description),
        &caption,
    ))
}

fn legend(canvas: &mut Canvas, rejected: bool) {
    let y = 18.0;
    canvas.dots(7.0, &[(LEFT + 6.0, y - 4.0)], "class=\"dots s0\"");
    canvas.text(LEFT + 18.0, y, "", "right");
    canvas.dots(5.6, &[(LEFT + 76.0, y - 4.0)], "class=\"squares s1\"");
    canvas.text(LEFT + 88.0, y, "", "down");
    if rejected {
        canvas.crosses(3.5, &[(LEFT + 148.0, y - 4.0)], "bad");
        canvas.text(LEFT + 160.0, y, "", "rejected");
    }
}

/// The solar hour of each record where hour angles are known, else the azimuth of the sun.
fn hours(points: &[(&Record, [f64; 2])], place: Place) -> Option<(Axis, Vec<f64>)> {
    let ends = (place.left, place.left + place.width);
    let hours: Vec<f64> = points
        .iter()
        .map(|(r, _)| r.hour_angle_deg.map_or(f64::NAN, |h| 12.0 + h / 15.0))
        .collect();
    if let Some(bounds) = range(hours.iter().copied(), 0.04, 1.0) {
        let across = Axis::new(
            bounds,
            ends,
            "solar time, h (12 = the sun in the meridian)",
            8,
        );
        return Some((across, hours));
    }
    let azimuths: Vec<f64> = points.iter().map(|(r, _)| r.sun_azimuth_deg).collect();
    let bounds = range(azimuths.iter().copied(), 0.04, 4.0)?;
    let across = Axis::new(
        bounds,
        ends,
        "azimuth of the sun, ° (no times are known)",
        8,
    );
    Some((across, azimuths))
}

/// Nanoseconds of each record where times are known, else its number.
fn date_axis(points: &[(&Record, [f64; 2])], place: Place) -> (Axis, Vec<f64>) {
    let ends = (place.left, place.left + place.width);
    let times: Vec<f64> = points
        .iter()
        .map(|(r, _)| r.unix_ns.map_or(f64::NAN, |t| t as f64))
        .collect();
    let Some(bounds) = range(times.iter().copied(), 0.02, 600e9) else {
        let numbers: Vec<f64> = (1..=points.len()).map(|i| i as f64).collect();
        let bounds = range(numbers.iter().copied(), 0.02, 1.0).unwrap_or((0.0, 1.0));
        let mut across = Axis::new(
            bounds,
            ends,
            "record, in the order of the file (no times are known)",
            10,
        );
        across.marks.retain(|(at, _)| at.fract() == 0.0);
        return (across, numbers);
    };
    let (marks, name) = dates::ticks(bounds.0 as i64, bounds.1 as i64);
    let mut across = Axis::new(bounds, ends, &name, 1);
    across.marks = marks.into_iter().map(|(t, l)| (t as f64, l)).collect();
    (across, times)
}

fn draw(
    canvas: &mut Canvas,
    place: Place,
    across: &Axis,
    up: &Axis,
    points: &[(&Record, [f64; 2])],
    x: &[f64],
) {
    canvas.frame(place, across, up);
    let zero = up.pixel(0.0);
    canvas.line((place.left, zero), (place.left + place.width, zero), "axis");
    let diameter = match points.len() {
        0..200 => 5.0,
        200..1000 => 3.6,
        _ => 2.4,
    };
    let mut rejected = Vec::new();
    for component in [1, 0] {
        let mut dots = Vec::with_capacity(points.len());
        for ((record, mrad), &x) in points.iter().zip(x) {
            if !x.is_finite() {
                continue;
            }
            let at = (across.pixel(x), up.pixel_inside(mrad[component]));
            if record.rejected.is_some() {
                rejected.push(at);
            } else {
                dots.push(at);
            }
        }
        if component == 0 {
            canvas.dots(diameter, &dots, "class=\"dots s0\"");
        } else {
            canvas.dots(0.8 * diameter, &dots, "class=\"squares s1\"");
        }
    }
    canvas.crosses(3.0, &rejected, "bad");
}

/// Where one set of the chosen schedule ends and the next begins.
fn set_bounds(canvas: &mut Canvas, place: Place, across: &Axis, section: &HeliostatSection) {
    let Some(choice) = section.sets.iter().find(|choice| choice.chosen) else {
        return;
    };
    for set in &choice.sets {
        let Some(hour) = set.hour_angle_from_deg.map(|deg| 12.0 + deg / 15.0) else {
            continue;
        };
        if across.contains(hour) && across.name.starts_with("solar") {
            let x = across.pixel(hour);
            canvas.line((x, place.top), (x, place.top + place.height), "bound");
            canvas.text(x + 4.0, place.top + 12.0, "soft", "next set");
        }
    }
}

/// Bounds and names of epochs above and across the panel of dates.
fn epochs(canvas: &mut Canvas, place: Place, across: &Axis, section: &HeliostatSection) {
    if section.epochs.len() < 2 || section.part() != "epoch" {
        return;
    }
    // Halfway between the last record of one and the first of the next.
    let mut bounds = Vec::new();
    for pair in section.epochs.windows(2) {
        let (Some(end), Some(begin)) = (pair[0].to_unix_ns, pair[1].from_unix_ns) else {
            return;
        };
        bounds.push((0.5 * (end as f64 + begin as f64), begin));
    }
    let mut free_from = place.left;
    let y = place.top - 7.0;
    for (i, (middle, begin)) in bounds.into_iter().enumerate() {
        if !across.contains(middle) {
            continue;
        }
        let x = across.pixel(middle);
        canvas.line((x, y - 12.0), (x, place.top + place.height), "bound");
        let full = format!("epoch {}, from {}", i + 2, dates::day(begin));
        // Roughly as wide as 12 px letters are.
        let short = (i + 2).to_string();
        let text = [full, short].into_iter().find(|text| {
            x >= free_from
                && x + 12.0 + 6.3 * text.len() as f64 <= next_bound(section, across, i + 1, place)
        });
        if let Some(text) = text {
            free_from = x + 4.0 + 6.3 * text.len() as f64;
            canvas.text(x + 4.0, y, "", &text);
        }
    }
}

/// Where the epoch after `i` begins, or the panel ends.
fn next_bound(section: &HeliostatSection, across: &Axis, i: usize, place: Place) -> f64 {
    let edge = place.left + place.width;
    let (Some(end), Some(begin)) = (
        section.epochs.get(i).and_then(|e| e.to_unix_ns),
        section.epochs.get(i + 1).and_then(|e| e.from_unix_ns),
    ) else {
        return edge + 30.0;
    };
    across.pixel(0.5 * (end as f64 + begin as f64)).min(edge)
}

const _: () = assert!(SECOND + HALF < WIDTH);
