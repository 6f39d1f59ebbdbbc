//! Byte-stream split: the first bytes of all values, then the second bytes, and so on.

/// Values whose bytes are transposed together: two matrices of 8 × 8 bytes side by side, which is
/// as wide as the vectors that every processor has.
const GROUP: usize = 16;

/// Fills `out` with the values, their bytes split into eight streams; it is eight times as long.
pub(super) fn split(values: &[f64], map: impl Fn(f64) -> f64, out: &mut [u8]) {
    let n = values.len();
    let mut streams = out.chunks_exact_mut(n.max(1));
    let mut streams: [&mut [u8]; 8] = std::array::from_fn(|_| streams.next().unwrap_or_default());
    let whole = n / GROUP * GROUP;
    for (at, group) in (0..whole).step_by(GROUP).zip(values.chunks_exact(GROUP)) {
        let words = transpose(std::array::from_fn(|i| {
            [map(group[i]).to_bits(), map(group[i + 8]).to_bits()]
        }));
        for (stream, [low, high]) in streams.iter_mut().zip(words) {
            stream[at..at + 8].copy_from_slice(&low.to_le_bytes());
            stream[at + 8..at + 16].copy_from_slice(&high.to_le_bytes());
        }
    }
    for at in whole..n {
        for (stream, byte) in streams.iter_mut().zip(map(values[at]).to_le_bytes()) {
            stream[at] = byte;
        }
    }
}

/// Transposes two matrices of 8 × 8 bytes, by swapping ever smaller blocks.
#[inline(always)]
fn transpose(w: [[u64; 2]; 8]) -> [[u64; 2]; 8] {
    let [a, b, c, d, e, f, g, h] = w;
    let ([a, e], [b, f]) = (swap::<32>(a, e), swap::<32>(b, f));
    let ([c, g], [d, h]) = (swap::<32>(c, g), swap::<32>(d, h));
    let ([a, c], [b, d]) = (swap::<16>(a, c), swap::<16>(b, d));
    let ([e, g], [f, h]) = (swap::<16>(e, g), swap::<16>(f, h));
    let ([a, b], [c, d]) = (swap::<8>(a, b), swap::<8>(c, d));
    let ([e, f], [g, h]) = (swap::<8>(e, f), swap::<8>(g, h));
    [a, b, c, d, e, f, g, h]
}

/// Exchanges the upper bits of each `2 × BITS` of `low` with the lower ones of `high`.
#[inline(always)]
fn swap<const BITS: u32>(low: [u64; 2], high: [u64; 2]) -> [[u64; 2]; 2] {
    // Ones in the lower half of each 2 × BITS.
    let mask = u64::MAX / ((1 << BITS) + 1);
    let one = |side: usize| ((low[side] >> BITS) ^ high[side]) & mask;
    let moved = [one(0), one(1)];
    [
        [low[0] ^ (moved[0] << BITS), low[1] ^ (moved[1] << BITS)],
        [high[0] ^ moved[0], high[1] ^ moved[1]],
    ]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn streams_hold_the_bytes_of_the_values() {
        for n in [0, 1, 15, 16, 17, 1000] {
            let values: Vec<f64> = (0..n).map(|i| (f64::from(i) + 0.3).sin()).collect();
            let mut bytes = vec![0; values.len() * 8];
            split(&values, |v| v, &mut bytes);
            for (i, value) in values.iter().enumerate() {
                let back = std::array::from_fn(|k| bytes[k * values.len() + i]);
                assert_eq!(value.to_le_bytes(), back);
            }
        }
    }
}
