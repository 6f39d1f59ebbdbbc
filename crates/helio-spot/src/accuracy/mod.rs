//! How accurately a heliostat tracks, from a campaign of spots and the weather beside them: the report of
//! T/GRLM 02-2014, *Test method for solar heliostat tracking accuracy*.
//!
//! [`evaluate`] takes the spots of a campaign (metres on the target, right and down of its centre), a weather
//! record and the [`Limits`] of a guideline, and gives the error of each frame, accuracy, precision and bias,
//! the share of frames within 3.5 mrad at each wind speed with its confidence interval, a [`Verdict`], and what
//! of the measurement departs from the standard, clause by clause. It reads no file and no clock.
//!
//! **The error of a frame**, formula (1), is the distance of the spot from the aim point over the distance of
//! the heliostat: η = √(Δu² + Δv²) / L · 1000 mrad. On a target that is not square to the line from the
//! heliostat that is more than the angle which clause 3.2 defines; where [`Setup::toward_heliostat`] is given
//! both are computed, and (1), which clause 8 names, is judged.
//!
//! **Accuracy** (3.2) is the root mean square of η about the aim point, **precision** (3.3) that about the mean
//! spot, with N for a divisor, so that accuracy² = precision² + bias².
//!
//! **Shares** are counted in wind bins. Frames of a video follow each other faster than a heliostat swings:
//! each bin's number of independent frames follows from the autocorrelation of "within the angle" along time,
//! and the interval is that of Clopper and Pearson for that number. It is then widened by what the instruments
//! may have added or taken away, and by frames that had the weather but no usable spot: its lower end counts
//! them as beyond the angle, its upper end as within.
//!
//! **Verdict**: qualified if the intervals of all bins lie above their limits, not qualified if one lies below,
//! else there is not enough data.

mod clauses;
mod correlation;
mod figures;
mod judge;
mod limits;
mod share;
pub mod simulate;
mod weather;

pub use clauses::{Clause, ClauseOutcome, Statements};
pub use figures::{Figure, Figures};
pub use judge::{BinOutcome, JudgedBin, Verdict, WindBin};
pub use limits::{Limits, ShareLimit};
pub use share::clopper_pearson;
pub use weather::Weather;

use std::fmt;

use crate::SpotStatus;

/// A wrong call of [`evaluate`].
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum AccuracyError {
    /// There is no frame.
    #[error("there are no spots to evaluate")]
    NoSpots,
    /// A number that makes no sense.
    #[error("{what} must be {wanted}, got {value}")]
    Bad {
        /// What it is.
        what: &'static str,
        /// What it must be.
        wanted: &'static str,
        /// What was given.
        value: f64,
    },
    /// An uncertainty of the instruments that makes no sense.
    #[error("{what} must be {wanted}, got {value}")]
    Uncertainty {
        /// Which.
        what: &'static str,
        /// What it must be.
        wanted: &'static str,
        /// What was given.
        value: f64,
    },
    /// A column of the weather record is shorter or longer than its times.
    #[error("{what} of the weather record has {found} rows, its times have {wanted}")]
    Length {
        /// The column.
        what: &'static str,
        /// Rows of the times.
        wanted: usize,
        /// Rows of the column.
        found: usize,
    },
    /// A time of the weather record that is not later than the one before.
    #[error("weather record: row {row} (counted from 0) is not later than the row before it")]
    WeatherOrder {
        /// The row.
        row: usize,
    },
}

/// A spot of the campaign.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SpotRow {
    /// When \[ns of Unix time\]; `None` if it is not known.
    pub unix_ns: Option<i64>,
    /// Where on the target \[m\], right and down of its centre; `None` if there is none.
    pub spot_m: Option<[f64; 2]>,
    /// One standard deviation per component \[m\]; `None` if not stated.
    pub sigma_m: Option<f64>,
    /// What became of the frame; `None` if it could not be read.
    pub status: Option<SpotStatus>,
}

/// One standard deviation of what the instruments may be wrong by; `None` where it was not stated, which counts
/// as nothing and is said.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Uncertainty {
    /// Distance L \[m\].
    pub slant_m: Option<f64>,
    /// Pixel scale µ, as a part of itself: the same for all frames.
    pub scale: Option<f64>,
    /// Place of the target's marks, and so of the aim point, per component \[m\]: the same for all frames.
    pub survey_m: Option<f64>,
    /// Centre of a spot, per component \[m\], for rows that state none: of each frame for itself.
    pub centre_m: Option<f64>,
}

/// Where the heliostat aims and from where.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Setup {
    /// Aim point on the target \[m\], right and down of its centre.
    pub aim_m: [f64; 2],
    /// Centre of rotation to aim point, L \[m\].
    pub slant_m: f64,
    /// From the aim point to the heliostat: right, down and out of the target toward whoever faces it; any
    /// length. `None` if it is not known: the angle of clause 3.2 is then not computed.
    pub toward_heliostat: Option<[f64; 3]>,
    /// How well the instruments know.
    pub uncertainty: Uncertainty,
}

