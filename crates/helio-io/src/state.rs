//! The state of a field that is followed, as it is kept from one update to the next.
//!
//! One Parquet file: a row for each heliostat and each account of what happened to it, and what is common to
//! the field as JSON in the file's metadata. See `docs/files.md`.

use std::collections::HashMap;
use std::f64::consts::PI;
use std::fs::File;
use std::io::Read;
use std::ops::Range;
use std::path::Path;
use std::sync::Arc;
use std::thread::Builder;

use arrow::array::{
    Array, ArrayRef, Float64Array, Int64Array, ListArray, RecordBatch, StringArray,
};
use arrow::buffer::OffsetBuffer;
use arrow::datatypes::{DataType, Field};
use bytes::Bytes;
use helio_calib::Mount;
use helio_calib::joint::{
    AccountParts, Alarm, AxisCause, Cause, HeliostatParts, JumpSeen, Lately, Mishaps, Noise, Spell,
    StateParts, Wander, Watch,
};
use helio_core::drive::Drive;
use helio_core::{Enu, EnuUnit, TargetPlane};
use parquet::arrow::ArrowWriter;
use parquet::arrow::arrow_reader::ParquetRecordBatchReaderBuilder;
use parquet::basic::Compression;
use parquet::errors::ParquetError;
use parquet::file::metadata::KeyValue;
use parquet::file::properties::{EnabledStatistics, WriterProperties};
use parquet::file::reader::ChunkReader;
use rayon::prelude::*;
use serde_json::{Value, json};

use crate::atomic::write_file;
use crate::error::{IoError, Place, Problem, quoted};
use crate::field::LoadedField;
use crate::hash::Sha256;
use crate::table::PARQUET_THREAD;

/// The format that this program writes, and the only one that it reads.
pub const STATE_FORMAT: u32 = 2;
/// The key of the format's number in the file's metadata.
const FORMAT_KEY: &str = "helio_state";
/// The key of what is common.
const COMMON_KEY: &str = "helio_state_common";
/// The key of the checksum, a text of [`SEAL_LENGTH`] digits.
const SEAL_KEY: &str = "helio_state_sha256";
const SEAL_LENGTH: usize = 64;
/// Bytes of a piece: several are summed side by side.
const SEALED_TOGETHER: usize = 1 << 20;
/// What stands between that key and its text in the footer: in Thrift's compact protocol a text follows, of that length.
const SEAL_BEGINS: [u8; 2] = [0x18, SEAL_LENGTH as u8];
/// What every Parquet file begins and ends with.
const MAGIC: &[u8; 4] = b"PAR1";
/// A pivot, a target or a mirror offset that moved by less is where it was \[m\].
const SAME_M: f64 = 1e-3;
/// A direction or a latitude that turned by less is as it was \[rad\].
const SAME_RAD: f64 = 1e-5;

/// Everything that a state file holds.
#[derive(Debug, Clone, PartialEq)]
pub struct StateFile {
    /// What is known of the field.
    pub parts: StateParts,
    /// The targets that causes count: [`Cause::Target`] of 1 is the second of these.
    pub targets: Vec<(String, TargetPlane)>,
    /// Longitude of the site \[rad\], which says where the sun stood.
    pub site_longitude_rad: f64,
    /// How each heliostat stands, in the order of the parts.
    pub mounts: Vec<KeptMount>,
    /// Version of the program that wrote it.
    pub version: String,
}

/// What of a heliostat's mount must not change while it is followed.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct KeptMount {
    /// Crossing of its axes.
    pub pivot: Enu,
    /// Pivot to mirror centre along the normal \[m\].
    pub mirror_offset_m: f64,
    /// Where the normal points at zero angles.
    pub axis1: Enu,
    /// The fixed axis.
    pub axis3: Enu,
    /// What the steps of either axis mean, where it has a drive.
    pub drives: [Option<KeptDrive>; 2],
}

/// What the steps of a drive mean: some angles of its axis \[rad\], each with the steps there. Its ends do not count.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct KeptDrive(pub [[f64; 2]; 4]);

impl KeptDrive {
    /// Of a drive.
    #[must_use]
    pub fn of(drive: &Drive) -> Option<Self> {
        let drive = endless(drive);
        let (low, high) = drive.range_rad();
        let (low, high) = if (high - low).is_finite() {
            (low, high)
        } else {
            (-PI, PI)
        };
        let mut kept = [[0.0; 2]; 4];
        // not at its ends, where a triangle that is flat turns without steps
        for (pair, share) in kept.iter_mut().zip([0.125, 0.375, 0.625, 0.875]) {
            let angle_rad = low + share * (high - low);
            *pair = [angle_rad, drive.steps(angle_rad)?];
        }
        Some(Self(kept))
    }

    fn from_numbers(numbers: &[f64]) -> Option<Self> {
        let (pairs, []) = numbers.as_chunks::<2>() else {
            return None;
        };
        Some(Self(pairs.try_into().ok()?))
    }

    /// What another drive makes of the same steps, where that is something else.
    fn differs(&self, now: &Drive) -> Option<String> {
        let now = endless(now);
        self.0.iter().find_map(|&[angle_rad, steps]| {
            let found = now.angle_rad(steps);
            let same = found.is_some_and(|found| within(found - angle_rad, SAME_RAD));
            let shown = found.map_or("nowhere".to_owned(), |found| {
                format!("at {} degrees", degrees(found))
            });
            (!same).then(|| {
                format!(
                    "at {} degrees there at {steps} steps and {shown} in this field",
                    degrees(angle_rad)
                )
            })
        })
    }
}

