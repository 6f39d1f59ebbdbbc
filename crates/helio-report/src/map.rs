//! A field seen from above.

use helio_core::Status;

use crate::svg::{Figure, Short};
use crate::ticks::{at_steps, label, ticks};
use crate::{FigureError, equal, palette};

/// What colours the heliostats of a map.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum MapColour<'a> {
    /// An angle \[deg\], NaN where there is none.
    Angle {
        /// One per heliostat.
        values_deg: &'a [f64],
        /// What it is, for the colour bar.
        name: &'a str,
        /// True for azimuths in [0, 360): colours then go round.
        cyclic: bool,
    },
    /// The status.
    Status,
}

/// What a map shows.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FieldMap<'a> {
    /// Heading.
    pub title: &'a str,
    /// Pivots toward east \[m\].
    pub east_m: &'a [f64],
    /// Pivots toward north \[m\].
    pub north_m: &'a [f64],
    /// The status of each heliostat.
    pub status: &'a [Status],
    /// What colours them.
    pub colour: MapColour<'a>,
    /// Where the tower stands, east and north \[m\].
    pub tower_m: Option<(f64, f64)>,
}

const WIDTH: f64 = 860.0;
const LEFT: f64 = 64.0;
const TOP: f64 = 44.0;
const BOTTOM: f64 = 48.0;
const PLOT: (f64, f64) = (620.0, 620.0);
/// Colours of a bar: finer steps are not told apart.
const BINS: usize = 64;

/// Draws a field from above: north up, equal scales, metres.
///
/// # Errors
/// [`FigureError`] if columns differ in length or there is no heliostat.
///
/// ```
/// use helio_core::Status;
/// use helio_report::{FieldMap, MapColour, field_map};
/// let figure = field_map(&FieldMap {
///     title: "Two heliostats",
///     east_m: &[-20.0, 20.0],
///     north_m: &[50.0, 50.0],
///     status: &[Status::Ok, Status::Unreachable],
///     colour: MapColour::Status,
///     tower_m: Some((0.0, 0.0)),
/// })?;
/// assert!(figure.to_svg().contains("unreachable"));
/// # Ok::<(), helio_report::FigureError>(())
/// ```
pub fn field_map(map: &FieldMap<'_>) -> Result<Figure, FigureError> {
    let n = map.east_m.len();
    equal("north_m", n, map.north_m.len())?;
    equal("status", n, map.status.len())?;
    if let MapColour::Angle { values_deg, .. } = map.colour {
        equal("values_deg", n, values_deg.len())?;
    }
    let view = View::of(map).ok_or(FigureError::Empty { what: "heliostat" })?;
    let mut figure = Figure::new(WIDTH, TOP + view.size.1 + BOTTOM);
    figure.text(
        LEFT,
        26.0,
        "font-size=\"16\" font-weight=\"600\"",
        map.title,
    );
    view.draw_frame(&mut figure);

    let diameter = view.dot_diameter(n);
    let places: Vec<_> = (0..n)
        .map(|i| {
            let (x, y) = view.pixel(map.east_m[i], map.north_m[i]);
            ((x * 10.0).round() as i32, (y * 10.0).round() as i32)
        })
        .collect();
    let right = LEFT + view.size.0 + 28.0;
    match map.colour {
        MapColour::Status => draw_statuses(&mut figure, map.status, &places, diameter, right),
        MapColour::Angle {
            values_deg,
            name,
            cyclic,
        } => draw_angles(
            &mut figure,
            (values_deg, name, cyclic),
            &places,
            diameter,
            right,
        ),
    }
    if let Some((east_m, north_m)) = map.tower_m {
        let (x, y) = view.pixel(east_m, north_m);
        let (x, y) = (Short(x), Short(y));
        figure.raw(format_args!(
            "<path d=\"M{x} {y}m-6 5h12l-6 -12z\" fill=\"#fff\" stroke=\"#000\" \
             stroke-width=\"1.5\"><title>tower</title></path>"
        ));
    }
    Ok(figure)
}

/// From metres to pixels.
struct View {
    /// West, south, east and north edges \[m\].
    edges_m: (f64, f64, f64, f64),
    size: (f64, f64),
    scale: f64,
}

