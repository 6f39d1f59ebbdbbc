//! What is photographed, and what is the same in all frames of it.

use helio_core::angle::radians;
use helio_spot::simulate::{Beam, BeamShape, Camera, Daylight, Depth, Pose, Scene, Sensor, Shadow};
use helio_spot::{Board, Lens, LensValues, Marks};

use super::images::ImagesError;

/// What is photographed, and how.
#[derive(Debug, Clone, PartialEq)]
pub struct ImagePlan {
    /// Number of frames, where no log of observations says how many.
    pub frames: u32,
    /// Of all random numbers.
    pub seed: u64,
    /// Pixels in a row, and rows.
    pub size_px: [usize; 2],
    /// Bits of a gray value.
    pub depth: Depth,
    /// The target.
    pub board: Board,
    /// Shape of the beam.
    pub shape: ImageBeam,
    /// Standard deviation of the beam, or radius of a flat top \[m\].
    pub beam_m: f64,
    /// What the beam's brightest place adds \[parts of white\].
    pub peak: f64,
    /// Daylight on the target \[parts of white\].
    pub daylight: f64,
    /// Relative change of the daylight over the width of the target.
    pub gradient: f64,
    /// Share of the daylight that a shadow with a slanting edge takes.
    pub shadow: f64,
    /// Relative depth of the fabric's folds.
    pub texture: f64,
    /// Standard deviation of the noise of a pixel \[parts of white\].
    pub noise: f64,
    /// How far the camera stands to the left, as an angle at the target \[degrees\].
    pub turn_deg: f64,
    /// How far it stands below \[degrees\].
    pub tilt_deg: f64,
    /// How far the picture is turned clockwise \[degrees\].
    pub roll_deg: f64,
    /// Radial distortion k1 of the lens, whose focal length is the picture's width.
    pub distortion: f64,
    /// A second beam, with so much of the light of the first.
    pub second: f64,
    /// Stray light beyond the right edge \[parts of white at its brightest\].
    pub stray: f64,
    /// Every frame of this number has no beam.
    pub empty_every: Option<u32>,
    /// Leave the corners out of `target.toml`, so that marks are looked for.
    pub find_marks: bool,
}

impl Default for ImagePlan {
    fn default() -> Self {
        Self {
            frames: 10,
            seed: 1,
            size_px: [768, 576],
            depth: Depth::Bits8,
            board: Board {
                width_m: 8.0,
                height_m: 7.0,
                marks: Marks::FourCorners,
            },
            shape: ImageBeam::Gaussian,
            beam_m: 0.6,
            peak: 0.35,
            daylight: 0.5,
            gradient: 0.0,
            shadow: 0.0,
            texture: 0.01,
            noise: 0.005,
            turn_deg: 0.0,
            tilt_deg: 0.0,
            roll_deg: 0.0,
            distortion: 0.0,
            second: 0.0,
            stray: 0.0,
            empty_every: None,
            find_marks: false,
        }
    }
}

/// Shape of a simulated beam.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum ImageBeam {
    /// Round.
    Gaussian,
    /// Twice as long as wide, slanting.
    Ellipse,
    /// Even within its radius.
    FlatTop,
    /// Sixteen images that do not quite meet.
    Facets,
}

impl ImageBeam {
    /// Every shape.
    pub const ALL: [Self; 4] = [Self::Gaussian, Self::Ellipse, Self::FlatTop, Self::Facets];

    /// The word for it.
    #[must_use]
    pub const fn as_str(self) -> &'static str {
        match self {
            Self::Gaussian => "gaussian",
            Self::Ellipse => "ellipse",
            Self::FlatTop => "flat-top",
            Self::Facets => "facets",
        }
    }

    pub(super) fn of_size(self, beam_m: f64) -> BeamShape {
        match self {
            Self::Gaussian => BeamShape::Gaussian { sigma_m: beam_m },
            Self::Ellipse => BeamShape::Ellipse {
                along_m: beam_m * std::f64::consts::SQRT_2,
                across_m: beam_m / std::f64::consts::SQRT_2,
                angle_rad: 0.7,
            },
            Self::FlatTop => BeamShape::FlatTop {
                radius_m: beam_m,
                edge_m: 0.15 * beam_m,
            },
            Self::Facets => BeamShape::Facets {
                count: 16,
                sigma_m: 0.6 * beam_m,
                spread_m: 0.7 * beam_m,
            },
        }
    }
}

/// What is the same in all frames.
pub(super) fn scene(plan: &ImagePlan) -> Result<(Scene, Option<Lens>), ImagesError> {
    let board = plan.board;
    let [width, height] = plan.size_px;
    let plain = Scene::plain(board, width, height)?;
    let straight = Camera::of_pose(width, height, &{
        let [left, _] = plain.camera.pixel(-0.5 * board.width_m, 0.0);
        let [right, _] = plain.camera.pixel(0.5 * board.width_m, 0.0);
        let distance_m = 40.0 * board.width_m.max(board.height_m);
        Pose {
            distance_m,
            focal_px: (right - left) / board.width_m * distance_m,
            turn_rad: radians(plan.turn_deg),
            tilt_rad: radians(plan.tilt_deg),
            roll_rad: radians(plan.roll_deg),
        }
    })?;
    let lens = if plan.distortion == 0.0 {
        None
    } else {
        Some(Lens::new(LensValues {
            fx_px: width as f64,
            fy_px: width as f64,
            cx_px: 0.5 * (width as f64 - 1.0),
            cy_px: 0.5 * (height as f64 - 1.0),
            k1: plan.distortion,
            ..LensValues::default()
        })?)
    };
    let shadow = (plan.shadow > 0.0).then_some(Shadow {
        through_m: [0.1 * board.width_m, 0.0],
        into_rad: 0.6,
        depth: plan.shadow,
        penumbra_m: 0.02 * board.width_m,
    });
    let mut others = Vec::new();
    if plan.stray > 0.0 {
        others.push(Beam {
            shape: BeamShape::Gaussian {
                sigma_m: 0.1 * board.width_m,
            },
            u_m: 0.62 * board.width_m,
            v_m: -0.1 * board.height_m,
            peak: plan.stray,
        });
    }
    let scene = Scene {
        texture: plan.texture,
        daylight: Daylight {
            level: plan.daylight,
            gradient_per_m: [plan.gradient / board.width_m, 0.0],
            shadow,
        },
        others,
        camera: match lens {
            Some(lens) => straight.with_lens(lens),
            None => straight,
        },
        sensor: Sensor {
            depth: plan.depth,
            white_electrons: f64::INFINITY,
            read_noise: plan.noise,
            ..plain.sensor
        },
        ..plain
    };
    Ok((scene, lens))
}
