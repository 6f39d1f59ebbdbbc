//! The formula of [`model`](crate::model) in the form that costs least, and its normal equations.
//!
//! The same mathematics, told in the frame of the target: with P the plane's axes (xi, eta, nt) as rows
//! along the mount's axes, N = P n, S = P s and OT = P OT, the beam r = 2 (S·N) N - S and the spot need
//! no dot products with the plane. A parameter turns the mirror about some axis w, dn = w × n, so that
//! the derivative of a component of the spot is the triple product w·m with m = N × (what a move of N
//! does to that component): one vector m per component serves every parameter. In the frame in which
//! the fixed axis stands upright (c of [`model::normal`](crate::model::normal)) the axes of the tilt's
//! components and of gamma0 are the same for every observation: their columns are taken from the sums of
//! the three components of M = A Pᵀ m, once per evaluation. A test holds all of it to `model`.

use helio_core::lanes::{Columns, Lanes};

use super::lane::Lane;
use crate::model::Real;

/// Columns of an observation.
pub(super) const SUN: usize = 0;
pub(super) const AXIS1: usize = 3;
pub(super) const AXIS2: usize = 5;
pub(super) const SPOT: usize = 7;
/// 1/sigma; 0 for an observation that only fills its place.
pub(super) const WEIGHT: usize = 9;
pub(super) const ROW: usize = 10;

/// Rows whose derivatives are kept at once.
const CHUNK: usize = 8;

/// Observations of eight heliostats on a target of each.
#[derive(Debug, Clone, Copy)]
pub(super) struct Segment {
    /// xi, eta, nt along the mount's axes, then pivot → centre along nt.
    pub plane: Columns<10>,
    /// One past its last row.
    pub end: usize,
}

/// What is summed over the observations; the parameters in the order of `Parameter`, `P` of them.
pub(super) struct Sums<L, const P: usize> {
    /// JᵀJ, lower triangle.
    pub matrix: [[Lane<L>; P]; P],
    /// Jᵀr.
    pub gradient: [Lane<L>; P],
    pub sum_of_squares: Lane<L>,
    /// Its sign bit is set where a beam does not come from the mirror's front to the target's.
    pub misses: Lane<L>,
}

/// (1 - cos psi)/psi² and (psi - sin psi)/psi³ as functions of psi²; good to the last digit for tilts up to
/// half a turn.
#[inline(always)]
fn tilt_functions<T: Real>(square: T) -> [T; 2] {
    let mut both = [T::splat(0.0); 2];
    for (value, [first, start]) in both.iter_mut().zip([[0.5, 3.0], [1.0 / 6.0, 4.0]]) {
        // coefficients (-1)^n / (2n + 2)! and (-1)^n / (2n + 3)!
        const TERMS: usize = 15;
        let mut coefficients = [first; TERMS];
        for n in 1..TERMS {
            let k = start + 2.0 * (n as f64 - 1.0);
            coefficients[n] = -coefficients[n - 1] / (k * (k + 1.0));
        }
        *value = T::splat(coefficients[TERMS - 1]);
        for &coefficient in coefficients[..TERMS - 1].iter().rev() {
            *value = value.mul_add(square, T::splat(coefficient));
        }
    }
    both
}

/// Parameters made ready.
struct Posed<L> {
    tilt: [[Lane<L>; 3]; 3],
    /// Derivatives by tilt and first reference from those by turns about the axes of c: columns.
    turns: [[Lane<L>; 3]; 3],
    reference1: [Lane<L>; 2],
    reference2: [Lane<L>; 2],
    tau: [Lane<L>; 2],
    mu: [Lane<L>; 2],
    offset: Lane<L>,
}

#[inline(always)]
fn cos_sin<L: Lanes>(angle: Lane<L>) -> [Lane<L>; 2] {
    let (sine, cosine) = angle.sin_cos();
    [cosine, sine]
}

