//! The field: a map and a histogram of RMS.

use super::plot::{Axis, Canvas, Place, WIDTH, count, mrad, quantile, range};
use super::{CalibrationPage, HeliostatSummary, Verdict};
use crate::palette;
use crate::svg::Short;

/// Colours of the bar: finer steps are not told apart.
const BINS: usize = 48;
const LEFT: f64 = 72.0;
const TOP: f64 = 16.0;
const PLOT: (f64, f64) = (640.0, 560.0);

/// A part of viridis that stands out from white and from black.
fn colour(part: f64) -> String {
    palette::value(false, 0.14 + 0.78 * part)
}

/// The scale of colours and of the histogram: up to where 98 % of the field lies, rounded up.
fn scale(field: &[HeliostatSummary]) -> Option<f64> {
    let most = quantile(field.iter().map(|h| h.beam_rms_mrad), 0.98)?;
    // A field without any residual still gets a scale.
    let most = most.max(0.08);
    let power = 10_f64.powf(most.log10().floor());
    [1.0, 1.5, 2.0, 3.0, 4.0, 5.0, 6.0, 8.0, 10.0]
        .into_iter()
        .map(|factor| factor * power)
        .find(|&s| s > most * 1.000_001)
        .or(Some(most * 1.1))
        .filter(|s| s.is_finite())
}

/// The map, or nothing where no heliostat has a place.
pub(super) fn map(page: &CalibrationPage) -> Option<String> {
    let placed: Vec<&HeliostatSummary> = page
        .field
        .iter()
        .filter(|h| h.east_m.is_finite() && h.north_m.is_finite())
        .collect();
    if placed.is_empty() {
        return None;
    }
    let tower = page.tower_m.filter(|t| t.iter().all(|v| v.is_finite()));
    let easts = placed.iter().map(|h| h.east_m);
    let norths = placed.iter().map(|h| h.north_m);
    let (west, east) = range(easts.chain(tower.map(|t| t[0])), 0.04, 20.0)?;
    let (south, north) = range(norths.chain(tower.map(|t| t[1])), 0.04, 20.0)?;
    let pixels = (PLOT.0 / (east - west)).min(PLOT.1 / (north - south));
    // A field one heliostat wide still gets a readable plot.
    let place = Place {
        left: LEFT,
        top: TOP,
        width: (pixels * (east - west)).max(220.0),
        height: (pixels * (north - south)).max(220.0),
    };
    let around = |(min, max): (f64, f64), size: f64| {
        let (middle, half) = (0.5 * (min + max), 0.5 * size / pixels);
        (middle - half, middle + half)
    };
    let across = Axis::new(
        around((west, east), place.width),
        (place.left, place.left + place.width),
        "east, m",
        (place.width / 80.0) as usize,
    );
    let up = Axis::new(
        around((south, north), place.height),
        (place.top + place.height, place.top),
        "north, m",
        (place.height / 60.0) as usize,
    );
    let mut canvas = Canvas::new(TOP + place.height + 44.0);
    canvas.frame(place, &across, &up);

    let most = scale(&page.field);
    let area = place.width * place.height;
    let diameter = (0.62 * (area / placed.len() as f64).sqrt()).clamp(1.6, 9.0);
    let at = |h: &HeliostatSummary| (across.pixel(h.east_m), up.pixel(h.north_m));
    let rings = |verdict: Verdict| -> Vec<(f64, f64)> {
        let some = placed.iter().filter(|h| h.verdict == verdict);
        some.map(|h| at(h)).collect()
    };
    let ring = diameter + (0.7 * diameter).clamp(1.2, 5.0);
    canvas.dots(ring, &rings(Verdict::Undetermined), "class=\"dots ring\"");
    canvas.dots(ring, &rings(Verdict::Failed), "class=\"dots failed\"");
    let mut bins: Vec<Vec<(f64, f64)>> = vec![Vec::new(); BINS];
    let (mut without, mut unobserved) = (Vec::new(), Vec::new());
    for h in &placed {
        match most.filter(|_| h.beam_rms_mrad.is_finite()) {
            Some(most) => {
                let bin = (h.beam_rms_mrad / most * BINS as f64).max(0.0) as usize;
                bins[bin.min(BINS - 1)].push(at(h));
            }
            None if h.verdict == Verdict::NotObserved => unobserved.push(at(h)),
            None => without.push(at(h)),
        }
    }
    // Small, so that the others stand out.
    canvas.dots(0.55 * diameter, &unobserved, "class=\"dots none\"");
    canvas.dots(diameter, &without, "class=\"dots none\"");
    for (bin, dots) in bins.iter().enumerate() {
        let colour = colour((bin as f64 + 0.5) / BINS as f64);
        let more = format!("class=\"dots\" style=\"stroke:{colour}\"");
        canvas.dots(diameter, dots, &more);
    }
    if let Some([e, n]) = tower {
        let (x, y) = (Short(across.pixel(e)), Short(up.pixel(n)));
        canvas.raw(format_args!(
            "<path d=\"M{x} {y}m-6 5h12l-6 -12z\" class=\"tower\"><title>tower</title></path>"
        ));
    }
    legend(&mut canvas, place.left + place.width + 34.0, most, &placed);

    let caption = format!(
        "The field from above, coloured by what the fit leaves of the beam (RMS). Heliostats: {}.",
        count(placed.len())
    );
    let description = "Colours run from dark, a small RMS, to light, a large one; rings mark undetermined and failed heliostats.";
    Some(super::page::figure(
        &canvas.element("RMS over the field", description),
        &caption,
    ))
}

