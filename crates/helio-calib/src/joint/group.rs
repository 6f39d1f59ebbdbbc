//! Eight heliostats of a joint fit side by side: their records linearised and filtered in lanes.
//!
//! The filter of [`belief`](super::belief), begun at what is expected of the common unknowns and not at zero, so
//! that surprises need no common unknowns.

use core::ops::Range;

use faer::prelude::Solve;
use faer::{Mat, Side};
use helio_core::lanes::{BLOCK, Columns, Kernel, Lanes, run};
use helio_core::{Enu, SimdLevel};
use rayon::prelude::*;

use super::belief::{Belief, Number, Rates, Room, Shape, Tied, Told, WANDERING, at, column};
use super::common::{Common, Sum};
use super::hyper::{Hyper, Marks};
use super::reopen::LAST;
use super::rows::{
    BOUNDLESS, DAY_NS, MILLI, Place, Prepared, SUN_TURN_RAD_S, Structure, in_time, linearise,
    usable,
};
use crate::field::Campaign;
use crate::field::lane::{Eight, Lane};
use crate::model::{Real, dot};
use crate::observation::{Observation, Sighting};

impl<L: Lanes> Number for Lane<L> {
    #[inline(always)]
    fn square_root(self) -> Self {
        self.sqrt()
    }
    #[inline(always)]
    fn is(self, value: f64) -> Self {
        let value = Self::splat(value);
        let below = Self::select(self.lt(value), Self::splat(0.0), Self::splat(1.0));
        Self::select(value.lt(self), Self::splat(0.0), below)
    }
}

/// Columns of a record as given, along the world's axes.
mod given {
    pub const SUN: usize = 0;
    pub const ANGLES: usize = 3;
    /// Centre, normal, right, down.
    pub const PLANE: usize = 5;
    pub const SPOT: usize = 17;
    /// Zero where none is stated.
    pub const SIGMA: usize = 19;
    pub const TARGET: usize = 20;
    /// Since the record before.
    pub const DAYS: usize = 21;
    /// 0 where there is no record that can be used.
    pub const LIVE: usize = 22;
    pub const COUNT: usize = 23;
}

/// Columns of a mount: its axes, its pivot, the celestial pole.
const MOUNT: usize = 15;

/// Records whose determinants are multiplied before a logarithm is taken: far from the ends of a double.
const TOGETHER: usize = 8;

/// Room for eight heliostats, used again and again.
#[derive(Debug, Default)]
pub(super) struct Group {
    /// As [`column`] says, record after record.
    rows: Vec<Eight>,
    mount: Vec<Eight>,
    /// Where the formula is made linear, then the mirror offset.
    still: Vec<Eight>,
    /// 1 for a heliostat, 0 for a place that nobody takes.
    taken: Eight,
    length: usize,
    /// First of the last records of each.
    last: Eight,
    /// Whether a reference jumped in any of them.
    jumped: bool,
}

/// What is known of eight heliostats after their records, as [`Belief`] has it.
#[derive(Debug, Clone, PartialEq, Default)]
pub(super) struct Beliefs {
    pub mean: Vec<Eight>,
    pub gain: Vec<Eight>,
    pub spread: Vec<Eight>,
    /// Farthest that a record lies from what was expected: chi-squared with two degrees of freedom.
    pub farthest: Eight,
    /// The same of the [last records](LAST).
    pub farthest_last: Eight,
    /// Records of each that tell nothing by themselves, in time.
    pub silent: [Vec<usize>; BLOCK],
}

/// What some groups tell of what is common, about some value of it.
#[derive(Debug, Clone)]
pub(super) struct Total {
    matrix: Vec<Eight>,
    vector: Vec<Eight>,
    square: Eight,
    log_determinant: f64,
    determinants: Vec<Eight>,
}

impl Total {
    pub fn nothing(shape: Shape) -> Self {
        let zero = [0.0; BLOCK];
        Self {
            matrix: vec![zero; Shape::triangle(shape.common())],
            vector: vec![zero; shape.common()],
            square: zero,
            log_determinant: 0.0,
            determinants: Vec::new(),
        }
    }

    /// As if a heliostat had no records.
    pub fn leave_out(&mut self, lane: usize) {
        for values in self.matrix.iter_mut().chain(&mut self.vector) {
            values[lane] = 0.0;
        }
        self.square[lane] = 0.0;
        for values in &mut self.determinants {
            self.log_determinant -= libm::log(values[lane]);
            values[lane] = 1.0;
        }
    }

    pub fn add(&mut self, other: &Self) {
        let add = |to: &mut [Eight], from: &[Eight]| {
            for (a, b) in to.as_flattened_mut().iter_mut().zip(from.as_flattened()) {
                *a += b;
            }
        };
        add(&mut self.matrix, &other.matrix);
        add(&mut self.vector, &other.vector);
        add(
            core::slice::from_mut(&mut self.square),
            core::slice::from_ref(&other.square),
        );
        self.log_determinant += other.log_determinant;
    }

    /// The same about zero.
    pub fn sum(&self, shape: Shape, about: &[f64]) -> Sum {
        let of_lanes = |lanes: &Eight| lanes.iter().sum::<f64>();
        let mut told = Told::nothing(shape);
        told.matrix = self.matrix.iter().map(of_lanes).collect();
        let left: Vec<f64> = self.vector.iter().map(of_lanes).collect();
        told.square = of_lanes(&self.square);
        for (i, left) in left.iter().enumerate() {
            let mut moved = 0.0;
            for (j, b) in about.iter().enumerate() {
                moved += told.matrix[at(i.max(j), i.min(j))] * b;
            }
            told.vector[i] = left + moved;
            told.square += about[i] * (left + told.vector[i]);
        }
        Sum::new(told, self.log_determinant)
    }
}

