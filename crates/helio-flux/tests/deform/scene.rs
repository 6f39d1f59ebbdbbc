//! Meshes of known shape.

use helio_flux::mesh::{Mesh, Mirror, MirrorOptions, Pick, ReadOptions, csv};

/// What a grid is made of.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Of {
    Quadrilaterals,
    Triangles,
}

/// A rectangle of `nx` by `ny` cells over `x` and `y`, lifted to `z` of its plan.
pub fn grid(
    [x0, x1]: [f64; 2],
    [y0, y1]: [f64; 2],
    [nx, ny]: [usize; 2],
    of: Of,
    z: impl Fn(f64, f64) -> f64,
) -> Mesh {
    let mut nodes = String::from("node,x_m,y_m,z_m\n");
    for i in 0..=nx {
        for j in 0..=ny {
            let x = x0 + (x1 - x0) * i as f64 / nx as f64;
            let y = y0 + (y1 - y0) * j as f64 / ny as f64;
            let id = 1 + i * (ny + 1) + j;
            nodes += &format!("{id},{x:?},{y:?},{:?}\n", z(x, y));
        }
    }
    let mut elements = String::from("element,node1,node2,node3,node4\n");
    let mut next = 1;
    for i in 0..nx {
        for j in 0..ny {
            let at = |i: usize, j: usize| 1 + i * (ny + 1) + j;
            let [a, b, c, d] = [at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)];
            match of {
                Of::Quadrilaterals => elements += &format!("{next},{a},{b},{c},{d}\n"),
                Of::Triangles => {
                    elements += &format!("{next},{a},{b},{c},\n{},{a},{c},{d},\n", next + 1);
                    next += 1;
                }
            }
            next += 1;
        }
    }
    csv::nodes("nodes", nodes.as_bytes(), &ReadOptions::default())
        .and_then(|nodes| nodes.elements("elements", elements.as_bytes()))
        .unwrap()
}

/// The mesh displaced by a function of the position.
pub fn moved(mut mesh: Mesh, by_m: impl Fn([f64; 3]) -> [f64; 3]) -> Mesh {
    let all = mesh.position_m().iter().map(|&p| by_m(p)).collect();
    mesh.set_displacements_m(all).unwrap();
    mesh
}

/// The side of it that faces up.
pub fn upper(mesh: &Mesh) -> Mirror {
    let options = MirrorOptions::toward([0.0, 0.0, 1.0]).unwrap();
    mesh.mirror(&Pick::All, &options).unwrap()
}

pub fn sub(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    [a[0] - b[0], a[1] - b[1], a[2] - b[2]]
}

pub fn length(a: [f64; 3]) -> f64 {
    (a[0] * a[0] + a[1] * a[1] + a[2] * a[2]).sqrt()
}
