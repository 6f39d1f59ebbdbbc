//! Times sun positions, each figure a line of JSON on one thread: `sun [REPEATS]`.
//!
//! Bulk: nanoseconds per instant from integer nanoseconds to azimuth and both elevations, the ephemeris
//! at hand; sorted (a sun every 10 s) and in random order over a year. Direct: the reference evaluation.
//! Making: the ephemeris of a span.
#![allow(clippy::print_stdout)]

use std::hint::black_box;

use helio_bench::nanoseconds;
use helio_core::SimdLevel;
use helio_core::sun::{SunEphemeris, SunError, SunPositions, SunSite, position};

const SECOND: i64 = 1_000_000_000;
const DAY: i64 = 86_400 * SECOND;
/// 2026-01-01T00:00:00Z
const FROM: i64 = 1_767_225_600 * SECOND;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let repeats = std::env::args()
        .nth(1)
        .map_or(Ok(11), |text| text.parse::<usize>())?;
    let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build()?;
    Ok(pool.install(|| run(repeats))?)
}

fn run(repeats: usize) -> Result<(), SunError> {
    let site = SunSite::new(0.888_607, 0.111_488, 87.0)?;
    let ephemeris = SunEphemeris::new(FROM, FROM + 366 * DAY, None, 0.0)?;
    for &level in SimdLevel::available().iter().rev() {
        for n in [1_i64, 1000, 100_000] {
            let sorted: Vec<i64> = (0..n).map(|k| FROM + k * 10 * SECOND).collect();
            let shuffled: Vec<i64> = (0..n)
                .map(|k| FROM + (k * 7_919_000_003 * SECOND + k).rem_euclid(365 * DAY))
                .collect();
            for (order, instants) in [("sorted", sorted), ("random", shuffled)] {
                let mut out = SunPositions::default();
                let mut work = || ephemeris.positions_into(&site, &instants, Some(level), &mut out);
                work()?;
                let (least, median) = nanoseconds(repeats, || {
                    let _ = black_box(work());
                });
                println!(
                    "{{\"what\": \"bulk {order}\", \"level\": \"{level}\", \"n\": {n}, \
                     \"ns_per_instant_min\": {:.3}, \"ns_per_instant_median\": {:.3}}}",
                    least / n as f64,
                    median / n as f64
                );
            }
        }
    }
    let (least, median) = nanoseconds(repeats, || {
        let _ = black_box(position(&site, black_box(FROM), None, 0.0));
    });
    println!("{{\"what\": \"direct\", \"ns_min\": {least:.0}, \"ns_median\": {median:.0}}}");
    for (span, days) in [("day", 1), ("year", 365)] {
        let (least, median) = nanoseconds(repeats, || {
            let _ = black_box(SunEphemeris::new(FROM, FROM + days * DAY - 1, None, 0.0));
        });
        println!(
            "{{\"what\": \"making a {span}\", \"ns_min\": {least:.0}, \"ns_median\": {median:.0}}}"
        );
    }
    Ok(())
}
