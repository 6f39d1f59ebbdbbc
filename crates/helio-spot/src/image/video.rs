//! Frames from a stream of raw gray pixels.

use std::io::Read;

use super::decode::{DecodeError, Limits};
use super::{Frame, Picture};

/// How the pixels of raw video are stored, row by row without gaps.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum RawFormat {
    /// A byte each, ffmpeg's `gray`.
    Gray8,
    /// Two bytes each, the low one first, ffmpeg's `gray16le`.
    Gray16Le,
}

impl RawFormat {
    const fn bytes(self) -> u64 {
        match self {
            Self::Gray8 => 1,
            Self::Gray16Le => 2,
        }
    }
}

/// Why a stream gives no further frame.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum VideoError {
    /// The stream ends inside a frame.
    #[error("frame {frame}, counted from 0: the stream ends after {found} of its {wanted} bytes")]
    ShortFrame {
        /// From 0.
        frame: u64,
        /// Bytes there are.
        found: usize,
        /// Bytes of a frame.
        wanted: usize,
    },
    /// The stream cannot be read.
    #[error("frame {frame}, counted from 0: {source}")]
    Read {
        /// From 0.
        frame: u64,
        /// What the system says.
        source: std::io::Error,
    },
}

/// Frames of raw gray video, such as `ffmpeg -i FILE -f rawvideo -pix_fmt gray -` writes. One frame at a time is in memory.
///
/// After an error there are no more frames.
///
/// ```
/// use helio_spot::{Limits, RawFormat, RawVideo};
/// let two_frames = [1_u8, 2, 3, 4, 5, 6];
/// let video = RawVideo::new(&two_frames[..], 3, 1, RawFormat::Gray8, &Limits::default())?;
/// assert_eq!(video.filter(|frame| frame.is_ok()).count(), 2);
/// # Ok::<(), helio_spot::DecodeError>(())
/// ```
#[derive(Debug)]
pub struct RawVideo<R> {
    reader: R,
    width: usize,
    height: usize,
    format: RawFormat,
    frame: u64,
    ended: bool,
}

impl<R: Read> RawVideo<R> {
    /// Of frames of this size. Reads nothing yet.
    ///
    /// # Errors
    /// [`DecodeError::NoPixels`], and beyond the limits [`DecodeError::TooManyPixels`] and [`DecodeError::TooManyBytes`].
    pub fn new(
        reader: R,
        width: usize,
        height: usize,
        format: RawFormat,
        limits: &Limits,
    ) -> Result<Self, DecodeError> {
        limits.check(width as u64, height as u64, format.bytes())?;
        Ok(Self {
            reader,
            width,
            height,
            format,
            frame: 0,
            ended: false,
        })
    }

    fn read(&mut self) -> Result<Option<Frame>, VideoError> {
        let frame = self.frame;
        let wanted = self.width * self.height * self.format.bytes() as usize;
        let mut bytes = Vec::with_capacity(wanted);
        (&mut self.reader)
            .take(wanted as u64)
            .read_to_end(&mut bytes)
            .map_err(|source| VideoError::Read { frame, source })?;
        if bytes.is_empty() {
            return Ok(None);
        }
        let found = bytes.len();
        let (width, height) = (self.width, self.height);
        let picture = match self.format {
            RawFormat::Gray8 => Picture::new(bytes, width, height).map(Frame::Gray8),
            RawFormat::Gray16Le => {
                let (words, _) = bytes.as_chunks::<2>();
                let words = words.iter().map(|&word| u16::from_le_bytes(word)).collect();
                Picture::new(words, width, height).map(Frame::Gray16)
            }
        };
        // Of the right size unless it is short.
        picture.map(Some).map_err(|_| VideoError::ShortFrame {
            frame,
            found,
            wanted,
        })
    }
}

impl<R: Read> Iterator for RawVideo<R> {
    type Item = Result<Frame, VideoError>;

    fn next(&mut self) -> Option<Self::Item> {
        if self.ended {
            return None;
        }
        let frame = self.read();
        self.frame += 1;
        self.ended = !matches!(frame, Ok(Some(_)));
        frame.transpose()
    }
}
