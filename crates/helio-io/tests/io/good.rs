//! What is good, and means what it says.

use std::sync::Arc;

use arrow::array::{
    ArrayRef, DictionaryArray, Float32Array, Int64Array, StringArray, TimestampMillisecondArray,
};
use arrow::datatypes::Int32Type;
use helio_core::angle::radians;
use helio_core::drive::Drive;
use helio_core::{Enu, TrackingMode};

use crate::files::{FIELD, Folder, LAYOUT, floats, texts};

#[test]
fn the_plain_field() {
    let loaded = Folder::of_field().load().unwrap();
    let site = loaded.site.as_ref().unwrap();
    assert_eq!(site.name.as_deref(), Some("Test"));
    assert_eq!(site.latitude_rad, radians(40.0));
    assert_eq!(site.elevation_m, 1100.0);
    assert_eq!(site.pressure_hpa, None);
    let observer = site.sun_site().unwrap();
    assert_eq!(
        (observer.latitude_rad(), observer.temperature_c()),
        (radians(40.0), 12.0)
    );
    assert_eq!(loaded.field.ids(), ["A1", "A2", "A3"]);
    assert_eq!(loaded.field.mode(), TrackingMode::AzimuthElevation);
    let heliostat = loaded.field.heliostats()[2];
    assert_eq!(heliostat.pivot, Enu::new(30.0, 80.0, 4.5));
    assert_eq!(heliostat.aim, Enu::new(0.0, 0.0, 100.0));
    assert_eq!(heliostat.mirror_offset_m, 0.2);
    assert!(heliostat.limits.is_none());
    assert_eq!(loaded.target(2).unwrap().unwrap().0, "receiver");
    assert!(!loaded.has_drives());
    assert!(loaded.schedule.is_none() && loaded.warnings.is_empty());
    assert_eq!(loaded.files.len(), 2);
}

#[test]
fn a_point_gets_a_plane_square_to_the_line_to_it() {
    let layout = "id,east_m,north_m,up_m,aim\nA1,0,50,100,\nA2,0,50,60,white\n";
    let loaded = Folder::of_field()
        .with("layout.csv", layout)
        .load()
        .unwrap();
    let plane = loaded.plane_for(0).unwrap();
    assert_eq!(plane.centre, Enu::new(0.0, 0.0, 100.0));
    assert_eq!(plane.normal.as_enu(), Enu::new(0.0, 1.0, 0.0));
    assert_eq!(plane.right.as_enu().up, 0.0);
    let white = loaded.targets["white"].area.unwrap();
    assert_eq!(loaded.plane_for(1).unwrap(), white.plane);
    assert_eq!((white.width_m, white.height_m), (8.0, 6.0));
    let at_pivot = "id,east_m,north_m,up_m\nA1,0,0,100\n";
    let loaded = Folder::of_field()
        .with("layout.csv", at_pivot)
        .load()
        .unwrap();
    assert_eq!(loaded.plane_for(0).unwrap().normal, helio_core::EnuUnit::UP);
}

#[test]
fn byte_order_marks_blanks_and_line_ends_do_not_matter() {
    let windows = format!(
        "\u{FEFF}{}",
        LAYOUT.replace('\n', "\r\n").replace(',', " , ")
    );
    let toml = format!("\u{FEFF}{}", FIELD.replace('\n', "\r\n"));
    let plain = Folder::of_field().load().unwrap();
    let loaded = Folder::new()
        .with("field.toml", toml)
        .with("layout.csv", windows)
        .load()
        .unwrap();
    assert_eq!(loaded.field, plain.field);
    let no_last_end = Folder::of_field()
        .with("layout.csv", LAYOUT.trim_end())
        .load()
        .unwrap();
    assert_eq!(no_last_end.field, plain.field);
}

