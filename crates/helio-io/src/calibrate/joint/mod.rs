//! A field as one: fitted together ([`JointRun::fit`]), or followed from a state ([`Following`]).

mod batch;
mod known;
mod planned;
mod tables;
mod update;
mod words;

use std::path::Path;
use std::sync::OnceLock;

use helio_calib::joint::{
    CommonCause, DAY_NS, FieldState, Foretold, JointFit, Spell, StepKind, Worth, ZeroPoint,
    too_late,
};
use helio_calib::{Campaign, Mount, Observation};
use helio_core::TargetPlane;

pub use self::known::{Day, Seen};
pub use self::tables::cause_target;
pub use self::update::Following;
pub use self::words::{STOPPED, alarm_words, days_of, for_people, jump_words};
use super::RunError;
use crate::error::IoError;
use crate::field::LoadedField;
use crate::hash::Sha256;
use crate::observations::Observations;
use crate::state::{KeptMount, StateFile};
use crate::times::format_time;
use crate::words::Grouped;

/// Jumps whose size is looked for: those that people are told of.
pub const JUMPS_SIZED: usize = 40;

/// Options of a fit heliostat by heliostat that the field as one has no use for, each with the reason.
pub const NOT_AS_ONE: [(&str, &str); 8] = [
    (
        "solver",
        "the field as one is filtered record by record, and there is one way to do that",
    ),
    (
        "residual",
        "the field as one makes the miss across the beam small, by the scatter that it finds",
    ),
    (
        "robust",
        "the field as one decides of each record whether it is believed, by those after it",
    ),
    (
        "sets",
        "in the field as one what changes over the day are causes in common, and what changes over days the zero points",
    ),
    (
        "fit_mirror_offset",
        "the field as one takes the mirror offset from the layout",
    ),
    (
        "hold",
        "in the field as one all six angles are found, few records leaning on those of all others",
    ),
    (
        "prior",
        "the field as one learns from all heliostats what is to be expected of one",
    ),
    (
        "resume",
        "the field as one is fitted in one piece, and nothing of it is finished before the end",
    ),
];

/// Options that a state was begun with, and that an update has no say in, each with the reason.
pub const NOT_ANEW: [(&str, &str); 2] = [
    (
        "keep_all",
        "a state goes on as the --joint that began it was told to",
    ),
    (
        "no_jumps",
        "a state goes on as the --joint that began it was told to",
    ),
];

/// What is asked of the field as one.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct JointAsked {
    /// Whether every record that is a number is believed; of a fit.
    pub keep_all: bool,
    /// Whether no zero point is taken to jump; of a fit.
    pub no_jumps: bool,
    /// Days after the last record of the field that the rows are for.
    pub ahead_days: f64,
    /// Greatest uncertainty of the pointing over the year that a row may have \[mrad\]; none for any.
    pub max_year_pointing_mrad: Option<f64>,
}

impl Default for JointAsked {
    fn default() -> Self {
        Self {
            keep_all: false,
            no_jumps: false,
            ahead_days: 1.0,
            max_year_pointing_mrad: None,
        }
    }
}

impl JointAsked {
    /// SHA-256 of what changes a fit and its rows, for [`Provenance::options_hash`](crate::Provenance::options_hash).
    #[must_use]
    pub fn hash(&self) -> String {
        let mut hash = Sha256::default();
        let text = format!("{:?} {} {}", self.ahead_days, self.keep_all, self.no_jumps);
        hash.update(text.as_bytes());
        hash.finish()
    }
}

/// Something worth saying while a run goes on, which it does not stop.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Remark {
    /// Something may be wrong.
    Warning(String),
    /// Something to know.
    Note(String),
}

/// Hears remarks as they come.
pub type Say<'a> = &'a (dyn Fn(Remark) + Sync);

/// Told how much more is done and how much there is in all; false asks to stop.
pub type Watch<'a> = &'a (dyn Fn(u64, u64) -> bool + Sync);

/// A field, its observations in order and what is asked of them.
#[derive(Clone, Copy)]
pub struct JointRun<'a> {
    /// The field, which has a site.
    pub loaded: &'a LoadedField,
    /// Its observations.
    pub observations: &'a Observations,
    /// How.
    pub asked: &'a JointAsked,
    /// Who hears what is worth saying.
    pub say: Say<'a>,
    /// Who is told how far it is.
    pub watch: Watch<'a>,
}

