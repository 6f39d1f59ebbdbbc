//! What a joint fit found, in words.

use helio_calib::Parameter;
use helio_calib::joint::{CommonCause, JointFit, Worth};
use helio_core::TargetPlane;
use helio_io::calibrate::joint::{STOPPED, cause_target, for_people};

use super::Run;

fn cause_words(cause: &CommonCause, worth: &Worth, targets: &[(String, TargetPlane)]) -> String {
    let (factor, unit) = for_people(cause.cause.description().unit);
    let words = cause.cause.description().in_words;
    let what = match cause_target(cause.cause, targets) {
        "" => words.to_owned(),
        name => format!("{words} `{name}`"),
    };
    if !cause.admitted {
        return format!("{what}: not admitted, the records do not speak for it");
    }
    let spread = if cause.spread > 0.0 {
        format!(", heliostats about it by {:.2}", factor * cause.spread)
    } else {
        String::new()
    };
    format!(
        "{what}: {:+.2} ± {:.2} {unit}{spread}; turns beams by {:.2} mrad, is worth {:.2} (evidence {:.1} nats)",
        factor * cause.value,
        factor * cause.sigma,
        worth.turn_mrad,
        worth.worth_mrad,
        cause.log_evidence
    )
}

impl Run<'_> {
    pub(super) fn say_fit(
        &self,
        fit: &JointFit,
        worth: &[Worth],
        targets: &[(String, TargetPlane)],
    ) {
        let printer = self.printer;
        for (cause, worth) in fit.causes.iter().zip(worth) {
            printer.say(format_args!("{}", cause_words(cause, worth, targets)));
        }
        if !fit.converged {
            printer.warn(STOPPED);
        }
        let (noise, wander) = (&fit.noise, &fit.wander);
        printer.say(format_args!(
            "records scatter by {:.2} mrad across the beam, by {:.1} cm on the target where they state no sigma_m, \
             by {:.1} s along the sun's path",
            noise.beam_mrad,
            1e2 * noise.spot_m,
            noise.sun_path_s
        ));
        printer.say(format_args!(
            "zero points wander by {:.2} and {:.2} mrad within {:.0} days, and by {:.2} and {:.2} mrad within {:.1} \
             days",
            wander.slow_mrad[0],
            wander.slow_mrad[1],
            wander.slow_days,
            wander.fast_mrad[0],
            wander.fast_mrad[1],
            wander.fast_days
        ));
        let still = fit.field_mean.len();
        let of_field: Vec<String> = Parameter::ALL[..6]
            .iter()
            .enumerate()
            .map(|(k, parameter)| {
                format!(
                    "{} {:+.1} ± {:.1}",
                    parameter.in_words(),
                    1e3 * fit.field_mean[k],
                    1e3 * fit.field_covariance[k * still + k].max(0.0).sqrt()
                )
            })
            .collect();
        printer.say(format_args!(
            "heliostats of this field [mrad]: {}",
            of_field.join(", ")
        ));
    }
}
