//! What `check` says: what a field is, and whether it can work.

use std::fmt::Write;
use std::path::PathBuf;

use helio_core::angle::degrees;
use helio_core::error::TrackError;
use helio_core::sun::SunError;
use helio_core::{EnuUnit, OffsetForm, Status, TrackOptions, Tracker, Tracking};

use crate::{Grouped, LoadedField, Tally, format_time};

/// Heliostats named one by one.
const NAMED: usize = 10;
const DAY_S: i64 = 86_400;

/// What there is to say of a field.
#[derive(Debug, Clone, PartialEq, Eq)]
#[non_exhaustive]
pub struct FieldCheck {
    /// Lines of a name and what is to be said of it.
    pub text: String,
    /// Suns that the whole field was tracked through.
    pub suns: usize,
    /// Rows of each status, a row a sun and heliostat.
    pub tally: Tally,
    /// Rows of the heliostats that never reach their aim.
    pub never: Vec<usize>,
    /// Rows of those that do so for some of the suns only.
    pub sometimes: Vec<usize>,
}

/// Why a field is not checked to the end.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum CheckError {
    /// The site's numbers, or an instant beyond the years of the sun's algorithm.
    #[error(transparent)]
    Sun(#[from] SunError),
    /// A field that cannot be tracked.
    #[error(transparent)]
    Track(#[from] TrackError),
    /// Whoever watched wanted an end.
    #[error("stopped")]
    Stopped,
}

impl FieldCheck {
    /// Looks at a field, and tracks it through a sample of the suns of a year. `files` is what the files read are called,
    /// `unix_ns` the instant \[ns of Unix time\] that is called now. `watch` is told of suns done and in all.
    ///
    /// # Errors
    /// [`CheckError`]; [`CheckError::Stopped`] if `watch` wanted an end.
    ///
    /// ```
    /// use helio_io::{FieldCheck, load_field, write_example_field};
    /// let folder = tempfile::tempdir()?;
    /// let loaded = load_field(&write_example_field(folder.path(), false)?.field)?;
    /// let check = FieldCheck::of(&loaded, &loaded.files, 1_782_043_200_000_000_000, &|_, _| true)?;
    /// assert!(check.text.contains("\nheliostats     500, tracking mode azimuth-elevation\n"));
    /// assert!(check.text.contains("sun now        2026-06-21T12:00:00Z: azimuth 155.722°"));
    /// assert_eq!(check.tally.total(), 500 * check.suns as u64);
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn of(
        loaded: &LoadedField,
        files: &[PathBuf],
        unix_ns: i64,
        watch: &(dyn Fn(u64, u64) -> bool + Sync),
    ) -> Result<Self, CheckError> {
        let mut report = Report::default();
        describe(loaded, files, &mut report);
        sun_now(loaded, unix_ns, &mut report)?;
        reachability(loaded, report, watch)
    }
}

/// Lines of a name and what is to be said of it.
#[derive(Default)]
struct Report(String);

impl Report {
    fn line(&mut self, name: &str, text: impl std::fmt::Display) {
        // Writing to a string cannot fail.
        let _ = writeln!(self.0, "{name:<14} {text}");
    }
}

/// A range of numbers, or the one they all are.
struct Span(f64, f64);

impl Span {
    fn of(values: impl Iterator<Item = f64>) -> Self {
        values.fold(Self(f64::INFINITY, f64::NEG_INFINITY), |s, v| {
            Self(s.0.min(v), s.1.max(v))
        })
    }
}

impl std::fmt::Display for Span {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        // To the places asked for, without the zeros that say nothing.
        let places = f.precision().unwrap_or(3);
        let short = |value: f64| {
            let text = format!("{value:.places$}");
            let text = text.trim_end_matches('0').trim_end_matches('.').to_owned();
            if text == "-0" { "0".to_owned() } else { text }
        };
        let (low, high) = (short(self.0), short(self.1));
        if low == high {
            f.write_str(&low)
        } else {
            write!(f, "{low} to {high}")
        }
    }
}

