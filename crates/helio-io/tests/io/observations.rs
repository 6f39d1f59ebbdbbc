//! Tables of observations: what is understood, and what is said about the rest.

use std::fmt::Write as _;
use std::sync::Arc;

use arrow::array::{ArrayRef, TimestampNanosecondArray};
use helio_core::Field;
use helio_core::angle::{degrees, radians};
use helio_core::error::FieldError;
use helio_io::{IoError, LeftAsideReason, Observations, load_observations};

use crate::files::{FIELD, Folder, floats, texts};

const DRIVES: &str = "
[heliostats.drive.axis1]
type = \"encoder\"
steps_per_deg = 1000
[heliostats.drive.axis2]
type = \"encoder\"
steps_per_deg = 500
zero_steps = 100
";

const SEEN: &str = "heliostat_id,time,axis1_deg,axis2_deg,target,u_m,v_m,sigma_m
A1,2026-06-21T06:00:00Z,170.5,40.25,white,0.5,-0.25,0.02
A2,2026-06-21T08:00:00+02:00,171.5,41.25,white,0.1,0.2,
A1,2026-06-21T07:00:00Z,172.5,42.25,white,-0.5,0.75,0.03
";

fn seen(table: &str) -> Folder {
    Folder::of_field().with("seen.csv", table)
}

fn load(folder: &Folder) -> Result<Observations, IoError> {
    load_observations(&folder.path("seen.csv"), &folder.load()?)
}

#[test]
fn a_table_is_understood() {
    let observed = load(&seen(SEEN)).unwrap();
    assert_eq!((observed.records, observed.len()), (3, 3));
    assert_eq!(observed.targets.len(), 1);
    assert_eq!(observed.targets[0].0, "white");
    let rows: Vec<usize> = observed.heliostats.iter().map(|h| h.row).collect();
    assert_eq!(rows, [0, 1]);
    let a1 = &observed.heliostats[0];
    assert_eq!(a1.records, [0, 2]);
    assert_eq!(observed.position(a1.records[1]).unwrap(), "line 4");
    let first = &a1.observations[0];
    assert_eq!(
        (first.axis1_rad, first.axis2_rad),
        (radians(170.5), radians(40.25))
    );
    assert_eq!(
        (first.u_m, first.v_m, first.sigma_m),
        (0.5, -0.25, Some(0.02))
    );
    assert_eq!(first.unix_ns, Some(1_782_021_600_000_000_000));
    let a2 = &observed.heliostats[1].observations[0];
    assert_eq!((a2.unix_ns, a2.sigma_m), (first.unix_ns, None));
    assert_eq!(a2.sun, first.sun);
    // Noon at 94.4° east is at about 5:44 UTC in June: shortly after, the sun is high in the south.
    assert!(degrees(first.sun.elevation_rad()) > 70.0);
    let hour_deg = degrees(first.hour_angle_rad.unwrap());
    assert!((3.0..5.0).contains(&hour_deg), "{hour_deg}");
    assert!(observed.warnings.is_empty() && observed.left_aside.is_empty());
}

