//! The light of one mirror, laid into the bins of the receiver.

use super::ConvolveOptions;
use super::outline::{Figure, Outline};
use super::surface::{Ball, Surface, point};
use crate::receiver::Receiver;
use crate::vector::{Vector, add, dot, norm, scale, sub};

/// Points of pairs see an image as smooth that lie this part of what half the light of a point is spread over apart; and
/// single ones.
const POINTS_APART: [f64; 2] = [0.4, 0.2];

/// Pieces of a mirror may be this part of it long to count as a few points.
const PIECE_LENGTH: f64 = 0.5;

/// Most points along a side of a bin: beyond, the mirror is cut instead.
const MOST_SIDE: usize = 16;

/// Points around a cylinder or cone, at least.
const AROUND: usize = 64;

/// Pieces are this part of a mirror long at least.
const SHORTEST: f64 = 4096.0;

/// Most evaluations for one mirror that is cut: a second or so.
const MOST_EVALUATIONS: u64 = 1 << 23;

/// Part of the light of a piece too long still that may be in a wrong bin: half of it on one side of an edge, where a
/// quarter was to be.
const WRONG: f64 = 0.25;

/// Why a mirror's light has no place.
pub(super) enum Trouble {
    /// So much of its power may be in wrong bins.
    NotSettled(f64),
    /// A bin that its light comes to lies behind another.
    Hidden { bin: usize, by: usize },
}

/// A flat piece of the receiver, in the axes of a mirror.
struct Cell {
    slot: u32,
    ball: Ball,
    corners: [Vector; 4],
    count: usize,
}

/// What a thread lays light with.
pub(super) struct Spread<'a> {
    surface: &'a Surface<'a>,
    tolerance: f64,
    points: usize,
    /// The bins that may be lit by the mirror at hand, and their power \[W\].
    pub bins: Vec<u32>,
    pub power_w: Vec<f64>,
    whole_plane: Option<[Vector; 4]>,
    /// Whether parts of the receiver may lie behind others.
    is_folded: bool,
    cells: Vec<Cell>,
    /// Polygons put under a cone for the mirror at hand.
    pub evaluations: u64,
    unsettled_w: f64,
    hidden: Option<(usize, usize)>,
}

impl<'a> Spread<'a> {
    pub(super) fn new(surface: &'a Surface<'a>, options: &ConvolveOptions) -> Self {
        let receiver = surface.receiver;
        Self {
            surface,
            tolerance: options.tolerance,
            points: options.points,
            bins: Vec::new(),
            power_w: Vec::new(),
            whole_plane: surface.whole_plane(),
            is_folded: matches!(receiver, Receiver::Mesh(_)) && receiver.plane().is_none(),
            cells: Vec::new(),
            evaluations: 0,
            unsettled_w: 0.0,
            hidden: None,
        }
    }

    /// Finds [`bins`](Self::bins) and [`power_w`](Self::power_w) of a mirror.
    ///
    /// Of mirror, bin and blur (what the cone makes of a point at the bin's distance), the cone is always integrated as it
    /// is; points stand for the bin where that is fine against the blur, and else for the mirror, which is cut until its
    /// pieces are, or light one bin only.
    pub(super) fn light(&mut self, outline: &Outline<'_>) -> Result<(), Trouble> {
        let from = outline.ball();
        let local = |ball: &Ball| Ball {
            centre: outline.local(ball.centre),
            radius_m: ball.radius_m,
        };
        let mut bins = core::mem::take(&mut self.bins);
        self.surface
            .near(|ball| outline.reaches(&from, &local(ball)), &mut bins);
        self.bins = bins;
        self.evaluations = 0;
        self.power_w.clear();
        self.power_w.resize(self.bins.len(), 0.0);
        if self.bins.is_empty() {
            return Ok(());
        }
        let (mut nearest_m, mut size_m) = (f64::INFINITY, [0.0_f64; 2]);
        for &bin in &self.bins {
            let middle = self.surface.receiver.bin_centre_m(bin as usize);
            let own_m = self.surface.size_m(bin as usize);
            let near_m = outline.local(middle)[2] - from.centre[2] - own_m[0].max(own_m[1]);
            nearest_m = nearest_m.min(near_m);
            size_m = [0, 1].map(|k| size_m[k].max(own_m[k]));
        }
        // parts of a bin much nearer than where the middle ray ends are in the light of none
        let blur_m = outline.blur_m(nearest_m.max(0.5 * self.way_m(outline)));
        if self.at_points(outline, size_m, blur_m) {
            return Ok(());
        }
        self.in_pieces(outline, blur_m)
    }

