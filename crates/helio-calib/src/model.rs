//! Where a spot lands, and how that depends on each parameter: the one formula of this crate.

use core::ops::{Add, Div, Mul, Neg, Sub};

use crate::observation::Sighting;
use crate::parameters::{COUNT, Parameter, Parameters};

/// What the formula computes with: a number, some lanes of numbers, or a number with derivatives.
pub trait Real:
    Copy
    + Add<Output = Self>
    + Sub<Output = Self>
    + Mul<Output = Self>
    + Div<Output = Self>
    + Neg<Output = Self>
{
    /// The same number everywhere.
    fn splat(value: f64) -> Self;
    /// self · factor + addend, rounded once or twice.
    #[must_use]
    fn mul_add(self, factor: Self, addend: Self) -> Self;
    /// Sine and cosine, in this order.
    fn sin_cos(self) -> (Self, Self);
}

impl Real for f64 {
    #[inline(always)]
    fn splat(value: f64) -> Self {
        value
    }
    #[inline(always)]
    fn mul_add(self, factor: Self, addend: Self) -> Self {
        // A fused one would be emulated wherever the build does not ask for the instruction.
        self * factor + addend
    }
    #[inline(always)]
    fn sin_cos(self) -> (Self, Self) {
        libm::sincos(self)
    }
}

#[inline(always)]
pub(crate) fn dot<T: Real>(a: [T; 3], b: [T; 3]) -> T {
    a[2].mul_add(b[2], a[1].mul_add(b[1], a[0] * b[0]))
}

/// A row vector times a matrix: c A.
#[inline(always)]
fn row_times<T: Real>(c: [T; 3], matrix: &[[T; 3]; 3]) -> [T; 3] {
    // loops, here and below: a closure in `from_fn` is not compiled for the lanes' instruction set
    let mut out = c;
    for k in 0..3 {
        let first = c[1].mul_add(matrix[1][k], c[0] * matrix[0][k]);
        out[k] = c[2].mul_add(matrix[2][k], first);
    }
    out
}

/// Terms of the power series of [`tilt_functions`].
const TERMS: usize = 15;

/// Coefficients first, first/(start (start + 1)) …, of falling sign.
const fn series(first: f64, start: f64) -> [f64; TERMS] {
    let mut coefficients = [first; TERMS];
    let mut n = 1;
    while n < TERMS {
        let k = start + 2.0 * (n as f64 - 1.0);
        coefficients[n] = -coefficients[n - 1] / (k * (k + 1.0));
        n += 1;
    }
    coefficients
}

/// sin(psi)/psi and (1 - cos(psi))/psi² as functions of psi², each with its derivative. The power series
/// serve any tilt up to half a turn.
#[inline(always)]
fn tilt_functions<T: Real>(square: T) -> [[T; 2]; 2] {
    // coefficients (-1)^n / (2n + 1)! and (-1)^n / (2n + 2)!
    const SERIES: [[f64; TERMS]; 2] = [series(1.0, 2.0), series(0.5, 3.0)];
    let sum = |coefficients: &[f64; TERMS]| {
        let mut value = T::splat(coefficients[TERMS - 1]);
        let mut slope = T::splat(0.0);
        for &coefficient in coefficients[..TERMS - 1].iter().rev() {
            slope = slope.mul_add(square, value);
            value = value.mul_add(square, T::splat(coefficient));
        }
        [value, slope]
    };
    [sum(&SERIES[0]), sum(&SERIES[1])]
}

/// Parameters made ready for many sightings.
#[derive(Debug, Clone, Copy)]
pub struct Pose<T> {
    /// A, and its derivatives by the two components of the tilt.
    tilt: [[[T; 3]; 3]; 3],
    azimuth_reference: [T; 2],
    elevation_reference: [T; 2],
    nonorthogonality: [T; 2],
    mirror_tilt: [T; 2],
    mirror_offset_m: T,
    /// In place of the mount's.
    pose_errors: Option<[T; 3]>,
}

#[inline(always)]
fn cos_sin<T: Real>(angle: T) -> [T; 2] {
    let (sine, cosine) = angle.sin_cos();
    [cosine, sine]
}

impl Pose<f64> {
    /// Of one heliostat.
    #[must_use]
    pub fn of(parameters: &Parameters) -> Self {
        Self::new(parameters.values)
    }
}

