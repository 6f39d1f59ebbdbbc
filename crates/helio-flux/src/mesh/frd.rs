//! Result files of CalculiX, as text.
//!
//! The format is that of the CalculiX GraphiX manual ("Result Format", in fixed columns). It writes numbers
//! with six digits: a displacement of 18 mm comes to 0.1 µm, but a position at 1 m to 10 µm only. So take
//! the positions from the `.inp` and the displacements alone from here: over a face of 5 mm the slopes are
//! then good to some 20 µrad.
//!
//! Write displacements with `*NODE FILE` and `U`, in the global frame. Of shells ask for
//! `*NODE FILE, OUTPUT=2D`, or CalculiX writes the nodes of the solids it makes of them, which the model
//! does not have. Binary files (`*NODE OUTPUT`) are refused.

use std::collections::HashSet;

use super::build::Builder;
use super::error::{ReadError, ReadProblem};
use super::options::ReadOptions;
use super::shape::Shape;
use super::text::{Lines, Source, lossy, trim, whole};
use super::{Displacements, Mesh};
use crate::vector::Vector;

/// Which of the results of a file.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
#[non_exhaustive]
pub enum Step {
    /// The last one that is no eigenmode.
    #[default]
    Last,
    /// The one of this number, as the file counts them.
    Number(u64),
}

/// Reads the displacements of a step; `file` is the name in messages.
///
/// # Errors
/// [`ReadError`] for a file that breaks the format or is binary, and without displacements of that step.
///
/// ```
/// use helio_flux::mesh::{ReadOptions, frd};
/// let results = [
///     "    1C",
///     "  100CL  101 1.000000000           2                     0    1           1",
///     " -4  DISP        4    1",
///     " -5  D1          1    2    1    0",
///     " -1         1 0.00000E+00 0.00000E+00 0.00000E+00",
///     " -1         2 1.00000E-03 0.00000E+00-2.50000E-02",
///     " -3",
///     " 9999",
/// ]
/// .join("\n");
/// let results = results.as_bytes();
/// let moved = frd::displacements("beam.frd", results, frd::Step::Last, &ReadOptions::default())?;
/// assert_eq!(moved.node_ids(), [1, 2]);
/// assert_eq!(moved.displacement_m()[1], [0.001, 0.0, -0.025]);
/// # Ok::<(), helio_flux::mesh::ReadError>(())
/// ```
pub fn displacements(
    file: &str,
    bytes: &[u8],
    step: Step,
    options: &ReadOptions,
) -> Result<Displacements, ReadError> {
    let source = Source { file, options };
    source.check_bytes(bytes)?;
    let mut lines = Lines::new(bytes);
    let mut header: Option<Header> = None;
    let mut found: Option<Displacements> = None;
    let mut steps = Vec::new();
    let mut modes = 0_u64;
    while let Some(text) = lines.next() {
        match key(text) {
            b"100" => header = Some(Header::parse(&source, lines.line(), text)?),
            b"2" | b"3" => refuse_binary(&source, lines.line(), text, 73)?,
            b"-4" if trim(columns(text, 5, 13)) == b"DISP" => {
                let Some(header) = &header else {
                    let wanted = "a line 100C above it";
                    return Err(source.wrong(lines.line(), "DISP", wanted, "none"));
                };
                if header.mode {
                    modes += 1;
                    continue;
                }
                steps.push(header.step);
                let wanted = match step {
                    Step::Last => true,
                    Step::Number(number) => number == header.step,
                };
                if wanted {
                    found = Some(block(&source, &mut lines, header.id_columns)?);
                }
            }
            _ => {}
        }
    }
    found.ok_or_else(|| {
        steps.dedup();
        let there: Vec<_> = steps.iter().take(8).map(u64::to_string).collect();
        let wanted = match step {
            Step::Number(number) if !there.is_empty() => {
                format!("step {number}, and the file has [{}]", there.join(", "))
            }
            _ if modes > 0 => "those of a load; the file has eigenmodes only".to_owned(),
            _ => "a block DISP (from *NODE FILE with U)".to_owned(),
        };
        source.whole(ReadProblem::Missing {
            what: "a block of displacements".to_owned(),
            wanted,
        })
    })
}

