//! Planar element substitution: slope errors of surfaces whose normals are known.

use helio_flux::deform::{
    DeformError, FaceStatus, PoseFit, RigidMotion, SlopeErrors, reconstruct_poses,
    substitute_elements,
};

use crate::scene::{Of, grid, moved, sub, upper};

const SQUARE: [f64; 2] = [-1.0, 1.0];

/// Turned as a whole by a known angle, every element's slope error is that angle, by every method.
#[test]
fn a_rigid_facet_turned_by_a_known_angle() {
    for angle in [1e-9, 1e-3, 0.3_f64] {
        // Axis, and what the normal (up) then leans by toward x and toward y.
        let cases = [
            ([1.0, 0.0, 0.0], [0.0, -angle]),
            ([0.0, 1.0, 0.0], [angle, 0.0]),
            ([0.0, 0.0, 1.0], [0.0, 0.0]),
            (
                [3.0, -4.0, 0.0],
                [(-0.8 * angle.tan()).atan(), (-0.6 * angle.tan()).atan()],
            ),
        ];
        for (axis, [along_x, along_y]) in cases {
            let motion = RigidMotion::turn([0.5, 0.2, 7.0], axis, angle)
                .unwrap()
                .and_shift([0.1, -0.3, 0.02]);
            let flat = grid(SQUARE, SQUARE, [3, 2], Of::Triangles, |_, _| 0.0);
            let mirror = upper(&moved(flat, |p| sub(motion.point_m(p), p)));
            let total = if axis[2] == 1.0 { 0.0 } else { angle };
            let three = reconstruct_poses(&mirror, PoseFit::ThreePoints).unwrap();
            let fitted = reconstruct_poses(&mirror, PoseFit::LeastSquares).unwrap();
            for pose in three.1.iter().chain(&fitted.1) {
                // Displacements are differences of positions of 10 m: so much is rounding.
                assert!(pose.max_m < 2e-15, "{pose:?}");
            }
            for deformed in [substitute_elements(&mirror).unwrap(), three.0, fitted.0] {
                let slopes = SlopeErrors::new(&deformed, [1.0, 0.0, 0.0]).unwrap();
                assert_eq!(slopes.total_rad().len(), 12);
                for row in 0..12 {
                    assert!((slopes.total_rad()[row] - total).abs() < 5e-15);
                    assert!((slopes.first_rad()[row] - along_x).abs() < 5e-15);
                    assert!((slopes.second_rad()[row] - along_y).abs() < 5e-15);
                }
                assert!((slopes.rms_rad() - total).abs() < 5e-15);
            }
        }
    }
}

/// Largest error of the elements' normals against `slope` (of z along x and y) at their centroids.
fn worst_normal(
    cells: usize,
    of: Of,
    z: fn(f64, f64) -> f64,
    slope: fn(f64, f64) -> [f64; 2],
) -> f64 {
    let flat = grid(SQUARE, SQUARE, [cells, cells], of, |_, _| 0.0);
    let mirror = upper(&moved(flat, |[x, y, _]| [0.0, 0.0, z(x, y)]));
    let deformed = substitute_elements(&mirror).unwrap();
    let slopes = SlopeErrors::new(&deformed, [1.0, 0.0, 0.0]).unwrap();
    let mut worst = 0.0_f64;
    for (row, ideal) in deformed.ideal().iter().enumerate() {
        let [x, y, _] = ideal.centroid_m();
        // The normal of z(x, y) is along (-∂z/∂x, -∂z/∂y, 1).
        let [by_x, by_y] = slope(x, y);
        worst = worst
            .max((slopes.first_rad()[row] + by_x.atan()).abs())
            .max((slopes.second_rad()[row] + by_y.atan()).abs())
            .max((slopes.total_rad()[row] - by_x.hypot(by_y).atan()).abs());
    }
    worst
}

