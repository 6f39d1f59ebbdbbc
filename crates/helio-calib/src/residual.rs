//! What a fit makes small: spots, and, to get near, normals.

use crate::aiming::wanted_normal;
use crate::fit::{Constraint, ResidualForm};
use crate::measures::observed_spot;
use crate::model::{Landing, Pose, landing, normal};
use crate::observation::Sighting;
use crate::parameters::COUNT;
use crate::solver::{LeastSquares, System};

/// Rounding error of a residual over the length of the way to the spot.
const ROUNDING: f64 = 4.0 * f64::EPSILON;

/// Sum of ((x - mean)/sigma)² of the priors.
pub(crate) fn prior_sum(constraints: &[Constraint; COUNT], values: &[f64; COUNT]) -> f64 {
    let mut sum = 0.0;
    for (constraint, value) in constraints.iter().zip(values) {
        if let Constraint::Prior { mean, sigma } = constraint {
            let residual = (value - mean) / sigma;
            sum += residual * residual;
        }
    }
    sum
}

/// Writes the priors' rows from `row` on.
pub(crate) fn prior_rows(
    constraints: &[Constraint; COUNT],
    values: &[f64; COUNT],
    mut row: usize,
    system: &mut System,
) {
    for (k, constraint) in constraints.iter().enumerate() {
        if let Constraint::Prior { mean, sigma } = constraint {
            let mut slopes = [0.0; COUNT];
            slopes[k] = 1.0;
            system.set(row, values[k] - mean, &slopes, sigma.recip());
            row += 1;
        }
    }
}

/// How many parameters have a prior.
pub(crate) fn priors(constraints: &[Constraint; COUNT]) -> usize {
    constraints
        .iter()
        .filter(|c| matches!(c, Constraint::Prior { .. }))
        .count()
}

/// Which parameters are not held.
pub(crate) fn columns(constraints: &[Constraint; COUNT]) -> Vec<usize> {
    (0..COUNT)
        .filter(|&k| constraints[k] != Constraint::Held)
        .collect()
}

/// Predicted less observed spots.
pub(crate) struct Spots<'a> {
    pub sightings: &'a [Sighting<f64>],
    /// What multiplies the residual of each: 1/sigma times the root of its robust weight; 0 leaves it out.
    pub factors: Vec<f64>,
    pub form: ResidualForm,
    pub constraints: &'a [Constraint; COUNT],
}

impl Spots<'_> {
    pub fn system(&self) -> System {
        let each = match self.form {
            ResidualForm::Components | ResidualForm::Beam => 2,
            ResidualForm::Distance => 1,
        };
        let rows = each * self.sightings.len() + priors(self.constraints);
        System::new(rows, columns(self.constraints))
    }

    /// A residual as the form sees it.
    fn seen(&self, sighting: &Sighting<f64>, [du, dv]: [f64; 2]) -> [f64; 2] {
        match self.form {
            ResidualForm::Beam => sighting.across_beam().map(|[u, v]| u * du + v * dv),
            ResidualForm::Components | ResidualForm::Distance => [du, dv],
        }
    }

    /// [`seen`](Self::seen), with the derivatives.
    fn turned(
        &self,
        sighting: &Sighting<f64>,
        land: &Landing<f64>,
    ) -> ([f64; 2], [[f64; COUNT]; 2]) {
        let slopes = match self.form {
            ResidualForm::Beam => {
                let [right, down] = &land.slopes;
                sighting
                    .across_beam()
                    .map(|[u, v]| core::array::from_fn(|k| u * right[k] + v * down[k]))
            }
            ResidualForm::Components | ResidualForm::Distance => land.slopes,
        };
        (self.seen(sighting, land.residual_m), slopes)
    }

    fn used(&self) -> impl Iterator<Item = (usize, &Sighting<f64>, f64)> {
        let pairs = self.sightings.iter().zip(&self.factors);
        pairs
            .enumerate()
            .map(|(i, (sighting, &factor))| (i, sighting, factor))
    }
}