/// Reads the numbers of the nodes and where they are \[m\], to six digits; empty for results without them.
/// `file` is the name in messages.
///
/// # Errors
/// [`ReadError`] for a file that breaks the format or is binary.
///
/// ```
/// use helio_flux::mesh::{ReadOptions, frd};
/// let results = b"    1C\n    2C                             1                                     1\n \
///     -1         7 1.00000E+00 0.00000E+00 2.00000E+00\n -3\n 9999\n";
/// let nodes = frd::positions("beam.frd", results, &ReadOptions::default())?;
/// assert_eq!(nodes, [(7, [1.0, 0.0, 2.0])]);
/// # Ok::<(), helio_flux::mesh::ReadError>(())
/// ```
pub fn positions(
    file: &str,
    bytes: &[u8],
    options: &ReadOptions,
) -> Result<Vec<(u64, [f64; 3])>, ReadError> {
    let source = Source { file, options };
    source.check_bytes(bytes)?;
    let mut lines = Lines::new(bytes);
    let mut nodes = Vec::new();
    while let Some(text) = lines.next() {
        if key(text) == b"2" {
            refuse_binary(&source, lines.line(), text, 73)?;
            let columns = id_columns(text, 73);
            points(&source, &mut lines, columns, "the nodes", |_, id, at_m| {
                let count = nodes.len() as u64 + 1;
                source.at_most("nodes", count, source.options.limits.nodes)?;
                nodes.push((id, at_m));
                Ok(())
            })?;
        }
    }
    Ok(nodes)
}

/// Reads nodes and elements; `file` is the name in messages.
///
/// For a model of which the input is lost. The positions have six digits.
///
/// # Errors
/// [`ReadError`] for a file that breaks the format or is binary.
pub fn mesh(file: &str, bytes: &[u8], options: &ReadOptions) -> Result<Mesh, ReadError> {
    let source = Source { file, options };
    source.check_bytes(bytes)?;
    let mut lines = Lines::new(bytes);
    let mut builder = Builder::default();
    while let Some(text) = lines.next() {
        match key(text) {
            b"2" if text.get(5) == Some(&b'C') => {
                refuse_binary(&source, lines.line(), text, 73)?;
                let id_columns = id_columns(text, 73);
                points(
                    &source,
                    &mut lines,
                    id_columns,
                    "the nodes",
                    |line, id, at_m| builder.node(&source, line, id, at_m),
                )?;
            }
            b"3" if text.get(5) == Some(&b'C') => {
                refuse_binary(&source, lines.line(), text, 73)?;
                elements(&source, &mut lines, id_columns(text, 73), &mut builder)?;
            }
            _ => {}
        }
    }
    builder.finish(&source)
}

/// Columns of a line, counted from 0, as far as it goes.
fn columns(text: &[u8], from: usize, to: usize) -> &[u8] {
    let to = to.min(text.len());
    &text[from.min(to)..to]
}

/// The key in columns 1 to 4: `-1` to `-5`, or a number before a C.
fn key(text: &[u8]) -> &[u8] {
    if text.get(5) == Some(&b'C') {
        trim(columns(text, 1, 5))
    } else if text.first() == Some(&b' ') && text.get(1) == Some(&b'-') {
        columns(text, 1, 3)
    } else {
        b""
    }
}

/// Width of the numbers of nodes: 5 columns in the short format, 10 in the long one.
fn id_columns(text: &[u8], at: usize) -> usize {
    if trim(columns(text, at, at + 2)) == b"0" {
        5
    } else {
        10
    }
}

fn refuse_binary(
    source: &Source<'_>,
    line: usize,
    text: &[u8],
    at: usize,
) -> Result<(), ReadError> {
    if matches!(trim(columns(text, at, at + 2)), b"2" | b"3") {
        return Err(source.error(
            line,
            ReadProblem::Unsupported {
                what: "a binary .frd file".to_owned(),
                advice: "write it as text, with *NODE FILE instead of *NODE OUTPUT".to_owned(),
            },
        ));
    }
    Ok(())
}

/// What a line `100C` says of the block below it.
#[derive(Debug)]
struct Header {
    step: u64,
    /// An eigenmode is no displacement under a load.
    mode: bool,
    id_columns: usize,
}

impl Header {
    fn parse(source: &Source<'_>, line: usize, text: &[u8]) -> Result<Self, ReadError> {
        refuse_binary(source, line, text, 73)?;
        let step = columns(text, 58, 63);
        Ok(Self {
            step: whole(step).ok_or_else(|| {
                source.wrong(line, "number of the step", "a whole number", &lossy(step))
            })?,
            mode: trim(columns(text, 56, 58)) == b"2",
            id_columns: id_columns(text, 73),
        })
    }
}

