//! Data tables, CSV or Parquet, with the place of every problem.

mod memory;
mod parquet;
mod text;

use std::borrow::Cow;
use std::collections::HashMap;
use std::fs::File;
use std::io::Read;
use std::path::{Path, PathBuf};

pub use self::memory::{MemoryTable, TableSource};
pub use self::parquet::PARQUET_THREAD;

use self::parquet::Columns;
use self::text::Records;
use crate::error::{IoError, Place, Problem, quoted};
use crate::keys::{Key, Kind, names};
use crate::output::KeptCells;
use crate::times;
use crate::toml::check_name;

/// A table in memory: named columns, rows in the order of the file.
#[derive(Debug)]
pub(crate) struct Table {
    path: PathBuf,
    names: Vec<String>,
    rows: usize,
    cells: Cells,
}

#[derive(Debug)]
enum Cells {
    Text(Records),
    Parquet(Columns),
}

impl Table {
    /// Reads a whole table.
    pub(crate) fn read<'a>(source: impl Into<TableSource<'a>>) -> Result<Self, IoError> {
        let table = match source.into() {
            TableSource::File(path) => Self::read_file(path)?,
            TableSource::Memory(table) => Self {
                path: table.name().to_path_buf(),
                names: table.names.clone(),
                rows: table.rows,
                cells: Cells::Parquet(table.columns.clone()),
            },
        };
        table.check_header()?;
        if table.rows == 0 {
            let what = "the table has a header but no rows".to_string();
            return Err(IoError::new(
                Place::file(&table.path),
                Problem::Empty { what },
            ));
        }
        Ok(table)
    }

    /// A file that begins like Parquet is Parquet, whatever its name.
    fn read_file(path: &Path) -> Result<Self, IoError> {
        let mut file = open(path)?;
        let refuse = |error| IoError::read(path, error);
        let mut bytes = Vec::new();
        Read::by_ref(&mut file)
            .take(4)
            .read_to_end(&mut bytes)
            .map_err(refuse)?;
        let suffix = path.extension().map(|s| s.to_string_lossy().to_lowercase());
        let looks_parquet = bytes == b"PAR1";
        let named_parquet = matches!(suffix.as_deref(), Some("parquet" | "pq"));
        let (names, rows, cells) = if looks_parquet || named_parquet {
            let (names, rows, columns) = parquet::read(path, file, looks_parquet)?;
            (names, rows, Cells::Parquet(columns))
        } else {
            file.read_to_end(&mut bytes).map_err(refuse)?;
            let (names, records) = text::read(path, bytes)?;
            (names, records.len(), Cells::Text(records))
        };
        Ok(Self {
            path: path.to_path_buf(),
            names,
            rows,
            cells,
        })
    }

    fn check_header(&self) -> Result<(), IoError> {
        let mut first = HashMap::with_capacity(self.names.len());
        for (index, name) in self.names.iter().enumerate() {
            if let Some(first) = first.insert(name, index) {
                let first = format!("column {}", first + 1);
                let problem = Problem::Duplicate {
                    what: "column",
                    name: name.clone(),
                    first,
                };
                return Err(IoError::new(self.header_place(), problem));
            }
        }
        Ok(())
    }

    pub(crate) fn rows(&self) -> usize {
        self.rows
    }

    pub(crate) fn names(&self) -> &[String] {
        &self.names
    }

    pub(crate) fn path(&self) -> &Path {
        &self.path
    }

    /// Line of each row of a text file.
    pub(crate) fn lines(&self) -> Option<&[usize]> {
        match &self.cells {
            Cells::Text(records) => Some(records.lines()),
            Cells::Parquet(_) => None,
        }
    }

    /// The header: line 1 of a CSV file.
    pub(crate) fn header_place(&self) -> Place {
        let line = matches!(self.cells, Cells::Text(_)).then_some(1);
        Place {
            line,
            ..Place::file(&self.path)
        }
    }

    /// A row, and the heliostat it is about if that is known.
    pub(crate) fn place(&self, row: usize, heliostat: Option<&str>) -> Place {
        let mut place = Place::file(&self.path);
        match &self.cells {
            Cells::Text(records) => place.line = Some(records.line(row)),
            Cells::Parquet(_) => place.row = Some(row + 1),
        }
        place.heliostat = heliostat.filter(|id| !id.is_empty()).map(str::to_string);
        place
    }

    /// Where a row stands, in words.
    pub(crate) fn position(&self, row: usize) -> String {
        match &self.cells {
            Cells::Text(records) => format!("line {}", records.line(row)),
            Cells::Parquet(_) => format!("row {}", row + 1),
        }
    }

    /// Cells of a column of a text file as they stand there; nothing of Parquet.
    pub(crate) fn texts(&self, column: usize) -> Option<Vec<String>> {
        let Cells::Text(records) = &self.cells else {
            return None;
        };
        let cell = |row| records.cell(row, column).to_owned();
        Some((0..self.rows).map(cell).collect())
    }

    /// Cells of a column of a table in memory; nothing of a file of text, nor of a column of a kind that nobody reads.
    pub(crate) fn kept(&self, column: usize) -> Option<KeptCells> {
        match &self.cells {
            Cells::Text(_) => None,
            Cells::Parquet(columns) => columns.kept(column),
        }
    }

    fn cell_error(&self, row: usize, cell: Cell<'_>, problem: Problem) -> IoError {
        let mut place = self.place(row, cell.heliostat);
        place.field = Some(self.names[cell.column].clone());
        IoError::new(place, problem)
    }

    /// The key, where the column itself is named otherwise.
    fn subject(&self, cell: Cell<'_>) -> String {
        if self.names[cell.column] == cell.key.name {
            String::new()
        } else {
            cell.key.name.to_string()
        }
    }

    /// A cell as text without blanks around it; `None` if it is empty.
    fn text(&self, row: usize, cell: Cell<'_>) -> Result<Option<Cow<'_, str>>, IoError> {
        let text = match &self.cells {
            Cells::Text(records) => Some(Cow::Borrowed(records.cell(row, cell.column))),
            Cells::Parquet(columns) => columns.text(row, cell.column).map_err(|found| {
                let time = matches!(cell.key.kind, Kind::Time);
                let wanted = if time {
                    cell.key.wanted()
                } else {
                    "text".to_string()
                };
                let what = self.subject(cell);
                self.cell_error(
                    row,
                    cell,
                    Problem::WrongKind {
                        what,
                        wanted,
                        found,
                    },
                )
            })?,
        };
        Ok(text.filter(|text| !text.is_empty()))
    }

    fn number(&self, row: usize, cell: Cell<'_>) -> Result<Option<f64>, IoError> {
        let wrong = |found: String| {
            let (what, wanted) = (self.subject(cell), "a number".to_string());
            self.cell_error(
                row,
                cell,
                Problem::WrongKind {
                    what,
                    wanted,
                    found,
                },
            )
        };
        let value = match &self.cells {
            Cells::Text(records) => match records.cell(row, cell.column) {
                "" => None,
                text => Some(text.parse::<f64>().map_err(|_| wrong(quoted(text)))?),
            },
            Cells::Parquet(columns) => columns.number(row, cell.column).map_err(wrong)?,
        };
        let Some(value) = value else {
            return Ok(None);
        };
        let what = self.subject(cell);
        cell.key
            .check(&what, value)
            .map(Some)
            .map_err(|p| self.cell_error(row, cell, p))
    }

    fn time(&self, row: usize, cell: Cell<'_>) -> Result<Option<i64>, IoError> {
        if let Cells::Parquet(columns) = &self.cells
            && let Some(time) = columns.time(row, cell.column)
        {
            return Ok(time);
        }
        let Some(text) = self.text(row, cell)? else {
            return Ok(None);
        };
        times::time(&text)
            .map(Some)
            .map_err(|p| self.cell_error(row, cell, p))
    }
}

