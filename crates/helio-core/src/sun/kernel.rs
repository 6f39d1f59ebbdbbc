//! The arithmetic of a batch. The callers have checked the arguments; this trusts them.

use core::f64::consts::TAU;

use super::position::Columns;
use super::refraction::Refraction;
use super::site::{Observer, SunSite};
use super::time::HALF_DAY_NS;
use crate::lanes::Lanes;
use crate::lanes::math::{angle_full, angle_half, sin_cos};

/// Instants that go through both steps together; their columns stay in the nearest cache.
const CHUNK: usize = 128;

/// As far past a chunk the widest vector of the first step may write.
const SPILL: usize = 8;

const HALF_DAY: u64 = HALF_DAY_NS as u64;

/// One half day of UT1: polynomials in the fraction of it, counted from its middle.
#[derive(Debug, Clone, Copy)]
pub(super) struct Interval {
    /// Hour angle at Greenwich \[rad\].
    pub hour_angle: [f64; 6],
    pub sin_declination: [f64; 6],
    pub cos_declination: [f64; 6],
    pub sin_parallax: [f64; 2],
}

/// A site and a span.
#[derive(Clone, Copy)]
pub(super) struct Job<'a> {
    pub intervals: &'a [Interval],
    /// UTC at which the first interval begins, wrapped to 64 bits.
    pub origin_unix_ns: i64,
    observer: Observer,
    longitude_rad: f64,
    refraction: Refraction,
}

type Buffer = [f64; CHUNK + SPILL];

/// Consecutive instants of one interval.
#[derive(Clone, Copy)]
struct Run {
    /// One past the last row.
    end: usize,
    /// The interval.
    index: usize,
}

/// What the first step leaves for the second.
struct Places {
    fraction: Buffer,
    hour_angle: Buffer,
    sin_declination: Buffer,
    cos_declination: Buffer,
    sin_parallax: Buffer,
}

impl<'a> Job<'a> {
    pub fn new(intervals: &'a [Interval], origin_unix_ns: i64, site: &SunSite) -> Self {
        Self {
            intervals,
            origin_unix_ns,
            observer: site.observer,
            longitude_rad: site.longitude_rad(),
            refraction: Refraction::of(site),
        }
    }

    /// `V` is the vector of the first step, `P` the pack of the second.
    #[inline(always)]
    pub fn run<V: Lanes, P: Lanes>(&self, unix_ns: &[i64], out: &mut Columns<'_>) {
        let mut places = Places {
            fraction: [0.0; CHUNK + SPILL],
            hour_angle: [0.0; CHUNK + SPILL],
            sin_declination: [0.0; CHUNK + SPILL],
            cos_declination: [0.0; CHUNK + SPILL],
            sin_parallax: [0.0; CHUNK + SPILL],
        };
        for (index, instants) in unix_ns.chunks(CHUNK).enumerate() {
            self.interpolate::<V>(instants, &mut places);
            let start = index * CHUNK;
            let mut row = 0;
            while row < instants.len() {
                let suns = self.topocentric::<P>(&places, row);
                let count = P::WIDTH.min(instants.len() - row);
                let at = start + row..start + row + count;
                put(suns[0], &mut out.azimuth[at.clone()]);
                put(suns[1], &mut out.apparent[at.clone()]);
                put(suns[2], &mut out.geometric[at]);
                row += count;
            }
        }
    }

    /// Evaluates the polynomials, run by run of instants in one interval. What a vector writes past
    /// its run is written over by the next one.
    #[inline(always)]
    fn interpolate<V: Lanes>(&self, instants: &[i64], places: &mut Places) {
        let mut runs = [Run { end: 0, index: 0 }; CHUNK];
        let runs = self.divide(instants, &mut places.fraction, &mut runs);
        let mut row = 0;
        for run in runs {
            let interval = &self.intervals[run.index];
            while row < run.end {
                let t = V::read(&places.fraction[row..]);
                polynomial(t, &interval.hour_angle).write(&mut places.hour_angle[row..]);
                polynomial(t, &interval.sin_declination).write(&mut places.sin_declination[row..]);
                polynomial(t, &interval.cos_declination).write(&mut places.cos_declination[row..]);
                polynomial(t, &interval.sin_parallax).write(&mut places.sin_parallax[row..]);
                row += V::WIDTH;
            }
            row = run.end;
        }
    }

