//! The page of a calibration: what it did to a field and to some of its heliostats.
//!
//! [`CalibrationPage`] is plain data, filled by [`CalibrationPage::of_run`] or by hand; [`calibration_page`] turns it
//! into one HTML file that needs nothing from outside. Numbers are in the units that people read:
//! degrees, metres, milliradians of the beam. A number that does not exist is NaN or `None` and is
//! never drawn. A page of a large field holds sections of few heliostats: [`most_in_need`] chooses
//! them, and the page says how many it left out.

pub(crate) mod correlation;
pub(crate) mod dates;
mod heliostat;
mod of_run;
mod overview;
pub(crate) mod page;
mod parameters;
pub(crate) mod plot;
mod residuals;
mod target;

/// How many heliostats get a section of their own where nobody asks for another number.
pub const SECTIONS: usize = 40;

/// What a calibration says about a field.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct CalibrationPage {
    /// Heading.
    pub title: String,
    /// When the page was made, as text; this crate has no clock.
    pub generated_utc: String,
    /// What made it, such as "helio-rs 0.2.0".
    pub version: String,
    /// What the reader should know of the run, each with its name: files, solver, options.
    pub facts: Vec<(String, String)>,
    /// What was found about the field as a whole, in sentences.
    pub findings: Vec<String>,
    /// Every heliostat, in the order of the field.
    pub field: Vec<HeliostatSummary>,
    /// Where the tower stands, east and north \[m\].
    pub tower_m: Option<[f64; 2]>,
    /// The targets that records name.
    pub targets: Vec<TargetOutline>,
    /// The heliostats with a section of their own, in the order in which they are shown; see
    /// [`most_in_need`].
    pub heliostats: Vec<HeliostatSection>,
}

/// What a calibration says about one heliostat, in a line.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct HeliostatSummary {
    /// Its name.
    pub id: String,
    /// Pivot toward east \[m\].
    pub east_m: f64,
    /// Pivot toward north \[m\].
    pub north_m: f64,
    /// RMS angle between predicted beams and spots after the fit \[mrad\]; of the worst epoch, rejected
    /// records left out. NaN where there is none.
    pub beam_rms_mrad: f64,
    /// What to think of it.
    pub verdict: Verdict,
    /// Records, rejected ones included.
    pub observations: usize,
    /// Rejected records.
    pub rejected: usize,
    /// Sets of parameters: epochs, or parts of the day; 1 where nothing jumped and the day is whole.
    pub epochs: usize,
    /// Why the verdict, in a few words; may be empty.
    pub remark: String,
}

/// What to think of a heliostat's calibration.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default, PartialOrd, Ord)]
pub enum Verdict {
    /// There is no result: refused, too few records, or stopped early.
    Failed,
    /// There is a result that its records do not determine.
    Undetermined,
    /// There is a result, and its records determine it.
    Determined,
    /// There were no records of this heliostat.
    #[default]
    NotObserved,
}

impl Verdict {
    /// All of them, those in most need of attention first.
    pub const ALL: [Self; 4] = [
        Self::Failed,
        Self::Undetermined,
        Self::Determined,
        Self::NotObserved,
    ];

    /// The words for people.
    #[must_use]
    pub const fn as_str(self) -> &'static str {
        match self {
            Self::Failed => "failed",
            Self::Undetermined => "undetermined",
            Self::Determined => "determined",
            Self::NotObserved => "not observed",
        }
    }
}

impl std::fmt::Display for Verdict {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(self.as_str())
    }
}

/// The outline of a target.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct TargetOutline {
    /// Its name.
    pub name: String,
    /// Width and height \[m\], where known.
    pub size_m: Option<[f64; 2]>,
}

