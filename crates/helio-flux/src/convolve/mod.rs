//! From elements to the flux on a receiver, by integrals: the outline of every mirror against the cone of the sun.

mod cone;
mod outline;
mod radial;
mod spread;
mod surface;

use cone::Cones;
use outline::Outline;
use spread::{Spread, Trouble};
use surface::Surface;

use crate::account::Account;
use crate::element::Element;
use crate::error::FluxError;
use crate::map::FluxMap;
use crate::parallel::{Going, Watch, over_tasks};
use crate::trace::{Origins, Scene, pieces};
use crate::vector::{Vector, dot};

/// How a convolution is done. Threads change no bit of the answer.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ConvolveOptions {
    /// Points along each side of a bin over which its flux is averaged, at least. Where that is too coarse for an image the
    /// bin gets more of them, or the mirror is cut instead; a mesh's triangles are always taken as they are.
    pub points: usize,
    /// By how much of an element's reflected power its bins may together differ from what falls on the
    /// receiver, before they are made to agree; and how much of it may be in a wrong bin.
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

/// Most elements of a task for a thread, and tasks enough for any number of threads.
const ELEMENTS_PER_TASK: usize = 16;
const TASKS: usize = 128;

/// Quanta of power in all that is reflected: whole ones add up to the same in any order.
const QUANTA: f64 = (1_u64 << 60) as f64;

/// The flux on the receiver as an integral over every element.
///
/// Light leaves a flat mirror the same all over it, spread over directions as the sun's is, widened by the errors of
/// the surface. Of mirror, bin and directions the latter are integrated in closed form over an outline: that of the
/// mirror as a point of the receiver sees it, or that of a bin as a point of the mirror does. Points stand for whichever of
/// the two is the smaller against the blur (half the light of a point, at that distance), as many as it takes. Points of
/// a mirror share out their light, so that it adds up whatever their number; what points of bins get is held against
/// all that falls on the receiver, told without bins, until both agree within
/// [`ConvolveOptions::tolerance`], and then made to.
///
/// Slope errors σ turn the light by 2σ in the plane of incidence and 2σ cos(incidence) across it; the cone that results, the
/// sun's disc with that Gaussian over it, is tabulated for every incidence. Elements neither shade nor block each
/// other here.
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
/// [`FluxError::BadValue`] for a sun without direction, an irradiance out of range, `points` outside 1..=64 or a tolerance
/// outside 1e-6..=1; [`FluxError::NotSettled`] where bins cut the sharp image of an element so often that no reasonable
/// effort meets the tolerance; [`FluxError::HiddenBin`] for a mesh receiver of which parts lie behind others.
pub fn convolve(scene: &Scene<'_>, options: &ConvolveOptions) -> Result<FluxMap, FluxError> {
    run(
        scene,
        options,
        &Going::new(None, scene.elements.len() as u64),
    )
}

/// Like [`convolve()`], for a long run that somebody watches and may stop: `watch` is told by the threads how many
/// elements they have just done and how many there are in all. `None` if it asked to stop.
///
/// # Errors
/// As [`convolve()`].
pub fn convolve_watched(
    scene: &Scene<'_>,
    options: &ConvolveOptions,
    watch: Watch<'_>,
) -> Result<Option<FluxMap>, FluxError> {
    let going = Going::new(Some(watch), scene.elements.len() as u64);
    let map = run(scene, options, &going)?;
    Ok(going.is_on().then_some(map))
}

fn run(
    scene: &Scene<'_>,
    options: &ConvolveOptions,
    going: &Going<'_>,
) -> Result<FluxMap, FluxError> {
    let sun = checked(scene, options)?;
    let account = account_of(scene, sun);
    let reflected_w = account.incoming_w - account.reflection_loss_w;
    let mut power_w = vec![0.0; scene.receiver.bins()];
    if reflected_w > 0.0 {
        let quantum_w = reflected_w / QUANTA;
        let quanta = lay(scene, sun, options, quantum_w, going)?;
        for (to, quanta) in power_w.iter_mut().zip(quanta) {
            *to = quanta as f64 * quantum_w;
        }
    }
    let received_w = power_w.iter().sum::<f64>().min(reflected_w);
    Ok(FluxMap::new(
        scene.receiver,
        &power_w,
        Account {
            received_w,
            spilled_w: reflected_w - received_w,
            ..account
        },
    ))
}

fn checked(scene: &Scene<'_>, options: &ConvolveOptions) -> Result<Vector, FluxError> {
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
    Ok(sun)
}

/// Looks at a convolution without doing all of it.
pub(crate) struct Measure;

impl Measure {
    /// Polygons that a convolution would put under cones, by `most` elements at most; `None` if they are more than
    /// `enough`, which is not counted to the end.
    pub(crate) fn of(
        scene: &Scene<'_>,
        options: &ConvolveOptions,
        most: usize,
        enough: f64,
    ) -> Result<Option<f64>, FluxError> {
        let sun = checked(scene, options)?;
        let step = scene.elements.len().div_ceil(most).max(1);
        let some: Vec<Element> = scene.elements.iter().step_by(step).copied().collect();
        let cones = cones_of(scene, &some, sun);
        let surface = Surface::new(scene.receiver);
        let mut spread = Spread::new(&surface, options);
        let mut sum = 0;
        for (number, element) in some.iter().enumerate() {
            each_outline(scene, element, sun, &cones, |outline| {
                let found = spread.light(outline);
                sum += spread.evaluations;
                found.map_err(|trouble| named(trouble, number * step, options))
            })?;
            if sum as f64 * step as f64 > enough {
                return Ok(None);
            }
        }
        Ok(Some(sum as f64 * step as f64))
    }