impl<L: Lanes> Posed<L> {
    #[inline(always)]
    fn new(x: &[Lane<L>; 7]) -> Self {
        let [a, b, gamma0, tau1, alpha0, mu, offset] = *x;
        let (zero, one) = (Lane::splat(0.0), Lane::splat(1.0));
        let square = a * a + b * b;
        let [h, m] = tilt_functions(square);
        let k = m.neg_mul_add(square, one);
        let (ha, hb) = (h * a, h * b);
        let (ma, mb) = (m * a, m * b);
        let tilt = [
            [ha.neg_mul_add(a, one), -(ha * b), -(k * a)],
            [-(ha * b), hb.neg_mul_add(b, one), -(k * b)],
            [k * a, k * b, h.neg_mul_add(square, one)],
        ];
        // A = exp of the turn by v = (b, -a, 0); its derivatives turn c about J(v) dv, with
        // J = 1 + h [v] + m [v]².
        let turns = [
            [-(ma * b), mb.neg_mul_add(b, one), hb],
            [-ma.neg_mul_add(a, one), ma * b, -ha],
            [zero, zero, -one],
        ];
        Self {
            tilt,
            turns,
            reference1: cos_sin(gamma0),
            reference2: cos_sin(alpha0),
            tau: cos_sin(tau1),
            mu: cos_sin(mu),
            offset,
        }
    }

    /// B = A Pᵀ: from the target's frame to that of c.
    #[inline(always)]
    fn upright(&self, segment: &Segment, lane: usize) -> [[Lane<L>; 3]; 3] {
        let mut b = self.tilt;
        for axis in 0..3 {
            let p = three(&segment.plane, lane, 3 * axis);
            for k in 0..3 {
                b[k][axis] = dot(&self.tilt[k], &p);
            }
        }
        b
    }
}

#[inline(always)]
fn column<L: Lanes, const N: usize>(columns: &Columns<N>, lane: usize, which: usize) -> Lane<L> {
    Lane(L::load(columns, lane, which))
}

/// Three columns next to each other.
#[inline(always)]
fn three<L: Lanes, const N: usize>(
    columns: &Columns<N>,
    lane: usize,
    first: usize,
) -> [Lane<L>; 3] {
    [
        column(columns, lane, first),
        column(columns, lane, first + 1),
        column(columns, lane, first + 2),
    ]
}

// Functions and not closures: a closure may not be told to be inlined, and one that is not is
// compiled without the instructions of its lanes.

#[inline(always)]
fn dot<L: Lanes>(a: &[Lane<L>; 3], b: &[Lane<L>; 3]) -> Lane<L> {
    a[2].mul_add(b[2], a[1].mul_add(b[1], a[0] * b[0]))
}

/// c B
#[inline(always)]
fn row_times<L: Lanes>(c: &[Lane<L>; 3], b: &[[Lane<L>; 3]; 3]) -> [Lane<L>; 3] {
    let [b0, b1, b2] = b;
    [
        dot(c, &[b0[0], b1[0], b2[0]]),
        dot(c, &[b0[1], b1[1], b2[1]]),
        dot(c, &[b0[2], b1[2], b2[2]]),
    ]
}

/// Cosine and sine of an encoder angle less its reference.
#[inline(always)]
fn turned_back<L: Lanes>(
    [cos0, sin0]: [Lane<L>; 2],
    row: &Columns<ROW>,
    lane: usize,
    which: usize,
) -> [Lane<L>; 2] {
    let cosine: Lane<L> = column(row, lane, which);
    let sine: Lane<L> = column(row, lane, which + 1);
    [
        sine.mul_add(sin0, cosine * cos0),
        cosine.neg_mul_add(sin0, sine * cos0),
    ]
}

/// A spot and what leads to it.
#[derive(Clone, Copy)]
struct Spot<L> {
    turned1: [Lane<L>; 2],
    turned2: [Lane<L>; 2],
    normal: [Lane<L>; 3],
    /// 2 S·N
    double: Lane<L>,
    /// -1/(nt·r)
    per_facing: Lane<L>,
    /// Along xi and eta.
    beam: [Lane<L>; 2],
    beam_m: Lane<L>,
    /// Predicted less observed.
    residual: [Lane<L>; 2],
    misses: Lane<L>,
}

impl<L: Lanes> Spot<L> {
    #[inline(always)]
    fn nothing() -> Self {
        let zero = Lane::splat(0.0);
        Self {
            turned1: [zero; 2],
            turned2: [zero; 2],
            normal: [zero; 3],
            double: zero,
            per_facing: zero,
            beam: [zero; 2],
            beam_m: zero,
            residual: [zero; 2],
            misses: zero,
        }
    }
}

/// Weighted derivatives and residual of one component of a spot.
type Slopes<L> = ([Lane<L>; 7], Lane<L>);

