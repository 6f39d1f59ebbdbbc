//! A receiver as numbers, to be kept and made again to the last bit.

use super::{Frustum, MeshReceiver, Plane, Receiver, bad};
use crate::error::FluxError;
use crate::vector::{Vector, norm, sub};

/// Directions that were unit vectors once are so still, to rounding.
const ROUNDING: f64 = 1e-12;
/// No grid is finer.
const MOST_BINS: f64 = 1e9;

impl Receiver {
    /// The word for its shape, and numbers from which [`from_numbers`](Self::from_numbers) makes the same receiver.
    ///
    /// ```
    /// use helio_flux::{Plane, Receiver};
    /// let plane = Plane::new([5.0, 0.0, 9.0], [0.1, 0.3, -1.0], [1.0, 0.0, 0.0], [2.0, 1.0], [1, 4])?;
    /// let receiver = Receiver::Plane(plane);
    /// let (shape, numbers) = receiver.numbers();
    /// assert_eq!(Receiver::from_numbers(shape, &numbers)?, receiver);
    /// # Ok::<(), helio_flux::FluxError>(())
    /// ```
    #[must_use]
    pub fn numbers(&self) -> (&'static str, Vec<f64>) {
        match self {
            Self::Plane(plane) => ("plane", plane.numbers()),
            Self::Frustum(round) => ("cone", round.numbers()),
            Self::Mesh(mesh) => {
                let corners = (0..mesh.triangles()).filter_map(|row| mesh.corners_m(row));
                ("mesh", corners.flatten().flatten().copied().collect())
            }
        }
    }

    /// The receiver of what [`numbers`](Self::numbers) gave.
    ///
    /// # Errors
    /// [`FluxError`] for a word that is none of those, numbers that are too few or too many, and those of no receiver.
    pub fn from_numbers(shape: &str, numbers: &[f64]) -> Result<Self, FluxError> {
        match shape {
            "plane" => Plane::from_numbers(numbers).map(Self::Plane),
            "cone" => Frustum::from_numbers(numbers).map(Self::Frustum),
            "mesh" => {
                let (points, rest) = numbers.as_chunks::<3>();
                let (triangles, more) = points.as_chunks::<3>();
                if !rest.is_empty() || !more.is_empty() {
                    return Err(length("mesh receiver", "nine for each triangle", numbers));
                }
                MeshReceiver::new(triangles).map(Self::Mesh)
            }
            _ => {
                let wanted = "that of a plane, cone or mesh";
                Err(bad("receiver", "shape", wanted, f64::NAN))
            }
        }
    }
}

fn length(who: &'static str, wanted: &'static str, numbers: &[f64]) -> FluxError {
    bad(who, "numbers", wanted, numbers.len() as f64)
}

fn grid(who: &'static str, counts: [f64; 2]) -> Result<[usize; 2], FluxError> {
    for count in counts {
        if !(count.fract() == 0.0 && (0.0..=MOST_BINS).contains(&count)) {
            return Err(bad(who, "grid", "whole numbers", count));
        }
    }
    Ok(counts.map(|count| count as usize))
}

/// That directions are what they would become, but for rounding.
fn close(who: &'static str, pairs: &[(Vector, Vector)]) -> Result<(), FluxError> {
    for &(found, wanted) in pairs {
        let apart = norm(sub(found, wanted));
        if apart.is_nan() || apart > ROUNDING {
            return Err(bad(who, "directions", "square unit vectors", apart));
        }
    }
    Ok(())
}

impl Plane {
    fn numbers(&self) -> Vec<f64> {
        let points = [self.centre_m, self.normal, self.right, self.down];
        let grid = [self.rows, self.columns].map(|count| count as f64);
        let size = [self.width_m, self.height_m];
        [points.as_flattened(), &size, &grid].concat()
    }

