//! Records that are wrong, and records that were given in a wrong way.

#![allow(
    clippy::unwrap_used,
    clippy::print_stderr,
    reason = "tests fail and talk"
)]

mod campaigns;

use campaigns::Heliostat;
use helio_calib::diagnosis::{
    CalibrateOptions, Calibration, Context, Finding, Reason, Verdict, WrongCall, calibrate,
};
use helio_calib::random::Random;
use helio_calib::simulate::{Fault, SimulateOptions, Simulated, simulate};
use helio_calib::{CalibrationError, Mount, Observation};
use helio_core::EnuUnit;

fn judge(heliostat: &Heliostat, observations: &[Observation], neighbours: &[Mount]) -> Calibration {
    let context = Context {
        site_latitude_rad: Some(heliostat.latitude_rad),
        aim: None,
        neighbours,
        targets: &heliostat.targets,
    };
    calibrate(
        &heliostat.mount,
        observations,
        &context,
        &CalibrateOptions::default(),
    )
    .unwrap()
}

fn campaign(
    random: &mut Random,
    change: impl FnOnce(&mut SimulateOptions),
) -> (Heliostat, Simulated) {
    let heliostat = Heliostat::draw(random);
    let mut options = heliostat.options(random);
    change(&mut options);
    let simulated = simulate(
        &heliostat.mount,
        &heliostat.truth,
        &heliostat.targets,
        &heliostat.site,
        &options,
    )
    .unwrap();
    (heliostat, simulated)
}

/// One wrong record of a few, and one in five of many: found, and nothing else.
#[test]
fn outliers_are_found_and_spoil_nothing() {
    let mut random = Random::new(31);
    eprintln!(
        "records  outliers  campaigns   found  wrongly rejected  year error without / with outliers"
    );
    for (count, outliers, bounds) in [
        (12, 1, [0.97, 0.02]),
        (20, 3, [0.97, 0.02]),
        (60, 12, [0.98, 0.01]),
    ] {
        let campaigns = 60;
        let (mut planted, mut found, mut clean, mut wrongly) = (0, 0, 0, 0);
        let (mut without, mut with) = (0.0, 0.0);
        for _ in 0..campaigns {
            let (heliostat, simulated) = campaign(&mut random, |options| {
                options.count = count;
                options.outlier_share = f64::from(outliers as u32) / count as f64;
            });
            let answer = judge(&heliostat, &simulated.observations, &[]);
            let rejected: Vec<usize> = answer.rejected.iter().map(|r| r.row).collect();
            for (row, truth) in simulated.truth.iter().enumerate() {
                let hit = rejected.contains(&row);
                if truth.fault == Fault::Outlier {
                    planted += 1;
                    found += usize::from(hit);
                } else {
                    clean += 1;
                    wrongly += usize::from(hit);
                }
            }
            let good: Vec<Observation> = simulated
                .observations
                .iter()
                .zip(&simulated.truth)
                .filter(|(_, t)| t.fault == Fault::None)
                .map(|(o, _)| *o)
                .collect();
            let error = |answer: &Calibration| {
                let found = &answer.epochs[0].fit.parameters;
                heliostat.year_error_mrad(found, &campaigns::Bending::default())
            };
            with += error(&answer);
            without += error(&judge(&heliostat, &good, &[]));
        }
        let share = f64::from(found as u32) / f64::from(planted as u32);
        let false_share = f64::from(wrongly as u32) / f64::from(clean as u32);
        eprintln!(
            "{count:>7}  {outliers:>8}  {campaigns:>9}  {share:>6.3}  {false_share:>16.4}  {:.3} / {:.3} mrad",
            without / f64::from(campaigns),
            with / f64::from(campaigns)
        );
        assert!(share >= bounds[0], "{share}");
        assert!(false_share <= bounds[1], "{false_share}");
        assert!(with <= 1.25 * without, "{with} {without}");
    }
}

