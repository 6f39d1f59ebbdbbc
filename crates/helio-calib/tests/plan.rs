//! Planned observations against others, by what they are for: the pointing error over the year.

#![allow(
    clippy::unwrap_used,
    clippy::print_stdout,
    reason = "tests fail and talk"
)]

use helio_calib::aiming::encoder_angles_rad;
use helio_calib::model::{Pose, landing};
use helio_calib::plan::{candidates, expected_pointing_mrad, year_suns};
use helio_calib::random::Random;
use helio_calib::simulate::{Aiming, ErrorSpread, SimulateOptions, simulate};
use helio_calib::{
    Candidate, Duty, FitOptions, Mount, Observation, Parameters, PlanOptions, Sighting, fit, plan,
    pointing_sigma_mrad, uncertainty,
};
use helio_core::angle::radians;
use helio_core::sun::SunSite;
use helio_core::{Enu, EnuUnit, MountAxes, MountErrors, PoseErrors, TargetPlane, TrackingMode};

const DAY_NS: i64 = 86_400_000_000_000;
const AIM: Enu = Enu::new(0.0, -0.5, 55.2);
const NOISE_MRAD: f64 = 0.5;

fn site() -> SunSite {
    SunSite::new(radians(50.9134), radians(6.3878), 88.0).unwrap()
}

fn targets() -> Vec<TargetPlane> {
    let north = EnuUnit::try_new(Enu::new(0.0, 1.0, 0.0)).unwrap();
    [(0.0, 43.1), (0.0, 35.9), (-17.6, 52.0)]
        .map(|(east, up)| TargetPlane::level(Enu::new(east, -3.2, up), north))
        .to_vec()
}

/// What a heliostat that believes `found` does at a sun: the angle between its beam and the aim \[mrad\].
fn pointing_error_mrad(mount: &Mount, truth: &Parameters, found: &Parameters, sun: EnuUnit) -> f64 {
    let [axis1_rad, axis2_rad] = encoder_angles_rad(mount, found, sun, AIM).unwrap();
    let facing = EnuUnit::try_new(mount.pivot - AIM).unwrap();
    let plane = TargetPlane::level(AIM, facing);
    let observation = Observation::new(sun, axis1_rad, axis2_rad, plane, 0.0, 0.0);
    let landing = landing(&Pose::of(truth), &Sighting::new(mount, &observation));
    1e3 * landing.residual_m[0].hypot(landing.residual_m[1]) / landing.beam_m
}

fn year_error_mrad(mount: &Mount, truth: &Parameters, found: &Parameters, suns: &[EnuUnit]) -> f64 {
    let squares = suns
        .iter()
        .map(|&sun| pointing_error_mrad(mount, truth, found, sun).powi(2));
    (squares.sum::<f64>() / suns.len() as f64).sqrt()
}

/// What a camera sees when the heliostat follows a candidate.
fn look(
    mount: &Mount,
    truth: &Parameters,
    found: &Parameters,
    candidate: &Candidate,
    random: &mut Random,
) -> Observation {
    let plane = candidate.plane;
    let [axis1_rad, axis2_rad] =
        encoder_angles_rad(mount, found, candidate.sun, plane.centre).unwrap();
    let mut seen = Observation::new(candidate.sun, axis1_rad, axis2_rad, plane, 0.0, 0.0);
    let landing = landing(&Pose::of(truth), &Sighting::new(mount, &seen));
    let sigma_m = 1e-3 * NOISE_MRAD * (plane.centre - mount.pivot).norm();
    let noise = random.normal_pair();
    seen.u_m = landing.residual_m[0] + sigma_m * noise[0];
    seen.v_m = landing.residual_m[1] + sigma_m * noise[1];
    seen.sigma_m = Some(sigma_m);
    seen
}