/// The same mechanism without its ends.
fn endless(drive: &Drive) -> Drive {
    let (low, high) = (f64::NEG_INFINITY, f64::INFINITY);
    match *drive {
        Drive::Encoder(encoder) => encoder.with_range(low, high).map(Drive::Encoder),
        Drive::Triangle(triangle) => triangle
            .with_range(low, high)
            .and_then(|triangle| triangle.with_stops(low, high))
            .map(Drive::Triangle),
        other => Ok(other),
    }
    .unwrap_or(*drive)
}

impl KeptMount {
    /// Of a mount and the drives of its axes.
    #[must_use]
    pub fn of(mount: &Mount, drives: &[Option<Drive>; 2]) -> Self {
        Self {
            pivot: mount.pivot,
            mirror_offset_m: mount.mirror_offset_m,
            axis1: mount.axes.axis1,
            axis3: mount.axes.axis3,
            drives: drives.map(|drive| drive.as_ref().and_then(KeptDrive::of)),
        }
    }

    /// What of a field's mount and drives is not as it was.
    fn differs(&self, mount: &Mount, drives: &[Option<Drive>; 2]) -> Option<String> {
        let now = Self::of(mount, drives);
        if !within((now.pivot - self.pivot).norm(), SAME_M) {
            return Some(format!(
                "has its pivot at {} there and at {} in this field",
                shown(self.pivot),
                shown(now.pivot)
            ));
        }
        if !within(now.mirror_offset_m - self.mirror_offset_m, SAME_M) {
            return Some(format!(
                "has a mirror offset of {} m there and of {} m in this field",
                self.mirror_offset_m, now.mirror_offset_m
            ));
        }
        if !within((now.axis3 - self.axis3).norm(), SAME_RAD)
            || !within((now.axis1 - self.axis1).norm(), SAME_RAD)
        {
            return Some(format!(
                "has its fixed axis along {} there and along {} in this field",
                shown(self.axis3),
                shown(now.axis3)
            ));
        }
        let pairs = self.drives.iter().zip(drives);
        pairs.enumerate().find_map(|(axis, (kept, now))| {
            let axis = axis + 1;
            match (kept, now) {
                (None, None) => None,
                (Some(kept), Some(now)) => {
                    let stands = kept.differs(now)?;
                    Some(format!("has a drive of axis {axis} that stands {stands}"))
                }
                (None, Some(_)) => Some(format!(
                    "has no drive of axis {axis} there and one in this field"
                )),
                (Some(_), None) => Some(format!(
                    "has a drive of axis {axis} there and none in this field"
                )),
            }
        })
    }

    fn numbers(&self) -> [f64; 10] {
        let [a, b, c] = [self.pivot, self.axis1, self.axis3].map(|v| [v.east, v.north, v.up]);
        [
            a[0],
            a[1],
            a[2],
            self.mirror_offset_m,
            b[0],
            b[1],
            b[2],
            c[0],
            c[1],
            c[2],
        ]
    }

    fn from_numbers(n: &[f64]) -> Option<Self> {
        let &[e, n, u, mirror_offset_m, a, b, c, f, g, h] = n else {
            return None;
        };
        Some(Self {
            pivot: Enu::new(e, n, u),
            mirror_offset_m,
            axis1: Enu::new(a, b, c),
            axis3: Enu::new(f, g, h),
            drives: [None; 2],
        })
    }
}

impl StateFile {
    /// Holds the state against a field that is to go on with it: for each heliostat of the state its row in the
    /// field, or nothing where the field no longer has it.
    ///
    /// # Errors
    /// [`IoError`] where the site, a target or a mount is not where it was when the state was begun, or the steps of a
    /// drive mean other angles.
    pub fn rows(&self, path: &Path, loaded: &LoadedField) -> Result<Vec<Option<usize>>, IoError> {
        let other = |message: String| Err(conflict(path, None, message));
        let Some(site) = &loaded.site else {
            return other("it belongs to a field with a [site], which this field has not".into());
        };
        let (latitude_rad, longitude_rad) = (self.parts.site_latitude_rad, self.site_longitude_rad);
        for (what, kept, now) in [
            ("latitude", latitude_rad, site.latitude_rad),
            ("longitude", longitude_rad, site.longitude_rad),
        ] {
            if !within(now - kept, SAME_RAD) {
                return other(format!(
                    "it is of another field: its site lies at a {what} of {} degrees, this field's at {}",
                    degrees(kept),
                    degrees(now)
                ));
            }
        }
        for (name, kept) in &self.targets {
            let Some(area) = loaded.targets.get(name).and_then(|t| t.area.as_ref()) else {
                continue;
            };
            let now = &area.plane;
            let moved = (now.centre - kept.centre).norm();
            if !within(moved, SAME_M) {
                return other(format!(
                    "target {} has its centre at {} there and at {} in this field; what is known of it is worth \
                     nothing once it is moved: begin a new state with --joint",
                    quoted(name),
                    shown(kept.centre),
                    shown(now.centre)
                ));
            }
            for (what, now, kept) in [
                ("normal", now.normal, kept.normal),
                ("right edge", now.right, kept.right),
            ] {
                let (now, kept) = (now.as_enu(), kept.as_enu());
                if !within((now - kept).norm(), SAME_RAD) {
                    return other(format!(
                        "target {} has its {what} along {} there and along {} in this field; begin a new state \
                         with --joint",
                        quoted(name),
                        shown(kept),
                        shown(now)
                    ));
                }
            }
        }
        let field = &loaded.field;
        let ids: HashMap<&str, usize> = field
            .ids()
            .iter()
            .enumerate()
            .map(|(row, id)| (id.as_str(), row))
            .collect();
        self.parts
            .heliostats
            .iter()
            .zip(&self.mounts)
            .map(|(heliostat, kept)| {
                let Some(&row) = ids.get(heliostat.id.as_str()) else {
                    return Ok(None);
                };
                let mount = Mount::of(field.mode(), &field.heliostats()[row]);
                let Some(found) = kept.differs(&mount, &loaded.drives[row]) else {
                    return Ok(Some(row));
                };
                let message = format!(
                    "{found}: what is known of it holds no longer; begin a new state with --joint"
                );
                Err(conflict(path, Some(&heliostat.id), message))
            })
            .collect()
    }
}

