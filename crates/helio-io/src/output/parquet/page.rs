//! Pages: headers in Thrift's compact protocol, bodies compressed with zstd.

use std::cell::RefCell;
use std::path::Path;

use super::hybrid::varint;
use crate::IoError;

/// zstd level of everything: higher ones hardly shrink the noise in the low bytes of doubles.
const ZSTD_LEVEL: i32 = 1;

/// Encodings used, by their number in the Parquet format.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[repr(u8)]
pub(super) enum Coding {
    Rle = 3,
    DeltaBinaryPacked = 5,
    RleDictionary = 8,
    ByteStreamSplit = 9,
}

/// What a page holds.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Kind {
    Dictionary,
    Data(Coding),
}

/// A page ready to be written: its header, then its body.
#[derive(Debug, Default)]
pub(super) struct Page {
    pub(super) header: Vec<u8>,
    pub(super) body: Vec<u8>,
    /// Header and body before compression.
    pub(super) raw_bytes: usize,
}

impl Page {
    pub(super) fn bytes(&self) -> usize {
        self.header.len() + self.body.len()
    }
}

/// Memory that a thread keeps from page to page.
struct Workshop {
    zstd: Option<zstd::bulk::Compressor<'static>>,
    desk: Desk,
}

/// Where a page's body is put together.
#[derive(Default)]
pub(super) struct Desk {
    /// Empty at the start of a page.
    pub(super) raw: Vec<u8>,
    /// Keeps its length and old contents, which saves filling a megabyte with zeros.
    pub(super) wide: Vec<u8>,
    /// Values of a page without its nulls.
    pub(super) dense: Vec<f64>,
}

thread_local! {
    static WORKSHOP: RefCell<Workshop> = RefCell::new(Workshop { zstd: None, desk: Desk::default() });
}

/// Makes a page; `fill` puts together its body before compression.
pub(super) fn page(
    kind: Kind,
    values: usize,
    body: Vec<u8>,
    name: &Path,
    fill: impl for<'a> FnOnce(&'a mut Desk) -> &'a [u8],
) -> Result<Page, IoError> {
    WORKSHOP.with_borrow_mut(|workshop| {
        let Workshop { zstd, desk } = workshop;
        desk.raw.clear();
        let raw = fill(desk);
        let mut page = Page {
            body,
            ..Page::default()
        };
        let failed = |e| IoError::write(name, e);
        let zstd = match zstd {
            Some(zstd) => zstd,
            none => none.insert(zstd::bulk::Compressor::new(ZSTD_LEVEL).map_err(failed)?),
        };
        page.body.clear();
        page.body
            .reserve(zstd::zstd_safe::compress_bound(raw.len()));
        zstd.compress_to_buffer(raw, &mut page.body)
            .map_err(failed)?;
        header(kind, values, raw.len(), page.body.len(), &mut page.header);
        page.raw_bytes = page.header.len() + raw.len();
        Ok(page)
    })
}

/// The page header of `parquet.thrift`. Each field is its step from the one before and its type
/// in one byte, then its value; a zero ends a struct.
fn header(kind: Kind, values: usize, raw: usize, compressed: usize, out: &mut Vec<u8>) {
    const I32: u8 = 5;
    const STRUCT: u8 = 12;
    let i32_field = |step: u8, value: usize, out: &mut Vec<u8>| {
        out.push(step << 4 | I32);
        varint((value as u64) << 1, out); // zigzag of a number that is not negative
    };
    let (page_type, at) = match kind {
        Kind::Data(_) => (0, 5),
        Kind::Dictionary => (2, 7),
    };
    i32_field(1, page_type, out);
    i32_field(1, raw, out);
    i32_field(1, compressed, out);
    out.push((at - 3) << 4 | STRUCT);
    i32_field(1, values, out);
    match kind {
        Kind::Data(coding) => {
            i32_field(1, coding as usize, out);
            i32_field(1, Coding::Rle as usize, out); // definition levels
            i32_field(1, Coding::Rle as usize, out); // repetition levels
        }
        Kind::Dictionary => i32_field(1, 0, out), // plain
    }
    out.extend_from_slice(&[0, 0]);
}
