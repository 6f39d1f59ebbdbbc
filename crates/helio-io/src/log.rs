//! The log beside camera frames: a table of observations whose spots the frames show.

use crate::error::{IoError, Problem, quoted};
use crate::keys;
use crate::output::KeptCells;
use crate::small::pair;
use crate::table::{Keyed, Naming, Table, TableSource};

/// A table of observations taken apart: where its spots are, and everything else.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub struct ObservationLog {
    /// Right and down of the target's centre \[m\], one a record.
    pub spots_m: Vec<[f64; 2]>,
    /// The other columns, without `u_m`, `v_m`, `sigma_m` and `file`: of a file its cells as they stand there, of a table
    /// in memory what they hold.
    pub columns: Vec<(String, KeptCells)>,
}

/// Takes a table of observations apart (in memory, or CSV; with `u_m` and `v_m` in every row, as `simulate observations`
/// writes it), so that frames can be made of its spots and
/// [`load_observations_with_spots`](crate::load_observations_with_spots) can read the rest.
///
/// # Errors
/// [`IoError`] with file, line and column for an unknown or missing column, a Parquet file, and a record without a
/// spot.
///
/// ```
/// use helio_io::output::KeptCells;
/// let folder = tempfile::tempdir()?;
/// let path = folder.path().join("seen.csv");
/// std::fs::write(&path, "heliostat_id,axis1_deg,u_m,v_m\nA1,12.5,0.25,-1\n")?;
/// let log = helio_io::load_observation_log(&path)?;
/// assert_eq!(log.spots_m, [[0.25, -1.0]]);
/// assert_eq!(log.columns[1], ("axis1_deg".into(), KeptCells::Text(vec!["12.5".into()])));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn load_observation_log<'a>(
    source: impl Into<TableSource<'a>>,
) -> Result<ObservationLog, IoError> {
    let source = source.into();
    let table = Keyed::new(
        Table::read(source)?,
        keys::OBSERVATION_COLUMNS,
        &Naming::default(),
    )?;
    for key in [&keys::SPOT_U, &keys::SPOT_V] {
        if !table.has(key) {
            return Err(table.missing_column(key));
        }
    }
    let rows = table.table().rows();
    let spot = |row| match pair(&table, row, "", &keys::SPOT_U, &keys::SPOT_V)? {
        Some((u_m, v_m)) => Ok([u_m, v_m]),
        None => {
            let problem = Problem::Missing {
                what: "the spot".into(),
                wanted: "a frame of every record is wanted".into(),
            };
            Err(table.error(row, &keys::SPOT_U, None, problem))
        }
    };
    let spots_m = (0..rows).map(spot).collect::<Result<_, IoError>>()?;
    let left = [&keys::SPOT_U, &keys::SPOT_V, &keys::SIGMA, &keys::FRAME].map(|key| key.name);
    let mut columns = Vec::new();
    for (column, name) in table.table().names().iter().enumerate() {
        if left.contains(&name.as_str()) {
            continue;
        }
        let cells = match source {
            TableSource::File(_) => table.table().texts(column).map(KeptCells::Text),
            TableSource::Memory(_) => table.table().kept(column),
        };
        let cells = cells.ok_or_else(|| {
            let message = match source {
                TableSource::File(_) => {
                    "a Parquet table; wanted CSV, whose cells can be passed on as they are".into()
                }
                TableSource::Memory(_) => {
                    format!(
                        "the column {} holds neither text nor numbers nor times",
                        quoted(name)
                    )
                }
            };
            let problem = Problem::Conflict { message };
            IoError::new(table.table().header_place(), problem)
        })?;
        columns.push((name.clone(), cells));
    }
    Ok(ObservationLog { spots_m, columns })
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use arrow::array::{
        ArrayRef, Float64Array, Int64Array, RecordBatch, StringArray, TimestampNanosecondArray,
    };

    use super::*;
    use crate::MemoryTable;
    use crate::output::{Destination, Format, write_columns};

    #[test]
    fn what_is_wrong_is_named() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("seen.csv");
        let refused = |text: &str| {
            std::fs::write(&path, text).unwrap();
            load_observation_log(&path).unwrap_err().to_string()
        };
        assert!(refused("heliostat_id,u_m\nA1,1\n").contains("`v_m`"));
        let without = refused("heliostat_id,u_m,v_m\nA1,1,2\nA1,,\n");
        assert!(
            without.contains("seen.csv:3") && without.contains("the spot"),
            "{without}"
        );
        assert!(refused("heliostat_id,u_m,v_m,axes\nA1,1,2,3\n").contains("`axes`"));
    }

    /// What a table in memory holds goes on as it is, and is written as the cells of a file would be.
    #[test]
    fn a_table_in_memory_keeps_what_it_holds() {
        let text = || Arc::new(StringArray::from(vec![Some("A1"), None])) as ArrayRef;
        let numbers = || Arc::new(Float64Array::from(vec![None, Some(0.1)])) as ArrayRef;
        let times = TimestampNanosecondArray::from(vec![0, 1_000_000_000]).with_timezone("UTC");
        let batch = RecordBatch::try_from_iter([
            ("heliostat_id", text()),
            ("time", Arc::new(times) as ArrayRef),
            ("axis1_deg", numbers()),
            (
                "axis1_steps",
                Arc::new(Int64Array::from(vec![5, -7])) as ArrayRef,
            ),
            (
                "u_m",
                Arc::new(Float64Array::from(vec![1.0, 2.0])) as ArrayRef,
            ),
            (
                "v_m",
                Arc::new(Float64Array::from(vec![-1.0, 0.5])) as ArrayRef,
            ),
        ])
        .unwrap();
        let table = MemoryTable::new("observations", &batch.schema(), &[batch]).unwrap();
        let log = load_observation_log(&table).unwrap();
        assert_eq!(log.spots_m, [[1.0, -1.0], [2.0, 0.5]]);
        let columns: Vec<_> = log
            .columns
            .iter()
            .map(|(name, cells)| (name.as_str(), cells.cells()))
            .collect();
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("log.csv");
        write_columns(Destination::File(path.clone()), Format::Csv, &columns).unwrap();
        assert_eq!(
            std::fs::read_to_string(path).unwrap(),
            "heliostat_id,time,axis1_deg,axis1_steps\nA1,1970-01-01T00:00:00Z,,5\n,1970-01-01T00:00:01Z,0.1,-7\n"
        );
    }
}
