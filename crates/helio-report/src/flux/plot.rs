//! Axes and curves of plots, straight or logarithmic.

use super::units::superscript;
use super::view::turned;
use super::{LEFT, SOFT};
use crate::svg::{Figure, Short};
use crate::ticks::{label, ticks};

/// A rectangle on the drawing.
#[derive(Debug, Clone, Copy)]
pub(super) struct Place {
    pub(super) top: f64,
    pub(super) width: f64,
    pub(super) height: f64,
}

/// From numbers to pixels along one side of a place.
#[derive(Debug, Clone, Copy)]
pub(super) struct Axis {
    least: f64,
    greatest: f64,
    log: bool,
    /// Where `least` and `greatest` stand.
    ends: (f64, f64),
}

impl Axis {
    /// A range, ascending; above 0 if logarithmic.
    pub(super) const fn new(range: (f64, f64), log: bool, ends: (f64, f64)) -> Self {
        Self {
            least: range.0,
            greatest: range.1,
            log,
            ends,
        }
    }

    pub(super) fn pixel(&self, value: f64) -> f64 {
        let part = if self.log {
            (value.ln() - self.least.ln()) / (self.greatest.ln() - self.least.ln())
        } else {
            (value - self.least) / (self.greatest - self.least)
        };
        self.ends.0 + part * (self.ends.1 - self.ends.0)
    }

    /// Numbers with their words, and places of a finer grid.
    fn marks(&self, most: usize) -> (Vec<(f64, String)>, Vec<f64>) {
        if !self.log {
            let at = ticks(self.least, self.greatest, most);
            return (at.iter().map(|&t| (t, label(t, &at))).collect(), Vec::new());
        }
        let (low, high) = (self.least.log10(), self.greatest.log10());
        let inside =
            |value: f64| value >= self.least * 0.999_999 && value <= self.greatest * 1.000_001;
        let powers = (low.floor() as i32)..=(high.ceil() as i32);
        let times = |factors: &[i32]| -> Vec<f64> {
            powers
                .clone()
                .flat_map(|p| factors.iter().map(move |&f| f64::from(f) * 10_f64.powi(p)))
                .filter(|&v| inside(v))
                .collect()
        };
        let factors: &[i32] = match high - low {
            d if d < 1.2 => &[1, 2, 3, 5],
            d if d < 2.5 => &[1, 2, 5],
            _ => &[1],
        };
        let all = times(factors);
        let every = all.len().div_ceil(most.max(2));
        let words = |v: f64| (v, log_label(v, low, high));
        let marks = all.into_iter().step_by(every).map(words).collect();
        let fine = if high - low < 6.0 {
            times(&[1, 2, 3, 4, 5, 6, 7, 8, 9])
        } else {
            times(&[1])
        };
        (marks, fine)
    }
}

/// Plain where the axis has few zeros, else a power of ten.
fn log_label(value: f64, low: f64, high: f64) -> String {
    let plain = low >= -3.01 && high <= 4.01;
    let power = value.log10().floor() as i32;
    // floor of a logarithm may miss by one at the power itself
    let power = if value / 10_f64.powi(power) > 9.5 {
        power + 1
    } else {
        power
    };
    if plain {
        let decimals = (-power).max(0) as usize;
        return format!("{value:.decimals$}");
    }
    let factor = (value / 10_f64.powi(power)).round();
    let ten = format!("10{}", superscript(&power.to_string()));
    if factor == 1.0 {
        ten
    } else {
        format!("{factor}·{ten}")
    }
}

/// Frame, grid, numbers and names.
pub(super) fn frame(
    figure: &mut Figure,
    place: Place,
    (x, x_name): (&Axis, &str),
    (y, y_name): (&Axis, &str),
) {
    let (right, bottom) = (LEFT + place.width, place.top + place.height);
    let (x_marks, x_fine) = x.marks(9);
    let (y_marks, y_fine) = y.marks(((place.height / 34.0) as usize).clamp(3, 9));
    let down = |figure: &mut Figure, at: f64, colour: &str| {
        figure.line((x.pixel(at), place.top), (x.pixel(at), bottom), colour);
    };
    let across = |figure: &mut Figure, at: f64, colour: &str| {
        figure.line((LEFT, y.pixel(at)), (right, y.pixel(at)), colour);
    };
    for &at in &x_fine {
        down(figure, at, "#f3f3f3");
    }
    for &at in &y_fine {
        across(figure, at, "#f3f3f3");
    }
    for (at, text) in &x_marks {
        down(figure, *at, "#dcdcdc");
        figure.text(x.pixel(*at), bottom + 17.0, "text-anchor=\"middle\"", text);
    }
    for (at, text) in &y_marks {
        across(figure, *at, "#dcdcdc");
        figure.text(LEFT - 8.0, y.pixel(*at) + 4.0, "text-anchor=\"end\"", text);
    }
    let size = (place.width, place.height);
    figure.rect(LEFT, place.top, size, "fill=\"none\" stroke=\"#888\"");
    let more = format!("text-anchor=\"middle\" {SOFT}");
    figure.text(LEFT + place.width / 2.0, bottom + 36.0, &more, x_name);
    turned(figure, 16.0, place.top + place.height / 2.0, y_name);
}

/// A line through points.
pub(super) fn curve(figure: &mut Figure, points: &[(f64, f64)], more: &str) {
    let mut path = String::with_capacity(points.len() * 12);
    for (k, &(x, y)) in points.iter().enumerate() {
        let command = if k == 0 { 'M' } else { 'L' };
        path.push_str(&format!("{command}{} {}", Short(x), Short(y)));
    }
    figure.raw(format_args!(
        "<path d=\"{path}\" fill=\"none\" stroke-linejoin=\"round\" {more}/>"
    ));
}

/// Names of curves below each other, each with a piece of its line.
pub(super) fn legend(figure: &mut Figure, top: f64, names: &[(String, String)]) {
    for (k, (name, stroke)) in names.iter().enumerate() {
        let y = top + 18.0 * k as f64;
        curve(figure, &[(LEFT, y - 4.0), (LEFT + 26.0, y - 4.0)], stroke);
        figure.text(LEFT + 34.0, y, "", name);
    }
}
