//! Mounts that sag and whose encoders are off centre: every way from encoders to spots and back knows it.

#![allow(
    clippy::unwrap_used,
    clippy::print_stdout,
    reason = "tests fail and talk"
)]

mod common;

use common::{Rng, campaign, errors, observe, parameters, place, sun};
use helio_calib::aiming::encoder_angles_rad;
use helio_calib::model::{Pose, landing};
use helio_calib::simulate::Aiming;
use helio_calib::{
    Campaign, FieldFitOptions, FitOptions, Sighting, SimulateOptions, Start, fit, fit_field,
    measures, simulate,
};
use helio_core::angle::{radians, wrap_pi};
use helio_core::sun::SunSite;
use helio_core::{PoseErrors, TrackingMode};

fn modes() -> [TrackingMode; 4] {
    [
        TrackingMode::AzimuthElevation,
        TrackingMode::SpinningElevation,
        TrackingMode::PitchRoll {
            axis_azimuth_rad: std::f64::consts::FRAC_PI_2,
        },
        TrackingMode::Polar { latitude_rad: 0.65 },
    ]
}

fn some(rng: &mut Rng, most: f64) -> PoseErrors {
    PoseErrors::from_array([0; 3].map(|_| rng.within(most)))
}

/// Encoder angles of the tests' own formula land their spots: predicted less observed is rounding.
#[test]
fn spots_are_where_they_were_seen() {
    let (mut worst, mut count) = (0.0_f64, 0);
    let mut rng = Rng::new(7);
    for mode in modes() {
        for _ in 0..500 {
            let mut at = place(&mut rng, mode);
            at.mount.pose_errors = some(&mut rng, PoseErrors::MAX_RAD);
            let truth = errors(&mut rng);
            let to = [rng.within(1.0), rng.within(1.0)];
            let Some(seen) = observe(&at.mount, &truth, &at.plane, sun(&mut rng), to) else {
                continue;
            };
            let known = parameters(&at.mount, &truth);
            let land = landing(&Pose::of(&known), &Sighting::new(&at.mount, &seen));
            if !land.hits() || land.facing > -0.1 {
                continue;
            }
            let slant_m = (at.plane.centre - at.mount.pivot).norm();
            worst = land
                .residual_m
                .iter()
                .fold(worst, |w, r| w.max(r.abs() / slant_m));
            // and back: the angles that send the beam there
            let aim = at.plane.point(to[0], to[1]);
            let [axis1, axis2] = encoder_angles_rad(&at.mount, &known, seen.sun, aim).unwrap();
            let level = (seen.axis2_rad - truth.elevation_reference_rad).cos();
            worst = worst
                .max((wrap_pi(axis1 - seen.axis1_rad) * level).abs())
                .max(wrap_pi(axis2 - seen.axis2_rad).abs());
            count += 1;
        }
    }
    println!("{count} spots within {worst:e} of the slant");
    assert!(count > 1500 && worst < 1e-12, "{count} {worst:e}");
}

/// Known pose errors cost the fit nothing; those that are not known leave the spots off.
#[test]
fn known_pose_errors_are_taken_out_by_every_fit() {
    let mut rng = Rng::new(11);
    let mut seen = Vec::new();
    for mode in modes() {
        for row in 0..10 {
            let mut at = place(&mut rng, mode);
            // some of the lanes have none
            if row % 3 != 0 {
                at.mount.pose_errors = some(&mut rng, 0.02);
            }
            let truth = errors(&mut rng);
            let records = campaign(&mut rng, &at, &truth, 40, 0.0);
            seen.push((at, truth, records));
        }
    }
    let campaigns: Vec<Campaign<'_>> = seen
        .iter()
        .map(|(at, _, records)| Campaign {
            mount: at.mount,
            observations: records,
        })
        .collect();
    let fits = fit_field(&campaigns, &FieldFitOptions::default());
    for ((at, truth, records), of_field) in seen.iter().zip(fits) {
        let want = parameters(&at.mount, truth).canonical();
        let single = fit(&at.mount, records, &FitOptions::default()).unwrap();
        for found in [single.parameters, of_field.unwrap().parameters] {
            for (k, want) in want.values.iter().enumerate() {
                let off = wrap_pi(found.values[k] - want).abs();
                assert!(off < 1e-8, "{k}: {off:e} {:?}", at.mount);
            }
        }
        let mut stiff = at.mount;
        stiff.pose_errors = PoseErrors::NONE;
        let (_, left) = measures(&stiff, records, &want);
        let any = !at.mount.pose_errors.is_none();
        assert_eq!(left.beam_rms_mrad > 1e-6, any, "{left:?}");
    }
}

