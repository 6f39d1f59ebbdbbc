//! Files that VTK and meshio wrote (`data/make_vtk.py` says of what).

use std::fs;
use std::path::PathBuf;

use helio_flux::deform::{PoseFit, SlopeErrors, reconstruct_poses, write_vtk};
use helio_flux::mesh::{
    ElementStatus, Mesh, MirrorOptions, Pick, ReadError, ReadOptions, Shape, Vectors, csv, vtk,
};

fn folder() -> PathBuf {
    PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("tests/mesh/data/vtk")
}

fn read(name: &str) -> Result<Mesh, ReadError> {
    let bytes = fs::read(folder().join(name)).unwrap();
    vtk::mesh(name, &bytes, Vectors::Displacement, &ReadOptions::default())
}

fn moved_as_written(mesh: &Mesh, name: &str) {
    let moved = mesh.displacement_m().unwrap();
    for (at, by) in mesh.position_m().iter().zip(moved) {
        // Legacy text has six digits.
        let wanted = [0.1, 0.0, 0.01 * at[0]];
        assert!(
            (0..3).all(|k| (by[k] - wanted[k]).abs() < 1e-6),
            "{name}: {by:?}"
        );
    }
}

#[test]
fn every_coat_of_a_grid() {
    let mut seen = 0;
    for entry in fs::read_dir(folder()).unwrap() {
        let name = entry.unwrap().file_name().into_string().unwrap();
        if !name.starts_with("grid") {
            continue;
        }
        seen += 1;
        if name.contains("lz4") {
            assert_eq!(
                read(&name).unwrap_err().to_string(),
                "grid-appended-lz4.vtu:2: `compressor vtkLZ4DataCompressor` is not read; write it with zlib \
                 or without compression"
            );
            continue;
        }
        let mesh = read(&name).unwrap();
        assert_eq!(mesh.position_m().len(), 30, "{name}");
        assert!((mesh.position_m()[29][1] - 1.0 / 3.0).abs() < 1e-10);
        let elements: Vec<_> = mesh.elements().map(|e| (e.0, e.1, e.3)).collect();
        let ok = ElementStatus::Ok;
        assert_eq!(
            elements,
            [
                (0, Shape::Quadrilateral, ok),
                (1, Shape::Triangle, ok),
                (2, Shape::Hexahedron, ok),
                (3, Shape::Wedge, ok),
                (4, Shape::Quadrilateral, ok),
            ],
            "{name}: {}",
            mesh.faults()
        );
        let corners = mesh.elements().nth(4).unwrap().2;
        assert_eq!(corners, [19, 20, 21, 22].map(Some));
        assert_eq!(
            mesh.faults().to_string(),
            "1 element of type `vtk 3` left aside"
        );
        assert_eq!(
            mesh.element_sets().collect::<Vec<_>>(),
            ["part=0", "part=1", "part=2"]
        );
        assert_eq!(mesh.element_set("part=1").unwrap(), [1, 4]);
        moved_as_written(&mesh, &name);
    }
    assert_eq!(seen, 11);
}

#[test]
fn every_coat_of_polygons() {
    let mut seen = 0;
    for entry in fs::read_dir(folder()).unwrap() {
        let name = entry.unwrap().file_name().into_string().unwrap();
        if !name.starts_with("polygons") || name.contains("lz4") {
            continue;
        }
        seen += 1;
        let mesh = read(&name).unwrap();
        let elements: Vec<_> = mesh.elements().map(|e| (e.0, e.1, e.2)).collect();
        // The line counts before the polygons.
        assert_eq!(
            elements,
            [
                (1, Shape::Quadrilateral, [0, 1, 2, 3].map(Some).to_vec()),
                (2, Shape::Triangle, [1, 4, 2].map(Some).to_vec()),
            ],
            "{name}"
        );
        assert_eq!(mesh.element_set("part=5").unwrap(), [1]);
        moved_as_written(&mesh, &name);
    }
    assert_eq!(seen, 10);
}

#[test]
fn files_of_meshio() {
    for name in [
        "meshio.vtk",
        "meshio-ascii.vtk",
        "meshio.vtu",
        "meshio-plain.vtu",
    ] {
        let mesh = read(name).unwrap();
        assert_eq!((mesh.len(), mesh.position_m().len()), (3, 13), "{name}");
        assert!(mesh.faults().is_empty());
        assert_eq!(mesh.element_set("part=2").unwrap(), [2]);
        moved_as_written(&mesh, name);
    }
}

