//! Which mirrors may stand in whose light.

use super::verdict::Screen;
use crate::bvh::{Aabb, Bvh};
use crate::element::Element;
use crate::vector::{Vector, cross, dot, norm, scale, sub, unit};

/// Up to so many obstacles are tried one after another for sixteen rays at once; beyond, a tree finds them for each
/// ray. A test in lanes takes about 1 ns a ray, a search of the tree some 100.
const MOST_IN_LANES: usize = 64;

/// All elements, as obstacles.
pub(super) struct Obstacles<'a> {
    elements: &'a [Element],
    tree: Bvh,
}

/// What may stand in the light of one element.
#[derive(Debug, Clone, Default)]
pub(super) struct Candidates {
    /// Between it and the sun.
    pub shaders: Vec<u32>,
    /// Between it and the receiver.
    pub blockers: Vec<u32>,
}

impl Candidates {
    pub(super) fn is_empty(&self) -> bool {
        self.shaders.is_empty() && self.blockers.is_empty()
    }

    pub(super) fn fit_lanes(&self) -> bool {
        self.shaders.len() <= MOST_IN_LANES && self.blockers.len() <= MOST_IN_LANES
    }
}

/// A bundle of rays from an element.
#[derive(Clone, Copy)]
pub(super) struct Bundle<'a> {
    pub element: &'a Element,
    pub from: Vector,
    pub radius_m: f64,
    /// Unit vector.
    pub toward: Vector,
    /// Growth of its radius along the way.
    pub spread: f64,
    /// Where it ends.
    pub length_m: f64,
}

impl Bundle<'_> {
    /// True if it may meet another element: if no direction across the bundle parts the two outlines.
    fn may_meet(&self, other: &Element) -> bool {
        let (mine, theirs) = (self.element.corners_m(), other.corners_m());
        let normal = self.element.normal();
        let range = |corners: &[Vector], axis: Vector| {
            corners
                .iter()
                .fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), corner| {
                    let at = dot(sub(*corner, self.from), axis);
                    (low.min(at), high.max(at))
                })
        };
        // It leaves on the reflecting side, and goes ahead.
        let ahead = range(theirs, self.toward).1 - range(mine, self.toward).0;
        if ahead <= 0.0 || range(theirs, normal).1 <= 0.0 {
            return false;
        }
        let widened = self.spread * ahead;
        for corners in [mine, theirs] {
            for (k, from) in corners.iter().enumerate() {
                let edge = sub(corners[(k + 1) % corners.len()], *from);
                let Some(axis) = unit(cross(self.toward, edge)) else {
                    continue;
                };
                let (a, b) = (range(mine, axis), range(theirs, axis));
                if a.1 + widened < b.0 || b.1 + widened < a.0 {
                    return false;
                }
            }
        }
        true
    }

    /// True if it may touch a sphere.
    fn may_touch(&self, middle: Vector, radius_m: f64) -> bool {
        let apart = sub(middle, self.from);
        let along = dot(apart, self.toward);
        let near = radius_m + self.radius_m;
        if along < -near || along > self.length_m + near {
            return false;
        }
        let across = norm(sub(apart, scale(self.toward, along)));
        across <= near + self.spread * (along + near)
    }
}

impl<'a> Obstacles<'a> {
    /// `None` if all elements are of one mirror.
    pub(super) fn new(elements: &'a [Element]) -> Option<Self> {
        let first = elements.first()?.mirror();
        if elements.iter().all(|element| element.mirror() == first) {
            return None;
        }
        let boxes: Vec<_> = elements
            .iter()
            .map(|e| Aabb::around(e.corners_m()))
            .collect();
        Some(Self {
            elements,
            tree: Bvh::new(&boxes),
        })
    }

    /// Elements of other mirrors that a bundle may touch; of more than fit the lanes, one more than that, since
    /// the tree is asked then and a list of all of a fine mesh's would fill the memory.
    pub(super) fn touched(&self, bundle: &Bundle<'_>, mirror: u32) -> Vec<u32> {
        let mut found = Vec::new();
        let enough = core::cell::Cell::new(false);
        self.tree.visit(
            |bounds| !enough.get() && bundle.may_touch(bounds.middle(), bounds.radius()),
            |k| {
                let element = &self.elements[k];
                if element.mirror() != mirror && !enough.get() && bundle.may_meet(element) {
                    found.push(k as u32);
                    enough.set(found.len() > MOST_IN_LANES);
                }
            },
        );
        found.shrink_to_fit();
        found
    }

    /// The obstacles with places relative to a point, ready for lanes.
    pub(super) fn screens(&self, which: &[u32], origin: Vector) -> Vec<Screen> {
        which
            .iter()
            .map(|&k| screen(&self.elements[k as usize], origin))
            .collect()
    }

    /// True if a ray meets an element of another mirror before `end`, in lengths of its direction.
    pub(super) fn is_met(&self, origin: Vector, direction: Vector, end: f64, mirror: u32) -> bool {
        let inverse = direction.map(|x| 1.0 / x);
        let met = core::cell::Cell::new(false);
        self.tree.visit(
            |bounds| !met.get() && bounds.is_met(origin, inverse, 0.0, end),
            |k| {
                let element = &self.elements[k];
                if !met.get() && element.mirror() != mirror {
                    met.set(meets(element, origin, direction, end));
                }
            },
        );
        met.get()
    }
}

/// Inward sides of an element: across each edge in its plane, and how far from the origin.
fn sides(element: &Element) -> impl Iterator<Item = (Vector, f64)> + '_ {
    let corners = element.corners_m();
    let normal = element.normal();
    (0..4).map(move |k| {
        let k = k % corners.len();
        let (from, to) = (corners[k], corners[(k + 1) % corners.len()]);
        let inward = cross(normal, sub(to, from));
        (inward, dot(inward, from))
    })
}

fn screen(element: &Element, origin: Vector) -> Screen {
    let single = |v: Vector| v.map(|x| x as f32);
    let normal = element.normal();
    let mut out = Screen {
        normal: single(normal),
        offset: dot(normal, sub(element.centroid_m(), origin)) as f32,
        inward: [[0.0; 3]; 4],
        bounds: [0.0; 4],
    };
    for (k, (inward, bound)) in sides(element).enumerate() {
        out.inward[k] = single(inward);
        out.bounds[k] = (bound - dot(inward, origin)) as f32;
    }
    out
}

fn meets(element: &Element, origin: Vector, direction: Vector, end: f64) -> bool {
    let normal = element.normal();
    let along = dot(normal, sub(element.centroid_m(), origin)) / dot(normal, direction);
    if !(along > 0.0 && along < end) {
        return false;
    }
    let point: Vector = core::array::from_fn(|k| origin[k] + along * direction[k]);
    sides(element).all(|(inward, bound)| dot(inward, point) >= bound)
}
