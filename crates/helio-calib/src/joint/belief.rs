//! What is known of one heliostat (or of some, in lanes), and how a record changes it: a Kalman filter whose
//! mean is a linear function of what the whole field has in common.
//!
//! With s the heliostat's own unknowns and b the common ones, s given b is normal with mean m + G b and
//! covariance P. A record y = H s + F b + e, e of covariance R, tells of b through h = F + H G with the
//! covariance S = H P Hᵀ + R, and of s given b in the usual way. Summed over records, hᵀ S⁻¹ h and
//! hᵀ S⁻¹ (y - H m) are the normal equations of b with the heliostat's own block eliminated: the Schur
//! complement of the arrow matrix of the whole field, one record at a time.

use crate::model::Real;

/// What the filter computes with.
pub(super) trait Number: Real {
    fn square_root(self) -> Self;
    /// 1 where it is this number, else 0.
    fn is(self, value: f64) -> Self;
}

impl Number for f64 {
    #[inline(always)]
    fn square_root(self) -> Self {
        libm::sqrt(self)
    }
    #[inline(always)]
    fn is(self, value: f64) -> Self {
        Self::from(u8::from(self == value))
    }
}

/// Zero points that wander: two of either axis, one slow and one fast.
pub(super) const WANDERING: usize = 4;
/// Where the references stand among the heliostat's own unknowns.
pub(super) const REFERENCES: [usize; 2] = [2, 4];

/// Numbers of unknowns.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Shape {
    /// Of a heliostat, at rest: six angles, then the causes of which each has its own value.
    pub still: usize,
    /// Causes in common.
    pub causes: usize,
    /// Whether the mean is kept as a function of what is common; if not, that is taken as known.
    pub tied: bool,
}

impl Shape {
    /// Of a heliostat, the wandering ones too.
    pub const fn own(self) -> usize {
        self.still + WANDERING
    }
    /// In common: means of those at rest, then the causes.
    pub const fn common(self) -> usize {
        if self.tied {
            self.still + self.causes
        } else {
            0
        }
    }
    /// Numbers of a linearised record.
    pub const fn row(self) -> usize {
        2 * self.still + 2 * self.causes + column::REST
    }
    pub const fn triangle(n: usize) -> usize {
        n * (n + 1) / 2
    }
}

/// After the derivatives of both components by those at rest and by the causes.
pub(super) mod column {
    /// What is to be explained \[mrad\], two components across the beam.
    pub const SEEN: usize = 0;
    /// Motion of the spot with the sun's time \[mrad/s\].
    pub const PATH: usize = 2;
    /// Stated variance \[mrad²\].
    pub const STATED: usize = 4;
    /// What multiplies the variance on the target \[mrad²/m²\]; zero where one is stated.
    pub const ON_TARGET: usize = 5;
    /// Days since the record before.
    pub const DAYS: usize = 6;
    /// Variances added to the references just before \[mrad²\].
    pub const JUMP: usize = 7;
    /// 1 where the record is not believed.
    pub const SILENT: usize = 9;
    /// How many.
    pub const REST: usize = 10;
}

/// How records scatter and zero points wander, ready for the filter.
#[derive(Debug, Clone, Copy)]
pub(super) struct Rates {
    /// Variance of either component \[mrad²\].
    pub beam: f64,
    /// On the target \[m²\].
    pub spot: f64,
    /// Of the sun's time \[s²\].
    pub sun: f64,
    /// Variance of each wandering zero point \[mrad²\]: slow of either axis, fast of either axis.
    pub wander: [f64; WANDERING],
    /// Days in which each is forgotten by a factor e.
    pub days: [f64; WANDERING],
}

/// What is known.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Belief<T> {
    pub shape: Shape,
    /// m: of each own unknown where every common one is zero.
    pub mean: Vec<T>,
    /// G, row by row.
    pub gain: Vec<T>,
    /// P, lower triangle row by row.
    pub spread: Vec<T>,
    /// Columns of H and P Hᵀ and rows of h, kept for the next record.
    pub room: Room<T>,
}

/// See [`Belief`].
#[derive(Debug, Clone, PartialEq, Default)]
pub(super) struct Room<T> {
    slopes: Vec<[T; 2]>,
    pulled: Vec<[T; 2]>,
    common: Vec<[T; 2]>,
}

impl<T: Number> Room<T> {
    pub fn of(shape: Shape) -> Self {
        let zero = [T::splat(0.0); 2];
        Self {
            slopes: vec![zero; shape.own()],
            pulled: vec![zero; shape.own()],
            common: vec![zero; shape.common()],
        }
    }
}

/// What records tell of what is common.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Told<T> {
    /// Lower triangle.
    pub matrix: Vec<T>,
    pub vector: Vec<T>,
    /// Sum of squares of what is left where every common unknown is zero.
    pub square: T,
    /// Product of the determinants of S since it was last taken.
    pub determinant: T,
}

