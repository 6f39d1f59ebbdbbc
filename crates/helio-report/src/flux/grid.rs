//! Maps of receivers with rows and columns.

use std::f64::consts::TAU;

use super::contours::{Contours, averaged, contours};
use super::labels::{self, Taken};
use super::raster::{DRAWN, FINEST, Raster};
use super::scale::ColourScale;
use super::units::{self, Unit, figures};
use super::view::{View, beside, mark};
use super::{LEFT, SOFT, TITLE, WIDTH, check_length};
use crate::svg::{Figure, Short};
use crate::{FigureError, equal, palette};

/// What a map says in words.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct MapText<'a> {
    /// Heading.
    pub title: &'a str,
    /// Direct irradiance of the sun \[W/m²\], above 0: with it the words say the concentration.
    pub dni_w_m2: Option<f64>,
    /// One more line of words; may be empty.
    pub subtitle: &'a str,
}

/// The shape and size of a receiver's grid.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Surface {
    /// A rectangle.
    Plane {
        /// Along rows \[m\].
        width_m: f64,
        /// Along columns \[m\].
        height_m: f64,
    },
    /// The outside of a cylinder or a cone, unrolled: columns go once round it.
    Round {
        /// At the upper edge of the first row \[m\].
        top_radius_m: f64,
        /// At the lower edge of the last row \[m\].
        bottom_radius_m: f64,
        /// From edge to edge along the surface \[m\].
        slant_m: f64,
    },
}

/// A map from plain columns.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct GridMap<'a> {
    /// Words.
    pub text: MapText<'a>,
    /// Shape and size of the whole grid.
    pub surface: Surface,
    /// Rows of bins, at least 1.
    pub rows: usize,
    /// Columns of bins, at least 1.
    pub columns: usize,
    /// Irradiance of the bins \[W/m²\], row by row from the upper left; finite and not negative.
    pub irradiance_w_m2: &'a [f64],
}

/// Draws a map: colours with a labelled bar, contours with their values, the peak marked; one scale in metres both ways.
///
/// A plane is seen as a camera facing it sees it, with right and down counted from its middle. A cylinder or a cone is
/// unrolled: arc length (of a cone, at its mean radius) from the meridian where column 0 begins, with degrees above,
/// and the way down along the surface. Where the sides differ more than twelvefold the shorter one is stretched, and
/// the words say so. Contours of noisy maps are drawn from a smoothed copy, and the words say that too.
///
/// # Errors
/// [`FigureError`] for a grid without bins, a column of another length, sizes that are not above 0, an irradiance that
/// is negative or not finite, or a `dni_w_m2` that is not above 0.
///
/// ```
/// use helio_report::flux::{GridMap, MapText, Surface, grid_map};
/// let figure = grid_map(&GridMap {
///     text: MapText { title: "A spot", dni_w_m2: Some(1000.0), subtitle: "" },
///     surface: Surface::Plane { width_m: 0.3, height_m: 0.2 },
///     rows: 2,
///     columns: 3,
///     irradiance_w_m2: &[0.0, 2000.0, 0.0, 1000.0, 4000.0, 1000.0],
/// })?;
/// assert!(figure.to_svg().contains("peak 4\u{202f}kW/m²"));
/// # Ok::<(), helio_report::FigureError>(())
/// ```
pub fn grid_map(map: &GridMap<'_>) -> Result<Figure, FigureError> {
    let checked = Checked::new(map)?;
    let lines = contours(
        map.irradiance_w_m2,
        [map.rows, map.columns],
        checked.unit.factor,
    )?;
    let round = matches!(map.surface, Surface::Round { .. });
    let top = if round { 104.0 } else { 88.0 };
    let top = top
        + if map.text.subtitle.is_empty() {
            0.0
        } else {
            17.0
        };
    let view = checked.view(top);
    let mut figure = Figure::new(WIDTH, view.bottom().max(top + 150.0) + 52.0);
    figure.text(LEFT, 26.0, TITLE, map.text.title);
    figure.text(LEFT, 46.0, "", &checked.words());
    figure.text(LEFT, 63.0, SOFT, &checked.more_words(&view, &lines));
    if !map.text.subtitle.is_empty() {
        figure.text(LEFT, 80.0, SOFT, map.text.subtitle);
    }

    let scale = ColourScale {
        least: 0.0,
        greatest: if checked.peak.0 > 0.0 {
            checked.peak.0
        } else {
            1.0
        },
        signed: false,
    };
    bins(&mut figure, map, &view, &scale)?;
    let peak = view.pixel(checked.peak_m[0], checked.peak_m[1]);
    let word = beside(peak, &view).0;
    let mut taken = [(peak, (10.0, 10.0)), (word, (20.0, 9.0))]
        .map(|(middle, half)| Taken { middle, half })
        .to_vec();
    labels::draw(
        &mut figure,
        &lines,
        (&view, &scale, checked.unit.factor),
        &mut taken,
    );
    if checked.peak.0 > 0.0 {
        mark(&mut figure, peak, "peak", &view);
    }
    if round {
        degrees(&mut figure, &view);
    }
    let [x_name, y_name] = checked.names();
    view.axes(&mut figure, x_name, y_name);
    let marks: Vec<f64> = lines
        .levels
        .iter()
        .filter(|level| !level.lines.is_empty())
        .map(|level| level.value)
        .collect();
    scale.bar(
        &mut figure,
        (view.right() + 28.0, top),
        (view.size.1 - 16.0).clamp(110.0, 320.0),
        (checked.unit.name, checked.unit.factor),
        &marks,
    );
    Ok(figure)
}

