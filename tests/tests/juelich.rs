//! Jülich, uncalibrated: motor steps through drive, mount and reflection to the spot.

#![allow(
    clippy::unwrap_used,
    clippy::print_stderr,
    reason = "tests fail and talk"
)]

use helio_core::drive::{TriangleDrive, TriangleGeometry};
use helio_core::tracking::Prediction;
use helio_core::{
    Enu, EnuUnit, Heliostat, OffsetForm, Status, TargetPlane, TrackOptions, Tracker, TrackingMode,
};
use helio_tests::V3;
use helio_tests::cases::field;
use helio_tests::data::{self, Table};

/// What the README of the records says an uncalibrated heliostat misses by: name, number of records,
/// start \[mrad\].
fn published(text: &str) -> Vec<(String, usize, f64)> {
    let mut rows = Vec::new();
    let mut columns = None;
    for line in text.lines().filter(|line| line.starts_with('|')) {
        let cells: Vec<&str> = line.trim_matches('|').split('|').map(str::trim).collect();
        if cells[0] == "heliostat" {
            let at = |name| cells.iter().position(|c| *c == name);
            columns = at("records").zip(at("start"));
        } else if let Some((records, start)) = columns
            && let (Ok(records), Ok(start)) = (cells[records].parse(), cells[start].parse())
        {
            rows.push((cells[0].to_owned(), records, start));
        }
    }
    rows
}

#[test]
fn uncalibrated_heliostats_miss_by_what_is_published() {
    let Some(folder) = data::folder("uncalibrated_heliostats_miss_by_what_is_published") else {
        return;
    };
    let folder = folder.join("juelich/calibration");
    let published = published(&std::fs::read_to_string(folder.join("README.md")).unwrap());
    assert_eq!(published.len(), 12);
    let heliostats = Table::read(folder.join("heliostats.csv"));
    let actuators = Table::read(folder.join("actuators.csv"));
    // The fixed axis points east; gamma = -t1, alpha = t2.
    let mode = TrackingMode::PitchRoll {
        axis_azimuth_rad: std::f64::consts::FRAC_PI_2,
    };
    eprintln!("heliostat  records  published  computed  difference");
    for (name, count, want_mrad) in published {
        let row = (0..heliostats.len())
            .find(|&r| heliostats.text(r, "heliostat") == name)
            .unwrap();
        let drive = |axis: &str, sign: f64| {
            let row = (0..actuators.len())
                .find(|&r| {
                    actuators.text(r, "heliostat") == name && actuators.text(r, "axis") == axis
                })
                .unwrap();
            TriangleDrive::new(TriangleGeometry {
                offset_m: actuators.number(row, "offset_m"),
                pivot_radius_m: actuators.number(row, "pivot_radius_m"),
                initial_stroke_length_m: actuators.number(row, "initial_stroke_length_m"),
                initial_angle_rad: actuators.number(row, "initial_angle_rad"),
                steps_per_m: actuators.number(row, "increment_steps_per_m"),
                clockwise: actuators.text(row, "clockwise_axis_movement") == "1",
                sign,
            })
            .unwrap()
        };
        let (drive1, drive2) = (drive("1", -1.0), drive("2", 1.0));
        let pivot = Enu::new(
            heliostats.number(row, "east_m"),
            heliostats.number(row, "north_m"),
            heliostats.number(row, "up_m"),
        );
        let mirror_offset_m = heliostats.number(row, "mirror_pivot_offset_m");
        assert_eq!(mirror_offset_m, 0.175);
        let records = Table::read(folder.join(format!("{name}.csv")));
        let mut sum = 0.0;
        let mut used = 0;
        for record in 0..records.len() {
            if name == "AA39" && records.text(record, "epoch") != "3" {
                continue;
            }
            let at = |column: &str| records.number(record, column);
            let sun = EnuUnit::from_azimuth_elevation(
                (180.0 - at("sun_azimuth_south_deg")).to_radians(),
                at("sun_elevation_deg").to_radians(),
            );
            let spot = Enu::new(at("helios_e_m"), at("helios_n_m"), at("helios_u_m"));
            let heliostat = Heliostat {
                mirror_offset_m,
                ..Heliostat::new(pivot, spot)
            };
            let tracker = Tracker::new(&field(mode, &[heliostat]), OffsetForm::Exact).unwrap();
            let axis1 = [drive1.angle_rad(at("axis1_steps")).unwrap()];
            let axis2 = [drive2.angle_rad(at("axis2_steps")).unwrap()];
            // The README's normal, from its own angles.
            let (t1, t2) = (-axis1[0], axis2[0]);
            let n = V3(t2.sin(), -t2.cos() * t1.sin(), t2.cos() * t1.cos());
            let forward = V3::from(tracker.forward(&axis1, &axis2).unwrap()[0]);
            assert!((forward - n).norm() < 1e-15);
            // The beam by hand, and as predicted on a plane through the spot that faces north.
            let s = V3::from(sun);
            let beam = n * (2.0 * s.dot(n)) - s;
            let to_spot = V3::from(spot) - V3::from(pivot) - n * mirror_offset_m;
            let miss = beam.angle_to(to_spot);
            let north = EnuUnit::try_new(Enu::new(0.0, 1.0, 0.0)).unwrap();
            let plane = TargetPlane::level(spot, north);
            let mut out = Prediction::default();
            let options = TrackOptions::default();
            tracker
                .predict_into(sun, &axis1, &axis2, &[plane], &options, &mut out)
                .unwrap();
            assert_eq!(out.status, [Status::Ok]);
            assert!((out.beam_error_rad[0] - miss).abs() < 1e-12);
            sum += miss * miss;
            used += 1;
        }
        let got_mrad = 1e3 * (sum / f64::from(used)).sqrt();
        let off = 100.0 * (got_mrad / want_mrad - 1.0);
        eprintln!("{name:>9}  {used:>7}  {want_mrad:>9.1}  {got_mrad:>8.2}  {off:>+9.2} %");
        assert_eq!(used as usize, count, "{name}");
        assert!(
            off.abs() < 2.0,
            "{name}: {got_mrad} mrad, published {want_mrad}"
        );
    }
}

