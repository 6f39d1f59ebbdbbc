//! `field.toml` and the tables it names.

mod calibration;
mod drives;
mod layout;
mod parts;
mod site;

use std::collections::{BTreeMap, HashMap};
use std::path::{Path, PathBuf};

use helio_core::angle::radians;
use helio_core::drive::Drive;
use helio_core::error::FieldError;
use helio_core::{AxisLimits, Enu, EnuUnit, Field, Heliostat, TargetPlane, TrackingMode};

pub(crate) use calibration::ignored as ignored_in_calibrations;
pub use calibration::{CalibrationSchedule, Lapse};
pub use parts::{FieldParts, surroundings_of_text};
pub use site::{Site, Target, TargetArea};

use crate::error::{IoError, Problem, said};
use crate::keys::{self, Key};
use crate::table::{Keyed, Naming, Table, TableSource, read_text};
use crate::toml::{Section, Source};
use layout::{Aim, Context, Quantities, shown};

/// A field as its files describe it.
#[derive(Debug, Clone)]
#[non_exhaustive]
pub struct LoadedField {
    /// Where it lies; `None` if the file has no `[site]`, and the sun must be given by its angles.
    pub site: Option<Site>,
    /// What can be aimed at, by name.
    pub targets: BTreeMap<String, Target>,
    /// The heliostats, in the order of the table. Their limits are what the stated limits and the
    /// range of the drive have in common; their errors are the calibrated ones. Where a
    /// [`schedule`](Self::schedule) exists, they are as at solar noon of its last span of time.
    pub field: Field,
    /// Number of each heliostat's target in [`targets`](Self::targets), in the order of the names;
    /// `None` if it aims at a point of its own.
    pub target_of: Vec<Option<usize>>,
    /// Drives of each heliostat's two axes.
    pub drives: Vec<[Option<Drive>; 2]>,
    /// Calibrations that change with the hour or the date; `None` if none does, which is the cheap
    /// and common case: all parameters then stand in [`field`](Self::field).
    pub schedule: Option<CalibrationSchedule>,
    /// Hour angle over which neighbouring sets of a calibration blend \[rad\].
    pub blend_rad: f64,
    /// How foreign tables of observations name their columns.
    pub observation_columns: ObservationColumns,
    /// Things worth saying that stop nothing.
    pub warnings: Vec<String>,
    /// Every file read, `field.toml` first.
    pub files: Vec<PathBuf>,
}

/// Names of the columns of a foreign table of observations, as `[observations]` states them.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
#[non_exhaustive]
pub struct ObservationColumns {
    /// Our name and the table's.
    pub renames: Vec<(String, String)>,
    /// Columns to leave aside.
    pub ignore: Vec<String>,
}

impl ObservationColumns {
    fn parse(file: &Section<'_>) -> Result<Self, IoError> {
        let Some(section) = file.section(&keys::OBSERVATIONS_TABLE)? else {
            return Ok(Self::default());
        };
        let renames = section.renames(&keys::OBSERVED_COLUMNS)?;
        let ignore = section.texts(&keys::OBSERVED_IGNORE)?;
        for (index, (ours, foreign)) in renames.iter().enumerate() {
            let again = renames[..index]
                .iter()
                .any(|(_, other)| other.text.trim() == foreign.text.trim());
            if again
                || ignore
                    .iter()
                    .any(|ignored| ignored.text.trim() == foreign.text.trim())
            {
                let other = if again {
                    "for another column too"
                } else {
                    "in ignore too"
                };
                let message = format!("{ours} is column `{}`, which stands {other}", foreign.text);
                let problem = Problem::Conflict { message };
                return Err(section.source().error(foreign.span.clone(), problem));
            }
        }
        Ok(Self {
            renames: renames
                .iter()
                .map(|(ours, foreign)| ((*ours).to_string(), foreign.text.trim().to_string()))
                .collect(),
            ignore: ignore
                .iter()
                .map(|name| name.text.trim().to_string())
                .collect(),
        })
    }
}

impl LoadedField {
    /// Name and target that a heliostat aims at; `None` if it aims at a point of its own.
    ///
    /// # Errors
    /// [`FieldError::NoSuchRow`] if `row` is not in the field.
    pub fn target(&self, row: usize) -> Result<Option<(&str, &Target)>, FieldError> {
        let number = in_row(&self.target_of, row)?;
        let target = number.and_then(|number| self.targets.iter().nth(number));
        Ok(target.map(|(name, target)| (name.as_str(), target)))
    }

