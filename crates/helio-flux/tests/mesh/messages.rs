//! Every message of a bad file, as people see it.

use std::fmt::{Display, Write as _};

use helio_flux::mesh::frd::Step;
use helio_flux::mesh::{MirrorOptions, Pick, ReadOptions, Vectors, csv, frd, gmsh, inp, vtk};

#[derive(Default)]
struct Messages(String);

impl Messages {
    fn add<T>(&mut self, title: &str, result: Result<T, impl Display>) {
        let Err(error) = result else {
            panic!("{title}: was accepted");
        };
        writeln!(self.0, "# {title}\n{error}\n").unwrap();
    }

    fn show(self, name: &str) {
        let mut settings = insta::Settings::clone_current();
        settings.set_snapshot_path("../snapshots");
        settings.set_prepend_module_to_snapshot(false);
        settings.set_omit_expression(true);
        settings.bind(|| insta::assert_snapshot!(name, self.0));
    }
}

const NODES: &str = "*NODE\n1,0,0,0\n2,1,0,0\n3,0,1,0\n4,1,1,0\n";

#[test]
fn input_files() {
    let mut m = Messages::default();
    let options = ReadOptions::default();
    let mut bad = |title: &str, text: &[u8]| {
        m.add(title, inp::mesh("model.inp", text, &options));
    };
    let mut model = |title: &str, more: &str| bad(title, format!("{NODES}{more}").as_bytes());
    model("node number that is none", "*NODE\nfive,0,0,0\n");
    model("node number zero", "*NODE\n0,0,0,0\n");
    model("coordinate that is no number", "*NODE\n5,0,1..0,0\n");
    model("coordinate that is infinite", "*NODE\n5,0,0,inf\n");
    model("coordinate beyond all measure", "*NODE\n5,1e200,0,0\n");
    model(
        "coordinates that are not Cartesian",
        "*NODE, SYSTEM=C\n5,1,0,0\n",
    );
    model("node at two places", "*NODE\n2,1,0,0.5\n");
    model("type of elements missing", "*ELEMENT, ELSET=A\n1,1,2,3\n");
    model("too few nodes", "*ELEMENT, TYPE=S4\n1,1,2,3\n*STEP\n");
    model(
        "too few nodes at the end",
        "*ELEMENT, TYPE=C3D20R\n1,1,2,3,4,1,2,3,4,\n",
    );
    model("too many nodes", "*ELEMENT, TYPE=S3\n1,1,2,3,4\n");
    model("node that is no number", "*ELEMENT, TYPE=S3\n1,1,2,c\n");
    model("node left out", "*ELEMENT, TYPE=S3\n1,1,,3\n");
    model("generated nodes", "*NGEN\n1,4,1\n");
    model("copied elements", "*ELCOPY, ELEMENT SHIFT=10\n");
    model("moved instance", "*INSTANCE, NAME=A, PART=B\n1.,0.,0.\n");
    model("second part", "*PART, NAME=A\n*END PART\n*PART, NAME=B\n");
    model("include that nobody opens", "*INCLUDE, INPUT=other.inp\n");
    model("include without a name", "*INCLUDE\n");
    model("set without a name", "*NSET\n1\n");
    model("set of an unknown set", "*NSET, NSET=A\nB\n");
    model(
        "generate of too many numbers",
        "*NSET, NSET=A, GENERATE\n1,2,3,4\n",
    );
    model("generate with no step", "*NSET, NSET=A, GENERATE\n1,2,0\n");
    model("surface of an unknown set", "*SURFACE, NAME=A\nB, S1\n");
    model("surface of an edge", "*SURFACE, NAME=A\n1, E1\n");
    model("control characters", "*NODE\n5,0,\u{1b}[31m,0\n");
    model(
        "long text",
        &format!("*NODE\n{},0,0,0\n", "x".repeat(10_000)),
    );
    bad("empty file", b"");
    bad("another kind of file", b"PK\x03\x04\x14\x00\x08\n");
    let mut small = ReadOptions::default();
    small.limits.nodes = 3;
    m.add(
        "too many nodes for the limits",
        inp::mesh("model.inp", NODES.as_bytes(), &small),
    );
    small = ReadOptions::default();
    small.limits.elements = 1;
    let text = format!("{NODES}*ELEMENT,TYPE=S3\n1,1,2,3\n2,2,3,4\n");
    m.add(
        "too many elements",
        inp::mesh("model.inp", text.as_bytes(), &small),
    );
    small = ReadOptions::default();
    small.limits.bytes = 10;
    m.add(
        "too many bytes",
        inp::mesh("model.inp", NODES.as_bytes(), &small),
    );
    small = ReadOptions::default();
    small.limits.set_members = 10;
    // Sets of sets of sets: 2^5 members as they are written.
    let mut text = format!("{NODES}*NSET,NSET=A0\n1,2\n");
    for k in 1..6 {
        let before = k - 1;
        write!(text, "*NSET,NSET=A{k}\nA{before},A{before}\n").unwrap();
    }
    m.add(
        "sets of sets",
        inp::mesh("model.inp", text.as_bytes(), &small),
    );
    m.add("unit that is none", ReadOptions::in_units_of(f64::NAN));
    m.show("input_files");
}

