//! The mount: where its axes point, by how much it departs from the ideal, and how far it turns.

mod base;

use core::f64::consts::PI;

pub use base::MountAxes;

use crate::angle::wrap_pi;

/// The four ways of turning a mirror about two axes (Guo 2015 fig. 1).
///
/// They differ only in where the fixed axis nominally points; every mode has all error parameters,
/// forward and inverse. See [`MountAxes`] for the axes of each.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
#[non_exhaustive]
pub enum TrackingMode {
    /// Fixed axis vertical; axis angles are azimuth (from north through east) and elevation.
    #[default]
    AzimuthElevation,
    /// Fixed axis toward the aim point (target-oriented). Axis 1 is zero where the plane through
    /// the fixed axis stands upright; it is minus the spinning angle rho of Guo 2015 eq. (5).
    /// Axis 2 is 90° when the mirror faces the aim.
    SpinningElevation,
    /// Fixed axis level. Axis angles are zero when the mirror lies face up.
    PitchRoll {
        /// Where the fixed axis points \[rad\], clockwise from north; π/2 is east.
        axis_azimuth_rad: f64,
    },
    /// Fixed axis toward the elevated pole. In the northern hemisphere axis 1 is the hour angle of
    /// the normal (west positive) and axis 2 its declination; in the southern, where the mount is the
    /// same turned half round, axis 1 is minus the hour angle and axis 2 minus the declination.
    Polar {
        /// Latitude of the site \[rad\], north positive.
        latitude_rad: f64,
    },
}

impl TrackingMode {
    /// The word used in files.
    #[must_use]
    pub const fn as_str(self) -> &'static str {
        match self {
            Self::AzimuthElevation => "azimuth-elevation",
            Self::SpinningElevation => "spinning-elevation",
            Self::PitchRoll { .. } => "pitch-roll",
            Self::Polar { .. } => "polar",
        }
    }
}

/// The six angular errors of a mount (Guo 2015 §3 and §4.1). All zero is a perfect mount.
///
/// ```
/// use helio_core::MountErrors;
/// let leaning = MountErrors { pedestal_tilt_rad: 0.002, ..MountErrors::default() };
/// assert_eq!(leaning.canonical(), leaning);
/// ```
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct MountErrors {
    /// Lean of the fixed axis \[rad\], psi_t.
    pub pedestal_tilt_rad: f64,
    /// Where the fixed axis leans to \[rad\], psi_a: from mount axis 1 toward mount axis 2, which
    /// for an azimuth-elevation mount is clockwise from north.
    pub pedestal_tilt_azimuth_rad: f64,
    /// Moving axis away from square to the fixed axis \[rad\], tau1; magnitude below π/2.
    pub axis_nonorthogonality_rad: f64,
    /// Mirror plane away from parallel with the moving axis \[rad\], mu; magnitude below π/2.
    pub mirror_tilt_rad: f64,
    /// Reference of the first axis' encoder \[rad\], gamma0: its reading is the true angle plus this.
    pub azimuth_reference_rad: f64,
    /// Reference of the second axis' encoder \[rad\], alpha0: its reading is the true angle plus this.
    pub elevation_reference_rad: f64,
}

