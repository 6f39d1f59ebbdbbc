//! The small tables of the command line: suns, present axis angles, angles to predict from.

use std::borrow::Cow;
use std::collections::HashMap;
use std::path::Path;

use helio_core::Field;
use helio_core::angle::radians;
use helio_core::drive::Drive;

use crate::error::{IoError, Problem, quoted};
use crate::field::LoadedField;
use crate::keys::{self, Key};
use crate::table::{Keyed, Naming, Table, TableSource};

/// Suns given by their angles.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Suns {
    /// Azimuth \[rad\], clockwise from north.
    pub azimuth_rad: Vec<f64>,
    /// Apparent elevation \[rad\].
    pub elevation_rad: Vec<f64>,
}

/// Other names of the columns that hold a sun.
const SUN_SYNONYMS: &[(&str, &str)] = &[
    ("azimuth_deg", "sun_azimuth_deg"),
    ("elevation_deg", "sun_elevation_deg"),
];

/// Other names of the columns that hold axis angles.
const AXIS_SYNONYMS: &[(&str, &str)] = &[
    ("azimuth_deg", "axis1_deg"),
    ("elevation_deg", "axis2_deg"),
    ("heliostat", "id"),
    ("heliostat_id", "id"),
];

/// Reads a table of suns: columns `azimuth_deg`, `elevation_deg` (or `sun_azimuth_deg`,
/// `sun_elevation_deg`), CSV or Parquet.
///
/// # Errors
/// [`IoError`] for an unknown or missing column, and for angles that are no numbers or out of range:
/// azimuth within ±360, elevation within ±90 degrees.
///
/// ```
/// let folder = tempfile::tempdir()?;
/// let path = folder.path().join("suns.csv");
/// std::fs::write(&path, "azimuth_deg,elevation_deg\n180,45\n")?;
/// assert_eq!(helio_io::load_suns(&path)?.azimuth_rad, [std::f64::consts::PI]);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn load_suns(path: &Path) -> Result<Suns, IoError> {
    let naming = Naming {
        synonyms: SUN_SYNONYMS,
        ..Naming::default()
    };
    let table = Keyed::new(Table::read(path)?, keys::SUN_COLUMNS, &naming)?;
    let mut suns = Suns::default();
    for row in 0..table.table().rows() {
        suns.azimuth_rad
            .push(radians(table.needed(row, &keys::SUN_AZIMUTH, None)?));
        suns.elevation_rad
            .push(radians(table.needed(row, &keys::SUN_ELEVATION, None)?));
    }
    Ok(suns)
}

/// Where the heliostats of a field stand, in field order.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct PresentAngles {
    /// First axis \[rad\]; NaN where it is not known.
    pub axis1_rad: Vec<f64>,
    /// Second axis \[rad\]; NaN where it is not known.
    pub axis2_rad: Vec<f64>,
}

/// Reads the present axis angles of a field: columns `id`, `axis1_deg`, `axis2_deg` (or
/// `azimuth_deg`, `elevation_deg`). The other columns that `track` writes are left aside.
/// Heliostats without a row, or with an empty one, are not known. In a table with `time` or the sun's
/// angles a heliostat may have many rows; the last with angles counts.
///
/// # Errors
/// [`IoError`] for an unknown or missing column, an id that is not in the field or stands twice for no time, one
/// angle without the other, and angles that are no numbers.
pub fn load_present(path: &Path, field: &Field) -> Result<PresentAngles, IoError> {
    let ignore = |name: &str| keys::TRACKED.contains(&name);
    let naming = Naming {
        synonyms: AXIS_SYNONYMS,
        ignore: Some(&ignore),
        ..Naming::default()
    };
    let table = Keyed::new(Table::read(path)?, keys::PRESENT_COLUMNS, &naming)?;
    for key in [&keys::AXIS1, &keys::AXIS2] {
        if !table.has(key) {
            return Err(table.missing_column(key));
        }
    }
    // Rows of several suns: the axes stand where the last of them left them.
    let several = table
        .table()
        .names()
        .iter()
        .any(|name| name == "time" || name == "sun_azimuth_deg");
    let unknown = vec![f64::NAN; field.len()];
    let mut present = PresentAngles {
        axis1_rad: unknown.clone(),
        axis2_rad: unknown,
    };
    let mut first: HashMap<usize, usize> = HashMap::new();
    for row in 0..table.table().rows() {
        let (id, heliostat) = heliostat(&table, row, field)?;
        if let Some(first) = first.insert(heliostat, row)
            && !several
        {
            let first = table.table().position(first);
            let problem = Problem::Duplicate {
                what: "id",
                name: id,
                first,
            };
            return Err(table.error(row, &keys::ID, None, problem));
        }
        if let Some((axis1, axis2)) = pair(&table, row, &id, &keys::AXIS1, &keys::AXIS2)? {
            present.axis1_rad[heliostat] = radians(axis1);
            present.axis2_rad[heliostat] = radians(axis2);
        }
    }
    Ok(present)
}