    /// How far the middle ray goes, or if it misses, how far away the receiver is along it \[m\].
    fn way_m(&self, outline: &Outline<'_>) -> f64 {
        let (from, along) = outline.middle_ray();
        let hit = self.surface.receiver.hit(from, along);
        let away = dot(sub(self.surface.receiver.centre_m(), from), along);
        hit.map_or(away, |hit| hit.along)
    }

    /// At points of the bins, as many as it takes until they hold what falls on the receiver; false if that is more than
    /// pieces of the mirror take.
    fn at_points(&mut self, outline: &Outline<'_>, size_m: [f64; 2], blur_m: f64) -> bool {
        let mut sides = size_m.map(|size_m| {
            let mut side = self.points;
            let most = |side: usize| POINTS_APART[side % 2] * blur_m * side as f64;
            while size_m > most(side) && side <= MOST_SIDE {
                side *= 2;
            }
            side
        });
        if let Receiver::Frustum(round) = self.surface.receiver {
            // where it curves away from the light, too
            while sides[1] * round.columns() < AROUND {
                sides[1] *= 2;
            }
        }
        let cuts = pieces(&outline.figure, PIECE_LENGTH * blur_m);
        let nodes = outline.figure.nodes().1 as f64;
        let is_mesh = matches!(self.surface.receiver, Receiver::Mesh(_));
        if is_mesh || (sides[0] * sides[1]) as f64 >= nodes * cuts {
            return false;
        }
        let inside_w = match self.whole_plane {
            Some(whole) => {
                let whole = whole.map(|p| outline.local(p));
                let all = (outline.figure, outline.power_w);
                Some(self.inside(outline, &whole, all, blur_m))
            }
            // The outline of a round receiver has too many edges to be asked.
            None => None,
        };
        let receiver = self.surface.receiver;
        while sides[0].max(sides[1]) <= MOST_SIDE {
            let mut sum_w = 0.0;
            let count = sides[0] * sides[1];
            let kept = self.surface.points(sides);
            for (power_w, &bin) in self.power_w.iter_mut().zip(&self.bins) {
                let bin = bin as usize;
                let sum: f64 = match kept {
                    Some(all) => {
                        let mine = &all[bin * count..(bin + 1) * count];
                        mine.iter().map(|point| outline.flux_at(point)).sum()
                    }
                    None => (0..count)
                        .map(|k| outline.flux_at(&point(receiver, bin, k, sides)))
                        .sum(),
                };
                *power_w = sum / count as f64 * receiver.bin_area_m2(bin);
                sum_w += *power_w;
            }
            self.evaluations += (self.bins.len() * count) as u64;
            if self.whole_plane.is_none()
                && self.grazing_w(outline, sides) > self.tolerance * outline.power_w
            {
                break;
            }
            let wanted_w = inside_w.unwrap_or(sum_w).min(outline.power_w);
            if (sum_w - wanted_w).abs() <= self.tolerance * outline.power_w {
                // to the last digit
                if sum_w > 0.0 {
                    for power_w in &mut self.power_w {
                        *power_w *= wanted_w / sum_w;
                    }
                }
                return true;
            }
            sides = sides.map(|side| 2 * side);
        }
        self.power_w.fill(0.0);
        false
    }

