//! A `Flux` as numbers and arrays, for pickle.

use helio_flux::mesh::Mirror;
use helio_flux::{Account, FluxMap, Receiver};
use helio_io::DeformedMirror;
use numpy::PyReadonlyArray1;
use pyo3::prelude::*;
use pyo3::types::PyDict;

use super::map::PyFlux;
use super::mesh::method_of;
use crate::array::owned;
use crate::failure::Failure;

type Floats<'py> = PyReadonlyArray1<'py, f64>;

/// A flux as it is pickled.
#[derive(FromPyObject)]
#[pyo3(from_item_all)]
pub(super) struct Kept<'py> {
    version: String,
    shape: String,
    receiver: Floats<'py>,
    flux_w_m2: Floats<'py>,
    /// The powers of the account [W], and its counts.
    powers_w: [f64; 7],
    counts: (u64, usize),
    dni_w_m2: f64,
    status: Option<Vec<u8>>,
    warnings: Vec<String>,
    slopes: Option<KeptSlopes<'py>>,
}

/// A deformed mirror as it is pickled: what the slope errors are computed from, by the same steps.
#[derive(FromPyObject)]
#[pyo3(from_item_all)]
struct KeptSlopes<'py> {
    method: String,
    axis: [f64; 3],
    nodes: PyReadonlyArray1<'py, u64>,
    position_m: Floats<'py>,
    displacement_m: Floats<'py>,
    elements: PyReadonlyArray1<'py, u64>,
    facets: PyReadonlyArray1<'py, u32>,
    /// Four for each face; of a triangle the last is the third.
    corners: PyReadonlyArray1<'py, u32>,
    counts: PyReadonlyArray1<'py, u8>,
}

fn refused(what: &str) -> Failure {
    let message = format!("this pickle of a Flux is damaged: {what}");
    Failure::new("OptionError", message)
}

pub(super) fn kept<'py>(py: Python<'py>, flux: &PyFlux) -> Result<Bound<'py, PyDict>, Failure> {
    let (shape, receiver) = flux.receiver.numbers();
    let a = flux.map.account();
    let dict = PyDict::new(py);
    dict.set_item("version", env!("CARGO_PKG_VERSION"))?;
    dict.set_item("shape", shape)?;
    dict.set_item("receiver", column(py, receiver)?)?;
    dict.set_item(
        "flux_w_m2",
        column(py, flux.map.irradiance_w_m2().to_vec())?,
    )?;
    let powers_w = [
        a.mirror_w,
        a.incoming_w,
        a.shaded_w,
        a.reflection_loss_w,
        a.blocked_w,
        a.spilled_w,
        a.received_w,
    ];
    dict.set_item("powers_w", powers_w)?;
    dict.set_item("counts", (a.rays, a.turned_away))?;
    dict.set_item("dni_w_m2", flux.dni_w_m2)?;
    dict.set_item("status", flux.status.as_deref())?;
    dict.set_item("warnings", &flux.warnings)?;
    let slopes = match &flux.slopes {
        Some((shape, mirror)) => Some(kept_slopes(py, shape, mirror)?),
        None => None,
    };
    dict.set_item("slopes", slopes)?;
    Ok(dict)
}

fn column<T: numpy::Element>(py: Python<'_>, numbers: Vec<T>) -> Result<Bound<'_, PyAny>, Failure> {
    let len = numbers.len();
    owned(py, numbers, &[len])
}

fn kept_slopes<'py>(
    py: Python<'py>,
    shape: &DeformedMirror,
    mirror: &Mirror,
) -> Result<Bound<'py, PyDict>, Failure> {
    let faces = mirror.faces();
    let corners = faces.iter().flat_map(|face| {
        let corners = face.corners();
        (0..4).map(move |k| corners[k.min(corners.len() - 1)])
    });
    let moved = mirror.displacement_m().unwrap_or_default().as_flattened();
    let dict = PyDict::new(py);
    dict.set_item("method", shape.method.as_str())?;
    dict.set_item("axis", shape.axis)?;
    dict.set_item("nodes", column(py, mirror.node_ids().to_vec())?)?;
    let position_m = mirror.position_m().as_flattened().to_vec();
    dict.set_item("position_m", column(py, position_m)?)?;
    dict.set_item("displacement_m", column(py, moved.to_vec())?)?;
    let elements = faces.iter().map(|face| face.element()).collect();
    dict.set_item("elements", column(py, elements)?)?;
    let facets = faces.iter().map(|face| face.facet()).collect();
    dict.set_item("facets", column(py, facets)?)?;
    dict.set_item("corners", column(py, corners.collect())?)?;
    let counts = faces.iter().map(|face| face.corners().len() as u8);
    dict.set_item("counts", column(py, counts.collect())?)?;
    Ok(dict)
}

impl Kept<'_> {
    pub(super) fn flux(self) -> Result<PyFlux, Failure> {
        let version = env!("CARGO_PKG_VERSION");
        if self.version != version {
            let found = self.version;
            let message = format!(
                "a Flux pickled by helio_py {found} is not read by {version}; keep results by Flux.write"
            );
            return Err(Failure::new("OptionError", message));
        }
        let floats = |array: &Floats<'_>| array.as_array().to_vec();
        let receiver = Receiver::from_numbers(&self.shape, &floats(&self.receiver))?;
        let [
            mirror_w,
            incoming_w,
            shaded_w,
            reflection_loss_w,
            blocked_w,
            spilled_w,
            received_w,
        ] = self.powers_w;
        let (rays, turned_away) = self.counts;
        let account = Account {
            mirror_w,
            incoming_w,
            shaded_w,
            reflection_loss_w,
            blocked_w,
            spilled_w,
            received_w,
            rays,
            turned_away,
        };
        let map = FluxMap::of_bins(&receiver, floats(&self.flux_w_m2), account)?;
        let slopes = match self.slopes {
            Some(slopes) => Some(slopes.slopes()?),
            None => None,
        };
        Ok(PyFlux {
            receiver,
            map,
            dni_w_m2: self.dni_w_m2,
            status: self.status,
            slopes,
            warnings: self.warnings,
        })
    }
}

impl KeptSlopes<'_> {
    fn slopes(self) -> Result<(DeformedMirror, Mirror), Failure> {
        let points = |array: &Floats<'_>| {
            let flat = array.as_array().to_vec();
            let (points, rest) = flat.as_chunks::<3>();
            if rest.is_empty() {
                Ok(points.to_vec())
            } else {
                Err(refused("coordinates"))
            }
        };
        let (elements, facets) = (self.elements.as_array(), self.facets.as_array());
        let (corners, counts) = (self.corners.as_array().to_vec(), self.counts.as_array());
        let (corners, rest) = corners.as_chunks::<4>();
        let faces = counts.len();
        if !rest.is_empty() || [elements.len(), facets.len(), corners.len()] != [faces; 3] {
            return Err(refused("faces"));
        }
        if counts.iter().any(|&count| count > 4) {
            return Err(refused("corners"));
        }
        let rows = (0..faces).map(|row| {
            let of = &corners[row][..usize::from(counts[row])];
            (elements[row], facets[row], of)
        });
        let (position_m, moved_m) = (points(&self.position_m)?, points(&self.displacement_m)?);
        let nodes = self.nodes.as_array().to_vec();
        let mirror = Mirror::of_faces(nodes, position_m, Some(moved_m), rows)?;
        let method = method_of(&self.method)?;
        let shape = DeformedMirror::of(&mirror, method, Some(self.axis))?;
        if shape.slopes.area_m2().len() != mirror.faces().len() {
            return Err(refused("faces without an area"));
        }
        Ok((shape, mirror))
    }
}
