//! The mirror-centre normal, in lanes.

use core::f64::consts::FRAC_1_SQRT_2;

use crate::lanes::{Lanes, Mask};

/// Largest |Hz/L| that the series of [`Exact`] is good for to the last digit.
pub(crate) const MAX_SERIES_RATIO: f64 = 1.0 / 12.0;

/// Least cosine of the incidence at the mirror: beyond, the sun is edge-on or behind.
pub(crate) const MIN_COS_INCIDENCE: f64 = 1e-6;

/// Sun and aim of some heliostats.
#[derive(Clone, Copy)]
pub(crate) struct Rays<L> {
    /// Half the unit vector pivot → aim, along the mount's axes.
    pub half_t: [L; 3],
    /// Half the unit vector to the sun, along the mount's axes.
    pub half_s: [L; 3],
    /// Hz/L; enormous where the aim is at the pivot.
    pub ratio: L,
}

/// The first step: what depends on sun and aim alone, and the first guess of the lean.
#[derive(Clone, Copy)]
pub(crate) struct Bisector<L> {
    /// cos(theta), theta half the sun-aim angle.
    pub cos_theta: L,
    /// sin²(theta).
    pub sin_sq_theta: L,
    /// 1/cos(theta).
    pub inverse_cos: L,
    /// k0 of Guo 2015 eq. (8), where the form uses it.
    pub first_k: L,
}

/// The normal.
#[derive(Clone, Copy)]
pub(crate) struct Normal<L> {
    /// Components along the mount's axes.
    pub n: [L; 3],
    /// s·n, where it was asked for.
    pub cos_incidence: L,
}

/// One way of taking the mirror-pivot offset into account, in three steps that a kernel may do in
/// different loops.
pub(crate) trait OffsetSource: Copy {
    fn bisector<L: Lanes>(self, rays: &Rays<L>) -> Bisector<L>;
    /// k, the second coefficient of Guo 2015 eq. (16), for ratios up to [`MAX_SERIES_RATIO`]; with
    /// `FULL` for any, at any cost.
    fn lean<L: Lanes, const FULL: bool>(self, ratio: L, bisector: &Bisector<L>) -> L;
    /// The normal; with `FULL` also s·n.
    fn normal<L: Lanes, const FULL: bool>(
        self,
        rays: &Rays<L>,
        bisector: &Bisector<L>,
        k: L,
    ) -> Normal<L>;
}

/// Negative where the sun may be edge-on or behind: the exact judgement is made elsewhere.
///
/// s·n = C cos(theta) - k sin²(theta), with C > 0.99 and |k| < 0.046 for |h| <= 1/12: beyond 87.3° alone is
/// there a doubt.
#[inline(always)]
pub(crate) fn doubt<L: Lanes>(cos_theta: L) -> L {
    cos_theta.sub(L::splat(0.047))
}

/// Half sum and half difference of the unit vectors: their lengths *are* cos(theta) and
/// sin(theta), with all digits where an arccosine of s·t would lose half of them.
#[derive(Clone, Copy)]
struct HalfAngle<L> {
    mean: [L; 3],
    difference: [L; 3],
}

#[inline(always)]
fn dot<L: Lanes>(a: [L; 3], b: [L; 3]) -> L {
    a[2].mul_add(b[2], a[1].mul_add(b[1], a[0].mul(b[0])))
}

#[inline(always)]
fn half_angle<L: Lanes>(rays: &Rays<L>) -> HalfAngle<L> {
    let [t, s] = [rays.half_t, rays.half_s];
    HalfAngle {
        mean: [s[0].add(t[0]), s[1].add(t[1]), s[2].add(t[2])],
        difference: [t[0].sub(s[0]), t[1].sub(s[1]), t[2].sub(s[2])],
    }
}

impl<L: Lanes> HalfAngle<L> {
    /// cos(theta) and sin²(theta).
    #[inline(always)]
    fn cos_and_sin_sq(&self) -> (L, L) {
        (
            dot(self.mean, self.mean).sqrt(),
            dot(self.difference, self.difference),
        )
    }

