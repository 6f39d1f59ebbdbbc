//! What each verb does when all is well.

// Test helpers fail loudly; the lint knows only functions that are tests themselves.
#![allow(clippy::unwrap_used)]

mod common;

use std::collections::BTreeMap;
use std::io::Read;
use std::path::Path;
use std::process::Stdio;

use arrow::array::{Array, AsArray, DictionaryArray};
use arrow::datatypes::{
    DataType, Float64Type, Int32Type, Int64Type, TimeUnit, TimestampNanosecondType,
};
use common::{DRIVES, FIELD, Folder, HELIOSTATS, NOON, rows};
use parquet::arrow::arrow_reader::ParquetRecordBatchReaderBuilder;

/// An hour of the morning, every ten minutes: 7 suns.
const HOUR: &[&str] = &[
    "--from",
    "2026-06-21T09:00:00+02:00",
    "--to",
    "2026-06-21T10:00:00+02:00",
    "--step",
    "10min",
];

fn with_drives() -> Folder {
    let folder = Folder::new();
    folder.write("field.toml", format!("{FIELD}{DRIVES}"));
    folder
}

#[test]
fn tracking_writes_a_row_for_each_sun_and_heliostat() {
    let run = Folder::new().track(HOUR);
    let csv = run.good();
    let heading = "time,id,azimuth_deg,elevation_deg,incidence_deg,limit_excess_deg,status";
    assert_eq!(csv.lines().next(), Some(heading));
    let rows = rows(&csv);
    assert_eq!(rows.len(), 7 * 3);
    assert_eq!(rows[0]["time"], "2026-06-21T07:00:00Z");
    assert_eq!(rows[20]["time"], "2026-06-21T08:00:00Z");
    assert_eq!(rows[3]["id"], "A1");
    assert_eq!(rows[5]["id"], "B, 3");
    assert!(
        rows.iter()
            .all(|row| row["status"] == "ok" && row["limit_excess_deg"] == "0.0")
    );
    assert!(
        run.stderr()
            .contains("Shading and blocking are not computed")
    );
}

#[test]
fn a_known_angle_comes_out() {
    // Sun and aim due south of a heliostat without offset: the normal halves their elevations.
    let folder = Folder::new();
    folder.write("heliostats.csv", "id,east_m,north_m,up_m\nA1,0,120,0\n");
    let field = FIELD.replace("mirror_offset_m = 0.2", "mirror_offset_m = 0");
    folder.write("field.toml", field);
    let run = folder.track(&["--sun-azimuth-deg", "180", "--sun-elevation-deg", "65"]);
    let rows = rows(&run.good());
    let number = |name: &str| rows[0][name].parse::<f64>().unwrap();
    assert!((number("azimuth_deg") - 180.0).abs() < 1e-12);
    assert!((number("elevation_deg") - 55.0).abs() < 1e-12);
    assert!((number("incidence_deg") - 10.0).abs() < 1e-12);
    assert_eq!(
        (number("sun_azimuth_deg"), number("sun_elevation_deg")),
        (180.0, 65.0)
    );
}

#[test]
fn every_format_says_the_same() {
    let folder = with_drives();
    for out in ["a.csv", "a.json", "a.jsonl", "a.parquet"] {
        let run = folder.track(&[HOUR, &["--verify", "--out", out]].concat());
        assert_eq!(run.good(), "", "{out}");
    }
    let csv = rows(&folder.read("a.csv"));
    let jsonl = folder.read("a.jsonl");
    let objects: Vec<serde_json::Value> = jsonl
        .lines()
        .map(|line| serde_json::from_str(line).unwrap())
        .collect();
    let array: Vec<serde_json::Value> = serde_json::from_str(&folder.read("a.json")).unwrap();
    assert_eq!(array, objects);
    assert_eq!(csv.len(), objects.len());
    for ((row, object), line) in csv.iter().zip(&objects).zip(jsonl.lines()) {
        assert_eq!(object.as_object().unwrap().len(), row.len());
        for (name, cell) in row {
            match object[name].as_str() {
                Some(text) => assert_eq!(text, cell),
                // To the digit: the parser of this test may round.
                None => assert!(
                    line.contains(&format!("\"{name}\":{cell},")),
                    "{name}: {line}"
                ),
            }
        }
    }
    assert_eq!(parquet_rows(&folder.path().join("a.parquet")), csv);
}

