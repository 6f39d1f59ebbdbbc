//! Whole fields against the single fit, and the same bits however they are computed.

#![allow(
    clippy::unwrap_used,
    clippy::print_stdout,
    reason = "tests fail and talk"
)]

mod common;

use common::{Rng, errors, observe, place, sun};
use helio_calib::{
    Campaign, Constraint, FieldFit, FieldFitOptions, FitOptions, Mount, Observation, Parameter,
    Parameters, Start, Stop, fit, fit_field, uncertainty,
};
use helio_core::{Enu, EnuUnit, SimdLevel, TargetPlane, TrackingMode};

const MODES: [TrackingMode; 4] = [
    TrackingMode::AzimuthElevation,
    TrackingMode::SpinningElevation,
    TrackingMode::PitchRoll {
        axis_azimuth_rad: std::f64::consts::FRAC_PI_2,
    },
    TrackingMode::Polar { latitude_rad: 0.65 },
];

struct Seen {
    mount: Mount,
    truth: Parameters,
    observations: Vec<Observation>,
}

impl Seen {
    fn campaign(&self) -> Campaign<'_> {
        Campaign {
            mount: self.mount,
            observations: &self.observations,
        }
    }
}

/// M from 6 to 60, noise 0.5 mrad; each third heliostat sees a second target, each fifth states sigmas.
fn field(seed: u64, count: usize) -> Vec<Seen> {
    let mut rng = Rng::new(seed);
    (0..count)
        .map(|k| {
            let mode = MODES[k % 4];
            let at = place(&mut rng, mode);
            let errors = errors(&mut rng);
            let facing = EnuUnit::try_new(Enu::new(0.1, 1.0, -0.2)).unwrap();
            let second = TargetPlane::level(at.plane.centre + Enu::new(0.5, 0.0, -8.0), facing);
            let slant = (at.plane.centre - at.mount.pivot).norm();
            let wanted = 6 + (rng.unit() * 55.0) as usize;
            let mut observations = Vec::new();
            while observations.len() < wanted {
                let other = k % 3 == 0 && rng.unit() < 0.4;
                let plane = if other { &second } else { &at.plane };
                let to = [rng.within(1.5), rng.within(1.5)];
                let Some(mut o) = observe(&at.mount, &errors, plane, sun(&mut rng), to) else {
                    continue;
                };
                let scale = if k % 5 == 0 { rng.range(0.5, 2.0) } else { 1.0 };
                o.u_m += 0.0005 * slant * scale * rng.normal();
                o.v_m += 0.0005 * slant * scale * rng.normal();
                o.sigma_m = (k % 5 == 0).then_some(0.0005 * slant * scale);
                observations.push(o);
            }
            Seen {
                mount: at.mount,
                truth: Parameters::new(&errors, at.mount.mirror_offset_m),
                observations,
            }
        })
        .collect()
}

/// Distance of two values of a parameter; references go round.
fn apart(parameter: Parameter, a: &Parameters, b: &Parameters) -> f64 {
    let d = (a.get(parameter) - b.get(parameter)).abs();
    match parameter {
        Parameter::AzimuthReference | Parameter::ElevationReference => {
            d.min((d - std::f64::consts::TAU).abs())
        }
        _ => d,
    }
}

fn farthest(a: &Parameters, b: &Parameters) -> f64 {
    Parameter::ALL
        .iter()
        .map(|&p| apart(p, a, b))
        .fold(0.0, f64::max)
}

/// Reference: the single fit on faer. Where that stops before its steps are short (a few with M = 6), it is
/// asked whether it would move away from the answer. The greatest difference, and how many were asked again.
fn against_the_single_fit(seen: &[Seen], options: &FieldFitOptions) -> (f64, usize) {
    let single = FitOptions {
        constraints: options.constraints,
        start: options.start,
        ..FitOptions::default()
    };
    let campaigns: Vec<_> = seen.iter().map(Seen::campaign).collect();
    let fits = fit_field(&campaigns, options);
    let (mut worst, mut again): (f64, usize) = (0.0, 0);
    for (k, (one, found)) in seen.iter().zip(fits).enumerate() {
        let found = found.unwrap();
        assert!(found.stop.converged(), "{k}: {found:?}");
        let mut want = fit(&one.mount, &one.observations, &single).unwrap();
        if !matches!(want.stop, Stop::SmallStep | Stop::SmallGradient) {
            again += 1;
            let from_here = FitOptions {
                start: Start::At(found.parameters),
                ..single
            };
            want = fit(&one.mount, &one.observations, &from_here).unwrap();
        }
        worst = worst.max(farthest(&found.parameters, &want.parameters));
        let ratio = found.sum_of_squares / want.sum_of_squares;
        assert!((ratio - 1.0).abs() < 1e-9, "{k}: {ratio}");
        // With sigmas the RMS is not least at the optimum: it moves as far as the parameters do.
        assert!((found.rms_m / want.rms_m - 1.0).abs() < 1e-7, "{k}");
    }
    (worst, again)
}

