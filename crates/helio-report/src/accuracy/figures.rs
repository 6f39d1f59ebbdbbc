//! The drawings of the page.

use std::fmt::Write;

use helio_spot::accuracy::{EvaluatedFrame, SpotRow};

use super::tables::percent;
use super::{AccuracyPage, DRAWN};
use crate::calibration::dates;
use crate::calibration::plot::{Axis, Canvas, Place, count, mrad, quantile, range};
use crate::svg::{Escaped, Short};

const LEFT: f64 = 76.0;
const TOP: f64 = 22.0;
const WIDTH: f64 = 840.0;

/// A drawing that may be moved sideways on narrow screens.
fn wide(svg: &str, caption: &str) -> String {
    format!(
        "<figure>\n<div class=\"wide\">{svg}</div><figcaption>{}</figcaption>\n</figure>\n",
        Escaped(caption)
    )
}

/// Counted frames with their spots, in the order of the table.
fn counted<'a>(
    page: &'a AccuracyPage<'_>,
) -> impl Iterator<Item = (&'a SpotRow, &'a EvaluatedFrame)> + Clone {
    page.spots
        .iter()
        .zip(&page.evaluation.frames)
        .filter(|(_, frame)| frame.eta_mrad.is_some())
}

/// Every so many of counted frames is drawn.
fn stride(page: &AccuracyPage<'_>) -> (usize, usize) {
    let all = counted(page).count();
    (all, all.div_ceil(DRAWN).max(1))
}

fn drawn_words(all: usize, step: usize) -> String {
    if step > 1 {
        format!(
            " {} of {} frames are drawn, evenly chosen.",
            count(all.div_ceil(step)),
            count(all)
        )
    } else {
        String::new()
    }
}

/// Figure 3 of the standard.
pub(super) fn by_wind(page: &AccuracyPage<'_>) -> String {
    let found = page.evaluation;
    let place = Place {
        left: LEFT,
        top: TOP,
        width: WIDTH,
        height: 300.0,
    };
    let mut canvas = Canvas::new(TOP + 300.0 + 46.0);
    let fastest = found.histogram.last().map_or(14.0, |bin| bin.to_m_s);
    if !found.histogram.iter().any(|bin| bin.frames > 0) {
        canvas.nothing(place, "no counted frame has a wind speed");
    } else {
        let across = Axis::new(
            (0.0, fastest),
            (place.left, place.left + place.width),
            "wind speed, m/s",
            15,
        );
        let angle = page.limits.angle_mrad;
        let up = Axis::new(
            (0.0, 105.0),
            (place.top + place.height, place.top),
            &format!("frames within {angle} mrad, %"),
            6,
        );
        canvas.frame(place, &across, &up);
        for bin in &found.histogram {
            let Some(share) = bin.share else { continue };
            let (x, end) = (across.pixel(bin.from_m_s), across.pixel(bin.to_m_s));
            let gap = 0.12 * (end - x);
            let (top, bottom) = (up.pixel(100.0 * share), up.pixel(0.0));
            let size = (end - x - 2.0 * gap, bottom - top);
            canvas.rect(x + gap, top, size, format_args!("class=\"col\""));
            let middle = 0.5 * (x + end);
            whisker(&mut canvas, middle, &up, bin.interval, 4.0, "whisker");
        }
        for (k, judged) in found.judged.iter().enumerate() {
            let (limit, bin) = (judged.limit, &judged.bin);
            let half = page.options.bin_half_width_m_s;
            let y = up.pixel(100.0 * limit.share);
            let ends = [limit.wind_m_s - half, limit.wind_m_s + half];
            let [from, to] = ends.map(|wind| across.pixel_inside(wind));
            canvas.line((from, y), (to, y), "limit");
            if let Some(share) = bin.share {
                // beside the bar of the same wind
                let x = across.pixel_inside(limit.wind_m_s);
                let open = [(x, up.pixel(100.0 * share))];
                whisker(&mut canvas, x, &up, bin.interval, 7.0, "s1 whisker");
                canvas.dots(7.0, &open, "class=\"dots s1\"");
            }
            let below = if k == 0 { 15.0 } else { -6.0 };
            let text = format!("limit > {}", percent(limit.share, 0));
            canvas.text(to + 4.0, y + below, "small", &text);
        }
    }
    let caption = format!(
        "Figure 3 of the standard: share of frames within {} mrad by wind speed. Bars: bins of {} m/s; lines \
         through their ends: {} intervals. Orange: frames within ± {} m/s of the wind speeds that are judged, and their \
         intervals. Red: the limits.",
        page.limits.angle_mrad,
        page.options.histogram_step_m_s,
        percent(page.options.confidence, 0),
        page.options.bin_half_width_m_s
    );
    let described: Vec<String> = found
        .judged
        .iter()
        .map(|judged| {
            let share = judged
                .bin
                .share
                .map_or("no frames".to_owned(), |s| percent(s, 1));
            format!("{} m/s: {share}", judged.limit.wind_m_s)
        })
        .collect();
    wide(
        &canvas.element("Shares by wind speed", &described.join(", ")),
        &caption,
    )
}