    /// n = C/cos(theta) (s+t)/2 + k (t-s)/2, Guo 2015 eq. (16).
    #[inline(always)]
    fn robust_normal(&self, c_over_cos: L, k: L) -> [L; 3] {
        let [m, d] = [self.mean, self.difference];
        [
            k.mul_add(d[0], c_over_cos.mul(m[0])),
            k.mul_add(d[1], c_over_cos.mul(m[1])),
            k.mul_add(d[2], c_over_cos.mul(m[2])),
        ]
    }
}

/// One division serves 1/cos(theta) and 1/(2 - h cos(theta)).
#[inline(always)]
fn bisector_with_lever<L: Lanes>(rays: &Rays<L>) -> Bisector<L> {
    let (cos_theta, sin_sq_theta) = half_angle(rays).cos_and_sin_sq();
    // k0 = h/(2 - h cos(theta))                                                                 (8)
    let lever = rays.ratio.neg_mul_add(cos_theta, L::splat(2.0));
    let reciprocal = L::splat(1.0).div(cos_theta.mul(lever));
    Bisector {
        cos_theta,
        sin_sq_theta,
        inverse_cos: reciprocal.mul(lever),
        first_k: rays.ratio.mul(reciprocal.mul(cos_theta)),
    }
}

/// The normal of eq. (16) with C = sqrt(1 - k² sin²(theta)).
#[inline(always)]
fn leaning_normal<L: Lanes, const FULL: bool>(rays: &Rays<L>, b: &Bisector<L>, k: L) -> Normal<L> {
    let c = k.mul(k).neg_mul_add(b.sin_sq_theta, L::splat(1.0)).sqrt();
    // s·n = cos(theta + tau)
    let cos_incidence = if FULL {
        k.neg_mul_add(b.sin_sq_theta, c.mul(b.cos_theta))
    } else {
        L::splat(0.0)
    };
    Normal {
        n: half_angle(rays).robust_normal(c.mul(b.inverse_cos), k),
        cos_incidence,
    }
}

/// Guo 2015 eq. (9), solved to the last digit.
///
/// With C = cos(tau), k = sin(tau)/sin(theta) and h = Hz/L, eq. (9) reads k (2C - h cos(theta)) = h C.
/// The first guess C = 1 is eq. (8), k0 = h/(2 - h cos(theta)). Its relative correction x depends on
/// v = k0² sin²(theta) and g = k0 cos(theta) alone, and its power series
///   x = v g [1/2 + v (3/8 + 3/4 g) + v² (5/16 + 3/2 g + 3/2 g²) + v³ (35/128 + 145/64 g + ..) + ..]
/// leaves less than 1e-17 of the normal for |h| <= 1/12: Newton's limit without its divisions.
#[derive(Clone, Copy)]
pub(crate) struct Exact;

impl OffsetSource for Exact {
    #[inline(always)]
    fn bisector<L: Lanes>(self, rays: &Rays<L>) -> Bisector<L> {
        bisector_with_lever(rays)
    }

    #[inline(always)]
    fn lean<L: Lanes, const FULL: bool>(self, h: L, b: &Bisector<L>) -> L {
        let c = L::splat;
        let k0 = b.first_k;
        let g = k0.mul(b.cos_theta);
        let v = k0.mul(k0).mul(b.sin_sq_theta);
        let x3 = g.mul_add(c(145.0 / 64.0), c(35.0 / 128.0));
        let x2 = g.mul_add(c(1.5), c(1.5)).mul_add(g, c(5.0 / 16.0));
        let x1 = g.mul_add(c(0.75), c(0.375));
        let low = x1.mul_add(v, c(0.5));
        let x = x3.mul_add(v, x2).mul_add(v.mul(v), low).mul(v.mul(g));
        let k = k0.mul_add(x, k0);
        let series = h.abs().le(c(MAX_SERIES_RATIO));
        if FULL && !series.all() {
            return L::select(series, k, near_field(h, b.cos_theta, b.sin_sq_theta.sqrt()));
        }
        k
    }

    #[inline(always)]
    fn normal<L: Lanes, const FULL: bool>(
        self,
        rays: &Rays<L>,
        b: &Bisector<L>,
        k: L,
    ) -> Normal<L> {
        leaning_normal::<L, FULL>(rays, b, k)
    }
}

