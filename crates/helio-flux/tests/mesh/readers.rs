//! Each reader on a model of known contents.

use std::io;

use helio_flux::mesh::frd::Step;
use helio_flux::mesh::{
    ElementStatus, Mesh, MirrorOptions, Pick, ReadOptions, ReadProblem, Shape, csv, frd, inp,
};

const DEFAULT: fn() -> ReadOptions = ReadOptions::default;

/// Two unit squares side by side as shells, with what else a model holds.
const PLATE: &str = "*HEADING\n a plate, caf\u{e9}\n** a comment\n*Node, NSET=All\n\
    1, 0., 0., 0.\n2, 1.0, 0.0\n3, 2.D0,,\n 11, 0, 1, 0\n12,1,1,0\n13,2,1,0\n\
    *ELEMENT, TYPE=S4R, ELSET=Glass\n 1, 1,2,12,11\n2, 2,3,13,\n12\n\
    *Element, type=B31, elset=Frame\n50, 1, 11\n51, 3, 13\n\
    *NSET, NSET=Left\n1, 11,\n*NSET,NSET=odd,GENERATE\n1,13,2\n*NSET, NSET=both\nLEFT, Odd\n\
    *ELSET, ELSET=Second, GENERATE\n2, 1000000000000, 2\n\
    *SURFACE, NAME=Front, TYPE=ELEMENT\nglass, SPOS\n2, SNEG\n\
    *MATERIAL, NAME=GLASS\n*ELASTIC\n70000.0, 0.23\n*STEP\n*STATIC\n*END STEP\n";

#[test]
fn an_input_file_with_sets_and_foreign_elements() {
    let mesh = inp::mesh("plate.inp", PLATE.as_bytes(), &DEFAULT()).unwrap();
    assert_eq!(mesh.node_ids(), [1, 2, 3, 11, 12, 13]);
    assert_eq!(mesh.position_m()[2], [2.0, 0.0, 0.0]);
    let elements: Vec<_> = mesh.elements().collect();
    let some = |ids: [u64; 4]| ids.map(Some).to_vec();
    let quad = Shape::Quadrilateral;
    assert_eq!(
        elements,
        [
            (1, quad, some([1, 2, 12, 11]), ElementStatus::Ok),
            (2, quad, some([2, 3, 13, 12]), ElementStatus::Ok),
        ]
    );
    assert!(mesh.faults().is_empty());
    assert_eq!(
        mesh.faults().to_string(),
        "2 elements of type `B31` left aside"
    );
    assert_eq!(mesh.node_set("ALL").unwrap().len(), 6);
    assert_eq!(mesh.node_set("left").unwrap(), [1, 11]);
    assert_eq!(mesh.node_set("ODD").unwrap(), [1, 3, 11, 13]);
    assert_eq!(mesh.node_set("Both").unwrap(), [1, 3, 11, 13]);
    assert_eq!(mesh.element_set("second").unwrap(), [2]);
    let names: Vec<_> = mesh.node_sets().collect();
    assert_eq!(names, ["All", "both", "Left", "odd"]);
    assert_eq!(mesh.surfaces().collect::<Vec<_>>(), ["Front"]);
}

/// As Abaqus/CAE writes it: a part, an instance where it was drawn, sets and surfaces of the assembly, and
/// a reference point with the number of a node of the part.
#[test]
fn an_assembly_of_one_part() {
    let model = "*Heading\n*Part, name=Plate\n*Node\n1,0.,0.,0.\n2,1.,0.,0.\n3,1.,1.,0.\n4,0.,1.,0.\n\
        *Element, type=S4R\n1, 1, 2, 3, 4\n*Elset, elset=Glass\n1,\n*End Part\n\
        *Assembly, name=Assembly\n*Instance, name=Plate-1, part=Plate\n*End Instance\n\
        *Node\n1, 0.5, 0.5, 10.\n*Element, type=SPRINGA\n1, 1, 2\n*Nset, nset=Pilot\n1,\n\
        *Nset, nset=Edge, instance=Plate-1\n1, 2\n*Nset, nset=Same, instance=Plate-1\nEdge\n\
        *Elset, elset=_Front_SPOS, internal, instance=Plate-1\n1,\n\
        *Surface, type=ELEMENT, name=Front\n_Front_SPOS, SPOS\n\
        *Surface, type=ELEMENT, name=Other\nPlate-1.Glass, SPOS\nPlate-1.1, SPOS\n*End Assembly\n";
    let mesh = inp::mesh("cae.inp", model.as_bytes(), &DEFAULT()).unwrap();
    assert_eq!(mesh.position_m()[0], [0.0; 3]);
    assert_eq!((mesh.node_ids().len(), mesh.len()), (4, 1));
    assert_eq!(mesh.node_set("edge").unwrap(), [1, 2]);
    assert_eq!(mesh.node_set("same").unwrap(), [1, 2]);
    assert!(mesh.node_set("pilot").unwrap().is_empty());
    let toward = MirrorOptions::toward([0.0, 0.0, 1.0]).unwrap();
    for name in ["Front", "Other"] {
        let mirror = mesh.mirror(&Pick::Surface(name), &toward).unwrap();
        assert_eq!(mirror.faces().len(), 1, "{name}");
    }
}

