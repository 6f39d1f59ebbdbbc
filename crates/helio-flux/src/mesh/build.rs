//! From what a reader finds, one line after the other, to a mesh.

use std::collections::{BTreeMap, HashMap};

use super::error::{ReadError, ReadProblem};
use super::shape::{Lie, Shape, lie};
use super::text::Source;
use super::{ElementStatus, Face, Faults, Mesh, MeshElement, Named};
use crate::vector::Vector;

/// Corner whose node the mesh does not have.
pub(crate) const NO_NODE: u32 = u32::MAX;

/// Elements as they stand in the file: nodes by their numbers.
#[derive(Debug, Clone, Copy)]
struct RawElement {
    id: u64,
    shape: Shape,
    corners: [u64; 8],
}

/// A set as it stands in a file.
#[derive(Debug, Default)]
struct RawSet {
    name: String,
    members: Vec<Member>,
}

/// A member of a set as it stands in a file.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Member {
    Id(u64),
    /// From, to, step; all three positive.
    Range(u64, u64, u64),
    /// Another set of the same kind, by its place.
    Set(usize),
}

/// Sets of one kind in the order in which they appear, found by name whatever its case.
#[derive(Debug, Default)]
pub(crate) struct RawSets {
    sets: Vec<RawSet>,
    by_name: HashMap<String, usize>,
    members: u64,
}

impl RawSets {
    pub(crate) fn find(&self, name: &str) -> Option<usize> {
        self.by_name.get(&name.to_uppercase()).copied()
    }

    /// The place of the set of this name, which is made if there is none.
    pub(crate) fn place(&mut self, name: &str) -> usize {
        let key = name.to_uppercase();
        let next = self.sets.len();
        let place = *self.by_name.entry(key).or_insert(next);
        if place == next {
            self.sets.push(RawSet {
                name: name.to_owned(),
                members: Vec::new(),
            });
        }
        place
    }

    pub(crate) fn push(
        &mut self,
        source: &Source<'_>,
        place: usize,
        member: Member,
    ) -> Result<(), ReadError> {
        self.members += 1;
        let most = source.options.limits.set_members;
        source.at_most("members of sets", self.members, most)?;
        self.sets[place].members.push(member);
        Ok(())
    }

    /// The rows of every set's members: ascending, each once. Numbers that nothing has are left out.
    fn resolve(
        &self,
        source: &Source<'_>,
        index: &HashMap<u64, u32>,
    ) -> Result<BTreeMap<String, Named<u32>>, ReadError> {
        let mut budget = Budget::new(source);
        let mut out = BTreeMap::new();
        for (place, set) in self.sets.iter().enumerate() {
            let mut rows = Vec::new();
            for member in self.flat(place, &mut budget)? {
                match member {
                    Member::Id(id) => rows.extend(index.get(&id)),
                    Member::Range(from, to, step) => {
                        let count = to.saturating_sub(from) / step + 1;
                        if count > index.len() as u64 {
                            // Fewer things than numbers: ask the things.
                            budget.spend(index.len() as u64)?;
                            let within = |id: u64| {
                                (from..=to).contains(&id) && (id - from).is_multiple_of(step)
                            };
                            let found = index.iter().filter(|&(&id, _)| within(id));
                            rows.extend(found.map(|(_, &row)| row));
                        } else {
                            budget.spend(count)?;
                            // count is below the number of things: this cannot overflow.
                            rows.extend((0..count).filter_map(|k| index.get(&(from + k * step))));
                        }
                    }
                    Member::Set(_) => {}
                }
            }
            rows.sort_unstable();
            rows.dedup();
            out.insert(
                set.name.to_uppercase(),
                Named {
                    name: set.name.clone(),
                    rows,
                },
            );
        }
        Ok(out)
    }

    /// The members of a set and of the sets within it, each of these once.
    fn flat(&self, place: usize, budget: &mut Budget<'_>) -> Result<Vec<Member>, ReadError> {
        let mut seen = vec![place];
        let mut out = Vec::new();
        let mut next = 0;
        while next < seen.len() {
            let members = &self.sets[seen[next]].members;
            budget.spend(members.len() as u64 + 1)?;
            for &member in members {
                if let Member::Set(inner) = member {
                    budget.spend(seen.len() as u64)?;
                    if !seen.contains(&inner) {
                        seen.push(inner);
                    }
                } else {
                    out.push(member);
                }
            }
            next += 1;
        }
        Ok(out)
    }
}

