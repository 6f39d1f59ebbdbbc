//! Zero-point jumps: found, dated, and not seen where there are none.

#![allow(
    clippy::unwrap_used,
    clippy::print_stderr,
    reason = "tests fail and talk"
)]

mod campaigns;

use campaigns::{Bending, DAY_NS, Heliostat};
use helio_calib::Observation;
use helio_calib::diagnosis::{CalibrateOptions, Calibration, Context, Finding, calibrate};
use helio_calib::random::Random;
use helio_calib::simulate::{Jump, SimulateOptions};

/// A series over a year of a mount that also does something beyond six angles.
struct Series {
    heliostat: Heliostat,
    observations: Vec<Observation>,
    /// Rows from the first after the jump on.
    first_after: Option<usize>,
    jump: Option<Jump>,
}

fn series(random: &mut Random, jump: bool) -> Series {
    let heliostat = Heliostat::draw(random);
    let mut options = SimulateOptions {
        count: 40 + random.below(110),
        noise_mrad: random.between(0.3, 0.8),
        outlier_share: 0.03,
        ..heliostat.options(random)
    };
    if jump {
        let span = options.to_unix_ns - options.from_unix_ns;
        let size = 1e-3 * random.between(3.0, 12.0);
        let size = if random.below(2) == 0 { size } else { -size };
        let both = random.between(0.3, 1.0);
        let parts = [[1.0, 0.0], [0.0, 1.0], [1.0, both]][random.below(3)];
        options.jumps = vec![Jump {
            unix_ns: options.from_unix_ns + (span as f64 * random.between(0.2, 0.8)) as i64,
            azimuth_reference_rad: size * parts[0],
            elevation_reference_rad: size * parts[1],
        }];
    }
    let simulated = heliostat.observe(&options).unwrap();
    let mut observations = simulated.observations;
    Bending::draw(random, 0.4).bend(&mut observations);
    let jump = options.jumps.first().copied();
    let first_after = jump.and_then(|j| {
        observations
            .iter()
            .position(|o| o.unix_ns >= Some(j.unix_ns))
    });
    Series {
        heliostat,
        observations,
        first_after,
        jump,
    }
}

fn called_wrong(finding: &Finding) -> bool {
    matches!(finding, Finding::WrongCall { .. })
}

fn judge(series: &Series) -> Calibration {
    let context = Context {
        site_latitude_rad: Some(series.heliostat.latitude_rad),
        ..Context::default()
    };
    let answer = calibrate(
        &series.heliostat.mount,
        &series.observations,
        &context,
        &CalibrateOptions::default(),
    )
    .unwrap();
    assert!(
        !answer.findings.iter().any(called_wrong),
        "{:?}",
        answer.findings
    );
    answer
}

fn median(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    values[values.len() / 2]
}

#[test]
fn jumps_are_found_and_dated() {
    let mut random = Random::new(41);
    let count = 200;
    let (mut found, mut exact, mut superfluous) = (0, 0, 0);
    let (mut days, mut widths, mut sizes) = (Vec::new(), Vec::new(), Vec::new());
    for _ in 0..count {
        let series = series(&mut random, true);
        let jump = series.jump.unwrap();
        let truth = series.first_after.unwrap();
        let answer = judge(&series);
        let mut seen = 0;
        for finding in &answer.findings {
            let Finding::Jump {
                last_before,
                first_after,
                after_unix_ns,
                before_unix_ns,
                axis1_mrad,
                axis2_mrad,
            } = *finding
            else {
                continue;
            };
            let (from, to) = (after_unix_ns.unwrap(), before_unix_ns.unwrap());
            // found: no more than two records off
            if first_after + 2 < truth || last_before > truth + 1 {
                superfluous += 1;
                continue;
            }
            seen += 1;
            let off = (from - jump.unix_ns).max(jump.unix_ns - to).max(0);
            exact += u32::from(off == 0);
            days.push(off as f64 / DAY_NS as f64);
            widths.push((to - from) as f64 / DAY_NS as f64);
            sizes.push(
                (axis1_mrad - 1e3 * jump.azimuth_reference_rad)
                    .hypot(axis2_mrad - 1e3 * jump.elevation_reference_rad),
            );
        }
        found += u32::from(seen == 1);
        superfluous += u32::from(seen > 1);
    }
    let most = days.iter().copied().fold(0.0, f64::max);
    eprintln!("series with a jump of 3 to 12 mrad of an encoder reference: {count}");
    eprintln!(
        "found within two records: {found} ({:.1} %)",
        100.0 * f64::from(found) / f64::from(count)
    );
    eprintln!("of these dated right (jump between the two dates): {exact}");
    eprintln!(
        "error of the date: largest {most:.1} days; width of the stated interval: median {:.1} days",
        median(widths)
    );
    eprintln!("error of the size: median {:.2} mrad", median(sizes));
    eprintln!("superfluous jumps: {superfluous}");
    assert!(found >= 190, "{found}");
    assert!(f64::from(exact) >= 0.85 * f64::from(found), "{exact}");
    assert!(superfluous <= 4, "{superfluous}");
}

