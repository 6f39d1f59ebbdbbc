//! Parquet, written page by page.
//!
//! Row groups are cut at whole suns where they can be, so that the ids of one are, byte for byte,
//! the ids of the next: they are encoded once. Moments and statuses come in runs. What is left are
//! the numbers, whose pages are independent of each other and are made on all threads.
//!
//! The `parquet` crate describes the schema and writes the footer; pages are made here because its
//! column writers hash every id and every time again for each row.

mod delta;
mod hybrid;
mod page;
mod split;

use std::ops::Range;
use std::path::Path;
use std::sync::Arc;

use arrow::datatypes::{DataType, Field, Schema, TimeUnit};
use parquet::arrow::add_encoded_arrow_schema_to_metadata;
use parquet::basic::{Compression, Encoding, ZstdLevel};
use parquet::errors::ParquetError;
use parquet::file::metadata::{
    ColumnChunkMetaData, FileMetaData, KeyValue, ParquetMetaDataBuilder, ParquetMetaDataWriter,
    RowGroupMetaData,
};
use parquet::file::properties::WriterProperties;
use parquet::file::statistics::Statistics;
use parquet::schema::parser::parse_message_type;
use parquet::schema::types::{ColumnDescPtr, SchemaDescriptor};
use rayon::prelude::*;

use super::rows::Checked;
use super::sink::{Piece, Sink};
use super::{Format, Layout, Moment, Moments, Number, Scale};
use crate::{IoError, Place, Problem};
use helio_core::Status;
use page::{Coding, Desk, Kind, Page, page};

/// Rows of a page of numbers: each of the eight byte streams then fills one zstd block exactly, so
/// noise and what compresses never share a block.
const PAGE_ROWS: usize = 1 << 17;

const MAGIC: &[u8] = b"PAR1";

#[derive(Debug)]
pub(super) struct ParquetEncoder {
    schema: Arc<SchemaDescriptor>,
    key_values: Option<Vec<KeyValue>>,
    row_groups: Vec<RowGroupMetaData>,
    rows: usize,
    statuses: Arc<Bytes>,
    ids: Option<CachedIds>,
}

/// Bytes of a chunk or a page, with their length before compression.
#[derive(Debug)]
struct Bytes {
    bytes: Arc<[u8]>,
    raw_bytes: usize,
}

/// The id column of a row group, for the next one like it.
#[derive(Debug, Clone)]
struct CachedIds {
    first_heliostat: usize,
    rows: usize,
    /// Length of the dictionary page at the start of the chunk.
    dictionary: usize,
    chunk: Arc<Bytes>,
}

/// A part of a row group that one thread makes.
enum Task {
    /// A dictionary-encoded column of 8-byte moments: values per sun.
    Moment {
        values: Vec<[u8; 8]>,
        keys: bool,
    },
    Ids,
    IdKeys,
    Status,
    Number {
        column: usize,
        part: Range<usize>,
    },
}

/// What a chunk's statistics are made of.
#[derive(Debug, Clone, Copy)]
struct Extent {
    min: f64,
    max: f64,
    nulls: usize,
}

impl Extent {
    const NONE: Self = Self {
        min: f64::INFINITY,
        max: f64::NEG_INFINITY,
        nulls: 0,
    };

    fn and(self, other: Self) -> Self {
        Self {
            min: self.min.min(other.min),
            max: self.max.max(other.max),
            nulls: self.nulls + other.nulls,
        }
    }

    /// Parquet's statistics leave the sign of a zero open, so the wider one is written.
    fn statistics(self, whole: bool) -> Statistics {
        let nulls = Some(self.nulls as u64);
        let any = self.min <= self.max;
        if whole {
            let ends = any.then_some((self.min as i64, self.max as i64));
            return Statistics::int64(ends.map(|e| e.0), ends.map(|e| e.1), None, nulls, false);
        }
        let min = if self.min == 0.0 { -0.0 } else { self.min };
        let max = if self.max == 0.0 { 0.0 } else { self.max };
        let ends = any.then_some((min, max));
        Statistics::double(ends.map(|e| e.0), ends.map(|e| e.1), None, nulls, false)
    }
}

