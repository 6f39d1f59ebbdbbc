//! Whether records fit: those of one heliostat lately, and those of the whole field at a time.

use std::collections::BTreeMap;

/// What a record counts less with each one after it: a memory of sixteen.
const KEPT: f64 = 15.0 / 16.0;
/// A heliostat with more than one odd record in so many is not understood, and not learnt from.
const UNFIT: u64 = 4;
/// Nor is one with so many of the last records odd, each by what it counts: two and a half of the first eight.
const FEWEST_ODD: f64 = 2.5;
/// What eight records count together, to rounding: fewer say nothing of how many are odd.
const FEWEST_RECORDS: f64 = 6.4;
/// Records in a row that are not believed which are an alarm: eight times in a million by accident.
pub(super) const ALARMING: usize = 3;

/// How many of a heliostat's last records do not fit the others, each counting by 15/16 less than the one after it.
///
/// A record that is not believed, or whose beam should not meet its target, is odd; one before which a zero point is
/// taken to have jumped is so for each axis.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Lately {
    /// What the odd ones count together.
    pub odd: f64,
    /// What all count together: at most 16.
    pub records: f64,
}

impl Lately {
    /// Counts the next record, with how often it is odd.
    pub(super) fn count(&mut self, odd: usize) {
        self.odd = KEPT * self.odd + odd as f64;
        self.records = KEPT * self.records + 1.0;
    }

    /// Of records in time, by how often each is odd.
    pub(super) fn of(odd: &[usize]) -> Self {
        let mut lately = Self::default();
        for &odd in odd {
            lately.count(odd);
        }
        lately
    }

    /// Share of odd ones; zero without records.
    #[must_use]
    pub fn share(&self) -> f64 {
        if self.records > 0.0 {
            self.odd / self.records
        } else {
            0.0
        }
    }

    /// Whether the heliostat is not understood by them: more than a quarter of eight or more, counted together more
    /// than two and a half.
    #[must_use]
    pub fn much(&self) -> bool {
        let limit = FEWEST_ODD.max(self.records / UNFIT as f64);
        self.records > FEWEST_RECORDS && self.odd > limit
    }

    /// Whether so few are odd that what came long before them is forgotten: less than an eighth.
    fn little(&self) -> bool {
        2.0 * UNFIT as f64 * self.odd < self.records
    }

    /// Whether a heliostat is not to be believed now: the last records are too odd, or all of them together and
    /// the last not yet few enough, or the last ones in a row.
    pub(super) fn unexplained(&self, records: u64, odd: u64, in_a_row: usize) -> bool {
        let of_all = self.records > FEWEST_RECORDS && odd * UNFIT > records && !self.little();
        in_a_row >= ALARMING || self.much() || of_all
    }
}

/// Whether so many records of a heliostat do not fit the others, of all or lately, that it says nothing of what is common,
/// nor of how records scatter.
pub(super) fn unfit(records: u64, odd: u64, lately: &Lately) -> bool {
    odd * UNFIT > records || lately.much()
}

/// A record that is not believed is not the last one of a heliostat where it is so much later than those before it, nor
/// is what few heliostats have the last day of a field \[days\]: its time may be wrong.
const LATER_DAYS: f64 = 30.0;

/// The last day once a record of another is taken in.
pub(super) fn moves_on(last: Option<f64>, day: f64, believed: bool) -> Option<f64> {
    match last {
        Some(last) if !believed && day > last + LATER_DAYS => Some(last),
        Some(last) => Some(last.max(day)),
        None => Some(day),
    }
}

/// Heliostats that a judgement of the field needs.
const FEWEST: usize = 8;
/// Records farther apart do not count as of one time \[days\].
const SPAN_DAYS: f64 = 30.0;
/// Spells that are remembered.
const SPELLS_KEPT: usize = 64;
/// Median of chi-squared with two degrees of freedom.
const MEDIAN: f64 = 1.386_294_361_119_890_6;

/// A time during which the field as a whole did not do what was foretold of it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Spell {
    /// Its first and its last UTC day \[days since 1970\].
    pub days: [f64; 2],
    /// Heliostats of the judgement that was worst.
    pub heliostats: usize,
    /// Their middle chi-squared there, of two degrees of freedom (1.39 is expected); at most 10⁹, as which records
    /// that are not believed count.
    pub middle: f64,
    /// Whether no three judgements in a row since have found the field in order.
    pub lasts: bool,
}

