//! `predict`: where beams land; the typed call and its answer are in `helio_py._predict`.

use helio_core::tracking::Prediction;
use helio_core::{EnuUnit, OffsetForm, TargetPlane, TrackOptions};
use helio_io::{Angles, RowPredictor, RowPredictorError};
use pyo3::prelude::*;

use crate::array::{Numbers, owned, shape_text, wrong_shape};
use crate::failure::Failure;
use crate::field::PyField;
use crate::forward::in_whole;
use crate::guard::guarded;
use crate::track::{Changing, Suns, direction};

/// Rows computed between two looks at whether the user wants to stop: some hundredths of a second.
const ROWS_PER_LOOK: usize = 1 << 18;

/// The columns u_m, v_m, point_enu_m, beam_error_rad and status.
#[pyfunction]
pub(crate) fn _predict<'py>(
    py: Python<'py>,
    field: &Bound<'py, PyAny>,
    azimuth_rad: &Bound<'py, PyAny>,
    elevation_rad: &Bound<'py, PyAny>,
    sun_azimuth_rad: &Bound<'py, PyAny>,
    sun_elevation_rad: &Bound<'py, PyAny>,
    times: Option<&Bound<'py, PyAny>>,
) -> PyResult<[Bound<'py, PyAny>; 5]> {
    guarded(|| {
        let field = PyField::of(field)?.get().inner();
        let n = field.len();
        let suns = Suns::of(sun_azimuth_rad, sun_elevation_rad)?;
        let wanted: Vec<usize> = suns.count().into_iter().chain([n]).collect();
        let azimuth_rad = Numbers::of(azimuth_rad, "azimuth_rad")?;
        let elevation_rad = Numbers::of(elevation_rad, "elevation_rad")?;
        for (numbers, what) in [
            (&azimuth_rad, "azimuth_rad"),
            (&elevation_rad, "elevation_rad"),
        ] {
            if numbers.shape() != wanted {
                return Err(wrong_shape(what, &shape_text(&wanted), numbers.shape()));
            }
        }
        let times = times.map(|times| suns.times(times)).transpose()?;
        let mut changing = Changing::of(field, &*field.tracker(OffsetForm::Exact)?)?;
        let planes = (0..n)
            .map(|row| field.plane_for(row))
            .collect::<Result<Vec<TargetPlane>, _>>()?;
        let angles = [azimuth_rad.as_slice()?, elevation_rad.as_slice()?];
        let mut columns = Columns::default();
        let suns = suns.directions();
        let per_block = (ROWS_PER_LOOK / n.max(1)).max(1);
        for first in (0..suns.len()).step_by(per_block) {
            if first > 0 {
                py.check_signals()?;
            }
            py.detach(|| {
                let mut one = Prediction::default();
                for sun in first..suns.len().min(first + per_block) {
                    if let Some(changing) = &mut changing {
                        let unix_ns = times.as_ref().map(|times| times[sun]);
                        changing.bring_up_to_date(unix_ns, suns[sun])?;
                    }
                    let tracker = changing.as_ref().map_or(field.exact(), |c| c.tracker());
                    let rows = sun * n..(sun + 1) * n;
                    let [axis1, axis2] = angles.map(|column| &column[rows.clone()]);
                    let options = TrackOptions::default();
                    tracker
                        .predict_into(suns[sun], axis1, axis2, &planes, &options, &mut one)
                        .map_err(|error| in_whole(error, rows.start))?;
                    columns.add(&one);
                }
                Ok::<_, Failure>(())
            })?;
        }
        columns.handed_out(py, &wanted)
    })
}

impl From<RowPredictorError> for Failure {
    fn from(error: RowPredictorError) -> Self {
        match error {
            RowPredictorError::Field(error) => error.into(),
            RowPredictorError::Track(error) => error.into(),
            RowPredictorError::Calibration(error) => error.into(),
            other => Self::new("MissingError", other.to_string()),
        }
    }
}