/// Room for [`CHUNK`] rows, made once for all evaluations of a fit.
pub(super) struct Chunk<L> {
    spots: [Spot<L>; CHUNK],
    /// Of either component.
    held: [[Slopes<L>; 2]; CHUNK],
}

impl<L: Lanes> Chunk<L> {
    #[inline(always)]
    pub fn new() -> Self {
        let zero = Lane::splat(0.0);
        Self {
            spots: [Spot::nothing(); CHUNK],
            held: [[([zero; 7], zero); 2]; CHUNK],
        }
    }
}

impl<L: Lanes> Posed<L> {
    #[inline(always)]
    fn spot(
        &self,
        from_plane: &[[Lane<L>; 3]; 3],
        centre: Lane<L>,
        row: &Columns<ROW>,
        lane: usize,
    ) -> Spot<L> {
        let [cos_gamma, sin_gamma] = turned_back(self.reference1, row, lane, AXIS1);
        let [cos_alpha, sin_alpha] = turned_back(self.reference2, row, lane, AXIS2);
        let ([cos_tau, sin_tau], [cos_mu, sin_mu]) = (self.tau, self.mu);
        let d0 = cos_mu * cos_alpha;
        let d1 = (sin_tau * cos_mu).neg_mul_add(sin_alpha, cos_tau * sin_mu);
        let d2 = (cos_tau * cos_mu).mul_add(sin_alpha, sin_tau * sin_mu);
        let c0 = sin_gamma.neg_mul_add(d1, cos_gamma * d0);
        let c1 = sin_gamma.mul_add(d0, cos_gamma * d1);
        let normal = row_times(&[c0, c1, d2], from_plane);
        let sun = three(row, lane, SUN);
        let [n0, n1, n2] = normal;
        let cos_incidence = dot(&sun, &normal);
        let double = cos_incidence + cos_incidence;
        let beam = [double.mul_add(n0, -sun[0]), double.mul_add(n1, -sun[1])];
        let toward = double.neg_mul_add(n2, sun[2]);
        let per_facing = Lane::splat(1.0) / toward;
        let beam_m = self.offset.mul_add(n2, -centre) * per_facing;
        let residual = [
            beam_m.mul_add(beam[0], self.offset.mul_add(n0, -column(row, lane, SPOT))),
            beam_m.mul_add(
                beam[1],
                self.offset.mul_add(n1, -column(row, lane, SPOT + 1)),
            ),
        ];
        Spot {
            turned1: [cos_gamma, sin_gamma],
            turned2: [cos_alpha, sin_alpha],
            normal,
            double,
            per_facing,
            beam,
            beam_m,
            residual,
            misses: cos_incidence
                .either_negative(toward)
                .either_negative(beam_m),
        }
    }

    /// Weighted residuals and their derivatives: by turns about the three axes of c, then by tau1, alpha0,
    /// mu and the offset.
    #[inline(always)]
    fn slopes(
        &self,
        from_plane: &[[Lane<L>; 3]; 3],
        spot: &Spot<L>,
        sun: &[Lane<L>; 3],
        weight: Lane<L>,
    ) -> [Slopes<L>; 2] {
        let [n0, n1, n2] = spot.normal;
        let [s0, s1, s2] = *sun;
        // What a move of the beam's end along nt does on the plane.
        let shear = [
            spot.beam[0] * spot.per_facing,
            spot.beam[1] * spot.per_facing,
        ];
        let on_plane = [shear[0].mul_add(n2, n0), shear[1].mul_add(n2, n1)];
        let stretch = spot.beam_m.mul_add(spot.double, self.offset) * weight;
        let twice = (spot.beam_m + spot.beam_m) * weight;
        let pull = [twice * on_plane[0], twice * on_plane[1]];
        let [t0, t1, t2] = [stretch * n0, stretch * n1, stretch * n2];
        let cross = [
            n2.neg_mul_add(s1, n1 * s2),
            n0.neg_mul_add(s2, n2 * s0),
            n1.neg_mul_add(s0, n0 * s1),
        ];
        let m = [
            [
                pull[0].mul_add(cross[0], shear[0] * t1),
                pull[0].mul_add(cross[1], shear[0].neg_mul_add(t0, t2)),
                pull[0].mul_add(cross[2], -t1),
            ],
            [
                pull[1].mul_add(cross[0], shear[1].mul_add(t1, -t2)),
                shear[1].neg_mul_add(t0, pull[1] * cross[1]),
                pull[1].mul_add(cross[2], t0),
            ],
        ];
        [
            self.about_axes(
                from_plane,
                spot,
                &m[0],
                on_plane[0],
                spot.residual[0],
                weight,
            ),
            self.about_axes(
                from_plane,
                spot,
                &m[1],
                on_plane[1],
                spot.residual[1],
                weight,
            ),
        ]
    }

