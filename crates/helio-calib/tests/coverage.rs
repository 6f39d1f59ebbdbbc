//! Stated 95 % intervals contain the truth 95 % of the time.

#![allow(
    clippy::unwrap_used,
    clippy::print_stdout,
    reason = "tests fail and talk"
)]

mod common;

use common::{Rng, campaign, errors, parameters, place};
use helio_calib::{FitOptions, Loss, Parameter, fit, uncertainty};
use helio_core::TrackingMode;
use helio_core::angle::wrap_pi;
use rayon::prelude::*;

const FITS: u64 = 2_000;

/// Of one fit: is each of the six within its interval; the tilt's angle; its azimuth where it is known.
type Inside = ([bool; 6], bool, Option<bool>);

fn run(options: &FitOptions) -> Vec<Inside> {
    (0..FITS)
        .into_par_iter()
        .map(|seed| {
            let mut rng = Rng::new(seed + 1_000_000);
            let place = place(&mut rng, TrackingMode::AzimuthElevation);
            let truth = errors(&mut rng);
            let records = 6 + (rng.unit() * 55.0) as usize;
            let seen = campaign(&mut rng, &place, &truth, records, 0.5);
            let found = fit(&place.mount, &seen, options).unwrap();
            let known = uncertainty(&place.mount, &seen, &found, options).unwrap();
            let wanted = parameters(&place.mount, &truth).canonical();
            let inside = std::array::from_fn(|k| {
                let parameter = Parameter::ALL[k];
                let (low, high) = known.interval95(parameter, &found).unwrap();
                let off = wrap_pi(wanted.values[k] - found.parameters.values[k]);
                off.abs() <= 0.5 * (high - low)
            });
            let (tilt, azimuth) = known.tilt_standard_error(&found);
            let t = helio_calib::student_t95(known.degrees_of_freedom);
            let angles = found.parameters.errors();
            (
                inside,
                (angles.pedestal_tilt_rad - truth.pedestal_tilt_rad).abs() <= t * tilt,
                azimuth.map(|sigma| {
                    let off = angles.pedestal_tilt_azimuth_rad - truth.pedestal_tilt_azimuth_rad;
                    wrap_pi(off).abs() <= t * sigma
                }),
            )
        })
        .collect()
}

fn share(of: impl Iterator<Item = bool>) -> (f64, usize) {
    let all: Vec<bool> = of.collect();
    let inside = all.iter().filter(|x| **x).count();
    (inside as f64 / all.len() as f64, all.len())
}

#[test]
fn intervals_contain_the_truth_as_often_as_they_say() {
    for loss in [Loss::Squares, Loss::Huber, Loss::StudentT { degrees: 5.0 }] {
        let options = FitOptions {
            loss,
            ..FitOptions::default()
        };
        let found = run(&options);
        let mut wrong = Vec::new();
        let mut note = |what: &str, (share, of): (f64, usize)| {
            println!("{loss:?}, {what}: {:.1} % of {of}", 100.0 * share);
            if !(0.93..=0.97).contains(&share) {
                wrong.push(format!("{what}: {share}"));
            }
        };
        for (k, parameter) in Parameter::ALL.iter().take(6).enumerate() {
            note(parameter.as_str(), share(found.iter().map(|f| f.0[k])));
        }
        note("tilt azimuth", share(found.iter().filter_map(|f| f.2)));
        // the tilt's angle cannot be negative: no promise where it is near zero
        let (tilt, _) = share(found.iter().filter(|f| f.2.is_some()).map(|f| f.1));
        println!(
            "{loss:?}, tilt where its azimuth is known: {:.1} %",
            100.0 * tilt
        );
        assert!(wrong.is_empty(), "{loss:?}: {wrong:?}");
    }
}
