//! Mirror pose reconstruction against motions that are known.

use helio_flux::deform::{DeformError, RigidMotion, fit_pose, pose_from_three_points};
use proptest::prelude::*;

use crate::scene::{length, sub};

fn point(most: f64) -> impl Strategy<Value = [f64; 3]> {
    let along = move || -most..most;
    (along(), along(), along()).prop_map(|(x, y, z)| [x, y, z])
}

fn motion() -> impl Strategy<Value = RigidMotion> {
    (point(5.0), point(1.0), -3.1..3.1_f64, point(2.0)).prop_filter_map(
        "an axis has a direction",
        |(through, axis, angle, shift)| {
            let turn = RigidMotion::turn(through, axis, angle).ok()?;
            (length(axis) > 0.01).then(|| turn.and_shift(shift))
        },
    )
}

/// Largest difference between where two motions put points of a mirror of some metres.
fn apart(a: &RigidMotion, b: &RigidMotion) -> f64 {
    let corners = [[0.0; 3], [5.0, 0.0, 0.0], [0.0, 5.0, 0.0], [0.0, 0.0, 5.0]];
    corners
        .map(|p| length(sub(a.point_m(p), b.point_m(p))))
        .into_iter()
        .fold(0.0, f64::max)
}

/// Twice the area of a triangle over its longest side squared.
fn slenderness([a, b, c]: [[f64; 3]; 3]) -> f64 {
    let (u, v) = (sub(b, a), sub(c, a));
    let cross = [
        u[1] * v[2] - u[2] * v[1],
        u[2] * v[0] - u[0] * v[2],
        u[0] * v[1] - u[1] * v[0],
    ];
    let longest = length(u).max(length(v)).max(length(sub(c, b)));
    length(cross) / (longest * longest)
}

proptest! {
    /// Three points that moved rigidly give that motion back, through the steps of the paper too.
    #[test]
    fn three_points_give_the_motion(motion in motion(), before in [point(3.0), point(3.0), point(3.0)]) {
        prop_assume!(slenderness(before) > 0.01 && length(sub(before[0], before[1])) > 0.1);
        let after = before.map(|p| motion.point_m(p));
        let pose = pose_from_three_points(before, after).unwrap();
        prop_assert!(apart(&pose.motion, &motion) < 1e-11);
        prop_assert!(pose.rms_m < 1e-13);
        // One translation, then a turn about each axis through the shifted first point.
        let shifted = RigidMotion::turn([0.0; 3], [1.0, 0.0, 0.0], 0.0).unwrap().and_shift(pose.translation_m);
        let first = RigidMotion::turn(after[0], pose.first_axis, pose.first_angle_rad).unwrap();
        let second = RigidMotion::turn(after[0], pose.second_axis, pose.second_angle_rad).unwrap();
        let third = first.point_m(shifted.point_m(before[2]));
        prop_assert!(length(sub(third, after[2])) < 1e-12); // already in place after the first turn
        for (p, q) in before.iter().zip(after) {
            let end = second.point_m(first.point_m(shifted.point_m(*p)));
            prop_assert!(length(sub(end, q)) < 1e-12);
        }
    }

    /// Least squares over points that moved rigidly gives that motion back.
    #[test]
    fn all_points_give_the_motion(motion in motion(), before in prop::collection::vec(point(3.0), 4..30)) {
        let after: Vec<_> = before.iter().map(|&p| motion.point_m(p)).collect();
        match fit_pose(&before, &after) {
            Ok(pose) => {
                prop_assert!(pose.max_m < 1e-12, "{}", pose.max_m);
                prop_assert!(pose.rms_m <= pose.max_m);
            }
            Err(error) => {
                let on_a_line = matches!(error, DeformError::OnALine { .. });
                prop_assert!(on_a_line, "{}", error);
            }
        }
    }

    /// No turn or shift nearby fits displaced points better: the least squares are the least.
    #[test]
    fn no_motion_nearby_fits_better(
        motion in motion(),
        both in prop::collection::vec((point(3.0), point(0.1)), 6..20),
        axis in point(1.0),
        shift in point(1.0),
    ) {
        prop_assume!(length(axis) > 0.1);
        let before: Vec<_> = both.iter().map(|b| b.0).collect();
        let noisy = |(p, by): &([f64; 3], [f64; 3])| {
            let at = motion.point_m(*p);
            [at[0] + by[0], at[1] + by[1], at[2] + by[2]]
        };
        let after: Vec<_> = both.iter().map(noisy).collect();
        let Ok(pose) = fit_pose(&before, &after) else { return Ok(()) };
        let squares = |nudge: &RigidMotion| -> f64 {
            before.iter().zip(&after).map(|(&p, &q)| {
                let left = length(sub(nudge.point_m(pose.motion.point_m(p)), q));
                left * left
            }).sum()
        };
        let none = RigidMotion::turn([0.0; 3], axis, 0.0).unwrap();
        let least = squares(&none);
        prop_assert!((least - before.len() as f64 * pose.rms_m * pose.rms_m).abs() <= 1e-9 * least);
        for size in [1e-2, -1e-2] {
            let turned = RigidMotion::turn(after[0], axis, size).unwrap();
            let shifted = none.and_shift(shift.map(|x| size * x));
            prop_assert!(squares(&turned) >= least);
            prop_assert!(squares(&shifted) >= least);
        }
        // A rotation, never a mirror image.
        let [a, b, c] = pose.motion.rotation();
        let determinant = a[0] * (b[1] * c[2] - b[2] * c[1]) - a[1] * (b[0] * c[2] - b[2] * c[0])
            + a[2] * (b[0] * c[1] - b[1] * c[0]);
        prop_assert!((determinant - 1.0).abs() < 1e-13);
    }
}

