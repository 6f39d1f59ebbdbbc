//! The next observations, as they are asked for and where they go.

use helio_calib::Proposal;
use helio_io::LoadedField;
use helio_io::calibrate::Proposals;

use crate::args::CalibrateArgs;
use crate::failure::Failure;
use crate::plan;
use crate::printer::{Bytes, Printer};

/// What is asked of the next observations, if they are.
pub(super) fn proposals_of(
    args: &CalibrateArgs,
    loaded: &LoadedField,
) -> Result<Option<Proposals>, Failure> {
    let (Some(count), Some(date)) = (args.plan, &args.plan_date) else {
        return Ok(None);
    };
    Ok(Some(Proposals::new(usize::from(count), date, loaded)?))
}

/// Writes proposals, each with the row of its heliostat in the field.
pub(super) fn write_proposals(
    proposals: &Proposals,
    rows: &[(usize, Proposal)],
    args: &CalibrateArgs,
    loaded: &LoadedField,
    printer: &Printer,
) -> Result<(), Failure> {
    let format = plan::format(args.plan_out.as_deref(), None)?;
    let destination = plan::destination(args.plan_out.as_deref(), format, &[], printer)?;
    let bytes = proposals.write(rows, loaded, destination, format)?;
    printer.say(format_args!("proposed observations: {}", Bytes(bytes)));
    Ok(())
}
