//! Where the files of heliostats and their records stand.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use super::RECORD;
use crate::error::{IoError, Place, Problem};

/// How the file of a heliostat's properties ends.
const PROPERTIES: &str = "-heliostat-properties.json";

/// The files of heliostats and of their records.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct PaintFiles {
    /// The heliostat-properties.json of each heliostat, by its name.
    pub heliostats: BTreeMap<String, PathBuf>,
    /// The calibration-properties.json files of heliostats, by their names.
    pub records: BTreeMap<String, Vec<PathBuf>>,
}

impl PaintFiles {
    /// The files of a folder in PAINT's own order: `AA39/Properties/AA39-heliostat-properties.json` and
    /// `AA39/Calibration/…-calibration-properties.json`, records by their numbers.
    ///
    /// # Errors
    /// [`IoError`] for a folder that cannot be read or has no heliostat.
    pub fn in_folder(folder: &Path) -> Result<Self, IoError> {
        let mut found = Self::default();
        for heliostat in entries(folder)? {
            for path in entries_if_there(&heliostat.join("Properties"))? {
                if let Some(name) = stem(&path, PROPERTIES) {
                    found.heliostats.insert(name, path);
                }
            }
        }
        if found.heliostats.is_empty() {
            let problem = Problem::Missing {
                what: format!("a file */Properties/*{PROPERTIES}"),
                wanted: String::new(),
            };
            return Err(IoError::new(Place::file(folder), problem));
        }
        for name in found.heliostats.keys() {
            let mut records = entries_if_there(&folder.join(name).join("Calibration"))?;
            records.retain(|path| stem(path, RECORD).is_some());
            records.sort_by_key(|path| (path.as_os_str().len(), path.clone()));
            found.records.insert(name.clone(), records);
        }
        Ok(found)
    }
}

fn stem(path: &Path, suffix: &str) -> Option<String> {
    let name = path.file_name()?.to_str()?;
    name.strip_suffix(suffix).map(str::to_owned)
}

fn entries(folder: &Path) -> Result<Vec<PathBuf>, IoError> {
    let read = || -> std::io::Result<Vec<PathBuf>> {
        let each = std::fs::read_dir(folder)?;
        each.map(|entry| Ok(entry?.path())).collect()
    };
    let mut found = read().map_err(|error| IoError::read(folder, error))?;
    found.sort();
    Ok(found)
}

fn entries_if_there(folder: &Path) -> Result<Vec<PathBuf>, IoError> {
    if folder.is_dir() {
        entries(folder)
    } else {
        Ok(Vec::new())
    }
}
