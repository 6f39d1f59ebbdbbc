//! Isolines of a map, calm where its numbers are noisy.

use contour::ContourBuilder;

use crate::FigureError;
use crate::ticks::ticks;

/// Sides of the grid that isolines are drawn from: finer ones are averaged.
const FINEST: usize = 160;
/// Noise of the bins over the peak up to which a map is taken as it is.
const CALM: f64 = 0.008;
/// Above this much noise, after smoothing, there are few lines.
const ROUGH: f64 = 0.03;

/// Isolines of one value, in parts of the map's width and height.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Isolines {
    pub(super) value: f64,
    pub(super) lines: Vec<Vec<(f64, f64)>>,
}

/// Isolines of a map, and how many bins the map was smoothed over for them (a standard deviation, 0: none).
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Contours {
    pub(super) levels: Vec<Isolines>,
    pub(super) smoothed_bins: f64,
}

/// Isolines at round values, which are counted in units of `1 / factor`.
pub(super) fn contours(
    values: &[f64],
    [rows, columns]: [usize; 2],
    factor: f64,
) -> Result<Contours, FigureError> {
    let mut map = Averaged::of(values, rows, columns);
    let mut passes = 0;
    let peak = |map: &Averaged| map.values.iter().copied().fold(0.0, f64::max);
    let most_passes = map.most_passes(peak(&map));
    while passes < most_passes && map.noise(peak(&map)) > CALM * peak(&map) {
        map.smooth();
        passes += 1;
    }
    let greatest = peak(&map);
    let most = if map.noise(greatest) > ROUGH * greatest {
        3
    } else {
        8
    };
    let mut thresholds = ticks(0.0, greatest * factor, most);
    thresholds.retain(|&t| t > 0.0 && t < greatest * factor);
    let thresholds: Vec<f64> = thresholds.iter().map(|t| t / factor).collect();
    let builder = ContourBuilder::new(map.columns, map.rows, true);
    let found = builder
        .lines(&map.values, &thresholds)
        .map_err(|error| FigureError::Pixels {
            why: format!("isolines: {error}"),
        })?;
    let levels = found
        .iter()
        .map(|line| Isolines {
            value: line.threshold(),
            lines: line
                .geometry()
                .iter()
                .flat_map(|ring| map.open(ring.coords().map(|c| (c.x, c.y)).collect()))
                .collect(),
        })
        .collect();
    let block = map.block[0].max(map.block[1]) as f64;
    Ok(Contours {
        levels,
        smoothed_bins: block * (0.5 * f64::from(passes)).sqrt(),
    })
}

/// Means over blocks of bins.
struct Averaged {
    values: Vec<f64>,
    rows: usize,
    columns: usize,
    /// Rows and columns of bins of a block; the last may be smaller.
    block: [usize; 2],
    /// Bins of the whole map.
    bins: [usize; 2],
}

impl Averaged {
    fn of(values: &[f64], rows: usize, columns: usize) -> Self {
        let block = [rows, columns].map(|n| n.div_ceil(FINEST));
        let (to_rows, to_columns) = (rows.div_ceil(block[0]), columns.div_ceil(block[1]));
        Self {
            values: averaged(values, [rows, columns], block),
            rows: to_rows,
            columns: to_columns,
            block,
            bins: [rows, columns],
        }
    }

    /// Standard deviation of the noise of bins that are lit, by the differences that a smooth map does not have
    /// (Immerkær 1996, with the median in place of the mean so that edges of a spot do not count).
    fn noise(&self, peak: f64) -> f64 {
        if self.rows < 3 || self.columns < 3 {
            return 0.0;
        }
        let at = |row: usize, column: usize| self.values[row * self.columns + column];
        let mut rough = Vec::new();
        for r in 1..self.rows - 1 {
            for c in 1..self.columns - 1 {
                if at(r, c) < 0.05 * peak {
                    continue;
                }
                let straight = at(r - 1, c) + at(r + 1, c) + at(r, c - 1) + at(r, c + 1);
                let oblique =
                    at(r - 1, c - 1) + at(r - 1, c + 1) + at(r + 1, c - 1) + at(r + 1, c + 1);
                rough.push((oblique - 2.0 * straight + 4.0 * at(r, c)).abs() / 6.0);
            }
        }
        rough.sort_by(f64::total_cmp);
        rough
            .get(rough.len() / 2)
            .map_or(0.0, |median| median / 0.6745)
    }

