//! What was found in a frame, drawn into it.

use std::collections::HashSet;
use std::path::{Path, PathBuf};

use helio_spot::{Frame, Gray, Plane, View};

use super::SeenInFrame;
use crate::error::{IoError, Place, Problem};
use crate::pictures::{is_overlay, write_overlay};

const CORNERS: [u8; 3] = [0, 220, 255];
const HIDDEN: [u8; 3] = [255, 140, 0];
const EDGE: [u8; 3] = [0, 120, 255];
const OUTLINE: [u8; 3] = [255, 220, 0];
const WINDOW: [u8; 3] = [255, 0, 220];
const CENTRE: [u8; 3] = [255, 30, 30];
const SIGMA: [u8; 3] = [40, 255, 60];

/// A folder for pictures of what was found in frames.
///
/// ```
/// use helio_io::{OverlayFolder, SeenInFrame};
/// use helio_spot::View;
/// let there = tempfile::tempdir()?;
/// let folder = there.path().join("seen");
/// let overlay = OverlayFolder::new(&folder, &["a/7.png".into(), "b/8.png".into()], &[])?;
/// assert_eq!(overlay.path(1), folder.join("8.png"));
/// let gray = [90_u8; 80 * 60];
/// overlay.write(0, View::new(&gray, 80, 60)?, &SeenInFrame::default())?;
/// assert!(folder.join("7.png").exists());
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct OverlayFolder {
    folder: PathBuf,
    /// Name of each file without its suffix; none for video.
    stems: Vec<String>,
    /// Whether frames are numbered because names stand several times.
    numbered: bool,
}

/// Why a folder is none for pictures of what was found.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum OverlayError {
    /// There is a file of that name.
    #[error("{} is a file; wanted a folder for the pictures", folder.display())]
    NoFolder {
        /// What was named.
        folder: PathBuf,
    },
    /// A frame would be replaced by what is drawn over it.
    #[error("{} is a frame that this run reads; wanted another folder", path.display())]
    OverFrame {
        /// The frame.
        path: PathBuf,
    },
    /// A file would be replaced that no earlier run drew.
    #[error("{} is there already, and spot did not draw it; wanted another folder", path.display())]
    NotOurs {
        /// The file.
        path: PathBuf,
    },
    /// It cannot be made.
    #[error(transparent)]
    Io(#[from] IoError),
}

impl OverlayFolder {
    /// A folder, made if it does not exist, for pictures named as these files are without their suffixes, with their place
    /// in front where names stand several times; `frame-000000.png` and so on where no file is named. None of them may
    /// be one of `inputs`; what is there already and was not drawn by an earlier run is not replaced.
    ///
    /// # Errors
    /// [`OverlayError`].
    pub fn new(folder: &Path, files: &[PathBuf], inputs: &[PathBuf]) -> Result<Self, OverlayError> {
        let stem = |path: &PathBuf| {
            let stem = path.file_stem().unwrap_or(path.as_os_str());
            stem.to_string_lossy().into_owned()
        };
        let stems: Vec<String> = files.iter().map(stem).collect();
        let different: HashSet<&String> = stems.iter().collect();
        let overlay = Self {
            folder: folder.to_path_buf(),
            numbered: different.len() < stems.len(),
            stems,
        };
        let folder = folder.to_path_buf();
        if folder.exists() && !folder.is_dir() {
            return Err(OverlayError::NoFolder { folder });
        }
        std::fs::create_dir_all(&folder).map_err(|error| IoError::write(&folder, error))?;
        let inputs = inputs.iter().filter_map(|p| p.canonicalize().ok());
        let inputs: HashSet<PathBuf> = inputs.collect();
        for path in (0..overlay.stems.len()).map(|index| overlay.path(index)) {
            let there = path.canonicalize();
            if there.is_ok_and(|there| inputs.contains(&there)) {
                return Err(OverlayError::OverFrame { path });
            }
            if path.symlink_metadata().is_ok() && !is_overlay(&path) {
                return Err(OverlayError::NotOurs { path });
            }
        }
        Ok(overlay)
    }

