//! The mirror of a structure's model, with its load and without.

use std::path::PathBuf;

use helio_flux::Element;
use helio_flux::deform::{
    DeformError, Deformed, PoseFit, SlopeErrors, reconstruct_poses, substitute_elements,
};
use helio_flux::mesh::{Mesh, Mirror, MirrorOptions};
use helio_io::{
    FluxScene, MatchedNodes, MeshFiles, MirrorPart, SceneOf, SceneUnit, displace_mesh, load_mesh,
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
            let scene = scene.read(SceneOf::Mesh)?;
            let sun = scene.sun.toward.unwrap_or([0.0, 0.0, 1.0]);
            let read = Read::of(&asked, given, &scene)?;
            let shape = Shape::of(&read, &asked.method, scene.mirror.axis)?;
            let elements = shape.elements(scene.mirror.reflectivity)?;
            let map = scene.light(&elements, sun, 0, watch)?;
            let map = map.ok_or_else(stopped)?;
            let mut flux = PyFlux::of_mesh(scene, map, read.warnings);
            let unloaded = shape.unloaded;
            flux.add_slopes((read.loaded && !unloaded).then_some(shape), read.mirror);
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
        let mut mesh = match given {
            Some(mesh) => mesh,
            None => asked.load(scene, &mut warnings)?,
        };
        let loaded = mesh.displacement_m().is_some();
        if !loaded {
            if !matches!(asked.method.as_str(), "elements" | "unloaded") {
                let message = format!(
                    "{} wants displacements, and the mesh has none",
                    asked.method
                );
                return Err(Failure::of("OptionError", "method", message));
            }
            // Nothing moves: the mirror as it was drawn.
            mesh.set_displacements_m(vec![[0.0; 3]; mesh.node_ids().len()])?;
        }
        warnings.extend(mesh.faults().to_string().lines().map(str::to_owned));
        let part = match (&asked.surface, &asked.element_set) {
            (Some(name), _) => MirrorPart::Surface(name.clone()),
            (None, Some(name)) => MirrorPart::ElementSet(name.clone()),
            (None, None) => scene.mirror.part.clone(),
        };
        let sun = scene.sun.toward.unwrap_or([0.0, 0.0, 1.0]);
        let mut options = MirrorOptions::toward(sun)?;
        if let Some(crease_rad) = scene.mirror.crease_rad {
            options = options.with_crease_rad(crease_rad)?;
        }
        let mirror = mesh.mirror(&part.pick(), &options)?;
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
    fn load(&self, scene: &FluxScene, warnings: &mut Vec<String>) -> Result<Mesh, Failure> {
        let Some(model) = &self.model else {
            return Err(Failure::of("OptionError", "mesh", "there is none"));
        };
        let unit = match self.unit.as_deref() {
            None => scene.mirror.unit,
            Some("m") => Some(SceneUnit::Metre),
            Some("cm") => Some(SceneUnit::Centimetre),
            Some("mm") => Some(SceneUnit::Millimetre),
            Some("in") => Some(SceneUnit::Inch),
            Some(other) => {
                let message = format!("wanted m, cm, mm or in, got `{other}`");
                return Err(Failure::of("OptionError", "unit", message));
            }
        };
        let metres_per_unit = unit.map(SceneUnit::metres);
        let vectors = self.vectors.as_deref();
        let loaded = load_mesh(&MeshFiles {
            mesh: model,
            elements: self.elements.as_deref(),
            metres_per_unit,
            vectors,
        })?;
        let mut mesh = loaded.mesh;
        if let Some(path) = &self.displacements {
            let matched = displace_mesh(&mut mesh, path, self.step, metres_per_unit, vectors)?;
            of_nodes(&matched, warnings);
        } else if mesh.displacement_m().is_none() && !mesh.other_vectors().is_empty() {
            warnings.push(format!(
                "vectors of the nodes are named {:?}, and none is taken for displacements: vectors= says which is",
                mesh.other_vectors()
            ));
        }
        Ok(mesh)
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

/// The mirror as one method puts it, and what it says of the slopes.
pub(super) struct Shape {
    pub(super) deformed: Deformed,
    pub(super) slopes: SlopeErrors,
    unloaded: bool,
}

impl Shape {
    fn of(read: &Read, method: &str, axis: Option<[f64; 3]>) -> Result<Self, Failure> {
        let poses = |fit| reconstruct_poses(&read.mirror, fit).map(|(deformed, _)| deformed);
        let deformed = match method {
            "elements" | "unloaded" => substitute_elements(&read.mirror)?,
            "pose" => poses(PoseFit::ThreePoints)?,
            "rigid" => poses(PoseFit::LeastSquares)?,
            _ => {
                let message = format!("wanted elements, pose, rigid or unloaded, got `{method}`");
                return Err(Failure::of("OptionError", "method", message));
            }
        };
        let slopes = match (axis, SlopeErrors::new(&deformed, axis.unwrap_or(X))) {
            (None, Err(DeformError::BadAxis { .. })) => SlopeErrors::new(&deformed, Y)?,
            (_, slopes) => slopes?,
        };
        Ok(Self {
            deformed,
            slopes,
            unloaded: method == "unloaded",
        })
    }

    fn elements(&self, reflectivity: f64) -> Result<Vec<Element>, Failure> {
        let of = |element: &Element| element.with_reflectivity(reflectivity);
        let elements: Result<Vec<_>, _> = if self.unloaded {
            self.deformed.ideal().iter().map(of).collect()
        } else {
            self.deformed.loaded().iter().flatten().map(of).collect()
        };
        Ok(elements?)
    }
}

const X: [f64; 3] = [1.0, 0.0, 0.0];
const Y: [f64; 3] = [0.0, 1.0, 0.0];
