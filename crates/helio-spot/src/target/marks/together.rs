//! Marks that belong to one board.

use super::{Mark, MarkSize};
use crate::target::{Board, Corners, Homography};

/// An arm's end may be this share of the arm off the place that the other marks give it, besides the coarse picture's
/// grain.
const ARM: f64 = 0.12;
/// And an edge this far from the direction that the corners give it \[rad\].
const TURN: f64 = 0.03;
/// How much longer one pixel may be on the board in one direction than across it.
const STRETCH: f64 = 1.35;
/// Standard deviation of the direction in which arms were painted \[rad\]: 6 to 8 on the Jülich boards.
const PAINTED: f64 = 0.008;
/// Marks at a corner of the board looked at together, at most.
const MOST: usize = 12;

/// Signs of the corners: right, down.
const SIGNS: [[f64; 2]; 4] = [[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]];

/// What four lists of marks give.
pub(super) enum Four {
    /// No four that agree.
    None,
    /// The four that agree best.
    One(Corners),
    /// Two boards.
    Several,
}

/// The four marks that agree best.
pub(super) fn four(lists: &[Vec<Mark>; 4], board: &Board) -> Four {
    let mut fits: Vec<(f64, [&Mark; 4], Corners)> = Vec::new();
    let [l0, l1, l2, l3] = lists.each_ref().map(|l| &l[..l.len().min(MOST)]);
    for a in l0 {
        for b in l1.iter().filter(|b| alike(a, b)) {
            for c in l2.iter().filter(|c| alike(a, c) && alike(b, c)) {
                for d in l3.iter().filter(|d| alike(a, d) && alike(c, d)) {
                    let marks = [a, b, c, d];
                    let at = marks.map(|m| m.corner_px);
                    let Some((score, size)) = agreement(&marks.map(Some), &at, board, 1.0) else {
                        continue;
                    };
                    let corners = Corners {
                        at_px: at,
                        sigma_px: marks.map(sigma),
                        seen: [true; 4],
                        marks: Some(size),
                    };
                    fits.push((score, marks, corners));
                }
            }
        }
    }
    let Some((_, best, corners)) = fits.iter().min_by(|a, b| a.0.total_cmp(&b.0)) else {
        return Four::None;
    };
    let other = |(_, marks, _): &(f64, [&Mark; 4], Corners)| {
        (0..4).all(|i| !core::ptr::eq(marks[i], best[i]))
    };
    if fits.iter().any(other) {
        return Four::Several;
    }
    Four::One(*corners)
}

/// The three marks that agree best, and the number of the fourth corner, which is where its neighbours' arms point and
/// must be a place that `is_seen` has in the picture.
pub(super) fn three(
    lists: &[Vec<Mark>; 4],
    board: &Board,
    is_seen: impl Fn([f64; 2]) -> bool,
) -> Option<(usize, Corners)> {
    let mut best: Option<(f64, usize, Corners)> = None;
    for hidden in 0..4 {
        // Neighbours along the width and the height, and the opposite corner.
        let [beside, over, far] = [hidden ^ 1, 3 - hidden, hidden ^ 2];
        let [l, m, n] = [beside, over, far].map(|i| &lists[i][..lists[i].len().min(MOST)]);
        for a in l {
            for b in m.iter().filter(|b| alike(a, b)) {
                for c in n.iter().filter(|c| alike(a, c) && alike(b, c)) {
                    let Some((at, spread)) = a.lines[0]
                        .turned_by(PAINTED)
                        .crossing(&b.lines[1].turned_by(PAINTED))
                    else {
                        continue;
                    };
                    let mut marks = [None; 4];
                    marks[beside] = Some(a);
                    marks[over] = Some(b);
                    marks[far] = Some(c);
                    let at_px = marks.map(|m| m.map_or(at, |m: &Mark| m.corner_px));
                    let Some((score, size)) = agreement(&marks, &at_px, board, 0.8) else {
                        continue;
                    };
                    let corners = Corners {
                        at_px,
                        sigma_px: marks
                            .map(|m| m.map_or((0.5 * (spread[0] + spread[2])).sqrt(), sigma)),
                        seen: marks.map(|m| m.is_some()),
                        marks: Some(size),
                    };
                    if is_seen(at) && best.as_ref().is_none_or(|b| score < b.0) {
                        best = Some((score, hidden, corners));
                    }
                }
            }
        }
    }
    best.map(|b| (b.1, b.2))
}

