//! The table of spots: what cameras saw on their targets, frame by frame.

use std::path::PathBuf;

use helio_spot::SpotStatus;

use crate::error::{IoError, Problem, quoted};
use crate::keys::{self, Key};
use crate::output::{Cells, Destination, Format, write_columns};
use crate::small::pair;
use crate::table::{Keyed, Naming, Table, TableSource};

/// The word in the column `status` of frames that could not be read.
const UNREADABLE: &str = "unreadable";

/// What became of a frame.
#[derive(Debug, Clone, PartialEq)]
pub struct SpotRow {
    /// The frame's file; for video its number, as `frame 17`.
    pub file: String,
    /// When it was taken \[ns of Unix time\], where that is known.
    pub unix_ns: Option<i64>,
    /// Gray value from which on a pixel belongs to the spot.
    pub threshold: Option<u32>,
    /// Pixels of the spot.
    pub area_px: Option<u64>,
    /// Side of the window \[px\].
    pub window_px: Option<u32>,
    /// Row and column of the standard's centre, as its (A.4) has them but counted from 0; of other methods the middle of
    /// the spot.
    pub row_column: Option<[f64; 2]>,
    /// Where the place on the target is seen: `[x_px, y_px]`; of the standard the middle of the window.
    pub at_px: Option<[f64; 2]>,
    /// Where it is on the target: `[u_m, v_m]`.
    pub at_m: Option<[f64; 2]>,
    /// One standard deviation of either component \[m\].
    pub sigma_m: Option<f64>,
    /// What else is to be known, in words with a blank between them.
    pub flags: String,
    /// The status; none for a frame that could not be read.
    pub status: Option<SpotStatus>,
    /// Why a frame could not be read, or why its target was not found.
    pub reason: String,
}

impl SpotRow {
    /// A frame that could not be read.
    #[must_use]
    pub fn unreadable(file: String, unix_ns: Option<i64>, reason: String) -> Self {
        Self {
            reason,
            ..Self::without_position(file, unix_ns, None)
        }
    }

    /// A frame without a position.
    #[must_use]
    pub fn without_position(
        file: String,
        unix_ns: Option<i64>,
        status: Option<SpotStatus>,
    ) -> Self {
        Self {
            file,
            unix_ns,
            threshold: None,
            area_px: None,
            window_px: None,
            row_column: None,
            at_px: None,
            at_m: None,
            sigma_m: None,
            flags: String::new(),
            status,
            reason: String::new(),
        }
    }

    /// The word in the column `status`.
    #[must_use]
    pub const fn status_word(&self) -> &'static str {
        match self.status {
            Some(status) => status.as_str(),
            None => UNREADABLE,
        }
    }
}

/// Writes a table of spots: columns `file, time` (where any is known), `threshold, area_px, window_px, row, column,
/// x_px, y_px, u_m, v_m, sigma_m, flags, status, reason`; the number of its bytes.
///
/// # Errors
/// [`IoError`] if it cannot be written; there is then no file.
pub fn write_spots(
    destination: Destination,
    format: Format,
    rows: &[SpotRow],
) -> Result<u64, IoError> {
    fn column<T>(rows: &[SpotRow], of: impl Fn(&SpotRow) -> T) -> Vec<T> {
        rows.iter().map(of).collect()
    }
    let number = |of: fn(&SpotRow) -> Option<f64>| column(rows, |row| of(row).unwrap_or(f64::NAN));
    let files = column(rows, |row| row.file.clone());
    let times = column(rows, |row| row.unix_ns);
    let threshold = column(rows, |row| row.threshold.map(i64::from));
    let area_px = column(rows, |row| row.area_px.and_then(|n| i64::try_from(n).ok()));
    let window_px = column(rows, |row| row.window_px.map(i64::from));
    let row_px = number(|row| row.row_column.map(|at| at[0]));
    let column_px = number(|row| row.row_column.map(|at| at[1]));
    let x_px = number(|row| row.at_px.map(|at| at[0]));
    let y_px = number(|row| row.at_px.map(|at| at[1]));
    let (u_m, v_m) = (
        number(|row| row.at_m.map(|at| at[0])),
        number(|row| row.at_m.map(|at| at[1])),
    );
    let sigma_m = number(|row| row.sigma_m);
    let flags = column(rows, |row| row.flags.clone());
    let status = column(rows, |row| row.status_word().to_owned());
    let reason = column(rows, |row| row.reason.clone());
    let mut columns = vec![("file", Cells::Text(&files))];
    if times.iter().any(Option::is_some) {
        columns.push(("time", Cells::Times(&times)));
    }
    columns.extend([
        ("threshold", Cells::Whole(&threshold)),
        ("area_px", Cells::Whole(&area_px)),
        ("window_px", Cells::Whole(&window_px)),
        ("row", Cells::Numbers(&row_px)),
        ("column", Cells::Numbers(&column_px)),
        ("x_px", Cells::Numbers(&x_px)),
        ("y_px", Cells::Numbers(&y_px)),
        ("u_m", Cells::Numbers(&u_m)),
        ("v_m", Cells::Numbers(&v_m)),
        ("sigma_m", Cells::Numbers(&sigma_m)),
        ("flags", Cells::Text(&flags)),
        ("status", Cells::Text(&status)),
        ("reason", Cells::Text(&reason)),
    ]);
    write_columns(destination, format, &columns)
}

