//! The mount as turning steel: rotations about physical axes in the world, and the inverse by
//! crossing two cones.

use core::f64::consts::{FRAC_PI_2, PI};

use helio_core::{MountErrors, PoseErrors, TrackingMode};

use crate::V3;
use crate::dd::{self, Dd, Dd3};

/// A mount at rest: where things point at zero angles.
#[derive(Debug, Clone, Copy)]
pub struct Rest {
    /// The axis that does not move.
    pub fixed: Dd3,
    /// Where the mirror faces.
    pub facing: Dd3,
    /// The axis that the fixed one carries; growing first angles turn `facing` toward it.
    pub moving: Dd3,
}

const EAST: V3 = V3(1.0, 0.0, 0.0);
const NORTH: V3 = V3(0.0, 1.0, 0.0);
const UP: V3 = V3(0.0, 0.0, 1.0);

/// How each mode's perfect mount stands, in words of its own drawing.
///
/// # Panics
/// For a mode that this does not know.
#[must_use]
pub fn rest(mode: TrackingMode, to_aim: Dd3) -> Rest {
    let [east, north, up] = [EAST, NORTH, UP].map(Dd3::new);
    match mode {
        // A post; mirror upright, facing north; azimuth turns it clockwise seen from above.
        TrackingMode::AzimuthElevation => Rest {
            fixed: up,
            facing: north,
            moving: east,
        },
        // The fixed axis looks at the aim; at rest the mirror faces square to it in the upright plane,
        // upward; growing angles turn it to the left of one who looks at the aim (gamma = -rho, and
        // rho is positive for a sun to the right, eq. 5).
        TrackingMode::SpinningElevation => {
            let t = to_aim.unit();
            let level = Dd3([t.0[0], t.0[1], Dd::new(0.0)]);
            let ahead = if level.norm().value() > 0.0 {
                level.unit()
            } else {
                north
            };
            let left = up.cross(ahead);
            Rest {
                fixed: t,
                facing: t.cross(left),
                moving: left,
            }
        }
        // The fixed axis is level; mirror flat, face up; growing angles tip it toward the left of
        // one who looks along the fixed axis (axis east: toward north, gamma = -t1).
        TrackingMode::PitchRoll { axis_azimuth_rad } => {
            let along = north.rotated(up.reversed(), axis_azimuth_rad);
            Rest {
                fixed: along,
                facing: up,
                moving: up.cross(along),
            }
        }
        // The fixed axis points to the elevated pole; mirror in the meridian, facing the equator;
        // north of the equator growing angles turn it west with the sun. South of it the same
        // mount stands turned half round.
        TrackingMode::Polar { latitude_rad } => {
            let (toward_pole, side) = if latitude_rad >= 0.0 {
                (north, east.reversed())
            } else {
                (north.reversed(), east)
            };
            let (sin, cos) = dd::sin_cos(Dd::new(latitude_rad.abs()));
            let fixed = toward_pole.scaled(cos).plus(up.scaled(sin));
            let facing = up.scaled(cos).minus(toward_pole.scaled(sin));
            Rest {
                fixed,
                facing,
                moving: side,
            }
        }
        other => panic!("no drawing of {other:?}"),
    }
}

/// The mount at rest after its pedestal has been set up leaning.
#[must_use]
pub fn leaning(mode: TrackingMode, to_aim: Dd3, errors: &MountErrors) -> Rest {
    let Rest {
        fixed,
        facing,
        moving,
    } = rest(mode, to_aim);
    // toward where it leans: from the zero of the first angle by psi_a
    let (sin, cos) = dd::sin_cos(Dd::new(errors.pedestal_tilt_azimuth_rad));
    let lean = facing.scaled(cos).plus(moving.scaled(sin));
    let hinge = fixed.cross(lean);
    let tip = |v: Dd3| v.rotated(hinge, errors.pedestal_tilt_rad);
    Rest {
        fixed: tip(fixed),
        facing: tip(facing),
        moving: tip(moving),
    }
}

/// The normal for encoder angles of a mount without pose errors.
#[must_use]
pub fn forward(
    mode: TrackingMode,
    to_aim: Dd3,
    errors: &MountErrors,
    axis1_rad: f64,
    axis2_rad: f64,
) -> Dd3 {
    let gamma = Dd::new(axis1_rad) - Dd::new(errors.azimuth_reference_rad);
    let alpha = Dd::new(axis2_rad) - Dd::new(errors.elevation_reference_rad);
    turned(mode, to_aim, errors, [gamma, alpha])
}

