//! `flux`: irradiance on a receiver, from a loaded structure, a field of heliostats, or a camera's picture.

mod camera;
mod field;
mod mesh;
mod outputs;
mod plots;
mod shapes;
mod summary;

use std::path::PathBuf;
use std::sync::Mutex;
use std::sync::atomic::Ordering;

use helio_flux::{Element, FluxMap};
use helio_io::{FluxScene, SceneMethod, SceneOf, SunForm, hash_file, load_scene};
use serde_json::{Value, json};

use super::track::stop_on_signals;
use crate::Outcome;
use crate::args::{FluxArgs, InsteadArgs};
use crate::failure::Failure;
use crate::plan;
use crate::printer::{Grouped, Printer};

pub(crate) fn run(args: &FluxArgs, printer: &Printer) -> Result<Outcome, Failure> {
    let threads = plan::threads(args.threads)?;
    if args.field.is_none() {
        for (given, option) in [
            (args.sun.time.is_some(), "--time"),
            (args.sun.sun_azimuth_deg.is_some(), "--sun-azimuth-deg"),
        ] {
            if given {
                return Err(Failure::refused(format!(
                    "{option} is of --field; the sun of a mesh is `toward` of [sun] in its scene"
                )));
            }
        }
    }
    match (&args.mesh, &args.field, &args.camera) {
        (Some(model), ..) => mesh::run(model, args, threads, printer),
        (_, Some(field), _) => field::run(field, args, threads, printer),
        (.., Some(frame)) => camera::run(frame, args, printer),
        // The command line wants one of them.
        _ => Err(Failure::refused("wanted --mesh, --field or --camera")),
    }
}

/// The scene of a run, with what was typed instead of it.
fn scene(args: &FluxArgs, of: SceneOf<'_>, printer: &Printer) -> Result<FluxScene, Failure> {
    let Some(path) = &args.scene else {
        // The command line wants it.
        return Err(Failure::refused("--scene FILE is missing"));
    };
    let mut scene = load_scene(path, of)?;
    for warning in &scene.warnings {
        printer.warn(warning);
    }
    instead(&mut scene, &args.instead)?;
    if scene.rays.method == SceneMethod::Convolve {
        printer.note(format_args!(
            "by convolution mirrors neither shade nor block each other"
        ));
    }
    Ok(scene)
}

fn instead(scene: &mut FluxScene, typed: &InsteadArgs) -> Result<(), Failure> {
    if let Some(dni_w_m2) = typed.dni_w_m2 {
        scene.sun.dni_w_m2 = dni_w_m2;
    }
    if let Some(half_angle_mrad) = typed.half_angle_mrad {
        let half_angle_rad = 1e-3 * half_angle_mrad;
        scene.sun.form = match scene.sun.form {
            SunForm::Pillbox(_) => SunForm::Pillbox(half_angle_rad),
            SunForm::LimbDarkened(_) => SunForm::LimbDarkened(half_angle_rad),
            other => {
                return Err(Failure::refused(format!(
                    "--half-angle-mrad is of a pillbox or limb-darkened sun; the scene's is {}",
                    other.as_str()
                )));
            }
        };
    }
    for (given, option) in [
        (typed.rays.is_some(), "--rays"),
        (typed.seed.is_some(), "--seed"),
    ] {
        if given && scene.rays.method == SceneMethod::Convolve {
            return Err(Failure::refused(format!(
                "{option} is of rays; the scene's method is convolve"
            )));
        }
    }
    scene.rays.count = typed.rays.unwrap_or(scene.rays.count);
    scene.rays.seed = typed.seed.unwrap_or(scene.rays.seed);
    Ok(())
}

/// Traces or integrates, with progress, until it is done or somebody wants an end.
fn light(
    scene: &FluxScene,
    elements: &[Element],
    sun: [f64; 3],
    threads: usize,
    printer: &Printer,
) -> Result<FluxMap, Failure> {
    let trace = scene.rays.method == SceneMethod::Trace;
    let stop = stop_on_signals();
    let progress = Mutex::new(None);
    let things = if trace { "rays" } else { "bins" };
    let watch = |more: u64, all: u64| {
        if let Ok(mut progress) = progress.lock() {
            progress
                .get_or_insert_with(|| printer.progress_of(all, things))
                .advance(more);
        }
        !stop.load(Ordering::Relaxed)
    };
    let Some(map) = scene.light(elements, sun, threads, &watch)? else {
        return Err(Failure::Interrupted { streamed: false });
    };
    if !trace {
        say_oblique(scene, elements, sun, printer);
    }
    let took_s = match progress.into_inner() {
        Ok(Some(progress)) => progress.finish().as_secs_f64(),
        _ => 0.0,
    };
    let count = if trace {
        map.account().rays
    } else {
        scene.receiver.bins() as u64
    };
    printer.say(format_args!("{} {things} in {took_s:.2} s", Grouped(count)));
    Ok(map)
}

/// Cosine of incidence below which a slope error's cone is far from round.
const OBLIQUE: f64 = 0.9;

/// A slope error turns rays by twice itself in the plane of incidence, and by less across; the integral takes it round.
fn say_oblique(scene: &FluxScene, elements: &[Element], sun: [f64; 3], printer: &Printer) {
    let dot = |n: [f64; 3]| n[0] * sun[0] + n[1] * sun[1] + n[2] * sun[2];
    let length = dot(sun).sqrt();
    let cosines = elements.iter().map(|e| dot(e.normal()) / length);
    let least = cosines.filter(|cosine| *cosine > 0.0).fold(1.0, f64::min);
    if scene.mirror.error.slope_rms_rad() > 0.0 && least < OBLIQUE {
        printer.warn(format_args!(
            "convolve takes the light that slope errors scatter as round, and it is {least:.2} times as wide across as in the plane of \
             incidence (up to {:.0} degrees here): peaks may be 10 % off at 60 degrees and 30 % at 75; method = \"trace\" is right",
            least.acos().to_degrees()
        ));
    }
}

/// What every summary of a scene has.
fn about_scene(scene: &FluxScene, sun: [f64; 3]) -> Value {
    let (name, value) = match scene.sun.form {
        SunForm::Pillbox(rad) | SunForm::LimbDarkened(rad) => ("half_angle_mrad", 1e3 * rad),
        SunForm::Gaussian(rad) => ("sigma_mrad", 1e3 * rad),
        SunForm::Buie(ratio) => ("circumsolar_ratio", ratio),
        _ => ("extent", f64::NAN),
    };
    let rays = match scene.rays.method {
        SceneMethod::Convolve => json!({ "method": "convolve", "points": scene.rays.points }),
        _ => json!({ "method": "trace", "count": scene.rays.count, "seed": scene.rays.seed }),
    };
    json!({
        "sun": {
            "toward": sun,
            "shape": scene.sun.form.as_str(),
            name: value,
            "dni_w_m2": scene.sun.dni_w_m2,
        },
        "reflectivity": scene.mirror.reflectivity,
        "slope_error_mrad": 1e3 * scene.mirror.error.slope_rms_rad(),
        "specularity_mrad": 1e3 * scene.mirror.error.specularity_rms_rad(),
        "rays": rays,
    })
}

/// Files that were read, with their contents' hashes.
fn hashes(files: &[PathBuf]) -> Result<Value, Failure> {
    let hashes = files
        .iter()
        .map(|path| {
            let hash = hash_file(path)?;
            Ok(json!({ "file": path.display().to_string(), "sha256": hash }))
        })
        .collect::<Result<Vec<_>, Failure>>()?;
    Ok(Value::Array(hashes))
}