/// Pieces of a file count one behind the other.
#[test]
fn pieces_are_put_together() {
    let piece = |x: f64| {
        format!(
            "<Piece NumberOfPoints=\"3\" NumberOfCells=\"1\"><Points><DataArray type=\"Float64\" \
             NumberOfComponents=\"3\" format=\"ascii\">{x} 0 0 {} 0 0 {x} 1 0</DataArray></Points><Cells>\
             <DataArray type=\"Int64\" Name=\"connectivity\">0 1 2</DataArray><DataArray type=\"Int64\" \
             Name=\"offsets\">3</DataArray><DataArray type=\"UInt8\" Name=\"types\">5</DataArray></Cells></Piece>",
            x + 1.0
        )
    };
    let text = format!(
        "<?xml version=\"1.0\"?>\n<VTKFile type=\"UnstructuredGrid\"><UnstructuredGrid>{}{}</UnstructuredGrid>\
         </VTKFile>",
        piece(0.0),
        piece(5.0)
    );
    let mesh = vtk::mesh(
        "m",
        text.as_bytes(),
        Vectors::Displacement,
        &ReadOptions::default(),
    );
    let mesh = mesh.unwrap();
    let corners: Vec<_> = mesh.elements().map(|e| e.2).collect();
    assert_eq!(corners, [[0, 1, 2].map(Some), [3, 4, 5].map(Some)]);
}

/// What is written for ParaView is read back: the mirror and its displacements.
#[test]
fn maps_come_back() {
    let nodes = "node,x_m,y_m,z_m,ux_m,uy_m,uz_m\n1,0,0,0,0,0,0\n2,1,0,0,0,0,0.1\n3,1,1,0,0,0,0.3\n4,0,1,0,0,0,0\n";
    let elements = "element,node1,node2,node3\n5,1,2,3\n6,1,3,4\n";
    let mesh = csv::nodes("n", nodes.as_bytes(), &ReadOptions::default())
        .and_then(|nodes| nodes.elements("e", elements.as_bytes()))
        .unwrap();
    let options = MirrorOptions::toward([0.0, 0.0, 1.0]).unwrap();
    let mirror = mesh.mirror(&Pick::All, &options).unwrap();
    let (rigid, _) = reconstruct_poses(&mirror, PoseFit::ThreePoints).unwrap();
    let slopes = SlopeErrors::new(&rigid, [1.0, 0.0, 0.0]).unwrap();
    let mut file = Vec::new();
    write_vtk(&mut file, &mirror, &slopes).unwrap();
    let back = vtk::mesh(
        "map.vtk",
        &file,
        Vectors::Displacement,
        &ReadOptions::default(),
    )
    .unwrap();
    assert_eq!(back.position_m(), mirror.position_m());
    assert_eq!(back.displacement_m(), mirror.displacement_m());
    assert_eq!(back.element_set("element=6").unwrap(), [1]);
    assert_eq!(back.element_set("facet=0").unwrap(), [0, 1]);
    let again = back.mirror(&Pick::All, &options).unwrap();
    let corners = |m: &helio_flux::mesh::Mirror| -> Vec<Vec<u32>> {
        m.faces().iter().map(|f| f.corners().to_vec()).collect()
    };
    assert_eq!(corners(&again), corners(&mirror));
}

// Cut before its displacements a file would be a mirror without load.
#[test]
fn files_that_were_cut_off_are_no_files() {
    let whole = r#"<VTKFile type="UnstructuredGrid"><UnstructuredGrid><Piece NumberOfPoints="3" NumberOfCells="1">
<Points><DataArray type="Float64" NumberOfComponents="3" format="ascii">0 0 0 1 0 0 0 1 0</DataArray></Points>
<Cells><DataArray type="Int64" Name="connectivity" format="ascii">0 1 2</DataArray><DataArray type="Int64"
Name="offsets" format="ascii">3</DataArray><DataArray type="UInt8" Name="types" format="ascii">5</DataArray></Cells>
<PointData><DataArray type="Float64" Name="lift" NumberOfComponents="3" format="ascii">0 0 0 0 0 0 0 0 1</DataArray>
</PointData></Piece></UnstructuredGrid></VTKFile>
"#;
    let read = |text: &str| {
        let options = ReadOptions::default();
        vtk::mesh("a.vtu", text.as_bytes(), Vectors::Displacement, &options)
    };
    assert_eq!(read(whole).unwrap().other_vectors(), ["lift"]);
    let after = |mark: &str| &whole[..whole.find(mark).unwrap() + mark.len()];
    for (mark, inside, line) in [
        ("</Cells>\n", "Piece", 5),
        ("<PointData>", "PointData", 5),
        ("0 0 0 0 0 0", "DataArray", 5),
        ("</UnstructuredGrid>", "VTKFile", 6),
    ] {
        let error = read(after(mark)).unwrap_err().to_string();
        let wanted = format!("a.vtu:{line}: the file ends inside <{inside}>");
        assert_eq!(error, wanted, "{mark}");
    }
}
