//! Coloured faces of a mesh, seen from one direction.

use super::raster::{DRAWN, Raster};
use super::scale::ColourScale;
use super::units::figures;
use super::view::{View, mark};
use super::{LEFT, SOFT, TITLE, WIDTH};
use crate::svg::{Figure, Short};
use crate::{FigureError, equal, palette};

/// Faces of a mesh, each with a value.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FaceMap<'a> {
    /// Heading.
    pub title: &'a str,
    /// A line of words under it; may be empty.
    pub words: &'a str,
    /// What the values are, for the bar: "slope error".
    pub quantity: &'a str,
    /// Their unit, such as "mrad"; may be empty.
    pub unit: &'a str,
    /// The corners of each face \[m\]: three or more, in order around it.
    pub faces_m: &'a [&'a [[f64; 3]]],
    /// The value of each face; NaN where there is none, which is drawn gray.
    pub values: &'a [f64],
    /// From the faces to the eye; of any length.
    pub toward_viewer: [f64; 3],
    /// Whether values count about zero: colours then go from blue by white to red.
    pub signed: bool,
}

/// Draws the faces in parallel projection, to one scale in metres, nearer ones over farther ones, with a labelled bar
/// and a mark at the greatest and the least value.
///
/// Up in the picture is z, or y where the eye looks along z. Each axis counts the frame's own metres along it.
///
/// # Errors
/// [`FigureError`] for no face or one of fewer than three corners, columns of different lengths, a corner that is not
/// finite, an infinite value, or a `toward_viewer` without a direction.
///
/// ```
/// use helio_report::flux::{FaceMap, face_map};
/// let face = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.1]];
/// let figure = face_map(&FaceMap {
///     title: "One face",
///     words: "",
///     quantity: "slope error",
///     unit: "mrad",
///     faces_m: &[&face],
///     values: &[22.6],
///     toward_viewer: [0.0, 0.0, 1.0],
///     signed: false,
/// })?;
/// assert!(figure.to_svg().contains("greatest 22.6\u{202f}mrad"));
/// # Ok::<(), helio_report::FigureError>(())
/// ```
pub fn face_map(map: &FaceMap<'_>) -> Result<Figure, FigureError> {
    let seen = Seen::new(map)?;
    let scale = ColourScale::around(map.values.iter().copied(), map.signed);
    let top = if map.words.is_empty() { 70.0 } else { 88.0 };
    let view = seen.view(top);
    let mut figure = Figure::new(WIDTH, view.bottom().max(top + 150.0) + 52.0);
    figure.text(LEFT, 26.0, TITLE, map.title);
    figure.text(LEFT, 46.0, "", &words(map));
    if !map.words.is_empty() {
        figure.text(LEFT, 63.0, SOFT, map.words);
    }
    if map.faces_m.len() > DRAWN {
        seen.paint(&mut figure, map, (&view, &scale))?;
    } else {
        seen.draw(&mut figure, map, (&view, &scale));
    }
    view.axes(&mut figure, seen.names[0], seen.names[1]);
    for (row, word) in extremes(map).into_iter().flatten().zip(["max", "min"]) {
        let (x, y) = seen.middle(row);
        mark(&mut figure, view.pixel(x, y), word, &view);
    }
    let name = match (map.quantity, map.unit) {
        (quantity, "") => quantity.to_owned(),
        (_, unit) => unit.to_owned(),
    };
    scale.bar(
        &mut figure,
        (view.right() + 28.0, top),
        (view.size.1 - 16.0).clamp(110.0, 320.0),
        (&name, 1.0),
        &[],
    );
    Ok(figure)
}

/// Rows of the greatest and the least value, the first of equals; one alone where all are equal.
fn extremes(map: &FaceMap<'_>) -> [Option<usize>; 2] {
    let (mut greatest, mut least): (Option<usize>, Option<usize>) = (None, None);
    for (row, &value) in map.values.iter().enumerate() {
        if value.is_nan() {
            continue;
        }
        if greatest.is_none_or(|best| value > map.values[best]) {
            greatest = Some(row);
        }
        if least.is_none_or(|best| value < map.values[best]) {
            least = Some(row);
        }
    }
    [greatest, least.filter(|_| least != greatest)]
}

fn words(map: &FaceMap<'_>) -> String {
    let with = |row: usize| {
        let value = figures(map.values[row]);
        if map.unit.is_empty() {
            value
        } else {
            format!("{value}\u{202f}{}", map.unit)
        }
    };
    let mut words = format!("{} of {} faces", map.quantity, map.faces_m.len());
    match extremes(map) {
        [Some(greatest), Some(least)] => words.push_str(&format!(
            ": greatest {}, least {}",
            with(greatest),
            with(least)
        )),
        [Some(greatest), None] => words.push_str(&format!(": greatest {}", with(greatest))),
        _ => {}
    }
    match map.values.iter().filter(|v| v.is_nan()).count() {
        0 => {}
        count => words.push_str(&format!("; {count} without a value, gray")),
    }
    words
}

