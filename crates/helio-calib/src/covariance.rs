//! How well the parameters are known.

use faer::Mat;

use crate::error::CalibrationError;
use crate::fit::{Fit, FitOptions, check};
use crate::measures::{angle_rad, beam};
use crate::model::{Pose, landing};
use crate::observation::{Mount, Observation, Sighting};
use crate::parameters::{COUNT, Parameter, Parameters};
use crate::residual::Spots;
use crate::solver::{LeastSquares, RANK_TOLERANCE, System};

/// Standard deviations from which a tilt has an azimuth.
const TILT_SIGMAS: f64 = 5.0;

/// How well a fit knows its parameters.
///
/// Everything comes from the singular values of the Jacobian J of both components at the optimum, its columns
/// scaled to unit length, rows weighted as in the fit and the priors' rows below. A fit of distances has the
/// same minimum and so the same uncertainty: its own Jacobian knows only half of it.
///
/// Where the observations do not determine a combination of parameters, its variance is finite and enormous
/// (the singular value is taken as 1e-11 of the largest), and `rank` says so.
#[derive(Debug, Clone, PartialEq)]
pub struct Uncertainty {
    /// The parameters that were not held.
    pub free: Vec<Parameter>,
    /// Covariance in the order of [`Parameter::ALL`] \[rad², rad m, m²\]; zero for held parameters.
    ///
    /// sigma² (JᵀJ)⁻¹, with priors counted at the sigma they state.
    pub covariance: [[f64; COUNT]; COUNT],
    /// Square roots of its diagonal \[rad, m\].
    pub standard_errors: [f64; COUNT],
    /// Covariance over both standard errors; zero for held parameters.
    pub correlation: [[f64; COUNT]; COUNT],
    /// Residual components less parameters; what priors determine is not taken off.
    pub degrees_of_freedom: usize,
    /// One standard deviation of a residual component over its stated sigma (metres where none is stated),
    /// sqrt(S/degrees of freedom); infinite where no freedom is left. With a robust loss, the standard
    /// deviation of errors that would make the parameters as uncertain with plain squares.
    pub sigma: f64,
    /// S where every observation states a sigma: about `degrees_of_freedom` if the sigmas are right.
    pub chi_square: Option<f64>,
    /// Of the Jacobian with scaled columns, falling.
    pub singular_values: Vec<f64>,
    /// How many combinations of parameters the observations determine.
    pub rank: usize,
    /// Largest over smallest singular value.
    pub condition: f64,
    /// The worst-determined combination of parameters: a unit vector in \[rad, m\], its largest entry positive.
    pub weakest: [f64; COUNT],
    /// How far each observation's beam moves when that observation is left out \[mrad\], to first order;
    /// infinite where it alone determines something, zero where it has no weight.
    pub influence_mrad: Vec<f64>,
    /// What each observation determines itself: trace of its block of the hat matrix, 0 to 2.
    pub leverage: Vec<f64>,
}

/// Uncertainty of a fit's parameters.
///
/// # Errors
/// As [`fit`](crate::fit()); and if the fit is not one of these observations.
pub fn uncertainty(
    mount: &Mount,
    observations: &[Observation],
    fit: &Fit,
    options: &FitOptions,
) -> Result<Uncertainty, CalibrationError> {
    check(observations, options)?;
    if fit.weights.len() != observations.len() {
        return Err(CalibrationError::BadOption {
            what: "observations of the fit",
            wanted: "as many as those given",
            value: fit.weights.len() as f64,
        });
    }
    let sightings: Vec<_> = observations
        .iter()
        .map(|observation| Sighting::new(mount, observation))
        .collect();
    let values = fit.parameters.values;
    let pose = Pose::new(values);
    // weight 0 leaves a record out, as a miss does
    let weights: Vec<f64> = sightings
        .iter()
        .zip(&fit.weights)
        .map(|(sighting, &weight)| {
            if landing(&pose, sighting).hits() {
                weight
            } else {
                0.0
            }
        })
        .collect();
    let spots = Spots {
        sightings: &sightings,
        factors: sightings
            .iter()
            .zip(&weights)
            .map(|(sighting, weight)| sighting.weight * libm::sqrt(*weight))
            .collect(),
        form: options.residual.of_components(),
        constraints: &options.constraints,
    };
    let mut system = spots.system();
    spots.linearise(&values, &mut system);
    let decomposed = Decomposed::of(&system);

    let rows = 2 * sightings.len();
    let known_before = (rows..system.residuals.len())
        .map(|row| decomposed.hat(row, row))
        .sum::<f64>();
    let used = 2 * weights.iter().filter(|w| **w > 0.0).count();
    let determined = decomposed.singular_values.len() as f64 - known_before;
    let freedom = libm::round(used as f64 - determined).max(0.0);
    let sigma = if freedom > 0.0 {
        libm::sqrt(variance(
            &system,
            &weights,
            fit,
            options,
            used as f64,
            freedom,
        ))
    } else {
        f64::INFINITY
    };
    let covariance = decomposed.covariance(&system.columns, rows, sigma);
    let standard_errors: [f64; COUNT] =
        core::array::from_fn(|k| libm::sqrt(covariance[k][k].max(0.0)));
    let correlation = core::array::from_fn(|i| {
        core::array::from_fn(|k| {
            if i == k {
                f64::from(u8::from(system.columns.contains(&i)))
            } else {
                ratio(covariance[i][k], standard_errors[i], standard_errors[k])
            }
        })
    });
    let (influence_mrad, leverage) = influence(&decomposed, &system, &sightings, &values);
    let stated = observations.iter().all(|o| o.sigma_m.is_some());
    let largest = decomposed.singular_values.first().copied().unwrap_or(0.0);
    let smallest = decomposed.singular_values.last().copied().unwrap_or(0.0);
    Ok(Uncertainty {
        free: options.free().collect(),
        covariance,
        standard_errors,
        correlation,
        degrees_of_freedom: freedom as usize,
        sigma,
        chi_square: stated.then_some(fit.sum_of_squares),
        rank: decomposed.rank(),
        condition: if smallest > 0.0 {
            largest / smallest
        } else {
            f64::INFINITY
        },
        weakest: decomposed.weakest(&system.columns),
        singular_values: decomposed.singular_values,
        influence_mrad,
        leverage,
    })
}