impl Setup {
    /// Angle between two points of the target as the heliostat's centre of rotation sees them \[mrad\], as
    /// clauses 3.2 and 3.3 define it. `None` if [`toward_heliostat`](Self::toward_heliostat) is.
    ///
    /// ```
    /// use helio_spot::accuracy::{Setup, Uncertainty};
    /// let setup = Setup {
    ///     aim_m: [0.0, 0.0],
    ///     slant_m: 100.0,
    ///     // 60 degrees to the right of the target's normal
    ///     toward_heliostat: Some([60_f64.to_radians().sin(), 0.0, 60_f64.to_radians().cos()]),
    ///     uncertainty: Uncertainty::default(),
    /// };
    /// let angle_mrad = setup.angle_mrad([0.1, 0.0], setup.aim_m).unwrap();
    /// assert!((angle_mrad - 0.5).abs() < 1e-3); // half of the 1 mrad of formula (1)
    /// ```
    #[must_use]
    pub fn angle_mrad(&self, one_m: [f64; 2], other_m: [f64; 2]) -> Option<f64> {
        let [right, down, out] = self.toward_heliostat?;
        let length = libm::sqrt(right * right + down * down + out * out);
        let pivot = [right, down, out].map(|c| c / length * self.slant_m);
        let ray = |spot: [f64; 2]| {
            [
                spot[0] - self.aim_m[0] - pivot[0],
                spot[1] - self.aim_m[1] - pivot[1],
                -pivot[2],
            ]
        };
        let (a, b) = (ray(one_m), ray(other_m));
        let cross = [
            a[1] * b[2] - a[2] * b[1],
            a[2] * b[0] - a[0] * b[2],
            a[0] * b[1] - a[1] * b[0],
        ];
        let sine = libm::sqrt(cross.iter().map(|c| c * c).sum());
        let cosine: f64 = a.iter().zip(b).map(|(a, b)| a * b).sum();
        Some(libm::atan2(sine, cosine) * 1e3)
    }

    /// Error of a spot by formula (1) \[mrad\].
    #[must_use]
    pub fn eta_mrad(&self, spot_m: [f64; 2]) -> f64 {
        Target::of(self).eta_mrad(spot_m, self.aim_m)
    }

    fn check(&self) -> Result<(), AccuracyError> {
        let bad = |what, wanted, value| {
            Err(AccuracyError::Bad {
                what,
                wanted,
                value,
            })
        };
        if !(self.slant_m.is_finite() && self.slant_m > 0.0) {
            return bad("the distance of the heliostat", "above 0 m", self.slant_m);
        }
        for value in self.aim_m {
            if !value.is_finite() {
                return bad("the aim point", "a finite number of metres", value);
            }
        }
        if let Some(toward) = self.toward_heliostat {
            let length = libm::sqrt(toward.iter().map(|c| c * c).sum());
            if !(length > 0.0 && length.is_finite()) {
                return bad("the direction to the heliostat", "of some length", length);
            }
            if toward[2] <= 0.0 {
                let wanted = "out of the target's face";
                return bad("the direction to the heliostat", wanted, toward[2]);
            }
        }
        let unsure = self.uncertainty;
        let bad = |what, wanted, value| {
            Err(AccuracyError::Uncertainty {
                what,
                wanted,
                value,
            })
        };
        for (what, value) in [
            ("the uncertainty of the distance", unsure.slant_m),
            ("the uncertainty of the pixel scale", unsure.scale),
            ("the uncertainty of the survey", unsure.survey_m),
            ("the uncertainty of the centres", unsure.centre_m),
        ] {
            if let Some(value) = value
                && !(value >= 0.0 && value.is_finite())
            {
                return bad(what, "at least 0", value);
            }
        }
        if let Some(sigma) = unsure.slant_m
            && sigma >= 0.1 * self.slant_m
        {
            let wanted = "less than a tenth of the distance";
            return bad("the uncertainty of the distance", wanted, sigma);
        }
        if let Some(sigma) = unsure.scale
            && sigma >= 0.1
        {
            let wanted = "less than a tenth";
            return bad("the uncertainty of the pixel scale", wanted, sigma);
        }
        Ok(())
    }
}

/// How it is counted.
#[derive(Debug, Clone, PartialEq)]
pub struct Options {
    /// Frames within so much of a limit's wind speed are in its bin \[m/s\]; 1.
    pub bin_half_width_m_s: f64,
    /// Width of the bins of the figure of all wind speeds \[m/s\]; 1.
    pub histogram_step_m_s: f64,
    /// How often intervals hold the truth; 0.95.
    pub confidence: f64,
    /// Longest time between two weather rows that frames between them may use \[s\]; 60.
    pub weather_gap_s: f64,
    /// Statuses whose spots count; `ok` alone.
    pub accepted: Vec<SpotStatus>,
}

