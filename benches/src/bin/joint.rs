//! Times the joint fit of a simulated field against the fits of its heliostats one by one, in the same run.
//!
//! ```text
//! joint [--heliostats N] [--observations M] [--threads T] [--repeat R] [--wrong SHARE] [--answers FILE]
//! ```
//!
//! Zero points wander, records scatter, a share of the spots was found in a wrong place. The time of either
//! is the least of the repeats.
#![allow(clippy::print_stdout)]

use std::fmt::Write as _;
use std::hint::black_box;
use std::time::Instant;

use helio_bench::Options;
use helio_bench::campaigns::Random;
use helio_calib::joint::{DAY_NS, JointFit, JointOptions, fit_joint};
use helio_calib::model::{Pose, landing};
use helio_calib::{Campaign, FieldFitOptions, Mount, Observation, Parameters, Sighting, fit_field};
use helio_core::{
    Enu, EnuUnit, Field, Heliostat, MountErrors, OffsetForm, TargetPlane, Tracker, TrackingMode,
};

/// Heliostats that are seen under the same suns.
const TOGETHER: usize = 32;
const LATITUDE_RAD: f64 = 0.65;

/// Mounts, and as many observations of each.
fn simulate(
    heliostats: usize,
    per_heliostat: usize,
    wrong: f64,
) -> Result<(Vec<Mount>, Vec<Observation>), Box<dyn std::error::Error>> {
    let mut random = Random(20_261_122);
    let facing = EnuUnit::try_new(Enu::new(0.0, 1.0, -0.1))?;
    let planes = [43.0, 35.0].map(|height| TargetPlane::level(Enu::new(0.0, 0.0, height), facing));
    let mode = TrackingMode::AzimuthElevation;
    let mut mounts = Vec::with_capacity(heliostats);
    let mut observations = Vec::with_capacity(heliostats * per_heliostat);
    while mounts.len() < heliostats {
        let count = TOGETHER.min(heliostats - mounts.len());
        let mut field = [Field::new(mode), Field::new(mode)];
        let mut chosen = Vec::new();
        for k in 0..count {
            let (sine, cosine) = (1.6 * random.unit() - 0.8).sin_cos();
            let distance = 60.0 + 240.0 * random.unit();
            let pivot = Enu::new(distance * sine, distance * cosine, 3.0);
            let errors = MountErrors {
                pedestal_tilt_rad: 0.008 * random.unit(),
                pedestal_tilt_azimuth_rad: core::f64::consts::PI * (2.0 * random.unit() - 1.0),
                axis_nonorthogonality_rad: 0.002 * random.normal(),
                mirror_tilt_rad: 0.004 * random.normal(),
                azimuth_reference_rad: 0.006 * random.normal(),
                elevation_reference_rad: 0.006 * random.normal(),
            };
            for (field, plane) in field.iter_mut().zip(&planes) {
                let mut heliostat = Heliostat::new(pivot, plane.centre);
                heliostat.mirror_offset_m = 0.2;
                heliostat.errors = errors;
                field.push(&k.to_string(), heliostat)?;
            }
            let mut heliostat = Heliostat::new(pivot, planes[0].centre);
            heliostat.mirror_offset_m = 0.2;
            heliostat.errors = errors;
            chosen.push(heliostat);
        }
        let trackers = [
            Tracker::new(&field[0], OffsetForm::Exact)?,
            Tracker::new(&field[1], OffsetForm::Exact)?,
        ];
        let mut day = 18_000.0;
        let mut seen = Vec::with_capacity(per_heliostat);
        for _ in 0..per_heliostat {
            day += if random.unit() < 0.5 {
                0.02
            } else {
                8.0 * random.unit()
            };
            let azimuth_rad = core::f64::consts::PI + 2.8 * (random.unit() - 0.5);
            let sun = EnuUnit::from_azimuth_elevation(azimuth_rad, 0.2 + 0.85 * random.unit());
            let target = usize::from(random.unit() < 0.3);
            seen.push((day, sun, target, trackers[target].track(sun)));
        }
        for (k, heliostat) in chosen.iter().enumerate() {
            let mount = Mount::of(mode, heliostat);
            let truth = Parameters::new(&heliostat.errors, heliostat.mirror_offset_m);
            let pose = Pose::of(&truth);
            let mut zero = [0.0; 4];
            let mut last = 0.0;
            for (day, sun, target, tracking) in &seen {
                let plane = planes[*target];
                let slant = (plane.centre - mount.pivot).norm();
                for (i, zero) in zero.iter_mut().enumerate() {
                    let (size, days) = [(0.0004, 60.0), (0.0003, 0.3)][i / 2];
                    let kept = f64::exp((last - day) / days);
                    *zero = kept * *zero + (1.0 - kept * kept).sqrt() * size * random.normal();
                }
                last = *day;
                let angles = [tracking.axis1_rad()[k], tracking.axis2_rad()[k]]
                    .map(|angle| angle + 0.002 * random.normal());
                let mut observation = Observation::new(
                    *sun,
                    angles[0] - zero[0] - zero[2],
                    angles[1] - zero[1] - zero[3],
                    plane,
                    0.0,
                    0.0,
                );
                let sighting = Sighting::new(&mount, &observation);
                let at = landing(&pose, &sighting).residual_m;
                let scatter = if random.unit() < wrong { 20.0 } else { 0.4 };
                observation.u_m = at[0] + 0.001 * scatter * slant * random.normal();
                observation.v_m = at[1] + 0.001 * scatter * slant * random.normal();
                observation.axis1_rad = angles[0];
                observation.axis2_rad = angles[1];
                observation.target = *target;
                observation.unix_ns = Some((day * DAY_NS) as i64);
                observations.push(observation);
            }
            mounts.push(mount);
        }
    }
    Ok((mounts, observations))
}

