//! Thresholds against their definitions, worked out the slow way, and against OpenCV and scikit-image.
#![allow(clippy::unwrap_used, reason = "tests fail")]

use helio_spot::{Gray, Histogram, SpotError, Threshold, View};

/// SplitMix64.
struct Random(u64);

impl Random {
    fn below(&mut self, end: u64) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        (z ^ (z >> 31)) % end
    }
}

fn histogram<P: Gray + TryFrom<u32>>(bins: &[(u32, u32)]) -> Histogram {
    let mut pixels = Vec::new();
    for &(gray, count) in bins {
        let gray = P::try_from(gray).unwrap_or_default();
        pixels.extend(std::iter::repeat_n(gray, count as usize));
    }
    Histogram::of(View::new(&pixels, pixels.len(), 1).unwrap()).unwrap()
}

/// Few gray values or many, close or far apart, equal counts or not.
fn random_bins(random: &mut Random, most: u64) -> Vec<(u32, u32)> {
    let count = 2 + random.below(most - 1);
    let widest = [1, 3, 20][random.below(3) as usize];
    let heights = [1, 4, 300][random.below(3) as usize];
    let mut gray = random.below(20);
    let mut bins = Vec::new();
    for _ in 0..count {
        if gray > 255 {
            break;
        }
        bins.push((gray as u32, 1 + random.below(heights) as u32));
        gray += 1 + random.below(widest);
    }
    bins
}

/// N0 N1 (mean1 - mean0)² as a fraction.
fn between(bins: &[(u32, u32)], threshold: u32) -> (u128, u128) {
    let class = |keep: &dyn Fn(u32) -> bool| {
        let of = bins.iter().filter(|bin| keep(bin.0));
        of.fold((0_i128, 0_i128), |(n, sum), bin| {
            (
                n + i128::from(bin.1),
                sum + i128::from(bin.0) * i128::from(bin.1),
            )
        })
    };
    let (n0, sum0) = class(&|gray| gray < threshold);
    let (n1, sum1) = class(&|gray| gray >= threshold);
    if n0 == 0 || n1 == 0 {
        return (0, 1);
    }
    let difference = (n0 * sum1 - n1 * sum0).unsigned_abs();
    (difference * difference, (n0 * n1) as u128)
}

#[test]
fn otsu_by_its_definition() {
    let mut random = Random(1979);
    let mut ties = 0;
    for _ in 0..3000 {
        let bins = random_bins(&mut random, 40);
        // All thresholds in exact fractions; the first of the greatest.
        let mut best = (0, (0, 1));
        for threshold in 0..=256 {
            let value = between(&bins, threshold);
            let difference = (value.0 * best.1.1).cmp(&(best.1.0 * value.1));
            let below = |threshold| bins.iter().filter(|bin| bin.0 < threshold).count();
            let same_split = below(threshold) == below(best.0);
            match difference {
                std::cmp::Ordering::Greater => best = (threshold, value),
                std::cmp::Ordering::Equal if value.0 > 0 && !same_split => ties += 1,
                _ => {}
            }
        }
        for found in [histogram::<u8>(&bins), histogram::<u16>(&bins)] {
            assert_eq!(Threshold::Otsu.of(&found).unwrap(), best.0, "{bins:?}");
            let two = Threshold::MultiOtsu { classes: 2 };
            assert_eq!(two.of(&found).unwrap(), best.0, "{bins:?}");
        }
    }
    assert!(ties > 0, "no true tie among the cases");
}

#[test]
fn multi_otsu_by_its_definition() {
    let mut random = Random(1980);
    for case in 0..400 {
        let bins = random_bins(&mut random, 14);
        let total: f64 = bins.iter().map(|bin| f64::from(bin.1)).sum();
        let mean = bins
            .iter()
            .map(|&(g, n)| f64::from(g) * f64::from(n))
            .sum::<f64>()
            / total;
        let class = |from: usize, to: usize| {
            let n: f64 = bins[from..to].iter().map(|bin| f64::from(bin.1)).sum();
            let sum: f64 = bins[from..to]
                .iter()
                .map(|&(g, n)| (f64::from(g) - mean) * f64::from(n))
                .sum();
            sum * sum / n
        };
        let b = bins.len();
        for classes in [3, 4] {
            // The best value for each place of the top cut.
            let mut of_top = vec![f64::NEG_INFINITY; b];
            if b <= classes {
                of_top[b - 1] = 1.0;
            }
            for second in 1..b {
                for (top, best) in of_top.iter_mut().enumerate().skip(second + 1) {
                    if classes == 3 {
                        let value = class(0, second) + class(second, top) + class(top, b);
                        *best = best.max(value);
                        continue;
                    }
                    for first in 1..second {
                        let value = class(0, first)
                            + class(first, second)
                            + class(second, top)
                            + class(top, b);
                        *best = best.max(value);
                    }
                }
            }
            let best = of_top.iter().fold(f64::NEG_INFINITY, |a, &b| a.max(b));
            let method = Threshold::MultiOtsu {
                classes: classes as u8,
            };
            let found = method.of(&histogram::<u8>(&bins)).unwrap();
            let top = bins.iter().position(|bin| bin.0 == found).unwrap();
            assert!(of_top[top] >= best * (1.0 - 1e-12), "case {case}: {bins:?}");
        }
    }
}