/// What is no number is not within anything.
fn within(difference: f64, limit: f64) -> bool {
    difference.abs() < limit
}

fn shown(v: Enu) -> String {
    format!("({}, {}, {})", v.east, v.north, v.up)
}

fn degrees(angle_rad: f64) -> f64 {
    crate::calibrated::degrees_for(angle_rad)
}

fn conflict(path: &Path, heliostat: Option<&str>, message: String) -> IoError {
    let place = Place {
        heliostat: heliostat.map(str::to_owned),
        ..Place::file(path)
    };
    IoError::new(place, Problem::Conflict { message })
}

/// Numbers as text that is read back as the same doubles. (The numbers of JSON are not, in every reader.)
pub(crate) fn text(numbers: &[f64]) -> String {
    let mut out = String::with_capacity(20 * numbers.len());
    for number in numbers {
        if !out.is_empty() {
            out.push(' ');
        }
        out.push_str(zmij::Buffer::new().format(*number));
    }
    out
}

fn plane_text(plane: &TargetPlane) -> String {
    let vectors = [
        plane.centre,
        plane.normal.as_enu(),
        plane.right.as_enu(),
        plane.down.as_enu(),
    ];
    text(&vectors.map(|v| [v.east, v.north, v.up]).concat())
}

fn spell_numbers(spell: &Spell) -> [f64; 5] {
    let [first, last] = spell.days;
    [
        first,
        last,
        spell.heliostats as f64,
        spell.middle,
        f64::from(u8::from(spell.lasts)),
    ]
}

fn common_json(state: &StateFile) -> Value {
    let parts = &state.parts;
    let shared: Vec<Value> = parts
        .shared
        .iter()
        .map(|cause| {
            let name = cause.description().name;
            match cause.target() {
                Some(k) => {
                    let target = state.targets.get(k).map(|(name, _)| name.as_str());
                    json!({ "cause": name, "target": target })
                }
                None => json!({ "cause": name }),
            }
        })
        .collect();
    let own: Vec<&str> = parts.own.iter().map(|c| c.description().name).collect();
    let targets: Vec<Value> = state
        .targets
        .iter()
        .map(|(name, plane)| json!({ "name": name, "centre_normal_right_down_enu": plane_text(plane) }))
        .collect();
    let (n, w, m, a) = (&parts.noise, &parts.wander, &parts.mishaps, &parts.alarm);
    json!({
        "version": state.version,
        "site_latitude_rad": text(&[parts.site_latitude_rad]),
        "site_longitude_rad": text(&[state.site_longitude_rad]),
        "noise_beam_mrad_spot_m_sun_path_s": text(&[n.beam_mrad, n.spot_m, n.sun_path_s]),
        "wander_slow_mrad_days_fast_mrad_days": text(&[
            w.slow_mrad[0], w.slow_mrad[1], w.slow_days, w.fast_mrad[0], w.fast_mrad[1], w.fast_days,
        ]),
        "mishaps_outlier_mrad_jump_mrad": text(&[m.outlier, m.outlier_mrad, m.jump, m.jump_mrad]),
        "alarm_false_rate_weight": text(&[a.false_alarm_rate, a.weight]),
        "own_causes": own,
        "shared_causes": shared,
        "targets": targets,
        "prior_sigma": text(&parts.prior_sigma),
        "spread": text(&parts.spread),
        "matrix": text(&parts.matrix),
        "vector": text(&parts.vector),
        "square": text(&[parts.square]),
        "log_determinant": text(&[parts.log_determinant]),
        "watch_days_calm": text(&[parts.watch.days[0], parts.watch.days[1], parts.watch.calm as f64]),
        "watch_waiting": text(&parts.watch.waiting.iter().flat_map(|(&place, &square)| [place as f64, square]).collect::<Vec<_>>()),
        "watch_spells": text(&parts.watch.spells.iter().flat_map(spell_numbers).collect::<Vec<_>>()),
    })
}

/// Lists of numbers, one a row.
#[derive(Debug)]
struct Lists<T> {
    values: Vec<T>,
    lengths: Vec<usize>,
}

impl<T> Default for Lists<T> {
    fn default() -> Self {
        Self {
            values: Vec::new(),
            lengths: Vec::new(),
        }
    }
}

impl<T: Clone> Lists<T> {
    fn push(&mut self, list: &[T]) {
        self.values.extend_from_slice(list);
        self.lengths.push(list.len());
    }
}

fn list_of(values: ArrayRef, lengths: Vec<usize>) -> Result<ArrayRef, arrow::error::ArrowError> {
    let field = Arc::new(Field::new("item", values.data_type().clone(), false));
    let offsets = OffsetBuffer::<i32>::from_lengths(lengths);
    Ok(Arc::new(ListArray::try_new(field, offsets, values, None)?))
}

