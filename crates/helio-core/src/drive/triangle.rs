//! A screw that closes a triangle with two fixed sides (Guo 2013, last page).
//!
//! The slide gives x + x0 = sqrt(a² + b² + 2ab cos(alpha + beta0)). The Jülich actuator is the same
//! triangle seen by the angle A = 180° - (alpha + beta0) between its fixed sides; one
//! implementation serves both.

use core::f64::consts::PI;

use crate::error::DriveError;

/// Slack in steps for the ends of a range: the end itself, computed back from its angle, is inside.
const STEPS_SLACK: f64 = 1e-6;

/// A linear actuator in the parameters of the Jülich actuator tables.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TriangleGeometry {
    /// Fixed side from the axis to the actuator's foot \[m\].
    pub offset_m: f64,
    /// Fixed side from the axis to the actuator's head \[m\].
    pub pivot_radius_m: f64,
    /// Length of the screw at zero steps \[m\].
    pub initial_stroke_length_m: f64,
    /// Actuator's own angle at zero steps \[rad\].
    pub initial_angle_rad: f64,
    /// Steps that lengthen the screw by a metre.
    pub steps_per_m: f64,
    /// True if the angle falls as the screw grows.
    pub clockwise: bool,
    /// The axis angle is this times the actuator's own angle: 1 or -1.
    pub sign: f64,
}

/// A linear screw in the form of Guo 2013.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ScrewGeometry {
    /// One arm of the bracket, a \[m\].
    pub arm_a_m: f64,
    /// The other arm, b \[m\].
    pub arm_b_m: f64,
    /// Bracket angle beta0 \[rad\]; alpha + beta0 must stay between 0 and π.
    pub bracket_rad: f64,
    /// Length x0 of the screw at zero steps \[m\].
    pub zero_length_m: f64,
    /// Steps that lengthen the screw by a metre; 1 makes "steps" the stroke x in metres.
    pub steps_per_m: f64,
    /// The axis angle is this times the slide's alpha: 1 or -1.
    pub sign: f64,
}

/// A linear actuator closing a triangle, ready to convert both ways.
///
/// The five worked cases published with the Jülich data are in the tests.
///
/// ```
/// use helio_core::drive::{ScrewGeometry, TriangleDrive};
/// let screw = ScrewGeometry {
///     arm_a_m: 0.4,
///     arm_b_m: 0.5,
///     bracket_rad: 0.3,
///     zero_length_m: 0.2,
///     steps_per_m: 1.0,
///     sign: 1.0,
/// };
/// let drive = TriangleDrive::from_screw(screw)?;
/// let angle_rad = 0.9_f64;
/// // x + x0 = sqrt(a² + b² + 2ab cos(alpha + beta0))
/// let length = (0.16 + 0.25 + 0.4 * (angle_rad + 0.3).cos()).sqrt();
/// assert!((drive.steps(angle_rad).unwrap() - (length - 0.2)).abs() < 1e-15);
/// # Ok::<(), helio_core::error::DriveError>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TriangleDrive {
    side_a_m: f64,
    side_b_m: f64,
    length_at_zero_m: f64,
    steps_per_m: f64,
    /// Axis angle = reference + slope · A, with A the angle between the fixed sides; slope is ±1.
    slope: f64,
    reference_rad: f64,
    range_steps: (f64, f64),
    limits_rad: (f64, f64),
}

