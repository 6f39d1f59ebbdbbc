//! From elements to the flux on a receiver, by rays.

mod beam;
mod kernel;
mod occlusion;
mod rayset;
mod tally;
mod verdict;

pub use beam::Origins;
pub(crate) use beam::across;
use beam::{Cone, Piece, onto_plane, pieces};
use helio_core::SimdLevel;
use kernel::{Beam, Grid, Pass, PlaneKernel, plane};
use occlusion::{Bundle, Candidates, Obstacles};
use rayset::Lap;
pub use rayset::RaySet;
use tally::Tally;
use verdict::{BLOCKED, FREE, SHADED, Sight, VerdictKernel, verdicts};

use crate::element::Element;
use crate::error::FluxError;
use crate::map::FluxMap;
use crate::optics::OpticalError;
use crate::parallel::over_tasks;
use crate::receiver::{Plane, Receiver, check_direction};
use crate::sunshape::SunShape;
use crate::vector::{Vector, add, dot, norm, scale, sub};

/// Rays of an element come in multiples of this, the width of the widest vectors.
const ROUND: u64 = 16;

/// Rays of a task for a thread: a third of a millisecond, against microseconds to fetch one.
const RAYS_PER_TASK: u64 = 1 << 18;

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
    /// [`mirror`](Element::mirror)s shade and block each other.
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
    Ok(run(scene, options, sun, level, &plan, &set))
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
    Ok(run(scene, options, sun, level, &plan, set))
}

fn run(
    scene: &Scene<'_>,
    options: &RayOptions,
    sun: Vector,
    level: SimdLevel,
    plan: &Plan,
    set: &RaySet,
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
    let tally = tracer.in_parallel(options.threads);
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

/// A piece with its rays.
#[derive(Debug, Clone, Copy)]
struct Job {
    piece: Piece,
    /// The element it is a piece of.
    element: u32,
    /// Index of the first of its rays, among all.
    first_ray: u64,
    rays: u64,
    /// Quanta that a ray brings, and that are left of them when it is reflected.
    weight: u64,
    reflected: u64,
}

/// What is to be traced.
struct Plan {
    jobs: Vec<Job>,
    rays: u64,
    quantum_w: f64,
    mirror_w: f64,
    turned_away: usize,
}

/// Quanta in all the light: room for four times as many in 64 bits, since every ray's are rounded.
const QUANTA: f64 = (1_u64 << 60) as f64;

/// Most rays: some minutes of a thread per thousandth of it, and a weight is still known to 1e-6.
const MAX_RAYS: u64 = 1 << 40;

impl Plan {
    fn new(scene: &Scene<'_>, sun: Vector, options: &RayOptions) -> Result<Self, FluxError> {
        let (Rays::PerElement(wanted) | Rays::Total(wanted)) = options.rays;
        let too_many = |rays: u64| FluxError::BadValue {
            who: "rays",
            what: "their number",
            wanted: "within 1..=2⁴⁰, in all and for each element",
            value: rays as f64,
        };
        if !(1..=MAX_RAYS).contains(&wanted) {
            return Err(too_many(wanted));
        }
        let mut plan = Self {
            jobs: Vec::with_capacity(scene.elements.len()),
            rays: 0,
            quantum_w: 1.0,
            mirror_w: 0.0,
            turned_away: 0,
        };
        let power_of = |element: &Element| scene.dni_w_m2 * element.aperture_m2(sun);
        let all_w: f64 = scene.elements.iter().map(power_of).sum();
        if all_w > 0.0 {
            plan.quantum_w = all_w / QUANTA;
        }
        for (number, element) in scene.elements.iter().enumerate() {
            let power_w = power_of(element);
            if dot(element.normal(), sun) <= 0.0 {
                plan.turned_away += 1;
                continue;
            }
            plan.mirror_w += scene.dni_w_m2 * element.area_m2();
            if power_w <= 0.0 {
                continue;
            }
            for piece in pieces(element, options.origins) {
                let piece_w = power_w * piece.share;
                let rays = match options.rays {
                    Rays::PerElement(count) => count,
                    Rays::Total(count) => (piece_w / all_w * count as f64).ceil() as u64,
                };
                let rays = rays.max(1).next_multiple_of(ROUND);
                let quanta = piece_w / plan.quantum_w / rays as f64;
                plan.jobs.push(Job {
                    piece,
                    element: number as u32,
                    first_ray: plan.rays,
                    rays,
                    weight: quanta.round() as u64,
                    reflected: (quanta * element.reflectivity()).round() as u64,
                });
                plan.rays += rays;
                if plan.rays > MAX_RAYS {
                    return Err(too_many(plan.rays));
                }
            }
        }
        // Of what the weights were rounded to, so that all the light is all of it.
        let quanta: u64 = plan.jobs.iter().map(|job| job.rays * job.weight).sum();
        if quanta > 0 {
            plan.quantum_w = all_w / quanta as f64;
        }
        Ok(plan)
    }
}

/// All that a thread wants to know.
struct Tracer<'a> {
    scene: &'a Scene<'a>,
    sun: Vector,
    sun_across: [Vector; 2],
    level: SimdLevel,
    seed: u64,
    plan: &'a Plan,
    set: &'a RaySet,
    obstacles: Option<Obstacles<'a>>,
    /// Of each element; empty without obstacles.
    candidates: Vec<Candidates>,
}