impl Lists<f64> {
    fn array(self) -> Result<ArrayRef, arrow::error::ArrowError> {
        list_of(Arc::new(Float64Array::from(self.values)), self.lengths)
    }
}

impl Lists<i64> {
    fn array(self) -> Result<ArrayRef, arrow::error::ArrowError> {
        list_of(Arc::new(Int64Array::from(self.values)), self.lengths)
    }
}

fn signed(count: usize) -> i64 {
    i64::try_from(count).unwrap_or(i64::MAX)
}

fn batch(state: &StateFile) -> Result<RecordBatch, arrow::error::ArrowError> {
    let rows: Vec<(&HeliostatParts, &KeptMount, usize)> = state
        .parts
        .heliostats
        .iter()
        .zip(&state.mounts)
        .flat_map(|(heliostat, mount)| {
            (0..heliostat.accounts.len()).map(move |account| (heliostat, mount, account))
        })
        .collect();
    let counts = |of: &dyn Fn(&HeliostatParts) -> u64| -> ArrayRef {
        Arc::new(Int64Array::from_iter_values(
            rows.iter()
                .map(|row| i64::try_from(of(row.0)).unwrap_or(i64::MAX)),
        ))
    };
    let lists = |of: &dyn Fn(&HeliostatParts, &KeptMount) -> Vec<f64>| {
        let mut lists = Lists::default();
        for (heliostat, mount, _) in &rows {
            lists.push(&of(heliostat, mount));
        }
        lists.array()
    };
    let drive = |axis: usize| {
        lists(&|_, mount| mount.drives[axis].map_or(Vec::new(), |kept| kept.0.concat()))
    };
    let of_account = |of: &dyn for<'a> Fn(&'a AccountParts) -> &'a [f64]| {
        let mut lists = Lists::default();
        for (heliostat, _, account) in &rows {
            lists.push(of(&heliostat.accounts[*account]));
        }
        lists.array()
    };
    let number_of_account = |of: &dyn Fn(&AccountParts) -> f64| -> ArrayRef {
        Arc::new(Float64Array::from_iter_values(
            rows.iter().map(|row| of(&row.0.accounts[row.2])),
        ))
    };
    let marks = |of: &dyn Fn(&AccountParts) -> Vec<i64>| {
        let mut lists = Lists::default();
        for (heliostat, _, account) in &rows {
            lists.push(&of(&heliostat.accounts[*account]));
        }
        lists.array()
    };
    let jump_axes = {
        let mut lists = Lists::default();
        for (heliostat, _, _) in &rows {
            let axes: Vec<i64> = heliostat.jumps.iter().map(|j| signed(j.axis)).collect();
            lists.push(&axes);
        }
        lists.array()?
    };
    let columns: Vec<(&str, ArrayRef, bool)> = vec![
        (
            "id",
            Arc::new(StringArray::from_iter_values(rows.iter().map(|r| &r.0.id))),
            false,
        ),
        (
            "account",
            Arc::new(Int64Array::from_iter_values(
                rows.iter().map(|r| signed(r.2)),
            )),
            false,
        ),
        (
            "last_day",
            Arc::new(Float64Array::from_iter(rows.iter().map(|r| r.0.last_day))),
            true,
        ),
        ("records", counts(&|h| h.records), false),
        ("misses", counts(&|h| h.misses), false),
        ("outliers", counts(&|h| h.outliers), false),
        ("jump_count", counts(&|h| h.jump_count), false),
        (
            "jump_days",
            lists(&|h, _| h.jumps.iter().map(|j| j.day).collect())?,
            false,
        ),
        ("jump_axes", jump_axes, false),
        ("drift1", number_of_account(&|a| a.drift[0]), false),
        ("drift2", number_of_account(&|a| a.drift[1]), false),
        (
            "drift_variance",
            number_of_account(&|a| a.drift_variance),
            false,
        ),
        (
            "unbelieved",
            number_of_account(&|a| a.unbelieved as f64),
            false,
        ),
        ("lately_odd", number_of_account(&|a| a.lately.odd), false),
        (
            "lately_records",
            number_of_account(&|a| a.lately.records),
            false,
        ),
        ("undecided_days", lists(&|h, _| h.undecided.clone())?, false),
        ("mount", lists(&|_, mount| mount.numbers().to_vec())?, false),
        ("drive1", drive(0)?, false),
        ("drive2", drive(1)?, false),
        (
            "log_likelihood",
            number_of_account(&|a| a.log_likelihood),
            false,
        ),
        ("mean", of_account(&|a| &a.mean)?, false),
        ("gain", of_account(&|a| &a.gain)?, false),
        ("spread", of_account(&|a| &a.spread)?, false),
        ("matrix", of_account(&|a| &a.matrix)?, false),
        ("vector", of_account(&|a| &a.vector)?, false),
        ("square", number_of_account(&|a| a.square), false),
        (
            "doubted_outliers",
            marks(&|a| a.outliers.iter().map(|&k| signed(k)).collect())?,
            false,
        ),
        (
            "doubted_jumps",
            marks(&|a| a.jumps.iter().map(|&(k, _)| signed(k)).collect())?,
            false,
        ),
        (
            "doubted_jump_axes",
            marks(&|a| a.jumps.iter().map(|&(_, axis)| signed(axis)).collect())?,
            false,
        ),
    ];
    RecordBatch::try_from_iter_with_nullable(columns)
}

