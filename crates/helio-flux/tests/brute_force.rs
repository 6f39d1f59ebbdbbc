//! Rays against a tracer of the tests' own: random rays, one at a time, in doubles.

#![allow(
    clippy::unwrap_used,
    clippy::print_stdout,
    reason = "tests fail and talk"
)]

mod common;

use common::*;
use helio_flux::{
    Element, Frustum, MeshReceiver, OpticalError, Plane, RayOptions, Rays, Receiver, Scene,
    SunShape, trace_rays,
};

/// Greatest and root mean square difference of bins, in standard errors of the brute force.
fn compare(receiver: &Receiver, tilt: V, slope: f64, specularity: f64) {
    // A mirror of 7 m by 6 m, tilted, under an oblique sun, toward the receiver.
    let normal = unit(tilt);
    let edge_a = unit(cross([0.0, 1.0, 0.0], normal)).map(|x| 7.0 * x);
    let edge_b = cross(normal, edge_a.map(|x| x / 7.0)).map(|x| 6.0 * x);
    let corner = combine(combine([0.0; 3], -0.5, edge_a), -0.5, edge_b);
    let to_receiver = unit(combine(receiver.centre_m(), -1.0, [0.0; 3]));
    let sun = unit(combine(
        to_receiver.map(|x| -x),
        2.0 * dot(normal, to_receiver),
        normal,
    ));
    let other = |x: f64, y: f64| combine(combine(corner, x, edge_a), y, edge_b);
    let elements =
        [
            Element::quadrilateral([corner, other(1.0, 0.0), other(1.0, 1.0), other(0.0, 1.0)])
                .unwrap(),
        ];
    let half_angle = 4.65e-3;
    let scene = Scene {
        elements: &elements,
        receiver,
        sun,
        dni_w_m2: 1000.0,
        sun_shape: &SunShape::pillbox(half_angle).unwrap(),
        optical_error: OpticalError::new(slope, specularity).unwrap(),
    };
    let options = RayOptions {
        rays: Rays::Total(1 << 23),
        ..RayOptions::default()
    };
    let map = trace_rays(&scene, &options).unwrap();
    let power_w = 1000.0 * 42.0 * dot(normal, sun);
    assert!((map.account().incoming_w / power_w - 1.0).abs() < 1e-12);

    let brute = BruteForce {
        sun,
        half_angle,
        slope,
        specularity,
    };
    let rays = 2_000_000;
    let hit = |o: V, d: V| receiver.hit(o, d).map(|hit| hit.bin);
    let (counts, missed) = brute.trace(
        [corner, edge_a, edge_b],
        rays,
        receiver.bins(),
        hit,
        &mut Pcg(9),
    );
    let (mut squares, mut worst, mut bins) = (0.0, 0.0_f64, 0.0_f64);
    for (bin, &count) in counts.iter().enumerate() {
        let expected =
            map.irradiance_w_m2()[bin] * receiver.bin_area_m2(bin) / power_w * rays as f64;
        if expected < 50.0 {
            continue;
        }
        let deviation = (count as f64 - expected) / expected.sqrt();
        squares += deviation * deviation;
        worst = worst.max(deviation.abs());
        bins += 1.0;
    }
    let rms = (squares / bins).sqrt();
    println!(
        "{bins} bins: rms {rms:.3}, worst {worst:.2} standard errors; missed {missed} of {rays}"
    );
    // The counts' own scatter is 1 (binomial: a little less); five standard errors of a root mean square
    // allow for the net's own error, and 5 sigma once in 1.7 million.
    assert!(
        bins > 100.0 && (rms - 1.0).abs() < 5.0 / (2.0 * bins).sqrt() + 0.02,
        "{rms}"
    );
    assert!(worst < 5.0, "{worst}");
    let spilled = map.account().spilled_w / power_w * rays as f64;
    assert!(
        (missed as f64 - spilled).abs() < 5.0 * spilled.sqrt() + 5.0,
        "{missed} {spilled}"
    );
}