    /// The plane on which a heliostat's beam is looked at: its target's, or, if it aims at a mere
    /// point, the plane through that point square to the line from the pivot, its right edge level.
    ///
    /// A heliostat whose aim is its own pivot gets a level plane; its rows have status
    /// `aim_at_pivot` in any case.
    ///
    /// # Errors
    /// [`FieldError::NoSuchRow`] if `row` is not in the field.
    pub fn plane_for(&self, row: usize) -> Result<TargetPlane, FieldError> {
        let heliostat = in_row(self.field.heliostats(), row)?;
        let area = self.target(row)?.and_then(|(_, target)| target.area);
        Ok(match area {
            Some(area) => area.plane,
            None => {
                let toward_field = EnuUnit::try_new(heliostat.pivot - heliostat.aim);
                TargetPlane::level(heliostat.aim, toward_field.unwrap_or(EnuUnit::UP))
            }
        })
    }

    /// True if any axis has a drive.
    #[must_use]
    pub fn has_drives(&self) -> bool {
        self.drives.iter().flatten().any(Option::is_some)
    }
}

/// What stands in a row.
fn in_row<T>(all: &[T], row: usize) -> Result<&T, FieldError> {
    let count = all.len();
    all.get(row).ok_or(FieldError::NoSuchRow { row, count })
}

/// Reads `field.toml` and the tables it names, relative to its own folder.
///
/// The keys are those of [`schema`](crate::schema). The heliostat table has a row per heliostat with
/// `id, east_m, north_m, up_m` (the pivot) and any of the quantities that can stand in `[heliostats]`
/// as a default for all; an empty cell falls back to the default. Limits stated and the range of a
/// drive ([`Drive::range_rad`]) both hold: what they have in common becomes the heliostat's limits. A
/// drive whose ends lie more than 3600° apart is a counter: its range limits no angle, though an angle
/// beyond it has no steps. The second axis has two limits or none.
/// A calibration table overrides the layout; empty cells of it leave the layout's value.
///
/// # Errors
/// [`IoError`] with file, line and column of the TOML, or file, line (row) and column name of a
/// table, for anything missing, unknown, doubled, out of range, or not what its key wants.
///
/// ```
/// let folder = tempfile::tempdir()?;
/// std::fs::write(folder.path().join("layout.csv"), "id,east_m,north_m,up_m\nA1,10,80,4\n")?;
/// let path = folder.path().join("field.toml");
/// std::fs::write(&path, r#"
///     [targets.receiver]
///     centre_enu_m = [0, 0, 60]
///     [heliostats]
///     table = "layout.csv"
///     aim = "receiver"
///     mirror_offset_m = 0.2
/// "#)?;
/// let loaded = helio_io::load_field(&path)?;
/// assert_eq!(loaded.field.ids(), ["A1"]);
/// assert_eq!(loaded.field.heliostats()[0].mirror_offset_m, 0.2);
/// assert_eq!(loaded.target(0)?.unwrap().0, "receiver");
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn load_field(path: &Path) -> Result<LoadedField, IoError> {
    load(path, None)
}

/// Reads `field.toml` as [`load_field`] does, with another calibration table in the place of the one that it names, if it
/// names one.
///
/// # Errors
/// As [`load_field`].
pub fn load_field_calibrated(
    path: &Path,
    calibration: TableSource<'_>,
) -> Result<LoadedField, IoError> {
    load(path, Some(calibration))
}

