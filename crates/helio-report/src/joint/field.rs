//! How heliostats differ: each against the field's normal distribution, and correlations over the field.

use std::f64::consts::TAU;
use std::fmt::Write;

use super::{HeliostatLine, JointPage, rounded};
use crate::calibration::EpochSection;
use crate::calibration::correlation::{matrix, shortened};
use crate::calibration::page::figure as framed;
use crate::calibration::plot::{Axis, Canvas, Place, WIDTH, count, quantile, range};
use crate::svg::{Escaped, Short};

/// Up to so many heliostats are drawn one by one; more are counted.
const MOST_ONE_BY_ONE: usize = 24;
/// More unknowns than this are not drawn.
const MOST: usize = 16;
const LEFT: [f64; 2] = [76.0, 540.0];
const STRIP: f64 = 384.0;
const CURVE: f64 = 46.0;
const COUNTS: f64 = 120.0;
const ROW: f64 = 13.0;
const BINS: usize = 40;

/// A heliostat's value of an unknown with its standard deviation.
fn of(line: &HeliostatLine, unknown: usize) -> Option<(f64, f64)> {
    let value = line.values_mrad.get(unknown).filter(|v| v.is_finite())?;
    let sigma = line.sigmas_mrad.get(unknown).copied();
    Some((*value, sigma.filter(|s| *s >= 0.0).unwrap_or(f64::NAN)))
}

/// One strip for each unknown, or nothing where no heliostat was observed.
pub(super) fn figure(page: &JointPage) -> Option<String> {
    let observed: Vec<&HeliostatLine> = page
        .heliostats
        .iter()
        .filter(|h| h.observations > 0 && (0..page.unknowns.len()).any(|k| of(h, k).is_some()))
        .collect();
    if observed.is_empty() {
        return None;
    }
    let one_by_one = observed.len() <= MOST_ONE_BY_ONE;
    let height = if one_by_one {
        CURVE + ROW * observed.len() as f64 + 4.0
    } else {
        COUNTS
    };
    let shown = page.unknowns.len().min(MOST);
    let each = height + 60.0;
    let mut canvas = Canvas::new(each * shown.div_ceil(2) as f64);
    for unknown in 0..shown {
        let place = Place {
            left: LEFT[unknown % 2],
            top: 22.0 + each * (unknown / 2) as f64,
            width: STRIP,
            height,
        };
        strip(&mut canvas, place, page, &observed, unknown);
    }
    let mut caption = if one_by_one {
        "Heliostats' own values, each with one standard deviation, under the normal distribution from which the fit \
         takes them to be drawn."
            .to_owned()
    } else {
        format!(
            "Values of {} observed heliostats, counted, and the normal distribution from which the fit takes them to be \
             drawn.",
            count(observed.len())
        )
    };
    caption.push_str(
        " Few records leave a value near the field's mean, so the values may crowd closer than the curve.",
    );
    let without = page.heliostats.len() - observed.len();
    if without > 0 {
        let _ = write!(caption, " Left out, as never observed: {}.", count(without));
    }
    if shown < page.unknowns.len() {
        let _ = write!(caption, " The first {shown} of {}.", page.unknowns.len());
    }
    let description = "The table below has the means and standard deviations of the field.";
    Some(framed(
        &canvas.element("Distribution of heliostats' own angles", description),
        &caption,
    ))
}

fn strip(
    canvas: &mut Canvas,
    place: Place,
    page: &JointPage,
    observed: &[&HeliostatLine],
    unknown: usize,
) {
    let name = format!("{}, mrad", page.unknowns[unknown]);
    canvas.text(place.left, place.top - 8.0, "name", &name);
    let one_by_one = observed.len() <= MOST_ONE_BY_ONE;
    let (mean, spread) = (
        page.mean_mrad.get(unknown).copied().unwrap_or(f64::NAN),
        page.spread_mrad(unknown),
    );
    let values = || observed.iter().filter_map(|h| of(h, unknown));
    let curve = [mean - 2.8 * spread, mean + 2.8 * spread];
    let bounds = if one_by_one {
        let ends = values().flat_map(|(v, s)| if s.is_nan() { [v; 2] } else { [v - s, v + s] });
        range(ends.chain(curve), 0.03, 1e-3)
    } else {
        // A few far off must not squeeze the field.
        let ends = [0.005, 0.995].map(|share| quantile(values().map(|(v, _)| v), share));
        range(ends.into_iter().flatten().chain(curve), 0.04, 1e-3)
    };
    let Some(bounds) = bounds else {
        canvas.nothing(place, "no finite numbers");
        return;
    };
    let across = Axis::new(bounds, (place.left, place.left + place.width), "", 7);
    let bottom = place.top + place.height;
    for (at, text) in &across.marks {
        let x = across.pixel(*at);
        canvas.line((x, place.top), (x, bottom), "grid");
        canvas.text(x, bottom + 15.0, "m", text);
    }
    if across.contains(mean) {
        let x = across.pixel(mean);
        canvas.line((x, place.top), (x, bottom), "axis");
    }
    if one_by_one {
        normal(canvas, place, &across, mean, spread, (CURVE - 4.0, 1.0));
        rows(canvas, place, &across, observed, unknown);
    } else {
        counted(
            canvas,
            place,
            &across,
            values().map(|(v, _)| v),
            (mean, spread),
        );
    }
    canvas.rect(
        place.left,
        place.top,
        (place.width, place.height),
        format_args!("class=\"frame\""),
    );
}