/// What the filter is to know: noise, wander, heliostats' spread, and about what common unknowns.
#[derive(Debug)]
pub(super) struct Prior<'a> {
    shape: Shape,
    rates: Rates,
    spread: &'a [f64],
    /// Inverse of the spread, row by row; none where it has none.
    per_spread: Option<Vec<f64>>,
    about: &'a [f64],
    /// Causes in common that are not held to zero: those of the records.
    causes: &'a [usize],
}

impl<'a> Prior<'a> {
    pub fn new(shape: Shape, hyper: &'a Hyper, about: &'a [f64], causes: &'a [usize]) -> Self {
        Self {
            shape,
            rates: hyper.rates(),
            spread: &hyper.spread,
            per_spread: inverse(shape.still, &hyper.spread),
            about,
            causes,
        }
    }
}

/// Of a lower triangle, in units of its diagonal.
fn inverse(n: usize, triangle: &[f64]) -> Option<Vec<f64>> {
    let sigma: Vec<f64> = (0..n).map(|i| libm::sqrt(triangle[at(i, i)])).collect();
    let matrix = Mat::from_fn(n, n, |i, j| {
        triangle[at(i.max(j), i.min(j))] / (sigma[i] * sigma[j])
    });
    let inverse = matrix.llt(Side::Lower).ok()?.solve(Mat::identity(n, n));
    let out: Vec<f64> = (0..n * n)
        .map(|k| inverse[(k / n, k % n)] / (sigma[k / n] * sigma[k % n]))
        .collect();
    out.iter().all(|x| x.is_finite()).then_some(out)
}

impl Group {
    /// Takes heliostats, and linearises their records where it is to be for each.
    pub fn linearise<'a>(
        &mut self,
        level: SimdLevel,
        structure: &Structure,
        shared: &[f64],
        heliostats: impl ExactSizeIterator<Item = (&'a Campaign<'a>, &'a [f64])> + Clone,
        pole: Enu,
    ) {
        let still = structure.shape().still;
        let zero = [0.0; BLOCK];
        self.mount.clear();
        self.mount.resize(MOUNT, zero);
        self.still.clear();
        self.still.resize(still + 1, zero);
        self.taken = zero;
        let mut sources: Vec<Source<'_>> = Vec::with_capacity(BLOCK);
        for (lane, (campaign, at)) in heliostats.enumerate() {
            self.taken[lane] = 1.0;
            let mount = &campaign.mount;
            let axes = mount.axes;
            let of_mount =
                [axes.axis1, axes.axis2, axes.axis3].map(|axis| [axis.east, axis.north, axis.up]);
            for (k, value) in of_mount.as_flattened().iter().enumerate() {
                self.mount[k][lane] = *value;
            }
            let rest = [mount.pivot, pole].map(|v| [v.east, v.north, v.up]);
            for (k, value) in rest.as_flattened().iter().enumerate() {
                self.mount[9 + k][lane] = *value;
            }
            for (k, value) in at.iter().enumerate() {
                self.still[k][lane] = *value;
            }
            self.still[still][lane] = mount.mirror_offset_m;
            sources.push(Source::of(campaign));
        }
        // places that nobody takes: any mount, no record
        for lane in sources.len()..BLOCK {
            for columns in [&mut self.mount, &mut self.still] {
                for values in columns.iter_mut() {
                    values[lane] = values[0];
                }
            }
        }
        let lengths = sources.iter().map(|source| source.observations.len());
        self.length = lengths.clone().max().unwrap_or(0);
        self.last = zero;
        for (first, length) in self.last.iter_mut().zip(lengths) {
            *first = length.saturating_sub(LAST) as f64;
        }
        self.jumped = false;
        let columns = structure.shape().row();
        // every number is written
        self.rows.resize(self.length * columns, zero);
        let mut given = [const { Columns([[0.0; BLOCK]; given::COUNT]) }; TILE];
        for (tile, rows) in self.rows.chunks_mut(TILE * columns).enumerate() {
            let given = &mut given[..rows.len() / columns];
            given.fill(Columns([zero; given::COUNT]));
            for (lane, source) in sources.iter_mut().enumerate() {
                source.put(tile * TILE, lane, given);
            }
            run(
                level,
                Linearise {
                    structure,
                    shared,
                    mount: &self.mount,
                    still: &self.still,
                    given,
                    rows,
                },
            );
        }
    }

    /// Writes down what was decided about the records of a heliostat.
    pub fn mark(&mut self, shape: Shape, lane: usize, marks: &Marks, jump_mrad: f64) {
        let rest = shape.row() - column::REST;
        for &k in &marks.outliers {
            self.rows[k * shape.row() + rest + column::SILENT][lane] = 1.0;
        }
        self.jumped |= !marks.jumps.is_empty();
        for &(k, axis) in &marks.jumps {
            self.rows[k * shape.row() + rest + column::JUMP + axis][lane] = jump_mrad * jump_mrad;
        }
    }

    /// Takes all records of a heliostat for ones that tell nothing.
    pub fn silence(&mut self, shape: Shape, lane: usize) {
        let rest = shape.row() - column::REST;
        for row in self.rows.chunks_exact_mut(shape.row()) {
            row[rest + column::SILENT][lane] = 1.0;
            for axis in 0..2 {
                row[rest + column::JUMP + axis][lane] = 0.0;
            }
        }
    }

