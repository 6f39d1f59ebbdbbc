//! From a camera's gray values to irradiance, with one reading of a heat-flux gauge (Yan 2022 §3.2).

use crate::error::FluxError;

const WHO: &str = "gauge";

fn bad(what: &'static str, wanted: &'static str, value: f64) -> FluxError {
    FluxError::BadValue {
        who: WHO,
        what,
        wanted,
        value,
    }
}

/// Direct irradiance on a plane that faces the sun \[W/m²\]: what a gauge reads in the open, less what it reads with
/// the sun's disc shaded from it.
///
/// ```
/// use helio_flux::gauge::direct_w_m2;
/// assert_eq!(direct_w_m2(1007.0, 185.0)?, 822.0); // the paper's afternoon
/// assert!(direct_w_m2(185.0, 1007.0).is_err());
/// # Ok::<(), helio_flux::FluxError>(())
/// ```
///
/// # Errors
/// [`FluxError::BadValue`] if a reading is negative or not finite, or the diffuse one exceeds the global one.
pub fn direct_w_m2(global_w_m2: f64, diffuse_w_m2: f64) -> Result<f64, FluxError> {
    for (what, value) in [("global_w_m2", global_w_m2), ("diffuse_w_m2", diffuse_w_m2)] {
        if !(value.is_finite() && value >= 0.0) {
            return Err(bad(what, "at least 0 W/m², and finite", value));
        }
    }
    if diffuse_w_m2 > global_w_m2 {
        let wanted = "at most the global irradiance";
        return Err(bad("diffuse_w_m2", wanted, diffuse_w_m2));
    }
    Ok(global_w_m2 - diffuse_w_m2)
}

/// Gray values of a picture, row by row from the top; whatever a camera counts in.
#[derive(Debug, Clone, Copy)]
pub struct GrayView<'a, T> {
    rows: usize,
    columns: usize,
    gray: &'a [T],
}

impl<'a, T: Copy + Into<f64>> GrayView<'a, T> {
    /// A picture of at least one pixel.
    ///
    /// # Errors
    /// [`FluxError::WrongSize`] if there are not as many values as pixels, or none.
    pub fn new(rows: usize, columns: usize, gray: &'a [T]) -> Result<Self, FluxError> {
        let wanted = rows.saturating_mul(columns);
        if wanted == 0 || gray.len() != wanted {
            return Err(FluxError::WrongSize {
                rows,
                columns,
                found: gray.len(),
            });
        }
        Ok(Self {
            rows,
            columns,
            gray,
        })
    }

    /// Rows.
    #[must_use]
    pub const fn rows(&self) -> usize {
        self.rows
    }

    /// Columns.
    #[must_use]
    pub const fn columns(&self) -> usize {
        self.columns
    }

    fn at(&self, row: usize, column: usize) -> f64 {
        self.gray[row * self.columns + column].into()
    }
}

/// A gauge's reading, and where in the picture its sensor was.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Reading {
    /// Row of the sensor's middle; whole numbers are middles of pixels.
    pub row_px: f64,
    /// Column of the sensor's middle.
    pub column_px: f64,
    /// Radius of the sensor \[pixels\]: gray is averaged over pixels whose middles lie within; the nearest pixel
    /// always counts.
    pub radius_px: f64,
    /// What it read \[W/m²\].
    pub flux_w_m2: f64,
}

/// What gray values mean: irradiance = scale · (gray - dark).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct GrayScale {
    /// Irradiance of one gray value \[W/m²\].
    pub w_m2_per_gray: f64,
    /// Gray value without light.
    pub dark_gray: f64,
    /// Gray value from which on a pixel is full, and tells only that there was more.
    pub full_gray: f64,
}

/// A picture in W/m².
#[derive(Debug, Clone, PartialEq)]
pub struct FluxImage {
    /// Irradiance of the pixels \[W/m²\], row by row.
    pub irradiance_w_m2: Vec<f64>,
    /// Pixels that were full: theirs is at least what stands there.
    pub full: usize,
}

