//! Words and binary numbers of files whose lines say little.

use super::error::{ReadError, ReadProblem};
use super::text::{self, Source, lossy};
use crate::vector::Vector;

/// A place in a file that is read word by word, or byte by byte where it is binary.
#[derive(Debug, Clone)]
pub(crate) struct Scan<'a> {
    pub(crate) source: Source<'a>,
    bytes: &'a [u8],
    at: usize,
    line: usize,
    big_endian: bool,
}

impl<'a> Scan<'a> {
    pub(crate) fn new(source: Source<'a>, bytes: &'a [u8]) -> Result<Self, ReadError> {
        source.check_bytes(bytes)?;
        Ok(Self {
            source,
            bytes,
            at: 0,
            line: 1,
            big_endian: false,
        })
    }

    /// Binary numbers from here on have their highest byte first.
    pub(crate) fn set_big_endian(&mut self) {
        self.big_endian = true;
    }

    /// The line of the place, counted from 1.
    pub(crate) const fn line(&self) -> usize {
        self.line
    }

    /// Bytes that are left.
    pub(crate) fn left(&self) -> usize {
        self.bytes.len() - self.at
    }

    fn skip_blanks(&mut self) {
        while let Some(&byte) = self.bytes.get(self.at) {
            if !byte.is_ascii_whitespace() {
                break;
            }
            self.line += usize::from(byte == b'\n');
            self.at += 1;
        }
    }

    /// The next word between blanks; it stands on [`line`](Self::line).
    pub(crate) fn word(&mut self) -> Option<&'a [u8]> {
        self.skip_blanks();
        let rest = &self.bytes[self.at..];
        let end = rest.iter().position(u8::is_ascii_whitespace);
        let word = &rest[..end.unwrap_or(rest.len())];
        self.at += word.len();
        (!word.is_empty()).then_some(word)
    }

    /// What is left of this line, without its end, which is passed.
    pub(crate) fn rest_of_line(&mut self) -> &'a [u8] {
        let rest = &self.bytes[self.at..];
        let end = rest.iter().position(|&b| b == b'\n');
        let text = &rest[..end.unwrap_or(rest.len())];
        self.at += text.len();
        if end.is_some() {
            self.at += 1;
            self.line += 1;
        }
        text
    }

    /// Passes lines up to one that begins with `mark`, which is passed too.
    pub(crate) fn skip_to(&mut self, mark: &[u8]) -> bool {
        let mut at = self.at;
        let mut line = self.line;
        while at < self.bytes.len() {
            let rest = &self.bytes[at..];
            let begins = (at == 0 || self.bytes[at - 1] == b'\n') && rest.starts_with(mark);
            if begins {
                self.at = at + mark.len();
                self.line = line;
                return true;
            }
            let Some(end) = rest.iter().position(|&b| b == b'\n') else {
                break;
            };
            at += end + 1;
            line += 1;
        }
        false
    }

    #[cold]
    pub(crate) fn ended(&self, inside: &str) -> ReadError {
        let inside = inside.to_owned();
        self.source.whole(ReadProblem::Ended { inside })
    }

    pub(crate) fn needed(&mut self, what: &str) -> Result<&'a [u8], ReadError> {
        match self.word() {
            Some(word) => Ok(word),
            None => Err(self.ended(what)),
        }
    }

    /// A whole number not below zero.
    pub(crate) fn whole(&mut self, what: &str) -> Result<u64, ReadError> {
        let word = self.needed(what)?;
        let wanted = "a whole number";
        text::whole(word).ok_or_else(|| self.source.wrong(self.line, what, wanted, &lossy(word)))
    }

    /// A whole number of either sign.
    pub(crate) fn signed(&mut self, what: &str) -> Result<i64, ReadError> {
        let word = self.needed(what)?;
        let number = std::str::from_utf8(word).ok().and_then(|w| w.parse().ok());
        let wanted = "a whole number";
        number.ok_or_else(|| self.source.wrong(self.line, what, wanted, &lossy(word)))
    }

    /// The number of a node or element.
    pub(crate) fn id(&mut self, what: &str) -> Result<u64, ReadError> {
        let word = self.needed(what)?;
        self.source.id(self.line, what, word)
    }

    /// Three lengths in metres from words in the units of the file.
    pub(crate) fn point_m(&mut self, what: &str) -> Result<Vector, ReadError> {
        let mut at_m = [0.0; 3];
        for at_m in &mut at_m {
            let word = self.needed(what)?;
            *at_m = self.source.length_m(self.line, what, word)?;
        }
        Ok(at_m)
    }

    /// A number, also one that is not finite.
    pub(crate) fn number(&mut self, what: &str) -> Result<f64, ReadError> {
        let word = self.needed(what)?;
        let wanted = "a number";
        text::number(word).ok_or_else(|| self.source.wrong(self.line, what, wanted, &lossy(word)))
    }

    /// So many bytes.
    pub(crate) fn take(&mut self, count: usize, what: &str) -> Result<&'a [u8], ReadError> {
        let rest = &self.bytes[self.at..];
        let Some(taken) = rest.get(..count) else {
            return Err(self.ended(what));
        };
        self.at += count;
        Ok(taken)
    }

    fn array<const N: usize>(&mut self, what: &str) -> Result<[u8; N], ReadError> {
        let mut out = [0; N];
        out.copy_from_slice(self.take(N, what)?);
        if self.big_endian {
            out.reverse();
        }
        Ok(out)
    }

    pub(crate) fn i32(&mut self, what: &str) -> Result<i32, ReadError> {
        self.array(what).map(i32::from_le_bytes)
    }

    pub(crate) fn u64(&mut self, what: &str) -> Result<u64, ReadError> {
        self.array(what).map(u64::from_le_bytes)
    }

    pub(crate) fn f64(&mut self, what: &str) -> Result<f64, ReadError> {
        self.array(what).map(f64::from_le_bytes)
    }

    /// Three lengths in metres from binary numbers.
    pub(crate) fn binary_point_m(&mut self, what: &str) -> Result<Vector, ReadError> {
        let at = [self.f64(what)?, self.f64(what)?, self.f64(what)?];
        self.source.point_m(what, at)
    }

    /// Refuses an announced number of things of which each takes at least so many bytes.
    pub(crate) fn announced(
        &self,
        what: &'static str,
        count: u64,
        bytes_each: usize,
    ) -> Result<(), ReadError> {
        let most = self.left() as u64 / bytes_each.max(1) as u64;
        if count > most {
            return Err(self.source.error(
                self.line,
                ReadProblem::Wrong {
                    what: format!("number of {what}"),
                    wanted: format!("at most {most}, for which the file has room"),
                    found: count.to_string(),
                },
            ));
        }
        Ok(())
    }
}