/// A Parquet table in the words of CSV.
fn parquet_rows(path: &Path) -> Vec<BTreeMap<String, String>> {
    let file = std::fs::File::open(path).unwrap();
    let reader = ParquetRecordBatchReaderBuilder::try_new(file)
        .unwrap()
        .build()
        .unwrap();
    let mut rows = Vec::new();
    for batch in reader {
        let batch = batch.unwrap();
        for row in 0..batch.num_rows() {
            let cell = |(field, column): (&arrow::datatypes::FieldRef, &arrow::array::ArrayRef)| {
                let text = match column.data_type() {
                    _ if column.is_null(row) => String::new(),
                    DataType::Float64 => {
                        serde_json::to_string(&column.as_primitive::<Float64Type>().value(row))
                            .unwrap()
                    }
                    DataType::Int64 => column.as_primitive::<Int64Type>().value(row).to_string(),
                    DataType::Timestamp(TimeUnit::Nanosecond, Some(zone)) => {
                        assert_eq!(zone.as_ref(), "UTC");
                        let ns = column.as_primitive::<TimestampNanosecondType>().value(row);
                        helio_io::format_time(ns)
                    }
                    DataType::Dictionary(_, _) => {
                        let words: &DictionaryArray<Int32Type> = column.as_dictionary();
                        let key = words.key(row).unwrap();
                        words.values().as_string::<i32>().value(key).to_owned()
                    }
                    other => panic!("{other}"),
                };
                (field.name().clone(), text)
            };
            rows.push(
                batch
                    .schema()
                    .fields()
                    .iter()
                    .zip(batch.columns())
                    .map(cell)
                    .collect(),
            );
        }
    }
    rows
}

#[test]
fn parquet_is_encoded_as_documented() {
    use parquet::basic::{Compression, Encoding};
    use parquet::file::reader::{FileReader, SerializedFileReader};
    let folder = with_drives();
    folder
        .track(&[HOUR, &["--out", "a.parquet"]].concat())
        .good();
    let file = std::fs::File::open(folder.path().join("a.parquet")).unwrap();
    let reader = SerializedFileReader::new(file).unwrap();
    let group = reader.metadata().row_group(0);
    assert_eq!(group.num_rows(), 21);
    for column in group.columns() {
        let name = column.column_path().string();
        let wanted = match name.as_str() {
            "time" | "id" | "status" => Encoding::RLE_DICTIONARY,
            "axis1_steps" | "axis2_steps" => Encoding::DELTA_BINARY_PACKED,
            _ => Encoding::BYTE_STREAM_SPLIT,
        };
        assert!(
            column.encodings().any(|encoding| encoding == wanted),
            "{name}"
        );
        assert!(
            matches!(column.compression(), Compression::ZSTD(_)),
            "{name}"
        );
    }
    let azimuth = group.column(2).statistics().unwrap();
    assert_eq!(azimuth.null_count_opt(), Some(0));
}

/// Nulls, several pages and row groups, steps and given suns, read back as they were written.
#[test]
fn parquet_and_csv_agree_where_rows_are_many_and_odd() {
    let folder = with_drives();
    let mut table = "id,east_m,north_m,up_m,axis2_min_deg,axis2_max_deg\n".to_owned();
    for i in 0..300 {
        // Limits cut off some heliostats at some suns, each after its own fashion.
        let (east, north, most) = (i % 50 * 9 - 220, 40 + i / 50 * 15, 30 + i % 53);
        table.push_str(&format!("H{i},{east},{north},3,0,{most}\n"));
    }
    folder.write("heliostats.csv", table);
    let mut suns = "azimuth_deg,elevation_deg\n".to_owned();
    for i in 0..500 {
        suns.push_str(&format!("{}.{},{}\n", i % 360, i % 10, i % 97 - 7));
    }
    folder.write("suns.csv", suns);
    for out in ["a.csv", "a.parquet"] {
        let run = folder.track(&["--suns", "suns.csv", "--out", out]);
        assert_eq!(run.code(), 1, "{}", run.stderr());
        assert!(run.stderr().contains("outside_limits"));
    }
    let csv = rows(&folder.read("a.csv"));
    assert_eq!(csv.len(), 300 * 500);
    assert!(csv.iter().any(|row| row["status"] == "outside_limits"
        && row["azimuth_deg"].is_empty()
        && row["limit_excess_deg"].parse::<f64>().unwrap() > 0.0));
    assert!(csv.iter().all(|row| row["status"] != "sun_below_horizon"
        || row["incidence_deg"].is_empty() && row["limit_excess_deg"].is_empty()));
    assert!(parquet_rows(&folder.path().join("a.parquet")) == csv);
}

#[test]
fn steps_are_whole_and_rounded() {
    let rows = rows(&with_drives().track(NOON).good());
    for row in rows {
        for (angle, steps) in [
            ("azimuth_deg", "axis1_steps"),
            ("elevation_deg", "axis2_steps"),
        ] {
            let angle: f64 = row[angle].parse().unwrap();
            let steps: i64 = row[steps].parse().unwrap();
            assert_eq!(steps, (angle * 1000.0).round() as i64);
        }
    }
}

