//! The sections of a scene but its receiver.

use helio_core::angle::radians;
use helio_flux::sunshape::SOLAR_HALF_ANGLE_RAD;
use helio_flux::{Canting, FluxError, HeliostatMirror, OpticalError};

use super::{
    MirrorPart, SceneMethod, SceneMirror, SceneOf, SceneRays, SceneSun, SceneUnit, SunForm, keys,
};
use crate::error::{IoError, Problem};
use crate::keys::Key;
use crate::toml::Section;

/// What messages call a number without a fraction.
pub(super) const WHOLE: &str = "a whole number";

/// A problem with keys that are right one by one.
pub(super) fn conflict(section: &Section<'_>, key: &Key, message: String) -> IoError {
    section.error(key, Problem::Conflict { message })
}

/// What the library says of a value, at the key of that name.
pub(super) fn refused(
    section: &Section<'_>,
    known: &[&Key],
    otherwise: &Key,
    error: &FluxError,
) -> IoError {
    let what = match error {
        FluxError::BadValue { what, .. } => *what,
        _ => "",
    };
    let count = |key| section.number(key).ok().flatten().unwrap_or(0.0);
    // The library has names of its own for these: the key that is in the file, of several.
    let names: &[&str] = match what {
        "bins" if count(&keys::COLUMNS) > count(&keys::ROWS) => &["columns", "rows"],
        "bins" => &["rows", "columns"],
        "normal" => &["facing"],
        "greater radius" | "smaller radius" => &["base_radius_m", "radius_m"],
        _ => &[what],
    };
    let mut named = names
        .iter()
        .filter_map(|name| known.iter().find(|key| key.name == *name).copied());
    let first = named.clone().next();
    let key = named.find(|key| section.has(key)).or(first);
    let key = key.unwrap_or(otherwise);
    conflict(section, key, error.to_string())
}

pub(super) fn sun(file: &Section<'_>, of: SceneOf<'_>) -> Result<SceneSun, IoError> {
    let mut sun = SceneSun {
        toward: None,
        form: SunForm::Pillbox(SOLAR_HALF_ANGLE_RAD),
        dni_w_m2: 1000.0,
    };
    let Some(section) = file.section(&keys::SUN)? else {
        return Ok(sun);
    };
    if let Some(dni_w_m2) = section.number(&keys::DNI)? {
        sun.dni_w_m2 = dni_w_m2;
    }
    sun.toward = direction(&section, &keys::TOWARD)?;
    if sun.toward.is_some() && !matches!(of, SceneOf::Mesh) {
        let message = format!(
            "{} is of a mesh; of a field the sun is that of --time, or of --sun-azimuth-deg and --sun-elevation-deg",
            section.dotted(&keys::TOWARD)
        );
        return Err(conflict(&section, &keys::TOWARD, message));
    }
    let word = section.text(&keys::SHAPE)?.unwrap_or("pillbox");
    let own = match word {
        "gaussian" => &keys::SIGMA,
        "buie" => &keys::CIRCUMSOLAR,
        _ => &keys::HALF_ANGLE,
    };
    for key in [&keys::HALF_ANGLE, &keys::SIGMA, &keys::CIRCUMSOLAR] {
        if key.name != own.name && section.has(key) {
            let message = format!(
                "{} does not go with shape = \"{word}\", which has {}",
                section.dotted(key),
                own.name
            );
            return Err(conflict(&section, key, message));
        }
    }
    let number = section.number(own)?;
    let mrad = |number: f64| 1e-3 * number;
    sun.form = match (word, number) {
        ("gaussian", Some(sigma)) => SunForm::Gaussian(mrad(sigma)),
        ("buie", Some(ratio)) => SunForm::Buie(ratio),
        ("gaussian" | "buie", None) => return Err(section.missing(own)),
        ("limb-darkened", half) => SunForm::LimbDarkened(half.map_or(SOLAR_HALF_ANGLE_RAD, mrad)),
        (_, half) => SunForm::Pillbox(half.map_or(SOLAR_HALF_ANGLE_RAD, mrad)),
    };
    Ok(sun)
}

/// A vector with a length.
pub(super) fn direction(section: &Section<'_>, key: &Key) -> Result<Option<[f64; 3]>, IoError> {
    let Some(vector) = section.enu(key, keys::FAR_M)? else {
        return Ok(None);
    };
    if vector.iter().all(|x| x.abs() < 1e-9) {
        let message = format!("{} has no length, so no direction", section.dotted(key));
        return Err(conflict(section, key, message));
    }
    Ok(Some(vector))
}