/// Writes a state; the number of its bytes. The same state gives the same bytes, and reading them back the same
/// doubles. The file carries its own checksum.
///
/// # Errors
/// [`IoError`] if it cannot be written, or its mounts are not as many as its heliostats; what stood in its place
/// then stays.
pub fn write_state(path: &Path, state: &StateFile) -> Result<u64, IoError> {
    let bytes = state_bytes(path, state)?;
    write_file(path, &bytes)?;
    Ok(bytes.len() as u64)
}

/// What [`write_state`] writes to `path`, for those who write it later.
///
/// # Errors
/// [`IoError`] if its mounts are not as many as its heliostats.
pub fn state_bytes(path: &Path, state: &StateFile) -> Result<Vec<u8>, IoError> {
    let (heliostats, mounts) = (state.parts.heliostats.len(), state.mounts.len());
    if heliostats != mounts {
        let message = format!("state: expected {heliostats} mounts, one a heliostat, got {mounts}");
        return Err(conflict(path, None, message));
    }
    bytes_of(state).map_err(|error| not_parquet(path, &error.to_string()))
}

fn bytes_of(state: &StateFile) -> Result<Vec<u8>, ParquetError> {
    let batch = batch(state)?;
    let metadata = vec![
        KeyValue::new(FORMAT_KEY.to_owned(), STATE_FORMAT.to_string()),
        KeyValue::new(COMMON_KEY.to_owned(), common_json(state).to_string()),
        KeyValue::new(SEAL_KEY.to_owned(), "0".repeat(SEAL_LENGTH)),
    ];
    // Split into bytes and compressed it would be smaller by a third, and slower to read and to write.
    let properties = WriterProperties::builder()
        .set_key_value_metadata(Some(metadata))
        .set_compression(Compression::UNCOMPRESSED)
        .set_dictionary_enabled(false)
        .set_statistics_enabled(EnabledStatistics::None)
        .build();
    let mut bytes = Vec::new();
    let mut writer = ArrowWriter::try_new(&mut bytes, batch.schema(), Some(properties))?;
    writer.write(&batch)?;
    writer.close()?;
    let place = seal_in(&bytes)
        .ok_or_else(|| ParquetError::General("the checksum has no place".to_owned()))?;
    let seal = seal_of(&bytes, &place);
    bytes[place].copy_from_slice(seal.as_bytes());
    Ok(bytes)
}

/// Where in a file its checksum stands.
fn seal_in(bytes: &[u8]) -> Option<Range<usize>> {
    let (rest, _) = bytes.split_last_chunk::<{ MAGIC.len() }>()?;
    let (rest, length) = rest.split_last_chunk()?;
    let footer = rest
        .len()
        .checked_sub(u32::from_le_bytes(*length) as usize)?;
    let mark = [SEAL_KEY.as_bytes(), &SEAL_BEGINS].concat();
    let before = rest[footer..].windows(mark.len()).position(|w| w == mark)?;
    let from = footer + before + mark.len();
    (from + SEAL_LENGTH <= rest.len()).then_some(from..from + SEAL_LENGTH)
}

/// SHA-256 of the SHA-256s of a file's pieces, with zeros where its checksum stands.
fn seal_of(bytes: &[u8], place: &Range<usize>) -> String {
    let of_piece = |(n, piece): (usize, &[u8])| {
        let from = n * SEALED_TOGETHER;
        let within = |at: usize| at.clamp(from, from + piece.len()) - from;
        let (start, end) = (within(place.start), within(place.end));
        let mut hash = Sha256::default();
        hash.update(&piece[..start]);
        hash.update(&[b'0'; SEAL_LENGTH][..end - start]);
        hash.update(&piece[end..]);
        hash.finish()
    };
    let pieces = bytes.par_chunks(SEALED_TOGETHER).enumerate();
    let each: Vec<String> = pieces.map(of_piece).collect();
    let mut hash = Sha256::default();
    hash.update(each.concat().as_bytes());
    hash.finish()
}

fn not_parquet(path: &Path, said: &str) -> IoError {
    let message = said.trim_start_matches("Parquet error: ").to_owned();
    IoError::new(
        Place::file(path),
        Problem::Syntax {
            format: "Parquet",
            message,
        },
    )
}

/// Reads a state that [`write_state`] wrote, and the checksum that it carries.
///
/// # Errors
/// [`IoError`] for a file that is no state, of another format, not whole, or not as it was written.
pub fn read_state(path: &Path) -> Result<(StateFile, String), IoError> {
    let refuse = |error| IoError::read(path, error);
    let mut file = File::open(path).map_err(refuse)?;
    let mut bytes = Vec::new();
    file.read_to_end(&mut bytes).map_err(refuse)?;
    state_of(path, file, &bytes)
}

/// Reads what [`state_bytes`] gave or [`write_state`] wrote from memory; `name` is what messages call it.
///
/// # Errors
/// As [`read_state`].
pub fn state_of_bytes(name: &Path, bytes: Vec<u8>) -> Result<(StateFile, String), IoError> {
    let bytes = Bytes::from(bytes);
    state_of(name, bytes.clone(), &bytes)
}

fn state_of(
    path: &Path,
    reader: impl ChunkReader + 'static,
    bytes: &[u8],
) -> Result<(StateFile, String), IoError> {
    let seal = sealed(bytes).map_err(|message| conflict(path, None, message))?;
    // As for tables: the reader panics on some damaged files, which must not end the program.
    let thread = Builder::new().name(PARQUET_THREAD.to_string());
    let done = thread
        .spawn(move || pages(reader, seal))
        .map_err(|error| IoError::read(path, error))?
        .join();
    match done {
        Ok(Ok(state)) => Ok(state),
        Ok(Err(Unread::Parquet(said))) => Err(not_parquet(path, &said)),
        Ok(Err(Unread::Other(message))) => Err(conflict(path, None, message)),
        Err(_) => Err(not_parquet(path, "its pages are damaged")),
    }
}

