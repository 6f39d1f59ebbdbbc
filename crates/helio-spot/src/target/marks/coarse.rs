//! Dark outlines of marks in a picture of block means.

use super::Kind;
use crate::image::{Gray, View};
use crate::target::Marks;

/// Blocks of the first try: as small as leaves at most this many, so that it takes a tenth of reading the frame's file.
const CELLS: usize = 350_000;
/// Side of the closing's box in blocks: arms up to this wide vanish in it.
const BOX: usize = 15;
/// Darker than this share of the closing (in 256ths), and by this many of 255 levels, is dark.
const DARK: u16 = 190;
const DARKER_BY: u8 = 6;
/// Arms of at least this many blocks.
const SHORTEST: f64 = 6.0;
/// Share of a component's cells that must lie within the outline it is taken for.
const WITHIN: f64 = 0.93;
/// More outlines than this in one picture are no marks.
const MOST: usize = 64;

/// Memory for [`find_corners`](super::find_corners), kept from frame to frame.
#[derive(Debug, Clone, Default)]
pub struct MarkScratch {
    sums: Vec<u32>,
    level: Vec<u8>,
    other: Vec<u8>,
    padded: Vec<u8>,
    runs: Vec<Run>,
    parents: Vec<u32>,
    blobs: Vec<Blob>,
}

/// Dark cells side by side.
#[derive(Debug, Clone, Copy)]
struct Run {
    row: u32,
    first: u32,
    end: u32,
    /// Next run of the same component.
    next: u32,
}

const NONE: u32 = u32::MAX;

/// A connected component.
#[derive(Debug, Clone, Copy)]
struct Blob {
    area: u32,
    columns: [u32; 2],
    rows: [u32; 2],
    /// Extreme corners: upper left, upper right, lower right, lower left.
    extremes: [Extreme; 4],
    first_run: u32,
}

/// The cells farthest in a direction: their mean counts.
#[derive(Debug, Clone, Copy)]
struct Extreme {
    value: i64,
    x: i64,
    y: i64,
    count: i64,
}

impl Extreme {
    const fn none() -> Self {
        Self {
            value: i64::MIN,
            x: 0,
            y: 0,
            count: 0,
        }
    }

    const fn take(&mut self, value: i64, x: i64, y: i64) {
        if value > self.value {
            *self = Self {
                value,
                x,
                y,
                count: 1,
            };
        } else if value == self.value {
            self.x += x;
            self.y += y;
            self.count += 1;
        }
    }

    fn at(&self) -> [f64; 2] {
        let n = self.count.max(1) as f64;
        [self.x as f64 / n, self.y as f64 / n]
    }
}

/// An outline that may be a mark, in pixels.
#[derive(Debug, Clone, Copy)]
pub(super) struct Candidate {
    pub(super) kind: Kind,
    /// The vertex of an L, the middle of the outer edge of a T's bar.
    pub(super) vertex_px: [f64; 2],
    /// End of the arm along the board's width: of an L its outer corner, of a T its middle.
    pub(super) right_tip_px: [f64; 2],
    /// Outer ends along the board's height: the vertex and the tip of an L, both ends of a T's bar.
    pub(super) down_ends_px: [[f64; 2]; 2],
    pub(super) width_px: f64,
    pub(super) cell_px: f64,
}

/// Sizes of blocks to try, in pixels, the usual one first.
pub(super) fn cells(width: usize, height: usize) -> impl Iterator<Item = usize> {
    let mut usual = 1;
    while (width / usual) * (height / usual) > CELLS {
        usual *= 2;
    }
    let large_enough = move |cell: usize| width.min(height) / cell > 2 * BOX;
    let coarser = [usual, 2 * usual, 4 * usual];
    let finer = core::iter::successors(Some(usual / 2), |c| Some(c / 2)).take_while(|&c| c > 0);
    coarser
        .into_iter()
        .chain(finer)
        .filter(move |&c| large_enough(c))
}

