//! Maps of many cells as an embedded PNG.

use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use image::codecs::png::{CompressionType, FilterType, PngEncoder};
use image::{ExtendedColorType, ImageEncoder};

use crate::FigureError;
use crate::svg::{Figure, Short};

/// Cells up to which a map is drawn one by one.
pub(super) const DRAWN: usize = 2500;
/// Sides of a raster \[px\]: what is coarser is repeated, what is finer averaged before.
pub(super) const FINEST: usize = 1200;

/// Pixels in rows from the upper left.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Raster {
    width: usize,
    height: usize,
    rgb: Vec<u8>,
}

impl Raster {
    /// Each pixel by its row and column.
    pub(super) fn new(
        width: usize,
        height: usize,
        mut colour: impl FnMut(usize, usize) -> [u8; 3],
    ) -> Self {
        let mut rgb = Vec::with_capacity(width * height * 3);
        for row in 0..height {
            for column in 0..width {
                rgb.extend(colour(row, column));
            }
        }
        Self { width, height, rgb }
    }

    /// Each cell as so many pixels that programs that smooth pictures when they enlarge them show cells still.
    pub(super) fn repeated(self) -> Self {
        let [x, y] = [self.width, self.height].map(|side| (FINEST / side).clamp(1, 16));
        let pixel = |row: usize, column: usize| {
            let at = 3 * (row / y * self.width + column / x);
            [self.rgb[at], self.rgb[at + 1], self.rgb[at + 2]]
        };
        Self::new(self.width * x, self.height * y, pixel)
    }

    /// Adds it to a figure as an image that needs no file.
    pub(super) fn draw(
        &self,
        figure: &mut Figure,
        (x, y): (f64, f64),
        (width, height): (f64, f64),
    ) -> Result<(), FigureError> {
        let mut png = Vec::new();
        let encoder =
            PngEncoder::new_with_quality(&mut png, CompressionType::Best, FilterType::NoFilter);
        let side = |pixels: usize| u32::try_from(pixels).unwrap_or(u32::MAX);
        encoder
            .write_image(
                &self.rgb,
                side(self.width),
                side(self.height),
                ExtendedColorType::Rgb8,
            )
            .map_err(|error| FigureError::Pixels {
                why: error.to_string(),
            })?;
        let (x, y, width, height) = (Short(x), Short(y), Short(width), Short(height));
        figure.raw(format_args!(
            "<image x=\"{x}\" y=\"{y}\" width=\"{width}\" height=\"{height}\" preserveAspectRatio=\"none\" \
             style=\"image-rendering:pixelated\" href=\"data:image/png;base64,{}\"/>",
            STANDARD.encode(&png)
        ));
        Ok(())
    }
}
