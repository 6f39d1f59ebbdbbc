//! The rays that every element's cone is cut into.

use core::f64::consts::TAU;

use rayon::iter::{IntoParallelIterator, ParallelIterator};

use crate::optics::OpticalError;
use crate::sampling::{Sobol, hash, part};
use crate::sunshape::SunShape;

/// Fewest and most rays of a set: 2¹⁸ of six singles are 6 MiB, which still come from a cache as fast as they
/// are used; a set of 2¹² leaves twice the error of one of 2¹⁸ at a million rays, and is made in half a millisecond.
const LEAST: u64 = 1 << 12;
const MOST: u64 = 1 << 18;

/// Rays traced for each one of a set: making one costs as much as tracing a hundred, and is shared by all
/// threads.
const RAYS_PER_SET: u64 = 64;

/// The rays that every element's cone is cut into: where on it they start, and how far they stray from its
/// middle ray. Made once, it serves any number of scenes under the same sun.
///
/// ```
/// use helio_flux::{OpticalError, RaySet, SunShape};
/// let sun_shape = SunShape::pillbox(4.65e-3)?;
/// let set = RaySet::new(&sun_shape, &OpticalError::NONE, 0, 10_000_000);
/// assert_eq!(set.len(), 262_144);
/// # Ok::<(), helio_flux::FluxError>(())
/// ```
// Singles: the angles are offsets from a direction that is kept in doubles, so that their rounding is 1e-7
// of the cone.
#[derive(Debug, Clone)]
pub struct RaySet {
    sun_shape: SunShape,
    optical_error: OpticalError,
    seed: u64,
    /// Place on the element, in units of its edges, in [0, 1).
    pub(crate) a: Vec<f32>,
    pub(crate) b: Vec<f32>,
    /// Offset from the middle of the sun and scatter, per unit of length along the ray.
    pub(crate) dx: Vec<f32>,
    pub(crate) dy: Vec<f32>,
    /// Slopes of the normal.
    pub(crate) gx: Vec<f32>,
    pub(crate) gy: Vec<f32>,
    /// Greatest offset, and greatest slope.
    pub(crate) reach: [f64; 2],
}

impl RaySet {
    /// A set of a size that is right for tracing about so many rays.
    #[must_use]
    pub fn new(sun: &SunShape, error: &OpticalError, seed: u64, rays: u64) -> Self {
        let sobol = Sobol::new(seed);
        let count = (rays / RAYS_PER_SET).next_power_of_two();
        let points: Vec<[f32; 6]> = (0..count.clamp(LEAST, MOST) as u32)
            .into_par_iter()
            .map(|ray| point(&sobol, sun, error, ray))
            .collect();
        let column = |k: usize| points.iter().map(|point| point[k]).collect::<Vec<_>>();
        let reach = |k: usize| {
            let length = |p: &[f32; 6]| libm::hypot(f64::from(p[k]), f64::from(p[k + 1]));
            points.iter().map(length).fold(0.0, f64::max)
        };
        Self {
            sun_shape: sun.clone(),
            optical_error: *error,
            seed,
            a: column(0),
            b: column(1),
            dx: column(2),
            dy: column(3),
            gx: column(4),
            gy: column(5),
            reach: [reach(2), reach(4)],
        }
    }

    /// How many rays there are before they are used again, shifted and turned.
    #[must_use]
    pub fn len(&self) -> u64 {
        self.a.len() as u64
    }

    /// Never: a set has at least 4096 rays.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.a.is_empty()
    }

    /// True if it was made of these.
    pub(crate) fn is_of(&self, sun: &SunShape, error: &OpticalError, seed: u64) -> bool {
        self.sun_shape == *sun && self.optical_error == *error && self.seed == seed
    }
}

/// A ray of a set: its place, its offset from the sun's middle, its slopes.
fn point(sobol: &Sobol, sun: &SunShape, error: &OpticalError, ray: u32) -> [f32; 6] {
    let at = |dimension| sobol.at(ray, dimension);
    let (sin, cos) = libm::sincos(TAU * at(3));
    let radius = libm::tan(sun.quantile_rad(at(2)));
    let pair = |first: usize, sigma: f64| match sigma {
        0.0 => (0.0, 0.0),
        _ => normal_pair(at(first), at(first + 1), sigma),
    };
    let (gx, gy) = pair(4, error.slope_rms_rad());
    let (sx, sy) = pair(6, error.specularity_rms_rad());
    let (dx, dy) = (radius * cos + sx, radius * sin + sy);
    let single = |x: f64| x as f32;
    let [dx, dy, gx, gy] = [dx, dy, gx, gy].map(single);
    [below_one(at(0)), below_one(at(1)), dx, dy, gx, gy]
}

/// A number in [0, 1) as a single that is below 1 too.
fn below_one(x: f64) -> f32 {
    (x as f32).min(1.0 - f32::EPSILON / 2.0)
}

/// Two deviates of a normal distribution (Box and Muller 1958) from two even ones in [0, 1).
fn normal_pair(x: f64, y: f64, sigma: f64) -> (f64, f64) {
    let radius = sigma * libm::sqrt(-2.0 * libm::log(1.0 - x));
    let (sin, cos) = libm::sincos(TAU * y);
    (radius * cos, radius * sin)
}

/// How a set is changed for each time round: places shifted, cones turned. The shifts of many laps fill
/// their cube evenly too: multiples of powers of the root of x⁵ = x + 1 (Roberts 2018), from a start by the seed.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Lap {
    /// Added to a and b, around.
    pub shift: [f64; 2],
    /// Sine and cosine of the turn of the sun's cone.
    pub sun_turn: [f64; 2],
    /// Sine and cosine of the turn of the slopes.
    pub slope_turn: [f64; 2],
}

impl Lap {
    pub(crate) fn new(seed: u64, lap: u64) -> Self {
        const ROOT: f64 = 1.167_303_978_261_418_7;
        let mut step = 1.0;
        let parts: [f64; 4] = core::array::from_fn(|k| {
            step /= ROOT;
            let start = part(hash(seed, 1000 + k as u64));
            let at = start + (lap as f64 * step).fract();
            // A lap's place is the same single in every kernel.
            f64::from(below_one(at.fract()))
        });
        let turn = |part: f64| {
            let (sin, cos) = libm::sincos(TAU * part);
            [sin, cos]
        };
        Self {
            shift: [parts[0], parts[1]],
            sun_turn: turn(parts[2]),
            slope_turn: turn(parts[3]),
        }
    }
}
