//! The records that were left aside.

use super::{Done, Run};
use crate::IoError;
use crate::field::LoadedField;
use crate::observations::{LeftAsideReason, Observations};
use crate::output::{Cells, Destination, Format, write_columns};

/// A record that was set aside.
#[derive(Debug, Clone, PartialEq)]
pub struct Rejected {
    /// Which record of the file.
    pub record: usize,
    /// Row of its heliostat in the field.
    pub row: usize,
    /// How far its beam was off \[mrad\].
    pub beam_mrad: f64,
    /// In a word.
    pub reason: String,
    /// In words.
    pub why: String,
}

impl Run<'_> {
    /// The records that the calibration of heliostats set aside.
    #[must_use]
    pub fn rejected(&self, done: &[Done]) -> Vec<Rejected> {
        let mut rows = Vec::new();
        for one in done {
            let of = &self.observations.heliostats[one.index];
            rows.extend(one.rejected.iter().map(|left| Rejected {
                record: of.records[left.row],
                row: of.row,
                beam_mrad: left.beam_mrad.0,
                reason: left.reason.clone(),
                why: left.words.clone(),
            }));
        }
        rows
    }
}

/// Writes the records that a calibration set aside, and those that were no use from the first; the number of bytes.
///
/// # Errors
/// [`IoError`] if it cannot be written, or if the observations are not those of their file.
pub fn write_rejected(
    destination: Destination,
    format: Format,
    mut rows: Vec<Rejected>,
    loaded: &LoadedField,
    observations: &Observations,
) -> Result<u64, IoError> {
    for aside in &observations.left_aside {
        let why = match aside.reason {
            LeftAsideReason::Duplicate { of } => {
                format!("it is {} again", observations.position(of)?)
            }
            LeftAsideReason::SunBelowHorizon => "at its time the sun was down".to_owned(),
            LeftAsideReason::NoFrame => "its frame is not among the spots".to_owned(),
            LeftAsideReason::Spot(None) => "its frame could not be read".to_owned(),
            LeftAsideReason::Spot(Some(status)) => {
                format!("the spot of its frame is {}", status.as_str())
            }
            LeftAsideReason::InFuture => "its time is still to come".to_owned(),
            _ => "it has no spot".to_owned(),
        };
        rows.push(Rejected {
            record: aside.record,
            row: aside.heliostat,
            beam_mrad: f64::NAN,
            reason: aside.reason.as_str().to_owned(),
            why,
        });
    }
    rows.sort_by_key(|row| row.record);
    let ids: Vec<String> = rows
        .iter()
        .map(|row| loaded.field.ids()[row.row].clone())
        .collect();
    let records: Vec<String> = rows
        .iter()
        .map(|row| observations.record_id(row.record).unwrap_or("").to_owned())
        .collect();
    let lines: Result<Vec<Option<i64>>, IoError> = rows
        .iter()
        .map(|row| Ok(i64::try_from(observations.line(row.record)?).ok()))
        .collect();
    let lines = lines?;
    let beams: Vec<f64> = rows.iter().map(|row| row.beam_mrad).collect();
    let reasons: Vec<String> = rows.iter().map(|row| row.reason.clone()).collect();
    let whys: Vec<String> = rows.iter().map(|row| row.why.clone()).collect();
    let mut columns = vec![("id", Cells::Text(&ids)), ("line", Cells::Whole(&lines))];
    if records.iter().any(|record| !record.is_empty()) {
        columns.push(("record_id", Cells::Text(&records)));
    }
    columns.extend([
        ("beam_mrad", Cells::Numbers(&beams)),
        ("reason", Cells::Text(&reasons)),
        ("why", Cells::Text(&whys)),
    ]);
    write_columns(destination, format, &columns)
}
