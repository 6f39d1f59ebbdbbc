//! The reflecting faces of a mesh, turned toward the sun and grouped into facets.

use std::collections::HashSet;

use super::error::{MeshError, quoted};
use super::shape::{Lie, lie};
use super::{ElementStatus, Face, Fault, Mesh, find};
use crate::element::Element;
use crate::vector::{Vector, cross, dot, norm, scale, sub, unit};

mod coincident;
mod facets;
mod kept;
mod outer;

pub use outer::LeftAside;

/// Which part of a mesh is the mirror.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum Pick<'a> {
    /// Every shell, and of every body of solids its sunny side.
    All,
    /// The shells of an element set, and of every body of its solids the sunny side.
    ElementSet(&'a str),
    /// The faces of a surface.
    Surface(&'a str),
    /// The shells and the outer faces of solids whose corners are all in a node set.
    NodeSet(&'a str),
}

/// How to find the mirror's side.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct MirrorOptions {
    sun: Vector,
    crease_rad: f64,
}

impl MirrorOptions {
    /// Mirrors that face a sun in this direction (to it, of any length). The direction says which side of
    /// a facet reflects; it need not be the sun that is traced.
    ///
    /// # Errors
    /// [`MeshError::BadValue`] for a vector that is not finite or has no length.
    pub fn toward(sun: [f64; 3]) -> Result<Self, MeshError> {
        let sun = unit(sun).ok_or(MeshError::BadValue {
            what: "sun",
            wanted: "a finite vector with a length",
            value: norm(sun),
        })?;
        // A crease of a body, between the front of a glass and its rim, is square or nearly so; neighbours
        // on a curved mirror differ by a few degrees even in the coarsest mesh.
        let crease_rad = 40.0 * (std::f64::consts::PI / 180.0);
        Ok(Self { sun, crease_rad })
    }

    /// Neighbouring faces whose normals differ by more than this belong to different facets, in
    /// (0, π/2) \[rad\]; without it 40°.
    ///
    /// # Errors
    /// [`MeshError::BadValue`] outside that range.
    pub fn with_crease_rad(self, crease_rad: f64) -> Result<Self, MeshError> {
        if !(crease_rad > 0.0 && crease_rad < std::f64::consts::FRAC_PI_2) {
            return Err(MeshError::BadValue {
                what: "crease_rad",
                wanted: "between 0 and pi/2",
                value: crease_rad,
            });
        }
        Ok(Self { crease_rad, ..self })
    }
}

/// A face of a mirror.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct MirrorFace {
    element: u64,
    facet: u32,
    corners: [u32; 4],
    count: u8,
}

impl MirrorFace {
    /// Number of the element that it is a face of.
    #[must_use]
    pub const fn element(&self) -> u64 {
        self.element
    }

    /// Which facet it belongs to, from 0.
    #[must_use]
    pub const fn facet(&self) -> u32 {
        self.facet
    }

    /// Its three or four corners as rows of [`Mirror::position_m`], counterclockwise as seen from the
    /// reflecting side.
    #[must_use]
    pub fn corners(&self) -> &[u32] {
        &self.corners[..usize::from(self.count)]
    }
}

/// The reflecting side of a mesh: faces in the order of the mesh's elements, each in a facet.
///
/// A facet is what hangs together by edges without a crease. It holds the nodes of its faces only, with
/// their displacements if the mesh has them.
#[derive(Debug, Clone, PartialEq)]
pub struct Mirror {
    node_ids: Vec<u64>,
    position_m: Vec<Vector>,
    displacement_m: Option<Vec<Vector>>,
    faces: Vec<MirrorFace>,
    facets: u32,
    unusable: Fault,
    covered: u64,
    coincident: Fault,
    rewound: Fault,
    left_aside: LeftAside,
}

impl Mirror {
    /// The faces.
    #[must_use]
    pub fn faces(&self) -> &[MirrorFace] {
        &self.faces
    }

    /// How many facets there are.
    #[must_use]
    pub const fn facets(&self) -> u32 {
        self.facets
    }

