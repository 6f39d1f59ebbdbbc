//! `correct`: axis angles with what a joint calibration left by pose; the typed call and its answer are in
//! `helio_py._correct`.

use std::borrow::Cow;

use helio_core::Status;
use helio_io::{Corrections, CorrectionsError, beyond_drives, by_row};
use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::array::owned;
use crate::failure::Failure;
use crate::field::{Inner, PyField};
use crate::guard::guarded;
use crate::rows::Angles;
use crate::table::Given;
use crate::watch::{watched, watched_or_left};

/// Rows computed between two looks at whether the user wants to stop: some tenths of a second at the most known poses.
const ROWS_PER_LOOK: usize = 1 << 15;

impl From<CorrectionsError> for Failure {
    fn from(error: CorrectionsError) -> Self {
        match error {
            CorrectionsError::Table(error) => Self::from(error).or_of("leftovers"),
            other => Self::of("ConflictError", "leftovers", other),
        }
    }
}

/// Angles, incidence, excess, corrections and standard deviations, as columns of the rows given.
struct Columns {
    numbers: [Vec<f64>; 8],
    status: Vec<Status>,
}

/// The columns of a `Corrected`, by name.
#[pyfunction]
pub(crate) fn _correct<'py>(
    py: Python<'py>,
    field: &Bound<'py, PyAny>,
    columns: Vec<Bound<'py, PyAny>>,
    status: &Bound<'py, PyAny>,
    leftovers: &Bound<'py, PyAny>,
    progress: Option<Py<PyAny>>,
) -> PyResult<Bound<'py, PyDict>> {
    guarded(|| {
        let field = PyField::of(field)?;
        let inner = field.get().inner();
        let angles = Angles::of(&columns, status, inner.len(), "tracking")?;
        let leftovers = Given::of(leftovers, "leftovers")?;
        let kept = field.clone().unbind();
        // Of a large field some hundred megabytes of text.
        let corrections = watched_or_left(py, None, move |_| {
            let inner = kept.get().inner();
            let schedule = inner.schedule().map(|(schedule, _)| schedule);
            Corrections::load(leftovers.source(), inner.field(), schedule)
        })??;
        let (given, status) = (angles.columns()?, angles.status());
        let done = watched(py, progress.as_ref(), |watch| {
            corrected(inner, &corrections, &given, status, watch)
        })?;
        let dict = PyDict::new(py);
        let shape = angles.shape(inner.len());
        let names = [
            "azimuth_rad",
            "elevation_rad",
            "incidence_rad",
            "limit_excess_rad",
            "leftover_axis1_rad",
            "leftover_axis2_rad",
            "sigma_axis1_rad",
            "sigma_axis2_rad",
        ];
        for (name, column) in names.into_iter().zip(done.numbers) {
            dict.set_item(name, owned(py, column, &shape)?)?;
        }
        let codes: Vec<u8> = done.status.iter().map(|status| status.code()).collect();
        dict.set_item("status", owned(py, codes, &shape)?)?;
        let warnings = corrections.of_another_calibration().map(|others| {
            format!("{others}; write them anew with calibrate(..., joint=True, leftovers=True)")
        });
        dict.set_item("warnings", warnings.into_iter().collect::<Vec<_>>())?;
        Ok(dict)
    })
}

fn corrected(
    field: &Inner,
    corrections: &Corrections,
    given: &[&[f64]],
    status: &[Status],
    watch: &(dyn Fn(u64, u64) -> bool + Sync),
) -> Columns {
    let (rows, n) = (status.len(), field.len());
    let mut done = Columns {
        numbers: Default::default(),
        status: Vec::with_capacity(rows),
    };
    let per_block = n * (ROWS_PER_LOOK / n.max(1)).max(1);
    for first in (0..rows).step_by(per_block.max(1)) {
        if !watch(0, rows as u64) {
            break; // the user's signal is what is raised
        }
        let block = first..rows.min(first + per_block);
        let [one, two, incidence, excess] = [0, 1, 2, 3].map(|k| &given[k][block.clone()]);
        let found = corrections.correct(one, two, &status[block.clone()]);
        let mut now = Cow::Borrowed(&status[block.clone()]);
        if field.drives_end_early() {
            let drives = &field.loaded().drives;
            let [one, two] = [0, 1].map(|axis| {
                by_row(drives, &found.axes_rad[axis], |of, angle| {
                    of[axis]?.steps(angle)
                })
            });
            beyond_drives(drives, [&one, &two], &mut now);
        }
        let [axis1, axis2] = found.axes_rad;
        let [turn1, turn2] = found.turns_rad;
        let [sigma1, sigma2] = found.sigmas_rad;
        let mut columns = [
            axis1,
            axis2,
            incidence.to_vec(),
            excess.to_vec(),
            turn1,
            turn2,
            sigma1,
            sigma2,
        ];
        // As where the angles alone are beyond their drive: by how much is not known.
        for (row, (now, before)) in now.iter().zip(&status[block.clone()]).enumerate() {
            if now != before {
                columns.iter_mut().for_each(|column| column[row] = f64::NAN);
            }
        }
        for (all, column) in done.numbers.iter_mut().zip(columns) {
            all.extend(column);
        }
        done.status.extend_from_slice(&now);
        watch(block.len() as u64, rows as u64);
    }
    done
}
