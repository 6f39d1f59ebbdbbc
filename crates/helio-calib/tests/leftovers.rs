//! What is left by pose: planted in synthetic fields and found again, and not found where there is nothing.

#![allow(clippy::unwrap_used, reason = "tests fail")]
#![allow(clippy::print_stdout, reason = "numbers behind the verdicts")]

use std::f64::consts::{PI, TAU};

use helio_calib::aiming::encoder_angles_rad;
use helio_calib::joint::simulate::{FieldOptions, SimulatedField, simulate_field};
use helio_calib::joint::{
    AxisCause, Cause, CommonCause, FieldState, JointFit, JointOptions, Known, Leftover,
    LeftoverOptions, LeftoverParts, Leftovers, fit_joint,
};
use helio_calib::random::Random;
use helio_calib::{CalibrationError, Campaign, Observation, Parameters};
use helio_core::PoseErrors;

/// 95 % of chi-squared with two degrees of freedom lie below.
const SQUARE_95: f64 = 5.991;
const NEXT: usize = 4;
const DAY_NS: f64 = 86_400e9;

/// A smooth random function of both readings: waves of random direction and phase, whose covariance is a
/// squared exponential.
struct Smooth(Vec<[f64; 4]>);

impl Smooth {
    fn new(random: &mut Random, amplitude: f64, length_rad: f64) -> Self {
        let waves = 60;
        let size = amplitude * (2.0 / f64::from(waves)).sqrt();
        let wave = |_| {
            let along = [random.normal(), random.normal()].map(|w| w / length_rad);
            [size, along[0], along[1], random.between(0.0, TAU)]
        };
        Self((0..waves).map(wave).collect())
    }

    fn at(&self, pose: [f64; 2]) -> f64 {
        let of = |[size, first, second, phase]: &[f64; 4]| {
            size * (first * pose[0] + second * pose[1] + phase).cos()
        };
        self.0.iter().map(of).sum()
    }
}

/// A field of which every heliostat's readings are larger by these functions than they would be.
struct Planted {
    options: FieldOptions,
    field: SimulatedField,
    left: Vec<[Smooth; 2]>,
}

impl Planted {
    fn new(options: FieldOptions, amplitude_mrad: [f64; 2], length_rad: f64) -> Self {
        let mut field = simulate_field(&options).unwrap();
        let mut left = Vec::new();
        for (k, heliostat) in field.heliostats.iter_mut().enumerate() {
            let mut random = Random::stream(1_000_003 * options.seed, k as u64);
            let of = amplitude_mrad.map(|a| Smooth::new(&mut random, 1e-3 * a, length_rad));
            for o in &mut heliostat.observations {
                let pose = [o.axis1_rad, o.axis2_rad];
                o.axis1_rad += of[0].at(pose);
                o.axis2_rad += of[1].at(pose);
            }
            left.push(of);
        }
        Self {
            options,
            field,
            left,
        }
    }

    fn fit(&self, least_log_evidence: f64) -> (JointFit, Leftovers) {
        let campaigns = self.field.first(self.options.records);
        let joint = JointOptions::new(self.options.site.latitude_rad());
        let fit = fit_joint(&campaigns, &joint).unwrap();
        let options = LeftoverOptions {
            least_log_evidence,
            day: Some(self.next_day()),
            ..LeftoverOptions::default()
        };
        let leftovers = fit.leftovers(&campaigns, &options).unwrap();
        (fit, leftovers)
    }

    fn next_day(&self) -> f64 {
        let last = self.field.heliostats[0].observations.last().unwrap();
        last.unix_ns.unwrap() as f64 / DAY_NS
    }
}

fn base(seed: u64) -> FieldOptions {
    FieldOptions {
        heliostats: 40,
        next_day_records: NEXT,
        ..FieldOptions::new(seed).unwrap()
    }
}

fn rms(values: &[f64]) -> f64 {
    (values.iter().map(|x| x * x).sum::<f64>() / values.len() as f64).sqrt()
}

/// Causes that the fit made out, which set-points without leftovers stand on.
fn pose_errors(state: &FieldState, known: &Known) -> PoseErrors {
    let mut errors = PoseErrors::NONE;
    let mut own = 6;
    for CommonCause { cause, value, .. } in state.causes() {
        match cause {
            Cause::Axis(AxisCause::Axis1Sag) => errors.axis1_sag_rad = value,
            Cause::Axis(AxisCause::Axis2Sag) => errors.axis2_sag_rad = value,
            Cause::Axis(AxisCause::Axis2Eccentricity) => {
                errors.axis2_eccentricity_rad = known.values[own];
                own += 1;
            }
            _ => {}
        }
    }
    errors
}

