//! The method of the standard against the sums of (A.3) written out.
#![allow(clippy::unwrap_used, reason = "tests fail")]

use helio_spot::{
    Flags, Gray, Scratch, SpotStatus, StandardOptions, StandardSpot, Threshold, View, standard,
};

/// SplitMix64.
struct Random(u64);

impl Random {
    fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    }

    fn below(&mut self, end: u64) -> u64 {
        self.next() % end
    }

    fn between(&mut self, low: usize, high: usize) -> usize {
        low + self.below((high - low + 1) as u64) as usize
    }
}

/// The sums of (A.3), pixel by pixel, rows and columns counted from 1 as printed.
#[derive(Debug, PartialEq)]
struct Direct {
    area: u64,
    side: f64,
    clamped: bool,
    size: i64,
    best: u64,
    /// From 1.
    maximisers: Vec<(i64, i64)>,
}

fn direct(image: &[Vec<u32>], threshold: u32) -> Direct {
    let (h, w) = (image.len() as i64, image[0].len() as i64);
    let kept = |i: i64, j: i64| {
        if i < 1 || j < 1 {
            return 0; // row 0 and column 0 do not exist
        }
        assert!(
            i <= h && j <= w,
            "the printed range ends inside the picture"
        );
        let g = image[i as usize - 1][j as usize - 1];
        if g >= threshold { u64::from(g) } else { 0 }
    };
    let area = image.iter().flatten().filter(|&&g| g >= threshold).count() as u64;
    let shorter = h.min(w) as f64;
    let clamped = (area as f64).sqrt() >= shorter;
    let side = if clamped {
        shorter - 1.0
    } else {
        (area as f64).sqrt()
    };
    let half = (side / 2.0).floor() as i64;
    let (mut best, mut maximisers, mut size) = (0, Vec::new(), 0);
    for x in half + 1..=h - half {
        for y in half + 1..=w - half {
            let mut f = 0;
            let from = |x: i64| (x as f64 - side / 2.0).floor() as i64;
            let to = |x: i64| (x as f64 + side / 2.0).floor() as i64;
            size = to(x) - from(x) + 1;
            for i in from(x)..=to(x) {
                for j in from(y)..=to(y) {
                    f += kept(i, j);
                }
            }
            if f > best {
                best = f;
                maximisers.clear();
            }
            if f == best {
                maximisers.push((x, y));
            }
        }
    }
    Direct {
        area,
        side,
        clamped,
        size,
        best,
        maximisers,
    }
}

fn mean(values: impl ExactSizeIterator<Item = i64>) -> f64 {
    let n = values.len() as f64;
    values.sum::<i64>() as f64 / n
}

fn agrees(image: &[Vec<u32>], white: u32, spot: &StandardSpot, context: &str) {
    let expected = direct(image, spot.threshold);
    assert_eq!(spot.area_px, expected.area, "{context}");
    assert_eq!(spot.side_px.to_bits(), expected.side.to_bits(), "{context}");
    assert_eq!(
        spot.flags.contains(Flags::WINDOW_CLAMPED),
        expected.clamped,
        "{context}"
    );
    if expected.best == 0 {
        assert_eq!(spot.status, SpotStatus::Empty, "{context}");
        assert!(
            spot.row.is_nan() && spot.y_px.is_nan() && spot.centroid_x_px.is_nan(),
            "{context}"
        );
        assert_eq!((spot.window_sum, spot.maximisers), (0, 0), "{context}");
        return;
    }
    assert_eq!(spot.status, SpotStatus::Ok, "{context}");
    assert_eq!(i64::from(spot.window_px), expected.size, "{context}");
    assert_eq!(spot.window_sum, expected.best, "{context}");
    assert_eq!(
        spot.maximisers,
        expected.maximisers.len() as u64,
        "{context}"
    );
    let row = mean(expected.maximisers.iter().map(|at| at.0 - 1));
    let column = mean(expected.maximisers.iter().map(|at| at.1 - 1));
    assert_eq!((spot.row, spot.column), (row, column), "{context}");
    // The middle of rows floor(x - l/2) ..= floor(x + l/2).
    let even = expected.size % 2 == 0;
    let lead = if even { 0.5 } else { 0.0 };
    assert_eq!(
        (spot.y_px, spot.x_px),
        (row - lead, column - lead),
        "{context}"
    );
    let kept = image.iter().flatten().filter(|&&g| g >= spot.threshold);
    let saturated = kept.clone().any(|&g| g == white);
    assert_eq!(
        spot.flags.contains(Flags::SATURATED),
        saturated,
        "{context}"
    );
    let (mut sum, mut x, mut y) = (0.0, 0.0, 0.0);
    for (i, line) in image.iter().enumerate() {
        for (j, &g) in line
            .iter()
            .enumerate()
            .filter(|(_, g)| **g >= spot.threshold)
        {
            let g = f64::from(g);
            sum += g;
            x += g * j as f64;
            y += g * i as f64;
        }
    }
    assert!((spot.centroid_x_px - x / sum).abs() < 1e-9, "{context}");
    assert!((spot.centroid_y_px - y / sum).abs() < 1e-9, "{context}");
}