fn whisker(canvas: &mut Canvas, x: f64, up: &Axis, ends: [f64; 2], arm: f64, class: &str) {
    let [low, high] = ends.map(|end| up.pixel(100.0 * end));
    canvas.line((x, low), (x, high), class);
    for y in [low, high] {
        canvas.line((x - arm, y), (x + arm, y), class);
    }
}

/// Spots on the target.
pub(super) fn scatter(page: &AccuracyPage<'_>) -> String {
    let side = 520.0;
    let place = Place {
        left: LEFT + 60.0,
        top: TOP,
        width: side,
        height: side,
    };
    let mut canvas = Canvas::new(TOP + side + 46.0);
    let (all, step) = stride(page);
    let aim = page.setup.aim_m;
    let radius = page.limits.angle_mrad * 1e-3 * page.setup.slant_m;
    let spots = || counted(page).filter_map(|(row, _)| row.spot_m);
    let circle = [
        [aim[0] - 1.1 * radius, aim[1] - 1.1 * radius],
        [aim[0] + 1.1 * radius, aim[1] + 1.1 * radius],
    ];
    let points = || spots().chain(circle);
    let ranges = [0, 1].map(|k| range(points().map(move |p| p[k]), 0.03, 0.01));
    if let (Some(mean), [Some(right), Some(down)]) = (
        page.evaluation.figures.map(|figures| figures.mean_m),
        ranges,
    ) {
        let half = 0.5 * (right.1 - right.0).max(down.1 - down.0);
        let around = |(min, max): (f64, f64)| (0.5 * (min + max) - half, 0.5 * (min + max) + half);
        let across = Axis::new(
            around(right),
            (place.left, place.left + side),
            "right on the target, m",
            6,
        );
        let up = Axis::new(
            around(down),
            (place.top, place.top + side),
            "down on the target, m",
            6,
        );
        canvas.frame(place, &across, &up);
        let dots: Vec<(f64, f64)> = spots()
            .step_by(step)
            .map(|p| (across.pixel(p[0]), up.pixel(p[1])))
            .collect();
        let diameter = if dots.len() > 1000 { 2.2 } else { 3.6 };
        canvas.dots(diameter, &dots, "class=\"dots s0\" stroke-opacity=\".55\"");
        let (x, y) = (across.pixel(aim[0]), up.pixel(aim[1]));
        let r = across.pixel(aim[0] + radius) - x;
        let (cx, cy, r) = (Short(x), Short(y), Short(r));
        canvas.raw(format_args!(
            "<circle cx=\"{cx}\" cy=\"{cy}\" r=\"{r}\" class=\"outline\" stroke=\"var(--bad)\" stroke-width=\"1.5\"/>"
        ));
        canvas.line((x - 9.0, y), (x + 9.0, y), "limit");
        canvas.line((x, y - 9.0), (x, y + 9.0), "limit");
        canvas.crosses(6.0, &[(across.pixel(mean[0]), up.pixel(mean[1]))], "scale");
    } else {
        canvas.nothing(place, "no frame was counted");
    }
    let caption = format!(
        "Spots on the target as a camera facing it sees them. Red cross: aim point; dashed circle: {} mrad by formula \
         (1), {:.3} m. Oblique cross: mean spot.{}",
        page.limits.angle_mrad,
        radius,
        drawn_words(all, step)
    );
    let description = format!("{all} spots");
    wide(
        &canvas.element("Spots on the target", &description),
        &caption,
    )
}

