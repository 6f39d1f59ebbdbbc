//! `verify`: beams followed back to the target; the typed call and its answer are in `helio_py._correct`.

use helio_core::{OffsetForm, Status, TargetPlane, TrackOptions};
use helio_io::BeamsBack;
use pyo3::prelude::*;

use crate::array::{owned, shape_text, wrong_shape};
use crate::failure::Failure;
use crate::field::PyField;
use crate::forward::in_whole;
use crate::guard::guarded;
use crate::pool;
use crate::rows::Angles;
use crate::track::{Changing, Suns};

/// Rows computed between two looks at whether the user wants to stop: some hundredths of a second.
const ROWS_PER_LOOK: usize = 1 << 18;

/// The angle of each beam off its aim \[rad\], and the statuses. `columns` are both angles, of corrected ones also the
/// corrections.
#[pyfunction]
pub(crate) fn _verify<'py>(
    py: Python<'py>,
    field: &Bound<'py, PyAny>,
    columns: Vec<Bound<'py, PyAny>>,
    status: &Bound<'py, PyAny>,
    sun_azimuth_rad: &Bound<'py, PyAny>,
    sun_elevation_rad: &Bound<'py, PyAny>,
    times: Option<&Bound<'py, PyAny>>,
) -> PyResult<[Bound<'py, PyAny>; 2]> {
    guarded(|| {
        let field = PyField::of(field)?.get().inner();
        let n = field.len();
        let angles = Angles::of(&columns, status, n, "tracking")?;
        let suns = Suns::of(sun_azimuth_rad, sun_elevation_rad)?;
        let shape = angles.shape(n);
        if suns.count() != angles.suns() {
            let wanted: Vec<usize> = suns.count().into_iter().chain([n]).collect();
            return Err(wrong_shape("tracking", &shape_text(&wanted), &shape));
        }
        let times = times.map(|times| suns.times(times)).transpose()?;
        let mut changing = Changing::of(field, &*field.tracker(OffsetForm::Exact)?)?;
        let planes = (0..n)
            .map(|row| field.plane_for(row))
            .collect::<Result<Vec<TargetPlane>, _>>()?;
        let drives = field.loaded().drives.as_slice();
        let mut back = BeamsBack::new(drives, planes, TrackOptions::default());
        let given = angles.columns()?;
        let mut status = angles.status().to_vec();
        let mut errors_rad = Vec::with_capacity(status.len());
        let suns = suns.directions();
        let per_block = (ROWS_PER_LOOK / n.max(1)).max(1);
        for first in (0..suns.len()).step_by(per_block) {
            if first > 0 {
                py.check_signals()?;
            }
            let block = first..suns.len().min(first + per_block);
            let mut work = || {
                let of = |k: usize| &given[k][block.start * n..block.end * n];
                let turns = (given.len() == 4).then(|| [of(2), of(3)]);
                let axes = back.angles_rad([of(0), of(1)], turns);
                for sun in block.clone() {
                    if let Some(changing) = &mut changing {
                        let unix_ns = times.as_ref().map(|times| times[sun]);
                        changing.bring_up_to_date(unix_ns, suns[sun])?;
                    }
                    let tracker = changing.as_ref().map_or(field.exact(), |c| c.tracker());
                    let rows = (sun - first) * n..(sun - first + 1) * n;
                    let axes = axes.each_ref().map(|column| &column[rows.clone()]);
                    let status = &mut status[sun * n..(sun + 1) * n];
                    back.sun(tracker, suns[sun], axes, status, &mut errors_rad)
                        .map_err(|error| in_whole(error, sun * n))?;
                }
                Ok::<_, Failure>(())
            };
            py.detach(|| pool::run(&mut work))??;
        }
        let codes: Vec<u8> = status.iter().map(|status: &Status| status.code()).collect();
        Ok([owned(py, errors_rad, &shape)?, owned(py, codes, &shape)?])
    })
}