fn legend(canvas: &mut Canvas, x: f64, most: Option<f64>, placed: &[&HeliostatSummary]) {
    let mut y = TOP + 12.0;
    if let Some(most) = most {
        canvas.text(x, y, "name", "RMS of the beam, mrad");
        let (top, height) = (y + 14.0, 150.0);
        let each = height / BINS as f64;
        for bin in 0..BINS {
            let from_top = top + height - (bin + 1) as f64 * each;
            let fill = colour((bin as f64 + 0.5) / BINS as f64);
            // A little overlap, so that no paper shows between two colours.
            let size = (16.0, each + if bin == 0 { 0.0 } else { 0.5 });
            canvas.rect(x, from_top, size, format_args!("fill=\"{fill}\""));
        }
        let bar = Axis::new((0.0, most), (top + height, top), "", 5);
        let beyond = placed.iter().any(|h| h.beam_rms_mrad > most);
        for (at, text) in &bar.marks {
            let y = bar.pixel(*at);
            canvas.line((x + 16.0, y), (x + 20.0, y), "axis");
            let last = beyond && (*at - most).abs() < 1e-9 * most;
            let text = if last {
                format!("{text} and more")
            } else {
                text.clone()
            };
            canvas.text(x + 24.0, y + 4.0, "", &text);
        }
        y = top + height + 32.0;
    }
    let number = |verdict| placed.iter().filter(|h| h.verdict == verdict).count();
    for (verdict, class) in [(Verdict::Undetermined, "ring"), (Verdict::Failed, "failed")] {
        let number = number(verdict);
        if number > 0 {
            canvas.dots(
                13.0,
                &[(x + 8.0, y - 4.0)],
                &format!("class=\"dots {class}\""),
            );
            canvas.dots(7.0, &[(x + 8.0, y - 4.0)], "class=\"dots none\"");
            let text = format!("{verdict}: {}", count(number));
            canvas.text(x + 24.0, y, "", &text);
            y += 22.0;
        }
    }
    let without = |h: &&&HeliostatSummary| !h.beam_rms_mrad.is_finite();
    let unobserved = |h: &&&HeliostatSummary| h.verdict == Verdict::NotObserved;
    let all = placed.iter().filter(without).count();
    let never = placed.iter().filter(without).filter(unobserved).count();
    for (number, diameter, name) in [(all - never, 9.0, "no RMS"), (never, 5.0, "not observed")] {
        if number > 0 {
            canvas.dots(diameter, &[(x + 8.0, y - 4.0)], "class=\"dots none\"");
            canvas.text(x + 24.0, y, "", &format!("{name}: {}", count(number)));
            y += 22.0;
        }
    }
}

