//! Shading and blocking against areas of shadows known in closed form.

#![allow(
    clippy::unwrap_used,
    clippy::print_stdout,
    reason = "tests fail and talk"
)]

mod common;

use common::*;
use helio_core::SimdLevel;
use helio_flux::{
    Account, Element, Frustum, OpticalError, RayOptions, Rays, Receiver, Scene, SunShape,
    trace_rays,
};

fn trace(
    elements: &[Element],
    receiver: &Receiver,
    sun: V,
    half_angle: f64,
    options: &RayOptions,
) -> Account {
    let scene = Scene {
        elements,
        receiver,
        sun,
        dni_w_m2: 1000.0,
        sun_shape: &SunShape::pillbox(half_angle).unwrap(),
        optical_error: OpticalError::NONE,
    };
    let account = *trace_rays(&scene, options).unwrap().account();
    assert!(
        account.unaccounted_w().abs() <= 1e-15 * account.incoming_w,
        "{account:?}"
    );
    account
}

fn rays(rays: u64) -> RayOptions {
    RayOptions {
        rays: Rays::PerElement(rays),
        ..RayOptions::default()
    }
}

/// A square of 2 m on the ground, mirror 0, of reflectivity 0.9.
fn ground() -> Element {
    rectangle([0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0])
        .with_reflectivity(0.9)
        .unwrap()
}

/// A square of 2 m that looks down, cut into n x n pieces: mirror 1.
fn lid(centre: V, n: usize) -> Vec<Element> {
    let mut pieces = Vec::new();
    for k in 0..n * n {
        let at = |k: usize| 2.0 * (k as f64 + 0.5) / n as f64 - 1.0;
        let middle = combine(centre, 1.0, [at(k % n), at(k / n), 0.0]);
        let half = 1.0 / n as f64;
        pieces.push(rectangle(middle, [0.0, half, 0.0], [half, 0.0, 0.0]).with_mirror(1));
    }
    pieces
}

// The lid's shadow, moved by the slanting sun, covers a part of the square known by plain geometry; of the rest
// a part is reflected into the lid, on the other side.
#[test]
fn shadow_and_block_of_a_lid_are_rectangles() {
    let receiver = screen(16);
    for (shift, slant) in [
        (1.0, 0.0),
        (1.4, 0.1),
        (-0.7, 0.05),
        (0.3, -0.2),
        (3.5, 0.1),
    ] {
        // 5 m up: the shadow moves by -5 slant, reflected light meets the lid +5 slant further on
        let sun = [slant, 0.0, 1.0];
        let overlap = |a: f64, b: f64| (2.0_f64.min(2.0 - (a - b).abs())).max(0.0);
        let shadow = overlap(shift - 5.0 * slant, 0.0);
        // the lid seen backwards along the reflected light: at shift + 5 slant; less where it is shaded anyway
        let interval = |middle: f64| ((middle - 1.0).max(-1.0), (middle + 1.0).min(1.0));
        let (s, b) = (interval(shift - 5.0 * slant), interval(shift + 5.0 * slant));
        let both = (s.1.min(b.1) - s.0.max(b.0)).max(0.0);
        let block = overlap(shift + 5.0 * slant, 0.0) - if shadow > 0.0 { both } else { 0.0 };
        let cosine = 1.0 / (1.0 + slant * slant).sqrt();
        for pieces in [1, 12] {
            let mut elements = vec![ground()];
            elements.extend(lid([shift, 0.0, 5.0], pieces));
            let account = trace(&elements, &receiver, sun, 1e-7, &rays(1 << 18));
            assert_eq!(account.turned_away, pieces * pieces);
            let (shaded, blocked) = (account.shaded_w / cosine, account.blocked_w / cosine);
            println!("{shift} {slant} {pieces}: shaded {shaded:.1}, blocked {blocked:.1} W");
            // two of width 2 m; a net of 2^18 rays has the area of a rectangle to 2^-16
            assert!(
                (shaded - 2000.0 * shadow).abs() < 1.0,
                "{}",
                2000.0 * shadow
            );
            assert!(
                (blocked - 0.9 * 2000.0 * block).abs() < 1.0,
                "{}",
                1800.0 * block
            );
        }
    }
}

