//! Heliostats of fields as mirrors.

#![allow(
    clippy::unwrap_used,
    clippy::print_stdout,
    reason = "tests fail and talk"
)]

mod common;

use common::*;
use helio_core::layout::{Measures, radial_staggered};
use helio_core::{Enu, EnuUnit, Field, Heliostat, MountErrors, Status, TrackingMode};
use helio_flux::{
    Canting, ConvolveOptions, Frustum, HeliostatMirror, OpticalError, Plane, RayOptions, Rays,
    Receiver, Scene, SunShape, convolve, field_mirrors, posed_mirrors, trace_rays,
};

fn sun() -> EnuUnit {
    EnuUnit::from_azimuth_elevation(3.5, 0.7)
}

fn vector(e: Enu) -> V {
    [e.east, e.north, e.up]
}

/// A board of 20 m that faces the field, 100 m up in the origin.
fn board(bins: usize) -> Receiver {
    let plane = Plane::new(
        [0.0, 0.0, 100.0],
        [0.0, 0.8, -0.6],
        [-1.0, 0.0, 0.0],
        [20.0, 20.0],
        [bins, bins],
    );
    Receiver::Plane(plane.unwrap())
}

// The light of each heliostat, however its mount errs (its angles take the errors into account), lands on its aim; in
// every mode; and the mirror is as large as it was made, its width level where the mount's moving axis is.
#[test]
fn the_light_of_each_heliostat_lands_on_its_aim() {
    let modes = [
        TrackingMode::AzimuthElevation,
        TrackingMode::SpinningElevation,
        TrackingMode::PitchRoll {
            axis_azimuth_rad: 1.57,
        },
        TrackingMode::Polar { latitude_rad: 0.65 },
    ];
    let receiver = board(200);
    for mode in modes {
        for (k, place) in [[30.0, 90.0], [-60.0, 150.0], [5.0, 210.0]]
            .into_iter()
            .enumerate()
        {
            let aim = [0.8 * k as f64 - 1.0, 0.3, 100.4 - 0.5 * k as f64];
            let aim = combine(
                aim,
                -dot(combine(aim, -1.0, [0.0, 0.0, 100.0]), [0.0, 0.8, -0.6]),
                [0.0, 0.8, -0.6],
            );
            let mut heliostat = Heliostat::new(
                Enu::new(place[0], place[1], 4.0),
                Enu::new(aim[0], aim[1], aim[2]),
            );
            heliostat.mirror_offset_m = 0.3;
            heliostat.errors = MountErrors {
                pedestal_tilt_rad: 0.004,
                mirror_tilt_rad: 0.003,
                ..MountErrors::default()
            };
            let mut field = Field::new(mode);
            field.push("A", heliostat).unwrap();
            let mirror = HeliostatMirror {
                width_m: 4.0,
                height_m: 3.0,
                columns: 2,
                rows: 2,
                gap_m: 0.1,
                canting: Canting::ToAim,
                ..HeliostatMirror::default()
            };
            let mirrors = field_mirrors(&field, sun(), &mirror).unwrap();
            assert_eq!(
                (mirrors.elements.len(), &mirrors.status[..]),
                (4, &[Status::Ok][..])
            );
            let area: f64 = mirrors.elements.iter().map(|e| e.area_m2()).sum();
            // facets of 1.95 m by 1.45 m; canting makes them longer by its square
            assert!((area / (4.0 * 1.95 * 1.45) - 1.0).abs() < 1e-4, "{area}");
            if mode == TrackingMode::AzimuthElevation {
                let corners = mirrors.elements[0].corners_m();
                let edge = combine(corners[1], -1.0, corners[0]);
                // as level as the pedestal's lean of 4 mrad and the canting, 1 m in 200, leave it
                assert!(edge[2].abs() < 0.009 * 1.95, "{edge:?}");
            }
            let scene = Scene {
                elements: &mirrors.elements,
                receiver: &receiver,
                sun: vector(sun().as_enu()),
                dni_w_m2: 900.0,
                sun_shape: &SunShape::pillbox(4.65e-3).unwrap(),
                optical_error: OpticalError::NONE,
            };
            let map = trace_rays(
                &scene,
                &RayOptions {
                    rays: Rays::Total(1 << 20),
                    ..RayOptions::default()
                },
            )
            .unwrap();
            assert!(map.account().spilled_w < 1e-9);
            let Receiver::Plane(plane) = &receiver else {
                unreachable!()
            };
            let [right, down] = centroid_m(&map, [20.0, 20.0]);
            let at = combine(
                combine([0.0, 0.0, 100.0], right, plane.right()),
                down,
                plane.down(),
            );
            let miss = combine(at, -1.0, aim);
            let miss = dot(miss, miss).sqrt();
            println!("{mode:?} {k}: {:.1} mm", 1e3 * miss);
            // an oblique board sees the near side of a cone smaller: a thousandth of a spot of a metre or two
            assert!(miss < 0.003, "{mode:?} {k}: {miss}");
        }
    }
}

