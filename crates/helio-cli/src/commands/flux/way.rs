//! By rays or by a convolution, as the scene says or by an error, and how sure the peak is.

use std::sync::Mutex;
use std::sync::atomic::Ordering;

use helio_flux::{Choice, Element, FluxMap, Scene, Way, peak_error};
use helio_io::FluxScene;
use serde_json::{Value, json};

use crate::commands::track::stop_on_signals;
use crate::failure::Failure;
use crate::printer::{Grouped, Printer};

/// The way that was taken to a map.
pub(super) struct Taken {
    way: Way,
    /// Why, where the scene did not say which.
    choice: Option<Choice>,
    /// Relative standard error of the greatest irradiance; none without light.
    peak_error: Option<f64>,
}

impl Taken {
    /// What a summary says of it.
    pub(super) fn about(&self, scene: &FluxScene) -> Value {
        let mut about = match self.way {
            Way::Convolution(points) => json!({ "method": "convolve", "points": points }),
            Way::Rays(count) => {
                json!({ "method": "trace", "count": count, "seed": scene.rays.seed })
            }
            _ => json!({}),
        };
        about["peak_standard_error"] = json!(self.peak_error);
        if let Some(choice) = &self.choice {
            about["chosen_for_error"] = json!(scene.rays.error);
            about["chosen_because"] = json!(choice.why.to_string());
        }
        about
    }

    fn say(&self, printer: &Printer) {
        if let Some(error) = self.peak_error {
            printer.say(format_args!(
                "the greatest irradiance is known to {:.2} % or better, one standard error",
                100.0 * error
            ));
        }
    }
}

/// Traces or integrates, with progress, until it is done or somebody wants an end.
pub(super) fn light(
    scene: &FluxScene,
    elements: &[Element],
    sun: [f64; 3],
    threads: usize,
    printer: &Printer,
) -> Result<(FluxMap, Taken), Failure> {
    let shape = scene.sun.form.shape()?;
    let lit = scene.lit(elements, sun, &shape);
    let (way, choice) = way(scene, &lit, threads, printer)?;
    let stop = stop_on_signals();
    let progress = Mutex::new(None);
    let things = match way {
        Way::Convolution(_) => "elements",
        _ => "rays",
    };
    let watch = |more: u64, all: u64| {
        if let Ok(mut progress) = progress.lock() {
            progress
                .get_or_insert_with(|| printer.progress_of(all, things))
                .advance(more);
        }
        !stop.load(Ordering::Relaxed)
    };
    let map = scene.by_way(&lit, way, threads, &watch)?;
    let Some(map) = map else {
        return Err(Failure::Interrupted { streamed: false });
    };
    let took_s = match progress.into_inner() {
        Ok(Some(progress)) => progress.finish().as_secs_f64(),
        _ => 0.0,
    };
    let count = match way {
        Way::Convolution(_) => elements.len() as u64,
        _ => map.account().rays,
    };
    printer.say(format_args!("{} {things} in {took_s:.2} s", Grouped(count)));
    let taken = Taken {
        way,
        choice,
        peak_error: peak_error(&lit, &map)?,
    };
    taken.say(printer);
    Ok((map, taken))
}

/// Which way; the scene's, or by its error.
fn way(
    scene: &FluxScene,
    lit: &Scene<'_>,
    threads: usize,
    printer: &Printer,
) -> Result<(Way, Option<Choice>), Failure> {
    let (way, choice) = scene.way(lit, threads)?;
    match (way, &choice) {
        (Way::Convolution(_), Some(choice)) => printer.say(format_args!(
            "by convolution: {}; a pilot of rays saw no mirror shade or block another",
            choice.why
        )),
        (Way::Convolution(_), None) => printer.note(format_args!(
            "by convolution mirrors neither shade nor block each other"
        )),
        (_, Some(choice)) => printer.say(format_args!("by rays: {}", choice.why)),
        _ => {}
    }
    Ok((way, choice))
}
