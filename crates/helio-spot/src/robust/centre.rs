//! The centre of a lump at full resolution, and how certain it is.

use super::cells::{COARSE, Cells};
use super::light::{Light, TERMS};
use super::lumps::{FINE, Lump, Lumps, NONE};
use crate::target::Plane;

/// Light above this part of the peak counts wholly, above half of it in part.
const FOOT: f32 = 0.08;
/// Brighter than this part of white is as bright as the camera can tell.
pub(super) const SATURATED: f64 = 0.975;

/// What the fine cells of a lump say.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Centre {
    /// On the target.
    pub(super) place_m: [f64; 2],
    pub(super) covariance_m2: [[f64; 2]; 2],
    /// Light above the surroundings from which on it counted.
    pub(super) foot: f64,
    /// Fine cells that counted.
    pub(super) area: f64,
    /// Those brighter than half of the peak, and how many of those were as bright as the camera can tell.
    pub(super) half_area: f64,
    pub(super) saturated_area: f64,
    /// Brightest fine cell.
    pub(super) brightest: f64,
    /// Its shape is that of two beams which melt into one.
    pub(super) twin: bool,
    /// Another lump's light meets it.
    pub(super) beside: bool,
    /// Its highest light at the target's edge.
    pub(super) at_edge: f64,
}

impl Centre {
    /// Makes it less certain by so much along a direction.
    pub(super) fn spread(&mut self, sigma_m: f64, direction: [f64; 2]) {
        for r in 0..2 {
            for c in 0..2 {
                self.covariance_m2[r][c] += sigma_m * sigma_m * direction[r] * direction[c];
            }
        }
    }

    /// One standard deviation per component \[m\].
    pub(super) fn sigma_m(&self) -> f64 {
        (0.5 * (self.covariance_m2[0][0] + self.covariance_m2[1][1])).sqrt()
    }
}

/// Weighted sums over cells.
#[derive(Debug, Clone, Copy, Default)]
struct Sums {
    weight: f64,
    place: [f64; 2],
}

impl Sums {
    fn add(&mut self, weight: f64, place: [f64; 2]) {
        self.weight += weight;
        self.place[0] += weight * place[0];
        self.place[1] += weight * place[1];
    }

    fn middle(&self) -> [f64; 2] {
        self.place.map(|sum| sum / self.weight)
    }
}

/// Of a spot.
#[derive(Debug, Clone, Copy)]
struct Gaussian {
    middle_m: [f64; 2],
    /// Along u and v.
    deviation_m: [f64; 2],
    /// Its logarithm: uu, uv, vv.
    form: [f64; 3],
}

impl Gaussian {
    /// Off its middle.
    fn at(&self, [x, y]: [f64; 2]) -> f64 {
        let [xx, xy, yy] = self.form;
        libm::exp(xx * x * x + xy * x * y + yy * y * y)
    }
}

/// A coarse cell of the lump.
#[derive(Debug, Clone, Copy)]
pub(super) struct Part {
    pub(super) column: f64,
    pub(super) row: f64,
    /// Middle and derivative on the target.
    pub(super) place_m: [f64; 2],
    slopes: [[f64; 2]; 2],
    /// Its area on the target: of a fine cell, and with the weights of its fine cells.
    area: f64,
    pub(super) covered: f64,
    /// Sum of the squares of those weights.
    mask_squared: f64,
    /// Of the light around.
    brighter: f64,
    /// Smoothed light above it.
    pub(super) smooth: f64,
    /// Its light, weighted by its area on the target.
    pub(super) light: f64,
    /// What noise makes of that.
    pub(super) variance: f64,
    /// What light may be under marks.
    pub(super) hidden: f64,
    /// Some of it is as bright as the camera can tell.
    saturated: bool,
}

#[derive(Debug, Default)]
pub(super) struct CentreScratch {
    pub(super) parts: Vec<Part>,
    bends: Vec<f32>,
    /// Fine cells that counted for more than a half, row by row.
    counted: Vec<bool>,
    width: usize,
}

