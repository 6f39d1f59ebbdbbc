//! Input files of CalculiX and Abaqus.
//!
//! Read are `*NODE`, `*ELEMENT`, `*NSET`, `*ELSET` (also `GENERATE` and sets within sets), `*SURFACE` and
//! `*INCLUDE`; what else a model says (materials, steps, loads) is left aside. Shells, membranes and solids
//! are kept, linear ones and the corners of quadratic ones; beams, springs and the like are counted in
//! [`Faults::skipped`](super::Faults::skipped). Of an Abaqus assembly one part is read if its instance
//! stands where it was drawn.
//!
//! Refused by name, because the nodes would be elsewhere or missing: nodes in other than Cartesian
//! coordinates, generated or copied nodes and elements, instances that are moved, several parts.

mod keyword;

use std::io;

use self::keyword::{Keyword, Kind, kind};
use super::Mesh;
use super::build::{Builder, Member, RawSets};
use super::error::{ReadError, ReadProblem};
use super::options::ReadOptions;
use super::text::{Lines, Source, cells, lossy, trim, whole};

/// How deep files may include files.
const MOST_DEPTH: usize = 8;
/// Nodes of the largest element read.
const MOST_NODES: usize = 27;
/// Bytes of a keyword line with its continuations.
const MOST_KEYWORD: usize = 1 << 16;

/// Reads a model that includes no other file; `file` is its name in messages.
///
/// # Errors
/// [`ReadError`] for text that breaks the format, for an `*INCLUDE`, and beyond the limits of `options`.
///
/// ```
/// use helio_flux::mesh::{ReadOptions, inp};
/// let model = b"*NODE\n1,0,0,0\n2,1000,0,0\n3,0,1000,0\n*ELEMENT,TYPE=S3,ELSET=GLASS\n7,1,2,3\n";
/// let mesh = inp::mesh("model.inp", model, &ReadOptions::in_units_of(0.001)?)?;
/// assert_eq!(mesh.position_m()[1], [1.0, 0.0, 0.0]);
/// assert_eq!(mesh.element_set("glass")?, [7]);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn mesh(file: &str, bytes: &[u8], options: &ReadOptions) -> Result<Mesh, ReadError> {
    mesh_with(file, bytes, options, &mut |_| {
        Err(io::Error::other("included files are not opened here"))
    })
}

/// Reads a model with the files it includes, each of which `open` is asked for by the name that stands
/// in the `*INCLUDE`.
///
/// # Errors
/// As [`mesh`], and where `open` fails or files include each other more than eight deep.
pub fn mesh_with(
    file: &str,
    bytes: &[u8],
    options: &ReadOptions,
    open: &mut dyn FnMut(&str) -> io::Result<Vec<u8>>,
) -> Result<Mesh, ReadError> {
    let source = Source { file, options };
    let mut reader = Reader {
        builder: Builder::default(),
        block: Block::Other,
        parts: 0,
        in_assembly: false,
        bytes: 0,
        includes: 0,
        open,
    };
    reader.file(source, bytes, 0)?;
    reader.end(&source)?;
    reader.builder.finish(&source)
}

/// What the data lines belong to.
#[derive(Debug)]
enum Block {
    Other,
    Node {
        set: Option<usize>,
    },
    Element {
        kind: Kind,
        name: String,
        set: Option<usize>,
        /// The line on which an element began, and its numbers so far.
        begun: usize,
        numbers: Vec<u64>,
    },
    NodeSet {
        place: usize,
        generate: bool,
    },
    ElementSet {
        place: usize,
        generate: bool,
    },
    Surface {
        place: usize,
    },
    /// Data of an instance: where it stands.
    Instance,
}

struct Reader<'o> {
    builder: Builder,
    block: Block,
    parts: usize,
    /// In an `*ASSEMBLY`, outside its `*INSTANCE`: numbers there are those of other nodes and elements.
    in_assembly: bool,
    bytes: u64,
    includes: u64,
    open: &'o mut dyn FnMut(&str) -> io::Result<Vec<u8>>,
}