    /// Splits instants into intervals and the fraction of each, in integers as far as they carry.
    #[inline(always)]
    fn divide<'r>(
        &self,
        instants: &[i64],
        fraction: &mut Buffer,
        runs: &'r mut [Run; CHUNK],
    ) -> &'r [Run] {
        let mut count = 0;
        let mut row = 0;
        while row < instants.len() {
            let since = |instant: i64| instant.wrapping_sub(self.origin_unix_ns) as u64;
            let index = since(instants[row]) / HALF_DAY;
            let start = index * HALF_DAY;
            for (&instant, fraction) in instants[row..].iter().zip(&mut fraction[row..]) {
                let inside = since(instant).wrapping_sub(start);
                if inside >= HALF_DAY {
                    break;
                }
                // exact: an integer below 2^53
                let from_middle = (inside as i64 - HALF_DAY_NS / 2) as f64;
                *fraction = from_middle * (1.0 / HALF_DAY_NS as f64);
                row += 1;
            }
            runs[count] = Run {
                end: row,
                index: index as usize,
            };
            count += 1;
        }
        &runs[..count]
    }

    /// Azimuth, apparent and geometric elevation: `topocentric::position` in lanes.
    #[inline(always)]
    fn topocentric<L: Lanes>(&self, places: &Places, row: usize) -> [L; 3] {
        let splat = L::splat;
        let sin_declination = L::read(&places.sin_declination[row..]);
        let cos_declination = L::read(&places.cos_declination[row..]);
        let sin_parallax = L::read(&places.sin_parallax[row..]);
        let hour_angle = L::read(&places.hour_angle[row..]).add(splat(self.longitude_rad));
        let (sin_hour, cos_hour) = sin_cos(hour_angle);
        let Observer {
            sin_latitude,
            cos_latitude,
            axis_distance,
            equator_height,
        } = self.observer;

        let shift = splat(axis_distance).mul(sin_parallax);
        let meridian = cos_declination.mul(cos_hour).sub(shift);
        let west = cos_declination.mul(sin_hour);
        let axis = splat(equator_height).neg_mul_add(sin_parallax, sin_declination);
        let up = meridian.mul_add(splat(cos_latitude), splat(sin_latitude).mul(axis));
        let north = meridian.neg_mul_add(splat(sin_latitude), splat(cos_latitude).mul(axis));

        let level_sq = north.mul_add(north, west.mul(west));
        let scale = splat(1.0).div(up.mul_add(up, level_sq).sqrt());
        // never zero, so that a sun in the very zenith has an azimuth
        let level = level_sq.sqrt().max(splat(f64::MIN_POSITIVE));
        let geometric = angle_half(level.mul(scale), up.mul(scale));
        let apparent = geometric.add(self.refraction.lanes(geometric));

        let east = splat(0.0).sub(west);
        let azimuth = angle_full(north, east, splat(1.0).div(level));
        let turned = azimuth.add(splat(TAU));
        let azimuth = L::select(azimuth.lt(splat(0.0)), turned, azimuth);
        // the sum may round to a whole turn
        let azimuth = L::select(azimuth.lt(splat(TAU)), azimuth, splat(0.0));
        [azimuth, apparent, geometric]
    }
}

/// Writes as many rows as there is room for.
#[inline(always)]
fn put<L: Lanes>(values: L, target: &mut [f64]) {
    if target.len() == L::WIDTH {
        values.write(target);
    } else {
        let mut side = [0.0; 4 * SPILL];
        values.write(&mut side);
        target.copy_from_slice(&side[..target.len()]);
    }
}

#[inline(always)]
fn polynomial<L: Lanes, const N: usize>(t: L, coefficients: &[f64; N]) -> L {
    let mut sum = L::splat(coefficients[N - 1]);
    for k in (0..N - 1).rev() {
        sum = sum.mul_add(t, L::splat(coefficients[k]));
    }
    sum
}