impl MountErrors {
    /// The same mount in its one canonical form: tilt not negative, tilt azimuth in [0, 2π),
    /// non-orthogonality and mirror tilt within ±π/2, references in [-π, π).
    ///
    /// Equivalent parameters (theory: "Equivalent parameters") give the same normal at the same
    /// encoder angles.
    ///
    /// ```
    /// use helio_core::MountErrors;
    /// let errors = MountErrors { pedestal_tilt_rad: -0.01, ..MountErrors::default() };
    /// let canonical = errors.canonical();
    /// assert_eq!(canonical.pedestal_tilt_rad, 0.01);
    /// assert!((canonical.pedestal_tilt_azimuth_rad - std::f64::consts::PI).abs() < 1e-15);
    /// ```
    #[must_use]
    pub fn canonical(self) -> Self {
        let mut e = self;
        e.pedestal_tilt_rad = wrap_pi(e.pedestal_tilt_rad);
        if e.pedestal_tilt_rad < 0.0 {
            e.pedestal_tilt_rad = -e.pedestal_tilt_rad;
            e.pedestal_tilt_azimuth_rad += PI;
        }
        e.mirror_tilt_rad = wrap_pi(e.mirror_tilt_rad);
        if !(-PI / 2.0..=PI / 2.0).contains(&e.mirror_tilt_rad) {
            e.mirror_tilt_rad = wrap_pi(PI - e.mirror_tilt_rad);
            e.elevation_reference_rad += PI;
        }
        e.axis_nonorthogonality_rad = wrap_pi(e.axis_nonorthogonality_rad);
        if !(-PI / 2.0..=PI / 2.0).contains(&e.axis_nonorthogonality_rad) {
            e.axis_nonorthogonality_rad = wrap_pi(PI - e.axis_nonorthogonality_rad);
            e.azimuth_reference_rad += PI;
            e.elevation_reference_rad += PI;
        }
        e.pedestal_tilt_azimuth_rad = crate::angle::wrap_tau(e.pedestal_tilt_azimuth_rad);
        e.azimuth_reference_rad = wrap_pi(e.azimuth_reference_rad);
        e.elevation_reference_rad = wrap_pi(e.elevation_reference_rad);
        e
    }
}

/// What stands between an axis' true angle and its encoder's beyond the reference, and changes with the
/// pose: sag of either axis under gravity, and eccentricity of the second axis' encoder. None by
/// default.
///
/// **Sag.** A mirror whose centre of mass lies before the axes (toward its normal) hangs on them, and
/// structure and drive give way in proportion to its torque; kappa is how far where it pulls an
/// axis round as hard as it can. Positive kappa sinks the mirror; negative stands for a counterweight
/// too heavy. The first axis of an azimuth-elevation mount, being upright, has no sag; its second
/// bends as a telescope's tube does, by -kappa2 cos(alpha).
///
/// **Eccentricity.** An encoder's disc off its axis, or a linear drive whose ratio is slightly off,
/// errs once per turn; e is how far the second axis turns too far where it stands square to its zero.
///
/// With g the world's up along the nominal [`MountAxes`], g = (axis1.up, axis2.up, axis3.up), and
/// gamma, alpha the *true* angles of the first and second axis,
///
/// ```text
/// up = cos(alpha) (cos(gamma) g1 + sin(gamma) g2) + sin(alpha) g3      how far up the normal points
/// sag1 = -kappa1 d(up)/d(gamma) = kappa1 cos(alpha) (sin(gamma) g1 - cos(gamma) g2)
/// sag2 = -kappa2 d(up)/d(alpha) = kappa2 (sin(alpha) (cos(gamma) g1 + sin(gamma) g2) - cos(alpha) g3)
/// gamma = encoder1 - gamma0 + sag1
/// alpha = encoder2 - alpha0 + sag2 + e sin(alpha)
/// ```
///
/// All are those of the true (for the sag: loaded) pose, so that encoder angles follow from a normal in
/// closed form, and only the normal for encoder angles has to be solved for.
///
/// ```
/// use helio_core::{Enu, Field, Heliostat, OffsetForm, PoseErrors, Tracker, TrackingMode};
/// let mut field = Field::new(TrackingMode::AzimuthElevation);
/// let mut heliostat = Heliostat::new(Enu::default(), Enu::new(0.0, 90.0, 0.0));
/// heliostat.pose_errors = PoseErrors { axis2_sag_rad: 0.004, ..PoseErrors::NONE };
/// field.push("A1", heliostat)?;
/// let tracker = Tracker::new(&field, OffsetForm::Exact)?;
/// // Its encoder says level, but the mirror looks 4 mrad down.
/// let normals = tracker.forward(&[0.0], &[0.0])?;
/// assert!((normals[0].elevation_rad() + 0.004).abs() < 1e-7);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct PoseErrors {
    /// Most that the first axis sags \[rad\], kappa1; magnitude at most [`MAX_RAD`](Self::MAX_RAD).
    pub axis1_sag_rad: f64,
    /// Most that the second axis sags \[rad\], kappa2; magnitude at most [`MAX_RAD`](Self::MAX_RAD).
    pub axis2_sag_rad: f64,
    /// How far the second axis turns beyond its encoder at alpha = 90° \[rad\], e; magnitude at most
    /// [`MAX_RAD`](Self::MAX_RAD).
    pub axis2_eccentricity_rad: f64,
}

