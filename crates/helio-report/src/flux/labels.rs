//! Contour lines on a drawing, and numbers on them that do not run into each other.

use super::contours::Contours;
use super::scale::{ColourScale, ink_on};
use super::view::{View, halo};
use crate::svg::{Figure, Short};
use crate::ticks::label;

/// Length that a line needs for a number, and below which it is left out unless it is its level's longest \[px\].
const LABELLED: f64 = 70.0;
const SPECK: f64 = 26.0;

/// A place of text that others keep away from: middle and half of its size.
#[derive(Debug, Clone, Copy)]
pub(super) struct Taken {
    pub(super) middle: (f64, f64),
    pub(super) half: (f64, f64),
}

impl Taken {
    fn meets(&self, other: &Self) -> bool {
        (self.middle.0 - other.middle.0).abs() < self.half.0 + other.half.0
            && (self.middle.1 - other.middle.1).abs() < self.half.1 + other.half.1
    }
}

/// Draws the lines, and their values times `factor` where there is room beside what is taken.
pub(super) fn draw(
    figure: &mut Figure,
    contours: &Contours,
    (view, scale, factor): (&View, &ColourScale, f64),
    taken: &mut Vec<Taken>,
) {
    let values: Vec<f64> = contours
        .levels
        .iter()
        .map(|level| level.value * factor)
        .collect();
    let mut numbers = Vec::new();
    for level in &contours.levels {
        let mut lines: Vec<(f64, Vec<(f64, f64)>)> = level
            .lines
            .iter()
            .map(|line| line.iter().map(|&(x, y)| view.at(x, y)).collect())
            .map(|line: Vec<(f64, f64)>| (length(&line), line))
            .collect();
        // the longest first; equals stay in their order
        lines.sort_by(|a, b| b.0.total_cmp(&a.0));
        let longest = lines.first().map_or(0.0, |line| line.0);
        lines.retain(|line| line.0 >= SPECK || line.0 == longest);
        let ink = ink_on(scale.part(level.value));
        path(figure, &lines, ink);
        numbers.push((level.value, ink, lines));
    }
    // from the highest: its lines are the shortest and have the fewest places
    for (value, ink, lines) in numbers.iter().rev() {
        let text = label(value * factor, &values);
        let half = (4.0 + 3.7 * text.chars().count() as f64, 8.0);
        for (_, line) in lines.iter().filter(|line| line.0 > LABELLED).take(2) {
            if let Some(middle) = place(line, half, view, taken) {
                taken.push(Taken { middle, half });
                let around = if *ink == "#fff" { "#222" } else { "#fff" };
                let more = format!(
                    "text-anchor=\"middle\" class=\"level\" {}",
                    halo(ink, around)
                );
                figure.text(middle.0, middle.1 + 4.0, &more, &text);
            }
        }
    }
}

fn path(figure: &mut Figure, lines: &[(f64, Vec<(f64, f64)>)], ink: &str) {
    let mut path = String::new();
    for (_, line) in lines {
        for (k, &(x, y)) in line.iter().enumerate() {
            let command = if k == 0 { 'M' } else { 'L' };
            path.push_str(&format!("{command}{} {}", Short(x), Short(y)));
        }
    }
    if !path.is_empty() {
        figure.raw(format_args!(
            "<path class=\"contour\" d=\"{path}\" fill=\"none\" stroke=\"{ink}\" stroke-opacity=\".75\" \
             stroke-linejoin=\"round\"/>"
        ));
    }
}

fn length(line: &[(f64, f64)]) -> f64 {
    line.windows(2)
        .map(|w| (w[1].0 - w[0].0).hypot(w[1].1 - w[0].1))
        .sum()
}

/// The most level place of a line where a number has room; `None` without one.
fn place(
    line: &[(f64, f64)],
    half: (f64, f64),
    view: &View,
    taken: &[Taken],
) -> Option<(f64, f64)> {
    let inside = |(x, y): (f64, f64)| {
        let (low, high) = (view.at(0.0, 0.0), view.at(1.0, 1.0));
        x - half.0 > low.0 && x + half.0 < high.0 && y - half.1 > low.1 && y + half.1 < high.1
    };
    let around = 3.min(line.len().saturating_sub(1) / 2);
    let mut best: Option<(f64, (f64, f64))> = None;
    for k in around..line.len() - around {
        let at = line[k];
        let free = |t: &Taken| !t.meets(&Taken { middle: at, half });
        if !inside(at) || !taken.iter().all(free) {
            continue;
        }
        let (a, b) = (line[k - around], line[k + around]);
        let steep = (b.1 - a.1).abs() / (b.0 - a.0).hypot(b.1 - a.1).max(1e-9);
        if best.is_none_or(|best| steep < best.0 - 1e-9) {
            best = Some((steep, at));
        }
    }
    best.map(|best| best.1)
}
