//! What is asked of any bytes, in the tests of this crate and by `fuzz/`: a message, or a mesh that goes
//! the whole way to slope errors.

use helio_flux::deform::{PoseFit, SlopeErrors, reconstruct_poses, substitute_elements};
use helio_flux::mesh::frd::Step;
use helio_flux::mesh::{
    Mesh, MirrorOptions, Pick, ReadError, ReadOptions, Vectors, csv, frd, gmsh, inp, vtk,
};

/// Limits that a small file does not reach in earnest.
pub fn options() -> ReadOptions {
    let mut options = ReadOptions::default();
    options.limits.bytes = 4 << 20;
    options.limits.nodes = 1 << 17;
    options.limits.elements = 1 << 17;
    options.limits.set_members = 1 << 18;
    options
}

/// Reads bytes as the format of this name.
pub fn read(format: &str, bytes: &[u8]) {
    let options = options();
    match format {
        "inp" => {
            let mut depth = 0;
            whole_way(inp::mesh_with("m.inp", bytes, &options, &mut |_| {
                depth += 1;
                Ok(bytes[bytes.len() / 2..].to_vec())
            }));
            assert!(depth <= 200, "{depth} files opened");
        }
        "frd" => {
            match frd::displacements("m.frd", bytes, Step::Last, &options) {
                Ok(moved) => assert_eq!(moved.node_ids().len(), moved.displacement_m().len()),
                Err(error) => told(&error),
            }
            whole_way(frd::mesh("m.frd", bytes, &options));
        }
        "gmsh" => whole_way(gmsh::mesh("m.msh", bytes, Vectors::Displacement, &options)),
        "vtk" => whole_way(vtk::mesh("m.vtk", bytes, Vectors::Displacement, &options)),
        "csv" => {
            // Three tables, one behind the other.
            let mark = b"\n---\n";
            let next = |bytes: &[u8]| bytes.windows(mark.len()).position(|w| w == mark);
            let (nodes, rest) = match next(bytes) {
                Some(at) => (&bytes[..at], &bytes[at + mark.len()..]),
                None => (bytes, &b""[..]),
            };
            let (elements, moved) = match next(rest) {
                Some(at) => (&rest[..at], &rest[at + mark.len()..]),
                None => (rest, &b""[..]),
            };
            let moved = csv::displacements("u.csv", moved, &options);
            let mesh = csv::nodes("n.csv", nodes, &options)
                .and_then(|nodes| nodes.elements("e.csv", elements))
                .map(|mut mesh| {
                    match moved {
                        Ok(moved) => drop(mesh.displace(&moved)),
                        Err(error) => told(&error),
                    }
                    mesh
                });
            whole_way(mesh);
        }
        other => panic!("no format {other}"),
    }
}

/// A message is there, on one line, and not as long as the file.
fn told(error: &ReadError) {
    let text = error.to_string();
    assert!(
        !text.is_empty() && text.len() < 5000,
        "{} bytes",
        text.len()
    );
    assert!(text.lines().count() == 1, "{text}");
}

fn whole_way(mesh: Result<Mesh, ReadError>) {
    let mut mesh = match mesh {
        Ok(mesh) => mesh,
        Err(error) => return told(&error),
    };
    assert_eq!(mesh.elements().count(), mesh.len());
    let text = mesh.faults().to_string();
    assert!(mesh.faults().is_empty() || !text.is_empty());
    if mesh.displacement_m().is_none() {
        let by_m = mesh
            .position_m()
            .iter()
            .map(|at| [0.0, 0.0, 0.01 * at[0]])
            .collect();
        mesh.set_displacements_m(by_m).expect("one per node");
    }
    let options = MirrorOptions::toward([0.1, 0.2, 1.0]).expect("a direction");
    let owned = |names: &mut dyn Iterator<Item = &str>| -> Vec<String> {
        names.take(2).map(str::to_owned).collect()
    };
    let (sets, surfaces) = (owned(&mut mesh.element_sets()), owned(&mut mesh.surfaces()));
    let nodes = owned(&mut mesh.node_sets());
    let picks = std::iter::once(Pick::All)
        .chain(sets.iter().map(|name| Pick::ElementSet(name)))
        .chain(surfaces.iter().map(|name| Pick::Surface(name)))
        .chain(nodes.iter().map(|name| Pick::NodeSet(name)));
    for pick in picks {
        let Ok(mirror) = mesh.mirror(&pick, &options) else {
            continue;
        };
        assert!(!mirror.faces().is_empty());
        for face in mirror.faces() {
            assert!(face.facet() < mirror.facets());
            let nodes = mirror.position_m().len();
            assert!(
                face.corners()
                    .iter()
                    .all(|&corner| (corner as usize) < nodes)
            );
        }
        let elements = substitute_elements(&mirror).expect("it has displacements");
        let (rigid, poses) =
            reconstruct_poses(&mirror, PoseFit::ThreePoints).expect("it has displacements");
        assert_eq!(poses.len(), mirror.facets() as usize);
        let (fitted, _) =
            reconstruct_poses(&mirror, PoseFit::LeastSquares).expect("it has displacements");
        for deformed in [elements, rigid, fitted] {
            assert_eq!(deformed.ideal().len(), mirror.faces().len());
            // The axis may be along a normal, which is said.
            let Ok(slopes) = SlopeErrors::new(&deformed, [0.3, 0.8, 0.1]) else {
                continue;
            };
            for (slope, loaded) in slopes.total_rad().iter().zip(deformed.loaded()) {
                assert_eq!(slope.is_nan(), loaded.is_none());
                assert!(slope.is_nan() || (0.0..=3.15).contains(slope));
            }
        }
    }
}