impl ParquetEncoder {
    pub(super) fn new(layout: &Layout, name: &Path) -> Result<Self, IoError> {
        let schema = parse_message_type(&message_type(layout)).map_err(|e| refuse(name, &e))?;
        let mut properties = WriterProperties::default();
        add_encoded_arrow_schema_to_metadata(&arrow_schema(layout), &mut properties);
        let statuses = page(Kind::Dictionary, Status::ALL.len(), Vec::new(), name, |w| {
            for status in Status::ALL {
                byte_array(status.as_str(), &mut w.raw);
            }
            &w.raw
        })?;
        Ok(Self {
            schema: Arc::new(SchemaDescriptor::new(Arc::new(schema))),
            key_values: properties.key_value_metadata().cloned(),
            row_groups: Vec::new(),
            rows: 0,
            statuses: Arc::new(joined(&[statuses])),
            ids: None,
        })
    }

    pub(super) fn begin(&self, sink: &mut Sink) -> Result<(), IoError> {
        sink.send(Piece::Small(MAGIC.to_vec()))
    }

    pub(super) fn encode(
        &mut self,
        layout: &Layout,
        block: &Checked<'_>,
        sink: &mut Sink,
    ) -> Result<(), IoError> {
        let most = Format::Parquet.rows_per_block();
        // A block a little too large is better than a row group that cuts a sun in two.
        let step = if block.len() < 2 * most {
            block.len()
        } else {
            most
        };
        for start in (0..block.len()).step_by(step) {
            self.row_group(layout, block, start..(start + step).min(block.len()), sink)?;
        }
        Ok(())
    }

    pub(super) fn end(&self, sink: &mut Sink) -> Result<(), IoError> {
        let file = FileMetaData::new(
            2,
            self.rows as i64,
            Some(concat!("helio-rs version ", env!("CARGO_PKG_VERSION")).to_owned()),
            self.key_values.clone(),
            self.schema.clone(),
            None,
        );
        let metadata = ParquetMetaDataBuilder::new(file)
            .set_row_groups(self.row_groups.clone())
            .build();
        let mut footer = Vec::new();
        ParquetMetaDataWriter::new(&mut footer, &metadata)
            .finish()
            .map_err(|e| refuse(sink.name(), &e))?;
        sink.send(Piece::Small(footer))
    }

    fn row_group(
        &mut self,
        layout: &Layout,
        block: &Checked<'_>,
        range: Range<usize>,
        sink: &mut Sink,
    ) -> Result<(), IoError> {
        let cached = self.ids.take().filter(|ids| {
            block.heliostats.is_none()
                && ids.first_heliostat == block.heliostat(range.start)
                && ids.rows == range.len()
        });
        let tasks = tasks(layout, block, &range, cached.is_some());
        let bodies = sink.buffers(tasks.len());
        let name = sink.name();
        let made: Vec<(Page, Extent)> = tasks
            .par_iter()
            .zip(bodies)
            .map(|(task, body)| make(task, layout, block, &range, body, name))
            .collect::<Result<_, _>>()?;
        let mut made = made.into_iter();

        let mut group = Group {
            rows: range.len(),
            columns: Vec::new(),
            schema: self.schema.clone(),
            name: name.to_owned(),
        };
        let moments = match layout.moment {
            Moment::Time => 1,
            Moment::SunAngles => 2,
        };
        let statistics = moment_statistics(block, &range);
        for statistics in statistics.into_iter().take(moments) {
            let pages: Vec<Page> = made.by_ref().take(2).map(|(page, _)| page).collect();
            group.add(
                Some(0),
                Coding::RleDictionary,
                Some(statistics),
                pages,
                sink,
            )?;
        }
        let ids = match cached {
            Some(cached) => cached,
            None => {
                let pages: Vec<Page> = made.by_ref().take(2).map(|(page, _)| page).collect();
                CachedIds {
                    first_heliostat: block.heliostat(range.start),
                    rows: range.len(),
                    dictionary: pages.first().map_or(0, Page::bytes),
                    chunk: Arc::new(joined(&pages)),
                }
            }
        };
        group.add_shared(&[&ids.chunk], ids.dictionary, sink)?;
        self.ids = Some(ids);
        let pages_each = range.len().div_ceil(PAGE_ROWS);
        for number in &layout.numbers {
            let (pages, extents): (Vec<Page>, Vec<Extent>) = made.by_ref().take(pages_each).unzip();
            let extent = extents.into_iter().fold(Extent::NONE, Extent::and);
            let whole = number.scale == Scale::Whole;
            let coding = number_coding(number);
            group.add(None, coding, Some(extent.statistics(whole)), pages, sink)?;
        }
        let keys: Vec<Page> = made.map(|(page, _)| page).collect();
        let keys = joined(&keys);
        group.add_shared(&[&self.statuses, &keys], self.statuses.bytes.len(), sink)?;

        let ordinal = i16::try_from(self.row_groups.len()).unwrap_or(i16::MAX);
        let group = group.finish(ordinal)?;
        self.rows += range.len();
        self.row_groups.push(group);
        Ok(())
    }
}

