//! Synthetic camera frames of a target, with their truth.

use std::path::PathBuf;

use helio_calib::random::Random;
use helio_core::angle::radians;
use helio_spot::simulate::{
    Beam, BeamShape, Camera, Daylight, Depth, Pose, Scene, Sensor, Shadow, SimulatedFrame, Truth,
};
use helio_spot::{Board, Frame, Lens, LensError, LensValues, Marks, SpotError};
use rayon::prelude::*;

use crate::output::{Cells, Destination, Format, write_columns};
use crate::{IoError, ObservationLog};

/// Most bytes of pixels that are kept in memory.
const MOST_BYTES: u64 = 1 << 32;

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

    fn of_size(self, beam_m: f64) -> BeamShape {
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

/// Why no frames are made.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ImagesError {
    /// A file that cannot be written.
    #[error(transparent)]
    Io(#[from] IoError),
    /// Numbers of which no frame can be made.
    #[error(transparent)]
    Spot(#[from] SpotError),
    /// A lens that is none.
    #[error(transparent)]
    Lens(#[from] LensError),
    /// A folder with something in the way.
    #[error(
        "{} holds {name}, which simulate images did not write or which was changed since, and would lose it; wanted \
         another folder",
        folder.display()
    )]
    Held {
        /// The folder.
        folder: PathBuf,
        /// What is in the way.
        name: String,
    },
    /// More than is kept in memory.
    #[error(
        "{frames} frames of {width}x{height} pixels are {bytes} bytes; wanted at most {most}, or a folder for them"
    )]
    TooMany {
        /// Their number.
        frames: usize,
        /// Pixels in a row.
        width: usize,
        /// Rows.
        height: usize,
        /// All their pixels.
        bytes: u64,
        /// The most there may be.
        most: u64,
    },
    /// Whoever watched wanted an end.
    #[error("stopped")]
    Stopped,
}

/// Pixels of frames of one size, one frame after the other.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum FramePixels {
    /// 0 to 255.
    Bits8(Vec<u8>),
    /// 0 to 65535.
    Bits16(Vec<u16>),
}

/// Frames that can be made, each by its number.
#[derive(Debug, Clone)]
pub struct SimulatedImages {
    pub(super) plan: ImagePlan,
    pub(super) scene: Scene,
    pub(super) lens: Option<Lens>,
    pub(super) log: Option<ObservationLog>,
}

impl SimulatedImages {
    /// What is the same in all frames, worked out once.
    ///
    /// # Errors
    /// [`ImagesError::Spot`] and [`ImagesError::Lens`] name a number that makes no sense.
    ///
    /// ```
    /// use helio_io::{ImagePlan, SimulatedImages};
    /// let plan = ImagePlan { frames: 3, size_px: [160, 120], ..ImagePlan::default() };
    /// let images = SimulatedImages::new(plan)?;
    /// let truth = images.frame(2)?.truth;
    /// assert!(truth.beam.unwrap().share_on_target > 0.99);
    /// assert_eq!((images.frame(2)?.truth, images.len()), (truth, 3));
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn new(plan: ImagePlan) -> Result<Self, ImagesError> {
        let (scene, lens) = scene(&plan)?;
        Ok(Self {
            plan,
            scene,
            lens,
            log: None,
        })
    }

    /// Frames of the spots of a table of observations instead, one each.
    #[must_use]
    pub fn with_log(mut self, log: ObservationLog) -> Self {
        self.log = Some(log);
        self
    }

    /// Number of frames.
    #[must_use]
    pub fn len(&self) -> usize {
        match &self.log {
            Some(log) => log.spots_m.len(),
            None => self.plan.frames as usize,
        }
    }

    /// True if there is none.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// File names of the frames.
    #[must_use]
    pub fn names(&self) -> Vec<String> {
        (1..=self.len()).map(name).collect()
    }

    /// A frame by its number, counted from 1.
    ///
    /// # Errors
    /// [`SpotError`] names a number that makes no sense.
    pub fn frame(&self, number: usize) -> Result<SimulatedFrame, SpotError> {
        let plan = &self.plan;
        let mut scene = self.scene.clone();
        let seed = Random::stream(plan.seed, number as u64).next_u64();
        let mut random = Random::new(seed);
        let (wide, high) = (0.3 * plan.board.width_m, 0.3 * plan.board.height_m);
        let mut beam = |peak: f64| Beam {
            shape: plan.shape.of_size(plan.beam_m),
            u_m: random.between(-wide, wide),
            v_m: random.between(-high, high),
            peak,
        };
        let mut first = beam(plan.peak);
        let logged = self.log.as_ref().and_then(|log| {
            let row = number.checked_sub(1)?;
            log.spots_m.get(row)
        });
        if let Some(&[u_m, v_m]) = logged {
            (first.u_m, first.v_m) = (u_m, v_m);
        }
        let second = beam(plan.peak * plan.second);
        let empty = plan
            .empty_every
            .is_some_and(|every| (number as u64).is_multiple_of(u64::from(every)));
        if !empty {
            scene.beam = Some(first);
        }
        if plan.second > 0.0 {
            scene.others.push(second);
        }
        scene.render(seed)
    }

