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

/// An `.inp` of one row of squares from the origin, and a `.vtk` with the points at `at`, moved by nothing.
fn row_of_squares(squares: usize, vtk_points: impl Fn([f64; 2]) -> Vec<[f64; 3]>) -> [String; 2] {
    let (mut inp, mut points) = (String::from("*NODE\n"), String::new());
    let mut count = 0;
    for k in 0..=squares {
        for (side, y) in [(1, 0.0), (2, 0.2)] {
            let x = 0.1 * k as f64;
            inp += &format!("{},{x},{y},0\n", 2 * k + side);
            for [x, y, z] in vtk_points([x, y]) {
                points += &format!("{x} {y} {z}\n");
                count += 1;
            }
        }
    }
    inp += "*ELEMENT,TYPE=S4\n";
    for k in 0..squares {
        let first = 2 * k + 1;
        inp += &format!(
            "{},{first},{},{},{}\n",
            k + 1,
            first + 2,
            first + 3,
            first + 1
        );
    }
    let moved = "0 0 0\n".repeat(count);
    let vtk = format!(
        "# vtk DataFile Version 3.0\nm\nASCII\nDATASET POLYDATA\nPOINTS {count} double\n{points}POLYGONS 1 4\n\
         3 0 1 2\nPOINT_DATA {count}\nVECTORS displacement double\n{moved}"
    );
    [inp, vtk]
}

// A point at the origin is there in every unit, and one that is held after every warping.
#[test]
fn points_few_of_which_match_are_of_another_mesh() {
    let displaced = |of: &dyn Fn([f64; 2]) -> Vec<[f64; 3]>| {
        let [inp, vtk] = row_of_squares(8, of);
        let folder = folder(&[("a.inp", &inp), ("r.vtk", &vtk)]);
        let mut mesh = load_mesh(&files(&folder.path().join("a.inp")))
            .unwrap()
            .mesh;
        let path = folder.path().join("r.vtk");
        displace_mesh(&mut mesh, &path, None, Some(1.0), None)
            .map(|matched| (matched.known, matched.without.len(), matched.unknown.len()))
            .map_err(|error| error.to_string())
    };
    let millimetres = displaced(&|[x, y]| vec![[1e3 * x, 1e3 * y, 0.0]]).unwrap_err();
    let few = "only 1 of its 18 points are where a node of the mesh is, and 1 of 18 nodes have one";
    assert!(millimetres.contains(few), "{millimetres}");
    assert!(millimetres.contains("[0.000000, 200.000000, 0.000000] m, where its point 2 is"));
    assert!(millimetres.contains("unit or the mesh is another"));
    let warped = displaced(&|[x, y]| vec![[x, y, 0.01 * x]]).unwrap_err();
    assert!(warped.contains("only 2 of its 18"), "{warped}");
    // some points moved, a part of the mesh, and more than the mesh: these are taken
    let some = displaced(&|[x, y]| vec![[x, y, if x > 0.65 { 0.1 } else { 0.0 }]]);
    assert_eq!(some, Ok((14, 4, 4)));
    let part = displaced(&|[x, y]| if x < 0.15 { vec![[x, y, 0.0]] } else { vec![] });
    assert_eq!(part, Ok((4, 14, 0)));
    let more = displaced(&|[x, y]| [0.0, 1.0, 2.0].map(|z| [x, y, z]).to_vec());
    assert_eq!(more, Ok((18, 0, 36)));
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
