//! Nodes and elements of version 2.2.

use super::{Reader, kind};
use crate::mesh::error::ReadError;
use crate::mesh::scan::Scan;

pub(super) fn nodes(scan: &mut Scan<'_>, reader: &mut Reader) -> Result<(), ReadError> {
    let source = scan.source;
    let count = scan.whole("number of nodes")?;
    if reader.binary {
        scan.rest_of_line();
        scan.announced("nodes", count, 28)?;
        for _ in 0..count {
            let id = binary_id(scan, "node number")?;
            let at_m = scan.binary_point_m("position of a node")?;
            reader.builder.node(&source, 0, id, at_m)?;
        }
        return Ok(());
    }
    scan.announced("nodes", count, 8)?;
    for _ in 0..count {
        let id = scan.id("node number")?;
        let line = scan.line();
        let at_m = scan.point_m("position of a node")?;
        reader.builder.node(&source, line, id, at_m)?;
    }
    Ok(())
}

fn binary_id(scan: &mut Scan<'_>, what: &str) -> Result<u64, ReadError> {
    let id = scan.i32(what)?;
    match u64::try_from(id) {
        Ok(id) if id > 0 => Ok(id),
        _ => Err(scan.source.whole(crate::mesh::ReadProblem::Wrong {
            what: what.to_owned(),
            wanted: "a positive whole number".to_owned(),
            found: id.to_string(),
        })),
    }
}

/// Tags of an element; Gmsh writes two, and some more of partitions.
const MOST_TAGS: u64 = 1000;

pub(super) fn elements(scan: &mut Scan<'_>, reader: &mut Reader) -> Result<(), ReadError> {
    let source = scan.source;
    let count = scan.whole("number of elements")?;
    if reader.binary {
        scan.rest_of_line();
        return binary_elements(scan, reader, count);
    }
    scan.announced("elements", count, 6)?;
    let mut nodes = Vec::new();
    for _ in 0..count {
        let id = scan.id("element number")?;
        let number = scan.signed("type of an element")?;
        let kind = kind(scan, number)?;
        let tags = scan.whole("number of tags")?;
        if tags > MOST_TAGS {
            let line = scan.line();
            let wanted = format!("at most {MOST_TAGS}");
            return Err(source.wrong(line, "number of tags", &wanted, &tags.to_string()));
        }
        let mut group = 0;
        for k in 0..tags {
            let tag = scan.signed("tag of an element")?;
            if k == 0 {
                group = tag;
            }
        }
        nodes.clear();
        for _ in 0..kind.nodes {
            nodes.push(scan.id("node of an element")?);
        }
        keep(scan, reader, (id, number, group), kind, &nodes)?;
    }
    Ok(())
}

fn keep(
    scan: &Scan<'_>,
    reader: &mut Reader,
    (id, number, group): (u64, i64, i64),
    kind: super::Kind,
    nodes: &[u64],
) -> Result<(), ReadError> {
    let Some(shape) = kind.shape else {
        reader.builder.skip(&format!("gmsh {number}"));
        return Ok(());
    };
    reader.builder.element(&scan.source, id, shape, nodes)?;
    reader.join(&scan.source, kind.dimension, group, id)
}

fn binary_elements(scan: &mut Scan<'_>, reader: &mut Reader, count: u64) -> Result<(), ReadError> {
    scan.announced("elements", count, 4)?;
    let mut nodes = Vec::new();
    let mut done = 0;
    while done < count {
        let number = i64::from(scan.i32("type of elements")?);
        let kind = kind(scan, number)?;
        let block = binary_id(scan, "number of elements")?;
        let tags = scan.i32("number of tags")?;
        let tags = u64::try_from(tags).unwrap_or(u64::MAX);
        if tags > MOST_TAGS {
            return Err(scan.source.whole(crate::mesh::ReadProblem::Wrong {
                what: "number of tags".to_owned(),
                wanted: format!("at most {MOST_TAGS}"),
                found: tags.to_string(),
            }));
        }
        scan.announced("elements", block, 4 * (1 + kind.nodes))?;
        for _ in 0..block {
            let id = binary_id(scan, "element number")?;
            let mut group = 0;
            for k in 0..tags {
                let tag = scan.i32("tag of an element")?;
                if k == 0 {
                    group = i64::from(tag);
                }
            }
            nodes.clear();
            for _ in 0..kind.nodes {
                nodes.push(binary_id(scan, "node of an element")?);
            }
            keep(scan, reader, (id, number, group), kind, &nodes)?;
        }
        done += block;
    }
    Ok(())
}