/// Faces as the eye has them: right and up \[m\], and toward it.
struct Seen {
    faces: Vec<Vec<[f64; 3]>>,
    names: [&'static str; 2],
}

impl Seen {
    fn new(map: &FaceMap<'_>) -> Result<Self, FigureError> {
        if map.faces_m.is_empty() {
            return Err(FigureError::Empty { what: "face" });
        }
        equal("values", map.faces_m.len(), map.values.len())?;
        let bad = |what, wanted, row, value| FigureError::BadValue {
            what,
            wanted,
            row: Some(row),
            value,
        };
        if let Some(row) = map.values.iter().position(|v| v.is_infinite()) {
            let wanted = "finite, or NaN for none";
            return Err(bad("values", wanted, row, map.values[row]));
        }
        let length = |v: [f64; 3]| v[0].hypot(v[1]).hypot(v[2]);
        let toward = map.toward_viewer;
        if !(length(toward) > 0.0 && length(toward).is_finite()) {
            return Err(FigureError::BadValue {
                what: "toward_viewer",
                wanted: "a finite vector with a length; its length",
                row: None,
                value: length(toward),
            });
        }
        let toward = toward.map(|x| x / length(toward));
        // z is up in the picture, unless the eye looks along it
        let hint = if toward[2].abs() > 0.99 {
            [0.0, 1.0, 0.0]
        } else {
            [0.0, 0.0, 1.0]
        };
        let right = cross(hint, toward);
        let right = right.map(|x| x / length(right));
        let up = cross(toward, right);
        let mut faces = Vec::with_capacity(map.faces_m.len());
        for (row, &face) in map.faces_m.iter().enumerate() {
            if face.len() < 3 {
                let wanted = "at least three corners";
                return Err(bad("faces_m", wanted, row, face.len() as f64));
            }
            // squares of extents must stay finite
            let good = |x: &&f64| !(x.abs() <= 1e12);
            if let Some(&value) = face.iter().flatten().find(good) {
                return Err(bad("faces_m", "corners within ±1e12 m", row, value));
            }
            let place = |c: &[f64; 3]| [dot(*c, right), dot(*c, up), dot(*c, toward)];
            faces.push(face.iter().map(place).collect());
        }
        let name = |axis: [f64; 3], other: &'static str| {
            let along = |k: usize| axis[k] > 1.0 - 1e-9;
            match (along(0), along(1), along(2)) {
                (true, _, _) => "x (m)",
                (_, true, _) => "y (m)",
                (_, _, true) => "z (m)",
                _ => other,
            }
        };
        let names = [
            name(right, "right, as seen from there (m)"),
            name(up, "up, as seen from there (m)"),
        ];
        Ok(Self { faces, names })
    }

    fn view(&self, top: f64) -> View {
        let range = |side: usize| {
            let values = || self.faces.iter().flatten().map(move |corner| corner[side]);
            (
                values().fold(f64::INFINITY, f64::min),
                values().fold(f64::NEG_INFINITY, f64::max),
            )
        };
        let (x, y) = (range(0), range(1));
        let extent = (x.1 - x.0).max(y.1 - y.0);
        // far from zero a range must still be wider than the doubles there are apart
        let far = x.0.abs().max(y.0.abs()).max(x.1.abs()).max(y.1.abs());
        let least = extent.max(1e-6 * far).max(1e-9);
        let room = |(from, to): (f64, f64), least: f64| {
            let spare = 0.03 * extent + 0.5 * (least - (to - from)).max(0.0);
            (from - spare, to + spare)
        };
        let slim = least / 12.0;
        let (x, y) = (room(x, slim), room(y, slim));
        View::fit(x, (y.1, y.0), top)
    }

    fn middle(&self, row: usize) -> (f64, f64) {
        let face = &self.faces[row];
        let mean = |side: usize| face.iter().map(|c| c[side]).sum::<f64>() / face.len() as f64;
        (mean(0), mean(1))
    }

    /// Each face as a polygon, the farthest first.
    fn draw(&self, figure: &mut Figure, map: &FaceMap<'_>, (view, scale): (&View, &ColourScale)) {
        let depth = |row: usize| {
            let face = &self.faces[row];
            face.iter().map(|c| c[2]).sum::<f64>() / face.len() as f64
        };
        let mut order: Vec<(f64, usize)> = (0..self.faces.len()).map(|r| (depth(r), r)).collect();
        order.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
        figure.raw(format_args!(
            "<g class=\"faces\" stroke=\"#000\" stroke-opacity=\".25\" stroke-width=\".4\" stroke-linejoin=\"round\">"
        ));
        for (_, row) in order {
            let fill = colour(map.values[row], scale);
            let mut path = String::new();
            for (k, corner) in self.faces[row].iter().enumerate() {
                let (x, y) = view.pixel(corner[0], corner[1]);
                let command = if k == 0 { 'M' } else { 'L' };
                path.push_str(&format!("{command}{} {}", Short(x), Short(y)));
            }
            let fill = palette::hex(fill);
            figure.raw(format_args!("<path d=\"{path}z\" fill=\"{fill}\"/>"));
        }
        figure.raw(format_args!("</g>"));
    }

