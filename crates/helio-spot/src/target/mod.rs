//! The target: its board, where its corners are in the picture, and the way from pixels to metres on it.

pub mod homography;
pub mod lens;
pub mod marks;

pub use homography::{Homography, diagonals_cross};
pub use lens::{Lens, LensError, LensValues};
pub use marks::{Expected, FindOptions, JOINT_SHARE, MarkScratch, MarkSize, find_corners};

/// Which marks a board carries.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Marks {
    /// An L in each corner.
    FourCorners,
    /// The upper of two boards that share an edge: L marks above, T marks half-way down both sides.
    TwoPanelUpper,
    /// The lower of two boards that share an edge: T marks half-way down both sides, L marks below.
    TwoPanelLower,
}

impl Marks {
    /// The word for files.
    #[must_use]
    pub const fn as_str(self) -> &'static str {
        match self {
            Self::FourCorners => "four-corners",
            Self::TwoPanelUpper => "two-panel-upper",
            Self::TwoPanelLower => "two-panel-lower",
        }
    }
}

/// A flat white board with black marks at its corners.
///
/// The corners are the outer vertices of the L marks; at a T mark the corner lies on the outer edge of its bar, at the
/// joint of the two boards.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Board {
    /// From the left to the right corners.
    pub width_m: f64,
    /// From the upper to the lower corners.
    pub height_m: f64,
    /// Its marks.
    pub marks: Marks,
}

/// A corner of a board, as a camera facing it sees it.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Corner {
    /// Above, left.
    UpperLeft,
    /// Above, right.
    UpperRight,
    /// Below, right.
    LowerRight,
    /// Below, left.
    LowerLeft,
}

impl Corner {
    /// All four, in the order used everywhere: clockwise from the upper left.
    pub const ALL: [Self; 4] = [
        Self::UpperLeft,
        Self::UpperRight,
        Self::LowerRight,
        Self::LowerLeft,
    ];

    /// Its name.
    #[must_use]
    pub const fn as_str(self) -> &'static str {
        match self {
            Self::UpperLeft => "upper left",
            Self::UpperRight => "upper right",
            Self::LowerRight => "lower right",
            Self::LowerLeft => "lower left",
        }
    }
}

impl core::fmt::Display for Corner {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        f.write_str(self.as_str())
    }
}

/// Where a board's corners are in a picture: upper left, upper right, lower right, lower left.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Corners {
    /// `[x_px, y_px]` of each.
    pub at_px: [[f64; 2]; 4],
    /// One standard deviation of each, along x as along y.
    pub sigma_px: [f64; 4],
    /// Whether the mark was seen; where not, the corner follows from the others.
    pub seen: [bool; 4],
    /// Size of the marks where they were looked for.
    pub marks: Option<MarkSize>,
}

impl Corners {
    /// Corners that somebody gives, all with the same uncertainty (one standard deviation per coordinate).
    #[must_use]
    pub const fn given(at_px: [[f64; 2]; 4], sigma_px: f64) -> Self {
        Self {
            at_px,
            sigma_px: [sigma_px; 4],
            seen: [true; 4],
            marks: None,
        }
    }

    /// The same, of a board on which the places of the marks are known to one standard deviation `sigma_m` each, right
    /// as down \[m\]: that much less certain.
    #[must_use]
    pub fn with_survey(mut self, board: &Board, sigma_m: f64) -> Self {
        let side = |i: usize| {
            let [[ax, ay], [bx, by]] = [self.at_px[i], self.at_px[(i + 1) % 4]];
            let metres = if i.is_multiple_of(2) {
                board.width_m
            } else {
                board.height_m
            };
            (bx - ax).hypot(by - ay) / metres
        };
        // the mean scale of the two sides that meet in the corner
        let px_per_m = [0, 1, 2, 3].map(|i| 0.5 * (side(i) + side((i + 3) % 4)));
        for (own, px_per_m) in self.sigma_px.iter_mut().zip(px_per_m) {
            *own = own.hypot(sigma_m * px_per_m);
        }
        self
    }
}

