//! The list of causes that a field may have in common: one entry each.

use crate::model::{Real, torque};

/// A pose as the causes see it; `T` is one number or some lanes.
#[derive(Debug, Clone, Copy)]
pub(super) struct LoadedPose<T> {
    /// Cosine and sine of the first true angle, gamma.
    pub axis1: [T; 2],
    /// Cosine and sine of the second true angle, alpha.
    pub axis2: [T; 2],
    /// The world's up along the mount's axes.
    pub up: [T; 3],
}

/// Of what a cause has one value.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Scope {
    /// Of each heliostat, spread about the field's mean.
    Heliostat,
    /// Of each target.
    Target,
    /// Of the field.
    Field,
}

impl Scope {
    /// The word for columns.
    #[must_use]
    pub const fn as_str(self) -> &'static str {
        match self {
            Self::Heliostat => "heliostat",
            Self::Target => "target",
            Self::Field => "field",
        }
    }
}

/// What is said of a cause in one place.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Description {
    /// The word for columns and keys, with its unit.
    pub name: &'static str,
    /// The words for people.
    pub in_words: &'static str,
    /// Unit of the value as kept.
    pub unit: &'static str,
    /// Of what it has one value.
    pub scope: Scope,
    /// How large it may well be, one standard deviation about zero before anything was seen, in its unit.
    pub expected: f64,
    /// How far heliostats may well differ in it, in its unit; zero where they cannot.
    pub expected_spread: f64,
}

