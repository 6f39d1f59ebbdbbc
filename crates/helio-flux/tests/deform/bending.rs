//! Facets that bend: both methods agree where they are stiff and part where they are not (Yan 2022 §5),
//! by the closed form of a plate held at its middle.

use helio_flux::deform::{PoseFit, SlopeErrors, reconstruct_poses, substitute_elements};

use crate::scene::{Of, grid, moved, upper};

/// Half the length of the facet \[m\].
const HALF_M: f64 = 0.08;
/// Its weight per length of a strip 1 m wide \[N/m²\]: glass of 4 mm.
const LOAD: f64 = 2500.0 * 9.81 * 0.004;
/// What the beam below turns it by \[rad\].
const TURN_RAD: f64 = 0.02;

/// Deflection downward of the plate at `x` from the middle: two cantilevers of length l under q,
/// w = q x² (6 l² - 4 l x + x²) / 24 EI (Euler-Bernoulli).
fn deflection_m(x: f64, stiffness: f64) -> f64 {
    let (x, l) = (x.abs(), HALF_M);
    LOAD * x * x * (6.0 * l * l - 4.0 * l * x + x * x) / (24.0 * stiffness)
}

struct Found {
    elements_rms_rad: f64,
    pose_rms_rad: f64,
    /// Root mean square over the facet of the difference of both slope errors along the bend.
    apart_rad: f64,
    residual_m: f64,
}

fn methods(stiffness: f64, cells: usize) -> Found {
    let flat = grid(
        [-HALF_M, HALF_M],
        [0.0, 0.05],
        [cells, 1],
        Of::Quadrilaterals,
        |_, _| 0.0,
    );
    let mirror = upper(&moved(flat, |[x, _, _]| {
        let turned = [x * TURN_RAD.cos() - x, 0.0, -x * TURN_RAD.sin()];
        let down = deflection_m(x, stiffness);
        [
            turned[0] - down * TURN_RAD.sin(),
            0.0,
            turned[2] - down * TURN_RAD.cos(),
        ]
    }));
    let (rigid, poses) = reconstruct_poses(&mirror, PoseFit::LeastSquares).unwrap();
    let pose = SlopeErrors::new(&rigid, [1.0, 0.0, 0.0]).unwrap();
    let elements = substitute_elements(&mirror).unwrap();
    let elements = SlopeErrors::new(&elements, [1.0, 0.0, 0.0]).unwrap();
    let both = elements.first_rad().iter().zip(pose.first_rad());
    let squares: f64 = both.map(|(a, b)| (a - b) * (a - b)).sum();
    Found {
        elements_rms_rad: elements.rms_rad(),
        pose_rms_rad: pose.rms_rad(),
        apart_rad: (squares / cells as f64).sqrt(),
        residual_m: poses[0].rms_m,
    }
}

/// θ = q x (3 l² - 3 l x + x²) / 6 EI, whose mean square over 0..l is (q l³ / 6 EI)² · 9/14.
fn bending_rms_rad(stiffness: f64) -> f64 {
    LOAD * HALF_M.powi(3) / (6.0 * stiffness) * (9.0_f64 / 14.0).sqrt()
}

#[test]
fn methods_agree_where_facets_are_stiff_and_part_as_they_bend() {
    // Glass of 4 mm has 394 N m (E = 70 GPa, Poisson 0.23); the others go from a steel plate to a foil.
    println!(
        "stiffness_n_m,apart_mrad,closed_form_mrad,elements_rms_mrad,pose_rms_mrad,residual_um"
    );
    let mut last = f64::MAX;
    for stiffness in [1.0, 3.94, 1e1, 3.94e1, 1e2, 3.94e2, 1e3, 1e4, 1e5] {
        let found = methods(stiffness, 200);
        let closed = bending_rms_rad(stiffness);
        println!(
            "{stiffness:e},{:.6},{:.6},{:.5},{:.5},{:.4}",
            1e3 * found.apart_rad,
            1e3 * closed,
            1e3 * found.elements_rms_rad,
            1e3 * found.pose_rms_rad,
            1e6 * found.residual_m,
        );
        // Even at 8 mrad of bending the tangent differs from the angle by less than a part in 1000.
        assert!((found.apart_rad / closed - 1.0).abs() < 1e-3, "{stiffness}");
        assert!((found.pose_rms_rad - TURN_RAD).abs() < 1e-4 * TURN_RAD);
        // Bending turns the halves opposite ways: squares add to those of the common turn.
        let together = TURN_RAD.hypot(closed);
        assert!((found.elements_rms_rad / together - 1.0).abs() < 1e-3);
        // The residual of the rigid fit falls with the stiffness as the difference does.
        assert!(found.residual_m < last);
        last = found.residual_m;
    }
    assert!(bending_rms_rad(1.0) > 0.25 * TURN_RAD && bending_rms_rad(1e5) < 1e-5 * TURN_RAD);
}

/// The residual of the least-squares motion: the deflection less its mean.
#[test]
fn the_residual_is_the_deflection_about_its_mean() {
    let stiffness = 394.0;
    let found = methods(stiffness, 2000);
    let samples = 20_000;
    let all: Vec<f64> = (0..samples)
        .map(|k| deflection_m(HALF_M * (k as f64 + 0.5) / samples as f64, stiffness))
        .collect();
    let mean = all.iter().sum::<f64>() / samples as f64;
    let squares = all.iter().map(|w| (w - mean).powi(2)).sum::<f64>() / samples as f64;
    // Nodes at both ends weigh as much as those between: one part in the number of cells.
    assert!((found.residual_m / squares.sqrt() - 1.0).abs() < 2e-3);
}

/// Quadrilaterals have the slope at their middle to O(h²): a table of the error against the cells.
#[test]
fn the_difference_converges_with_the_mesh() {
    let error = |cells| (methods(3.94, cells).apart_rad / bending_rms_rad(3.94) - 1.0).abs();
    let errors = [8, 16, 32].map(error);
    for pair in errors.windows(2) {
        let order = (pair[0] / pair[1]).log2();
        assert!((order - 2.0).abs() < 0.3, "{order} of {errors:?}");
    }
}
