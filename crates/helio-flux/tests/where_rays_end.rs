//! Rays end where they land: receivers that are long against their distance, with mirrors before and behind them.

#![allow(
    clippy::unwrap_used,
    clippy::print_stdout,
    reason = "tests fail and talk"
)]

mod common;

use common::*;
use helio_core::SimdLevel;
use helio_flux::{
    Account, Element, Frustum, MeshReceiver, OpticalError, Plane, RayOptions, Rays, Receiver,
    Scene, SunShape, trace_rays,
};

const SUN: V = [0.0, 0.3, 1.0];
const HALF_ANGLE: f64 = 4.65e-3;
const SLOPE: f64 = 2e-3;

/// A corner and two edges.
type Panel = [V; 3];

/// A panel about a middle, `width` along x, that sends the sun to a point.
fn panel(middle: V, width: f64, height: f64, to: V) -> Panel {
    let normal = unit(combine(unit(combine(to, -1.0, middle)), 1.0, unit(SUN)));
    let x = [1.0, 0.0, 0.0];
    let x = unit(combine(x, -dot(x, normal), normal));
    let (a, b) = (x.map(|k| width * k), cross(normal, x).map(|k| height * k));
    [combine(combine(middle, -0.5, a), -0.5, b), a, b]
}

/// A panel as n times n elements of a mirror.
fn cut(&[corner, a, b]: &Panel, n: usize, mirror: u32) -> Vec<Element> {
    let half = 0.5 / n as f64;
    let middle = |k: usize, along: V, from: V| combine(from, half * (2 * k + 1) as f64, along);
    (0..n * n)
        .map(|k| {
            let at = middle(k / n, b, middle(k % n, a, corner));
            rectangle(at, a.map(|x| half * x), b.map(|x| half * x)).with_mirror(mirror)
        })
        .collect()
}

fn elements(panels: &[Panel]) -> Vec<Element> {
    let numbered = panels.iter().zip(0..);
    numbered.flat_map(|(panel, k)| cut(panel, 1, k)).collect()
}

fn trace(elements: &[Element], receiver: &Receiver, slope: f64, options: &RayOptions) -> Account {
    let scene = Scene {
        elements,
        receiver,
        sun: SUN,
        dni_w_m2: 870.0,
        sun_shape: &SunShape::pillbox(HALF_ANGLE).unwrap(),
        optical_error: OpticalError::new(slope, 0.0).unwrap(),
    };
    let account = *trace_rays(&scene, options).unwrap().account();
    println!("{account:?}");
    account
}

fn options() -> RayOptions {
    RayOptions {
        rays: Rays::Total(1 << 20),
        ..RayOptions::default()
    }
}

/// Two mirrors, the second in the light of the first as it comes to the receiver, or behind where it lands.
fn before_and_behind() -> [Vec<Panel>; 2] {
    let at = |x: f64| [x, 0.0, 6.0];
    [
        vec![
            panel([10.0, -2.0, 0.0], 3.0, 2.0, at(18.0)),
            panel([12.0, -1.4, 3.0], 1.0, 1.0, at(20.0)),
        ],
        vec![
            panel([-15.0, -2.0, 0.0], 3.0, 2.0, at(-9.0)),
            panel([-7.0, 0.3, 9.0], 3.0, 3.0, at(-1.0)),
        ],
    ]
}

/// A rectangle of 40 m by 4 m that looks down, as a plane and in 80 triangles, with another triangle if wanted.
fn long_plane() -> Receiver {
    let (centre, down, right) = ([0.0, 0.0, 6.0], [0.0, 0.0, -1.0], [1.0, 0.0, 0.0]);
    Receiver::Plane(Plane::new(centre, down, right, [40.0, 4.0], [10, 100]).unwrap())
}

