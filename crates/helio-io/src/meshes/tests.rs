//! Files of two parts, and what is said of them.

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
        let head = "  100CL  101 1.000000000           3                     0    1           1\n";
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