impl PoseErrors {
    /// A stiff mount with centred encoders.
    pub const NONE: Self = Self {
        axis1_sag_rad: 0.0,
        axis2_sag_rad: 0.0,
        axis2_eccentricity_rad: 0.0,
    };

    /// Largest magnitude of each that a heliostat may have \[rad\]: some ten times what is found on
    /// real ones.
    pub const MAX_RAD: f64 = 0.05;

    /// True if there are none.
    #[must_use]
    pub fn is_none(&self) -> bool {
        *self == Self::NONE
    }

    /// From the three \[rad\] in the order of the fields.
    #[must_use]
    pub const fn from_array([axis1_sag, axis2_sag, axis2_eccentricity]: [f64; 3]) -> Self {
        Self {
            axis1_sag_rad: axis1_sag,
            axis2_sag_rad: axis2_sag,
            axis2_eccentricity_rad: axis2_eccentricity,
        }
    }

    /// The three \[rad\] in the order of the fields.
    #[must_use]
    pub const fn to_array(&self) -> [f64; 3] {
        [
            self.axis1_sag_rad,
            self.axis2_sag_rad,
            self.axis2_eccentricity_rad,
        ]
    }

    /// What the second axis may turn by at most \[rad\].
    pub(crate) fn axis2_most_rad(&self) -> f64 {
        self.axis2_sag_rad.abs() + self.axis2_eccentricity_rad.abs()
    }
}

/// How far the axes turn, on encoder angles \[rad\]; infinite where there is no limit.
///
/// A range may exceed a full turn, for encoders that count on: the representative nearest to the
/// middle of the range is chosen, or the nearest to a given present position.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct AxisLimits {
    /// Least angle of the first axis.
    pub axis1_min_rad: f64,
    /// Greatest angle of the first axis.
    pub axis1_max_rad: f64,
    /// Least angle of the second axis.
    pub axis2_min_rad: f64,
    /// Greatest angle of the second axis.
    pub axis2_max_rad: f64,
}

impl AxisLimits {
    /// No limits: the direct solution, with axis 1 in [0, 2π) unless a present position is given,
    /// which it then turns on from.
    pub const NONE: Self = Self {
        axis1_min_rad: f64::NEG_INFINITY,
        axis1_max_rad: f64::INFINITY,
        axis2_min_rad: f64::NEG_INFINITY,
        axis2_max_rad: f64::INFINITY,
    };

    /// True if no axis is limited on either side.
    #[must_use]
    pub fn is_none(&self) -> bool {
        *self == Self::NONE
    }

    /// The part that two sets of limits have in common; may be empty.
    #[must_use]
    pub fn intersect(self, other: Self) -> Self {
        Self {
            axis1_min_rad: self.axis1_min_rad.max(other.axis1_min_rad),
            axis1_max_rad: self.axis1_max_rad.min(other.axis1_max_rad),
            axis2_min_rad: self.axis2_min_rad.max(other.axis2_min_rad),
            axis2_max_rad: self.axis2_max_rad.min(other.axis2_max_rad),
        }
    }
}

impl Default for AxisLimits {
    fn default() -> Self {
        Self::NONE
    }
}
