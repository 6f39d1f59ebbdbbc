//! Light of a beam on the plane of the target.

use super::random::Draws;
use crate::error::SpotError;

/// A beam on the target: what it looks like, where its centre of mass lies, how bright it is.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Beam {
    /// How its light is spread.
    pub shape: BeamShape,
    /// Centre of mass of all its light, right of the target's centre \[m\]; may lie beyond the target.
    pub u_m: f64,
    /// Centre of mass of all its light, down of the target's centre \[m\].
    pub v_m: f64,
    /// What its brightest place adds to white fabric, in parts of what saturates the camera; more than 1
    /// for stray light that blinds it.
    pub peak: f64,
}

/// How the light of a beam is spread about its centre of mass.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum BeamShape {
    /// Round, of a standard deviation.
    Gaussian {
        /// Standard deviation \[m\].
        sigma_m: f64,
    },
    /// As an oblique or astigmatic heliostat makes it.
    Ellipse {
        /// Standard deviation along its first axis \[m\].
        along_m: f64,
        /// Standard deviation across it \[m\].
        across_m: f64,
        /// From the right towards down to its first axis \[rad\].
        angle_rad: f64,
    },
    /// A disc with a soft edge, as a flat mirror close by makes it: the light falls over its edge as the
    /// integral of a Gaussian does.
    FlatTop {
        /// Where half of the light is left \[m\].
        radius_m: f64,
        /// Standard deviation of the edge's softness \[m\].
        edge_m: f64,
    },
    /// Images of facets that do not quite meet: lopsided and with several tops.
    Facets {
        /// How many.
        count: u16,
        /// Standard deviation of each \[m\].
        sigma_m: f64,
        /// Standard deviation of their middles \[m\].
        spread_m: f64,
    },
}

/// Parts of a beam whose light is worth adding lie within so many standard deviations.
const REACH: f64 = 9.0;

/// A beam made ready to ask for its light.
#[derive(Debug, Clone)]
pub(super) struct Light {
    lobes: Vec<Lobe>,
    disc: Option<Disc>,
    /// Left, top, right, bottom of where it has light worth adding \[m\].
    pub(super) reach_m: [f64; 4],
}

/// A Gaussian.
#[derive(Debug, Clone, Copy)]
struct Lobe {
    u_m: f64,
    v_m: f64,
    peak: f64,
    /// Of the quadratic form: uu, 2 uv, vv \[1/m²\].
    form: [f64; 3],
}

#[derive(Debug, Clone, Copy)]
struct Disc {
    u_m: f64,
    v_m: f64,
    peak: f64,
    radius_m: f64,
    edge_m: f64,
}

impl Light {
    pub(super) fn new(beam: &Beam, draws: Draws) -> Result<Self, SpotError> {
        check_beam(beam)?;
        let Beam {
            shape,
            u_m,
            v_m,
            peak,
        } = *beam;
        let mut lobes = Vec::new();
        let mut disc = None;
        let reach_m = match shape {
            BeamShape::Gaussian { sigma_m } => {
                lobes.push(Lobe::round(u_m, v_m, sigma_m));
                REACH * sigma_m
            }
            BeamShape::Ellipse {
                along_m,
                across_m,
                angle_rad,
            } => {
                let (sine, cosine) = libm::sincos(angle_rad);
                let (a, b) = (1.0 / (along_m * along_m), 1.0 / (across_m * across_m));
                lobes.push(Lobe {
                    u_m,
                    v_m,
                    peak: 1.0,
                    form: [
                        a * cosine * cosine + b * sine * sine,
                        2.0 * (a - b) * sine * cosine,
                        a * sine * sine + b * cosine * cosine,
                    ],
                });
                REACH * along_m.max(across_m)
            }
            BeamShape::FlatTop { radius_m, edge_m } => {
                disc = Some(Disc {
                    u_m,
                    v_m,
                    peak,
                    radius_m,
                    edge_m,
                });
                radius_m + REACH * edge_m
            }
            BeamShape::Facets {
                count,
                sigma_m,
                spread_m,
            } => {
                lobes = facets(count, sigma_m, spread_m, draws);
                let farthest_m = lobes
                    .iter()
                    .map(|lobe| lobe.u_m.abs().max(lobe.v_m.abs()))
                    .fold(0.0, f64::max);
                for lobe in &mut lobes {
                    lobe.u_m += u_m;
                    lobe.v_m += v_m;
                }
                farthest_m + REACH * sigma_m
            }
        };
        let mut light = Self {
            lobes,
            disc,
            reach_m: [u_m - reach_m, v_m - reach_m, u_m + reach_m, v_m + reach_m],
        };
        // The tops of several lobes lie close to the middles of some of them.
        let top = light
            .lobes
            .iter()
            .map(|lobe| light.at(lobe.u_m, lobe.v_m))
            .fold(0.0, f64::max);
        for lobe in &mut light.lobes {
            lobe.peak *= peak / top;
        }
        Ok(light)
    }

