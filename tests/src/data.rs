//! The shared data folder and its tables.

use std::path::PathBuf;

/// The folder in HELIO_DATA; without it says that the test `name` is skipped.
#[must_use]
pub fn folder(name: &str) -> Option<PathBuf> {
    let Some(folder) = std::env::var_os("HELIO_DATA") else {
        eprintln!("skipped: HELIO_DATA is not set ({name})");
        return None;
    };
    Some(PathBuf::from(folder))
}

/// A comma-separated table without quotes.
#[derive(Debug, Clone)]
pub struct Table {
    path: PathBuf,
    header: Vec<String>,
    rows: Vec<Vec<String>>,
}

impl Table {
    /// Reads a file.
    ///
    /// # Panics
    /// If it is not there or a row is ragged.
    #[must_use]
    pub fn read(path: PathBuf) -> Self {
        let text = std::fs::read_to_string(&path)
            .unwrap_or_else(|error| panic!("{}: {error}", path.display()));
        let text = text.trim_start_matches('\u{feff}');
        let cells = |line: &str| {
            line.split(',')
                .map(|c| c.trim().to_owned())
                .collect::<Vec<_>>()
        };
        let mut lines = text.lines().filter(|line| !line.trim().is_empty());
        let header = cells(lines.next().unwrap_or_default());
        let rows: Vec<_> = lines.map(cells).collect();
        for (row, cells) in rows.iter().enumerate() {
            assert_eq!(cells.len(), header.len(), "{} row {row}", path.display());
        }
        Self { path, header, rows }
    }

    /// Number of rows.
    #[must_use]
    pub fn len(&self) -> usize {
        self.rows.len()
    }

    /// True if there is none.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.rows.is_empty()
    }

    /// True if there is such a column.
    #[must_use]
    pub fn has(&self, column: &str) -> bool {
        self.header.iter().any(|h| h == column)
    }

    /// A cell.
    ///
    /// # Panics
    /// If there is no such column.
    #[must_use]
    pub fn text(&self, row: usize, column: &str) -> &str {
        let Some(index) = self.header.iter().position(|h| h == column) else {
            panic!("{}: no column {column}", self.path.display());
        };
        &self.rows[row][index]
    }

    /// A number.
    ///
    /// # Panics
    /// If the cell is not one.
    #[must_use]
    pub fn number(&self, row: usize, column: &str) -> f64 {
        let text = self.text(row, column);
        text.parse()
            .unwrap_or_else(|_| panic!("{} row {row}: {column} is {text:?}", self.path.display()))
    }
}
