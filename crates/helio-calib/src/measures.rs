//! How far predicted spots lie from observed ones.

use helio_core::{Enu, EnuUnit, TargetPlane};

use crate::aiming::aimed;
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
/// use helio_core::{Enu, EnuUnit, MountAxes, PoseErrors, TargetPlane, TrackingMode};
/// let axes = MountAxes::of(TrackingMode::AzimuthElevation, EnuUnit::UP);
/// let mount = Mount { axes, pivot: Enu::default(), mirror_offset_m: 0.0, pose_errors: PoseErrors::NONE };
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

pub(crate) fn reflected(sun: [f64; 3], n: [f64; 3]) -> [f64; 3] {
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
    let across = cross(a, b);
    libm::atan2(libm::sqrt(dot(across, across)), dot(a, b))
}

pub(crate) fn cross(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    [
        a[1] * b[2] - a[2] * b[1],
        a[2] * b[0] - a[0] * b[2],
        a[0] * b[1] - a[1] * b[0],
    ]
}

pub(crate) fn dot(a: [f64; 3], b: [f64; 3]) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
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
    Some(spread_mrad(
        &beam_slopes(mount, parameters, &Pose::of(parameters), sun, aim)?,
        covariance,
    ))
}

/// sqrt(trace(J C Jᵀ)) with the slopes of [`beam_slopes`].
pub(crate) fn spread_mrad(slopes: &[[f64; COUNT]; 2], covariance: &[[f64; COUNT]; COUNT]) -> f64 {
    let mut variance = 0.0;
    for slopes in slopes {
        for (i, row) in covariance.iter().enumerate() {
            for (k, c) in row.iter().enumerate() {
                // held parameters have no variance whatever their slope is
                if *c != 0.0 {
                    variance += slopes[i] * c * slopes[k];
                }
            }
        }
    }
    libm::sqrt(variance.max(0.0))
}

/// What each parameter does to the beam that is sent to `aim`, in two directions across it \[mrad/rad, mrad/m\].
pub(crate) fn beam_slopes(
    mount: &Mount,
    parameters: &Parameters,
    pose: &Pose<f64>,
    sun: EnuUnit,
    aim: Enu,
) -> Option<[[f64; COUNT]; 2]> {
    let (n, [axis1, axis2]) = aimed(mount, parameters, sun, aim)?;
    let world =
        |v: [f64; 3]| mount.axes.axis1 * v[0] + mount.axes.axis2 * v[1] + mount.axes.axis3 * v[2];
    let back = world(n) * parameters.mirror_offset_m() + mount.pivot - aim;
    // a plane square to the beam at the aim: what the spot moves there is the beam's angle times its length
    let plane = TargetPlane::level(aim, EnuUnit::try_new(back).ok()?);
    let seen = Observation::new(sun, axis1, axis2, plane, 0.0, 0.0);
    let land = landing(pose, &Sighting::new(mount, &seen));
    land.hits().then(|| {
        land.slopes
            .map(|slopes| slopes.map(|slope| 1e3 * slope / land.beam_m))
    })
}
