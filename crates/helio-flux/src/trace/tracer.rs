//! Threads, laps and kernels: how the rays of a plan are traced.

use helio_core::SimdLevel;

use super::Scene;
use super::beam::{Cone, Piece, onto_plane};
use super::ends::Ends;
use super::kernel::{Grid, Pass, PlaneKernel, plane};
use super::occlusion::{Bundle, Candidates, Obstacles, Outline};
use super::plan::{Job, Plan};
use super::rayset::{Lap, RaySet};
use super::round::{RoundKernel, onto_round, round};
use super::tally::{SPILLED, Tally, cell_of};
use super::verdict::{BLOCKED, DOUBTFUL, FREE, SHADED, Sight, VerdictKernel, verdicts};
use crate::element::Element;
use crate::parallel::{Going, over_tasks};
use crate::receiver::Receiver;
use crate::vector::{Vector, add, dot, norm, scale, sub};

/// Rays of a task for a thread: a third of a millisecond, against microseconds to fetch one.
const RAYS_PER_TASK: u64 = 1 << 18;

/// All that a thread wants to know.
pub(super) struct Tracer<'a> {
    pub scene: &'a Scene<'a>,
    pub sun: Vector,
    pub sun_across: [Vector; 2],
    pub level: SimdLevel,
    pub seed: u64,
    pub plan: &'a Plan,
    pub set: &'a RaySet,
    pub obstacles: Option<Obstacles<'a>>,
    /// Of each element; empty without obstacles.
    pub candidates: Vec<Candidates>,
}

/// Elements of a task that looks for what is in their way.
const ELEMENTS_PER_TASK: usize = 256;

/// Most elements whose obstacles are looked for together: the facets of a heliostat, a patch of a fine mesh.
const MOST_TOGETHER: usize = 32;