/// Some observations of one day, six more on another: chosen by the plan, at random, evenly spaced.
#[test]
fn planned_observations_point_better_over_the_year_than_others() {
    const CASES: u64 = 200;
    const DRAWS: usize = 4;
    let site = site();
    let suns = year_suns(site.latitude_rad(), 0.15);
    let some: Vec<EnuUnit> = suns.iter().copied().step_by(7).collect();
    let modes = [
        TrackingMode::AzimuthElevation,
        TrackingMode::PitchRoll {
            axis_azimuth_rad: std::f64::consts::FRAC_PI_2,
        },
    ];
    // mean squares over all cases and draws: predicted so far, so far, planned, random, even
    let mut sums = [0.0; 3];
    let mut expected = [0.0; 2];
    let mut wins = [0; 2];
    let mut unfinished = 0;
    for case in 0..CASES {
        let mut random = Random::stream(31, case);
        let mount = Mount {
            axes: MountAxes::of(modes[random.below(2)], EnuUnit::UP),
            pivot: Enu::new(
                random.between(-120.0, 120.0),
                random.between(25.0, 240.0),
                1.7,
            ),
            mirror_offset_m: 0.175,
            pose_errors: PoseErrors::NONE,
        };
        let truth = Parameters::new(&ErrorSpread::default().draw(&mut random), 0.175);
        let day = 1_735_689_600_000_000_000 + DAY_NS * random.below(330) as i64;
        let campaign = SimulateOptions {
            seed: case,
            count: 8,
            from_unix_ns: day,
            to_unix_ns: day + DAY_NS,
            noise_mrad: NOISE_MRAD,
            min_sun_elevation_rad: 0.1,
            aiming: Aiming::Board {
                half_width_m: 3.0,
                half_height_m: 3.0,
            },
            ..SimulateOptions::default()
        };
        let so_far = simulate(&mount, &truth, &targets(), &site, &campaign)
            .unwrap()
            .observations;
        let options = FitOptions::default();
        let before = fit(&mount, &so_far, &options).unwrap();
        unfinished += usize::from(!before.stop.converged());
        let next = day + 30 * DAY_NS;
        let offers = candidates(&site, next, next + DAY_NS, 900.0, 0.1, &targets()).unwrap();
        let duty = Duty {
            suns: &some,
            aim: AIM,
        };
        // As the fits below, which know nothing beforehand.
        let plan_options = PlanOptions {
            noise_mrad: NOISE_MRAD,
            prior_sigmas: [1.0, 1.0, 1.0, 1.0, 1.0, 1.0, 0.0],
            ..PlanOptions::default()
        };
        let proposals = plan(
            &mount,
            &before.parameters,
            &so_far,
            &offers,
            &duty,
            6,
            &plan_options,
        )
        .unwrap();
        assert_eq!(proposals.len(), 6);
        let planned: Vec<Candidate> = proposals
            .iter()
            .map(|p| {
                *offers
                    .iter()
                    .find(|c| c.unix_ns == p.unix_ns && c.target == p.target)
                    .unwrap()
            })
            .collect();
        let mut times: Vec<i64> = offers.iter().map(|c| c.unix_ns).collect();
        times.dedup();
        let mut own = [0.0; 3];
        for _ in 0..DRAWS {
            let mut shuffled = times.clone();
            random.shuffle(&mut shuffled);
            let mut at = |unix_ns: i64| {
                let target = random.below(3);
                *offers
                    .iter()
                    .find(|c| c.unix_ns == unix_ns && c.target == target)
                    .unwrap()
            };
            let drawn: Vec<Candidate> = shuffled[..6].iter().map(|&t| at(t)).collect();
            let even: Vec<Candidate> = (0..6)
                .map(|k| at(times[k * (times.len() - 1) / 5]))
                .collect();
            let noise = random.next_u64();
            for (k, chosen) in [&planned, &drawn, &even].into_iter().enumerate() {
                let mut random = Random::new(noise);
                let mut all = so_far.clone();
                all.extend(
                    chosen
                        .iter()
                        .map(|c| look(&mount, &truth, &before.parameters, c, &mut random)),
                );
                let after = fit(&mount, &all, &options).unwrap();
                unfinished += usize::from(!after.stop.converged());
                let error = year_error_mrad(&mount, &truth, &after.parameters, &some);
                own[k] += error * error / DRAWS as f64;
            }
        }
        for k in 0..3 {
            sums[k] += own[k] / CASES as f64;
        }
        let last = proposals[5].expected_year_pointing_mrad_after;
        expected[0] += proposals[0].expected_year_pointing_mrad_before.powi(2) / CASES as f64;
        expected[1] += last * last / CASES as f64;
        wins[0] += usize::from(own[0] < own[1]);
        wins[1] += usize::from(own[0] < own[2]);
    }
    let [planned, drawn, even] = sums.map(f64::sqrt);
    println!(
        "year pointing error, RMS of {CASES} cases: planned {planned:.3} mrad (predicted {:.3}, before {:.3}), \
         random {drawn:.3}, evenly spaced {even:.3}; planned better than random in {}, than evenly spaced in {}; \
         fits that stopped early: {unfinished}",
        expected[1].sqrt(),
        expected[0].sqrt(),
        wins[0],
        wins[1]
    );
    assert!(planned < drawn && planned < even);
    assert!(2 * wins[0] > CASES as usize && 2 * wins[1] > CASES as usize);
    // The prediction is of the truth: 200 cases know an RMS to about 1/sqrt(2 · 200 · few) of it.
    assert!((planned / expected[1].sqrt() - 1.0).abs() < 0.15);
}

