//! The projective map between a flat board and its picture.

use super::{Corner, CornersError};

/// Three corners whose triangle is lower than this share of its longest side count as in line.
const IN_LINE: f64 = 1e-4;

/// Sign of the corners' positions on the board, in their order: right, down.
const SIGNS: [[f64; 2]; 4] = [[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]];

/// Map between metres on a board and pixels of a picture without distortion, from the board's four corners.
///
/// With the corners P₀ … P₃ and λᵢ the (doubled) area of the triangle of the three others, λ₀P₀ - λ₁P₁ + λ₂P₂ - λ₃P₃ = 0
/// in homogeneous coordinates, so the map takes the board's corner i to λᵢPᵢ and everything else follows by
/// linearity. No system is solved and nothing cancels: the areas come from differences of corners, and pixels count
/// from the corners' mean.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Homography {
    /// Mean of the corners.
    origin_px: [f64; 2],
    /// Corners from there.
    corners_px: [[f64; 2]; 4],
    /// λᵢ.
    weights: [f64; 4],
    /// Half of width and height.
    half_m: [f64; 2],
    /// From the board (right, down in halves; 1) to pixels from the origin, homogeneous.
    forward: [[f64; 3]; 3],
    /// Back, up to a positive factor.
    backward: [[f64; 3]; 3],
}

impl Homography {
    /// Of the corners in order upper left, upper right, lower right, lower left, as seen in the picture (right, down),
    /// of a board of the given size.
    ///
    /// # Errors
    /// Names what is wrong with corners through which no such map exists: [`CornersError::NotFinite`],
    /// [`CornersError::InLine`], [`CornersError::Mirrored`], [`CornersError::Crossed`], [`CornersError::Dented`],
    /// or with the size: [`CornersError::BadBoard`].
    pub fn from_corners(
        corners_px: &[[f64; 2]; 4],
        width_m: f64,
        height_m: f64,
    ) -> Result<Self, CornersError> {
        for (what, value_m) in [("width_m", width_m), ("height_m", height_m)] {
            if !(value_m.is_finite() && value_m > 0.0) {
                return Err(CornersError::BadBoard { what, value_m });
            }
        }
        for (corner, at) in Corner::ALL.into_iter().zip(corners_px) {
            if !(at[0].is_finite() && at[1].is_finite()) {
                return Err(CornersError::NotFinite { corner });
            }
        }
        let first = corners_px[0];
        let mut origin_px = [0.0; 2];
        for k in 0..2 {
            let sum: f64 = corners_px.iter().map(|p| p[k] - first[k]).sum();
            origin_px[k] = first[k] + 0.25 * sum;
        }
        let corners = corners_px.map(|p| [p[0] - origin_px[0], p[1] - origin_px[1]]);
        let weights = areas(&corners)?;

        let mut forward = [[0.0; 3]; 3];
        for ((p, w), s) in corners.iter().zip(weights).zip(SIGNS) {
            for (row, value) in forward.iter_mut().zip([p[0], p[1], 1.0]) {
                row[0] += 0.25 * s[0] * w * value;
                row[1] += 0.25 * s[1] * w * value;
                row[2] += 0.25 * w * value;
            }
        }
        Ok(Self {
            origin_px,
            corners_px: corners,
            weights,
            half_m: [0.5 * width_m, 0.5 * height_m],
            forward,
            backward: adjugate(&forward),
        })
    }

    /// Pixel of a place right and down of the board's centre; none behind the camera.
    #[must_use]
    pub fn to_pixels(&self, [u_m, v_m]: [f64; 2]) -> Option<[f64; 2]> {
        let at = [u_m / self.half_m[0], v_m / self.half_m[1]];
        let ([x, y], _) = project(&self.forward, at)?;
        Some([self.origin_px[0] + x, self.origin_px[1] + y])
    }

    /// Place right and down of the board's centre that is seen at a pixel; none on or beyond the board's horizon.
    #[must_use]
    pub fn to_target(&self, pixel: [f64; 2]) -> Option<[f64; 2]> {
        let ([s, t], _) = project(&self.backward, self.relative(pixel))?;
        Some([self.half_m[0] * s, self.half_m[1] * t])
    }

    /// Derivative of [`to_target`](Self::to_target): rows u, v, columns x, y, in metres per pixel.
    #[must_use]
    pub fn target_slopes(&self, pixel: [f64; 2]) -> Option<[[f64; 2]; 2]> {
        let (_, [[a, b], [c, d]]) = project(&self.backward, self.relative(pixel))?;
        let [w, h] = self.half_m;
        Some([[w * a, w * b], [h * c, h * d]])
    }

