//! Gray from colours.

/// BT.601 luma of 8-bit pixels of `N` samples, red, green and blue first: 0.299 R + 0.587 G + 0.114 B, rounded, halves up.
pub(super) fn luma8<const N: usize>(samples: &[u8]) -> Vec<u8> {
    let (pixels, _) = samples.as_chunks::<N>();
    pixels
        .iter()
        .map(|p| luma(p.map(u32::from)) as u8)
        .collect()
}

/// The same of 16-bit pixels.
pub(super) fn luma16<const N: usize>(samples: &[u16]) -> Vec<u16> {
    let (pixels, _) = samples.as_chunks::<N>();
    pixels
        .iter()
        .map(|p| luma(p.map(u32::from)) as u16)
        .collect()
}

#[inline(always)]
fn luma<const N: usize>(pixel: [u32; N]) -> u32 {
    (299 * pixel[0] + 587 * pixel[1] + 114 * pixel[2] + 500) / 1000
}
