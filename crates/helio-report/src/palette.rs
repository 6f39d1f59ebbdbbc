//! Colours.

use helio_core::Status;

/// Matplotlib's viridis at equal steps.
const VIRIDIS: [u32; 9] = [
    0x440154, 0x472d7b, 0x3b528b, 0x2c728e, 0x21918c, 0x28ae80, 0x5ec962, 0xaddc30, 0xfde725,
];

/// ColorBrewer's RdBu from blue to red, for values about zero.
const BLUE_RED: [u32; 9] = [
    0x2166ac, 0x4393c3, 0x92c5de, 0xd1e5f0, 0xf7f7f7, 0xfddbc7, 0xf4a582, 0xd6604d, 0xb2182b,
];

/// Matplotlib's twilight at equal steps, its light ends darkened to stand out from white paper.
const TWILIGHT: [u32; 17] = [
    0xb0a3c4, 0x9eabc0, 0x86a4bc, 0x7297c1, 0x6276ba, 0x5e51ad, 0x592a8f, 0x45135c, 0x2f1436,
    0x4a1342, 0x741e4f, 0x983550, 0xb25652, 0xc27c63, 0xc4957c, 0xb99aa6, 0xb0a3c4,
];

/// Okabe and Ito's colours, for curves.
pub(crate) const CURVES: [&str; 7] = [
    "#0072b2", "#d55e00", "#009e73", "#cc79a7", "#e69f00", "#56b4e9", "#222222",
];

/// What has no value.
pub(crate) const NOTHING: &str = "#dedede";
pub(crate) const NOTHING_RGB: [u8; 3] = [0xde; 3];

/// A colour for `part` in 0..=1; cyclic palettes end where they begin.
pub(crate) fn value(cyclic: bool, part: f64) -> String {
    hex(between(if cyclic { &TWILIGHT } else { &VIRIDIS }, part))
}

/// Red, green and blue for `part` in 0..=1: viridis, or for signed values blue, white and red.
pub(crate) fn rgb(signed: bool, part: f64) -> [u8; 3] {
    between(if signed { &BLUE_RED } else { &VIRIDIS }, part)
}

pub(crate) fn hex([red, green, blue]: [u8; 3]) -> String {
    format!("#{red:02x}{green:02x}{blue:02x}")
}

fn between(stops: &[u32], part: f64) -> [u8; 3] {
    let place = part.clamp(0.0, 1.0) * (stops.len() - 1) as f64;
    let low = (place as usize).min(stops.len() - 2);
    let between = place - low as f64;
    [16, 8, 0].map(|shift| {
        let at = |stop: u32| f64::from(stop >> shift & 0xff);
        (at(stops[low]) + (at(stops[low + 1]) - at(stops[low])) * between).round() as u8
    })
}

pub(crate) fn status(status: Status) -> &'static str {
    match status {
        Status::Ok => "#009e73",
        Status::Unreachable => "#d55e00",
        Status::OutsideLimits => "#e69f00",
        Status::SunBelowHorizon => "#999999",
        Status::SunOpposesAim => "#cc79a7",
        Status::AimAtPivot => "#222222",
        Status::MissesTarget => "#56b4e9",
    }
}