impl<T: Real> Pose<T> {
    /// From values in the order of [`Parameter::ALL`](crate::Parameter::ALL).
    #[inline(always)]
    #[must_use]
    pub fn new(values: [T; COUNT]) -> Self {
        let [a, b, gamma0, tau1, alpha0, mu, mirror_offset_m] = values;
        let (zero, one, two) = (T::splat(0.0), T::splat(1.0), T::splat(2.0));
        // A = [[1 - h a², -h a b, -k a], [-h a b, 1 - h b², -k b], [k a, k b, cos(psi_t)]],
        // cos(psi_t) = 1 - h psi_t²
        let square = a * a + b * b;
        let [[k, dk], [h, dh]] = tilt_functions(square);
        let matrix = [
            [one - h * a * a, -(h * a * b), -(k * a)],
            [-(h * a * b), one - h * b * b, -(k * b)],
            [k * a, k * b, one - h * square],
        ];
        // by a: psi_t² grows with 2 a
        let by = |x: T, da: T, db: T| {
            let (kx, hx) = (dk * two * x, dh * two * x);
            let aa = -(hx * a * a) - two * h * a * da;
            let ab = -(hx * a * b) - h * (da * b + a * db);
            let bb = -(hx * b * b) - two * h * b * db;
            let ka = kx * a + k * da;
            let kb = kx * b + k * db;
            let cc = -(hx * square) - two * h * x;
            [[aa, ab, -ka], [ab, bb, -kb], [ka, kb, cc]]
        };
        Self {
            tilt: [matrix, by(a, one, zero), by(b, zero, one)],
            azimuth_reference: cos_sin(gamma0),
            elevation_reference: cos_sin(alpha0),
            nonorthogonality: cos_sin(tau1),
            mirror_tilt: cos_sin(mu),
            mirror_offset_m,
            pose_errors: None,
        }
    }

    /// With these pose errors \[rad\], in the order of [`helio_core::PoseErrors`], in place of what is known of
    /// the mount, as a fit of them needs it.
    #[inline(always)]
    #[must_use]
    pub fn with_pose_errors(self, pose_errors: [T; 3]) -> Self {
        Self {
            pose_errors: Some(pose_errors),
            ..self
        }
    }
}

/// cos and sin of a difference of angles.
#[inline(always)]
pub(crate) fn turned_back<T: Real>([cosine, sine]: [T; 2], [cos0, sin0]: [T; 2]) -> [T; 2] {
    [
        sine.mul_add(sin0, cosine * cos0),
        sine.mul_add(cos0, -(cosine * sin0)),
    ]
}

/// Sag over kappa of either axis in a loaded pose, [`helio_core::PoseErrors`]: gamma and alpha as cosine and sine,
/// `up` along the mount's axes.
#[inline(always)]
pub(crate) fn torque<T: Real>(
    up: [T; 3],
    [cos_gamma, sin_gamma]: [T; 2],
    [cos_alpha, sin_alpha]: [T; 2],
) -> [T; 2] {
    let across = sin_gamma.mul_add(up[0], -(cos_gamma * up[1]));
    let level = sin_gamma.mul_add(up[1], cos_gamma * up[0]);
    [
        cos_alpha * across,
        sin_alpha.mul_add(level, -(cos_alpha * up[2])),
    ]
}

/// The identity less the derivatives of what both axes are turned by, by gamma and alpha in a loaded pose: what
/// turns a small turn of the true angles into one of the encoders'.
#[inline(always)]
fn stiffness<T: Real>(
    [kappa1, kappa2, e]: [T; 3],
    up: [T; 3],
    [cos_gamma, sin_gamma]: [T; 2],
    [cos_alpha, sin_alpha]: [T; 2],
) -> [[T; 2]; 2] {
    let one = T::splat(1.0);
    let across = sin_gamma.mul_add(up[0], -(cos_gamma * up[1]));
    let level = sin_gamma.mul_add(up[1], cos_gamma * up[0]);
    let height = sin_alpha.mul_add(up[2], cos_alpha * level);
    [
        [
            one - kappa1 * cos_alpha * level,
            kappa1 * sin_alpha * across,
        ],
        [
            kappa2 * sin_alpha * across,
            one - (kappa2 * height + e * cos_alpha),
        ],
    ]
}

/// The solution of two equations, by Cramer's rule: the matrix is near the identity.
#[inline(always)]
fn solved<T: Real>([[m11, m12], [m21, m22]]: [[T; 2]; 2], [r1, r2]: [T; 2]) -> [T; 2] {
    let per = T::splat(1.0) / (m11 * m22 - m12 * m21);
    [(m22 * r1 - m12 * r2) * per, (m11 * r2 - m21 * r1) * per]
}

/// A pair turned on by an angle of no more than 0.11 rad, to the last digit.
#[inline(always)]
pub(crate) fn turned_on<T: Real>([cosine, sine]: [T; 2], angle: T) -> [T; 2] {
    let z = angle * angle;
    let c = T::splat;
    let s = z.mul_add(c(1.0 / 362_880.0), c(-1.0 / 5040.0));
    let s = s.mul_add(z, c(1.0 / 120.0)).mul_add(z, c(-1.0 / 6.0));
    let s = angle * (s * z) + angle;
    // 1 - cos(angle)
    let v = z.mul_add(c(-1.0 / 40320.0), c(1.0 / 720.0));
    let v = v.mul_add(z, c(-1.0 / 24.0)).mul_add(z, c(0.5)) * z;
    [
        cosine - (cosine * v + sine * s),
        sine + (cosine * s - sine * v),
    ]
}

