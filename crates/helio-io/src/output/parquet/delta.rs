//! Parquet's delta encoding of whole numbers.

use super::hybrid::varint;

const BLOCK: usize = 128;
const MINIBLOCKS: usize = 4;
const MINIBLOCK: usize = BLOCK / MINIBLOCKS;

fn zigzag(value: i64) -> u64 {
    ((value << 1) ^ (value >> 63)) as u64
}

/// Appends values as differences, packed in as few bits as each stretch of 32 needs.
pub(super) fn encode(values: &[i64], out: &mut Vec<u8>) {
    varint(BLOCK as u64, out);
    varint(MINIBLOCKS as u64, out);
    varint(values.len() as u64, out);
    varint(zigzag(values.first().copied().unwrap_or(0)), out);
    let deltas = values.get(1..).unwrap_or(&[]);
    for (block, part) in deltas.chunks(BLOCK).enumerate() {
        let before = &values[block * BLOCK..];
        let mut steps = [0_i64; BLOCK];
        for (step, (&value, &previous)) in steps.iter_mut().zip(part.iter().zip(before)) {
            *step = value.wrapping_sub(previous);
        }
        let steps = &steps[..part.len()];
        let least = steps.iter().copied().min().unwrap_or(0);
        varint(zigzag(least), out);
        let widths_at = out.len();
        out.extend_from_slice(&[0; MINIBLOCKS]);
        for (mini, steps) in steps.chunks(MINIBLOCK).enumerate() {
            let above = |step: i64| step.wrapping_sub(least) as u64;
            let all = steps.iter().fold(0, |bits, &step| bits | above(step));
            let width = u64::BITS - all.leading_zeros();
            out[widths_at + mini] = width as u8;
            let end = out.len() + MINIBLOCK * width as usize / 8;
            let mut waiting = 0_u128;
            let mut filled = 0;
            for &step in steps {
                waiting |= u128::from(above(step)) << filled;
                filled += width;
                if filled >= 64 {
                    out.extend_from_slice(&(waiting as u64).to_le_bytes());
                    waiting >>= 64;
                    filled -= 64;
                }
            }
            out.extend_from_slice(&waiting.to_le_bytes()[..filled.div_ceil(8) as usize]);
            out.resize(end, 0);
        }
    }
}
