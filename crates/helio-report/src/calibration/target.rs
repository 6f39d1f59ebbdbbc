//! Spots on the target: where the parameters before and the fit put them, and where they were.

use std::fmt::Write;

use super::plot::{Axis, COLOURS, Canvas, Place, WIDTH, mrad, quantile, range};
use super::{HeliostatSection, Record, TargetOutline};
use crate::svg::Short;

/// More arrows than this are not told apart.
const MOST_ARROWS: usize = 400;
const SIDE: f64 = 390.0;
const TOP: f64 = 58.0;
const LEFT: [f64; 2] = [62.0, 532.0];

/// The figure, or nothing where there are no records.
pub(super) fn figure(section: &HeliostatSection, outlines: &[TargetOutline]) -> Option<String> {
    let names = target_names(&section.records);
    let step = section.records.len().div_ceil(MOST_ARROWS).max(1);
    let shown: Vec<&Record> = section
        .records
        .iter()
        .step_by(step)
        .filter(|r| r.measured_m.iter().all(|m| m.is_finite()))
        .collect();
    if shown.is_empty() {
        return None;
    }
    let legend_lines = names.len().min(COLOURS).div_ceil(4) as f64;
    let mut canvas = Canvas::new(TOP + SIDE + 62.0 + 18.0 * legend_lines);
    let outlines: Vec<(usize, [f64; 2])> = outlines
        .iter()
        .filter_map(|o| Some((names.iter().position(|n| *n == o.name)?, o.size_m?)))
        .filter(|(_, size)| size.iter().all(|s| s.is_finite() && *s > 0.0))
        .collect();

    let far = before(&mut canvas, &shown, &names, &outlines);
    let scale = after(&mut canvas, &shown, &names, &outlines);

    let y = TOP + SIDE + 58.0;
    for (i, name) in names.iter().enumerate().take(COLOURS) {
        let name = if i + 1 == COLOURS && names.len() > COLOURS {
            "other targets"
        } else {
            name
        };
        let (x, y) = (LEFT[0] + 220.0 * (i % 4) as f64, y + 18.0 * (i / 4) as f64);
        canvas.line((x, y - 4.0), (x + 18.0, y - 4.0), &format!("arrow s{i}"));
        canvas.text(x + 24.0, y, "", name);
    }
    let mut caption = format!(
        "On the target, right and down as a camera facing it sees them. Left: from where the parameters before put each spot \
         to where it was measured, true to scale. Right: the same after the fit, {scale}."
    );
    if section.records.iter().any(|r| r.rejected.is_some()) {
        caption.push_str(" Crosses: rejected records.");
    }
    if far > 0 {
        let _ = write!(
            caption,
            " Not all of the left picture's arrows begin inside it: {far} come from outside, or their beams miss the target."
        );
    }
    if step > 1 {
        let _ = write!(
            caption,
            " {} of {} records are drawn, evenly chosen.",
            shown.len(),
            section.records.len()
        );
    }
    let title = format!("Heliostat {}: spots on the target", section.id);
    let description = format!(
        "{} records; RMS of the beam {} mrad before, {} mrad after.",
        section.records.len(),
        mrad(section.before_rms_mrad),
        mrad(section.after_rms_mrad)
    );
    Some(super::page::figure(
        &canvas.element(&title, &description),
        &caption,
    ))
}

/// Names of targets in order of appearance.
fn target_names(records: &[Record]) -> Vec<&str> {
    let mut names: Vec<&str> = Vec::new();
    for record in records {
        if !names.contains(&record.target.as_str()) {
            names.push(&record.target);
        }
    }
    names
}

fn colour(record: &Record, names: &[&str]) -> usize {
    let place = names.iter().position(|n| *n == record.target).unwrap_or(0);
    place.min(COLOURS - 1)
}

fn place(panel: usize) -> Place {
    Place {
        left: LEFT[panel],
        top: TOP,
        width: SIDE,
        height: SIDE,
    }
}

/// Axes of equal scale that hold some points.
fn axes(panel: usize, points: &[[f64; 2]]) -> Option<[Axis; 2]> {
    let right = range(points.iter().map(|p| p[0]), 0.08, 0.1)?;
    let down = range(points.iter().map(|p| p[1]), 0.08, 0.1)?;
    let half = 0.5 * (right.1 - right.0).max(down.1 - down.0);
    let around = |(min, max): (f64, f64)| {
        let middle = 0.5 * (min + max);
        (middle - half, middle + half)
    };
    let p = place(panel);
    Some([
        Axis::new(
            around(right),
            (p.left, p.left + p.width),
            "right on the target, m",
            6,
        ),
        Axis::new(
            around(down),
            (p.top, p.top + p.height),
            "down on the target, m",
            6,
        ),
    ])
}