/// Newton steps from the unloaded pose: each squares the error, and one more brings derivatives as far.
const STEPS: usize = 4;

/// The loaded pose that gives the unloaded one, as cosines and sines of gamma and alpha.
#[inline(always)]
fn settled<T: Real>(errors: [T; 3], up: [T; 3], gamma: [T; 2], alpha: [T; 2]) -> [[T; 2]; 2] {
    let mut turn = [T::splat(0.0); 2];
    let (mut g, mut a) = (gamma, alpha);
    for _ in 0..STEPS {
        let [torque1, torque2] = torque(up, g, a);
        let left = [
            errors[0] * torque1 - turn[0],
            errors[1] * torque2 + errors[2] * a[1] - turn[1],
        ];
        let [step1, step2] = solved(stiffness(errors, up, g, a), left);
        turn = [turn[0] + step1, turn[1] + step2];
        g = turned_on(gamma, turn[0]);
        a = turned_on(alpha, turn[1]);
    }
    [g, a]
}

/// A normal and its derivatives.
#[derive(Debug, Clone, Copy)]
pub struct Normal<T> {
    /// The mirror's normal along the mount's axes.
    pub n: [T; 3],
    /// dn by the first six parameters.
    pub slopes: [[T; 3]; 6],
    /// What each pose error turns its axis by (the first, the second, the second), per radian of it and with
    /// the pose kept, within ±1.
    pub turns: [T; 3],
}

/// Guo 2015 eq. (29) and its derivatives: n = c A, c = d turned by gamma,
/// d = (cos(mu) cos(alpha), sin(mu), cos(mu) sin(alpha)) turned by tau1.
///
/// Where the mount has pose errors, gamma and alpha are the true angles, F(gamma, alpha) = (encoder - reference),
/// with F the true angles less what the errors turn them by; derivatives by the references go through that of F
/// (implicit function theorem). Pose errors know nothing of the other parameters.
#[inline(always)]
#[must_use]
pub fn normal<T: Real>(pose: &Pose<T>, sighting: &Sighting<T>) -> Normal<T> {
    let mut gamma = turned_back(sighting.axis1, pose.azimuth_reference);
    let mut alpha = turned_back(sighting.axis2, pose.elevation_reference);
    let errors = pose.pose_errors.or(sighting.pose_errors);
    if let Some(errors) = errors {
        [gamma, alpha] = settled(errors, sighting.up, gamma, alpha);
    }
    let ([cos_gamma, sin_gamma], [cos_alpha, sin_alpha]) = (gamma, alpha);
    let [cos_tau, sin_tau] = pose.nonorthogonality;
    let [cos_mu, sin_mu] = pose.mirror_tilt;
    let by_tau = |e: [T; 3]| {
        [
            e[0],
            cos_tau.mul_add(e[1], -(sin_tau * e[2])),
            sin_tau.mul_add(e[1], cos_tau * e[2]),
        ]
    };
    let by_gamma = |d: [T; 3]| {
        [
            cos_gamma.mul_add(d[0], -(sin_gamma * d[1])),
            sin_gamma.mul_add(d[0], cos_gamma * d[1]),
            d[2],
        ]
    };
    let zero = T::splat(0.0);
    let (forward, upward) = (cos_mu * cos_alpha, cos_mu * sin_alpha);
    let d = by_tau([forward, sin_mu, upward]);
    let c = by_gamma(d);
    let [matrix, by_a, by_b] = &pose.tilt;
    // both encoder angles count from their references: the signs are turned
    let by_alpha0 = by_gamma(by_tau([upward, zero, -forward]));
    let by_mu = by_gamma(by_tau([
        -(sin_mu * cos_alpha),
        cos_mu,
        -(sin_mu * sin_alpha),
    ]));
    let by_tau1 = by_gamma([zero, -d[2], d[1]]);
    let mut by_gamma0 = row_times([c[1], -c[0], zero], matrix);
    let mut by_alpha0 = row_times(by_alpha0, matrix);
    if let Some(errors) = errors {
        let [[m11, m12], [m21, m22]] = stiffness(errors, sighting.up, gamma, alpha);
        let per = T::splat(1.0) / (m11 * m22 - m12 * m21);
        for (first, second) in by_gamma0.iter_mut().zip(&mut by_alpha0) {
            let kept = (*first, *second);
            *first = (m22 * kept.0 - m21 * kept.1) * per;
            *second = (m11 * kept.1 - m12 * kept.0) * per;
        }
    }
    let [torque1, torque2] = torque(sighting.up, gamma, alpha);
    Normal {
        n: row_times(c, matrix),
        slopes: [
            row_times(c, by_a),
            row_times(c, by_b),
            by_gamma0,
            row_times(by_tau1, matrix),
            by_alpha0,
            row_times(by_mu, matrix),
        ],
        turns: [torque1, torque2, sin_alpha],
    }
}

