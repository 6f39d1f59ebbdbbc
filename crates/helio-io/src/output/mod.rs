//! Streaming writers of result tables: CSV, Parquet, JSON and JSON lines, in bounded memory.
//!
//! A result has a row for each sun and heliostat: sun by sun, heliostats in field order. It is
//! handed over in blocks of whole suns, as the columns the computation left behind; angles are
//! converted to the unit written (degrees, milliradians) on the way, so nothing is copied for it.
//! Blocks are encoded on all threads of the current rayon pool while another thread writes.
//!
//! | | CSV | JSON | Parquet |
//! |---|---|---|---|
//! | time | RFC 3339, `Z` | same | timestamp(ns, UTC), dictionary |
//! | id, status | text | text | dictionary |
//! | numbers | shortest text that reads back as the same double | same | f64, byte-stream split, zstd 1 |
//! | whole numbers | digits | digits | i64, delta encoding, zstd 1 |
//! | a number that does not exist | empty | `null` | null |
//!
//! A file is written beside its destination and renamed when it is complete, so a failed run
//! leaves nothing behind. Destinations that are not regular files (a device, a named pipe) are
//! written directly. Small tables without suns are written by [`write_table`] and [`write_columns`].
//!
//! ```
//! use helio_core::Status;
//! use helio_io::output::{Destination, Format, Layout, Moment, Moments, Number, Rows, TableWriter};
//!
//! let folder = tempfile::tempdir()?;
//! let path = folder.path().join("angles.csv");
//! let layout = Layout {
//!     ids: vec!["A1".into(), "A2".into()],
//!     moment: Moment::Time,
//!     numbers: vec![Number::degrees("azimuth_deg")],
//! };
//! let mut writer = TableWriter::create(Destination::File(path.clone()), Format::Csv, layout)?;
//! writer.write(&Rows {
//!     moments: Moments::Times { unix_ns: &[1_750_507_200_000_000_000] },
//!     ends: None,
//!     heliostats: None,
//!     numbers: &[&[std::f64::consts::PI, f64::NAN]],
//!     status: &[Status::Ok, Status::Unreachable],
//! })?;
//! writer.finish()?;
//! assert_eq!(
//!     std::fs::read_to_string(path)?,
//!     "time,id,azimuth_deg,status\n\
//!      2025-06-21T12:00:00Z,A1,180.0,ok\n\
//!      2025-06-21T12:00:00Z,A2,,unreachable\n"
//! );
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

mod kept;
mod parquet;
mod plain;
mod rows;
mod sink;
mod text;

use std::path::Path;

use helio_core::Status;

pub use kept::kept_rows;
pub use plain::{Cells, KeptCells, KeptColumns, write_columns, write_table};
pub use sink::Destination;

use rows::Checked;

use crate::IoError;

/// How a table is written.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Format {
    /// Comma-separated values with a heading.
    Csv,
    /// Apache Parquet.
    Parquet,
    /// One JSON array of objects, an object per line.
    Json,
    /// JSON lines: an object per line and nothing around them.
    JsonLines,
}

impl Format {
    /// Every format.
    pub const ALL: [Self; 4] = [Self::Csv, Self::Parquet, Self::Json, Self::JsonLines];

    /// The word used for it on the command line.
    #[must_use]
    pub const fn as_str(self) -> &'static str {
        match self {
            Self::Csv => "csv",
            Self::Parquet => "parquet",
            Self::Json => "json",
            Self::JsonLines => "jsonl",
        }
    }

    /// The format of a word, if it is one.
    #[must_use]
    pub fn from_word(word: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|format| format.as_str() == word)
    }

    /// The format that a file's suffix stands for.
    ///
    /// ```
    /// use helio_io::output::Format;
    /// assert_eq!(Format::of_path("day.PARQUET".as_ref()), Some(Format::Parquet));
    /// assert_eq!(Format::of_path("day.xlsx".as_ref()), None);
    /// ```
    #[must_use]
    pub fn of_path(path: &Path) -> Option<Self> {
        let suffix = path.extension()?.to_str()?.to_ascii_lowercase();
        match suffix.as_str() {
            "ndjson" => Some(Self::JsonLines),
            "pq" => Some(Self::Parquet),
            other => Self::from_word(other),
        }
    }

    /// Rows that a block should have, to keep all threads busy in little memory; for Parquet this
    /// is the size of a row group.
    #[must_use]
    pub const fn rows_per_block(self) -> usize {
        match self {
            Self::Parquet => 1 << 20,
            _ => 1 << 18,
        }
    }
}

/// What tells the suns of a table apart.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Moment {
    /// Column `time`.
    Time,
    /// Columns `sun_azimuth_deg`, `sun_elevation_deg`.
    SunAngles,
}

/// How the numbers of a column are given and written.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Scale {
    /// As they are.
    Plain,
    /// Given in radians, written in degrees.
    Degrees,
    /// Given in radians, written in milliradians.
    Milliradians,
    /// Rounded to whole numbers.
    Whole,
}

impl Scale {
    #[inline(always)]
    fn apply(self, value: f64) -> f64 {
        match self {
            Self::Plain => value,
            Self::Degrees => helio_core::angle::degrees(value),
            Self::Milliradians => value * 1000.0,
            Self::Whole => value.round_ties_even(),
        }
    }
}

/// A column of numbers.
#[derive(Debug, Clone, PartialEq)]
pub struct Number {
    /// Heading, with the unit written.
    pub name: String,
    /// From the unit given to the unit written.
    pub scale: Scale,
    /// The status, besides `ok`, whose rows carry this number.
    pub also: Option<Status>,
}

