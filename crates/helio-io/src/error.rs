//! The one error of this crate: where, what was found, what was wanted.

use std::fmt;
use std::io;
use std::ops::Range;
use std::path::{Path, PathBuf};

/// Where a problem lies.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
#[non_exhaustive]
pub struct Place {
    /// The file; `None` for text from elsewhere, such as the command line.
    pub path: Option<PathBuf>,
    /// Line of a text file, counted from 1; the header of a CSV file is line 1.
    pub line: Option<usize>,
    /// Column of a text file in characters, counted from 1.
    pub column: Option<usize>,
    /// Row of a Parquet file, counted from 1.
    pub row: Option<usize>,
    /// Name of the heliostat, where it is known.
    pub heliostat: Option<String>,
    /// Name of the table's column.
    pub field: Option<String>,
}

impl Place {
    /// A whole file.
    #[must_use]
    pub fn file(path: &Path) -> Self {
        Self {
            path: Some(path.to_path_buf()),
            ..Self::default()
        }
    }
}

impl fmt::Display for Place {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let mut separator = "";
        if let Some(path) = &self.path {
            write!(f, "{}", path.display())?;
            separator = ":";
        }
        for number in [self.line, self.column].into_iter().flatten() {
            write!(f, "{separator}{number}")?;
            separator = ":";
        }
        let mut separator = if separator.is_empty() { "" } else { ": " };
        if let Some(row) = self.row {
            write!(f, "{separator}row {row}")?;
            separator = ": ";
        }
        if let Some(heliostat) = &self.heliostat {
            write!(f, "{separator}heliostat {}", quoted(heliostat))?;
            separator = ": ";
        }
        if let Some(field) = &self.field {
            write!(f, "{separator}column {}", quoted(field))?;
        }
        Ok(())
    }
}

/// What is wrong.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum Problem {
    /// A file cannot be read.
    #[error("cannot be read: {reason}")]
    Unreadable {
        /// What the system said.
        reason: String,
    },
    /// A file that another file names cannot be read.
    #[error("{key} names {}, which cannot be read: {reason}", path.display())]
    Reference {
        /// The key that names it.
        key: String,
        /// The file.
        path: PathBuf,
        /// What the system said.
        reason: String,
    },
    /// A file cannot be written.
    #[error("cannot be written: {reason}")]
    Unwritable {
        /// What the system said.
        reason: String,
    },
    /// Bytes that are no UTF-8 text.
    #[error("not UTF-8 text: found byte 0x{byte:02X}; {hint}")]
    NotUtf8 {
        /// The first wrong byte.
        byte: u8,
        /// How to mend it.
        hint: String,
    },
    /// The file breaks the rules of its own format.
    #[error("not valid {format}: {message}")]
    Syntax {
        /// `TOML`, `CSV` or `Parquet`.
        format: &'static str,
        /// What the parser said.
        message: String,
    },
    /// A name that nobody knows.
    #[error("unknown {what} {}{}", quoted(.name), suggestion(.nearest, .known, .advice))]
    Unknown {
        /// What kind of name: a key, a column, a target, …
        what: &'static str,
        /// The name.
        name: String,
        /// The nearest known name, if one is near.
        nearest: Option<String>,
        /// Every known name; the nearest first if there are many.
        known: Vec<String>,
        /// What else can be done about it; may be empty.
        advice: String,
    },
    /// Something that must be there is not.
    #[error("{what} is missing{}", because(.wanted))]
    Missing {
        /// What is missing.
        what: String,
        /// Why it is wanted.
        wanted: String,
    },
    /// A value of another kind than wanted.
    #[error("{}must be {wanted}, found {found}", subject(.what))]
    WrongKind {
        /// The key or quantity; empty where the place already names it.
        what: String,
        /// What was wanted.
        wanted: String,
        /// What was found.
        found: String,
    },
    /// A number that is NaN or infinite.
    #[error("{}must be a finite number, found {value}", subject(.what))]
    NotFinite {
        /// The key or quantity; empty where the place already names it.
        what: String,
        /// What was found.
        value: f64,
    },
    /// A number outside its range.
    #[error("{}must lie in {}..={}{unit}, found {}", subject(.what), short(*.min), short(*.max), short(*.value))]
    OutOfRange {
        /// The key or quantity; empty where the place already names it.
        what: String,
        /// Least value.
        min: f64,
        /// Greatest value.
        max: f64,
        /// The unit with a leading space, or nothing.
        unit: &'static str,
        /// What was found.
        value: f64,
    },
    /// A name that stands twice.
    #[error("{what} {} stands twice, first in {first}", quoted(.name))]
    Duplicate {
        /// What kind of name.
        what: &'static str,
        /// The name.
        name: String,
        /// Where it stood first.
        first: String,
    },
    /// A table without rows, or a file without contents.
    #[error("{what}")]
    Empty {
        /// What is empty, as a sentence.
        what: String,
    },
    /// A row with more or fewer cells than the header.
    #[error("{found} cells, but the header has {wanted} columns")]
    Ragged {
        /// Cells of the row.
        found: usize,
        /// Columns of the header.
        wanted: usize,
    },
    /// A name longer than anybody would mean.
    #[error("{what} of {length} bytes begins {}; at most {limit} bytes", quoted(.start))]
    TooLong {
        /// What kind of name.
        what: &'static str,
        /// Bytes found.
        length: usize,
        /// Most bytes accepted.
        limit: usize,
        /// How it begins.
        start: String,
    },
    /// Text that is no time, or a time without an offset.
    #[error("{} is not a usable {what}: {reason}", quoted(.text))]
    Time {
        /// `time` or `step`.
        what: &'static str,
        /// What was found.
        text: String,
        /// What is wrong and how to write it.
        reason: String,
    },
    /// Things that are right one by one but not together.
    #[error("{message}")]
    Conflict {
        /// The whole sentence.
        message: String,
    },
}

