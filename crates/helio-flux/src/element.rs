//! Flat pieces of mirror: what deformed meshes and canted facets become before they are traced.

use crate::error::FluxError;
use crate::vector::{Vector, add, cross, dot, is_finite, norm, scale, sub};

/// A flat piece of mirror: a triangle or a quadrilateral that reflects on one side.
///
/// Its corners run counterclockwise as seen from the reflecting side. Points in metres, in the one
/// right-handed frame of the scene. A quadrilateral whose corners are not quite in a plane (as of a bent
/// mesh) counts as the flat piece of the same vector area through the mean of its corners.
///
/// ```
/// use helio_flux::Element;
/// // A square of 2 m that faces up.
/// let corners_m = [[0.0, 0.0, 0.0], [2.0, 0.0, 0.0], [2.0, 2.0, 0.0], [0.0, 2.0, 0.0]];
/// let element = Element::quadrilateral(corners_m)?;
/// assert_eq!(element.normal(), [0.0, 0.0, 1.0]);
/// assert_eq!(element.centroid_m(), [1.0, 1.0, 0.0]);
/// assert_eq!(element.area_m2(), 4.0);
/// # Ok::<(), helio_flux::FluxError>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Element {
    corners_m: [Vector; 4],
    corner_count: u8,
    centroid_m: Vector,
    normal: Vector,
    area_m2: f64,
    reflectivity: f64,
    mirror: u32,
}

/// An area below this part of the squared extent is none: what rounding leaves of three points on a
/// line is some 1e-16 of it, a sliver of a real mesh above 1e-6.
const LEAST_RELATIVE_AREA: f64 = 1e-12;

impl Element {
    /// A triangle with reflectivity 1, of mirror 0.
    ///
    /// # Errors
    /// [`FluxError::BadCorner`] for a corner that is not finite, [`FluxError::NoArea`] if the corners
    /// span none.
    pub fn triangle(corners_m: [[f64; 3]; 3]) -> Result<Self, FluxError> {
        let [a, b, c] = corners_m;
        Self::new([a, b, c, c], 3)
    }

    /// A quadrilateral with reflectivity 1, of mirror 0.
    ///
    /// # Errors
    /// As [`triangle`](Self::triangle).
    pub fn quadrilateral(corners_m: [[f64; 3]; 4]) -> Result<Self, FluxError> {
        Self::new(corners_m, 4)
    }

    fn new(corners_m: [Vector; 4], corner_count: u8) -> Result<Self, FluxError> {
        for (corner, &at) in corners_m.iter().enumerate() {
            if !is_finite(at) {
                return Err(FluxError::BadCorner { corner, at });
            }
        }
        let [a, b, c, d] = corners_m;
        // Vector area ½ (c - a) × (d - b): of a triangle too, whose d is c. Yan 2022 eq. (3) gives the
        // direction from three corners and eq. (4) the area of two triangles.
        let area = scale(cross(sub(c, a), sub(d, b)), 0.5);
        let area_m2 = norm(area);
        let mut extent_m = 0.0_f64;
        for (k, &from) in corners_m.iter().enumerate() {
            for &to in &corners_m[k + 1..] {
                extent_m = extent_m.max(norm(sub(to, from)));
            }
        }
        if !(area_m2.is_finite() && area_m2 > LEAST_RELATIVE_AREA * extent_m * extent_m) {
            return Err(FluxError::NoArea { area_m2, extent_m });
        }
        // Yan 2022 eq. (2)
        let count = usize::from(corner_count);
        let sum = corners_m[1..count].iter().fold(a, |sum, &p| add(sum, p));
        Ok(Self {
            corners_m,
            corner_count,
            centroid_m: scale(sum, 1.0 / f64::from(corner_count)),
            normal: scale(area, 1.0 / area_m2),
            area_m2,
            reflectivity: 1.0,
            mirror: 0,
        })
    }

    /// The same piece with another reflectivity, the part of the light that is reflected.
    ///
    /// # Errors
    /// [`FluxError::BadValue`] unless it lies in 0..=1.
    pub fn with_reflectivity(self, reflectivity: f64) -> Result<Self, FluxError> {
        if !(0.0..=1.0).contains(&reflectivity) {
            return Err(FluxError::BadValue {
                who: "element",
                what: "reflectivity",
                wanted: "within 0..=1",
                value: reflectivity,
            });
        }
        Ok(Self {
            reflectivity,
            ..self
        })
    }

