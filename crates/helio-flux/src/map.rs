//! The irradiance of a receiver.

use crate::account::Account;
use crate::receiver::Receiver;

/// Irradiance of every bin of a receiver, and where the rest of the light went.
#[derive(Debug, Clone, PartialEq)]
pub struct FluxMap {
    rows: usize,
    columns: usize,
    irradiance_w_m2: Vec<f64>,
    account: Account,
}

impl FluxMap {
    /// From the power of every bin \[W\].
    pub(crate) fn new(receiver: &Receiver, power_w: &[f64], account: Account) -> Self {
        let irradiance = |(bin, &power): (usize, &f64)| power / receiver.bin_area_m2(bin);
        Self {
            rows: receiver.rows(),
            columns: receiver.columns(),
            irradiance_w_m2: power_w.iter().enumerate().map(irradiance).collect(),
            account,
        }
    }

    /// Rows of the receiver's grid.
    #[must_use]
    pub const fn rows(&self) -> usize {
        self.rows
    }

    /// Columns of the receiver's grid.
    #[must_use]
    pub const fn columns(&self) -> usize {
        self.columns
    }

    /// Irradiance of the bins \[W/m²\], row by row: power over the true area of each.
    #[must_use]
    pub fn irradiance_w_m2(&self) -> &[f64] {
        &self.irradiance_w_m2
    }

    /// Irradiance of a row's bins \[W/m²\].
    ///
    /// # Panics
    /// If there is no such row.
    #[must_use]
    pub fn row_w_m2(&self, row: usize) -> &[f64] {
        &self.irradiance_w_m2[row * self.columns..(row + 1) * self.columns]
    }

    /// The greatest irradiance \[W/m²\] and its bin; the first of equals.
    #[must_use]
    pub fn peak(&self) -> (f64, usize) {
        let mut peak = (f64::NEG_INFINITY, 0);
        for (bin, &value) in self.irradiance_w_m2.iter().enumerate() {
            if value > peak.0 {
                peak = (value, bin);
            }
        }
        peak
    }

    /// Where the light went.
    #[must_use]
    pub const fn account(&self) -> &Account {
        &self.account
    }
}