/// The slopes by the pose errors lead a joint step to them from none at all.
#[test]
fn pose_slopes_find_the_errors_from_none() {
    let mut rng = Rng::new(13);
    let mut worst = 0.0_f64;
    let mode = TrackingMode::PitchRoll {
        axis_azimuth_rad: std::f64::consts::FRAC_PI_2,
    };
    for _ in 0..20 {
        let mut at = place(&mut rng, mode);
        at.mount.pose_errors = some(&mut rng, 0.01);
        let truth = errors(&mut rng);
        let records = campaign(&mut rng, &at, &truth, 30, 0.0);
        let known = parameters(&at.mount, &truth);
        let mut found = [0.0; 3];
        // Gauss-Newton in three unknowns, the angles being known
        for _ in 0..5 {
            let pose = Pose::of(&known).with_pose_errors(found);
            // normal equations, with their right side as the last column
            let mut rows = [[0.0; 4]; 3];
            for record in &records {
                let land = landing(&pose, &Sighting::new(&at.mount, record));
                for (slopes, residual) in land.pose_slopes.iter().zip(land.residual_m) {
                    for (row, slope) in rows.iter_mut().zip(slopes) {
                        for k in 0..3 {
                            row[k] += slope * slopes[k];
                        }
                        row[3] -= slope * residual;
                    }
                }
            }
            for k in 0..3 {
                let pivot = rows[k].map(|value| value / rows[k][k]);
                for row in &mut rows {
                    let factor = row[k];
                    for (value, of) in row.iter_mut().zip(pivot) {
                        *value -= factor * of;
                    }
                }
                rows[k] = pivot;
            }
            for (value, row) in found.iter_mut().zip(rows) {
                *value += row[3];
            }
        }
        let want = at.mount.pose_errors.to_array();
        for (found, want) in found.iter().zip(want) {
            worst = worst.max((found - want).abs());
        }
    }
    println!("found within {worst:e} rad");
    assert!(worst < 1e-11);
}

/// A simulated campaign of a mount with pose errors: its spots are the truth's, and the fit that knows them finds
/// the rest.
#[test]
fn simulated_campaigns_have_the_mounts_pose_errors() {
    let mut rng = Rng::new(17);
    let site = SunSite::new(radians(37.0), radians(-6.0), 20.0).unwrap();
    let mode = TrackingMode::PitchRoll {
        axis_azimuth_rad: std::f64::consts::FRAC_PI_2,
    };
    let mut at = place(&mut rng, mode);
    at.mount.pose_errors = PoseErrors {
        axis1_sag_rad: 0.0,
        axis2_sag_rad: 0.0036,
        axis2_eccentricity_rad: -0.0013,
    };
    let truth = helio_core::MountErrors {
        pedestal_tilt_rad: 0.003,
        mirror_tilt_rad: -0.002,
        ..helio_core::MountErrors::default()
    };
    let known = parameters(&at.mount, &truth);
    for aiming in [
        Aiming::Uncalibrated,
        Aiming::Board {
            half_width_m: 1.0,
            half_height_m: 1.0,
        },
    ] {
        let options = SimulateOptions {
            noise_mrad: 0.0,
            aiming,
            ..SimulateOptions::default()
        };
        let got = simulate(&at.mount, &known, &[at.plane], &site, &options).unwrap();
        let (_, all) = measures(&at.mount, &got.observations, &known);
        assert!(all.beam_rms_mrad < 1e-9, "{all:?}");
        let options = FitOptions {
            start: Start::Cold,
            ..FitOptions::default()
        };
        let found = fit(&at.mount, &got.observations, &options).unwrap();
        let want = known.canonical();
        for k in 0..6 {
            let off = wrap_pi(found.parameters.values[k] - want.values[k]).abs();
            assert!(off < 1e-7, "{k}: {off:e}");
        }
        let mut stiff = at.mount;
        stiff.pose_errors = PoseErrors::NONE;
        let (_, all) = measures(&stiff, &got.observations, &known);
        assert!(all.beam_rms_mrad > 0.2, "{all:?}");
    }
}
