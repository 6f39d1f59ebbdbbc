//! Points and cells as both formats give them, and what they become.

use std::collections::BTreeSet;

use crate::mesh::build::{Builder, Member};
use crate::mesh::error::{ReadError, ReadProblem};
use crate::mesh::text::Source;
use crate::mesh::vectors::Vectors;
use crate::mesh::{Displacements, Mesh, Shape};
use crate::vector::Vector;

/// Points of cells, one cell behind the other, and where each cell ends in that.
#[derive(Debug, Default)]
pub(super) struct Cells {
    pub(super) connectivity: Vec<u64>,
    pub(super) ends: Vec<usize>,
}

/// What a file holds, pieces of an XML file one behind the other.
#[derive(Debug, Default)]
pub(super) struct Grid {
    pub(super) points_m: Vec<Vector>,
    pub(super) cells: Cells,
    /// The type of each cell by its number; 7 (polygon) for those of polygon data.
    pub(super) types: Vec<u64>,
    /// The displacements, as far as pieces had them.
    pub(super) moved_m: Vec<Vector>,
    pub(super) has_moved: bool,
    /// Names of vectors of the points.
    pub(super) vectors: Vec<String>,
    /// Whole numbers of the cells, by name.
    pub(super) labels: Vec<(String, Vec<i64>)>,
}

/// A number of a cell type that is no cell: lines, points and strips of polygon data.
pub(super) const NO_CELL: u64 = u64::MAX;
/// The polygon of any number of corners.
pub(super) const POLYGON: u64 = 7;

/// The most values of an array of which sets are made.
const MOST_VALUES: usize = 1000;

/// Cell types by number (VTK file formats, "Cell types"): shape, points, and the order of its corners if it
/// is not that of Abaqus. A wedge runs the other way round, and pixels and voxels row by row.
fn kind(number: u64, points: usize) -> Option<(Shape, usize, &'static [usize])> {
    use Shape::{Hexahedron, Pyramid, Quadrilateral, Tetrahedron, Triangle, Wedge};
    const STRAIGHT: &[usize] = &[0, 1, 2, 3, 4, 5, 6, 7];
    const TURNED: &[usize] = &[0, 2, 1, 3, 5, 4];
    let (shape, wanted, order): (_, _, &'static [usize]) = match number {
        5 => (Triangle, 3, STRAIGHT),
        POLYGON if points == 3 => (Triangle, 3, STRAIGHT),
        POLYGON if points == 4 => (Quadrilateral, 4, STRAIGHT),
        8 => (Quadrilateral, 4, &[0, 1, 3, 2]),
        9 => (Quadrilateral, 4, STRAIGHT),
        10 => (Tetrahedron, 4, STRAIGHT),
        11 => (Hexahedron, 8, &[0, 1, 3, 2, 4, 5, 7, 6]),
        12 => (Hexahedron, 8, STRAIGHT),
        13 => (Wedge, 6, TURNED),
        14 => (Pyramid, 5, STRAIGHT),
        22 => (Triangle, 6, STRAIGHT),
        23 => (Quadrilateral, 8, STRAIGHT),
        24 => (Tetrahedron, 10, STRAIGHT),
        25 => (Hexahedron, 20, STRAIGHT),
        26 => (Wedge, 15, TURNED),
        27 => (Pyramid, 13, STRAIGHT),
        28 => (Quadrilateral, 9, STRAIGHT),
        29 => (Hexahedron, 27, STRAIGHT),
        30 => (Quadrilateral, 6, STRAIGHT),
        31 => (Wedge, 12, TURNED),
        32 => (Wedge, 18, TURNED),
        33 => (Hexahedron, 24, STRAIGHT),
        34 => (Triangle, 7, STRAIGHT),
        // Lagrange and Bézier cells of any order have their corners first.
        69 | 76 => (Triangle, points.max(3), STRAIGHT),
        70 | 77 => (Quadrilateral, points.max(4), STRAIGHT),
        71 | 78 => (Tetrahedron, points.max(4), STRAIGHT),
        72 | 79 => (Hexahedron, points.max(8), STRAIGHT),
        73 | 80 => (Wedge, points.max(6), TURNED),
        _ => return None,
    };
    Some((shape, wanted, order))
}

impl Grid {
    /// Adds cells of one type behind those there are.
    pub(super) fn append(&mut self, cells: &Cells, number: u64) {
        let base = self.cells.connectivity.len();
        self.cells.connectivity.extend(&cells.connectivity);
        self.cells
            .ends
            .extend(cells.ends.iter().map(|end| base + end));
        self.types.resize(self.cells.ends.len(), number);
    }

    pub(super) fn finish(
        self,
        source: &Source<'_>,
        vectors: Vectors<'_>,
    ) -> Result<Mesh, ReadError> {
        let wrong = |what: String, wanted: String, found: usize| {
            let found = found.to_string();
            let problem = ReadProblem::Wrong {
                what,
                wanted,
                found,
            };
            Err(source.whole(problem))
        };
        vectors.check(source, self.has_moved, &self.vectors)?;
        let mut builder = Builder::default();
        for (id, &at_m) in self.points_m.iter().enumerate() {
            builder.node(source, 0, id as u64, at_m)?;
        }
        if self.types.len() != self.cells.ends.len() {
            let wanted = format!("{}, one per cell", self.cells.ends.len());
            return wrong("number of cell types".to_owned(), wanted, self.types.len());
        }
        let mut start = 0;
        let mut corners = Vec::new();
        for (id, (&end, &number)) in self.cells.ends.iter().zip(&self.types).enumerate() {
            let points = &self.cells.connectivity[start..end];
            start = end;
            let Some((shape, wanted, order)) = kind(number, points.len()) else {
                let name = if number == NO_CELL {
                    "vtk vertex, line or strip".to_owned()
                } else {
                    format!("vtk {number}")
                };
                builder.skip(&name);
                continue;
            };
            if points.len() != wanted {
                let what = format!("points of cell {id} of type {number}");
                return wrong(what, wanted.to_string(), points.len());
            }
            corners.clear();
            corners.extend(order.iter().take(shape.corners()).map(|&k| points[k]));
            corners.extend_from_slice(&points[shape.corners()..]);
            builder.element(source, id as u64, shape, &corners)?;
        }
        for (name, values) in &self.labels {
            if values.len() != self.types.len() {
                let wanted = format!("{}, one per cell", self.types.len());
                return wrong(format!("values of {name}"), wanted, values.len());
            }
            let mut distinct = BTreeSet::new();
            if !values.iter().all(|value| {
                distinct.insert(*value);
                distinct.len() <= MOST_VALUES
            }) {
                continue;
            }
            for (id, value) in values.iter().enumerate() {
                let sets = &mut builder.element_sets;
                let place = sets.place(&format!("{name}={value}"));
                sets.push(source, place, Member::Id(id as u64))?;
            }
        }
        let points = self.points_m.len();
        let mut mesh = builder.finish(source)?;
        let mut names = self.vectors;
        names.retain(|name| !vectors.wants(name));
        mesh.vectors = names;
        if self.has_moved {
            if self.moved_m.len() != points {
                let wanted = format!("{points}, one per point");
                return wrong(
                    "number of displacements".to_owned(),
                    wanted,
                    self.moved_m.len(),
                );
            }
            mesh.displace(&Displacements {
                node_ids: (0..points as u64).collect(),
                displacement_m: self.moved_m,
            });
        }
        Ok(mesh)
    }
}