/// The lines `-1` up to `-3`: number of a node and three lengths in 12 columns each.
fn points(
    source: &Source<'_>,
    lines: &mut Lines<'_>,
    id_columns: usize,
    what: &str,
    mut take: impl FnMut(usize, u64, Vector) -> Result<(), ReadError>,
) -> Result<(), ReadError> {
    while let Some(text) = lines.next() {
        let line = lines.line();
        match key(text) {
            b"-1" => {
                let first = 3 + id_columns;
                let id = source.id(line, "node number", columns(text, 3, first))?;
                let mut at_m = [0.0; 3];
                for (k, at_m) in at_m.iter_mut().enumerate() {
                    let from = first + 12 * k;
                    let name = format_args!("{} of node {id}", ["x", "y", "z"][k]).to_string();
                    *at_m = source.length_m(line, &name, columns(text, from, from + 12))?;
                }
                take(line, id, at_m)?;
            }
            b"-3" => return Ok(()),
            b"-4" | b"-5" => {}
            _ => {
                let wanted = "lines that begin with -1, and -3 at their end";
                return Err(source.wrong(line, what, wanted, &lossy(text)));
            }
        }
    }
    Err(source.whole(ReadProblem::Ended {
        inside: what.to_owned(),
    }))
}

fn block(
    source: &Source<'_>,
    lines: &mut Lines<'_>,
    id_columns: usize,
) -> Result<Displacements, ReadError> {
    let mut moved = Displacements::default();
    let mut seen = HashSet::new();
    points(
        source,
        lines,
        id_columns,
        "the displacements",
        |line, id, by_m| {
            if !seen.insert(id) {
                let (what, wanted) = ("node number", "one that stands once");
                return Err(source.wrong(line, what, wanted, &id.to_string()));
            }
            source.at_most("nodes", seen.len() as u64, source.options.limits.nodes)?;
            moved.node_ids.push(id);
            moved.displacement_m.push(by_m);
            Ok(())
        },
    )?;
    Ok(moved)
}

/// Shapes by the type numbers of the format, and how many nodes they have; beams are 11 and 12.
fn shape(kind: u64) -> Option<(Shape, usize)> {
    Some(match kind {
        1 => (Shape::Hexahedron, 8),
        2 => (Shape::Wedge, 6),
        3 => (Shape::Tetrahedron, 4),
        4 => (Shape::Hexahedron, 20),
        5 => (Shape::Wedge, 15),
        6 => (Shape::Tetrahedron, 10),
        7 => (Shape::Triangle, 3),
        8 => (Shape::Triangle, 6),
        9 => (Shape::Quadrilateral, 4),
        10 => (Shape::Quadrilateral, 8),
        _ => return None,
    })
}

fn elements(
    source: &Source<'_>,
    lines: &mut Lines<'_>,
    id_columns: usize,
    builder: &mut Builder,
) -> Result<(), ReadError> {
    // Line, number, type and nodes so far of the element that is being read.
    let mut open: Option<(usize, u64, u64, Vec<u64>)> = None;
    let per_line = if id_columns == 5 { 15 } else { 10 };
    while let Some(text) = lines.next() {
        let line = lines.line();
        match key(text) {
            key @ (b"-1" | b"-3") => {
                if let Some((line, id, kind, _)) = open.take() {
                    let what = format!("nodes of element {id} of type {kind}");
                    return Err(source.wrong(line, &what, "complete", "fewer"));
                }
                if key == b"-3" {
                    return Ok(());
                }
                let first = 3 + id_columns;
                let id = source.id(line, "element number", columns(text, 3, first))?;
                let of_type = columns(text, first, first + 5);
                let kind = source.id(line, "type of the element", of_type)?;
                if shape(kind).is_some() {
                    open = Some((line, id, kind, Vec::new()));
                } else {
                    builder.skip(&format!("frd {kind}"));
                }
            }
            b"-2" => {
                let Some((begun, id, kind, mut nodes)) = open.take() else {
                    continue;
                };
                for k in 0..per_line {
                    let from = 3 + k * id_columns;
                    let cell = columns(text, from, from + id_columns);
                    if trim(cell).is_empty() {
                        break;
                    }
                    nodes.push(source.id(line, "node of an element", cell)?);
                }
                match shape(kind) {
                    Some((shape, wanted)) if nodes.len() >= wanted => {
                        builder.element(source, id, shape, &nodes)?;
                    }
                    _ => open = Some((begun, id, kind, nodes)),
                }
            }
            _ => {
                let wanted = "lines that begin with -1 or -2, and -3 at their end";
                return Err(source.wrong(line, "the elements", wanted, &lossy(text)));
            }
        }
    }
    Err(source.whole(ReadProblem::Ended {
        inside: "the elements".to_owned(),
    }))
}
