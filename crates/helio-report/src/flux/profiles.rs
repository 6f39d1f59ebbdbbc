//! Profiles through the peak of a map.

use super::grid::{Checked, GridMap, Surface};
use super::plot::{Axis, Place, curve, frame, legend};
use super::units::figures;
use super::{LEFT, TITLE, WIDTH};
use crate::svg::Figure;
use crate::{FigureError, palette};

const HEIGHT: f64 = 190.0;
const PLOT_WIDTH: f64 = 740.0;
/// Points of a curve at most: more do not show.
const POINTS: usize = 1500;

/// Draws the irradiance along the row and along the column of the peak, and beside each the mean of all rows or
/// columns, which a receiver lit along one side only is better judged by.
///
/// # Errors
/// As [`grid_map`](super::grid_map).
///
/// ```
/// use helio_report::flux::{GridMap, MapText, Surface, grid_profiles};
/// let figure = grid_profiles(&GridMap {
///     text: MapText::default(),
///     surface: Surface::Round { top_radius_m: 2.0, bottom_radius_m: 2.0, slant_m: 3.0 },
///     rows: 1,
///     columns: 4,
///     irradiance_w_m2: &[0.0, 2000.0, 500.0, 0.0],
/// })?;
/// assert!(figure.to_svg().contains("arc length"));
/// # Ok::<(), helio_report::FigureError>(())
/// ```
pub fn grid_profiles(map: &GridMap<'_>) -> Result<Figure, FigureError> {
    let checked = Checked::new(map)?;
    let (rows, columns) = (map.rows, map.columns);
    let at = |row: usize, column: usize| map.irradiance_w_m2[row * columns + column];
    let (_, peak_row, peak_column) = checked.peak;
    let sums = |outer: usize, inner: usize, value: &dyn Fn(usize, usize) -> f64| -> Vec<f64> {
        let mean = |i: usize| (0..inner).map(|j| value(i, j)).sum::<f64>() / inner as f64;
        (0..outer).map(mean).collect()
    };
    let along_row = Profile {
        through: (0..columns).map(|c| at(peak_row, c)).collect(),
        mean: sums(columns, rows, &|c, r| at(r, c)),
        words: ["row", "rows"],
        other: (peak_row, rows),
    };
    let along_column = Profile {
        through: (0..rows).map(|r| at(r, peak_column)).collect(),
        mean: sums(rows, columns, &|r, c| at(r, c)),
        words: ["column", "columns"],
        other: (peak_column, columns),
    };
    let mut figure = Figure::new(WIDTH, 34.0 + 2.0 * (HEIGHT + 100.0));
    let title = if checked.peak.0 > 0.0 {
        "Profiles through the peak"
    } else {
        "Profiles: no light"
    };
    figure.text(LEFT, 26.0, TITLE, title);
    along_row.draw(&mut figure, 44.0, &checked, 0);
    along_column.draw(&mut figure, 44.0 + HEIGHT + 100.0, &checked, 1);
    Ok(figure)
}

struct Profile {
    through: Vec<f64>,
    mean: Vec<f64>,
    /// What the peak's bins are, and all of them.
    words: [&'static str; 2],
    /// Which one of how many.
    other: (usize, usize),
}

impl Profile {
    fn draw(&self, figure: &mut Figure, top: f64, checked: &Checked<'_>, side: usize) {
        let place = Place {
            top,
            width: PLOT_WIDTH,
            height: HEIGHT,
        };
        let start = checked.map.surface.start_m()[side];
        let length = checked.map.surface.size_m()[side];
        let factor = checked.unit.factor;
        let greatest = if checked.peak.0 > 0.0 {
            1.06 * checked.peak.0 * factor
        } else {
            1.0
        };
        let x = Axis::new((start, start + length), false, (LEFT, LEFT + PLOT_WIDTH));
        let y = Axis::new((0.0, greatest), false, (top + HEIGHT, top));
        let name = match (checked.map.surface, side) {
            (Surface::Round { .. }, 0) => "arc length (m)",
            _ => checked.names()[side],
        };
        let irradiance = format!("irradiance ({})", checked.unit.name);
        frame(figure, place, (&x, name), (&y, &irradiance));
        let many = self.other.1 > 1;
        let strokes = [1, 0].map(|k| {
            let dash = ["", " stroke-dasharray=\"5 3\""][k];
            format!(
                "stroke=\"{}\" stroke-width=\"1.6\"{dash}",
                palette::CURVES[k]
            )
        });
        let curves = [(&self.mean, &strokes[0]), (&self.through, &strokes[1])];
        for (values, stroke) in curves.into_iter().skip(usize::from(!many)) {
            let points: Vec<(f64, f64)> = steps(values)
                .into_iter()
                .map(|(part, value)| (x.pixel(start + length * part), y.pixel(value * factor)))
                .collect();
            curve(figure, &points, stroke);
        }
        let [one, all] = self.words;
        let other = checked.peak_m[1 - side];
        let direction = if side == 0 { "down" } else { "across" };
        let of_what = if checked.peak.0 > 0.0 {
            "of the peak"
        } else {
            "without light"
        };
        let through = format!(
            "{one} {of_what}, {}\u{202f}m {direction} ({} of {})",
            figures(other),
            self.other.0 + 1,
            self.other.1
        );
        let mut names = vec![(through, strokes[1].clone())];
        if many {
            let mean = format!("mean of the {} {all}", self.other.1);
            names.push((mean, strokes[0].clone()));
        }
        legend(figure, top + HEIGHT + 56.0, &names);
    }
}

/// The curve of bins over parts of their side: a stair where its steps show, else a line through means of bins.
fn steps(values: &[f64]) -> Vec<(f64, f64)> {
    let count = values.len();
    let part = |k: usize| k as f64 / count as f64;
    if count <= 400 {
        let stair = |(k, &v): (usize, &f64)| [(part(k), v), (part(k + 1), v)];
        return values.iter().enumerate().flat_map(stair).collect();
    }
    let block = count.div_ceil(POINTS);
    let mean = |(k, bins): (usize, &[f64])| {
        let middle = (k * block) as f64 + 0.5 * bins.len() as f64;
        let sum: f64 = bins.iter().sum();
        (middle / count as f64, sum / bins.len() as f64)
    };
    values.chunks(block).enumerate().map(mean).collect()
}