/// The same columns for rows of a table of angles, each of a heliostat under a sun \[rad, ns of Unix time\].
#[pyfunction]
pub(crate) fn _predict_rows<'py>(
    py: Python<'py>,
    field: &Bound<'py, PyAny>,
    heliostat: Vec<usize>,
    angles: [Bound<'py, PyAny>; 2],
    suns: [Bound<'py, PyAny>; 2],
    unix_ns: Option<Vec<i64>>,
) -> PyResult<[Bound<'py, PyAny>; 5]> {
    guarded(|| {
        let loaded = PyField::of(field)?.get().inner().loaded();
        let numbers = |of: &Bound<'py, PyAny>| {
            let numbers = Numbers::of(of, "azimuth_rad")?;
            Ok::<_, Failure>(numbers.as_slice()?.to_vec())
        };
        let [axis1_rad, axis2_rad] = [numbers(&angles[0])?, numbers(&angles[1])?];
        let angles = Angles {
            heliostat,
            axis1_rad,
            axis2_rad,
            ..Angles::default()
        };
        let rows = angles.heliostat.len();
        let [azimuth_rad, elevation_rad] = [numbers(&suns[0])?, numbers(&suns[1])?];
        let toward = azimuth_rad.iter().zip(&elevation_rad).enumerate();
        let toward = toward.map(|(row, (&azimuth, &elevation))| direction(row, azimuth, elevation));
        let toward = toward.collect::<Result<Vec<EnuUnit>, Failure>>()?;
        let same = |a: usize, b: usize| match &unix_ns {
            Some(unix_ns) => unix_ns[a] == unix_ns[b],
            None => azimuth_rad[a] == azimuth_rad[b] && elevation_rad[a] == elevation_rad[b],
        };
        let mut predictor = RowPredictor::new(loaded, TrackOptions::default())?;
        let mut columns = Columns::default();
        let mut start = 0;
        while start < rows {
            if start > 0 {
                py.check_signals()?;
            }
            py.detach(|| {
                let mut looked_at = 0;
                while start < rows && looked_at < ROWS_PER_LOOK {
                    let end = predictor.group_end(&angles, start, same);
                    let unix_ns = unix_ns.as_ref().map(|times| times[start]);
                    let landed = predictor.predict(&angles, start..end, toward[start], unix_ns)?;
                    for &heliostat in &angles.heliostat[start..end] {
                        columns.add_row(landed, heliostat);
                    }
                    start = end;
                    looked_at += loaded.field.len();
                }
                Ok::<_, Failure>(())
            })?;
        }
        columns.handed_out(py, &[rows])
    })
}

#[derive(Default)]
struct Columns {
    u_m: Vec<f64>,
    v_m: Vec<f64>,
    point_enu_m: Vec<f64>,
    beam_error_rad: Vec<f64>,
    status: Vec<u8>,
}

impl Columns {
    fn add(&mut self, one: &Prediction) {
        for row in 0..one.status.len() {
            self.add_row(one, row);
        }
    }

    fn add_row(&mut self, one: &Prediction, row: usize) {
        self.u_m.push(one.u_m[row]);
        self.v_m.push(one.v_m[row]);
        self.point_enu_m
            .extend([one.east_m[row], one.north_m[row], one.up_m[row]]);
        self.beam_error_rad.push(one.beam_error_rad[row]);
        self.status.push(one.status[row].code());
    }

    fn handed_out<'py>(
        self,
        py: Python<'py>,
        shape: &[usize],
    ) -> Result<[Bound<'py, PyAny>; 5], Failure> {
        let points: Vec<usize> = shape.iter().copied().chain([3]).collect();
        Ok([
            owned(py, self.u_m, shape)?,
            owned(py, self.v_m, shape)?,
            owned(py, self.point_enu_m, &points)?,
            owned(py, self.beam_error_rad, shape)?,
            owned(py, self.status, shape)?,
        ])
    }
}
