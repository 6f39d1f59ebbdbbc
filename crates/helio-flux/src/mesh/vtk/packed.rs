//! Arrays that are not text: inline or appended, raw or as base64, plain or packed with zlib.

use std::io::Read as _;

use base64::Engine as _;
use base64::engine::general_purpose::STANDARD;
use flate2::read::ZlibDecoder;

use super::xml::{Array, File, Written};
use crate::mesh::error::{ReadError, ReadProblem};

impl<'a> File<'a> {
    /// The bytes of an array that is not text.
    pub(super) fn unpack(&mut self, array: &Array<'a>) -> Result<Vec<u8>, ReadError> {
        let (text, raw) = match array.written {
            Written::Text(text) | Written::Binary(text) => (text.trim_ascii(), false),
            Written::Appended(offset) => match self.appended.get(offset..) {
                Some(rest) => (rest, self.appended_raw),
                None => {
                    let wanted = format!("below {}, the appended bytes", self.appended.len());
                    let found = offset.to_string();
                    return Err(self.wrong(array.at, "offset", &wanted, &found));
                }
            },
        };
        let mut stream = Stream {
            text,
            raw,
            at: array.at,
        };
        let size = if self.wide_header { 8 } else { 4 };
        if !self.zlib {
            let head = stream.peek(self, size)?;
            let count = self.header(&head, 0);
            self.spend(count)?;
            let whole = size as u64 + count;
            let whole = usize::try_from(whole).unwrap_or(usize::MAX);
            return Ok(stream.take(self, whole)?.split_off(size));
        }
        let blocks = stream.peek(self, size)?;
        let blocks = self.header(&blocks, 0);
        // Each block has at least its size in the head.
        let most = text.len() as u64 / size as u64;
        if blocks > most {
            let wanted = format!("at most {most}");
            let found = blocks.to_string();
            return Err(self.wrong(array.at, "number of blocks", &wanted, &found));
        }
        if blocks == 0 {
            return Ok(Vec::new());
        }
        let head = stream.take(self, size * (3 + blocks as usize))?;
        let (block, last) = (self.header(&head, 1), self.header(&head, 2));
        let mut packed = 0_u64;
        for k in 0..blocks as usize {
            packed = packed.saturating_add(self.header(&head, 3 + k));
        }
        let packed = stream.take(self, usize::try_from(packed).unwrap_or(usize::MAX))?;
        let mut out = Vec::new();
        let mut from = 0;
        for k in 0..blocks {
            let size = self.header(&head, 3 + k as usize) as usize;
            let wanted = if k + 1 == blocks && last > 0 {
                last
            } else {
                block
            };
            self.spend(wanted)?;
            let before = out.len() as u64;
            let of_block = &packed[from..from + size];
            from += size;
            // One byte more than wanted tells that there is more.
            let unpacked = ZlibDecoder::new(of_block)
                .take(wanted.saturating_add(1))
                .read_to_end(&mut out);
            if unpacked.is_err() || out.len() as u64 - before != wanted {
                let found = match unpacked {
                    Ok(count) => format!("{count} bytes or more"),
                    Err(error) => error.to_string(),
                };
                let wanted = format!("{wanted} bytes packed with zlib");
                return Err(self.wrong(array.at, &array.name, &wanted, &found));
            }
        }
        Ok(out)
    }

    /// A number of the head of an array.
    fn header(&self, head: &[u8], place: usize) -> u64 {
        let size = if self.wide_header { 8 } else { 4 };
        let mut bytes = [0; 8];
        bytes[..size].copy_from_slice(&head[place * size..(place + 1) * size]);
        if self.big_endian {
            bytes[..size].reverse();
        }
        u64::from_le_bytes(bytes)
    }

    fn spend(&mut self, bytes: u64) -> Result<(), ReadError> {
        self.unpacked = self.unpacked.saturating_add(bytes);
        let most = self.source.options.limits.bytes;
        self.source.at_most("bytes unpacked", self.unpacked, most)
    }
}

/// Bytes of an array, raw or as base64.
struct Stream<'a> {
    text: &'a [u8],
    raw: bool,
    at: usize,
}

impl Stream<'_> {
    /// The first so many bytes, which stay.
    fn peek(&self, file: &File<'_>, count: usize) -> Result<Vec<u8>, ReadError> {
        let ended = || {
            let inside = "the bytes of an array".to_owned();
            file.error(self.at, ReadProblem::Ended { inside })
        };
        if self.raw {
            return self.text.get(..count).map(<[u8]>::to_vec).ok_or_else(ended);
        }
        let coded = count.div_ceil(3).checked_mul(4).ok_or_else(ended)?;
        let text = self.text.get(..coded).ok_or_else(ended)?;
        // What is behind the bytes wanted may be the start of more, or filling.
        let mut bytes = STANDARD.decode(text).map_err(|error| {
            let found = error.to_string();
            file.wrong(self.at, "an array", "base64", &found)
        })?;
        if bytes.len() < count {
            return Err(ended());
        }
        bytes.truncate(count);
        Ok(bytes)
    }

    /// The next so many bytes, encoded by themselves.
    fn take(&mut self, file: &File<'_>, count: usize) -> Result<Vec<u8>, ReadError> {
        let bytes = self.peek(file, count)?;
        let passed = if self.raw {
            count
        } else {
            count.div_ceil(3) * 4
        };
        self.text = &self.text[passed..];
        Ok(bytes)
    }
}
