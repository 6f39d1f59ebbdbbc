//! Every key of `scene.toml`.

use crate::keys::{Key, Kind, optional, required};

/// No scene reaches farther \[m\].
pub(crate) const FAR_M: f64 = 1e6;
const LENGTH: Kind = Kind::Number(1e-6, 1e6);
/// Of a heliostat, as `helio_flux::HeliostatMirror` has it.
const MIRROR_SIDE: Kind = Kind::Number(1e-6, 1000.0);
const COUNT: Kind = Kind::Number(1.0, 1000.0);
const BINS: Kind = Kind::Number(1.0, 1_048_576.0);

// [sun]

pub(crate) static TOWARD: Key = optional(
    "toward",
    Kind::Vector,
    "Direction to the sun in the frame of the model, of any length; of a mesh only. Default: [0, 0, 1].",
);
pub(crate) static SHAPE: Key = optional(
    "shape",
    Kind::Word(&["pillbox", "limb-darkened", "gaussian", "buie"]),
    "How its light is spread: an even disc, one that darkens toward its limb, a Gaussian cone, or a disc with an aureole. Default: pillbox.",
);
pub(crate) static HALF_ANGLE: Key = optional(
    "half_angle_mrad",
    Kind::Number(1e-6, 100.0),
    "Half angle of the disc of a pillbox or limb-darkened sun. Default: 4.65.",
);
pub(crate) static SIGMA: Key = optional(
    "sigma_mrad",
    Kind::Number(1e-6, 100.0),
    "Of a Gaussian sun: one standard deviation per axis.",
);
pub(crate) static CIRCUMSOLAR: Key = optional(
    "circumsolar_ratio",
    Kind::Number(0.01, 0.7),
    "Of a sun after Buie, Monger and Dey 2003: the aureole's share of its light.",
);
pub(crate) static DNI: Key = optional(
    "dni_w_m2",
    Kind::Number(0.0, 1e6),
    "Direct normal irradiance. Default: 1000.",
);
static SUN_KEYS: &[&Key] = &[&TOWARD, &SHAPE, &HALF_ANGLE, &SIGMA, &CIRCUMSOLAR, &DNI];
pub(crate) static SUN: Key = optional("sun", Kind::Table(SUN_KEYS), "The sun's light.");

// [mirror]

pub(crate) static REFLECTIVITY: Key = optional(
    "reflectivity",
    Kind::Number(0.0, 1.0),
    "The part of the light that mirrors reflect. Default: 1.",
);
pub(crate) static SLOPE: Key = optional(
    "slope_error_mrad",
    Kind::Number(0.0, 50.0),
    "Errors of the surface that turn its normals, root mean square per axis, besides those of the mesh. Default: 0.",
);
pub(crate) static SPECULARITY: Key = optional(
    "specularity_mrad",
    Kind::Number(0.0, 50.0),
    "Scatter of the reflected rays, root mean square per axis. Default: 0.",
);
pub(crate) static ELEMENT_SET: Key = optional(
    "element_set",
    Kind::Text,
    "The mesh's set of elements that is the mirror. Default, without surface and node_set too: all that reflects.",
);
pub(crate) static SURFACE: Key = optional(
    "surface",
    Kind::Text,
    "The mesh's surface that is the mirror.",
);
pub(crate) static NODE_SET: Key = optional(
    "node_set",
    Kind::Text,
    "The mesh's set of nodes whose faces are the mirror.",
);
pub(crate) static UNIT: Key = optional(
    "unit",
    Kind::Word(&["m", "cm", "mm", "in"]),
    "Unit of length of the files of the mesh and its displacements. Files of solvers carry none: required for all but tables in CSV whose columns end in _m or _mm.",
);
pub(crate) static CREASE: Key = optional(
    "crease_deg",
    Kind::Number(0.1, 89.9),
    "Neighbouring faces of a mesh whose normals differ by more are of two facets. Default: 40.",
);
pub(crate) static AXIS: Key = optional(
    "axis",
    Kind::Vector,
    "Along it, laid into each face, the first of the two components of a slope error is told. Default: [1, 0, 0], or [0, 1, 0] where that is along a normal.",
);
pub(crate) static WIDTH: Key = optional(
    "width_m",
    MIRROR_SIDE,
    "Of a heliostat's mirror: its width over all facets, along the moving axis.",
);
pub(crate) static HEIGHT: Key = optional("height_m", MIRROR_SIDE, "Likewise its height.");
pub(crate) static FACET_COLUMNS: Key = optional(
    "columns",
    COUNT,
    "Facets of a heliostat side by side along the width. Default: 1.",
);
pub(crate) static FACET_ROWS: Key =
    optional("rows", COUNT, "Likewise along the height. Default: 1.");
