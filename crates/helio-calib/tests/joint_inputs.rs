//! What the joint fit and a followed field do with numbers that make no sense.

#![allow(clippy::unwrap_used, reason = "tests fail")]

use helio_calib::joint::simulate::{FieldOptions, SimulatedField, simulate_field};
use helio_calib::joint::{
    Cause, FieldState, JointFit, JointOptions, JumpSeen, LeftoverOptions, Mishaps, Noise,
    SpotCause, StateParts, StepKind, Wander, fit_joint,
};
use helio_calib::{CalibrationError, Campaign, Duty, Observation};
use helio_core::{Enu, EnuUnit};

const RECORDS: usize = 14;

fn field() -> (SimulatedField, JointOptions) {
    let options = FieldOptions {
        heliostats: 12,
        records: RECORDS,
        ..FieldOptions::new(41).unwrap()
    };
    let how = JointOptions::new(options.site.latitude_rad());
    (simulate_field(&options).unwrap(), how)
}

type Spoil = fn(&mut Observation);

/// Each makes a record one that cannot be used.
const SPOILS: [(&str, Spoil); 10] = [
    ("sigma_m NaN", |o| o.sigma_m = Some(f64::NAN)),
    ("sigma_m 0", |o| o.sigma_m = Some(0.0)),
    ("sigma_m negative", |o| o.sigma_m = Some(-0.02)),
    ("sigma_m infinite", |o| o.sigma_m = Some(f64::INFINITY)),
    ("sigma_m beyond squares", |o| o.sigma_m = Some(1e200)),
    ("sun", |o| {
        o.sun = EnuUnit::from_azimuth_elevation(f64::NAN, 0.5);
    }),
    ("axis1_rad", |o| o.axis1_rad = f64::INFINITY),
    ("axis2_rad", |o| o.axis2_rad = f64::NAN),
    ("u_m", |o| o.u_m = f64::NEG_INFINITY),
    ("plane", |o| o.plane.centre = Enu::new(0.0, f64::NAN, 40.0)),
];

/// Largest difference of what is said of heliostats, in standard deviations.
fn apart(one: &JointFit, other: &JointFit) -> f64 {
    let mut most: f64 = 0.0;
    for (a, b) in one.heliostats.iter().zip(&other.heliostats) {
        let n = a.still.len() + a.wandering.len();
        let numbers = a.still.iter().chain(&a.wandering);
        for (i, (x, y)) in numbers.zip(b.still.iter().chain(&b.wandering)).enumerate() {
            let (p, q) = (a.covariance[i * n + i], b.covariance[i * n + i]);
            // NaN is no maximum
            assert!(x.is_finite() && p.is_finite(), "{x} {p}");
            most = most.max((x - y).abs() / q.sqrt());
            most = most.max((p / q - 1.0).abs());
        }
    }
    most
}

/// Records without scatter: noise and wander are to be found at nothing, which is farther than the rounds of one search
/// go. Of the same field with scatter the search ends.
#[test]
fn a_search_that_ended_early_says_so() {
    let ended = |size: f64| {
        let options = FieldOptions::new(1).unwrap();
        let (noise, wander) = (options.noise, options.wander);
        let options = FieldOptions {
            heliostats: 12,
            records: 20,
            noise: Noise {
                beam_mrad: size * noise.beam_mrad,
                spot_m: size * noise.spot_m,
                sun_path_s: size * noise.sun_path_s,
            },
            wander: Wander {
                slow_mrad: wander.slow_mrad.map(|x| size * x),
                fast_mrad: wander.fast_mrad.map(|x| size * x),
                ..wander
            },
            ..options
        };
        let field = simulate_field(&options).unwrap();
        let how = JointOptions {
            expansions: 1,
            ..JointOptions::new(options.site.latitude_rad())
        };
        let fit = fit_joint(&field.first(20), &how).unwrap();
        for posterior in &fit.heliostats {
            let numbers = posterior.still.iter().chain(&posterior.covariance);
            assert!(numbers.clone().all(|x| x.is_finite()), "{size}");
        }
        fit.converged
    };
    assert!(ended(1.0));
    assert!(!ended(1e-9));
}

