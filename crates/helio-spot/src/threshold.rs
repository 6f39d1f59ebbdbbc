//! Gray-level histograms and the thresholds that follow from them.
//!
//! A threshold `T` parts the gray values into background, `g < T`, and spot, `g >= T`, as (A.1) of
//! T/GRLM 02-2014 has it; libraries that keep `g > t` (OpenCV, scikit-image) call the same choice `t = T - 1`.

use crate::error::SpotError;
use crate::image::{Gray, View};
use crate::simd::{self, Kernel, Level};

/// How to choose the threshold.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
#[non_exhaustive]
pub enum Threshold {
    /// Otsu (1979): the two classes whose variance between each other is greatest. Where several
    /// thresholds do so, the lowest.
    #[default]
    Otsu,
    /// This gray value.
    Fixed(u32),
    /// Zack, Rogers & Latt (1977), "triangle": left out are gray values up to the one whose count lies farthest
    /// below the straight line from the most frequent gray value (of several, the darkest) to the end of the
    /// histogram's longer tail, or to the bright end where both are as long. Of several that are as far, the one
    /// nearest to that end; where none lies below the line, the darker of the line's ends.
    Triangle,
    /// Otsu's criterion with this many classes, 2 to 4: all but the brightest class are background. Of a
    /// picture with fewer gray values, each is a class.
    MultiOtsu {
        /// Number of classes.
        classes: u8,
    },
}

/// How many pixels of a picture have each gray value: 256 counts of an 8-bit picture, 65,536 of a 16-bit one.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct Histogram {
    counts: Vec<u32>,
}

impl Histogram {
    /// Counts a picture.
    ///
    /// # Errors
    /// [`SpotError::TooLarge`] for a picture of more than 2³² - 1 pixels.
    ///
    /// ```
    /// use helio_spot::{Histogram, View};
    /// let view = View::new(&[3_u8, 200, 3, 4], 2, 2)?;
    /// let histogram = Histogram::of(view)?;
    /// assert_eq!(histogram.counts()[3], 2);
    /// assert_eq!(histogram.at_least(4), 2);
    /// # Ok::<(), helio_spot::SpotError>(())
    /// ```
    pub fn of<P: Gray>(view: View<'_, P>) -> Result<Self, SpotError> {
        let mut counter = Counter::default();
        counter.count(Level::best(), view)?;
        Ok(counter.histogram)
    }

    /// The counts, darkest first.
    #[must_use]
    pub fn counts(&self) -> &[u32] {
        &self.counts
    }

    /// How many pixels are this bright or brighter.
    #[must_use]
    pub fn at_least(&self, gray: u32) -> u64 {
        let kept = self.counts.get(gray as usize..).unwrap_or_default();
        kept.iter().map(|&n| u64::from(n)).sum()
    }

    /// The darkest and the brightest gray value there is.
    #[must_use]
    pub fn range(&self) -> Option<(u32, u32)> {
        let first = self.counts.iter().position(|&n| n > 0)?;
        let last = self.counts.iter().rposition(|&n| n > 0)?;
        Some((first as u32, last as u32))
    }

    /// Gray values that occur, with their counts.
    fn occupied(&self) -> impl Iterator<Item = (u32, u32)> + '_ {
        (0..)
            .zip(self.counts.iter().copied())
            .filter(|bin| bin.1 > 0)
    }
}

impl Threshold {
    /// The lowest gray value that is kept, chosen from a histogram.
    ///
    /// A picture of one gray value has no two classes: every method but [`Fixed`](Self::Fixed) then answers
    /// one more than that value, which keeps nothing. The answer can therefore be one above white.
    ///
    /// # Errors
    /// [`SpotError::BadOption`] for a number of classes other than 2, 3 and 4.
    ///
    /// ```
    /// use helio_spot::{Histogram, Threshold, View};
    /// let view = View::new(&[10_u8, 12, 11, 200, 210, 12], 3, 2)?;
    /// assert_eq!(Threshold::Otsu.of(&Histogram::of(view)?)?, 13);
    /// # Ok::<(), helio_spot::SpotError>(())
    /// ```
    pub fn of(self, histogram: &Histogram) -> Result<u32, SpotError> {
        if let Self::MultiOtsu { classes } = self
            && !(2..=4).contains(&classes)
        {
            return Err(SpotError::BadOption {
                what: "the number of classes of the multi-level threshold",
                wanted: "2, 3 or 4",
                value: f64::from(classes),
            });
        }
        if let Self::Fixed(gray) = self {
            return Ok(gray);
        }
        let Some((first, last)) = histogram.range() else {
            return Ok(0);
        };
        if first == last {
            return Ok(first + 1);
        }
        Ok(match self {
            Self::Fixed(gray) => gray,
            Self::Triangle => triangle(&histogram.counts, first, last),
            Self::Otsu | Self::MultiOtsu { classes: 2 } => otsu(histogram),
            Self::MultiOtsu { classes } => multi_otsu(histogram, usize::from(classes)),
        })
    }
}

