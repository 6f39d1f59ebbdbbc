//! Entities, nodes and elements of version 4.1.

use super::{Reader, kind};
use crate::mesh::error::{ReadError, ReadProblem};
use crate::mesh::scan::Scan;

/// A number that is `int` in the binary format.
fn int(scan: &mut Scan<'_>, binary: bool, what: &str) -> Result<i64, ReadError> {
    if binary {
        scan.i32(what).map(i64::from)
    } else {
        scan.signed(what)
    }
}

/// A number that is `size_t` in the binary format.
fn size(scan: &mut Scan<'_>, binary: bool, what: &str) -> Result<u64, ReadError> {
    if binary {
        scan.u64(what)
    } else {
        scan.whole(what)
    }
}

fn id(scan: &mut Scan<'_>, binary: bool, what: &str) -> Result<u64, ReadError> {
    if !binary {
        return scan.id(what);
    }
    match scan.u64(what)? {
        0 => Err(scan.source.whole(ReadProblem::Wrong {
            what: what.to_owned(),
            wanted: "a positive whole number".to_owned(),
            found: "0".to_owned(),
        })),
        id => Ok(id),
    }
}

/// The bytes that a number takes at least.
const fn bytes(binary: bool, of_binary: usize) -> usize {
    if binary { of_binary } else { 2 }
}

fn begin(scan: &mut Scan<'_>, binary: bool) {
    if binary {
        scan.rest_of_line();
    }
}

pub(super) fn entities(scan: &mut Scan<'_>, reader: &mut Reader) -> Result<(), ReadError> {
    let binary = reader.binary;
    begin(scan, binary);
    let what = "$Entities";
    let mut counts = [0; 4];
    for count in &mut counts {
        *count = size(scan, binary, what)?;
    }
    for (dimension, &count) in counts.iter().enumerate() {
        scan.announced("entities", count, bytes(binary, 24))?;
        for _ in 0..count {
            let number = int(scan, binary, what)?;
            // A point has a place, the others have a box.
            for _ in 0..if dimension == 0 { 3 } else { 6 } {
                if binary {
                    scan.f64(what)?;
                } else {
                    scan.number(what)?;
                }
            }
            let groups = size(scan, binary, what)?;
            scan.announced("physical groups", groups, bytes(binary, 4))?;
            let mut all = Vec::new();
            for _ in 0..groups {
                all.push(int(scan, binary, what)?);
            }
            if dimension > 0 {
                let bounding = size(scan, binary, what)?;
                scan.announced("bounding entities", bounding, bytes(binary, 4))?;
                for _ in 0..bounding {
                    int(scan, binary, what)?;
                }
            }
            if !all.is_empty() {
                reader.entities.insert((dimension as i64, number), all);
            }
        }
    }
    Ok(())
}

/// The four numbers at the head of nodes and elements: blocks, things, lowest and highest number.
fn head(scan: &mut Scan<'_>, binary: bool, what: &str) -> Result<u64, ReadError> {
    begin(scan, binary);
    let blocks = size(scan, binary, what)?;
    for _ in 0..3 {
        size(scan, binary, what)?;
    }
    scan.announced("blocks", blocks, bytes(binary, 20))?;
    Ok(blocks)
}

pub(super) fn nodes(scan: &mut Scan<'_>, reader: &mut Reader) -> Result<(), ReadError> {
    let source = scan.source;
    let binary = reader.binary;
    let what = "$Nodes";
    let mut ids = Vec::new();
    for _ in 0..head(scan, binary, what)? {
        let dimension = int(scan, binary, what)?;
        int(scan, binary, what)?;
        let parametric = int(scan, binary, what)?;
        // Coordinates on the entity stand behind those in space.
        let more = match (parametric, dimension) {
            (0, _) => 0,
            (1, 0..=3) => dimension,
            _ => {
                let line = scan.line();
                let wanted = "0, or 1 for an entity of dimension 0 to 3";
                let found = format!("{parametric} of dimension {dimension}");
                return Err(source.wrong(line, "parametric", wanted, &found));
            }
        };
        let count = size(scan, binary, what)?;
        scan.announced("nodes", count, bytes(binary, 32))?;
        ids.clear();
        for _ in 0..count {
            let id = id(scan, binary, "node number")?;
            ids.push((id, scan.line()));
        }
        for &(id, line) in &ids {
            let of_node = "position of a node";
            let at_m = if binary {
                scan.binary_point_m(of_node)?
            } else {
                scan.point_m(of_node)?
            };
            for _ in 0..more {
                if binary {
                    scan.f64(what)?;
                } else {
                    scan.number(what)?;
                }
            }
            let line = if binary { 0 } else { line };
            reader.builder.node(&source, line, id, at_m)?;
        }
    }
    Ok(())
}

pub(super) fn elements(scan: &mut Scan<'_>, reader: &mut Reader) -> Result<(), ReadError> {
    let source = scan.source;
    let binary = reader.binary;
    let what = "$Elements";
    let mut nodes = Vec::new();
    for _ in 0..head(scan, binary, what)? {
        let dimension = int(scan, binary, what)?;
        let entity = int(scan, binary, what)?;
        let number = int(scan, binary, "type of elements")?;
        let kind = kind(scan, number)?;
        let count = size(scan, binary, what)?;
        scan.announced("elements", count, bytes(binary, 8) * (1 + kind.nodes))?;
        let groups = reader.entities.get(&(dimension, entity)).cloned();
        let groups = groups.unwrap_or_default();
        // Groups of an entity are numbers of its own dimension.
        for _ in 0..count {
            let element = id(scan, binary, "element number")?;
            nodes.clear();
            for _ in 0..kind.nodes {
                nodes.push(id(scan, binary, "node of an element")?);
            }
            let Some(shape) = kind.shape else {
                reader.builder.skip(&format!("gmsh {number}"));
                continue;
            };
            reader.builder.element(&source, element, shape, &nodes)?;
            for &group in &groups {
                reader.join(&source, dimension, group, element)?;
            }
        }
    }
    Ok(())
}
