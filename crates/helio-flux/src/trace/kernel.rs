//! Rays of one element to bins of a plane, sixteen at a time.
//!
//! Plain loops over arrays of singles, which the compiler turns into vectors of whatever width the
//! instruction set has. Every operation has one correct result (no fused multiply-add, no estimates), so
//! that each instruction set gives the same bits.

use helio_core::SimdLevel;
use helio_core::lanes::{Kernel, Lanes, Singles, run};

/// Rays of one block.
pub(crate) const BLOCK: usize = 256;

/// One pass of rays: equal lengths, a multiple of [`BLOCK`].
#[derive(Debug, Clone, Copy)]
pub(crate) struct Pass<'a> {
    pub a: &'a [f32],
    pub b: &'a [f32],
    pub dx: &'a [f32],
    pub dy: &'a [f32],
    pub gx: &'a [f32],
    pub gy: &'a [f32],
}

/// An element seen from a plane receiver: places (first index: u, v, w) of rays that start at
/// `corner + a · edge_a + b · edge_b` and run along `middle + dx · along_x + …`.
///
/// u and v count bins of the receiver's grid with a frame one bin wide all round it, and are sheared along
/// the middle ray, which so has no u and v: all numbers are small, as singles want them. w is the
/// distance from the plane \[m\].
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct Beam {
    pub corner: [f32; 3],
    pub edge_a: [f32; 3],
    pub edge_b: [f32; 3],
    pub shift: [f32; 2],
    pub middle_w: f32,
    pub along: [[f32; 3]; 2],
    pub slope: [[f32; 3]; 2],
}

/// The grid of a plane with its frame.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Grid {
    pub columns: u32,
    pub rows: u32,
}

impl Grid {
    pub(crate) const fn stride(self) -> u32 {
        self.columns + 2
    }
    pub(crate) const fn cells(self) -> usize {
        (self.columns as usize + 2) * (self.rows as usize + 2)
    }
}

/// Adds `weight` to the cell that each ray of a pass hits.
pub(crate) struct PlaneKernel<'a, const TRIANGLE: bool, const SLOPES: bool> {
    pub beam: &'a Beam,
    pub pass: Pass<'a>,
    pub grid: Grid,
    pub weight: u64,
    /// Of each ray, [`FREE`] or not; empty for all free.
    pub verdicts: &'a [u32],
    pub cells: &'a mut [u64],
}

pub(crate) fn plane<const TRIANGLE: bool, const SLOPES: bool>(
    level: SimdLevel,
    kernel: PlaneKernel<'_, TRIANGLE, SLOPES>,
) {
    run(level, kernel);
}

impl<'a, const TRIANGLE: bool, const SLOPES: bool> Kernel for PlaneKernel<'a, TRIANGLE, SLOPES> {
    type Output = ();

    #[inline(always)]
    fn run<L: Lanes>(self) {
        let mut index = [0_u32; BLOCK];
        let count = self.pass.a.len();
        let mut from = 0;
        while from < count {
            let to = count.min(from + BLOCK);
            let index = &mut index[..to - from];
            let part = self.pass.part(from, to);
            hit::<L, TRIANGLE, SLOPES>(self.beam, self.grid, part, index);
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

impl Pass<'_> {
    #[inline(always)]
    pub(super) fn part(&self, from: usize, to: usize) -> Self {
        Self {
            a: &self.a[from..to],
            b: &self.b[from..to],
            dx: &self.dx[from..to],
            dy: &self.dy[from..to],
            gx: &self.gx[from..to],
            gy: &self.gy[from..to],
        }
    }
}

#[inline(always)]
fn hit<L: Lanes, const TRIANGLE: bool, const SLOPES: bool>(
    beam: &Beam,
    grid: Grid,
    pass: Pass<'_>,
    index: &mut [u32],
) {
    let n = index.len();
    let width = <L::Singles as Singles>::WIDTH;
    let c = L::Singles::splat;
    let corner = beam.corner.map(c);
    let edge_a = beam.edge_a.map(c);
    let edge_b = beam.edge_b.map(c);
    let [along_x, along_y] = beam.along.map(|v| v.map(c));
    let [slope_x, slope_y] = beam.slope.map(|v| v.map(c));
    let [zero, middle_w] = [0.0, beam.middle_w].map(c);
    let last_column = c(grid.columns as f32 + 1.5);
    let last_row = c(grid.rows as f32 + 1.5);
    let stride = c(grid.stride() as f32);
    for at in (0..n).step_by(width) {
        let read = |column: &[f32]| L::Singles::read(&column[at..]);
        let (a, b) = start::<L, TRIANGLE>(read(pass.a), read(pass.b), beam.shift);
        let place = |k: usize| a.mul_add(edge_a[k], b.mul_add(edge_b[k], corner[k]));
        let (dx, dy) = (read(pass.dx), read(pass.dy));
        let mut stray = [zero, zero, middle_w];
        for k in 0..3 {
            stray[k] = dx.mul_add(
                along_x[k],
                if k == 2 {
                    dy.mul_add(along_y[k], middle_w)
                } else {
                    dy.mul(along_y[k])
                },
            );
        }
        if SLOPES {
            let (gx, gy) = (read(pass.gx), read(pass.gy));
            for k in 0..3 {
                stray[k] = gx.mul_add(slope_x[k], gy.mul_add(slope_y[k], stray[k]));
            }
        }
        let way = place(2).div(stray[2]);
        let u = way.neg_mul_add(stray[0], place(0));
        let v = way.neg_mul_add(stray[1], place(1));
        let u = u.max(zero).min(last_column).floor();
        let v = v.max(zero).min(last_row).floor();
        v.mul_add(stride, u).write_whole(&mut index[at..]);
    }
}

/// Where on the element rays start: the set's places shifted around, and for a triangle folded into it.
#[inline(always)]
pub(super) fn start<L: Lanes, const TRIANGLE: bool>(
    a: L::Singles,
    b: L::Singles,
    shift: [f32; 2],
) -> (L::Singles, L::Singles) {
    let c = L::Singles::splat;
    let [zero, one] = [0.0, 1.0].map(c);
    // a number of [0, 2) without its whole part
    let wrap = |x: L::Singles| x.sub(L::Singles::select(one.le(x), one, zero));
    let (a, b) = (wrap(a.add(c(shift[0]))), wrap(b.add(c(shift[1]))));
    if !TRIANGLE {
        return (a, b);
    }
    let over = one.lt(a.add(b));
    let fold = |x: L::Singles| L::Singles::select(over, one.sub(x), x);
    (fold(a), fold(b))
}
