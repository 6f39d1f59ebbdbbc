//! The method of T/GRLM 02-2014, appendix A.2, as printed.
//!
//! With the picture `g`, threshold `T`, area `S` and side `l`:
//!
//! ```text
//! (A.1)  I(x, y) = g(x, y) where g(x, y) >= T, else 0
//! (A.2)  l = sqrt(S),  l < min(H, W)
//! (A.3)  f(x, y) = sum of I(i, j), i = floor(x - l/2) ..= floor(x + l/2), j likewise about y,
//!        for [l/2] + 1 <= x <= H - [l/2] and [l/2] + 1 <= y <= W - [l/2]
//! (A.4)  f(x_c, y_c) = max f(x, y)
//! ```
//!
//! `x` is the row and `y` the column, both counted from 1. For whole `x` the sum runs over the rows
//! `x - ceil(l/2) ..= x + floor(l/2)`: where `l` is an even whole number that is `l + 1` rows with `x` in their
//! middle; for every other `l` it is `2 floor(l/2) + 2` rows with their middle at `x - 1/2`, and the printed
//! range of `x` then begins with a window that reaches row 0, which does not exist and counts as zero. Columns
//! likewise.

mod centroid;
mod integral;

use crate::error::SpotError;
use crate::image::{Gray, View};
use crate::simd::{self, Kernel, Level};
use crate::status::{Flags, SpotStatus};
use crate::threshold::{Counter, Threshold};
use centroid::Totals;
use integral::Blocks;

/// How [`standard`] works.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
#[non_exhaustive]
pub struct StandardOptions {
    /// How background and spot are parted.
    pub threshold: Threshold,
}

impl StandardOptions {
    /// With this threshold.
    #[must_use]
    pub const fn with_threshold(threshold: Threshold) -> Self {
        Self { threshold }
    }
}

/// Memory that [`standard`] works in, to be used again for the next picture.
#[derive(Debug, Clone, Default)]
pub struct Scratch {
    counter: Counter,
    totals: Totals,
    blocks: Blocks,
    /// Sums of the kept pixels of each column over the rows of a window.
    columns: Vec<u32>,
    /// Sums of `columns` from the left.
    before: Vec<u64>,
}

/// What [`standard`] found. Positions are NaN where the status is [`SpotStatus::Empty`].
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
pub struct StandardSpot {
    /// [`SpotStatus::Ok`], or [`SpotStatus::Empty`] where nothing is kept or all that is kept is black.
    pub status: SpotStatus,
    /// [`Flags::WINDOW_CLAMPED`], [`Flags::SATURATED`] where a kept pixel is white.
    pub flags: Flags,
    /// `T`, the lowest gray value that is kept; one above white keeps nothing.
    pub threshold: u32,
    /// `S`, the number of pixels kept.
    pub area_px: u64,
    /// `l` as used \[px\]: the square root of `S`, and where that is not below the picture's shorter side, that
    /// side less one: the greatest whole number that (A.2) admits; the window then covers the shorter side exactly.
    pub side_px: f64,
    /// Rows, and as many columns, that a window covers.
    pub window_px: u32,
    /// The row `x_c` of (A.4), counted from 0: one less than printed. With ties the mean of all maximisers.
    pub row: f64,
    /// The column `y_c` of (A.4), likewise.
    pub column: f64,
    /// The middle of the window \[px\], which 7.2 calls the spot's centre, to the right: `column`, or half a pixel
    /// less where the window has an even number of columns.
    pub x_px: f64,
    /// The middle of the window \[px\], downwards.
    pub y_px: f64,
    /// `f(x_c, y_c)`.
    pub window_sum: u64,
    /// How many `(x, y)` have this sum: 1 where the maximum is the only one.
    pub maximisers: u64,
    /// Gray-weighted centroid of all kept pixels of the picture \[px\], to the right.
    pub centroid_x_px: f64,
    /// Gray-weighted centroid of all kept pixels of the picture \[px\], downwards.
    pub centroid_y_px: f64,
}

impl StandardSpot {
    const fn empty(threshold: u32, area_px: u64, window: Window) -> Self {
        Self {
            status: SpotStatus::Empty,
            flags: Flags::none().with_if(window.clamped, Flags::WINDOW_CLAMPED),
            threshold,
            area_px,
            side_px: window.side_px,
            window_px: window.size() as u32,
            row: f64::NAN,
            column: f64::NAN,
            x_px: f64::NAN,
            y_px: f64::NAN,
            window_sum: 0,
            maximisers: 0,
            centroid_x_px: f64::NAN,
            centroid_y_px: f64::NAN,
        }
    }
}

