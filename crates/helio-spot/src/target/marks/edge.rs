//! The edges of a mark's arms at full resolution.

use super::coarse::Candidate;
use super::{JOINT_SHARE, Mark};
use crate::image::{Gray, View};

/// At most so many profiles across an edge.
const PROFILES: usize = 64;
/// Profiles to each side whose gray levels are used together.
const NEAR: usize = 3;
/// Board less mark must be this share of the board.
const CONTRAST: f64 = 0.15;

/// A straight line with its uncertainty: points at + x·along + (offset + slope·x)·out.
#[derive(Debug, Clone, Copy)]
pub(super) struct Line {
    at: [f64; 2],
    along: [f64; 2],
    out: [f64; 2],
    offset: f64,
    slope: f64,
    /// Covariance of offset and slope: 00, 01, 11.
    spread: [f64; 3],
    /// How far to both sides of `at` it was fitted.
    half: f64,
}

impl Line {
    /// Unit vector along it, as precise as the line.
    pub(super) fn direction(&self) -> [f64; 2] {
        let d = [0, 1].map(|k| self.along[k] + self.slope * self.out[k]);
        let size = d[0].hypot(d[1]);
        d.map(|c| c / size)
    }

    /// Standard deviation of its direction \[rad\].
    pub(super) fn direction_sigma(&self) -> f64 {
        self.spread[2].sqrt()
    }

    /// Where it crosses another, and the covariance of that as xx, xy, yy.
    pub(super) fn crossing(&self, other: &Self) -> Option<([f64; 2], [f64; 3])> {
        // A point p of a line has n·(p - at) = offset with n = out - slope·along.
        let [m, n] = [self, other].map(|l| [0, 1].map(|k| l.out[k] - l.slope * l.along[k]));
        let [f, g] = [self, other];
        let right = [
            f.offset + m[0] * f.at[0] + m[1] * f.at[1],
            g.offset + n[0] * g.at[0] + n[1] * g.at[1],
        ];
        let det = m[0] * n[1] - m[1] * n[0];
        if det.abs() < 0.2 {
            return None;
        }
        let p = [
            (right[0] * n[1] - right[1] * m[1]) / det,
            (right[1] * m[0] - right[0] * n[0]) / det,
        ];
        // A shift d of a line along its normal moves the crossing along the other line.
        let [v, w] = [f.variance(p), g.variance(p)];
        let [a, b] = [[n[1] / det, -n[0] / det], [-m[1] / det, m[0] / det]];
        Some((
            p,
            [
                v * a[0] * a[0] + w * b[0] * b[0],
                v * a[0] * a[1] + w * b[0] * b[1],
                v * a[1] * a[1] + w * b[1] * b[1],
            ],
        ))
    }

    /// The same with its direction less certain by so much \[rad\].
    pub(super) fn turned_by(mut self, sigma_rad: f64) -> Self {
        self.spread[2] += sigma_rad * sigma_rad;
        self
    }

    /// Variance of its place along the normal next to a point.
    fn variance(&self, p: [f64; 2]) -> f64 {
        let x = (p[0] - self.at[0]) * self.along[0] + (p[1] - self.at[1]) * self.along[1];
        let [aa, ab, bb] = self.spread;
        (aa + x * (2.0 * ab + x * bb)).max(0.0)
    }

    /// The line midway between two opposite edges of a bar, seen along the first one's normal.
    fn midway(&self, other: &Self) -> Self {
        Self {
            at: [0, 1].map(|k| 0.5 * (self.at[k] + other.at[k])),
            offset: 0.5 * (self.offset - other.offset),
            slope: 0.5 * (self.slope - other.slope),
            spread: [0, 1, 2].map(|k| 0.25 * (self.spread[k] + other.spread[k])),
            ..*self
        }
    }