    /// From m of one component to its derivatives.
    #[inline(always)]
    fn about_axes(
        &self,
        from_plane: &[[Lane<L>; 3]; 3],
        spot: &Spot<L>,
        m: &[Lane<L>; 3],
        on_plane: Lane<L>,
        residual: Lane<L>,
        weight: Lane<L>,
    ) -> Slopes<L> {
        let [cos_gamma, sin_gamma] = spot.turned1;
        let [cos_alpha, sin_alpha] = spot.turned2;
        let [cos_tau, sin_tau] = self.tau;
        let (x, y, z) = (
            dot(&from_plane[0], m),
            dot(&from_plane[1], m),
            dot(&from_plane[2], m),
        );
        let level = sin_gamma.mul_add(y, cos_gamma * x);
        let across = sin_gamma.neg_mul_add(x, cos_gamma * y);
        let moving = sin_tau.mul_add(z, cos_tau * across);
        let square = sin_tau.neg_mul_add(across, cos_tau * z);
        let mirror = sin_alpha.neg_mul_add(level, cos_alpha * square);
        (
            [x, y, z, level, moving, mirror, on_plane * weight],
            residual * weight,
        )
    }
}

/// Normal equations of the lanes from `lane` at the parameters `x`; of the seven the first `P` count.
#[inline(always)]
pub(super) fn sums<L: Lanes, const P: usize>(
    rows: &[Columns<ROW>],
    segments: &[Segment],
    lane: usize,
    x: &[Lane<L>; 7],
    chunk: &mut Chunk<L>,
) -> Sums<L, P> {
    let posed = Posed::new(x);
    let zero = Lane::splat(0.0);
    let mut matrix = [[zero; P]; P];
    let mut gradient = [zero; P];
    let mut sum_of_squares = zero;
    let mut misses = zero;
    let Chunk { spots, held } = chunk;
    let mut first = 0;
    for segment in segments {
        let from_plane = posed.upright(segment, lane);
        let centre = column(&segment.plane, lane, 9);
        // First the derivatives of some rows, a long chain each, then their products, many and short: in one
        // loop the sums would not find room in the registers beside them.
        for some in rows[first..segment.end].chunks(CHUNK) {
            for (row, spot) in some.iter().zip(&mut *spots) {
                *spot = posed.spot(&from_plane, centre, row, lane);
                misses = misses.either_negative(spot.misses);
            }
            for ((row, spot), both) in some.iter().zip(&*spots).zip(&mut *held) {
                let sun = three(row, lane, SUN);
                *both = posed.slopes(&from_plane, spot, &sun, column(row, lane, WEIGHT));
            }
            for both in &held[..some.len()] {
                for (slopes, residual) in both {
                    for i in 0..P {
                        for j in 0..=i {
                            matrix[i][j] = slopes[i].mul_add(slopes[j], matrix[i][j]);
                        }
                        gradient[i] = slopes[i].mul_add(*residual, gradient[i]);
                    }
                    sum_of_squares = residual.mul_add(*residual, sum_of_squares);
                }
            }
        }
        first = segment.end;
    }
    turn_first_three(&mut matrix, &mut gradient, &posed.turns);
    Sums {
        matrix,
        gradient,
        sum_of_squares,
        misses,
    }
}

/// From derivatives by turns about the axes of c to those by tilt and first reference: Tᵀ H T.
#[inline(always)]
fn turn_first_three<L: Lanes, const P: usize>(
    matrix: &mut [[Lane<L>; P]; P],
    gradient: &mut [Lane<L>; P],
    turns: &[[Lane<L>; 3]; 3],
) {
    // H T, then Tᵀ of it
    let mut half = [[Lane::splat(0.0); 3]; 3];
    for i in 0..3 {
        let h = [
            matrix[i][0],
            if i >= 1 { matrix[i][1] } else { matrix[1][i] },
            if i >= 2 { matrix[i][2] } else { matrix[2][i] },
        ];
        for j in 0..3 {
            half[i][j] = dot(&turns[j], &h);
        }
    }
    for i in 0..3 {
        for j in 0..=i {
            matrix[i][j] = dot(&turns[i], &[half[0][j], half[1][j], half[2][j]]);
        }
    }
    for row in &mut matrix[3..] {
        let h = [row[0], row[1], row[2]];
        for j in 0..3 {
            row[j] = dot(&turns[j], &h);
        }
    }
    let g = [gradient[0], gradient[1], gradient[2]];
    for j in 0..3 {
        gradient[j] = dot(&turns[j], &g);
    }
}

