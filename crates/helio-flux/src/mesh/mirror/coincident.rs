//! Faces that stand where others do, on nodes of their own.

use std::collections::HashMap;

use super::Candidate;
use crate::vector::{Vector, norm, sub};

/// Of the extent of all faces: two files, or two parts of one, round their numbers so far apart at most.
const OF_EXTENT: f64 = 1e-6;
/// Of a face's longest diagonal: corners farther apart are those of two faces, however small these are.
const OF_FACE: f64 = 1e-3;
/// Cells are so many tolerances wide: few places share one, and few nodes stand near its borders.
const CELL: f64 = 4.0;

/// Numbers for places: nodes within the tolerance of each other have the same.
struct Places {
    tolerance_m: f64,
    low_m: Vector,
    cells: HashMap<[i64; 3], Vec<(u32, Vector)>>,
    count: u32,
}

impl Places {
    fn cell(&self, axis: usize, at_m: f64) -> i64 {
        ((at_m - self.low_m[axis]) / (CELL * self.tolerance_m)).floor() as i64
    }

    /// The number of a place, a new one if none is near.
    fn of(&mut self, at_m: Vector) -> u32 {
        let range = |axis: usize| {
            let [low, high] =
                [-1.0, 1.0].map(|side| self.cell(axis, at_m[axis] + side * self.tolerance_m));
            low..=high
        };
        let [xs, ys, zs] = [0, 1, 2].map(range);
        for x in xs {
            for y in ys.clone() {
                for z in zs.clone() {
                    let near =
                        self.cells.get(&[x, y, z]).into_iter().flatten().find(|at| {
                            (0..3).all(|k| (at.1[k] - at_m[k]).abs() <= self.tolerance_m)
                        });
                    if let Some(&(number, _)) = near {
                        return number;
                    }
                }
            }
        }
        let own = [0, 1, 2].map(|axis| self.cell(axis, at_m[axis]));
        let number = self.count;
        self.cells.entry(own).or_default().push((number, at_m));
        self.count += 1;
        number
    }
}

/// Whether each face stands where one before it does: every corner at one of the other's. Of a quadrilateral and the two
/// triangles that it comes to by a diagonal, what is last: the quadrilateral, or both triangles where it is before them.
pub(super) fn stand_twice(candidates: &[Candidate], position_m: &[Vector]) -> Vec<bool> {
    let at = |node: &u32| position_m[*node as usize];
    let mut low_m = [f64::INFINITY; 3];
    let mut high_m = [f64::NEG_INFINITY; 3];
    for corner in candidates.iter().flat_map(Candidate::corners).map(at) {
        for k in 0..3 {
            low_m[k] = low_m[k].min(corner[k]);
            high_m[k] = high_m[k].max(corner[k]);
        }
    }
    let extent_m = (0..3).fold(0.0_f64, |most, k| most.max(high_m[k] - low_m[k]));
    let mut places = Places {
        tolerance_m: (OF_EXTENT * extent_m).max(f64::MIN_POSITIVE),
        low_m,
        cells: HashMap::new(),
        count: 0,
    };
    let mut place_of = vec![u32::MAX; position_m.len()];
    for node in candidates.iter().flat_map(Candidate::corners) {
        let place = &mut place_of[*node as usize];
        if *place == u32::MAX {
            *place = places.of(at(node));
        }
    }
    let corners = |row: usize| candidates[row].corners().iter().map(at);
    let mut first: HashMap<[u32; 4], usize> = HashMap::with_capacity(candidates.len());
    let mut twice = vec![false; candidates.len()];
    for (row, candidate) in candidates.iter().enumerate() {
        let corner_places = candidate.corners().iter().map(|n| place_of[*n as usize]);
        let before = *first.entry(key(corner_places)).or_insert(row);
        if before < row {
            let [one, other]: [Vec<_>; 2] = [before, row].map(|row| corners(row).collect());
            twice[row] = is_same(&one, &other);
        }
    }
    mark_split(candidates, position_m, &place_of, &first, &mut twice);
    twice
}

/// Marks quadrilaterals on the two triangles that they come to by a diagonal, or the triangles on the quadrilateral.
fn mark_split(
    candidates: &[Candidate],
    position_m: &[Vector],
    place_of: &[u32],
    first: &HashMap<[u32; 4], usize>,
    twice: &mut [bool],
) {
    let corners = |row: usize| {
        let nodes = candidates[row].corners().iter();
        nodes.map(|node| position_m[*node as usize])
    };
    let triangle = |half: [u32; 3]| first.get(&key(half.iter().map(|n| place_of[*n as usize])));
    for (row, candidate) in candidates.iter().enumerate() {
        let &[a, b, c, d] = candidate.corners() else {
            continue;
        };
        for halves in [[[a, b, c], [c, d, a]], [[b, c, d], [d, a, b]]] {
            let [Some(&one), Some(&other)] = halves.map(triangle) else {
                continue;
            };
            if one == other || [row, one, other].iter().any(|row| twice[*row]) {
                continue;
            }
            let whole: Vec<_> = corners(row).collect();
            let parts: Vec<_> = corners(one).chain(corners(other)).collect();
            if is_same(&whole, &parts) {
                let last: &[usize] = if row < one.min(other) {
                    &[one, other]
                } else {
                    &[row]
                };
                last.iter().for_each(|row| twice[*row] = true);
            }
        }
    }
}

/// The places of a face's corners, whichever it begins with and whichever way round it goes.
fn key(places: impl Iterator<Item = u32>) -> [u32; 4] {
    let mut key = [u32::MAX; 4];
    for (slot, place) in key.iter_mut().zip(places) {
        *slot = place;
    }
    key.sort_unstable();
    key
}

/// Whether every corner of one is at a corner of the other, as near as their size wants it.
fn is_same(one: &[Vector], other: &[Vector]) -> bool {
    let distance = |a: &Vector, b: &Vector| norm(sub(*a, *b));
    let longest_m = one
        .iter()
        .flat_map(|a| one.iter().map(move |b| distance(a, b)))
        .fold(0.0, f64::max);
    let is_at =
        |a: &Vector, all: &[Vector]| all.iter().any(|b| distance(a, b) <= OF_FACE * longest_m);
    one.iter().all(|a| is_at(a, other)) && other.iter().all(|b| is_at(b, one))
}
