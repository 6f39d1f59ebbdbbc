//! `simulate`: synthetic fields, observations and camera frames.

use helio_core::Enu;
use helio_core::layout::{Measures, fermat_spiral, radial_staggered};
use helio_io::output::write_table;

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
    mirror_m: (11.0, 10.0),
    pivot_height_m: 6.0,
};

pub(crate) fn run(what: &Simulate, printer: &Printer) -> Result<Outcome, Failure> {
    match what {
        Simulate::Field(args) => field(args, printer),
        Simulate::Campaign(args) => super::accuracy::simulate_campaign(args, printer),
        Simulate::Observations(args) => super::observations::run(args, printer),
        Simulate::Images(args) => super::images::run(args, printer),
    }
}

fn field(args: &SimulateFieldArgs, printer: &Printer) -> Result<Outcome, Failure> {
    let format = plan::format(args.out.as_deref(), args.format)?;
    let destination = plan::destination(args.out.as_deref(), format, &[], printer)?;
    let layout = Layout::generate(&LayoutPlan {
        pattern: args.layout,
        heliostats: args.heliostats,
        tower_height_m: args.tower_height_m,
        mirror_m: (args.mirror_width_m, args.mirror_height_m),
        pivot_height_m: args.pivot_height_m,
    });
    let bytes = write_table(destination, format, &layout.ids, &layout.columns())?;
    let farthest_m = layout
        .east_m
        .iter()
        .zip(&layout.north_m)
        .map(|(&east_m, &north_m)| f64::hypot(east_m, north_m))
        .fold(0.0, f64::max);
    printer.say(format_args!(
        "{} heliostats within {farthest_m:.0} m of the tower; {}",
        Grouped(layout.ids.len() as u64),
        Bytes(bytes)
    ));
    Ok(Outcome::Good)
}

/// A generated layout as columns.
pub(crate) struct Layout {
    ids: Vec<String>,
    east_m: Vec<f64>,
    north_m: Vec<f64>,
    up_m: Vec<f64>,
}

impl Layout {
    pub(crate) fn generate(plan: &LayoutPlan) -> Self {
        let pivots = pivots(plan);
        // Nobody sets up a heliostat by less, and short numbers read well.
        let millimetres = |m: f64| (m * 1000.0).round() / 1000.0 + 0.0;
        let column = |of: fn(&Enu) -> f64| pivots.iter().map(|p| millimetres(of(p))).collect();
        Self {
            ids: ids(pivots.len()),
            east_m: column(|p| p.east),
            north_m: column(|p| p.north),
            up_m: column(|p| p.up),
        }
    }

    /// The columns after `id`.
    pub(crate) fn columns(&self) -> [(&'static str, &[f64]); 3] {
        [
            ("east_m", &self.east_m),
            ("north_m", &self.north_m),
            ("up_m", &self.up_m),
        ]
    }

    pub(crate) fn ids(&self) -> &[String] {
        &self.ids
    }
}

/// Names of so many heliostats, all of the same length so that they sort.
fn ids(count: usize) -> Vec<String> {
    let digits = count.to_string().len();
    (1..=count).map(|i| format!("H{i:0digits$}")).collect()
}

fn pivots(plan: &LayoutPlan) -> Vec<Enu> {
    let measures = Measures {
        count: plan.heliostats as usize,
        tower_height_m: plan.tower_height_m,
        mirror_width_m: plan.mirror_m.0,
        mirror_height_m: plan.mirror_m.1,
        up_m: plan.pivot_height_m,
    };
    match plan.pattern {
        LayoutWord::RadialStaggered => radial_staggered(&measures),
        LayoutWord::FermatSpiral => fermat_spiral(&measures),
    }
}
