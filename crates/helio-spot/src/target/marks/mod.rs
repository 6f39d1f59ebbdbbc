//! The black corner marks of a board, found without templates.
//!
//! 1. **Coarse** (`coarse`): means of square blocks; black top-hat (closing less picture) with a box wider than an arm
//!    of a mark. It answers to dark things that are thin, whatever the light around them: the slopes of beams and the
//!    edges of shadows do not answer. Connected dark cells are kept that have the outline of an L or a T.
//! 2. **Fine** (`edge`): straight lines through the outer edges of both arms at full resolution; the corner is
//!    where they cross.
//! 3. **Together** (`together`): the four marks that agree with one picture of the board, by where they are, where
//!    their arms point and how long they are.
//!
//! If no four agree at one size of blocks, finer and coarser ones are tried.

mod coarse;
mod edge;
#[cfg(test)]
mod tests;
mod together;

use super::{Board, Corners, CornersError, Lens, Marks};
use crate::image::{Gray, View};

pub use coarse::MarkScratch;
use together::Four;

/// At a T mark the corner (the joint of the two boards) lies this share of the bar's length below the middle of the
/// arm. Measured on the Jülich tower's marks, frames with even numbers: see `marks_juelich.rs` in the package `tests`.
pub const JOINT_SHARE: f64 = 0.026;

/// How to look for corners.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct FindOptions {
    /// Where the corners should be, and how far from there they may be; none looks everywhere.
    pub expected: Option<Expected>,
    /// Give up where one mark is not seen. Otherwise its corner is where the arms of its neighbours point, with
    /// `seen` false and an uncertainty to match, provided that the three others agree.
    pub all_four: bool,
    /// The camera's lens, where its distortion is known: marks are then put together in a perfect lens's picture. The
    /// corners are still those of the picture taken.
    pub lens: Option<Lens>,
}

/// Where corners should be.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Expected {
    /// Upper left, upper right, lower right, lower left.
    pub at_px: [[f64; 2]; 4],
    /// Farthest that a corner may be from there, at least 1.
    pub within_px: f64,
}

/// Size of the marks of a board, to two blocks of the coarse picture or so (see [`marks`](self)).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct MarkSize {
    /// Outer length of an arm along the board's width; of a T mark's arm from the outer edge of its bar.
    pub arm_right_m: f64,
    /// Outer length of an arm along the board's height; of a T mark's bar.
    pub arm_down_m: f64,
    /// Width of an arm.
    pub width_m: f64,
}

impl MarkSize {
    /// As large as marks usually are on a board of this size, for boards whose marks were not looked for.
    #[must_use]
    pub const fn usual(board: &Board) -> Self {
        let side = board.width_m.min(board.height_m);
        Self {
            arm_right_m: 0.15 * side,
            arm_down_m: 0.15 * side,
            width_m: 0.03 * side,
        }
    }

    /// Rectangles on the board that its marks cover, widened by `margin_m` on all sides: four places `[u_m, v_m]` each,
    /// clockwise from the upper left. Includes the T marks in the middle of the outer edge of a board with two panels.
    #[must_use]
    pub fn regions(&self, board: &Board, margin_m: f64) -> Vec<[[f64; 2]; 4]> {
        let [right, down] = [0.5 * board.width_m, 0.5 * board.height_m];
        let Self {
            arm_right_m,
            arm_down_m,
            width_m,
        } = *self;
        let mut regions = Vec::new();
        let mut add = |u: [f64; 2], v: [f64; 2]| {
            let [u0, u1] = [u[0].min(u[1]) - margin_m, u[0].max(u[1]) + margin_m];
            let [v0, v1] = [v[0].min(v[1]) - margin_m, v[0].max(v[1]) + margin_m];
            regions.push([[u0, v0], [u1, v0], [u1, v1], [u0, v1]]);
        };
        for (corner, [s, t]) in [[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]]
            .into_iter()
            .enumerate()
        {
            let at = [s * right, t * down];
            if Kind::of(board.marks, corner).is_bar() {
                let middle = at[1] - JOINT_SHARE * arm_down_m;
                let [half, thin] = [0.5 * arm_down_m, 0.5 * width_m];
                add([at[0], at[0] - s * width_m], [middle - half, middle + half]);
                add(
                    [at[0], at[0] - s * arm_right_m],
                    [middle - thin, middle + thin],
                );
            } else {
                add(
                    [at[0], at[0] - s * arm_right_m],
                    [at[1], at[1] - t * width_m],
                );
                add(
                    [at[0], at[0] - s * width_m],
                    [at[1], at[1] - t * arm_down_m],
                );
            }
        }
        let outer = match board.marks {
            Marks::FourCorners => None,
            Marks::TwoPanelUpper => Some(-1.0),
            Marks::TwoPanelLower => Some(1.0),
        };
        if let Some(t) = outer {
            let [half, thin] = [0.5 * arm_right_m, 0.5 * width_m];
            add([-half, half], [t * down, t * (down - width_m)]);
            add([-thin, thin], [t * down, t * (down - arm_down_m)]);
        }
        regions
    }
}

