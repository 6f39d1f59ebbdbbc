//! What the light falls on: white panels with black marks before something darker.

use super::random::Draws;
use crate::target::{Board, JOINT_SHARE, Marks};

/// A rectangle of the plane, left, top, right, bottom \[m\].
type Rectangle = [f64; 4];

/// Panels and marks.
#[derive(Debug, Clone)]
pub(super) struct Surface {
    panels: Vec<Rectangle>,
    marks: Vec<Rectangle>,
    /// Of what is neither.
    surroundings: f64,
    black: f64,
    texture: f64,
    weave: Draws,
}

/// Bars of the marks of a target, as its owner would paint them.
///
/// An L is two bars from its corner along the edges; a T of a two-panel board is a bar of `arm_m` along the edge,
/// its middle a little above the joint, with one of the same length inwards.
fn bars(board: &Board, arm_m: f64, bar_m: f64) -> Vec<Rectangle> {
    let height_m = board.height_m;
    let (right, bottom) = (0.5 * board.width_m, 0.5 * height_m);
    // The joint of the panels and the far corners of the other panel.
    let (joint, top, low) = match board.marks {
        Marks::FourCorners => (None, -bottom, bottom),
        Marks::TwoPanelUpper => (Some(bottom), -bottom, bottom + height_m),
        Marks::TwoPanelLower => (Some(-bottom), -bottom - height_m, bottom),
    };
    let mut bars = Vec::new();
    for side in [-1.0, 1.0] {
        // From the edge inwards, so much.
        let span = |length_m: f64| {
            let inner = side * (right - length_m);
            [inner.min(side * right), inner.max(side * right)]
        };
        let ([a, b], [c, d]) = (span(arm_m), span(bar_m));
        bars.push([a, top, b, top + bar_m]);
        bars.push([c, top, d, top + arm_m]);
        bars.push([a, low - bar_m, b, low]);
        bars.push([c, low - arm_m, d, low]);
        if let Some(joint) = joint {
            let middle = joint - JOINT_SHARE * arm_m;
            bars.push([c, middle - 0.5 * arm_m, d, middle + 0.5 * arm_m]);
            bars.push([a, middle - 0.5 * bar_m, b, middle + 0.5 * bar_m]);
        }
    }
    bars
}

impl Surface {
    pub(super) fn new(
        board: &Board,
        (arm_m, bar_m): (f64, f64),
        margin_m: f64,
        texture: f64,
        weave: Draws,
    ) -> Self {
        let height_m = board.height_m;
        let (right, bottom) = (0.5 * board.width_m + margin_m, 0.5 * height_m);
        let (top, low) = match board.marks {
            Marks::FourCorners => (-bottom, bottom),
            Marks::TwoPanelUpper => (-bottom, bottom + height_m),
            Marks::TwoPanelLower => (-bottom - height_m, bottom),
        };
        Self {
            panels: vec![[-right, top - margin_m, right, low + margin_m]],
            marks: bars(board, arm_m, bar_m),
            surroundings: 0.45,
            black: 0.06,
            texture,
            weave,
        }
    }

    /// The light it gives back from a small parallelogram about a place \[parts of what white does\].
    /// `steps_m` is what a pixel right and a pixel down are on the plane.
    pub(super) fn over_pixel(&self, at_m: [f64; 2], steps_m: [[f64; 2]; 2]) -> f64 {
        // Half of the extent of the pixel on the plane.
        let half = [0, 1].map(|k| 0.5 * (steps_m[0][k].abs() + steps_m[1][k].abs()));
        let near = |r: &Rectangle| {
            let outside = |grow: f64| {
                at_m[0] < r[0] - grow * half[0]
                    || at_m[0] > r[2] + grow * half[0]
                    || at_m[1] < r[1] - grow * half[1]
                    || at_m[1] > r[3] + grow * half[1]
            };
            !outside(1.0) && outside(-1.0)
        };
        let paint = if self.panels.iter().chain(&self.marks).any(near) {
            // A lattice whose points have 64 different x and 64 different y: an edge along either moves
            // the share by 1/64 of a pixel at a time.
            const POINTS: u32 = 64;
            let mut sum = 0.0;
            for i in 0..POINTS {
                let across = (f64::from(i) + 0.5) / f64::from(POINTS) - 0.5;
                let along = (f64::from(i * 19 % POINTS) + 0.5) / f64::from(POINTS) - 0.5;
                sum += self.paint(
                    [0, 1].map(|k| at_m[k] + across * steps_m[0][k] + along * steps_m[1][k]),
                );
            }
            sum / f64::from(POINTS)
        } else {
            self.paint(at_m)
        };
        paint * (1.0 + self.texture * self.folds(at_m))
    }