/// Holds a file against its checksum, before anything in it is believed; nothing where it has none, which is then to
/// be explained.
fn sealed(bytes: &[u8]) -> Result<Option<String>, String> {
    if !bytes.starts_with(MAGIC) {
        return Err(
            "it is no state of a followed field, which is a Parquet file; wanted what --joint --state or --update \
             wrote"
                .into(),
        );
    }
    if !bytes[MAGIC.len()..].ends_with(MAGIC) {
        return Err(format!(
            "it is not whole: wanted `PAR1` as its last bytes, after {} bytes found {}; go on from a copy of it, \
             or begin a new state with --joint",
            bytes.len(),
            quoted(
                &bytes[bytes.len().saturating_sub(MAGIC.len())..]
                    .escape_ascii()
                    .to_string()
            )
        ));
    }
    let Some(place) = seal_in(bytes) else {
        return Ok(None);
    };
    let found = seal_of(bytes, &place);
    if found.as_bytes() != &bytes[place.clone()] {
        return Err(format!(
            "it is not as it was written: its checksum is {found}, and {} stands in it; go on from a copy of it, or \
             begin a new state with --joint",
            bytes[place].escape_ascii()
        ));
    }
    Ok(Some(found))
}

enum Unread {
    Parquet(String),
    Other(String),
}

impl From<ParquetError> for Unread {
    fn from(error: ParquetError) -> Self {
        Self::Parquet(error.to_string())
    }
}

impl From<arrow::error::ArrowError> for Unread {
    fn from(error: arrow::error::ArrowError) -> Self {
        Self::Parquet(error.to_string())
    }
}

fn pages(
    file: impl ChunkReader + 'static,
    seal: Option<String>,
) -> Result<(StateFile, String), Unread> {
    let builder = ParquetRecordBatchReaderBuilder::try_new(file)?;
    let pairs = builder.metadata().file_metadata().key_value_metadata();
    let value = |key: &str| -> Option<String> {
        let pair = pairs?.iter().find(|pair| pair.key == key)?;
        pair.value.clone()
    };
    let format = value(FORMAT_KEY).ok_or_else(|| {
        Unread::Other(format!(
            "it is a table but no state of a followed field: its metadata has no {}; wanted what --joint --state \
             or --update wrote",
            quoted(FORMAT_KEY)
        ))
    })?;
    if format != STATE_FORMAT.to_string() {
        return Err(Unread::Other(format!(
            "it is a state of format {}; this program reads format {STATE_FORMAT}: begin a new state with --joint",
            quoted(&format)
        )));
    }
    let seal = seal.ok_or_else(|| {
        Unread::Other(format!(
            "it is not as it was written: wanted its checksum as {} in its metadata, found none; go on from a copy \
             of it, or begin a new state with --joint",
            quoted(SEAL_KEY)
        ))
    })?;
    let common = value(COMMON_KEY).unwrap_or_default();
    let common: Value = serde_json::from_str(&common)
        .map_err(|error| Unread::Other(format!("{}: {error}", quoted(COMMON_KEY))))?;
    let common = Common(&common);
    let mut state = common.state()?;
    let rows = usize::try_from(builder.metadata().file_metadata().num_rows()).unwrap_or(0);
    for batch in builder.with_batch_size(rows.max(1)).build()? {
        take(&batch?, &mut state)?;
    }
    Ok((state, seal))
}

/// The JSON of what is common.
struct Common<'a>(&'a Value);