impl GrayScale {
    /// The scale of a picture by one reading.
    ///
    /// `dark_gray` is what the camera gives without light; `full_gray` the greatest value it can give.
    ///
    /// ```
    /// use helio_flux::gauge::{GrayScale, GrayView, Reading};
    /// let gray: Vec<u8> = vec![10, 60, 110, 60];
    /// let view = GrayView::new(1, 4, &gray)?;
    /// let reading = Reading { row_px: 0.0, column_px: 2.0, radius_px: 0.0, flux_w_m2: 4174.0 };
    /// let scale = GrayScale::by_reading(&view, &reading, 10.0, 255.0)?;
    /// assert_eq!(scale.apply(&view).irradiance_w_m2, [0.0, 2087.0, 4174.0, 2087.0]);
    /// # Ok::<(), helio_flux::FluxError>(())
    /// ```
    ///
    /// # Errors
    /// [`FluxError::BadValue`] if the sensor lies outside the picture, its reading is not above 0, one of its pixels
    /// is full, or it is no lighter than the dark.
    pub fn by_reading<T: Copy + Into<f64>>(
        view: &GrayView<'_, T>,
        reading: &Reading,
        dark_gray: f64,
        full_gray: f64,
    ) -> Result<Self, FluxError> {
        let inside = |at: f64, count: usize| at >= -0.5 && at < count as f64 - 0.5;
        if !inside(reading.row_px, view.rows) {
            return Err(bad("row_px", "within the picture", reading.row_px));
        }
        if !inside(reading.column_px, view.columns) {
            return Err(bad("column_px", "within the picture", reading.column_px));
        }
        if !(reading.radius_px >= 0.0 && reading.radius_px.is_finite()) {
            return Err(bad("radius_px", "at least 0 pixels", reading.radius_px));
        }
        if !(reading.flux_w_m2 > 0.0 && reading.flux_w_m2.is_finite()) {
            return Err(bad("flux_w_m2", "above 0 W/m²", reading.flux_w_m2));
        }
        if !(dark_gray.is_finite() && full_gray > dark_gray) {
            return Err(bad("full_gray", "above dark_gray", full_gray));
        }
        let nearest = (
            reading.row_px.round().max(0.0) as usize,
            reading.column_px.round().max(0.0) as usize,
        );
        let (mut sum, mut count) = (0.0, 0.0);
        let reach = |middle: f64, count: usize| {
            let low = (middle - reading.radius_px).floor().max(0.0) as usize;
            let high = (middle + reading.radius_px).ceil().max(0.0) as usize;
            low..=high.min(count - 1)
        };
        for row in reach(reading.row_px, view.rows) {
            for column in reach(reading.column_px, view.columns) {
                let (dy, dx) = (
                    row as f64 - reading.row_px,
                    column as f64 - reading.column_px,
                );
                let within = dx * dx + dy * dy <= reading.radius_px * reading.radius_px;
                if !(within || (row, column) == nearest) {
                    continue;
                }
                let gray = view.at(row, column);
                if gray >= full_gray {
                    let wanted = "below full_gray in every pixel of the sensor";
                    return Err(bad("gray", wanted, gray));
                }
                sum += gray;
                count += 1.0;
            }
        }
        let lighter = sum / count - dark_gray;
        if lighter.is_nan() || lighter <= 0.0 {
            return Err(bad("gray at the sensor", "above dark_gray", sum / count));
        }
        Ok(Self {
            w_m2_per_gray: reading.flux_w_m2 / lighter,
            dark_gray,
            full_gray,
        })
    }

    /// A picture in W/m²; what is darker than the dark is 0.
    #[must_use]
    pub fn apply<T: Copy + Into<f64>>(&self, view: &GrayView<'_, T>) -> FluxImage {
        let mut full = 0;
        let flux = |&gray: &T| {
            let gray: f64 = gray.into();
            full += usize::from(gray >= self.full_gray);
            self.w_m2_per_gray * (gray - self.dark_gray).max(0.0)
        };
        FluxImage {
            irradiance_w_m2: view.gray.iter().map(flux).collect(),
            full,
        }
    }
}

/// How alike two views of an evenly lit target are: a Lambertian one looks the same from everywhere.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LambertianCheck {
    /// Difference of the mean gray values, over their mean.
    pub of_means: f64,
    /// Greatest difference of a patch's gray values, over their mean.
    pub greatest: f64,
    /// Patches compared.
    pub patches: usize,
}

