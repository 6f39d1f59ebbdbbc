//! The table of observations: what cameras saw of each heliostat.

use std::collections::HashMap;
use std::path::PathBuf;

use helio_calib::Observation;
use helio_calib::aiming::hour_angle_rad;
use helio_core::angle::{degrees, radians, wrap_pi};
use helio_core::{Enu, EnuUnit, TargetPlane};
use helio_spot::SpotStatus;
use rayon::prelude::*;

use crate::error::{IoError, Place, Problem, quoted, short};
use crate::field::LoadedField;
use crate::joining::{Frames, NEAR_NS};
use crate::keys;
use crate::small::{both_or_none, driven_rad, known_heliostat, pair};
use crate::spots::SpotTable;
use crate::table::{Keyed, Naming, Table, TableSource};
use crate::times::format_time;

/// Observations of a field, by heliostat, and where in the file each stands.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub struct Observations {
    /// The file.
    pub path: PathBuf,
    /// How many records it has.
    pub records: usize,
    /// Heliostats with observations, in the order of the field.
    pub heliostats: Vec<HeliostatObservations>,
    /// What [`Observation::target`] numbers: the targets of the field that have a plane, in the order
    /// of their names.
    pub targets: Vec<(String, TargetPlane)>,
    /// Records that cannot be used, in the order of the file.
    pub left_aside: Vec<LeftAside>,
    /// Things worth saying that stop nothing.
    pub warnings: Vec<String>,
    /// Lines of a text file.
    lines: Option<Vec<usize>>,
    /// Names of the records, where the file gives them.
    names: Vec<Option<Box<str>>>,
}

/// The observations of one heliostat.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub struct HeliostatObservations {
    /// Its row in the field.
    pub row: usize,
    /// In the order of the file.
    pub observations: Vec<Observation>,
    /// Record of each in the file, counted from 0.
    pub records: Vec<usize>,
}

/// A record that is no use for a calibration although nothing is wrong with the file.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub struct LeftAside {
    /// Which record of the file, counted from 0.
    pub record: usize,
    /// Row of its heliostat in the field.
    pub heliostat: usize,
    /// Why.
    pub reason: LeftAsideReason,
}

/// Why a record was left aside.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum LeftAsideReason {
    /// It is an earlier record again, to the last digit.
    Duplicate {
        /// The earlier one.
        of: usize,
    },
    /// At its time the sun was below the horizon.
    SunBelowHorizon,
    /// It has no spot: the camera found none.
    NoSpot,
    /// Its frame is not among the spots given apart.
    NoFrame,
    /// Its frame has no spot that can be trusted: the status of its row among the spots given apart, none for a frame
    /// that could not be read.
    Spot(Option<SpotStatus>),
    /// It has a time that is still to come.
    InFuture,
}

impl LeftAsideReason {
    /// The word for columns.
    #[must_use]
    pub const fn as_str(self) -> &'static str {
        match self {
            Self::Duplicate { .. } => "duplicate",
            Self::SunBelowHorizon => "sun_below_horizon",
            Self::NoSpot => "no_spot",
            Self::NoFrame => "no_frame",
            Self::Spot(None) => "spot_unreadable",
            Self::Spot(Some(SpotStatus::Empty)) => "spot_empty",
            Self::Spot(Some(SpotStatus::Cut)) => "spot_cut",
            Self::Spot(Some(SpotStatus::Ambiguous)) => "spot_ambiguous",
            Self::Spot(Some(SpotStatus::Unclear)) => "spot_unclear",
            Self::Spot(Some(SpotStatus::NoTarget)) => "spot_no_target",
            Self::Spot(Some(SpotStatus::Ok | SpotStatus::Saturated)) => "spot",
            Self::InFuture => "in_future",
        }
    }
}

impl Observations {
    /// Where a record stands, in words: `line 12`, or `row 11` of a Parquet file.
    ///
    /// # Errors
    /// [`Problem::OutOfRange`] if the file has no such record.
    pub fn position(&self, record: usize) -> Result<String, IoError> {
        let line = self.line(record)?;
        let kind = if self.lines.is_some() { "line" } else { "row" };
        Ok(format!("{kind} {line}"))
    }

    /// Number of the line on which a record of a text file stands, or of its row in a Parquet file, from 1.
    ///
    /// # Errors
    /// [`Problem::OutOfRange`] if the file has no such record.
    pub fn line(&self, record: usize) -> Result<usize, IoError> {
        let line = match &self.lines {
            Some(lines) => lines.get(record).copied(),
            None => (record < self.records).then(|| record + 1),
        };
        line.ok_or_else(|| {
            let problem = Problem::OutOfRange {
                what: "record".to_string(),
                min: 0.0,
                max: self.records as f64 - 1.0,
                unit: "",
                value: record as f64,
            };
            IoError::new(Place::file(&self.path), problem)
        })
    }

