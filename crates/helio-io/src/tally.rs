//! Rows counted by their status.

use std::fmt::{Display, Formatter, Result};

use helio_core::Status;

use crate::Grouped;

/// Rows of each status, counted.
///
/// ```
/// use helio_core::Status;
/// let mut tally = helio_io::Tally::default();
/// tally.add(&[Status::Ok, Status::Ok, Status::SunBelowHorizon]);
/// assert_eq!((tally.total(), tally.failed()), (3, 0));
/// assert_eq!(tally.to_string(), "2 ok, 1 sun_below_horizon");
/// ```
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Tally([u64; Status::ALL.len()]);

impl Tally {
    /// Counts more rows.
    pub fn add(&mut self, status: &[Status]) {
        for part in status.chunks(1 << 14) {
            // The compiler counts one word of a whole stretch at once, but not seven.
            let ok = part
                .iter()
                .map(|&s| u32::from(s == Status::Ok))
                .sum::<u32>();
            self.0[0] += u64::from(ok);
            if (ok as usize) < part.len() {
                for &s in part.iter().filter(|&&s| s != Status::Ok) {
                    self.0[usize::from(s.code())] += 1;
                }
            }
        }
    }

    /// All rows.
    #[must_use]
    pub fn total(&self) -> u64 {
        self.0.iter().sum()
    }

    /// Rows without an answer that the night does not excuse.
    #[must_use]
    pub fn failed(&self) -> u64 {
        self.total() - self.count(Status::Ok) - self.count(Status::SunBelowHorizon)
    }

    /// Rows of one status.
    #[must_use]
    pub fn count(&self, status: Status) -> u64 {
        self.0[usize::from(status.code())]
    }

    /// Every status with its rows.
    #[must_use]
    pub fn rows(&self) -> Vec<(Status, u64)> {
        Status::ALL
            .into_iter()
            .map(|s| (s, self.count(s)))
            .collect()
    }
}

impl Display for Tally {
    fn fmt(&self, f: &mut Formatter<'_>) -> Result {
        let mut separator = "";
        for (status, count) in self.rows() {
            if count > 0 {
                write!(f, "{separator}{} {status}", Grouped(count))?;
                separator = ", ";
            }
        }
        if separator.is_empty() {
            f.write_str("no rows")?;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_tally_tells_failures_from_the_night() {
        let mut tally = Tally::default();
        tally.add(&[Status::Ok; 20_000]);
        tally.add(&[Status::SunBelowHorizon, Status::Unreachable]);
        assert_eq!(tally.failed(), 1);
        assert_eq!(
            tally.to_string(),
            "20,000 ok, 1 unreachable, 1 sun_below_horizon"
        );
    }
}
