//! `convert paint`: a plant made up with known errors, and records made wrong.

// Test helpers fail loudly; the lint knows only functions that are tests themselves.
#![allow(clippy::unwrap_used)]

mod common;

use std::path::Path;

use common::{Folder, Run, copy_folder, rows};

const TOWER: &str = "paint/tower.json";
const RECORD: &str = "paint/A1/Calibration/100137-calibration-properties.json";
const HELIOSTAT: &str = "paint/A1/Properties/A1-heliostat-properties.json";

fn plant() -> Folder {
    let folder = Folder::empty();
    let examples = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../examples/paint");
    copy_folder(&examples, &folder.path().join("paint"));
    folder
}

fn convert(folder: &Folder, more: &[&str]) -> Run {
    let args = ["convert", "paint", "--tower", TOWER, "--records", "paint"];
    folder.run(&[&args[..], more].concat())
}

/// A text of a file in the place of another.
fn change(folder: &Folder, name: &str, from: &str, to: &str) {
    let text = folder.read(name);
    assert!(text.contains(from), "{name}: {from}");
    folder.write(name, text.replacen(from, to, 1));
}

/// From records through observations to the errors that the records were made with.
#[test]
fn the_errors_that_records_were_made_with_are_found() {
    let folder = plant();
    let run = convert(&folder, &["--out", "plant"]);
    run.good();
    assert!(
        run.stderr().contains("24 records of 2 heliostats"),
        "{}",
        run.stderr()
    );
    assert!(
        run.stderr().contains("receiver is no plane"),
        "{}",
        run.stderr()
    );
    let calibrated = folder.run(&[
        "calibrate",
        "--field",
        "plant/field.toml",
        "--observations",
        "plant/observations.csv",
    ]);
    let found = rows(&calibrated.good());
    let truth = rows(&folder.read("paint/truth.csv"));
    assert_eq!(found.len(), 2);
    for (found, truth) in found.iter().zip(&truth) {
        assert_eq!(
            (found["id"].as_str(), found["status"].as_str()),
            (truth["id"].as_str(), "ok")
        );
        let number = |of: &str| found[of].parse::<f64>().unwrap();
        // Half of 0.3 mrad of a normal's error, both components, is what the spots were scattered by.
        assert!(number("beam_rms_mrad") < 0.6, "{found:?}");
        for name in [
            "axis_nonorthogonality",
            "mirror_tilt",
            "azimuth_reference",
            "elevation_reference",
        ] {
            let off_deg = number(&format!("{name}_deg"))
                - truth[&format!("{name}_deg")].parse::<f64>().unwrap();
            let sigma_deg = (1e-3 * number(&format!("sigma_{name}_mrad"))).to_degrees();
            assert!(
                off_deg.abs() < 4.0 * sigma_deg,
                "{name}: {off_deg} of {sigma_deg}"
            );
        }
    }
}

#[test]
fn the_other_centre_and_another_aim_are_taken() {
    let folder = plant();
    convert(&folder, &["--out", "helios"]).good();
    convert(
        &folder,
        &["--out", "utis", "--centroid", "utis", "--aim", "board"],
    )
    .good();
    let [helios, utis] =
        ["helios", "utis"].map(|of| rows(&folder.read(&format!("{of}/observations.csv"))));
    for (one, other) in helios.iter().zip(&utis) {
        let apart =
            |axis: &str| other[axis].parse::<f64>().unwrap() - one[axis].parse::<f64>().unwrap();
        // As the records were made.
        assert!(
            (apart("spot_east_m") - 0.01).abs() < 1e-5 && (apart("spot_up_m") - 0.02).abs() < 1e-5
        );
        assert_eq!(one["axis1_steps"], other["axis1_steps"]);
    }
    assert!(folder.read("utis/field.toml").contains("aim = \"board\""));
}

#[test]
fn records_that_say_too_little_are_left_aside() {
    let folder = plant();
    change(
        &folder,
        RECORD,
        "\"sun_azimuth\": 5.183052882858902",
        "\"sun_azimuth\": null",
    );
    let run = convert(&folder, &["--out", "plant"]);
    assert_eq!(run.code(), 1, "{}", run.stderr());
    let said = run.stderr();
    assert!(
        said.contains("1 record left aside, first 100137-calibration-properties.json: no sun"),
        "{said}"
    );
    assert_eq!(rows(&folder.read("plant/observations.csv")).len(), 23);
    let quiet = convert(&folder, &["--out", "plant", "-q"]);
    assert_eq!((quiet.code(), quiet.stderr().as_str()), (1, ""));
}

#[test]
fn spots_off_their_plane_are_counted() {
    let folder = plant();
    // Two metres farther to the north: 2 m / 111.25 km.
    change(&folder, RECORD, "50.89998202223", "50.9");
    let run = convert(&folder, &["--out", "plant"]);
    run.good();
    assert!(
        run.stderr()
            .contains("1 of 24 spots lie more than 2 cm off the plane"),
        "{}",
        run.stderr()
    );
}

