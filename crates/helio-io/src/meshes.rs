//! Meshes of mirrors and their displacements from files of any format that `helio-flux` reads.

use std::cell::RefCell;
use std::collections::HashMap;
use std::path::{Path, PathBuf};

use helio_flux::mesh::{Limits, Mesh, ReadError, ReadOptions, Vectors, csv, frd, gmsh, inp, vtk};

use crate::error::{IoError, Place, Problem};

mod matching;

use matching::Moved;

/// Where a mesh stands, and how to read it.
#[derive(Debug, Clone, Copy)]
pub struct MeshFiles<'a> {
    /// Its file: of CalculiX or Abaqus, Gmsh, VTK, or a table of nodes in CSV.
    pub mesh: &'a Path,
    /// With a table of nodes: the table of elements.
    pub elements: Option<&'a Path>,
    /// One unit of length of the files \[m\]. `None` will do for tables whose columns end in `_m` or `_mm`: the
    /// other formats do not say it.
    pub metres_per_unit: Option<f64>,
    /// Name of the vectors that are displacements, in files that have names; `None` for the usual ones.
    pub vectors: Option<&'a str>,
}

/// A mesh and where it was read from.
#[derive(Debug, Clone)]
#[non_exhaustive]
pub struct LoadedMesh {
    /// The mesh.
    pub mesh: Mesh,
    /// Every file read, the named one first.
    pub files: Vec<PathBuf>,
}

/// What displacements and mesh do not have in common.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
#[non_exhaustive]
pub struct MatchedNodes {
    /// Nodes of the mesh without a displacement.
    pub without: Vec<u64>,
    /// Nodes with a displacement that the mesh does not have.
    pub unknown: Vec<u64>,
    /// Nodes with a displacement that it has.
    pub known: usize,
}

/// What a file is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Kind {
    Inp,
    Frd,
    Gmsh,
    Vtk,
    Csv,
}

const SUFFIXES: [(&str, Kind); 7] = [
    ("inp", Kind::Inp),
    ("frd", Kind::Frd),
    ("msh", Kind::Gmsh),
    ("vtk", Kind::Vtk),
    ("vtu", Kind::Vtk),
    ("vtp", Kind::Vtk),
    ("csv", Kind::Csv),
];

impl Kind {
    /// By what the file begins with, else by its suffix: names are mistaken more often than contents.
    fn of(path: &Path, bytes: &[u8]) -> Result<Self, IoError> {
        let start = bytes.trim_ascii_start();
        let begins = |with: &str| {
            start.len() >= with.len() && start[..with.len()].eq_ignore_ascii_case(with.as_bytes())
        };
        if begins("$MeshFormat") {
            return Ok(Self::Gmsh);
        }
        if ["# vtk DataFile", "<VTKFile", "<?xml"]
            .iter()
            .any(|with| begins(with))
        {
            return Ok(Self::Vtk);
        }
        if begins("1C") && bytes.starts_with(b"    1C") {
            return Ok(Self::Frd);
        }
        let suffix = path.extension().map(|suffix| suffix.to_ascii_lowercase());
        let by_suffix = SUFFIXES
            .iter()
            .find(|(known, _)| suffix.as_ref().is_some_and(|suffix| suffix == known));
        match by_suffix {
            Some((_, kind)) => Ok(*kind),
            None if begins("*") => Ok(Self::Inp),
            None => Err(IoError::new(
                Place::file(path),
                Problem::WrongKind {
                    what: "a mesh's file".into(),
                    wanted: "one of .inp, .frd, .msh, .vtk, .vtu, .vtp and .csv".into(),
                    found: "another suffix, and none of them by what it begins with".into(),
                },
            )),
        }
    }
}

fn read(path: &Path) -> Result<Vec<u8>, IoError> {
    let whole = |error| IoError::read(path, error);
    let size = std::fs::metadata(path).map_err(whole)?.len();
    let most = Limits::default().bytes;
    if size > most {
        let message = format!("{size} bytes; at most {most} are accepted");
        return Err(IoError::new(
            Place::file(path),
            Problem::Conflict { message },
        ));
    }
    std::fs::read(path).map_err(whole)
}