/// Every type of element on one line of nodes far enough apart, with and without its mid-side nodes.
#[test]
fn corners_of_quadratic_elements_are_those_of_linear_ones() {
    let unit = [
        [0., 0., 0.],
        [1., 0., 0.],
        [1., 1., 0.],
        [0., 1., 0.],
        [0., 0., 1.],
        [1., 0., 1.],
        [1., 1., 1.],
        [0., 1., 1.],
    ];
    let wedge = [unit[0], unit[1], unit[3], unit[4], unit[5], unit[7]];
    let tetrahedron = [unit[0], unit[1], unit[3], unit[4]];
    let cases: [(&str, &str, usize, &[[f64; 3]]); 5] = [
        ("C3D8", "C3D20R", 20, &unit),
        ("C3D6", "C3D15", 15, &wedge),
        ("C3D4", "C3D10", 10, &tetrahedron),
        ("S4", "S8R", 8, &unit[..4]),
        ("S3", "S6", 6, &unit[..3]),
    ];
    for (linear, quadratic, nodes, corners) in cases {
        let mut model = "*NODE\n".to_owned();
        for (k, [x, y, z]) in corners.iter().enumerate() {
            model += &format!("{},{x},{y},{z}\n", k + 1);
        }
        for extra in corners.len() + 1..=nodes {
            model += &format!("{extra},9,9,{extra}\n");
        }
        let list = |count: usize| {
            let mut text = "7".to_owned();
            for k in 1..=count {
                text += if k % 15 == 0 { ",\n" } else { "," };
                text += &k.to_string();
            }
            text
        };
        let of = |name: &str, count: usize| {
            let text = format!("{model}*ELEMENT,TYPE={name}\n{}\n", list(count));
            let mesh = inp::mesh("m.inp", text.as_bytes(), &DEFAULT()).unwrap();
            mesh.elements().collect::<Vec<_>>()
        };
        let simple = of(linear, corners.len());
        assert_eq!(simple, of(quadratic, nodes), "{linear} {quadratic}");
        assert_eq!(simple[0].3, ElementStatus::Ok, "{linear}");
    }
}

#[test]
fn included_files_are_asked_for_and_errors_name_them() {
    let main = b"*INCLUDE, INPUT=mesh/nodes.inc\n*ELEMENT, TYPE=S3\n1,1,2,3\n";
    let mut asked = Vec::new();
    let mesh = inp::mesh_with("main.inp", main, &DEFAULT(), &mut |name| {
        asked.push(name.to_owned());
        Ok(b"*NODE\n1,0,0,0\n2,1,0,0\n3,0,1,0\n".to_vec())
    });
    assert_eq!(mesh.unwrap().len(), 1);
    assert_eq!(asked, ["mesh/nodes.inc"]);
    let error = inp::mesh_with("main.inp", main, &DEFAULT(), &mut |_| {
        Ok(b"*NODE\n1,0,0,oops\n".to_vec())
    });
    assert_eq!(
        error.unwrap_err().to_string(),
        "mesh/nodes.inc:2: z of node 1 must be a number, found `oops`"
    );
    // A file that includes itself, or two others each twice, comes to an end.
    for text in ["*INCLUDE,INPUT=a\n", "*INCLUDE,INPUT=a\n*INCLUDE,INPUT=b\n"] {
        let mut opened = 0;
        let error = inp::mesh_with("a", text.as_bytes(), &DEFAULT(), &mut |_| {
            opened += 1;
            Ok(text.as_bytes().to_vec())
        });
        let error = error.unwrap_err();
        assert!(
            matches!(error.problem(), ReadProblem::TooMany { .. }),
            "{error}"
        );
        assert!(opened <= 8);
    }
    let error = inp::mesh_with("a", main, &DEFAULT(), &mut |_| {
        Err(io::Error::from(io::ErrorKind::NotFound))
    });
    assert!(matches!(
        error.unwrap_err().problem(),
        ReadProblem::Unreadable { .. }
    ));
}

