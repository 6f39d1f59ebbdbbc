//! Mirror pose reconstruction: one rigid motion for each facet.

use super::error::DeformError;
use super::motion::RigidMotion;
use super::pose::{fit_pose, pose_from_three_points};
use super::{Deformed, FaceStatus};
use crate::mesh::Mirror;
use crate::vector::{Vector, add, cross, norm, sub};

/// From which of a facet's nodes its motion is taken.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum PoseFit {
    /// Three nodes far apart: the one farthest from the middle, the one farthest from that, and the one
    /// that makes the largest triangle with both. As in Yan 2022 §2.1, which leaves the choice open.
    ThreePoints,
    /// All nodes, each of the same weight.
    LeastSquares,
}

/// Whether a facet has a pose.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub enum PoseStatus {
    /// It has.
    Ok,
    /// Fewer than three of its nodes have displacements, or they lie on a line.
    TooFewPoints,
}

/// How a facet moved, and how far from rigid that was.
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
pub struct FacetPose {
    /// Its number, from 0.
    pub facet: u32,
    /// Its motion; `None` where the status is not ok.
    pub motion: Option<RigidMotion>,
    /// Whether it has a pose.
    pub status: PoseStatus,
    /// Numbers of the three nodes that the pose was taken from; `None` if from all.
    pub points: Option<[u64; 3]>,
    /// Nodes of the facet with a displacement.
    pub nodes: usize,
    /// Distance of its nodes from where the rigid motion puts them, root mean square over all of them
    /// \[m\]: how far from rigid the facet is. NaN without a pose.
    pub rms_m: f64,
    /// The largest of these distances \[m\]; NaN without a pose.
    pub max_m: f64,
    /// Number of the node that it belongs to; 0 without a pose.
    pub max_node: u64,
}

/// Mirror pose reconstruction: every facet moves as a rigid body (Yan 2022 §2.1).
///
/// # Errors
/// [`DeformError::NoDisplacements`]. A facet without a pose keeps its place with a status, and so do its
/// faces.
pub fn reconstruct_poses(
    mirror: &Mirror,
    fit: PoseFit,
) -> Result<(Deformed, Vec<FacetPose>), DeformError> {
    let by_m = mirror
        .displacement_m()
        .ok_or(DeformError::NoDisplacements)?;
    // Nodes by facet, each once, in the order of the mesh.
    let mut members: Vec<(u32, u32)> = mirror
        .faces()
        .iter()
        .flat_map(|face| face.corners().iter().map(|&node| (face.facet(), node)))
        .collect();
    members.sort_unstable();
    members.dedup();
    members.retain(|&(_, node)| by_m[node as usize].iter().all(|x| x.is_finite()));
    let mut poses = Vec::with_capacity(mirror.facets() as usize);
    let mut rest = &members[..];
    for facet in 0..mirror.facets() {
        let count = rest.iter().take_while(|member| member.0 == facet).count();
        let (own, others) = rest.split_at(count);
        rest = others;
        let ids: Vec<u64> = own
            .iter()
            .map(|m| mirror.node_ids()[m.1 as usize])
            .collect();
        let before: Vec<Vector> = own
            .iter()
            .map(|m| mirror.position_m()[m.1 as usize])
            .collect();
        let after: Vec<Vector> = own
            .iter()
            .zip(&before)
            .map(|(m, &at)| add(at, by_m[m.1 as usize]))
            .collect();
        poses.push(pose_of(facet, fit, &ids, &before, &after));
    }
    let deformed = Deformed::build(mirror, |face, corners| {
        let Some(motion) = &poses[face.facet() as usize].motion else {
            return FaceStatus::NoPose;
        };
        for corner in corners {
            *corner = motion.point_m(*corner);
        }
        FaceStatus::Ok
    });
    Ok((deformed, poses))
}

fn pose_of(
    facet: u32,
    fit: PoseFit,
    ids: &[u64],
    before: &[Vector],
    after: &[Vector],
) -> FacetPose {
    let mut points = None;
    let motion = match fit {
        PoseFit::LeastSquares => fit_pose(before, after).ok().map(|pose| pose.motion),
        PoseFit::ThreePoints if before.len() < 3 => None,
        PoseFit::ThreePoints => {
            let rows = far_apart(before);
            points = Some(rows.map(|row| ids[row]));
            let pose = pose_from_three_points(rows.map(|r| before[r]), rows.map(|r| after[r]));
            pose.ok().map(|pose| pose.motion)
        }
    };
    let mut pose = FacetPose {
        facet,
        motion,
        status: PoseStatus::TooFewPoints,
        points,
        nodes: ids.len(),
        rms_m: f64::NAN,
        max_m: f64::NAN,
        max_node: 0,
    };
    if let Some(motion) = motion {
        pose.status = PoseStatus::Ok;
        let mut sum = 0.0;
        let mut max = (0.0, ids[0]);
        for ((&before, &after), &id) in before.iter().zip(after).zip(ids) {
            let left_m = norm(sub(motion.point_m(before), after));
            sum += left_m * left_m;
            if left_m > max.0 {
                max = (left_m, id);
            }
        }
        pose.rms_m = (sum / before.len() as f64).sqrt();
        (pose.max_m, pose.max_node) = max;
    }
    pose
}

/// Rows of three points far apart, of at least one.
fn far_apart(points: &[Vector]) -> [usize; 3] {
    let farthest = |measure: &dyn Fn(Vector) -> f64| {
        let mut best = (f64::NEG_INFINITY, 0);
        for (row, &point) in points.iter().enumerate() {
            let size = measure(point);
            if size > best.0 {
                best = (size, row);
            }
        }
        best.1
    };
    let sum = points.iter().fold([0.0; 3], |sum, &p| add(sum, p));
    let middle = sum.map(|x| x / points.len() as f64);
    let first = farthest(&|p| norm(sub(p, middle)));
    let third = farthest(&|p| norm(sub(p, points[first])));
    let along = sub(points[third], points[first]);
    let second = farthest(&|p| norm(cross(sub(p, points[first]), along)));
    [first, second, third]
}
