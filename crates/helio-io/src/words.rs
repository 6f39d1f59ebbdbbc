//! Numbers for people.

use std::fmt::{Display, Formatter, Result};

/// A whole number with its digits in threes.
///
/// ```
/// assert_eq!(helio_io::Grouped(104_000_000).to_string(), "104,000,000");
/// ```
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Grouped(pub u64);

impl Display for Grouped {
    fn fmt(&self, f: &mut Formatter<'_>) -> Result {
        let digits = self.0.to_string();
        for (i, digit) in digits.chars().enumerate() {
            if i > 0 && (digits.len() - i).is_multiple_of(3) {
                f.write_str(",")?;
            }
            write!(f, "{digit}")?;
        }
        Ok(())
    }
}

/// A number of things, in the plural where they are not one.
///
/// ```
/// assert_eq!(helio_io::Counted(1, "row").to_string(), "1 row");
/// assert_eq!(helio_io::Counted(1200, "row").to_string(), "1,200 rows");
/// ```
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Counted(pub usize, pub &'static str);

impl Display for Counted {
    fn fmt(&self, f: &mut Formatter<'_>) -> Result {
        let ending = if self.0 == 1 { "" } else { "s" };
        write!(f, "{} {}{ending}", Grouped(self.0 as u64), self.1)
    }
}
