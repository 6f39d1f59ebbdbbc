//! What is foretold of records to come, and how the records that were used had been foretold.

use super::belief::{Belief, REFERENCES, Rates, Shape, column};
use super::common::Common;
use super::hyper::waited;
use super::rows::{Expansion, MILLI, Rows, Structure, filter_unit, parameters, pole};
use super::{JointFit, Marks};
use crate::error::{CalibrationError, in_place};
use crate::field::Campaign;
use crate::parameters::Parameters;

/// A spot foretold.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Foretold {
    /// Seen less foretold, across the beam \[mrad\].
    pub miss_mrad: [f64; 2],
    /// Covariance of that, noise of the record included \[mrad²\]: first, mixed, second.
    pub covariance_mrad2: [f64; 3],
}

impl Foretold {
    /// Of a record that cannot be foretold: its beam does not meet the target.
    pub(super) const NOTHING: Self = Self {
        miss_mrad: [f64::NAN; 2],
        covariance_mrad2: [f64::NAN; 3],
    };

    /// Length of the miss \[mrad\].
    #[must_use]
    pub fn beam_mrad(&self) -> f64 {
        libm::hypot(self.miss_mrad[0], self.miss_mrad[1])
    }

    /// The miss expected \[mrad\], root of the mean square.
    #[must_use]
    pub fn expected_mrad(&self) -> f64 {
        libm::sqrt(self.covariance_mrad2[0] + self.covariance_mrad2[2])
    }

    /// Squared length in standard deviations: chi-squared with two degrees of freedom.
    #[must_use]
    pub fn square(&self) -> f64 {
        let [x, y] = self.in_sigmas();
        x * x + y * y
    }

    /// The miss through the inverse of its covariance's root: two independent standard deviates.
    #[must_use]
    pub fn in_sigmas(&self) -> [f64; 2] {
        let [a, b, c] = self.covariance_mrad2;
        let [x, y] = self.miss_mrad;
        let root = libm::sqrt(a);
        let mixed = b / root;
        let first = x / root;
        [first, (y - mixed * first) / libm::sqrt(c - mixed * mixed)]
    }
}

/// Causes of the expansion from what is common.
pub(super) fn shared_values(structure: &Structure, common: &Common) -> Vec<f64> {
    let values = common.mean[structure.shape().still..].iter();
    let pairs = structure.shared.iter().zip(values);
    pairs
        .map(|(&cause, value)| value / filter_unit(cause))
        .collect()
}

/// Whose slopes an own unknown has: a wandering zero point moves the beam as its reference does.
pub(super) fn of_slope(still: usize, unknown: usize) -> usize {
    if unknown < still {
        unknown
    } else {
        REFERENCES[(unknown - still) % 2]
    }
}

/// A record held against what is believed.
pub(super) fn foretold(
    shape: Shape,
    row: &[f64],
    rates: &Rates,
    belief: &Belief<f64>,
    common: &Common,
) -> Foretold {
    let rest = shape.row() - column::REST;
    if row[rest + column::SILENT] != 0.0 && row[..rest].iter().all(|x| *x == 0.0) {
        return Foretold::NOTHING;
    }
    let Shape { still, causes, .. } = shape;
    let own = shape.own();
    let n = common.mean.len();
    // (s, b) jointly: s = m + G b + noise of P, and b itself through its causes
    let slope = |i: usize, c: usize| row[2 * of_slope(still, i) + c];
    let mut miss = [row[rest + column::SEEN], row[rest + column::SEEN + 1]];
    let mut by_common = vec![[0.0; 2]; n];
    for k in 0..causes {
        for c in 0..2 {
            by_common[still + k][c] = row[2 * still + 2 * k + c];
        }
    }
    for i in 0..own {
        for c in 0..2 {
            miss[c] -= slope(i, c) * belief.mean[i];
            for k in 0..n {
                by_common[k][c] += slope(i, c) * belief.gain(i, k);
            }
        }
    }
    for (by, b) in by_common.iter().zip(&common.mean) {
        for c in 0..2 {
            miss[c] -= by[c] * b;
        }
    }
    let noise =
        row[rest + column::ON_TARGET] * rates.spot + rates.beam + row[rest + column::STATED];
    let path = [row[rest + column::PATH], row[rest + column::PATH + 1]];
    let mut covariance_mrad2 = [0.0; 3];
    for (to, [c, d]) in covariance_mrad2.iter_mut().zip([[0, 0], [0, 1], [1, 1]]) {
        *to = if c == d { noise } else { 0.0 } + rates.sun * path[c] * path[d];
        for i in 0..own {
            for j in 0..own {
                *to += slope(i, c) * slope(j, d) * belief.covariance(i, j);
            }
        }
        for i in 0..n {
            for j in 0..n {
                *to += by_common[i][c] * by_common[j][d] * common.covariance[i * n + j];
            }
        }
    }
    Foretold {
        miss_mrad: miss,
        covariance_mrad2,
    }
}

