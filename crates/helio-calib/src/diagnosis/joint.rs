//! One model for a whole campaign: shared geometry, own encoder references for each epoch.
//!
//! The residual is the reflected direction r = -s + 2 (s·n) n along two directions across the one to
//! the measured spot, in mrad: no beam misses it, and it is nearly linear in the parameters.

use faer::dyn_stack::{MemBuffer, MemStack};
use faer::linalg::qr::no_pivoting::factor::{qr_in_place, qr_in_place_scratch};
use faer::{Mat, Par};

use crate::fit::{Constraint, FitOptions, Start};
use crate::loss::median;
use crate::measures::{angle_rad, cross, dot, reflected};
use crate::model::{Pose, normal};
use crate::observation::{Mount, Observation, Sighting};
use crate::parameters::{COUNT, Parameter, Parameters};

/// Parameters that this model knows: all but the mirror offset.
pub const ANGLES: usize = 6;
/// The two that may differ between epochs, as indices of [`Parameters::values`].
pub const REFERENCES: [usize; 2] = [
    Parameter::AzimuthReference as usize,
    Parameter::ElevationReference as usize,
];
/// The four that may not.
pub const GEOMETRY: [usize; 4] = [
    Parameter::Tilt1 as usize,
    Parameter::Tilt2 as usize,
    Parameter::AxisNonorthogonality as usize,
    Parameter::MirrorTilt as usize,
];
/// What the geometry of a mount is expected to be within \[rad\]: keeps directions that the records do not
/// determine from running away while records are judged. The fits that are reported do without.
const EXPECTED_GEOMETRY_RAD: f64 = 0.1;
/// Beam error at which an expectation of one standard deviation weighs as much as a record \[mrad\].
const EXPECTED_BEAM_MRAD: f64 = 1.0;
/// Student's degrees of freedom while records are judged.
const DEGREES: f64 = 3.0;

/// A robust solution is near enough where an iteration gains less than this share of its cost: what is computed with it
/// are a scale and weights.
const ROBUST_GAIN: f64 = 1e-6;

/// A record along its mount's axes.
#[derive(Debug, Clone, Copy)]
pub struct Record {
    /// Which observation.
    pub row: usize,
    /// For the formula of the crate.
    pub sighting: Sighting<f64>,
    /// Unit vector mirror → measured spot.
    pub to_spot: [f64; 3],
    /// Two directions across it.
    across: [[f64; 3]; 2],
    /// How much surer than the middle one, by the stated sigmas; 1 without.
    pub precision: f64,
}

fn unit(a: [f64; 3]) -> [f64; 3] {
    let norm = libm::sqrt(dot(a, a));
    a.map(|x| x / norm)
}

impl Record {
    pub fn new(mount: &Mount, row: usize, observation: &Observation) -> Self {
        let sighting = Sighting::new(mount, observation);
        let spot = observation.plane.point(observation.u_m, observation.v_m);
        let from_pivot = mount.components(spot - mount.pivot);
        // The mirror centre lies along the normal, which halves sun and spot: twice is enough (Shen 2016).
        let mut to_spot = unit(from_pivot);
        for _ in 0..2 {
            let n = unit([0, 1, 2].map(|k| sighting.sun[k] + to_spot[k]));
            to_spot = unit([0, 1, 2].map(|k| from_pivot[k] - mount.mirror_offset_m * n[k]));
        }
        // any direction that is not along the beam starts the pair
        let least = (0..3)
            .min_by(|&i, &j| to_spot[i].abs().total_cmp(&to_spot[j].abs()))
            .unwrap_or(0);
        let mut other = [0.0; 3];
        other[least] = 1.0;
        let first = unit(cross(to_spot, other));
        let second = cross(to_spot, first);
        Self {
            row,
            sighting,
            to_spot,
            across: [first, second],
            precision: 1.0,
        }
    }

    /// The normal that would send the beam to the measured spot.
    pub fn wanted_normal(&self) -> [f64; 3] {
        unit([0, 1, 2].map(|k| self.sighting.sun[k] + self.to_spot[k]))
    }

    /// Unit vector of the beam.
    fn beam(&self, pose: &Pose<f64>) -> [f64; 3] {
        reflected(self.sighting.sun, normal(pose, &self.sighting).n)
    }

    /// Residual \[mrad\].
    pub fn residual(&self, pose: &Pose<f64>) -> [f64; 2] {
        let r = self.beam(pose);
        self.across.map(|e| 1e3 * dot(e, r))
    }