impl CentreScratch {
    /// The centre of mass of what is brighter than the light around, weighted by areas on the target. None where
    /// the plane has no place for it.
    pub(super) fn of(
        &mut self,
        lump: &Lump,
        lumps: &Lumps,
        cells: &Cells,
        light: &Light,
        plane: &Plane,
        white: f64,
    ) -> Option<Centre> {
        let foot = (FOOT * lump.peak).max(4.0 * lumps.sigma as f32);
        let (width, height) = (cells.coarse.width, cells.coarse.height);
        let mut whole = Sums::default();
        let mut core = Sums::default();
        let mut lost = Sums::default();
        let mut centre = Centre {
            foot: f64::from(foot),
            at_edge: f64::from(lump.at_edge),
            ..Centre::default()
        };
        self.parts.clear();
        self.bends.clear();
        self.counted.clear();
        self.width = cells.fine.width;
        self.counted
            .resize(cells.fine.width * cells.fine.height, false);
        let high = (SATURATED * white) as f32;
        for row in 0..height {
            for column in 0..width {
                // Smoothed light of the cell and of its neighbours; what another lump has does not count.
                let Some(corners) = around(lumps, lump, column, row) else {
                    continue;
                };
                if corners.iter().flatten().all(|value| *value <= 0.5 * foot) {
                    continue;
                }
                centre.beside |= lumps.meets(lump, column, row, foot);
                let middle = [FINE * column as f64 + 1.5, FINE * row as f64 + 1.5];
                let pixel = cells.middle_px(middle[0], middle[1]);
                let (place_m, slopes) = (plane.to_target(pixel)?, plane.target_slopes(pixel)?);
                let [[a, b], [c, d]] = slopes;
                let area = (a * d - b * c).abs();
                let mut part = Part {
                    column: middle[0],
                    row: middle[1],
                    place_m,
                    slopes,
                    area,
                    covered: 0.0,
                    mask_squared: 0.0,
                    brighter: 1.0,
                    smooth: f64::from(corners[1][1]),
                    light: 0.0,
                    variance: 0.0,
                    hidden: 0.0,
                    saturated: false,
                };
                let mut cells_counted = 0.0;
                // The light around is even enough within a coarse cell, but at a shadow's edge.
                let even = light.is_even(middle[0], middle[1]);
                let level = light.at(middle[0], middle[1]);
                let slope = [
                    light.at(middle[0] + 1.0, middle[1]) - level,
                    light.at(middle[0], middle[1] + 1.0) - level,
                ];
                let mut sums = Sums::default();
                let mut core_sums = Sums::default();
                let mut lost_sums = Sums::default();
                let rows = row * COARSE..((row + 1) * COARSE).min(cells.fine.height);
                let columns = column * COARSE..((column + 1) * COARSE).min(cells.fine.width);
                for fine_row in rows {
                    let y = fine_row as f64 - middle[1];
                    let values = &cells.fine.row(fine_row)[columns.clone()];
                    for (k, &value) in values.iter().enumerate() {
                        let x = k as f64 - 1.5;
                        let smooth = between(&corners, x as f32, y as f32);
                        let mask = ((smooth - 0.5 * foot) / (0.5 * foot)).clamp(0.0, 1.0);
                        if value.is_nan() {
                            part.hidden += area * f64::from(mask * smooth);
                            continue;
                        }
                        if mask == 0.0 {
                            continue;
                        }
                        let mask = f64::from(mask);
                        self.counted[fine_row * cells.fine.width + columns.start + k] = mask > 0.5;
                        let value = f64::from(value);
                        let around = if even {
                            level + slope[0] * x + slope[1] * y
                        } else {
                            light.at(middle[0] + x, fine_row as f64)
                        };
                        let above = value - around;
                        sums.add(mask * above, [x, y]);
                        cells_counted += mask;
                        part.mask_squared += mask * mask;
                        centre.brightest = centre.brightest.max(value);
                        let inner = f64::from((smooth - 0.4 * lump.peak) / (0.2 * lump.peak))
                            .clamp(0.0, 1.0);
                        if inner > 0.0 {
                            core_sums.add(inner * above, [x, y]);
                        }
                        if smooth > 0.5 * lump.peak {
                            centre.half_area += 1.0;
                        }
                        if value >= f64::from(high) {
                            centre.saturated_area += 1.0;
                            part.saturated = true;
                            lost_sums.add(above, [x, y]);
                        }
                    }
                    // A row of each coarse cell is enough.
                    if fine_row % COARSE == 1 {
                        let bends = values.windows(3);
                        let bends = bends.map(|three| three[0] - 2.0 * three[1] + three[2]);
                        self.bends.extend(bends.filter(|bend| !bend.is_nan()));
                    }
                }
                centre.area += cells_counted;
                part.covered = area * cells_counted;
                part.light = area * sums.weight;
                part.brighter += (sums.weight / (cells_counted * level).max(1.0)).max(0.0);
                let block = cells.block as f64;
                for (to, from) in [
                    (&mut whole, sums),
                    (&mut core, core_sums),
                    (&mut lost, lost_sums),
                ] {
                    to.weight += area * from.weight;
                    for k in 0..2 {
                        let along = slopes[k][0] * from.place[0] + slopes[k][1] * from.place[1];
                        to.place[k] += area * (place_m[k] * from.weight + block * along);
                    }
                }
                self.parts.push(part);
            }
        }
        if whole.weight.is_nan() || whole.weight <= 0.0 {
            return None;
        }
        centre.place_m = whole.middle();
        self.weigh_noise(lumps, light);
        centre.covariance_m2 = self.covariance(&centre, &whole, cells, light);
        centre.twin = self.twin(&mut centre, light, f64::from(lump.peak));
        if core.weight > 0.0 {
            let inner = core.middle();
            let off = [0, 1].map(|k| inner[k] - centre.place_m[k]);
            centre.spread(SHAPE, off);
        }
        if lost.weight > 0.0 {
            let share = LOST * lost.weight / whole.weight;
            let at = lost.middle();
            let off = [0, 1].map(|k| at[k] - centre.place_m[k]);
            centre.spread(share, off);
        }
        Some(centre)
    }

