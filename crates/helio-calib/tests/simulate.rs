//! Synthetic campaigns against what was asked of them.

#![allow(clippy::unwrap_used, reason = "tests fail")]

use helio_calib::model::{Pose, landing};
use helio_calib::simulate::{Aiming, ErrorSpread, Fault, Jump, SimulateOptions, simulate};
use helio_calib::{CalibrationError, Mount, Parameters, Sighting};
use helio_core::angle::radians;
use helio_core::sun::{SunSite, position};
use helio_core::{Enu, EnuUnit, MountAxes, MountErrors, PoseErrors, TargetPlane, TrackingMode};

fn juelich() -> SunSite {
    SunSite::new(radians(50.9134), radians(6.3878), 88.0).unwrap()
}

fn mount(pivot: Enu) -> Mount {
    let mode = TrackingMode::PitchRoll {
        axis_azimuth_rad: std::f64::consts::FRAC_PI_2,
    };
    Mount {
        axes: MountAxes::of(mode, EnuUnit::UP),
        pivot,
        mirror_offset_m: 0.175,
        pose_errors: PoseErrors::NONE,
    }
}

fn targets() -> Vec<TargetPlane> {
    let north = EnuUnit::try_new(Enu::new(0.0, 1.0, 0.0)).unwrap();
    [(0.0, 43.1), (0.0, 35.9), (-17.6, 52.0)]
        .map(|(east, up)| TargetPlane::level(Enu::new(east, -3.2, up), north))
        .to_vec()
}

fn truth() -> Parameters {
    let errors = MountErrors {
        pedestal_tilt_rad: 0.006,
        pedestal_tilt_azimuth_rad: 2.0,
        axis_nonorthogonality_rad: -0.003,
        mirror_tilt_rad: 0.004,
        azimuth_reference_rad: 0.01,
        elevation_reference_rad: -0.008,
    };
    Parameters::new(&errors, 0.175)
}

/// Beam errors of the truth, over the slant \[mrad\].
fn misses(mount: &Mount, campaign: &helio_calib::Simulated) -> Vec<[f64; 2]> {
    campaign
        .observations
        .iter()
        .zip(&campaign.truth)
        .map(|(observation, truth)| {
            let slant_m = (observation.plane.centre - mount.pivot).norm();
            let landing = landing(
                &Pose::of(&truth.parameters),
                &Sighting::new(mount, observation),
            );
            landing.residual_m.map(|r| 1e3 * r / slant_m)
        })
        .collect()
}

#[test]
fn without_noise_every_spot_is_where_the_truth_sends_it() {
    let mount = mount(Enu::new(93.4, 219.8, 1.8));
    let options = SimulateOptions {
        noise_mrad: 0.0,
        ..SimulateOptions::default()
    };
    let campaign = simulate(&mount, &truth(), &targets(), &juelich(), &options).unwrap();
    for miss in misses(&mount, &campaign) {
        assert!(miss[0].abs() < 1e-9 && miss[1].abs() < 1e-9, "{miss:?}");
    }
    // The uncalibrated beam wanders over the board.
    let far = campaign.observations.iter().map(|o| o.u_m.hypot(o.v_m));
    assert!(far.fold(0.0, f64::max) > 1.0);
    assert!(campaign.observations.iter().all(|o| o.sigma_m.is_none()));
}

#[test]
fn times_suns_and_hours_are_those_asked_for() {
    let mount = mount(Enu::new(93.4, 219.8, 1.8));
    let site = juelich();
    let options = SimulateOptions {
        count: 200,
        hours: [13.0, 16.5],
        min_sun_elevation_rad: 0.3,
        days: Some(9),
        ..SimulateOptions::default()
    };
    let campaign = simulate(&mount, &truth(), &targets(), &site, &options).unwrap();
    assert_eq!(campaign.observations.len(), 200);
    let mut days = std::collections::BTreeSet::new();
    let mut last = i64::MIN;
    for observation in &campaign.observations {
        let unix_ns = observation.unix_ns.unwrap();
        assert!(unix_ns > last && unix_ns >= options.from_unix_ns && unix_ns < options.to_unix_ns);
        last = unix_ns;
        let sun = position(&site, unix_ns, None, 0.0).unwrap();
        assert_eq!(sun.direction(), observation.sun);
        assert!(sun.apparent_elevation_rad >= 0.3);
        let hour = 12.0 + observation.hour_angle_rad.unwrap().to_degrees() / 15.0;
        assert!((13.0..=16.5).contains(&hour), "{hour}");
        // Solar time against the clock: longitude 6.3878° and at most 17 minutes of equation of time.
        let clock = (unix_ns as f64 / 3.6e12).rem_euclid(24.0) + 6.3878 / 15.0;
        assert!((hour - clock).abs() < 0.29, "{hour} {clock}");
        days.insert((unix_ns as f64 / 8.64e13 + 6.3878 / 360.0).floor() as i64);
    }
    assert!(days.len() <= 9 && days.len() >= 8, "{}", days.len());
    let lit: std::collections::BTreeSet<_> =
        campaign.observations.iter().map(|o| o.target).collect();
    assert_eq!(lit.len(), 3);
}