/// Why there is no way from pixels to metres.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum CornersError {
    /// A board without size.
    #[error("board: {what} must be a number above 0, got {value_m}")]
    BadBoard {
        /// Which size.
        what: &'static str,
        /// What was given.
        value_m: f64,
    },
    /// A corner's position or uncertainty is no number, or the uncertainty is negative.
    #[error("{corner} corner: position and uncertainty must be numbers, the latter not below 0")]
    NotFinite {
        /// Which.
        corner: Corner,
    },
    /// Three corners that make no triangle.
    #[error("corners {}, {} and {} lie in a line", three[0], three[1], three[2])]
    InLine {
        /// Which.
        three: [Corner; 3],
    },
    /// Corners that run anticlockwise in the picture.
    #[error(
        "corners are mirrored: upper left, upper right, lower right, lower left must run clockwise in the picture"
    )]
    Mirrored,
    /// Sides that cross each other.
    #[error("corners are out of order: two sides of the board cross each other")]
    Crossed,
    /// A corner within the triangle of the three others.
    #[error("{corner} corner lies within the triangle of the three others")]
    Dented {
        /// Which.
        corner: Corner,
    },
    /// No board in the picture: no four marks (nor three) that agree with one board.
    #[error("no board found; marks that may be its own: {}", words(*found))]
    NoMarks {
        /// At which corners something was seen that looks like the mark there.
        found: [bool; 4],
    },
    /// More than one board like the one looked for: the expected corners are wanted.
    #[error("several boards in the picture have these marks: say where the corners are expected")]
    SeveralBoards,
    /// A corner that the lens cannot have pictured.
    #[error("{corner} corner: {source}")]
    Lens {
        /// Which.
        corner: Corner,
        /// What the lens says.
        source: LensError,
    },
}

/// The names of some corners.
fn words(found: [bool; 4]) -> String {
    let names: Vec<&str> = Corner::ALL
        .into_iter()
        .zip(found)
        .filter_map(|(corner, seen)| seen.then_some(corner.as_str()))
        .collect();
    if names.is_empty() {
        return "none".to_owned();
    }
    names.join(", ")
}

/// The way between pixels and metres on a board, and how certain it is.
///
/// ```
/// use helio_spot::{Board, Corners, Marks, Plane};
/// let board = Board { width_m: 6.0, height_m: 6.0, marks: Marks::FourCorners };
/// let corners = [[100.0, 100.0], [700.0, 100.0], [700.0, 700.0], [100.0, 700.0]];
/// let plane = Plane::new(board, Corners::given(corners, 0.5), None)?;
/// assert_eq!(plane.to_target([500.0, 400.0]), Some([1.0, 0.0]));
/// // Half a pixel, half a centimetre: the diagonals' crossing moves half as far as a corner does across them.
/// let [[uu, uv], _] = plane.covariance_m2([400.0, 400.0]).unwrap();
/// assert!((uu.sqrt() - 0.005 * 0.5_f64.sqrt()).abs() < 1e-12 && uv.abs() < 1e-12);
/// # Ok::<(), helio_spot::CornersError>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Plane {
    board: Board,
    corners: Corners,
    lens: Option<Lens>,
    map: Homography,
    /// Covariance of each corner in a perfect lens's picture \[px²\].
    spread_px2: [[[f64; 2]; 2]; 4],
}