/// Axis angles to predict from, one entry per row of the table.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Angles {
    /// Row of the heliostat in the field.
    pub heliostat: Vec<usize>,
    /// First axis \[rad\].
    pub axis1_rad: Vec<f64>,
    /// Second axis \[rad\].
    pub axis2_rad: Vec<f64>,
    /// The sun of each row, if the table states it.
    pub sun: AnglesSun,
    /// Rows left aside because their `status` says that they have no angles.
    pub skipped: usize,
    /// Whether the table states times beside the sun's angles, which are those that count.
    pub times_unused: bool,
}

/// The sun of each row of [`Angles`].
#[derive(Debug, Clone, Default, PartialEq)]
#[non_exhaustive]
pub enum AnglesSun {
    /// The table says nothing of it.
    #[default]
    Unstated,
    /// Times \[ns of Unix time\].
    Times {
        /// One for each row.
        unix_ns: Vec<i64>,
    },
    /// Given by angles, which win over times.
    Angles(Suns),
}

/// Reads axis angles to predict from: columns `id` and one of the pairs `axis1_deg, axis2_deg` (or
/// `azimuth_deg, elevation_deg`) and `axis1_steps, axis2_steps` (with drives; angles win where both
/// are there), optionally `time` or `sun_azimuth_deg, sun_elevation_deg`. What `track` writes can be
/// read back; its rows whose `status` is not `ok` and whose angles are empty are counted and left aside.
///
/// # Errors
/// [`IoError`] for an unknown or missing column, an id not in the field, a row without angles, steps
/// without or beyond a drive, and a time without an offset.
pub fn load_angles<'a>(
    table: impl Into<TableSource<'a>>,
    loaded: &LoadedField,
) -> Result<Angles, IoError> {
    let ignore = |name: &str| {
        keys::TRACKED.contains(&name) && keys::names(keys::ANGLE_COLUMNS).all(|known| known != name)
    };
    let naming = Naming {
        synonyms: AXIS_SYNONYMS,
        ignore: Some(&ignore),
        ..Naming::default()
    };
    let table = Keyed::new(Table::read(table)?, keys::ANGLE_COLUMNS, &naming)?;
    let has_angles = both_or_none(&table, &keys::AXIS1, &keys::AXIS2)?;
    let has_steps = both_or_none(&table, &keys::AXIS1_STEPS, &keys::AXIS2_STEPS)?;
    if !has_angles && !has_steps {
        return Err(table.missing_column(&keys::AXIS1));
    }
    let has_sun = both_or_none(&table, &keys::SUN_AZIMUTH, &keys::SUN_ELEVATION)?;
    let mut angles = Angles::default();
    let (mut suns, mut times) = (Suns::default(), Vec::new());
    for row in 0..table.table().rows() {
        let (id, heliostat) = heliostat(&table, row, &loaded.field)?;
        let who = Some(id.as_str());
        let mut found = pair(&table, row, &id, &keys::AXIS1, &keys::AXIS2)?
            .map(|(axis1, axis2)| (radians(axis1), radians(axis2)));
        if found.is_none()
            && let Some(steps) = pair(&table, row, &id, &keys::AXIS1_STEPS, &keys::AXIS2_STEPS)?
        {
            found = Some(driven_rad(
                &table,
                row,
                &id,
                &loaded.drives[heliostat],
                steps,
            )?);
        }
        let Some((axis1_rad, axis2_rad)) = found else {
            let status = table.text(row, &keys::STATUS, &id)?;
            if status.is_some_and(|status| status != "ok") {
                angles.skipped += 1;
                continue;
            }
            let problem = Problem::Missing {
                what: "the pair of axis angles".into(),
                wanted: "its cells are empty".into(),
            };
            return Err(table.row_error(row, &id, problem));
        };
        angles.heliostat.push(heliostat);
        angles.axis1_rad.push(axis1_rad);
        angles.axis2_rad.push(axis2_rad);
        if has_sun {
            suns.azimuth_rad
                .push(radians(table.needed(row, &keys::SUN_AZIMUTH, who)?));
            suns.elevation_rad
                .push(radians(table.needed(row, &keys::SUN_ELEVATION, who)?));
            let timed = || matches!(table.time(row, &keys::TIME, &id), Ok(Some(_)));
            angles.times_unused = angles.times_unused || table.has(&keys::TIME) && timed();
        } else if table.has(&keys::TIME) {
            times.push(table.time(row, &keys::TIME, &id)?.ok_or_else(|| {
                let problem = Problem::Missing {
                    what: "the time".into(),
                    wanted: "other rows have one".into(),
                };
                table.error(row, &keys::TIME, who, problem)
            })?);
        }
    }
    angles.sun = match (has_sun, table.has(&keys::TIME)) {
        (true, _) => AnglesSun::Angles(suns),
        (false, true) => AnglesSun::Times { unix_ns: times },
        (false, false) => AnglesSun::Unstated,
    };
    Ok(angles)
}