fn long_mesh(more: Option<[V; 3]>) -> Receiver {
    let corner = |i: i32, y: f64| [f64::from(i), y, 6.0];
    let mut triangles: Vec<_> = (-20..20)
        .flat_map(|i| {
            let [a, b] = [corner(i, -2.0), corner(i, 2.0)];
            let [c, d] = [corner(i + 1, 2.0), corner(i + 1, -2.0)];
            [[a, b, c], [a, c, d]]
        })
        .collect();
    triangles.extend(more);
    Receiver::Mesh(MeshReceiver::new(&triangles).unwrap())
}

// One plane, three descriptions. The third has a triangle out of all light that makes it no plane: rays that miss then
// end elsewhere, but what arrives is the same.
#[test]
fn a_plane_and_its_mesh_receive_the_same() {
    let aside = [[0.0, 30.0, 6.0], [1.0, 30.0, 6.0], [0.0, 30.0, 5.0]];
    for (panels, is_blocked) in before_and_behind().iter().zip([true, false]) {
        let elements = elements(panels);
        let on = |receiver: Receiver| trace(&elements, &receiver, 0.0, &options());
        let (plane, mesh) = (on(long_plane()), on(long_mesh(None)));
        assert!(plane.received_w > 3000.0, "{plane:?}");
        assert_eq!(plane.blocked_w > 100.0, is_blocked);
        let close = |a: f64, b: f64| (a - b).abs() < 1e-4 * plane.incoming_w;
        assert!(close(plane.received_w, mesh.received_w), "{mesh:?}");
        assert!(close(plane.blocked_w, mesh.blocked_w), "{mesh:?}");
        let bent = on(long_mesh(Some(aside)));
        assert!(close(plane.received_w, bent.received_w), "{bent:?}");
    }
}

/// How far along it a ray enters a tube about the x axis' parallel in a height of 6 m.
fn enters_tube(o: V, d: V, radius: f64, half_length: f64) -> Option<f64> {
    let (y, z) = (o[1], o[2] - 6.0);
    let a = d[1] * d[1] + d[2] * d[2];
    let b = y * d[1] + z * d[2];
    let c = y * y + z * z - radius * radius;
    let way = (-b - (b * b - a * c).sqrt()) / a;
    let inside = (o[0] + way * d[0]).abs() <= half_length;
    (way > 0.0 && inside).then_some(way)
}

fn meets(o: V, d: V, [corner, a, b]: Panel) -> Option<f64> {
    let normal = cross(a, b);
    let way = dot(normal, combine(corner, -1.0, o)) / dot(normal, d);
    let p = combine(combine(o, way, d), -1.0, corner);
    let inside = |edge: V| (0.0..=dot(edge, edge)).contains(&dot(p, edge));
    (way > 1e-9 && inside(a) && inside(b)).then_some(way)
}

const FATES: usize = 4;

/// Random rays that are received, spilled, blocked, shaded.
fn brute(panels: &[Panel], radius: f64, half_length: f64, rays: usize) -> [u64; FATES] {
    let mut random = Pcg(3);
    let mut fates = [0; FATES];
    let sun = unit(SUN);
    let aperture = |&[_, a, b]: &Panel| dot(cross(a, b), sun);
    let all: f64 = panels.iter().map(aperture).sum();
    let across = |axis: V| {
        let x = unit(cross([0.3, -0.5, 0.1], axis));
        [x, cross(axis, x)]
    };
    let [x, y] = across(sun);
    for _ in 0..rays {
        let mut left = random.uniform() * all;
        let mut k = 0;
        while k + 1 < panels.len() && left > aperture(&panels[k]) {
            left -= aperture(&panels[k]);
            k += 1;
        }
        let [corner, a, b] = panels[k];
        let (u, v) = (random.uniform(), random.uniform());
        let o = combine(combine(corner, u, a), v, b);
        let cos = 1.0 - random.uniform() * (1.0 - HALF_ANGLE.cos());
        let sin = (1.0 - cos * cos).sqrt();
        let (s, c) = (std::f64::consts::TAU * random.uniform()).sin_cos();
        let from = combine(combine(sun.map(|k| cos * k), sin * c, x), sin * s, y);
        let others = || panels.iter().enumerate().filter(|(j, _)| *j != k);
        if others().any(|(_, other)| meets(o, from, *other).is_some()) {
            fates[3] += 1;
            continue;
        }
        let normal = unit(cross(a, b));
        let [n_x, n_y] = across(normal);
        let [gx, gy] = random.normal().map(|g| SLOPE * g);
        let turned = unit(combine(combine(normal, gx, n_x), gy, n_y));
        let d = combine(from.map(|k| -k), 2.0 * dot(from, turned), turned);
        // past the tube: a plane square to the middle ray, behind the tube's ends
        let middle = combine(sun.map(|k| -k), 2.0 * dot(sun, normal), normal);
        let behind = half_length * middle[0].abs() + radius * middle[1].hypot(middle[2]);
        let to_centre = dot(middle, combine([0.0, 0.0, 6.0], -1.0, o));
        let hit = enters_tube(o, d, radius, half_length);
        let end = hit.unwrap_or((to_centre + behind) / dot(middle, d));
        let cut = |way: Option<f64>| way.is_some_and(|way| way < end);
        if others().any(|(_, other)| cut(meets(o, d, *other))) {
            fates[2] += 1;
        } else {
            fates[usize::from(hit.is_none())] += 1;
        }
    }
    fates
}