impl Common<'_> {
    fn wrong(key: &str) -> Unread {
        Unread::Other(format!(
            "{}: {} is not what this program writes there",
            quoted(COMMON_KEY),
            quoted(key)
        ))
    }

    fn list(&self, key: &str) -> Result<Vec<f64>, Unread> {
        let text = self.0[key].as_str().ok_or_else(|| Self::wrong(key))?;
        read_numbers(text).ok_or_else(|| Self::wrong(key))
    }

    fn numbers<const N: usize>(&self, key: &str) -> Result<[f64; N], Unread> {
        <[f64; N]>::try_from(self.list(key)?).map_err(|_| Self::wrong(key))
    }

    fn watch(&self) -> Result<Watch, Unread> {
        let [waiting, spells] = ["watch_waiting", "watch_spells"].map(|key| self.list(key));
        let (waiting, spells) = (waiting?, spells?);
        if waiting.len() % 2 != 0 || spells.len() % 5 != 0 {
            return Err(Self::wrong("watch_waiting or watch_spells"));
        }
        let waiting = waiting
            .chunks_exact(2)
            .map(|pair| (pair[0] as usize, pair[1]));
        let spells = spells.chunks_exact(5).map(|n| Spell {
            days: [n[0], n[1]],
            heliostats: n[2] as usize,
            middle: n[3],
            lasts: n[4] != 0.0,
        });
        let [first, last, calm] = self.numbers("watch_days_calm")?;
        Ok(Watch {
            days: [first, last],
            calm: calm as usize,
            waiting: waiting.collect(),
            spells: spells.collect(),
        })
    }

    fn entries(&self, key: &str) -> Result<&Vec<Value>, Unread> {
        self.0[key].as_array().ok_or_else(|| Self::wrong(key))
    }

    fn state(&self) -> Result<StateFile, Unread> {
        let targets: Vec<(String, TargetPlane)> = self
            .entries("targets")?
            .iter()
            .map(|target| {
                let name = target["name"].as_str()?;
                let numbers = read_numbers(target["centre_normal_right_down_enu"].as_str()?)?;
                Some((name.to_owned(), plane_of(&numbers)?))
            })
            .collect::<Option<_>>()
            .ok_or_else(|| Self::wrong("targets"))?;
        let own = self
            .entries("own_causes")?
            .iter()
            .map(|name| {
                let name = name.as_str().ok_or_else(|| Self::wrong("own_causes"))?;
                AxisCause::named(name).ok_or_else(|| unknown_cause(name))
            })
            .collect::<Result<_, _>>()?;
        let shared = self
            .entries("shared_causes")?
            .iter()
            .map(|entry| {
                let wrong = || Self::wrong("shared_causes");
                let name = entry["cause"].as_str().ok_or_else(wrong)?;
                let place = |name| targets.iter().position(|(known, _)| known == name);
                let target = match entry.get("target").filter(|target| !target.is_null()) {
                    Some(target) => Some(target.as_str().and_then(place).ok_or_else(wrong)?),
                    None => None,
                };
                Cause::named(name, target).ok_or_else(|| unknown_cause(name))
            })
            .collect::<Result<_, Unread>>()?;
        let [beam_mrad, spot_m, sun_path_s] = self.numbers("noise_beam_mrad_spot_m_sun_path_s")?;
        let [slow1, slow2, slow_days, fast1, fast2, fast_days] =
            self.numbers("wander_slow_mrad_days_fast_mrad_days")?;
        let [outlier, outlier_mrad, jump, jump_mrad] =
            self.numbers("mishaps_outlier_mrad_jump_mrad")?;
        let [false_alarm_rate, weight] = self.numbers("alarm_false_rate_weight")?;
        let [site_latitude_rad] = self.numbers("site_latitude_rad")?;
        let [site_longitude_rad] = self.numbers("site_longitude_rad")?;
        let [square] = self.numbers("square")?;
        let [log_determinant] = self.numbers("log_determinant")?;
        Ok(StateFile {
            parts: StateParts {
                noise: Noise {
                    beam_mrad,
                    spot_m,
                    sun_path_s,
                },
                wander: Wander {
                    slow_mrad: [slow1, slow2],
                    slow_days,
                    fast_mrad: [fast1, fast2],
                    fast_days,
                },
                mishaps: Mishaps {
                    outlier,
                    outlier_mrad,
                    jump,
                    jump_mrad,
                },
                alarm: Alarm {
                    false_alarm_rate,
                    weight,
                },
                site_latitude_rad,
                own,
                shared,
                prior_sigma: self.list("prior_sigma")?,
                spread: self.list("spread")?,
                matrix: self.list("matrix")?,
                vector: self.list("vector")?,
                square,
                log_determinant,
                watch: self.watch()?,
                heliostats: Vec::new(),
            },
            targets,
            site_longitude_rad,
            mounts: Vec::new(),
            version: self.0["version"].as_str().unwrap_or_default().to_owned(),
        })
    }
}

fn unknown_cause(name: &str) -> Unread {
    Unread::Other(format!(
        "it holds the cause {}, which this program does not know",
        quoted(name)
    ))
}

fn read_numbers(text: &str) -> Option<Vec<f64>> {
    text.split_whitespace()
        .map(|word| word.parse().ok().filter(|x: &f64| x.is_finite()))
        .collect()
}

fn plane_of(numbers: &[f64]) -> Option<TargetPlane> {
    let vector = |k: usize| {
        Some(Enu::new(
            *numbers.get(k)?,
            *numbers.get(k + 1)?,
            *numbers.get(k + 2)?,
        ))
    };
    let unit = |k: usize| EnuUnit::try_new(vector(k)?).ok();
    (numbers.len() == 12).then_some(())?;
    Some(TargetPlane {
        centre: vector(0)?,
        normal: unit(3)?,
        right: unit(6)?,
        down: unit(9)?,
    })
}

/// The columns of a batch by name.
struct Rows<'a>(&'a RecordBatch);

impl<'a> Rows<'a> {
    fn column<T: 'static>(&self, name: &str) -> Result<&'a T, Unread> {
        let column = self.0.column_by_name(name);
        let kind = |column: &ArrayRef| column.data_type().to_string();
        column
            .and_then(|column| column.as_any().downcast_ref())
            .ok_or_else(|| {
                let found = column.map_or("nothing".to_owned(), kind);
                Unread::Other(format!(
                    "column {} is {found}, not what this program writes there",
                    quoted(name)
                ))
            })
    }

    fn numbers(&self, name: &str) -> Result<&'a [f64], Unread> {
        Ok(self.column::<Float64Array>(name)?.values())
    }

    fn whole(&self, name: &str) -> Result<&'a [i64], Unread> {
        Ok(self.column::<Int64Array>(name)?.values())
    }

    fn lists<T: Array + 'static>(&self, name: &str) -> Result<(&'a [i32], &'a T), Unread> {
        let list = self.column::<ListArray>(name)?;
        let values = list.values().as_any().downcast_ref::<T>();
        let wrong = || Unread::Other(format!("column {} holds no numbers", quoted(name)));
        Ok((list.value_offsets(), values.ok_or_else(wrong)?))
    }

    fn number_lists(&self, name: &str) -> Result<ListsOf<'a, f64>, Unread> {
        let (offsets, values) = self.lists::<Float64Array>(name)?;
        Ok(ListsOf(offsets, values.values()))
    }

    fn whole_lists(&self, name: &str) -> Result<ListsOf<'a, i64>, Unread> {
        let (offsets, values) = self.lists::<Int64Array>(name)?;
        Ok(ListsOf(offsets, values.values()))
    }
}

