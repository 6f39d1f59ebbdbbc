//! `scene.toml`: what mirrors are lit by, and what they light.

pub(crate) mod keys;
mod light;
mod receiver;

use std::path::{Path, PathBuf};

use helio_core::angle::radians;
use helio_flux::mesh::Pick;
use helio_flux::sunshape::SOLAR_HALF_ANGLE_RAD;
use helio_flux::{Canting, FluxError, HeliostatMirror, OpticalError, Receiver, SunShape};

use crate::error::{IoError, Problem};
use crate::field::LoadedField;
use crate::keys::Key;
use crate::table::read_text;
use crate::toml::{Section, Source};

/// Which mirrors a scene is for: some of its keys are of one kind only.
#[derive(Debug, Clone, Copy)]
#[non_exhaustive]
pub enum SceneOf<'a> {
    /// Those of a mesh.
    Mesh,
    /// The heliostats of a field.
    Field(&'a LoadedField),
    /// Heliostats that no `field.toml` describes: none of their targets has a name.
    Heliostats,
}

/// A scene as its file describes it.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub struct FluxScene {
    /// The sun's light.
    pub sun: SceneSun,
    /// The mirrors' optics, and which they are.
    pub mirror: SceneMirror,
    /// What they light.
    pub receiver: Receiver,
    /// How the flux is found.
    pub rays: SceneRays,
    /// Every file read, `scene.toml` first.
    pub files: Vec<PathBuf>,
    /// Things worth saying that stop nothing.
    pub warnings: Vec<String>,
}

/// The sun of a scene.
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
pub struct SceneSun {
    /// Direction to it in the frame of the model, of any length; none is stated for a field.
    pub toward: Option<[f64; 3]>,
    /// How its light is spread.
    pub form: SunForm,
    /// Direct normal irradiance \[W/m²\].
    pub dni_w_m2: f64,
}

/// How the sun's light is spread over directions; see [`SunShape`].
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
pub enum SunForm {
    /// An even disc of this half angle \[rad\].
    Pillbox(f64),
    /// A disc of this half angle \[rad\] that darkens toward its limb.
    LimbDarkened(f64),
    /// A Gaussian cone of this standard deviation per axis \[rad\].
    Gaussian(f64),
    /// Disc and aureole of this circumsolar ratio.
    Buie(f64),
}

impl SunForm {
    /// The word for it in `scene.toml`.
    #[must_use]
    pub const fn as_str(self) -> &'static str {
        match self {
            Self::Pillbox(_) => "pillbox",
            Self::LimbDarkened(_) => "limb-darkened",
            Self::Gaussian(_) => "gaussian",
            Self::Buie(_) => "buie",
        }
    }

    /// The shape to trace with.
    ///
    /// # Errors
    /// [`FluxError::BadValue`] for a number out of range.
    pub fn shape(self) -> Result<SunShape, FluxError> {
        match self {
            Self::Pillbox(half_angle_rad) => SunShape::pillbox(half_angle_rad),
            Self::LimbDarkened(half_angle_rad) => SunShape::limb_darkened(half_angle_rad),
            Self::Gaussian(sigma_rad) => SunShape::gaussian(sigma_rad),
            Self::Buie(ratio) => SunShape::buie(ratio),
        }
    }
}

/// Unit of length of a mesh's files.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum SceneUnit {
    /// Metres.
    Metre,
    /// Centimetres.
    Centimetre,
    /// Millimetres.
    Millimetre,
    /// Inches.
    Inch,
}

impl SceneUnit {
    /// The unit in metres.
    #[must_use]
    pub const fn metres(self) -> f64 {
        match self {
            Self::Metre => 1.0,
            Self::Centimetre => 0.01,
            Self::Millimetre => 0.001,
            Self::Inch => 0.0254,
        }
    }