#[test]
fn columns_override_defaults_and_empty_cells_do_not() {
    let layout = "id,east_m,north_m,up_m,mirror_offset_m,pedestal_tilt_deg,pedestal_tilt_azimuth_deg,\
        axis_nonorthogonality_deg,mirror_tilt_deg,azimuth_reference_deg,elevation_reference_deg,\
        axis1_sag_deg,axis2_sag_deg,axis2_eccentricity_deg,axis1_min_deg,axis1_max_deg,axis2_min_deg,axis2_max_deg,aim,aim_east_m,aim_north_m,aim_up_m\n\
        A1,1,2,3,,,,,,,,,,,,,,,,,,\n\
        A2,1,2,3,0.5,1,2,3,4,5,6,0.7,-0.8,-0.9,-400,400,-10,100,white,,,\n\
        A3,1,2,3,,,,,,,,,,,,,,,,7,8,9\n";
    let defaults = "pedestal_tilt_deg = 0.1\npedestal_tilt_azimuth_deg = 0.2\n\
        axis_nonorthogonality_deg = 0.3\nmirror_tilt_deg = 0.4\nazimuth_reference_deg = 0.5\n\
        elevation_reference_deg = 0.6\naxis1_sag_deg = 0.01\naxis2_sag_deg = 0.02\naxis2_eccentricity_deg = 0.03\naxis1_min_deg = -270\naxis1_max_deg = 270\n\
        axis2_min_deg = 0\naxis2_max_deg = 90\n";
    let loaded = Folder::of_field()
        .with("layout.csv", layout)
        .edited(&[], defaults)
        .load()
        .unwrap();
    let all = |row: usize| {
        let h = loaded.field.heliostats()[row];
        let (e, s, l) = (h.errors, h.pose_errors, h.limits);
        [
            e.pedestal_tilt_rad,
            e.pedestal_tilt_azimuth_rad,
            e.axis_nonorthogonality_rad,
            e.mirror_tilt_rad,
            e.azimuth_reference_rad,
            e.elevation_reference_rad,
            s.axis1_sag_rad,
            s.axis2_sag_rad,
            s.axis2_eccentricity_rad,
            l.axis1_min_rad,
            l.axis1_max_rad,
            l.axis2_min_rad,
            l.axis2_max_rad,
        ]
    };
    assert_eq!(
        all(0),
        [
            0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.01, 0.02, 0.03, -270.0, 270.0, 0.0, 90.0
        ]
        .map(radians)
    );
    assert_eq!(
        all(1),
        [
            1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 0.7, -0.8, -0.9, -400.0, 400.0, -10.0, 100.0
        ]
        .map(radians)
    );
    let offsets: Vec<f64> = loaded
        .field
        .heliostats()
        .iter()
        .map(|h| h.mirror_offset_m)
        .collect();
    assert_eq!(offsets, [0.2, 0.5, 0.2]);
    assert_eq!(loaded.target(0).unwrap().unwrap().0, "receiver");
    assert_eq!(loaded.target(1).unwrap().unwrap().0, "white");
    assert!(loaded.target(2).unwrap().is_none());
    assert_eq!(loaded.field.heliostats()[2].aim, Enu::new(7.0, 8.0, 9.0));
}

#[test]
fn every_mode_is_understood() {
    for (text, mode) in [
        (
            "mode = \"azimuth-elevation\"",
            TrackingMode::AzimuthElevation,
        ),
        (
            "mode = \"spinning-elevation\"",
            TrackingMode::SpinningElevation,
        ),
        (
            "mode = \"pitch-roll\"\naxis_azimuth_deg = 90",
            TrackingMode::PitchRoll {
                axis_azimuth_rad: radians(90.0),
            },
        ),
        (
            "mode = \"polar\"",
            TrackingMode::Polar {
                latitude_rad: radians(40.0),
            },
        ),
    ] {
        let loaded = Folder::of_field().edited(&[], text).load().unwrap();
        assert_eq!(loaded.field.mode(), mode);
    }
}

#[test]
fn no_site_is_needed_for_given_suns() {
    let toml = &FIELD[FIELD.find("[targets.receiver]").unwrap()..];
    assert!(
        Folder::of_field()
            .with("field.toml", toml)
            .load()
            .unwrap()
            .site
            .is_none()
    );
}

