//! Meshes of VTK and ParaView: legacy `.vtk`, and `.vtu` or `.vtp` in XML.
//!
//! Unstructured grids and polygons are read, as text or binary, of legacy files up to version 5.1; in XML
//! inline or appended, plain or packed with zlib. Displacements are vectors of the points. Points and cells
//! have no numbers in these files: they count from 0. Cells of a one-component whole-number array make an
//! element set for each of its values, named `ARRAY=VALUE` (up to a thousand values).
//!
//! Read here and not by a crate: of `vtkio` 0.7.0-rc2 one in sixty of files broken at random made a panic,
//! it does not read raw appended data (which ParaView writes), and it names no line. XML, base64 and zlib
//! are those of `quick-xml`, `base64` and `flate2`.

mod array;
mod cells;
mod legacy;
mod packed;
mod xml;

use super::Mesh;
use super::error::ReadError;
use super::options::ReadOptions;
use super::scan::Scan;
use super::text::Source;
use super::vectors::Vectors;

/// Reads a mesh and the displacements in it, from a legacy or an XML file; `file` is the name in messages.
///
/// # Errors
/// [`ReadError`] for a file that breaks its format, for kinds of data set other than unstructured grids and
/// polygons, and for vectors named that it does not have.
///
/// ```
/// use helio_flux::mesh::{ReadOptions, Vectors, vtk};
/// let file = b"# vtk DataFile Version 3.0\na mirror\nASCII\nDATASET POLYDATA\nPOINTS 3 float\n0 0 0 1 0 0 0 1 0\n\
///     POLYGONS 1 4\n3 0 1 2\nPOINT_DATA 3\nVECTORS displacement float\n0 0 0 0 0 .1 0 0 0\n";
/// let mesh = vtk::mesh("mirror.vtk", file, Vectors::Displacement, &ReadOptions::default())?;
/// assert_eq!(mesh.len(), 1);
/// assert_eq!(mesh.displacement_m().map(|by| by[1][2]), Some(0.1));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn mesh(
    file: &str,
    bytes: &[u8],
    vectors: Vectors<'_>,
    options: &ReadOptions,
) -> Result<Mesh, ReadError> {
    let source = Source { file, options };
    source.check_bytes(bytes)?;
    let mut grid = cells::Grid::default();
    if bytes.trim_ascii_start().starts_with(b"<") {
        xml::read(source, bytes, vectors, &mut grid)?;
    } else {
        legacy::read(&mut Scan::new(source, bytes)?, vectors, &mut grid)?;
    }
    grid.finish(&source, vectors)
}
