//! Records as rows of a linear model.

use core::f64::consts::TAU;

use helio_core::{Enu, EnuUnit};

use super::belief::{Number, REFERENCES, Shape, Tied, column};
use super::hyper::Marks;
use super::terms::{AxisCause, Cause, LoadedPose, SeenSpot};
use crate::field::Campaign;
use crate::model::{Pose, dot, landing, normal, turned_back, turned_on};
use crate::observation::{Observation, Sighting};
use crate::parameters::{COUNT, Parameter, Parameters};

/// Angles of a mount.
pub(super) const ANGLES: usize = 6;
/// Milliradians of a radian: the unit of angles in the filter.
pub(super) const MILLI: f64 = 1e3;
/// The sun's turn about the pole \[rad/s\].
pub(super) const SUN_TURN_RAD_S: f64 = TAU / 86_400.0;
/// Nanoseconds of a day.
pub const DAY_NS: f64 = 86_400e9;

/// Which unknowns there are.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Structure {
    /// Causes of which each heliostat has its own value, after its six angles.
    pub own: Vec<AxisCause>,
    /// Causes of which there is one value.
    pub shared: Vec<Cause>,
}

impl Structure {
    pub fn shape(&self) -> Shape {
        Shape {
            still: ANGLES + self.own.len(),
            causes: self.shared.len(),
            tied: Tied::All,
        }
    }
}

/// Where the linear model touches the formula: radians, metres, seconds.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Expansion {
    /// Six angles and own causes.
    pub still: Vec<f64>,
    /// Shared causes.
    pub shared: Vec<f64>,
}

/// How an unknown is measured in the filter: by this times its own unit.
pub(super) const fn filter_unit(cause: Cause) -> f64 {
    match cause {
        Cause::Axis(_) => MILLI,
        Cause::Target(..) | Cause::Spots(_) => 1.0,
    }
}

/// Fixed-point steps to the loaded pose: each shrinks the error by the size of the causes, below 0.05.
const LOADING_STEPS: usize = 6;

/// A record's numbers that do not depend on the heliostat's unknowns.
#[derive(Debug, Clone, Copy)]
pub(super) struct Prepared<T> {
    pub sighting: Sighting<T>,
    /// Motion of the sun along the mount's axes \[1/s\].
    pub sun_motion: [T; 3],
    /// See [`Sighting::across_beam`], over the slant: mrad per metre.
    pub across: [[T; 2]; 2],
}

/// Where the formula is made linear for a heliostat, ready for its records.
pub(super) struct Place<'a, T> {
    /// Unknowns at rest, then the mirror offset.
    still: &'a [T],
    shared: &'a [T],
    pose: Pose<T>,
    /// Cosine and sine of the references.
    references: [[T; 2]; 2],
}

#[inline(always)]
fn cos_sin<T: Number>(angle: T) -> [T; 2] {
    let (sine, cosine) = angle.sin_cos();
    [cosine, sine]
}

impl<'a, T: Number> Place<'a, T> {
    #[inline(always)]
    pub fn new(still: &'a [T], shared: &'a [T]) -> Self {
        let mut values = [T::splat(0.0); COUNT];
        values[..ANGLES].copy_from_slice(&still[..ANGLES]);
        values[Parameter::MirrorOffset as usize] = still[still.len() - 1];
        Self {
            still,
            shared,
            pose: Pose::new(values),
            references: [cos_sin(still[REFERENCES[0]]), cos_sin(still[REFERENCES[1]])],
        }
    }
}

/// Adds what a cause turns both axes by.
#[inline(always)]
fn add_turn<T: Number>(turn: &mut [T; 2], cause: AxisCause, value: T, loaded: &LoadedPose<T>) {
    let by = cause.turn(loaded);
    *turn = [value.mul_add(by[0], turn[0]), value.mul_add(by[1], turn[1])];
}

#[inline(always)]
fn times<T: Number>(across: &[[T; 2]; 2], v: [T; 2]) -> [T; 2] {
    let [[right0, down0], [right1, down1]] = *across;
    [
        right0.mul_add(v[0], down0 * v[1]),
        right1.mul_add(v[0], down1 * v[1]),
    ]
}

