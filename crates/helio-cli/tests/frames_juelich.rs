//! From the seven pictured records of AA39's last epoch to corrected parameters, by the program alone.
//!
//! The pictures are found by the environment variable HELIO_DATA, the folder of the shared data; without it the test is
//! skipped.

// Test helpers fail loudly; the lint knows only functions that are tests themselves.
#![allow(clippy::unwrap_used)]

mod common;

use std::collections::{BTreeMap, BTreeSet};
use std::fmt::Write as _;
use std::path::Path;

use common::{Folder, rows};
use helio_tests::juelich::write_field;
use serde_json::Value;

const HELIOSTAT: &str = "AA39";

type Row = BTreeMap<String, String>;

fn table(path: &Path) -> Vec<Row> {
    let text = std::fs::read_to_string(path).unwrap();
    rows(text.trim_start_matches('\u{feff}'))
}

fn planes(juelich: &Path) -> serde_json::Map<String, Value> {
    let text = std::fs::read_to_string(juelich.join("target_planes.json")).unwrap();
    let planes: Value = serde_json::from_str(&text).unwrap();
    planes.as_object().unwrap().clone()
}

#[test]
fn seven_frames_correct_a_heliostat() {
    let Some(data) = std::env::var_os("HELIO_DATA") else {
        println!("skipped: HELIO_DATA is not set (seven_frames_correct_a_heliostat)");
        return;
    };
    let juelich = std::fs::canonicalize(data).unwrap().join("juelich");
    let folder = Folder::empty();
    let _ = write_field(&juelich, HELIOSTAT, folder.path());
    let crop = |id: &str| juelich.join("crops").join(format!("{id}-cropped.png"));
    let mut records = table(&juelich.join("calibration").join(format!("{HELIOSTAT}.csv")));
    records.retain(|row| row["epoch"] == "3" && crop(&row["record_id"]).exists());
    assert_eq!(records.len(), 7);

    // A list of frames, a target.toml and a run of `spot` for each target; a log of them all.
    let targets: BTreeSet<&String> = records.iter().map(|row| &row["target"]).collect();
    let mut spots = String::new();
    for target in targets {
        let plane = &planes(&juelich)[target];
        folder.write(
            "target.toml",
            format!(
                "width_m = {}\nheight_m = {}\ncorners_sigma_px = 0.3\nframe_width_px = 256\nframe_height_px = 256\n\
                 corners_px = [[-0.5, -0.5], [255.5, -0.5], [255.5, 255.5], [-0.5, 255.5]]\n",
                plane["width_m"], plane["height_m"]
            ),
        );
        let of = records.iter().filter(|row| row["target"] == *target);
        let list: String = of
            .map(|row| format!("{}\n", crop(&row["record_id"]).display()))
            .collect();
        folder.write("list.txt", list);
        let run = folder.run(&["spot", "@list.txt", "--target", "target.toml"]);
        assert!(run.code() < 2, "{}", run.stderr());
        let out = run.stdout();
        let (_, body) = out.split_once('\n').unwrap();
        spots += if spots.is_empty() { &out } else { body };
    }
    folder.write("spots.csv", &spots);
    let mut log = String::from(
        "heliostat_id,record_id,file,sun_azimuth_deg,sun_elevation_deg,axis1_steps,axis2_steps,target\n",
    );
    for row in &records {
        let id = &row["record_id"];
        let azimuth_deg = 180.0 - row["sun_azimuth_south_deg"].parse::<f64>().unwrap();
        writeln!(
            log,
            "{HELIOSTAT},{id},{id}-cropped.png,{azimuth_deg},{},{},{},{}",
            row["sun_elevation_deg"], row["axis1_steps"], row["axis2_steps"], row["target"],
        )
        .unwrap();
    }
    folder.write("log.csv", log);
    let found = rows(&spots);
    assert_eq!(found.len(), 7);
    for row in &found {
        assert_eq!(row["status"], "ok", "{row:?}");
    }

    let run = |spots: &str, more: &[&str]| {
        let args = [
            "calibrate",
            "--field",
            "field.toml",
            "--observations",
            "log.csv",
            "--spots",
            spots,
            "--keep-all",
        ];
        let run = folder.run(&[&args, more].concat());
        println!("{}", run.stderr());
        assert!(run.code() < 2, "{}", run.stderr());
        rows(&run.stdout()).remove(0)
    };
    let ours = run("spots.csv", &[]);
    // The same records with the spots of the plant's own software.
    let of_plant = table(&juelich.join("spots.csv"));
    let mut theirs = String::from("file,u_m,v_m,sigma_m,status\n");
    for row in &records {
        let id = &row["record_id"];
        let seen = of_plant
            .iter()
            .find(|seen| seen["image_id"] == *id)
            .unwrap();
        writeln!(
            theirs,
            "{id}-cropped.png,{},{},0.05,ok",
            seen["helios_right_m"], seen["helios_down_m"]
        )
        .unwrap();
    }
    folder.write("theirs.csv", theirs);
    let theirs = run("theirs.csv", &[]);
    let number = |row: &Row, name: &str| row[name].parse::<f64>().unwrap();
    for row in [&ours, &theirs] {
        assert_eq!(row["observations"], "7", "{row:?}");
        println!(
            "{} {}: beams {} mrad rms",
            row["id"], row["status"], row["beam_rms_mrad"]
        );
    }
    // Seven frames are explained as well as the plant's own spots of them are.
    let both = [&ours, &theirs].map(|row| number(row, "beam_rms_mrad"));
    assert!(both[0] < 1.1 * both[1], "{both:?}");
    // They do not determine six errors; four they do.
    assert_eq!(ours["status"], "undetermined");
    let four = [
        "--hold",
        "mirror_tilt,axis_nonorthogonality",
        "--max-year-pointing-mrad",
        "3",
    ];
    let held = run("spots.csv", &four);
    println!("four errors: {held:?}");
    assert_eq!(held["status"], "ok", "{held:?}");
    assert!(number(&held, "beam_rms_mrad") < 1.3 * both[1], "{held:?}");
}
