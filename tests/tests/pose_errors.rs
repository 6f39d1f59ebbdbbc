//! Sag under gravity and eccentric encoders: what they are, that they cost a neighbour without them no bit, and
//! what is refused.

#![allow(
    clippy::unwrap_used,
    clippy::print_stderr,
    reason = "tests fail and talk"
)]

use std::f64::consts::{FRAC_PI_2, PI, TAU};

use helio_core::error::FieldError;
use helio_core::{
    AxisLimits, Enu, EnuUnit, Field, Heliostat, MountErrors, OffsetForm, PoseErrors, Present,
    SimdLevel, Status, TrackOptions, Tracker, Tracking, TrackingMode,
};
use helio_tests::cases::{self, Kind, MODES};
use helio_tests::dd::Dd3;
use helio_tests::{Rng, V3, mount, normal};

const JUELICH: TrackingMode = TrackingMode::PitchRoll {
    axis_azimuth_rad: FRAC_PI_2,
};

fn one(mode: TrackingMode, heliostat: Heliostat) -> Tracker {
    Tracker::new(&cases::field(mode, &[heliostat]), OffsetForm::Exact).unwrap()
}

/// The two mounts that can be checked by eye: the measured term of a pitch-roll mount, kappa2 sin(t2)
/// cos(t1) with t1 = -gamma and t2 = alpha; and the bending of a telescope's tube, -kappa2 cos(alpha). On top of either the once-per-turn error of the second
/// encoder.
#[test]
fn worked_cases() {
    let mut rng = Rng::new(1);
    let pose_errors = PoseErrors {
        axis1_sag_rad: 0.002,
        axis2_sag_rad: 0.0036,
        axis2_eccentricity_rad: -0.0013,
    };
    for _ in 0..1_000 {
        let aim = Enu::new(rng.within(100.0), -100.0, 40.0);
        let stiff = Heliostat::new(Enu::default(), aim);
        let erring = Heliostat {
            pose_errors,
            ..stiff
        };
        let sun = EnuUnit::from_azimuth_elevation(PI + rng.within(1.0), rng.range(0.2, 1.2));
        for mode in [JUELICH, TrackingMode::AzimuthElevation] {
            let [stiff, erring] = [stiff, erring].map(|h| {
                let got = one(mode, h).track(sun);
                assert_eq!(got.status(), [Status::Ok]);
                [got.axis1_rad()[0], got.axis2_rad()[0]]
            });
            let [gamma, alpha] = stiff;
            let (t1, t2) = (-gamma, alpha);
            let mut want = if mode == JUELICH {
                // up is where the mirror faces at rest: the first axis sags by kappa1 sin(gamma) cos(alpha)
                [-0.002 * t1.sin() * t2.cos(), 0.0036 * t2.sin() * t1.cos()]
            } else {
                [0.0, -0.0036 * alpha.cos()]
            };
            want[1] -= 0.0013 * alpha.sin();
            for axis in 0..2 {
                let off = stiff[axis] - erring[axis] - want[axis];
                assert!(off.abs() < 2e-15, "{mode:?} axis {axis}: {off:e}");
            }
        }
    }
}

