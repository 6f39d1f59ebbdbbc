//! When frames were taken: by their place in the list, or by the numbers in their names.

use std::collections::HashMap;
use std::path::{Path, PathBuf};

use helio_io::parse_time;

use crate::args::SpotArgs;
use crate::failure::Failure;

/// When each frame was taken.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Clock {
    start_ns: i64,
    fps: f64,
    /// How many frames after the first each was taken; none where that is its place in the list.
    later: Option<Vec<u64>>,
}

impl Clock {
    pub(crate) fn of(args: &SpotArgs, files: &[PathBuf]) -> Result<Option<Self>, Failure> {
        let (Some(start), Some(fps)) = (&args.start, args.fps) else {
            return Ok(None);
        };
        let start_ns =
            parse_time(start).map_err(|error| Failure::refused(format!("--start: {error}")))?;
        let later = if args.numbered {
            Some(numbered(files)?)
        } else {
            None
        };
        Ok(Some(Self {
            start_ns,
            fps,
            later,
        }))
    }

    pub(crate) fn at(&self, index: usize) -> i64 {
        let later = self.later.as_ref().and_then(|later| later.get(index));
        let later = later.map_or(index as f64, |later| *later as f64);
        let later_ns = (later / self.fps * 1e9).round();
        self.start_ns.saturating_add(later_ns as i64)
    }
}

/// A name's number, and what stands before and after it: the last digits of the name without its suffix.
fn number(path: &Path) -> Option<(String, u64)> {
    let stem = path.file_stem()?.to_string_lossy();
    let end = stem.rfind(|c: char| c.is_ascii_digit())? + 1;
    let begin = stem[..end]
        .rfind(|c: char| !c.is_ascii_digit())
        .map_or(0, |at| {
            at + stem[at..].chars().next().map_or(1, char::len_utf8)
        });
    let number = stem[begin..end].parse().ok()?;
    Some((format!("{}#{}", &stem[..begin], &stem[end..]), number))
}

/// How many frames after the first each was taken, by the numbers in their names.
fn numbered(files: &[PathBuf]) -> Result<Vec<u64>, Failure> {
    if files.is_empty() {
        return Err(Failure::refused(
            "--numbered is for files; frames of raw video come one after another",
        ));
    }
    let numbers = files
        .iter()
        .map(|path| {
            let (_, number) = number(path).ok_or_else(|| {
                Failure::refused(format!(
                    "--numbered: {} has no number in its name",
                    path.display()
                ))
            })?;
            Ok(number)
        })
        .collect::<Result<Vec<u64>, Failure>>()?;
    if let Some(at) = numbers.windows(2).position(|pair| pair[1] <= pair[0]) {
        return Err(Failure::refused(format!(
            "--numbered: {} comes after {}; wanted numbers that ascend",
            files[at + 1].display(),
            files[at].display()
        )));
    }
    Ok(numbers.iter().map(|number| number - numbers[0]).collect())
}

/// Numbers in the names of frames that tell of other times than their places in the list do.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Gap {
    /// A frame, and the one that follows it.
    pub(crate) between: [PathBuf; 2],
    /// How many such places there are.
    pub(crate) count: usize,
}

/// Where names of one folder that differ by a number alone do not follow each other as most of them do.
pub(crate) fn gaps(files: &[PathBuf]) -> Option<Gap> {
    let names: Vec<Option<(String, u64)>> = files.iter().map(|path| number(path)).collect();
    let steps: Vec<(usize, i128)> = (1..files.len())
        .filter_map(|row| {
            let ((before, from), (name, to)) = (names[row - 1].as_ref()?, names[row].as_ref()?);
            let same = before == name && files[row - 1].parent() == files[row].parent();
            same.then(|| (row, i128::from(*to) - i128::from(*from)))
        })
        .collect();
    let mut counts: HashMap<i128, usize> = HashMap::new();
    for (_, step) in &steps {
        *counts.entry(*step).or_default() += 1;
    }
    let usual = counts
        .into_iter()
        .max_by_key(|&(step, count)| (count, std::cmp::Reverse(step)))?
        .0;
    let mut others = steps.iter().filter(|(_, step)| *step != usual);
    let (row, _) = others.next()?;
    Some(Gap {
        between: [files[row - 1].clone(), files[*row].clone()],
        count: 1 + others.count(),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn paths(names: &[&str]) -> Vec<PathBuf> {
        names.iter().map(PathBuf::from).collect()
    }

    #[test]
    fn numbers_of_names() {
        for (name, wanted) in [
            ("a/000012.png", Some(("#", 12))),
            ("cam2_0007b.png", Some(("cam2_#b", 7))),
            ("größe3.tif", Some(("größe#", 3))),
            ("frame.png", None),
            ("99999999999999999999999.png", None),
        ] {
            let found = number(Path::new(name));
            let wanted = wanted.map(|(around, number): (&str, u64)| (around.to_owned(), number));
            assert_eq!(found, wanted, "{name}");
        }
    }

    #[test]
    fn missing_numbers_are_told() {
        assert_eq!(gaps(&paths(&["1.png", "2.png", "3.png"])), None);
        // every tenth frame; other names; a folder after another
        assert_eq!(gaps(&paths(&["10.png", "20.png", "30.png"])), None);
        assert_eq!(gaps(&paths(&["a1.png", "b7.png", "c9.png", "x.png"])), None);
        assert_eq!(
            gaps(&paths(&["a/1.png", "a/2.png", "b/1.png", "b/2.png"])),
            None
        );
        let gap = gaps(&paths(&[
            "1.png", "2.png", "3.png", "6.png", "7.png", "9.png",
        ]))
        .unwrap();
        assert_eq!(
            gap.between,
            [PathBuf::from("3.png"), PathBuf::from("6.png")]
        );
        assert_eq!(gap.count, 2);
    }

    #[test]
    fn times_by_number_skip_what_is_missing() {
        assert_eq!(
            numbered(&paths(&["f/0004.png", "f/0005.png", "f/0009.png"])).unwrap(),
            [0, 1, 5]
        );
        let said = |names: &[&str]| numbered(&paths(names)).unwrap_err().to_string();
        assert!(said(&["1.png", "x.png"]).contains("x.png has no number"));
        assert!(said(&["2.png", "1.png"]).contains("1.png comes after 2.png"));
        assert!(said(&["a/1.png", "b/1.png"]).contains("ascend"));
        assert!(said(&[]).contains("raw video"));
    }
}