/// Misses of the next day and set-points of its suns, without and with leftovers.
#[derive(Default)]
struct Scores {
    misses_mrad: [Vec<f64>; 2],
    squares: [Vec<f64>; 2],
    setpoints_mrad: [Vec<f64>; 2],
    in_sigmas: Vec<f64>,
}

impl Scores {
    fn add(&mut self, planted: &Planted, fit: &JointFit, leftovers: &Leftovers) {
        let records = planted.options.records;
        let ids: Vec<String> = (0..planted.options.heliostats)
            .map(|k| k.to_string())
            .collect();
        let state = fit.follow(&ids).unwrap();
        for (k, heliostat) in planted.field.heliostats.iter().enumerate() {
            let (past, next) = (heliostat.first(records), heliostat.after(records));
            let ways = [
                fit.foretell(k, &next).unwrap(),
                leftovers.foretell(fit, k, &past, &next).unwrap(),
            ];
            for (way, foretold) in ways.iter().enumerate() {
                for one in foretold {
                    self.misses_mrad[way].push(one.beam_mrad());
                    self.squares[way].push(one.square());
                }
            }
            let known = state.known(k, planted.next_day()).unwrap();
            let mut mount = heliostat.mount;
            mount.pose_errors = pose_errors(&state, &known);
            let known = known.parameters(mount.mirror_offset_m);
            for (o, truth) in next.observations.iter().zip(&heliostat.truth[records..]) {
                let mut true_angles = Parameters {
                    values: [heliostat.mount.mirror_offset_m; 7],
                };
                true_angles.values[..6].copy_from_slice(&heliostat.angles_rad);
                let wander = truth.wandering_rad;
                true_angles.values[2] += wander[0] + wander[2];
                true_angles.values[4] += wander[1] + wander[3];
                let aim = o.plane.centre;
                let right = encoder_angles_rad(&heliostat.mount, &true_angles, o.sun, aim).unwrap();
                let given = encoder_angles_rad(&mount, &known, o.sun, aim).unwrap();
                let turn = leftovers.heliostats[k].turn_rad(given[0], given[1]);
                let sigma = leftovers.heliostats[k].sigma_rad(&mount, &known, given[0], given[1]);
                for axis in 0..2 {
                    let error = right[axis] + planted.left[k][axis].at(right) - given[axis];
                    let error = (error + PI).rem_euclid(TAU) - PI;
                    self.setpoints_mrad[0].push(1e3 * error);
                    self.setpoints_mrad[1].push(1e3 * (error - turn[axis]));
                    self.in_sigmas.push((error - turn[axis]) / sigma[axis]);
                }
            }
        }
    }

    fn covered(squares: &[f64]) -> f64 {
        squares.iter().filter(|x| **x < SQUARE_95).count() as f64 / squares.len() as f64
    }

    fn report(&self, what: &str) -> [f64; 2] {
        let inside = self.in_sigmas.iter().filter(|z| z.abs() < 1.96).count();
        let of_setpoints = inside as f64 / self.in_sigmas.len() as f64;
        let of_beams = [0, 1].map(|way| Self::covered(&self.squares[way]));
        println!(
            "{what}: beams of the next day miss by {:.3} mrad without, {:.3} with leftovers (95 % ellipses hold {:.3}, \
             {:.3}); set-points by {:.3}, {:.3} mrad (95 % intervals hold {:.3} of {})",
            rms(&self.misses_mrad[0]),
            rms(&self.misses_mrad[1]),
            of_beams[0],
            of_beams[1],
            rms(&self.setpoints_mrad[0]),
            rms(&self.setpoints_mrad[1]),
            of_setpoints,
            self.in_sigmas.len()
        );
        [of_beams[1], of_setpoints]
    }
}

