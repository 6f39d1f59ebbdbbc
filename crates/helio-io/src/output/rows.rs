//! A block whose columns were checked to fit together.

use std::ops::Range;

use helio_core::Status;

use super::{Layout, Moment, Moments, Rows};
use crate::{IoError, Place, Problem};

/// A block of rows with columns of equal length.
pub(super) struct Checked<'a> {
    pub(super) moments: Moments<'a>,
    ends: Option<&'a [usize]>,
    pub(super) heliostats: Option<&'a [u32]>,
    pub(super) numbers: &'a [&'a [f64]],
    pub(super) status: &'a [Status],
    field: usize,
}

impl<'a> Checked<'a> {
    pub(super) fn new(layout: &Layout, rows: &Rows<'a>) -> Result<Self, IoError> {
        let equal = |what: &str, expected: usize, got: usize| {
            if expected == got {
                return Ok(());
            }
            let message = format!("table block: {what}: expected {expected} entries, got {got}");
            Err(IoError::new(
                Place::default(),
                Problem::Conflict { message },
            ))
        };
        let suns = rows.moments.len();
        match (rows.moments, layout.moment) {
            (Moments::Times { .. }, Moment::Time) => {}
            (Moments::SunAngles { elevation_deg, .. }, Moment::SunAngles) => {
                equal("sun_elevation_deg", suns, elevation_deg.len())?;
            }
            (Moments::Times { .. }, Moment::SunAngles) => equal("sun_azimuth_deg", suns, 0)?,
            (Moments::SunAngles { .. }, Moment::Time) => equal("time", suns, 0)?,
        }
        let field = layout.ids.len();
        let len = match rows.ends {
            None => suns * field,
            Some(ends) => {
                equal("ends", suns, ends.len())?;
                if let Some(row) = (1..ends.len()).find(|&i| ends[i] < ends[i - 1]) {
                    equal("ends in order", ends[row - 1], ends[row])?;
                }
                ends.last().copied().unwrap_or(0)
            }
        };
        if let Some(heliostats) = rows.heliostats {
            equal("heliostats", len, heliostats.len())?;
            if let Some(&beyond) = heliostats.iter().find(|&&h| h as usize >= field) {
                equal(
                    "heliostat index below the number of ids",
                    field,
                    beyond as usize,
                )?;
            }
        } else if rows.ends.is_some() {
            equal("heliostats", len, 0)?;
        }
        equal(
            "columns of numbers",
            layout.numbers.len(),
            rows.numbers.len(),
        )?;
        for (number, column) in layout.numbers.iter().zip(rows.numbers) {
            equal(&number.name, len, column.len())?;
        }
        equal("status", len, rows.status.len())?;
        Ok(Self {
            moments: rows.moments,
            ends: rows.ends,
            heliostats: rows.heliostats,
            numbers: rows.numbers,
            status: rows.status,
            field,
        })
    }

    /// Number of rows.
    pub(super) fn len(&self) -> usize {
        self.status.len()
    }

    /// The heliostat of a row.
    #[inline]
    pub(super) fn heliostat(&self, row: usize) -> usize {
        match self.heliostats {
            Some(heliostats) => heliostats[row] as usize,
            None => row % self.field,
        }
    }

    /// The suns of a range of rows, each with its part of the range.
    pub(super) fn suns(&self, range: Range<usize>) -> impl Iterator<Item = (usize, Range<usize>)> {
        let end_of = move |sun: usize| match self.ends {
            Some(ends) => ends[sun],
            None => (sun + 1) * self.field,
        };
        let first = match self.ends {
            Some(ends) => ends.partition_point(|&end| end <= range.start),
            None => range.start / self.field.max(1),
        };
        let mut sun = first;
        let mut start = range.start;
        std::iter::from_fn(move || {
            while start < range.end {
                let this = sun;
                let end = end_of(this).min(range.end);
                sun += 1;
                if end > start {
                    let part = start..end;
                    start = end;
                    return Some((this, part));
                }
            }
            None
        })
    }
}