fn subject(what: &str) -> String {
    if what.is_empty() {
        String::new()
    } else {
        format!("{what} ")
    }
}

fn because(wanted: &str) -> String {
    if wanted.is_empty() {
        String::new()
    } else {
        format!(": {wanted}")
    }
}

fn suggestion(nearest: &Option<String>, known: &[String], advice: &str) -> String {
    match nearest {
        Some(nearest) => format!("; did you mean {}?", quoted(nearest)),
        None if known.is_empty() => advice.to_string(),
        None => {
            let shown: Vec<String> = known.iter().take(MAX_LISTED).map(|n| quoted(n)).collect();
            let more = known.len().saturating_sub(MAX_LISTED);
            let more = if more > 0 {
                format!(" and {more} more")
            } else {
                String::new()
            };
            format!("{advice}; known are {}{more}", shown.join(", "))
        }
    }
}

/// A number without a row of zeros.
pub(crate) fn short(value: f64) -> String {
    let size = value.abs();
    if size >= 1e7 || (size > 0.0 && size < 1e-4) {
        format!("{value:e}")
    } else {
        value.to_string()
    }
}

/// Names listed when none is near.
const MAX_LISTED: usize = 8;
/// How like two names must be, from 0 to 1, to ask whether one was meant.
const NEAR: f64 = 0.8;
/// How like two names must be for the known one to be listed first.
const FAINT: f64 = 0.6;
/// Characters of a foreign text that a message shows.
const MAX_SHOWN: usize = 64;
/// Characters of a line of TOML that a message shows on each side of the problem.
const MAX_BESIDE: usize = 50;

/// Foreign text as a message shows it: in backticks, control characters escaped, long text cut.
pub(crate) fn quoted(text: &str) -> String {
    let mut shown = String::from("`");
    for (count, c) in text.chars().enumerate() {
        if count == MAX_SHOWN {
            shown.push('…');
            break;
        }
        if c.is_control() {
            shown.extend(c.escape_default())
        } else {
            shown.push(c)
        }
    }
    shown.push('`');
    shown
}

/// How like a known name a wrong one is, from 0 to 1.
fn likeness(wrong: &str, known: &str) -> f64 {
    let right = known.to_lowercase();
    let mut likeness = strsim::jaro_winkler(wrong, &right);
    if wrong.len() > 2 && strsim::damerau_levenshtein(wrong, &right) <= 2 {
        likeness = likeness.max(0.95);
    }
    // Forgetting the unit is the commonest slip.
    if right
        .strip_prefix(wrong)
        .is_some_and(|rest| rest.starts_with('_'))
    {
        likeness = likeness.max(0.98);
    }
    likeness
}

