//! Facets: faces that hang together by edges without a crease, wound alike and turned toward the sun.

use super::{Candidate, MirrorOptions, is_smooth};
use crate::vector::{Vector, add, dot, scale};

/// Disjoint groups of rows.
#[derive(Debug)]
pub(super) struct Groups {
    parent: Vec<u32>,
}

impl Groups {
    pub(super) fn new(rows: usize) -> Self {
        Self {
            parent: (0..rows as u32).collect(),
        }
    }

    /// The lowest row of the group, so that nothing depends on the order of joining.
    pub(super) fn root(&mut self, mut row: usize) -> usize {
        while self.parent[row] as usize != row {
            let above = self.parent[row] as usize;
            self.parent[row] = self.parent[above];
            row = above;
        }
        row
    }

    pub(super) fn join(&mut self, a: usize, b: usize) {
        let (a, b) = (self.root(a), self.root(b));
        let (low, high) = (a.min(b), a.max(b));
        self.parent[high] = low as u32;
    }
}

/// Tells of every two faces that share an edge, and whether they run through it opposite ways, as
/// faces do that are wound alike. Of an edge of more than two faces, of neighbours in a row.
pub(super) fn edges(candidates: &[Candidate], mut tell: impl FnMut(usize, usize, bool)) {
    let mut all: Vec<(u32, u32, u32, bool)> = Vec::with_capacity(4 * candidates.len());
    for (row, candidate) in candidates.iter().enumerate() {
        let corners = candidate.corners();
        for (k, &from) in corners.iter().enumerate() {
            let to = corners[(k + 1) % corners.len()];
            all.push((from.min(to), from.max(to), row as u32, from < to));
        }
    }
    all.sort_unstable();
    for pair in all.windows(2) {
        let [a, b] = pair else { continue };
        if (a.0, a.1) == (b.0, b.1) && a.2 != b.2 {
            tell(a.2 as usize, b.2 as usize, a.3 != b.3);
        }
    }
}

pub(super) struct Grouped {
    /// The facet of each face, from 0 in the order of their first faces.
    pub(super) facet: Vec<u32>,
    pub(super) facets: u32,
    /// Faces that were wound the other way round than the first of their facet.
    pub(super) rewound: Vec<usize>,
}

/// Groups faces into facets and turns the shells among them.
pub(super) fn group(candidates: &mut [Candidate], options: &MirrorOptions) -> Grouped {
    let cos_crease = libm::cos(options.crease_rad);
    let mut groups = Groups::new(candidates.len());
    let mut links: Vec<(u32, u32, bool)> = Vec::new();
    edges(candidates, |a, b, alike| {
        let flip = if alike { 1.0 } else { -1.0 };
        let of_b = scale(candidates[b].area, flip);
        if is_smooth(candidates[a].area, of_b, cos_crease) {
            groups.join(a, b);
            links.push((a as u32, b as u32, alike));
            links.push((b as u32, a as u32, alike));
        }
    });
    links.sort_unstable();
    let starts: Vec<usize> = {
        let mut starts = vec![0; candidates.len() + 1];
        for link in &links {
            starts[link.0 as usize + 1] += 1;
        }
        for row in 0..candidates.len() {
            starts[row + 1] += starts[row];
        }
        starts
    };
    // From the first face of each facet outward: is a face wound like the first?
    let mut against: Vec<Option<bool>> = vec![None; candidates.len()];
    let mut open = Vec::new();
    for first in 0..candidates.len() {
        if against[first].is_some() {
            continue;
        }
        against[first] = Some(false);
        open.push(first);
        while let Some(row) = open.pop() {
            let here = against[row] == Some(true);
            for &(_, next, alike) in &links[starts[row]..starts[row + 1]] {
                let next = next as usize;
                if against[next].is_none() {
                    against[next] = Some(here == alike);
                    open.push(next);
                }
            }
        }
    }
    let is_against = |row: usize| against[row] == Some(true);
    let mut area: Vec<Vector> = vec![[0.0; 3]; candidates.len()];
    for (row, candidate) in candidates.iter().enumerate() {
        let flip = if is_against(row) { -1.0 } else { 1.0 };
        let first = groups.root(row);
        area[first] = add(area[first], scale(candidate.area, flip));
    }
    let mut number = vec![u32::MAX; candidates.len()];
    let mut grouped = Grouped {
        facet: Vec::with_capacity(candidates.len()),
        facets: 0,
        rewound: Vec::new(),
    };
    for (row, candidate) in candidates.iter_mut().enumerate() {
        let first = groups.root(row);
        if number[first] == u32::MAX {
            number[first] = grouped.facets;
            grouped.facets += 1;
        }
        grouped.facet.push(number[first]);
        // Outward is where solids reflect, whatever the sun does.
        if candidate.solid {
            continue;
        }
        if is_against(row) {
            grouped.rewound.push(row);
        }
        let shaded = dot(area[first], options.sun) < 0.0;
        if is_against(row) != shaded {
            candidate.turn();
        }
    }
    grouped
}
