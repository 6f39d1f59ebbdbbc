//! The target's part of a frame in cells: means of square blocks of pixels, and the coarser cells made of them.

use crate::image::{Gray, View};

/// Cells along the longer side of the target: as many as the crops of published data sets have. A beam is many
/// cells wide, so that the means lose nothing of its centre (the error falls as `exp(-2 (pi s)^2)` with its
/// standard deviation `s` in cells).
const LONGER_SIDE: usize = 256;
/// Fine cells to a side of a coarse cell. Spots are looked for in coarse cells, some 64 along the target.
pub(super) const COARSE: usize = 4;
/// Coarse cells to a side of a tile. The light without the spot is fitted to tiles, some 32 along the target.
pub(super) const TILE: usize = 2;
/// A mark: fine cells darker than this part of the light around.
const DARK: f32 = 0.72;

/// Values row by row; not a number where there is none.
#[derive(Debug, Default)]
pub(super) struct Grid {
    pub(super) values: Vec<f32>,
    pub(super) width: usize,
    pub(super) height: usize,
}

impl Grid {
    pub(super) fn reset(&mut self, width: usize, height: usize) {
        self.values.clear();
        self.values.resize(width * height, f32::NAN);
        (self.width, self.height) = (width, height);
    }

    pub(super) fn row(&self, row: usize) -> &[f32] {
        &self.values[row * self.width..(row + 1) * self.width]
    }

    /// Means of squares of `side` cells of `self`, where at least half of the cells have a value.
    fn reduce_into(&self, side: usize, to: &mut Self) {
        to.reset(self.width.div_ceil(side), self.height.div_ceil(side));
        for row in 0..to.height {
            let rows = row * side..((row + 1) * side).min(self.height);
            for column in 0..to.width {
                let columns = column * side..((column + 1) * side).min(self.width);
                let (mut sum, mut count) = (0.0_f32, 0_usize);
                for row in rows.clone() {
                    for &value in &self.row(row)[columns.clone()] {
                        if !value.is_nan() {
                            sum += value;
                            count += 1;
                        }
                    }
                }
                if 2 * count >= side * side {
                    to.values[row * to.width + column] = sum / count as f32;
                }
            }
        }
    }
}

/// The three sizes of cells and where they lie in the frame.
#[derive(Debug, Default)]
pub(super) struct Cells {
    pub(super) fine: Grid,
    pub(super) coarse: Grid,
    pub(super) tiles: Grid,
    /// Pixels to a side of a fine cell.
    pub(super) block: usize,
    /// The first pixel, column and row.
    pub(super) first: [usize; 2],
    /// Coarse cells on the target, marks among them.
    on_target: Vec<bool>,
    sums: Vec<u32>,
}

impl Cells {
    /// Whether a coarse cell lies on the target.
    fn is_on_target(&self, column: isize, row: isize) -> bool {
        let [width, height] = [self.coarse.width as isize, self.coarse.height as isize];
        (0..width).contains(&column)
            && (0..height).contains(&row)
            && self.on_target[(row * width + column) as usize]
    }

    /// The part of the coarse cells whose light is above a gray value.
    pub(super) fn share_above(&self, gray: f64) -> f64 {
        let values = self.coarse.values.iter().filter(|value| !value.is_nan());
        let (mut above, mut all) = (0_u32, 0_u32);
        for value in values {
            all += 1;
            above += u32::from(f64::from(*value) > gray);
        }
        f64::from(above) / f64::from(all.max(1))
    }

    /// Whether one of its neighbours does not.
    pub(super) fn at_edge(&self, column: usize, row: usize) -> bool {
        let [x, y] = [column as isize, row as isize];
        (-1..=1).any(|down| (-1..=1).any(|right| !self.is_on_target(x + right, y + down)))
    }

    /// The middle \[px\] of the fine cell at (column, row), which need not be whole.
    pub(super) fn middle_px(&self, column: f64, row: f64) -> [f64; 2] {
        let half = 0.5 * (self.block as f64 - 1.0);
        [
            self.first[0] as f64 + self.block as f64 * column + half,
            self.first[1] as f64 + self.block as f64 * row + half,
        ]
    }

    /// The fine cell, not whole, at a pixel.
    pub(super) fn of_px(&self, pixel: [f64; 2]) -> [f64; 2] {
        let half = 0.5 * (self.block as f64 - 1.0);
        [0, 1].map(|k| (pixel[k] - self.first[k] as f64 - half) / self.block as f64)
    }