/// Outlines of the kinds of marks that a board has.
pub(super) fn candidates<P: Gray>(
    view: View<'_, P>,
    cell: usize,
    marks: Marks,
    scratch: &mut MarkScratch,
) -> Vec<Candidate> {
    let [width, height] = [view.width() / cell, view.height() / cell];
    if width.min(height) <= 2 * BOX {
        return Vec::new();
    }
    means(view, cell, scratch);
    close(width, height, scratch);
    trace(width, height, scratch);
    let kinds: [Kind; 4] = core::array::from_fn(|corner| Kind::of(marks, corner));
    let mut found = Vec::new();
    for blob in &scratch.blobs {
        let [x0, x1] = blob.columns;
        let [y0, y1] = blob.rows;
        let [wide, high] = [x1 - x0, y1 - y0];
        let inside = x0 > 0 && y0 > 0 && (x1 as usize) < width && (y1 as usize) < height;
        if !inside
            || wide.min(high) < SHORTEST as u32
            || wide.max(high) > 3 * wide.min(high)
            || 4 * blob.area > 3 * wide * high
        {
            continue;
        }
        for kind in kinds {
            if let Some(candidate) = outline(blob, kind, &scratch.runs, cell as f64) {
                found.push(candidate);
                if found.len() == MOST {
                    return found;
                }
            }
        }
    }
    found
}

/// Mean of every block, 0 to 255; of more than 8 bit with the brightest block at 255.
fn means<P: Gray>(view: View<'_, P>, cell: usize, scratch: &mut MarkScratch) {
    let [width, height] = [view.width() / cell, view.height() / cell];
    let shift = 2 * cell.trailing_zeros();
    let half = (1_u32 << shift) >> 1;
    scratch.level.clear();
    scratch.level.reserve(width * height);
    let level = &mut scratch.level;
    // 16 bits hold the sum of 128 rows of 8 bit.
    let rows_fit = P::WHITE * cell as u32 <= u32::from(u16::MAX);
    let mut narrow = vec![0_u16; if rows_fit { width * cell } else { 0 }];
    let mut wide = vec![0_u32; if rows_fit { 0 } else { width * cell }];
    scratch.sums.clear();
    for block in 0..height {
        let rows = (block * cell..(block + 1) * cell).map(|r| &view.row(r)[..width * cell]);
        if rows_fit {
            narrow.fill(0);
            for row in rows {
                for (sum, &p) in narrow.iter_mut().zip(row) {
                    let p: u32 = p.into();
                    *sum += p as u16;
                }
            }
            let mean = |sum: u32| ((sum + half) >> shift) as u8;
            match cell {
                1 => level.extend(narrow.iter().map(|&s| s as u8)),
                2 => level.extend(narrow.as_chunks::<2>().0.iter().map(|c| mean(total(c)))),
                4 => level.extend(narrow.as_chunks::<4>().0.iter().map(|c| mean(total(c)))),
                _ => level.extend(narrow.chunks_exact(cell).map(|c| mean(total(c)))),
            }
        } else {
            wide.fill(0);
            for row in rows {
                for (sum, &p) in wide.iter_mut().zip(row) {
                    let p: u32 = p.into();
                    *sum += p;
                }
            }
            let mean = |c: &[u32]| {
                let sum: u64 = c.iter().map(|&s| u64::from(s)).sum();
                (sum >> shift) as u32
            };
            scratch.sums.extend(wide.chunks_exact(cell).map(mean));
        }
    }
    if !rows_fit {
        let brightest = scratch.sums.iter().copied().max().unwrap_or(0).max(1);
        let scaled = |&mean: &u32| (mean * 255 / brightest) as u8;
        level.extend(scratch.sums.iter().map(scaled));
    }
}

fn total(sums: &[u16]) -> u32 {
    sums.iter().map(|&s| u32::from(s)).sum()
}

/// Writes 1 into `scratch.other` where a cell is dark against the closing by a box, else 0.
///
/// Rows lie end to end, so that a step down is a step by `width`: windows that run over a row's end do so into cells
/// that are set to the neutral value. Only boxes wholly in the picture count.
fn close(width: usize, height: usize, scratch: &mut MarkScratch) {
    let reach = BOX - 1;
    let pad = reach * width + reach;
    let count = width * height;
    let MarkScratch {
        level,
        other,
        padded,
        ..
    } = scratch;
    other.clear();
    other.resize(count + pad, 0);
    padded.clear();
    padded.resize(count + pad, 0);

    // Largest of each box, kept at its upper left cell.
    let steps = [1, 2, 4, BOX - 8];
    other[..count].copy_from_slice(level);
    for step in steps.into_iter().chain(steps.map(|s| s * width)) {
        pairs(&other[..count], step, &mut padded[..count], u8::max);
        core::mem::swap(other, padded);
    }
    // Moved to its lower right cell, neutral where there is no box.
    padded[..pad].fill(255);
    padded[pad..].copy_from_slice(&other[..count]);
    for (row, cells) in padded[pad..].chunks_exact_mut(width).enumerate() {
        let kept = if row + BOX <= height {
            width - reach
        } else {
            0
        };
        cells[kept..].fill(255);
    }
    core::mem::swap(other, padded);
    // Smallest of the boxes that hold a cell.
    for step in steps.into_iter().chain(steps.map(|s| s * width)) {
        pairs(other, step, padded, u8::min);
        core::mem::swap(other, padded);
    }
    other.truncate(count);
    for (closed, &level) in other.iter_mut().zip(level.iter()) {
        let dark = (u16::from(level) << 8) < u16::from(*closed) * DARK
            && closed.saturating_sub(level) >= DARKER_BY;
        *closed = u8::from(dark);
    }
}

