//! Distortion of the camera's lens, in OpenCV's model.

/// Beyond this residual, in units of the focal length, a point counts as not inverted.
const ACCEPTED: f64 = 1e-12;
/// Newton needs 3 to 6 steps in the middle of the picture; more than this happens only next to a fold.
const MAX_STEPS: usize = 60;

/// What is wrong with a lens or with a pixel seen through it.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum LensError {
    /// A number that no lens has.
    #[error("lens: {what} must be {wanted}, got {value}")]
    BadValue {
        /// Which one.
        what: &'static str,
        /// What it must be.
        wanted: &'static str,
        /// What was given.
        value: f64,
    },
    /// A pixel that no direction within the lens's one-to-one range is seen at.
    #[error(
        "lens: pixel ({x_px:.2}, {y_px:.2}) lies where the distortion given cannot be inverted"
    )]
    NotInvertible {
        /// To the right.
        x_px: f64,
        /// Down.
        y_px: f64,
    },
}

/// A camera with radial and tangential distortion: OpenCV's `k1 k2 p1 p2 k3`.
///
/// With x = (x_px - cx) / fx and y = (y_px - cy) / fy of the picture of a perfect lens and r² = x² + y²:
///
/// x' = x (1 + k1 r² + k2 r⁴ + k3 r⁶) + 2 p1 x y + p2 (r² + 2 x²)
/// y' = y (1 + k1 r² + k2 r⁴ + k3 r⁶) + p1 (r² + 2 y²) + 2 p2 x y
///
/// are the same of the picture taken. Source: OpenCV, module calib3d; Brown (1966).
///
/// ```
/// use helio_spot::{Lens, LensValues};
/// let lens = Lens::new(LensValues {
///     fx_px: 2710.0, fy_px: 2704.0, cx_px: 854.0, cy_px: 628.0, k1: -0.18, k2: 0.22,
///     ..LensValues::default()
/// })?;
/// let taken = lens.distort([1500.0, 100.0]);
/// let [x_px, y_px] = lens.undistort(taken)?;
/// assert!((x_px - 1500.0).abs() < 1e-8 && (y_px - 100.0).abs() < 1e-8);
/// # Ok::<(), helio_spot::LensError>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Lens {
    values: LensValues,
    /// The r² up to which r (1 + k1 r² + k2 r⁴ + k3 r⁶) grows with r.
    square_limit: f64,
}

/// The numbers of a [`Lens`].
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct LensValues {
    /// Focal length over the width of a pixel.
    pub fx_px: f64,
    /// Focal length over the height of a pixel.
    pub fy_px: f64,
    /// Principal point, to the right.
    pub cx_px: f64,
    /// Principal point, down.
    pub cy_px: f64,
    /// Radial, r².
    pub k1: f64,
    /// Radial, r⁴.
    pub k2: f64,
    /// Tangential, down.
    pub p1: f64,
    /// Tangential, right.
    pub p2: f64,
    /// Radial, r⁶.
    pub k3: f64,
}

impl Lens {
    /// Of its numbers.
    ///
    /// # Errors
    /// [`LensError::BadValue`] for numbers that are not finite and focal lengths that are not positive.
    pub fn new(values: LensValues) -> Result<Self, LensError> {
        for (what, value) in [("fx_px", values.fx_px), ("fy_px", values.fy_px)] {
            if !(value.is_finite() && value > 0.0) {
                return Err(LensError::BadValue {
                    what,
                    wanted: "a number above 0",
                    value,
                });
            }
        }
        for (what, value) in [
            ("cx_px", values.cx_px),
            ("cy_px", values.cy_px),
            ("k1", values.k1),
            ("k2", values.k2),
            ("p1", values.p1),
            ("p2", values.p2),
            ("k3", values.k3),
        ] {
            if !value.is_finite() {
                return Err(LensError::BadValue {
                    what,
                    wanted: "a number",
                    value,
                });
            }
        }
        Ok(Self {
            values,
            square_limit: growth_limit(3.0 * values.k1, 5.0 * values.k2, 7.0 * values.k3),
        })
    }