#[test]
fn planted_leftovers_are_recovered_within_their_stated_uncertainty() {
    let mut scores = Scores::default();
    for seed in 1..=4 {
        let options = FieldOptions {
            records: 120,
            ..base(seed)
        };
        let planted = Planted::new(options, [0.6, 0.4], 0.36);
        let (fit, leftovers) = planted.fit(5.0);
        println!(
            "{seed}: {:.1} nats, amplitudes {:?} mrad, length {} rad",
            leftovers.log_evidence, leftovers.amplitude_mrad, leftovers.length_rad
        );
        assert!(leftovers.admitted, "{}", leftovers.log_evidence);
        scores.add(&planted, &fit, &leftovers);
    }
    let [of_beams, of_setpoints] = scores.report("planted");
    let misses = &scores.misses_mrad;
    assert!(rms(&misses[1]) < 0.97 * rms(&misses[0]));
    assert!(rms(&scores.setpoints_mrad[1]) < 0.9 * rms(&scores.setpoints_mrad[0]));
    assert!((0.93..=0.975).contains(&of_beams), "{of_beams}");
    assert!((0.93..=0.975).contains(&of_setpoints), "{of_setpoints}");
}

#[test]
fn nothing_is_claimed_where_nothing_is_left() {
    let mut most = [f64::NEG_INFINITY; 2];
    for seed in 1..=20 {
        for (kind, most) in most.iter_mut().enumerate() {
            let mishaps = [0.0, 1.0][kind];
            let options = FieldOptions {
                outlier_probability: 0.02 * mishaps,
                jump_probability: 0.005 * mishaps,
                ..base(seed)
            };
            let planted = Planted::new(options, [0.0; 2], 0.3);
            let (_, leftovers) = planted.fit(5.0);
            *most = most.max(leftovers.log_evidence);
            assert!(!leftovers.admitted, "{seed} {}", leftovers.log_evidence);
            for heliostat in &leftovers.heliostats {
                assert_eq!(heliostat.turn_rad(3.0, 0.6), [0.0; 2]);
            }
        }
    }
    println!("largest evidence of 20 fields: {most:.1?} nats, without and with outliers and jumps");
}

#[test]
fn corrections_are_bounded_and_fade_where_nothing_was_seen() {
    let planted = Planted::new(base(3), [3.0, 3.0], 0.3);
    let (fit, leftovers) = planted.fit(5.0);
    assert!(leftovers.admitted);
    let most = LeftoverOptions::default().most_rad;
    let mut reached = 0;
    let names: Vec<String> = (0..40).map(|k| k.to_string()).collect();
    let state = fit.follow(&names).unwrap();
    for (k, heliostat) in leftovers.heliostats.iter().enumerate() {
        for i in 0..60 {
            for j in 0..20 {
                let pose = [0.1 * f64::from(i), 0.1 * f64::from(j) - 0.2];
                let turn = heliostat.turn_rad(pose[0], pose[1]);
                reached += turn.iter().filter(|x| x.abs() == most).count();
                assert!(turn.iter().all(|x| x.abs() <= most), "{turn:?}");
                let again = heliostat.turn_rad(pose[0] + TAU, pose[1]);
                assert!((0..2).all(|a| (turn[a] - again[a]).abs() < 1e-12));
            }
        }
        let mount = &planted.field.heliostats[k].mount;
        let known = state.known(k, planted.next_day()).unwrap().parameters(0.18);
        for o in planted.field.heliostats[k].first(50).observations {
            let away = [o.axis1_rad + PI, o.axis2_rad];
            let turn = heliostat.turn_rad(away[0], away[1]);
            assert!(turn.iter().all(|x| x.abs() < 1e-6), "{turn:?}");
            let sigma = heliostat.sigma_rad(mount, &known, away[0], away[1]);
            for (sigma, amplitude) in sigma.iter().zip(leftovers.amplitude_mrad) {
                assert!(*sigma > 0.999e-3 * amplitude);
            }
        }
    }
    assert!(reached > 0, "the bound was never met");
}

#[test]
fn plain_numbers_hold_all_and_wrong_ones_are_refused() {
    let planted = Planted::new(base(5), [0.8, 0.8], 0.4);
    let (fit, leftovers) = planted.fit(f64::NEG_INFINITY);
    let one = &leftovers.heliostats[7];
    let again = Leftover::from_parts(one.parts().clone()).unwrap();
    assert_eq!(&again, one);
    let refused = |change: fn(&mut LeftoverParts)| {
        let mut parts = one.parts().clone();
        change(&mut parts);
        Leftover::from_parts(parts).unwrap_err()
    };
    let errors = [
        refused(|p| p.turns_rad.truncate(1)),
        refused(|p| p.covariance.truncate(1)),
        refused(|p| p.turns_rad[0][1] = f64::NAN),
        refused(|p| p.length_rad = 0.0),
    ];
    for error in errors {
        assert!(
            matches!(error, CalibrationError::BadOption { .. }),
            "{error}"
        );
    }
    let campaigns = planted.field.first(50);
    let of = |options: &LeftoverOptions, campaigns: &[Campaign<'_>]| {
        fit.leftovers(campaigns, options).unwrap_err().to_string()
    };
    let options = LeftoverOptions::default();
    assert!(of(&options, &campaigns[1..]).contains("number of campaigns must be that of the fit"));
    let options = LeftoverOptions {
        lengths_rad: Vec::new(),
        ..options
    };
    assert!(of(&options, &campaigns).contains("number of lengths_rad must be at least 1"));
    let day = LeftoverOptions {
        day: Some(f64::NAN),
        ..LeftoverOptions::default()
    };
    assert!(of(&day, &campaigns).contains("day must be finite"));
    let evidence = LeftoverOptions {
        least_log_evidence: f64::NAN,
        ..LeftoverOptions::default()
    };
    assert!(of(&evidence, &campaigns).contains("least_log_evidence must be a number"));
}

