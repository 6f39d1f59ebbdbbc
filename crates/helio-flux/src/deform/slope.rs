//! Slope errors: how far the load turns the normals.

use super::Deformed;
use super::error::DeformError;
use crate::vector::{cross, dot, norm, scale, sub, unit};

/// Slope errors of a deformed mirror, one row per face; NaN where the face has no loaded piece.
///
/// The total is the angle between the normals without and with the load (Yan 2022 eq. 5, by the arc
/// tangent, which keeps small angles). By axis it is the lean of the loaded normal, as seen along the
/// ideal piece: with unit vectors e1 (the given axis laid into the ideal piece's plane) and e2 = N × e1,
/// tan θ1 = N′·e1 / N′·N and tan θ2 = N′·e2 / N′·N, positive where the normal leans toward the axis. So
/// tan² θ = tan² θ1 + tan² θ2.
///
/// Means are weighted by the area of the piece without load; where areas differ little between elements,
/// the plain mean over them is nearly the same.
#[derive(Debug, Clone, PartialEq)]
pub struct SlopeErrors {
    element_ids: Vec<u64>,
    area_m2: Vec<f64>,
    total_rad: Vec<f64>,
    first_rad: Vec<f64>,
    second_rad: Vec<f64>,
    moved_m: Vec<f64>,
}

/// The largest value and the element it belongs to.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Extreme {
    /// The value, with its sign.
    pub value: f64,
    /// Row of the face.
    pub row: usize,
    /// Number of the element.
    pub element: u64,
}

impl SlopeErrors {
    /// Slope errors in total and along two axes: `axis` (of any length) laid into each piece, and the one
    /// across it.
    ///
    /// # Errors
    /// [`DeformError::BadAxis`] for an axis without a direction or within 1e-6 of the normal of a piece.
    pub fn new(deformed: &Deformed, axis: [f64; 3]) -> Result<Self, DeformError> {
        let bad = |why: String| DeformError::BadAxis { axis, why };
        let unit_axis = unit(axis).ok_or_else(|| bad("which has no direction".to_owned()))?;
        let count = deformed.ideal.len();
        let mut out = Self {
            element_ids: deformed.element_ids.clone(),
            area_m2: Vec::with_capacity(count),
            total_rad: Vec::with_capacity(count),
            first_rad: Vec::with_capacity(count),
            second_rad: Vec::with_capacity(count),
            moved_m: Vec::with_capacity(count),
        };
        for (row, (ideal, loaded)) in deformed.ideal.iter().zip(&deformed.loaded).enumerate() {
            let n = ideal.normal();
            let in_plane = sub(unit_axis, scale(n, dot(unit_axis, n)));
            let Some(first) = unit(in_plane).filter(|_| norm(in_plane) > 1e-6) else {
                let element = deformed.element_ids[row];
                return Err(bad(format!("which is along that of element {element}")));
            };
            let second = cross(n, first);
            out.area_m2.push(ideal.area_m2());
            let Some(loaded) = loaded else {
                for column in [
                    &mut out.total_rad,
                    &mut out.first_rad,
                    &mut out.second_rad,
                    &mut out.moved_m,
                ] {
                    column.push(f64::NAN);
                }
                continue;
            };
            let turned = loaded.normal();
            let along = dot(turned, n);
            // Yan 2022 eq. (5)
            out.total_rad
                .push(libm::atan2(norm(cross(n, turned)), along));
            out.first_rad.push(libm::atan2(dot(turned, first), along));
            out.second_rad.push(libm::atan2(dot(turned, second), along));
            let by_m = sub(loaded.centroid_m(), ideal.centroid_m());
            out.moved_m.push(norm(by_m));
        }
        Ok(out)
    }

    /// Numbers of the elements.
    #[must_use]
    pub fn element_ids(&self) -> &[u64] {
        &self.element_ids
    }

    /// Areas without load \[m²\], the weights of the means.
    #[must_use]
    pub fn area_m2(&self) -> &[f64] {
        &self.area_m2
    }

    /// Angle between the normals without and with the load \[rad\], in [0, π].
    #[must_use]
    pub fn total_rad(&self) -> &[f64] {
        &self.total_rad
    }

    /// Lean toward the axis \[rad\].
    #[must_use]
    pub fn first_rad(&self) -> &[f64] {
        &self.first_rad
    }

    /// Lean toward the normal's cross product with the axis \[rad\].
    #[must_use]
    pub fn second_rad(&self) -> &[f64] {
        &self.second_rad
    }

    /// How far the centroid moved \[m\] (the position error of Yan 2022 §2.3).
    #[must_use]
    pub fn moved_m(&self) -> &[f64] {
        &self.moved_m
    }

    /// Root mean square of the total, by area \[rad\]; NaN without any usable row.
    #[must_use]
    pub fn rms_rad(&self) -> f64 {
        self.rms(&self.total_rad)
    }

    /// Root mean square along the axis, by area \[rad\].
    #[must_use]
    pub fn rms_first_rad(&self) -> f64 {
        self.rms(&self.first_rad)
    }

    /// Root mean square across the axis, by area \[rad\].
    #[must_use]
    pub fn rms_second_rad(&self) -> f64 {
        self.rms(&self.second_rad)
    }

    /// The largest total and its element; `None` without any usable row.
    #[must_use]
    pub fn max(&self) -> Option<Extreme> {
        self.extreme(&self.total_rad)
    }

    /// The lean along the axis of largest magnitude, with its sign.
    #[must_use]
    pub fn max_first(&self) -> Option<Extreme> {
        self.extreme(&self.first_rad)
    }

    /// The lean across the axis of largest magnitude, with its sign.
    #[must_use]
    pub fn max_second(&self) -> Option<Extreme> {
        self.extreme(&self.second_rad)
    }

    /// The largest move of a centroid.
    #[must_use]
    pub fn max_moved(&self) -> Option<Extreme> {
        self.extreme(&self.moved_m)
    }

    fn rms(&self, column: &[f64]) -> f64 {
        let (mut sum, mut weight) = (0.0, 0.0);
        for (&value, &area) in column.iter().zip(&self.area_m2) {
            if !value.is_nan() {
                sum += area * value * value;
                weight += area;
            }
        }
        (sum / weight).sqrt()
    }

    fn extreme(&self, column: &[f64]) -> Option<Extreme> {
        let mut best: Option<Extreme> = None;
        for (row, &value) in column.iter().enumerate() {
            let beats = best.is_none_or(|best| value.abs() > best.value.abs());
            if !value.is_nan() && beats {
                let element = self.element_ids[row];
                best = Some(Extreme {
                    value,
                    row,
                    element,
                });
            }
        }
        best
    }
}
