//! Shapes of elements: how many corners, which faces, which way out.

use crate::vector::{Vector, add, cross, dot, is_finite, norm, scale, sub};

/// The shape of an element, by its corners. Nodes of a quadratic element on edges, faces and inside are
/// left aside: its corners alone count.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
#[non_exhaustive]
pub enum Shape {
    /// A shell or membrane of three corners.
    Triangle,
    /// A shell or membrane of four corners.
    Quadrilateral,
    /// A solid of four corners.
    Tetrahedron,
    /// A solid of five corners: a quadrilateral and a tip.
    Pyramid,
    /// A solid of six corners: two triangles, one above the other.
    Wedge,
    /// A solid of eight corners: two quadrilaterals, one above the other.
    Hexahedron,
}

/// Faces of solids as corners counted from 0, in the order of the labels S1, S2, … of Abaqus and
/// CalculiX (CalculiX manual, "Element types"; the same order of corners as in Gmsh). As seen from
/// outside each runs counterclockwise, where corner 4 (of a hexahedron) stands above corner 0 of a
/// quadrilateral that runs counterclockwise as seen from there.
const TETRAHEDRON: [&[u8]; 4] = [&[0, 2, 1], &[0, 1, 3], &[1, 2, 3], &[2, 0, 3]];
const PYRAMID: [&[u8]; 5] = [
    &[0, 3, 2, 1],
    &[0, 1, 4],
    &[1, 2, 4],
    &[2, 3, 4],
    &[3, 0, 4],
];
const WEDGE: [&[u8]; 5] = [
    &[0, 2, 1],
    &[3, 4, 5],
    &[0, 1, 4, 3],
    &[1, 2, 5, 4],
    &[2, 0, 3, 5],
];
const HEXAHEDRON: [&[u8]; 6] = [
    &[0, 3, 2, 1],
    &[4, 5, 6, 7],
    &[0, 1, 5, 4],
    &[1, 2, 6, 5],
    &[2, 3, 7, 6],
    &[3, 0, 4, 7],
];
const TRIANGLE: [&[u8]; 1] = [&[0, 1, 2]];
const QUADRILATERAL: [&[u8]; 1] = [&[0, 1, 2, 3]];

impl Shape {
    /// How many corners it has.
    #[must_use]
    pub const fn corners(self) -> usize {
        match self {
            Self::Triangle => 3,
            Self::Quadrilateral | Self::Tetrahedron => 4,
            Self::Pyramid => 5,
            Self::Wedge => 6,
            Self::Hexahedron => 8,
        }
    }

    /// Whether it fills a volume; the others are faces themselves.
    #[must_use]
    pub const fn is_solid(self) -> bool {
        !matches!(self, Self::Triangle | Self::Quadrilateral)
    }

    /// Its faces: corners counted from 0, counterclockwise as seen from outside (of a shell: from its
    /// positive side).
    pub(crate) const fn faces(self) -> &'static [&'static [u8]] {
        match self {
            Self::Triangle => &TRIANGLE,
            Self::Quadrilateral => &QUADRILATERAL,
            Self::Tetrahedron => &TETRAHEDRON,
            Self::Pyramid => &PYRAMID,
            Self::Wedge => &WEDGE,
            Self::Hexahedron => &HEXAHEDRON,
        }
    }
}

/// ½ (c - a) × (d - b) of a quadrilateral, and of a triangle, whose fourth corner is its third.
fn vector_area(corners: &[Vector]) -> Vector {
    let last = corners[corners.len() - 1];
    scale(
        cross(sub(corners[2], corners[0]), sub(last, corners[1])),
        0.5,
    )
}

fn mean(points: &[Vector]) -> Vector {
    let sum = points[1..].iter().fold(points[0], |sum, &p| add(sum, p));
    scale(sum, 1.0 / points.len() as f64)
}

/// Volume of a solid of these corners \[m³\], negative where they run the wrong way round: by the
/// theorem of Gauss, with each face as the flat piece of its vector area through the mean of its corners
/// (exact for flat faces).
fn signed_volume_m3(shape: Shape, corners: &[Vector]) -> f64 {
    let origin = mean(corners);
    let mut volume = 0.0;
    for face in shape.faces() {
        let mut at = [[0.0; 3]; 4];
        for (at, &corner) in at.iter_mut().zip(*face) {
            *at = sub(corners[usize::from(corner)], origin);
        }
        let at = &at[..face.len()];
        volume += dot(mean(at), vector_area(at)) / 3.0;
    }
    volume
}

/// How the corners of an element lie.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Lie {
    Good,
    /// No area, or no volume.
    Flat,
    /// A solid whose corners run the wrong way round, or a quadrilateral that is folded over or has a
    /// corner that points inward.
    Turned,
}

/// An area (or volume) below this part of the squared (or cubed) extent is none: rounding leaves some
/// 1e-16 of it, slivers of real meshes are above 1e-6. The same as for an [`Element`](crate::Element).
const LEAST_RELATIVE_SIZE: f64 = 1e-12;

