//! Real tables of other people, read through the TOML alone. They are found by the environment
//! variable HELIO_DATA, the folder of the shared data; without it these tests are skipped.

use std::path::{Path, PathBuf};

use helio_core::angle::{degrees, radians};
use helio_core::mount::MountAxes;
use helio_core::{EnuUnit, TrackingMode};
use helio_io::LoadedField;

use crate::files::Folder;

fn data() -> Option<PathBuf> {
    let Some(folder) = std::env::var_os("HELIO_DATA") else {
        println!("skipped: HELIO_DATA is not set");
        return None;
    };
    Some(std::fs::canonicalize(folder).unwrap())
}

fn load(data: &Path, toml: &str) -> LoadedField {
    let toml = toml.replace("DATA", &data.display().to_string());
    let folder = Folder::new().with("field.toml", toml);
    folder.load().unwrap_or_else(|error| panic!("{error}"))
}

#[test]
fn dunhuang() {
    let Some(data) = data() else { return };
    let toml = r#"
        [site]
        name = "Dunhuang"
        latitude_deg = 40.063
        longitude_deg = 94.426
        elevation_m = 1140
        [targets.receiver]
        centre_enu_m = [0, 0, 229.3]
        [heliostats]
        table = "DATA/dunhuang/layout.csv"
        aim = "receiver"
        up_offset_m = 6.0
        columns = { id = "heliostat", east_m = "x_m", north_m = "y_m", up_m = "z_m" }
    "#;
    let start = std::time::Instant::now();
    let loaded = load(&data, toml);
    println!(
        "dunhuang: {} heliostats in {:?}",
        loaded.field.len(),
        start.elapsed()
    );
    assert_eq!(loaded.field.len(), 11_915);
    let pivot = loaded.field.heliostats()[1].pivot;
    assert_eq!(
        (pivot.east, pivot.north, pivot.up),
        (1720.95, 633.42, -14.546769230769542 + 6.0)
    );
    assert_eq!(loaded.field.ids()[1], "2");
}

#[test]
fn nsttf() {
    let Some(data) = data() else { return };
    let toml = r#"
        [site]
        latitude_deg = 34.962276
        longitude_deg = -106.509606
        elevation_m = 1700
        [targets.tower]
        centre_enu_m = [0, 0, 60]
        [heliostats]
        table = "DATA/nsttf/NSTTF_Heliostats_origin_at_torque_tube.csv"
        aim = "tower"
        columns = { id = "Name", east_m = "X", north_m = "Y", up_m = "Z", mirror_offset_m = "Pivot Offset" }
        ignore = ["Num. Facets", "Num. Rows", "Num. Cols", "Pivot Height", "Facet Width", "Facet Height", "Focal Length"]
    "#;
    let loaded = load(&data, toml);
    assert_eq!(loaded.field.len(), 218);
    let row = loaded.field.row_of("5E10").unwrap();
    let heliostat = loaded.field.heliostats()[row];
    assert_eq!(
        (heliostat.pivot.east, heliostat.mirror_offset_m),
        (92.61, 0.1778)
    );
}

const JUELICH: &str = r#"
    [site]
    name = "Jülich"
    latitude_deg = 50.9134
    longitude_deg = 6.3878
    elevation_m = 87
    [targets.tower]
    centre_enu_m = [0, 0, 35]
    [heliostats]
    table = "DATA/juelich/calibration/heliostats.csv"
    aim = "tower"
    drives = "DATA/juelich/calibration/actuators.csv"
    mode = "pitch-roll"
    axis_azimuth_deg = 90
    columns = { id = "heliostat", mirror_offset_m = "mirror_pivot_offset_m" }
    ignore = ["lat_deg", "lon_deg", "height_m", "mirror_width_m", "mirror_height_m", "facets", "canting", "renovation"]
    # The mount's axis 1 grows the other way than the actuator's angle: gamma = -t1.
    [heliostats.drive.axis1]
    sign = -1
"#;

#[test]
fn juelich() {
    let Some(data) = data() else { return };
    let loaded = load(&data, JUELICH);
    assert_eq!(loaded.field.len(), 13);
    assert_eq!(
        loaded.field.mode(),
        TrackingMode::PitchRoll {
            axis_azimuth_rad: radians(90.0)
        }
    );
    // BF57: the steps end before the stops do, except at the upper end of axis 2's angle.
    let row = loaded.field.row_of("BF57").unwrap();
    let limits = loaded.field.heliostats()[row].limits;
    let triangle = |o: f64, p: f64, s: f64| ((o * o + p * p - s * s) / (2.0 * o * p)).acos();
    let growth = |o: f64, p: f64, s0: f64, steps: f64| {
        triangle(o, p, s0 + steps / 154166.6667) - triangle(o, p, s0)
    };
    let t1_max = 0.028190461 + growth(0.335308, 0.338095, 0.076773774, 66156.0);
    let t2_min = 0.931417847 - growth(0.340771, 0.3191, 0.076541364, 76112.0);
    for (found, wanted) in [
        (
            limits.axis1_min_rad,
            -t1_max.min(std::f64::consts::FRAC_PI_2),
        ),
        (limits.axis1_max_rad, -0.028190461),
        (limits.axis2_min_rad, t2_min.max(-0.95993)),
        (limits.axis2_max_rad, 0.931417847),
    ] {
        assert!((found - wanted).abs() < 1e-9, "{found} {wanted}");
    }
}

/// The record that the data's read-me works through: motor steps to the normal.
#[test]
fn juelich_record_118585() {
    let Some(data) = data() else { return };
    let loaded = load(&data, JUELICH);
    let records = std::fs::read_to_string(data.join("juelich/calibration/BF57.csv")).unwrap();
    let header: Vec<&str> = records.lines().next().unwrap().split(',').collect();
    let record: Vec<&str> = records
        .lines()
        .find(|line| line.starts_with("118585,"))
        .unwrap()
        .split(',')
        .collect();
    let cell = |name: &str| -> f64 {
        record[header.iter().position(|known| *known == name).unwrap()]
            .parse()
            .unwrap()
    };
    let row = loaded.field.row_of("BF57").unwrap();
    let [axis1, axis2] = loaded.drives[row].map(|drive| drive.unwrap());
    let gamma = axis1.angle_rad(cell("axis1_steps")).unwrap();
    let alpha = axis2.angle_rad(cell("axis2_steps")).unwrap();
    assert!(
        (degrees(gamma) + 53.767015).abs() < 1e-6,
        "{}",
        degrees(gamma)
    );
    assert!(
        (degrees(alpha) + 18.916717).abs() < 1e-6,
        "{}",
        degrees(alpha)
    );
    let mount = MountAxes::of(loaded.field.mode(), EnuUnit::UP);
    let normal = mount.axis1 * (alpha.cos() * gamma.cos())
        + mount.axis2 * (alpha.cos() * gamma.sin())
        + mount.axis3 * alpha.sin();
    for (found, wanted) in [
        (normal.east, -0.324193),
        (normal.north, -0.763055),
        (normal.up, 0.559147),
    ] {
        assert!((found - wanted).abs() < 1e-6, "{normal:?}");
    }
}
