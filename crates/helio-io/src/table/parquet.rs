//! Parquet.

use std::borrow::Cow;
use std::fs::File;
use std::path::Path;
use std::thread::{Builder, JoinHandle};

use arrow::array::{
    Array, ArrayRef, Float64Array, Int64Array, RecordBatch, StringArray, TimestampNanosecondArray,
};
use arrow::compute::{CastOptions, cast_with_options, concat};
use arrow::datatypes::{DataType, SchemaRef, TimeUnit};
use arrow::util::display::FormatOptions;
use parquet::arrow::arrow_reader::ParquetRecordBatchReaderBuilder;

use crate::error::{IoError, Place, Problem};

/// Name of the thread that reads Parquet tables. The `parquet` crate panics on some damaged files;
/// that is caught and reported as [`Problem::Syntax`], and a program whose panic hook passes over
/// threads of this name says nothing else about it.
pub const PARQUET_THREAD: &str = "helio-parquet";

/// The columns of a Parquet file, or of a table in memory.
#[derive(Debug, Clone)]
pub(super) struct Columns(Vec<Column>);

#[derive(Debug, Clone)]
enum Column {
    Float(Float64Array),
    Integer(Int64Array),
    Text(StringArray),
    Time(TimestampNanosecondArray),
    /// A kind that no key wants, by name.
    Other(String),
}

