//! Whether what is left by pose helps on days that no fit has seen: records of Jülich, strictly causal.
//!
//! Usage: `HELIO_DATA=… cargo run --release -p helio-bench --bin leftovers -- [helios|utis] [half|day] [poses=N] [NAME …]`, or
//! `leftovers speed=HELIOSTATS` for the time of a synthetic field of fifty records each.
//!
//! Fit and leftovers, their length, amplitudes and evidence are found anew from the records before each
//! foretold day. "As admitted" corrects where the evidence asks for it, "always" wherever the likeliest leftovers
//! say.

#![allow(clippy::print_stdout, reason = "a table is what it is for")]

use std::time::Instant;

use helio_bench::juelich::{Campaigns, INSIDE95, campaigns, day};
use helio_calib::joint::simulate::{FieldOptions, simulate_field};
use helio_calib::joint::{Foretold, JointOptions, LeftoverOptions, fit_joint};
use helio_calib::{Campaign, Observation};
use helio_tests::juelich::{LATITUDE_RAD, Records, Spots};
use rayon::prelude::*;

/// A foretold day: without, as admitted, always.
struct Day {
    foretold: [Vec<Foretold>; 3],
    log_evidence: f64,
    amplitude_mrad: [f64; 2],
    length_rad: f64,
}

fn foretell(all: &Campaigns, own: &Records, ahead: bool, today: i64, poses: usize) -> Day {
    let half = own.observations.len() / 2;
    let mine = own.observations.iter().enumerate();
    let mine = mine.filter(|(k, o)| if ahead { day(o) < today } else { *k < half });
    let known = all.known_before(today, own, mine.map(|(_, o)| *o).collect());
    let campaigns = campaigns(&known);
    let fit = fit_joint(&campaigns, &JointOptions::new(LATITUDE_RAD)).expect("a fit");
    let options = LeftoverOptions {
        least_log_evidence: f64::NEG_INFINITY,
        day: Some(today as f64 + 0.5),
        most_poses: poses,
        ..LeftoverOptions::default()
    };
    let leftovers = fit.leftovers(&campaigns, &options).expect("leftovers");
    let later = own.observations[half..].iter();
    let seen: Vec<Observation> = later.filter(|o| day(o) == today).copied().collect();
    let seen = Campaign {
        mount: own.mount,
        observations: &seen,
    };
    let k = campaigns.len() - 1;
    let without = fit.foretell(k, &seen).expect("foretold");
    let always = leftovers
        .foretell(&fit, k, &campaigns[k], &seen)
        .expect("foretold");
    let admitted = leftovers.log_evidence >= LeftoverOptions::default().least_log_evidence;
    Day {
        foretold: [
            without.clone(),
            if admitted { always.clone() } else { without },
            always,
        ],
        log_evidence: leftovers.log_evidence,
        amplitude_mrad: leftovers.amplitude_mrad,
        length_rad: leftovers.length_rad,
    }
}

fn speed(heliostats: usize, poses: usize) {
    let options = FieldOptions {
        heliostats,
        ..FieldOptions::new(1).expect("a site")
    };
    let field = simulate_field(&options).expect("a field");
    let campaigns = field.first(options.records);
    let start = Instant::now();
    let joint = JointOptions::new(options.site.latitude_rad());
    let fit = fit_joint(&campaigns, &joint).expect("a fit");
    let joint_s = start.elapsed().as_secs_f64();
    for least_log_evidence in [5.0, f64::NEG_INFINITY] {
        let start = Instant::now();
        let options = LeftoverOptions {
            least_log_evidence,
            most_poses: poses,
            ..LeftoverOptions::default()
        };
        let leftovers = fit.leftovers(&campaigns, &options).expect("leftovers");
        println!(
            "{heliostats} x {}: joint fit {joint_s:.2} s, leftovers {:.2} s, admitted: {} ({:.1} nats)",
            field.heliostats[0].observations.len(),
            start.elapsed().as_secs_f64(),
            leftovers.admitted,
            leftovers.log_evidence
        );
    }
}

fn main() {
    let mut spots = Spots::Helios;
    let mut protocols = vec![false, true];
    let mut names = Vec::new();
    let mut poses = LeftoverOptions::default().most_poses;
    for argument in std::env::args().skip(1) {
        match argument.as_str() {
            "helios" => spots = Spots::Helios,
            "utis" => spots = Spots::Utis,
            "half" => protocols = vec![false],
            "day" => protocols = vec![true],
            other if other.starts_with("poses=") => {
                poses = other[6..].parse().expect("poses=N");
            }
            other if other.starts_with("speed=") => {
                return speed(other[6..].parse().expect("speed=HELIOSTATS"), poses);
            }
            name => names.push(name.to_owned()),
        }
    }
    let data = std::env::var_os("HELIO_DATA").expect("HELIO_DATA names the folder of the records");
    let all = Campaigns::read(data.as_ref(), spots);
    println!(
        "| beam rms, mrad | heliostat | without | as admitted | always | inside 95 %: without | as admitted | always \
         | days admitted | nats of the last day | amplitudes, mrad | length, rad |"
    );
    for ahead in protocols {
        let words = if ahead {
            "one day ahead"
        } else {
            "earlier half, frozen"
        };
        let mut sums = [0.0; 3];
        let mut count = 0.0;
        for own in all
            .records()
            .iter()
            .filter(|r| names.is_empty() || names.contains(&r.name))
        {
            let half = own.observations.len() / 2;
            let mut days: Vec<i64> = own.observations[half..].iter().map(day).collect();
            days.dedup();
            let done: Vec<Day> = days
                .par_iter()
                .map(|&today| foretell(&all, own, ahead, today, poses))
                .collect();
            let of = |way: usize| done.iter().flat_map(move |d| &d.foretold[way]);
            let n = of(0).count() as f64;
            let rms = [0, 1, 2].map(|way| {
                let squares: f64 = of(way).map(|f| f.beam_mrad().powi(2)).sum();
                (squares / n).sqrt()
            });
            let inside = [0, 1, 2].map(|way| {
                let inside = of(way).filter(|f| f.square() < INSIDE95).count();
                inside as f64 / n
            });
            let least = LeftoverOptions::default().least_log_evidence;
            let admitted = done.iter().filter(|d| d.log_evidence >= least).count();
            let last = done.last().expect("a day");
            println!(
                "| {words} | {} | {:.3} | {:.3} | {:.3} | {:.2} | {:.2} | {:.2} | {admitted} of {} | {:.1} | {:.2} {:.2} | {:.2} |",
                own.name,
                rms[0],
                rms[1],
                rms[2],
                inside[0],
                inside[1],
                inside[2],
                days.len(),
                last.log_evidence,
                last.amplitude_mrad[0],
                last.amplitude_mrad[1],
                last.length_rad,
            );
            for (sum, rms) in sums.iter_mut().zip(rms) {
                *sum += rms;
            }
            count += 1.0;
        }
        println!(
            "| {words} | mean | {:.3} | {:.3} | {:.3} |",
            sums[0] / count,
            sums[1] / count,
            sums[2] / count
        );
    }
}
