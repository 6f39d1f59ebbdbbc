//! What is left of each heliostat's misses as a smooth turn of its axes by the pose: a small Gaussian process.
//!
//! The readings of both axes that point a mirror are larger than the angles say by f1 and f2, two functions of the
//! pose with mean zero, an amplitude each and a length, which are those of the whole field. On a heliostat's records
//! they are φ(pose)·w with few independent w (a Cholesky factorisation with pivots of the kernel), so that they
//! are unknowns like those that the field has in common: the same filter gives the normal equations of (m, θ, w)
//! with the angles and the wandering zero points of the heliostat eliminated, those of w are eliminated for every
//! amplitude, and what is left is summed over the field. Angles, zero points, causes in common and leftovers are
//! so conditioned on each other; nothing is fitted to residuals.

mod axes;
mod poses;

use faer::prelude::Solve;
use faer::{Mat, Side};
use rayon::prelude::*;

use super::JointFit;
use super::belief::{Belief, REFERENCES, Room, Shape, Told, WANDERING, at, column};
use super::common::{Common, Sum};
use super::foretell::{Foretold, foretold};
use super::going::{Going, Progress};
use super::hyper::waited;
use super::parts::{demand, finite, positive};
use super::rows::{ANGLES, MILLI, Rows};
use super::terms::{AxisCause, Cause};
use super::worth::dot;
use crate::error::{CalibrationError, in_place};
use crate::field::Campaign;
use crate::observation::Mount;
use crate::parameters::Parameters;
use axes::readings_by;
use poses::Seen;

/// How to look for what is left by pose.
#[derive(Debug, Clone, PartialEq)]
pub struct LeftoverOptions {
    /// Lengths that are tried \[rad\]: poses so far apart have little to do with each other.
    pub lengths_rad: Vec<f64>,
    /// Amplitudes that are tried for either axis beside none \[mrad\], one standard deviation.
    pub amplitudes_mrad: Vec<f64>,
    /// How much likelier (logarithm) the records of the field must be with leftovers, of any length and amplitude
    /// tried, than without.
    pub least_log_evidence: f64,
    /// Lengths and amplitudes are learnt from at most so many heliostats, evenly chosen.
    pub learnt_from: usize,
    /// Poses that stand for those of a heliostat's records, at most.
    pub most_poses: usize,
    /// A set-point is never corrected by more than this, either axis \[rad\].
    pub most_rad: f64,
    /// The day that corrections are for \[days since 1970\], as zero points wander; that of each heliostat's last
    /// record where none is given.
    pub day: Option<f64>,
}

impl Default for LeftoverOptions {
    fn default() -> Self {
        Self {
            lengths_rad: vec![0.09, 0.18, 0.36, 0.72],
            amplitudes_mrad: vec![0.07, 0.14, 0.28, 0.56],
            least_log_evidence: 5.0,
            learnt_from: 256,
            most_poses: 32,
            most_rad: 1e-3,
            day: None,
        }
    }
}

impl LeftoverOptions {
    fn check(&self) -> Result<(), CalibrationError> {
        let lengths = self.lengths_rad.iter().map(|&x| ("lengths_rad", x));
        let amplitudes = self.amplitudes_mrad.iter().map(|&x| ("amplitudes_mrad", x));
        for (what, value) in lengths
            .chain(amplitudes)
            .chain([("most_rad", self.most_rad)])
        {
            positive(what, value)?;
        }
        demand(
            "day",
            self.day.is_none_or(f64::is_finite),
            "finite",
            self.day.unwrap_or_default(),
        )?;
        let least = self.least_log_evidence;
        demand("least_log_evidence", !least.is_nan(), "a number", least)?;
        for (what, count) in [
            ("number of lengths_rad", self.lengths_rad.len()),
            ("number of amplitudes_mrad", self.amplitudes_mrad.len()),
            ("learnt_from", self.learnt_from),
        ] {
            demand(what, count > 0, "at least 1", 0.0)?;
        }
        Ok(())
    }
}

/// What is left by pose, of a field.
#[derive(Debug, Clone, PartialEq)]
pub struct Leftovers {
    /// Amplitude of either axis \[mrad\], one standard deviation before anything was seen; 0 where the records do not
    /// speak for it.
    pub amplitude_mrad: [f64; 2],
    /// Length \[rad\].
    pub length_rad: f64,
    /// How much likelier (logarithm) the records of the field are with leftovers than without: the mean of the
    /// likelihood over the lengths and amplitudes that were tried.
    pub log_evidence: f64,
    /// Whether that is enough. If not, no set-point is corrected.
    pub admitted: bool,
    /// In the order of the campaigns.
    pub heliostats: Vec<Leftover>,
    common: Common,
    most_poses: usize,
}

/// What is left by pose, of a heliostat.
#[derive(Debug, Clone, PartialEq)]
pub struct Leftover {
    parts: LeftoverParts,
    seen: Seen,
    /// Of the correction, before it is bounded \[rad\].
    weights: [Vec<f64>; 2],
}