impl std::fmt::Debug for JointRun<'_> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("JointRun")
            .field("asked", self.asked)
            .finish_non_exhaustive()
    }
}

/// A record that was held against what was known before it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Judged {
    /// Which of the heliostats with observations.
    pub index: usize,
    /// Which observation of that.
    pub observation: usize,
    /// How it was foretold.
    pub foretold: Foretold,
    /// What became of it.
    pub kind: StepKind,
    /// Zero points after it less those at rest (of the heliostat as it was before the run, where it is followed)
    /// \[rad\].
    pub zero_rad: [f64; 2],
    /// One standard deviation of them \[rad\].
    pub zero_sigma_rad: [f64; 2],
    /// Whether the zero point of either axis is taken to have jumped before it.
    pub jumped: [bool; 2],
    /// Whether other accounts of it are not yet given up.
    pub in_doubt: bool,
    /// Whether it raised an alarm, and whether as the third in a row that is not believed; only of records that were
    /// followed.
    pub alarm: Option<[bool; 2]>,
}

/// A jump of a zero point, for people.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct JumpFound {
    /// Which of the heliostats with observations.
    pub index: usize,
    /// Time of the first record after it \[ns of Unix time\].
    pub unix_ns: Option<i64>,
    /// Of the first (0) or second (1) axis.
    pub axis: usize,
    /// What is known of the zero point after it (in a followed field after all records of the run) less that before
    /// \[rad\].
    pub size_rad: Option<f64>,
    /// How far the beam of the first record after it was off \[mrad\].
    pub missed_mrad: Option<f64>,
    /// False while another account of the same records is not yet given up.
    pub certain: bool,
}

/// What a run found.
#[derive(Debug)]
pub struct JointFound<'a> {
    /// What is known of the field.
    pub state: FieldState,
    /// Rows of the state's heliostats in the field.
    pub rows: Vec<Option<usize>>,
    /// What the records of this run say of each.
    pub seen: Vec<Seen>,
    /// The causes in common.
    pub causes: Vec<CommonCause>,
    /// What each is worth; of a fit.
    pub worth: Option<Vec<Worth>>,
    /// Every record that was looked at.
    pub judged: Vec<Judged>,
    /// Jumps of zero points.
    pub jumps: Vec<JumpFound>,
    /// When the field as a whole was off.
    pub spells: Vec<Spell>,
    /// Whether it is off so that what was found rests on it.
    pub off: bool,
    /// The targets that causes count.
    pub targets: Vec<(String, TargetPlane)>,
    /// The fit, and the campaigns that it was given; none where the field was followed.
    pub fit: Option<(JointFit, Vec<Campaign<'a>>)>,
    site_longitude_rad: f64,
    mounts: Vec<KeptMount>,
    file: OnceLock<StateFile>,
}

impl JointFound<'_> {
    /// Whether the search of the fit ended where no step promised more.
    #[must_use]
    pub fn converged(&self) -> bool {
        self.fit.as_ref().is_none_or(|(fit, _)| fit.converged)
    }

    /// What a state file holds of it.
    pub fn state_file(&self) -> &StateFile {
        self.file.get_or_init(|| StateFile {
            parts: self.state.parts(),
            targets: self.targets.clone(),
            site_longitude_rad: self.site_longitude_rad,
            mounts: self.mounts.clone(),
            version: env!("CARGO_PKG_VERSION").to_owned(),
        })
    }

    /// Zero points of one of the heliostats with observations as all its records tell them; none where the field was
    /// followed, or it has too many records.
    ///
    /// # Errors
    /// [`RunError`] if there is no such heliostat.
    pub fn zero_points(&self, index: usize) -> Result<Option<Vec<ZeroPoint>>, RunError> {
        match &self.fit {
            Some((fit, campaigns)) => Ok(fit.zero_points(index, &campaigns[index])?),
            None => Ok(None),
        }
    }

    /// Rows of the field with the places of their heliostats in the state, in the order of the field.
    fn places(&self) -> Vec<(usize, usize)> {
        let each = self.rows.iter().enumerate();
        let mut places: Vec<(usize, usize)> = each
            .filter_map(|(place, row)| Some(((*row)?, place)))
            .collect();
        places.sort_unstable();
        places
    }
}

