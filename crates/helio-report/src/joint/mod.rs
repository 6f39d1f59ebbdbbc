//! The page of a field calibrated as one: what its heliostats share, how they differ, how their zero points
//! move, and whether the stated uncertainty holds.
//!
//! [`JointPage`] is plain numbers, filled by [`JointPage::of_run`] or by hand; [`joint_page`] turns it into one HTML file
//! that needs nothing from outside. Angles are milliradians, of the mirror or, where said, of the beam. A
//! number that does not exist is NaN or `None` and is never drawn. Its size is bounded whatever the size of
//! the field: figures of all records count them, figures of single heliostats show at most [`TRACKS`].

mod causes;
mod field;
mod foretold;
mod of_run;
mod page;
mod zero;

/// How many heliostats' zero points are drawn at most: those missed farthest, and others evenly chosen.
pub const TRACKS: usize = 24;

/// After so many records of its own a heliostat is foretold mainly from them; the first are foretold from the
/// field, and would drown the others in a mean of squares.
const SETTLED: usize = 6;

/// What a joint calibration says about a field.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct JointPage {
    /// Heading.
    pub title: String,
    /// When the page was made, as text; this crate has no clock.
    pub generated_utc: String,
    /// What made it, such as "helio-rs 0.4.0".
    pub version: String,
    /// What the reader should know of the run, each with its name: files, options.
    pub facts: Vec<(String, String)>,
    /// What else was found about the field, in sentences; the page has its own on what it holds.
    pub findings: Vec<String>,
    /// The causes that were looked for, in any order.
    pub causes: Vec<CauseLine>,
    /// How records scatter and zero points wander, one number a line.
    pub noise: Vec<NumberLine>,
    /// Names of what each heliostat has of its own: six angles, then causes of its own.
    pub unknowns: Vec<String>,
    /// Means of them over the field \[mrad\].
    pub mean_mrad: Vec<f64>,
    /// Their covariance over the field \[mrad²\], row by row.
    pub covariance_mrad2: Vec<f64>,
    /// Every heliostat, in the order of the field.
    pub heliostats: Vec<HeliostatLine>,
    /// Whether the field is followed: zero points are then those known after each record, less those at rest before
    /// the first; else those that all records tell, less those at rest after the last.
    pub followed: bool,
}

impl JointPage {
    /// Standard deviation of an unknown over the field \[mrad\], NaN where it is not known.
    fn spread_mrad(&self, unknown: usize) -> f64 {
        let n = self.unknowns.len();
        let variance = self.covariance_mrad2.get(unknown * n + unknown);
        variance.map_or(f64::NAN, |v| v.sqrt())
    }
}

/// A cause that a field may have in common.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct CauseLine {
    /// Its name in words, with its target where it is one's.
    pub name: String,
    /// Of what it has one value: heliostat, target, field.
    pub scope: String,
    /// Unit of its numbers, for people: mrad, mm, s.
    pub unit: String,
    /// Its value; of a cause of each heliostat the field's mean.
    pub value: f64,
    /// One standard deviation of that.
    pub sigma: f64,
    /// Standard deviation of heliostats about it, where they may differ.
    pub spread: Option<f64>,
    /// Logarithm of how much likelier the records are with it than without.
    pub log_evidence: f64,
    /// Whether the field's records speak for it; if not it was held at zero.
    pub admitted: bool,
    /// Root mean square over the records of how far its value turns the beam \[mrad\].
    pub turn_mrad: Option<f64>,
    /// The same of what is left where each heliostat's angles make up for as much as they can \[mrad\].
    pub worth_mrad: Option<f64>,
}

/// A number with its name.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct NumberLine {
    /// What it is, in words.
    pub name: String,
    /// The number.
    pub value: f64,
    /// Its unit.
    pub unit: String,
}

/// What a joint calibration says about one heliostat.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct HeliostatLine {
    /// Its name.
    pub id: String,
    /// How many records it had.
    pub observations: usize,
    /// What it has of its own, in the order of [`JointPage::unknowns`] \[mrad\].
    pub values_mrad: Vec<f64>,
    /// One standard deviation of each \[mrad\].
    pub sigmas_mrad: Vec<f64>,
    /// Its records, in time: the last of its observations. A caller may leave them out for a part of a very large
    /// field.
    pub records: Vec<RecordLine>,
}

/// One record, held against what was believed from the heliostat's records before it.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct RecordLine {
    /// What the reader finds it by, such as "row 17"; may be empty.
    pub label: String,
    /// When, in nanoseconds from 1970 UTC, where known.
    pub unix_ns: Option<i64>,
    /// Seen less foretold, across the beam \[mrad\].
    pub miss_mrad: [f64; 2],
    /// Covariance of that, the record's own scatter included \[mrad²\]: first, mixed, second.
    pub covariance_mrad2: [f64; 3],
    /// Zero points of both axes less those at rest, see [`JointPage::followed`] \[mrad\].
    pub zero_mrad: [f64; 2],
    /// One standard deviation of them \[mrad\].
    pub zero_sigma_mrad: [f64; 2],
    /// Whether it was not believed.
    pub outlier: bool,
    /// Whether the zero point of either axis was taken to have jumped just before it.
    pub jumped: [bool; 2],
    /// Whether other accounts of it are left, so that records to come may say that no zero point jumped.
    pub in_doubt: bool,
}

impl RecordLine {
    /// Length of the miss \[mrad\].
    fn beam_mrad(&self) -> f64 {
        self.miss_mrad[0].hypot(self.miss_mrad[1])
    }

