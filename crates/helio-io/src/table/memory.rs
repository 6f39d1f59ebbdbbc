//! Tables that somebody has in memory already.

use std::path::{Path, PathBuf};

use arrow::array::RecordBatch;
use arrow::datatypes::SchemaRef;

use super::parquet::{Arrays, Columns, columns_of};
use crate::error::{IoError, Place, Problem};
use crate::hash::Sha256;
use crate::output::KeptCells;

/// A table in memory, as Arrow has it, to be read as if it were a file.
///
/// Messages call it by a name of the caller's choice and count its rows from 1, as those of Parquet files.
///
/// ```
/// use std::sync::Arc;
/// use arrow::array::{Float64Array, RecordBatch, StringArray};
/// use helio_io::{MemoryTable, load_spots};
/// let batch = RecordBatch::try_from_iter([
///     ("file", Arc::new(StringArray::from(vec!["a.png"])) as _),
///     ("u_m", Arc::new(Float64Array::from(vec![0.5])) as _),
///     ("v_m", Arc::new(Float64Array::from(vec![-0.25])) as _),
///     ("status", Arc::new(StringArray::from(vec!["ok"])) as _),
/// ])?;
/// let table = MemoryTable::new("spots", &batch.schema(), &[batch])?;
/// assert_eq!(load_spots(&table)?.rows[0].at_m, Some([0.5, -0.25]));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Debug, Clone)]
pub struct MemoryTable {
    name: PathBuf,
    pub(super) names: Vec<String>,
    pub(super) rows: usize,
    pub(super) columns: Columns,
    hash: String,
}

impl MemoryTable {
    /// A table of these batches, which all have this schema; `name` is what messages call it.
    ///
    /// # Errors
    /// [`Problem::Syntax`] for a number that does not fit into what it would be read as.
    pub fn new(name: &str, schema: &SchemaRef, batches: &[RecordBatch]) -> Result<Self, IoError> {
        let name = PathBuf::from(name);
        let (names, rows, columns) = columns_of(schema, batches).map_err(|message| {
            let format = "Arrow";
            IoError::new(Place::file(&name), Problem::Syntax { format, message })
        })?;
        let hash = hash_of(&names, rows, &columns);
        Ok(Self {
            name,
            names,
            rows,
            columns,
            hash,
        })
    }

    /// SHA-256 of its names and cells, however they are cut into batches and encoded.
    #[must_use]
    pub fn hash(&self) -> &str {
        &self.hash
    }

    /// What messages call it.
    #[must_use]
    pub fn name(&self) -> &Path {
        &self.name
    }
}

fn hash_of(names: &[String], rows: usize, columns: &Columns) -> String {
    let mut hash = Sha256::default();
    hash.update(&(rows as u64).to_le_bytes());
    for (index, name) in names.iter().enumerate() {
        hash.update(name.as_bytes());
        hash.update(&[0]);
        columns.hash(index, &mut hash);
    }
    hash.finish()
}

/// Where a table is read from: a file, CSV or Parquet, or memory.
///
/// Whatever takes one takes a path too.
#[derive(Debug, Clone, Copy)]
pub enum TableSource<'a> {
    /// A file.
    File(&'a Path),
    /// A table in memory.
    Memory(&'a MemoryTable),
}

impl<'a> TableSource<'a> {
    /// The file, or what a table in memory is called.
    #[must_use]
    pub fn path(self) -> &'a Path {
        match self {
            Self::File(path) => path,
            Self::Memory(table) => table.name(),
        }
    }

    /// SHA-256 of the file, or of what is in memory.
    ///
    /// # Errors
    /// [`IoError`] if a file cannot be read.
    pub fn hash(self) -> Result<String, IoError> {
        match self {
            Self::File(path) => crate::hash::hash_file(path),
            Self::Memory(table) => Ok(table.hash().to_owned()),
        }
    }
}

impl<'a> From<&'a Path> for TableSource<'a> {
    fn from(path: &'a Path) -> Self {
        Self::File(path)
    }
}

impl<'a> From<&'a PathBuf> for TableSource<'a> {
    fn from(path: &'a PathBuf) -> Self {
        Self::File(path)
    }
}

impl<'a> From<&'a MemoryTable> for TableSource<'a> {
    fn from(table: &'a MemoryTable) -> Self {
        Self::Memory(table)
    }
}

impl Columns {
    /// The cells of a column; none of a kind that no key wants.
    pub(super) fn kept(&self, column: usize) -> Option<KeptCells> {
        Some(match self.arrays(column) {
            Arrays::Float(values) => {
                KeptCells::Numbers(values.iter().map(|v| v.unwrap_or(f64::NAN)).collect())
            }
            Arrays::Whole(values) => KeptCells::Whole(values.iter().collect()),
            Arrays::Time(values) => KeptCells::Times(values.iter().collect()),
            Arrays::Text(values) => {
                KeptCells::Text(values.iter().map(|v| v.unwrap_or("").to_owned()).collect())
            }
            Arrays::Other(_) => return None,
        })
    }

    /// Takes the cells of a column in, where each is and what it is.
    fn hash(&self, column: usize, hash: &mut Sha256) {
        let mut add = |there: bool, bytes: &[u8]| {
            hash.update(&[u8::from(there)]);
            hash.update(bytes);
        };
        match self.arrays(column) {
            Arrays::Float(values) => {
                values
                    .iter()
                    .for_each(|v| add(v.is_some(), &v.unwrap_or(0.0).to_le_bytes()));
            }
            Arrays::Whole(values) => {
                values
                    .iter()
                    .for_each(|v| add(v.is_some(), &v.unwrap_or(0).to_le_bytes()));
            }
            Arrays::Time(values) => {
                values
                    .iter()
                    .for_each(|v| add(v.is_some(), &v.unwrap_or(0).to_le_bytes()));
            }
            Arrays::Text(values) => values.iter().for_each(|v| {
                let text = v.unwrap_or("");
                add(v.is_some(), &(text.len() as u64).to_le_bytes());
                add(true, text.as_bytes());
            }),
            Arrays::Other(kind) => add(false, kind.as_bytes()),
        }
    }
}
