//! Synthetic camera frames of a target, with their truth.

use std::path::PathBuf;

use helio_calib::random::Random;
use helio_spot::simulate::{Beam, Depth, Scene, SimulatedFrame, Truth};
use helio_spot::{Frame, Lens, LensError, SpotError};
use rayon::prelude::*;

use super::image_plan::{ImagePlan, scene};
use crate::output::{Cells, Destination, Format, write_columns};
use crate::{IoError, ObservationLog};

/// Most bytes of pixels that are kept in memory.
const MOST_BYTES: u64 = 1 << 32;

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

#[cfg(test)]
mod tests {
    use super::*;

    fn plan(frames: u32, size_px: [usize; 2]) -> ImagePlan {
        ImagePlan {
            frames,
            size_px,
            ..ImagePlan::default()
        }
    }

    /// Each is the frame of its number, of either depth, and the same on one thread as on several.
    #[test]
    fn frames_in_memory_are_those_made_one_by_one() {
        let pool = |threads| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads);
            pool.build().unwrap()
        };
        for depth in [Depth::Bits8, Depth::Bits16] {
            let plan = ImagePlan {
                depth,
                second: 0.3,
                empty_every: Some(2),
                ..plan(5, [31, 22])
            };
            let images = SimulatedImages::new(plan).unwrap();
            let of = |threads| pool(threads).install(|| images.pixels(&|_, _| true).unwrap());
            let (pixels, truths) = of(3);
            assert_eq!(of(1), (pixels.clone(), truths.clone()));
            let mut wanted = (Vec::new(), Vec::new());
            for (number, truth) in (1..=5).zip(&truths) {
                let made = images.frame(number).unwrap();
                assert_eq!(made.truth, *truth);
                assert_eq!(truth.beam.is_none(), number % 2 == 0);
                match made.frame {
                    Frame::Gray8(picture) => wanted.0.extend(picture.into_pixels()),
                    Frame::Gray16(picture) => wanted.1.extend(picture.into_pixels()),
                }
            }
            assert_eq!(
                pixels,
                match depth {
                    Depth::Bits8 => FramePixels::Bits8(wanted.0),
                    Depth::Bits16 => FramePixels::Bits16(wanted.1),
                }
            );
        }
    }

    #[test]
    fn more_than_memory_holds_is_refused_and_whoever_watches_ends_it() {
        let images = SimulatedImages::new(plan(1_000_000, [768, 576])).unwrap();
        let refused = images.pixels(&|_, _| true).unwrap_err().to_string();
        assert!(
            refused.contains("442368000000 bytes; wanted at most 4294967296"),
            "{refused}"
        );
        let images = SimulatedImages::new(plan(3, [30, 20])).unwrap();
        assert!(matches!(
            images.pixels(&|_, _| false),
            Err(ImagesError::Stopped)
        ));
        let folder = tempfile::tempdir().unwrap();
        let stopped = images.write(folder.path(), &|_, _| false);
        assert!(matches!(stopped, Err(ImagesError::Stopped)));
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 0);
        // What an earlier call wrote is all there still.
        images.write(folder.path(), &|_, _| true).unwrap();
        let fewer = SimulatedImages::new(plan(1, [30, 20])).unwrap();
        let stopped = fewer.write(folder.path(), &|_, _| false);
        assert!(matches!(stopped, Err(ImagesError::Stopped)));
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 5);
    }
}