/// The column chunks of a row group, sent on and described.
struct Group {
    rows: usize,
    columns: Vec<ColumnChunkMetaData>,
    schema: Arc<SchemaDescriptor>,
    name: std::path::PathBuf,
}

impl Group {
    /// Sends a chunk; `dictionary` is the position of its dictionary page among the pages.
    fn add(
        &mut self,
        dictionary: Option<usize>,
        coding: Coding,
        statistics: Option<Statistics>,
        pages: Vec<Page>,
        sink: &mut Sink,
    ) -> Result<(), IoError> {
        let start = sink.position();
        let dictionary_bytes = dictionary.map(|at| pages[at].bytes());
        let bytes: usize = pages.iter().map(Page::bytes).sum();
        let raw_bytes = pages.iter().map(|page| page.raw_bytes).sum();
        for page in pages {
            sink.send(Piece::Small(page.header))?;
            sink.send(Piece::Owned(page.body))?;
        }
        self.describe(
            start,
            bytes,
            raw_bytes,
            dictionary_bytes,
            coding,
            statistics,
        )
    }

    /// Sends a dictionary-encoded text chunk that was made before.
    fn add_shared(
        &mut self,
        parts: &[&Bytes],
        dictionary_bytes: usize,
        sink: &mut Sink,
    ) -> Result<(), IoError> {
        let start = sink.position();
        for part in parts {
            sink.send(Piece::Shared(part.bytes.clone()))?;
        }
        let bytes = parts.iter().map(|part| part.bytes.len()).sum();
        let raw_bytes = parts.iter().map(|part| part.raw_bytes).sum();
        let coding = Coding::RleDictionary;
        self.describe(
            start,
            bytes,
            raw_bytes,
            Some(dictionary_bytes),
            coding,
            None,
        )
    }

    fn describe(
        &mut self,
        start: u64,
        bytes: usize,
        raw_bytes: usize,
        dictionary_bytes: Option<usize>,
        coding: Coding,
        statistics: Option<Statistics>,
    ) -> Result<(), IoError> {
        let column: ColumnDescPtr = self.schema.column(self.columns.len());
        let mut encodings = vec![Encoding::RLE];
        encodings.push(match coding {
            Coding::Rle => Encoding::RLE,
            Coding::DeltaBinaryPacked => Encoding::DELTA_BINARY_PACKED,
            Coding::RleDictionary => Encoding::RLE_DICTIONARY,
            Coding::ByteStreamSplit => Encoding::BYTE_STREAM_SPLIT,
        });
        if dictionary_bytes.is_some() {
            encodings.push(Encoding::PLAIN);
        }
        let start = start as i64;
        let mut builder = ColumnChunkMetaData::builder(column)
            .set_encodings(encodings)
            .set_compression(Compression::ZSTD(ZstdLevel::default()))
            .set_num_values(self.rows as i64)
            .set_total_compressed_size(bytes as i64)
            .set_total_uncompressed_size(raw_bytes as i64)
            .set_data_page_offset(start + dictionary_bytes.unwrap_or(0) as i64)
            .set_dictionary_page_offset(dictionary_bytes.map(|_| start));
        if let Some(statistics) = statistics {
            builder = builder.set_statistics(statistics);
        }
        let chunk = builder.build().map_err(|e| refuse(&self.name, &e))?;
        self.columns.push(chunk);
        Ok(())
    }

    fn finish(self, ordinal: i16) -> Result<RowGroupMetaData, IoError> {
        let raw_bytes = self.columns.iter().map(|c| c.uncompressed_size()).sum();
        RowGroupMetaData::builder(self.schema)
            .set_num_rows(self.rows as i64)
            .set_total_byte_size(raw_bytes)
            .set_column_metadata(self.columns)
            .set_ordinal(ordinal)
            .build()
            .map_err(|e| refuse(&self.name, &e))
    }
}

fn refuse(name: &Path, error: &ParquetError) -> IoError {
    let problem = Problem::Syntax {
        format: "Parquet",
        message: error.to_string(),
    };
    IoError::new(Place::file(name), problem)
}

