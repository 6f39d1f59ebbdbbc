//! Points that fill a cube evenly, the same for a seed everywhere.

/// Dimensions there are direction numbers for.
pub(crate) const DIMENSIONS: usize = 8;

/// Sobol' points with the direction numbers of Joe and Kuo 2008 (new-joe-kuo-6, first eight dimensions),
/// their digits permuted by the nested uniform scrambling of Owen 1995 in the hashed form of Burley 2020
/// (JCGT 9(4), after Laine and Karras).
#[derive(Debug, Clone)]
pub(crate) struct Sobol {
    directions: [[u32; 32]; DIMENSIONS],
    seeds: [u32; DIMENSIONS],
}

impl Sobol {
    pub(crate) fn new(seed: u64) -> Self {
        // degree, coefficients and first direction numbers of dimensions 2 to 8
        const JOE_KUO: [(usize, u32, [u32; 5]); DIMENSIONS - 1] = [
            (1, 0, [1, 0, 0, 0, 0]),
            (2, 1, [1, 3, 0, 0, 0]),
            (3, 1, [1, 3, 1, 0, 0]),
            (3, 2, [1, 1, 1, 0, 0]),
            (4, 1, [1, 1, 3, 3, 0]),
            (4, 4, [1, 3, 5, 13, 0]),
            (5, 2, [1, 1, 5, 5, 17]),
        ];
        let mut directions = [[0; 32]; DIMENSIONS];
        for (bit, direction) in directions[0].iter_mut().enumerate() {
            *direction = 1 << (31 - bit);
        }
        for (v, (degree, coefficients, first)) in directions[1..].iter_mut().zip(JOE_KUO) {
            for bit in 0..32 {
                if bit < degree {
                    v[bit] = first[bit] << (31 - bit);
                    continue;
                }
                v[bit] = v[bit - degree] ^ (v[bit - degree] >> degree);
                for k in 1..degree {
                    if (coefficients >> (degree - 1 - k)) & 1 == 1 {
                        v[bit] ^= v[bit - k];
                    }
                }
            }
        }
        let seeds = core::array::from_fn(|d| (hash(seed, d as u64) >> 32) as u32);
        Self { directions, seeds }
    }

    /// Coordinate `dimension` of point `index`, in [0, 1), on a grid of 2⁻³².
    pub(crate) fn at(&self, index: u32, dimension: usize) -> f64 {
        f64::from(scramble(
            self.digits(index, dimension),
            self.seeds[dimension],
        )) * (1.0 / 4_294_967_296.0)
    }

    fn digits(&self, index: u32, dimension: usize) -> u32 {
        let mut digits = 0;
        let mut rest = index;
        while rest != 0 {
            digits ^= self.directions[dimension][rest.trailing_zeros() as usize];
            rest &= rest - 1;
        }
        digits
    }
}

fn scramble(digits: u32, seed: u32) -> u32 {
    let mut x = digits.reverse_bits();
    x ^= x.wrapping_mul(0x3d20_adea);
    x = x.wrapping_add(seed);
    x = x.wrapping_mul((seed >> 16) | 1);
    x ^= x.wrapping_mul(0x0552_6c56);
    x ^= x.wrapping_mul(0x53a2_2864);
    x.reverse_bits()
}

/// 64 bits of a seed and a number, each bit of either changing half of them (the output function of
/// splitmix64: Steele, Lea and Flood 2014, twice).
pub(crate) const fn hash(seed: u64, number: u64) -> u64 {
    const fn mix(z: u64) -> u64 {
        let z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        let z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        z ^ (z >> 31)
    }
    mix(mix(seed.wrapping_add(0x9E37_79B9_7F4A_7C15)) ^ number.wrapping_mul(0x9E37_79B9_7F4A_7C15))
}

/// A number in [0, 1) from 64 bits.
pub(crate) fn part(bits: u64) -> f64 {
    (bits >> 11) as f64 * (1.0 / 9_007_199_254_740_992.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    // Joe and Kuo's generator lists points 1, 2, 3 of its sequence (in Gray code order 1, 3, 2 of ours).
    #[test]
    fn unscrambled_points_are_those_published() {
        let sobol = Sobol::new(0);
        let point = |i| -> Vec<f64> {
            (0..DIMENSIONS)
                .map(|d| f64::from(sobol.digits(i, d)) / 4_294_967_296.0)
                .collect()
        };
        assert_eq!(point(1), [0.5; 8]);
        let two = [0.75, 0.25, 0.25, 0.25, 0.75, 0.75, 0.25, 0.75];
        let three: Vec<_> = two.iter().map(|x| 1.0 - x).collect();
        assert_eq!(point(3), two);
        assert_eq!(point(2), three);
    }

    // What a net in base 2 promises: each of n equal slices of each coordinate holds one of the first n
    // points, and so does each of the 2^a x 2^b boxes of the first two coordinates (a (0, m, 2)-net).
    #[test]
    fn scrambled_points_are_still_a_net() {
        for seed in 0..5 {
            let sobol = Sobol::new(seed);
            let n = 256_u32;
            for first in [0, 256, 1024] {
                for d in 0..DIMENSIONS {
                    let mut seen = vec![false; n as usize];
                    for i in first..first + n {
                        seen[(sobol.at(i, d) * f64::from(n)) as usize] = true;
                    }
                    assert!(seen.iter().all(|&s| s), "seed {seed}, dimension {d}");
                }
                for wide in 0..=8 {
                    let (columns, rows) = (1 << wide, n >> wide);
                    let mut seen = vec![false; n as usize];
                    for i in first..first + n {
                        let x = (sobol.at(i, 0) * f64::from(columns)) as u32;
                        let y = (sobol.at(i, 1) * f64::from(rows)) as u32;
                        seen[(y * columns + x) as usize] = true;
                    }
                    assert!(seen.iter().all(|&s| s), "seed {seed}, {columns} x {rows}");
                }
            }
        }
        assert_ne!(Sobol::new(1).at(5, 0), Sobol::new(2).at(5, 0));
    }
}
