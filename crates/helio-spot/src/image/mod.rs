//! Gray pictures, and where they come from.

mod decode;
mod luma;
mod video;

pub use decode::{DecodeError, Limits, decode, is_decoding};
pub use video::{RawFormat, RawVideo, VideoError};

use crate::error::SpotError;

/// A gray value: 8 or 16 bit.
pub trait Gray: Copy + Ord + Send + Sync + 'static + Into<u32> + sealed::Sealed + Default {
    /// The largest.
    const WHITE: u32;
}

impl Gray for u8 {
    const WHITE: u32 = u8::MAX as u32;
}
impl Gray for u16 {
    const WHITE: u32 = u16::MAX as u32;
}

pub(crate) mod sealed {
    /// What kernels want to know of a gray value.
    pub trait Sealed: Sized {
        /// Holds the sum of 257 of them.
        type Sum: Copy + Default + From<Self> + Into<u32> + core::ops::AddAssign;
        /// From a gray value not above white.
        fn from_gray(gray: u32) -> Self;
        /// The same pixels where they are of 8 bit.
        fn bytes(row: &[Self]) -> Option<&[u8]>;
    }
    impl Sealed for u8 {
        type Sum = u16;
        fn from_gray(gray: u32) -> Self {
            gray as Self
        }
        fn bytes(row: &[Self]) -> Option<&[u8]> {
            Some(row)
        }
    }
    impl Sealed for u16 {
        type Sum = u32;
        fn from_gray(gray: u32) -> Self {
            gray as Self
        }
        fn bytes(_: &[Self]) -> Option<&[u8]> {
            None
        }
    }
}

/// A rectangle of gray values that somebody else keeps; may be a part of a larger picture.
#[derive(Debug, Clone, Copy)]
pub struct View<'a, P> {
    pixels: &'a [P],
    width: usize,
    height: usize,
    stride: usize,
}

impl<'a, P: Gray> View<'a, P> {
    /// Of pixels row by row.
    ///
    /// # Errors
    /// [`SpotError::WrongSize`] where there are not `width * height` of them, or none.
    pub fn new(pixels: &'a [P], width: usize, height: usize) -> Result<Self, SpotError> {
        let wanted = width.saturating_mul(height);
        if wanted == 0 || pixels.len() != wanted {
            return Err(SpotError::WrongSize {
                width,
                height,
                wanted: wanted.max(1),
                found: pixels.len(),
            });
        }
        Ok(Self {
            pixels,
            width,
            height,
            stride: width,
        })
    }

    /// Pixels in a row.
    #[must_use]
    pub const fn width(&self) -> usize {
        self.width
    }

    /// Rows.
    #[must_use]
    pub const fn height(&self) -> usize {
        self.height
    }

    /// A row from left to right; none past the last.
    #[must_use]
    pub fn row(&self, row: usize) -> &'a [P] {
        if row >= self.height {
            return &[];
        }
        &self.pixels[row * self.stride..row * self.stride + self.width]
    }

    /// The rows from the top.
    pub fn rows(&self) -> impl Iterator<Item = &'a [P]> + use<'a, P> {
        let Self {
            pixels,
            width,
            height,
            stride,
        } = *self;
        (0..height).map(move |row| &pixels[row * stride..row * stride + width])
    }

    /// A rectangle of it, cut to what there is; none where nothing is left.
    #[must_use]
    pub fn part(&self, column: usize, row: usize, width: usize, height: usize) -> Option<Self> {
        let width = width.min(self.width.checked_sub(column)?);
        let height = height.min(self.height.checked_sub(row)?);
        if width == 0 || height == 0 {
            return None;
        }
        let first = row * self.stride + column;
        Some(Self {
            pixels: &self.pixels[first..first + (height - 1) * self.stride + width],
            width,
            height,
            stride: self.stride,
        })
    }
}

/// A gray picture.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Frame {
    /// 8 bit.
    Gray8(Picture<u8>),
    /// 16 bit.
    Gray16(Picture<u16>),
}

/// Pixels row by row with their size: as many as width times height, at least one.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Picture<P> {
    pixels: Vec<P>,
    width: usize,
    height: usize,
}

impl<P: Gray> Picture<P> {
    /// Of pixels row by row.
    ///
    /// # Errors
    /// As [`View::new`].
    pub fn new(pixels: Vec<P>, width: usize, height: usize) -> Result<Self, SpotError> {
        View::new(&pixels, width, height)?;
        Ok(Self {
            pixels,
            width,
            height,
        })
    }

    /// All of it.
    #[must_use]
    pub fn view(&self) -> View<'_, P> {
        View {
            pixels: &self.pixels,
            width: self.width,
            height: self.height,
            stride: self.width,
        }
    }

    /// The pixels back.
    #[must_use]
    pub fn into_pixels(self) -> Vec<P> {
        self.pixels
    }
}

macro_rules! of_colours {
    ($gray:ty, $luma:path) => {
        impl Picture<$gray> {
            /// Of red, green and blue, pixel by pixel and row by row; they become gray as those of a file do, see
            /// [`decode`].
            ///
            /// # Errors
            /// As [`View::new`].
            ///
            /// ```
            /// use helio_spot::Picture;
            /// let picture = Picture::<u8>::of_rgb(&[255, 255, 255, 100, 0, 0], 2, 1)?;
            /// assert_eq!(picture.view().row(0), [255, 30]);
            /// # Ok::<(), helio_spot::SpotError>(())
            /// ```
            pub fn of_rgb(
                samples: &[$gray],
                width: usize,
                height: usize,
            ) -> Result<Self, SpotError> {
                if !samples.len().is_multiple_of(3) {
                    return Err(SpotError::WrongSize {
                        width,
                        height,
                        wanted: width.saturating_mul(height).max(1),
                        found: samples.len() / 3,
                    });
                }
                Self::new($luma(samples), width, height)
            }
        }
    };
}

of_colours!(u8, luma::luma8::<3>);
of_colours!(u16, luma::luma16::<3>);
