//! The method of the standard on any picture: width, threshold, then pixels.
#![no_main]

use helio_spot::{Scratch, StandardOptions, Threshold, View, standard};
use libfuzzer_sys::fuzz_target;

fuzz_target!(|bytes: &[u8]| {
    let [width, method, pixels @ ..] = bytes else {
        return;
    };
    let width = usize::from(*width);
    let height = pixels.len().checked_div(width).unwrap_or(0).min(64);
    let Ok(view) = View::new(&pixels[..width * height], width, height) else {
        return;
    };
    let threshold = match method {
        0 => Threshold::Otsu,
        1 => Threshold::Triangle,
        2..=4 => Threshold::MultiOtsu { classes: *method },
        gray => Threshold::Fixed(u32::from(*gray)),
    };
    let options = StandardOptions::with_threshold(threshold);
    let Ok(spot) = standard(view, &options, &mut Scratch::default()) else {
        panic!("a small picture is refused");
    };
    // Any one window has no greater sum.
    if spot.maximisers > 0 {
        let size = spot.window_px as usize;
        let kept = |row: usize, column: usize| {
            let gray = view.row(row)[column];
            if u32::from(gray) >= spot.threshold {
                u64::from(gray)
            } else {
                0
            }
        };
        for (top, left) in [
            (0, 0),
            (height.saturating_sub(size), width.saturating_sub(size)),
        ] {
            let sum: u64 = (top..height.min(top + size))
                .flat_map(|row| (left..width.min(left + size)).map(move |column| (row, column)))
                .map(|(row, column)| kept(row, column))
                .sum();
            assert!(sum <= spot.window_sum);
        }
        assert!((0.0..width as f64).contains(&spot.x_px));
        assert!((0.0..height as f64).contains(&spot.y_px));
    }
});
