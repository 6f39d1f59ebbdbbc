//! Which of the spots given apart belongs to a record: by the frame's name, or by time.

use crate::error::{IoError, Problem, quoted, short};
use crate::keys;
use crate::spots::SpotTable;
use crate::table::Keyed;
use crate::times::format_time;

/// Spots given apart belong to records no more than this beside them in time \[ns\].
pub(crate) const NEAR_NS: i64 = 500_000_000;

/// Spots given apart, by what records know them by.
pub(crate) struct Frames<'a> {
    pub(crate) spots: &'a SpotTable,
    /// Parts of each name, the last first, and its row; in order. None where records go by time.
    by_name: Option<Vec<(Vec<&'a str>, usize)>>,
    /// Times and rows, in order.
    by_time: Vec<(i64, usize)>,
}

impl<'a> Frames<'a> {
    /// A row that says the same as another once more, as in tables that were put together, is one frame.
    pub(crate) fn new(spots: &'a SpotTable, named: bool) -> Self {
        let rows = || spots.rows.iter().enumerate();
        let again = |later: usize, first: usize| spots.rows[later] == spots.rows[first];
        let by_name = named.then(|| {
            let names = rows().map(|(row, spot)| (parts(&spot.file), row));
            let mut by_name: Vec<_> = names.collect();
            by_name.sort_unstable();
            by_name.dedup_by(|later, first| later.0 == first.0 && again(later.1, first.1));
            by_name
        });
        let times = rows().filter_map(|(row, spot)| Some((spot.unix_ns?, row)));
        let mut by_time: Vec<(i64, usize)> = times.collect();
        by_time.sort_unstable();
        by_time.dedup_by(|later, first| later.0 == first.0 && again(later.1, first.1));
        Self {
            spots,
            by_name,
            by_time,
        }
    }

    /// Whether records name their frames.
    pub(crate) const fn by_name(&self) -> bool {
        self.by_name.is_some()
    }

    /// The frame of a record.
    pub(crate) fn of(
        &self,
        table: &Keyed,
        row: usize,
        id: &str,
        unix_ns: Option<i64>,
    ) -> Result<Option<usize>, IoError> {
        let refuse =
            |key, message| Err(table.error(row, key, Some(id), Problem::Conflict { message }));
        let Some(by_name) = &self.by_name else {
            let near = unix_ns.map_or([None; 2], |unix_ns| self.nearest(unix_ns));
            return match near {
                [Some(one), Some(other)] => {
                    let frame = |row: usize| {
                        let file = quoted(&self.spots.rows[row].file);
                        format!("{file} ({})", self.spots.position(row))
                    };
                    let message = format!(
                        "two frames of {} are equally near to its time: {} and {}; wanted times that tell frames apart, \
                         or the frames' names in a column {}",
                        self.spots.path.display(),
                        frame(one),
                        frame(other),
                        quoted(keys::FRAME.name)
                    );
                    refuse(&keys::TIME, message)
                }
                [one, _] => Ok(one),
            };
        };
        let Some(name) = table.text(row, &keys::FRAME, id)? else {
            return Ok(None);
        };
        let found = named(by_name, &parts(&name));
        let one = match found.as_slice() {
            [] => return Ok(None),
            [one] => *one,
            [first, second, ..] => {
                let message = format!(
                    "{} frames of {} may be meant by {}, first {} ({}) and {} ({}); wanted more of its folders, or each \
                     frame once",
                    found.len(),
                    self.spots.path.display(),
                    quoted(&name),
                    quoted(&self.spots.rows[*first].file),
                    self.spots.position(*first),
                    quoted(&self.spots.rows[*second].file),
                    self.spots.position(*second)
                );
                return refuse(&keys::FRAME, message);
            }
        };
        if let (Some(taken), Some(unix_ns)) = (self.spots.rows[one].unix_ns, unix_ns)
            && taken.abs_diff(unix_ns) > NEAR_NS.unsigned_abs()
        {
            let message = format!(
                "its frame {} was taken at {} ({}, {}), {} s from the record's {}; wanted within {} s, or one of the two \
                 tables without times",
                quoted(&name),
                format_time(taken),
                self.spots.path.display(),
                self.spots.position(one),
                short(1e-9 * taken.abs_diff(unix_ns) as f64),
                format_time(unix_ns),
                1e-9 * NEAR_NS as f64
            );
            return refuse(&keys::FRAME, message);
        }
        Ok(Some(one))
    }

