//! Meshes of Gmsh: `.msh` of versions 2.2 and 4.1, as text or binary.
//!
//! Physical groups become element sets by their names (`physical-7` for number 7 without a name). Shells,
//! solids and the corners of those of higher order are kept; points and lines are counted in
//! [`Faults::skipped`](super::Faults::skipped). Displacements are taken from a `$NodeData` of three
//! components.
//!
//! Read here and not by a crate: `mshio` (2020) reads version 4.1 without names and without data, and says
//! of a bad file neither the line nor what was wanted. Versions 1, 2.0, 2.1 and 4.0 are refused by name.

mod data;
mod v2;
mod v4;

use std::collections::HashMap;

use super::build::{Builder, Member};
use super::error::{ReadError, ReadProblem};
use super::options::ReadOptions;
use super::scan::Scan;
use super::shape::Shape;
use super::text::{Source, lossy};
use super::vectors::Vectors;
use super::{Displacements, Mesh};

/// Reads a mesh and the displacements in it; `file` is the name in messages.
///
/// # Errors
/// [`ReadError`] for a file that breaks the format or is of another version, and for vectors named that
/// it does not have.
///
/// ```
/// use helio_flux::mesh::{ReadOptions, Vectors, gmsh};
/// let file = b"$MeshFormat\n2.2 0 8\n$EndMeshFormat\n$PhysicalNames\n1\n2 4 \"mirror\"\n$EndPhysicalNames\n\
///     $Nodes\n3\n1 0 0 0\n2 1 0 0\n3 0 1 0\n$EndNodes\n$Elements\n1\n9 2 2 4 1 1 2 3\n$EndElements\n";
/// let mesh = gmsh::mesh("mirror.msh", file, Vectors::Displacement, &ReadOptions::default())?;
/// assert_eq!(mesh.element_set("mirror")?, [9]);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn mesh(
    file: &str,
    bytes: &[u8],
    vectors: Vectors<'_>,
    options: &ReadOptions,
) -> Result<Mesh, ReadError> {
    let mut scan = Scan::new(Source { file, options }, bytes)?;
    let source = scan.source;
    let mut reader = Reader {
        builder: Builder::default(),
        names: HashMap::new(),
        entities: HashMap::new(),
        binary: false,
    };
    let mut version = None;
    let mut known = Vec::new();
    let mut displacements: Option<Displacements> = None;
    while let Some(word) = scan.word() {
        let line = scan.line();
        let section = match word.strip_prefix(b"$") {
            Some(section) => lossy(section),
            None => {
                return Err(source.wrong(line, "a section", "a word like $Nodes", &lossy(word)));
            }
        };
        let Some(version) = version else {
            if section != "MeshFormat" {
                return Err(source.wrong(line, "the first section", "$MeshFormat", &section));
            }
            version = Some(format(&mut scan, &mut reader)?);
            end(&mut scan, &section)?;
            continue;
        };
        match section.as_str() {
            "PhysicalNames" => reader.names(&mut scan)?,
            "Entities" if version == Version::V4 => v4::entities(&mut scan, &mut reader)?,
            "Nodes" if version == Version::V4 => v4::nodes(&mut scan, &mut reader)?,
            "Nodes" => v2::nodes(&mut scan, &mut reader)?,
            "Elements" if version == Version::V4 => v4::elements(&mut scan, &mut reader)?,
            "Elements" => v2::elements(&mut scan, &mut reader)?,
            "NodeData" => {
                let found = data::nodes(&mut scan, reader.binary, vectors, &mut known)?;
                displacements = found.or(displacements);
            }
            other => {
                let mark = format!("$End{other}");
                if !scan.skip_to(mark.as_bytes()) {
                    return Err(scan.ended(&format!("${other}")));
                }
                continue;
            }
        }
        end(&mut scan, &section)?;
    }
    if version.is_none() {
        return Err(source.whole(ReadProblem::Missing {
            what: "$MeshFormat".to_owned(),
            wanted: "a file of Gmsh, version 2.2 or 4.1".to_owned(),
        }));
    }
    vectors.check(&source, displacements.is_some(), &known)?;
    let mut mesh = reader.builder.finish(&source)?;
    if let Some(displacements) = &displacements {
        mesh.displace(displacements);
    }
    known.retain(|name| !vectors.wants(name));
    known.dedup();
    known.truncate(100);
    mesh.vectors = known;
    Ok(mesh)
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Version {
    V2,
    V4,
}

struct Reader {
    builder: Builder,
    /// Names of physical groups by dimension and number.
    names: HashMap<(i64, i64), String>,
    /// Physical groups of an entity by its dimension and number (version 4).
    entities: HashMap<(i64, i64), Vec<i64>>,
    binary: bool,
}

fn format(scan: &mut Scan<'_>, reader: &mut Reader) -> Result<Version, ReadError> {
    let source = scan.source;
    let word = scan.needed("$MeshFormat")?;
    let line = scan.line();
    let version = match word {
        b"2.2" => Version::V2,
        b"4.1" => Version::V4,
        other => {
            return Err(source.error(
                line,
                ReadProblem::Unsupported {
                    what: format!("version {} of Gmsh's format", lossy(other)),
                    advice: "save it as 4.1 (gmsh -save -format msh41)".to_owned(),
                },
            ));
        }
    };
    reader.binary = match scan.whole("kind of file")? {
        0 => false,
        1 => true,
        other => {
            return Err(source.wrong(line, "kind of file", "0 or 1", &other.to_string()));
        }
    };
    let size = scan.whole("size of numbers")?;
    if size != 8 {
        return Err(source.wrong(line, "size of numbers", "8", &size.to_string()));
    }
    if reader.binary {
        scan.rest_of_line();
        match scan.i32("$MeshFormat")? {
            1 => {}
            0x0100_0000 => scan.set_big_endian(),
            other => {
                let what = "the number that tells the order of bytes";
                return Err(source.wrong(line, what, "1", &other.to_string()));
            }
        }
    }
    Ok(version)
}

fn end(scan: &mut Scan<'_>, section: &str) -> Result<(), ReadError> {
    let inside = format!("${section}");
    let word = scan.needed(&inside)?;
    if word.strip_prefix(b"$End") == Some(section.as_bytes()) {
        return Ok(());
    }
    let what = format!("the end of {inside}");
    let wanted = format!("$End{section}");
    Err(scan.source.wrong(scan.line(), &what, &wanted, &lossy(word)))
}

impl Reader {
    fn names(&mut self, scan: &mut Scan<'_>) -> Result<(), ReadError> {
        let count = scan.whole("number of physical names")?;
        scan.announced("physical names", count, 4)?;
        for _ in 0..count {
            let dimension = scan.signed("dimension of a physical name")?;
            let number = scan.signed("number of a physical name")?;
            let text = lossy(scan.rest_of_line());
            let name = text.trim().trim_matches('"');
            if name.is_empty() {
                let line = scan.line() - 1;
                let what = "physical name";
                return Err(scan.source.wrong(line, what, "a name in quotes", &text));
            }
            self.names.insert((dimension, number), name.to_owned());
        }
        Ok(())
    }

    /// Puts an element into the set of a physical group; zero is none.
    fn join(
        &mut self,
        source: &Source<'_>,
        dimension: i64,
        group: i64,
        element: u64,
    ) -> Result<(), ReadError> {
        if group == 0 {
            return Ok(());
        }
        // A negative number says that the element is turned, which the sun decides here.
        let group = group.saturating_abs();
        let sets = &mut self.builder.element_sets;
        let place = match self.names.get(&(dimension, group)) {
            Some(name) => sets.place(name),
            None => sets.place(&format!("physical-{group}")),
        };
        sets.push(source, place, Member::Id(element))
    }
}

/// What an element type is: its dimension, its nodes, and its shape if it can carry a mirror.
#[derive(Debug, Clone, Copy)]
struct Kind {
    dimension: i64,
    nodes: usize,
    shape: Option<Shape>,
}

/// Types of elements by their number (Gmsh reference manual, "MSH file format").
fn kind(scan: &Scan<'_>, number: i64) -> Result<Kind, ReadError> {
    use Shape::{Hexahedron, Pyramid, Quadrilateral, Tetrahedron, Triangle, Wedge};
    let (nodes, dimension, shape) = match number {
        1 => (2, 1, None),
        2 => (3, 2, Some(Triangle)),
        3 => (4, 2, Some(Quadrilateral)),
        4 => (4, 3, Some(Tetrahedron)),
        5 => (8, 3, Some(Hexahedron)),
        6 => (6, 3, Some(Wedge)),
        7 => (5, 3, Some(Pyramid)),
        8 => (3, 1, None),
        9 => (6, 2, Some(Triangle)),
        10 => (9, 2, Some(Quadrilateral)),
        11 => (10, 3, Some(Tetrahedron)),
        12 => (27, 3, Some(Hexahedron)),
        13 => (18, 3, Some(Wedge)),
        14 => (14, 3, Some(Pyramid)),
        15 => (1, 0, None),
        16 => (8, 2, Some(Quadrilateral)),
        17 => (20, 3, Some(Hexahedron)),
        18 => (15, 3, Some(Wedge)),
        19 => (13, 3, Some(Pyramid)),
        20 => (9, 2, Some(Triangle)),
        21 => (10, 2, Some(Triangle)),
        26 => (4, 1, None),
        27 => (5, 1, None),
        29 => (20, 3, Some(Tetrahedron)),
        36 => (16, 2, Some(Quadrilateral)),
        92 => (64, 3, Some(Hexahedron)),
        other => {
            return Err(scan.source.error(
                scan.line(),
                ReadProblem::Unsupported {
                    what: format!("element type {other}"),
                    advice: "mesh with elements of first, second or third order".to_owned(),
                },
            ));
        }
    };
    Ok(Kind {
        dimension,
        nodes,
        shape,
    })
}