    /// Square of what is left of each record where the formula was made linear, in expected variances of one
    /// component: record by record.
    pub fn misses(&self, shape: Shape, prior: &Prior<'_>) -> Vec<Eight> {
        let rest = shape.row() - column::REST;
        let rates = &prior.rates;
        let wander: f64 = rates.wander.iter().sum();
        let of_row = |row: &[Eight]| {
            let mut misses = [0.0; BLOCK];
            for lane in 0..BLOCK {
                let mut square = 0.0;
                let mut scatter = rates.beam + rates.spot * row[rest + column::ON_TARGET][lane];
                scatter += row[rest + column::STATED][lane] + wander;
                for i in 0..2 {
                    let mut left = row[rest + column::SEEN + i][lane];
                    for k in 0..shape.still {
                        left -= row[2 * k + i][lane] * (MILLI * self.still[k][lane]);
                    }
                    square += left * left;
                    let path = row[rest + column::PATH + i][lane];
                    scatter += 0.5 * rates.sun * path * path;
                }
                // of a record that tells nothing, nothing is known
                let silent = row[rest + column::SILENT][lane] > 0.0;
                misses[lane] = if silent { f64::NAN } else { square / scatter };
            }
            misses
        };
        self.rows.chunks_exact(shape.row()).map(of_row).collect()
    }

    /// Takes the records of a heliostat from one on for ones that tell nothing, at the time of the one before.
    pub fn end(&mut self, shape: Shape, lane: usize, from: usize) {
        let rest = shape.row() - column::REST;
        for row in self.rows.chunks_exact_mut(shape.row()).skip(from) {
            row[rest + column::SILENT][lane] = 1.0;
            for k in [column::DAYS, column::JUMP, column::JUMP + 1] {
                row[rest + k][lane] = 0.0;
            }
        }
    }

    /// Linearised records of a heliostat by themselves, one after the other.
    pub fn records_of(&self, shape: Shape, lane: usize, records: Range<usize>) -> Vec<f64> {
        let wanted = self.rows[records.start * shape.row()..records.end * shape.row()].iter();
        wanted.map(|values| values[lane]).collect()
    }

    /// Goes through all records.
    pub fn filter(&self, level: SimdLevel, prior: &Prior<'_>, known: &mut Beliefs) -> Total {
        let shape = prior.shape;
        let zero = [0.0; BLOCK];
        known.mean.resize(shape.own(), zero);
        // causes that are held to zero have no part in anything
        known.gain.clear();
        known.gain.resize(shape.own() * shape.common(), zero);
        known.spread.resize(Shape::triangle(shape.own()), zero);
        known.farthest = zero;
        known.farthest_last = zero;
        let mut total = Total::nothing(shape);
        total
            .determinants
            .resize(self.length.div_ceil(TOGETHER), [1.0; BLOCK]);
        run(
            level,
            Filter {
                group: self,
                prior,
                known,
                total: &mut total,
            },
        );
        for product in &total.determinants {
            for (value, taken) in product.iter().zip(&self.taken) {
                if *taken > 0.0 {
                    total.log_determinant += libm::log(*value);
                }
            }
        }
        total
    }
}

#[inline(always)]
fn place(
    columns: &mut Columns<{ given::COUNT }>,
    lane: usize,
    observation: &Observation,
    days: f64,
) {
    let columns = &mut columns.0;
    // time goes on where a record tells nothing
    columns[given::DAYS][lane] = days;
    if !usable(observation) {
        return;
    }
    let plane = &observation.plane;
    let vectors = [
        (given::SUN, observation.sun.as_enu()),
        (given::PLANE, plane.centre),
        (given::PLANE + 3, plane.normal.as_enu()),
        (given::PLANE + 6, plane.right.as_enu()),
        (given::PLANE + 9, plane.down.as_enu()),
    ];
    for (first, vector) in vectors {
        columns[first][lane] = vector.east;
        columns[first + 1][lane] = vector.north;
        columns[first + 2][lane] = vector.up;
    }
    columns[given::ANGLES][lane] = observation.axis1_rad;
    columns[given::ANGLES + 1][lane] = observation.axis2_rad;
    columns[given::SPOT][lane] = observation.u_m;
    columns[given::SPOT + 1][lane] = observation.v_m;
    columns[given::SIGMA][lane] = observation.sigma_m.unwrap_or(0.0);
    columns[given::TARGET][lane] = observation.target as f64;
    columns[given::LIVE][lane] = 1.0;
}

#[inline(always)]
fn three<L: Lanes>(from: &[Eight], lane: usize) -> [Lane<L>; 3] {
    [
        Lane::read(&from[0], lane),
        Lane::read(&from[1], lane),
        Lane::read(&from[2], lane),
    ]
}

#[inline(always)]
fn along<L: Lanes>(axes: &[[Lane<L>; 3]; 3], vector: &[Lane<L>; 3]) -> [Lane<L>; 3] {
    [
        dot(axes[0], *vector),
        dot(axes[1], *vector),
        dot(axes[2], *vector),
    ]
}

/// Records that are brought into lanes and linearised before others are: few enough for the nearest cache.
const TILE: usize = 16;

/// Records of a heliostat, one after the other in time.
struct Source<'a> {
    observations: &'a [Observation],
    /// Which, and when, where they do not stand in time.
    sorted: Option<(Vec<usize>, Vec<f64>)>,
    last: Option<f64>,
}

impl<'a> Source<'a> {
    fn of(campaign: &'a Campaign<'a>) -> Self {
        let observations = campaign.observations;
        let in_order = observations.is_sorted_by_key(|o| o.unix_ns.unwrap_or(i64::MIN))
            && observations.first().is_none_or(|o| o.unix_ns.is_some());
        Self {
            observations,
            sorted: (!in_order).then(|| in_time(campaign)),
            last: None,
        }
    }

