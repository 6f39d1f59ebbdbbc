//! Angles of a few heliostats over time.

use std::fmt::Write;

use crate::svg::{Figure, Short};
use crate::ticks::{at_steps, label, ticks};
use crate::{FigureError, equal, palette};

/// What runs to the right.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum CurveAxis<'a> {
    /// Time, labelled by the clock of an offset from UTC.
    Time {
        /// Offset \[s\], east positive.
        offset_s: i32,
        /// What to call it.
        name: &'a str,
    },
    /// The number of the sun in a list.
    Row,
}

/// The angles of one heliostat; NaN where there is none.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Curve<'a> {
    /// Its name.
    pub id: &'a str,
    /// First axis \[deg\].
    pub axis1_deg: &'a [f64],
    /// Second axis \[deg\].
    pub axis2_deg: &'a [f64],
    /// Incidence \[deg\].
    pub incidence_deg: &'a [f64],
}

/// What the curves show.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct AngleCurves<'a> {
    /// Heading.
    pub title: &'a str,
    /// What runs to the right.
    pub axis: CurveAxis<'a>,
    /// Where each sun stands along it: Unix time \[ns\], or its number.
    pub at: &'a [i64],
    /// The heliostats.
    pub curves: &'a [Curve<'a>],
    /// True if axis 1 starts over after a full turn: a jump of half a turn then breaks its curve.
    pub axis1_turns: bool,
    /// What to call the two axes.
    pub axis_names: [&'a str; 2],
}

const LEFT: f64 = 64.0;
const TOP: f64 = 44.0;
const PLOT_WIDTH: f64 = 660.0;
const PANEL: f64 = 180.0;
const GAP: f64 = 24.0;
const WIDTH: f64 = 860.0;

/// Draws axis 1, axis 2 and incidence of some heliostats below each other.
///
/// # Errors
/// [`FigureError`] if columns differ in length or there is nothing to draw. For an example see
/// [`Figure::to_svg`].
pub fn angle_curves(curves: &AngleCurves<'_>) -> Result<Figure, FigureError> {
    let n = curves.at.len();
    for curve in curves.curves {
        equal("axis1_deg", n, curve.axis1_deg.len())?;
        equal("axis2_deg", n, curve.axis2_deg.len())?;
        equal("incidence_deg", n, curve.incidence_deg.len())?;
    }
    let (Some(&from), Some(&to)) = (curves.at.iter().min(), curves.at.iter().max()) else {
        return Err(FigureError::Empty { what: "sun" });
    };
    if curves.curves.is_empty() {
        return Err(FigureError::Empty { what: "heliostat" });
    }
    let mut figure = Figure::new(WIDTH, TOP + 3.0 * (PANEL + GAP) + 30.0);
    figure.text(
        LEFT,
        26.0,
        "font-size=\"16\" font-weight=\"600\"",
        curves.title,
    );
    let across = Across::new(curves.axis, from, to);
    let turns = [curves.axis1_turns, false, false];
    let names = [curves.axis_names[0], curves.axis_names[1], "incidence"];
    for panel in 0..3 {
        let columns: Vec<&[f64]> = curves
            .curves
            .iter()
            .map(|c| [c.axis1_deg, c.axis2_deg, c.incidence_deg][panel])
            .collect();
        let top = TOP + panel as f64 * (PANEL + GAP);
        draw_panel(
            &mut figure,
            top,
            names[panel],
            turns[panel],
            &across,
            curves.at,
            &columns,
        );
    }
    let bottom = TOP + 3.0 * PANEL + 2.0 * GAP;
    for (at, text) in &across.labels {
        figure.text(
            across.pixel(*at),
            bottom + 16.0,
            "text-anchor=\"middle\"",
            text,
        );
    }
    let name = match curves.axis {
        CurveAxis::Time { name, .. } => name,
        CurveAxis::Row => "sun, in the order given",
    };
    figure.text(
        LEFT + PLOT_WIDTH / 2.0,
        bottom + 36.0,
        "text-anchor=\"middle\"",
        name,
    );
    for (i, curve) in curves.curves.iter().enumerate() {
        let y = TOP + 12.0 + 20.0 * i as f64;
        let x = LEFT + PLOT_WIDTH + 20.0;
        let colour = palette::CURVES[i % palette::CURVES.len()];
        let (x1, x2, at) = (Short(x), Short(x + 18.0), Short(y - 4.0));
        let dash = dash(i);
        figure.raw(format_args!(
            "<path d=\"M{x1} {at}H{x2}\" stroke=\"{colour}\" stroke-width=\"2\"{dash}/>"
        ));
        figure.text(x + 24.0, y, "", curve.id);
    }
    Ok(figure)
}

