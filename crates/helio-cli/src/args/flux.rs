//! What was typed for `flux`.

use std::path::PathBuf;

use clap::{ArgGroup, Args as ClapArgs, ValueEnum};
use helio_io::SceneUnit;

use super::{FormatWord, SunArgs, number};

/// Irradiance on a receiver: from a loaded structure, from a field of heliostats, or from a camera's picture
///
/// With --mesh the mirror is part of a mesh as solvers of structures write it (CalculiX and Abaqus .inp with .frd, Gmsh,
/// VTK, CSV), displaced by --displacements: how far its normals turn by planar element substitution and by mirror pose
/// reconstruction (Yan 2022), and the flux that one of them gives. With --field it is the heliostats of a field.toml as
/// they track a sun; they shade and block each other. scene.toml says what is lit: sun, optics, receiver, rays. With
/// --camera a gray picture becomes W/m² by one reading of a heat-flux gauge.
///
/// What was found goes to standard output (or --summary) as JSON: where the power went, peak and mean of the flux,
/// slope errors, faults of the mesh, heliostats by status. The map goes to --out, slope errors to --slopes, figures
/// to --plot. The exit status is 1 if heliostats or faces of the mirror are left out, or if none of the reflected light
/// arrives.
#[derive(Debug, ClapArgs)]
#[command(
    group = ArgGroup::new("source").required(true).args(["mesh", "field", "camera"]),
    after_help = "Example:\n  helio-rs flux --mesh examples/flux/strips.inp --displacements \
                  examples/flux/strips.frd --scene examples/flux/strips.toml --out map.csv --slopes slopes.csv\n  \
                  helio-rs flux --field examples/field.toml --time 2026-06-21T12:00:00Z --scene \
                  examples/flux/tower.toml --out flux.csv"
)]
pub(crate) struct FluxArgs {
    /// The model of the structure: .inp, .frd, .msh, .vtk, .vtu, .vtp, or .csv (a table of nodes)
    #[arg(long, value_name = "MODEL", requires = "scene")]
    pub(crate) mesh: Option<PathBuf>,
    /// The field.toml
    #[arg(long, value_name = "FILE", requires = "scene")]
    pub(crate) field: Option<PathBuf>,
    /// A frame of the receiver, as spot reads them
    #[arg(long, value_name = "FRAME", requires = "gauge")]
    pub(crate) camera: Option<PathBuf>,
    /// The scene.toml
    #[arg(long, value_name = "FILE", conflicts_with = "camera")]
    pub(crate) scene: Option<PathBuf>,
    #[command(flatten)]
    pub(crate) structure: MeshArgs,
    #[command(flatten)]
    pub(crate) sun: SunArgs,
    #[command(flatten)]
    pub(crate) instead: InsteadArgs,
    #[command(flatten)]
    pub(crate) picture: CameraArgs,
    /// File for the map, a row a bin: .csv, .parquet, .json, .jsonl, or .vtk for ParaView
    #[arg(long, value_name = "FILE")]
    pub(crate) out: Option<PathBuf>,
    /// Format of the map, whatever the suffix
    #[arg(long, value_name = "FORMAT", requires = "out")]
    pub(crate) format: Option<FormatWord>,
    /// File for the slope errors of a mesh, a row a face: .csv, or .vtk for ParaView
    #[arg(long, value_name = "FILE", requires = "mesh")]
    pub(crate) slopes: Option<PathBuf>,
    /// Figures of the map, of profiles through its peak and of the slope errors: .svg, .png, or .html for a page
    #[arg(long, value_name = "FILE")]
    pub(crate) plot: Option<PathBuf>,
    /// File for what was found; .json [default: standard output]
    #[arg(long, value_name = "FILE")]
    pub(crate) summary: Option<PathBuf>,
    /// Say nothing but errors
    #[arg(short, long)]
    pub(crate) quiet: bool,
    /// Threads to use [default: all processors]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=1024))]
    pub(crate) threads: Option<u16>,
}