    /// Residual \[mrad\] and its slopes \[mrad/rad\].
    pub fn linearised(&self, pose: &Pose<f64>) -> ([f64; 2], [[f64; ANGLES]; 2]) {
        let bent = normal(pose, &self.sighting);
        let s = self.sighting.sun;
        let n = bent.n;
        let sn = dot(s, n);
        let r = reflected(s, n);
        let residual = self.across.map(|e| 1e3 * dot(e, r));
        // dr = 2 ((s·dn) n + (s·n) dn): both products taken once for all parameters
        let slopes = self.across.map(|e| {
            let en = dot(e, n);
            let turn: [f64; 3] = core::array::from_fn(|k| 2e3 * (en * s[k] + sn * e[k]));
            bent.slopes.map(|dn| dot(turn, dn))
        });
        (residual, slopes)
    }

    /// Angle between the beam and the measured spot \[mrad\].
    pub fn beam_mrad(&self, pose: &Pose<f64>) -> f64 {
        1e3 * angle_rad(self.beam(pose), self.to_spot)
    }

    /// Squared distance of the beam's end from the spot's on the unit sphere: grows with the angle, at less work.
    pub fn chord2(&self, pose: &Pose<f64>) -> f64 {
        let r = self.beam(pose);
        let off: [f64; 3] = core::array::from_fn(|k| r[k] - self.to_spot[k]);
        dot(off, off)
    }
}

/// Makes records ready, with precisions from their stated sigmas: of the angle as seen from the heliostat,
/// over the middle one.
pub fn records(mount: &Mount, observations: &[Observation], rows: &[usize]) -> Vec<Record> {
    let mut records: Vec<Record> = rows
        .iter()
        .map(|&row| Record::new(mount, row, &observations[row]))
        .collect();
    let angles: Option<Vec<f64>> = rows
        .iter()
        .map(|&row| {
            let o = &observations[row];
            let slant_m = (o.plane.point(o.u_m, o.v_m) - mount.pivot).norm();
            o.sigma_m.map(|sigma_m| sigma_m / slant_m)
        })
        .collect();
    if let Some(angles) = angles {
        let middle = median(angles.clone());
        for (record, angle) in records.iter_mut().zip(angles) {
            record.precision = middle / angle;
        }
    }
    records
}

/// What is free and what is expected.
#[derive(Debug, Clone, Copy)]
pub struct Frame {
    free: [bool; ANGLES],
    /// Mean and standard deviation that a parameter is drawn to.
    expected: [Option<(f64, f64)>; ANGLES],
    /// True where that is the caller's prior.
    stated: [bool; ANGLES],
    /// Values at the start.
    pub start: [f64; COUNT],
}

impl Frame {
    pub fn new(mount: &Mount, options: &FitOptions) -> Self {
        let mut start = match options.start {
            Start::At(parameters) => parameters.values,
            Start::Cold | Start::Zeros => [0.0; COUNT],
        };
        if !matches!(options.start, Start::At(_)) {
            start[Parameter::MirrorOffset as usize] = mount.mirror_offset_m;
        }
        let mut expected = [None; ANGLES];
        for k in GEOMETRY {
            expected[k] = Some((0.0, EXPECTED_GEOMETRY_RAD));
        }
        let mut free = [true; ANGLES];
        let mut stated = [false; ANGLES];
        for k in 0..ANGLES {
            match options.constraints[k] {
                Constraint::Free => {}
                Constraint::Held => free[k] = false,
                Constraint::Prior { mean, sigma } => {
                    expected[k] = Some((mean, sigma));
                    stated[k] = true;
                }
            }
        }
        Self {
            free,
            expected,
            stated,
            start,
        }
    }

    /// Of a mount of which nothing is known but how far mounts are from perfect \[rad, one standard deviation\].
    pub fn expecting(mount: &Mount, geometry_rad: f64, references_rad: f64) -> Self {
        let mut frame = Self::new(mount, &FitOptions::default());
        for k in GEOMETRY {
            frame.expected[k] = Some((0.0, geometry_rad));
        }
        for k in REFERENCES {
            frame.expected[k] = Some((0.0, references_rad));
        }
        frame
    }

    pub fn is_free(&self, k: usize) -> bool {
        self.free[k]
    }

    /// How many angles one epoch has.
    pub fn count(&self) -> usize {
        self.free.iter().filter(|&&f| f).count()
    }

    /// Standard deviations that the caller stated, by parameter.
    pub fn stated(&self) -> Vec<(usize, f64)> {
        (0..ANGLES)
            .filter(|&k| self.free[k] && self.stated[k])
            .filter_map(|k| self.expected[k].map(|(_, sigma)| (k, sigma)))
            .collect()
    }

    pub fn references_free(&self) -> bool {
        REFERENCES.iter().any(|&k| self.free[k])
    }
}