impl<T: Number> Told<T> {
    pub fn nothing(shape: Shape) -> Self {
        let zero = T::splat(0.0);
        Self {
            matrix: vec![zero; Shape::triangle(shape.common())],
            vector: vec![zero; shape.common()],
            square: zero,
            determinant: T::splat(1.0),
        }
    }
}

/// Where element (i, j), j <= i, of a lower triangle stands.
#[inline(always)]
pub(super) const fn at(i: usize, j: usize) -> usize {
    i * (i + 1) / 2 + j
}

/// Through the inverse of a square root, of which the diagonal is given as reciprocals.
#[inline(always)]
fn through<T: Number>([per11, r21, per22]: [T; 3], v: [T; 2]) -> [T; 2] {
    let first = v[0] * per11;
    [first, (v[1] - r21 * first) * per22]
}

/// A record before it is believed.
#[derive(Debug, Clone, Copy)]
pub(super) struct Surprise<T> {
    /// Lower triangle of the square root of S.
    root: [T; 3],
    /// y - H m, through the inverse of that root.
    left: [T; 2],
    /// Squared length of the same with the common unknowns as given: chi-squared with two degrees of freedom.
    pub square: T,
}

impl<T: Number> Belief<T> {
    /// Before any record: those at rest as the field's (`spread` is their lower triangle), zero points
    /// anywhere in their range.
    pub fn of_field(shape: Shape, spread: &[f64], rates: &Rates) -> Self {
        let (own, common) = (shape.own(), shape.common());
        let zero = T::splat(0.0);
        let mut belief = Self {
            shape,
            mean: vec![zero; own],
            gain: vec![zero; own * common],
            spread: vec![zero; Shape::triangle(own)],
            room: Room::of(shape),
        };
        for (to, &from) in belief.spread.iter_mut().zip(spread) {
            *to = T::splat(from);
        }
        if shape.tied {
            for i in 0..shape.still {
                belief.gain[i * common + i] = T::splat(1.0);
            }
        }
        for (k, &variance) in rates.wander.iter().enumerate() {
            let i = shape.still + k;
            belief.spread[at(i, i)] = T::splat(variance);
        }
        belief
    }

    /// Time goes by: `kept` is what is left of each wandering zero point, `added` its new variance.
    #[inline(always)]
    pub fn wait(&mut self, kept: [T; WANDERING], added: [T; WANDERING]) {
        let (still, common) = (self.shape.still, self.shape.common());
        for k in 0..WANDERING {
            let i = still + k;
            self.mean[i] = self.mean[i] * kept[k];
            for g in &mut self.gain[i * common..(i + 1) * common] {
                *g = *g * kept[k];
            }
            for j in 0..still {
                let p = &mut self.spread[at(i, j)];
                *p = *p * kept[k];
            }
            for l in 0..k {
                let p = &mut self.spread[at(i, still + l)];
                *p = *p * (kept[k] * kept[l]);
            }
            let p = &mut self.spread[at(i, i)];
            *p = kept[k].mul_add(kept[k] * *p, added[k]);
        }
    }

    /// The references may have jumped: their variances grow.
    #[inline(always)]
    pub fn loosen(&mut self, variances: [T; 2]) {
        for (variance, i) in variances.into_iter().zip(REFERENCES) {
            let p = &mut self.spread[at(i, i)];
            *p = *p + variance;
        }
    }

