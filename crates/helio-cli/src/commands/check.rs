//! `check`: reads everything and says what is there and whether it can work.

use helio_io::{CheckError, FieldCheck};

use crate::Outcome;
use crate::args::{CheckArgs, NO_SHADING};
use crate::failure::Failure;
use crate::plan;
use crate::printer::Printer;

pub(crate) fn run(args: &CheckArgs, printer: &Printer) -> Result<Outcome, Failure> {
    let loaded = plan::field(&args.field, printer)?;
    let now_ns = jiff::Timestamp::now()
        .as_second()
        .saturating_mul(1_000_000_000);
    let check =
        FieldCheck::of(&loaded, &loaded.files, now_ns, &|_, _| true).map_err(
            |error| match error {
                CheckError::Sun(error) => error.into(),
                CheckError::Track(error) => error.into(),
                _ => Failure::refused(error.to_string()),
            },
        )?;
    printer.data(&check.text)?;
    printer.say(format_args!("{NO_SHADING}"));
    Ok(Outcome::Good)
}