/// Parameters of a campaign.
#[derive(Debug, Clone, PartialEq)]
pub struct Model {
    /// Geometry; the references in here are not looked at.
    pub shared: [f64; COUNT],
    /// References of each epoch.
    pub references: Vec<[f64; 2]>,
}

impl Model {
    pub fn parameters(&self, epoch: usize) -> Parameters {
        let mut values = self.shared;
        for (k, value) in REFERENCES.into_iter().zip(self.references[epoch]) {
            values[k] = value;
        }
        Parameters { values }
    }

    pub fn poses(&self) -> Vec<Pose<f64>> {
        (0..self.references.len())
            .map(|epoch| Pose::of(&self.parameters(epoch)))
            .collect()
    }

    /// The same with one epoch only.
    pub fn single(parameters: &Parameters) -> Self {
        Self {
            shared: parameters.values,
            references: vec![REFERENCES.map(|k| parameters.values[k])],
        }
    }
}

/// How residuals count.
#[derive(Debug, Clone, Copy)]
pub enum Judge<'a> {
    /// Squares of those that are marked.
    Marked(&'a [bool]),
    /// Student's t with this scale per direction \[mrad\], of those that are marked.
    Student(&'a [bool], f64),
}

impl Judge<'_> {
    /// Cost of a squared residual.
    fn cost(self, i: usize, square: f64) -> f64 {
        match self {
            Self::Marked(marks) if marks[i] => square,
            Self::Student(marks, scale) if marks[i] => {
                let variance = scale * scale;
                (DEGREES + 2.0) * variance * libm::log1p(square / (variance * DEGREES))
            }
            _ => 0.0,
        }
    }

    /// Its weight.
    fn weight(self, i: usize, square: f64) -> f64 {
        match self {
            Self::Marked(marks) if marks[i] => 1.0,
            Self::Student(marks, scale) if marks[i] => {
                (DEGREES + 2.0) / (DEGREES + square / (scale * scale))
            }
            _ => 0.0,
        }
    }
}

/// Squared beam residuals of all records \[mrad²\], over their precision.
pub fn squares(records: &[Record], epochs: &[usize], model: &Model) -> Vec<f64> {
    let poses = model.poses();
    records
        .iter()
        .zip(epochs)
        .map(|(record, &epoch)| {
            let beam = record.precision * record.beam_mrad(&poses[epoch]);
            beam * beam
        })
        .collect()
}

/// What is asked for leaving the expected values.
pub fn expectation(frame: &Frame, model: &Model) -> f64 {
    let mut cost = 0.0;
    let mut add = |k: usize, value: f64| {
        if let (true, Some((mean, sigma))) = (frame.free[k], frame.expected[k]) {
            let z = EXPECTED_BEAM_MRAD * (value - mean) / sigma;
            cost += z * z;
        }
    };
    for k in GEOMETRY {
        add(k, model.shared[k]);
    }
    for references in &model.references {
        for (k, &value) in REFERENCES.into_iter().zip(references) {
            add(k, value);
        }
    }
    cost
}

fn cost(
    frame: &Frame,
    records: &[Record],
    epochs: &[usize],
    model: &Model,
    judge: Judge<'_>,
) -> f64 {
    let poses = model.poses();
    let mut cost = expectation(frame, model);
    for (i, (record, &epoch)) in records.iter().zip(epochs).enumerate() {
        let r = record.residual(&poses[epoch]);
        let square = record.precision * record.precision * (r[0] * r[0] + r[1] * r[1]);
        cost += judge.cost(i, square);
    }
    cost
}

/// Columns of the Jacobian: free geometry, then the free references epoch by epoch.
#[derive(Debug, Clone)]
pub struct Columns {
    geometry: Vec<usize>,
    references: Vec<usize>,
    epochs: usize,
}

impl Columns {
    pub fn new(frame: &Frame, epochs: usize) -> Self {
        Self {
            geometry: GEOMETRY.into_iter().filter(|&k| frame.free[k]).collect(),
            references: (0..2).filter(|&i| frame.free[REFERENCES[i]]).collect(),
            epochs,
        }
    }

    pub fn count(&self) -> usize {
        self.geometry.len() + self.epochs * self.references.len()
    }

    /// Places the slopes of a record of an epoch.
    pub fn place(&self, epoch: usize, slopes: &[f64; ANGLES], mut put: impl FnMut(usize, f64)) {
        for (column, &k) in self.geometry.iter().enumerate() {
            put(column, slopes[k]);
        }
        let first = self.geometry.len() + epoch * self.references.len();
        for (column, &i) in self.references.iter().enumerate() {
            put(first + column, slopes[REFERENCES[i]]);
        }
    }

