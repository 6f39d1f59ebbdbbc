//! Series on logarithmic axes, and the figure of the stiffness in the documentation.

use helio_report::flux::{Convergence, Series, convergence};

use super::drawing::{keep, read};
use super::stiffness;

// On logarithmic axes a power law is a straight line, and a decade is as long anywhere.
#[test]
fn power_laws_are_straight_lines_with_their_slopes() {
    let rays = [1e4, 1e5, 1e6, 1e7, 1e8];
    let half = rays.map(|n: f64| n.powf(-0.5));
    let third = rays.map(|n: f64| 3.0 * n.powf(-0.75));
    let figure = convergence(&Convergence {
        title: "Errors",
        x_name: "rays",
        y_name: "root mean square error over the peak",
        series: &[
            Series {
                name: "random",
                x: &rays,
                y: &half,
                fit: true,
            },
            Series {
                name: "low discrepancy",
                x: &rays,
                y: &third,
                fit: true,
            },
            Series {
                name: "not fitted",
                x: &rays[..2],
                y: &third[..2],
                fit: false,
            },
        ],
    })
    .unwrap();
    keep("flux-convergence", &figure);
    let drawing = read(&figure);
    assert!(drawing.says("random: slope \u{2212}0.50"));
    assert!(drawing.says("low discrepancy: slope \u{2212}0.75"));
    assert!(drawing.texts.iter().any(|t| t.2 == "not fitted"));
    for (_, curve) in drawing.curves.iter().filter(|c| c.1.len() == 5) {
        let step = (curve[1].0 - curve[0].0, curve[1].1 - curve[0].1);
        for pair in curve.windows(2) {
            assert!((pair[1].0 - pair[0].0 - step.0).abs() < 0.2);
            assert!((pair[1].1 - pair[0].1 - step.1).abs() < 0.2);
        }
    }
    for power in ["10⁴", "10⁸", "10⁻²"] {
        assert!(drawing.texts.iter().any(|t| t.2 == power), "{power}");
    }
}

// The figure of the documentation is the one that its table makes.
#[test]
fn the_figure_of_the_stiffness_is_up_to_date() {
    let root = concat!(env!("CARGO_MANIFEST_DIR"), "/../../");
    let read = |path: &str| std::fs::read_to_string(format!("{root}{path}")).unwrap();
    let table = read("examples/flux/stiffness.csv");
    let svg = stiffness::svg(&table).unwrap();
    assert!(
        svg == read("docs/figures/stiffness.svg"),
        "make it again: see crates/helio-report/examples/stiffness.rs"
    );
    // and the table is the one of the readme
    let readme = read("examples/flux/README.md");
    for row in table.lines().skip(1) {
        let cells: Vec<&str> = row.split(',').collect();
        assert!(
            readme.contains(&format!("| {} |", cells.join(" | "))),
            "{row}"
        );
    }
}
