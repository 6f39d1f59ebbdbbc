//! Pictures as PNG files.

use std::io::Cursor;
use std::path::Path;

use helio_spot::Frame;
use image::codecs::png::{CompressionType, FilterType, PngEncoder};
use image::{ExtendedColorType, ImageEncoder};

use crate::IoError;
use crate::atomic::write_file;

/// Writes a gray frame as a PNG of 8 or 16 bit.
///
/// # Errors
/// [`IoError`] if it cannot be written; there is then no file.
///
/// ```
/// use helio_spot::{Frame, Limits, Picture, decode};
/// let folder = tempfile::tempdir()?;
/// let path = folder.path().join("a.png");
/// let frame = Frame::Gray16(Picture::new(vec![1, 2, 60_000, 4, 5, 6], 3, 2)?);
/// helio_io::write_frame(&path, &frame)?;
/// assert_eq!(decode(&std::fs::read(&path)?, &Limits::default())?, frame);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn write_frame(path: &Path, frame: &Frame) -> Result<(), IoError> {
    match frame {
        Frame::Gray8(picture) => {
            let view = picture.view();
            let bytes: Vec<u8> = view.rows().flatten().copied().collect();
            write(
                path,
                &bytes,
                view.width(),
                view.height(),
                ExtendedColorType::L8,
            )
        }
        Frame::Gray16(picture) => {
            let view = picture.view();
            // The encoder takes them as this machine has them and swaps as PNG wants.
            let bytes: Vec<u8> = view
                .rows()
                .flatten()
                .flat_map(|v| v.to_ne_bytes())
                .collect();
            write(
                path,
                &bytes,
                view.width(),
                view.height(),
                ExtendedColorType::L16,
            )
        }
    }
}

/// Writes a colour picture as a PNG of 8 bit: red, green, blue of each pixel, row by row.
///
/// # Errors
/// [`IoError`] if the pixels are not `width * height`, or it cannot be written; there is then no file.
pub fn write_rgb(path: &Path, rgb: &[[u8; 3]], width: usize, height: usize) -> Result<(), IoError> {
    write(
        path,
        rgb.as_flattened(),
        width,
        height,
        ExtendedColorType::Rgb8,
    )
}

fn write(
    path: &Path,
    bytes: &[u8],
    width: usize,
    height: usize,
    colour: ExtendedColorType,
) -> Result<(), IoError> {
    let refuse = |message: String| IoError::write(path, std::io::Error::other(message));
    let size = |pixels: usize| u32::try_from(pixels).map_err(|e| refuse(e.to_string()));
    let (width, height) = (size(width)?, size(height)?);
    let wanted = u128::from(width) * u128::from(height) * u128::from(colour.bits_per_pixel() / 8);
    if wanted != bytes.len() as u128 {
        return Err(refuse(format!(
            "{wanted} bytes of pixels wanted, found {}",
            bytes.len()
        )));
    }
    let mut file = Cursor::new(Vec::new());
    PngEncoder::new_with_quality(&mut file, CompressionType::Fast, FilterType::Sub)
        .write_image(bytes, width, height, colour)
        .map_err(|e| refuse(e.to_string()))?;
    write_file(path, file.get_ref())
}
