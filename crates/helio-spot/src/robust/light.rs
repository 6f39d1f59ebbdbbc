//! The light on the target without the spot: a smooth surface, and the straight edge of a shadow where there is one.

use super::cells::{COARSE, Grid, TILE};

/// Without a shadow's edge constant, slopes, curvatures. With one constant, slopes, the step at the edge, how the slopes
/// change there (a shadow takes a part of the light), curvatures.
pub(super) const TERMS: usize = 9;
/// How many are used, and how many of those make planes.
const WITHOUT_EDGE: [usize; 2] = [6, 3];
const WITH_EDGE: [usize; 2] = [9, 6];
const LEVEL: [usize; 2] = [3, 3];
/// The step.
const STEP: usize = 3;
/// Pulls curvatures towards nought, in tiles' worth of evidence: a surface that is known on one side of a large
/// spot only must not bend away under it.
const CURVATURE_TILES: f64 = 3.0;
/// A tile that is brighter than the surface by so many standard deviations belongs to a spot, and one that is
/// darker to a mark or a shadow. The first is the narrower because a spot has a soft foot.
const BRIGHT: f64 = 2.5;
const DARK: f64 = 3.5;
/// Gray values within which the surface is never better known, as a part of white: a quarter of a step of 8 bits.
const FLOOR: f64 = 0.25 / 255.0;

/// See [`Light::bulges`]: parts of the light.
const UNFIT: f64 = 0.03;
const BULGE: f64 = 0.05;
/// See [`Light::swells`]: empty targets at Jülich have up to 0.124 by the lens, beams of 3 and 4 m on one of 8 m 0.19 and more.
const SWELL: f64 = 0.16;

/// Part of the tiles below the plane that a fit begins with: a spot of half the target leaves it within the light around.
const LOWER: f64 = 0.33;
/// And where a beam may leave hardly any without its light.
const LOWEST: f64 = 0.15;

/// Fine cells of a tile.
const TILE_AREA: f64 = (TILE * COARSE * TILE * COARSE) as f64;

/// Edge of a shadow: `normal . (column, row) = offset` in fine cells.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Edge {
    pub(super) normal: [f64; 2],
    pub(super) offset: f64,
    /// Width of the change from shadow to light \[fine cells\].
    pub(super) ramp: f64,
}

impl Edge {
    /// From -1/2 in the shadow to 1/2 in the light.
    fn step(&self, column: f64, row: f64) -> f64 {
        (self.distance(column, row) / self.ramp).clamp(-0.5, 0.5)
    }

    /// From the edge \[fine cells\].
    pub(super) fn distance(&self, column: f64, row: f64) -> f64 {
        self.normal[0] * column + self.normal[1] * row - self.offset
    }
}

/// What the light without the spot is taken for.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Ground {
    /// A quadratic surface.
    Curved,
    /// The same with a shadow's edge.
    Shaded(Edge),
    /// A plane through the darkest of the target.
    Level,
}

impl Ground {
    pub(super) fn of(edge: Option<Edge>) -> Self {
        edge.map_or(Self::Curved, Self::Shaded)
    }
}

/// The surface.
#[derive(Debug, Clone, Copy)]
pub(super) struct Light {
    terms: [f64; TERMS],
    pub(super) edge: Option<Edge>,
    /// Half the width and height \[fine cells\].
    half: [f64; 2],
    /// Standard deviation of the tiles that belong to it.
    pub(super) tile_sigma: f64,
    /// Variance of a mean over an area, times the area \[fine cells\]: what noise, folds and dirt leave in sums over
    /// areas as large as spots.
    pub(super) unrest: f64,
    /// Tiles that belong to it, of all.
    pub(super) share: f64,
    /// What it may be off as a whole, or at one side against the other.
    pub(super) doubt: f64,
    sums: Sums,
}

