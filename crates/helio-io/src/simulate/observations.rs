//! Synthetic campaigns of camera observations.

use std::f64::consts::TAU;

use helio_calib::random::Random;
use helio_calib::simulate::{ErrorSpread, SimulateOptions, simulate_while};
use helio_calib::{CalibrationError, Mount, Observation, Parameters};
use helio_core::angle::degrees;
use helio_core::{MountErrors, TargetPlane};
use rayon::prelude::*;

use crate::output::{Cells, Destination, Format, write_columns};
use crate::{CalibratedSet, IoError, LoadedField, Provenance, degrees_for, write_calibration};

/// Streams of random numbers of the true errors, apart from those of the campaigns.
const TRUTH: u64 = 0x7472_7574_6800_0000;
/// Neighbours whose records may get among those of a heliostat.
const NEIGHBOURS: usize = 8;

/// What is observed, and how.
#[derive(Debug, Clone, Default)]
pub struct ObservationPlan {
    /// So many heliostats, evenly over the field; all if there is no number.
    pub heliostats: Option<usize>,
    /// These heliostats instead.
    pub ids: Option<Vec<String>>,
    /// Targets to see spots on; all that have a plane if none is named.
    pub targets: Option<Vec<String>>,
    /// Of each heliostat. Its neighbours and share of wrong heliostats are filled in here.
    pub options: SimulateOptions,
    /// Share of observations that are a neighbour's.
    pub wrong_heliostat_share: f64,
    /// The true errors are drawn from this; those of the field without it.
    pub spread: Option<ErrorSpread>,
    /// Motor steps instead of angles.
    pub steps: bool,
}

/// Why nothing is simulated.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum SimulateError {
    /// The sun at the times of observations needs a site.
    #[error("there is no [site], which the sun at the times of observations needs")]
    NoSite,
    /// A heliostat that the field does not have.
    #[error("no heliostat `{id}` in the field")]
    UnknownHeliostat {
        /// What was asked for.
        id: String,
    },
    /// A target that the field does not have.
    #[error("unknown target `{name}`; known are {known}")]
    UnknownTarget {
        /// What was asked for.
        name: String,
        /// Those that there are.
        known: String,
    },
    /// A target without a plane.
    #[error("target `{name}` is a mere point, and a spot is seen on a plane")]
    TargetWithoutPlane {
        /// Which.
        name: String,
    },
    /// No target faces any heliostat.
    #[error(
        "no target with a plane faces any of the heliostats; give one normal_enu, width_m and height_m, or name \
         another"
    )]
    NoneFaced,
    /// Options that a heliostat cannot be observed with.
    #[error("heliostat {id}: {error}")]
    Heliostat {
        /// Which.
        id: String,
        /// Why.
        error: Box<CalibrationError>,
    },
    /// An angle that no steps lead to.
    #[error("heliostat {id} has no drive on axis {axis} that goes to {angle_deg:.3} degrees")]
    NoSteps {
        /// Which.
        id: String,
        /// Its axis, 1 or 2.
        axis: usize,
        /// The angle \[degrees\].
        angle_deg: f64,
    },
    /// The site's numbers.
    #[error(transparent)]
    Site(#[from] helio_core::sun::SunError),
    /// Whoever watched wanted an end.
    #[error("stopped")]
    Stopped,
}

/// A campaign: what was seen, and the errors that were true.
#[derive(Debug, Clone)]
pub struct SimulatedObservations {
    /// Rows of the heliostats observed, in the order asked for.
    pub rows: Vec<usize>,
    /// Names of those that no target faces, and that have no observations.
    pub unseen: Vec<String>,
    /// The heliostat of each observation.
    pub heliostat_ids: Vec<String>,
    /// Its time \[ns of Unix time\].
    pub unix_ns: Vec<Option<i64>>,
    /// Encoder angles of both axes \[degrees\], or motor steps.
    pub axes: [Vec<f64>; 2],
    /// Whether they are steps.
    pub steps: bool,
    /// Its target's name.
    pub targets: Vec<String>,
    /// The spot right of the target's centre \[m\].
    pub u_m: Vec<f64>,
    /// The spot below it \[m\].
    pub v_m: Vec<f64>,
    /// One standard deviation of either \[m\]; NaN without noise.
    pub sigma_m: Vec<f64>,
    /// The true errors of each heliostat of `rows`.
    pub truth: Vec<MountErrors>,
}