    /// The picture of the frame of this place in the list.
    #[must_use]
    pub fn path(&self, index: usize) -> PathBuf {
        let name = match self.stems.get(index) {
            None => format!("frame-{index:06}.png"),
            Some(stem) if self.numbered => format!("{index:06}-{stem}.png"),
            Some(stem) => format!("{stem}.png"),
        };
        self.folder.join(name)
    }

    /// Draws what was seen into a copy of a frame and writes it as PNG: marks, what counted as light, window and centre.
    ///
    /// # Errors
    /// [`IoError`] if it cannot be written; there is then no file.
    pub fn write<P: Gray>(
        &self,
        index: usize,
        view: View<'_, P>,
        seen: &SeenInFrame,
    ) -> Result<(), IoError> {
        let path = self.path(index);
        // Of video nobody knows before how many there will be.
        if self.stems.is_empty() && path.symlink_metadata().is_ok() && !is_overlay(&path) {
            let message = OverlayError::NotOurs { path: path.clone() }.to_string();
            let problem = Problem::Conflict { message };
            return Err(IoError::new(Place::default(), problem));
        }
        let canvas = drawn(view, seen);
        write_overlay(&path, &canvas.pixels, canvas.width, canvas.height)
    }

    /// The same for a frame of 8 or 16 bit.
    ///
    /// # Errors
    /// As [`write`](Self::write).
    pub fn write_frame(
        &self,
        index: usize,
        frame: &Frame,
        seen: &SeenInFrame,
    ) -> Result<(), IoError> {
        match frame {
            Frame::Gray8(picture) => self.write(index, picture.view(), seen),
            Frame::Gray16(picture) => self.write(index, picture.view(), seen),
        }
    }
}

fn drawn<P: Gray>(view: View<'_, P>, seen: &SeenInFrame) -> Canvas {
    let deep = P::WHITE > u32::from(u8::MAX);
    let mut canvas = Canvas::new(view, |gray| if deep { gray >> 8 } else { gray });
    if let Some((threshold, within)) = seen.threshold {
        canvas.outline(view, threshold, within);
    }
    for &[from, to] in &seen.outline_px {
        canvas.line(from, to, OUTLINE);
    }
    if let Some(plane) = &seen.plane {
        let corners = plane.corners();
        for (i, &at) in corners.at_px.iter().enumerate() {
            canvas.line(at, corners.at_px[(i + 1) % 4], EDGE);
        }
        for (&at, &seen) in corners.at_px.iter().zip(&corners.seen) {
            canvas.cross(at, 0.0, 12.0, if seen { CORNERS } else { HIDDEN });
        }
    }
    if let Some([left, top, right, bottom]) = seen.window {
        let around = [[left, top], [right, top], [right, bottom], [left, bottom]];
        for (i, &at) in around.iter().enumerate() {
            canvas.line(at, around[(i + 1) % 4], WINDOW);
        }
    }
    if let Some(at) = seen.centre {
        canvas.cross(at, 3.0, 14.0, CENTRE);
        if let (Some(plane), Some(covariance_m2)) = (&seen.plane, seen.covariance_m2) {
            canvas.ellipse(plane, at, covariance_m2);
        }
    }
    canvas
}

struct Canvas {
    pixels: Vec<[u8; 3]>,
    width: usize,
    height: usize,
}

impl Canvas {
    fn new<P: Gray>(view: View<'_, P>, byte: impl Fn(u32) -> u32) -> Self {
        let pixels = view
            .rows()
            .flatten()
            .map(|&gray| [byte(gray.into()).min(255) as u8; 3])
            .collect();
        Self {
            pixels,
            width: view.width(),
            height: view.height(),
        }
    }

    fn set(&mut self, x_px: f64, y_px: f64, colour: [u8; 3]) {
        let (x, y) = (x_px.round(), y_px.round());
        if x >= 0.0 && y >= 0.0 && x < self.width as f64 && y < self.height as f64 {
            self.pixels[y as usize * self.width + x as usize] = colour;
        }
    }