    /// Power that may be wrong at points which the light grazes \[W\].
    fn grazing_w(&self, outline: &Outline<'_>, sides: [usize; 2]) -> f64 {
        let receiver = self.surface.receiver;
        let count = sides[0] * sides[1];
        let of_bin = |&bin: &u32| {
            let bin = bin as usize;
            let at = |k: usize| outline.grazing_at(&point(receiver, bin, k, sides));
            (0..count).map(at).sum::<f64>() / count as f64 * receiver.bin_area_m2(bin)
        };
        self.bins.iter().map(of_bin).sum()
    }

    /// Power of a piece (figure, power) that falls on a flat receiver, given its corners, without its
    /// bins.
    fn inside(
        &self,
        outline: &Outline<'_>,
        whole: &[Vector; 4],
        (figure, power_w): (Figure, f64),
        blur_m: f64,
    ) -> f64 {
        let ball = around(&figure);
        let mut receiver = self.surface.ball();
        receiver.centre = outline.local(receiver.centre);
        if !outline.reaches(&ball, &receiver) {
            return 0.0;
        }
        let part = |from: &Vector| outline.part_on(*from, whole);
        let length_m = figure.length_m();
        let is_small = length_m <= PIECE_LENGTH * blur_m;
        if !is_small {
            let (corners, count) = figure.corners();
            if corners[..count].iter().all(|corner| part(corner) >= 1.0) {
                return power_w;
            }
        }
        if is_small || length_m <= outline.length_m / SHORTEST {
            let (nodes, count) = figure.nodes();
            let sum: f64 = nodes[..count].iter().map(part).sum();
            return sum / count as f64 * power_w;
        }
        let (parts, count) = figure.parts();
        let each_w = power_w / count as f64;
        parts[..count]
            .iter()
            .map(|part| self.inside(outline, whole, (*part, each_w), blur_m))
            .sum()
    }

    /// Piece by piece of the mirror, each as a few points that see the bins as they are: what they give adds up to what
    /// falls on the receiver, whatever their number.
    fn in_pieces(&mut self, outline: &Outline<'_>, blur_m: f64) -> Result<(), Trouble> {
        let (surface, from) = (self.surface, outline.ball());
        self.cells.clear();
        for (slot, &bin) in self.bins.iter().enumerate() {
            surface.each_piece(bin as usize, |corners| {
                let count = corners.len().min(4);
                let mut kept = [[0.0; 3]; 4];
                for (to, corner) in kept.iter_mut().zip(corners) {
                    *to = outline.local(*corner);
                }
                let ball = ball_of(&kept[..count]);
                if outline.reaches(&from, &ball) {
                    self.cells.push(Cell {
                        slot: slot as u32,
                        ball,
                        corners: kept,
                        count,
                    });
                }
            });
        }
        (self.unsettled_w, self.hidden) = (0.0, None);
        let mut stack: Vec<u32> = (0..self.cells.len() as u32).collect();
        let all = (outline.figure, outline.power_w);
        self.piece(outline, all, blur_m, 0, &mut stack);
        if let Some((bin, by)) = self.hidden {
            return Err(Trouble::Hidden { bin, by });
        }
        let wrong = WRONG * self.unsettled_w / outline.power_w;
        if wrong > self.tolerance {
            return Err(Trouble::NotSettled(wrong));
        }
        Ok(())
    }

    /// A piece (figure, power) whose light can reach the cells from `first` on in the stack.
    fn piece(
        &mut self,
        outline: &Outline<'_>,
        (figure, power_w): (Figure, f64),
        blur_m: f64,
        first: usize,
        stack: &mut Vec<u32>,
    ) {
        let (from, to) = (first, stack.len());
        let ball = around(&figure);
        for k in from..to {
            let cell = stack[k];
            if outline.reaches(&ball, &self.cells[cell as usize].ball) {
                stack.push(cell);
            }
        }
        let mine = to..stack.len();
        self.evaluations += mine.len() as u64;
        let length_m = figure.length_m();
        if length_m <= PIECE_LENGTH * blur_m {
            self.lay(outline, &figure, power_w, &stack[mine]);
        } else if let Some(cell) = self.only(outline, &figure, &stack[mine.clone()]) {
            self.power_w[cell] += power_w;
        } else if length_m <= outline.length_m / SHORTEST || self.evaluations > MOST_EVALUATIONS {
            if !mine.is_empty() {
                self.unsettled_w += power_w;
                self.lay(outline, &figure, power_w, &stack[mine]);
            }
        } else if !mine.is_empty() {
            let (parts, count) = figure.parts();
            for part in &parts[..count] {
                self.piece(outline, (*part, power_w / count as f64), blur_m, to, stack);
            }
        }
        stack.truncate(to);
    }

