//! How a rigid facet moved: from three of its points, or from all by least squares.

use super::error::DeformError;
use super::motion::{IDENTITY, RigidMotion, Rotation, about, across, apply, compose};
use crate::vector::{Vector, add, cross, dot, is_finite, norm, scale, sub, unit};

/// One translation and two rotations that bring a facet from its place to where the load put it
/// (Yan 2022 §2.1 and figure 1).
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
pub struct ThreePointPose {
    /// All of it at once.
    pub motion: RigidMotion,
    /// How far the first point moved \[m\].
    pub translation_m: [f64; 3],
    /// Unit axis through the first point about which the third is turned into its direction.
    pub first_axis: [f64; 3],
    /// By how much \[rad\], in [0, π].
    pub first_angle_rad: f64,
    /// Unit axis from the first point to the third about which the second is turned into its plane.
    pub second_axis: [f64; 3],
    /// By how much \[rad\], in (-π, π].
    pub second_angle_rad: f64,
    /// How far the points end from where the load put them, root mean square of the three \[m\]: what
    /// their distances changed. Zero for a rigid facet.
    pub rms_m: f64,
}

/// Points whose extent across a line is below this part of that along it leave the turn about the line
/// open: the coordinates of solvers' files have six digits.
const LEAST_ACROSS: f64 = 1e-6;

/// The motion of a rigid facet from three of its points, before and after \[m\].
///
/// The facet is shifted by the first point's displacement, turned about it until the third point lies in
/// its direction, and turned about the line to that one until the second point lies in its half plane
/// (Yan 2022 §2.1). The three need not be rigid: `rms_m` says how far they are from it.
///
/// # Errors
/// [`DeformError::OnALine`] unless they span a triangle before and after; [`DeformError::NotFinite`].
///
/// ```
/// use helio_flux::deform::{RigidMotion, pose_from_three_points};
/// let before_m = [[0.0, 0.0, 0.0], [0.0, 1.0, 0.0], [1.0, 0.0, 0.0]];
/// let tipped = RigidMotion::turn([0.0; 3], [1.0, 2.0, 0.0], 0.01)?.and_shift([0.0, 0.0, 0.005]);
/// let pose = pose_from_three_points(before_m, before_m.map(|p| tipped.point_m(p)))?;
/// let n = pose.motion.direction([0.0, 0.0, 1.0]);
/// let wanted = tipped.direction([0.0, 0.0, 1.0]);
/// assert!((0..3).all(|k| (n[k] - wanted[k]).abs() < 1e-15));
/// # Ok::<(), helio_flux::deform::DeformError>(())
/// ```
pub fn pose_from_three_points(
    before_m: [[f64; 3]; 3],
    after_m: [[f64; 3]; 3],
) -> Result<ThreePointPose, DeformError> {
    check_finite("before_m", &before_m)?;
    check_finite("after_m", &after_m)?;
    let [to_second, to_third] = [sub(before_m[1], before_m[0]), sub(before_m[2], before_m[0])];
    let [second, third] = [sub(after_m[1], after_m[0]), sub(after_m[2], after_m[0])];
    for (a, b) in [(to_second, to_third), (second, third)] {
        let longest = norm(a).max(norm(b)).max(norm(sub(b, a)));
        let across = ratio(norm(cross(a, b)), longest * longest);
        if across <= LEAST_ACROSS {
            return Err(DeformError::OnALine { points: 3, across });
        }
    }
    // n1 = a × a′, φ1 = ∠(a, a′) with a = T3 - T1: any axis across for no turn or half a turn
    let turn = cross(to_third, third);
    let first_angle_rad = libm::atan2(norm(turn), dot(to_third, third));
    let first_axis = unit(turn).unwrap_or_else(|| across(to_third));
    let first = about(first_axis, first_angle_rad);
    // n2 = a′; φ2 between what is across it of the turned T2 and of T2′
    let second_axis = scale(third, 1.0 / norm(third));
    let turned = apply(&first, to_second);
    let (from, to) = (cross(second_axis, turned), cross(second_axis, second));
    let second_angle_rad = libm::atan2(dot(second_axis, cross(from, to)), dot(from, to));
    let rotation = compose(&about(second_axis, second_angle_rad), &first);
    let motion = RigidMotion::new(rotation, before_m[0], after_m[0]);
    let misfit = Misfit::of(&motion, &before_m, &after_m);
    Ok(ThreePointPose {
        motion,
        translation_m: sub(after_m[0], before_m[0]),
        first_axis,
        first_angle_rad,
        second_axis,
        second_angle_rad,
        rms_m: misfit.rms_m,
    })
}