impl Default for Options {
    fn default() -> Self {
        Self {
            bin_half_width_m_s: 1.0,
            histogram_step_m_s: 1.0,
            confidence: 0.95,
            weather_gap_s: 60.0,
            accepted: vec![SpotStatus::Ok],
        }
    }
}

impl Options {
    fn check(&self) -> Result<(), AccuracyError> {
        for (what, wanted, value, min, max) in [
            (
                "half the width of a wind bin",
                "0.01 to 20 m/s",
                self.bin_half_width_m_s,
                0.01,
                20.0,
            ),
            (
                "the width of the histogram's bins",
                "0.1 to 20 m/s",
                self.histogram_step_m_s,
                0.1,
                20.0,
            ),
            (
                "the confidence",
                "0.5 to 0.9999",
                self.confidence,
                0.5,
                0.9999,
            ),
            (
                "the longest gap of the weather",
                "0 to 86400 s",
                self.weather_gap_s,
                0.0,
                86_400.0,
            ),
        ] {
            if !(min..=max).contains(&value) {
                return Err(AccuracyError::Bad {
                    what,
                    wanted,
                    value,
                });
            }
        }
        if let Some(status) = self.accepted.iter().find(|s| !s.has_position()) {
            return Err(AccuracyError::Bad {
                what: "a status whose spots are to count",
                wanted: "one that comes with a position",
                value: f64::from(*status as u8),
            });
        }
        Ok(())
    }
}

/// Whether a frame was counted, and if not why.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub enum FrameStatus {
    /// Counted.
    Ok,
    /// It has no time.
    NoTime,
    /// An earlier row has its time and says the same: a frame counts once.
    Repeated,
    /// Other rows have its time and say otherwise: nobody knows which of them is right, so that none counts.
    Contradicted,
    /// The weather record has no irradiance at its time.
    NoDni,
    /// The irradiance was too low.
    LowDni,
    /// The weather record has no air temperature at its time.
    NoAirTemperature,
    /// The air was too cold or too warm.
    AirTemperature,
    /// The weather record has no wind at its time.
    NoWind,
    /// It has no spot that counts: the status of the spot.
    Spot(SpotStatus),
    /// It could not be read.
    Unreadable,
    /// It has a status that comes with a position, but no finite position.
    NoPosition,
}

impl FrameStatus {
    /// The word for columns.
    #[must_use]
    pub const fn as_str(self) -> &'static str {
        match self {
            Self::Ok => "ok",
            Self::NoTime => "no_time",
            Self::Repeated => "repeated",
            Self::Contradicted => "contradicted",
            Self::NoDni => "no_dni",
            Self::LowDni => "low_dni",
            Self::NoAirTemperature => "no_air_temperature",
            Self::AirTemperature => "air_temperature",
            Self::NoWind => "no_wind",
            Self::Spot(status) => status.as_str(),
            Self::Unreadable => "unreadable",
            Self::NoPosition => "no_position",
        }
    }

    /// Why a frame was left out, in words.
    #[must_use]
    pub const fn reason(self) -> &'static str {
        match self {
            Self::Ok => "counted",
            Self::NoTime => "no time",
            Self::Repeated => "an earlier row says the same",
            Self::Contradicted => "rows of one time that contradict each other",
            Self::NoDni => "no irradiance recorded at its time",
            Self::LowDni => "irradiance too low",
            Self::NoAirTemperature => "no air temperature recorded at its time",
            Self::AirTemperature => "air too cold or too warm",
            Self::NoWind => "no wind recorded at its time",
            Self::Spot(SpotStatus::Ok) => "spots of status ok are not accepted",
            Self::Spot(SpotStatus::Empty) => "no spot on the target",
            Self::Spot(SpotStatus::Cut) => "spot cut by the target's edge",
            Self::Spot(SpotStatus::Saturated) => "spot saturated",
            Self::Spot(SpotStatus::Ambiguous) => "more than one spot could be meant",
            Self::Spot(SpotStatus::Unclear) => "light on the target, its middle not to be told",
            Self::Spot(SpotStatus::NoTarget) => "target not found in the frame",
            Self::Unreadable => "frame could not be read",
            Self::NoPosition => "no position in the table",
        }
    }

    /// Whether the frame had the light and the weather but no spot that counts.
    const fn is_lost(self) -> bool {
        matches!(
            self,
            Self::Spot(_) | Self::Unreadable | Self::NoPosition | Self::Contradicted
        )
    }
}