fn message_type(layout: &Layout) -> String {
    let mut text = String::from("message table {\n");
    match layout.moment {
        Moment::Time => text.push_str("REQUIRED INT64 time (TIMESTAMP(NANOS,true));\n"),
        Moment::SunAngles => {
            text.push_str("REQUIRED DOUBLE sun_azimuth_deg;\nREQUIRED DOUBLE sun_elevation_deg;\n")
        }
    }
    text.push_str("REQUIRED BYTE_ARRAY id (STRING);\n");
    for number in &layout.numbers {
        let kind = if number.scale == Scale::Whole {
            "INT64"
        } else {
            "DOUBLE"
        };
        text.push_str(&format!("OPTIONAL {kind} {};\n", number.name));
    }
    text.push_str("REQUIRED BYTE_ARRAY status (STRING);\n}");
    text
}

/// The same schema for Arrow, which reads dictionaries as such only if told.
fn arrow_schema(layout: &Layout) -> Schema {
    let words = || DataType::Dictionary(Box::new(DataType::Int32), Box::new(DataType::Utf8));
    let mut fields = match layout.moment {
        Moment::Time => {
            let utc = DataType::Timestamp(TimeUnit::Nanosecond, Some("UTC".into()));
            vec![Field::new("time", utc, false)]
        }
        Moment::SunAngles => vec![
            Field::new("sun_azimuth_deg", DataType::Float64, false),
            Field::new("sun_elevation_deg", DataType::Float64, false),
        ],
    };
    fields.push(Field::new("id", words(), false));
    for number in &layout.numbers {
        let kind = if number.scale == Scale::Whole {
            DataType::Int64
        } else {
            DataType::Float64
        };
        fields.push(Field::new(&number.name, kind, true));
    }
    fields.push(Field::new("status", words(), false));
    Schema::new(fields)
}

fn number_coding(number: &Number) -> Coding {
    if number.scale == Scale::Whole {
        Coding::DeltaBinaryPacked
    } else {
        Coding::ByteStreamSplit
    }
}

/// The parts of a row group, in the order of the file.
fn tasks(layout: &Layout, block: &Checked<'_>, range: &Range<usize>, ids_known: bool) -> Vec<Task> {
    let suns = suns_of(block, range);
    let mut tasks = Vec::new();
    let mut moment = |values: Vec<[u8; 8]>| {
        tasks.push(Task::Moment {
            values: values.clone(),
            keys: false,
        });
        tasks.push(Task::Moment { values, keys: true });
    };
    match block.moments {
        Moments::Times { unix_ns } => {
            moment(unix_ns[suns].iter().map(|t| t.to_le_bytes()).collect())
        }
        Moments::SunAngles {
            azimuth_deg,
            elevation_deg,
        } => {
            for angles in [azimuth_deg, elevation_deg] {
                moment(
                    angles[suns.clone()]
                        .iter()
                        .map(|a| a.to_le_bytes())
                        .collect(),
                );
            }
        }
    }
    if !ids_known {
        tasks.extend([Task::Ids, Task::IdKeys]);
    }
    for column in 0..layout.numbers.len() {
        for start in range.clone().step_by(PAGE_ROWS) {
            let part = start..(start + PAGE_ROWS).min(range.end);
            tasks.push(Task::Number { column, part });
        }
    }
    tasks.push(Task::Status);
    tasks
}

/// The suns that have rows in a range, from the first to the last.
fn suns_of(block: &Checked<'_>, range: &Range<usize>) -> Range<usize> {
    let mut suns = block.suns(range.clone()).map(|(sun, _)| sun);
    let first = suns.next().unwrap_or(0);
    first..suns.last().unwrap_or(first) + 1
}

fn moment_statistics(block: &Checked<'_>, range: &Range<usize>) -> Vec<Statistics> {
    let suns = suns_of(block, range);
    match block.moments {
        Moments::Times { unix_ns } => {
            let times = &unix_ns[suns];
            let (min, max) = (times.iter().min(), times.iter().max());
            vec![Statistics::int64(
                min.copied(),
                max.copied(),
                None,
                Some(0),
                false,
            )]
        }
        Moments::SunAngles {
            azimuth_deg,
            elevation_deg,
        } => [azimuth_deg, elevation_deg]
            .map(|angles| {
                let one = |extent: Extent, &angle: &f64| {
                    extent.and(Extent {
                        min: angle,
                        max: angle,
                        nulls: 0,
                    })
                };
                angles[suns.clone()]
                    .iter()
                    .fold(Extent::NONE, one)
                    .statistics(false)
            })
            .to_vec(),
    }
}

