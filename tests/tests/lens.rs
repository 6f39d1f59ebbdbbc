//! The lens model against a camera calibrated with a checkerboard by OpenCV.

#![allow(
    clippy::unwrap_used,
    clippy::print_stderr,
    reason = "tests fail and talk"
)]

use helio_spot::{Lens, LensValues};
use helio_tests::data::{self, Table};
use serde_json::Value;

fn numbers(value: &Value) -> Vec<f64> {
    value
        .as_array()
        .unwrap()
        .iter()
        .map(|v| v.as_f64().unwrap())
        .collect()
}

/// Rotation of a vector about another by its length (Rodrigues).
fn rotate(by: &[f64], p: [f64; 3]) -> [f64; 3] {
    let angle = by.iter().map(|c| c * c).sum::<f64>().sqrt();
    let k: Vec<f64> = by.iter().map(|c| c / angle).collect();
    let dot: f64 = (0..3).map(|i| k[i] * p[i]).sum();
    core::array::from_fn(|i| {
        let [a, b] = [(i + 1) % 3, (i + 2) % 3];
        let cross = k[a] * p[b] - k[b] * p[a];
        p[i] * angle.cos() + cross * angle.sin() + k[i] * dot * (1.0 - angle.cos())
    })
}

#[test]
fn a_calibrated_cameras_views_are_predicted_as_well_as_published() {
    let name = "a_calibrated_cameras_views_are_predicted_as_well_as_published";
    let Some(folder) = data::folder(name) else {
        return;
    };
    let folder = folder.join("camera_calibration");
    let text = std::fs::read_to_string(folder.join("reference.json")).unwrap();
    let reference: Value = serde_json::from_str(&text).unwrap();
    let matrix: Vec<Vec<f64>> = reference["intrinsic_matrix"]
        .as_array()
        .unwrap()
        .iter()
        .map(numbers)
        .collect();
    let bend = numbers(&reference["distortion_k1_k2_p1_p2"]);
    let lens = Lens::new(LensValues {
        fx_px: matrix[0][0],
        fy_px: matrix[1][1],
        cx_px: matrix[0][2],
        cy_px: matrix[1][2],
        k1: bend[0],
        k2: bend[1],
        p1: bend[2],
        p2: bend[3],
        k3: 0.0,
    })
    .unwrap();
    let corners = Table::read(folder.join("corners.csv"));
    let views = reference["views"].as_object().unwrap();
    let (mut squares, mut straight, mut count) = (0.0, 0.0, 0);
    for (view, pose) in views {
        let [turn, shift] = ["rotation_vector", "translation"].map(|key| numbers(&pose[key]));
        let (mut own, mut points) = (0.0, 0);
        for row in (0..corners.len()).filter(|r| corners.text(*r, "view") == view) {
            let at = ["board_x", "board_y", "board_z"].map(|c| corners.number(row, c));
            let turned = rotate(&turn, at);
            let [x, y, z] = core::array::from_fn(|i| turned[i] + shift[i]);
            let perfect = [
                matrix[0][0] * x / z + matrix[0][2],
                matrix[1][1] * y / z + matrix[1][2],
            ];
            let seen = ["image_x_px", "image_y_px"].map(|c| corners.number(row, c));
            let taken = lens.distort(perfect);
            let square = |p: [f64; 2]| (p[0] - seen[0]).powi(2) + (p[1] - seen[1]).powi(2);
            own += square(taken);
            straight += square(perfect);
            points += 1;
            let back = lens.undistort(taken).unwrap();
            assert!((back[0] - perfect[0]).abs() < 1e-8 && (back[1] - perfect[1]).abs() < 1e-8);
        }
        assert_eq!(points, 18 * 23, "view {view}");
        let rms = (own / f64::from(points)).sqrt();
        let published = pose["reprojection_error_px"].as_f64().unwrap();
        eprintln!("view {view}: {rms:.6} px, published {published:.6}");
        // Published from projections in single precision, 6e-5 px apart where they lie here.
        assert!(
            (rms - published).abs() < 1e-5,
            "view {view}: {rms} {published}"
        );
        squares += own;
        count += points;
    }
    let [rms, without] = [squares, straight].map(|s| (s / f64::from(count)).sqrt());
    eprintln!("{count} corners: {rms:.4} px, without distortion {without:.2}");
    // Published over ten views, of which six are here.
    assert!((rms - 0.19).abs() < 0.005, "{rms}");
    assert!(without > 2.0, "{without}");
}