    /// Its numbers.
    #[must_use]
    pub const fn values(&self) -> &LensValues {
        &self.values
    }

    /// Where in the picture taken a point `[x_px, y_px]` of the perfect lens's picture lies.
    ///
    /// The formula is evaluated wherever it is asked for, also beyond its one-to-one range.
    #[must_use]
    pub fn distort(&self, perfect_px: [f64; 2]) -> [f64; 2] {
        let (taken, _) = self.bend(self.reduced(perfect_px));
        self.pixels(taken)
    }

    /// Where in a perfect lens's picture a point `[x_px, y_px]` of the picture taken would lie.
    ///
    /// # Errors
    /// [`LensError::NotInvertible`] where the model folds before it reaches the pixel.
    pub fn undistort(&self, taken_px: [f64; 2]) -> Result<[f64; 2], LensError> {
        Ok(self.undistort_with_slopes(taken_px)?.0)
    }

    /// As [`undistort`](Self::undistort), with the derivative of the perfect position by the taken one.
    ///
    /// # Errors
    /// As [`undistort`](Self::undistort).
    pub fn undistort_with_slopes(
        &self,
        taken_px: [f64; 2],
    ) -> Result<([f64; 2], [[f64; 2]; 2]), LensError> {
        let wanted = self.reduced(taken_px);
        let refused = LensError::NotInvertible {
            x_px: taken_px[0],
            y_px: taken_px[1],
        };
        if !(wanted[0].is_finite() && wanted[1].is_finite()) {
            return Err(refused);
        }
        // Start at the point itself, or inside the one-to-one disc on the way to it.
        let square = wanted[0] * wanted[0] + wanted[1] * wanted[1];
        let shrink = (0.9 * self.square_limit / square).sqrt().min(1.0);
        let mut at = [shrink * wanted[0], shrink * wanted[1]];
        let (mut left, mut slopes) = self.left_over(at, wanted);
        for _ in 0..MAX_STEPS {
            let [[a, b], [c, d]] = slopes;
            let det = a * d - b * c;
            let step = [
                (d * left[0] - b * left[1]) / det,
                (a * left[1] - c * left[0]) / det,
            ];
            // Halve the step until it stays on the disc and brings the point nearer.
            let mut scale = 1.0;
            let mut better = None;
            while scale > 1e-6 {
                let next = [at[0] + scale * step[0], at[1] + scale * step[1]];
                if next[0] * next[0] + next[1] * next[1] < self.square_limit {
                    let (next_left, next_slopes) = self.left_over(next, wanted);
                    if size(next_left) < size(left) && determinant(next_slopes) > 0.0 {
                        better = Some((next, next_left, next_slopes));
                        break;
                    }
                }
                scale *= 0.5;
            }
            match better {
                Some(next) => (at, left, slopes) = next,
                None => break,
            }
        }
        let det = determinant(slopes);
        if !(size(left) <= ACCEPTED && det > 0.0) {
            return Err(refused);
        }
        let [[a, b], [c, d]] = slopes;
        let stretch = self.values.fx_px / self.values.fy_px;
        let inverse = [[d / det, -b / det * stretch], [-c / det / stretch, a / det]];
        Ok((self.pixels(at), inverse))
    }

    fn left_over(&self, at: [f64; 2], wanted: [f64; 2]) -> ([f64; 2], [[f64; 2]; 2]) {
        let (taken, slopes) = self.bend(at);
        ([wanted[0] - taken[0], wanted[1] - taken[1]], slopes)
    }

    fn reduced(&self, [x_px, y_px]: [f64; 2]) -> [f64; 2] {
        let v = &self.values;
        [(x_px - v.cx_px) / v.fx_px, (y_px - v.cy_px) / v.fy_px]
    }

    fn pixels(&self, [x, y]: [f64; 2]) -> [f64; 2] {
        let v = &self.values;
        [v.fx_px * x + v.cx_px, v.fy_px * y + v.cy_px]
    }