fn field(count: usize) -> Field {
    let measures = Measures {
        count,
        tower_height_m: 100.0,
        mirror_width_m: 11.0,
        mirror_height_m: 10.0,
        up_m: 5.5,
    };
    let mut field = Field::new(TrackingMode::AzimuthElevation);
    for (k, pivot) in radial_staggered(&measures).into_iter().enumerate() {
        field
            .push(
                &k.to_string(),
                Heliostat::new(pivot, Enu::new(0.0, 0.0, 100.0)),
            )
            .unwrap();
    }
    field
}

#[test]
fn a_field_lights_a_cylinder_and_the_account_closes() {
    let field = field(300);
    let mirror = HeliostatMirror {
        width_m: 11.0,
        height_m: 10.0,
        columns: 2,
        rows: 2,
        canting: Canting::ToAim,
        reflectivity: 0.88,
        ..HeliostatMirror::default()
    };
    let mirrors = field_mirrors(&field, sun(), &mirror).unwrap();
    assert_eq!(mirrors.elements.len(), 1200);
    let cylinder = Frustum::cylinder(
        [0.0, 0.0, 92.0],
        [0.0, 0.0, 1.0],
        [0.0, 1.0, 0.0],
        5.0,
        16.0,
        [20, 36],
    )
    .unwrap();
    let receiver = Receiver::Frustum(cylinder);
    let error = OpticalError::new(1.0e-3, 0.5e-3).unwrap();
    let scene = Scene {
        elements: &mirrors.elements,
        receiver: &receiver,
        sun: vector(sun().as_enu()),
        dni_w_m2: 900.0,
        sun_shape: &SunShape::limb_darkened(4.65e-3).unwrap(),
        optical_error: error,
    };
    let options = RayOptions {
        rays: Rays::Total(2_000_000),
        ..RayOptions::default()
    };
    let map = trace_rays(&scene, &options).unwrap();
    let a = map.account();
    println!("{a:?}");
    assert!(a.unaccounted_w().abs() <= 1e-15 * a.incoming_w);
    // low sun: mirrors shade, and hardly block, which is what the layout is for
    assert!(a.shaded_w > 0.001 * a.incoming_w && a.blocked_w < 0.03 * a.incoming_w);
    assert!(a.received_w > 0.6 * a.incoming_w);
    let free = trace_rays(
        &scene,
        &RayOptions {
            occlusion: false,
            ..options
        },
    )
    .unwrap();
    let integral = convolve(&scene, &ConvolveOptions::default()).unwrap();
    let apart = relative_rms(free.irradiance_w_m2(), integral.irradiance_w_m2());
    println!("rays and convolution {apart:.2e}");
    assert!(apart < 0.015, "{apart}");
    assert!((free.account().received_w / integral.account().received_w - 1.0).abs() < 5e-3);
}

#[test]
fn rows_without_an_answer_keep_their_place() {
    let field = field(3);
    let mirror = HeliostatMirror::default();
    let below = EnuUnit::from_azimuth_elevation(1.0, -0.1);
    let dark = field_mirrors(&field, below, &mirror).unwrap();
    assert_eq!(
        (dark.elements.len(), dark.status),
        (0, vec![Status::SunBelowHorizon; 3])
    );
    let nan = f64::NAN;
    let some = posed_mirrors(&field, &[0.1, nan, 0.2], &[0.5, 0.5, 0.5], &mirror).unwrap();
    assert_eq!(some.status, [Status::Ok, Status::Unreachable, Status::Ok]);
    assert_eq!(
        some.elements.iter().map(|e| e.mirror()).collect::<Vec<_>>(),
        [0, 2]
    );
    // azimuth 0.1, elevation 0.5
    let want = EnuUnit::from_azimuth_elevation(0.1, 0.5).as_enu();
    assert!(dot(some.elements[0].normal(), vector(want)) > 1.0 - 1e-14);
    assert!(posed_mirrors(&field, &[0.1], &[0.5], &mirror).is_err());
    for (bad, text) in [
        (
            HeliostatMirror {
                width_m: 0.0,
                ..mirror
            },
            "width_m must be above 0",
        ),
        (
            HeliostatMirror {
                gap_m: 7.0,
                columns: 2,
                ..mirror
            },
            "gap_m must be at least 0 m, and leave room",
        ),
        (
            HeliostatMirror {
                pieces: 0,
                ..mirror
            },
            "pieces must be within 1..=1000",
        ),
        (
            HeliostatMirror {
                canting: Canting::FocalLength(-1.0),
                ..mirror
            },
            "focal length must be above 0 m",
        ),
        (
            HeliostatMirror {
                reflectivity: 1.5,
                ..mirror
            },
            "reflectivity must be within 0..=1",
        ),
    ] {
        let said = field_mirrors(&field, sun(), &bad).unwrap_err().to_string();
        assert!(said.contains(text), "{said}");
    }
}
