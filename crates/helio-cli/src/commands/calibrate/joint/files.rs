//! The tables beside the calibration: causes in common, records one by one.

use std::path::Path;

use helio_calib::joint::{CommonCause, Worth};
use helio_core::TargetPlane;
use helio_io::Observations;
use helio_io::output::{Cells, write_columns};

use super::said::target_of;
use super::{Judged, Run};
use crate::failure::Failure;
use crate::plan;

impl Run<'_> {
    pub(super) fn write_causes(
        &self,
        path: &Path,
        causes: &[CommonCause],
        worth: Option<&[Worth]>,
        targets: &[(String, TargetPlane)],
    ) -> Result<(), Failure> {
        let format = plan::format(Some(path), None)?;
        let destination = plan::destination(Some(path), format, &[], self.printer)?;
        let texts = |of: &dyn Fn(&CommonCause) -> String| causes.iter().map(of).collect::<Vec<_>>();
        let numbers = |of: &dyn Fn(&CommonCause) -> f64| causes.iter().map(of).collect::<Vec<_>>();
        let names = texts(&|c| c.cause.description().name.to_owned());
        let of_targets = texts(&|c| target_of(c.cause, targets).to_owned());
        let scopes = texts(&|c| c.cause.description().scope.as_str().to_owned());
        let admitted: Vec<Option<i64>> =
            causes.iter().map(|c| Some(i64::from(c.admitted))).collect();
        let (value, sigma) = (numbers(&|c| c.value), numbers(&|c| c.sigma));
        let (spread, evidence) = (numbers(&|c| c.spread), numbers(&|c| c.log_evidence));
        let worths = |of: fn(&Worth) -> f64| -> Vec<f64> {
            match worth {
                Some(worth) => worth.iter().map(of).collect(),
                None => vec![f64::NAN; causes.len()],
            }
        };
        let (turn, worth) = (worths(|w| w.turn_mrad), worths(|w| w.worth_mrad));
        let columns = [
            ("cause", Cells::Text(&names)),
            ("target", Cells::Text(&of_targets)),
            ("scope", Cells::Text(&scopes)),
            ("value", Cells::Numbers(&value)),
            ("sigma", Cells::Numbers(&sigma)),
            ("spread", Cells::Numbers(&spread)),
            ("log_evidence", Cells::Numbers(&evidence)),
            ("admitted", Cells::Whole(&admitted)),
            ("turn_mrad", Cells::Numbers(&turn)),
            ("worth_mrad", Cells::Numbers(&worth)),
        ];
        write_columns(destination, format, &columns)?;
        Ok(())
    }

    pub(super) fn write_steps(
        &self,
        path: &Path,
        judged: &[Judged],
        observations: &Observations,
    ) -> Result<(), Failure> {
        let format = plan::format(Some(path), None)?;
        let destination = plan::destination(Some(path), format, &[], self.printer)?;
        let record = |one: &Judged| observations.heliostats[one.index].records[one.observation];
        let ids: Vec<String> = judged
            .iter()
            .map(|one| self.loaded.field.ids()[observations.heliostats[one.index].row].clone())
            .collect();
        let times: Vec<Option<i64>> = judged
            .iter()
            .map(|one| observations.heliostats[one.index].observations[one.observation].unix_ns)
            .collect();
        let lines: Result<Vec<Option<i64>>, Failure> = judged
            .iter()
            .map(|one| Ok(i64::try_from(observations.line(record(one))?).ok()))
            .collect();
        let lines = lines?;
        let numbers = |of: &dyn Fn(&Judged) -> f64| judged.iter().map(of).collect::<Vec<f64>>();
        let foretold = numbers(&|one| one.foretold.expected_mrad());
        let seen = numbers(&|one| one.foretold.beam_mrad());
        let square = numbers(&|one| one.foretold.square());
        let kinds: Vec<String> = judged
            .iter()
            .map(|one| one.kind.as_str().to_owned())
            .collect();
        let alarms: Vec<Option<i64>> = judged
            .iter()
            .map(|one| one.alarm.map(|alarm| i64::from(alarm != [false; 2])))
            .collect();
        let mut columns = vec![
            ("id", Cells::Text(&ids)),
            ("time", Cells::Times(&times)),
            ("line", Cells::Whole(&lines)),
            ("foretold_mrad", Cells::Numbers(&foretold)),
            ("seen_mrad", Cells::Numbers(&seen)),
            ("chi_squared", Cells::Numbers(&square)),
            ("kind", Cells::Text(&kinds)),
        ];
        if self.args.joint.update.is_some() {
            columns.push(("alarm", Cells::Whole(&alarms)));
        }
        write_columns(destination, format, &columns)?;
        Ok(())
    }
}
