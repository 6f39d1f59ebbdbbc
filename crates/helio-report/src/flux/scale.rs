//! From values to colours, and the bar that says how.

use crate::palette;
use crate::svg::Figure;
use crate::ticks::{label, ticks};

/// How many colours a scale has: finer steps are not told apart, and rasters of few colours are small.
const COLOURS: f64 = 256.0;
/// Steps of the bar.
const STEPS: usize = 64;
/// Its width \[px\].
const BAR: f64 = 16.0;

/// Values of a map and the colours between them.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct ColourScale {
    pub(super) least: f64,
    pub(super) greatest: f64,
    pub(super) signed: bool,
}

impl ColourScale {
    /// From 0, or from the least where all values lie in the upper half of it; about 0 if signed.
    pub(super) fn around(values: impl Iterator<Item = f64>, signed: bool) -> Self {
        let (mut least, mut greatest) = (f64::INFINITY, f64::NEG_INFINITY);
        for value in values.filter(|v| v.is_finite()) {
            (least, greatest) = (least.min(value), greatest.max(value));
        }
        if least > greatest {
            (least, greatest) = (0.0, 0.0);
        }
        if signed {
            greatest = greatest.abs().max(least.abs());
            least = -greatest;
        } else if least >= 0.0 && least <= 0.5 * greatest {
            least = 0.0;
        }
        if least == greatest {
            // one value alone: a scale from nothing to it, or to one
            (least, greatest) = match greatest {
                g if g > 0.0 => (0.0, g),
                g if g < 0.0 => (g, 0.0),
                _ => (0.0, 1.0),
            };
            if signed {
                least = -greatest;
            }
        }
        Self {
            least,
            greatest,
            signed,
        }
    }

    /// Where a value stands from 0 to 1.
    pub(super) fn part(&self, value: f64) -> f64 {
        (value - self.least) / (self.greatest - self.least)
    }

    pub(super) fn rgb(&self, value: f64) -> [u8; 3] {
        let step = (self.part(value).clamp(0.0, 1.0) * (COLOURS - 1.0)).round();
        palette::rgb(self.signed, step / (COLOURS - 1.0))
    }

    /// The bar with its numbers, times `factor`, under its name; `marks` are lines across it.
    pub(super) fn bar(
        &self,
        figure: &mut Figure,
        (left, top): (f64, f64),
        height: f64,
        (name, factor): (&str, f64),
        marks: &[f64],
    ) {
        figure.text(left, top + 4.0, "font-weight=\"600\"", name);
        let top = top + 16.0;
        let each = height / STEPS as f64;
        for step in 0..STEPS {
            let y = top + height - (step + 1) as f64 * each;
            let part = (step as f64 + 0.5) / STEPS as f64;
            let fill = palette::hex(palette::rgb(self.signed, part));
            // A little overlap, so that no paper shows between two colours.
            let over = if step == 0 { 0.0 } else { 0.5 };
            figure.rect(left, y, (BAR, each + over), &format!("fill=\"{fill}\""));
        }
        let at = |value: f64| top + height * (1.0 - self.part(value));
        for &mark in marks {
            let ink = ink_on(self.part(mark));
            figure.line((left, at(mark)), (left + BAR, at(mark)), ink);
        }
        let most = ((height / 30.0) as usize).clamp(2, 8);
        let numbers = ticks(self.least * factor, self.greatest * factor, most);
        for &number in &numbers {
            let y = at(number / factor);
            figure.line((left + BAR, y), (left + BAR + 4.0, y), "#444");
            figure.text(left + BAR + 8.0, y + 4.0, "", &label(number, &numbers));
        }
    }
}

/// What can be read on the colour of a part of the unsigned scale.
pub(super) fn ink_on(part: f64) -> &'static str {
    if part < 0.6 { "#fff" } else { "#111" }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn scales_begin_at_nothing_unless_all_is_far_from_it() {
        let around = |values: &[f64], signed| {
            let scale = ColourScale::around(values.iter().copied(), signed);
            (scale.least, scale.greatest)
        };
        assert_eq!(around(&[2.0, 10.0, f64::NAN], false), (0.0, 10.0));
        assert_eq!(around(&[9.0, 10.0], false), (9.0, 10.0));
        assert_eq!(around(&[-1.0, 3.0], true), (-3.0, 3.0));
        assert_eq!(around(&[4.0, 4.0], false), (0.0, 4.0));
        assert_eq!(around(&[0.0], false), (0.0, 1.0));
        assert_eq!(around(&[0.0], true), (-1.0, 1.0));
        assert_eq!(around(&[], false), (0.0, 1.0));
        let scale = ColourScale::around([0.0, 8.0].into_iter(), false);
        assert_eq!(scale.rgb(0.0), [0x44, 0x01, 0x54]); // viridis from its first
        assert_eq!(scale.rgb(8.0), [0xfd, 0xe7, 0x25]); // to its last
    }
}
