//! `track`: axis angles of every heliostat for each sun.

use std::borrow::Cow;
use std::path::Path;
use std::sync::atomic::{AtomicBool, Ordering};

use helio_calib::joint::Leftover;
use helio_calib::{Mount, Parameters};
use helio_core::drive::Drive;
use helio_core::{
    AxisLimits, EnuUnit, Field, Present, Status, TargetPlane, TrackOptions, Tracker, Tracking,
};
use helio_io::output::{Layout, Number, Rows, Scale};
use helio_io::{CalibrationSchedule, LoadedField, PresentAngles, load_leftovers, load_present};
use rayon::prelude::*;

use crate::Outcome;
use crate::args::{NO_SHADING, TrackArgs};
use crate::failure::Failure;
use crate::plan::{self, SunBlock, Suns};
use crate::plot::Plot;
use crate::printer::{Bytes, Grouped, Printer, Tally};
use helio_calib::aiming::hour_angle_rad;

/// Rows from which a simple pass is worth a second thread.
const ROWS_PER_TASK: usize = 1 << 15;

pub(crate) fn run(args: &TrackArgs, printer: &Printer) -> Result<Outcome, Failure> {
    let threads = plan::threads(args.out.threads)?;
    let format = plan::format(args.out.out.as_deref(), args.out.format)?;
    let loaded = plan::field(&args.field, printer)?;
    let suns = Suns::of_track(args, &loaded, printer)?;
    let options = TrackOptions {
        threads,
        ..TrackOptions::default()
    };
    plan::not_the_same(
        ("--out", args.out.out.as_deref()),
        ("--plot", args.plot.as_deref()),
    )?;
    let mut run = Run::new(args, &loaded, options)?;
    plan::warn_of_lapse(&loaded, suns.times_ns(), printer);
    let mut inputs = loaded.files.clone();
    inputs.extend(args.present.clone());
    inputs.extend(args.suns.clone());
    inputs.extend(args.leftovers.clone());
    let leftovers = match &args.leftovers {
        Some(path) => Some(Leftovers::load(path, &loaded, printer)?),
        None => None,
    };
    let mut plot = match &args.plot {
        Some(path) => {
            let ids = args.plot_heliostats.as_deref();
            let colour = args.plot_colour;
            Some(Plot::new(
                path,
                colour,
                ids,
                &loaded.field,
                suns.len(),
                &inputs,
            )?)
        }
        None => None,
    };
    let layout = layout(&loaded, suns.moment(), leftovers.is_some(), args.verify);
    let per_block = layout.suns_per_block(format);
    let mut writer = plan::writer(&args.out, format, layout, &inputs, printer)?;

    let stop = stop_on_signals();
    let mut tally = Tally::default();
    let mut verified = Verified::default();
    let mut progress = printer.progress(suns.len() as u64);
    for first in (0..suns.len()).step_by(per_block) {
        let block = suns.block(first, per_block)?;
        if suns.len() == 1 {
            printer.say(format_args!("sun at {}", block.describe(0)));
        }
        run.track(&block)?;
        let mut answers = run.answers();
        let corrected = leftovers.as_ref().map(|l| l.correct(&answers));
        if let Some([axis1_rad, axis2_rad, ..]) = &corrected {
            answers = Answers {
                axis1_rad,
                axis2_rad,
                ..answers
            };
        }
        // What the drives and the way back say of rows that the angles alone would call good.
        let mut status = Cow::Borrowed(answers.status);
        let mut steps = None;
        if loaded.has_drives() {
            let [one, two] = [0, 1].map(|axis| {
                let angles = [answers.axis1_rad, answers.axis2_rad][axis];
                by_row(&loaded, angles, |drives, angle| drives[axis]?.steps(angle))
            });
            beyond_drives(&loaded, [&one, &two], &mut status);
            steps = Some([one, two]);
        }
        let mut errors = None;
        if args.verify {
            let turns = corrected.as_ref().map(|[_, _, turns @ .., _, _]| turns);
            errors =
                Some(verified.verify(&run, &loaded, &block, (&answers, turns), status.to_mut())?);
        }
        let mut excess_rad = Cow::Borrowed(answers.limit_excess_rad);
        if let Cow::Owned(status) = &status {
            // By how much such a row is outside is not known: its angles are inside.
            for (row, (&now, &before)) in status.iter().zip(answers.status).enumerate() {
                if now != before {
                    excess_rad.to_mut()[row] = f64::NAN;
                }
            }
        }
        let answers = Answers {
            status: &status,
            ..answers
        };
        let mut columns: Vec<&[f64]> = vec![
            answers.axis1_rad,
            answers.axis2_rad,
            answers.incidence_rad,
            &*excess_rad,
        ];
        columns.extend(steps.iter().flatten().map(Vec::as_slice));
        columns.extend(corrected.iter().flat_map(|c| &c[2..]).map(Vec::as_slice));
        columns.extend(errors.as_deref());
        tally.add(answers.status);
        if let Some(plot) = &mut plot {
            plot.take(&block, &answers);
        }
        writer.write(&Rows {
            moments: block.moments(),
            ends: None,
            heliostats: None,
            numbers: &columns,
            status: answers.status,
        })?;
        if stop.load(Ordering::Relaxed) {
            return Err(plan::interrupted(&args.out));
        }
        progress.advance(block.suns.len() as u64);
    }
    // Everything that can fail comes before the first result takes its place.
    let drawn = match plot {
        Some(plot) => Some(plot.draw(&loaded, &suns, &tally)?),
        None => None,
    };
    let written = writer.finish()?;
    if let Some(drawn) = drawn {
        drawn.finish()?;
    }
    let took_s = progress.finish().as_secs_f64();
    printer.say(format_args!(
        "{} rows: {tally}; {} in {took_s:.2} s",
        Grouped(written.rows),
        Bytes(written.bytes)
    ));
    if args.verify {
        verified.report(&loaded, printer);
    }
    printer.say(format_args!("{NO_SHADING}"));
    Ok(if tally.failed() > 0 {
        Outcome::SomeRowsFailed
    } else {
        Outcome::Good
    })
}

