//! 10,000 random heliostats of which nothing is known: every fit reaches its optimum.

#![allow(
    clippy::unwrap_used,
    clippy::print_stdout,
    reason = "tests fail and talk"
)]

mod common;

use common::{Rng, campaign, errors, parameters, place};
use helio_calib::{FitOptions, Solver, Start, fit, measures};
use helio_core::TrackingMode;
use rayon::prelude::*;

const HELIOSTATS: u64 = 10_000;
/// How many of them are fitted from plain zeros too, where not all can be reached.
const FROM_ZEROS: u64 = 1_000;

#[test]
fn every_random_heliostat_reaches_its_optimum_from_cold() {
    for solver in [Solver::HartleyMeyer, Solver::GaussNewton] {
        for start in [Start::Cold, Start::Zeros] {
            let options = FitOptions {
                solver,
                start,
                ..FitOptions::default()
            };
            let count = match start {
                Start::Cold => HELIOSTATS,
                _ => FROM_ZEROS,
            };
            let found: Vec<(bool, usize, String)> = (0..count)
                .into_par_iter()
                .map(|seed| {
                    let mut rng = Rng::new(seed);
                    let place = place(&mut rng, TrackingMode::AzimuthElevation);
                    let truth = errors(&mut rng);
                    let records = 6 + (rng.unit() * 55.0) as usize;
                    let seen = campaign(&mut rng, &place, &truth, records, 0.5);
                    let found = fit(&place.mount, &seen, &options).unwrap();
                    let of_truth =
                        measures(&place.mount, &seen, &parameters(&place.mount, &truth)).1;
                    let reached = found.stop.converged() && found.rms_m <= 1.01 * of_truth.rms_m;
                    let what = if reached {
                        String::new()
                    } else {
                        format!(
                            "{seed}: M {records}, {:?} after {}, rms {} m, truth's {} m, {:?} {:?}",
                            found.stop,
                            found.iterations,
                            found.rms_m,
                            of_truth.rms_m,
                            found.parameters,
                            truth
                        )
                    };
                    (reached, found.iterations, what)
                })
                .collect();
            let missed: Vec<&str> = found
                .iter()
                .filter(|f| !f.0)
                .map(|f| f.2.as_str())
                .collect();
            let mut histogram = std::collections::BTreeMap::new();
            for (_, iterations, _) in &found {
                *histogram.entry(*iterations).or_insert(0_usize) += 1;
            }
            println!(
                "{solver:?} from {start:?}: {} of {count} reach the optimum",
                found.len() - missed.len()
            );
            println!("iterations: heliostats {histogram:?}");
            if start == Start::Cold {
                assert!(missed.is_empty(), "{} missed: {missed:#?}", missed.len());
            }
        }
    }
}
