//! Meshes from arrays, as programs hold them.

use super::build::Builder;
use super::error::{ReadError, ReadProblem};
use super::text::{MOST_M, Source};
use super::{Mesh, ReadOptions, Shape};

/// What messages call the arrays.
const ARRAYS: &str = "arrays";

impl Mesh {
    /// A mesh of shells of three or four corners. Nodes and elements have the numbers of their rows, from 0.
    ///
    /// `position_m` are the nodes \[m\], `corners` the rows of each element's nodes, in order round it.
    ///
    /// ```
    /// use helio_flux::mesh::{Mesh, MirrorOptions, Pick};
    /// let nodes = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0], [0.0, 1.0, 0.0]];
    /// let mesh = Mesh::of_shells(&nodes, [&[0, 1, 2, 3][..]])?;
    /// let mirror = mesh.mirror(&Pick::All, &MirrorOptions::toward([0.0, 0.0, 1.0])?)?;
    /// assert_eq!(mirror.faces().len(), 1);
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    ///
    /// # Errors
    /// [`ReadError`] for no node at all, a place that is not finite or beyond 1e12 m, and an element that has not
    /// three or four corners. An element of nodes that are not there keeps its place with a status.
    pub fn of_shells<'a>(
        position_m: &[[f64; 3]],
        corners: impl IntoIterator<Item = &'a [u64]>,
    ) -> Result<Self, ReadError> {
        let options = ReadOptions::default();
        let source = Source {
            file: ARRAYS,
            options: &options,
        };
        let wrong = |what: String, wanted: &str, found: String| {
            source.whole(ReadProblem::Wrong {
                what,
                wanted: wanted.to_owned(),
                found,
            })
        };
        let mut builder = Builder::default();
        for (row, &at_m) in position_m.iter().enumerate() {
            if let Some(bad) = at_m.iter().find(|m| m.is_nan() || m.abs() > MOST_M) {
                let what = format!("node {row} (counted from 0)");
                return Err(wrong(what, "within 1e12 m", bad.to_string()));
            }
            builder.node(&source, 0, row as u64, at_m)?;
        }
        for (row, corners) in corners.into_iter().enumerate() {
            let shape = match corners.len() {
                3 => Shape::Triangle,
                4 => Shape::Quadrilateral,
                found => {
                    let what = format!("corners of element {row} (counted from 0)");
                    return Err(wrong(what, "3 or 4", found.to_string()));
                }
            };
            builder.element(&source, row as u64, shape, corners)?;
        }
        builder.finish(&source)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::ElementStatus;

    const NODES: [[f64; 3]; 4] = [
        [0.0, 0.0, 0.0],
        [1.0, 0.0, 0.0],
        [1.0, 1.0, 0.0],
        [0.0, 1.0, 0.0],
    ];

    #[test]
    fn what_is_wrong_by_itself_keeps_its_place() {
        let corners: [&[u64]; 4] = [&[0, 1, 2], &[0, 2, 9], &[0, 0, 1], &[0, 1, 2, 3]];
        let mesh = Mesh::of_shells(&NODES, corners).unwrap();
        let status: Vec<_> = mesh.elements().map(|(.., status)| status).collect();
        assert_eq!(
            status,
            [
                ElementStatus::Ok,
                ElementStatus::MissingNode,
                ElementStatus::Degenerate,
                ElementStatus::Ok
            ]
        );
        assert_eq!(mesh.faults().missing_nodes.first(), [1]);
    }

    #[test]
    fn arrays_that_are_no_mesh_are_refused() {
        let none: [&[u64]; 0] = [];
        assert!(Mesh::of_shells(&[], none).is_err());
        let error = Mesh::of_shells(&NODES, [&[0, 1][..]]).unwrap_err();
        assert!(error.to_string().contains("element 0"), "{error}");
        let error = Mesh::of_shells(&[[f64::NAN, 0.0, 0.0]], none).unwrap_err();
        assert!(error.to_string().contains("node 0"), "{error}");
    }
}
