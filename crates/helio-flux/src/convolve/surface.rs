//! The receiver as flat pieces, as points, and as a tree of balls.

use std::sync::OnceLock;

use crate::receiver::Receiver;
use crate::vector::{Vector, add, norm, scale, sub};

/// Flat pieces around a cylinder or cone, at least: the prism is 8e-5 of the radius inside it on the average.
const AROUND: usize = 256;

/// Bins of a leaf.
const LEAF: usize = 8;

/// Points kept, at most: 50 MB of them.
const KEPT: usize = 1 << 20;

/// A place on the receiver, the way it faces, and how much of its bin it stands for: 1 for an even share.
#[derive(Clone, Copy)]
pub(super) struct Point {
    pub at: Vector,
    pub normal: Vector,
    pub share: f64,
}

/// A ball around a part of something.
#[derive(Clone, Copy)]
pub(super) struct Ball {
    pub centre: Vector,
    pub radius_m: f64,
}

/// A part of the tree: its bins are `order[first..last]`.
struct Node {
    ball: Ball,
    first: usize,
    last: usize,
    /// The second of its two children; the first follows it. 0 for a leaf.
    second: usize,
}

pub(super) struct Surface<'a> {
    pub receiver: &'a Receiver,
    nodes: Vec<Node>,
    order: Vec<u32>,
    /// Height and width of each bin \[m\]; one for all where they are alike.
    sizes_m: Vec<[f64; 2]>,
    /// Of one, two and four points along each side.
    points: [OnceLock<Vec<Point>>; 9],
    /// Flat pieces that a column of a round receiver is cut into.
    pub cuts: usize,
}

impl<'a> Surface<'a> {
    fn bare(receiver: &'a Receiver) -> Self {
        let cuts = match receiver {
            Receiver::Frustum(round) => AROUND.div_ceil(round.columns()),
            _ => 1,
        };
        Self {
            receiver,
            nodes: Vec::new(),
            order: Vec::new(),
            sizes_m: Vec::new(),
            points: [const { OnceLock::new() }; 9],
            cuts,
        }
    }

    pub(super) fn new(receiver: &'a Receiver) -> Self {
        let bins = receiver.bins();
        let mut surface = Self::bare(receiver);
        surface.sizes_m = match receiver {
            Receiver::Plane(_) => vec![surface.size_of(0)],
            _ => (0..bins).map(|bin| surface.size_of(bin)).collect(),
        };
        let balls: Vec<Ball> = (0..bins).map(|bin| surface.ball_of(bin)).collect();
        let mut order: Vec<u32> = (0..bins as u32).collect();
        surface.grow(&mut order, 0, &balls);
        surface.order = order;
        surface
    }

    /// A ball around a bin, and its longest side \[m\].
    pub(super) fn bin(receiver: &'a Receiver, bin: usize) -> (Ball, f64) {
        let surface = Self::bare(receiver);
        let [height_m, width_m] = surface.size_of(bin);
        (surface.ball_of(bin), height_m.max(width_m))
    }

    pub(super) fn size_m(&self, bin: usize) -> [f64; 2] {
        self.sizes_m[bin.min(self.sizes_m.len() - 1)]
    }

    fn size_of(&self, bin: usize) -> [f64; 2] {
        let mut size_m = [0.0_f64; 2];
        self.each_piece(bin, |corners| {
            for (k, corner) in corners.iter().enumerate() {
                let side_m = norm(sub(corners[(k + 1) % corners.len()], *corner));
                // first along a row, then down, and so on
                let cuts = if k % 2 == 0 { self.cuts as f64 } else { 1.0 };
                size_m[1 - k % 2] = size_m[1 - k % 2].max(side_m * cuts);
            }
        });
        size_m
    }

    fn ball_of(&self, bin: usize) -> Ball {
        let centre = self.receiver.bin_centre_m(bin);
        let mut radius_m = 0.0_f64;
        self.each_piece(bin, |corners| {
            for corner in corners {
                radius_m = radius_m.max(norm(sub(*corner, centre)));
            }
        });
        Ball { centre, radius_m }
    }

    /// The tree of some bins, from `first` on in the order; halves along the longest way between their middles.
    fn grow(&mut self, bins: &mut [u32], first: usize, balls: &[Ball]) -> usize {
        let (mut low, mut high) = ([f64::INFINITY; 3], [f64::NEG_INFINITY; 3]);
        for &bin in bins.iter() {
            for (k, x) in balls[bin as usize].centre.into_iter().enumerate() {
                low[k] = low[k].min(x);
                high[k] = high[k].max(x);
            }
        }
        let centre = scale(add(low, high), 0.5);
        let reach = |ball: &Ball| norm(sub(ball.centre, centre)) + ball.radius_m;
        let radius_m = bins.iter().map(|&bin| reach(&balls[bin as usize]));
        let ball = Ball {
            centre,
            radius_m: radius_m.fold(0.0, f64::max),
        };
        let node = self.nodes.len();
        self.nodes.push(Node {
            ball,
            first,
            last: first + bins.len(),
            second: 0,
        });
        if bins.len() > LEAF {
            let extent = sub(high, low);
            let axis = (0..3).fold(0, |best, k| if extent[k] > extent[best] { k } else { best });
            let half = bins.len() / 2;
            bins.select_nth_unstable_by(half, |&a, &b| {
                let at = |bin: u32| balls[bin as usize].centre[axis];
                at(a).total_cmp(&at(b)).then(a.cmp(&b))
            });
            let (one, other) = bins.split_at_mut(half);
            self.grow(one, first, balls);
            let second = self.grow(other, first + half, balls);
            self.nodes[node].second = second;
        }
        node
    }

