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
mod tests {
    use super::*;

    fn folder(files: &[(&str, &str)]) -> tempfile::TempDir {
        let folder = tempfile::tempdir().unwrap();
        for (name, text) in files {
            std::fs::write(folder.path().join(name), text).unwrap();
        }
        folder
    }

    fn files(mesh: &Path) -> MeshFiles<'_> {
        MeshFiles {
            mesh,
            elements: None,
            metres_per_unit: Some(1.0),
            vectors: None,
        }
    }

    const NODES: &str = "node,x_m,y_m,z_m\n1,0,0,0\n2,1,0,0\n3,0,1,0\n";
    const ELEMENTS: &str = "element,node1,node2,node3\n1,1,2,3\n";
    const MOVED: &str = "node,ux_m,uy_m,uz_m\n1,0,0,0\n2,0,0,0.1\n9,0,0,0\n";
    const INP: &str = "*NODE\n1,0,0,0\n2,1,0,0\n3,0,1,0\n*ELEMENT,TYPE=S3\n1,1,2,3\n";
    const VTK: &str = "# vtk DataFile Version 3.0\nm\nASCII\nDATASET POLYDATA\nPOINTS 3 float\n0 0 0 1 0 0 0 1 0\n\
                       POLYGONS 1 4\n3 0 1 2\nPOINT_DATA 3\nVECTORS displacement float\n0 0 0 0 0 .1 0 0 0\n";

    #[test]
    fn every_pair_of_tables_is_matched_by_numbers() {
        let folder = folder(&[("n.csv", NODES), ("e.csv", ELEMENTS), ("u.csv", MOVED)]);
        let at = |name: &str| folder.path().join(name);
        let (nodes, elements) = (at("n.csv"), at("e.csv"));
        let wanted = MeshFiles {
            elements: Some(&elements),
            ..files(&nodes)
        };
        let mut loaded = load_mesh(&wanted).unwrap();
        assert_eq!(loaded.files.len(), 2);
        let matched = displace_mesh(&mut loaded.mesh, &at("u.csv"), None, Some(1.0), None).unwrap();
        assert_eq!(
            (matched.without, matched.unknown, matched.known),
            (vec![3], vec![9], 2)
        );
        assert_eq!(loaded.mesh.displacement_m().unwrap()[1], [0.0, 0.0, 0.1]);
        let error = load_mesh(&files(&nodes)).unwrap_err().to_string();
        assert!(error.contains("table of elements is missing"), "{error}");
    }

    // Formats by what stands in the file, whatever it is called.
    #[test]
    fn a_wrong_suffix_is_no_matter_where_the_file_says_what_it_is() {
        let folder = folder(&[("a.dat", INP), ("b.inp", VTK), ("c.dat", "hello")]);
        let at = |name: &str| folder.path().join(name);
        assert_eq!(load_mesh(&files(&at("a.dat"))).unwrap().mesh.len(), 1);
        assert_eq!(load_mesh(&files(&at("b.inp"))).unwrap().mesh.len(), 1);
        let error = load_mesh(&files(&at("c.dat"))).unwrap_err().to_string();
        assert!(error.contains("one of .inp, .frd, .msh"), "{error}");
    }

    /// `VTK`, its points in this order, each with its own displacement.
    fn vtk(rows: [usize; 3]) -> String {
        let points = ["0 0 0 ", "1 0 0 ", "0 1 0 "];
        let by = ["0 0 0 ", "0 .1 0 ", "0 0 .2 "];
        let of = |all: [&str; 3]| rows.map(|row| all[row]).concat();
        format!(
            "# vtk DataFile Version 3.0\nm\nASCII\nDATASET POLYDATA\nPOINTS 3 float\n{}\nPOLYGONS 1 4\n3 0 1 2\n\
             POINT_DATA 3\nVECTORS displacement float\n{}\n",
            of(points),
            of(by)
        )
    }

    #[test]
    fn points_without_numbers_are_known_by_where_they_are() {
        let (in_order, turned) = (vtk([0, 1, 2]), vtk([2, 0, 1]));
        let elsewhere = in_order.replace("0 0 0 1 0 0 0 1 0", "5 0 0 6 0 0 5 1 0");
        let folder = folder(&[
            ("a.inp", INP),
            ("r.vtk", &in_order),
            ("t.vtk", &turned),
            ("e.vtk", &elsewhere),
            ("x.csv", "node,ux_m,uy_m,uz_m\n7,0,0,0\n"),
        ]);
        let at = |name: &str| folder.path().join(name);
        let mut mesh = load_mesh(&files(&at("a.inp"))).unwrap().mesh;
        for name in ["r.vtk", "t.vtk"] {
            let matched = displace_mesh(&mut mesh, &at(name), None, Some(1.0), None).unwrap();
            assert_eq!((matched.known, matched.unknown.len()), (3, 0), "{name}");
            let by_m = mesh.displacement_m().unwrap();
            let good = |row: usize, axis: usize, m: f64| (by_m[row][axis] - m).abs() < 1e-8;
            assert_eq!(by_m[0], [0.0; 3], "{name}");
            assert!(good(1, 1, 0.1) && good(2, 2, 0.2), "{name} {by_m:?}");
        }
        let mut said = |name: &str, step, unit| {
            let error = displace_mesh(&mut mesh, &at(name), step, Some(unit), None);
            error.unwrap_err().to_string()
        };
        let error = said("e.vtk", None, 1.0);
        assert!(
            error.contains("[5.000000, 0.000000, 0.000000] m, and node 1 at [0.0"),
            "{error}"
        );
        assert!(said("r.vtk", Some(2), 1.0).contains("in .frd files only"));
        assert!(said("a.inp", None, 1.0).contains("holds no displacements"));
        assert!(said("x.csv", None, 1.0).contains("none of its nodes"));
    }

    #[test]
    fn two_points_at_one_place_with_two_displacements_are_no_one_node() {
        let twice = vtk([0, 1, 2]).replace("0 0 0 1 0 0 0 1 0", "1 0 0 1 0 0 0 1 0");
        let folder = folder(&[("a.inp", INP), ("r.vtk", &twice)]);
        let at = |name: &str| folder.path().join(name);
        let mut mesh = load_mesh(&files(&at("a.inp"))).unwrap().mesh;
        let error = displace_mesh(&mut mesh, &at("r.vtk"), None, Some(1.0), None).unwrap_err();
        assert!(error.to_string().contains("which is node 2"), "{error}");
    }

    #[test]
    fn results_of_another_mesh_with_the_same_numbers_are_refused() {
        let results = |x: &str| {
            let nodes = format!(
                "    1C\n    2C                             3                                     1\n \
                 -1         1 0.00000E+00 0.00000E+00 0.00000E+00\n \
                 -1         2 {x} 0.00000E+00 0.00000E+00\n \
                 -1         3 0.00000E+00 1.00000E+00 0.00000E+00\n -3\n"
            );
            let head =
                "  100CL  101 1.000000000           3                     0    1           1\n";
            let rows =
                (1..=3).map(|id| format!(" -1         {id} 0.00000E+00 0.00000E+00 1.00000E-03\n"));
            let block = rows.collect::<String>();
            format!("{nodes}{head} -4  DISP        4    1\n{block} -3\n 9999\n")
        };
        // the last digit of an .frd is no other mesh
        let folder = folder(&[
            ("a.inp", INP),
            ("same.frd", &results("9.99995E-01")),
            ("other.frd", &results("1.10000E+00")),
        ]);
        let at = |name: &str| folder.path().join(name);
        let mut mesh = load_mesh(&files(&at("a.inp"))).unwrap().mesh;
        let matched = displace_mesh(&mut mesh, &at("same.frd"), None, Some(1.0), None).unwrap();
        assert_eq!(matched.known, 3);
        let error = displace_mesh(&mut mesh, &at("other.frd"), None, Some(1.0), None).unwrap_err();
        let wanted = "node 2 is at [1.100000, 0.000000, 0.000000] m here and at [1.000000, 0.0";
        assert!(error.to_string().contains(wanted), "{error}");
    }

    #[test]
    fn no_unit_is_guessed() {
        let bare = NODES.replace("_m", "");
        let folder = folder(&[
            ("a.inp", INP),
            ("n.csv", NODES),
            ("b.csv", &bare),
            ("e.csv", ELEMENTS),
        ]);
        let (elements, at) = (folder.path().join("e.csv"), |name: &str| {
            folder.path().join(name)
        });
        let load = |name: &str, elements: Option<&Path>| {
            let path = at(name);
            let files = MeshFiles {
                elements,
                metres_per_unit: None,
                ..files(&path)
            };
            load_mesh(&files).map_err(|error| error.to_string())
        };
        for (name, elements) in [("a.inp", None), ("b.csv", Some(&*elements))] {
            let error = load(name, elements).unwrap_err();
            assert!(
                error.contains("unit of its lengths is missing") && error.contains("--unit"),
                "{error}"
            );
        }
        assert_eq!(load("n.csv", Some(&elements)).unwrap().mesh.len(), 1);
    }

    #[test]
    fn files_that_an_inp_includes_are_found_beside_it() {
        let (nodes, rest) = INP.split_at(INP.find("*ELEMENT").unwrap());
        let main = format!("*INCLUDE,INPUT=nodes.txt\n{rest}");
        let folder = folder(&[("nodes.txt", nodes), ("m.inp", &main)]);
        let loaded = load_mesh(&files(&folder.path().join("m.inp"))).unwrap();
        assert_eq!((loaded.mesh.len(), loaded.files.len()), (1, 2));
    }
}
