//! Files in XML (VTK file formats, "XML file formats").

use std::borrow::Cow;

use quick_xml::Reader;
use quick_xml::events::{BytesStart, Event};

use super::array::{Kind, Number};
use super::cells::{Grid, NO_CELL, POLYGON};
use crate::mesh::error::{ReadError, ReadProblem};
use crate::mesh::text::{Source, lossy, whole};
use crate::mesh::vectors::Vectors;

/// How the numbers of an array are written.
#[derive(Debug, Clone, Copy)]
pub(super) enum Written<'a> {
    Text(&'a [u8]),
    Binary(&'a [u8]),
    Appended(usize),
}

/// An array as it stands in the file.
#[derive(Debug, Clone)]
pub(super) struct Array<'a> {
    pub(super) name: String,
    /// `None` for text and the like, which only matters if it is read.
    kind: Option<Kind>,
    components: u64,
    pub(super) written: Written<'a>,
    /// Byte of the file at which it stands.
    pub(super) at: usize,
}

/// A piece of the mesh: its arrays by the part they stand in.
#[derive(Debug, Default)]
struct Piece<'a> {
    points: u64,
    cells: u64,
    arrays: Vec<(String, Array<'a>)>,
}

pub(super) struct File<'a> {
    pub(super) source: Source<'a>,
    bytes: &'a [u8],
    pub(super) big_endian: bool,
    pub(super) wide_header: bool,
    pub(super) zlib: bool,
    pub(super) appended: &'a [u8],
    pub(super) appended_raw: bool,
    /// Bytes that have been unpacked so far.
    pub(super) unpacked: u64,
}

pub(super) fn read(
    source: Source<'_>,
    bytes: &[u8],
    vectors: Vectors<'_>,
    grid: &mut Grid,
) -> Result<(), ReadError> {
    let mut file = File {
        source,
        bytes,
        big_endian: false,
        wide_header: false,
        zlib: false,
        appended: b"",
        appended_raw: false,
        unpacked: 0,
    };
    let pieces = file.structure()?;
    for piece in &pieces {
        file.piece(piece, vectors, grid)?;
    }
    Ok(())
}

/// An attribute of an element; a name in quotes as it stands.
fn attribute<'e>(element: &'e BytesStart<'_>, name: &str) -> Option<Cow<'e, str>> {
    let found = element.try_get_attribute(name).ok().flatten();
    found.map(|attribute| attribute.value)
}

impl<'a> File<'a> {
    #[cold]
    pub(super) fn error(&self, at: usize, problem: ReadProblem) -> ReadError {
        let before = &self.bytes[..at.min(self.bytes.len())];
        let line = 1 + before.iter().filter(|&&b| b == b'\n').count();
        self.source.error(line, problem)
    }

    #[cold]
    pub(super) fn wrong(&self, at: usize, what: &str, wanted: &str, found: &str) -> ReadError {
        let (what, wanted, found) = (what.to_owned(), wanted.to_owned(), found.to_owned());
        self.error(
            at,
            ReadProblem::Wrong {
                what,
                wanted,
                found,
            },
        )
    }

    #[cold]
    fn unsupported(&self, at: usize, what: &str, found: &str, advice: &str) -> ReadError {
        let what = format!("{what} {found}");
        let advice = advice.to_owned();
        self.error(at, ReadProblem::Unsupported { what, advice })
    }