struct ListsOf<'a, T>(&'a [i32], &'a [T]);

impl<'a, T> ListsOf<'a, T> {
    fn of(&self, row: usize) -> &'a [T] {
        &self.1[self.0[row] as usize..self.0[row + 1] as usize]
    }
}

fn place(number: i64) -> usize {
    // Beyond everything is refused where it is used.
    usize::try_from(number).unwrap_or(usize::MAX)
}

fn take(batch: &RecordBatch, state: &mut StateFile) -> Result<(), Unread> {
    let rows = Rows(batch);
    for (column, field) in batch.columns().iter().zip(batch.schema().fields()) {
        let holes = field.name() != "last_day" && column.null_count() > 0;
        if holes || matches!(field.data_type(), DataType::Null) {
            return Err(Unread::Other(format!(
                "column {} has empty cells",
                quoted(field.name())
            )));
        }
    }
    let ids = rows.column::<StringArray>("id")?;
    let last_day = rows.column::<Float64Array>("last_day")?;
    let (account, records, outliers) = (
        rows.whole("account")?,
        rows.whole("records")?,
        rows.whole("outliers")?,
    );
    let misses = rows.whole("misses")?;
    let unbelieved = rows.numbers("unbelieved")?;
    let [odd, counted] = ["lately_odd", "lately_records"].map(|name| rows.numbers(name));
    let (odd, counted) = (odd?, counted?);
    let jump_count = rows.whole("jump_count")?;
    let (drift1, drift2, drift_variance) = (
        rows.numbers("drift1")?,
        rows.numbers("drift2")?,
        rows.numbers("drift_variance")?,
    );
    let (jump_days, jump_axes) = (
        rows.number_lists("jump_days")?,
        rows.whole_lists("jump_axes")?,
    );
    let (undecided, mounts) = (
        rows.number_lists("undecided_days")?,
        rows.number_lists("mount")?,
    );
    let drives = [rows.number_lists("drive1")?, rows.number_lists("drive2")?];
    let (likelihood, square) = (rows.numbers("log_likelihood")?, rows.numbers("square")?);
    let [mean, gain, spread, matrix, vector] =
        ["mean", "gain", "spread", "matrix", "vector"].map(|name| rows.number_lists(name));
    let (mean, gain, spread, matrix, vector) = (mean?, gain?, spread?, matrix?, vector?);
    let [wrong, jumps, axes] = ["doubted_outliers", "doubted_jumps", "doubted_jump_axes"]
        .map(|name| rows.whole_lists(name));
    let (wrong, jumps, axes) = (wrong?, jumps?, axes?);
    for row in 0..batch.num_rows() {
        let id = ids.value(row);
        let follows = match state.parts.heliostats.last() {
            Some(last) if last.id == id => last.accounts.len(),
            _ => 0,
        };
        if place(account[row]) != follows {
            return Err(Unread::Other(format!(
                "row {}: heliostat {} has account {} where its account {follows} is due",
                row + 1,
                quoted(id),
                account[row]
            )));
        }
        if follows == 0 {
            let mut mount = KeptMount::from_numbers(mounts.of(row)).ok_or_else(|| {
                Unread::Other(format!(
                    "row {}: heliostat {}: mount must be 10 numbers, found {}",
                    row + 1,
                    quoted(id),
                    mounts.of(row).len()
                ))
            })?;
            for (axis, kept) in mount.drives.iter_mut().enumerate() {
                let numbers = drives[axis].of(row);
                *kept = KeptDrive::from_numbers(numbers);
                if kept.is_none() && !numbers.is_empty() {
                    return Err(Unread::Other(format!(
                        "row {}: heliostat {}: drive{} must be 8 numbers or none, found {}",
                        row + 1,
                        quoted(id),
                        axis + 1,
                        numbers.len()
                    )));
                }
            }
            state.mounts.push(mount);
            let pairs = jump_days.of(row).iter().zip(jump_axes.of(row));
            state.parts.heliostats.push(HeliostatParts {
                id: id.to_owned(),
                last_day: last_day.is_valid(row).then(|| last_day.value(row)),
                records: records[row].unsigned_abs(),
                misses: misses[row].unsigned_abs(),
                outliers: outliers[row].unsigned_abs(),
                jump_count: jump_count[row].unsigned_abs(),
                jumps: pairs
                    .map(|(&day, &axis)| JumpSeen {
                        day,
                        axis: place(axis),
                    })
                    .collect(),
                undecided: undecided.of(row).to_vec(),
                accounts: Vec::new(),
            });
        }
        if let Some(heliostat) = state.parts.heliostats.last_mut() {
            let pairs = jumps.of(row).iter().zip(axes.of(row));
            heliostat.accounts.push(AccountParts {
                log_likelihood: likelihood[row],
                drift: [drift1[row], drift2[row]],
                drift_variance: drift_variance[row],
                unbelieved: unbelieved[row] as usize,
                lately: Lately {
                    odd: odd[row],
                    records: counted[row],
                },
                mean: mean.of(row).to_vec(),
                gain: gain.of(row).to_vec(),
                spread: spread.of(row).to_vec(),
                matrix: matrix.of(row).to_vec(),
                vector: vector.of(row).to_vec(),
                square: square[row],
                outliers: wrong.of(row).iter().map(|&k| place(k)).collect(),
                jumps: pairs.map(|(&k, &axis)| (place(k), place(axis))).collect(),
            });
        }
    }
    Ok(())
}