    /// Those from `from` on, as many as there is room for.
    fn put(&mut self, from: usize, lane: usize, given: &mut [Columns<{ given::COUNT }>]) {
        for (record, columns) in (from..self.observations.len()).zip(given) {
            let (observation, day) = match &self.sorted {
                None => {
                    let observation = &self.observations[record];
                    let ns = observation.unix_ns.unwrap_or_default();
                    (observation, ns as f64 / DAY_NS)
                }
                Some((of, days)) => (&self.observations[of[record]], days[record]),
            };
            place(columns, lane, observation, day - self.last.unwrap_or(day));
            self.last = Some(day);
        }
    }
}

struct Linearise<'a> {
    structure: &'a Structure,
    shared: &'a [f64],
    mount: &'a [Eight],
    still: &'a [Eight],
    given: &'a [Columns<{ given::COUNT }>],
    rows: &'a mut [Eight],
}

impl Kernel for Linearise<'_> {
    type Output = ();
    #[inline(always)]
    fn run<L: Lanes>(mut self) {
        let mut lane = 0;
        while lane < BLOCK {
            linearise_some::<L>(&mut self, lane);
            lane += L::WIDTH;
        }
    }
}

/// See [`prepare`](super::rows::prepare) and [`Rows::of`].
#[inline(always)]
fn linearise_some<L: Lanes>(some: &mut Linearise<'_>, lane: usize) {
    let structure = some.structure;
    let shape = structure.shape();
    let (zero, one) = (Lane::<L>::splat(0.0), Lane::<L>::splat(1.0));
    let mut still = vec![zero; some.still.len()];
    for k in 0..still.len() {
        still[k] = Lane::read(&some.still[k], lane);
    }
    let mut shared = vec![zero; some.shared.len()];
    for k in 0..shared.len() {
        shared[k] = Lane::splat(some.shared[k]);
    }
    let place = Place::new(&still, &shared);
    let mount = some.mount;
    let axes = [
        three::<L>(&mount[0..3], lane),
        three(&mount[3..6], lane),
        three(&mount[6..9], lane),
    ];
    let pivot = three::<L>(&mount[9..12], lane);
    let pole = three::<L>(&mount[12..15], lane);
    let mut row = vec![zero; shape.row()];
    let rest = shape.row() - column::REST;
    let rows = some.rows.chunks_exact_mut(shape.row());
    for (given, out) in some.given.iter().zip(rows) {
        let given = &given.0;
        let sun = three::<L>(&given[given::SUN..], lane);
        let centre = three::<L>(&given[given::PLANE..], lane);
        let normal = three::<L>(&given[given::PLANE + 3..], lane);
        let right = three::<L>(&given[given::PLANE + 6..], lane);
        let down = three::<L>(&given[given::PLANE + 9..], lane);
        let centre = [
            centre[0] - pivot[0],
            centre[1] - pivot[1],
            centre[2] - pivot[2],
        ];
        let turn = Lane::splat(SUN_TURN_RAD_S);
        let motion = [
            (sun[1] * pole[2] - sun[2] * pole[1]) * turn,
            (sun[2] * pole[0] - sun[0] * pole[2]) * turn,
            (sun[0] * pole[1] - sun[1] * pole[0]) * turn,
        ];
        let (sin1, cos1) = Lane::<L>::read(&given[given::ANGLES], lane).sin_cos();
        let (sin2, cos2) = Lane::<L>::read(&given[given::ANGLES + 1], lane).sin_cos();
        let along_normal = dot(normal, centre);
        let u = dot(right, centre) + Lane::read(&given[given::SPOT], lane);
        let v = dot(down, centre) + Lane::read(&given[given::SPOT + 1], lane);
        // see `Sighting::across_beam`
        let square = u * u + v * v;
        let level = square.sqrt();
        let slant = along_normal.mul_add(along_normal, square).sqrt();
        let per = Lane::splat(MILLI) / slant;
        let per_level = one / level;
        let on_axis = square.le(zero);
        let cosine = Lane::select(on_axis, zero, u * per_level);
        let sine = Lane::select(on_axis, -one, v * per_level);
        let shortened = Lane::select(on_axis, one, along_normal.abs() / slant);
        let short = per * shortened;
        let prepared = Prepared {
            sighting: Sighting {
                sun: along(&axes, &sun),
                axis1: [cos1, sin1],
                axis2: [cos2, sin2],
                plane: [
                    along(&axes, &normal),
                    along(&axes, &right),
                    along(&axes, &down),
                ],
                centre_along_normal_m: along_normal,
                spot_m: [u, v],
                weight: one,
                up: [axes[0][2], axes[1][2], axes[2][2]],
                pose_errors: None,
            },
            sun_motion: along(&axes, &motion),
            across: [
                [-(sine * per), cosine * per],
                // on the axis the two components are simply right and down
                [cosine * short, Lane::select(on_axis, short, sine * short)],
            ],
        };
        let target = Lane::read(&given[given::TARGET], lane);
        let lands = linearise(structure, &place, &prepared, target, &mut row);
        let sigma = Lane::read(&given[given::SIGMA], lane);
        let stated = zero.lt(sigma);
        let per_square = per * per;
        let numbers = [
            (column::STATED, per_square * sigma * sigma),
            (column::ON_TARGET, Lane::select(stated, zero, per_square)),
        ];
        // not a number where any number is none
        let mut bad = zero;
        for value in &row[..rest + column::STATED] {
            bad = value.mul_add(zero, bad);
        }
        let mut fine = Lane::select(zero.lt(lands[0]), one, zero);
        fine = Lane::select(zero.lt(lands[1]), fine, zero);
        fine = Lane::select(zero.lt(lands[2]), fine, zero);
        fine = Lane::select(
            zero.lt(Lane::<L>::read(&given[given::LIVE], lane)),
            fine,
            zero,
        );
        fine = Lane::select(bad.le(zero), fine, zero);
        for (_, value) in numbers {
            fine = Lane::select(value.lt(Lane::splat(BOUNDLESS)), fine, zero);
        }
        let tells = zero.lt(fine);
        for (value, out) in row[..rest + column::STATED].iter().zip(out.iter_mut()) {
            Lane::select(tells, *value, zero).write(out, lane);
        }
        for (which, value) in numbers {
            Lane::select(tells, value, zero).write(&mut out[rest + which], lane);
        }
        Lane::<L>::read(&given[given::DAYS], lane).write(&mut out[rest + column::DAYS], lane);
        (one - fine).write(&mut out[rest + column::SILENT], lane);
        zero.write(&mut out[rest + column::JUMP], lane);
        zero.write(&mut out[rest + column::JUMP + 1], lane);
    }
}

