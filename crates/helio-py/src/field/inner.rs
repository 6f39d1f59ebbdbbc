//! What a field is, and the trackers made for it.

use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, PoisonError};

use helio_core::drive::Drive;
use helio_core::error::FieldError;
use helio_core::tracking::TrackingColumns;
use helio_core::{EnuUnit, Field, OffsetForm, Status, TargetPlane, Tracker};
use helio_io::{
    CalibrationSchedule, LoadedField, MemoryTable, Site, hash_file, load_field,
    load_field_calibrated,
};

use crate::failure::Failure;

/// Angles that rounding may put beyond a limit \[rad\].
const ROUNDING_RAD: f64 = 2e-12;

/// A field and the constants of its heliostats, computed once.
pub(crate) struct Inner {
    source: Source,
    exact: Arc<Tracker>,
    /// Trackers of other offset forms asked for.
    others: Mutex<Vec<Arc<Tracker>>>,
    drives_end_early: bool,
}

enum Source {
    Columns(Field),
    Files {
        loaded: Box<LoadedField>,
        path: PathBuf,
        /// Every file read, as it was named.
        named: Vec<PathBuf>,
        hashes: Vec<String>,
    },
}

impl Inner {
    pub(crate) fn of_columns(field: Field) -> Result<Self, Failure> {
        Self::new(Source::Columns(field))
    }

    /// Reads a field.toml.
    pub(crate) fn load(path: &Path) -> Result<Self, Failure> {
        Self::loaded_from(path, load_field(path)?)
    }

    /// Reads a field.toml, with another calibration than it names.
    pub(crate) fn load_calibrated(path: &Path, calibration: &MemoryTable) -> Result<Self, Failure> {
        Self::loaded_from(path, load_field_calibrated(path, calibration.into())?)
    }

    fn loaded_from(path: &Path, mut loaded: LoadedField) -> Result<Self, Failure> {
        let named = loaded.files.clone();
        // Whoever asks again may stand in another folder.
        let absolute = |path: &Path| std::path::absolute(path).unwrap_or_else(|_| path.into());
        for file in &mut loaded.files {
            *file = absolute(file);
        }
        let loaded = Box::new(loaded);
        let hashes: Result<_, _> = loaded.files.iter().map(|file| hash_file(file)).collect();
        let path = absolute(path);
        Self::new(Source::Files {
            loaded,
            path,
            named,
            hashes: hashes?,
        })
    }

    fn new(source: Source) -> Result<Self, Failure> {
        let exact = Arc::new(Tracker::new(source.field(), OffsetForm::Exact)?);
        let drives_end_early = match &source {
            Source::Columns(_) => false,
            Source::Files { loaded, .. } => drives_end_early(loaded),
        };
        Ok(Self {
            source,
            exact,
            others: Mutex::default(),
            drives_end_early,
        })
    }

    pub(crate) fn field(&self) -> &Field {
        self.source.field()
    }

    pub(crate) fn len(&self) -> usize {
        self.exact.len()
    }

    pub(crate) fn exact(&self) -> &Tracker {
        &self.exact
    }

    /// The tracker for an offset form, made when it is first asked for.
    pub(crate) fn tracker(&self, offset: OffsetForm) -> Result<Arc<Tracker>, Failure> {
        if offset == OffsetForm::Exact {
            return Ok(Arc::clone(&self.exact));
        }
        let find = |kept: &[Arc<Tracker>]| kept.iter().find(|t| t.offset() == offset).cloned();
        // Held for moments only, and not while a tracker is made.
        let kept = || self.others.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(found) = find(&kept()) {
            return Ok(found);
        }
        let made = Arc::new(Tracker::new(self.field(), offset)?);
        let mut kept = kept();
        if find(&kept).is_none() {
            kept.push(Arc::clone(&made));
        }
        Ok(made)
    }

    pub(crate) fn loaded(&self) -> Option<&LoadedField> {
        match &self.source {
            Source::Columns(_) => None,
            Source::Files { loaded, .. } => Some(loaded),
        }
    }

    /// Calibrations that change with the hour or the date, and where the sun is seen from.
    pub(crate) fn schedule(&self) -> Option<(&CalibrationSchedule, Option<&Site>)> {
        let loaded = self.loaded()?;
        let schedule = loaded.schedule.as_ref()?;
        Some((schedule, loaded.site.as_ref()))
    }

