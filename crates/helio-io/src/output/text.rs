//! CSV, JSON and JSON lines.

use std::io::Write as _;
use std::ops::Range;

use helio_core::Status;
use rayon::prelude::*;

use super::rows::Checked;
use super::sink::{Piece, Sink};
use super::{Format, Layout, Moments, Scale};
use crate::{IoError, format_time};

/// Rows that one task turns into text: about a megabyte.
const ROWS_PER_TASK: usize = 8192;

#[derive(Debug)]
pub(super) struct TextEncoder {
    format: Format,
    /// Everything of a row before its first number that depends on the heliostat only.
    ids: Vec<Box<[u8]>>,
    /// What stands before each number.
    before: Vec<Box<[u8]>>,
    started: bool,
}

impl TextEncoder {
    pub(super) fn new(layout: &Layout, format: Format) -> Self {
        let csv = format == Format::Csv;
        let ids = layout
            .ids
            .iter()
            .map(|id| {
                if csv {
                    format!(",{}", csv_text(id)).into_bytes().into()
                } else {
                    format!(",\"id\":{}", json_text(id)).into_bytes().into()
                }
            })
            .collect();
        let before = layout
            .numbers
            .iter()
            .map(|number| {
                if csv {
                    Box::from(*b",")
                } else {
                    format!(",{}:", json_text(&number.name)).into_bytes().into()
                }
            })
            .collect();
        Self {
            format,
            ids,
            before,
            started: false,
        }
    }

    pub(super) fn begin(&self, layout: &Layout, sink: &mut Sink) -> Result<(), IoError> {
        match self.format {
            Format::Csv => {
                let headings: Vec<_> = layout.headings().into_iter().map(csv_text).collect();
                sink.send(Piece::Owned(
                    format!("{}\n", headings.join(",")).into_bytes(),
                ))
            }
            Format::Json => sink.send(Piece::Owned(b"[".to_vec())),
            _ => Ok(()),
        }
    }

    pub(super) fn end(&self, sink: &mut Sink) -> Result<(), IoError> {
        match self.format {
            Format::Json => sink.send(Piece::Owned(b"\n]\n".to_vec())),
            _ => Ok(()),
        }
    }

    pub(super) fn encode(
        &mut self,
        layout: &Layout,
        block: &Checked<'_>,
        sink: &mut Sink,
    ) -> Result<(), IoError> {
        let moments = self.moments(&block.moments);
        let tasks = block.len().div_ceil(ROWS_PER_TASK);
        let first_of_table = !std::mem::replace(&mut self.started, true);
        let mut pieces = sink.buffers(tasks);
        pieces.par_iter_mut().enumerate().for_each(|(task, out)| {
            let start = task * ROWS_PER_TASK;
            let range = start..(start + ROWS_PER_TASK).min(block.len());
            self.write_rows(
                layout,
                block,
                &moments,
                range,
                first_of_table && task == 0,
                out,
            );
        });
        for piece in pieces {
            sink.send(Piece::Owned(piece))?;
        }
        Ok(())
    }

    /// What starts the rows of each sun.
    fn moments(&self, moments: &Moments<'_>) -> Vec<Box<[u8]>> {
        let csv = self.format == Format::Csv;
        match *moments {
            Moments::Times { unix_ns } => unix_ns
                .iter()
                .map(|&unix_ns| {
                    let time = format_time(unix_ns);
                    let text = if csv {
                        time
                    } else {
                        format!("{{\"time\":\"{time}\"")
                    };
                    text.into_bytes().into()
                })
                .collect(),
            Moments::SunAngles {
                azimuth_deg,
                elevation_deg,
            } => azimuth_deg
                .iter()
                .zip(elevation_deg)
                .map(|(&azimuth_deg, &elevation_deg)| {
                    let mut text = Vec::new();
                    if !csv {
                        text.extend_from_slice(b"{\"sun_azimuth_deg\":");
                    }
                    self.number(Scale::Plain, azimuth_deg, &mut text);
                    text.extend_from_slice(if csv {
                        b","
                    } else {
                        b",\"sun_elevation_deg\":"
                    });
                    self.number(Scale::Plain, elevation_deg, &mut text);
                    text.into()
                })
                .collect(),
        }
    }

    fn write_rows(
        &self,
        layout: &Layout,
        block: &Checked<'_>,
        moments: &[Box<[u8]>],
        range: Range<usize>,
        first_of_table: bool,
        out: &mut Vec<u8>,
    ) {
        let (before_row, before_status, after_status): (&[u8], &[u8], &[u8]) = match self.format {
            Format::Csv => (b"", b",", b"\n"),
            Format::Json => (b",\n", b",\"status\":\"", b"\"}"),
            _ => (b"", b",\"status\":\"", b"\"}\n"),
        };
        let mut separator = if first_of_table && self.format == Format::Json {
            &b"\n"[..]
        } else {
            before_row
        };
        for (sun, part) in block.suns(range) {
            let moment = &moments[sun];
            for row in part {
                out.extend_from_slice(separator);
                separator = before_row;
                out.extend_from_slice(moment);
                out.extend_from_slice(&self.ids[block.heliostat(row)]);
                let status = block.status[row];
                for ((number, before), column) in
                    layout.numbers.iter().zip(&self.before).zip(block.numbers)
                {
                    out.extend_from_slice(before);
                    let value = if number.carried_by(status) {
                        column[row]
                    } else {
                        f64::NAN
                    };
                    self.number(number.scale, value, out);
                }
                out.extend_from_slice(before_status);
                out.extend_from_slice(Status::as_str(status).as_bytes());
                out.extend_from_slice(after_status);
            }
        }
    }

    #[inline]
    fn number(&self, scale: Scale, value: f64, out: &mut Vec<u8>) {
        let value = scale.apply(value);
        if !value.is_finite() {
            if self.format != Format::Csv {
                out.extend_from_slice(b"null");
            }
        } else if scale == Scale::Whole {
            // Writing to a vector cannot fail.
            let _ = write!(out, "{}", value as i64);
        } else {
            out.extend_from_slice(zmij::Buffer::new().format_finite(value).as_bytes());
        }
    }
}

/// A field of a CSV row, quoted where it has to be.
pub(super) fn csv_text(text: &str) -> String {
    if text.contains(['"', ',', '\n', '\r']) {
        format!("\"{}\"", text.replace('"', "\"\""))
    } else {
        text.to_owned()
    }
}

/// A JSON string with its quotes.
pub(super) fn json_text(text: &str) -> String {
    let mut quoted = String::with_capacity(text.len() + 2);
    quoted.push('"');
    for c in text.chars() {
        match c {
            '"' => quoted.push_str("\\\""),
            '\\' => quoted.push_str("\\\\"),
            c if u32::from(c) < 0x20 => quoted.push_str(&format!("\\u{:04x}", u32::from(c))),
            c => quoted.push(c),
        }
    }
    quoted.push('"');
    quoted
}