#[test]
fn records_that_cannot_be_used_tell_nothing() {
    let (field, how) = field();
    let clean = fit_joint(&field.first(RECORDS), &how).unwrap();
    // one beside each of the records of heliostat 3, made at the same time
    for (n, (what, spoil)) in SPOILS.into_iter().enumerate() {
        let mut campaigns = field.first(RECORDS);
        let mut records = campaigns[3].observations.to_vec();
        let mut bad = records[n];
        spoil(&mut bad);
        records.insert(n + 1, bad);
        campaigns[3].observations = &records;
        let fit = fit_joint(&campaigns, &how).unwrap();
        // other heliostats stand side by side and are summed in another order: no more than rounding, through a search
        let apart = apart(&fit, &clean);
        assert!(apart < 1e-6, "{what}: {apart}");
        let heliostat = &fit.heliostats[3];
        assert_eq!(heliostat.records, RECORDS + 1, "{what}");
        assert!(!heliostat.outliers.contains(&(n + 1)), "{what}");
        let history = fit.history(3, &campaigns[3]).unwrap();
        assert_eq!(history[n + 1].observation, n + 1, "{what}");
        assert!(history[n + 1].foretold.beam_mrad().is_nan(), "{what}");
        assert_eq!(
            history[n + 1].zero_rad,
            history[n].zero_rad,
            "{what}: nothing new at the same time"
        );
    }
}

#[test]
fn a_followed_field_passes_them_by() {
    let (field, how) = field();
    let fit = fit_joint(&field.first(RECORDS - 4), &how).unwrap();
    let ids: Vec<String> = (0..12).map(|k| format!("h{k}")).collect();
    let clean = fit.follow(&ids).unwrap();
    let heliostat = &field.heliostats[5];
    let good = &heliostat.observations[RECORDS - 4..RECORDS];
    for (what, spoil) in SPOILS {
        let mut records = good.to_vec();
        let mut bad = records[1];
        spoil(&mut bad);
        records.insert(2, bad);
        let of = |observations| Campaign {
            mount: heliostat.mount,
            observations,
        };
        let (mut with, mut without) = (clean.clone(), clean.clone());
        let steps = with.update(&[(5, of(&records))]).unwrap();
        without.update(&[(5, of(good))]).unwrap();
        assert_eq!(steps[0][2].kind, StepKind::Misses, "{what}");
        let (mut parts, without) = (with.parts(), without.parts());
        // but for being counted
        let [with, without_it] = [&mut parts.heliostats[5], &mut without.heliostats[5].clone()];
        assert_eq!((with.misses, without_it.misses), (1, 0), "{what}");
        (with.records, with.misses) = (with.records - 1, 0);
        for (with, without) in with.accounts.iter_mut().zip(&without_it.accounts) {
            assert!(with.lately.odd > without.lately.odd + 0.5, "{what}");
            with.lately = without.lately;
        }
        assert!(parts == without, "{what}");
    }
}

#[test]
fn only_targets_that_were_seen_have_causes() {
    let (mut field, how) = field();
    for heliostat in &mut field.heliostats {
        for o in &mut heliostat.observations {
            o.target = [2, 400, usize::MAX][o.target];
        }
    }
    // a record that tells nothing names none
    field.heliostats[0].observations[0].target = 7;
    field.heliostats[0].observations[0].u_m = f64::NAN;
    let fit = fit_joint(&field.first(RECORDS), &how).unwrap();
    let shifts: Vec<Cause> = fit
        .causes
        .iter()
        .map(|c| c.cause)
        .filter(|c| matches!(c, Cause::Target(..)))
        .collect();
    let wanted: Vec<Cause> = [2, 400, usize::MAX]
        .into_iter()
        .flat_map(|t| {
            [
                Cause::Target(SpotCause::TargetRight, t),
                Cause::Target(SpotCause::TargetDown, t),
            ]
        })
        .collect();
    assert_eq!(shifts, wanted);
}

