//! `simulate observations`: synthetic campaigns of camera observations.

use helio_calib::random::Random;
use helio_calib::simulate::{Aiming, ErrorSpread, Jump, SimulateOptions, simulate};
use helio_calib::{Mount, Observation, Parameters};
use helio_core::angle::{degrees, radians};
use helio_core::{MountErrors, TargetPlane};
use helio_io::output::{Cells, write_columns};
use helio_io::{
    CalibratedSet, LoadedField, Provenance, degrees_for, parse_time, write_calibration,
};
use rayon::prelude::*;

use crate::Outcome;
use crate::args::SimulateObservationsArgs;
use crate::failure::Failure;
use crate::plan;
use crate::printer::{Bytes, Counted, Grouped, Printer};

/// Streams of random numbers of the true errors, apart from those of the campaigns.
const TRUTH: u64 = 0x7472_7574_6800_0000;
/// Neighbours whose records may get among those of a heliostat.
const NEIGHBOURS: usize = 8;

pub(crate) fn run(args: &SimulateObservationsArgs, printer: &Printer) -> Result<Outcome, Failure> {
    plan::threads(args.out.threads)?;
    let format = plan::format(args.out.out.as_deref(), args.out.format)?;
    let loaded = plan::field(&args.field, printer)?;
    let truth_format = match &args.truth {
        Some(path) => Some((path, plan::format(Some(path), None)?)),
        None => None,
    };
    plan::not_the_same(
        ("--out", args.out.out.as_deref()),
        ("--truth", args.truth.as_deref()),
    )?;
    let destination = plan::destination(args.out.out.as_deref(), format, &loaded.files, printer)?;
    let truth_destination = match truth_format {
        Some((path, format)) => Some((
            plan::destination(Some(path), format, &loaded.files, printer)?,
            format,
        )),
        None => None,
    };
    let campaign = Campaign::new(args, &loaded)?;
    let rows = rows(args, &loaded)?;
    // The first of several failures is the one to report, whichever thread was first.
    let all: Vec<Result<Option<Vec<Observation>>, Failure>> =
        rows.par_iter().map(|&row| campaign.of(row)).collect();
    let all: Vec<Option<Vec<Observation>>> = all.into_iter().collect::<Result<_, _>>()?;
    let unseen: Vec<&str> = rows
        .iter()
        .zip(&all)
        .filter(|(_, seen)| seen.is_none())
        .map(|(&row, _)| loaded.field.ids()[row].as_str())
        .collect();
    if unseen.len() == rows.len() {
        return Err(Failure::refused(
            "no target with a plane faces any of the heliostats; give one normal_enu, width_m and \
             height_m, or name another by --target",
        ));
    }
    if !unseen.is_empty() {
        printer.warn(format_args!(
            "{} heliostats are faced by none of the targets and have no observations (first {})",
            Grouped(unseen.len() as u64),
            unseen[0]
        ));
    }
    let seen: Vec<(usize, Observation)> = rows
        .iter()
        .zip(all)
        .flat_map(|(&row, seen)| seen.unwrap_or_default().into_iter().map(move |o| (row, o)))
        .collect();
    let bytes = campaign.write(args, &seen, destination, format)?;
    if let Some((destination, format)) = truth_destination {
        campaign.write_truth(&rows, destination, format)?;
    }
    printer.say(format_args!(
        "{} of {}; {}",
        Counted(seen.len(), "observation"),
        Counted(rows.len() - unseen.len(), "heliostat"),
        Bytes(bytes)
    ));
    Ok(Outcome::Good)
}

/// The heliostats to observe.
fn rows(args: &SimulateObservationsArgs, loaded: &LoadedField) -> Result<Vec<usize>, Failure> {
    let n = loaded.field.len();
    if let Some(ids) = &args.ids {
        return ids
            .iter()
            .map(|id| {
                loaded.field.row_of(id).ok_or_else(|| {
                    Failure::refused(format!("--ids: no heliostat `{id}` in the field"))
                })
            })
            .collect();
    }
    let wanted = args.heliostats.map_or(n, |count| (count as usize).min(n));
    Ok((0..wanted).map(|k| k * n / wanted).collect())
}