fn check<P: Gray + TryFrom<u32>>(
    image: &[Vec<u32>],
    threshold: Threshold,
    scratch: &mut Scratch,
    context: &str,
) where
    P::Error: std::fmt::Debug,
{
    let gray = |g: u32| P::try_from(g).unwrap();
    let (h, w) = (image.len(), image[0].len());
    let pixels: Vec<P> = image.iter().flatten().map(|&g| gray(g)).collect();
    let options = StandardOptions::with_threshold(threshold);
    let spot = standard(View::new(&pixels, w, h).unwrap(), &options, scratch).unwrap();
    agrees(image, P::WHITE, &spot, context);
    // The same inside a larger picture, whose other pixels are white.
    let (left, top, right, bottom) = (3, 2, 5, 1);
    let wide = left + w + right;
    let mut larger = vec![gray(P::WHITE); wide * (top + h + bottom)];
    for (row, line) in image.iter().enumerate() {
        for (column, &g) in line.iter().enumerate() {
            larger[(top + row) * wide + left + column] = gray(g);
        }
    }
    let larger = View::new(&larger, wide, top + h + bottom).unwrap();
    let part = larger.part(left, top, w, h).unwrap();
    let of_part = standard(part, &options, scratch).unwrap();
    assert_eq!(format!("{of_part:?}"), format!("{spot:?}"), "{context}");
}

/// Noise, few gray values, blobs, single pixels.
fn image(random: &mut Random, h: usize, w: usize, white: u32) -> Vec<Vec<u32>> {
    let kind = random.below(5);
    let levels = [2, 3, 16, u64::from(white) + 1][random.below(4) as usize];
    let step = white / (levels as u32 - 1);
    let (cx, cy) = (random.below(w as u64) as f64, random.below(h as u64) as f64);
    let radius = 0.5 + random.below(1000) as f64 / 1000.0 * h.min(w) as f64 / 2.0;
    (0..h)
        .map(|row| {
            (0..w)
                .map(|column| {
                    let noise = random.below(levels) as u32 * step;
                    let distance = (column as f64 - cx).hypot(row as f64 - cy);
                    match kind {
                        0 => noise,
                        1 => noise / 8 + if distance <= radius { white / 2 } else { 0 },
                        2 => (f64::from(white) * (-(distance / radius).powi(2)).exp()) as u32,
                        3 if random.below(7) == 0 => noise,
                        3 => 0,
                        _ => (noise / 4).max(if distance <= radius { white } else { 0 }),
                    }
                })
                .collect()
        })
        .collect()
}

