//! Lines, words and numbers of text files, with the line each stands on.

use super::error::{ReadError, ReadProblem};
use super::options::ReadOptions;
use crate::vector::Vector;

/// Lines of a file, counted from 1, without their ends.
#[derive(Debug, Clone)]
pub(crate) struct Lines<'a> {
    rest: &'a [u8],
    line: usize,
}

impl<'a> Lines<'a> {
    pub(crate) fn new(bytes: &'a [u8]) -> Self {
        // A byte-order mark says nothing here.
        let rest = bytes.strip_prefix(b"\xEF\xBB\xBF").unwrap_or(bytes);
        Self { rest, line: 0 }
    }

    /// The line that was given last.
    pub(crate) const fn line(&self) -> usize {
        self.line
    }

    pub(crate) fn next(&mut self) -> Option<&'a [u8]> {
        if self.rest.is_empty() {
            return None;
        }
        let end = self.rest.iter().position(|&b| b == b'\n');
        let (line, rest) = match end {
            Some(end) => (&self.rest[..end], &self.rest[end + 1..]),
            None => (self.rest, &self.rest[self.rest.len()..]),
        };
        self.rest = rest;
        self.line += 1;
        Some(line.strip_suffix(b"\r").unwrap_or(line))
    }
}

/// Largest magnitude of a length \[m\]: beyond the distance of the sun, and fourth powers are finite.
pub(crate) const MOST_M: f64 = 1e12;

/// A file that is being read: its name and options, for numbers and errors.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Source<'a> {
    pub(crate) file: &'a str,
    pub(crate) options: &'a ReadOptions,
}

impl Source<'_> {
    #[cold]
    pub(crate) fn error(&self, line: usize, problem: ReadProblem) -> ReadError {
        ReadError::new(self.file, Some(line), problem)
    }

    #[cold]
    pub(crate) fn whole(&self, problem: ReadProblem) -> ReadError {
        ReadError::new(self.file, None, problem)
    }

    #[cold]
    pub(crate) fn wrong(&self, line: usize, what: &str, wanted: &str, found: &str) -> ReadError {
        let (what, wanted, found) = (what.to_owned(), wanted.to_owned(), found.to_owned());
        self.error(
            line,
            ReadProblem::Wrong {
                what,
                wanted,
                found,
            },
        )
    }

    /// Refuses more of something than the limits accept.
    pub(crate) fn at_most(
        &self,
        what: &'static str,
        found: u64,
        most: u64,
    ) -> Result<(), ReadError> {
        if found <= most {
            return Ok(());
        }
        Err(self.whole(ReadProblem::TooMany { what, found, most }))
    }

    pub(crate) fn check_bytes(&self, bytes: &[u8]) -> Result<(), ReadError> {
        self.at_most("bytes", bytes.len() as u64, self.options.limits.bytes)
    }

    /// The number of a node or element: a positive whole number.
    pub(crate) fn id(&self, line: usize, what: &str, text: &[u8]) -> Result<u64, ReadError> {
        match whole(text) {
            Some(id) if id > 0 => Ok(id),
            _ => Err(self.wrong(line, what, "a positive whole number", &lossy(text))),
        }
    }

    /// A length in metres from text in the units of the file.
    pub(crate) fn length_m(&self, line: usize, what: &str, text: &[u8]) -> Result<f64, ReadError> {
        self.length_of(line, what, text, self.options.metres_per_unit())
    }

    /// A length in metres from text in units of so many metres.
    pub(crate) fn length_of(
        &self,
        line: usize,
        what: &str,
        text: &[u8],
        metres_per_unit: f64,
    ) -> Result<f64, ReadError> {
        let Some(value) = number(text) else {
            return Err(self.wrong(line, what, "a number", &lossy(text)));
        };
        scaled_m(value, metres_per_unit)
            .ok_or_else(|| self.error(line, not_finite(what, &lossy(text), metres_per_unit)))
    }
}