/// Curves past the last colour are dashed.
fn dash(curve: usize) -> &'static str {
    ["", " stroke-dasharray=\"6 3\"", " stroke-dasharray=\"2 2\""]
        [(curve / palette::CURVES.len()).min(2)]
}

/// The axis to the right.
struct Across {
    from: i64,
    span: f64,
    labels: Vec<(i64, String)>,
}

impl Across {
    fn new(axis: CurveAxis<'_>, from: i64, to: i64) -> Self {
        let span = (to as f64 - from as f64).max(1.0);
        let labels = match axis {
            CurveAxis::Time { offset_s, .. } => clock_labels(from, to, offset_s),
            CurveAxis::Row => ticks(from as f64, to as f64, 10)
                .into_iter()
                .filter(|t| t.fract() == 0.0)
                .map(|t| (t as i64, format!("{}", t as i64 + 1)))
                .collect(),
        };
        Self { from, span, labels }
    }

    fn pixel(&self, at: i64) -> f64 {
        LEFT + (at as f64 - self.from as f64) / self.span * PLOT_WIDTH
    }
}

/// Round times of the local clock within a range.
fn clock_labels(from: i64, to: i64, offset_s: i32) -> Vec<(i64, String)> {
    const SECOND: i64 = 1_000_000_000;
    let span_s = (to as f64 - from as f64) / SECOND as f64;
    let step_s = [
        1, 2, 5, 10, 30, 60, 120, 300, 600, 1800, 3600, 7200, 10_800, 21_600, 43_200, 86_400,
    ]
    .into_iter()
    .find(|&step| span_s / f64::from(step) <= 10.0)
    .unwrap_or_else(|| 86_400 * (span_s / 864_000.0).ceil().min(1e6) as i32);
    let step_s = i64::from(step_s);
    let local = |unix_ns: i64| unix_ns.div_euclid(SECOND) + i64::from(offset_s);
    let first = local(from).div_euclid(step_s);
    (first..=first + 12)
        .filter_map(|k| {
            let clock = k * step_s;
            let unix_ns = (clock - i64::from(offset_s)).checked_mul(SECOND)?;
            let day_s = clock.rem_euclid(86_400);
            let (h, m, s) = (day_s / 3600, day_s / 60 % 60, day_s % 60);
            let text = if step_s < 60 {
                format!("{h:02}:{m:02}:{s:02}")
            } else {
                format!("{h:02}:{m:02}")
            };
            (from..=to).contains(&unix_ns).then_some((unix_ns, text))
        })
        .collect()
}

fn draw_panel(
    figure: &mut Figure,
    top: f64,
    name: &str,
    turns: bool,
    across: &Across,
    at: &[i64],
    columns: &[&[f64]],
) {
    let finite = || {
        columns
            .iter()
            .flat_map(|c| c.iter().copied())
            .filter(|v| v.is_finite())
    };
    let mut min = finite().fold(f64::INFINITY, f64::min);
    let mut max = finite().fold(f64::NEG_INFINITY, f64::max);
    let empty = min > max;
    if empty {
        (min, max) = (0.0, 1.0);
    }
    let margin = (0.05 * (max - min)).max(0.5);
    (min, max) = (min - margin, max + margin);
    let pixel = |value: f64| top + PANEL * (max - value) / (max - min);
    let marks = if max - min > 200.0 {
        at_steps(min, max, 90.0)
    } else {
        ticks(min, max, 5)
    };
    for &mark in &marks {
        let y = pixel(mark);
        figure.line((LEFT, y), (LEFT + PLOT_WIDTH, y), "#e8e8e8");
        if !empty {
            let text = format!("{}°", label(mark, &marks));
            figure.text(LEFT - 6.0, y + 4.0, "text-anchor=\"end\"", &text);
        }
    }
    for (mark, _) in &across.labels {
        let x = across.pixel(*mark);
        figure.line((x, top), (x, top + PANEL), "#e8e8e8");
    }
    figure.rect(
        LEFT,
        top,
        (PLOT_WIDTH, PANEL),
        "fill=\"none\" stroke=\"#888\"",
    );
    if empty {
        let (x, y) = (LEFT + PLOT_WIDTH / 2.0, top + PANEL / 2.0);
        figure.text(
            x,
            y,
            "text-anchor=\"middle\" fill=\"#777\"",
            "no angle in this time",
        );
    }
    for (i, column) in columns.iter().enumerate() {
        let path = path(column, at, turns, across, pixel);
        if path.is_empty() {
            continue;
        }
        let colour = palette::CURVES[i % palette::CURVES.len()];
        let dash = dash(i);
        figure.raw(format_args!(
            "<path d=\"{path}\" fill=\"none\" stroke=\"{colour}\" stroke-width=\"1.5\" \
             stroke-linejoin=\"round\" stroke-linecap=\"round\"{dash}/>"
        ));
    }
    // Last and with a rim of paper, so that no curve runs through it.
    let rim = "font-weight=\"600\" paint-order=\"stroke\" stroke=\"#fff\" stroke-width=\"4\"";
    figure.text(LEFT + 8.0, top + 16.0, rim, name);
}