/// Records held against a belief of the day `last`, in the order of the observations.
pub(super) fn later(
    belief: &Belief<f64>,
    last: Option<f64>,
    rows: &Rows,
    rates: &Rates,
    common: &Common,
) -> Vec<Foretold> {
    let mut out = vec![Foretold::NOTHING; rows.len()];
    for record in 0..rows.len() {
        let mut belief = belief.clone();
        if let Some(last) = last {
            let (kept, added) = waited(rates, rows.days[record] - last);
            belief.wait(kept, added);
        }
        let row = rows.row(belief.shape, record);
        out[rows.of[record]] = foretold(belief.shape, row, rates, &belief, common);
    }
    out
}

/// How a record that was used had been foretold from those before it, and the zero points after it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct History {
    /// Which observation.
    pub observation: usize,
    /// When \[days since 1970\].
    pub day: f64,
    /// Held against what was believed before it.
    pub foretold: Foretold,
    /// References of either axis as then known, less those at rest after all records \[rad\]: jumps and wander.
    pub zero_rad: [f64; 2],
    /// One standard deviation of the references \[rad\].
    pub zero_sigma_rad: [f64; 2],
    /// Whether it was taken for an outlier.
    pub outlier: bool,
    /// Whether the zero point of either axis was taken to have jumped before it.
    pub jumped: [bool; 2],
}

impl JointFit {
    pub(super) fn rows(&self, k: usize, campaign: &Campaign<'_>) -> Rows {
        let at = Expansion {
            still: self.heliostats[k].still.clone(),
            shared: shared_values(&self.structure, &self.common),
        };
        Rows::of(&self.structure, campaign, &at, pole(self.site_latitude_rad))
    }

    /// The records that the fit used, with what was decided about them.
    pub(super) fn marked(&self, k: usize, campaign: &Campaign<'_>) -> (Rows, Marks) {
        let posterior = &self.heliostats[k];
        let mut rows = self.rows(k, campaign);
        let place = |observation: usize| rows.of.iter().position(|&of| of == observation);
        let marks = Marks {
            outliers: posterior
                .outliers
                .iter()
                .filter_map(|&o| place(o))
                .collect(),
            jumps: posterior
                .jumps
                .iter()
                .filter_map(|&(o, jump)| Some((place(o)?, jump.axis)))
                .collect(),
        };
        rows.mark(self.structure.shape(), &marks, self.mishaps.jump_mrad);
        (rows, marks)
    }

    /// Holds the observations of a campaign of heliostat `k` against what is foretold of them from its records
    /// so far, however long after those they are; in the order of the observations.
    ///
    /// # Errors
    /// [`CalibrationError::NoSuchHeliostat`] if there is no heliostat `k`.
    pub fn foretell(
        &self,
        k: usize,
        campaign: &Campaign<'_>,
    ) -> Result<Vec<Foretold>, CalibrationError> {
        let last = in_place(&self.heliostats, "k", k)?.last_day;
        let rows = self.rows(k, campaign);
        let (belief, rates) = (self.belief(k), self.hyper.rates());
        Ok(later(&belief, last, &rows, &rates, &self.common))
    }

