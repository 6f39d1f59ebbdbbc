//! A mirror as the points of the receiver see it, and the receiver as its points do.

use super::radial::Radial;
use super::surface::{Ball, Point};
use crate::trace::{MirrorPiece, across};
use crate::vector::{Vector, add, cross, dot, norm, scale, sub, unit};

/// A parallelogram or a triangle of an element, in axes of its own: in the plane of incidence and across it, both square to
/// its middle ray, and along that. The first is squeezed as its cone is.
pub(super) struct Outline<'a> {
    pub cone: &'a Radial,
    /// Reflected power \[W\].
    pub power_w: f64,
    /// Longest edge \[m\].
    pub length_m: f64,
    pub figure: Figure,
    axes: [Vector; 3],
    strength: f64,
    normal: Vector,
    centroid: Vector,
    /// The same in the axes.
    local_normal: Vector,
    middle: Vector,
    corners: [Vector; 4],
    count: usize,
    radius_m: f64,
    /// Variance of the light per axis, after the squeeze.
    variance: f64,
}

/// A corner and two edges of a parallelogram or triangle.
#[derive(Clone, Copy)]
pub(super) struct Figure {
    pub corner: Vector,
    pub edges: [Vector; 2],
    pub is_triangle: bool,
}

impl Figure {
    /// Where parts of the edges lead to.
    pub(super) fn at(&self, a: f64, b: f64) -> Vector {
        add(
            self.corner,
            add(scale(self.edges[0], a), scale(self.edges[1], b)),
        )
    }

    pub(super) fn corners(&self) -> ([Vector; 4], usize) {
        let [p, q, r] = [self.at(0.0, 0.0), self.at(1.0, 0.0), self.at(0.0, 1.0)];
        if self.is_triangle {
            ([p, q, r, r], 3)
        } else {
            ([p, q, self.at(1.0, 1.0), r], 4)
        }
    }

    /// Its middle.
    pub(super) fn middle(&self) -> Vector {
        let part = if self.is_triangle { 1.0 / 3.0 } else { 0.5 };
        self.at(part, part)
    }

    /// Longest edge \[m\].
    pub(super) fn length_m(&self) -> f64 {
        let [one, other] = self.edges;
        let third = if self.is_triangle {
            norm(sub(one, other))
        } else {
            0.0
        };
        norm(one).max(norm(other)).max(third)
    }

    /// Parts of the same area each: quarters, or the halves of a long parallelogram; and how many.
    pub(super) fn parts(&self) -> ([Self; 4], usize) {
        let [one, other] = self.edges.map(norm);
        let is_long = !self.is_triangle && one.max(other) > 1.5 * one.min(other);
        if !is_long {
            return (self.quarters(), 4);
        }
        let longer = usize::from(other > one);
        let mut half = *self;
        half.edges[longer] = scale(half.edges[longer], 0.5);
        let mut next = half;
        next.corner = add(half.corner, half.edges[longer]);
        ([half, next, next, next], 2)
    }

    /// Of the same area each.
    fn quarters(&self) -> [Self; 4] {
        let edges = self.edges.map(|edge| scale(edge, 0.5));
        let part = |a: f64, b: f64| Self {
            corner: self.at(a, b),
            edges,
            ..*self
        };
        let last = if self.is_triangle {
            Self {
                corner: self.at(0.5, 0.5),
                edges: edges.map(|edge| scale(edge, -1.0)),
                ..*self
            }
        } else {
            part(0.5, 0.5)
        };
        [part(0.0, 0.0), part(0.5, 0.0), part(0.0, 0.5), last]
    }