#[test]
fn inline_and_dotted_toml_are_the_same_toml() {
    let toml = "targets.receiver.centre_enu_m = [0, 0, 100]\n\
        heliostats = { table = 'layout.csv', aim = 'receiver', drive.axis1 = { type = 'encoder', steps_per_deg = 10 } }\n";
    let loaded = Folder::of_field().with("field.toml", toml).load().unwrap();
    assert!(loaded.drives[0][0].is_some());
}

#[test]
fn parquet_of_many_types_says_the_same_as_csv() {
    let ids: DictionaryArray<Int32Type> = vec!["A1", "A2", "A3"].into_iter().collect();
    let north = Int64Array::from(vec![80, 80, 80]);
    let up = Float32Array::from(vec![4.0, 4.0, 4.5]);
    let folder = Folder::of_field()
        .edited(&[("layout.csv", "layout.parquet")], "")
        .with_parquet(
            "layout.parquet",
            vec![
                ("id", Arc::new(ids) as ArrayRef),
                ("east_m", floats(&[10.0, 20.0, 30.0])),
                ("north_m", Arc::new(north)),
                ("up_m", Arc::new(up)),
                (
                    "mirror_tilt_deg",
                    arrow::array::new_null_array(&arrow::datatypes::DataType::Null, 3),
                ),
            ],
        );
    assert_eq!(
        folder.load().unwrap().field,
        Folder::of_field().load().unwrap().field
    );
    let folder = Folder::of_field()
        .edited(&[("layout.csv", "layout.parquet")], "")
        .with_parquet(
            "layout.parquet",
            vec![
                ("id", Arc::new(Int64Array::from(vec![7])) as ArrayRef),
                ("east_m", floats(&[10.0])),
                ("north_m", floats(&[10.0])),
                ("up_m", floats(&[10.0])),
            ],
        );
    assert_eq!(folder.load().unwrap().field.ids(), ["7"]);
}

fn steps(drive: &Option<Drive>, angle_deg: f64) -> f64 {
    drive.unwrap().steps(radians(angle_deg)).unwrap()
}

#[test]
fn drives_of_every_type_from_toml() {
    let drives = "[heliostats.drive.axis1]\ntype = \"encoder\"\nsteps_per_deg = 100\nzero_steps = 50\n\
        sign = -1\nmin_steps = -10000\nmax_steps = 10000\n\
        [heliostats.drive.axis2]\ntype = \"screw\"\narm_a_m = 0.4\narm_b_m = 0.5\nbracket_deg = 17\n\
        zero_length_m = 0.2\nsteps_per_m = 1000\n";
    let loaded = Folder::of_field().edited(&[], drives).load().unwrap();
    assert!(loaded.has_drives());
    let [encoder, screw] = &loaded.drives[1];
    assert!((steps(encoder, 2.0) + 150.0).abs() < 1e-9);
    let length = (0.41 + 0.4 * radians(57.0).cos()).sqrt();
    assert!((steps(screw, 40.0) - 1000.0 * (length - 0.2)).abs() < 1e-9);
    let limits = loaded.field.heliostats()[1].limits;
    assert!((limits.axis1_min_rad - radians(-99.5)).abs() < 1e-12);
    assert!((limits.axis1_max_rad - radians(100.5)).abs() < 1e-12);
    assert!((limits.axis2_min_rad - radians(-17.0)).abs() < 1e-12);
}

#[test]
fn a_counter_is_no_stop() {
    let drives = "[heliostats.drive.axis1]\ntype = \"encoder\"\nsteps_per_deg = 100\nmin_steps = 0\n\
        max_steps = 4294967295\n[heliostats.drive.axis2]\ntype = \"encoder\"\nsteps_per_deg = 100\n\
        min_steps = 0\nmax_steps = 4294967295\n";
    let limits = |stated: &str| {
        let loaded = Folder::of_field()
            .edited(&[], &format!("{stated}{drives}"))
            .load()
            .unwrap();
        let l = loaded.field.heliostats()[0].limits;
        [
            l.axis1_min_rad,
            l.axis1_max_rad,
            l.axis2_min_rad,
            l.axis2_max_rad,
        ]
    };
    let infinite = f64::INFINITY;
    assert_eq!(limits(""), [0.0, infinite, -infinite, infinite]);
    let stated =
        "axis1_min_deg = 90\naxis1_max_deg = 270\naxis2_min_deg = -5\naxis2_max_deg = 95\n";
    assert_eq!(limits(stated), [90.0, 270.0, -5.0, 95.0].map(radians));
}

