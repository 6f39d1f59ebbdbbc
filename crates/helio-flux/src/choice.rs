//! Rays or a convolution, whichever is sooner at an error; and how sure the peak of a map is.

use core::fmt;

use crate::convolve::{ConvolveOptions, Measure};
use crate::error::FluxError;
use crate::map::FluxMap;
use crate::receiver::Receiver;
use crate::trace::{RayOptions, Rays, Scene, trace_rays};

/// Least error that a convolution is good for: what tables of the cone and the mean incidence leave of a peak.
const CONVOLVED: f64 = 5e-4;

/// Rays of the first pilot for each element, and in all.
const PILOT: [u64; 2] = [16, 1 << 17];

/// A pilot with so many rays in the peak's bin, and this part of those wanted, tells how many are wanted; another is
/// repeated with so many times as many.
const COUNTED: f64 = 100.0;
/// What a pilot's peak may be above the truth by chance beyond what is expected: rays too few are traced twice.
const SPARE: f64 = 1.25;
const MORE: u64 = 8;

/// Elements by which the effort of a convolution is told.
const ELEMENTS_ASKED: usize = 128;

/// A pilot is no longer than this; rays are few enough to be traced at all \[number\].
const MOST_PILOT: f64 = (1_u64 << 33) as f64;
const MOST_RAYS: f64 = (1_u64 << 40) as f64;

/// Seconds of one thread, for a ray (of a plane, a round receiver, a mesh), for its being asked whether it is shaded or
/// blocked, for making an element and a set of rays ready, for a polygon under a cone and for tables of cones: measured on
/// one machine by `benches/src/bin/flux_choice.rs`; only their ratios count. Neighbours cost 7e-9 (a field) to 1.7e-8
/// (strips side by side).
const RAY_S: [f64; 3] = [1.2e-9, 1.4e-8, 2.1e-7];
const OCCLUDED_RAY_S: f64 = 1e-8;
const ELEMENT_S: f64 = 1.5e-6;
const SET_S: f64 = 2e-3;
const POLYGON_S: f64 = 9e-8;
const TABLES_S: f64 = 2e-3;

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
    /// Only a convolution comes so close with a reasonable number of rays, or in the dark nothing does.
    NoRays,
    /// It was predicted to be the sooner one; seconds of one thread, by rays and by convolution.
    Sooner {
        /// By rays.
        rays_s: f64,
        /// By convolution; `None` for more than by rays, which is not counted to the end.
        convolution_s: Option<f64>,
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
                convolution_s: Some(convolution_s),
            } => write!(
                f,
                "rays would take about {rays_s:.2} s of one thread, a convolution {convolution_s:.2} s"
            ),
            Self::Sooner { rays_s, .. } => write!(
                f,
                "rays would take about {rays_s:.2} s of one thread, a convolution more"
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
/// and how many rays the peak's bin gets; eight times as many until they are an eighth of those wanted, less what the
/// greatest of so many bins scatters upward. As many are taken then as random ones would need
/// ([`peak_error`]); low-discrepancy rays come closer. What a convolution takes is counted on some of the
/// elements, until it is more than the rays take. No clock is asked: the same input leads to the same choice.
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
    let (map, rays) = pilot(scene, error, seed, threads)?;
    let account = map.account();
    let occluded_w = account.shaded_w + account.blocked_w;
    let by_rays = |why| {
        let way = Way::Rays(rays.unwrap_or(account.rays));
        Choice { way, why }
    };
    // less than this is the rim of neighbours, and makes no difference to any bright bin
    if occluded_w > 0.1 * error * peak_w(scene.receiver, &map) {
        return Ok(by_rays(Why::Occlusion(occluded_w / account.incoming_w)));
    }
    let points = ConvolveOptions::default().points;
    let options = ConvolveOptions {
        threads,
        ..ConvolveOptions::default()
    };
    let rays_s = rays.map(|rays| seconds_of(scene, rays));
    let enough = rays_s.map_or(f64::INFINITY, |rays_s| rays_s / POLYGON_S);
    let polygons = match Measure::of(scene, &options, ELEMENTS_ASKED, enough) {
        Ok(polygons) => polygons,
        Err(_) if rays.is_some() => return Ok(by_rays(Why::NoConvolution)),
        Err(error) => return Err(error),
    };
    let by_convolution = Way::Convolution(points);
    let (Some(rays), Some(rays_s)) = (rays, rays_s) else {
        return Ok(Choice {
            way: by_convolution,
            why: Why::NoRays,
        });
    };
    let convolution_s = polygons.map(|polygons| TABLES_S + polygons * POLYGON_S);
    let way = match convolution_s {
        Some(seconds) if seconds <= rays_s => by_convolution,
        _ => Way::Rays(rays),
    };
    let why = Why::Sooner {
        rays_s,
        convolution_s,
    };
    Ok(Choice { way, why })
}