// The sun's disc blurs the edge of a shadow; what is in it stays the same. And pieces of one mirror, or the option,
// leave the light alone.
#[test]
fn a_blurred_shadow_holds_as_much() {
    let receiver = screen(16);
    let mut elements = vec![ground()];
    elements.extend(lid([0.6, 0.0, 30.0], 1));
    let account = trace(
        &elements,
        &receiver,
        [0.0, 0.0, 1.0],
        9.3e-3,
        &rays(1 << 18),
    );
    // half the shadow's edge blurs outward past nothing: the square goes on to -1
    assert!(
        (account.shaded_w - 1000.0 * 2.0 * 1.4).abs() < 300.0,
        "{account:?}"
    );
    let narrow = trace(&elements, &receiver, [0.0, 0.0, 1.0], 1e-6, &rays(1 << 18));
    assert!((narrow.shaded_w - 2800.0).abs() < 1.0);
    assert!(
        account.shaded_w < narrow.shaded_w - 50.0,
        "light comes round the sides"
    );
    let off = RayOptions {
        occlusion: false,
        ..rays(1 << 12)
    };
    assert_eq!(
        trace(&elements, &receiver, [0.0, 0.0, 1.0], 1e-6, &off).shaded_w,
        0.0
    );
    let one: Vec<_> = elements.iter().map(|e| e.with_mirror(7)).collect();
    assert_eq!(
        trace(&one, &receiver, [0.0, 0.0, 1.0], 1e-6, &rays(1 << 12)).shaded_w,
        0.0
    );
}

