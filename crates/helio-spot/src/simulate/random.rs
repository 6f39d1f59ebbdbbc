//! Random numbers by place: each pixel, cell and lobe asks by its own number, so that what one gets depends
//! neither on the others nor on the order in which threads come.

use core::f64::consts::TAU;

/// The output function of splitmix64 (Steele, Lea and Flood 2014).
const fn mix(z: u64) -> u64 {
    let z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
    let z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
    z ^ (z >> 31)
}

const STEP: u64 = 0x9E37_79B9_7F4A_7C15;

/// A stream of a seed: what is drawn from one tells nothing about the others.
#[derive(Debug, Clone, Copy)]
pub(super) struct Draws(u64);

impl Draws {
    pub(super) const fn new(seed: u64, stream: u64) -> Self {
        Self(mix(
            mix(seed.wrapping_add(STEP)) ^ mix(stream.wrapping_mul(STEP).wrapping_add(1))
        ))
    }

    const fn bits(self, index: u64) -> u64 {
        mix(self.0.wrapping_add(mix(index.wrapping_mul(STEP))))
    }

    /// In [0, 1), on a grid of 2⁻⁵³.
    pub(super) const fn uniform(self, index: u64) -> f64 {
        (self.bits(index) >> 11) as f64 * (1.0 / 9_007_199_254_740_992.0)
    }

    /// A deviate of the standard normal distribution (Box and Muller 1958).
    pub(super) fn normal(self, index: u64) -> f64 {
        self.normal_pair(index)[0]
    }

    /// Two of them, independent.
    pub(super) fn normal_pair(self, index: u64) -> [f64; 2] {
        // 1 - uniform lies in (0, 1]: its logarithm is finite
        let radius = libm::sqrt(-2.0 * libm::log(1.0 - self.uniform(2 * index)));
        let (sine, cosine) = libm::sincos(TAU * self.uniform(2 * index + 1));
        [radius * cosine, radius * sine]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn deviates_have_their_moments_and_streams_differ() {
        let draws = Draws::new(3, 1);
        let n = 100_000_u64;
        let (mut sum, mut squares, mut across) = (0.0, 0.0, 0.0);
        for i in 0..n {
            let [a, b] = draws.normal_pair(i);
            sum += a;
            squares += a * a;
            across += a * b;
        }
        let n = n as f64;
        // four standard errors: 1/sqrt(n), sqrt(2/n), 1/sqrt(n)
        assert!((sum / n).abs() < 0.0127);
        assert!((squares / n - 1.0).abs() < 0.018);
        assert!((across / n).abs() < 0.0127);
        assert_ne!(draws.bits(0), Draws::new(3, 2).bits(0));
        assert_ne!(draws.bits(0), Draws::new(4, 1).bits(0));
    }
}