#[test]
fn verification_follows_the_beams_back() {
    let exact = Folder::new().track(&[NOON, &["--verify"]].concat());
    for row in rows(&exact.good()) {
        assert!(row["beam_error_mrad"].parse::<f64>().unwrap() < 1e-9);
    }
    assert!(exact.stderr().contains("the field has no drive"));
    // A step is 0.001°, so an axis is off by at most half of it and the beam by four times that.
    let stepped = with_drives().track(&[NOON, &["--verify"]].concat());
    let errors: Vec<f64> = rows(&stepped.good())
        .iter()
        .map(|row| row["beam_error_mrad"].parse().unwrap())
        .collect();
    assert!(
        errors.iter().all(|&e| e < 0.035) && errors.iter().any(|&e| e > 1e-4),
        "{errors:?}"
    );
    assert!(stepped.stderr().contains("through whole motor steps"));
    // Without the offset taken into account the beams miss by what it turns them.
    let none = Folder::new().track(&[NOON, &["--verify", "--offset", "none"]].concat());
    assert!(
        rows(&none.good())
            .iter()
            .any(|row| row["beam_error_mrad"].parse::<f64>().unwrap() > 0.05)
    );
}

#[test]
fn predictions_take_back_what_tracking_wrote() {
    let folder = with_drives();
    let day = [
        "--from",
        "2026-06-21T00:00Z",
        "--to",
        "2026-06-21T23:00Z",
        "--step",
        "1h",
    ];
    for name in ["a.csv", "a.parquet"] {
        folder.track(&[&day[..], &["--out", name]].concat()).good();
        let run = folder.run(&["predict", "--field", "field.toml", "--angles", name]);
        let rows = rows(&run.good());
        assert!(run.stderr().contains("left aside"), "{}", run.stderr());
        assert!(rows.len() > 30 && rows.len() < 72);
        for row in rows {
            assert_eq!(row["status"], "ok");
            let number = |name: &str| row[name].parse::<f64>().unwrap();
            assert!(number("u_m").abs() < 1e-10 && number("v_m").abs() < 1e-10);
            assert!((number("up_m") - 120.0).abs() < 1e-10);
            assert!(number("beam_error_mrad") < 1e-9);
        }
    }
}

/// The angles of a field with pose errors lead its beams back to their aims, whole steps too, and are those of one
/// without less what they turn.
#[test]
fn pose_errors_go_through_tracking_prediction_limits_and_steps() {
    let errors = "axis1_sag_deg = 0.1\naxis2_eccentricity_deg = -0.07\n";
    let folder = Folder::new();
    // elevation is turned by -kappa2 cos(elevation) + e sin(elevation), the azimuth not at all
    let of_each =
        "id,east_m,north_m,up_m,axis2_sag_deg\nA1,-40,100,3,0.2\nA2,0.5,110,3,\nB,60,240,3,-0.3\n";
    folder.write("heliostats.csv", of_each);
    let stiff = of_each.replace("axis2_sag_deg", "note");
    let stiff_field = format!("{FIELD}ignore = [\"note\"]\n");
    folder.write("stiff.csv", stiff);
    folder.write(
        "stiff.toml",
        stiff_field.replace("heliostats.csv", "stiff.csv"),
    );
    folder.write("field.toml", format!("{FIELD}{errors}"));
    let tracked = folder.track(&[NOON, &["--verify", "--out", "angles.csv"]].concat());
    tracked.good();
    let sagging = rows(&folder.read("angles.csv"));
    let stiff = folder.run(&[&["track", "--field", "stiff.toml"], NOON].concat());
    for ((row, stiff), kappa_deg) in sagging
        .iter()
        .zip(rows(&stiff.good()))
        .zip([0.2, 0.0, -0.3])
    {
        let number = |row: &BTreeMap<String, String>, name: &str| row[name].parse::<f64>().unwrap();
        assert!(number(row, "beam_error_mrad") < 1e-9);
        let elevation = number(&stiff, "elevation_deg");
        let off = number(row, "elevation_deg") - elevation;
        let (sin, cos) = elevation.to_radians().sin_cos();
        let want = kappa_deg * cos + 0.07 * sin;
        assert!((off - want).abs() < 1e-12, "{off} {want}");
        assert_eq!(row["azimuth_deg"], stiff["azimuth_deg"]);
    }
    let predict = ["predict", "--field", "field.toml", "--angles", "angles.csv"];
    let predicted = rows(&folder.run(&[&predict[..], NOON].concat()).good());
    for row in &predicted {
        assert!(row["beam_error_mrad"].parse::<f64>().unwrap() < 1e-9);
    }
    // whole steps of 0.001°: half of one at most on either axis, four times that on the beam
    folder.write("field.toml", format!("{FIELD}{errors}{DRIVES}"));
    let stepped = folder.track(&[NOON, &["--verify"]].concat());
    for row in rows(&stepped.good()) {
        assert!(row["beam_error_mrad"].parse::<f64>().unwrap() < 0.035);
        let steps = 1000.0 * row["elevation_deg"].parse::<f64>().unwrap();
        assert_eq!(row["axis2_steps"].parse::<f64>().unwrap(), steps.round());
    }
    // a limit between the encoder's angle and the one that a stiff mount would have
    let elevation: f64 = sagging[0]["elevation_deg"].parse().unwrap();
    let limits = |most: f64| {
        let limits = format!("axis2_min_deg = -90\naxis2_max_deg = {most}\n");
        folder.write("field.toml", format!("{FIELD}{errors}{limits}"));
        rows(&folder.track(NOON).stdout()).swap_remove(0)
    };
    assert_eq!(limits(elevation + 0.001)["status"], "ok");
    let outside = limits(elevation - 0.001);
    assert_eq!(outside["status"], "outside_limits");
    let excess: f64 = outside["limit_excess_deg"].parse().unwrap();
    assert!((excess - 0.001).abs() < 1e-9, "{excess}");
    let report = folder.run(&["check", "--field", "field.toml"]).good();
    assert!(
        report.contains("axis1_sag 0.1°")
            && report.contains("axis2_sag -0.3 to 0.2°")
            && report.contains("axis2_eccentricity -0.07°"),
        "{report}"
    );
}

