//! Findings in words.

use helio_calib::{Finding, Reason, WrongCall};

use super::Run;
use crate::IoError;
use crate::times::format_time;

/// Findings with the names and places that only this program knows.
pub(super) struct Words<'a> {
    pub run: &'a Run<'a>,
    pub index: usize,
    pub neighbours: &'a [usize],
}

impl Words<'_> {
    pub(super) fn heliostat(&self, neighbour: usize) -> String {
        let row = self.neighbours.get(neighbour);
        row.map_or(String::new(), |&row| {
            self.run.loaded.field.ids()[row].clone()
        })
    }

    pub(super) fn target(&self, target: usize) -> &str {
        let targets = &self.run.observations.targets;
        targets.get(target).map_or("", |(name, _)| name)
    }

    pub(super) fn position(&self, row: usize) -> Result<String, IoError> {
        let of = &self.run.observations.heliostats[self.index];
        self.run.observations.position(of.records[row])
    }

    pub(super) fn reason(&self, reason: &Reason) -> Result<String, IoError> {
        Ok(match reason {
            Reason::WrongHeliostat { neighbour } => {
                format!(
                    "it fits the mount of heliostat {}",
                    self.heliostat(*neighbour)
                )
            }
            Reason::WrongTarget { target } => {
                format!("its spot fits target {}", self.target(*target))
            }
            Reason::Duplicate { of } => format!("it is {} again", self.position(*of)?),
            other => other.to_string(),
        })
    }

    pub(super) fn finding(&self, finding: &Finding) -> Result<String, IoError> {
        Ok(match finding {
            Finding::Jump {
                last_before,
                first_after,
                after_unix_ns,
                before_unix_ns,
                axis1_mrad,
                axis2_mrad,
            } => {
                let at = match (after_unix_ns, before_unix_ns) {
                    (Some(after), Some(before)) => {
                        format!("{} and {}", format_time(*after), format_time(*before))
                    }
                    _ => format!(
                        "{} and {}",
                        self.position(*last_before)?,
                        self.position(*first_after)?
                    ),
                };
                format!(
                    "the encoder references jumped between {at}, by {axis1_mrad:+.1} mrad on the first \
                     axis and {axis2_mrad:+.1} mrad on the second"
                )
            }
            Finding::WrongCall { call, .. } => {
                let text = finding.to_string();
                match call {
                    WrongCall::OtherHeliostat { neighbour } => text.replace(
                        &format!("neighbour {neighbour}"),
                        &format!("heliostat {}", self.heliostat(*neighbour)),
                    ),
                    WrongCall::OtherTarget { target } => text.replace(
                        &format!("target {target}"),
                        &format!("target {}", self.target(*target)),
                    ),
                    _ => text,
                }
            }
            other => other.to_string(),
        })
    }
}