#[test]
fn noise_is_as_large_as_stated() {
    let mount = mount(Enu::new(-20.0, 60.0, 1.8));
    let options = SimulateOptions {
        count: 4000,
        noise_mrad: 0.7,
        ..SimulateOptions::default()
    };
    let campaign = simulate(&mount, &truth(), &targets(), &juelich(), &options).unwrap();
    let misses = misses(&mount, &campaign);
    for k in [0, 1] {
        let sum: f64 = misses.iter().map(|m| m[k] * m[k]).sum();
        let sigma = (sum / 4000.0).sqrt();
        // four standard errors of a standard deviation: 4 / sqrt(2 · 4000)
        assert!((sigma / 0.7 - 1.0).abs() < 0.045, "{sigma}");
    }
    for (observation, _) in campaign.observations.iter().zip(&misses) {
        let slant_m = (observation.plane.centre - mount.pivot).norm();
        assert!((observation.sigma_m.unwrap() / (0.7e-3 * slant_m) - 1.0).abs() < 1e-12);
    }
}

#[test]
fn outliers_and_jumps_are_where_the_truth_says() {
    let mount = mount(Enu::new(93.4, 219.8, 1.8));
    let clean = SimulateOptions {
        count: 100,
        noise_mrad: 0.0,
        ..SimulateOptions::default()
    };
    let jump = Jump {
        unix_ns: 1_751_000_000_000_000_000,
        azimuth_reference_rad: 0.005,
        elevation_reference_rad: -0.002,
    };
    let wrong = SimulateOptions {
        outlier_share: 0.1,
        outlier_mrad: 12.0,
        jumps: vec![jump],
        ..clean.clone()
    };
    let site = juelich();
    let clean = simulate(&mount, &truth(), &targets(), &site, &clean).unwrap();
    let wrong = simulate(&mount, &truth(), &targets(), &site, &wrong).unwrap();
    let mut outliers = 0;
    for (row, miss) in misses(&mount, &wrong).into_iter().enumerate() {
        let far = miss[0].hypot(miss[1]);
        let (a, b) = (&clean.observations[row], &wrong.observations[row]);
        // The same campaign otherwise.
        assert_eq!(
            (a.unix_ns, a.axis1_rad, a.target),
            (b.unix_ns, b.axis1_rad, b.target)
        );
        if wrong.truth[row].fault == Fault::Outlier {
            outliers += 1;
            assert!((12.0..=24.0).contains(&far), "{far}");
        } else {
            assert!(far < 1e-9, "{far}");
        }
        let later = b.unix_ns.unwrap() >= jump.unix_ns;
        let added = wrong.truth[row].parameters.values[2] - truth().values[2];
        assert!((added - if later { 0.005 } else { 0.0 }).abs() < 1e-15);
        assert_eq!(later && wrong.truth[row].fault == Fault::None, {
            let moved = (a.u_m - b.u_m).hypot(a.v_m - b.v_m);
            wrong.truth[row].fault == Fault::None && moved > 0.5
        });
    }
    assert_eq!(outliers, 10);
}

/// Of few observations each, too, the share asked for is the share made.
#[test]
fn shares_hold_over_heliostats_of_few_observations() {
    for (count, share) in [(12, 0.02), (25, 0.02), (30, 0.03), (7, 0.5)] {
        let mut outliers = 0;
        for seed in 0..400 {
            let options = SimulateOptions {
                seed,
                count,
                outlier_share: share,
                ..SimulateOptions::default()
            };
            let mount = mount(Enu::new(93.4, 219.8, 1.8));
            let campaign = simulate(&mount, &truth(), &targets(), &juelich(), &options).unwrap();
            let faults = campaign.truth.iter().map(|truth| truth.fault);
            let of_one = faults.filter(|fault| *fault == Fault::Outlier).count();
            let wanted = share * count as f64;
            assert!((of_one as f64 - wanted).abs() < 1.0, "{of_one}");
            outliers += of_one;
        }
        let wanted = 400.0 * share * count as f64;
        let sigma = (400.0 * 0.25_f64).sqrt();
        assert!(
            (outliers as f64 - wanted).abs() < 3.0 * sigma,
            "{outliers} {wanted}"
        );
    }
}

