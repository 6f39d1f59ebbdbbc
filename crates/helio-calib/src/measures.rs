//! How far predicted spots lie from observed ones.

use helio_core::{Enu, EnuUnit, TargetPlane};

use crate::model::{Pose, landing, normal};
use crate::observation::{Mount, Observation, Sighting};
use crate::parameters::{COUNT, Parameters};

/// Three ways to say how large the residuals are, each over the observations whose predicted beam reaches
/// the target; infinite where none does.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Measures {
    /// sqrt(mean of du² + dv²) \[m\].
    pub rms_m: f64,
    /// RMS of each distance over pivot-to-target-centre distance, as GRLM (1) \[mrad\].
    pub rms_mrad: f64,
    /// RMS angle, seen from the mirror centre, between predicted beam and measured spot \[mrad\].
    pub beam_rms_mrad: f64,
}

/// Residuals (predicted less observed, right and down \[m\]; NaN on a miss) with these parameters, and what
/// they come to.
///
/// ```
/// use helio_calib::{Mount, Observation, Parameters, measures};
/// use helio_core::{Enu, EnuUnit, MountAxes, TargetPlane, TrackingMode};
/// let axes = MountAxes::of(TrackingMode::AzimuthElevation, EnuUnit::UP);
/// let mount = Mount { axes, pivot: Enu::default(), mirror_offset_m: 0.0 };
/// let facing_north = EnuUnit::try_new(Enu::new(0.0, 1.0, 0.0))?;
/// let plane = TargetPlane::level(Enu::new(0.0, -100.0, 0.0), facing_north);
/// // the sun stands in the south at 40°, the mirror is lifted by 20.01°: the beam rises by 0.02°
/// let sun = EnuUnit::from_azimuth_elevation(std::f64::consts::PI, 40_f64.to_radians());
/// let seen = Observation::new(sun, std::f64::consts::PI, 20.01_f64.to_radians(), plane, 0.0, 0.0);
/// let (residuals, all) = measures(&mount, &[seen], &Parameters::default());
/// assert!((residuals[0][1] + 100.0 * 0.02_f64.to_radians().tan()).abs() < 1e-9); // v runs down
/// assert!((all.beam_rms_mrad - 1e3 * 0.02_f64.to_radians()).abs() < 1e-9);
/// # Ok::<(), helio_core::error::FrameError>(())
/// ```
#[must_use]
pub fn measures(
    mount: &Mount,
    observations: &[Observation],
    parameters: &Parameters,
) -> (Vec<[f64; 2]>, Measures) {
    let pose = Pose::of(parameters);
    let mut residuals = Vec::with_capacity(observations.len());
    let (mut landed, mut metres, mut angles, mut beams) = (0_usize, 0.0, 0.0, 0.0);
    for observation in observations {
        let sighting = Sighting::new(mount, observation);
        let land = landing(&pose, &sighting);
        if land.hits() {
            let [du, dv] = land.residual_m;
            let square = du * du + dv * dv;
            let to_centre = (observation.plane.centre - mount.pivot).norm();
            let beam = beam_error_rad(&pose, parameters.mirror_offset_m(), &sighting);
            landed += 1;
            metres += square;
            angles += square / (to_centre * to_centre);
            beams += beam * beam;
            residuals.push(land.residual_m);
        } else {
            residuals.push([f64::NAN; 2]);
        }
    }
    let root = |sum: f64| {
        if landed > 0 {
            libm::sqrt(sum / landed as f64)
        } else {
            f64::INFINITY
        }
    };
    let measures = Measures {
        rms_m: root(metres),
        rms_mrad: 1e3 * root(angles),
        beam_rms_mrad: 1e3 * root(beams),
    };
    (residuals, measures)
}

/// Angle of each observation, at the predicted mirror centre, between the predicted beam and the measured
/// spot \[mrad\]; NaN where the predicted beam misses the target.
#[must_use]
pub fn beam_errors_mrad(
    mount: &Mount,
    observations: &[Observation],
    parameters: &Parameters,
) -> Vec<f64> {
    let pose = Pose::of(parameters);
    observations
        .iter()
        .map(|observation| {
            let sighting = Sighting::new(mount, observation);
            if landing(&pose, &sighting).hits() {
                1e3 * beam_error_rad(&pose, parameters.mirror_offset_m(), &sighting)
            } else {
                f64::NAN
            }
        })
        .collect()
}

/// Unit vector of the reflected beam along the mount's axes: r = -s + 2 (s·n) n.
pub(crate) fn beam(pose: &Pose<f64>, sighting: &Sighting<f64>) -> [f64; 3] {
    reflected(sighting.sun, normal(pose, sighting).n)
}

fn reflected(sun: [f64; 3], n: [f64; 3]) -> [f64; 3] {
    let double = 2.0 * dot(sun, n);
    core::array::from_fn(|k| double * n[k] - sun[k])
}

/// Pivot → observed spot along the mount's axes \[m\].
pub(crate) fn observed_spot(sighting: &Sighting<f64>) -> [f64; 3] {
    let [plane_normal, right, down] = sighting.plane;
    core::array::from_fn(|k| {
        sighting.centre_along_normal_m * plane_normal[k]
            + sighting.spot_m[0] * right[k]
            + sighting.spot_m[1] * down[k]
    })
}

fn beam_error_rad(pose: &Pose<f64>, mirror_offset_m: f64, sighting: &Sighting<f64>) -> f64 {
    let n = normal(pose, sighting).n;
    let spot = observed_spot(sighting);
    let seen = core::array::from_fn(|k| spot[k] - mirror_offset_m * n[k]);
    angle_rad(reflected(sighting.sun, n), seen)
}

