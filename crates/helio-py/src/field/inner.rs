//! What a field is, and the trackers made for it.

use std::borrow::Cow;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, PoisonError};

use helio_core::drive::Drive;
use helio_core::error::FieldError;
use helio_core::tracking::TrackingColumns;
use helio_core::{Field, OffsetForm, Status, TargetPlane, Tracker};
use helio_io::{
    CalibrationSchedule, FieldParts, LoadedField, MemoryTable, Site, hash_file, load_field,
    load_field_calibrated,
};

use crate::calibrate::hash_text;
use crate::failure::Failure;

/// Angles that rounding may put beyond a limit \[rad\].
const ROUNDING_RAD: f64 = 2e-12;

/// A field and the constants of its heliostats, computed once.
pub(crate) struct Inner {
    loaded: Box<LoadedField>,
    source: Source,
    exact: Arc<Tracker>,
    /// Trackers of other offset forms asked for.
    others: Mutex<Vec<Arc<Tracker>>>,
    drives_end_early: bool,
}

enum Source {
    Columns {
        /// What the columns said, where a calibration has been put in their place.
        before: Option<Box<FieldParts>>,
        /// `[site]` and `[targets]` as they were given.
        surroundings: String,
    },
    Files {
        path: PathBuf,
        /// Every file read, as it was named.
        named: Vec<PathBuf>,
        hashes: Vec<String>,
    },
}

impl Inner {
    /// A field of columns; `surroundings` is the text that its site and targets were read from.
    pub(crate) fn of_columns(
        parts: FieldParts,
        surroundings: String,
        calibration: Option<&MemoryTable>,
    ) -> Result<Self, Failure> {
        let before = calibration.map(|_| Box::new(parts.clone()));
        let loaded = LoadedField::of_parts(parts, calibration.map(Into::into))?;
        let source = Source::Columns {
            before,
            surroundings,
        };
        Self::new(loaded, source)
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
        let hashes: Result<_, _> = loaded.files.iter().map(|file| hash_file(file)).collect();
        let (path, hashes) = (absolute(path), hashes?);
        let source = Source::Files {
            path,
            named,
            hashes,
        };
        Self::new(loaded, source)
    }

    fn new(loaded: LoadedField, source: Source) -> Result<Self, Failure> {
        let exact = Arc::new(Tracker::new(&loaded.field, OffsetForm::Exact)?);
        let drives_end_early = drives_end_early(&loaded);
        Ok(Self {
            loaded: Box::new(loaded),
            source,
            exact,
            others: Mutex::default(),
            drives_end_early,
        })
    }

    pub(crate) fn field(&self) -> &Field {
        &self.loaded.field
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

    pub(crate) fn loaded(&self) -> &LoadedField {
        &self.loaded
    }

    /// Calibrations that change with the hour or the date, and where the sun is seen from.
    pub(crate) fn schedule(&self) -> Option<(&CalibrationSchedule, Option<&Site>)> {
        let schedule = self.loaded.schedule.as_ref()?;
        Some((schedule, self.loaded.site.as_ref()))
    }

    pub(crate) fn site(&self) -> Option<&Site> {
        self.loaded.site.as_ref()
    }

    /// Every file read, as whoever asked for the first of them named it.
    pub(crate) fn named(&self) -> &[PathBuf] {
        match &self.source {
            Source::Columns { .. } => &[],
            Source::Files { named, .. } => named,
        }
    }

    /// A field on whose targets spots are seen.
    ///
    /// # Errors
    /// `MissingError` for a field of columns without targets.
    pub(crate) fn with_targets(&self) -> Result<&LoadedField, Failure> {
        if self.is_bare() {
            let message = "field: observations are of targets, which this field has none of; give it \
                           `targets` and `site`, or read it from files: Field.from_toml";
            return Err(Failure::new("MissingError", message));
        }
        Ok(&self.loaded)
    }

    /// True for columns of heliostats and nothing around them.
    pub(crate) fn is_bare(&self) -> bool {
        matches!(self.source, Source::Columns { .. }) && self.loaded.targets.is_empty()
    }

    /// SHA-256 of all that it was made from.
    pub(crate) fn hash(&self) -> String {
        match &self.source {
            Source::Files { hashes, .. } => hash_text(&hashes.join(" ")),
            Source::Columns { .. } => super::columns::hash(&self.parts(), self.surroundings()),
        }
    }

    /// What its columns said before a calibration was put in their place.
    pub(crate) fn parts(&self) -> Cow<'_, FieldParts> {
        match &self.source {
            Source::Columns {
                before: Some(before),
                ..
            } => Cow::Borrowed(before),
            _ => Cow::Owned(FieldParts::of(&self.loaded)),
        }
    }

    pub(crate) fn surroundings(&self) -> &str {
        match &self.source {
            Source::Columns { surroundings, .. } => surroundings,
            Source::Files { .. } => "",
        }
    }

    /// The plane on which a heliostat's beam is looked at: its target's, or one through its aim that faces it.
    pub(crate) fn plane_for(&self, row: usize) -> Result<TargetPlane, FieldError> {
        self.loaded.plane_for(row)
    }

    /// The file it was read from, and the hashes of all files read.
    pub(crate) fn read_from(&self) -> Option<(&Path, &[String])> {
        match &self.source {
            Source::Columns { .. } => None,
            Source::Files { path, hashes, .. } => Some((path, hashes)),
        }
    }

    pub(crate) fn drives(&self, row: usize) -> [Option<Drive>; 2] {
        self.loaded.drives.get(row).copied().unwrap_or_default()
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