impl View {
    fn of(map: &FieldMap<'_>) -> Option<Self> {
        let (mut west, mut south) = (f64::INFINITY, f64::INFINITY);
        let (mut east, mut north) = (f64::NEG_INFINITY, f64::NEG_INFINITY);
        let points = map.east_m.iter().copied().zip(map.north_m.iter().copied());
        for (e, n) in points.chain(map.tower_m) {
            (west, east) = (west.min(e), east.max(e));
            (south, north) = (south.min(n), north.max(n));
        }
        if map.east_m.is_empty() || !(east - west).is_finite() || !(north - south).is_finite() {
            return None;
        }
        let margin = 0.04 * (east - west).max(north - south).max(1.0);
        let edges_m = (west - margin, south - margin, east + margin, north + margin);
        let extent = (edges_m.2 - edges_m.0, edges_m.3 - edges_m.1);
        let scale = (PLOT.0 / extent.0).min(PLOT.1 / extent.1);
        // A field one heliostat wide still gets a readable plot.
        let size = ((extent.0 * scale).max(200.0), (extent.1 * scale).max(200.0));
        let spare = (
            (size.0 / scale - extent.0) / 2.0,
            (size.1 / scale - extent.1) / 2.0,
        );
        Some(Self {
            edges_m: (
                edges_m.0 - spare.0,
                edges_m.1 - spare.1,
                edges_m.2 + spare.0,
                edges_m.3 + spare.1,
            ),
            size,
            scale,
        })
    }

    fn pixel(&self, east_m: f64, north_m: f64) -> (f64, f64) {
        (
            LEFT + (east_m - self.edges_m.0) * self.scale,
            TOP + (self.edges_m.3 - north_m) * self.scale,
        )
    }

    /// Dots that nearly touch where heliostats stand evenly.
    fn dot_diameter(&self, count: usize) -> f64 {
        let (w, h) = self.size;
        (0.62 * (w * h / count.max(1) as f64).sqrt()).clamp(1.8, 10.0)
    }

    fn draw_frame(&self, figure: &mut Figure) {
        let (west, south, east, north) = self.edges_m;
        let (bottom, middle) = (TOP + self.size.1, LEFT + self.size.0 / 2.0);
        // One step for both axes: squares stay squares.
        let widest = ticks(0.0, (east - west).max(north - south), 8);
        let step = widest.get(1).copied().unwrap_or(1.0);
        let easts = at_steps(west, east, step);
        for &e in &easts {
            let (x, _) = self.pixel(e, south);
            figure.line((x, TOP), (x, bottom), "#e8e8e8");
            figure.text(
                x,
                bottom + 16.0,
                "text-anchor=\"middle\"",
                &label(e, &easts),
            );
        }
        let norths = at_steps(south, north, step);
        for &n in &norths {
            let (_, y) = self.pixel(west, n);
            figure.line((LEFT, y), (LEFT + self.size.0, y), "#e8e8e8");
            figure.text(
                LEFT - 6.0,
                y + 4.0,
                "text-anchor=\"end\"",
                &label(n, &norths),
            );
        }
        figure.rect(LEFT, TOP, self.size, "fill=\"none\" stroke=\"#888\"");
        figure.text(middle, bottom + 36.0, "text-anchor=\"middle\"", "east (m)");
        let y = TOP + self.size.1 / 2.0;
        let turn = format!(
            "text-anchor=\"middle\" transform=\"rotate(-90 14 {})\"",
            Short(y)
        );
        figure.text(14.0, y, &turn, "north (m)");
        let (x, y) = (Short(LEFT + self.size.0 - 18.0), Short(TOP + 34.0));
        figure.raw(format_args!(
            "<path d=\"M{x} {y}v-22m-4 7l4 -8l4 8\" stroke=\"#444\" stroke-width=\"1.5\" fill=\"none\"/>"
        ));
        figure.text(
            LEFT + self.size.0 - 18.0,
            TOP + 46.0,
            "text-anchor=\"middle\"",
            "N",
        );
    }
}

fn draw_statuses(
    figure: &mut Figure,
    status: &[Status],
    places: &[(i32, i32)],
    diameter: f64,
    right: f64,
) {
    let mut y = TOP + 12.0;
    for kind in Status::ALL {
        let dots: Vec<_> = (0..status.len())
            .filter(|&i| status[i] == kind)
            .map(|i| places[i])
            .collect();
        if dots.is_empty() {
            continue;
        }
        figure.dots(palette::status(kind), diameter, &dots);
        legend(
            figure,
            right,
            &mut y,
            palette::status(kind),
            kind.as_str(),
            dots.len(),
        );
    }
}

fn legend(figure: &mut Figure, x: f64, y: &mut f64, colour: &str, text: &str, count: usize) {
    figure.rect(
        x,
        *y - 9.0,
        (10.0, 10.0),
        &format!("rx=\"5\" fill=\"{colour}\""),
    );
    figure.text(x + 16.0, *y, "", text);
    figure.text(x + 16.0, *y + 15.0, "fill=\"#777\"", &count.to_string());
    *y += 38.0;
}

