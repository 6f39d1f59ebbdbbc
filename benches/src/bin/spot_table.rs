//! Error of the centre against truth on simulated frames, over signal-to-noise and shape of the beam, as Markdown.
//!
//! `cargo run --release -p helio-bench --bin spot_table [FRAMES]`: so many frames for each cell, 40 unless told.

use helio_spot::simulate::{Beam, BeamShape, Camera, Pose, Scene, Shadow};
use helio_spot::{
    Board, Corners, Frame, Marks, Plane, RobustOptions, Scratch, SpotError, SpotScratch,
    SpotStatus, StandardOptions, Threshold, View, find_spot, standard,
};

const BOARD: Board = Board {
    width_m: 8.0,
    height_m: 7.0,
    marks: Marks::FourCorners,
};
/// Light of the beam's top over the noise of a pixel.
const SIGNAL_TO_NOISE: [f64; 5] = [5.0, 10.0, 30.0, 100.0, 300.0];
/// What the beam's top adds, in parts of white.
const PEAK: f64 = 0.35;

/// What is compared; the centroid is that of all pixels above Otsu's threshold.
const METHODS: [&str; 4] = [
    "`robust`",
    "`standard`",
    "`standard`, `multi:3`",
    "centroid",
];

/// What a table is made for.
struct Case {
    name: &'static str,
    shape: BeamShape,
    change: fn(&mut Scene),
}

fn cases() -> Vec<Case> {
    let round = BeamShape::Gaussian { sigma_m: 0.6 };
    let case = |name, shape, change| Case {
        name,
        shape,
        change,
    };
    vec![
        case("Gaussian", round, |_| {}),
        case(
            "ellipse 2:1",
            BeamShape::Ellipse {
                along_m: 0.85,
                across_m: 0.42,
                angle_rad: 0.7,
            },
            |_| {},
        ),
        case(
            "flat top",
            BeamShape::FlatTop {
                radius_m: 0.9,
                edge_m: 0.12,
            },
            |_| {},
        ),
        case(
            "16 facets",
            BeamShape::Facets {
                count: 16,
                sigma_m: 0.35,
                spread_m: 0.45,
            },
            |_| {},
        ),
        case("Gaussian, saturated", round, |scene| {
            scene.daylight.level = 0.8;
        }),
        case(
            "Gaussian, daylight 20 % brighter to the right",
            round,
            |scene| {
                scene.daylight.gradient_per_m = [0.2 / BOARD.width_m, 0.0];
            },
        ),
        case("Gaussian, shadow's edge", round, |scene| {
            scene.daylight.shadow = Some(Shadow {
                through_m: [1.0, 0.0],
                into_rad: 0.6,
                depth: 0.3,
                penumbra_m: 0.15,
            });
        }),
        case("Gaussian, folds of 2 %", round, |scene| {
            scene.texture = 0.02
        }),
        case("Gaussian, stray light at the edge", round, |scene| {
            scene.others.push(Beam {
                shape: BeamShape::Gaussian { sigma_m: 0.8 },
                u_m: 4.9,
                v_m: -1.0,
                peak: 3.0,
            });
        }),
        case(
            "Gaussian, camera 25° aside and 10° below",
            round,
            |scene| {
                let pose = Pose {
                    distance_m: 200.0,
                    focal_px: 200.0 * 60.0,
                    turn_rad: 0.436,
                    tilt_rad: 0.175,
                    roll_rad: 0.03,
                };
                if let Ok(camera) = Camera::of_pose(768, 576, &pose) {
                    scene.camera = camera;
                }
            },
        ),
    ]
}

/// Distances from the truth \[px\], right and down, of the frames that gave a place.
#[derive(Default)]
struct Errors {
    off_px: Vec<[f64; 2]>,
    frames: usize,
}

impl Errors {
    fn add(&mut self, off_px: Option<[f64; 2]>) {
        self.frames += 1;
        self.off_px.extend(off_px);
    }

