//! Held parameters, priors, the mirror offset as seventh parameter, several targets, all modes, sigmas, bad calls.

#![allow(
    clippy::unwrap_used,
    clippy::print_stdout,
    reason = "tests fail and talk"
)]

mod common;

use std::f64::consts::{FRAC_PI_2, PI};

use common::{Place, Rng, campaign, errors, observe, parameters, place, sun};
use helio_calib::{
    CalibrationError, Constraint, Fit, FitOptions, Mount, Observation, Parameter, ResidualForm,
    Solver, Start, Stop, fit, measures, pointing_sigma_mrad, uncertainty,
};
use helio_core::angle::wrap_pi;
use helio_core::{Enu, EnuUnit, MountErrors, TargetPlane, TrackingMode};

const SOLVERS: [Solver; 2] = [Solver::HartleyMeyer, Solver::GaussNewton];

fn off(found: &Fit, mount: &Mount, truth: &MountErrors) -> f64 {
    let wanted = parameters(mount, truth).canonical();
    (0..6)
        .map(|k| wrap_pi(found.parameters.values[k] - wanted.values[k]).abs())
        .fold(0.0, f64::max)
}

fn modes() -> [TrackingMode; 5] {
    [
        TrackingMode::AzimuthElevation,
        TrackingMode::SpinningElevation,
        TrackingMode::PitchRoll {
            axis_azimuth_rad: FRAC_PI_2,
        },
        TrackingMode::PitchRoll {
            axis_azimuth_rad: 0.4,
        },
        TrackingMode::Polar { latitude_rad: 0.65 },
    ]
}

#[test]
fn every_mode_is_found_from_cold() {
    for mode in modes() {
        for solver in SOLVERS {
            for seed in 0..40 {
                let mut rng = Rng::new(seed);
                let place = place(&mut rng, mode);
                let truth = errors(&mut rng);
                let seen = campaign(&mut rng, &place, &truth, 20, 0.0);
                let options = FitOptions {
                    solver,
                    ..FitOptions::default()
                };
                let found = fit(&place.mount, &seen, &options).unwrap();
                let off = off(&found, &place.mount, &truth);
                assert!(
                    off < 1e-9,
                    "{mode:?} {solver:?} seed {seed}: {off} {found:?}"
                );
            }
        }
    }
}

#[test]
fn the_mirror_offset_can_be_the_seventh_parameter() {
    let mut constraints = [Constraint::Free; 7];
    for solver in SOLVERS {
        for start in [Start::Cold, Start::Zeros] {
            for seed in 0..40 {
                let mut rng = Rng::new(seed + 100);
                let mut place = place(&mut rng, TrackingMode::AzimuthElevation);
                let truth = MountErrors {
                    azimuth_reference_rad: 0.1,
                    ..errors(&mut rng)
                };
                let seen = campaign(&mut rng, &place, &truth, 40, 0.0);
                let right = place.mount.mirror_offset_m;
                place.mount.mirror_offset_m = right + 0.15;
                let options = FitOptions {
                    solver,
                    start,
                    constraints,
                    ..FitOptions::default()
                };
                let found = fit(&place.mount, &seen, &options).unwrap();
                let off = off(&found, &place.mount, &truth);
                let offset = found.parameters.mirror_offset_m();
                assert!(
                    off < 1e-9 && (offset - right).abs() < 1e-7,
                    "{seed}: {off} {offset}, not {right}"
                );
            }
        }
    }
    // held, the offset stays what the mount says
    constraints[6] = Constraint::Held;
    let mut rng = Rng::new(7);
    let place = place(&mut rng, TrackingMode::AzimuthElevation);
    let truth = errors(&mut rng);
    let seen = campaign(&mut rng, &place, &truth, 10, 0.5);
    let options = FitOptions {
        constraints,
        ..FitOptions::default()
    };
    let found = fit(&place.mount, &seen, &options).unwrap();
    assert_eq!(
        found.parameters.mirror_offset_m(),
        place.mount.mirror_offset_m
    );
}

#[test]
fn held_parameters_stay_to_the_bit() {
    let mut rng = Rng::new(11);
    let place = place(&mut rng, TrackingMode::AzimuthElevation);
    let truth = errors(&mut rng);
    let seen = campaign(&mut rng, &place, &truth, 30, 0.3);
    let begin = parameters(&place.mount, &truth);
    for held in 0..7 {
        let mut constraints = [Constraint::Free; 7];
        constraints[held] = Constraint::Held;
        let options = FitOptions {
            constraints,
            start: Start::At(begin),
            ..FitOptions::default()
        };
        let found = fit(&place.mount, &seen, &options).unwrap();
        assert!(found.stop.converged());
        assert_eq!(found.parameters.values[held], begin.values[held]);
        let known = uncertainty(&place.mount, &seen, &found, &options).unwrap();
        assert_eq!(known.standard_errors[held], 0.0);
        assert_eq!(known.interval95(Parameter::ALL[held], &found), None);
        assert_eq!(known.free.len(), 6);
        assert_eq!(known.singular_values.len(), 6);
    }
}