    /// The same piece as a part of another mirror.
    #[must_use]
    pub const fn with_mirror(self, mirror: u32) -> Self {
        Self { mirror, ..self }
    }

    /// The corners \[m\], three or four.
    #[must_use]
    pub fn corners_m(&self) -> &[[f64; 3]] {
        &self.corners_m[..usize::from(self.corner_count)]
    }

    /// Mean of the corners \[m\] (Yan 2022 eq. 2).
    #[must_use]
    pub const fn centroid_m(&self) -> [f64; 3] {
        self.centroid_m
    }

    /// Unit vector square to the piece, out of its reflecting side.
    #[must_use]
    pub const fn normal(&self) -> [f64; 3] {
        self.normal
    }

    /// Area \[m²\].
    #[must_use]
    pub const fn area_m2(&self) -> f64 {
        self.area_m2
    }

    /// The part of the light that is reflected, in 0..=1.
    #[must_use]
    pub const fn reflectivity(&self) -> f64 {
        self.reflectivity
    }

    /// Which mirror it is a piece of: pieces of one mirror neither shade nor block each other.
    #[must_use]
    pub const fn mirror(&self) -> u32 {
        self.mirror
    }

    /// Area across the light of a sun in direction `sun` (unit vector to it) \[m²\]; zero where the sun
    /// stands behind (Yan 2022 eq. 4: A cos(phi2), with the sun vector reversed).
    ///
    /// ```
    /// use helio_flux::Element;
    /// let element = Element::triangle([[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])?;
    /// assert_eq!(element.aperture_m2([0.0, 0.6, 0.8]), 0.4);
    /// assert_eq!(element.aperture_m2([0.0, 0.6, -0.8]), 0.0);
    /// # Ok::<(), helio_flux::FluxError>(())
    /// ```
    #[must_use]
    pub fn aperture_m2(&self, sun: [f64; 3]) -> f64 {
        (self.area_m2 * dot(self.normal, sun)).max(0.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    // A bent quadrilateral: vector area is the mean of those of both ways to cut it into triangles.
    #[test]
    fn the_vector_area_of_a_bent_quadrilateral_is_that_of_its_triangles() {
        let [a, b, c, d] = [
            [0.0, 0.0, 0.0],
            [1.0, 0.1, 0.0],
            [1.1, 1.2, 0.3],
            [0.0, 1.0, 0.0],
        ];
        let quad = Element::quadrilateral([a, b, c, d]).unwrap();
        let vector_area = |p: &Element| scale(p.normal(), p.area_m2());
        let triangle = |p| vector_area(&Element::triangle(p).unwrap());
        for sum in [
            add(triangle([a, b, c]), triangle([a, c, d])),
            add(triangle([a, b, d]), triangle([b, c, d])),
        ] {
            assert!(norm(sub(sum, vector_area(&quad))) < 1e-15);
        }
        assert!((norm(quad.normal()) - 1.0).abs() < 1e-15);
    }

    #[test]
    fn what_has_no_area_is_refused_by_name() {
        let on_a_line = [[0.0, 0.0, 0.0], [1.0, 1.0, 1.0], [3.0, 3.0, 3.0]];
        let error = Element::triangle(on_a_line).unwrap_err();
        assert!(matches!(error, FluxError::NoArea { .. }), "{error}");
        let error = Element::triangle([[1.0; 3]; 3]).unwrap_err();
        assert!(matches!(error, FluxError::NoArea { .. }), "{error}");
        let error = Element::triangle([[0.0; 3], [f64::NAN, 0.0, 1.0], [1.0; 3]]).unwrap_err();
        let text = "element: corner 1 (counted from 0) must be finite, got (NaN, 0, 1)";
        assert_eq!(error.to_string(), text);
        let good = Element::triangle([[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]).unwrap();
        for bad in [-0.1, 1.1, f64::NAN] {
            let error = good.with_reflectivity(bad).unwrap_err();
            assert!(matches!(error, FluxError::BadValue { .. }), "{error}");
        }
    }
}