/// Most memory that the process has had, as the system tells it \[MB\].
fn most_memory_mb() -> f64 {
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let line = status.lines().find(|line| line.starts_with("VmHWM"));
    let number = line.and_then(|line| line.split_whitespace().nth(1));
    number
        .and_then(|kb| kb.parse().ok())
        .map_or(f64::NAN, |kb: f64| kb / 1024.0)
}

fn seconds<T>(repeat: usize, mut work: impl FnMut() -> T) -> f64 {
    let mut least = f64::INFINITY;
    for _ in 0..repeat.max(1) {
        let start = Instant::now();
        black_box(work());
        least = least.min(start.elapsed().as_secs_f64());
    }
    least
}

/// All numbers of an answer as text, one a line.
fn answers(fit: &JointFit) -> String {
    let mut text = String::new();
    let mut put = |name: &str, value: f64| {
        let _ = writeln!(text, "{name} {value:e}");
    };
    for cause in &fit.causes {
        put("cause", cause.value);
        put("sigma", cause.sigma);
        put("evidence", cause.log_evidence);
    }
    for (name, values) in [("mean", &fit.field_mean), ("spread", &fit.field_covariance)] {
        for &value in values {
            put(name, value);
        }
    }
    for value in [fit.noise.beam_mrad, fit.noise.spot_m, fit.noise.sun_path_s] {
        put("noise", value);
    }
    let w = &fit.wander;
    for value in w
        .slow_mrad
        .into_iter()
        .chain(w.fast_mrad)
        .chain([w.slow_days, w.fast_days])
    {
        put("wander", value);
    }
    put("likelihood", fit.minus_log_likelihood);
    for posterior in &fit.heliostats {
        for &value in &posterior.still {
            put("still", value);
        }
        for &value in &posterior.wandering {
            put("wandering", value);
        }
        for &value in &posterior.covariance {
            put("covariance", value);
        }
        put(
            "outliers",
            posterior.outliers.iter().map(|k| k + 1).sum::<usize>() as f64,
        );
        put(
            "jumps",
            posterior
                .jumps
                .iter()
                .map(|(k, jump)| 2 * k + jump.axis + 1)
                .sum::<usize>() as f64,
        );
    }
    text
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    const KNOWN: [&str; 6] = [
        "heliostats",
        "observations",
        "threads",
        "repeat",
        "wrong",
        "answers",
    ];
    let options = Options::from_arguments(&KNOWN)?;
    let heliostats = options.number("heliostats", 10_000)?;
    let per_heliostat = options.number("observations", 50)?;
    let threads = options.number("threads", 1)?;
    let repeat = options.number("repeat", 3)?;
    let wrong = options.number("wrong", 0.002)?;
    rayon::ThreadPoolBuilder::new()
        .num_threads(threads)
        .build_global()?;
    let (mounts, observations) = simulate(heliostats, per_heliostat, wrong)?;
    let campaigns: Vec<Campaign<'_>> = mounts
        .iter()
        .zip(observations.chunks_exact(per_heliostat))
        .map(|(&mount, observations)| Campaign {
            mount,
            observations,
        })
        .collect();
    let joint_options = JointOptions::new(LATITUDE_RAD);
    let before_mb = most_memory_mb();
    let alone_s = seconds(repeat, || {
        fit_field(&campaigns, &FieldFitOptions::default())
    });
    let alone_mb = most_memory_mb();
    let joint_s = seconds(repeat, || fit_joint(&campaigns, &joint_options));
    let records = (heliostats * per_heliostat) as f64;
    println!(
        "{{\"heliostats\": {heliostats}, \"observations\": {per_heliostat}, \"threads\": {threads}, \
         \"alone_s\": {alone_s:.4}, \"joint_s\": {joint_s:.4}, \"ratio\": {:.2}, \
         \"alone_ns_per_record\": {:.1}, \"joint_ns_per_record\": {:.1}, \
         \"given_mb\": {before_mb:.0}, \"alone_mb\": {alone_mb:.0}, \"joint_mb\": {:.0}}}",
        joint_s / alone_s,
        1e9 * alone_s / records,
        1e9 * joint_s / records,
        most_memory_mb(),
    );
    if let Some(path) = options.text("answers") {
        std::fs::write(path, answers(&fit_joint(&campaigns, &joint_options)?))?;
    }
    Ok(())
}
