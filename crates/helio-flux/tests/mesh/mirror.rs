//! The reflecting side of a mesh: which faces, which way round, which facet.

use helio_flux::Element;
use helio_flux::mesh::{Mesh, MeshError, Mirror, MirrorOptions, Pick, ReadOptions, inp};

fn mesh(model: &str) -> Mesh {
    inp::mesh("m.inp", model.as_bytes(), &ReadOptions::default()).unwrap()
}

fn toward(sun: [f64; 3]) -> MirrorOptions {
    MirrorOptions::toward(sun).unwrap()
}

fn normals(mirror: &Mirror) -> Vec<[f64; 3]> {
    let at = |node: &u32| mirror.position_m()[*node as usize];
    let element = |face: &helio_flux::mesh::MirrorFace| {
        let corners: Vec<_> = face.corners().iter().map(at).collect();
        match corners[..] {
            [a, b, c] => Element::triangle([a, b, c]),
            [a, b, c, d] => Element::quadrilateral([a, b, c, d]),
            _ => unreachable!("three or four corners"),
        }
    };
    mirror
        .faces()
        .iter()
        .map(|f| element(f).unwrap().normal())
        .collect()
}

/// Two glasses of 2 x 1 solids, 1 apart, inclined like a roof (slope 1 in 4) and 4 mm thick, on a thick
/// foot each that shares nodes with the glass from below; `kind` makes of each brick its elements.
fn roof(kind: &str) -> String {
    let mut nodes = String::from("*NODE\n");
    let mut glass = Vec::new();
    let mut foot = Vec::new();
    for side in [0, 1] {
        let base = 1 + 100 * side;
        let out = if side == 0 { 1.0 } else { -1.0 };
        for layer in 0..3 {
            for i in 0..3 {
                for j in 0..2 {
                    let z = [0.0, 0.3, 0.304][layer];
                    let (x, y) = (f64::from(i), f64::from(j));
                    let id = base + 10 * layer as i32 + 2 * i + j;
                    let lift = if layer > 0 { -0.25 * x } else { -0.25 };
                    let (px, pz) = (out * (1.0 + x), 1.0 + z + lift);
                    nodes += &format!("{id},{px},{y},{pz}\n");
                }
            }
        }
        for layer in 0..2 {
            for i in 0..2 {
                let at = |layer: i32, i: i32, j: i32| base + 10 * layer + 2 * i + j;
                // Counterclockwise from above; the other side of the roof is a mirror image.
                let ring = |layer: i32| {
                    let mut ring = [
                        at(layer, i, 0),
                        at(layer, i + 1, 0),
                        at(layer, i + 1, 1),
                        at(layer, i, 1),
                    ];
                    if side == 1 {
                        ring.reverse();
                    }
                    ring
                };
                let [a, b, c, d] = ring(layer);
                let [e, f, g, h] = ring(layer + 1);
                let into = if layer == 1 { &mut glass } else { &mut foot };
                if layer == 0 && i == 1 {
                    continue;
                }
                match kind {
                    "C3D8" => into.push(vec![a, b, c, d, e, f, g, h]),
                    "inverted C3D8" => into.push(vec![e, f, g, h, a, b, c, d]),
                    "C3D6" => {
                        into.push(vec![a, b, c, e, f, g]);
                        into.push(vec![a, c, d, e, g, h]);
                    }
                    _ => {
                        // Six tetrahedra about the diagonal from a to g.
                        for [p, q] in [[b, c], [c, d], [d, h], [h, e], [e, f], [f, b]] {
                            into.push(vec![a, p, q, g]);
                        }
                    }
                }
            }
        }
    }
    let kind = kind.split(' ').next_back().unwrap();
    let mut next = 0;
    let mut block = |set: &str, elements: &[Vec<i32>]| {
        let mut text = format!("*ELEMENT,TYPE={kind},ELSET={set}\n");
        for nodes in elements {
            next += 1;
            let nodes: Vec<_> = nodes.iter().map(i32::to_string).collect();
            text += &format!("{next},{}\n", nodes.join(","));
        }
        text
    };
    nodes + &block("GLASS", &glass) + &block("FOOT", &foot)
}

