//! How well real heliostats are pointed on days that no fit has seen: records of Jülich, strictly causal.
//!
//! Usage: `HELIO_DATA=… cargo run --release -p helio-bench --bin juelich -- [helios|utis] [strict] [few] [NAME …]`

#![allow(clippy::print_stdout, reason = "a table is what it is for")]

use helio_bench::juelich::{Campaigns, FEW, Others, PROTOCOLS};
use helio_calib::joint::JointOptions;
use helio_tests::juelich::{LATITUDE_RAD, Spots};

fn main() {
    let data = std::env::var_os("HELIO_DATA").expect("HELIO_DATA names the folder of the records");
    let mut spots = Spots::Helios;
    let mut others = Others::BeforeThatDay;
    let mut protocols = PROTOCOLS;
    let mut names = Vec::new();
    for argument in std::env::args().skip(1) {
        match argument.as_str() {
            "helios" => spots = Spots::Helios,
            "utis" => spots = Spots::Utis,
            "few" => protocols = FEW,
            "strict" => others = Others::BeforeOwnLast,
            name => names.push(name.to_owned()),
        }
    }
    if names.is_empty() {
        names = ["BF57", "BG62", "BH35", "BF55"].map(String::from).to_vec();
    }
    let campaigns = Campaigns::read(data.as_ref(), spots);
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
