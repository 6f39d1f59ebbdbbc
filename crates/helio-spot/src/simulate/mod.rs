//! Synthetic camera frames whose truth is known.
//!
//! The light is laid out on the plane of the target: white panels with black marks under even or shaded
//! light, and beams on top. A camera then sees the plane pixel by pixel (edges by the share of the pixel that they
//! cover), blurs it, adds shot and read noise and rounds to its gray values. The same [`Scene`] and seed give
//! the same bits, whatever the number of threads.

mod beam;
mod board;
mod camera;
mod random;

use rayon::prelude::*;

use crate::error::SpotError;
use crate::image::{Frame, Picture};
use crate::target::{Board, Marks};
use beam::Light;
pub use beam::{Beam, BeamShape};
use board::Surface;
pub use camera::{Camera, Pose};
use random::Draws;

/// Streams of random numbers of one seed.
const NOISE: u64 = 1;
const WEAVE: u64 = 2;
const FACETS: u64 = 1 << 32;

/// What is in front of the camera, and the camera.
#[derive(Debug, Clone, PartialEq)]
pub struct Scene {
    /// The target and its marks; of a two-panel board the other panel is in the picture too.
    pub board: Board,
    /// Length of the arms of its marks \[m\].
    pub arm_m: f64,
    /// Width of their bars \[m\].
    pub bar_m: f64,
    /// White beyond the corners \[m\].
    pub margin_m: f64,
    /// Relative depth of the fabric's folds and weave; 0 for plain white.
    pub texture: f64,
    /// Light other than that of heliostats.
    pub daylight: Daylight,
    /// The beam whose centre is asked for; none: an empty target.
    pub beam: Option<Beam>,
    /// Further beams, and stray light.
    pub others: Vec<Beam>,
    /// What sees it.
    pub camera: Camera,
    /// What makes gray values of it.
    pub sensor: Sensor,
}

/// Light of the day on the plane.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Daylight {
    /// On white at the target's centre, in parts of what saturates the camera.
    pub level: f64,
    /// Relative change per metre to the right and down \[1/m\].
    pub gradient_per_m: [f64; 2],
    /// The edge of a shadow.
    pub shadow: Option<Shadow>,
}

/// A shadow with a straight edge.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Shadow {
    /// A place (u_m, v_m) on its edge.
    pub through_m: [f64; 2],
    /// Direction from the light into the shadow, from the right towards down \[rad\].
    pub into_rad: f64,
    /// Share of the daylight that it takes, 0 to 1.
    pub depth: f64,
    /// Width of the penumbra \[m\], more than 0.
    pub penumbra_m: f64,
}

/// From light to gray values.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Sensor {
    /// Of the gray values.
    pub depth: Depth,
    /// Standard deviation of the blur of optics and air \[px\].
    pub blur_px: f64,
    /// Electrons that white stands for: shot noise is the root of them. Infinite for none.
    pub white_electrons: f64,
    /// Standard deviation of the noise of reading, in parts of white.
    pub read_noise: f64,
}

/// Bits of a gray value.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Depth {
    /// 0 to 255.
    Bits8,
    /// 0 to 65535.
    Bits16,
}

/// A frame and what is true of it.
#[derive(Debug, Clone, PartialEq)]
pub struct SimulatedFrame {
    /// The picture.
    pub frame: Frame,
    /// What is true of it.
    pub truth: Truth,
}

/// What is true of a simulated frame.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Truth {
    /// Upper left, upper right, lower right, lower left corner of the target, x right and y down \[px\].
    pub corners_px: [[f64; 2]; 4],
    /// The beam asked for.
    pub beam: Option<BeamTruth>,
}

/// Where a beam truly is.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct BeamTruth {
    /// Centre of mass of all its light, also of what misses the target: right of the target's centre \[m\].
    pub u_m: f64,
    /// The same down \[m\].
    pub v_m: f64,
    /// Where (u_m, v_m) is seen, to the right \[px\].
    pub x_px: f64,
    /// Where (u_m, v_m) is seen, down \[px\].
    pub y_px: f64,
    /// Share of its light that falls on the target, 0 to 1.
    pub share_on_target: f64,
    /// Centre of mass (u_m, v_m) of the light that falls on the target (on its marks too); none where none does.
    pub on_target_m: Option<[f64; 2]>,
}