impl Number {
    /// Numbers given in radians and written in degrees.
    #[must_use]
    pub fn degrees(name: &str) -> Self {
        Self::new(name, Scale::Degrees)
    }

    /// Numbers of a scale, for rows that are ok.
    #[must_use]
    pub fn new(name: &str, scale: Scale) -> Self {
        Self {
            name: name.to_owned(),
            scale,
            also: None,
        }
    }

    /// The same column, carried by rows of one more status.
    #[must_use]
    pub fn also(mut self, status: Status) -> Self {
        self.also = Some(status);
        self
    }

    /// Whether a row of this status may carry the number.
    #[inline(always)]
    fn carried_by(&self, status: Status) -> bool {
        status == Status::Ok || Some(status) == self.also
    }
}

/// The columns of a table: moment, id, numbers, status, in this order.
#[derive(Debug, Clone, PartialEq)]
pub struct Layout {
    /// Names of the heliostats.
    pub ids: Vec<String>,
    /// What tells the suns apart.
    pub moment: Moment,
    /// The columns of numbers.
    pub numbers: Vec<Number>,
}

impl Layout {
    /// Headings, in order.
    #[must_use]
    pub fn headings(&self) -> Vec<&str> {
        let mut headings = match self.moment {
            Moment::Time => vec!["time"],
            Moment::SunAngles => vec!["sun_azimuth_deg", "sun_elevation_deg"],
        };
        headings.push("id");
        headings.extend(self.numbers.iter().map(|number| number.name.as_str()));
        headings.push("status");
        headings
    }

    /// Suns that a block should hold, at least one.
    #[must_use]
    pub fn suns_per_block(&self, format: Format) -> usize {
        (format.rows_per_block() / self.ids.len().max(1)).max(1)
    }
}

/// The suns of a block, one entry each.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Moments<'a> {
    /// Times \[ns\] since 1970-01-01T00:00:00Z.
    Times {
        /// One per sun.
        unix_ns: &'a [i64],
    },
    /// Given sun angles \[deg\].
    SunAngles {
        /// Clockwise from north.
        azimuth_deg: &'a [f64],
        /// Up from the horizon.
        elevation_deg: &'a [f64],
    },
}

impl Moments<'_> {
    fn len(&self) -> usize {
        match self {
            Self::Times { unix_ns } => unix_ns.len(),
            Self::SunAngles { azimuth_deg, .. } => azimuth_deg.len(),
        }
    }
}

/// A block of rows, as columns.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Rows<'a> {
    /// The suns.
    pub moments: Moments<'a>,
    /// For each sun the row after its last; `None`: every sun has a row for every heliostat.
    pub ends: Option<&'a [usize]>,
    /// For each row its heliostat, as an index into [`Layout::ids`]; `None`: field order, again
    /// and again.
    pub heliostats: Option<&'a [u32]>,
    /// The columns of numbers, in the order of the layout. What is not finite is written as absent.
    pub numbers: &'a [&'a [f64]],
    /// The status of each row.
    pub status: &'a [Status],
}

/// What was written.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Written {
    /// Rows.
    pub rows: u64,
    /// Bytes, as they stand in the file.
    pub bytes: u64,
}

/// Writes a table block by block. Dropping it unfinished leaves no file behind.
#[derive(Debug)]
pub struct TableWriter {
    layout: Layout,
    encoder: Encoder,
    sink: sink::Sink,
    written: Written,
}

#[derive(Debug)]
enum Encoder {
    Text(text::TextEncoder),
    Parquet(Box<parquet::ParquetEncoder>),
}

impl TableWriter {
    /// Opens the destination.
    ///
    /// # Errors
    /// [`IoError`] if it cannot be created.
    pub fn create(
        destination: Destination,
        format: Format,
        layout: Layout,
    ) -> Result<Self, IoError> {
        let sink = sink::Sink::open(destination)?;
        let encoder = match format {
            Format::Parquet => Encoder::Parquet(Box::new(parquet::ParquetEncoder::new(
                &layout,
                sink.name(),
            )?)),
            text => Encoder::Text(text::TextEncoder::new(&layout, text)),
        };
        let mut writer = Self {
            layout,
            encoder,
            sink,
            written: Written::default(),
        };
        match &mut writer.encoder {
            Encoder::Text(text) => text.begin(&writer.layout, &mut writer.sink)?,
            Encoder::Parquet(parquet) => parquet.begin(&mut writer.sink)?,
        }
        Ok(writer)
    }

    /// The columns.
    #[must_use]
    pub fn layout(&self) -> &Layout {
        &self.layout
    }

    /// Writes a block; see [`Layout::suns_per_block`] for its best size.
    ///
    /// # Errors
    /// [`IoError`] if the columns do not fit together, or if writing fails (here, or in a
    /// block before this one: writing runs beside the encoding).
    pub fn write(&mut self, rows: &Rows<'_>) -> Result<(), IoError> {
        let block = Checked::new(&self.layout, rows)?;
        if block.len() == 0 {
            return Ok(());
        }
        match &mut self.encoder {
            Encoder::Text(text) => text.encode(&self.layout, &block, &mut self.sink)?,
            Encoder::Parquet(parquet) => parquet.encode(&self.layout, &block, &mut self.sink)?,
        }
        self.written.rows += block.len() as u64;
        Ok(())
    }

    /// Completes the table and puts the file in place.
    ///
    /// # Errors
    /// [`IoError`] if writing failed at any time; there is then no file.
    pub fn finish(mut self) -> Result<Written, IoError> {
        match &mut self.encoder {
            Encoder::Text(text) => text.end(&mut self.sink)?,
            Encoder::Parquet(parquet) => parquet.end(&mut self.sink)?,
        }
        self.written.bytes = self.sink.finish()?;
        Ok(self.written)
    }
}
