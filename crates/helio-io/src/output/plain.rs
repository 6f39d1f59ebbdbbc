//! Small tables of names and numbers, written whole: generated layouts, calibrations.

use std::io::Write;
use std::path::Path;
use std::sync::{Arc, Mutex, PoisonError};

use ::parquet::arrow::ArrowWriter;
use ::parquet::basic::{Compression, Encoding, ZstdLevel};
use ::parquet::errors::ParquetError;
use ::parquet::file::properties::WriterProperties;
use arrow::array::{
    ArrayRef, Float64Array, Int64Array, RecordBatch, StringArray, TimestampNanosecondArray,
};

use super::sink::{Piece, Sink};
use super::text::{csv_text, json_text};
use super::{Destination, Format};
use crate::{IoError, Place, Problem, format_time};

/// Bytes of text handed over at once.
const PIECE: usize = 1 << 20;

/// The cells of a column, in the order of the rows.
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
pub enum Cells<'a> {
    /// Text; an empty one is absent.
    Text(&'a [String]),
    /// Numbers; what is not finite is absent.
    Numbers(&'a [f64]),
    /// Whole numbers.
    Whole(&'a [Option<i64>]),
    /// Times \[ns of Unix time\].
    Times(&'a [Option<i64>]),
}

impl Cells<'_> {
    fn len(&self) -> usize {
        match self {
            Self::Text(cells) => cells.len(),
            Self::Numbers(cells) => cells.len(),
            Self::Whole(cells) | Self::Times(cells) => cells.len(),
        }
    }

    /// A cell of a row in CSV or JSON; false if it is absent.
    fn write(&self, row: usize, csv: bool, out: &mut Vec<u8>) -> bool {
        match self {
            Self::Text(cells) if cells[row].is_empty() => return false,
            Self::Text(cells) if csv => out.extend_from_slice(csv_text(&cells[row]).as_bytes()),
            Self::Text(cells) => out.extend_from_slice(json_text(&cells[row]).as_bytes()),
            Self::Numbers(cells) if !cells[row].is_finite() => return false,
            Self::Numbers(cells) => {
                out.extend_from_slice(zmij::Buffer::new().format_finite(cells[row]).as_bytes());
            }
            // Writing to a vector cannot fail.
            Self::Whole(cells) => match cells[row] {
                None => return false,
                Some(number) => {
                    let _ = write!(out, "{number}");
                }
            },
            Self::Times(cells) => match cells[row] {
                None => return false,
                Some(unix_ns) if csv => out.extend_from_slice(format_time(unix_ns).as_bytes()),
                Some(unix_ns) => {
                    let _ = write!(out, "\"{}\"", format_time(unix_ns));
                }
            },
        }
        true
    }

    fn array(&self) -> ArrayRef {
        match self {
            Self::Text(cells) => Arc::new(StringArray::from_iter(
                cells.iter().map(|t| (!t.is_empty()).then_some(t)),
            )),
            Self::Numbers(cells) => Arc::new(Float64Array::from_iter(
                cells.iter().map(|v| v.is_finite().then_some(*v)),
            )),
            Self::Whole(cells) => Arc::new(Int64Array::from_iter(cells.iter().copied())),
            Self::Times(cells) => Arc::new(
                TimestampNanosecondArray::from_iter(cells.iter().copied()).with_timezone("UTC"),
            ),
        }
    }
}

/// The cells of a column that is kept in memory.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub enum KeptCells {
    /// Text; an empty one is absent.
    Text(Vec<String>),
    /// Numbers; what is not finite is absent.
    Numbers(Vec<f64>),
    /// Whole numbers.
    Whole(Vec<Option<i64>>),
    /// Times \[ns of Unix time\].
    Times(Vec<Option<i64>>),
}

impl KeptCells {
    /// The same cells, to be written.
    #[must_use]
    pub fn cells(&self) -> Cells<'_> {
        match self {
            Self::Text(cells) => Cells::Text(cells),
            Self::Numbers(cells) => Cells::Numbers(cells),
            Self::Whole(cells) => Cells::Whole(cells),
            Self::Times(cells) => Cells::Times(cells),
        }
    }
}