/// The rigid motion nearest to what many points did, and how far from rigid that was.
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
pub struct FittedPose {
    /// The motion.
    pub motion: RigidMotion,
    /// Root mean square of the distances that are left \[m\].
    pub rms_m: f64,
    /// The largest of them \[m\].
    pub max_m: f64,
    /// Row of the point that it belongs to.
    pub max_row: usize,
}

/// The rigid motion that brings points nearest to where the load put them, by least squares over all,
/// each of the same weight \[m\].
///
/// Source: Horn (1987), "Closed-form solution of absolute orientation using unit quaternions", J. Opt.
/// Soc. Am. A 4, 629, §4: the rotation is the eigenvector of the largest eigenvalue of a symmetric 4 × 4
/// matrix, which is found here by Jacobi's turns. It never mirrors.
///
/// # Errors
/// [`DeformError::OnALine`] for fewer than three points or points nearly on a line;
/// [`DeformError::WrongLength`], [`DeformError::NotFinite`].
///
/// ```
/// use helio_flux::deform::fit_pose;
/// let before_m = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0], [0.0, 1.0, 0.0]];
/// // Twisted: two corners up, two corners down. The nearest rigid motion is none.
/// let z = [0.001, -0.001, 0.001, -0.001];
/// let after_m: Vec<_> = before_m.iter().zip(z).map(|(p, z)| [p[0], p[1], z]).collect();
/// let pose = fit_pose(&before_m, &after_m)?;
/// assert!(pose.motion.rotation_vector_rad().iter().all(|x| x.abs() < 1e-15));
/// assert!((pose.rms_m - 0.001).abs() < 1e-15);
/// # Ok::<(), helio_flux::deform::DeformError>(())
/// ```
pub fn fit_pose(before_m: &[[f64; 3]], after_m: &[[f64; 3]]) -> Result<FittedPose, DeformError> {
    if before_m.len() != after_m.len() {
        return Err(DeformError::WrongLength {
            what: "after_m",
            expected: before_m.len(),
            found: after_m.len(),
        });
    }
    check_finite("before_m", before_m)?;
    check_finite("after_m", after_m)?;
    if before_m.len() < 3 {
        let (points, across) = (before_m.len(), 0.0);
        return Err(DeformError::OnALine { points, across });
    }
    let (from_m, to_m) = (mean(before_m), mean(after_m));
    // M = Σ r r′ᵀ with both sets about their means
    let mut m: Rotation = [[0.0; 3]; 3];
    for (&before, &after) in before_m.iter().zip(after_m) {
        let (r, s) = (sub(before, from_m), sub(after, to_m));
        for (row, &r) in m.iter_mut().zip(&r) {
            *row = add(*row, scale(s, r));
        }
    }
    let (quaternion, gap) = largest_eigenvector(horn_matrix(&m));
    // For a rigid motion the gap is 2 (s2 + s3) / (s1 + s2 + s3) with the principal sums of squares s.
    let across = (0.5 * gap).max(0.0).sqrt();
    if across <= LEAST_ACROSS {
        let points = before_m.len();
        return Err(DeformError::OnALine { points, across });
    }
    let motion = RigidMotion::new(of_quaternion(quaternion), from_m, to_m);
    let misfit = Misfit::of(&motion, before_m, after_m);
    Ok(FittedPose {
        motion,
        rms_m: misfit.rms_m,
        max_m: misfit.max_m,
        max_row: misfit.max_row,
    })
}

struct Misfit {
    rms_m: f64,
    max_m: f64,
    max_row: usize,
}

impl Misfit {
    fn of(motion: &RigidMotion, before_m: &[Vector], after_m: &[Vector]) -> Self {
        let mut sum = 0.0;
        let (mut max_m, mut max_row) = (0.0, 0);
        for (row, (&before, &after)) in before_m.iter().zip(after_m).enumerate() {
            let left_m = norm(sub(motion.point_m(before), after));
            sum += left_m * left_m;
            if left_m > max_m {
                (max_m, max_row) = (left_m, row);
            }
        }
        Self {
            rms_m: (sum / before_m.len() as f64).sqrt(),
            max_m,
            max_row,
        }
    }
}