/// Differences of gray below which Yan 2022 §3.2 takes a paper for Lambertian.
pub const LAMBERTIAN: f64 = 0.025;

impl LambertianCheck {
    /// Compares two views, cut into `side` by `side` patches each, taken with one exposure. Each view must show the same
    /// part of the target, upright and filling the picture, but need not have as many pixels.
    ///
    /// Patches, since single pixels differ by noise: with 8 by 8 patches a picture of a hundred thousand pixels averages
    /// it away by a factor of forty.
    ///
    /// ```
    /// use helio_flux::gauge::{GrayView, LambertianCheck};
    /// let (front, side) = ([200_u8; 64], [196_u8; 16]);
    /// let (front, side) = (GrayView::new(8, 8, &front)?, GrayView::new(4, 4, &side)?);
    /// let check = LambertianCheck::of_views(&front, &side, 2, 0.0)?;
    /// assert!((check.greatest - 4.0 / 198.0).abs() < 1e-12 && check.passes());
    /// # Ok::<(), helio_flux::FluxError>(())
    /// ```
    ///
    /// # Errors
    /// [`FluxError::BadValue`] if there are more patches to a side than pixels, or none, or a patch is no lighter than
    /// `dark_gray`.
    pub fn of_views<T: Copy + Into<f64>, U: Copy + Into<f64>>(
        first: &GrayView<'_, T>,
        second: &GrayView<'_, U>,
        side: usize,
        dark_gray: f64,
    ) -> Result<Self, FluxError> {
        let most = [first.rows, first.columns, second.rows, second.columns];
        let most = most.into_iter().fold(usize::MAX, usize::min);
        if !(1..=most).contains(&side) {
            return Err(bad("side", "within 1..= the pixels of a side", side as f64));
        }
        let (a, b) = (patches(first, side), patches(second, side));
        let difference = |x: f64, y: f64| -> Result<f64, FluxError> {
            let mean = 0.5 * (x + y) - dark_gray;
            if mean.is_nan() || mean <= 0.0 {
                return Err(bad("gray of a patch", "above dark_gray", 0.5 * (x + y)));
            }
            Ok((x - y).abs() / mean)
        };
        let mut greatest = 0.0_f64;
        for (&x, &y) in a.iter().zip(&b) {
            greatest = greatest.max(difference(x, y)?);
        }
        let mean = |values: &[f64]| values.iter().sum::<f64>() / values.len() as f64;
        Ok(Self {
            of_means: difference(mean(&a), mean(&b))?,
            greatest,
            patches: a.len(),
        })
    }

    /// True if every patch differs by less than the paper's 2.5 %.
    #[must_use]
    pub fn passes(&self) -> bool {
        self.greatest < LAMBERTIAN
    }
}

