//! `--update`: new records on top of a state.

use std::path::Path;

use helio_calib::joint::{DAY_NS, FieldState};
use helio_io::calibrate::joint::{Following, alarm_words};
use helio_io::{Observations, read_state, state_bytes, write_file};

use super::outputs::Found;
use super::{Asked, Run, say};
use crate::Outcome;
use crate::commands::calibrate::SAID;
use crate::failure::Failure;
use crate::printer::{Bytes, Counted, Grouped};

impl Run<'_> {
    pub(super) fn update(&self, path: &Path, asked: Asked) -> Result<Outcome, Failure> {
        let hear = |remark| say(self.printer, remark);
        let following = Following::begin(path, read_state(path)?, &self.loaded, &hear)?;
        let (observations, hash) = self.observations()?;
        self.with(&observations, |run| {
            let mut provenance = self.provenance("joint-update", hash)?;
            provenance.options_hash = following.checksum().to_owned();
            // what to see next can be asked of a state at any time
            let all = run.update(following, self.args.plan_date.is_some())?;
            let found = Found {
                run,
                all: &all,
                day: &run.day(&all.state)?,
                provenance: &provenance,
            };
            let place = self.args.joint.state.as_deref().unwrap_or(path);
            let (written, bytes) = rayon::join(
                || self.write(asked, &found),
                || state_bytes(place, all.state_file()),
            );
            let written = written?;
            // The state goes last: where anything failed, the same records can be given again.
            let bytes = bytes?;
            write_file(place, &bytes)?;
            let written_bytes = bytes.len() as u64;
            self.say_judged(&observations, &all.judged, &all.jumps);
            self.say_alarms(&all.state, &observations, &run.alarms(&all));
            self.printer.say(format_args!(
                "state of {}: {}",
                Counted(all.rows.len(), "heliostat"),
                Bytes(written_bytes)
            ));
            let times = all.seen.iter().filter_map(|one| one.times_ns);
            let from_ns = times.map(|(first, _)| first).min().unwrap_or(i64::MAX);
            self.say_spells(&all.spells, (from_ns as f64 / DAY_NS).floor());
            Ok(self.say_table(&written, all.off))
        })
    }

    fn say_alarms(
        &self,
        state: &FieldState,
        observations: &Observations,
        first: &[(usize, i64, bool)],
    ) {
        let id = |index: usize| &self.loaded.field.ids()[observations.heliostats[index].row];
        for &(index, unix_ns, unbelieved) in first.iter().take(SAID) {
            let words = alarm_words(unix_ns, unbelieved);
            self.printer.say(format_args!("{}: {words}", id(index)));
        }
        if first.len() > SAID {
            let more = first.len() - SAID;
            self.printer.say(format_args!(
                "... and {}; --steps shows all",
                Counted(more, "alarm")
            ));
        }
        let rate = state.alarm.false_alarm_rate;
        self.printer.say(format_args!(
            "alarms: {} of {}; of the records of heliostats without drift some {} % raise one",
            Grouped(first.len() as u64),
            Counted(observations.heliostats.len(), "heliostat"),
            100.0 * rate
        ));
    }
}