/// What all heliostats share.
struct Campaign<'a> {
    loaded: &'a LoadedField,
    site: helio_core::sun::SunSite,
    targets: Vec<(&'a str, TargetPlane)>,
    options: SimulateOptions,
    wrong_heliostat_share: f64,
    spread: Option<ErrorSpread>,
}

impl<'a> Campaign<'a> {
    fn new(args: &SimulateObservationsArgs, loaded: &'a LoadedField) -> Result<Self, Failure> {
        let Some(site) = &loaded.site else {
            return Err(Failure::refused(format!(
                "{}: there is no [site], which the sun at the times of observations needs",
                args.field.display()
            )));
        };
        let mut targets = Vec::new();
        for (name, target) in &loaded.targets {
            let wanted = args
                .target
                .as_ref()
                .is_none_or(|names| names.contains(name));
            match target.area {
                Some(area) if wanted => targets.push((name.as_str(), area.plane)),
                None if wanted && args.target.is_some() => {
                    return Err(Failure::refused(format!(
                        "--target {name}: it is a mere point, and a spot is seen on a plane"
                    )));
                }
                _ => {}
            }
        }
        for name in args.target.iter().flatten() {
            if !loaded.targets.contains_key(name) {
                let known: Vec<&str> = loaded.targets.keys().map(String::as_str).collect();
                return Err(Failure::refused(format!(
                    "--target: unknown target `{name}`; known are {}",
                    known.join(", ")
                )));
            }
        }
        let time = |option: &str, text: &str| {
            parse_time(text).map_err(|e| Failure::refused(format!("{option}: {e}")))
        };
        let mut jumps = Vec::new();
        for jump in &args.jump {
            let parts: Vec<&str> = jump.split(',').collect();
            let [at, one, two] = parts[..] else {
                return Err(Failure::refused(format!(
                    "--jump {jump}: wanted TIME,AXIS1_MRAD,AXIS2_MRAD"
                )));
            };
            let mrad = |text: &str| {
                let number = text.trim().parse::<f64>().ok().filter(|v| v.is_finite());
                number.ok_or_else(|| {
                    Failure::refused(format!("--jump {jump}: `{text}` is no finite number"))
                })
            };
            jumps.push(Jump {
                unix_ns: time("--jump", at)?,
                azimuth_reference_rad: 1e-3 * mrad(one)?,
                elevation_reference_rad: 1e-3 * mrad(two)?,
            });
        }
        Ok(Self {
            loaded,
            site: site.sun_site()?,
            targets,
            wrong_heliostat_share: args.wrong_heliostat,
            spread: args.random_errors.then(ErrorSpread::default),
            options: SimulateOptions {
                seed: args.seed,
                count: args.count as usize,
                from_unix_ns: time("--from", &args.from)?,
                to_unix_ns: time("--to", &args.to)?,
                days: args.days.map(|days| days as usize),
                hours: args.hours.0,
                min_sun_elevation_rad: radians(args.min_sun_elevation_deg),
                noise_mrad: args.noise_mrad,
                outlier_share: args.outliers,
                outlier_mrad: args.outlier_mrad,
                jumps,
                wrong_target_share: args.wrong_target,
                aiming: Aiming::Uncalibrated,
                ..SimulateOptions::default()
            },
        })
    }

    fn mount(&self, row: usize) -> Mount {
        let field = &self.loaded.field;
        Mount::of(field.mode(), &field.heliostats()[row])
    }

    fn errors(&self, row: usize) -> MountErrors {
        match &self.spread {
            Some(spread) => spread.draw(&mut Random::stream(self.options.seed ^ TRUTH, row as u64)),
            None => self.loaded.field.heliostats()[row].errors,
        }
    }

    fn parameters(&self, row: usize) -> Parameters {
        let offset_m = self.loaded.field.heliostats()[row].mirror_offset_m;
        Parameters::new(&self.errors(row), offset_m)
    }