pub(super) fn mirror(file: &Section<'_>, of: SceneOf<'_>) -> Result<SceneMirror, IoError> {
    let mut mirror = SceneMirror {
        reflectivity: 1.0,
        error: OpticalError::NONE,
        part: MirrorPart::All,
        unit: None,
        crease_rad: None,
        axis: None,
        heliostat: None,
    };
    let field = !matches!(of, SceneOf::Mesh);
    let Some(section) = file.section(&keys::MIRROR)? else {
        if field {
            return Err(file.missing(&keys::MIRROR));
        }
        return Ok(mirror);
    };
    let (others, whose): (&[&Key], _) = if field {
        (
            &keys::OF_MESH,
            "a mesh; the mirrors here are the field's heliostats",
        )
    } else {
        (
            &keys::OF_FIELD,
            "a field's heliostats; a mesh has a shape of its own",
        )
    };
    for key in others {
        if section.has(key) {
            let message = format!("{} is of {whose}", section.dotted(key));
            return Err(conflict(&section, key, message));
        }
    }
    if let Some(reflectivity) = section.number(&keys::REFLECTIVITY)? {
        mirror.reflectivity = reflectivity;
    }
    let mrad = |key| Ok::<f64, IoError>(1e-3 * section.number(key)?.unwrap_or(0.0));
    let (slope_rad, specularity_rad) = (mrad(&keys::SLOPE)?, mrad(&keys::SPECULARITY)?);
    mirror.error = OpticalError::new(slope_rad, specularity_rad)
        .map_err(|error| conflict(&section, &keys::SLOPE, error.to_string()))?;
    mirror.part = MirrorPart::of(&section)?;
    mirror.unit = SceneUnit::of(&section)?;
    mirror.crease_rad = section.number(&keys::CREASE)?.map(radians);
    mirror.axis = direction(&section, &keys::AXIS)?;
    if field {
        mirror.heliostat = Some(heliostat(&section, mirror.reflectivity)?);
    }
    Ok(mirror)
}

fn heliostat(section: &Section<'_>, reflectivity: f64) -> Result<HeliostatMirror, IoError> {
    let needed = |key| section.number(key)?.ok_or_else(|| section.missing(key));
    let count = |key| Ok::<usize, IoError>(section.whole(key, WHOLE)?.unwrap_or(1) as usize);
    let focal_m = section.number(&keys::FOCAL)?;
    let canting = match (section.text(&keys::CANTING)?, focal_m) {
        (Some("focal-length"), Some(focal_m)) => Canting::FocalLength(focal_m),
        (Some("focal-length"), None) => return Err(section.missing(&keys::FOCAL)),
        (_, Some(_)) => {
            let message = format!(
                "{} goes with canting = \"focal-length\" only",
                section.dotted(&keys::FOCAL)
            );
            return Err(conflict(section, &keys::FOCAL, message));
        }
        (Some("to-aim"), None) => Canting::ToAim,
        _ => Canting::Flat,
    };
    Ok(HeliostatMirror {
        width_m: needed(&keys::WIDTH)?,
        height_m: needed(&keys::HEIGHT)?,
        columns: count(&keys::FACET_COLUMNS)?,
        rows: count(&keys::FACET_ROWS)?,
        gap_m: section.number(&keys::GAP)?.unwrap_or(0.0),
        canting,
        pieces: count(&keys::PIECES)?,
        reflectivity,
    })
}

pub(super) fn rays(file: &Section<'_>) -> Result<SceneRays, IoError> {
    let mut rays = SceneRays {
        method: SceneMethod::Trace,
        error: 0.01,
        count: 4_000_000,
        seed: 0,
        points: 2,
    };
    let Some(section) = file.section(&keys::RAYS)? else {
        return Ok(rays);
    };
    rays.method = match section.text(&keys::METHOD)? {
        Some("convolve") => SceneMethod::Convolve,
        Some("auto") => SceneMethod::Auto,
        _ => SceneMethod::Trace,
    };
    let others: &[(&Key, &str)] = match rays.method {
        SceneMethod::Trace => &[(&keys::POINTS, "convolve"), (&keys::ERROR, "auto")],
        SceneMethod::Convolve => &[
            (&keys::RAY_COUNT, "trace"),
            (&keys::SEED, "trace"),
            (&keys::ERROR, "auto"),
        ],
        SceneMethod::Auto => &[(&keys::RAY_COUNT, "trace"), (&keys::POINTS, "convolve")],
    };
    for (key, method) in others {
        if section.has(key) {
            let message = format!("{} is of method = \"{method}\"", section.dotted(key));
            return Err(conflict(&section, key, message));
        }
    }
    if let Some(error) = section.number(&keys::ERROR)? {
        rays.error = error;
    }
    if let Some(count) = section.whole(&keys::RAY_COUNT, WHOLE)? {
        rays.count = count;
    }
    if let Some(seed) = section.whole(&keys::SEED, WHOLE)? {
        rays.seed = seed;
    }
    if let Some(points) = section.whole(&keys::POINTS, WHOLE)? {
        rays.points = points as usize;
    }
    Ok(rays)
}
