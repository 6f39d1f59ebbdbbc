//! What is wrong with a file of a mesh, or with what is asked of a mesh.

use std::fmt;

/// A file that cannot be used: which file, which line, what was found, what was wanted.
///
/// ```
/// use helio_flux::mesh::{ReadOptions, csv};
/// let error = csv::nodes("nodes.csv", b"node,x_m,y_m,z_m\n1,0,0,up\n", &ReadOptions::default()).unwrap_err();
/// assert_eq!(error.to_string(), "nodes.csv:2: z_m must be a number, found `up`");
/// ```
#[derive(Debug, Clone, PartialEq)]
pub struct ReadError {
    file: String,
    line: Option<usize>,
    problem: ReadProblem,
}

impl ReadError {
    /// A problem on a line (counted from 1) of a file, or with the file as a whole.
    #[must_use]
    pub fn new(file: &str, line: Option<usize>, problem: ReadProblem) -> Self {
        Self {
            file: file.to_owned(),
            line,
            problem,
        }
    }

    /// The file, as it was named by the caller or by an `*INCLUDE`.
    #[must_use]
    pub fn file(&self) -> &str {
        &self.file
    }

    /// The line, counted from 1; `None` for the file as a whole and for binary parts.
    #[must_use]
    pub const fn line(&self) -> Option<usize> {
        self.line
    }

    /// What is wrong.
    #[must_use]
    pub const fn problem(&self) -> &ReadProblem {
        &self.problem
    }
}

impl fmt::Display for ReadError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.line {
            Some(line) => write!(f, "{}:{line}: {}", shown(&self.file), self.problem),
            None => write!(f, "{}: {}", shown(&self.file), self.problem),
        }
    }
}

impl std::error::Error for ReadError {}

/// What is wrong with a file.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum ReadProblem {
    /// The file, or one that it includes, cannot be opened.
    #[error("cannot be read: {}", shown(.reason))]
    Unreadable {
        /// What the system said.
        reason: String,
    },
    /// The file breaks the rules of its own format.
    #[error("not well-formed {format}: {}", shown(.message))]
    Syntax {
        /// The format.
        format: &'static str,
        /// What its parser said.
        message: String,
    },
    /// Text that is something else than wanted.
    #[error("{} must be {}, found {}", shown(.what), shown(.wanted), quoted(.found))]
    Wrong {
        /// The quantity, column or word.
        what: String,
        /// What was wanted.
        wanted: String,
        /// What was found.
        found: String,
    },
    /// A number that is NaN, infinite or larger than any mirror.
    #[error("{} must be a finite number within ±{most:e}, found {}", shown(.what), quoted(.found))]
    NotFinite {
        /// The quantity.
        what: String,
        /// Largest magnitude, in the units of the file.
        most: f64,
        /// What was found.
        found: String,
    },
    /// Something that must be there is not.
    #[error("{} is missing; wanted {}", shown(.what), shown(.wanted))]
    Missing {
        /// What is missing.
        what: String,
        /// What was wanted.
        wanted: String,
    },
    /// A part of the format that this crate does not read.
    #[error("{} is not read; {advice}", quoted(.what))]
    Unsupported {
        /// The part.
        what: String,
        /// What can be done.
        advice: String,
    },
    /// One node at two places.
    #[error("node {id} stands twice, at two places; first {}", place(.first))]
    TwoPlaces {
        /// The node.
        id: u64,
        /// Line where it stood first, if the file has lines.
        first: Option<usize>,
    },
    /// More of something than is accepted.
    #[error("{found} {what} found; at most {most} are accepted")]
    TooMany {
        /// What there is too much of.
        what: &'static str,
        /// How many were found or announced.
        found: u64,
        /// The limit.
        most: u64,
    },
    /// The file ends before it should.
    #[error("the file ends inside {}", shown(.inside))]
    Ended {
        /// What was begun.
        inside: String,
    },
}

/// A wrong call: about a mesh that has been read.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum MeshError {
    /// A set or surface that the mesh does not have.
    #[error("the mesh has no {kind} {}; {}", quoted(.name), listed(.known))]
    UnknownName {
        /// Node set, element set or surface.
        kind: &'static str,
        /// The name asked for.
        name: String,
        /// The names there are.
        known: Vec<String>,
    },
    /// Nothing is left of what was asked for.
    #[error("no usable mirror face in {what}: {why}")]
    NoFaces {
        /// What was asked for.
        what: String,
        /// What was there instead.
        why: String,
    },
    /// A number is NaN, infinite or outside its range.
    #[error("{what} must be {wanted}, got {value}")]
    BadValue {
        /// The quantity.
        what: &'static str,
        /// The range it must lie in.
        wanted: &'static str,
        /// What was given.
        value: f64,
    },
    /// Columns that do not go together.
    #[error("{what}: expected {expected}, one per node, got {found}")]
    WrongLength {
        /// The column.
        what: &'static str,
        /// How many were wanted.
        expected: usize,
        /// How many there are.
        found: usize,
    },
}

fn place(line: &Option<usize>) -> String {
    line.map_or_else(|| "before".to_owned(), |line| format!("on line {line}"))
}

/// Names that a message lists.
const MAX_LISTED: usize = 8;
/// Characters of a foreign text that a message shows.
const MAX_SHOWN: usize = 48;

fn listed(known: &[String]) -> String {
    if known.is_empty() {
        return "it has none".to_owned();
    }
    let shown: Vec<String> = known.iter().take(MAX_LISTED).map(|n| quoted(n)).collect();
    let more = match known.len().saturating_sub(MAX_LISTED) {
        0 => String::new(),
        more => format!(" and {more} more"),
    };
    format!("known are {}{more}", shown.join(", "))
}

/// Foreign text: control characters escaped, long text cut.
fn shown(text: &str) -> String {
    let mut out = String::new();
    for (count, c) in text.chars().enumerate() {
        if count == 4 * MAX_SHOWN {
            out.push('…');
            break;
        }
        if c.is_control() {
            out.extend(c.escape_default());
        } else {
            out.push(c);
        }
    }
    out
}

/// Foreign text in backticks, control characters escaped, long text cut.
pub(crate) fn quoted(text: &str) -> String {
    let short: String = text.chars().take(MAX_SHOWN).collect();
    let more = if short.len() < text.len() { "…" } else { "" };
    format!("`{}{more}`", shown(&short))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn foreign_text_is_cut_and_escaped() {
        assert_eq!(quoted("a\tb\u{1b}"), "`a\\tb\\u{1b}`");
        assert_eq!(quoted(&"é".repeat(1000)).chars().count(), MAX_SHOWN + 3);
        let error = ReadError::new(
            &"x".repeat(5000),
            Some(3),
            ReadProblem::Ended { inside: "a".into() },
        );
        assert!(error.to_string().len() < 300);
    }
}
