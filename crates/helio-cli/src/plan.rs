//! What was typed means: radians, a loaded field, suns, an open writer.

use std::path::{Path, PathBuf};

use helio_core::EnuUnit;
use helio_core::angle::{degrees, radians};
use helio_core::sun::{SunPositions, SunSite, positions};
pub(crate) use helio_io::degrees_as_written;
use helio_io::output::{Destination, Format, Layout, Moment, Moments, TableWriter};
use helio_io::{
    IoError, LoadedField, Site, TimeRange, format_time, load_field, load_suns, parse_step,
    parse_time,
};
use jiff::fmt::temporal::Pieces;

use crate::args::{FormatWord, OutArgs, SunArgs, TrackArgs};
use crate::failure::Failure;
use crate::printer::Printer;

/// Reads a field and passes its warnings on.
pub(crate) fn field(path: &Path, printer: &Printer) -> Result<LoadedField, Failure> {
    let loaded = load_field(path)?;
    for warning in &loaded.warnings {
        printer.warn(warning);
    }
    Ok(loaded)
}

/// Sets the number of threads for everything that follows.
pub(crate) fn threads(wanted: Option<u16>) -> Result<usize, Failure> {
    let Some(threads) = wanted.map(usize::from) else {
        return Ok(0);
    };
    rayon::ThreadPoolBuilder::new()
        .num_threads(threads)
        .build_global()
        .map_err(|e| Failure::refused(format!("--threads {threads}: {e}")))?;
    Ok(threads)
}

/// The sun's clock and place.
#[derive(Debug, Clone, Copy)]
pub(crate) struct SunClock {
    site: SunSite,
    delta_t_s: Option<f64>,
    ut1_utc_s: f64,
}

impl SunClock {
    pub(crate) fn of(site: &Site) -> Result<Self, Failure> {
        Ok(Self {
            site: site.sun_site()?,
            delta_t_s: site.delta_t_s,
            ut1_utc_s: site.ut1_utc_s.unwrap_or(0.0),
        })
    }

    /// Azimuths and apparent elevations \[rad\].
    pub(crate) fn suns(&self, unix_ns: &[i64]) -> Result<(Vec<f64>, Vec<f64>), Failure> {
        let suns = self.positions(unix_ns)?;
        Ok((suns.azimuth_rad, suns.apparent_elevation_rad))
    }

    /// Apparent and geometric positions.
    pub(crate) fn positions(&self, unix_ns: &[i64]) -> Result<SunPositions, Failure> {
        Ok(positions(
            &self.site,
            unix_ns,
            self.delta_t_s,
            self.ut1_utc_s,
        )?)
    }

    /// The clock of a field that must have one.
    pub(crate) fn needed(loaded: &LoadedField) -> Result<Self, Failure> {
        match &loaded.site {
            Some(site) => Self::of(site),
            None => Err(Failure::refused(format!(
                "{}: there is no [site], which the sun's position at a time needs; add it, or give \
                 --sun-azimuth-deg and --sun-elevation-deg",
                loaded
                    .files
                    .first()
                    .map_or(Path::new("field.toml"), PathBuf::as_path)
                    .display()
            ))),
        }
    }
}

/// The suns of a run.
#[derive(Debug)]
pub(crate) enum Suns {
    /// At times.
    Times {
        range: TimeRange,
        clock: SunClock,
        /// Offset from UTC in which the times were given \[s\], for labels.
        offset_s: i32,
    },
    /// Given by their angles \[deg\].
    Angles {
        azimuth_deg: Vec<f64>,
        elevation_deg: Vec<f64>,
    },
}

/// Some of the suns of a run.
#[derive(Debug, Default)]
pub(crate) struct SunBlock {
    pub(crate) unix_ns: Vec<i64>,
    pub(crate) azimuth_deg: Vec<f64>,
    pub(crate) elevation_deg: Vec<f64>,
    /// Toward the sun; below the horizon where the sun is.
    pub(crate) suns: Vec<EnuUnit>,
}