/// Lower case, and no longer than comparing is worth.
fn comparable(name: &str) -> String {
    name.to_lowercase().chars().take(128).collect()
}

/// The known name nearest to a wrong one, if it is near enough to be meant.
pub(crate) fn nearest<'a>(name: &str, known: impl IntoIterator<Item = &'a str>) -> Option<String> {
    let wrong = comparable(name);
    known
        .into_iter()
        .map(|known| (likeness(&wrong, known), known))
        .filter(|(likeness, _)| *likeness >= NEAR)
        // The first of equals.
        .reduce(|best, other| if other.0 > best.0 { other } else { best })
        .map(|(_, name)| name.to_string())
}

impl Problem {
    pub(crate) fn unknown<'a>(
        what: &'static str,
        name: &str,
        known: impl IntoIterator<Item = &'a str> + Clone,
    ) -> Self {
        let nearest = nearest(name, known.clone());
        let mut known: Vec<String> = known.into_iter().map(str::to_string).collect();
        if known.len() > MAX_LISTED {
            let wrong = comparable(name);
            let rank = |known: &str| match likeness(&wrong, known) {
                faint if faint < FAINT => 0.0,
                like => like,
            };
            known.sort_by(|a, b| rank(b).total_cmp(&rank(a)));
        }
        Self::Unknown {
            what,
            name: name.to_string(),
            nearest,
            known,
            advice: String::new(),
        }
    }
}

/// A file or a text that cannot be used, or a result that cannot be written.
///
/// The message is one line (file, line and column or row, what was found, what was wanted);
/// problems in TOML are followed by the line itself with the place marked.
///
/// ```
/// let error = helio_io::parse_time("2026-06-21T12:00:00").unwrap_err();
/// assert!(error.to_string().contains("2026-06-21T12:00:00Z"), "{error}");
/// assert!(matches!(error.problem(), helio_io::Problem::Time { .. }));
/// ```
#[derive(Debug)]
pub struct IoError(Box<Inner>);

#[derive(Debug)]
struct Inner {
    place: Place,
    problem: Problem,
    quote: Option<Quote>,
    io: Option<io::Error>,
}

/// A line of the file with a part marked.
#[derive(Debug)]
struct Quote {
    line: usize,
    text: String,
    /// Characters before the mark, and characters marked.
    before: usize,
    marked: usize,
}

impl IoError {
    /// A problem at a place.
    #[must_use]
    pub fn new(place: Place, problem: Problem) -> Self {
        Self(Box::new(Inner {
            place,
            problem,
            quote: None,
            io: None,
        }))
    }

    /// A file that cannot be read.
    #[must_use]
    pub fn read(path: &Path, error: io::Error) -> Self {
        let problem = Problem::Unreadable {
            reason: said(&error),
        };
        Self(Box::new(Inner {
            place: Place::file(path),
            problem,
            quote: None,
            io: Some(error),
        }))
    }

    /// A file that cannot be written.
    #[must_use]
    pub fn write(path: &Path, error: io::Error) -> Self {
        let problem = Problem::Unwritable {
            reason: said(&error),
        };
        Self(Box::new(Inner {
            place: Place::file(path),
            problem,
            quote: None,
            io: Some(error),
        }))
    }

    /// A problem at a span of bytes of a text file, whose line is quoted.
    pub(crate) fn in_text(
        path: &Path,
        text: &str,
        span: Option<Range<usize>>,
        problem: Problem,
    ) -> Self {
        let Some(span) = span else {
            return Self::new(Place::file(path), problem);
        };
        let start = floor_char_boundary(text, span.start);
        let end = floor_char_boundary(text, span.end.max(start));
        let line_start = text[..start].rfind('\n').map_or(0, |at| at + 1);
        let line = text[..start].matches('\n').count() + 1;
        let whole = text[line_start..].lines().next().unwrap_or("");
        let before = text[line_start..start].chars().count();
        let place = Place {
            line: Some(line),
            column: Some(before + 1),
            ..Place::file(path)
        };
        let marked = text[start..end]
            .lines()
            .next()
            .unwrap_or("")
            .chars()
            .count()
            .max(1);
        let quote = Some(Quote {
            line,
            text: whole.to_string(),
            before,
            marked,
        });
        Self(Box::new(Inner {
            place,
            problem,
            quote,
            io: None,
        }))
    }