#[test]
fn predictions_take_rows_in_any_order_and_steps() {
    let folder = with_drives();
    folder.write(
        "angles.csv",
        "id,axis1_steps,axis2_steps,sun_azimuth_deg,sun_elevation_deg\n\
         A2,170000,50000,150,60\nA1,160000,50000,150,60\nA1,161000,50000,150,60\n\
         \"B, 3\",10000,50000,150.1,60\n",
    );
    let run = folder.run(&["predict", "--field", "field.toml", "--angles", "angles.csv"]);
    assert_eq!(
        run.code(),
        1,
        "the last mirror shows its back: {}",
        run.stderr()
    );
    let rows = rows(&run.stdout());
    let ids: Vec<_> = rows.iter().map(|row| row["id"].as_str()).collect();
    assert_eq!(ids, ["A2", "A1", "A1", "B, 3"]);
    assert_ne!(rows[1]["u_m"], rows[2]["u_m"]);
    assert_eq!(rows[3]["status"], "misses_target");
    assert_eq!(rows[3]["u_m"], "");
    assert_eq!(rows[3]["sun_azimuth_deg"], "150.1");
    // A sun of the command line wins.
    let given = ["--sun-azimuth-deg", "180", "--sun-elevation-deg", "50"];
    let args = [
        &["predict", "--field", "field.toml", "--angles", "angles.csv"],
        &given[..],
    ]
    .concat();
    assert!(folder.run(&args).stderr().contains("wins"));
}

#[test]
fn shortest_travel_goes_on_counting() {
    let folder = Folder::new();
    // A heliostat north of the tower in the southern hemisphere's fashion: its azimuth passes north.
    folder.write(
        "heliostats.csv",
        "id,east_m,north_m,up_m\nS1,0.0,-150.0,3.0\n",
    );
    let limits = "axis1_min_deg = -720\naxis1_max_deg = 720\n";
    folder.write("field.toml", format!("{FIELD}{limits}"));
    folder.write(
        "suns.csv",
        "azimuth_deg,elevation_deg\n60,20\n30,20\n0,20\n330,20\n300,20\n",
    );
    let azimuths = |more: &[&str]| -> Vec<f64> {
        let run = folder.track(&[&["--suns", "suns.csv"], more].concat());
        rows(&run.good())
            .iter()
            .map(|row| row["azimuth_deg"].parse().unwrap())
            .collect()
    };
    let travels = |azimuths: &[f64]| azimuths.windows(2).all(|w| (w[1] - w[0]).abs() < 60.0);
    assert!(travels(&azimuths(&["--continuous"])));
    folder.write("present.csv", "id,axis1_deg,axis2_deg\nS1,370,40\n");
    let from_present = azimuths(&["--present", "present.csv"]);
    assert!(
        travels(&from_present) && (from_present[0] - 370.0).abs() < 60.0,
        "{from_present:?}"
    );
}

