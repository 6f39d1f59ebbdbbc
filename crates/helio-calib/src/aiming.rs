//! Encoder angles that send the beam to a point: the model run backwards.

use helio_core::angle::{wrap_pi, wrap_tau};
use helio_core::{Enu, EnuUnit};

use crate::measures::dot;
use crate::model::torque;
use crate::observation::Mount;
use crate::parameters::Parameters;

/// Encoder angles \[rad\] of a heliostat that sends its beam to `aim`: the exact mirror-centre normal of
/// Guo 2015 eqs. (9) and (16), then the direct solution of (22)-(27), less the mount's pose errors. `None` where it cannot: the aim
/// lies within the mirror offset, the sun opposite to it, or the normal in a blind cone.
///
/// The first angle lies in [0, 2π), the second in [-π, π). They agree with `helio_core::Tracker`, which
/// needs a tracking mode where a [`Mount`] has axes only.
///
/// ```
/// use helio_calib::{Mount, Parameters, aiming::encoder_angles_rad};
/// use helio_core::{Enu, EnuUnit, MountAxes, PoseErrors, TrackingMode};
/// let mount = Mount {
///     axes: MountAxes::of(TrackingMode::AzimuthElevation, EnuUnit::UP),
///     pivot: Enu::new(0.0, 100.0, 0.0),
///     mirror_offset_m: 0.0,
///     pose_errors: PoseErrors::NONE,
/// };
/// // Sun and aim both 45 degrees up in the south: so is the normal.
/// let sun = EnuUnit::from_azimuth_elevation(180_f64.to_radians(), 45_f64.to_radians());
/// let aim = Enu::new(0.0, 0.0, 100.0);
/// let [azimuth, elevation] = encoder_angles_rad(&mount, &Parameters::default(), sun, aim).unwrap();
/// assert!((azimuth.to_degrees() - 180.0).abs() < 1e-12);
/// assert!((elevation.to_degrees() - 45.0).abs() < 1e-12);
/// ```
#[must_use]
pub fn encoder_angles_rad(
    mount: &Mount,
    parameters: &Parameters,
    sun: EnuUnit,
    aim: Enu,
) -> Option<[f64; 2]> {
    aimed(mount, parameters, sun, aim).map(|(_, angles)| angles)
}

/// The normal along the mount's axes, beside the [`encoder_angles_rad`].
pub(crate) fn aimed(
    mount: &Mount,
    parameters: &Parameters,
    sun: EnuUnit,
    aim: Enu,
) -> Option<([f64; 3], [f64; 2])> {
    let [a, b, gamma0, tau1, alpha0, mu, offset_m] = parameters.values;
    let point = mount.components(aim - mount.pivot);
    let n = wanted_normal(mount.components(sun.as_enu()), point, offset_m)?;
    // c = A n, with A in the two components of the tilt (theory: "Smooth in the tilt")
    let tilt = libm::hypot(a, b);
    let (sine, cosine) = libm::sincos(tilt);
    let (k, h) = if tilt > 0.0 {
        let half = libm::sin(0.5 * tilt) / tilt;
        (sine / tilt, 2.0 * half * half)
    } else {
        (1.0, 0.5)
    };
    let across = a * n[0] + b * n[1];
    let c = [
        n[0] - a * (h * across + k * n[2]),
        n[1] - b * (h * across + k * n[2]),
        k * across + cosine * n[2],
    ];
    let (sin_tau, cos_tau) = libm::sincos(tau1);
    let (sin_mu, cos_mu) = libm::sincos(mu);
    let sin_alpha = (c[2] - sin_tau * sin_mu) / (cos_tau * cos_mu); // (22)
    let d2 = (sin_mu - sin_tau * c[2]) / cos_tau; // (24)
    let square = c[0] * c[0] + c[1] * c[1] - d2 * d2;
    if square.is_nan() || square < 0.0 {
        return None;
    }
    let d1 = libm::sqrt(square); // (23)
    let mut alpha = libm::atan2(sin_alpha * cos_mu, d1);
    let mut gamma = libm::atan2(c[1] * d1 - c[0] * d2, c[0] * d1 + c[1] * d2); // (25)-(27)
    if !mount.pose_errors.is_none() {
        let (sin_gamma, cos_gamma) = libm::sincos(gamma);
        let [torque1, torque2] =
            torque(mount.up(), [cos_gamma, sin_gamma], [d1 / cos_mu, sin_alpha]);
        gamma -= mount.pose_errors.axis1_sag_rad * torque1;
        alpha -= mount.pose_errors.axis2_sag_rad * torque2
            + mount.pose_errors.axis2_eccentricity_rad * sin_alpha;
    }
    Some((n, [wrap_tau(gamma + gamma0), wrap_pi(alpha + alpha0)]))
}

