//! From elements to the flux on a receiver, by integrals: the outline of every mirror against the cone of the sun.

mod outline;
mod radial;
mod refine;

use outline::Outline;
use radial::Radial;
use rayon::iter::{IntoParallelIterator, ParallelIterator};
use refine::Integral;

use crate::account::Account;
use crate::error::FluxError;
use crate::map::FluxMap;
use crate::parallel::{Going, Watch};
use crate::trace::Scene;
use crate::vector::dot;

/// How a convolution is done. Threads change no bit of the answer.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ConvolveOptions {
    /// Points along each side of a bin over which its flux is averaged; of a mesh's triangles, its square. Where
    /// that is too coarse for the images, the bin gets more.
    pub points: usize,
    /// Where bins need more points: how much twice as many along each side may change the power of all such bins
    /// together, as part of the reflected power. And by how much more than is reflected may be received.
    pub tolerance: f64,
    /// Most threads to use; 0 for as many as the thread pool has.
    pub threads: usize,
}

impl Default for ConvolveOptions {
    fn default() -> Self {
        Self {
            points: 2,
            tolerance: 1e-3,
            threads: 0,
        }
    }
}

/// Incidences that have a widened cone of their own: 64 steps of the cosine change it by less than 1 %.
const STEPS: usize = 64;

/// The flux on the receiver as an integral over every element.
///
/// A point of the receiver sees a flat mirror show it the sun, and the part of the sun's light that lies within
/// the mirror's outline is what it gets: E = ρ DNI cos(θ) ∫ B dω over the outline as seen from the point. That is
/// exact for a flat piece at any distance, and costs no rays; what is left is the average over a bin, for which
/// `points` squared points stand.
///
/// Where these lie farther apart than a quarter of the image of a mirror (its width, or at the bin's distance that of
/// half the sun's light), the bin is given twice as many along each side until they do not, and twice as many again
/// until that changes no more than [`ConvolveOptions::tolerance`]. Finer bins keep their points.
///
/// Slope errors widen the cone by 2σ in the plane of incidence and 2σ cos(incidence) across; here they do so all
/// round by the mean square of the two. Elements neither shade nor block each other here.
///
/// ```
/// use helio_flux::{ConvolveOptions, Element, OpticalError, Plane, Receiver, Scene, SunShape, convolve};
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
/// let map = convolve(&scene, &ConvolveOptions::default())?;
/// assert_eq!(map.irradiance_w_m2()[10 * 20 + 10], 1000.0);
/// assert!((map.account().received_w - 1000.0).abs() < 0.5);
/// # Ok::<(), helio_flux::FluxError>(())
/// ```
///
/// # Errors
/// [`FluxError::BadValue`] for a sun without direction, an irradiance out of range, `points` outside 1..=64 or a tolerance outside
/// 1e-6..=1; [`FluxError::NotSettled`] if bins are so coarse that more effort than is reasonable leaves the tolerance
/// unmet, or more is received than is reflected.
pub fn convolve(scene: &Scene<'_>, options: &ConvolveOptions) -> Result<FluxMap, FluxError> {
    run(
        scene,
        options,
        &Going::new(None, scene.receiver.bins() as u64),
    )
}

/// Like [`convolve()`], for a long run that somebody watches and may stop: `watch` is told by the threads how many
/// bins they have just done and how many there are in all. `None` if it asked to stop.
///
/// # Errors
/// As [`convolve()`].
pub fn convolve_watched(
    scene: &Scene<'_>,
    options: &ConvolveOptions,
    watch: Watch<'_>,
) -> Result<Option<FluxMap>, FluxError> {
    let going = Going::new(Some(watch), scene.receiver.bins() as u64);
    let map = run(scene, options, &going)?;
    Ok(going.is_on().then_some(map))
}

fn run(
    scene: &Scene<'_>,
    options: &ConvolveOptions,
    going: &Going<'_>,
) -> Result<FluxMap, FluxError> {
    let sun = scene.check()?;
    if !(1..=64).contains(&options.points) {
        return Err(FluxError::BadValue {
            who: "convolution",
            what: "points",
            wanted: "within 1..=64",
            value: options.points as f64,
        });
    }
    if !(options.tolerance >= 1e-6 && options.tolerance <= 1.0) {
        return Err(FluxError::BadValue {
            who: "convolution",
            what: "tolerance",
            wanted: "within 1e-6..=1",
            value: options.tolerance,
        });
    }
    let mut account = Account::default();
    let mut steps = [None; STEPS + 1];
    let mut outlines = Vec::with_capacity(scene.elements.len());
    for element in scene.elements {
        let cosine = dot(element.normal(), sun);
        if cosine <= 0.0 {
            account.turned_away += 1;
            continue;
        }
        let incoming_w = scene.dni_w_m2 * element.aperture_m2(sun);
        account.mirror_w += scene.dni_w_m2 * element.area_m2();
        account.incoming_w += incoming_w;
        account.reflection_loss_w += incoming_w * (1.0 - element.reflectivity());
        let step = (cosine * STEPS as f64).round() as usize;
        let strength = scene.dni_w_m2 * element.reflectivity();
        outlines.push(Outline::new(element, sun, step, strength));
        steps[step] = Some(());
    }
    let slope = scene.optical_error.slope_rms_rad();
    let scatter = scene.optical_error.specularity_rms_rad();
    let cones: Vec<Option<Radial>> = (0..=STEPS)
        .into_par_iter()
        .map(|step| {
            steps[step]?;
            // without slopes all are the same: only the first is asked for
            let cosine = step as f64 / STEPS as f64;
            let square = 2.0 * slope * slope * (1.0 + cosine * cosine) + scatter * scatter;
            Some(Radial::new(scene.sun_shape, square.sqrt()))
        })
        .collect();
    let reflected_w = account.incoming_w - account.reflection_loss_w;
    let integral = Integral {
        receiver: scene.receiver,
        outlines: &outlines,
        cones: &cones,
        threads: options.threads,
        going,
    };
    let power_w = integral.power_w(options, reflected_w)?;
    account.received_w = power_w.iter().sum();
    // What is received beyond all that is reflected is within the tolerance, and told as unaccounted.
    account.spilled_w = (reflected_w - account.received_w).max(0.0);
    Ok(FluxMap::new(scene.receiver, &power_w, account))
}