impl SunBlock {
    pub(crate) fn moments(&self) -> Moments<'_> {
        if self.unix_ns.is_empty() {
            Moments::SunAngles {
                azimuth_deg: &self.azimuth_deg,
                elevation_deg: &self.elevation_deg,
            }
        } else {
            Moments::Times {
                unix_ns: &self.unix_ns,
            }
        }
    }

    /// A sun in words.
    pub(crate) fn describe(&self, sun: usize) -> String {
        let (azimuth_deg, elevation_deg) = (self.azimuth_deg[sun], self.elevation_deg[sun]);
        let stands = if elevation_deg < 0.0 {
            "below the horizon"
        } else {
            "above the horizon"
        };
        let height = elevation_deg.abs();
        match self.unix_ns.get(sun) {
            Some(&unix_ns) => format!(
                "{}: azimuth {azimuth_deg:.3}°, {height:.3}° {stands}",
                format_time(unix_ns)
            ),
            None => format!("azimuth {azimuth_deg:.3}°, {height:.3}° {stands}"),
        }
    }
}

impl Suns {
    /// The suns that `track` was asked for.
    pub(crate) fn of_track(
        args: &TrackArgs,
        loaded: &LoadedField,
        printer: &Printer,
    ) -> Result<Self, Failure> {
        let timed = args.sun.time.is_some() || args.from.is_some();
        if let Some(path) = &args.suns {
            win_over_time(timed, "--suns", printer);
            let suns = load_suns(path)?;
            return Ok(Self::Angles {
                azimuth_deg: suns
                    .azimuth_rad
                    .into_iter()
                    .map(degrees_as_written)
                    .collect(),
                elevation_deg: suns
                    .elevation_rad
                    .into_iter()
                    .map(degrees_as_written)
                    .collect(),
            });
        }
        if let Some(given) = Self::given(&args.sun) {
            win_over_time(timed, "--sun-azimuth-deg and --sun-elevation-deg", printer);
            return Ok(given);
        }
        if let (Some(from), Some(to), Some(step)) = (&args.from, &args.to, &args.step) {
            let range = TimeRange::new(
                time("--from", from)?,
                time("--to", to)?,
                parse_step(step).map_err(|e| typed("--step", &e))?,
            )
            .map_err(|e| typed("--from and --to", &e))?;
            return Self::times(range, from, loaded);
        }
        Self::one(&args.sun, loaded, printer)
    }

    /// The one sun of a command without ranges; now if none was given.
    pub(crate) fn one(
        args: &SunArgs,
        loaded: &LoadedField,
        printer: &Printer,
    ) -> Result<Self, Failure> {
        if let Some(given) = Self::given(args) {
            win_over_time(
                args.time.is_some(),
                "--sun-azimuth-deg and --sun-elevation-deg",
                printer,
            );
            return Ok(given);
        }
        match &args.time {
            Some(text) => {
                let unix_ns = time("--time", text)?;
                Self::times(TimeRange::new(unix_ns, unix_ns, 1)?, text, loaded)
            }
            None => {
                // Whole seconds: nobody wants to type more to see the same sun again.
                let now = jiff::Timestamp::now().as_second();
                let unix_ns = now.saturating_mul(1_000_000_000);
                let suns = Self::times(TimeRange::new(unix_ns, unix_ns, 1)?, "", loaded)?;
                printer.note(format_args!(
                    "no time or sun given: now, {}",
                    format_time(unix_ns)
                ));
                Ok(suns)
            }
        }
    }

    fn given(args: &SunArgs) -> Option<Self> {
        let (azimuth_deg, elevation_deg) = (args.sun_azimuth_deg?, args.sun_elevation_deg?);
        Some(Self::Angles {
            azimuth_deg: vec![azimuth_deg],
            elevation_deg: vec![elevation_deg],
        })
    }

