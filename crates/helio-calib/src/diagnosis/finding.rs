//! What was noticed about a campaign, and why a record was left out.

use core::fmt;

/// Why a record was left out of the fit.
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
pub enum Reason {
    /// Its spot is farther from the prediction than its errors can explain.
    Outlier,
    /// Axis angles and spot fit the mount of another heliostat.
    WrongHeliostat {
        /// Which of [`Context::neighbours`](super::Context::neighbours).
        neighbour: usize,
    },
    /// The spot fits where the beam meets another target.
    WrongTarget {
        /// Which of [`Context::targets`](super::Context::targets).
        target: usize,
    },
    /// With the parameters found its beam does not meet the target's front.
    MissesTarget,
    /// The same numbers as another record.
    Duplicate {
        /// The row that was kept.
        of: usize,
    },
    /// A number is NaN or infinite, or the stated sigma is not positive.
    NotFinite,
}

impl Reason {
    /// The word for columns.
    #[must_use]
    pub const fn as_str(self) -> &'static str {
        match self {
            Self::Outlier => "outlier",
            Self::WrongHeliostat { .. } => "wrong_heliostat",
            Self::WrongTarget { .. } => "wrong_target",
            Self::MissesTarget => "misses_target",
            Self::Duplicate { .. } => "duplicate",
            Self::NotFinite => "not_finite",
        }
    }
}

impl fmt::Display for Reason {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Outlier => write!(f, "its spot is too far from where its beam lands"),
            Self::WrongHeliostat { neighbour } => {
                write!(f, "it fits the mount of neighbour {neighbour}")
            }
            Self::WrongTarget { target } => write!(f, "its spot fits target {target}"),
            Self::MissesTarget => write!(f, "its beam does not meet the target"),
            Self::Duplicate { of } => write!(f, "it repeats record {of}"),
            Self::NotFinite => write!(f, "a number is not finite or its sigma not positive"),
        }
    }
}

/// A record that was left out.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Rejected {
    /// Which observation, counted from 0.
    pub row: usize,
    /// Angle at the mirror between predicted beam and measured spot \[mrad\]; NaN where there is none.
    pub beam_mrad: f64,
    /// Why.
    pub reason: Reason,
}

/// A way in which all records may have been given wrongly.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum WrongCall {
    /// Encoder angles in degrees where radians were meant.
    EncoderInDegrees,
    /// Encoder angles in radians that were taken for degrees.
    EncoderInRadians,
    /// Encoder angles far beyond a few turns in any unit: motor steps.
    EncoderInSteps,
    /// The first axis' angles in degrees where radians were meant, the second's not.
    Axis1InDegrees,
    /// The first axis' angles in radians that were taken for degrees, the second's not.
    Axis1InRadians,
    /// The second axis' angles in degrees where radians were meant, the first's not.
    Axis2InDegrees,
    /// The second axis' angles in radians that were taken for degrees, the first's not.
    Axis2InRadians,
    /// Sun azimuth counted from south, positive toward east.
    SunFromSouthEastward,
    /// Sun azimuth counted from south, positive toward west.
    SunFromSouthWestward,
    /// The suns are those of other times, as from times with a wrong offset from UTC.
    TimesOff {
        /// By how much earlier than the records, in minutes; negative where later.
        early_minutes: i32,
    },
    /// The first axis counts the other way. (A second axis that does is the same mount over the top, with references
    /// half a turn off: its parameters are right.)
    Axis1Flipped,
    /// The two axes are exchanged.
    AxesSwapped,
    /// v counts upward.
    SpotUpward,
    /// u counts to the left.
    SpotMirrored,
    /// u and v are exchanged.
    SpotSwapped,
    /// The records are those of another heliostat.
    OtherHeliostat {
        /// Which of [`Context::neighbours`](super::Context::neighbours).
        neighbour: usize,
    },
    /// The spots were seen on another target.
    OtherTarget {
        /// Which of [`Context::targets`](super::Context::targets).
        target: usize,
    },
}

impl WrongCall {
    /// The word for columns.
    #[must_use]
    pub const fn as_str(self) -> &'static str {
        match self {
            Self::EncoderInDegrees => "encoder_in_degrees",
            Self::EncoderInRadians => "encoder_in_radians",
            Self::EncoderInSteps => "encoder_in_steps",
            Self::Axis1InDegrees => "axis1_in_degrees",
            Self::Axis1InRadians => "axis1_in_radians",
            Self::Axis2InDegrees => "axis2_in_degrees",
            Self::Axis2InRadians => "axis2_in_radians",
            Self::TimesOff { .. } => "times_off",
            Self::SunFromSouthEastward => "sun_from_south_eastward",
            Self::SunFromSouthWestward => "sun_from_south_westward",
            Self::Axis1Flipped => "axis1_flipped",
            Self::AxesSwapped => "axes_swapped",
            Self::SpotUpward => "spot_upward",
            Self::SpotMirrored => "spot_mirrored",
            Self::SpotSwapped => "spot_swapped",
            Self::OtherHeliostat { .. } => "other_heliostat",
            Self::OtherTarget { .. } => "other_target",
        }
    }

    const fn axis(self) -> &'static str {
        match self {
            Self::Axis1InDegrees | Self::Axis1InRadians => "first",
            _ => "second",
        }
    }
}

