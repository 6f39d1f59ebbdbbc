//! Times the tracking kernel on an input file of the peers.
//!
//! ```text
//! kernel --input FILE [--threads T] [--repeat R] [--level scalar|avx2|avx512]
//!        [--offset exact|approximate|iterated:N|none] [--output ANSWERS]
//! ```
#![allow(clippy::print_stdout)]

use std::hint::black_box;
use std::path::Path;

use helio_bench::{Nanoseconds, Options, PeerInput, write_answers};
use helio_core::{OffsetForm, Status, TrackOptions, Tracker, Tracking};

const KNOWN: [&str; 6] = ["input", "threads", "repeat", "level", "offset", "output"];

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let options = Options::from_arguments(&KNOWN)?;
    let input = PeerInput::read(options.path("input")?)?;
    let level = options.level()?;
    let offset = offset_form(options.text("offset").unwrap_or("exact"))?;
    let track_options = TrackOptions {
        threads: options.number("threads", 1)?,
        level: Some(level),
    };
    let tracker = Tracker::new(&input.field()?, offset).map_err(|error| error.to_string())?;
    let suns = [input.sun];
    let mut out = Tracking::default();
    tracker.track_into(&suns, None, &track_options, &mut out)?;
    if let Some(path) = options.text("output") {
        let codes: Vec<u8> = out.status().iter().map(|&status| status.code()).collect();
        let columns = [out.axis1_rad(), out.axis2_rad(), out.incidence_rad()];
        write_answers(Path::new(path), &columns, &codes)?;
    }
    let time = Nanoseconds::of(options.number("repeat", 11)?, || {
        let _ = black_box(tracker.track_into(&suns, None, &track_options, &mut out));
    });
    let rows_not_ok = out.status().iter().filter(|&&s| s != Status::Ok).count();
    println!(
        "{{\"peer\": \"helio_rs\", \"version\": \"{} {level}\", \"n\": {}, \"threads\": {}, \
         \"rows_not_ok\": {rows_not_ok}, \"ns_per_heliostat\": {}}}",
        env!("CARGO_PKG_VERSION"),
        tracker.len(),
        track_options.threads,
        time.json(tracker.len())
    );
    Ok(())
}

fn offset_form(text: &str) -> Result<OffsetForm, String> {
    let wrong =
        || format!("--offset: expected exact, approximate, iterated:N or none, got {text:?}");
    match text {
        "exact" => Ok(OffsetForm::Exact),
        "approximate" => Ok(OffsetForm::Approximate),
        "none" => Ok(OffsetForm::None),
        _ => {
            let count = text.strip_prefix("iterated:").ok_or_else(wrong)?;
            count.parse().map(OffsetForm::Iterated).map_err(|_| wrong())
        }
    }
}