// Mirrors that light a tube at a slant, a small one in the light of each: before the tube's near end, before it as seen
// from the middle, and behind where rays land. In lanes, by the tree, at every instruction set.
#[test]
fn a_long_tube_against_brute_force() {
    let (radius, half_length) = (0.4, 20.0);
    let panels: Vec<_> = [
        ([-15.0, 1.0, 0.0], 3.0, 2.0),
        ([-15.0 + 4.0, 0.6, 3.0], 0.8, 0.8),
        ([10.0, -2.0, 0.0], 3.0, 2.0),
        ([12.0 + 2.0, -1.4, 3.0], 1.0, 1.0),
        ([2.0, 0.3, 9.0], 3.0, 3.0),
        ([-6.0, -1.0, 0.0], 3.0, 2.0),
    ]
    .map(|(middle, width, height): (V, f64, f64)| {
        panel(middle, width, height, [middle[0] + 8.0, 0.0, 6.0])
    })
    .to_vec();
    let tube = Frustum::cylinder(
        [-half_length, 0.0, 6.0],
        [1.0, 0.0, 0.0],
        [0.0, 1.0, 0.0],
        radius,
        2.0 * half_length,
        [40, 24],
    );
    let tube = Receiver::Frustum(tube.unwrap());
    let whole = elements(&panels);
    let got = trace(&whole, &tube, SLOPE, &options());
    let rays = 1_000_000;
    let fates = brute(&panels, radius, half_length, rays);
    let per_w = rays as f64 / got.incoming_w;
    let got_w = [got.received_w, got.spilled_w, got.blocked_w, got.shaded_w];
    println!("{fates:?} {:?}", got_w.map(|w| (w * per_w).round()));
    assert!(fates[..3].iter().all(|&count| count > 20_000), "{fates:?}");
    for (count, got_w) in fates.into_iter().zip(got_w) {
        let apart = count as f64 - got_w * per_w;
        // of the two, the program's rays are the finer
        assert!(apart.abs() < 5.0 * (count as f64).sqrt() + 100.0, "{apart}");
    }
    for &level in SimdLevel::available() {
        for threads in [1, 2] {
            let other = RayOptions {
                level: Some(level),
                threads,
                ..options()
            };
            assert_eq!(trace(&whole, &tube, SLOPE, &other), got, "{level}");
        }
    }
    let pieces: Vec<_> = panels
        .iter()
        .zip(0..)
        .flat_map(|(panel, k)| cut(panel, 12, k))
        .collect();
    let by_tree = trace(&pieces, &tube, SLOPE, &options());
    for (a, b) in [
        (got.received_w, by_tree.received_w),
        (got.blocked_w, by_tree.blocked_w),
    ] {
        assert!((a - b).abs() < 1e-3 * got.incoming_w, "{a} {b}");
    }
}