    /// All frames in memory, and what is true of them. The same plan gives the same bits, whatever the threads. `watch`
    /// is told of frames done and in all.
    ///
    /// # Errors
    /// [`ImagesError::TooMany`] for more than 4 GiB of pixels, or more than there is memory for;
    /// [`ImagesError::Stopped`] if `watch` wanted an end.
    pub fn pixels(
        &self,
        watch: &(dyn Fn(u64, u64) -> bool + Sync),
    ) -> Result<(FramePixels, Vec<Truth>), ImagesError> {
        Ok(match self.plan.depth {
            Depth::Bits8 => {
                let (pixels, truths) = self.filled(watch, |frame| match frame {
                    Frame::Gray8(picture) => picture.into_pixels(),
                    Frame::Gray16(_) => Vec::new(),
                })?;
                (FramePixels::Bits8(pixels), truths)
            }
            Depth::Bits16 => {
                let (pixels, truths) = self.filled(watch, |frame| match frame {
                    Frame::Gray16(picture) => picture.into_pixels(),
                    Frame::Gray8(_) => Vec::new(),
                })?;
                (FramePixels::Bits16(pixels), truths)
            }
        })
    }

    fn filled<P: Copy + Default + Send>(
        &self,
        watch: &(dyn Fn(u64, u64) -> bool + Sync),
        of: impl Fn(Frame) -> Vec<P> + Sync,
    ) -> Result<(Vec<P>, Vec<Truth>), ImagesError> {
        let [width, height] = self.plan.size_px;
        let one = width.saturating_mul(height);
        let count = self.len().saturating_mul(one);
        let too_many = || ImagesError::TooMany {
            frames: self.len(),
            width,
            height,
            bytes: (count as u64).saturating_mul(size_of::<P>() as u64),
            most: MOST_BYTES,
        };
        let mut pixels = Vec::new();
        if (count as u64).saturating_mul(size_of::<P>() as u64) > MOST_BYTES
            || pixels.try_reserve_exact(count).is_err()
        {
            return Err(too_many());
        }
        pixels.resize(count, P::default());
        let all = self.len() as u64;
        let truths: Vec<Result<Truth, ImagesError>> = pixels
            .par_chunks_mut(one.max(1))
            .enumerate()
            .with_max_len(1)
            .map(|(index, place)| {
                if !watch(0, all) {
                    return Err(ImagesError::Stopped);
                }
                let simulated = self.frame(index + 1)?;
                let found = of(simulated.frame);
                if found.len() == place.len() {
                    place.copy_from_slice(&found);
                }
                watch(1, all);
                Ok(simulated.truth)
            })
            .collect();
        // The first of several failures is the one to report, whichever thread was first.
        Ok((pixels, truths.into_iter().collect::<Result<_, _>>()?))
    }

    /// Where the target's corners are seen: upper left, upper right, lower right, lower left \[px\].
    ///
    /// # Errors
    /// [`SpotError`] names a number that makes no sense.
    pub fn corners_px(&self) -> Result<[[f64; 2]; 4], SpotError> {
        Ok(self.scene.truth(0)?.corners_px)
    }

    /// The lens, if it distorts.
    #[must_use]
    pub fn lens(&self) -> Option<&Lens> {
        self.lens.as_ref()
    }

    /// Writes where the spots truly are, as `truth.csv` has it.
    ///
    /// # Errors
    /// [`IoError`] if it cannot be written; there is then no file.
    pub fn write_truth(
        &self,
        destination: Destination,
        format: Format,
        truths: &[Truth],
    ) -> Result<(), IoError> {
        let files: Vec<String> = (1..=truths.len()).map(name).collect();
        let number = |of: fn(&helio_spot::simulate::BeamTruth) -> f64| -> Vec<f64> {
            truths
                .iter()
                .map(|truth| truth.beam.as_ref().map_or(f64::NAN, of))
                .collect()
        };
        let (u_m, v_m) = (number(|b| b.u_m), number(|b| b.v_m));
        let (x_px, y_px) = (number(|b| b.x_px), number(|b| b.y_px));
        let share = number(|b| b.share_on_target);
        let seen_u_m = number(|b| b.on_target_m.map_or(f64::NAN, |at| at[0]));
        let seen_v_m = number(|b| b.on_target_m.map_or(f64::NAN, |at| at[1]));
        let columns = [
            ("file", Cells::Text(&files)),
            ("u_m", Cells::Numbers(&u_m)),
            ("v_m", Cells::Numbers(&v_m)),
            ("x_px", Cells::Numbers(&x_px)),
            ("y_px", Cells::Numbers(&y_px)),
            ("share_on_target", Cells::Numbers(&share)),
            ("on_target_u_m", Cells::Numbers(&seen_u_m)),
            ("on_target_v_m", Cells::Numbers(&seen_v_m)),
        ];
        write_columns(destination, format, &columns)?;
        Ok(())
    }

    /// Writes the table of observations with the frames' names in place of the spots, as `log.csv` has it; nothing
    /// where there is no such table.
    ///
    /// # Errors
    /// [`IoError`] if it cannot be written; there is then no file.
    pub fn write_log(&self, destination: Destination, format: Format) -> Result<(), IoError> {
        let Some(log) = &self.log else { return Ok(()) };
        let files = self.names();
        let of_file = ("file", Cells::Text(&files));
        let others = log.columns.iter();
        let others = others.map(|(name, cells)| (name.as_str(), cells.cells()));
        let columns: Vec<_> = others.chain([of_file]).collect();
        write_columns(destination, format, &columns)?;
        Ok(())
    }
}

/// File of a frame.
pub(super) fn name(number: usize) -> String {
    format!("{number:06}.png")
}

/// What is the same in all frames.
fn scene(plan: &ImagePlan) -> Result<(Scene, Option<Lens>), ImagesError> {
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
