//! The protocols by which calibrations are held against later days of real records.

use std::path::Path;

use helio_calib::joint::{Foretold, JointFit, JointOptions, fit_joint};
use helio_calib::{Campaign, Observation};
use helio_tests::juelich::{NAMES, Records, Spots, records_with};
use rayon::prelude::*;

/// Which of a heliostat's own records are used, and when.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Protocol {
    /// The first so many.
    First(usize),
    /// Twelve spread over the earlier half.
    Spread12,
    /// The earlier half.
    Half,
    /// All before the day that is foretold.
    DayAhead,
    /// The earlier half fitted; then followed record by record without fitting anew, each foretold from all
    /// before its day.
    FollowedByDay,
    /// The same, each record foretold from all before it.
    FollowedByRecord,
}

/// Which records of other heliostats are known.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Others {
    /// All before the day that is foretold.
    BeforeThatDay,
    /// All up to the last own record that is used.
    BeforeOwnLast,
}

/// After how many records of its own a new heliostat is looked at.
pub const FEW: &[Protocol] = &[
    Protocol::First(0),
    Protocol::First(1),
    Protocol::First(2),
    Protocol::First(3),
    Protocol::First(6),
    Protocol::First(12),
];

/// Those of the table.
pub const PROTOCOLS: &[Protocol] = &[
    Protocol::First(12),
    Protocol::Spread12,
    Protocol::Half,
    Protocol::DayAhead,
    Protocol::FollowedByDay,
    Protocol::FollowedByRecord,
];

/// Those in which parts of the model are left out.
pub const PARTS: &[Protocol] = &[
    Protocol::First(12),
    Protocol::Spread12,
    Protocol::Half,
    Protocol::DayAhead,
];

impl Protocol {
    /// The words of the table.
    #[must_use]
    pub fn in_words(self) -> String {
        match self {
            Self::First(count) => return format!("first {count}, frozen"),
            Self::Spread12 => "12 spread over the earlier half, frozen",
            Self::Half => "earlier half, frozen",
            Self::DayAhead => "one day ahead, fitted anew each day",
            Self::FollowedByDay => "one day ahead, followed",
            Self::FollowedByRecord => "one record ahead, followed",
        }
        .to_owned()
    }
}

/// How a heliostat did.
#[derive(Debug, Clone)]
pub struct Done {
    /// Of the later half of its records.
    pub rms_mrad: f64,
    /// What had been expected of them.
    pub expected_mrad: f64,
    /// Share of them within the stated 95 % ellipse.
    pub inside95: f64,
    /// Each of them.
    pub beam_mrad: Vec<f64>,
    /// Of each, chi-squared with two degrees of freedom.
    pub square: Vec<f64>,
    /// The last fit.
    pub last: JointFit,
}

/// All heliostats of Jülich.
#[derive(Debug)]
pub struct Campaigns {
    all: Vec<Records>,
}

const DAY_NS: i64 = 86_400_000_000_000;
/// What 95 % of chi-squared with two degrees of freedom lie below.
pub const INSIDE95: f64 = 5.991_464_547_107_98;

/// The day of a record, since 1970.
#[must_use]
pub fn day(observation: &Observation) -> i64 {
    observation.unix_ns.unwrap_or_default().div_euclid(DAY_NS)
}

/// Records of some heliostats that are known at some time.
pub type Known<'a> = Vec<(&'a Records, Vec<Observation>)>;

/// As the library takes them.
#[must_use]
pub fn campaigns<'a>(known: &'a Known<'_>) -> Vec<Campaign<'a>> {
    known
        .iter()
        .map(|(records, observations)| Campaign {
            mount: records.mount,
            observations,
        })
        .collect()
}

impl Campaigns {
    /// Reads them; those without times are left out.
    ///
    /// # Panics
    /// If files are missing.
    #[must_use]
    pub fn read(data: &Path, spots: Spots) -> Self {
        let mut all: Vec<Records> = NAMES
            .iter()
            .map(|name| records_with(data, name, spots))
            .collect();
        all.retain(|r| r.observations.iter().any(|o| o.unix_ns.is_some()));
        for records in &mut all {
            // Records stand in time: one without a time was taken about when the one before it was.
            let mut last = records.observations.iter().find_map(|o| o.unix_ns);
            for o in &mut records.observations {
                last = o.unix_ns.or(last);
                o.unix_ns = last;
            }
            for o in &mut records.observations {
                o.sigma_m = None;
            }
            records.observations.sort_by_key(|o| o.unix_ns);
        }
        Self { all }
    }

    /// Names of those there are.
    pub fn names(&self) -> impl Iterator<Item = &str> {
        self.all.iter().map(|r| r.name.as_str())
    }

    /// The records, each heliostat's in time.
    #[must_use]
    pub fn records(&self) -> &[Records] {
        &self.all
    }