#[test]
fn result_files() {
    let good = include_str!("data/strip.frd");
    let options = ReadOptions::default();
    let mut m = Messages::default();
    let mut bad = |title: &str, from: &str, to: &str| {
        assert!(good.contains(from), "{title}");
        let text = good.replacen(from, to, 1);
        m.add(
            title,
            frd::displacements("model.frd", text.as_bytes(), Step::Last, &options),
        );
    };
    bad(
        "binary",
        "     0    1           1\n",
        "     0    1           2\n",
    );
    bad(
        "binary mesh",
        " 6                                     1",
        " 6                                     3",
    );
    bad("no displacements", "DISP", "FORC");
    bad(
        "eigenmodes",
        "     0    1           1\n",
        "     2    1           1\n",
    );
    bad(
        "no step",
        "     0    1           1\n",
        "     0    x           1\n",
    );
    bad("results without a header", "  100CL", "  1000L");
    bad("number cut", "-8.17659E-02", "-8.17659Q-02");
    bad("number that is infinite", "-8.17659E-02", "    Infinity");
    bad(
        "node twice",
        " -1         2-8.17724",
        " -1         1-8.17724",
    );
    bad(
        "line cut",
        "-8.17724E-06 2.60073E-08-2.44566E-02",
        "-8.17724E-06",
    );
    bad(
        "strange line",
        " -1         4 0.00000E+00 0.00000E+00 0.00000E+00\n -1         5-8",
        "hello\n -1         5-8",
    );
    bad(
        "cut short",
        " -1         6 2.86227E-03 3.76377E-07-8.17659E-02\n -3\n 9999\n",
        "",
    );
    m.add(
        "empty",
        frd::displacements("model.frd", b"", Step::Last, &options),
    );
    let step = frd::displacements("model.frd", good.as_bytes(), Step::Number(7), &options);
    m.add("step that is not there", step);
    let mut bad = |title: &str, from: &str, to: &str| {
        assert!(good.contains(from), "{title}");
        let text = good.replacen(from, to, 1);
        m.add(title, frd::mesh("model.frd", text.as_bytes(), &options));
    };
    bad(
        "mesh: element cut short",
        " -2         1         2         5         4\n",
        "",
    );
    bad(
        "mesh: strange line",
        " -2         1         2         5         4\n",
        "x\n",
    );
    bad(
        "mesh: type that is no number",
        "    9    0    1\n",
        "    q    0    1\n",
    );
    m.add(
        "mesh: no nodes",
        frd::mesh("model.frd", b"    1C\n 9999\n", &options),
    );
    m.show("result_files");
}