/// The plan's number is that of the fit's covariance.
#[test]
fn what_is_expected_is_what_the_covariance_says() {
    let site = site();
    let suns: Vec<EnuUnit> = year_suns(site.latitude_rad(), 0.15);
    let mount = Mount {
        axes: MountAxes::of(TrackingMode::AzimuthElevation, EnuUnit::UP),
        pivot: Enu::new(40.0, 120.0, 1.7),
        mirror_offset_m: 0.175,
        pose_errors: PoseErrors::NONE,
    };
    let errors = MountErrors {
        pedestal_tilt_rad: 0.004,
        azimuth_reference_rad: 0.01,
        ..MountErrors::default()
    };
    let truth = Parameters::new(&errors, 0.175);
    let campaign = SimulateOptions {
        count: 12,
        noise_mrad: NOISE_MRAD,
        ..SimulateOptions::default()
    };
    let seen = simulate(&mount, &truth, &targets(), &site, &campaign).unwrap();
    // Nothing known before, as good as.
    let plan_options = PlanOptions {
        noise_mrad: NOISE_MRAD,
        prior_sigmas: [30.0, 30.0, 30.0, 30.0, 30.0, 30.0, 0.0],
        ..PlanOptions::default()
    };
    let options = FitOptions::default();
    let fitted = fit(&mount, &seen.observations, &options).unwrap();
    let known = uncertainty(&mount, &seen.observations, &fitted, &options).unwrap();
    // The fit estimates the noise; the plan takes the stated one.
    let mut covariance = known.covariance;
    for value in covariance.iter_mut().flatten() {
        *value /= known.sigma * known.sigma;
    }
    let squares = suns.iter().map(|&sun| {
        pointing_sigma_mrad(&mount, &fitted.parameters, &covariance, sun, AIM)
            .unwrap()
            .powi(2)
    });
    let from_covariance = (squares.sum::<f64>() / suns.len() as f64).sqrt();
    let duty = Duty {
        suns: &suns,
        aim: AIM,
    };
    let expected = expected_pointing_mrad(
        &mount,
        &fitted.parameters,
        &seen.observations,
        &duty,
        &plan_options,
    )
    .unwrap();
    assert!(
        (expected / from_covariance - 1.0).abs() < 1e-4,
        "{expected} {from_covariance}"
    );
}