    fn times(range: TimeRange, text: &str, loaded: &LoadedField) -> Result<Self, Failure> {
        let offset = Pieces::parse(text.trim())
            .ok()
            .and_then(|pieces| pieces.to_numeric_offset());
        Ok(Self::Times {
            range,
            clock: SunClock::needed(loaded)?,
            offset_s: offset.map_or(0, jiff::tz::Offset::seconds),
        })
    }

    pub(crate) fn len(&self) -> usize {
        match self {
            Self::Times { range, .. } => range.len(),
            Self::Angles { azimuth_deg, .. } => azimuth_deg.len(),
        }
    }

    /// First and last time \[ns of Unix time\].
    pub(crate) fn times_ns(&self) -> Option<(i64, i64)> {
        match self {
            Self::Times { range, .. } => {
                let count = i128::try_from(range.len().saturating_sub(1)).unwrap_or(0);
                let last = i128::from(range.from_unix_ns()) + i128::from(range.step_ns()) * count;
                Some((
                    range.from_unix_ns(),
                    i64::try_from(last).unwrap_or(i64::MAX),
                ))
            }
            Self::Angles { .. } => None,
        }
    }

    pub(crate) fn moment(&self) -> Moment {
        match self {
            Self::Times { .. } => Moment::Time,
            Self::Angles { .. } => Moment::SunAngles,
        }
    }

    /// Some of the suns, from `first` on.
    pub(crate) fn block(&self, first: usize, count: usize) -> Result<SunBlock, Failure> {
        let mut block = SunBlock::default();
        match self {
            Self::Times { range, clock, .. } => {
                let last = (first + count).min(range.len());
                let at = |i: usize| {
                    let later = i128::from(range.step_ns()) * i as i128;
                    // Within the range, whose ends are both of this type.
                    (i128::from(range.from_unix_ns()) + later) as i64
                };
                block.unix_ns = (first..last).map(at).collect();
                let (azimuth_rad, elevation_rad) = clock.suns(&block.unix_ns)?;
                block.suns = toward(&azimuth_rad, &elevation_rad);
                block.azimuth_deg = azimuth_rad.into_iter().map(degrees).collect();
                block.elevation_deg = elevation_rad.into_iter().map(degrees).collect();
            }
            Self::Angles {
                azimuth_deg,
                elevation_deg,
            } => {
                let last = (first + count).min(azimuth_deg.len());
                block.azimuth_deg = azimuth_deg[first..last].to_vec();
                block.elevation_deg = elevation_deg[first..last].to_vec();
                let in_radians =
                    |deg: &[f64]| -> Vec<f64> { deg.iter().map(|&d| radians(d)).collect() };
                block.suns = toward(
                    &in_radians(&block.azimuth_deg),
                    &in_radians(&block.elevation_deg),
                );
            }
        }
        Ok(block)
    }
}

fn time(option: &str, text: &str) -> Result<i64, Failure> {
    parse_time(text).map_err(|e| typed(option, &e))
}

/// Something wrong with what an option was given.
fn typed(option: &str, error: &IoError) -> Failure {
    Failure::refused(format!("{option}: {error}"))
}

fn win_over_time(timed: bool, what: &str, printer: &Printer) {
    if timed {
        printer.note(format_args!(
            "the sun is given by {what}; the time is not used"
        ));
    }
}

pub(crate) fn toward(azimuth_rad: &[f64], elevation_rad: &[f64]) -> Vec<EnuUnit> {
    azimuth_rad
        .iter()
        .zip(elevation_rad)
        .map(|(&azimuth, &elevation)| EnuUnit::from_azimuth_elevation(azimuth, elevation))
        .collect()
}

/// The format of an output.
pub(crate) fn format(out: Option<&Path>, word: Option<FormatWord>) -> Result<Format, Failure> {
    match (word, out.filter(|path| !is_stdout(path))) {
        (Some(word), _) => Ok(word.into()),
        (None, None) => Ok(Format::Csv),
        (None, Some(path)) if path.extension().is_none() => Ok(Format::Csv),
        (None, Some(path)) => Format::of_path(path).ok_or_else(|| {
            Failure::refused(format!(
                "{}: the suffix stands for no format; wanted .csv, .parquet, .json or .jsonl, or \
                 --format",
                path.display()
            ))
        }),
    }
}