    /// Numbers of the nodes, in the order of the mesh.
    #[must_use]
    pub fn node_ids(&self) -> &[u64] {
        &self.node_ids
    }

    /// Where the nodes are without load \[m\].
    #[must_use]
    pub fn position_m(&self) -> &[[f64; 3]] {
        &self.position_m
    }

    /// Displacements of the nodes \[m\] if the mesh has any; NaN for a node without.
    #[must_use]
    pub fn displacement_m(&self) -> Option<&[[f64; 3]]> {
        self.displacement_m.as_deref()
    }

    /// Elements of the chosen part without a face here: they have a fault of their own, their face has, or
    /// it is that of an element before (as under a skin of shells).
    #[must_use]
    pub const fn unusable(&self) -> &Fault {
        &self.unusable
    }

    /// How many of [`unusable`](Self::unusable) miss nothing: their face is that of an element before.
    #[must_use]
    pub const fn covered(&self) -> u64 {
        self.covered
    }

    /// Elements of the chosen part whose face stands where that of an element before it does, on nodes of its
    /// own (to 1e-6 of the part's extent and 1e-3 of the face's), as where two parts are meshed one on the
    /// other: not used, for the light would count twice.
    #[must_use]
    pub const fn coincident(&self) -> &Fault {
        &self.coincident
    }

    /// Outer faces of solids that are turned to the sun and belong to no patch that counts; none for a
    /// surface or a node set.
    #[must_use]
    pub const fn left_aside(&self) -> &LeftAside {
        &self.left_aside
    }

    /// Shells whose corners run the other way round than those of their neighbours: used, turned.
    #[must_use]
    pub const fn rewound(&self) -> &Fault {
        &self.rewound
    }
}

/// A face that may belong to the mirror.
#[derive(Debug, Clone, Copy)]
struct Candidate {
    face: Face,
    corners: [u32; 4],
    count: u8,
    solid: bool,
    /// ½ (c - a) × (d - b)
    area: Vector,
}

impl Candidate {
    fn corners(&self) -> &[u32] {
        &self.corners[..usize::from(self.count)]
    }

    fn turn(&mut self) {
        let count = usize::from(self.count);
        self.corners[..count].reverse();
        self.area = scale(self.area, -1.0);
    }
}

