//! Trigonometry in lanes, from polynomials of our own: the platform's functions differ from one
//! machine to the next, these do not.

use core::f64::consts::{FRAC_PI_2, FRAC_PI_4, FRAC_PI_8};

use super::{Lanes, Mask};

/// sin(π/8) and cos(π/8).
const SIN_PI_8: f64 = 0.382_683_432_365_089_8;
const COS_PI_8: f64 = 0.923_879_532_511_286_7;

/// asin(x) = x + x·z·P(z), z = x², for |x| <= sin(π/8): minimax, relative error 1.6e-16, which at
/// its largest is an eighth of the last digit of π/2.
#[allow(clippy::excessive_precision)]
const ASIN: [f64; 9] = [
    0.166_666_666_666_802_4,
    0.074_999_999_963_035_29,
    0.044_642_860_592_502_9,
    0.030_381_787_222_815_69,
    0.022_376_193_482_733_595,
    0.017_290_679_268_489_755,
    0.014_546_390_078_636_893,
    0.008_347_065_438_372_572,
    0.018_943_257_434_888_713,
];

/// sin(x) = x + x·z·P(z), |x| <= π/4: minimax, relative error 3.5e-18.
#[allow(clippy::excessive_precision)]
const SIN: [f64; 6] = [
    -0.166_666_666_666_666_32,
    0.008_333_333_333_322_44,
    -0.000_198_412_698_298_260_5,
    2.755_731_369_791_223e-6,
    -2.505_075_902_197_721e-8,
    1.589_684_706_283_054_8e-10,
];

/// cos(x) = 1 - z/2 + z²·P(z), |x| <= π/4: minimax, relative error 4.7e-20.
#[allow(clippy::excessive_precision)]
const COS: [f64; 6] = [
    0.041_666_666_666_666_6,
    -0.001_388_888_888_887_414,
    2.480_158_728_949_242_3e-5,
    -2.755_731_435_539_317_5e-7,
    2.087_572_370_281_34e-9,
    -1.135_967_072_920_081_4e-11,
];

/// Largest magnitude that [`sin_cos`] reduces without loss.
pub const MAX_ANGLE_RAD: f64 = 1.0e5;

#[inline(always)]
fn horner<L: Lanes>(z: L, coefficients: &[f64]) -> L {
    let (last, rest) = match coefficients.split_last() {
        Some(parts) => parts,
        None => return L::splat(0.0),
    };
    let mut sum = L::splat(*last);
    for &coefficient in rest.iter().rev() {
        sum = sum.mul_add(z, L::splat(coefficient));
    }
    sum
}

/// asin of |x| <= sin(π/8). Even and odd terms side by side: half of Horner's latency.
#[inline(always)]
fn asin_small<L: Lanes>(x: L) -> L {
    let c = L::splat;
    let z = x.mul(x);
    let z2 = z.mul(z);
    let even = c(ASIN[8]).mul_add(z2, c(ASIN[6])).mul_add(z2, c(ASIN[4]));
    let odd = c(ASIN[7]).mul_add(z2, c(ASIN[5])).mul_add(z2, c(ASIN[3]));
    let even = even.mul_add(z2, c(ASIN[2])).mul_add(z2, c(ASIN[0]));
    let odd = odd.mul_add(z2, c(ASIN[1]));
    odd.mul_add(z, even).mul(z).mul_add(x, x)
}

/// An angle on its way: base + asin(component), with the component where an arcsine keeps all its
/// digits, near its middle and never near its ends. Kernels do the two halves in different loops.
///
/// Signs choose here where comparisons would: a comparison costs a wide processor two multiplications.
#[derive(Clone, Copy)]
pub(crate) struct Reduced<L> {
    pub base: L,
    pub component: L,
}

/// The first octant turned back by half of it: sin(angle - π/8) of the folded angle.
#[inline(always)]
fn from_mid_octant<L: Lanes>(cosine: L, sine: L) -> L {
    let turned = sine.min(cosine).mul(L::splat(COS_PI_8));
    cosine.max(sine).neg_mul_add(L::splat(SIN_PI_8), turned)
}

impl<L: Lanes> Reduced<L> {
    /// Of the angle in [0, π/2] of a unit vector of the first quadrant.
    #[inline(always)]
    pub fn acute(cosine: L, sine: L) -> Self {
        // π/8 + asin(..) below the diagonal, 3π/8 - asin(..) above it
        let below = cosine.sub(sine);
        Self {
            base: L::splat(FRAC_PI_4).sub(L::splat(FRAC_PI_8).copysign(below)),
            component: from_mid_octant(cosine, sine).xor_sign(below),
        }
    }

    /// Of the angle in [-π/2, π/2] of a vector with cosine >= 0 whose length is 1/`scale`.
    #[inline(always)]
    pub fn half(cosine: L, sine: L, scale: L) -> Self {
        let acute = Self::acute(cosine, sine.abs());
        Self {
            base: acute.base.xor_sign(sine),
            component: acute.component.mul(scale).xor_sign(sine),
        }
    }

