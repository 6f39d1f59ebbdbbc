//! Where frames come from: files, directories, patterns, lists.

use std::collections::HashSet;
use std::path::{Component, Path, PathBuf};

use crate::error::{IoError, Place, Problem, quoted};
use crate::table::read_text;
use crate::words::Counted;

/// Suffixes of pictures, in lower case.
const SUFFIXES: &[&str] = &[
    "png", "tif", "tiff", "jpg", "jpeg", "pgm", "ppm", "pnm", "pbm",
];

/// The files that somebody means.
#[derive(Debug, Clone, PartialEq, Eq)]
#[non_exhaustive]
pub struct FrameFiles {
    /// Each once, where it was named first.
    pub paths: Vec<PathBuf>,
    /// Files that were named again, by whatever name.
    pub again: Vec<PathBuf>,
}

/// The files that somebody means by what was typed, in order: a file is itself, a directory its pictures by name, a
/// pattern with `*` or `?` what it matches by name (numbers in names by their value, so that `9.png` comes before
/// `10.png`), `@LIST` the files that a text file lists, one a line, relative to
/// that file (empty lines and lines that begin with `#` are left aside). A file counts once, however often and by
/// whatever names it is named.
///
/// # Errors
/// [`IoError`] for a directory that cannot be read or has no picture, a pattern that nothing matches, and a list that
/// cannot be read or names nothing. Files need not exist: that is told when they are read.
///
/// ```
/// let folder = tempfile::tempdir()?;
/// for name in ["b.png", "a.PNG", "notes.txt"] {
///     std::fs::write(folder.path().join(name), "")?;
/// }
/// let files = helio_io::frame_files(&[folder.path().to_path_buf()])?;
/// let (a, b) = (folder.path().join("a.PNG"), folder.path().join("b.png"));
/// assert_eq!(files.paths, [a, b.clone()]);
/// let files = helio_io::frame_files(&[folder.path().join("?.png"), b.clone()])?;
/// assert_eq!((files.paths, files.again), (vec![b.clone()], vec![b]));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn frame_files(typed: &[PathBuf]) -> Result<FrameFiles, IoError> {
    let mut files = Vec::new();
    for path in typed {
        let text = path.to_string_lossy();
        if path.is_dir() {
            files.extend(directory(path)?);
        } else if let Some(list) = text.strip_prefix('@').filter(|_| !path.exists()) {
            files.extend(listed(Path::new(list))?);
        } else if text.contains(['*', '?']) && !path.exists() {
            files.extend(matched(path)?);
        } else {
            files.push(path.clone());
        }
    }
    let mut known = HashSet::with_capacity(files.len());
    let (paths, again) = files.into_iter().partition(|path: &PathBuf| {
        known.insert(path.canonicalize().unwrap_or_else(|_| path.clone()))
    });
    Ok(FrameFiles { paths, again })
}

impl FrameFiles {
    /// That files were named more than once, where some were.
    ///
    /// ```
    /// let files = helio_io::frame_files(&["a.png".into(), "a.png".into()])?;
    /// assert!(files.warning().is_some_and(|said| said.starts_with("1 file named more than once")));
    /// # Ok::<(), helio_io::IoError>(())
    /// ```
    #[must_use]
    pub fn warning(&self) -> Option<String> {
        let first = self.again.first()?;
        Some(format!(
            "{} named more than once and taken once, first {}",
            Counted(self.again.len(), "file"),
            first.display()
        ))
    }
}

fn nothing(path: &Path, what: String) -> IoError {
    IoError::new(Place::file(path), Problem::Empty { what })
}

fn is_picture(path: &Path) -> bool {
    path.extension()
        .map(|suffix| suffix.to_string_lossy().to_lowercase())
        .is_some_and(|suffix| SUFFIXES.contains(&suffix.as_str()))
}

/// What a directory holds, by name and the numbers in it.
fn entries(path: &Path) -> Result<Vec<PathBuf>, IoError> {
    let folder = if path == Path::new("") {
        Path::new(".")
    } else {
        path
    };
    let refuse = |error| IoError::read(folder, error);
    let mut found = Vec::new();
    for entry in std::fs::read_dir(folder).map_err(refuse)? {
        found.push(path.join(entry.map_err(refuse)?.file_name()));
    }
    found.sort_by_cached_key(|path| {
        let name = path.file_name().unwrap_or_default().to_string_lossy();
        (parts(&name), path.clone())
    });
    Ok(found)
}

/// A part of a name.
#[derive(PartialEq, Eq, PartialOrd, Ord)]
enum Part {
    /// Digits without leading zeros, and how many: so numbers of any length are in order.
    Number(usize, String),
    Text(String),
}

/// A name by its numbers, so that `frame10.png` comes after `frame9.png`.
fn parts(name: &str) -> Vec<Part> {
    let mut parts = Vec::new();
    let mut rest = name;
    while let Some(first) = rest.chars().next() {
        let digits = first.is_ascii_digit();
        let end = rest.find(|c: char| c.is_ascii_digit() != digits);
        let (part, after) = rest.split_at(end.unwrap_or(rest.len()));
        rest = after;
        parts.push(if digits {
            let number = part.trim_start_matches('0');
            Part::Number(number.len(), number.to_owned())
        } else {
            Part::Text(part.to_owned())
        });
    }
    parts
}

fn directory(path: &Path) -> Result<Vec<PathBuf>, IoError> {
    let mut found = entries(path)?;
    found.retain(|file| is_picture(file) && file.is_file());
    if found.is_empty() {
        let what = format!(
            "a directory without pictures; wanted .{}",
            SUFFIXES.join(", .")
        );
        return Err(nothing(path, what));
    }
    Ok(found)
}