#[test]
fn triangle_by_its_definition() {
    let mut random = Random(1977);
    for _ in 0..3000 {
        let bins = random_bins(&mut random, 60);
        let found = Threshold::Triangle.of(&histogram::<u8>(&bins)).unwrap();
        let (first, last) = (bins[0].0, bins[bins.len() - 1].0);
        let most = bins.iter().map(|bin| bin.1).max().unwrap();
        let peak = bins.iter().find(|bin| bin.1 == most).unwrap().0;
        let dark = peak - first > last - peak;
        let end = if dark { first } else { last };
        // How far below the line from (end, 0) to (peak, most) a bin's top lies, at right angles.
        let length = f64::from(peak) - f64::from(end);
        let distance = |gray: u32| {
            let count = bins.iter().find(|bin| bin.0 == gray).map_or(0, |bin| bin.1);
            let along = f64::from(gray) - f64::from(end);
            let line = f64::from(most) * along / length;
            (line - f64::from(count)) * length.abs() / length.hypot(f64::from(most))
        };
        let (low, high) = (peak.min(end), peak.max(end));
        let farthest = (low..=high).map(distance).fold(0.0, f64::max);
        let chosen = found - 1;
        assert!((low..=high).contains(&chosen));
        if chosen != low || farthest > 1e-9 {
            assert!(distance(chosen) > farthest - 1e-9, "{bins:?}: {found}");
        } else {
            assert!(farthest < 1e-9, "{bins:?}: {found}");
        }
    }
}

#[test]
fn other_libraries() {
    let path = concat!(
        env!("CARGO_MANIFEST_DIR"),
        "/../../tests/reference/spot_thresholds.txt"
    );
    let text = std::fs::read_to_string(path).unwrap();
    let (mut cases, mut otherwise) = (0, Vec::new());
    for line in text.lines().filter(|line| !line.starts_with('#')) {
        let cells: Vec<&str> = line.split("; ").collect();
        let bins: Vec<(u32, u32)> = cells[8]
            .split(' ')
            .map(|bin| bin.split_once(':').unwrap())
            .map(|(gray, count)| (gray.parse().unwrap(), count.parse().unwrap()))
            .collect();
        let histogram = if cells[1] == "8" {
            histogram::<u8>(&bins)
        } else {
            histogram::<u16>(&bins)
        };
        let kept = |threshold: u32| histogram.at_least(threshold);
        let theirs = |cell: usize| cells[cell].parse::<u32>().ok();
        let otsu = Threshold::Otsu.of(&histogram).unwrap();
        // They keep what is above, so theirs is one less; where gray values are missing, any number between keeps the same.
        for cell in [2, 3] {
            assert_eq!(kept(otsu), kept(theirs(cell).unwrap() + 1), "{line}");
        }
        assert_eq!(otsu, theirs(2).unwrap() + 1, "{line}");
        let triangle = Threshold::Triangle.of(&histogram).unwrap();
        assert_eq!(kept(triangle), kept(theirs(5).unwrap() + 1), "{line}");
        // OpenCV draws the line to one gray value past the end.
        if let Some(theirs) = theirs(4) {
            assert!(triangle.abs_diff(theirs + 1) <= 1, "{line}");
        }
        for (cell, classes) in [(6, 3), (7, 4)] {
            if let Some(theirs) = theirs(cell) {
                let ours = Threshold::MultiOtsu { classes }.of(&histogram).unwrap();
                if kept(ours) != kept(theirs + 1) {
                    otherwise.push((cells[0], classes, ours, theirs));
                }
            }
        }
        cases += 1;
    }
    assert_eq!(cases, 18);
    // scikit-image adds in single precision: its 194 misses the greatest variance by 2 parts in 10⁸.
    assert_eq!(otherwise, [("dark mark on white", 3, 193, 193)]);
}

#[test]
fn calls_that_make_no_sense() {
    let flat = histogram::<u8>(&[(9, 5)]);
    for classes in [0, 1, 5, 255] {
        let error = Threshold::MultiOtsu { classes }.of(&flat).unwrap_err();
        assert!(matches!(error, SpotError::BadOption { .. }));
        assert_eq!(
            error.to_string(),
            format!(
                "the number of classes of the multi-level threshold must be 2, 3 or 4, got {classes}"
            )
        );
    }
    assert_eq!(Threshold::Fixed(300).of(&flat).unwrap(), 300);
    assert_eq!((flat.at_least(300), flat.range()), (0, Some((9, 9))));
}

#[test]
fn large_pictures_are_counted_like_small_ones() {
    // Large enough for pairs to be counted; even stretches, noise, an odd width.
    let mut random = Random(3);
    for (width, height) in [(601, 301), (513, 257), (1 << 17, 1), (3, 50_000)] {
        let mut pixels = vec![0_u8; width * height];
        for (at, pixel) in pixels.iter_mut().enumerate() {
            *pixel = if at % 1000 < 400 {
                (at / 1000) as u8
            } else {
                random.below(256) as u8
            };
        }
        let mut expected = vec![0_u32; 256];
        for &pixel in &pixels {
            expected[usize::from(pixel)] += 1;
        }
        let view = View::new(&pixels, width, height).unwrap();
        for _ in 0..2 {
            assert_eq!(Histogram::of(view).unwrap().counts(), expected);
        }
        let words: Vec<u16> = pixels.iter().map(|&p| u16::from(p) * 257).collect();
        let view = View::new(&words, width, height).unwrap();
        let found = Histogram::of(view).unwrap();
        assert!(found.counts().iter().step_by(257).eq(&expected));
    }
}
