//! Random numbers that are the same everywhere, for simulation and for shuffled folds.

use core::f64::consts::TAU;

/// A generator of random numbers: xoshiro256++ 1.0 of Blackman and Vigna (2019), its state filled from
/// the seed by splitmix64. Not for secrets.
///
/// Its numbers depend on the seed alone: integers by exact arithmetic, normal deviates by crate `libm`.
///
/// ```
/// use helio_calib::random::Random;
/// let (mut a, mut b) = (Random::new(7), Random::new(7));
/// assert_eq!(a.uniform().to_bits(), b.uniform().to_bits());
/// assert!((0.0..1.0).contains(&a.uniform()));
/// ```
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Random {
    state: [u64; 4],
}

impl Random {
    /// The generator of a seed.
    #[must_use]
    pub const fn new(seed: u64) -> Self {
        let mut state = [0; 4];
        let mut z = seed;
        let mut k = 0;
        while k < 4 {
            z = z.wrapping_add(0x9E37_79B9_7F4A_7C15);
            state[k] = mix(z);
            k += 1;
        }
        Self { state }
    }

    /// The generator number `index` of a seed: one for each heliostat, observation or case, so that
    /// what is drawn for one does not depend on how much the others draw.
    ///
    /// ```
    /// use helio_calib::random::Random;
    /// assert_ne!(Random::stream(7, 0).next_u64(), Random::stream(7, 1).next_u64());
    /// ```
    #[must_use]
    pub const fn stream(seed: u64, index: u64) -> Self {
        Self::new(mix(seed) ^ mix(index.wrapping_mul(0x9E37_79B9_7F4A_7C15)))
    }

    /// The next 64 bits.
    pub const fn next_u64(&mut self) -> u64 {
        let s = &mut self.state;
        let out = s[0].wrapping_add(s[3]).rotate_left(23).wrapping_add(s[0]);
        let t = s[1] << 17;
        s[2] ^= s[0];
        s[3] ^= s[1];
        s[1] ^= s[2];
        s[0] ^= s[3];
        s[2] ^= t;
        s[3] = s[3].rotate_left(45);
        out
    }

    /// Evenly distributed in [0, 1), on a grid of 2⁻⁵³.
    pub const fn uniform(&mut self) -> f64 {
        (self.next_u64() >> 11) as f64 * (1.0 / 9_007_199_254_740_992.0)
    }

    /// Evenly distributed from `low` up to `high`.
    pub fn between(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * self.uniform()
    }

    /// A whole number below `bound`, each equally likely to 1 in 2⁶⁴; 0 if `bound` is 0.
    pub const fn below(&mut self, bound: usize) -> usize {
        ((self.next_u64() as u128 * bound as u128) >> 64) as usize
    }

    /// Two independent deviates of the standard normal distribution (Box and Muller 1958).
    pub fn normal_pair(&mut self) -> [f64; 2] {
        // 1 - uniform lies in (0, 1]: its logarithm is finite
        let radius = libm::sqrt(-2.0 * libm::log(1.0 - self.uniform()));
        let (sine, cosine) = libm::sincos(TAU * self.uniform());
        [radius * cosine, radius * sine]
    }

    /// A deviate of the standard normal distribution.
    pub fn normal(&mut self) -> f64 {
        self.normal_pair()[0]
    }

    /// Puts a slice into random order, each order equally likely (Fisher and Yates).
    pub fn shuffle<T>(&mut self, slice: &mut [T]) {
        for last in (1..slice.len()).rev() {
            slice.swap(last, self.below(last + 1));
        }
    }
}

/// The output function of splitmix64 (Steele, Lea and Flood 2014).
const fn mix(z: u64) -> u64 {
    let z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
    let z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
    z ^ (z >> 31)
}

#[cfg(test)]
mod tests {
    use super::*;

    // splitmix64 of seed 1234567: the values published with it (Vigna, prng.di.unimi.it; also Rosetta Code)
    #[test]
    fn splitmix_gives_its_published_numbers() {
        let mut z = 1_234_567_u64;
        for want in [
            6_457_827_717_110_365_317,
            3_203_168_211_198_807_973,
            9_817_491_932_198_370_423,
            4_593_380_528_125_082_431,
        ] {
            z = z.wrapping_add(0x9E37_79B9_7F4A_7C15);
            assert_eq!(mix(z), want);
        }
    }

    // xoshiro256++ from state 1, 2, 3, 4: the values that crate rand_xoshiro tests against
    #[test]
    fn xoshiro_gives_its_published_numbers() {
        let mut random = Random {
            state: [1, 2, 3, 4],
        };
        for want in [
            41_943_041,
            58_720_359,
            3_588_806_011_781_223,
            3_591_011_842_654_386,
            9_228_616_714_210_784_205,
            9_973_669_472_204_895_162,
        ] {
            assert_eq!(random.next_u64(), want);
        }
    }

    #[test]
    fn deviates_have_their_moments() {
        let mut random = Random::new(1);
        let n = 100_000;
        let (mut sum, mut squares, mut fourth) = (0.0, 0.0, 0.0);
        for _ in 0..n {
            let z = random.normal();
            sum += z;
            squares += z * z;
            fourth += z * z * z * z;
        }
        let n = f64::from(n);
        // four standard errors: 1/sqrt(n), sqrt(2/n), sqrt(96/n)
        assert!((sum / n).abs() < 0.0127);
        assert!((squares / n - 1.0).abs() < 0.018);
        assert!((fourth / n - 3.0).abs() < 0.124);
        let mut counts = [0; 7];
        for _ in 0..70_000 {
            counts[random.below(7)] += 1;
        }
        assert!(counts.iter().all(|&c| (9_600..10_400).contains(&c)));
        let mut order: Vec<usize> = (0..50).collect();
        random.shuffle(&mut order);
        let mut sorted = order.clone();
        sorted.sort_unstable();
        assert!(order != sorted && sorted.iter().enumerate().all(|(k, &v)| k == v));
    }
}