fn layout(
    loaded: &LoadedField,
    moment: helio_io::output::Moment,
    leftovers: bool,
    verify: bool,
) -> Layout {
    let mut numbers = vec![
        Number::degrees("azimuth_deg"),
        Number::degrees("elevation_deg"),
        Number::degrees("incidence_deg"),
        // The one number of a row without an answer: by how much it has none.
        Number::degrees("limit_excess_deg").also(Status::OutsideLimits),
    ];
    if loaded.has_drives() {
        numbers.push(Number::new("axis1_steps", Scale::Whole));
        numbers.push(Number::new("axis2_steps", Scale::Whole));
    }
    if leftovers {
        numbers.extend(
            [
                "leftover_axis1_mrad",
                "leftover_axis2_mrad",
                "sigma_axis1_mrad",
                "sigma_axis2_mrad",
            ]
            .map(|name| Number::new(name, Scale::Milliradians)),
        );
    }
    if verify {
        numbers.push(Number::new("beam_error_mrad", Scale::Milliradians));
    }
    Layout {
        ids: loaded.field.ids().to_vec(),
        moment,
        numbers,
    }
}

/// Set when the user or the system wants an end: unfinished files are then removed as after any
/// failure, which a plain death by signal would not do.
pub(crate) fn stop_on_signals() -> &'static AtomicBool {
    static STOP: AtomicBool = AtomicBool::new(false);
    // Without a handler the default stands: an end at once.
    let _ = ctrlc::set_handler(|| {
        if STOP.swap(true, Ordering::Relaxed) {
            // Asked twice: somebody does not want to wait for the block to end.
            helio_io::remove_unfinished_files();
            std::process::exit(130);
        }
    });
    &STOP
}

/// The answers of a block, as columns of all its rows.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Answers<'a> {
    pub(crate) axis1_rad: &'a [f64],
    pub(crate) axis2_rad: &'a [f64],
    pub(crate) incidence_rad: &'a [f64],
    pub(crate) limit_excess_rad: &'a [f64],
    pub(crate) status: &'a [Status],
}

impl<'a> From<&'a Tracking> for Answers<'a> {
    fn from(tracking: &'a Tracking) -> Self {
        Self {
            axis1_rad: tracking.axis1_rad(),
            axis2_rad: tracking.axis2_rad(),
            incidence_rad: tracking.incidence_rad(),
            limit_excess_rad: tracking.limit_excess_rad(),
            status: tracking.status(),
        }
    }
}

/// What is left by pose, heliostat by heliostat.
struct Leftovers {
    of: Vec<Option<Known>>,
}

/// A heliostat whose leftovers are known.
struct Known {
    leftover: Leftover,
    mount: Mount,
    parameters: Parameters,
    limits: AxisLimits,
}

/// Angles that differ by more than this are not those that leftovers were written for \[rad\].
const SAME_RAD: f64 = 1e-9;

