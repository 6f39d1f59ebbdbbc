//! Integrals over bins that are coarser than what falls on them: power is neither made nor lost.

#![allow(clippy::unwrap_used, reason = "tests fail")]

mod common;

use common::scene;
use helio_flux::{
    ConvolveOptions, Element, FluxError, FluxMap, Frustum, MeshReceiver, Plane, RayOptions, Rays,
    Receiver, Scene, SunShape, convolve, trace_rays,
};

const DOWN: [f64; 3] = [0.0, 0.0, -1.0];

/// A level mirror with its corner at a place.
fn facet(x: f64, y: f64, width: f64, height: f64) -> Element {
    let corners = [
        [x, y],
        [x + width, y],
        [x + width, y + height],
        [x, y + height],
    ];
    Element::quadrilateral(corners.map(|[x, y]| [x, y, 0.0])).unwrap()
}

/// Eight strips cut into slices, as a mesh has them.
fn slices() -> Vec<Element> {
    (0..8 * 35)
        .map(|k| {
            let (strip, slice) = (f64::from(k % 8), f64::from(k / 8));
            facet(0.02 * strip - 0.08, 0.005 * slice - 0.0875, 0.015, 0.005)
        })
        .collect()
}

fn by_points(scene: &Scene<'_>, points: usize) -> FluxMap {
    let options = ConvolveOptions {
        points,
        ..ConvolveOptions::default()
    };
    convolve(scene, &options).unwrap()
}

/// All of the light falls on the receiver: nothing is spilled, and no watt is made.
fn assert_all_received(map: &FluxMap) {
    let account = map.account();
    let off = account.received_w / account.incoming_w - 1.0;
    assert!(off.abs() < 1e-3, "{account:?}");
    assert!(account.spilled_w >= 0.0, "{account:?}");
}

#[test]
fn coarse_bins_neither_make_nor_lose_power() {
    let sun = SunShape::pillbox(4.65e-3).unwrap();
    let two = [facet(0.0, 0.0, 1.0, 1.0), facet(1.0, 0.0, 1.0, 1.0)];
    let slices = slices();
    for points in [1, 2, 3] {
        let wide =
            |bins| Plane::new([0.5, 0.5, 10.0], DOWN, [1.0, 0.0, 0.0], [40.0, 40.0], bins).unwrap();
        for bins in [[3, 3], [1, 1], [2, 7]] {
            let receiver = Receiver::Plane(wide(bins));
            assert_all_received(&by_points(&scene(&two, &receiver, &sun), points));
        }
        let plane = Plane::new([0.0, 0.0, 1.0], DOWN, [1.0, 0.0, 0.0], [1.0, 1.0], [10, 10]);
        let receiver = Receiver::Plane(plane.unwrap());
        assert_all_received(&by_points(&scene(&slices, &receiver, &sun), points));
        let (a, b, c, d) = (
            [-9.0, -9.0, 10.0],
            [9.0, -9.0, 10.0],
            [9.0, 9.0, 10.0],
            [-9.0, 9.0, 10.0],
        );
        let mesh = MeshReceiver::new(&[[a, c, b], [a, d, c]]).unwrap();
        let receiver = Receiver::Mesh(mesh);
        assert_all_received(&by_points(&scene(&two, &receiver, &sun), points));
    }
}

// Bin by bin against rays, which know nothing of points: on a plane whose bins cut the image, all round a
// cylinder with four columns, and on cones whose bins are much wider below than above, one of them pointed,
// and on a cylinder that stands along the beam.
#[test]
fn coarse_bins_hold_what_rays_bring() {
    let sun = SunShape::limb_darkened(4.65e-3).unwrap();
    let slices = slices();
    let plane = Plane::new([0.03, 0.01, 1.0], DOWN, [1.0, 0.0, 0.0], [0.4, 0.3], [3, 4]);
    let around = Frustum::cylinder(
        [-1.0, 0.0, 3.0],
        [1.0, 0.0, 0.0],
        [0.0, 0.0, -1.0],
        0.05,
        2.0,
        [2, 4],
    );
    let nearly_up = [0.004, 0.0, 1.0];
    let side = [1.0, 0.0, 0.0];
    let grazed = Frustum::cylinder([-0.02, 0.0, 1.0], nearly_up, side, 0.05, 1.0, [3, 6]);
    let cone = |radii_m: [f64; 2], grid: [usize; 2]| {
        let along = [1.0, 0.0, 0.0];
        let cone = Frustum::cone([-0.4, 0.0, 1.5], along, DOWN, radii_m, 0.8, grid);
        Receiver::Frustum(cone.unwrap())
    };
    for receiver in [
        Receiver::Plane(plane.unwrap()),
        Receiver::Frustum(around.unwrap()),
        cone([0.02, 0.15], [3, 4]),
        cone([0.15, 0.0], [2, 8]),
        Receiver::Frustum(grazed.unwrap()),
    ] {
        let scene = scene(&slices, &receiver, &sun);
        let rays = RayOptions {
            rays: Rays::Total(1 << 25),
            ..RayOptions::default()
        };
        let traced = trace_rays(&scene, &rays).unwrap();
        let integral = by_points(&scene, 1);
        assert!(traced.account().received_w > 0.05);
        let (mut apart_w, all_w) = (0.0, traced.account().received_w);
        for (bin, (a, b)) in traced
            .irradiance_w_m2()
            .iter()
            .zip(integral.irradiance_w_m2())
            .enumerate()
        {
            apart_w += (a - b).abs() * receiver.bin_area_m2(bin);
        }
        assert!(apart_w < 3e-3 * all_w, "{apart_w} of {all_w}");
        let one_thread = ConvolveOptions {
            points: 1,
            threads: 1,
            ..ConvolveOptions::default()
        };
        assert!(convolve(&scene, &one_thread).unwrap() == integral);
    }
}

