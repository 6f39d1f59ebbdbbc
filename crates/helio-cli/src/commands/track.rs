//! `track`: axis angles of every heliostat for each sun.

use std::borrow::Cow;
use std::path::Path;
use std::sync::atomic::{AtomicBool, Ordering};

use helio_core::{EnuUnit, Field, Present, Status, TrackOptions, Tracker, Tracking};
use helio_io::output::{Layout, Rows};
use helio_io::{
    BeamsBack, CalibrationSchedule, Corrections, CorrectionsError, LoadedField, PresentAngles,
    beyond_drives, by_row, load_present, tracked_numbers,
};

use crate::Outcome;
use crate::args::{NO_SHADING, TrackArgs};
use crate::failure::Failure;
use crate::plan::{self, SunBlock, Suns};
use crate::plot::Plot;
use crate::printer::{Bytes, Grouped, Printer, Tally};
use helio_calib::aiming::hour_angle_rad;

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
        Some(path) => Some(corrections(path, &loaded, printer)?),
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
    let layout = Layout {
        ids: loaded.field.ids().to_vec(),
        moment: suns.moment(),
        numbers: tracked_numbers(loaded.has_drives(), leftovers.is_some(), args.verify),
    };
    let per_block = layout.suns_per_block(format);
    let mut writer = plan::writer(&args.out, format, layout, &inputs, printer)?;

    let stop = stop_on_signals();
    let mut tally = Tally::default();
    let mut verified = Verified::default();
    let mut back = match args.verify {
        true => {
            let planes = (0..loaded.field.len()).map(|row| loaded.plane_for(row));
            let planes = planes.collect::<Result<_, _>>()?;
            Some(BeamsBack::new(&loaded.drives, planes, options))
        }
        false => None,
    };
    let mut progress = printer.progress(suns.len() as u64);
    for first in (0..suns.len()).step_by(per_block) {
        let block = suns.block(first, per_block)?;
        if suns.len() == 1 {
            printer.say(format_args!("sun at {}", block.describe(0)));
        }
        run.track(&block)?;
        let mut answers = run.answers();
        let corrected = leftovers
            .as_ref()
            .map(|l| l.correct(answers.axis1_rad, answers.axis2_rad, answers.status));
        if let Some(corrected) = &corrected {
            let [axis1_rad, axis2_rad] = &corrected.axes_rad;
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
                by_row(&loaded.drives, angles, |drives, angle| {
                    drives[axis]?.steps(angle)
                })
            });
            beyond_drives(&loaded.drives, [&one, &two], &mut status);
            steps = Some([one, two]);
        }
        let mut errors = None;
        if let Some(back) = &mut back {
            let turns = corrected.as_ref().map(|corrected| &corrected.turns_rad);
            errors =
                Some(verified.verify(&run, back, &block, (&answers, turns), status.to_mut())?);
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
        let of_leftovers = corrected.iter().flat_map(|c| [&c.turns_rad, &c.sigmas_rad]);
        columns.extend(of_leftovers.flatten().map(Vec::as_slice));
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

fn corrections(
    path: &Path,
    loaded: &LoadedField,
    printer: &Printer,
) -> Result<Corrections, Failure> {
    let found = Corrections::load(path, &loaded.field, loaded.schedule.as_ref());
    let found = found.map_err(|error| match error {
        CorrectionsError::Table(error) => error.into(),
        changing => Failure::refused(format!("--leftovers: {changing}")),
    })?;
    if let Some(others) = found.of_another_calibration() {
        printer.warn(format_args!(
            "{others}; write them anew with calibrate --joint"
        ));
    }
    Ok(found)
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

/// What became of the beams that were followed back.
#[derive(Debug, Default)]
struct Verified {
    beams: u64,
    sum_of_squares: f64,
    greatest_rad: f64,
    misses: u64,
}

impl Verified {
    /// Angle of each row's beam off its aim \[rad\], after the angles went through whole steps; a row
    /// whose beam misses its target has that status then.
    fn verify(
        &mut self,
        run: &Run<'_>,
        back: &mut BeamsBack<'_>,
        block: &SunBlock,
        (answers, turns): (&Answers<'_>, Option<&[Vec<f64>; 2]>),
        status: &mut [Status],
    ) -> Result<Vec<f64>, Failure> {
        let turns = turns.map(|turns| turns.each_ref().map(Vec::as_slice));
        let [axis1_rad, axis2_rad] = back.angles_rad([answers.axis1_rad, answers.axis2_rad], turns);
        let n = run.tracker.len();
        let mut errors = Vec::with_capacity(status.len());
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
            let angles = [&axis1_rad[rows.clone()], &axis2_rad[rows.clone()]];
            let status = &mut status[rows.clone()];
            let missed = |status: &[Status]| {
                let misses = status.iter().filter(|&&s| s == Status::MissesTarget);
                misses.count() as u64
            };
            let before = missed(status);
            back.sun(&tracker, toward, angles, status, &mut errors)?;
            self.misses += missed(status) - before;
            for error_rad in errors[rows].iter().filter(|error| !error.is_nan()) {
                self.beams += 1;
                self.sum_of_squares += error_rad * error_rad;
                self.greatest_rad = self.greatest_rad.max(*error_rad);
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