/// Both solutions of every mode err as their own true pose asks: encoder angles against the
/// independent inverse.
#[test]
fn encoder_angles_are_those_of_the_true_pose() {
    let mut worst = 0.0_f64;
    let mut count = 0;
    for number in 0..MODES {
        let mut rng = Rng::new(20 + number as u64);
        let mode = cases::mode(number, rng.range(0.1, 1.4));
        let sun = cases::sun(&mut rng);
        let mut direct: Vec<Heliostat> = (0..3_000)
            .map(|_| cases::heliostat(&mut rng, Kind::Anywhere, mode, sun.into()))
            .collect();
        cases::pose_errors(&mut rng, &mut direct);
        let over: Vec<Heliostat> = direct
            .iter()
            .map(|h| Heliostat {
                limits: AxisLimits {
                    axis2_min_rad: h.errors.elevation_reference_rad + FRAC_PI_2 + 0.1,
                    axis2_max_rad: h.errors.elevation_reference_rad + 3.0 * FRAC_PI_2 - 0.1,
                    ..AxisLimits::NONE
                },
                ..*h
            })
            .collect();
        for (which, heliostats) in [&direct, &over].into_iter().enumerate() {
            let field = cases::field(mode, heliostats);
            let got = Tracker::new(&field, OffsetForm::Exact).unwrap().track(sun);
            for (row, h) in heliostats.iter().enumerate() {
                let truth = normal::exact(
                    h.pivot.into(),
                    h.aim.into(),
                    h.mirror_offset_m,
                    V3::from(sun),
                )
                .unwrap();
                let far = mount::cone_margin(mode, truth.t, &h.errors, truth.n) > 1e-2
                    && truth.cos_theta.value() > 0.1;
                if !far || got.status()[row] != Status::Ok {
                    continue;
                }
                let both =
                    mount::inverse_with(mode, truth.t, &h.errors, h.pose_errors, truth.n).unwrap();
                let axes = [got.axis1_rad()[row], got.axis2_rad()[row]];
                for axis in 0..2 {
                    let off = (axes[axis] - both[which][axis]) / TAU;
                    worst = worst.max((off - off.round()).abs() * TAU);
                }
                count += 1;
            }
        }
    }
    eprintln!("{count} answers within {worst:.1e} rad");
    assert!(count > 20_000);
    assert!(worst < 1e-12);
}

/// Face along the fixed axis of a perfect mount any first angle will do, and it stays where it is; the second
/// then sags by where that is.
#[test]
fn a_free_axis_stays_and_the_other_sags_accordingly() {
    let mode = TrackingMode::SpinningElevation;
    let mut h = Heliostat::new(Enu::default(), Enu::new(0.0, -100.0, 0.0));
    h.pose_errors = PoseErrors {
        axis1_sag_rad: 0.02,
        axis2_sag_rad: -0.03,
        axis2_eccentricity_rad: 0.01,
    };
    let to_aim = EnuUnit::try_new(h.aim).unwrap();
    for reference in [0.0, 1.2] {
        h.errors.azimuth_reference_rad = reference;
        let tracker = one(mode, h);
        for now in [-2.0, 0.0, 0.7, 3.0, f64::NAN] {
            let present = Present {
                axis1_rad: &[now],
                axis2_rad: &[1.5],
            };
            let mut out = Tracking::default();
            let options = TrackOptions::default();
            tracker
                .track_into(&[to_aim], Some(present), &options, &mut out)
                .unwrap();
            assert_eq!(out.status(), [Status::Ok]);
            if !now.is_nan() {
                assert_eq!(out.axis1_rad()[0], now);
            }
            let back = tracker.forward(out.axis1_rad(), out.axis2_rad()).unwrap()[0];
            let off = (back.as_enu() - to_aim.as_enu()).norm();
            assert!(off < 1e-15, "from {now}: {off:e}");
        }
    }
}

type Bits = [u64; 4];

fn bits(tracking: &Tracking, row: usize) -> (Bits, Status) {
    let columns = [
        tracking.axis1_rad(),
        tracking.axis2_rad(),
        tracking.incidence_rad(),
        tracking.limit_excess_rad(),
    ];
    (columns.map(|c| c[row].to_bits()), tracking.status()[row])
}

fn mixed(
    rng: &mut Rng,
    mode: TrackingMode,
    sun: V3,
    count: usize,
    limited: bool,
) -> Vec<Heliostat> {
    (0..count)
        .map(|row| {
            let mut h = if row % 300 < 200 {
                cases::heliostat(rng, Kind::Anywhere, mode, sun)
            } else {
                cases::messy(rng, mode, sun)
            };
            if !limited {
                h.limits = AxisLimits::NONE;
            } else if row % 300 < 100 {
                h.limits = AxisLimits {
                    axis1_min_rad: -7.0,
                    axis1_max_rad: 9.0,
                    axis2_min_rad: -8.0,
                    axis2_max_rad: 8.0,
                };
            }
            h
        })
        .collect()
}

