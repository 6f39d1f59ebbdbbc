//! How a spot is found, from the words of those who ask.

use helio_spot::{Board, RobustOptions, StandardOptions, Threshold};

/// How spots are found.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub enum SpotMethod {
    /// Appendix A of T/GRLM 02-2014 as printed, within the rectangle about the target.
    Standard(StandardOptions),
    /// Centre of mass of the light that the spot adds to the target.
    Robust(RobustOptions),
}

/// Options of finding spots, some of which are for one method alone.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct SpotWords {
    /// Threshold of the standard, as [`parse_threshold`] reads it; Otsu's unless given.
    pub threshold: Option<Threshold>,
    /// Where the spot is expected: `u_m`, `v_m` and one standard deviation \[m\], a tenth of the target unless given.
    pub expected: Option<(f64, f64, Option<f64>)>,
    /// Gray value from which on the camera cannot tell more; that of the format unless given.
    pub white: Option<u32>,
}

/// An option given with a method that has no use for it.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[error("--{option} is for --method {method}; {why}")]
pub struct UselessOption {
    /// Its name.
    pub option: &'static str,
    /// The method that it is for.
    pub method: &'static str,
    /// What the other does instead.
    pub why: &'static str,
}

impl SpotMethod {
    /// The method of the standard.
    ///
    /// # Errors
    /// [`UselessOption`] for what only the robust method knows.
    pub fn standard(words: &SpotWords) -> Result<Self, UselessOption> {
        let other = [
            ("expected", words.expected.is_some()),
            ("white", words.white.is_some()),
        ];
        if let Some((option, _)) = other.into_iter().find(|(_, given)| *given) {
            return Err(UselessOption {
                option,
                method: "robust",
                why: "the standard takes the densest square",
            });
        }
        let threshold = words.threshold.unwrap_or_default();
        Ok(Self::Standard(StandardOptions::with_threshold(threshold)))
    }

    /// The robust method for spots on a target.
    ///
    /// # Errors
    /// [`UselessOption`] for a threshold.
    ///
    /// ```
    /// use helio_io::{SpotMethod, SpotWords};
    /// use helio_spot::{Board, Marks};
    /// let board = Board { width_m: 8.0, height_m: 7.0, marks: Marks::FourCorners };
    /// let words = SpotWords { expected: Some((0.5, 0.0, None)), ..SpotWords::default() };
    /// let SpotMethod::Robust(options) = SpotMethod::robust(&words, &board)? else { unreachable!() };
    /// assert_eq!(options.expected, Some((0.5, 0.0, 0.1 * 7.0)));
    /// assert!(SpotMethod::standard(&words).is_err());
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn robust(words: &SpotWords, board: &Board) -> Result<Self, UselessOption> {
        if words.threshold.is_some() {
            return Err(UselessOption {
                option: "threshold",
                method: "standard",
                why: "robust takes its own from the light around the spot",
            });
        }
        let tenth_m = 0.1 * board.width_m.min(board.height_m);
        let options = RobustOptions {
            expected: words
                .expected
                .map(|(u_m, v_m, sigma_m)| (u_m, v_m, sigma_m.unwrap_or(tenth_m))),
            white: words.white,
        };
        Ok(Self::Robust(options))
    }
}

/// A threshold as people write it: `otsu`, `triangle`, `fixed:N` (a gray value) or `multi:N` (the brightest of N classes).
///
/// # Errors
/// In words, what is wanted.
///
/// ```
/// use helio_io::parse_threshold;
/// use helio_spot::Threshold;
/// assert_eq!(parse_threshold("fixed:300"), Ok(Threshold::Fixed(300)));
/// assert!(parse_threshold("multi:5").unwrap_err().contains("2 to 4 classes"));
/// ```
pub fn parse_threshold(text: &str) -> Result<Threshold, String> {
    let wanted = "wanted otsu, triangle, fixed:N (a gray value) or multi:N (2 to 4 classes)";
    match text.split_once(':') {
        None if text == "otsu" => Ok(Threshold::Otsu),
        None if text == "triangle" => Ok(Threshold::Triangle),
        Some(("fixed", gray)) => match gray.parse::<u32>() {
            Ok(gray) if gray <= 65_535 => Ok(Threshold::Fixed(gray)),
            _ => Err(format!(
                "{wanted}; a gray value is a whole number in 0..=65535"
            )),
        },
        Some(("multi", classes)) => match classes.parse::<u8>() {
            Ok(classes) if (2..=4).contains(&classes) => Ok(Threshold::MultiOtsu { classes }),
            _ => Err(wanted.into()),
        },
        _ => Err(wanted.into()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn words_are_read_or_refused_with_what_is_wanted() {
        assert_eq!(
            parse_threshold("multi:3"),
            Ok(Threshold::MultiOtsu { classes: 3 })
        );
        for text in ["multi:5", "fixed:", "fixed:-1", "Otsu", "otsu:1", ""] {
            let said = parse_threshold(text).unwrap_err();
            assert!(said.contains("wanted otsu"), "{text}");
        }
    }
}