    /// Root mean square distance / distance of the mean from the truth, and how many frames gave no place.
    fn cell(&self) -> String {
        let n = self.off_px.len() as f64;
        if self.off_px.is_empty() {
            return "none found".into();
        }
        let square: f64 = self.off_px.iter().map(|[x, y]| x * x + y * y).sum();
        let mean = [0, 1].map(|k| self.off_px.iter().map(|off| off[k]).sum::<f64>() / n);
        let missed = self.frames - self.off_px.len();
        let missed = if missed > 0 {
            format!(" ({missed} missed)")
        } else {
            String::new()
        };
        format!(
            "{:.3} / {:.3}{missed}",
            (square / n).sqrt(),
            mean[0].hypot(mean[1])
        )
    }
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let frames: u64 = match std::env::args().nth(1) {
        Some(text) => text.parse()?,
        None => 40,
    };
    let mut out = String::from(
        "| beam | method | signal to noise 5 | 10 | 30 | 100 | 300 |\n|---|---|---|---|---|---|---|\n",
    );
    for (number, case) in cases().iter().enumerate() {
        let mut cells: [Vec<String>; METHODS.len()] = Default::default();
        for (column, snr) in SIGNAL_TO_NOISE.into_iter().enumerate() {
            let stream = ((number * 16 + column) as u64) << 32;
            let errors = cell(case, snr, frames, stream)?;
            for (cells, errors) in cells.iter_mut().zip(&errors) {
                cells.push(errors.cell());
            }
        }
        for (method, cells) in METHODS.iter().zip(&cells) {
            out.push_str(&format!(
                "| {} | {method} | {} |\n",
                case.name,
                cells.join(" | ")
            ));
        }
    }
    print(&out);
    Ok(())
}

#[allow(clippy::print_stdout)]
fn print(text: &str) {
    println!("{text}");
}

/// Errors of each method over frames whose spots stand at places evenly spread over a pixel and the
/// middle of the target.
fn cell(
    case: &Case,
    snr: f64,
    frames: u64,
    stream: u64,
) -> Result<[Errors; METHODS.len()], SpotError> {
    let mut errors: [Errors; METHODS.len()] = Default::default();
    let mut rooms = (Scratch::default(), SpotScratch::default());
    for index in 0..frames {
        let mut scene = Scene::plain(BOARD, 768, 576)?;
        (case.change)(&mut scene);
        // Additive recurrences by the square root of 2 and 3: evenly spread, different in each frame.
        let at = [2.0_f64, 3.0].map(|root| (root.sqrt() * (index + 1) as f64).fract() - 0.5);
        scene.beam = Some(Beam {
            shape: case.shape,
            u_m: 0.4 * BOARD.width_m * at[0],
            v_m: 0.4 * BOARD.height_m * at[1],
            peak: PEAK,
        });
        scene.sensor.white_electrons = f64::INFINITY;
        scene.sensor.read_noise = PEAK / snr;
        let seen = scene.render(stream | index)?;
        let Some(truth) = seen.truth.beam else {
            continue;
        };
        let corners = Corners::given(seen.truth.corners_px, 0.05);
        let Ok(plane) = Plane::new(BOARD, corners, None) else {
            continue;
        };
        let found = match &seen.frame {
            Frame::Gray8(picture) => places(picture.view(), &plane, &mut rooms)?,
            Frame::Gray16(_) => continue,
        };
        for (errors, place) in errors.iter_mut().zip(found) {
            errors.add(place.map(|[x, y]| [x - truth.x_px, y - truth.y_px]));
        }
    }
    Ok(errors)
}

/// Where each method sees the spot \[px\].
fn places(
    view: View<'_, u8>,
    plane: &Plane,
    (of_standard, of_robust): &mut (Scratch, SpotScratch),
) -> Result<[Option<[f64; 2]>; METHODS.len()], SpotError> {
    let spot = find_spot(view, plane, &RobustOptions::default(), of_robust)?;
    let robust = spot.status.has_position().then_some([spot.x_px, spot.y_px]);
    let corners = &plane.corners().at_px;
    let low = [0, 1].map(|k| {
        corners
            .iter()
            .map(|c| c[k])
            .fold(f64::INFINITY, f64::min)
            .floor()
            .max(0.0)
    });
    let high = [0, 1].map(|k| corners.iter().map(|c| c[k]).fold(0.0, f64::max).ceil());
    let size = [0, 1].map(|k| (high[k] - low[k]) as usize + 1);
    let Some(part) = view.part(low[0] as usize, low[1] as usize, size[0], size[1]) else {
        return Ok([robust, None, None, None]);
    };
    let otsu = standard(part, &StandardOptions::default(), of_standard)?;
    let three = StandardOptions::with_threshold(Threshold::MultiOtsu { classes: 3 });
    let three = standard(part, &three, of_standard)?;
    let place = |status: SpotStatus, x_px: f64, y_px: f64| {
        (status != SpotStatus::Empty).then_some([low[0] + x_px, low[1] + y_px])
    };
    Ok([
        robust,
        place(otsu.status, otsu.x_px, otsu.y_px),
        place(three.status, three.x_px, three.y_px),
        place(otsu.status, otsu.centroid_x_px, otsu.centroid_y_px),
    ])
}