/// Refuses a field of which nothing can be known as one.
///
/// # Errors
/// [`RunError::Refused`] without a site.
pub fn needs_site(loaded: &LoadedField) -> Result<(), RunError> {
    if loaded.site.is_some() {
        return Ok(());
    }
    let path = loaded.files.first();
    Err(RunError::refused(format!(
        "{}: --joint and --update need the latitude from [site]: the sun's path over the sky",
        path.map_or(Path::new("field.toml"), |path| path).display()
    )))
}

impl JointRun<'_> {
    fn mount(&self, row: usize) -> Mount {
        mount(self.loaded, row)
    }

    fn latitude_rad(&self) -> f64 {
        self.loaded.site.as_ref().map_or(0.0, |s| s.latitude_rad)
    }

    fn warn(&self, words: String) {
        (self.say)(Remark::Warning(words));
    }

    fn note(&self, words: String) {
        (self.say)(Remark::Note(words));
    }

    /// Asks whether to go on, which callers do between the tables that they write.
    ///
    /// # Errors
    /// [`RunError::Calibration`] where whoever watches asked to stop.
    pub fn go_on(&self) -> Result<(), RunError> {
        if (self.watch)(0, 0) {
            Ok(())
        } else {
            Err(helio_calib::CalibrationError::Stopped.into())
        }
    }

    /// Looks whether the observations can be put in order, and says what of them cannot; `updated` where they are to go
    /// into a state.
    ///
    /// # Errors
    /// [`RunError::Refused`] for records without a time where all need one, or none has.
    pub fn check_times(&self, updated: bool) -> Result<(), RunError> {
        let observations = self.observations;
        let mut timeless = 0;
        let mut first = None;
        for of in &observations.heliostats {
            for (observation, &record) in of.observations.iter().zip(&of.records) {
                if observation.unix_ns.is_none() {
                    timeless += 1;
                    first.get_or_insert((record, of.row));
                }
            }
        }
        let Some((record, row)) = first else {
            return Ok(());
        };
        let words = format!(
            "{}: {} no time (first {}, heliostat `{}`)",
            observations.path.display(),
            match timeless {
                1 => "1 record has".to_owned(),
                count => format!("{} records have", Grouped(count)),
            },
            observations.position(record)?,
            self.loaded.field.ids()[row]
        );
        if updated {
            return Err(RunError::refused(format!(
                "{words}, without which --update cannot tell new records from old ones"
            )));
        }
        if timeless == observations.len() as u64 {
            return Err(RunError::refused(format!(
                "{words}, and --joint needs times: zero points wander"
            )));
        }
        self.warn(format!(
            "{words}: each counts as made together with the one before it"
        ));
        Ok(())
    }

    /// The day after which a record's time is hardly its own: more than a month after those of almost all heliostats of
    /// the table \[days since 1970\]; such records are said.
    fn too_late(&self, so: &str) -> Result<f64, IoError> {
        let observations = self.observations;
        let day = |o: &Observation| o.unix_ns.map(|ns| ns as f64 / DAY_NS);
        let last_days: Vec<f64> = observations
            .heliostats
            .iter()
            .filter_map(|of| of.observations.iter().filter_map(day).reduce(f64::max))
            .collect();
        let limit = too_late(&last_days);
        let mut late = 0;
        let mut first = None;
        for of in &observations.heliostats {
            for (observation, &record) in of.observations.iter().zip(&of.records) {
                if day(observation).is_some_and(|day| day > limit) {
                    late += 1;
                    first.get_or_insert((record, of.row, observation.unix_ns));
                }
            }
        }
        if let Some((record, row, ns)) = first {
            self.warn(format!(
                "{}: {} more than 30 days after those of the other heliostats (first {}, heliostat `{}`, {}): {so}",
                observations.path.display(),
                match late {
                    1 => "1 record is dated".to_owned(),
                    late => format!("{} records are dated", Grouped(late)),
                },
                observations.position(record)?,
                self.loaded.field.ids()[row],
                ns.map_or(String::new(), format_time)
            ));
        }
        Ok(limit)
    }
}

fn mount(loaded: &LoadedField, row: usize) -> Mount {
    let field = &loaded.field;
    Mount::of(field.mode(), &field.heliostats()[row])
}

/// What of a row's mount and drives must not change while it is followed.
fn kept_mount(loaded: &LoadedField, row: usize) -> KeptMount {
    KeptMount::of(&mount(loaded, row), &loaded.drives[row])
}
