//! What is wrong with single elements: named and counted, never silent.

use std::collections::BTreeMap;
use std::fmt;

/// How usable an element is.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub enum ElementStatus {
    /// As it should be.
    Ok,
    /// A solid whose corners run the wrong way round (used, its faces turned outward), or a shell that is
    /// folded over or has a corner that points inward (not used).
    Inverted,
    /// No area, or no volume: not used.
    Degenerate,
    /// The number, or the corners, of an element before it: not used.
    Duplicate,
    /// One of its nodes is not in the mesh: not used.
    MissingNode,
}

/// How many elements of a mesh share a fault, and the first of them by number.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Fault {
    count: u64,
    first: Vec<u64>,
    /// For missing nodes: the node of each of `first`.
    nodes: Vec<u64>,
}

/// Elements that a message names.
const NAMED: usize = 8;

impl Fault {
    /// How many.
    #[must_use]
    pub const fn count(&self) -> u64 {
        self.count
    }

    /// The numbers of the first few, in the order of the file.
    #[must_use]
    pub fn first(&self) -> &[u64] {
        &self.first
    }

    /// For missing nodes: the number of the node that each of [`first`](Self::first) wants; else empty.
    #[must_use]
    pub fn nodes(&self) -> &[u64] {
        &self.nodes
    }

    pub(crate) fn add(&mut self, id: u64) {
        self.count += 1;
        if self.first.len() < NAMED {
            self.first.push(id);
        }
    }

    pub(crate) fn add_pair(&mut self, id: u64, node: u64) {
        self.add(id);
        if self.nodes.len() < self.first.len() {
            self.nodes.push(node);
        }
    }
}

impl fmt::Display for Fault {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for (k, id) in self.first.iter().enumerate() {
            let comma = if k > 0 { ", " } else { "" };
            write!(f, "{comma}{id}")?;
            if let Some(node) = self.nodes.get(k) {
                write!(f, " wants node {node}")?;
            }
        }
        if self.count > self.first.len() as u64 {
            write!(f, ", …")?;
        }
        Ok(())
    }
}

/// What was found wrong with the elements of a mesh, and what was left aside.
///
/// As text, one line for each fault that there is, with the first elements by number.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
#[non_exhaustive]
pub struct Faults {
    /// Elements with nodes that the mesh does not have.
    pub missing_nodes: Fault,
    /// Quadratic elements without a node between their corners that they name; their corners count all the same.
    pub missing_mid_nodes: Fault,
    /// Elements without area or volume.
    pub degenerate: Fault,
    /// Solids whose corners run the wrong way round, and shells that are folded over.
    pub inverted: Fault,
    /// Elements with the number, or the corners, of one before.
    pub duplicate: Fault,
    /// Members of surfaces that name a face which their element does not have.
    pub no_such_face: Fault,
    /// How many elements of types that carry no mirror (beams, springs, masses, …) were left aside, by type.
    pub skipped: BTreeMap<String, u64>,
}

impl Faults {
    /// Whether any element has a fault; elements of other types are none.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.each().iter().all(|(fault, _)| fault.count == 0)
    }

    /// Each fault with what it is, of one element and of many.
    fn each(&self) -> [(&Fault, [&str; 2]); 6] {
        [
            (
                &self.missing_nodes,
                ["with nodes that the mesh does not have"; 2],
            ),
            (
                &self.missing_mid_nodes,
                ["with nodes between corners that the mesh does not have"; 2],
            ),
            (&self.degenerate, ["without area or volume"; 2]),
            (&self.inverted, ["inverted or folded over"; 2]),
            (&self.duplicate, ["that stands twice", "that stand twice"]),
            (
                &self.no_such_face,
                [
                    "named in a surface with a face it does not have",
                    "named in a surface with a face they do not have",
                ],
            ),
        ]
    }
}

impl fmt::Display for Faults {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let mut newline = "";
        for (fault, what) in self.each() {
            if fault.count > 0 {
                let many = usize::from(fault.count > 1);
                let (s, what) = (["", "s"][many], what[many]);
                write!(f, "{newline}{} element{s} {what}: {fault}", fault.count)?;
                newline = "\n";
            }
        }
        for (kind, count) in &self.skipped {
            let s = if *count == 1 { "" } else { "s" };
            let kind = super::error::quoted(kind);
            write!(f, "{newline}{count} element{s} of type {kind} left aside")?;
            newline = "\n";
        }
        Ok(())
    }
}
