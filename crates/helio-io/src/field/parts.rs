//! Fields that stand in no file.

use std::collections::{BTreeMap, HashMap};
use std::path::Path;

use helio_core::Field;
use helio_core::angle::radians;
use helio_core::drive::Drive;
use helio_core::error::FieldError;

use super::{
    BLEND_DEG, LoadedField, ObservationColumns, Site, Target, calibration, site, within_drives,
};
use crate::error::{IoError, Place, Problem};
use crate::keys;
use crate::table::{Table, TableSource};
use crate::toml::{Section, Source};

/// Where a field lies and what it aims at, from a text with the tables `[site]` and `[targets.NAME]` of a field.toml;
/// `path` is what messages call it.
///
/// # Errors
/// [`IoError`] with line and column for anything missing, unknown, doubled, out of range, or not what its key wants.
///
/// ```
/// let text = "[site]\nlatitude_deg = 37.4\nlongitude_deg = -6.25\nelevation_m = 20\n";
/// let (site, targets) = helio_io::surroundings_of_text("field".as_ref(), text)?;
/// assert!(targets.is_empty() && (site.unwrap().latitude_rad - 37.4_f64.to_radians()).abs() < 1e-15);
/// # Ok::<(), helio_io::IoError>(())
/// ```
pub fn surroundings_of_text(
    path: &Path,
    text: &str,
) -> Result<(Option<Site>, BTreeMap<String, Target>), IoError> {
    let source = Source { path, text };
    let document = source.parse()?;
    let table = document.as_table();
    let file = Section::new(source, String::new(), table, None, keys::SURROUNDINGS)?;
    let site = file.section(&keys::SITE_TABLE)?;
    let site = site.as_ref().map(Site::parse).transpose()?;
    Ok((site, site::targets(&file)?))
}

/// What a field is made of that stands in no file.
#[derive(Debug, Clone)]
pub struct FieldParts {
    /// The heliostats. Those that [`target_of`](Self::target_of) gives a target aim at its centre, whatever they say.
    pub field: Field,
    /// Where it lies.
    pub site: Option<Site>,
    /// What can be aimed at, by name.
    pub targets: BTreeMap<String, Target>,
    /// Number of each heliostat's target, in the order of the names; `None` for one that aims at a point of its own.
    pub target_of: Vec<Option<usize>>,
    /// Drives of each heliostat's two axes.
    pub drives: Vec<[Option<Drive>; 2]>,
}

impl FieldParts {
    /// The parts of a field that has no calibration.
    #[must_use]
    pub fn of(loaded: &LoadedField) -> Self {
        Self {
            field: loaded.field.clone(),
            site: loaded.site.clone(),
            targets: loaded.targets.clone(),
            target_of: loaded.target_of.clone(),
            drives: loaded.drives.clone(),
        }
    }

    /// Heliostats with targets and drives to their aims and limits.
    fn put_together(&mut self) -> Result<(), IoError> {
        let count = self.field.len();
        for (what, found) in [
            ("target_of", self.target_of.len()),
            ("drives", self.drives.len()),
        ] {
            if found != count {
                let message = format!("{what}: expected {count} rows, got {found}");
                return Err(conflict(None, message));
            }
        }
        let centres: Vec<_> = self.targets.values().map(|target| target.centre).collect();
        for row in 0..count {
            let (target, drives) = (self.target_of[row], &self.drives[row]);
            if target.is_none() && *drives == [None; 2] {
                continue;
            }
            let id = self.field.ids()[row].clone();
            let mut heliostat = self.field.heliostats()[row];
            if let Some(number) = target {
                let missing = || conflict(Some(&id), format!("there is no target {number}"));
                heliostat.aim = *centres.get(number).ok_or_else(missing)?;
            }
            heliostat.limits = within_drives(heliostat.limits, drives)
                .map_err(|problem| of_heliostat(Some(&id), problem))?;
            let replaced = self.field.replace(row, heliostat);
            replaced.map_err(|error| refused(&id, &error))?;
        }
        Ok(())
    }
}

