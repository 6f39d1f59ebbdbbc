//! What became of a row.

/// Why a row has, or does not have, an answer. Numbers, names and sentences are defined once, here.
///
/// The numbers are stable: they are the bytes of every status column.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default)]
#[repr(u8)]
pub enum Status {
    /// The row's numbers are valid.
    #[default]
    Ok = 0,
    /// No axis angles point the mirror there: the normal lies in a blind cone about the fixed axis.
    Unreachable = 1,
    /// Neither solution lies within the axis limits.
    OutsideLimits = 2,
    /// The apparent centre of the sun is below the horizon.
    SunBelowHorizon = 3,
    /// The sun stands opposite the aim: the mirror would be seen edge-on or from behind.
    SunOpposesAim = 4,
    /// The aim point is no farther from the pivot than the mirror's centre.
    AimAtPivot = 5,
    /// The reflected ray does not meet the front of the target plane.
    MissesTarget = 6,
}

impl Status {
    /// Every status, in the order of its number.
    pub const ALL: [Self; 7] = [
        Self::Ok,
        Self::Unreachable,
        Self::OutsideLimits,
        Self::SunBelowHorizon,
        Self::SunOpposesAim,
        Self::AimAtPivot,
        Self::MissesTarget,
    ];

    /// The word used in files, on the command line and in Python.
    ///
    /// ```
    /// assert_eq!(helio_core::Status::SunBelowHorizon.as_str(), "sun_below_horizon");
    /// ```
    #[must_use]
    pub const fn as_str(self) -> &'static str {
        match self {
            Self::Ok => "ok",
            Self::Unreachable => "unreachable",
            Self::OutsideLimits => "outside_limits",
            Self::SunBelowHorizon => "sun_below_horizon",
            Self::SunOpposesAim => "sun_opposes_aim",
            Self::AimAtPivot => "aim_at_pivot",
            Self::MissesTarget => "misses_target",
        }
    }

    /// The number written in status columns.
    #[must_use]
    pub const fn code(self) -> u8 {
        self as u8
    }

    /// The status of a number, if it is one.
    #[must_use]
    pub const fn from_code(code: u8) -> Option<Self> {
        if (code as usize) < Self::ALL.len() {
            Some(Self::ALL[code as usize])
        } else {
            None
        }
    }
}

impl core::fmt::Display for Status {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        f.write_str(self.as_str())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn codes_and_statuses_are_one_to_one() {
        for (code, status) in Status::ALL.into_iter().enumerate() {
            assert_eq!(usize::from(status.code()), code);
            assert_eq!(Status::from_code(status.code()), Some(status));
        }
        assert_eq!(Status::from_code(7), None);
    }
}