    /// The name that a record has in the column `record_id`.
    #[must_use]
    pub fn record_id(&self, record: usize) -> Option<&str> {
        self.names.get(record)?.as_deref()
    }

    /// Observations that can be used.
    #[must_use]
    pub fn len(&self) -> usize {
        self.heliostats.iter().map(|h| h.observations.len()).sum()
    }

    /// True if none can be used.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.heliostats.is_empty()
    }

    /// Leaves aside the records made after a time \[ns since 1970, UTC\], and says so in a warning: a clock that was
    /// set wrong, or a year mistyped. A heliostat that had no others is then not one with observations. How many
    /// were left aside.
    ///
    /// # Errors
    /// As [`position`](Self::position), if one of them has come to name a record that the file does not have.
    pub fn leave_aside_after(&mut self, latest_unix_ns: i64) -> Result<usize, IoError> {
        let known = self.left_aside.len();
        let too_late = |o: &Observation| o.unix_ns.is_some_and(|ns| ns > latest_unix_ns);
        for of in &mut self.heliostats {
            if !of.observations.iter().any(too_late) {
                continue;
            }
            let pairs = of.observations.drain(..).zip(of.records.drain(..));
            let (late, kept): (Vec<_>, Vec<_>) = pairs.partition(|(o, _)| too_late(o));
            (of.observations, of.records) = kept.into_iter().unzip();
            self.left_aside
                .extend(late.into_iter().map(|(_, record)| LeftAside {
                    record,
                    heliostat: of.row,
                    reason: LeftAsideReason::InFuture,
                }));
        }
        self.heliostats.retain(|of| !of.observations.is_empty());
        let first = self.left_aside[known..].iter().map(|aside| aside.record);
        if let Some(first) = first.min() {
            self.warnings.push(format!(
                "{}: records of a time still to come (after {}), left aside: {} (first: {}); are their clock and this \
                 one right?",
                self.path.display(),
                format_time(latest_unix_ns),
                self.left_aside.len() - known,
                self.position(first)?
            ));
        }
        let count = self.left_aside.len() - known;
        self.left_aside.sort_by_key(|aside| aside.record);
        Ok(count)
    }
}

/// Other names of the columns.
const SYNONYMS: &[(&str, &str)] = &[
    ("id", "heliostat_id"),
    ("heliostat", "heliostat_id"),
    ("azimuth_deg", "axis1_deg"),
    ("elevation_deg", "axis2_deg"),
];

/// Reads a table of observations, CSV or Parquet, of heliostats of a field.
///
/// | columns | |
/// |---|---|
/// | `heliostat_id` (or `id`) | a heliostat of the field |
/// | `time` | with its offset from UTC; needs `[site]` for the sun |
/// | `sun_azimuth_deg, sun_elevation_deg` | clockwise from north, apparent; they win over a time |
/// | `axis1_deg, axis2_deg` (or `azimuth_deg, elevation_deg`) | encoder angles |
/// | `axis1_steps, axis2_steps` | motor steps of heliostats with drives, where no angles are given |
/// | `target` | by name, a plane; without it the one that the heliostat aims at |
/// | `u_m, v_m` | spot, right and below the target's centre as a camera facing it sees it |
/// | `spot_east_m, spot_north_m, spot_up_m` | the spot as a point instead; moved square onto the plane |
/// | `sigma_m` | optional: one standard deviation of either component; for all observations of a heliostat or none |
/// | `record_id` | optional: what the record is called elsewhere |
/// | `file` | the frame, instead of a spot: see [`load_observations_with_spots`] |
///
/// Foreign names are translated by `[observations.columns]` of `field.toml`, and columns named in
/// `[observations] ignore` are left aside.
///
/// Records without a spot, under a sun below the horizon, and exact repetitions of an earlier one are
/// left aside and listed; everything else that is wrong refuses the file. Those of a time still to come are left to
/// [`Observations::leave_aside_after`], as nothing here reads a clock.
///
/// # Errors
/// [`IoError`] with file, line (row) and column for: an unknown or missing column, a row of another
/// length, a heliostat or target not in the field, a target that is a mere point, a number that is
/// not finite, no number at all or out of range, a time without an offset, a time without `[site]`,
/// half a pair of angles, steps without or beyond a drive, a spot far off its target's plane or stated twice
/// differently, a `sigma_m` that only some observations of a heliostat have, and sun azimuths counted from south.
///
/// ```
/// let folder = tempfile::tempdir()?;
/// let file = |name: &str, text: &str| std::fs::write(folder.path().join(name), text);
/// file("layout.csv", "id,east_m,north_m,up_m\nA1,10,80,4\n")?;
/// file("field.toml", r#"
///     [targets.white]
///     centre_enu_m = [0, 0, 40]
///     normal_enu = [0, 1, 0]
///     width_m = 8
///     height_m = 6
///     [heliostats]
///     table = "layout.csv"
///     aim = "white"
/// "#)?;
/// file("seen.csv", "heliostat_id,sun_azimuth_deg,sun_elevation_deg,axis1_deg,axis2_deg,u_m,v_m\n\
///                   A1,150,40,168,31,0.12,-0.3\n")?;
/// let field = helio_io::load_field(&folder.path().join("field.toml"))?;
/// let seen = helio_io::load_observations(&folder.path().join("seen.csv"), &field)?;
/// assert_eq!(seen.heliostats[0].observations[0].v_m, -0.3);
/// assert_eq!(seen.position(seen.heliostats[0].records[0])?, "line 2");
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn load_observations<'a>(
    table: impl Into<TableSource<'a>>,
    loaded: &LoadedField,
) -> Result<Observations, IoError> {
    load_observations_with_spots(table, None, loaded)
}

