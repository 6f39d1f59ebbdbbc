//! `forward`: from axis angles to mirror normals.

use helio_core::error::TrackError;
use pyo3::prelude::*;

use crate::array::{Numbers, owned, shape_text, wrong_shape};
use crate::failure::Failure;
use crate::field::PyField;
use crate::guard::guarded;

/// Rows computed between two looks at whether the user wants to stop: some hundredths of a second.
const ROWS_PER_LOOK: usize = 1 << 20;

/// Mirror normals for encoder angles.
///
/// Parameters
/// ----------
/// field : Field
///     The heliostats, n of them.
/// azimuth_rad, elevation_rad : array of shape (n,) or (m, n)
///     Encoder angles of both axes [rad], as `track` gives them.
///
/// Returns
/// -------
/// array of shape (n, 3) or (m, n, 3)
///     Unit vectors east, north, up out of the mirrors (Guo 2015 eq. 29). A row whose angles are NaN, as
///     `track` gives them where it has no answer, has a normal of NaN.
///
/// Raises
/// ------
/// ShapeError, DataTypeError, AngleError
///
/// Notes
/// -----
/// Where the calibration of a field changes with the hour or the date, its errors are those at solar noon of the
/// last span of time.
///
/// Examples
/// --------
/// >>> import helio_py as hp
/// >>> field = hp.Field([[0.0, 0.0, 0.0]], [0.0, 90.0, 0.0])
/// >>> hp.forward(field, [0.0], [0.0])
/// array([[0., 1., 0.]])
#[pyfunction]
#[pyo3(signature = (field, azimuth_rad, elevation_rad))]
pub(crate) fn forward<'py>(
    py: Python<'py>,
    field: &Bound<'py, PyAny>,
    azimuth_rad: &Bound<'py, PyAny>,
    elevation_rad: &Bound<'py, PyAny>,
) -> PyResult<Bound<'py, PyAny>> {
    guarded(|| {
        let field = PyField::of(field)?.get().inner();
        let n = field.len();
        let azimuth_rad = Numbers::of(azimuth_rad, "azimuth_rad")?;
        let elevation_rad = Numbers::of(elevation_rad, "elevation_rad")?;
        let shape = azimuth_rad.shape();
        if !matches!(*shape, [found] | [_, found] if found == n) {
            let wanted = format!("({n},) or (m, {n})");
            return Err(wrong_shape("azimuth_rad", &wanted, shape));
        }
        if elevation_rad.shape() != shape {
            let wanted = format!("{} as azimuth_rad has", shape_text(shape));
            return Err(wrong_shape("elevation_rad", &wanted, elevation_rad.shape()));
        }
        let columns = [azimuth_rad.as_slice()?, elevation_rad.as_slice()?];
        let mut normals = Vec::with_capacity(columns[0].len() * 3);
        let per_block = n * (ROWS_PER_LOOK / n.max(1)).max(1);
        for start in (0..columns[0].len()).step_by(per_block.max(1)) {
            if start > 0 {
                py.check_signals()?;
            }
            let end = columns[0].len().min(start + per_block);
            let block = columns.map(|column| &column[start..end]);
            py.detach(|| {
                for (sun, rows) in (start..end).step_by(n).enumerate() {
                    let rows_here = sun * n..(sun + 1) * n;
                    add(
                        field.exact(),
                        block.map(|c| &c[rows_here.clone()]),
                        &mut normals,
                    )
                    .map_err(|error| in_whole(error, rows))?;
                }
                Ok::<_, Failure>(())
            })?;
        }
        let shape: Vec<usize> = shape.iter().copied().chain([3]).collect();
        owned(py, normals, &shape)
    })
}

/// Adds the normals of one sun; NaN where an angle is not known.
fn add(
    tracker: &helio_core::Tracker,
    columns: [&[f64]; 2],
    normals: &mut Vec<f64>,
) -> Result<(), TrackError> {
    let known = columns.map(|column| column.iter().any(|angle| angle.is_nan()));
    let found = if known == [false, false] {
        tracker.forward(columns[0], columns[1])?
    } else {
        // The core refuses NaN here; any angle stands in for it, and its normal is not kept.
        let [axis1, axis2] = columns.map(|column| {
            let filled = column.iter().map(|a| if a.is_nan() { 0.0 } else { *a });
            filled.collect::<Vec<_>>()
        });
        tracker.forward(&axis1, &axis2)?
    };
    for (row, normal) in found.into_iter().enumerate() {
        let normal = normal.as_enu();
        let unknown = columns[0][row].is_nan() || columns[1][row].is_nan();
        let of = |component: f64| if unknown { f64::NAN } else { component };
        normals.extend([of(normal.east), of(normal.north), of(normal.up)]);
    }
    Ok(())
}

/// A bad row of one sun as a row of all of them.
pub(crate) fn in_whole(error: TrackError, first: usize) -> TrackError {
    match error {
        TrackError::BadAngle {
            what,
            row,
            limit,
            value,
        } => TrackError::BadAngle {
            what: if what == "axis1_rad" {
                "azimuth_rad"
            } else {
                "elevation_rad"
            },
            row: first + row,
            limit,
            value,
        },
        other => other,
    }
}