/// Corners of the outlines, so that they are in the picture.
fn corners(outlines: &[(usize, [f64; 2])]) -> impl Iterator<Item = [f64; 2]> + '_ {
    outlines
        .iter()
        .flat_map(|(_, [w, h])| [[-0.5 * w, -0.5 * h], [0.5 * w, 0.5 * h]])
}

fn draw_outlines(canvas: &mut Canvas, [right, down]: &[Axis; 2], outlines: &[(usize, [f64; 2])]) {
    for (i, [w, h]) in outlines {
        let (x, y) = (right.pixel(-0.5 * w), down.pixel(-0.5 * h));
        let size = (right.pixel(0.5 * w) - x, down.pixel(0.5 * h) - y);
        let class = (*i).min(COLOURS - 1);
        canvas.rect(x, y, size, format_args!("class=\"outline s{class}\""));
    }
    let (x, y) = (right.pixel(0.0), down.pixel(0.0));
    canvas.line((x - 7.0, y), (x + 7.0, y), "axis");
    canvas.line((x, y - 7.0), (x, y + 7.0), "axis");
}

/// Draws the left panel; gives how many arrows do not begin in it.
fn before(
    canvas: &mut Canvas,
    shown: &[&Record],
    names: &[&str],
    outlines: &[(usize, [f64; 2])],
) -> usize {
    canvas.text(LEFT[0], TOP - 12.0, "name", "Before the fit");
    let lengths = |r: &Record| distance(r.before_m, r.measured_m);
    let arrows: Vec<&Record> = shown
        .iter()
        .copied()
        .filter(|r| lengths(r).is_finite())
        .collect();
    // A few wild predictions must not make the others invisible.
    let typical = quantile(arrows.iter().map(|r| lengths(r)), 0.5);
    let near = |r: &Record| typical.is_some_and(|t| lengths(r) <= 8.0 * t);
    let points: Vec<[f64; 2]> = shown
        .iter()
        .map(|r| r.measured_m)
        .chain(arrows.iter().filter(|r| near(r)).map(|r| r.before_m))
        .chain([[0.0; 2]])
        .collect();
    // The whole target is in the picture as long as that leaves something to see.
    let far = |points: &[[f64; 2]]| {
        let all = points.iter().flatten();
        all.fold(0.0, |most: f64, m| most.max(m.abs()))
    };
    let corners: Vec<[f64; 2]> = corners(outlines).collect();
    let whole = far(&corners) <= 2.0 * far(&points);
    let points: Vec<[f64; 2]> = points
        .into_iter()
        .chain(corners.into_iter().filter(|_| whole))
        .collect();
    let Some(axes) = axes(0, &points) else {
        canvas.nothing(place(0), "no finite numbers");
        return 0;
    };
    canvas.frame(place(0), &axes[0], &axes[1]);
    canvas.clipped(place(0), |canvas| {
        draw_outlines(canvas, &axes, outlines);
        draw_arrows(canvas, &axes, &arrows, names, 1.0, |r| r.before_m);
        draw_rejected(canvas, &axes, shown);
    });
    let outside = |p: [f64; 2]| !(axes[0].contains(p[0]) && axes[1].contains(p[1]));
    shown.len() - arrows.iter().filter(|r| !outside(r.before_m)).count()
}