impl Leftovers {
    fn load(path: &Path, loaded: &LoadedField, printer: &Printer) -> Result<Self, Failure> {
        if loaded.schedule.is_some() {
            return Err(Failure::refused(format!(
                "--leftovers: {} belongs to one calibration, and that of the field changes with the hour or the date",
                path.display()
            )));
        }
        let field = &loaded.field;
        let mut others = 0;
        let mut first = None;
        let mut of = Vec::with_capacity(field.len());
        for (row, leftover) in load_leftovers(path, field)?.into_iter().enumerate() {
            let heliostat = &field.heliostats()[row];
            let parameters = Parameters::new(&heliostat.errors, heliostat.mirror_offset_m);
            let known = leftover.map(|leftover| {
                let wanted = leftover.parts().angles_rad;
                let mut pairs = wanted.iter().zip(&parameters.values);
                if pairs.any(|(a, b)| (a - b).abs() > SAME_RAD) {
                    others += 1;
                    first.get_or_insert(row);
                }
                Known {
                    leftover,
                    mount: Mount::of(field.mode(), heliostat),
                    parameters,
                    limits: heliostat.limits,
                }
            });
            of.push(known);
        }
        if let Some(first) = first {
            printer.warn(format_args!(
                "{}: {} now of another calibration than these leftovers were written for (first `{}`); write them \
                 anew with calibrate --joint",
                path.display(),
                match others {
                    1 => "1 heliostat is".to_owned(),
                    others => format!("{} heliostats are", Grouped(others)),
                },
                field.ids()[first]
            ));
        }
        Ok(Self { of })
    }

    /// Angles of both axes, the corrections that are in them, and one standard deviation of what is still wrong, of
    /// every row \[rad\]. Limits are kept: a correction ends at them.
    fn correct(&self, answers: &Answers<'_>) -> [Vec<f64>; 6] {
        let rows: Vec<[f64; 6]> = (0..answers.status.len())
            .into_par_iter()
            .map(|row| {
                let [one, two] = [answers.axis1_rad[row], answers.axis2_rad[row]];
                match &self.of[row % self.of.len()] {
                    Some(known) if answers.status[row] == Status::Ok => known.correct(one, two),
                    _ => [one, two, f64::NAN, f64::NAN, f64::NAN, f64::NAN],
                }
            })
            .collect();
        std::array::from_fn(|k| rows.iter().map(|row| row[k]).collect())
    }
}

impl Known {
    fn correct(&self, axis1_rad: f64, axis2_rad: f64) -> [f64; 6] {
        let turn = self.leftover.turn_rad(axis1_rad, axis2_rad);
        let limits = &self.limits;
        let corrected = [
            (axis1_rad + turn[0])
                .max(limits.axis1_min_rad)
                .min(limits.axis1_max_rad),
            (axis2_rad + turn[1])
                .max(limits.axis2_min_rad)
                .min(limits.axis2_max_rad),
        ];
        let sigma = self
            .leftover
            .sigma_rad(&self.mount, &self.parameters, axis1_rad, axis2_rad);
        [
            corrected[0],
            corrected[1],
            corrected[0] - axis1_rad,
            corrected[1] - axis2_rad,
            sigma[0],
            sigma[1],
        ]
    }
}

/// Everything that tracking one block after another needs.
struct Run<'a> {
    tracker: Tracker,
    options: TrackOptions,
    tracking: Tracking,
    /// Where the axes stand, for the shortest travel.
    present: Option<PresentAngles>,
    /// For a calibration that changes with the hour.
    changing: Option<Changing<'a>>,
}

/// A field that is brought up to date for each sun.
struct Changing<'a> {
    schedule: &'a CalibrationSchedule,
    field: Field,
    latitude_rad: f64,
    all: Collected,
}

#[derive(Default)]
struct Collected {
    axis1_rad: Vec<f64>,
    axis2_rad: Vec<f64>,
    incidence_rad: Vec<f64>,
    limit_excess_rad: Vec<f64>,
    status: Vec<Status>,
}

impl Collected {
    fn clear(&mut self) {
        *self = Self::default();
    }

    fn extend(&mut self, answers: Answers<'_>) {
        self.axis1_rad.extend_from_slice(answers.axis1_rad);
        self.axis2_rad.extend_from_slice(answers.axis2_rad);
        self.incidence_rad.extend_from_slice(answers.incidence_rad);
        self.limit_excess_rad
            .extend_from_slice(answers.limit_excess_rad);
        self.status.extend_from_slice(answers.status);
    }
}

