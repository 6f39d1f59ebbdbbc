//! The small tables.

use helio_core::angle::radians;
use helio_io::{AnglesSun, load_angles, load_present, load_suns};

use crate::files::{Folder, floats};

#[test]
fn suns_under_both_names_and_in_parquet() {
    let folder = Folder::new()
        .with("a.csv", "elevation_deg,azimuth_deg\n20,10\n-5,350\n")
        .with(
            "b.csv",
            "sun_azimuth_deg,sun_elevation_deg\n10,20\n350,-5\n",
        )
        .with_parquet(
            "c.parquet",
            vec![
                ("azimuth_deg", floats(&[10.0, 350.0])),
                ("elevation_deg", floats(&[20.0, -5.0])),
            ],
        );
    for name in ["a.csv", "b.csv", "c.parquet"] {
        let suns = load_suns(&folder.path(name)).unwrap();
        assert_eq!(suns.azimuth_rad, [10.0, 350.0].map(radians));
        assert_eq!(suns.elevation_rad, [20.0, -5.0].map(radians));
    }
}

#[test]
fn present_angles_come_in_field_order() {
    let loaded = Folder::of_field().load().unwrap();
    let text = "time,id,azimuth_deg,elevation_deg,incidence_deg,limit_excess_deg,status,axis1_steps,axis2_steps\n\
        2026-06-21T12:00:00Z,A3,400,20,1,0,ok,5,6\n2026-06-21T12:00:00Z,A1,,,,,unreachable,,\n";
    let folder = Folder::new().with("now.csv", text);
    let present = load_present(&folder.path("now.csv"), &loaded.field).unwrap();
    assert!(present.axis1_rad[0].is_nan() && present.axis2_rad[1].is_nan());
    assert_eq!(
        (present.axis1_rad[2], present.axis2_rad[2]),
        (radians(400.0), radians(20.0))
    );
}

#[test]
fn the_axes_stand_where_the_last_sun_left_them() {
    let loaded = Folder::of_field().load().unwrap();
    let text = "time,id,azimuth_deg,elevation_deg,beam_error_mrad,status\n\
        2026-06-21T12:00:00Z,A1,10,20,0.1,ok\n2026-06-21T12:00:00Z,A2,30,40,,ok\n\
        2026-06-21T13:00:00Z,A1,50,60,0.1,ok\n2026-06-21T13:00:00Z,A2,,,,misses_target\n";
    let folder = Folder::new().with("now.csv", text);
    let present = load_present(&folder.path("now.csv"), &loaded.field).unwrap();
    assert_eq!(present.axis1_rad[..2], [50.0, 30.0].map(radians));
    assert_eq!(present.axis2_rad[..2], [60.0, 40.0].map(radians));
}

#[test]
fn angles_as_degrees_as_steps_and_as_track_wrote_them() {
    let drives = "[heliostats.drive.axis1]\ntype = \"encoder\"\nsteps_per_deg = 100\n\
        [heliostats.drive.axis2]\ntype = \"encoder\"\nsteps_per_deg = 200\n";
    let loaded = Folder::of_field().edited(&[], drives).load().unwrap();
    let folder = Folder::new()
        .with("steps.csv", "id,axis1_steps,axis2_steps\nA2,1000,2000\n")
        .with(
            "degrees.csv",
            "id,axis1_deg,axis2_deg,time,sun_azimuth_deg,sun_elevation_deg\nA2,10,10,,180,30\n",
        )
        .with(
            "both.csv",
            "id,axis1_deg,axis2_deg,time,sun_azimuth_deg,sun_elevation_deg\n\
             A2,10,10,1970-01-01T00:00:01Z,180,30\n",
        )
        .with(
            "track.csv",
            "time,id,azimuth_deg,elevation_deg,incidence_deg,limit_excess_deg,status\n\
             1970-01-01T00:00:01Z,A2,10,10,5,0,ok\n1970-01-01T00:00:01Z,A3,,,,,unreachable\n",
        );
    let read = |name: &str| load_angles(&folder.path(name), &loaded).unwrap();
    for name in ["steps.csv", "degrees.csv", "track.csv"] {
        let angles = read(name);
        assert_eq!(angles.heliostat, [1]);
        assert!((angles.axis1_rad[0] - radians(10.0)).abs() < 1e-15);
        assert!((angles.axis2_rad[0] - radians(10.0)).abs() < 1e-15);
    }
    assert_eq!(read("steps.csv").sun, AnglesSun::Unstated);
    assert_eq!(
        read("track.csv").sun,
        AnglesSun::Times {
            unix_ns: vec![1_000_000_000]
        }
    );
    assert_eq!(read("track.csv").skipped, 1);
    for (name, unused) in [("degrees.csv", false), ("both.csv", true)] {
        let angles = read(name);
        assert_eq!(angles.times_unused, unused, "{name}");
        let AnglesSun::Angles(suns) = angles.sun else {
            panic!()
        };
        assert_eq!(suns.azimuth_rad, [radians(180.0)]);
    }
}