/// A [`Leftover`] as plain numbers, for files.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct LeftoverParts {
    /// Length \[rad\].
    pub length_rad: f64,
    /// Amplitude of either axis \[rad\].
    pub amplitude_rad: [f64; 2],
    /// Largest correction of either axis \[rad\].
    pub most_rad: f64,
    /// Poses that stand for all that were seen: readings of both axes \[rad\].
    pub poses_rad: Vec<[f64; 2]>,
    /// Correction of both readings at those poses, before it is bounded \[rad\].
    pub turns_rad: Vec<[f64; 2]>,
    /// The six angles on which the corrections stand \[rad\]: those found without leftovers, zero points included.
    pub angles_rad: [f64; ANGLES],
    /// Causes whose uncertainty is part of `covariance`.
    pub causes: Vec<AxisCause>,
    /// By how much six angles, then the causes, differ from those that were found without leftovers \[rad\].
    pub moved_rad: Vec<f64>,
    /// Covariance of these and of the weights of either axis' leftover at the poses \[rad²\]: lower triangle, row by
    /// row.
    pub covariance: Vec<f64>,
}

impl LeftoverParts {
    fn known(&self) -> usize {
        ANGLES + self.causes.len()
    }
}

impl Leftover {
    /// From plain numbers.
    ///
    /// # Errors
    /// [`CalibrationError::BadOption`] where they do not belong together or are not finite.
    pub fn from_parts(parts: LeftoverParts) -> Result<Self, CalibrationError> {
        let n = parts.poses_rad.len();
        let of_all = parts.known() + 2 * n;
        let sizes = [
            ("number of turns_rad", parts.turns_rad.len(), n),
            ("number of moved_rad", parts.moved_rad.len(), parts.known()),
            (
                "number of elements of covariance",
                parts.covariance.len(),
                Shape::triangle(of_all),
            ),
        ];
        for (what, found, wanted) in sizes {
            let asked = "as many as poses_rad and causes ask for";
            demand(what, found == wanted, asked, found as f64)?;
        }
        let numbers = parts
            .poses_rad
            .iter()
            .chain(&parts.turns_rad)
            .flatten()
            .chain(&parts.moved_rad)
            .chain(&parts.covariance)
            .chain(&parts.amplitude_rad)
            .chain(&parts.angles_rad);
        for &value in numbers {
            finite("number of a leftover", value)?;
        }
        for (what, value) in [
            ("length_rad", parts.length_rad),
            ("most_rad", parts.most_rad),
        ] {
            positive(what, value)?;
        }
        let seen = Seen::new(parts.length_rad, parts.poses_rad.iter().copied());
        let weights =
            [0, 1].map(|axis| seen.through(parts.turns_rad.iter().map(|turn| turn[axis])));
        Ok(Self {
            parts,
            seen,
            weights,
        })
    }

    /// The plain numbers.
    #[must_use]
    pub fn parts(&self) -> &LeftoverParts {
        &self.parts
    }

    /// What to add to the readings of both axes that the angles ask for \[rad\]: cut off at
    /// [`most_rad`](LeftoverParts::most_rad) of either axis, fading to nothing away from the poses that were seen;
    /// nothing too where an angle is not finite.
    #[must_use]
    pub fn turn_rad(&self, axis1_rad: f64, axis2_rad: f64) -> [f64; 2] {
        self.bounded(&self.seen.features([axis1_rad, axis2_rad]))
    }

    fn bounded(&self, features: &[f64]) -> [f64; 2] {
        let most = self.parts.most_rad;
        [0, 1].map(|axis| dot(features, &self.weights[axis]).clamp(-most, most))
    }

    /// Errors of both readings after that correction, of a heliostat with these angles: one standard deviation
    /// \[rad\], that of the angles themselves included, and what the bound cuts off. Infinite where a number of the
    /// pose, the mount or the parameters is not finite: nothing is known there.
    #[must_use]
    pub fn sigma_rad(
        &self,
        mount: &Mount,
        parameters: &Parameters,
        axis1_rad: f64,
        axis2_rad: f64,
    ) -> [f64; 2] {
        let parts = &self.parts;
        let (known, n) = (parts.known(), parts.poses_rad.len());
        let by = |pose| readings_by(mount, parameters, &parts.causes, pose);
        let moved = |pose| {
            let by = by(pose);
            [0, 1].map(|axis| pairs(&by, &parts.moved_rad, axis))
        };
        let pose = [axis1_rad, axis2_rad];
        let features = self.seen.features(pose);
        let unknown = self.seen.unknown(&features);
        let given = self.bounded(&features);
        let by_known = by(pose);
        let moved_here = moved(pose);
        let moved_there: Vec<[f64; 2]> = parts.poses_rad.iter().map(|&p| moved(p)).collect();
        [0, 1].map(|axis| {
            // the leftover itself, without what moved angles do
            let own = parts.turns_rad.iter().zip(&moved_there);
            let own = self.seen.through(own.map(|(t, m)| t[axis] - m[axis]));
            let wrong = moved_here[axis] + dot(&features, &own) - given[axis];
            let mut slopes: Vec<f64> = by_known.iter().map(|by| by[axis]).collect();
            slopes.resize(known + 2 * n, 0.0);
            slopes[known + axis * n..][..n].copy_from_slice(&features);
            let amplitude = parts.amplitude_rad[axis];
            let variance = quadratic(&parts.covariance, &slopes) + amplitude * amplitude * unknown;
            let sigma = libm::sqrt(variance.max(0.0) + wrong * wrong);
            if sigma.is_finite() {
                sigma
            } else {
                f64::INFINITY
            }
        })
    }
}