    /// Points that stand for the same part of its area each: a polynomial of degree three over the parallelogram (Gauss),
    /// of degree two over the triangle (Hammer and Stroud 1956), has their mean.
    pub(super) fn nodes(&self) -> ([Vector; 4], usize) {
        if self.is_triangle {
            let (near, far) = (1.0 / 6.0, 2.0 / 3.0);
            let [p, q, r] = [(near, near), (far, near), (near, far)].map(|(a, b)| self.at(a, b));
            return ([p, q, r, r], 3);
        }
        let (low, high) = (0.211_324_865_405_187_1, 0.788_675_134_594_812_9);
        let all = [(low, low), (high, low), (low, high), (high, high)];
        (all.map(|(a, b)| self.at(a, b)), 4)
    }
}

impl<'a> Outline<'a> {
    /// `strength` is direct irradiance times reflectivity.
    pub(super) fn new(
        piece: &MirrorPiece,
        area_m2: f64,
        sun: Vector,
        strength: f64,
        cone: &'a Radial,
    ) -> Self {
        let normal = piece.normal;
        let cosine = dot(normal, sun);
        let along = sub(scale(normal, 2.0 * cosine), sun);
        let lean = sub(normal, scale(along, cosine));
        let x = unit(lean)
            .filter(|_| norm(lean) > 1e-9)
            .unwrap_or_else(|| across(along)[0]);
        let axes = [scale(x, cone.squeeze), cross(along, x), along];
        let local = |p: Vector| axes.map(|axis| dot(axis, p));
        let of_world = Figure {
            corner: piece.corner,
            edges: [piece.edge_a, piece.edge_b],
            is_triangle: piece.is_triangle,
        };
        let figure = Figure {
            corner: local(of_world.corner),
            edges: of_world.edges.map(local),
            is_triangle: piece.is_triangle,
        };
        let centroid = of_world.middle();
        let (corners, count) = of_world.corners();
        let from_middle = |p: &Vector| norm(sub(*p, centroid));
        let radius_m = corners.iter().map(from_middle).fold(0.0, f64::max);
        let edges = (0..count).map(|k| norm(sub(corners[(k + 1) % count], corners[k])));
        Self {
            power_w: strength * cosine * area_m2,
            length_m: edges.fold(0.0, f64::max),
            figure,
            axes,
            strength,
            normal,
            centroid,
            local_normal: axes.map(|axis| dot(axis, normal)),
            middle: local(centroid),
            corners: figure.corners().0,
            count,
            radius_m,
            variance: cone.half * cone.half / (2.0 * core::f64::consts::LN_2),
            cone,
        }
    }

    pub(super) fn local(&self, p: Vector) -> Vector {
        self.axes.map(|axis| dot(axis, p))
    }

    /// A point in the axes, as it is in the world.
    pub(super) fn world(&self, [x, y, z]: Vector) -> Vector {
        let squeeze = self.cone.squeeze;
        let flat = add(
            scale(self.axes[0], x / (squeeze * squeeze)),
            scale(self.axes[1], y),
        );
        add(flat, scale(self.axes[2], z))
    }

    /// Irradiance at a point of the receiver \[W/m²\], times its share.
    pub(super) fn flux_at(&self, point: &Point) -> f64 {
        let facing = -dot(point.normal, self.axes[2]);
        if facing <= 0.0 || dot(sub(point.at, self.centroid), self.normal) <= 0.0 {
            return 0.0;
        }
        let [x, y, z] = self.local(point.at);
        // far from the middle ray nothing of the sun shows
        let (dx, dy, far) = (x - self.middle[0], y - self.middle[1], z - self.middle[2]);
        let reach = self.radius_m + self.cone.end * (far + self.radius_m);
        if far <= 0.0 || dx * dx + dy * dy > reach * reach {
            return 0.0;
        }
        let [shift_x, shift_y] = self.shift(point.normal, facing);
        let mut seen = [[0.0; 2]; 4];
        for (to, corner) in seen.iter_mut().zip(&self.corners[..self.count]) {
            let distance = z - corner[2];
            if distance <= 0.0 {
                return 0.0;
            }
            let inverse = 1.0 / distance;
            *to = [
                (x - corner[0]) * inverse - shift_x,
                (y - corner[1]) * inverse - shift_y,
            ];
        }
        self.strength * point.share * facing * self.cone.within(&seen[..self.count])
    }