#[test]
fn given_suns_win_over_times() {
    let folder = Folder::new();
    let given = ["--sun-azimuth-deg", "180", "--sun-elevation-deg", "45"];
    let run = folder.track(&[NOON, &given[..]].concat());
    assert!(
        run.good()
            .starts_with("sun_azimuth_deg,sun_elevation_deg,id,")
    );
    assert!(run.stderr().contains("the time is not used"));
}

#[test]
fn without_a_sun_it_is_now() {
    let run = Folder::new().track(&[]);
    assert_eq!(rows(&run.good()).len(), 3);
    assert!(
        run.stderr().contains("no time or sun given: now, 20"),
        "{}",
        run.stderr()
    );
}

#[test]
fn the_night_is_no_failure_and_an_unreachable_row_is() {
    let folder = Folder::new();
    let night = folder.track(&["--time", "2026-06-21T00:00:00Z"]);
    let rows = rows(&night.good());
    assert!(
        rows.iter()
            .all(|r| r["status"] == "sun_below_horizon" && r["azimuth_deg"].is_empty())
    );
    folder.write(
        "field.toml",
        format!("{FIELD}axis2_min_deg = 0\naxis2_max_deg = 30\n"),
    );
    let limited = folder.track(NOON);
    assert_eq!(limited.code(), 1);
    assert!(
        limited.stderr().contains("outside_limits"),
        "{}",
        limited.stderr()
    );
}

#[test]
fn quiet_is_quiet_and_dash_is_standard_output() {
    let folder = Folder::new();
    let run = folder.track(&[NOON, &["-q", "--out", "-", "--format", "jsonl"]].concat());
    assert_eq!(run.good().lines().count(), 3);
    assert_eq!(run.stderr(), "");
    assert_eq!(folder.contents().len(), 2);
}

#[test]
fn results_replace_what_was_there_and_nothing_else_remains() {
    let folder = Folder::new();
    folder.write("a.csv", "old");
    folder.track(&[NOON, &["--out", "a.csv"]].concat()).good();
    assert!(folder.read("a.csv").starts_with("time,"));
    assert_eq!(folder.contents().len(), 3);
}

#[test]
fn threads_change_nothing() {
    let folder = with_drives();
    let mut outputs = Vec::new();
    for threads in ["1", "2", "7"] {
        let args = [
            HOUR,
            &["--out", "a.parquet", "--verify", "--threads", threads],
        ]
        .concat();
        folder.track(&args).good();
        outputs.push(std::fs::read(folder.path().join("a.parquet")).unwrap());
    }
    assert!(outputs.windows(2).all(|pair| pair[0] == pair[1]));
}

#[test]
fn a_closed_pipe_ends_quietly() {
    let folder = Folder::new();
    for format in ["csv", "json", "jsonl", "parquet"] {
        let day = [
            "--from",
            "2026-06-21T05:00Z",
            "--to",
            "2026-06-21T19:00Z",
            "--step",
            "100ms",
        ];
        let args = [
            &["track", "--field", "field.toml"],
            &day[..],
            &["-q", "--format", format],
        ]
        .concat();
        let mut child = folder
            .command(&args)
            .stdout(Stdio::piped())
            .stderr(Stdio::piped())
            .spawn()
            .unwrap();
        let mut some = [0; 100];
        child.stdout.take().unwrap().read_exact(&mut some).unwrap();
        // The reading end is closed here.
        let done = child.wait_with_output().unwrap();
        assert_eq!(done.status.code(), Some(0), "{format}");
        assert_eq!(String::from_utf8(done.stderr).unwrap(), "", "{format}");
    }
}

#[cfg(unix)]
#[test]
fn an_interrupted_run_leaves_nothing_behind() {
    let folder = Folder::new();
    let years = [
        "--from",
        "2020-01-01T00:00Z",
        "--to",
        "2040-01-01T00:00Z",
        "--step",
        "1s",
    ];
    let args = [
        &["track", "--field", "field.toml"],
        &years[..],
        &["--out", "a.parquet"],
    ]
    .concat();
    let mut child = folder
        .command(&args)
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    // The temporary file is there once the handler is about to be.
    while folder.contents().len() < 3 {
        std::thread::sleep(std::time::Duration::from_millis(5));
    }
    std::thread::sleep(std::time::Duration::from_millis(300));
    let id = child.id().to_string();
    assert!(
        std::process::Command::new("kill")
            .args(["-INT", &id])
            .status()
            .unwrap()
            .success()
    );
    let code = child.wait().unwrap().code();
    let mut said = String::new();
    child
        .stderr
        .take()
        .unwrap()
        .read_to_string(&mut said)
        .unwrap();
    assert_eq!(code, Some(130), "{said}");
    assert!(said.contains("interrupted"), "{said}");
    assert_eq!(folder.contents().len(), 2);
}