    /// Takes the means of the pixels within the closed outline \[px\]; false where less than half of it lies in the
    /// frame, or hardly any pixel.
    pub(super) fn fill<P: Gray>(&mut self, view: View<'_, P>, outline_px: &[[f64; 2]]) -> bool {
        let mut low = [f64::INFINITY; 2];
        let mut high = [f64::NEG_INFINITY; 2];
        for point in outline_px {
            for axis in 0..2 {
                low[axis] = low[axis].min(point[axis]);
                high[axis] = high[axis].max(point[axis]);
            }
        }
        let frame = [view.width() as f64, view.height() as f64];
        for axis in 0..2 {
            // Pixel k covers k - 1/2 to k + 1/2.
            low[axis] = (low[axis] + 0.5).floor().max(0.0);
            high[axis] = (high[axis] + 0.5).ceil().min(frame[axis]);
            let pixels = high[axis] - low[axis];
            if pixels.is_nan() || pixels < 8.0 {
                return false;
            }
        }
        self.first = [low[0] as usize, low[1] as usize];
        let size = [(high[0] - low[0]) as usize, (high[1] - low[1]) as usize];
        self.block = size[0].max(size[1]).div_ceil(LONGER_SIDE);
        let block = self.block;
        let (columns, rows) = (size[0] / block, size[1] / block);
        self.fine.reset(columns, rows);
        let per_pixel = 1.0 / (block * block) as f32;
        let mut seen = 0;
        for row in 0..rows {
            let Some((from, to)) = self.inside(outline_px, row) else {
                continue;
            };
            seen += to - from;
            self.sums.clear();
            self.sums.resize((to - from) * block, 0);
            let first_column = self.first[0] + from * block;
            for line in 0..block {
                let pixels = view.row(self.first[1] + row * block + line);
                for (sum, &pixel) in self.sums.iter_mut().zip(&pixels[first_column..]) {
                    *sum += pixel.into();
                }
            }
            let values = &mut self.fine.values[row * columns..][from..to];
            for (value, sums) in values.iter_mut().zip(self.sums.chunks_exact(block)) {
                *value = sums.iter().sum::<u32>() as f32 * per_pixel;
            }
        }
        // A corner far away makes a target of which the frame shows a bit.
        if 2.0 * ((seen * block * block) as f64) < area(outline_px) {
            return false;
        }
        self.coarsen();
        self.on_target.clear();
        let coarse = self.coarse.values.iter();
        self.on_target.extend(coarse.map(|value| !value.is_nan()));
        self.tiles.values.iter().filter(|v| !v.is_nan()).count() >= 16
    }

    /// Coarse cells and tiles from the fine ones.
    fn coarsen(&mut self) {
        self.fine.reduce_into(COARSE, &mut self.coarse);
        self.coarse.reduce_into(TILE, &mut self.tiles);
    }

    /// The cells of a row that lie wholly within the outline: the first, and one past the last.
    fn inside(&self, outline_px: &[[f64; 2]], row: usize) -> Option<(usize, usize)> {
        /// What the corners of a picture that is all target may be off by rounding \[px\].
        const ROUNDING: f64 = 1e-6;
        let block = self.block as f64;
        let top = (self.first[1] + row * self.block) as f64 - 0.5;
        let (mut from, mut to) = (f64::NEG_INFINITY, f64::INFINITY);
        for y in [top + ROUNDING, top + block - ROUNDING] {
            let (mut left, mut right) = (f64::INFINITY, f64::NEG_INFINITY);
            let mut last = *outline_px.last()?;
            for &point in outline_px {
                if (last[1] < y) != (point[1] < y) {
                    let share = (y - last[1]) / (point[1] - last[1]);
                    let x = last[0] + share * (point[0] - last[0]);
                    left = left.min(x);
                    right = right.max(x);
                }
                last = point;
            }
            from = from.max(left);
            to = to.min(right);
        }
        if from.is_infinite() || to.is_infinite() {
            return None;
        }
        let cell = |x: f64| (x + 0.5 - self.first[0] as f64) / block;
        let from = (cell(from) - ROUNDING).ceil().max(0.0) as usize;
        let to = ((cell(to) + ROUNDING).floor().max(0.0) as usize).min(self.fine.width);
        (from < to).then_some((from, to))
    }

    /// Leaves out the marks: cells far darker than the light around, with their neighbours, in whose means some of
    /// the mark is. True if there was any.
    /// `light` is that of coarse cells.
    pub(super) fn leave_out_dark(&mut self, light: impl Fn(usize, usize) -> f32) -> bool {
        let (width, height) = (self.fine.width, self.fine.height);
        let mut any = false;
        // Negative values stand for dark ones until the neighbours are done.
        for row in 0..self.coarse.height {
            let rows = row * COARSE..((row + 1) * COARSE).min(height);
            for column in 0..self.coarse.width {
                let dark = DARK * light(column, row);
                let (first, last) = (column * COARSE, ((column + 1) * COARSE).min(width));
                for row in rows.clone() {
                    for value in &mut self.fine.values[row * width + first..row * width + last] {
                        if *value < dark {
                            *value = -1.0 - *value;
                            any = true;
                        }
                    }
                }
            }
        }
        if !any {
            return false;
        }
        for row in 0..height {
            for column in 0..width {
                // Not so where it is no number.
                let dark = self.fine.values[row * width + column] < 0.0;
                if !dark {
                    continue;
                }
                for near in row.saturating_sub(1)..(row + 2).min(height) {
                    for beside in column.saturating_sub(1)..(column + 2).min(width) {
                        let value = &mut self.fine.values[near * width + beside];
                        if *value >= 0.0 {
                            *value = f32::NAN;
                        }
                    }
                }
            }
        }
        for value in &mut self.fine.values {
            if *value < 0.0 {
                *value = f32::NAN;
            }
        }
        self.coarsen();
        true
    }
}

/// Of a closed outline \[px²\].
fn area(outline_px: &[[f64; 2]]) -> f64 {
    let Some(mut last) = outline_px.last().copied() else {
        return 0.0;
    };
    let mut twice = 0.0;
    for &point in outline_px {
        twice += last[0] * point[1] - point[0] * last[1];
        last = point;
    }
    0.5 * twice.abs()
}