impl Scene {
    /// An even target in the middle of the picture of a camera that looks square at it from afar, all its panels
    /// within seven tenths of the picture; no beam.
    ///
    /// # Errors
    /// As [`Scene::render`].
    pub fn plain(board: Board, width_px: usize, height_px: usize) -> Result<Self, SpotError> {
        check_sizes(&board)?;
        let Board {
            width_m, height_m, ..
        } = board;
        let distance_m = 40.0 * width_m.max(height_m);
        // The other panel of a board of two is to be seen whole, whichever it is.
        let panels = if board.marks == Marks::FourCorners {
            1.0
        } else {
            3.0
        };
        let across = width_px as f64 / width_m;
        let px_per_m = 0.7 * across.min(height_px as f64 / (panels * height_m));
        let pose = Pose {
            distance_m,
            focal_px: (px_per_m * distance_m).max(1e-3),
            turn_rad: 0.0,
            tilt_rad: 0.0,
            roll_rad: 0.0,
        };
        Ok(Self {
            board,
            arm_m: 0.1 * width_m.min(height_m),
            bar_m: 0.02 * width_m.min(height_m),
            margin_m: 0.04 * width_m.min(height_m),
            texture: 0.0,
            daylight: Daylight {
                level: 0.5,
                gradient_per_m: [0.0, 0.0],
                shadow: None,
            },
            beam: None,
            others: Vec::new(),
            camera: Camera::of_pose(width_px, height_px, &pose)?,
            sensor: Sensor {
                depth: Depth::Bits8,
                blur_px: 0.7,
                white_electrons: 20_000.0,
                read_noise: 0.002,
            },
        })
    }

    /// What is true of its frames; facets depend on the seed.
    ///
    /// # Errors
    /// As [`Scene::render`].
    pub fn truth(&self, seed: u64) -> Result<Truth, SpotError> {
        self.check()?;
        let (right, bottom) = (0.5 * self.board.width_m, 0.5 * self.board.height_m);
        let corners_px = [
            [-right, -bottom],
            [right, -bottom],
            [right, bottom],
            [-right, bottom],
        ]
        .map(|[u_m, v_m]| self.camera.pixel(u_m, v_m));
        let beam = match &self.beam {
            None => None,
            Some(beam) => {
                let light = Light::new(beam, Draws::new(seed, FACETS))?;
                let all = light.within(light.reach_m);
                let on_target = light.within([-right, -bottom, right, bottom]);
                let [x_px, y_px] = self.camera.pixel(beam.u_m, beam.v_m);
                Some(BeamTruth {
                    u_m: beam.u_m,
                    v_m: beam.v_m,
                    x_px,
                    y_px,
                    share_on_target: if all.power > 0.0 {
                        (on_target.power / all.power).min(1.0)
                    } else {
                        0.0
                    },
                    on_target_m: on_target.centre_m,
                })
            }
        };
        Ok(Truth { corners_px, beam })
    }