    /// Finds the arrays without reading them, up to the appended data.
    fn structure(&mut self) -> Result<Vec<Piece<'a>>, ReadError> {
        let bytes = self.bytes;
        let mut reader = Reader::from_reader(bytes);
        reader.config_mut().check_end_names = true;
        let mut pieces: Vec<Piece<'a>> = Vec::new();
        let mut part = String::new();
        let mut open: Option<(Array<'a>, usize)> = None;
        let mut is_file = false;
        let mut inside: Vec<String> = Vec::new();
        loop {
            let at = usize::try_from(reader.buffer_position()).unwrap_or(bytes.len());
            let event = reader.read_event().map_err(|error| {
                let (format, message) = ("XML", lossy(error.to_string().as_bytes()));
                self.error(at, ReadProblem::Syntax { format, message })
            })?;
            let after = usize::try_from(reader.buffer_position()).unwrap_or(bytes.len());
            let (element, empty) = match &event {
                Event::Start(element) => {
                    inside.push(element.name().as_ref().to_owned());
                    (element, false)
                }
                Event::Empty(element) => (element, true),
                Event::End(element) => {
                    inside.pop();
                    if element.name().as_ref() == "DataArray"
                        && let Some((mut array, from)) = open.take()
                    {
                        // Keys of information may stand behind the numbers.
                        let text = &bytes[from..at.max(from)];
                        let end = text.iter().position(|&b| b == b'<').unwrap_or(text.len());
                        let text = &text[..end];
                        match &mut array.written {
                            Written::Text(into) | Written::Binary(into) => *into = text,
                            Written::Appended(_) => {}
                        }
                        keep(&mut pieces, &part, array);
                    }
                    continue;
                }
                Event::Eof => {
                    // A file that was cut off can have lost its displacements.
                    if let Some(name) = inside.pop() {
                        let inside = format!("<{name}>");
                        return Err(self.error(bytes.len(), ReadProblem::Ended { inside }));
                    }
                    break;
                }
                _ => continue,
            };
            match element.name().as_ref() {
                "VTKFile" => {
                    is_file = true;
                    self.head(element, at)?;
                }
                "Piece" => {
                    let count = |name: &str| -> Result<u64, ReadError> {
                        let value = attribute(element, name).unwrap_or_default();
                        if value.is_empty() {
                            return Ok(0);
                        }
                        let wanted = "a whole number";
                        whole(value.as_bytes()).ok_or_else(|| self.wrong(at, name, wanted, &value))
                    };
                    let mut piece = Piece {
                        points: count("NumberOfPoints")?,
                        cells: count("NumberOfCells")?,
                        arrays: Vec::new(),
                    };
                    for name in [
                        "NumberOfPolys",
                        "NumberOfVerts",
                        "NumberOfLines",
                        "NumberOfStrips",
                    ] {
                        piece.cells = piece.cells.saturating_add(count(name)?);
                    }
                    pieces.push(piece);
                }
                "DataArray" => {
                    let array = self.array(element, at)?;
                    if empty {
                        keep(&mut pieces, &part, array);
                    } else {
                        open = Some((array, after));
                    }
                }
                "AppendedData" => {
                    let encoding = attribute(element, "encoding").unwrap_or_default();
                    self.appended_raw = match encoding.as_ref() {
                        "raw" => true,
                        "base64" => false,
                        other => {
                            return Err(self.wrong(at, "encoding", "raw or base64", other));
                        }
                    };
                    let rest = &bytes[after..];
                    let Some(mark) = rest.iter().position(|b| !b.is_ascii_whitespace()) else {
                        break;
                    };
                    if rest[mark] != b'_' {
                        let found = &rest[mark..rest.len().min(mark + 8)];
                        return Err(self.wrong(
                            after,
                            "the appended data",
                            "_ at their start",
                            &lossy(found),
                        ));
                    }
                    // Raw bytes are no XML: nothing is looked for behind them.
                    self.appended = &rest[mark + 1..];
                    break;
                }
                name @ ("PointData" | "CellData" | "Points" | "Cells" | "Verts" | "Lines"
                | "Strips" | "Polys" | "FieldData") => part = name.to_owned(),
                _ => {}
            }
        }
        if !is_file {
            let wanted = "an element VTKFile".to_owned();
            let what = "the file's head".to_owned();
            return Err(self.source.whole(ReadProblem::Missing { what, wanted }));
        }
        Ok(pieces)
    }

    fn head(&mut self, element: &BytesStart<'_>, at: usize) -> Result<(), ReadError> {
        let get = |name| attribute(element, name).unwrap_or_default();
        let kind = get("type");
        if !matches!(kind.as_ref(), "UnstructuredGrid" | "PolyData") {
            let advice = "write an unstructured grid (.vtu) or polygons (.vtp)";
            return Err(self.unsupported(at, "a file of type", &kind, advice));
        }
        self.big_endian = match get("byte_order").as_ref() {
            "BigEndian" => true,
            "LittleEndian" | "" => false,
            other => {
                let wanted = "LittleEndian or BigEndian";
                return Err(self.wrong(at, "byte_order", wanted, other));
            }
        };
        self.wide_header = match get("header_type").as_ref() {
            "UInt64" => true,
            "UInt32" | "" => false,
            other => return Err(self.wrong(at, "header_type", "UInt32 or UInt64", other)),
        };
        self.zlib = match get("compressor").as_ref() {
            "" => false,
            "vtkZLibDataCompressor" => true,
            other => {
                let advice = "write it with zlib or without compression";
                return Err(self.unsupported(at, "compressor", other, advice));
            }
        };
        Ok(())
    }