    /// Nothing counted.
    pub(super) fn clear(&mut self) {
        self.counted.clear();
    }

    /// The sides between fine cells that counted and those that did not, from one end to the other in fine cells.
    pub(super) fn sides(&self) -> impl Iterator<Item = [[f64; 2]; 2]> {
        let width = self.width.max(1);
        let height = self.counted.len() / width;
        let counted = move |column: usize, row: usize| {
            column < width && row < height && self.counted[row * width + column]
        };
        // Above and left of each cell, and of one cell more at the right and below.
        (0..=height)
            .flat_map(move |row| (0..=width).map(move |column| (column, row)))
            .flat_map(move |(column, row)| {
                let own = counted(column, row);
                let corner = [column as f64 - 0.5, row as f64 - 0.5];
                let left = column > 0 && counted(column - 1, row);
                let above = row > 0 && counted(column, row - 1);
                let side = |differs: bool, to: [f64; 2]| differs.then_some([corner, to]);
                [
                    side(own != left, [corner[0], corner[1] + 1.0]),
                    side(own != above, [corner[0] + 1.0, corner[1]]),
                ]
            })
            .flatten()
    }

    /// The way to where the centre would be with what is not seen of a spot that the target's edge cuts: the part beyond
    /// the edge of the Gaussian that fits what is seen best. None where no Gaussian fits. `at_edge` is the part of its
    /// peak that is seen at the edge: where the Gaussian wants more, less is missing.
    pub(super) fn beyond(&self, centre: &Centre, plane: &Plane, at_edge: f64) -> Option<[f64; 2]> {
        let shape = self.gaussian(centre)?;
        let half = [0.5 * plane.board().width_m, 0.5 * plane.board().height_m];
        let (mut seen, mut unseen) = (Sums::default(), Sums::default());
        let mut wanted = 0.0_f64;
        let reach = shape.deviation_m.map(|sigma| 4.0 * sigma);
        let steps = 40;
        for row in -steps..=steps {
            for column in -steps..=steps {
                let off = [column, row].map(|k| f64::from(k) / f64::from(steps));
                let off = [off[0] * reach[0], off[1] * reach[1]];
                let place = [shape.middle_m[0] + off[0], shape.middle_m[1] + off[1]];
                let weight = shape.at(off);
                if place[0].abs() <= half[0] && place[1].abs() <= half[1] {
                    seen.add(weight, place);
                } else {
                    unseen.add(weight, place);
                    wanted = wanted.max(weight);
                }
            }
        }
        // Of a spot of which less than a half is seen the rest is a guess.
        if unseen.weight == 0.0 || unseen.weight > seen.weight {
            return None;
        }
        let missing = unseen.weight * (at_edge / wanted).min(1.0);
        let share = missing / (seen.weight + missing);
        let beyond = unseen.middle();
        Some([0, 1].map(|k| share * (beyond[k] - centre.place_m[k])))
    }

