//! Series of numbers, above all how errors fall.

use super::plot::{Axis, Place, curve, frame, legend};
use super::{LEFT, TITLE, WIDTH};
use crate::svg::Figure;
use crate::{FigureError, equal, palette};

const PLOT_WIDTH: f64 = 740.0;
const HEIGHT: f64 = 400.0;

/// Points that belong together.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Series<'a> {
    /// Its name for the legend.
    pub name: &'a str,
    /// Where its points stand across; in any order, they are joined as they come.
    pub x: &'a [f64],
    /// And up.
    pub y: &'a [f64],
    /// Whether the slope of a power law through its points is written beside the name: where both axes are
    /// logarithmic and there are two points or more.
    pub fit: bool,
}

/// Errors over an effort, both logarithmic.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Convergence<'a> {
    /// Heading.
    pub title: &'a str,
    /// The effort with its unit, such as "rays" or "time (s)".
    pub x_name: &'a str,
    /// The error with its unit.
    pub y_name: &'a str,
    /// One to seven series.
    pub series: &'a [Series<'a>],
}

/// Series over straight or logarithmic axes.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SeriesPlot<'a> {
    /// Heading; may be empty.
    pub title: &'a str,
    /// What runs across, with its unit.
    pub x_name: &'a str,
    /// What runs up, with its unit.
    pub y_name: &'a str,
    /// Whether x is logarithmic.
    pub x_log: bool,
    /// Whether y is logarithmic.
    pub y_log: bool,
    /// One to seven series.
    pub series: &'a [Series<'a>],
}

/// Draws errors over an effort on logarithmic axes, with the slopes of power laws fitted to the series that ask for it.
///
/// A point with an error of exactly 0 has no place there: it is left out, and the legend counts such points.
///
/// # Errors
/// [`FigureError`] for no series, more than seven or one whose columns differ in length or are empty, and for numbers
/// that are negative or not finite, or an effort of 0.
///
/// ```
/// use helio_report::flux::{Convergence, Series, convergence};
/// let figure = convergence(&Convergence {
///     title: "A flat facet",
///     x_name: "rays",
///     y_name: "error over the peak",
///     series: &[Series { name: "random", x: &[1e4, 1e6, 1e8], y: &[1e-1, 1e-2, 1e-3], fit: true }],
/// })?;
/// assert!(figure.to_svg().contains("random: slope \u{2212}0.50"));
/// # Ok::<(), helio_report::FigureError>(())
/// ```
pub fn convergence(plot: &Convergence<'_>) -> Result<Figure, FigureError> {
    series_plot(&SeriesPlot {
        title: plot.title,
        x_name: plot.x_name,
        y_name: plot.y_name,
        x_log: true,
        y_log: true,
        series: plot.series,
    })
}

/// Draws series as lines with dots, their names below.
///
/// # Errors
/// As [`convergence`]; on a straight axis any finite number has a place.
///
/// ```
/// use helio_report::flux::{Series, SeriesPlot, series_plot};
/// let figure = series_plot(&SeriesPlot {
///     title: "Slope errors",
///     x_name: "bending stiffness (N m)",
///     y_name: "slope error (mrad)",
///     x_log: true,
///     y_log: false,
///     series: &[Series { name: "by elements", x: &[0.1, 400.0], y: &[21.0, 22.7], fit: false }],
/// })?;
/// assert!(figure.to_svg().contains("by elements"));
/// # Ok::<(), helio_report::FigureError>(())
/// ```
pub fn series_plot(plot: &SeriesPlot<'_>) -> Result<Figure, FigureError> {
    let drawn = checked(plot)?;
    let ranges = [0, 1].map(|side| {
        let values = drawn
            .iter()
            .flatten()
            .map(|p| if side == 0 { p.0 } else { p.1 });
        range(values, if side == 0 { plot.x_log } else { plot.y_log })
    });
    let [Some(across), Some(up)] = ranges else {
        return Err(FigureError::Empty { what: "point" });
    };
    let top = if plot.title.is_empty() { 16.0 } else { 44.0 };
    let place = Place {
        top,
        width: PLOT_WIDTH,
        height: HEIGHT,
    };
    let below = top + HEIGHT + 60.0;
    let mut figure = Figure::new(WIDTH, below + 18.0 * plot.series.len() as f64 + 4.0);
    figure.text(LEFT, 26.0, TITLE, plot.title);
    let x = Axis::new(across, plot.x_log, (LEFT, LEFT + PLOT_WIDTH));
    let y = Axis::new(up, plot.y_log, (top + HEIGHT, top));
    frame(&mut figure, place, (&x, plot.x_name), (&y, plot.y_name));
    let mut names = Vec::new();
    for (k, (series, points)) in plot.series.iter().zip(&drawn).enumerate() {
        let colour = palette::CURVES[k];
        // not by colour alone
        let dash = ["", "7 3", "2 3", "9 3 2 3", "12 4", "4 2", "1 2"][k];
        let stroke =
            format!("stroke=\"{colour}\" stroke-width=\"1.6\" stroke-dasharray=\"{dash}\"")
                .replace(" stroke-dasharray=\"\"", "");
        let at: Vec<(f64, f64)> = points
            .iter()
            .map(|p| (x.pixel(p.0), y.pixel(p.1)))
            .collect();
        curve(&mut figure, &at, &stroke);
        let dots: Vec<(i32, i32)> = at
            .iter()
            .map(|&(x, y)| ((x * 10.0).round() as i32, (y * 10.0).round() as i32))
            .collect();
        figure.dots(colour, 6.0, &dots);
        names.push((said(plot, series, points), stroke));
    }
    legend(&mut figure, below, &names);
    Ok(figure)
}

