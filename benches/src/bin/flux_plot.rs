//! Figures of what `flux_error` measured: error against rays, and against time for rays and convolution.
//!
//! ```text
//! flux_plot --lines FILE --out DIR
//! ```
//!
//! Writes flux-error-rays.svg and flux-error-time.svg.

use std::fs;
use std::path::Path;

use helio_bench::Options;
use helio_report::flux::{Convergence, Series, convergence};
use serde::Deserialize;

#[derive(Debug, Clone, Deserialize)]
struct Line {
    scene: String,
    elements: usize,
    way: String,
    rays: f64,
    seconds: f64,
    rms_of_peak: f64,
}

/// A curve of one scene and way.
struct Curve {
    name: String,
    way: String,
    lines: Vec<Line>,
}

fn main() -> Result<(), String> {
    let options = Options::from_arguments(&["lines", "out"])?;
    let path = options.path("lines")?;
    let out = options.path("out")?;
    let read = fs::read_to_string(path).map_err(|error| format!("{}: {error}", path.display()))?;
    let curves = curves(&read)?;
    let rays: Vec<_> = curves.iter().filter(|curve| curve.way == "rays").collect();
    let effort = |line: &Line| line.rays;
    let title = "How the error of a map falls with rays";
    draw(
        &out.join("flux-error-rays.svg"),
        title,
        "rays",
        &rays,
        effort,
    )?;
    // A mesh ten times as fine adds nothing to see here.
    let all: Vec<_> = curves
        .iter()
        .filter(|curve| curve.lines[0].elements < 100_000)
        .collect();
    let title = "How the error of a map falls with time";
    draw(
        &out.join("flux-error-time.svg"),
        title,
        "seconds on two threads",
        &all,
        |line| line.seconds,
    )
}

fn curves(text: &str) -> Result<Vec<Curve>, String> {
    let mut curves: Vec<Curve> = Vec::new();
    for line in text.lines() {
        let line: Line = serde_json::from_str(line).map_err(|error| error.to_string())?;
        let things = if line.elements == 1 {
            "1 element".to_owned()
        } else {
            format!("{} elements", line.elements)
        };
        let name = format!("{}, {things}, {}", line.scene, line.way);
        match curves.iter_mut().find(|curve| curve.name == name) {
            Some(curve) => curve.lines.push(line),
            None => curves.push(Curve {
                name,
                way: line.way.clone(),
                lines: vec![line],
            }),
        }
    }
    Ok(curves)
}

fn draw(
    path: &Path,
    title: &str,
    x_name: &str,
    curves: &[&Curve],
    effort: impl Fn(&Line) -> f64,
) -> Result<(), String> {
    let columns: Vec<(Vec<f64>, Vec<f64>)> = curves
        .iter()
        .map(|curve| {
            curve
                .lines
                .iter()
                .map(|line| (effort(line), line.rms_of_peak))
                .unzip()
        })
        .collect();
    let series: Vec<_> = curves
        .iter()
        .zip(&columns)
        .map(|(curve, (x, y))| Series {
            name: &curve.name,
            x,
            y,
            fit: x.len() > 2 && x_name == "rays",
        })
        .collect();
    let figure = convergence(&Convergence {
        title,
        x_name,
        y_name: "root mean square error of the bins, of the peak",
        series: &series,
    })
    .map_err(|error| error.to_string())?;
    fs::write(path, figure.to_svg()).map_err(|error| format!("{}: {error}", path.display()))
}
