//! The heliostats of a field as they track.

use std::path::Path;

use helio_calib::aiming::hour_angle_rad;
use helio_core::{EnuUnit, Field, Status};
use helio_flux::{FieldMirrors, field_mirrors};
use helio_io::{LoadedField, SceneOf, format_time};
use serde_json::{Map, Value, json};

use super::super::track::latitude_rad;
use super::outputs::Outputs;
use super::plots::{self, Plot};
use super::summary;
use crate::Outcome;
use crate::args::FluxArgs;
use crate::failure::Failure;
use crate::plan::{self, Suns};
use crate::printer::{Counted, Printer, Tally};

pub(super) fn run(
    path: &Path,
    args: &FluxArgs,
    threads: usize,
    printer: &Printer,
) -> Result<Outcome, Failure> {
    let loaded = plan::field(path, printer)?;
    let scene = super::scene(args, SceneOf::Field(&loaded), printer)?;
    let mut inputs = loaded.files.clone();
    inputs.extend(scene.files.iter().cloned());
    let outputs = Outputs::check(args, &inputs)?;
    let Some(mirror) = scene.mirror.heliostat else {
        // A scene of a field has one.
        return Err(Failure::refused("the scene has no [mirror]"));
    };
    let suns = Suns::one(&args.sun, &loaded, printer)?;
    plan::warn_of_lapse(&loaded, suns.times_ns(), printer);
    let block = suns.block(0, 1)?;
    printer.say(format_args!("sun at {}", block.describe(0)));
    let sun = block.suns[0];
    let field = up_to_date(&loaded, block.unix_ns.first().copied(), sun)?;
    let mirrors = field_mirrors(&field, sun, &mirror)?;
    let mut tally = Tally::default();
    tally.add(&mirrors.status);
    printer.say(format_args!(
        "{}: {tally}; {} of mirror",
        Counted(field.len(), "heliostat"),
        Counted(mirrors.elements.len(), "element")
    ));
    warn_of_missing(&field, &mirrors, printer);
    let sun = sun.as_enu();
    let toward = [sun.east, sun.north, sun.up];
    let (map, taken) = super::light(&scene, &mirrors.elements, toward, threads, printer)?;
    summary::say_account(map.account(), printer);
    summary::say_peak(&scene.receiver, &map, scene.sun.dni_w_m2, printer);
    let drawn = plots::draw(args, || {
        let name = path.display();
        let mut facts = vec![(
            "field".to_owned(),
            format!("{name}: {}: {tally}", Counted(field.len(), "heliostat")),
        )];
        facts.extend(plots::facts(&scene, block.describe(0)));
        Ok(Plot {
            title: format!("Flux of {name}"),
            facts,
            account: Some(map.account()),
            figures: vec![plots::of_receiver(&scene, &map, &block.describe(0))?],
            notes: vec!["Heliostats that cannot track neither shade nor block others.".to_owned()],
            ..Plot::default()
        })
    })?;
    outputs.map(
        &scene.receiver,
        &map,
        ["east_m", "north_m", "up_m"],
        printer,
    )?;
    if let Some(drawn) = drawn {
        drawn.write()?;
    }
    let found = json!({
        "field": path.display().to_string(),
        "time": block.unix_ns.first().map(|time| format_time(*time)),
        "sun_azimuth_deg": block.azimuth_deg[0],
        "sun_elevation_deg": block.elevation_deg[0],
        "heliostats": statuses(&tally),
        "elements": mirrors.elements.len(),
        "mirror_area_m2": mirrors.elements.iter().map(helio_flux::Element::area_m2).sum::<f64>(),
        "scene": super::about_scene(&scene, toward, &taken),
        "power": summary::account(map.account()),
        "receiver": summary::receiver(&scene.receiver, &map, scene.sun.dni_w_m2),
        "files": super::hashes(&inputs)?,
        "version": env!("CARGO_PKG_VERSION"),
    });
    outputs.summary(&found, printer)?;
    Ok(if tally.failed() > 0 {
        Outcome::SomeRowsFailed
    } else {
        Outcome::Good
    })
}

/// The field with the calibration that holds at a time.
fn up_to_date(loaded: &LoadedField, unix_ns: Option<i64>, sun: EnuUnit) -> Result<Field, Failure> {
    let mut field = loaded.field.clone();
    if let Some(schedule) = &loaded.schedule {
        let hour_rad = hour_angle_rad(sun, latitude_rad(loaded)?);
        schedule.update(&mut field, unix_ns, hour_rad)?;
    }
    Ok(field)
}

fn warn_of_missing(field: &Field, mirrors: &FieldMirrors, printer: &Printer) {
    let without = |status: &Status| !matches!(status, Status::Ok | Status::SunBelowHorizon);
    let count = mirrors.status.iter().filter(|s| without(s)).count();
    if let Some(first) = mirrors.status.iter().position(without) {
        printer.warn(format_args!(
            "{} cannot track and are left out, first `{}` ({}); they neither shade nor block",
            Counted(count, "heliostat"),
            field.ids()[first],
            mirrors.status[first]
        ));
    }
}

fn statuses(tally: &Tally) -> Value {
    let counts: Map<String, Value> = tally
        .rows()
        .into_iter()
        .filter(|(_, count)| *count > 0)
        .map(|(status, count)| (status.to_string(), json!(count)))
        .collect();
    Value::Object(counts)
}