    fn value<'m>(&self, model: &'m mut Model, column: usize) -> (usize, &'m mut f64) {
        match self.geometry.get(column) {
            Some(&k) => (k, &mut model.shared[k]),
            None => {
                let rest = column - self.geometry.len();
                let i = self.references[rest % self.references.len()];
                (
                    REFERENCES[i],
                    &mut model.references[rest / self.references.len()][i],
                )
            }
        }
    }
}

/// Solves least squares by QR; the right side is the last column of the matrix, which is used up.
fn least_squares(matrix: &mut Mat<f64>, scratch: &mut MemBuffer) -> Vec<f64> {
    let n = matrix.ncols() - 1;
    // one column at a time: blocks are for larger matrices
    let mut reflections = Mat::<f64>::zeros(1, n + 1);
    qr_in_place(
        matrix.as_mut(),
        reflections.as_mut(),
        Par::Seq,
        MemStack::new(scratch),
        Default::default(),
    );
    let mut solution = vec![0.0; n];
    for i in (0..n).rev() {
        let mut rest = matrix[(i, n)];
        for k in i + 1..n {
            rest -= matrix[(i, k)] * solution[k];
        }
        solution[i] = rest / matrix[(i, i)];
    }
    solution
}

/// Levenberg-Marquardt, each step by QR of the weighted Jacobian over its damping.
pub fn solve(
    frame: &Frame,
    records: &[Record],
    epochs: &[usize],
    start: Model,
    judge: Judge<'_>,
    iterations: usize,
) -> (Model, f64) {
    let columns = Columns::new(frame, start.references.len());
    let n = columns.count();
    let mut model = start;
    let mut best = cost(frame, records, epochs, &model, judge);
    if n == 0 {
        return (model, best);
    }
    let enough = match judge {
        Judge::Marked(_) => 1e-10,
        Judge::Student(..) => ROBUST_GAIN,
    };
    let mut damping = 1e-7;
    let expected = 2 * records.len();
    let mut system = Mat::<f64>::zeros(expected + 2 * n, n + 1);
    let mut work = system.clone();
    let mut scratch = MemBuffer::new(qr_in_place_scratch::<f64>(
        expected + 2 * n,
        n + 1,
        1,
        Par::Seq,
        Default::default(),
    ));
    for _ in 0..iterations {
        let poses = model.poses();
        system.fill(0.0);
        for (i, (record, &epoch)) in records.iter().zip(epochs).enumerate() {
            let (r, slopes) = record.linearised(&poses[epoch]);
            let square = record.precision * record.precision * (r[0] * r[0] + r[1] * r[1]);
            let weight = judge.weight(i, square);
            if weight == 0.0 {
                continue;
            }
            let root = libm::sqrt(weight) * record.precision;
            for (c, slopes) in slopes.iter().enumerate() {
                columns.place(epoch, slopes, |column, value| {
                    system[(2 * i + c, column)] = root * value;
                });
                system[(2 * i + c, n)] = -root * r[c];
            }
        }
        for column in 0..n {
            let (k, value) = columns.value(&mut model, column);
            if let Some((mean, sigma)) = frame.expected[k] {
                system[(expected + column, column)] = EXPECTED_BEAM_MRAD / sigma;
                system[(expected + column, n)] = EXPECTED_BEAM_MRAD * (mean - *value) / sigma;
            }
        }
        let norms: Vec<f64> = (0..n)
            .map(|column| {
                let squares = system.col_as_slice(column).iter().map(|x| x * x);
                libm::sqrt(squares.sum()).max(1e-6)
            })
            .collect();
        let mut moved = None;
        for _ in 0..11 {
            work.copy_from(&system);
            for (column, norm) in norms.iter().enumerate() {
                work[(expected + n + column, column)] = libm::sqrt(damping) * norm;
            }
            let step = least_squares(&mut work, &mut scratch);
            let mut trial = model.clone();
            let mut largest = 0.0_f64;
            for (column, step) in step.iter().enumerate() {
                *columns.value(&mut trial, column).1 += step;
                largest = largest.max(step.abs());
            }
            let now = cost(frame, records, epochs, &trial, judge);
            if now <= best && largest.is_finite() {
                damping = (0.2 * damping).max(1e-9);
                moved = Some((trial, now, largest));
                break;
            }
            damping *= 10.0;
        }
        let Some((trial, now, largest)) = moved else {
            break;
        };
        let gain = best - now;
        (model, best) = (trial, now);
        if largest < 1e-9 || gain <= enough * best {
            break;
        }
    }
    (model, best)
}