impl Light {
    /// Whether it rises towards the middle of the target and the tiles are far from it, as daylight does not and a beam does
    /// that leaves hardly any of the target without its light.
    pub(super) fn bulges(&self, white: f64) -> bool {
        let level = self.terms[0];
        self.tile_sigma > (UNFIT * level).max(4.0 * FLOOR * white)
            && self.curvature() < -BULGE * level
    }

    /// Whether it rises towards the middle more than a lens makes daylight, as under a beam so large that it is taken for it.
    pub(super) fn swells(&self) -> bool {
        self.curvature() < -SWELL * self.terms[0]
    }

    fn curvature(&self) -> f64 {
        let [_, first] = if self.edge.is_some() {
            WITH_EDGE
        } else {
            WITHOUT_EDGE
        };
        self.terms[first] + self.terms[first + 2]
    }

    /// At the fine cell (column, row).
    pub(super) fn at(&self, column: f64, row: f64) -> f64 {
        let basis = basis(self.half, self.edge.as_ref(), column, row);
        dot(&self.terms, &basis)
    }

    /// At coarse cell (column, row), whole numbers.
    pub(super) fn at_coarse(&self, column: usize, row: usize) -> f64 {
        let [x, y] = [middle(column, COARSE), middle(row, COARSE)];
        if self.is_even(x, y) {
            return self.at(x, y);
        }
        let mut sum = 0.0;
        for k in 0..COARSE * COARSE {
            let [right, down] = [k % COARSE, k / COARSE].map(|k| k as f64);
            sum += self.at(
                (column * COARSE) as f64 + right,
                (row * COARSE) as f64 + down,
            );
        }
        sum / (COARSE * COARSE) as f64
    }

    /// The least within coarse cell (column, row), near enough.
    pub(super) fn least_at_coarse(&self, column: usize, row: usize) -> f64 {
        let [x, y] = [middle(column, COARSE), middle(row, COARSE)];
        let at = self.at(x, y);
        if self.is_even(x, y) {
            at
        } else {
            // The whole step lower at the most.
            at - self.step()
        }
    }

    /// Whether no shadow's edge is in or beside the coarse cell whose middle is the fine cell (column, row).
    pub(super) fn is_even(&self, column: f64, row: f64) -> bool {
        self.edge
            .as_ref()
            .is_none_or(|edge| edge.distance(column, row).abs() > 0.5 * edge.ramp + COARSE as f64)
    }

    /// How badly the tiles are explained: the logarithm of the width of the distribution that each is drawn from, on
    /// average; a tile that does not belong to the surface may have any gray value up to white.
    pub(super) fn cost(&self, white: f64) -> f64 {
        self.share * libm::log(self.tile_sigma) + (1.0 - self.share) * libm::log(white)
    }

    /// Its terms' factors at the fine cell (column, row).
    pub(super) fn basis(&self, column: f64, row: f64) -> [f64; TERMS] {
        basis(self.half, self.edge.as_ref(), column, row)
    }

    /// Change per fine cell towards the light at a shadow's edge, over a coarse cell about the fine cell (column, row).
    pub(super) fn steepness(&self, column: f64, row: f64) -> f64 {
        self.edge.map_or(0.0, |edge| {
            let side = 0.5 * COARSE as f64;
            let [right, down] = edge.normal.map(|c| side * c);
            let rise =
                edge.step(column + right, row + down) - edge.step(column - right, row - down);
            self.terms[STEP] * rise / COARSE as f64
        })
    }

    /// Covariance of two sums of the terms with these factors.
    pub(super) fn covariance(&self, factors: &[[f64; TERMS]; 2]) -> [[f64; 2]; 2] {
        let mut sum = [[0.0; 2]; 2];
        for (column, factor) in factors.iter().enumerate() {
            let sums = Sums {
                right: *factor,
                ..self.sums
            };
            // It was solved once.
            if let Some(spread) = sums.solve() {
                for row in 0..2 {
                    sum[row][column] = self.unrest / TILE_AREA * dot(&factors[row], &spread);
                }
            }
        }
        sum
    }

    /// Height of the step at the shadow's edge, if there is one.
    pub(super) fn step(&self) -> f64 {
        if self.edge.is_some() {
            self.terms[STEP].abs()
        } else {
            0.0
        }
    }
}

