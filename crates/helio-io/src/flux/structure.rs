//! The mirror of a structure's model: read, chosen, and as its load puts it.

use std::path::{Path, PathBuf};

use helio_flux::deform::{
    DeformError, Deformed, FacetPose, PoseFit, SlopeErrors, reconstruct_poses, substitute_elements,
};
use helio_flux::mesh::{Mesh, MeshError, Mirror, MirrorOptions};
use helio_flux::{Element, FluxError};

use crate::{
    FluxScene, IoError, MatchedNodes, MeshFiles, MirrorPart, SceneUnit, displace_mesh, load_mesh,
};

/// Where the sun of a scene that does not say it stands.
const OVERHEAD: [f64; 3] = [0.0, 0.0, 1.0];

/// Where a structure's model stands, and what the solver said of it.
#[derive(Debug, Clone, Copy)]
pub struct StructureFiles<'a> {
    /// The model.
    pub mesh: &'a Path,
    /// With a table of nodes: the table of elements.
    pub elements: Option<&'a Path>,
    /// Displacements of its nodes, where they do not stand in the model's own file.
    pub displacements: Option<&'a Path>,
    /// Step of an `.frd`.
    pub step: Option<u64>,
    /// Name of the vectors that are displacements.
    pub vectors: Option<&'a str>,
    /// Unit of its lengths instead of the scene's.
    pub unit: Option<SceneUnit>,
}

/// A structure's model as its files have it.
#[derive(Debug, Clone)]
#[non_exhaustive]
pub struct Structure {
    /// The model; nodes of one without a load move by nothing.
    pub mesh: Mesh,
    /// Whether there are displacements.
    pub loaded: bool,
    /// What displacements of another file and the model do not have in common.
    pub matched: MatchedNodes,
    /// Every file read, the model's first.
    pub files: Vec<PathBuf>,
}

impl Structure {
    /// Reads the model and its displacements; `scene` says the unit where the files do not.
    ///
    /// # Errors
    /// As [`load_mesh`] and [`displace_mesh`].
    pub fn load(files: &StructureFiles<'_>, scene: &FluxScene) -> Result<Self, IoError> {
        let unit = files.unit.or(scene.mirror.unit);
        let metres_per_unit = unit.map(SceneUnit::metres);
        let read = load_mesh(&MeshFiles {
            mesh: files.mesh,
            elements: files.elements,
            metres_per_unit,
            vectors: files.vectors,
        })?;
        let mut structure = Self::of(read.mesh, read.files);
        if let Some(path) = files.displacements {
            structure.files.push(path.to_owned());
            let mesh = &mut structure.mesh;
            structure.matched =
                displace_mesh(mesh, path, files.step, metres_per_unit, files.vectors)?;
            structure.loaded = true;
        }
        Ok(structure)
    }

    /// A model that was read already.
    #[must_use]
    pub fn of(mesh: Mesh, files: Vec<PathBuf>) -> Self {
        Self {
            loaded: mesh.displacement_m().is_some(),
            mesh,
            matched: MatchedNodes::default(),
            files,
        }
    }

    /// The faces of a part that reflect, turned to the scene's sun; without a load they move by nothing.
    ///
    /// # Errors
    /// As [`Mesh::mirror`], and for a direction of the sun or a crease that is none.
    pub fn mirror(&mut self, part: &MirrorPart, scene: &FluxScene) -> Result<Mirror, MeshError> {
        if !self.loaded {
            let nodes = self.mesh.node_ids().len();
            self.mesh.set_displacements_m(vec![[0.0; 3]; nodes])?;
        }
        let mut options = MirrorOptions::toward(scene.sun.toward.unwrap_or(OVERHEAD))?;
        if let Some(crease_rad) = scene.mirror.crease_rad {
            options = options.with_crease_rad(crease_rad)?;
        }
        self.mesh.mirror(&part.pick(), &options)
    }
}

/// Which deformed mirror is lit.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum DeformMethod {
    /// Every face where its nodes go: planar element substitution.
    Elements,
    /// Every facet as three of its points move: mirror pose reconstruction.
    Pose,
    /// Every facet as all of its nodes move, by least squares.
    Rigid,
    /// The mirror without its load.
    Unloaded,
}