    fn of(section: &Section<'_>) -> Result<Option<Self>, IoError> {
        Ok(section.text(&keys::UNIT)?.map(|unit| match unit {
            "cm" => Self::Centimetre,
            "mm" => Self::Millimetre,
            "in" => Self::Inch,
            _ => Self::Metre,
        }))
    }
}

/// Which part of a mesh is meant.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
#[non_exhaustive]
pub enum MirrorPart {
    /// All that reflects.
    #[default]
    All,
    /// An element set.
    ElementSet(String),
    /// A surface.
    Surface(String),
    /// The faces whose corners are all in a node set.
    NodeSet(String),
}

impl MirrorPart {
    /// What to ask a mesh for.
    #[must_use]
    pub fn pick(&self) -> Pick<'_> {
        match self {
            Self::All => Pick::All,
            Self::ElementSet(name) => Pick::ElementSet(name),
            Self::Surface(name) => Pick::Surface(name),
            Self::NodeSet(name) => Pick::NodeSet(name),
        }
    }

    fn of(section: &Section<'_>) -> Result<Self, IoError> {
        let mut part = None;
        for (key, of) in [
            (&keys::ELEMENT_SET, Self::ElementSet as fn(String) -> Self),
            (&keys::SURFACE, Self::Surface),
            (&keys::NODE_SET, Self::NodeSet),
        ] {
            if let Some(name) = section.text(key)? {
                if part.is_some() {
                    let message = format!(
                        "{} stands beside another of element_set, surface and node_set; wanted one",
                        section.dotted(key)
                    );
                    return Err(section.error(key, Problem::Conflict { message }));
                }
                part = Some(of(name.to_owned()));
            }
        }
        Ok(part.unwrap_or_default())
    }
}

/// The mirrors of a scene.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub struct SceneMirror {
    /// The part of the light that is reflected.
    pub reflectivity: f64,
    /// What the surface does to the light besides.
    pub error: OpticalError,
    /// Of a mesh: which part of it is the mirror.
    pub part: MirrorPart,
    /// Of a mesh: the unit of its lengths, if it is said.
    pub unit: Option<SceneUnit>,
    /// Of a mesh: the least angle between faces of two facets \[rad\], if it is stated.
    pub crease_rad: Option<f64>,
    /// Of a mesh: along which axis slope errors are told first, if it is stated.
    pub axis: Option<[f64; 3]>,
    /// Of a field: how its heliostats are built.
    pub heliostat: Option<HeliostatMirror>,
}

/// How the flux is found.
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
pub struct SceneRays {
    /// By rays or by integrals.
    pub method: SceneMethod,
    /// Of [`SceneMethod::Auto`]: the relative standard error of the greatest irradiance.
    pub error: f64,
    /// Rays in all.
    pub count: u64,
    /// Of the rays.
    pub seed: u64,
    /// Of integrals: points along each side of a bin.
    pub points: usize,
}

/// By rays or by integrals.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
#[non_exhaustive]
pub enum SceneMethod {
    /// [`helio_flux::trace_rays`].
    #[default]
    Trace,
    /// [`helio_flux::convolve()`].
    Convolve,
    /// As [`helio_flux::choose_way`] says.
    Auto,
}

/// Reads a `scene.toml`, and the file of its receiver if that is a mesh.
///
/// # Errors
/// [`IoError`] with file, line and column for text that is no TOML, an unknown or missing key, a number out of
/// range, a key that does not go with the shape of sun or receiver or with the kind of mirrors, and a receiver that is
/// none.
///
/// ```
/// use helio_io::{SceneOf, load_scene};
/// let folder = tempfile::tempdir()?;
/// let path = folder.path().join("scene.toml");
/// std::fs::write(&path, r#"
///     [sun]
///     dni_w_m2 = 822
///     [mirror]
///     reflectivity = 0.87
///     [receiver]
///     shape = "plane"
///     centre_m = [0, 0, 1]
///     facing = [0, 0, -1]
///     width_m = 0.2
///     height_m = 0.2
/// "#)?;
/// let scene = load_scene(&path, SceneOf::Mesh)?;
/// assert_eq!((scene.receiver.bins(), scene.sun.dni_w_m2), (2500, 822.0));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn load_scene(path: &Path, of: SceneOf<'_>) -> Result<FluxScene, IoError> {
    scene_of_text(path, &read_text(path)?, of)
}

