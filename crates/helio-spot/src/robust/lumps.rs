//! What stands out of the light on the target: lumps of coarse cells, told apart and described.

use super::cells::{COARSE, Cells, Grid};
use super::light::{Light, median};

/// Where one lump ends and the next begins: the saddle between two is lower than this part of the lower top. Of what is
/// large and stands out a reader of the picture says two tops sooner than of specks in a spot's foot.
const SADDLE: f32 = 0.4;
const SADDLE_OF_LARGE: f32 = 0.75;
/// Above this part of the lower top two tops are one.
const SEAM: f32 = 0.92;
/// A top is large from so many coarse cells on and this part of the higher one, and stands out by so many times the
/// roughness.
const LARGE: u32 = 8;
const LIKE: f32 = 0.15;
const STANDS_OUT: f32 = 5.0;
/// Coarse cells above this part of a top are its half.
const HALF: f32 = 0.5;
/// And its very top.
const TOP: f32 = 0.9;
/// No lump.
pub(super) const NONE: u16 = u16::MAX;

/// A lump of light.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Lump {
    /// Highest value above the light around.
    pub(super) peak: f32,
    /// Sum over its coarse cells.
    pub(super) sum: f64,
    /// Its middle, weighted \[coarse cells\].
    pub(super) middle: [f64; 2],
    /// Coarse cells above half of the peak.
    pub(super) half_cells: u32,
    /// Standard deviations of those along and across \[coarse cells\].
    pub(super) along: f64,
    pub(super) across: f64,
    /// Highest value at the target's edge.
    pub(super) at_edge: f32,
    /// Length of the target's edge that its top touches, in radii of the top taken as a disc.
    pub(super) contact: f64,
    /// Coarse cells of its top.
    pub(super) top_cells: u32,
    /// Though its top touches the edge the middle may be on the target.
    pub(super) may_be_cut: bool,
    /// It is no line and touches neither the target's edge nor a corner.
    pub(super) apart: bool,
    /// It has a second top.
    pub(super) seam: bool,
    label: u16,
}

/// Coarse cells above the light, and their lumps.
#[derive(Debug, Default)]
pub(super) struct Lumps {
    /// Above the light around, smoothed.
    pub(super) above: Grid,
    /// The lump that a coarse cell belongs to.
    pub(super) labels: Vec<u16>,
    pub(super) found: Vec<Lump>,
    /// Roughness of `above` where no lump is.
    pub(super) sigma: f64,
    /// Roughness of single coarse cells.
    pub(super) cell_sigma: f64,
    rest: Grid,
    order: Vec<u64>,
    parents: Vec<u16>,
    tops: Vec<f32>,
    counts: Vec<u32>,
    seams: Vec<u16>,
    sizes: Vec<f32>,
}

impl Lumps {
    /// Subtracts the light and finds what is left of it.
    pub(super) fn find(&mut self, cells: &Cells, light: &Light, floor: f64) {
        self.smooth(&cells.coarse, light);
        let bound = (4.0 * light.tile_sigma.max(floor)) as f32;
        let around = |grid: &Grid, sizes: &mut Vec<f32>| {
            let values = grid.values.iter().copied();
            let around = values.filter(|v| *v < bound && *v > -2.0 * bound);
            (1.4826 * median(sizes, around)).max(floor)
        };
        self.sigma = around(&self.above, &mut self.sizes).max(light.tile_sigma);
        self.cell_sigma = around(&self.rest, &mut self.sizes);
        self.divide(3.0 * self.sigma as f32);
        self.describe(cells);
    }

