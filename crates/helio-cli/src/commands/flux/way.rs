//! By rays or by a convolution, as the scene says or by an error, and how sure the peak is.

use std::sync::Mutex;
use std::sync::atomic::Ordering;

use helio_flux::{Choice, Element, FluxMap, Scene, Way, peak_error, peak_excess};
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
    /// By how much it may be too high, as the greatest of many.
    peak_excess: Option<f64>,
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
        about["peak_too_high_by_up_to"] = json!(self.peak_excess);
        if let Some(choice) = &self.choice {
            about["chosen_for_error"] = json!(scene.rays.error);
            about["chosen_because"] = json!(choice.why.to_string());
        }
        about
    }

    fn say(&self, printer: &Printer) {
        if let (Some(error), Some(excess)) = (self.peak_error, self.peak_excess) {
            let too_high = match self.way {
                Way::Convolution(_) => String::new(),
                _ => format!(
                    "; as the greatest of bins that scatter it is too high by up to some {:.2} %",
                    100.0 * excess
                ),
            };
            printer.say(format_args!(
                "standard error of the greatest irradiance at most {:.2} %{too_high}",
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
    let (mut way, choice) = way(scene, &lit, threads, printer)?;
    let map = loop {
        let map = by_way(scene, &lit, way, threads, printer)?;
        let Some(more) = scene.again(way, &map) else {
            break map;
        };
        printer.say(format_args!(
            "the greatest irradiance scatters by more than {}: more rays",
            scene.rays.error
        ));
        way = more;
    };
    let taken = Taken {
        way,
        choice,
        peak_error: peak_error(&lit, &map)?,
        peak_excess: peak_excess(&scene.receiver, &map),
    };
    taken.say(printer);
    Ok((map, taken))
}

fn by_way(
    scene: &FluxScene,
    lit: &Scene<'_>,
    way: Way,
    threads: usize,
    printer: &Printer,
) -> Result<FluxMap, Failure> {
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
    let map = scene.by_way(lit, way, threads, &watch)?;
    let Some(map) = map else {
        return Err(Failure::Interrupted { streamed: false });
    };
    let took_s = match progress.into_inner() {
        Ok(Some(progress)) => progress.finish().as_secs_f64(),
        _ => 0.0,
    };
    let count = match way {
        Way::Convolution(_) => lit.elements.len() as u64,
        _ => map.account().rays,
    };
    printer.say(format_args!("{} {things} in {took_s:.2} s", Grouped(count)));
    Ok(map)
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
