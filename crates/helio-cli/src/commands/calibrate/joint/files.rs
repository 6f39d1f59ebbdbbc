//! The tables beside the calibration: causes in common, records one by one.

use std::path::Path;

use helio_calib::joint::{Cause, CommonCause};
use helio_io::Observations;
use helio_io::output::{Cells, write_columns};

use super::{Judged, Run};
use crate::failure::Failure;
use crate::plan;

impl Run<'_> {
    pub(super) fn write_causes(
        &self,
        path: &Path,
        causes: &[CommonCause],
        observations: &Observations,
    ) -> Result<(), Failure> {
        let format = plan::format(Some(path), None)?;
        let destination = plan::destination(Some(path), format, &[], self.printer)?;
        let texts = |of: &dyn Fn(&CommonCause) -> String| causes.iter().map(of).collect::<Vec<_>>();
        let numbers = |of: &dyn Fn(&CommonCause) -> f64| causes.iter().map(of).collect::<Vec<_>>();
        let names = texts(&|c| c.cause.description().name.to_owned());
        let targets = texts(&|c| target_of(c.cause, observations).to_owned());
        let scopes = texts(&|c| c.cause.description().scope.as_str().to_owned());
        let admitted: Vec<Option<i64>> =
            causes.iter().map(|c| Some(i64::from(c.admitted))).collect();
        let (value, sigma) = (numbers(&|c| c.value), numbers(&|c| c.sigma));
        let (spread, evidence) = (numbers(&|c| c.spread), numbers(&|c| c.log_evidence));
        let columns = [
            ("cause", Cells::Text(&names)),
            ("target", Cells::Text(&targets)),
            ("scope", Cells::Text(&scopes)),
            ("value", Cells::Numbers(&value)),
            ("sigma", Cells::Numbers(&sigma)),
            ("spread", Cells::Numbers(&spread)),
            ("log_evidence", Cells::Numbers(&evidence)),
            ("admitted", Cells::Whole(&admitted)),
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
        let lines: Vec<Option<i64>> = judged
            .iter()
            .map(|one| i64::try_from(observations.line(record(one))).ok())
            .collect();
        let numbers = |of: &dyn Fn(&Judged) -> f64| judged.iter().map(of).collect::<Vec<f64>>();
        let foretold = numbers(&|one| one.foretold.expected_mrad());
        let seen = numbers(&|one| one.foretold.beam_mrad());
        let square = numbers(&|one| one.foretold.square());
        let kinds: Vec<String> = judged
            .iter()
            .map(|one| one.kind.as_str().to_owned())
            .collect();
        let alarms: Vec<Option<i64>> = judged.iter().map(|one| one.alarm.map(i64::from)).collect();
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

/// The name of the target that a cause belongs to, or nothing.
pub(super) fn target_of(cause: Cause, observations: &Observations) -> &str {
    match cause {
        Cause::TargetRight(k) | Cause::TargetDown(k) => observations
            .targets
            .get(k)
            .map_or("", |(name, _)| name.as_str()),
        Cause::Axis(_) | Cause::SunTime => "",
    }
}
