//! What is stated of heliostats whose last records are hard to understand: a zero point that jumped just before them,
//! a spot in a wrong place at the very end.

#![allow(clippy::unwrap_used, reason = "tests fail")]
#![allow(clippy::print_stdout, reason = "numbers behind the verdicts")]

use helio_calib::joint::simulate::{FieldOptions, SimulatedField, simulate_field};
use helio_calib::joint::{Foretold, JointOptions, fit_joint};

const HELIOSTATS: usize = 48;

fn field(seed: u64, records: usize, change: impl Fn(&mut FieldOptions)) -> SimulatedField {
    let mut options = FieldOptions {
        heliostats: HELIOSTATS,
        records: records + 1,
        ..FieldOptions::new(seed).unwrap()
    };
    change(&mut options);
    simulate_field(&options).unwrap()
}

/// How far records to come lie from what was foretold of them, over what was stated of that.
#[derive(Default)]
struct Ratios {
    batch: Vec<f64>,
    followed: Vec<f64>,
    far: [usize; 2],
}

impl Ratios {
    fn take(&mut self, what: &str, field: &SimulatedField, records: usize, which: impl Fn(usize) -> bool) {
        let options = JointOptions::new(FieldOptions::new(1).unwrap().site.latitude_rad());
        let fit = fit_joint(&field.first(records), &options).unwrap();
        let ids: Vec<String> = (0..HELIOSTATS).map(|k| k.to_string()).collect();
        let state = fit.follow(&ids).unwrap();
        let early = records / 2;
        let fit_early = fit_joint(&field.first(early), &options).unwrap();
        let mut followed = fit_early.follow(&ids).unwrap();
        let between: Vec<_> = field.heliostats.iter().enumerate().map(|(k, h)| {
            let mut campaign = h.first(records);
            campaign.observations = &campaign.observations[early..];
            (k, campaign)
        }).collect();
        followed.update(&between).unwrap();
        for (k, heliostat) in field.heliostats.iter().enumerate() {
            let truth = &heliostat.truth[records];
            if truth.outlier || truth.jump.is_some() || !which(k) {
                continue;
            }
            let mut next = heliostat.after(records);
            next.observations = &next.observations[..1];
            let ratio = |f: &Foretold| f.beam_mrad() / f.expected_mrad();
            let batch = fit.foretell(k, &next).unwrap();
            if !state.heliostats()[k].unexplained() {
                let r = ratio(&batch[0]);
                if r > 5.0 {
                    println!("{what}: heliostat {k} batch {r:.1}: {:.2} of {:.2}; {:?} {:?}", batch[0].beam_mrad(), batch[0].expected_mrad(), fit.heliostats[k].outliers, fit.heliostats[k].jumps);
                    self.far[0] += 1;
                }
                self.batch.push(r);
            }
            if !followed.heliostats()[k].unexplained() {
                let f = followed.foretell(k, &next).unwrap();
                let r = ratio(&f[0]);
                if r > 5.0 {
                    self.far[1] += 1;
                }
                self.followed.push(r);
            }
        }
    }

    fn say(&self, what: &str) {
        let rms = |v: &[f64]| (v.iter().map(|x| x * x).sum::<f64>() / v.len() as f64).sqrt();
        let most = |v: &[f64]| v.iter().fold(0.0_f64, |a, b| a.max(*b));
        println!(
            "{what}: batch {} rms {:.2} most {:.2} far {}; followed {} rms {:.2} most {:.2} far {}",
            self.batch.len(), rms(&self.batch), most(&self.batch), self.far[0],
            self.followed.len(), rms(&self.followed), most(&self.followed), self.far[1],
        );
    }
}

#[test]
fn survey() {
    for records in [2, 3, 4, 6, 8, 12, 24] {
        let mut ratios = Ratios::default();
        for seed in 0..4 {
            let field = field(seed, records, |options| {
                options.outlier_probability = 0.02;
                options.jump_probability = 0.005;
            });
            ratios.take("plain", &field, records, |_| true);
        }
        ratios.say(&format!("plain {records}"));
    }
    for records in [6, 12, 24] {
        for size in [1.0, 3.0, 8.0, 20.0, 40.0] {
            for late in [1, 2, 3, 5] {
                let mut ratios = Ratios::default();
                for seed in 10..12 {
                    let mut field = field(seed, records, |_| ());
                    // every fourth has jumped
                    for (k, heliostat) in field.heliostats.iter_mut().enumerate().filter(|(k, _)| k % 4 == 0) {
                        for o in &mut heliostat.observations[records - late..] {
                            if k % 3 != 1 {
                                o.axis1_rad += 1e-3 * size;
                            }
                            if k % 3 != 2 {
                                o.axis2_rad -= 1e-3 * size;
                            }
                        }
                    }
                    ratios.take(&format!("jump {size} {late} of {records}"), &field, records, |k| k % 4 == 0);
                }
                ratios.say(&format!("jump of {size} mrad before {late} of {records}"));
            }
        }
    }
}
