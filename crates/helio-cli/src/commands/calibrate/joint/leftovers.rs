//! `--leftovers`: what is left by pose, for `track`.

use std::path::Path;

use helio_calib::joint::{LeftoverOptions, Leftovers};
use helio_io::output::Format;
use helio_io::{Observations, write_leftovers};

use super::Run;
use crate::failure::Failure;
use crate::plan;
use crate::printer::Bytes;

/// The format of the file: one that `track` reads.
pub(super) fn format(path: &Path) -> Result<Format, Failure> {
    match plan::format(Some(path), None)? {
        format @ (Format::Csv | Format::Parquet) => Ok(format),
        other => Err(Failure::refused(format!(
            "--leftovers: {} would be {}, which track does not read; wanted .csv or .parquet",
            path.display(),
            other.as_str()
        ))),
    }
}

impl Run<'_> {
    pub(super) fn write_left(
        &self,
        path: &Path,
        (options, leftovers): &(LeftoverOptions, Leftovers),
        observations: &Observations,
    ) -> Result<(), Failure> {
        let format = format(path)?;
        let field = &self.loaded.field;
        let rows = observations.heliostats.iter().map(|of| of.row);
        let ids: Vec<String> = rows.map(|row| field.ids()[row].clone()).collect();
        let destination = plan::destination(Some(path), format, &[], self.printer)?;
        let bytes = write_leftovers(destination, format, &ids, &leftovers.heliostats)?;
        let evidence = leftovers.log_evidence;
        if leftovers.admitted {
            let [first, second] = leftovers.amplitude_mrad;
            self.printer.say(format_args!(
                "left by pose: {first:.2} and {second:.2} mrad of axes 1 and 2 over {:.0}° (evidence {evidence:.1} nats); \
                 set-points corrected by {:.1} mrad at the most; {}",
                leftovers.length_rad.to_degrees(),
                1e3 * options.most_rad,
                Bytes(bytes)
            ));
        } else {
            self.printer.say(format_args!(
                "left by pose: nothing that the records speak for (evidence {evidence:.1} nats, wanted {:.0}); no \
                 set-point is corrected",
                options.least_log_evidence
            ));
        }
        Ok(())
    }
}