/// The scene of a text that stands, or might stand, in a `scene.toml` at that path: messages name it, and files named
/// in the text are sought from its folder.
///
/// # Errors
/// As [`load_scene`].
///
/// ```
/// use helio_io::{SceneOf, scene_of_text};
/// let text = "[receiver]\nshape = \"plane\"\ncentre_m = [0, 0, 1]\nfacing = [0, 0, -1]\nwidth_m = 1\nheight_m = 1";
/// let scene = scene_of_text("scene".as_ref(), text, SceneOf::Mesh)?;
/// assert_eq!(scene.sun.dni_w_m2, 1000.0);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn scene_of_text(path: &Path, text: &str, of: SceneOf<'_>) -> Result<FluxScene, IoError> {
    let source = Source { path, text };
    let document = source.parse()?;
    let file = Section::new(
        source,
        String::new(),
        document.as_table(),
        None,
        keys::SCENE_FILE,
    )?;
    let mut files = vec![path.to_path_buf()];
    let mut warnings = Vec::new();
    let sun = sun(&file, of)?;
    let mirror = mirror(&file, of)?;
    let Some(section) = file.section(&keys::RECEIVER)? else {
        return Err(file.missing(&keys::RECEIVER));
    };
    let receiver = receiver::receiver(&section, of, &mut files, &mut warnings)?;
    let rays = rays(&file)?;
    Ok(FluxScene {
        sun,
        mirror,
        receiver,
        rays,
        files,
        warnings,
    })
}

/// A problem with keys that are right one by one.
fn conflict(section: &Section<'_>, key: &Key, message: String) -> IoError {
    section.error(key, Problem::Conflict { message })
}

/// What the library says of a value, at the key of that name.
fn refused(section: &Section<'_>, known: &[&Key], otherwise: &Key, error: &FluxError) -> IoError {
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

/// A whole number.
fn whole(section: &Section<'_>, key: &Key) -> Result<Option<u64>, IoError> {
    let Some(number) = section.number(key)? else {
        return Ok(None);
    };
    if number.fract() != 0.0 {
        let problem = Problem::WrongKind {
            what: section.dotted(key),
            wanted: "a whole number".into(),
            found: number.to_string(),
        };
        return Err(section.error(key, problem));
    }
    Ok(Some(number as u64))
}

fn sun(file: &Section<'_>, of: SceneOf<'_>) -> Result<SceneSun, IoError> {
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
fn direction(section: &Section<'_>, key: &Key) -> Result<Option<[f64; 3]>, IoError> {
    let Some(vector) = section.enu(key, keys::FAR_M)? else {
        return Ok(None);
    };
    if vector.iter().all(|x| x.abs() < 1e-9) {
        let message = format!("{} has no length, so no direction", section.dotted(key));
        return Err(conflict(section, key, message));
    }
    Ok(Some(vector))
}

fn mirror(file: &Section<'_>, of: SceneOf<'_>) -> Result<SceneMirror, IoError> {
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
    let count = |key| Ok::<usize, IoError>(whole(section, key)?.unwrap_or(1) as usize);
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

fn rays(file: &Section<'_>) -> Result<SceneRays, IoError> {
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
    if let Some(count) = whole(&section, &keys::RAY_COUNT)? {
        rays.count = count;
    }
    if let Some(seed) = whole(&section, &keys::SEED)? {
        rays.seed = seed;
    }
    if let Some(points) = whole(&section, &keys::POINTS)? {
        rays.points = points as usize;
    }
    Ok(rays)
}

#[cfg(test)]
mod tests;
