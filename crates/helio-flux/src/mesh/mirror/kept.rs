//! A mirror made again of what was kept of it.

use super::{Fault, LeftAside, MeshError, Mirror, MirrorFace};

impl Mirror {
    /// A mirror of nodes and faces that are known already, such as those of another that was kept: the number of each
    /// face's element, its facet, and its corners as rows of the nodes. It says of nothing else what became of it.
    ///
    /// # Errors
    /// [`MeshError::WrongLength`] for columns of nodes that differ in length, [`MeshError::BadValue`] for a face without
    /// three or four corners or with one that is no node.
    ///
    /// ```
    /// use helio_flux::mesh::Mirror;
    /// let places_m = vec![[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];
    /// let mirror = Mirror::of_faces(vec![7, 8, 9], places_m, None, [(1, 0, [0, 1, 2].as_slice())])?;
    /// assert_eq!((mirror.facets(), mirror.faces()[0].corners()), (1, [0, 1, 2].as_slice()));
    /// # Ok::<(), helio_flux::mesh::MeshError>(())
    /// ```
    pub fn of_faces<'a>(
        node_ids: Vec<u64>,
        position_m: Vec<[f64; 3]>,
        displacement_m: Option<Vec<[f64; 3]>>,
        faces: impl IntoIterator<Item = (u64, u32, &'a [u32])>,
    ) -> Result<Self, MeshError> {
        let nodes = node_ids.len();
        let moved = displacement_m.as_ref().map_or(nodes, Vec::len);
        for (what, found) in [("position_m", position_m.len()), ("displacement_m", moved)] {
            if found != nodes {
                return Err(MeshError::WrongLength {
                    what,
                    expected: nodes,
                    found,
                });
            }
        }
        let face = |(element, facet, rows): (u64, u32, &[u32])| {
            let bad = |wanted, value| MeshError::BadValue {
                what: "a face",
                wanted,
                value,
            };
            if !matches!(rows.len(), 3 | 4) {
                return Err(bad("of three or four corners", rows.len() as f64));
            }
            if let Some(&beyond) = rows.iter().find(|&&row| row as usize >= nodes) {
                return Err(bad("of rows of the nodes", f64::from(beyond)));
            }
            let mut corners = [rows[2]; 4];
            corners[..rows.len()].copy_from_slice(rows);
            Ok(MirrorFace {
                element,
                facet,
                corners,
                count: rows.len() as u8,
            })
        };
        let faces: Vec<_> = faces.into_iter().map(face).collect::<Result<_, _>>()?;
        Ok(Self {
            facets: faces
                .iter()
                .map(|f| f.facet.saturating_add(1))
                .max()
                .unwrap_or(0),
            node_ids,
            position_m,
            displacement_m,
            faces,
            unusable: Fault::default(),
            covered: 0,
            coincident: Fault::default(),
            rewound: Fault::default(),
            left_aside: LeftAside::default(),
        })
    }
}
