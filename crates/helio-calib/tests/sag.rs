//! Mounts that sag under gravity: every way from encoders to spots and back knows it.

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
use helio_core::{Sag, TrackingMode};

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

fn kappa(rng: &mut Rng, most: f64) -> Sag {
    Sag {
        axis1_rad: rng.within(most),
        axis2_rad: rng.within(most),
    }
}

/// Encoder angles of the tests' own formula land their spots: predicted less observed is rounding.
#[test]
fn spots_of_sagging_mounts_are_where_they_were_seen() {
    let (mut worst, mut count) = (0.0_f64, 0);
    let mut rng = Rng::new(7);
    for mode in modes() {
        for _ in 0..500 {
            let mut at = place(&mut rng, mode);
            at.mount.sag = kappa(&mut rng, Sag::MAX_RAD);
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

/// A known sag costs the fit nothing; one that is not known leaves the spots off.
#[test]
fn a_known_sag_is_taken_out_by_every_fit() {
    let mut rng = Rng::new(11);
    let mut seen = Vec::new();
    for mode in modes() {
        for row in 0..10 {
            let mut at = place(&mut rng, mode);
            // some of the lanes have none
            if row % 3 != 0 {
                at.mount.sag = kappa(&mut rng, 0.02);
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
        stiff.sag = Sag::NONE;
        let (_, left) = measures(&stiff, records, &want);
        let sags = at
            .mount
            .sag
            .axis1_rad
            .abs()
            .max(at.mount.sag.axis2_rad.abs());
        assert_eq!(left.beam_rms_mrad > 1e-6, sags > 1e-8, "{left:?}");
    }
}

/// The slopes by the sag lead a joint step to it from none at all.
#[test]
fn sag_slopes_find_the_sag_from_none() {
    let mut rng = Rng::new(13);
    let mode = TrackingMode::PitchRoll {
        axis_azimuth_rad: std::f64::consts::FRAC_PI_2,
    };
    for _ in 0..20 {
        let mut at = place(&mut rng, mode);
        at.mount.sag = kappa(&mut rng, 0.01);
        let truth = errors(&mut rng);
        let records = campaign(&mut rng, &at, &truth, 30, 0.0);
        let known = parameters(&at.mount, &truth);
        let mut sag = [0.0; 2];
        // Gauss-Newton in two unknowns, the angles being known
        for _ in 0..5 {
            let pose = Pose::of(&known).with_sag(sag);
            let (mut a, mut b) = ([[0.0; 2]; 2], [0.0; 2]);
            for record in &records {
                let land = landing(&pose, &Sighting::new(&at.mount, record));
                for (slopes, residual) in land.sag_slopes.iter().zip(land.residual_m) {
                    for i in 0..2 {
                        b[i] -= slopes[i] * residual;
                        for k in 0..2 {
                            a[i][k] += slopes[i] * slopes[k];
                        }
                    }
                }
            }
            let det = a[0][0] * a[1][1] - a[0][1] * a[1][0];
            sag[0] += (a[1][1] * b[0] - a[0][1] * b[1]) / det;
            sag[1] += (a[0][0] * b[1] - a[1][0] * b[0]) / det;
        }
        let want = at.mount.sag;
        assert!((sag[0] - want.axis1_rad).abs() < 1e-11, "{sag:?} {want:?}");
        assert!((sag[1] - want.axis2_rad).abs() < 1e-11, "{sag:?} {want:?}");
    }
}

/// A simulated campaign of a mount that sags: its spots are the truth's, and the fit that knows the sag finds
/// the errors.
#[test]
fn simulated_campaigns_sag() {
    let mut rng = Rng::new(17);
    let site = SunSite::new(radians(37.0), radians(-6.0), 20.0).unwrap();
    let mode = TrackingMode::PitchRoll {
        axis_azimuth_rad: std::f64::consts::FRAC_PI_2,
    };
    let mut at = place(&mut rng, mode);
    at.mount.sag.axis2_rad = 0.0036;
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
        stiff.sag = Sag::NONE;
        let (_, all) = measures(&stiff, &got.observations, &known);
        assert!(all.beam_rms_mrad > 0.2, "{all:?}");
    }
}
