//! Real layouts: every heliostat of Dunhuang and NSTTF sends its beam to its aim.

#![allow(
    clippy::unwrap_used,
    clippy::print_stderr,
    reason = "tests fail and talk"
)]

use std::path::Path;

use helio_core::{EnuUnit, OffsetForm, Status, TrackOptions, Tracker, Tracking};
use helio_tests::dd::Dd3;
use helio_tests::{V3, Worst, data, mount};

/// Loads a field whose table is one of the shared files.
fn load(name: &str, toml: &str) -> helio_io::LoadedField {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join(format!("{name}.toml"));
    std::fs::write(&path, toml).unwrap();
    helio_io::load_field(&path).unwrap_or_else(|error| panic!("{error}"))
}

fn quoted(path: &Path) -> String {
    path.display().to_string().replace('\\', "/")
}

/// Tracks some suns and follows every beam.
fn check(loaded: &helio_io::LoadedField, ok_at_least: f64) {
    let field = &loaded.field;
    let tracker = Tracker::new(field, OffsetForm::Exact).unwrap();
    let suns: Vec<EnuUnit> = [
        (62.0, 2.0),
        (90.0, 25.0),
        (130.0, 60.0),
        (180.0, 73.0),
        (250.0, 40.0),
        (290.0, 8.0),
    ]
    .iter()
    .map(|&(a, e): &(f64, f64)| EnuUnit::from_azimuth_elevation(a.to_radians(), e.to_radians()))
    .collect();
    let mut got = Tracking::default();
    tracker
        .track_into(&suns, None, &TrackOptions::default(), &mut got)
        .unwrap();
    let (mut miss, mut turning) = (Worst::default(), Worst::default());
    let mut ok = 0;
    for (index, sun) in suns.iter().enumerate() {
        let rows = got.rows_of_sun(index);
        let status = &got.status()[rows.clone()];
        let axes = (&got.axis1_rad()[rows.clone()], &got.axis2_rad()[rows]);
        let plain = |column: &[f64]| -> Vec<f64> {
            column
                .iter()
                .map(|a| if a.is_nan() { 0.0 } else { *a })
                .collect()
        };
        let normals = tracker.forward(&plain(axes.0), &plain(axes.1)).unwrap();
        let s = V3::from(*sun);
        for (row, h) in field.heliostats().iter().enumerate() {
            if status[row] != Status::Ok {
                assert!(axes.0[row].is_nan());
                continue;
            }
            ok += 1;
            let n = V3::from(normals[row]);
            let place = || format!("{} sun {index}", field.ids()[row]);
            let to_aim = V3::from(h.aim) - V3::from(h.pivot);
            let by_axes = mount::forward(
                field.mode(),
                Dd3::new(to_aim),
                &h.errors,
                axes.0[row],
                axes.1[row],
            );
            turning.see(by_axes.distance_to(n), place);
            let beam = n * (2.0 * s.dot(n)) - s;
            let from_mirror = to_aim - n * h.mirror_offset_m;
            assert!(beam.dot(from_mirror) > 0.0, "{}", place());
            miss.see(from_mirror.cross(beam).norm(), place);
        }
    }
    let rows = suns.len() * field.len();
    eprintln!("{} heliostats, {ok} of {rows} rows ok", field.len());
    eprintln!("beam misses the aim by {miss} m; normal off its turning by {turning}");
    assert!(ok as f64 >= ok_at_least * rows as f64);
    assert!(miss.value < 1e-9 && turning.value < 2e-15);
}

#[test]
fn dunhuang() {
    let Some(folder) = data::folder("dunhuang") else {
        return;
    };
    let table = folder.join("dunhuang/layout.csv");
    let toml = format!(
        r#"
        [site]
        name = "Dunhuang"
        latitude_deg = 40.063
        longitude_deg = 94.426
        elevation_m = 1100
        [targets.receiver]
        centre_enu_m = [0, 0, 229.3]
        [heliostats]
        table = "{}"
        aim = "receiver"
        mirror_offset_m = 0.3
        up_offset_m = 6
        pedestal_tilt_deg = 0.1
        pedestal_tilt_azimuth_deg = 77
        axis_nonorthogonality_deg = -0.05
        mirror_tilt_deg = 0.08
        azimuth_reference_deg = 1.5
        elevation_reference_deg = -0.7
        [heliostats.columns]
        id = "heliostat"
        east_m = "x_m"
        north_m = "y_m"
        up_m = "z_m"
        "#,
        quoted(&table)
    );
    let loaded = load("dunhuang", &toml);
    assert_eq!(loaded.field.len(), 11_915);
    // the first row of the table, as it stands there, on its pedestal
    let first = V3::from(loaded.field.heliostats()[0].pivot);
    assert!(
        (first - V3(1323.49, -906.255, 6.0 - 3.604_75)).norm() < 1e-9,
        "{first:?}"
    );
    check(&loaded, 0.999);
}

#[test]
fn nsttf() {
    let Some(folder) = data::folder("nsttf") else {
        return;
    };
    let table = folder.join("nsttf/NSTTF_Heliostats_origin_at_torque_tube.csv");
    let toml = format!(
        r#"
        [site]
        name = "NSTTF"
        latitude_deg = 34.962276
        longitude_deg = -106.509606
        elevation_m = 1700
        [targets.tower]
        centre_enu_m = [0, 0, 60]
        [heliostats]
        table = "{}"
        aim = "tower"
        ignore = ["Num. Facets", "Num. Rows", "Num. Cols", "Pivot Height", "Facet Width", "Facet Height", "Focal Length"]
        [heliostats.columns]
        id = "Name"
        east_m = "X"
        north_m = "Y"
        up_m = "Z"
        mirror_offset_m = "Pivot Offset"
        "#,
        quoted(&table)
    );
    let loaded = load("nsttf", &toml);
    assert_eq!(loaded.field.len(), 218);
    assert_eq!(loaded.field.ids()[0], "5E10");
    assert!(
        loaded
            .field
            .heliostats()
            .iter()
            .all(|h| h.mirror_offset_m == 0.1778)
    );
    check(&loaded, 1.0);
}