/// Of quadrilaterals the diagonals give the slope at the middle, exactly on a surface of second order
/// and to O(h²) on others; a triangle has the slope at the middle of its hypotenuse: O(h).
#[test]
fn normals_of_a_paraboloid_and_of_a_sphere() {
    // Focal length 3 m: z = (x² + y²) / 4f
    let paraboloid = |cells, of| {
        worst_normal(
            cells,
            of,
            |x, y| (x * x + y * y) / 12.0,
            |x, y| [x / 6.0, y / 6.0],
        )
    };
    assert!(paraboloid(5, Of::Quadrilaterals) < 1e-15);
    // Radius 4 m.
    let sphere = |cells, of| {
        worst_normal(
            cells,
            of,
            |x, y| 4.0 - (16.0 - x * x - y * y).sqrt(),
            |x, y| {
                let down = (16.0 - x * x - y * y).sqrt();
                [x / down, y / down]
            },
        )
    };
    let errors: Vec<f64> = [10, 20, 40, 80]
        .map(|cells| sphere(cells, Of::Quadrilaterals))
        .to_vec();
    for pair in errors.windows(2) {
        let order = (pair[0] / pair[1]).log2();
        assert!((order - 2.0).abs() < 0.2, "{order} of {errors:?}");
    }
    for shape in [sphere, paraboloid] {
        let order = (shape(20, Of::Triangles) / shape(40, Of::Triangles)).log2();
        assert!((order - 1.0).abs() < 0.1, "{order}");
    }
}

#[test]
fn faces_without_displacements_keep_their_place() {
    let mut mesh = grid(
        [0.0, 3.0],
        [0.0, 1.0],
        [3, 1],
        Of::Quadrilaterals,
        |_, _| 0.0,
    );
    let unmoved = upper(&mesh);
    assert_eq!(
        substitute_elements(&unmoved).unwrap_err(),
        DeformError::NoDisplacements
    );
    // The nodes of the second cell's far edge do not move, and one of them is not known to;
    // the third cell is squeezed to nothing.
    let known = mesh.position_m().iter().map(|&[x, y, _]| match x {
        2.0 if y == 1.0 => [f64::NAN; 3],
        _ => [0.0; 3],
    });
    let known = known.collect();
    mesh.set_displacements_m(known).unwrap();
    let deformed = substitute_elements(&upper(&mesh)).unwrap();
    use FaceStatus::{Collapsed, NoDisplacement, Ok};
    assert_eq!(deformed.status(), [Ok, NoDisplacement, NoDisplacement]);
    assert_eq!(deformed.usable(), 1);
    let slopes = SlopeErrors::new(&deformed, [0.0, 1.0, 0.0]).unwrap();
    assert!(slopes.total_rad()[1].is_nan());
    assert_eq!(slopes.rms_rad(), 0.0);
    // The rigid facet moves by the nodes that are known to.
    let (rigid, poses) = reconstruct_poses(&upper(&mesh), PoseFit::LeastSquares).unwrap();
    assert_eq!((rigid.usable(), poses[0].nodes), (3, 7));
    let squeezed = moved(mesh, |[x, ..]| [-x, 0.0, 0.0]);
    let deformed = substitute_elements(&upper(&squeezed)).unwrap();
    assert_eq!(deformed.status(), [Collapsed; 3]);
    assert!(
        SlopeErrors::new(&deformed, [0.0, 1.0, 0.0])
            .unwrap()
            .max()
            .is_none()
    );
}

#[test]
fn axes_that_say_nothing_are_refused() {
    let mesh = grid(SQUARE, SQUARE, [1, 1], Of::Quadrilaterals, |_, _| 0.0);
    let deformed = substitute_elements(&upper(&moved(mesh, |_| [0.0; 3]))).unwrap();
    let message = |axis| SlopeErrors::new(&deformed, axis).unwrap_err().to_string();
    assert_eq!(
        message([0.0, 0.0, 2.0]),
        "axis must be a finite vector across the normals of the mirror, got (0, 0, 2), which is along \
         that of element 1"
    );
    assert!(message([0.0; 3]).ends_with("(0, 0, 0), which has no direction"));
    assert!(message([f64::NAN, 0.0, 0.0]).ends_with("which has no direction"));
}