    /// The miss expected \[mrad\], root of the mean square.
    fn expected_mrad(&self) -> f64 {
        (self.covariance_mrad2[0] + self.covariance_mrad2[2]).sqrt()
    }

    /// Probability of a miss inside the ellipse through this one, if what is stated holds; NaN where the
    /// covariance is none.
    fn inside(&self) -> f64 {
        let [a, b, c] = self.covariance_mrad2;
        let [x, y] = self.miss_mrad;
        let root = a.sqrt();
        let first = x / root;
        let second = (y - b / root * first) / (c - b * b / a).sqrt();
        -(-0.5 * (first * first + second * second)).exp_m1()
    }

    /// Whether it was foretold at all, in finite numbers.
    fn is_foretold(&self) -> bool {
        self.inside().is_finite() && self.beam_mrad().is_finite()
    }

    /// Whether it was taken as it is: neither an outlier nor after a jump, both of which are known only from
    /// the record itself and those after it.
    fn is_plain(&self) -> bool {
        !self.outlier && self.jumped == [false; 2]
    }
}

/// The page as a complete HTML file that needs nothing from outside.
///
/// ```
/// use helio_report::joint::{JointPage, joint_page};
/// let page = JointPage { title: "My field".to_owned(), ..JointPage::default() };
/// assert!(joint_page(&page).contains("<h1>My field</h1>"));
/// ```
#[must_use]
pub fn joint_page(page: &JointPage) -> String {
    page::html(page)
}

/// Which heliostats' zero points the page draws, of those with records: all of a small field; else half of
/// [`TRACKS`] those missed farthest, the others evenly chosen.
#[must_use]
pub fn tracks(page: &JointPage) -> Vec<usize> {
    zero::chosen(page)
}

/// The heliostats whose zero points the page needs in numbers besides those: those of the jumps that it lists.
#[must_use]
pub fn jumped(page: &JointPage) -> Vec<usize> {
    zero::listed(page)
}

impl HeliostatLine {
    /// How many of its observations were made before its records.
    fn before(&self) -> usize {
        self.observations.saturating_sub(self.records.len())
    }

    /// Plain records that were foretold from [`SETTLED`] others at least.
    fn settled(&self) -> impl Iterator<Item = &RecordLine> {
        let later = self
            .records
            .iter()
            .skip(SETTLED.saturating_sub(self.before()));
        later.filter(|r| r.is_foretold() && r.is_plain())
    }
}

/// Root of the mean of squares; NaN of nothing.
fn rms(values: impl IntoIterator<Item = f64>) -> f64 {
    let (mut sum, mut count) = (0.0, 0.0_f64);
    for value in values {
        sum += value * value;
        count += 1.0;
    }
    (sum / count).sqrt()
}

/// At most `most` of some places, evenly chosen, in order.
fn evenly(count: usize, most: usize) -> impl Iterator<Item = usize> {
    let shown = count.min(most);
    (0..shown).map(move |k| k * count / shown)
}

/// A number with as many decimals as its standard deviation has something to say about; a dash for none.
fn rounded(value: f64, sigma: f64) -> String {
    if !value.is_finite() {
        return "–".to_owned();
    }
    if !(sigma > 0.0 && sigma.is_finite()) {
        return crate::calibration::plot::mrad(value);
    }
    let decimals = (1.0 - sigma.log10().floor()).clamp(0.0, 6.0) as usize;
    let text = format!("{value:.decimals$}");
    let nothing = text.bytes().all(|b| matches!(b, b'-' | b'0' | b'.'));
    if nothing {
        return text.trim_start_matches('-').to_owned();
    }
    text.replace('-', "\u{2212}")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn half_of_all_misses_lie_inside_the_ellipse_of_one_half() {
        // chi-squared with two degrees of freedom has its median at 2 ln 2
        let square = 2.0 * 2_f64.ln();
        let record = RecordLine {
            miss_mrad: [2.0 * square.sqrt(), 0.0],
            covariance_mrad2: [4.0, 0.0, 1.0],
            ..RecordLine::default()
        };
        assert!((record.inside() - 0.5).abs() < 1e-12);
        assert!((record.expected_mrad() - 5_f64.sqrt()).abs() < 1e-12);
        // turned by 45°: variances 1 and 4 along the diagonals
        let record = RecordLine {
            miss_mrad: [square.sqrt() * 2_f64.sqrt(); 2],
            covariance_mrad2: [2.5, 1.5, 2.5],
            ..RecordLine::default()
        };
        assert!((record.inside() - 0.5).abs() < 1e-12);
        // more than fully correlated
        let none = RecordLine {
            covariance_mrad2: [1.0, 2.0, 1.0],
            ..record
        };
        assert!(!none.is_foretold());
    }

    #[test]
    fn numbers_are_as_sharp_as_their_sigma() {
        assert_eq!(rounded(-3.6123, 0.04), "\u{2212}3.612");
        assert_eq!(rounded(-0.004, 0.4), "0.00");
        assert_eq!(rounded(412.3, 25.0), "412");
        assert_eq!(rounded(1.234, f64::NAN), "1.23");
        assert_eq!(rounded(f64::NAN, 1.0), "–");
        assert_eq!(evenly(5, 24).collect::<Vec<_>>(), [0, 1, 2, 3, 4]);
        assert_eq!(evenly(9, 3).collect::<Vec<_>>(), [0, 3, 6]);
        assert_eq!(evenly(0, 3).count(), 0);
        assert_eq!(rms([3.0, 4.0, 0.0, 0.0]), 2.5);
        assert!(rms([]).is_nan());
    }
}