impl SimulatedObservations {
    /// Simulates what cameras see of a field. The same plan gives the same observations, whatever the threads.
    /// `watch` is told of heliostats done and in all.
    ///
    /// # Errors
    /// [`SimulateError`]; [`SimulateError::Stopped`] if `watch` wanted an end.
    ///
    /// ```
    /// use helio_io::{ObservationPlan, SimulateError, SimulatedObservations, load_field};
    /// let folder = tempfile::tempdir()?;
    /// std::fs::write(folder.path().join("h.csv"), "id,east_m,north_m,up_m\nA1,0,100,5\n")?;
    /// std::fs::write(folder.path().join("field.toml"), "[targets.t]\ncentre_enu_m = [0, 0, 50]\n\
    ///     [heliostats]\ntable = \"h.csv\"\naim = \"t\"\n")?;
    /// let loaded = load_field(&folder.path().join("field.toml"))?;
    /// let refused = SimulatedObservations::of(&loaded, &ObservationPlan::default(), &|_, _| true);
    /// assert!(matches!(refused, Err(SimulateError::NoSite)));
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn of(
        loaded: &LoadedField,
        plan: &ObservationPlan,
        watch: &(dyn Fn(u64, u64) -> bool + Sync),
    ) -> Result<Self, SimulateError> {
        let campaign = Campaign::new(loaded, plan)?;
        let rows = rows(loaded, plan)?;
        // The first of several failures is the one to report, whichever thread was first.
        let all: Vec<Result<Option<Vec<Observation>>, SimulateError>> = rows
            .par_iter()
            .map(|&row| {
                let all = rows.len() as u64;
                let seen = campaign.of(row, &|| watch(0, all))?;
                watch(1, all);
                Ok(seen)
            })
            .collect();
        let all: Vec<Option<Vec<Observation>>> = all.into_iter().collect::<Result<_, _>>()?;
        let ids = loaded.field.ids();
        let unseen: Vec<String> = rows
            .iter()
            .zip(&all)
            .filter(|(_, seen)| seen.is_none())
            .map(|(&row, _)| ids[row].clone())
            .collect();
        if unseen.len() == rows.len() {
            return Err(SimulateError::NoneFaced);
        }
        let seen: Vec<(usize, Observation)> = rows
            .iter()
            .zip(all)
            .flat_map(|(&row, seen)| seen.unwrap_or_default().into_iter().map(move |o| (row, o)))
            .collect();
        campaign.table(rows, unseen, &seen)
    }

    /// Writes the observations as `calibrate` reads them, and answers the bytes.
    ///
    /// # Errors
    /// [`IoError`] if they cannot be written.
    pub fn write(&self, destination: Destination, format: Format) -> Result<u64, IoError> {
        let names = if self.steps {
            ["axis1_steps", "axis2_steps"]
        } else {
            ["axis1_deg", "axis2_deg"]
        };
        let columns = [
            ("heliostat_id", Cells::Text(&self.heliostat_ids)),
            ("time", Cells::Times(&self.unix_ns)),
            (names[0], Cells::Numbers(&self.axes[0])),
            (names[1], Cells::Numbers(&self.axes[1])),
            ("target", Cells::Text(&self.targets)),
            ("u_m", Cells::Numbers(&self.u_m)),
            ("v_m", Cells::Numbers(&self.v_m)),
            ("sigma_m", Cells::Numbers(&self.sigma_m)),
        ];
        write_columns(destination, format, &columns)
    }