/// The upper faces of both glasses, and neither rims nor backs nor feet.
#[test]
fn the_sunny_side_of_solids_of_every_shape() {
    let up = (1.0_f64 + 0.0625).sqrt();
    for (kind, faces) in [("C3D8", 4), ("inverted C3D8", 4), ("C3D6", 8), ("C3D4", 8)] {
        let mesh = mesh(&roof(kind));
        assert_eq!(
            mesh.faults().inverted.count() > 0,
            kind.starts_with("inverted"),
            "{kind}: {}",
            mesh.faults()
        );
        let mirror = mesh
            .mirror(&Pick::ElementSet("GLASS"), &toward([0.3, 0.0, 1.0]))
            .unwrap();
        assert_eq!(
            (mirror.faces().len(), mirror.facets()),
            (faces, 2),
            "{kind}"
        );
        for (face, normal) in mirror.faces().iter().zip(normals(&mirror)) {
            let side = if face.facet() == 0 { 1.0 } else { -1.0 };
            let wanted = [side * 0.25 / up, 0.0, 1.0 / up];
            assert!(
                (0..3).all(|k| (normal[k] - wanted[k]).abs() < 1e-14),
                "{kind} {normal:?}"
            );
        }
        // The sun below: the backs, as far as the feet leave them free.
        let below = mesh.mirror(&Pick::ElementSet("GLASS"), &toward([0.0, 0.0, -1.0]));
        assert_eq!(below.unwrap().faces().len(), faces / 2, "{kind}");
    }
}

#[test]
fn surfaces_and_node_sets_choose_the_same_faces() {
    let model = roof("C3D8")
        + "*SURFACE,NAME=FRONT\nGLASS,S2\n\
           *NSET,NSET=TOP,GENERATE\n21,26,1\n121,126,1\n*SURFACE,NAME=NONE\n9999,S1\n\
           *SURFACE,NAME=WRONG\n1,S6\nGLASS,S2\n";
    let mesh = mesh(&model);
    let options = toward([0.0, 0.0, 1.0]);
    let of = |pick| mesh.mirror(&pick, &options).unwrap();
    let glass = of(Pick::ElementSet("glass"));
    assert_eq!(of(Pick::Surface("front")), glass);
    assert_eq!(of(Pick::NodeSet("top")), glass);
    assert_eq!(glass.faces()[0].element(), 1);
    assert_eq!(glass.node_ids()[..6], [21, 22, 23, 24, 25, 26]);
    let error = mesh.mirror(&Pick::Surface("none"), &options).unwrap_err();
    assert!(matches!(error, MeshError::NoFaces { .. }), "{error}");
}

/// A bowl of shells, wound at random: seen by a sun so low that it stands behind some of its faces.
#[test]
fn shells_are_wound_like_their_neighbours_and_turned_together() {
    let mut nodes = String::from("*NODE\n");
    let mut elements = String::from("*ELEMENT,TYPE=S4\n");
    let count = 8;
    for i in 0..=count {
        for j in 0..=count {
            let (x, y) = (f64::from(i) / 4.0 - 1.0, f64::from(j) / 4.0 - 1.0);
            nodes += &format!("{},{x},{y},{}\n", 100 * i + j + 1, 0.5 * (x * x + y * y));
        }
    }
    let mut rewound = Vec::new();
    for i in 0..count {
        for j in 0..count {
            let at = |i, j| 100 * i + j + 1;
            let mut ring = [at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)];
            let id = 1 + i * count + j;
            if id != 1 && (i * 7 + j * 5) % 3 == 0 {
                ring.reverse();
                rewound.push(id as u64);
            }
            let [a, b, c, d] = ring;
            elements += &format!("{id},{a},{b},{c},{d}\n");
        }
    }
    let mesh = mesh(&(nodes + &elements));
    let mirror = mesh.mirror(&Pick::All, &toward([0.9, 0.0, 0.3])).unwrap();
    assert_eq!(mirror.facets(), 1);
    let mut behind = 0;
    for normal in normals(&mirror) {
        assert!(normal[2] > 0.0, "{normal:?}");
        behind += usize::from(0.9 * normal[0] + 0.3 * normal[2] < 0.0);
    }
    assert!(behind > 0);
    assert_eq!(mirror.rewound().count(), rewound.len() as u64);
    assert_eq!(mirror.rewound().first()[..], rewound[..8]);
}