/// Elements of a task that looks for what is in their way.
const ELEMENTS_PER_TASK: usize = 256;

impl Tracer<'_> {
    /// Finds what may stand in the light of every element.
    fn look_around(&mut self, threads: usize) {
        let Some(obstacles) = &self.obstacles else {
            return;
        };
        let elements = self.scene.elements;
        let receiver = (
            self.scene.receiver.centre_m(),
            self.scene.receiver.radius_m(),
        );
        let candidates_of = |element: &Element| {
            let (normal, from) = (element.normal(), element.centroid_m());
            let cosine = dot(normal, self.sun);
            if cosine <= 0.0 {
                return Candidates::default();
            }
            let distance = |p: &Vector| norm(sub(*p, from));
            let radius_m = element.corners_m().iter().map(distance).fold(0.0, f64::max);
            let [sun_reach, slope_reach] = self.set.reach;
            let to_sun = Bundle {
                from,
                radius_m,
                toward: self.sun,
                spread: sun_reach,
                length_m: f64::INFINITY,
            };
            let reflected = Bundle {
                toward: sub(scale(normal, 2.0 * cosine), self.sun),
                spread: sun_reach + 2.0 * slope_reach,
                length_m: norm(sub(receiver.0, from)) + receiver.1,
                ..to_sun
            };
            Candidates {
                shaders: obstacles.touched(&to_sun, element.mirror()),
                blockers: obstacles.touched(&reflected, element.mirror()),
            }
        };
        let tasks = elements.len().div_ceil(ELEMENTS_PER_TASK);
        let parts = over_tasks(tasks, threads, |mine| {
            let part = |task: usize| {
                let first = task * ELEMENTS_PER_TASK;
                let last = elements.len().min(first + ELEMENTS_PER_TASK);
                let found: Vec<_> = elements[first..last].iter().map(candidates_of).collect();
                (task, found)
            };
            mine.map(part).collect::<Vec<_>>()
        });
        let mut parts: Vec<_> = parts.into_iter().flatten().collect();
        parts.sort_unstable_by_key(|part| part.0);
        self.candidates = parts.into_iter().flat_map(|part| part.1).collect();
    }

    fn in_parallel(&self, threads: usize) -> Tally {
        let tasks = self.plan.rays.div_ceil(RAYS_PER_TASK) as usize;
        let tallies = over_tasks(tasks, threads, |mine| {
            let mut tally = Tally::new(self.scene.receiver);
            for task in mine {
                let first = task as u64 * RAYS_PER_TASK;
                let last = self.plan.rays.min(first + RAYS_PER_TASK);
                self.trace(first, last, &mut tally);
            }
            tally
        });
        // Whole numbers: in which order they are added changes nothing.
        let mut sum = Tally::new(self.scene.receiver);
        for tally in &tallies {
            sum.add(tally);
        }
        sum
    }

    /// Rays `first..last` of all.
    fn trace(&self, first: u64, last: u64, tally: &mut Tally) {
        let jobs = &self.plan.jobs;
        let mut at = first;
        let mut job = jobs.partition_point(|job| job.first_ray + job.rays <= first);
        let mut lap: Option<(u64, Lap)> = None;
        while at < last {
            let current = &jobs[job];
            let lap_number = at / self.set.len();
            let end = last
                .min(current.first_ray + current.rays)
                .min((lap_number + 1) * self.set.len());
            let lap = match lap {
                Some((number, lap)) if number == lap_number => lap,
                _ => lap.insert((lap_number, Lap::new(self.seed, lap_number))).1,
            };
            let from = (at % self.set.len()) as usize;
            self.part(current, &lap, from, from + (end - at) as usize, tally);
            at = end;
            if at == current.first_ray + current.rays {
                job += 1;
            }
        }
    }

    /// Rays `from..to` of the set, in one lap, from one piece.
    fn part(&self, job: &Job, lap: &Lap, from: usize, to: usize, tally: &mut Tally) {
        let cone = Cone::new(job.piece.normal, self.sun, self.sun_across, lap);
        let set = self.set;
        let pass = Pass {
            a: &set.a[from..to],
            b: &set.b[from..to],
            dx: &set.dx[from..to],
            dy: &set.dy[from..to],
            gx: &set.gx[from..to],
            gy: &set.gy[from..to],
        };
        let mut found = core::mem::take(&mut tally.verdicts);
        self.judge(job, lap, &cone, &pass, &mut found);
        let count = (to - from) as u64;
        let count_of = |verdict| found.iter().filter(|&&v| v == verdict).count() as u64;
        let (shaded, blocked) = (count_of(SHADED), count_of(BLOCKED));
        tally.incoming += count * job.weight;
        tally.shaded += shaded * job.weight;
        tally.reflection_loss += (count - shaded) * (job.weight - job.reflected);
        tally.blocked += blocked * job.reflected;
        if let Receiver::Plane(receiver) = self.scene.receiver
            && let Some(beam) = onto_plane(receiver, &job.piece, &cone, lap, set.reach)
        {
            self.onto_cells(receiver, &beam, job, pass, &found, &mut tally.cells);
        } else {
            for ray in 0..to - from {
                if found.get(ray).is_some_and(|&verdict| verdict != FREE) {
                    continue;
                }
                let (origin, direction) = one_ray(&job.piece, &cone, lap, &pass, ray);
                let cell = match self.scene.receiver.hit(origin, direction) {
                    Some(hit) => tally::cell_of(self.scene.receiver, hit.bin),
                    None => tally::SPILLED,
                };
                tally.cells[cell] += job.reflected;
            }
        }
        tally.verdicts = found;
    }

    /// The fast way onto a plane.
    fn onto_cells(
        &self,
        receiver: &Plane,
        beam: &Beam,
        job: &Job,
        pass: Pass<'_>,
        verdicts: &[u32],
        cells: &mut [u64],
    ) {
        let grid = Grid {
            columns: receiver.columns() as u32,
            rows: receiver.rows() as u32,
        };
        let slopes = self.scene.optical_error.slope_rms_rad() > 0.0;
        macro_rules! run {
            ($triangle:literal, $slopes:literal) => {
                plane::<$triangle, $slopes>(
                    self.level,
                    PlaneKernel {
                        beam,
                        pass,
                        grid,
                        weight: job.reflected,
                        verdicts,
                        cells,
                    },
                )
            };
        }
        match (job.piece.is_triangle, slopes) {
            (false, false) => run!(false, false),
            (false, true) => run!(false, true),
            (true, false) => run!(true, false),
            (true, true) => run!(true, true),
        }
    }

    /// Which rays other mirrors keep away; none, if there is nothing in the way of any.
    fn judge(&self, job: &Job, lap: &Lap, cone: &Cone, pass: &Pass<'_>, found: &mut Vec<u32>) {
        found.clear();
        let (Some(obstacles), Some(candidates)) =
            (&self.obstacles, self.candidates.get(job.element as usize))
        else {
            return;
        };
        if candidates.is_empty() {
            return;
        }
        found.resize(pass.a.len(), FREE);
        let element = &self.scene.elements[job.element as usize];
        let origin = element.centroid_m();
        // Rays end in the plane of the receiver, or across its middle.
        let (gate, through) = match self.scene.receiver {
            Receiver::Plane(plane) => (plane.normal(), plane.centre_m()),
            other => (cone.middle, other.centre_m()),
        };
        let gate_offset = dot(gate, sub(through, origin));
        if candidates.fit_lanes() {
            let single = |v: Vector| v.map(|x| x as f32);
            let sight = Sight {
                corner: single(sub(job.piece.corner, origin)),
                edge_a: single(job.piece.edge_a),
                edge_b: single(job.piece.edge_b),
                shift: lap.shift.map(|x| x as f32),
                is_triangle: job.piece.is_triangle,
                sun: single(cone.sun),
                sun_along: cone.sun_along.map(single),
                middle: single(cone.middle),
                along: cone.along.map(single),
                slope: cone.slope.map(single),
                gate: single(gate),
                gate_offset: gate_offset as f32,
            };
            let kernel = VerdictKernel {
                sight: &sight,
                pass: *pass,
                shaders: &obstacles.screens(&candidates.shaders, origin),
                blockers: &obstacles.screens(&candidates.blockers, origin),
                verdicts: found,
            };
            verdicts(self.level, kernel);
            return;
        }
        for (ray, verdict) in found.iter_mut().enumerate() {
            let (from, direction) = one_ray(&job.piece, cone, lap, pass, ray);
            let strays = [
                (pass.dx[ray], cone.sun_along[0]),
                (pass.dy[ray], cone.sun_along[1]),
            ];
            let to_sun = strays.into_iter().fold(cone.sun, |sum, (by, along)| {
                add(sum, scale(along, f64::from(by)))
            });
            let end = (gate_offset - dot(gate, sub(from, origin))) / dot(gate, direction);
            let mirror = element.mirror();
            if obstacles.is_met(from, to_sun, f64::INFINITY, mirror) {
                *verdict = SHADED;
            } else if obstacles.is_met(from, direction, end, mirror) {
                *verdict = BLOCKED;
            }
        }
    }
}

/// A ray in doubles: its origin and direction.
fn one_ray(piece: &Piece, cone: &Cone, lap: &Lap, pass: &Pass<'_>, ray: usize) -> (Vector, Vector) {
    let place = |from: f32, shift: f64| {
        let at = f64::from(from) + shift;
        if at >= 1.0 { at - 1.0 } else { at }
    };
    let mut a = place(pass.a[ray], lap.shift[0]);
    let mut b = place(pass.b[ray], lap.shift[1]);
    if piece.is_triangle && a + b > 1.0 {
        (a, b) = (1.0 - a, 1.0 - b);
    }
    let origin = add(
        piece.corner,
        add(scale(piece.edge_a, a), scale(piece.edge_b, b)),
    );
    let mut direction = cone.middle;
    for (by, along) in [
        (pass.dx[ray], cone.along[0]),
        (pass.dy[ray], cone.along[1]),
        (pass.gx[ray], cone.slope[0]),
        (pass.gy[ray], cone.slope[1]),
    ] {
        direction = add(direction, scale(along, f64::from(by)));
    }
    (origin, direction)
}