fn draw_angles(
    figure: &mut Figure,
    (values_deg, name, cyclic): (&[f64], &str, bool),
    places: &[(i32, i32)],
    diameter: f64,
    right: f64,
) {
    let finite = || values_deg.iter().copied().filter(|v| v.is_finite());
    let (mut min, mut max) = if cyclic {
        (0.0, 360.0)
    } else {
        (
            finite().fold(f64::INFINITY, f64::min),
            finite().fold(f64::NEG_INFINITY, f64::max),
        )
    };
    if max - min < 1e-6 {
        (min, max) = (min - 0.5, max + 0.5);
    }
    let mut bins: Vec<Vec<(i32, i32)>> = vec![Vec::new(); BINS];
    let mut without = Vec::new();
    for (&value, &place) in values_deg.iter().zip(places) {
        if value.is_finite() {
            let part = (value - min) / (max - min);
            // Turns of a counting encoder fall on the same colour.
            let part = if cyclic { part.rem_euclid(1.0) } else { part };
            bins[((part * BINS as f64) as usize).min(BINS - 1)].push(place);
        } else {
            without.push(place);
        }
    }
    let colour = |bin: usize| palette::value(cyclic, (bin as f64 + 0.5) / BINS as f64);
    figure.dots(palette::NOTHING, diameter, &without);
    for (bin, dots) in bins.iter().enumerate() {
        figure.dots(&colour(bin), diameter, dots);
    }

    let mut y = TOP + 12.0;
    if without.len() < values_deg.len() {
        figure.text(right, y, "font-weight=\"600\"", name);
        let (top, height) = (y + 12.0, 256.0);
        let each = height / BINS as f64;
        for bin in 0..BINS {
            let from_top = top + height - (bin + 1) as f64 * each;
            // A little overlap, so that no paper shows between two colours.
            let size = (16.0, each + if bin == 0 { 0.0 } else { 0.5 });
            figure.rect(right, from_top, size, &format!("fill=\"{}\"", colour(bin)));
        }
        let marks = if cyclic {
            at_steps(0.0, 360.0, 45.0)
        } else {
            ticks(min, max, 7)
        };
        for &mark in &marks {
            let at = top + height * (max - mark) / (max - min);
            figure.line((right + 16.0, at), (right + 20.0, at), "#444");
            let text = format!("{}°", label(mark, &marks));
            figure.text(right + 24.0, at + 4.0, "", &text);
        }
        y = top + height + 34.0;
    }
    if !without.is_empty() {
        legend(
            figure,
            right,
            &mut y,
            palette::NOTHING,
            "no angle",
            without.len(),
        );
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn many(n: usize) -> (Vec<f64>, Vec<f64>, Vec<f64>) {
        let spiral = |i: usize| (20.0 * (i as f64).sqrt(), i as f64 * 2.399_963);
        let east = (0..n).map(|i| spiral(i).0 * spiral(i).1.sin()).collect();
        let north = (0..n).map(|i| spiral(i).0 * spiral(i).1.cos()).collect();
        (
            east,
            north,
            (0..n).map(|i| i as f64 * 360.0 / n as f64).collect(),
        )
    }

    #[test]
    fn a_large_field_stays_a_small_file() {
        let (east_m, north_m, values_deg) = many(12_000);
        let figure = field_map(&FieldMap {
            title: "Large",
            east_m: &east_m,
            north_m: &north_m,
            status: &vec![Status::Ok; 12_000],
            colour: MapColour::Angle {
                values_deg: &values_deg,
                name: "azimuth",
                cyclic: true,
            },
            tower_m: Some((0.0, 0.0)),
        });
        let svg = figure.unwrap().to_svg();
        assert!(svg.len() < 220_000, "{}", svg.len());
        assert_eq!(svg.matches("h0").count(), 12_000);
    }

    #[test]
    fn odd_fields_are_drawn_and_wrong_ones_refused() {
        let map = FieldMap {
            title: "",
            east_m: &[5.0],
            north_m: &[5.0],
            status: &[Status::Unreachable],
            colour: MapColour::Angle {
                values_deg: &[f64::NAN],
                name: "elevation",
                cyclic: false,
            },
            tower_m: None,
        };
        assert!(field_map(&map).unwrap().to_svg().contains("no angle"));
        let column = FieldMap {
            east_m: &[0.0, 0.0, 0.0],
            north_m: &[0.0, 50.0, 100.0],
            status: &[Status::Ok; 3],
            colour: MapColour::Status,
            ..map
        };
        assert!(!field_map(&column).unwrap().to_svg().contains("NaN"));
        assert!(
            field_map(&FieldMap {
                north_m: &[],
                ..map
            })
            .is_err()
        );
        let none = FieldMap {
            east_m: &[],
            north_m: &[],
            status: &[],
            colour: MapColour::Status,
            ..map
        };
        assert_eq!(
            field_map(&none).unwrap_err(),
            FigureError::Empty { what: "heliostat" }
        );
    }
}
