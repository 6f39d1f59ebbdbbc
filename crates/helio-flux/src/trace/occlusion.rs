//! Which mirrors may stand in whose light.

use super::verdict::Screen;
use crate::bvh::{Aabb, Bvh};
use crate::element::Element;
use crate::vector::{Vector, add, cross, dot, norm, scale, sub, unit};

/// Up to so many obstacles are tried one after another for sixteen rays at once; beyond, a tree finds them for each
/// ray. A test in lanes takes about 1 ns a ray, a search of the tree some 100.
const MOST_IN_LANES: usize = 64;

/// Most elements near some bundles that are tried one by one for each; of more, the tree finds those of each.
const MOST_NEAR: usize = 512;

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
    /// So many blockers, the first, are nearer than all of the receiver, or the plane that rays end in.
    pub sure: usize,
}

impl Candidates {
    pub(super) fn is_empty(&self) -> bool {
        self.shaders.is_empty() && self.blockers.is_empty()
    }

    pub(super) fn fit_lanes(&self) -> bool {
        self.shaders.len() <= MOST_IN_LANES && self.blockers.len() <= MOST_IN_LANES
    }
}

/// Corners of an element moved into its plane, where rays start on it and where it is met: a bent quadrilateral's
/// own stand out of it.
#[derive(Debug, Clone, Copy)]
pub(super) struct Outline {
    corners: [Vector; 4],
    count: usize,
}

impl Outline {
    pub(super) fn of(element: &Element) -> Self {
        let (normal, centroid) = (element.normal(), element.centroid_m());
        let mut corners = [centroid; 4];
        for (to, &from) in corners.iter_mut().zip(element.corners_m()) {
            *to = sub(from, scale(normal, dot(sub(from, centroid), normal)));
        }
        let count = element.corners_m().len();
        Self { corners, count }
    }

    fn corners(&self) -> &[Vector] {
        &self.corners[..self.count]
    }

    /// From where to where it reaches along an axis, from a point.
    fn range(&self, from: Vector, axis: Vector) -> (f64, f64) {
        let ends = (f64::INFINITY, f64::NEG_INFINITY);
        self.corners().iter().fold(ends, |(low, high), corner| {
            let at = dot(sub(*corner, from), axis);
            (low.min(at), high.max(at))
        })
    }
}

/// A bundle of rays from an element. Their directions are `toward` plus something square to it, no longer than
/// `spread`.
#[derive(Clone, Copy)]
pub(super) struct Bundle {
    pub outline: Outline,
    pub normal: Vector,
    pub from: Vector,
    pub radius_m: f64,
    /// Unit vector.
    pub toward: Vector,
    /// Growth of its radius along the way.
    pub spread: f64,
    /// Where it ends.
    pub length_m: f64,
}

impl Bundle {
    /// False if no ray of it can meet an element: if some direction parts the two outlines all along the way.
    fn may_meet(&self, other: &Element) -> bool {
        let theirs = Outline::of(other);
        let range = |outline: &Outline, axis| outline.range(self.from, axis);
        let along = range(&theirs, self.toward);
        // How far its rays have come at most, and so strayed, where they are past the other.
        let ahead = along.1 - range(&self.outline, self.toward).0;
        if ahead <= 0.0 {
            return false;
        }
        // Rays leave the plane that they start in, unless they run almost in it.
        let rises = dot(self.toward, self.normal) > self.spread;
        if rises && range(&theirs, self.normal).1 <= 0.0 {
            return false;
        }
        let strayed = self.spread * ahead;
        [self.outline, theirs].iter().all(|outline| {
            let corners = outline.corners();
            (0..corners.len()).all(|k| {
                let edge = sub(corners[(k + 1) % corners.len()], corners[k]);
                // An edge along the bundle has no direction across both.
                unit(cross(self.toward, edge)).is_none_or(|axis| {
                    let (mine, theirs) = (range(&self.outline, axis), range(&theirs, axis));
                    mine.1 + strayed >= theirs.0 && theirs.1 + strayed >= mine.0
                })
            })
        })
    }