/// Fine-cell coordinate of the middle of a cell that is `side` fine cells wide.
fn middle(index: usize, side: usize) -> f64 {
    (index * side) as f64 + 0.5 * (side - 1) as f64
}

fn basis(half: [f64; 2], edge: Option<&Edge>, column: f64, row: f64) -> [f64; TERMS] {
    let x = (column + 0.5) / half[0] - 1.0;
    let y = (row + 0.5) / half[1] - 1.0;
    let [p, q, r] = [x * x - 1.0 / 3.0, x * y, y * y - 1.0 / 3.0];
    edge.map_or([1.0, x, y, p, q, r, 0.0, 0.0, 0.0], |edge| {
        let step = edge.step(column, row);
        [1.0, x, y, step, step * x, step * y, p, q, r]
    })
}

fn dot(a: &[f64; TERMS], b: &[f64; TERMS]) -> f64 {
    let mut sum = 0.0;
    for k in 0..TERMS {
        sum += a[k] * b[k];
    }
    sum
}

/// Sums of a least-squares fit of the first `terms`.
#[derive(Debug, Clone, Copy)]
pub(super) struct Sums {
    products: [[f64; TERMS]; TERMS],
    right: [f64; TERMS],
    terms: usize,
}

impl Sums {
    fn new(terms: usize, planes: usize) -> Self {
        let mut products = [[0.0; TERMS]; TERMS];
        // A thousandth of a tile keeps what is not seen at nought.
        for (k, row) in products.iter_mut().enumerate().skip(1) {
            row[k] = if k < planes { 1e-3 } else { CURVATURE_TILES };
        }
        Self {
            products,
            right: [0.0; TERMS],
            terms,
        }
    }

    /// Of a quadratic in two variables, freely fitted.
    pub(super) fn quadratic() -> Self {
        Self {
            products: [[0.0; TERMS]; TERMS],
            right: [0.0; TERMS],
            terms: 6,
        }
    }

    pub(super) fn add(&mut self, basis: &[f64; TERMS], value: f64, weight: f64) {
        for row in 0..self.terms {
            let weighted = weight * basis[row];
            for (product, factor) in self.products[row].iter_mut().zip(&basis[..=row]) {
                *product += weighted * factor;
            }
            self.right[row] += weighted * value;
        }
    }

    /// By Cholesky; none where the tiles do not carry a surface.
    pub(super) fn solve(&self) -> Option<[f64; TERMS]> {
        let mut factor = self.products;
        let mut x = self.right;
        for row in 0..self.terms {
            let (above, below) = factor.split_at_mut(row);
            let own = &mut below[0];
            for (column, upper) in above.iter().enumerate() {
                let mut sum = own[column];
                for (a, b) in own[..column].iter().zip(upper) {
                    sum -= a * b;
                }
                own[column] = sum / upper[column];
            }
            let mut pivot = own[row];
            for (k, a) in own[..row].iter().enumerate() {
                pivot -= a * a;
                x[row] -= a * x[k];
            }
            if pivot.is_nan() || pivot < 1e-9 {
                return None;
            }
            own[row] = pivot.sqrt();
            x[row] /= own[row];
        }
        for row in (0..self.terms).rev() {
            for k in row + 1..self.terms {
                x[row] -= factor[k][row] * x[k];
            }
            x[row] /= factor[row][row];
        }
        Some(x)
    }
}

/// A tile of the fit.
#[derive(Debug, Clone, Copy)]
struct Tile {
    basis: [f64; TERMS],
    value: f64,
    cell: u32,
    /// Taken into the sums.
    taken: bool,
}

/// What a fit needs besides.
#[derive(Debug, Default)]
pub(super) struct LightScratch {
    tiles: Vec<Tile>,
    sizes: Vec<f32>,
    bright: Vec<bool>,
    rest: Vec<f32>,
}

