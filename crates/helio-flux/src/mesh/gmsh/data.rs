//! Values of nodes, of both versions.

use std::collections::HashSet;

use crate::mesh::error::{ReadError, ReadProblem};
use crate::mesh::scan::Scan;
use crate::mesh::text::lossy;
use crate::mesh::{Displacements, Vectors};

/// The most tags of each kind.
const MOST_TAGS: u64 = 100;
/// The most values of a node: a tensor has nine.
const MOST_VALUES: u64 = 9;

/// Reads a `$NodeData`; gives the displacements if it is what `vectors` asks for.
pub(super) fn nodes(
    scan: &mut Scan<'_>,
    binary: bool,
    vectors: Vectors<'_>,
    known: &mut Vec<String>,
) -> Result<Option<Displacements>, ReadError> {
    let source = scan.source;
    let what = "$NodeData";
    let tags = |scan: &mut Scan<'_>| {
        let count = scan.whole("number of tags of $NodeData")?;
        if count > MOST_TAGS {
            let (line, wanted) = (scan.line(), format!("at most {MOST_TAGS}"));
            return Err(source.wrong(line, "number of tags", &wanted, &count.to_string()));
        }
        scan.rest_of_line();
        Ok(count)
    };
    let mut name = String::new();
    for k in 0..tags(scan)? {
        let text = lossy(scan.rest_of_line());
        if k == 0 {
            name = text.trim().trim_matches('"').to_owned();
        }
    }
    for _ in 0..tags(scan)? {
        scan.number(what)?;
    }
    let mut whole = [0, 1, 0];
    for k in 0..tags(scan)? {
        let value = scan.whole("tag of $NodeData")?;
        if let Some(into) = usize::try_from(k).ok().and_then(|k| whole.get_mut(k)) {
            *into = value;
        }
    }
    let [_, values, count] = whole;
    if !(1..=MOST_VALUES).contains(&values) {
        let (line, wanted) = (scan.line(), format!("1 to {MOST_VALUES}"));
        return Err(source.wrong(line, "values per node", &wanted, &values.to_string()));
    }
    if binary {
        scan.rest_of_line();
    }
    let bytes = if binary { 4 + 8 * values as usize } else { 4 };
    scan.announced("values", count, bytes)?;
    if values == 3 {
        known.push(name.clone());
    }
    let wanted = values == 3 && vectors.wants(&name);
    let mut moved = Displacements::default();
    let mut seen = HashSet::new();
    for _ in 0..count {
        let id = if binary {
            u64::try_from(scan.i32(what)?).unwrap_or(0)
        } else {
            scan.whole("node number")?
        };
        if wanted {
            let by_m = if binary {
                scan.binary_point_m("displacement of a node")?
            } else {
                scan.point_m("displacement of a node")?
            };
            if !seen.insert(id) {
                return Err(source.whole(ReadProblem::Wrong {
                    what: format!("node number in {what}"),
                    wanted: "one that stands once".to_owned(),
                    found: id.to_string(),
                }));
            }
            moved.node_ids.push(id);
            moved.displacement_m.push(by_m);
            continue;
        }
        for _ in 0..values {
            if binary {
                scan.f64(what)?;
            } else {
                scan.number(what)?;
            }
        }
    }
    Ok(wanted.then_some(moved))
}