fn make(
    task: &Task,
    layout: &Layout,
    block: &Checked<'_>,
    range: &Range<usize>,
    body: Vec<u8>,
    name: &Path,
) -> Result<(Page, Extent), IoError> {
    let keys = Kind::Data(Coding::RleDictionary);
    let rows = range.len();
    let made = match task {
        Task::Moment {
            values,
            keys: false,
        } => page(Kind::Dictionary, values.len(), body, name, |w| {
            w.raw.extend(values.iter().flatten());
            &w.raw
        })?,
        Task::Moment { values, keys: true } => page(keys, rows, body, name, |w| {
            let bits = hybrid::bits_below(values.len());
            w.raw.push(bits as u8);
            let first = suns_of(block, range).start;
            for (sun, part) in block.suns(range.clone()) {
                hybrid::run(part.len(), (sun - first) as u32, bits, &mut w.raw);
            }
            &w.raw
        })?,
        Task::Ids => {
            let ids = dictionary_of_ids(layout, block, range);
            page(Kind::Dictionary, ids.len(), body, name, |w| {
                for row in ids {
                    let id = match block.heliostats {
                        Some(_) => row,
                        None => row % layout.ids.len(),
                    };
                    byte_array(&layout.ids[id], &mut w.raw);
                }
                &w.raw
            })?
        }
        Task::IdKeys => {
            let ids = dictionary_of_ids(layout, block, range);
            page(keys, rows, body, name, |w| {
                let bits = hybrid::bits_below(ids.len());
                w.raw.push(bits as u8);
                let (first, count) = (ids.start, ids.len());
                let range = range.clone();
                match block.heliostats {
                    Some(heliostats) => {
                        hybrid::encode(range, bits, |row| heliostats[row], &mut w.raw);
                    }
                    None => {
                        let key = |row: usize| ((row - first) % count) as u32;
                        hybrid::encode(range, bits, key, &mut w.raw);
                    }
                }
                &w.raw
            })?
        }
        Task::Status => page(keys, rows, body, name, |w| {
            let bits = hybrid::bits_below(Status::ALL.len());
            w.raw.push(bits as u8);
            let key = |row: usize| u32::from(block.status[row].code());
            hybrid::encode(range.clone(), bits, key, &mut w.raw);
            &w.raw
        })?,
        Task::Number { column, part } => {
            let number = &layout.numbers[*column];
            let values = &block.numbers[*column][part.clone()];
            let status = &block.status[part.clone()];
            let mut extent = Extent::NONE;
            let kind = Kind::Data(number_coding(number));
            let page = page(kind, part.len(), body, name, |w| {
                let (found, body) = numbers(number, values, status, w);
                extent = found;
                body
            })?;
            return Ok((page, extent));
        }
    };
    Ok((made, Extent::NONE))
}

/// The entries of the id dictionary: heliostats, or rows where each has one in field order.
fn dictionary_of_ids(layout: &Layout, block: &Checked<'_>, range: &Range<usize>) -> Range<usize> {
    let field = layout.ids.len();
    match block.heliostats {
        Some(_) => 0..field,
        // Row numbers: the dictionary then starts with the first row's heliostat.
        None => range.start..range.start + range.len().min(field),
    }
}

