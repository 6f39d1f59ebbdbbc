//! Where the observer stands, and in what air.

use core::f64::consts::{FRAC_PI_2, PI};

use super::error::SunError;

/// Yearly mean temperature assumed where none is given \[°C\].
pub const DEFAULT_TEMPERATURE_C: f64 = 12.0;

/// Flattening of the earth's meridian, b/a, as SPA has it (NREL/TP-560-34302 eq. 34).
const POLAR_TO_EQUATORIAL: f64 = 0.996_647_19;

/// Equatorial radius of the earth \[m\], as SPA has it (eq. 35).
const EARTH_RADIUS_M: f64 = 6_378_140.0;

/// Pressure of the standard atmosphere \[hPa\] at an elevation above the sea \[m\].
///
/// Source: ICAO Doc 7488, troposphere: p = 1013.25 (1 - 0.0065 h / 288.15)^5.25588.
/// Valid from -500 m to 11,000 m; NaN where the formula has no value (above 44 km).
///
/// ```
/// use helio_core::sun::standard_pressure_hpa;
/// assert_eq!(standard_pressure_hpa(0.0), 1013.25);
/// assert!((standard_pressure_hpa(1000.0) - 898.75).abs() < 0.01);
/// ```
#[must_use]
pub fn standard_pressure_hpa(elevation_m: f64) -> f64 {
    1013.25 * libm::pow(1.0 - 0.0065 / 288.15 * elevation_m, 5.255_88)
}

/// Where the sun is observed from, and the air there.
///
/// ```
/// use helio_core::angle::radians;
/// use helio_core::sun::SunSite;
/// let dunhuang = SunSite::new(radians(40.063), radians(94.426), 1138.0)?;
/// assert!((dunhuang.pressure_hpa() - 883.8).abs() < 0.1); // standard atmosphere
/// assert_eq!(dunhuang.temperature_c(), 12.0);
/// assert!(SunSite::new(40.063, 94.426, 1138.0).is_err()); // degrees are not radians
/// # Ok::<(), helio_core::sun::SunError>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SunSite {
    latitude_rad: f64,
    longitude_rad: f64,
    elevation_m: f64,
    pressure_hpa: f64,
    temperature_c: f64,
    pub(super) observer: Observer,
}

/// What the topocentric step needs of a site.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Observer {
    pub sin_latitude: f64,
    pub cos_latitude: f64,
    /// Distance from the earth's axis, in equatorial radii: x of eq. 35.
    pub axis_distance: f64,
    /// Height above the equator's plane, in equatorial radii: y of eq. 36.
    pub equator_height: f64,
}

impl SunSite {
    /// A site by latitude \[rad, north positive\], longitude \[rad, east positive\] and elevation above the
    /// sea \[m\], with the standard atmosphere's pressure there and [`DEFAULT_TEMPERATURE_C`].
    ///
    /// # Errors
    /// [`SunError::BadValue`] for a latitude beyond ±π/2, a longitude beyond ±π or an elevation
    /// outside -500..=11000 m.
    pub fn new(latitude_rad: f64, longitude_rad: f64, elevation_m: f64) -> Result<Self, SunError> {
        check(
            "latitude_rad",
            latitude_rad,
            -FRAC_PI_2,
            FRAC_PI_2,
            "within ±π/2 (±90°)",
        )?;
        check("longitude_rad", longitude_rad, -PI, PI, "within ±π (±180°)")?;
        check(
            "elevation_m",
            elevation_m,
            -500.0,
            11_000.0,
            "between -500 and 11000 m",
        )?;
        Ok(Self {
            latitude_rad,
            longitude_rad,
            elevation_m,
            pressure_hpa: standard_pressure_hpa(elevation_m),
            temperature_c: DEFAULT_TEMPERATURE_C,
            observer: Observer::new(latitude_rad, elevation_m),
        })
    }

    /// The same site with a given yearly mean pressure \[hPa\], not reduced to the sea; 0 for no
    /// refraction.
    ///
    /// # Errors
    /// [`SunError::BadValue`] outside 0..=2000 hPa.
    pub fn with_pressure_hpa(self, pressure_hpa: f64) -> Result<Self, SunError> {
        check(
            "pressure_hpa",
            pressure_hpa,
            0.0,
            2000.0,
            "between 0 and 2000 hPa",
        )?;
        Ok(Self {
            pressure_hpa,
            ..self
        })
    }

    /// The same site with a given yearly mean temperature \[°C\].
    ///
    /// # Errors
    /// [`SunError::BadValue`] outside ±100 °C.
    pub fn with_temperature_c(self, temperature_c: f64) -> Result<Self, SunError> {
        check(
            "temperature_c",
            temperature_c,
            -100.0,
            100.0,
            "between -100 and 100 °C",
        )?;
        Ok(Self {
            temperature_c,
            ..self
        })
    }

    /// Latitude \[rad\], north positive.
    #[must_use]
    pub const fn latitude_rad(&self) -> f64 {
        self.latitude_rad
    }

    /// Longitude \[rad\], east positive.
    #[must_use]
    pub const fn longitude_rad(&self) -> f64 {
        self.longitude_rad
    }

    /// Elevation above the sea \[m\].
    #[must_use]
    pub const fn elevation_m(&self) -> f64 {
        self.elevation_m
    }

    /// Pressure of the air \[hPa\].
    #[must_use]
    pub const fn pressure_hpa(&self) -> f64 {
        self.pressure_hpa
    }

    /// Temperature of the air \[°C\].
    #[must_use]
    pub const fn temperature_c(&self) -> f64 {
        self.temperature_c
    }
}

impl Observer {
    fn new(latitude_rad: f64, elevation_m: f64) -> Self {
        let (sin_latitude, cos_latitude) = libm::sincos(latitude_rad);
        // u = atan(b/a tan φ);  x = cos u + h cos φ;  y = b/a sin u + h sin φ
        let u = libm::atan(POLAR_TO_EQUATORIAL * libm::tan(latitude_rad));
        let (sin_u, cos_u) = libm::sincos(u);
        let height = elevation_m / EARTH_RADIUS_M;
        Self {
            sin_latitude,
            cos_latitude,
            axis_distance: cos_u + height * cos_latitude,
            equator_height: POLAR_TO_EQUATORIAL * sin_u + height * sin_latitude,
        }
    }
}

pub(super) fn check(
    what: &'static str,
    value: f64,
    min: f64,
    max: f64,
    wanted: &'static str,
) -> Result<(), SunError> {
    if (min..=max).contains(&value) {
        Ok(())
    } else {
        Err(SunError::BadValue {
            what,
            wanted,
            value,
        })
    }
}
