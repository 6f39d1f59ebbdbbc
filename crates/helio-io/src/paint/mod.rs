//! PAINT records into a field and its observations.
//!
//! PAINT (Phipps et al., Nature Energy 2026, doi 10.1038/s41560-026-02070-1) publishes the heliostats of the solar tower in
//! Jülich: geodetic places, kinematics with linear actuators, and for each calibration picture motor steps, the sun and
//! the spot's centre as a geodetic point. Points become east, north, up of the plant's own by the full rotation (WGS 84).
//! Its azimuths count from south, east positive: ours are 180° less those. The mount is `pitch-roll` with the first axis
//! to the east; the first actuator's angle grows as the mirror tips to the south, ours the other way, hence its sign
//! of -1.

mod files;
mod geodesy;
mod heliostats;
mod json;
mod observations;
mod tower;
mod written;

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use rayon::prelude::*;

pub use self::files::PaintFiles;
use self::heliostats::Properties;
use self::observations::Seen;
use self::tower::{Plane, Tower};
use crate::error::IoError;

/// How the file of a record ends.
const RECORD: &str = "-calibration-properties.json";
/// Spots of the published revision that lies on the surveyed planes are off them by rounding alone \[m\].
const OFF_PLANE_M: f64 = 0.02;

/// Which of the published centres is the spot.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub enum PaintCentroid {
    /// The plant's own.
    #[default]
    Helios,
    /// That of a network.
    Utis,
}

impl PaintCentroid {
    /// Every centre.
    pub const ALL: [Self; 2] = [Self::Helios, Self::Utis];

    /// Its name in the records.
    #[must_use]
    pub fn as_str(self) -> &'static str {
        match self {
            Self::Helios => "HeliOS",
            Self::Utis => "UTIS",
        }
    }
}

/// Why records are not converted.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum PaintError {
    /// A file; the message names it.
    #[error(transparent)]
    Io(#[from] IoError),
    /// No such target to aim at.
    #[error("no plane target `{name}` in {}; known are {known}", tower.display())]
    UnknownAim {
        /// What was asked for.
        name: String,
        /// The file of the tower.
        tower: PathBuf,
        /// Names of its planes.
        known: String,
    },
    /// A heliostat has records and no properties.
    #[error("there is none for `{name}`, which has records")]
    WithoutProperties {
        /// The heliostat.
        name: String,
    },
    /// Asked to end before its end.
    #[error("stopped before its end")]
    Stopped,
}

/// What converts records: told how many files more are read and how many there are; false where it is to end.
pub type PaintWatch<'a> = &'a (dyn Fn(u64, u64) -> bool + Sync);

/// A plant as PAINT's records have it, in the frame and by the conventions of this program.
#[derive(Debug, Clone)]
pub struct Paint {
    geodetic: [f64; 3],
    targets: BTreeMap<String, Plane>,
    aim: String,
    names: Vec<String>,
    heliostats: Vec<Properties>,
    seen: Vec<Seen>,
    left_aside: Vec<(PathBuf, String)>,
    warnings: Vec<String>,
}

impl Paint {
    /// Reads the tower, the heliostats and their records; `aim` is the target that the field's heliostats aim at, by
    /// default the first by name.
    ///
    /// Records without a sun (PAINT has published such revisions), without this centroid, or of a target that is no
    /// plane are left aside.
    ///
    /// # Errors
    /// [`PaintError`] naming the file and the key for whatever is missing or not what it has to be.
    pub fn read(
        tower: &Path,
        files: &PaintFiles,
        centroid: PaintCentroid,
        aim: Option<&str>,
        watch: PaintWatch<'_>,
    ) -> Result<Self, PaintError> {
        if let Some(name) = files
            .records
            .keys()
            .find(|name| !files.heliostats.contains_key(*name))
        {
            return Err(PaintError::WithoutProperties { name: name.clone() });
        }
        let Tower {
            origin,
            targets,
            others,
        } = Tower::read(tower)?;
        let first = targets.keys().next();
        let aim = aim.or(first.map(String::as_str)).unwrap_or_default();
        if !targets.contains_key(aim) {
            return Err(PaintError::UnknownAim {
                name: aim.to_owned(),
                tower: tower.to_owned(),
                known: targets.keys().cloned().collect::<Vec<_>>().join(", "),
            });
        }
        let records: Vec<(&String, &PathBuf)> = files
            .records
            .iter()
            .flat_map(|(name, paths)| paths.iter().map(move |path| (name, path)))
            .collect();
        let all = (files.heliostats.len() + records.len()) as u64;
        let one_more = || {
            if watch(1, all) {
                Ok(())
            } else {
                Err(PaintError::Stopped)
            }
        };
        let stated: Vec<(&String, &PathBuf)> = files.heliostats.iter().collect();
        let heliostats = first_failure(stated.par_iter().map(|(name, path)| {
            one_more()?;
            Ok(Properties::read(name, path, &origin)?)
        }))?;
        let read = first_failure(records.par_iter().map(|(name, path)| {
            one_more()?;
            Ok(observations::read(name, path, &origin, &targets, centroid)?)
        }))?;
        let (mut seen, mut left_aside) = (Vec::new(), Vec::new());
        for (read, (_, path)) in read.into_iter().zip(&records) {
            match read {
                Ok(one) => seen.push(one),
                Err(reason) => left_aside.push(((*path).clone(), reason)),
            }
        }
        let no_plane = |name: &String| format!("{name} is no plane, and no target of the field");
        let mut warnings: Vec<String> = others.iter().map(no_plane).collect();
        warnings.extend(off_planes(&seen));
        if let Some((path, reason)) = left_aside.first() {
            let name = path.file_name().unwrap_or_default().display();
            let count = left_aside.len();
            let plural = if count == 1 { "" } else { "s" };
            warnings.push(format!(
                "{count} record{plural} left aside, first {name}: {reason}"
            ));
        }
        Ok(Self {
            geodetic: origin.geodetic,
            aim: aim.to_owned(),
            targets,
            names: files.heliostats.keys().cloned().collect(),
            heliostats,
            seen,
            left_aside,
            warnings,
        })
    }

    /// Names of the heliostats.
    #[must_use]
    pub fn heliostats(&self) -> &[String] {
        &self.names
    }

    /// How far each record's spot lies before the plane of its target \[m\].
    #[must_use]
    pub fn off_plane_m(&self) -> Vec<f64> {
        self.seen.iter().map(|seen| seen.off_plane_m).collect()
    }

    /// Records left aside, and why.
    #[must_use]
    pub fn left_aside(&self) -> &[(PathBuf, String)] {
        &self.left_aside
    }

    /// Things worth saying that stop nothing.
    #[must_use]
    pub fn warnings(&self) -> &[String] {
        &self.warnings
    }
}

/// All of it, or of several failures that of the first.
fn first_failure<T: Send>(
    each: impl IndexedParallelIterator<Item = Result<T, PaintError>>,
) -> Result<Vec<T>, PaintError> {
    let all: Vec<Result<T, PaintError>> = each.collect();
    all.into_iter().collect()
}

fn off_planes(seen: &[Seen]) -> Option<String> {
    let far = seen
        .iter()
        .filter(|seen| seen.off_plane_m.abs() > OFF_PLANE_M);
    let far = far.count();
    (far > 0).then(|| {
        format!(
            "{far} of {} spots lie more than {:.0} cm off the plane of their target: revisions of PAINT records differ by \
             constant shifts of up to 1.6 m, and those on the planes are the right ones",
            seen.len(),
            100.0 * OFF_PLANE_M
        )
    })
}