#[test]
fn every_spelling_says_the_same() {
    let expected = load(&seen(SEEN)).unwrap();
    let same = |folder: &Folder| {
        let observed = load(folder).unwrap();
        assert_eq!(observed.heliostats.len(), expected.heliostats.len());
        for (one, other) in observed.heliostats.iter().zip(&expected.heliostats) {
            assert_eq!(one.observations, other.observations);
        }
    };
    same(&seen(
        &SEEN
            .replace("heliostat_id", "id")
            .replace("axis1", "azimuth")
            .replace("axis2", "elevation"),
    ));
    // The heliostats' own target, where the record names none.
    let own = FIELD.replace("aim = \"receiver\"", "aim = \"white\"");
    let table = SEEN.replace(",target", "").replace(",white", "");
    same(&seen(&table).with("field.toml", own));
    // A foreign table.
    let foreign = SEEN
        .replace("heliostat_id", "Name")
        .replace("u_m", "x")
        .replace('\n', ",7\n");
    let naming =
        "[observations]\ncolumns = { heliostat_id = \"Name\", u_m = \"x\" }\nignore = [\"7\"]\n";
    same(&seen(&foreign).edited(&[], naming));
    // Motor steps.
    let mut steps = SEEN.replace("_deg", "_steps");
    for (angle, count) in [
        ("170.5", "170500"),
        ("171.5", "171500"),
        ("172.5", "172500"),
        ("40.25", "20225"),
        ("41.25", "20725"),
        ("42.25", "21225"),
    ] {
        steps = steps.replace(angle, count);
    }
    let folder = seen(&steps).edited(&[], DRIVES);
    let observed = load(&folder).unwrap();
    let off = observed.heliostats[0].observations[1].axis2_rad - radians(42.25);
    assert!(off.abs() < 1e-15);
    // Parquet.
    let times = TimestampNanosecondArray::from(
        [0, 0, 3600]
            .map(|later: i64| (1_782_021_600 + later) * 1_000_000_000)
            .to_vec(),
    )
    .with_timezone("UTC");
    let times: ArrayRef = Arc::new(times);
    let folder = Folder::of_field().with_parquet(
        "seen.csv",
        vec![
            ("heliostat_id", texts(&["A1", "A2", "A1"])),
            ("time", times),
            ("axis1_deg", floats(&[170.5, 171.5, 172.5])),
            ("axis2_deg", floats(&[40.25, 41.25, 42.25])),
            ("target", texts(&["white"; 3])),
            ("u_m", floats(&[0.5, 0.1, -0.5])),
            ("v_m", floats(&[-0.25, 0.2, 0.75])),
        ],
    );
    let observed = load(&folder).unwrap();
    assert_eq!(observed.position(2).unwrap(), "row 3");
    assert_eq!(
        observed.heliostats[0].observations[1].sun,
        expected.heliostats[0].observations[1].sun
    );
}

#[test]
fn a_spot_said_twice_is_one_to_rounding() {
    let observed = load(&seen(SEEN)).unwrap();
    let plane = observed.targets[0].1;
    // The points of the same spots, to the centimetre; the last row leaves its point out.
    let twice = |off_m: f64| -> String {
        let spots = [(0.5, -0.25), (0.1, 0.2), (-0.5, 0.75)];
        let mut table = String::new();
        for (k, line) in SEEN.lines().enumerate() {
            table += line;
            match k {
                0 => table += ",spot_east_m,spot_north_m,spot_up_m",
                3 => table += ",,,",
                _ => {
                    let (u_m, v_m) = spots[k - 1];
                    let point = plane.point(u_m, v_m + off_m);
                    let round = |x: f64| (x * 100.0).round() / 100.0;
                    let [east, north, up] = [point.east, point.north, point.up].map(round);
                    write!(table, ",{east},{north},{up}").unwrap();
                }
            }
            table.push('\n');
        }
        table
    };
    let both = load(&seen(&twice(0.0))).unwrap();
    for (one, other) in both.heliostats.iter().zip(&observed.heliostats) {
        assert_eq!(one.observations, other.observations);
    }
    let said = load(&seen(&twice(0.03))).unwrap_err().to_string();
    for word in [
        "seen.csv:2: heliostat `A1`: two spots 0.0",
        "u_m",
        "v_m",
        "spot_up_m",
    ] {
        assert!(said.contains(word), "{word}: {said}");
    }
}

#[test]
fn sigmas_are_for_all_of_a_heliostat_or_for_none() {
    // Of A1 all, of A2 none: each is a fit of its own.
    load(&seen(SEEN)).unwrap();
    // A record without a spot needs none; one with a spot does.
    let without = "A1,2026-06-21T05:00:00Z,172.5,42.25,white,,,\n";
    assert_eq!(load(&seen(&format!("{SEEN}{without}"))).unwrap().len(), 3);
    let spot = without.replace("white,,", "white,0.1,0.1");
    let said = load(&seen(&format!("{SEEN}{spot}")))
        .unwrap_err()
        .to_string();
    assert!(
        said.contains(
            "seen.csv:5: heliostat `A1`: column `sigma_m`: empty, though 2 of the 3 observations"
        ),
        "{said}"
    );
}