    fn from_numbers(numbers: &[f64]) -> Result<Self, FluxError> {
        const WHO: &str = "plane receiver";
        let (points, rest) = numbers.as_chunks::<3>();
        let (&[centre_m, normal, right, down, [width_m, height_m, rows]], &[columns]) =
            (points, rest)
        else {
            return Err(length(WHO, "sixteen", numbers));
        };
        let grid = grid(WHO, [rows, columns])?;
        let again = Self::new(centre_m, normal, right, [width_m, height_m], grid)?;
        let pairs = [
            (normal, again.normal),
            (right, again.right),
            (down, again.down),
        ];
        close(WHO, &pairs)?;
        Ok(Self {
            normal,
            right,
            down,
            ..again
        })
    }
}

impl Frustum {
    fn numbers(&self) -> Vec<f64> {
        let grid = [self.rows, self.columns].map(|count| count as f64);
        let sizes = [self.base_radius_m, self.end_radius_m, self.height_m];
        [&self.base_m, self.axes.as_flattened(), &sizes, &grid].concat()
    }

    fn from_numbers(numbers: &[f64]) -> Result<Self, FluxError> {
        const WHO: &str = "round receiver";
        let (points, rest) = numbers.as_chunks::<3>();
        let (
            &[
                base_m,
                zero,
                across,
                axis,
                [base_radius_m, end_radius_m, height_m],
            ],
            &[rows, columns],
        ) = (points, rest)
        else {
            return Err(length(WHO, "seventeen", numbers));
        };
        let grid = grid(WHO, [rows, columns])?;
        let radii_m = [base_radius_m, end_radius_m];
        let again = Self::cone(base_m, axis, zero, radii_m, height_m, grid)?;
        let axes = [zero, across, axis];
        close(WHO, &[0, 1, 2].map(|k| (axes[k], again.axes[k])))?;
        Ok(Self { axes, ..again })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn receivers() -> [Receiver; 4] {
        let (base, axis) = ([-8.0, -3.0, 100.0], [1.0, 0.4, 0.1]);
        let down = [0.01, 0.3, -1.0];
        let plane = Plane::new([1.0, 2.0, 3.0], down, [1.0, 0.2, 0.0], [2.0, 1.5], [3, 7]);
        let round = Frustum::cylinder(base, axis, down, 3.0, 12.0, [24, 48]);
        let cone = Frustum::cone(base, axis, down, [3.0, 0.0], 12.0, [2, 5]);
        let mesh = MeshReceiver::new(&[[[0.0; 3], [1.0, 0.1, 0.0], [0.0, 1.0, 0.3]]]);
        [
            Receiver::Plane(plane.unwrap()),
            Receiver::Frustum(round.unwrap()),
            Receiver::Frustum(cone.unwrap()),
            Receiver::Mesh(mesh.unwrap()),
        ]
    }

    #[test]
    fn numbers_make_the_same_receiver() {
        for receiver in receivers() {
            let (shape, numbers) = receiver.numbers();
            assert_eq!(Receiver::from_numbers(shape, &numbers), Ok(receiver));
        }
    }

    #[test]
    fn other_numbers_are_refused() {
        for receiver in receivers() {
            let (shape, numbers) = receiver.numbers();
            assert!(Receiver::from_numbers(shape, &numbers[1..]).is_err());
            for row in 0..numbers.len() {
                for value in [f64::NAN, f64::INFINITY] {
                    let mut wrong = numbers.clone();
                    wrong[row] = value;
                    assert!(
                        Receiver::from_numbers(shape, &wrong).is_err(),
                        "{shape} {row}"
                    );
                }
            }
            assert!(Receiver::from_numbers("dish", &numbers).is_err());
        }
        let (shape, mut numbers) = receivers()[0].numbers();
        numbers[4] += 1e-6;
        let refused = Receiver::from_numbers(shape, &numbers)
            .unwrap_err()
            .to_string();
        assert!(refused.contains("square unit vectors"), "{refused}");
    }
}
