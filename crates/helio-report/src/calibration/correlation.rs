//! Correlation matrices.

use super::plot::{Canvas, WIDTH};
use super::{EpochSection, HeliostatSection};

/// More epochs than this are not drawn.
const MOST_EPOCHS: usize = 6;
const CELL: f64 = 36.0;
/// Names longer than this many letters are cut.
const MOST_LETTERS: usize = 34;

fn drawable(epoch: &EpochSection) -> bool {
    let n = epoch.correlation_names.len();
    n > 1 && epoch.correlation.len() == n && epoch.correlation.iter().all(|row| row.len() == n)
}

/// The matrices of all epochs, or nothing where there are none.
pub(super) fn figure(section: &HeliostatSection) -> Option<String> {
    let all: Vec<(usize, &EpochSection)> = section
        .epochs
        .iter()
        .enumerate()
        .filter(|(_, e)| drawable(e))
        .collect();
    let shown = &all[..all.len().min(MOST_EPOCHS)];
    let most = shown.iter().map(|(_, e)| e.correlation_names.len()).max()?;
    let head = if section.epochs.len() > 1 { 50.0 } else { 28.0 };
    let each = head + CELL * most as f64 + 16.0;
    let mut canvas = Canvas::new(each * shown.len().div_ceil(2) as f64);
    for (place, (number, epoch)) in shown.iter().enumerate() {
        let left = WIDTH / 2.0 * (place % 2) as f64 + 16.0;
        let top = each * (place / 2) as f64 + head;
        if section.epochs.len() > 1 {
            canvas.text(
                left,
                top - 26.0,
                "name",
                &format!("{} {}", section.part(), number + 1),
            );
        }
        matrix(&mut canvas, left, top, epoch);
    }
    let mut caption = "Correlations of the fitted parameters. Near 1 or \u{2212}1 the records cannot tell two of them apart."
        .to_owned();
    if shown.len() < all.len() {
        caption.push_str(&format!(
            " The first {} of {} {}s.",
            shown.len(),
            all.len(),
            section.part()
        ));
    }
    let title = format!("Heliostat {}: correlations", section.id);
    let description = strongest(shown);
    Some(super::page::figure(
        &canvas.element(&title, &description),
        &caption,
    ))
}

pub(crate) fn matrix(canvas: &mut Canvas, left: f64, top: f64, epoch: &EpochSection) {
    let names: Vec<String> = epoch
        .correlation_names
        .iter()
        .enumerate()
        .map(|(i, name)| shortened(&format!("{} {name}", i + 1), MOST_LETTERS))
        .collect();
    let letters = names.iter().map(|n| n.chars().count()).max().unwrap_or(0);
    let left = left + 10.0 + 5.6 * letters as f64;
    for (i, name) in names.iter().enumerate() {
        let y = top + CELL * (i as f64 + 0.5) + 4.0;
        canvas.text(left - 10.0, y, "e small", name);
        let x = left + CELL * (i as f64 + 0.5);
        canvas.text(x, top - 6.0, "m", &(i + 1).to_string());
    }
    for (i, row) in epoch.correlation.iter().enumerate() {
        for (j, &value) in row.iter().enumerate().take(i + 1) {
            let (x, y) = (left + CELL * j as f64 + 1.0, top + CELL * i as f64 + 1.0);
            let size = (CELL - 2.0, CELL - 2.0);
            if i == j || !value.is_finite() {
                canvas.rect(x, y, size, format_args!("class=\"cell\""));
            } else {
                let (class, depth) = (
                    if value < 0.0 { "f0" } else { "f1" },
                    0.75 * value.abs().min(1.0),
                );
                canvas.rect(
                    x,
                    y,
                    size,
                    format_args!("class=\"{class}\" fill-opacity=\"{depth:.2}\""),
                );
            }
            let text = if value.is_finite() {
                // Nearly one is not one.
                let round = if i == j {
                    value
                } else {
                    value.clamp(-0.99, 0.99)
                };
                let text = format!("{round:.2}").replace('-', "\u{2212}");
                if i == j { "1".to_owned() } else { text }
            } else {
                "–".to_owned()
            };
            canvas.text(x + size.0 / 2.0, y + size.1 / 2.0 + 4.0, "m small", &text);
        }
    }
}

pub(crate) fn shortened(name: &str, most: usize) -> String {
    if name.chars().count() <= most {
        return name.to_owned();
    }
    let mut short: String = name.chars().take(most - 1).collect();
    short.push('…');
    short
}

/// The strongest correlation in words.
fn strongest(epochs: &[(usize, &EpochSection)]) -> String {
    let mut best: Option<(f64, &str, &str)> = None;
    for (_, epoch) in epochs {
        for (i, row) in epoch.correlation.iter().enumerate() {
            for (j, &value) in row.iter().enumerate().take(i) {
                if value.is_finite() && best.is_none_or(|(b, ..)| value.abs() > b.abs()) {
                    let names = &epoch.correlation_names;
                    best = Some((value, &names[i], &names[j]));
                }
            }
        }
    }
    best.map_or_else(
        || "No correlations are known.".to_owned(),
        |(value, a, b)| format!("The strongest is {value:.2}, between {a} and {b}."),
    )
}
