//! Meshes of mirrors and their displacements, from the files that solvers of structures write.
//!
//! | file | module | what is read |
//! |---|---|---|
//! | CalculiX or Abaqus `.inp` | [`inp`] | nodes, shells and solids, node and element sets, surfaces, `*INCLUDE` |
//! | CalculiX `.frd` | [`frd`] | nodes, elements, displacements of a step |
//! | Gmsh `.msh` | [`gmsh`] | nodes, elements, physical groups, displacements |
//! | VTK `.vtk`, `.vtu`, `.vtp` | [`vtk`] | nodes, elements, labels of elements, displacements |
//! | tables in CSV | [`csv`] | nodes, elements, displacements |
//!
//! A reader takes bytes and the name to call them by, and touches no file itself. It gives a [`Mesh`]:
//! nodes and elements by the numbers of the file, points in metres in the right-handed frame of the file.
//! Of quadratic elements the corners are kept. [`Mesh::mirror`] takes the reflecting faces out of it, turned
//! toward the sun; [`deform`](crate::deform) then asks how the load bent them.
//!
//! A file that breaks its format is refused with file, line, what was found and what was wanted
//! ([`ReadError`]). An element that is wrong by itself (a node is missing, no area, inverted, there twice)
//! keeps its place with a status, and [`Mesh::faults`] names and counts them.
//!
//! ```
//! use helio_flux::mesh::{MirrorOptions, Pick, ReadOptions, frd, inp};
//!
//! // A square of 2 m, and what the solver says of its corners.
//! let model = b"*NODE\n1,0,0,0\n2,2,0,0\n3,2,2,0\n4,0,2,0\n*ELEMENT,TYPE=S4,ELSET=GLASS\n1,1,2,3,4\n";
//! let mut mesh = inp::mesh("model.inp", model, &ReadOptions::default())?;
//! mesh.set_displacements_m(vec![[0.0, 0.0, 0.0], [0.0, 0.0, 0.02], [0.0, 0.0, 0.02], [0.0; 3]])?;
//! let sun = [0.0, 0.0, 1.0];
//! let mirror = mesh.mirror(&Pick::ElementSet("glass"), &MirrorOptions::toward(sun)?)?;
//! assert_eq!(mirror.faces().len(), 1);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

use std::collections::{BTreeMap, HashMap};

use crate::vector::Vector;

mod arrays;
mod build;
pub mod csv;
pub mod error;
mod faults;
pub mod frd;
pub mod gmsh;
pub mod inp;
mod mirror;
mod options;
mod scan;
mod shape;
mod text;
mod vectors;
pub mod vtk;

pub use error::{MeshError, ReadError, ReadProblem};
pub use faults::{ElementStatus, Fault, Faults};
pub use mirror::{LeftAside, Mirror, MirrorFace, MirrorOptions, Pick};
pub use options::{Limits, ReadOptions};
pub use shape::Shape;
pub use vectors::Vectors;

/// A mesh: nodes, elements, sets and surfaces, and the displacements of the nodes if they are known.
///
/// Nodes and elements are in the order of the file. Sets and surfaces go by name, whatever its case.
#[derive(Debug, Clone, PartialEq)]
pub struct Mesh {
    node_ids: Vec<u64>,
    position_m: Vec<Vector>,
    displacement_m: Option<Vec<Vector>>,
    node_index: HashMap<u64, u32>,
    elements: Vec<MeshElement>,
    status: Vec<ElementStatus>,
    node_sets: BTreeMap<String, Named<u32>>,
    element_sets: BTreeMap<String, Named<u32>>,
    surfaces: BTreeMap<String, Named<Face>>,
    faults: Faults,
    vectors: Vec<String>,
}

/// An element by its corners.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
struct MeshElement {
    id: u64,
    shape: Shape,
    corners: [u32; 8],
}

/// Rows under the name that the file gives them.
#[derive(Debug, Clone, PartialEq, Eq)]
struct Named<T> {
    name: String,
    rows: Vec<T>,
}

/// A face of an element.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
struct Face {
    /// Row of the element.
    element: u32,
    /// Which of its faces, from 0.
    face: u8,
}

impl Mesh {
    /// Numbers of the nodes, in the order of the file.
    #[must_use]
    pub fn node_ids(&self) -> &[u64] {
        &self.node_ids
    }

    /// Where the nodes are without load \[m\].
    #[must_use]
    pub fn position_m(&self) -> &[[f64; 3]] {
        &self.position_m
    }

    /// Displacements of the nodes \[m\], if they are known; NaN for a node without one.
    #[must_use]
    pub fn displacement_m(&self) -> Option<&[[f64; 3]]> {
        self.displacement_m.as_deref()
    }

    /// How many elements there are.
    #[must_use]
    pub fn len(&self) -> usize {
        self.elements.len()
    }

