//! How well real heliostats are pointed on days that no fit has seen: records of Jülich, strictly causal.
//!
//! Usage: `HELIO_DATA=… cargo run --release -p helio-bench --bin juelich [-- helios|utis]`

use helio_bench::juelich::{Campaigns, PROTOCOLS};
use helio_tests::juelich::Spots;

fn main() {
    let data = std::env::var_os("HELIO_DATA").expect("HELIO_DATA names the folder of the records");
    let mut arguments = std::env::args().skip(1);
    let spots = match arguments.next().as_deref() {
        None | Some("helios") => Spots::Helios,
        Some("utis") => Spots::Utis,
        Some(other) => panic!("helios or utis, not {other}"),
    };
    let only: Vec<String> = arguments.collect();
    let campaigns = Campaigns::read(data.as_ref(), spots);
    let four = ["BF57", "BG62", "BH35", "BF55"];
    let names: Vec<&str> = if only.is_empty() {
        four.to_vec()
    } else {
        only.iter().map(String::as_str).collect()
    };
    println!(
        "| beam rms, mrad | {} | mean | inside 95 % |",
        names.join(" | ")
    );
    for protocol in PROTOCOLS {
        let mut line = Vec::new();
        let mut inside = Vec::new();
        for name in &names {
            let result = campaigns.run(name, *protocol);
            if std::env::var_os("TALK").is_some() {
                let f = &result.last;
                eprintln!(
                    "{name} {}: {:?} {:?}",
                    protocol.in_words(),
                    f.noise,
                    f.wander
                );
                for c in &f.causes {
                    eprintln!(
                        "  {:?} {:.5} ± {:.5} spread {:.5} evidence {:.1} {}",
                        c.cause, c.value, c.sigma, c.spread, c.log_evidence, c.admitted
                    );
                }
                let n = f.field_mean.len();
                let sd: Vec<String> = (0..n)
                    .map(|i| {
                        format!(
                            "{:.2}±{:.2}",
                            1e3 * f.field_mean[i],
                            1e3 * f.field_covariance[i * n + i].sqrt()
                        )
                    })
                    .collect();
                eprintln!("  {}", sd.join(" "));
                for h in &f.heliostats {
                    let v: Vec<String> =
                        h.still.iter().map(|x| format!("{:.2}", x * 1e3)).collect();
                    eprintln!("  {} out {:?} jumps {:?}", v.join(" "), h.outliers, h.jumps);
                }
                let mut worst: Vec<(f64, usize)> =
                    result.beam_mrad.iter().copied().zip(0..).collect();
                worst.sort_by(|a, b| b.0.total_cmp(&a.0));
                eprintln!("  worst {:?}", &worst[..5]);
            }
            line.push(result.rms_mrad);
            inside.push(result.inside95);
        }
        let text: Vec<String> = line.iter().map(|x| format!("{x:.2}")).collect();
        let mean = line.iter().sum::<f64>() / line.len() as f64;
        let share: Vec<String> = inside.iter().map(|x| format!("{x:.2}")).collect();
        println!(
            "| {} | {} | {mean:.3} | {} |",
            protocol.in_words(),
            text.join(" | "),
            share.join(" ")
        );
    }
}