impl Plane {
    /// Of a board, its corners in the picture taken, and the camera's lens where its distortion is known.
    ///
    /// # Errors
    /// [`CornersError`] says what is wrong with the corners, the board or the lens.
    pub fn new(board: Board, corners: Corners, lens: Option<Lens>) -> Result<Self, CornersError> {
        let mut perfect_px = corners.at_px;
        let mut spread_px2 = [[[0.0; 2]; 2]; 4];
        for (i, corner) in Corner::ALL.into_iter().enumerate() {
            let sigma = corners.sigma_px[i];
            let at = corners.at_px[i];
            if !(at[0].is_finite() && at[1].is_finite() && sigma.is_finite() && sigma >= 0.0) {
                return Err(CornersError::NotFinite { corner });
            }
            let mut slopes = [[1.0, 0.0], [0.0, 1.0]];
            if let Some(lens) = &lens {
                (perfect_px[i], slopes) = lens
                    .undistort_with_slopes(at)
                    .map_err(|source| CornersError::Lens { corner, source })?;
            }
            let own = [[sigma * sigma, 0.0], [0.0, sigma * sigma]];
            add_spread(&mut spread_px2[i], &slopes, &own);
        }
        Ok(Self {
            board,
            corners,
            lens,
            map: Homography::from_corners(&perfect_px, board.width_m, board.height_m)?,
            spread_px2,
        })
    }

    /// The board.
    #[must_use]
    pub const fn board(&self) -> &Board {
        &self.board
    }

    /// Its corners in the picture taken.
    #[must_use]
    pub const fn corners(&self) -> &Corners {
        &self.corners
    }

    /// The lens.
    #[must_use]
    pub const fn lens(&self) -> Option<&Lens> {
        self.lens.as_ref()
    }

    /// Place `[u_m, v_m]` right and down of the board's centre that is seen at the pixel `[x_px, y_px]`; none where the
    /// lens or the perspective has no such place.
    #[must_use]
    pub fn to_target(&self, pixel: [f64; 2]) -> Option<[f64; 2]> {
        self.map.to_target(self.perfect(pixel)?.0)
    }

    /// Pixel `[x_px, y_px]` at which a place `[u_m, v_m]` right and down of the board's centre is seen; none for a
    /// place behind the camera.
    #[must_use]
    pub fn to_pixels(&self, place_m: [f64; 2]) -> Option<[f64; 2]> {
        let perfect = self.map.to_pixels(place_m)?;
        Some(match &self.lens {
            Some(lens) => lens.distort(perfect),
            None => perfect,
        })
    }

    /// Derivative of [`to_target`](Self::to_target) at a pixel: rows u, v, columns x, y, in metres per pixel.
    #[must_use]
    pub fn target_slopes(&self, pixel: [f64; 2]) -> Option<[[f64; 2]; 2]> {
        let (perfect, bend) = self.perfect(pixel)?;
        let slopes = self.map.target_slopes(perfect)?;
        Some(product(&slopes, &bend))
    }

    /// Side of the square on the board with the area that one pixel covers there \[m\].
    #[must_use]
    pub fn metres_per_px(&self, pixel: [f64; 2]) -> Option<f64> {
        let [[a, b], [c, d]] = self.target_slopes(pixel)?;
        Some((a * d - b * c).abs().sqrt())
    }

    /// Pixel of the board's centre: the crossing of its diagonals (T/GRLM 02-2014, A.1). With a lens, of the diagonals
    /// in a perfect lens's picture.
    #[must_use]
    pub fn centre_px(&self) -> Option<[f64; 2]> {
        self.to_pixels([0.0, 0.0])
    }

    /// Covariance \[m²\] that the corners' uncertainty gives the place seen at a pixel, the pixel itself taken as exact:
    /// the sum over corners of J Σ Jᵀ, with J the derivative of the place by the corner.
    #[must_use]
    pub fn covariance_m2(&self, pixel: [f64; 2]) -> Option<[[f64; 2]; 2]> {
        let (perfect, _) = self.perfect(pixel)?;
        let slopes = self.map.corner_slopes(perfect)?;
        let mut sum = [[0.0; 2]; 2];
        for (slope, spread) in slopes.iter().zip(&self.spread_px2) {
            add_spread(&mut sum, slope, spread);
        }
        Some(sum)
    }