    /// The bins of leaves whose ball is wanted.
    pub(super) fn near(&self, wanted: impl Fn(&Ball) -> bool, bins: &mut Vec<u32>) {
        bins.clear();
        let mut stack = vec![0];
        while let Some(node) = stack.pop() {
            let Node {
                ball,
                first,
                last,
                second,
            } = &self.nodes[node];
            if !wanted(ball) {
                continue;
            }
            if *second == 0 {
                bins.extend(&self.order[*first..*last]);
            } else {
                stack.push(*second);
                stack.push(node + 1);
            }
        }
    }

    /// All of it.
    pub(super) fn ball(&self) -> Ball {
        self.nodes[0].ball
    }

    /// Points of all bins, `sides` of them down and along a row of each, if they are few enough to be kept.
    pub(super) fn points(&self, sides: [usize; 2]) -> Option<&[Point]> {
        let bins = self.receiver.bins();
        let count = sides[0] * sides[1];
        let place = |side: usize| [1, 2, 4].iter().position(|&n| n == side);
        let place = 3 * place(sides[0])? + place(sides[1])?;
        if bins * count > KEPT {
            return None;
        }
        let all = || {
            let one = |k: usize| point(self.receiver, k / count, k % count, sides);
            (0..bins * count).map(one).collect()
        };
        Some(self.points[place].get_or_init(all))
    }

    /// The flat pieces of a bin: their corners, counterclockwise as seen from the lit side.
    pub(super) fn each_piece(&self, bin: usize, mut see: impl FnMut(&[Vector])) {
        let (row, column) = (bin / self.receiver.columns(), bin % self.receiver.columns());
        let (row, column) = (row as f64, column as f64);
        match self.receiver {
            Receiver::Plane(plane) => see(&rectangle(|r, c| plane.point_m(row + r, column + c))),
            Receiver::Frustum(round) => {
                let cut = |k: usize, c: f64| column + (k as f64 + c) / self.cuts as f64;
                for k in 0..self.cuts {
                    see(&rectangle(|r, c| round.point_m(row + r, cut(k, c))));
                }
            }
            Receiver::Mesh(mesh) => see(mesh.corners_m(bin).unwrap_or_default()),
        }
    }

    /// The outline of a flat receiver with a grid.
    pub(super) fn whole_plane(&self) -> Option<[Vector; 4]> {
        let Receiver::Plane(plane) = self.receiver else {
            return None;
        };
        let (rows, columns) = (plane.rows() as f64, plane.columns() as f64);
        Some(rectangle(|r, c| plane.point_m(r * rows, c * columns)))
    }
}

/// One of the points of a bin (of a triangle: with as many along each side), each of which stands for the same area, or on a
/// cone for more where it is wider.
pub(super) fn point(receiver: &Receiver, bin: usize, k: usize, sides: [usize; 2]) -> Point {
    let [high, wide] = sides;
    let (row, column) = (bin / receiver.columns(), bin % receiver.columns());
    let row = row as f64 + place(k / wide, high);
    let column = column as f64 + place(k % wide, wide);
    match receiver {
        Receiver::Plane(plane) => Point {
            at: plane.point_m(row, column),
            normal: plane.normal(),
            share: 1.0,
        },
        Receiver::Frustum(round) => Point {
            at: round.point_m(row, column),
            normal: round.normal(column),
            share: round.share_at(row),
        },
        Receiver::Mesh(mesh) => Point {
            at: of_triangle(mesh.corners_m(bin).unwrap_or_default(), k, wide),
            normal: receiver.bin_normal(bin),
            share: 1.0,
        },
    }
}

/// The middle of one of the triangles that lines along its sides cut a triangle into, `side` rows of 1, 3, 5, …
fn of_triangle(corners: &[Vector], k: usize, side: usize) -> Vector {
    let &[a, b, c] = corners else {
        return [0.0; 3];
    };
    let row = k.isqrt();
    let along = k - row * row;
    // sums of the places of three corners: rows from the first corner, and steps along them
    let (rows, steps) = if along.is_multiple_of(2) {
        (3 * row + 2, 3 * (along / 2) + 1)
    } else {
        (3 * row + 1, 3 * (along / 2) + 2)
    };
    let third = 1.0 / (3 * side) as f64;
    let down = scale(sub(b, a), rows as f64 * third);
    add(a, add(down, scale(sub(c, b), steps as f64 * third)))
}

/// The nodes of a rule along a side, as parts of it: of Gauss with two for each pair, or the middle of each part.
fn place(k: usize, side: usize) -> f64 {
    const AWAY: f64 = 0.577_350_269_189_625_8;
    let at = if side.is_multiple_of(2) {
        (k - k % 2) as f64 + 1.0 + if k.is_multiple_of(2) { -AWAY } else { AWAY }
    } else {
        k as f64 + 0.5
    };
    at / side as f64
}

/// Corners, given parts of the way down and to the right.
fn rectangle(at: impl Fn(f64, f64) -> Vector) -> [Vector; 4] {
    [at(1.0, 0.0), at(1.0, 1.0), at(0.0, 1.0), at(0.0, 0.0)]
}
