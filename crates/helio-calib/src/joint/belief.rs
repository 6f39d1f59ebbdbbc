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

/// Of what the mean is kept as a function; the rest of what is common is taken as known.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Tied {
    Nothing,
    /// Of the causes in common alone.
    Causes,
    /// Of the means of the unknowns at rest, then the causes.
    All,
}

/// Numbers of unknowns.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Shape {
    /// Of a heliostat, at rest: six angles, then the causes of which each has its own value.
    pub still: usize,
    /// Causes in common.
    pub causes: usize,
    pub tied: Tied,
}

impl Shape {
    /// Of a heliostat, the wandering ones too.
    pub const fn own(self) -> usize {
        self.still + WANDERING
    }
    /// In common, of those to which the mean is tied.
    pub const fn common(self) -> usize {
        match self.tied {
            Tied::Nothing => 0,
            Tied::Causes => self.causes,
            Tied::All => self.still + self.causes,
        }
    }
    /// Those of them that are means of unknowns at rest.
    pub const fn means(self) -> usize {
        match self.tied {
            Tied::Nothing | Tied::Causes => 0,
            Tied::All => self.still,
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
    /// G by columns: how each own unknown goes with the first common one, then with the second.
    gain: Vec<T>,
    /// P, row by row; the upper half is not used.
    spread: Vec<T>,
}

/// Columns of H and P Hᵀ and rows of h of the record that was weighed last.
#[derive(Debug, Clone, PartialEq)]
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

    /// h of the record that was weighed last, before it is believed.
    pub fn by_common(&self) -> &[[T; 2]] {
        &self.common
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

    /// Takes in more causes, of which nothing is told yet.
    pub fn grow(&mut self, shape: Shape) {
        let zero = T::splat(0.0);
        self.matrix.resize(Shape::triangle(shape.common()), zero);
        self.vector.resize(shape.common(), zero);
    }
}

/// Where element (i, j), j <= i, of a lower triangle stands.
#[inline(always)]
pub(super) const fn at(i: usize, j: usize) -> usize {
    i * (i + 1) / 2 + j
}

/// A record before it is believed: with S = L D Lᵀ, L of unit diagonal.
#[derive(Debug, Clone, Copy)]
pub(super) struct Surprise<T> {
    /// Below the diagonal of L.
    mixed: T,
    /// Of D, and its inverse.
    spread: [T; 2],
    per: [T; 2],
    /// y - H m through the inverse of L, where every common unknown that the mean is tied to is zero.
    left: [T; 2],
    /// The same with the common unknowns as given.
    expected: [T; 2],
}

/// The same code with the number of own unknowns known to the compiler, where it is one of the usual ones.
macro_rules! with_known {
    ($own:expr, |$n:ident| $body:expr) => {
        match $own {
            10 => {
                let $n: usize = 10;
                $body
            }
            11 => {
                let $n: usize = 11;
                $body
            }
            $n => $body,
        }
    };
}

/// Rows of a triangle one by one, the first ones without a loop: the compiler then knows their lengths.
macro_rules! each_row {
    ($n:expr, |$i:ident| $body:expr) => {
        each_row!(@ $n, $i, $body, 0 1 2 3 4 5 6 7 8 9 10);
        for $i in 11..$n {
            $body
        }
    };
    (@ $n:expr, $i:ident, $body:expr, $($k:literal)*) => {
        $(
            if $k < $n {
                let $i: usize = $k;
                $body
            }
        )*
    };
}

/// P Hᵀ, from the lower half of P.
#[inline(always)]
fn pull<T: Number>(own: usize, spread: &[T], slopes: &[[T; 2]], pulled: &mut [[T; 2]]) {
    let (spread, slopes, pulled) = (&spread[..own * own], &slopes[..own], &mut pulled[..own]);
    each_row!(own, |i| {
        let h = slopes[i];
        let line = &spread[i * own..i * own + i + 1];
        let mut sum = [line[i] * h[0], line[i] * h[1]];
        for j in 0..i {
            let p = line[j];
            sum = [
                p.mul_add(slopes[j][0], sum[0]),
                p.mul_add(slopes[j][1], sum[1]),
            ];
            pulled[j] = [p.mul_add(h[0], pulled[j][0]), p.mul_add(h[1], pulled[j][1])];
        }
        pulled[i] = sum;
    });
}

/// Takes w wᵀ from the lower half of P.
#[inline(always)]
fn settle<T: Number>(own: usize, spread: &mut [T], pulled: &[[T; 2]]) {
    let (spread, pulled) = (&mut spread[..own * own], &pulled[..own]);
    each_row!(own, |i| {
        let minus = [-pulled[i][0], -pulled[i][1]];
        let line = &mut spread[i * own..i * own + i + 1];
        for j in 0..i + 1 {
            let w = pulled[j];
            line[j] = minus[0].mul_add(w[0], minus[1].mul_add(w[1], line[j]));
        }
    });
}

/// H G, added to what stands there.
#[inline(always)]
fn join<T: Number>(own: usize, gain: &[T], slopes: &[[T; 2]], common: &mut [[T; 2]]) {
    let slopes = &slopes[..own];
    for (line, to) in gain.chunks_exact(own).zip(common) {
        let mut sum = *to;
        for (&g, h) in line.iter().zip(slopes) {
            sum = [g.mul_add(h[0], sum[0]), g.mul_add(h[1], sum[1])];
        }
        *to = sum;
    }
}

/// Takes w cᵀ from the columns of the gain.
#[inline(always)]
fn take<T: Number>(own: usize, lines: &mut [T], of_line: &[[T; 2]], by: &[[T; 2]]) {
    let by = &by[..own];
    for (line, w) in lines.chunks_exact_mut(own).zip(of_line) {
        let minus = [-w[0], -w[1]];
        for (p, v) in line.iter_mut().zip(by) {
            *p = minus[0].mul_add(v[0], minus[1].mul_add(v[1], *p));
        }
    }
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
            spread: vec![zero; own * own],
        };
        for i in 0..shape.still {
            for j in 0..=i {
                belief.set_covariance(i, j, T::splat(spread[at(i, j)]));
            }
        }
        for i in 0..shape.means() {
            belief.set_gain(i, i, T::splat(1.0));
        }
        for (k, &variance) in rates.wander.iter().enumerate() {
            let i = shape.still + k;
            belief.set_covariance(i, i, T::splat(variance));
        }
        belief
    }