impl Mesh {
    /// The reflecting faces of a part of the mesh, turned toward the sun.
    ///
    /// Of solids the outer faces count: of each body (what hangs together by nodes) the smooth patch that
    /// takes the most light, so that neither the back of a glass nor its rims reflect. Faces of a surface
    /// or a node set are taken as they are chosen. Shells are wound like their neighbours and then, facet
    /// by facet, turned toward the sun. A body has one patch, also where several facets, or glass and
    /// supports, are one body: [`Mirror::left_aside`] counts what else of it is turned to the sun. Name the
    /// mirror by a surface then.
    ///
    /// # Errors
    /// [`MeshError::UnknownName`], and [`MeshError::NoFaces`] if nothing usable is left.
    ///
    /// ```
    /// use helio_flux::mesh::{MirrorOptions, Pick, ReadOptions, inp};
    /// // A glass of 4 mm as one solid element: its face S2 is on top.
    /// let model = b"*NODE\n1,0,0,0\n2,1,0,0\n3,1,1,0\n4,0,1,0\n5,0,0,.004\n6,1,0,.004\n7,1,1,.004\n\
    ///     8,0,1,.004\n*ELEMENT,TYPE=C3D8\n1,1,2,3,4,5,6,7,8\n";
    /// let mesh = inp::mesh("glass.inp", model, &ReadOptions::default())?;
    /// let mirror = mesh.mirror(&Pick::All, &MirrorOptions::toward([0.0, 0.6, 0.8])?)?;
    /// assert_eq!(mirror.faces().len(), 1);
    /// assert_eq!(mirror.node_ids(), [5, 6, 7, 8]);
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn mirror(&self, pick: &Pick<'_>, options: &MirrorOptions) -> Result<Mirror, MeshError> {
        let mut unusable = Fault::default();
        let (chosen, sunny) = self.chosen(pick, &mut unusable)?;
        let mut candidates = Vec::with_capacity(chosen.len());
        for face in chosen {
            match self.candidate(face) {
                Some(candidate) => candidates.push(candidate),
                None => unusable.add(self.elements[face.element as usize].id),
            }
        }
        let mut left_aside = LeftAside::default();
        if sunny {
            (candidates, left_aside) = outer::sunny_sides(self, candidates, options);
        }
        // A skin of shells on the face of a solid is one mirror, not two.
        let mut seen = HashSet::with_capacity(candidates.len());
        let mut covered = 0;
        candidates.retain(|candidate| {
            let mut key = candidate.corners;
            key[usize::from(candidate.count)..].fill(u32::MAX);
            key.sort_unstable();
            let first = seen.insert(key);
            if !first {
                covered += 1;
                unusable.add(self.elements[candidate.face.element as usize].id);
            }
            first
        });
        let mut coincident = Fault::default();
        let twice = coincident::stand_twice(&candidates, &self.position_m);
        let mut rows = twice.iter();
        candidates.retain(|candidate| {
            let again = rows.next().is_some_and(|again| *again);
            if again {
                coincident.add(self.elements[candidate.face.element as usize].id);
            }
            !again
        });
        let what = match pick {
            Pick::All => "the mesh".to_owned(),
            Pick::ElementSet(name) => format!("element set {}", quoted(name)),
            Pick::Surface(name) => format!("surface {}", quoted(name)),
            Pick::NodeSet(name) => format!("node set {}", quoted(name)),
        };
        if candidates.is_empty() {
            let why = if unusable.count() > 0 {
                format!("{} unusable elements: {unusable}", unusable.count())
            } else if self.is_empty() {
                let kinds: Vec<_> = self.faults.skipped.keys().map(|k| quoted(k)).collect();
                format!(
                    "the mesh has no shells or solids, only [{}]",
                    kinds.join(", ")
                )
            } else {
                "it has no shells and no outer faces of solids toward the sun".to_owned()
            };
            return Err(MeshError::NoFaces { what, why });
        }
        let grouped = facets::group(&mut candidates, options);
        let mut rewound = Fault::default();
        for &row in &grouped.rewound {
            let element = candidates[row].face.element as usize;
            rewound.add(self.elements[element].id);
        }
        let mirror = self.collect(&candidates, &grouped.facet, grouped.facets);
        Ok(Mirror {
            unusable,
            covered,
            coincident,
            rewound,
            left_aside,
            ..mirror
        })
    }

    /// The faces that a pick names, in order, and whether of solids only the sunny side is meant.
    fn chosen(
        &self,
        pick: &Pick<'_>,
        unusable: &mut Fault,
    ) -> Result<(Vec<Face>, bool), MeshError> {
        let mut faces = Vec::new();
        let mut of_elements = |rows: &mut dyn Iterator<Item = u32>| {
            let mut solids = Vec::new();
            for row in rows {
                if !self.usable(row) {
                    unusable.add(self.elements[row as usize].id);
                } else if self.elements[row as usize].shape.is_solid() {
                    solids.push(row);
                } else {
                    let element = row;
                    faces.push(Face { element, face: 0 });
                }
            }
            if !solids.is_empty() {
                faces.extend(outer::faces(self, &solids));
            }
        };
        let sunny = match pick {
            Pick::All => {
                of_elements(&mut (0..self.elements.len() as u32));
                true
            }
            Pick::ElementSet(name) => {
                let rows = find(&self.element_sets, "element set", name)?;
                of_elements(&mut rows.iter().copied());
                true
            }
            Pick::Surface(name) => {
                for &face in find(&self.surfaces, "surface", name)? {
                    if self.usable(face.element) {
                        faces.push(face);
                    } else {
                        unusable.add(self.elements[face.element as usize].id);
                    }
                }
                false
            }
            Pick::NodeSet(name) => {
                let rows = find(&self.node_sets, "node set", name)?;
                // Faulty elements elsewhere are none of this pick's business.
                let mut elements = (0..self.elements.len() as u32).filter(|&row| self.usable(row));
                of_elements(&mut elements);
                let within = |&face: &Face| {
                    let (corners, count) = self.corners_of(face);
                    let mut corners = corners[..count].iter();
                    corners.all(|node| rows.binary_search(node).is_ok())
                };
                faces.retain(within);
                false
            }
        };
        faces.sort_unstable();
        Ok((faces, sunny))
    }