    /// Of the angle in [-π, π] of a vector whose length is 1/`scale`.
    #[inline(always)]
    pub fn full(cosine: L, sine: L, scale: L) -> Self {
        let (level, upright) = (cosine.abs(), sine.abs());
        let below = level.sub(upright);
        let component = from_mid_octant(level, upright).mul(scale);
        // From the upright, π/2 less the acute angle: forward it is taken off, backward put on.
        let from_upright = L::splat(FRAC_PI_4).add(L::splat(FRAC_PI_8).copysign(below));
        let base = L::splat(FRAC_PI_2).sub(from_upright.xor_sign(cosine));
        Self {
            base: base.xor_sign(sine),
            component: component.xor_sign(below).xor_sign(cosine).xor_sign(sine),
        }
    }

    /// The angle.
    #[inline(always)]
    pub fn angle(self) -> L {
        self.base.add(asin_small(self.component))
    }
}

/// The angle in [-π/2, π/2] of a unit vector with cosine >= 0.
#[inline(always)]
pub(crate) fn angle_half<L: Lanes>(cosine: L, sine: L) -> L {
    Reduced::half(cosine, sine, L::splat(1.0)).angle()
}

/// The angle in [-π, π] of a vector whose length is 1/`scale`.
#[inline(always)]
pub fn angle_full<L: Lanes>(cosine: L, sine: L, scale: L) -> L {
    Reduced::full(cosine, sine, scale).angle()
}

/// Sine and cosine, in this order, of |angle| <= [`MAX_ANGLE_RAD`].
#[inline(always)]
pub fn sin_cos<L: Lanes>(angle: L) -> (L, L) {
    // π/2 in three parts (Cody and Waite): the product of a quadrant number with the first two
    // is exact, the fused multiply-add then rounds once.
    const PIO2_HIGH: f64 = 1.570_796_326_734_125_6;
    const PIO2_MIDDLE: f64 = 6.077_100_506_303_966e-11;
    const PIO2_LOW: f64 = 2.022_266_248_795_950_6e-21;
    let half = L::splat(0.5);
    let quadrant = angle
        .mul_add(L::splat(core::f64::consts::FRAC_2_PI), half)
        .floor();
    let r = quadrant.neg_mul_add(L::splat(PIO2_HIGH), angle);
    let r = quadrant.neg_mul_add(L::splat(PIO2_MIDDLE), r);
    let r = quadrant.neg_mul_add(L::splat(PIO2_LOW), r);
    let z = r.mul(r);
    let sine = horner(z, &SIN).mul(z).mul_add(r, r);
    let cosine = horner(z, &COS).mul(z).sub(half).mul_add(z, L::splat(1.0));
    // quadrant mod 4 by arithmetic, exact for these sizes
    let quarter = L::splat(0.25);
    let turn = quadrant.sub(quadrant.mul(quarter).floor().mul(L::splat(4.0)));
    let odd = half.lt(turn.sub(turn.mul(half).floor().mul(L::splat(2.0))));
    let sine_negative = L::splat(1.5).lt(turn);
    // cos is negative in quadrants 1 and 2
    let cosine_negative = L::splat(0.5).lt(turn).and(turn.lt(L::splat(2.5)));
    (
        L::select(odd, cosine, sine).neg_if(sine_negative),
        L::select(odd, sine, cosine).neg_if(cosine_negative),
    )
}

#[cfg(test)]
mod tests {
    use core::f64::consts::PI;

    use super::*;

    /// Reference: libm's double functions, themselves within a unit in the last place.
    #[test]
    fn angles_agree_with_libm_all_round_the_circle() {
        for step in 0..=400_000 {
            let angle = (f64::from(step) / 200_000.0 - 1.0) * PI;
            let (s, c) = libm::sincos(angle);
            let length = 1.0 + f64::from(step % 7);
            let got = Reduced::full(c * length, s * length, 1.0 / length).angle();
            // two units in the last place of π
            assert!((got - libm::atan2(s, c)).abs() < 8.9e-16, "{angle} {got}");
            if c >= 0.0 {
                assert!(
                    (Reduced::half(c * length, s * length, 1.0 / length).angle()
                        - libm::atan2(s, c))
                    .abs()
                        < 3.4e-16,
                    "{angle}"
                );
            }
            if c >= 0.0 && s >= 0.0 {
                assert!(
                    (Reduced::acute(c, s).angle() - libm::atan2(s, c)).abs() < 3.4e-16,
                    "{angle}"
                );
            }
        }
    }

    #[test]
    fn the_axes_and_small_angles_come_out_to_the_last_digit_of_one() {
        let tiny = 1.2e-16;
        assert!(Reduced::full(1.0, 0.0, 1.0).angle().abs() < tiny);
        assert_eq!(Reduced::full(0.0, 1.0, 1.0).angle(), FRAC_PI_2);
        assert_eq!(Reduced::full(-1.0, 0.0, 1.0).angle(), PI);
        assert_eq!(Reduced::full(-1.0, -0.0, 1.0).angle(), -PI);
        assert!((Reduced::half(1.0, -1e-9, 1.0).angle() + 1e-9).abs() < tiny);
        assert_eq!(Reduced::acute(0.0, 1.0).angle(), FRAC_PI_2);
    }

    #[test]
    fn sine_and_cosine_agree_with_libm() {
        for step in -300_000..=300_000 {
            for angle in [f64::from(step) * 2.1e-5, f64::from(step) * 0.31] {
                let (s, c) = sin_cos(angle);
                let (want_s, want_c) = libm::sincos(angle);
                assert!((s - want_s).abs() < 2.3e-16, "sin {angle}: {s} {want_s}");
                assert!((c - want_c).abs() < 2.3e-16, "cos {angle}: {c} {want_c}");
            }
        }
    }
}