/// A table of spots and where in the file each stands.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub struct SpotTable {
    /// The file.
    pub path: PathBuf,
    /// In the order of the file.
    pub rows: Vec<SpotRow>,
    /// Lines of a text file.
    lines: Option<Vec<usize>>,
}

impl SpotTable {
    /// Where a row stands, in words: `line 12`, or `row 11` of a Parquet file.
    ///
    /// # Panics
    /// If the file has no such row.
    #[must_use]
    pub fn position(&self, row: usize) -> String {
        match &self.lines {
            Some(lines) => format!("line {}", lines[row]),
            None => format!("row {}", row + 1),
        }
    }
}

/// Reads a table of spots, CSV or Parquet, as [`write_spots`] writes it; wanted are `file`, `u_m`, `v_m` and `status`.
///
/// # Errors
/// [`IoError`] with file, line (row) and column for an unknown or missing column, a time without an offset, a number
/// that is none, half a position, a status nobody knows, and one with a position that has none.
///
/// ```
/// let folder = tempfile::tempdir()?;
/// let path = folder.path().join("spots.csv");
/// std::fs::write(&path, "file,u_m,v_m,sigma_m,status\na.png,0.5,-0.25,0.01,ok\nb.png,,,,empty\n")?;
/// let spots = helio_io::load_spots(&path)?;
/// assert_eq!(spots.rows[0].at_m, Some([0.5, -0.25]));
/// assert_eq!(spots.rows[1].status_word(), "empty");
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn load_spots<'a>(table: impl Into<TableSource<'a>>) -> Result<SpotTable, IoError> {
    let source = table.into();
    let table = Keyed::new(Table::read(source)?, keys::SPOT_COLUMNS, &Naming::default())?;
    for key in [
        &keys::SPOT_FILE,
        &keys::SPOT_U,
        &keys::SPOT_V,
        &keys::SPOT_STATUS,
    ] {
        if !table.has(key) {
            return Err(table.missing_column(key));
        }
    }
    let rows = (0..table.table().rows())
        .map(|row| read_row(&table, row))
        .collect::<Result<_, _>>()?;
    Ok(SpotTable {
        path: source.path().to_path_buf(),
        rows,
        lines: table.table().lines().map(<[usize]>::to_vec),
    })
}

