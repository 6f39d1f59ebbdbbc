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
use helio_calib::simulate::{Fault, SimulateOptions, Simulated};
use helio_calib::{CalibrationError, FitOptions, Mount, Observation, fit};
use helio_core::EnuUnit;
use helio_core::sun::position;

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
    let simulated = heliostat.observe(&options).unwrap();
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
        let simulated = heliostat.observe(&options).unwrap();
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
    let changes: [(WrongCall, Change); 9] = [
        (WrongCall::Axis1InDegrees, |o| {
            o.axis1_rad = o.axis1_rad.to_degrees();
        }),
        (WrongCall::Axis1InRadians, |o| {
            o.axis1_rad = o.axis1_rad.to_radians();
        }),
        (WrongCall::Axis2InDegrees, |o| {
            o.axis2_rad = o.axis2_rad.to_degrees();
        }),
        (WrongCall::Axis2InRadians, |o| {
            o.axis2_rad = o.axis2_rad.to_radians();
        }),
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

/// Suns from the ephemeris, for times with a wrong offset from UTC.
#[test]
fn times_with_a_wrong_offset_are_named() {
    let mut random = Random::new(37);
    eprintln!("offset  campaigns  named rightly  named otherwise  refused");
    for minutes in [-660, -330, -120, -60, -30, 30, 60, 120, 330, 600] {
        let (mut right, mut otherwise, mut refused) = (0, 0, 0);
        let campaigns = 20;
        for _ in 0..campaigns {
            let (heliostat, simulated) = campaign(&mut random, |options| options.count = 40);
            let mut observations = simulated.observations;
            for o in &mut observations {
                let unix_ns = o.unix_ns.unwrap() + i64::from(minutes) * 60_000_000_000;
                let at = position(&heliostat.site, unix_ns, None, 0.0).unwrap();
                o.sun = at.direction();
                o.unix_ns = Some(unix_ns);
            }
            let answer = judge(&heliostat, &observations, &[]);
            for finding in &answer.findings {
                if let Finding::WrongCall { call, .. } = finding {
                    let early_minutes = -minutes;
                    let named = *call == WrongCall::TimesOff { early_minutes };
                    right += u32::from(named);
                    otherwise += u32::from(!named);
                }
            }
            refused += u32::from(answer.epochs.iter().all(|e| !e.verdict.is_determined()));
        }
        eprintln!("{minutes:>6}  {campaigns:>9}  {right:>13}  {otherwise:>15}  {refused:>7}");
        assert!(right >= 19 && otherwise == 0, "{minutes}");
        assert_eq!(refused, campaigns, "{minutes}");
    }
}

/// Half of the records of another mount: whatever the others agree on is not to be trusted.
#[test]
fn a_campaign_of_which_much_does_not_fit_is_refused() {
    let mut random = Random::new(38);
    eprintln!("share wrong  campaigns  determined  mean share set aside");
    for (share, trusted) in [(0.1, true), (0.2, true), (0.4, false), (0.5, false)] {
        let (mut determined, mut aside) = (0, 0.0);
        let campaigns = 30;
        for _ in 0..campaigns {
            let (heliostat, simulated) = campaign(&mut random, |options| {
                options.count = 60;
                options.noise_mrad = 0.3;
            });
            let mut observations = simulated.observations;
            let wrong = (share * 60.0) as usize;
            for o in observations.iter_mut().take(wrong) {
                // anywhere on the board, wherever the beam went
                o.u_m = random.between(-3.0, 3.0);
                o.v_m = random.between(-3.0, 3.0);
            }
            observations.rotate_left(random.below(60));
            let options = CalibrateOptions {
                jumps: false,
                ..CalibrateOptions::default()
            };
            let context = Context {
                site_latitude_rad: Some(heliostat.latitude_rad),
                ..Context::default()
            };
            let answer = calibrate(&heliostat.mount, &observations, &context, &options).unwrap();
            let left = answer.rejected.len();
            let verdict = &answer.epochs[0].verdict;
            determined += u32::from(verdict.is_determined());
            aside += left as f64 / 60.0;
            assert!(3 * left <= 60 || !verdict.is_determined());
            if 3 * left > 60 && answer.findings.is_empty() {
                assert!(verdict.to_string().contains("do not fit"), "{verdict}");
            }
        }
        let mean = aside / f64::from(campaigns);
        eprintln!("{share:>11}  {campaigns:>9}  {determined:>10}  {mean:>20.2}");
        if trusted {
            assert_eq!(determined, campaigns, "{share}");
        } else {
            assert_eq!(determined, 0, "{share}");
        }
    }
}

#[test]
fn a_sigma_stated_for_some_records_only_is_refused() {
    let mut random = Random::new(39);
    let (heliostat, simulated) = campaign(&mut random, |options| options.count = 20);
    let mut observations = simulated.observations;
    for o in &mut observations {
        o.sigma_m = Some(0.1);
    }
    observations[7].sigma_m = None;
    let wanted = CalibrationError::SigmaMissing { row: 7, stated: 0 };
    assert_eq!(
        fit(&heliostat.mount, &observations, &FitOptions::default()),
        Err(wanted.clone())
    );
    let options = CalibrateOptions::default();
    let refused = calibrate(
        &heliostat.mount,
        &observations,
        &Context::default(),
        &options,
    );
    assert_eq!(refused, Err(wanted.clone()));
    assert_eq!(
        wanted.to_string(),
        "observation 7 states no sigma_m, but observation 0 does: state it for all or for none"
    );
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