const FORMS: [OffsetForm; 4] = [
    OffsetForm::Exact,
    OffsetForm::Approximate,
    OffsetForm::Iterated(2),
    OffsetForm::None,
];

/// Instruction sets × threads × batch sizes × forms × limits × present × modes, and several suns at once.
#[test]
fn the_same_bits_however_it_is_computed() {
    const LARGEST: usize = 50_001;
    let mut out = Tracking::default();
    for number in 0..MODES {
        for limited in [false, true] {
            let mut rng = Rng::new(40 + 2 * number as u64 + u64::from(limited));
            let mode = cases::mode(number, 0.6);
            let suns = [cases::sun(&mut rng), cases::sun(&mut rng)];
            let mut some = mixed(&mut rng, mode, suns[0].into(), 901, limited);
            cases::pose_errors(&mut rng, &mut some);
            let all: Vec<Heliostat> = (0..LARGEST).map(|row| some[row * 7 % 901]).collect();
            let mut column = || -> Vec<f64> {
                let place = |rng: &mut Rng| {
                    if rng.chance(0.1) {
                        f64::NAN
                    } else {
                        rng.within(9.0)
                    }
                };
                (0..LARGEST).map(|_| place(&mut rng)).collect()
            };
            let (axis1, axis2) = (column(), column());
            for form in FORMS {
                let whole = Tracker::new(&cases::field(mode, &all), form).unwrap();
                for known in [false, true] {
                    let present = |size: usize| {
                        known.then(|| Present {
                            axis1_rad: &axis1[..size],
                            axis2_rad: &axis2[..size],
                        })
                    };
                    let scalar = TrackOptions {
                        threads: 1,
                        level: Some(SimdLevel::Scalar),
                    };
                    whole
                        .track_into(&suns, present(LARGEST), &scalar, &mut out)
                        .unwrap();
                    let oracle: Vec<_> = (0..2 * LARGEST).map(|row| bits(&out, row)).collect();
                    for size in [1, 7, 64, 901, LARGEST] {
                        let tracker =
                            Tracker::new(&cases::field(mode, &all[..size]), form).unwrap();
                        for &level in SimdLevel::available() {
                            for threads in [1, 2, 7] {
                                let options = TrackOptions {
                                    threads,
                                    level: Some(level),
                                };
                                tracker
                                    .track_into(&suns, present(size), &options, &mut out)
                                    .unwrap();
                                for sun in 0..2 {
                                    for row in 0..size {
                                        assert_eq!(
                                            bits(&out, sun * size + row),
                                            oracle[sun * LARGEST + row],
                                            "{mode:?} {form:?} {known} {size} {level} {threads}"
                                        );
                                    }
                                }
                            }
                        }
                    }
                }
            }
        }
    }
}

