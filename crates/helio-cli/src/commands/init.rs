//! `init`: a field to start from.

use std::path::Path;

use helio_io::{ExampleError, ExampleField, write_example_field};

use crate::Outcome;
use crate::args::InitArgs;
use crate::failure::Failure;
use crate::printer::Printer;

pub(crate) fn run(args: &InitArgs, printer: &Printer) -> Result<Outcome, Failure> {
    let ExampleField {
        field,
        table,
        heliostats,
        ..
    } = write_example_field(&args.dir, args.force).map_err(|error| match error {
        ExampleError::Io(error) => error.into(),
        ExampleError::There { .. } => Failure::refused(format!("{error}; --force replaces it")),
        _ => Failure::refused(error.to_string()),
    })?;
    let shown = field.display();
    printer.say(format_args!("{shown} and {table}: {heliostats} heliostats"));
    printer.say(format_args!(
        "next: helio-rs track --field {}",
        Quoted(&field)
    ));
    Ok(Outcome::Good)
}

/// A path as a shell takes it.
struct Quoted<'a>(&'a Path);

impl std::fmt::Display for Quoted<'_> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let text = self.0.display().to_string();
        let plain = |c: char| c.is_alphanumeric() || "/._-+:\\".contains(c);
        if text.chars().all(plain) {
            f.write_str(&text)
        } else {
            write!(f, "'{}'", text.replace('\'', "'\\''"))
        }
    }
}