    /// The slot of the one cell that all light of a piece falls on, if there is one: what falls there from all
    /// its corners does so from all of it.
    fn only(&mut self, outline: &Outline<'_>, figure: &Figure, cells: &[u32]) -> Option<usize> {
        if self.is_folded {
            return None;
        }
        let (corners, count) = figure.corners();
        let middle = figure.middle();
        for &cell in cells {
            let cell = &self.cells[cell as usize];
            let holds = |p: &Vector| outline.part_on(*p, &cell.corners[..cell.count]) >= 1.0;
            self.evaluations += 1;
            if holds(&middle) {
                return corners[..count]
                    .iter()
                    .all(holds)
                    .then_some(cell.slot as usize);
            }
        }
        None
    }

    /// The light of a few points of a piece.
    fn lay(&mut self, outline: &Outline<'_>, figure: &Figure, power_w: f64, cells: &[u32]) {
        let (nodes, count) = figure.nodes();
        let each_w = power_w / count as f64;
        self.evaluations += (count * cells.len()) as u64;
        for &cell in cells {
            let cell = &self.cells[cell as usize];
            let corners = &cell.corners[..cell.count];
            let part = |node: &Vector| outline.part_on(*node, corners);
            let sum: f64 = nodes[..count].iter().map(part).sum();
            self.power_w[cell.slot as usize] += each_w * sum;
            if self.is_folded && sum > 0.0 && self.hidden.is_none() {
                let bin = self.bins[cell.slot as usize] as usize;
                self.hidden = hidden_by(self.surface.receiver, outline, nodes[0], bin);
            }
        }
    }
}

/// Whether a triangle, or a part of it, lies behind another as seen from a point of the mirror: both.
fn hidden_by(
    receiver: &Receiver,
    outline: &Outline<'_>,
    from: Vector,
    bin: usize,
) -> Option<(usize, usize)> {
    let from = outline.world(from);
    let middle = receiver.bin_centre_m(bin);
    let corners = receiver.bin_corners_m(bin);
    let inside = |p: &Vector| add(scale(*p, 0.9), scale(middle, 0.1));
    let places = core::iter::once(middle).chain(corners.iter().map(inside));
    places
        .filter_map(|place| receiver.hit(from, sub(place, from)))
        .find(|hit| hit.bin != bin && hit.along < 1.0 - 1e-6)
        .map(|hit| (bin, hit.bin))
}

/// How many pieces a figure is cut into until all are so short.
fn pieces(figure: &Figure, short_m: f64) -> f64 {
    let cuts = |length_m: f64| {
        (length_m / short_m)
            .clamp(1.0, SHORTEST)
            .log2()
            .ceil()
            .exp2()
    };
    if figure.is_triangle {
        return cuts(figure.length_m()).powi(2);
    }
    figure.edges.iter().map(|edge| cuts(norm(*edge))).product()
}

fn around(figure: &Figure) -> Ball {
    let (corners, count) = figure.corners();
    ball_of(&corners[..count])
}

fn ball_of(corners: &[Vector]) -> Ball {
    let sum = corners.iter().fold([0.0; 3], |sum, p| add(sum, *p));
    let centre = scale(sum, 1.0 / corners.len().max(1) as f64);
    let away = corners.iter().map(|p| norm(sub(*p, centre)));
    Ball {
        centre,
        radius_m: away.fold(0.0, f64::max),
    }
}
