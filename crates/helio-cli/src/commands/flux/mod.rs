//! `flux`: irradiance on a receiver, from a loaded structure, a field of heliostats, or a camera's picture.

mod camera;
mod field;
mod mesh;
mod outputs;
mod plots;
mod shapes;
mod summary;
mod way;

use std::path::PathBuf;

use helio_io::{FluxScene, SceneMethod, SceneOf, SunForm, hash_file, load_scene};
use serde_json::{Value, json};
use way::{Taken, light};

use crate::Outcome;
use crate::args::{FluxArgs, InsteadArgs};
use crate::failure::Failure;
use crate::plan;
use crate::printer::Printer;

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
    let method = scene.rays.method;
    let (convolve, auto) = (SceneMethod::Convolve, SceneMethod::Auto);
    for (wrong, option, of) in [
        (
            typed.rays.is_some() && method == convolve,
            "--rays",
            "convolve",
        ),
        (typed.rays.is_some() && method == auto, "--rays", "auto"),
        (
            typed.seed.is_some() && method == convolve,
            "--seed",
            "convolve",
        ),
    ] {
        if wrong {
            return Err(Failure::refused(format!(
                "{option} is of rays; the scene's method is {of}"
            )));
        }
    }
    scene.rays.count = typed.rays.unwrap_or(scene.rays.count);
    scene.rays.seed = typed.seed.unwrap_or(scene.rays.seed);
    Ok(())
}

/// What every summary of a scene has.
fn about_scene(scene: &FluxScene, sun: [f64; 3], taken: &Taken) -> Value {
    let (name, value) = match scene.sun.form {
        SunForm::Pillbox(rad) | SunForm::LimbDarkened(rad) => ("half_angle_mrad", 1e3 * rad),
        SunForm::Gaussian(rad) => ("sigma_mrad", 1e3 * rad),
        SunForm::Buie(ratio) => ("circumsolar_ratio", ratio),
        _ => ("extent", f64::NAN),
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
        "rays": taken.about(scene),
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
