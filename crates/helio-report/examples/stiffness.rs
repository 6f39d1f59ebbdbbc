//! Slope errors by both methods of Yan 2022 over the bending stiffness of the glass, and their largest difference.
//!
//! ```sh
//! cargo run --release -p helio-report --example stiffness -- examples/flux/stiffness.csv docs/figures/stiffness.svg
//! ```

use std::env;
use std::error::Error;
use std::fs;

use helio_report::flux::{Series, SeriesPlot, series_plot};
use helio_report::stack;

#[allow(
    dead_code,
    reason = "a test draws the figure too and has a main of its own"
)]
fn main() -> Result<(), Box<dyn Error>> {
    let arguments: Vec<String> = env::args().skip(1).collect();
    let [table, figure] = &arguments[..] else {
        return Err("wanted: TABLE.csv FIGURE.svg".into());
    };
    fs::write(figure, svg(&fs::read_to_string(table)?)?)?;
    Ok(())
}

/// The figure of a table with the columns of `examples/flux/stiffness.csv`.
pub fn svg(table: &str) -> Result<String, Box<dyn Error>> {
    let mut reader = csv::Reader::from_reader(table.as_bytes());
    let names = reader.headers()?.clone();
    let rows: Vec<csv::StringRecord> = reader.records().collect::<Result<_, _>>()?;
    let column = |name: &str| -> Result<Vec<f64>, Box<dyn Error>> {
        let at = names.iter().position(|n| n == name);
        let at = at.ok_or_else(|| format!("there is no column {name}"))?;
        Ok(rows
            .iter()
            .map(|row| row[at].parse())
            .collect::<Result<_, _>>()?)
    };
    let stiffness_n_m = column("stiffness_n_m")?;
    let (elements, pose) = (column("elements_mrad")?, column("pose_mrad")?);
    let difference = column("largest_difference_mrad")?;
    let series = |name, y, fit| Series {
        name,
        x: &stiffness_n_m,
        y,
        fit,
    };
    let x_name = "bending stiffness of the glass (N m)";
    let both = series_plot(&SeriesPlot {
        title: "Largest slope error of the loaded strips by two methods",
        x_name,
        y_name: "slope error (mrad)",
        x_log: true,
        y_log: false,
        series: &[
            series("planar element substitution", &elements, false),
            series("mirror pose reconstruction", &pose, false),
        ],
    })?;
    let apart = series_plot(&SeriesPlot {
        title: "Where facets bend, the methods part",
        x_name,
        y_name: "largest difference of a face (mrad)",
        x_log: true,
        y_log: true,
        series: &[series("largest difference", &difference, true)],
    })?;
    Ok(stack(&[both, apart]).to_svg())
}