    /// The straight line whose picture through a lens this one was fitted to; `undo` leads out of that picture.
    ///
    /// The picture bends; points of this line, led back, bend as much the other way, and the line fitted to them is the
    /// one wanted but for terms of second order in the bend.
    pub(super) fn unbent(&self, undo: impl Fn([f64; 2]) -> Option<[f64; 2]>) -> Option<Self> {
        const POINTS: usize = 9;
        let mut points = [[0.0; 2]; POINTS];
        for (k, point) in points.iter_mut().enumerate() {
            let x = self.half * (2.0 * k as f64 / (POINTS - 1) as f64 - 1.0);
            *point = undo(place(self, x, self.offset + self.slope * x))?;
        }
        let at = [0, 1].map(|k| points.iter().map(|p| p[k]).sum::<f64>() / POINTS as f64);
        let whole = minus(points[POINTS - 1], points[0]);
        let along = whole.map(|c| c / size(whole));
        let mut out = [along[1], -along[0]];
        if out[0] * self.out[0] + out[1] * self.out[1] < 0.0 {
            out = out.map(|c| -c);
        }
        let [mut xd, mut xx] = [0.0; 2];
        for point in points {
            let [p, q] = minus(point, at);
            let x = p * along[0] + q * along[1];
            xd += x * (p * out[0] + q * out[1]);
            xx += x * x;
        }
        (xx > 0.0).then_some(Self {
            at,
            along,
            out,
            offset: 0.0,
            slope: xd / xx,
            half: 0.5 * size(whole),
            ..*self
        })
    }

    pub(super) fn shifted(&self, by: [f64; 2]) -> Self {
        Self {
            at: [self.at[0] + by[0], self.at[1] + by[1]],
            ..*self
        }
    }
}

/// The mark of an outline, where its edges are straight and clear.
pub(super) fn refine<P: Gray>(view: View<'_, P>, candidate: &Candidate) -> Option<Mark> {
    let &Candidate {
        kind,
        vertex_px: vertex,
        right_tip_px: tip,
        down_ends_px: [upper, lower],
        width_px: width,
        cell_px: cell,
    } = candidate;
    let right = minus(tip, vertex);
    let down = minus(lower, upper);
    let [a, b] = [size(right), size(down)];
    let trim = 0.4 * width + 0.5 * cell;
    let (right_line, down_line) = if kind.is_bar() {
        let down_line = edge(view, upper, lower, [trim, trim], right.map(|c| -c), width)?;
        let half = down.map(|c| 0.5 * width * c / b);
        let trims = [width + trim, trim];
        let sides = [-1.0, 1.0].map(|sign| {
            let by = half.map(|c| sign * c);
            edge(view, plus(vertex, by), plus(tip, by), trims, by, width)
        });
        let [Some(above), Some(below)] = sides else {
            return None;
        };
        let joint = down.map(|c| JOINT_SHARE * c);
        (above.midway(&below).shifted(joint), down_line)
    } else {
        let trims = [0.4 * width, trim];
        (
            edge(view, vertex, tip, trims, down.map(|c| -c), width)?,
            edge(view, vertex, lower, trims, right.map(|c| -c), width)?,
        )
    };
    let (corner_px, mut spread_px2) = right_line.crossing(&down_line)?;
    // A hundredth of a pixel is what steps of gray and sampling leave; an arm hardly wider than the blur never shows its
    // black, which moves its edges.
    let floor_px = 0.01 + 0.35 * libm::exp(-0.45 * width);
    spread_px2[0] += floor_px * floor_px;
    spread_px2[2] += floor_px * floor_px;
    // A corner far from its outline is none.
    let start = if kind.is_bar() {
        plus(vertex, down.map(|c| JOINT_SHARE * c))
    } else {
        vertex
    };
    if size(minus(corner_px, start)) > width + 2.0 * cell || a < width || b < width {
        return None;
    }
    let right_tip_px = if kind.is_bar() {
        plus(tip, down.map(|c| JOINT_SHARE * c))
    } else {
        tip
    };
    Some(Mark {
        corner_px,
        spread_px2,
        lines: [right_line, down_line],
        right_tip_px,
        down_ends_px: if kind.is_bar() {
            [upper, lower]
        } else {
            [corner_px, lower]
        },
        width_px: width,
        cell_px: cell,
    })
}