fn wrong(error: &ReadError) -> IoError {
    let place = Place {
        line: error.line(),
        ..Place::file(Path::new(error.file()))
    };
    let message = error.problem().to_string();
    IoError::new(place, Problem::Conflict { message })
}

/// Reads a mesh of any format, with the displacements that stand in the same file.
///
/// The format is told by what the file begins with and by its suffix: `.inp` (CalculiX, Abaqus), `.frd`, `.msh`
/// (Gmsh), `.vtk`, `.vtu`, `.vtp`, or `.csv` for a table of nodes, which goes with one of elements. Files that an
/// `.inp` includes are looked for beside it.
///
/// # Errors
/// [`IoError`] with file and line for a file that cannot be read or breaks its format.
///
/// ```
/// use helio_io::{MeshFiles, load_mesh};
/// let folder = tempfile::tempdir()?;
/// let path = folder.path().join("plate.inp");
/// std::fs::write(&path, "*NODE\n1,0,0,0\n2,1000,0,0\n3,0,1000,0\n*ELEMENT,TYPE=S3\n1,1,2,3\n")?;
/// let files = MeshFiles { mesh: &path, elements: None, metres_per_unit: Some(0.001), vectors: None };
/// let loaded = load_mesh(&files)?;
/// assert_eq!(loaded.mesh.position_m()[1], [1.0, 0.0, 0.0]);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn load_mesh(files: &MeshFiles<'_>) -> Result<LoadedMesh, IoError> {
    let path = files.mesh;
    let bytes = read(path)?;
    let kind = Kind::of(path, &bytes)?;
    let name = path.to_string_lossy();
    let options = options(path, &bytes, kind, files.metres_per_unit)?;
    let vectors = files.vectors.map_or(Vectors::Displacement, Vectors::Named);
    let mut all = vec![path.to_path_buf()];
    if let Some(elements) = files.elements
        && kind != Kind::Csv
    {
        let message = format!(
            "{} holds its elements itself; a table of elements goes with a table of nodes in CSV",
            path.display()
        );
        return Err(IoError::new(
            Place::file(elements),
            Problem::Conflict { message },
        ));
    }
    let mesh = match kind {
        Kind::Inp => {
            let included = RefCell::new(Vec::new());
            let folder = path.parent().unwrap_or(Path::new(""));
            let mesh = inp::mesh_with(&name, &bytes, &options, &mut |include| {
                let path = folder.join(include);
                let bytes = std::fs::read(&path)?;
                included.borrow_mut().push(path);
                Ok(bytes)
            });
            all.append(&mut included.borrow_mut());
            mesh
        }
        Kind::Frd => frd::mesh(&name, &bytes, &options),
        Kind::Gmsh => gmsh::mesh(&name, &bytes, vectors, &options),
        Kind::Vtk => vtk::mesh(&name, &bytes, vectors, &options),
        Kind::Csv => {
            let Some(elements) = files.elements else {
                let problem = Problem::Missing {
                    what: "the table of elements".into(),
                    wanted: "a table of nodes goes with one of elements".into(),
                };
                return Err(IoError::new(Place::file(path), problem));
            };
            all.push(elements.to_path_buf());
            let rows = read(elements)?;
            csv::nodes(&name, &bytes, &options)
                .and_then(|nodes| nodes.elements(&elements.to_string_lossy(), &rows))
        }
    };
    let mesh = mesh.map_err(|error| wrong(&error))?;
    Ok(LoadedMesh { mesh, files: all })
}

fn options(
    path: &Path,
    bytes: &[u8],
    kind: Kind,
    metres_per_unit: Option<f64>,
) -> Result<ReadOptions, IoError> {
    // A model in millimetres is as likely as one in metres: no guess.
    if metres_per_unit.is_none() && (kind != Kind::Csv || has_bare_lengths(bytes)) {
        let problem = Problem::Missing {
            what: "the unit of its lengths".into(),
            wanted: "the file does not say it: `unit` (m, cm, mm or in) in [mirror] of the scene or --unit; of a \
                     receiver's file, `unit` in [receiver]"
                .into(),
        };
        return Err(IoError::new(Place::file(path), problem));
    }
    let metres_per_unit = metres_per_unit.unwrap_or(1.0);
    ReadOptions::in_units_of(metres_per_unit).map_err(|error| {
        let message = error.to_string();
        IoError::new(Place::file(path), Problem::Conflict { message })
    })
}