/// Of a mesh.
#[derive(Debug, ClapArgs)]
pub(crate) struct MeshArgs {
    /// What the solver says of the nodes: .frd, .msh, .vtk, .vtu or .csv [default: displacements in the model's file,
    /// if there are any]
    #[arg(long, value_name = "RESULT", requires = "mesh")]
    pub(crate) displacements: Option<PathBuf>,
    /// Table of elements that goes with a table of nodes
    #[arg(long, value_name = "FILE", requires = "mesh")]
    pub(crate) elements: Option<PathBuf>,
    /// Step of an .frd [default: the last that is no eigenmode]
    #[arg(
        long,
        value_name = "N",
        allow_negative_numbers = true,
        requires = "displacements"
    )]
    pub(crate) step: Option<u64>,
    /// Name of the vectors that are displacements, in .msh and .vtk [default: displacement and the like]
    #[arg(long, value_name = "NAME", requires = "mesh")]
    pub(crate) vectors: Option<String>,
    /// Which deformed mirror is traced
    #[arg(
        long,
        value_name = "METHOD",
        default_value = "elements",
        requires = "mesh"
    )]
    pub(crate) method: DeformWord,
    /// Unit of length of the mesh's files [default: the scene's]
    #[arg(long, value_name = "UNIT", requires = "mesh")]
    pub(crate) unit: Option<UnitWord>,
    /// Surface of the mesh that is the mirror [default: the scene's]
    #[arg(long, value_name = "NAME", requires = "mesh", group = "part")]
    pub(crate) surface: Option<String>,
    /// Element set that is the mirror [default: the scene's]
    #[arg(long, value_name = "NAME", requires = "mesh", group = "part")]
    pub(crate) element_set: Option<String>,
}

/// Numbers instead of the scene's, for a loop over them.
#[derive(Debug, ClapArgs)]
pub(crate) struct InsteadArgs {
    /// Direct normal irradiance instead of the scene's
    #[arg(long, value_name = "W/M2", allow_negative_numbers = true, value_parser = irradiance)]
    pub(crate) dni_w_m2: Option<f64>,
    /// Half angle of the sun's disc instead of the scene's
    #[arg(long, value_name = "MRAD", allow_negative_numbers = true, value_parser = half_angle, requires = "scene")]
    pub(crate) half_angle_mrad: Option<f64>,
    /// Number of rays instead of the scene's
    #[arg(long, value_name = "N", allow_negative_numbers = true, requires = "scene", value_parser = clap::value_parser!(u64).range(1..=1_000_000_000_000))]
    pub(crate) rays: Option<u64>,
    /// Seed of the rays instead of the scene's
    #[arg(
        long,
        value_name = "N",
        allow_negative_numbers = true,
        value_parser = seed,
        requires = "scene"
    )]
    pub(crate) seed: Option<u64>,
}

/// Of a camera's picture.
#[derive(Debug, ClapArgs)]
pub(crate) struct CameraArgs {
    /// What a heat-flux gauge reads in W/m², and where the picture shows its sensor in pixels right and down (the
    /// middle of the first pixel is 0, 0), with the sensor's radius if gray is to be averaged over it
    #[arg(long, value_name = "X,Y,W/M2[,RADIUS]", allow_hyphen_values = true, requires = "camera", value_parser = gauge)]
    pub(crate) gauge: Option<Gauge>,
    /// Gray value without light
    #[arg(long, value_name = "GRAY", allow_negative_numbers = true, default_value = "0", value_parser = gray)]
    pub(crate) dark: f64,
    /// Gray value from which on the camera cannot tell more [default: 255 or 65535]
    #[arg(long, value_name = "GRAY", allow_negative_numbers = true, requires = "camera", value_parser = gray)]
    pub(crate) white: Option<f64>,
    /// Global and diffuse irradiance, whose difference is the direct one: for concentrations
    #[arg(long, value_name = "GLOBAL,DIFFUSE", allow_hyphen_values = true, requires = "camera", conflicts_with = "dni_w_m2", value_parser = two)]
    pub(crate) global_diffuse_w_m2: Option<[f64; 2]>,
    /// The target.toml of the receiver in the picture: the map is then one in metres on it
    #[arg(long, value_name = "FILE", requires = "camera")]
    pub(crate) target: Option<PathBuf>,
    /// Two evenly lit views of the receiver's paint, from the front and from aside: is it Lambertian?
    #[arg(long, value_name = "FRAME", num_args = 2, requires = "camera")]
    pub(crate) views: Option<Vec<PathBuf>>,
}