/// Means of side x side patches.
fn patches<T: Copy + Into<f64>>(view: &GrayView<'_, T>, side: usize) -> Vec<f64> {
    let edge = |k: usize, count: usize| k * count / side;
    let mut out = Vec::with_capacity(side * side);
    for j in 0..side {
        for i in 0..side {
            let rows = edge(j, view.rows)..edge(j + 1, view.rows);
            let columns = edge(i, view.columns)..edge(i + 1, view.columns);
            let count = (rows.len() * columns.len()) as f64;
            let sum: f64 = rows
                .flat_map(|row| columns.clone().map(move |column| (row, column)))
                .map(|(row, column)| view.at(row, column))
                .sum();
            out.push(sum / count);
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Gray of a flux map as a camera sees it: linear, with a dark level, in whole numbers.
    fn picture(flux: &[f64], w_m2_per_gray: f64) -> Vec<u16> {
        flux.iter()
            .map(|f| (64.0 + f / w_m2_per_gray).round() as u16)
            .collect()
    }

    // A map made into a picture and back: the paper's two readings, 4174 and 3642 W/m².
    #[test]
    fn a_picture_of_a_map_is_that_map() {
        for reading_w_m2 in [4174.0, 3642.0] {
            let flux: Vec<f64> = (0..40 * 60)
                .map(|k| {
                    let (row, column) = (f64::from(k / 60) - 19.5, f64::from(k % 60) - 29.5);
                    reading_w_m2 * (-(row * row + column * column) / 300.0).exp()
                })
                .collect();
            let gray = picture(&flux, 0.1);
            let view = GrayView::new(40, 60, &gray).unwrap();
            let reading = Reading {
                row_px: 19.5,
                column_px: 29.5,
                radius_px: 1.0,
                // the mean of the four pixels about the middle
                flux_w_m2: flux[19 * 60 + 29],
            };
            let scale = GrayScale::by_reading(&view, &reading, 64.0, 65535.0).unwrap();
            let image = scale.apply(&view);
            assert_eq!(image.full, 0);
            for (got, want) in image.irradiance_w_m2.iter().zip(&flux) {
                // half a gray value of 0.1 W/m² here, and half of one at the sensor
                assert!((got - want).abs() < 0.101, "{got} {want}");
            }
        }
    }

    #[test]
    fn sensors_that_tell_nothing_are_refused() {
        let gray: Vec<u8> = vec![5, 5, 255, 90];
        let view = GrayView::new(2, 2, &gray).unwrap();
        let reading = Reading {
            row_px: 1.0,
            column_px: 1.0,
            radius_px: 0.2,
            flux_w_m2: 100.0,
        };
        let said = |reading: &Reading, dark: f64| {
            GrayScale::by_reading(&view, reading, dark, 255.0)
                .unwrap_err()
                .to_string()
        };
        assert!(GrayScale::by_reading(&view, &reading, 5.0, 255.0).is_ok());
        let full = Reading {
            column_px: 0.0,
            ..reading
        };
        assert!(
            said(&full, 5.0).contains("below full_gray"),
            "{}",
            said(&full, 5.0)
        );
        let dark = Reading {
            row_px: 0.0,
            ..reading
        };
        assert!(said(&dark, 5.0).contains("gray at the sensor must be above dark_gray, got 5"));
        for outside in [-0.6, 1.5, f64::NAN] {
            let outside = Reading {
                row_px: outside,
                ..reading
            };
            assert!(said(&outside, 5.0).contains("row_px must be within the picture"));
        }
        assert!(
            said(
                &Reading {
                    flux_w_m2: 0.0,
                    ..reading
                },
                5.0
            )
            .contains("flux_w_m2")
        );
        assert!(
            said(
                &Reading {
                    radius_px: f64::NAN,
                    ..reading
                },
                5.0
            )
            .contains("radius_px")
        );
        let scale = GrayScale::by_reading(&view, &reading, 5.0, 255.0).unwrap();
        assert_eq!(scale.apply(&view).full, 1);
        let error = GrayView::new(2, 3, &gray).unwrap_err().to_string();
        assert_eq!(
            error,
            "a picture of 2 rows and 3 columns wants at least one pixel and as many gray values, found 4"
        );
        for (global, diffuse) in [(f64::NAN, 1.0), (1.0, f64::INFINITY), (-1.0, 0.0)] {
            assert!(direct_w_m2(global, diffuse).is_err());
        }
    }

    // A target that darkens by 3 % at a corner when seen from the side is none, though its mean hardly changes.
    #[test]
    fn one_dark_corner_is_found() {
        let front = vec![200.0; 80 * 80];
        let mut side = front.clone();
        let check = |side: &[f64]| {
            let (a, b) = (
                GrayView::new(80, 80, &front).unwrap(),
                GrayView::new(80, 80, side).unwrap(),
            );
            LambertianCheck::of_views(&a, &b, 8, 0.0).unwrap()
        };
        assert_eq!((check(&side).greatest, check(&side).passes()), (0.0, true));
        for row in 70..80 {
            side[row * 80..row * 80 + 10].fill(194.0);
        }
        let found = check(&side);
        assert!((found.greatest - 6.0 / 197.0).abs() < 1e-12, "{found:?}");
        assert!(
            (found.of_means - 6.0 / 64.0 / 199.953_125).abs() < 1e-12,
            "{found:?}"
        );
        assert!(!found.passes());
        let view = GrayView::new(80, 80, &front).unwrap();
        for side in [0, 81] {
            assert!(LambertianCheck::of_views(&view, &view, side, 0.0).is_err());
        }
        assert!(LambertianCheck::of_views(&view, &view, 8, 200.0).is_err());
    }
}