/// Counts members of sets against the limit.
struct Budget<'a> {
    source: &'a Source<'a>,
    spent: u64,
}

impl<'a> Budget<'a> {
    fn new(source: &'a Source<'a>) -> Self {
        Self { source, spent: 0 }
    }

    fn spend(&mut self, members: u64) -> Result<(), ReadError> {
        self.spent = self.spent.saturating_add(members);
        let most = self.source.options.limits.set_members;
        self.source.at_most("members of sets", self.spent, most)
    }
}

/// A mesh in the making.
#[derive(Debug, Default)]
pub(crate) struct Builder {
    node_ids: Vec<u64>,
    position_m: Vec<Vector>,
    node_lines: Vec<u32>,
    node_index: HashMap<u64, u32>,
    elements: Vec<RawElement>,
    /// Nodes between corners that were not there when their element (a row) named them.
    unseen: Vec<(u32, u64)>,
    pub(crate) node_sets: RawSets,
    pub(crate) element_sets: RawSets,
    surfaces: Vec<(String, Vec<(Member, u8)>)>,
    skipped: BTreeMap<String, u64>,
}

impl Builder {
    /// One more node; the same node at the same place again is no harm. `line` is 0 without lines.
    pub(crate) fn node(
        &mut self,
        source: &Source<'_>,
        line: usize,
        id: u64,
        at_m: Vector,
    ) -> Result<(), ReadError> {
        let row = self.node_ids.len();
        let first = *self.node_index.entry(id).or_insert(row as u32) as usize;
        if first < row {
            if self.position_m[first] == at_m {
                return Ok(());
            }
            let known = self.node_lines[first] as usize;
            let problem = ReadProblem::TwoPlaces {
                id,
                first: (known > 0).then_some(known),
            };
            return Err(if line > 0 {
                source.error(line, problem)
            } else {
                source.whole(problem)
            });
        }
        source.at_most("nodes", row as u64 + 1, source.options.limits.nodes)?;
        self.node_ids.push(id);
        self.position_m.push(at_m);
        self.node_lines.push(u32::try_from(line).unwrap_or(0));
        Ok(())
    }

    /// One more element by the numbers of its nodes, of which the first are its corners.
    pub(crate) fn element(
        &mut self,
        source: &Source<'_>,
        id: u64,
        shape: Shape,
        nodes: &[u64],
    ) -> Result<(), ReadError> {
        let most = source.options.limits.elements;
        source.at_most("elements", self.elements.len() as u64 + 1, most)?;
        let between = &nodes[shape.corners()..];
        let row = self.elements.len() as u32;
        let unseen = between
            .iter()
            .filter(|node| !self.node_index.contains_key(node));
        self.unseen.extend(unseen.map(|&node| (row, node)));
        let mut corners = [0; 8];
        corners[..shape.corners()].copy_from_slice(&nodes[..shape.corners()]);
        self.elements.push(RawElement { id, shape, corners });
        Ok(())
    }

    /// One more element of a type that carries no mirror.
    pub(crate) fn skip(&mut self, kind: &str) {
        if let Some(count) = self.skipped.get_mut(kind) {
            *count += 1;
        } else {
            let kind = kind.chars().take(40).collect();
            *self.skipped.entry(kind).or_insert(0) += 1;
        }
    }

    /// A surface, to which members with the number of a face (counted from 0) can be added.
    pub(crate) fn surface(&mut self, name: &str) -> usize {
        self.surfaces.push((name.to_owned(), Vec::new()));
        self.surfaces.len() - 1
    }

    pub(crate) fn surface_member(&mut self, surface: usize, member: Member, face: u8) {
        self.surfaces[surface].1.push((member, face));
    }