/// Each cause that turns a mirror about its axes is one entry: what is said of it, and by how much it turns
/// gamma and alpha in a pose for each radian of its value. That is its formula and its derivative at once,
/// as every one of them is linear in its value.
macro_rules! axis_causes {
    ($($(#[$doc:meta])* $name:ident { $($field:ident: $value:expr),+ $(,)? } |$pose:ident| $turn:expr;)+) => {
        /// A cause that turns a mirror about its axes.
        #[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
        pub enum AxisCause {
            $($(#[$doc])* $name,)+
        }

        impl AxisCause {
            /// All of them.
            pub const ALL: &'static [Self] = &[$(Self::$name),+];

            /// What is said of it.
            #[must_use]
            pub const fn description(self) -> Description {
                match self {
                    $(Self::$name => Description { $($field: $value),+ },)+
                }
            }

            /// That of a [name](Description::name).
            #[must_use]
            pub fn named(name: &str) -> Option<Self> {
                let mut all = Self::ALL.iter().copied();
                all.find(|cause| cause.description().name == name)
            }

            /// By how much gamma and alpha turn in a pose, per radian of its value.
            #[inline(always)]
            pub(super) fn turn<T: Real>(self, pose: &LoadedPose<T>) -> [T; 2] {
                match self {
                    $(Self::$name => {
                        let $pose = pose;
                        $turn
                    })+
                }
            }
        }
    };
}

axis_causes! {
    /// Sag of the first axis under the mirror's weight, [`helio_core::PoseErrors::axis1_sag_rad`].
    Axis1Sag {
        name: "axis1_sag_rad",
        in_words: "sag of axis 1",
        unit: "rad",
        scope: Scope::Field,
        expected: 5e-3,
        expected_spread: 0.0,
    } |pose| [torque(pose.up, pose.axis1, pose.axis2)[0], T::splat(0.0)];
    /// Sag of the second axis under the mirror's weight, [`helio_core::PoseErrors::axis2_sag_rad`].
    Axis2Sag {
        name: "axis2_sag_rad",
        in_words: "sag of axis 2",
        unit: "rad",
        scope: Scope::Field,
        expected: 5e-3,
        expected_spread: 0.0,
    } |pose| [T::splat(0.0), torque(pose.up, pose.axis1, pose.axis2)[1]];
    /// Eccentricity of the second axis' encoder: alpha is larger than read by this times sin(alpha). A drive
    /// that turns a little too far or too little for its steps looks the same.
    Axis2Eccentricity {
        name: "axis2_eccentricity_rad",
        in_words: "eccentricity of axis 2",
        unit: "rad",
        scope: Scope::Heliostat,
        expected: 2e-3,
        expected_spread: 1e-3,
    } |pose| [T::splat(0.0), pose.axis2[1]];
}

/// A record's spot as the causes that move it see it.
#[derive(Debug, Clone, Copy)]
pub(super) struct SeenSpot<T> {
    /// How fast the spot runs over the target, right and down, while the sun goes its way \[m/s\].
    pub sun_path_m_s: [T; 2],
}

/// Each cause that moves spots and turns nothing is one entry: what is said of it, and by how much it moves a spot
/// right and down on the target \[m\] for each unit of its value, linearly. Of those of a target every target has
/// its own value.
macro_rules! spot_causes {
    ($($(#[$doc:meta])* $name:ident { $($field:ident: $value:expr),+ $(,)? } |$spot:ident| $moves:expr;)+) => {
        /// A cause that moves spots on the target.
        #[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
        pub enum SpotCause {
            $($(#[$doc])* $name,)+
        }

        impl SpotCause {
            /// All of them.
            pub const ALL: &'static [Self] = &[$(Self::$name),+];

            /// What is said of it.
            #[must_use]
            pub const fn description(self) -> Description {
                match self {
                    $(Self::$name => Description { $($field: $value),+ },)+
                }
            }

            /// By how much it moves a spot right and down \[m\], per unit of its value.
            #[inline(always)]
            pub(super) fn moves<T: Real>(self, spot: &SeenSpot<T>) -> [T; 2] {
                match self {
                    $(Self::$name => {
                        let $spot = spot;
                        $moves
                    })+
                }
            }
        }
    };
}

spot_causes! {
    /// Every spot on a target lies farther right by this than where the target was surveyed says.
    TargetRight {
        name: "target_right_m",
        in_words: "shift of the target to the right",
        unit: "m",
        scope: Scope::Target,
        expected: 0.03,
        expected_spread: 0.0,
    } |_spot| [T::splat(1.0), T::splat(0.0)];
    /// The same, down.
    TargetDown {
        name: "target_down_m",
        in_words: "shift of the target downward",
        unit: "m",
        scope: Scope::Target,
        expected: 0.03,
        expected_spread: 0.0,
    } |_spot| [T::splat(0.0), T::splat(1.0)];
    /// The sun is where it will be this much later than the record says.
    SunTime {
        name: "sun_time_s",
        in_words: "sun ahead of its recorded time",
        unit: "s",
        scope: Scope::Field,
        expected: 10.0,
        expected_spread: 0.0,
    } |spot| spot.sun_path_m_s;
}

/// A cause of any kind, as reports name it.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Cause {
    /// Turns mirrors about their axes.
    Axis(AxisCause),
    /// Moves the spots on this target.
    Target(SpotCause, usize),
    /// Moves all spots.
    Spots(SpotCause),
}

impl Cause {
    /// What is said of it.
    #[must_use]
    pub const fn description(self) -> Description {
        match self {
            Self::Axis(cause) => cause.description(),
            Self::Target(cause, _) | Self::Spots(cause) => cause.description(),
        }
    }

    /// The target whose spots it moves, where it moves those of one.
    #[must_use]
    pub const fn target(self) -> Option<usize> {
        match self {
            Self::Target(_, target) => Some(target),
            Self::Axis(_) | Self::Spots(_) => None,
        }
    }

    /// The one of that name ([`Description::name`]); of this target where it is one of a target.
    #[must_use]
    pub fn named(name: &str, target: Option<usize>) -> Option<Self> {
        let mut of_spots = SpotCause::ALL.iter().filter_map(|&cause| cause.of(target));
        AxisCause::named(name)
            .map(Self::Axis)
            .or_else(|| of_spots.find(|cause| cause.description().name == name))
    }
}

impl SpotCause {
    /// Of a target where it is a cause of targets.
    pub(super) fn of(self, target: Option<usize>) -> Option<Cause> {
        match self.description().scope {
            Scope::Target => Some(Cause::Target(self, target?)),
            Scope::Field | Scope::Heliostat => Some(Cause::Spots(self)),
        }
    }
}
