//! What the benchmarks share: the peers' files, a clock and the command line.

pub mod campaigns;
pub mod juelich;

use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::fs;
use std::io::Write as _;
use std::path::Path;
use std::str::FromStr;
use std::time::Instant;

use helio_core::{
    AxisLimits, Enu, EnuUnit, Field, Heliostat, MountErrors, PoseErrors, SimdLevel, TrackingMode,
};

/// Columns of an input file, in the order of `peers/common.py`.
pub const COLUMNS: usize = 14;

/// Shortest time \[µs\] that is measured at once; the same for every peer.
const MIN_REPEAT_US: u128 = 20_000;

/// A field as the peers read it: one sun, and columns of one row per heliostat.
#[derive(Debug)]
pub struct PeerInput {
    /// The columns, one after another: aim east, north, up \[m\], mirror offset \[m\], the six errors
    /// \[rad\], the four limits \[rad\].
    pub columns: Vec<Vec<f64>>,
    /// The sun.
    pub sun: EnuUnit,
}

impl PeerInput {
    /// Reads the raw little-endian columns and the JSON beside them that `peers/common.py` writes.
    ///
    /// # Errors
    /// A sentence, if a file is missing or not of that form.
    pub fn read(path: &Path) -> Result<Self, String> {
        let about_path = path.with_extension("json");
        let text = fs::read_to_string(&about_path)
            .map_err(|error| format!("{}: {error}", about_path.display()))?;
        let about: serde_json::Value = serde_json::from_str(&text)
            .map_err(|error| format!("{}: {error}", about_path.display()))?;
        let number = |key: &str| {
            about[key]
                .as_f64()
                .ok_or_else(|| format!("{}: no number {key}", about_path.display()))
        };
        let bytes = fs::read(path).map_err(|error| format!("{}: {error}", path.display()))?;
        let values: Vec<f64> = bytes
            .chunks_exact(8)
            .map(|chunk| f64::from_le_bytes(std::array::from_fn(|k| chunk[k])))
            .collect();
        let n = number("n")? as usize;
        if n == 0 || values.len() != COLUMNS * n {
            return Err(format!(
                "{}: expected {COLUMNS} columns of {n} rows, got {} numbers",
                path.display(),
                values.len()
            ));
        }
        let (azimuth_rad, elevation_rad) =
            (number("sun_azimuth_rad")?, number("sun_elevation_rad")?);
        Ok(Self {
            columns: values.chunks_exact(n).map(<[f64]>::to_vec).collect(),
            sun: EnuUnit::from_azimuth_elevation(azimuth_rad, elevation_rad),
        })
    }

    /// Number of heliostats.
    #[must_use]
    pub fn len(&self) -> usize {
        self.columns[0].len()
    }

    /// True if there is none.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// The heliostats, pivots at the origin.
    ///
    /// # Errors
    /// A sentence, if a row is not a heliostat.
    pub fn field(&self) -> Result<Field, String> {
        let mut field = Field::new(TrackingMode::AzimuthElevation);
        for row in 0..self.len() {
            let at = |column: usize| self.columns[column][row];
            let heliostat = Heliostat {
                pivot: Enu::default(),
                aim: Enu::new(at(0), at(1), at(2)),
                mirror_offset_m: at(3),
                errors: MountErrors {
                    pedestal_tilt_azimuth_rad: at(4),
                    pedestal_tilt_rad: at(5),
                    axis_nonorthogonality_rad: at(6),
                    mirror_tilt_rad: at(7),
                    azimuth_reference_rad: at(8),
                    elevation_reference_rad: at(9),
                },
                pose_errors: PoseErrors::NONE,
                limits: AxisLimits {
                    axis1_min_rad: at(10),
                    axis1_max_rad: at(11),
                    axis2_min_rad: at(12),
                    axis2_max_rad: at(13),
                },
            };
            field
                .push(&row.to_string(), heliostat)
                .map_err(|error| error.to_string())?;
        }
        Ok(field)
    }
}

/// Writes columns and, after them, a byte per row, as `peers/common.py` reads them.
///
/// # Errors
/// A sentence, if the file cannot be written.
pub fn write_answers(path: &Path, columns: &[&[f64]], status: &[u8]) -> Result<(), String> {
    let write = || -> std::io::Result<()> {
        let mut file = std::io::BufWriter::new(fs::File::create(path)?);
        for value in columns.iter().copied().flatten() {
            file.write_all(&value.to_le_bytes())?;
        }
        file.write_all(status)?;
        file.flush()
    };
    write().map_err(|error| format!("{}: {error}", path.display()))
}