/// Reads a table of observations whose spots are given apart, as `spot` writes them.
///
/// The table then has no spots of its own but a column `file`, which names the frame of each record as the spots do: of the
/// folders before it as many must agree as both tables name. Or else a `time` within half a second of the frame's, of which
/// the nearest is taken. Where frames are named and both tables
/// have times, these must agree as well. The standard deviation comes from the
/// frame too. Frames with the status `ok` or `saturated` count; `cut`, `ambiguous`, `unclear`, `empty`,
/// `no_target` and `unreadable` are left aside, as are records whose frame is not there.
///
/// # Errors
/// As [`load_observations`]; and for a table with spots of its own, one without `file` and `time`, a file name that
/// several frames may be meant by, a time that several frames are equally near to, a frame whose time is not that of the
/// record which names it, a frame that belongs to records of two heliostats or of two poses, and spots none of which belongs
/// to a record.
pub fn load_observations_with_spots<'a>(
    table: impl Into<TableSource<'a>>,
    spots: Option<&SpotTable>,
    loaded: &LoadedField,
) -> Result<Observations, IoError> {
    let table = Table::read(table)?;
    let names = &loaded.observation_columns;
    let renames: Vec<(&str, &str)> = names
        .renames
        .iter()
        .map(|(ours, foreign)| (ours.as_str(), foreign.as_str()))
        .collect();
    let foreign = renames.iter().map(|(_, foreign)| *foreign);
    for named in foreign.chain(names.ignore.iter().map(String::as_str)) {
        let there = table.names().iter().map(String::as_str);
        if !there.clone().any(|known| known == named) {
            let problem = Problem::unknown(
                "column, named in [observations] of field.toml,",
                named,
                there,
            );
            return Err(IoError::new(table.header_place(), problem));
        }
    }
    let ignored = |name: &str| names.ignore.iter().any(|ignored| ignored == name);
    let naming = Naming {
        renames: &renames,
        synonyms: SYNONYMS,
        ignore: Some(&ignored),
        advice: "; name it in [observations] ignore of field.toml, or in [observations.columns] as one of ours",
    };
    let table = Keyed::new(table, keys::OBSERVATION_COLUMNS, &naming)?;
    let reader = Reader::new(&table, spots, loaded)?;
    let rows = table.table().rows();
    let read: Vec<Result<Record, IoError>> = (0..rows)
        .into_par_iter()
        .with_min_len(ROWS_PER_TASK)
        .map(|row| reader.read(row))
        .collect();
    // The first of several wrong rows is the one to report.
    let mut records = read.into_iter().collect::<Result<Vec<Record>, _>>()?;
    reader.check_frames(&records)?;
    reader.place_suns(&mut records)?;
    reader.gather(records)
}

/// Rounded coordinates leave spots some millimetres off their plane, and off other words for them \[m\].
const ROUNDING_M: f64 = 0.01;
/// Rows from which reading is worth a second thread.
const ROWS_PER_TASK: usize = 1 << 12;

/// A row as it was read.
#[derive(Debug, Clone, Copy)]
struct Record {
    heliostat: usize,
    unix_ns: Option<i64>,
    /// Azimuth and elevation \[rad\], where the table gives them.
    given: Option<(f64, f64)>,
    sun: EnuUnit,
    axis1_rad: f64,
    axis2_rad: f64,
    /// Among the planes.
    target: usize,
    /// `None` if there is none.
    spot_m: Option<[f64; 2]>,
    /// How far a spot given as a point lies before its plane \[m\].
    off_plane_m: f64,
    sigma_m: Option<f64>,
    /// Which row of the spots given apart.
    frame: Option<usize>,
    /// Why it has no spot.
    without: LeftAsideReason,
}

/// Everything that reading a row needs.
struct Reader<'a> {
    table: &'a Keyed,
    loaded: &'a LoadedField,
    /// The planes, and the greater half of their extents \[m\].
    planes: Vec<(&'a str, TargetPlane, f64)>,
    /// Of each target of the field, in the order of the names: its number among the planes.
    plane_of: Vec<Option<usize>>,
    points: bool,
    frames: Option<Frames<'a>>,
}