    /// A bundle that holds all rays of some; `None` for bundles that part too far.
    fn around(bundles: &[Self]) -> Option<Self> {
        let first = bundles.first()?;
        let sum = |of: fn(&Self) -> Vector| bundles.iter().map(of).fold([0.0; 3], add);
        let from = scale(sum(|b| b.from), 1.0 / bundles.len() as f64);
        let toward = unit(sum(|b| b.toward))?;
        let mut all = Self {
            from,
            toward,
            radius_m: 0.0,
            spread: 0.0,
            length_m: 0.0,
            ..*first
        };
        for b in bundles {
            let aside = norm(cross(b.toward, toward));
            // What a ray goes ahead along the common direction, at least, for one unit along its own.
            let ahead = dot(b.toward, toward) - b.spread * aside;
            if ahead < 0.5 {
                return None;
            }
            all.radius_m = all.radius_m.max(norm(sub(b.from, from)) + b.radius_m);
            all.spread = all.spread.max((aside + b.spread) / ahead);
            all.length_m = all.length_m.max(b.length_m);
        }
        // An end that one of them reaches on its side lies farther ahead than its own length.
        if all.length_m.is_finite() {
            all.length_m += 2.0 * all.spread * (all.length_m + all.radius_m) + 2.0 * all.radius_m;
        }
        Some(all)
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

    /// What each of some bundles from one mirror may touch. They are looked for together: neighbours have much the same
    /// in their way, and a search of the tree costs more than to try some tens of elements.
    pub(super) fn touched(&self, bundles: &[Bundle], mirror: u32) -> Vec<Vec<u32>> {
        let near = Bundle::around(bundles).and_then(|all| {
            let mut near = Vec::new();
            let full = core::cell::Cell::new(false);
            self.tree.visit(
                |bounds| !full.get() && all.may_touch(bounds.middle(), bounds.radius()),
                |k| {
                    near.push(k as u32);
                    full.set(near.len() > MOST_NEAR);
                },
            );
            if full.get() {
                return None;
            }
            near.retain(|&k| self.elements[k as usize].mirror() != mirror);
            Some(near)
        });
        let each = bundles.iter().map(|bundle| {
            let mut found = Vec::new();
            match &near {
                Some(near) => {
                    for &k in near {
                        self.try_one(k, bundle, mirror, &mut found);
                    }
                }
                None => self.touched_alone(bundle, mirror, &mut found),
            }
            found.shrink_to_fit();
            found
        });
        each.collect()
    }

    fn touched_alone(&self, bundle: &Bundle, mirror: u32, found: &mut Vec<u32>) {
        let full = core::cell::Cell::new(false);
        self.tree.visit(
            |bounds| !full.get() && bundle.may_touch(bounds.middle(), bounds.radius()),
            |k| {
                self.try_one(k as u32, bundle, mirror, found);
                full.set(found.len() > MOST_IN_LANES);
            },
        );
    }

    /// Adds an element of another mirror that a bundle may touch; of more than fit the lanes, one more than that, since
    /// the tree is asked then and a list of all of a fine mesh's would fill the memory.
    fn try_one(&self, k: u32, bundle: &Bundle, mirror: u32, found: &mut Vec<u32>) {
        let element = &self.elements[k as usize];
        if element.mirror() == mirror || found.len() > MOST_IN_LANES {
            return;
        }
        // Spheres tell most apart in a tenth of the time.
        let bounds = Aabb::around(element.corners_m());
        if bundle.may_touch(bounds.middle(), bounds.radius()) && bundle.may_meet(element) {
            found.push(k);
        }
    }

    /// The obstacles with places relative to a point, ready for lanes.
    pub(super) fn screens(&self, which: &[u32], origin: Vector) -> Vec<Screen> {
        which
            .iter()
            .map(|&k| screen(&self.elements[k as usize], origin))
            .collect()
    }

    /// Puts first those of some elements that end before `near_m` along a unit vector from a point, and counts them.
    pub(super) fn sure_first(
        &self,
        which: &mut [u32],
        from: Vector,
        toward: Vector,
        near_m: f64,
    ) -> usize {
        let is_near = |k: u32| {
            Outline::of(&self.elements[k as usize])
                .range(from, toward)
                .1
                < near_m
        };
        which.sort_by_cached_key(|&k| !is_near(k));
        which.partition_point(|&k| is_near(k))
    }

    /// True if a ray meets one of some elements before `end`, in lengths of its direction.
    pub(super) fn is_any_met(
        &self,
        which: &[u32],
        origin: Vector,
        direction: Vector,
        end: f64,
    ) -> bool {
        which
            .iter()
            .any(|&k| meets(&self.elements[k as usize], origin, direction, end))
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sampling::{hash, part};
    use crate::trace::across;

    struct Random(u64);

    impl Random {
        fn next(&mut self) -> f64 {
            self.0 += 1;
            part(hash(11, self.0))
        }
        fn within(&mut self, most: f64) -> f64 {
            most * (2.0 * self.next() - 1.0)
        }
        fn vector(&mut self, most: f64) -> Vector {
            core::array::from_fn(|_| self.within(most))
        }
        /// A quadrilateral of about 2 m, bent, or a triangle.
        fn element(&mut self, middle: Vector, bent_m: f64) -> Option<Element> {
            let [x, y] = across(unit(self.vector(1.0))?);
            let z = cross(x, y);
            let corners = [[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]].map(|[a, b]| {
                let in_plane = add(
                    scale(x, a + self.within(0.5)),
                    scale(y, b + self.within(0.5)),
                );
                add(
                    middle,
                    add(in_plane, scale(z, self.within(bent_m.max(1e-9)))),
                )
            });
            if self.next() < 0.3 {
                let [a, b, c, _] = corners;
                return Element::triangle([a, b, c]).ok();
            }
            Element::quadrilateral(corners).ok()
        }
    }

    // Elements anywhere near a bundle, flat and bent, square to it and edge on: whatever a ray of it meets is found.
    #[test]
    fn what_a_ray_meets_its_bundle_may_meet() {
        let mut random = Random(0);
        let (mut met, mut parted) = (0, 0);
        for round in 0..20_000 {
            let bent_m = [0.0, 0.4][round % 2];
            let middle = random.vector(3.0);
            let (Some(mine), Some(theirs)) = (
                random.element([0.0; 3], bent_m),
                random.element(middle, bent_m),
            ) else {
                continue;
            };
            let normal = mine.normal();
            let Some(toward) = unit(random.vector(1.0)).filter(|d| dot(*d, normal) > 0.0) else {
                continue;
            };
            let outline = Outline::of(&mine);
            let bundle = Bundle {
                outline,
                normal,
                from: mine.centroid_m(),
                radius_m: 3.0,
                toward,
                spread: [0.3, 0.01][round % 3 / 2],
                length_m: f64::INFINITY,
            };
            let may = bundle.may_meet(&theirs);
            parted += usize::from(!may);
            let sideways = across(toward);
            for _ in 0..20 {
                // a mean of the corners lies within them
                let shares: Vec<f64> = outline.corners().iter().map(|_| random.next()).collect();
                let all: f64 = shares.iter().sum();
                let origin = outline
                    .corners()
                    .iter()
                    .zip(&shares)
                    .fold([0.0; 3], |sum, (&c, share)| add(sum, scale(c, share / all)));
                let (sin, cos) = libm::sincos(random.within(4.0));
                let stray = bundle.spread * random.next().sqrt();
                let direction = add(
                    toward,
                    add(
                        scale(sideways[0], stray * cos),
                        scale(sideways[1], stray * sin),
                    ),
                );
                if meets(&theirs, origin, direction, f64::INFINITY) {
                    met += 1;
                    assert!(may, "{round}: {mine:?} {theirs:?}");
                }
            }
        }
        assert!(met > 5_000 && parted > 5_000, "{met} {parted}");
    }

    // Heliostats of several elements, in one order and alone: the same is in the way.
    #[test]
    fn bundles_together_touch_what_each_does_alone() {
        let mut random = Random(500_000);
        let mut elements = Vec::new();
        for mirror in 0..120 {
            let middle = random.vector(20.0);
            for _ in 0..5 {
                let at = add(middle, random.vector(1.5));
                let Some(element) = random.element(at, 0.1) else {
                    continue;
                };
                elements.push(element.with_mirror(mirror));
            }
        }
        let obstacles = Obstacles::new(&elements).unwrap();
        let mut found = [0; 2];
        for group in elements.chunk_by(|a, b| a.mirror() == b.mirror()) {
            let toward = unit(random.vector(1.0)).unwrap();
            for apart in [0.02, 3.0] {
                let bundle = |element: &Element| Bundle {
                    outline: Outline::of(element),
                    normal: element.normal(),
                    from: element.centroid_m(),
                    radius_m: 2.5,
                    toward: unit(add(toward, random.vector(apart))).unwrap(),
                    spread: 0.05,
                    length_m: 15.0,
                };
                let bundles: Vec<_> = group.iter().map(bundle).collect();
                let together = obstacles.touched(&bundles, group[0].mirror());
                for (bundle, mut together) in bundles.iter().zip(together) {
                    let mut alone = Vec::new();
                    obstacles.touched_alone(bundle, group[0].mirror(), &mut alone);
                    alone.sort_unstable();
                    together.sort_unstable();
                    assert_eq!(together, alone);
                    found[usize::from(apart > 1.0)] += alone.len();
                }
            }
        }
        assert!(found.iter().all(|&f| f > 200), "{found:?}");
    }
}
