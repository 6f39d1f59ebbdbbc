//! The straight edge of a shadow across the target.

use super::cells::{COARSE, Cells, Grid};
use super::light::{Edge, median};

/// Directions that the light may come from across the edge.
const DIRECTIONS: usize = 48;
/// Coarse cells between two parallel lines that are told apart.
const APART: f64 = 1.5;
/// A place belongs to an edge where the light changes by so many times its median change.
const STEEP: f64 = 4.0;
/// An edge is seen along this part of its way across the target, at least; a spot may hide the rest.
const SEEN: f64 = 0.5;

/// A place where the light changes.
#[derive(Debug, Clone, Copy)]
struct Slope {
    /// Coarse cells.
    place: [f64; 2],
    /// Towards the light.
    direction: [f64; 2],
    size: f64,
}

#[derive(Debug, Default)]
pub(super) struct EdgeScratch {
    slopes: Vec<Slope>,
    sizes: Vec<f32>,
    votes: Vec<u16>,
    seen: Vec<bool>,
}

impl EdgeScratch {
    /// The most conspicuous straight line along which the light changes in one sense, if there is one.
    pub(super) fn find(&mut self, cells: &Cells, floor: f64) -> Option<Edge> {
        self.collect(&cells.coarse, floor);
        let (width, height) = (cells.coarse.width as f64, cells.coarse.height as f64);
        let reach = width.hypot(height);
        let lines = (2.0 * reach / APART) as usize + 2;
        let normals: [[f64; 2]; DIRECTIONS] = std::array::from_fn(|k| {
            let (sine, cosine) =
                libm::sincos(2.0 * std::f64::consts::PI * k as f64 / DIRECTIONS as f64);
            [cosine, sine]
        });
        self.votes.clear();
        self.votes.resize(DIRECTIONS * lines, 0);
        for slope in &self.slopes {
            let angle = libm::atan2(slope.direction[1], slope.direction[0]);
            let turns = angle / (2.0 * std::f64::consts::PI) * DIRECTIONS as f64;
            let nearest = turns.round() as isize;
            for beside in -1..=1 {
                let k = (nearest + beside).rem_euclid(DIRECTIONS as isize) as usize;
                let offset = dot(normals[k], slope.place);
                let line = ((offset + reach) / APART) as usize;
                let votes = &mut self.votes[k * lines + line.min(lines - 1)];
                *votes = votes.saturating_add(1);
            }
        }
        // The first of the best.
        let mut best = 0;
        for (k, votes) in self.votes.iter().enumerate() {
            if *votes > self.votes[best] {
                best = k;
            }
        }
        let mut normal = normals[best / lines];
        let mut offset = ((best % lines) as f64 + 0.5) * APART - reach;
        let mut spread = 0.0;
        let mut within = 2.5;
        for _ in 0..5 {
            (normal, offset, spread) = self.straighten(normal, offset, within)?;
            within = (3.0 * spread.max(0.0).sqrt()).clamp(2.0, 8.0);
        }
        if self.part_seen(&cells.coarse, normal, offset) < SEEN {
            return None;
        }
        // A ramp of width w has the variance w^2/12 in its slope, a difference over two cells, each a mean, adds 5/12.
        let ramp = (12.0 * (spread - 5.0 / 12.0).max(0.0)).sqrt();
        let side = COARSE as f64;
        let middle = 0.5 * (side - 1.0);
        Some(Edge {
            normal,
            // Fine cell = 4 coarse cells + 1.5.
            offset: side * offset + middle * (normal[0] + normal[1]),
            ramp: (side * ramp).max(1.0),
        })
    }