/// A way to part the gray values in two: d²/m is N² times the variance between the classes.
#[derive(Clone, Copy)]
struct Split {
    /// N₀·Σ - N·Σ₀, where N₀ pixels of gray sum Σ₀ are below the threshold.
    d: u128,
    /// N₀·N₁.
    m: u64,
    threshold: u32,
}

impl Split {
    /// d₁²/m₁ against d₂²/m₂, in doubles where these are sure and exactly where they are close.
    fn exceeds(&self, other: &Self) -> bool {
        let [ours, theirs] = [(self, other), (other, self)].map(|(a, b)| {
            let d = a.d as f64;
            d * d * b.m as f64
        });
        if (ours - theirs).abs() > 1e-12 * theirs {
            return ours > theirs;
        }
        let exact = |a: &Self, b: &Self| {
            let square = a.d.checked_mul(a.d)?;
            let low = u128::from(square as u64) * u128::from(b.m);
            let high = (square >> 64) * u128::from(b.m) + (low >> 64);
            Some((high, low as u64))
        };
        match (exact(self, other), exact(other, self)) {
            (Some(ours), Some(theirs)) => ours > theirs,
            // Past 33 million pixels of 16 bit.
            _ => ours > theirs,
        }
    }
}

fn otsu(histogram: &Histogram) -> u32 {
    let (mut n, mut sum) = (0_u64, 0_u64);
    for (gray, count) in histogram.occupied() {
        n += u64::from(count);
        sum += u64::from(gray) * u64::from(count);
    }
    let mut best = Split {
        d: 0,
        m: 1,
        threshold: 0,
    };
    let (mut n0, mut sum0) = (0_u64, 0_u64);
    for (gray, count) in histogram.occupied() {
        n0 += u64::from(count);
        sum0 += u64::from(gray) * u64::from(count);
        if n0 == n {
            break;
        }
        let split = Split {
            d: u128::from(n0) * u128::from(sum) - u128::from(n) * u128::from(sum0),
            m: n0 * (n - n0),
            threshold: gray + 1,
        };
        if split.exceeds(&best) {
            best = split;
        }
    }
    best.threshold
}

fn triangle(counts: &[u32], first: u32, last: u32) -> u32 {
    let mut peak = first;
    for gray in first..=last {
        if counts[gray as usize] > counts[peak as usize] {
            peak = gray;
        }
    }
    let dark_tail = peak - first > last - peak;
    let end = if dark_tail { first } else { last };
    let length = u64::from(peak.abs_diff(end));
    let height = u64::from(counts[peak as usize]);
    // The line is `height / length · x` high, x gray values from the end; times `length` to stay whole.
    let mut farthest = (0, peak.min(end));
    for x in 0..length {
        let gray = if dark_tail {
            end + x as u32
        } else {
            end - x as u32
        };
        let below = (height * x).saturating_sub(length * u64::from(counts[gray as usize]));
        if below > farthest.0 {
            farthest = (below, gray);
        }
    }
    farthest.1 + 1
}

/// The top threshold of the partition into `classes` intervals whose sum of n·(mean - middle)² is greatest.
///
/// The best last cut does not fall as more gray values are added, so each layer is found by halving:
/// O(classes · values · log values).
fn multi_otsu(histogram: &Histogram, classes: usize) -> u32 {
    let bins: Vec<(u32, u32)> = histogram.occupied().collect();
    let classes = classes.min(bins.len());
    let (n, sum) = bins.iter().fold((0, 0), |(n, sum), &(gray, count)| {
        (
            n + i64::from(count),
            sum + i64::from(gray) * i64::from(count),
        )
    });
    // Gray values from near their mean: sums stay exact and their squares small.
    let middle = sum / n;
    let mut before = vec![(0_i64, 0_i64)];
    for &(gray, count) in &bins {
        let (n, sum) = before[before.len() - 1];
        let count = i64::from(count);
        before.push((n + count, sum + (i64::from(gray) - middle) * count));
    }
    let between = |from: usize, to: usize| {
        let n = (before[to].0 - before[from].0) as f64;
        let sum = (before[to].1 - before[from].1) as f64;
        sum * sum / n
    };
    // Of the first `to` values in one class.
    let mut layer: Vec<f64> = (0..=bins.len())
        .map(|to| if to == 0 { 0.0 } else { between(0, to) })
        .collect();
    let mut top = 0;
    for class in 2..=classes {
        let mut next = vec![0.0; bins.len() + 1];
        // (values from, to; cuts from, to), all inclusive
        let mut open = vec![(class, bins.len(), class - 1, bins.len() - 1)];
        while let Some((low, high, cut_low, cut_high)) = open.pop() {
            if low > high {
                continue;
            }
            let to = usize::midpoint(low, high);
            let mut best = (f64::NEG_INFINITY, cut_low);
            let cuts = cut_low..=cut_high.min(to - 1);
            for (cut, below) in cuts.clone().zip(&layer[cuts]) {
                let value = below + between(cut, to);
                if value > best.0 {
                    best = (value, cut);
                }
            }
            next[to] = best.0;
            if to == bins.len() {
                top = best.1;
            }
            open.push((low, to - 1, cut_low, best.1));
            open.push((to + 1, high, best.1, cut_high));
        }
        layer = next;
    }
    bins[top].0
}