/// 1 - exp(-x) for x >= 0, from the series of a small part of it that is doubled again and again: no step
/// makes the relative error larger.
#[inline(always)]
fn forgotten<L: Lanes>(x: Lane<L>) -> Lane<L> {
    const DOUBLED: usize = 6;
    const MOST: f64 = 64.0;
    const TERMS: usize = 18;
    const PER: [f64; TERMS] = {
        let mut per = [0.0; TERMS];
        let mut k = 0;
        while k < TERMS {
            per[k] = 1.0 / (TERMS - k + 1) as f64;
            k += 1;
        }
        per
    };
    let one = Lane::splat(1.0);
    let x = x.min(Lane::splat(MOST)).max(Lane::splat(0.0)) * Lane::splat(1.0 / MOST);
    let mut sum = one;
    for per in PER {
        sum = (x * sum).neg_mul_add(Lane::splat(per), one);
    }
    let mut lost = x * sum;
    for _ in 0..DOUBLED {
        lost = lost * (Lane::splat(2.0) - lost);
    }
    lost
}

struct Filter<'a> {
    group: &'a Group,
    prior: &'a Prior<'a>,
    known: &'a mut Beliefs,
    total: &'a mut Total,
}

impl Kernel for Filter<'_> {
    type Output = ();
    #[inline(always)]
    fn run<L: Lanes>(self) {
        let mut lane = 0;
        while lane < BLOCK {
            filter_some::<L>(self.group, self.prior, self.known, self.total, lane);
            lane += L::WIDTH;
        }
    }
}

/// What the mean is made a function of: the causes alone, as long as no reference jumps. By the means of the
/// unknowns at rest it then follows from what is known at the end (see [`by_means`]).
fn tied(group: &Group, prior: &Prior<'_>) -> Shape {
    let all = group.jumped || prior.per_spread.is_none();
    Shape {
        still: prior.shape.still,
        causes: prior.causes.len(),
        tied: if all { Tied::All } else { Tied::Causes },
    }
}

#[inline(always)]
fn filter_some<L: Lanes>(
    group: &Group,
    prior: &Prior<'_>,
    known: &mut Beliefs,
    total: &mut Total,
    lane: usize,
) {
    let given = prior.shape;
    let shape = tied(group, prior);
    let still = shape.still;
    let (zero, one) = (Lane::<L>::splat(0.0), Lane::<L>::splat(1.0));
    let rates = &prior.rates;
    let rest = shape.row() - column::REST;
    let rows = Shape {
        causes: prior.causes.len(),
        ..given
    };
    let rest_given = rows.row() - column::REST;
    // apart from the filter: no record waits for another
    let mut lost = vec![[zero; 2]; group.length];
    for (lost, numbers) in lost.iter_mut().zip(group.rows.chunks_exact(rows.row())) {
        let days = Lane::read(&numbers[rest_given + column::DAYS], lane);
        *lost = [
            forgotten(days / Lane::splat(rates.days[0])),
            forgotten(days / Lane::splat(rates.days[2])),
        ];
    }
    let mut belief = Belief::of_field(shape, prior.spread, rates);
    for i in 0..still {
        belief.mean[i] = Lane::splat(prior.about[i]);
    }
    let mut told = Told::nothing(shape);
    let mut room = Room::of(shape);
    let mut row = vec![zero; shape.row()];
    let (mut farthest, mut farthest_last) = (zero, zero);
    let last = Lane::<L>::read(&group.last, lane);
    for (k, numbers) in group.rows.chunks_exact(rows.row()).enumerate() {
        for (to, from) in row[..2 * still].iter_mut().zip(numbers) {
            *to = Lane::read(from, lane);
        }
        let others = numbers[rest_given..].iter();
        for (to, from) in row[rest..].iter_mut().zip(others) {
            *to = Lane::read(from, lane);
        }
        for (n, &cause) in prior.causes.iter().enumerate() {
            let value = Lane::splat(prior.about[still + cause]);
            for i in 0..2 {
                let slope = Lane::read(&numbers[2 * (still + n) + i], lane);
                row[2 * (still + n) + i] = slope;
                let seen = &mut row[rest + column::SEEN + i];
                *seen = value.neg_mul_add(slope, *seen);
            }
        }
        let [slow, fast] = lost[k];
        let lost = [slow, slow, fast, fast];
        let mut kept = [zero; WANDERING];
        let mut added = [zero; WANDERING];
        for i in 0..WANDERING {
            kept[i] = one - lost[i];
            added[i] = Lane::splat(rates.wander[i]) * (lost[i] * (one + kept[i]));
        }
        belief.wait(kept, added);
        if group.jumped {
            belief.loosen([row[rest + column::JUMP], row[rest + column::JUMP + 1]]);
        }
        let mut surprise = belief.weigh(&row, rates, &[], &mut room);
        surprise.mute(one - row[rest + column::SILENT]);
        let square = surprise.square();
        farthest = square.max(farthest);
        let square = Lane::select(Lane::splat(k as f64).lt(last), zero, square);
        farthest_last = square.max(farthest_last);
        belief.believe(&surprise, &mut room, &mut told);
        if k % TOGETHER == TOGETHER - 1 || k + 1 == group.length {
            told.determinant
                .write(&mut total.determinants[k / TOGETHER], lane);
            told.determinant = one;
        }
    }
    farthest.write(&mut known.farthest, lane);
    farthest_last.write(&mut known.farthest_last, lane);
    for i in 0..shape.own() {
        for j in 0..=i {
            belief
                .covariance(i, j)
                .write(&mut known.spread[at(i, j)], lane);
        }
    }
    let taken = Lane::read(&group.taken, lane);
    (told.square * taken).write(&mut total.square, lane);
    let (first, common) = (shape.means(), given.common());
    for (n, &cause) in prior.causes.iter().enumerate() {
        let (from, to) = (first + n, still + cause);
        for i in 0..shape.own() {
            belief
                .gain(i, from)
                .write(&mut known.gain[i * common + to], lane);
        }
        (told.vector[from] * taken).write(&mut total.vector[to], lane);
        for (m, &other) in prior.causes[..=n].iter().enumerate() {
            let value = told.matrix[at(from, first + m)] * taken;
            value.write(&mut total.matrix[at(to, still + other)], lane);
        }
    }
    if let (Tied::Causes, Some(per_spread)) = (shape.tied, &prior.per_spread) {
        by_means(prior, per_spread, &belief, known, total, lane, taken);
    } else {
        for i in 0..still {
            for k in 0..shape.own() {
                belief
                    .gain(k, i)
                    .write(&mut known.gain[k * common + i], lane);
            }
            (told.vector[i] * taken).write(&mut total.vector[i], lane);
            for j in 0..=i {
                (told.matrix[at(i, j)] * taken).write(&mut total.matrix[at(i, j)], lane);
            }
            for (n, &cause) in prior.causes.iter().enumerate() {
                let value = told.matrix[at(first + n, i)] * taken;
                value.write(&mut total.matrix[at(still + cause, i)], lane);
            }
        }
    }
    for i in 0..shape.own() {
        let mut mean = belief.mean[i];
        for (g, &b) in known.gain[i * common..(i + 1) * common]
            .iter()
            .zip(prior.about)
        {
            mean = Lane::read(g, lane).neg_mul_add(Lane::splat(b), mean);
        }
        mean.write(&mut known.mean[i], lane);
    }
}