/// The example of the README, record 118585 of BF57.
#[test]
fn the_published_example_record() {
    let (t1, t2) = (53.767015_f64.to_radians(), (-18.916717_f64).to_radians());
    let mode = TrackingMode::PitchRoll {
        axis_azimuth_rad: std::f64::consts::FRAC_PI_2,
    };
    let pivot = Enu::new(93.4342, 219.8333, 1.7594);
    let spot = Enu::new(-1.7302, -3.2285, 35.4422);
    let heliostat = Heliostat {
        mirror_offset_m: 0.175,
        ..Heliostat::new(pivot, spot)
    };
    let tracker = Tracker::new(&field(mode, &[heliostat]), OffsetForm::Exact).unwrap();
    let n = V3::from(tracker.forward(&[-t1], &[t2]).unwrap()[0]);
    assert!(
        (n - V3(-0.324193, -0.763055, 0.559147)).norm() < 1e-6,
        "{n:?}"
    );
    let sun = EnuUnit::try_new(Enu::new(-0.167820, -0.455546, 0.874251)).unwrap();
    let got = tracker.track(sun);
    assert_eq!(got.status(), [Status::Ok]);
    let wanted = V3::from(tracker.forward(got.axis1_rad(), got.axis2_rad()).unwrap()[0]);
    // "the normal that really halves sun and spot direction": six digits, 14.6 mrad away
    assert!(
        (wanted - V3(-0.311075, -0.763906, 0.565403)).norm() < 5e-4,
        "{wanted:?}"
    );
    assert!(
        (1e3 * wanted.angle_to(n) - 14.6).abs() < 0.3,
        "{}",
        1e3 * wanted.angle_to(n)
    );
}
