//! Rays of one element against the few mirrors that may stand in their way, as many at a time as a vector holds.

use helio_core::SimdLevel;
use helio_core::lanes::{Kernel, Lanes, Mask, Singles, run};

use super::kernel::{Pass, start};

/// A ray that neither comes from nor runs into another mirror.
pub(crate) const FREE: u32 = 0;
/// A ray that the sun cannot send.
pub(crate) const SHADED: u32 = 1;
/// A ray that another mirror keeps from the receiver.
pub(crate) const BLOCKED: u32 = 2;
/// A ray that another mirror keeps from the receiver unless it arrives first.
pub(crate) const DOUBTFUL: u32 = 3;

/// An obstacle: a convex polygon, with places relative to the element's centroid.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Screen {
    pub normal: [f32; 3],
    pub offset: f32,
    /// Square to each edge, inward, and what a point inside has at least along it.
    pub inward: [[f32; 3]; 4],
    pub bounds: [f32; 4],
}

/// Rays of an element in the scene's axes, with places relative to its centroid.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Sight {
    pub corner: [f32; 3],
    pub edge_a: [f32; 3],
    pub edge_b: [f32; 3],
    pub shift: [f32; 2],
    pub is_triangle: bool,
    pub sun: [f32; 3],
    pub sun_along: [[f32; 3]; 2],
    pub middle: [f32; 3],
    pub along: [[f32; 3]; 2],
    pub slope: [[f32; 3]; 2],
    /// Where rays end: the plane of these, or so far along the middle ray.
    pub gate: [f32; 3],
    pub gate_offset: f32,
    pub far: f32,
}

/// Says of each ray whether another mirror stands in its way.
pub(crate) struct VerdictKernel<'a> {
    pub sight: &'a Sight,
    pub pass: Pass<'a>,
    pub shaders: &'a [Screen],
    pub blockers: &'a [Screen],
    /// Blockers that may be behind where a ray lands.
    pub doubtful: &'a [Screen],
    pub verdicts: &'a mut [u32],
}

pub(crate) fn verdicts(level: SimdLevel, kernel: VerdictKernel<'_>) {
    run(level, kernel);
}

type Three<S> = [S; 3];

#[inline(always)]
fn dot<S: Singles>(a: Three<S>, b: Three<S>) -> S {
    a[0].mul_add(b[0], a[1].mul_add(b[1], a[2].mul(b[2])))
}

/// What rays look for obstacles with.
#[derive(Clone, Copy)]
struct Ray<S> {
    origin: Three<S>,
    direction: Three<S>,
    /// Where it ends, in lengths of its direction.
    end: S,
}

impl<S: Singles> Ray<S> {
    #[inline(always)]
    fn meets(&self, screen: &Screen) -> S::Mask {
        let normal = screen.normal.map(S::splat);
        let to = S::splat(screen.offset).sub(dot(normal, self.origin));
        let along = to.div(dot(normal, self.direction));
        let point = [0, 1, 2].map(|k| along.mul_add(self.direction[k], self.origin[k]));
        // no number (a ray in the plane) fails
        let mut met = S::splat(0.0).lt(along).and(along.lt(self.end));
        for k in 0..4 {
            let inside = dot(screen.inward[k].map(S::splat), point);
            met = met.and(S::splat(screen.bounds[k]).le(inside));
        }
        met
    }
}

impl Kernel for VerdictKernel<'_> {
    type Output = ();

    #[inline(always)]
    fn run<L: Lanes>(self) {
        let width = <L::Singles as Singles>::WIDTH;
        let c = L::Singles::splat;
        let zero = c(0.0);
        let Sight {
            sun_along,
            along,
            slope,
            ..
        } = *self.sight;
        let [corner, edge_a, edge_b] =
            [self.sight.corner, self.sight.edge_a, self.sight.edge_b].map(|v| v.map(c));
        let [sun, middle, gate] =
            [self.sight.sun, self.sight.middle, self.sight.gate].map(|v| v.map(c));
        for at in (0..self.pass.a.len()).step_by(width) {
            let read = |column: &[f32]| L::Singles::read(&column[at..]);
            let (a, b) = (read(self.pass.a), read(self.pass.b));
            let (a, b) = if self.sight.is_triangle {
                start::<L, true>(a, b, self.sight.shift)
            } else {
                start::<L, false>(a, b, self.sight.shift)
            };
            let origin = [0, 1, 2].map(|k| a.mul_add(edge_a[k], b.mul_add(edge_b[k], corner[k])));
            let (dx, dy) = (read(self.pass.dx), read(self.pass.dy));
            let (gx, gy) = (read(self.pass.gx), read(self.pass.gy));
            let shifted =
                |by: [[f32; 3]; 2], x: L::Singles, y: L::Singles, to: Three<L::Singles>| {
                    [0, 1, 2].map(|k| x.mul_add(c(by[0][k]), y.mul_add(c(by[1][k]), to[k])))
                };
            let to_sun = Ray {
                origin,
                direction: shifted(sun_along, dx, dy, sun),
                end: c(f32::INFINITY),
            };
            let mut verdict = zero;
            let out = shifted(slope, gx, gy, shifted(along, dx, dy, middle));
            let end = c(self.sight.gate_offset)
                .sub(dot(gate, origin))
                .div(dot(gate, out))
                .min(c(self.sight.far).sub(dot(middle, origin)));
            let reflected = Ray {
                origin,
                direction: out,
                end,
            };
            for screen in self.doubtful {
                verdict = L::Singles::select(reflected.meets(screen), c(DOUBTFUL as f32), verdict);
            }
            for screen in self.blockers {
                verdict = L::Singles::select(reflected.meets(screen), c(BLOCKED as f32), verdict);
            }
            for screen in self.shaders {
                verdict = L::Singles::select(to_sun.meets(screen), c(SHADED as f32), verdict);
            }
            verdict.write_whole(&mut self.verdicts[at..]);
        }
    }
}
