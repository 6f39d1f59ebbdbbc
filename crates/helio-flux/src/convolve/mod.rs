//! From elements to the flux on a receiver, by integrals: the outline of every mirror against the cone of the sun.

mod radial;

use radial::Radial;
use rayon::iter::{IntoParallelIterator, ParallelIterator};

use crate::account::Account;
use crate::element::Element;
use crate::error::FluxError;
use crate::map::FluxMap;
use crate::parallel::{Going, Watch, over_tasks};
use crate::receiver::Receiver;
use crate::trace::Scene;
use crate::trace::across;
use crate::vector::{Vector, dot, norm, scale, sub};

/// How a convolution is done. Threads change no bit of the answer.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct ConvolveOptions {
    /// Points along each side of a bin over which its flux is averaged; of a mesh's triangles, its square.
    pub points: usize,
    /// Most threads to use; 0 for as many as the thread pool has.
    pub threads: usize,
}

impl Default for ConvolveOptions {
    fn default() -> Self {
        Self {
            points: 2,
            threads: 0,
        }
    }
}

/// Incidences that have a widened cone of their own: 64 steps of the cosine change it by less than 1 %.
const STEPS: usize = 64;

/// Bins of a task for a thread: some 64 tasks for a usual grid.
const BINS_PER_TASK: usize = 64;

/// The flux on the receiver as an integral over every element.
///
/// A point of the receiver sees a flat mirror show it the sun, and the part of the sun's light that lies within
/// the mirror's outline is what it gets: E = ρ DNI cos(θ) ∫ B dω over the outline as seen from the point. That is
/// exact for a flat piece at any distance, and costs no rays; what is left is the average over a bin, for which
/// `points` squared points stand.
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
/// [`FluxError::BadValue`] for a sun without direction, an irradiance out of range, or `points` outside 1..=64.
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
    let bin_power = |bin: usize| -> f64 {
        let points = points_of(scene.receiver, bin, options.points);
        let count = points.len() as f64;
        let mut sum = 0.0;
        for point in points {
            for outline in &outlines {
                if let Some(cone) = &cones[outline.step] {
                    sum += outline.flux_at(&point, cone);
                }
            }
        }
        sum / count * scene.receiver.bin_area_m2(bin)
    };
    let bins = scene.receiver.bins();
    let mut power_w = vec![0.0; bins];
    let tasks = bins.div_ceil(BINS_PER_TASK);
    let parts = over_tasks(tasks, options.threads, |mine| {
        let part = |task: usize| {
            let first = task * BINS_PER_TASK;
            let last = bins.min(first + BINS_PER_TASK);
            let power_w: Vec<f64> = (first..last).map(bin_power).collect();
            going.did((last - first) as u64);
            (first, power_w)
        };
        mine.take_while(|_| going.is_on())
            .map(part)
            .collect::<Vec<_>>()
    });
    for (first, part) in parts.into_iter().flatten() {
        power_w[first..first + part.len()].copy_from_slice(&part);
    }
    account.received_w = power_w.iter().sum();
    account.spilled_w = account.incoming_w - account.reflection_loss_w - account.received_w;
    Ok(FluxMap::new(scene.receiver, &power_w, account))
}

/// A place on the receiver, and the way it faces.
struct Point {
    at: Vector,
    normal: Vector,
}

/// Points over a bin, each standing for the same area.
fn points_of(receiver: &Receiver, bin: usize, side: usize) -> Vec<Point> {
    let place = |k: usize| (k as f64 + 0.5) / side as f64;
    let normal = receiver.bin_normal(bin);
    let grid = |at: &dyn Fn(f64, f64) -> (Vector, Vector)| -> Vec<Point> {
        (0..side * side)
            .map(|k| {
                let (at, normal) = at(place(k / side), place(k % side));
                Point { at, normal }
            })
            .collect()
    };
    let (row, column) = (bin / receiver.columns(), bin % receiver.columns());
    let (row, column) = (row as f64, column as f64);
    match receiver {
        Receiver::Plane(plane) => grid(&|v, u| (plane.point_m(row + v, column + u), normal)),
        Receiver::Frustum(round) => {
            grid(&|v, u| (round.point_m(row + v, column + u), round.normal(column + u)))
        }
        Receiver::Mesh(mesh) => {
            let corners = mesh.corners_m(bin).unwrap_or_default();
            grid(&|v, u| {
                // even over a triangle (Osada et al. 2002)
                let root = v.sqrt();
                let parts = [1.0 - root, root * (1.0 - u), root * u];
                let mut at = [0.0; 3];
                for (corner, part) in corners.iter().zip(parts) {
                    at = crate::vector::add(at, scale(*corner, part));
                }
                (at, normal)
            })
        }
    }
}

/// An element as the receiver sees it: its corners in axes across and along the middle ray.
struct Outline {
    axes: [Vector; 3],
    corners: [Vector; 4],
    count: usize,
    middle: Vector,
    radius_m: f64,
    step: usize,
    strength: f64,
    normal: Vector,
    centroid: Vector,
}

impl Outline {
    fn new(element: &Element, sun: Vector, step: usize, strength: f64) -> Self {
        let normal = element.normal();
        let along = sub(scale(normal, 2.0 * dot(normal, sun)), sun);
        let [x, y] = across(along);
        let axes = [x, y, along];
        let local = |p: Vector| axes.map(|axis| dot(axis, p));
        let centroid = element.centroid_m();
        // a bent quadrilateral, moved into its plane
        let flat = |p: Vector| sub(p, scale(normal, dot(sub(p, centroid), normal)));
        let mut corners = [[0.0; 3]; 4];
        let mut radius_m = 0.0_f64;
        for (to, &from) in corners.iter_mut().zip(element.corners_m()) {
            *to = local(flat(from));
            radius_m = radius_m.max(norm(sub(from, centroid)));
        }
        Self {
            axes,
            corners,
            count: element.corners_m().len(),
            middle: local(centroid),
            radius_m,
            step,
            strength,
            normal,
            centroid,
        }
    }

    /// Irradiance at a point of the receiver \[W/m²\].
    fn flux_at(&self, point: &Point, cone: &Radial) -> f64 {
        let facing = -dot(point.normal, self.axes[2]);
        if facing <= 0.0 || dot(sub(point.at, self.centroid), self.normal) <= 0.0 {
            return 0.0;
        }
        let [x, y, z] = self.axes.map(|axis| dot(axis, point.at));
        // far from the middle ray nothing of the sun shows
        let (dx, dy, far) = (self.middle[0] - x, self.middle[1] - y, z - self.middle[2]);
        let reach = self.radius_m + cone.end * (far + self.radius_m);
        if far <= 0.0 || dx * dx + dy * dy > reach * reach {
            return 0.0;
        }
        let mut seen = [[0.0; 2]; 4];
        for (to, corner) in seen.iter_mut().zip(&self.corners[..self.count]) {
            let distance = z - corner[2];
            if distance <= 0.0 {
                return 0.0;
            }
            let inverse = 1.0 / distance;
            *to = [(corner[0] - x) * inverse, (corner[1] - y) * inverse];
        }
        self.strength * facing * cone.within(&seen[..self.count])
    }
}
