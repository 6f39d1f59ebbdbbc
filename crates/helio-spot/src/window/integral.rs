//! An integral image of blocks of pixels: bounds of all window sums for little work.

use std::ops::Range;

use super::centroid::Totals;
use super::{Kept, Span, Window};
use crate::image::Gray;

/// Edge of a block \[px\]: 16 rows of 8-bit pixels add up in 16 bits, and the bounds stay close.
const EDGE: usize = 16;
/// Columns that are added up at once: their sums stay in the first cache.
const STRIP: usize = 256;

/// Sums of the kept pixels of all blocks above and to the left of each block corner.
#[derive(Debug, Clone, Default)]
pub(super) struct Blocks {
    /// Row by row, one more each way than there are blocks.
    corners: Vec<u64>,
    rows: usize,
    columns: usize,
    /// Sums of each column of pixels over the rows of each row of blocks.
    bands: Vec<u32>,
    width: usize,
    /// Bounds of one row of chunks.
    line: Vec<u64>,
    /// The greatest bound of each row of chunks.
    greatest: Vec<u64>,
}

impl Blocks {
    /// Adds up the kept pixels, by blocks and in total.
    #[inline(always)]
    pub(super) fn sum<P: Gray>(&mut self, kept: &Kept<'_, P>, totals: &mut Totals) {
        let (height, width) = (kept.view.height(), kept.view.width());
        (self.rows, self.columns) = (height.div_ceil(EDGE), width.div_ceil(EDGE));
        self.width = width;
        self.bands.resize(self.rows * width, 0);
        let line = self.columns + 1;
        self.corners.clear();
        self.corners.resize((self.rows + 1) * line, 0);
        *totals = Totals::default();
        for band in 0..self.rows {
            let top = band * EDGE;
            let (above, here) = self.corners[band * line..(band + 2) * line].split_at_mut(line);
            for left in (0..width).step_by(STRIP) {
                let right = width.min(left + STRIP);
                let mut sums = [P::Sum::default(); STRIP];
                let sums = &mut sums[..right - left];
                for row in top..height.min(top + EDGE) {
                    let Some(pixels) = kept.row(row) else {
                        continue;
                    };
                    let mut sum = 0_u32;
                    for (column, &gray) in sums.iter_mut().zip(&pixels[left..right]) {
                        let gray = kept.gray(gray);
                        *column += P::Sum::from(gray);
                        sum += gray.into();
                    }
                    totals.sum += u64::from(sum);
                    totals.y += u128::from(sum) * row as u128;
                }
                let band = &mut self.bands[band * width..][left..right];
                for (column, &sum) in band.iter_mut().zip(sums.iter()) {
                    *column = sum.into();
                }
                let mut strip = 0_u64;
                let mut moment = 0_u64;
                let blocks = here[left / EDGE + 1..].iter_mut();
                for ((block, column), sums) in
                    blocks.zip((0..).step_by(EDGE)).zip(sums.chunks(EDGE))
                {
                    let mut sum = 0_u32;
                    for (column, &in_column) in (column..).zip(sums.iter()) {
                        sum += in_column.into();
                        moment += u64::from(in_column.into()) * column;
                    }
                    strip += u64::from(sum);
                    *block = u64::from(sum);
                }
                totals.x += u128::from(moment) + u128::from(strip) * left as u128;
            }
            let mut to_the_left = 0;
            for (block, above) in here.iter_mut().zip(above.iter()) {
                to_the_left += *block;
                *block = to_the_left + above;
            }
        }
    }

    /// Adds these rows of these columns of the picture to `summed`.
    #[inline(always)]
    pub(super) fn add_rows<P: Gray>(
        &self,
        kept: &Kept<'_, P>,
        rows: Range<usize>,
        columns: Range<usize>,
        summed: &mut [u32],
    ) {
        let mut row = rows.start;
        while row < rows.end {
            let band = row / EDGE;
            let next = ((band + 1) * EDGE).min(kept.view.height());
            if row.is_multiple_of(EDGE) && next <= rows.end {
                let band = &self.bands[band * self.width..][columns.clone()];
                for (sum, more) in summed.iter_mut().zip(band) {
                    *sum += more;
                }
                row = next;
            } else {
                if let Some(pixels) = kept.row(row) {
                    for (sum, &gray) in summed.iter_mut().zip(&pixels[columns.clone()]) {
                        *sum += kept.gray(gray).into();
                    }
                }
                row += 1;
            }
        }
    }

