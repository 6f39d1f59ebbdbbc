//! Against synthetic frames, whose truth is known.

use super::*;
use crate::image::Frame;
use crate::simulate::{Beam, BeamShape, Scene, Shadow};
use crate::target::{Board, Corners, Marks};

const BOARD: Board = Board {
    width_m: 8.0,
    height_m: 7.0,
    marks: Marks::FourCorners,
};

fn scene() -> Scene {
    Scene::plain(BOARD, 320, 280).unwrap()
}

fn beam(shape: BeamShape, u_m: f64, v_m: f64, peak: f64) -> Beam {
    Beam {
        shape,
        u_m,
        v_m,
        peak,
    }
}

fn gaussian(u_m: f64, v_m: f64, peak: f64) -> Beam {
    beam(BeamShape::Gaussian { sigma_m: 0.6 }, u_m, v_m, peak)
}

fn look(scene: &Scene, seed: u64, options: &RobustOptions, scratch: &mut SpotScratch) -> Spot {
    let seen = scene.render(seed).unwrap();
    let corners = Corners::given(seen.truth.corners_px, 0.0);
    let plane = Plane::new(scene.board, corners, None).unwrap();
    match &seen.frame {
        Frame::Gray8(picture) => find_spot(picture.view(), &plane, options, scratch),
        Frame::Gray16(picture) => find_spot(picture.view(), &plane, options, scratch),
    }
    .unwrap()
}

fn spot(scene: &Scene, seed: u64) -> Spot {
    look(
        scene,
        seed,
        &RobustOptions::default(),
        &mut SpotScratch::default(),
    )
}

/// splitmix64, 0 to 1.
struct Random(u64);

impl Random {
    fn unit(&mut self) -> f64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((z ^ (z >> 31)) >> 11) as f64 / (1_u64 << 53) as f64
    }

    fn between(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * self.unit()
    }
}

/// A beam that moves by parts of a pixel is followed; the bias is the mean error over what noise there is.
#[test]
fn follows_parts_of_a_pixel() {
    let shapes = [
        BeamShape::Gaussian { sigma_m: 0.5 },
        BeamShape::Ellipse {
            along_m: 0.9,
            across_m: 0.35,
            angle_rad: 0.7,
        },
        BeamShape::FlatTop {
            radius_m: 0.9,
            edge_m: 0.15,
        },
    ];
    for shape in shapes {
        for (width, height) in [(320, 280), (900, 800)] {
            let mut scene = Scene::plain(BOARD, width, height).unwrap();
            scene.sensor.white_electrons = f64::INFINITY;
            let px_m = 8.0 / (0.7 * f64::from(width as u32));
            let mut worst = 0.0_f64;
            for step in 0..8 {
                let shift = f64::from(step) / 8.0;
                let at = [0.4 + shift * px_m, -0.3 + 0.6 * shift * px_m];
                scene.beam = Some(beam(shape, at[0], at[1], 0.4));
                let mut bias = [0.0; 2];
                for seed in 0..4 {
                    let truth = scene.truth(seed).unwrap().beam.unwrap();
                    let found = spot(&scene, 100 * step as u64 + seed);
                    assert_eq!(found.status, SpotStatus::Ok);
                    bias[0] += 0.25 * (found.x_px - truth.x_px);
                    bias[1] += 0.25 * (found.y_px - truth.y_px);
                }
                worst = worst.max(bias[0].hypot(bias[1]));
            }
            println!("{shape:?} {width} x {height}: largest bias {worst:.4} px");
            assert!(worst < 0.02, "{shape:?} {width} {worst}");
        }
    }
}

/// Error over stated standard deviation, without and with shot noise, gradient and a shadow's edge.
#[test]
fn says_how_certain_it_is() {
    let mut random = Random(5);
    let mut scratch = SpotScratch::default();
    for shadow in [false, true] {
        let (mut squares, mut within, mut count) = (0.0, 0, 0);
        for seed in 0..60 {
            let mut scene = scene();
            scene.sensor.white_electrons = random.between(1e3, 1e4);
            scene.sensor.read_noise = random.between(0.002, 0.02);
            scene.daylight.gradient_per_m =
                [random.between(-0.03, 0.03), random.between(-0.03, 0.03)];
            if shadow {
                scene.daylight.shadow = Some(Shadow {
                    through_m: [random.between(-2.0, 2.0), random.between(-2.0, 2.0)],
                    into_rad: random.between(0.0, 6.0),
                    depth: random.between(0.1, 0.6),
                    penumbra_m: random.between(0.05, 0.3),
                });
            }
            let sigma_m = random.between(0.35, 0.8);
            let (u_m, v_m) = (random.between(-1.5, 1.5), random.between(-1.2, 1.2));
            let peak = random.between(0.15, 0.35);
            scene.beam = Some(beam(BeamShape::Gaussian { sigma_m }, u_m, v_m, peak));
            let found = look(&scene, seed, &RobustOptions::default(), &mut scratch);
            assert_eq!(found.status, SpotStatus::Ok, "{seed} {scene:?}");
            let [[uu, _], [_, vv]] = found.covariance_m2;
            for z in [(found.u_m - u_m) / uu.sqrt(), (found.v_m - v_m) / vv.sqrt()] {
                squares += z * z;
                within += i32::from(z.abs() < 3.0);
                count += 1;
            }
        }
        let rms = (squares / f64::from(count)).sqrt();
        let share = f64::from(within) / f64::from(count);
        println!("shadow {shadow}: rms of error over sigma {rms:.2}, {share:.3} within 3");
        if shadow {
            assert!(rms < 2.0 && share > 0.9, "{rms} {share}");
        } else {
            assert!(rms > 0.5 && rms < 1.3 && share > 0.98, "{rms} {share}");
        }
    }
}