/// Writes a slope down, and takes what it explains at `scaled` into what is seen.
#[inline(always)]
fn put<T: Number>(to: &mut [T], seen: &mut [T; 2], slope: [T; 2], scaled: T) {
    to[0] = slope[0];
    to[1] = slope[1];
    *seen = [
        slope[0].mul_add(scaled, seen[0]),
        slope[1].mul_add(scaled, seen[1]),
    ];
}

#[inline(always)]
fn by_turn<T: Number>(
    cause: AxisCause,
    loaded: &LoadedPose<T>,
    references: &[[T; 2]; 2],
) -> [T; 2] {
    let [by1, by2] = cause.turn(loaded);
    [
        -(references[0][0] * by1) - references[1][0] * by2,
        -(references[0][1] * by1) - references[1][1] * by2,
    ]
}

/// The numbers of a linearised record (see [`column`]) but for time and noise, and three numbers that are positive
/// where the beam meets the target. The target by its number.
#[inline(always)]
pub(super) fn linearise<T: Number>(
    structure: &Structure,
    place: &Place<'_, T>,
    prepared: &Prepared<T>,
    target: T,
    row: &mut [T],
) -> [T; 3] {
    let Place {
        still,
        shared,
        pose,
        references,
    } = place;
    let zero = T::splat(0.0);
    let sighting = &prepared.sighting;
    // The loaded pose: true angles = read angles less references, turned by the causes there.
    let unloaded = [
        turned_back(sighting.axis1, references[0]),
        turned_back(sighting.axis2, references[1]),
    ];
    let mut turn = [zero; 2];
    let mut loaded = LoadedPose {
        axis1: unloaded[0],
        axis2: unloaded[1],
        up: sighting.up,
    };
    let of_axes = structure
        .shared
        .iter()
        .any(|cause| matches!(cause, Cause::Axis(_)));
    let mut turned = *sighting;
    if of_axes || !structure.own.is_empty() {
        for _ in 0..LOADING_STEPS {
            turn = [zero; 2];
            for (k, &cause) in structure.own.iter().enumerate() {
                add_turn(&mut turn, cause, still[ANGLES + k], &loaded);
            }
            for (&cause, &value) in structure.shared.iter().zip(*shared) {
                if let Cause::Axis(cause) = cause {
                    add_turn(&mut turn, cause, value, &loaded);
                }
            }
            loaded.axis1 = turned_on(unloaded[0], turn[0]);
            loaded.axis2 = turned_on(unloaded[1], turn[1]);
        }
        turned.axis1 = turned_on(sighting.axis1, turn[0]);
        turned.axis2 = turned_on(sighting.axis2, turn[1]);
    }
    turned.pose_errors = None;
    let land = landing(pose, &turned);
    let across = &prepared.across;
    // across the beam, per milliradian or in the filter's unit
    let per_milli = T::splat(1.0 / MILLI);
    let (slopes, rest) = row.split_at_mut(2 * (ANGLES + structure.own.len()));
    let (by_cause, rest) = rest.split_at_mut(2 * structure.shared.len());
    let mut seen = times(across, [-land.residual_m[0], -land.residual_m[1]]);
    let milli = T::splat(MILLI);
    for k in 0..ANGLES {
        let moved = [land.slopes[0][k] * per_milli, land.slopes[1][k] * per_milli];
        let slope = times(across, moved);
        put(
            &mut slopes[2 * k..2 * k + 2],
            &mut seen,
            slope,
            still[k] * milli,
        );
    }
    let [first, second] = REFERENCES;
    let references = [
        [slopes[2 * first], slopes[2 * first + 1]],
        [slopes[2 * second], slopes[2 * second + 1]],
    ];
    for (k, &cause) in structure.own.iter().enumerate() {
        let k = ANGLES + k;
        let slope = by_turn(cause, &loaded, &references);
        put(
            &mut slopes[2 * k..2 * k + 2],
            &mut seen,
            slope,
            still[k] * milli,
        );
    }
    // r = 2 (s·n) n - s and the spot's lambda r move with s
    let n = normal(pose, &turned).n;
    let double = T::splat(2.0) * land.cos_incidence;
    let motion = prepared.sun_motion;
    let along = T::splat(2.0) * dot(motion, n);
    let [plane_normal, right, down] = turned.plane;
    let mut beam = [zero; 3];
    let mut moved = [zero; 3];
    for k in 0..3 {
        beam[k] = double.mul_add(n[k], -turned.sun[k]);
        moved[k] = along.mul_add(n[k], -motion[k]);
    }
    let slip = dot(plane_normal, moved) / land.facing;
    for k in 0..3 {
        moved[k] = land.beam_m * (moved[k] - slip * beam[k]);
    }
    let spot = SeenSpot {
        sun_path_m_s: [dot(right, moved), dot(down, moved)],
    };
    let path = times(across, spot.sun_path_m_s);
    for (k, &cause) in structure.shared.iter().enumerate() {
        // Of the causes the formula knows those alone that turn axes: the others add to what it predicts.
        let (slope, scaled) = match cause {
            Cause::Axis(cause) => (by_turn(cause, &loaded, &references), shared[k] * milli),
            Cause::Target(cause, of) => {
                let is_it = target.is(of as f64);
                (times(across, cause.moves(&spot).map(|m| is_it * m)), zero)
            }
            Cause::Spots(cause) => (times(across, cause.moves(&spot)), zero),
        };
        put(&mut by_cause[2 * k..2 * k + 2], &mut seen, slope, scaled);
    }
    rest[column::SEEN] = seen[0];
    rest[column::SEEN + 1] = seen[1];
    rest[column::PATH] = path[0];
    rest[column::PATH + 1] = path[1];
    [land.cos_incidence, -land.facing, land.beam_m]
}

