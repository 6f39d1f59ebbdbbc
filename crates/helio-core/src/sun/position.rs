//! Answers: one sun, and columns of suns.

use alloc::vec::Vec;
use core::ops::Range;

use crate::frame::EnuUnit;

/// Where the sun stands in a site's sky.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SunPosition {
    /// Azimuth \[rad\], clockwise from north, in [0, 2π).
    pub azimuth_rad: f64,
    /// Elevation of the centre as seen through the air \[rad\]: geometric plus refraction.
    pub apparent_elevation_rad: f64,
    /// Elevation of the centre without air \[rad\], parallax included.
    pub geometric_elevation_rad: f64,
}

impl SunPosition {
    /// Toward the sun as a heliostat sees it, through the air.
    ///
    /// ```
    /// use helio_core::sun::SunPosition;
    /// let sun = SunPosition {
    ///     azimuth_rad: 0.0,
    ///     apparent_elevation_rad: 30_f64.to_radians(),
    ///     geometric_elevation_rad: 29.97_f64.to_radians(),
    /// };
    /// assert!((sun.direction().as_enu().up - 0.5).abs() < 1e-15);
    /// assert!(sun.geometric_direction().as_enu().up < 0.4996);
    /// ```
    #[must_use]
    pub fn direction(&self) -> EnuUnit {
        EnuUnit::from_azimuth_elevation(self.azimuth_rad, self.apparent_elevation_rad)
    }

    /// Toward the sun as it were without air.
    #[must_use]
    pub fn geometric_direction(&self) -> EnuUnit {
        EnuUnit::from_azimuth_elevation(self.azimuth_rad, self.geometric_elevation_rad)
    }

    /// True if the apparent centre is below the horizon.
    #[must_use]
    pub fn is_below_horizon(&self) -> bool {
        self.apparent_elevation_rad < 0.0
    }
}

/// Suns as columns, one row per instant, in the order of the question.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct SunPositions {
    /// Azimuth \[rad\], clockwise from north, in [0, 2π).
    pub azimuth_rad: Vec<f64>,
    /// Elevation of the centre as seen through the air \[rad\].
    pub apparent_elevation_rad: Vec<f64>,
    /// Elevation of the centre without air \[rad\].
    pub geometric_elevation_rad: Vec<f64>,
}

impl SunPositions {
    /// Number of instants.
    #[must_use]
    pub fn len(&self) -> usize {
        self.azimuth_rad.len()
    }

    /// True if there is none.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.azimuth_rad.is_empty()
    }

    /// The sun of a row, `None` past the end.
    #[must_use]
    pub fn get(&self, row: usize) -> Option<SunPosition> {
        Some(SunPosition {
            azimuth_rad: *self.azimuth_rad.get(row)?,
            apparent_elevation_rad: *self.apparent_elevation_rad.get(row)?,
            geometric_elevation_rad: *self.geometric_elevation_rad.get(row)?,
        })
    }

    /// The suns, row by row.
    pub fn iter(&self) -> impl Iterator<Item = SunPosition> + '_ {
        (0..self.len()).filter_map(|row| self.get(row))
    }

    /// Sets the number of rows; what new rows hold is not defined.
    pub(super) fn resize(&mut self, len: usize) {
        self.azimuth_rad.resize(len, 0.0);
        self.apparent_elevation_rad.resize(len, 0.0);
        self.geometric_elevation_rad.resize(len, 0.0);
    }

    pub(super) fn columns(&mut self, rows: Range<usize>) -> Columns<'_> {
        Columns {
            azimuth: &mut self.azimuth_rad[rows.clone()],
            apparent: &mut self.apparent_elevation_rad[rows.clone()],
            geometric: &mut self.geometric_elevation_rad[rows],
        }
    }
}

/// Consecutive rows of an answer.
pub(super) struct Columns<'a> {
    pub azimuth: &'a mut [f64],
    pub apparent: &'a mut [f64],
    pub geometric: &'a mut [f64],
}

impl<'a> Columns<'a> {
    /// Divides at a row.
    #[cfg(feature = "std")]
    pub fn split_at(self, row: usize) -> (Self, Self) {
        let (azimuth, azimuth_rest) = self.azimuth.split_at_mut(row);
        let (apparent, apparent_rest) = self.apparent.split_at_mut(row);
        let (geometric, geometric_rest) = self.geometric.split_at_mut(row);
        let rest = Self {
            azimuth: azimuth_rest,
            apparent: apparent_rest,
            geometric: geometric_rest,
        };
        (
            Columns {
                azimuth,
                apparent,
                geometric,
            },
            rest,
        )
    }
}