impl<'a> Reader<'a> {
    fn new(
        table: &'a Keyed,
        spots: Option<&'a SpotTable>,
        loaded: &'a LoadedField,
    ) -> Result<Self, IoError> {
        let angles = both_or_none(table, &keys::AXIS1, &keys::AXIS2)?;
        let steps = both_or_none(table, &keys::AXIS1_STEPS, &keys::AXIS2_STEPS)?;
        if !angles && !steps {
            return Err(table.missing_column(&keys::AXIS1));
        }
        let sun = both_or_none(table, &keys::SUN_AZIMUTH, &keys::SUN_ELEVATION)?;
        if !sun && !table.has(&keys::TIME) {
            let problem = Problem::Missing {
                what: "column `time`".into(),
                wanted: "or sun_azimuth_deg and sun_elevation_deg instead".into(),
            };
            return Err(IoError::new(table.table().header_place(), problem));
        }
        let spot = both_or_none(table, &keys::SPOT_U, &keys::SPOT_V)?;
        let point = [&keys::SPOT_EAST, &keys::SPOT_NORTH, &keys::SPOT_UP];
        let points = point.iter().any(|key| table.has(key));
        if points && let Some(key) = point.iter().find(|key| !table.has(key)) {
            return Err(table.missing_column(key));
        }
        let frames = match spots {
            Some(spots) => {
                let own = [&keys::SPOT_U, &keys::SPOT_EAST, &keys::SIGMA];
                if let Some(key) = own.into_iter().find(|key| table.has(key)) {
                    let message = format!(
                        "column {}, though the spots are given apart in {}; wanted one of the two",
                        quoted(key.name),
                        spots.path.display()
                    );
                    let place = table.table().header_place();
                    return Err(IoError::new(place, Problem::Conflict { message }));
                }
                if !table.has(&keys::FRAME) && !table.has(&keys::TIME) {
                    return Err(table.missing_column(&keys::FRAME));
                }
                Some(Frames::new(spots, table.has(&keys::FRAME)))
            }
            None if !spot && !points => return Err(table.missing_column(&keys::SPOT_U)),
            None => None,
        };
        let mut planes = Vec::new();
        let mut plane_of = Vec::with_capacity(loaded.targets.len());
        for (name, target) in &loaded.targets {
            plane_of.push(target.area.map(|area| {
                let half_m = 0.5 * area.width_m.max(area.height_m);
                planes.push((name.as_str(), area.plane, half_m));
                planes.len() - 1
            }));
        }
        Ok(Self {
            table,
            loaded,
            planes,
            plane_of,
            points,
            frames,
        })
    }

    fn read(&self, row: usize) -> Result<Record, IoError> {
        let table = self.table;
        let (id, heliostat) = known_heliostat(table, row, &keys::HELIOSTAT_ID, &self.loaded.field)?;
        let unix_ns = table.time(row, &keys::TIME, &id)?;
        let given = pair(table, row, &id, &keys::SUN_AZIMUTH, &keys::SUN_ELEVATION)?
            .map(|(azimuth, elevation)| (radians(azimuth), radians(elevation)));
        if given.is_none() {
            let missing = |what: &str, wanted: &str| Problem::Missing {
                what: what.into(),
                wanted: wanted.into(),
            };
            if unix_ns.is_none() {
                let problem = missing("the sun", "neither a time nor the sun's angles are there");
                return Err(table.row_error(row, &id, problem));
            }
            if self.loaded.site.is_none() {
                let problem = missing(
                    "[site] of field.toml",
                    "the sun at a time needs it; add it, or give sun_azimuth_deg and sun_elevation_deg",
                );
                return Err(table.error(row, &keys::TIME, Some(&id), problem));
            }
        }
        let (axis1_rad, axis2_rad) = self.axes(row, &id, heliostat)?;
        let target = self.target(row, &id, heliostat)?;
        let mut frame = None;
        let mut without = LeftAsideReason::NoSpot;
        let mut sigma_m = table.number(row, &keys::SIGMA, Some(&id))?;
        let spot = match &self.frames {
            None => self.spot(row, &id, target)?,
            Some(frames) => {
                frame = frames.of(table, row, &id, unix_ns)?;
                let seen = frame.map(|frame| &frames.spots.rows[frame]);
                let trusted = [SpotStatus::Ok, SpotStatus::Saturated].map(Some);
                let spot = seen.filter(|seen| trusted.contains(&seen.status));
                without = seen.map_or(LeftAsideReason::NoFrame, |seen| {
                    LeftAsideReason::Spot(seen.status)
                });
                sigma_m = spot.and_then(|seen| seen.sigma_m);
                spot.and_then(|seen| seen.at_m).map(|at_m| (at_m, 0.0))
            }
        };
        Ok(Record {
            heliostat,
            unix_ns,
            given,
            sun: given.map_or(EnuUnit::UP, |(azimuth, elevation)| {
                EnuUnit::from_azimuth_elevation(azimuth, elevation)
            }),
            axis1_rad,
            axis2_rad,
            target,
            spot_m: spot.map(|(spot_m, _)| spot_m),
            off_plane_m: spot.map_or(0.0, |(_, off_m)| off_m),
            sigma_m,
            frame,
            without,
        })
    }