    /// Whether the Gaussian through what is seen has its top on the target.
    pub(super) fn is_topped(&self, centre: &Centre, plane: &Plane) -> bool {
        let board = plane.board();
        self.gaussian(centre).is_some_and(|shape| {
            let half = [0.5 * board.width_m, 0.5 * board.height_m];
            (0..2).all(|k| shape.middle_m[k].abs() < half[k] - TOP_WITHIN * shape.deviation_m[k])
        })
    }

    /// The Gaussian whose logarithm, a quadratic, fits that of the smoothed light best, each cell weighted by the square
    /// of its light, as its noise demands (Guo, IEEE Signal Process. Mag. 28 (2011) 134).
    fn gaussian(&self, centre: &Centre) -> Option<Gaussian> {
        let mut sums = super::light::Sums::quadratic();
        let brightest = self
            .parts
            .iter()
            .map(|part| part.smooth)
            .fold(0.0, f64::max);
        for part in &self.parts {
            if part.smooth > 0.2 * brightest && !part.saturated {
                let [x, y] = [0, 1].map(|k| part.place_m[k] - centre.place_m[k]);
                let basis = [1.0, x, y, x * x, x * y, y * y, 0.0, 0.0, 0.0];
                sums.add(&basis, libm::log(part.smooth), part.smooth * part.smooth);
            }
        }
        let [_, a, b, aa, ab, bb, ..] = sums.solve()?;
        // ln f = c + a x + b y + aa x^2 + ab x y + bb y^2: the top is where the slopes vanish.
        let determinant = 4.0 * aa * bb - ab * ab;
        if aa.is_nan() || aa >= 0.0 || bb >= 0.0 || determinant <= 0.0 {
            return None;
        }
        let off = [
            (ab * b - 2.0 * bb * a) / determinant,
            (ab * a - 2.0 * aa * b) / determinant,
        ];
        Some(Gaussian {
            middle_m: [0, 1].map(|k| centre.place_m[k] + off[k]),
            deviation_m: [
                (-2.0 * bb / determinant).sqrt(),
                (-2.0 * aa / determinant).sqrt(),
            ],
            form: [aa, ab, bb],
        })
    }

    /// What noise, as it is seen beside the spot and in it, makes of the light of each cell.
    fn weigh_noise(&mut self, lumps: &Lumps, light: &Light) {
        // Of a fine cell, if neighbours had nothing to do with each other.
        let beside = (lumps.cell_sigma * lumps.cell_sigma * FINE * FINE).max(light.unrest);
        // Brighter cells are noisier.
        let bend = 1.4826 * super::light::median_of(&mut self.bends);
        let noisier = (bend * bend / 6.0 - beside).max(0.0);
        for part in &mut self.parts {
            // Folds and dirt take their part of the spot's light too.
            let within = beside * part.brighter * part.brighter + noisier;
            part.variance = part.area * part.area * part.mask_squared * within;
        }
    }

    /// Of noise and of the light around.
    fn covariance(
        &self,
        centre: &Centre,
        whole: &Sums,
        cells: &Cells,
        light: &Light,
    ) -> [[f64; 2]; 2] {
        let block = cells.block as f64;
        let mut sum = self.doubt_of(light, |part| {
            [0, 1].map(|k| part.place_m[k] - centre.place_m[k])
        });
        let total = whole.weight * whole.weight;
        // A cell's own extent.
        let extent = block * block * FINE * FINE / 12.0;
        for part in &self.parts {
            let [[a, b], [c, d]] = part.slopes;
            let own = [
                [extent * (a * a + b * b), extent * (a * c + b * d)],
                [extent * (a * c + b * d), extent * (c * c + d * d)],
            ];
            for r in 0..2 {
                for c in 0..2 {
                    sum[r][c] += part.variance * own[r][c];
                }
            }
        }
        sum.map(|row| row.map(|value| value / total))
    }