    /// Derivative of [`to_pixels`](Self::to_pixels): rows x, y, columns u, v, in pixels per metre.
    #[must_use]
    pub fn pixel_slopes(&self, [u_m, v_m]: [f64; 2]) -> Option<[[f64; 2]; 2]> {
        let [w, h] = self.half_m;
        let (_, [[a, b], [c, d]]) = project(&self.forward, [u_m / w, v_m / h])?;
        Some([[a / w, b / h], [c / w, d / h]])
    }

    /// How the place seen at a pixel moves with each corner: four derivatives, rows u, v, columns x, y of the corner,
    /// in metres per pixel.
    #[must_use]
    pub fn corner_slopes(&self, pixel: [f64; 2]) -> Option<[[[f64; 2]; 2]; 4]> {
        let at = self.relative(pixel);
        let ([s, t], _) = project(&self.backward, at)?;
        let slopes = self.target_slopes(pixel)?;
        // The pixel is the mean of the corners weighed by wᵢ = λᵢ bᵢ.
        let shares = SIGNS.map(|[si, ti]| 0.25 * (1.0 + s * si + t * ti));
        let sum: f64 = (0..4).map(|i| self.weights[i] * shares[i]).sum();
        Some(core::array::from_fn(|i| {
            let own = self.weights[i] * shares[i];
            let mut moved = [[own, 0.0], [0.0, own]];
            for (j, share) in shares.iter().enumerate() {
                if j == i {
                    continue;
                }
                // λⱼ is the area of the three others: its change with corner i is a side of them, turned.
                let [next, after] = match (i + 4 - j) % 4 {
                    1 => [(i + 1) % 4, (i + 2) % 4],
                    2 => [(i + 1) % 4, (i + 3) % 4],
                    _ => [(i + 2) % 4, (i + 3) % 4],
                };
                let [n, m] = [self.corners_px[next], self.corners_px[after]];
                let change = [n[1] - m[1], m[0] - n[0]];
                for (k, row) in moved.iter_mut().enumerate() {
                    let away = share * (self.corners_px[j][k] - at[k]);
                    row[0] += away * change[0];
                    row[1] += away * change[1];
                }
            }
            // The pixel is fixed, so the place moves against the picture.
            let [[a, b], [c, d]] = moved;
            slopes.map(|[p, q]| [-(p * a + q * c) / sum, -(p * b + q * d) / sum])
        }))
    }

    fn relative(&self, pixel: [f64; 2]) -> [f64; 2] {
        [pixel[0] - self.origin_px[0], pixel[1] - self.origin_px[1]]
    }
}

/// Where the line through the first and third point crosses that through the second and fourth: the centre of a board
/// by its diagonals (T/GRLM 02-2014, A.1). None where the lines are parallel.
#[must_use]
pub fn diagonals_cross(corners_px: &[[f64; 2]; 4]) -> Option<[f64; 2]> {
    let [p0, p1, p2, p3] = *corners_px;
    let along = [p2[0] - p0[0], p2[1] - p0[1]];
    let other = [p3[0] - p1[0], p3[1] - p1[1]];
    let det = cross(along, other);
    let share = cross([p1[0] - p0[0], p1[1] - p0[1]], other) / det;
    let at = [p0[0] + share * along[0], p0[1] + share * along[1]];
    (at[0].is_finite() && at[1].is_finite()).then_some(at)
}

/// λᵢ: the doubled area of the triangle of all corners but i, positive where they run clockwise in the picture.
fn areas(corners: &[[f64; 2]; 4]) -> Result<[f64; 4], CornersError> {
    let mut weights = [0.0; 4];
    for (i, weight) in weights.iter_mut().enumerate() {
        let [a, b, c] = [1, 2, 3].map(|k| corners[(i + k) % 4]);
        let [ab, ac, bc] = [[a, b], [a, c], [b, c]].map(|[p, q]| [q[0] - p[0], q[1] - p[1]]);
        *weight = cross(ab, ac);
        let longest = [ab, ac, bc]
            .map(|e| e[0] * e[0] + e[1] * e[1])
            .into_iter()
            .fold(0.0, f64::max);
        if weight.abs() <= IN_LINE * longest {
            let three = [1, 2, 3].map(|k| Corner::ALL[(i + k) % 4]);
            return Err(CornersError::InLine { three });
        }
    }
    let negative: Vec<usize> = (0..4).filter(|&i| weights[i] < 0.0).collect();
    match negative[..] {
        [] => Ok(weights),
        [_, _, _, _] => Err(CornersError::Mirrored),
        [_, _] => Err(CornersError::Crossed),
        // One area of the other sign: its opposite corner lies in the triangle of the others.
        [i] => Err(CornersError::Dented {
            corner: Corner::ALL[(i + 2) % 4],
        }),
        _ => {
            let i = (0..4).find(|&i| weights[i] > 0.0).unwrap_or(0);
            Err(CornersError::Dented {
                corner: Corner::ALL[(i + 2) % 4],
            })
        }
    }
}