/// Errors and wind over time.
pub(super) fn over_time(page: &AccuracyPage<'_>) -> String {
    let (all, step) = stride(page);
    let mut canvas = Canvas::new(TOP + 200.0 + 26.0 + 110.0 + 46.0);
    let place = Place {
        left: LEFT,
        top: TOP,
        width: WIDTH,
        height: 200.0,
    };
    let lower = Place {
        top: TOP + 226.0,
        height: 110.0,
        ..place
    };
    let rows: Vec<(i64, f64, f64)> = counted(page)
        .step_by(step)
        .filter_map(|(row, frame)| {
            let wind = frame.wind_m_s.unwrap_or(f64::NAN);
            Some((row.unix_ns?, frame.eta_mrad?, wind))
        })
        .collect();
    let top = quantile(rows.iter().map(|row| row.1), 1.0);
    let span = page.evaluation.counted_ns;
    let (Some([from, to]), Some(top)) = (span, top) else {
        canvas.nothing(place, "no frame was counted");
        return wide(
            &canvas.element("Errors over time", "nothing"),
            "Errors over time.",
        );
    };
    // one frame alone stands in the middle of a second
    let (from, to) = if from == to {
        (
            from.saturating_sub(500_000_000),
            to.saturating_add(500_000_000),
        )
    } else {
        (from, to)
    };
    let across = |name: &str, marks: bool| {
        let seconds = (to as f64 - from as f64) * 1e-9;
        let mut axis = Axis::new((0.0, seconds), (LEFT, LEFT + WIDTH), name, 8);
        let (at, label) = dates::ticks(from, to);
        axis.marks = at
            .into_iter()
            .map(|(ns, text)| ((ns - from) as f64 * 1e-9, text))
            .collect();
        if marks {
            axis.name = label;
        } else {
            for (_, text) in &mut axis.marks {
                text.clear();
            }
        }
        axis
    };
    let limit = page.limits.angle_mrad;
    let up = Axis::new(
        (0.0, 1.05 * top.max(limit)),
        (place.top + place.height, place.top),
        "error, mrad",
        5,
    );
    let bare = across("", false);
    canvas.frame(place, &bare, &up);
    let second = |ns: i64| bare.pixel((ns - from) as f64 * 1e-9);
    let dots = |value: fn(&(i64, f64, f64)) -> f64, up: &Axis| -> Vec<(f64, f64)> {
        rows.iter()
            .filter(|row| value(row).is_finite())
            .map(|row| (second(row.0), up.pixel(value(row))))
            .collect()
    };
    let size = if rows.len() > 1500 { 2.0 } else { 3.0 };
    let class = "stroke-opacity=\".6\"";
    canvas.dots(
        size,
        &dots(|row| row.1, &up),
        &format!("class=\"dots s0\" {class}"),
    );
    let y = up.pixel(limit);
    canvas.line((LEFT, y), (LEFT + WIDTH, y), "bound");
    canvas.text(
        LEFT + WIDTH - 4.0,
        y - 5.0,
        "e small",
        &format!("{limit} mrad"),
    );

    let strongest = quantile(rows.iter().map(|row| row.2), 1.0);
    let below = across("", true);
    match strongest {
        Some(strongest) => {
            let up = Axis::new(
                (0.0, 1.08 * strongest.max(1.0)),
                (lower.top + lower.height, lower.top),
                "wind, m/s",
                4,
            );
            canvas.frame(lower, &below, &up);
            canvas.dots(size, &dots(|row| row.2, &up), "class=\"dots s2\"");
        }
        None => canvas.nothing(lower, "no wind was recorded"),
    }
    let caption = format!(
        "Error of each counted frame by formula (1), and the wind at its time. Dashed: {limit} mrad.{}",
        drawn_words(all, step)
    );
    let description = format!("{all} frames, up to {} mrad", mrad(top));
    wide(&canvas.element("Errors over time", &description), &caption)
}

/// How many frames have which error.
pub(super) fn histogram(page: &AccuracyPage<'_>) -> String {
    let place = Place {
        left: LEFT,
        top: TOP,
        width: WIDTH,
        height: 200.0,
    };
    let mut canvas = Canvas::new(TOP + 200.0 + 46.0);
    let etas: Vec<f64> = counted(page)
        .filter_map(|(_, frame)| frame.eta_mrad)
        .collect();
    let limit = page.limits.angle_mrad;
    let Some(top) = quantile(etas.iter().copied(), 1.0) else {
        canvas.nothing(place, "no frame was counted");
        return wide(
            &canvas.element("Errors", "nothing"),
            "Errors of the counted frames.",
        );
    };
    // a step that divides the limit, so that no bar lies on both sides of it
    let reach = top.max(1.2 * limit);
    let parts = (60.0 * limit / reach).floor().max(1.0);
    let step = limit / parts;
    let bars = ((reach / step).ceil() as usize).clamp(1, 2000);
    let mut counts = vec![0_usize; bars + 1];
    for eta in &etas {
        // the limit itself is within
        let bar = (eta / step).ceil() as usize;
        counts[bar.saturating_sub(1).min(bars)] += 1;
    }
    let most = counts.iter().copied().max().unwrap_or(0);
    let across = Axis::new(
        (0.0, bars as f64 * step),
        (LEFT, LEFT + WIDTH),
        "error by formula (1), mrad",
        10,
    );
    let up = Axis::new(
        (0.0, 1.05 * most.max(1) as f64),
        (place.top + place.height, place.top),
        "frames",
        5,
    );
    canvas.frame(place, &across, &up);
    for (bar, &number) in counts.iter().enumerate().filter(|(_, number)| **number > 0) {
        let (x, end) = (
            across.pixel(bar as f64 * step),
            across.pixel((bar + 1) as f64 * step),
        );
        let (y, bottom) = (up.pixel(number as f64), up.pixel(0.0));
        let class = if (bar as f64 + 0.5) * step > limit {
            "col beyond"
        } else {
            "col"
        };
        let size = ((end - x - 1.0).max(0.5), bottom - y);
        canvas.rect(x + 0.5, y, size, format_args!("class=\"{class}\""));
    }
    let x = across.pixel(limit);
    canvas.line((x, place.top), (x, place.top + place.height), "bound");
    let within = etas.iter().filter(|eta| **eta <= limit).count();
    let mut caption = String::from("Errors of the counted frames. ");
    let _ = write!(
        caption,
        "Dashed: {limit} mrad, within which {} lie.",
        percent(within as f64 / etas.len() as f64, 2)
    );
    wide(
        &canvas.element("Errors of the counted frames", &caption),
        &caption,
    )
}