pub(crate) fn lie(shape: Shape, corners: &[Vector]) -> Lie {
    if !corners.iter().all(|&corner| is_finite(corner)) {
        return Lie::Flat;
    }
    let mut extent_m = 0.0_f64;
    for (k, &from) in corners.iter().enumerate() {
        for &to in &corners[k + 1..] {
            extent_m = extent_m.max(norm(sub(to, from)));
        }
    }
    if shape.is_solid() {
        let volume = signed_volume_m3(shape, corners);
        let least = LEAST_RELATIVE_SIZE * extent_m * extent_m * extent_m;
        if volume.abs() <= least {
            return Lie::Flat;
        }
        return if volume < 0.0 { Lie::Turned } else { Lie::Good };
    }
    face_lie(corners, extent_m)
}

fn face_lie(corners: &[Vector], extent_m: f64) -> Lie {
    let area = vector_area(corners);
    let area_m2 = norm(area);
    let least = LEAST_RELATIVE_SIZE * extent_m * extent_m;
    let turned = corners.len() == 4
        && (0..4).any(|k| {
            let (from, at, to) = (corners[(k + 3) % 4], corners[k], corners[(k + 1) % 4]);
            dot(cross(sub(at, from), sub(to, at)), area) < -least * area_m2
        });
    // The two halves of a bow tie can cancel: look for the fold first, about the larger half.
    if area_m2 > least {
        return if turned { Lie::Turned } else { Lie::Good };
    }
    if corners.len() == 4 {
        let halves = [[0, 1, 2], [0, 2, 3], [0, 1, 3], [1, 2, 3]];
        let largest = halves
            .iter()
            .map(|&[a, b, c]| norm(vector_area(&[corners[a], corners[b], corners[c]])))
            .fold(0.0, f64::max);
        if largest > least {
            return Lie::Turned;
        }
    }
    Lie::Flat
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Shapes with flat faces and known volumes.
    fn solids() -> Vec<(Shape, Vec<Vector>, f64)> {
        let [o, x, y, z] = [
            [0.0, 0.0, 0.0],
            [2.0, 0.0, 0.0],
            [0.0, 3.0, 0.0],
            [0.0, 0.0, 5.0],
        ];
        let square = [o, x, [2.0, 3.0, 0.0], y];
        let lifted = |points: &[Vector]| {
            let mut all = points.to_vec();
            all.extend(points.iter().map(|&p| add(p, z)));
            all
        };
        let mut pyramid = square.to_vec();
        pyramid.push([1.0, 1.0, 5.0]);
        vec![
            (Shape::Tetrahedron, vec![o, x, y, z], 5.0),
            (Shape::Pyramid, pyramid, 10.0),
            (Shape::Wedge, lifted(&[o, x, y]), 15.0),
            (Shape::Hexahedron, lifted(&square), 30.0),
        ]
    }

    #[test]
    fn volumes_are_those_of_the_solids_and_turn_their_sign_with_the_order() {
        for (shape, corners, volume) in solids() {
            let found = signed_volume_m3(shape, &corners);
            assert!((found - volume).abs() < 1e-14 * volume, "{shape:?} {found}");
            assert_eq!(lie(shape, &corners), Lie::Good);
            let mirrored: Vec<_> = corners.iter().map(|&[x, y, z]| [y, x, z]).collect();
            assert_eq!(lie(shape, &mirrored), Lie::Turned, "{shape:?}");
            let flat: Vec<_> = corners.iter().map(|&[x, y, _]| [x, y, x + y]).collect();
            assert_eq!(lie(shape, &flat), Lie::Flat, "{shape:?}");
        }
    }

    // Each edge is run through once each way, and every face looks away from the middle.
    #[test]
    fn faces_close_and_look_outward() {
        for (shape, corners, _) in solids() {
            let mut edges = Vec::new();
            let middle = mean(&corners);
            for face in shape.faces() {
                let at: Vec<_> = face.iter().map(|&c| corners[usize::from(c)]).collect();
                assert!(dot(vector_area(&at), sub(mean(&at), middle)) > 0.0);
                for k in 0..face.len() {
                    edges.push((face[k], face[(k + 1) % face.len()]));
                }
            }
            for &(from, to) in &edges {
                let same = edges.iter().filter(|&&e| e == (from, to)).count();
                assert_eq!((same, edges.contains(&(to, from))), (1, true), "{shape:?}");
            }
        }
    }

    #[test]
    fn folded_quadrilaterals_are_told_from_flat_ones() {
        let [a, b, c, d] = [
            [0.0, 0.0, 0.0],
            [1.0, 0.0, 0.0],
            [1.0, 1.0, 0.0],
            [0.0, 1.0, 0.0],
        ];
        let of = |corners: [Vector; 4]| lie(Shape::Quadrilateral, &corners);
        assert_eq!(of([a, b, c, d]), Lie::Good);
        assert_eq!(of([a, d, c, b]), Lie::Good); // seen from behind
        assert_eq!(of([a, c, b, d]), Lie::Turned); // a bow tie of no area
        assert_eq!(of([a, b, [0.1, 0.1, 0.0], d]), Lie::Turned); // a dart
        assert_eq!(of([a, b, b, b]), Lie::Flat);
        assert_eq!(of([a, [2.0, 0.0, 0.0], b, a]), Lie::Flat);
        assert_eq!(of([[f64::NAN; 3], b, c, d]), Lie::Flat);
    }
}