/// A frame as it was evaluated; numbers are there as far as they are known.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct EvaluatedFrame {
    /// Counted, or why not.
    pub status: FrameStatus,
    /// Error by formula (1) \[mrad\], of frames that are counted.
    pub eta_mrad: Option<f64>,
    /// Error as clause 3.2 defines it \[mrad\], of frames that are counted.
    pub angle_mrad: Option<f64>,
    /// Wind at its time \[m/s\].
    pub wind_m_s: Option<f64>,
    /// Irradiance at its time \[W/m²\].
    pub dni_w_m2: Option<f64>,
    /// Air temperature at its time \[°C\].
    pub air_temperature_c: Option<f64>,
}

/// Something a reader of the report must know.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub enum Warning {
    /// No weather at all.
    NoWeather,
    /// The weather record lacks a quantity, so that its condition could not be checked.
    NotRecorded {
        /// The quantity.
        what: &'static str,
    },
    /// Rows that say again what an earlier one says of the same time: they count once.
    Repeated {
        /// How many.
        rows: usize,
    },
    /// Times of which rows say different things: none of these rows counts.
    Contradicted {
        /// How many times.
        times: usize,
        /// How many rows they have.
        rows: usize,
        /// The first of the times \[ns of Unix time\].
        first_unix_ns: i64,
        /// Whether all times of the table are whole seconds.
        whole_seconds: bool,
    },
    /// Frames come more slowly than the guideline wants.
    SlowSampling {
        /// Frames per second found, from the median step.
        found: f64,
        /// Frames per second wanted.
        wanted: f64,
    },
    /// Wind speeds of the range to cover at which no frame was counted.
    WindNotCovered {
        /// From and to \[m/s\], by steps of the histogram, neighbours joined.
        missing_m_s: Vec<[f64; 2]>,
    },
    /// The wind of the frames in a bin lies to one side of the speed that the bin stands for.
    OffCentre {
        /// The speed \[m/s\].
        wind_m_s: f64,
        /// The mean wind of its frames \[m/s\].
        mean_m_s: f64,
    },
    /// Frames with the weather but no spot that counts, in a bin that is judged.
    LostFrames {
        /// The speed of the bin \[m/s\].
        wind_m_s: f64,
        /// How many.
        lost: usize,
        /// Counted ones beside them.
        counted: usize,
    },
    /// The errors of a bin change so slowly that its frames tell as much as one.
    Unresolved {
        /// The speed of the bin \[m/s\].
        wind_m_s: f64,
    },
    /// An uncertainty that was not stated and counts as nothing.
    NotStated {
        /// Of what.
        what: &'static str,
    },
    /// The angle of clause 3.2 was not computed.
    NoDirection,
}

impl fmt::Display for Warning {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::NoWeather => f.write_str(
                "there is no weather record: neither light nor air was checked, and no frame has a wind speed",
            ),
            Self::NotRecorded { what } => write!(
                f,
                "the weather record has no {what}: its condition was not checked"
            ),
            Self::Repeated { rows } => write!(
                f,
                "rows that say again what an earlier one says of the same time, left out: {rows}"
            ),
            Self::Contradicted {
                times,
                rows,
                whole_seconds,
                ..
            } => {
                write!(
                    f,
                    "times of which rows contradict each other, left out: {times}, with {rows} rows; "
                )?;
                f.write_str(if *whole_seconds {
                    "all times are whole seconds: wanted fractions of a second, as spot --start --fps writes them, or \
                     as many digits as tell the frames apart"
                } else {
                    "wanted one row a frame, of one camera and one method, and times fine enough to tell its frames \
                     apart"
                })
            }
            Self::SlowSampling { found, wanted } => write!(
                f,
                "frames come at {found:.3} per second, wanted at least {wanted}: short swings are missed"
            ),
            Self::WindNotCovered { missing_m_s } => {
                let ranges: Vec<String> = missing_m_s
                    .iter()
                    .map(|[from, to]| format!("{from} to {to}"))
                    .collect();
                write!(f, "no frames at wind speeds of {} m/s", ranges.join(", "))
            }
            Self::OffCentre { wind_m_s, mean_m_s } => write!(
                f,
                "the frames around {wind_m_s} m/s have a mean wind of {mean_m_s:.2} m/s"
            ),
            Self::LostFrames {
                wind_m_s,
                lost,
                counted,
            } => write!(
                f,
                "around {wind_m_s} m/s the frames without a spot that counts are {lost}, beside {counted} counted: the \
                 interval allows for either, within the angle and beyond"
            ),
            Self::Unresolved { wind_m_s } => write!(
                f,
                "around {wind_m_s} m/s errors change so slowly that the frames tell no more than one would"
            ),
            Self::NotStated { what } => {
                write!(f, "the uncertainty of {what} is not stated: it counts as nothing")
            }
            Self::NoDirection => f.write_str(
                "it is not stated from where the heliostat looks at the target: the angle of clause 3.2 is not computed",
            ),
        }
    }
}

