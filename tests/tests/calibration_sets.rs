//! Parameter sets over the day on recorded heliostats: what they leave, what they predict (Guo 2015 §6, figure 9),
//! and that no axis jumps where one passes into the next.

#![allow(
    clippy::unwrap_used,
    clippy::print_stderr,
    reason = "tests fail and talk"
)]

use std::fmt::Write as _;

use helio_calib::schedule::BLEND_RAD;
use helio_calib::{
    FitOptions, Mount, Observation, Parameters, Schedule, Sets, beam_errors_mrad, fit, fit_sets,
};
use helio_core::sun::{SunSite, position};
use helio_core::{Field, OffsetForm, Status, Tracker, TrackingMode};
use helio_tests::{Rng, circle_difference_rad, data, juelich};

fn rms(squares: &[f64]) -> f64 {
    (squares.iter().sum::<f64>() / squares.len() as f64).sqrt()
}

/// Fitted to the rows of `from`, beam errors squared of the rows of `to`: a set for each half of the day that
/// knows nothing of the other, or one. Written without the schedule.
fn plain(
    mount: &Mount,
    observations: &[Observation],
    from: &[usize],
    to: &[usize],
    halves: bool,
) -> Vec<f64> {
    let half = |row: &usize| halves && observations[*row].hour_angle_rad.unwrap() > 0.0;
    let fitted = |afternoon: bool| -> Parameters {
        let own: Vec<Observation> = from
            .iter()
            .filter(|&row| half(row) == afternoon)
            .map(|&row| observations[row])
            .collect();
        fit(mount, &own, &FitOptions::default()).unwrap().parameters
    };
    let morning = fitted(false);
    let afternoon = if halves { fitted(true) } else { morning };
    to.iter()
        .map(|row| {
            let parameters = if half(row) { &afternoon } else { &morning };
            beam_errors_mrad(mount, &observations[*row..=*row], parameters)[0].powi(2)
        })
        .collect()
}

/// RMS on days left out, ten folds of days of the clock.
fn predicted(mount: &Mount, observations: &[Observation], halves: bool) -> f64 {
    let day = |row: usize| observations[row].unix_ns.map(|t| t / 86_400_000_000_000);
    let mut days: Vec<i64> = (0..observations.len()).filter_map(day).collect();
    days.sort_unstable();
    days.dedup();
    let mut rng = Rng::new(7);
    for place in (1..days.len()).rev() {
        days.swap(place, rng.below(place + 1));
    }
    let fold = |row: usize| Some(days.iter().position(|&d| Some(d) == day(row))? % 10);
    let mut squares = Vec::new();
    for out in 0..10 {
        let rows = |is: bool| -> Vec<usize> {
            (0..observations.len())
                .filter(|&row| fold(row).is_some_and(|f| (f == out) == is))
                .collect()
        };
        squares.extend(plain(
            mount,
            observations,
            &rows(false),
            &rows(true),
            halves,
        ));
    }
    rms(&squares)
}