#[test]
fn points_are_moved_onto_their_plane() {
    // White stands at (0, 2, 60) and faces north: right is west.
    let table = "id,sun_azimuth_deg,sun_elevation_deg,axis1_deg,axis2_deg,target,spot_east_m,spot_north_m,spot_up_m\n\
                 A1,180,50,1,2,white,0.5,2.004,59.25\n\
                 A1,181,50,1,2,white,0.5,2.3,59.25\n";
    let observed = load(&seen(table)).unwrap();
    for observation in &observed.heliostats[0].observations {
        assert!((observation.u_m + 0.5).abs() < 1e-12 && (observation.v_m - 0.75).abs() < 1e-12);
    }
    assert_eq!(observed.warnings.len(), 1);
    let said = &observed.warnings[0];
    assert!(
        said.contains("1 of 2 spots") && said.contains("(line 3) 0.300 m before"),
        "{said}"
    );
}

#[test]
fn records_without_use_are_listed_and_nothing_is_lost() {
    let table = "record_id,id,time,axis1_deg,axis2_deg,target,u_m,v_m\n\
                 7,A1,2026-06-21T06:00:00Z,1,2,white,0.5,0.5\n\
                 8,A1,2026-06-21T20:00:00Z,1,2,white,0.5,0.5\n\
                 9,A1,2026-06-21T06:00:00Z,1,2,white,0.5,0.5\n\
                 10,A1,2026-06-21T06:30:00Z,1,2,white,,\n\
                 11,A1,2026-06-21T06:00:00Z,1,2,white,0.5,0.6\n";
    let observed = load(&seen(table)).unwrap();
    let why: Vec<_> = observed
        .left_aside
        .iter()
        .map(|aside| (aside.record, aside.reason))
        .collect();
    assert_eq!(
        why,
        [
            (1, LeftAsideReason::SunBelowHorizon),
            (2, LeftAsideReason::Duplicate { of: 0 }),
            (3, LeftAsideReason::NoSpot),
        ]
    );
    assert_eq!(observed.heliostats[0].records, [0, 4]);
    assert_eq!(observed.record_id(4), Some("11"));
    assert_eq!(observed.warnings.len(), 3);
    assert_eq!(observed.len() + observed.left_aside.len(), observed.records);
}

#[test]
fn records_of_a_time_still_to_come_are_left_aside() {
    let table = "id,time,axis1_deg,axis2_deg,target,u_m,v_m\n\
                 A1,2026-06-21T06:00:00Z,1,2,white,0.5,0.5\n\
                 A1,2226-06-21T06:00:00Z,1,2,white,0.5,0.5\n\
                 A1,2026-06-21T20:00:00Z,1,2,white,0.5,0.5\n\
                 A1,2026-06-21T07:00:00Z,1,2,white,0.5,0.5\n";
    let mut observed = load(&seen(table)).unwrap();
    let time = |record: usize| observed.heliostats[0].observations[record].unix_ns.unwrap();
    let (morning, later) = (time(0), time(2));
    // made at that very time is not after it
    assert_eq!(observed.leave_aside_after(later).unwrap(), 1);
    assert_eq!(observed.leave_aside_after(later).unwrap(), 0);
    let why: Vec<_> = observed
        .left_aside
        .iter()
        .map(|aside| (aside.record, aside.reason))
        .collect();
    assert_eq!(
        why,
        [
            (1, LeftAsideReason::InFuture),
            (2, LeftAsideReason::SunBelowHorizon),
        ]
    );
    assert_eq!(observed.heliostats[0].records, [0, 3]);
    assert_eq!(observed.warnings.len(), 2);
    let said = &observed.warnings[1];
    assert!(said.contains("left aside: 1 (first: line 3)"), "{said}");
    assert_eq!(observed.len() + observed.left_aside.len(), observed.records);
    assert_eq!(observed.leave_aside_after(morning - 1).unwrap(), 2);
    assert!(observed.is_empty());
}