impl From<Cells<'_>> for KeptCells {
    fn from(cells: Cells<'_>) -> Self {
        match cells {
            Cells::Text(cells) => Self::Text(cells.to_vec()),
            Cells::Numbers(cells) => Self::Numbers(cells.to_vec()),
            Cells::Whole(cells) => Self::Whole(cells.to_vec()),
            Cells::Times(cells) => Self::Times(cells.to_vec()),
        }
    }
}

/// Where a table that is kept in memory is to be found after it was written to [`Destination::Columns`].
///
/// ```
/// use helio_io::output::{Cells, Destination, Format, KeptCells, KeptColumns, write_columns};
/// let kept = KeptColumns::default();
/// let columns = [("beam_mrad", Cells::Numbers(&[1.5]))];
/// write_columns(Destination::Columns(kept.clone()), Format::Csv, &columns)?;
/// assert_eq!(kept.take(), [("beam_mrad".to_owned(), KeptCells::Numbers(vec![1.5]))]);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Debug, Clone, Default)]
pub struct KeptColumns(Arc<Mutex<Vec<(String, KeptCells)>>>);

impl KeptColumns {
    /// The columns, which are gone then.
    #[must_use]
    pub fn take(&self) -> Vec<(String, KeptCells)> {
        std::mem::take(&mut self.0.lock().unwrap_or_else(PoisonError::into_inner))
    }

