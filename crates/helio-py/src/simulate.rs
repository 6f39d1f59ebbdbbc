//! `simulate_field` and `simulate_observations`: the typed calls are in `helio_py._simulate`; beside them frames and
//! campaigns of tracking accuracy.

pub(crate) mod campaign;
pub(crate) mod images;

use helio_calib::simulate::{Aiming, ErrorSpread, Jump, SimulateOptions};
use helio_core::angle::radians;
use helio_core::layout::Measures;
use helio_io::output::{Destination, Format};
use helio_io::{
    LayoutPattern, ObservationPlan, SimulateError, SimulatedLayout, SimulatedObservations,
};
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyList};

use crate::array::owned;
use crate::failure::Failure;
use crate::field::PyField;
use crate::given;
use crate::guard::guarded;
use crate::watch::{watched, watched_or_left};

/// Names made between two looks at whether the user wants to stop.
const IDS_PER_LOOK: usize = 1 << 16;

/// Columns of a generated layout.
#[pyfunction]
pub(crate) fn _simulate_field<'py>(
    py: Python<'py>,
    heliostats: u32,
    layout: &str,
    tower_height_m: f64,
    mirror_width_m: f64,
    mirror_height_m: f64,
    pivot_height_m: f64,
) -> PyResult<Bound<'py, PyDict>> {
    guarded(|| {
        let pattern = match layout {
            "radial-staggered" => LayoutPattern::RadialStaggered,
            "fermat-spiral" => LayoutPattern::FermatSpiral,
            other => {
                let message = format!("wanted radial-staggered or fermat-spiral, got `{other}`");
                return Err(Failure::of("OptionError", "layout", message));
            }
        };
        let measures = Measures {
            count: heliostats as usize,
            tower_height_m,
            mirror_width_m,
            mirror_height_m,
            up_m: pivot_height_m,
        };
        let made = watched_or_left(py, None, move |_| {
            SimulatedLayout::generate(pattern, &measures)
        })?;
        let table = PyDict::new(py);
        let len = made.ids.len();
        let ids = PyList::empty(py);
        for (row, id) in made.ids.into_iter().enumerate() {
            if row % IDS_PER_LOOK == 0 {
                py.check_signals()?;
            }
            ids.append(id)?;
        }
        table.set_item("id", ids)?;
        for (name, column) in [
            ("east_m", made.east_m),
            ("north_m", made.north_m),
            ("up_m", made.up_m),
        ] {
            table.set_item(name, owned(py, column, &[len])?)?;
        }
        Ok(table)
    })
}

/// What is observed, as the keywords of `simulate_observations` have it.
#[derive(FromPyObject)]
#[pyo3(from_item_all)]
pub(crate) struct CampaignAsked {
    heliostats: Option<usize>,
    ids: Option<Vec<String>>,
    targets: Option<Vec<String>>,
    count: usize,
    seed: u64,
    from_unix_ns: i64,
    to_unix_ns: i64,
    days: Option<usize>,
    hours: [f64; 2],
    min_sun_elevation_deg: f64,
    noise_mrad: f64,
    outliers: f64,
    outlier_mrad: f64,
    wrong_heliostat: f64,
    wrong_target: f64,
    jumps: Vec<(i64, f64, f64)>,
    random_errors: bool,
    steps: bool,
}

impl From<CampaignAsked> for ObservationPlan {
    fn from(asked: CampaignAsked) -> Self {
        let jumps = asked.jumps.into_iter().map(|(unix_ns, one, two)| Jump {
            unix_ns,
            azimuth_reference_rad: 1e-3 * one,
            elevation_reference_rad: 1e-3 * two,
        });
        let options = SimulateOptions {
            seed: asked.seed,
            count: asked.count,
            from_unix_ns: asked.from_unix_ns,
            to_unix_ns: asked.to_unix_ns,
            days: asked.days,
            hours: asked.hours,
            min_sun_elevation_rad: radians(asked.min_sun_elevation_deg),
            noise_mrad: asked.noise_mrad,
            outlier_share: asked.outliers,
            outlier_mrad: asked.outlier_mrad,
            jumps: jumps.collect(),
            wrong_target_share: asked.wrong_target,
            aiming: Aiming::Uncalibrated,
            ..SimulateOptions::default()
        };
        Self {
            heliostats: asked.heliostats,
            ids: asked.ids,
            targets: asked.targets,
            options,
            wrong_heliostat_share: asked.wrong_heliostat,
            spread: asked.random_errors.then(ErrorSpread::default),
            steps: asked.steps,
        }
    }
}

