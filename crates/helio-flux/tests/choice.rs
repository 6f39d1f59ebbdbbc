//! The way that is chosen by an error, and the error that is stated, against maps of many rays.

#![allow(
    clippy::unwrap_used,
    clippy::print_stdout,
    reason = "tests fail and talk"
)]

mod common;

use common::*;
use helio_flux::{
    ConvolveOptions, Element, FluxError, FluxMap, Frustum, OpticalError, RayOptions, Rays,
    Receiver, Scene, SunShape, Way, Why, choose_way, convolve, peak_error, trace_rays,
};

fn scene<'a>(
    elements: &'a [Element],
    receiver: &'a Receiver,
    sun_shape: &'a SunShape,
) -> Scene<'a> {
    Scene {
        elements,
        receiver,
        sun: [0.02, 0.01, 1.0],
        dni_w_m2: 1000.0,
        sun_shape,
        optical_error: OpticalError::new(1e-3, 3e-4).unwrap(),
    }
}

fn traced(scene: &Scene<'_>, rays: u64, seed: u64) -> FluxMap {
    let options = RayOptions {
        rays: Rays::Total(rays),
        seed,
        ..RayOptions::default()
    };
    trace_rays(scene, &options).unwrap()
}

fn taken(scene: &Scene<'_>, way: Way, seed: u64) -> FluxMap {
    match way {
        Way::Rays(rays) => traced(scene, rays, seed),
        Way::Convolution(points) => {
            let options = ConvolveOptions {
                points,
                ..ConvolveOptions::default()
            };
            convolve(scene, &options).unwrap()
        }
        _ => panic!("{way:?}"),
    }
}

/// A level patchwork of mirrors side by side, all of one mirror so that nothing is in the way.
fn patches(side: usize) -> Vec<Element> {
    let size = 2.0 / side as f64;
    (0..side * side)
        .map(|k| {
            let at = |k: usize| (k as f64 + 0.5) * size - 1.0;
            let half = 0.5 * size;
            let centre = [at(k % side), at(k / side), 0.0];
            rectangle(centre, [half, 0.0, 0.0], [0.0, half, 0.0])
        })
        .collect()
}

fn receivers() -> [Receiver; 2] {
    let (base, axis) = ([-8.0, -3.0, 100.0], [1.0, 0.4, 0.1]);
    let round = Frustum::cylinder(base, axis, [0.0, 0.0, -1.0], 3.0, 12.0, [24, 48]);
    [screen(48), Receiver::Frustum(round.unwrap())]
}

// The map's own peak bin against the mean of ten times as many rays: on the whole no farther off than is stated.
#[test]
fn stated_errors_hold() {
    let sun_shape = SunShape::limb_darkened(4.65e-3).unwrap();
    for receiver in &receivers() {
        for elements in [patches(1), patches(60)] {
            let scene = scene(&elements, receiver, &sun_shape);
            let many: Vec<FluxMap> = (100..108)
                .map(|seed| traced(&scene, 1 << 23, seed))
                .collect();
            for goal in [0.02, 0.005] {
                let choice = choose_way(&scene, goal, 3, 0).unwrap();
                let mut squares = 0.0;
                let mut stated = 0.0_f64;
                for seed in 0..6 {
                    let map = taken(&scene, choice.way, seed);
                    let error = peak_error(&scene, &map).unwrap().unwrap();
                    stated = stated.max(error);
                    assert!(error <= 1.05 * goal, "{error} {goal} {choice:?}");
                    let (flux, bin) = map.peak();
                    // at a bin that is not picked for its scatter
                    let bin = if map.account().rays > 0 {
                        many[0].peak().1
                    } else {
                        bin
                    };
                    let got = map.irradiance_w_m2()[bin];
                    let sum: f64 = many.iter().map(|m| m.irradiance_w_m2()[bin]).sum();
                    squares += (got / (sum / 8.0) - 1.0).powi(2);
                    assert!(flux >= got);
                }
                let off = (squares / 6.0_f64).sqrt();
                println!(
                    "{} elements, {goal}: {choice:?}, stated {stated:.2e}, off {off:.2e}",
                    elements.len()
                );
                // the many rays have a scatter of their own
                assert!(off < 1.5 * stated + 1e-3, "{off} {stated}");
            }
        }
    }
}

#[test]
fn few_mirrors_are_convolved_and_many_traced() {
    let sun_shape = SunShape::pillbox(4.65e-3).unwrap();
    let receiver = screen(64);
    let one = patches(1);
    let choice = choose_way(&scene(&one, &receiver, &sun_shape), 0.005, 0, 1).unwrap();
    assert_eq!(choice.way, Way::Convolution(2));
    assert!(choice.why.to_string().starts_with("rays would take about"));
    let many = patches(150);
    let choice = choose_way(&scene(&many, &receiver, &sun_shape), 0.005, 0, 1).unwrap();
    assert!(matches!(choice.way, Way::Rays(_)), "{choice:?}");
    // and the closer, the more
    let Way::Rays(few) = choice.way else { panic!() };
    let closer = choose_way(&scene(&many, &receiver, &sun_shape), 0.002, 0, 1).unwrap();
    if let Way::Rays(more) = closer.way {
        assert!(more > 3 * few);
    }
    assert_eq!(
        choice,
        choose_way(&scene(&many, &receiver, &sun_shape), 0.005, 0, 2).unwrap()
    );
}

#[test]
fn mirrors_in_each_others_light_are_traced() {
    let sun_shape = SunShape::pillbox(4.65e-3).unwrap();
    let receiver = screen(32);
    let elements = [
        rectangle([0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]),
        rectangle([0.5, 0.0, 3.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]).with_mirror(1),
    ];
    let choice = choose_way(&scene(&elements, &receiver, &sun_shape), 0.01, 0, 0).unwrap();
    assert!(
        matches!(choice.why, Why::Occlusion(part) if part > 0.2),
        "{choice:?}"
    );
    assert!(matches!(choice.way, Way::Rays(_)));
}

#[test]
fn errors_out_of_reach_are_refused_and_the_dark_has_none() {
    let sun_shape = SunShape::pillbox(4.65e-3).unwrap();
    let receiver = screen(8);
    let elements = patches(1);
    let lit = scene(&elements, &receiver, &sun_shape);
    for error in [0.0, 1e-4, 0.6, f64::NAN] {
        let refused = choose_way(&lit, error, 0, 0);
        assert!(matches!(
            refused,
            Err(FluxError::BadValue { what: "error", .. })
        ));
    }
    let dark = Scene {
        dni_w_m2: 0.0,
        ..lit
    };
    let choice = choose_way(&dark, 0.01, 0, 0).unwrap();
    let map = taken(&dark, choice.way, 0);
    assert_eq!(peak_error(&dark, &map).unwrap(), None);
}
