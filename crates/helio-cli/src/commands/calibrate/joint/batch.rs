//! `--joint`: all records of a field at once.

use helio_io::write_state;

use super::outputs::Found;
use super::{Asked, Run};
use crate::Outcome;
use crate::failure::Failure;
use crate::printer::{Bytes, Counted};

impl Run<'_> {
    pub(super) fn fit(&self, asked: Asked) -> Result<Outcome, Failure> {
        let (observations, hash) = self.observations()?;
        self.with(&observations, |run| {
            let provenance = self.provenance("joint", hash)?;
            let all = run.fit()?;
            let day = run.day(&all.state)?;
            let left = match &self.args.joint.leftovers {
                Some(path) => run.leftovers(&all, &day)?.map(|left| (path, left)),
                None => None,
            };
            let found = Found {
                run,
                all: &all,
                day: &day,
                provenance: &provenance,
            };
            let written = self.write(asked, &found)?;
            if let Some((path, left)) = &left {
                self.write_left(path, left, &observations)?;
            }
            if let Some(path) = &self.args.joint.state {
                let bytes = write_state(path, all.state_file())?;
                self.printer.say(format_args!(
                    "state of {}: {}",
                    Counted(all.rows.len(), "heliostat"),
                    Bytes(bytes)
                ));
            }
            if let (Some((fit, _)), Some(worth)) = (&all.fit, &all.worth) {
                self.say_fit(fit, worth, &observations.targets);
            }
            self.say_judged(&observations, &all.judged, &all.jumps);
            self.say_spells(&all.spells, f64::NEG_INFINITY);
            if all.off {
                self.printer
                    .note(format_args!("what was found rests on these records too: mend them or leave them out, and fit again"));
            }
            Ok(self.say_table(&written, all.off))
        })
    }
}
