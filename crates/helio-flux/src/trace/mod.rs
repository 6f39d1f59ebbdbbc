//! From elements to the flux on a receiver, by rays.

mod beam;
mod ends;
mod kernel;
mod occlusion;
mod plan;
mod rayset;
mod round;
mod tally;
mod tracer;
mod verdict;

pub use beam::Origins;
pub(crate) use beam::{Piece as MirrorPiece, across, pieces};
use helio_core::SimdLevel;
use occlusion::Obstacles;
use plan::Plan;
pub use rayset::RaySet;
use tracer::Tracer;

use crate::element::Element;
use crate::error::FluxError;
use crate::map::FluxMap;
use crate::optics::OpticalError;
use crate::parallel::{Going, Watch};
use crate::receiver::{Receiver, check_direction};
use crate::sunshape::SunShape;
use crate::vector::Vector;

/// Mirrors under the sun, and what they light.
#[derive(Debug, Clone, Copy)]
pub struct Scene<'a> {
    /// The mirrors' flat pieces.
    pub elements: &'a [Element],
    /// What they light.
    pub receiver: &'a Receiver,
    /// Direction to the sun, of any length.
    pub sun: [f64; 3],
    /// Direct normal irradiance \[W/m²\].
    pub dni_w_m2: f64,
    /// How the sun's light is spread over directions.
    pub sun_shape: &'a SunShape,
    /// What the mirrors' surface adds to that.
    pub optical_error: OpticalError,
}

/// How many rays.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum Rays {
    /// As many from each element, or each of two halves of a quadrilateral that is no parallelogram.
    PerElement(u64),
    /// So many in all, given to elements by the power on their apertures.
    Total(u64),
}

/// How rays are traced. Threads and instruction set change no bit of the answer.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct RayOptions {
    /// How many; each element's are rounded up to a multiple of 16.
    pub rays: Rays,
    /// Which of many equally good sets of rays.
    pub seed: u64,
    /// Where on an element rays start.
    pub origins: Origins,
    /// Whether mirrors stand in each other's light: elements of different
    /// [`mirror`](Element::mirror)s shade and block each other. A ray is blocked by what it meets before the receiver;
    /// one that misses, by what it meets before the plane of a flat receiver, and before all of any receiver is behind
    /// it.
    pub occlusion: bool,
    /// Most threads to use; 0 for as many as the thread pool has.
    pub threads: usize,
    /// Instruction set; `None` for the best that the processor has.
    pub level: Option<SimdLevel>,
}

impl Default for RayOptions {
    fn default() -> Self {
        Self {
            rays: Rays::Total(4_000_000),
            seed: 0,
            origins: Origins::Spread,
            occlusion: true,
            threads: 0,
            level: None,
        }
    }
}

/// Traces rays from every element to the receiver.
///
/// Every ray carries its share of the power on the element's aperture (Yan 2022 §2.3). The rays of all elements
/// are consecutive ones of one low-discrepancy sequence; power is counted in whole quanta, 2⁻⁶⁰ of
/// the sum, so that neither threads nor their order change a bit.
///
/// ```
/// use helio_flux::{Element, Plane, RayOptions, Receiver, Scene, SunShape, OpticalError, trace_rays};
/// // A mirror of 1 m² on the ground, the sun in the zenith, and a screen 10 m above.
/// let mirror = [[-0.5, -0.5, 0.0], [0.5, -0.5, 0.0], [0.5, 0.5, 0.0], [-0.5, 0.5, 0.0]];
/// let elements = [Element::quadrilateral(mirror)?];
/// let down = [0.0, 0.0, -1.0];
/// let plane = Plane::new([0.0, 0.0, 10.0], down, [1.0, 0.0, 0.0], [2.0, 2.0], [20, 20])?;
/// let scene = Scene {
///     elements: &elements,
///     receiver: &Receiver::Plane(plane),
///     sun: [0.0, 0.0, 1.0],
///     dni_w_m2: 1000.0,
///     sun_shape: &SunShape::pillbox(4.65e-3)?,
///     optical_error: OpticalError::NONE,
/// };
/// let map = trace_rays(&scene, &RayOptions::default())?;
/// // All of it arrives, and in the middle it is as strong as the sun.
/// assert!((map.account().received_w - 1000.0).abs() < 1e-9);
/// assert!((map.irradiance_w_m2()[10 * 20 + 10] - 1000.0).abs() < 5.0);
/// # Ok::<(), helio_flux::FluxError>(())
/// ```
///
/// # Errors
/// [`FluxError::BadValue`] for a sun without direction, an irradiance or a number of rays out of range,
/// [`FluxError::LevelUnavailable`] for an instruction set that this processor lacks.
pub fn trace_rays(scene: &Scene<'_>, options: &RayOptions) -> Result<FluxMap, FluxError> {
    let sun = scene.check()?;
    let level = checked_level(options.level)?;
    let plan = Plan::new(scene, sun, options)?;
    let (shape, error) = (scene.sun_shape, &scene.optical_error);
    let set = RaySet::new(shape, error, options.seed, plan.rays);
    let going = Going::new(None, plan.rays);
    Ok(run(scene, options, sun, level, &plan, &set, &going))
}