fn wall(tilt: V, bins: usize) -> Receiver {
    Receiver::Plane(
        Plane::new(
            [20.0, -30.0, 90.0],
            tilt,
            [1.0, 0.2, 0.0],
            [12.0, 14.0],
            [bins, bins],
        )
        .unwrap(),
    )
}

#[test]
fn an_oblique_facet_onto_an_oblique_plane() {
    compare(&wall([-0.1, 0.6, -0.7], 24), [0.5, 0.2, 1.0], 0.0, 0.0);
}

#[test]
fn with_slopes_and_scatter() {
    compare(&wall([-0.1, 0.6, -0.7], 24), [0.5, 0.2, 1.0], 2.0e-3, 0.0);
    compare(
        &wall([0.0, 0.3, -1.0], 24),
        [-0.4, -0.8, 1.0],
        1.5e-3,
        1.0e-3,
    );
}

#[test]
fn onto_a_cylinder_and_a_cone() {
    let (base, up, zero) = ([20.0, -30.0, 84.0], [0.0, 0.1, 1.0], [1.0, 0.0, 0.0]);
    let cylinder = Frustum::cylinder(base, up, zero, 4.0, 9.0, [16, 48]).unwrap();
    compare(&Receiver::Frustum(cylinder), [0.5, 0.2, 1.0], 1.0e-3, 0.0);
    let cone = Frustum::cone(base, up, zero, [5.0, 2.0], 9.0, [16, 48]).unwrap();
    compare(&Receiver::Frustum(cone), [-0.3, 0.2, 1.0], 0.0, 0.0);
}

// The same rays onto a plane, and onto the same plane cut into triangles.
#[test]
fn a_mesh_of_a_plane_is_that_plane() {
    let plane = Plane::new(
        [20.0, -30.0, 90.0],
        [-0.1, 0.6, -0.7],
        [1.0, 0.2, 0.0],
        [12.0, 14.0],
        [16, 16],
    )
    .unwrap();
    let mut triangles = Vec::new();
    for row in 0..16 {
        for column in 0..16 {
            let p = |r: usize, c: usize| plane.point_m((row + r) as f64, (column + c) as f64);
            // counterclockwise as the light sees them
            triangles.push([p(0, 0), p(1, 0), p(1, 1)]);
            triangles.push([p(0, 0), p(1, 1), p(0, 1)]);
        }
    }
    let mesh = Receiver::Mesh(MeshReceiver::new(&triangles).unwrap());
    assert!(dot(mesh.bin_normal(0), plane.normal()) > 0.999_999);
    assert!((mesh.area_m2() / plane.area_m2() - 1.0).abs() < 1e-12);
    compare(&mesh, [0.5, 0.2, 1.0], 1.0e-3, 0.0);
    let elements = [rectangle([0.0; 3], [3.0, 0.0, 0.0], [0.0, 2.0, 1.0])];
    let to = unit(plane.centre_m());
    let n = elements[0].normal();
    let scene = Scene {
        elements: &elements,
        receiver: &mesh,
        sun: combine(to.map(|x| -x), 2.0 * dot(n, to), n),
        dni_w_m2: 1000.0,
        sun_shape: &SunShape::pillbox(4.65e-3).unwrap(),
        optical_error: OpticalError::NONE,
    };
    let options = RayOptions {
        rays: Rays::Total(200_000),
        ..RayOptions::default()
    };
    let by_triangles = trace_rays(&scene, &options).unwrap();
    let flat = Receiver::Plane(plane.clone());
    let by_plane = trace_rays(
        &Scene {
            receiver: &flat,
            ..scene
        },
        &options,
    )
    .unwrap();
    let weight_w = by_plane.account().incoming_w / by_plane.account().rays as f64;
    for bin in 0..256 {
        let power = by_plane.irradiance_w_m2()[bin] * plane.bin_area_m2();
        let sum: f64 = (0..2)
            .map(|k| by_triangles.irradiance_w_m2()[2 * bin + k] * mesh.bin_area_m2(2 * bin + k))
            .sum();
        // rays on an edge, to the rounding of singles
        assert!((power - sum).abs() < 4.5 * weight_w, "{bin}: {power} {sum}");
    }
}
