//! How much light comes to a receiver's back: against areas known by hand, and against rays.

#![allow(clippy::unwrap_used, reason = "tests fail loudly")]

mod common;

use common::*;
use helio_flux::{
    Element, Frustum, MeshReceiver, OpticalError, Plane, RayOptions, Receiver, Scene, SunShape,
    lit_from_behind_w, trace_rays,
};

const UP: [f64; 3] = [0.0, 0.0, 1.0];

/// A square of 1 m² on the ground that sends a sun in the zenith straight back up.
fn mirror(x: f64) -> Element {
    rectangle([x, 0.0, 0.0], [0.5, 0.0, 0.0], [0.0, 0.5, 0.0])
        .with_reflectivity(0.9)
        .unwrap()
}

fn found_w(elements: &[Element], receiver: &Receiver) -> (f64, f64) {
    let scene = Scene {
        elements,
        receiver,
        sun: UP,
        dni_w_m2: 1000.0,
        sun_shape: &SunShape::pillbox(1e-4).unwrap(),
        optical_error: OpticalError::NONE,
    };
    let received_w = trace_rays(&scene, &RayOptions::default()).unwrap();
    (
        lit_from_behind_w(&scene).unwrap(),
        received_w.account().received_w,
    )
}

fn plane(facing: [f64; 3], width_m: f64) -> Receiver {
    let size_m = [width_m, 2.0];
    Receiver::Plane(Plane::new([0.0, 0.0, 5.0], facing, [1.0, 0.0, 0.0], size_m, [4, 4]).unwrap())
}

#[test]
fn a_plane_takes_light_on_one_side() {
    let down = [0.0, 0.0, -1.0];
    let (behind_w, received_w) = found_w(&[mirror(0.0)], &plane(down, 2.0));
    assert_eq!(behind_w, 0.0);
    assert!((received_w - 900.0).abs() < 1e-6);
    let (behind_w, received_w) = found_w(&[mirror(0.0)], &plane(UP, 2.0));
    assert!((behind_w - 900.0).abs() < 1e-9, "{behind_w}");
    assert_eq!(received_w, 0.0);
    // half of the mirror lies under it, and of two mirrors the other beside it
    let (behind_w, _) = found_w(&[mirror(0.0), mirror(3.0)], &plane(UP, 0.5));
    assert!((behind_w - 450.0).abs() < 1e-9, "{behind_w}");
    // a receiver below its mirrors, and the sun below all of them
    let below = Plane::new([0.0, 0.0, -5.0], UP, [1.0, 0.0, 0.0], [2.0; 2], [4, 4]).unwrap();
    assert_eq!(found_w(&[mirror(0.0)], &Receiver::Plane(below)), (0.0, 0.0));
}

#[test]
fn of_triangles_the_first_that_is_met_decides() {
    let triangle = |z: f64, turned: bool| {
        let [a, b, c] = [[-3.0, -3.0, z], [9.0, -3.0, z], [-3.0, 9.0, z]];
        // counterclockwise as seen from above, or from below
        if turned { [a, c, b] } else { [a, b, c] }
    };
    let receiver = |all: &[[[f64; 3]; 3]]| Receiver::Mesh(MeshReceiver::new(all).unwrap());
    let w = |all: &[[[f64; 3]; 3]]| found_w(&[mirror(0.0)], &receiver(all)).0;
    assert_eq!(w(&[triangle(5.0, true)]), 0.0);
    assert!((w(&[triangle(5.0, false)]) - 900.0).abs() < 1e-9);
    // the back of a far side is not reached, that of a near one is
    assert_eq!(w(&[triangle(5.0, true), triangle(6.0, false)]), 0.0);
    assert!((w(&[triangle(6.0, true), triangle(5.0, false)]) - 900.0).abs() < 1e-9);
}

#[test]
fn a_cylinder_is_lit_from_behind_through_its_end_only() {
    let cylinder = |base_m: [f64; 3], axis: [f64; 3]| {
        let across = [0.0, 1.0, 0.0];
        Receiver::Frustum(Frustum::cylinder(base_m, axis, across, 2.0, 4.0, [4, 8]).unwrap())
    };
    // across the light: its near outside
    let (behind_w, received_w) =
        found_w(&[mirror(0.0)], &cylinder([-2.0, 0.0, 9.0], [1.0, 0.0, 0.0]));
    assert_eq!(behind_w, 0.0);
    assert!((received_w - 900.0).abs() < 1e-6);
    // slanting, so that all of the light goes in at the open end and meets the inside
    let (behind_w, received_w) =
        found_w(&[mirror(0.0)], &cylinder([0.0, 0.0, 9.0], [1.0, 0.0, 1.0]));
    assert!((behind_w - 900.0).abs() < 1e-9, "{behind_w} {received_w}");
}