/// Where an angle is not finite nothing is known: no correction, and that is said. A record with such an angle is
/// foretold by nothing.
#[test]
fn what_is_no_pose_is_not_corrected() {
    let planted = Planted::new(base(3), [3.0, 3.0], 0.3);
    let (fit, leftovers) = planted.fit(5.0);
    assert!(leftovers.admitted);
    let heliostat = &leftovers.heliostats[0];
    let names: Vec<String> = (0..40).map(|k| k.to_string()).collect();
    let state = fit.follow(&names).unwrap();
    let mount = &planted.field.heliostats[0].mount;
    let known = state.known(0, planted.next_day()).unwrap().parameters(0.18);
    for pose in [
        [f64::NAN, 0.5],
        [3.0, f64::INFINITY],
        [f64::NEG_INFINITY, f64::NAN],
    ] {
        assert_eq!(heliostat.turn_rad(pose[0], pose[1]), [0.0; 2]);
        let sigma = heliostat.sigma_rad(mount, &known, pose[0], pose[1]);
        assert_eq!(sigma, [f64::INFINITY; 2]);
    }
    let mut wrong = known;
    wrong.values[2] = f64::NAN;
    assert_eq!(
        heliostat.sigma_rad(mount, &wrong, 3.0, 0.5),
        [f64::INFINITY; 2]
    );

    let past = planted.field.heliostats[0].first(50);
    let mut seen = past.observations[..3].to_vec();
    seen[1].axis2_rad = f64::NAN;
    let seen = Campaign {
        observations: &seen,
        ..past
    };
    let foretold = leftovers.foretell(&fit, 0, &past, &seen).unwrap();
    assert!(foretold[1].beam_mrad().is_nan() && foretold[1].expected_mrad().is_nan());
    for k in [0, 2] {
        assert!(foretold[k].expected_mrad() < 5.0, "{:?}", foretold[k]);
    }
}

/// Of a field of which some have no records, and of none.
#[test]
fn threads_change_no_bit_and_heliostats_without_records_have_no_correction() {
    let planted = Planted::new(base(9), [0.8, 0.8], 0.4);
    let mut campaigns = planted.field.first(50);
    let none: &[Observation] = &[];
    campaigns[4].observations = none;
    campaigns[11].observations = &campaigns[11].observations[..1];
    let joint = JointOptions::new(planted.options.site.latitude_rad());
    let fit = fit_joint(&campaigns, &joint).unwrap();
    let options = LeftoverOptions::default();
    let with = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads);
        pool.build()
            .unwrap()
            .install(|| fit.leftovers(&campaigns, &options).unwrap())
    };
    let one = with(1);
    for threads in [2, 3, 8] {
        let other = with(threads);
        assert_eq!(other.log_evidence.to_bits(), one.log_evidence.to_bits());
        for (a, b) in one.heliostats.iter().zip(&other.heliostats) {
            let bits = |parts: &LeftoverParts| -> Vec<u64> {
                let turns = parts.turns_rad.iter().flatten();
                let numbers = turns.chain(&parts.covariance).chain(&parts.moved_rad);
                numbers.map(|x| x.to_bits()).collect()
            };
            assert_eq!(bits(a.parts()), bits(b.parts()), "{threads} threads");
        }
    }
    assert_eq!(one.heliostats[4].turn_rad(3.0, 0.5), [0.0; 2]);
    let nobody = fit_joint(&[], &joint).unwrap();
    let leftovers = nobody.leftovers(&[], &options).unwrap();
    assert!(!leftovers.admitted && leftovers.heliostats.is_empty());
}