/// The normal that sends the sun to a point \[m, from the pivot, along the mount's axes\], Guo 2015 eq. (16) with
/// the exact tau: k = Hz C/(2 L C - Hz cos(theta)), C = sqrt(1 - k² sin²(theta)).
pub(crate) fn wanted_normal(sun: [f64; 3], point: [f64; 3], offset_m: f64) -> Option<[f64; 3]> {
    let slant_m = libm::sqrt(dot(point, point));
    if slant_m.is_nan() || slant_m <= offset_m.abs() {
        return None;
    }
    let sum: [f64; 3] = core::array::from_fn(|i| sun[i] + point[i] / slant_m);
    let difference: [f64; 3] = core::array::from_fn(|i| point[i] / slant_m - sun[i]);
    let cosine = 0.5 * libm::sqrt(dot(sum, sum));
    let sine = 0.5 * libm::sqrt(dot(difference, difference));
    if cosine.is_nan() || cosine <= 1e-6 {
        return None;
    }
    let (mut c, mut k) = (1.0, 0.0);
    for _ in 0..50 {
        k = offset_m * c / (2.0 * slant_m * c - offset_m * cosine);
        let next = libm::sqrt(1.0 - k * k * sine * sine);
        let done = next == c;
        c = next;
        if done {
            break;
        }
    }
    let n: [f64; 3] =
        core::array::from_fn(|i| sum[i] * (0.5 * c / cosine) + difference[i] * (0.5 * k));
    n.iter().all(|x| x.is_finite()).then_some(n)
}

/// Hour angle of a sun \[rad\], west (afternoon) positive, from where it stands over a latitude \[rad\].
///
/// ```
/// use helio_calib::aiming::hour_angle_rad;
/// use helio_core::EnuUnit;
/// let west = EnuUnit::from_azimuth_elevation(250_f64.to_radians(), 0.3);
/// assert!(hour_angle_rad(west, 0.9) > 0.0);
/// ```
#[must_use]
pub fn hour_angle_rad(sun: EnuUnit, latitude_rad: f64) -> f64 {
    let s = sun.as_enu();
    let (sine, cosine) = libm::sincos(latitude_rad);
    libm::atan2(-s.east, cosine * s.up - sine * s.north)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::Random;
    use helio_core::{
        Field, Heliostat, MountErrors, OffsetForm, PoseErrors, Status, Tracker, TrackingMode,
    };

    #[test]
    fn hour_angles_are_west_positive() {
        let latitude_rad = 0.7;
        let noon = EnuUnit::from_azimuth_elevation(core::f64::consts::PI, 0.8);
        assert!(hour_angle_rad(noon, latitude_rad).abs() < 1e-15);
        let evening = EnuUnit::from_azimuth_elevation(1.5 * core::f64::consts::PI, 0.2);
        assert!(hour_angle_rad(evening, latitude_rad) > 0.5);
    }

    #[test]
    fn angles_are_those_of_the_tracker_in_every_mode() {
        let mut random = Random::new(3);
        let mut worst = 0.0_f64;
        let mut compared = 0;
        for mode in [
            TrackingMode::AzimuthElevation,
            TrackingMode::SpinningElevation,
            TrackingMode::PitchRoll {
                axis_azimuth_rad: core::f64::consts::FRAC_PI_2,
            },
            TrackingMode::Polar { latitude_rad: 0.7 },
        ] {
            for _ in 0..500 {
                let pivot = Enu::new(
                    random.between(-90.0, 90.0),
                    random.between(30.0, 200.0),
                    0.0,
                );
                let aim = Enu::new(0.0, 0.0, random.between(20.0, 80.0));
                let heliostat = Heliostat {
                    mirror_offset_m: random.between(-0.3, 0.5),
                    errors: MountErrors {
                        pedestal_tilt_rad: random.between(0.0, 0.04),
                        pedestal_tilt_azimuth_rad: random.between(0.0, 6.0),
                        axis_nonorthogonality_rad: random.between(-0.1, 0.1),
                        mirror_tilt_rad: random.between(-0.04, 0.04),
                        azimuth_reference_rad: random.between(-3.0, 3.0),
                        elevation_reference_rad: random.between(-0.2, 0.2),
                    },
                    pose_errors: if compared % 3 == 0 {
                        PoseErrors::NONE
                    } else {
                        PoseErrors {
                            axis1_sag_rad: random.between(-0.05, 0.05),
                            axis2_sag_rad: random.between(-0.05, 0.05),
                            axis2_eccentricity_rad: random.between(-0.05, 0.05),
                        }
                    },
                    ..Heliostat::new(pivot, aim)
                };
                let sun = EnuUnit::from_azimuth_elevation(
                    random.between(1.2, 5.0),
                    random.between(0.1, 1.3),
                );
                let mut field = Field::new(mode);
                field.push("A", heliostat).unwrap();
                let tracking = Tracker::new(&field, OffsetForm::Exact).unwrap().track(sun);
                let mount = Mount::of(mode, &heliostat);
                let parameters = Parameters::new(&heliostat.errors, heliostat.mirror_offset_m);
                let got = encoder_angles_rad(&mount, &parameters, sun, aim);
                assert_eq!(got.is_some(), tracking.status()[0] == Status::Ok);
                let Some([axis1, axis2]) = got else { continue };
                let off1 = wrap_pi(axis1 - tracking.axis1_rad()[0]);
                let off2 = wrap_pi(axis2 - tracking.axis2_rad()[0]);
                // Near the fixed axis the first angle is ill-determined by nature.
                let level = libm::cos(axis2 - heliostat.errors.elevation_reference_rad);
                worst = worst.max((off1 * level).abs()).max(off2.abs());
                compared += 1;
            }
        }
        assert!(compared > 1900, "{compared}");
        assert!(worst < 1e-13, "{worst}");
    }
}