    pub(crate) fn site(&self) -> Option<&Site> {
        self.loaded()?.site.as_ref()
    }

    pub(crate) fn warnings(&self) -> &[String] {
        self.loaded().map_or(&[], |loaded| &loaded.warnings)
    }

    pub(crate) fn files(&self) -> &[PathBuf] {
        self.loaded().map_or(&[], |loaded| &loaded.files)
    }

    /// Every file read, as whoever asked for the first of them named it.
    pub(crate) fn named(&self) -> Option<&[PathBuf]> {
        match &self.source {
            Source::Columns(_) => None,
            Source::Files { named, .. } => Some(named),
        }
    }

    /// What was read from files, and their hashes, for a calibration.
    ///
    /// # Errors
    /// `MissingError` for a field of columns.
    pub(crate) fn files_read(&self) -> Result<(&LoadedField, &[String]), Failure> {
        match &self.source {
            Source::Files { loaded, hashes, .. } => Ok((loaded, hashes)),
            Source::Columns(_) => {
                let message = "field: observations are of targets, which only a field read from files has: Field.from_toml";
                Err(Failure::new("MissingError", message))
            }
        }
    }

    /// The plane on which a heliostat's beam is looked at: its target's, or one through its aim that faces it.
    pub(crate) fn plane_for(&self, row: usize) -> Result<TargetPlane, FieldError> {
        if let Some(loaded) = self.loaded() {
            return loaded.plane_for(row);
        }
        let heliostats = self.field().heliostats();
        let count = heliostats.len();
        let heliostat = heliostats
            .get(row)
            .ok_or(FieldError::NoSuchRow { row, count })?;
        let toward_field = EnuUnit::try_new(heliostat.pivot - heliostat.aim);
        Ok(TargetPlane::level(
            heliostat.aim,
            toward_field.unwrap_or(EnuUnit::UP),
        ))
    }

    /// The file it was read from, and the hashes of all files read.
    pub(crate) fn read_from(&self) -> Option<(&Path, &[String])> {
        match &self.source {
            Source::Columns(_) => None,
            Source::Files { path, hashes, .. } => Some((path, hashes)),
        }
    }

    pub(crate) fn drives(&self, row: usize) -> [Option<Drive>; 2] {
        let drives = self.loaded().and_then(|loaded| loaded.drives.get(row));
        drives.copied().unwrap_or_default()
    }

    /// True if some angles within the limits have no steps, so that rows must be looked at once more.
    pub(crate) fn drives_end_early(&self) -> bool {
        self.drives_end_early
    }

    /// Makes rows whose angles no steps of their drive lead to rows outside their limits, as `helio-rs
    /// track` does; by how much they are outside is not known. True if there is one.
    pub(crate) fn beyond_drives(&self, columns: TrackingColumns<'_>) -> bool {
        let n = self.len();
        let mut any = false;
        for row in 0..columns.status.len() {
            let angles = [columns.axis1_rad[row], columns.axis2_rad[row]];
            let drives = self.drives(row % n);
            let lacks = |axis: usize| drives[axis].is_some_and(|d| d.steps(angles[axis]).is_none());
            if columns.status[row] == Status::Ok && (lacks(0) || lacks(1)) {
                columns.status[row] = Status::OutsideLimits;
                columns.axis1_rad[row] = f64::NAN;
                columns.axis2_rad[row] = f64::NAN;
                columns.incidence_rad[row] = f64::NAN;
                columns.limit_excess_rad[row] = f64::NAN;
                any = true;
            }
        }
        any
    }
}

impl Source {
    fn field(&self) -> &Field {
        match self {
            Self::Columns(field) => field,
            Self::Files { loaded, .. } => &loaded.field,
        }
    }
}

/// Steps are monotone in the angle, so that a drive with steps at both limits has them between.
fn drives_end_early(loaded: &LoadedField) -> bool {
    let heliostats = loaded.field.heliostats().iter().zip(&loaded.drives);
    heliostats.into_iter().any(|(heliostat, drives)| {
        let l = &heliostat.limits;
        let ends = [
            [l.axis1_min_rad, l.axis1_max_rad],
            [l.axis2_min_rad, l.axis2_max_rad],
        ];
        drives.iter().zip(ends).any(|(drive, [min, max])| {
            drive.is_some_and(|drive| {
                drive.steps(min - ROUNDING_RAD).is_none()
                    || drive.steps(max + ROUNDING_RAD).is_none()
            })
        })
    })
}
