//! The plain gray-weighted centroid.

/// Sum of the kept pixels and its first moments.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Totals {
    pub(super) sum: u64,
    /// Each gray value times its column.
    pub(super) x: u128,
    /// Each gray value times its row.
    pub(super) y: u128,
}

impl Totals {
    /// The centroid \[px\], right and down of the first pixel; NaN of nothing.
    pub(super) fn centroid(self) -> (f64, f64) {
        let sum = self.sum as f64;
        (self.x as f64 / sum, self.y as f64 / sum)
    }
}