impl TriangleDrive {
    /// A drive from the columns of a Jülich actuator table:
    /// t = a0 + (A(s) - A(s0)), or minus when clockwise.
    ///
    /// # Errors
    /// [`DriveError::BadValue`] if a number is out of range or the triangle does not close at zero steps.
    pub fn new(geometry: TriangleGeometry) -> Result<Self, DriveError> {
        let g = geometry;
        positive("offset_m", g.offset_m)?;
        positive("pivot_radius_m", g.pivot_radius_m)?;
        positive("steps_per_m", g.steps_per_m)?;
        finite("initial_angle_rad", g.initial_angle_rad)?;
        unit_sign(g.sign)?;
        let reach = (
            (g.offset_m - g.pivot_radius_m).abs(),
            g.offset_m + g.pivot_radius_m,
        );
        if !(g.initial_stroke_length_m >= reach.0 && g.initial_stroke_length_m <= reach.1) {
            return Err(DriveError::BadValue {
                what: "initial_stroke_length_m",
                wanted: "between the difference and the sum of the fixed sides",
                value: g.initial_stroke_length_m,
            });
        }
        let direction = if g.clockwise { -1.0 } else { 1.0 };
        let mut drive = Self {
            side_a_m: g.offset_m,
            side_b_m: g.pivot_radius_m,
            length_at_zero_m: g.initial_stroke_length_m,
            steps_per_m: g.steps_per_m,
            slope: direction * g.sign,
            reference_rad: 0.0,
            range_steps: (f64::NEG_INFINITY, f64::INFINITY),
            limits_rad: (f64::NEG_INFINITY, f64::INFINITY),
        };
        let at_zero = drive.triangle_angle_rad(g.initial_stroke_length_m);
        drive.reference_rad = g.sign * (g.initial_angle_rad - direction * at_zero);
        Ok(drive)
    }

    /// A drive from Guo's linear screw: A = π - (alpha + beta0).
    ///
    /// # Errors
    /// [`DriveError::BadValue`] if a number is out of range.
    pub fn from_screw(screw: ScrewGeometry) -> Result<Self, DriveError> {
        positive("arm_a_m", screw.arm_a_m)?;
        positive("arm_b_m", screw.arm_b_m)?;
        positive("steps_per_m", screw.steps_per_m)?;
        finite("bracket_rad", screw.bracket_rad)?;
        finite("zero_length_m", screw.zero_length_m)?;
        unit_sign(screw.sign)?;
        Ok(Self {
            side_a_m: screw.arm_a_m,
            side_b_m: screw.arm_b_m,
            length_at_zero_m: screw.zero_length_m,
            steps_per_m: screw.steps_per_m,
            slope: -screw.sign,
            reference_rad: screw.sign * (PI - screw.bracket_rad),
            range_steps: (f64::NEG_INFINITY, f64::INFINITY),
            limits_rad: (f64::NEG_INFINITY, f64::INFINITY),
        })
    }

    /// The same drive with an end at each side \[steps\].
    ///
    /// # Errors
    /// [`DriveError::BadValue`] if the range is empty or NaN.
    pub fn with_range(mut self, min_steps: f64, max_steps: f64) -> Result<Self, DriveError> {
        ordered("max_steps", min_steps, max_steps)?;
        self.range_steps = (min_steps, max_steps);
        Ok(self)
    }

    /// The same drive with mechanical stops at two axis angles \[rad\]. They narrow the range that a
    /// heliostat is given as limits; a conversion beyond them is still the mechanism's.
    ///
    /// # Errors
    /// [`DriveError::BadValue`] if the range is empty or NaN.
    pub fn with_stops(mut self, min_rad: f64, max_rad: f64) -> Result<Self, DriveError> {
        ordered("max_rad", min_rad, max_rad)?;
        self.limits_rad = (min_rad, max_rad);
        Ok(self)
    }

    /// Angle A between the fixed sides when the screw is `length_m` long, in [0, π].
    ///
    /// Half-angle form of the law of cosines: the arccosine of the slide loses half its digits
    /// near both ends.
    fn triangle_angle_rad(&self, length_m: f64) -> f64 {
        let difference = self.side_a_m - self.side_b_m;
        let sum = self.side_a_m + self.side_b_m;
        let opposite = (length_m - difference) * (length_m + difference);
        let adjacent = (sum - length_m) * (sum + length_m);
        2.0 * libm::atan2(libm::sqrt(opposite.max(0.0)), libm::sqrt(adjacent.max(0.0)))
    }

    pub(super) fn numbers(&self) -> [f64; 10] {
        let ((min_steps, max_steps), (min_rad, max_rad)) = (self.range_steps, self.limits_rad);
        [
            self.side_a_m,
            self.side_b_m,
            self.length_at_zero_m,
            self.steps_per_m,
            self.slope,
            self.reference_rad,
            min_steps,
            max_steps,
            min_rad,
            max_rad,
        ]
    }