/// The pick of each value and that `step` further on; beyond the end the value itself.
fn pairs(from: &[u8], step: usize, to: &mut [u8], pick: impl Fn(u8, u8) -> u8) {
    let both = from.len().saturating_sub(step);
    for ((to, &a), &b) in to
        .iter_mut()
        .zip(&from[..both])
        .zip(&from[step.min(from.len())..])
    {
        *to = pick(a, b);
    }
    to[both..].copy_from_slice(&from[both..]);
}

/// Runs of dark cells joined to components (also over corners).
fn trace(width: usize, height: usize, scratch: &mut MarkScratch) {
    let MarkScratch {
        other,
        runs,
        parents,
        blobs,
        ..
    } = scratch;
    runs.clear();
    parents.clear();
    blobs.clear();
    let mut above = 0..0;
    for (row, cells) in other.chunks_exact(width).enumerate().take(height) {
        let start = runs.len();
        let mut at = 0;
        while let Some(first) = next(cells, at, 1) {
            let end = next(cells, first, 0).unwrap_or(width);
            runs.push(Run {
                row: row as u32,
                first: first as u32,
                end: end as u32,
                next: NONE,
            });
            parents.push(parents.len() as u32);
            at = end;
        }
        // Both lists are in order: walk them together.
        let mut upper = above.start;
        for k in start..runs.len() {
            let run = runs[k];
            while upper < above.end && runs[upper].end < run.first {
                upper += 1;
            }
            let mut touching = upper;
            while touching < above.end && runs[touching].first <= run.end {
                let [a, b] = [root(parents, touching as u32), root(parents, k as u32)];
                parents[a.max(b) as usize] = a.min(b);
                touching += 1;
            }
        }
        above = start..runs.len();
    }
    // Runs in order: a component's root is its first run, so its place in the list of components is known before it is
    // asked for. `parents` of a root then holds that place, marked by the high bit.
    const PLACE: u32 = 1 << 31;
    for k in 0..runs.len() {
        let parent = parents[k];
        let place = if parent as usize == k {
            blobs.push(Blob::new());
            (blobs.len() - 1) as u32 | PLACE
        } else {
            parents[parent as usize]
        };
        parents[k] = place;
        let Some(blob) = blobs.get_mut((place & !PLACE) as usize) else {
            continue;
        };
        runs[k].next = blob.first_run;
        blob.first_run = k as u32;
        blob.add(runs[k]);
    }
}

/// Where `value` (0 or 1) comes next.
fn next(cells: &[u8], from: usize, value: u8) -> Option<usize> {
    let mut at = from;
    if value == 1 {
        // Most of a picture is not dark: skip by blocks.
        for block in cells[from..].as_chunks::<16>().0 {
            if u128::from_ne_bytes(*block) != 0 {
                break;
            }
            at += 16;
        }
    }
    cells[at..].iter().position(|&c| c == value).map(|k| at + k)
}

fn root(parents: &mut [u32], of: u32) -> u32 {
    let mut at = of;
    while parents[at as usize] != at {
        let up = parents[parents[at as usize] as usize];
        parents[at as usize] = up;
        at = up;
    }
    at
}

impl Blob {
    const fn new() -> Self {
        Self {
            area: 0,
            columns: [u32::MAX, 0],
            rows: [u32::MAX, 0],
            extremes: [Extreme::none(); 4],
            first_run: NONE,
        }
    }