fn ratio(covariance: f64, a: f64, b: f64) -> f64 {
    let both = a * b;
    if both > 0.0 && both.is_finite() {
        (covariance / both).clamp(-1.0, 1.0)
    } else {
        0.0
    }
}

/// Variance of a residual component. With a robust loss that of Huber (Robust Statistics, §7.6, eq. 6.6),
/// K² E\[psi²\]/E\[psi'\]² with K = 1 + p/n var(psi')/E\[psi'\]², times the mean weight because J's rows have
/// been weighted.
fn variance(
    system: &System,
    weights: &[f64],
    fit: &Fit,
    options: &FitOptions,
    used: f64,
    freedom: f64,
) -> f64 {
    let (mut psi, mut slope, mut squares, mut mean) = (0.0, 0.0, 0.0, 0.0);
    for (i, &weight) in weights.iter().enumerate() {
        if weight > 0.0 {
            // the rows carry the root of the weight
            let [du, dv] = [system.residuals[2 * i], system.residuals[2 * i + 1]];
            let square = du * du + dv * dv;
            psi += weight * square;
            let own = if fit.scale > 0.0 {
                options
                    .loss
                    .mean_slope(libm::sqrt(square / weight) / fit.scale)
            } else {
                1.0
            };
            slope += 2.0 * own;
            squares += 2.0 * own * own;
            mean += 2.0 * weight;
        }
    }
    let (slope, squares, mean) = (slope / used, squares / used, mean / used);
    let slope_squared = (slope * slope).max(1e-6);
    let spread = (squares - slope * slope).max(0.0) / slope_squared;
    let k = 1.0 + (used - freedom) / used * spread;
    k * k * psi / freedom * mean / slope_squared
}

/// sigma² (JᵀJ)⁻¹ of the free parameters; the rows after `rows` are priors'.
pub(crate) fn of(system: &System, rows: usize, sigma: f64) -> [[f64; COUNT]; COUNT] {
    Decomposed::of(system).covariance(&system.columns, rows, sigma)
}

/// Singular value decomposition of a Jacobian with scaled columns.
struct Decomposed {
    u: Mat<f64>,
    v: Mat<f64>,
    singular_values: Vec<f64>,
    lengths: Vec<f64>,
}

impl Decomposed {
    fn of(system: &System) -> Self {
        let (scaled, lengths) = system.scaled();
        let columns = lengths.len();
        let rows = scaled.nrows().max(columns);
        // rows of zeros give it as many singular values as columns
        let tall = Mat::from_fn(rows, columns, |i, k| {
            if i < scaled.nrows() {
                scaled[(i, k)]
            } else {
                0.0
            }
        });
        match tall.thin_svd() {
            Ok(svd) => {
                let s = svd.S().column_vector();
                Self {
                    u: svd.U().to_owned(),
                    v: svd.V().to_owned(),
                    singular_values: (0..columns).map(|k| s[k]).collect(),
                    lengths,
                }
            }
            Err(_) => Self {
                u: Mat::zeros(rows, columns),
                v: Mat::identity(columns, columns),
                singular_values: vec![0.0; columns],
                lengths,
            },
        }
    }

    fn least(&self) -> f64 {
        RANK_TOLERANCE * self.singular_values.first().copied().unwrap_or(0.0)
    }