/// Heliostats without pose errors get the same bits whether or not another one has some: inverse and forward.
#[test]
fn a_neighbour_with_pose_errors_changes_nothing() {
    let mut rng = Rng::new(60);
    let count = 1_500;
    for number in 0..MODES {
        for limited in [false, true] {
            let mode = cases::mode(number, 0.6);
            let sun = cases::sun(&mut rng);
            let mut all = mixed(&mut rng, mode, sun.into(), count, limited);
            for h in all.iter_mut().step_by(9) {
                h.errors = MountErrors::default();
            }
            let mut with_other = all.clone();
            let mut other = all[0];
            if limited {
                other.pose_errors.axis2_sag_rad = 0.01;
            } else {
                other.pose_errors.axis2_eccentricity_rad = 0.01;
            }
            with_other.push(other);
            let mut axis1: Vec<f64> = (0..=count).map(|_| rng.within(9.0)).collect();
            let mut axis2: Vec<f64> = (0..=count).map(|_| rng.within(9.0)).collect();
            for row in (0..count).step_by(27) {
                (axis1[row], axis2[row]) = (0.0, -0.0);
            }
            for form in FORMS {
                let alone = Tracker::new(&cases::field(mode, &all), form).unwrap();
                let both = Tracker::new(&cases::field(mode, &with_other), form).unwrap();
                let (mut want, mut got) = (Tracking::default(), Tracking::default());
                for &level in SimdLevel::available() {
                    let options = TrackOptions {
                        threads: 1,
                        level: Some(level),
                    };
                    for known in [false, true] {
                        let present = |size: usize| {
                            known.then(|| Present {
                                axis1_rad: &axis1[..size],
                                axis2_rad: &axis2[..size],
                            })
                        };
                        alone
                            .track_into(&[sun], present(count), &options, &mut want)
                            .unwrap();
                        both.track_into(&[sun], present(count + 1), &options, &mut got)
                            .unwrap();
                        for row in 0..count {
                            let place = || format!("{mode:?} {form:?} {level} {known} row {row}");
                            assert_eq!(bits(&want, row), bits(&got, row), "{}", place());
                        }
                    }
                }
                let want = alone.forward(&axis1[..count], &axis2[..count]).unwrap();
                let got = both.forward(&axis1, &axis2).unwrap();
                for (row, (want, got)) in want.iter().zip(&got).enumerate() {
                    let bits = |n: &EnuUnit| {
                        let v = n.as_enu();
                        [v.east, v.north, v.up].map(f64::to_bits)
                    };
                    assert_eq!(bits(want), bits(got), "{mode:?} row {row}");
                }
            }
        }
    }
}

/// Forward over every orientation keeps unit length and closes on the independent turning of steel; the sum of
/// all is checked in `closing`.
#[test]
fn the_most_that_is_accepted_still_closes() {
    let mut worst = 0.0_f64;
    for number in 0..MODES {
        let mode = cases::mode(number, 0.6);
        let mut rng = Rng::new(80 + number as u64);
        for signs in 0..8 {
            let mut h = Heliostat::new(Enu::default(), (rng.direction() * 300.0).enu());
            h.pose_errors = PoseErrors::from_array([1, 2, 4].map(|bit| {
                if signs & bit == 0 {
                    PoseErrors::MAX_RAD
                } else {
                    -PoseErrors::MAX_RAD
                }
            }));
            let tracker = one(mode, h);
            let to_aim = Dd3::new(h.aim.into());
            for _ in 0..300 {
                let (axis1, axis2) = (rng.within(TAU), rng.within(TAU));
                let got = tracker.forward(&[axis1], &[axis2]).unwrap()[0];
                let want =
                    mount::forward_with(mode, to_aim, &h.errors, h.pose_errors, axis1, axis2);
                worst = worst.max(want.distance_to(got.into()));
            }
        }
    }
    eprintln!("forward within {worst:.2e}");
    assert!(worst < 2e-15);
}

#[test]
fn what_is_too_much_is_refused_by_name() {
    for (errors, what) in [
        ([0.0501, 0.0, 0.0], "axis1_sag_rad"),
        ([0.0, -0.06, 0.0], "axis2_sag_rad"),
        ([f64::NAN, 0.0, 0.0], "axis1_sag_rad"),
        ([0.0, f64::INFINITY, 0.0], "axis2_sag_rad"),
        ([0.05, -0.05, 0.0501], "axis2_eccentricity_rad"),
        ([0.0, 0.0, f64::NAN], "axis2_eccentricity_rad"),
    ] {
        let mut field = Field::new(TrackingMode::AzimuthElevation);
        let mut h = Heliostat::new(Enu::default(), Enu::new(0.0, 50.0, 0.0));
        h.pose_errors = PoseErrors::from_array(errors);
        let error = field.push("A1", h).unwrap_err();
        assert!(
            matches!(&error, FieldError::BadValue { id, what: found, .. } if id == "A1" && *found == what),
            "{error}"
        );
    }
}
