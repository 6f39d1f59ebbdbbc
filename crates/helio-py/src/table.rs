//! Tables in and out: files, Arrow streams of any library, columns.
//!
//! What a value is, and which kind of table goes back, is decided in `helio_py._tables`. Between there and here a table
//! is a list of columns, each a tuple of its name, a word for what it holds, and its cells.

use std::path::PathBuf;
use std::sync::Arc;

use arrow::array::{
    ArrayRef, Float64Array, Int64Array, RecordBatch, RecordBatchReader, StringArray,
    TimestampNanosecondArray,
};
use arrow::datatypes::{Field as ArrowField, Schema};
use arrow::error::ArrowError;
use arrow::ffi_stream::{ArrowArrayStreamReader, FFI_ArrowArrayStream};
use helio_io::output::{Cells, Destination, Format, KeptCells, write_columns};
use helio_io::{MemoryTable, TableSource, write_file};
use numpy::PyReadonlyArray1;
use pyo3::prelude::*;
use pyo3::sync::PyOnceLock;
use pyo3::types::{PyCapsule, PyList};

use crate::array::owned;
use crate::failure::Failure;
use crate::given;
use crate::guard::guarded;

/// A whole number or time that is not there.
const ABSENT: i64 = i64::MIN;

/// A table from Python.
pub(crate) enum Given {
    File(PathBuf),
    Memory(Box<MemoryTable>),
}

impl Given {
    /// What an argument holds; `what` is its name.
    ///
    /// # Errors
    /// `DataTypeError` for what is no table, `ShapeError` for columns that differ in length.
    pub(crate) fn of(value: &Bound<'_, PyAny>, what: &str) -> Result<Self, Failure> {
        static TAKE: PyOnceLock<Py<PyAny>> = PyOnceLock::new();
        let take = TAKE.import(value.py(), "helio_py._tables", "taken")?;
        let taken = take.call1((value, what))?;
        if let Ok(capsule) = taken.cast::<PyCapsule>() {
            return Ok(Self::Memory(Box::new(of_stream(capsule, what)?)));
        }
        if let Ok(columns) = taken.cast::<PyList>() {
            return Ok(Self::Memory(Box::new(of_columns(columns, what)?)));
        }
        Ok(Self::File(taken.extract()?))
    }

    pub(crate) fn source(&self) -> TableSource<'_> {
        match self {
            Self::File(path) => path.into(),
            Self::Memory(table) => table.as_ref().into(),
        }
    }
}

fn bad_arrow(what: &str, error: &ArrowError) -> Failure {
    Failure::of(
        "DataTypeError",
        what,
        format_args!("its Arrow stream cannot be read: {error}"),
    )
}

fn of_stream(capsule: &Bound<'_, PyCapsule>, what: &str) -> Result<MemoryTable, Failure> {
    let refuse = |error: ArrowError| bad_arrow(what, &error);
    let start = capsule.pointer_checked(Some(c"arrow_array_stream"))?;
    // SAFETY: by the PyCapsule protocol a capsule of this name holds such a stream, which is moved out of it here;
    // what is left is an empty one that nobody can read a second time.
    #[allow(unsafe_code)]
    let reader =
        unsafe { ArrowArrayStreamReader::from_raw(start.cast::<FFI_ArrowArrayStream>().as_ptr()) };
    let reader = reader.map_err(refuse)?;
    let schema = reader.schema();
    // pandas' own names for an index without a name.
    let columns: Vec<usize> = schema
        .fields()
        .iter()
        .enumerate()
        .filter(|(_, field)| !field.name().starts_with("__index_level_"))
        .map(|(column, _)| column)
        .collect();
    let schema = Arc::new(schema.project(&columns).map_err(refuse)?);
    let batches = reader
        .map(|batch| batch?.project(&columns))
        .collect::<Result<Vec<RecordBatch>, ArrowError>>()
        .map_err(refuse)?;
    Ok(MemoryTable::new(what, &schema, &batches)?)
}