/// The points of each series that have a place.
fn checked(plot: &SeriesPlot<'_>) -> Result<Vec<Vec<(f64, f64)>>, FigureError> {
    if plot.series.is_empty() {
        return Err(FigureError::Empty { what: "series" });
    }
    if plot.series.len() > palette::CURVES.len() {
        return Err(FigureError::BadValue {
            what: "number of series",
            wanted: "at most 7",
            row: None,
            value: plot.series.len() as f64,
        });
    }
    let mut all = Vec::new();
    for series in plot.series {
        equal("y of a series", series.x.len(), series.y.len())?;
        if series.x.is_empty() {
            return Err(FigureError::Empty {
                what: "point of a series",
            });
        }
        for (what, column, log, zero) in [
            ("x of a series", series.x, plot.x_log, false),
            ("y of a series", series.y, plot.y_log, true),
        ] {
            let wanted = match (log, zero) {
                (false, _) => "finite",
                (true, false) => "above 0 and finite",
                (true, true) => "not negative and finite",
            };
            let good = |v: f64| v.is_finite() && (!log || v > 0.0 || (zero && v == 0.0));
            if let Some(row) = column.iter().position(|&v| !good(v)) {
                return Err(FigureError::BadValue {
                    what,
                    wanted,
                    row: Some(row),
                    value: column[row],
                });
            }
        }
        let points = series.x.iter().copied().zip(series.y.iter().copied());
        all.push(points.filter(|p| !plot.y_log || p.1 > 0.0).collect());
    }
    Ok(all)
}

/// A range with a little room; from 0 on a straight axis where values come near it.
fn range(values: impl Iterator<Item = f64>, log: bool) -> Option<(f64, f64)> {
    let (mut least, mut greatest) = (f64::INFINITY, f64::NEG_INFINITY);
    for value in values {
        (least, greatest) = (least.min(value), greatest.max(value));
    }
    if least > greatest {
        return None;
    }
    if log {
        let room = (0.04 * (greatest.ln() - least.ln())).exp().max(1.15);
        return Some((
            (least / room).max(f64::MIN_POSITIVE),
            (greatest * room).min(f64::MAX),
        ));
    }
    let room = (0.06 * (greatest - least)).max(0.01 * greatest.abs());
    let room = if room > 0.0 { room } else { 0.5 };
    let low = if least >= 0.0 && least < 0.4 * greatest {
        0.0
    } else {
        least - room
    };
    let high = greatest + room;
    (low.is_finite() && high.is_finite() && (high - low).is_finite()).then_some((low, high))
}

/// A series' name, with the slope of its power law and what is not drawn.
fn said(plot: &SeriesPlot<'_>, series: &Series<'_>, points: &[(f64, f64)]) -> String {
    let mut words = series.name.to_owned();
    if series.fit
        && plot.x_log
        && plot.y_log
        && let Some(slope) = slope(points)
    {
        words.push_str(&format!(": slope {slope:.2}").replace('-', "\u{2212}"));
    }
    match series.x.len() - points.len() {
        0 => {}
        1 => words.push_str(" (one error of 0 not drawn)"),
        n => words.push_str(&format!(" ({n} errors of 0 not drawn)")),
    }
    words
}

/// The exponent of the power law through points by least squares of the logarithms.
fn slope(points: &[(f64, f64)]) -> Option<f64> {
    let count = points.len() as f64;
    let mean = |value: &dyn Fn(&(f64, f64)) -> f64| points.iter().map(value).sum::<f64>() / count;
    let (x, y) = (mean(&|p| p.0.ln()), mean(&|p| p.1.ln()));
    let squares = mean(&|p| (p.0.ln() - x).powi(2));
    let products = mean(&|p| (p.0.ln() - x) * (p.1.ln() - y));
    (squares > 1e-12).then(|| products / squares)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn slopes_are_those_of_power_laws() {
        let law = |x: f64| (x, 7.0 * x.powf(-0.75));
        let found = slope(&[law(1e3), law(1e4), law(3e6)]).unwrap();
        assert!((found + 0.75).abs() < 1e-12);
        assert_eq!(slope(&[law(5.0)]), None);
        assert_eq!(slope(&[(2.0, 1.0), (2.0, 3.0)]), None);
        assert_eq!(slope(&[]), None);
    }
}