/// k of eq. (9) for any |h| < 1, by Newton's method within a bracket.
///
/// The unknown is y = |sin(tau)|, which lies in [0, sin 45°]: at its ends the residual
/// 2 y C - |h| (C sin(theta) ± y cos(theta)) has opposite signs.
#[inline(always)]
fn near_field<L: Lanes>(h: L, cos_theta: L, sin_theta: L) -> L {
    let (one, two) = (L::splat(1.0), L::splat(2.0));
    let a = h.abs();
    let e = cos_theta.copysign(h);
    let mut low = L::splat(0.0);
    let mut high = L::splat(FRAC_1_SQRT_2);
    let mut y = L::splat(0.25);
    for _ in 0..48 {
        let c = y.neg_mul_add(y, one).sqrt();
        let residual = c.mul(two).mul(y).sub(a.mul(c.mul(sin_theta).add(y.mul(e))));
        let negative = residual.lt(L::splat(0.0));
        low = L::select(negative, y, low);
        high = L::select(negative, high, y);
        let slope = two
            .mul(y.mul(y).neg_mul_add(two, one))
            .div(c)
            .add(a.mul(sin_theta.mul(y).div(c).sub(e)));
        let newton = y.sub(residual.div(slope));
        let inside = low.le(newton).and(newton.le(high));
        y = L::select(inside, newton, low.add(high).mul(L::splat(0.5)));
    }
    let c = y.neg_mul_add(y, one).sqrt();
    h.mul(c).div(two.mul(c).sub(h.mul(cos_theta)))
}

/// Guo 2015 eq. (8).
#[derive(Clone, Copy)]
pub(crate) struct Approximate;

impl OffsetSource for Approximate {
    #[inline(always)]
    fn bisector<L: Lanes>(self, rays: &Rays<L>) -> Bisector<L> {
        bisector_with_lever(rays)
    }

    #[inline(always)]
    fn lean<L: Lanes, const FULL: bool>(self, _ratio: L, b: &Bisector<L>) -> L {
        b.first_k
    }

    #[inline(always)]
    fn normal<L: Lanes, const FULL: bool>(
        self,
        rays: &Rays<L>,
        b: &Bisector<L>,
        k: L,
    ) -> Normal<L> {
        leaning_normal::<L, FULL>(rays, b, k)
    }
}

/// Shen 2016 eq. (11): n = unit(s + unit(T - Hz n)), again and again, from n = unit(s + t); with
/// no iteration at all, as if there were no offset.
#[derive(Clone, Copy)]
pub(crate) struct Iterated(pub u32);

impl OffsetSource for Iterated {
    #[inline(always)]
    fn bisector<L: Lanes>(self, rays: &Rays<L>) -> Bisector<L> {
        let (cos_theta, sin_sq_theta) = half_angle(rays).cos_and_sin_sq();
        Bisector {
            cos_theta,
            sin_sq_theta,
            inverse_cos: L::splat(1.0).div(cos_theta),
            first_k: L::splat(0.0),
        }
    }

    #[inline(always)]
    fn lean<L: Lanes, const FULL: bool>(self, _ratio: L, _bisector: &Bisector<L>) -> L {
        L::splat(0.0)
    }

    #[inline(always)]
    fn normal<L: Lanes, const FULL: bool>(
        self,
        rays: &Rays<L>,
        b: &Bisector<L>,
        k: L,
    ) -> Normal<L> {
        let [t, s] = [rays.half_t, rays.half_s];
        let half = L::splat(0.5);
        let half_h = rays.ratio.mul(half);
        let mut n = half_angle(rays).robust_normal(b.inverse_cos, k);
        for _ in 0..self.0 {
            // in units of L: half of T - M is half_t - (h/2) n
            let ray = [
                half_h.neg_mul_add(n[0], t[0]),
                half_h.neg_mul_add(n[1], t[1]),
                half_h.neg_mul_add(n[2], t[2]),
            ];
            let unit = half.div(dot(ray, ray).sqrt());
            let sum = [
                ray[0].mul_add(unit, s[0]),
                ray[1].mul_add(unit, s[1]),
                ray[2].mul_add(unit, s[2]),
            ];
            let unit = L::splat(1.0).div(dot(sum, sum).sqrt());
            n = [sum[0].mul(unit), sum[1].mul(unit), sum[2].mul(unit)];
        }
        Normal {
            n,
            cos_incidence: dot(s, n).mul(L::splat(2.0)),
        }
    }
}
