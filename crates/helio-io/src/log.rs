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
    use super::*;

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
}
