//! `helio-rs`: axis angles of whole heliostat fields from the command line.
//!
//! `args` holds what was typed, `plan` what it means, `commands` does it, `printer` talks.

mod args;
mod commands;
mod failure;
mod plan;
mod plot;
mod printer;

use std::process::ExitCode;

use args::{Args, Verb};
use failure::Failure;
use printer::Printer;

/// What a run came to.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Outcome {
    /// Everything was computed.
    Good,
    /// Some rows have a status other than `ok` or `sun_below_horizon`.
    SomeRowsFailed,
}

fn main() -> ExitCode {
    keep_silent_about_damaged_files();
    let args = Args::typed();
    let printer = Printer::new(args.verb.is_quiet());
    match run(&args, &printer) {
        Ok(Outcome::Good) => ExitCode::SUCCESS,
        Ok(Outcome::SomeRowsFailed) => ExitCode::from(1),
        // Whoever read our output has enough: nothing went wrong here.
        Err(failure) if failure.is_closed_pipe() => ExitCode::SUCCESS,
        Err(failure) => {
            printer.error(&failure);
            ExitCode::from(failure.exit_code())
        }
    }
}

/// The readers of Parquet and of pictures panic on some damaged files; that is caught and becomes a message of ours.
fn keep_silent_about_damaged_files() {
    let hook = std::panic::take_hook();
    std::panic::set_hook(Box::new(move |info| {
        let parquet = std::thread::current().name() == Some(helio_io::PARQUET_THREAD);
        if !parquet && !helio_spot::is_decoding() {
            hook(info);
        }
    }));
}

fn run(args: &Args, printer: &Printer) -> Result<Outcome, Failure> {
    match &args.verb {
        Verb::Init(init) => commands::init::run(init, printer),
        Verb::Check(check) => commands::check::run(check, printer),
        Verb::Track(track) => commands::track::run(track, printer),
        Verb::Predict(predict) => commands::predict::run(predict, printer),
        Verb::Calibrate(calibrate) => commands::calibrate::run(calibrate, printer),
        Verb::Spot(spot) => commands::spot::run(spot, printer),
        Verb::Flux(flux) => commands::flux::run(flux, printer),
        Verb::Accuracy(accuracy) => commands::accuracy::run(accuracy, printer),
        Verb::Simulate { what } => commands::simulate::run(what, printer),
        Verb::Convert { what } => commands::convert::run(what, printer),
        Verb::Schema { of } => commands::schema::run(*of, printer),
    }
}