impl LightScratch {
    /// The surface of the tiles; none where there are too few. `white` is the largest gray value.
    pub(super) fn fit(
        &mut self,
        tiles: &Grid,
        fine: [usize; 2],
        ground: Ground,
        white: f64,
    ) -> Option<Light> {
        let edge = match ground {
            Ground::Shaded(edge) => Some(edge),
            Ground::Curved | Ground::Level => None,
        };
        let half = [0.5 * fine[0] as f64, 0.5 * fine[1] as f64];
        let side = TILE * COARSE;
        self.tiles.clear();
        for row in 0..tiles.height {
            for (column, &value) in tiles.row(row).iter().enumerate() {
                let [x, y] = [middle(column, side), middle(row, side)];
                // A tile on the edge is partly in the shadow.
                let on_edge = edge.is_some_and(|edge| {
                    edge.distance(x, y).abs() < 0.5 * edge.ramp + 0.75 * side as f64
                });
                if !value.is_nan() && !on_edge {
                    self.tiles.push(Tile {
                        basis: basis(half, edge.as_ref(), x, y),
                        value: f64::from(value),
                        cell: (row * tiles.width + column) as u32,
                        taken: false,
                    });
                }
            }
        }
        if self.tiles.len() < 16 {
            return None;
        }
        let floor = FLOOR * white;
        let [used, planes] = match ground {
            Ground::Shaded(_) => WITH_EDGE,
            Ground::Curved => WITHOUT_EDGE,
            Ground::Level => LEVEL,
        };
        let level = ground == Ground::Level;
        let mut terms = self.low_plane(planes, floor, if level { LOWEST } else { LOWER })?;
        // Roughness from tile to tile, whatever lies upon the surface.
        let steps = tiles.values.windows(2).map(|pair| pair[1] - pair[0]);
        let rough = median(&mut self.sizes, steps.filter(|step| !step.is_nan()));
        let off = self.tiles.iter();
        let off = off.map(|tile| (tile.value - dot(&terms, &tile.basis)) as f32);
        // What is above the plane is the beam's.
        let off = off.filter(|off| !level || *off < 0.0);
        let mut sigma = median(&mut self.sizes, off).max(rough).max(floor);
        // The low plane lies below the surface: begin wide, from where most of the tiles near it are.
        let mut sums = Sums::new(used, planes);
        let mut low = -DARK * sigma;
        let mut high = 2.0 * BRIGHT * sigma;
        let mut settled = false;
        for _ in 0..20 {
            let mut changed = 0;
            for tile in &mut self.tiles {
                let residual = tile.value - dot(&terms, &tile.basis);
                let take = residual > low && residual < high;
                if take != tile.taken {
                    sums.add(&tile.basis, tile.value, if take { 1.0 } else { -1.0 });
                    tile.taken = take;
                    changed += 1;
                }
            }
            // What is between the plane and the beam's foot must not lift it.
            if changed == 0 && settled || level {
                break;
            }
            terms = sums.solve()?;
            let taken = self.tiles.iter().filter(|tile| tile.taken);
            let residuals = taken.map(|tile| (tile.value - dot(&terms, &tile.basis)) as f32);
            let found = 1.4826 * median(&mut self.sizes, residuals);
            // Not at once, lest one part of the target wins before the others are seen.
            let least = 0.7 * sigma;
            sigma = found.max(least).max(floor);
            settled = sigma > least;
            (low, high) = (-DARK * sigma, BRIGHT * sigma);
        }
        // The foot of a spot reaches into the tiles beside those that are told to be too bright.
        self.bright.clear();
        self.bright.resize(tiles.values.len(), false);
        for tile in &self.tiles {
            if !tile.taken && tile.value - dot(&terms, &tile.basis) > 0.0 {
                let (column, row) = (
                    tile.cell as usize % tiles.width,
                    tile.cell as usize / tiles.width,
                );
                for near in row.saturating_sub(1)..(row + 2).min(tiles.height) {
                    for beside in column.saturating_sub(1)..(column + 2).min(tiles.width) {
                        self.bright[near * tiles.width + beside] = true;
                    }
                }
            }
        }
        let mut without = sums;
        let mut left = 0;
        for tile in self.tiles.iter().filter(|tile| tile.taken) {
            if self.bright[tile.cell as usize] {
                without.add(&tile.basis, tile.value, -1.0);
            } else {
                left += 1;
            }
        }
        if 5 * left >= self.tiles.len()
            && !level
            && let Some(better) = without.solve()
        {
            terms = better;
            sums = without;
        }
        let unrest = self.unrest(tiles, &terms, sigma);
        let within = self.tiles.iter().filter(|tile| {
            let residual = tile.value - dot(&terms, &tile.basis);
            residual > -DARK * sigma && residual < DARK * sigma
        });
        let share = within.count() as f64 / self.tiles.len() as f64;
        Some(Light {
            terms,
            edge,
            half,
            tile_sigma: sigma,
            unrest,
            share,
            doubt: 0.0,
            sums,
        })
    }

