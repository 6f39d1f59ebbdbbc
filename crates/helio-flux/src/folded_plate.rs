//! The folded-plate concentrator of Yan 2022: flat strips, each of which lights the same flat receiver evenly.

use crate::element::Element;
use crate::error::FluxError;
use crate::vector::Vector;

/// A concentrator of flat strips on both sides of a flat receiver that faces down to them (Yan 2022 §3.1).
///
/// The rule: light parallel to the axis that falls on the edges of a strip is reflected to the edges of the receiver,
/// so that every strip lights the whole width evenly; each strip begins where the one before ends. The
/// profile lies in the x-z plane, with the axis along z through the middle of the receiver.
///
/// ```
/// use helio_flux::FoldedPlate;
/// // 150 mm from the axis, 200 mm wide, 1 m above, eight strips a side.
/// let plate = FoldedPlate::new(0.15, 0.2, 1.0, 8)?;
/// assert!((plate.mean_concentration() - 11.326).abs() < 5e-4); // the paper: 11.33
/// # Ok::<(), helio_flux::FluxError>(())
/// ```
#[derive(Debug, Clone, PartialEq)]
pub struct FoldedPlate {
    receiver_width_m: f64,
    receiver_height_m: f64,
    edges_m: Vec<[f64; 2]>,
}

impl FoldedPlate {
    /// A concentrator whose innermost strip begins at `start_m` from the axis, at height 0.
    ///
    /// # Errors
    /// [`FluxError::BadValue`] if a length is not above 0, there are no strips or more than 1000, or so many that
    /// they rise to the receiver.
    pub fn new(
        start_m: f64,
        receiver_width_m: f64,
        receiver_height_m: f64,
        strips: usize,
    ) -> Result<Self, FluxError> {
        let bad = |what, wanted, value| FluxError::BadValue {
            who: "folded plate",
            what,
            wanted,
            value,
        };
        for (what, value) in [
            ("start_m", start_m),
            ("receiver_width_m", receiver_width_m),
            ("receiver_height_m", receiver_height_m),
        ] {
            if !(value.is_finite() && value > 0.0) {
                return Err(bad(what, "above 0 m", value));
            }
        }
        if !(1..=1000).contains(&strips) {
            return Err(bad("strips", "within 1..=1000", strips as f64));
        }
        let half_m = 0.5 * receiver_width_m;
        let mut edges_m = vec![[start_m, 0.0]];
        let [mut x, mut z] = [start_m, 0.0];
        for _ in 0..strips {
            // Light along the axis at (x, z) leaves at twice the tilt, for the far edge of the receiver.
            let tan_two_tilts = (x + half_m) / (receiver_height_m - z);
            let tilt = libm::tan(0.5 * libm::atan(tan_two_tilts));
            // The outer edge: x' - (height - z') tan(2 tilt) = half, z' = z + (x' - x) tan(tilt).
            let to = (half_m + (receiver_height_m - z + x * tilt) * tan_two_tilts)
                / (1.0 + tilt * tan_two_tilts);
            z += (to - x) * tilt;
            x = to;
            if z >= receiver_height_m {
                let wanted = "so few that they stay below the receiver";
                return Err(bad("strips", wanted, strips as f64));
            }
            edges_m.push([x, z]);
        }
        Ok(Self {
            receiver_width_m,
            receiver_height_m,
            edges_m,
        })
    }

    /// Edges of the strips on the side of positive x, from the innermost: distance from the axis and height \[m\].
    #[must_use]
    pub fn edges_m(&self) -> &[[f64; 2]] {
        &self.edges_m
    }

    /// Concentration by one strip: its width across the light over that of the receiver. Strips count from 0 at
    /// the axis.
    ///
    /// # Panics
    /// If there is no such strip.
    #[must_use]
    pub fn strip_concentration(&self, strip: usize) -> f64 {
        let [inner, outer] = [self.edges_m[strip][0], self.edges_m[strip + 1][0]];
        (outer - inner) / self.receiver_width_m
    }

    /// Concentration by all strips of both sides.
    #[must_use]
    pub fn mean_concentration(&self) -> f64 {
        let [inner, outer] = [self.edges_m[0][0], self.edges_m[self.edges_m.len() - 1][0]];
        2.0 * (outer - inner) / self.receiver_width_m
    }

    /// Width and height of the receiver \[m\].
    #[must_use]
    pub const fn receiver_m(&self) -> [f64; 2] {
        [self.receiver_width_m, self.receiver_height_m]
    }

    /// The strips of both sides as elements of a length along y, centred; each strip is a mirror of its own,
    /// first those of positive x from the innermost, then those of negative x.
    ///
    /// # Errors
    /// [`FluxError::BadValue`] unless `length_m` is above 0.
    pub fn elements(&self, length_m: f64) -> Result<Vec<Element>, FluxError> {
        if !(length_m.is_finite() && length_m > 0.0) {
            return Err(FluxError::BadValue {
                who: "folded plate",
                what: "length_m",
                wanted: "above 0 m",
                value: length_m,
            });
        }
        let half = 0.5 * length_m;
        let mut elements = Vec::new();
        for side in [1.0, -1.0] {
            for strip in self.edges_m.windows(2) {
                let corner = |k: usize, y: f64| -> Vector { [side * strip[k][0], y, strip[k][1]] };
                // counterclockwise from above
                let corners = [
                    corner(0, -side * half),
                    corner(1, -side * half),
                    corner(1, side * half),
                    corner(0, side * half),
                ];
                let mirror = elements.len() as u32;
                elements.push(Element::quadrilateral(corners)?.with_mirror(mirror));
            }
        }
        Ok(elements)
    }
}
