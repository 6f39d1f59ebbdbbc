//! What the cross-crate tests share.
//!
//! Nothing in here uses the arithmetic of the crates under test: vectors, random numbers, the
//! mirror-centre normal (in double-double), the mount as turning steel (Rodrigues rotations about
//! physical axes) and the inverse by the crossing of two cones are written from the papers.

#![allow(clippy::print_stderr, reason = "tests talk")]

pub mod cases;
pub mod data;
pub mod dd;
pub mod juelich;
pub mod mount;
pub mod normal;
pub mod rng;
pub mod vec3;

pub use rng::Rng;
pub use vec3::V3;

/// `a - b` on the circle \[rad\], in [-π, π].
#[must_use]
pub fn circle_difference_rad(a: f64, b: f64) -> f64 {
    let difference = a - b;
    difference - core::f64::consts::TAU * (difference / core::f64::consts::TAU).round()
}

/// The largest of what it is shown, with a word on where.
#[derive(Debug, Clone, Default)]
pub struct Worst {
    /// The largest value so far; NaN sticks.
    pub value: f64,
    /// Where it was.
    pub place: String,
    /// How many were shown.
    pub count: usize,
}

impl Worst {
    /// Shows it a magnitude.
    pub fn see(&mut self, value: f64, place: impl FnOnce() -> String) {
        self.count += 1;
        let stuck = self.value.is_nan();
        if !stuck && (value.is_nan() || value > self.value) {
            self.value = value;
            self.place = place();
        }
    }

    /// The worse of two.
    #[must_use]
    pub fn merge(self, other: Self) -> Self {
        let count = self.count + other.count;
        let other_wins = !self.value.is_nan() && (other.value.is_nan() || other.value > self.value);
        let worse = if other_wins { other } else { self };
        Self { count, ..worse }
    }
}

impl core::fmt::Display for Worst {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        write!(f, "{:.3e} of {} ({})", self.value, self.count, self.place)
    }
}

/// The README's own Rust, compiled and run.
#[cfg(doctest)]
#[doc = include_str!("../../README.md")]
pub struct Readme;
