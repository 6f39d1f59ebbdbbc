//! CSV.

use std::path::Path;

use crate::error::{IoError, Place, Problem};

use super::decode;

/// The rows of a CSV file below its header, each with as many cells as that.
///
/// One text and where its cells end: a million rows cost no allocations of their own.
#[derive(Debug)]
pub(super) struct Records {
    text: String,
    ends: Vec<usize>,
    columns: usize,
    lines: Vec<usize>,
}

impl Records {
    pub(super) fn len(&self) -> usize {
        self.lines.len()
    }

    pub(super) fn line(&self, row: usize) -> usize {
        self.lines[row]
    }

    pub(super) fn lines(&self) -> &[usize] {
        &self.lines
    }

    /// Without blanks around it.
    pub(super) fn cell(&self, row: usize, column: usize) -> &str {
        let cell = row * self.columns + column;
        let start = cell.checked_sub(1).map_or(0, |before| self.ends[before]);
        &self.text[start..self.ends[cell]]
    }
}

pub(super) fn read(path: &Path, bytes: Vec<u8>) -> Result<(Vec<String>, Records), IoError> {
    let text = decode(path, bytes)?;
    let at = |line: Option<usize>, problem| {
        IoError::new(
            Place {
                line,
                ..Place::file(path)
            },
            problem,
        )
    };
    if text.trim_start().starts_with(['[', '{']) {
        let message = "it looks like JSON, which is not read; give CSV or Parquet".to_string();
        return Err(at(None, Problem::Conflict { message }));
    }
    // Ragged rows are found below, in words of ours.
    let mut reader = csv::ReaderBuilder::new()
        .has_headers(false)
        .flexible(true)
        .trim(csv::Trim::All)
        .from_reader(text.as_bytes());
    let mut lines = Lines {
        text: text.as_bytes(),
        offset: 0,
        line: 1,
    };
    let mut names: Option<Vec<String>> = None;
    let mut records = Records {
        text: String::with_capacity(text.len()),
        ends: Vec::new(),
        columns: 0,
        lines: Vec::new(),
    };
    let mut record = csv::StringRecord::new();
    loop {
        match reader.read_record(&mut record) {
            Ok(false) => break,
            Ok(true) => {}
            Err(error) => {
                let line = error
                    .position()
                    .and_then(|p| usize::try_from(p.line()).ok());
                let message = error.to_string();
                return Err(at(
                    line,
                    Problem::Syntax {
                        format: "CSV",
                        message,
                    },
                ));
            }
        }
        let byte = record.position().map_or(0, csv::Position::byte);
        let line = lines.at(usize::try_from(byte).unwrap_or(usize::MAX));
        let Some(names) = &names else {
            names = Some(record.iter().map(str::to_string).collect());
            records.columns = record.len();
            continue;
        };
        if record.len() != names.len() {
            let problem = Problem::Ragged {
                found: record.len(),
                wanted: names.len(),
            };
            return Err(at(Some(line), problem));
        }
        records.lines.push(line);
        for cell in &record {
            records.text.push_str(cell);
            records.ends.push(records.text.len());
        }
    }
    match names {
        Some(names) => Ok((names, records)),
        None => Err(at(
            None,
            Problem::Empty {
                what: "the file is empty; it needs a header".into(),
            },
        )),
    }
}

/// Line numbers of ascending byte offsets: the reader's own count does not step over blank lines.
struct Lines<'a> {
    text: &'a [u8],
    offset: usize,
    line: usize,
}

impl Lines<'_> {
    /// The line of the first byte at or after `offset` that is not a line end.
    fn at(&mut self, offset: usize) -> usize {
        while let Some(byte) = self.text.get(self.offset) {
            if self.offset >= offset && !matches!(byte, b'\n' | b'\r') {
                break;
            }
            self.line += usize::from(*byte == b'\n');
            self.offset += 1;
        }
        self.line
    }
}