    /// All faces as one picture: each pixel of the nearest.
    fn paint(
        &self,
        figure: &mut Figure,
        map: &FaceMap<'_>,
        (view, scale): (&View, &ColourScale),
    ) -> Result<(), FigureError> {
        let [width, height] = [view.size.0, view.size.1].map(|side| (2.0 * side).round().max(1.0));
        let (columns, rows) = (width as usize, height as usize);
        let mut nearest = vec![(f64::NEG_INFINITY, usize::MAX); columns * rows];
        for (row, face) in self.faces.iter().enumerate() {
            let corner = |c: &[f64; 3]| {
                let (x, y) = view.pixel(c[0], c[1]);
                let (x, y) = (x - LEFT, y - view.top);
                [x * width / view.size.0, y * height / view.size.1, c[2]]
            };
            let first = corner(&face[0]);
            for pair in face[1..].windows(2) {
                let triangle = [first, corner(&pair[0]), corner(&pair[1])];
                fill(triangle, (columns, rows), |pixel, toward| {
                    if toward > nearest[pixel].0 {
                        nearest[pixel] = (toward, row);
                    }
                });
            }
        }
        let pixel = |row: usize, column: usize| match nearest[row * columns + column].1 {
            usize::MAX => [255; 3],
            face => colour(map.values[face], scale),
        };
        Raster::new(columns, rows, pixel).draw(figure, view.at(0.0, 0.0), view.size)
    }
}

fn colour(value: f64, scale: &ColourScale) -> [u8; 3] {
    if value.is_nan() {
        return palette::NOTHING_RGB;
    }
    scale.rgb(value)
}

/// Visits the pixels whose middles lie in a triangle, and one pixel of a triangle that holds none.
fn fill(
    corners: [[f64; 3]; 3],
    (columns, rows): (usize, usize),
    mut visit: impl FnMut(usize, f64),
) {
    let [a, b, c] = corners;
    let area = (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]);
    let ends = |side: usize, count: usize| {
        let least = a[side].min(b[side]).min(c[side]);
        let greatest = a[side].max(b[side]).max(c[side]);
        // saturating: what is left of the drawing is its first pixel
        let from = (least - 0.5).ceil().max(0.0) as usize;
        let to = (greatest - 0.5).floor() + 1.0;
        (from, (to.max(0.0) as usize).min(count))
    };
    let (left, right) = ends(0, columns);
    let (top, bottom) = ends(1, rows);
    let mut none = true;
    if area != 0.0 {
        for row in top..bottom {
            for column in left..right {
                let (x, y) = (column as f64 + 0.5, row as f64 + 0.5);
                let part = |p: [f64; 3], q: [f64; 3]| {
                    ((q[0] - p[0]) * (y - p[1]) - (q[1] - p[1]) * (x - p[0])) / area
                };
                let (of_c, of_a, of_b) = (part(a, b), part(b, c), part(c, a));
                if of_a >= 0.0 && of_b >= 0.0 && of_c >= 0.0 {
                    visit(
                        row * columns + column,
                        of_a * a[2] + of_b * b[2] + of_c * c[2],
                    );
                    none = false;
                }
            }
        }
    }
    if none {
        // a sliver or smaller than a pixel: where its middle is
        let mean = |side: usize| (a[side] + b[side] + c[side]) / 3.0;
        let column = (mean(0).max(0.0) as usize).min(columns - 1);
        let row = (mean(1).max(0.0) as usize).min(rows - 1);
        visit(row * columns + column, mean(2));
    }
}

fn dot(a: [f64; 3], b: [f64; 3]) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

fn cross(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    [
        a[1] * b[2] - a[2] * b[1],
        a[2] * b[0] - a[0] * b[2],
        a[0] * b[1] - a[1] * b[0],
    ]
}

#[cfg(test)]
mod tests {
    use super::*;

    // Pixels of two triangles that make a rectangle are each visited, and their depth is that of the plane.
    #[test]
    fn triangles_fill_a_rectangle() {
        let at = |x: f64, y: f64| [x, y, 2.0 * x - y];
        let corners = [at(1.0, 1.0), at(9.0, 1.0), at(9.0, 7.0), at(1.0, 7.0)];
        let mut depth = vec![f64::NAN; 10 * 8];
        for triangle in [[0, 1, 2], [0, 2, 3]] {
            fill(triangle.map(|k| corners[k]), (10, 8), |pixel, toward| {
                depth[pixel] = toward;
            });
        }
        for (pixel, found) in depth.iter().enumerate() {
            let (row, column) = (pixel / 10, pixel % 10);
            if (1..9).contains(&column) && (1..7).contains(&row) {
                let wanted = at(column as f64 + 0.5, row as f64 + 0.5)[2];
                assert!((found - wanted).abs() < 1e-12);
            } else {
                assert!(found.is_nan(), "{row} {column}");
            }
        }
    }

    #[test]
    fn a_speck_is_one_pixel() {
        let mut seen = Vec::new();
        let speck = [[3.1, 2.1, 0.0], [3.2, 2.1, 0.0], [3.1, 2.2, 3.0]];
        fill(speck, (10, 8), |pixel, toward| seen.push((pixel, toward)));
        assert_eq!(seen, [(23, 1.0)]);
    }
}