    /// The observations of a heliostat, their targets numbered as here; `None` if no target faces it.
    fn of(&self, row: usize) -> Result<Option<Vec<Observation>>, Failure> {
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
        let neighbours = if self.wrong_heliostat_share > 0.0 {
            self.neighbours(row)
        } else {
            Vec::new()
        };
        let options = SimulateOptions {
            seed: Random::stream(self.options.seed, row as u64).next_u64(),
            wrong_heliostat_share: if neighbours.is_empty() {
                0.0
            } else {
                self.wrong_heliostat_share
            },
            wrong_target_share: if planes.len() > 1 {
                self.options.wrong_target_share
            } else {
                0.0
            },
            neighbours,
            ..self.options.clone()
        };
        let seen = simulate(&mount, &self.parameters(row), &planes, &self.site, &options).map_err(
            |e| {
                let id = &self.loaded.field.ids()[row];
                Failure::refused(format!("heliostat {id}: {e}"))
            },
        )?;
        let mut observations = seen.observations;
        for observation in &mut observations {
            observation.target = facing[observation.target];
        }
        Ok(Some(observations))
    }

    fn neighbours(&self, row: usize) -> Vec<(Mount, Parameters)> {
        helio_io::calibrate::neighbours(&self.loaded.field, row, NEIGHBOURS)
            .into_iter()
            .map(|other| (self.mount(other), self.parameters(other)))
            .collect()
    }

    fn write(
        &self,
        args: &SimulateObservationsArgs,
        seen: &[(usize, Observation)],
        destination: helio_io::output::Destination,
        format: helio_io::output::Format,
    ) -> Result<u64, Failure> {
        let number = |of: &dyn Fn(&Observation) -> f64| -> Vec<f64> {
            seen.iter().map(|(_, o)| of(o)).collect()
        };
        let ids: Vec<String> = seen
            .iter()
            .map(|(row, _)| self.loaded.field.ids()[*row].clone())
            .collect();
        let times: Vec<Option<i64>> = seen.iter().map(|(_, o)| o.unix_ns).collect();
        let targets: Vec<String> = seen
            .iter()
            .map(|(_, o)| self.targets[o.target].0.to_owned())
            .collect();
        let axes = if args.steps {
            let mut columns = [Vec::new(), Vec::new()];
            for (row, o) in seen {
                for (axis, angle_rad) in [o.axis1_rad, o.axis2_rad].into_iter().enumerate() {
                    let drive = self.loaded.drives[*row][axis].as_ref();
                    let steps = drive.and_then(|drive| drive.steps(angle_rad));
                    columns[axis].push(steps.ok_or_else(|| {
                        Failure::refused(format!(
                            "--steps: heliostat {} has no drive on axis {} that goes to {:.3} degrees",
                            self.loaded.field.ids()[*row],
                            axis + 1,
                            degrees(angle_rad)
                        ))
                    })?);
                }
            }
            columns
        } else {
            [
                number(&|o| degrees_for(o.axis1_rad)),
                number(&|o| degrees_for(o.axis2_rad)),
            ]
        };
        let names = if args.steps {
            ["axis1_steps", "axis2_steps"]
        } else {
            ["axis1_deg", "axis2_deg"]
        };
        let (u_m, v_m) = (number(&|o| o.u_m), number(&|o| o.v_m));
        let sigma_m = number(&|o| o.sigma_m.unwrap_or(f64::NAN));
        let columns = [
            ("heliostat_id", Cells::Text(&ids)),
            ("time", Cells::Times(&times)),
            (names[0], Cells::Numbers(&axes[0])),
            (names[1], Cells::Numbers(&axes[1])),
            ("target", Cells::Text(&targets)),
            ("u_m", Cells::Numbers(&u_m)),
            ("v_m", Cells::Numbers(&v_m)),
            ("sigma_m", Cells::Numbers(&sigma_m)),
        ];
        Ok(write_columns(destination, format, &columns)?)
    }

    fn write_truth(
        &self,
        rows: &[usize],
        destination: helio_io::output::Destination,
        format: helio_io::output::Format,
    ) -> Result<(), Failure> {
        let sets: Vec<CalibratedSet> = rows
            .iter()
            .map(|&row| {
                let id = &self.loaded.field.ids()[row];
                let heliostat = &self.loaded.field.heliostats()[row];
                CalibratedSet {
                    errors: Some(self.errors(row)),
                    pose_errors_rad: CalibratedSet::stated(heliostat.pose_errors),
                    mirror_offset_m: Some(heliostat.mirror_offset_m),
                    ..CalibratedSet::without_result(id, "truth", "")
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
