//! Tables in CSV: nodes, elements, displacements.
//!
//! | table | columns |
//! |---|---|
//! | nodes | `node, x_m, y_m, z_m`, and `ux_m, uy_m, uz_m` if the displacements stand with them |
//! | elements | `element, node1, node2, node3`, then as far as needed `node4` … `node8`, and if wanted `shape` and `set` |
//! | displacements | `node, ux_m, uy_m, uz_m` |
//!
//! Lengths in metres where the name ends in `_m`, in millimetres where it ends in `_mm`, in the unit of the
//! [`ReadOptions`] without an ending. Three nodes are a triangle and four a quadrilateral unless `shape`
//! says `tetrahedron`, `pyramid`, `wedge` or `hexahedron`. Other columns are left aside.

use std::collections::HashSet;

use ::csv::{ByteRecord, Reader, ReaderBuilder, Trim};

use super::build::{Builder, Member};
use super::error::{ReadError, ReadProblem};
use super::options::ReadOptions;
use super::shape::Shape;
use super::text::{Source, lossy};
use super::{Displacements, Mesh};
use crate::vector::Vector;

/// Nodes of a table, to which the elements are still to come.
#[derive(Debug)]
pub struct Nodes<'a> {
    builder: Builder,
    moved: Option<Displacements>,
    options: &'a ReadOptions,
}

/// Reads a table of nodes; `file` is its name in messages.
///
/// # Errors
/// [`ReadError`] for a missing column, and a cell that is no number.
///
/// ```
/// use helio_flux::mesh::{ReadOptions, csv};
/// let nodes = b"node,x_mm,y_mm,z_mm\n1,0,0,0\n2,1000,0,0\n3,0,1000,0\n";
/// let options = ReadOptions::default();
/// let mesh = csv::nodes("nodes.csv", nodes, &options)?
///     .elements("elements.csv", b"element,node1,node2,node3,set\n5,1,2,3,glass\n")?;
/// assert_eq!(mesh.position_m()[1], [1.0, 0.0, 0.0]);
/// assert_eq!(mesh.element_set("glass").unwrap(), [5]);
/// # Ok::<(), helio_flux::mesh::ReadError>(())
/// ```
pub fn nodes<'a>(
    file: &str,
    bytes: &[u8],
    options: &'a ReadOptions,
) -> Result<Nodes<'a>, ReadError> {
    let source = Source { file, options };
    let mut table = Table::new(source, bytes)?;
    let id = table.needed("node")?;
    let position = table.vector(["x", "y", "z"])?;
    let moved = table.vector(["ux", "uy", "uz"]);
    let has_moved = table.has_any(["ux", "uy", "uz"]);
    let moved = if has_moved { Some(moved?) } else { None };
    let mut builder = Builder::default();
    let mut displacements = has_moved.then(Displacements::default);
    while let Some(line) = table.below()? {
        let node = source.id(line, "node", table.cell(id))?;
        let at_m = table.lengths(line, &position)?;
        builder.node(&source, line, node, at_m)?;
        if let (Some(columns), Some(into)) = (&moved, &mut displacements) {
            into.node_ids.push(node);
            into.displacement_m.push(table.lengths(line, columns)?);
        }
    }
    Ok(Nodes {
        builder,
        moved: displacements,
        options,
    })
}

/// Shapes by their names in a table.
const SHAPES: [(&str, Shape); 6] = [
    ("triangle", Shape::Triangle),
    ("quadrilateral", Shape::Quadrilateral),
    ("tetrahedron", Shape::Tetrahedron),
    ("pyramid", Shape::Pyramid),
    ("wedge", Shape::Wedge),
    ("hexahedron", Shape::Hexahedron),
];