/// Records of another heliostat and of another target are called what they are.
#[test]
fn foreign_records_are_named() {
    let mut random = Random::new(32);
    let (mut planted, mut set_aside, mut named) = ([0; 2], [0; 2], [0; 2]);
    for _ in 0..60 {
        let mut heliostat = Heliostat::draw(&mut random);
        heliostat.truth = heliostat.neighbour(&mut random).1;
        let neighbours: Vec<_> = (0..2).map(|_| heliostat.neighbour(&mut random)).collect();
        let mut options = heliostat.options(&mut random);
        options.count = 40;
        options.wrong_heliostat_share = 0.1;
        options.wrong_target_share = 0.1;
        options.neighbours = vec![neighbours[0]];
        let simulated = simulate(
            &heliostat.mount,
            &heliostat.truth,
            &heliostat.targets,
            &heliostat.site,
            &options,
        )
        .unwrap();
        let mounts: Vec<Mount> = neighbours.iter().map(|(mount, _)| *mount).collect();
        let answer = judge(&heliostat, &simulated.observations, &mounts);
        for (row, truth) in simulated.truth.iter().enumerate() {
            let reason = answer
                .rejected
                .iter()
                .find(|r| r.row == row)
                .map(|r| r.reason);
            let (kind, right) = match truth.fault {
                Fault::WrongHeliostat(index) => (
                    0,
                    reason == Some(Reason::WrongHeliostat { neighbour: index }),
                ),
                Fault::WrongTarget(lit) => (1, reason == Some(Reason::WrongTarget { target: lit })),
                _ => continue,
            };
            planted[kind] += 1;
            set_aside[kind] += usize::from(reason.is_some());
            named[kind] += usize::from(right);
        }
    }
    eprintln!("                planted  set aside  rightly named");
    for (kind, word) in ["wrong heliostat", "wrong target"].iter().enumerate() {
        eprintln!(
            "{word:>15} {:>8} {:>10} {:>14}",
            planted[kind], set_aside[kind], named[kind]
        );
    }
    for kind in 0..2 {
        assert!(set_aside[kind] * 100 >= planted[kind] * 97);
    }
    assert!(named[1] * 100 >= planted[1] * 95);
    assert!(named[0] * 100 >= planted[0] * 60);
}

/// Every record of a campaign given in the same wrong way: named, and not used.
#[test]
fn wrong_calls_are_recognised() {
    let turned = |o: &mut Observation, azimuth: fn(f64) -> f64| {
        o.sun =
            EnuUnit::from_azimuth_elevation(azimuth(o.sun.azimuth_rad()), o.sun.elevation_rad());
    };
    type Change = fn(&mut Observation);
    let changes: [(WrongCall, Change); 5] = [
        (WrongCall::EncoderInDegrees, |o| {
            o.axis1_rad = o.axis1_rad.to_degrees();
            o.axis2_rad = o.axis2_rad.to_degrees();
        }),
        (WrongCall::EncoderInRadians, |o| {
            o.axis1_rad = o.axis1_rad.to_radians();
            o.axis2_rad = o.axis2_rad.to_radians();
        }),
        (WrongCall::EncoderInSteps, |o| {
            o.axis1_rad = 20_000.0 + 8_000.0 * o.axis1_rad;
            o.axis2_rad = 30_000.0 + 8_000.0 * o.axis2_rad;
        }),
        (WrongCall::Axis1Flipped, |o| o.axis1_rad = -o.axis1_rad),
        (WrongCall::AxesSwapped, |o| {
            std::mem::swap(&mut o.axis1_rad, &mut o.axis2_rad);
        }),
    ];
    let mut random = Random::new(33);
    let mut check = |call: WrongCall, change: &dyn Fn(&mut Observation)| {
        let mut right = 0;
        for _ in 0..20 {
            let (heliostat, simulated) = campaign(&mut random, |options| options.count = 30);
            let mut observations = simulated.observations;
            observations.iter_mut().for_each(change);
            let answer = judge(&heliostat, &observations, &[]);
            let named = answer
                .findings
                .iter()
                .any(|f| matches!(f, Finding::WrongCall { call: c, .. } if *c == call));
            right += u32::from(named);
            assert!(
                answer.epochs.iter().all(|e| !e.verdict.is_determined()),
                "{call:?}: {:?}",
                answer.findings
            );
        }
        eprintln!("{:<24} named in {right} of 20", call.as_str());
        assert!(right >= 19, "{call:?} {right}");
    };
    for (call, change) in changes {
        check(call, &change);
    }
    check(WrongCall::SunFromSouthEastward, &|o| {
        turned(o, |a| std::f64::consts::PI - a)
    });
    check(WrongCall::SunFromSouthWestward, &|o| {
        turned(o, |a| a + std::f64::consts::PI)
    });
}