/// Linearised records of one heliostat, in time.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Rows {
    /// Numbers of all records, one after the other.
    pub numbers: Vec<f64>,
    /// Which observation each is.
    pub of: Vec<usize>,
    /// When \[days since 1970\]; of the record before where none is known.
    pub days: Vec<f64>,
}

impl Rows {
    pub fn len(&self) -> usize {
        self.of.len()
    }
    pub fn row(&self, shape: Shape, k: usize) -> &[f64] {
        &self.numbers[k * shape.row()..(k + 1) * shape.row()]
    }
    pub fn row_mut(&mut self, shape: Shape, k: usize) -> &mut [f64] {
        &mut self.numbers[k * shape.row()..(k + 1) * shape.row()]
    }
}

/// Toward the celestial pole about which the sun turns, from its latitude.
pub(super) fn pole(latitude_rad: f64) -> Enu {
    let (sine, cosine) = libm::sincos(latitude_rad);
    Enu::new(0.0, cosine, sine)
}

/// How a direction to the sun moves \[1/s\].
fn sun_motion(sun: EnuUnit, pole: Enu) -> Enu {
    sun.as_enu().cross(pole) * SUN_TURN_RAD_S
}

/// Whether all numbers of a record can be meant; where one cannot, the record tells nothing.
pub(super) fn usable(observation: &Observation) -> bool {
    let Observation {
        sun,
        axis1_rad,
        axis2_rad,
        plane,
        u_m,
        v_m,
        sigma_m,
        ..
    } = observation;
    let vectors = [
        sun.as_enu(),
        plane.centre,
        plane.normal.as_enu(),
        plane.right.as_enu(),
        plane.down.as_enu(),
    ];
    // not zero where any of them is not finite, without a branch for each
    let mut nothing = 0.0;
    for x in [*axis1_rad, *axis2_rad, *u_m, *v_m] {
        nothing += 0.0 * x;
    }
    for vector in vectors {
        nothing += 0.0 * vector.east + 0.0 * vector.north + 0.0 * vector.up;
    }
    nothing == 0.0 && sigma_m.is_none_or(|sigma_m| sigma_m > 0.0 && (sigma_m * sigma_m).is_finite())
}

/// A record of a variance above this \[mrad²\], a kiloradian, tells nothing: products of such variances would leave
/// the range of doubles.
pub(super) const BOUNDLESS: f64 = 1e12;

