//! How the plane of the target comes into the picture.

use crate::error::SpotError;
use crate::target::{Lens, LensError};

/// Size of the picture and the way from metres on the target to its pixels.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Camera {
    width_px: usize,
    height_px: usize,
    /// From (u_m, v_m, 1) to pixels of a perfect lens.
    forth: [[f64; 3]; 3],
    back: [[f64; 3]; 3],
    lens: Option<Lens>,
}

/// Where a pin-hole camera stands that looks at the target's centre.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Pose {
    /// From the camera to the target's centre \[m\].
    pub distance_m: f64,
    /// Focal length over the size of a pixel.
    pub focal_px: f64,
    /// How far the target's right edge is turned away from the camera \[rad\].
    pub turn_rad: f64,
    /// How far its lower edge is turned away \[rad\].
    pub tilt_rad: f64,
    /// How far the picture of the target is turned clockwise \[rad\].
    pub roll_rad: f64,
}

impl Camera {
    /// A pin-hole camera with the target's centre in the middle of its picture.
    ///
    /// # Errors
    /// [`SpotError`] for an empty picture, and for a camera that does not see the target's face.
    pub fn of_pose(width_px: usize, height_px: usize, pose: &Pose) -> Result<Self, SpotError> {
        let option = |what, wanted, value| {
            Err(SpotError::BadOption {
                what,
                wanted,
                value,
            })
        };
        for (what, value) in [("distance_m", pose.distance_m), ("focal_px", pose.focal_px)] {
            if !(1e-3..=1e7).contains(&value) {
                return option(what, "in 1e-3..=1e7", value);
            }
        }
        for (what, value) in [("turn_rad", pose.turn_rad), ("tilt_rad", pose.tilt_rad)] {
            if !(-1.5..=1.5).contains(&value) {
                return option(what, "in -1.5..=1.5", value);
            }
        }
        if !(-10.0..=10.0).contains(&pose.roll_rad) {
            return option("roll_rad", "in -10..=10", pose.roll_rad);
        }
        let (sin_turn, cos_turn) = libm::sincos(pose.turn_rad);
        let (sin_tilt, cos_tilt) = libm::sincos(pose.tilt_rad);
        let (sin_roll, cos_roll) = libm::sincos(pose.roll_rad);
        // Columns: the target's right and down as the camera has them (right, down, away from it).
        let right = [cos_turn, 0.0, sin_turn];
        let down = [-sin_turn * sin_tilt, cos_tilt, cos_turn * sin_tilt];
        let roll =
            |[x, y, z]: [f64; 3]| [cos_roll * x - sin_roll * y, sin_roll * x + cos_roll * y, z];
        let (right, down) = (roll(right), roll(down));
        let f = pose.focal_px;
        let [cx, cy] = [width_px, height_px].map(|size| 0.5 * (size as f64 - 1.0));
        let column = |[x, y, z]: [f64; 3]| [f * x + cx * z, f * y + cy * z, z];
        let (a, b, c) = (
            column(right),
            column(down),
            column([0.0, 0.0, pose.distance_m]),
        );
        Self::of_homography(
            width_px,
            height_px,
            [[a[0], b[0], c[0]], [a[1], b[1], c[1]], [a[2], b[2], c[2]]],
        )
    }

    /// A camera whose pixels of a perfect lens are `metres_to_px` (u_m, v_m, 1), divided by the third.
    ///
    /// # Errors
    /// [`SpotError`] for an empty picture or one of more than 2²⁸ pixels, and where the way cannot be gone back.
    pub fn of_homography(
        width_px: usize,
        height_px: usize,
        metres_to_px: [[f64; 3]; 3],
    ) -> Result<Self, SpotError> {
        let pixels = width_px.saturating_mul(height_px);
        if pixels == 0 || pixels > 1 << 28 {
            return Err(SpotError::BadOption {
                what: "pixels of a camera",
                wanted: "in 1..=2^28",
                value: pixels as f64,
            });
        }
        let back = adjugate(&metres_to_px);
        let det: f64 = (0..3).map(|k| metres_to_px[0][k] * back[k][0]).sum();
        if !(det.is_finite() && det.abs() > 0.0) {
            return Err(SpotError::BadOption {
                what: "determinant of the way from metres to pixels",
                wanted: "a finite number other than 0",
                value: det,
            });
        }
        Ok(Self {
            width_px,
            height_px,
            forth: metres_to_px,
            back,
            lens: None,
        })
    }

    /// The same through a lens that distorts.
    #[must_use]
    pub fn with_lens(self, lens: Lens) -> Self {
        Self {
            lens: Some(lens),
            ..self
        }
    }

    /// Pixels in a row.
    #[must_use]
    pub const fn width_px(&self) -> usize {
        self.width_px
    }

    /// Rows.
    #[must_use]
    pub const fn height_px(&self) -> usize {
        self.height_px
    }

    /// Where in the picture (x right, y down) a place on the target is seen; far outside it where the plane
    /// lies behind the camera.
    #[must_use]
    pub fn pixel(&self, u_m: f64, v_m: f64) -> [f64; 2] {
        let perfect = apply(&self.forth, [u_m, v_m]);
        match &self.lens {
            Some(lens) => lens.distort(perfect),
            None => perfect,
        }
    }