fn describe(loaded: &LoadedField, files: &[PathBuf], report: &mut Report) {
    let files: Vec<String> = files.iter().map(|f| f.display().to_string()).collect();
    match files.is_empty() {
        true => report.line("files", "none: columns of no file"),
        false => report.line("files", files.join(", ")),
    }
    match &loaded.site {
        Some(site) => {
            let name = site
                .name
                .as_deref()
                .map_or(String::new(), |name| format!("{name}, "));
            let (latitude, longitude) = (degrees(site.latitude_rad), degrees(site.longitude_rad));
            let north = if latitude < 0.0 { 'S' } else { 'N' };
            let east = if longitude < 0.0 { 'W' } else { 'E' };
            report.line(
                "site",
                format_args!(
                    "{name}{:.6}° {north}, {:.6}° {east}, {} m",
                    latitude.abs(),
                    longitude.abs(),
                    site.elevation_m
                ),
            );
        }
        None => report.line("site", "none: suns must be given by their angles"),
    }
    let field = &loaded.field;
    let heliostats = field.heliostats();
    let count = Grouped(field.len() as u64);
    report.line(
        "heliostats",
        format_args!("{count}, tracking mode {}", field.mode().as_str()),
    );
    let span = |of: fn(&helio_core::Heliostat) -> f64| Span::of(heliostats.iter().map(of));
    report.line(
        "pivots",
        format_args!(
            "east {:.1} m, north {:.1} m, up {:.2} m",
            span(|h| h.pivot.east),
            span(|h| h.pivot.north),
            span(|h| h.pivot.up)
        ),
    );
    for (number, (name, target)) in loaded.targets.iter().enumerate() {
        let aiming = loaded
            .target_of
            .iter()
            .filter(|&&of| of == Some(number))
            .count();
        let c = target.centre;
        let area = target.area.map_or("a point".to_owned(), |area| {
            format!("{} by {} m", area.width_m, area.height_m)
        });
        report.line(
            "target",
            format_args!(
                "{name}: {area} at east {}, north {}, up {} m; {} heliostats aim at it",
                c.east,
                c.north,
                c.up,
                Grouped(aiming as u64)
            ),
        );
    }
    for (number, (name, target)) in loaded.targets.iter().enumerate() {
        let Some(plane) = target.area.map(|area| area.plane) else {
            continue;
        };
        let behind: Vec<&str> = (0..field.len())
            .filter(|&row| loaded.target_of[row] == Some(number))
            .filter(|&row| (heliostats[row].pivot - plane.centre).dot(plane.normal.as_enu()) <= 0.0)
            .map(|row| field.ids()[row].as_str())
            .collect();
        if !behind.is_empty() {
            let count = Grouped(behind.len() as u64);
            let named = behind[..behind.len().min(NAMED)].join(", ");
            let more = if behind.len() > NAMED { ", ..." } else { "" };
            report.line(
                "",
                format_args!(
                    "{count} heliostats stand behind the plane of {name} and miss it ({named}{more})"
                ),
            );
        }
    }
    let own = loaded.target_of.iter().filter(|of| of.is_none()).count();
    if own > 0 {
        report.line(
            "own aims",
            format_args!("{} heliostats", Grouped(own as u64)),
        );
    }
    report.line(
        "slant range",
        format_args!("{:.1} m", span(|h| (h.aim - h.pivot).norm())),
    );
    report.line(
        "mirror offset",
        format_args!("{:.4} m", span(|h| h.mirror_offset_m)),
    );
    describe_errors(loaded, report);
    describe_pose_errors(loaded, report);
    describe_limits(loaded, report);
    let driven = |axis: usize| loaded.drives.iter().filter(|d| d[axis].is_some()).count();
    if loaded.has_drives() {
        let (one, two) = (Grouped(driven(0) as u64), Grouped(driven(1) as u64));
        report.line(
            "drives",
            format_args!("axis 1 of {one} heliostats, axis 2 of {two}"),
        );
    } else {
        report.line("drives", "none");
    }
    if let Some(schedule) = &loaded.schedule {
        let varying = Grouped(schedule.varying_rows().len() as u64);
        report.line(
            "calibration",
            format_args!("changes with the hour or the date for {varying} heliostats"),
        );
    }
}