impl fmt::Display for WrongCall {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::EncoderInDegrees => {
                write!(f, "encoder angles look like degrees taken for radians")
            }
            Self::EncoderInRadians => {
                write!(f, "encoder angles look like radians taken for degrees")
            }
            Self::EncoderInSteps => write!(
                f,
                "encoder angles are far beyond a few turns: they look like motor steps"
            ),
            Self::Axis1InDegrees | Self::Axis2InDegrees => write!(
                f,
                "the {} axis' angles look like degrees taken for radians, the other's do not",
                self.axis()
            ),
            Self::Axis1InRadians | Self::Axis2InRadians => write!(
                f,
                "the {} axis' angles look like radians taken for degrees, the other's do not",
                self.axis()
            ),
            Self::TimesOff { early_minutes } => write!(
                f,
                "the suns look {} minutes too {}: are the times' offsets from UTC right?",
                early_minutes.abs(),
                if *early_minutes > 0 { "early" } else { "late" }
            ),
            Self::SunFromSouthEastward => write!(
                f,
                "the sun's azimuth looks counted from south toward east: 180° - azimuth is wanted"
            ),
            Self::SunFromSouthWestward => write!(
                f,
                "the sun's azimuth looks counted from south toward west: azimuth + 180° is wanted"
            ),
            Self::Axis1Flipped => write!(f, "the first axis looks counted the other way"),
            Self::AxesSwapped => write!(f, "the two axes look exchanged"),
            Self::SpotUpward => write!(f, "the spots' v looks counted upward instead of down"),
            Self::SpotMirrored => write!(
                f,
                "the spots' u looks counted to the left instead of the right, as a camera facing the target sees it"
            ),
            Self::SpotSwapped => write!(f, "the spots' u and v look exchanged"),
            Self::OtherHeliostat { neighbour } => {
                write!(f, "the records fit the mount of neighbour {neighbour}")
            }
            Self::OtherTarget { target } => write!(f, "the spots fit target {target}"),
        }
    }
}

/// Something to know about a campaign.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub enum Finding {
    /// Too few usable records for the parameters that are asked.
    TooFew {
        /// How many are usable.
        found: usize,
        /// How many are needed.
        wanted: usize,
    },
    /// The sun hardly moved between the records.
    AllAtOneTime {
        /// Largest angle between the first sun and another \[rad\].
        spread_rad: f64,
    },
    /// The records make sense only if read in another way.
    WrongCall {
        /// In which.
        call: WrongCall,
        /// Median beam error as given \[mrad\].
        as_given_mrad: f64,
        /// Median beam error when read that way \[mrad\]; NaN where only the size was looked at.
        corrected_mrad: f64,
    },
    /// The median beam error stays large, and no known wrong call explains it.
    Unexplained {
        /// Median beam error \[mrad\].
        median_mrad: f64,
    },
    /// Zero points jumped.
    Jump {
        /// Last record before.
        last_before: usize,
        /// First record after.
        first_after: usize,
        /// Time of the last record before, in nanoseconds from 1970 UTC.
        after_unix_ns: Option<i64>,
        /// Time of the first record after, in nanoseconds from 1970 UTC.
        before_unix_ns: Option<i64>,
        /// Change of the first axis' reference \[mrad\].
        axis1_mrad: f64,
        /// Change of the second axis' reference \[mrad\].
        axis2_mrad: f64,
    },
    /// An epoch is too short for its own six angles and took what jumps do not change (tilt,
    /// non-orthogonality, mirror tilt) from the whole campaign.
    Borrowed {
        /// Which epoch, counted from 0.
        epoch: usize,
    },
    /// No latitude was given: the gate looked at the whole sky on the side of the observed suns.
    NoLatitude,
}

impl Finding {
    /// The word for columns.
    #[must_use]
    pub const fn as_str(&self) -> &'static str {
        match self {
            Self::TooFew { .. } => "too_few",
            Self::AllAtOneTime { .. } => "all_at_one_time",
            Self::WrongCall { call, .. } => call.as_str(),
            Self::Unexplained { .. } => "unexplained",
            Self::Jump { .. } => "jump",
            Self::Borrowed { .. } => "borrowed",
            Self::NoLatitude => "no_latitude",
        }
    }
}

impl fmt::Display for Finding {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::TooFew { found, wanted } => {
                let s = if *found == 1 { "" } else { "s" };
                write!(f, "{found} usable record{s}, at least {wanted} are needed")
            }
            Self::AllAtOneTime { spread_rad } => write!(
                f,
                "all records are at one time: their suns lie within {:.3}°",
                spread_rad.to_degrees()
            ),
            Self::WrongCall {
                call,
                as_given_mrad,
                corrected_mrad,
            } => {
                write!(f, "{call}")?;
                if corrected_mrad.is_finite() {
                    write!(
                        f,
                        " (median beam error {as_given_mrad:.1} mrad as given, {corrected_mrad:.1} mrad then)"
                    )?;
                }
                Ok(())
            }
            Self::Unexplained { median_mrad } => write!(
                f,
                "the median beam error is {median_mrad:.1} mrad, and no known wrong call explains it"
            ),
            Self::Jump {
                last_before,
                first_after,
                axis1_mrad,
                axis2_mrad,
                ..
            } => write!(
                f,
                "zero points jumped between records {last_before} and {first_after}: \
                 by {axis1_mrad:+.1} mrad on the first axis, {axis2_mrad:+.1} mrad on the second"
            ),
            Self::Borrowed { epoch } => write!(
                f,
                "epoch {} is too short for its own six angles: tilt, non-orthogonality and \
                 mirror tilt are held near those of the whole campaign",
                epoch + 1
            ),
            Self::NoLatitude => write!(
                f,
                "no latitude is known: judged over the sky on the side of the observed suns \
                 instead of the year's"
            ),
        }
    }
}