#[test]
fn a_folder_of_others_is_left_as_it_is() {
    let folder = plant();
    std::fs::create_dir(folder.path().join("plant")).unwrap();
    folder.write("plant/drives.csv", "mine");
    let refused = convert(&folder, &["--out", "plant"]);
    assert_eq!(refused.code(), 2);
    assert!(
        refused.stderr().contains("drives.csv is there already"),
        "{}",
        refused.stderr()
    );
    assert_eq!(folder.read("plant/drives.csv"), "mine");
    std::fs::remove_file(folder.path().join("plant/drives.csv")).unwrap();

    convert(&folder, &["--out", "plant"]).good();
    let first = folder.read("plant/field.toml");
    convert(&folder, &["--out", "plant"]).good();
    assert_eq!(
        folder.read("plant/field.toml"),
        first,
        "the same again, over what it wrote itself"
    );
    change(
        &folder,
        "plant/field.toml",
        "axis_azimuth_deg = 90",
        "axis_azimuth_deg = 91",
    );
    let changed = folder.read("plant/field.toml");
    let refused = convert(&folder, &["--out", "plant"]);
    assert_eq!(refused.code(), 2);
    assert!(
        refused.stderr().contains("which was changed since"),
        "{}",
        refused.stderr()
    );
    assert_eq!(folder.read("plant/field.toml"), changed);

    // Records struck out by hand are no less worth.
    folder.write("plant/field.toml", &first);
    let seen = folder.read("plant/observations.csv");
    let fewer: Vec<&str> = seen.lines().take(5).collect();
    folder.write("plant/observations.csv", fewer.join("\n"));
    let refused = convert(&folder, &["--out", "plant"]);
    assert_eq!(refused.code(), 2);
    assert!(
        refused
            .stderr()
            .contains("observations.csv is there already"),
        "{}",
        refused.stderr()
    );
    assert_eq!(folder.read("plant/observations.csv"), fewer.join("\n"));
}

#[test]
fn what_is_wrong_is_named_with_its_file() {
    let wrong: &[(&str, &str, &str, &str)] = &[
        (RECORD, "{", "[", "not valid JSON"),
        (
            RECORD,
            "axis_1_motor_position",
            "axis_3",
            "the key `motor_position.axis_1_motor_position` is missing",
        ),
        (
            RECORD,
            "33.9213524532655",
            "\"high\"",
            "sun_elevation must be a finite number, found \"high\"",
        ),
        (RECORD, "33.9213524532655", "1e999", "number out of range"),
        (
            RECORD,
            "121.68118\n",
            "121.68118, 1\n",
            "focal_spot.HeliOS must be 3 finite numbers, found 4 values",
        ),
        (
            RECORD,
            "\"focal_spot\"",
            "\"spot\"",
            "the key `focal_spot` is missing",
        ),
        (
            HELIOSTAT,
            "\"linear\"",
            "\"ideal\"",
            "actuators[0].type_axis must be \"linear\", found \"ideal\"",
        ),
        (
            HELIOSTAT,
            "\"joint_translation_e_1\": 0.0",
            "\"joint_translation_e_1\": 0.1",
            "here axes cross",
        ),
        (
            HELIOSTAT,
            "concentrator_translation_n",
            "other",
            "concentrator_translation_n` is missing",
        ),
        (
            TOWER,
            "\"planar\"",
            "\"round\"",
            "a planar target is missing",
        ),
        (
            TOWER,
            "\"power_plant_properties\"",
            "\"plant\"",
            "the key `power_plant_properties` is missing",
        ),
        (
            TOWER,
            "upper_left",
            "upper_l",
            "the key `board.coordinates.upper_left` is missing",
        ),
        (
            TOWER,
            "50.9,",
            "95.9,",
            "latitude must lie in -90..=90 degrees, found 95.9",
        ),
        (
            TOWER,
            "   0,\n   1,\n   0\n",
            "   0,\n   -1,\n   0\n",
            "run the other way round",
        ),
    ];
    for (file, from, to, said) in wrong {
        let folder = plant();
        change(&folder, file, from, to);
        let run = convert(&folder, &["--out", "plant"]);
        assert_eq!(run.code(), 2, "{said}: {}", run.stderr());
        let stderr = run.stderr();
        assert!(
            stderr.contains(said) && stderr.contains(file.rsplit('/').next().unwrap()),
            "{said}: {stderr}"
        );
        assert!(!folder.path().join("plant").exists(), "{said}");
    }
}

#[test]
fn wrong_calls_are_refused() {
    let folder = plant();
    let refused = |args: &[&str], said: &str| {
        let run = folder.run(&[&["convert", "paint"], args].concat());
        assert_eq!(run.code(), 2, "{}", run.stderr());
        assert!(run.stderr().contains(said), "{}", run.stderr());
    };
    let whole = ["--tower", TOWER, "--records", "paint", "--out", "plant"];
    refused(
        &[&whole[..], &["--aim", "bord"]].concat(),
        "--aim: no plane target `bord`",
    );
    refused(
        &[&whole[..], &["--centroid", "otsu"]].concat(),
        "--centroid",
    );
    refused(
        &["--tower", TOWER, "--records", "nowhere", "--out", "plant"],
        "nowhere",
    );
    refused(
        &[
            "--tower",
            "nowhere.json",
            "--records",
            "paint",
            "--out",
            "plant",
        ],
        "nowhere.json",
    );
    refused(
        &["--tower", TOWER, "--records", "paint/A1", "--out", "plant"],
        "-heliostat-properties.json is missing",
    );
    refused(
        &["--tower", TOWER, "--records", "paint", "--out", TOWER],
        "tower.json",
    );
}

/// The first axis of such a plant reads from a quarter turn below zero up, where angles count from zero.
#[test]
fn a_converted_plant_is_simulated_in_steps() {
    let folder = plant();
    convert(&folder, &["--out", "plant"]).good();
    let simulate = [
        "simulate",
        "observations",
        "--field",
        "plant/field.toml",
        "--count",
        "20",
        "--hours",
        "10-14",
    ];
    let seen = rows(&folder.run(&[&simulate[..], &["--steps"]].concat()).good());
    assert_eq!(seen.len(), 40);
    for row in &seen {
        for axis in ["axis1_steps", "axis2_steps"] {
            let steps: f64 = row[axis].parse().unwrap();
            assert!((0.0..=75451.0).contains(&steps), "{row:?}");
        }
    }
}