    fn rank(&self) -> usize {
        let least = self.least();
        self.singular_values.iter().filter(|s| **s > least).count()
    }

    fn hat(&self, i: usize, k: usize) -> f64 {
        let rank = self.rank();
        (0..rank).map(|c| self.u[(i, c)] * self.u[(k, c)]).sum()
    }

    /// J⁺ of a row: what a unit of its residual does to each free parameter.
    fn pull(&self, row: usize, parameter: usize) -> f64 {
        let least = self.least().max(f64::MIN_POSITIVE);
        let sum: f64 = (0..self.singular_values.len())
            .map(|c| self.v[(parameter, c)] * self.u[(row, c)] / self.singular_values[c].max(least))
            .sum();
        sum / self.lengths[parameter]
    }

    /// sigma² J⁺J⁺ᵀ; the rows after `rows` count at sigma 1.
    fn covariance(&self, columns: &[usize], rows: usize, sigma: f64) -> [[f64; COUNT]; COUNT] {
        let mut covariance = [[0.0; COUNT]; COUNT];
        let count = columns.len();
        let least = self.least().max(f64::MIN_POSITIVE);
        // Uᵀ W U with W = sigma² for the observations, 1 for priors
        let middle = Mat::from_fn(count, count, |i, k| {
            let priors: f64 = (rows..self.u.nrows())
                .map(|row| self.u[(row, i)] * self.u[(row, k)])
                .sum();
            let unit = f64::from(u8::from(i == k));
            if sigma.is_finite() {
                sigma * sigma * (unit - priors) + priors
            } else {
                unit
            }
        });
        for (a, &i) in columns.iter().enumerate() {
            for (b, &k) in columns.iter().enumerate() {
                let mut sum = 0.0;
                for c in 0..count {
                    for d in 0..count {
                        sum += self.v[(a, c)] / self.singular_values[c].max(least) * middle[(c, d)]
                            / self.singular_values[d].max(least)
                            * self.v[(b, d)];
                    }
                }
                covariance[i][k] = sum / (self.lengths[a] * self.lengths[b]);
                if !sigma.is_finite() {
                    covariance[i][k] = if i == k { f64::INFINITY } else { 0.0 };
                }
            }
        }
        // the same from both sides, to the bit
        core::array::from_fn(|i| {
            core::array::from_fn(|k| 0.5 * (covariance[i][k] + covariance[k][i]))
        })
    }

    fn weakest(&self, columns: &[usize]) -> [f64; COUNT] {
        let mut weakest = [0.0; COUNT];
        let Some(last) = self.singular_values.len().checked_sub(1) else {
            return weakest;
        };
        for (k, &column) in columns.iter().enumerate() {
            weakest[column] = self.v[(k, last)] / self.lengths[k];
        }
        let norm = libm::sqrt(weakest.iter().map(|x| x * x).sum());
        let largest = weakest.iter().fold(
            0.0_f64,
            |most, &x| if x.abs() > most.abs() { x } else { most },
        );
        if norm > 0.0 {
            let factor = libm::copysign(norm, largest);
            weakest = weakest.map(|x| x / factor);
        }
        weakest
    }
}

/// Leave-one-out, to first order: x - x₍ᵢ₎ = -J⁺ᵢ (1 - Hᵢᵢ)⁻¹ rᵢ, as the angle by which beam i turns.
fn influence(
    decomposed: &Decomposed,
    system: &System,
    sightings: &[Sighting<f64>],
    values: &[f64; COUNT],
) -> (Vec<f64>, Vec<f64>) {
    let pose = Pose::new(*values);
    let mut leverage = Vec::with_capacity(sightings.len());
    let mut influence = Vec::with_capacity(sightings.len());
    for (i, sighting) in sightings.iter().enumerate() {
        let [a, b] = [2 * i, 2 * i + 1];
        let (aa, ab, bb) = (
            decomposed.hat(a, a),
            decomposed.hat(a, b),
            decomposed.hat(b, b),
        );
        leverage.push(aa + bb);
        let determinant = (1.0 - aa) * (1.0 - bb) - ab * ab;
        if determinant < 1e-10 {
            influence.push(f64::INFINITY);
            continue;
        }
        let [ra, rb] = [system.residuals[a], system.residuals[b]];
        let left = [
            ((1.0 - bb) * ra + ab * rb) / determinant,
            (ab * ra + (1.0 - aa) * rb) / determinant,
        ];
        let mut without = *values;
        for (k, &column) in system.columns.iter().enumerate() {
            without[column] += decomposed.pull(a, k) * left[0] + decomposed.pull(b, k) * left[1];
        }
        let moved = angle_rad(beam(&pose, sighting), beam(&Pose::new(without), sighting));
        influence.push(1e3 * moved);
    }
    (influence, leverage)
}

