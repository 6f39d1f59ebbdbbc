//! What is left by pose: a row for each heliostat.

use helio_calib::joint::{AxisCause, Leftover, LeftoverParts};
use helio_core::Field;
use helio_core::angle::radians;

use crate::calibrated::degrees_for;
use crate::error::{IoError, Problem, quoted};
use crate::keys::{ID, Key, Kind};
use crate::output::{Cells, Destination, Format, write_columns};
use crate::small::known_heliostat;
use crate::state::text;
use crate::table::{Keyed, Naming, Table, TableSource};

const fn column(name: &'static str, kind: Kind, about: &'static str) -> Key {
    Key {
        name,
        kind,
        required: true,
        about,
    }
}

/// Larger numbers of any of these columns are a mistake.
const LARGE: f64 = 1e6;
static LENGTH: Key = column(
    "length_deg",
    Kind::Number(1e-6, LARGE),
    "Poses so far apart have little to do with each other.",
);
static AMPLITUDE1: Key = column(
    "amplitude_axis1_mrad",
    Kind::Number(0.0, LARGE),
    "Leftover of axis 1 before anything was seen, one standard deviation.",
);
static AMPLITUDE2: Key = column(
    "amplitude_axis2_mrad",
    Kind::Number(0.0, LARGE),
    "Leftover of axis 2 before anything was seen, one standard deviation.",
);
static MOST: Key = column(
    "most_mrad",
    Kind::Number(1e-6, LARGE),
    "Largest correction of either axis.",
);
static POSES: Key = column(
    "poses_rad",
    Kind::Text,
    "Readings of both axes at some poses, pose by pose.",
);
static TURNS: Key = column(
    "turns_rad",
    Kind::Text,
    "Correction of both readings at these poses, pose by pose.",
);
static ANGLES: Key = column(
    "angles_rad",
    Kind::Text,
    "The angles on which the corrections stand.",
);
static CAUSES: Key = column("causes", Kind::Text, "Causes that the covariance knows.");
static MOVED: Key = column(
    "moved_rad",
    Kind::Text,
    "Angles and causes with leftovers less those without.",
);
static COVARIANCE: Key = column(
    "covariance",
    Kind::Text,
    "Lower triangle of the covariance of angles, causes and leftovers.",
);
static COLUMNS: &[&Key] = &[
    &ID,
    &LENGTH,
    &AMPLITUDE1,
    &AMPLITUDE2,
    &MOST,
    &POSES,
    &TURNS,
    &ANGLES,
    &CAUSES,
    &MOVED,
    &COVARIANCE,
];

/// Writes what is left by pose, a row for each heliostat of `ids`; gives the number of bytes.
///
/// # Errors
/// [`IoError`] where it cannot be written, or the number of names is another.
pub fn write_leftovers(
    destination: Destination,
    format: Format,
    ids: &[String],
    leftovers: &[Leftover],
) -> Result<u64, IoError> {
    let parts: Vec<&LeftoverParts> = leftovers.iter().map(Leftover::parts).collect();
    let numbers = |of: &dyn Fn(&LeftoverParts) -> f64| -> Vec<f64> {
        parts.iter().map(|part| of(part)).collect()
    };
    let texts = |of: &dyn Fn(&LeftoverParts) -> String| -> Vec<String> {
        parts.iter().map(|part| of(part)).collect()
    };
    let length = numbers(&|p| degrees_for(p.length_rad));
    let [first, second] = [0, 1].map(|axis| numbers(&|p| 1e3 * p.amplitude_rad[axis]));
    let most = numbers(&|p| 1e3 * p.most_rad);
    let poses = texts(&|p| text(p.poses_rad.as_flattened()));
    let turns = texts(&|p| text(p.turns_rad.as_flattened()));
    let angles = texts(&|p| text(&p.angles_rad));
    let causes = texts(&|p| {
        let names: Vec<&str> = p.causes.iter().map(|c| c.description().name).collect();
        names.join(" ")
    });
    let moved = texts(&|p| text(&p.moved_rad));
    // for standard deviations alone: nine digits are more than enough of the longest column
    let covariance = texts(&|p| {
        let words: Vec<String> = p.covariance.iter().map(|x| format!("{x:.8e}")).collect();
        words.join(" ")
    });
    let columns = [
        (ID.name, Cells::Text(ids)),
        (LENGTH.name, Cells::Numbers(&length)),
        (AMPLITUDE1.name, Cells::Numbers(&first)),
        (AMPLITUDE2.name, Cells::Numbers(&second)),
        (MOST.name, Cells::Numbers(&most)),
        (POSES.name, Cells::Text(&poses)),
        (TURNS.name, Cells::Text(&turns)),
        (ANGLES.name, Cells::Text(&angles)),
        (CAUSES.name, Cells::Text(&causes)),
        (MOVED.name, Cells::Text(&moved)),
        (COVARIANCE.name, Cells::Text(&covariance)),
    ];
    write_columns(destination, format, &columns)
}