    /// Covariance of two sums over the light of the cells, each with a factor, by noise and by what the light around may be
    /// off.
    pub(super) fn doubt_of(
        &self,
        light: &Light,
        factors: impl Fn(&Part) -> [f64; 2],
    ) -> [[f64; 2]; 2] {
        let mut sum = [[0.0; 2]; 2];
        let mut lever = [[0.0; TERMS]; 2];
        // Of a shadow's edge that is not quite where, nor as wide as it was found.
        let mut shifted = [0.0; 2];
        for part in &self.parts {
            let factors = factors(part);
            let basis = light.basis(part.column, part.row);
            let steep = light.steepness(part.column, part.row);
            for r in 0..2 {
                for c in 0..2 {
                    sum[r][c] += part.variance * (factors[r] * factors[c]);
                }
                for (to, term) in lever[r].iter_mut().zip(&basis) {
                    *to += part.covered * factors[r] * term;
                }
                shifted[r] += part.covered * factors[r] * steep;
            }
        }
        let surface = light.covariance(&lever);
        for r in 0..2 {
            for c in 0..2 {
                let edge = EDGE_SHIFT * EDGE_SHIFT * shifted[r] * shifted[c];
                let plane: f64 = (0..3).map(|k| lever[r][k] * lever[c][k]).sum();
                sum[r][c] += surface[r][c] + edge + light.doubt * light.doubt * plane;
            }
        }
        sum
    }
}

/// How far within the edge a top is to be that is seen in part, in standard deviations.
const TOP_WITHIN: f64 = 0.2;
/// How well the place of a shadow's edge is known \[fine cells\].
const EDGE_SHIFT: f64 = 0.3;
/// How far the response of a camera that was not measured may draw the centre towards the brightest part: a part of
/// the way from the centre of all light to that of the brighter half.
const SHAPE: f64 = 0.5;
/// Light beyond white, as a part of what is seen where the picture is white.
const LOST: f64 = 0.25;

/// Smoothed light at a coarse cell and its eight neighbours, rows from the top; nought where it is not the lump's.
/// None where the middle is not the lump's nor beside it.
fn around(lumps: &Lumps, lump: &Lump, column: usize, row: usize) -> Option<[[f32; 3]; 3]> {
    let own = lumps.of(lump, column, row);
    if own.is_none() && lumps.labels[row * lumps.above.width + column] != NONE {
        return None;
    }
    let mut corners = [[f32::NAN; 3]; 3];
    let mut any = false;
    for (j, line) in corners.iter_mut().enumerate() {
        for (i, value) in line.iter_mut().enumerate() {
            let (Some(x), Some(y)) = ((column + i).checked_sub(1), (row + j).checked_sub(1)) else {
                continue;
            };
            if x >= lumps.above.width || y >= lumps.above.height {
                continue;
            }
            any |= lumps.is_of(lump, x, y);
            if let Some(found) = lumps.of(lump, x, y) {
                *value = found;
            } else if !lumps.above.values[y * lumps.above.width + x].is_nan() {
                // Another lump's.
                *value = 0.0;
            }
        }
    }
    if !any {
        return None;
    }
    // Beyond the edge and under marks: as in the cell itself, or nought.
    let own = own.unwrap_or(0.0);
    for value in corners.iter_mut().flatten() {
        if value.is_nan() {
            *value = own;
        }
    }
    Some(corners)
}

/// Between the middles of coarse cells; x and y in fine cells from the middle one's.
fn between(corners: &[[f32; 3]; 3], x: f32, y: f32) -> f32 {
    let (i, p) = if x < 0.0 {
        (0, 1.0 + x / COARSE as f32)
    } else {
        (1, x / COARSE as f32)
    };
    let (j, q) = if y < 0.0 {
        (0, 1.0 + y / COARSE as f32)
    } else {
        (1, y / COARSE as f32)
    };
    let line = |j: usize| corners[j][i] + p * (corners[j][i + 1] - corners[j][i]);
    line(j) + q * (line(j + 1) - line(j))
}