    /// Holds a record (see [`column`]) against what is known; its components scatter by the variance `extra`
    /// \[mrad²\] more than `rates` say.
    #[inline(always)]
    pub fn weigh(&mut self, row: &[T], rates: &Rates, extra: f64, common: &[f64]) -> Surprise<T> {
        let Shape { still, causes, .. } = self.shape;
        let (own, of_common) = (self.shape.own(), self.shape.common());
        let (slopes, rest) = row.split_at(2 * still);
        let (by_cause, rest) = rest.split_at(2 * causes);
        let room = &mut self.room;
        for (k, slope) in room.slopes[..still].iter_mut().enumerate() {
            *slope = [slopes[2 * k], slopes[2 * k + 1]];
        }
        for k in 0..WANDERING {
            room.slopes[still + k] = room.slopes[REFERENCES[k % 2]];
        }
        // P Hᵀ
        for pulled in &mut room.pulled {
            *pulled = [T::splat(0.0); 2];
        }
        for i in 0..own {
            let h = room.slopes[i];
            let line = &self.spread[at(i, 0)..at(i, 0) + i + 1];
            let mut sum = [line[i] * h[0], line[i] * h[1]];
            for j in 0..i {
                let p = line[j];
                let other = room.slopes[j];
                sum = [p.mul_add(other[0], sum[0]), p.mul_add(other[1], sum[1])];
                let pulled = &mut room.pulled[j];
                *pulled = [p.mul_add(h[0], pulled[0]), p.mul_add(h[1], pulled[1])];
            }
            let pulled = &mut room.pulled[i];
            *pulled = [pulled[0] + sum[0], pulled[1] + sum[1]];
        }
        // S
        let path = [rest[column::PATH], rest[column::PATH + 1]];
        let beam = rest[column::ON_TARGET].mul_add(T::splat(rates.spot), T::splat(rates.beam))
            + (rest[column::STATED] + T::splat(extra));
        let sun = T::splat(rates.sun);
        let mut s = [
            (sun * path[0]).mul_add(path[0], beam),
            (sun * path[0]) * path[1],
            (sun * path[1]).mul_add(path[1], beam),
        ];
        let mut left = [rest[column::SEEN], rest[column::SEEN + 1]];
        for i in 0..own {
            let (h, v) = (room.slopes[i], room.pulled[i]);
            s = [
                h[0].mul_add(v[0], s[0]),
                h[1].mul_add(v[0], s[1]),
                h[1].mul_add(v[1], s[2]),
            ];
            let m = self.mean[i];
            left = [left[0] - h[0] * m, left[1] - h[1] * m];
        }
        // h = F + H G
        for (k, c) in room.common.iter_mut().enumerate() {
            *c = if k < still {
                [T::splat(0.0); 2]
            } else {
                let cause = k - still;
                [by_cause[2 * cause], by_cause[2 * cause + 1]]
            };
        }
        for i in 0..own {
            let h = room.slopes[i];
            let line = &self.gain[i * of_common..(i + 1) * of_common];
            for (c, &g) in room.common.iter_mut().zip(line) {
                *c = [h[0].mul_add(g, c[0]), h[1].mul_add(g, c[1])];
            }
        }
        // S = root rootᵀ
        let one = T::splat(1.0);
        let r11 = s[0].square_root();
        let r21 = s[1] / r11;
        let r22 = (s[2] - r21 * r21).square_root();
        let (per11, per22) = (one / r11, one / r22);
        let root = [per11, r21, per22];
        left = through(root, left);
        for v in &mut room.pulled {
            *v = through(root, *v);
        }
        for c in &mut room.common {
            *c = through(root, *c);
        }
        let mut with_common = left;
        for (c, &b) in room.common.iter().zip(common) {
            let b = T::splat(b);
            with_common = [with_common[0] - c[0] * b, with_common[1] - c[1] * b];
        }
        Surprise {
            root: [r11, r21, r22],
            left,
            square: with_common[1].mul_add(with_common[1], with_common[0] * with_common[0]),
        }
    }

    /// Lets the record that was weighed last tell nothing where `live` is 0, and all where it is 1.
    #[inline(always)]
    pub fn mute(&mut self, surprise: &mut Surprise<T>, live: T) {
        let one = T::splat(1.0);
        for pair in self.room.pulled.iter_mut().chain(&mut self.room.common) {
            *pair = [pair[0] * live, pair[1] * live];
        }
        surprise.left = [surprise.left[0] * live, surprise.left[1] * live];
        surprise.square = surprise.square * live;
        let [r11, r21, r22] = surprise.root;
        let dead = one - live;
        surprise.root = [live.mul_add(r11, dead), r21, live.mul_add(r22, dead)];
    }

    /// Believes the record that was weighed last, and adds what it tells of what is common.
    #[inline(always)]
    pub fn believe(&mut self, surprise: &Surprise<T>, told: &mut Told<T>) {
        let of_common = self.shape.common();
        let left = surprise.left;
        let room = &self.room;
        for (i, &w) in room.pulled.iter().enumerate() {
            let m = &mut self.mean[i];
            *m = w[0].mul_add(left[0], w[1].mul_add(left[1], *m));
            let minus = [-w[0], -w[1]];
            let line = &mut self.gain[i * of_common..(i + 1) * of_common];
            for (g, &c) in line.iter_mut().zip(&room.common) {
                *g = minus[0].mul_add(c[0], minus[1].mul_add(c[1], *g));
            }
            let line = &mut self.spread[at(i, 0)..at(i, 0) + i + 1];
            for (p, &other) in line.iter_mut().zip(&room.pulled) {
                *p = minus[0].mul_add(other[0], minus[1].mul_add(other[1], *p));
            }
        }
        for (i, &c) in room.common.iter().enumerate() {
            let v = &mut told.vector[i];
            *v = c[0].mul_add(left[0], c[1].mul_add(left[1], *v));
            let line = &mut told.matrix[at(i, 0)..at(i, 0) + i + 1];
            for (m, &other) in line.iter_mut().zip(&room.common) {
                *m = c[0].mul_add(other[0], c[1].mul_add(other[1], *m));
            }
        }
        told.square = left[1].mul_add(left[1], left[0].mul_add(left[0], told.square));
        told.determinant = told.determinant * (surprise.root[0] * surprise.root[2]);
    }
}

impl Surprise<f64> {
    /// Logarithm of the determinant of S.
    pub fn log_determinant(&self) -> f64 {
        2.0 * libm::log(self.root[0] * self.root[2])
    }
}
