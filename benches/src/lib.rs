//! What the benchmarks share: the peers' input files and a clock.

use std::fs;
use std::path::Path;
use std::time::Instant;

use helio_core::{AxisLimits, Enu, EnuUnit, Field, Heliostat, MountErrors, TrackingMode};

/// A field as the peers read it: one sun, and columns of one row per heliostat.
#[derive(Debug)]
pub struct PeerInput {
    /// The field, aims relative to pivots at the origin.
    pub field: Field,
    /// The sun.
    pub sun: EnuUnit,
}

/// Reads the raw little-endian columns and the JSON beside them that `peers/common.py` writes.
///
/// # Errors
/// A sentence, if a file is missing or not of that form.
pub fn read_peer_input(path: &Path) -> Result<PeerInput, String> {
    let text = fs::read_to_string(path.with_extension("json")).map_err(|e| e.to_string())?;
    let about: serde_json::Value = serde_json::from_str(&text).map_err(|e| e.to_string())?;
    let number = |key: &str| about[key].as_f64().ok_or(format!("{key} is missing"));
    let n = number("n")? as usize;
    let bytes = fs::read(path).map_err(|e| e.to_string())?;
    let values: Vec<f64> = bytes
        .chunks_exact(8)
        .map(|chunk| f64::from_le_bytes(std::array::from_fn(|k| chunk[k])))
        .collect();
    if values.len() != 14 * n {
        return Err(format!(
            "expected 14 columns of {n} rows, got {} numbers",
            values.len()
        ));
    }
    let mut field = Field::new(TrackingMode::AzimuthElevation);
    for row in 0..n {
        let at = |column: usize| values[column * n + row];
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
            limits: AxisLimits {
                axis1_min_rad: at(10),
                axis1_max_rad: at(11),
                axis2_min_rad: at(12),
                axis2_max_rad: at(13),
            },
        };
        field
            .push(&row.to_string(), heliostat)
            .map_err(|e| e.to_string())?;
    }
    let sun =
        EnuUnit::from_azimuth_elevation(number("sun_azimuth_rad")?, number("sun_elevation_rad")?);
    Ok(PeerInput { field, sun })
}

/// Nanoseconds of one call of `work`: (minimum, median) over `repeats`, each long enough to time.
pub fn nanoseconds(repeats: usize, mut work: impl FnMut()) -> (f64, f64) {
    let mut loops = 1_u32;
    loop {
        let start = Instant::now();
        for _ in 0..loops {
            work();
        }
        if start.elapsed().as_micros() >= 1500 {
            break;
        }
        loops *= 2;
    }
    let mut times: Vec<f64> = (0..repeats)
        .map(|_| {
            let start = Instant::now();
            for _ in 0..loops {
                work();
            }
            start.elapsed().as_nanos() as f64 / f64::from(loops)
        })
        .collect();
    times.sort_by(f64::total_cmp);
    (times[0], times[times.len() / 2])
}
