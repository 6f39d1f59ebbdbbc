//! Small tables of names and numbers, written whole: generated layouts.

use std::io::Write;
use std::path::Path;
use std::sync::Arc;

use ::parquet::arrow::ArrowWriter;
use ::parquet::basic::{Compression, Encoding, ZstdLevel};
use ::parquet::errors::ParquetError;
use ::parquet::file::properties::WriterProperties;
use arrow::array::{ArrayRef, Float64Array, RecordBatch, StringArray};

use super::sink::{Piece, Sink};
use super::text::{csv_text, json_text};
use super::{Destination, Format};
use crate::{IoError, Place, Problem};

/// Bytes of text handed over at once.
const PIECE: usize = 1 << 20;

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
    for (name, column) in columns {
        if column.len() != ids.len() {
            let (expected, got) = (ids.len(), column.len());
            let message = format!("table: {name}: expected {expected} entries, got {got}");
            return Err(IoError::new(
                Place::default(),
                Problem::Conflict { message },
            ));
        }
    }
    let mut sink = Sink::open(destination)?;
    match format {
        Format::Parquet => {
            let bytes = parquet_bytes(ids, columns).map_err(|e| refuse(sink.name(), &e))?;
            sink.send(Piece::Owned(bytes))?;
        }
        text => rows(text, ids, columns, &mut sink)?,
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

fn rows(
    format: Format,
    ids: &[String],
    columns: &[(&str, &[f64])],
    sink: &mut Sink,
) -> Result<(), IoError> {
    let mut out = Vec::new();
    let (before, between, after) = match format {
        Format::Csv => {
            let names: Vec<&str> = columns.iter().map(|(name, _)| *name).collect();
            // Writing to a vector cannot fail.
            let _ = writeln!(out, "id,{}", names.join(","));
            ("", "", "\n")
        }
        Format::Json => {
            out.extend_from_slice(b"[\n");
            ("{\"id\":", ",\n", "}")
        }
        _ => ("{\"id\":", "", "}\n"),
    };
    for (row, id) in ids.iter().enumerate() {
        if row > 0 {
            out.extend_from_slice(between.as_bytes());
        }
        out.extend_from_slice(before.as_bytes());
        let csv = format == Format::Csv;
        let id = if csv { csv_text(id) } else { json_text(id) };
        out.extend_from_slice(id.as_bytes());
        for (name, column) in columns {
            if csv {
                out.push(b',');
            } else {
                let _ = write!(out, ",\"{name}\":");
            }
            if column[row].is_finite() {
                let mut text = zmij::Buffer::new();
                out.extend_from_slice(text.format_finite(column[row]).as_bytes());
            } else if !csv {
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

fn parquet_bytes(ids: &[String], columns: &[(&str, &[f64])]) -> Result<Vec<u8>, ParquetError> {
    let names: ArrayRef = Arc::new(StringArray::from_iter_values(ids));
    let numbers = columns.iter().map(|(name, column)| {
        let values = column.iter().map(|v| v.is_finite().then_some(*v));
        let array: ArrayRef = Arc::new(Float64Array::from_iter(values));
        (*name, array)
    });
    let batch = RecordBatch::try_from_iter(std::iter::once(("id", names)).chain(numbers))?;
    let mut properties =
        WriterProperties::builder().set_compression(Compression::ZSTD(ZstdLevel::try_new(1)?));
    for (name, _) in columns {
        let name = ::parquet::schema::types::ColumnPath::from(*name);
        properties = properties
            .set_column_dictionary_enabled(name.clone(), false)
            .set_column_encoding(name, Encoding::BYTE_STREAM_SPLIT);
    }
    let mut bytes = Vec::new();
    let mut writer = ArrowWriter::try_new(&mut bytes, batch.schema(), Some(properties.build()))?;
    writer.write(&batch)?;
    writer.close()?;
    Ok(bytes)
}