    /// The row nearest to a time, if it is near enough, and another one that is no farther away.
    fn nearest(&self, unix_ns: i64) -> [Option<usize>; 2] {
        let apart = |time: i64| time.abs_diff(unix_ns);
        let after = self.by_time.partition_point(|(time, _)| *time < unix_ns);
        let (before, after) = self.by_time.split_at(after);
        let sides = before.last().into_iter().chain(after.first());
        let least = sides.map(|(time, _)| apart(*time)).min();
        let Some(least) = least.filter(|least| *least <= NEAR_NS.unsigned_abs()) else {
            return [None; 2];
        };
        // rows of one time stand side by side
        let as_near = |side: &&(i64, usize)| apart(side.0) == least;
        let before = before.iter().rev().take_while(as_near).take(2);
        let mut both: Vec<usize> = before
            .chain(after.iter().take_while(as_near).take(2))
            .map(|(_, row)| *row)
            .collect();
        both.sort_unstable();
        [both.first().copied(), both.get(1).copied()]
    }
}

/// The parts of a name, whichever way its folders are written, the last first. An absolute name ends with an empty part,
/// before which nothing comes; what comes before `..` is not known by its name.
fn parts(name: &str) -> Vec<&str> {
    let mut parts = Vec::new();
    let mut all = name.rsplit(['/', '\\']).peekable();
    while let Some(part) = all.next() {
        match part {
            ".." => break,
            "." => {}
            "" if all.peek().is_some() || parts.is_empty() => {}
            _ => parts.push(part),
        }
    }
    parts
}

/// The rows whose names agree with another as far as both go, in the order of the table; `by_name` is in order.
fn named(by_name: &[(Vec<&str>, usize)], name: &[&str]) -> Vec<usize> {
    if name.is_empty() {
        return Vec::new();
    }
    let from = by_name.partition_point(|(parts, _)| parts.as_slice() < name);
    // those that go farther than the name, and it
    let farther = by_name[from..]
        .iter()
        .take_while(|(parts, _)| parts.starts_with(name));
    let mut rows: Vec<usize> = farther.map(|(_, row)| *row).collect();
    // those that go less far
    for length in 1..name.len() {
        let less = &name[..length];
        let from = by_name.partition_point(|(parts, _)| parts.as_slice() < less);
        let same = by_name[from..]
            .iter()
            .take_while(|(parts, _)| parts.as_slice() == less);
        rows.extend(same.map(|(_, row)| *row));
    }
    rows.sort_unstable();
    rows
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_taken_apart_from_their_end() {
        for (name, wanted) in [
            ("1.png", &["1.png"][..]),
            ("dayA/1.png", &["1.png", "dayA"]),
            ("./dayA//1.png", &["1.png", "dayA"]),
            ("/data/1.png", &["1.png", "data", ""]),
            ("C:\\data\\1.png", &["1.png", "data", "C:"]),
            ("run/../dayA/1.png", &["1.png", "dayA"]),
            ("", &[]),
            ("..", &[]),
            ("/", &[]),
        ] {
            assert_eq!(parts(name), wanted, "{name}");
        }
    }

    /// Against the rule itself, name by name: the shorter is the end of the longer.
    #[test]
    fn names_agree_as_far_as_both_go() {
        let names = [
            "1.png",
            "2.png",
            "a/1.png",
            "b/1.png",
            "x/a/1.png",
            "/a/1.png",
            "/x/a/1.png",
            "a/2.png",
            "a/1.pn",
            "1.png",
            "b/a/1.png",
            "../a/1.png",
        ];
        let mut by_name: Vec<_> = names
            .iter()
            .enumerate()
            .map(|(row, name)| (parts(name), row))
            .collect();
        by_name.sort_unstable();
        for name in names
            .into_iter()
            .chain(["y/1.png", "3.png", "/1.png", "x/x/a/1.png"])
        {
            let own = parts(name);
            let agree = |other: &str| {
                let other = parts(other);
                own.iter().zip(&other).all(|(a, b)| a == b)
            };
            let wanted: Vec<usize> = (0..names.len()).filter(|&row| agree(names[row])).collect();
            assert_eq!(named(&by_name, &own), wanted, "{name}");
        }
        assert_eq!(named(&by_name, &parts("/1.png")), [0, 9]);
        assert_eq!(named(&by_name, &[]), [0_usize; 0]);
    }
}