/// Like [`trace_rays`], for a long run that somebody watches and may stop: `watch` is told by the threads how many
/// rays they have just traced and how many there are in all. `None` if it asked to stop.
///
/// ```
/// use std::sync::atomic::{AtomicU64, Ordering};
/// # use helio_flux::{Element, FluxError, Plane, RayOptions, Receiver, Scene, SunShape, OpticalError};
/// use helio_flux::trace_rays_watched;
/// # let mirror = [[-0.5, -0.5, 0.0], [0.5, -0.5, 0.0], [0.5, 0.5, 0.0], [-0.5, 0.5, 0.0]];
/// # let elements = [Element::quadrilateral(mirror)?];
/// # let plane = Plane::new([0.0, 0.0, 10.0], [0.0, 0.0, -1.0], [1.0, 0.0, 0.0], [2.0, 2.0], [20, 20])?;
/// # let scene = Scene {
/// #     elements: &elements,
/// #     receiver: &Receiver::Plane(plane),
/// #     sun: [0.0, 0.0, 1.0],
/// #     dni_w_m2: 1000.0,
/// #     sun_shape: &SunShape::pillbox(4.65e-3)?,
/// #     optical_error: OpticalError::NONE,
/// # };
/// let traced = AtomicU64::new(0);
/// let count = |rays: u64, _all: u64| {
///     traced.fetch_add(rays, Ordering::Relaxed);
///     true
/// };
/// let map = trace_rays_watched(&scene, &RayOptions::default(), &count)?;
/// assert_eq!(map.map(|map| map.account().rays), Some(traced.into_inner()));
/// # Ok::<(), FluxError>(())
/// ```
///
/// # Errors
/// As [`trace_rays`].
pub fn trace_rays_watched(
    scene: &Scene<'_>,
    options: &RayOptions,
    watch: Watch<'_>,
) -> Result<Option<FluxMap>, FluxError> {
    let sun = scene.check()?;
    let level = checked_level(options.level)?;
    let plan = Plan::new(scene, sun, options)?;
    let (shape, error) = (scene.sun_shape, &scene.optical_error);
    let set = RaySet::new(shape, error, options.seed, plan.rays);
    let going = Going::new(Some(watch), plan.rays);
    let map = run(scene, options, sun, level, &plan, &set, &going);
    Ok(going.is_on().then_some(map))
}

/// Like [`trace_rays`], with rays that were made before.
///
/// # Errors
/// As [`trace_rays`], and [`FluxError::OtherRays`] if they were made for another sun shape, optical error or
/// seed.
pub fn trace_rays_with(
    scene: &Scene<'_>,
    options: &RayOptions,
    set: &RaySet,
) -> Result<FluxMap, FluxError> {
    let sun = scene.check()?;
    let level = checked_level(options.level)?;
    if !set.is_of(scene.sun_shape, &scene.optical_error, options.seed) {
        return Err(FluxError::OtherRays);
    }
    let plan = Plan::new(scene, sun, options)?;
    let going = Going::new(None, plan.rays);
    Ok(run(scene, options, sun, level, &plan, set, &going))
}

fn run(
    scene: &Scene<'_>,
    options: &RayOptions,
    sun: Vector,
    level: SimdLevel,
    plan: &Plan,
    set: &RaySet,
    going: &Going<'_>,
) -> FluxMap {
    let obstacles = options
        .occlusion
        .then(|| Obstacles::new(scene.elements))
        .flatten();
    let mut tracer = Tracer {
        scene,
        sun,
        sun_across: across(sun),
        level,
        seed: options.seed,
        plan,
        set,
        obstacles,
        candidates: Vec::new(),
    };
    tracer.look_around(options.threads);
    let tally = tracer.in_parallel(options.threads, going);
    tally.into_map(scene.receiver, plan)
}

impl Scene<'_> {
    /// The unit vector to the sun, if all is well.
    pub(crate) fn check(&self) -> Result<Vector, FluxError> {
        let sun = check_direction("scene", "sun", self.sun)?;
        if !(0.0..=1e6).contains(&self.dni_w_m2) {
            return Err(FluxError::BadValue {
                who: "scene",
                what: "dni_w_m2",
                wanted: "within 0..=1e6 W/m²",
                value: self.dni_w_m2,
            });
        }
        Ok(sun)
    }
}

fn checked_level(level: Option<SimdLevel>) -> Result<SimdLevel, FluxError> {
    let best = SimdLevel::best();
    match level {
        Some(level) if level > best => Err(FluxError::LevelUnavailable { level }),
        Some(level) => Ok(level),
        None => Ok(best),
    }
}
