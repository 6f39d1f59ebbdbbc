//! `predict`: where each beam lands, from axis angles.

use std::sync::atomic::Ordering;

use helio_core::tracking::Prediction;
use helio_core::{EnuUnit, OffsetForm, Status, TargetPlane, TrackOptions, Tracker};
use helio_io::output::{Layout, Moment, Moments, Number, Rows, Scale};
use helio_io::{Angles, AnglesSun, LoadedField, load_angles};

use super::track::{latitude_rad, stop_on_signals};
use crate::Outcome;
use crate::args::{NO_SHADING, PredictArgs};
use crate::failure::Failure;
use helio_calib::aiming::hour_angle_rad;

use crate::plan::{self, SunClock, Suns, degrees_as_written, toward};
use crate::printer::{Bytes, Grouped, Printer, Tally};

pub(crate) fn run(args: &PredictArgs, printer: &Printer) -> Result<Outcome, Failure> {
    let threads = plan::threads(args.out.threads)?;
    let format = plan::format(args.out.out.as_deref(), args.out.format)?;
    let loaded = plan::field(&args.field, printer)?;
    let angles = load_angles(&args.angles, &loaded)?;
    let suns = row_suns(args, &angles, &loaded, printer)?;
    let (from, to) = (suns.unix_ns.iter().min(), suns.unix_ns.iter().max());
    plan::warn_of_lapse(&loaded, from.copied().zip(to.copied()), printer);
    let layout = Layout {
        ids: loaded.field.ids().to_vec(),
        moment: suns.moment,
        numbers: ["u_m", "v_m", "east_m", "north_m", "up_m"]
            .map(|name| Number::new(name, Scale::Plain))
            .into_iter()
            .chain([Number::new("beam_error_mrad", Scale::Milliradians)])
            .collect(),
    };
    let mut inputs = loaded.files.clone();
    inputs.push(args.angles.clone());
    let mut writer = plan::writer(&args.out, format, layout, &inputs, printer)?;
    let options = TrackOptions {
        threads,
        ..TrackOptions::default()
    };

    let mut predictor = Predictor::new(&loaded, options)?;
    let mut block = Block::default();
    let mut tally = Tally::default();
    let stop = stop_on_signals();
    let rows = angles.heliostat.len();
    let mut progress = printer.progress(rows as u64);
    let mut start = 0;
    while start < rows {
        let end = group_end(&angles, &suns, start, &mut predictor.seen);
        predictor.predict(&angles, start..end, &suns, &mut block)?;
        progress.advance((end - start) as u64);
        start = end;
        if block.status.len() >= format.rows_per_block() || start == rows {
            tally.add(&block.status);
            block.write(&suns, &mut writer)?;
        }
        if stop.load(Ordering::Relaxed) {
            return Err(plan::interrupted(&args.out));
        }
    }
    let written = writer.finish()?;
    let took_s = progress.finish().as_secs_f64();
    printer.say(format_args!(
        "{} rows: {tally}; {} in {took_s:.2} s",
        Grouped(written.rows),
        Bytes(written.bytes)
    ));
    if angles.skipped > 0 {
        let skipped = Grouped(angles.skipped as u64);
        printer.note(format_args!(
            "{skipped} rows without angles were left aside"
        ));
    }
    printer.say(format_args!("{NO_SHADING}"));
    Ok(if tally.failed() > 0 {
        Outcome::SomeRowsFailed
    } else {
        Outcome::Good
    })
}

/// The sun of each row of a table of angles.
struct RowSuns {
    moment: Moment,
    unix_ns: Vec<i64>,
    azimuth_deg: Vec<f64>,
    elevation_deg: Vec<f64>,
    suns: Vec<EnuUnit>,
}

impl RowSuns {
    fn same(&self, a: usize, b: usize) -> bool {
        match self.moment {
            Moment::Time => self.unix_ns[a] == self.unix_ns[b],
            Moment::SunAngles => {
                self.azimuth_deg[a] == self.azimuth_deg[b]
                    && self.elevation_deg[a] == self.elevation_deg[b]
            }
        }
    }
}

fn row_suns(
    args: &PredictArgs,
    angles: &Angles,
    loaded: &LoadedField,
    printer: &Printer,
) -> Result<RowSuns, Failure> {
    let typed = args.sun.time.is_some() || args.sun.sun_azimuth_deg.is_some();
    let rows = angles.heliostat.len();
    if typed && !matches!(angles.sun, AnglesSun::Unstated) {
        printer.note(format_args!(
            "the sun of the command line wins over that of the table"
        ));
    }
    match &angles.sun {
        AnglesSun::Times { unix_ns } if !typed => {
            let (azimuth_rad, elevation_rad) = SunClock::needed(loaded)?.suns(unix_ns)?;
            Ok(RowSuns {
                moment: Moment::Time,
                unix_ns: unix_ns.clone(),
                azimuth_deg: Vec::new(),
                elevation_deg: Vec::new(),
                suns: toward(&azimuth_rad, &elevation_rad),
            })
        }
        AnglesSun::Angles(given) if !typed => {
            let in_degrees =
                |rad: &[f64]| -> Vec<f64> { rad.iter().map(|&r| degrees_as_written(r)).collect() };
            Ok(RowSuns {
                moment: Moment::SunAngles,
                unix_ns: Vec::new(),
                azimuth_deg: in_degrees(&given.azimuth_rad),
                elevation_deg: in_degrees(&given.elevation_rad),
                suns: toward(&given.azimuth_rad, &given.elevation_rad),
            })
        }
        _ => {
            let block = Suns::one(&args.sun, loaded, printer)?.block(0, 1)?;
            printer.say(format_args!("sun at {}", block.describe(0)));
            let timed = !block.unix_ns.is_empty();
            let repeated = |column: &[f64]| column.repeat(if timed { 0 } else { rows });
            Ok(RowSuns {
                moment: if timed {
                    Moment::Time
                } else {
                    Moment::SunAngles
                },
                unix_ns: block.unix_ns.repeat(rows),
                azimuth_deg: repeated(&block.azimuth_deg),
                elevation_deg: repeated(&block.elevation_deg),
                suns: block.suns.repeat(rows),
            })
        }
    }
}

