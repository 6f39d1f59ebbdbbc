//! `predict`: where each beam lands, from axis angles.

use std::ops::Range;
use std::sync::atomic::Ordering;

use helio_core::tracking::Prediction;
use helio_core::{EnuUnit, Status, TrackOptions};
use helio_io::output::{Layout, Moment, Moments, Number, Rows, Scale};
use helio_io::{Angles, AnglesSun, LoadedField, RowPredictor, RowPredictorError, load_angles};

use super::track::stop_on_signals;
use crate::Outcome;
use crate::args::{NO_SHADING, PredictArgs};
use crate::failure::Failure;
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

    let mut predictor = RowPredictor::new(&loaded, options)?;
    let mut block = Block::default();
    let mut tally = Tally::default();
    let stop = stop_on_signals();
    let rows = angles.heliostat.len();
    let mut progress = printer.progress(rows as u64);
    let mut start = 0;
    while start < rows {
        let end = predictor.group_end(&angles, start, |a, b| suns.same(a, b));
        let (sun, unix_ns) = (suns.suns[start], suns.unix_ns.get(start).copied());
        let landed = predictor.predict(&angles, start..end, sun, unix_ns)?;
        block.add(&angles, start..end, landed);
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
    if !typed && angles.times_unused {
        printer.warn(format_args!(
            "{}: it states both times and the sun's angles; the angles say where the sun is",
            args.angles.display()
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

impl From<RowPredictorError> for Failure {
    fn from(error: RowPredictorError) -> Self {
        match error {
            RowPredictorError::Field(error) => error.into(),
            RowPredictorError::Track(error) => error.into(),
            RowPredictorError::Calibration(error) => error.into(),
            other => Self::refused(other.to_string()),
        }
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
    fn add(&mut self, angles: &Angles, rows: Range<usize>, p: &Prediction) {
        self.firsts.push(rows.start);
        let columns = [
            &p.u_m,
            &p.v_m,
            &p.east_m,
            &p.north_m,
            &p.up_m,
            &p.beam_error_rad,
        ];
        for &heliostat in &angles.heliostat[rows] {
            for (numbers, column) in self.numbers.iter_mut().zip(columns) {
                numbers.push(column[heliostat]);
            }
            self.status.push(p.status[heliostat]);
            self.heliostats.push(heliostat as u32);
        }
        self.ends.push(self.status.len());
    }

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