#[test]
fn a_beam_that_misses_and_an_angle_beyond_the_drive_are_no_good_rows() {
    let folder = Folder::new();
    // A1 stands behind the plane.
    folder.write(
        "heliostats.csv",
        "id,east_m,north_m,up_m\nA1,-10,-90,3\nA2,0.5,110,3\n",
    );
    let run = folder.track(&[NOON, &["--verify"]].concat());
    assert_eq!(run.code(), 1, "{}", run.stderr());
    let found = rows(&run.stdout());
    assert_eq!(
        (&*found[0]["status"], &*found[0]["azimuth_deg"]),
        ("misses_target", "")
    );
    assert_eq!(found[1]["status"], "ok");
    let report = folder.run(&["check", "--field", "field.toml"]).good();
    assert!(
        report.contains("1 heliostats stand behind the plane of receiver and miss it (A1)"),
        "{report}"
    );
    assert!(
        report.contains("apparent (as tracked)") && report.contains("° geometric"),
        "{report}"
    );
    // A drive with one end, which is no stop of the axis.
    let drive = DRIVES.replace(
        "steps_per_deg = 1000.0\n",
        "steps_per_deg = 1000.0\nmin_steps = 80000\n",
    );
    let folder = Folder::new();
    folder.write("field.toml", format!("{FIELD}{drive}"));
    for more in [&[][..], &["--verify"]] {
        let run = folder.track(&[NOON, more].concat());
        assert_eq!(run.code(), 1, "{}", run.stderr());
        for row in rows(&run.stdout()) {
            assert_eq!(row["status"], "outside_limits");
            let cells = ["elevation_deg", "axis2_steps", "limit_excess_deg"];
            assert!(cells.iter().all(|name| row[*name].is_empty()), "{row:?}");
        }
    }
}

#[test]
fn a_counter_leaves_the_angles_where_they_are() {
    let folder = Folder::new();
    let drives = DRIVES.replace(
        "steps_per_deg = 1000.0\n",
        "steps_per_deg = 100.0\nmin_steps = 0\nmax_steps = 4294967295\n",
    );
    folder.write("field.toml", format!("{FIELD}{drives}"));
    folder
        .track(&[HOUR, &["--verify", "--out", "p.csv"]].concat())
        .good();
    for more in [
        &["--verify"][..],
        &["--continuous"],
        &["--present", "p.csv", "--verify"],
    ] {
        for row in rows(&folder.track(&[HOUR, more].concat()).good()) {
            let azimuth: f64 = row["azimuth_deg"].parse().unwrap();
            let elevation: f64 = row["elevation_deg"].parse().unwrap();
            assert!((0.0..360.0).contains(&azimuth) && (0.0..90.0).contains(&elevation));
        }
    }
}

/// Whatever `track` writes, with any option, can be read back.
#[test]
fn every_result_of_tracking_can_be_read_back() {
    let one_axis = DRIVES.split("[heliostats.drive.axis2]").next().unwrap();
    for drives in ["", one_axis, DRIVES] {
        let folder = Folder::new();
        folder.write("field.toml", format!("{FIELD}{drives}"));
        for (out, sun) in [("a.csv", HOUR), ("a.parquet", HOUR), ("b.csv", NOON)] {
            folder
                .track(&[sun, &["--verify", "--continuous", "--out", out]].concat())
                .good();
            folder.track(&[NOON, &["--present", out]].concat()).good();
            let predict = ["predict", "--field", "field.toml", "--angles", out];
            folder.run(&predict).good();
        }
    }
}

#[test]
fn an_expired_calibration_is_told_once() {
    let folder = Folder::new();
    folder.write("field.toml", format!("{FIELD}calibration = \"c.csv\"\n"));
    folder.write(
        "c.csv",
        "id,valid_to,azimuth_reference_deg\nA1,2026-01-01T00:00:00Z,1\nA2,2026-02-01T00:00:00Z,1\n",
    );
    let run = folder.track(HOUR);
    run.good();
    let told = "warning: calibration: 2 heliostats have no set that is valid all the time asked for \
                (first A1, last valid_to 2026-02-01T00:00:00Z); the layout's errors hold there";
    assert_eq!(run.stderr().matches(told).count(), 1, "{}", run.stderr());
    let run = folder.track(&["--time", "2025-12-31T12:00:00Z"]);
    assert!(!run.stderr().contains("no set that is valid"));
}

