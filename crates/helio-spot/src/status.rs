//! What became of a frame.

/// Whether a frame gave a spot.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
#[repr(u8)]
pub enum SpotStatus {
    /// A spot, whole and alone.
    Ok,
    /// No spot on the target.
    Empty,
    /// The spot reaches over the target's edge: its centre is that of the part that is seen, or a fit to it.
    Cut,
    /// Too much of the spot is as bright as the camera can tell.
    Saturated,
    /// More than one spot could be meant.
    Ambiguous,
    /// There is light that may be a spot's, but where its middle is cannot be told: the target is white all over, or so full of
    /// light that nothing without it is left.
    Unclear,
    /// The target was not found in the frame.
    NoTarget,
}

impl SpotStatus {
    /// Every status.
    pub const ALL: [Self; 7] = [
        Self::Ok,
        Self::Empty,
        Self::Cut,
        Self::Saturated,
        Self::Ambiguous,
        Self::Unclear,
        Self::NoTarget,
    ];

    /// The word for columns.
    #[must_use]
    pub const fn as_str(self) -> &'static str {
        match self {
            Self::Ok => "ok",
            Self::Empty => "empty",
            Self::Cut => "cut",
            Self::Saturated => "saturated",
            Self::Ambiguous => "ambiguous",
            Self::Unclear => "unclear",
            Self::NoTarget => "no_target",
        }
    }

    /// Whether a position comes with it: all but empty, unclear and no target.
    #[must_use]
    pub const fn has_position(self) -> bool {
        !matches!(self, Self::Empty | Self::Unclear | Self::NoTarget)
    }
}

/// What is to be known about a spot besides its status.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default)]
pub struct Flags(u16);

impl Flags {
    /// The spot reaches over the target's edge. On an empty target: light grows towards the edge, stray light or a spot whose
    /// middle is beyond it.
    pub const CUT: Self = Self(1);
    /// Some of the spot is as bright as the camera can tell, or most of a target that shows none.
    pub const SATURATED: Self = Self(1 << 1);
    /// Another spot on the target could be meant, or two have melted into one: it has a second top, or the shape of two
    /// round beams.
    pub const SEVERAL: Self = Self(1 << 2);
    /// Little brighter than the target around it.
    pub const FAINT: Self = Self(1 << 3);
    /// The light on the target is uneven where the spot is: a shadow's edge, grazing light, stray light.
    pub const UNEVEN_LIGHT: Self = Self(1 << 4);
    /// Far from where it was expected.
    pub const FAR_FROM_EXPECTED: Self = Self(1 << 5);
    /// The window of the standard is as large as the picture.
    pub const WINDOW_CLAMPED: Self = Self(1 << 6);
    /// Corners of the target were given and not looked for.
    pub const CORNERS_GIVEN: Self = Self(1 << 7);
    /// A corner of the target was not seen: it follows from the others.
    pub const CORNER_HIDDEN: Self = Self(1 << 8);

    const NAMES: [(Self, &'static str); 9] = [
        (Self::CUT, "cut"),
        (Self::SATURATED, "saturated"),
        (Self::SEVERAL, "several"),
        (Self::FAINT, "faint"),
        (Self::UNEVEN_LIGHT, "uneven_light"),
        (Self::FAR_FROM_EXPECTED, "far_from_expected"),
        (Self::WINDOW_CLAMPED, "window_clamped"),
        (Self::CORNERS_GIVEN, "corners_given"),
        (Self::CORNER_HIDDEN, "corner_hidden"),
    ];

    /// None.
    #[must_use]
    pub const fn none() -> Self {
        Self(0)
    }

    /// These and those.
    #[must_use]
    pub const fn with(self, other: Self) -> Self {
        Self(self.0 | other.0)
    }

    /// These, and those where it is so.
    #[must_use]
    pub const fn with_if(self, so: bool, other: Self) -> Self {
        if so { self.with(other) } else { self }
    }

    /// Whether all of those are among these.
    #[must_use]
    pub const fn contains(self, other: Self) -> bool {
        self.0 & other.0 == other.0
    }

    /// The words for columns.
    pub fn words(self) -> impl Iterator<Item = &'static str> {
        Self::NAMES
            .into_iter()
            .filter(move |(flag, _)| self.contains(*flag))
            .map(|(_, word)| word)
    }
}