/// A table of columns as `helio_py._tables` has them.
pub(crate) fn of_columns(columns: &Bound<'_, PyList>, what: &str) -> Result<MemoryTable, Failure> {
    let mut fields = Vec::with_capacity(columns.len());
    let mut arrays = Vec::with_capacity(columns.len());
    for column in columns {
        let (name, holds, cells): (String, String, Bound<'_, PyAny>) = column.extract()?;
        let array = array(&holds, &cells)?;
        fields.push(ArrowField::new(name, array.data_type().clone(), true));
        arrays.push(array);
    }
    let schema = Arc::new(Schema::new(fields));
    if arrays.is_empty() {
        return Ok(MemoryTable::new(what, &schema, &[])?);
    }
    let batch = RecordBatch::try_new(Arc::clone(&schema), arrays);
    let batch = batch.map_err(|error| bad_arrow(what, &error))?;
    Ok(MemoryTable::new(what, &schema, &[batch])?)
}

fn array(holds: &str, cells: &Bound<'_, PyAny>) -> Result<ArrayRef, Failure> {
    let whole = || -> Result<Vec<Option<i64>>, Failure> {
        let cells: PyReadonlyArray1<'_, i64> = cells.extract()?;
        let cells = cells.as_array();
        Ok(cells.iter().map(|&c| (c != ABSENT).then_some(c)).collect())
    };
    Ok(match holds {
        "numbers" => {
            let cells: PyReadonlyArray1<'_, f64> = cells.extract()?;
            let cells = cells.as_array();
            let cells = cells.iter().map(|&c| (!c.is_nan()).then_some(c));
            Arc::new(cells.collect::<Float64Array>())
        }
        "whole" => Arc::new(whole()?.into_iter().collect::<Int64Array>()),
        "times" => {
            let times = whole()?.into_iter().collect::<TimestampNanosecondArray>();
            Arc::new(times.with_timezone("UTC"))
        }
        _ => {
            let cells: Vec<Option<String>> = cells.extract()?;
            Arc::new(cells.into_iter().collect::<StringArray>())
        }
    })
}

/// Texts made between two looks at whether the user wants to stop.
const TEXTS_PER_LOOK: usize = 1 << 16;

fn texts(py: Python<'_>, cells: Vec<String>) -> PyResult<Bound<'_, PyList>> {
    if cells.len() <= TEXTS_PER_LOOK {
        return PyList::new(py, cells);
    }
    let list = PyList::empty(py);
    for (row, cell) in cells.into_iter().enumerate() {
        if row % TEXTS_PER_LOOK == 0 {
            py.check_signals()?;
        }
        list.append(cell)?;
    }
    Ok(list)
}

/// Columns for `helio_py._tables`.
pub(crate) fn handed_out<'py>(
    py: Python<'py>,
    columns: Vec<(String, KeptCells)>,
) -> Result<Bound<'py, PyList>, Failure> {
    let list = PyList::empty(py);
    for (name, cells) in columns {
        let whole = |cells: Vec<Option<i64>>| {
            let cells: Vec<i64> = cells.into_iter().map(|c| c.unwrap_or(ABSENT)).collect();
            let len = cells.len();
            owned(py, cells, &[len])
        };
        let (holds, cells) = match cells {
            KeptCells::Text(cells) => ("text", texts(py, cells)?.into_any()),
            KeptCells::Numbers(cells) => {
                let len = cells.len();
                ("numbers", owned(py, cells, &[len])?)
            }
            KeptCells::Whole(cells) => ("whole", whole(cells)?),
            KeptCells::Times(cells) => ("times", whole(cells)?),
            _ => return Err(Failure::new("InternalError", "a column of an unknown kind")),
        };
        list.append((name, holds, cells))?;
    }
    Ok(list)
}

/// A table of the kind that a keyword `kind` names.
pub(crate) fn given_back<'py>(
    py: Python<'py>,
    columns: Vec<(String, KeptCells)>,
    kind: &str,
) -> Result<Bound<'py, PyAny>, Failure> {
    static CHECKED: PyOnceLock<Py<PyAny>> = PyOnceLock::new();
    static GIVEN_BACK: PyOnceLock<Py<PyAny>> = PyOnceLock::new();
    let checked = CHECKED.import(py, "helio_py._tables", "checked_kind")?;
    let kind = checked.call1((kind,))?;
    let give = GIVEN_BACK.import(py, "helio_py._tables", "given_back")?;
    Ok(give.call1((handed_out(py, columns)?, kind))?)
}

/// Columns as the command line would have written them.
fn kept(columns: &Bound<'_, PyList>) -> Result<Vec<(String, KeptCells)>, Failure> {
    let mut kept = Vec::with_capacity(columns.len());
    for column in columns {
        let (name, holds, cells): (String, String, Bound<'_, PyAny>) = column.extract()?;
        let whole = || -> Result<Vec<Option<i64>>, Failure> {
            let cells: PyReadonlyArray1<'_, i64> = cells.extract()?;
            let cells = cells.as_array();
            Ok(cells.iter().map(|&c| (c != ABSENT).then_some(c)).collect())
        };
        let cells = match holds.as_str() {
            "numbers" => {
                let cells: PyReadonlyArray1<'_, f64> = cells.extract()?;
                KeptCells::Numbers(cells.as_array().to_vec())
            }
            "whole" => KeptCells::Whole(whole()?),
            "times" => KeptCells::Times(whole()?),
            _ => {
                let cells: Vec<Option<String>> = cells.extract()?;
                KeptCells::Text(cells.into_iter().map(Option::unwrap_or_default).collect())
            }
        };
        kept.push((name, cells));
    }
    Ok(kept)
}

/// Writes columns to a file whose suffix chooses the format, as the command line writes its tables.
#[pyfunction]
pub(crate) fn _write_table(
    py: Python<'_>,
    path: &Bound<'_, PyAny>,
    columns: &Bound<'_, PyList>,
) -> PyResult<u64> {
    guarded(|| {
        let path = given::path(path, "path")?;
        let columns = kept(columns)?;
        let format = Format::of_path(&path).ok_or_else(|| {
            let message = format!(
                "{}: the suffix stands for no format; wanted .csv, .parquet, .json or .jsonl",
                path.display()
            );
            Failure::of("OptionError", "path", message)
        })?;
        let cells: Vec<(&str, Cells<'_>)> = columns
            .iter()
            .map(|(name, cells)| {
                let cells = match cells {
                    KeptCells::Text(cells) => Cells::Text(cells),
                    KeptCells::Numbers(cells) => Cells::Numbers(cells),
                    KeptCells::Whole(cells) => Cells::Whole(cells),
                    KeptCells::Times(cells) => Cells::Times(cells),
                    _ => Cells::Text(&[]),
                };
                (name.as_str(), cells)
            })
            .collect();
        Ok(py.detach(|| write_columns(Destination::File(path.clone()), format, &cells))?)
    })
}

/// Writes a text to a file that appears whole or not at all.
#[pyfunction]
pub(crate) fn _write_text(path: &Bound<'_, PyAny>, text: &str) -> PyResult<()> {
    guarded(|| {
        let py = path.py();
        let path = given::path(path, "path")?;
        Ok(py.detach(|| write_file(&path, text.as_bytes()))?)
    })
}