/// The spot of a picture as T/GRLM 02-2014 prints it in (A.1) to (A.4).
///
/// Everything but the final divisions is done in whole numbers. Pictures where nothing is kept (all black, or
/// of one gray value with a threshold other than a fixed one) are [`SpotStatus::Empty`].
///
/// # Errors
/// [`SpotError::TooLarge`] for a picture of more than 2³² - 1 pixels, and the errors of [`Threshold::of`].
///
/// ```
/// use helio_spot::{Scratch, StandardOptions, View, standard};
/// let mut pixels = [10_u8; 8 * 6];
/// for (x, y) in [(4, 2), (5, 2), (4, 3), (5, 3)] {
///     pixels[y * 8 + x] = 200;
/// }
/// let view = View::new(&pixels, 8, 6)?;
/// let spot = standard(view, &StandardOptions::default(), &mut Scratch::default())?;
/// assert_eq!((spot.threshold, spot.area_px, spot.side_px), (11, 4, 2.0));
/// // l = 2 gives a window of three rows; four places have all of the spot in it
/// assert_eq!((spot.window_px, spot.maximisers, spot.window_sum), (3, 4, 800));
/// assert_eq!((spot.x_px, spot.y_px), (4.5, 2.5));
/// # Ok::<(), helio_spot::SpotError>(())
/// ```
pub fn standard<P: Gray>(
    view: View<'_, P>,
    options: &StandardOptions,
    scratch: &mut Scratch,
) -> Result<StandardSpot, SpotError> {
    standard_at(Level::best(), view, options, scratch)
}

fn standard_at<P: Gray>(
    level: Level,
    view: View<'_, P>,
    options: &StandardOptions,
    scratch: &mut Scratch,
) -> Result<StandardSpot, SpotError> {
    scratch.counter.count(level, view)?;
    let threshold = options.threshold.of(&scratch.counter.histogram)?;
    let area_px = scratch.counter.histogram.at_least(threshold);
    let window = Window::new(area_px, view.width().min(view.height()));
    if area_px == 0 {
        return Ok(StandardSpot::empty(threshold, 0, window));
    }
    let best = simd::run_at(
        level,
        Search {
            kept: Kept {
                view,
                threshold: P::from_gray(threshold),
                row_max: &scratch.counter.row_max,
            },
            window,
            totals: &mut scratch.totals,
            blocks: &mut scratch.blocks,
            columns: &mut scratch.columns,
            before: &mut scratch.before,
        },
    );
    if best.sum == 0 {
        return Ok(StandardSpot::empty(threshold, area_px, window));
    }
    let (row, column) = best.mean();
    let (x_px, y_px) = scratch.totals.centroid();
    let white = scratch.counter.histogram.at_least(P::WHITE) > 0;
    Ok(StandardSpot {
        status: SpotStatus::Ok,
        flags: Flags::none()
            .with_if(window.clamped, Flags::WINDOW_CLAMPED)
            .with_if(white, Flags::SATURATED),
        threshold,
        area_px,
        side_px: window.side_px,
        window_px: window.size() as u32,
        row,
        column,
        x_px: column - window.lead(),
        y_px: row - window.lead(),
        window_sum: best.sum,
        maximisers: best.count,
        centroid_x_px: x_px,
        centroid_y_px: y_px,
    })
}

/// The window of (A.3) about a pixel: `before` pixels, the pixel, `after` pixels.
#[derive(Debug, Clone, Copy)]
struct Window {
    side_px: f64,
    clamped: bool,
    /// ceil(l/2)
    before: usize,
    /// floor(l/2)
    after: usize,
}

impl Window {
    /// Of an area, in a picture whose shorter side is given; all in whole numbers.
    fn new(area_px: u64, shorter: usize) -> Self {
        let shorter = shorter as u64;
        let clamped = area_px >= shorter * shorter;
        let squared = if clamped {
            (shorter - 1) * (shorter - 1)
        } else {
            area_px
        };
        // floor(sqrt(S)/2) = floor(sqrt(floor(S/4)))
        let after = (squared / 4).isqrt();
        let even = 4 * after * after == squared;
        Self {
            side_px: (squared as f64).sqrt(),
            clamped,
            before: after as usize + usize::from(!even),
            after: after as usize,
        }
    }

    const fn size(self) -> usize {
        self.before + 1 + self.after
    }

    /// How far the middle lies before the pixel that the window is about.
    const fn lead(self) -> f64 {
        (self.before - self.after) as f64 / 2.0
    }
}