fn load(path: &Path, calibration: Option<TableSource<'_>>) -> Result<LoadedField, IoError> {
    let text = read_text(path)?;
    let source = Source { path, text: &text };
    let document = source.parse()?;
    let file = Section::new(source, String::new(), document.as_table(), None, keys::FILE)?;
    let site = file
        .section(&keys::SITE_TABLE)?
        .as_ref()
        .map(Site::parse)
        .transpose()?;
    let targets = site::targets(&file)?;
    let observation_columns = ObservationColumns::parse(&file)?;
    let Some(heliostats) = file.section(&keys::HELIOSTATS_TABLE)? else {
        return Err(file.missing(&keys::HELIOSTATS_TABLE));
    };
    let mut files = vec![path.to_path_buf()];

    let mode = mode(&heliostats, site.as_ref())?;
    let drive_defaults = drives::Defaults::parse(&heliostats)?;
    let centres: Vec<(&str, Enu)> = targets
        .iter()
        .map(|(name, target)| (name.as_str(), target.centre))
        .collect();
    let context = Context {
        defaults: Quantities::parse(&heliostats)?,
        default_aim: default_aim(&heliostats, &centres)?,
        up_offset_m: heliostats.number(&keys::UP_OFFSET)?.unwrap_or(0.0),
        targets: &centres,
    };
    let blend_deg = heliostats.number(&keys::BLEND)?.unwrap_or(BLEND_DEG);
    let layout = layout_table(&heliostats, &mut files)?;
    context.defaults.check_sides(&heliostats, &layout)?;
    let rows = layout::rows(&layout, &context)?;

    let mut ids = Vec::with_capacity(rows.len());
    let mut target_of = Vec::with_capacity(rows.len());
    let mut base: Vec<Heliostat> = Vec::with_capacity(rows.len());
    for row in rows {
        target_of.push(match row.aim {
            Aim::Point(_) => None,
            Aim::Target(number) => Some(number),
        });
        ids.push(row.id);
        base.push(row.heliostat);
    }
    let row_of: HashMap<&str, usize> = ids
        .iter()
        .enumerate()
        .map(|(row, id)| (id.as_str(), row))
        .collect();

    let drives = match read_named(&heliostats, &keys::DRIVES, &mut files)? {
        Some(table) => drive_defaults.with_table(table, &ids, &row_of)?,
        None => drive_defaults.for_all(ids.len())?,
    };
    for (row, (heliostat, drives)) in base.iter_mut().zip(&drives).enumerate() {
        heliostat.limits = within_drives(heliostat.limits, drives)
            .map_err(|problem| layout.row_error(row, &ids[row], problem))?;
    }
    let calibration = match calibration {
        Some(table) => Some(Table::read(table)?),
        None => read_named(&heliostats, &keys::CALIBRATION, &mut files)?,
    };
    let (heliostats, schedule, warnings) = match calibration {
        Some(table) => {
            let done = calibration::apply(table, &ids, &row_of, base, blend_deg)?;
            (done.heliostats, done.schedule, done.warnings)
        }
        None => (base, None, Vec::new()),
    };

    let mut field = Field::new(mode);
    for (row, (id, heliostat)) in ids.iter().zip(heliostats).enumerate() {
        // Everything is checked by now, in the units of the files; this is the last word.
        field.push(id, heliostat).map_err(|error| {
            layout.row_error(
                row,
                id,
                Problem::Conflict {
                    message: error.to_string(),
                },
            )
        })?;
    }
    Ok(LoadedField {
        site,
        targets,
        field,
        target_of,
        drives,
        schedule,
        blend_rad: radians(blend_deg),
        observation_columns,
        warnings,
        files,
    })
}

/// Hour angle over which calibration sets blend by default \[deg\].
const BLEND_DEG: f64 = 5.0;

fn mode(heliostats: &Section<'_>, site: Option<&Site>) -> Result<TrackingMode, IoError> {
    let word = heliostats.text(&keys::MODE)?.unwrap_or("azimuth-elevation");
    let axis_azimuth_deg = heliostats.number(&keys::AXIS_AZIMUTH)?;
    if axis_azimuth_deg.is_some() && word != "pitch-roll" {
        let message = format!(
            "{} is for mode \"pitch-roll\", but the mode is \"{word}\"",
            heliostats.dotted(&keys::AXIS_AZIMUTH)
        );
        return Err(heliostats.error(&keys::AXIS_AZIMUTH, Problem::Conflict { message }));
    }
    match word {
        "spinning-elevation" => Ok(TrackingMode::SpinningElevation),
        "pitch-roll" => match axis_azimuth_deg {
            Some(azimuth_deg) => Ok(TrackingMode::PitchRoll {
                axis_azimuth_rad: radians(azimuth_deg),
            }),
            None => Err(heliostats.missing(&keys::AXIS_AZIMUTH)),
        },
        "polar" => match site {
            Some(site) => Ok(TrackingMode::Polar {
                latitude_rad: site.latitude_rad,
            }),
            None => {
                let message = "mode \"polar\" needs the latitude from [site]".to_string();
                Err(heliostats.error(&keys::MODE, Problem::Conflict { message }))
            }
        },
        _ => Ok(TrackingMode::AzimuthElevation),
    }
}

fn default_aim(
    heliostats: &Section<'_>,
    targets: &[(&str, Enu)],
) -> Result<Option<usize>, IoError> {
    let Some(name) = heliostats.text(&keys::AIM)? else {
        return Ok(None);
    };
    let known = targets.iter().map(|(known, _)| *known);
    match targets.iter().position(|(known, _)| *known == name) {
        Some(number) => Ok(Some(number)),
        None => Err(heliostats.error(&keys::AIM, Problem::unknown("target", name, known))),
    }
}

/// A table that a key names, relative to the folder of the TOML.
fn read_named(
    heliostats: &Section<'_>,
    key: &'static Key,
    files: &mut Vec<PathBuf>,
) -> Result<Option<Table>, IoError> {
    let Some(name) = heliostats.text(key)? else {
        return Ok(None);
    };
    let folder = heliostats.source().path.parent().unwrap_or(Path::new(""));
    let path = folder.join(name);
    let refuse = |error: std::io::Error| {
        let (key, reason) = (heliostats.dotted(key), said(&error));
        Problem::Reference {
            key,
            path: path.clone(),
            reason,
        }
    };
    // Seen from the TOML: that is where a wrong name is mended.
    let found = std::fs::metadata(&path).and_then(|found| {
        if found.is_dir() {
            Err(std::io::ErrorKind::IsADirectory.into())
        } else {
            Ok(())
        }
    });
    found.map_err(|error| heliostats.error(key, refuse(error)))?;
    let table = Table::read(&path)?;
    files.push(path);
    Ok(Some(table))
}