/// What the mean is as a function of the means of the unknowns at rest, and what the records tell of these,
/// where nothing was added to the unknowns at rest meanwhile. With C their covariance before the records, P
/// what is left of it, m - m0 what the records moved them by, and G the gain by the causes: the gain by the
/// means is P C⁻¹, and the normal equations with Hᵀ V⁻¹ H = C⁻¹ - C⁻¹ P C⁻¹, with
/// Hᵀ V⁻¹ F = -C⁻¹ G, and with C⁻¹ (m - m0) on their right, V the covariance of all records together.
#[inline(always)]
fn by_means<L: Lanes>(
    prior: &Prior<'_>,
    per_spread: &[f64],
    belief: &Belief<Lane<L>>,
    known: &mut Beliefs,
    total: &mut Total,
    lane: usize,
    taken: Lane<L>,
) {
    let zero = Lane::<L>::splat(0.0);
    let (still, common) = (prior.shape.still, prior.shape.common());
    let mut gain = vec![zero; still * still];
    for i in 0..belief.shape.own() {
        for j in 0..still {
            let mut sum = zero;
            for l in 0..still {
                sum = belief
                    .covariance(i, l)
                    .mul_add(Lane::splat(per_spread[l * still + j]), sum);
            }
            sum.write(&mut known.gain[i * common + j], lane);
            if i < still {
                gain[i * still + j] = sum;
            }
        }
    }
    for i in 0..still {
        let line = &per_spread[i * still..(i + 1) * still];
        let mut vector = zero;
        for (l, &c) in line.iter().enumerate() {
            let moved = belief.mean[l] - Lane::splat(prior.about[l]);
            vector = moved.mul_add(Lane::splat(c), vector);
        }
        (vector * taken).write(&mut total.vector[i], lane);
        for j in 0..=i {
            let mut value = Lane::splat(line[j]);
            for (l, &c) in line.iter().enumerate() {
                value = gain[l * still + j].neg_mul_add(Lane::splat(c), value);
            }
            (value * taken).write(&mut total.matrix[at(i, j)], lane);
        }
        for (n, &cause) in prior.causes.iter().enumerate() {
            let mut value = zero;
            for (l, &c) in line.iter().enumerate() {
                value = belief.gain(l, n).neg_mul_add(Lane::splat(c), value);
            }
            (value * taken).write(&mut total.matrix[at(still + cause, i)], lane);
        }
    }
}

impl Beliefs {
    /// Takes what is known of a heliostat from others.
    pub fn take(&mut self, lane: usize, from: &Self, of: usize) {
        let pairs = [
            (&mut self.mean, &from.mean),
            (&mut self.gain, &from.gain),
            (&mut self.spread, &from.spread),
        ];
        for (to, from) in pairs {
            for (to, from) in to.iter_mut().zip(from) {
                to[lane] = from[of];
            }
        }
        self.farthest[lane] = from.farthest[of];
        self.farthest_last[lane] = from.farthest_last[of];
    }

    /// Of one of the heliostats.
    pub fn belief(&self, shape: Shape, lane: usize) -> Belief<f64> {
        let of = |values: &[Eight]| values.iter().map(|v| v[lane]).collect::<Vec<f64>>();
        Belief::of_parts(shape, of(&self.mean), &of(&self.gain), &of(&self.spread))
    }