/// What a column is.
pub(super) enum Arrays<'a> {
    Float(&'a Float64Array),
    Whole(&'a Int64Array),
    Text(&'a StringArray),
    Time(&'a TimestampNanosecondArray),
    Other(&'a str),
}

impl Columns {
    pub(super) fn arrays(&self, column: usize) -> Arrays<'_> {
        match &self.0[column] {
            Column::Float(values) => Arrays::Float(values),
            Column::Integer(values) => Arrays::Whole(values),
            Column::Text(values) => Arrays::Text(values),
            Column::Time(values) => Arrays::Time(values),
            Column::Other(kind) => Arrays::Other(kind),
        }
    }

    /// A text or a whole number, nothing for a number that is none; otherwise what was found.
    pub(super) fn text(&self, row: usize, column: usize) -> Result<Option<Cow<'_, str>>, String> {
        match &self.0[column] {
            Column::Text(values) => Ok(values
                .is_valid(row)
                .then(|| Cow::Borrowed(values.value(row).trim()))),
            Column::Integer(values) => Ok(values
                .is_valid(row)
                .then(|| Cow::Owned(values.value(row).to_string()))),
            // What pandas makes of a column of text without any.
            Column::Float(values) if values.is_null(row) || values.value(row).is_nan() => Ok(None),
            Column::Float(_) => Err("a column of fractional numbers".into()),
            Column::Time(_) => Err("a column of times".into()),
            Column::Other(kind) => Err(format!("a column of type {kind}")),
        }
    }

    /// A number; otherwise what was found.
    pub(super) fn number(&self, row: usize, column: usize) -> Result<Option<f64>, String> {
        match &self.0[column] {
            Column::Float(values) => Ok(values.is_valid(row).then(|| values.value(row))),
            Column::Integer(values) => Ok(values.is_valid(row).then(|| values.value(row) as f64)),
            Column::Text(values) if values.null_count() == values.len() => Ok(None),
            Column::Text(_) => Err("a column of text".into()),
            Column::Time(_) => Err("a column of times".into()),
            Column::Other(kind) => Err(format!("a column of type {kind}")),
        }
    }

    /// A time \[ns\] from a column of times; `None` if the column holds something else.
    pub(super) fn time(&self, row: usize, column: usize) -> Option<Option<i64>> {
        match &self.0[column] {
            Column::Time(values) => Some(values.is_valid(row).then(|| values.value(row))),
            _ => None,
        }
    }
}

pub(super) fn read(
    path: &Path,
    file: File,
    magic: bool,
) -> Result<(Vec<String>, usize, Columns), IoError> {
    let bad = |message: String| {
        IoError::new(
            Place::file(path),
            Problem::Syntax {
                format: "Parquet",
                message,
            },
        )
    };
    if !magic {
        return Err(bad("the file does not begin with PAR1".into()));
    }
    // The reader of damaged pages runs into its own assertions here and there. A damaged file is no
    // fault of this program and must not end it; the thread's name lets a panic hook keep silent.
    let reader = Builder::new().name(PARQUET_THREAD.to_string());
    let done = reader.spawn(|| pages(file)).map(JoinHandle::join);
    match done {
        Ok(Ok(done)) => {
            done.map_err(|said| bad(said.trim_start_matches("Parquet error: ").to_string()))
        }
        Ok(Err(_)) => Err(bad("its pages are damaged".into())),
        Err(error) => Err(IoError::read(path, error)),
    }
}

/// Names, number of rows and columns; or what the reader said.
fn pages(file: File) -> Result<(Vec<String>, usize, Columns), String> {
    let builder =
        ParquetRecordBatchReaderBuilder::try_new(file).map_err(|error| error.to_string())?;
    let schema = builder.schema().clone();
    let reader = builder.build().map_err(|error| error.to_string())?;
    let mut batches = Vec::new();
    for batch in reader {
        batches.push(batch.map_err(|error| error.to_string())?);
    }
    columns_of(&schema, &batches)
}

/// Names, number of rows and columns of batches; or what is wrong with them.
pub(super) fn columns_of(
    schema: &SchemaRef,
    batches: &[RecordBatch],
) -> Result<(Vec<String>, usize, Columns), String> {
    let rows = batches.iter().map(RecordBatch::num_rows).sum();
    let mut columns = Vec::with_capacity(schema.fields().len());
    for (index, field) in schema.fields().iter().enumerate() {
        let parts: Vec<&dyn Array> = batches.iter().map(|b| b.column(index).as_ref()).collect();
        let column = if parts.is_empty() {
            Column::Other(field.data_type().to_string())
        } else {
            let whole = concat(&parts).map_err(|error| error.to_string())?;
            column(&whole).map_err(|error| format!("column {}: {error}", field.name()))?
        };
        columns.push(column);
    }
    let names = schema
        .fields()
        .iter()
        .map(|field| field.name().trim().to_string())
        .collect();
    Ok((names, rows, Columns(columns)))
}

fn column(whole: &ArrayRef) -> Result<Column, arrow::error::ArrowError> {
    // A number that does not fit is an error, not a hole.
    let options = CastOptions {
        safe: false,
        format_options: FormatOptions::default(),
    };
    let to = |kind: &DataType| cast_with_options(whole, kind, &options);
    let inner = match whole.data_type() {
        DataType::Dictionary(_, value) => value.as_ref(),
        kind => kind,
    };
    Ok(match inner {
        DataType::Float16
        | DataType::Float32
        | DataType::Float64
        | DataType::Decimal128(..)
        | DataType::Decimal256(..) => {
            Column::Float(Float64Array::from(to(&DataType::Float64)?.to_data()))
        }
        kind if kind.is_integer() || *kind == DataType::Boolean => {
            Column::Integer(Int64Array::from(to(&DataType::Int64)?.to_data()))
        }
        DataType::Utf8 | DataType::LargeUtf8 | DataType::Utf8View | DataType::Null => {
            Column::Text(StringArray::from(to(&DataType::Utf8)?.to_data()))
        }
        // A time without a zone is not a time.
        DataType::Timestamp(_, Some(_)) => {
            let utc = DataType::Timestamp(TimeUnit::Nanosecond, Some("UTC".into()));
            Column::Time(TimestampNanosecondArray::from(to(&utc)?.to_data()))
        }
        // Nothing in it is anything: an empty column of pandas has this type.
        DataType::Timestamp(_, None) if whole.null_count() == whole.len() => {
            Column::Text(StringArray::new_null(whole.len()))
        }
        DataType::Timestamp(_, None) => Column::Other("time without a zone".into()),
        kind => Column::Other(kind.to_string()),
    })
}