/// Half a turn, where the axis across two opposite directions is anybody's choice.
#[test]
fn half_a_turn_comes_back() {
    let before = [[0.0; 3], [0.0, 1.0, 0.0], [1.0, 0.0, 0.0]];
    for axis in [
        [0.0, 0.0, 1.0],
        [0.0, 1.0, 0.0],
        [1.0, 0.0, 0.0],
        [1.0, 1.0, 0.0],
    ] {
        let turn = RigidMotion::turn([0.0; 3], axis, std::f64::consts::PI).unwrap();
        let after = before.map(|p| turn.point_m(p));
        let three = pose_from_three_points(before, after).unwrap();
        assert!(apart(&three.motion, &turn) < 1e-14, "{axis:?}");
        let all = fit_pose(&before, &after).unwrap();
        assert!(apart(&all.motion, &turn) < 1e-14, "{axis:?}");
    }
}

/// A mirror image of a facet that is not flat has no rotation: the fit says so by its residual.
#[test]
fn a_mirror_image_is_no_rigid_motion() {
    let before = [[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
    let after = before.map(|[x, y, z]| [x, y, -z]);
    assert!(fit_pose(&before, &after).unwrap().rms_m > 0.1);
}

#[test]
fn points_that_leave_a_turn_open_are_refused() {
    let line = [[0.0; 3], [1.0, 1.0, 0.0], [3.0, 3.0, 1e-9]];
    let triangle = [[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];
    for (before, after) in [
        (line, triangle),
        (triangle, line),
        ([[2.0; 3]; 3], triangle),
    ] {
        let error = pose_from_three_points(before, after).unwrap_err();
        assert!(matches!(error, DeformError::OnALine { .. }), "{error}");
        let error = fit_pose(&before, &before.map(|p| p)).err();
        assert_eq!(before != triangle, error.is_some());
    }
    for error in [
        fit_pose(&triangle[..2], &triangle[..2]),
        fit_pose(&[], &[]),
        fit_pose(&[[1.0; 3]; 5], &[[1.0; 3]; 5]),
    ] {
        assert!(matches!(error, Err(DeformError::OnALine { .. })));
    }
    assert_eq!(
        fit_pose(&triangle, &triangle[..2]).unwrap_err().to_string(),
        "after_m: expected 3, one per point before the load, got 2"
    );
    let mut bad = triangle;
    bad[1][2] = f64::INFINITY;
    assert_eq!(
        fit_pose(&triangle, &bad).unwrap_err().to_string(),
        "after_m 1 (counted from 0) must be finite, got (1, 0, inf)"
    );
    assert_eq!(
        pose_from_three_points(line, line).unwrap_err().to_string(),
        "a pose needs three points that are not on a line, got 3 whose extent across their longest \
         direction is 8e-11 of that along it"
    );
}