/// What a mount's pose errors turn its axes by, at true angles \[rad\]. The sag is minus kappa times what the
/// height of the normal of a perfect mount gains with the angle: heights turn with an axis as cosines do, so
/// that the gain is the height a quarter turn on, less the part that does not turn. The eccentricity goes
/// with how far the normal of a perfect mount leans to the fixed axis.
#[must_use]
pub fn turns(
    mode: TrackingMode,
    to_aim: Dd3,
    errors: PoseErrors,
    [gamma, alpha]: [Dd; 2],
) -> [Dd; 2] {
    let perfect = MountErrors::default();
    let lean =
        turned(mode, to_aim, &perfect, [gamma, alpha]).dot(leaning(mode, to_aim, &perfect).fixed);
    let height = |gamma: Dd, alpha: Dd| {
        let n = turned(mode, to_aim, &perfect, [gamma, alpha]);
        n.dot(Dd3::new(UP))
    };
    let quarter = Dd::new(FRAC_PI_2);
    let gain1 = (height(gamma + quarter, alpha) - height(gamma - quarter, alpha)) * Dd::new(0.5);
    let gain2 = height(gamma, alpha + quarter);
    [
        -(gain1 * Dd::new(errors.axis1_sag_rad)),
        lean * Dd::new(errors.axis2_eccentricity_rad) - gain2 * Dd::new(errors.axis2_sag_rad),
    ]
}

/// The normal for encoder angles of a mount with pose errors: the true pose is found by turning the one without
/// by those of the last again and again until it stays.
#[must_use]
pub fn forward_with(
    mode: TrackingMode,
    to_aim: Dd3,
    errors: &MountErrors,
    pose_errors: PoseErrors,
    axis1_rad: f64,
    axis2_rad: f64,
) -> Dd3 {
    let unloaded = [
        Dd::new(axis1_rad) - Dd::new(errors.azimuth_reference_rad),
        Dd::new(axis2_rad) - Dd::new(errors.elevation_reference_rad),
    ];
    if pose_errors.is_none() {
        return turned(mode, to_aim, errors, unloaded);
    }
    let mut pose = unloaded;
    // each time nearer by a factor of eight at least
    for _ in 0..25 {
        let by = turns(mode, to_aim, pose_errors, pose);
        pose = [unloaded[0] + by[0], unloaded[1] + by[1]];
    }
    turned(mode, to_aim, errors, pose)
}

/// The normal for true angles of both axes: one rotation after the other.
#[must_use]
pub fn turned(
    mode: TrackingMode,
    to_aim: Dd3,
    errors: &MountErrors,
    [gamma, alpha]: [Dd; 2],
) -> Dd3 {
    let Rest {
        fixed,
        facing,
        moving,
    } = leaning(mode, to_aim, errors);
    // Turn about the fixed axis, facing toward moving: clockwise seen from the axis' tip.
    let facing = facing.rotated(fixed.reversed(), gamma);
    let moving = moving.rotated(fixed.reversed(), gamma);
    // The moving axis stands tau1 off the square, lifted toward the fixed axis, and carries with it
    // the direction in which the mirror rises.
    let hinge = moving.cross(fixed);
    let moving = moving.rotated(hinge, errors.axis_nonorthogonality_rad);
    let rising = fixed.rotated(hinge, errors.axis_nonorthogonality_rad);
    // Turn about the moving axis, facing toward rising.
    let facing = facing.rotated(facing.cross(rising), alpha);
    // The mirror is not parallel to the moving axis: its normal leans to it by mu.
    facing.rotated(facing.cross(moving), errors.mirror_tilt_rad)
}

/// How near a normal is to a blind cone, as cos(half-angle) - cos(distance from the cone's axis):
/// negative inside. The least over both cones; infinite if the mount has no cone.
#[must_use]
pub fn cone_margin(mode: TrackingMode, to_aim: Dd3, errors: &MountErrors, n: Dd3) -> f64 {
    let fixed = leaning(mode, to_aim, errors).fixed;
    let (tau1, mu) = (errors.axis_nonorthogonality_rad, errors.mirror_tilt_rad);
    let polar = n.cross(fixed).norm().value().atan2(n.dot(fixed).value());
    let one = |half: f64, from_axis: f64| {
        if tau1 == 0.0 && mu == 0.0 {
            return f64::INFINITY;
        }
        2.0 * (0.5 * (from_axis + half)).sin() * (0.5 * (from_axis - half)).sin()
    };
    one((tau1 - mu).abs(), polar).min(one((tau1 + mu).abs(), PI - polar))
}