/// Reads what [`write_leftovers`] wrote, in field order; `None` for heliostats without a row.
///
/// # Errors
/// [`IoError`] for an unknown or missing column, an id that is not in the field or stands twice, and numbers that are
/// none or do not belong together.
pub fn load_leftovers<'a>(
    table: impl Into<TableSource<'a>>,
    field: &Field,
) -> Result<Vec<Option<Leftover>>, IoError> {
    let table = Keyed::new(Table::read(table)?, COLUMNS, &Naming::default())?;
    let mut out: Vec<Option<Leftover>> = vec![None; field.len()];
    let mut first = vec![0; field.len()];
    for row in 0..table.table().rows() {
        let (id, heliostat) = known_heliostat(&table, row, &ID, field)?;
        if out[heliostat].is_some() {
            let problem = Problem::Duplicate {
                what: "id",
                name: id.into_owned(),
                first: table.table().position(first[heliostat]),
            };
            return Err(table.error(row, &ID, None, problem));
        }
        first[heliostat] = row;
        out[heliostat] = Some(leftover(&table, row, &id)?);
    }
    Ok(out)
}

fn leftover(table: &Keyed, row: usize, id: &str) -> Result<Leftover, IoError> {
    let who = Some(id);
    let number = |key: &'static Key| table.needed(row, key, who);
    let words = |key: &'static Key| -> Result<Vec<String>, IoError> {
        let cell = table.text(row, key, id)?.unwrap_or_default();
        Ok(cell.split_whitespace().map(str::to_owned).collect())
    };
    let wrong = |key: &'static Key, wanted: &str, found: String| {
        let problem = Problem::WrongKind {
            what: String::new(),
            wanted: wanted.to_owned(),
            found,
        };
        table.error(row, key, who, problem)
    };
    let list = |key: &'static Key| -> Result<Vec<f64>, IoError> {
        words(key)?
            .iter()
            .map(|word| {
                let number = word.parse().ok().filter(|x: &f64| x.is_finite());
                number.ok_or_else(|| wrong(key, "numbers apart by blanks", quoted(word)))
            })
            .collect()
    };
    let pairs = |key: &'static Key| -> Result<Vec<[f64; 2]>, IoError> {
        let numbers = list(key)?;
        match numbers.as_chunks() {
            (pairs, []) => Ok(pairs.to_vec()),
            _ => Err(wrong(key, "pairs", format!("{} numbers", numbers.len()))),
        }
    };
    let angles = list(&ANGLES)?;
    let angles_rad = <[f64; 6]>::try_from(&angles[..])
        .map_err(|_| wrong(&ANGLES, "6 numbers", angles.len().to_string()))?;
    let causes = words(&CAUSES)?
        .iter()
        .map(|name| {
            AxisCause::named(name).ok_or_else(|| wrong(&CAUSES, "names of causes", quoted(name)))
        })
        .collect::<Result<_, _>>()?;
    let parts = LeftoverParts {
        length_rad: radians(number(&LENGTH)?),
        amplitude_rad: [1e-3 * number(&AMPLITUDE1)?, 1e-3 * number(&AMPLITUDE2)?],
        most_rad: 1e-3 * number(&MOST)?,
        poses_rad: pairs(&POSES)?,
        turns_rad: pairs(&TURNS)?,
        angles_rad,
        causes,
        moved_rad: list(&MOVED)?,
        covariance: list(&COVARIANCE)?,
    };
    Leftover::from_parts(parts).map_err(|error| {
        let message = error.to_string();
        table.row_error(row, id, Problem::Conflict { message })
    })
}

