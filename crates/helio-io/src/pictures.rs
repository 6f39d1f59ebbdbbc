//! Pictures as PNG files.

use std::fs::File;
use std::io::{Cursor, Read, Seek, SeekFrom};
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

/// What tells our pictures of what was found from those of others: a text chunk of PNG ("Software: helio-rs spot --overlay"),
/// with its length before and its checksum behind.
const MARK: &[u8] = b"\x00\x00\x00\x20tEXtSoftware\0helio-rs spot --overlay\x28\x66\x55\x10";
/// Bytes of the chunk that ends a PNG.
const END: usize = 12;

/// Writes a picture of what was found in a frame, marked as one.
pub(crate) fn write_overlay(
    path: &Path,
    rgb: &[[u8; 3]],
    width: usize,
    height: usize,
) -> Result<(), IoError> {
    let mut bytes = encoded(
        path,
        rgb.as_flattened(),
        width,
        height,
        ExtendedColorType::Rgb8,
    )?;
    let end = bytes.len().saturating_sub(END);
    bytes.splice(end..end, MARK.iter().copied());
    write_file(path, &bytes)
}

/// True for a file that [`write_overlay`] wrote.
pub(crate) fn is_overlay(path: &Path) -> bool {
    let last = || -> std::io::Result<Vec<u8>> {
        let mut file = File::open(path)?;
        let mut bytes = vec![0; MARK.len() + END];
        file.seek(SeekFrom::End(-(bytes.len() as i64)))?;
        file.read_exact(&mut bytes)?;
        Ok(bytes)
    };
    last().is_ok_and(|bytes| bytes.starts_with(MARK))
}

fn write(
    path: &Path,
    bytes: &[u8],
    width: usize,
    height: usize,
    colour: ExtendedColorType,
) -> Result<(), IoError> {
    write_file(path, &encoded(path, bytes, width, height, colour)?)
}

fn encoded(
    path: &Path,
    bytes: &[u8],
    width: usize,
    height: usize,
    colour: ExtendedColorType,
) -> Result<Vec<u8>, IoError> {
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
    Ok(file.into_inner())
}

#[cfg(test)]
mod tests {
    use helio_spot::{Frame, Limits, decode};

    use super::*;

    #[test]
    fn pictures_of_what_was_found_are_known_again() {
        let folder = tempfile::tempdir().expect("a folder");
        let [ours, other] = ["ours.png", "other.png"].map(|name| folder.path().join(name));
        let rgb = [[10, 20, 30], [40, 50, 60]];
        write_overlay(&ours, &rgb, 2, 1).expect("written");
        write_rgb(&other, &rgb, 2, 1).expect("written");
        assert!(is_overlay(&ours) && !is_overlay(&other));
        assert!(!is_overlay(&folder.path().join("none.png")));
        // A reader that looks at checksums takes both for the same picture.
        let read = |path| -> Frame {
            let bytes = std::fs::read(path).expect("a file");
            decode(&bytes, &Limits::default()).expect("a picture")
        };
        assert_eq!(read(&ours), read(&other));
    }
}