    /// So many passes that a spot keeps its shape: they spread a point by a quarter of the spot's radius.
    fn most_passes(&self, peak: f64) -> u32 {
        let bright = self.values.iter().filter(|&&v| v > 0.5 * peak).count();
        (bright / 25).min(24) as u32
    }

    /// Each bin gets a quarter of either neighbour, along rows and then along columns.
    fn smooth(&mut self) {
        let (rows, columns) = (self.rows, self.columns);
        let pass = |values: &[f64], along: &dyn Fn(usize, usize, bool) -> usize| -> Vec<f64> {
            let bin = |i: usize| {
                let (row, column) = (i / columns, i % columns);
                let (before, after) = (along(row, column, false), along(row, column, true));
                0.5 * values[i] + 0.25 * (values[before] + values[after])
            };
            (0..values.len()).map(bin).collect()
        };
        let step = |at: usize, count: usize, up: bool| {
            if up {
                (at + 1).min(count - 1)
            } else {
                at.saturating_sub(1)
            }
        };
        let across =
            |row: usize, column: usize, up: bool| row * columns + step(column, columns, up);
        let down = |row: usize, column: usize, up: bool| step(row, rows, up) * columns + column;
        self.values = pass(&pass(&self.values, &across), &down);
    }

    /// A ring in blocks as lines in parts of the map, without what runs along the border: there the library closes
    /// rings as if there were no light beyond.
    fn open(&self, ring: Vec<(f64, f64)>) -> Vec<Vec<(f64, f64)>> {
        let (width, height) = (self.columns as f64, self.rows as f64);
        let border = |&(x, y): &(f64, f64)| x <= 0.0 || y <= 0.0 || x >= width || y >= height;
        let mut points = ring;
        let mut closed = true;
        if let Some(first) = points.iter().position(border) {
            // begin at the border; the last point of a ring is its first
            points.pop();
            points.rotate_left(first);
            closed = false;
        }
        let mut lines: Vec<Vec<(f64, f64)>> = Vec::new();
        for line in points.split(border).filter(|line| line.len() > 1) {
            let [rows, columns] = [0, 1];
            lines.push(
                line.iter()
                    .map(|&(x, y)| (self.part(x, columns), self.part(y, rows)))
                    .collect(),
            );
        }
        debug_assert!(!closed || lines.len() <= 1);
        lines
    }

    /// From blocks, whose middles are at halves, to a part of the map's side.
    fn part(&self, at: f64, side: usize) -> f64 {
        let (block, bins) = (self.block[side], self.bins[side]);
        let count = bins.div_ceil(block);
        let middle = |k: usize| {
            let (from, to) = (k * block, ((k + 1) * block).min(bins));
            0.5 * (from + to) as f64 / bins as f64
        };
        let low = ((at - 0.5).max(0.0) as usize).min(count.saturating_sub(2));
        let high = (low + 1).min(count - 1);
        middle(low) + (middle(high) - middle(low)) * (at - 0.5 - low as f64)
    }
}