    /// Unknowns at rest of one of the heliostats, for what is common \[mrad\].
    pub fn still<'a>(
        &'a self,
        shape: Shape,
        lane: usize,
        common: &'a [f64],
    ) -> impl Iterator<Item = f64> + 'a {
        (0..shape.still).map(move |i| {
            let line = &self.gain[i * common.len()..(i + 1) * common.len()];
            let by: f64 = line.iter().zip(common).map(|(g, b)| g[lane] * b).sum();
            self.mean[i][lane] + by
        })
    }

    /// With what is common known only so well: of all own unknowns, or where `apart` of those at rest less
    /// their means over the field.
    pub fn settle(&self, level: SimdLevel, shape: Shape, common: &Common, apart: bool) -> Settled {
        let count = if apart { shape.still } else { shape.own() };
        let zero = [0.0; BLOCK];
        let mut settled = Settled {
            mean: vec![zero; count],
            covariance: vec![zero; Shape::triangle(count)],
        };
        run(
            level,
            Settle {
                known: self,
                common,
                apart,
                settled: &mut settled,
            },
        );
        settled
    }
}

/// Mean and covariance (lower triangle) of unknowns of eight heliostats.
#[derive(Debug)]
pub(super) struct Settled {
    pub mean: Vec<Eight>,
    pub covariance: Vec<Eight>,
}

struct Settle<'a> {
    known: &'a Beliefs,
    common: &'a Common,
    apart: bool,
    settled: &'a mut Settled,
}

impl Kernel for Settle<'_> {
    type Output = ();
    #[inline(always)]
    fn run<L: Lanes>(self) {
        let mut lane = 0;
        while lane < BLOCK {
            settle_some::<L>(self.known, self.common, self.apart, self.settled, lane);
            lane += L::WIDTH;
        }
    }
}

/// P + G V Gᵀ.
#[inline(always)]
fn settle_some<L: Lanes>(
    known: &Beliefs,
    common: &Common,
    apart: bool,
    settled: &mut Settled,
    lane: usize,
) {
    let zero = Lane::<L>::splat(0.0);
    let (count, n) = (settled.mean.len(), common.mean.len());
    let mut gain = vec![zero; count * n];
    for (to, from) in gain.iter_mut().zip(&known.gain) {
        *to = Lane::read(from, lane);
    }
    let mut through = vec![zero; n];
    for i in 0..count {
        if apart {
            gain[i * n + i] = gain[i * n + i] - Lane::splat(1.0);
        }
        let mut mean = Lane::read(&known.mean[i], lane);
        for (&g, &b) in gain[i * n..(i + 1) * n].iter().zip(&common.mean) {
            mean = g.mul_add(Lane::splat(b), mean);
        }
        mean.write(&mut settled.mean[i], lane);
        for (to, line) in through.iter_mut().zip(common.covariance.chunks_exact(n)) {
            let mut sum = zero;
            for (&g, &v) in gain[i * n..(i + 1) * n].iter().zip(line) {
                sum = g.mul_add(Lane::splat(v), sum);
            }
            *to = sum;
        }
        for j in 0..=i {
            let mut sum = Lane::read(&known.spread[at(i, j)], lane);
            for (&g, &t) in gain[j * n..(j + 1) * n].iter().zip(&through) {
                sum = g.mul_add(t, sum);
            }
            sum.write(&mut settled.covariance[at(i, j)], lane);
        }
    }
}

/// Heliostats that noise and wander are learnt from.
#[derive(Debug)]
pub(super) struct Sample {
    pub shape: Shape,
    pub level: SimdLevel,
    pub groups: Vec<Group>,
    /// The heliostats, eight by eight.
    pub members: Vec<usize>,
    /// About what common unknowns.
    pub about: Vec<f64>,
    /// See [`Prior`].
    pub causes: Vec<usize>,
}

impl Sample {
    /// Goes through all records.
    pub fn filter(&self, hyper: &Hyper) -> (Vec<Beliefs>, Sum) {
        let prior = Prior::new(self.shape, hyper, &self.about, &self.causes);
        let each: Vec<(Beliefs, Total)> = self
            .groups
            .par_iter()
            .map(|group| {
                let mut known = Beliefs::default();
                let total = group.filter(self.level, &prior, &mut known);
                (known, total)
            })
            .collect();
        let mut sum = Total::nothing(self.shape);
        for (_, total) in &each {
            sum.add(total);
        }
        let sum = sum.sum(self.shape, &self.about);
        (each.into_iter().map(|(known, _)| known).collect(), sum)
    }

    /// What all records tell under each of some assumptions: a group's records stay in the cache meanwhile.
    pub fn tell(&self, each: &[Hyper]) -> Vec<Sum> {
        let prior = |hyper| Prior::new(self.shape, hyper, &self.about, &self.causes);
        let priors: Vec<Prior<'_>> = each.iter().map(prior).collect();
        let of_groups: Vec<Vec<Total>> = self
            .groups
            .par_iter()
            .map_init(Beliefs::default, |known, group| {
                let told = priors
                    .iter()
                    .map(|prior| group.filter(self.level, prior, known));
                told.collect()
            })
            .collect();
        (0..each.len())
            .map(|n| {
                let mut sum = Total::nothing(self.shape);
                for totals in &of_groups {
                    sum.add(&totals[n]);
                }
                sum.sum(self.shape, &self.about)
            })
            .collect()
    }