    /// The model and its derivative, in units of the focal length.
    fn bend(&self, [x, y]: [f64; 2]) -> ([f64; 2], [[f64; 2]; 2]) {
        let LensValues {
            k1, k2, k3, p1, p2, ..
        } = self.values;
        let r2 = x * x + y * y;
        let radial = 1.0 + r2 * (k1 + r2 * (k2 + r2 * k3));
        let growth = 2.0 * (k1 + r2 * (2.0 * k2 + r2 * 3.0 * k3));
        let across = x * y * growth + 2.0 * (p1 * x + p2 * y);
        (
            [
                x * radial + 2.0 * p1 * x * y + p2 * (r2 + 2.0 * x * x),
                y * radial + p1 * (r2 + 2.0 * y * y) + 2.0 * p2 * x * y,
            ],
            [
                [
                    radial + x * x * growth + 2.0 * p1 * y + 6.0 * p2 * x,
                    across,
                ],
                [
                    across,
                    radial + y * y * growth + 6.0 * p1 * y + 2.0 * p2 * x,
                ],
            ],
        )
    }
}

fn size(v: [f64; 2]) -> f64 {
    v[0].abs().max(v[1].abs())
}

fn determinant([[a, b], [c, d]]: [[f64; 2]; 2]) -> f64 {
    a * d - b * c
}

/// Smallest positive root of 1 + a s + b s² + c s³; infinite where there is none.
fn growth_limit(a: f64, b: f64, c: f64) -> f64 {
    let value = |s: f64| 1.0 + s * (a + s * (b + s * c));
    // Between the turning points the cubic is monotone, so that a change of sign is a root.
    let mut turns = [f64::INFINITY; 2];
    let half = b * b - 3.0 * a * c;
    if half >= 0.0 {
        // Roots of a + 2 b s + 3 c s² without cancellation.
        let q = -(b + half.sqrt().copysign(b));
        turns = [q / (3.0 * c), a / q];
    }
    turns.sort_by(f64::total_cmp);
    let mut low = 0.0;
    for turn in turns {
        if turn.is_finite() && turn > low {
            if value(turn) <= 0.0 {
                return bisect(value, low, turn);
            }
            low = turn;
        }
    }
    let mut high = low.max(1.0) * 2.0;
    while high < 1e12 {
        if value(high) <= 0.0 {
            return bisect(value, low, high);
        }
        high *= 2.0;
    }
    f64::INFINITY
}

