//! Coloured faces.

use helio_report::flux::{FaceMap, face_map};

use super::drawing::read;

type Face = [[f64; 3]; 4];

fn square(x: f64, y: f64, z: f64, side: f64) -> Face {
    [
        [x, y, z],
        [x + side, y, z],
        [x + side, y + side, z],
        [x, y + side, z],
    ]
}

fn map<'a>(faces_m: &'a [&'a [[f64; 3]]], values: &'a [f64]) -> FaceMap<'a> {
    FaceMap {
        title: "Faces",
        words: "",
        quantity: "slope error",
        unit: "mrad",
        faces_m,
        values,
        toward_viewer: [0.0, 0.0, 3.0],
        signed: false,
    }
}

#[test]
fn nearer_faces_are_drawn_over_farther_ones_and_extremes_are_marked() {
    // the second lies over the first; the third has no value
    let faces = [
        square(0.0, 0.0, 0.0, 2.0),
        square(0.5, 0.5, 1.0, 1.0),
        square(3.0, 0.0, 0.5, 2.0),
        square(0.0, 3.0, 0.0, 2.0),
    ];
    let faces_m: Vec<&[[f64; 3]]> = faces.iter().map(|f| &f[..]).collect();
    let values = [8.0, 2.0, f64::NAN, 4.0];
    let drawing = read(&face_map(&map(&faces_m, &values)).unwrap());
    let order: Vec<&str> = drawing.faces.iter().map(|f| &f.fill[..]).collect();
    // 8, 4, none, 2 of 8 by depth: viridis at 1, 0.5 and 0.25
    assert_eq!(order, ["#fde725", "#21918c", "#dedede", "#3b528b"]);
    assert!(drawing.says("slope error of 4 faces: greatest 8\u{202f}mrad, least 2\u{202f}mrad; 1 without a value, gray"));
    let middle = |k: usize| {
        let e = drawing.faces[k].edges;
        (0.5 * (e[0] + e[2]), 0.5 * (e[1] + e[3]))
    };
    for (mark, wanted) in drawing.marks.iter().zip([middle(0), middle(3)]) {
        assert!((mark.0 - wanted.0).abs() < 0.2 && (mark.1 - wanted.1).abs() < 0.2);
    }
    assert_eq!(drawing.marks.len(), 2);
    assert!(drawing.says("x (m)") && drawing.says("y (m)"));
    // y runs up
    assert!(drawing.faces[1].edges[3] < drawing.faces[0].edges[1]);
    // from the side: right is north of an eye in the east, and up is up
    let side = FaceMap {
        toward_viewer: [1.0, 0.0, 0.0],
        ..map(&faces_m, &values)
    };
    let drawing = read(&face_map(&side).unwrap());
    assert!(drawing.says("y (m)") && drawing.says("z (m)"));
}

#[test]
fn signed_values_are_white_at_zero() {
    let faces = [
        square(0.0, 0.0, 0.0, 1.0),
        square(1.0, 0.0, 0.0, 1.0),
        square(2.0, 0.0, 0.0, 1.0),
    ];
    let faces_m: Vec<&[[f64; 3]]> = faces.iter().map(|f| &f[..]).collect();
    let signed = FaceMap {
        signed: true,
        ..map(&faces_m, &[-5.0, 0.0, 2.5])
    };
    let drawing = read(&face_map(&signed).unwrap());
    let channel = |k: usize, c: usize| {
        u8::from_str_radix(&drawing.faces[k].fill[1 + 2 * c..3 + 2 * c], 16).unwrap()
    };
    assert_eq!(drawing.faces[0].fill, "#2166ac");
    assert!((0..3).all(|c| channel(1, c) > 0xf0));
    assert!(channel(2, 0) > channel(2, 2)); // red
}

// Many faces: one picture whose pixels are the nearest face's, in a file that does not grow with them.
#[test]
fn many_faces_are_one_picture() {
    let side = 640;
    let mut faces: Vec<Face> = (0..side * side)
        .map(|i| square((i % side) as f64, (i / side) as f64, 0.0, 1.0))
        .collect();
    // one large face hovers over the upper right quarter
    let half = side as f64 / 2.0;
    faces.push(square(half, half, 1.0, half));
    let faces_m: Vec<&[[f64; 3]]> = faces.iter().map(|f| &f[..]).collect();
    let mut values: Vec<f64> = (0..side * side)
        .map(|i| if i % side < side / 2 { 0.0 } else { 5.0 })
        .collect();
    values.push(10.0);
    let figure = face_map(&map(&faces_m, &values)).unwrap();
    assert!(figure.to_svg().len() < 400_000, "{}", figure.to_svg().len());
    let drawing = read(&figure);
    let (picture, _) = drawing.image.unwrap();
    let at = |x: f64, y: f64| {
        let (w, h) = (f64::from(picture.width()), f64::from(picture.height()));
        picture.get_pixel((x * w) as u32, (y * h) as u32).0
    };
    assert_eq!(at(0.25, 0.25), [68, 1, 84]);
    assert_eq!(at(0.25, 0.75), [68, 1, 84]);
    assert_eq!(at(0.75, 0.25), [253, 231, 37]);
    let middle = at(0.75, 0.75);
    assert!(middle[0].abs_diff(33) < 3 && middle[1].abs_diff(145) < 3);
    assert_eq!(at(0.005, 0.005), [255; 3]); // beside the faces
}