impl Source<'_> {
    /// A point of a binary part.
    pub(crate) fn point_m(&self, what: &str, at: Vector) -> Result<Vector, ReadError> {
        self.point_of(None, what, at)
    }

    /// A point whose last word stands on a line.
    pub(crate) fn point_on(
        &self,
        line: usize,
        what: &str,
        at: Vector,
    ) -> Result<Vector, ReadError> {
        self.point_of(Some(line), what, at)
    }

    fn point_of(&self, line: Option<usize>, what: &str, at: Vector) -> Result<Vector, ReadError> {
        let metres_per_unit = self.options.metres_per_unit();
        let mut out = [0.0; 3];
        for (out, value) in out.iter_mut().zip(at) {
            *out = scaled_m(value, metres_per_unit).ok_or_else(|| {
                let problem = not_finite(what, &value.to_string(), metres_per_unit);
                ReadError::new(self.file, line, problem)
            })?;
        }
        Ok(out)
    }
}

fn not_finite(what: &str, found: &str, metres_per_unit: f64) -> ReadProblem {
    ReadProblem::NotFinite {
        what: what.to_owned(),
        most: MOST_M / metres_per_unit,
        found: found.to_owned(),
    }
}

/// Metres from units; `None` where it is not finite or beyond all measure.
fn scaled_m(value: f64, metres_per_unit: f64) -> Option<f64> {
    let length_m = value * metres_per_unit;
    (length_m.abs() <= MOST_M).then_some(length_m)
}

/// Foreign bytes as text for a message.
pub(crate) fn lossy(text: &[u8]) -> String {
    // A message shows its beginning only.
    String::from_utf8_lossy(&text[..text.len().min(400)]).into_owned()
}

pub(crate) fn trim(text: &[u8]) -> &[u8] {
    text.trim_ascii()
}

/// A whole number not below zero.
pub(crate) fn whole(text: &[u8]) -> Option<u64> {
    std::str::from_utf8(trim(text)).ok()?.parse().ok()
}

/// A number, also with the exponent letter D of Fortran; infinities and NaN come through.
pub(crate) fn number(text: &[u8]) -> Option<f64> {
    let text = std::str::from_utf8(trim(text)).ok()?;
    if let Ok(value) = text.parse() {
        return Some(value);
    }
    // Short, or it is no number.
    if text.len() <= 40 && text.contains(['d', 'D']) && !text.contains(['i', 'n', 'I', 'N']) {
        return text.replace(['d', 'D'], "e").parse().ok();
    }
    None
}

/// Cells between commas, blanks around them removed; an empty last cell is dropped.
pub(crate) fn cells(line: &[u8]) -> impl Iterator<Item = &[u8]> {
    let line = trim(line);
    let line = line.strip_suffix(b",").unwrap_or(line);
    line.split(|&b| b == b',').map(trim)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lines_of_every_end_are_counted() {
        let mut lines = Lines::new(b"\xEF\xBB\xBFa\r\n\nb");
        let mut all = Vec::new();
        while let Some(text) = lines.next() {
            all.push((lines.line(), text));
        }
        assert_eq!(all, [(1, &b"a"[..]), (2, &b""[..]), (3, &b"b"[..])]);
    }

    #[test]
    fn numbers_of_solvers_are_read() {
        for (text, value) in [
            ("1", 1.0),
            (" -1.5E-03 ", -1.5e-3),
            ("1.25D+02", 125.0),
            (".5", 0.5),
            ("5.", 5.0),
            ("+7d0", 7.0),
        ] {
            assert_eq!(number(text.as_bytes()), Some(value), "{text}");
        }
        for bad in ["", "1,5", "0x10", "1e", "d", "end", "1 2", "1e5d5"] {
            assert_eq!(number(bad.as_bytes()), None, "{bad}");
        }
        assert_eq!(whole(b"-1"), None);
        assert_eq!(whole(b"18446744073709551616"), None);
    }
}