/// Shape and turn of a mark.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Kind {
    /// An L with its vertex at the corner of this number, clockwise from the upper left.
    Angle(usize),
    /// A T with its bar on the left.
    BarLeft,
    /// A T with its bar on the right.
    BarRight,
}

impl Kind {
    /// The mark that a board has at a corner.
    const fn of(marks: Marks, corner: usize) -> Self {
        match (marks, corner) {
            (Marks::TwoPanelUpper, 2) | (Marks::TwoPanelLower, 1) => Self::BarRight,
            (Marks::TwoPanelUpper, 3) | (Marks::TwoPanelLower, 0) => Self::BarLeft,
            _ => Self::Angle(corner),
        }
    }

    const fn is_bar(self) -> bool {
        !matches!(self, Self::Angle(_))
    }
}

/// A mark at full resolution.
#[derive(Debug, Clone, Copy)]
struct Mark {
    corner_px: [f64; 2],
    /// Covariance of the corner, as xx, xy, yy.
    spread_px2: [f64; 3],
    /// The line through the corner along the arm that lies along the board's width, and along its height.
    lines: [edge::Line; 2],
    /// End of the arm along the width.
    right_tip_px: [f64; 2],
    /// Ends of the arm or bar along the height.
    down_ends_px: [[f64; 2]; 2],
    /// Width of the arms.
    width_px: f64,
    /// How far a tip may be off.
    cell_px: f64,
}

impl Mark {
    fn shifted(mut self, by: [f64; 2]) -> Self {
        let points = [&mut self.corner_px, &mut self.right_tip_px];
        for p in points.into_iter().chain(&mut self.down_ends_px) {
            *p = [p[0] + by[0], p[1] + by[1]];
        }
        self.lines = self.lines.map(|l| l.shifted(by));
        self
    }
}

/// The way between the view that is looked at and the picture in which marks are put together: the view itself, or
/// the whole picture of a perfect lens.
#[derive(Debug, Clone, Copy)]
struct Way {
    lens: Option<Lens>,
    /// First pixel of the view.
    shift_px: [f64; 2],
}

impl Way {
    fn perfect(&self, seen_px: [f64; 2]) -> Option<[f64; 2]> {
        let Some(lens) = &self.lens else {
            return Some(seen_px);
        };
        lens.undistort([0, 1].map(|k| seen_px[k] + self.shift_px[k]))
            .ok()
    }

    fn seen(&self, perfect_px: [f64; 2]) -> [f64; 2] {
        let Some(lens) = &self.lens else {
            return perfect_px;
        };
        let taken = lens.distort(perfect_px);
        [0, 1].map(|k| taken[k] - self.shift_px[k])
    }