    /// The frame that the camera takes, its noise and fabric drawn from the seed.
    ///
    /// # Errors
    /// [`SpotError`] names a number that makes no sense.
    ///
    /// ```
    /// use helio_spot::simulate::{Beam, BeamShape, Scene};
    /// use helio_spot::target::{Board, Marks};
    /// let board = Board { width_m: 8.0, height_m: 7.0, marks: Marks::FourCorners };
    /// let mut scene = Scene::plain(board, 160, 120)?;
    /// scene.beam = Some(Beam { shape: BeamShape::Gaussian { sigma_m: 0.6 }, u_m: 0.5, v_m: -0.2, peak: 0.3 });
    /// let seen = scene.render(1)?;
    /// let truth = seen.truth.beam.unwrap();
    /// assert!(truth.share_on_target > 0.999 && truth.x_px > 79.5);
    /// assert_eq!(seen, scene.render(1)?);
    /// # Ok::<(), helio_spot::SpotError>(())
    /// ```
    pub fn render(&self, seed: u64) -> Result<SimulatedFrame, SpotError> {
        let truth = self.truth(seed)?;
        let mut light = Vec::with_capacity(1 + self.others.len());
        for (i, beam) in self.beam.iter().chain(&self.others).enumerate() {
            // The beam asked for is the first stream, there or not.
            let stream = FACETS + i as u64 + u64::from(self.beam.is_none());
            light.push(Light::new(beam, Draws::new(seed, stream))?);
        }
        let surface = Surface::new(
            &self.board,
            (self.arm_m, self.bar_m),
            self.margin_m,
            self.texture,
            Draws::new(seed, WEAVE),
        );
        let (width, height) = (self.camera.width_px(), self.camera.height_px());
        let mut level = vec![0.0_f64; width * height];
        level
            .par_chunks_mut(width)
            .enumerate()
            .for_each(|(row, out)| self.row(row, &surface, &light, out));
        blur(&mut level, width, self.sensor.blur_px);
        let noise = Draws::new(seed, NOISE);
        let frame = match self.sensor.depth {
            Depth::Bits8 => {
                let gray = self.gray(&level, noise, 255.0, |value| value as u8);
                Frame::Gray8(Picture::new(gray, width, height)?)
            }
            Depth::Bits16 => {
                let gray = self.gray(&level, noise, 65_535.0, |value| value as u16);
                Frame::Gray16(Picture::new(gray, width, height)?)
            }
        };
        Ok(SimulatedFrame { frame, truth })
    }

    /// Light that a row of pixels gets \[parts of white\].
    fn row(&self, row: usize, surface: &Surface, beams: &[Light], out: &mut [f64]) {
        let y_px = row as f64;
        let place = |x_px: f64, y_px: f64| self.camera.place(x_px, y_px).ok();
        for (column, out) in out.iter_mut().enumerate() {
            let x_px = column as f64;
            let here = place(x_px, y_px);
            let steps = (place(x_px + 0.5, y_px), place(x_px - 0.5, y_px));
            let down = (place(x_px, y_px + 0.5), place(x_px, y_px - 0.5));
            // What the lens cannot show stays dark.
            let (Some(at_m), (Some(a), Some(b)), (Some(c), Some(d))) = (here, steps, down) else {
                continue;
            };
            let steps_m = [[a[0] - b[0], a[1] - b[1]], [c[0] - d[0], c[1] - d[1]]];
            let mut light = self.daylight.at(at_m);
            for beam in beams {
                light += beam.at(at_m[0], at_m[1]);
            }
            *out = light * surface.over_pixel(at_m, steps_m);
        }
    }

    /// Gray values with noise.
    fn gray<P: Send>(
        &self,
        level: &[f64],
        noise: Draws,
        white: f64,
        pixel: impl Fn(f64) -> P + Sync,
    ) -> Vec<P> {
        let Sensor {
            white_electrons,
            read_noise,
            ..
        } = self.sensor;
        level
            .par_iter()
            .enumerate()
            .map(|(i, &level)| {
                let sigma = libm::sqrt(level / white_electrons + read_noise * read_noise);
                let read = if sigma > 0.0 {
                    level + sigma * noise.normal(i as u64)
                } else {
                    level
                };
                pixel(libm::round((read * white).clamp(0.0, white)))
            })
            .collect()
    }

