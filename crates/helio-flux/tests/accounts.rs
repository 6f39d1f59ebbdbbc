//! Energy to the last ray, and the same bits whoever counts.

#![allow(
    clippy::unwrap_used,
    clippy::print_stdout,
    reason = "tests fail and talk"
)]

mod common;

use common::*;
use helio_core::SimdLevel;
use helio_flux::{
    Element, FluxError, FluxMap, OpticalError, RayOptions, Rays, Receiver, Scene, SunShape,
    trace_rays,
};
use proptest::prelude::*;

fn elements() -> Vec<Element> {
    let mut elements = Vec::new();
    for k in 0..40 {
        let (x, y) = (f64::from(k % 8) * 3.0 - 10.0, f64::from(k / 8) * 3.0 - 6.0);
        let lean = 0.01 * f64::from(k % 5) - 0.02;
        let mirror = rectangle([x, y, 0.0], [1.2, 0.0, lean], [0.1, 1.1, -lean]);
        elements.push(
            mirror
                .with_reflectivity(0.8 + 0.004 * f64::from(k))
                .unwrap()
                .with_mirror(k as u32),
        );
        let triangle = [
            [x, y + 20.0, 1.0],
            [x + 2.0, y + 20.0, 1.1],
            [x, y + 22.0, 0.9],
        ];
        elements.push(
            Element::triangle(triangle)
                .unwrap()
                .with_mirror(100 + k as u32),
        );
    }
    // one with its back to the sun, and one quadrilateral that is no parallelogram
    elements.push(rectangle(
        [0.0, 40.0, 0.0],
        [1.0, 0.0, 0.0],
        [0.0, -1.0, 0.0],
    ));
    let kite = [
        [30.0, 0.0, 0.0],
        [32.0, 0.0, 0.0],
        [33.0, 2.0, 0.1],
        [30.0, 1.0, 0.0],
    ];
    elements.push(Element::quadrilateral(kite).unwrap());
    elements
}

fn trace(receiver: &Receiver, sun: V, options: &RayOptions) -> FluxMap {
    let elements = elements();
    let scene = Scene {
        elements: &elements,
        receiver,
        sun,
        dni_w_m2: 913.0,
        sun_shape: &SunShape::buie(0.05).unwrap(),
        optical_error: OpticalError::new(1.0e-3, 0.3e-3).unwrap(),
    };
    trace_rays(&scene, options).unwrap()
}

fn receivers() -> Vec<Receiver> {
    use helio_flux::Frustum;
    let cone = Frustum::cone(
        [0.0, 0.0, 90.0],
        [0.0, 0.0, 1.0],
        [1.0, 0.0, 0.0],
        [3.0, 7.0],
        9.0,
        [9, 24],
    );
    vec![screen(32), Receiver::Frustum(cone.unwrap())]
}

fn bits(map: &FluxMap) -> Vec<u64> {
    let account = map.account();
    let parts = [
        account.received_w,
        account.spilled_w,
        account.reflection_loss_w,
        account.incoming_w,
    ];
    map.irradiance_w_m2()
        .iter()
        .chain(&parts)
        .map(|x| x.to_bits())
        .collect()
}

#[test]
fn threads_and_instruction_sets_change_no_bit() {
    for receiver in receivers() {
        let options = |threads, level| RayOptions {
            rays: Rays::Total(1_500_000),
            seed: 5,
            threads,
            level,
            ..RayOptions::default()
        };
        let sun = [0.03, 0.05, 1.0];
        let want = bits(&trace(&receiver, sun, &options(1, None)));
        for threads in [0, 2, 5] {
            assert!(
                want == bits(&trace(&receiver, sun, &options(threads, None))),
                "{threads} threads"
            );
        }
        for &level in SimdLevel::available() {
            assert!(
                want == bits(&trace(&receiver, sun, &options(2, Some(level)))),
                "{level}"
            );
        }
        let other = RayOptions {
            seed: 6,
            ..options(1, None)
        };
        assert!(
            want != bits(&trace(&receiver, sun, &other)),
            "the seed changes nothing"
        );
    }
}