/// The body of a page of numbers: which exist, then those.
fn numbers<'a>(
    number: &Number,
    values: &[f64],
    status: &[Status],
    desk: &'a mut Desk,
) -> (Extent, &'a [u8]) {
    let (mut extent, finite) = extent(values, number.scale);
    // A plain pass over everything, which becomes vector code as a test for each row does not.
    let carried = status
        .iter()
        .fold(true, |all, &status| all & number.carried_by(status));

    desk.raw.extend_from_slice(&[0; 4]);
    let dense = if finite && carried {
        hybrid::run(values.len(), 1, 1, &mut desk.raw);
        values
    } else {
        let exists = |row: usize| number.carried_by(status[row]) && values[row].is_finite();
        let level = |row: usize| u32::from(exists(row));
        hybrid::encode(0..values.len(), 1, level, &mut desk.raw);
        let rows = (0..values.len()).filter(|&row| exists(row));
        desk.dense.clear();
        desk.dense.extend(rows.map(|row| values[row]));
        extent = self::extent(&desk.dense, number.scale).0;
        extent.nulls = values.len() - desk.dense.len();
        &desk.dense
    };
    let levels = (desk.raw.len() - 4) as u32;
    desk.raw[..4].copy_from_slice(&levels.to_le_bytes());

    if number.scale == Scale::Whole {
        let whole: Vec<i64> = dense
            .iter()
            .map(|&v| number.scale.apply(v) as i64)
            .collect();
        delta::encode(&whole, &mut desk.raw);
        return (extent, &desk.raw);
    }
    let start = desk.raw.len();
    let length = start + dense.len() * 8;
    if desk.wide.len() < length {
        desk.wide.resize(length, 0);
    }
    let body = &mut desk.wide[..length];
    body[..start].copy_from_slice(&desk.raw);
    let streams = &mut body[start..];
    match number.scale {
        // Each its own copy of the loop, with the factor inside.
        Scale::Degrees => split::split(dense, |v| Scale::Degrees.apply(v), streams),
        Scale::Milliradians => split::split(dense, |v| Scale::Milliradians.apply(v), streams),
        _ => split::split(dense, |v| v, streams),
    }
    (extent, body)
}

/// Least and greatest value as written (every scale keeps the order), and whether all are finite.
fn extent(values: &[f64], scale: Scale) -> (Extent, bool) {
    // Several of each, so that one comparison need not wait for the one before.
    let mut min = [f64::INFINITY; 8];
    let mut max = [f64::NEG_INFINITY; 8];
    let mut odd = [false; 8];
    let mut see = |lane: usize, v: f64| {
        min[lane] = if v < min[lane] { v } else { min[lane] };
        max[lane] = if v > max[lane] { v } else { max[lane] };
        odd[lane] |= v.is_nan();
    };
    let chunks = values.chunks_exact(8);
    for &v in chunks.remainder() {
        see(0, v);
    }
    for chunk in chunks {
        for (lane, &v) in chunk.iter().enumerate() {
            see(lane, v);
        }
    }
    let min = min.into_iter().fold(f64::INFINITY, f64::min);
    let max = max.into_iter().fold(f64::NEG_INFINITY, f64::max);
    let infinite = min == f64::NEG_INFINITY || max == f64::INFINITY;
    let finite = !infinite && !odd.contains(&true);
    let extent = Extent {
        min: scale.apply(min),
        max: scale.apply(max),
        nulls: 0,
    };
    (extent, finite)
}

fn byte_array(text: &str, out: &mut Vec<u8>) {
    out.extend_from_slice(&(text.len() as u32).to_le_bytes());
    out.extend_from_slice(text.as_bytes());
}

fn joined(pages: &[Page]) -> Bytes {
    let mut bytes = Vec::with_capacity(pages.iter().map(Page::bytes).sum());
    for page in pages {
        bytes.extend_from_slice(&page.header);
        bytes.extend_from_slice(&page.body);
    }
    Bytes {
        bytes: bytes.into(),
        raw_bytes: pages.iter().map(|page| page.raw_bytes).sum(),
    }
}

#[cfg(test)]
mod tests {
    use std::fs::File;

    use arrow::array::{Array, AsArray};
    use arrow::datatypes::{Float64Type, Int32Type, Int64Type, TimestampNanosecondType};
    use parquet::arrow::arrow_reader::ParquetRecordBatchReaderBuilder;

    use super::*;
    use crate::output::{Destination, Rows, TableWriter};