#[test]
fn agrees_with_the_single_fit_to_a_nanoradian_in_every_mode() {
    let (worst, again) = against_the_single_fit(&field(1, 4000), &FieldFitOptions::default());
    println!("greatest difference {worst:e} rad, {again} asked again");
    assert!(worst < 1e-9);
    assert!(again <= 8);
}

#[test]
fn agrees_with_the_offset_free_with_some_held_and_with_priors() {
    let seen = field(2, 400);
    let mut options = FieldFitOptions::default();
    options.constraints[Parameter::MirrorOffset as usize] = Constraint::Prior {
        mean: 0.25,
        sigma: 0.01,
    };
    options.constraints[Parameter::AxisNonorthogonality as usize] = Constraint::Prior {
        mean: 0.0,
        sigma: 0.03,
    };
    let (worst, _) = against_the_single_fit(&seen, &options);
    println!("with priors {worst:e}");
    assert!(worst < 1e-9);
    let mut options = FieldFitOptions::default();
    for held in [Parameter::MirrorTilt, Parameter::Tilt1, Parameter::Tilt2] {
        options.constraints[held as usize] = Constraint::Held;
    }
    let (worst, _) = against_the_single_fit(&seen, &options);
    println!("with some held {worst:e}");
    assert!(worst < 1e-9);
    let mut options = FieldFitOptions::default();
    options.constraints[Parameter::MirrorOffset as usize] = Constraint::Free;
    let long: Vec<_> = seen
        .into_iter()
        .filter(|s| s.observations.len() > 20)
        .collect();
    let (worst, _) = against_the_single_fit(&long, &options);
    println!("with the offset {worst:e}");
    assert!(worst < 1e-9);
}

#[test]
fn reaches_the_optimum_from_nothing() {
    // The truth's RMS is an upper bound of the optimum's.
    let seen = field(3, 10_000);
    let campaigns: Vec<_> = seen.iter().map(Seen::campaign).collect();
    let fits = fit_field(&campaigns, &FieldFitOptions::default());
    let mut histogram = [0_usize; 20];
    for (k, (one, found)) in seen.iter().zip(fits).enumerate() {
        let found = found.unwrap();
        let (_, truth) = helio_calib::measures(&one.mount, &one.observations, &one.truth);
        if one.observations[0].sigma_m.is_none() {
            assert!(found.rms_m <= truth.rms_m * 1.01, "{k}: {found:?}");
        }
        histogram[found.iterations.min(19)] += 1;
    }
    println!("iterations {histogram:?}");
}

fn same_bits(a: &FieldFit, b: &FieldFit) -> bool {
    let numbers = |f: &FieldFit| -> Vec<u64> {
        let mut all = f.parameters.values.to_vec();
        all.extend([f.sum_of_squares, f.rms_m]);
        if let Some(covariance) = &f.covariance {
            all.extend(covariance.as_flattened());
        }
        all.iter().map(|x| x.to_bits()).collect()
    };
    numbers(a) == numbers(b) && a.stop == b.stop && a.iterations == b.iterations
}

#[test]
fn the_same_bits_for_every_level_number_of_threads_and_neighbour() {
    let seen = field(4, 203);
    let campaigns: Vec<_> = seen.iter().map(Seen::campaign).collect();
    let options = FieldFitOptions {
        with_covariance: true,
        level: Some(SimdLevel::Scalar),
        threads: 1,
        ..FieldFitOptions::default()
    };
    let want: Vec<_> = fit_field(&campaigns, &options)
        .into_iter()
        .map(Result::unwrap)
        .collect();
    for &level in SimdLevel::available() {
        for threads in [1, 2, 5, 0] {
            let options = FieldFitOptions {
                level: Some(level),
                threads,
                ..options
            };
            for (k, got) in fit_field(&campaigns, &options).into_iter().enumerate() {
                assert!(same_bits(&got.unwrap(), &want[k]), "{level} {threads} {k}");
            }
        }
    }
    // alone, and in another order
    for k in (0..campaigns.len()).step_by(7) {
        let got = fit_field(
            &campaigns[k..=k],
            &FieldFitOptions {
                level: None,
                ..options
            },
        );
        assert!(same_bits(got[0].as_ref().unwrap(), &want[k]), "{k}");
    }
    let turned: Vec<_> = campaigns.iter().rev().copied().collect();
    let got = fit_field(
        &turned,
        &FieldFitOptions {
            level: None,
            ..options
        },
    );
    for (got, want) in got.iter().rev().zip(&want) {
        assert!(same_bits(got.as_ref().unwrap(), want));
    }
}

