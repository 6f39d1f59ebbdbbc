//! The integral over bins: at points as they are asked for, and at more where these miss the images.

use core::sync::atomic::{AtomicU64, Ordering};

use super::ConvolveOptions;
use super::outline::{Ball, Outline, point_of};
use super::radial::Radial;
use crate::error::FluxError;
use crate::parallel::{Going, over_tasks};
use crate::receiver::Receiver;
use crate::vector::{norm, sub};

/// Bins of a task for a thread: some 64 tasks for a usual grid.
const BINS_PER_TASK: usize = 64;

/// Points that an image must be wide for its bin to be taken at its points.
const POINTS_ACROSS: f64 = 4.0;

/// Most points along a side of a bin: coarser bins are refused.
const MOST_POINTS: usize = 1 << 20;

/// Points along a side of a part of a bin that is not cut further.
const PART: usize = 8;

/// Most evaluations (a mirror seen from a point) of one pass: some minutes of one core.
const MOST_EVALUATIONS: u64 = 1 << 31;

/// What is integrated.
pub(super) struct Integral<'a> {
    pub receiver: &'a Receiver,
    pub outlines: &'a [Outline],
    pub cones: &'a [Option<Radial>],
    pub threads: usize,
    pub going: &'a Going<'a>,
}

impl Integral<'_> {
    /// Power of every bin \[W\].
    pub(super) fn power_w(
        &self,
        options: &ConvolveOptions,
        reflected_w: f64,
    ) -> Result<Vec<f64>, FluxError> {
        let bins = self.receiver.bins();
        let mut sides = self.sides(options.points);
        if let Some(bin) = (0..bins).find(|&bin| sides[bin] >= MOST_POINTS) {
            return Err(FluxError::BinsTooCoarse {
                bin,
                found: sides[bin],
                most: MOST_POINTS,
            });
        }
        let mut coarse: Vec<usize> = (0..bins).filter(|&k| sides[k] > options.points).collect();
        let fine: Vec<usize> = (0..bins).filter(|&k| sides[k] == options.points).collect();
        let mut power_w = vec![0.0; bins];
        self.over(
            &fine,
            |bin| self.at_points(bin, options.points),
            |bin, power| {
                power_w[bin] = power;
            },
        );
        let mut spent = 0;
        self.refined(&coarse, &sides, &mut power_w, &mut spent, options)?;
        self.going.did(coarse.len() as u64);
        let excess = |power_w: &[f64]| power_w.iter().sum::<f64>() - reflected_w;
        let allowed_w = options.tolerance * reflected_w;
        if coarse.is_empty() && excess(&power_w) > allowed_w {
            coarse = fine;
        }
        if coarse.is_empty() {
            return Ok(power_w);
        }
        loop {
            // points nearer than the images are wide have found nothing there
            coarse.retain(|&bin| power_w[bin] > 0.0);
            if coarse.is_empty() || !self.going.is_on() {
                return Ok(power_w);
            }
            let before = power_w.clone();
            for &bin in &coarse {
                sides[bin] *= 2;
            }
            self.refined(&coarse, &sides, &mut power_w, &mut spent, options)?;
            let change: f64 = before
                .iter()
                .zip(&power_w)
                .map(|(a, b)| (a - b).abs())
                .sum();
            let off_w = change.max(excess(&power_w));
            if off_w <= allowed_w {
                return Ok(power_w);
            }
            // the next pass takes four times this one
            if spent > MOST_EVALUATIONS / 4 || coarse.iter().any(|&k| sides[k] >= MOST_POINTS) {
                return Err(FluxError::NotSettled {
                    found: off_w / reflected_w,
                    wanted: options.tolerance,
                    evaluations: spent,
                });
            }
        }
    }

    /// What `power` says of bins, and how `put` keeps it.
    fn over<T: Send>(
        &self,
        bins: &[usize],
        power: impl Fn(usize) -> T + Sync,
        mut put: impl FnMut(usize, T),
    ) {
        let tasks = bins.len().div_ceil(BINS_PER_TASK);
        let parts = over_tasks(tasks, self.threads, |mine| {
            let part = |task: usize| {
                let first = task * BINS_PER_TASK;
                let some = &bins[first..bins.len().min(first + BINS_PER_TASK)];
                let power: Vec<(usize, T)> = some.iter().map(|&bin| (bin, power(bin))).collect();
                self.going.did(some.len() as u64);
                power
            };
            mine.take_while(|_| self.going.is_on())
                .map(part)
                .collect::<Vec<_>>()
        });
        for (bin, power) in parts.into_iter().flatten().flatten() {
            put(bin, power);
        }
    }

    /// Of a bin, at points each of which stands for the same area.
    fn at_points(&self, bin: usize, side: usize) -> f64 {
        let place = |k: usize| (k as f64 + 0.5) / side as f64;
        let mut sum = 0.0;
        for k in 0..side * side {
            let point = point_of(self.receiver, bin, place(k / side), place(k % side));
            for outline in self.outlines {
                if let Some(cone) = &self.cones[outline.step] {
                    sum += outline.flux_at(&point, cone);
                }
            }
        }
        sum / (side * side) as f64 * self.receiver.bin_area_m2(bin)
    }

    /// Points along a side that every bin wants: as given, or twice as often as it takes.
    fn sides(&self, points: usize) -> Vec<usize> {
        let bins = self.receiver.bins();
        let sizes: Vec<(Ball, f64)> = (0..bins).map(|bin| self.size_of(bin)).collect();
        let largest_m = sizes.iter().map(|(_, size_m)| *size_m).fold(0.0, f64::max);
        let all = Ball {
            centre: self.receiver.centre_m(),
            radius_m: self.receiver.radius_m(),
        };
        let least_m = self.least_width_m(&all);
        let enough = |size_m: f64, least_m: f64| {
            let mut side = points;
            while size_m * POINTS_ACROSS > least_m * side as f64 && side < MOST_POINTS {
                side *= 2;
            }
            side
        };
        let mut sides = vec![points; bins];
        if enough(largest_m, least_m) == points {
            return sides;
        }
        let every: Vec<usize> = (0..bins).collect();
        let tasks = over_tasks(bins.div_ceil(BINS_PER_TASK), self.threads, |mine| {
            mine.flat_map(|task| {
                let first = task * BINS_PER_TASK;
                every[first..bins.min(first + BINS_PER_TASK)]
                    .iter()
                    .map(|&bin| (bin, enough(sizes[bin].1, self.least_width_m(&sizes[bin].0))))
                    .collect::<Vec<_>>()
            })
            .collect::<Vec<_>>()
        });
        for (bin, side) in tasks.into_iter().flatten() {
            sides[bin] = side;
        }
        sides
    }

    /// Least width of the images in a part of the receiver \[m\].
    fn least_width_m(&self, ball: &Ball) -> f64 {
        let width = |outline: &Outline| {
            let cone = self.cones[outline.step].as_ref()?;
            let far_m = outline.reaches(ball, cone)?;
            Some(outline.width_m(far_m, cone))
        };
        self.outlines
            .iter()
            .filter_map(width)
            .fold(f64::INFINITY, f64::min)
    }

    /// A ball around a bin, and the longest side \[m\].
    fn size_of(&self, bin: usize) -> (Ball, f64) {
        let at = |v: f64, u: f64| point_of(self.receiver, bin, v, u).at;
        let length = |line: &dyn Fn(f64) -> [f64; 3]| -> f64 {
            (0..8)
                .map(|k| norm(sub(line(f64::from(k) / 8.0), line(f64::from(k + 1) / 8.0))))
                .sum()
        };
        let mut size_m = 0.0_f64;
        for side in [0.0, 1.0] {
            size_m = size_m
                .max(length(&|u| at(side, u)))
                .max(length(&|v| at(v, side)));
        }
        let ball = Ball {
            centre: at(0.5, 0.5),
            // no point is farther than along two sides
            radius_m: size_m,
        };
        (ball, size_m)
    }

    /// Of bins that want more points, with their sides as they are now.
    fn refined(
        &self,
        coarse: &[usize],
        sides: &[usize],
        power_w: &mut [f64],
        spent: &mut u64,
        options: &ConvolveOptions,
    ) -> Result<(), FluxError> {
        let evaluations = AtomicU64::new(0);
        let power = |bin: usize| {
            let seen: Vec<&Outline> = self.outlines.iter().collect();
            let side = sides[bin];
            let part = Part {
                bin,
                row: 0,
                column: 0,
                points: side,
                side,
            };
            let sum = self.part(&part, &seen, &evaluations);
            sum / (side as f64 * side as f64) * self.receiver.bin_area_m2(bin)
        };
        let tasks = over_tasks(coarse.len(), self.threads, |mine| {
            mine.take_while(|_| self.going.is_on())
                .map(|k| {
                    let power = power(coarse[k]);
                    // whoever watches may want an end
                    self.going.did(0);
                    (coarse[k], power)
                })
                .collect::<Vec<_>>()
        });
        for (bin, power) in tasks.into_iter().flatten() {
            power_w[bin] = power;
        }
        *spent = evaluations.into_inner();
        if *spent > MOST_EVALUATIONS {
            return Err(FluxError::NotSettled {
                found: 1.0,
                wanted: options.tolerance,
                evaluations: *spent,
            });
        }
        Ok(())
    }

    /// Sum over the points of a part of a bin, cut into four as long as that leaves mirrors out.
    fn part(&self, part: &Part, seen: &[&Outline], evaluations: &AtomicU64) -> f64 {
        if !self.going.is_on() || evaluations.load(Ordering::Relaxed) > MOST_EVALUATIONS {
            return 0.0;
        }
        let at = |row: f64, column: f64| {
            let side = part.side as f64;
            point_of(self.receiver, part.bin, row / side, column / side)
        };
        let (row, column, points) = (part.row as f64, part.column as f64, part.points as f64);
        let mut near = seen.to_vec();
        // of a round receiver only what is nearly flat
        if !matches!(self.receiver, Receiver::Frustum(_)) || part.side >= 32 * part.points {
            let centre = at(row + 0.5 * points, column + 0.5 * points).at;
            let mut radius_m = 0.0_f64;
            for (v, u) in [(0.0, 0.0), (0.0, 1.0), (1.0, 0.0), (1.0, 1.0)] {
                let corner = at(row + v * points, column + u * points).at;
                radius_m = radius_m.max(norm(sub(corner, centre)));
            }
            let ball = Ball {
                centre,
                radius_m: 1.1 * radius_m,
            };
            near.retain(|outline| {
                let cone = self.cones[outline.step].as_ref();
                cone.is_some_and(|cone| outline.reaches(&ball, cone).is_some())
            });
        }
        evaluations.fetch_add(near.len() as u64, Ordering::Relaxed);
        if near.is_empty() {
            return 0.0;
        }
        if part.points > PART && part.points.is_multiple_of(2) {
            let half = part.points / 2;
            let quarter = |k: usize| Part {
                row: part.row + half * (k / 2),
                column: part.column + half * (k % 2),
                points: half,
                ..*part
            };
            return (0..4)
                .map(|k| self.part(&quarter(k), &near, evaluations))
                .sum();
        }
        let mut sum = 0.0;
        for k in 0..part.points * part.points {
            let point = at(
                row + (k / part.points) as f64 + 0.5,
                column + (k % part.points) as f64 + 0.5,
            );
            for outline in &near {
                if let Some(cone) = &self.cones[outline.step] {
                    sum += outline.flux_at(&point, cone);
                }
            }
        }
        evaluations.fetch_add(
            (near.len() * part.points * part.points) as u64,
            Ordering::Relaxed,
        );
        sum
    }
}

/// A square of a bin's points.
#[derive(Clone, Copy)]
struct Part {
    bin: usize,
    row: usize,
    column: usize,
    points: usize,
    side: usize,
}
