//! What both ways of calibrating are asked beside their table: the next observations, what changed, a page.

use std::io::Write;
use std::path::{Path, PathBuf};
use std::time::{SystemTime, UNIX_EPOCH};

use helio_io::calibrate::{Changes, Proposals, RunError, earlier};
use helio_io::output::{Destination, Format, KeptColumns};
use helio_io::{AtomicFile, CalibratedSet, IoError, LoadedField, Observations, format_time};
use pyo3::prelude::*;

use crate::calibrate::of_option;
use crate::failure::Failure;
use crate::table::Given;

/// The tables that a calibration reads.
pub(crate) struct Inputs {
    pub(crate) observations: Given,
    pub(crate) spots: Option<Given>,
    compare: Option<Given>,
}

impl Inputs {
    pub(crate) fn of(
        observations: &Bound<'_, PyAny>,
        spots: Option<&Bound<'_, PyAny>>,
        compare: Option<&Bound<'_, PyAny>>,
    ) -> Result<Self, Failure> {
        let given = |table: Option<&Bound<'_, PyAny>>, what| {
            table.map(|table| Given::of(table, what)).transpose()
        };
        Ok(Self {
            observations: Given::of(observations, "observations")?,
            spots: given(spots, "spots")?,
            compare: given(compare, "compare")?,
        })
    }

    /// The earlier calibration, if there is one to compare with.
    pub(crate) fn earlier(
        &self,
        loaded: &LoadedField,
    ) -> Result<Option<Vec<CalibratedSet>>, Failure> {
        let Some(table) = &self.compare else {
            return Ok(None);
        };
        match earlier(table.source(), loaded) {
            Ok(old) => Ok(Some(old)),
            // A table in memory is known by the name of its argument.
            Err(RunError::Refused(words)) => Err(of_option(&words.replacen(
                "--compare compare:",
                "--compare:",
                1,
            ))),
            Err(other) => Err(other.into()),
        }
    }

    /// Refuses a file to write that the call reads.
    pub(crate) fn not_among(
        &self,
        what: &str,
        path: &Path,
        field: &LoadedField,
    ) -> Result<(), Failure> {
        let Ok(there) = path.canonicalize() else {
            return Ok(());
        };
        let tables = [
            Some(&self.observations),
            self.spots.as_ref(),
            self.compare.as_ref(),
        ];
        let read = tables
            .into_iter()
            .flatten()
            .filter_map(|given| match given {
                Given::File(path) => Some(path),
                Given::Memory(_) => None,
            });
        let same = |input: &PathBuf| input.canonicalize().is_ok_and(|input| input == there);
        if field.files.iter().chain(read).any(same) {
            let message = format!("{}: this call reads it; name another file", path.display());
            return Err(Failure::of("OptionError", what, message));
        }
        Ok(())
    }
}

/// The page of a calibration, begun before the fit so that a place that cannot be written is known at once.
pub(crate) struct PageFile(AtomicFile);

impl PageFile {
    /// The file of a page, if one is wanted.
    ///
    /// # Errors
    /// As [`Self::begin`], and `OptionError` for a file that the call reads.
    pub(crate) fn wanted(
        path: Option<&Path>,
        inputs: &Inputs,
        field: &LoadedField,
    ) -> Result<Option<Self>, Failure> {
        let Some(path) = path else {
            return Ok(None);
        };
        inputs.not_among("report", path, field)?;
        Self::begin(path).map(Some)
    }

    /// # Errors
    /// `OptionError` for a name that is not of a page, `FileError` for a place that cannot be written.
    fn begin(path: &Path) -> Result<Self, Failure> {
        let suffix = path.extension().map(|suffix| suffix.to_ascii_lowercase());
        if suffix.is_none_or(|suffix| suffix != "html" && suffix != "htm") {
            let message = format!("{}: wanted a name that ends in .html", path.display());
            return Err(Failure::of("OptionError", "report", message));
        }
        Ok(Self(AtomicFile::create(path)?))
    }

    pub(crate) fn write(self, page: &str) -> Result<(), Failure> {
        let Self(mut file) = self;
        let path = file.path().to_owned();
        file.write_all(page.as_bytes())
            .map_err(|error| IoError::write(&path, error))?;
        Ok(file.finish()?)
    }
}

/// Where a path leads, whether there is a file or not; its folder is.
pub(crate) fn place(path: &Path) -> Option<PathBuf> {
    path.canonicalize().ok().or_else(|| {
        let folder = path.parent().filter(|folder| *folder != Path::new(""));
        let folder = folder.unwrap_or(Path::new(".")).canonicalize().ok()?;
        Some(folder.join(path.file_name()?))
    })
}

/// The next observations: how many of each heliostat, and their day.
pub(crate) type Plan = (usize, String);

/// Refuses a number of observations that nobody can want.
pub(crate) fn check_plan(plan: Option<&Plan>) -> Result<(), Failure> {
    match plan {
        Some((count, _)) if !(1..=1000).contains(count) => {
            let message = format!("wanted 1 to 1000 observations, got {count}");
            Err(Failure::of("OptionError", "plan", message))
        }
        _ => Ok(()),
    }
}

/// What is asked of the next observations, if they are.
pub(crate) fn proposals(
    plan: Option<&Plan>,
    loaded: &LoadedField,
) -> Result<Option<Proposals>, Failure> {
    let Some((count, date)) = plan else {
        return Ok(None);
    };
    match Proposals::new(*count, date, loaded) {
        Ok(proposals) => Ok(Some(proposals)),
        Err(RunError::Refused(words)) => {
            let words = words.trim_start_matches("--plan-date ");
            let words = words.trim_start_matches("--plan: ");
            Err(Failure::of("OptionError", "plan", words))
        }
        Err(other) => Err(other.into()),
    }
}

/// What changed against an earlier calibration.
pub(crate) struct Compared {
    pub(crate) changes: Changes,
    pub(crate) table: KeptColumns,
}

impl Compared {
    pub(crate) fn of(
        old: &[CalibratedSet],
        new: &[CalibratedSet],
        loaded: &LoadedField,
        observations: &Observations,
        go_on: &(dyn Fn() -> bool + Sync),
    ) -> Result<Self, Failure> {
        let changes = Changes::between(loaded, observations, old, new, go_on)?;
        let table = KeptColumns::default();
        changes.write(Destination::Columns(table.clone()), Format::Csv)?;
        Ok(Self { changes, table })
    }
}

/// Now \[ns of Unix time\].
pub(crate) fn now_ns() -> i64 {
    let since = SystemTime::now().duration_since(UNIX_EPOCH);
    since.map_or(0, |since| {
        i64::try_from(since.as_nanos()).unwrap_or(i64::MAX)
    })
}

/// Now, to the second, as the text that pages are dated with.
pub(crate) fn made_at() -> String {
    format_time(now_ns() / 1_000_000_000 * 1_000_000_000)
}
