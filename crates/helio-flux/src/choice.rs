//! Rays or a convolution, whichever is sooner at an error; and how sure the peak of a map is.

use core::fmt;

use crate::convolve::{ConvolveOptions, Measure};
use crate::error::FluxError;
use crate::map::FluxMap;
use crate::receiver::Receiver;
use crate::trace::{RayOptions, Rays, Scene, trace_rays};

/// Least error that a convolution is good for: what tables of the cone and the mean incidence leave of a peak.
const CONVOLVED: f64 = 5e-4;

/// Rays of the pilot for each element, and in all.
const PILOT: [u64; 2] = [16, 1 << 17];

/// Elements by which the effort of a convolution is told.
const ELEMENTS_ASKED: usize = 128;

/// Rays are few enough to be traced at all \[number\].
const MOST_RAYS: f64 = (1_u64 << 40) as f64;

/// Seconds of one thread, for a ray (of a plane, a round receiver, a mesh), for its being asked whether it is shaded or
/// blocked, for making an element and a set of rays ready, and for a polygon under a cone: measured on one machine; only
/// their ratios count.
const RAY_S: [f64; 3] = [1e-9, 2e-9, 5e-8];
const OCCLUDED_RAY_S: f64 = 5e-9;
const ELEMENT_S: f64 = 1.5e-6;
const SET_S: f64 = 1e-2;
const POLYGON_S: f64 = 1e-7;

/// A way to a map.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum Way {
    /// [`trace_rays`] with so many rays in all.
    Rays(u64),
    /// [`convolve()`](crate::convolve()) with so many points along each side of a bin.
    Convolution(usize),
}

/// Why a way was taken.
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
pub enum Why {
    /// Mirrors take this part of each other's light, of which only rays know.
    Occlusion(f64),
    /// A convolution cannot do it: parts of the receiver hide others, or bins are too coarse.
    NoConvolution,
    /// Only a convolution comes so close with fewer than 2⁴⁰ rays, or in the dark nothing does.
    NoRays,
    /// It was predicted to be the sooner one; seconds of one thread, by rays and by convolution.
    Sooner {
        /// By rays.
        rays_s: f64,
        /// By convolution.
        convolution_s: f64,
    },
}

impl fmt::Display for Why {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Occlusion(part) => write!(
                f,
                "mirrors take {:.2} % of each other's light, of which only rays know",
                100.0 * part
            ),
            Self::NoConvolution => write!(f, "a convolution cannot do it here"),
            Self::NoRays => write!(f, "too many rays would be needed"),
            Self::Sooner {
                rays_s,
                convolution_s,
            } => write!(
                f,
                "rays would take about {rays_s:.2} s of one thread, a convolution {convolution_s:.2} s"
            ),
        }
    }
}

/// A way, and why.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Choice {
    /// The way.
    pub way: Way,
    /// Why that one.
    pub why: Why,
}

