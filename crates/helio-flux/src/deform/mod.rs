//! What a load does to a mirror: where its pieces go and how far their normals turn.
//!
//! Two ways, both of Yan 2022:
//!
//! - **Planar element substitution** ([`substitute_elements`], §2.2): every face of the mesh is a flat piece
//!   of mirror that goes where its nodes go. Good for any deformation.
//! - **Mirror pose reconstruction** ([`reconstruct_poses`], §2.1): every facet is rigid and moves as three of
//!   its points do, or as all of them do by least squares. Good as long as facets do not bend; the residual
//!   of the fit says whether they do.
//!
//! Both give a [`Deformed`] mirror: the elements without and with the load, from which [`SlopeErrors`] and
//! the flux follow.
//!
//! ```
//! use helio_flux::deform::{PoseFit, SlopeErrors, reconstruct_poses, substitute_elements};
//! use helio_flux::mesh::{MirrorOptions, Pick, ReadOptions, csv};
//!
//! // A square of 1 m that tips by 2 mm in 1 m about its edge along y.
//! let nodes = b"node,x_m,y_m,z_m,ux_m,uy_m,uz_m\n1,0,0,0,0,0,0\n2,1,0,0,0,0,0.002\n3,1,1,0,0,0,0.002\n4,0,1,0,0,0,0\n";
//! let mesh = csv::nodes("nodes.csv", nodes, &ReadOptions::default())?
//!     .elements("elements.csv", b"element,node1,node2,node3,node4\n1,1,2,3,4\n")?;
//! let mirror = mesh.mirror(&Pick::All, &MirrorOptions::toward([0.0, 0.0, 1.0])?)?;
//! let deformed = substitute_elements(&mirror)?;
//! let slopes = SlopeErrors::new(&deformed, [1.0, 0.0, 0.0])?;
//! assert!((slopes.total_rad()[0] - 0.002_f64.atan()).abs() < 1e-15);
//! assert!((slopes.first_rad()[0] + 0.002_f64.atan()).abs() < 1e-15); // the normal leans back, to -x
//! let (rigid, poses) = reconstruct_poses(&mirror, PoseFit::LeastSquares)?;
//! assert!(poses[0].rms_m < 1e-6); // it grew longer by 2 µm
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

mod error;
mod facet;
mod motion;
mod pose;
mod slope;
mod write;

pub use error::DeformError;
pub use facet::{FacetPose, PoseFit, PoseStatus, reconstruct_poses};
pub use motion::RigidMotion;
pub use pose::{FittedPose, ThreePointPose, fit_pose, pose_from_three_points};
pub use slope::{Extreme, SlopeErrors};
pub use write::{write_csv, write_vtk};

use crate::element::Element;
use crate::error::FluxError;
use crate::mesh::{Mirror, MirrorFace};
use crate::vector::{Vector, add};

/// Why a face has no loaded element.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub enum FaceStatus {
    /// It has one.
    Ok,
    /// A node of it has no displacement.
    NoDisplacement,
    /// Its facet has no pose: too few points with displacements, or all on a line.
    NoPose,
    /// The load left it no area.
    Collapsed,
}

impl FaceStatus {
    /// One word for tables.
    #[must_use]
    pub const fn word(self) -> &'static str {
        match self {
            Self::Ok => "ok",
            Self::NoDisplacement => "no_displacement",
            Self::NoPose => "no_pose",
            Self::Collapsed => "collapsed",
        }
    }
}

/// A mirror without and with its load: one row per face of the [`Mirror`], in its order. Elements carry the
/// number of their facet as [`Element::mirror`].
#[derive(Debug, Clone, PartialEq)]
pub struct Deformed {
    element_ids: Vec<u64>,
    ideal: Vec<Element>,
    loaded: Vec<Option<Element>>,
    status: Vec<FaceStatus>,
}

impl Deformed {
    /// Numbers of the mesh's elements that the faces belong to.
    #[must_use]
    pub fn element_ids(&self) -> &[u64] {
        &self.element_ids
    }

    /// The flat pieces without load.
    #[must_use]
    pub fn ideal(&self) -> &[Element] {
        &self.ideal
    }

    /// The flat pieces under load; `None` where [`status`](Self::status) is not ok.
    #[must_use]
    pub fn loaded(&self) -> &[Option<Element>] {
        &self.loaded
    }

    /// Whether a row has a loaded piece, and why not.
    #[must_use]
    pub fn status(&self) -> &[FaceStatus] {
        &self.status
    }

    /// How many rows have a loaded piece.
    #[must_use]
    pub fn usable(&self) -> usize {
        self.loaded.iter().flatten().count()
    }

    /// Moves every face by what `motion` says of it.
    fn build(
        mirror: &Mirror,
        mut moved: impl FnMut(&MirrorFace, &mut [Vector]) -> FaceStatus,
    ) -> Self {
        let count = mirror.faces().len();
        let mut deformed = Self {
            element_ids: Vec::with_capacity(count),
            ideal: Vec::with_capacity(count),
            loaded: Vec::with_capacity(count),
            status: Vec::with_capacity(count),
        };
        for face in mirror.faces() {
            let mut corners = [[0.0; 3]; 4];
            let corners = &mut corners[..face.corners().len()];
            for (corner, &node) in corners.iter_mut().zip(face.corners()) {
                *corner = mirror.position_m()[node as usize];
            }
            // A mirror has no faces without area: see Mesh::mirror.
            let Ok(ideal) = element(corners) else {
                continue;
            };
            let mut status = moved(face, corners);
            let mut loaded = None;
            if status == FaceStatus::Ok {
                match element(corners) {
                    Ok(element) => loaded = Some(element.with_mirror(face.facet())),
                    Err(_) => status = FaceStatus::Collapsed,
                }
            }
            deformed.element_ids.push(face.element());
            deformed.ideal.push(ideal.with_mirror(face.facet()));
            deformed.loaded.push(loaded);
            deformed.status.push(status);
        }
        deformed
    }
}

fn element(corners: &[Vector]) -> Result<Element, FluxError> {
    match *corners {
        [a, b, c, d] => Element::quadrilateral([a, b, c, d]),
        [a, b, c] => Element::triangle([a, b, c]),
        _ => Element::triangle([[0.0; 3]; 3]),
    }
}

/// Planar element substitution: every face goes where the displacements of its nodes put it, as the flat
/// piece through their mean with their vector area (Yan 2022 eq. 1 to 4).
///
/// # Errors
/// [`DeformError::NoDisplacements`]. A face with a node that has none keeps its place with a status.
pub fn substitute_elements(mirror: &Mirror) -> Result<Deformed, DeformError> {
    let by_m = mirror
        .displacement_m()
        .ok_or(DeformError::NoDisplacements)?;
    Ok(Deformed::build(mirror, |face, corners| {
        for (corner, &node) in corners.iter_mut().zip(face.corners()) {
            let by_m = by_m[node as usize];
            if by_m.iter().any(|x| x.is_nan()) {
                return FaceStatus::NoDisplacement;
            }
            // Yan 2022 eq. (1)
            *corner = add(*corner, by_m);
        }
        FaceStatus::Ok
    }))
}