    /// A line of two pixels' width.
    fn line(&mut self, from: [f64; 2], to: [f64; 2], colour: [u8; 3]) {
        // What is far outside the picture need not be walked along.
        let far = 4.0 * (self.width + self.height) as f64;
        if !from.iter().chain(&to).all(|c| c.abs() < far) {
            return;
        }
        let (dx, dy) = (to[0] - from[0], to[1] - from[1]);
        let steps = dx.abs().max(dy.abs()).ceil().max(1.0);
        let (wide, high) = if dx.abs() > dy.abs() {
            (0.0, 1.0)
        } else {
            (1.0, 0.0)
        };
        for i in 0..=steps as usize {
            let t = i as f64 / steps;
            let (x, y) = (from[0] + t * dx, from[1] + t * dy);
            self.set(x, y, colour);
            self.set(x + wide, y + high, colour);
        }
    }

    /// Four arms from `inner` to `outer` pixels away.
    fn cross(&mut self, [x, y]: [f64; 2], inner: f64, outer: f64, colour: [u8; 3]) {
        for (dx, dy) in [(1.0, 0.0), (-1.0, 0.0), (0.0, 1.0), (0.0, -1.0)] {
            self.line(
                [x + inner * dx, y + inner * dy],
                [x + outer * dx, y + outer * dy],
                colour,
            );
        }
    }

    /// Ellipse of one standard deviation about the centre.
    fn ellipse(&mut self, plane: &Plane, at: [f64; 2], [[uu, uv], [_, vv]]: [[f64; 2]; 2]) {
        let Some([u_m, v_m]) = plane.to_target(at) else {
            return;
        };
        // L with L Lᵀ = the covariance.
        let a = uu.max(0.0).sqrt();
        let b = if a > 0.0 { uv / a } else { 0.0 };
        let c = (vv - b * b).max(0.0).sqrt();
        const SIDES: usize = 64;
        let place = |i: usize| {
            let (sine, cosine) = (std::f64::consts::TAU * i as f64 / SIDES as f64).sin_cos();
            plane.to_pixels([u_m + a * cosine, v_m + b * cosine + c * sine])
        };
        for i in 0..SIDES {
            if let (Some(from), Some(to)) = (place(i), place(i + 1)) {
                self.line(from, to, SIGMA);
            }
        }
    }

    /// The edge of what is as bright as the threshold (means of 5 x 5 pixels, so that noise leaves no islands).
    fn outline<P: Gray>(&mut self, view: View<'_, P>, threshold: f64, within: [f64; 4]) {
        let clamp = |c: f64, size: usize| c.round().clamp(0.0, size as f64 - 1.0) as usize;
        let (left, right) = (clamp(within[0], self.width), clamp(within[2], self.width));
        let (top, bottom) = (clamp(within[1], self.height), clamp(within[3], self.height));
        let (wide, high) = (right - left + 1, bottom - top + 1);
        let bright: Vec<bool> = (0..high)
            .flat_map(|row| (0..wide).map(move |column| (row, column)))
            .map(|(row, column)| {
                let rows = row.saturating_sub(2)..(row + 3).min(high);
                let columns = column.saturating_sub(2)..(column + 3).min(wide);
                let count = rows.len() * columns.len();
                let sum: u32 = rows
                    .map(|r| {
                        let part = &view.row(top + r)[left + columns.start..left + columns.end];
                        part.iter().map(|&gray| -> u32 { gray.into() }).sum::<u32>()
                    })
                    .sum();
                f64::from(sum) >= threshold * count as f64
            })
            .collect();
        for (index, _) in bright.iter().enumerate().filter(|(_, bright)| **bright) {
            let (row, column) = (index / wide, index % wide);
            let inner = row > 0
                && column > 0
                && row + 1 < high
                && column + 1 < wide
                && [index - 1, index + 1, index - wide, index + wide]
                    .iter()
                    .all(|&beside| bright[beside]);
            if !inner {
                self.set((left + column) as f64, (top + row) as f64, OUTLINE);
            }
        }
    }
}