#[test]
fn several_targets_in_one_fit() {
    for seed in 0..40 {
        let mut rng = Rng::new(seed + 300);
        let place = place(&mut rng, TrackingMode::AzimuthElevation);
        let truth = errors(&mut rng);
        let side = EnuUnit::from_azimuth_elevation(0.3, -0.2);
        let planes = [
            place.plane,
            TargetPlane::level(Enu::new(-8.0, 1.0, 30.0), side),
        ];
        let mut seen = Vec::new();
        while seen.len() < 16 {
            let target = seen.len() % 2;
            let at = sun(&mut rng);
            let spot = [rng.within(1.0), rng.within(1.0)];
            if let Some(mut record) = observe(&place.mount, &truth, &planes[target], at, spot) {
                record.target = target;
                seen.push(record);
            }
        }
        let found = fit(&place.mount, &seen, &FitOptions::default()).unwrap();
        let off = off(&found, &place.mount, &truth);
        assert!(off < 1e-9, "{seed}: {off}");
    }
}

/// Normal equations with priors, by elimination: nothing of the code under test.
fn solve(mut a: Vec<Vec<f64>>, mut b: Vec<f64>) -> Vec<f64> {
    let n = b.len();
    for i in 0..n {
        let pivot = (i..n)
            .max_by(|&x, &y| a[x][i].abs().total_cmp(&a[y][i].abs()))
            .unwrap();
        a.swap(i, pivot);
        b.swap(i, pivot);
        for k in i + 1..n {
            let factor = a[k][i] / a[i][i];
            let above = a[i].clone();
            for (value, above) in a[k].iter_mut().zip(above) {
                *value -= factor * above;
            }
            b[k] -= factor * b[i];
        }
    }
    for i in (0..n).rev() {
        for k in i + 1..n {
            b[i] -= a[i][k] * b[k];
        }
        b[i] /= a[i][i];
    }
    b
}

#[test]
fn priors_weigh_as_the_closed_form_says() {
    // around the truth the model is linear over microradians: x = (JᵀWJ + P)⁻¹ (JᵀW y + P m)
    let mut rng = Rng::new(21);
    let place = place(&mut rng, TrackingMode::AzimuthElevation);
    let truth = errors(&mut rng);
    let begin = parameters(&place.mount, &truth);
    let mut seen = campaign(&mut rng, &place, &truth, 12, 1e-3);
    let sigma_m = 2e-4;
    for record in &mut seen {
        record.sigma_m = Some(sigma_m);
    }
    let means: Vec<f64> = (0..6)
        .map(|k| begin.values[k] + 2e-6 * rng.normal())
        .collect();
    let prior_sigma = 1e-6;
    let mut constraints = [Constraint::Held; 7];
    for (constraint, &mean) in constraints.iter_mut().zip(&means) {
        *constraint = Constraint::Prior {
            mean,
            sigma: prior_sigma,
        };
    }
    // slopes by central differences of the residuals alone
    let residuals = |values: [f64; 7]| {
        let at = helio_calib::Parameters { values };
        measures(&place.mount, &seen, &at).0
    };
    let at_truth: Vec<f64> = residuals(begin.values).concat();
    let step = 1e-5;
    let slopes: Vec<Vec<f64>> = (0..6)
        .map(|k| {
            let [mut up, mut down] = [begin.values; 2];
            up[k] += step;
            down[k] -= step;
            let (up, down) = (residuals(up).concat(), residuals(down).concat());
            up.iter()
                .zip(&down)
                .map(|(u, d)| (u - d) / (2.0 * step))
                .collect()
        })
        .collect();
    let weight = 1.0 / (sigma_m * sigma_m);
    let prior = 1.0 / (prior_sigma * prior_sigma);
    let dot = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(x, y)| x * y).sum::<f64>();
    let matrix: Vec<Vec<f64>> = (0..6)
        .map(|i| {
            (0..6)
                .map(|k| weight * dot(&slopes[i], &slopes[k]) + if i == k { prior } else { 0.0 })
                .collect()
        })
        .collect();
    let right: Vec<f64> = (0..6)
        .map(|i| prior * (means[i] - begin.values[i]) - weight * dot(&slopes[i], &at_truth))
        .collect();
    let wanted = solve(matrix.clone(), right);
    for solver in SOLVERS {
        for start in [Start::At(begin), Start::Cold] {
            let options = FitOptions {
                solver,
                start,
                constraints,
                ..FitOptions::default()
            };
            let found = fit(&place.mount, &seen, &options).unwrap();
            for k in 0..6 {
                let moved = found.parameters.values[k] - begin.values[k];
                assert!(
                    (moved - wanted[k]).abs() < 1e-10,
                    "{k}: {moved}, not {} (the prior alone {})",
                    wanted[k],
                    means[k] - begin.values[k]
                );
            }
            // the covariance at sigma 1 is the inverse of that matrix; here sigma is estimated
            let known = uncertainty(&place.mount, &seen, &found, &options).unwrap();
            for k in 0..6 {
                let unit: Vec<f64> = (0..6).map(|i| f64::from(u8::from(i == k))).collect();
                let variance = solve(matrix.clone(), unit)[k];
                let ratio = known.covariance[k][k] / variance;
                let s = known.sigma * known.sigma;
                assert!(
                    ratio > 0.98 * s.min(1.0) && ratio < 1.02 * s.max(1.0),
                    "{k}: {ratio}, sigma² {s}"
                );
            }
        }
    }
}