/// A map whose numbers can be drawn, and what follows from them.
pub(super) struct Checked<'a> {
    pub(super) map: &'a GridMap<'a>,
    pub(super) unit: Unit,
    /// The greatest irradiance \[W/m²\], its row and its column; the first of equals.
    pub(super) peak: (f64, usize, usize),
    /// Where it is, across and down as the axes count \[m\].
    pub(super) peak_m: [f64; 2],
    power_w: f64,
    area_m2: f64,
}

impl<'a> Checked<'a> {
    pub(super) fn new(map: &'a GridMap<'a>) -> Result<Self, FigureError> {
        if map.rows == 0 || map.columns == 0 {
            return Err(FigureError::Empty { what: "bin" });
        }
        equal(
            "irradiance_w_m2",
            map.rows.saturating_mul(map.columns),
            map.irradiance_w_m2.len(),
        )?;
        map.surface.check()?;
        if let Some(dni_w_m2) = map.text.dni_w_m2.filter(|d| !(d.is_finite() && *d > 0.0)) {
            return Err(FigureError::BadValue {
                what: "dni_w_m2",
                wanted: "above 0 and finite",
                row: None,
                value: dni_w_m2,
            });
        }
        let mut peak = (f64::NEG_INFINITY, 0);
        for (bin, &value) in map.irradiance_w_m2.iter().enumerate() {
            if !(value >= 0.0 && value.is_finite()) {
                return Err(FigureError::BadValue {
                    what: "irradiance_w_m2",
                    wanted: "finite and not negative",
                    row: Some(bin),
                    value,
                });
            }
            if value > peak.0 {
                peak = (value, bin);
            }
        }
        let (row, column) = (peak.1 / map.columns, peak.1 % map.columns);
        let [left, top] = map.surface.start_m();
        let [width, height] = map.surface.size_m();
        let row_area = |row: usize| map.surface.bin_area_m2(row, map.rows, map.columns);
        let power = |(row, bins): (usize, &[f64])| row_area(row) * bins.iter().sum::<f64>();
        let rows = map.irradiance_w_m2.chunks(map.columns).enumerate();
        Ok(Self {
            map,
            unit: units::irradiance(peak.0),
            peak: (peak.0, row, column),
            peak_m: [
                left + width * (column as f64 + 0.5) / map.columns as f64,
                top + height * (row as f64 + 0.5) / map.rows as f64,
            ],
            power_w: rows.map(power).sum(),
            area_m2: (0..map.rows).map(row_area).sum::<f64>() * map.columns as f64,
        })
    }

    fn view(&self, top: f64) -> View {
        let [x, y] = self.map.surface.start_m();
        let [width, height] = self.map.surface.size_m();
        View::fit((x, x + width), (y, y + height), top)
    }

    pub(super) const fn names(&self) -> [&'static str; 2] {
        match self.map.surface {
            Surface::Plane { .. } => ["to the right (m)", "down (m)"],
            Surface::Round {
                top_radius_m,
                bottom_radius_m,
                ..
            } if top_radius_m == bottom_radius_m => [
                "arc length (m), angle above",
                "down from the upper edge (m)",
            ],
            Surface::Round { .. } => [
                "arc length at the mean radius (m), angle above",
                "down along the surface (m)",
            ],
        }
    }

    fn words(&self) -> String {
        let mean = self.power_w / self.area_m2;
        if self.peak.0 <= 0.0 {
            return "power 0\u{202f}W: no light".to_owned();
        }
        let [x, y] = self.peak_m.map(figures);
        let place = match self.map.surface {
            Surface::Plane { .. } => format!("{x}\u{202f}m right, {y}\u{202f}m down"),
            Surface::Round { .. } => {
                let turn = (self.peak.2 as f64 + 0.5) / self.map.columns as f64;
                format!("{}°, {y}\u{202f}m down", figures(360.0 * turn))
            }
        };
        format!(
            "power {}, mean {}, peak {} at {place}",
            units::with(self.power_w, units::power(self.power_w)),
            units::with(mean, self.unit),
            units::with(self.peak.0, self.unit)
        )
    }