#[test]
fn bad_tables_are_refused_in_good_words() {
    let mut said = String::new();
    let mut case = |title: &str, folder: Folder| {
        let error = load(&folder).expect_err(title);
        writeln!(said, "# {title}\n{}\n", folder.redact(&error)).unwrap();
    };
    let edit = |from: &str, to: &str| {
        assert!(SEEN.contains(from), "{from}");
        seen(&SEEN.replacen(from, to, 1))
    };
    case("no such file", Folder::of_field());
    case("empty", seen(""));
    case("no rows", seen(SEEN.lines().next().unwrap()));
    case("a foreign separator", seen(&SEEN.replace(',', ";")));
    case("ragged", edit(",0.1,0.2,\n", ",0.1,0.2\n"));
    case("unknown column", edit("sigma_m", "sigma"));
    case("unknown column, nothing near", edit("sigma_m", "colour"));
    case("no heliostat", edit("heliostat_id", "record_id"));
    case("no time", seen(&SEEN.replace("time", "record_id")));
    case(
        "no axes",
        seen("id,time,target,u_m,v_m\nA1,2026-06-21T06:00:00Z,white,0,0\n"),
    );
    case("one axis", edit("axis2_deg", "record_id"));
    case(
        "no spot",
        seen("id,time,axis1_deg,axis2_deg\nA1,2026-06-21T06:00:00Z,1,2\n"),
    );
    case(
        "half a spot",
        seen("id,time,axis1_deg,axis2_deg,u_m\nA1,2026-06-21T06:00:00Z,1,2,0\n"),
    );
    case(
        "half a point",
        seen(
            "id,time,axis1_deg,axis2_deg,spot_east_m,spot_up_m\nA1,2026-06-21T06:00:00Z,1,2,0,0\n",
        ),
    );
    case(
        "half the sun",
        seen("id,sun_azimuth_deg,axis1_deg,axis2_deg,u_m,v_m\nA1,1,1,2,0,0\n"),
    );
    case("both names of a column", edit("target", "azimuth_deg"));
    case("unknown heliostat", edit("A2", "A22"));
    case("unknown heliostat, nothing near", edit("A2", "mirror"));
    case("empty heliostat", edit("A2", ""));
    case("unknown target", edit("41.25,white", "41.25,whit"));
    case(
        "unknown target, nothing near",
        edit("41.25,white", "41.25,tower"),
    );
    case(
        "a mere point as target",
        edit("41.25,white", "41.25,receiver"),
    );
    case(
        "no target, and a mere point to aim at",
        edit("41.25,white", "41.25,"),
    );
    case("time without an offset", edit("06:00:00Z", "06:00:00"));
    case("no time at all", edit("2026-06-21T06:00:00Z", "noon"));
    case("date only", edit("2026-06-21T06:00:00Z", "2026-06-21"));
    case("empty time", edit("2026-06-21T06:00:00Z", ""));
    let site =
        "[site]\nname = \"Test\"\nlatitude_deg = 40.0\nlongitude_deg = 94.4\nelevation_m = 1100\n";
    case("time without a site", seen(SEEN).edited(&[(site, "")], ""));
    case("text for a number", edit("170.5", "high"));
    case("comma for a point", edit("170.5", "\"170,5\""));
    case("not a number", edit("170.5", "NaN"));
    case("infinite", edit("0.75", "inf"));
    case("empty angle", edit("170.5", ""));
    case("no angles", edit("170.5,40.25", ","));
    case("steps for degrees", edit("170.5", "53767"));
    case("half a spot in a row", edit("0.5,-0.25", "0.5,"));
    case("far spot", edit("0.5,-0.25", "50000,0"));
    case("sigma zero", edit("0.02", "0"));
    case("sigma negative", edit("0.02", "-0.02"));
    case("sigma not a number", edit("0.02", "NaN"));
    let suns = |rows: &str| {
        seen(&format!(
            "id,sun_azimuth_deg,sun_elevation_deg,axis1_deg,axis2_deg,target,u_m,v_m\n{rows}"
        ))
    };
    case("sun beyond a turn", suns("A1,400,30,1,2,white,0,0\n"));
    case("sun beyond the zenith", suns("A1,180,95,1,2,white,0,0\n"));
    case("half a sun in a row", suns("A1,180,,1,2,white,0,0\n"));
    case("no sun in a row", suns("A1,,,1,2,white,0,0\n"));
    case(
        "a column counted from south",
        seen(
            "id,sun_azimuth_south_deg,sun_elevation_deg,axis1_deg,axis2_deg,u_m,v_m\nA1,1,30,1,2,0,0\n",
        ),
    );
    let point = |row: &str| {
        seen(&format!(
            "id,sun_azimuth_deg,sun_elevation_deg,axis1_deg,axis2_deg,target,spot_east_m,spot_north_m,spot_up_m\n{row}\n"
        ))
    };
    case(
        "a spot behind its target",
        point("A1,180,40,1,2,white,0.5,-30,59"),
    );
    let black = "[targets.black]\ncentre_enu_m = [0, -30, 60]\nnormal_enu = [0, 1, 0]\nwidth_m = 8\nheight_m = 6\n";
    case(
        "a spot on another target",
        point("A1,180,40,1,2,white,0.5,-30,59").edited(&[], black),
    );
    case("a point that lacks up", point("A1,180,40,1,2,white,0.5,2,"));
    let steps = |one: &str| {
        seen(&format!(
            "id,sun_azimuth_deg,sun_elevation_deg,axis1_steps,axis2_steps,target,u_m,v_m\nA1,180,40,{one},100,white,0,0\n"
        ))
    };
    case("steps without a drive", steps("1000"));
    case(
        "steps beyond the drive",
        steps("1000").edited(
            &[],
            &DRIVES.replace("= 1000\n", "= 1000\nmax_steps = 500\n"),
        ),
    );
    case(
        "a foreign name that is not there",
        seen(SEEN).edited(&[], "[observations.columns]\nu_m = \"x\"\n"),
    );
    case(
        "an ignored name that is not there",
        seen(SEEN).edited(&[], "[observations]\nignore = [\"sigma\"]\n"),
    );
    case(
        "one foreign name for two",
        seen(SEEN).edited(&[], "[observations.columns]\nu_m = \"x\"\nv_m = \"x\"\n"),
    );
    case(
        "an unknown name of ours",
        seen(SEEN).edited(&[], "[observations.columns]\nu = \"x\"\n"),
    );
    case(
        "an unknown key",
        seen(SEEN).edited(&[], "[observations]\ncolumn = 1\n"),
    );
    let folder = Folder::of_field().with_parquet(
        "seen.csv",
        vec![
            ("heliostat_id", texts(&["A1", "A7"])),
            ("time", texts(&["2026-06-21T06:00:00Z"; 2])),
            ("axis1_deg", floats(&[1.0, f64::NAN])),
            ("axis2_deg", floats(&[1.0, 2.0])),
            ("target", texts(&["white"; 2])),
            ("u_m", floats(&[0.5, 0.5])),
            ("v_m", floats(&[0.5, 0.5])),
        ],
    );
    case("Parquet: a row", folder);
    let mut settings = insta::Settings::clone_current();
    settings.set_snapshot_path("../snapshots");
    settings.set_prepend_module_to_snapshot(false);
    settings.set_omit_expression(true);
    settings.bind(|| insta::assert_snapshot!("observations", said));
}

