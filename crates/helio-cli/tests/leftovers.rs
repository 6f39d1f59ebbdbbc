//! `calibrate --joint --leftovers` and `track --leftovers`: what is left by pose, from records to set-points.

// Test helpers fail loudly; the lint knows only functions that are tests themselves.
#![allow(clippy::unwrap_used)]

mod common;

use std::f64::consts::TAU;
use std::path::Path;

use common::{Folder, rows};

const SUNS: &str = "azimuth_deg,elevation_deg\n100,25\n130,45\n180,60\n220,50\n250,30\n";

/// What readings of either axis are larger by in this pose \[rad\].
fn left(id: &str, [one, two]: [f64; 2]) -> [f64; 2] {
    let phase: f64 = id.bytes().map(f64::from).sum();
    [
        0.6e-3 * (4.0 * one + phase).sin() * (3.0 * two + phase).cos(),
        0.6e-3 * (4.0 * one + 2.0 * phase).cos() * (5.0 * two + phase).sin(),
    ]
}

/// Thirty heliostats of the example field, whose readings hold what no angle explains if `planted`.
fn seen(planted: bool) -> Folder {
    let folder = Folder::empty();
    let examples = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../examples");
    for name in ["field.toml", "heliostats.csv"] {
        std::fs::copy(examples.join(name), folder.path().join(name)).unwrap();
    }
    let args = "simulate observations --field field.toml --heliostats 30 --count 80 --random-errors \
                --noise-mrad 0.4 --seed 5 --truth truth.csv --out seen.csv";
    let args: Vec<&str> = args.split_whitespace().collect();
    folder.run(&args).good();
    if planted {
        let text = folder.read("seen.csv");
        let mut lines = text.lines();
        let mut out = format!("{}\n", lines.next().unwrap());
        for line in lines {
            let mut cells: Vec<String> = line.split(',').map(str::to_owned).collect();
            let pose = [2, 3].map(|k| cells[k].parse::<f64>().unwrap().to_radians());
            let by = left(&cells[0], pose);
            for axis in 0..2 {
                cells[2 + axis] = (pose[axis] + by[axis]).to_degrees().to_string();
            }
            out += &format!("{}\n", cells.join(","));
        }
        assert!(text.starts_with("heliostat_id,time,axis1_deg,axis2_deg,"));
        folder.write("seen.csv", out);
    }
    let field = folder.read("field.toml");
    for (name, calibration) in [("true.toml", "truth.csv"), ("calibrated.toml", "cal.csv")] {
        let with = format!("[heliostats]\ncalibration = \"{calibration}\"");
        folder.write(name, field.replacen("[heliostats]", &with, 1));
    }
    folder.write("suns.csv", SUNS);
    let args = "calibrate --field field.toml --observations seen.csv --joint --leftovers left.csv --out cal.csv";
    let args: Vec<&str> = args.split_whitespace().collect();
    let said = folder.run(&args);
    let said = said.stderr();
    assert_eq!(
        said.contains("no set-point is corrected"),
        !planted,
        "{said}"
    );
    folder
}

/// Rows of heliostats that were seen.
fn track(folder: &Folder, field: &str, more: &[&str]) -> Vec<(String, Vec<f64>)> {
    let args = ["track", "--field", field, "--suns", "suns.csv"];
    let known = folder.read("left.csv");
    let known: Vec<&str> = known
        .lines()
        .map(|l| l.split(',').next().unwrap())
        .collect();
    let columns = [
        "azimuth_deg",
        "elevation_deg",
        "leftover_axis1_mrad",
        "leftover_axis2_mrad",
        "sigma_axis1_mrad",
        "sigma_axis2_mrad",
    ];
    rows(&folder.run(&[&args, more].concat()).good())
        .into_iter()
        .filter(|row| known.contains(&row["id"].as_str()))
        .map(|row| {
            let numbers = columns
                .iter()
                .filter_map(|name| row.get(*name)?.parse().ok());
            (row["id"].clone(), numbers.collect())
        })
        .collect()
}

