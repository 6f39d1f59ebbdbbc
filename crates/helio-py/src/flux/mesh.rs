//! The mirror of a structure's model, with its load and without.

use std::path::PathBuf;

use helio_flux::mesh::{Mesh, Mirror};
use helio_io::{
    DeformMethod, DeformedMirror, FluxScene, MatchedNodes, MirrorPart, SceneOf, SceneUnit,
    Structure, StructureFiles,
};
use pyo3::prelude::*;

use super::field::stopped;
use super::map::PyFlux;
use super::scene::SceneAsked;
use crate::array::{Numbers, wrong_shape};
use crate::failure::Failure;
use crate::guard::guarded;
use crate::watch::watched;

/// What was asked about a mesh in files.
#[derive(FromPyObject)]
#[pyo3(from_item_all)]
pub(crate) struct MeshAsked {
    model: Option<PathBuf>,
    elements: Option<PathBuf>,
    displacements: Option<PathBuf>,
    step: Option<u64>,
    vectors: Option<String>,
    unit: Option<String>,
    surface: Option<String>,
    element_set: Option<String>,
    method: String,
}

/// Points of an array of shape (n, 3).
fn points(value: &Bound<'_, PyAny>, what: &str) -> Result<Vec<[f64; 3]>, Failure> {
    let numbers = Numbers::of(value, what)?;
    let [_, 3] = *numbers.shape() else {
        return Err(wrong_shape(what, "(n, 3)", numbers.shape()));
    };
    let (points, _) = numbers.as_slice()?.as_chunks();
    Ok(points.to_vec())
}

/// A mesh given as arrays: nodes of shape (n, 3), the rows of each element's nodes, displacements of shape (n, 3).
fn mesh_of_arrays(
    nodes: &Bound<'_, PyAny>,
    corners: &[Vec<u64>],
    displacements: Option<&Bound<'_, PyAny>>,
) -> Result<Mesh, Failure> {
    let nodes = points(nodes, "mesh")?;
    let mut mesh = Mesh::of_shells(&nodes, corners.iter().map(Vec::as_slice))?;
    if let Some(value) = displacements {
        let moved = points(value, "displacements")?;
        if moved.len() != nodes.len() {
            let wanted = format!("({}, 3) as mesh has", nodes.len());
            return Err(wrong_shape("displacements", &wanted, &[moved.len(), 3]));
        }
        mesh.set_displacements_m(moved)?;
    }
    Ok(mesh)
}

/// The flux of the mirror of a mesh.
#[pyfunction]
pub(crate) fn _flux_mesh(
    py: Python<'_>,
    asked: MeshAsked,
    nodes: Option<&Bound<'_, PyAny>>,
    corners: Vec<Vec<u64>>,
    displacements: Option<&Bound<'_, PyAny>>,
    scene: SceneAsked,
    progress: Option<Py<PyAny>>,
) -> PyResult<PyFlux> {
    guarded(|| {
        let given = match nodes {
            Some(nodes) => Some(mesh_of_arrays(nodes, &corners, displacements)?),
            None => None,
        };
        watched(py, progress.as_ref(), |watch| {
            let method = method_of(&asked.method)?;
            let scene = scene.read(SceneOf::Mesh)?;
            let sun = scene.sun.toward.unwrap_or([0.0, 0.0, 1.0]);
            let read = Read::of(&asked, given, &scene)?;
            let shape = DeformedMirror::of(&read.mirror, method, scene.mirror.axis)?;
            let elements = shape.elements(scene.mirror.reflectivity)?;
            let map = scene.light(&elements, sun, 0, watch)?;
            let map = map.ok_or_else(stopped)?;
            let mut flux = PyFlux::of_mesh(scene, map, read.warnings);
            let bent = read.loaded && method != DeformMethod::Unloaded;
            flux.add_slopes(bent.then_some((shape, read.mirror)));
            Ok(flux)
        })?
    })
}

/// A model as it was read.
struct Read {
    mirror: Mirror,
    /// Whether there are displacements.
    loaded: bool,
    warnings: Vec<String>,
}