impl Nodes<'_> {
    /// Reads the table of elements that goes with the nodes; `file` is its name in messages.
    ///
    /// # Errors
    /// [`ReadError`] for a missing column, a cell that is no number, and a shape that is not known.
    pub fn elements(mut self, file: &str, bytes: &[u8]) -> Result<Mesh, ReadError> {
        let source = Source {
            file,
            options: self.options,
        };
        let mut table = Table::new(source, bytes)?;
        let id = table.needed("element")?;
        let mut corners = Vec::new();
        for k in 1..=8 {
            let name = format!("node{k}");
            match table.find(&name) {
                Some(column) => corners.push(column),
                None if k <= 3 => return Err(table.missing(&name)),
                None => break,
            }
        }
        let shape_column = table.find("shape");
        let set_column = table.find("set");
        let mut numbers = Vec::new();
        while let Some(line) = table.below()? {
            let element = source.id(line, "element", table.cell(id))?;
            numbers.clear();
            for (k, &column) in corners.iter().enumerate() {
                if table.cell(column).is_empty() {
                    break;
                }
                let what = format!("node{} of element {element}", k + 1);
                numbers.push(source.id(line, &what, table.cell(column))?);
            }
            let said = shape_column.map_or(&b""[..], |column| table.cell(column));
            let shape = if said.is_empty() {
                match numbers.len() {
                    3 => Some(Shape::Triangle),
                    4 => Some(Shape::Quadrilateral),
                    _ => None,
                }
            } else {
                let said = lossy(said).to_lowercase();
                let known = SHAPES.iter().find(|(name, _)| *name == said);
                let Some((_, shape)) = known else {
                    let names: Vec<_> = SHAPES.iter().map(|(name, _)| *name).collect();
                    return Err(source.wrong(
                        line,
                        "shape",
                        &format!("one of {}", names.join(", ")),
                        &said,
                    ));
                };
                Some(*shape)
            };
            let Some(shape) = shape.filter(|shape| shape.corners() == numbers.len()) else {
                let wanted = match shape {
                    Some(shape) => shape.corners().to_string(),
                    None => "3 or 4, or their shape given".to_owned(),
                };
                let what = format!("nodes of element {element}");
                let found = numbers.len().to_string();
                return Err(source.wrong(line, &what, &wanted, &found));
            };
            self.builder.element(&source, element, shape, &numbers)?;
            if let Some(column) = set_column
                && !table.cell(column).is_empty()
            {
                let place = self.builder.element_sets.place(&lossy(table.cell(column)));
                self.builder
                    .element_sets
                    .push(&source, place, Member::Id(element))?;
            }
        }
        let mut mesh = self.builder.finish(&source)?;
        if let Some(moved) = &self.moved {
            mesh.displace(moved);
        }
        Ok(mesh)
    }
}

/// Reads a table of displacements; `file` is its name in messages.
///
/// # Errors
/// [`ReadError`] for a missing column, a cell that is no number, and a node that stands twice.
pub fn displacements(
    file: &str,
    bytes: &[u8],
    options: &ReadOptions,
) -> Result<Displacements, ReadError> {
    let source = Source { file, options };
    let mut table = Table::new(source, bytes)?;
    let id = table.needed("node")?;
    let columns = table.vector(["ux", "uy", "uz"])?;
    let mut moved = Displacements::default();
    let mut seen = HashSet::new();
    while let Some(line) = table.below()? {
        let node = source.id(line, "node", table.cell(id))?;
        if !seen.insert(node) {
            return Err(source.wrong(line, "node", "one that stands once", &node.to_string()));
        }
        source.at_most("nodes", seen.len() as u64, options.limits.nodes)?;
        moved.node_ids.push(node);
        moved.displacement_m.push(table.lengths(line, &columns)?);
    }
    Ok(moved)
}

/// A column of lengths: its place, its name, and its unit \[m\].
type Column = (usize, String, f64);

/// A table, row by row.
struct Table<'a> {
    source: Source<'a>,
    bytes: &'a [u8],
    reader: Reader<&'a [u8]>,
    names: Vec<String>,
    record: ByteRecord,
    /// Bytes up to which lines have been counted, and the line there.
    counted: (usize, usize),
}