#[test]
fn gmsh_files() {
    let good = "$MeshFormat\n4.1 0 8\n$EndMeshFormat\n$PhysicalNames\n1\n2 7 \"glass\"\n$EndPhysicalNames\n\
        $Entities\n0 0 1 0\n1 0 0 0 1 1 0 1 7 0\n$EndEntities\n\
        $Nodes\n1 3 1 3\n2 1 0 3\n1\n2\n3\n0 0 0\n1 0 0\n0 1 0\n$EndNodes\n\
        $Elements\n1 1 1 1\n2 1 2 1\n1 1 2 3\n$EndElements\n\
        $NodeData\n1\n\"u\"\n1\n0.0\n3\n0\n3\n2\n1 0 0 0\n2 0 0 0.1\n$EndNodeData\n";
    let options = ReadOptions::default();
    let read = |bytes: &[u8]| gmsh::mesh("model.msh", bytes, Vectors::Displacement, &options);
    assert_eq!(
        read(good.as_bytes()).unwrap().element_set("glass").unwrap(),
        [1]
    );
    let mut m = Messages::default();
    let mut bad = |title: &str, from: &str, to: &str| {
        assert!(good.contains(from), "{title}");
        m.add(title, read(good.replacen(from, to, 1).as_bytes()));
    };
    bad("another version", "4.1 0 8", "4 0 8");
    bad("neither text nor binary", "4.1 0 8", "4.1 2 8");
    bad("other numbers", "4.1 0 8", "4.1 0 4");
    bad("no format", "$MeshFormat", "$Nodes");
    bad("stray words", "$Nodes", "Nodes");
    bad("physical name without a name", "2 7 \"glass\"", "2 7");
    bad(
        "too many names",
        "$PhysicalNames\n1",
        "$PhysicalNames\n99999999999",
    );
    bad(
        "entity with a strange number",
        "1 0 0 0 1 1 0 1 7 0",
        "1 0 0 0 1 1 0 x 7 0",
    );
    bad(
        "too many groups",
        "1 0 0 0 1 1 0 1 7 0",
        "1 0 0 0 1 1 0 1000000 7 0",
    );
    bad("too many nodes", "2 1 0 3\n", "2 1 0 4000000000\n");
    bad("fewer nodes than said", "2 1 0 3\n", "2 1 0 2\n");
    bad("parametric", "2 1 0 3\n", "2 1 5 3\n");
    bad("node zero", "3\n1\n2\n3\n0", "3\n0\n2\n3\n0");
    bad(
        "position that is not finite",
        "0 1 0\n$EndNodes",
        "0 -nan 0\n$EndNodes",
    );
    bad(
        "type of elements unknown",
        "2 1 2 1\n1 1 2 3",
        "2 1 99 1\n1 1 2 3",
    );
    bad(
        "too many elements",
        "2 1 2 1\n1 1 2 3",
        "2 1 2 1000\n1 1 2 3",
    );
    bad(
        "too few nodes of an element",
        "1 1 2 3\n$EndE",
        "1 1 2\n$EndE",
    );
    bad("too many values", "3\n0\n3\n2\n", "3\n0\n3\n500\n");
    bad("values of a strange kind", "3\n0\n3\n2\n", "3\n0\n81\n2\n");
    bad("too many tags", "$NodeData\n1\n", "$NodeData\n101\n");
    bad("node moved twice", "\n2 0 0 0.1", "\n1 0 0 0.1");
    bad("displacement that is infinite", "0 0 0.1", "0 0 inf");
    bad("cut short", "2 0 0 0.1\n$EndNodeData\n", "");
    bad(
        "section without an end",
        "$EndElements\n",
        "$EndElements\n$Periodic\n",
    );
    let binary = include_bytes!("data/simple-4.1-binary.msh");
    let mut bad = |title: &str, bytes: &[u8]| m.add(title, read(bytes));
    bad("binary, cut short", &binary[..1500]);
    let mut broken = binary.to_vec();
    let at = broken.windows(7).position(|w| w == b"$Nodes\n").unwrap() + 7;
    broken[at..at + 8].copy_from_slice(&u64::MAX.to_le_bytes());
    bad("binary, too many blocks", &broken);
    let binary = include_bytes!("data/simple-2.2-binary.msh");
    let mut broken = binary.to_vec();
    broken[20] = 9;
    bad("binary, order of bytes", &broken);
    let mut broken = binary.to_vec();
    let at = broken.windows(7).position(|w| w == b"$Nodes\n").unwrap() + 10;
    broken[at..at + 4].copy_from_slice(&(-5_i32).to_le_bytes());
    bad("binary, node below zero", &broken);
    let mut broken = binary.to_vec();
    broken[at + 4..at + 12].copy_from_slice(&f64::NAN.to_le_bytes());
    bad("binary, not a number", &broken);
    bad("empty", b"");
    m.show("gmsh_files");
}