    fn check(&self) -> Result<(), SpotError> {
        check_sizes(&self.board)?;
        let least_m = self.board.width_m.min(self.board.height_m);
        let ranges = [
            (
                "arm_m",
                "in 0..=half of the target's lesser side",
                self.arm_m,
                0.5 * least_m,
            ),
            ("bar_m", "in 0..=arm_m", self.bar_m, self.arm_m),
            ("margin_m", "in 0..=1e4", self.margin_m, 1e4),
            ("texture", "in 0..=1", self.texture, 1.0),
            (
                "level of the daylight",
                "in 0..=1e6",
                self.daylight.level,
                1e6,
            ),
            ("blur_px", "in 0..=20", self.sensor.blur_px, 20.0),
            ("read_noise", "in 0..=1", self.sensor.read_noise, 1.0),
        ];
        for (what, wanted, value, most) in ranges {
            if !(0.0..=most).contains(&value) {
                return Err(SpotError::BadOption {
                    what,
                    wanted,
                    value,
                });
            }
        }
        let option = |what, wanted, value| {
            Err(SpotError::BadOption {
                what,
                wanted,
                value,
            })
        };
        if self.sensor.white_electrons.is_nan() || self.sensor.white_electrons < 1.0 {
            return option("white_electrons", "1 or more", self.sensor.white_electrons);
        }
        for value in self.daylight.gradient_per_m {
            if !(-1e3..=1e3).contains(&value) {
                return option("gradient_per_m", "in -1e3..=1e3", value);
            }
        }
        if let Some(shadow) = &self.daylight.shadow {
            if !(0.0..=1.0).contains(&shadow.depth) {
                return option("depth of the shadow", "in 0..=1", shadow.depth);
            }
            if !(1e-6..=1e4).contains(&shadow.penumbra_m) {
                return option("penumbra_m", "in 1e-6..=1e4", shadow.penumbra_m);
            }
            for value in [shadow.into_rad, shadow.through_m[0], shadow.through_m[1]] {
                if !value.is_finite() {
                    return option("place and direction of the shadow", "finite", value);
                }
            }
        }
        Ok(())
    }
}

fn check_sizes(board: &Board) -> Result<(), SpotError> {
    for (what, value) in [("width_m", board.width_m), ("height_m", board.height_m)] {
        if !(1e-2..=1e4).contains(&value) {
            return Err(SpotError::BadOption {
                what,
                wanted: "in 0.01..=10000",
                value,
            });
        }
    }
    Ok(())
}

impl Daylight {
    fn at(&self, [u_m, v_m]: [f64; 2]) -> f64 {
        let [right, down] = self.gradient_per_m;
        let light = self.level * (1.0 + right * u_m + down * v_m).max(0.0);
        let Some(shadow) = &self.shadow else {
            return light;
        };
        let (sine, cosine) = libm::sincos(shadow.into_rad);
        let into_m = cosine * (u_m - shadow.through_m[0]) + sine * (v_m - shadow.through_m[1]);
        let t = (into_m / shadow.penumbra_m + 0.5).clamp(0.0, 1.0);
        light * (1.0 - shadow.depth * t * t * (3.0 - 2.0 * t))
    }
}

/// Gaussian blur along rows, then along columns; the picture goes on beyond its edges as it ends there.
fn blur(level: &mut [f64], width: usize, sigma_px: f64) {
    if sigma_px <= 0.0 {
        return;
    }
    let reach = libm::ceil(4.0 * sigma_px) as usize;
    let mut weights: Vec<f64> = (0..=reach)
        .map(|k| {
            let z = k as f64 / sigma_px;
            libm::exp(-0.5 * z * z)
        })
        .collect();
    let sum = weights[0] + 2.0 * weights[1..].iter().sum::<f64>();
    for weight in &mut weights {
        *weight /= sum;
    }
    let rows = level.len() / width;
    let (last_column, last_row) = (width - 1, rows - 1);
    let mut across = vec![0.0; level.len()];
    across
        .par_chunks_mut(width)
        .zip(level.par_chunks(width))
        .for_each(|(out, row)| {
            for (column, out) in out.iter_mut().enumerate() {
                let mut sum = weights[0] * row[column];
                for (k, &weight) in weights.iter().enumerate().skip(1) {
                    let left = row[column.saturating_sub(k)];
                    sum += weight * (left + row[(column + k).min(last_column)]);
                }
                *out = sum;
            }
        });
    level
        .par_chunks_mut(width)
        .enumerate()
        .for_each(|(row, out)| {
            let of = |row: usize| &across[row * width..(row + 1) * width];
            for (out, &middle) in out.iter_mut().zip(of(row)) {
                *out = weights[0] * middle;
            }
            for (k, &weight) in weights.iter().enumerate().skip(1) {
                let (above, below) = (of(row.saturating_sub(k)), of((row + k).min(last_row)));
                for ((out, &a), &b) in out.iter_mut().zip(above).zip(below) {
                    *out += weight * (a + b);
                }
            }
        });
}

#[cfg(test)]
mod tests;