    /// Where the bound is greatest, of chunks of windows.
    #[inline(always)]
    pub(super) fn likeliest(&mut self, window: Window, rows: Span, columns: Span) -> (Span, Span) {
        self.greatest.clear();
        let mut likeliest = (0, 0);
        for chunk in 0..chunks(rows, window) {
            self.bounds(chunk, window, columns);
            let greatest = self.line.iter().fold(0, |a, &b| a.max(b));
            if self
                .greatest
                .get(likeliest.0)
                .is_none_or(|&so_far| greatest > so_far)
            {
                let column = self.line.iter().position(|&bound| bound == greatest);
                likeliest = (chunk, column.unwrap_or(0));
            }
            self.greatest.push(greatest);
        }
        (
            span_of(likeliest.0, likeliest.0, window, rows),
            span_of(likeliest.1, likeliest.1, window, columns),
        )
    }

    /// The smallest rectangle with all windows whose bound is not below `floor`; after [`Self::likeliest`].
    #[inline(always)]
    pub(super) fn not_below(
        &mut self,
        floor: u64,
        window: Window,
        rows: Span,
        columns: Span,
    ) -> (Span, Span) {
        let mut found: Option<[usize; 4]> = None;
        for chunk in 0..self.greatest.len() {
            if self.greatest[chunk] < floor {
                continue;
            }
            self.bounds(chunk, window, columns);
            let hit = |&bound: &u64| bound >= floor;
            let (Some(first), Some(last)) = (
                self.line.iter().position(hit),
                self.line.iter().rposition(hit),
            ) else {
                continue;
            };
            let [top, _, left, right] = found.unwrap_or([chunk, chunk, first, last]);
            found = Some([top, chunk, left.min(first), right.max(last)]);
        }
        let Some([top, bottom, left, right]) = found else {
            return (rows, columns);
        };
        (
            span_of(top, bottom, window, rows),
            span_of(left, right, window, columns),
        )
    }

    /// Upper bounds of the window sums of a row of chunks: what the blocks hold that its windows touch.
    #[inline(always)]
    fn bounds(&mut self, chunk: usize, window: Window, columns: Span) {
        // 16 windows next to each other, the first of which begins with a block.
        let reach = (EDGE - 1 + window.size()).div_ceil(EDGE);
        let line = self.columns + 1;
        let above = &self.corners[chunk * line..][..line];
        let below = &self.corners[self.rows.min(chunk + reach) * line..][..line];
        let chunks = chunks(columns, window);
        let inside = chunks.min(line.saturating_sub(reach));
        self.line.clear();
        self.line.resize(chunks, 0);
        let (full, cut) = self.line.split_at_mut(inside);
        for (k, bound) in full.iter_mut().enumerate() {
            *bound = below[k + reach] - below[k] - (above[k + reach] - above[k]);
        }
        let end = line - 1;
        for (k, bound) in (inside..).zip(cut) {
            *bound = below[end] - below[k] - (above[end] - above[k]);
        }
    }
}

/// Into how many chunks the windows fall, by the block in which they begin; one that begins before the first
/// block belongs to the first chunk.
#[inline(always)]
fn chunks(span: Span, window: Window) -> usize {
    (span.end - window.before).div_ceil(EDGE).max(1)
}

/// The pixels of `span` that the windows of these chunks are about.
#[inline(always)]
fn span_of(first: usize, last: usize, window: Window, span: Span) -> Span {
    Span {
        first: if first == 0 {
            span.first
        } else {
            first * EDGE + window.before
        },
        end: span.end.min((last + 1) * EDGE + window.before),
    }
}
