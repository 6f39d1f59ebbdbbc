//! Outer faces of solids, and which of them are the sunny side of their body.

use super::super::{Face, Mesh};
use super::facets::{Groups, edges};
use super::{Candidate, MirrorOptions, is_smooth};
use crate::vector::{Vector, add, dot};

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
) -> Vec<Candidate> {
    if candidates.iter().all(|candidate| !candidate.solid) {
        return candidates;
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
    for (row, candidate) in solids.iter().enumerate() {
        let body = bodies.root(candidate.corners[0] as usize);
        if best[body] == patches.root(row) {
            kept.push(*candidate);
        }
    }
    kept.sort_unstable_by_key(|candidate| candidate.face);
    kept
}
