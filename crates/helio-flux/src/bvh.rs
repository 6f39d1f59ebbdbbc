//! Boxes in a tree: which of many things a ray or a cone may touch.

use crate::vector::Vector;

/// A box along the axes.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Aabb {
    pub low: Vector,
    pub high: Vector,
}

impl Aabb {
    pub(crate) fn around(points: &[Vector]) -> Self {
        let mut out = Self {
            low: [f64::INFINITY; 3],
            high: [f64::NEG_INFINITY; 3],
        };
        for &point in points {
            out = out.union(Self {
                low: point,
                high: point,
            });
        }
        out
    }

    fn union(self, other: Self) -> Self {
        Self {
            low: core::array::from_fn(|k| self.low[k].min(other.low[k])),
            high: core::array::from_fn(|k| self.high[k].max(other.high[k])),
        }
    }

    pub(crate) fn middle(&self) -> Vector {
        core::array::from_fn(|k| 0.5 * (self.low[k] + self.high[k]))
    }

    /// Radius of the sphere around it.
    pub(crate) fn radius(&self) -> f64 {
        let half = core::array::from_fn(|k| 0.5 * (self.high[k] - self.low[k]));
        crate::vector::norm(half)
    }

    /// True if a ray passes through it (grown by a few roundings) between `from` and `to`, in lengths of its
    /// direction.
    pub(crate) fn is_met(&self, origin: Vector, inverse: Vector, from: f64, to: f64) -> bool {
        let (mut near, mut far) = (from, to);
        for k in 0..3 {
            let a = (self.low[k] - origin[k]) * inverse[k];
            let b = (self.high[k] - origin[k]) * inverse[k];
            // A ray within a face gives NaN, which `min` and `max` leave out: the face counts as met.
            near = near.max(a.min(b));
            far = far.min(a.max(b));
        }
        let rounding = 8.0 * f64::EPSILON * near.abs().max(far.abs());
        near <= far + rounding
    }
}

/// Things in a leaf: testing two more boxes costs about as much as testing these.
const LEAF: usize = 4;

#[derive(Debug, Clone, PartialEq)]
struct Node {
    bounds: Aabb,
    /// Of a leaf the first of its things; of others the second child (the first follows at once).
    first: u32,
    /// Things of a leaf; 0 for others.
    count: u32,
}

/// A tree over boxes, split in the middle of their order along the longest side.
#[derive(Debug, Clone, Default, PartialEq)]
pub(crate) struct Bvh {
    nodes: Vec<Node>,
    order: Vec<u32>,
}

impl Bvh {
    pub(crate) fn new(boxes: &[Aabb]) -> Self {
        let mut tree = Self {
            nodes: Vec::with_capacity(boxes.len()),
            order: (0..boxes.len() as u32).collect(),
        };
        if !boxes.is_empty() {
            let mut order = core::mem::take(&mut tree.order);
            tree.build(boxes, &mut order, 0);
            tree.order = order;
        }
        tree
    }

    fn build(&mut self, boxes: &[Aabb], order: &mut [u32], first: usize) {
        let mut bounds = boxes[order[0] as usize];
        for &k in &order[1..] {
            bounds = bounds.union(boxes[k as usize]);
        }
        let at = self.nodes.len();
        self.nodes.push(Node {
            bounds,
            first: first as u32,
            count: order.len() as u32,
        });
        if order.len() <= LEAF {
            return;
        }
        let side = |k: usize| bounds.high[k] - bounds.low[k];
        let axis = (1..3).fold(0, |best, k| if side(k) > side(best) { k } else { best });
        let middle = |k: &u32| {
            let b = &boxes[*k as usize];
            b.low[axis] + b.high[axis]
        };
        let half = order.len() / 2;
        order.select_nth_unstable_by(half, |a, b| middle(a).total_cmp(&middle(b)).then(a.cmp(b)));
        let (left, right) = order.split_at_mut(half);
        self.build(boxes, left, first);
        self.nodes[at].first = self.nodes.len() as u32;
        self.nodes[at].count = 0;
        self.build(boxes, right, first + half);
    }

    /// Calls `thing` with each thing in boxes that `may` says yes to.
    pub(crate) fn visit(&self, mut may: impl FnMut(&Aabb) -> bool, mut thing: impl FnMut(usize)) {
        // Halving 2³² things leaves no more than this to come back to.
        let mut stack = [0_u32; 40];
        let mut depth = 0;
        let mut at = 0;
        loop {
            if let Some(node) = self.nodes.get(at)
                && may(&node.bounds)
            {
                if node.count == 0 {
                    stack[depth] = node.first;
                    depth += 1;
                    at += 1;
                    continue;
                }
                let first = node.first as usize;
                for &k in &self.order[first..first + node.count as usize] {
                    thing(k as usize);
                }
            }
            if depth == 0 {
                return;
            }
            depth -= 1;
            at = stack[depth] as usize;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sampling::{hash, part};

    #[test]
    fn a_ray_finds_the_boxes_that_it_finds_one_by_one() {
        let mut number = 0;
        let mut next = || {
            number += 1;
            part(hash(7, number))
        };
        let boxes: Vec<Aabb> = (0..500)
            .map(|_| {
                let low: Vector = core::array::from_fn(|_| 10.0 * next());
                let high = low.map(|x| x + next());
                Aabb { low, high }
            })
            .collect();
        let tree = Bvh::new(&boxes);
        let mut found_any = 0;
        for _ in 0..200 {
            let origin: Vector = core::array::from_fn(|_| 10.0 * next());
            let inverse: Vector = core::array::from_fn(|_| 1.0 / (next() - 0.5));
            let mut found = Vec::new();
            let meets = |b: &Aabb| b.is_met(origin, inverse, 0.0, f64::INFINITY);
            tree.visit(meets, |k| {
                if meets(&boxes[k]) {
                    found.push(k);
                }
            });
            found.sort_unstable();
            let wanted: Vec<_> = (0..boxes.len()).filter(|&k| meets(&boxes[k])).collect();
            assert_eq!(found, wanted);
            found_any += usize::from(!wanted.is_empty());
        }
        assert!(found_any > 50);
        Bvh::new(&[]).visit(|_| true, |_| panic!("of nothing"));
    }
}