#[test]
fn one_set_against_two_a_day() {
    let Some(data) = data::folder("one_set_against_two_a_day") else {
        return;
    };
    eprintln!("Beam RMS in mrad on the records themselves / on days not seen.");
    eprintln!(
        "heliostat  records  days  one set      two, each alone  two, near the common  best by cross-validation"
    );
    let mut improved = 0;
    for name in ["BF57", "BG62", "BH35", "BF55"] {
        let records = juelich::records(&data, name);
        let (mount, observations) = (&records.mount, &records.observations);
        let options = FitOptions::default();
        let two = fit_sets(mount, observations, &options, Sets::Two).unwrap();
        let best = fit_sets(mount, observations, &options, Sets::Auto { max: 4 }).unwrap();
        let all: Vec<usize> = (0..observations.len()).collect();
        let plain = [false, true].map(|halves| {
            let own = rms(&plain(mount, observations, &all, &all, halves));
            (own, predicted(mount, observations, halves))
        });
        let choices: Vec<(f64, f64)> = best
            .choices
            .iter()
            .map(|c| {
                let unseen = c.cross_validated_beam_rms_mrad.unwrap();
                (c.in_sample_beam_rms_mrad, unseen)
            })
            .collect();
        let mut tried = String::new();
        for (own, unseen) in &choices {
            write!(tried, "  {own:.3}/{unseen:.3}").unwrap();
        }
        eprintln!(
            "{name:>9}  {:>7}  {:>4}  {:.3}/{:.3}  {:.3}/{:.3}      {:.3}/{:.3}           {} of 1 to 4:{tried}",
            observations.len(),
            two.days,
            plain[0].0,
            plain[0].1,
            plain[1].0,
            plain[1].1,
            choices[1].0,
            choices[1].1,
            best.sets.len(),
        );
        assert_eq!(two.choices, best.choices[..2]);
        // The single set is the plain fit; other folds of days change its prediction little.
        assert!((choices[0].0 - plain[0].0).abs() < 1e-9);
        assert!((choices[0].1 / plain[0].1 - 1.0).abs() < 0.03);
        // The paper's finding: two sets leave less. Free of each other they leave least,
        // but predict worse than near the common one.
        assert!(choices[1].0 < choices[0].0 && plain[1].0 < plain[0].0);
        assert!(choices[1].1 < plain[1].1 * 1.01, "{name}");
        // Near the common set little is lost where one was right.
        assert!(choices[1].1 < choices[0].1 * 1.02, "{name}");
        improved += usize::from(choices[1].1 < choices[0].1);
    }
    assert!(improved >= 2, "{improved}");
}

/// A field with the sets as a calibration table, as tracking reads it.
fn tracked(mount: &Mount, schedule: &Schedule) -> helio_io::CalibrationSchedule {
    let folder = tempfile::tempdir().unwrap();
    let write = |name: &str, text: &str| std::fs::write(folder.path().join(name), text).unwrap();
    write(
        "field.toml",
        "[site]\nlatitude_deg = 50.9134\nlongitude_deg = 6.3878\nelevation_m = 88.0\n\
         [targets.receiver]\ncentre_enu_m = [0.0, -0.5, 55.2]\n\
         [heliostats]\ntable = \"heliostats.csv\"\naim = \"receiver\"\nmode = \"pitch-roll\"\n\
         axis_azimuth_deg = 90\nmirror_offset_m = 0.175\ncalibration = \"sets.csv\"\n",
    );
    let p = mount.pivot;
    let row = format!("H,{},{},{}\n", p.east, p.north, p.up);
    write("heliostats.csv", &format!("id,east_m,north_m,up_m\n{row}"));
    let mut table = String::from(
        "id,set,pedestal_tilt_deg,pedestal_tilt_azimuth_deg,axis_nonorthogonality_deg,mirror_tilt_deg,\
         azimuth_reference_deg,elevation_reference_deg,hour_angle_from_deg,hour_angle_to_deg\n",
    );
    for set in &schedule.sets {
        let e = set.fit.parameters.errors();
        write!(table, "H,{}", set.name).unwrap();
        for angle in [
            e.pedestal_tilt_rad,
            e.pedestal_tilt_azimuth_rad,
            e.axis_nonorthogonality_rad,
            e.mirror_tilt_rad,
            e.azimuth_reference_rad,
            e.elevation_reference_rad,
            set.hour_angle_from_rad,
            set.hour_angle_to_rad,
        ] {
            write!(table, ",{}", angle.to_degrees()).unwrap();
        }
        table.push('\n');
    }
    write("sets.csv", &table);
    let loaded = helio_io::load_field(&folder.path().join("field.toml")).unwrap();
    loaded.schedule.unwrap()
}

