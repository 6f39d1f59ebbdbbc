//! The tables beside the calibration: causes in common, records one by one.

use helio_calib::joint::{Cause, CommonCause, StepKind, Worth};
use helio_core::TargetPlane;

use super::{JointFound, JointRun, Judged};
use crate::calibrate::Rejected;
use crate::error::IoError;
use crate::output::{Cells, Destination, Format, write_columns};

/// The name of the target that a cause belongs to, or nothing.
#[must_use]
pub fn cause_target(cause: Cause, targets: &[(String, TargetPlane)]) -> &str {
    let target = cause.target().and_then(|k| targets.get(k));
    target.map_or("", |(name, _)| name.as_str())
}

impl JointFound<'_> {
    /// Writes the causes in common; the number of bytes.
    ///
    /// # Errors
    /// [`IoError`] if they cannot be written.
    pub fn write_causes(&self, destination: Destination, format: Format) -> Result<u64, IoError> {
        let causes = &self.causes;
        let texts = |of: &dyn Fn(&CommonCause) -> String| causes.iter().map(of).collect::<Vec<_>>();
        let numbers = |of: &dyn Fn(&CommonCause) -> f64| causes.iter().map(of).collect::<Vec<_>>();
        let names = texts(&|c| c.cause.description().name.to_owned());
        let of_targets = texts(&|c| cause_target(c.cause, &self.targets).to_owned());
        let scopes = texts(&|c| c.cause.description().scope.as_str().to_owned());
        let admitted: Vec<Option<i64>> =
            causes.iter().map(|c| Some(i64::from(c.admitted))).collect();
        let (value, sigma) = (numbers(&|c| c.value), numbers(&|c| c.sigma));
        let (spread, evidence) = (numbers(&|c| c.spread), numbers(&|c| c.log_evidence));
        let worths = |of: fn(&Worth) -> f64| -> Vec<f64> {
            match &self.worth {
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
        write_columns(destination, format, &columns)
    }
}

impl JointRun<'_> {
    /// Writes how every record was foretold and what became of it; the number of bytes.
    ///
    /// # Errors
    /// [`IoError`] if it cannot be written, or the observations are not those of their file.
    pub fn write_steps(
        &self,
        found: &JointFound<'_>,
        destination: Destination,
        format: Format,
    ) -> Result<u64, IoError> {
        let (judged, observations) = (&found.judged, self.observations);
        let record = |one: &Judged| observations.heliostats[one.index].records[one.observation];
        let ids: Vec<String> = judged
            .iter()
            .map(|one| self.loaded.field.ids()[observations.heliostats[one.index].row].clone())
            .collect();
        let times: Vec<Option<i64>> = judged
            .iter()
            .map(|one| observations.heliostats[one.index].observations[one.observation].unix_ns)
            .collect();
        let lines: Result<Vec<Option<i64>>, IoError> = judged
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
        if found.fit.is_none() {
            columns.push(("alarm", Cells::Whole(&alarms)));
        }
        write_columns(destination, format, &columns)
    }

    /// Records that were not believed, or whose beam should not have met the target.
    #[must_use]
    pub fn rejected(&self, found: &JointFound<'_>) -> Vec<Rejected> {
        let words = |one: &Judged| match one.kind {
            StepKind::Outlier => Some(format!(
                "its spot lies {:.1} mrad from where it was expected to {:.1} mrad, and no jump of a zero point explains it \
                 better",
                one.foretold.beam_mrad(),
                one.foretold.expected_mrad()
            )),
            StepKind::Misses => Some("its beam should not meet the target".to_owned()),
            _ => None,
        };
        found
            .judged
            .iter()
            .filter_map(|one| {
                let of = &self.observations.heliostats[one.index];
                Some(Rejected {
                    record: of.records[one.observation],
                    row: of.row,
                    beam_mrad: one.foretold.beam_mrad(),
                    reason: one.kind.as_str().to_owned(),
                    why: words(one)?,
                })
            })
            .collect()
    }

    /// What every record that raised an alarm first of its heliostat did: which of the heliostats with observations,
    /// when, and whether as the third in a row that is not believed.
    #[must_use]
    pub fn alarms(&self, found: &JointFound<'_>) -> Vec<(usize, i64, bool)> {
        let mut first: Vec<(usize, i64, bool)> = Vec::new();
        for one in &found.judged {
            let Some(alarm) = one.alarm.filter(|alarm| *alarm != [false; 2]) else {
                continue;
            };
            if first.last().is_none_or(|last| last.0 != one.index) {
                let of = &self.observations.heliostats[one.index].observations;
                let unix_ns = of[one.observation].unix_ns.unwrap_or_default();
                first.push((one.index, unix_ns, alarm[1]));
            }
        }
        first
    }
}