#[test]
fn a_prior_brings_few_records_to_a_fit() {
    let mut rng = Rng::new(5);
    let place = place(&mut rng, TrackingMode::AzimuthElevation);
    let truth = errors(&mut rng);
    let mut seen = campaign(&mut rng, &place, &truth, 1, 0.0);
    seen[0].sigma_m = Some(0.05);
    let wanted = parameters(&place.mount, &truth);
    let mut constraints = FitOptions::default().constraints;
    for k in [0, 1, 3, 5] {
        constraints[k] = Constraint::Prior {
            mean: wanted.values[k],
            sigma: 1e-3,
        };
    }
    let options = FitOptions {
        constraints,
        ..FitOptions::default()
    };
    let found = fit(&place.mount, &seen, &options).unwrap();
    assert!(found.stop.converged(), "{found:?}");
    assert!(off(&found, &place.mount, &truth) < 1e-9, "{found:?}");
    let free = fit(&place.mount, &seen, &FitOptions::default());
    assert_eq!(
        free,
        Err(CalibrationError::TooFew {
            found: 1,
            wanted: 3,
            parameters: 6
        })
    );
    let distance = FitOptions {
        residual: ResidualForm::Distance,
        ..FitOptions::default()
    };
    assert!(matches!(
        fit(&place.mount, &seen, &distance),
        Err(CalibrationError::TooFew { wanted: 6, .. })
    ));
}

#[test]
fn sigmas_weigh_records() {
    // one in three records is ten times as noisy and says so
    let (mut stated, mut silent) = (0.0, 0.0);
    let mut chi = 0.0;
    for seed in 0..200 {
        let mut rng = Rng::new(seed + 400);
        let place = place(&mut rng, TrackingMode::AzimuthElevation);
        let truth = errors(&mut rng);
        let mut seen = campaign(&mut rng, &place, &truth, 30, 0.0);
        for (i, record) in seen.iter_mut().enumerate() {
            let sigma = if i % 3 == 0 { 0.5 } else { 0.05 };
            record.u_m += sigma * rng.normal();
            record.v_m += sigma * rng.normal();
            record.sigma_m = Some(sigma);
        }
        let options = FitOptions::default();
        let found = fit(&place.mount, &seen, &options).unwrap();
        stated += off(&found, &place.mount, &truth);
        let known = uncertainty(&place.mount, &seen, &found, &options).unwrap();
        assert_eq!(known.degrees_of_freedom, 54);
        chi += known.chi_square.unwrap() / 54.0 / 200.0;
        let mut without = seen.clone();
        for record in &mut without {
            record.sigma_m = None;
        }
        let found = fit(&place.mount, &without, &options).unwrap();
        let known = uncertainty(&place.mount, &without, &found, &options).unwrap();
        assert_eq!(known.chi_square, None);
        silent += off(&found, &place.mount, &truth);
    }
    assert!(stated < 0.4 * silent, "{stated} {silent}");
    // 200 times 54 degrees of freedom: 1 ± 0.014
    assert!((chi - 1.0).abs() < 0.05, "{chi}");
    // one sigma for all changes nothing but units
    let mut rng = Rng::new(3);
    let place = place(&mut rng, TrackingMode::AzimuthElevation);
    let truth = errors(&mut rng);
    let seen = campaign(&mut rng, &place, &truth, 20, 0.5);
    let mut with = seen.clone();
    for record in &mut with {
        record.sigma_m = Some(0.125);
    }
    let options = FitOptions::default();
    let [a, b] = [seen, with].map(|seen| {
        let found = fit(&place.mount, &seen, &options).unwrap();
        let known = uncertainty(&place.mount, &seen, &found, &options).unwrap();
        (found, known)
    });
    for k in 0..6 {
        assert!((a.0.parameters.values[k] - b.0.parameters.values[k]).abs() < 1e-11);
        let ratio = a.1.standard_errors[k] / b.1.standard_errors[k];
        assert!((ratio - 1.0).abs() < 1e-8, "{ratio}");
    }
    assert!((a.1.sigma - 0.125 * b.1.sigma).abs() < 1e-10);
}

