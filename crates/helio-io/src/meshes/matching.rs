//! Which displacement of a file is whose: by the numbers of the nodes, or by where they are.

use std::collections::HashMap;

use helio_flux::mesh::Mesh;

use super::MatchedNodes;

/// Displacements as a file has them, one entry per node; NaN for a node without.
pub(super) struct Moved {
    pub(super) node_ids: Vec<u64>,
    pub(super) displacement_m: Vec<[f64; 3]>,
    /// Where the file says that its nodes are, as far as it does.
    pub(super) position_m: Vec<Option<[f64; 3]>>,
}

/// Of the model's extent: far below any element, far above what doubles lose.
const OF_EXTENT: f64 = 1e-6;
/// Of a coordinate: an `.frd` and most VTK files in text have six digits.
const OF_COORDINATE: f64 = 1e-5;
/// Points of a file at one place.
const MOST_AT_ONE_PLACE: usize = 1000;

/// How far apart one node may be in two files.
struct Tolerance {
    of_extent_m: f64,
    /// The largest for any node.
    most_m: f64,
}

impl Tolerance {
    fn of(mesh: &Mesh) -> Self {
        let mut least = [f64::INFINITY; 3];
        let mut most = [f64::NEG_INFINITY; 3];
        let mut farthest_m = 0.0_f64;
        for at in mesh.position_m() {
            for axis in 0..3 {
                least[axis] = least[axis].min(at[axis]);
                most[axis] = most[axis].max(at[axis]);
                farthest_m = farthest_m.max(at[axis].abs());
            }
        }
        let sides = (0..3).map(|axis| most[axis] - least[axis]);
        let extent_m = sides.fold(0.0, f64::max);
        let of_extent_m = (OF_EXTENT * extent_m).max(f64::MIN_POSITIVE);
        Self {
            of_extent_m,
            most_m: of_extent_m + OF_COORDINATE * farthest_m,
        }
    }

    fn accepts(&self, in_mesh: [f64; 3], in_file: [f64; 3]) -> bool {
        (0..3).all(|axis| {
            let (here, there) = (in_mesh[axis], in_file[axis]);
            (here - there).abs() <= self.of_extent_m + OF_COORDINATE * here.abs()
        })
    }
}

fn place(at_m: [f64; 3]) -> String {
    let [x, y, z] = at_m;
    format!("[{x:.6}, {y:.6}, {z:.6}] m")
}

/// Gives nodes their displacements by their numbers; a node that is elsewhere in the file is another one.
pub(super) fn by_number(mesh: &mut Mesh, moved: &Moved) -> Result<MatchedNodes, String> {
    let rows: HashMap<u64, usize> = mesh
        .node_ids()
        .iter()
        .enumerate()
        .map(|(row, id)| (*id, row))
        .collect();
    let tolerance = Tolerance::of(mesh);
    let mut displacement_m = vec![[f64::NAN; 3]; rows.len()];
    let mut unknown = Vec::new();
    for (k, (id, by_m)) in moved.node_ids.iter().zip(&moved.displacement_m).enumerate() {
        if by_m.iter().any(|x| x.is_nan()) {
            continue;
        }
        let Some(&row) = rows.get(id) else {
            unknown.push(*id);
            continue;
        };
        let here = mesh.position_m()[row];
        if let Some(there) = moved.position_m.get(k).copied().flatten()
            && !tolerance.accepts(here, there)
        {
            return Err(format!(
                "node {id} is at {} here and at {} in the mesh; wanted the displacements of that mesh, in its unit",
                place(there),
                place(here)
            ));
        }
        displacement_m[row] = *by_m;
    }
    Ok(give(mesh, displacement_m, unknown))
}