    /// The pixel in a perfect lens's picture, and the derivative there.
    fn perfect(&self, pixel: [f64; 2]) -> Option<([f64; 2], [[f64; 2]; 2])> {
        match &self.lens {
            Some(lens) => lens.undistort_with_slopes(pixel).ok(),
            None => Some((pixel, [[1.0, 0.0], [0.0, 1.0]])),
        }
    }
}

fn product(a: &[[f64; 2]; 2], b: &[[f64; 2]; 2]) -> [[f64; 2]; 2] {
    a.map(|[p, q]| [p * b[0][0] + q * b[1][0], p * b[0][1] + q * b[1][1]])
}

/// Adds J Σ Jᵀ.
fn add_spread(sum: &mut [[f64; 2]; 2], slopes: &[[f64; 2]; 2], spread: &[[f64; 2]; 2]) {
    let half = product(slopes, spread);
    for (row, [p, q]) in sum.iter_mut().zip(half) {
        for (value, [a, b]) in row.iter_mut().zip(slopes) {
            *value += p * a + q * b;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const BOARD: Board = Board {
        width_m: 8.6252,
        height_m: 7.2105,
        marks: Marks::TwoPanelUpper,
    };
    const SEEN: [[f64; 2]; 4] = [
        [133.84, 444.41],
        [1303.88, 407.10],
        [1329.95, 1367.16],
        [161.62, 1402.31],
    ];

    fn lens() -> Lens {
        Lens::new(LensValues {
            fx_px: 2710.0,
            fy_px: 2704.0,
            cx_px: 756.0,
            cy_px: 1344.0,
            k1: -0.18,
            k2: 0.22,
            p1: 8e-4,
            p2: 1e-3,
            k3: 0.0,
        })
        .unwrap()
    }

    /// Standard normal numbers by splitmix64 and the polar method.
    struct Normal(u64);

    impl Normal {
        fn unit(&mut self) -> f64 {
            self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
            let mut z = self.0;
            z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
            z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
            ((z ^ (z >> 31)) >> 11) as f64 / (1_u64 << 53) as f64
        }

        fn next(&mut self) -> f64 {
            loop {
                let [x, y] = [0, 1].map(|_| 2.0 * self.unit() - 1.0);
                let s = x * x + y * y;
                if s < 1.0 && s > 0.0 {
                    return x * (-2.0 * s.ln() / s).sqrt();
                }
            }
        }
    }

    #[test]
    fn marks_are_no_better_known_than_they_were_surveyed() {
        let exact = Corners::given(SEEN, 0.0);
        let plane = Plane::new(BOARD, exact.with_survey(&BOARD, 0.02), None).unwrap();
        for corner in SEEN {
            let [[uu, _], [_, vv]] = plane.covariance_m2(corner).unwrap();
            for variance in [uu, vv] {
                assert!((variance.sqrt() / 0.02 - 1.0).abs() < 0.1, "{variance}");
            }
        }
        let both = Corners::given(SEEN, 3.0).with_survey(&BOARD, 0.02).sigma_px;
        let alone = exact.with_survey(&BOARD, 0.02).sigma_px;
        for (both, alone) in both.into_iter().zip(alone) {
            assert!((both - alone.hypot(3.0)).abs() < 1e-12);
        }
    }

    #[test]
    fn covariance_is_that_of_moved_corners() {
        let corners = Corners {
            sigma_px: [0.3, 0.5, 0.2, 1.0],
            ..Corners::given(SEEN, 0.0)
        };
        for lens in [None, Some(lens())] {
            let plane = Plane::new(BOARD, corners, lens).unwrap();
            for pixel in [
                [731.0, 905.0],
                [200.0, 480.0],
                [1310.0, 1000.0],
                [160.0, 1500.0],
            ] {
                let found = plane.covariance_m2(pixel).unwrap();
                let at = plane.to_target(pixel).unwrap();
                let mut normal = Normal(7);
                let draws = 20_000;
                let mut sum = [[0.0; 2]; 2];
                for _ in 0..draws {
                    let mut moved = corners;
                    for (p, sigma) in moved.at_px.iter_mut().zip(corners.sigma_px) {
                        *p = p.map(|c| c + sigma * normal.next());
                    }
                    let moved = Plane::new(BOARD, moved, lens).unwrap();
                    let there = moved.to_target(pixel).unwrap();
                    let d = [there[0] - at[0], there[1] - at[1]];
                    for i in 0..2 {
                        for k in 0..2 {
                            sum[i][k] += d[i] * d[k] / f64::from(draws);
                        }
                    }
                }
                // A variance of 20,000 draws is known to 1 %; 5 of those.
                for i in 0..2 {
                    for k in 0..2 {
                        let size = (found[i][i] * found[k][k]).sqrt();
                        let off = (sum[i][k] - found[i][k]).abs() / size;
                        assert!(off < 0.05, "{pixel:?} {off}: {found:?} {sum:?}");
                    }
                }
            }
        }
    }

    #[test]
    fn lens_and_board_go_there_and_back() {
        let plane = Plane::new(BOARD, Corners::given(SEEN, 0.1), Some(lens())).unwrap();
        for (at, wanted) in SEEN
            .iter()
            .zip([[-0.5, -0.5], [0.5, -0.5], [0.5, 0.5], [-0.5, 0.5]])
        {
            let place = plane.to_target(*at).unwrap();
            assert!((place[0] - wanted[0] * BOARD.width_m).abs() < 1e-11);
            assert!((place[1] - wanted[1] * BOARD.height_m).abs() < 1e-11);
        }
        for i in 0..=10 {
            for k in 0..=10 {
                let pixel = [150.0 + 110.0 * f64::from(i), 450.0 + 90.0 * f64::from(k)];
                let place = plane.to_target(pixel).unwrap();
                let back = plane.to_pixels(place).unwrap();
                assert!((back[0] - pixel[0]).abs() < 1e-8 && (back[1] - pixel[1]).abs() < 1e-8);
                // Slopes by differences.
                let slopes = plane.target_slopes(pixel).unwrap();
                for c in 0..2 {
                    let mut ends = [pixel, pixel];
                    ends[0][c] -= 0.1;
                    ends[1][c] += 0.1;
                    let [a, b] = ends.map(|p| plane.to_target(p).unwrap());
                    for r in 0..2 {
                        assert!(((b[r] - a[r]) / 0.2 - slopes[r][c]).abs() < 1e-9);
                    }
                }
                let area = slopes[0][0] * slopes[1][1] - slopes[0][1] * slopes[1][0];
                assert!((plane.metres_per_px(pixel).unwrap().powi(2) - area).abs() < 1e-12);
            }
        }
    }

    #[test]
    fn centre_is_where_the_diagonals_cross() {
        let plane = Plane::new(BOARD, Corners::given(SEEN, 0.1), None).unwrap();
        let centre = plane.centre_px().unwrap();
        let crossing = diagonals_cross(&SEEN).unwrap();
        assert!((centre[0] - crossing[0]).abs() < 1e-9);
        assert!((centre[1] - crossing[1]).abs() < 1e-9);
        assert_eq!(
            diagonals_cross(&[[0.0, 0.0], [0.0, 1.0], [1.0, 1.0], [1.0, 2.0]]),
            None
        );
    }

    #[test]
    fn bad_uncertainty_is_refused() {
        for bad in [-1.0, f64::NAN, f64::INFINITY] {
            let corners = Corners {
                sigma_px: [0.1, 0.1, bad, 0.1],
                ..Corners::given(SEEN, 0.1)
            };
            assert_eq!(
                Plane::new(BOARD, corners, None),
                Err(CornersError::NotFinite {
                    corner: Corner::LowerRight
                })
            );
        }
    }
}
