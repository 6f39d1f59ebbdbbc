use super::*;
use crate::image::View;
use crate::target::Marks;

const BOARD: Board = Board {
    width_m: 8.0,
    height_m: 6.0,
    marks: Marks::FourCorners,
};

fn gray8(seen: &SimulatedFrame) -> View<'_, u8> {
    match &seen.frame {
        Frame::Gray8(picture) => picture.view(),
        Frame::Gray16(_) => panic!("8 bit wanted"),
    }
}

fn scene() -> Scene {
    let mut scene = Scene::plain(BOARD, 320, 240).unwrap();
    scene.beam = Some(Beam {
        shape: BeamShape::Gaussian { sigma_m: 0.5 },
        u_m: 0.513,
        v_m: -0.377,
        peak: 0.4,
    });
    scene
}

fn without_noise(mut scene: Scene) -> Scene {
    scene.sensor.white_electrons = f64::INFINITY;
    scene.sensor.read_noise = 0.0;
    scene
}

#[test]
fn any_number_of_threads_gives_the_same_bits() {
    let mut scene = scene();
    scene.texture = 0.02;
    scene.others.push(Beam {
        shape: BeamShape::Facets {
            count: 9,
            sigma_m: 0.2,
            spread_m: 0.3,
        },
        u_m: -2.0,
        v_m: 1.0,
        peak: 0.2,
    });
    let render = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads);
        pool.build().unwrap().install(|| scene.render(5).unwrap())
    };
    let one = render(1);
    assert_eq!(one, render(3));
    assert_ne!(one, scene.render(6).unwrap());
}

// The mean of what the beam adds, weighted by the pixels' places, without noise and at 16 bit.
#[test]
fn the_spot_stands_where_the_truth_says() {
    let mut scene = without_noise(scene());
    scene.sensor.depth = Depth::Bits16;
    let with = scene.render(1).unwrap();
    scene.beam = None;
    let without = scene.render(1).unwrap();
    assert!(without.truth.beam.is_none());
    let (Frame::Gray16(with_it), Frame::Gray16(without_it)) = (&with.frame, &without.frame) else {
        panic!("16 bit wanted");
    };
    let (mut sum, mut x, mut y) = (0.0, 0.0, 0.0);
    for (row, (a, b)) in with_it
        .view()
        .rows()
        .zip(without_it.view().rows())
        .enumerate()
    {
        for (column, (&a, &b)) in a.iter().zip(b).enumerate() {
            let light = f64::from(a) - f64::from(b);
            sum += light;
            x += light * column as f64;
            y += light * row as f64;
        }
    }
    let truth = with.truth.beam.unwrap();
    // Steps of 1/65535 over the picture leave a few thousandths of a pixel; perspective 40 widths away less.
    assert!((x / sum - truth.x_px).abs() < 5e-3, "{} {truth:?}", x / sum);
    assert!((y / sum - truth.y_px).abs() < 5e-3, "{} {truth:?}", y / sum);
    assert!((truth.share_on_target - 1.0).abs() < 1e-6);
}

// Along a row through the upper left L the first black begins at the corner: the white that a row lacks,
// counted in pixels, is the bar's width.
#[test]
fn marks_begin_at_the_corners() {
    let scene = without_noise(Scene::plain(BOARD, 320, 240).unwrap());
    let seen = scene.render(1).unwrap();
    let view = gray8(&seen);
    let [x_px, y_px] = seen.truth.corners_px[0];
    let px_per_m = (seen.truth.corners_px[1][0] - x_px) / 8.0;
    let row = (y_px + 0.3 * px_per_m) as usize;
    let (white, black) = (0.5 * 255.0, 0.03 * 255.0);
    let from = x_px as usize - 4;
    let to = (x_px + 0.4 * px_per_m) as usize;
    let mut lacking = 0.0;
    let mut first_moment = 0.0;
    for column in from..to {
        let lack = (white - f64::from(view.row(row)[column])) / (white - black);
        lacking += lack;
        first_moment += lack * column as f64;
    }
    assert!((lacking - scene.bar_m * px_per_m).abs() < 0.05, "{lacking}");
    let middle = first_moment / lacking;
    assert!(
        (middle - (x_px + 0.5 * scene.bar_m * px_per_m)).abs() < 0.05,
        "{middle} {x_px}"
    );
}