fn pairs(by: &[[f64; 2]], of: &[f64], axis: usize) -> f64 {
    by.iter().zip(of).map(|(by, x)| by[axis] * x).sum()
}

/// xᵀ C x of a lower triangle.
fn quadratic(triangle: &[f64], x: &[f64]) -> f64 {
    let mut sum = 0.0;
    for i in 0..x.len() {
        let line = &triangle[at(i, 0)..];
        sum += x[i] * (2.0 * dot(&line[..i], &x[..i]) + line[i] * x[i]);
    }
    sum
}

/// A heliostat after its records, its leftovers among the unknowns that it has in common with nobody.
struct Wide {
    narrow: Shape,
    shape: Shape,
    seen: Seen,
    belief: Belief<f64>,
    told: Told<f64>,
    log_determinant: f64,
}

/// Leftovers given what is common: their mean is `at_zero` + `by_common` b, their covariance `spread`; mrad.
struct Left {
    at_zero: Vec<f64>,
    by_common: Mat<f64>,
    spread: Mat<f64>,
}

impl Wide {
    fn count(&self) -> usize {
        2 * self.seen.poses.len()
    }

    /// Prior standard deviation of a weight \[mrad\].
    fn prior(&self, amplitude_mrad: [f64; 2], k: usize) -> f64 {
        amplitude_mrad[k / self.seen.poses.len()]
    }

    /// A Λww A + 1 for the prior's A.
    fn matrix(&self, amplitude_mrad: [f64; 2]) -> Mat<f64> {
        let (n, common) = (self.count(), self.narrow.common());
        Mat::from_fn(n, n, |i, j| {
            let (i, j) = (i.max(j), i.min(j));
            let scale = self.prior(amplitude_mrad, i) * self.prior(amplitude_mrad, j);
            f64::from(u8::from(i == j)) + scale * self.told.matrix[at(common + i, common + j)]
        })
    }

    /// A [Λwb | ηw].
    fn right(&self, amplitude_mrad: [f64; 2]) -> Mat<f64> {
        let (n, common) = (self.count(), self.narrow.common());
        Mat::from_fn(n, common + 1, |i, j| {
            let told = if j < common {
                self.told.matrix[at(common + i, j)]
            } else {
                self.told.vector[common + i]
            };
            self.prior(amplitude_mrad, i) * told
        })
    }

    /// What the records tell of what is common, leftovers of these amplitudes eliminated.
    fn eliminated(&self, amplitude_mrad: [f64; 2]) -> Option<Sum> {
        let common = self.narrow.common();
        let mut told = Told {
            matrix: self.told.matrix[..Shape::triangle(common)].to_vec(),
            vector: self.told.vector[..common].to_vec(),
            square: self.told.square,
            determinant: 1.0,
        };
        let mut log_determinant = self.log_determinant;
        if self.count() > 0 && amplitude_mrad != [0.0; 2] {
            let factor = self.matrix(amplitude_mrad).llt(Side::Lower).ok()?;
            let right = self.right(amplitude_mrad);
            let solved = factor.solve(&right);
            let product = right.transpose() * &solved;
            for i in 0..common {
                for j in 0..=i {
                    told.matrix[at(i, j)] -= product[(i, j)];
                }
                told.vector[i] -= product[(i, common)];
            }
            told.square -= product[(common, common)];
            let root = factor.L();
            for i in 0..self.count() {
                log_determinant += 2.0 * libm::log(root[(i, i)]);
            }
        }
        Some(Sum::new(told, log_determinant))
    }

    fn left(&self, amplitude_mrad: [f64; 2]) -> Option<Left> {
        let (n, common) = (self.count(), self.narrow.common());
        let factor = self.matrix(amplitude_mrad).llt(Side::Lower).ok()?;
        let solved = factor.solve(self.right(amplitude_mrad));
        let covariance = factor.solve(Mat::<f64>::identity(n, n));
        let prior = |k: usize| self.prior(amplitude_mrad, k);
        Some(Left {
            at_zero: (0..n).map(|i| prior(i) * solved[(i, common)]).collect(),
            by_common: Mat::from_fn(n, common, |i, j| -prior(i) * solved[(i, j)]),
            spread: Mat::from_fn(n, n, |i, j| prior(i) * prior(j) * covariance[(i, j)]),
        })
    }