fn read_row(table: &Keyed, row: usize) -> Result<SpotRow, IoError> {
    let text = |key: &'static Key| {
        let text = table.text(row, key, "")?;
        Ok::<_, IoError>(text.map(std::borrow::Cow::into_owned).unwrap_or_default())
    };
    let two = |first: &'static Key, second: &'static Key| pair(table, row, "", first, second);
    let whole = |key: &'static Key| {
        let Some(number) = table.number(row, key, None)? else {
            return Ok(None);
        };
        if number < 0.0 || number.fract() != 0.0 {
            let problem = Problem::WrongKind {
                what: String::new(),
                wanted: "a whole number of 0 or more".into(),
                found: number.to_string(),
            };
            return Err(table.error(row, key, None, problem));
        }
        Ok(Some(number as u64))
    };
    let small = |key| Ok::<_, IoError>(whole(key)?.and_then(|n| u32::try_from(n).ok()));
    let word = text(&keys::SPOT_STATUS)?;
    let status = SpotStatus::ALL
        .into_iter()
        .find(|status| status.as_str() == word);
    if status.is_none() && word != UNREADABLE {
        let words = SpotStatus::ALL.map(SpotStatus::as_str).into_iter();
        let problem = Problem::unknown("status", &word, words.chain([UNREADABLE]));
        return Err(table.error(row, &keys::SPOT_STATUS, None, problem));
    }
    let both = |pair: Option<(f64, f64)>| pair.map(|(one, two)| [one, two]);
    let at_m = both(two(&keys::SPOT_U, &keys::SPOT_V)?);
    if at_m.is_none() && status.is_some_and(SpotStatus::has_position) {
        let message = format!("empty, though the status is {}", quoted(&word));
        return Err(table.error(row, &keys::SPOT_U, None, Problem::Conflict { message }));
    }
    let row_column = both(two(&keys::SPOT_ROW, &keys::SPOT_COLUMN)?);
    let at_px = both(two(&keys::SPOT_X, &keys::SPOT_Y)?);
    Ok(SpotRow {
        file: text(&keys::SPOT_FILE)?,
        unix_ns: table.time(row, &keys::TIME, "")?,
        threshold: small(&keys::SPOT_THRESHOLD)?,
        area_px: whole(&keys::SPOT_AREA)?,
        window_px: small(&keys::SPOT_WINDOW)?,
        row_column,
        at_px,
        at_m,
        sigma_m: table.number(row, &keys::SPOT_SIGMA, None)?,
        flags: text(&keys::SPOT_FLAGS)?,
        status,
        reason: text(&keys::SPOT_REASON)?,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn rows() -> Vec<SpotRow> {
        vec![
            SpotRow {
                threshold: Some(141),
                area_px: Some(70_000),
                window_px: Some(266),
                row_column: Some([641.0, 812.75]),
                at_px: Some([812.25, 640.5]),
                at_m: Some([0.1, -1.0 / 3.0]),
                sigma_m: Some(0.0125),
                flags: "saturated several".into(),
                unix_ns: Some(1_700_000_000_040_000_000),
                ..SpotRow::without_position("a, b.png".into(), None, Some(SpotStatus::Ok))
            },
            SpotRow::without_position("c.png".into(), None, Some(SpotStatus::Empty)),
            SpotRow::unreadable("d.png".into(), None, "no picture: \"text\"".into()),
        ]
    }

    #[test]
    fn what_is_written_is_read() {
        let folder = tempfile::tempdir().unwrap();
        for (name, format) in [("s.csv", Format::Csv), ("s.parquet", Format::Parquet)] {
            let path = folder.path().join(name);
            write_spots(Destination::File(path.clone()), format, &rows()).unwrap();
            let read = load_spots(&path).unwrap();
            assert_eq!(read.rows, rows());
            let third = read.position(2);
            assert!(third == "line 4" || third == "row 3", "{third}");
        }
    }

    #[test]
    fn what_is_wrong_is_named() {
        let folder = tempfile::tempdir().unwrap();
        let refused = |text: &str| {
            let path = folder.path().join("s.csv");
            std::fs::write(&path, text).unwrap();
            load_spots(&path).unwrap_err().to_string()
        };
        let word = refused("file,u_m,v_m,status\na,1,2,sautrated\n");
        assert!(
            word.contains("s.csv:2") && word.contains("did you mean `saturated`?"),
            "{word}"
        );
        assert!(refused("file,u_m,v_m,status\na,,,ok\n").contains("though the status is `ok`"));
        assert!(refused("file,u_m,v_m,status\na,1,,ok\n").contains("though `u_m` is there"));
        assert!(refused("file,u_m,v_m\na,1,2\n").contains("`status`"));
        assert!(refused("file,u_m,v_m,statos\na,1,2,ok\n").contains("did you mean `status`?"));
        assert!(
            refused("file,time,u_m,v_m,status\na,2026-01-01T00:00:00,1,2,ok\n").contains("offset")
        );
        let half = refused("file,u_m,v_m,area_px,status\na,1,2,2.5,ok\n");
        assert!(half.contains("a whole number"), "{half}");
    }
}