    fn perfect_mark(&self, mark: Mark) -> Option<Mark> {
        if self.lens.is_none() {
            return Some(mark);
        }
        let [right, down] = mark.lines.map(|line| line.unbent(|p| self.perfect(p)));
        let lines = [right?, down?];
        let (corner_px, _) = lines[0].crossing(&lines[1])?;
        let [upper, lower] = mark.down_ends_px.map(|p| {
            // The end of an L is its corner.
            if p == mark.corner_px {
                Some(corner_px)
            } else {
                self.perfect(p)
            }
        });
        Some(Mark {
            corner_px,
            lines,
            right_tip_px: self.perfect(mark.right_tip_px)?,
            down_ends_px: [upper?, lower?],
            ..mark
        })
    }

    fn seen_corners(&self, mut corners: Corners) -> Corners {
        corners.at_px = corners.at_px.map(|at| self.seen(at));
        corners
    }
}

/// Looks for the corner marks of a board.
///
/// The marks are darker than the board around them, have straight arms at least twice as long as wide, the same size
/// in all corners, and at least a few pixels of board around them. The picture may be rolled by 25°, or the board be
/// turned or tilted by 40°, or rolled by 10° and both turned and tilted by 25°; arms may be 2.5 px wide or wider. Marks
/// cut by the frame's edge are not seen. Distortion beyond k1 = -0.2 or so, at a focal length of the picture's width, wants
/// [`FindOptions::lens`].
///
/// Each corner's uncertainty is that of the lines fitted to the arms' edges.
///
/// # Errors
/// [`CornersError::NoMarks`] where no board is found; it says which of its marks there may be.
pub fn find_corners<P: Gray>(
    view: View<'_, P>,
    board: &Board,
    options: &FindOptions,
    scratch: &mut MarkScratch,
) -> Result<Corners, CornersError> {
    for (what, value_m) in [("width_m", board.width_m), ("height_m", board.height_m)] {
        if !(value_m.is_finite() && value_m > 0.0) {
            return Err(CornersError::BadBoard { what, value_m });
        }
    }
    let (view, shift_px) = near(view, options.expected.as_ref())?;
    let size_px = [view.width(), view.height()].map(|n| n as f64);
    let way = Way {
        lens: options.lens,
        shift_px,
    };
    let is_seen = |perfect_px| {
        let at = way.seen(perfect_px);
        (0..2).all(|k| at[k] > -0.5 && at[k] < size_px[k] - 0.5)
    };
    let expected = options.expected.as_ref().map(|e| Expected {
        at_px: e.at_px.map(|p| [p[0] - shift_px[0], p[1] - shift_px[1]]),
        within_px: e.within_px,
    });
    let mut found = [false; 4];
    for cell in coarse::cells(view.width(), view.height()) {
        let mut marks: [Vec<Mark>; 4] = Default::default();
        let wanted = Wanted {
            board,
            expected: expected.as_ref(),
            way: &way,
        };
        collect(view, [0.0; 2], cell, &wanted, scratch, &mut marks);
        for (seen, list) in found.iter_mut().zip(&marks) {
            *seen |= !list.is_empty();
        }
        let mut four = together::four(&marks, board);
        let mut three = None;
        if matches!(four, Four::None) {
            three = together::three(&marks, board, is_seen)
                .map(|(hidden, corners)| (hidden, way.seen_corners(corners)));
        }
        if let Some((hidden, corners)) = &three {
            // Once more where the fourth should be: a mark that the blocks were too coarse for, or too noisy.
            if let Some((part, first_px)) = around(view, corners.at_px[*hidden], &marks, *hidden) {
                for cell in [cell / 2, 2 * cell] {
                    if cell > 0 && matches!(four, Four::None) {
                        collect(part, first_px, cell, &wanted, scratch, &mut marks);
                        four = together::four(&marks, board);
                    }
                }
            }
        }
        match (four, three) {
            (Four::One(corners), _) => {
                return Ok(shifted(way.seen_corners(corners), shift_px));
            }
            (Four::Several, _) => return Err(CornersError::SeveralBoards),
            (Four::None, Some((hidden, corners))) => {
                if options.all_four {
                    found = [true; 4];
                    found[hidden] = false;
                    return Err(CornersError::NoMarks { found });
                }
                return Ok(shifted(corners, shift_px));
            }
            (Four::None, None) => {}
        }
    }
    Err(CornersError::NoMarks { found })
}