    /// What is common and the leftovers of this heliostat, together.
    fn both(&self, left: &Left, common: &Common) -> Common {
        let (n, c) = (self.count(), self.narrow.common());
        let v = Mat::from_fn(c, c, |i, j| common.covariance[i * c + j]);
        let mixed = &left.by_common * &v;
        let spread = &mixed * left.by_common.transpose() + &left.spread;
        let mut mean = common.mean.clone();
        for i in 0..n {
            let by: f64 = (0..c)
                .map(|j| left.by_common[(i, j)] * common.mean[j])
                .sum();
            mean.push(left.at_zero[i] + by);
        }
        let all = c + n;
        let covariance = (0..all * all).map(|k| match (k / all, k % all) {
            (i, j) if i < c && j < c => v[(i, j)],
            (i, j) if i < c => mixed[(j - c, i)],
            (i, j) if j < c => mixed[(i - c, j)],
            (i, j) => 0.5 * (spread[(i - c, j - c)] + spread[(j - c, i - c)]),
        });
        Common {
            mean,
            covariance: covariance.collect(),
            minus_log_likelihood: common.minus_log_likelihood,
        }
    }
}

/// Readings of both axes of a record \[rad\].
fn pose_of(campaign: &Campaign<'_>, record: usize) -> [f64; 2] {
    let observation = &campaign.observations[record];
    [observation.axis1_rad, observation.axis2_rad]
}

/// A linearised record with the derivatives by leftovers after those by causes.
fn widened(narrow: Shape, row: &[f64], features: &[f64]) -> Vec<f64> {
    let (known, rest) = row.split_at(row.len() - column::REST);
    debug_assert_eq!(row.len(), narrow.row());
    let mut out = Vec::with_capacity(row.len() + 4 * features.len());
    out.extend_from_slice(known);
    for reference in REFERENCES {
        for feature in features {
            out.extend([0, 1].map(|c| row[2 * reference + c] * feature));
        }
    }
    out.extend_from_slice(rest);
    out
}

fn wide_shape(narrow: Shape, seen: &Seen) -> Shape {
    Shape {
        causes: narrow.causes + 2 * seen.poses.len(),
        ..narrow
    }
}

/// Heliostats that are summed before others are added.
const CHUNK: usize = 16;

impl JointFit {
    /// Goes through the records of heliostat `k` again, leftovers among the unknowns.
    fn widen(&self, rows: &Rows, campaign: &Campaign<'_>, length_rad: f64, most: usize) -> Wide {
        let narrow = self.structure.shape();
        let rest = narrow.row() - column::REST;
        let believed: Vec<[f64; 2]> = (0..rows.len())
            .filter(|&record| rows.row(narrow, record)[rest + column::SILENT] == 0.0)
            .map(|record| pose_of(campaign, rows.of[record]))
            .collect();
        let seen = Seen::chosen(length_rad, &believed, most);
        let shape = wide_shape(narrow, &seen);
        let rates = self.hyper.rates();
        let mut belief = Belief::of_field(shape, &self.hyper.spread, &rates);
        let mut told = Told::nothing(shape);
        let mut room = Room::of(shape);
        let mut log_determinant = 0.0;
        for record in 0..rows.len() {
            let row = rows.row(narrow, record);
            let days = row[rest + column::DAYS];
            if days > 0.0 {
                let (kept, added) = waited(&rates, days);
                belief.wait(kept, added);
            }
            belief.loosen([row[rest + column::JUMP], row[rest + column::JUMP + 1]]);
            if row[rest + column::SILENT] == 0.0 {
                let features = seen.features(pose_of(campaign, rows.of[record]));
                let row = widened(narrow, row, &features);
                let surprise = belief.weigh(&row, &rates, &[], &mut room);
                belief.believe(&surprise, &mut room, &mut told);
                log_determinant += libm::log(surprise.determinant());
            }
        }
        Wide {
            narrow,
            shape,
            seen,
            belief,
            told,
            log_determinant,
        }
    }