fn layout_table(heliostats: &Section<'_>, files: &mut Vec<PathBuf>) -> Result<Keyed, IoError> {
    let renames = heliostats.renames(&keys::COLUMNS)?;
    let ignore = heliostats.texts(&keys::IGNORE)?;
    let Some(table) = read_named(heliostats, &keys::TABLE, files)? else {
        return Err(heliostats.missing(&keys::TABLE));
    };
    let names = || table.names().iter().map(String::as_str);
    let foreign = renames.iter().map(|(_, foreign)| foreign);
    for named in foreign.chain(&ignore) {
        if !names().any(|known| known == named.text.trim()) {
            let what = "column of the table";
            let problem = Problem::unknown(what, named.text, names());
            return Err(heliostats.source().error(named.span.clone(), problem));
        }
    }
    for (index, (ours, foreign)) in renames.iter().enumerate() {
        let again = renames[..index]
            .iter()
            .any(|(_, other)| other.text == foreign.text);
        if again || ignore.iter().any(|ignored| ignored.text == foreign.text) {
            let other = if again {
                "for another column too"
            } else {
                "in ignore too"
            };
            let message = format!("{ours} is column `{}`, which stands {other}", foreign.text);
            let problem = Problem::Conflict { message };
            return Err(heliostats.source().error(foreign.span.clone(), problem));
        }
    }
    let renames: Vec<(&str, &str)> = renames
        .iter()
        .map(|(ours, foreign)| (*ours, foreign.text.trim()))
        .collect();
    let ignored = |name: &str| ignore.iter().any(|ignored| ignored.text.trim() == name);
    let naming = Naming {
        renames: &renames,
        synonyms: &[],
        ignore: Some(&ignored),
        advice: "; name it in [heliostats] ignore, or in [heliostats.columns] as one of ours",
    };
    Keyed::new(table, keys::LAYOUT, &naming)
}

/// Greatest distance between the ends of a drive that are taken for stops \[rad\]: no mechanism
/// turns ten times, but counters of 32 bits go much farther.
const WIDEST_RAD: f64 = 20.0 * std::f64::consts::PI;

/// The range of a drive as far as it limits its axis.
///
/// An end of a counter still tells on which side of it the first axis' angle is to be given; the
/// second is not turned round.
fn stops((low, high): (f64, f64), axis: usize) -> (f64, f64) {
    if !(low.is_finite() && high.is_finite() && high - low > WIDEST_RAD) {
        return (low, high);
    }
    let near = |end: f64| axis == 0 && end.abs() <= 0.5 * WIDEST_RAD;
    (
        if near(low) { low } else { f64::NEG_INFINITY },
        if near(high) { high } else { f64::INFINITY },
    )
}

/// What the stated limits and the reach of the drives have in common.
fn within_drives(stated: AxisLimits, drives: &[Option<Drive>; 2]) -> Result<AxisLimits, Problem> {
    let [axis1, axis2] = [0, 1].map(|axis| {
        let range = drives[axis].as_ref().map(Drive::range_rad);
        range.map_or((f64::NEG_INFINITY, f64::INFINITY), |range| {
            stops(range, axis)
        })
    });
    let reach = AxisLimits {
        axis1_min_rad: axis1.0,
        axis1_max_rad: axis1.1,
        axis2_min_rad: axis2.0,
        axis2_max_rad: axis2.1,
    };
    let mut both = stated.intersect(reach);
    if both.axis2_min_rad.is_finite() != both.axis2_max_rad.is_finite() {
        // One end of a drive is no pair of stops; what lies beyond it has no steps all the same.
        (both.axis2_min_rad, both.axis2_max_rad) = (f64::NEG_INFINITY, f64::INFINITY);
    }
    for (axis, least, greatest, stated, drive) in [
        (
            1,
            both.axis1_min_rad,
            both.axis1_max_rad,
            (stated.axis1_min_rad, stated.axis1_max_rad),
            axis1,
        ),
        (
            2,
            both.axis2_min_rad,
            both.axis2_max_rad,
            (stated.axis2_min_rad, stated.axis2_max_rad),
            axis2,
        ),
    ] {
        if least > greatest {
            let message = format!(
                "axis {axis} cannot move: its limits are {} to {} deg, its drive reaches {} to {} deg",
                shown(stated.0),
                shown(stated.1),
                shown(drive.0),
                shown(drive.1)
            );
            return Err(Problem::Conflict { message });
        }
    }
    Ok(both)
}