/// What CalculiX 2.20 wrote of a strip of two S4 shells under a load on its end (first lines of each block).
const RESULTS: &str = include_str!("data/strip.frd");
const STRIP: &str = include_str!("data/strip.inp");

#[test]
fn results_of_calculix_go_with_its_input() {
    let options = ReadOptions::in_units_of(0.001).unwrap();
    let mut mesh = inp::mesh("strip.inp", STRIP.as_bytes(), &options).unwrap();
    let bytes = RESULTS.as_bytes();
    let moved = frd::displacements("strip.frd", bytes, Step::Last, &options).unwrap();
    let matched = mesh.displace(&moved);
    assert!(matched.without.is_empty() && matched.unknown.is_empty());
    // The table of displacements of the same run: *NODE PRINT, seven digits.
    let printed = include_str!("data/strip.dat");
    let mut compared = 0;
    for line in printed.lines() {
        let words: Vec<_> = line.split_whitespace().collect();
        let [id, x, y, z] = words[..] else { continue };
        let Ok(id) = id.parse::<u64>() else { continue };
        let row = mesh.node_ids().iter().position(|&n| n == id).unwrap();
        let by_m = mesh.displacement_m().unwrap()[row];
        for (by_m, word) in by_m.iter().zip([x, y, z]) {
            let printed_m = 0.001 * word.parse::<f64>().unwrap();
            // Half a unit of the sixth digit.
            assert!(
                (by_m - printed_m).abs() <= 5.1e-6 * printed_m.abs(),
                "node {id}"
            );
            compared += 1;
        }
    }
    assert_eq!(compared, 3 * mesh.node_ids().len());
    // The mesh that the results carry is that of the input, to six digits.
    let again = frd::mesh("strip.frd", bytes, &options).unwrap();
    assert_eq!(again.node_ids(), mesh.node_ids());
    for (a, b) in again.position_m().iter().zip(mesh.position_m()) {
        assert!((0..3).all(|k| (a[k] - b[k]).abs() <= 5.1e-6 * b[k].abs()));
    }
    let corners = |mesh: &Mesh| mesh.elements().map(|e| (e.0, e.1, e.2)).collect::<Vec<_>>();
    assert_eq!(corners(&again), corners(&mesh));
}

#[test]
fn steps_of_results_are_told_apart() {
    let options = DEFAULT();
    let block = |step: u64, kind: u64, ux: &str| {
        format!(
            "  100CL  101 1.000000000           1                    {kind:2}{step:5}           1\n \
             -4  DISP        4    1\n -5  D1          1    2    1    0\n \
             -1         1{ux:>12} 0.00000E+00 0.00000E+00\n -3\n"
        )
    };
    let text = format!(
        "    1C\n{}{}{} 9999\n",
        block(1, 0, "1.00000E+00"),
        block(2, 1, "2.00000E+00"),
        block(3, 2, "3.00000E+00")
    );
    let ux = |step| {
        frd::displacements("f", text.as_bytes(), step, &options).map(|m| m.displacement_m()[0][0])
    };
    // Step 3 is an eigenmode.
    assert_eq!(ux(Step::Last), Ok(2.0));
    assert_eq!(ux(Step::Number(1)), Ok(1.0));
    let error = ux(Step::Number(3)).unwrap_err().to_string();
    assert_eq!(
        error,
        "f: a block of displacements is missing; wanted step 3, and the file has [1, 2]"
    );
    // Numbers that touch, as the fixed columns allow.
    let text = block(1, 0, "-1.00000E-02").replace(" 0.00000E+00 0.0", "-2.00000E-02-0.0");
    let moved = frd::displacements("f", text.as_bytes(), Step::Last, &options).unwrap();
    assert_eq!(moved.displacement_m(), [[-0.01, -0.02, 0.0]]);
}