/// Means over blocks of bins, of which the last of a row or column may be smaller.
pub(super) fn averaged(
    values: &[f64],
    [rows, columns]: [usize; 2],
    [down, across]: [usize; 2],
) -> Vec<f64> {
    if down == 1 && across == 1 {
        return values.to_vec();
    }
    let mut out = Vec::with_capacity(rows.div_ceil(down) * columns.div_ceil(across));
    for top in (0..rows).step_by(down) {
        let bottom = (top + down).min(rows);
        for left in (0..columns).step_by(across) {
            let right = (left + across).min(columns);
            let sum: f64 = (top..bottom)
                .flat_map(|row| &values[row * columns + left..row * columns + right])
                .sum();
            out.push(sum / ((bottom - top) * (right - left)) as f64);
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    fn made(rows: usize, columns: usize, value: impl Fn(f64, f64) -> f64) -> Vec<f64> {
        (0..rows * columns)
            .map(|i| {
                let (row, column) = (i / columns, i % columns);
                value(
                    (column as f64 + 0.5) / columns as f64,
                    (row as f64 + 0.5) / rows as f64,
                )
            })
            .collect()
    }

    // A cone of light has circles, whose radii follow from its slope.
    #[test]
    fn a_cone_has_circles() {
        for side in [64, 500] {
            let cone = made(side, side, |x, y| {
                (8.0 - 20.0 * (x - 0.5).hypot(y - 0.5)).max(0.0)
            });
            let found = contours(&cone, [side, side], 1.0).unwrap();
            assert_eq!(found.smoothed_bins, 0.0);
            assert_eq!(found.levels.len(), 7); // 1 to 7 below the peak of nearly 8
            for level in &found.levels {
                assert_eq!(level.lines.len(), 1, "{}", level.value);
                let wanted = (8.0 - level.value) / 20.0;
                for &(x, y) in &level.lines[0] {
                    let radius = (x - 0.5).hypot(y - 0.5);
                    assert!((radius - wanted).abs() < 0.004, "{radius} {wanted}");
                }
                assert_eq!(level.lines[0].first(), level.lines[0].last());
            }
        }
    }

    // Lines of a ramp end at the border; nothing runs along it.
    #[test]
    fn a_ramp_has_straight_open_lines() {
        let ramp = made(20, 40, |x, _| 10.0 * x);
        let found = contours(&ramp, [20, 40], 1.0).unwrap();
        let values: Vec<f64> = found.levels.iter().map(|level| level.value).collect();
        assert_eq!(values, [2.0, 4.0, 6.0, 8.0]);
        for level in &found.levels {
            assert_eq!(level.lines.len(), 1);
            for &(x, y) in &level.lines[0] {
                assert!((x - 0.1 * level.value).abs() < 1e-12);
                assert!((0.0..=1.0).contains(&y));
            }
        }
    }

    #[test]
    fn maps_without_slope_have_no_lines() {
        for values in [vec![3.0; 12], vec![0.0; 12]] {
            let found = contours(&values, [3, 4], 1.0).unwrap();
            assert!(found.levels.iter().all(|level| level.lines.is_empty()));
        }
        for shape in [[1, 1], [1, 6], [6, 1]] {
            let values: Vec<f64> = (0..shape[0] * shape[1]).map(|i| i as f64).collect();
            let found = contours(&values, shape, 1.0).unwrap();
            assert!(found.levels.iter().all(|level| level.lines.is_empty()));
        }
    }

    // Ten per cent of noise on a broad spot: the lines stay few, near the circles of the spot without it.
    #[test]
    fn noise_is_smoothed_before_lines_are_drawn() {
        let mut seed = 1_u64;
        let mut dice = || {
            seed = seed
                .wrapping_mul(6_364_136_223_846_793_005)
                .wrapping_add(1_442_695_040_888_963_407);
            (seed >> 11) as f64 / (1_u64 << 53) as f64 - 0.5
        };
        let spot = |x: f64, y: f64| {
            let r = (x - 0.5).hypot(y - 0.5) / 0.2;
            10.0 * (-0.5 * r * r).exp()
        };
        let mut noisy = made(128, 128, spot);
        for value in &mut noisy {
            *value *= 1.0 + 0.1 * 12_f64.sqrt() * dice();
        }
        let found = contours(&noisy, [128, 128], 1.0).unwrap();
        assert!(found.smoothed_bins > 0.5);
        for level in &found.levels {
            let long = level.lines.iter().max_by_key(|line| line.len()).unwrap();
            if level.value < 9.0 {
                for &(x, y) in long {
                    assert!((spot(x, y) - level.value).abs() < 0.8);
                }
            }
        }
        let lines: usize = found.levels.iter().map(|level| level.lines.len()).sum();
        assert!(lines < 30, "{lines}");
    }
}
