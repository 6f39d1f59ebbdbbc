//! When frames were taken: by their place in the list, or by the numbers in their names.

use std::collections::HashMap;
use std::fmt::{self, Display, Formatter};
use std::path::{Path, PathBuf};

use crate::words::Counted;

/// When each frame was taken.
///
/// ```
/// use helio_io::FrameClock;
/// let clock = FrameClock::new(1_000, 2.0);
/// assert_eq!(clock.at(3), 1_500_001_000);
/// let clock = clock.numbered(&["f7.png".into(), "f9.png".into()])?;
/// assert_eq!(clock.at(1), 1_000_001_000);
/// # Ok::<(), helio_io::FrameNumberError>(())
/// ```
#[derive(Debug, Clone, PartialEq)]
pub struct FrameClock {
    start_ns: i64,
    fps: f64,
    /// How many frames after the first each was taken; none where that is its place in the list.
    later: Option<Vec<u64>>,
}

/// Why no times can be told from the names of frames.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum FrameNumberError {
    /// There are no files.
    #[error("frames of raw video come one after another")]
    NoFiles,
    /// A name without a number.
    #[error("{} has no number in its name", path.display())]
    NoNumber {
        /// The frame.
        path: PathBuf,
    },
    /// A number that is not above the one before.
    #[error("{} comes after {}; wanted numbers that ascend", path.display(), before.display())]
    NotAscending {
        /// The frame.
        path: PathBuf,
        /// The one before it.
        before: PathBuf,
    },
}

impl FrameClock {
    /// Frames of which the first was taken then \[ns of Unix time\], so many a second, each by its place in the list.
    #[must_use]
    pub const fn new(start_ns: i64, fps: f64) -> Self {
        Self {
            start_ns,
            fps,
            later: None,
        }
    }

    /// The same by the numbers in the names of files, the last digits before the suffix; the first file is the first
    /// frame.
    ///
    /// # Errors
    /// [`FrameNumberError`] where there is no file, a name has no number, or one does not ascend.
    pub fn numbered(self, files: &[PathBuf]) -> Result<Self, FrameNumberError> {
        let later = Some(numbered(files)?);
        Ok(Self { later, ..self })
    }

    /// When the frame of this place in the list was taken \[ns of Unix time\].
    #[must_use]
    pub fn at(&self, index: usize) -> i64 {
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
fn numbered(files: &[PathBuf]) -> Result<Vec<u64>, FrameNumberError> {
    let Some(first) = files.first() else {
        return Err(FrameNumberError::NoFiles);
    };
    let of = |path: &PathBuf| {
        let (_, number) =
            number(path).ok_or_else(|| FrameNumberError::NoNumber { path: path.clone() })?;
        Ok(number)
    };
    let first = of(first)?;
    let numbers = files
        .iter()
        .map(of)
        .collect::<Result<Vec<u64>, FrameNumberError>>()?;
    if let Some(at) = numbers.windows(2).position(|pair| pair[1] <= pair[0]) {
        return Err(FrameNumberError::NotAscending {
            path: files[at + 1].clone(),
            before: files[at].clone(),
        });
    }
    Ok(numbers.iter().map(|number| number - first).collect())
}

/// Numbers in the names of frames that tell of other times than their places in the list do; says so up to what is to be
/// done about it.
#[derive(Debug, Clone, PartialEq, Eq)]
#[non_exhaustive]
pub struct FrameGap {
    /// A frame, and the one that follows it.
    pub between: [PathBuf; 2],
    /// How many such places there are.
    pub count: usize,
}

impl Display for FrameGap {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        let [before, after] = &self.between;
        write!(
            f,
            "the numbers in the names leave some out: after {} comes {} ({}); times go by the place in the list, so that \
             frames which are missing shift those after them",
            before.display(),
            after.display(),
            Counted(self.count, "such place")
        )
    }
}

/// Where names of one folder that differ by a number alone do not follow each other as most of them do.
///
/// ```
/// let names = ["1.png", "2.png", "3.png", "6.png", "7.png"].map(std::path::PathBuf::from);
/// let gap = helio_io::frame_gap(&names).ok_or("none")?;
/// assert_eq!(gap.between, [names[2].clone(), names[3].clone()]);
/// # Ok::<(), &str>(())
/// ```
#[must_use]
pub fn frame_gap(files: &[PathBuf]) -> Option<FrameGap> {
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
    Some(FrameGap {
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
        assert_eq!(frame_gap(&paths(&["1.png", "2.png", "3.png"])), None);
        // every tenth frame; other names; a folder after another
        assert_eq!(frame_gap(&paths(&["10.png", "20.png", "30.png"])), None);
        assert_eq!(
            frame_gap(&paths(&["a1.png", "b7.png", "c9.png", "x.png"])),
            None
        );
        assert_eq!(
            frame_gap(&paths(&["a/1.png", "a/2.png", "b/1.png", "b/2.png"])),
            None
        );
        let gap = frame_gap(&paths(&[
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