    fn collect(&mut self, coarse: &Grid, floor: f64) {
        self.slopes.clear();
        for row in 1..coarse.height.saturating_sub(1) {
            let (above, here, below) = (coarse.row(row - 1), coarse.row(row), coarse.row(row + 1));
            for column in 1..coarse.width.saturating_sub(1) {
                let across = |row: &[f32]| row[column + 1] - row[column - 1];
                let along = |column: usize| below[column] - above[column];
                let right = across(above) + 2.0 * across(here) + across(below);
                let down = along(column - 1) + 2.0 * along(column) + along(column + 1);
                let [right, down] = [right, down].map(|sum| 0.125 * f64::from(sum));
                let size = right.hypot(down);
                if size > 0.0 {
                    self.slopes.push(Slope {
                        place: [column as f64, row as f64],
                        direction: [right / size, down / size],
                        size,
                    });
                }
            }
        }
        let sizes = self.slopes.iter().map(|slope| slope.size as f32);
        let steep = STEEP * median(&mut self.sizes, sizes).max(floor);
        self.slopes.retain(|slope| slope.size > steep);
    }

    fn near(&self, normal: [f64; 2], offset: f64, within: f64) -> impl Iterator<Item = &Slope> {
        self.slopes.iter().filter(move |slope| {
            (dot(normal, slope.place) - offset).abs() < within
                && dot(normal, slope.direction) > 0.87
        })
    }

    /// The line through the slopes near a line, and their variance across it.
    fn straighten(
        &self,
        normal: [f64; 2],
        offset: f64,
        within: f64,
    ) -> Option<([f64; 2], f64, f64)> {
        let (mut weight, mut mean, mut square) = (0.0, [0.0; 2], [0.0; 3]);
        for slope in self.near(normal, offset, within) {
            let [x, y] = slope.place;
            weight += slope.size;
            mean[0] += slope.size * x;
            mean[1] += slope.size * y;
            square[0] += slope.size * x * x;
            square[1] += slope.size * x * y;
            square[2] += slope.size * y * y;
        }
        if weight == 0.0 {
            return None;
        }
        let mean = mean.map(|sum| sum / weight);
        let xx = square[0] / weight - mean[0] * mean[0];
        let xy = square[1] / weight - mean[0] * mean[1];
        let yy = square[2] / weight - mean[1] * mean[1];
        // Along the line the spread is largest: half the angle of (xx - yy, 2 xy).
        let angle = 0.5 * libm::atan2(2.0 * xy, xx - yy);
        let (sine, cosine) = libm::sincos(angle);
        let mut across = [-sine, cosine];
        if dot(across, normal) < 0.0 {
            across = across.map(|c| -c);
        }
        let spread = across[0] * across[0] * xx
            + 2.0 * across[0] * across[1] * xy
            + across[1] * across[1] * yy;
        Some((across, dot(across, mean), spread))
    }

    /// Of the line's way across the target.
    fn part_seen(&mut self, coarse: &Grid, normal: [f64; 2], offset: f64) -> f64 {
        let along = [-normal[1], normal[0]];
        let reach = (coarse.width as f64).hypot(coarse.height as f64).ceil();
        let mut seen = std::mem::take(&mut self.seen);
        seen.clear();
        seen.resize(2 * reach as usize + 2, false);
        for slope in self.near(normal, offset, 1.5) {
            seen[(dot(along, slope.place) + reach) as usize] = true;
        }
        let (mut cells, mut count) = (0, 0);
        for (k, seen) in seen.iter().enumerate() {
            let t = k as f64 + 0.5 - reach;
            let [x, y] = [0, 1].map(|c| (offset * normal[c] + t * along[c]).round());
            if x < 1.0
                || y < 1.0
                || x + 1.0 >= coarse.width as f64
                || y + 1.0 >= coarse.height as f64
            {
                continue;
            }
            if !coarse.row(y as usize)[x as usize].is_nan() {
                cells += 1;
                count += usize::from(*seen);
            }
        }
        self.seen = seen;
        // Not a corner that is cut off.
        if 4 * cells < coarse.width.min(coarse.height) {
            return 0.0;
        }
        f64::from(count as u32) / f64::from(cells as u32)
    }
}

fn dot(a: [f64; 2], b: [f64; 2]) -> f64 {
    a[0] * b[0] + a[1] * b[1]
}