/// Everything [`evaluate`] finds.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub struct Evaluation {
    /// The verdict by the intervals.
    pub verdict: Verdict,
    /// What the printed rule (8.2), share above limit, says of the same shares: `None` if a bin is empty.
    pub printed_verdict: Option<bool>,
    /// The bins that are judged, in the order of the limits.
    pub judged: Vec<JudgedBin>,
    /// All wind speeds by steps of the histogram, empty ones included: figure 3 of the standard.
    pub histogram: Vec<WindBin>,
    /// Accuracy, precision and bias of all counted frames; `None` without any.
    pub figures: Option<Figures>,
    /// Each frame, in the order given.
    pub frames: Vec<EvaluatedFrame>,
    /// How many frames have which status, counted ones first.
    pub counts: Vec<(FrameStatus, usize)>,
    /// Median time between successive frames \[s\]; `None` below two frames.
    pub step_s: Option<f64>,
    /// First and last time of a counted frame \[ns of Unix time\].
    pub counted_ns: Option<[i64; 2]>,
    /// What a reader must know.
    pub warnings: Vec<Warning>,
    /// The standard, clause by clause.
    pub clauses: Vec<Clause>,
}

/// Evaluates a campaign.
///
/// The rows may stand in any order: nothing but the places of [`Evaluation::frames`] depends on it. Of rows that say
/// the same of one time the first counts; the others are [`Repeated`](FrameStatus::Repeated), so that a table which
/// holds frames twice is judged as if it held them once. Where rows of one time differ in status, place or standard
/// deviation, all of them are [`Contradicted`](FrameStatus::Contradicted) and stand for one frame without a spot.
///
/// # Errors
/// [`AccuracyError`] without any spot, for a weather record whose times do not ascend or whose columns differ
/// in length, and for numbers of the set-up, the limits or the options that make no sense. A frame that cannot
/// be used keeps its place and says why in its status.
///
/// ```
/// use helio_spot::SpotStatus;
/// use helio_spot::accuracy::*;
/// let spots: Vec<SpotRow> = (0..10)
///     .map(|i| SpotRow {
///         unix_ns: Some(i * 1_000_000_000),
///         spot_m: Some([0.3, -0.1]),
///         sigma_m: None,
///         status: Some(SpotStatus::Ok),
///     })
///     .collect();
/// let weather = Weather {
///     unix_ns: vec![0, 10_000_000_000],
///     wind_m_s: vec![vec![3.5, 4.5]],
///     dni_w_m2: Some(vec![800.0, 820.0]),
///     air_temperature_c: Some(vec![21.0, 21.0]),
/// };
/// let setup = Setup {
///     aim_m: [0.0, -0.1],
///     slant_m: 100.0,
///     toward_heliostat: None,
///     uncertainty: Uncertainty::default(),
/// };
/// let found = evaluate(
///     &spots, Some(&weather), &setup, &Limits::grlm(), &Options::default(), &Statements::default(),
/// )?;
/// assert!((found.figures.unwrap().accuracy.mrad - 3.0).abs() < 1e-12);
/// assert_eq!(found.judged[0].bin.frames, 10);
/// assert_eq!(found.verdict, Verdict::NotEnoughData);
/// # Ok::<(), AccuracyError>(())
/// ```
pub fn evaluate(
    spots: &[SpotRow],
    weather: Option<&Weather>,
    setup: &Setup,
    limits: &Limits,
    options: &Options,
    statements: &Statements,
) -> Result<Evaluation, AccuracyError> {
    if spots.is_empty() {
        return Err(AccuracyError::NoSpots);
    }
    setup.check()?;
    limits.check()?;
    options.check()?;
    if let Some(weather) = weather {
        weather.check()?;
    }
    let order = in_time(spots);
    let frames = statuses(spots, &order, weather, setup, limits, options);
    let step_ns = median_step_ns(spots, &order);
    let taken = |wanted: &dyn Fn(&EvaluatedFrame) -> bool| {
        Frames::of(spots, &frames, &order, step_ns, setup, wanted)
    };
    let counted = taken(&|frame| frame.status == FrameStatus::Ok);
    let step_s = step_ns.map(|ns| ns as f64 * 1e-9);

    let count = judge::Count {
        spots,
        frames: &frames,
        order: &order,
        step_ns,
        setup,
        limits,
        options,
    };
    let judged: Vec<JudgedBin> = limits
        .shares
        .iter()
        .map(|limit| count.judged(*limit))
        .collect();
    let histogram = count.histogram();
    let (verdict, printed_verdict) = judge::verdict(&judged);

    let mut evaluation = Evaluation {
        verdict,
        printed_verdict,
        judged,
        histogram,
        figures: figures::figures(&counted, setup),
        counts: counts(&frames),
        step_s,
        counted_ns: counted_ns(spots, &frames, &order),
        warnings: Vec::new(),
        clauses: Vec::new(),
        frames,
    };
    evaluation.warnings = repeated(spots, &evaluation.frames);
    let others = warnings(&evaluation, spots, weather, setup, limits, options);
    evaluation.warnings.extend(others);
    evaluation.clauses = clauses::clauses(&evaluation, weather, setup, limits, statements);
    Ok(evaluation)
}