impl<'a> Table<'a> {
    fn new(source: Source<'a>, bytes: &'a [u8]) -> Result<Self, ReadError> {
        source.check_bytes(bytes)?;
        let bytes = bytes.strip_prefix(b"\xEF\xBB\xBF").unwrap_or(bytes);
        let mut table = Self {
            source,
            bytes,
            reader: ReaderBuilder::new()
                .has_headers(false)
                .flexible(true)
                .trim(Trim::All)
                .comment(Some(b'#'))
                .from_reader(bytes),
            names: Vec::new(),
            record: ByteRecord::new(),
            counted: (0, 1),
        };
        if table.row()?.is_none() {
            return Err(source.whole(ReadProblem::Missing {
                what: "the header".to_owned(),
                wanted: "a line with the names of the columns".to_owned(),
            }));
        }
        table.names = table.record.iter().map(lossy).collect();
        Ok(table)
    }

    /// The next row and its line.
    fn row(&mut self) -> Result<Option<usize>, ReadError> {
        // Reading bytes from memory fails in no way but this; ragged rows are found by ourselves.
        match self.reader.read_byte_record(&mut self.record) {
            Ok(true) => {}
            Ok(false) => return Ok(None),
            Err(error) => {
                let reason = error.to_string();
                return Err(self.source.whole(ReadProblem::Unreadable { reason }));
            }
        }
        let at = self.record.position().map_or(0, ::csv::Position::byte);
        let mut at = usize::try_from(at)
            .unwrap_or(usize::MAX)
            .min(self.bytes.len());
        // The record is said to begin where the one before ended: skip empty lines and comments.
        loop {
            match self.bytes.get(at) {
                Some(b'\n' | b'\r') => at += 1,
                Some(b'#') => {
                    let rest = &self.bytes[at..];
                    at += rest.iter().position(|&b| b == b'\n').unwrap_or(rest.len());
                }
                _ => break,
            }
        }
        let (from, line) = self.counted;
        let passed = self.bytes[from.min(at)..at].iter();
        let line = line + passed.filter(|&&b| b == b'\n').count();
        self.counted = (at.max(from), line);
        Ok(Some(line))
    }

    /// The next row below the header, and its line.
    fn below(&mut self) -> Result<Option<usize>, ReadError> {
        let line = self.row()?;
        if let Some(line) = line
            && self.record.len() != self.names.len()
        {
            let wanted = format!("{}, as in the header", self.names.len());
            let found = self.record.len().to_string();
            let what = "number of cells";
            return Err(self.source.wrong(line, what, &wanted, &found));
        }
        Ok(line)
    }

    fn find(&self, name: &str) -> Option<usize> {
        self.names.iter().position(|n| n.eq_ignore_ascii_case(name))
    }

    fn missing(&self, name: &str) -> ReadError {
        let names: Vec<String> = self.names.iter().take(12).cloned().collect();
        let what = format!("column {name}");
        let wanted = format!("it beside [{}]", names.join(", "));
        self.source.error(1, ReadProblem::Missing { what, wanted })
    }

    fn needed(&self, name: &str) -> Result<usize, ReadError> {
        self.find(name).ok_or_else(|| self.missing(name))
    }

    fn length(&self, name: &str) -> Option<Column> {
        let unit = self.source.options.metres_per_unit();
        [("_m", 1.0), ("_mm", 0.001), ("", unit)]
            .into_iter()
            .find_map(|(ending, unit)| {
                let name = format!("{name}{ending}");
                Some((self.find(&name)?, name, unit))
            })
    }

    fn vector(&self, names: [&str; 3]) -> Result<[Column; 3], ReadError> {
        let [a, b, c] = names.map(|name| {
            self.length(name)
                .ok_or_else(|| self.missing(&format!("{name}_m")))
        });
        Ok([a?, b?, c?])
    }

    fn has_any(&self, names: [&str; 3]) -> bool {
        names.iter().any(|name| self.length(name).is_some())
    }

    fn cell(&self, column: usize) -> &[u8] {
        self.record.get(column).unwrap_or(b"")
    }

    fn lengths(&self, line: usize, columns: &[Column; 3]) -> Result<Vector, ReadError> {
        let mut out = [0.0; 3];
        for (out, (column, name, unit)) in out.iter_mut().zip(columns) {
            *out = self
                .source
                .length_of(line, name, self.cell(*column), *unit)?;
        }
        Ok(out)
    }
}