/// Angle between two vectors, exact for small ones too.
pub(crate) fn angle_rad(a: [f64; 3], b: [f64; 3]) -> f64 {
    let cross = [
        a[1] * b[2] - a[2] * b[1],
        a[2] * b[0] - a[0] * b[2],
        a[0] * b[1] - a[1] * b[0],
    ];
    libm::atan2(libm::sqrt(dot(cross, cross)), dot(a, b))
}

pub(crate) fn dot(a: [f64; 3], b: [f64; 3]) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

pub(crate) fn unit(a: [f64; 3]) -> Option<[f64; 3]> {
    let length = libm::sqrt(dot(a, a));
    (length > 1e-12 && length.is_finite()).then(|| a.map(|x| x / length))
}

/// The normal that sends the sun to a point \[m, from the pivot, along the mount's axes\]:
/// n = unit(s + unit(P - Hz n)) by fixed point (Shen 2016), which a mirror near its pivot reaches in a few
/// rounds. Nothing where the sun stands opposite to the point.
pub(crate) fn wanted_normal(
    sun: [f64; 3],
    point: [f64; 3],
    mirror_offset_m: f64,
) -> Option<[f64; 3]> {
    const ROUNDS: usize = 12;
    let toward = |n: [f64; 3]| {
        let beam = unit(core::array::from_fn(|k| point[k] - mirror_offset_m * n[k]))?;
        unit(core::array::from_fn(|k| sun[k] + beam[k]))
    };
    let mut n = toward([0.0; 3])?;
    for _ in 0..ROUNDS {
        let next = toward(n)?;
        let moved: [f64; 3] = core::array::from_fn(|k| next[k] - n[k]);
        n = next;
        if dot(moved, moved) < 1e-30 {
            break;
        }
    }
    Some(n)
}

/// One-standard-deviation error of the beam \[mrad\] that the parameters' uncertainty causes when the
/// heliostat tracks with these parameters to send the beam to `aim`: RMS over both directions across the
/// beam, sqrt(trace(J C Jᵀ)) over the beam's length.
///
/// `covariance` is in the order of [`Parameter::ALL`](crate::Parameter::ALL), as
/// [`Uncertainty::covariance`](crate::Uncertainty). The direct (not over-the-top) axis angles are taken.
/// Nothing where the heliostat cannot send this sun to the aim.
#[must_use]
pub fn pointing_sigma_mrad(
    mount: &Mount,
    parameters: &Parameters,
    covariance: &[[f64; COUNT]; COUNT],
    sun: EnuUnit,
    aim: Enu,
) -> Option<f64> {
    let offset = parameters.mirror_offset_m();
    let along_sun = mount.components(sun.as_enu());
    let along_aim = mount.components(aim - mount.pivot);
    let n = wanted_normal(along_sun, along_aim, offset)?;
    let [axis1, axis2] = encoders(parameters, n)?;
    let world =
        |v: [f64; 3]| mount.axes.axis1 * v[0] + mount.axes.axis2 * v[1] + mount.axes.axis3 * v[2];
    let back = EnuUnit::try_new(world(n) * offset + mount.pivot - aim).ok()?;
    // a plane square to the beam at the aim: what the spot moves there is the beam's angle times its length
    let plane = TargetPlane::level(aim, back);
    let sighting = Sighting {
        axis1,
        axis2,
        ..Sighting::new(mount, &Observation::new(sun, 0.0, 0.0, plane, 0.0, 0.0))
    };
    let land = landing(&Pose::of(parameters), &sighting);
    if !land.hits() {
        return None;
    }
    let mut variance = 0.0;
    for slopes in land.slopes {
        for (i, row) in covariance.iter().enumerate() {
            for (k, c) in row.iter().enumerate() {
                // held parameters have no variance whatever their slope is
                if *c != 0.0 {
                    variance += slopes[i] * c * slopes[k];
                }
            }
        }
    }
    Some(1e3 * libm::sqrt(variance.max(0.0)) / land.beam_m)
}

/// Cosine and sine of both encoder angles for a normal along the mount's axes, the direct solution:
/// Guo 2015 eq. (22)-(27). Nothing within a blind cone.
fn encoders(parameters: &Parameters, n: [f64; 3]) -> Option<[[f64; 2]; 2]> {
    let [a, b, gamma0, tau1, alpha0, mu, _] = parameters.values;
    let tilt = libm::hypot(a, b);
    // c = A n
    let (k, h) = if tilt > 1e-8 {
        (
            libm::sin(tilt) / tilt,
            2.0 * libm::pow(libm::sin(0.5 * tilt) / tilt, 2.0),
        )
    } else {
        (1.0, 0.5)
    };
    let lean = a * n[0] + b * n[1];
    let c = [
        n[0] - h * a * lean - k * a * n[2],
        n[1] - h * b * lean - k * b * n[2],
        k * lean + (1.0 - h * tilt * tilt) * n[2],
    ];
    let (sin_tau, cos_tau) = libm::sincos(tau1);
    let (sin_mu, cos_mu) = libm::sincos(mu);
    let sin_alpha = (c[2] - sin_tau * sin_mu) / (cos_tau * cos_mu);
    let d2 = (sin_mu - sin_tau * c[2]) / cos_tau;
    let square = c[0] * c[0] + c[1] * c[1] - d2 * d2;
    if !(square >= 0.0 && sin_alpha.abs() <= 1.0 + 1e-9) {
        return None;
    }
    let d1 = libm::sqrt(square);
    let alpha = libm::atan2(sin_alpha, d1 / cos_mu) + alpha0;
    let gamma = libm::atan2(c[1] * d1 - c[0] * d2, c[0] * d1 + c[1] * d2) + gamma0;
    let (sin1, cos1) = libm::sincos(gamma);
    let (sin2, cos2) = libm::sincos(alpha);
    Some([[cos1, sin1], [cos2, sin2]])
}