    /// Writes the true errors as a calibration table.
    ///
    /// # Errors
    /// [`IoError`] if they cannot be written.
    pub fn write_truth(
        &self,
        loaded: &LoadedField,
        destination: Destination,
        format: Format,
    ) -> Result<(), IoError> {
        let sets: Vec<CalibratedSet> = self
            .rows
            .iter()
            .zip(&self.truth)
            .map(|(&row, errors)| {
                let heliostat = &loaded.field.heliostats()[row];
                CalibratedSet {
                    errors: Some(*errors),
                    pose_errors_rad: CalibratedSet::stated(heliostat.pose_errors),
                    mirror_offset_m: Some(heliostat.mirror_offset_m),
                    ..CalibratedSet::without_result(&loaded.field.ids()[row], "truth", "")
                }
            })
            .collect();
        let provenance = Provenance {
            version: env!("CARGO_PKG_VERSION").to_owned(),
            ..Provenance::default()
        };
        write_calibration(destination, format, &sets, &provenance)?;
        Ok(())
    }
}

/// The heliostats to observe.
fn rows(loaded: &LoadedField, plan: &ObservationPlan) -> Result<Vec<usize>, SimulateError> {
    let n = loaded.field.len();
    if let Some(ids) = &plan.ids {
        return ids
            .iter()
            .map(|id| {
                let unknown = || SimulateError::UnknownHeliostat { id: id.clone() };
                loaded.field.row_of(id).ok_or_else(unknown)
            })
            .collect();
    }
    let wanted = plan.heliostats.map_or(n, |count| count.min(n));
    Ok((0..wanted).map(|k| k * n / wanted).collect())
}

/// What all heliostats share.
struct Campaign<'a> {
    loaded: &'a LoadedField,
    plan: &'a ObservationPlan,
    site: helio_core::sun::SunSite,
    targets: Vec<(&'a str, TargetPlane)>,
}

impl<'a> Campaign<'a> {
    fn new(loaded: &'a LoadedField, plan: &'a ObservationPlan) -> Result<Self, SimulateError> {
        let site = loaded.site.as_ref().ok_or(SimulateError::NoSite)?;
        let mut targets = Vec::new();
        for (name, target) in &loaded.targets {
            let wanted = plan
                .targets
                .as_ref()
                .is_none_or(|names| names.contains(name));
            match target.area {
                Some(area) if wanted => targets.push((name.as_str(), area.plane)),
                None if wanted && plan.targets.is_some() => {
                    return Err(SimulateError::TargetWithoutPlane { name: name.clone() });
                }
                _ => {}
            }
        }
        for name in plan.targets.iter().flatten() {
            if !loaded.targets.contains_key(name) {
                let known: Vec<&str> = loaded.targets.keys().map(String::as_str).collect();
                return Err(SimulateError::UnknownTarget {
                    name: name.clone(),
                    known: known.join(", "),
                });
            }
        }
        Ok(Self {
            loaded,
            plan,
            site: site.sun_site()?,
            targets,
        })
    }

    fn mount(&self, row: usize) -> Mount {
        let field = &self.loaded.field;
        Mount::of(field.mode(), &field.heliostats()[row])
    }

    fn errors(&self, row: usize) -> MountErrors {
        match &self.plan.spread {
            Some(spread) => spread.draw(&mut Random::stream(
                self.plan.options.seed ^ TRUTH,
                row as u64,
            )),
            None => self.loaded.field.heliostats()[row].errors,
        }
    }

    fn parameters(&self, row: usize) -> Parameters {
        let offset_m = self.loaded.field.heliostats()[row].mirror_offset_m;
        Parameters::new(&self.errors(row), offset_m)
    }