/// Chooses rays (and their number) or a convolution, whichever is predicted to be sooner at an error: of the
/// irradiance of the peak's bin, one standard deviation, as part of it.
///
/// A few rays are traced first: they tell whether mirrors shade or block each other, which only rays can do justice to,
/// and how many rays the peak's bin gets. As many are taken then as random ones would need
/// ([`peak_error`]); low-discrepancy rays come closer. What a convolution takes is counted on some of the
/// elements. No clock is asked: the same input leads to the same choice.
///
/// ```
/// use helio_flux::{Element, OpticalError, Plane, Receiver, Scene, SunShape, Way, choose_way};
/// let mirror = [[-0.5, -0.5, 0.0], [0.5, -0.5, 0.0], [0.5, 0.5, 0.0], [-0.5, 0.5, 0.0]];
/// let plane = Plane::new([0.0, 0.0, 10.0], [0.0, 0.0, -1.0], [1.0, 0.0, 0.0], [2.0, 2.0], [20, 20])?;
/// let scene = Scene {
///     elements: &[Element::quadrilateral(mirror)?],
///     receiver: &Receiver::Plane(plane),
///     sun: [0.0, 0.0, 1.0],
///     dni_w_m2: 1000.0,
///     sun_shape: &SunShape::pillbox(4.65e-3)?,
///     optical_error: OpticalError::NONE,
/// };
/// assert_eq!(choose_way(&scene, 0.001, 0, 0)?.way, Way::Convolution(2));
/// # Ok::<(), helio_flux::FluxError>(())
/// ```
///
/// # Errors
/// [`FluxError::BadValue`] unless `error` lies in 5e-4..=0.5, and as [`trace_rays`]; [`FluxError::NotSettled`] or
/// [`FluxError::HiddenBin`] where neither way can do it.
pub fn choose_way(
    scene: &Scene<'_>,
    error: f64,
    seed: u64,
    threads: usize,
) -> Result<Choice, FluxError> {
    if !(CONVOLVED..=0.5).contains(&error) {
        return Err(FluxError::BadValue {
            who: "choice of rays or convolution",
            what: "error",
            wanted: "within 5e-4..=0.5 of the peak",
            value: error,
        });
    }
    let elements = scene.elements.len();
    let pilot = (PILOT[0] * elements as u64).max(PILOT[1]);
    let options = RayOptions {
        rays: Rays::Total(pilot),
        seed,
        threads,
        ..RayOptions::default()
    };
    let map = trace_rays(scene, &options)?;
    let account = map.account();
    let rays = rays_for(scene.receiver, &map, error, pilot);
    let occluded_w = account.shaded_w + account.blocked_w;
    let by_rays = |why| {
        let way = Way::Rays(rays.unwrap_or(pilot));
        Choice { way, why }
    };
    if occluded_w > 0.0 {
        return Ok(by_rays(Why::Occlusion(occluded_w / account.incoming_w)));
    }
    let points = ConvolveOptions::default().points;
    let options = ConvolveOptions {
        threads,
        ..ConvolveOptions::default()
    };
    let polygons = match Measure::of(scene, &options, ELEMENTS_ASKED) {
        Ok(polygons) => polygons,
        Err(_) if rays.is_some() => return Ok(by_rays(Why::NoConvolution)),
        Err(error) => return Err(error),
    };
    let Some(rays) = rays else {
        let way = Way::Convolution(points);
        return Ok(Choice {
            way,
            why: Why::NoRays,
        });
    };
    let kind = match scene.receiver {
        Receiver::Plane(_) => 0,
        Receiver::Frustum(_) => 1,
        Receiver::Mesh(_) => 2,
    };
    let several = scene
        .elements
        .windows(2)
        .any(|pair| pair[0].mirror() != pair[1].mirror());
    let asked_s = if several { OCCLUDED_RAY_S } else { 0.0 };
    let rays_s = SET_S + elements as f64 * ELEMENT_S + rays as f64 * (RAY_S[kind] + asked_s);
    let convolution_s = polygons * POLYGON_S;
    let way = if rays_s < convolution_s {
        Way::Rays(rays)
    } else {
        Way::Convolution(points)
    };
    let why = Why::Sooner {
        rays_s,
        convolution_s,
    };
    Ok(Choice { way, why })
}

/// Rays that bring the peak's bin to an error, by a pilot; `None` if they are too many, or none arrive.
fn rays_for(receiver: &Receiver, map: &FluxMap, error: f64, pilot: u64) -> Option<u64> {
    let found = scatter(receiver, map)?;
    // the pilot's peak is one that scatters upward, by some of its errors
    let peak = 1.0 + 3.0 * found;
    let rays = (map.account().rays as f64 * peak * (found / error) * (found / error)).ceil();
    (rays <= MOST_RAYS).then(|| (rays as u64).max(pilot))
}

/// Relative standard error of the peak's bin if rays were random: of n that arrive there, 1/√n.
fn scatter(receiver: &Receiver, map: &FluxMap) -> Option<f64> {
    let (flux, bin) = map.peak();
    let account = map.account();
    let peak_w = flux * receiver.bin_area_m2(bin);
    // of one ray, before anything is taken from it
    let ray_w = account.incoming_w / account.rays as f64;
    (peak_w > 0.0 && account.rays > 0).then(|| (ray_w / peak_w).sqrt())
}

/// How far the irradiance of a map's peak may be off, as part of it; `None` for a map without light.
///
/// Of rays, one standard error as it would be if they were random, 1/√n of n rays in the bin (counted as if nothing had
/// been lost of any): low-discrepancy rays scatter less. As many bins scatter, the greatest of equal ones lies two
/// or three of these above what it should be. Of a convolution, what 8 times 8 points say of that bin instead, and
/// 5e-4 for what the tables of its cones may be off. Unknown are errors that both share: flat elements, the sun's
/// shape.
///
/// # Errors
/// As [`convolve()`](crate::convolve()), for a map of it.
pub fn peak_error(scene: &Scene<'_>, map: &FluxMap) -> Result<Option<f64>, FluxError> {
    let (flux, bin) = map.peak();
    if flux.is_nan() || flux <= 0.0 {
        return Ok(None);
    }
    if map.account().rays > 0 {
        return Ok(scatter(scene.receiver, map));
    }
    let fine = Measure::bin_flux(scene, bin, 8)?;
    Ok(Some((fine - flux).abs() / flux + CONVOLVED))
}