    fn array(&self, element: &BytesStart<'_>, at: usize) -> Result<Array<'a>, ReadError> {
        let get = |name| attribute(element, name).unwrap_or_default();
        let kind = get("type");
        let name = get("Name").into_owned();
        let kind = Kind::xml(kind.as_bytes());
        let components = get("NumberOfComponents");
        let components = if components.is_empty() {
            1
        } else {
            let wanted = "a whole number";
            whole(components.as_bytes())
                .ok_or_else(|| self.wrong(at, "NumberOfComponents", wanted, &components))?
        };
        let written = match get("format").as_ref() {
            "ascii" | "" => Written::Text(b""),
            "binary" => Written::Binary(b""),
            "appended" => {
                let offset = get("offset");
                let place = whole(offset.as_bytes()).and_then(|place| usize::try_from(place).ok());
                let wanted = "a whole number";
                Written::Appended(place.ok_or_else(|| self.wrong(at, "offset", wanted, &offset))?)
            }
            other => {
                let wanted = "ascii, binary or appended";
                return Err(self.wrong(at, "format", wanted, other));
            }
        };
        Ok(Array {
            name,
            kind,
            components,
            written,
            at,
        })
    }

    /// Reads the arrays of a piece that make the mesh.
    fn piece(
        &mut self,
        piece: &Piece<'a>,
        vectors: Vectors<'_>,
        grid: &mut Grid,
    ) -> Result<(), ReadError> {
        let base = grid.points_m.len() as u64;
        let first_cell = grid.cells.ends.len();
        for (part, array) in &piece.arrays {
            match part.as_str() {
                "Points" => {
                    let points = self.vectors_m(array, "Points", piece.points)?;
                    grid.points_m.extend(points);
                }
                "PointData" if array.components == 3 => {
                    if grid.vectors.len() < 100 && !grid.vectors.contains(&array.name) {
                        grid.vectors.push(array.name.clone());
                    }
                    if vectors.wants(&array.name) {
                        let moved = self.vectors_m(array, &array.name, piece.points)?;
                        grid.moved_m.extend(moved);
                        grid.has_moved = true;
                    }
                }
                _ => {}
            }
        }
        // In the order in which cells of polygon data count.
        for part in ["Cells", "Verts", "Lines", "Polys", "Strips"] {
            self.cells(piece, part, base, grid)?;
        }
        if (grid.cells.ends.len() - first_cell) as u64 != piece.cells {
            let found = (grid.cells.ends.len() - first_cell).to_string();
            let what = "number of cells".to_owned();
            let wanted = format!("{}, as the piece says", piece.cells);
            return Err(self.source.whole(ReadProblem::Wrong {
                what,
                wanted,
                found,
            }));
        }
        for (part, array) in &piece.arrays {
            if part == "CellData" && array.components == 1 && array.kind.is_some_and(Kind::is_whole)
            {
                let values = self.numbers(array)?;
                let values = values.iter().map(|n| n.place().map_or(-1, |p| p as i64));
                let row = grid.labels.iter().position(|label| label.0 == array.name);
                let row = row.unwrap_or_else(|| {
                    grid.labels.push((array.name.clone(), Vec::new()));
                    grid.labels.len() - 1
                });
                grid.labels[row].1.extend(values);
            }
        }
        Ok(())
    }

    fn cells(
        &mut self,
        piece: &Piece<'a>,
        part: &str,
        base: u64,
        grid: &mut Grid,
    ) -> Result<(), ReadError> {
        let find = |name: &str| {
            let mut arrays = piece.arrays.iter();
            arrays
                .find(|(of, array)| of == part && array.name == name)
                .map(|(_, array)| array)
        };
        let (Some(connectivity), Some(offsets)) = (find("connectivity"), find("offsets")) else {
            return Ok(());
        };
        let start = grid.cells.connectivity.len();
        for number in self.numbers(connectivity)? {
            // A point below zero is one that is not there.
            let place = number
                .place()
                .map_or(u64::MAX, |place| place.saturating_add(base));
            grid.cells.connectivity.push(place);
        }
        let mut last = start;
        for number in self.numbers(offsets)? {
            let end = number
                .place()
                .and_then(|p| usize::try_from(p).ok()?.checked_add(start));
            match end {
                Some(end) if end >= last && end <= grid.cells.connectivity.len() => last = end,
                _ => {
                    let wanted = "numbers that rise to the length of connectivity";
                    let found = number.real().to_string();
                    return Err(self.wrong(offsets.at, "offsets", wanted, &found));
                }
            }
            grid.cells.ends.push(last);
        }
        if last != grid.cells.connectivity.len() {
            let wanted = "numbers that rise to the length of connectivity";
            let found = (last - start).to_string();
            return Err(self.wrong(offsets.at, "offsets", wanted, &found));
        }
        match part {
            "Polys" => grid.types.resize(grid.cells.ends.len(), POLYGON),
            "Cells" => {
                let Some(types) = find("types") else {
                    let what = "the array types".to_owned();
                    let wanted = "the type of each cell".to_owned();
                    return Err(self.error(offsets.at, ReadProblem::Missing { what, wanted }));
                };
                for number in self.numbers(types)? {
                    grid.types.push(number.place().unwrap_or(NO_CELL));
                }
            }
            _ => grid.types.resize(grid.cells.ends.len(), NO_CELL),
        }
        Ok(())
    }

    fn vectors_m(
        &mut self,
        array: &Array<'a>,
        what: &str,
        count: u64,
    ) -> Result<Vec<[f64; 3]>, ReadError> {
        let numbers = self.numbers(array)?;
        if array.components != 3 || numbers.len() as u64 != count.saturating_mul(3) {
            let wanted = format!("{count} times 3 numbers");
            let found = format!("{} in tuples of {}", numbers.len(), array.components);
            return Err(self.wrong(array.at, what, &wanted, &found));
        }
        let mut out = Vec::with_capacity(numbers.len() / 3);
        for tuple in numbers.chunks_exact(3) {
            let at = [tuple[0].real(), tuple[1].real(), tuple[2].real()];
            out.push(self.source.point_m(what, at)?);
        }
        Ok(out)
    }

    /// All numbers of an array.
    fn numbers(&mut self, array: &Array<'a>) -> Result<Vec<Number>, ReadError> {
        let Some(kind) = array.kind else {
            let what = format!("type of {}", array.name);
            let wanted = "Float64, Int64 or another type of numbers";
            return Err(self.wrong(array.at, &what, wanted, "something else"));
        };
        if let Written::Text(text) = array.written {
            let words = text
                .split(u8::is_ascii_whitespace)
                .filter(|w| !w.is_empty());
            let number = |word: &[u8]| {
                let what = format!("a value of {}", array.name);
                let wanted = if kind.is_whole() {
                    "a whole number"
                } else {
                    "a number"
                };
                kind.word(word)
                    .ok_or_else(|| self.wrong(array.at, &what, wanted, &lossy(word)))
            };
            return words.map(number).collect();
        }
        let mut bytes = self.unpack(array)?;
        let size = kind.bytes();
        if !bytes.len().is_multiple_of(size) {
            let wanted = format!("a multiple of {size} bytes");
            let found = bytes.len().to_string();
            return Err(self.wrong(array.at, &array.name, &wanted, &found));
        }
        if self.big_endian {
            bytes.chunks_exact_mut(size).for_each(<[u8]>::reverse);
        }
        Ok(bytes.chunks_exact(size).map(|b| kind.number(b)).collect())
    }
}

fn keep<'a>(pieces: &mut [Piece<'a>], part: &str, array: Array<'a>) {
    if let Some(piece) = pieces.last_mut() {
        piece.arrays.push((part.to_owned(), array));
    }
}
