//! Times sun positions on one thread, each figure a line of JSON.
//!
//! ```text
//! sun [--repeat R] [--level scalar|avx2|avx512] [--output ANSWERS]
//! ```
//!
//! Bulk: from integer nanoseconds to azimuth and both elevations, the ephemeris at hand; sorted (a
//! sun every 10 s) and in random order over a year; beside it the greatest difference from the direct
//! evaluation. Direct: the reference evaluation. Making: the ephemeris of a span.
//! `ANSWERS` are those of the sorted 100,000 instants, the ones of `peers/sun_pvlib.py`.
#![allow(clippy::print_stdout)]

use std::hint::black_box;
use std::path::Path;

use helio_bench::{Nanoseconds, Options, write_answers};
use helio_core::SimdLevel;
use helio_core::angle::degrees;
use helio_core::sun::{SunEphemeris, SunPositions, SunSite, position};

const SECOND: i64 = 1_000_000_000;
const DAY: i64 = 86_400 * SECOND;
/// 2026-01-01T00:00:00Z
const FROM: i64 = 1_767_225_600 * SECOND;
const DELTA_T_S: Option<f64> = Some(69.2);
/// Rows of a batch that are also evaluated directly.
const CHECKED: usize = 5000;
const LARGE: i64 = 100_000;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let options = Options::from_arguments(&["repeat", "level", "output"])?;
    let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build()?;
    pool.install(|| run(&options))?;
    Ok(())
}

fn run(options: &Options) -> Result<(), String> {
    let (repeats, level) = (options.number("repeat", 11)?, options.level()?);
    let site = site().map_err(|error| error.to_string())?;
    let ephemeris = SunEphemeris::new(FROM, FROM + 366 * DAY, DELTA_T_S, 0.0)
        .map_err(|error| error.to_string())?;
    for n in [1, 1000, LARGE] {
        let sorted: Vec<i64> = (0..n).map(|k| FROM + k * 10 * SECOND).collect();
        let random: Vec<i64> = (0..n)
            .map(|k| FROM + (k * 7_919_000_003 * SECOND + k).rem_euclid(365 * DAY))
            .collect();
        for (order, instants) in [("sorted", sorted), ("random", random)] {
            let out = bulk(&ephemeris, &site, &instants, order, level, repeats)?;
            if let (Some(path), LARGE, "sorted") = (options.text("output"), n, order) {
                let columns: [&[f64]; 3] = [
                    &out.azimuth_rad,
                    &out.apparent_elevation_rad,
                    &out.geometric_elevation_rad,
                ];
                write_answers(Path::new(path), &columns, &[])?;
            }
        }
    }
    let time = Nanoseconds::of(repeats, || {
        let _ = black_box(position(&site, black_box(FROM), DELTA_T_S, 0.0));
    });
    println!(
        "{{\"what\": \"direct\", \"ns_per_instant\": {}}}",
        time.json(1)
    );
    for (span, days) in [("day", 1), ("year", 365)] {
        let time = Nanoseconds::of(repeats.min(3), || {
            let _ = black_box(SunEphemeris::new(
                FROM,
                FROM + days * DAY - 1,
                DELTA_T_S,
                0.0,
            ));
        });
        println!(
            "{{\"what\": \"making a {span}\", \"ns\": {}}}",
            time.json(1)
        );
    }
    Ok(())
}

fn site() -> Result<SunSite, helio_core::sun::SunError> {
    SunSite::new(0.888_607, 0.111_488, 87.0)?
        .with_pressure_hpa(1003.0)?
        .with_temperature_c(12.0)
}

fn bulk(
    ephemeris: &SunEphemeris,
    site: &SunSite,
    instants: &[i64],
    order: &str,
    level: SimdLevel,
    repeats: usize,
) -> Result<SunPositions, String> {
    let n = instants.len();
    let mut out = SunPositions::default();
    let mut work = || ephemeris.positions_into(site, instants, Some(level), &mut out);
    work().map_err(|error| error.to_string())?;
    let time = Nanoseconds::of(repeats, || {
        let _ = black_box(work());
    });
    let mut greatest_rad = 0.0_f64;
    for row in (0..n).step_by(n.div_ceil(CHECKED)) {
        let direct =
            position(site, instants[row], DELTA_T_S, 0.0).map_err(|error| error.to_string())?;
        let turn = (out.azimuth_rad[row] - direct.azimuth_rad).abs();
        greatest_rad = greatest_rad
            .max(turn.min(std::f64::consts::TAU - turn))
            .max((out.apparent_elevation_rad[row] - direct.apparent_elevation_rad).abs())
            .max((out.geometric_elevation_rad[row] - direct.geometric_elevation_rad).abs());
    }
    println!(
        "{{\"what\": \"bulk {order}\", \"level\": \"{level}\", \"n\": {n}, \
         \"ns_per_instant\": {}, \"greatest_difference_from_direct_deg\": {:.3e}}}",
        time.json(n),
        degrees(greatest_rad)
    );
    Ok(out)
}