/// A column of one row on behalf of a key.
#[derive(Clone, Copy)]
struct Cell<'a> {
    column: usize,
    key: &'static Key,
    heliostat: Option<&'a str>,
}

/// A table whose columns are known by key.
#[derive(Debug)]
pub(crate) struct Keyed {
    table: Table,
    keys: &'static [&'static Key],
    /// Column of each key.
    columns: Vec<Option<usize>>,
    synonyms: &'static [(&'static str, &'static str)],
}

/// How the columns of a table are named.
#[derive(Default)]
pub(crate) struct Naming<'a> {
    /// Our name and the table's.
    pub(crate) renames: &'a [(&'a str, &'a str)],
    /// Other names accepted for ours.
    pub(crate) synonyms: &'static [(&'static str, &'static str)],
    /// True for columns to leave aside.
    pub(crate) ignore: Option<&'a dyn Fn(&str) -> bool>,
    /// How to get rid of an unknown column, for the message.
    pub(crate) advice: &'a str,
}

impl Keyed {
    /// Finds the column of each key; every column must be one's own, ignored, or required.
    pub(crate) fn new(
        table: Table,
        keys: &'static [&'static Key],
        naming: &Naming<'_>,
    ) -> Result<Self, IoError> {
        let mut columns: Vec<Option<usize>> = vec![None; keys.len()];
        let conflict = |message| IoError::new(table.header_place(), Problem::Conflict { message });
        for (index, name) in table.names().iter().enumerate() {
            if naming.ignore.is_some_and(|ignore| ignore(name)) {
                continue;
            }
            let renamed = naming.renames.iter().find(|(_, foreign)| foreign == name);
            let synonym = naming.synonyms.iter().find(|(other, _)| other == name);
            let ours = match (renamed, synonym) {
                (Some((ours, _)), _) => *ours,
                (None, Some((_, ours))) => *ours,
                (None, None) => name.as_str(),
            };
            let Some(key) = keys.iter().position(|key| key.name == ours) else {
                return Err(unknown_column(&table, index, keys, naming));
            };
            if let Some(first) = columns[key] {
                let (first, second) = (quoted(&table.names()[first]), quoted(name));
                let message = format!(
                    "columns {first} and {second} both mean {}; ignore one",
                    keys[key].name
                );
                return Err(conflict(message));
            }
            columns[key] = Some(index);
        }
        let keyed = Self {
            table,
            keys,
            columns,
            synonyms: naming.synonyms,
        };
        for key in keys {
            if key.required && !keyed.has(key) {
                return Err(keyed.missing_column(key));
            }
        }
        Ok(keyed)
    }

    /// A column is needed that is not there.
    pub(crate) fn missing_column(&self, key: &Key) -> IoError {
        let nearest =
            crate::error::nearest(key.name, self.table.names().iter().map(String::as_str))
                .filter(|name| names(self.keys).all(|known| known != name));
        let about = match nearest {
            Some(name) => format!("is it {}?", quoted(&name)),
            None => key.about.trim_end_matches('.').to_lowercase(),
        };
        let mut what = format!("column {}", quoted(key.name));
        for (other, ours) in self.synonyms {
            if *ours == key.name {
                what += &format!(" (or {})", quoted(other));
            }
        }
        IoError::new(
            self.table.header_place(),
            Problem::Missing {
                what,
                wanted: about,
            },
        )
    }

    pub(crate) fn table(&self) -> &Table {
        &self.table
    }

    fn column(&self, key: &Key) -> Option<usize> {
        // Keys are statics: each is itself and no other, and this runs for every cell.
        let index = self
            .keys
            .iter()
            .position(|known| std::ptr::eq(*known, key))?;
        self.columns[index]
    }

    pub(crate) fn has(&self, key: &Key) -> bool {
        self.column(key).is_some()
    }

    fn cell<'a>(&self, key: &'static Key, heliostat: Option<&'a str>) -> Option<Cell<'a>> {
        Some(Cell {
            column: self.column(key)?,
            key,
            heliostat,
        })
    }

    /// The heliostat's name in a row.
    pub(crate) fn id(&self, row: usize, key: &'static Key) -> Result<Cow<'_, str>, IoError> {
        let Some(cell) = self.cell(key, None) else {
            return Err(self.missing_column(key));
        };
        let name = self.table.text(row, cell)?.unwrap_or_default();
        check_name("id", &name).map_err(|problem| self.table.cell_error(row, cell, problem))?;
        Ok(name)
    }

    /// A text cell; `None` if there is no such column or the cell is empty.
    pub(crate) fn text(
        &self,
        row: usize,
        key: &'static Key,
        heliostat: &str,
    ) -> Result<Option<Cow<'_, str>>, IoError> {
        match self.cell(key, Some(heliostat)) {
            Some(cell) => self.table.text(row, cell),
            None => Ok(None),
        }
    }

    /// A number in its key's range; `None` if there is no such column or the cell is empty.
    pub(crate) fn number(
        &self,
        row: usize,
        key: &'static Key,
        heliostat: Option<&str>,
    ) -> Result<Option<f64>, IoError> {
        match self.cell(key, heliostat) {
            Some(cell) => self.table.number(row, cell),
            None => Ok(None),
        }
    }

    /// A number that must be there.
    pub(crate) fn needed(
        &self,
        row: usize,
        key: &'static Key,
        heliostat: Option<&str>,
    ) -> Result<f64, IoError> {
        let Some(cell) = self.cell(key, heliostat) else {
            return Err(self.missing_column(key));
        };
        self.table.number(row, cell)?.ok_or_else(|| {
            let wanted = key.wanted();
            let (what, found) = (self.table.subject(cell), "an empty cell".to_string());
            self.table.cell_error(
                row,
                cell,
                Problem::WrongKind {
                    what,
                    wanted,
                    found,
                },
            )
        })
    }

    pub(crate) fn time(
        &self,
        row: usize,
        key: &'static Key,
        heliostat: &str,
    ) -> Result<Option<i64>, IoError> {
        match self.cell(key, Some(heliostat)) {
            Some(cell) => self.table.time(row, cell),
            None => Ok(None),
        }
    }

    /// A problem with a cell, or with the row if there is no such column.
    pub(crate) fn error(
        &self,
        row: usize,
        key: &'static Key,
        heliostat: Option<&str>,
        problem: Problem,
    ) -> IoError {
        match self.cell(key, heliostat) {
            Some(cell) => self.table.cell_error(row, cell, problem),
            None => IoError::new(self.table.place(row, heliostat), problem),
        }
    }

    /// A problem with a row.
    pub(crate) fn row_error(&self, row: usize, heliostat: &str, problem: Problem) -> IoError {
        IoError::new(self.table.place(row, Some(heliostat)), problem)
    }
}