#[test]
fn suns_counted_from_south_are_recognised() {
    let times: Vec<String> = (1..9)
        .map(|h| format!("2026-06-21T{h:02}:00:00Z"))
        .collect();
    let mut timed = "id,time,axis1_deg,axis2_deg,target,u_m,v_m\n".to_string();
    for time in &times {
        writeln!(timed, "A1,{time},1,2,white,0,0").unwrap();
    }
    let suns: Vec<(f64, f64)> = load(&seen(&timed)).unwrap().heliostats[0]
        .observations
        .iter()
        .map(|o| (degrees(o.sun.azimuth_rad()), degrees(o.sun.elevation_rad())))
        .collect();
    let table = |azimuth: &dyn Fn(f64) -> f64| {
        let mut table =
            "id,time,sun_azimuth_deg,sun_elevation_deg,axis1_deg,axis2_deg,target,u_m,v_m\n"
                .to_string();
        for (time, (deg, elevation)) in times.iter().zip(&suns) {
            writeln!(
                table,
                "A1,{time},{},{elevation},1,2,white,0,0",
                azimuth(*deg)
            )
            .unwrap();
        }
        seen(&table)
    };
    let both = load(&table(&|deg| deg)).unwrap();
    let said = "records that state both a time and the sun's angles: 8 (first: line 2); the angles say where the sun is";
    assert!(both.warnings[0].ends_with(said), "{:?}", both.warnings);
    let eastward = load(&table(&|deg| 180.0 - deg)).unwrap_err().to_string();
    assert!(
        eastward.contains("seen.csv:1: column `sun_azimuth_deg`")
            && eastward.contains("from south toward east: 180 - it"),
        "{eastward}"
    );
    let westward = load(&table(&|deg| deg - 180.0)).unwrap_err().to_string();
    assert!(
        westward.contains("from south toward west: 180 + it"),
        "{westward}"
    );
}