/// Draws the right panel; gives the words for its exaggeration.
fn after(
    canvas: &mut Canvas,
    shown: &[&Record],
    names: &[&str],
    outlines: &[(usize, [f64; 2])],
) -> String {
    let arrows: Vec<&Record> = shown
        .iter()
        .copied()
        .filter(|r| r.rejected.is_none() && distance(r.after_m, r.measured_m).is_finite())
        .collect();
    // Only as far as the spots lie, so that small differences are seen.
    let points: Vec<[f64; 2]> = shown
        .iter()
        .map(|r| r.measured_m)
        .chain([[0.0; 2]])
        .collect();
    let Some(axes) = axes(1, &points) else {
        canvas.nothing(place(1), "no finite numbers");
        return "not drawn".to_owned();
    };
    // So much that the typical arrow takes a twelfth of the picture.
    let span = axes[0].max - axes[0].min;
    let typical = quantile(
        arrows.iter().map(|r| distance(r.after_m, r.measured_m)),
        0.5,
    );
    let wanted = typical.map_or(1.0, |t| span / 12.0 / t.max(1e-12));
    let factor = [1.0, 2.0, 5.0, 10.0, 20.0, 50.0, 100.0, 200.0, 500.0, 1000.0]
        .into_iter()
        .rfind(|f| *f <= wanted)
        .unwrap_or(1.0);
    let heading = if factor > 1.0 {
        format!("After the fit, differences \u{d7} {factor}")
    } else {
        "After the fit".to_owned()
    };
    canvas.text(LEFT[1], TOP - 12.0, "name", &heading);
    canvas.frame(place(1), &axes[0], &axes[1]);
    canvas.clipped(place(1), |canvas| {
        draw_outlines(canvas, &axes, outlines);
        draw_arrows(canvas, &axes, &arrows, names, factor, |r| r.after_m);
        draw_rejected(canvas, &axes, shown);
    });
    if arrows.is_empty() {
        let p = place(1);
        let why = "nothing was fitted";
        canvas.text(p.left + p.width / 2.0, p.top + 20.0, "m soft", why);
        return "not drawn".to_owned();
    }
    // How long an arrow of a milliradian is, for the distance of the typical record.
    let per_mrad = quantile(
        arrows
            .iter()
            .map(|r| distance(r.after_m, r.measured_m) / r.after_mrad),
        0.5,
    );
    if let Some(metres) = per_mrad.filter(|m| *m > 0.0) {
        let (nice, length) = [0.01, 0.02, 0.05, 0.1, 0.2, 0.5, 1.0, 2.0, 5.0, 10.0, 20.0]
            .map(|nice| (nice, nice * metres * factor / span * SIDE))
            .into_iter()
            .find(|(_, length)| *length >= 24.0)
            .unwrap_or((50.0, 50.0 * metres * factor / span * SIDE));
        let right = LEFT[1] + SIDE;
        if length < 150.0 {
            canvas.line((right - length, TOP - 16.0), (right, TOP - 16.0), "scale");
            let text = format!("about {nice} mrad");
            canvas.text(right - length - 6.0, TOP - 12.0, "e soft", &text);
        }
    }
    if factor > 1.0 {
        format!("differences drawn {factor} times as long")
    } else {
        "true to scale".to_owned()
    }
}

fn distance(from: [f64; 2], to: [f64; 2]) -> f64 {
    (from[0] - to[0]).hypot(from[1] - to[1])
}

/// Arrows to the measured spots, those of one colour as one path.
fn draw_arrows(
    canvas: &mut Canvas,
    [right, down]: &[Axis; 2],
    records: &[&Record],
    names: &[&str],
    factor: f64,
    from: impl Fn(&Record) -> [f64; 2],
) {
    let mut paths = vec![String::new(); COLOURS];
    let mut heads: Vec<Vec<(f64, f64)>> = vec![Vec::new(); COLOURS];
    // A tail may lie kilometres away: far outside is as good.
    let clamp = |v: f64| v.clamp(-1e5, 1e5);
    for record in records {
        let (to, from) = (record.measured_m, from(record));
        let head = (right.pixel(to[0]), down.pixel(to[1]));
        let tail = (
            clamp(right.pixel(to[0] + factor * (from[0] - to[0]))),
            clamp(down.pixel(to[1] + factor * (from[1] - to[1]))),
        );
        let (x, y) = (head.0 - tail.0, head.1 - tail.1);
        let length = x.hypot(y);
        let i = colour(record, names);
        heads[i].push(head);
        if length < 1.0 {
            continue;
        }
        let barb = 5.0_f64.min(0.5 * length) / length;
        let _ = write!(
            paths[i],
            "M{} {}L{} {}m{} {}L{} {}L{} {}",
            Short(tail.0),
            Short(tail.1),
            Short(head.0),
            Short(head.1),
            Short(barb * (-x + 0.5 * y)),
            Short(barb * (-y - 0.5 * x)),
            Short(head.0),
            Short(head.1),
            Short(head.0 + barb * (-x - 0.5 * y)),
            Short(head.1 + barb * (-y + 0.5 * x)),
        );
    }
    for (i, path) in paths.iter().enumerate() {
        if !path.is_empty() {
            canvas.raw(format_args!("<path d=\"{path}\" class=\"arrow s{i}\"/>"));
        }
        canvas.dots(2.4, &heads[i], &format!("class=\"dots s{i}\""));
    }
}

fn draw_rejected(canvas: &mut Canvas, [right, down]: &[Axis; 2], records: &[&Record]) {
    let at: Vec<(f64, f64)> = records
        .iter()
        .filter(|r| r.rejected.is_some())
        .map(|r| (right.pixel(r.measured_m[0]), down.pixel(r.measured_m[1])))
        .collect();
    canvas.crosses(4.0, &at, "bad");
}

const _: () = assert!(LEFT[1] + SIDE < WIDTH);
