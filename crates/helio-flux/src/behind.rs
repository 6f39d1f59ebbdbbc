//! Light that comes to a receiver's back.

use crate::element::Element;
use crate::error::FluxError;
use crate::trace::Scene;
use crate::vector::{Vector, add, dot, scale, sub};

/// Points that are asked in all: to a thousandth of the light, and at once.
const POINTS: usize = 1 << 16;
/// Points along a side of an element at most.
const MOST_ALONG: usize = 16;

/// About how much of the reflected light comes to the receiver from behind \[W\]: to the side that is not lit, before
/// any that is. Such light passes, and an [`Account`](crate::Account) has it among what is spilled.
///
/// The middle rays of up to 65,536 points on the mirrors are followed, without the width of the sun and without
/// shading and blocking: enough to say that a receiver is turned the wrong way round, or lit from both sides.
///
/// ```
/// use helio_flux::{Element, Plane, Receiver, Scene, SunShape, OpticalError, lit_from_behind_w};
/// let mirror = [[-0.5, -0.5, 0.0], [0.5, -0.5, 0.0], [0.5, 0.5, 0.0], [-0.5, 0.5, 0.0]];
/// let elements = [Element::quadrilateral(mirror)?];
/// let behind_w = |facing| -> Result<f64, helio_flux::FluxError> {
///     let plane = Plane::new([0.0, 0.0, 10.0], facing, [1.0, 0.0, 0.0], [2.0, 2.0], [20, 20])?;
///     lit_from_behind_w(&Scene {
///         elements: &elements,
///         receiver: &Receiver::Plane(plane),
///         sun: [0.0, 0.0, 1.0],
///         dni_w_m2: 1000.0,
///         sun_shape: &SunShape::pillbox(4.65e-3)?,
///         optical_error: OpticalError::NONE,
///     })
/// };
/// assert_eq!(behind_w([0.0, 0.0, -1.0])?, 0.0);
/// assert!((behind_w([0.0, 0.0, 1.0])? - 1000.0).abs() < 1e-9);
/// # Ok::<(), helio_flux::FluxError>(())
/// ```
///
/// # Errors
/// [`FluxError::BadValue`] for a sun without direction or an irradiance out of range.
pub fn lit_from_behind_w(scene: &Scene<'_>) -> Result<f64, FluxError> {
    let sun = scene.check()?;
    let power_w = |element: &Element| {
        scene.dni_w_m2 * element.area_m2() * dot(element.normal(), sun) * element.reflectivity()
    };
    let lit = || {
        let elements = scene.elements.iter();
        elements.filter(|element| dot(element.normal(), sun) > 0.0)
    };
    let count = lit().count();
    if count == 0 {
        return Ok(0.0);
    }
    let every = count.div_ceil(POINTS);
    let along = ((POINTS / count).isqrt()).clamp(1, MOST_ALONG);
    let (mut asked_w, mut behind_w) = (0.0, 0.0);
    for element in lit().step_by(every) {
        let normal = element.normal();
        let middle = sub(scale(normal, 2.0 * dot(normal, sun)), sun);
        let is_behind = |point: &Vector| scene.receiver.back_first(*point, middle).is_some();
        let behind = points(element, along).filter(is_behind).count();
        asked_w += power_w(element);
        behind_w += power_w(element) * behind as f64 / (along * along) as f64;
    }
    if behind_w == 0.0 {
        return Ok(0.0);
    }
    let all_w: f64 = lit().map(power_w).sum();
    Ok(all_w * (behind_w / asked_w))
}

/// `along` by `along` points, evenly spread over an element.
fn points(element: &Element, along: usize) -> impl Iterator<Item = Vector> {
    let corners = element.corners_m();
    let part = move |k: usize| (k as f64 + 0.5) / along as f64;
    (0..along * along).map(move |k| {
        let (mut u, mut v) = (part(k % along), part(k / along));
        let (a, b, c) = (corners[0], corners[1], corners[corners.len() - 1]);
        let [ab, ac] = [sub(b, a), sub(c, a)];
        let Some(d) = corners.get(2).filter(|_| corners.len() == 4) else {
            // The half beyond the diagonal is turned back.
            if u + v > 1.0 {
                (u, v) = (1.0 - u, 1.0 - v);
            }
            return add(a, add(scale(ab, u), scale(ac, v)));
        };
        let twist = sub(sub(*d, b), ac);
        add(a, add(scale(ab, u), add(scale(ac, v), scale(twist, u * v))))
    })
}
