//! A camera's gray values, and the flux of a picture in bins of the target that it shows.

use std::io::Read;
use std::path::{Path, PathBuf};

use helio_spot::{Frame, Limits, Plane, decode};

use crate::{CameraTarget, IoError};

/// No camera writes larger files \[bytes\].
const MOST_BYTES: u64 = 1 << 30;
/// Columns of the grid that a target in a picture is cut into.
const COLUMNS: usize = 100;
/// Points along each side of such a bin.
const POINTS: usize = 4;

/// Why a file is no picture.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum PictureError {
    /// It cannot be read.
    #[error(transparent)]
    Unreadable(#[from] IoError),
    /// It is none, or larger than any.
    #[error("{}: {message}", path.display())]
    NoPicture {
        /// The file.
        path: PathBuf,
        /// What is wrong with it.
        message: String,
    },
}

/// Gray values of a picture, row by row from the top.
#[derive(Debug, Clone, PartialEq)]
pub struct GrayPicture {
    /// Rows of pixels.
    pub rows: usize,
    /// Columns of pixels.
    pub columns: usize,
    /// The values.
    pub gray: Vec<f64>,
    /// The greatest that its format can hold.
    pub most: f64,
}

impl GrayPicture {
    /// Reads a frame of a camera; colours become gray.
    ///
    /// # Errors
    /// [`PictureError`].
    pub fn read(path: &Path) -> Result<Self, PictureError> {
        let mut bytes = Vec::new();
        std::fs::File::open(path)
            .and_then(|file| file.take(MOST_BYTES + 1).read_to_end(&mut bytes))
            .map_err(|error| IoError::read(path, error))?;
        let refuse = |message: String| PictureError::NoPicture {
            path: path.to_owned(),
            message,
        };
        if bytes.len() as u64 > MOST_BYTES {
            return Err(refuse("more than 1 GiB of file".to_owned()));
        }
        let frame = decode(&bytes, &Limits::default());
        frame
            .map(Self::of)
            .map_err(|error| refuse(error.to_string()))
    }

    /// The gray values of a frame.
    ///
    /// ```
    /// use helio_io::GrayPicture;
    /// use helio_spot::{Frame, Picture};
    /// let frame = Frame::Gray8(Picture::new(vec![3, 250], 2, 1)?);
    /// let picture = GrayPicture::of(frame);
    /// assert_eq!((picture.rows, picture.columns, picture.most), (1, 2, 255.0));
    /// assert_eq!(picture.gray, [3.0, 250.0]);
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    #[must_use]
    pub fn of(frame: Frame) -> Self {
        let (columns, rows, gray, most) = match frame {
            Frame::Gray8(picture) => {
                let (width, height) = (picture.view().width(), picture.view().height());
                let gray = picture.into_pixels().into_iter().map(f64::from).collect();
                (width, height, gray, 255.0)
            }
            Frame::Gray16(picture) => {
                let (width, height) = (picture.view().width(), picture.view().height());
                let gray = picture.into_pixels().into_iter().map(f64::from).collect();
                (width, height, gray, 65_535.0)
            }
        };
        Self {
            rows,
            columns,
            gray,
            most,
        }
    }
}

/// The flux on a target as a picture shows it, in bins of the target: rows from its upper edge down, columns from its
/// left edge as the camera sees it.
#[derive(Debug, Clone, PartialEq)]
pub struct TargetFlux {
    /// Rows of bins.
    pub rows: usize,
    /// Columns of bins.
    pub columns: usize,
    /// Width and height of the target \[m\].
    pub size_m: [f64; 2],
    /// Irradiance of each bin \[W/m²\], row by row; NaN where the picture does not show it.
    pub flux_w_m2: Vec<f64>,
}

impl TargetFlux {
    /// Means over bins of a picture in W/m² of so many rows and columns of pixels.
    ///
    /// # Errors
    /// In words: a picture of another size than the target was measured in, a target whose corners are not known, and one
    /// that the picture does not show.
    pub fn of(
        target: &CameraTarget,
        [rows_px, columns_px]: [usize; 2],
        flux_w_m2: &[f64],
    ) -> Result<Self, String> {
        if let Some(reason) = target.refuses_size(columns_px, rows_px) {
            return Err(reason);
        }
        let Some(plane) = &target.plane else {
            return Err(
                "the target's corners are not known; wanted corners_px in target.toml".to_owned(),
            );
        };
        let size_m = [target.board.width_m, target.board.height_m];
        let rows = (COLUMNS as f64 * size_m[1] / size_m[0]).round();
        let rows = rows.clamp(1.0, 10_000.0) as usize;
        let mut seen = Self {
            rows,
            columns: COLUMNS,
            size_m,
            flux_w_m2: Vec::with_capacity(rows * COLUMNS),
        };
        let picture = Pixels {
            rows: rows_px,
            columns: columns_px,
            flux_w_m2,
        };
        for bin in 0..rows * COLUMNS {
            let mean = seen.mean_of(bin, plane, &picture);
            seen.flux_w_m2.push(mean);
        }
        if seen.flux_w_m2.iter().all(|flux| flux.is_nan()) {
            return Err("the picture does not show the target".to_owned());
        }
        Ok(seen)
    }

    /// Mean over points of a bin, each as the pixel that shows it.
    fn mean_of(&self, bin: usize, plane: &Plane, picture: &Pixels<'_>) -> f64 {
        let (row, column) = (bin / self.columns, bin % self.columns);
        let mut sum = 0.0;
        for point in 0..POINTS * POINTS {
            let part = |k: usize| (k as f64 + 0.5) / POINTS as f64;
            let across = (column as f64 + part(point % POINTS)) / self.columns as f64;
            let down = (row as f64 + part(point / POINTS)) / self.rows as f64;
            let at_m = [
                (across - 0.5) * self.size_m[0],
                (down - 0.5) * self.size_m[1],
            ];
            let Some([x, y]) = plane.to_pixels(at_m) else {
                return f64::NAN;
            };
            let (x, y) = (x.round(), y.round());
            let inside =
                x >= 0.0 && y >= 0.0 && x < picture.columns as f64 && y < picture.rows as f64;
            if !inside {
                return f64::NAN;
            }
            sum += picture.flux_w_m2[y as usize * picture.columns + x as usize];
        }
        sum / (POINTS * POINTS) as f64
    }

    /// Where the middle of a bin is \[m\]: right and down from the target's centre.
    #[must_use]
    pub fn uv_m(&self, bin: usize) -> [f64; 2] {
        let part = |k: usize, count: usize| (k as f64 + 0.5) / count as f64 - 0.5;
        [
            part(bin % self.columns, self.columns) * self.size_m[0],
            part(bin / self.columns, self.rows) * self.size_m[1],
        ]
    }

    /// Area of a bin \[m²\].
    #[must_use]
    pub fn bin_m2(&self) -> f64 {
        self.size_m[0] * self.size_m[1] / (self.rows * self.columns) as f64
    }

    /// Bins that the picture shows, and their flux \[W/m²\].
    pub fn known(&self) -> impl Iterator<Item = (usize, f64)> {
        let all = self.flux_w_m2.iter().copied().enumerate();
        all.filter(|(_, flux)| !flux.is_nan())
    }
}

/// A picture in W/m².
struct Pixels<'a> {
    rows: usize,
    columns: usize,
    flux_w_m2: &'a [f64],
}
