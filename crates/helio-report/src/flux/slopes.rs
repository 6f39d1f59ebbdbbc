//! What a load does to a mirror.

use helio_flux::deform::{Deformed, SlopeErrors};

use super::faces::{FaceMap, face_map};
use super::units::figures;
use crate::svg::{Figure, stack};
use crate::{FigureError, equal};

/// Which column of the slope errors is drawn.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum SlopeColumn {
    /// The angle between the normals without and with the load.
    Total,
    /// The lean toward the axis, signed.
    First,
    /// The lean across the axis, signed.
    Second,
    /// How far the middle of each face moved.
    Moved,
}

/// Draws one column of the slope errors on the faces of the mirror without load, seen along the sun.
///
/// `sun` points to the sun. Faces without a loaded piece are gray and counted.
///
/// # Errors
/// [`FigureError`] if the slope errors are not those of this mirror, for a mirror without faces, or a sun without a
/// direction.
///
/// ```
/// use helio_flux::deform::{SlopeErrors, substitute_elements};
/// use helio_flux::mesh::{MirrorOptions, Pick, ReadOptions, csv};
/// use helio_report::flux::{SlopeColumn, slope_map};
/// let nodes = b"node,x_m,y_m,z_m,ux_m,uy_m,uz_m\n1,0,0,0,0,0,0\n2,1,0,0,0,0,0.002\n3,1,1,0,0,0,0.002\n4,0,1,0,0,0,0\n";
/// let mesh = csv::nodes("nodes.csv", nodes, &ReadOptions::default())?
///     .elements("elements.csv", b"element,node1,node2,node3,node4\n1,1,2,3,4\n")?;
/// let up = [0.0, 0.0, 1.0];
/// let deformed = substitute_elements(&mesh.mirror(&Pick::All, &MirrorOptions::toward(up)?)?)?;
/// let slopes = SlopeErrors::new(&deformed, [1.0, 0.0, 0.0])?;
/// let figure = slope_map(&deformed, &slopes, SlopeColumn::Total, up, "A tipped square")?;
/// assert!(figure.to_svg().contains("greatest 2\u{202f}mrad"));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn slope_map(
    deformed: &Deformed,
    slopes: &SlopeErrors,
    column: SlopeColumn,
    sun: [f64; 3],
    title: &str,
) -> Result<Figure, FigureError> {
    let ideal = deformed.ideal();
    equal("slope errors", ideal.len(), slopes.total_rad().len())?;
    let (values, thousand, unit) = match column {
        SlopeColumn::Total => (slopes.total_rad(), Some(slopes.rms_rad()), "mrad"),
        SlopeColumn::First => (slopes.first_rad(), Some(slopes.rms_first_rad()), "mrad"),
        SlopeColumn::Second => (slopes.second_rad(), Some(slopes.rms_second_rad()), "mrad"),
        SlopeColumn::Moved => (slopes.moved_m(), None, "mm"),
    };
    let quantity = match column {
        SlopeColumn::Total => "slope error",
        SlopeColumn::First => "lean toward the axis",
        SlopeColumn::Second => "lean across the axis",
        SlopeColumn::Moved => "displacement",
    };
    // radians to milliradians, metres to millimetres
    let values: Vec<f64> = values.iter().map(|v| 1e3 * v).collect();
    let faces_m: Vec<&[[f64; 3]]> = ideal.iter().map(|element| element.corners_m()).collect();
    let words = match thousand.filter(|rms| rms.is_finite()) {
        Some(rms) => format!(
            "root mean square by area {}\u{202f}mrad; seen along the sun",
            figures(1e3 * rms)
        ),
        None => "seen along the sun".to_owned(),
    };
    face_map(&FaceMap {
        title,
        words: &words,
        quantity,
        unit,
        faces_m: &faces_m,
        values: &values,
        toward_viewer: sun,
        signed: matches!(column, SlopeColumn::First | SlopeColumn::Second),
    })
}

/// Draws the slope error, its parts along both axes and the displacement below each other.
///
/// # Errors
/// As [`slope_map`].
pub fn slope_figure(
    deformed: &Deformed,
    slopes: &SlopeErrors,
    sun: [f64; 3],
    title: &str,
) -> Result<Figure, FigureError> {
    let draw = |(column, title)| slope_map(deformed, slopes, column, sun, title);
    let figures = [
        (SlopeColumn::Total, title),
        (SlopeColumn::First, "Along the axis"),
        (SlopeColumn::Second, "Across the axis"),
        (SlopeColumn::Moved, "Displacement"),
    ]
    .into_iter()
    .map(draw)
    .collect::<Result<Vec<_>, _>>()?;
    Ok(stack(&figures))
}
