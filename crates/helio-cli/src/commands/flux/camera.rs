//! From a camera's gray values to W/m², by one reading of a gauge.

use std::path::Path;

use crate::Outcome;
use crate::args::FluxArgs;
use crate::failure::Failure;
use crate::printer::Printer;

pub(super) fn run(_frame: &Path, _args: &FluxArgs, _printer: &Printer) -> Result<Outcome, Failure> {
    Err(Failure::refused("--camera"))
}