/// A normal distribution whose top is `part` of the `height` given.
fn normal(
    canvas: &mut Canvas,
    place: Place,
    across: &Axis,
    mean: f64,
    spread: f64,
    (height, part): (f64, f64),
) {
    if !(spread > 0.0 && spread.is_finite() && mean.is_finite()) {
        return;
    }
    let foot = if height < place.height - 20.0 {
        place.top + height
    } else {
        place.top + place.height
    };
    let mut path = String::new();
    for step in 0..=96 {
        let at = across.min + (across.max - across.min) * f64::from(step) / 96.0;
        let z = (at - mean) / spread;
        let y = foot - part * (height - 4.0) * (-0.5 * z * z).exp();
        let letter = if step == 0 { 'M' } else { 'L' };
        // Writing to a string cannot fail.
        let _ = write!(path, "{letter}{} {}", Short(across.pixel(at)), Short(y));
    }
    let (left, right, foot) = (
        Short(place.left),
        Short(place.left + place.width),
        Short(foot),
    );
    canvas.clipped(place, |canvas| {
        canvas.raw(format_args!(
            "<path d=\"{path}L{right} {foot}L{left} {foot}z\" class=\"f1 mark\" fill-opacity=\"0.16\"/>"
        ));
        canvas.raw(format_args!("<path d=\"{path}\" class=\"s1\"/>"));
    });
}

fn rows(
    canvas: &mut Canvas,
    place: Place,
    across: &Axis,
    observed: &[&HeliostatLine],
    unknown: usize,
) {
    let mut dots = Vec::new();
    for (row, line) in observed.iter().enumerate() {
        let y = place.top + CURVE + ROW * (row as f64 + 0.5);
        canvas.text(
            place.left - 6.0,
            y + 4.0,
            "e small",
            &shortened(&line.id, 10),
        );
        let Some((value, sigma)) = of(line, unknown) else {
            continue;
        };
        if sigma.is_finite() {
            let ends = [value - sigma, value + sigma].map(|v| across.pixel_inside(v));
            canvas.line((ends[0], y), (ends[1], y), "bar s0");
        }
        dots.push((across.pixel(value), y));
    }
    canvas.dots(6.0, &dots, "class=\"dots s0\"");
}

/// A histogram with the normal distribution of as many over it.
fn counted(
    canvas: &mut Canvas,
    place: Place,
    across: &Axis,
    values: impl Iterator<Item = f64>,
    (mean, spread): (f64, f64),
) {
    let mut bins = [0_usize; BINS];
    let mut all = 0;
    for value in values {
        all += 1;
        let bin = (value - across.min) / (across.max - across.min) * BINS as f64;
        if across.contains(value) {
            bins[(bin as usize).min(BINS - 1)] += 1;
        }
    }
    let each = (across.max - across.min) / BINS as f64;
    let peak = all as f64 * each / (spread * TAU.sqrt());
    let tallest = bins.iter().copied().max().unwrap_or(0).max(1) as f64;
    let tallest = if peak.is_finite() {
        tallest.max(peak)
    } else {
        tallest
    };
    let bottom = place.top + place.height;
    let width = place.width / BINS as f64;
    for (bin, &number) in bins.iter().enumerate().filter(|(_, n)| **n > 0) {
        let tall = (place.height - 4.0) * number as f64 / tallest;
        let x = place.left + width * bin as f64 + 0.4;
        canvas.rect(
            x,
            bottom - tall,
            (width - 0.8, tall),
            format_args!("class=\"f0\" fill-opacity=\"0.75\""),
        );
    }
    if peak.is_finite() {
        normal(
            canvas,
            place,
            across,
            mean,
            spread,
            (place.height, peak / tallest),
        );
    }
    canvas.text(
        place.left - 6.0,
        place.top + 10.0,
        "e small",
        &count(tallest as usize),
    );
    canvas.text(place.left - 6.0, bottom, "e small", "0");
}

/// Correlations over the field, or nothing where they are not known.
pub(super) fn correlations(page: &JointPage) -> Option<String> {
    let n = page.unknowns.len();
    if !(2..=MOST).contains(&n) || page.covariance_mrad2.len() != n * n {
        return None;
    }
    let correlation = (0..n)
        .map(|i| {
            let of = |j| {
                let sigmas = page.spread_mrad(i) * page.spread_mrad(j);
                if i == j {
                    1.0
                } else {
                    page.covariance_mrad2[i * n + j] / sigmas
                }
            };
            (0..n).map(of).collect()
        })
        .collect();
    let names = EpochSection {
        correlation,
        correlation_names: page.unknowns.clone(),
        ..EpochSection::default()
    };
    let mut canvas = Canvas::new(28.0 + 36.0 * n as f64 + 10.0);
    matrix(&mut canvas, 16.0, 28.0, &names);
    Some(framed(
        &canvas.element(
            "Correlations over the field",
            "How heliostats' own values go together over the field.",
        ),
        "Correlations over the field: which of the heliostats' own values go together.",
    ))
}

/// Mean and standard deviation of each unknown.
pub(super) fn table(page: &JointPage) -> String {
    if page.unknowns.is_empty() {
        return String::new();
    }
    let mut html = String::from(
        "<table><thead><tr><th>of each heliostat</th><th class=\"n\">mean of the field, mrad</th>\
         <th class=\"n\">standard deviation, mrad</th></tr></thead>\n",
    );
    for (unknown, name) in page.unknowns.iter().enumerate() {
        let spread = page.spread_mrad(unknown);
        let mean = page.mean_mrad.get(unknown).copied().unwrap_or(f64::NAN);
        let _ = writeln!(
            html,
            "<tr><td>{}</td><td class=\"n\">{}</td><td class=\"n\">{}</td></tr>",
            Escaped(name),
            rounded(mean, 0.3 * spread),
            rounded(spread, 0.3 * spread),
        );
    }
    html.push_str("</table>\n");
    html
}

const _: () = assert!(LEFT[1] + STRIP < WIDTH);