    fn axes(&self, row: usize, id: &str, heliostat: usize) -> Result<(f64, f64), IoError> {
        let table = self.table;
        let angles = pair(table, row, id, &keys::AXIS1, &keys::AXIS2).map_err(|error| {
            let Problem::OutOfRange { value, .. } = error.problem() else {
                return error;
            };
            let message = format!(
                "{} is no angle in degrees; it looks like motor steps, which go in the columns axis1_steps \
                 and axis2_steps",
                short(*value)
            );
            IoError::new(error.place().clone(), Problem::Conflict { message })
        })?;
        if let Some((axis1, axis2)) = angles {
            return Ok((radians(axis1), radians(axis2)));
        }
        match pair(table, row, id, &keys::AXIS1_STEPS, &keys::AXIS2_STEPS)? {
            Some(steps) => driven_rad(table, row, id, &self.loaded.drives[heliostat], steps),
            None => {
                let problem = Problem::Missing {
                    what: "the pair of axis angles".into(),
                    wanted: "its cells are empty".into(),
                };
                Err(table.row_error(row, id, problem))
            }
        }
    }

    /// Number of the plane on which the spot was seen.
    fn target(&self, row: usize, id: &str, heliostat: usize) -> Result<usize, IoError> {
        let refuse = |problem| self.table.error(row, &keys::SPOT_TARGET, Some(id), problem);
        let number = match self.table.text(row, &keys::SPOT_TARGET, id)? {
            Some(name) => {
                let known = self.loaded.targets.keys().map(String::as_str);
                match known.clone().position(|known| known == name) {
                    Some(number) => number,
                    None => return Err(refuse(Problem::unknown("target", &name, known))),
                }
            }
            None => self.loaded.target_of[heliostat].ok_or_else(|| {
                refuse(Problem::Missing {
                    what: "the target".into(),
                    wanted: "the heliostat aims at a point of its own, so the record must name it"
                        .into(),
                })
            })?,
        };
        self.plane_of[number].ok_or_else(|| {
            let name = self.loaded.targets.keys().nth(number);
            let name = quoted(name.map_or("", String::as_str));
            refuse(Problem::Conflict {
                message: format!(
                    "target {name} is a mere point, and a spot is seen on a plane; give [targets.NAME] \
                     of field.toml its normal_enu, width_m and height_m, or name another target here"
                ),
            })
        })
    }

    /// The spot on its plane \[m\], and how far it lay before it.
    #[allow(clippy::type_complexity)]
    fn spot(
        &self,
        row: usize,
        id: &str,
        target: usize,
    ) -> Result<Option<([f64; 2], f64)>, IoError> {
        let table = self.table;
        let stated = pair(table, row, id, &keys::SPOT_U, &keys::SPOT_V)?;
        let stated_m = stated.map(|(u_m, v_m)| [u_m, v_m]);
        if !self.points {
            return Ok(stated_m.map(|spot_m| (spot_m, 0.0)));
        }
        let point_keys = [&keys::SPOT_EAST, &keys::SPOT_NORTH, &keys::SPOT_UP];
        let mut point = [None; 3];
        for (slot, key) in point.iter_mut().zip(point_keys) {
            *slot = table.number(row, key, Some(id))?;
        }
        let point = match point {
            [None, None, None] => return Ok(stated_m.map(|spot_m| (spot_m, 0.0))),
            [Some(east), Some(north), Some(up)] => Enu::new(east, north, up),
            _ => {
                let lacking: Vec<&str> = point_keys
                    .iter()
                    .zip(point)
                    .filter(|(_, value)| value.is_none())
                    .map(|(key, _)| key.name)
                    .collect();
                let message = format!("its spot lacks {}", lacking.join(" and "));
                return Err(table.row_error(row, id, Problem::Conflict { message }));
            }
        };
        let (name, plane, half_m) = &self.planes[target];
        let (spot_m, off_m) = project(plane, point);
        if off_m.abs() > *half_m {
            let other = self.planes.iter().find(|(_, plane, half_m)| {
                let ([u_m, v_m], off_m) = project(plane, point);
                off_m.abs() <= 0.1 * half_m && u_m.abs() <= *half_m && v_m.abs() <= *half_m
            });
            let hint = other.map_or(String::new(), |(name, ..)| {
                format!("; it lies on {}", quoted(name))
            });
            let message = format!(
                "the spot lies {} m {} the plane of target {}{hint}",
                short((off_m.abs() * 1e3).round() / 1e3),
                side(off_m),
                quoted(name)
            );
            return Err(table.row_error(row, id, Problem::Conflict { message }));
        }
        let Some([u_m, v_m]) = stated_m else {
            return Ok(Some((spot_m, off_m)));
        };
        let apart_m = (u_m - spot_m[0]).hypot(v_m - spot_m[1]);
        if apart_m > ROUNDING_M {
            let message = format!(
                "two spots {apart_m:.3} m apart: {} and {} say {}, {}, the point of {}, {} and {} lies \
                 at {:.3}, {:.3} on target {}; wanted one of them, or both within {ROUNDING_M} m",
                keys::SPOT_U.name,
                keys::SPOT_V.name,
                short(u_m),
                short(v_m),
                keys::SPOT_EAST.name,
                keys::SPOT_NORTH.name,
                keys::SPOT_UP.name,
                spot_m[0],
                spot_m[1],
                quoted(name)
            );
            return Err(table.row_error(row, id, Problem::Conflict { message }));
        }
        Ok(Some(([u_m, v_m], off_m)))
    }