#[test]
fn equals_the_sums_written_out() {
    let mut random = Random(20140821);
    let mut scratch = Scratch::default();
    let mut count = 0;
    for h in 3..=24 {
        for w in 3..=24 {
            let white = [255, 65_535][(h + w) % 2];
            let image = image(&mut random, h, w, white);
            let threshold = match random.below(4) {
                0 => Threshold::Fixed(random.below(u64::from(white) + 2) as u32),
                1 => Threshold::Triangle,
                2 => Threshold::MultiOtsu {
                    classes: 2 + random.below(3) as u8,
                },
                _ => Threshold::Otsu,
            };
            let context = format!("{w} x {h}, {threshold:?}");
            if white == 255 {
                check::<u8>(&image, threshold, &mut scratch, &context);
            } else {
                check::<u16>(&image, threshold, &mut scratch, &context);
            }
            count += 1;
        }
    }
    assert_eq!(count, 484);
    // Larger than the blocks that bound the search, and much wider than high.
    for k in 0..120 {
        let (h, w) = if k % 3 == 0 {
            (random.between(1, 9), random.between(1, 300))
        } else {
            (random.between(25, 70), random.between(25, 90))
        };
        let image = image(&mut random, h, w, 255);
        let context = format!("{w} x {h}, larger, {k}");
        check::<u8>(&image, Threshold::Otsu, &mut scratch, &context);
        check::<u16>(&image, Threshold::Fixed(200), &mut scratch, &context);
    }
}

#[test]
fn every_window_from_one_pixel_to_the_whole_picture() {
    // `area` white pixels, in reading order or scattered: l goes through every even and odd whole number and
    // what lies between.
    let mut random = Random(7);
    let mut scratch = Scratch::default();
    for (h, w) in [
        (9, 9),
        (10, 10),
        (9, 14),
        (15, 8),
        (1, 1),
        (1, 7),
        (2, 2),
        (2, 5),
    ] {
        for area in 1..=h * w {
            for scattered in [false, true] {
                let mut left = area;
                let mut image = vec![vec![0; w]; h];
                for at in 0..h * w {
                    let rest = (h * w - at) as u64;
                    if left > 0 && (!scattered || random.below(rest) < left as u64) {
                        image[at / w][at % w] = 255;
                        left -= 1;
                    }
                }
                let context = format!("{w} x {h}, {area} white, scattered {scattered}");
                check::<u8>(&image, Threshold::Fixed(255), &mut scratch, &context);
            }
        }
    }
}

#[test]
fn flat_pictures() {
    let mut scratch = Scratch::default();
    for (h, w) in [(1, 1), (3, 3), (4, 4), (7, 30), (33, 20)] {
        for gray in [0_u32, 1, 128, 255] {
            let image = vec![vec![gray; w]; h];
            for threshold in [
                Threshold::Fixed(0),
                Threshold::Fixed(gray),
                Threshold::Fixed(255),
            ] {
                check::<u8>(&image, threshold, &mut scratch, "flat");
                check::<u16>(&image, threshold, &mut scratch, "flat");
            }
            // Nothing parts a flat picture: nothing is kept, no position is given.
            let pixels = vec![gray as u8; h * w];
            let view = View::new(&pixels, w, h).unwrap();
            for threshold in [
                Threshold::Otsu,
                Threshold::Triangle,
                Threshold::MultiOtsu { classes: 3 },
            ] {
                let options = StandardOptions::with_threshold(threshold);
                let spot = standard(view, &options, &mut scratch).unwrap();
                assert_eq!((spot.status, spot.threshold), (SpotStatus::Empty, gray + 1));
                assert_eq!(spot.area_px, 0);
                assert!(spot.x_px.is_nan() && spot.row.is_nan());
            }
        }
        // All saturated, with a threshold that keeps them: the only place is the picture's middle.
        let pixels = vec![255_u8; h * w];
        let options = StandardOptions::with_threshold(Threshold::Fixed(200));
        let view = View::new(&pixels, w, h).unwrap();
        let spot = standard(view, &options, &mut scratch).unwrap();
        let middle = ((w - 1) as f64 / 2.0, (h - 1) as f64 / 2.0);
        assert_eq!((spot.centroid_x_px, spot.centroid_y_px), middle);
        assert_eq!((spot.x_px, spot.y_px), middle);
        assert!(
            spot.flags
                .contains(Flags::SATURATED.with(Flags::WINDOW_CLAMPED))
        );
        assert_eq!(spot.side_px, (h.min(w) - 1) as f64);
        assert_eq!(spot.window_px as usize, h.min(w));
    }
}