/// (A.1)
#[derive(Clone, Copy)]
struct Kept<'a, P> {
    view: View<'a, P>,
    threshold: P,
    row_max: &'a [u16],
}

impl<'a, P: Gray> Kept<'a, P> {
    /// A row in which something is kept.
    #[inline(always)]
    fn row(&self, row: usize) -> Option<&'a [P]> {
        let brightest = *self.row_max.get(row)?;
        (u32::from(brightest) >= self.threshold.into()).then(|| self.view.row(row))
    }

    #[inline(always)]
    fn gray(&self, gray: P) -> P {
        if gray >= self.threshold {
            gray
        } else {
            P::default()
        }
    }
}

/// The greatest window sum so far, and where.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
struct Best {
    sum: u64,
    count: u64,
    rows: u64,
    columns: u64,
}

impl Best {
    #[inline(always)]
    fn note(&mut self, sum: u64, row: usize, column: usize) {
        if sum > self.sum {
            *self = Self {
                sum,
                ..Self::default()
            };
        }
        if sum == self.sum {
            self.count += 1;
            self.rows += row as u64;
            self.columns += column as u64;
        }
    }

    fn mean(&self) -> (f64, f64) {
        let count = self.count as f64;
        (self.rows as f64 / count, self.columns as f64 / count)
    }
}

/// Rows or columns of the pixels that windows are about.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
struct Span {
    first: usize,
    /// One past the last.
    end: usize,
}

/// (A.3) and (A.4).
struct Search<'a, P> {
    kept: Kept<'a, P>,
    window: Window,
    totals: &'a mut Totals,
    blocks: &'a mut Blocks,
    columns: &'a mut Vec<u32>,
    before: &'a mut Vec<u64>,
}

impl<P: Gray> Kernel for Search<'_, P> {
    type Output = Best;

    /// Sums over blocks bound the window sums from above; only where a bound is not below the greatest sum
    /// known are windows summed. What is found is the same as by summing all.
    #[inline(always)]
    fn run(mut self) -> Best {
        self.blocks.sum(&self.kept, self.totals);
        let (height, width) = (self.kept.view.height(), self.kept.view.width());
        let after = self.window.after;
        let rows = Span {
            first: after,
            end: height - after,
        };
        let columns = Span {
            first: after,
            end: width - after,
        };
        let (likely_rows, likely_columns) = self.blocks.likeliest(self.window, rows, columns);
        let floor = self.greatest(likely_rows, likely_columns).sum;
        let (rows, columns) = self.blocks.not_below(floor, self.window, rows, columns);
        self.greatest(rows, columns)
    }
}