    fn add(&mut self, run: Run) {
        self.area += run.end - run.first;
        self.columns = [self.columns[0].min(run.first), self.columns[1].max(run.end)];
        self.rows = [self.rows[0].min(run.row), self.rows[1].max(run.row + 1)];
        // Outer corners of the cells.
        let [left, right] = [i64::from(run.first), i64::from(run.end)];
        let [top, bottom] = [i64::from(run.row), i64::from(run.row) + 1];
        let [ul, ur, lr, ll] = &mut self.extremes;
        ul.take(-left - top, left, top);
        ur.take(right - top, right, top);
        lr.take(right + bottom, right, bottom);
        ll.take(bottom - left, left, bottom);
    }
}

/// Whether a component has the outline of a mark.
fn outline(blob: &Blob, kind: Kind, runs: &[Run], cell_px: f64) -> Option<Candidate> {
    let ends = blob.extremes.each_ref().map(Extreme::at);
    let middle = |a: usize, b: usize| [0, 1].map(|k| 0.5 * (ends[a][k] + ends[b][k]));
    // Vertex, end to the side, both ends up and down.
    let (vertex, tip, [upper, lower]) = match kind {
        Kind::Angle(c) => (ends[c], ends[c ^ 1], [ends[c], ends[3 - c]]),
        Kind::BarLeft => (middle(0, 3), middle(1, 2), [ends[0], ends[3]]),
        Kind::BarRight => (middle(1, 2), middle(0, 3), [ends[1], ends[2]]),
    };
    let right = [tip[0] - vertex[0], tip[1] - vertex[1]];
    let down = [lower[0] - upper[0], lower[1] - upper[1]];
    let [a, b] = [right[0].hypot(right[1]), down[0].hypot(down[1])];
    let area = blob.area as f64;
    let det = right[0] * down[1] - right[1] * down[0];
    let sine = (det / (a * b)).abs();
    // Arms within 35° of the frame's sides, of similar length, neither parallel nor short.
    let straight = right[1].abs() < 0.7 * right[0].abs() && down[0].abs() < 0.7 * down[1].abs();
    if !(a.min(b) >= SHORTEST && a.max(b) < 2.2 * a.min(b) && straight && sine > 0.7) {
        return None;
    }
    // Area of two bars of width w that share a square: w (a + b - w).
    let sum = a + b;
    let width = 0.5 * (sum - (sum * sum - 4.0 * area / sine).max(0.0).sqrt());
    if !(width >= 1.2 && width < 0.4 * a.min(b)) {
        return None;
    }
    // Cells in the outline: in the arm to the side, in the arm up or down (or both halves of a bar).
    let mut count = [0_u32; 4];
    let mut at = blob.first_run;
    while let Some(run) = runs.get(at as usize) {
        at = run.next;
        for column in run.first..run.end {
            let x = f64::from(column) + 0.5 - vertex[0];
            let y = f64::from(run.row) + 0.5 - vertex[1];
            // Cells along the arms from the vertex.
            let s = (x * down[1] - y * down[0]) / det * a;
            let t = (y * right[0] - x * right[1]) / det * b;
            let off = if kind.is_bar() {
                t.abs() - 0.5 * width
            } else {
                t - width
            };
            let in_right = off < 1.0 && s < a + 1.0;
            let in_down = s < width + 1.0;
            if in_right || in_down {
                count[0] += 1;
            }
            if s > width + 1.0 {
                count[1] += u32::from(in_right);
            } else if off > 1.0 {
                count[if kind.is_bar() && t < 0.0 { 3 } else { 2 }] += 1;
            }
        }
    }
    let [within, side, below, above] = count.map(f64::from);
    let full = |found: f64, length: f64| {
        let wanted = sine * width * length;
        found > 0.65 * wanted && found < 1.4 * wanted
    };
    let side_full = full(side, a - width - 1.0);
    let down_full = if kind.is_bar() {
        let half = 0.5 * (b - width) - 1.0;
        full(below, half) && full(above, half)
    } else {
        full(below, b - width - 1.0)
    };
    if !(within >= WITHIN * area && side_full && down_full) {
        return None;
    }
    let pixels = |p: [f64; 2]| p.map(|c| c * cell_px - 0.5);
    Some(Candidate {
        kind,
        vertex_px: pixels(vertex),
        right_tip_px: pixels(tip),
        down_ends_px: [pixels(upper), pixels(lower)],
        width_px: width * cell_px,
        cell_px,
    })
}