/// A predicted spot against the observed one.
#[derive(Debug, Clone, Copy)]
pub struct Landing<T> {
    /// Predicted less observed, right and down \[m\]. Not weighted.
    pub residual_m: [T; 2],
    /// Its derivatives by the seven parameters.
    pub slopes: [[T; COUNT]; 2],
    /// Its derivatives by the pose errors, in the order of [`helio_core::PoseErrors`], also where there are none:
    /// \[component\]\[error\].
    pub pose_slopes: [[T; 3]; 2],
    /// s·n: positive where the sun is before the mirror.
    pub cos_incidence: T,
    /// nt·r: negative where the beam comes from the target's front.
    pub facing: T,
    /// Way of the beam \[m\]: positive where the target is before the mirror.
    pub beam_m: T,
}

/// Guo 2015 §4.2 and its derivatives:
/// r = -s + 2 (s·n) n; lambda = (nt·t0 - Hz nt·n)/(nt·r); OT = Hz n + lambda r;
/// d = Hz dn + 2 lambda ((s·dn) n + (s·n) dn); dOT = d - r (nt·d)/(nt·r).
#[inline(always)]
#[must_use]
pub fn landing<T: Real>(pose: &Pose<T>, sighting: &Sighting<T>) -> Landing<T> {
    let Normal { n, slopes, turns } = normal(pose, sighting);
    let [plane_normal, right, down] = sighting.plane;
    let offset = pose.mirror_offset_m;
    let two = T::splat(2.0);
    let cos_incidence = dot(sighting.sun, n);
    let double = two * cos_incidence;
    let mut r = n;
    for k in 0..3 {
        r[k] = double.mul_add(n[k], -sighting.sun[k]);
    }
    let facing = dot(plane_normal, r);
    let along = dot(plane_normal, n);
    let per_facing = T::splat(1.0) / facing;
    let beam_m = (sighting.centre_along_normal_m - offset * along) * per_facing;
    let mut spot = n;
    for k in 0..3 {
        spot[k] = offset.mul_add(n[k], beam_m * r[k]);
    }
    // What a move of the beam's end does on the plane: along xi and eta, sheared by the beam's slant.
    let slant = [dot(right, r) * per_facing, dot(down, r) * per_facing];
    let mut on_plane = [right, down];
    for (of, slant) in on_plane.iter_mut().zip(slant) {
        for k in 0..3 {
            of[k] = of[k] - slant * plane_normal[k];
        }
    }
    // d = (Hz + 2 lambda s·n) dn + 2 lambda (s·dn) n: both products taken once for all parameters
    let stretch = beam_m.mul_add(double, offset);
    let mut by_parameter = [[two; COUNT]; 2];
    for (by, on_plane) in by_parameter.iter_mut().zip(on_plane) {
        let along = dot(on_plane, n);
        let pull = two * beam_m * along;
        let mut turn = on_plane;
        for k in 0..3 {
            turn[k] = stretch.mul_add(on_plane[k], pull * sighting.sun[k]);
        }
        for (by, slope) in by.iter_mut().zip(slopes) {
            *by = dot(turn, slope);
        }
        by[Parameter::MirrorOffset as usize] = along;
    }
    let slopes = by_parameter;
    // further turned is less reference
    let by_pose_errors = |slopes: &[T; COUNT]| {
        let by_alpha0 = slopes[Parameter::ElevationReference as usize];
        [
            -(turns[0] * slopes[Parameter::AzimuthReference as usize]),
            -(turns[1] * by_alpha0),
            -(turns[2] * by_alpha0),
        ]
    };
    Landing {
        residual_m: [
            dot(right, spot) - sighting.spot_m[0],
            dot(down, spot) - sighting.spot_m[1],
        ],
        pose_slopes: [by_pose_errors(&slopes[0]), by_pose_errors(&slopes[1])],
        slopes,
        cos_incidence,
        facing,
        beam_m,
    }
}

impl Landing<f64> {
    /// True if the beam comes from the mirror's front and meets the target's.
    #[must_use]
    pub fn hits(&self) -> bool {
        self.cos_incidence > 0.0
            && self.facing < 0.0
            && self.beam_m > 0.0
            && self.residual_m.iter().all(|r| r.is_finite())
    }
}