    /// Refuses spots given apart that cannot be meant: none that belongs to a record, and one that belongs to two
    /// heliostats, or to two poses.
    fn check_frames(&self, records: &[Record]) -> Result<(), IoError> {
        let Some(frames) = &self.frames else {
            return Ok(());
        };
        let table = self.table.table();
        let mut first: HashMap<usize, usize> = HashMap::new();
        for (row, record) in records.iter().enumerate() {
            let Some(frame) = record.frame else { continue };
            let before = *first.entry(frame).or_insert(row);
            if records[before].heliostat != record.heliostat {
                let message = format!(
                    "its frame {} is that of heliostat {} too ({})",
                    quoted(&frames.spots.rows[frame].file),
                    quoted(&self.loaded.field.ids()[records[before].heliostat]),
                    table.position(before)
                );
                let id = &self.loaded.field.ids()[record.heliostat];
                return Err(self.table.row_error(row, id, Problem::Conflict { message }));
            }
            let pose = |row: usize| {
                let record = &records[row];
                (
                    record.unix_ns,
                    record.axis1_rad.to_bits(),
                    record.axis2_rad.to_bits(),
                )
            };
            if pose(before) != pose(row) {
                let (key, how) = if frames.by_name() {
                    (&keys::FRAME, "a frame shows one".to_owned())
                } else {
                    let how = format!(
                        "records belong to the frame nearest in time, and a frame shows one pose: wanted one record a \
                         frame, or the frames' names in a column {}",
                        quoted(keys::FRAME.name)
                    );
                    (&keys::TIME, how)
                };
                let message = format!(
                    "its frame {} is that of another pose or time too ({}); {how}",
                    quoted(&frames.spots.rows[frame].file),
                    table.position(before)
                );
                let id = &self.loaded.field.ids()[record.heliostat];
                let problem = Problem::Conflict { message };
                return Err(self.table.error(row, key, Some(id), problem));
            }
        }
        if first.is_empty() {
            let message = format!(
                "none of the {} records belongs to a frame of {}, whose first is {}; wanted the same names in the \
                 column `file`, or times within {} s",
                records.len(),
                frames.spots.path.display(),
                quoted(frames.spots.rows.first().map_or("", |row| &row.file)),
                1e-9 * NEAR_NS as f64
            );
            return Err(IoError::new(
                Place::file(table.path()),
                Problem::Conflict { message },
            ));
        }
        Ok(())
    }

    /// Refuses a heliostat some of whose observations state how sure they are and some do not: what the
    /// others count is nowhere said.
    fn same_sigmas(&self, records: &[Record], of: &[usize]) -> Result<(), IoError> {
        let mut stated = of.iter().filter(|&&row| records[row].sigma_m.is_some());
        let lacking = of.iter().find(|&&row| records[row].sigma_m.is_none());
        let (Some(&row), Some(&other)) = (lacking, stated.next()) else {
            return Ok(());
        };
        let id = &self.loaded.field.ids()[records[row].heliostat];
        let message = format!(
            "empty, though {} of the {} observations of this heliostat state one ({} the first); wanted \
             for all of them or for none",
            stated.count() + 1,
            of.len(),
            self.table.table().position(other)
        );
        Err(self
            .table
            .error(row, &keys::SIGMA, Some(id), Problem::Conflict { message }))
    }

    /// Where the sun stood at the times given, and whether given suns agree with theirs.
    fn place_suns(&self, records: &mut [Record]) -> Result<(), IoError> {
        let Some(site) = &self.loaded.site else {
            return Ok(());
        };
        let timed: Vec<usize> = (0..records.len())
            .filter(|&row| records[row].unix_ns.is_some())
            .collect();
        let times: Vec<i64> = timed
            .iter()
            .filter_map(|&row| records[row].unix_ns)
            .collect();
        let suns = site.sun_site().and_then(|place| {
            let ut1_utc_s = site.ut1_utc_s.unwrap_or(0.0);
            helio_core::sun::positions(&place, &times, site.delta_t_s, ut1_utc_s)
        });
        let suns = suns.map_err(|error| {
            let message = format!("the sun of its times: {error}");
            IoError::new(
                Place::file(self.table.table().path()),
                Problem::Conflict { message },
            )
        })?;
        let mut compared = Compared::default();
        for ((&row, &azimuth), &elevation) in timed
            .iter()
            .zip(&suns.azimuth_rad)
            .zip(&suns.apparent_elevation_rad)
        {
            let record = &mut records[row];
            match record.given {
                Some(given) => compared.add(given, (azimuth, elevation)),
                None => record.sun = EnuUnit::from_azimuth_elevation(azimuth, elevation),
            }
        }
        compared.check(self.table)
    }