fn describe_errors(loaded: &LoadedField, report: &mut Report) {
    let heliostats = loaded.field.heliostats();
    let mut none = true;
    for (name, of) in [
        (
            "pedestal_tilt",
            (|e| e.pedestal_tilt_rad) as fn(&helio_core::MountErrors) -> f64,
        ),
        ("axis_nonorthogonality", |e| e.axis_nonorthogonality_rad),
        ("mirror_tilt", |e| e.mirror_tilt_rad),
        ("azimuth_reference", |e| e.azimuth_reference_rad),
        ("elevation_reference", |e| e.elevation_reference_rad),
    ] {
        let span = Span::of(heliostats.iter().map(|h| degrees(of(&h.errors))));
        if span.0 != 0.0 || span.1 != 0.0 {
            report.line(
                if none { "errors" } else { "" },
                format_args!("{name} {span:.4}°"),
            );
            none = false;
        }
    }
    if none {
        report.line("errors", "none");
    }
}

/// Nothing where there are none.
fn describe_pose_errors(loaded: &LoadedField, report: &mut Report) {
    let heliostats = loaded.field.heliostats();
    let mut first = true;
    for (name, of) in [
        (
            "axis1_sag",
            (|s| s.axis1_sag_rad) as fn(&helio_core::PoseErrors) -> f64,
        ),
        ("axis2_sag", |s| s.axis2_sag_rad),
        ("axis2_eccentricity", |s| s.axis2_eccentricity_rad),
    ] {
        let span = Span::of(heliostats.iter().map(|h| degrees(of(&h.pose_errors))));
        if span.0 != 0.0 || span.1 != 0.0 {
            let label = if first { "pose errors" } else { "" };
            report.line(label, format_args!("{name} {span:.4}°"));
            first = false;
        }
    }
}

fn describe_limits(loaded: &LoadedField, report: &mut Report) {
    let heliostats = loaded.field.heliostats();
    let unlimited = heliostats.iter().filter(|h| h.limits.is_none()).count();
    if unlimited == heliostats.len() {
        report.line("limits", "none");
        return;
    }
    let ends = |least: fn(&helio_core::AxisLimits) -> f64,
                most: fn(&helio_core::AxisLimits) -> f64| {
        let finite = |of: fn(&helio_core::AxisLimits) -> f64| {
            Span::of(
                heliostats
                    .iter()
                    .map(|h| degrees(of(&h.limits)))
                    .filter(|v| v.is_finite()),
            )
        };
        let say = |span: Span, none: &str| {
            if span.0 > span.1 {
                none.to_owned()
            } else {
                format!("{span:.3}°")
            }
        };
        format!(
            "from {} up to {}",
            say(finite(least), "anywhere"),
            say(finite(most), "anywhere")
        )
    };
    report.line(
        "limits",
        format_args!("axis 1 {}", ends(|l| l.axis1_min_rad, |l| l.axis1_max_rad)),
    );
    report.line(
        "",
        format_args!("axis 2 {}", ends(|l| l.axis2_min_rad, |l| l.axis2_max_rad)),
    );
    if unlimited > 0 {
        report.line(
            "",
            format_args!("{} heliostats without limits", Grouped(unlimited as u64)),
        );
    }
}

fn sun_now(loaded: &LoadedField, unix_ns: i64, report: &mut Report) -> Result<(), SunError> {
    let Some(site) = &loaded.site else {
        return Ok(());
    };
    if let Some(sun) = site.sun_positions(&[unix_ns])?.get(0) {
        report.line(
            "sun now",
            format_args!(
                "{}: azimuth {:.3}°, elevation {:.3}° apparent (as tracked), {:.3}° geometric",
                format_time(unix_ns),
                degrees(sun.azimuth_rad),
                degrees(sun.apparent_elevation_rad),
                degrees(sun.geometric_elevation_rad)
            ),
        );
    }
    Ok(())
}