#[test]
fn sound_campaigns_are_not_called_wrong() {
    let mut random = Random::new(34);
    for _ in 0..100 {
        let (heliostat, simulated) = campaign(&mut random, |options| {
            options.count = 30;
            options.outlier_share = 0.1;
        });
        let answer = judge(&heliostat, &simulated.observations, &[]);
        assert!(answer.findings.is_empty(), "{:?}", answer.findings);
    }
}

#[test]
fn nothing_is_lost() {
    let mut random = Random::new(35);
    let (heliostat, simulated) = campaign(&mut random, |options| options.count = 20);
    let mut observations = simulated.observations;
    observations[3].u_m = f64::NAN;
    observations[5].sigma_m = Some(0.0);
    observations.push(observations[7]);
    observations[9].axis1_rad += 2.0;
    let answer = judge(&heliostat, &observations, &[]);
    let reasons: Vec<_> = answer.rejected.iter().map(|r| (r.row, r.reason)).collect();
    assert_eq!(
        reasons,
        [
            (3, Reason::NotFinite),
            (5, Reason::NotFinite),
            (9, Reason::MissesTarget),
            (20, Reason::Duplicate { of: 7 })
        ]
    );
    assert_eq!(answer.epochs[0].rows.len(), 17);

    let answer = judge(&heliostat, &observations[..2], &[]);
    assert_eq!(
        answer.findings,
        [Finding::TooFew {
            found: 2,
            wanted: 3
        }]
    );
    assert!(answer.epochs.is_empty());

    // one time: the same sun, spots in several places
    let same: Vec<Observation> = observations[10..18]
        .iter()
        .map(|o| Observation {
            sun: observations[10].sun,
            ..*o
        })
        .collect();
    let answer = judge(&heliostat, &same, &[]);
    assert!(
        matches!(answer.findings[0], Finding::AllAtOneTime { .. }),
        "{:?}",
        answer.findings
    );
    for epoch in &answer.epochs {
        assert!(
            matches!(&epoch.verdict, Verdict::Undetermined { why } if why.contains("one time"))
        );
    }

    let options = CalibrateOptions {
        floor_mrad: f64::NAN,
        ..CalibrateOptions::default()
    };
    let refused = calibrate(
        &heliostat.mount,
        &observations,
        &Context::default(),
        &options,
    );
    assert!(matches!(
        refused,
        Err(CalibrationError::BadOption {
            what: "floor_mrad",
            ..
        })
    ));
}

/// The same bits again, in whatever order the records come.
#[test]
fn the_answer_does_not_depend_on_the_order_of_records() {
    let mut random = Random::new(36);
    let (heliostat, simulated) = campaign(&mut random, |options| {
        options.count = 30;
        options.outlier_share = 0.1;
    });
    let answer = judge(&heliostat, &simulated.observations, &[]);
    let again = judge(&heliostat, &simulated.observations, &[]);
    assert_eq!(answer, again);
    let backwards: Vec<Observation> = simulated.observations.iter().rev().copied().collect();
    let other = judge(&heliostat, &backwards, &[]);
    assert_eq!(answer.epochs[0].fit, other.epochs[0].fit);
    let mirrored: Vec<usize> = other.rejected.iter().rev().map(|r| 29 - r.row).collect();
    let rows: Vec<usize> = answer.rejected.iter().map(|r| r.row).collect();
    assert_eq!(rows, mirrored);
}