fn bisect(value: impl Fn(f64) -> f64, mut low: f64, mut high: f64) -> f64 {
    for _ in 0..200 {
        let middle = 0.5 * (low + high);
        if middle <= low || middle >= high {
            break;
        }
        if value(middle) > 0.0 {
            low = middle;
        } else {
            high = middle;
        }
    }
    low
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn lens(k1: f64, k2: f64, p1: f64, p2: f64, k3: f64) -> Lens {
        Lens::new(LensValues {
            fx_px: 2710.0,
            fy_px: 2690.0,
            cx_px: 1340.0,
            cy_px: 760.0,
            k1,
            k2,
            p1,
            p2,
            k3,
        })
        .unwrap()
    }

    /// The formula in 40 digits (mpmath), written there from OpenCV's documentation.
    #[test]
    fn distort_equals_forty_digits() {
        let lens = Lens::new(LensValues {
            fx_px: 2709.982927489918,
            fy_px: 2704.1333701532612,
            cx_px: 853.7358760164032,
            cy_px: 628.0310932763621,
            k1: -0.17764057631159896,
            k2: 0.2191071319361339,
            p1: 0.0007862158118110876,
            p2: 0.0010005962910328151,
            k3: -0.03,
        })
        .unwrap();
        for (perfect, taken) in [
            ([0.0, 0.0], REFERENCE[0]),
            ([1625.0, 3.5], REFERENCE[1]),
            ([400.25, 1235.0], REFERENCE[2]),
        ] {
            let found = lens.distort(perfect);
            for k in 0..2 {
                assert!((found[k] - taken[k]).abs() < 1e-12 * 2000.0, "{found:?}");
            }
        }
    }
    const REFERENCE: [[f64; 2]; 3] = [
        [20.199_789_997_484_773, 14.879_623_695_215_925],
        [1_610.111_730_137_219_4, 16.136_349_598_643_39],
        [406.164_870_253_545_36, 1_227.534_364_567_023],
    ];

    #[test]
    fn limit_is_the_first_fold() {
        // 1 - 3 s/10: s = 10/3
        assert!((growth_limit(-0.3, 0.0, 0.0) - 10.0 / 3.0).abs() < 1e-14);
        // (1 - s)(1 - s/2)(1 - s/4): 1, 2 and 4
        let (a, b, c) = (-1.75, 0.875, -0.125);
        assert!((growth_limit(a, b, c) - 1.0).abs() < 1e-12);
        assert_eq!(growth_limit(0.0, 0.0, 0.0), f64::INFINITY);
        assert_eq!(growth_limit(0.4, 0.1, 0.2), f64::INFINITY);
        // 1 + s - s³: 1.324717957244746 (the plastic number)
        assert!((growth_limit(1.0, 0.0, -1.0) - 1.324_717_957_244_746).abs() < 1e-14);
    }

    #[test]
    fn beyond_the_fold_is_refused_by_name() {
        // r (1 - r²/3) never exceeds 2/3, at r = 1.
        let lens = lens(-1.0 / 3.0, 0.0, 0.0, 0.0, 0.0);
        let at = |r: f64| [1340.0 + 2710.0 * r, 760.0];
        assert!(lens.undistort(at(0.66)).is_ok());
        assert!(matches!(
            lens.undistort(at(0.67)),
            Err(LensError::NotInvertible { .. })
        ));
        assert!(lens.undistort([f64::NAN, 0.0]).is_err());
        assert!(lens.undistort([f64::INFINITY, 0.0]).is_err());
    }

    #[test]
    fn bad_numbers_are_refused_by_name() {
        let good = *lens(0.0, 0.0, 0.0, 0.0, 0.0).values();
        for (what, values) in [
            ("fx_px", LensValues { fx_px: 0.0, ..good }),
            (
                "fy_px",
                LensValues {
                    fy_px: f64::NAN,
                    ..good
                },
            ),
            (
                "k3",
                LensValues {
                    k3: f64::INFINITY,
                    ..good
                },
            ),
        ] {
            let error = Lens::new(values).unwrap_err();
            assert!(error.to_string().contains(what), "{error}");
        }
    }

    proptest! {
        #[test]
        fn undistort_undoes_distort(
            k1 in -0.3..0.3, k2 in -0.1..0.1, p1 in -0.003..0.003, p2 in -0.003..0.003,
            k3 in -0.03..0.03, x in -0.45..0.45, y in -0.3..0.3,
        ) {
            let lens = lens(k1, k2, p1, p2, k3);
            let perfect = [1340.0 + 2710.0 * x, 760.0 + 2690.0 * y];
            let (found, slopes) = lens.undistort_with_slopes(lens.distort(perfect)).unwrap();
            // 1e-12 focal lengths, times how much the inverse magnifies
            let bound = 2710.0 * 4e-12;
            prop_assert!((found[0] - perfect[0]).abs() < bound, "{found:?} {perfect:?}");
            prop_assert!((found[1] - perfect[1]).abs() < bound);
            // The slopes by differences.
            let h = 0.01;
            for k in 0..2 {
                let mut moved = [lens.distort(perfect), lens.distort(perfect)];
                moved[0][k] -= h;
                moved[1][k] += h;
                let a = lens.undistort(moved[0]).unwrap();
                let b = lens.undistort(moved[1]).unwrap();
                for i in 0..2 {
                    let slope = (b[i] - a[i]) / (2.0 * h);
                    prop_assert!((slope - slopes[i][k]).abs() < 1e-6, "{slope} {slopes:?}");
                }
            }
        }
    }
}
