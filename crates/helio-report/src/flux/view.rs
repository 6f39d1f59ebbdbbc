//! Where a map in metres stands on the drawing.

use super::{LEFT, SOFT};
use crate::svg::{Figure, Short};
use crate::ticks::{at_steps, label, ticks};

/// Largest width and height of a map \[px\].
const LARGEST: (f64, f64) = (620.0, 560.0);
/// Beyond this ratio of its sides a map to one scale would be a line.
const SLIMMEST: f64 = 12.0;

/// From metres to pixels, with one scale both ways wherever that can be seen.
#[derive(Debug, Clone, Copy)]
pub(super) struct View {
    pub(super) top: f64,
    /// Width and height \[px\].
    pub(super) size: (f64, f64),
    /// Values at the left and right edge, at the upper and lower edge \[m\].
    x_m: (f64, f64),
    y_m: (f64, f64),
    /// False where the shorter side had to be stretched.
    pub(super) to_scale: bool,
}

impl View {
    /// A view of a range across and one from the upper edge to the lower; neither may be of no length.
    pub(super) fn fit(x_m: (f64, f64), y_m: (f64, f64), top: f64) -> Self {
        let (width_m, height_m) = ((x_m.1 - x_m.0).abs(), (y_m.1 - y_m.0).abs());
        let (across, down) = (
            width_m.max(height_m / SLIMMEST),
            height_m.max(width_m / SLIMMEST),
        );
        let scale = (LARGEST.0 / across).min(LARGEST.1 / down);
        Self {
            top,
            size: (across * scale, down * scale),
            x_m,
            y_m,
            to_scale: across == width_m && down == height_m,
        }
    }

    pub(super) fn pixel(&self, x_m: f64, y_m: f64) -> (f64, f64) {
        let part = |value: f64, (from, to): (f64, f64)| (value - from) / (to - from);
        (
            LEFT + self.size.0 * part(x_m, self.x_m),
            self.top + self.size.1 * part(y_m, self.y_m),
        )
    }

    /// The point at parts of the width and the height.
    pub(super) fn at(&self, across: f64, down: f64) -> (f64, f64) {
        (LEFT + self.size.0 * across, self.top + self.size.1 * down)
    }

    pub(super) fn right(&self) -> f64 {
        LEFT + self.size.0
    }

    pub(super) fn bottom(&self) -> f64 {
        self.top + self.size.1
    }

    /// Frame, ticks and names along both axes.
    pub(super) fn axes(&self, figure: &mut Figure, x_name: &str, y_name: &str) {
        let bottom = self.bottom();
        let (x_step, y_step) = self.steps();
        let marks = at_steps(
            self.x_m.0.min(self.x_m.1),
            self.x_m.0.max(self.x_m.1),
            x_step,
        );
        for &mark in &marks {
            let (x, _) = self.pixel(mark, self.y_m.0);
            figure.line((x, bottom), (x, bottom + 4.0), "#888");
            figure.text(
                x,
                bottom + 17.0,
                "text-anchor=\"middle\"",
                &label(mark, &marks),
            );
        }
        let marks = at_steps(
            self.y_m.0.min(self.y_m.1),
            self.y_m.0.max(self.y_m.1),
            y_step,
        );
        for &mark in &marks {
            let (_, y) = self.pixel(self.x_m.0, mark);
            figure.line((LEFT - 4.0, y), (LEFT, y), "#888");
            figure.text(
                LEFT - 8.0,
                y + 4.0,
                "text-anchor=\"end\"",
                &label(mark, &marks),
            );
        }
        figure.rect(LEFT, self.top, self.size, "fill=\"none\" stroke=\"#888\"");
        let middle = LEFT + self.size.0 / 2.0;
        // a slim map is narrower than its axis' name
        let least = LEFT + 3.3 * x_name.chars().count() as f64 - 40.0;
        let more = format!("text-anchor=\"middle\" {SOFT}");
        figure.text(middle.max(least), bottom + 36.0, &more, x_name);
        turned(figure, 16.0, self.top + self.size.1 / 2.0, y_name);
    }

    /// Steps of the ticks: one for both axes where the scale is one and there is room.
    fn steps(&self) -> (f64, f64) {
        let step = |(from, to): (f64, f64), pixels: f64, each: f64| {
            let most = ((pixels / each) as usize).clamp(2, 8);
            let all = ticks(0.0, (to - from).abs(), most);
            all.get(1).copied().unwrap_or((to - from).abs())
        };
        let across = step(self.x_m, self.size.0, 56.0);
        let down = step(self.y_m, self.size.1, 32.0);
        let (widest, slimmest) = (self.size.0.max(self.size.1), self.size.0.min(self.size.1));
        if self.to_scale && slimmest > 0.4 * widest {
            (across.max(down), across.max(down))
        } else {
            (across, down)
        }
    }
}

/// Text turned to run upward along an axis.
pub(super) fn turned(figure: &mut Figure, x: f64, y: f64, text: &str) {
    let more = format!(
        "text-anchor=\"middle\" {SOFT} transform=\"rotate(-90 {} {})\"",
        Short(x),
        Short(y)
    );
    figure.text(x, y, &more, text);
}

/// A place worth finding: a cross with a word beside it, readable on any colour.
pub(super) fn mark(figure: &mut Figure, (x, y): (f64, f64), word: &str, inside: &View) {
    let (px, py) = (Short(x), Short(y));
    for (width, colour) in [(4, "#fff"), (2, "#000")] {
        figure.raw(format_args!(
            "<path d=\"M{px} {py}m-7 0h5m4 0h5m-7 -7v5m0 4v5\" stroke=\"{colour}\" stroke-width=\"{width}\" fill=\"none\"/>"
        ));
    }
    // toward the middle, so that it stays on the map
    let left = x > LEFT + 0.75 * inside.size.0;
    let (dx, anchor) = if left {
        (-10.0, "end")
    } else {
        (10.0, "start")
    };
    let dy = if y < inside.top + 16.0 { 16.0 } else { -6.0 };
    let more = format!(
        "text-anchor=\"{anchor}\" font-weight=\"600\" {}",
        halo("#000", "#fff")
    );
    figure.text(x + dx, y + dy, &more, word);
}

/// Attributes of text that is read on any ground.
pub(super) fn halo(ink: &str, around: &str) -> String {
    format!(
        "fill=\"{ink}\" stroke=\"{around}\" stroke-width=\"3\" stroke-linejoin=\"round\" stroke-opacity=\".85\" \
         paint-order=\"stroke\""
    )
}
