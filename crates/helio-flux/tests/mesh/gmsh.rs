//! Files that Gmsh wrote, against what Gmsh says of them.

use helio_flux::deform::substitute_elements;
use helio_flux::mesh::{Mesh, MirrorOptions, Pick, ReadOptions, Vectors, gmsh};

const FILES: [(&str, &[u8]); 8] = [
    ("simple-2.2", include_bytes!("data/simple-2.2.msh")),
    (
        "simple-2.2-binary",
        include_bytes!("data/simple-2.2-binary.msh"),
    ),
    ("simple-4.1", include_bytes!("data/simple-4.1.msh")),
    (
        "simple-4.1-binary",
        include_bytes!("data/simple-4.1-binary.msh"),
    ),
    ("quadratic-2.2", include_bytes!("data/quadratic-2.2.msh")),
    (
        "quadratic-2.2-binary",
        include_bytes!("data/quadratic-2.2-binary.msh"),
    ),
    ("quadratic-4.1", include_bytes!("data/quadratic-4.1.msh")),
    (
        "quadratic-4.1-binary",
        include_bytes!("data/quadratic-4.1-binary.msh"),
    ),
];

fn read(name: &str, bytes: &[u8]) -> Mesh {
    gmsh::mesh(name, bytes, Vectors::Displacement, &ReadOptions::default()).unwrap()
}

/// Area of the upper side of an element set \[m²\].
fn area(mesh: &Mesh, set: &str) -> f64 {
    let options = MirrorOptions::toward([0.0, 0.0, 1.0]).unwrap();
    let mirror = mesh.mirror(&Pick::ElementSet(set), &options).unwrap();
    let deformed = substitute_elements(&mirror).unwrap();
    deformed
        .ideal()
        .iter()
        .map(|element| element.area_m2())
        .sum()
}

#[test]
fn groups_areas_and_displacements_are_those_of_gmsh() {
    let said = include_str!("data/gmsh.csv");
    for (name, bytes) in FILES {
        let mesh = read(name, bytes);
        // Version 2.2 repeats an element for each of its groups.
        let repeated = if name.contains("2.2") {
            mesh.element_set("right").unwrap().len()
        } else {
            0
        };
        assert_eq!(mesh.faults().duplicate.count(), repeated as u64, "{name}");
        assert_eq!(mesh.faults().degenerate.count(), 0);
        assert_eq!(mesh.faults().inverted.count(), 0, "{name}");
        assert_eq!(mesh.faults().missing_nodes.count(), 0);
        let mut compared = 0;
        for line in said.lines().filter(|line| !line.starts_with('#')) {
            let [model, group, count, size] = line.split(',').collect::<Vec<_>>()[..] else {
                panic!("{line}");
            };
            if !name.starts_with(model) {
                continue;
            }
            compared += 1;
            let count: usize = count.parse().unwrap();
            assert_eq!(
                mesh.element_set(group).unwrap().len(),
                count,
                "{name} {group}"
            );
            let size: f64 = size.parse().unwrap();
            // The upper side of the foot is 2 m x 1 m, and as large as its volume over half its height.
            let wanted = if group == "foot" { size / 0.5 } else { size };
            assert!(
                (area(&mesh, group) - wanted).abs() < 1e-11,
                "{name} {group}"
            );
        }
        assert_eq!(compared, 3);
        let moved = mesh.displacement_m().unwrap();
        for (at, by) in mesh.position_m().iter().zip(moved) {
            assert!(by[0] == 0.0 && by[1] == 0.0 && (by[2] - 0.01 * at[0]).abs() < 1e-15);
        }
    }
}

/// The four files of a model hold one mesh; only version 2.2 repeats an element for each of its groups.
#[test]
fn versions_and_kinds_agree() {
    for four in FILES.chunks(4) {
        let first = read(four[0].0, four[0].1);
        for &(name, bytes) in &four[1..] {
            let other = read(name, bytes);
            let mut nodes: Vec<_> = first.node_ids().iter().zip(first.position_m()).collect();
            let mut others: Vec<_> = other.node_ids().iter().zip(other.position_m()).collect();
            nodes.sort_by_key(|node| *node.0);
            others.sort_by_key(|node| *node.0);
            assert_eq!(nodes.len(), others.len());
            for (a, b) in nodes.iter().zip(&others) {
                // Text has 16 digits.
                assert!(
                    a.0 == b.0 && (0..3).all(|k| (a.1[k] - b.1[k]).abs() < 1e-14),
                    "{name}"
                );
            }
            let wanted = |mesh: &Mesh| mesh.element_set("mirror").unwrap().len();
            assert_eq!(wanted(&first), wanted(&other));
        }
    }
}

#[test]
fn vectors_are_chosen_by_name() {
    let (name, bytes) = FILES[2];
    let options = ReadOptions::default();
    let of = |vectors| gmsh::mesh(name, bytes, vectors, &options);
    assert_eq!(
        of(Vectors::Named("displacement")).unwrap().displacement_m(),
        read(name, bytes).displacement_m()
    );
    let error = of(Vectors::Named("speed")).unwrap_err().to_string();
    assert_eq!(
        error,
        "simple-4.1: a vector of the nodes named `speed` is missing; wanted one of [displacement]"
    );
    let text = String::from_utf8_lossy(bytes).replace("\"displacement\"", "\"speed\"");
    let mesh = gmsh::mesh(name, text.as_bytes(), Vectors::Displacement, &options).unwrap();
    assert!(mesh.displacement_m().is_none());
}

/// Binary numbers with the highest byte first say so in their first number.
#[test]
fn either_order_of_bytes_is_read() {
    let file = |number: fn(i32) -> [u8; 4], real: fn(f64) -> [u8; 8]| {
        let mut bytes = b"$MeshFormat\n2.2 1 8\n".to_vec();
        bytes.extend(number(1));
        bytes.extend(b"\n$EndMeshFormat\n$Nodes\n3\n");
        for (id, at) in [
            (1, [0.0, 0.0, 0.0]),
            (2, [1.0, 0.0, 0.0]),
            (3, [0.0, 2.5, 0.0]),
        ] {
            bytes.extend(number(id));
            bytes.extend(at.map(real).concat());
        }
        bytes.extend(b"\n$EndNodes\n$Elements\n1\n");
        bytes.extend([2, 1, 2, 9, 5, 5, 1, 2, 3].map(number).concat());
        bytes.extend(b"\n$EndElements\n");
        bytes
    };
    let little = read("little", &file(i32::to_le_bytes, f64::to_le_bytes));
    let big = read("big", &file(i32::to_be_bytes, f64::to_be_bytes));
    assert_eq!(little, big);
    assert_eq!(big.position_m()[2], [0.0, 2.5, 0.0]);
    assert_eq!(big.element_set("physical-5").unwrap(), [9]);
}
