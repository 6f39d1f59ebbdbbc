//! A canvas whose colours are classes of the page, so that one drawing serves light, dark and paper.

use std::fmt::{Arguments, Write};

use crate::svg::{Escaped, Short};
use crate::ticks::{label, ticks};

/// Width of every figure, in pixels of its own.
pub(crate) const WIDTH: f64 = 940.0;

/// How many colours `s0`, `s1` … and `f0`, `f1` … the page has.
pub(crate) const COLOURS: usize = 6;

/// A drawing in the making.
pub(crate) struct Canvas {
    height: f64,
    body: String,
}

impl Canvas {
    pub(crate) fn new(height: f64) -> Self {
        Self {
            height,
            body: String::new(),
        }
    }

    /// The drawing, with a title and a description for those who cannot see it.
    pub(crate) fn element(&self, title: &str, description: &str) -> String {
        let (w, h) = (Short(WIDTH), Short(self.height));
        format!(
            "<svg role=\"img\" width=\"{w}\" height=\"{h}\" viewBox=\"0 0 {w} {h}\">\
             <title>{}</title><desc>{}</desc>\n{}</svg>\n",
            Escaped(title),
            Escaped(description),
            self.body
        )
    }

    /// Adds markup as it is.
    pub(crate) fn raw(&mut self, markup: Arguments<'_>) {
        // Writing to a string cannot fail.
        let _ = writeln!(self.body, "{markup}");
    }

    /// Text; the class says where it is anchored: `e` end, `m` middle.
    pub(crate) fn text(&mut self, x: f64, y: f64, class: &str, text: &str) {
        let (x, y, text) = (Short(x), Short(y), Escaped(text));
        self.raw(format_args!(
            "<text x=\"{x}\" y=\"{y}\" class=\"{class}\">{text}</text>"
        ));
    }

    pub(crate) fn line(&mut self, from: (f64, f64), to: (f64, f64), class: &str) {
        let (x1, y1, x2, y2) = (Short(from.0), Short(from.1), Short(to.0), Short(to.1));
        self.raw(format_args!(
            "<path d=\"M{x1} {y1}L{x2} {y2}\" class=\"{class}\"/>"
        ));
    }

    pub(crate) fn rect(&mut self, x: f64, y: f64, size: (f64, f64), more: Arguments<'_>) {
        let (x, y, w, h) = (Short(x), Short(y), Short(size.0), Short(size.1));
        self.raw(format_args!(
            "<rect x=\"{x}\" y=\"{y}\" width=\"{w}\" height=\"{h}\" {more}/>"
        ));
    }

    /// Dots as one path of strokes of a tenth of a pixel, ten bytes a dot: printers leave out square
    /// ends of strokes without any length. `more` are attributes: a class with `dots`, a stroke.
    pub(crate) fn dots(&mut self, diameter: f64, dots: &[(f64, f64)], more: &str) {
        if dots.is_empty() {
            return;
        }
        let mut path = String::with_capacity(dots.len() * 10);
        let mut at = (0, 0);
        for &(x, y) in dots {
            let (x, y) = ((x * 10.0).round() as i32, (y * 10.0).round() as i32);
            let _ = write!(path, "m{} {}h1", x - at.0, y - at.1);
            at = (x + 1, y);
        }
        let width = Short(diameter * 10.0);
        self.raw(format_args!(
            "<path transform=\"scale(.1)\" {more} stroke-width=\"{width}\" d=\"{path}\"/>"
        ));
    }

    /// Crosses as one path.
    pub(crate) fn crosses(&mut self, arm: f64, at: &[(f64, f64)], class: &str) {
        if at.is_empty() {
            return;
        }
        let mut path = String::with_capacity(at.len() * 30);
        let (a, b) = (Short(arm), Short(2.0 * arm));
        for &(x, y) in at {
            let (x, y) = (Short(x), Short(y));
            let _ = write!(path, "M{x} {y}m-{a} -{a}l{b} {b}m-{b} 0l{b} -{b}");
        }
        self.raw(format_args!("<path d=\"{path}\" class=\"{class}\"/>"));
    }

    /// Everything that `draw` adds is cut off outside a rectangle.
    pub(crate) fn clipped(&mut self, place: Place, draw: impl FnOnce(&mut Self)) {
        let Place {
            left,
            top,
            width,
            height,
        } = place;
        let (x, y, w, h) = (Short(left), Short(top), Short(width), Short(height));
        self.raw(format_args!(
            "<svg x=\"{x}\" y=\"{y}\" width=\"{w}\" height=\"{h}\" viewBox=\"{x} {y} {w} {h}\">"
        ));
        draw(self);
        self.raw(format_args!("</svg>"));
    }

    /// A frame with a grid, numbers and names along both axes.
    pub(crate) fn frame(&mut self, place: Place, across: &Axis, up: &Axis) {
        let Place {
            left,
            top,
            width,
            height,
        } = place;
        let bottom = top + height;
        for (at, text) in &across.marks {
            let x = across.pixel(*at);
            self.line((x, top), (x, bottom), "grid");
            // The last one may need room that the drawing does not have.
            let room = WIDTH - 3.6 * text.chars().count() as f64;
            self.text(x.min(room), bottom + 15.0, "m", text);
        }
        for (at, text) in &up.marks {
            let y = up.pixel(*at);
            self.line((left, y), (left + width, y), "grid");
            self.text(left - 6.0, y + 4.0, "e", text);
        }
        self.rect(left, top, (width, height), format_args!("class=\"frame\""));
        self.text(left + width / 2.0, bottom + 32.0, "m soft", &across.name);
        let letters = up.marks.iter().map(|(_, text)| text.chars().count());
        let away = 16.0 + 7.0 * letters.max().unwrap_or(0).max(4) as f64;
        let (x, y) = (Short(left - away), Short(top + height / 2.0));
        let name = Escaped(&up.name);
        self.raw(format_args!(
            "<text transform=\"translate({x} {y}) rotate(-90)\" class=\"m soft\">{name}</text>"
        ));
    }