/// What a record counts that is not believed, comes after a jump or should not meet its target.
const ODD: f64 = 1e9;

/// Holds the field as a whole against what was foretold: bounded, whatever the number of records.
///
/// Records are taken in time. The first of each heliostat count together until a day begins of which eight or more
/// heliostats were seen since the last judgement: then their middle chi-squared is judged.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Watch {
    /// First and last UTC day of the records that wait for a judgement.
    pub days: [f64; 2],
    /// Chi-squared of the first of them of each heliostat, by its place.
    pub waiting: BTreeMap<usize, f64>,
    /// Judgements in a row that found the field in order, in a spell that lasts.
    pub calm: usize,
    /// When the field was not in order, in time.
    pub spells: Vec<Spell>,
}

/// A record as the field is judged by it.
#[derive(Debug, Clone, Copy)]
pub(super) struct Witness {
    pub day: f64,
    pub place: usize,
    /// Nothing where it is odd.
    pub square: Option<f64>,
}

impl Watch {
    /// Takes in records of some heliostats.
    pub(super) fn take(&mut self, mut records: Vec<Witness>) {
        records.sort_by(|a, b| a.day.total_cmp(&b.day).then(a.place.cmp(&b.place)));
        for Witness { day, place, square } in records {
            let day = day.floor();
            let [first, last] = self.days;
            let apart = (day - first).abs() > SPAN_DAYS;
            if self.waiting.is_empty() || apart || (day > last && self.waiting.len() >= FEWEST) {
                self.judge();
                self.waiting.clear();
                self.days = [day, day];
            }
            self.days = [self.days[0].min(day), self.days[1].max(day)];
            self.waiting
                .entry(place)
                .or_insert(square.unwrap_or(ODD).min(ODD));
        }
    }

    /// Judges what waits, if it is enough.
    fn judge(&mut self) {
        let count = self.waiting.len();
        if count < FEWEST {
            return;
        }
        let mut squares: Vec<f64> = self.waiting.values().copied().collect();
        squares.sort_by(f64::total_cmp);
        let middle = squares[(count - 1) / 2];
        let root = libm::sqrt(count as f64);
        let last = self.spells.last_mut().filter(|spell| spell.lasts);
        match last {
            // it began by a wide margin, and ends where nothing is left of it
            Some(spell) if middle > MEDIAN + LEFT / root => {
                self.calm = 0;
                spell.days[1] = self.days[1];
                if middle > spell.middle {
                    (spell.heliostats, spell.middle) = (count, middle);
                }
            }
            Some(spell) => {
                self.calm += 1;
                spell.lasts = self.calm < CALM;
            }
            None if middle > CLEARLY.max(MEDIAN + BEGINS / root) => {
                if self.spells.len() == SPELLS_KEPT {
                    self.spells.remove(0);
                }
                self.calm = 0;
                self.spells.push(Spell {
                    days: self.days,
                    heliostats: count,
                    middle,
                    lasts: true,
                });
            }
            None => {}
        }
    }

    /// When the field was not in order, in time; what waits is judged with the rest if it is enough.
    #[must_use]
    pub fn spells(&self) -> Vec<Spell> {
        let mut now = self.clone();
        now.judge();
        now.spells
    }
}

impl Spell {
    /// Whether a time \[days since 1970\] lies within it.
    #[must_use]
    pub fn holds(&self, day: f64) -> bool {
        let day = day.floor();
        day >= self.days[0] && (self.lasts || day <= self.days[1])
    }
}

/// The field is off where the middle of chi-squared is above this,
const CLEARLY: f64 = 4.0;
/// and above its expectation by so many times 1/√N, seven times what it scatters by;
const BEGINS: f64 = 14.0;
/// it is in order again once it is above it by less than so many
const LEFT: f64 = 2.0;
/// in so many judgements in a row.
const CALM: usize = 3;

/// Days after which a time is not believed to be one of a field \[days since 1970\]: a month after the last day of its
/// heliostats, from which a tenth of them (one at least) are left out. None of fewer than three is.
#[must_use]
pub fn too_late(last_days: &[f64]) -> f64 {
    let mut days = last_days.to_vec();
    days.sort_by(|a, b| b.total_cmp(a));
    match days.len() {
        0..3 => f64::INFINITY,
        count => days[(count / 10).max(1)] + LATER_DAYS,
    }
}