#[test]
fn heliostats_without_times_have_no_last_day() {
    let (mut field, how) = field();
    for o in &mut field.heliostats[4].observations[..RECORDS] {
        o.unix_ns = None;
    }
    let fit = fit_joint(&field.first(RECORDS), &how).unwrap();
    assert_eq!(fit.heliostats[4].last_day, None);
    assert_eq!(fit.heliostats[4].records, RECORDS);
    assert!(fit.heliostats[3].last_day.unwrap() > 10_000.0);
}

/// What was refused, and the value.
fn refused<T: std::fmt::Debug>(of: Result<T, CalibrationError>) -> (&'static str, f64) {
    match of {
        Err(CalibrationError::BadOption { what, value, .. }) => (what, value),
        other => panic!("{other:?}"),
    }
}

#[test]
fn options_that_make_no_sense_are_refused() {
    type Spoiled = (&'static str, fn(&mut JointOptions), f64);
    let spoiled: [Spoiled; 14] = [
        ("site_latitude_rad", |o| o.site_latitude_rad = 1.6, 1.6),
        ("mishaps.outlier", |o| o.mishaps.outlier = -0.1, -0.1),
        (
            "mishaps.outlier",
            |o| o.mishaps.outlier = f64::NAN,
            f64::NAN,
        ),
        ("mishaps.jump", |o| o.mishaps.jump = -1e-9, -1e-9),
        ("mishaps.jump", |o| o.mishaps.jump = f64::NAN, f64::NAN),
        (
            "mishaps.outlier + mishaps.jump",
            |o| {
                o.mishaps = Mishaps {
                    outlier: 0.5,
                    jump: 0.5,
                    ..o.mishaps
                }
            },
            1.0,
        ),
        (
            "mishaps.outlier_mrad",
            |o| o.mishaps.outlier_mrad = 0.0,
            0.0,
        ),
        (
            "mishaps.outlier_mrad",
            |o| o.mishaps.outlier_mrad = f64::INFINITY,
            f64::INFINITY,
        ),
        ("mishaps.jump_mrad", |o| o.mishaps.jump_mrad = -1.0, -1.0),
        (
            "mishaps.jump_mrad",
            |o| o.mishaps.jump_mrad = f64::NAN,
            f64::NAN,
        ),
        (
            "site_latitude_rad",
            |o| o.site_latitude_rad = f64::NAN,
            f64::NAN,
        ),
        (
            "site_latitude_rad",
            |o| o.site_latitude_rad = f64::NEG_INFINITY,
            f64::NEG_INFINITY,
        ),
        (
            "least_log_evidence",
            |o| o.least_log_evidence = f64::NAN,
            f64::NAN,
        ),
        ("learnt_from", |o| o.learnt_from = 0, 0.0),
    ];
    for (wanted, spoil, value) in spoiled {
        let mut how = JointOptions::new(0.7);
        spoil(&mut how);
        let (what, found) = refused(fit_joint(&[], &how));
        assert_eq!(what, wanted);
        assert!(found == value || (found.is_nan() && value.is_nan()));
    }
    // none at all is a sensible wish
    let mut how = JointOptions::new(0.7);
    how.mishaps.outlier = 0.0;
    how.mishaps.jump = 0.0;
    fit_joint(&[], &how).unwrap();
}

/// A state with records in doubt.
fn state() -> FieldState {
    let (field, how) = field();
    let fit = fit_joint(&field.first(RECORDS - 2), &how).unwrap();
    let ids: Vec<String> = (0..12).map(|k| format!("h{k}")).collect();
    let mut state = fit.follow(&ids).unwrap();
    let heliostat = &field.heliostats[0];
    let mut records = heliostat.observations[RECORDS - 2..RECORDS].to_vec();
    records[1].u_m += 1.5;
    let campaign = Campaign {
        mount: heliostat.mount,
        observations: &records,
    };
    state.update(&[(0, campaign)]).unwrap();
    state
}

#[test]
fn states_that_make_no_sense_are_refused() {
    let parts = state().parts();
    let doubtful = &parts.heliostats[0];
    assert!(doubtful.accounts.len() > 1, "the last record is in doubt");
    let again = FieldState::from_parts(parts.clone()).unwrap();
    assert_eq!(again.parts(), parts);
    type Spoiled = (&'static str, fn(&mut StateParts));
    let spoiled: [Spoiled; 45] = [
        ("noise.beam_mrad", |p| p.noise.beam_mrad = f64::NAN),
        ("noise.beam_mrad", |p| p.noise.beam_mrad = 0.0),
        ("noise.spot_m", |p| p.noise.spot_m = -0.01),
        ("noise.sun_path_s", |p| p.noise.sun_path_s = f64::INFINITY),
        ("wander.slow_mrad", |p| p.wander.slow_mrad[1] = f64::NAN),
        ("wander.fast_mrad", |p| p.wander.fast_mrad[0] = -0.1),
        ("wander.slow_days", |p| p.wander.slow_days = 0.0),
        ("wander.slow_days", |p| p.wander.slow_days = f64::INFINITY),
        ("wander.fast_days", |p| p.wander.fast_days = f64::NAN),
        ("site_latitude_rad", |p| p.site_latitude_rad = f64::NAN),
        ("mishaps.outlier", |p| p.mishaps.outlier = f64::NAN),
        ("mishaps.outlier + mishaps.jump", |p| {
            p.mishaps.outlier = 2.0
        }),
        ("mishaps.jump", |p| p.mishaps.jump = -0.1),
        ("mishaps.outlier_mrad", |p| p.mishaps.outlier_mrad = 0.0),
        ("mishaps.jump_mrad", |p| p.mishaps.jump_mrad = f64::NAN),
        ("alarm.false_alarm_rate", |p| p.alarm.false_alarm_rate = 2.0),
        ("alarm.weight", |p| p.alarm.weight = f64::NAN),
        ("square", |p| p.square = f64::NAN),
        ("log_determinant", |p| p.log_determinant = f64::INFINITY),
        ("prior_sigma", |p| p.prior_sigma[2] = -1.0),
        ("prior_sigma", |p| p.prior_sigma[2] = f64::NAN),
        ("variance in spread", |p| p.spread[2] = -1.0),
        ("spread", |p| p.spread[1] = f64::NAN),
        ("diagonal of matrix", |p| p.matrix[5] = -1.0),
        ("vector", |p| p.vector[0] = f64::NAN),
        ("heliostat by its place", |p| {
            p.heliostats[7].id = p.heliostats[2].id.clone();
        }),
        ("day of a record", |p| {
            p.heliostats[1].last_day = Some(f64::NAN);
        }),
        ("day of a record", |p| {
            p.heliostats[0].undecided[0] = f64::INFINITY;
        }),
        ("day of a jump", |p| {
            let day = f64::NAN;
            p.heliostats[1].jumps.push(JumpSeen { day, axis: 0 });
        }),
        ("axis of a jump", |p| {
            p.heliostats[1].jumps.push(JumpSeen { day: 1e4, axis: 7 });
        }),
        ("accounts", |p| p.heliostats[3].accounts.clear()),
        ("log_likelihood", |p| {
            p.heliostats[0].accounts[1].log_likelihood = f64::NAN;
        }),
        ("drift", |p| {
            p.heliostats[0].accounts[0].drift[1] = f64::NAN;
        }),
        ("drift_variance", |p| {
            p.heliostats[0].accounts[0].drift_variance = -0.1;
        }),
        ("drift_variance", |p| {
            p.heliostats[0].accounts[0].drift_variance = f64::NAN;
        }),
        ("mean", |p| p.heliostats[4].accounts[0].mean[1] = f64::NAN),
        ("gain", |p| p.heliostats[4].accounts[0].gain[1] = f64::NAN),
        ("spread", |p| {
            p.heliostats[4].accounts[0].spread[1] = f64::NAN;
        }),
        ("variance in spread", |p| {
            p.heliostats[4].accounts[0].spread[9] = -1e-3;
        }),
        ("square", |p| {
            p.heliostats[0].accounts[0].square = f64::INFINITY;
        }),
        ("axis of a jump", |p| {
            p.heliostats[0].accounts[0].jumps.push((0, 2));
        }),
        ("record in doubt", |p| {
            p.heliostats[0].accounts[0].outliers.push(99);
        }),
        ("diagonal of matrix", |p| {
            let common = p.vector.len();
            let account = &mut p.heliostats[0].accounts[0];
            account.matrix = vec![-1.0; common * (common + 1) / 2];
            account.vector = vec![1.0; common];
        }),
        ("matrix", |p| p.matrix.truncate(3)),
        ("matrix", |p| p.matrix[1] = 1e300),
    ];
    for (n, (wanted, spoil)) in spoiled.into_iter().enumerate() {
        let mut parts = parts.clone();
        spoil(&mut parts);
        let (what, _) = refused(FieldState::from_parts(parts));
        assert_eq!(what, wanted, "{n}");
    }
}

#[test]
fn a_fit_says_whether_its_search_ended() {
    let (field, how) = field();
    let fit = fit_joint(&field.first(RECORDS), &how).unwrap();
    assert!(fit.converged);
    // the site's latitude is all that is known: nothing to search, and nothing found
    assert!(fit_joint(&[], &how).unwrap().converged);
}

#[test]
fn places_beyond_the_end_are_refused() {
    let (field, how) = field();
    let campaigns = field.first(RECORDS);
    let fit = fit_joint(&campaigns, &how).unwrap();
    let leftovers = fit
        .leftovers(&campaigns, &LeftoverOptions::default())
        .unwrap();
    let ids: Vec<String> = (0..12).map(|k| k.to_string()).collect();
    let mut state = fit.follow(&ids).unwrap();
    let (campaign, mount) = (&campaigns[0], &campaigns[0].mount);
    let duty = Duty {
        suns: &[],
        aim: Enu::default(),
    };
    for place in [12, usize::MAX] {
        let refused = [
            ("k", fit.foretell(place, campaign).map(|_| ())),
            ("k", fit.history(place, campaign).map(|_| ())),
            ("k", fit.parameters(place, 0.2).map(|_| ())),
            ("k", fit.zero_points(place, campaign).map(|_| ())),
            (
                "k",
                leftovers
                    .foretell(&fit, place, campaign, campaign)
                    .map(|_| ()),
            ),
            ("place", state.update(&[(place, *campaign)]).map(|_| ())),
            ("place", state.foretell(place, campaign).map(|_| ())),
            ("place", state.known(place, 0.0).map(|_| ())),
            ("place", state.at_rest(place).map(|_| ())),
            (
                "place",
                state.pointing_mrad(place, mount, 0.0, &duty).map(|_| ()),
            ),
            (
                "place",
                state.plan(place, mount, &[], &duty, 1, 0.0).map(|_| ()),
            ),
        ];
        for (n, (what, refused)) in refused.into_iter().enumerate() {
            let wanted = format!("{what} must be below 12, the number of heliostats, got {place}");
            assert_eq!(refused.unwrap_err().to_string(), wanted, "{n}");
        }
    }
    // nor does one stand twice, nor know leftovers heliostats that the fit does not
    let (what, value) = refused(state.update(&[(3, *campaign), (3, *campaign)]));
    assert_eq!((what, value), ("place", 3.0));
    let smaller = fit_joint(&campaigns[..5], &how).unwrap();
    let error = leftovers.foretell(&smaller, 5, campaign, campaign);
    let wanted = "k must be below 5, the number of heliostats, got 5";
    assert_eq!(error.unwrap_err().to_string(), wanted);
}