    /// The light at a place of the plane \[parts of white\].
    pub(super) fn at(&self, u_m: f64, v_m: f64) -> f64 {
        let [left, top, right, bottom] = self.reach_m;
        if u_m < left || u_m > right || v_m < top || v_m > bottom {
            return 0.0;
        }
        let mut light = 0.0;
        for lobe in &self.lobes {
            let (du, dv) = (u_m - lobe.u_m, v_m - lobe.v_m);
            let [uu, uv, vv] = lobe.form;
            let q = uu * du * du + uv * du * dv + vv * dv * dv;
            if q < REACH * REACH {
                light += lobe.peak * libm::exp(-0.5 * q);
            }
        }
        if let Some(disc) = &self.disc {
            let (du, dv) = (u_m - disc.u_m, v_m - disc.v_m);
            let beyond = (libm::sqrt(du * du + dv * dv) - disc.radius_m) / disc.edge_m;
            light += disc.peak * 0.5 * libm::erfc(core::f64::consts::FRAC_1_SQRT_2 * beyond);
        }
        light
    }

    /// Light within a rectangle (left, top, right, bottom \[m\]) and its centre of mass: the midpoint rule on
    /// a grid that is fine against the beam.
    pub(super) fn within(&self, rectangle_m: [f64; 4]) -> Moments {
        const CELLS: usize = 400;
        let low = [0, 1].map(|k| rectangle_m[k].max(self.reach_m[k]));
        let high = [2, 3].map(|k| rectangle_m[k].min(self.reach_m[k]));
        let step = [0, 1].map(|k| (high[k] - low[k]) / CELLS as f64);
        if step[0] <= 0.0 || step[1] <= 0.0 {
            return Moments::default();
        }
        let place = |k: usize, i: usize| low[k] + (i as f64 + 0.5) * step[k];
        let mut sums = [0.0; 3];
        for row in 0..CELLS {
            let v_m = place(1, row);
            let mut of_row = [0.0; 2];
            for column in 0..CELLS {
                let u_m = place(0, column);
                let light = self.at(u_m, v_m);
                of_row[0] += light;
                of_row[1] += light * u_m;
            }
            sums[0] += of_row[0];
            sums[1] += of_row[1];
            sums[2] += of_row[0] * v_m;
        }
        if sums[0] <= 0.0 {
            return Moments::default();
        }
        Moments {
            power: sums[0] * step[0] * step[1],
            centre_m: Some([sums[1] / sums[0], sums[2] / sums[0]]),
        }
    }
}

/// Light and its centre of mass.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Moments {
    /// Parts of white times square metres.
    pub(super) power: f64,
    /// None where there is no light.
    pub(super) centre_m: Option<[f64; 2]>,
}

impl Lobe {
    fn round(u_m: f64, v_m: f64, sigma_m: f64) -> Self {
        let a = 1.0 / (sigma_m * sigma_m);
        Self {
            u_m,
            v_m,
            peak: 1.0,
            form: [a, 0.0, a],
        }
    }
}

/// Images of facets about their common centre of mass.
fn facets(count: u16, sigma_m: f64, spread_m: f64, draws: Draws) -> Vec<Lobe> {
    let mut lobes: Vec<Lobe> = (0..u64::from(count))
        .map(|i| {
            let [right, down] = draws.normal_pair(2 * i);
            Lobe {
                peak: 0.5 + draws.uniform(4 * i + 2),
                ..Lobe::round(spread_m * right, spread_m * down, sigma_m)
            }
        })
        .collect();
    // All are equally wide, so that their tops weigh as their light does.
    let sum = |of: fn(&Lobe) -> f64| lobes.iter().map(of).sum::<f64>();
    let weight = sum(|lobe| lobe.peak);
    let u_m = sum(|lobe| lobe.peak * lobe.u_m) / weight;
    let v_m = sum(|lobe| lobe.peak * lobe.v_m) / weight;
    for lobe in &mut lobes {
        lobe.u_m -= u_m;
        lobe.v_m -= v_m;
    }
    lobes
}