    /// How own unknown `i` goes with common unknown `k`.
    #[inline(always)]
    pub fn gain(&self, i: usize, k: usize) -> T {
        self.gain[k * self.shape.own() + i]
    }

    #[inline(always)]
    pub fn set_gain(&mut self, i: usize, k: usize, value: T) {
        let own = self.shape.own();
        self.gain[k * own + i] = value;
    }

    /// Of two own unknowns, with the common ones given.
    #[inline(always)]
    pub fn covariance(&self, i: usize, j: usize) -> T {
        self.spread[i.max(j) * self.shape.own() + i.min(j)]
    }

    #[inline(always)]
    pub fn set_covariance(&mut self, i: usize, j: usize, value: T) {
        let own = self.shape.own();
        self.spread[i.max(j) * own + i.min(j)] = value;
    }

    /// Time goes by: `kept` is what is left of each wandering zero point, `added` its new variance.
    #[inline(always)]
    pub fn wait(&mut self, kept: [T; WANDERING], added: [T; WANDERING]) {
        let (still, own) = (self.shape.still, self.shape.own());
        for k in 0..WANDERING {
            let i = still + k;
            self.mean[i] = self.mean[i] * kept[k];
            let line = &mut self.spread[i * own..(i + 1) * own];
            for p in &mut line[..still] {
                *p = *p * kept[k];
            }
            for l in 0..k {
                line[still + l] = line[still + l] * (kept[k] * kept[l]);
            }
            line[i] = kept[k].mul_add(kept[k] * line[i], added[k]);
        }
        for column in self.gain.chunks_exact_mut(own) {
            for (g, kept) in column[still..].iter_mut().zip(kept) {
                *g = *g * kept;
            }
        }
    }

    /// The references may have jumped: their variances grow.
    #[inline(always)]
    pub fn loosen(&mut self, variances: [T; 2]) {
        for (variance, i) in variances.into_iter().zip(REFERENCES) {
            let p = self.covariance(i, i) + variance;
            self.set_covariance(i, i, p);
        }
    }

    /// Holds a record (see [`column`]) against what is known.
    #[inline(always)]
    pub fn weigh(
        &self,
        row: &[T],
        rates: &Rates,
        common: &[f64],
        room: &mut Room<T>,
    ) -> Surprise<T> {
        let Shape { still, causes, .. } = self.shape;
        let (own, means) = (self.shape.own(), self.shape.means());
        let (slopes, rest) = row.split_at(2 * still);
        let (by_cause, rest) = rest.split_at(2 * causes);
        let Room {
            slopes: by_own,
            pulled,
            common: by_common,
        } = room;
        for (to, slope) in by_own.iter_mut().zip(slopes.as_chunks::<2>().0) {
            *to = *slope;
        }
        for k in 0..WANDERING {
            by_own[still + k] = by_own[REFERENCES[k % 2]];
        }
        // h = F + H G
        let (of_means, of_causes) = by_common.split_at_mut(means);
        of_means.fill([T::splat(0.0); 2]);
        for (to, slope) in of_causes.iter_mut().zip(by_cause.as_chunks::<2>().0) {
            *to = *slope;
        }
        with_known!(own, |n| {
            pull(n, &self.spread, by_own, pulled);
            join(n, &self.gain, by_own, by_common);
        });
        // S = H P Hᵀ + R
        let path = [rest[column::PATH], rest[column::PATH + 1]];
        let beam = rest[column::ON_TARGET].mul_add(T::splat(rates.spot), T::splat(rates.beam))
            + rest[column::STATED];
        let sun = T::splat(rates.sun);
        let mut s = [
            (sun * path[0]).mul_add(path[0], beam),
            (sun * path[0]) * path[1],
            (sun * path[1]).mul_add(path[1], beam),
        ];
        let mut left = [rest[column::SEEN], rest[column::SEEN + 1]];
        for ((h, v), &m) in by_own.iter().zip(&*pulled).zip(&self.mean) {
            s = [
                h[0].mul_add(v[0], s[0]),
                h[1].mul_add(v[0], s[1]),
                h[1].mul_add(v[1], s[2]),
            ];
            left = [left[0] - h[0] * m, left[1] - h[1] * m];
        }
        let one = T::splat(1.0);
        let first = one / s[0];
        let mixed = s[1] * first;
        let second = s[2] - mixed * s[1];
        left[1] = left[1] - mixed * left[0];
        let mut expected = left;
        for (c, &b) in by_common.iter().zip(common) {
            let b = T::splat(b);
            expected = [
                expected[0] - c[0] * b,
                expected[1] - (c[1] - mixed * c[0]) * b,
            ];
        }
        Surprise {
            mixed,
            spread: [s[0], second],
            per: [first, one / second],
            left,
            expected,
        }
    }

