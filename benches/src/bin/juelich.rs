//! How well real heliostats are pointed on days that no fit has seen: records of Jülich, strictly causal.
//!
//! Usage: `HELIO_DATA=… cargo run --release -p helio-bench --bin juelich -- [helios|utis] [strict] [few|parts] [NAME …]`
//!
//! `parts` leaves out the parts of the model one by one.

#![allow(clippy::print_stdout, reason = "a table is what it is for")]

use helio_bench::juelich::{Campaigns, FEW, Others, PARTS, PROTOCOLS};
use helio_calib::joint::{JointOptions, Mishaps, Part, Scope, SpotCause};
use helio_tests::juelich::{LATITUDE_RAD, Spots};

/// The whole model, then without each of its parts.
fn variants() -> Vec<(String, JointOptions)> {
    let whole = JointOptions::new(LATITUDE_RAD);
    let mut out = vec![("nothing".to_owned(), whole.clone())];
    for &cause in &whole.axis_causes {
        let mut options = whole.clone();
        options.axis_causes.retain(|c| *c != cause);
        out.push((cause.description().in_words.to_owned(), options));
    }
    let shift = |cause: SpotCause| cause.description().scope == Scope::Target;
    let mut options = whole.clone();
    options.spot_causes.retain(|c| !shift(*c));
    out.push(("shifts of targets".to_owned(), options));
    let mut options = whole.clone();
    options.spot_causes.retain(|c| *c != SpotCause::SunTime);
    out.push(("time of the sun".to_owned(), options));
    let mut options = whole.clone();
    options.axis_causes.clear();
    options.spot_causes.clear();
    out.push(("all causes in common".to_owned(), options));
    for &part in Part::ALL {
        let mut options = whole.clone();
        options.left_out = vec![part];
        out.push((part.in_words().to_owned(), options));
    }
    let mut options = whole.clone();
    options.left_out = vec![Part::SlowWander, Part::FastWander];
    out.push(("all wander".to_owned(), options));
    let mut options = whole;
    options.mishaps = Mishaps {
        outlier: 0.0,
        jump: 0.0,
        ..options.mishaps
    };
    out.push(("outliers and jumps".to_owned(), options));
    out
}

/// Means over heliostats, and what they lose.
fn parts(campaigns: &Campaigns, names: &[String], others: Others) {
    let words: Vec<String> = PARTS.iter().map(|p| p.in_words()).collect();
    println!("| left out | {} |", words.join(" | "));
    let mut whole: Option<Vec<f64>> = None;
    for (what, options) in variants() {
        let mean = |&protocol| {
            let of = |name: &String| campaigns.run(name, protocol, others, &options).rms_mrad;
            names.iter().map(of).sum::<f64>() / names.len() as f64
        };
        let means: Vec<f64> = PARTS.iter().map(mean).collect();
        let against = whole.get_or_insert_with(|| means.clone());
        let pairs = means.iter().zip(against.iter());
        let line: Vec<String> = pairs
            .map(|(m, w)| format!("{m:.3} ({:+.3})", m - w))
            .collect();
        println!("| {what} | {} |", line.join(" | "));
    }
}

fn main() {
    let data = std::env::var_os("HELIO_DATA").expect("HELIO_DATA names the folder of the records");
    let mut spots = Spots::Helios;
    let mut others = Others::BeforeThatDay;
    let mut protocols = PROTOCOLS;
    let mut in_parts = false;
    let mut names = Vec::new();
    for argument in std::env::args().skip(1) {
        match argument.as_str() {
            "helios" => spots = Spots::Helios,
            "utis" => spots = Spots::Utis,
            "few" => protocols = FEW,
            "parts" => in_parts = true,
            "strict" => others = Others::BeforeOwnLast,
            name => names.push(name.to_owned()),
        }
    }
    if names.is_empty() {
        names = ["BF57", "BG62", "BH35", "BF55"].map(String::from).to_vec();
    }
    let campaigns = Campaigns::read(data.as_ref(), spots);
    if in_parts {
        parts(&campaigns, &names, others);
        return;
    }
    let options = JointOptions::new(LATITUDE_RAD);
    println!(
        "| beam rms, mrad | {} | mean | expected | inside 95 % |",
        names.join(" | ")
    );
    for &protocol in protocols {
        let done: Vec<_> = names
            .iter()
            .map(|name| campaigns.run(name, protocol, others, &options))
            .collect();
        let mean = done.iter().map(|d| d.rms_mrad).sum::<f64>() / done.len() as f64;
        let line: Vec<String> = done.iter().map(|d| format!("{:.2}", d.rms_mrad)).collect();
        let expected: Vec<String> = done
            .iter()
            .map(|d| format!("{:.2}", d.expected_mrad))
            .collect();
        let share: Vec<String> = done.iter().map(|d| format!("{:.2}", d.inside95)).collect();
        println!(
            "| {} | {} | {mean:.3} | {} | {} |",
            protocol.in_words(),
            line.join(" | "),
            expected.join(" "),
            share.join(" ")
        );
    }
}