#[test]
fn set_points_come_nearer_to_the_truth_by_what_is_left() {
    let folder = seen(true);
    let truth = track(&folder, "true.toml", &[]);
    let plain = track(&folder, "calibrated.toml", &[]);
    let corrected = track(&folder, "calibrated.toml", &["--leftovers", "left.csv"]);
    assert!(truth.len() > 100, "{}", truth.len());
    assert_eq!(truth.len(), corrected.len());
    let (mut before, mut after, mut inside, mut count) = (0.0, 0.0, 0, 0);
    for ((truth, plain), corrected) in truth.iter().zip(&plain).zip(&corrected) {
        let pose = [truth.1[0], truth.1[1]].map(f64::to_radians);
        let wanted = left(&truth.0, pose);
        for axis in 0..2 {
            let off = |row: &(String, Vec<f64>)| {
                let error = row.1[axis].to_radians() - pose[axis] - wanted[axis];
                error - TAU * (error / TAU).round()
            };
            let added = (corrected.1[axis] - plain.1[axis]).to_radians();
            assert!((1e3 * added - corrected.1[2 + axis]).abs() < 1e-9);
            assert!(corrected.1[2 + axis].abs() <= 1.0 + 1e-9);
            // by what it turns the mirror
            let lever = [pose[1].cos(), 1.0][axis];
            before += (lever * off(plain)).powi(2);
            after += (lever * off(corrected)).powi(2);
            inside += usize::from(1e3 * off(corrected).abs() < 1.96 * corrected.1[4 + axis]);
            count += 1;
        }
    }
    let share = inside as f64 / f64::from(count);
    println!(
        "set-points off by {:.3} mrad without, {:.3} mrad with leftovers; {share:.3} of {count} within 95 %",
        1e3 * (before / f64::from(count)).sqrt(),
        1e3 * (after / f64::from(count)).sqrt()
    );
    assert!(after < 0.6 * before, "{after} {before}");
    assert!(share > 0.9, "{share}");

    // the way back takes the corrections out, and what was written is read
    let verify = ["--leftovers", "left.csv", "--verify", "--out", "angles.csv"];
    let args = ["track", "--field", "calibrated.toml", "--suns", "suns.csv"];
    let run = folder.run(&[&args, &verify[..]].concat());
    run.good();
    for row in rows(&folder.read("angles.csv")) {
        if row["status"] == "ok" {
            assert!(
                row["beam_error_mrad"].parse::<f64>().unwrap() < 0.1,
                "{row:?}"
            );
        }
    }
    let args = [
        "predict",
        "--field",
        "calibrated.toml",
        "--angles",
        "angles.csv",
    ];
    folder.run(&args).good();
    // of another calibration
    let said = folder.run(&[
        "track",
        "--field",
        "field.toml",
        "--suns",
        "suns.csv",
        "--leftovers",
        "left.csv",
        "--out",
        "b.csv",
    ]);
    assert!(
        said.stderr()
            .contains(" heliostats are now of another calibration")
    );
}

#[test]
fn nothing_is_corrected_where_nothing_is_left_and_wrong_files_are_refused() {
    let folder = seen(false);
    let plain = track(&folder, "calibrated.toml", &[]);
    for (plain, same) in plain.iter().zip(track(
        &folder,
        "calibrated.toml",
        &["--leftovers", "left.csv"],
    )) {
        assert_eq!(plain.1[..], same.1[..2]);
        assert_eq!(same.1[2..4], [0.0; 2]);
    }
    let joint = |file: &str| {
        folder.run(&[
            "calibrate",
            "--field",
            "field.toml",
            "--observations",
            "seen.csv",
            "--joint",
            "--leftovers",
            file,
            "--out",
            "other.csv",
        ])
    };
    let run = joint("left.json");
    assert_eq!(run.code(), 2);
    assert!(run.stderr().contains("wanted .csv or .parquet"));
    assert_eq!(joint("seen.csv").code(), 2);
    let wrong = folder.run(&[
        "track",
        "--field",
        "calibrated.toml",
        "--suns",
        "suns.csv",
        "--leftovers",
        "suns.csv",
    ]);
    assert_eq!(wrong.code(), 2);
}