pub(crate) fn is_stdout(path: &Path) -> bool {
    path == Path::new("-")
}

/// The failure of a run that was stopped.
pub(crate) fn interrupted(out: &OutArgs) -> Failure {
    Failure::Interrupted {
        streamed: out.out.as_deref().is_none_or(is_stdout),
    }
}

/// Refuses to write two results to one place.
pub(crate) fn not_the_same(
    (first, out): (&str, Option<&Path>),
    (second, plot): (&str, Option<&Path>),
) -> Result<(), Failure> {
    let (Some(out), Some(plot)) = (out.filter(|path| !is_stdout(path)), plot) else {
        return Ok(());
    };
    // Neither need exist yet; their folders must.
    let place = |path: &Path| {
        path.canonicalize().ok().or_else(|| {
            let folder = path.parent().filter(|folder| *folder != Path::new(""));
            let folder = folder.unwrap_or(Path::new(".")).canonicalize().ok()?;
            Some(folder.join(path.file_name()?))
        })
    };
    if out == plot || place(out).is_some_and(|out| Some(out) == place(plot)) {
        return Err(Failure::refused(format!(
            "{}: {first} and {second} name the same file; give them two",
            plot.display()
        )));
    }
    Ok(())
}

/// Says, once, whose calibration does not hold for the times of a run.
pub(crate) fn warn_of_lapse(loaded: &LoadedField, times: Option<(i64, i64)>, printer: &Printer) {
    let (Some(schedule), Some((from_ns, to_ns))) = (&loaded.schedule, times) else {
        return;
    };
    let Some(lapse) = schedule.lapse(from_ns, to_ns) else {
        return;
    };
    let first = &loaded.field.ids()[lapse.first];
    let last = lapse.last_valid_to_ns.map_or(String::new(), |last_ns| {
        format!(", last valid_to {}", format_time(last_ns))
    });
    printer.warn(format_args!(
        "calibration: {} heliostats have no set that is valid all the time asked for (first \
         {first}{last}); the layout's errors hold there",
        crate::printer::Grouped(lapse.heliostats as u64)
    ));
}

/// Opens the table of a run.
pub(crate) fn writer(
    out: &OutArgs,
    format: Format,
    layout: Layout,
    inputs: &[PathBuf],
    printer: &Printer,
) -> Result<TableWriter, Failure> {
    let destination = destination(out.out.as_deref(), format, inputs, printer)?;
    Ok(TableWriter::create(destination, format, layout)?)
}

/// Where a table goes.
pub(crate) fn destination(
    out: Option<&Path>,
    format: Format,
    inputs: &[PathBuf],
    printer: &Printer,
) -> Result<Destination, Failure> {
    match out.filter(|path| !is_stdout(path)) {
        None if format == Format::Parquet && printer.stdout_is_terminal() => Err(Failure::refused(
            "Parquet is not text for a terminal; give --out FILE, or another --format",
        )),
        None => Ok(printer.stdout_table()),
        Some(path) => {
            not_an_input(path, inputs)?;
            Ok(Destination::File(path.to_owned()))
        }
    }
}

/// Now, as the text that pages are dated with.
pub(crate) fn made_at() -> String {
    let seconds = jiff::Timestamp::now().as_second();
    format_time(seconds.saturating_mul(1_000_000_000))
}

/// Refuses to replace what the run reads.
pub(crate) fn not_an_input(path: &Path, inputs: &[PathBuf]) -> Result<(), Failure> {
    let Ok(there) = path.canonicalize() else {
        return Ok(());
    };
    let same = |input: &&PathBuf| input.canonicalize().is_ok_and(|input| input == there);
    if inputs.iter().any(|input| same(&input)) {
        return Err(Failure::refused(format!(
            "{}: this run reads it; write to another file",
            path.display()
        )));
    }
    Ok(())
}