    /// Whether there is no element.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.elements.is_empty()
    }

    /// Number, shape, numbers of the corner nodes and status of each element. A corner whose node is not
    /// in the mesh is `None`.
    pub fn elements(&self) -> impl Iterator<Item = (u64, Shape, Vec<Option<u64>>, ElementStatus)> {
        let rows = self.elements.iter().zip(&self.status);
        rows.map(|(element, &status)| {
            let corners = &element.corners[..element.shape.corners()];
            let corner = |&row: &u32| self.node_ids.get(row as usize).copied();
            let corners = corners.iter().map(corner).collect();
            (element.id, element.shape, corners, status)
        })
    }

    /// Names of the vectors of the nodes in its file that were not read as displacements, the first hundred,
    /// from formats that name them (Gmsh, VTK).
    #[must_use]
    pub fn other_vectors(&self) -> &[String] {
        &self.vectors
    }

    /// What was found wrong with single elements.
    #[must_use]
    pub const fn faults(&self) -> &Faults {
        &self.faults
    }

    /// Names of the node sets.
    pub fn node_sets(&self) -> impl Iterator<Item = &str> {
        self.node_sets.values().map(|set| set.name.as_str())
    }

    /// Names of the element sets.
    pub fn element_sets(&self) -> impl Iterator<Item = &str> {
        self.element_sets.values().map(|set| set.name.as_str())
    }

    /// Names of the surfaces.
    pub fn surfaces(&self) -> impl Iterator<Item = &str> {
        self.surfaces.values().map(|set| set.name.as_str())
    }

    /// Numbers of the nodes of a set, in the order of the mesh's nodes.
    ///
    /// # Errors
    /// [`MeshError::UnknownName`].
    pub fn node_set(&self, name: &str) -> Result<Vec<u64>, MeshError> {
        let rows = find(&self.node_sets, "node set", name)?;
        Ok(rows
            .iter()
            .map(|&row| self.node_ids[row as usize])
            .collect())
    }

    /// Numbers of the elements of a set, in the order of the mesh's elements.
    ///
    /// # Errors
    /// [`MeshError::UnknownName`].
    pub fn element_set(&self, name: &str) -> Result<Vec<u64>, MeshError> {
        let rows = find(&self.element_sets, "element set", name)?;
        Ok(rows
            .iter()
            .map(|&row| self.elements[row as usize].id)
            .collect())
    }

    /// Gives every node its displacement \[m\], in the order of the nodes.
    ///
    /// # Errors
    /// [`MeshError::WrongLength`].
    pub fn set_displacements_m(&mut self, displacement_m: Vec<[f64; 3]>) -> Result<(), MeshError> {
        if displacement_m.len() != self.node_ids.len() {
            return Err(MeshError::WrongLength {
                what: "displacement_m",
                expected: self.node_ids.len(),
                found: displacement_m.len(),
            });
        }
        self.displacement_m = Some(displacement_m);
        Ok(())
    }

    /// Gives nodes the displacements that a solver wrote, by their numbers, and says which nodes were left
    /// without one and which numbers the mesh does not have.
    ///
    /// ```
    /// use helio_flux::mesh::{ReadOptions, csv};
    /// let options = ReadOptions::default();
    /// let nodes = csv::nodes("n.csv", b"node,x_m,y_m,z_m\n1,0,0,0\n2,1,0,0\n3,0,1,0\n", &options)?;
    /// let mut mesh = nodes.elements("e.csv", b"element,node1,node2,node3\n1,1,2,3\n")?;
    /// let moved = csv::displacements("u.csv", b"node,ux_m,uy_m,uz_m\n1,0,0,0\n2,0,0,0.1\n9,0,0,0\n", &options)?;
    /// let matched = mesh.displace(&moved);
    /// assert_eq!(matched.without, [3]);
    /// assert_eq!(matched.unknown, [9]);
    /// # Ok::<(), helio_flux::mesh::ReadError>(())
    /// ```
    pub fn displace(&mut self, moved: &Displacements) -> Matched {
        let mut displacement_m = vec![[f64::NAN; 3]; self.node_ids.len()];
        let mut matched = Matched::default();
        for (id, &by_m) in moved.node_ids.iter().zip(&moved.displacement_m) {
            match self.node_index.get(id) {
                Some(&row) => displacement_m[row as usize] = by_m,
                None => matched.unknown.push(*id),
            }
        }
        let each = self.node_ids.iter().zip(&displacement_m);
        matched.without = each
            .filter(|(_, by)| by[0].is_nan())
            .map(|(id, _)| *id)
            .collect();
        self.displacement_m = Some(displacement_m);
        matched
    }
}

/// Displacements of nodes by their numbers, as a solver wrote them.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Displacements {
    node_ids: Vec<u64>,
    displacement_m: Vec<Vector>,
}

impl Displacements {
    /// Numbers of the nodes, in the order of the file; each once.
    #[must_use]
    pub fn node_ids(&self) -> &[u64] {
        &self.node_ids
    }

    /// How far each node moved \[m\], along the axes of the file.
    #[must_use]
    pub fn displacement_m(&self) -> &[[f64; 3]] {
        &self.displacement_m
    }
}

/// What [`Mesh::displace`] could not match.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
#[non_exhaustive]
pub struct Matched {
    /// Nodes of the mesh without a displacement.
    pub without: Vec<u64>,
    /// Nodes with a displacement that the mesh does not have.
    pub unknown: Vec<u64>,
}

fn find<'a, T>(
    sets: &'a BTreeMap<String, Named<T>>,
    kind: &'static str,
    name: &str,
) -> Result<&'a [T], MeshError> {
    match sets.get(&name.to_uppercase()) {
        Some(set) => Ok(&set.rows),
        None => Err(MeshError::UnknownName {
            kind,
            name: name.to_owned(),
            known: sets.values().map(|set| set.name.clone()).collect(),
        }),
    }
}