/// The edge of a dark bar near the line between two points, `outward` pointing to the light.
///
/// First where profiles across it come half-way from dark to light; then, twice, where the gray area within a few
/// pixels of the line puts a sharp edge: unbiased for any symmetric blur and for pixels that are squares.
fn edge<P: Gray>(
    view: View<'_, P>,
    from: [f64; 2],
    to: [f64; 2],
    trim: [f64; 2],
    outward: [f64; 2],
    width: f64,
) -> Option<Line> {
    let whole = minus(to, from);
    let length = size(whole);
    let along = whole.map(|c| c / length);
    let mut out = [along[1], -along[0]];
    if out[0] * outward[0] + out[1] * outward[1] < 0.0 {
        out = out.map(|c| -c);
    }
    let used = length - trim[0] - trim[1];
    let count = (used.max(0.0) as usize + 1).min(PROFILES);
    if count < 5 {
        return None;
    }
    let spacing = used / (count - 1) as f64;
    let half = 0.5 * used;
    let start = trim[0] + half;
    let mut line = Line {
        at: [0, 1].map(|k| from[k] + start * along[k]),
        along,
        out,
        offset: 0.0,
        slope: 0.0,
        spread: [0.0; 3],
        half,
    };
    let xs = (0..count).map(|k| k as f64 * spacing - half);

    let mut points: Vec<[f64; 2]> = Vec::with_capacity(count);
    for x in xs.clone() {
        if let Some(d) = half_way(view, &line, x, width) {
            points.push([x, d]);
        }
    }
    straight(&mut line, &points, count, spacing, width)?;

    let reach = reach(width);
    let mut board = 0.0;
    for _ in 0..2 {
        points.clear();
        let levels: Vec<Option<[f64; 2]>> =
            xs.clone().map(|x| levels(view, &line, x, width)).collect();
        let (mut lights, mut lit) = (0.0, 0.0);
        for (k, x) in xs.clone().enumerate() {
            // Levels are those of the neighbours too, or their noise would be the edge's.
            let near = &levels[k.saturating_sub(NEAR)..(k + NEAR + 1).min(levels.len())];
            let (mut sum, mut n) = ([0.0; 2], 0.0);
            for [dark, light] in near.iter().flatten() {
                sum = [sum[0] + dark, sum[1] + light];
                n += 1.0;
            }
            let [dark, light] = sum.map(|s| s / n);
            if n > 0.0 {
                lights += light;
                lit += 1.0;
            }
            if levels[k].is_some()
                && light - dark > CONTRAST * light
                && let Some(d) = balanced(view, &line, x, reach, [dark, light])
            {
                points.push([x, d]);
            }
        }
        straight(&mut line, &points, count, spacing, width)?;
        board = lights / lit;
    }
    line.spread[0] += ambiguity(view, &line, xs, width, reach, board).powi(2);
    Some(line)
}

/// Where on the profile at `x` the gray first passes half-way from the bar's middle outwards; from the bar's line.
fn half_way<P: Gray>(view: View<'_, P>, line: &Line, x: f64, width: f64) -> Option<f64> {
    const STEPS: usize = 25;
    let step = 1.25 * width / (STEPS - 1) as f64;
    let mut values = [0.0; STEPS];
    for (k, value) in values.iter_mut().enumerate() {
        *value = sample(view, place(line, x, k as f64 * step - 0.6 * width))?;
    }
    let dark = values[..STEPS / 2]
        .iter()
        .copied()
        .fold(f64::INFINITY, f64::min);
    let light = values[STEPS / 2..].iter().copied().fold(0.0, f64::max);
    if light - dark <= CONTRAST * light {
        return None;
    }
    let half = 0.5 * (dark + light);
    let darkest = values.iter().position(|&v| v == dark)?;
    let k = (darkest..STEPS - 1).find(|&k| values[k + 1] > half)?;
    let share = (half - values[k]) / (values[k + 1] - values[k]);
    Some((k as f64 + share) * step - 0.6 * width)
}