    pub(crate) fn finish(self, source: &Source<'_>) -> Result<Mesh, ReadError> {
        if self.node_ids.is_empty() {
            return Err(source.whole(ReadProblem::Missing {
                what: "every node".to_owned(),
                wanted: "a mesh with nodes and elements".to_owned(),
            }));
        }
        let mut faults = Faults {
            skipped: self.skipped,
            ..Faults::default()
        };
        let mut told = None;
        for &(row, node) in &self.unseen {
            if told != Some(row) && !self.node_index.contains_key(&node) {
                told = Some(row);
                let id = self.elements[row as usize].id;
                faults.missing_mid_nodes.add_pair(id, node);
            }
        }
        let mut element_index = HashMap::with_capacity(self.elements.len());
        let mut same_corners = HashMap::with_capacity(self.elements.len());
        let mut elements = Vec::with_capacity(self.elements.len());
        let mut status = Vec::with_capacity(self.elements.len());
        for (row, raw) in self.elements.iter().enumerate() {
            let count = raw.shape.corners();
            let mut corners = [NO_NODE; 8];
            let mut at = [[0.0; 3]; 8];
            let mut missing = None;
            for k in 0..count {
                match self.node_index.get(&raw.corners[k]) {
                    Some(&node) => {
                        corners[k] = node;
                        at[k] = self.position_m[node as usize];
                    }
                    None => missing = missing.or(Some(raw.corners[k])),
                }
            }
            let mut key = corners;
            key.sort_unstable();
            let again = element_index.contains_key(&raw.id);
            let mut first = row as u32;
            if missing.is_none() && !again {
                first = *same_corners.entry((raw.shape, key)).or_insert(first);
            }
            // In sets, an element with the corners of one before stands for that one: Gmsh's version 2.2
            // repeats an element for each of its groups.
            element_index.entry(raw.id).or_insert(first);
            let of_element = if let Some(node) = missing {
                faults.missing_nodes.add_pair(raw.id, node);
                ElementStatus::MissingNode
            } else if again || first < row as u32 {
                faults.duplicate.add(raw.id);
                ElementStatus::Duplicate
            } else {
                match lie(raw.shape, &at[..count]) {
                    Lie::Good => ElementStatus::Ok,
                    Lie::Flat => {
                        faults.degenerate.add(raw.id);
                        ElementStatus::Degenerate
                    }
                    Lie::Turned => {
                        faults.inverted.add(raw.id);
                        ElementStatus::Inverted
                    }
                }
            };
            elements.push(MeshElement {
                id: raw.id,
                shape: raw.shape,
                corners,
            });
            status.push(of_element);
        }
        let node_sets = self.node_sets.resolve(source, &self.node_index)?;
        let element_sets = self.element_sets.resolve(source, &element_index)?;
        let mut surfaces = BTreeMap::new();
        let mut budget = Budget::new(source);
        for (name, members) in self.surfaces {
            let mut faces = Vec::new();
            for (member, face) in members {
                let rows = match member {
                    Member::Id(id) => element_index.get(&id).copied().into_iter().collect(),
                    Member::Set(place) => {
                        let set = &self.element_sets.sets[place].name.to_uppercase();
                        element_sets
                            .get(set)
                            .map_or_else(Vec::new, |s| s.rows.clone())
                    }
                    Member::Range(..) => Vec::new(),
                };
                budget.spend(rows.len() as u64 + 1)?;
                for row in rows {
                    let shape = elements[row as usize].shape;
                    // Both sides of a shell are its one face.
                    let face = if face <= 1 && !shape.is_solid() {
                        0
                    } else {
                        face
                    };
                    if usize::from(face) < shape.faces().len() {
                        faces.push(Face { element: row, face });
                    } else {
                        faults.no_such_face.add(elements[row as usize].id);
                    }
                }
            }
            faces.sort_unstable();
            faces.dedup();
            surfaces.insert(name.to_uppercase(), Named { name, rows: faces });
        }
        Ok(Mesh {
            node_ids: self.node_ids,
            position_m: self.position_m,
            displacement_m: None,
            node_index: self.node_index,
            elements,
            status,
            node_sets,
            element_sets,
            surfaces,
            faults,
            vectors: Vec::new(),
        })
    }
}