/// The stretches of a column that have values, at most two points per pixel.
fn path(
    column: &[f64],
    at: &[i64],
    turns: bool,
    across: &Across,
    pixel: impl Fn(f64) -> f64,
) -> String {
    let mut path = String::new();
    let mut last: Option<(f64, f64, f64)> = None;
    for (row, (&value, &at)) in column.iter().zip(at).enumerate() {
        if !value.is_finite() {
            last = None;
            continue;
        }
        let (x, y) = (across.pixel(at), pixel(value));
        match last {
            Some((_, _, before)) if turns && (value - before).abs() > 180.0 => {
                let _ = write!(path, "M{} {}h0", Short(x), Short(y));
            }
            None => {
                let _ = write!(path, "M{} {}h0", Short(x), Short(y));
            }
            Some((last_x, last_y, _)) => {
                let ends = column.get(row + 1).is_none_or(|next| {
                    !next.is_finite() || (turns && (next - value).abs() > 180.0)
                });
                if !ends && (x - last_x).abs() < 0.5 && (y - last_y).abs() < 0.5 {
                    // Too near to see, but a turn is judged from the value before.
                    last = Some((last_x, last_y, value));
                    continue;
                }
                let _ = write!(path, "L{} {}", Short(x), Short(y));
            }
        }
        last = Some((x, y, value));
    }
    path
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_day_is_labelled_by_the_local_clock_and_breaks_at_north() {
        let n = 8641;
        let at: Vec<i64> = (0..n)
            .map(|i| 1_750_456_800_000_000_000 + i * 10_000_000_000)
            .collect();
        let axis1_deg: Vec<f64> = (0..n).map(|i| (300.0 + i as f64 / 48.0) % 360.0).collect();
        let gap: Vec<f64> = (0..n)
            .map(|i| {
                if (4000..5000).contains(&i) {
                    f64::NAN
                } else {
                    10.0
                }
            })
            .collect();
        let figure = angle_curves(&AngleCurves {
            title: "A day",
            axis: CurveAxis::Time {
                offset_s: 7200,
                name: "time (UTC+02:00)",
            },
            at: &at,
            curves: &[Curve {
                id: "A<1>",
                axis1_deg: &axis1_deg,
                axis2_deg: &gap,
                incidence_deg: &gap,
            }],
            axis1_turns: true,
            axis_names: ["azimuth", "elevation"],
        });
        let svg = figure.unwrap().to_svg();
        assert!(svg.contains(">12:00<") && svg.contains("UTC+02:00") && svg.contains("A&lt;1&gt;"));
        assert_eq!(svg.matches("h0").count(), 6, "each curve in two stretches");
        assert!(svg.len() < 60_000, "{}", svg.len());
    }

    #[test]
    fn a_single_sun_and_a_night_are_drawn() {
        for value in [20.0, f64::NAN] {
            let column = [value];
            let curve = Curve {
                id: "A1",
                axis1_deg: &column,
                axis2_deg: &column,
                incidence_deg: &column,
            };
            let figure = angle_curves(&AngleCurves {
                title: "",
                axis: CurveAxis::Row,
                at: &[0],
                curves: &[curve],
                axis1_turns: true,
                axis_names: ["axis 1", "axis 2"],
            });
            assert!(!figure.unwrap().to_svg().contains("NaN"));
        }
    }
}