/// Counts gray values, and keeps the tables for the next picture.
#[derive(Debug, Clone, Default)]
pub(crate) struct Counter {
    pub(crate) histogram: Histogram,
    /// The brightest gray value of each row.
    pub(crate) row_max: Vec<u16>,
    /// How often each pair of neighbours occurs; all zero between calls.
    pairs: Vec<u32>,
}

/// Pixels above which clearing and adding up 65,536 pairs costs less than it saves.
const PAIRS_FROM: usize = 1 << 17;

impl Counter {
    /// Counts a picture.
    pub(crate) fn count<P: Gray>(
        &mut self,
        level: Level,
        view: View<'_, P>,
    ) -> Result<(), SpotError> {
        let pixels = view.width().saturating_mul(view.height());
        if u32::try_from(pixels).is_err() {
            return Err(SpotError::TooLarge {
                width: view.width(),
                height: view.height(),
                most: u32::MAX,
            });
        }
        let by_pairs = pixels >= PAIRS_FROM;
        simd::run_at(
            level,
            Count {
                view,
                counter: self,
                by_pairs,
            },
        );
        Ok(())
    }
}

struct Count<'a, P> {
    view: View<'a, P>,
    counter: &'a mut Counter,
    by_pairs: bool,
}

impl<P: Gray> Kernel for Count<'_, P> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        let Counter {
            histogram: Histogram { counts },
            row_max,
            pairs,
        } = self.counter;
        counts.clear();
        counts.resize(P::WHITE as usize + 1, 0);
        row_max.clear();
        row_max.reserve(self.view.height());
        // Neighbours are often equal: a count is read again sooner than it is written where there is one table.
        let mut tables = [[0_u32; 256]; 4];
        if self.by_pairs {
            pairs.resize(1 << 16, 0);
        }
        for row in self.view.rows() {
            let brightest = row.iter().fold(P::default(), |a, &b| a.max(b));
            row_max.push(brightest.into() as u16);
            match P::bytes(row) {
                Some(bytes) if self.by_pairs => {
                    let (words, rest) = bytes.as_chunks::<8>();
                    count_pairs(words, pairs);
                    count_singles(rest, &mut tables);
                }
                Some(bytes) => count_singles(bytes, &mut tables),
                None => {
                    for &gray in row {
                        counts[gray.into() as usize] += 1;
                    }
                }
            }
        }
        if P::WHITE == u32::from(u8::MAX) {
            for (gray, count) in counts.iter_mut().enumerate() {
                *count = tables.iter().map(|table| table[gray]).sum();
            }
            if self.by_pairs {
                fold_pairs(pairs, counts);
            }
        }
    }
}

#[inline(always)]
fn count_singles(bytes: &[u8], tables: &mut [[u32; 256]; 4]) {
    let (fours, rest) = bytes.as_chunks::<4>();
    for four in fours {
        for (table, &gray) in tables.iter_mut().zip(four) {
            table[usize::from(gray)] += 1;
        }
    }
    for &gray in rest {
        tables[0][usize::from(gray)] += 1;
    }
}

#[inline(always)]
fn count_pairs(words: &[[u8; 8]], pairs: &mut [u32]) {
    let Some(pairs) = pairs.first_chunk_mut::<{ 1 << 16 }>() else {
        return;
    };
    let (fours, rest) = words.as_chunks::<4>();
    for four in fours {
        let words = four.map(u64::from_le_bytes);
        let same = (words[0] ^ words[1]) | (words[0] ^ words[2]) | (words[0] ^ words[3]);
        if same == 0 {
            // An even background: a count need not wait for the one before it.
            count_word(words[0], 4, pairs);
        } else {
            for word in words {
                count_word(word, 1, pairs);
            }
        }
    }
    for &word in rest {
        count_word(u64::from_le_bytes(word), 1, pairs);
    }
}

#[inline(always)]
fn count_word(word: u64, times: u32, pairs: &mut [u32; 1 << 16]) {
    for k in 0..4 {
        pairs[usize::from((word >> (16 * k)) as u16)] += times;
    }
}

/// Adds pairs to the counts of either neighbour, and clears them.
#[inline(always)]
fn fold_pairs(pairs: &mut [u32], counts: &mut [u32]) {
    let (rows, _) = pairs.as_chunks_mut::<256>();
    let mut of_row = [0; 256];
    for (of_row, row) in of_row.iter_mut().zip(rows) {
        for (count, pair) in counts.iter_mut().zip(row.iter()) {
            *count += pair;
        }
        *of_row = row.iter().sum();
        *row = [0; 256];
    }
    for (count, more) in counts.iter_mut().zip(of_row) {
        *count += more;
    }
}