/// Seconds of one thread that so many rays take.
fn seconds_of(scene: &Scene<'_>, rays: u64) -> f64 {
    let elements = scene.elements;
    let kind = match scene.receiver {
        Receiver::Plane(_) => 0,
        Receiver::Frustum(_) => 1,
        Receiver::Mesh(_) => 2,
    };
    let several = elements
        .windows(2)
        .any(|pair| pair[0].mirror() != pair[1].mirror());
    let asked_s = if several { OCCLUDED_RAY_S } else { 0.0 };
    SET_S + elements.len() as f64 * ELEMENT_S + rays as f64 * (RAY_S[kind] + asked_s)
}

/// The map of a few rays, and how many bring the peak's bin to an error; `None` if they are too many, or none arrive.
fn pilot(
    scene: &Scene<'_>,
    error: f64,
    seed: u64,
    threads: usize,
) -> Result<(FluxMap, Option<u64>), FluxError> {
    let mut rays = (PILOT[0] * scene.elements.len() as u64).max(PILOT[1]);
    loop {
        let options = RayOptions {
            rays: Rays::Total(rays),
            seed,
            threads,
            ..RayOptions::default()
        };
        let map = trace_rays(scene, &options)?;
        let Some(found) = scatter(scene.receiver, &map) else {
            return Ok((map, None));
        };
        let counted = 1.0 / (found * found);
        let above = greatest_of(scene.receiver.bins());
        let expected = counted - above * counted.sqrt();
        let more = rays as f64 * MORE as f64;
        if expected >= COUNTED {
            let wanted = (SPARE * rays as f64 / (expected * error * error)).ceil();
            if wanted > MOST_RAYS {
                return Ok((map, None));
            }
            if wanted <= more {
                return Ok((map, Some((wanted as u64).max(rays))));
            }
        }
        if more > MOST_PILOT {
            return Ok((map, None));
        }
        rays *= MORE;
    }
}

/// By how many standard errors the greatest of so many bins that should be equal is expected above them (Cramér 1946
/// §28.6, to second order).
fn greatest_of(bins: usize) -> f64 {
    if bins < 2 {
        return 0.0;
    }
    let ln = libm::log(bins as f64);
    let first = libm::sqrt(2.0 * ln);
    let second = libm::log(ln) + libm::log(4.0 * core::f64::consts::PI);
    // of two, exactly
    (first - second / (2.0 * first)).max(libm::sqrt(core::f64::consts::FRAC_1_PI))
}

/// Power of the peak's bin \[W\].
fn peak_w(receiver: &Receiver, map: &FluxMap) -> f64 {
    let (flux, bin) = map.peak();
    flux.max(0.0) * receiver.bin_area_m2(bin)
}

/// Relative standard error of the peak's bin if rays were random: of n that arrive there, 1/√n.
fn scatter(receiver: &Receiver, map: &FluxMap) -> Option<f64> {
    let account = map.account();
    let peak_w = peak_w(receiver, map);
    // of one ray, before anything is taken from it
    let ray_w = account.incoming_w / account.rays as f64;
    (peak_w > 0.0 && account.rays > 0).then(|| (ray_w / peak_w).sqrt())
}

/// How far the irradiance of a map's peak may be off, as part of it; `None` for a map without light.
///
/// Of rays, one standard error as it would be if they were random, 1/√n of n rays in the bin (counted as if nothing had
/// been lost of any): low-discrepancy rays scatter less. As many bins scatter, the greatest of them lies above what it
/// should be: [`peak_excess`]. Of a convolution, what 8 times 8 points say of that bin instead (or where they
/// are too coarse, the tolerance of 1e-3), and 5e-4 for what the tables of its cones may be off. Unknown are errors that both share: flat elements, the sun's
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
    let other = Measure::bin_flux(scene, bin, 8)?.map(|fine| (fine - flux).abs() / flux);
    let off = other.unwrap_or(ConvolveOptions::default().tolerance);
    Ok(Some(off + CONVOLVED))
}

/// Rays that keep an error where a map of rays did not, by [`peak_error`]: the peak of its pilot was too high. `None` if it did.
#[must_use]
pub fn rays_to_repeat(receiver: &Receiver, map: &FluxMap, error: f64) -> Option<u64> {
    let rays = map.account().rays;
    let stated = scatter(receiver, map).filter(|stated| rays > 0 && *stated > error)?;
    let wanted = SPARE * rays as f64 * (stated / error) * (stated / error);
    (wanted <= MOST_RAYS).then_some(wanted.ceil() as u64)
}

/// By how much of itself the irradiance of a map's peak is expected too high at most, for being the greatest of bins that
/// scatter: of a traced map, as many standard errors as the greatest of those normal numbers has whose bins are as bright
/// within their scatter. 0 for a convolution, or one bin above all others; `None` for a map without light.
#[must_use]
pub fn peak_excess(receiver: &Receiver, map: &FluxMap) -> Option<f64> {
    let (peak, _) = map.peak();
    if map.account().rays == 0 {
        return (peak > 0.0).then_some(0.0);
    }
    let error = scatter(receiver, map)?;
    // two that are equal differ so much
    let within = 2.0 * greatest_of(map.irradiance_w_m2().len()) * error;
    let bright = |flux: &&f64| **flux >= peak * (1.0 - within);
    Some(greatest_of(map.irradiance_w_m2().iter().filter(bright).count()) * error)
}