/// Rows in the order of their times, those without one last; rows of one time stay in their order.
fn in_time(spots: &[SpotRow]) -> Vec<usize> {
    let mut order: Vec<usize> = (0..spots.len()).collect();
    order.sort_by_key(|&row| spots[row].unix_ns.map_or((true, 0), |ns| (false, ns)));
    order
}

fn median_step_ns(spots: &[SpotRow], order: &[usize]) -> Option<i64> {
    let times: Vec<i64> = order.iter().filter_map(|&row| spots[row].unix_ns).collect();
    let pairs = times.windows(2);
    correlation::median_step(pairs.map(|pair| pair[1].saturating_sub(pair[0])))
}

fn statuses(
    spots: &[SpotRow],
    order: &[usize],
    weather: Option<&Weather>,
    setup: &Setup,
    limits: &Limits,
    options: &Options,
) -> Vec<EvaluatedFrame> {
    let empty = EvaluatedFrame {
        status: FrameStatus::NoTime,
        eta_mrad: None,
        angle_mrad: None,
        wind_m_s: None,
        dni_w_m2: None,
        air_temperature_c: None,
    };
    let mut frames = vec![empty; spots.len()];
    let gap_ns = (options.weather_gap_s * 1e9) as i64;
    let times = weather.map_or(&[][..], |w| &w.unix_ns);
    let column = |values| weather::Column::new(times, values, gap_ns);
    let mut winds: Vec<weather::Column<'_>> = weather
        .into_iter()
        .flat_map(|w| &w.wind_m_s)
        .map(|values| column(values))
        .collect();
    let mut dni = weather.and_then(|w| w.dni_w_m2.as_deref()).map(column);
    let mut air = weather
        .and_then(|w| w.air_temperature_c.as_deref())
        .map(column);
    let [coldest, warmest] = limits.air_temperature_c;
    let same_time = |a: &usize, b: &usize| spots[*a].unix_ns == spots[*b].unix_ns;
    for rows in order.chunk_by(same_time) {
        let Some(unix_ns) = spots[rows[0]].unix_ns else {
            continue;
        };
        // all of them are asked, so that each goes along with time
        let each: Vec<Option<f64>> = winds.iter_mut().map(|wind| wind.at(unix_ns)).collect();
        let sum: Option<f64> = each.iter().copied().sum();
        let of_time = EvaluatedFrame {
            wind_m_s: sum
                .filter(|_| !each.is_empty())
                .map(|sum| sum / each.len() as f64),
            dni_w_m2: dni.as_mut().and_then(|column| column.at(unix_ns)),
            air_temperature_c: air.as_mut().and_then(|column| column.at(unix_ns)),
            ..empty
        };
        let bad_weather = if dni.is_some() && of_time.dni_w_m2.is_none() {
            Some(FrameStatus::NoDni)
        } else if of_time
            .dni_w_m2
            .is_some_and(|dni| dni <= limits.least_dni_w_m2)
        {
            Some(FrameStatus::LowDni)
        } else if air.is_some() && of_time.air_temperature_c.is_none() {
            Some(FrameStatus::NoAirTemperature)
        } else if of_time
            .air_temperature_c
            .is_some_and(|t| t < coldest || t > warmest)
        {
            Some(FrameStatus::AirTemperature)
        } else if !winds.is_empty() && of_time.wind_m_s.is_none() {
            Some(FrameStatus::NoWind)
        } else {
            None
        };
        let first = rows[0];
        let alike = rows
            .iter()
            .all(|&row| says(&spots[row]) == says(&spots[first]));
        for &row in rows {
            let spot = &spots[row];
            let status = if alike && row != first {
                frames[row].status = FrameStatus::Repeated;
                continue;
            } else if let Some(status) = bad_weather {
                status
            } else if !alike {
                FrameStatus::Contradicted
            } else if let Some(status) = spot.status
                && !options.accepted.contains(&status)
            {
                FrameStatus::Spot(status)
            } else if spot.status.is_none() {
                FrameStatus::Unreadable
            } else if !spot.spot_m.is_some_and(|m| m.iter().all(|c| c.is_finite())) {
                FrameStatus::NoPosition
            } else {
                FrameStatus::Ok
            };
            frames[row] = EvaluatedFrame { status, ..of_time };
            if let (FrameStatus::Ok, Some(spot_m)) = (status, spot.spot_m) {
                frames[row].eta_mrad = Some(setup.eta_mrad(spot_m));
                frames[row].angle_mrad = setup.angle_mrad(spot_m, setup.aim_m);
            }
        }
    }
    frames
}