fn check_finite(what: &'static str, points: &[Vector]) -> Result<(), DeformError> {
    match points.iter().position(|&p| !is_finite(p)) {
        Some(row) => Err(DeformError::NotFinite {
            what,
            row,
            at_m: points[row],
        }),
        None => Ok(()),
    }
}

fn mean(points: &[Vector]) -> Vector {
    // About the first point, which keeps the digits of a facet far from the origin.
    let first = points[0];
    let sum = points
        .iter()
        .fold([0.0; 3], |sum, &p| add(sum, sub(p, first)));
    add(first, scale(sum, 1.0 / points.len() as f64))
}

type Symmetric = [[f64; 4]; 4];

/// Horn (1987) §4A: N of the sums of products M.
fn horn_matrix(m: &Rotation) -> Symmetric {
    let [[xx, xy, xz], [yx, yy, yz], [zx, zy, zz]] = *m;
    [
        [xx + yy + zz, yz - zy, zx - xz, xy - yx],
        [yz - zy, xx - yy - zz, xy + yx, zx + xz],
        [zx - xz, xy + yx, yy - xx - zz, yz + zy],
        [xy - yx, zx + xz, yz + zy, zz - xx - yy],
    ]
}

/// Sweeps of Jacobi's method; a 4 × 4 matrix needs five or six, and each sweep beyond changes nothing.
const SWEEPS: usize = 12;

/// The unit eigenvector of the largest eigenvalue, and how far that is above the next, relative to it.
fn largest_eigenvector(mut a: Symmetric) -> ([f64; 4], f64) {
    let mut vectors: Symmetric = [[0.0; 4]; 4];
    for (k, row) in vectors.iter_mut().enumerate() {
        row[k] = 1.0;
    }
    for _ in 0..SWEEPS {
        for p in 0..3 {
            for q in p + 1..4 {
                if a[p][q] == 0.0 {
                    continue;
                }
                // Golub & Van Loan, Matrix Computations, §8.5.2: t = tan of the angle that zeroes a[p][q]
                let tau = (a[q][q] - a[p][p]) / (2.0 * a[p][q]);
                let root = (1.0 + tau * tau).sqrt();
                let t = if tau >= 0.0 {
                    1.0 / (tau + root)
                } else {
                    1.0 / (tau - root)
                };
                let c = 1.0 / (1.0 + t * t).sqrt();
                let s = t * c;
                for row in &mut a {
                    let (x, y) = (row[p], row[q]);
                    (row[p], row[q]) = (c * x - s * y, s * x + c * y);
                }
                let (x, y) = (a[p], a[q]);
                for k in 0..4 {
                    a[p][k] = c * x[k] - s * y[k];
                    a[q][k] = s * x[k] + c * y[k];
                }
                for row in &mut vectors {
                    let (x, y) = (row[p], row[q]);
                    (row[p], row[q]) = (c * x - s * y, s * x + c * y);
                }
            }
        }
    }
    let largest = (0..4).fold(0, |k, j| if a[j][j] > a[k][k] { j } else { k });
    let next = (0..4)
        .filter(|&j| j != largest)
        .map(|j| a[j][j])
        .fold(f64::NEG_INFINITY, f64::max);
    let vector = vectors.map(|row| row[largest]);
    (
        vector,
        ratio(a[largest][largest] - next, a[largest][largest]),
    )
}

/// The quotient of two sizes; zero where it is no number, as for points that are one.
fn ratio(size: f64, of: f64) -> f64 {
    let ratio = size / of;
    if ratio.is_nan() { 0.0 } else { ratio }
}

/// The rotation of a unit quaternion (scalar first).
fn of_quaternion([w, x, y, z]: [f64; 4]) -> Rotation {
    let length = (w * w + x * x + y * y + z * z).sqrt();
    if length == 0.0 {
        return IDENTITY;
    }
    let [w, x, y, z] = [w / length, x / length, y / length, z / length];
    [
        [
            1.0 - 2.0 * (y * y + z * z),
            2.0 * (x * y - w * z),
            2.0 * (x * z + w * y),
        ],
        [
            2.0 * (x * y + w * z),
            1.0 - 2.0 * (x * x + z * z),
            2.0 * (y * z - w * x),
        ],
        [
            2.0 * (x * z - w * y),
            2.0 * (y * z + w * x),
            1.0 - 2.0 * (x * x + y * y),
        ],
    ]
}