#[test]
fn no_axis_jumps_where_one_set_passes_into_the_next() {
    let Some(data) = data::folder("no_axis_jumps_where_one_set_passes_into_the_next") else {
        return;
    };
    const STEP_S: i64 = 10;
    let mode = TrackingMode::PitchRoll {
        axis_azimuth_rad: std::f64::consts::FRAC_PI_2,
    };
    let site = SunSite::new(50.9134_f64.to_radians(), 6.3878_f64.to_radians(), 88.0).unwrap();
    eprintln!(
        "heliostat  sets  most apart (mrad)  largest step in 10 s (mrad) with one set, with the schedule"
    );
    for name in ["BF57", "BH35"] {
        let records = juelich::records(&data, name);
        let options = FitOptions::default();
        let schedule =
            fit_sets(&records.mount, &records.observations, &options, Sets::Two).unwrap();
        let tracker = tracked(&records.mount, &schedule);
        let angles = |heliostat, sun| {
            let mut field = Field::new(mode);
            field.push("H", heliostat).unwrap();
            let tracking = Tracker::new(&field, OffsetForm::Exact).unwrap().track(sun);
            assert_eq!(tracking.status(), [Status::Ok]);
            [tracking.axis1_rad()[0], tracking.axis2_rad()[0]]
        };
        let [one, other] = [0, 1].map(|set: usize| schedule.sets[set].fit.parameters.values);
        let squares = one.iter().zip(other).map(|(a, b)| (a - b).powi(2));
        let difference = squares.sum::<f64>().sqrt();
        assert!(difference < 0.01, "{difference}");
        let (mut apart, mut plain_step, mut step) = (0.0_f64, 0.0_f64, 0.0_f64);
        // 2025: a day of winter, of spring and of summer, five hours about noon
        for noon_s in [1_736_510_400, 1_742_990_400, 1_750_507_200_i64] {
            let mut last: Option<([f64; 2], [[f64; 2]; 2], f64)> = None;
            for k in -900..900 {
                let unix_ns = (noon_s + STEP_S * k) * 1_000_000_000;
                let sun = position(&site, unix_ns, None, 0.0).unwrap().direction();
                let hour = juelich::hour_angle_rad(sun);
                let here = tracker.heliostat_at(0, Some(unix_ns), hour).unwrap();
                // The schedule's own blend is what tracking makes of the table.
                let blended = schedule.at(hour).values;
                let read = Parameters::new(&here.errors, here.mirror_offset_m).values;
                for (a, b) in blended.iter().zip(read) {
                    assert!((a - b).abs() < 1e-14, "{hour}: {a} {b}");
                }
                let now = angles(here, sun);
                let ends = [-1.0, 1.0]
                    .map(|hour| angles(tracker.heliostat_at(0, Some(unix_ns), hour).unwrap(), sun));
                if let Some((before, ends_before, hour_before)) = last {
                    let share = (hour - hour_before) / BLEND_RAD;
                    for axis in [0, 1] {
                        let moved = circle_difference_rad(now[axis], before[axis]);
                        let [one, other] = [0, 1].map(|set| {
                            circle_difference_rad(ends[set][axis], ends_before[set][axis])
                        });
                        let gap = circle_difference_rad(ends[1][axis], ends[0][axis]).abs();
                        // As either set would have moved, and the blend's share of the gap between them;
                        // angles are not linear in parameters: what is second order in their difference.
                        let (least, most) = (one.min(other), one.max(other));
                        let bend = difference * difference * (share + most.abs() + least.abs());
                        let room = gap * share + bend;
                        assert!(
                            (least - room..=most + room).contains(&moved),
                            "{name} {k} axis {axis}: {moved}, sets {one} and {other}, room {room}"
                        );
                        apart = apart.max(1e3 * gap);
                        plain_step = plain_step.max(1e3 * most.abs().max(least.abs()));
                        step = step.max(1e3 * moved.abs());
                    }
                }
                last = Some((now, ends, hour));
            }
        }
        let sets = schedule.sets.len();
        // What the blend adds to a step of 10 s is a hundredth of the gap, give or take.
        assert!(step < plain_step + 0.01 * apart);
        eprintln!("{name:>9}  {sets:>4}  {apart:>17.3}  {plain_step:>27.4}  {step:.4}");
    }
}
