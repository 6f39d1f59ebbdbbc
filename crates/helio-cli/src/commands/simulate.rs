//! `simulate`: synthetic fields, observations and camera frames.

use helio_core::layout::Measures;
use helio_io::output::write_table;
use helio_io::{LayoutPattern, SimulatedLayout};

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
    let layout = layout(&LayoutPlan {
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

/// A layout as it is planned.
pub(crate) fn layout(plan: &LayoutPlan) -> SimulatedLayout {
    let measures = Measures {
        count: plan.heliostats as usize,
        tower_height_m: plan.tower_height_m,
        mirror_width_m: plan.mirror_m.0,
        mirror_height_m: plan.mirror_m.1,
        up_m: plan.pivot_height_m,
    };
    let pattern = match plan.pattern {
        LayoutWord::RadialStaggered => LayoutPattern::RadialStaggered,
        LayoutWord::FermatSpiral => LayoutPattern::FermatSpiral,
    };
    SimulatedLayout::generate(pattern, &measures)
}
