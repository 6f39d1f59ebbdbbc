//! `simulate`: synthetic fields, observations and camera frames.

use helio_core::layout::Measures;
use helio_io::output::write_table;
use helio_io::{LayoutPattern, SimulatedLayout};

use crate::Outcome;
use crate::args::{LayoutWord, Simulate, SimulateFieldArgs};
use crate::failure::Failure;
use crate::plan;
use crate::printer::{Bytes, Grouped, Printer};

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
    let pattern = match args.layout {
        LayoutWord::RadialStaggered => LayoutPattern::RadialStaggered,
        LayoutWord::FermatSpiral => LayoutPattern::FermatSpiral,
    };
    let measures = Measures {
        count: args.heliostats as usize,
        tower_height_m: args.tower_height_m,
        mirror_width_m: args.mirror_width_m,
        mirror_height_m: args.mirror_height_m,
        up_m: args.pivot_height_m,
    };
    let layout = SimulatedLayout::generate(pattern, &measures);
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