impl Reader<'_> {
    fn file(&mut self, source: Source<'_>, bytes: &[u8], depth: usize) -> Result<(), ReadError> {
        self.bytes = self.bytes.saturating_add(bytes.len() as u64);
        source.at_most("bytes", self.bytes, source.options.limits.bytes)?;
        let mut lines = Lines::new(bytes);
        while let Some(text) = lines.next() {
            let text = trim(text);
            if text.is_empty() || text.starts_with(b"**") {
                continue;
            }
            if text.starts_with(b"*") {
                self.keyword(source, text, &mut lines, depth)?;
            } else {
                self.data(&source, lines.line(), text)?;
            }
        }
        Ok(())
    }

    fn keyword(
        &mut self,
        source: Source<'_>,
        text: &[u8],
        lines: &mut Lines<'_>,
        depth: usize,
    ) -> Result<(), ReadError> {
        let line = lines.line();
        self.end(&source)?;
        let mut whole_line = text.to_vec();
        // A keyword line that ends with a comma goes on.
        while whole_line.ends_with(b",") && whole_line.len() < MOST_KEYWORD {
            let Some(more) = lines.clone().next() else {
                break;
            };
            if trim(more).starts_with(b"*") {
                break;
            }
            lines.next();
            whole_line.extend_from_slice(trim(more));
        }
        let keyword = Keyword::parse(&String::from_utf8_lossy(&whole_line));
        let unsupported = |what: String, advice: &str| {
            let advice = advice.to_owned();
            Err(source.error(line, ReadProblem::Unsupported { what, advice }))
        };
        // Reference points and springs of an assembly count from 1 like the part's own nodes.
        let foreign = self.in_assembly && keyword.get("INSTANCE").is_none();
        self.block = match keyword.name.as_str() {
            "NODE" | "ELEMENT" if foreign => Block::Other,
            "NODE" => {
                let system = keyword.get("SYSTEM").unwrap_or("R");
                if !system.eq_ignore_ascii_case("R") {
                    let what = format!("*NODE, SYSTEM={system}");
                    return unsupported(what, "write the nodes in Cartesian coordinates");
                }
                let set = keyword.get("NSET");
                let set = set.map(|name| self.builder.node_sets.place(name));
                Block::Node { set }
            }
            "ELEMENT" => {
                let name = needed(&source, line, &keyword, "TYPE", "the type of the elements")?;
                let set = keyword.get("ELSET");
                Block::Element {
                    kind: kind(name),
                    name: name.to_uppercase(),
                    set: set.map(|name| self.builder.element_sets.place(name)),
                    begun: 0,
                    numbers: Vec::new(),
                }
            }
            "NSET" => {
                let name = needed(&source, line, &keyword, "NSET", "the name of the set")?;
                let place = self.builder.node_sets.place(name);
                let generate = keyword.get("GENERATE").is_some();
                if foreign {
                    Block::Other
                } else {
                    Block::NodeSet { place, generate }
                }
            }
            "ELSET" => {
                let name = needed(&source, line, &keyword, "ELSET", "the name of the set")?;
                let place = self.builder.element_sets.place(name);
                let generate = keyword.get("GENERATE").is_some();
                Block::ElementSet { place, generate }
            }
            "SURFACE" => {
                let name = needed(&source, line, &keyword, "NAME", "the name of the surface")?;
                match keyword
                    .get("TYPE")
                    .unwrap_or("ELEMENT")
                    .to_uppercase()
                    .as_str()
                {
                    "ELEMENT" => {
                        let place = self.builder.surface(name);
                        Block::Surface { place }
                    }
                    "NODE" => {
                        let place = self.builder.node_sets.place(name);
                        let generate = false;
                        Block::NodeSet { place, generate }
                    }
                    _ => Block::Other,
                }
            }
            "PART" => {
                self.parts += 1;
                if self.parts > 1 {
                    return unsupported(
                        "a second *PART".to_owned(),
                        "write the model without parts and assembly, or each part by itself",
                    );
                }
                Block::Other
            }
            "ASSEMBLY" | "ENDINSTANCE" | "ENDASSEMBLY" => {
                self.in_assembly = keyword.name != "ENDASSEMBLY";
                Block::Other
            }
            "INSTANCE" => {
                self.in_assembly = false;
                Block::Instance
            }
            "NGEN" | "NFILL" | "NCOPY" | "NMAP" | "ELGEN" | "ELCOPY" | "SYSTEM" => {
                let advice = "write every node and element in the global frame";
                return unsupported(format!("*{}", keyword.name), advice);
            }
            "INCLUDE" => {
                let name = needed(&source, line, &keyword, "INPUT", "the file to include")?;
                self.include(&source, line, name, depth)?;
                Block::Other
            }
            _ => Block::Other,
        };
        Ok(())
    }

    fn include(
        &mut self,
        source: &Source<'_>,
        line: usize,
        name: &str,
        depth: usize,
    ) -> Result<(), ReadError> {
        self.includes += 1;
        let too_many =
            |what, found, most| source.error(line, ReadProblem::TooMany { what, found, most });
        if depth >= MOST_DEPTH {
            let found = depth as u64 + 1;
            return Err(too_many("levels of *INCLUDE", found, MOST_DEPTH as u64));
        }
        let most = source.options.limits.includes;
        if self.includes > most {
            return Err(too_many("included files", self.includes, most));
        }
        let bytes = (self.open)(name).map_err(|error| {
            let reason = format!("{}: {error}", lossy(name.as_bytes()));
            source.error(line, ReadProblem::Unreadable { reason })
        })?;
        let inner = Source {
            file: name,
            options: source.options,
        };
        self.file(inner, &bytes, depth + 1)?;
        self.end(&inner)
    }

    /// The end of a block: an element must not be cut short.
    fn end(&self, source: &Source<'_>) -> Result<(), ReadError> {
        let Block::Element {
            kind: Kind::Known(_, wanted),
            name,
            begun,
            numbers,
            ..
        } = &self.block
        else {
            return Ok(());
        };
        if numbers.is_empty() {
            return Ok(());
        }
        let what = format!("nodes of element {}", numbers[0]);
        let wanted = format!("{wanted} ({name})");
        let found = (numbers.len() - 1).to_string();
        Err(source.wrong(*begun, &what, &wanted, &found))
    }

    fn data(&mut self, source: &Source<'_>, line: usize, text: &[u8]) -> Result<(), ReadError> {
        match &mut self.block {
            Block::Other => Ok(()),
            Block::Instance => Err(source.error(
                line,
                ReadProblem::Unsupported {
                    what: "an *INSTANCE that is moved".to_owned(),
                    advice: "write the model without parts and assembly".to_owned(),
                },
            )),
            Block::Node { set } => {
                let mut cells = cells(text);
                let id = source.id(line, "node number", cells.next().unwrap_or(b""))?;
                let mut at_m = [0.0; 3];
                for (at_m, axis) in at_m.iter_mut().zip(["x", "y", "z"]) {
                    // A coordinate left out is zero, as for the solvers.
                    if let Some(cell) = cells.next().filter(|cell| !cell.is_empty()) {
                        *at_m = source.length_m(line, &format!("{axis} of node {id}"), cell)?;
                    }
                }
                self.builder.node(source, line, id, at_m)?;
                if let Some(set) = *set {
                    self.builder.node_sets.push(source, set, Member::Id(id))?;
                }
                Ok(())
            }
            Block::Element {
                kind: Kind::Other,
                name,
                ..
            } => {
                // Which of the lines begin an element is not known for a foreign type: count those with
                // a number in front.
                if whole(cells(text).next().unwrap_or(b"")).is_some() {
                    self.builder.skip(name);
                }
                Ok(())
            }
            Block::Element {
                kind: Kind::Known(shape, wanted),
                name,
                set,
                begun,
                numbers,
            } => {
                for cell in cells(text) {
                    if numbers.is_empty() {
                        *begun = line;
                    }
                    let what = if numbers.is_empty() {
                        "element number"
                    } else {
                        "node of an element"
                    };
                    numbers.push(source.id(line, what, cell)?);
                    if numbers.len() > *wanted + 1 || numbers.len() > MOST_NODES + 1 {
                        let what = format!("nodes of element {}", numbers[0]);
                        let wanted = format!("{wanted} ({name})");
                        return Err(source.wrong(line, &what, &wanted, "more"));
                    }
                }
                if numbers.len() == *wanted + 1 {
                    let id = numbers[0];
                    self.builder.element(source, id, *shape, &numbers[1..])?;
                    if let Some(set) = *set {
                        self.builder
                            .element_sets
                            .push(source, set, Member::Id(id))?;
                    }
                    numbers.clear();
                }
                Ok(())
            }
            Block::NodeSet { place, generate } => {
                let sets = &mut self.builder.node_sets;
                members(source, line, text, *generate, sets, *place)
            }
            Block::ElementSet { place, generate } => {
                let sets = &mut self.builder.element_sets;
                members(source, line, text, *generate, sets, *place)
            }
            Block::Surface { place } => {
                let place = *place;
                self.surface(source, line, text, place)
            }
        }
    }

    fn surface(
        &mut self,
        source: &Source<'_>,
        line: usize,
        text: &[u8],
        place: usize,
    ) -> Result<(), ReadError> {
        let mut cells = cells(text);
        let who = cells.next().unwrap_or(b"");
        let label = lossy(cells.next().unwrap_or(b"")).to_uppercase();
        let face = match label.as_str() {
            "SPOS" | "SNEG" => 0,
            _ => match label.strip_prefix('S').and_then(|n| n.parse().ok()) {
                Some(face @ 1..=6) => face - 1,
                _ => {
                    let wanted = "S1 to S6, SPOS or SNEG";
                    return Err(source.wrong(line, "face of a surface", wanted, &label));
                }
            },
        };
        let Some(member) = member(who, &self.builder.element_sets) else {
            let wanted = "an element number or a set defined above";
            return Err(source.wrong(line, "member of a surface", wanted, &lossy(who)));
        };
        self.builder.surface_member(place, member, face);
        Ok(())
    }
}