#[test]
fn the_account_is_that_of_the_elements() {
    let sun = unit([0.03, 0.05, 1.0]);
    let (mut incoming, mut area, mut reflected) = (0.0, 0.0, 0.0);
    for element in elements() {
        let cosine = dot(element.normal(), sun);
        if cosine > 0.0 {
            incoming += 913.0 * element.area_m2() * cosine;
            reflected += 913.0 * element.area_m2() * cosine * element.reflectivity();
            area += 913.0 * element.area_m2();
        }
    }
    for receiver in receivers() {
        let map = trace(
            &receiver,
            sun,
            &RayOptions {
                rays: Rays::Total(300_000),
                ..RayOptions::default()
            },
        );
        let account = map.account();
        assert_eq!(account.turned_away, 1);
        assert!(
            account.rays >= 300_000 && account.rays < 303_000,
            "{}",
            account.rays
        );
        assert!((account.incoming_w / incoming - 1.0).abs() < 1e-13);
        assert!((account.mirror_w / area - 1.0).abs() < 1e-13);
        // weights are whole quanta: 2⁻³¹ of each ray's at most
        assert!(((account.received_w + account.spilled_w) / reflected - 1.0).abs() < 1e-9);
        assert!(account.received_w > 0.0 && account.spilled_w > 0.0);
        let sum: f64 = (0..receiver.bins())
            .map(|b| map.irradiance_w_m2()[b] * receiver.bin_area_m2(b))
            .sum();
        assert!((sum / account.received_w - 1.0).abs() < 1e-13);
    }
}

#[test]
fn wrong_calls_are_refused_by_name() {
    let (receiver, elements) = (screen(8), elements());
    let scene = Scene {
        elements: &elements,
        receiver: &receiver,
        sun: [0.0, 0.0, 1.0],
        dni_w_m2: 1000.0,
        sun_shape: &SunShape::pillbox(4.65e-3).unwrap(),
        optical_error: OpticalError::NONE,
    };
    let options = RayOptions::default();
    let said = |scene: &Scene<'_>, options: &RayOptions| {
        trace_rays(scene, options).unwrap_err().to_string()
    };
    let text = "scene: sun must be a finite vector with a length, got 0";
    assert_eq!(
        said(
            &Scene {
                sun: [0.0; 3],
                ..scene
            },
            &options
        ),
        text
    );
    let text = "scene: dni_w_m2 must be within 0..=1e6 W/m², got NaN";
    assert_eq!(
        said(
            &Scene {
                dni_w_m2: f64::NAN,
                ..scene
            },
            &options
        ),
        text
    );
    for rays in [
        Rays::Total(0),
        Rays::PerElement(0),
        Rays::PerElement(u64::MAX),
        Rays::PerElement(1 << 38),
    ] {
        let error = trace_rays(&scene, &RayOptions { rays, ..options }).unwrap_err();
        assert!(
            matches!(error, FluxError::BadValue { who: "rays", .. }),
            "{error}"
        );
    }
    // nothing to do is no error
    for nothing in [
        Scene {
            elements: &[],
            ..scene
        },
        Scene {
            dni_w_m2: 0.0,
            ..scene
        },
        Scene {
            sun: [0.0, 0.0, -1.0],
            ..scene
        },
    ] {
        let map = trace_rays(&nothing, &options).unwrap();
        assert!(map.irradiance_w_m2().iter().all(|&flux| flux == 0.0));
        assert_eq!(map.account().unaccounted_w(), 0.0);
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(16))]
    #[test]
    fn all_light_is_accounted_for(x in -1.0..1.0, y in -1.0..1.0, z in -0.2..1.0, seed: u64, rays in 1_u64..50_000) {
        prop_assume!(x * x + y * y + z * z > 0.01);
        for receiver in receivers() {
            let options = RayOptions { rays: Rays::Total(rays), seed, ..RayOptions::default() };
            let account = *trace(&receiver, [x, y, z], &options).account();
            // four sums, each rounded
            prop_assert!(account.unaccounted_w().abs() <= 1e-15 * account.incoming_w, "{:?}", account);
        }
    }
}