#[test]
fn places_beyond_the_end_are_refused() {
    let sets = "id,mirror_tilt_deg,hour_angle_from_deg,hour_angle_to_deg\nA1,0.1,,0\nA3,0.3,0,\n";
    let folder = seen(SEEN)
        .with("cal.csv", sets)
        .edited(&[], "calibration = \"cal.csv\"\n");
    let loaded = folder.load().unwrap();
    let schedule = loaded.schedule.as_ref().unwrap();
    let mut shorter = Field::new(loaded.field.mode());
    let first = loaded.field.heliostats()[0];
    shorter.push("A1", first).unwrap();
    let error = schedule.update(&mut shorter, None, 0.0).unwrap_err();
    assert_eq!(error, FieldError::NoSuchRow { row: 2, count: 1 });
    for row in [3, usize::MAX] {
        for refused in [
            loaded.target(row).map(|_| ()),
            loaded.plane_for(row).map(|_| ()),
            schedule.heliostat_at(row, None, 0.0).map(|_| ()),
            schedule.set_at(row, None, 0.0).map(|_| ()),
        ] {
            assert_eq!(
                refused.unwrap_err().to_string(),
                format!("row must be below 3, the number of heliostats, got {row}")
            );
        }
    }
    let columns = vec![
        ("heliostat_id", texts(&["A1"; 3])),
        ("sun_azimuth_deg", floats(&[150.0, 151.0, 152.0])),
        ("sun_elevation_deg", floats(&[40.0; 3])),
        ("axis1_deg", floats(&[170.5; 3])),
        ("axis2_deg", floats(&[40.25; 3])),
        ("target", texts(&["white"; 3])),
        ("u_m", floats(&[0.5; 3])),
        ("v_m", floats(&[0.2; 3])),
    ];
    let parquet = Folder::of_field().with_parquet("seen.csv", columns);
    for (folder, last) in [(folder, "line 4"), (parquet, "row 3")] {
        let observed = load(&folder).unwrap();
        assert_eq!(observed.position(2).unwrap(), last);
        for refused in [
            observed.position(3).map(|_| ()),
            observed.line(3).map(|_| ()),
        ] {
            assert_eq!(
                folder.redact(&refused.unwrap_err()),
                "DIR/seen.csv: record must lie in 0..=2, found 3"
            );
        }
        assert!(observed.line(usize::MAX).is_err());
    }
}