pub(crate) static GAP: Key = optional(
    "gap_m",
    Kind::Number(0.0, 1e3),
    "Free space between a heliostat's facets. Default: 0.",
);
pub(crate) static CANTING: Key = optional(
    "canting",
    Kind::Word(&["flat", "to-aim", "focal-length"]),
    "How a heliostat's facets are tilted toward its middle: not at all, to the distance of its own aim, or to focal_length_m. Default: flat.",
);
pub(crate) static FOCAL: Key = optional(
    "focal_length_m",
    Kind::Number(0.1, 1e6),
    "Focal length of the paraboloid that facets touch, with canting = \"focal-length\".",
);
pub(crate) static PIECES: Key = optional(
    "pieces",
    COUNT,
    "Flat pieces along each side of a facet: 1 for flat facets, more for facets that are curved like the canting's paraboloid. Default: 1.",
);
/// Keys of a mesh only.
pub(crate) static OF_MESH: [&Key; 6] = [&ELEMENT_SET, &SURFACE, &NODE_SET, &UNIT, &CREASE, &AXIS];
/// Keys of a field's heliostats only.
pub(crate) static OF_FIELD: [&Key; 8] = [
    &WIDTH,
    &HEIGHT,
    &FACET_COLUMNS,
    &FACET_ROWS,
    &GAP,
    &CANTING,
    &FOCAL,
    &PIECES,
];
static MIRROR_KEYS: &[&Key] = &[
    &REFLECTIVITY,
    &SLOPE,
    &SPECULARITY,
    &ELEMENT_SET,
    &SURFACE,
    &NODE_SET,
    &UNIT,
    &CREASE,
    &AXIS,
    &WIDTH,
    &HEIGHT,
    &FACET_COLUMNS,
    &FACET_ROWS,
    &GAP,
    &CANTING,
    &FOCAL,
    &PIECES,
];
pub(crate) static MIRROR: Key = optional(
    "mirror",
    Kind::Table(MIRROR_KEYS),
    "The mirrors: their optics; of a mesh, which part reflects; of a field, how heliostats are built.",
);

// [receiver]