    /// Which place (u_m, v_m) of the target's plane a pixel sees.
    ///
    /// # Errors
    /// [`LensError`] where the lens's distortion cannot be undone.
    pub fn place(&self, x_px: f64, y_px: f64) -> Result<[f64; 2], LensError> {
        let perfect = match &self.lens {
            Some(lens) => lens.undistort([x_px, y_px])?,
            None => [x_px, y_px],
        };
        Ok(apply(&self.back, perfect))
    }
}

fn apply(h: &[[f64; 3]; 3], [x, y]: [f64; 2]) -> [f64; 2] {
    let [a, b, w] = h.map(|row| row[0] * x + row[1] * y + row[2]);
    [a / w, b / w]
}

/// The inverse but for its scale, which a homography does not have.
fn adjugate(h: &[[f64; 3]; 3]) -> [[f64; 3]; 3] {
    let minor = |i: usize, j: usize| {
        let (r, s) = ((i + 1) % 3, (i + 2) % 3);
        let (p, q) = ((j + 1) % 3, (j + 2) % 3);
        h[r][p] * h[s][q] - h[r][q] * h[s][p]
    };
    let mut out = [[0.0; 3]; 3];
    for (i, row) in out.iter_mut().enumerate() {
        for (j, cell) in row.iter_mut().enumerate() {
            *cell = minor(j, i);
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::target::LensValues;

    const POSE: Pose = Pose {
        distance_m: 200.0,
        focal_px: 25_000.0,
        turn_rad: 0.3,
        tilt_rad: -0.2,
        roll_rad: 0.05,
    };

    #[test]
    fn there_and_back() {
        let lens = Lens::new(LensValues {
            fx_px: 3000.0,
            fy_px: 3000.0,
            cx_px: 400.0,
            cy_px: 280.0,
            k1: -0.2,
            k2: 0.1,
            p1: 1e-3,
            ..LensValues::default()
        })
        .unwrap();
        let camera = Camera::of_pose(768, 576, &POSE).unwrap().with_lens(lens);
        for (u_m, v_m) in [(0.0, 0.0), (2.0, -1.5), (-3.0, 3.0)] {
            let [x_px, y_px] = camera.pixel(u_m, v_m);
            let [u, v] = camera.place(x_px, y_px).unwrap();
            assert!((u - u_m).abs() < 1e-9 && (v - v_m).abs() < 1e-9);
        }
    }

    // The textbook's projection, point by point: turn about the vertical, tilt, roll, divide by depth.
    #[test]
    fn a_pose_is_what_it_says() {
        let camera = Camera::of_pose(768, 576, &POSE).unwrap();
        assert_eq!(camera.pixel(0.0, 0.0), [383.5, 287.5]);
        let straight = Pose {
            turn_rad: 0.0,
            tilt_rad: 0.0,
            roll_rad: 0.0,
            ..POSE
        };
        let square = Camera::of_pose(768, 576, &straight)
            .unwrap()
            .pixel(1.0, 2.0);
        assert!(
            (square[0] - (383.5 + 125.0)).abs() < 1e-9
                && (square[1] - (287.5 + 250.0)).abs() < 1e-9
        );
        let turned = Pose {
            turn_rad: 0.3,
            ..straight
        };
        let [x_px, y_px] = Camera::of_pose(768, 576, &turned).unwrap().pixel(2.0, 1.0);
        let depth_m = 200.0 + 2.0 * libm::sin(0.3);
        assert!((x_px - (383.5 + 25_000.0 * 2.0 * libm::cos(0.3) / depth_m)).abs() < 1e-9);
        assert!((y_px - (287.5 + 25_000.0 / depth_m)).abs() < 1e-9);
        let tilted = Pose {
            tilt_rad: 0.4,
            ..straight
        };
        let [_, y_px] = Camera::of_pose(768, 576, &tilted).unwrap().pixel(0.0, 1.0);
        assert!(
            (y_px - (287.5 + 25_000.0 * libm::cos(0.4) / (200.0 + libm::sin(0.4)))).abs() < 1e-9
        );
        let rolled = Pose {
            roll_rad: core::f64::consts::FRAC_PI_2,
            ..straight
        };
        let [x_px, y_px] = Camera::of_pose(768, 576, &rolled).unwrap().pixel(1.0, 0.0);
        assert!((x_px - 383.5).abs() < 1e-9 && (y_px - (287.5 + 125.0)).abs() < 1e-9);
    }

    #[test]
    fn senseless_cameras_are_refused() {
        assert!(Camera::of_pose(0, 576, &POSE).is_err());
        assert!(Camera::of_pose(usize::MAX, 2, &POSE).is_err());
        assert!(
            Camera::of_pose(
                8,
                8,
                &Pose {
                    turn_rad: 1.6,
                    ..POSE
                }
            )
            .is_err()
        );
        assert!(
            Camera::of_pose(
                8,
                8,
                &Pose {
                    distance_m: f64::NAN,
                    ..POSE
                }
            )
            .is_err()
        );
        assert!(
            Camera::of_homography(8, 8, [[1.0, 2.0, 0.0], [2.0, 4.0, 0.0], [0.0, 0.0, 1.0]])
                .is_err()
        );
    }
}