// A disc of 2 µm on a grid that its image covers: what one point more or less of a bin would lose is shared out.
#[test]
fn images_with_sharp_edges_keep_their_power() {
    let sun = SunShape::pillbox(1e-6).unwrap();
    let elements = [facet(0.013, 0.021, 1.0, 0.7)];
    for bins in [[1, 1], [3, 4], [7, 5], [64, 64]] {
        let plane = Plane::new([0.5, 0.5, 10.0], DOWN, [1.0, 0.0, 0.0], [2.0, 2.0], bins).unwrap();
        let receiver = Receiver::Plane(plane);
        let scene = scene(&elements, &receiver, &sun);
        let options = ConvolveOptions {
            tolerance: 0.02,
            ..ConvolveOptions::default()
        };
        let map = convolve(&scene, &options).unwrap();
        assert!((map.account().received_w / 700.0 - 1.0).abs() < 1e-9);
        // each bin: what it has in common with the mirror, which the light does not blur
        let overlap = |k: usize, count: usize, from: f64, to: f64| {
            let [low, high] = [k, k + 1].map(|k| -0.5 + 2.0 * k as f64 / count as f64);
            (high.min(to) - low.max(from)).max(0.0)
        };
        for (bin, flux) in map.irradiance_w_m2().iter().enumerate() {
            // rows run along y, columns along x
            let (row, column) = (bin / bins[1], bin % bins[1]);
            let want = 1000.0
                * overlap(column, bins[1], 0.013, 1.013)
                * overlap(row, bins[0], 0.021, 0.721);
            let got = flux * receiver.bin_area_m2(bin);
            assert!(
                (got - want).abs() < 0.02 * 700.0,
                "{bins:?} {bin}: {got} {want}"
            );
        }
    }
}

#[test]
fn what_cannot_be_settled_is_refused() {
    // a parallel beam on a grid of hairs
    let sun = SunShape::pillbox(1e-6).unwrap();
    let elements = [facet(0.0, 0.0, 1.0, 1.0)];
    let (at, right, size) = ([0.5, 0.5, 1.0], [0.8, 0.6, 0.0], [2.0, 2.0]);
    let plane = Plane::new(at, DOWN, right, size, [300, 300]).unwrap();
    let receiver = Receiver::Plane(plane);
    let scene = scene(&elements, &receiver, &sun);
    let fine = ConvolveOptions {
        tolerance: 1e-6,
        ..ConvolveOptions::default()
    };
    let refused = convolve(&scene, &fine);
    assert!(
        matches!(refused, Err(FluxError::NotSettled { element: 0, .. })),
        "{refused:?}"
    );
    for tolerance in [0.0, -1.0, f64::NAN, 2.0] {
        let options = ConvolveOptions {
            tolerance,
            ..ConvolveOptions::default()
        };
        let refused = convolve(&scene, &options);
        assert!(matches!(
            refused,
            Err(FluxError::BadValue {
                what: "tolerance",
                ..
            })
        ));
    }
}

// One pane behind another: an integral would light both.
#[test]
fn a_receiver_in_its_own_light_is_refused() {
    let sun = SunShape::pillbox(4.65e-3).unwrap();
    let elements = [facet(-0.5, -0.5, 1.0, 1.0)];
    let pane = |up: f64| [[-2.0, -2.0, up], [0.0, 3.0, up], [2.0, -2.0, up]];
    let mesh = MeshReceiver::new(&[pane(10.0), pane(11.0)]).unwrap();
    let receiver = Receiver::Mesh(mesh);
    let refused = convolve(
        &scene(&elements, &receiver, &sun),
        &ConvolveOptions::default(),
    );
    let hidden = FluxError::HiddenBin { bin: 1, by: 0 };
    assert_eq!(refused, Err(hidden));
}