/// The end of the rows from `start` on that have the same sun and name each heliostat once.
fn group_end(angles: &Angles, suns: &RowSuns, start: usize, seen: &mut [usize]) -> usize {
    let mut end = start;
    while end < angles.heliostat.len() && suns.same(start, end) {
        // A mark that is this group's own start needs no clearing between groups.
        let mark = &mut seen[angles.heliostat[end]];
        if *mark == start {
            break;
        }
        *mark = start;
        end += 1;
    }
    end
}

struct Predictor<'a> {
    loaded: &'a LoadedField,
    tracker: Tracker,
    changing: Option<(helio_core::Field, f64)>,
    options: TrackOptions,
    planes: Vec<TargetPlane>,
    seen: Vec<usize>,
    axis1_rad: Vec<f64>,
    axis2_rad: Vec<f64>,
    prediction: Prediction,
}

impl<'a> Predictor<'a> {
    fn new(loaded: &'a LoadedField, options: TrackOptions) -> Result<Self, Failure> {
        let n = loaded.field.len();
        let planes: Result<_, _> = (0..n).map(|row| loaded.plane_for(row)).collect();
        let changing = match &loaded.schedule {
            Some(_) => Some((loaded.field.clone(), latitude_rad(loaded)?)),
            None => None,
        };
        Ok(Self {
            loaded,
            // Forward needs no offset form: the mirror's centre lies where it lies.
            tracker: Tracker::new(&loaded.field, OffsetForm::Exact)?,
            changing,
            options,
            planes: planes?,
            seen: vec![usize::MAX; n],
            axis1_rad: vec![f64::NAN; n],
            axis2_rad: vec![f64::NAN; n],
            prediction: Prediction::default(),
        })
    }

    fn predict(
        &mut self,
        angles: &Angles,
        rows: std::ops::Range<usize>,
        suns: &RowSuns,
        block: &mut Block,
    ) -> Result<(), Failure> {
        let first = rows.start;
        let sun = suns.suns[first];
        if let (Some(schedule), Some((field, latitude_rad))) =
            (&self.loaded.schedule, &mut self.changing)
        {
            let hour_rad = hour_angle_rad(sun, *latitude_rad);
            if schedule.update(field, suns.unix_ns.get(first).copied(), hour_rad)? {
                self.tracker = Tracker::new(field, OffsetForm::Exact)?;
            }
        }
        self.axis1_rad.fill(f64::NAN);
        self.axis2_rad.fill(f64::NAN);
        for row in rows.clone() {
            self.axis1_rad[angles.heliostat[row]] = angles.axis1_rad[row];
            self.axis2_rad[angles.heliostat[row]] = angles.axis2_rad[row];
        }
        let p = &mut self.prediction;
        let (axis1, axis2) = (&self.axis1_rad, &self.axis2_rad);
        self.tracker
            .predict_into(sun, axis1, axis2, &self.planes, &self.options, p)?;
        let columns = [
            &p.u_m,
            &p.v_m,
            &p.east_m,
            &p.north_m,
            &p.up_m,
            &p.beam_error_rad,
        ];
        for row in rows {
            let heliostat = angles.heliostat[row];
            for (numbers, column) in block.numbers.iter_mut().zip(columns) {
                numbers.push(column[heliostat]);
            }
            block.status.push(p.status[heliostat]);
            block.heliostats.push(heliostat as u32);
        }
        block.firsts.push(first);
        block.ends.push(block.status.len());
        Ok(())
    }
}

/// Rows waiting to be written.
#[derive(Default)]
struct Block {
    /// A row of the table of angles for each group, which tells its sun.
    firsts: Vec<usize>,
    ends: Vec<usize>,
    heliostats: Vec<u32>,
    numbers: [Vec<f64>; 6],
    status: Vec<Status>,
}

impl Block {
    fn write(
        &mut self,
        suns: &RowSuns,
        writer: &mut helio_io::output::TableWriter,
    ) -> Result<(), Failure> {
        fn of<T: Copy>(firsts: &[usize], column: &[T]) -> Vec<T> {
            firsts
                .iter()
                .filter_map(|&row| column.get(row).copied())
                .collect()
        }
        let unix_ns = of(&self.firsts, &suns.unix_ns);
        let azimuth_deg = of(&self.firsts, &suns.azimuth_deg);
        let elevation_deg = of(&self.firsts, &suns.elevation_deg);
        let moments = match suns.moment {
            Moment::Time => Moments::Times { unix_ns: &unix_ns },
            Moment::SunAngles => Moments::SunAngles {
                azimuth_deg: &azimuth_deg,
                elevation_deg: &elevation_deg,
            },
        };
        writer.write(&Rows {
            moments,
            ends: Some(&self.ends),
            heliostats: Some(&self.heliostats),
            numbers: &self.numbers.each_ref().map(Vec::as_slice),
            status: &self.status,
        })?;
        *self = Self::default();
        Ok(())
    }
}