/// What a row says of its time, to the last bit.
fn says(spot: &SpotRow) -> (Option<SpotStatus>, Option<[u64; 2]>, Option<u64>) {
    // 0 and -0 are one
    let bits = |value: f64| (value + 0.0).to_bits();
    (
        spot.status,
        spot.spot_m.map(|spot_m| spot_m.map(bits)),
        spot.sigma_m.map(bits),
    )
}

/// What is to be said of rows that have the time of another.
fn repeated(spots: &[SpotRow], frames: &[EvaluatedFrame]) -> Vec<Warning> {
    let of = |status: FrameStatus| {
        let rows = spots.iter().zip(frames);
        rows.filter(move |(_, frame)| frame.status == status)
            .filter_map(|(spot, _)| spot.unix_ns)
    };
    let mut warnings = Vec::new();
    let rows = of(FrameStatus::Repeated).count();
    if rows > 0 {
        warnings.push(Warning::Repeated { rows });
    }
    let mut times: Vec<i64> = of(FrameStatus::Contradicted).collect();
    let rows = times.len();
    times.sort_unstable();
    times.dedup();
    if let Some(&first_unix_ns) = times.first() {
        let mut all = spots.iter().filter_map(|spot| spot.unix_ns);
        warnings.push(Warning::Contradicted {
            times: times.len(),
            rows,
            first_unix_ns,
            whole_seconds: all.all(|ns| ns % 1_000_000_000 == 0),
        });
    }
    warnings
}

fn counts(frames: &[EvaluatedFrame]) -> Vec<(FrameStatus, usize)> {
    let mut counts = vec![(FrameStatus::Ok, 0)];
    for frame in frames {
        match counts
            .iter_mut()
            .find(|(status, _)| *status == frame.status)
        {
            Some((_, count)) => *count += 1,
            None => counts.push((frame.status, 1)),
        }
    }
    counts[1..].sort_by_key(|&(status, count)| (std::cmp::Reverse(count), status.as_str()));
    counts
}

fn counted_ns(spots: &[SpotRow], frames: &[EvaluatedFrame], order: &[usize]) -> Option<[i64; 2]> {
    let counted = || {
        order
            .iter()
            .filter(|&&row| frames[row].status == FrameStatus::Ok)
            .filter_map(|&row| spots[row].unix_ns)
    };
    Some([counted().min()?, counted().max()?])
}

fn warnings(
    found: &Evaluation,
    spots: &[SpotRow],
    weather: Option<&Weather>,
    setup: &Setup,
    limits: &Limits,
    options: &Options,
) -> Vec<Warning> {
    let mut warnings = Vec::new();
    match weather {
        None => warnings.push(Warning::NoWeather),
        Some(weather) => {
            for (what, there) in [
                ("wind", !weather.wind_m_s.is_empty()),
                ("irradiance", weather.dni_w_m2.is_some()),
                ("air temperature", weather.air_temperature_c.is_some()),
            ] {
                if !there {
                    warnings.push(Warning::NotRecorded { what });
                }
            }
        }
    }
    if let Some(step_s) = found.step_s
        && 1.0 / step_s < limits.camera_frames_per_s * 0.99
    {
        warnings.push(Warning::SlowSampling {
            found: 1.0 / step_s,
            wanted: limits.camera_frames_per_s,
        });
    }
    let missing_m_s = missing_winds(&found.histogram, limits);
    if !missing_m_s.is_empty() {
        warnings.push(Warning::WindNotCovered { missing_m_s });
    }
    for JudgedBin { limit, bin, .. } in &found.judged {
        let wind_m_s = limit.wind_m_s;
        if let Some(mean_m_s) = bin.mean_wind_m_s
            && (mean_m_s - wind_m_s).abs() > 0.25 * options.bin_half_width_m_s
        {
            warnings.push(Warning::OffCentre { wind_m_s, mean_m_s });
        }
        if bin.lost > 0 {
            warnings.push(Warning::LostFrames {
                wind_m_s,
                lost: bin.lost,
                counted: bin.frames,
            });
        }
        if bin.frames > 1 && bin.independent_frames <= 1.0 {
            warnings.push(Warning::Unresolved { wind_m_s });
        }
    }
    let unsure = setup.uncertainty;
    let mut counted = spots
        .iter()
        .zip(&found.frames)
        .filter(|(_, f)| f.eta_mrad.is_some());
    let centres = unsure.centre_m.is_some() || counted.all(|(spot, _)| spot.sigma_m.is_some());
    for (what, stated) in [
        ("the distance", unsure.slant_m.is_some()),
        ("the pixel scale", unsure.scale.is_some()),
        ("the survey of the target", unsure.survey_m.is_some()),
        ("the spots' centres", centres),
    ] {
        if !stated {
            warnings.push(Warning::NotStated { what });
        }
    }
    if setup.toward_heliostat.is_none() {
        warnings.push(Warning::NoDirection);
    }
    warnings
}