/// A campaign of observations of a field with a site and targets.
#[pyfunction]
pub(crate) fn _simulate_observations(
    py: Python<'_>,
    field: &Bound<'_, PyAny>,
    asked: CampaignAsked,
    progress: Option<Py<PyAny>>,
) -> PyResult<PyCampaign> {
    guarded(|| {
        let field = PyField::of(field)?.clone().unbind();
        field.get().inner().with_targets()?;
        let plan = ObservationPlan::from(asked);
        let seen = watched(py, progress.as_ref(), |watch| {
            SimulatedObservations::of(field.get().inner().loaded(), &plan, watch)
        })??;
        Ok(PyCampaign { field, seen })
    })
}

impl From<SimulateError> for Failure {
    fn from(error: SimulateError) -> Self {
        let message = error.to_string();
        match error {
            SimulateError::NoSite => Self::new("MissingError", message),
            SimulateError::UnknownHeliostat { .. } => Self::of("OptionError", "ids", message),
            SimulateError::UnknownTarget { .. }
            | SimulateError::TargetWithoutPlane { .. }
            | SimulateError::NoneFaced => Self::of("OptionError", "targets", message),
            SimulateError::NoSteps { .. } => Self::of("OptionError", "steps", message),
            SimulateError::Site(error) => error.into(),
            _ => Self::new("OptionError", message),
        }
    }
}

/// One of a mount's errors \[rad\].
type ErrorOf = fn(&helio_core::MountErrors) -> f64;

/// A simulated campaign, for `helio_py.SimulatedObservations`.
#[pyclass(frozen, name = "_Campaign", module = "helio_py._native")]
pub(crate) struct PyCampaign {
    field: Py<PyField>,
    seen: SimulatedObservations,
}

#[pymethods]
impl PyCampaign {
    /// Columns as the observations file has them; times as nanoseconds of Unix time.
    fn observations<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        guarded(|| {
            let seen = &self.seen;
            let n = seen.heliostat_ids.len();
            let numbers = |column: &Vec<f64>| owned(py, column.clone(), &[n]);
            let table = PyDict::new(py);
            table.set_item("heliostat_id", &seen.heliostat_ids)?;
            let times = seen.unix_ns.iter().map(|time| time.unwrap_or(i64::MIN));
            table.set_item("time", owned(py, times.collect::<Vec<_>>(), &[n])?)?;
            let names = if seen.steps {
                ["axis1_steps", "axis2_steps"]
            } else {
                ["axis1_deg", "axis2_deg"]
            };
            for (name, column) in names.into_iter().zip(&seen.axes) {
                table.set_item(name, numbers(column)?)?;
            }
            table.set_item("target", &seen.targets)?;
            for (name, column) in [
                ("u_m", &seen.u_m),
                ("v_m", &seen.v_m),
                ("sigma_m", &seen.sigma_m),
            ] {
                table.set_item(name, numbers(column)?)?;
            }
            Ok(table)
        })
    }

    /// The true errors of the heliostats observed, as columns.
    fn truth<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        guarded(|| {
            let seen = &self.seen;
            let field = self.field.get().inner().field();
            let ids: Vec<&str> = seen
                .rows
                .iter()
                .map(|&row| field.ids()[row].as_str())
                .collect();
            let table = PyDict::new(py);
            table.set_item("id", ids)?;
            let columns: [(&str, ErrorOf); 6] = [
                ("pedestal_tilt_rad", |e| e.pedestal_tilt_rad),
                ("pedestal_tilt_azimuth_rad", |e| e.pedestal_tilt_azimuth_rad),
                ("axis_nonorthogonality_rad", |e| e.axis_nonorthogonality_rad),
                ("mirror_tilt_rad", |e| e.mirror_tilt_rad),
                ("azimuth_reference_rad", |e| e.azimuth_reference_rad),
                ("elevation_reference_rad", |e| e.elevation_reference_rad),
            ];
            for (name, of) in columns {
                let column: Vec<f64> = seen.truth.iter().map(of).collect();
                table.set_item(name, owned(py, column, &[seen.truth.len()])?)?;
            }
            Ok(table)
        })
    }

    /// Heliostats that no target faces.
    fn unseen(&self) -> Vec<String> {
        self.seen.unseen.clone()
    }

    /// Writes the observations, or the true errors as a calibration table.
    fn write(&self, path: &Bound<'_, PyAny>, truth: bool) -> PyResult<()> {
        guarded(|| {
            let py = path.py();
            let path = given::path(path, "path")?;
            let Some(format) = Format::of_path(&path) else {
                let message = format!(
                    "{}: the suffix stands for no format; wanted .csv, .parquet, .json or .jsonl",
                    path.display()
                );
                return Err(Failure::of("OptionError", "path", message));
            };
            let destination = Destination::File(path);
            let field = self.field.get().inner();
            py.detach(|| match truth {
                true => self.seen.write_truth(field.loaded(), destination, format),
                false => self.seen.write(destination, format).map(|_| ()),
            })?;
            Ok(())
        })
    }
}