    /// Second moments of what heliostats at rest depart from the field by, summed over them: row by row.
    pub fn moments(&self, known: &[Beliefs], common: &Common) -> Vec<f64> {
        let still = self.shape.still;
        let each: Vec<Settled> = known
            .par_iter()
            .map(|known| known.settle(self.level, self.shape, common, true))
            .collect();
        let mut total = vec![0.0; still * still];
        for (settled, group) in each.iter().zip(&self.groups) {
            for i in 0..still {
                for j in 0..still {
                    let covariance = &settled.covariance[at(i.max(j), i.min(j))];
                    for lane in 0..BLOCK {
                        let square = settled.mean[i][lane] * settled.mean[j][lane];
                        total[i * still + j] += group.taken[lane] * (square + covariance[lane]);
                    }
                }
            }
        }
        total
    }
}

#[cfg(test)]
mod tests {
    use super::super::hyper::waited;
    use super::super::rows::{Expansion, Rows, pole};
    use super::super::simulate::{FieldOptions, simulate_field};
    use super::super::terms::{AxisCause, Cause, SpotCause};
    use super::*;

    fn hyper(still: usize) -> Hyper {
        use super::super::hyper::{
            EXPECTED_NOISE, EXPECTED_SPREAD_MRAD, EXPECTED_WANDER, expected_covariance,
        };
        let mut sigma = EXPECTED_SPREAD_MRAD.to_vec();
        sigma.resize(still, 1.0);
        Hyper {
            noise: EXPECTED_NOISE,
            wander: EXPECTED_WANDER,
            spread: expected_covariance(&sigma),
        }
    }

    /// Relative to the largest of the wanted numbers.
    fn near(what: &str, got: &[f64], want: &[f64]) {
        let size = want.iter().fold(0.0, |m: f64, x| m.max(x.abs()));
        assert_eq!(got.len(), want.len(), "{what}");
        for (k, (got, want)) in got.iter().zip(want).enumerate() {
            assert!(
                (got - want).abs() <= 1e-9 * size,
                "{what} {k}: {got} {want} of {size}"
            );
        }
    }

    /// The filter of one heliostat, record by record about zero, is what the lanes are held to: with a jump,
    /// a record that is not believed, some that cannot be used and lengths that differ.
    #[test]
    fn lanes_know_and_tell_what_the_filter_of_one_does() {
        let options = FieldOptions {
            heliostats: 3,
            records: 14,
            ..FieldOptions::new(3).unwrap()
        };
        let field = simulate_field(&options).unwrap();
        let mut campaigns = field.first(14);
        campaigns[1].observations = &campaigns[1].observations[..9];
        let mut unusable = campaigns[2].observations.to_vec();
        unusable[3].sigma_m = Some(f64::NAN);
        unusable[7].u_m = f64::INFINITY;
        unusable[8].sigma_m = Some(0.02);
        campaigns[2].observations = &unusable;
        let structure = Structure {
            own: vec![AxisCause::Axis2Eccentricity],
            shared: vec![
                Cause::Axis(AxisCause::Axis1Sag),
                Cause::Target(SpotCause::TargetRight, 0),
                Cause::Target(SpotCause::TargetDown, 1),
                Cause::Spots(SpotCause::SunTime),
            ],
        };
        let shape = structure.shape();
        let pole = pole(options.site.latitude_rad());
        let place = Expansion {
            still: vec![1e-3, -2e-3, 3e-3, 5e-4, -1e-3, 2e-3, 4e-4],
            shared: vec![1e-3, 0.01, -0.02, 3.0],
        };
        let hyper = hyper(shape.still);
        let about: Vec<f64> = (0..shape.common()).map(|k| 0.1 * k as f64 - 0.4).collect();
        let marks = Marks {
            outliers: vec![4],
            jumps: vec![(6, 0), (8, 1)],
        };
        let mut group = Group::default();
        let heliostats = campaigns.iter().map(|c| (c, &place.still[..]));
        let level = SimdLevel::best();
        group.linearise(level, &structure, &place.shared, heliostats, pole);
        group.mark(shape, 1, &marks, 10.0);
        let prior = Prior::new(shape, &hyper, &about, &[0, 1, 2, 3]);
        let mut known = Beliefs::default();
        let total = group.filter(SimdLevel::best(), &prior, &mut known);
        let got = total.sum(shape, &about);

        let rates = hyper.rates();
        let rest = shape.row() - column::REST;
        let mut want = Sum::nothing(shape);
        for (lane, campaign) in campaigns.iter().enumerate() {
            let mut rows = Rows::of(&structure, campaign, &place, pole);
            if lane == 1 {
                rows.mark(shape, &marks, 10.0);
            }
            near(
                "rows",
                &group.records_of(shape, lane, 0..rows.len()),
                &rows.numbers,
            );
            let mut belief = Belief::of_field(shape, &hyper.spread, &rates);
            let mut told = Told::nothing(shape);
            let mut room = Room::of(shape);
            let mut log_determinant = 0.0;
            for k in 0..rows.len() {
                let row = rows.row(shape, k);
                let (kept, added) = waited(&rates, row[rest + column::DAYS]);
                belief.wait(kept, added);
                belief.loosen([row[rest + column::JUMP], row[rest + column::JUMP + 1]]);
                if row[rest + column::SILENT] == 0.0 {
                    let surprise = belief.weigh(row, &rates, &[], &mut room);
                    belief.believe(&surprise, &mut room, &mut told);
                    log_determinant += libm::log(surprise.determinant());
                }
            }
            want.add(&Sum::new(told, log_determinant));
            let lanes = known.belief(shape, lane);
            near("mean", &lanes.mean, &belief.mean);
            near("gain", &lanes.gain_by_rows(), &belief.gain_by_rows());
            near("spread", &lanes.triangle(), &belief.triangle());
        }
        near("matrix", &got.told.matrix, &want.told.matrix);
        near("vector", &got.told.vector, &want.told.vector);
        near("square", &[got.told.square], &[want.told.square]);
        near(
            "determinant",
            &[got.log_determinant],
            &[want.log_determinant],
        );
    }
}