    /// What a point that the light grazes may get more or less than [`flux_at`](Self::flux_at) says, which takes its
    /// direction for that of the middle ray there \[W/m²\], times its share; 0 for one that faces it.
    pub(super) fn grazing_at(&self, point: &Point) -> f64 {
        let facing = -dot(point.normal, self.axes[2]);
        let wide = 2.0 * self.cone.half;
        if facing.abs() > wide {
            return 0.0;
        }
        // as if it faced the light
        let turned = Point {
            normal: scale(self.axes[2], -1.0),
            ..*point
        };
        self.cone.half * self.flux_at(&turned)
    }

    /// By how much the cone seems moved.
    ///
    /// Light that comes a little more squarely to the receiver than the middle ray does is denser there, and light that
    /// leaves the mirror so is less dense: 1 + g·d to first order in its offset d, which for a Gaussian of variance v is
    /// the same as its being moved by v g.
    fn shift(&self, receiver_normal: Vector, facing: f64) -> [f64; 2] {
        let squared = self.cone.squeeze * self.cone.squeeze;
        let most = 0.2 * self.cone.half;
        core::array::from_fn(|k| {
            let of_receiver = -dot(receiver_normal, self.axes[k]) / facing;
            let of_mirror = self.local_normal[k] / self.local_normal[2];
            let by = if k == 0 { squared } else { 1.0 };
            (self.variance * (of_receiver - of_mirror) / by).clamp(-most, most)
        })
    }

    /// Whether light of a ball of the mirror can reach a ball of the receiver, both in the axes.
    pub(super) fn reaches(&self, from: &Ball, to: &Ball) -> bool {
        let [dx, dy, far] = sub(to.centre, from.centre);
        let both = from.radius_m + to.radius_m;
        let reach = both + self.cone.end * (far + both);
        far + both > 0.0 && dx * dx + dy * dy <= reach * reach
    }

    /// Where its middle ray begins, and the way it goes.
    pub(super) const fn middle_ray(&self) -> (Vector, Vector) {
        (self.centroid, self.axes[2])
    }

    /// A ball around it, in the axes.
    pub(super) fn ball(&self) -> Ball {
        Ball {
            centre: self.middle,
            radius_m: self.radius_m,
        }
    }

    /// Width of what half of the light of a point lies in, at a distance \[m\].
    pub(super) fn blur_m(&self, far_m: f64) -> f64 {
        2.0 * self.cone.half * far_m.max(0.0)
    }

    /// The part of the light of a point of the mirror that falls on the lit side of a flat convex piece of the receiver,
    /// both in the axes.
    pub(super) fn part_on(&self, from: Vector, corners: &[Vector]) -> f64 {
        let mut seen = [[0.0; 2]; 8];
        let mut count = 0;
        let mut put = |p: Vector| {
            let inverse = 1.0 / p[2];
            seen[count] = [p[0] * inverse, p[1] * inverse];
            count += 1;
        };
        // only what lies ahead
        let least = 1e-9 * (1.0 + self.radius_m);
        for (k, corner) in corners.iter().enumerate() {
            let p = sub(*corner, from);
            let q = sub(corners[(k + 1) % corners.len()], from);
            if p[2] > least {
                put(p);
            }
            if (p[2] > least) != (q[2] > least) {
                let part = (least - p[2]) / (q[2] - p[2]);
                put(add(p, scale(sub(q, p), part)));
            }
        }
        if count < 3 {
            return 0.0;
        }
        let seen = &seen[..count];
        // corners run counterclockwise as those see them whom the lit side faces, who look against the third axis
        let turn = |k: usize| {
            let (p, q) = (seen[k], seen[(k + 1) % seen.len()]);
            p[0] * q[1] - p[1] * q[0]
        };
        if (0..seen.len()).map(turn).sum::<f64>() >= 0.0 {
            return 0.0;
        }
        self.cone.within(seen)
    }
}
