//! Times the calibration of a whole field and writes its campaigns for the peers.
//!
//! ```text
//! calibration [--heliostats N] [--observations M] [--threads T] [--repeat R] [--level scalar|avx2|avx512]
//!             [--covariance true] [--campaigns FILE] [--output ANSWERS]
//! ```
#![allow(clippy::print_stdout)]

use std::hint::black_box;
use std::path::Path;

use helio_bench::campaigns::Campaigns;
use helio_bench::{Nanoseconds, Options, write_answers};
use helio_calib::{FieldFitOptions, fit_field};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    const KNOWN: [&str; 8] = [
        "heliostats",
        "observations",
        "threads",
        "repeat",
        "level",
        "covariance",
        "campaigns",
        "output",
    ];
    let options = Options::from_arguments(&KNOWN)?;
    let heliostats = options.number("heliostats", 10_000)?;
    let per_heliostat = options.number("observations", 50)?;
    let field = Campaigns::new(heliostats, per_heliostat, 20_150_901)?;
    if let Some(path) = options.text("campaigns") {
        field.write(Path::new(path))?;
    }
    let level = options.level()?;
    let fit_options = FieldFitOptions {
        threads: options.number("threads", 1)?,
        level: Some(level),
        with_covariance: options.number("covariance", false)?,
        ..FieldFitOptions::default()
    };
    let campaigns = field.campaigns();
    let fits = fit_field(&campaigns, &fit_options);
    let mut answers = Vec::new();
    for (number, fit) in fits.iter().enumerate() {
        let fit = fit.as_ref().map_err(ToString::to_string)?;
        if !fit.stop.converged() {
            return Err(format!("heliostat {number}: {}", fit.stop.as_str()).into());
        }
        answers.extend(&fit.parameters.values[..6]);
        answers.push(fit.sum_of_squares);
    }
    if let Some(path) = options.text("output") {
        write_answers(Path::new(path), &[&answers], &[])?;
    }
    let time = Nanoseconds::of(options.number("repeat", 11)?, || {
        let _ = black_box(fit_field(&campaigns, &fit_options));
    });
    println!(
        "{{\"peer\": \"helio_rs\", \"version\": \"{} {level}\", \"heliostats\": {heliostats}, \"observations\": {per_heliostat}, \
         \"threads\": {}, \"ns_per_fit\": {}}}",
        env!("CARGO_PKG_VERSION"),
        fit_options.threads,
        time.json(heliostats)
    );
    Ok(())
}
