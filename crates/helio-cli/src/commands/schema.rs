//! `schema`: JSON Schema of field.toml.

use crate::Outcome;
use crate::failure::Failure;
use crate::printer::Printer;

pub(crate) fn run(printer: &Printer) -> Result<Outcome, Failure> {
    printer.data(&format!("{:#}\n", helio_io::schema()))?;
    Ok(Outcome::Good)
}