/// Everything about one heliostat.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct HeliostatSection {
    /// Its name.
    pub id: String,
    /// What to think of it.
    pub verdict: Verdict,
    /// The verdict and other findings in sentences.
    pub words: Vec<String>,
    /// RMS angle between predicted beams and spots with the parameters before, rejected records
    /// left out \[mrad\]; NaN where there is none.
    pub before_rms_mrad: f64,
    /// The same after the fit.
    pub after_rms_mrad: f64,
    /// More numbers, each with its name.
    pub facts: Vec<(String, String)>,
    /// Every record, in the order of the file.
    pub records: Vec<Record>,
    /// What has parameters of its own, ascending in time: stretches between jumps, or parts of the day
    /// (recognised by their times, which overlap). One where nothing jumped, none where nothing was fitted.
    pub epochs: Vec<EpochSection>,
    /// Numbers of sets over the day that were compared; empty where none were.
    pub sets: Vec<SetChoice>,
}

impl HeliostatSection {
    /// What to call each of [`epochs`](Self::epochs): an epoch, or a set where their times overlap.
    fn part(&self) -> &'static str {
        let overlap = self.epochs.windows(2).any(|pair| {
            let times = pair[0].to_unix_ns.zip(pair[1].from_unix_ns);
            times.is_some_and(|(end, begin)| end > begin)
        });
        if overlap { "set" } else { "epoch" }
    }
}

/// One record of a heliostat.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Record {
    /// What the reader finds it by, such as "row 17".
    pub label: String,
    /// Name of the target on which the spot was.
    pub target: String,
    /// When, in nanoseconds from 1970 UTC, where known.
    pub unix_ns: Option<i64>,
    /// Hour angle of the sun \[deg\], afternoon positive, where known.
    pub hour_angle_deg: Option<f64>,
    /// Sun, clockwise from north \[deg\].
    pub sun_azimuth_deg: f64,
    /// Sun, above the horizon \[deg\].
    pub sun_elevation_deg: f64,
    /// The spot on its target, right and down as a camera facing it sees them \[m\].
    pub measured_m: [f64; 2],
    /// Where the parameters before put it; NaN where they miss the target.
    pub before_m: [f64; 2],
    /// Where the fit puts it; NaN where it misses the target, or where there is no fit.
    pub after_m: [f64; 2],
    /// Angle between predicted beam and measured spot with the parameters before \[mrad\]; NaN on a miss.
    pub before_mrad: f64,
    /// The same after the fit.
    pub after_mrad: f64,
    /// Which of [`HeliostatSection::epochs`] it belongs to.
    pub epoch: Option<usize>,
    /// Why it was rejected; `None` if it was used.
    pub rejected: Option<String>,
}

/// A stretch of time, or a part of the day, with parameters of its own.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct EpochSection {
    /// First record's time, nanoseconds from 1970 UTC, where known.
    pub from_unix_ns: Option<i64>,
    /// Last record's time.
    pub to_unix_ns: Option<i64>,
    /// Records that were used.
    pub observations: usize,
    /// RMS of its records \[mrad\], NaN where there is none.
    pub beam_rms_mrad: f64,
    /// What to think of it.
    pub verdict: Verdict,
    /// The verdict in a sentence; may be empty.
    pub words: String,
    /// Predicted pointing uncertainty over the sun positions of a year \[mrad\], one standard deviation.
    pub year_pointing_mrad: Option<f64>,
    /// The parameters, in the same order in every epoch of a heliostat.
    pub parameters: Vec<ParameterRow>,
    /// Correlations of the free parameters: one row per name in `correlation_names`.
    pub correlation: Vec<Vec<f64>>,
    /// Short names for the rows and columns of `correlation`.
    pub correlation_names: Vec<String>,
    /// More numbers, each with its name: condition, rank, degrees of freedom.
    pub facts: Vec<(String, String)>,
}

/// The unit of a parameter.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default)]
pub enum ParameterUnit {
    /// Degrees.
    #[default]
    Degrees,
    /// Metres.
    Metres,
}