#[test]
fn creases_part_facets() {
    // Two squares that meet at an angle of 30° along a shared edge.
    let (c, s) = (30.0_f64.to_radians().cos(), 30.0_f64.to_radians().sin());
    let model = format!(
        "*NODE\n1,0,0,0\n2,0,1,0\n3,-1,0,0\n4,-1,1,0\n5,{c},0,{s}\n6,{c},1,{s}\n\
         *ELEMENT,TYPE=S4\n1,3,1,2,4\n2,1,5,6,2\n"
    );
    let mesh = mesh(&model);
    let facets = |degrees: f64| {
        let options = toward([0.0, 0.0, 1.0]).with_crease_rad(degrees.to_radians());
        mesh.mirror(&Pick::All, &options.unwrap()).unwrap().facets()
    };
    assert_eq!((facets(29.0), facets(31.0)), (2, 1));
    assert!(toward([0.0, 0.0, 1.0]).with_crease_rad(2.0).is_err());
    assert!(MirrorOptions::toward([0.0; 3]).is_err());
    assert!(MirrorOptions::toward([f64::NAN, 0.0, 1.0]).is_err());
}

#[test]
fn faulty_elements_have_no_face_and_are_named() {
    let model = "*NODE\n1,0,0,0\n2,1,0,0\n3,1,1,0\n4,0,1,0\n\
        *ELEMENT,TYPE=S4\n1,1,2,3,4\n2,1,2,3,99\n3,1,3,2,4\n";
    let mirror = mesh(model).mirror(&Pick::All, &toward([0.0, 0.0, 1.0]));
    let mirror = mirror.unwrap();
    assert_eq!(mirror.faces().len(), 1);
    assert_eq!(
        (mirror.unusable().count(), mirror.unusable().first()),
        (2, &[2, 3][..])
    );
}

/// A membrane on the front of a glass shares its nodes: the face counts once.
#[test]
fn a_skin_of_shells_is_no_second_mirror() {
    let model = "*NODE\n1,0,0,0\n2,1,0,0\n3,1,1,0\n4,0,1,0\n5,0,0,.1\n6,1,0,.1\n7,1,1,.1\n8,0,1,.1\n\
        *ELEMENT,TYPE=C3D8,ELSET=GLASS\n1,1,2,3,4,5,6,7,8\n*ELEMENT,TYPE=M3D4,ELSET=GLASS\n2,8,7,6,5\n";
    let mesh = mesh(model);
    for pick in [Pick::All, Pick::ElementSet("GLASS")] {
        let mirror = mesh.mirror(&pick, &toward([0.0, 0.0, 1.0])).unwrap();
        assert_eq!(mirror.faces().len(), 1);
        assert_eq!(mirror.unusable().first(), [2]);
        assert_eq!(normals(&mirror), [[0.0, 0.0, 1.0]]);
    }
}

// Both sides of a ridge of one solid look up, at arctan 2 each: one counts, the other is told.
#[test]
fn what_a_body_leaves_aside_is_counted() {
    let ridge = mesh(
        "*NODE\n1,0,0,0\n2,1,0,2\n3,2,0,0\n4,0,1,0\n5,1,1,2\n6,2,1,0\n*ELEMENT,TYPE=C3D6\n1,1,2,3,4,5,6\n\
         *SURFACE,NAME=BOTH\n1,S3\n1,S4\n",
    );
    let up = toward([0.0, 0.0, 1.0]);
    let mirror = ridge.mirror(&Pick::All, &up).unwrap();
    let aside = mirror.left_aside();
    assert_eq!(mirror.faces().len(), 1);
    assert_eq!((aside.faces(), aside.patches()), (1, 1));
    assert!((aside.part() - 1.0).abs() < 1e-14, "{}", aside.part());
    let named = ridge.mirror(&Pick::Surface("BOTH"), &up).unwrap();
    assert_eq!((named.faces().len(), named.left_aside().faces()), (2, 0));
}