fn unknown_column(
    table: &Table,
    index: usize,
    keys: &'static [&'static Key],
    naming: &Naming<'_>,
) -> IoError {
    let name = &table.names()[index];
    let problem = if name.is_empty() {
        let advice = match naming.advice {
            "" => "",
            advice if advice.contains("[observations]") => {
                "; leave it aside by ignore = [\"\"] in [observations]"
            }
            _ => "; leave it aside by ignore = [\"\"] in [heliostats]",
        };
        Problem::Conflict {
            message: format!("column {} has no name{advice}", index + 1),
        }
    } else if name.contains("azimuth") && name.contains("south") {
        let message = format!(
            "column {} counts from south; azimuths here count clockwise from north \
             (180 - it, if it grows toward east)",
            quoted(name)
        );
        Problem::Conflict { message }
    } else if let [single] = table.names()
        && let Some(separator) = [';', '\t', '|'].into_iter().find(|c| single.contains(*c))
    {
        let message = format!(
            "the columns seem to be separated by {}; separate them by commas",
            quoted(&separator.to_string())
        );
        Problem::Conflict { message }
    } else {
        let mut problem = Problem::unknown("column", name, names(keys));
        if let Problem::Unknown {
            nearest: None,
            advice,
            ..
        } = &mut problem
        {
            *advice = naming.advice.to_string();
        }
        problem
    };
    IoError::new(table.header_place(), problem)
}