    /// Irradiance of a bin \[W/m²\] by so many points along its side; `None` if they are too coarse for the images there,
    /// so that a convolution cuts mirrors instead.
    pub(crate) fn bin_flux(
        scene: &Scene<'_>,
        bin: usize,
        side: usize,
    ) -> Result<Option<f64>, FluxError> {
        let sun = scene.check()?;
        let cones = cones_of(scene, scene.elements, sun);
        let (ball, size_m) = Surface::bin(scene.receiver, bin);
        let points: Vec<_> = (0..side * side)
            .map(|k| surface::point(scene.receiver, bin, k, [side; 2]))
            .collect();
        let (mut sum, mut grazing, mut is_coarse) = (0.0, 0.0, false);
        for element in scene.elements {
            each_outline(scene, element, sun, &cones, |outline| {
                let flux: f64 = points.iter().map(|p| outline.flux_at(p)).sum();
                sum += flux;
                grazing += points.iter().map(|p| outline.grazing_at(p)).sum::<f64>();
                let from = outline.ball();
                let to = surface::Ball {
                    centre: outline.local(ball.centre),
                    ..ball
                };
                let blur_m = outline.blur_m(to.centre[2] - from.centre[2]);
                is_coarse |= size_m > 0.25 * blur_m * side as f64 && outline.reaches(&from, &to);
                Ok::<(), FluxError>(())
            })?;
        }
        is_coarse |= grazing > 1e-3 * sum;
        Ok((!is_coarse).then(|| sum / points.len() as f64))
    }
}

fn cones_of<'a>(scene: &Scene<'a>, elements: &[Element], sun: Vector) -> Cones<'a> {
    let cosines = elements.iter().map(|element| dot(element.normal(), sun));
    let lit = cosines.filter(|cosine| *cosine > 0.0);
    Cones::new(scene.sun_shape, &scene.optical_error, lit)
}

/// The pieces of an element that the sun sees, with something to reflect.
fn each_outline<E>(
    scene: &Scene<'_>,
    element: &Element,
    sun: Vector,
    cones: &Cones<'_>,
    mut see: impl FnMut(&Outline<'_>) -> Result<(), E>,
) -> Result<(), E> {
    let cosine = dot(element.normal(), sun);
    let Some(cone) = cones.of(cosine).filter(|_| cosine > 0.0) else {
        return Ok(());
    };
    let strength = scene.dni_w_m2 * element.reflectivity();
    for piece in pieces(element, Origins::Spread) {
        let area_m2 = element.area_m2() * piece.share;
        let outline = Outline::new(&piece, area_m2, sun, strength, cone);
        if outline.power_w > 0.0 {
            see(&outline)?;
        }
    }
    Ok(())
}

fn named(trouble: Trouble, element: usize, options: &ConvolveOptions) -> FluxError {
    match trouble {
        Trouble::NotSettled(found) => FluxError::NotSettled {
            element,
            found,
            wanted: options.tolerance,
        },
        Trouble::Hidden { bin, by } => FluxError::HiddenBin { bin, by },
    }
}

/// What there is before any of it is spread.
fn account_of(scene: &Scene<'_>, sun: Vector) -> Account {
    let mut account = Account::default();
    for element in scene.elements {
        if dot(element.normal(), sun) <= 0.0 {
            account.turned_away += 1;
            continue;
        }
        let incoming_w = scene.dni_w_m2 * element.aperture_m2(sun);
        account.mirror_w += scene.dni_w_m2 * element.area_m2();
        account.incoming_w += incoming_w;
        account.reflection_loss_w += incoming_w * (1.0 - element.reflectivity());
    }
    account
}

/// Quanta of every bin.
fn lay(
    scene: &Scene<'_>,
    sun: Vector,
    options: &ConvolveOptions,
    quantum_w: f64,
    going: &Going<'_>,
) -> Result<Vec<u64>, FluxError> {
    let cones = cones_of(scene, scene.elements, sun);
    let surface = Surface::new(scene.receiver);
    let bins = scene.receiver.bins();
    let of_task = (scene.elements.len() / TASKS).clamp(1, ELEMENTS_PER_TASK);
    let tasks = scene.elements.len().div_ceil(of_task);
    let parts = over_tasks(tasks, options.threads, |mine| {
        let mut spread = Spread::new(&surface, options);
        let mut quanta = vec![0_u64; bins];
        // the first in the order of the elements, whichever thread finds it
        let mut trouble: Option<(usize, Trouble)> = None;
        for task in mine.take_while(|_| going.is_on()) {
            let first = task * of_task;
            let last = scene.elements.len().min(first + of_task);
            for (number, element) in scene.elements.iter().enumerate().take(last).skip(first) {
                if trouble.as_ref().is_some_and(|(of, _)| *of < number) {
                    break;
                }
                let found = each_outline(scene, element, sun, &cones, |outline| {
                    spread.light(outline)?;
                    for (&bin, power_w) in spread.bins.iter().zip(&spread.power_w) {
                        quanta[bin as usize] += (power_w / quantum_w).round() as u64;
                    }
                    Ok(())
                });
                if let Err(found) = found {
                    trouble = Some((number, found));
                }
            }
            going.did((last - first) as u64);
        }
        (quanta, trouble)
    });
    let mut all = vec![0_u64; bins];
    let mut first: Option<(usize, Trouble)> = None;
    for (quanta, trouble) in parts {
        for (to, some) in all.iter_mut().zip(quanta) {
            *to += some;
        }
        if let Some((number, found)) = trouble
            && first.as_ref().is_none_or(|(of, _)| number < *of)
        {
            first = Some((number, found));
        }
    }
    match first {
        None => Ok(all),
        Some((element, trouble)) => Err(named(trouble, element, options)),
    }
}
