//! Frames from image files.

use std::cell::Cell;
use std::io::Cursor;
use std::panic;

use image::codecs::jpeg::JpegDecoder;
use image::codecs::png::PngDecoder;
use image::codecs::pnm::PnmDecoder;
use image::codecs::tiff::TiffDecoder;
use image::error::{ImageError, LimitErrorKind};
use image::{ColorType, ImageDecoder, ImageFormat};

use super::luma::{luma8, luma16};
use super::{Frame, Picture};

/// What a picture may cost, looked at before memory is taken.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub struct Limits {
    /// Pixels of a frame.
    pub max_pixels: u64,
    /// Bytes of the decoded samples, before colours become gray. The decoder may need as much again for itself,
    /// and for a progressive JPEG twice as much.
    pub max_bytes: u64,
}

impl Default for Limits {
    /// 64 million pixels, 512 MB.
    fn default() -> Self {
        Self {
            max_pixels: 64_000_000,
            max_bytes: 512_000_000,
        }
    }
}

impl Limits {
    /// The default for bytes, and this many pixels.
    #[must_use]
    pub fn with_max_pixels(max_pixels: u64) -> Self {
        Self {
            max_pixels,
            ..Self::default()
        }
    }

    /// Pixels of such a frame, if it is within the limits.
    pub(super) fn check(
        &self,
        width: u64,
        height: u64,
        bytes_per_pixel: u64,
    ) -> Result<usize, DecodeError> {
        if width == 0 || height == 0 {
            return Err(DecodeError::NoPixels { width, height });
        }
        let pixels = width.saturating_mul(height);
        if pixels > self.max_pixels {
            return Err(DecodeError::TooManyPixels {
                width,
                height,
                most: self.max_pixels,
            });
        }
        let bytes = pixels.saturating_mul(bytes_per_pixel);
        match usize::try_from(bytes) {
            Ok(_) if bytes <= self.max_bytes => Ok(pixels as usize),
            _ => Err(DecodeError::TooManyBytes {
                most: self.max_bytes,
            }),
        }
    }
}

/// Why bytes are not a frame.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum DecodeError {
    /// There is nothing.
    #[error("no bytes: expected a PNG, TIFF, PNM or JPEG image")]
    NoBytes,
    /// Not an image, whatever the file is called.
    #[error("not an image: expected PNG, TIFF, PNM or JPEG, found bytes that begin \"{begins}\"")]
    NotAnImage {
        /// The first few, escaped.
        begins: String,
    },
    /// An image of another format.
    #[error("a {format} image: expected PNG, TIFF, PNM or JPEG")]
    OtherFormat {
        /// Its usual suffix.
        format: &'static str,
    },
    /// An image without pixels.
    #[error("an image of {width} x {height} pixels: expected at least one")]
    NoPixels {
        /// Pixels in a row.
        width: u64,
        /// Rows.
        height: u64,
    },
    /// More pixels than [`Limits::max_pixels`].
    #[error("an image of {width} x {height} pixels: at most {most} pixels are read")]
    TooManyPixels {
        /// Pixels in a row.
        width: u64,
        /// Rows.
        height: u64,
        /// The limit.
        most: u64,
    },
    /// More memory than [`Limits::max_bytes`].
    #[error("an image that takes more than {most} bytes when decoded")]
    TooManyBytes {
        /// The limit.
        most: u64,
    },
    /// A file that holds several images: which one is meant?
    #[error("{format}: several images in one file: expected one")]
    SeveralImages {
        /// Its format.
        format: &'static str,
    },
    /// The end is missing.
    #[error("{format}: the file ends before the image does")]
    Truncated {
        /// Its format.
        format: &'static str,
    },
    /// A layout of samples that is not read, such as floating point.
    #[error("{format}: {what}: gray or colour of 8 or 16 bit is read")]
    Unsupported {
        /// Its format.
        format: &'static str,
        /// What was found.
        what: String,
    },
    /// Bytes against the format's rules.
    #[error("{format}: {what}")]
    Broken {
        /// Its format.
        format: &'static str,
        /// What was found.
        what: String,
    },
}

