//! Figures straight from `helio_flux`.

use helio_flux::{FluxMap, Receiver};

use super::faces::{FaceMap, face_map};
use super::grid::{GridMap, MapText, Surface, grid_map};
use super::profiles::grid_profiles;
use super::units::{self, figures};
use crate::svg::{Figure, stack};
use crate::{FigureError, equal};

/// Draws the map of a receiver: [`grid_map`] for planes, cylinders and cones, [`face_map`] for meshes, which are seen
/// from where most of their light comes from.
///
/// # Errors
/// [`FigureError`] if the map is not one of this receiver's, or as [`grid_map`].
///
/// ```
/// use helio_flux::{ConvolveOptions, Element, OpticalError, Plane, Receiver, Scene, SunShape, convolve};
/// use helio_report::flux::{MapText, receiver_map};
/// let corners_m = [[-0.1, -0.1, 0.0], [0.1, -0.1, 0.0], [0.1, 0.1, 0.0], [-0.1, 0.1, 0.0]];
/// let elements = [Element::quadrilateral(corners_m)?];
/// let plane = Plane::new([0.0, 0.0, 1.0], [0.0, 0.0, -1.0], [1.0, 0.0, 0.0], [0.3, 0.3], [12, 12])?;
/// let receiver = Receiver::Plane(plane);
/// let sun_shape = SunShape::pillbox(4.65e-3)?;
/// let scene = Scene {
///     elements: &elements,
///     receiver: &receiver,
///     sun: [0.0, 0.0, 1.0],
///     dni_w_m2: 1000.0,
///     sun_shape: &sun_shape,
///     optical_error: OpticalError::NONE,
/// };
/// let map = convolve(&scene, &ConvolveOptions::default())?;
/// let text = MapText { title: "A flat facet", dni_w_m2: Some(1000.0), subtitle: "" };
/// assert!(receiver_map(&receiver, &map, &text)?.to_svg().contains("A flat facet"));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn receiver_map(
    receiver: &Receiver,
    map: &FluxMap,
    text: &MapText<'_>,
) -> Result<Figure, FigureError> {
    match grid(receiver, map, text)? {
        Some(grid) => grid_map(&grid),
        None => mesh_map(receiver, map, text),
    }
}

/// Draws the map of a receiver and, below it, the profiles through its peak; a mesh has none.
///
/// # Errors
/// As [`receiver_map`].
pub fn receiver_figure(
    receiver: &Receiver,
    map: &FluxMap,
    text: &MapText<'_>,
) -> Result<Figure, FigureError> {
    match grid(receiver, map, text)? {
        Some(grid) => Ok(stack(&[grid_map(&grid)?, grid_profiles(&grid)?])),
        None => mesh_map(receiver, map, text),
    }
}

/// The grid of a receiver that has one.
fn grid<'a>(
    receiver: &Receiver,
    map: &'a FluxMap,
    text: &MapText<'a>,
) -> Result<Option<GridMap<'a>>, FigureError> {
    equal("rows of the map", receiver.rows(), map.rows())?;
    equal("columns of the map", receiver.columns(), map.columns())?;
    let surface = match receiver {
        Receiver::Plane(plane) => {
            let [width_m, height_m] = plane.size_m();
            Surface::Plane { width_m, height_m }
        }
        Receiver::Frustum(frustum) => {
            let [base_radius_m, end_radius_m] = frustum.radii_m();
            Surface::Round {
                top_radius_m: end_radius_m,
                bottom_radius_m: base_radius_m,
                slant_m: frustum.slant_m(),
            }
        }
        _ => return Ok(None),
    };
    Ok(Some(GridMap {
        text: *text,
        surface,
        rows: map.rows(),
        columns: map.columns(),
        irradiance_w_m2: map.irradiance_w_m2(),
    }))
}

fn mesh_map(receiver: &Receiver, map: &FluxMap, text: &MapText<'_>) -> Result<Figure, FigureError> {
    let Receiver::Mesh(mesh) = receiver else {
        return Err(FigureError::Empty {
            what: "known receiver",
        });
    };
    let faces_m: Vec<&[[f64; 3]]> = (0..mesh.triangles())
        .filter_map(|face| mesh.corners_m(face))
        .collect();
    // The mean normal, weighed by the power on each face.
    let mut toward_viewer = [0.0; 3];
    let (mut power_w, mut area_m2, mut peak) = (0.0, 0.0, 0.0_f64);
    for (face, &irradiance) in map.irradiance_w_m2().iter().enumerate() {
        let (area, normal) = (receiver.bin_area_m2(face), receiver.bin_normal(face));
        power_w += irradiance * area;
        area_m2 += area;
        peak = peak.max(irradiance);
        for (sum, part) in toward_viewer.iter_mut().zip(normal) {
            *sum += irradiance * area * part;
        }
    }
    // Light from all around, or none at all, has no direction of its own.
    if toward_viewer.iter().map(|x| x * x).sum::<f64>().sqrt() <= 1e-3 * power_w {
        toward_viewer = receiver.bin_normal(map.peak().1);
    }
    let unit = units::irradiance(peak);
    let values: Vec<f64> = map
        .irradiance_w_m2()
        .iter()
        .map(|v| v * unit.factor)
        .collect();
    let mean = power_w / area_m2;
    let mut words = vec![if peak > 0.0 {
        format!(
            "power {}, mean {}",
            units::with(power_w, units::power(power_w)),
            units::with(mean, unit)
        )
    } else {
        "power 0\u{202f}W: no light".to_owned()
    }];
    if let Some(dni) = text.dni_w_m2.filter(|_| peak > 0.0) {
        let (peak, mean) = (figures(peak / dni), figures(mean / dni));
        words.push(format!(
            "concentration {peak} at the peak, {mean} in the mean"
        ));
    }
    if !text.subtitle.is_empty() {
        words.push(text.subtitle.to_owned());
    }
    face_map(&FaceMap {
        title: text.title,
        words: &words.join("; "),
        quantity: "irradiance",
        unit: unit.name,
        faces_m: &faces_m,
        values: &values,
        toward_viewer,
        signed: false,
    })
}