#[test]
fn influence_is_what_leaving_out_does() {
    let mut rng = Rng::new(77);
    let place = place(&mut rng, TrackingMode::AzimuthElevation);
    let truth = errors(&mut rng);
    // small noise: first order is said
    let seen = campaign(&mut rng, &place, &truth, 12, 3e-3);
    let options = FitOptions::default();
    let found = fit(&place.mount, &seen, &options).unwrap();
    let known = uncertainty(&place.mount, &seen, &found, &options).unwrap();
    let trace: f64 = known.leverage.iter().sum();
    assert!((trace - 6.0).abs() < 1e-9, "{trace}");
    for (i, record) in seen.iter().enumerate() {
        let mut rest = seen.clone();
        rest.remove(i);
        let without = fit(&place.mount, &rest, &options).unwrap();
        // the beam's turn is what changes its spot, over the way, across the beam: compare by the two spots
        let spot_with = spot(&place, record, &found);
        let spot_without = spot(&place, record, &without);
        let (a, b) = (
            spot_with - place.mount.pivot,
            spot_without - place.mount.pivot,
        );
        let angle = 1e3 * a.cross(b).norm() / (a.norm() * b.norm());
        let said = known.influence_mrad[i];
        assert!(
            (said - angle).abs() < 0.02 * angle,
            "{i}: {said}, left out {angle}"
        );
    }
}

fn spot(place: &Place, record: &Observation, found: &Fit) -> Enu {
    let residual = measures(&place.mount, &[*record], &found.parameters).0[0];
    place
        .plane
        .point(record.u_m + residual[0], record.v_m + residual[1])
}

#[test]
fn pointing_sigma_is_the_scatter_of_beams() {
    // many fits of one heliostat: their beams scatter over a sun as the first fit's covariance says
    let mut rng = Rng::new(31);
    let place = place(&mut rng, TrackingMode::AzimuthElevation);
    let truth = errors(&mut rng);
    let options = FitOptions::default();
    let clean = campaign(&mut rng, &place, &truth, 20, 0.0);
    let ahead = sun(&mut rng);
    let aim = place.plane.centre;
    let exact = observe(&place.mount, &truth, &place.plane, ahead, [0.0, 0.0]).unwrap();
    let slant = (aim - place.mount.pivot).norm();
    let (mut squares, mut variances) = (0.0, 0.0);
    for _ in 0..400 {
        let mut seen = clean.clone();
        for record in &mut seen {
            record.u_m += 5e-4 * slant * rng.normal();
            record.v_m += 5e-4 * slant * rng.normal();
        }
        let found = fit(&place.mount, &seen, &options).unwrap();
        let known = uncertainty(&place.mount, &seen, &found, &options).unwrap();
        let sigma = pointing_sigma_mrad(
            &place.mount,
            &found.parameters,
            &known.covariance,
            ahead,
            aim,
        )
        .unwrap();
        variances += sigma * sigma / 400.0;
        // at the true heliostat's encoder angles the fit expects the beam elsewhere: that is its error
        let off = helio_calib::beam_errors_mrad(&place.mount, &[exact], &found.parameters)[0];
        squares += off * off / 400.0;
    }
    let ratio = (squares / variances).sqrt();
    assert!((ratio - 1.0).abs() < 0.06, "{ratio}");
    let none = [[0.0; 7]; 7];
    let below = EnuUnit::try_new(place.mount.pivot - aim).unwrap();
    let held = parameters(&place.mount, &truth);
    assert_eq!(
        pointing_sigma_mrad(&place.mount, &held, &none, ahead, aim),
        Some(0.0)
    );
    assert_eq!(
        pointing_sigma_mrad(&place.mount, &held, &none, below, aim),
        None
    );
}