/// The frame in the bytes of a PNG, TIFF, PNM or JPEG file; the format is told by the bytes.
///
/// Gray of 8 and 16 bit stays as it is; PNG and PNM of fewer bits, and PNM whose white is another number, are
/// stretched to 8 or 16. Colours become gray as 0.299 R + 0.587 G + 0.114 B (BT.601), rounded, halves up; JPEG,
/// CMYK and palettes by way of RGB. Transparency is ignored, as are orientation tags and colour profiles. Of an
/// animated PNG the still picture is taken. Refused are TIFF files with several pictures, of floating point, with
/// palettes, or of 2 or 4 bit, and whatever the file is too short for. A decoder that panics is caught, and the
/// file counts as broken; the program's panic hook is asked first, see [`is_decoding`]. What a decoder says is told in
/// a line of at most 200 characters.
///
/// # Errors
/// [`DecodeError`]; beyond `limits` before memory is taken for the picture.
///
/// ```
/// use helio_spot::{Frame, Limits, decode};
/// let frame = decode(b"P5 2 1 255 \x07\xff", &Limits::default())?;
/// let Frame::Gray8(picture) = frame else { unreachable!() };
/// assert_eq!(picture.view().row(0), [7, 255]);
/// assert_eq!(
///     decode(b"no picture", &Limits::default()).unwrap_err().to_string(),
///     "not an image: expected PNG, TIFF, PNM or JPEG, found bytes that begin \"no picture\"",
/// );
/// # Ok::<(), helio_spot::DecodeError>(())
/// ```
pub fn decode(bytes: &[u8], limits: &Limits) -> Result<Frame, DecodeError> {
    let format = format_of(bytes)?;
    // Fuzzing found files at which decoders panic (png 0.18.1: a palette of one byte; zune-jpeg 0.5.15).
    DECODING.set(true);
    let read = panic::catch_unwind(|| decode_as(format, bytes, limits));
    DECODING.set(false);
    read.unwrap_or_else(|_| {
        Err(DecodeError::Broken {
            format: name_of(format),
            what: "the decoder gave up".to_owned(),
        })
    })
}

thread_local! {
    static DECODING: Cell<bool> = const { Cell::new(false) };
}

/// Whether this thread is within [`decode`], where panics are caught.
///
/// A library must not replace the panic hook of a program; a program whose hook asks this may keep silent about
/// panics that concern nobody:
///
/// ```
/// let hook = std::panic::take_hook();
/// std::panic::set_hook(Box::new(move |info| {
///     if !helio_spot::is_decoding() {
///         hook(info);
///     }
/// }));
/// ```
#[must_use]
pub fn is_decoding() -> bool {
    DECODING.get()
}

fn decode_as(format: ImageFormat, bytes: &[u8], limits: &Limits) -> Result<Frame, DecodeError> {
    let file = Cursor::new(bytes);
    let name = name_of(format);
    let refuse = |error| refused(name, limits, error);
    match format {
        ImageFormat::Png => {
            if let Some(header) = bytes
                .get(12..24)
                .and_then(|header| header.strip_prefix(b"IHDR"))
            {
                let (size, _) = header.as_chunks::<4>();
                let [width, height] = [0, 1].map(|k| u64::from(u32::from_be_bytes(size[k])));
                limits.check(width, height, 1)?;
            }
            let decoder = PngDecoder::with_limits(file, for_decoder(limits));
            read(name, decoder.map_err(refuse)?, limits)
        }
        ImageFormat::Jpeg => {
            // The decoder would fill in gray.
            let last_scan = bytes.windows(2).rposition(|two| two == [0xff, 0xda]);
            let data = bytes.get(last_scan.unwrap_or(0)..).unwrap_or_default();
            if !data.windows(2).any(|two| two == [0xff, 0xd9]) {
                return Err(DecodeError::Truncated { format: name });
            }
            let decoder = JpegDecoder::new(file);
            read(name, decoder.map_err(refuse)?, limits)
        }
        ImageFormat::Tiff => {
            if tiff_has_more(bytes) == Some(true) {
                return Err(DecodeError::SeveralImages { format: name });
            }
            let decoder = TiffDecoder::new(file);
            read(name, decoder.map_err(refuse)?, limits)
        }
        ImageFormat::Pnm => {
            let decoder = PnmDecoder::new(file);
            read(name, decoder.map_err(refuse)?, limits)
        }
        other => Err(DecodeError::OtherFormat {
            format: other.extensions_str().first().copied().unwrap_or("foreign"),
        }),
    }
}

const fn name_of(format: ImageFormat) -> &'static str {
    match format {
        ImageFormat::Png => "PNG",
        ImageFormat::Jpeg => "JPEG",
        ImageFormat::Tiff => "TIFF",
        ImageFormat::Pnm => "PNM",
        _ => "image",
    }
}

fn format_of(bytes: &[u8]) -> Result<ImageFormat, DecodeError> {
    if bytes.is_empty() {
        return Err(DecodeError::NoBytes);
    }
    // TIFF with 64-bit offsets
    if bytes.starts_with(b"II+\0") || bytes.starts_with(b"MM\0+") {
        return Ok(ImageFormat::Tiff);
    }
    image::guess_format(bytes).map_err(|_| DecodeError::NotAnImage {
        begins: bytes[..bytes.len().min(12)].escape_ascii().to_string(),
    })
}

