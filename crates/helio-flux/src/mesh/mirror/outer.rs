//! Outer faces of solids, and which of them are the sunny side of their body.

use super::super::{Face, Mesh};
use super::facets::{Groups, edges};
use super::{Candidate, MirrorOptions, is_smooth};
use crate::vector::{Vector, add, dot, norm};

/// Outer faces of solids that are turned to the sun and are not of the patch that counts.
///
/// ```
/// use helio_flux::mesh::{MirrorOptions, Pick, ReadOptions, inp};
/// // A ridge of one solid, of which two sides look up: one of them counts.
/// let model = b"*NODE\n1,0,0,0\n2,1,0,2\n3,2,0,0\n4,0,1,0\n5,1,1,2\n6,2,1,0\n\
///     *ELEMENT,TYPE=C3D6\n1,1,2,3,4,5,6\n";
/// let mesh = inp::mesh("ridge.inp", model, &ReadOptions::default())?;
/// let mirror = mesh.mirror(&Pick::All, &MirrorOptions::toward([0.0, 0.0, 1.0])?)?;
/// assert_eq!(mirror.faces().len(), 1);
/// let aside = mirror.left_aside();
/// assert_eq!((aside.faces(), aside.patches(), aside.part()), (1, 1, 1.0));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct LeftAside {
    faces: u64,
    patches: u64,
    part: f64,
}

impl LeftAside {
    /// How many faces.
    #[must_use]
    pub const fn faces(&self) -> u64 {
        self.faces
    }

    /// How many smooth patches these are of.
    #[must_use]
    pub const fn patches(&self) -> u64 {
        self.patches
    }

    /// Their area across the sun as a part of that of the solids' faces that count, from 0: some thousandths
    /// for the rims of a glass, and more where facets or supports hang together with it. Infinite if none
    /// counts.
    #[must_use]
    pub const fn part(&self) -> f64 {
        self.part
    }
}

/// Below this cosine to the sun a face stands along its light but for rounding.
const LEAST_COSINE: f64 = 1e-6;

/// The faces of `solids` (rows, ascending) that no other usable solid of the mesh shares.
pub(super) fn faces(mesh: &Mesh, solids: &[u32]) -> Vec<Face> {
    let mut keyed: Vec<([u32; 4], Face)> = Vec::new();
    for element in 0..mesh.elements.len() as u32 {
        let shape = mesh.elements[element as usize].shape;
        if !shape.is_solid() || !mesh.usable(element) {
            continue;
        }
        for face in 0..shape.faces().len() as u8 {
            let face = Face { element, face };
            let (mut key, count) = mesh.corners_of(face);
            if count < 3 {
                continue; // collapsed to an edge
            }
            key[count..].fill(u32::MAX);
            key.sort_unstable();
            keyed.push((key, face));
        }
    }
    keyed.sort_unstable();
    let runs = keyed.chunk_by(|a, b| a.0 == b.0);
    let single = runs.filter(|run| run.len() == 1).map(|run| run[0].1);
    single
        .filter(|face| solids.binary_search(&face.element).is_ok())
        .collect()
}

/// Shells as they are; of each body of solids the smooth patch that takes the most light.
pub(super) fn sunny_sides(
    mesh: &Mesh,
    candidates: Vec<Candidate>,
    options: &MirrorOptions,
) -> (Vec<Candidate>, LeftAside) {
    if candidates.iter().all(|candidate| !candidate.solid) {
        return (candidates, LeftAside::default());
    }
    let (solids, shells): (Vec<_>, Vec<_>) = candidates.into_iter().partition(|c| c.solid);
    let cos_crease = libm::cos(options.crease_rad);
    // Patches hang together by edges without a crease; outer faces are all wound alike.
    let mut patches = Groups::new(solids.len());
    edges(&solids, |a, b, _| {
        if is_smooth(solids[a].area, solids[b].area, cos_crease) {
            patches.join(a, b);
        }
    });
    // Bodies hang together by the nodes of their elements.
    let mut bodies = Groups::new(mesh.node_ids.len());
    for candidate in &solids {
        let element = &mesh.elements[candidate.face.element as usize];
        let corners = &element.corners[..element.shape.corners()];
        for &node in &corners[1..] {
            bodies.join(corners[0] as usize, node as usize);
        }
    }
    let mut light: Vec<Vector> = vec![[0.0; 3]; solids.len()];
    for (row, candidate) in solids.iter().enumerate() {
        let patch = patches.root(row);
        light[patch] = add(light[patch], candidate.area);
    }
    let mut best: Vec<usize> = vec![usize::MAX; mesh.node_ids.len()];
    for (row, candidate) in solids.iter().enumerate() {
        let patch = patches.root(row);
        let taken = dot(light[patch], options.sun);
        let body = bodies.root(candidate.corners[0] as usize);
        let best = &mut best[body];
        if taken > 0.0 && (*best == usize::MAX || taken > dot(light[*best], options.sun)) {
            *best = patch;
        }
    }
    let mut kept = shells;
    let mut aside = LeftAside::default();
    let (mut of_kept_m2, mut of_aside_m2) = (0.0, 0.0);
    let mut counted = vec![false; solids.len()];
    for (row, candidate) in solids.iter().enumerate() {
        let body = bodies.root(candidate.corners[0] as usize);
        let across_m2 = dot(candidate.area, options.sun);
        let patch = patches.root(row);
        if best[body] == patch {
            kept.push(*candidate);
            of_kept_m2 += across_m2.max(0.0);
        } else if across_m2 > LEAST_COSINE * norm(candidate.area) {
            aside.faces += 1;
            of_aside_m2 += across_m2;
            if !counted[patch] {
                counted[patch] = true;
                aside.patches += 1;
            }
        }
    }
    if aside.faces > 0 {
        aside.part = of_aside_m2 / of_kept_m2;
    }
    kept.sort_unstable_by_key(|candidate| candidate.face);
    (kept, aside)
}