impl Tracer<'_> {
    /// Finds what may stand in the light of every element.
    pub(super) fn look_around(&mut self, threads: usize) {
        let Some(obstacles) = &self.obstacles else {
            return;
        };
        let elements = self.scene.elements;
        let ends_of = |element: &Element| {
            let normal = element.normal();
            let middle = sub(scale(normal, 2.0 * dot(normal, self.sun)), self.sun);
            Ends::new(self.scene.receiver, middle, element.centroid_m())
        };
        let [sun_reach, slope_reach] = self.set.reach;
        let bundles_of = |element: &Element| {
            let (normal, from) = (element.normal(), element.centroid_m());
            let ends = ends_of(element);
            let distance = |p: &Vector| norm(sub(*p, from));
            let to_sun = Bundle {
                outline: Outline::of(element),
                normal,
                from,
                radius_m: element.corners_m().iter().map(distance).fold(0.0, f64::max),
                toward: self.sun,
                spread: sun_reach,
                length_m: f64::INFINITY,
            };
            let reflected = Bundle {
                toward: ends.middle,
                spread: sun_reach + 2.0 * slope_reach,
                length_m: ends.far_m,
                ..to_sun
            };
            (to_sun, reflected)
        };
        // Of elements of one mirror; those turned away have no light to lose.
        let candidates_of = |together: &[Element]| {
            let mirror = together[0].mirror();
            let lit = |element: &Element| dot(element.normal(), self.sun) > 0.0;
            let pairs = together
                .iter()
                .filter(|element| lit(element))
                .map(bundles_of);
            let (to_sun, reflected): (Vec<_>, Vec<_>) = pairs.unzip();
            let mut found = core::iter::zip(
                obstacles.touched(&to_sun, mirror),
                obstacles.touched(&reflected, mirror),
            );
            let of = |element: &Element| match lit(element).then(|| found.next()).flatten() {
                Some((shaders, mut blockers)) => {
                    let ends = ends_of(element);
                    let (from, near_m) = (element.centroid_m(), ends.near_m);
                    let sure = if ends.is_flat {
                        blockers.len()
                    } else {
                        obstacles.sure_first(&mut blockers, from, ends.middle, near_m)
                    };
                    Candidates {
                        shaders,
                        blockers,
                        sure,
                    }
                }
                None => Candidates::default(),
            };
            together.iter().map(of).collect::<Vec<_>>()
        };
        let tasks = elements.len().div_ceil(ELEMENTS_PER_TASK);
        let parts = over_tasks(tasks, threads, |mine| {
            let part = |task: usize| {
                let first = task * ELEMENTS_PER_TASK;
                let last = elements.len().min(first + ELEMENTS_PER_TASK);
                let mirrors = elements[first..last].chunk_by(|a, b| a.mirror() == b.mirror());
                let together = mirrors.flat_map(|of_one| of_one.chunks(MOST_TOGETHER));
                let found: Vec<_> = together.flat_map(candidates_of).collect();
                (task, found)
            };
            mine.map(part).collect::<Vec<_>>()
        });
        let mut parts: Vec<_> = parts.into_iter().flatten().collect();
        parts.sort_unstable_by_key(|part| part.0);
        self.candidates = parts.into_iter().flat_map(|part| part.1).collect();
    }

    pub(super) fn in_parallel(&self, threads: usize, going: &Going<'_>) -> Tally {
        let tasks = self.plan.rays.div_ceil(RAYS_PER_TASK) as usize;
        let tallies = over_tasks(tasks, threads, |mine| {
            let mut tally = Tally::new(self.scene.receiver);
            for task in mine.take_while(|_| going.is_on()) {
                let first = task as u64 * RAYS_PER_TASK;
                let last = self.plan.rays.min(first + RAYS_PER_TASK);
                self.trace(first, last, &mut tally);
                going.did(last - first);
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
        if !self.in_lanes(job, lap, &cone, pass, &found, &mut tally.cells) {
            for ray in 0..to - from {
                if found.get(ray).is_some_and(|&verdict| verdict != FREE) {
                    continue;
                }
                let (origin, direction) = one_ray(&job.piece, &cone, lap, &pass, ray);
                let cell = match self.scene.receiver.hit(origin, direction) {
                    Some(hit) => cell_of(self.scene.receiver, hit.bin),
                    None => SPILLED,
                };
                tally.cells[cell] += job.reflected;
            }
        }
        tally.verdicts = found;
    }

    /// The fast ways; false if there is none for this receiver, or the element is too near to it.
    fn in_lanes(
        &self,
        job: &Job,
        lap: &Lap,
        cone: &Cone,
        pass: Pass<'_>,
        verdicts: &[u32],
        cells: &mut [u64],
    ) -> bool {
        let (level, weight, piece) = (self.level, job.reflected, &job.piece);
        let slopes = self.scene.optical_error.slope_rms_rad() > 0.0;
        // A kernel for each of four kinds of rays, so that none does what another wants.
        macro_rules! run {
            ($kernel:ident { $($field:ident),* }, $run:ident) => {
                match (piece.is_triangle, slopes) {
                    (false, false) => $run::<false, false>(level, $kernel { $($field),* }),
                    (false, true) => $run::<false, true>(level, $kernel { $($field),* }),
                    (true, false) => $run::<true, false>(level, $kernel { $($field),* }),
                    (true, true) => $run::<true, true>(level, $kernel { $($field),* }),
                }
            };
        }
        match self.scene.receiver {
            Receiver::Plane(receiver) => {
                let Some(beam) = &onto_plane(receiver, piece, cone, lap, self.set.reach) else {
                    return false;
                };
                let grid = Grid {
                    columns: receiver.columns() as u32,
                    rows: receiver.rows() as u32,
                };
                run!(
                    PlaneKernel {
                        beam,
                        pass,
                        grid,
                        weight,
                        verdicts,
                        cells
                    },
                    plane
                );
            }
            Receiver::Frustum(receiver) => {
                let radius_m = self.scene.receiver.radius_m();
                let Some(beam) = &onto_round(receiver, piece, cone, lap, radius_m) else {
                    return false;
                };
                run!(
                    RoundKernel {
                        beam,
                        pass,
                        weight,
                        verdicts,
                        cells
                    },
                    round
                );
            }
            Receiver::Mesh(_) => return false,
        }
        true
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
        let ends = Ends::new(self.scene.receiver, cone.middle, origin);
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
                gate: single(ends.gate),
                gate_offset: ends.gate_offset_m as f32,
                far: ends.far_m as f32,
            };
            let (sure, doubtful) = candidates.blockers.split_at(candidates.sure);
            let kernel = VerdictKernel {
                sight: &sight,
                pass: *pass,
                shaders: &obstacles.screens(&candidates.shaders, origin),
                blockers: &obstacles.screens(sure, origin),
                doubtful: &obstacles.screens(doubtful, origin),
                verdicts: found,
            };
            verdicts(self.level, kernel);
            if doubtful.is_empty() {
                return;
            }
            for (ray, verdict) in found.iter_mut().enumerate() {
                if *verdict == DOUBTFUL {
                    let (from, direction) = one_ray(&job.piece, cone, lap, pass, ray);
                    let is_met = |end| obstacles.is_any_met(doubtful, from, direction, end);
                    let is_cut = ends.is_cut(from, direction, is_met);
                    *verdict = if is_cut { BLOCKED } else { FREE };
                }
            }
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
            let mirror = element.mirror();
            let is_met = |end| obstacles.is_met(from, direction, end, mirror);
            if obstacles.is_met(from, to_sun, f64::INFINITY, mirror) {
                *verdict = SHADED;
            } else if ends.is_cut(from, direction, is_met) {
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