fn for_decoder(limits: &Limits) -> image::Limits {
    let mut decoder = image::Limits::no_limits();
    decoder.max_alloc = Some(limits.max_bytes);
    decoder
}

fn read(
    format: &'static str,
    mut decoder: impl ImageDecoder,
    limits: &Limits,
) -> Result<Frame, DecodeError> {
    let refused = |error| refused(format, limits, error);
    let (width, height) = decoder.dimensions();
    let colour = decoder.color_type();
    let per_pixel = u64::from(colour.bytes_per_pixel());
    let pixels = limits.check(width.into(), height.into(), per_pixel)?;
    decoder.set_limits(for_decoder(limits)).map_err(refused)?;
    let mut samples = vec![0_u8; pixels * per_pixel as usize];
    decoder.read_image(&mut samples).map_err(refused)?;
    let (width, height) = (width as usize, height as usize);
    let gray = match colour {
        ColorType::L8 => Ok(samples),
        ColorType::La8 => Ok(first_of::<2, _>(&samples)),
        ColorType::Rgb8 => Ok(luma8::<3>(&samples)),
        ColorType::Rgba8 => Ok(luma8::<4>(&samples)),
        ColorType::L16 => Err(words(&samples)),
        ColorType::La16 => Err(first_of::<2, _>(&words(&samples))),
        ColorType::Rgb16 => Err(luma16::<3>(&words(&samples))),
        ColorType::Rgba16 => Err(luma16::<4>(&words(&samples))),
        other => {
            return Err(DecodeError::Unsupported {
                format,
                what: format!("samples of type {other:?}"),
            });
        }
    };
    let frame = match gray {
        Ok(gray) => Picture::new(gray, width, height).map(Frame::Gray8),
        Err(gray) => Picture::new(gray, width, height).map(Frame::Gray16),
    };
    frame.map_err(|error| DecodeError::Broken {
        format,
        what: error.to_string(),
    })
}

fn first_of<const N: usize, T: Copy>(samples: &[T]) -> Vec<T> {
    samples
        .as_chunks::<N>()
        .0
        .iter()
        .map(|pixel| pixel[0])
        .collect()
}

fn words(samples: &[u8]) -> Vec<u16> {
    let (words, _) = samples.as_chunks::<2>();
    words.iter().map(|&word| u16::from_ne_bytes(word)).collect()
}

fn refused(format: &'static str, limits: &Limits, error: ImageError) -> DecodeError {
    let what = match &error {
        ImageError::Decoding(error) => {
            std::error::Error::source(error).map_or_else(|| error.to_string(), ToString::to_string)
        }
        other => other.to_string(),
    };
    let what = in_short(&what);
    match error {
        ImageError::IoError(error) if error.kind() == std::io::ErrorKind::UnexpectedEof => {
            DecodeError::Truncated { format }
        }
        ImageError::Limits(error) if error.kind() == LimitErrorKind::InsufficientMemory => {
            DecodeError::TooManyBytes {
                most: limits.max_bytes,
            }
        }
        ImageError::Unsupported(_) => DecodeError::Unsupported { format, what },
        _ => DecodeError::Broken { format, what },
    }
}

/// On a line, and no longer than anybody reads: decoders quote from files.
fn in_short(text: &str) -> String {
    // With what stands around it at most 200.
    const MOST: usize = 140;
    let plain = |c: char| if c.is_control() { ' ' } else { c };
    let mut short: String = text.chars().take(MOST).map(plain).collect();
    if text.chars().nth(MOST).is_some() {
        short.pop();
        short.push('…');
    }
    short
}

/// Whether a second directory of tags follows the first; none where the file is too short to tell.
fn tiff_has_more(bytes: &[u8]) -> Option<bool> {
    let little = bytes.starts_with(b"II");
    let big = bytes.starts_with(b"II+") || bytes.starts_with(b"MM\0+");
    let number = |at: u64, size: u64| {
        let field = bytes
            .get(usize::try_from(at).ok()?..)?
            .get(..size as usize)?;
        let push = |number: u64, &byte: &u8| (number << 8) | u64::from(byte);
        Some(if little {
            field.iter().rev().fold(0, push)
        } else {
            field.iter().fold(0, push)
        })
    };
    // where the first directory's offset stands; size of an offset, of the count of tags, of a tag
    let (at, offset, count, tag) = if big { (8, 8, 8, 20) } else { (4, 4, 2, 12) };
    let first = number(at, offset)?;
    let tags = number(first, count)?;
    let end = tags
        .checked_mul(tag)?
        .checked_add(count)?
        .checked_add(first)?;
    Some(number(end, offset)? != 0)
}