/// Which deformed mirror is traced.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum DeformWord {
    /// Every face where its nodes go: planar element substitution
    Elements,
    /// Every facet as three of its points move: mirror pose reconstruction
    Pose,
    /// Every facet as all of its nodes move, by least squares
    Rigid,
    /// The mirror without its load
    Unloaded,
}

/// A unit of length.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum UnitWord {
    M,
    Cm,
    Mm,
    In,
}

impl From<UnitWord> for SceneUnit {
    fn from(word: UnitWord) -> Self {
        match word {
            UnitWord::M => Self::Metre,
            UnitWord::Cm => Self::Centimetre,
            UnitWord::Mm => Self::Millimetre,
            UnitWord::In => Self::Inch,
        }
    }
}

/// A reading of a gauge.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Gauge {
    pub(crate) x_px: f64,
    pub(crate) y_px: f64,
    pub(crate) flux_w_m2: f64,
    pub(crate) radius_px: f64,
}

fn irradiance(text: &str) -> Result<f64, String> {
    number(text, 0.0, 1e6, "W/m²")
}

fn half_angle(text: &str) -> Result<f64, String> {
    number(text, 1e-6, 100.0, "milliradians")
}

/// As in a scene, whose numbers are doubles.
fn seed(text: &str) -> Result<u64, String> {
    const MOST: u64 = (1 << 53) - 1;
    let value = text.trim().parse().ok().filter(|seed| *seed <= MOST);
    value.ok_or_else(|| format!("wanted a whole number from 0 to {MOST} (2^53 - 1)"))
}

fn gray(text: &str) -> Result<f64, String> {
    number(text, 0.0, 65_535.0, "gray values")
}

fn gauge(text: &str) -> Result<Gauge, String> {
    let wanted = || "wanted X,Y,W/M2 or X,Y,W/M2,RADIUS, such as 120,80.5,4174,2".to_owned();
    let parts: Vec<&str> = text.split(',').map(str::trim).collect();
    let one = |text: &str, max: f64| number(text, 0.0, max, "").map_err(|_| wanted());
    let (place, radius_px) = match parts[..] {
        [x, y, flux] => ([x, y, flux], 0.0),
        [x, y, flux, radius] => ([x, y, flux], one(radius, 1e4)?),
        _ => return Err(wanted()),
    };
    let flux_w_m2 = one(place[2], 1e9)?;
    if flux_w_m2 <= 0.0 {
        return Err(wanted());
    }
    Ok(Gauge {
        x_px: one(place[0], 1e6)?,
        y_px: one(place[1], 1e6)?,
        flux_w_m2,
        radius_px,
    })
}

fn two(text: &str) -> Result<[f64; 2], String> {
    let wanted = || "wanted two numbers of W/m² with a comma between them, such as 1007,185";
    let (global, diffuse) = text.split_once(',').ok_or_else(wanted)?;
    let one = |text: &str| irradiance(text.trim()).map_err(|_| wanted());
    Ok([one(global)?, one(diffuse)?])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn readings_are_read() {
        let read = gauge("120, 80.5,4174").unwrap();
        assert_eq!(
            (read.x_px, read.y_px, read.flux_w_m2, read.radius_px),
            (120.0, 80.5, 4174.0, 0.0)
        );
        assert_eq!(gauge("1,2,3,4").unwrap().radius_px, 4.0);
        for bad in [
            "",
            "1,2",
            "1,2,0",
            "1,2,-3",
            "1,2,3,4,5",
            "a,2,3",
            "1,2,NaN",
        ] {
            assert!(gauge(bad).unwrap_err().contains("X,Y"), "{bad}");
        }
        assert_eq!(two("1007, 185"), Ok([1007.0, 185.0]));
        assert!(two("1007").is_err());
    }
}