pub(crate) static RECEIVER_SHAPE: Key = required(
    "shape",
    Kind::Word(&["plane", "cylinder", "cone", "mesh", "target"]),
    "A rectangle; the outside of an upright cylinder or cone; triangles of a file; or a plane target of the field.",
);
pub(crate) static CENTRE: Key = optional("centre_m", Kind::Vector, "Middle of a plane.");
pub(crate) static FACING: Key = optional(
    "facing",
    Kind::Vector,
    "Direction out of the lit side of a plane, or roughly so of a mesh.",
);
pub(crate) static RIGHT: Key = optional(
    "right",
    Kind::Vector,
    "Along a plane's rows, to the right as a camera facing it sees them. Default: level, or x where the plane is level.",
);
pub(crate) static RECEIVER_WIDTH: Key = optional("width_m", LENGTH, "Width of a plane.");
pub(crate) static RECEIVER_HEIGHT: Key = optional(
    "height_m",
    LENGTH,
    "Height of a plane, or of a cylinder or cone along its axis.",
);
pub(crate) static BASE: Key = optional(
    "base_m",
    Kind::Vector,
    "Of a cylinder or cone: the middle of the end it stands on.",
);
pub(crate) static RECEIVER_AXIS: Key = optional(
    "axis",
    Kind::Vector,
    "Of a cylinder or cone: from its base to its other end. Default: [0, 0, 1].",
);
pub(crate) static ZERO: Key = optional(
    "zero",
    Kind::Vector,
    "Of a cylinder or cone: where the first column begins, seen from the axis. Default: [0, 1, 0], or [1, 0, 0] where that is the axis.",
);
pub(crate) static RADIUS: Key = optional("radius_m", LENGTH, "Of a cylinder.");
const RADIUS_OF_END: Kind = Kind::Number(0.0, 1e6);
pub(crate) static BASE_RADIUS: Key = optional(
    "base_radius_m",
    RADIUS_OF_END,
    "Of a cone: radius at its base.",
);
pub(crate) static END_RADIUS: Key = optional(
    "end_radius_m",
    RADIUS_OF_END,
    "Of a cone: radius at its other end.",
);
pub(crate) static ROWS: Key = optional("rows", BINS, "Rows of bins. Default: 50.");
pub(crate) static COLUMNS: Key = optional("columns", BINS, "Columns of bins. Default: 50.");
pub(crate) static FILE: Key = optional(
    "file",
    Kind::Text,
    "Of a mesh: its file, relative to this one; .inp, .frd, .msh, .vtk, .vtu or .vtp.",
);
pub(crate) static TARGET: Key = optional(
    "target",
    Kind::Text,
    "With shape = \"target\": the name of a target of the field that is a plane.",
);
/// Which keys go with which shape.
pub(crate) static OF_SHAPE: [(&str, &[&Key]); 5] = [
    (
        "plane",
        &[
            &CENTRE,
            &FACING,
            &RIGHT,
            &RECEIVER_WIDTH,
            &RECEIVER_HEIGHT,
            &ROWS,
            &COLUMNS,
        ],
    ),
    (
        "cylinder",
        &[
            &BASE,
            &RECEIVER_AXIS,
            &ZERO,
            &RADIUS,
            &RECEIVER_HEIGHT,
            &ROWS,
            &COLUMNS,
        ],
    ),
    (
        "cone",
        &[
            &BASE,
            &RECEIVER_AXIS,
            &ZERO,
            &BASE_RADIUS,
            &END_RADIUS,
            &RECEIVER_HEIGHT,
            &ROWS,
            &COLUMNS,
        ],
    ),
    (
        "mesh",
        &[&FILE, &FACING, &ELEMENT_SET, &SURFACE, &NODE_SET, &UNIT],
    ),
    ("target", &[&TARGET, &ROWS, &COLUMNS]),
];
static RECEIVER_KEYS: &[&Key] = &[
    &RECEIVER_SHAPE,
    &CENTRE,
    &FACING,
    &RIGHT,
    &RECEIVER_WIDTH,
    &RECEIVER_HEIGHT,
    &BASE,
    &RECEIVER_AXIS,
    &ZERO,
    &RADIUS,
    &BASE_RADIUS,
    &END_RADIUS,
    &ROWS,
    &COLUMNS,
    &FILE,
    &ELEMENT_SET,
    &SURFACE,
    &NODE_SET,
    &UNIT,
    &TARGET,
];
pub(crate) static RECEIVER: Key = required(
    "receiver",
    Kind::Table(RECEIVER_KEYS),
    "What the mirrors light, and its grid of bins.",
);

// [rays]

pub(crate) static METHOD: Key = optional(
    "method",
    Kind::Word(&["trace", "convolve", "auto"]),
    "Rays with shading and blocking, integrals over the mirrors' outlines without, or whichever is sooner at an error. Default: trace.",
);
pub(crate) static ERROR: Key = optional(
    "error",
    Kind::Number(5e-4, 0.5),
    "Of auto: the standard error that the greatest irradiance may have, as part of it. Default: 0.01.",
);
pub(crate) static RAY_COUNT: Key = optional(
    "count",
    Kind::Number(1.0, 1e12),
    "Rays to trace in all. Default: 4000000.",
);
pub(crate) static SEED: Key = optional(
    "seed",
    Kind::Number(0.0, 9_007_199_254_740_991.0),
    "Which of many equally good sets of rays. Default: 0.",
);
pub(crate) static POINTS: Key = optional(
    "points",
    Kind::Number(1.0, 64.0),
    "Of convolve: points along each side of a bin. Default: 2.",
);
static RAYS_KEYS: &[&Key] = &[&METHOD, &ERROR, &RAY_COUNT, &SEED, &POINTS];
pub(crate) static RAYS: Key = optional("rays", Kind::Table(RAYS_KEYS), "How the flux is found.");

pub(crate) static SCENE_FILE: &[&Key] = &[&SUN, &MIRROR, &RECEIVER, &RAYS];

#[cfg(test)]
mod tests {
    use super::*;
    use crate::keys::names;

    #[test]
    fn lists_hold_every_key_once() {
        for list in [SUN_KEYS, MIRROR_KEYS, RECEIVER_KEYS, RAYS_KEYS, SCENE_FILE] {
            let mut seen: Vec<&str> = names(list).collect();
            seen.sort_unstable();
            seen.dedup();
            assert_eq!(seen.len(), list.len());
        }
        for (_, keys) in OF_SHAPE {
            for key in keys {
                assert!(names(RECEIVER_KEYS).any(|name| name == key.name));
            }
        }
    }
}