/// Image of a point and its derivative; none where it has none.
fn project(map: &[[f64; 3]; 3], [s, t]: [f64; 2]) -> Option<([f64; 2], [[f64; 2]; 2])> {
    let [x, y, w] = map.map(|[a, b, c]| a * s + b * t + c);
    let at = [x / w, y / w];
    if !(w > 0.0 && at[0].is_finite() && at[1].is_finite()) {
        return None;
    }
    let slope = |k: usize, i: usize| (map[k][i] - at[k] * map[2][i]) / w;
    Some((at, [[slope(0, 0), slope(0, 1)], [slope(1, 0), slope(1, 1)]]))
}

fn adjugate(m: &[[f64; 3]; 3]) -> [[f64; 3]; 3] {
    let minor = |r: usize, c: usize| {
        let (r1, r2) = ((r + 1) % 3, (r + 2) % 3);
        let (c1, c2) = ((c + 1) % 3, (c + 2) % 3);
        m[r1][c1] * m[r2][c2] - m[r1][c2] * m[r2][c1]
    };
    core::array::from_fn(|i| core::array::from_fn(|j| minor(j, i)))
}

fn cross(a: [f64; 2], b: [f64; 2]) -> f64 {
    a[0] * b[1] - a[1] * b[0]
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    struct Case {
        corners_px: [[f64; 2]; 4],
        size_m: [f64; 2],
        pixel: [f64; 2],
        target_m: [f64; 2],
    }

    /// The 8x8 system in 60 digits (mpmath), the doubles here taken as exact.
    const CASES: [Case; 6] = [
        Case {
            corners_px: [[0.0, 0.0], [4.0, 0.0], [4.0, 3.0], [0.0, 3.0]],
            size_m: [4.0, 3.0],
            pixel: [1.0, 1.0],
            target_m: [-1.0, -0.5],
        },
        Case {
            corners_px: [
                [133.84, 444.41],
                [1303.88, 407.1],
                [1329.95, 1367.16],
                [161.62, 1402.31],
            ],
            size_m: [8.6252, 7.2105],
            pixel: [700.25, 512.5],
            target_m: [-0.150_293_190_284_486_6, -2.958_927_434_510_089_7],
        },
        Case {
            corners_px: [
                [1104.16, 126.94],
                [2443.44, 102.64],
                [2478.42, 1485.13],
                [1094.06, 1511.74],
            ],
            size_m: [5.4121, 6.3875],
            pixel: [2400.125, 1300.75],
            target_m: [2.416_777_803_907_238, 2.359_671_165_760_356],
        },
        Case {
            corners_px: [[10.0, 10.0], [90.0, 30.0], [80.0, 70.0], [20.0, 95.0]],
            size_m: [2.0, 1.0],
            pixel: [55.0, 44.0],
            target_m: [-0.271_778_629_461_902_54, -0.200_789_455_442_254_4],
        },
        Case {
            corners_px: [
                [100_010.5, -200_020.25],
                [100_013.25, -200_019.5],
                [100_012.75, -200_016.125],
                [100_009.875, -200_017.0],
            ],
            size_m: [12.0, 30.0],
            pixel: [100_011.375, -200_018.5],
            target_m: [-1.013_072_810_795_063_4, -1.520_637_067_473_981_2],
        },
        Case {
            corners_px: [
                [-0.001, -0.002],
                [0.003, -0.0015],
                [0.0025, 0.004],
                [-0.002, 0.001],
            ],
            size_m: [1000.0, 2000.0],
            pixel: [0.0005, 0.000_25],
            target_m: [97.527_618_912_294_41, 83.158_679_975_844_55],
        },
    ];

    #[test]
    fn equals_forty_digits() {
        for case in CASES {
            let [w, h] = case.size_m;
            let map = Homography::from_corners(&case.corners_px, w, h).unwrap();
            let found = map.to_target(case.pixel).unwrap();
            for k in 0..2 {
                let error = (found[k] - case.target_m[k]).abs() / case.size_m[k];
                assert!(error < 4e-16, "{error:e}: {found:?} {:?}", case.target_m);
            }
            // The corners themselves and back again.
            for (p, s) in case.corners_px.iter().zip(SIGNS) {
                let wanted = [0.5 * w * s[0], 0.5 * h * s[1]];
                let found = map.to_target(*p).unwrap();
                assert!((found[0] - wanted[0]).abs() < 1e-15 * w);
                assert!((found[1] - wanted[1]).abs() < 1e-15 * h);
                let back = map.to_pixels(wanted).unwrap();
                let scale = p[0].abs().max(p[1].abs()).max(1e-3);
                assert!((back[0] - p[0]).abs() < 1e-15 * scale);
                assert!((back[1] - p[1]).abs() < 1e-15 * scale);
            }
        }
    }

    /// A pinhole camera looking at the board: turned, tilted, from any distance.
    fn camera(turn: [f64; 3], away: f64, f_px: f64) -> impl Fn([f64; 2]) -> [f64; 2] {
        let [[ca, sa], [cb, sb], [cc, sc]] = turn.map(|a| [a.cos(), a.sin()]);
        move |[u, v]: [f64; 2]| {
            let [x, y] = [cc * u - sc * v, sc * u + cc * v];
            let [x, z] = [ca * x, -sa * x];
            let [y, z] = [cb * y - sb * z, sb * y + cb * z];
            [
                1344.0 + f_px * x / (away + z),
                756.0 + f_px * y / (away + z),
            ]
        }
    }

    prop_compose! {
        fn cameras()(
            yaw in -1.0..1.0, pitch in -0.7..0.7, roll in -0.7..0.7,
            away in 15.0..200.0, f_px in 500.0..20_000.0, w in 1.0..12.0, h in 1.0..12.0,
        ) -> ([f64; 3], f64, f64, f64, f64) {
            ([yaw, pitch, roll], away, f_px, w, h)
        }
    }

    fn board(see: impl Fn([f64; 2]) -> [f64; 2], w: f64, h: f64) -> [[f64; 2]; 4] {
        SIGNS.map(|[s, t]| see([0.5 * w * s, 0.5 * h * t]))
    }

    proptest! {
        #[test]
        fn undoes_any_camera((turn, away, f_px, w, h) in cameras(), u in -0.7..0.7, v in -0.7..0.7) {
            let see = camera(turn, away, f_px);
            let map = Homography::from_corners(&board(&see, w, h), w, h).unwrap();
            let place = [w * u, h * v];
            let pixel = see(place);
            let found = map.to_target(pixel).unwrap();
            let seen = map.to_pixels(place).unwrap();
            // What the rounding of a pixel near 1e3 to 1e4 makes in metres.
            let rounding_px = 8.0 * f64::EPSILON * (2000.0 + f_px);
            let slopes = map.target_slopes(pixel).unwrap();
            for k in 0..2 {
                let bound_m = rounding_px * (slopes[k][0].abs() + slopes[k][1].abs());
                prop_assert!((found[k] - place[k]).abs() < bound_m, "{found:?} {place:?} {bound_m:e}");
                prop_assert!((seen[k] - pixel[k]).abs() < rounding_px);
            }
            // The diagonals of the picture cross at the picture of the centre.
            let centre = diagonals_cross(&board(&see, w, h)).unwrap();
            let wanted = see([0.0, 0.0]);
            prop_assert!((centre[0] - wanted[0]).abs() < rounding_px);
            prop_assert!((centre[1] - wanted[1]).abs() < rounding_px);
        }

        #[test]
        fn slopes_are_those_of_differences(
            (turn, away, f_px, w, h) in cameras(), u in -0.5..0.5, v in -0.5..0.5,
        ) {
            let see = camera(turn, away, f_px);
            let corners = board(&see, w, h);
            let map = Homography::from_corners(&corners, w, h).unwrap();
            let place = [w * u, h * v];
            let pixel = map.to_pixels(place).unwrap();
            let slopes = map.target_slopes(pixel).unwrap();
            let back = map.pixel_slopes(place).unwrap();
            let corner_slopes = map.corner_slopes(pixel).unwrap();
            let size = slopes.iter().flatten().fold(0.0_f64, |m, s| m.max(s.abs()));
            let step = 1e-4 * f_px / away;
            for k in 0..2 {
                let mut pixels = [pixel, pixel];
                pixels[0][k] -= step;
                pixels[1][k] += step;
                let [a, b] = pixels.map(|p| map.to_target(p).unwrap());
                for i in 0..2 {
                    let slope = (b[i] - a[i]) / (2.0 * step);
                    prop_assert!((slope - slopes[i][k]).abs() < 1e-6 * size);
                    let product: f64 = (0..2).map(|j| slopes[i][j] * back[j][k]).sum();
                    prop_assert!((product - f64::from(u8::from(i == k))).abs() < 1e-11);
                }
                for c in 0..4 {
                    let mut moved = [corners, corners];
                    moved[0][c][k] -= step;
                    moved[1][c][k] += step;
                    let [a, b] = moved.map(|m| {
                        Homography::from_corners(&m, w, h).unwrap().to_target(pixel).unwrap()
                    });
                    for i in 0..2 {
                        let slope = (b[i] - a[i]) / (2.0 * step);
                        let found = corner_slopes[c][i][k];
                        prop_assert!((slope - found).abs() < 1e-6 * size, "{slope} {found}");
                    }
                }
            }
        }
    }

    #[test]
    fn no_place_beyond_the_horizon() {
        // Sides that run together 20 px above the upper edge: the horizon lies there.
        let corners = [[-10.0, 0.0], [10.0, 0.0], [20.0, 20.0], [-20.0, 20.0]];
        let map = Homography::from_corners(&corners, 2.0, 2.0).unwrap();
        assert!(map.to_target([0.0, -19.9]).is_some());
        assert_eq!(map.to_target([0.0, -20.1]), None);
        assert_eq!(map.to_target([f64::NAN, 0.0]), None);
        // And the board's plane behind the camera has no picture.
        assert!(map.to_pixels([0.0, 2.9]).is_some());
        assert_eq!(map.to_pixels([0.0, 3.1]), None);
        assert_eq!(map.target_slopes([0.0, -20.1]), None);
        assert_eq!(map.corner_slopes([0.0, -20.1]), None);
    }

    #[test]
    fn bad_corners_are_refused_by_name() {
        let good = [[0.0, 0.0], [100.0, 2.0], [98.0, 60.0], [3.0, 58.0]];
        let refuse =
            |corners: [[f64; 2]; 4]| Homography::from_corners(&corners, 3.0, 2.0).unwrap_err();
        let [a, b, c, d] = good;
        assert_eq!(refuse([b, a, d, c]), CornersError::Mirrored);
        assert_eq!(refuse([a, d, c, b]), CornersError::Mirrored);
        assert_eq!(refuse([a, c, b, d]), CornersError::Crossed);
        assert_eq!(refuse([a, b, d, c]), CornersError::Crossed);
        for corner in 0..4 {
            let mut dented = good;
            let [before, after] = [good[(corner + 1) % 4], good[(corner + 3) % 4]];
            for k in 0..2 {
                dented[corner][k] =
                    0.4 * before[k] + 0.4 * after[k] + 0.2 * good[(corner + 2) % 4][k];
            }
            let wanted = CornersError::Dented {
                corner: Corner::ALL[corner],
            };
            assert_eq!(refuse(dented), wanted);
            let mut straight = good;
            for k in 0..2 {
                straight[corner][k] = 0.5 * (before[k] + after[k]);
            }
            assert!(
                matches!(refuse(straight), CornersError::InLine { three } if three.contains(&Corner::ALL[corner]))
            );
            let mut twice = good;
            twice[corner] = after;
            assert!(matches!(refuse(twice), CornersError::InLine { .. }));
            let mut not = good;
            not[corner][1] = f64::NAN;
            let wanted = CornersError::NotFinite {
                corner: Corner::ALL[corner],
            };
            assert_eq!(refuse(not), wanted);
        }
        assert!(matches!(refuse([a; 4]), CornersError::InLine { .. }));
        for (w, h) in [
            (0.0, 1.0),
            (1.0, -1.0),
            (f64::NAN, 1.0),
            (1.0, f64::INFINITY),
        ] {
            assert!(matches!(
                Homography::from_corners(&good, w, h),
                Err(CornersError::BadBoard { .. })
            ));
        }
        // Any turn of the picture is taken: the corners' names say what is up.
        for turn in 0..4 {
            let turned = [0, 1, 2, 3].map(|k| good[(k + turn) % 4]);
            assert!(Homography::from_corners(&turned, 3.0, 2.0).is_ok());
        }
    }
}
