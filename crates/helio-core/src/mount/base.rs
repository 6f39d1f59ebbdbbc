//! Base rotations: what makes four tracking modes of one formula.

use core::f64::consts::FRAC_PI_2;

use super::TrackingMode;
use crate::frame::{Enu, EnuUnit};

/// The mount's own axes as unit vectors of the world; a perfect mount's fixed axis is `axis3`.
///
/// These are the rows of the base rotation R in c = A R n, with det R = +1 in the papers' left-handed
/// north-east-up components (theory: "One formula, four tracking modes").
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct MountAxes {
    /// Where the normal points at zero angles.
    pub axis1: Enu,
    /// Completes the frame; growing axis-1 angles turn from `axis1` toward `axis2`.
    pub axis2: Enu,
    /// The fixed axis.
    pub axis3: Enu,
}

impl MountAxes {
    /// The axes of a mode for a heliostat that sees its aim in the direction `to_aim`.
    ///
    /// Only spinning-elevation depends on the aim. For a fixed axis exactly upright there (aim
    /// overhead) its azimuth counts as north.
    #[must_use]
    pub fn of(mode: TrackingMode, to_aim: EnuUnit) -> Self {
        match mode {
            TrackingMode::AzimuthElevation => Self {
                axis1: Enu::new(0.0, 1.0, 0.0),
                axis2: Enu::new(1.0, 0.0, 0.0),
                axis3: Enu::new(0.0, 0.0, 1.0),
            },
            // p0 of Guo 2015 eq. (3); (sin phi, -cos phi, 0); t.
            TrackingMode::SpinningElevation => {
                let t = to_aim.as_enu();
                let level = libm::hypot(t.east, t.north);
                let (sin_phi, cos_phi) = if level > 0.0 {
                    (t.east / level, t.north / level)
                } else {
                    (0.0, 1.0)
                };
                Self {
                    axis1: Enu::new(-t.up * sin_phi, -t.up * cos_phi, level),
                    axis2: Enu::new(-cos_phi, sin_phi, 0.0),
                    axis3: t,
                }
            }
            TrackingMode::PitchRoll { axis_azimuth_rad } => {
                let (sin_azimuth, cos_azimuth) = level_sin_cos(axis_azimuth_rad);
                Self {
                    axis1: Enu::new(0.0, 0.0, 1.0),
                    axis2: Enu::new(-cos_azimuth, sin_azimuth, 0.0),
                    axis3: Enu::new(sin_azimuth, cos_azimuth, 0.0),
                }
            }
            TrackingMode::Polar { latitude_rad } => {
                let (sin_latitude, cos_latitude) = libm::sincos(latitude_rad);
                if latitude_rad >= 0.0 {
                    Self {
                        axis1: Enu::new(0.0, -sin_latitude, cos_latitude),
                        axis2: Enu::new(-1.0, 0.0, 0.0),
                        axis3: Enu::new(0.0, cos_latitude, sin_latitude),
                    }
                } else {
                    // South of the equator the elevated pole is the southern one: the same mount
                    // turned half round about the vertical.
                    Self {
                        axis1: Enu::new(0.0, -sin_latitude, cos_latitude),
                        axis2: Enu::new(1.0, 0.0, 0.0),
                        axis3: Enu::new(0.0, -cos_latitude, -sin_latitude),
                    }
                }
            }
        }
    }
}

/// Sine and cosine of an azimuth, exact at whole quarter turns so that "east" is exactly east.
fn level_sin_cos(azimuth_rad: f64) -> (f64, f64) {
    let quarters = azimuth_rad / FRAC_PI_2;
    let nearest = libm::rint(quarters);
    if (quarters - nearest).abs() > 1e-14 {
        return libm::sincos(azimuth_rad);
    }
    match libm::fmod(nearest, 4.0) as i32 {
        0 => (0.0, 1.0),
        1 | -3 => (1.0, 0.0),
        2 | -2 => (0.0, -1.0),
        _ => (-1.0, 0.0),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    // det R = +1 in left-handed NEU is -1 in right-handed ENU: axis1 x axis2 = -axis3.
    #[test]
    fn every_mode_has_an_orthonormal_frame_of_the_papers_handedness() {
        let modes = [
            TrackingMode::AzimuthElevation,
            TrackingMode::SpinningElevation,
            TrackingMode::PitchRoll {
                axis_azimuth_rad: 1.1,
            },
            TrackingMode::PitchRoll {
                axis_azimuth_rad: FRAC_PI_2,
            },
            TrackingMode::PitchRoll {
                axis_azimuth_rad: 3.0 * FRAC_PI_2,
            },
            TrackingMode::PitchRoll {
                axis_azimuth_rad: -FRAC_PI_2,
            },
            TrackingMode::Polar { latitude_rad: 0.7 },
            TrackingMode::Polar { latitude_rad: -0.4 },
        ];
        for mode in modes {
            for azimuth_rad in [0.0, 2.0, 4.0] {
                let to_aim = EnuUnit::from_azimuth_elevation(azimuth_rad, 0.6);
                let m = MountAxes::of(mode, to_aim);
                assert!(
                    (m.axis1.cross(m.axis2) + m.axis3).norm() < 1e-15,
                    "{mode:?}"
                );
                assert!((m.axis1.norm() - 1.0).abs() < 1e-15);
                assert!(m.axis1.dot(m.axis2).abs() < 1e-15);
            }
        }
    }
}