/// Tracks the whole field through a sample of the suns of a year.
fn reachability(
    loaded: &LoadedField,
    mut report: Report,
    watch: &(dyn Fn(u64, u64) -> bool + Sync),
) -> Result<FieldCheck, CheckError> {
    let (suns, of) = sample(loaded)?;
    let n = loaded.field.len();
    let tracker = Tracker::new(&loaded.field, OffsetForm::Exact)?;
    let mut tracking = Tracking::default();
    let mut tally = Tally::default();
    let mut worked = vec![0_usize; n];
    let all = suns.len() as u64;
    for &sun in &suns {
        if !watch(0, all) {
            return Err(CheckError::Stopped);
        }
        tracker.track_into(&[sun], None, &TrackOptions::default(), &mut tracking)?;
        tally.add(tracking.status());
        for (worked, &status) in worked.iter_mut().zip(tracking.status()) {
            *worked += usize::from(status == Status::Ok);
        }
        watch(1, all);
    }
    let share = |count: u64| 100.0 * count as f64 / tally.total().max(1) as f64;
    report.line(
        "reachable",
        format_args!("over {} {of}:", Grouped(suns.len() as u64)),
    );
    for (status, count) in tally.rows().into_iter().filter(|&(_, count)| count > 0) {
        report.line(
            "",
            format_args!("{status} {:.3} % of the rows", share(count)),
        );
    }
    let rows = |wanted: &dyn Fn(usize) -> bool| -> Vec<usize> {
        (0..n).filter(|&row| wanted(worked[row])).collect()
    };
    let never = rows(&|worked| worked == 0);
    let sometimes = rows(&|worked| worked > 0 && worked < suns.len());
    for (what, rows) in [
        ("never reaches its aim", &never),
        ("sometimes does not", &sometimes),
    ] {
        if rows.is_empty() {
            continue;
        }
        let ids: Vec<&str> = rows
            .iter()
            .take(NAMED)
            .map(|&row| loaded.field.ids()[row].as_str())
            .collect();
        let more = if rows.len() > NAMED { ", ..." } else { "" };
        let count = Grouped(rows.len() as u64);
        report.line(
            "",
            format_args!("{what}: {count} heliostats ({}{more})", ids.join(", ")),
        );
    }
    Ok(FieldCheck {
        text: report.0,
        suns: suns.len(),
        tally,
        never,
        sometimes,
    })
}

/// Suns above the horizon: of a year where there is a site, else all over the sky.
fn sample(loaded: &LoadedField) -> Result<(Vec<EnuUnit>, &'static str), SunError> {
    let all: Vec<EnuUnit> = match &loaded.site {
        Some(site) => {
            // Every tenth day and half hour of 2026: later years hardly differ.
            let first_s = 1_767_225_600;
            let times: Vec<i64> = (0..37 * 48)
                .map(|k| (first_s + k / 48 * 10 * DAY_S + k % 48 * 1800) * 1_000_000_000)
                .collect();
            let suns = site.sun_positions(&times)?;
            let angles = suns.azimuth_rad.iter().zip(&suns.apparent_elevation_rad);
            angles
                .map(|(&azimuth, &elevation)| EnuUnit::from_azimuth_elevation(azimuth, elevation))
                .collect()
        }
        None => (0..24 * 9)
            .map(|k| {
                let (azimuth_deg, elevation_deg) = (k % 24 * 15, k / 24 * 10 + 5);
                EnuUnit::from_azimuth_elevation(
                    f64::from(azimuth_deg).to_radians(),
                    f64::from(elevation_deg).to_radians(),
                )
            })
            .collect(),
    };
    let of = match &loaded.site {
        Some(_) => "suns of a year (every half hour of every tenth day)",
        None => "suns all over the sky",
    };
    let up = all
        .into_iter()
        .filter(|sun| sun.as_enu().up > 0.0)
        .collect();
    Ok((up, of))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn whoever_watches_ends_it_and_hears_of_every_sun() {
        let folder = tempfile::tempdir().unwrap();
        let written = crate::write_example_field(folder.path(), false).unwrap();
        let loaded = crate::load_field(&written.field).unwrap();
        let of = |watch: &(dyn Fn(u64, u64) -> bool + Sync)| {
            FieldCheck::of(&loaded, &loaded.files, 0, watch)
        };
        assert!(matches!(of(&|_, _| false), Err(CheckError::Stopped)));
        let heard = std::sync::atomic::AtomicU64::new(0);
        let check = of(&|more, all| {
            assert!(all > 100);
            heard.fetch_add(more, std::sync::atomic::Ordering::Relaxed);
            true
        });
        let check = check.unwrap();
        assert_eq!(heard.into_inner(), check.suns as u64);
    }
}