#[cfg(test)]
mod tests {
    use helio_core::{Enu, Heliostat, TrackingMode};

    use super::*;

    fn parts() -> LeftoverParts {
        let known = 7;
        let of_all = known + 4;
        LeftoverParts {
            length_rad: 0.37,
            amplitude_rad: [1e-4, 3e-4],
            most_rad: 1e-3,
            poses_rad: vec![[3.1, 0.4], [2.2, -0.1]],
            turns_rad: vec![[1.25e-4, -3.3e-5], [-7e-5, 1e-300]],
            angles_rad: [1e-3, -2e-3, 0.1, 0.0, 0.2, 1e-3],
            causes: vec![AxisCause::Axis2Sag],
            moved_rad: vec![1e-5; known],
            covariance: (0..of_all * (of_all + 1) / 2)
                .map(|k| 1e-9 / (1.0 + k as f64))
                .collect(),
        }
    }

    fn field() -> Field {
        let mut field = Field::new(TrackingMode::AzimuthElevation);
        for id in ["A1", "A2", "A3"] {
            let heliostat = Heliostat::new(Enu::new(0.0, 50.0, 2.0), Enu::new(0.0, 0.0, 40.0));
            field.push(id, heliostat).unwrap();
        }
        field
    }

    #[test]
    fn what_was_written_is_read_again() {
        let folder = tempfile::tempdir().unwrap();
        let none = LeftoverParts {
            poses_rad: Vec::new(),
            turns_rad: Vec::new(),
            covariance: vec![0.0; 28],
            ..parts()
        };
        let leftovers = [parts(), none].map(|parts| Leftover::from_parts(parts).unwrap());
        for name in ["left.csv", "left.parquet"] {
            let path = folder.path().join(name);
            let format = Format::of_path(&path).unwrap();
            let ids = ["A3".to_owned(), "A1".to_owned()];
            write_leftovers(Destination::File(path.clone()), format, &ids, &leftovers).unwrap();
            let read = load_leftovers(&path, &field()).unwrap();
            assert!(read[1].is_none());
            for (read, written) in [(&read[2], &leftovers[0]), (&read[0], &leftovers[1])] {
                let read = read.as_ref().unwrap();
                assert_eq!(
                    read.turn_rad(3.0, 0.3),
                    written.turn_rad(3.0, 0.3),
                    "{name}"
                );
                for (a, b) in read
                    .parts()
                    .covariance
                    .iter()
                    .zip(&written.parts().covariance)
                {
                    assert!((a - b).abs() <= 1e-8 * b.abs(), "{a} {b}");
                }
                assert_eq!(read.parts().causes, written.parts().causes);
            }
        }
    }

    #[test]
    fn wrong_tables_are_refused_by_place() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("left.csv");
        let left = [Leftover::from_parts(parts()).unwrap()];
        let ids = ["A1".to_owned()];
        write_leftovers(Destination::File(path.clone()), Format::Csv, &ids, &left).unwrap();
        let good = std::fs::read_to_string(&path).unwrap();
        for (from, to, said) in [
            ("A1,", "B1,", "unknown heliostat `B1`"),
            (
                "axis2_sag_rad",
                "sag",
                "must be names of causes, found `sag`",
            ),
            ("3.1 ", "", "must be pairs, found 3 numbers"),
            ("3.1 ", "x ", "must be numbers apart by blanks, found `x`"),
            ("most_mrad", "most", "unknown column `most`"),
            (" 1e-300", " 1 2 3", "number of turns_rad"),
        ] {
            assert!(good.contains(from), "{from}");
            std::fs::write(&path, good.replacen(from, to, 1)).unwrap();
            let error = load_leftovers(&path, &field()).unwrap_err().to_string();
            assert!(error.contains(said), "{from}: {error}");
        }
    }
}