/// Least and median time of one call.
#[derive(Debug, Clone, Copy)]
pub struct Nanoseconds {
    /// The fastest repeat.
    pub least: f64,
    /// The middle one.
    pub median: f64,
}

impl Nanoseconds {
    /// Times `work`, `repeats` times, each long enough for the clock.
    pub fn of(repeats: usize, mut work: impl FnMut()) -> Self {
        let mut timed = |loops: u32| {
            let start = Instant::now();
            for _ in 0..loops {
                work();
            }
            start.elapsed()
        };
        let mut loops = 1_u32;
        while timed(loops).as_micros() < MIN_REPEAT_US && loops < u32::MAX / 2 {
            loops *= 2;
        }
        let mut times: Vec<f64> = (0..repeats.max(1))
            .map(|_| timed(loops).as_nanos() as f64 / f64::from(loops))
            .collect();
        times.sort_by(f64::total_cmp);
        Self {
            least: times[0],
            median: times[times.len() / 2],
        }
    }

    /// The JSON object of the peers, each figure divided by `count`.
    #[must_use]
    pub fn json(self, count: usize) -> String {
        let mut text = String::new();
        let (least, median) = (self.least / count as f64, self.median / count as f64);
        // Writing to a string does not fail.
        let _ = write!(text, "{{\"minimum\": {least:.5}, \"median\": {median:.5}}}");
        text
    }
}

/// Options of the form `--name VALUE`.
#[derive(Debug)]
pub struct Options(BTreeMap<String, String>);

impl Options {
    /// Takes the process's arguments; `known` are the names without their dashes.
    ///
    /// # Errors
    /// A sentence, for an unknown option or one without its value.
    pub fn from_arguments(known: &[&str]) -> Result<Self, String> {
        let mut options = BTreeMap::new();
        let mut arguments = std::env::args().skip(1);
        while let Some(argument) = arguments.next() {
            let name = argument
                .strip_prefix("--")
                .filter(|name| known.contains(name))
                .ok_or_else(|| {
                    format!("unknown option {argument}; known: --{}", known.join(", --"))
                })?;
            let value = arguments
                .next()
                .ok_or_else(|| format!("--{name} wants a value"))?;
            options.insert(name.to_owned(), value);
        }
        Ok(Self(options))
    }

    /// The text of an option.
    #[must_use]
    pub fn text(&self, name: &str) -> Option<&str> {
        self.0.get(name).map(String::as_str)
    }

    /// The path of an option that must be given.
    ///
    /// # Errors
    /// A sentence, if it is not.
    pub fn path(&self, name: &str) -> Result<&Path, String> {
        self.text(name)
            .map(Path::new)
            .ok_or_else(|| format!("--{name} must be given"))
    }

    /// The number of an option, or the default.
    ///
    /// # Errors
    /// A sentence, if it is no number.
    pub fn number<T: FromStr>(&self, name: &str, default: T) -> Result<T, String> {
        self.text(name).map_or(Ok(default), |text| {
            text.parse()
                .map_err(|_| format!("--{name}: expected a number, got {text:?}"))
        })
    }

    /// The instruction set of `--level`, or the best.
    ///
    /// # Errors
    /// A sentence that names those there are.
    pub fn level(&self) -> Result<SimdLevel, String> {
        let Some(text) = self.text("level") else {
            return Ok(SimdLevel::best());
        };
        let available = SimdLevel::available();
        let found = available.iter().find(|level| level.as_str() == text);
        found.copied().ok_or_else(|| {
            let names: Vec<&str> = available.iter().map(|level| level.as_str()).collect();
            format!(
                "--level: expected one of {}, got {text:?}",
                names.join(", ")
            )
        })
    }
}

/// Most memory that the process has used \[MiB\]; 0 where the system does not say.
#[must_use]
pub fn memory_mib() -> u64 {
    let status = fs::read_to_string("/proc/self/status").unwrap_or_default();
    let line = status.lines().find_map(|line| line.strip_prefix("VmHWM:"));
    let kib = line.and_then(|line| {
        line.trim()
            .trim_end_matches("kB")
            .trim()
            .parse::<u64>()
            .ok()
    });
    kib.unwrap_or(0) / 1024
}
