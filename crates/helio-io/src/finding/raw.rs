//! Raw video, from the words of those who ask.

use helio_spot::RawFormat;

/// Frames of raw video.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub struct RawFrames {
    /// Pixels of a row.
    pub width: usize,
    /// Rows.
    pub height: usize,
    /// How a pixel is stored.
    pub format: RawFormat,
}

/// Size and format of raw video as people write it: `1920x1080` of 8 bit, `1920x1080:gray8`, `1920x1080:gray16le`.
///
/// # Errors
/// In words, what is wanted.
///
/// ```
/// use helio_spot::RawFormat;
/// let video = helio_io::parse_raw("1920x1080:gray16le")?;
/// assert_eq!((video.width, video.format), (1920, RawFormat::Gray16Le));
/// assert!(helio_io::parse_raw("5x5:rgb24").unwrap_err().contains("gray8 or gray16le"));
/// # Ok::<(), String>(())
/// ```
pub fn parse_raw(text: &str) -> Result<RawFrames, String> {
    let (text, format) = match text.split_once(':') {
        None => (text, RawFormat::Gray8),
        Some((text, "gray8" | "gray")) => (text, RawFormat::Gray8),
        Some((text, "gray16le")) => (text, RawFormat::Gray16Le),
        Some(_) => return Err("wanted gray8 or gray16le after the colon".into()),
    };
    let (width, height) = parse_size(text)?;
    Ok(RawFrames {
        width,
        height,
        format,
    })
}

/// Pixels of a frame as people write them: `768x576`.
///
/// # Errors
/// In words, what is wanted.
///
/// ```
/// assert_eq!(helio_io::parse_size("768x576"), Ok((768, 576)));
/// assert!(helio_io::parse_size("0x5").is_err());
/// ```
pub fn parse_size(text: &str) -> Result<(usize, usize), String> {
    let wanted = "wanted WIDTHxHEIGHT in pixels, such as 768x576";
    let (width, height) = text.split_once('x').ok_or(wanted)?;
    let side = |text: &str| match text.parse::<usize>() {
        Ok(side) if (1..=65_535).contains(&side) => Ok(side),
        _ => Err(format!("{wanted}; each in 1..=65535")),
    };
    Ok((side(width)?, side(height)?))
}
