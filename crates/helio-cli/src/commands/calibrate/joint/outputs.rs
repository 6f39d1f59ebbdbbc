//! What both ways write: tables, proposals, the page.

use helio_io::calibrate::joint::{Day, JointFound, JointRun};
use helio_io::calibrate::write_rejected;
use helio_io::{CalibratedSet, Provenance, write_calibration};
use helio_report::AboutRun;
use helio_report::joint::{JointPage, joint_page};

use super::{Asked, Run};
use crate::commands::calibrate::proposals::write_proposals;
use crate::commands::calibrate::{changes, write_page};
use crate::failure::Failure;
use crate::plan::{self, made_at};

/// What a run found.
pub(super) struct Found<'a> {
    pub(super) run: &'a JointRun<'a>,
    pub(super) all: &'a JointFound<'a>,
    /// The day that the table is for.
    pub(super) day: &'a Day,
    pub(super) provenance: &'a Provenance,
}

/// What was written.
pub(super) struct Written {
    pub sets: Vec<CalibratedSet>,
    pub changes: Vec<String>,
    pub bytes: u64,
}

impl Run<'_> {
    /// Writes everything but the state, the calibration last.
    pub(super) fn write(&self, asked: Asked, found: &Found<'_>) -> Result<Written, Failure> {
        let (args, run) = (self.args, found.run);
        let observations = run.observations;
        let sets = run.sets(found.all, found.day)?;
        let changes = match &asked.old {
            Some(old) => changes(&self.loaded, observations, old, &sets)?,
            None => Vec::new(),
        };
        if let Some(file) = asked.report {
            let about = AboutRun {
                provenance: found.provenance,
                generated_utc: made_at(),
                changes: changes.clone(),
            };
            let page = JointPage::of_run(run, found.all, about)?;
            write_page(file, &joint_page(&page))?;
        }
        if let Some(path) = &args.joint.causes {
            let format = plan::format(Some(path), None)?;
            let destination = plan::destination(Some(path), format, &[], self.printer)?;
            found.all.write_causes(destination, format)?;
        }
        if let Some(path) = &args.joint.steps {
            let format = plan::format(Some(path), None)?;
            let destination = plan::destination(Some(path), format, &[], self.printer)?;
            run.write_steps(found.all, destination, format)?;
        }
        if let Some(path) = &args.rejected {
            let rows = run.rejected(found.all);
            let format = plan::format(Some(path), None)?;
            let destination = plan::destination(Some(path), format, &[], self.printer)?;
            write_rejected(destination, format, rows, &self.loaded, observations)?;
        }
        let proposals = asked.proposals.as_ref();
        if let Some(proposals) = proposals {
            let rows = run.propose(proposals, found.all)?;
            write_proposals(proposals, &rows, args, &self.loaded, self.printer)?;
        }
        // Proposals take the place of the calibration where both would go to standard output.
        let bytes = if proposals.is_some() && args.plan_out.is_none() && args.out.out.is_none() {
            0
        } else {
            write_calibration(asked.destination, asked.format, &sets, found.provenance)?
        };
        Ok(Written {
            sets,
            changes,
            bytes,
        })
    }
}
