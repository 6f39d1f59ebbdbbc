//! Legacy files (VTK file formats, "Simple legacy formats"), as text or binary.

use super::array::{Kind, Number};
use super::cells::{Cells, Grid, NO_CELL, POLYGON};
use crate::mesh::error::{ReadError, ReadProblem};
use crate::mesh::scan::Scan;
use crate::mesh::text::lossy;
use crate::mesh::vectors::Vectors;

/// What the arrays after `POINT_DATA` or `CELL_DATA` belong to.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Of {
    Nothing,
    Points,
    Cells,
}

pub(super) fn read(
    scan: &mut Scan<'_>,
    vectors: Vectors<'_>,
    grid: &mut Grid,
) -> Result<(), ReadError> {
    let source = scan.source;
    let header = scan.rest_of_line();
    let Some(version) = header.strip_prefix(b"# vtk DataFile Version ") else {
        let wanted = "# vtk DataFile Version, or XML";
        return Err(source.wrong(1, "the first line", wanted, &lossy(header)));
    };
    let of_5 = version
        .trim_ascii()
        .first()
        .is_some_and(|digit| *digit >= b'5');
    scan.rest_of_line(); // the title
    let mut file = File {
        binary: false,
        of_5,
        is_polygons: false,
        vectors,
    };
    let word = scan.needed("the kind of file")?;
    match word {
        b"ASCII" => {}
        b"BINARY" => {
            file.binary = true;
            scan.set_big_endian();
        }
        other => {
            let line = scan.line();
            return Err(source.wrong(line, "kind of file", "ASCII or BINARY", &lossy(other)));
        }
    }
    let mut of = (Of::Nothing, 0);
    // Vertices, lines, polygons and strips: in this order they count, wherever they stand.
    let mut parts: [Cells; 4] = Default::default();
    while let Some(word) = scan.word() {
        let line = scan.line();
        match word.to_ascii_uppercase().as_slice() {
            b"DATASET" => {
                let kind = scan.needed("DATASET")?;
                file.is_polygons = match kind {
                    b"UNSTRUCTURED_GRID" => false,
                    b"POLYDATA" => true,
                    other => return Err(unsupported(scan, "a data set", other)),
                };
            }
            b"POINTS" => {
                let count = scan.whole("number of points")?;
                let kind = file.kind(scan)?;
                file.vectors_m(scan, kind, count, "points", &mut grid.points_m)?;
            }
            b"CELLS" => file.cells(scan, &mut grid.cells)?,
            b"VERTICES" if file.is_polygons => file.cells(scan, &mut parts[0])?,
            b"LINES" if file.is_polygons => file.cells(scan, &mut parts[1])?,
            b"POLYGONS" if file.is_polygons => file.cells(scan, &mut parts[2])?,
            b"TRIANGLE_STRIPS" if file.is_polygons => file.cells(scan, &mut parts[3])?,
            b"CELL_TYPES" => {
                let count = scan.whole("number of cell types")?;
                let types = &mut grid.types;
                file.numbers(scan, Kind::I32, count, "cell types", |scan, number| {
                    let place = number.place();
                    types.push(place.ok_or_else(|| negative(scan, "cell type", number))?);
                    Ok(())
                })?;
            }
            b"POINT_DATA" => of = (Of::Points, scan.whole("number of points")?),
            b"CELL_DATA" => of = (Of::Cells, scan.whole("number of cells")?),
            b"METADATA" => skip_metadata(scan),
            b"FIELD" => file.field(scan, of.0, grid)?,
            b"SCALARS"
            | b"VECTORS"
            | b"NORMALS"
            | b"TEXTURE_COORDINATES"
            | b"TENSORS"
            | b"TENSORS6"
            | b"COLOR_SCALARS"
            | b"GLOBAL_IDS"
            | b"PEDIGREE_IDS" => {
                file.attribute(scan, word, of, grid)?;
            }
            b"LOOKUP_TABLE" => {
                scan.needed("LOOKUP_TABLE")?;
                let count = scan.whole("colours of a LOOKUP_TABLE")?;
                let kind = if file.binary { Kind::U8 } else { Kind::F32 };
                let values = count.saturating_mul(4);
                file.numbers(scan, kind, values, "colours", |_, _| Ok(()))?;
            }
            _ => {
                let wanted = "a word like POINTS, CELLS or POINT_DATA";
                return Err(source.wrong(line, "a section", wanted, &lossy(word)));
            }
        }
    }
    if file.is_polygons {
        for (part, number) in parts.iter().zip([NO_CELL, NO_CELL, POLYGON, NO_CELL]) {
            grid.append(part, number);
        }
    }
    Ok(())
}

fn unsupported(scan: &Scan<'_>, what: &str, found: &[u8]) -> ReadError {
    scan.source.error(
        scan.line(),
        ReadProblem::Unsupported {
            what: format!("{what} {}", lossy(found)),
            advice: "write an unstructured grid or polygons with arrays of numbers".to_owned(),
        },
    )
}