    fn paint(&self, at_m: [f64; 2]) -> f64 {
        let within =
            |r: &Rectangle| at_m[0] >= r[0] && at_m[0] < r[2] && at_m[1] >= r[1] && at_m[1] < r[3];
        if self.marks.iter().any(within) {
            self.black
        } else if self.panels.iter().any(within) {
            1.0
        } else {
            self.surroundings
        }
    }

    /// Folds of half a metre and a weave of three centimetres, within about -1 to 1.
    fn folds(&self, at_m: [f64; 2]) -> f64 {
        if self.texture == 0.0 {
            return 0.0;
        }
        0.7 * self.noise(at_m, 0.5, 0) + 0.3 * self.noise(at_m, 0.03, 1)
    }

    /// Values at the corners of a grid, smoothly in between.
    fn noise(&self, at_m: [f64; 2], cell_m: f64, octave: u64) -> f64 {
        // Far off the board nobody looks; the clamp keeps the cells whole numbers.
        let place = at_m.map(|m| (m / cell_m).clamp(-1e6, 1e6));
        let cell = place.map(libm::floor);
        let smooth = [0, 1].map(|k| {
            let t = place[k] - cell[k];
            t * t * (3.0 - 2.0 * t)
        });
        let corner = |i: f64, j: f64| {
            let [column, row] = [cell[0] + i, cell[1] + j].map(|c| (c + 2e6) as u64);
            2.0 * self.weave.uniform((octave << 48) | (row << 24) | column) - 1.0
        };
        let across = |j: f64| {
            let (a, b) = (corner(0.0, j), corner(1.0, j));
            a + smooth[0] * (b - a)
        };
        let (a, b) = (across(0.0), across(1.0));
        a + smooth[1] * (b - a)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const BOARD: Board = Board {
        width_m: 8.0,
        height_m: 6.0,
        marks: Marks::FourCorners,
    };

    fn area(bars: &[Rectangle]) -> f64 {
        bars.iter().map(|r| (r[2] - r[0]) * (r[3] - r[1])).sum()
    }

    #[test]
    fn marks_touch_the_corners_from_within() {
        let bars = bars(&BOARD, 0.75, 0.15);
        assert_eq!(bars.len(), 8);
        assert!((area(&bars) - 8.0 * 0.75 * 0.15).abs() < 1e-12);
        for corner in [[-4.0, -3.0], [4.0, -3.0], [4.0, 3.0], [-4.0, 3.0]] {
            let touching = bars.iter().filter(|r| {
                (r[0] == corner[0] || r[2] == corner[0]) && (r[1] == corner[1] || r[3] == corner[1])
            });
            assert_eq!(touching.count(), 2);
        }
        assert!(
            bars.iter()
                .all(|r| r[0] >= -4.0 && r[2] <= 4.0 && r[1] >= -3.0 && r[3] <= 3.0)
        );
    }

    #[test]
    fn a_two_panel_board_has_its_joint_at_the_targets_edge() {
        for (marks, joint) in [(Marks::TwoPanelUpper, 3.0), (Marks::TwoPanelLower, -3.0)] {
            let bars = bars(&Board { marks, ..BOARD }, 0.75, 0.15);
            assert_eq!(bars.len(), 12);
            let on_joint = bars
                .iter()
                .filter(|r| (0.5 * (r[1] + r[3]) - (joint - JOINT_SHARE * 0.75)).abs() < 1e-12);
            assert_eq!(on_joint.count(), 4);
        }
    }

    // A vertical edge 0.3 px right of a pixel's middle leaves 0.8 of it white.
    #[test]
    fn edges_have_their_share_of_a_pixel() {
        let surface = Surface::new(
            &Board {
                width_m: 2.0,
                height_m: 2.0,
                ..BOARD
            },
            (0.2, 0.05),
            0.0,
            0.0,
            Draws::new(0, 0),
        );
        let steps = [[0.01, 0.0], [0.0, 0.01]];
        let share = surface.over_pixel([1.0 - 0.003, 0.0], steps);
        assert!((share - (0.8 + 0.2 * 0.45)).abs() < 0.55 / 64.0, "{share}");
        assert_eq!(surface.over_pixel([0.0, 0.0], steps), 1.0);
        assert_eq!(surface.over_pixel([1.5, 0.0], steps), 0.45);
        assert_eq!(surface.over_pixel([-0.9, -0.98], steps), 0.06);
    }
}