#[test]
fn no_jumps_where_there_are_none() {
    let mut random = Random::new(42);
    let count = 200;
    let mut alarms = 0;
    for _ in 0..count {
        let answer = judge(&series(&mut random, false));
        alarms += u32::from(
            answer
                .findings
                .iter()
                .any(|f| matches!(f, Finding::Jump { .. })),
        );
    }
    eprintln!("false alarms on {count} series without a jump: {alarms}");
    assert!(alarms <= 4, "{alarms}");
}

/// A stretch of a few weeks with other zero points, as after a motor was exchanged and exchanged back.
#[test]
fn an_excursion_is_an_epoch_of_its_own() {
    let mut random = Random::new(43);
    let mut right = 0;
    for _ in 0..40 {
        let heliostat = Heliostat::draw(&mut random);
        let mut options = heliostat.options(&mut random);
        options.count = 100;
        let start = options.from_unix_ns + 120 * DAY_NS;
        let by = 1e-3 * random.between(5.0, 60.0);
        let there = Jump {
            unix_ns: start,
            azimuth_reference_rad: 0.0,
            elevation_reference_rad: by,
        };
        let back = Jump {
            unix_ns: start + 40 * DAY_NS,
            elevation_reference_rad: -by,
            ..there
        };
        options.jumps = vec![there, back];
        let simulated = heliostat.observe(&options).unwrap();
        let answer = judge(&Series {
            observations: simulated.observations,
            first_after: None,
            jump: None,
            heliostat,
        });
        let inside = |ns: Option<i64>| ns >= Some(there.unix_ns) && ns < Some(back.unix_ns);
        right += u32::from(
            answer.epochs.len() == 3
                && inside(answer.epochs[1].from_unix_ns)
                && inside(answer.epochs[1].to_unix_ns)
                && answer.rejected.is_empty(),
        );
    }
    eprintln!("excursions found with both dates and no record lost: {right} of 40");
    assert!(right >= 36, "{right}");
}

/// A jump looks a little like spots that are mirrored, or like a neighbour's records: it is not to be called that.
#[test]
fn jumps_are_not_called_wrong() {
    let mut random = Random::new(44);
    eprintln!("jump [mrad]  campaigns  called wrong  found and dated");
    for jump_mrad in [[5.0, 3.0], [-3.0, 8.0], [2.0, -2.0]] {
        let campaigns = 300;
        let (mut wrong, mut dated) = (0, 0);
        for _ in 0..campaigns {
            let mut heliostat = Heliostat::draw(&mut random);
            heliostat.truth = heliostat.neighbour(&mut random).1;
            let neighbours: Vec<_> = (0..8).map(|_| heliostat.neighbour(&mut random).0).collect();
            let mut options = heliostat.options(&mut random);
            options.count = 60;
            options.outlier_share = 0.02;
            // spots near the middle say little about which way u and v count
            options.aiming = SimulateOptions::default().aiming;
            let unix_ns = options.from_unix_ns + 151 * DAY_NS;
            let [azimuth_reference_rad, elevation_reference_rad] = jump_mrad.map(|x| 1e-3 * x);
            options.jumps = vec![Jump {
                unix_ns,
                azimuth_reference_rad,
                elevation_reference_rad,
            }];
            let observations = heliostat.observe(&options).unwrap().observations;
            let context = Context {
                site_latitude_rad: Some(heliostat.latitude_rad),
                neighbours: &neighbours,
                targets: &heliostat.targets,
                ..Context::default()
            };
            let options = CalibrateOptions::default();
            let answer = calibrate(&heliostat.mount, &observations, &context, &options).unwrap();
            wrong += u32::from(answer.findings.iter().any(called_wrong));
            dated += u32::from(answer.findings.iter().any(|f| match f {
                Finding::Jump {
                    after_unix_ns,
                    before_unix_ns,
                    ..
                } => *after_unix_ns < Some(unix_ns) && *before_unix_ns >= Some(unix_ns),
                _ => false,
            }));
        }
        let jump = format!("{:?}", jump_mrad);
        eprintln!("{jump:>11}  {campaigns:>9}  {wrong:>12}  {dated:>15}");
        assert_eq!(wrong, 0, "{jump}");
        assert!(dated >= 285, "{jump}: {dated}");
    }
}