/// Where the beams end at the parameters.
pub(super) struct Ending<L> {
    /// Weighted.
    pub sum_of_squares: Lane<L>,
    /// Not weighted \[m²\].
    pub square_m2: Lane<L>,
    /// Its sign bit is set where a beam misses.
    pub misses: Lane<L>,
}

/// Like [`sums`], without derivatives.
#[inline(always)]
pub(super) fn ending<L: Lanes>(
    rows: &[Columns<ROW>],
    segments: &[Segment],
    lane: usize,
    x: &[Lane<L>; 7],
) -> Ending<L> {
    let posed = Posed::new(x);
    let zero = Lane::splat(0.0);
    let mut ending = Ending {
        sum_of_squares: zero,
        square_m2: zero,
        misses: zero,
    };
    let mut first = 0;
    for segment in segments {
        let from_plane = posed.upright(segment, lane);
        let centre = column(&segment.plane, lane, 9);
        for row in &rows[first..segment.end] {
            let spot = posed.spot(&from_plane, centre, row, lane);
            let weight: Lane<L> = column(row, lane, WEIGHT);
            let [u, v] = spot.residual;
            let square = v.mul_add(v, u * u);
            let there = zero.lt(weight);
            ending.square_m2 = ending.square_m2 + Lane::select(there, square, zero);
            ending.sum_of_squares = (weight * weight).mul_add(square, ending.sum_of_squares);
            ending.misses = ending.misses.either_negative(spot.misses);
        }
        first = segment.end;
    }
    ending
}

/// Circular sums from which both references follow, see [`start`](super::start): the measured normals
/// (as long as twice the cosine of incidence, and weighted) against the encoder angles.
#[inline(always)]
pub(super) fn circular_sums<L: Lanes>(
    rows: &[Columns<ROW>],
    segments: &[Segment],
    lane: usize,
) -> [Lane<L>; 6] {
    let mut sums = [Lane::splat(0.0); 6];
    let mut first = 0;
    for segment in segments {
        let plane = [
            three(&segment.plane, lane, 0),
            three(&segment.plane, lane, 3),
            three(&segment.plane, lane, 6),
        ];
        let centre: Lane<L> = column(&segment.plane, lane, 9);
        for row in &rows[first..segment.end] {
            let (u, v): (Lane<L>, Lane<L>) = (column(row, lane, SPOT), column(row, lane, SPOT + 1));
            let square = centre.mul_add(centre, v.mul_add(v, u * u));
            let weight: Lane<L> = column(row, lane, WEIGHT);
            let per_length = weight / square.sqrt();
            let sun: [Lane<L>; 3] = three(row, lane, SUN);
            let both = [
                u.mul_add(per_length, weight * sun[0]),
                v.mul_add(per_length, weight * sun[1]),
                centre.mul_add(per_length, weight * sun[2]),
            ];
            let [x, y, z] = row_times(&both, &plane);
            let cos1: Lane<L> = column(row, lane, AXIS1);
            let sin1: Lane<L> = column(row, lane, AXIS1 + 1);
            let cos2: Lane<L> = column(row, lane, AXIS2);
            let sin2: Lane<L> = column(row, lane, AXIS2 + 1);
            let p = sin1.mul_add(y, cos1 * x);
            let q = cos1.neg_mul_add(y, sin1 * x);
            let products = [
                (cos2, p),
                (cos2, q),
                (sin2, p),
                (sin2, q),
                (sin2, z),
                (cos2, z),
            ];
            for (sum, (a, b)) in sums.iter_mut().zip(products) {
                *sum = a.mul_add(b, *sum);
            }
        }
        first = segment.end;
    }
    sums
}

/// True where no beam misses.
#[inline(always)]
pub(super) fn lands<L: Lanes>(misses: Lane<L>) -> L::Mask {
    // its magnitude does not matter: one with its sign
    Lane::splat(0.0).lt(Lane(L::splat(1.0).copysign(misses.0)))
}