/// The histogram, or nothing where no heliostat has an RMS.
pub(super) fn histogram(page: &CalibrationPage) -> Option<String> {
    let most = scale(&page.field)?;
    let bins = 30;
    let mut counts = vec![[0_usize; 2]; bins];
    let mut beyond = 0;
    for h in page.field.iter().filter(|h| h.beam_rms_mrad.is_finite()) {
        let bin = (h.beam_rms_mrad / most * bins as f64).max(0.0) as usize;
        if h.beam_rms_mrad > most {
            beyond += 1;
        } else {
            counts[bin.min(bins - 1)][usize::from(h.verdict != Verdict::Determined)] += 1;
        }
    }
    let tallest = counts.iter().map(|c| c[0] + c[1]).max().unwrap_or(0).max(1);
    let place = Place {
        left: LEFT,
        top: 34.0,
        width: 640.0,
        height: 190.0,
    };
    let bottom = place.top + place.height;
    let across = Axis::new(
        (0.0, most),
        (place.left, place.left + place.width),
        "RMS of the beam, mrad",
        10,
    );
    let mut up = Axis::new(
        (0.0, 1.06 * tallest as f64),
        (bottom, place.top),
        "heliostats",
        5,
    );
    // Half a heliostat is none, and large counts read better with their thousands apart.
    up.marks.retain(|(at, _)| at.fract() == 0.0);
    for (at, text) in &mut up.marks {
        *text = count(*at as usize);
    }
    let mut canvas = Canvas::new(bottom + 44.0);
    canvas.frame(place, &across, &up);
    let width = place.width / bins as f64;
    for (i, [determined, others]) in counts.iter().enumerate() {
        let x = place.left + width * i as f64 + 0.5;
        let low = up.pixel(*determined as f64);
        let high = up.pixel((determined + others) as f64);
        if *determined > 0 {
            let size = (width - 1.0, bottom - low);
            canvas.rect(x, low, size, format_args!("class=\"f0\""));
        }
        if *others > 0 {
            let size = (width - 1.0, low - high);
            canvas.rect(x, high, size, format_args!("class=\"f1\""));
        }
    }
    let y = 16.0;
    canvas.rect(LEFT, y - 10.0, (11.0, 11.0), format_args!("class=\"f0\""));
    canvas.text(LEFT + 18.0, y, "", "determined");
    if counts.iter().any(|c| c[1] > 0) {
        let x = LEFT + 110.0;
        canvas.rect(x, y - 10.0, (11.0, 11.0), format_args!("class=\"f1\""));
        canvas.text(x + 18.0, y, "", "not determined");
    }

    let finite = || page.field.iter().map(|h| h.beam_rms_mrad);
    let x = place.left + place.width + 34.0;
    for (i, (share, name)) in [
        (0.1, "10 % below"),
        (0.5, "half below"),
        (0.9, "90 % below"),
        (1.0, "largest"),
    ]
    .into_iter()
    .enumerate()
    {
        let y = place.top + 12.0 + 24.0 * i as f64;
        let value = quantile(finite(), share).unwrap_or(f64::NAN);
        canvas.text(x, y, "soft", name);
        canvas.text(x + 150.0, y, "e", &format!("{} mrad", mrad(value)));
    }
    let mut caption = "How many heliostats have which RMS.".to_owned();
    if beyond > 0 {
        caption.push_str(&format!(
            " Beyond the right edge: {}, up to {} mrad.",
            count(beyond),
            mrad(quantile(finite(), 1.0).unwrap_or(f64::NAN))
        ));
    }
    let description = format!(
        "Half of the heliostats lie below {} mrad.",
        mrad(quantile(finite(), 0.5).unwrap_or(f64::NAN))
    );
    Some(super::page::figure(
        &canvas.element("Histogram of RMS", &description),
        &caption,
    ))
}

const _: () = assert!(LEFT + PLOT.0 + 34.0 + 180.0 < WIDTH);