/// Opens a file; a folder opens on some systems and fails only when read.
fn open(path: &Path) -> Result<File, IoError> {
    if path.is_dir() {
        return Err(IoError::read(path, std::io::ErrorKind::IsADirectory.into()));
    }
    File::open(path).map_err(|error| IoError::read(path, error))
}

/// The text of a UTF-8 file, without a byte-order mark.
pub(crate) fn read_text(path: &Path) -> Result<String, IoError> {
    let mut bytes = Vec::new();
    open(path)?
        .read_to_end(&mut bytes)
        .map_err(|error| IoError::read(path, error))?;
    decode(path, bytes)
}

fn decode(path: &Path, mut bytes: Vec<u8>) -> Result<String, IoError> {
    if bytes.starts_with(b"\xEF\xBB\xBF") {
        bytes.drain(..3);
    }
    String::from_utf8(bytes).map_err(|error| {
        let at = error.utf8_error().valid_up_to();
        let bytes = error.as_bytes();
        let utf16 = bytes.starts_with(b"\xFF\xFE") || bytes.starts_with(b"\xFE\xFF");
        let hint = if utf16 {
            "it looks like UTF-16"
        } else {
            "it may be Latin-1"
        };
        let start = bytes[..at]
            .iter()
            .rposition(|byte| *byte == b'\n')
            .map_or(0, |at| at + 1);
        let line = bytes[..at].iter().filter(|byte| **byte == b'\n').count() + 1;
        let column = String::from_utf8_lossy(&bytes[start..at]).chars().count() + 1;
        let place = Place {
            line: Some(line),
            column: Some(column),
            ..Place::file(path)
        };
        let hint = format!("{hint}; save it as UTF-8");
        IoError::new(
            place,
            Problem::NotUtf8 {
                byte: bytes[at],
                hint,
            },
        )
    })
}