fn negative(scan: &Scan<'_>, what: &str, number: Number) -> ReadError {
    let wanted = "a whole number not below zero";
    let found = number.real().to_string();
    scan.source.wrong(scan.line(), what, wanted, &found)
}

/// Passes what stands between `METADATA` and an empty line.
fn skip_metadata(scan: &mut Scan<'_>) {
    scan.rest_of_line();
    while scan.left() > 0 && !scan.rest_of_line().trim_ascii().is_empty() {}
}

struct File<'a> {
    binary: bool,
    of_5: bool,
    is_polygons: bool,
    vectors: Vectors<'a>,
}

impl File<'_> {
    fn kind(&self, scan: &mut Scan<'_>) -> Result<Kind, ReadError> {
        let name = scan.needed("type of an array")?;
        Kind::legacy(name).ok_or_else(|| unsupported(scan, "an array of type", name))
    }

    fn numbers<'s>(
        &self,
        scan: &mut Scan<'s>,
        kind: Kind,
        count: u64,
        what: &'static str,
        mut take: impl FnMut(&Scan<'s>, Number) -> Result<(), ReadError>,
    ) -> Result<(), ReadError> {
        if !self.binary {
            scan.announced(what, count, 2)
                .or_else(|error| if count <= 1 { Ok(()) } else { Err(error) })?;
            for _ in 0..count {
                let word = scan.needed(what)?;
                let wanted = if kind.is_whole() {
                    "a whole number"
                } else {
                    "a number"
                };
                let number = kind
                    .word(word)
                    .ok_or_else(|| scan.source.wrong(scan.line(), what, wanted, &lossy(word)))?;
                take(scan, number)?;
            }
            return Ok(());
        }
        scan.rest_of_line();
        scan.announced(what, count, kind.bytes())?;
        for _ in 0..count {
            let mut bytes = [0; 8];
            let bytes = &mut bytes[..kind.bytes()];
            bytes.copy_from_slice(scan.take(kind.bytes(), what)?);
            bytes.reverse(); // highest first
            take(scan, kind.number(bytes))?;
        }
        Ok(())
    }

    /// Three lengths each.
    fn vectors_m(
        &self,
        scan: &mut Scan<'_>,
        kind: Kind,
        count: u64,
        what: &'static str,
        into: &mut Vec<[f64; 3]>,
    ) -> Result<(), ReadError> {
        let mut at = [0.0; 3];
        let mut axis = 0;
        self.numbers(scan, kind, count.saturating_mul(3), what, |scan, number| {
            at[axis] = number.real();
            axis = (axis + 1) % 3;
            if axis == 0 {
                let place = format!("one of the {what}");
                into.push(if self.binary {
                    scan.source.point_m(&place, at)?
                } else {
                    scan.source.point_on(scan.line(), &place, at)?
                });
            }
            Ok(())
        })
    }

    /// Cells by the count of their points and these (up to version 4.2), or by offsets (version 5).
    fn cells(&self, scan: &mut Scan<'_>, cells: &mut Cells) -> Result<(), ReadError> {
        let what = "points of cells";
        let first = scan.whole("number of cells")?;
        let size = scan.whole("size of the cells")?;
        let mut ahead = scan.clone();
        let by_offsets = ahead.word() == Some(b"OFFSETS");
        if self.of_5 && (by_offsets || first > 0) {
            return self.cells_of_5(scan, first, size, cells);
        }
        let mut left = 0;
        let mut count = 0;
        self.numbers(scan, Kind::I32, size, what, |scan, number| {
            let place = number.place().ok_or_else(|| negative(scan, what, number))?;
            if left == 0 {
                left = place;
                count += 1;
            } else {
                left -= 1;
                cells.connectivity.push(place);
            }
            if left == 0 {
                cells.ends.push(cells.connectivity.len());
            }
            Ok(())
        })?;
        if left > 0 || count != first {
            let wanted = format!("{first} whole cells");
            let found = format!("{count}, the last with {left} points missing");
            return Err(scan.source.wrong(scan.line(), what, &wanted, &found));
        }
        Ok(())
    }

    fn cells_of_5(
        &self,
        scan: &mut Scan<'_>,
        offsets: u64,
        size: u64,
        cells: &mut Cells,
    ) -> Result<(), ReadError> {
        for (word, count) in [("OFFSETS", offsets), ("CONNECTIVITY", size)] {
            let found = scan.needed(word)?;
            if found != word.as_bytes() {
                return Err(scan
                    .source
                    .wrong(scan.line(), "part of cells", word, &lossy(found)));
            }
            let kind = self.kind(scan)?;
            let base = cells.connectivity.len();
            let mut last = None;
            self.numbers(scan, kind, count, "points of cells", |scan, number| {
                let what = "points of cells";
                let place = number.place().ok_or_else(|| negative(scan, what, number))?;
                if word == "CONNECTIVITY" {
                    cells.connectivity.push(place);
                    return Ok(());
                }
                if last.map_or(place != 0, |last| place < last) || place > size {
                    let wanted = "offsets that begin with 0 and rise to the size of the cells";
                    let found = place.to_string();
                    return Err(scan.source.wrong(scan.line(), "OFFSETS", wanted, &found));
                }
                if last.is_some() {
                    cells.ends.push(base + place as usize);
                }
                last = Some(place);
                Ok(())
            })?;
            if word == "OFFSETS" && last.is_some_and(|last| last != size) {
                let wanted = format!("{size} at their end");
                let found = last.unwrap_or(0).to_string();
                return Err(scan.source.wrong(scan.line(), "OFFSETS", &wanted, &found));
            }
        }
        Ok(())
    }

    /// `FIELD name n`, then arrays with their own numbers of components and tuples.
    fn field(&self, scan: &mut Scan<'_>, of: Of, grid: &mut Grid) -> Result<(), ReadError> {
        scan.needed("FIELD")?;
        let arrays = scan.whole("number of arrays")?;
        scan.announced("arrays", arrays, 6)?;
        for _ in 0..arrays {
            let mut name = scan.needed("name of an array")?;
            while name == b"METADATA" {
                skip_metadata(scan);
                name = scan.needed("name of an array")?;
            }
            let components = scan.whole("components of an array")?;
            let count = scan.whole("tuples of an array")?;
            let kind = self.kind(scan)?;
            self.array(scan, &decoded(name), kind, components, count, of, grid)?;
        }
        Ok(())
    }

    fn attribute(
        &self,
        scan: &mut Scan<'_>,
        word: &[u8],
        (of, count): (Of, u64),
        grid: &mut Grid,
    ) -> Result<(), ReadError> {
        let name = decoded(scan.needed("name of an array")?);
        let word = word.to_ascii_uppercase();
        let components = match word.as_slice() {
            b"COLOR_SCALARS" => {
                let components = scan.whole("components of an array")?;
                let kind = if self.binary { Kind::U8 } else { Kind::F32 };
                let values = count.saturating_mul(components);
                return self.numbers(scan, kind, values, "colours", |_, _| Ok(()));
            }
            b"TEXTURE_COORDINATES" => scan.whole("components of an array")?,
            b"TENSORS" => 9,
            b"TENSORS6" => 6,
            b"VECTORS" | b"NORMALS" => 3,
            _ => 1,
        };
        let kind = self.kind(scan)?;
        let mut components = components;
        if word == b"SCALARS" {
            // The number of components may follow, and the table of colours.
            let mut ahead = scan.clone();
            let line = ahead.line();
            if let Some(more) = ahead.word()
                && ahead.line() == line
                && let Some(more) = crate::mesh::text::whole(more)
            {
                components = more;
                *scan = ahead;
            }
            let mut ahead = scan.clone();
            if ahead.word() == Some(b"LOOKUP_TABLE") {
                ahead.needed("LOOKUP_TABLE")?;
                *scan = ahead;
            }
        }
        self.array(scan, &name, kind, components, count, of, grid)
    }

    #[allow(clippy::too_many_arguments, reason = "what an array's head says")]
    fn array(
        &self,
        scan: &mut Scan<'_>,
        name: &str,
        kind: Kind,
        components: u64,
        count: u64,
        of: Of,
        grid: &mut Grid,
    ) -> Result<(), ReadError> {
        let values = count.saturating_mul(components);
        let what = "values of an array";
        if of == Of::Points && components == 3 {
            if grid.vectors.len() < 100 {
                grid.vectors.push(name.to_owned());
            }
            if self.vectors.wants(name) {
                grid.moved_m.clear();
                grid.has_moved = true;
                return self.vectors_m(scan, kind, count, "displacements", &mut grid.moved_m);
            }
        }
        if of == Of::Cells && components == 1 && kind.is_whole() {
            let mut labels = Vec::new();
            self.numbers(scan, kind, values, what, |_, number| {
                if let Number::Whole(value) = number {
                    labels.push(value);
                }
                Ok(())
            })?;
            grid.labels.push((name.to_owned(), labels));
            return Ok(());
        }
        self.numbers(scan, kind, values, what, |_, _| Ok(()))
    }
}

/// A name as it was before blanks and signs were written as %20 and the like.
fn decoded(name: &[u8]) -> String {
    let mut out = Vec::new();
    let mut rest = name;
    while let Some((&byte, after)) = rest.split_first() {
        let digits = after.get(..2).and_then(|d| std::str::from_utf8(d).ok());
        let coded = digits.and_then(|d| u8::from_str_radix(d, 16).ok());
        match coded.filter(|_| byte == b'%') {
            Some(coded) => {
                out.push(coded);
                rest = &after[2..];
            }
            None => {
                out.push(byte);
                rest = after;
            }
        }
    }
    lossy(&out)
}