    /// The observations of a heliostat, their targets numbered as here; `None` if no target faces it.
    fn of(
        &self,
        row: usize,
        goes_on: &dyn Fn() -> bool,
    ) -> Result<Option<Vec<Observation>>, SimulateError> {
        let mount = self.mount(row);
        let facing: Vec<usize> = (0..self.targets.len())
            .filter(|&k| {
                let plane = &self.targets[k].1;
                // Not at grazing incidence either.
                let toward = mount.pivot - plane.centre;
                plane.normal.as_enu().dot(toward) > 0.2 * toward.norm()
            })
            .collect();
        if facing.is_empty() {
            return Ok(None);
        }
        let planes: Vec<TargetPlane> = facing.iter().map(|&k| self.targets[k].1).collect();
        let neighbours = if self.plan.wrong_heliostat_share > 0.0 {
            self.neighbours(row)
        } else {
            Vec::new()
        };
        let options = SimulateOptions {
            seed: Random::stream(self.plan.options.seed, row as u64).next_u64(),
            wrong_heliostat_share: if neighbours.is_empty() {
                0.0
            } else {
                self.plan.wrong_heliostat_share
            },
            wrong_target_share: if planes.len() > 1 {
                self.plan.options.wrong_target_share
            } else {
                0.0
            },
            neighbours,
            ..self.plan.options.clone()
        };
        let parameters = self.parameters(row);
        let seen = simulate_while(&mount, &parameters, &planes, &self.site, &options, goes_on)
            .map_err(|error| match error {
                CalibrationError::Stopped => SimulateError::Stopped,
                error => SimulateError::Heliostat {
                    id: self.loaded.field.ids()[row].clone(),
                    error: Box::new(error),
                },
            })?;
        let mut observations = seen.observations;
        for observation in &mut observations {
            observation.target = facing[observation.target];
        }
        Ok(Some(observations))
    }

    fn neighbours(&self, row: usize) -> Vec<(Mount, Parameters)> {
        crate::calibrate::neighbours(&self.loaded.field, row, NEIGHBOURS)
            .into_iter()
            .map(|other| (self.mount(other), self.parameters(other)))
            .collect()
    }

    fn table(
        &self,
        rows: Vec<usize>,
        unseen: Vec<String>,
        seen: &[(usize, Observation)],
    ) -> Result<SimulatedObservations, SimulateError> {
        let number = |of: &dyn Fn(&Observation) -> f64| -> Vec<f64> {
            seen.iter().map(|(_, o)| of(o)).collect()
        };
        let ids = self.loaded.field.ids();
        Ok(SimulatedObservations {
            truth: rows.iter().map(|&row| self.errors(row)).collect(),
            rows,
            unseen,
            heliostat_ids: seen.iter().map(|(row, _)| ids[*row].clone()).collect(),
            unix_ns: seen.iter().map(|(_, o)| o.unix_ns).collect(),
            axes: if self.plan.steps {
                self.steps(seen)?
            } else {
                [
                    number(&|o| degrees_for(o.axis1_rad)),
                    number(&|o| degrees_for(o.axis2_rad)),
                ]
            },
            steps: self.plan.steps,
            targets: seen
                .iter()
                .map(|(_, o)| self.targets[o.target].0.to_owned())
                .collect(),
            u_m: number(&|o| o.u_m),
            v_m: number(&|o| o.v_m),
            sigma_m: number(&|o| o.sigma_m.unwrap_or(f64::NAN)),
        })
    }

    fn steps(&self, seen: &[(usize, Observation)]) -> Result<[Vec<f64>; 2], SimulateError> {
        let mut columns = [Vec::new(), Vec::new()];
        for (row, o) in seen {
            for (axis, angle_rad) in [o.axis1_rad, o.axis2_rad].into_iter().enumerate() {
                let drive = self.loaded.drives[*row][axis].as_ref();
                // Angles come within one turn from zero; a drive may count from a turn before.
                let turned = [0.0, -TAU, TAU].map(|turn| angle_rad + turn);
                let steps = drive.and_then(|drive| turned.iter().find_map(|&at| drive.steps(at)));
                columns[axis].push(steps.ok_or_else(|| SimulateError::NoSteps {
                    id: self.loaded.field.ids()[*row].clone(),
                    axis: axis + 1,
                    angle_deg: degrees(angle_rad),
                })?);
            }
        }
        Ok(columns)
    }
}