#[test]
fn vtk_files() {
    let mut m = Messages::default();
    let options = ReadOptions::default();
    let read = |name: &str, bytes: &[u8]| vtk::mesh(name, bytes, Vectors::Displacement, &options);
    let good = include_str!("data/vtk/grid-42.vtk");
    read("good", good.as_bytes()).unwrap();
    let mut bad = |title: &str, from: &str, to: &str| {
        assert!(good.contains(from), "{title}");
        m.add(
            title,
            read("model.vtk", good.replacen(from, to, 1).as_bytes()),
        );
    };
    bad("first line", "# vtk DataFile", "# vtx DataFile");
    bad("neither text nor binary", "ASCII", "ASCI");
    bad("another data set", "UNSTRUCTURED_GRID", "STRUCTURED_GRID");
    bad("points of text", "POINTS 30 double", "POINTS 30 string");
    bad("too many points", "POINTS 30", "POINTS 3000000000000");
    bad("fewer points than said", "POINTS 30", "POINTS 31");
    bad("point that is no number", "0 0 0 1", "0 zero 0 1");
    bad("point that is not finite", "0 0 0 1", "0 nan 0 1");
    bad("cell with too many points", "\n4 0 1 2 3", "\n9 0 1 2 3");
    bad("point below zero", "\n4 0 1 2 3", "\n4 0 1 -2 3");
    bad("cells fewer than said", "CELLS 6", "CELLS 7");
    bad("types fewer than cells", "CELL_TYPES 6", "CELL_TYPES 5");
    bad(
        "type with other points",
        "CELL_TYPES 6\n9",
        "CELL_TYPES 6\n12",
    );
    bad("stray word", "CELL_DATA", "CELLDATA");
    bad("labels fewer than cells", "part 1 6 int", "part 1 5 int");
    bad("array without a type", "part 1 6 int", "part 1 6 0");
    bad(
        "displacements fewer than points",
        "displacement 3 30",
        "displacement 3 29",
    );
    let good = include_str!("data/vtk/grid-51.vtk");
    let mut bad = |title: &str, from: &str, to: &str| {
        assert!(good.contains(from), "{title}");
        m.add(
            title,
            read("model.vtk", good.replacen(from, to, 1).as_bytes()),
        );
    };
    bad("offsets that fall", "0 4 7 15", "0 4 3 15");
    bad("offsets that end too early", "29 31", "29 30");
    bad("no connectivity", "CONNECTIVITY", "CONNECTED");
    let good = include_bytes!("data/vtk/grid-42-binary.vtk");
    m.add("binary, cut short", read("model.vtk", &good[..700]));
    m.add("binary, cut in the points", read("model.vtk", &good[..200]));
    let good = include_str!("data/vtk/grid-ascii-plain.vtu");
    read("good", good.as_bytes()).unwrap();
    let mut bad = |title: &str, from: &str, to: &str| {
        assert!(good.contains(from), "{title}");
        m.add(
            title,
            read("model.vtu", good.replacen(from, to, 1).as_bytes()),
        );
    };
    bad("XML: another kind", "\"UnstructuredGrid\"", "\"ImageData\"");
    bad("XML: not VTK", "VTKFile", "HTML");
    bad("XML: order of bytes", "LittleEndian", "MiddleEndian");
    bad("XML: head", "UInt32", "UInt16");
    bad("XML: tags that do not close", "</Points>", "</Pts>");
    bad(
        "XML: number of points",
        "NumberOfPoints=\"30\"",
        "NumberOfPoints=\"31\"",
    );
    bad(
        "XML: number of points is text",
        "NumberOfPoints=\"30\"",
        "NumberOfPoints=\"many\"",
    );
    bad(
        "XML: number of cells",
        "NumberOfCells=\"6\"",
        "NumberOfCells=\"5\"",
    );
    bad(
        "XML: type of an array",
        "<DataArray type=\"Float64\" Name=\"Points\"",
        "<DataArray type=\"String\" Name=\"Points\"",
    );
    bad(
        "XML: format of an array",
        "format=\"ascii\"",
        "format=\"hex\"",
    );
    bad(
        "XML: binary that is none",
        "format=\"ascii\"",
        "format=\"binary\"",
    );
    bad(
        "XML: components",
        "NumberOfComponents=\"3\"",
        "NumberOfComponents=\"x\"",
    );
    bad(
        "XML: appended without data",
        "format=\"ascii\"",
        "format=\"appended\" offset=\"4\"",
    );
    bad("XML: no offset", "format=\"ascii\"", "format=\"appended\"");
    bad("XML: no types", "Name=\"types\"", "Name=\"kinds\"");
    bad("XML: no number", "0 1 2 3", "0 1 2 x");
    let good = include_bytes!("data/vtk/grid-appended-zlib-raw.vtu");
    let head = good
        .windows(13)
        .position(|w| w == b"<AppendedData")
        .unwrap();
    let start = head + good[head..].iter().position(|&b| b == b'_').unwrap();
    let mut broken = good.to_vec();
    broken[start + 1..start + 5].copy_from_slice(&u32::MAX.to_le_bytes());
    m.add("XML: too many blocks", read("model.vtu", &broken));
    let mut broken = good.to_vec();
    broken[start + 60..start + 90].fill(7);
    m.add("XML: packed bytes broken", read("model.vtu", &broken));
    let mut broken = good.to_vec();
    broken[start] = b'x';
    m.add("XML: no mark", read("model.vtu", &broken));
    m.add(
        "XML: cut short",
        read("model.vtu", &good[..good.len() - 200]),
    );
    let mut small = options;
    small.limits.bytes = 100_000;
    // 4 kB that unpack to 3 MB of zeros.
    let bomb = include_bytes!("data/bomb.vtu");
    read("bomb.vtu", bomb).unwrap();
    let packed = vtk::mesh("bomb.vtu", bomb, Vectors::Displacement, &small);
    m.add("XML: unpacks to too much", packed);
    m.add("empty", read("model.vtk", b""));
    m.show("vtk_files");
}