// Two parts of one glass, each with nodes of its own (as a file of six digits rounds them), shells and solids: what stands
// where another does counts once, whichever way round it is wound; what stands elsewhere, however near, counts.
#[test]
fn parts_that_stand_one_on_the_other_count_once() {
    let part = |first: u32, z: f64, last: f64| {
        let at = [(0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0)];
        let node = |(k, (x, y)): (u32, &(f64, f64))| {
            format!("{},{},{},{z}\n", first + k, x + last, y - last)
        };
        (0..).zip(&at).map(node).collect::<String>()
    };
    let up = toward([0.0, 0.0, 1.0]);
    let model = |z: f64, last: f64| {
        mesh(&format!(
            "*NODE\n{}{}{}*ELEMENT,TYPE=S4,ELSET=A\n1,1,2,3,4\n*ELEMENT,TYPE=S4,ELSET=B\n2,14,13,12,11\n\
             *ELEMENT,TYPE=S4,ELSET=A\n3,21,22,23,24\n",
            part(1, 0.0, 0.0),
            part(11, z, last),
            part(21, 10.0, 0.0)
        ))
    };
    for last in [0.0, 4e-6] {
        let mirror = model(0.0, last).mirror(&Pick::All, &up).unwrap();
        let again = mirror.coincident();
        assert_eq!((mirror.faces().len(), again.first()), (2, &[2][..]));
        assert_eq!((again.count(), mirror.unusable().count()), (1, 0));
    }
    // the second part alone is a mirror like any other
    let alone = model(0.0, 0.0).mirror(&Pick::ElementSet("B"), &up).unwrap();
    assert_eq!((alone.faces().len(), alone.coincident().count()), (1, 0));
    // half a millimetre apart: two
    let apart = model(5e-4, 0.0).mirror(&Pick::All, &up).unwrap();
    assert_eq!((apart.faces().len(), apart.coincident().count()), (3, 0));
    // a shell on the face of a solid that has other nodes
    let glass = "*NODE\n1,0,0,0\n2,1,0,0\n3,1,1,0\n4,0,1,0\n5,0,0,.1\n6,1,0,.1\n7,1,1,.1\n8,0,1,.1\n\
        15,0,0,.1\n16,1,0,.1\n17,1,1,.1\n18,0,1,.1\n*ELEMENT,TYPE=C3D8\n1,1,2,3,4,5,6,7,8\n\
        *ELEMENT,TYPE=S4\n2,15,16,17,18\n";
    let mirror = mesh(glass).mirror(&Pick::All, &up).unwrap();
    assert_eq!((mirror.faces().len(), mirror.coincident().count()), (1, 1));
}

// A square and the same as two triangles, by either diagonal and in any order: 1 m² of mirror, not 2; half of it, or
// triangles that do not match it, are no second square.
#[test]
fn a_quadrilateral_on_two_triangles_counts_once() {
    let nodes = "*NODE\n1,0,0,0\n2,1,0,0\n3,1,1,0\n4,0,1,0\n11,0,0,0\n12,1,0,0\n13,1,1,0\n14,0,1,0\n15,0.5,0.5,0\n";
    let square = "*ELEMENT,TYPE=S4\n1,1,2,3,4\n";
    let of = |elements: &[&str]| {
        let mirror = mesh(&format!("{nodes}{}", elements.concat()))
            .mirror(&Pick::All, &toward([0.0, 0.0, 1.0]))
            .unwrap();
        let each_m2 = |corners: usize| if corners == 4 { 1.0 } else { 0.5 };
        let faces = mirror.faces().iter();
        let area_m2: f64 = faces.map(|face| each_m2(face.corners().len())).sum();
        (mirror.coincident().first().to_vec(), area_m2)
    };
    for halves in ["2,11,12,13\n3,11,13,14\n", "2,14,11,12\n3,13,14,12\n"] {
        let halves = format!("*ELEMENT,TYPE=S3\n{halves}");
        let (one, other) = halves.split_at(halves.find("\n3,").unwrap() + 1);
        let other = format!("*ELEMENT,TYPE=S3\n{other}");
        assert_eq!(of(&[square, &halves]), (vec![2, 3], 1.0));
        assert_eq!(of(&[&halves, square]), (vec![1], 1.0));
        assert_eq!(of(&[one, square, &other]), (vec![1], 1.0));
        assert_eq!(of(&[square, one]), (vec![], 1.5));
    }
    // one corner lies elsewhere
    let unlike = "*ELEMENT,TYPE=S3\n2,11,12,13\n3,11,13,15\n";
    assert!(of(&[square, unlike]).0.is_empty());
}

// Elements far smaller than a millionth of the mesh's extent stay apart from their neighbours.
#[test]
fn small_faces_far_apart_are_not_taken_for_one() {
    let mut model = String::from("*NODE\n");
    let mut elements = String::from("*ELEMENT,TYPE=S3\n");
    for k in 0..40 {
        let (first, x) = (10 * k + 1, 1e-7 * f64::from(k));
        model += &format!(
            "{first},{x},0,0\n{},{},0,0\n{},{x},1e-7,0\n",
            first + 1,
            x + 1e-7,
            first + 2
        );
        elements += &format!("{},{first},{},{}\n", k + 1, first + 1, first + 2);
    }
    model += "901,1,0,0\n902,1,1,0\n903,0,1,0\n";
    elements += "99,901,902,903\n";
    let mirror = mesh(&(model + &elements))
        .mirror(&Pick::All, &toward([0.0, 0.0, 1.0]))
        .unwrap();
    assert_eq!((mirror.faces().len(), mirror.coincident().count()), (41, 0));
}