fn listed(path: &Path) -> Result<Vec<PathBuf>, IoError> {
    let text = read_text(path)?;
    let folder = path.parent().unwrap_or(Path::new(""));
    let found: Vec<PathBuf> = text
        .lines()
        .map(str::trim)
        .filter(|line| !line.is_empty() && !line.starts_with('#'))
        .map(|line| folder.join(line))
        .collect();
    if found.is_empty() {
        return Err(nothing(path, "the list names no file".into()));
    }
    Ok(found)
}

fn matched(pattern: &Path) -> Result<Vec<PathBuf>, IoError> {
    let mut found = vec![PathBuf::new()];
    for part in pattern.components() {
        let wanted = part.as_os_str().to_string_lossy();
        let mut next = Vec::new();
        for before in found {
            if matches!(part, Component::Normal(_)) && wanted.contains(['*', '?']) {
                if before == Path::new("") || before.is_dir() {
                    next.extend(entries(&before)?.into_iter().filter(|path| {
                        path.file_name()
                            .is_some_and(|name| fits(&wanted, &name.to_string_lossy()))
                    }));
                }
            } else {
                next.push(before.join(part));
            }
        }
        found = next;
    }
    found.retain(|path| path.is_file());
    if found.is_empty() {
        let what = format!("no file matches {}", quoted(&pattern.to_string_lossy()));
        return Err(nothing(pattern, what));
    }
    Ok(found)
}

/// Whether a name fits a pattern of `*` (anything) and `?` (one character); hidden files only if it says so.
fn fits(pattern: &str, name: &str) -> bool {
    if name.starts_with('.') && !pattern.starts_with('.') {
        return false;
    }
    let (pattern, name): (Vec<char>, Vec<char>) =
        (pattern.chars().collect(), name.chars().collect());
    let (mut p, mut n) = (0, 0);
    // Where to go on after the last star, should what follows it not fit.
    let mut again: Option<(usize, usize)> = None;
    while n < name.len() {
        match pattern.get(p) {
            Some('*') => {
                again = Some((p + 1, n));
                p += 1;
            }
            Some(&c) if c == '?' || c == name[n] => {
                p += 1;
                n += 1;
            }
            _ => match again {
                Some((after, from)) => {
                    again = Some((after, from + 1));
                    (p, n) = (after, from + 1);
                }
                None => return false,
            },
        }
    }
    pattern[p..].iter().all(|&c| c == '*')
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn patterns_fit_as_a_shell_has_it() {
        for (pattern, name) in [
            ("*.png", "a.png"),
            ("*", "a"),
            ("a*b*c", "a-b-b-c"),
            ("f?.png", "f1.png"),
            ("**", ""),
            (".*", ".hidden"),
        ] {
            assert!(fits(pattern, name), "{pattern} {name}");
        }
        for (pattern, name) in [
            ("*.png", "a.jpg"),
            ("?", ""),
            ("?", "ab"),
            ("a*b", "a-c"),
            ("*", ".hidden"),
            ("f?.png", "f12.png"),
        ] {
            assert!(!fits(pattern, name), "{pattern} {name}");
        }
    }

    /// As the frames were numbered, with as many digits or not.
    #[test]
    fn frames_come_in_the_order_of_their_numbers() {
        let folder = tempfile::tempdir().unwrap();
        let names = [
            "1.png",
            "2.png",
            "09.png",
            "10.png",
            "100.png",
            "99999999999999999999999999.png",
            "100000000000000000000000000.png",
            "a-2-b.png",
            "a-10-a.png",
            "a-10-b.png",
            "b1.png",
        ];
        for name in names {
            std::fs::write(folder.path().join(name), "").unwrap();
        }
        let wanted: Vec<PathBuf> = names.iter().map(|name| folder.path().join(name)).collect();
        let of = |path: PathBuf| frame_files(&[path]).unwrap().paths;
        assert_eq!(of(folder.path().to_path_buf()), wanted);
        assert_eq!(of(folder.path().join("*.png")), wanted);
    }

    #[test]
    fn lists_patterns_and_directories_are_found() {
        let folder = tempfile::tempdir().unwrap();
        let at = |name: &str| folder.path().join(name);
        for run in ["one", "two"] {
            std::fs::create_dir(at(run)).unwrap();
            for name in ["1.png", "2.pgm"] {
                std::fs::write(at(run).join(name), "").unwrap();
            }
        }
        std::fs::write(at("list.txt"), "# mine\n\none/1.png\n missing.png \n").unwrap();
        let list = PathBuf::from(format!("@{}", at("list.txt").display()));
        assert_eq!(
            frame_files(&[list]).unwrap().paths,
            [at("one/1.png"), at("missing.png")]
        );
        // A file that is named twice counts once, whatever the names are; one that does not exist too.
        let typed = [
            at("*/?.png"),
            at("two"),
            at("missing.png"),
            at("one/../two/2.pgm"),
            at("missing.png"),
        ];
        let files = frame_files(&typed).unwrap();
        assert_eq!(
            files.paths,
            [
                at("one/1.png"),
                at("two/1.png"),
                at("two/2.pgm"),
                at("missing.png")
            ]
        );
        assert_eq!(
            files.again,
            [at("two/1.png"), at("one/../two/2.pgm"), at("missing.png")]
        );
        let said = |path: PathBuf| frame_files(&[path]).unwrap_err().to_string();
        std::fs::create_dir(at("empty")).unwrap();
        assert!(said(at("empty")).contains("without pictures"));
        assert!(said(at("*.jpg")).contains("no file matches"));
        std::fs::write(at("none.txt"), "# nothing\n").unwrap();
        assert!(
            said(PathBuf::from(format!("@{}", at("none.txt").display()))).contains("names no file")
        );
    }
}