/// Ranges of the wind to cover without a counted frame.
fn missing_winds(histogram: &[WindBin], limits: &Limits) -> Vec<[f64; 2]> {
    let [from, to] = limits.wind_m_s;
    let mut missing: Vec<[f64; 2]> = Vec::new();
    for bin in histogram.iter().filter(|bin| bin.frames == 0) {
        let (low, high) = (bin.from_m_s.max(from), bin.to_m_s.min(to));
        if low >= high {
            continue;
        }
        match missing.last_mut() {
            Some(last) if last[1] >= low => last[1] = high,
            _ => missing.push([low, high]),
        }
    }
    missing
}

/// Frames that are counted together, in the order of their times.
struct Frames {
    /// Time as a whole number of frame steps.
    ticks: Vec<i64>,
    spots_m: Vec<[f64; 2]>,
    /// Scatter of each centre \[m\], 0 where none is stated.
    sigmas_m: Vec<f64>,
    winds_m_s: Vec<f64>,
}

impl Frames {
    fn of(
        spots: &[SpotRow],
        frames: &[EvaluatedFrame],
        order: &[usize],
        step_ns: Option<i64>,
        setup: &Setup,
        wanted: &dyn Fn(&EvaluatedFrame) -> bool,
    ) -> Self {
        let mut taken = Self {
            ticks: Vec::new(),
            spots_m: Vec::new(),
            sigmas_m: Vec::new(),
            winds_m_s: Vec::new(),
        };
        let step_ns = step_ns.unwrap_or(1).max(1);
        for &row in order {
            let spot = &spots[row];
            if let (Some(unix_ns), Some(spot_m)) = (spot.unix_ns, spot.spot_m)
                && wanted(&frames[row])
            {
                // rounded, so that a jitter of the clock moves no frame to its neighbour's step
                let half = step_ns / 2;
                taken
                    .ticks
                    .push(unix_ns.saturating_add(half).div_euclid(step_ns));
                taken.spots_m.push(spot_m);
                let sigma_m = spot.sigma_m.or(setup.uncertainty.centre_m);
                taken
                    .sigmas_m
                    .push(sigma_m.filter(|s| s.is_finite()).unwrap_or(0.0));
                taken
                    .winds_m_s
                    .push(frames[row].wind_m_s.unwrap_or(f64::NAN));
            }
        }
        taken
    }
}

/// What turns a spot's place into an error, as it is or with an instrument wrong.
#[derive(Debug, Clone, Copy)]
struct Target {
    slant_m: f64,
    scale: f64,
    shift_m: [f64; 2],
}

/// An instrument whose error is the same for all frames.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Cause {
    Slant,
    Scale,
    Survey,
}

impl Cause {
    fn slot(self, figure: &mut Figure) -> &mut f64 {
        match self {
            Self::Slant => &mut figure.slant_mrad,
            Self::Scale => &mut figure.scale_mrad,
            Self::Survey => &mut figure.survey_mrad,
        }
    }
}

impl Target {
    fn of(setup: &Setup) -> Self {
        Self {
            slant_m: setup.slant_m,
            scale: 1.0,
            shift_m: [0.0; 2],
        }
    }

    /// With each instrument wrong by so many standard deviations to either side; the survey along both
    /// components.
    fn moved(setup: &Setup, width: f64) -> [(Cause, Vec<[Self; 2]>); 3] {
        let plain = Self::of(setup);
        let unsure = setup.uncertainty;
        let by = |sigma: Option<f64>, with: &dyn Fn(f64) -> Self| {
            let step = width * sigma.unwrap_or(0.0);
            if step > 0.0 {
                vec![[with(-step), with(step)]]
            } else {
                Vec::new()
            }
        };
        let slant = by(unsure.slant_m, &|step| Self {
            slant_m: plain.slant_m + step,
            ..plain
        });
        let scale = by(unsure.scale, &|step| Self {
            scale: 1.0 + step,
            ..plain
        });
        let mut survey = by(unsure.survey_m, &|step| Self {
            shift_m: [step, 0.0],
            ..plain
        });
        survey.extend(by(unsure.survey_m, &|step| Self {
            shift_m: [0.0, step],
            ..plain
        }));
        [
            (Cause::Slant, slant),
            (Cause::Scale, scale),
            (Cause::Survey, survey),
        ]
    }

    fn place(&self, spot_m: [f64; 2]) -> [f64; 2] {
        [
            spot_m[0] * self.scale + self.shift_m[0],
            spot_m[1] * self.scale + self.shift_m[1],
        ]
    }

    /// Formula (1).
    fn eta_mrad(&self, spot_m: [f64; 2], aim_m: [f64; 2]) -> f64 {
        let placed = self.place(spot_m);
        let (u, v) = (placed[0] - aim_m[0], placed[1] - aim_m[1]);
        libm::sqrt(u * u + v * v) / self.slant_m * 1e3
    }
}

#[cfg(test)]
mod tests;
