//! What is fitted.

use helio_core::MountErrors;

/// How many parameters there are.
pub const COUNT: usize = 7;

/// One of the seven parameters.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
#[repr(u8)]
pub enum Parameter {
    /// Component of the pedestal's tilt along mount axis 1: a = psi_t cos(psi_a) \[rad\].
    Tilt1 = 0,
    /// Component of the pedestal's tilt along mount axis 2: b = psi_t sin(psi_a) \[rad\].
    Tilt2 = 1,
    /// gamma0 \[rad\].
    AzimuthReference = 2,
    /// tau1 \[rad\].
    AxisNonorthogonality = 3,
    /// alpha0 \[rad\].
    ElevationReference = 4,
    /// mu \[rad\].
    MirrorTilt = 5,
    /// Hz \[m\].
    MirrorOffset = 6,
}

impl Parameter {
    /// All of them, in the order of [`Parameters::values`].
    pub const ALL: [Self; COUNT] = [
        Self::Tilt1,
        Self::Tilt2,
        Self::AzimuthReference,
        Self::AxisNonorthogonality,
        Self::ElevationReference,
        Self::MirrorTilt,
        Self::MirrorOffset,
    ];

    /// The word for columns and messages, with its unit.
    #[must_use]
    pub const fn as_str(self) -> &'static str {
        match self {
            Self::Tilt1 => "pedestal_tilt1_rad",
            Self::Tilt2 => "pedestal_tilt2_rad",
            Self::AzimuthReference => "azimuth_reference_rad",
            Self::AxisNonorthogonality => "axis_nonorthogonality_rad",
            Self::ElevationReference => "elevation_reference_rad",
            Self::MirrorTilt => "mirror_tilt_rad",
            Self::MirrorOffset => "mirror_offset_m",
        }
    }

    /// The words for people.
    #[must_use]
    pub const fn in_words(self) -> &'static str {
        match self {
            Self::Tilt1 => "pedestal tilt along mount axis 1",
            Self::Tilt2 => "pedestal tilt along mount axis 2",
            Self::AzimuthReference => "azimuth reference",
            Self::AxisNonorthogonality => "axis non-orthogonality",
            Self::ElevationReference => "elevation reference",
            Self::MirrorTilt => "mirror tilt",
            Self::MirrorOffset => "mirror offset",
        }
    }
}

/// The seven parameters of one heliostat; radians, and metres for the last.
///
/// ```
/// use helio_calib::Parameters;
/// use helio_core::MountErrors;
/// let errors = MountErrors { pedestal_tilt_rad: 0.01, ..MountErrors::default() };
/// let parameters = Parameters::new(&errors, 0.2);
/// assert_eq!(parameters.values, [0.01, 0.0, 0.0, 0.0, 0.0, 0.0, 0.2]);
/// assert_eq!(parameters.errors(), errors);
/// ```
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Parameters {
    /// In the order of [`Parameter::ALL`].
    pub values: [f64; COUNT],
}

impl Parameters {
    /// From a mount's errors and its mirror offset \[m\].
    #[must_use]
    pub fn new(errors: &MountErrors, mirror_offset_m: f64) -> Self {
        let (sine, cosine) = libm::sincos(errors.pedestal_tilt_azimuth_rad);
        Self {
            values: [
                errors.pedestal_tilt_rad * cosine,
                errors.pedestal_tilt_rad * sine,
                errors.azimuth_reference_rad,
                errors.axis_nonorthogonality_rad,
                errors.elevation_reference_rad,
                errors.mirror_tilt_rad,
                mirror_offset_m,
            ],
        }
    }

    /// The mount's errors, in their canonical form (see [`MountErrors::canonical`]).
    #[must_use]
    pub fn errors(&self) -> MountErrors {
        let [
            tilt1,
            tilt2,
            azimuth,
            nonorthogonality,
            elevation,
            mirror,
            _,
        ] = self.values;
        MountErrors {
            pedestal_tilt_rad: libm::hypot(tilt1, tilt2),
            pedestal_tilt_azimuth_rad: libm::atan2(tilt2, tilt1),
            axis_nonorthogonality_rad: nonorthogonality,
            mirror_tilt_rad: mirror,
            azimuth_reference_rad: azimuth,
            elevation_reference_rad: elevation,
        }
        .canonical()
    }

    /// The same mount in its canonical form.
    #[must_use]
    pub fn canonical(&self) -> Self {
        Self::new(&self.errors(), self.mirror_offset_m())
    }

    /// Hz \[m\].
    #[must_use]
    pub fn mirror_offset_m(&self) -> f64 {
        self.values[Parameter::MirrorOffset as usize]
    }

    /// One of them.
    #[must_use]
    pub fn get(&self, parameter: Parameter) -> f64 {
        self.values[parameter as usize]
    }
}
