//! The records that were left aside.

use std::path::Path;

use helio_io::LeftAsideReason;
use helio_io::output::{Cells, write_columns};

use super::Run;
use crate::calibration::Done;
use crate::failure::Failure;
use crate::plan;
use crate::printer::Printer;

impl Run<'_> {
    pub(super) fn write_rejected(
        &self,
        path: &Path,
        done: &[Done],
        printer: &Printer,
    ) -> Result<(), Failure> {
        let format = plan::format(Some(path), None)?;
        let destination = plan::destination(Some(path), format, &[], printer)?;
        let mut rows: Vec<(usize, usize, f64, String, String)> = Vec::new();
        for one in done {
            let of = &self.observations.heliostats[one.index];
            for left in &one.rejected {
                let record = of.records[left.row];
                rows.push((
                    record,
                    of.row,
                    left.beam_mrad.0,
                    left.reason.clone(),
                    left.words.clone(),
                ));
            }
        }
        for aside in &self.observations.left_aside {
            let why = match aside.reason {
                LeftAsideReason::Duplicate { of } => {
                    format!("it is {} again", self.observations.position(of))
                }
                LeftAsideReason::SunBelowHorizon => "at its time the sun was down".to_owned(),
                _ => "it has no spot".to_owned(),
            };
            let reason = aside.reason.as_str().to_owned();
            rows.push((aside.record, aside.heliostat, f64::NAN, reason, why));
        }
        rows.sort_by_key(|row| row.0);
        let ids: Vec<String> = rows
            .iter()
            .map(|row| self.loaded.field.ids()[row.1].clone())
            .collect();
        let records: Vec<String> = rows
            .iter()
            .map(|row| self.observations.record_id(row.0).unwrap_or("").to_owned())
            .collect();
        let lines: Vec<Option<i64>> = rows
            .iter()
            .map(|row| i64::try_from(self.observations.line(row.0)).ok())
            .collect();
        let beams: Vec<f64> = rows.iter().map(|row| row.2).collect();
        let reasons: Vec<String> = rows.iter().map(|row| row.3.clone()).collect();
        let whys: Vec<String> = rows.iter().map(|row| row.4.clone()).collect();
        let mut columns = vec![("id", Cells::Text(&ids)), ("line", Cells::Whole(&lines))];
        if records.iter().any(|record| !record.is_empty()) {
            columns.push(("record_id", Cells::Text(&records)));
        }
        columns.extend([
            ("beam_mrad", Cells::Numbers(&beams)),
            ("reason", Cells::Text(&reasons)),
            ("why", Cells::Text(&whys)),
        ]);
        write_columns(destination, format, &columns)?;
        Ok(())
    }
}
