//! `scene.toml`: what mirrors are lit by, and what they light.

pub(crate) mod keys;
mod light;
mod receiver;
mod sections;

use std::path::{Path, PathBuf};

use helio_flux::mesh::Pick;
use helio_flux::{FluxError, HeliostatMirror, OpticalError, Receiver, SunShape};

use crate::error::{IoError, Problem};
use crate::field::LoadedField;
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
    let sun = sections::sun(&file, of)?;
    let mirror = sections::mirror(&file, of)?;
    let Some(section) = file.section(&keys::RECEIVER)? else {
        return Err(file.missing(&keys::RECEIVER));
    };
    let receiver = receiver::receiver(&section, of, &mut files, &mut warnings)?;
    let rays = sections::rays(&file)?;
    Ok(FluxScene {
        sun,
        mirror,
        receiver,
        rays,
        files,
        warnings,
    })
}

#[cfg(test)]
mod tests;