    /// Says in the middle of a place why nothing is drawn there.
    pub(crate) fn nothing(&mut self, place: Place, why: &str) {
        let (x, y) = (
            place.left + place.width / 2.0,
            place.top + place.height / 2.0,
        );
        self.rect(
            place.left,
            place.top,
            (place.width, place.height),
            format_args!("class=\"frame\""),
        );
        self.text(x, y, "m soft", why);
    }
}

/// A rectangle on the canvas.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Place {
    pub(crate) left: f64,
    pub(crate) top: f64,
    pub(crate) width: f64,
    pub(crate) height: f64,
}

/// Numbers along a side of a frame.
#[derive(Debug, Clone)]
pub(crate) struct Axis {
    pub(crate) min: f64,
    pub(crate) max: f64,
    /// Where `min` and `max` stand.
    ends: (f64, f64),
    pub(crate) name: String,
    pub(crate) marks: Vec<(f64, String)>,
}

impl Axis {
    /// An axis from `min` to `max`, which must be finite and ascending.
    pub(crate) fn new(range: (f64, f64), ends: (f64, f64), name: &str, most: usize) -> Self {
        let (min, max) = range;
        let at = ticks(min, max, most);
        let marks = at.iter().map(|&t| (t, label(t, &at))).collect();
        Self {
            min,
            max,
            ends,
            name: name.to_owned(),
            marks,
        }
    }

    pub(crate) fn pixel(&self, value: f64) -> f64 {
        let part = (value - self.min) / (self.max - self.min);
        self.ends.0 + part * (self.ends.1 - self.ends.0)
    }

    /// The pixel of a value, or of the end that it lies beyond.
    pub(crate) fn pixel_inside(&self, value: f64) -> f64 {
        self.pixel(value.clamp(self.min, self.max))
    }

    pub(crate) fn contains(&self, value: f64) -> bool {
        (self.min..=self.max).contains(&value)
    }
}

/// Least and greatest finite value with a margin, at least `least` apart; `None` where there is none.
pub(crate) fn range(
    values: impl IntoIterator<Item = f64>,
    margin: f64,
    least: f64,
) -> Option<(f64, f64)> {
    let (mut min, mut max) = (f64::INFINITY, f64::NEG_INFINITY);
    for value in values.into_iter().filter(|v| v.is_finite()) {
        (min, max) = (min.min(value), max.max(value));
    }
    if min > max {
        return None;
    }
    let middle = 0.5 * min + 0.5 * max;
    // Far from zero a range must still be wider than the doubles there are apart.
    let least = least.max(1e-9 * middle.abs());
    let half = ((max - min) * (0.5 + margin)).max(0.5 * least);
    (half.is_finite()).then_some((middle - half, middle + half))
}

/// A value below which this share of some finite values lie; `None` where there is none.
pub(crate) fn quantile(values: impl IntoIterator<Item = f64>, share: f64) -> Option<f64> {
    let mut finite: Vec<f64> = values.into_iter().filter(|v| v.is_finite()).collect();
    finite.sort_by(f64::total_cmp);
    let place = (share * finite.len().saturating_sub(1) as f64).round() as usize;
    finite.get(place).copied()
}

/// A number of milliradians for people: three figures or so, a dash for none.
pub(crate) fn mrad(value: f64) -> String {
    if !value.is_finite() {
        return "–".to_owned();
    }
    let decimals = match value.abs() {
        v if v < 0.0995 => 3,
        v if v < 9.995 => 2,
        v if v < 99.95 => 1,
        _ => 0,
    };
    format!("{value:.decimals$}").replace('-', "\u{2212}")
}

/// A count with its thousands apart.
pub(crate) fn count(value: usize) -> String {
    let digits = value.to_string();
    let mut text = String::new();
    for (i, digit) in digits.chars().enumerate() {
        if i > 0 && (digits.len() - i).is_multiple_of(3) {
            text.push('\u{202f}');
        }
        text.push(digit);
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_short() {
        assert_eq!(mrad(0.7412), "0.74");
        assert_eq!(mrad(-131.27), "\u{2212}131");
        assert_eq!(mrad(0.04), "0.040");
        assert_eq!(mrad(9.999), "10.0");
        assert_eq!(mrad(f64::NAN), "–");
        assert_eq!(count(170_000), "170\u{202f}000");
        assert_eq!(count(12), "12");
    }

    #[test]
    fn ranges_of_nothing_and_of_one_are_ranges() {
        assert_eq!(range([f64::NAN], 0.1, 1.0), None);
        assert_eq!(range([3.0, f64::NAN], 0.1, 1.0), Some((2.5, 3.5)));
        assert_eq!(range([0.0, 10.0], 0.1, 1.0), Some((-1.0, 11.0)));
        let (min, max) = range([1e12], 0.0, 1e-6).unwrap();
        assert!(max - min > 1.0);
        assert_eq!(range([f64::MAX, f64::MIN], 0.5, 1.0), None);
        assert_eq!(quantile([3.0, 1.0, f64::NAN, 2.0], 0.5), Some(2.0));
        assert_eq!(quantile([], 0.5), None);
    }
}