    /// A block large enough to be cut inside a sun, then a small one, then one of all suns at once:
    /// nulls in stretches and scattered, several pages, times and ids across the cuts.
    #[test]
    fn what_is_written_is_read_back() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("table.parquet");
        let n = 70_000;
        let layout = Layout {
            ids: (0..n).map(|i| format!("H{i}")).collect(),
            moment: Moment::Time,
            numbers: vec![
                Number::new("number", Scale::Plain),
                Number::new("whole", Scale::Whole).also(Status::OutsideLimits),
            ],
        };
        let number = |row: usize| {
            if row.is_multiple_of(13) {
                f64::NAN
            } else {
                (row as f64).sin() * 1e3
            }
        };
        let whole = |row: usize| (row * row % 1_000_003) as f64 - 5e5 + 0.25;
        let status = |row: usize| match row {
            300_000..450_000 => Status::SunBelowHorizon,
            _ if row.is_multiple_of(97) => Status::OutsideLimits,
            _ => Status::Ok,
        };
        let mut writer =
            TableWriter::create(Destination::File(path.clone()), Format::Parquet, layout).unwrap();
        let mut row = 0;
        for suns in [35, 1, 15] {
            let rows = row..row + suns * n;
            let times: Vec<i64> = rows
                .clone()
                .step_by(n)
                .map(|r| (r / n) as i64 * 10)
                .collect();
            let numbers: Vec<f64> = rows.clone().map(number).collect();
            let wholes: Vec<f64> = rows.clone().map(whole).collect();
            let statuses: Vec<Status> = rows.map(status).collect();
            writer
                .write(&Rows {
                    moments: Moments::Times { unix_ns: &times },
                    ends: None,
                    heliostats: None,
                    numbers: &[&numbers, &wholes],
                    status: &statuses,
                })
                .unwrap();
            row += suns * n;
        }
        assert_eq!(writer.finish().unwrap().rows, row as u64);

        let reader = ParquetRecordBatchReaderBuilder::try_new(File::open(path).unwrap()).unwrap();
        assert_eq!(reader.metadata().num_row_groups(), 3 + 1 + 1);
        let mut at = 0;
        for batch in reader.with_batch_size(65_536).build().unwrap() {
            let batch = batch.unwrap();
            let words = |column: usize| {
                let column = batch.column(column).as_dictionary::<Int32Type>();
                (
                    column.keys().clone(),
                    column.values().as_string::<i32>().clone(),
                )
            };
            let times = batch.column(0).as_primitive::<TimestampNanosecondType>();
            let (ids, id_words) = words(1);
            let numbers = batch.column(2).as_primitive::<Float64Type>();
            let wholes = batch.column(3).as_primitive::<Int64Type>();
            let (statuses, status_words) = words(4);
            for i in 0..batch.num_rows() {
                assert_eq!(times.value(i), (at / n) as i64 * 10);
                let id: usize = id_words.value(ids.value(i) as usize)[1..].parse().unwrap();
                assert_eq!(id, at % n);
                let status = status(at);
                assert_eq!(
                    status_words.value(statuses.value(i) as usize),
                    status.as_str()
                );
                let ok = status == Status::Ok;
                assert_eq!(numbers.is_valid(i), ok && !number(at).is_nan());
                if numbers.is_valid(i) {
                    assert_eq!(numbers.value(i).to_bits(), number(at).to_bits());
                }
                assert_eq!(wholes.is_valid(i), ok || status == Status::OutsideLimits);
                if wholes.is_valid(i) {
                    assert_eq!(wholes.value(i) as f64, whole(at).round());
                }
                at += 1;
            }
        }
        assert_eq!(at, row);
    }

    #[test]
    fn delta_encoding_reads_back_at_every_length() {
        let folder = tempfile::tempdir().unwrap();
        for n in [1, 2, 32, 33, 128, 129, 130, 300] {
            let path = folder.path().join("table.parquet");
            let layout = Layout {
                ids: (0..n).map(|i| i.to_string()).collect(),
                moment: Moment::SunAngles,
                numbers: vec![Number::new("whole", Scale::Whole)],
            };
            let values: Vec<f64> = (0..n)
                .map(|i| {
                    if i % 3 == 0 {
                        -9e15 + i as f64
                    } else {
                        (i * i) as f64
                    }
                })
                .collect();
            let mut writer =
                TableWriter::create(Destination::File(path.clone()), Format::Parquet, layout)
                    .unwrap();
            writer
                .write(&Rows {
                    moments: Moments::SunAngles {
                        azimuth_deg: &[180.0],
                        elevation_deg: &[45.5],
                    },
                    ends: None,
                    heliostats: None,
                    numbers: &[&values],
                    status: &vec![Status::Ok; n],
                })
                .unwrap();
            writer.finish().unwrap();
            let reader =
                ParquetRecordBatchReaderBuilder::try_new(File::open(path).unwrap()).unwrap();
            let batch = reader.build().unwrap().next().unwrap().unwrap();
            let back: Vec<f64> = batch
                .column(3)
                .as_primitive::<Int64Type>()
                .values()
                .iter()
                .map(|&v| v as f64)
                .collect();
            assert_eq!(back, values);
            assert_eq!(batch.column(1).as_primitive::<Float64Type>().value(0), 45.5);
        }
    }
}