#[test]
fn tables() {
    let mut m = Messages::default();
    let options = ReadOptions::default();
    let nodes = |text: &str| csv::nodes("nodes.csv", text.as_bytes(), &options);
    m.add("empty", nodes(""));
    m.add("no column of numbers", nodes("id,x_m,y_m,z_m\n"));
    m.add("no column z", nodes("node,x_m,y_m\n1,0,0\n"));
    m.add(
        "displacements in part",
        nodes("node,x_m,y_m,z_m,ux_m\n1,0,0,0,0\n"),
    );
    m.add("ragged", nodes("node,x_m,y_m,z_m\n1,0,0\n"));
    m.add("decimal comma", nodes("node;x_m;y_m;z_m\n1;0,5;0;0\n"));
    m.add("empty cell", nodes("node,x_m,y_m,z_m\n1,0,,0\n"));
    m.add("not finite", nodes("node,x_mm,y_mm,z_mm\n1,0,NaN,0\n"));
    let good = "node,x_m,y_m,z_m\n1,0,0,0\n2,1,0,0\n3,0,1,0\n4,1,1,0\n";
    let elements = |text: &str| {
        nodes(good)
            .unwrap()
            .elements("elements.csv", text.as_bytes())
    };
    m.add("no third node", elements("element,node1,node2\n1,1,2\n"));
    m.add("two nodes", elements("element,node1,node2,node3\n1,1,2,\n"));
    m.add(
        "unknown shape",
        elements("element,node1,node2,node3,shape\n1,1,2,3,disc\n"),
    );
    m.add(
        "shape of other nodes",
        elements("element,node1,node2,node3,shape\n1,1,2,3,wedge\n"),
    );
    m.add(
        "element that is no number",
        elements("element,node1,node2,node3\nA,1,2,3\n"),
    );
    let moved = |text: &str| csv::displacements("u.csv", text.as_bytes(), &options);
    m.add(
        "displacement twice",
        moved("node,ux_m,uy_m,uz_m\n1,0,0,0\n1,0,0,0\n"),
    );
    m.add(
        "displacement that is text",
        moved("node,ux_m,uy_m,uz_m\n1,0,0,-\n"),
    );
    m.show("tables");
}

#[test]
fn choices() {
    let mut m = Messages::default();
    let text = format!("{NODES}*NSET,NSET=CORNERS\n1,2\n*ELEMENT,TYPE=B31,ELSET=FRAME\n1,1,2\n");
    let read = |text: &str| inp::mesh("m", text.as_bytes(), &ReadOptions::default()).unwrap();
    let options = MirrorOptions::toward([0.0, 0.0, 1.0]).unwrap();
    let frame = read(&text);
    m.add("no mirror", frame.mirror(&Pick::All, &options));
    m.add(
        "unknown element set",
        frame.mirror(&Pick::ElementSet("GLASS"), &options),
    );
    m.add(
        "unknown node set",
        frame.mirror(&Pick::NodeSet("TOP"), &options),
    );
    m.add(
        "unknown surface",
        frame.mirror(&Pick::Surface("FRONT"), &options),
    );
    let faulty = read(&format!(
        "{NODES}*ELEMENT,TYPE=S3,ELSET=G\n1,1,2,9\n2,1,2,2\n"
    ));
    m.add(
        "all faulty",
        faulty.mirror(&Pick::ElementSet("g"), &options),
    );
    let good = read(&format!(
        "{NODES}*NSET,NSET=A\n1,2\n*ELEMENT,TYPE=S3\n1,1,2,3\n"
    ));
    m.add(
        "set of too few nodes",
        good.mirror(&Pick::NodeSet("a"), &options),
    );
    let mut good = good;
    m.add(
        "displacements of another mesh",
        good.set_displacements_m(vec![[0.0; 3]; 3]),
    );
    m.add("sun without a direction", MirrorOptions::toward([0.0; 3]));
    writeln!(m.0, "# faults\n{}\n", faulty.faults()).unwrap();
    m.show("choices");
}
