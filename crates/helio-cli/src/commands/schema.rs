//! `schema`: JSON Schema of field.toml and target.toml.

use crate::Outcome;
use crate::args::SchemaWord;
use crate::failure::Failure;
use crate::printer::Printer;

pub(crate) fn run(of: SchemaWord, printer: &Printer) -> Result<Outcome, Failure> {
    let schema = match of {
        SchemaWord::Field => helio_io::schema(),
        SchemaWord::Target => helio_io::target_schema(),
    };
    printer.data(&format!("{schema:#}\n"))?;
    Ok(Outcome::Good)
}