fn check_beam(beam: &Beam) -> Result<(), SpotError> {
    let option = |what, wanted, value| {
        Err(SpotError::BadOption {
            what,
            wanted,
            value,
        })
    };
    for (what, value) in [("u_m of a beam", beam.u_m), ("v_m of a beam", beam.v_m)] {
        if !(-1e4..=1e4).contains(&value) {
            return option(what, "at most 10 km from the target's centre", value);
        }
    }
    if !(0.0..=1e6).contains(&beam.peak) {
        return option("peak of a beam", "in 0..=1e6", beam.peak);
    }
    let sizes = match beam.shape {
        BeamShape::Gaussian { sigma_m } => [sigma_m, sigma_m],
        BeamShape::Ellipse {
            along_m,
            across_m,
            angle_rad,
        } => {
            if !angle_rad.is_finite() {
                return option("angle_rad of a beam", "finite", angle_rad);
            }
            [along_m, across_m]
        }
        BeamShape::FlatTop { radius_m, edge_m } => [radius_m, edge_m],
        BeamShape::Facets {
            count,
            sigma_m,
            spread_m,
        } => {
            if count == 0 || count > 1000 {
                return option("count of facets", "in 1..=1000", f64::from(count));
            }
            if !(0.0..=1e4).contains(&spread_m) {
                return option("spread_m of facets", "in 0..=1e4", spread_m);
            }
            [sigma_m, sigma_m]
        }
    };
    for size_m in sizes {
        if !(1e-4..=1e4).contains(&size_m) {
            return option("size of a beam", "in 1e-4..=1e4 metres", size_m);
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    use core::f64::consts::TAU;

    const ALL_M: [f64; 4] = [-1e3, -1e3, 1e3, 1e3];

    fn light(shape: BeamShape) -> Light {
        let beam = Beam {
            shape,
            u_m: 0.4,
            v_m: -0.7,
            peak: 0.5,
        };
        Light::new(&beam, Draws::new(1, 9)).unwrap()
    }

    // Power of a Gaussian: 2π σ₁σ₂ times its peak; of a soft disc: π (R² + s²) times it.
    #[test]
    fn the_centre_of_mass_is_where_it_was_put() {
        let shapes = [
            (
                BeamShape::Gaussian { sigma_m: 0.5 },
                Some(TAU * 0.5 * 0.5 * 0.5),
            ),
            (
                BeamShape::Ellipse {
                    along_m: 1.0,
                    across_m: 0.25,
                    angle_rad: 0.6,
                },
                Some(TAU * 0.5 * 0.5 * 0.5),
            ),
            (
                BeamShape::FlatTop {
                    radius_m: 1.0,
                    edge_m: 0.1,
                },
                Some(1.586_504_3),
            ),
            (
                BeamShape::Facets {
                    count: 12,
                    sigma_m: 0.2,
                    spread_m: 0.3,
                },
                None,
            ),
        ];
        for (shape, power) in shapes {
            let moments = light(shape).within(ALL_M);
            let [u_m, v_m] = moments.centre_m.unwrap();
            assert!(
                (u_m - 0.4).abs() < 1e-9 && (v_m + 0.7).abs() < 1e-9,
                "{shape:?}"
            );
            if let Some(power) = power {
                assert!(
                    (moments.power - power).abs() < 2e-7,
                    "{shape:?} {}",
                    moments.power
                );
            }
        }
    }

    // A normal distribution cut at its mean: the mean of the half is σ sqrt(2/π) off.
    #[test]
    fn a_cut_beam_has_the_centre_of_what_is_left() {
        let moments = light(BeamShape::Gaussian { sigma_m: 0.5 }).within([-9.0, -9.0, 0.4, 9.0]);
        let [u_m, v_m] = moments.centre_m.unwrap();
        assert!((u_m - (0.4 - 0.398_942_28)).abs() < 1e-5, "{u_m}");
        assert!((v_m + 0.7).abs() < 1e-9);
        assert!(
            light(BeamShape::Gaussian { sigma_m: 0.5 })
                .within([7.0, 0.0, 8.0, 1.0])
                .centre_m
                .is_none()
        );
    }

    #[test]
    fn senseless_beams_are_refused() {
        let good = Beam {
            shape: BeamShape::Gaussian { sigma_m: 0.5 },
            u_m: 0.0,
            v_m: 0.0,
            peak: 1.0,
        };
        let bad = [
            Beam {
                u_m: f64::NAN,
                ..good
            },
            Beam { peak: -1.0, ..good },
            Beam {
                shape: BeamShape::Gaussian { sigma_m: 0.0 },
                ..good
            },
            Beam {
                shape: BeamShape::Facets {
                    count: 0,
                    sigma_m: 1.0,
                    spread_m: 1.0,
                },
                ..good
            },
        ];
        for beam in bad {
            assert!(Light::new(&beam, Draws::new(0, 0)).is_err(), "{beam:?}");
        }
    }
}