/// Both pairs of encoder angles that give a normal, the direct one first, not wrapped.
///
/// The moving axis m stands at 90° - tau1 from the fixed axis f and at 90° - mu from the normal n:
/// it lies where two cones cross. `None` where they do not.
#[must_use]
pub fn inverse(
    mode: TrackingMode,
    to_aim: Dd3,
    errors: &MountErrors,
    n: Dd3,
) -> Option<[[f64; 2]; 2]> {
    let Rest {
        fixed,
        facing,
        moving,
    } = leaning(mode, to_aim, errors);
    let [f, facing, moving, n] = [fixed, facing, moving, n].map(Dd3::value);
    let (sin_tau1, sin_mu) = (
        errors.axis_nonorthogonality_rad.sin(),
        errors.mirror_tilt_rad.sin(),
    );
    let across = f.cross(n);
    let across_sq = across.dot(across);
    let c = f.dot(n);
    // m = x f + y n + z (f x n) with m·f = sin(tau1), m·n = sin(mu), |m| = 1
    let x = (sin_tau1 - c * sin_mu) / across_sq;
    let y = (sin_mu - c * sin_tau1) / across_sq;
    let z_sq = (1.0 - x * sin_tau1 - y * sin_mu) / across_sq;
    if z_sq.is_nan() || z_sq < 0.0 {
        return None;
    }
    let z = z_sq.sqrt();
    let one = |z: f64| {
        let m = f * x + n * y + across * z;
        let gamma = (-m.dot(facing)).atan2(m.dot(moving));
        // where the mirror would face at alpha = 0, and where it would rise to: (level, m, rising)
        // is left-handed like (facing, moving, fixed)
        let level = facing.rotated(-f, gamma);
        let rising = m.cross(level);
        let alpha = n.dot(rising).atan2(n.dot(level));
        [
            gamma + errors.azimuth_reference_rad,
            alpha + errors.elevation_reference_rad,
        ]
    };
    let [a, b] = [one(z), one(-z)];
    let direct = |s: [f64; 2]| (s[1] - errors.elevation_reference_rad).abs() <= FRAC_PI_2;
    Some(if direct(a) || !direct(b) {
        [a, b]
    } else {
        [b, a]
    })
}

/// [`inverse`] for a mount with pose errors.
#[must_use]
pub fn inverse_with(
    mode: TrackingMode,
    to_aim: Dd3,
    errors: &MountErrors,
    pose_errors: PoseErrors,
    n: Dd3,
) -> Option<[[f64; 2]; 2]> {
    let both = inverse(mode, to_aim, errors, n)?;
    if pose_errors.is_none() {
        return Some(both);
    }
    Some(both.map(|[axis1, axis2]| {
        let pose = [
            Dd::new(axis1 - errors.azimuth_reference_rad),
            Dd::new(axis2 - errors.elevation_reference_rad),
        ];
        let [turn1, turn2] = turns(mode, to_aim, pose_errors, pose).map(Dd::value);
        [axis1 - turn1, axis2 - turn2]
    }))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn inverse_and_forward_are_each_others() {
        let mut rng = crate::Rng::new(3);
        for row in 0..50_000 {
            let mode = crate::cases::mode(row % 5, 0.7);
            let errors = crate::cases::large_errors(&mut rng);
            let (t, n) = (Dd3::new(rng.direction()), Dd3::new(rng.direction()));
            let margin = cone_margin(mode, t, &errors, n);
            let Some(both) = inverse(mode, t, &errors, n) else {
                assert!(margin < 1e-13);
                continue;
            };
            assert!(margin > -1e-13);
            for [axis1, axis2] in both {
                let back = forward(mode, t, &errors, axis1, axis2);
                let off = back.minus(n).value().norm();
                assert!(
                    off < 1e-13 + 1e-15 / margin.max(1e-9),
                    "{mode:?} {margin} {off:e}"
                );
            }
            let rise = both.map(|s| (s[1] - errors.elevation_reference_rad).cos());
            assert!(rise[0] >= -1e-9 && rise[1] <= 1e-9, "{rise:?}");
        }
    }

    // The drawing of a perfect mount, angle by angle.
    #[test]
    fn perfect_mounts_move_as_drawn() {
        let none = MountErrors::default();
        let close = |a: Dd3, b: V3| assert!(a.distance_to(b) < 2e-16, "{a:?} {b:?}");
        let t = V3(0.3, -2.0, 1.0);
        let at = |mode, a: f64, b: f64| forward(mode, Dd3::new(t), &none, a, b);
        let az_el = TrackingMode::AzimuthElevation;
        close(at(az_el, FRAC_PI_2, 0.0), EAST);
        close(at(az_el, 0.4, FRAC_PI_2), UP);
        let pitch_roll = TrackingMode::PitchRoll {
            axis_azimuth_rad: FRAC_PI_2,
        };
        // README of the Jülich records: n = (sin t2, -cos t2 sin t1, cos t2 cos t1), gamma = -t1
        let (t1, t2) = (0.6_f64, -0.3_f64);
        close(
            at(pitch_roll, -t1, t2),
            V3(t2.sin(), -t2.cos() * t1.sin(), t2.cos() * t1.cos()),
        );
        let polar = TrackingMode::Polar { latitude_rad: 0.7 };
        // hour angle 90° and declination 0 is due west on the horizon
        close(at(polar, FRAC_PI_2, 0.0), -EAST);
        close(
            at(polar, 0.0, FRAC_PI_2),
            V3(0.0, 0.7_f64.cos(), 0.7_f64.sin()),
        );
        let spinning = TrackingMode::SpinningElevation;
        close(at(spinning, 1.0, FRAC_PI_2), t.unit());
        // Aim in the south: right is west. A sun to the right has rho positive, gamma negative.
        let south = Dd3::new(-NORTH);
        close(forward(spinning, south, &none, -FRAC_PI_2, 0.0), -EAST);
        close(forward(spinning, south, &none, 0.0, 0.0), UP);
    }
}