    /// By heliostat.
    fn gather(&self, records: Vec<Record>) -> Result<Observations, IoError> {
        let table = self.table.table();
        let site = self.loaded.site.as_ref();
        let mut left_aside = Vec::new();
        let mut of_heliostat: Vec<Vec<usize>> = vec![Vec::new(); self.loaded.field.len()];
        let mut seen: HashMap<[u64; 9], usize> = HashMap::with_capacity(records.len());
        let mut farthest: Option<usize> = None;
        for (index, record) in records.iter().enumerate() {
            let mut leave = |reason| {
                left_aside.push(LeftAside {
                    record: index,
                    heliostat: record.heliostat,
                    reason,
                });
            };
            let Some(spot_m) = record.spot_m else {
                leave(record.without);
                continue;
            };
            if record.sun.as_enu().up < 0.0 {
                leave(LeftAsideReason::SunBelowHorizon);
                continue;
            }
            let sun = record.sun.as_enu();
            let same = [
                record.heliostat as u64,
                record.target as u64,
                sun.east.to_bits(),
                sun.north.to_bits(),
                record.unix_ns.unwrap_or(i64::MIN) as u64,
                record.axis1_rad.to_bits(),
                record.axis2_rad.to_bits(),
                spot_m[0].to_bits(),
                spot_m[1].to_bits(),
            ];
            if let Some(&of) = seen.get(&same) {
                leave(LeftAsideReason::Duplicate { of });
                continue;
            }
            seen.insert(same, index);
            if record.off_plane_m.abs() > farthest.map_or(0.0, |row| records[row].off_plane_m.abs())
            {
                farthest = Some(index);
            }
            of_heliostat[record.heliostat].push(index);
        }
        let mut observations = Observations {
            path: table.path().to_path_buf(),
            records: records.len(),
            heliostats: Vec::new(),
            targets: self
                .planes
                .iter()
                .map(|(name, plane, _)| ((*name).to_string(), *plane))
                .collect(),
            left_aside,
            warnings: Vec::new(),
            lines: table.lines().map(<[usize]>::to_vec),
            names: self.names()?,
        };
        for (row, records_of) in of_heliostat.into_iter().enumerate() {
            if records_of.is_empty() {
                continue;
            }
            self.same_sigmas(&records, &records_of)?;
            let of = |&index: &usize| {
                let record = &records[index];
                let [u_m, v_m] = record.spot_m.unwrap_or_default();
                Observation {
                    target: record.target,
                    sigma_m: record.sigma_m,
                    unix_ns: record.unix_ns,
                    hour_angle_rad: site.map(|site| hour_angle_rad(record.sun, site.latitude_rad)),
                    ..Observation::new(
                        record.sun,
                        record.axis1_rad,
                        record.axis2_rad,
                        self.planes[record.target].1,
                        u_m,
                        v_m,
                    )
                }
            };
            observations.heliostats.push(HeliostatObservations {
                row,
                observations: records_of.iter().map(of).collect(),
                records: records_of,
            });
        }
        self.warn(&records, farthest, &mut observations);
        Ok(observations)
    }

    fn names(&self) -> Result<Vec<Option<Box<str>>>, IoError> {
        if !self.table.has(&keys::RECORD_ID) {
            return Ok(Vec::new());
        }
        (0..self.table.table().rows())
            .map(|row| {
                let name = self.table.text(row, &keys::RECORD_ID, "")?;
                Ok(name.map(|name| name.into_owned().into_boxed_str()))
            })
            .collect()
    }