/// Gives nodes the displacements of the points that stand where they do, for files whose points have no
/// numbers.
pub(super) fn by_position(mesh: &mut Mesh, moved: &Moved) -> Result<MatchedNodes, String> {
    let tolerance = Tolerance::of(mesh);
    let points: Vec<[f64; 3]> = moved.position_m.iter().map_while(|at| *at).collect();
    let places = mesh.position_m();
    // Row by row, if that is how they stand: nodes at one place are told apart then.
    let in_order = places.len() == points.len()
        && places
            .iter()
            .zip(&points)
            .all(|(&here, &there)| tolerance.accepts(here, there));
    if in_order {
        return Ok(give(mesh, moved.displacement_m.clone(), Vec::new()));
    }
    let cell_m = 2.0 * tolerance.most_m;
    let cell = |x: f64| (x / cell_m).floor() as i64;
    let mut grid: HashMap<[i64; 3], Vec<usize>> = HashMap::new();
    for (row, at) in points.iter().enumerate() {
        let rows = grid.entry(at.map(cell)).or_default();
        rows.push(row);
        if rows.len() > MOST_AT_ONE_PLACE {
            return Err(format!(
                "more than {MOST_AT_ONE_PLACE} of its points are at {}; wanted displacements of the mesh",
                place(*at)
            ));
        }
    }
    let mut displacement_m = vec![[f64::NAN; 3]; places.len()];
    let mut taken = vec![false; points.len()];
    let mut nodes_found = 0;
    for (node, &here) in places.iter().enumerate() {
        let [x, y, z] = here.map(|x| cell(x - tolerance.most_m)..=cell(x + tolerance.most_m));
        let cells = x.flat_map(|x| {
            let z = z.clone();
            y.clone()
                .flat_map(move |y| z.clone().map(move |z| [x, y, z]))
        });
        let near = cells.filter_map(|cell| grid.get(&cell)).flatten().copied();
        let mut is_found = false;
        for row in near.filter(|&row| tolerance.accepts(here, points[row])) {
            taken[row] = true;
            is_found = true;
            let by_m = moved.displacement_m[row];
            let known = displacement_m[node];
            if known[0].is_nan() {
                displacement_m[node] = by_m;
            } else if !by_m[0].is_nan() && apart(known, by_m) {
                return Err(format!(
                    "two of its points are at {} with different displacements, and points have no numbers to tell \
                     which is node {}; wanted an .frd, .msh or CSV",
                    place(here),
                    mesh.node_ids()[node]
                ));
            }
        }
        nodes_found += usize::from(is_found);
    }
    refuse_another_mesh(mesh, &points, &taken, nodes_found)?;
    let unknown = taken.iter().enumerate().filter(|(_, taken)| !**taken);
    let unknown = unknown.map(|(row, _)| moved.node_ids[row]).collect();
    Ok(give(mesh, displacement_m, unknown))
}

/// Refuses points few of which are where nodes are. Some match by chance in another unit or after warping: at the
/// origin, or where the structure is held. Results of more than the mesh, and of part of it, are no other mesh.
fn refuse_another_mesh(
    mesh: &Mesh,
    points: &[[f64; 3]],
    taken: &[bool],
    nodes_found: usize,
) -> Result<(), String> {
    let matched = taken.iter().filter(|taken| **taken).count();
    let is_other = 2 * matched < taken.len() && 2 * nodes_found < mesh.node_ids().len();
    let astray = taken.iter().position(|taken| !taken);
    let (true, Some(row), Some(&node)) = (is_other, astray, mesh.position_m().first()) else {
        return Ok(());
    };
    let here = place(points[row]);
    if matched == 0 {
        return Err(format!(
            "none of its points is where a node of the mesh is: the first is at {here}, and node {} at {}; wanted \
             the displacements of that mesh, in its unit",
            mesh.node_ids()[0],
            place(node)
        ));
    }
    Err(format!(
        "only {matched} of its {} points are where a node of the mesh is, and {nodes_found} of {} nodes have one: no \
         node is at {here}, where its point {} is. The unit or the mesh is another, or the points are moved (warped) \
         already; wanted the displacements of that mesh, in its unit, at its undeformed points",
        points.len(),
        mesh.node_ids().len(),
        row + 1
    ))
}

/// Whether displacements of one place are of two nodes.
fn apart(a: [f64; 3], b: [f64; 3]) -> bool {
    (0..3).any(|axis| (a[axis] - b[axis]).abs() > 1e-9 + 1e-5 * a[axis].abs())
}

fn give(mesh: &mut Mesh, displacement_m: Vec<[f64; 3]>, unknown: Vec<u64>) -> MatchedNodes {
    let each = mesh.node_ids().iter().zip(&displacement_m);
    let without: Vec<u64> = each
        .filter(|(_, by)| by[0].is_nan())
        .map(|(id, _)| *id)
        .collect();
    let known = displacement_m.len() - without.len();
    // One entry per node, as the callers made it.
    let _ = mesh.set_displacements_m(displacement_m);
    MatchedNodes {
        without,
        unknown,
        known,
    }
}
