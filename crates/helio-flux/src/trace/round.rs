//! Rays of one element to bins of a cylinder or cone, as many at a time as a vector holds.
//!
//! Rays are taken up where they cross the plane through the receiver's middle, square to the element's middle ray: there
//! all numbers are small, as singles want them.

use helio_core::SimdLevel;
use helio_core::lanes::{Kernel, Lanes, Mask, Singles, run};

use super::beam::{Cone, Piece};
use super::kernel::{Pass, start};
use super::rayset::Lap;
use crate::receiver::Frustum;
use crate::vector::{Vector, dot, scale, sub};

/// Rays of one block.
const BLOCK: usize = 256;

/// An element seen from a round receiver, in the receiver's axes, from the middle of its axis.
#[derive(Debug, Clone, Copy)]
pub(super) struct RoundBeam {
    /// Where middle rays from the corner cross the plane, and how far they come; and the same along the edges.
    corner: [f32; 4],
    edge_a: [f32; 4],
    edge_b: [f32; 4],
    shift: [f32; 2],
    middle: [f32; 3],
    along: [[f32; 3]; 2],
    slope: [[f32; 3]; 2],
    /// Radius in the middle, and its growth along the axis.
    radius: f32,
    growth: f32,
    rows_per_m: f32,
    rows: f32,
    columns: f32,
}

/// What the kernel wants; `None` if rays may start within reach of the receiver.
pub(super) fn onto_round(
    frustum: &Frustum,
    piece: &Piece,
    cone: &Cone,
    lap: &Lap,
    radius_m: f64,
) -> Option<RoundBeam> {
    let centre = frustum.centre_m();
    // of a point or an edge: across the middle ray, and the way to the plane
    let project = |v: Vector| {
        let way = -dot(v, cone.middle);
        let flat = frustum.to_local(sub(v, scale(cone.middle, -way)));
        [flat[0], flat[1], flat[2], way].map(|x| x as f32)
    };
    let corner = project(sub(piece.corner, centre));
    let (edge_a, edge_b) = (project(piece.edge_a), project(piece.edge_b));
    let least = corner[3] + edge_a[3].min(0.0) + edge_b[3].min(0.0);
    if f64::from(least) < 1.5 * radius_m {
        return None;
    }
    let local = |v: Vector| frustum.to_local(v).map(|x| x as f32);
    let (radius, growth, height_m) = frustum.shape();
    Some(RoundBeam {
        corner,
        edge_a,
        edge_b,
        shift: lap.shift.map(|x| x as f32),
        middle: local(cone.middle),
        along: cone.along.map(local),
        slope: cone.slope.map(local),
        radius: radius as f32,
        growth: growth as f32,
        rows_per_m: (frustum.rows() as f64 / height_m) as f32,
        rows: frustum.rows() as f32,
        columns: frustum.columns() as f32,
    })
}

/// Adds `weight` to the cell of each free ray: 0 for a miss, else its bin and 1.
pub(super) struct RoundKernel<'a, const TRIANGLE: bool, const SLOPES: bool> {
    pub beam: &'a RoundBeam,
    pub pass: Pass<'a>,
    pub weight: u64,
    pub verdicts: &'a [u32],
    pub cells: &'a mut [u64],
}

pub(super) fn round<const TRIANGLE: bool, const SLOPES: bool>(
    level: SimdLevel,
    kernel: RoundKernel<'_, TRIANGLE, SLOPES>,
) {
    run(level, kernel);
}

impl<const TRIANGLE: bool, const SLOPES: bool> Kernel for RoundKernel<'_, TRIANGLE, SLOPES> {
    type Output = ();

    #[inline(always)]
    fn run<L: Lanes>(self) {
        let mut index = [0_u32; BLOCK];
        let count = self.pass.a.len();
        let mut from = 0;
        while from < count {
            let to = count.min(from + BLOCK);
            let index = &mut index[..to - from];
            hit::<L, TRIANGLE, SLOPES>(self.beam, self.pass.part(from, to), index);
            if self.verdicts.is_empty() {
                for &cell in &*index {
                    self.cells[cell as usize] += self.weight;
                }
            } else {
                for (&cell, &verdict) in index.iter().zip(&self.verdicts[from..to]) {
                    if verdict == super::verdict::FREE {
                        self.cells[cell as usize] += self.weight;
                    }
                }
            }
            from = to;
        }
    }
}

