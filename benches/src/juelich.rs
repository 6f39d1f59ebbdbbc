//! The protocols by which calibrations are held against later days of real records.

use std::path::Path;

use helio_calib::joint::{Foretold, JointFit, JointOptions, fit_joint};
use helio_calib::{Campaign, Observation};
use helio_tests::juelich::{LATITUDE_RAD, NAMES, Records, Spots, records_with};
use rayon::prelude::*;

/// Which of a heliostat's own records are used, and when.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Protocol {
    /// The first twelve.
    First12,
    /// Twelve spread over the earlier half.
    Spread12,
    /// The earlier half.
    Half,
    /// All before the day that is foretold.
    DayAhead,
}

/// All of them.
pub const PROTOCOLS: &[Protocol] = &[
    Protocol::First12,
    Protocol::Spread12,
    Protocol::Half,
    Protocol::DayAhead,
];

impl Protocol {
    /// The words of the table.
    #[must_use]
    pub const fn in_words(self) -> &'static str {
        match self {
            Self::First12 => "first 12, frozen",
            Self::Spread12 => "12 spread over the earlier half, frozen",
            Self::Half => "earlier half, frozen",
            Self::DayAhead => "one day ahead",
        }
    }
}

/// How a heliostat did.
#[derive(Debug, Clone)]
pub struct Done {
    /// Of the later half of its records.
    pub rms_mrad: f64,
    /// Share of them within the stated 95 % ellipse.
    pub inside95: f64,
    /// Each of them.
    pub beam_mrad: Vec<f64>,
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
const INSIDE95: f64 = 5.991_464_547_107_98;

fn day(observation: &Observation) -> i64 {
    observation.unix_ns.unwrap_or_default().div_euclid(DAY_NS)
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

    /// Foretells the later half of a heliostat's records.
    ///
    /// # Panics
    /// If there is no such heliostat, or a fit is refused.
    #[must_use]
    pub fn run(&self, name: &str, protocol: Protocol) -> Done {
        let own = self
            .all
            .iter()
            .find(|r| r.name == name)
            .expect("a heliostat");
        let count = own.observations.len();
        let half = count / 2;
        let (_, later) = own.observations.split_at(half);
        let mut days: Vec<i64> = later.iter().map(day).collect();
        days.dedup();
        let frozen: Vec<Observation> = match protocol {
            Protocol::First12 => own.observations[..12.min(half)].to_vec(),
            Protocol::Spread12 => {
                let mut picked: Vec<usize> = (0..12)
                    .map(|k| ((k * (half - 1)) as f64 / 11.0).round_ties_even() as usize)
                    .collect();
                picked.dedup();
                picked.into_iter().map(|k| own.observations[k]).collect()
            }
            Protocol::Half => own.observations[..half].to_vec(),
            Protocol::DayAhead => Vec::new(),
        };
        let by_day: Vec<(Vec<Foretold>, JointFit)> = days
            .par_iter()
            .map(|&today| {
                let before = |o: &&Observation| day(o) < today;
                let mut known: Vec<(&Records, Vec<Observation>)> = Vec::new();
                for records in self.all.iter().filter(|r| r.name != name) {
                    let earlier: Vec<Observation> = records
                        .observations
                        .iter()
                        .filter(before)
                        .copied()
                        .collect();
                    if !earlier.is_empty() {
                        known.push((records, earlier));
                    }
                }
                let mine = match protocol {
                    Protocol::DayAhead => own.observations.iter().filter(before).copied().collect(),
                    _ => frozen.clone(),
                };
                known.push((own, mine));
                let campaigns: Vec<Campaign<'_>> = known
                    .iter()
                    .map(|(records, observations)| Campaign {
                        mount: records.mount,
                        observations,
                    })
                    .collect();
                let fit = fit_joint(&campaigns, &JointOptions::new(LATITUDE_RAD)).expect("a fit");
                let seen: Vec<Observation> =
                    later.iter().filter(|o| day(o) == today).copied().collect();
                let asked = Campaign {
                    mount: own.mount,
                    observations: &seen,
                };
                (fit.foretell(campaigns.len() - 1, &asked), fit)
            })
            .collect();
        let foretold: Vec<&Foretold> = by_day.iter().flat_map(|(f, _)| f).collect();
        let n = foretold.len() as f64;
        let square: f64 = foretold.iter().map(|f| f.beam_mrad().powi(2)).sum();
        let inside = foretold.iter().filter(|f| f.square() < INSIDE95).count();
        let beam_mrad = foretold.iter().map(|f| f.beam_mrad()).collect();
        let last = by_day.into_iter().next_back().expect("a day").1;
        Done {
            rms_mrad: (square / n).sqrt(),
            inside95: inside as f64 / n,
            beam_mrad,
            last,
        }
    }
}