impl DeformMethod {
    /// Every method.
    pub const ALL: [Self; 4] = [Self::Elements, Self::Pose, Self::Rigid, Self::Unloaded];

    /// The word for it on the command line.
    #[must_use]
    pub const fn as_str(self) -> &'static str {
        match self {
            Self::Elements => "elements",
            Self::Pose => "pose",
            Self::Rigid => "rigid",
            Self::Unloaded => "unloaded",
        }
    }

    /// The method of a word, if it is one.
    #[must_use]
    pub fn from_word(word: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|method| method.as_str() == word)
    }
}

/// A mirror as one method puts it, and what it says of the slopes.
#[derive(Debug, Clone)]
#[non_exhaustive]
pub struct DeformedMirror {
    /// The method.
    pub method: DeformMethod,
    /// Along which axis slope errors are told first.
    pub axis: [f64; 3],
    /// Faces without the load and with it.
    pub deformed: Deformed,
    /// How far their normals turn.
    pub slopes: SlopeErrors,
    /// Of a method of facets: how each moved.
    pub poses: Vec<FacetPose>,
}

impl DeformedMirror {
    /// A mirror with displacements by a method; the axis of slope errors is x where none is stated, or y where the
    /// mirror faces along x.
    ///
    /// # Errors
    /// [`DeformError`] of [`substitute_elements`], [`reconstruct_poses`] and [`SlopeErrors::new`].
    ///
    /// ```
    /// use helio_flux::mesh::Mirror;
    /// use helio_io::{DeformMethod, DeformedMirror};
    /// let places_m = vec![[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];
    /// let moved_m = vec![[0.0; 3], [0.0, 0.0, 0.01], [0.0; 3]];
    /// let face = (1, 0, [0, 1, 2].as_slice());
    /// let mirror = Mirror::of_faces(vec![1, 2, 3], places_m, Some(moved_m), [face])?;
    /// let found = DeformedMirror::of(&mirror, DeformMethod::Elements, None)?;
    /// assert!((found.slopes.rms_rad() - 0.01_f64.atan()).abs() < 1e-15);
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn of(
        mirror: &Mirror,
        method: DeformMethod,
        axis: Option<[f64; 3]>,
    ) -> Result<Self, DeformError> {
        const X: [f64; 3] = [1.0, 0.0, 0.0];
        const Y: [f64; 3] = [0.0, 1.0, 0.0];
        let (deformed, poses) = match method {
            DeformMethod::Elements | DeformMethod::Unloaded => {
                (substitute_elements(mirror)?, Vec::new())
            }
            DeformMethod::Pose => reconstruct_poses(mirror, PoseFit::ThreePoints)?,
            DeformMethod::Rigid => reconstruct_poses(mirror, PoseFit::LeastSquares)?,
        };
        let (axis, slopes) = match (axis, SlopeErrors::new(&deformed, axis.unwrap_or(X))) {
            (None, Err(DeformError::BadAxis { .. })) => (Y, SlopeErrors::new(&deformed, Y)?),
            (axis, slopes) => (axis.unwrap_or(X), slopes?),
        };
        Ok(Self {
            method,
            axis,
            deformed,
            slopes,
            poses,
        })
    }

    /// The pieces to be lit: with the load but where the method says otherwise.
    ///
    /// # Errors
    /// [`FluxError::BadValue`] for a reflectivity outside 0..=1.
    pub fn elements(&self, reflectivity: f64) -> Result<Vec<Element>, FluxError> {
        if self.method == DeformMethod::Unloaded {
            return self.ideal_elements(reflectivity);
        }
        let loaded = self.deformed.loaded().iter().flatten();
        loaded.map(|e| e.with_reflectivity(reflectivity)).collect()
    }

    /// The pieces without the load.
    ///
    /// # Errors
    /// As [`elements`](Self::elements).
    pub fn ideal_elements(&self, reflectivity: f64) -> Result<Vec<Element>, FluxError> {
        let ideal = self.deformed.ideal().iter();
        ideal.map(|e| e.with_reflectivity(reflectivity)).collect()
    }
}