    fn put(&self, columns: &[(&str, Cells<'_>)]) {
        let kept = columns
            .iter()
            .map(|(name, cells)| ((*name).to_owned(), (*cells).into()));
        *self.0.lock().unwrap_or_else(PoisonError::into_inner) = kept.collect();
    }
}

/// Writes a table with a column `id` and columns of numbers, such as a layout of heliostats.
///
/// # Errors
/// [`IoError`] if columns differ in length or the table cannot be written; there is then no file.
///
/// ```
/// use helio_io::output::{Destination, Format, write_table};
/// let folder = tempfile::tempdir()?;
/// let path = folder.path().join("heliostats.csv");
/// let ids = ["A1".to_owned(), "A2".to_owned()];
/// let (east_m, north_m) = ([10.0, -10.5], [80.0, 80.0]);
/// let columns: [(&str, &[f64]); 2] = [("east_m", &east_m), ("north_m", &north_m)];
/// write_table(Destination::File(path.clone()), Format::Csv, &ids, &columns)?;
/// assert_eq!(std::fs::read_to_string(path)?, "id,east_m,north_m\nA1,10.0,80.0\nA2,-10.5,80.0\n");
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn write_table(
    destination: Destination,
    format: Format,
    ids: &[String],
    columns: &[(&str, &[f64])],
) -> Result<u64, IoError> {
    let columns: Vec<(&str, Cells<'_>)> = std::iter::once(("id", Cells::Text(ids)))
        .chain(columns.iter().map(|(name, c)| (*name, Cells::Numbers(c))))
        .collect();
    write_columns(destination, format, &columns)
}

/// Writes a table of any columns whole; the number of its bytes.
///
/// # Errors
/// [`IoError`] if columns differ in length or the table cannot be written; there is then no file.
///
/// ```
/// use helio_io::output::{Cells, Destination, Format, write_columns};
/// let folder = tempfile::tempdir()?;
/// let path = folder.path().join("rejected.jsonl");
/// let ids = ["A1".to_owned(), "A2".to_owned()];
/// let columns = [
///     ("id", Cells::Text(&ids)),
///     ("line", Cells::Whole(&[Some(2), None])),
///     ("beam_mrad", Cells::Numbers(&[1.5, f64::NAN])),
/// ];
/// write_columns(Destination::File(path.clone()), Format::JsonLines, &columns)?;
/// assert_eq!(
///     std::fs::read_to_string(path)?,
///     "{\"id\":\"A1\",\"line\":2,\"beam_mrad\":1.5}\n\
///      {\"id\":\"A2\",\"line\":null,\"beam_mrad\":null}\n"
/// );
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn write_columns(
    destination: Destination,
    format: Format,
    columns: &[(&str, Cells<'_>)],
) -> Result<u64, IoError> {
    let rows = columns.first().map_or(0, |(_, cells)| cells.len());
    for (name, cells) in columns {
        if cells.len() != rows {
            let got = cells.len();
            let message = format!("table: {name}: expected {rows} entries, got {got}");
            return Err(IoError::new(
                Place::default(),
                Problem::Conflict { message },
            ));
        }
    }
    if let Destination::Columns(kept) = &destination {
        kept.put(columns);
        return Ok(0);
    }
    let mut sink = Sink::open(destination)?;
    match format {
        Format::Parquet => {
            let bytes = parquet_bytes(columns).map_err(|e| refuse(sink.name(), &e))?;
            sink.send(Piece::Owned(bytes))?;
        }
        text => write_rows(text, rows, columns, &mut sink)?,
    }
    sink.finish()
}

fn refuse(name: &Path, error: &ParquetError) -> IoError {
    let problem = Problem::Syntax {
        format: "Parquet",
        message: error.to_string(),
    };
    IoError::new(Place::file(name), problem)
}

fn write_rows(
    format: Format,
    rows: usize,
    columns: &[(&str, Cells<'_>)],
    sink: &mut Sink,
) -> Result<(), IoError> {
    let csv = format == Format::Csv;
    let mut out = Vec::new();
    let (between, after) = match format {
        Format::Csv => {
            let names: Vec<String> = columns.iter().map(|(name, _)| csv_text(name)).collect();
            // Writing to a vector cannot fail.
            let _ = writeln!(out, "{}", names.join(","));
            ("", "\n")
        }
        Format::Json => {
            out.extend_from_slice(b"[\n");
            (",\n", "}")
        }
        _ => ("", "}\n"),
    };
    for row in 0..rows {
        if row > 0 {
            out.extend_from_slice(between.as_bytes());
        }
        for (index, (name, cells)) in columns.iter().enumerate() {
            if csv {
                if index > 0 {
                    out.push(b',');
                }
            } else {
                let before = if index == 0 { '{' } else { ',' };
                let _ = write!(out, "{before}{}:", json_text(name));
            }
            if !cells.write(row, csv, &mut out) && !csv {
                out.extend_from_slice(b"null");
            }
        }
        out.extend_from_slice(after.as_bytes());
        if out.len() > PIECE {
            sink.send(Piece::Owned(std::mem::take(&mut out)))?;
        }
    }
    if format == Format::Json {
        out.extend_from_slice(b"\n]\n");
    }
    sink.send(Piece::Owned(out))
}

fn parquet_bytes(columns: &[(&str, Cells<'_>)]) -> Result<Vec<u8>, ParquetError> {
    let arrays = columns
        .iter()
        .map(|(name, cells)| (*name, cells.array(), true));
    let batch = RecordBatch::try_from_iter_with_nullable(arrays)?;
    let mut properties =
        WriterProperties::builder().set_compression(Compression::ZSTD(ZstdLevel::try_new(1)?));
    for (name, cells) in columns {
        if matches!(cells, Cells::Numbers(_)) {
            let name = ::parquet::schema::types::ColumnPath::from(*name);
            properties = properties
                .set_column_dictionary_enabled(name.clone(), false)
                .set_column_encoding(name, Encoding::BYTE_STREAM_SPLIT);
        }
    }
    let mut bytes = Vec::new();
    let mut writer = ArrowWriter::try_new(&mut bytes, batch.schema(), Some(properties.build()))?;
    writer.write(&batch)?;
    writer.close()?;
    Ok(bytes)
}