/// A number, or the name of a set; both also behind the name of an instance and a dot.
fn member(cell: &[u8], sets: &RawSets) -> Option<Member> {
    if let Some(id) = whole(cell) {
        return Some(Member::Id(id));
    }
    let name = lossy(cell);
    let name = name.trim_matches('"');
    if let Some(set) = sets.find(name) {
        return Some(Member::Set(set));
    }
    let (_, local) = name.rsplit_once('.')?;
    match whole(local.as_bytes()) {
        Some(id) => Some(Member::Id(id)),
        None => sets.find(local).map(Member::Set),
    }
}

/// The members on a line of a set.
fn members(
    source: &Source<'_>,
    line: usize,
    text: &[u8],
    generate: bool,
    sets: &mut RawSets,
    place: usize,
) -> Result<(), ReadError> {
    if generate {
        let mut numbers = [1, 1, 1];
        let mut count = 0;
        for cell in cells(text).filter(|cell| !cell.is_empty()) {
            if count == 3 {
                let wanted = "from, to and step";
                return Err(source.wrong(line, "GENERATE", wanted, &lossy(text)));
            }
            numbers[count] = source.id(line, "number of GENERATE", cell)?;
            count += 1;
        }
        let [from, mut to, step] = numbers;
        if count == 1 {
            to = from;
        }
        return sets.push(source, place, Member::Range(from, to, step));
    }
    for cell in cells(text).filter(|cell| !cell.is_empty()) {
        let member = member(cell, sets);
        let Some(member) = member else {
            let wanted = "a number or a set defined above";
            return Err(source.wrong(line, "member of a set", wanted, &lossy(cell)));
        };
        sets.push(source, place, member)?;
    }
    Ok(())
}

fn needed<'k>(
    source: &Source<'_>,
    line: usize,
    keyword: &'k Keyword,
    key: &str,
    wanted: &str,
) -> Result<&'k str, ReadError> {
    match keyword.get(key) {
        Some(value) if !value.is_empty() => Ok(value),
        _ => Err(source.error(
            line,
            ReadProblem::Missing {
                what: format!("{key} of *{}", keyword.name),
                wanted: wanted.to_owned(),
            },
        )),
    }
}