    /// 1 2 1 along rows and columns, over what there is.
    fn smooth(&mut self, coarse: &Grid, light: &Light) {
        let (width, height) = (coarse.width, coarse.height);
        self.rest.reset(width, height);
        self.above.reset(width, height);
        for row in 0..height {
            for column in 0..width {
                let value = coarse.values[row * width + column];
                if !value.is_nan() {
                    self.rest.values[row * width + column] =
                        value - light.at_coarse(column, row) as f32;
                }
            }
        }
        for row in 0..height {
            for column in 0..width {
                if self.rest.values[row * width + column].is_nan() {
                    continue;
                }
                let (mut sum, mut weights) = (0.0_f32, 0.0_f32);
                for near in row.saturating_sub(1)..(row + 2).min(height) {
                    for beside in column.saturating_sub(1)..(column + 2).min(width) {
                        let value = self.rest.values[near * width + beside];
                        if !value.is_nan() {
                            let weight = if near == row { 2.0 } else { 1.0 }
                                * if beside == column { 2.0 } else { 1.0 };
                            sum += weight * value;
                            weights += weight;
                        }
                    }
                }
                self.above.values[row * width + column] = sum / weights;
            }
        }
    }

    fn root(&self, mut label: u16) -> u16 {
        while self.parents[label as usize] != label {
            label = self.parents[label as usize];
        }
        label
    }

    /// Floods from the brightest cell down to `low`. Two lumps that meet become one unless the saddle between
    /// them is deep.
    fn divide(&mut self, low: f32) {
        let (width, height) = (self.above.width, self.above.height);
        self.labels.clear();
        self.labels.resize(width * height, NONE);
        self.parents.clear();
        self.tops.clear();
        self.counts.clear();
        self.seams.clear();
        self.order.clear();
        let outstanding = STANDS_OUT * self.sigma as f32;
        for (cell, &value) in self.above.values.iter().enumerate() {
            if value > low {
                // Bits of positive numbers are ordered as the numbers are.
                self.order
                    .push(u64::from(!value.to_bits()) << 32 | cell as u64);
            }
        }
        self.order.sort_unstable();
        for k in 0..self.order.len() {
            let cell = (self.order[k] & 0xffff_ffff) as usize;
            let value = self.above.values[cell];
            let (column, row) = (cell % width, cell / width);
            let mut mine = NONE;
            for near in row.saturating_sub(1)..(row + 2).min(height) {
                for beside in column.saturating_sub(1)..(column + 2).min(width) {
                    let label = self.labels[near * width + beside];
                    if label == NONE {
                        continue;
                    }
                    let other = self.root(label);
                    if mine == NONE || mine == other {
                        mine = other;
                        continue;
                    }
                    let (mut high, mut lower) = (mine, other);
                    if self.tops[lower as usize] > self.tops[high as usize] {
                        (high, lower) = (lower, high);
                    }
                    let top = self.tops[lower as usize];
                    let large = self.counts[lower as usize] >= LARGE
                        && top - value > outstanding
                        && top > LIKE * self.tops[high as usize];
                    if value >= if large { SADDLE_OF_LARGE } else { SADDLE } * top {
                        self.parents[lower as usize] = high;
                        self.counts[high as usize] += self.counts[lower as usize];
                        if large && value < SEAM * top {
                            self.seams.push(high);
                        }
                    }
                    mine = high;
                }
            }
            if mine == NONE {
                if self.parents.len() >= usize::from(NONE) {
                    continue;
                }
                mine = self.parents.len() as u16;
                self.parents.push(mine);
                self.tops.push(value);
                self.counts.push(0);
            }
            self.labels[cell] = mine;
            self.counts[mine as usize] += 1;
        }
        for k in 0..self.labels.len() {
            if self.labels[k] != NONE {
                self.labels[k] = self.root(self.labels[k]);
            }
        }
    }