#[inline(always)]
fn hit<L: Lanes, const TRIANGLE: bool, const SLOPES: bool>(
    beam: &RoundBeam,
    pass: Pass<'_>,
    index: &mut [u32],
) {
    let width = <L::Singles as Singles>::WIDTH;
    let c = L::Singles::splat;
    let select = L::Singles::select;
    let corner = beam.corner.map(c);
    let (edge_a, edge_b) = (beam.edge_a.map(c), beam.edge_b.map(c));
    let middle = beam.middle.map(c);
    let along = beam.along.map(|v| v.map(c));
    let slope = beam.slope.map(|v| v.map(c));
    let [radius, growth] = [beam.radius, beam.growth].map(c);
    let [zero, half, one] = [0.0, 0.5, 1.0].map(c);
    let [rows, columns] = [beam.rows, beam.columns].map(c);
    for at in (0..index.len()).step_by(width) {
        let read = |column: &[f32]| L::Singles::read(&column[at..]);
        let (a, b) = start::<L, TRIANGLE>(read(pass.a), read(pass.b), beam.shift);
        let place = |k: usize| a.mul_add(edge_a[k], b.mul_add(edge_b[k], corner[k]));
        let (dx, dy) = (read(pass.dx), read(pass.dy));
        let mut stray = [0, 1, 2].map(|k| dx.mul_add(along[0][k], dy.mul(along[1][k])));
        if SLOPES {
            let (gx, gy) = (read(pass.gx), read(pass.gy));
            for k in 0..3 {
                stray[k] = gx.mul_add(slope[0][k], gy.mul_add(slope[1][k], stray[k]));
            }
        }
        let way = place(3);
        let p = [0, 1, 2].map(|k| way.mul_add(stray[k], place(k)));
        let d = [0, 1, 2].map(|k| middle[k].add(stray[k]));
        // |across|² = radius²: a t² + 2 b t + c = 0; light comes in by the root with a t + b < 0
        let wide = growth.mul_add(p[2], radius);
        let k_dz = growth.mul(d[2]);
        let qa = k_dz.neg_mul_add(k_dz, d[0].mul_add(d[0], d[1].mul(d[1])));
        let qb = wide.neg_mul_add(k_dz, p[0].mul_add(d[0], p[1].mul(d[1])));
        let qc = wide.neg_mul_add(wide, p[0].mul_add(p[0], p[1].mul(p[1])));
        let discriminant = qa.neg_mul_add(qc, qb.mul(qb));
        let root = discriminant.max(zero).sqrt();
        // -b - root over a, or c over -b + root: whichever does not cancel
        let ahead = qb.lt(zero);
        let over = select(ahead, qc, zero.sub(qb).sub(root));
        let t = over.div(select(ahead, root.sub(qb), qa));
        let [x, y, z] = [0, 1, 2].map(|k| t.mul_add(d[k], p[k]));
        let row = c(beam.rows_per_m).neg_mul_add(z, half.mul(rows)).floor();
        // no number fails
        let valid = zero
            .le(discriminant)
            .and(zero.le(row))
            .and(row.lt(rows))
            .and(zero.le(growth.mul_add(z, radius)));
        let column = columns.mul(turn::<L>(x, y)).floor();
        let column = column.max(zero).min(columns.sub(one));
        let bin = row.mul_add(columns, column.add(one));
        select(valid, bin, zero).write_whole(&mut index[at..]);
    }
}

/// The angle of (x, y) as a part of a full turn, from 0 to 1.
///
/// Abramowitz and Stegun 1964, 4.4.49: the arctangent of 0 to 1 to 2e-8.
#[inline(always)]
fn turn<L: Lanes>(x: L::Singles, y: L::Singles) -> L::Singles {
    const ARCTANGENT: [f32; 9] = [
        1.0,
        -0.333_331_45,
        0.199_935_51,
        -0.142_089,
        0.106_562_64,
        -0.075_289_64,
        0.042_909_614,
        -0.016_165_737,
        0.002_866_225_7,
    ];
    let c = L::Singles::splat;
    let select = L::Singles::select;
    let zero = c(0.0);
    let (across, up) = (x.max(zero.sub(x)), y.max(zero.sub(y)));
    let steep = across.lt(up);
    let ratio = select(steep, across, up).div(select(steep, up, across));
    let square = ratio.mul(ratio);
    let mut sum = c(ARCTANGENT[8]);
    for k in (0..8).rev() {
        sum = sum.mul_add(square, c(ARCTANGENT[k]));
    }
    let angle = sum.mul(ratio).mul(c(core::f32::consts::FRAC_1_PI * 0.5));
    let angle = select(steep, c(0.25).sub(angle), angle);
    let angle = select(x.lt(zero), c(0.5).sub(angle), angle);
    select(y.lt(zero), c(1.0).sub(angle), angle)
}

#[cfg(test)]
mod tests {
    use super::*;

    struct Turns<'a>(&'a [f32], &'a [f32]);

    impl Kernel for Turns<'_> {
        type Output = Vec<f32>;
        #[inline(always)]
        fn run<L: Lanes>(self) -> Vec<f32> {
            let mut out = vec![0.0; self.0.len()];
            for at in (0..out.len()).step_by(<L::Singles as Singles>::WIDTH) {
                let read = |column: &[f32]| L::Singles::read(&column[at..]);
                turn::<L>(read(self.0), read(self.1)).write(&mut out[at..]);
            }
            out
        }
    }

    #[test]
    fn turns_are_those_of_the_library() {
        let n = 4096;
        let angle = |k: usize| core::f64::consts::TAU * (k as f64 + 0.5) / n as f64;
        let x: Vec<f32> = (0..n).map(|k| (7.0 * libm::cos(angle(k))) as f32).collect();
        let y: Vec<f32> = (0..n).map(|k| (7.0 * libm::sin(angle(k))) as f32).collect();
        for (k, got) in run(SimdLevel::best(), Turns(&x, &y))
            .into_iter()
            .enumerate()
        {
            let want = (k as f64 + 0.5) / n as f64;
            assert!((f64::from(got) - want).abs() < 2e-7, "{k}: {got} {want}");
        }
    }
}