    fn warn(&self, records: &[Record], farthest: Option<usize>, out: &mut Observations) {
        let path = out.path.display().to_string();
        let position = |record| self.table.table().position(record);
        if let Some(row) = farthest
            && records[row].off_plane_m.abs() > ROUNDING_M
        {
            let (_, _, half_m) = self.planes[records[row].target];
            let count = records
                .iter()
                .filter(|record| record.off_plane_m.abs() > ROUNDING_M)
                .count();
            out.warnings.push(format!(
                "{path}: {} of {} spots lie more than {ROUNDING_M} m off the plane of their target, the \
                 farthest ({}) {:.3} m {}; they were moved square onto it{}",
                count,
                records.len(),
                position(row),
                records[row].off_plane_m.abs(),
                side(records[row].off_plane_m),
                if records[row].off_plane_m.abs() > 0.1 * half_m {
                    ": is its target the right one?"
                } else {
                    ""
                }
            ));
        }
        let mut of_both = records.iter().enumerate().filter(|(_, record)| {
            let given = record.given.is_some();
            given && record.unix_ns.is_some()
        });
        if let Some((first, _)) = of_both.next() {
            out.warnings.push(format!(
                "{path}: records that state both a time and the sun's angles: {} (first: {}); the angles say where the \
                 sun is",
                1 + of_both.count(),
                position(first)
            ));
        }
        let apart = |reason: &LeftAsideReason| {
            matches!(reason, LeftAsideReason::NoFrame | LeftAsideReason::Spot(_))
        };
        let of = |reason: fn(&LeftAsideReason) -> bool| {
            let mut which = out.left_aside.iter().filter(|aside| reason(&aside.reason));
            let first = which.next()?;
            Some((which.count() + 1, position(first.record), first))
        };
        let mut said = Vec::new();
        if let Some((count, first, _)) = of(|reason| matches!(reason, LeftAsideReason::NoSpot)) {
            said.push(format!(
                "{path}: records without a spot, left aside: {count} (first: {first})"
            ));
        }
        if let Some((count, first, aside)) = of(apart) {
            said.push(format!(
                "{path}: records whose frame has no spot to be trusted, left aside: {count} (first: {first}, {})",
                aside.reason.as_str()
            ));
        }
        if let Some((count, first, _)) =
            of(|reason| matches!(reason, LeftAsideReason::SunBelowHorizon))
        {
            said.push(format!(
                "{path}: records under a sun below the horizon, left aside: {count} (first: \
                 {first}); is the offset of the times right?"
            ));
        }
        if let Some((count, first, aside)) =
            of(|reason| matches!(reason, LeftAsideReason::Duplicate { .. }))
        {
            let again = match aside.reason {
                LeftAsideReason::Duplicate { of } => position(of),
                _ => String::new(),
            };
            said.push(format!(
                "{path}: records that repeat an earlier one, left aside: {count} (first: {first}, \
                 which is {again} again)"
            ));
        }
        out.warnings.extend(said);
    }
}

/// Components on a plane \[m\], and how far before it.
fn project(plane: &TargetPlane, point: Enu) -> ([f64; 2], f64) {
    let from_centre = point - plane.centre;
    let along = |axis: EnuUnit| axis.as_enu().dot(from_centre);
    ([along(plane.right), along(plane.down)], along(plane.normal))
}

fn side(off_m: f64) -> &'static str {
    if off_m < 0.0 { "behind" } else { "before" }
}

/// Suns that a table gives, beside those of its times.
#[derive(Default)]
struct Compared {
    apart_rad: Vec<f64>,
    /// The same if azimuths were counted from south toward east.
    from_south_rad: Vec<f64>,
    /// The same from south toward west.
    from_south_west_rad: Vec<f64>,
}

impl Compared {
    fn add(&mut self, (azimuth, elevation): (f64, f64), of_time: (f64, f64)) {
        let apart = |azimuth: f64| {
            let across = wrap_pi(azimuth - of_time.0) * elevation.cos();
            across.hypot(elevation - of_time.1)
        };
        self.apart_rad.push(apart(azimuth));
        let half_turn = std::f64::consts::PI;
        self.from_south_rad.push(apart(half_turn - azimuth));
        self.from_south_west_rad.push(apart(half_turn + azimuth));
    }

    /// Refuses suns that are plainly counted from elsewhere.
    fn check(mut self, table: &Keyed) -> Result<(), IoError> {
        if self.apart_rad.len() < 3 {
            return Ok(());
        }
        let near_rad = radians(1.0);
        let apart_rad = median(&mut self.apart_rad);
        if apart_rad <= 5.0 * near_rad {
            return Ok(());
        }
        let mend = if median(&mut self.from_south_rad) < near_rad {
            Some("count from south toward east: 180 - it counts from north")
        } else if median(&mut self.from_south_west_rad) < near_rad {
            Some("count from south toward west: 180 + it counts from north")
        } else {
            None
        };
        let name = keys::SUN_AZIMUTH.name;
        let apart_deg = degrees(apart_rad);
        let message = match mend {
            Some(mend) => format!(
                "the sun's azimuths seem to {mend}, as {name} must (with what is given they stand \
                 {apart_deg:.0} degrees beside the sun of their times)"
            ),
            None => format!(
                "the suns given stand {apart_deg:.0} degrees from the sun of their times, in the middle of {} \
                 records; wanted the apparent sun in degrees, azimuth clockwise from north, and times with \
                 their true offset from UTC (leave out either of the two if it is not to be trusted)",
                self.apart_rad.len()
            ),
        };
        let mut place = table.table().header_place();
        place.field = Some(name.to_string());
        Err(IoError::new(place, Problem::Conflict { message }))
    }
}

fn median(values: &mut [f64]) -> f64 {
    let middle = values.len() / 2;
    *values.select_nth_unstable_by(middle, f64::total_cmp).1
}