    /// Whether an element can have a face in a mirror.
    fn usable(&self, row: u32) -> bool {
        match self.status[row as usize] {
            ElementStatus::Ok => true,
            ElementStatus::Inverted => self.elements[row as usize].shape.is_solid(),
            _ => false,
        }
    }

    /// The corners of a face, counterclockwise as seen from outside, each node once.
    fn corners_of(&self, face: Face) -> ([u32; 4], usize) {
        let element = &self.elements[face.element as usize];
        let mut corners = [0; 4];
        let mut count = 0;
        for &corner in element.shape.faces()[usize::from(face.face)] {
            let node = element.corners[usize::from(corner)];
            // Collapsed elements have corners that are one node.
            if !corners[..count].contains(&node) {
                corners[count] = node;
                count += 1;
            }
        }
        if self.status[face.element as usize] == ElementStatus::Inverted {
            corners[..count].reverse();
        }
        (corners, count)
    }

    fn candidate(&self, face: Face) -> Option<Candidate> {
        let (corners, count) = self.corners_of(face);
        if count < 3 {
            return None;
        }
        let mut at = [[0.0; 3]; 4];
        for (at, &node) in at.iter_mut().zip(&corners[..count]) {
            *at = self.position_m[node as usize];
        }
        let shape = if count == 3 {
            super::Shape::Triangle
        } else {
            super::Shape::Quadrilateral
        };
        // What the flat piece of it will say.
        let element = match shape {
            super::Shape::Triangle => Element::triangle([at[0], at[1], at[2]]),
            _ => Element::quadrilateral(at),
        };
        if element.is_err() || lie(shape, &at[..count]) != Lie::Good {
            return None;
        }
        let area = cross(sub(at[2], at[0]), sub(at[count - 1], at[1]));
        Some(Candidate {
            face,
            corners,
            count: count as u8,
            solid: self.elements[face.element as usize].shape.is_solid(),
            area: scale(area, 0.5),
        })
    }

    fn collect(&self, candidates: &[Candidate], facet: &[u32], facets: u32) -> Mirror {
        let mut row_of = vec![u32::MAX; self.node_ids.len()];
        for &node in candidates.iter().flat_map(Candidate::corners) {
            row_of[node as usize] = 0;
        }
        let mut kept = Vec::new();
        for (node, row) in row_of.iter_mut().enumerate() {
            if *row == 0 {
                *row = kept.len() as u32;
                kept.push(node);
            }
        }
        let faces = candidates.iter().zip(facet).map(|(candidate, &facet)| {
            let mut corners = candidate.corners;
            for corner in &mut corners[..usize::from(candidate.count)] {
                *corner = row_of[*corner as usize];
            }
            MirrorFace {
                element: self.elements[candidate.face.element as usize].id,
                facet,
                corners,
                count: candidate.count,
            }
        });
        let pick = |column: &[Vector]| kept.iter().map(|&node| column[node]).collect();
        Mirror {
            node_ids: kept.iter().map(|&node| self.node_ids[node]).collect(),
            position_m: pick(&self.position_m),
            displacement_m: self.displacement_m.as_deref().map(pick),
            faces: faces.collect(),
            facets,
            unusable: Fault::default(),
            covered: 0,
            coincident: Fault::default(),
            rewound: Fault::default(),
            left_aside: LeftAside::default(),
        }
    }
}

/// Whether two areas that are wound the same way meet without a crease.
fn is_smooth(a: Vector, b: Vector, cos_crease: f64) -> bool {
    dot(a, b) >= cos_crease * norm(a) * norm(b)
}