/// Whether a table has a column of lengths without a unit.
fn has_bare_lengths(bytes: &[u8]) -> bool {
    let head = bytes.split(|&b| b == b'\n').next().unwrap_or(bytes);
    let mut names = head.split(|&b| b == b',').map(<[u8]>::trim_ascii);
    names.any(|name| matches!(name, b"x" | b"y" | b"z" | b"ux" | b"uy" | b"uz"))
}

/// Reads the displacements that a solver wrote into another file and gives them to the nodes of a mesh by their
/// numbers, or where points have none (VTK) by where they are. Files that say where their nodes are (all but CSV)
/// must agree with the mesh, to 1e-6 of its extent and 1e-5 of each coordinate. `step` is the number of the step in an `.frd`; without it the last that is no eigenmode counts.
///
/// # Errors
/// [`IoError`] with file and line for a file that cannot be read or breaks its format, without displacements, or
/// none of whose nodes the mesh has; for a node that is elsewhere in the mesh; and for a `step` with another format than `.frd`.
pub fn displace_mesh(
    mesh: &mut Mesh,
    path: &Path,
    step: Option<u64>,
    metres_per_unit: Option<f64>,
    vectors: Option<&str>,
) -> Result<MatchedNodes, IoError> {
    let bytes = read(path)?;
    let kind = Kind::of(path, &bytes)?;
    let name = path.to_string_lossy();
    let options = options(path, &bytes, kind, metres_per_unit)?;
    let refuse = |message: String| {
        let problem = Problem::Conflict { message };
        IoError::new(Place::file(path), problem)
    };
    if step.is_some() && kind != Kind::Frd {
        return Err(refuse("steps are told apart in .frd files only".to_owned()));
    }
    let moved = match kind {
        Kind::Inp => {
            return Err(refuse(
                "an .inp holds no displacements; wanted what the solver wrote, such as an .frd"
                    .into(),
            ));
        }
        Kind::Frd => {
            let step = step.map_or(frd::Step::Last, frd::Step::Number);
            let moved =
                frd::displacements(&name, &bytes, step, &options).map_err(|error| wrong(&error))?;
            let places = frd::positions(&name, &bytes, &options).map_err(|error| wrong(&error))?;
            let places: HashMap<u64, [f64; 3]> = places.into_iter().collect();
            let at = |id| places.get(id).copied();
            Moved {
                node_ids: moved.node_ids().to_vec(),
                displacement_m: moved.displacement_m().to_vec(),
                position_m: moved.node_ids().iter().map(at).collect(),
            }
        }
        Kind::Csv => {
            let moved =
                csv::displacements(&name, &bytes, &options).map_err(|error| wrong(&error))?;
            Moved {
                node_ids: moved.node_ids().to_vec(),
                displacement_m: moved.displacement_m().to_vec(),
                position_m: Vec::new(),
            }
        }
        Kind::Gmsh | Kind::Vtk => {
            let vectors = vectors.map_or(Vectors::Displacement, Vectors::Named);
            let other = match kind {
                Kind::Gmsh => gmsh::mesh(&name, &bytes, vectors, &options),
                _ => vtk::mesh(&name, &bytes, vectors, &options),
            };
            let other = other.map_err(|error| wrong(&error))?;
            let Some(moved) = other.displacement_m() else {
                let known: Vec<_> = other.other_vectors().iter().take(8).cloned().collect();
                return Err(refuse(format!(
                    "it holds no displacements of the nodes; its vectors are [{}], and --vectors names one",
                    known.join(", ")
                )));
            };
            Moved {
                node_ids: other.node_ids().to_vec(),
                displacement_m: moved.to_vec(),
                position_m: other.position_m().iter().map(|at| Some(*at)).collect(),
            }
        }
    };
    let matched = if kind == Kind::Vtk {
        matching::by_position(mesh, &moved)
    } else {
        matching::by_number(mesh, &moved)
    };
    let matched = matched.map_err(refuse)?;
    if matched.known == 0 {
        return Err(refuse("none of its nodes is one of the mesh".to_owned()));
    }
    Ok(matched)
}

#[cfg(test)]
mod tests;