    /// How the records of heliostat `k` that the fit used (the same campaign) had each been foretold from those
    /// before, in time. What is common is what the whole fit found.
    ///
    /// # Errors
    /// [`CalibrationError::NoSuchHeliostat`] if there is no heliostat `k`.
    pub fn history(
        &self,
        k: usize,
        campaign: &Campaign<'_>,
    ) -> Result<Vec<History>, CalibrationError> {
        let shape = self.structure.shape();
        let posterior = in_place(&self.heliostats, "k", k)?;
        let (rows, marks) = self.marked(k, campaign);
        let rates = self.hyper.rates();
        let mut belief = Belief::of_field(shape, &self.hyper.spread, &rates);
        let rest = shape.row() - column::REST;
        let mut told = super::belief::Told::nothing(shape);
        let mut room = super::belief::Room::of(shape);
        let mut out = Vec::with_capacity(rows.len());
        for record in 0..rows.len() {
            let row = rows.row(shape, record);
            let days = row[rest + column::DAYS];
            if days > 0.0 {
                let (kept, added) = waited(&rates, days);
                belief.wait(kept, added);
            }
            belief.loosen([row[rest + column::JUMP], row[rest + column::JUMP + 1]]);
            let before = foretold(shape, row, &rates, &belief, &self.common);
            let surprise = belief.weigh(row, &rates, &[], &mut room);
            let outlier = marks.outliers.contains(&record);
            if row[rest + column::SILENT] == 0.0 {
                belief.believe(&surprise, &mut room, &mut told);
            }
            let [mut zero, sigma] = references(&belief, &self.common);
            for (zero, at_rest) in zero.iter_mut().zip(REFERENCES) {
                *zero -= posterior.still[at_rest];
            }
            out.push(History {
                observation: rows.of[record],
                day: rows.days[record],
                foretold: before,
                zero_rad: zero,
                zero_sigma_rad: sigma,
                outlier,
                jumped: [0, 1].map(|axis| marks.jumps.contains(&(record, axis))),
            });
        }
        Ok(out)
    }

    /// The six angles of heliostat `k` at rest.
    ///
    /// # Errors
    /// [`CalibrationError::NoSuchHeliostat`] if there is no heliostat `k`.
    pub fn parameters(
        &self,
        k: usize,
        mirror_offset_m: f64,
    ) -> Result<Parameters, CalibrationError> {
        let posterior = in_place(&self.heliostats, "k", k)?;
        Ok(parameters(&posterior.still, mirror_offset_m))
    }
}

/// Zero points of both axes less those at rest, and their standard deviations \[rad\].
pub(super) fn zero_points(belief: &Belief<f64>, common: &Common) -> [[f64; 2]; 2] {
    let still = belief.shape.still;
    sums(belief, common, |axis| vec![still + axis, still + axis + 2])
}

/// References of both axes, zero points included, and their standard deviations \[rad\].
pub(super) fn references(belief: &Belief<f64>, common: &Common) -> [[f64; 2]; 2] {
    let still = belief.shape.still;
    let of = |axis: usize| vec![REFERENCES[axis], still + axis, still + axis + 2];
    sums(belief, common, of)
}

/// Sums of own unknowns, and their standard deviations \[rad\].
fn sums(belief: &Belief<f64>, common: &Common, of: impl Fn(usize) -> Vec<usize>) -> [[f64; 2]; 2] {
    let n = common.mean.len();
    let mut out = [[0.0; 2]; 2];
    for axis in 0..2 {
        let members = of(axis);
        let (mut mean, mut variance) = (0.0, 0.0);
        let mut gain = vec![0.0; n];
        for &k in &members {
            mean += belief.mean[k];
            for (l, sum) in gain.iter_mut().enumerate() {
                *sum += belief.gain(k, l);
            }
            for &l in &members {
                variance += belief.covariance(k, l);
            }
        }
        for (g, line) in gain.iter().zip(common.covariance.chunks_exact(n)) {
            let through: f64 = line.iter().zip(&gain).map(|(v, other)| v * other).sum();
            variance += g * through;
        }
        mean += gain
            .iter()
            .zip(&common.mean)
            .map(|(g, b)| g * b)
            .sum::<f64>();
        out[0][axis] = mean / MILLI;
        out[1][axis] = libm::sqrt(variance.max(0.0)) / MILLI;
    }
    out
}