fn sigma(mark: &Mark) -> f64 {
    (0.5 * (mark.spread_px2[0] + mark.spread_px2[2])).sqrt()
}

/// Whether two marks may be of one size, perspective and grain allowed for.
fn alike(a: &Mark, b: &Mark) -> bool {
    let lengths = |m: &Mark| {
        [
            distance(m.corner_px, m.right_tip_px),
            distance(m.down_ends_px[0], m.down_ends_px[1]),
        ]
    };
    let grain = a.cell_px + b.cell_px;
    let [la, lb] = [lengths(a), lengths(b)];
    (0..2).all(|k| (la[k] - lb[k]).abs() < 0.35 * la[k].max(lb[k]) + grain)
        && (a.width_px - b.width_px).abs() < 0.4 * a.width_px.max(b.width_px) + grain
}

fn distance(a: [f64; 2], b: [f64; 2]) -> f64 {
    (a[0] - b[0]).hypot(a[1] - b[1])
}

/// How well marks agree with corners (least is best) and the marks' size; none where they do not. `strict` below 1
/// asks for more.
fn agreement(
    marks: &[Option<&Mark>; 4],
    at_px: &[[f64; 2]; 4],
    board: &Board,
    strict: f64,
) -> Option<(f64, MarkSize)> {
    let map = Homography::from_corners(at_px, board.width_m, board.height_m).ok()?;
    let [[p, q], [r, s]] = map.target_slopes(map.to_pixels([0.0, 0.0])?)?;
    // Ratio of the singular values: with t = |J|²/(2 det), t + sqrt(t² - 1).
    let t = (p * p + q * q + r * r + s * s) / (2.0 * (p * s - q * r));
    if t.is_nan() || t > 0.5 * (STRETCH + 1.0 / STRETCH) {
        return None;
    }
    let mut arms = [[0.0; 2]; 4];
    let mut across = [[0.0; 2]; 4];
    let mut grains = [0.0; 4];
    let mut widths = [0.0; 4];
    let mut score = 0.0;
    for i in 0..4 {
        let Some(mark) = marks[i] else { continue };
        let [from, to, a, b] = [
            mark.corner_px,
            mark.right_tip_px,
            mark.down_ends_px[0],
            mark.down_ends_px[1],
        ]
        .map(|p| map.to_target(p));
        let (from, to, a, b) = (from?, to?, a?, b?);
        // Inwards is positive; a bar runs downwards.
        arms[i][0] = (to[0] - from[0]) * -SIGNS[i][0];
        across[i][0] = to[1] - from[1];
        arms[i][1] = (b[1] - a[1]).abs();
        across[i][1] = b[0] - a[0];
        let slopes = map.target_slopes(mark.corner_px)?;
        let metres = slopes
            .as_flattened()
            .iter()
            .fold(0.0, |m: f64, s| m.max(s.abs()));
        grains[i] = 1.5 * mark.cell_px * metres;
        widths[i] = mark.width_px * metres;
        let sides = map.pixel_slopes(from)?;
        for (k, line) in mark.lines.iter().enumerate() {
            let side = [sides[0][k], sides[1][k]];
            let d = line.direction();
            let turn = (d[0] * side[1] - d[1] * side[0]) / side[0].hypot(side[1]);
            let share = turn / (strict * TURN + 3.0 * line.direction_sigma());
            if share.abs() > 1.0 {
                return None;
            }
            score += share * share;
        }
    }
    let seen = marks.iter().flatten().count() as f64;
    let mut mean = [0.0; 2];
    for k in 0..2 {
        mean[k] = arms.iter().map(|a| a[k]).sum::<f64>() / seen;
        for i in (0..4).filter(|&i| marks[i].is_some()) {
            let allowed = strict * (ARM * mean[k] + grains[i]);
            for off in [arms[i][k] - mean[k], across[i][k]] {
                let share = off / allowed;
                if share.is_nan() || share.abs() > 1.0 {
                    return None;
                }
                score += share * share;
            }
        }
    }
    let part = [mean[0] / board.width_m, mean[1] / board.height_m];
    if !(part.iter().all(|p| *p > 0.015 && *p < 0.4)
        && mean[0] < 2.5 * mean[1]
        && mean[1] < 2.5 * mean[0])
    {
        return None;
    }
    Some((
        score,
        MarkSize {
            arm_right_m: mean[0],
            arm_down_m: mean[1],
            width_m: widths.iter().sum::<f64>() / seen,
        },
    ))
}