    /// Of all others the records before a day, then of a heliostat those that are given.
    #[must_use]
    pub fn known_before<'a>(
        &'a self,
        end: i64,
        own: &'a Records,
        mine: Vec<Observation>,
    ) -> Known<'a> {
        let mut known = Known::new();
        for records in self.all.iter().filter(|r| r.name != own.name) {
            let before = records.observations.iter().filter(|o| day(o) < end);
            let before: Vec<Observation> = before.copied().collect();
            if !before.is_empty() {
                known.push((records, before));
            }
        }
        known.push((own, mine));
        known
    }

    /// Foretells the later half of a heliostat's records.
    ///
    /// # Panics
    /// If there is no such heliostat, or a fit is refused.
    #[must_use]
    pub fn run(
        &self,
        name: &str,
        protocol: Protocol,
        others: Others,
        options: &JointOptions,
    ) -> Done {
        let own = self
            .all
            .iter()
            .find(|r| r.name == name)
            .expect("a heliostat");
        let half = own.observations.len() / 2;
        let (earlier, later) = own.observations.split_at(half);
        let mut days: Vec<i64> = later.iter().map(day).collect();
        days.dedup();
        let frozen: Vec<Observation> = match protocol {
            Protocol::First(count) => earlier[..count.min(half)].to_vec(),
            Protocol::Spread12 => {
                let mut picked: Vec<usize> = (0..12)
                    .map(|k| ((k * (half - 1)) as f64 / 11.0).round_ties_even() as usize)
                    .collect();
                picked.dedup();
                picked.into_iter().map(|k| earlier[k]).collect()
            }
            _ => earlier.to_vec(),
        };
        let last_own = frozen.last().map_or(i64::MIN, day);
        let known_before = |today: i64, mine: Vec<Observation>| {
            let end = match others {
                Others::BeforeThatDay => today,
                Others::BeforeOwnLast => today.min(last_own + 1),
            };
            self.known_before(end, own, mine)
        };
        let fit_of = |known: &Known<'_>| fit_joint(&campaigns(known), options).expect("a fit");
        let on = |today: i64| -> Vec<Observation> {
            later.iter().filter(|o| day(o) == today).copied().collect()
        };
        let (foretold, last) = match protocol {
            Protocol::FollowedByDay | Protocol::FollowedByRecord => {
                let known = known_before(days[0], frozen);
                let fit = fit_of(&known);
                (self.followed(own, &known, &fit, days[0], protocol), fit)
            }
            _ => {
                let mut by_day: Vec<(Vec<Foretold>, JointFit)> = days
                    .par_iter()
                    .map(|&today| {
                        let mine = match protocol {
                            Protocol::DayAhead => {
                                let before = own.observations.iter().filter(|o| day(o) < today);
                                before.copied().collect()
                            }
                            _ => frozen.clone(),
                        };
                        let known = known_before(today, mine);
                        let fit = fit_of(&known);
                        let seen = Campaign {
                            mount: own.mount,
                            observations: &on(today),
                        };
                        (fit.foretell(known.len() - 1, &seen).expect("foretold"), fit)
                    })
                    .collect();
                let foretold = by_day.iter_mut().flat_map(|(f, _)| core::mem::take(f));
                (foretold.collect(), by_day.pop().expect("a day").1)
            }
        };
        let n = foretold.len() as f64;
        let beam_mrad: Vec<f64> = foretold.iter().map(Foretold::beam_mrad).collect();
        let square: Vec<f64> = foretold.iter().map(Foretold::square).collect();
        let expected = foretold.iter().map(|f| f.expected_mrad().powi(2));
        let expected_mrad = (expected.sum::<f64>() / n).sqrt();
        Done {
            rms_mrad: (beam_mrad.iter().map(|x| x * x).sum::<f64>() / n).sqrt(),
            expected_mrad,
            inside95: square.iter().filter(|x| **x < INSIDE95).count() as f64 / n,
            beam_mrad,
            square,
            last,
        }
    }

    /// All heliostats followed from `start` on; what was foretold of the records of `own`.
    fn followed(
        &self,
        own: &Records,
        known: &Known<'_>,
        fit: &JointFit,
        start: i64,
        protocol: Protocol,
    ) -> Vec<Foretold> {
        let ids: Vec<String> = known.iter().map(|(r, _)| r.name.clone()).collect();
        let mut state = fit.follow(&ids).expect("a state");
        let later = own.observations.iter().skip(own.observations.len() / 2);
        let later: Vec<Observation> = later.copied().collect();
        let mut days: Vec<i64> = self
            .all
            .iter()
            .flat_map(|r| &r.observations)
            .map(day)
            .filter(|d| *d >= start)
            .collect();
        days.sort_unstable();
        days.dedup();
        let mut foretold = Vec::new();
        for today in days {
            let mut new: Vec<(usize, &Records, Vec<Observation>)> = Vec::new();
            for records in &self.all {
                let from = if records.name == own.name {
                    &later
                } else {
                    &records.observations
                };
                let seen: Vec<Observation> =
                    from.iter().filter(|o| day(o) == today).copied().collect();
                if !seen.is_empty() {
                    let place = state.position(&records.name);
                    let place = place.unwrap_or_else(|| state.add(&records.name));
                    new.push((place, records, seen));
                }
            }
            let campaigns: Vec<(usize, Campaign<'_>)> = new
                .iter()
                .map(|(place, records, seen)| {
                    let campaign = Campaign {
                        mount: records.mount,
                        observations: seen,
                    };
                    (*place, campaign)
                })
                .collect();
            let mine = new.iter().position(|(_, r, _)| r.name == own.name);
            if let (Some(mine), Protocol::FollowedByDay) = (mine, protocol) {
                let told = state.foretell(campaigns[mine].0, &campaigns[mine].1);
                foretold.extend(told.expect("foretold"));
            }
            let steps = state.update(&campaigns).expect("an update");
            if let (Some(mine), Protocol::FollowedByRecord) = (mine, protocol) {
                foretold.extend(steps[mine].iter().map(|s| s.foretold));
            }
        }
        foretold
    }
}