/// What does not depend on where the model is expanded.
pub(super) fn prepare(campaign: &Campaign<'_>, of: usize, pole: Enu) -> Prepared<f64> {
    let (mount, observation) = (&campaign.mount, &campaign.observations[of]);
    let sighting = Sighting::new(mount, observation);
    let [u, v] = sighting.spot_m;
    let slant_m =
        libm::sqrt(u * u + v * v + sighting.centre_along_normal_m * sighting.centre_along_normal_m);
    let per = MILLI / slant_m;
    Prepared {
        sun_motion: mount.components(sun_motion(observation.sun, pole)),
        across: sighting.across_beam().map(|line| line.map(|x| x * per)),
        sighting,
    }
}

/// Records in time, those without one beside the record before.
pub(super) fn in_time(campaign: &Campaign<'_>) -> (Vec<usize>, Vec<f64>) {
    let observations = campaign.observations;
    let mut last = observations
        .iter()
        .find_map(|o| o.unix_ns)
        .unwrap_or_default();
    let mut order: Vec<(i64, usize)> = observations
        .iter()
        .enumerate()
        .map(|(k, o)| {
            last = o.unix_ns.unwrap_or(last);
            (last, k)
        })
        .collect();
    order.sort_unstable();
    order
        .into_iter()
        .map(|(ns, k)| (k, ns as f64 / DAY_NS))
        .unzip()
}

impl Rows {
    /// Linearises the records of a heliostat about `at`. Those whose beam does not meet its target there, and those
    /// that are not [`usable`], tell nothing.
    pub fn of(structure: &Structure, campaign: &Campaign<'_>, at: &Expansion, pole: Enu) -> Self {
        let shape = structure.shape();
        let (of, days) = in_time(campaign);
        let mut numbers = vec![0.0; of.len() * shape.row()];
        let mut still = at.still.clone();
        still.push(campaign.mount.mirror_offset_m);
        let place = Place::new(&still, &at.shared);
        for (k, row) in numbers.chunks_exact_mut(shape.row()).enumerate() {
            let observation = &campaign.observations[of[k]];
            let prepared = prepare(campaign, of[k], pole);
            let lands = linearise(structure, &place, &prepared, observation.target as f64, row);
            let rest = shape.row() - column::REST;
            let per = prepared.across[0][0].hypot(prepared.across[0][1]);
            match observation.sigma_m {
                Some(sigma_m) => row[rest + column::STATED] = per * per * sigma_m * sigma_m,
                None => row[rest + column::ON_TARGET] = per * per,
            }
            let bounded = row[rest + column::STATED].max(row[rest + column::ON_TARGET]) < BOUNDLESS;
            let finite = row.iter().all(|x| x.is_finite());
            let tells = usable(observation) && bounded && finite && lands.iter().all(|x| *x > 0.0);
            if !tells {
                silence(shape, row);
            }
            if k > 0 {
                row[rest + column::DAYS] = days[k] - days[k - 1];
            }
        }
        Self { numbers, of, days }
    }
}

impl Rows {
    /// Writes down what was decided: outliers are not believed, jumps loosen references.
    pub fn mark(&mut self, shape: Shape, marks: &Marks, jump_mrad: f64) {
        let rest = shape.row() - column::REST;
        for &k in &marks.outliers {
            self.row_mut(shape, k)[rest + column::SILENT] = 1.0;
        }
        for &(k, axis) in &marks.jumps {
            self.row_mut(shape, k)[rest + column::JUMP + axis] = jump_mrad * jump_mrad;
        }
    }
}

/// A record that tells nothing: no unknown moves it.
pub(super) fn silence(shape: Shape, row: &mut [f64]) {
    let rest = shape.row() - column::REST;
    row[..rest].fill(0.0);
    row[rest + column::SEEN..=rest + column::ON_TARGET].fill(0.0);
    row[rest + column::SILENT] = 1.0;
}

/// The six angles of an expansion as parameters.
pub(super) fn parameters(still: &[f64], mirror_offset_m: f64) -> Parameters {
    let mut values = [mirror_offset_m; COUNT];
    values[..ANGLES].copy_from_slice(&still[..ANGLES]);
    Parameters { values }
}