    /// Believes the record that was weighed last, and adds what it tells of what is common.
    #[inline(always)]
    pub fn believe(&mut self, surprise: &Surprise<T>, room: &mut Room<T>, told: &mut Told<T>) {
        let Room { pulled, common, .. } = room;
        let root = [surprise.per[0].square_root(), surprise.per[1].square_root()];
        let through = |[x, y]: [T; 2]| [x * root[0], (y - surprise.mixed * x) * root[1]];
        for v in pulled.iter_mut().chain(&mut *common) {
            *v = through(*v);
        }
        let left = [surprise.left[0] * root[0], surprise.left[1] * root[1]];
        for (m, w) in self.mean.iter_mut().zip(&*pulled) {
            *m = w[0].mul_add(left[0], w[1].mul_add(left[1], *m));
        }
        with_known!(self.shape.own(), |n| {
            settle(n, &mut self.spread, pulled);
            take(n, &mut self.gain, common, pulled);
        });
        let mut from = 0;
        for (i, &c) in common.iter().enumerate() {
            let v = &mut told.vector[i];
            *v = c[0].mul_add(left[0], c[1].mul_add(left[1], *v));
            let line = &mut told.matrix[from..from + i + 1];
            from += i + 1;
            for (m, &other) in line.iter_mut().zip(&*common) {
                *m = c[0].mul_add(other[0], c[1].mul_add(other[1], *m));
            }
        }
        told.square = left[0].mul_add(left[0], left[1].mul_add(left[1], told.square));
        told.determinant = told.determinant * surprise.determinant();
    }
}

impl Belief<f64> {
    /// From its mean, its gain row by row and the lower triangle of its covariance.
    pub fn of_parts(shape: Shape, mean: Vec<f64>, gain: &[f64], triangle: &[f64]) -> Self {
        let (own, common) = (shape.own(), shape.common());
        let mut belief = Self {
            shape,
            mean,
            gain: vec![0.0; own * common],
            spread: vec![0.0; own * own],
        };
        for i in 0..own {
            for k in 0..common {
                belief.set_gain(i, k, gain[i * common + k]);
            }
            for j in 0..=i {
                belief.set_covariance(i, j, triangle[at(i, j)]);
            }
        }
        belief
    }

    /// Takes in more causes, that no record has met yet.
    pub fn grow(&mut self, shape: Shape) {
        self.shape = shape;
        self.gain.resize(shape.own() * shape.common(), 0.0);
    }

    /// See [`of_parts`](Self::of_parts).
    pub fn gain_by_rows(&self) -> Vec<f64> {
        let common = 0..self.shape.common();
        (0..self.shape.own())
            .flat_map(|i| common.clone().map(move |k| self.gain(i, k)))
            .collect()
    }

    /// See [`of_parts`](Self::of_parts).
    pub fn triangle(&self) -> Vec<f64> {
        (0..self.shape.own())
            .flat_map(|i| (0..=i).map(move |j| self.covariance(i, j)))
            .collect()
    }
}

impl<T: Number> Surprise<T> {
    /// Squared length of what is left with the common unknowns as given: chi-squared with two degrees of freedom.
    #[inline(always)]
    pub fn square(&self) -> T {
        let [x, y] = self.expected;
        (x * self.per[0]).mul_add(x, (y * self.per[1]) * y)
    }

    /// Of S.
    #[inline(always)]
    pub fn determinant(&self) -> T {
        self.spread[0] * self.spread[1]
    }

    /// Lets the record tell nothing where `live` is 0, and all where it is 1.
    #[inline(always)]
    pub fn mute(&mut self, live: T) {
        let dead = T::splat(1.0) - live;
        for k in 0..2 {
            self.per[k] = self.per[k] * live;
            self.spread[k] = live.mul_add(self.spread[k], dead);
        }
    }

    /// S (first, mixed, second), and what is left with the common unknowns as given.
    #[inline(always)]
    pub fn plain(&self) -> ([T; 3], [T; 2]) {
        let [first, second] = self.spread;
        let both = self.mixed * first;
        let [x, y] = self.expected;
        (
            [first, both, self.mixed.mul_add(both, second)],
            [x, self.mixed.mul_add(x, y)],
        )
    }
}