#[test]
fn noise_is_as_large_as_it_is_said_to_be() {
    let mut scene = Scene::plain(BOARD, 320, 240).unwrap();
    scene.sensor.depth = Depth::Bits16;
    scene.sensor.white_electrons = 10_000.0;
    scene.sensor.read_noise = 0.004;
    let seen = scene.render(2).unwrap();
    let Frame::Gray16(picture) = &seen.frame else {
        panic!("16 bit wanted");
    };
    let part = picture.view().part(120, 80, 80, 80).unwrap();
    let values: Vec<f64> = part
        .rows()
        .flatten()
        .map(|&v| f64::from(v) / 65_535.0)
        .collect();
    let n = values.len() as f64;
    let mean = values.iter().sum::<f64>() / n;
    let variance = values.iter().map(|v| (v - mean) * (v - mean)).sum::<f64>() / n;
    // Four standard errors of a mean and of a variance.
    let sigma = (0.5 / 10_000.0 + 0.004_f64 * 0.004).sqrt();
    assert!((mean - 0.5).abs() < 4.0 * sigma / n.sqrt(), "{mean}");
    assert!(
        (variance / (sigma * sigma) - 1.0).abs() < 4.0 * (2.0 / n).sqrt(),
        "{variance}"
    );
}

#[test]
fn shadows_gradients_and_bright_light_are_there() {
    let mut scene = without_noise(Scene::plain(BOARD, 320, 240).unwrap());
    scene.daylight.gradient_per_m = [0.05, 0.0];
    scene.daylight.shadow = Some(Shadow {
        through_m: [0.0, 0.0],
        into_rad: core::f64::consts::FRAC_PI_2,
        depth: 0.4,
        penumbra_m: 0.2,
    });
    scene.others.push(Beam {
        shape: BeamShape::Gaussian { sigma_m: 0.5 },
        u_m: 4.5,
        v_m: 0.0,
        peak: 20.0,
    });
    let seen = scene.render(1).unwrap();
    let view = gray8(&seen);
    let at = |u_m: f64, v_m: f64| {
        let [x_px, y_px] = scene.camera.pixel(u_m, v_m);
        f64::from(view.row(y_px.round() as usize)[x_px.round() as usize])
    };
    assert!((at(-2.0, -1.0) - 255.0 * 0.5 * 0.9).abs() < 2.0);
    assert!((at(-2.0, 1.0) - 255.0 * 0.5 * 0.9 * 0.6).abs() < 2.0);
    assert_eq!(at(4.0, 0.0), 255.0);
}

#[test]
fn a_beam_over_the_edge_says_what_is_left_of_it() {
    let mut scene = scene();
    scene.beam = Some(Beam {
        shape: BeamShape::Gaussian { sigma_m: 0.5 },
        u_m: 4.0,
        v_m: 0.0,
        peak: 0.4,
    });
    let truth = scene.truth(1).unwrap().beam.unwrap();
    assert!((truth.share_on_target - 0.5).abs() < 1e-6);
    let [u_m, _] = truth.on_target_m.unwrap();
    assert!((u_m - (4.0 - 0.398_942_28)).abs() < 1e-5);
    assert_eq!(truth.u_m, 4.0);
}

#[test]
fn senseless_scenes_are_refused_by_name() {
    let good = scene();
    let with = |change: fn(&mut Scene)| {
        let mut scene = good.clone();
        change(&mut scene);
        scene.render(1).unwrap_err().to_string()
    };
    assert!(with(|s| s.board.width_m = f64::NAN).contains("width_m"));
    assert!(with(|s| s.arm_m = 7.0).contains("arm_m"));
    assert!(with(|s| s.sensor.white_electrons = 0.0).contains("white_electrons"));
    assert!(with(|s| s.daylight.level = -1.0).contains("daylight"));
    assert!(
        with(|s| s.others.push(Beam {
            peak: f64::NAN,
            ..s.beam.unwrap()
        }))
        .contains("peak")
    );
}