    /// Where the problem lies.
    #[must_use]
    pub fn place(&self) -> &Place {
        &self.0.place
    }

    /// What is wrong.
    #[must_use]
    pub fn problem(&self) -> &Problem {
        &self.0.problem
    }

    /// The kind of system error behind this one, for instance a closed pipe.
    #[must_use]
    pub fn io_kind(&self) -> Option<io::ErrorKind> {
        self.0.io.as_ref().map(io::Error::kind)
    }
}

impl fmt::Display for IoError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let place = self.0.place.to_string();
        let separator = match &self.0.problem {
            _ if place.is_empty() => "",
            // "column `x` must be …", where the place is the subject of the sentence.
            Problem::WrongKind { what, .. }
            | Problem::NotFinite { what, .. }
            | Problem::OutOfRange { what, .. }
                if what.is_empty() =>
            {
                " "
            }
            _ => ": ",
        };
        write!(f, "{place}{separator}{}", self.0.problem)?;
        if let Some(quote) = &self.0.quote {
            let skipped = quote.before.saturating_sub(MAX_BESIDE);
            let ellipsis = if skipped > 0 { "…" } else { "" };
            let width = (quote.before - skipped + quote.marked).min(2 * MAX_BESIDE) + MAX_BESIDE;
            let visible = |c: char| if c.is_control() { ' ' } else { c };
            let shown: String = quote
                .text
                .chars()
                .skip(skipped)
                .take(width)
                .map(visible)
                .collect();
            let line = quote.line.to_string();
            let pad = " ".repeat(quote.before - skipped + ellipsis.chars().count());
            let most = shown
                .chars()
                .count()
                .saturating_sub(quote.before - skipped)
                .max(1);
            let marks = "^".repeat(quote.marked.min(most));
            let shown = shown.trim_end();
            write!(f, "\n  {line} | {ellipsis}{shown}")?;
            write!(f, "\n  {} | {pad}{marks}", " ".repeat(line.len()))?;
        }
        Ok(())
    }
}

impl std::error::Error for IoError {
    fn source(&self) -> Option<&(dyn std::error::Error + 'static)> {
        self.0.io.as_ref().map(|error| error as _)
    }
}

/// The system's reason in words of ours where they are plainer.
pub(crate) fn said(error: &io::Error) -> String {
    match error.kind() {
        io::ErrorKind::NotFound => "no such file".to_string(),
        io::ErrorKind::PermissionDenied => "permission denied".to_string(),
        io::ErrorKind::IsADirectory => "it is a folder, not a file".to_string(),
        io::ErrorKind::NotADirectory => "part of its path is a file, not a folder".to_string(),
        io::ErrorKind::StorageFull => "no space left".to_string(),
        _ => error.to_string(),
    }
}

/// The last character boundary at or before a byte; spans come from a parser, but trust nobody.
fn floor_char_boundary(text: &str, at: usize) -> usize {
    let mut at = at.min(text.len());
    while !text.is_char_boundary(at) {
        at -= 1;
    }
    at
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn near_names_are_found_and_far_ones_are_not() {
        let known = ["latitude_deg", "longitude_deg", "elevation_m"];
        assert_eq!(nearest("latitude", known).as_deref(), Some("latitude_deg"));
        assert_eq!(
            nearest("Longitude_deg", known).as_deref(),
            Some("longitude_deg")
        );
        assert_eq!(nearest("elevaton_m", known).as_deref(), Some("elevation_m"));
        assert_eq!(nearest("colour", known), None);
    }

    #[test]
    fn quotes_are_cut_and_escaped() {
        assert_eq!(quoted("a\tb"), "`a\\tb`");
        let long = quoted(&"x".repeat(1000));
        assert_eq!(long.chars().count(), MAX_SHOWN + 3);
    }

    #[test]
    fn any_span_can_be_quoted() {
        let text = "ä = 1\n\nlong = \"äöü\"";
        for start in 0..=text.len() + 2 {
            for end in 0..=text.len() + 2 {
                let problem = Problem::Empty { what: "x".into() };
                let error = IoError::in_text(Path::new("f"), text, Some(start..end), problem);
                assert!(error.to_string().starts_with("f:"));
            }
        }
    }
}