/// Which marks are looked for.
struct Wanted<'a> {
    board: &'a Board,
    expected: Option<&'a Expected>,
    way: &'a Way,
}

/// Adds the marks in a part of the picture that begins at `first_px`.
fn collect<P: Gray>(
    part: View<'_, P>,
    first_px: [f64; 2],
    cell: usize,
    wanted: &Wanted<'_>,
    scratch: &mut MarkScratch,
    marks: &mut [Vec<Mark>; 4],
) {
    let marks_of = wanted.board.marks;
    for candidate in &coarse::candidates(part, cell, marks_of, scratch) {
        let Some(mark) = edge::refine(part, candidate) else {
            continue;
        };
        let mark = mark.shifted(first_px);
        let [x, y] = mark.corner_px;
        let Some(mark) = wanted.way.perfect_mark(mark) else {
            continue;
        };
        for (corner, list) in marks.iter_mut().enumerate() {
            let near = wanted.expected.is_none_or(|e| {
                let [ex, ey] = e.at_px[corner];
                (x - ex).hypot(y - ey) <= e.within_px
            });
            if near && Kind::of(marks_of, corner) == candidate.kind {
                list.push(mark);
            }
        }
    }
}

/// The part of a view in which the mark of a hidden corner would lie with light around it, and its first pixel.
fn around<'a, P: Gray>(
    view: View<'a, P>,
    at_px: [f64; 2],
    marks: &[Vec<Mark>; 4],
    hidden: usize,
) -> Option<(View<'a, P>, [f64; 2])> {
    let beside = marks[hidden ^ 1].first()?;
    let [x, y] = beside.corner_px;
    let reach = 2.5 * (beside.right_tip_px[0] - x).hypot(beside.right_tip_px[1] - y);
    let range = [0, 1].map(|k| [(at_px[k] - reach) as usize, (at_px[k] + reach) as usize]);
    let [[x0, x1], [y0, y1]] = range;
    let part = view.part(x0, y0, x1.saturating_sub(x0) + 1, y1.saturating_sub(y0) + 1)?;
    Some((part, [x0 as f64, y0 as f64]))
}

/// The part of the view where the corners are expected, and its first pixel.
fn near<'a, P: Gray>(
    view: View<'a, P>,
    expected: Option<&Expected>,
) -> Result<(View<'a, P>, [f64; 2]), CornersError> {
    let Some(expected) = expected else {
        return Ok((view, [0.0; 2]));
    };
    for (corner, at) in super::Corner::ALL.into_iter().zip(expected.at_px) {
        let within = expected.within_px;
        if !(at[0].is_finite() && at[1].is_finite() && within.is_finite() && within >= 1.0) {
            return Err(CornersError::NotFinite { corner });
        }
    }
    // The arms point inwards: what lies outside of the expected corners is the board's rim, and light around the marks
    // is wanted as wide as a mark.
    let mut range = [[0_usize; 2]; 2];
    for (k, ends) in range.iter_mut().enumerate() {
        let values = expected.at_px.map(|p| p[k]);
        let low = values.into_iter().fold(f64::INFINITY, f64::min);
        let high = values.into_iter().fold(f64::NEG_INFINITY, f64::max);
        let margin = expected.within_px + 0.1 * (high - low) + 8.0;
        // Saturating casts: below 0 is 0.
        *ends = [(low - margin) as usize, (high + margin) as usize];
    }
    let [[x0, x1], [y0, y1]] = range;
    match view.part(x0, y0, x1.saturating_sub(x0) + 1, y1.saturating_sub(y0) + 1) {
        Some(part) => Ok((part, [x0 as f64, y0 as f64])),
        None => Err(CornersError::NoMarks { found: [false; 4] }),
    }
}

fn shifted(mut corners: Corners, shift_px: [f64; 2]) -> Corners {
    for at in &mut corners.at_px {
        *at = [at[0] + shift_px[0], at[1] + shift_px[1]];
    }
    corners
}