    fn more_words(&self, view: &View, lines: &Contours) -> String {
        let mut words = Vec::new();
        let dni_w_m2 = self.map.text.dni_w_m2.filter(|_| self.peak.0 > 0.0);
        if let Some(dni) = dni_w_m2 {
            let mean = self.power_w / self.area_m2;
            let (peak, mean) = (figures(self.peak.0 / dni), figures(mean / dni));
            words.push(format!(
                "concentration {peak} at the peak, {mean} in the mean"
            ));
        }
        words.push(format!("{} × {} bins", self.map.rows, self.map.columns));
        if lines.block != [1, 1] {
            let [rows, columns] = lines.block;
            words.push(format!("contours of means of {rows} × {columns} bins"));
        }
        if lines.smoothed_bins > 0.0 {
            let over = figures((10.0 * lines.smoothed_bins).round() / 10.0);
            words.push(format!("contours smoothed over {over} bins"));
        }
        if !view.to_scale {
            words.push("shorter side stretched".to_owned());
        }
        words.join("; ")
    }
}

impl Surface {
    /// Width and height of the unrolled grid \[m\].
    pub(super) fn size_m(&self) -> [f64; 2] {
        match *self {
            Self::Plane { width_m, height_m } => [width_m, height_m],
            Self::Round {
                top_radius_m,
                bottom_radius_m,
                slant_m,
            } => [0.5 * TAU * (top_radius_m + bottom_radius_m), slant_m],
        }
    }

    /// What the upper left corner counts as \[m\]: a plane's zero is its middle.
    pub(super) fn start_m(&self) -> [f64; 2] {
        match self {
            Self::Plane { .. } => self.size_m().map(|side| -0.5 * side),
            Self::Round { .. } => [0.0; 2],
        }
    }

    fn bin_area_m2(&self, row: usize, rows: usize, columns: usize) -> f64 {
        match *self {
            Self::Plane { width_m, height_m } => {
                width_m / columns as f64 * (height_m / rows as f64)
            }
            Self::Round {
                top_radius_m,
                bottom_radius_m,
                slant_m,
            } => {
                let down = (row as f64 + 0.5) / rows as f64;
                let radius_m = top_radius_m + (bottom_radius_m - top_radius_m) * down;
                TAU * radius_m / columns as f64 * (slant_m / rows as f64)
            }
        }
    }

    fn check(&self) -> Result<(), FigureError> {
        match *self {
            Self::Plane { width_m, height_m } => {
                check_length("width_m", width_m)?;
                check_length("height_m", height_m)
            }
            Self::Round {
                top_radius_m,
                bottom_radius_m,
                slant_m,
            } => {
                for (what, value) in [
                    ("top_radius_m", top_radius_m),
                    ("bottom_radius_m", bottom_radius_m),
                ] {
                    // one end of a cone may be its tip
                    if value != 0.0 {
                        check_length(what, value)?;
                    }
                }
                check_length("greater radius", top_radius_m.max(bottom_radius_m))?;
                check_length("slant_m", slant_m)
            }
        }
    }
}

/// The bins, one by one or as a picture.
fn bins(
    figure: &mut Figure,
    map: &GridMap<'_>,
    view: &View,
    scale: &ColourScale,
) -> Result<(), FigureError> {
    let (rows, columns) = (map.rows, map.columns);
    if rows * columns > DRAWN {
        let block = [rows, columns].map(|n| n.div_ceil(FINEST));
        let values = averaged(map.irradiance_w_m2, [rows, columns], block);
        let (rows, columns) = (rows.div_ceil(block[0]), columns.div_ceil(block[1]));
        let colour = |row: usize, column: usize| scale.rgb(values[row * columns + column]);
        let raster = Raster::new(columns, rows, colour).repeated();
        return raster.draw(figure, view.at(0.0, 0.0), view.size);
    }
    figure.raw(format_args!("<g shape-rendering=\"crispEdges\">"));
    for row in 0..rows {
        let colours: Vec<[u8; 3]> = map.irradiance_w_m2[row * columns..(row + 1) * columns]
            .iter()
            .map(|&value| scale.rgb(value))
            .collect();
        let mut from = 0;
        for run in colours.chunk_by(|a, b| a == b) {
            let to = from + run.len();
            let edge = |column: usize, row: usize| {
                view.at(column as f64 / columns as f64, row as f64 / rows as f64)
            };
            let ((x, y), (right, bottom)) = (edge(from, row), edge(to, row + 1));
            // A little overlap, so that no paper shows between two cells.
            let over = |last: bool| if last { 0.0 } else { 0.5 };
            let (right, bottom) = (right + over(to == columns), bottom + over(row + 1 == rows));
            let fill = format!("fill=\"{}\"", palette::hex(run[0]));
            figure.rect(x, y, (right - x, bottom - y), &fill);
            from = to;
        }
    }
    figure.raw(format_args!("</g>"));
    Ok(())
}

/// Angles of an unrolled receiver along its upper edge.
fn degrees(figure: &mut Figure, view: &View) {
    for degrees in [0, 90, 180, 270, 360] {
        let (x, y) = view.at(f64::from(degrees) / 360.0, 0.0);
        let (px, py) = (Short(x), Short(y));
        figure.raw(format_args!("<path d=\"M{px} {py}v-4\" stroke=\"#888\"/>"));
        figure.text(x, y - 8.0, "text-anchor=\"middle\"", &format!("{degrees}°"));
    }
}
