//! What pages of made-up numbers have in common.

// Each test file uses its own part of this.
#![allow(dead_code, missing_docs)]

use std::f64::consts::TAU;

/// A sequence of numbers in 0..1 that is the same every time.
pub struct Dice(pub u64);

impl Dice {
    pub fn roll(&mut self) -> f64 {
        self.0 = self
            .0
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 11) as f64 / (1_u64 << 53) as f64
    }

    /// With mean 0 and standard deviation 1.
    pub fn normal(&mut self) -> f64 {
        (-2.0 * (1.0 - self.roll()).ln()).sqrt() * (TAU * self.roll()).cos()
    }
}

pub const DAY_NS: i64 = 86_400_000_000_000;

/// Writes a page to the build's temporary folder, to be looked at, and checks what every page must keep.
/// `infinite` is how numbers that are not finite would look.
pub fn keep(name: &str, html: &str, infinite: &[&str]) {
    let path = std::path::Path::new(env!("CARGO_TARGET_TMPDIR")).join(format!("{name}.html"));
    std::fs::write(&path, html).expect("the temporary folder of the build");
    for word in ["NaN", "http", "<script", "url("].iter().chain(infinite) {
        assert!(!html.contains(word), "{name}: {word}");
    }
    balanced(name, html);
}

/// Every element that begins also ends, in the right order.
fn balanced(name: &str, html: &str) {
    let mut open: Vec<&str> = Vec::new();
    for tag in html.split('<').skip(1) {
        let (tag, _) = tag.split_once('>').expect("a tag that ends");
        let word = tag.split_whitespace().next().unwrap_or_default();
        if tag.starts_with('!') || tag.ends_with('/') || word == "meta" {
            continue;
        }
        match word.strip_prefix('/') {
            Some(end) => assert_eq!(open.pop(), Some(end), "{name}"),
            None => open.push(word),
        }
    }
    assert!(open.is_empty(), "{name}: {open:?}");
}