/// Gray of the bar and of the board, next to the line at `x`, as far from it on both sides.
///
/// Not where the bar is darkest: real marks are shaded across their arms.
fn levels<P: Gray>(view: View<'_, P>, line: &Line, x: f64, width: f64) -> Option<[f64; 2]> {
    let centre = line.offset + line.slope * x;
    let depth = (0.3 * width).max((0.5 * width).min(4.0));
    let mean = |side: f64| {
        let mut sum = 0.0;
        for k in 0..5 {
            let d = side * depth + 0.25 * span(width) * (f64::from(k) - 2.0);
            sum += sample(view, place(line, x, centre + d))?;
        }
        Some(sum / 5.0)
    };
    Some([mean(-1.0)?, mean(1.0)?])
}

/// How far to both sides of an edge its gray counts: wide enough for the blur of an edge in focus, narrow enough to leave
/// both levels.
fn reach(width: f64) -> f64 {
    (0.4 * width).clamp(1.0, 3.0)
}

/// How wide a strip along the edge its gray levels are taken from.
fn span(width: f64) -> f64 {
    0.2 * width
}

/// Half of how far the edge moves with what is called dark: the bar's darkest, or its gray next to the edge. Nothing for
/// an even bar; for a shaded one this is how well its edge is defined. From the mean of all profiles, so that noise
/// makes little of it.
fn ambiguity<P: Gray>(
    view: View<'_, P>,
    line: &Line,
    xs: impl Iterator<Item = f64> + Clone,
    width: f64,
    reach: f64,
    light: f64,
) -> f64 {
    let mean = |d: f64| {
        let (mut sum, mut n) = (0.0, 0.0);
        for x in xs.clone().step_by(2) {
            let centre = line.offset + line.slope * x;
            if let Some(value) = sample(view, place(line, x, centre + d)) {
                sum += value;
                n += 1.0;
            }
        }
        sum / n
    };
    let steps = (2.0 * reach) as usize + 1;
    let step = 2.0 * reach / steps as f64;
    let across: f64 = (0..steps)
        .map(|k| light - mean((k as f64 + 0.5) * step - reach))
        .sum();
    let edge = |dark: f64| across / (light - dark) * step - reach;
    let darkest = (0..9)
        .map(|k| mean(-width * (0.15 + 0.08 * f64::from(k))))
        .fold(f64::INFINITY, f64::min);
    let near = 0.5 * (mean(-reach - 0.3) + mean(-reach - 0.8).min(mean(-reach - 0.3)));
    0.5 * (edge(near) - edge(darkest)).abs().min(width)
}

/// Where a sharp edge would leave as much dark within `reach` of the line.
fn balanced<P: Gray>(
    view: View<'_, P>,
    line: &Line,
    x: f64,
    reach: f64,
    [dark, light]: [f64; 2],
) -> Option<f64> {
    let steps = (4.0 * reach) as usize + 1;
    let step = 2.0 * reach / steps as f64;
    let centre = line.offset + line.slope * x;
    let mut sum = 0.0;
    for k in 0..steps {
        let d = (k as f64 + 0.5) * step - reach;
        let value = sample(view, place(line, x, centre + d))?;
        sum += ((light - value) / (light - dark)).clamp(-0.5, 1.5);
    }
    Some(centre + sum * step - reach)
}

fn place(line: &Line, x: f64, d: f64) -> [f64; 2] {
    [0, 1].map(|k| line.at[k] + x * line.along[k] + d * line.out[k])
}

/// Gray between four pixels; none outside of the picture.
fn sample<P: Gray>(view: View<'_, P>, [x, y]: [f64; 2]) -> Option<f64> {
    if !(x >= 0.0 && y >= 0.0) {
        return None;
    }
    let [column, row] = [x as usize, y as usize];
    let [p, q] = [x - column as f64, y - row as f64];
    let [a, b] = pair(view.row(row), column)?;
    let [c, d] = pair(view.row(row + 1), column)?;
    Some((a + p * (b - a)) * (1.0 - q) + (c + p * (d - c)) * q)
}