impl Read {
    fn of(asked: &MeshAsked, given: Option<Mesh>, scene: &FluxScene) -> Result<Self, Failure> {
        let mut warnings = Vec::new();
        let mut structure = match given {
            Some(mesh) => Structure::of(mesh, Vec::new()),
            None => asked.load(scene, &mut warnings)?,
        };
        let loaded = structure.loaded;
        if !loaded && !matches!(asked.method.as_str(), "elements" | "unloaded") {
            let message = format!(
                "{} wants displacements, and the mesh has none",
                asked.method
            );
            return Err(Failure::of("OptionError", "method", message));
        }
        warnings.extend(
            structure
                .mesh
                .faults()
                .to_string()
                .lines()
                .map(str::to_owned),
        );
        let part = match (&asked.surface, &asked.element_set) {
            (Some(name), _) => MirrorPart::Surface(name.clone()),
            (None, Some(name)) => MirrorPart::ElementSet(name.clone()),
            (None, None) => scene.mirror.part.clone(),
        };
        let mirror = structure.mirror(&part, scene)?;
        for (fault, what) in [
            (mirror.unusable(), "without a face of their own"),
            (
                mirror.rewound(),
                "wound the other way round than their neighbours, and turned",
            ),
        ] {
            if fault.count() > 0 {
                warnings.push(format!("elements of the mirror {what}: {fault}"));
            }
        }
        if mirror.left_aside().faces() > 0 {
            warnings.push(format!(
                "{} outer faces of solids turned to the sun left aside, {:.3} times the area that counts",
                mirror.left_aside().faces(),
                mirror.left_aside().part()
            ));
        }
        Ok(Self {
            mirror,
            loaded,
            warnings,
        })
    }
}

impl MeshAsked {
    fn load(&self, scene: &FluxScene, warnings: &mut Vec<String>) -> Result<Structure, Failure> {
        let Some(model) = &self.model else {
            return Err(Failure::of("OptionError", "mesh", "there is none"));
        };
        let unit = match self.unit.as_deref() {
            None => None,
            Some("m") => Some(SceneUnit::Metre),
            Some("cm") => Some(SceneUnit::Centimetre),
            Some("mm") => Some(SceneUnit::Millimetre),
            Some("in") => Some(SceneUnit::Inch),
            Some(other) => {
                let message = format!("wanted m, cm, mm or in, got `{other}`");
                return Err(Failure::of("OptionError", "unit", message));
            }
        };
        let structure = Structure::load(
            &StructureFiles {
                mesh: model,
                elements: self.elements.as_deref(),
                displacements: self.displacements.as_deref(),
                step: self.step,
                vectors: self.vectors.as_deref(),
                unit,
            },
            scene,
        )?;
        of_nodes(&structure.matched, warnings);
        let others = structure.mesh.other_vectors();
        if !structure.loaded && others.is_empty() && self.method != "unloaded" {
            warnings.push(format!(
                "{} holds no displacements: the mirror is as it was drawn",
                model.display()
            ));
        }
        if !structure.loaded && !others.is_empty() {
            warnings.push(format!(
                "vectors of the nodes are named {others:?}, and none is taken for displacements: vectors= says which is"
            ));
        }
        Ok(structure)
    }
}

fn of_nodes(matched: &MatchedNodes, warnings: &mut Vec<String>) {
    for (nodes, what) in [
        (&matched.without, "of the mesh without a displacement"),
        (
            &matched.unknown,
            "with a displacement that the mesh does not have",
        ),
    ] {
        if let Some(first) = nodes.first() {
            warnings.push(format!("{} nodes {what}, first {first}", nodes.len()));
        }
    }
}

/// The method of a word.
pub(super) fn method_of(word: &str) -> Result<DeformMethod, Failure> {
    DeformMethod::from_word(word).ok_or_else(|| {
        let message = format!("wanted elements, pose, rigid or unloaded, got `{word}`");
        Failure::of("OptionError", "method", message)
    })
}