#[test]
fn what_the_data_cannot_tell_is_said() {
    // twelve pictures of one moment: two angles are all they know
    let mut rng = Rng::new(41);
    let place = place(&mut rng, TrackingMode::AzimuthElevation);
    let truth = errors(&mut rng);
    let at = sun(&mut rng);
    let seen: Vec<_> = (0..12)
        .map(|_| {
            let mut record = observe(&place.mount, &truth, &place.plane, at, [0.1, 0.2]).unwrap();
            record.u_m += 0.02 * rng.normal();
            record.v_m += 0.02 * rng.normal();
            record
        })
        .collect();
    for solver in SOLVERS {
        let options = FitOptions {
            solver,
            ..FitOptions::default()
        };
        let found = fit(&place.mount, &seen, &options).unwrap();
        assert!(found.stop.converged(), "{found:?}");
        assert!(found.rms_m < 0.1);
        // the shortest step leaves no angle wild
        assert!(found.parameters.errors().pedestal_tilt_rad < 0.2);
        let known = uncertainty(&place.mount, &seen, &found, &options).unwrap();
        assert_eq!(known.rank, 2);
        assert!(known.condition > 1e10);
        assert!(known.standard_errors[0] > 1.0);
        assert!((known.weakest.iter().map(|x| x * x).sum::<f64>() - 1.0).abs() < 1e-12);
    }
}

#[test]
fn one_record_in_the_wrong_place_ends_plain_squares_by_name() {
    let mut rng = Rng::new(51);
    let place = place(&mut rng, TrackingMode::AzimuthElevation);
    let truth = errors(&mut rng);
    let mut seen = campaign(&mut rng, &place, &truth, 30, 0.2);
    seen[4].axis1_rad += PI; // the beam goes away from the target
    let found = fit(&place.mount, &seen, &FitOptions::default()).unwrap();
    assert!(
        found.stop == Stop::NoLanding || found.sum_of_squares.is_finite(),
        "{found:?}"
    );
    let robust = FitOptions {
        loss: helio_calib::Loss::Huber,
        ..FitOptions::default()
    };
    let found = fit(&place.mount, &seen, &robust).unwrap();
    assert!(found.stop.converged());
    assert!(found.weights[4] < 0.1, "{:?}", found.weights);
    assert!(off(&found, &place.mount, &truth) < 0.01, "{found:?}");
}

#[test]
fn wrong_calls_are_refused_by_name() {
    let mut rng = Rng::new(61);
    let place = place(&mut rng, TrackingMode::AzimuthElevation);
    let truth = errors(&mut rng);
    let seen = campaign(&mut rng, &place, &truth, 8, 0.2);
    let try_with = |change: fn(&mut Observation)| {
        let mut seen = seen.clone();
        change(&mut seen[3]);
        fit(&place.mount, &seen, &FitOptions::default())
            .unwrap_err()
            .to_string()
    };
    type Case = (fn(&mut Observation), &'static str);
    let cases: [Case; 6] = [
        (
            |o| o.u_m = f64::NAN,
            "observation 3: u_m must be finite, got NaN",
        ),
        (
            |o| o.axis2_rad = f64::INFINITY,
            "observation 3: axis2_rad must be finite, got inf",
        ),
        (
            |o| o.sigma_m = Some(0.0),
            "observation 3: sigma_m must be finite and positive, got 0",
        ),
        (
            |o| o.sigma_m = Some(-1.0),
            "observation 3: sigma_m must be finite and positive, got -1",
        ),
        (
            |o| o.plane.centre.up = f64::NAN,
            "observation 3: target centre must be finite, got NaN",
        ),
        (
            |o| o.sun = EnuUnit::from_azimuth_elevation(f64::NAN, 0.3),
            "observation 3: sun must be finite, got NaN",
        ),
    ];
    for (change, message) in cases {
        assert_eq!(try_with(change), message);
    }
    let mut options = FitOptions {
        constraints: [Constraint::Held; 7],
        ..FitOptions::default()
    };
    assert_eq!(
        fit(&place.mount, &seen, &options),
        Err(CalibrationError::NothingFree)
    );
    options.constraints[0] = Constraint::Prior {
        mean: 0.0,
        sigma: 0.0,
    };
    assert!(matches!(
        fit(&place.mount, &seen, &options),
        Err(CalibrationError::BadPrior { .. })
    ));
    let none = FitOptions {
        max_iterations: 0,
        ..FitOptions::default()
    };
    assert!(matches!(
        fit(&place.mount, &seen, &none),
        Err(CalibrationError::BadOption { .. })
    ));
    assert!(matches!(
        fit(&place.mount, &[], &FitOptions::default()),
        Err(CalibrationError::TooFew { found: 0, .. })
    ));
}
