//! A column whose memory begins on a cache line, as streaming stores want it.
#![allow(unsafe_code)]

use alloc::vec::Vec;

const LANES: usize = 8;

#[derive(Debug, Clone, Copy, Default)]
#[repr(C, align(64))]
struct Line([f64; LANES]);

// SAFETY: eight doubles, 64 bytes, no padding; every bit pattern is valid and zero is a value.
unsafe impl bytemuck::Zeroable for Line {}
// SAFETY: as above.
unsafe impl bytemuck::Pod for Line {}

/// Doubles, aligned to 64 bytes.
#[derive(Debug, Clone, Default)]
pub(crate) struct AlignedColumn {
    lines: Vec<Line>,
    len: usize,
}

impl AlignedColumn {
    /// Sets the length; what the new rows hold is not defined.
    pub fn resize(&mut self, len: usize) {
        self.lines.resize(len.div_ceil(LANES), Line::default());
        self.len = len;
    }

    /// Sets the length and every row to zero.
    pub fn clear_to(&mut self, len: usize) {
        self.lines.clear();
        self.resize(len);
    }

    pub fn as_slice(&self) -> &[f64] {
        &bytemuck::cast_slice(&self.lines)[..self.len]
    }

    pub fn as_mut_slice(&mut self) -> &mut [f64] {
        &mut bytemuck::cast_slice_mut(&mut self.lines)[..self.len]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn columns_begin_on_a_cache_line_and_have_the_length_asked_for() {
        let mut column = AlignedColumn::default();
        for len in [0, 1, 7, 8, 9, 1000] {
            column.resize(len);
            assert_eq!(column.as_slice().len(), len);
            assert_eq!(column.as_mut_slice().as_ptr().addr() % 64, 0);
            column.as_mut_slice().fill(1.0);
        }
        column.clear_to(12);
        assert_eq!(column.as_slice(), [0.0; 12]);
    }
}