/// A plot that cannot be written leaves no rows behind either.
#[cfg(target_os = "linux")]
#[test]
fn a_plot_that_fails_leaves_no_rows() {
    let folder = Folder::new();
    std::os::unix::fs::symlink("/dev/full", folder.path().join("full.svg")).unwrap();
    let run = folder.track(&[NOON, &["--out", "a.csv", "--plot", "full.svg"]].concat());
    assert_eq!(run.code(), 2, "{}", run.stderr());
    assert!(!folder.path().join("a.csv").exists());
}

/// The reader's own words about a panic of its own are not passed on.
#[test]
fn damaged_parquet_does_not_panic_on_the_screen() {
    let folder = Folder::new();
    let run = folder.run(&[
        "simulate",
        "field",
        "--heliostats",
        "9",
        "--out",
        "h.parquet",
    ]);
    run.good();
    folder.write("field.toml", FIELD.replace("heliostats.csv", "h.parquet"));
    let good = std::fs::read(folder.path().join("h.parquet")).unwrap();
    for at in (4..good.len()).step_by(29) {
        let mut bad = good.clone();
        bad[at] ^= 0x7F;
        folder.write("h.parquet", bad);
        let run = folder.track(NOON);
        assert!(!run.stderr().contains("panicked"), "{at}: {}", run.stderr());
    }
}

#[test]
fn figures_are_drawn() {
    let folder = Folder::new();
    for (plot, colour) in [
        ("a.svg", "azimuth"),
        ("b.html", "elevation"),
        ("c.svg", "incidence"),
        ("d.html", "status"),
    ] {
        let more = [
            "--plot",
            plot,
            "--plot-colour",
            colour,
            "--plot-heliostats",
            "A1,A2",
            "-q",
        ];
        folder.track(&[HOUR, &more[..]].concat()).good();
        let text = folder.read(plot);
        assert!(text.contains("<svg") && text.contains("</svg>") && text.contains("A2"));
        assert!(text.contains("2026-06-21, UTC+02:00"), "{plot}");
        assert!(!text.contains("NaN"));
        assert!(
            !text.contains("href=") && !text.contains("src="),
            "{plot} needs nothing else"
        );
        assert_eq!(text.contains("<table>"), plot.ends_with("html"));
    }
    let night = folder.track(&["--time", "2026-06-21T00:00:00Z", "--plot", "n.html"]);
    night.good();
    assert!(folder.read("n.html").contains("sun_below_horizon"));
}

#[test]
fn a_check_reports_and_points() {
    let folder = with_drives();
    let run = folder.run(&["check", "--field", "field.toml"]);
    let report = run.good();
    for said in [
        "field.toml, heliostats.csv",
        "37.400000° N, 6.250000° W, 20 m",
        "3, tracking mode azimuth-elevation",
        "receiver: 12 by 12 m",
        "axis 1 of 3 heliostats",
        "sun now",
        "ok 100.000 % of the rows",
    ] {
        assert!(report.contains(said), "{said}: {report}");
    }
    let limits = "axis2_min_deg = 0\naxis2_max_deg = 50\n";
    folder.write(
        "field.toml",
        format!("{FIELD}{limits}mirror_tilt_deg = 0.1\n"),
    );
    let report = folder.run(&["check", "--field", "field.toml"]).good();
    assert!(
        report.contains("sometimes does not: 3 heliostats (A1, A2, B, 3)"),
        "{report}"
    );
    assert!(
        report.contains("mirror_tilt 0.1°") && report.contains("from 0° up to 50°"),
        "{report}"
    );
}

#[test]
fn the_schema_is_json() {
    let schema: serde_json::Value =
        serde_json::from_str(&Folder::empty().run(&["schema"]).good()).unwrap();
    assert_eq!(schema["properties"]["site"]["type"], "object");
}

#[test]
fn the_version_names_build_and_instruction_set() {
    let version = Folder::empty().run(&["--version"]).good();
    assert!(version.starts_with("helio-rs 0."), "{version}");
    assert!(
        version.contains(" build for ") && version.contains("instruction set "),
        "{version}"
    );
}

#[test]
fn init_writes_a_field_that_works() {
    let folder = Folder::empty();
    folder.run(&["init", "my field"]).good();
    let run = folder.run(&[&["track", "--field", "my field/field.toml"], NOON].concat());
    let rows = rows(&run.good());
    assert!(rows.len() > 100 && rows.iter().all(|row| row["status"] == "ok"));
    assert_eq!(folder.run(&["init", "my field"]).code(), 2);
    folder.run(&["init", "my field", "--force"]).good();
    let report = folder
        .run(&["check", "--field", "my field/field.toml"])
        .good();
    assert!(report.contains("ok 100.000 %"), "{report}");
}

