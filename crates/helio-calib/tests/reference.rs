//! The 24 campaigns of `tests/reference/calibration.json` (its `source` says where they come from), from zero
//! start, with both solvers and both forms of the residual.

#![allow(
    clippy::unwrap_used,
    clippy::print_stdout,
    reason = "tests fail and talk"
)]

use helio_calib::{
    Fit, FitOptions, Mount, Observation, Parameters, ResidualForm, Solver, Start, Stop, fit,
};
use helio_core::angle::{radians, wrap_pi};
use helio_core::{Enu, EnuUnit, MountAxes, MountErrors, PoseErrors, TargetPlane, TrackingMode};
use serde_json::Value;

struct Case {
    mount: Mount,
    observations: Vec<Observation>,
    noise_mrad: f64,
    truth: MountErrors,
    best: MountErrors,
    best_sum_m2: f64,
}

fn number(value: &Value, key: &str) -> f64 {
    value[key].as_f64().unwrap_or_else(|| panic!("no {key}"))
}

/// The file writes north, east, up.
fn vector(value: &Value) -> Enu {
    let [north, east, up] = [0, 1, 2].map(|k| value[k].as_f64().expect("three numbers"));
    Enu::new(east, north, up)
}

fn errors(deg: &Value) -> MountErrors {
    let angle = |key| radians(number(deg, key));
    MountErrors {
        pedestal_tilt_rad: angle("psi_t"),
        pedestal_tilt_azimuth_rad: angle("psi_a"),
        axis_nonorthogonality_rad: angle("tau1"),
        mirror_tilt_rad: angle("mu"),
        azimuth_reference_rad: angle("gamma0"),
        elevation_reference_rad: angle("alpha0"),
    }
}

fn cases() -> Vec<Case> {
    let path = concat!(
        env!("CARGO_MANIFEST_DIR"),
        "/../../tests/reference/calibration.json"
    );
    let text = std::fs::read_to_string(path).expect(path);
    let file: Value = serde_json::from_str(&text).expect("JSON");
    let list = file["cases"].as_array().expect("cases");
    assert_eq!(list.len(), 24);
    list.iter()
        .map(|case| {
            let unit = |key: &str| EnuUnit::try_new(vector(&case[key])).expect(key);
            let plane = TargetPlane {
                centre: vector(&case["target_centre_neu_m"]),
                normal: unit("target_normal_neu"),
                right: unit("target_right_neu"),
                down: unit("target_down_neu"),
            };
            let observations = case["observations"].as_array().expect("observations");
            Case {
                mount: Mount {
                    axes: MountAxes::of(TrackingMode::AzimuthElevation, EnuUnit::UP),
                    pivot: Enu::default(),
                    mirror_offset_m: number(case, "mirror_offset_m"),
                    pose_errors: PoseErrors::NONE,
                },
                observations: observations
                    .iter()
                    .map(|o| {
                        let angle = |key| radians(number(o, key));
                        Observation::new(
                            EnuUnit::from_azimuth_elevation(
                                angle("sun_azimuth_deg"),
                                angle("sun_elevation_deg"),
                            ),
                            angle("azimuth_deg"),
                            angle("elevation_deg"),
                            plane,
                            number(o, "u_m"),
                            number(o, "v_m"),
                        )
                    })
                    .collect(),
                noise_mrad: number(case, "noise_mrad_per_axis"),
                truth: errors(&case["true_deg"]),
                best: errors(&case["best_fit"]["deg"]),
                best_sum_m2: number(&case["best_fit"], "sum_squares_m2"),
            }
        })
        .collect()
}

/// Largest difference, the tilt by its components \[rad\].
fn difference(found: &Parameters, wanted: &MountErrors) -> f64 {
    let wanted = Parameters::new(wanted, 0.0);
    (0..6)
        .map(|k| wrap_pi(found.values[k] - wanted.values[k]).abs())
        .fold(0.0, f64::max)
}

fn reaches(case: &Case, found: &Fit) -> bool {
    let allowed = case.best_sum_m2 * (1.0 + 1e-9) + case.observations.len() as f64 * 1e-20;
    found.sum_of_squares <= allowed
}

#[test]
fn components_reach_every_optimum_from_zero() {
    for solver in [Solver::HartleyMeyer, Solver::GaussNewton] {
        for start in [Start::Zeros, Start::Cold] {
            let mut most = 0;
            for (number, case) in cases().iter().enumerate() {
                let options = FitOptions {
                    solver,
                    start,
                    ..FitOptions::default()
                };
                let found = fit(&case.mount, &case.observations, &options).unwrap();
                let what = format!("case {number}, {solver:?}, {start:?}: {found:?}");
                assert!(found.stop.converged(), "{what}");
                assert!(reaches(case, &found), "{what}, not {}", case.best_sum_m2);
                let limit = radians(1e-6);
                let off = difference(&found.parameters, &case.best);
                assert!(off < limit, "{what}: {off} rad from the best fit");
                if case.noise_mrad == 0.0 {
                    let off = difference(&found.parameters, &case.truth);
                    assert!(off < limit, "{what}: {off} rad from the truth");
                }
                most = most.max(found.iterations);
            }
            println!("components, {solver:?} from {start:?}: at most {most} iterations");
        }
    }
}

#[test]
fn distances_reach_every_optimum_of_eight_or_more() {
    for solver in [Solver::HartleyMeyer, Solver::GaussNewton] {
        for start in [Start::Zeros, Start::Cold] {
            for (number, case) in cases().iter().enumerate() {
                let options = FitOptions {
                    solver,
                    start,
                    residual: ResidualForm::Distance,
                    max_iterations: 300,
                    ..FitOptions::default()
                };
                let found = fit(&case.mount, &case.observations, &options).unwrap();
                let records = case.observations.len();
                println!(
                    "case {number}, M {records}, noise {}, {solver:?} {start:?}: {} after {}, S/S_opt - 1 = {:.1e}",
                    case.noise_mrad,
                    found.stop.as_str(),
                    found.iterations,
                    found.sum_of_squares / case.best_sum_m2 - 1.0
                );
                if records >= 8 {
                    assert!(reaches(case, &found), "case {number}: {found:?}");
                    if case.noise_mrad == 0.0 {
                        let off = difference(&found.parameters, &case.truth);
                        assert!(off < radians(1e-6), "case {number}: {off} rad");
                    }
                } else {
                    assert_ne!(found.stop, Stop::NoLanding, "case {number}");
                }
            }
        }
    }
}