#[test]
fn claims_nothing_on_empty_targets() {
    let mut random = Random(99);
    let mut scratch = SpotScratch::default();
    let mut claims = Vec::new();
    for seed in 0..1000 {
        let mut scene = Scene::plain(BOARD, 170, 150).unwrap();
        scene.daylight.level = random.between(0.1, 0.8);
        scene.sensor.white_electrons = random.between(500.0, 1e4);
        scene.sensor.read_noise = random.between(0.0, 0.03);
        match seed % 3 {
            0 => {}
            1 => {
                scene.daylight.gradient_per_m =
                    [random.between(-0.1, 0.1), random.between(-0.1, 0.1)]
            }
            _ => {
                scene.daylight.shadow = Some(Shadow {
                    through_m: [random.between(-3.5, 3.5), random.between(-3.0, 3.0)],
                    into_rad: random.between(0.0, 6.0),
                    depth: random.between(0.05, 0.9),
                    penumbra_m: random.between(0.02, 0.5),
                });
            }
        }
        let found = look(&scene, seed, &RobustOptions::default(), &mut scratch);
        assert_ne!(found.status, SpotStatus::NoTarget, "{seed}");
        if found.status.has_position() {
            claims.push((seed, scene.daylight));
        }
    }
    assert!(claims.is_empty(), "{} {claims:?}", claims.len());
}

#[test]
fn stray_light_at_the_edge_is_no_spot() {
    let mut scene = scene();
    let stray = beam(BeamShape::Gaussian { sigma_m: 0.8 }, 1.0, 3.9, 2.0);
    scene.others.push(stray);
    let mut scratch = SpotScratch::default();
    let found = look(&scene, 3, &RobustOptions::default(), &mut scratch);
    assert_eq!(found.status, SpotStatus::Empty);
    let refusals: Vec<_> = scratch.candidates().map(|c| c.refused).collect();
    assert_eq!(refusals[0], Some(Refusal::GrowsOutwards));
    // And does not hide one, though it is brighter.
    scene.beam = Some(gaussian(-1.0, -0.5, 0.2));
    let found = spot(&scene, 3);
    assert_eq!(found.status, SpotStatus::Ok);
    assert!((found.u_m + 1.0).hypot(found.v_m + 0.5) < 0.02, "{found:?}");
}

#[test]
fn the_expected_of_two_is_taken() {
    let mut scene = scene();
    scene.beam = Some(gaussian(-1.8, 0.5, 0.3));
    scene.others.push(gaussian(1.8, -0.5, 0.25));
    let found = spot(&scene, 1);
    assert_eq!(found.status, SpotStatus::Ambiguous);
    assert!(found.flags.contains(Flags::SEVERAL));
    assert!((found.u_m + 1.8).abs() < 0.02, "{found:?}");
    for (u, v) in [(-1.8, 0.5), (1.8, -0.5)] {
        let options = RobustOptions {
            expected: Some((u + 0.3, v - 0.3, 0.5)),
            ..RobustOptions::default()
        };
        let found = look(&scene, 1, &options, &mut SpotScratch::default());
        assert_eq!(found.status, SpotStatus::Ok);
        assert!(found.flags.contains(Flags::SEVERAL));
        assert!((found.u_m - u).hypot(found.v_m - v) < 0.02, "{found:?}");
    }
    let options = RobustOptions {
        expected: Some((0.0, 3.0, 0.2)),
        ..RobustOptions::default()
    };
    let found = look(&scene, 1, &options, &mut SpotScratch::default());
    assert!(found.flags.contains(Flags::FAR_FROM_EXPECTED));
}