#[test]
fn records_of_another_heliostat_or_target_are_what_they_are() {
    let here = mount(Enu::new(93.4, 219.8, 1.8));
    let there = mount(Enu::new(97.9, 219.8, 1.8));
    let options = SimulateOptions {
        count: 60,
        noise_mrad: 0.0,
        wrong_heliostat_share: 0.1,
        neighbours: vec![(there, truth())],
        wrong_target_share: 0.2,
        ..SimulateOptions::default()
    };
    let campaign = simulate(&here, &truth(), &targets(), &juelich(), &options).unwrap();
    let mut count = [0; 3];
    for (observation, truth) in campaign.observations.iter().zip(&campaign.truth) {
        let beam = |mount: &Mount, plane: TargetPlane| {
            let mut seen = *observation;
            seen.plane = plane;
            let landing = landing(&Pose::of(&truth.parameters), &Sighting::new(mount, &seen));
            landing.residual_m[0].hypot(landing.residual_m[1])
        };
        match truth.fault {
            Fault::None => {
                count[0] += 1;
                assert!(beam(&here, observation.plane) < 1e-9);
            }
            Fault::WrongHeliostat(which) => {
                count[1] += 1;
                assert_eq!(which, 0);
                assert!(beam(&here, observation.plane) > 1.0);
                assert!(beam(&there, observation.plane) < 1e-9);
            }
            Fault::WrongTarget(lit) => {
                count[2] += 1;
                assert_ne!(lit, observation.target);
                assert_eq!(observation.plane, targets()[observation.target]);
                assert!(beam(&here, observation.plane) > 1.0);
                assert!(beam(&here, targets()[lit]) < 1e-9);
            }
            other => panic!("{other:?}"),
        }
    }
    assert_eq!(count, [42, 6, 12]);
}

#[test]
fn references_far_off_are_no_trouble_when_somebody_steers() {
    let mount = mount(Enu::new(93.4, 219.8, 1.8));
    let spread = ErrorSpread {
        azimuth_reference_rad: 3.0,
        ..ErrorSpread::default()
    };
    for seed in 0..20 {
        let errors = spread.draw(&mut helio_calib::random::Random::new(seed));
        let options = SimulateOptions {
            seed,
            aiming: Aiming::Board {
                half_width_m: 4.3,
                half_height_m: 3.6,
            },
            board_half_m: Some([4.3, 3.6]),
            noise_mrad: 0.0,
            ..SimulateOptions::default()
        };
        let errors = Parameters::new(&errors, 0.175);
        let campaign = simulate(&mount, &errors, &targets(), &juelich(), &options).unwrap();
        assert!(campaign.observations.iter().all(|o| o.u_m.abs() <= 4.3));
        assert!(campaign.observations.iter().any(|o| o.u_m.abs() > 3.0));
    }
}

#[test]
fn the_same_seed_gives_the_same_bits() {
    let mount = mount(Enu::new(93.4, 219.8, 1.8));
    let options = SimulateOptions {
        outlier_share: 0.1,
        days: Some(5),
        ..SimulateOptions::default()
    };
    let make = |options: &SimulateOptions| {
        simulate(&mount, &truth(), &targets(), &juelich(), options).unwrap()
    };
    let campaign = make(&options);
    assert_eq!(campaign, make(&options));
    let other = SimulateOptions { seed: 2, ..options };
    assert_ne!(campaign, make(&other));
}

#[test]
fn what_cannot_be_is_refused() {
    let mount = mount(Enu::new(93.4, 219.8, 1.8));
    let ask = |options: SimulateOptions, targets: &[TargetPlane]| {
        let error = simulate(&mount, &truth(), targets, &juelich(), &options).unwrap_err();
        let CalibrationError::BadOption { what, .. } = error else {
            panic!("{error}");
        };
        what
    };
    let base = SimulateOptions::default;
    let all = targets();
    let night = SimulateOptions {
        hours: [0.0, 1.0],
        ..base()
    };
    assert!(ask(night, &all).starts_with("number of observations"));
    let from_unix_ns = base().from_unix_ns;
    for (options, what) in [
        (
            SimulateOptions {
                noise_mrad: f64::NAN,
                ..base()
            },
            "noise_mrad",
        ),
        (
            SimulateOptions {
                outlier_share: 1.5,
                ..base()
            },
            "outlier_share",
        ),
        (
            SimulateOptions {
                wrong_heliostat_share: 0.1,
                ..base()
            },
            "wrong_heliostat_share",
        ),
        (
            SimulateOptions {
                hours: [9.0, 9.0],
                ..base()
            },
            "hours to",
        ),
        (
            SimulateOptions {
                hours: [9.0, 25.0],
                ..base()
            },
            "hours to",
        ),
        (
            SimulateOptions {
                days: Some(0),
                ..base()
            },
            "days",
        ),
        (
            SimulateOptions {
                days: Some(367),
                ..base()
            },
            "days",
        ),
        (
            SimulateOptions {
                to_unix_ns: from_unix_ns,
                ..base()
            },
            "to_unix_ns",
        ),
    ] {
        assert_eq!(ask(options, &all), what);
    }
    assert_eq!(ask(base(), &[]), "number of targets");
    let one = SimulateOptions {
        wrong_target_share: 0.5,
        ..base()
    };
    assert_eq!(ask(one, &all[..1]), "wrong_target_share");
}