    /// What is left by pose of the misses of all heliostats, whose campaigns are those of the fit.
    ///
    /// Noise and wander are those that the fit found without leftovers, of which they took what they could: the
    /// evidence for leftovers is rather too small than too large.
    ///
    /// # Errors
    /// [`CalibrationError::BadOption`] for another number of campaigns, and where an option makes no sense.
    ///
    /// ```
    /// use helio_calib::joint::simulate::{FieldOptions, simulate_field};
    /// use helio_calib::joint::{JointOptions, LeftoverOptions, fit_joint};
    /// let options = FieldOptions { heliostats: 6, records: 20, ..FieldOptions::new(1)? };
    /// let field = simulate_field(&options)?;
    /// let campaigns = field.first(20);
    /// let fit = fit_joint(&campaigns, &JointOptions::new(options.site.latitude_rad()))?;
    /// let leftovers = fit.leftovers(&campaigns, &LeftoverOptions::default())?;
    /// // there is nothing in this field that the angles do not explain
    /// assert!(!leftovers.admitted);
    /// assert_eq!(leftovers.heliostats[0].turn_rad(3.0, 0.5), [0.0, 0.0]);
    /// # Ok::<(), helio_calib::CalibrationError>(())
    /// ```
    pub fn leftovers(
        &self,
        campaigns: &[Campaign<'_>],
        options: &LeftoverOptions,
    ) -> Result<Leftovers, CalibrationError> {
        self.leftovers_watched(campaigns, options, &|_, _| true)
    }

    /// [`leftovers`](Self::leftovers), watched: it tells how far it is, and ends early when it is told to.
    ///
    /// # Errors
    /// Those of [`leftovers`](Self::leftovers), and [`CalibrationError::Stopped`].
    pub fn leftovers_watched(
        &self,
        campaigns: &[Campaign<'_>],
        options: &LeftoverOptions,
        progress: Progress<'_>,
    ) -> Result<Leftovers, CalibrationError> {
        options.check()?;
        let given = campaigns.len();
        let same = given == self.heliostats.len();
        demand("number of campaigns", same, "that of the fit", given as f64)?;
        let going = Going::new(progress, 2 * given);
        let learnt = self.learn_leftovers(campaigns, options, &going);
        going.check()?;
        let (length, amplitude, poses) = match learnt {
            Some((length, amplitude, evidence)) if evidence >= options.least_log_evidence => {
                (length, amplitude, options.most_poses)
            }
            _ => (options.lengths_rad[0], [0.0; 2], 0),
        };
        let wide: Vec<Wide> = campaigns
            .par_iter()
            .enumerate()
            .map(|(k, campaign)| {
                if !going.on_after(1) {
                    return Err(CalibrationError::Stopped);
                }
                Ok(self.widen(&self.marked(k, campaign).0, campaign, length, poses))
            })
            .collect::<Result<_, _>>()?;
        let mut sum = Sum::nothing(self.structure.shape());
        for chunk in wide
            .par_chunks(CHUNK)
            .map(|chunk| {
                let mut sum = Sum::nothing(self.structure.shape());
                if !going.is_on() {
                    return sum;
                }
                for of_one in chunk.iter().filter_map(|wide| wide.eliminated(amplitude)) {
                    sum.add(&of_one);
                }
                sum
            })
            .collect::<Vec<Sum>>()
        {
            sum.add(&chunk);
        }
        let common = Common::new(&sum, &self.prior_sigma).unwrap_or_else(|| self.common.clone());
        let heliostats = wide
            .into_par_iter()
            .zip(campaigns)
            .enumerate()
            .map(|(k, (wide, campaign))| {
                if !going.on_after(1) {
                    return Err(CalibrationError::Stopped);
                }
                self.leftover(k, wide, campaign, &common, (amplitude, length), options)
            })
            .collect::<Result<Vec<_>, _>>()?;
        going.check()?;
        Ok(Leftovers {
            amplitude_mrad: amplitude,
            length_rad: length,
            log_evidence: learnt.map_or(f64::NEG_INFINITY, |learnt| learnt.2),
            admitted: amplitude != [0.0; 2],
            heliostats,
            common,
            most_poses: poses,
        })
    }

    /// Likeliest length and amplitudes, and the evidence for leftovers: every length and pair of amplitudes but
    /// none as likely beforehand. `None` if there is nothing to learn from.
    fn learn_leftovers(
        &self,
        campaigns: &[Campaign<'_>],
        options: &LeftoverOptions,
        going: &Going<'_>,
    ) -> Option<(f64, [f64; 2], f64)> {
        let shape = self.structure.shape();
        let with: Vec<usize> = (0..campaigns.len())
            .filter(|&k| campaigns[k].observations.len() > 1)
            .collect();
        let count = with.len().min(options.learnt_from);
        let chosen: Vec<usize> = (0..count).map(|k| with[k * with.len() / count]).collect();
        let mut amplitudes = vec![0.0];
        amplitudes.extend(&options.amplitudes_mrad);
        let cells: Vec<[f64; 2]> = amplitudes
            .iter()
            .flat_map(|&first| amplitudes.iter().map(move |&second| [first, second]))
            .collect();
        let lengths = &options.lengths_rad;
        let of_chunks: Vec<Vec<Sum>> = chosen
            .par_chunks(CHUNK)
            .map(|chunk| {
                let mut sums = vec![Sum::nothing(shape); lengths.len() * cells.len()];
                for &k in chunk {
                    if !going.is_on() {
                        return sums;
                    }
                    let campaign = &campaigns[k];
                    let (rows, _) = self.marked(k, campaign);
                    for (length, sums) in lengths.iter().zip(sums.chunks_mut(cells.len())) {
                        let wide = self.widen(&rows, campaign, *length, options.most_poses);
                        for (cell, sum) in cells.iter().zip(sums) {
                            if let Some(of_one) = wide.eliminated(*cell) {
                                sum.add(&of_one);
                            }
                        }
                    }
                }
                sums
            })
            .collect();
        let mut sums = vec![Sum::nothing(shape); lengths.len() * cells.len()];
        for of_chunk in &of_chunks {
            for (sum, of_chunk) in sums.iter_mut().zip(of_chunk) {
                sum.add(of_chunk);
            }
        }
        let without = Common::new(sums.first()?, &self.prior_sigma)?.minus_log_likelihood;
        let mut best: Option<(f64, [f64; 2], f64)> = None;
        let mut gains = Vec::with_capacity(sums.len());
        for (k, sum) in sums.iter().enumerate() {
            let (length, cell) = (lengths[k / cells.len()], cells[k % cells.len()]);
            if cell == [0.0; 2] {
                continue;
            }
            let Some(common) = Common::new(sum, &self.prior_sigma) else {
                continue;
            };
            let gain = without - common.minus_log_likelihood;
            gains.push(gain);
            if best.is_none_or(|(_, _, most)| gain > most) {
                best = Some((length, cell, gain));
            }
        }
        let (length, cell, most) = best?;
        let total: f64 = gains.iter().map(|gain| libm::exp(gain - most)).sum();
        Some((length, cell, most + libm::log(total / gains.len() as f64)))
    }

    fn leftover(
        &self,
        k: usize,
        wide: Wide,
        campaign: &Campaign<'_>,
        common: &Common,
        (amplitude_mrad, length_rad): ([f64; 2], f64),
        options: &LeftoverOptions,
    ) -> Result<Leftover, CalibrationError> {
        let posterior = &self.heliostats[k];
        let bad = CalibrationError::BadOption {
            what: "records of a heliostat",
            wanted: "ones whose leftovers can be solved for",
            value: f64::NAN,
        };
        let left = wide.left(amplitude_mrad).ok_or(bad)?;
        let both = wide.both(&left, common);
        let days = match (options.day, posterior.last_day) {
            (Some(day), Some(last)) => day - last,
            _ => 0.0,
        };
        let (kept, added) = waited(&self.hyper.rates(), days);
        let mut belief = wide.belief;
        belief.wait(kept, added);
        let mut plain = self.belief(k);
        plain.wait(kept, added);
        let (causes, members) = self.turning();
        let (own, c) = (wide.shape.own(), both.mean.len());
        let mut mean = both.mean_of(&belief);
        mean.extend(&both.mean);
        let mut before = self.common.mean_of(&plain);
        before.extend(&self.common.mean);
        let sum = |of: &[f64], members: &[usize]| members.iter().map(|&k| of[k]).sum::<f64>();
        let moved_rad: Vec<f64> = members
            .iter()
            .map(|members| (sum(&mean, members) - sum(&before, members)) / MILLI)
            .collect();
        // covariance of (own, common, leftovers), of which sums are taken
        let of_own = both.covariance_of(&belief);
        let gain = Mat::from_fn(own, c, |i, k| belief.gain(i, k));
        let of_both = Mat::from_fn(c, c, |i, j| both.covariance[i * c + j]);
        let mixed = gain * &of_both;
        let element = |i: usize, j: usize| match (i < own, j < own) {
            (true, true) => of_own[i * own + j],
            (true, false) => mixed[(i, j - own)],
            (false, true) => mixed[(j, i - own)],
            (false, false) => of_both[(i - own, j - own)],
        };
        let weights = (0..wide.seen.poses.len() * 2).map(|k| vec![own + wide.narrow.common() + k]);
        let all: Vec<Vec<usize>> = members.into_iter().chain(weights).collect();
        let mut covariance = Vec::with_capacity(Shape::triangle(all.len()));
        for (i, first) in all.iter().enumerate() {
            for second in &all[..=i] {
                let pairs = first
                    .iter()
                    .flat_map(|&a| second.iter().map(move |&b| (a, b)));
                let total: f64 = pairs.map(|(a, b)| element(a, b)).sum();
                covariance.push(total / (MILLI * MILLI));
            }
        }
        let mut parameters =
            super::rows::parameters(&posterior.still, campaign.mount.mirror_offset_m);
        for (k, members) in all.iter().take(ANGLES).enumerate() {
            parameters.values[k] = sum(&before, members) / MILLI;
        }
        let leftovers = &both.mean[wide.narrow.common()..];
        let turns_rad = wide
            .seen
            .poses
            .iter()
            .map(|&pose| {
                let by = readings_by(&campaign.mount, &parameters, &causes, pose);
                let features = wide.seen.features(pose);
                let n = features.len();
                [0, 1].map(|axis| {
                    pairs(&by, &moved_rad, axis)
                        + dot(&features, &leftovers[axis * n..(axis + 1) * n]) / MILLI
                })
            })
            .collect();
        Leftover::from_parts(LeftoverParts {
            length_rad,
            amplitude_rad: amplitude_mrad.map(|a| a / MILLI),
            most_rad: options.most_rad,
            poses_rad: wide.seen.poses,
            turns_rad,
            angles_rad: core::array::from_fn(|k| parameters.values[k]),
            causes,
            moved_rad,
            covariance,
        })
    }

    /// Causes that turn axes, and for the six angles and each of them what adds up to it among (own, common)
    /// unknowns.
    fn turning(&self) -> (Vec<AxisCause>, Vec<Vec<usize>>) {
        let Shape { still, .. } = self.structure.shape();
        let own = still + WANDERING;
        let mut causes = self.structure.own.clone();
        let mut members: Vec<Vec<usize>> = (0..still).map(|k| vec![k]).collect();
        for (axis, reference) in REFERENCES.into_iter().enumerate() {
            members[reference].extend([still + axis, still + axis + 2]);
        }
        for (k, cause) in self.structure.shared.iter().enumerate() {
            if let Cause::Axis(cause) = cause {
                causes.push(*cause);
                members.push(vec![own + still + k]);
            }
        }
        (causes, members)
    }
}

impl Leftovers {
    /// Holds the observations of a campaign of heliostat `k` against what is foretold of them from its records so
    /// far, `past`, set-points corrected by what is left; in the order of the observations.
    /// [`JointFit::foretell`] does it without.
    ///
    /// # Errors
    /// [`CalibrationError::NoSuchHeliostat`] if there is no heliostat `k`.
    pub fn foretell(
        &self,
        fit: &JointFit,
        k: usize,
        past: &Campaign<'_>,
        campaign: &Campaign<'_>,
    ) -> Result<Vec<Foretold>, CalibrationError> {
        let leftover = in_place(&self.heliostats, "k", k)?;
        let plain = fit.foretell(k, campaign)?;
        let (rows, _) = fit.marked(k, past);
        let wide = fit.widen(&rows, past, self.length_rad, self.most_poses);
        let Some(left) = wide.left(self.amplitude_mrad) else {
            return Ok(vec![Foretold::NOTHING; campaign.observations.len()]);
        };
        let both = wide.both(&left, &self.common);
        let rates = fit.hyper.rates();
        let rows = fit.rows(k, campaign);
        let mut out = vec![Foretold::NOTHING; rows.len()];
        for record in 0..rows.len() {
            let of = rows.of[record];
            let pose = pose_of(campaign, of);
            let features = wide.seen.features(pose);
            let row = rows.row(wide.narrow, record);
            let mut belief = wide.belief.clone();
            if let Some(last) = fit.heliostats[k].last_day {
                let (kept, added) = waited(&rates, rows.days[record] - last);
                belief.wait(kept, added);
            }
            let best = foretold(
                wide.shape,
                &widened(wide.narrow, row, &features),
                &rates,
                &belief,
                &both,
            );
            let turn = leftover.turn_rad(pose[0], pose[1]);
            let slope = |axis: usize, c: usize| row[2 * REFERENCES[axis] + c];
            let miss_mrad = [0, 1].map(|c| {
                let by = |axis: usize| slope(axis, c) * turn[axis] * MILLI;
                plain[of].miss_mrad[c] - by(0) - by(1)
            });
            let unknown = wide.seen.unknown(&features);
            let wrong = [0, 1].map(|c| miss_mrad[c] - best.miss_mrad[c]);
            let mut covariance_mrad2 = best.covariance_mrad2;
            for (to, [c, d]) in covariance_mrad2.iter_mut().zip([[0, 0], [0, 1], [1, 1]]) {
                *to += wrong[c] * wrong[d];
                for axis in 0..2 {
                    let amplitude = self.amplitude_mrad[axis];
                    *to += unknown * amplitude * amplitude * slope(axis, c) * slope(axis, d);
                }
            }
            out[of] = Foretold {
                miss_mrad,
                covariance_mrad2,
            };
        }
        Ok(out)
    }
}

#[cfg(test)]
mod tests {
    use super::super::simulate::{FieldOptions, simulate_field};
    use super::super::{JointOptions, fit_joint};
    use super::*;

    /// Correlation of the leftover of either axis at two poses, written anew.
    fn kernel(length: f64, a: [f64; 2], b: [f64; 2]) -> f64 {
        let chord = |k: usize| 2.0 - 2.0 * (a[k] - b[k]).cos();
        (-(chord(0) + chord(1)) / (2.0 * length * length)).exp()
    }

    /// Everything at once, without filter, poses that stand for others, or Schur complement: the covariance of all
    /// records of one heliostat as a dense matrix. The likelihood, what is left at new poses and how well it is known
    /// must be the same.
    #[test]
    fn a_dense_gaussian_process_says_the_same() {
        let options = FieldOptions {
            heliostats: 3,
            records: 14,
            records_a_day: 2,
            ..FieldOptions::new(4).unwrap()
        };
        let field = simulate_field(&options).unwrap();
        let campaigns = field.first(14);
        let how = JointOptions::new(options.site.latitude_rad());
        let fit = fit_joint(&campaigns, &how).unwrap();
        let shape = fit.structure.shape();
        let (amplitude, length): ([f64; 2], f64) = ([0.7, 0.5], 0.4);
        let rates = fit.hyper.rates();
        let campaign = &campaigns[1];
        let (rows, _) = fit.marked(1, campaign);
        let rest = shape.row() - column::REST;
        let live: Vec<usize> = (0..rows.len())
            .filter(|&r| rows.row(shape, r)[rest + column::SILENT] == 0.0)
            .collect();
        assert!(live.len() > 10);
        let jumps = |r: usize, axis: usize| -> f64 {
            (0..=r)
                .map(|r| rows.row(shape, r)[rest + column::JUMP + axis])
                .sum()
        };
        let n = 2 * live.len();
        let spread = &fit.hyper.spread;
        let matrix = |with: f64| {
            Mat::from_fn(n, n, |i, j| {
                let (r, c) = (live[i / 2], i % 2);
                let (q, d) = (live[j / 2], j % 2);
                let (one, other) = (rows.row(shape, r), rows.row(shape, q));
                let mut sum = 0.0;
                for a in 0..shape.still {
                    for b in 0..shape.still {
                        sum += one[2 * a + c] * spread[at(a.max(b), a.min(b))] * other[2 * b + d];
                    }
                }
                let of_common = |row: &[f64], k: usize, c: usize| row[2 * k + c];
                for k in 0..shape.common() {
                    let sigma = fit.prior_sigma[k];
                    sum += of_common(one, k, c) * sigma * sigma * of_common(other, k, d);
                }
                let days = (rows.days[r] - rows.days[q]).abs();
                let poses = [pose_of(campaign, rows.of[r]), pose_of(campaign, rows.of[q])];
                for axis in 0..2 {
                    let slopes = one[2 * REFERENCES[axis] + c] * other[2 * REFERENCES[axis] + d];
                    let wander: f64 = [axis, axis + 2]
                        .iter()
                        .map(|&k| rates.wander[k] * (-days / rates.days[k]).exp())
                        .sum();
                    let left = with * amplitude[axis].powi(2) * kernel(length, poses[0], poses[1]);
                    sum += slopes * (wander + left + jumps(r.min(q), axis));
                }
                if r == q {
                    let path = [one[rest + column::PATH], one[rest + column::PATH + 1]];
                    sum += rates.sun * path[c] * path[d];
                    if c == d {
                        sum += rates.beam
                            + rates.spot * one[rest + column::ON_TARGET]
                            + one[rest + column::STATED];
                    }
                }
                sum
            })
        };
        let seen = Mat::from_fn(n, 1, |i, _| {
            rows.row(shape, live[i / 2])[rest + column::SEEN + i % 2]
        });
        let likelihood = |with: f64| {
            let factor = matrix(with).llt(Side::Lower).unwrap();
            let explained = (seen.transpose() * factor.solve(&seen))[(0, 0)];
            let root = factor.L();
            let log: f64 = (0..n).map(|i| 2.0 * root[(i, i)].ln()).sum();
            0.5 * (explained + log)
        };
        let wide = fit.widen(&rows, campaign, length, 64);
        for (with, amplitude) in [(0.0, [0.0; 2]), (1.0, amplitude)] {
            let sum = wide.eliminated(amplitude).unwrap();
            let got = Common::new(&sum, &fit.prior_sigma).unwrap();
            let want = likelihood(with);
            // the poses leave at most a thousandth of the leftover's variance at a record
            let allowed = 1e-6 + 0.02 * with;
            let found = got.minus_log_likelihood;
            assert!((found - want).abs() < allowed, "{found} {want}");
        }

        let sum = wide.eliminated(amplitude).unwrap();
        let common = Common::new(&sum, &fit.prior_sigma).unwrap();
        let left = wide.left(amplitude).unwrap();
        let both = wide.both(&left, &common);
        let factor = matrix(1.0).llt(Side::Lower).unwrap();
        let solved = factor.solve(&seen);
        let poses = wide.seen.poses.len();
        let c = wide.narrow.common();
        for (r, away) in [(0, 0.0), (3, 0.0), (7, 0.1), (9, 0.2)] {
            let mut pose = pose_of(campaign, rows.of[live[r]]);
            pose[0] += away;
            let features = wide.seen.features(pose);
            for axis in 0..2 {
                let with = Mat::from_fn(n, 1, |i, _| {
                    let record = live[i / 2];
                    let row = rows.row(shape, record);
                    let near = kernel(length, pose, pose_of(campaign, rows.of[record]));
                    row[2 * REFERENCES[axis] + i % 2] * amplitude[axis].powi(2) * near
                });
                let want = (with.transpose() * &solved)[(0, 0)];
                let known = (with.transpose() * factor.solve(&with))[(0, 0)];
                let want_variance = amplitude[axis].powi(2) - known;
                let got = dot(&features, &both.mean[c + axis * poses..][..poses]);
                let mut variance = amplitude[axis].powi(2) * wide.seen.unknown(&features);
                for (i, x) in features.iter().enumerate() {
                    for (j, y) in features.iter().enumerate() {
                        let (i, j) = (c + axis * poses + i, c + axis * poses + j);
                        variance += x * y * both.covariance[i * both.mean.len() + j];
                    }
                }
                assert!((got - want).abs() < 0.01, "{r} {axis}: {got} {want}");
                assert!(
                    (variance.sqrt() - want_variance.sqrt()).abs() < 0.01,
                    "{r} {axis}: {variance} {want_variance}"
                );
            }
        }
    }
}