#[test]
fn simulated_fields_are_tables_to_track() {
    let folder = Folder::new();
    for layout in ["radial-staggered", "fermat-spiral"] {
        for (out, replaced) in [("s.csv", "s.csv"), ("s.parquet", "s.parquet")] {
            let args = [
                "simulate",
                "field",
                "--heliostats",
                "400",
                "--layout",
                layout,
                "--out",
                out,
            ];
            folder.run(&args).good();
            folder.write("field.toml", FIELD.replace("heliostats.csv", replaced));
            assert_eq!(rows(&folder.track(NOON).good()).len(), 400);
        }
        let csv = folder.run(&[
            "simulate",
            "field",
            "--heliostats",
            "400",
            "--layout",
            layout,
        ]);
        assert_eq!(csv.good(), folder.read("s.csv"), "the same again");
    }
}

/// The example at the end of each help, run where the examples are.
#[test]
fn the_examples_of_the_help_work() {
    let examples = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../examples");
    let verbs: &[&[&str]] = &[
        &["init"],
        &["check"],
        &["track"],
        &["predict"],
        &["simulate", "field"],
        &["simulate", "observations"],
        &["simulate", "images"],
        &["spot"],
        &["calibrate"],
        &["convert", "paint"],
        &["schema"],
    ];
    let folder = Folder::empty();
    common::copy_folder(
        &examples.join("paint"),
        &folder.path().join("examples/paint"),
    );
    for name in ["field.toml", "heliostats.csv"] {
        let to = folder.path().join("examples").join(name);
        std::fs::copy(examples.join(name), to).unwrap();
    }
    for verb in verbs {
        let help = folder.run(&[*verb, &["--help"]].concat()).good();
        let (_, example) = help.split_once("Example:\n").expect("an example");
        let mut commands = 0;
        for line in example.lines().filter(|line| !line.trim().is_empty()) {
            let line = line.split(" > ").next().unwrap();
            let words: Vec<&str> = line.split_whitespace().collect();
            assert_eq!(words[0], "helio-rs", "{line}");
            let run = folder.run(&words[1..]);
            assert_eq!(run.code(), 0, "{line}: {}", run.stderr());
            commands += 1;
        }
        assert!(commands > 0, "{verb:?}");
    }
    for verb in ["track", "predict"] {
        let help = folder.run(&[verb, "--help"]).good();
        assert!(
            help.replace('\n', " ")
                .contains("hading and blocking are not computed"),
            "{verb}"
        );
    }
}

/// The examples are what `init` writes, so that neither grows old.
#[test]
fn the_examples_are_up_to_date() {
    let examples = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../examples");
    let folder = Folder::empty();
    folder.run(&["init", "."]).good();
    for name in ["field.toml", "heliostats.csv"] {
        let committed = std::fs::read_to_string(examples.join(name)).unwrap();
        assert!(
            committed == folder.read(name),
            "examples/{name}: run `helio-rs init examples --force`"
        );
    }
}

#[test]
fn a_calibration_that_changes_with_the_hour_is_followed() {
    let folder = Folder::new();
    folder.write(
        "field.toml",
        format!("{FIELD}calibration = \"calibration.csv\"\n"),
    );
    folder.write(
        "calibration.csv",
        "id,set,hour_angle_from_deg,hour_angle_to_deg,azimuth_reference_deg\n\
         A1,1,-180,0,1.0\nA1,2,0,180,-1.0\n",
    );
    let day = [
        "--from",
        "2026-06-21T07:00Z",
        "--to",
        "2026-06-21T18:00Z",
        "--step",
        "1h",
    ];
    let calibrated = rows(&folder.track(&[&day[..], &["--verify"]].concat()).good());
    let plain = rows(&Folder::new().track(&day).good());
    let turned = |i: usize| -> f64 {
        let azimuth = |row: &BTreeMap<String, String>| row["azimuth_deg"].parse::<f64>().unwrap();
        azimuth(&calibrated[i]) - azimuth(&plain[i])
    };
    assert!((turned(0) - 1.0).abs() < 1e-9 && (turned(33) + 1.0).abs() < 1e-9);
    assert_eq!(turned(1), 0.0, "A2 has no calibration");
    for row in &calibrated {
        assert!(
            row["beam_error_mrad"].parse::<f64>().unwrap() < 1e-9,
            "{row:?}"
        );
    }
}

#[test]
fn the_text_of_the_fixture_is_a_good_field() {
    assert!(FIELD.contains("heliostats.csv") && HELIOSTATS.lines().count() == 4);
    Folder::new().track(NOON).good();
}