impl LoadedField {
    /// A field as if files had described it so, and had named a calibration table if there is one: limits are what those
    /// stated and the drives' have in common.
    ///
    /// # Errors
    /// [`IoError`] naming the heliostat whose axis cannot move, or whose target is not there; the same for columns of
    /// another length than the field's, and for whatever is wrong with the calibration.
    ///
    /// ```
    /// use helio_core::{Enu, Field, Heliostat, TrackingMode};
    /// use helio_io::{FieldParts, LoadedField};
    /// let text = "[targets.board]\ncentre_enu_m = [0, 5, 40]\nnormal_enu = [0, 1, 0]\nwidth_m = 8\nheight_m = 6\n";
    /// let (site, targets) = helio_io::surroundings_of_text("field".as_ref(), text)?;
    /// let mut field = Field::new(TrackingMode::AzimuthElevation);
    /// field.push("A1", Heliostat::new(Enu::new(0.0, 90.0, 4.0), Enu::default()))?;
    /// let (target_of, drives) = (vec![Some(0)], vec![[None; 2]]);
    /// let parts = FieldParts { field, site, targets, target_of, drives };
    /// let loaded = LoadedField::of_parts(parts, None)?;
    /// assert_eq!(loaded.field.heliostats()[0].aim, Enu::new(0.0, 5.0, 40.0));
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn of_parts(
        mut parts: FieldParts,
        calibration: Option<TableSource<'_>>,
    ) -> Result<Self, IoError> {
        parts.put_together()?;
        let FieldParts {
            mut field,
            site,
            targets,
            target_of,
            drives,
        } = parts;
        let (mut schedule, mut warnings) = (None, Vec::new());
        if let Some(table) = calibration {
            let table = Table::read(table)?;
            let ids = field.ids().to_vec();
            let rows = ids.iter().enumerate();
            let row_of: HashMap<&str, usize> = rows.map(|(row, id)| (id.as_str(), row)).collect();
            let base = field.heliostats().to_vec();
            let done = calibration::apply(table, &ids, &row_of, base, BLEND_DEG)?;
            for (row, heliostat) in done.heliostats.into_iter().enumerate() {
                let replaced = field.replace(row, heliostat);
                replaced.map_err(|error| refused(&ids[row], &error))?;
            }
            (schedule, warnings) = (done.schedule, done.warnings);
        }
        Ok(Self {
            site,
            targets,
            field,
            target_of,
            drives,
            schedule,
            blend_rad: radians(BLEND_DEG),
            observation_columns: ObservationColumns::default(),
            warnings,
            files: Vec::new(),
        })
    }
}

fn of_heliostat(id: Option<&str>, problem: Problem) -> IoError {
    let place = Place {
        heliostat: id.map(str::to_owned),
        ..Place::default()
    };
    IoError::new(place, problem)
}

fn conflict(id: Option<&str>, message: String) -> IoError {
    of_heliostat(id, Problem::Conflict { message })
}

fn refused(id: &str, error: &FieldError) -> IoError {
    conflict(Some(id), error.to_string())
}

#[cfg(test)]
mod tests {
    use helio_core::{Enu, Heliostat, TrackingMode};

    use super::*;

    fn parts(target_of: Vec<Option<usize>>, drives: usize) -> FieldParts {
        let mut field = Field::new(TrackingMode::AzimuthElevation);
        let heliostat = Heliostat::new(Enu::new(0.0, 90.0, 4.0), Enu::new(0.0, 0.0, 50.0));
        field.push("A1", heliostat).expect("a heliostat");
        FieldParts {
            field,
            site: None,
            targets: BTreeMap::new(),
            target_of,
            drives: vec![[None; 2]; drives],
        }
    }

    #[test]
    fn parts_that_do_not_fit_each_other_are_refused() {
        let said = |parts| match LoadedField::of_parts(parts, None) {
            Ok(_) => String::new(),
            Err(error) => error.to_string(),
        };
        assert_eq!(said(parts(vec![None], 1)), "");
        assert_eq!(said(parts(vec![], 1)), "target_of: expected 1 rows, got 0");
        assert_eq!(said(parts(vec![None], 2)), "drives: expected 1 rows, got 2");
        assert_eq!(
            said(parts(vec![Some(0)], 1)),
            "heliostat `A1`: there is no target 0"
        );
    }

    #[test]
    fn surroundings_know_nothing_else() {
        let read = |text| surroundings_of_text(Path::new("field"), text);
        let error = read("[heliostats]\naim = \"x\"\n").expect_err("a field of its own");
        assert!(
            error.to_string().contains("unknown key `heliostats`"),
            "{error}"
        );
        let (site, targets) = read("").expect("nothing is enough");
        assert!(site.is_none() && targets.is_empty());
    }
}