    /// See [`Light::unrest`]: the largest of what squares of 1, 2 and 4 tiles say. Neighbours that have nothing to do
    /// with each other would make them all the same.
    fn unrest(&mut self, tiles: &Grid, terms: &[f64; TERMS], sigma: f64) -> f64 {
        let (width, height) = (tiles.width, tiles.height);
        self.rest.clear();
        self.rest.resize(width * height, f32::NAN);
        for tile in &self.tiles {
            let cell = tile.cell as usize;
            let residual = tile.value - dot(terms, &tile.basis);
            if !self.bright[cell] && residual.abs() < DARK * sigma {
                self.rest[cell] = residual as f32;
            }
        }
        let mut most = sigma * sigma;
        for side in [2, 4] {
            let (mut squares, mut count) = (0.0, 0);
            for row in (0..height.saturating_sub(side - 1)).step_by(side) {
                for column in (0..width.saturating_sub(side - 1)).step_by(side) {
                    let (mut sum, mut of) = (0.0, 0);
                    for near in row..row + side {
                        for value in &self.rest[near * width + column..][..side] {
                            if !value.is_nan() {
                                sum += f64::from(*value);
                                of += 1;
                            }
                        }
                    }
                    if 4 * of >= 3 * side * side {
                        squares += sum * sum / of as f64;
                        count += 1;
                    }
                }
            }
            if count >= 8 {
                most = most.max(squares / f64::from(count));
            }
        }
        most * TILE_AREA
    }

    /// A plane (and step) below which a part of the tiles is.
    fn low_plane(&self, planes: usize, floor: f64, part: f64) -> Option<[f64; TERMS]> {
        let mut terms = [0.0; TERMS];
        for pass in 0..12 {
            let mut sums = Sums::new(planes, planes);
            // Every other tile is enough for a start.
            for tile in self.tiles.iter().step_by(2) {
                let residual = tile.value - dot(&terms, &tile.basis);
                let weight = if pass == 0 {
                    1.0
                } else {
                    let side = if residual > 0.0 { part } else { 1.0 - part };
                    side / residual.abs().max(4.0 * floor)
                };
                sums.add(&tile.basis, tile.value, weight);
            }
            terms = sums.solve()?;
        }
        Some(terms)
    }
}

/// Median size of the values; nought of none.
pub(super) fn median(sizes: &mut Vec<f32>, values: impl Iterator<Item = f32>) -> f64 {
    sizes.clear();
    sizes.extend(values.map(f32::abs));
    middle_of(sizes)
}

/// Median size of the values, which are changed.
pub(super) fn median_of(values: &mut [f32]) -> f64 {
    for value in values.iter_mut() {
        *value = value.abs();
    }
    middle_of(values)
}

fn middle_of(sizes: &mut [f32]) -> f64 {
    if sizes.is_empty() {
        return 0.0;
    }
    let middle = sizes.len() / 2;
    let (_, &mut value, _) = sizes.select_nth_unstable_by(middle, f32::total_cmp);
    f64::from(value)
}