#[test]
fn tables_with_units_sets_and_displacements() {
    let options = ReadOptions::in_units_of(0.01).unwrap();
    let nodes = "\u{feff}# from a spreadsheet\nnode, x ,y_m,z_mm,ux_m,uy_m,uz_mm\n\
        1,0,0,0,0,0,0\n\n2,100,0,0,0,0,5\r\n# the last\n3,0,1,1000,0,0,0\n4,100,1,0,0,0,0\n";
    let elements = "element,node1,node2,node3,node4,shape,set\n9,1,2,3,,,a\n10,2,3,4,,triangle,b\n\
        11,1,2,3,4,Tetrahedron,\n";
    let mesh = csv::nodes("n.csv", nodes.as_bytes(), &options)
        .and_then(|nodes| nodes.elements("e.csv", elements.as_bytes()))
        .unwrap();
    assert_eq!(mesh.position_m()[1], [1.0, 0.0, 0.0]);
    assert_eq!(mesh.position_m()[2], [0.0, 1.0, 1.0]);
    assert_eq!(mesh.displacement_m().unwrap()[1], [0.0, 0.0, 0.005]);
    let shapes: Vec<_> = mesh.elements().map(|e| e.1).collect();
    assert_eq!(
        shapes,
        [Shape::Triangle, Shape::Triangle, Shape::Tetrahedron]
    );
    assert_eq!(mesh.element_set("B").unwrap(), [10]);
    // Lines are counted over empty lines and comments.
    let wrong = nodes.replace("4,100", "4,1OO");
    let error = csv::nodes("n.csv", wrong.as_bytes(), &options).unwrap_err();
    assert_eq!(
        error.to_string(),
        "n.csv:8: x must be a number, found `1OO`"
    );
}

#[test]
fn faulty_elements_are_named_and_counted() {
    let model = "*NODE\n1,0,0,0\n2,1,0,0\n3,1,1,0\n4,0,1,0\n5,0,0,1\n6,1,0,1\n7,1,1,1\n8,0,1,1\n\
        9,2,0,0\n*ELEMENT,TYPE=S4\n1,1,2,3,4\n2,1,2,3,99\n3,2,3,4,1\n4,5,7,6,8\n5,1,2,9,2\n\
        *ELEMENT,TYPE=C3D8\n6,5,6,7,8,1,2,3,4\n1,1,2,3,4,5,6,7,8\n";
    let mesh = inp::mesh("m", model.as_bytes(), &DEFAULT()).unwrap();
    let status: Vec<_> = mesh.elements().map(|e| e.3).collect();
    use ElementStatus::{Degenerate, Duplicate, Inverted, MissingNode, Ok};
    assert_eq!(
        status,
        [
            Ok,
            MissingNode,
            Duplicate,
            Inverted,
            Degenerate,
            Inverted,
            Duplicate
        ]
    );
    let faults = mesh.faults();
    assert_eq!(faults.missing_nodes.first(), [2]);
    assert_eq!(faults.missing_nodes.nodes(), [99]);
    assert_eq!(faults.inverted.first(), [4, 6]);
    assert_eq!(faults.duplicate.first(), [3, 1]);
    assert_eq!(faults.degenerate.first(), [5]);
    assert_eq!(
        faults.to_string(),
        "1 element with nodes that the mesh does not have: 2 wants node 99\n\
         1 element without area or volume: 5\n\
         2 elements inverted or folded over: 4, 6\n\
         2 elements that stand twice: 3, 1"
    );
}

// Nodes between corners carry no light, and their element is used; a solver would not have solved it, so it is said.
#[test]
fn missing_nodes_between_corners_are_named() {
    let nodes = "*NODE\n1,0,0,0\n2,1,0,0\n3,1,1,0\n4,0,1,0\n5,.5,0,0\n6,1,.5,0\n7,.5,1,0\n";
    let element = "*ELEMENT,TYPE=S8R\n1,1,2,3,4,5,6,7,8\n*ELEMENT,TYPE=S6\n2,1,2,3,5,6,9\n";
    // in either order of the file
    for model in [format!("{nodes}{element}"), format!("{element}{nodes}")] {
        let mesh = inp::mesh("m", model.as_bytes(), &DEFAULT()).unwrap();
        let faults = mesh.faults();
        assert_eq!(faults.missing_mid_nodes.first(), [1, 2]);
        assert_eq!(faults.missing_mid_nodes.nodes(), [8, 9]);
        assert_eq!(
            faults.to_string(),
            "2 elements with nodes between corners that the mesh does not have: 1 wants node 8, 2 wants node 9"
        );
        assert!(mesh.elements().all(|e| e.3 == ElementStatus::Ok));
    }
}

#[test]
fn one_element_stands_twice() {
    let model = "*NODE\n1,0,0,0\n2,1,0,0\n3,1,1,0\n*ELEMENT,TYPE=S3\n1,1,2,3\n2,3,1,2\n*SURFACE,NAME=S\n1,S4\n";
    let mesh = inp::mesh("m", model.as_bytes(), &DEFAULT()).unwrap();
    assert_eq!(
        mesh.faults().to_string(),
        "1 element that stands twice: 2\n1 element named in a surface with a face it does not have: 1"
    );
}