#[test]
fn cut_saturated_and_faint_are_told() {
    let mut scene = scene();
    scene.beam = Some(gaussian(3.3, 0.4, 0.3));
    let found = spot(&scene, 2);
    assert_eq!(found.status, SpotStatus::Cut);
    assert!(found.flags.contains(Flags::CUT));
    let off = (found.u_m - 3.3).hypot(found.v_m - 0.4);
    assert!(
        off > 0.05 && off < 2.0 * found.sigma_m(),
        "{off} {}",
        found.sigma_m()
    );
    // The completed centre is nearer to the truth by more than a half.
    let [u_m, v_m] = found.completed_m.unwrap();
    assert!(
        (u_m - 3.3).hypot(v_m - 0.4) < 0.5 * off,
        "{u_m} {v_m} {off}"
    );

    scene.beam = Some(gaussian(0.3, 0.4, 1.5));
    let found = spot(&scene, 2);
    assert_eq!(found.status, SpotStatus::Saturated);
    assert!(found.flags.contains(Flags::SATURATED));
    assert!((found.u_m - 0.3).hypot(found.v_m - 0.4) < 0.02, "{found:?}");

    scene.daylight.level = 0.6;
    scene.beam = Some(gaussian(0.3, 0.4, 0.09));
    let found = spot(&scene, 2);
    assert_eq!(found.status, SpotStatus::Ok);
    assert!(found.flags.contains(Flags::FAINT) && !found.flags.contains(Flags::SATURATED));
    assert!((found.u_m - 0.3).hypot(found.v_m - 0.4) < 0.05, "{found:?}");
}

/// The same whatever the scratch was used for before, and for the same picture in 16 bits.
/// The foot of a Gaussian, 0.06 of its peak, is a circle of 2.37 standard deviations; the pieces go along the sides of
/// cells, eight radii in all.
#[test]
fn the_outline_is_that_of_what_counted() {
    let mut scene = scene();
    let mut scratch = SpotScratch::default();
    scene.beam = Some(gaussian(0.4, -0.3, 0.4));
    let options = RobustOptions::default();
    let found = look(&scene, 1, &options, &mut scratch);
    let px_m = 8.0 / (0.7 * 320.0);
    let radius = 0.6 * (-2.0 * f64::ln(0.06)).sqrt() / px_m;
    let (mut pieces, mut length) = (0, 0.0);
    for [from, to] in scratch.outline_px() {
        pieces += 1;
        length += (to[0] - from[0]).abs() + (to[1] - from[1]).abs();
        let away = (from[0] - found.x_px).hypot(from[1] - found.y_px);
        assert!((away - radius).abs() < 3.0, "{away} {radius}");
    }
    assert!(
        pieces > 100 && (length / (8.0 * radius) - 1.0).abs() < 0.05,
        "{pieces} {length}"
    );
    scene.beam = None;
    assert_eq!(
        look(&scene, 1, &options, &mut scratch).status,
        SpotStatus::Empty
    );
    assert_eq!(scratch.outline_px().count(), 0);
}

#[test]
fn scratch_leaves_no_trace() {
    let mut scene = scene();
    scene.beam = Some(gaussian(0.3, 0.4, 0.3));
    let fresh = spot(&scene, 4);
    let mut scratch = SpotScratch::default();
    let mut other = Scene::plain(BOARD, 700, 500).unwrap();
    other.beam = Some(gaussian(-2.0, 1.0, 0.2));
    look(&other, 1, &RobustOptions::default(), &mut scratch);
    let again = look(&scene, 4, &RobustOptions::default(), &mut scratch);
    assert_eq!(fresh, again);
}

#[test]
fn bad_options_and_targets_out_of_sight() {
    let pixels = vec![100_u8; 64 * 64];
    let view = View::new(&pixels, 64, 64).unwrap();
    let corners = |x: f64| [[x, 0.0], [x + 60.0, 0.0], [x + 60.0, 60.0], [x, 60.0]];
    let plane = |x: f64| Plane::new(BOARD, Corners::given(corners(x), 0.0), None).unwrap();
    let mut scratch = SpotScratch::default();
    for expected in [
        (f64::NAN, 0.0, 1.0),
        (0.0, 0.0, 0.0),
        (0.0, f64::INFINITY, 1.0),
    ] {
        let options = RobustOptions {
            expected: Some(expected),
            ..RobustOptions::default()
        };
        assert!(find_spot(view, &plane(0.0), &options, &mut scratch).is_err());
    }
    let options = RobustOptions::default();
    let flat = find_spot(view, &plane(0.0), &options, &mut scratch).unwrap();
    assert_eq!(flat.status, SpotStatus::Empty);
    for x in [1000.0, -1000.0, 1e6, -57.0] {
        let found = find_spot(view, &plane(x), &options, &mut scratch).unwrap();
        assert_eq!(found.status, SpotStatus::NoTarget, "{x}");
        assert!(found.u_m.is_nan());
    }
    let one = View::new(&pixels[..1], 1, 1).unwrap();
    let found = find_spot(one, &plane(0.0), &options, &mut scratch).unwrap();
    assert_eq!(found.status, SpotStatus::NoTarget);
}