impl<'a> Run<'a> {
    fn new(
        args: &TrackArgs,
        loaded: &'a LoadedField,
        options: TrackOptions,
    ) -> Result<Self, Failure> {
        let present = match (&args.present, args.continuous) {
            (Some(path), _) => Some(load_present(path, &loaded.field)?),
            (None, true) => {
                let unknown = vec![f64::NAN; loaded.field.len()];
                Some(PresentAngles {
                    axis1_rad: unknown.clone(),
                    axis2_rad: unknown,
                })
            }
            (None, false) => None,
        };
        let changing = match &loaded.schedule {
            Some(schedule) => Some(Changing {
                schedule,
                field: loaded.field.clone(),
                latitude_rad: latitude_rad(loaded)?,
                all: Collected::default(),
            }),
            None => None,
        };
        Ok(Self {
            tracker: Tracker::new(&loaded.field, args.offset)?,
            options,
            tracking: Tracking::default(),
            present,
            changing,
        })
    }

    fn track(&mut self, block: &SunBlock) -> Result<(), Failure> {
        if self.changing.is_none() {
            return self.track_suns(&block.suns);
        }
        if let Some(changing) = &mut self.changing {
            changing.all.clear();
        }
        for (sun, &toward) in block.suns.iter().enumerate() {
            self.bring_up_to_date(block.unix_ns.get(sun).copied(), toward)?;
            self.track_suns(&[toward])?;
            if let Some(changing) = &mut self.changing {
                changing.all.extend(Answers::from(&self.tracking));
            }
        }
        Ok(())
    }

    fn bring_up_to_date(&mut self, unix_ns: Option<i64>, toward: EnuUnit) -> Result<(), Failure> {
        if let Some(changing) = &mut self.changing {
            let hour_rad = hour_angle_rad(toward, changing.latitude_rad);
            if changing
                .schedule
                .update(&mut changing.field, unix_ns, hour_rad)?
            {
                self.tracker = Tracker::new(&changing.field, self.tracker.offset())?;
            }
        }
        Ok(())
    }

    fn track_suns(&mut self, suns: &[EnuUnit]) -> Result<(), Failure> {
        let present = self.present.as_ref().map(|present| Present {
            axis1_rad: &present.axis1_rad,
            axis2_rad: &present.axis2_rad,
        });
        self.tracker
            .track_into(suns, present, &self.options, &mut self.tracking)?;
        if let Some(present) = &mut self.present {
            move_on(present, &self.tracking);
        }
        Ok(())
    }

    fn answers(&self) -> Answers<'_> {
        match &self.changing {
            Some(Changing { all, .. }) => Answers {
                axis1_rad: &all.axis1_rad,
                axis2_rad: &all.axis2_rad,
                incidence_rad: &all.incidence_rad,
                limit_excess_rad: &all.limit_excess_rad,
                status: &all.status,
            },
            None => Answers::from(&self.tracking),
        }
    }
}

/// Each heliostat now stands where its last answer put it.
fn move_on(present: &mut PresentAngles, tracking: &Tracking) {
    for sun in 0..tracking.suns() {
        let rows = tracking.rows_of_sun(sun);
        for (heliostat, row) in rows.enumerate() {
            if tracking.status()[row] == Status::Ok {
                present.axis1_rad[heliostat] = tracking.axis1_rad()[row];
                present.axis2_rad[heliostat] = tracking.axis2_rad()[row];
            }
        }
    }
}

pub(crate) fn latitude_rad(loaded: &LoadedField) -> Result<f64, Failure> {
    match &loaded.site {
        Some(site) => Ok(site.latitude_rad),
        None => Err(Failure::refused(
            "the calibration changes with the hour angle of the sun, which needs the latitude from \
             [site]",
        )),
    }
}

/// A number for each row from its heliostat's drives and its angle; NaN where there is none.
fn by_row(
    loaded: &LoadedField,
    angles: &[f64],
    number: impl Fn(&[Option<Drive>; 2], f64) -> Option<f64> + Sync,
) -> Vec<f64> {
    let n = loaded.drives.len().max(1);
    angles
        .par_iter()
        .enumerate()
        .with_min_len(ROWS_PER_TASK)
        .map(|(row, &angle)| {
            if angle.is_nan() {
                return f64::NAN;
            }
            number(&loaded.drives[row % n], angle).unwrap_or(f64::NAN)
        })
        .collect()
}

/// Marks the rows whose angles no steps of their drive lead to.
fn beyond_drives(loaded: &LoadedField, steps: [&[f64]; 2], status: &mut Cow<'_, [Status]>) {
    let n = loaded.drives.len().max(1);
    for row in 0..status.len() {
        if steps[0][row].is_nan() || steps[1][row].is_nan() {
            let drives = &loaded.drives[row % n];
            let lacks = |axis: usize| drives[axis].is_some() && steps[axis][row].is_nan();
            if status[row] == Status::Ok && (lacks(0) || lacks(1)) {
                status.to_mut()[row] = Status::OutsideLimits;
            }
        }
    }
}