    fn describe(&mut self, cells: &Cells) {
        let (width, height) = (self.above.width, self.above.height);
        self.found.clear();
        for label in 0..self.parents.len() as u16 {
            if self.parents[label as usize] != label {
                continue;
            }
            let peak = self.tops[label as usize];
            let mut lump = Lump {
                peak,
                sum: 0.0,
                middle: [0.0; 2],
                half_cells: 0,
                along: 0.0,
                across: 0.0,
                at_edge: 0.0,
                contact: 0.0,
                top_cells: 0,
                may_be_cut: false,
                apart: false,
                seam: self.seams.iter().any(|&seam| self.root(seam) == label),
                label,
            };
            let mut half = Moments::default();
            let (mut top, mut touching) = (0_u32, 0_u32);
            for row in 0..height {
                for column in 0..width {
                    let cell = row * width + column;
                    if self.labels[cell] != label {
                        continue;
                    }
                    let value = self.above.values[cell];
                    let [x, y] = [column as f64, row as f64];
                    lump.sum += f64::from(value);
                    lump.middle[0] += f64::from(value) * x;
                    lump.middle[1] += f64::from(value) * y;
                    let at_edge = cells.at_edge(column, row);
                    if at_edge {
                        lump.at_edge = lump.at_edge.max(value);
                    }
                    if value >= HALF * peak {
                        half.add(x, y);
                    }
                    if value >= TOP * peak {
                        top += 1;
                        touching += u32::from(at_edge);
                    }
                }
            }
            lump.middle = lump.middle.map(|sum| sum / lump.sum);
            lump.half_cells = half.count as u32;
            [lump.along, lump.across] = half.deviations();
            let radius = (f64::from(top) / std::f64::consts::PI).sqrt();
            lump.contact = f64::from(touching) / radius;
            lump.top_cells = top;
            self.found.push(lump);
        }
        self.found
            .sort_by(|a, b| b.sum.total_cmp(&a.sum).then(a.label.cmp(&b.label)));
    }

    /// How much of the smoothed light above at a coarse cell counts for a lump: its own cells and those around
    /// it that no lump has.
    pub(super) fn of(&self, lump: &Lump, column: usize, row: usize) -> Option<f32> {
        let cell = row * self.above.width + column;
        let value = self.above.values[cell];
        let label = self.labels[cell];
        (!value.is_nan() && (label == lump.label || label == NONE)).then_some(value)
    }

    /// Whether a cell beside this one is another lump's and brighter than `foot`.
    pub(super) fn meets(&self, lump: &Lump, column: usize, row: usize, foot: f32) -> bool {
        let (width, height) = (self.above.width, self.above.height);
        (row.saturating_sub(1)..(row + 2).min(height)).any(|y| {
            (column.saturating_sub(1)..(column + 2).min(width)).any(|x| {
                let label = self.labels[y * width + x];
                label != lump.label && label != NONE && self.above.values[y * width + x] > foot
            })
        })
    }

    /// Whether half of its peak reaches a coarse cell.
    pub(super) fn reaches(&self, lump: &Lump, at: [f64; 2]) -> bool {
        // Negative ones become the first.
        let [column, row] = at.map(|at| at.round() as usize);
        column < self.above.width
            && row < self.above.height
            && self.is_of(lump, column, row)
            && self.above.values[row * self.above.width + column] >= HALF * lump.peak
    }

    pub(super) fn is_of(&self, lump: &Lump, column: usize, row: usize) -> bool {
        self.labels[row * self.above.width + column] == lump.label
    }
}

/// Of cells that count alike.
#[derive(Debug, Default)]
struct Moments {
    count: f64,
    x: f64,
    y: f64,
    xx: f64,
    xy: f64,
    yy: f64,
}

impl Moments {
    fn add(&mut self, x: f64, y: f64) {
        self.count += 1.0;
        self.x += x;
        self.y += y;
        self.xx += x * x;
        self.xy += x * y;
        self.yy += y * y;
    }

    fn middle(&self) -> [f64; 2] {
        [self.x / self.count, self.y / self.count]
    }

    /// Along and across; a single cell is a square with 1/12.
    fn deviations(&self) -> [f64; 2] {
        let [x, y] = self.middle();
        let xx = self.xx / self.count - x * x + 1.0 / 12.0;
        let yy = self.yy / self.count - y * y + 1.0 / 12.0;
        let xy = self.xy / self.count - x * y;
        let (mean, half) = (0.5 * (xx + yy), 0.5 * (xx - yy));
        let spread = (half * half + xy * xy).sqrt();
        [
            (mean + spread).sqrt(),
            (mean - spread).max(1.0 / 12.0).sqrt(),
        ]
    }
}

/// Fine cells along a coarse cell, as a number.
pub(super) const FINE: f64 = COARSE as f64;