#[test]
fn the_covariance_is_that_of_the_single_fit() {
    // M from 6 to 60: where normal equations lose most, half of the digits are left.
    let seen = field(5, 800);
    let campaigns: Vec<_> = seen.iter().map(Seen::campaign).collect();
    let options = FieldFitOptions {
        with_covariance: true,
        ..FieldFitOptions::default()
    };
    let single = FitOptions::default();
    let mut worst: f64 = 0.0;
    for (one, found) in seen.iter().zip(fit_field(&campaigns, &options)) {
        let fitted = fit(&one.mount, &one.observations, &single).unwrap();
        let want = uncertainty(&one.mount, &one.observations, &fitted, &single).unwrap();
        let got = found.unwrap().covariance.unwrap();
        for i in 0..7 {
            for j in 0..7 {
                let scale = want.standard_errors[i] * want.standard_errors[j];
                let difference = (got[i][j] - want.covariance[i][j]).abs();
                if scale == 0.0 {
                    assert_eq!(difference, 0.0);
                } else {
                    worst = worst.max(difference / scale);
                }
            }
        }
    }
    println!("greatest relative difference of covariances {worst:e}");
    assert!(worst < 1e-5);
}

#[test]
fn references_of_any_size_are_found() {
    // The same beams with other zeros of the encoders: the same sum of squares.
    let mut rng = Rng::new(6);
    let mut seen = field(6, 400);
    let fits = |seen: &[Seen]| -> Vec<FieldFit> {
        let campaigns: Vec<_> = seen.iter().map(Seen::campaign).collect();
        let fits = fit_field(&campaigns, &FieldFitOptions::default());
        fits.into_iter().map(Result::unwrap).collect()
    };
    let before = fits(&seen);
    for one in &mut seen {
        let turns = [rng.within(40.0), rng.within(40.0)];
        for observation in &mut one.observations {
            observation.axis1_rad += turns[0];
            observation.axis2_rad += turns[1];
        }
    }
    for (k, (before, after)) in before.iter().zip(fits(&seen)).enumerate() {
        assert!(after.stop.converged());
        let ratio = after.sum_of_squares / before.sum_of_squares;
        assert!((ratio - 1.0).abs() < 1e-9, "{k}: {ratio}");
    }
}

#[test]
fn what_is_wrong_is_said_and_costs_the_others_nothing() {
    let mut seen = field(7, 30);
    let good = {
        let campaigns: Vec<_> = seen.iter().map(Seen::campaign).collect();
        fit_field(&campaigns, &FieldFitOptions::default())
    };
    seen[3].observations[4].axis1_rad = f64::NAN;
    seen[5].observations[1].sigma_m = Some(f64::INFINITY);
    seen[9].observations.truncate(2);
    seen[10].observations.clear();
    seen[11].observations[0].u_m = f64::INFINITY;
    seen[12].observations[0].sigma_m = Some(-1.0);
    // a sigma for some and none for others, whichever come first
    seen[14].observations[0].sigma_m = Some(0.1);
    seen[16].observations.last_mut().unwrap().sigma_m = Some(0.1);
    let wrong = [3, 5, 9, 10, 11, 12, 14, 16];
    let campaigns: Vec<_> = seen.iter().map(Seen::campaign).collect();
    let fits = fit_field(&campaigns, &FieldFitOptions::default());
    for (k, (fit_now, before)) in fits.iter().zip(&good).enumerate() {
        if wrong.contains(&k) {
            let single = FitOptions::default();
            let want = fit(&seen[k].mount, &seen[k].observations, &single).unwrap_err();
            assert_eq!(fit_now.as_ref().unwrap_err().to_string(), want.to_string());
        } else {
            assert!(
                same_bits(fit_now.as_ref().unwrap(), before.as_ref().unwrap()),
                "{k}"
            );
        }
    }
    assert!(fit_field(&[], &FieldFitOptions::default()).is_empty());
    let nothing = FieldFitOptions {
        constraints: [Constraint::Held; 7],
        ..FieldFitOptions::default()
    };
    assert!(fit_field(&campaigns[..1], &nothing)[0].is_err());
    let never = FieldFitOptions {
        tolerance_rad: 0.0,
        ..FieldFitOptions::default()
    };
    assert!(fit_field(&campaigns[..1], &never)[0].is_err());
}

#[test]
fn starts_where_it_is_told() {
    let seen = field(8, 40);
    for one in &seen {
        let options = FieldFitOptions {
            start: Start::At(one.truth),
            ..FieldFitOptions::default()
        };
        let told = fit_field(&[one.campaign()], &options).remove(0).unwrap();
        let cold = fit_field(&[one.campaign()], &FieldFitOptions::default())
            .remove(0)
            .unwrap();
        assert!(farthest(&told.parameters, &cold.parameters) < 1e-9);
    }
}