#[test]
fn drives_from_a_table_fall_back_cell_by_cell() {
    let toml = "drives = \"drives.csv\"\naxis1_min_deg = -20\n\
        [heliostats.drive.axis1]\nsign = -1\nsteps_per_deg = 100\n\
        [heliostats.drive.axis2]\ntype = \"encoder\"\nsteps_per_deg = 7\n";
    let table = "heliostat,axis,type,steps_per_deg,max_steps\n\
        A1,1,encoder,,1000\nA2,1,encoder,200,\nA3,1,encoder,,\nZZ,1,encoder,1,\nA2,2,,8,\n";
    let loaded = Folder::of_field()
        .edited(&[], toml)
        .with("drives.csv", table)
        .load()
        .unwrap();
    let on = |row: usize, axis: usize| steps(&loaded.drives[row][axis], 1.0);
    let all: Vec<f64> = [(0, 0), (1, 0), (2, 0), (0, 1), (1, 1), (2, 1)]
        .map(|(row, axis)| on(row, axis).round())
        .to_vec();
    assert_eq!(all, [-100.0, -200.0, -100.0, 7.0, 8.0, 7.0]);
    let least: Vec<f64> = loaded
        .field
        .heliostats()
        .iter()
        .map(|h| h.limits.axis1_min_rad)
        .collect();
    // A1's drive ends at 1000 steps, which with sign -1 is -10°.
    assert!((least[0] - radians(-10.0)).abs() < 1e-12);
    assert_eq!(least[1], radians(-20.0));
}

#[test]
fn a_calibrated_pose_error_overrides_the_layouts_and_an_absent_one_leaves_it() {
    let of = |table: &str| {
        let loaded = Folder::of_field()
            .edited(&[], "axis2_sag_deg = 0.2\ncalibration = \"cal.csv\"\n")
            .with("cal.csv", table)
            .load()
            .unwrap();
        let heliostats = loaded.field.heliostats().iter();
        heliostats
            .map(|h| h.pose_errors.to_array())
            .collect::<Vec<_>>()
    };
    let layout = [0.0, radians(0.2), 0.0];
    // the column of axis 1 alone, a cell of it empty; tables of nothing else; none at all
    let both = "id,mirror_tilt_deg,axis1_sag_deg\nA1,0.1,-0.1\nA2,0.1,\n";
    assert_eq!(
        of(both),
        [[radians(-0.1), radians(0.2), 0.0], layout, layout]
    );
    let alone = "id,axis2_sag_deg\nA1,0.3\n";
    assert_eq!(of(alone), [[0.0, radians(0.3), 0.0], layout, layout]);
    let alone = "id,axis2_eccentricity_deg\nA3,-0.4\n";
    assert_eq!(
        of(alone),
        [layout, layout, [0.0, radians(0.2), radians(-0.4)]]
    );
    assert_eq!(of("id,mirror_tilt_deg\nA1,0.1\n"), [layout; 3]);
}