impl LeastSquares for Spots<'_> {
    fn sum(&self, values: &[f64; COUNT]) -> f64 {
        let pose = Pose::new(*values);
        let mut sum = 0.0;
        for (_, sighting, factor) in self.used() {
            if factor > 0.0 {
                let land = landing(&pose, sighting);
                if !land.hits() {
                    return f64::INFINITY;
                }
                let [du, dv] = self.seen(sighting, land.residual_m);
                sum += factor * factor * (du * du + dv * dv);
            }
        }
        sum + prior_sum(self.constraints, values)
    }

    fn linearise(&self, values: &[f64; COUNT], system: &mut System) -> f64 {
        let pose = Pose::new(*values);
        let mut sum = 0.0;
        for (i, sighting, factor) in self.used() {
            let (residual, slopes) = if factor > 0.0 {
                let land = landing(&pose, sighting);
                self.turned(sighting, &land)
            } else {
                ([0.0; 2], [[0.0; COUNT]; 2])
            };
            let [du, dv] = residual;
            sum += factor * factor * (du * du + dv * dv);
            match self.form {
                ResidualForm::Components | ResidualForm::Beam => {
                    system.set(2 * i, du, &slopes[0], factor);
                    system.set(2 * i + 1, dv, &slopes[1], factor);
                }
                ResidualForm::Distance => {
                    // df = (du d(du) + dv d(dv))/f has no value at f = 0; zero is as good as any there
                    let distance = libm::hypot(du, dv);
                    let per = if distance > 0.0 {
                        distance.recip()
                    } else {
                        0.0
                    };
                    let slope =
                        core::array::from_fn(|k| (du * slopes[0][k] + dv * slopes[1][k]) * per);
                    system.set(i, distance, &slope, factor);
                }
            }
        }
        let rows = system.residuals.len() - priors(self.constraints);
        prior_rows(self.constraints, values, rows, system);
        sum + prior_sum(self.constraints, values)
    }

    fn rounding(&self) -> f64 {
        let mut sum = 0.0;
        for (_, sighting, factor) in self.used() {
            let [u, v] = sighting.spot_m;
            let along = sighting.centre_along_normal_m;
            let error = factor * ROUNDING;
            sum += 2.0 * error * error * (u * u + v * v + along * along);
        }
        sum
    }
}

/// The mirror's normal less the one that would send the beam to the observed spot: defined everywhere, also
/// where a beam misses.
pub(crate) struct Normals<'a> {
    pub sightings: &'a [Sighting<f64>],
    /// The wanted normals.
    pub wanted: Vec<[f64; 3]>,
    /// What multiplies the residual of each, about that of its spot.
    pub factors: Vec<f64>,
    pub constraints: &'a [Constraint; COUNT],
}

impl<'a> Normals<'a> {
    /// With the normals that a mirror offset asks for.
    pub fn new(
        sightings: &'a [Sighting<f64>],
        constraints: &'a [Constraint; COUNT],
        mirror_offset_m: f64,
    ) -> Self {
        let mut wanted = Vec::with_capacity(sightings.len());
        let mut factors = Vec::with_capacity(sightings.len());
        for sighting in sightings {
            let spot = observed_spot(sighting);
            let way = libm::sqrt(spot.iter().map(|x| x * x).sum());
            let normal = wanted_normal(sighting.sun, spot, mirror_offset_m);
            // a beam turns twice as far as its mirror
            let usable = normal.is_some();
            factors.push(if usable {
                2.0 * way * sighting.weight
            } else {
                0.0
            });
            wanted.push(normal.unwrap_or(sighting.sun));
        }
        Self {
            sightings,
            wanted,
            factors,
            constraints,
        }
    }

    pub fn system(&self) -> System {
        let rows = 3 * self.sightings.len() + priors(self.constraints);
        System::new(rows, columns(self.constraints))
    }

    /// Length of each residual before its factor.
    pub fn lengths(&self, values: &[f64; COUNT]) -> Vec<f64> {
        let pose = Pose::new(*values);
        let pairs = self.sightings.iter().zip(&self.wanted);
        pairs
            .map(|(sighting, wanted)| {
                let n = normal(&pose, sighting).n;
                libm::sqrt(
                    (0..3)
                        .map(|k| (n[k] - wanted[k]) * (n[k] - wanted[k]))
                        .sum(),
                )
            })
            .collect()
    }
}

impl LeastSquares for Normals<'_> {
    fn sum(&self, values: &[f64; COUNT]) -> f64 {
        let mut sum = 0.0;
        for (length, factor) in self.lengths(values).iter().zip(&self.factors) {
            sum += factor * factor * length * length;
        }
        sum + prior_sum(self.constraints, values)
    }

    fn linearise(&self, values: &[f64; COUNT], system: &mut System) -> f64 {
        let pose = Pose::new(*values);
        for (i, sighting) in self.sightings.iter().enumerate() {
            let at = normal(&pose, sighting);
            for k in 0..3 {
                // the mirror offset turns no normal
                let slopes = core::array::from_fn(|p| if p < 6 { at.slopes[p][k] } else { 0.0 });
                let residual = at.n[k] - self.wanted[i][k];
                system.set(3 * i + k, residual, &slopes, self.factors[i]);
            }
        }
        prior_rows(self.constraints, values, 3 * self.sightings.len(), system);
        self.sum(values)
    }

    fn rounding(&self) -> f64 {
        let squares = self.factors.iter().map(|f| f * f).sum::<f64>();
        3.0 * ROUNDING * ROUNDING * squares
    }
}