impl<P: Gray> Search<'_, P> {
    /// The greatest of the windows about these pixels.
    #[inline(always)]
    fn greatest(&mut self, rows: Span, columns: Span) -> Best {
        let (before, size) = (self.window.before, self.window.size());
        // The first window may reach the row and the column that do not exist.
        let lead = usize::from(columns.first < before);
        let left = (columns.first + lead) - before;
        let right = columns.end + self.window.after;
        let summed = &mut *self.columns;
        summed.clear();
        summed.resize(lead + right - left, 0);
        self.before.clear();
        self.before.resize(summed.len() + 1, 0);
        let mut best = Best::default();
        for row in rows.first..rows.end {
            if row == rows.first {
                let window = row.saturating_sub(before)..row + self.window.after + 1;
                self.blocks
                    .add_rows(&self.kept, window, left..right, &mut summed[lead..]);
            } else {
                if let Some(pixels) = row
                    .checked_sub(before + 1)
                    .and_then(|row| self.kept.row(row))
                {
                    for (sum, &gray) in summed[lead..].iter_mut().zip(&pixels[left..right]) {
                        *sum -= self.kept.gray(gray).into();
                    }
                }
                if let Some(pixels) = self.kept.row(row + self.window.after) {
                    for (sum, &gray) in summed[lead..].iter_mut().zip(&pixels[left..right]) {
                        *sum += self.kept.gray(gray).into();
                    }
                }
            }
            let mut total = 0;
            for (before, &sum) in self.before[1..].iter_mut().zip(summed.iter()) {
                total += u64::from(sum);
                *before = total;
            }
            let sums = || {
                self.before[size..]
                    .iter()
                    .zip(&*self.before)
                    .map(|(end, start)| end - start)
            };
            let greatest = sums().fold(0, u64::max);
            if greatest >= best.sum {
                for (column, sum) in (columns.first..).zip(sums()) {
                    if sum == greatest {
                        best.note(sum, row, column);
                    }
                }
            }
        }
        best
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Every instruction set, and a scratch that another picture has been in, give the same answer as the sums of
    /// all windows by an integral image of pixels.
    #[test]
    fn same_answer_on_every_instruction_set() {
        let mut scratch = Scratch::default();
        let mut seed = 1_u64;
        for (width, height, beams) in [(640, 480, 1), (701, 333, 2), (97, 1503, 3), (300, 200, 40)]
        {
            let mut pixels = vec![0_u8; width * height];
            let mut random = |end: usize| {
                seed = seed
                    .wrapping_mul(6_364_136_223_846_793_005)
                    .wrapping_add(1_442_695_040_888_963_407);
                (seed >> 33) as usize % end
            };
            let beams: Vec<_> = (0..beams)
                .map(|_| (random(width), random(height), 5 + random(60)))
                .collect();
            let dim = beams.len().div_ceil(4) as u32;
            for (at, pixel) in pixels.iter_mut().enumerate() {
                let (x, y) = (at % width, at / width);
                let beam = |&(cx, cy, r): &(usize, usize, usize)| {
                    let squared = x.abs_diff(cx).pow(2) + y.abs_diff(cy).pow(2);
                    (150 * r * r / (r * r + squared)) as u32
                };
                let light: u32 = beams.iter().map(beam).sum();
                *pixel = (20 + light / dim + random(8) as u32).min(255) as u8;
            }
            let words: Vec<u16> = pixels.iter().map(|&pixel| u16::from(pixel) << 7).collect();
            let eight = View::new(&pixels, width, height).unwrap();
            let sixteen = View::new(&words, width, height).unwrap();
            for threshold in [Threshold::Otsu, Threshold::Fixed(40)] {
                let options = StandardOptions::with_threshold(threshold);
                let expected = all_windows(eight, &options);
                for level in levels() {
                    let spot = standard_at(level, eight, &options, &mut scratch).unwrap();
                    let found = (spot.window_sum, spot.maximisers, spot.row, spot.column);
                    assert_eq!(
                        found, expected,
                        "{width} x {height}, {threshold:?}, {level:?}"
                    );
                    let plain = standard_at(Level::Plain, sixteen, &options, &mut scratch).unwrap();
                    let spot = standard_at(level, sixteen, &options, &mut scratch).unwrap();
                    assert_eq!(spot, plain, "{width} x {height}, 16 bit, {level:?}");
                }
            }
            let options = StandardOptions::default();
            let eight = standard(eight, &options, &mut scratch).unwrap();
            let sixteen = standard(sixteen, &options, &mut scratch).unwrap();
            assert_eq!(sixteen.window_sum, eight.window_sum << 7);
            assert_eq!((sixteen.x_px, sixteen.y_px), (eight.x_px, eight.y_px));
        }
    }

    fn levels() -> impl Iterator<Item = Level> {
        [
            Level::Plain,
            #[cfg(target_arch = "x86_64")]
            Level::Avx2,
            #[cfg(target_arch = "x86_64")]
            Level::Avx512,
        ]
        .into_iter()
        .filter(|&level| level <= Level::best())
    }

    /// Greatest sum, how often, mean row and column.
    fn all_windows(view: View<'_, u8>, options: &StandardOptions) -> (u64, u64, f64, f64) {
        let (width, height) = (view.width(), view.height());
        let histogram = crate::threshold::Histogram::of(view).unwrap();
        let threshold = options.threshold.of(&histogram).unwrap();
        let mut corners = vec![vec![0_u64; width + 1]; height + 1];
        for (row, pixels) in view.rows().enumerate() {
            for (column, &gray) in pixels.iter().enumerate() {
                let kept = if u32::from(gray) >= threshold {
                    u64::from(gray)
                } else {
                    0
                };
                corners[row + 1][column + 1] =
                    kept + corners[row][column + 1] + corners[row + 1][column]
                        - corners[row][column];
            }
        }
        let window = Window::new(histogram.at_least(threshold), width.min(height));
        let mut best = Best::default();
        for row in window.after..height - window.after {
            for column in window.after..width - window.after {
                let (top, left) = (
                    row.saturating_sub(window.before),
                    column.saturating_sub(window.before),
                );
                let (bottom, right) = (row + window.after + 1, column + window.after + 1);
                let outer = corners[bottom][right] + corners[top][left];
                best.note(
                    outer - corners[top][right] - corners[bottom][left],
                    row,
                    column,
                );
            }
        }
        let (row, column) = best.mean();
        (best.sum, best.count, row, column)
    }
}