#[test]
fn a_constant_calibration_stands_in_the_field() {
    let table = "id,set,pedestal_tilt_deg,mirror_tilt_deg,mirror_offset_m,sigma_mirror_tilt_deg,\
        cov_a_b,rms_mrad,observations,status,version,valid_from,hour_angle_to_deg\n\
        A1,1,0.5,,0.3,0.1,0,1,9,ok,0.1,,\nA3,1,,,,,,,,singular,0.1,,\nZZ,1,1,,,,,,,,,,\n";
    let toml = "mirror_tilt_deg = 0.25\ncalibration = \"cal.csv\"\n";
    let loaded = Folder::of_field()
        .edited(&[], toml)
        .with("cal.csv", table)
        .load()
        .unwrap();
    assert!(loaded.schedule.is_none());
    let h = loaded.field.heliostats();
    assert_eq!(h[0].errors.pedestal_tilt_rad, radians(0.5));
    assert_eq!(h[0].errors.mirror_tilt_rad, radians(0.25));
    assert_eq!((h[0].mirror_offset_m, h[1].mirror_offset_m), (0.3, 0.2));
    assert_eq!(h[1].errors.mirror_tilt_rad, radians(0.25));
    assert_eq!(loaded.warnings.len(), 3, "{:?}", loaded.warnings);
    assert!(
        loaded.warnings[0]
            .ends_with("no calibration for 1 of 3 heliostats (A2); the layout's errors stay")
    );
}

#[test]
fn sets_by_hour_and_date_make_a_schedule() {
    let table = "id,set,mirror_tilt_deg,hour_angle_from_deg,hour_angle_to_deg,valid_from\n\
        A1,am,0.1,,10,2026-01-01T00:00:00+08:00\nA1,pm,0.3,10,,2026-01-01T00:00:00+08:00\n\
        A2,,0.5,,,\n";
    let toml = "calibration = \"cal.csv\"\nblend_deg = 10\n";
    let loaded = Folder::of_field()
        .edited(&[], toml)
        .with("cal.csv", table)
        .load()
        .unwrap();
    let schedule = loaded.schedule.unwrap();
    assert_eq!(schedule.varying_rows(), [0]);
    let now = helio_io::parse_time("2026-06-21T12:00:00Z").unwrap();
    let tilt = |row, time, hour_deg: f64| {
        schedule
            .heliostat_at(row, time, radians(hour_deg))
            .unwrap()
            .errors
            .mirror_tilt_rad
    };
    for (hour_deg, wanted_deg) in [(4.9, 0.1), (7.5, 0.15), (10.0, 0.2), (15.0, 0.3)] {
        let found = tilt(0, Some(now), hour_deg);
        assert!((found - radians(wanted_deg)).abs() < 1e-14, "{hour_deg}");
        assert_eq!(found, tilt(0, None, hour_deg));
    }
    assert_eq!(tilt(0, Some(0), 0.0), 0.0);
    assert_eq!(tilt(1, Some(0), 0.0), radians(0.5));
    assert_eq!(
        loaded.field.heliostats()[0].errors.mirror_tilt_rad,
        radians(0.1)
    );
}

#[test]
fn calibrations_in_parquet_with_real_times() {
    let from = TimestampMillisecondArray::from(vec![Some(1000), None]).with_timezone("+02:00");
    let sets: StringArray = vec![Some("a"), None].into_iter().collect();
    let folder = Folder::of_field()
        .edited(&[], "calibration = \"cal.parquet\"\n")
        .with_parquet(
            "cal.parquet",
            vec![
                ("id", texts(&["A1", "A2"])),
                ("set", Arc::new(sets) as ArrayRef),
                ("azimuth_reference_deg", floats(&[1.0, 2.0])),
                ("valid_from", Arc::new(from)),
            ],
        );
    let schedule = folder.load().unwrap().schedule.unwrap();
    let at = |ns| {
        schedule
            .heliostat_at(0, Some(ns), 0.0)
            .unwrap()
            .errors
            .azimuth_reference_rad
    };
    assert_eq!((at(999_999_999), at(1_000_000_000)), (0.0, radians(1.0)));
}

#[test]
fn tables_of_a_large_field_are_read() {
    let mut layout = String::from("id,east_m,north_m,up_m,mirror_offset_m\n");
    for row in 0..12_000 {
        layout += &format!(
            "H{row},{}.25,{}.125,{},0.2\n",
            row % 150,
            row / 150,
            row % 7
        );
    }
    let folder = Folder::of_field().with("layout.csv", layout);
    let field = folder.load().unwrap().field;
    assert_eq!(field.len(), 12_000);
    assert_eq!(field.ids()[11_999], "H11999");
}
