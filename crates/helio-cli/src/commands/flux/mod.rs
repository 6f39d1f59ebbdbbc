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

use helio_flux::{
    ConvolveOptions, Element, FluxMap, RayOptions, Rays, Scene, convolve_watched,
    trace_rays_watched,
};
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
    let shape = scene.sun.form.shape()?;
    let lit = Scene {
        elements,
        receiver: &scene.receiver,
        sun,
        dni_w_m2: scene.sun.dni_w_m2,
        sun_shape: &shape,
        optical_error: scene.mirror.error,
    };
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
    let map = if trace {
        let options = RayOptions {
            rays: Rays::Total(scene.rays.count),
            seed: scene.rays.seed,
            threads,
            ..RayOptions::default()
        };
        trace_rays_watched(&lit, &options, &watch)?
    } else {
        let options = ConvolveOptions {
            points: scene.rays.points,
            threads,
            ..ConvolveOptions::default()
        };
        convolve_watched(&lit, &options, &watch)?
    };
    let interrupted = Failure::Interrupted { streamed: false };
    let Some(map) = map else {
        return Err(interrupted);
    };
    if !trace {
        let going = |_: u64, _: u64| !stop.load(Ordering::Relaxed);
        let other = ConvolveOptions {
            points: other_points(scene.rays.points),
            threads,
        };
        let Some(other) = convolve_watched(&lit, &other, &going)? else {
            return Err(interrupted);
        };
        settled(scene, &map, &other)?;
        say_oblique(&lit, printer);
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

/// Points of a second integral, which the first is held against.
const fn other_points(points: usize) -> usize {
    if points < 64 { points + 1 } else { points - 1 }
}

/// Of the reflected power so much at most may lie in other bins with other points.
const SETTLED: f64 = 0.02;

/// Refuses a map whose points lie farther apart than its image is wide: they find it by chance, and the power with it.
fn settled(scene: &FluxScene, map: &FluxMap, other: &FluxMap) -> Result<(), Failure> {
    let account = map.account();
    let reflected_w = account.incoming_w - account.reflection_loss_w;
    let bins = map.irradiance_w_m2().iter().zip(other.irradiance_w_m2());
    let apart_w: f64 = bins
        .enumerate()
        .map(|(bin, (one, other))| scene.receiver.bin_area_m2(bin) * (one - other).abs())
        .sum();
    let surplus_w = account.received_w - reflected_w;
    if apart_w <= SETTLED * reflected_w && surplus_w <= 0.5 * SETTLED * reflected_w {
        return Ok(());
    }
    let points = scene.rays.points;
    Err(Failure::refused(format!(
        "convolve: with {points} by {points} points for each bin {} W of {} W reflected are received, with {more} by {more} {} W, \
         and {apart_w:.4} W lie in other bins; wanted less than {:.0} %: the points lie too far apart for so small an image: \
         more rows and columns of [receiver], more points of [rays], or its method = \"trace\"",
        short(account.received_w),
        short(reflected_w),
        short(other.account().received_w),
        100.0 * SETTLED,
        more = other_points(points),
    )))
}

/// Four digits.
fn short(watts: f64) -> String {
    format!("{watts:.4}")
}

/// Cosine of incidence below which a slope error's cone is far from round.
const OBLIQUE: f64 = 0.9;

/// A slope error turns rays by twice itself in the plane of incidence, and by less across; the integral takes it round.
fn say_oblique(lit: &Scene<'_>, printer: &Printer) {
    let dot = |n: [f64; 3]| n[0] * lit.sun[0] + n[1] * lit.sun[1] + n[2] * lit.sun[2];
    let length = dot(lit.sun).sqrt();
    let cosines = lit.elements.iter().map(|e| dot(e.normal()) / length);
    let least = cosines.filter(|cosine| *cosine > 0.0).fold(1.0, f64::min);
    if lit.optical_error.slope_rms_rad() > 0.0 && least < OBLIQUE {
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