/// What became of the beams that were followed back.
#[derive(Debug, Default)]
struct Verified {
    beams: u64,
    sum_of_squares: f64,
    greatest_rad: f64,
    misses: u64,
    planes: Vec<TargetPlane>,
}

impl Verified {
    /// Angle of each row's beam off its aim \[rad\], after the angles went through whole steps; a row
    /// whose beam misses its target has that status then.
    fn verify(
        &mut self,
        run: &Run<'_>,
        loaded: &LoadedField,
        block: &SunBlock,
        (answers, turns): (&Answers<'_>, Option<&[Vec<f64>; 2]>),
        status: &mut [Status],
    ) -> Result<Vec<f64>, Failure> {
        let n = loaded.field.len();
        if self.planes.is_empty() {
            let planes: Result<_, _> = (0..n).map(|row| loaded.plane_for(row)).collect();
            self.planes = planes?;
        }
        let [mut axis1_rad, mut axis2_rad] = [0, 1].map(|axis| {
            let angles = [answers.axis1_rad, answers.axis2_rad][axis];
            by_row(loaded, angles, |drives, angle| match &drives[axis] {
                Some(drive) => drive.quantised_rad(angle),
                None => Some(angle),
            })
        });
        if let Some(turns) = turns {
            // followed back through the angles alone, a correction would look like an error
            for (angles, turns) in [&mut axis1_rad, &mut axis2_rad].into_iter().zip(turns) {
                for (angle, turn) in angles.iter_mut().zip(turns) {
                    *angle -= if turn.is_nan() { 0.0 } else { *turn };
                }
            }
        }
        let mut errors = Vec::with_capacity(answers.status.len());
        let mut prediction = helio_core::tracking::Prediction::default();
        // A calibration that changes has left the tracker at the last sun of the block.
        let mut changing = run.changing.as_ref().map(|c| (c, c.field.clone()));
        let mut tracker = Cow::Borrowed(&run.tracker);
        for (sun, &toward) in block.suns.iter().enumerate() {
            if let Some((changing, field)) = &mut changing {
                let hour_rad = hour_angle_rad(toward, changing.latitude_rad);
                let unix_ns = block.unix_ns.get(sun).copied();
                if changing.schedule.update(field, unix_ns, hour_rad)? {
                    tracker = Cow::Owned(Tracker::new(field, run.tracker.offset())?);
                }
            }
            let rows = sun * n..(sun + 1) * n;
            tracker.predict_into(
                toward,
                &axis1_rad[rows.clone()],
                &axis2_rad[rows.clone()],
                &self.planes,
                &run.options,
                &mut prediction,
            )?;
            for (heliostat, row) in rows.enumerate() {
                let mut error_rad = f64::NAN;
                if status[row] == Status::Ok {
                    if axis1_rad[row].is_nan() || axis2_rad[row].is_nan() {
                        // The whole step nearest to an end of the drive lies beyond it.
                        status[row] = Status::OutsideLimits;
                    } else if prediction.status[heliostat] == Status::Ok {
                        error_rad = prediction.beam_error_rad[heliostat];
                        self.beams += 1;
                        self.sum_of_squares += error_rad * error_rad;
                        self.greatest_rad = self.greatest_rad.max(error_rad);
                    } else {
                        status[row] = Status::MissesTarget;
                        self.misses += 1;
                    }
                }
                errors.push(error_rad);
            }
        }
        Ok(errors)
    }

    fn report(&self, loaded: &LoadedField, printer: &Printer) {
        let through = if loaded.has_drives() {
            "through whole motor steps"
        } else {
            "of the angles themselves (the field has no drive)"
        };
        if self.beams > 0 {
            let rms_mrad = (self.sum_of_squares / self.beams as f64).sqrt() * 1000.0;
            let greatest_mrad = self.greatest_rad * 1000.0;
            printer.say(format_args!(
                "verified {} beams {through}: rms {rms_mrad:.3e} mrad off the aim, greatest \
                 {greatest_mrad:.3e} mrad",
                Grouped(self.beams)
            ));
        } else {
            printer.say(format_args!(
                "verified no beam {through}: none is reflected"
            ));
        }
        if self.misses > 0 {
            printer.warn(format_args!(
                "{} beams miss the plane of their target",
                Grouped(self.misses)
            ));
        }
    }
}
