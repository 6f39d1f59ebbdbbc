//! `schema`: JSON Schema of field.toml, target.toml and scene.toml.

use crate::Outcome;
use crate::args::SchemaWord;
use crate::failure::Failure;
use crate::printer::Printer;

pub(crate) fn run(of: SchemaWord, printer: &Printer) -> Result<Outcome, Failure> {
    let schema = match of {
        SchemaWord::Field => helio_io::schema(),
        SchemaWord::Target => helio_io::target_schema(),
        SchemaWord::Scene => helio_io::scene_schema(),
    };
    printer.data(&format!("{schema:#}\n"))?;
    Ok(Outcome::Good)
}