#[cfg(test)]
mod tests {
    use helio_core::{Enu, EnuUnit, Heliostat, TargetPlane, TrackingMode};

    use super::super::Campaign;
    use super::super::group::Group;
    use super::*;
    use crate::model::{Pose, landing};
    use crate::observation::{Mount, Observation, Sighting};

    /// Reference: `model::landing`, itself held to automatic differentiation.
    #[test]
    fn the_normal_equations_are_those_of_the_model() {
        let modes = [
            TrackingMode::AzimuthElevation,
            TrackingMode::SpinningElevation,
            TrackingMode::PitchRoll {
                axis_azimuth_rad: 1.3,
            },
            TrackingMode::Polar { latitude_rad: 0.7 },
        ];
        let mut seed = 20_u64;
        let mut random = || {
            seed = seed
                .wrapping_mul(6_364_136_223_846_793_005)
                .wrapping_add(1_442_695_040_888_963_407);
            (seed >> 11) as f64 / (1_u64 << 53) as f64 * 2.0 - 1.0
        };
        let mut worst: f64 = 0.0;
        let mut group = Group::default();
        for case in 0..2000 {
            let pivot = Enu::new(60.0 * random(), 100.0 + 50.0 * random(), 3.0 * random());
            let centre = Enu::new(random(), random(), 40.0 + 5.0 * random());
            let mut mount = Mount::of(modes[case % 4], &Heliostat::new(pivot, centre));
            mount.mirror_offset_m = 0.3 * random();
            let observations: Vec<Observation> = (0..4)
                .map(|_| {
                    let facing = EnuUnit::from_azimuth_elevation(0.3 * random(), 0.2 * random());
                    let plane = TargetPlane::level(centre, facing);
                    let sun = EnuUnit::from_azimuth_elevation(3.0 + random(), 0.8 + 0.5 * random());
                    let (axis1, axis2) = (3.0 * random(), 1.5 * random());
                    let mut o = Observation::new(sun, axis1, axis2, plane, random(), random());
                    o.sigma_m = Some(1.0 + 0.5 * random());
                    o
                })
                .collect();
            let size = if case % 5 == 0 { 0.0 } else { 0.3 };
            let x: [f64; 7] = core::array::from_fn(|k| match k {
                6 => mount.mirror_offset_m,
                _ => size * random(),
            });
            let mut square = 0.0;
            let mut matrix = [[0.0; 7]; 7];
            let mut gradient = [0.0; 7];
            let mut misses = false;
            let mut grazing = false;
            for observation in &observations {
                let sighting = Sighting::new(&mount, observation);
                let at = landing(&Pose::new(x), &sighting);
                misses |= !at.hits();
                grazing |= at.facing.abs() < 0.05;
                for (slopes, residual) in at.slopes.iter().zip(at.residual_m) {
                    let residual = residual * sighting.weight;
                    square += residual * residual;
                    for i in 0..7 {
                        let slope = slopes[i] * sighting.weight;
                        gradient[i] += slope * residual;
                        for j in 0..=i {
                            matrix[i][j] += slope * slopes[j] * sighting.weight;
                        }
                    }
                }
            }
            if grazing {
                continue;
            }
            let campaign = Campaign {
                mount,
                observations: &observations,
            };
            assert_eq!(group.fill(&[&campaign; 8]), [true; 8]);
            group.prepare::<f64>(0);
            let got = sums::<f64, 7>(
                &group.rows,
                &group.segments,
                0,
                &x.map(Lane),
                &mut Chunk::new(),
            );
            assert_eq!(!lands(got.misses), misses);
            worst = worst.max((got.sum_of_squares.0 - square).abs() / square);
            for i in 0..7 {
                let scale = (matrix[i][i] * square).sqrt();
                worst = worst.max((got.gradient[i].0 - gradient[i]).abs() / scale);
                for j in 0..=i {
                    let scale = (matrix[i][i] * matrix[j][j]).sqrt();
                    worst = worst.max((got.matrix[i][j].0 - matrix[i][j]).abs() / scale);
                }
            }
            let end = ending::<f64>(&group.rows, &group.segments, 0, &x.map(Lane));
            worst = worst.max((end.sum_of_squares.0 - square).abs() / square);
        }
        assert!(worst < 1e-12, "worst relative difference {worst:e}");
    }
}