fn heliostat(table: &Keyed, row: usize, field: &Field) -> Result<(String, usize), IoError> {
    known_heliostat(table, row, &keys::ID, field)
        .map(|(id, heliostat)| (id.into_owned(), heliostat))
}

/// Name and row in the field of the heliostat that a row names.
pub(crate) fn known_heliostat<'a>(
    table: &'a Keyed,
    row: usize,
    key: &'static Key,
    field: &Field,
) -> Result<(Cow<'a, str>, usize), IoError> {
    let id = table.id(row, key)?;
    match field.row_of(&id) {
        Some(heliostat) => Ok((id, heliostat)),
        None => {
            let nearest = crate::error::nearest(&id, field.ids().iter().map(String::as_str));
            let advice = format!(", the field has {} others", field.len());
            let name = id.into_owned();
            let problem = Problem::Unknown {
                what: "heliostat",
                name,
                nearest,
                known: Vec::new(),
                advice,
            };
            Err(table.error(row, key, None, problem))
        }
    }
}

/// The axis angles \[rad\] to which drives lead at these steps.
pub(crate) fn driven_rad(
    table: &Keyed,
    row: usize,
    id: &str,
    drives: &[Option<Drive>; 2],
    steps: (f64, f64),
) -> Result<(f64, f64), IoError> {
    let angle = |axis: usize, key: &'static Key, steps: f64| {
        let refuse = |message| table.error(row, key, Some(id), Problem::Conflict { message });
        let Some(drive) = &drives[axis] else {
            return Err(refuse(format!(
                "axis {} has no drive to take steps",
                axis + 1
            )));
        };
        drive
            .angle_rad(steps)
            .ok_or_else(|| refuse(format!("its drive cannot be at {steps} steps")))
    };
    Ok((
        angle(0, &keys::AXIS1_STEPS, steps.0)?,
        angle(1, &keys::AXIS2_STEPS, steps.1)?,
    ))
}

/// Both cells or none.
pub(crate) fn pair(
    table: &Keyed,
    row: usize,
    id: &str,
    first: &'static Key,
    second: &'static Key,
) -> Result<Option<(f64, f64)>, IoError> {
    let lacks = |key: &'static Key, other: &Key| {
        let message = format!("empty, though {} is there", quoted(other.name));
        table.error(row, key, Some(id), Problem::Conflict { message })
    };
    match (
        table.number(row, first, Some(id))?,
        table.number(row, second, Some(id))?,
    ) {
        (Some(one), Some(two)) => Ok(Some((one, two))),
        (None, None) => Ok(None),
        (Some(_), None) => Err(lacks(second, first)),
        (None, Some(_)) => Err(lacks(first, second)),
    }
}

/// True if the table has both columns, false if neither.
pub(crate) fn both_or_none(
    table: &Keyed,
    first: &'static Key,
    second: &'static Key,
) -> Result<bool, IoError> {
    match (table.has(first), table.has(second)) {
        (true, false) => Err(table.missing_column(second)),
        (false, true) => Err(table.missing_column(first)),
        (both, _) => Ok(both),
    }
}
