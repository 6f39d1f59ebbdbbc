//! Parquet's hybrid of run lengths and bit packing, for levels and dictionary keys.

use std::ops::Range;

/// Runs from here on are written as a length, shorter ones are packed.
const MIN_RUN: usize = 16;

/// Bits that hold every number below `count`.
pub(super) fn bits_below(count: usize) -> u32 {
    usize::BITS - count.saturating_sub(1).leading_zeros()
}

/// Appends a number in base 128, low digits first.
pub(super) fn varint(mut value: u64, out: &mut Vec<u8>) {
    while value >= 0x80 {
        out.push(value as u8 | 0x80);
        value >>= 7;
    }
    out.push(value as u8);
}

/// Appends `count` times the same value.
pub(super) fn run(count: usize, value: u32, bits: u32, out: &mut Vec<u8>) {
    varint((count as u64) << 1, out);
    out.extend_from_slice(&value.to_le_bytes()[..bits.div_ceil(8) as usize]);
}

/// Appends the values of `key` over a range, in runs and packed groups of eight.
pub(super) fn encode(
    range: Range<usize>,
    bits: u32,
    key: impl Fn(usize) -> u32,
    out: &mut Vec<u8>,
) {
    let mut packed = range.start;
    let mut at = range.start;
    while at < range.end {
        let value = key(at);
        let mut end = at + 1;
        while end < range.end && key(end) == value {
            end += 1;
        }
        // Packed values come in groups of eight; what completes a group is taken from the run.
        let fill = (8 - (at - packed) % 8) % 8;
        if end - at >= MIN_RUN + fill {
            let start = at + fill;
            if start > packed {
                pack(packed..start, bits, &key, out);
            }
            run(end - start, value, bits, out);
            packed = end;
        }
        at = end;
    }
    if range.end > packed {
        pack(packed..range.end, bits, &key, out);
    }
}

/// Appends values in groups of eight, the last one filled up with zeros.
fn pack(range: Range<usize>, bits: u32, key: impl Fn(usize) -> u32, out: &mut Vec<u8>) {
    let groups = range.len().div_ceil(8);
    varint(((groups as u64) << 1) | 1, out);
    let bytes = groups * bits as usize;
    let start = out.len();
    let mut waiting = 0_u64;
    let mut filled = 0;
    for at in range {
        waiting |= u64::from(key(at)) << filled;
        filled += bits;
        if filled >= 32 {
            out.extend_from_slice(&(waiting as u32).to_le_bytes());
            waiting >>= 32;
            filled -= 32;
        }
    }
    out.extend_from_slice(&waiting.to_le_bytes()[..filled.div_ceil(8) as usize]);
    out.resize(start + bytes, 0);
}

#[cfg(test)]
mod tests {
    use super::*;

    fn decode(mut bytes: &[u8], bits: u32, count: usize) -> Vec<u32> {
        let mut values = Vec::new();
        let mut next = || {
            let (first, rest) = bytes.split_first().unwrap();
            bytes = rest;
            *first
        };
        while values.len() < count {
            let mut header = 0_u64;
            for shift in (0..).step_by(7) {
                let byte = next();
                header |= u64::from(byte & 0x7f) << shift;
                if byte < 0x80 {
                    break;
                }
            }
            if header & 1 == 0 {
                let value = (0..bits.div_ceil(8)).fold(0, |v, i| v | u32::from(next()) << (8 * i));
                values.extend(std::iter::repeat_n(value, (header >> 1) as usize));
            } else {
                let total = (header >> 1) as usize * bits as usize;
                let group: Vec<u8> = (0..total).map(|_| next()).collect();
                for i in 0..(header >> 1) as usize * 8 {
                    let value = (0..bits as usize).fold(0, |v, b| {
                        let at = i * bits as usize + b;
                        v | u32::from(group[at / 8] >> (at % 8) & 1) << b
                    });
                    values.push(value);
                }
            }
        }
        values.truncate(count);
        values
    }

    #[test]
    fn runs_and_packed_groups_read_back() {
        for (bits, period) in [(1, 2), (3, 7), (14, 11_915), (20, 1_000_000)] {
            for run_length in [1, 3, 15, 16, 17, 23, 24, 100] {
                let values: Vec<u32> = (0..3001_u32)
                    .map(|i| (i / run_length).wrapping_mul(7919) % period)
                    .collect();
                for start in [0, 5] {
                    let mut bytes = Vec::new();
                    encode(start..values.len(), bits, |i| values[i], &mut bytes);
                    assert_eq!(decode(&bytes, bits, values.len() - start), values[start..]);
                }
            }
        }
    }

    #[test]
    fn bits_hold_the_greatest_key() {
        assert_eq!([1, 2, 3, 8, 9].map(bits_below), [0, 1, 2, 3, 4]);
    }
}