impl Uncertainty {
    /// 95 % interval of a parameter, Student's t with the residuals' sigma; nothing for a held parameter or
    /// where no freedom is left. A reference's interval may reach beyond ±π.
    #[must_use]
    pub fn interval95(&self, parameter: Parameter, fit: &Fit) -> Option<(f64, f64)> {
        if !self.free.contains(&parameter) || self.degrees_of_freedom == 0 {
            return None;
        }
        let half = student_t95(self.degrees_of_freedom) * self.standard_errors[parameter as usize];
        let value = fit.parameters.get(parameter);
        Some((value - half, value + half))
    }

    /// [`tilt_standard_error`] of a fit.
    #[must_use]
    pub fn tilt_standard_error(&self, fit: &Fit) -> (f64, Option<f64>) {
        tilt_standard_error(&fit.parameters, &self.covariance)
    }
}

/// Standard errors of the pedestal's tilt and of its azimuth \[rad\] from a covariance in the order of
/// [`Parameter::ALL`], theory §6: sd(psi_t) = sqrt(uᵀCu) with u along the tilt, sd(psi_a) = sqrt(wᵀCw)/psi_t with
/// w across it. The azimuth of a tilt within five standard errors of zero is not known.
#[must_use]
pub fn tilt_standard_error(
    parameters: &Parameters,
    covariance: &[[f64; COUNT]; COUNT],
) -> (f64, Option<f64>) {
    let [a, b] = [Parameter::Tilt1, Parameter::Tilt2];
    let (x, y) = (parameters.get(a), parameters.get(b));
    let tilt = libm::hypot(x, y);
    let (cosine, sine) = if tilt > 0.0 {
        (x / tilt, y / tilt)
    } else {
        (1.0, 0.0)
    };
    let (a, b) = (a as usize, b as usize);
    let deviation = |u: f64, w: f64| {
        let c = covariance;
        let both = u * w;
        let mixed = if both == 0.0 {
            0.0
        } else {
            both * (c[a][b] + c[b][a])
        };
        let term = |part: f64, c: f64| if part == 0.0 { 0.0 } else { part * part * c };
        libm::sqrt((term(u, c[a][a]) + term(w, c[b][b]) + mixed).max(0.0))
    };
    let along = deviation(cosine, sine);
    let across = deviation(-sine, cosine);
    let known = tilt > TILT_SIGMAS * along.max(across);
    (along, known.then(|| across / tilt))
}

/// 97.5 % quantile of Student's t: the half width of a 95 % interval in standard errors.
///
/// From the finite sums for whole degrees of freedom (Abramowitz & Stegun 26.7.3, 26.7.4) by bisection; above
/// 200 from their expansion 26.7.5, good to 1e-9 there. Infinite for 0.
///
/// ```
/// use helio_calib::student_t95;
/// assert!((student_t95(1) - 12.706_204_736).abs() < 1e-8);
/// assert!((student_t95(10) - 2.228_138_852).abs() < 1e-8);
/// ```
#[must_use]
pub fn student_t95(degrees: usize) -> f64 {
    /// 97.5 % quantile of the normal distribution.
    const NORMAL: f64 = 1.959_963_984_540_054;
    if degrees == 0 {
        return f64::INFINITY;
    }
    if degrees > 200 {
        let (x, n) = (NORMAL, degrees as f64);
        let s = x * x;
        let g1 = (s + 1.0) * x / 4.0;
        let g2 = ((5.0 * s + 16.0) * s + 3.0) * x / 96.0;
        let g3 = (((3.0 * s + 19.0) * s + 17.0) * s - 15.0) * x / 384.0;
        return x + g1 / n + g2 / (n * n) + g3 / (n * n * n);
    }
    let (mut low, mut high) = (0.0, 16.0);
    for _ in 0..60 {
        let middle = 0.5 * (low + high);
        if student_t_within(middle, degrees) < 0.95 {
            low = middle;
        } else {
            high = middle;
        }
    }
    0.5 * (low + high)
}

/// P(|T| < t).
fn student_t_within(t: f64, degrees: usize) -> f64 {
    let root = libm::sqrt(degrees as f64);
    let angle = libm::atan2(t, root);
    let (sine, cosine) = libm::sincos(angle);
    let square = cosine * cosine;
    if degrees.is_multiple_of(2) {
        let (mut term, mut sum) = (1.0, 1.0);
        for k in (2..degrees).step_by(2) {
            term *= square * (k as f64 - 1.0) / k as f64;
            sum += term;
        }
        sine * sum
    } else {
        let (mut term, mut sum) = (cosine, 0.0);
        for k in (1..degrees).step_by(2) {
            sum += term;
            term *= square * (k as f64 + 1.0) / (k as f64 + 2.0);
        }
        core::f64::consts::FRAC_2_PI * (angle + sine * sum)
    }
}