fn pair<P: Gray>(row: &[P], column: usize) -> Option<[f64; 2]> {
    let [a, b] = *row.get(column..column + 2)?.first_chunk::<2>()?;
    let [a, b]: [u32; 2] = [a.into(), b.into()];
    Some([f64::from(a), f64::from(b)])
}

/// Fits offset and slope of a line to points (x, d), most of which lie on it: first the least sum of distances, then
/// Tukey's weights.
fn straight(
    line: &mut Line,
    points: &[[f64; 2]],
    wanted: usize,
    spacing: f64,
    width: f64,
) -> Option<()> {
    let count = points.len();
    if count < 5 || 10 * count < 6 * wanted {
        return None;
    }
    let mut weights = vec![1.0; count];
    let mut fitted = weighted(points, &weights)?;
    for _ in 0..6 {
        for (w, p) in weights.iter_mut().zip(points) {
            *w = 1.0 / fitted.off(p).abs().max(0.02 * width);
        }
        fitted = weighted(points, &weights)?;
    }
    let mut scale = 0.0;
    for _ in 0..4 {
        let mut off: Vec<f64> = points.iter().map(|p| fitted.off(p).abs()).collect();
        let (_, &mut middle, _) = off.select_nth_unstable_by(count / 2, f64::total_cmp);
        scale = (1.4826 * middle).max(0.02);
        for (w, p) in weights.iter_mut().zip(points) {
            let z = fitted.off(p) / (4.685 * scale);
            *w = (1.0 - z * z).max(0.0).powi(2);
        }
        fitted = weighted(points, &weights)?;
    }
    let kept = weights.iter().filter(|&&w| w > 0.1).count();
    if 10 * kept < 6 * wanted || scale > 0.1 * width + 0.2 {
        return None;
    }
    let sum: f64 = weights.iter().sum();
    let squares: f64 = weights
        .iter()
        .zip(points)
        .map(|(w, p)| w * fitted.off(p).powi(2))
        .sum();
    // Profiles less than two pixels apart share pixels: neighbours' errors are alike. And a level's noise, which weighs
    // as much as that of `reach / span` profiles, is common to all profiles that share the level.
    let level = reach(width) / span(width).max(1.0);
    let common = (1.0 + level) / (1.0 + level / (2 * NEAR + 1) as f64);
    let shared = common * (1.0 + 0.5 * (2.0 - spacing).clamp(0.0, 1.0));
    let variance = shared * squares / (sum - 2.0).max(1.0);
    line.offset = fitted.offset;
    line.slope = fitted.slope;
    line.spread = fitted.inverse.map(|v| v * variance);
    Some(())
}

struct Fitted {
    offset: f64,
    slope: f64,
    inverse: [f64; 3],
}

impl Fitted {
    fn off(&self, [x, d]: &[f64; 2]) -> f64 {
        d - self.offset - self.slope * x
    }
}

fn weighted(points: &[[f64; 2]], weights: &[f64]) -> Option<Fitted> {
    let [mut s0, mut s1, mut s2, mut r0, mut r1] = [0.0; 5];
    for (&[x, d], w) in points.iter().zip(weights) {
        s0 += w;
        s1 += w * x;
        s2 += w * x * x;
        r0 += w * d;
        r1 += w * x * d;
    }
    let det = s0 * s2 - s1 * s1;
    if det.is_nan() || det <= 0.0 {
        return None;
    }
    Some(Fitted {
        offset: (r0 * s2 - r1 * s1) / det,
        slope: (r1 * s0 - r0 * s1) / det,
        inverse: [s2 / det, -s1 / det, s0 / det],
    })
}

fn plus(a: [f64; 2], b: [f64; 2]) -> [f64; 2] {
    [a[0] + b[0], a[1] + b[1]]
}

fn minus(a: [f64; 2], b: [f64; 2]) -> [f64; 2] {
    [a[0] - b[0], a[1] - b[1]]
}

fn size(a: [f64; 2]) -> f64 {
    a[0].hypot(a[1])
}
