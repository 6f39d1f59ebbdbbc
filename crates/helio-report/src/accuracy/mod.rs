//! The page of a tracking-accuracy campaign: verdict, shares by wind, scatter, errors over time, what departs from
//! the standard, and a place to sign.
//!
//! [`AccuracyPage`] holds what was evaluated and what is to be said of it; [`accuracy_page`] turns it into one HTML
//! file that needs nothing from outside. Its size is bounded whatever the number of frames: at most [`DRAWN`] of
//! them are drawn one by one.

mod figures;
mod page;
mod tables;

use helio_io::JudgedCampaign;
use helio_spot::accuracy::{Evaluation, Limits, Options, Setup, SpotRow};

/// How many frames are drawn one by one at most, evenly chosen.
pub const DRAWN: usize = 6000;

/// A campaign and its evaluation.
#[derive(Debug, Clone)]
pub struct AccuracyPage<'a> {
    /// Heading.
    pub title: String,
    /// What made it, such as "helio-rs 0.4.0".
    pub version: String,
    /// When the page was made, as text; this crate has no clock.
    pub generated_utc: String,
    /// What the reader should know of the campaign, each with its name: laboratory, place, files.
    pub facts: Vec<(String, String)>,
    /// What was found.
    pub evaluation: &'a Evaluation,
    /// The spots it was found from.
    pub spots: &'a [SpotRow],
    /// Where the heliostat aims and from where.
    pub setup: &'a Setup,
    /// The limits it is judged by.
    pub limits: &'a Limits,
    /// How it was counted.
    pub options: &'a Options,
    /// Instruments: role, name, maker, serial number, calibration.
    pub instruments: Vec<[String; 5]>,
    /// The raw data: name of the file and its SHA-256.
    pub files: Vec<(String, String)>,
    /// What else is to be known.
    pub notes: Vec<String>,
}

impl<'a> AccuracyPage<'a> {
    /// The page of a campaign that was judged, by a program of some version at some time; this crate has no clock.
    #[must_use]
    pub fn of_campaign(judged: &'a JudgedCampaign, version: &str, generated_utc: String) -> Self {
        AccuracyPage {
            title: judged.title(),
            version: format!("helio-rs {version}"),
            generated_utc,
            facts: judged.facts(),
            evaluation: &judged.evaluation,
            spots: &judged.spots,
            setup: &judged.setup,
            limits: &judged.limits,
            options: &judged.options,
            instruments: judged.instruments(),
            files: judged.files.clone(),
            notes: judged.campaign.notes.clone(),
        }
    }
}

/// The page as a complete HTML file.
#[must_use]
pub fn accuracy_page(page: &AccuracyPage<'_>) -> String {
    page::html(page)
}