// In lanes, by the tree, at every instruction set and on every receiver: the same verdicts, and those of a tracer
// of the tests' own.
#[test]
fn all_ways_agree_with_brute_force() {
    let sun = unit([0.3, 0.2, 1.0]);
    let cylinder = Frustum::cylinder(
        [0.0, 8.0, 18.0],
        [1.0, 0.0, 0.0],
        [0.0, 0.0, 1.0],
        3.0,
        6.0,
        [8, 16],
    );
    let to = unit([3.0, 8.0, 18.0]);
    let n = unit(combine(to, 1.0, sun));
    let a = unit(cross([0.0, 1.0, 0.0], n));
    let b = cross(n, a);
    let mirror = rectangle([0.0; 3], a.map(|x| 1.5 * x), b);
    // a post in the reflected light and a plate toward the sun
    let obstacles = [
        rectangle(to.map(|x| 6.0 * x), [0.3, 0.0, 0.1], [0.0, 0.2, 0.9]).with_mirror(1),
        Element::triangle([
            combine(sun.map(|x| 4.0 * x), 1.0, [-0.8, -0.5, 0.2]),
            combine(sun.map(|x| 4.0 * x), 1.0, [0.9, -0.6, 0.0]),
            combine(sun.map(|x| 4.0 * x), 1.0, [0.0, 1.1, 0.0]),
        ])
        .unwrap()
        .with_mirror(2),
    ];
    let half_angle = 0.02;
    // inside, by angles: the sum of the angles that its corners make is a full turn
    let covered = |o: V, d: V| {
        obstacles.map(|obstacle| {
            let c = obstacle.corners_m();
            let n = cross(combine(c[1], -1.0, c[0]), combine(c[2], -1.0, c[0]));
            let t = dot(n, combine(c[0], -1.0, o)) / dot(n, d);
            let p = combine(o, t, d);
            let turn: f64 = (0..c.len())
                .map(|k| {
                    let (u, v) = (
                        combine(c[k], -1.0, p),
                        combine(c[(k + 1) % c.len()], -1.0, p),
                    );
                    dot(cross(u, v), unit(n)).atan2(dot(u, v))
                })
                .sum();
            t > 0.0 && turn.abs() > 3.0
        })
    };
    let brute = BruteForce {
        sun,
        half_angle,
        slope: 0.0,
        specularity: 0.0,
    };
    let count = 400_000;
    let corner = combine(a.map(|x| -1.5 * x), -1.0, b);
    let place = [corner, a.map(|x| 3.0 * x), b.map(|x| 2.0 * x)];
    // 0 free, 1 blocked, 2 shaded; the sun's ray is the reflected one, mirrored
    let verdict = |o: V, d: V| {
        let back = combine(d.map(|x| -x), 2.0 * dot(d, n), n);
        let (toward, away) = (covered(o, back), covered(o, d));
        Some(if toward[0] || toward[1] {
            2
        } else {
            usize::from(away[0] || away[1])
        })
    };
    let (counts, _) = brute.trace(place, count, 3, verdict, &mut Pcg(4));
    let power = 6000.0 * dot(n, sun);
    let scale = power / count as f64;
    println!("brute force: {counts:?}");
    assert!(counts.iter().all(|&c| c > 5000), "{counts:?}");
    for receiver in [screen(20), Receiver::Frustum(cylinder.unwrap())] {
        let mut elements = vec![mirror];
        elements.extend(obstacles);
        // their own light is none of this test's
        let black: Vec<_> = obstacles
            .iter()
            .map(|e| e.corners_m().iter().rev().copied().collect::<Vec<_>>())
            .collect();
        assert_eq!(black.len(), 2);
        let scene_of = |elements: &[Element], options: &RayOptions| {
            trace(elements, &receiver, sun, half_angle, options)
        };
        let alone = |account: Account, rest: Account| {
            (
                account.shaded_w - rest.shaded_w,
                account.blocked_w - rest.blocked_w,
            )
        };
        let rest = scene_of(&elements[1..], &rays(1 << 19));
        let got = alone(scene_of(&elements, &rays(1 << 19)), rest);
        println!("{got:?}, others {:?}", (rest.shaded_w, rest.blocked_w));
        let error = |c: u64| 4.0 * (c as f64).sqrt() * scale + 1e-3 * power;
        assert!(
            (got.0 - counts[2] as f64 * scale).abs() < error(counts[2]),
            "{got:?}"
        );
        assert!(
            (got.1 - counts[1] as f64 * scale).abs() < error(counts[1]),
            "{got:?}"
        );
        // the obstacles cut up: more pieces than lanes are tried for
        let mut fine = vec![mirror];
        for obstacle in &obstacles {
            fine.extend(cut(obstacle, 7));
        }
        assert!(fine.len() > 90);
        let by_tree = alone(
            scene_of(&fine, &rays(1 << 19)),
            scene_of(&fine[1..], &rays(1 << 19)),
        );
        assert!(
            (got.0 - by_tree.0).abs() < 2e-4 * power,
            "{got:?} {by_tree:?}"
        );
        assert!(
            (got.1 - by_tree.1).abs() < 2e-4 * power,
            "{got:?} {by_tree:?}"
        );
        for &level in SimdLevel::available() {
            let options = RayOptions {
                level: Some(level),
                ..rays(1 << 14)
            };
            assert_eq!(
                scene_of(&elements, &options),
                scene_of(&elements, &rays(1 << 14)),
                "{level}"
            );
        }
    }
}

/// An element in n² triangles, or twice as many.
fn cut(element: &Element, n: usize) -> Vec<Element> {
    let corners = element.corners_m();
    let mut pieces = Vec::new();
    for fan in 1..corners.len() - 1 {
        let (o, p, q) = (corners[0], corners[fan], corners[fan + 1]);
        let (p, q) = (combine(p, -1.0, o), combine(q, -1.0, o));
        let at = |i: usize, j: usize| {
            combine(combine(o, i as f64 / n as f64, p), j as f64 / n as f64, q)
        };
        for i in 0..n {
            for j in 0..n - i {
                pieces.push([at(i, j), at(i + 1, j), at(i, j + 1)]);
                if i + j + 1 < n {
                    pieces.push([at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)]);
                }
            }
        }
    }
    let piece = |c| Element::triangle(c).unwrap().with_mirror(element.mirror());
    pieces.into_iter().map(piece).collect()
}