/// One parameter.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct ParameterRow {
    /// Its name in words.
    pub name: String,
    /// Unit of all its numbers.
    pub unit: ParameterUnit,
    /// The estimate, or the value at which it was held.
    pub value: f64,
    /// Its value before the fit, where there was one.
    pub before: Option<f64>,
    /// One standard error; `None` if the parameter was held or its error is not known.
    pub standard_error: Option<f64>,
    /// Lower and upper end of the 95 % interval.
    pub interval95: Option<[f64; 2]>,
    /// True if it was held.
    pub held: bool,
}

/// One number of sets over the day, compared with the others.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct SetChoice {
    /// True for the number that was chosen.
    pub chosen: bool,
    /// RMS over all records \[mrad\].
    pub beam_rms_mrad: f64,
    /// RMS over records that the fit had not seen \[mrad\], where it was found.
    pub unseen_rms_mrad: Option<f64>,
    /// The sets, ascending in hour angle.
    pub sets: Vec<SetRow>,
}

/// One set of parameters for a part of the day.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct SetRow {
    /// Where it begins \[deg\]; `None` from sunrise.
    pub hour_angle_from_deg: Option<f64>,
    /// Where it ends \[deg\]; `None` to sunset.
    pub hour_angle_to_deg: Option<f64>,
    /// Records that were used.
    pub observations: usize,
    /// Their RMS \[mrad\].
    pub beam_rms_mrad: f64,
}

/// Which heliostats should get a section: those asked for and the `most` in most need of
/// attention. Need is no result first, then an undetermined one, then the largest RMS; heliostats
/// without records need none. Gives places in `field`: first those asked for, in the order asked,
/// then the others, worst first. Names that the field does not have are passed over.
///
/// ```
/// use helio_report::calibration::{HeliostatSummary, Verdict, most_in_need};
/// let line = |id: &str, beam_rms_mrad, verdict| HeliostatSummary {
///     id: id.to_owned(),
///     beam_rms_mrad,
///     verdict,
///     ..HeliostatSummary::default()
/// };
/// let field = [
///     line("A1", 0.7, Verdict::Determined),
///     line("A2", 1.9, Verdict::Determined),
///     line("A3", 0.1, Verdict::Undetermined),
///     line("A4", f64::NAN, Verdict::NotObserved),
/// ];
/// assert_eq!(most_in_need(&field, 2, &[]), [2, 1]);
/// assert_eq!(most_in_need(&field, 2, &["A1"]), [0, 2, 1]);
/// ```
#[must_use]
pub fn most_in_need(field: &[HeliostatSummary], most: usize, asked: &[&str]) -> Vec<usize> {
    let mut chosen: Vec<usize> = Vec::new();
    for id in asked {
        let place = field.iter().position(|line| line.id == *id);
        chosen.extend(place.filter(|place| !chosen.contains(place)));
    }
    let mut others: Vec<usize> = (0..field.len())
        .filter(|i| field[*i].verdict != Verdict::NotObserved && !chosen.contains(i))
        .collect();
    // A heliostat without RMS is worse than any with one; ties stay in the order of the field.
    let rms = |i: usize| {
        let rms = field[i].beam_rms_mrad;
        if rms.is_nan() { f64::INFINITY } else { rms }
    };
    others.sort_by(|&a, &b| {
        let worse = field[a].verdict.cmp(&field[b].verdict);
        worse.then(rms(b).total_cmp(&rms(a)))
    });
    chosen.extend(others.into_iter().take(most));
    chosen
}

/// The page as a complete HTML file that needs nothing from outside.
///
/// ```
/// use helio_report::calibration::{CalibrationPage, calibration_page};
/// let page = CalibrationPage { title: "My field".to_owned(), ..CalibrationPage::default() };
/// assert!(calibration_page(&page).contains("<h1>My field</h1>"));
/// ```
#[must_use]
pub fn calibration_page(page: &CalibrationPage) -> String {
    page::html(page)
}