    pub(super) fn from_numbers(numbers: [f64; 10]) -> Result<Self, DriveError> {
        let [
            side_a_m,
            side_b_m,
            length_at_zero_m,
            steps_per_m,
            slope,
            reference_rad,
            ..,
        ] = numbers;
        let [.., min_steps, max_steps, min_rad, max_rad] = numbers;
        positive("side_a_m", side_a_m)?;
        positive("side_b_m", side_b_m)?;
        finite("length_at_zero_m", length_at_zero_m)?;
        positive("steps_per_m", steps_per_m)?;
        unit_sign(slope)?;
        finite("reference_rad", reference_rad)?;
        Self {
            side_a_m,
            side_b_m,
            length_at_zero_m,
            steps_per_m,
            slope,
            reference_rad,
            range_steps: (f64::NEG_INFINITY, f64::INFINITY),
            limits_rad: (f64::NEG_INFINITY, f64::INFINITY),
        }
        .with_range(min_steps, max_steps)?
        .with_stops(min_rad, max_rad)
    }

    /// See [`Drive::steps`](super::Drive::steps).
    #[must_use]
    pub fn steps(&self, angle_rad: f64) -> Option<f64> {
        let triangle_rad = self.slope * (angle_rad - self.reference_rad);
        if !(0.0..=PI).contains(&triangle_rad) {
            return None;
        }
        // s² = (a - b)² + 4ab sin²(A/2)
        let difference = self.side_a_m - self.side_b_m;
        let half = libm::sin(0.5 * triangle_rad);
        let length_m =
            libm::sqrt(difference * difference + 4.0 * self.side_a_m * self.side_b_m * half * half);
        within(
            (length_m - self.length_at_zero_m) * self.steps_per_m,
            self.range_steps,
        )
    }

    /// See [`Drive::angle_rad`](super::Drive::angle_rad).
    #[must_use]
    pub fn angle_rad(&self, steps: f64) -> Option<f64> {
        let steps = within(steps, self.range_steps)?;
        let length_m = self.length_at_zero_m + steps / self.steps_per_m;
        let reach = (
            (self.side_a_m - self.side_b_m).abs(),
            self.side_a_m + self.side_b_m,
        );
        if !(length_m >= reach.0 && length_m <= reach.1) {
            return None;
        }
        Some(self.reference_rad + self.slope * self.triangle_angle_rad(length_m))
    }

    /// See [`Drive::range_rad`](super::Drive::range_rad).
    #[must_use]
    pub fn range_rad(&self) -> (f64, f64) {
        let reach = (
            (self.side_a_m - self.side_b_m).abs(),
            self.side_a_m + self.side_b_m,
        );
        let at = |steps: f64| {
            let length_m = self.length_at_zero_m + steps / self.steps_per_m;
            self.reference_rad
                + self.slope * self.triangle_angle_rad(length_m.clamp(reach.0, reach.1))
        };
        let (a, b) = (at(self.range_steps.0), at(self.range_steps.1));
        (
            a.min(b).max(self.limits_rad.0),
            a.max(b).min(self.limits_rad.1),
        )
    }
}

pub(super) fn within(steps: f64, (min, max): (f64, f64)) -> Option<f64> {
    (steps >= min - STEPS_SLACK && steps <= max + STEPS_SLACK).then_some(steps)
}

pub(super) fn positive(what: &'static str, value: f64) -> Result<(), DriveError> {
    if value.is_finite() && value > 0.0 {
        return Ok(());
    }
    Err(DriveError::BadValue {
        what,
        wanted: "finite and above zero",
        value,
    })
}

pub(super) fn finite(what: &'static str, value: f64) -> Result<(), DriveError> {
    if value.is_finite() {
        return Ok(());
    }
    Err(DriveError::BadValue {
        what,
        wanted: "finite",
        value,
    })
}

pub(super) fn unit_sign(value: f64) -> Result<(), DriveError> {
    if value == 1.0 || value == -1.0 {
        return Ok(());
    }
    Err(DriveError::BadValue {
        what: "sign",
        wanted: "1 or -1",
        value,
    })
}

pub(super) fn ordered(what: &'static str, min: f64, max: f64) -> Result<(), DriveError> {
    if min < max {
        return Ok(());
    }
    Err(DriveError::BadValue {
        what,
        wanted: "above the minimum",
        value: max,
    })
}
