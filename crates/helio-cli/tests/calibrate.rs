//! `calibrate` and `simulate observations`, from the command line to the files.

// Test helpers fail loudly; the lint knows only functions that are tests themselves.
#![allow(clippy::unwrap_used)]

mod common;

use std::collections::BTreeMap;
use std::io::Read;
use std::process::Stdio;
use std::time::{Duration, Instant};

use common::{DRIVES, FIELD, Folder, NOON, Run, rows};

const CALIBRATE: &[&str] = &[
    "calibrate",
    "--field",
    "field.toml",
    "--observations",
    "seen.csv",
];

fn simulate(folder: &Folder, more: &[&str]) -> Run {
    let args = ["simulate", "observations", "--field", "field.toml"];
    let run = folder.run(&[&args, more].concat());
    run.good();
    run
}

/// The small field and its observations.
fn seen(more: &[&str]) -> Folder {
    let folder = Folder::new();
    let args = ["--random-errors", "--seed", "7", "--out", "seen.csv"];
    simulate(&folder, &[&args, more].concat());
    folder
}

fn calibrate(folder: &Folder, more: &[&str]) -> Run {
    folder.run(&[CALIBRATE, more].concat())
}

fn number(row: &BTreeMap<String, String>, name: &str) -> f64 {
    row[name]
        .parse()
        .unwrap_or_else(|_| panic!("{name}: {}", row[name]))
}

#[test]
fn the_truth_is_found_and_tracked() {
    let folder = seen(&["--truth", "truth.csv", "--count", "80"]);
    let run = calibrate(&folder, &["--out", "calibration.csv"]);
    run.good();
    let (found, truth) = (
        rows(&folder.read("calibration.csv")),
        rows(&folder.read("truth.csv")),
    );
    assert_eq!(found.len(), 3);
    for (found, truth) in found.iter().zip(&truth) {
        assert_eq!(
            (&found["id"], found["status"].as_str()),
            (&truth["id"], "ok")
        );
        assert_eq!(
            number(found, "observations") + number(found, "rejected"),
            80.0
        );
        // 0.5 mrad in each direction on the target; the target is seen at an angle.
        let rms = number(found, "rms_mrad");
        assert!((0.55..0.85).contains(&rms), "{rms}");
        for name in [
            "axis_nonorthogonality",
            "mirror_tilt",
            "azimuth_reference",
            "elevation_reference",
        ] {
            let off_mrad = (number(found, &format!("{name}_deg"))
                - number(truth, &format!("{name}_deg")))
            .to_radians()
                * 1e3;
            let sigma_mrad = number(found, &format!("sigma_{name}_mrad"));
            assert!(
                sigma_mrad > 0.0 && off_mrad.abs() < 5.0 * sigma_mrad,
                "{name}"
            );
        }
    }
    // What was written is what tracking takes: back through the truth the beams hit to what is known.
    folder.write(
        "field.toml",
        format!("{FIELD}calibration = \"calibration.csv\"\n"),
    );
    folder
        .track(&[NOON, &["--out", "angles.csv"]].concat())
        .good();
    folder.write(
        "field.toml",
        format!("{FIELD}calibration = \"truth.csv\"\n"),
    );
    let predicted = folder.run(&["predict", "--field", "field.toml", "--angles", "angles.csv"]);
    for row in rows(&predicted.good()) {
        let mrad = number(&row, "beam_error_mrad");
        assert!(mrad < 1.0, "{mrad}");
    }
}

#[test]
fn threads_and_formats_say_the_same() {
    let folder = seen(&["--count", "30", "--outliers", "0.1"]);
    calibrate(&folder, &["--threads", "1", "--out", "one.csv"]).good();
    let printed = calibrate(&folder, &["--threads", "4", "-q"]).good();
    assert_eq!(folder.read("one.csv"), printed);
    calibrate(&folder, &["--out", "one.json"]).good();
    let objects: Vec<serde_json::Value> = serde_json::from_str(&folder.read("one.json")).unwrap();
    let rows = rows(&printed);
    assert_eq!(objects.len(), rows.len());
    for (object, row) in objects.iter().zip(&rows) {
        for (name, cell) in row {
            match &object[name] {
                serde_json::Value::Null => assert_eq!(cell, "", "{name}"),
                serde_json::Value::String(text) => assert_eq!(text, cell),
                // The parser of this test may round.
                value => {
                    let (value, cell) = (value.as_f64().unwrap(), cell.parse::<f64>().unwrap());
                    assert!((value - cell).abs() <= 1e-15 * cell.abs(), "{name}");
                }
            }
        }
    }
    // Motor steps say nearly what the angles say.
    folder.write("field.toml", format!("{FIELD}{DRIVES}"));
    simulate(
        &folder,
        &[
            "--random-errors",
            "--seed",
            "7",
            "--count",
            "30",
            "--outliers",
            "0.1",
            "--steps",
            "--out",
            "seen.csv",
        ],
    );
    let driven = common::rows(&calibrate(&folder, &[]).good());
    for (one, other) in rows.iter().zip(&driven) {
        let off = number(one, "azimuth_reference_deg") - number(other, "azimuth_reference_deg");
        assert!(off.abs() < 0.01, "{off}");
    }
}

#[test]
fn simulated_observations_depend_on_the_seed_alone() {
    let folder = seen(&["--count", "20"]);
    let first = folder.read("seen.csv");
    let again = ["--random-errors", "--count", "20", "--out", "seen.csv"];
    simulate(
        &folder,
        &[&again[..], &["--seed", "7", "--threads", "1"]].concat(),
    );
    assert_eq!(folder.read("seen.csv"), first);
    simulate(&folder, &[&again[..], &["--seed", "8"]].concat());
    assert_ne!(folder.read("seen.csv"), first);
    simulate(
        &folder,
        &[
            "--hours", "9-11", "--days", "3", "--ids", "A2", "--out", "seen.csv",
        ],
    );
    let rows = rows(&folder.read("seen.csv"));
    assert!(rows.iter().all(|row| row["heliostat_id"] == "A2"));
    let mut days: Vec<String> = rows
        .iter()
        .map(|row| row["time"][..10].to_owned())
        .collect();
    days.dedup();
    assert_eq!(days.len(), 3);
    // 6.25° west: solar time is UTC less 25 minutes, give or take the equation of time.
    for row in &rows {
        let clock: f64 = row["time"][11..13].parse::<f64>().unwrap()
            + row["time"][14..16].parse::<f64>().unwrap() / 60.0;
        assert!((9.0..12.0).contains(&clock), "{}", row["time"]);
    }
}

#[test]
fn wrong_records_are_listed_and_none_is_lost() {
    let folder = seen(&["--count", "60", "--outliers", "0.1"]);
    let table = folder.read("seen.csv");
    // One record again, one at night.
    let (repeated, night) = (table.lines().nth(5).unwrap(), table.lines().nth(6).unwrap());
    let night = format!("{}2025-06-21T01:00:00Z{}", &night[..3], &night[23..]);
    folder.write("seen.csv", format!("{table}{repeated}\n{night}\n"));
    let run = calibrate(&folder, &["--out", "c.csv", "--rejected", "rejected.csv"]);
    run.good();
    let listed = rows(&folder.read("rejected.csv"));
    let count = |reason: &str| listed.iter().filter(|row| row["reason"] == reason).count();
    assert_eq!((count("duplicate"), count("sun_below_horizon")), (1, 1));
    // 6 of 60 for each of the three; another may be rejected besides.
    assert!(
        (18..=21).contains(&count("outlier")),
        "{}",
        count("outlier")
    );
    let calibrated = rows(&folder.read("c.csv"));
    let used: f64 = calibrated
        .iter()
        .map(|row| number(row, "observations"))
        .sum();
    assert_eq!(used as usize + listed.len(), 182);
    let duplicate = listed
        .iter()
        .find(|row| row["reason"] == "duplicate")
        .unwrap();
    assert_eq!(
        (duplicate["line"].as_str(), duplicate["why"].as_str()),
        ("182", "it is line 6 again")
    );
    assert!(run.stderr().contains("left aside: 1"), "{}", run.stderr());
}

#[test]
fn a_record_of_a_time_still_to_come_moves_nothing() {
    let folder = seen(&["--count", "20"]);
    calibrate(&folder, &["--out", "c.csv"]).good();
    let table = folder.read("seen.csv");
    let line = table.lines().nth(5).unwrap();
    let late = format!("{}2200{}", &line[..3], &line[7..]);
    folder.write("seen.csv", format!("{table}{late}\n"));
    let run = calibrate(&folder, &["--out", "d.csv", "--rejected", "rejected.csv"]);
    run.good();
    let found = |name: &str| {
        let mut rows = rows(&folder.read(name));
        for row in &mut rows {
            row.remove("observations_hash");
        }
        rows
    };
    assert_eq!(found("d.csv"), found("c.csv"));
    let listed = rows(&folder.read("rejected.csv"));
    let found: Vec<_> = listed
        .iter()
        .map(|row| (&row["line"], &row["reason"]))
        .collect();
    assert!(
        found.contains(&(&"62".to_owned(), &"in_future".to_owned())),
        "{found:?}"
    );
    let said = run.stderr();
    assert!(said.contains("left aside: 1 (first: line 62)"), "{said}");
    // nothing else is there
    folder.write(
        "seen.csv",
        format!("{}\n{late}\n", table.lines().next().unwrap()),
    );
    let run = calibrate(&folder, &["--out", "e.csv"]);
    assert_eq!(run.code(), 2);
    assert!(
        run.stderr().contains("none of its 1 records can be used"),
        "{}",
        run.stderr()
    );
}

#[test]
fn jumps_make_epochs_that_tracking_dates() {
    let jump = "2025-07-01T00:00:00Z,9,-6";
    let folder = seen(&["--count", "80", "--jump", jump]);
    let args = ["--out", "c.csv", "--report", "page.html"];
    let run = calibrate(&folder, &args);
    run.good();
    let calibrated = rows(&folder.read("c.csv"));
    assert_eq!(calibrated.len(), 6);
    for pair in calibrated.chunks(2) {
        assert_eq!(
            (pair[0]["set"].as_str(), pair[1]["set"].as_str()),
            ("1", "2")
        );
        assert_eq!(pair[0]["valid_to"], pair[1]["valid_from"]);
        assert_eq!(
            (pair[0]["valid_from"].as_str(), pair[1]["valid_to"].as_str()),
            ("", "")
        );
        let (before, after) = (&pair[0]["last_time"], &pair[1]["first_time"]);
        assert!(before.as_str() < "2025-07-01" && after.as_str() > "2025-07-01");
        let step =
            number(&pair[1], "azimuth_reference_deg") - number(&pair[0], "azimuth_reference_deg");
        let sigma = |row| number(row, "sigma_azimuth_reference_mrad");
        let sigma_mrad = sigma(&pair[0]).hypot(sigma(&pair[1]));
        assert!(
            (step.to_radians() * 1e3 - 9.0).abs() < 5.0 * sigma_mrad,
            "{step} {sigma_mrad}"
        );
    }
    assert!(
        run.stderr()
            .contains("A1: the encoder references jumped between"),
        "{}",
        run.stderr()
    );
    let page = folder.read("page.html");
    assert!(page.starts_with("<!") && page.contains("<svg") && page.contains("A2"));
    assert!(!page.contains("http"), "nothing from outside");
    folder.write("field.toml", format!("{FIELD}calibration = \"c.csv\"\n"));
    let reading = |time: &str| -> f64 {
        number(
            &rows(&folder.track(&["--time", time]).good())[1],
            "azimuth_deg",
        )
    };
    // The same sun a year apart to within its drift, the encoder by the jump.
    let moved = reading("2025-12-21T12:00:00Z") - reading("2024-12-21T12:00:00Z");
    assert!((moved.to_radians() * 1e3 - 9.0).abs() < 4.0, "{moved}");
}

#[test]
fn an_earlier_calibration_is_compared() {
    let folder = seen(&["--count", "120"]);
    // Every other record: the same truth under other noise.
    let table = folder.read("seen.csv");
    let half = |odd: usize| -> String {
        let lines = table.lines().enumerate();
        let kept = lines.filter(|(k, _)| *k == 0 || k % 2 == odd);
        kept.map(|(_, line)| format!("{line}\n")).collect()
    };
    folder.write("seen.csv", half(0));
    calibrate(&folder, &["--out", "old.csv"]).good();
    let again = calibrate(&folder, &["--out", "new.csv", "--compare", "old.csv"]);
    again.good();
    let said = again.stderr();
    assert!(
        said.contains("3 heliostats with an earlier calibration, 0 of them changed significantly"),
        "{said}"
    );
    assert!(
        said.contains("A1: changed by 0.000 mrad over the year, not significantly"),
        "{said}"
    );
    folder.write("seen.csv", half(1));
    let others = calibrate(&folder, &["--out", "new.csv", "--compare", "old.csv"]);
    others.good();
    let said = others.stderr();
    assert!(!said.contains("changed by 0.000 mrad"), "{said}");
    assert!(said.contains(" 0 of them changed significantly"), "{said}");
    let other_truth = ["--random-errors", "--count", "60", "--seed", "8"];
    simulate(
        &folder,
        &[&other_truth[..], &["--out", "seen.csv"]].concat(),
    );
    let other = calibrate(&folder, &["--out", "new.csv", "--compare", "old.csv"]);
    other.good();
    let said = other.stderr();
    assert!(said.contains("3 of them changed significantly"), "{said}");
}

/// What a comparison said is found again by tracking with the new calibration and following the beams with the
/// old one.
fn follow_changes(
    folder: &Folder,
    more: &str,
    [old, new]: [&str; 2],
    said: &str,
    within_mrad: std::ops::Range<f64>,
) {
    let mut suns = "azimuth_deg,elevation_deg\n".to_owned();
    let (sin, cos) = 37.4_f64.to_radians().sin_cos();
    for step in 0..24 * 96 {
        let ecliptic = f64::from(step / 96 * 15).to_radians();
        let up = 23.436_f64.to_radians().sin() * ecliptic.sin();
        let across = (1.0 - up * up).sqrt();
        let hour = (f64::from(step % 96) * 3.75 - 180.0).to_radians();
        let height = up * sin + across * cos * hour.cos();
        if height >= 10.0_f64.to_radians().sin() {
            let north = up * cos - across * sin * hour.cos();
            let azimuth = (-across * hour.sin()).atan2(north).to_degrees();
            let elevation = height.asin().to_degrees();
            suns += &format!("{},{elevation}\n", azimuth.rem_euclid(360.0));
        }
    }
    folder.write("suns.csv", suns);
    let plain = format!("{FIELD}{more}");
    let calibrated =
        |by: &str| folder.write("field.toml", format!("{plain}calibration = \"{by}\"\n"));
    calibrated(new);
    let args = ["--suns", "suns.csv", "--out", "angles.csv"];
    assert!(folder.track(&args).code() <= 1);
    calibrated(old);
    let args = ["predict", "--field", "field.toml", "--angles", "angles.csv"];
    let predicted = rows(&folder.run(&args).stdout());
    folder.write("field.toml", plain);
    for id in ["A1", "A2", "B, 3"] {
        let squares: Vec<f64> = predicted
            .iter()
            .filter(|row| row["id"] == id && row["status"] == "ok")
            .map(|row| number(row, "beam_error_mrad").powi(2))
            .collect();
        assert!(squares.len() > 800, "{}", squares.len());
        let wanted = (squares.iter().sum::<f64>() / squares.len() as f64).sqrt();
        let begin = format!("{id}: changed by ");
        let line = said.lines().find_map(|line| line.strip_prefix(&begin));
        let words = line.unwrap().split_whitespace().next();
        let mrad: f64 = words.unwrap().parse().unwrap();
        assert!((mrad / wanted - 1.0).abs() < 0.01, "{id}: {mrad} {wanted}");
        assert!(within_mrad.contains(&mrad), "{id}: {mrad}");
    }
}

/// A table holds the pose errors that its fits stood on, serves a field that knows none, and is compared with
/// another by its own.
#[test]
fn calibration_tables_have_pose_errors_of_their_own() {
    let pose = "axis1_sag_deg = 0.1\naxis2_sag_deg = 0.2\naxis2_eccentricity_deg = -0.07\n";
    let names = ["axis1_sag_deg", "axis2_sag_deg", "axis2_eccentricity_deg"];
    let folder = Folder::new();
    let pose_field = format!("{FIELD}{pose}");
    folder.write("field.toml", &pose_field);
    let args = ["--random-errors", "--seed", "7", "--count", "80"];
    simulate(&folder, &[&args[..], &["--out", "seen.csv"]].concat());
    calibrate(&folder, &["--out", "new.csv"]).good();
    let table = folder.read("new.csv");
    for row in rows(&table) {
        assert_eq!(names.map(|name| number(&row, name)), [0.1, 0.2, -0.07]);
        assert!(number(&row, "rms_mrad") < 0.85, "{row:?}");
    }
    // by the layout's or by the table's
    let track = |field: String| {
        folder.write("field.toml", field);
        folder.track(NOON).good()
    };
    let calibrated = "calibration = \"new.csv\"\n";
    let by_both = track(format!("{pose_field}{calibrated}"));
    assert_eq!(track(format!("{FIELD}{calibrated}")), by_both);
    assert_ne!(track(FIELD.to_owned()), by_both);

    // The same but for an eccentricity that is not what it was.
    let lines: Vec<Vec<&str>> = table
        .lines()
        .map(|line| line.split(',').collect())
        .collect();
    let of = |name: &str| lines[0].iter().position(|column| *column == name).unwrap();
    let (id, place) = (of("id"), of(names[2]));
    let mut old = String::new();
    for (number, line) in lines.iter().enumerate() {
        let mut line = line.clone();
        // a comma in an id moves what is after it
        let moved = usize::from(line[id].starts_with('"'));
        if number > 0 {
            line[place + moved] = "0.05";
        }
        old += &format!("{}\n", line.join(","));
    }
    folder.write("old.csv", old);
    folder.write("field.toml", &pose_field);
    let run = calibrate(&folder, &["--out", "again.csv", "--compare", "old.csv"]);
    run.good();
    let said = run.stderr();
    assert!(
        said.contains("whether significantly is not known: its pose errors are others"),
        "{said}"
    );
    follow_changes(&folder, pose, ["old.csv", "new.csv"], &said, 1.0..5.0);
    // and with the very same nothing has changed, whatever the layout states now
    folder.write("old.csv", table);
    folder.write("field.toml", format!("{FIELD}{calibrated}"));
    let same = calibrate(&folder, &["--out", "again.csv", "--compare", "old.csv"]).stderr();
    assert!(
        same.contains("A1: changed by 0.000 mrad over the year, not significantly"),
        "{same}"
    );
}

/// Sets are compared by what they tell the axes at each hour, however many there are on either side.
#[test]
fn an_earlier_calibration_of_another_number_of_sets_is_compared() {
    let folder = seen(&["--count", "80"]);
    calibrate(&folder, &["--out", "new.csv"]).good();
    // The same all day, and the same in the morning only: after noon the second axis 2 mrad off.
    let off_deg = 0.002_f64.to_degrees();
    let two = |off_deg: f64| {
        let names = [
            "pedestal_tilt_deg",
            "pedestal_tilt_azimuth_deg",
            "axis_nonorthogonality_deg",
            "mirror_tilt_deg",
            "azimuth_reference_deg",
        ];
        let mut table = format!(
            "id,set,{},elevation_reference_deg,hour_angle_from_deg,hour_angle_to_deg,covariance\n",
            names.join(",")
        );
        for row in rows(&folder.read("new.csv")) {
            let same: Vec<&str> = names.iter().map(|name| row[*name].as_str()).collect();
            let reference_deg = number(&row, "elevation_reference_deg");
            for (set, add, from, to) in [("one", 0.0, "", "0"), ("other", off_deg, "0", "")] {
                let (id, same) = (row["id"].replace('"', ""), same.join(","));
                let (reference_deg, spread) = (reference_deg + add, &row["covariance"]);
                table += &format!("\"{id}\",{set},{same},{reference_deg},{from},{to},{spread}\n");
            }
        }
        table
    };
    folder.write("old.csv", two(off_deg));
    let run = calibrate(&folder, &["--out", "again.csv", "--compare", "old.csv"]);
    run.good();
    let said = run.stderr();
    assert!(
        said.contains("3 heliostats with an earlier calibration, 3 of them changed significantly"),
        "{said}"
    );
    assert!(said.contains("the greatest of 2 pairs of sets"), "{said}");
    follow_changes(&folder, "", ["old.csv", "new.csv"], &said, 2.0..3.0);
    // Cut in two but the same: nothing has changed. And the other way round.
    folder.write("old.csv", two(0.0));
    let same = calibrate(&folder, &["--out", "again.csv", "--compare", "old.csv"]).stderr();
    assert!(same.contains("B, 3: changed by 0.000 mrad"), "{same}");
    let args = ["--sets", "2", "--out", "sets.csv", "--compare", "new.csv"];
    let run = calibrate(&folder, &args);
    run.good();
    let said = run.stderr();
    assert!(
        said.contains("3 heliostats with an earlier calibration, 0 of them changed significantly"),
        "{said}"
    );
}

#[test]
fn the_next_observations_are_proposed() {
    let folder = seen(&["--count", "12", "--days", "2"]);
    let plan = ["--plan", "4", "--plan-date", "2026-03-20"];
    let run = calibrate(
        &folder,
        &[&plan[..], &["--max-year-pointing-mrad", "50"]].concat(),
    );
    let proposed = rows(&run.stdout());
    assert_eq!(proposed.len(), 12, "{}", run.stderr());
    for row in &proposed {
        assert_eq!(
            (&row["time"][..10], row["target"].as_str()),
            ("2026-03-20", "receiver")
        );
        assert!(number(row, "sun_elevation_deg") >= 9.9);
        let (before, after) = (
            number(row, "year_pointing_before_mrad"),
            number(row, "year_pointing_after_mrad"),
        );
        assert!(after < before, "{after} {before}");
    }
    let args = [&plan[..], &["--plan-out", "plan.json", "--out", "c.csv"]].concat();
    calibrate(&folder, &args);
    assert!(
        folder
            .read("plan.json")
            .contains("year_pointing_after_mrad")
    );
    assert!(folder.read("c.csv").starts_with("id,set,"));
}

#[test]
fn sets_over_the_day_are_written_as_tracking_reads_them() {
    let folder = seen(&["--count", "80"]);
    let run = calibrate(&folder, &["--sets", "2", "--out", "c.csv"]);
    run.good();
    let sets = rows(&folder.read("c.csv"));
    assert_eq!(sets.len(), 6);
    assert_eq!(
        (sets[0]["set"].as_str(), sets[1]["set"].as_str()),
        ("morning", "afternoon")
    );
    assert_eq!(sets[0]["hour_angle_to_deg"], sets[1]["hour_angle_from_deg"]);
    assert!(
        run.stderr().contains("sets over the day: 1 "),
        "{}",
        run.stderr()
    );
    folder.write("field.toml", format!("{FIELD}calibration = \"c.csv\"\n"));
    folder.track(NOON).good();
    // One truth all day: one set is enough.
    folder.write("field.toml", FIELD);
    let run = calibrate(&folder, &["--sets", "auto", "--out", "c.csv"]);
    run.good();
    assert!(rows(&folder.read("c.csv")).len() <= 4, "{}", run.stderr());
}

/// A set that its own records do not determine is not used; in its hours the common set holds.
#[test]
fn a_set_over_the_day_passes_the_gate_or_the_common_one_holds() {
    let noise = ["--noise-mrad", "2", "--seed", "3", "--random-errors"];
    let folder = Folder::new();
    let campaign = |hours: &str, more: &[&str]| -> String {
        let args = ["--hours", hours, "--out", "part.csv"];
        simulate(&folder, &[&args, &noise[..], more].concat());
        folder.read("part.csv")
    };
    let morning = campaign("5-12", &["--count", "120"]);
    let noon = campaign("13-14", &["--count", "4", "--days", "1"]);
    let (_, noon) = noon.split_once('\n').unwrap();
    folder.write("seen.csv", format!("{morning}{noon}"));
    calibrate(&folder, &["--out", "one.csv"]).good();
    let args = ["--sets", "2", "--out", "two.csv", "--report", "page.html"];
    let run = calibrate(&folder, &args);
    run.good();
    let (one, two) = (rows(&folder.read("one.csv")), rows(&folder.read("two.csv")));
    let said = "the common set holds: its own records leave the beam uncertain by ";
    let mut refused = 0;
    for common in &one {
        let id = &common["id"];
        let sets: Vec<_> = two.iter().filter(|set| &set["id"] == id).collect();
        for set in &sets {
            assert_eq!(set["status"], "ok");
            // No set is called better known than the one that it departs from.
            let (own, whole) = (
                number(set, "year_pointing_mrad"),
                number(common, "year_pointing_mrad"),
            );
            assert!((whole..=2.0).contains(&own), "{id}: {own} {whole}");
        }
        let Some(afternoon) = sets.iter().find(|set| set["set"] == "afternoon") else {
            continue;
        };
        assert_eq!(afternoon["hour_angle_from_deg"], "0.0");
        if afternoon["why"].is_empty() {
            continue;
        }
        refused += 1;
        assert!(afternoon["why"].starts_with(said), "{}", afternoon["why"]);
        let line = format!("{id}: set afternoon: {said}");
        assert!(run.stderr().contains(&line), "{}", run.stderr());
        for name in [
            "pedestal_tilt_deg",
            "mirror_tilt_deg",
            "azimuth_reference_deg",
        ] {
            assert_eq!(afternoon[name], common[name], "{id}: {name}");
        }
    }
    assert!(refused > 0, "{}", run.stderr());
    assert!(folder.read("page.html").contains(said));
    // No records at all of an afternoon: its hours have a set nevertheless.
    folder.write("seen.csv", morning);
    let run = calibrate(&folder, &["--sets", "2", "--out", "two.csv"]);
    run.good();
    for row in rows(&folder.read("two.csv")) {
        let empty = row["set"] == "afternoon" && row["observations"] == "0";
        assert_eq!(
            row["why"].contains("no records of these hours"),
            empty,
            "{row:?}"
        );
    }
}

/// What is said of the sets taken is what predict leaves with the table written, also where the common set holds.
#[test]
fn sets_over_the_day_are_judged_as_written() {
    let folder = Folder::new();
    let campaign = |hours: &str, more: &[&str]| -> String {
        let args = ["--hours", hours, "--out", "part.csv"];
        simulate(&folder, &[&args, more].concat());
        folder.read("part.csv")
    };
    let morning = campaign("6-11.5", &["--seed", "3", "--count", "30"]);
    let args = ["--seed", "4", "--count", "12", "--days", "2"];
    // A quarter of a degree off on the first axis.
    let afternoon: String = campaign("13-14", &args)
        .lines()
        .skip(1)
        .map(|line| {
            let mut cells = split(line);
            cells[2] = (cells[2].parse::<f64>().unwrap() + 0.25).to_string();
            cells.join(",") + "\n"
        })
        .collect();
    folder.write("seen.csv", format!("{morning}{afternoon}"));
    let args = ["--sets", "2", "--keep-all", "--no-jumps", "--out", "c.csv"];
    let run = calibrate(&folder, &args);
    run.good();
    let seen = rows(&folder.read("seen.csv"));
    let mut angles = "id,time,axis1_deg,axis2_deg\n".to_owned();
    for row in &seen {
        let cells = ["time", "axis1_deg", "axis2_deg"].map(|name| row[name].as_str());
        angles += &format!("\"{}\",{}\n", row["heliostat_id"], cells.join(","));
    }
    folder.write("angles.csv", angles);
    folder.write("field.toml", format!("{FIELD}calibration = \"c.csv\"\n"));
    let predicted = folder.run(&["predict", "--field", "field.toml", "--angles", "angles.csv"]);
    let predicted = rows(&predicted.good());
    let table = rows(&folder.read("c.csv"));
    let said = run.stderr();
    let mut fallen = 0;
    for (id, pivot) in [
        ("A1", [-40.0, 100.0, 3.0]),
        ("A2", [0.5, 110.0, 3.0]),
        ("B, 3", [60.0, 240.0, 3.0]),
    ] {
        let (mut sum, mut count) = (0.0, 0.0);
        for (row, then) in seen.iter().zip(&predicted) {
            if row["heliostat_id"] != id {
                continue;
            }
            assert_eq!((&row["time"], id), (&then["time"], then["id"].as_str()));
            // The target's right is west, its down leans with it.
            let way = |row| {
                let (u, v) = (number(row, "u_m"), number(row, "v_m"));
                let tall = 1.09_f64.sqrt();
                let point = [-u, -0.3 / tall * v, 120.0 - v / tall];
                [0, 1, 2].map(|k| point[k] - pivot[k])
            };
            let (a, b) = (way(row), way(then));
            let dot = |a: [f64; 3], b: [f64; 3]| -> f64 { (0..3).map(|k| a[k] * b[k]).sum() };
            let off = [0, 1, 2].map(|k| a[k] - b[k]);
            let along = dot(off, a) / dot(a, a).sqrt();
            sum += (dot(off, off) - along * along) / dot(a, a);
            count += 1.0;
        }
        let wanted = 1e3 * f64::sqrt(sum / count);
        let begin = format!("{id}: sets over the day: ");
        let line = said.lines().find_map(|line| line.strip_prefix(&begin));
        let choice = line.unwrap().split("; ").find(|c| c.ends_with(", taken"));
        let choice = choice.unwrap();
        let mrad: f64 = choice.split(' ').nth(1).unwrap().parse().unwrap();
        assert!(choice.starts_with("2 "), "{said}");
        // Two digits are printed, and the mirror stands 0.2 m before its pivot.
        assert!((mrad - wanted).abs() < 0.01, "{id}: {mrad} {wanted}");
        let held = table
            .iter()
            .any(|row| row["id"] == id && !row["why"].is_empty());
        fallen += usize::from(held);
        assert_eq!(choice.contains("days left out"), !held, "{said}");
    }
    assert!((1..3).contains(&fallen), "{said}");
}

/// A prior weighs as it says beside the noise of the records, stated or not.
#[test]
fn a_prior_needs_no_stated_noise() {
    let folder = seen(&["--count", "40"]);
    let prior = ["--prior", "mirror_tilt=1:0.2"];
    let stated = rows(&calibrate(&folder, &prior).good());
    let free = rows(&calibrate(&folder, &[]).good());
    let bare: String = folder
        .read("seen.csv")
        .lines()
        .map(|line| format!("{}\n", line.rsplit_once(',').unwrap().0))
        .collect();
    assert!(!bare.contains("sigma_m"));
    folder.write("seen.csv", bare);
    let run = calibrate(&folder, &prior);
    for ((bare, stated), free) in rows(&run.good()).iter().zip(&stated).zip(&free) {
        let [bare, stated, free] = [bare, stated, free].map(|row| number(row, "mirror_tilt_deg"));
        // Half-way in between; the noise is known to a tenth, so its weight to a fifth.
        let way = (stated - free) / (1.0 - free);
        assert!((0.2..0.8).contains(&way), "{way}");
        let other = (bare - free) / (1.0 - free);
        assert!((other / way - 1.0).abs() < 0.2, "{other} {way}");
    }
    let note = "note: --prior without sigma_m: ";
    assert!(run.stderr().contains(note), "{}", run.stderr());
}

/// A prior that the records contradict is named, and no jumps are made up to please it.
#[test]
fn a_prior_that_is_wrong_is_named() {
    let folder = seen(&["--count", "40"]);
    let free = rows(&calibrate(&folder, &[]).good());
    let prior = ["--prior", "azimuth_reference=90:0.001", "--out", "c.csv"];
    let run = calibrate(&folder, &prior);
    assert_eq!(run.code(), 1, "{}", run.stderr());
    assert!(!run.stderr().contains("jumped"), "{}", run.stderr());
    for (row, free) in rows(&folder.read("c.csv")).iter().zip(&free) {
        assert_eq!(row["status"], "prior_contradicted");
        assert!(row["azimuth_reference_deg"].is_empty());
        let begin = "the prior on the azimuth reference contradicts the records: they say ";
        let words = row["why"].strip_prefix(begin).unwrap();
        assert!(words.ends_with(" degrees, the prior 90 ± 0.001"), "{words}");
        // As it is found without the prior, rounded to the digits shown.
        let found = number(free, "azimuth_reference_deg");
        let sigma = number(free, "sigma_azimuth_reference_mrad");
        let shown = words.split(" degrees").next().unwrap();
        let error = (sigma / 1e3).to_degrees();
        assert_eq!(shown, format!("{found:.2} ± {error:.2}"));
    }
    // A prior a few standard deviations off is none of these.
    let near = calibrate(&folder, &["--prior", "azimuth_reference=0:0.2"]);
    near.good();
}

/// What is fitted is not lost where its place turns out to be full.
#[cfg(target_os = "linux")]
#[test]
fn a_failure_at_the_end_keeps_what_is_finished() {
    let folder = seen(&["--count", "20"]);
    let args = ["--out", "c.csv", "--rejected"];
    let run = calibrate(&folder, &[&args[..], &["/dev/full"]].concat());
    assert_eq!(run.code(), 2);
    let said = "error: /dev/full: cannot be written: no space left; what is finished is kept in c.csv.part: once \
                that is mended, repeat the command with --resume";
    assert!(run.stderr().contains(said), "{}", run.stderr());
    assert_eq!(lines_of_part(&folder), 4);
    let run = calibrate(&folder, &[&args[..], &["r.csv", "--resume"]].concat());
    run.good();
    let said = "resumed: 3 of 3 heliostats are finished";
    assert!(run.stderr().contains(said), "{}", run.stderr());
    assert!(!folder.path().join("c.csv.part").exists());
}

#[test]
fn parameters_are_held_and_known_before() {
    let folder = seen(&["--count", "40"]);
    let held = rows(&calibrate(&folder, &["--hold", "mirror_tilt,axis_nonorthogonality"]).stdout());
    for row in &held {
        assert_eq!(number(row, "mirror_tilt_deg"), 0.0);
        assert_eq!(row["sigma_mirror_tilt_mrad"], "");
    }
    let known = calibrate(&folder, &["--prior", "mirror_tilt=0.05:0.00001"]);
    for row in rows(&known.stdout()) {
        assert!((number(&row, "mirror_tilt_deg") - 0.05).abs() < 1e-3);
    }
    let offset = rows(&calibrate(&folder, &["--fit-mirror-offset"]).stdout());
    assert!(
        offset
            .iter()
            .all(|row| row.contains_key("sigma_mirror_offset_m"))
    );
}

/// Numbers apart, which better fits may change.
fn without_numbers(text: &str) -> String {
    let mut plain = String::new();
    for c in text.chars() {
        if c.is_ascii_digit() {
            if !plain.ends_with('#') {
                plain.push('#');
            }
        } else {
            plain.push(c);
        }
    }
    plain.replace("#.#", "#")
}

/// Campaigns that cannot be right are not refused, nothing of them is lost, and what is wrong is named.
#[test]
fn what_is_wrong_with_a_campaign_is_named() {
    let mut said = String::new();
    let mut case =
        |title: &str, simulated: &[&str], change: &dyn Fn(&str) -> String, word: &str| {
            let folder = seen(simulated);
            let table = folder.read("seen.csv");
            let header = table.lines().next().unwrap();
            let rows_of: Vec<String> = table
                .lines()
                .skip(1)
                .map(change)
                .filter(|l| !l.is_empty())
                .collect();
            folder.write("seen.csv", format!("{header}\n{}\n", rows_of.join("\n")));
            let run = calibrate(&folder, &["--out", "c.csv"]);
            assert_eq!(run.code(), 1, "{title}: {}", run.stderr());
            for row in rows(&folder.read("c.csv")) {
                assert_eq!(row["status"], word, "{title}: {}", run.stderr());
                assert!(
                    row["pedestal_tilt_deg"].is_empty() && !row["why"].is_empty(),
                    "{title}"
                );
            }
            said.push_str(&format!("# {title}\n{}\n", without_numbers(&run.stderr())));
            // Nothing of it makes tracking worse.
            folder.write("field.toml", format!("{FIELD}calibration = \"c.csv\"\n"));
            assert_eq!(folder.track(NOON).code(), 2, "{title}");
        };
    let as_is = |line: &str| line.to_owned();
    let angles = |line: &str, of: &dyn Fn(f64, f64) -> (f64, f64)| {
        let mut cells: Vec<String> = split(line);
        let (one, two) = of(cells[2].parse().unwrap(), cells[3].parse().unwrap());
        (cells[2], cells[3]) = (one.to_string(), two.to_string());
        cells.join(",")
    };
    case("too few records", &["--count", "2"], &as_is, "too_few");
    case(
        "one record",
        &["--count", "1", "--ids", "A1"],
        &as_is,
        "too_few",
    );
    case(
        "angles in radians",
        &["--count", "40"],
        &|line| angles(line, &|a, b| (a.to_radians(), b.to_radians())),
        "encoder_in_radians",
    );
    case(
        "axes exchanged",
        &["--count", "40"],
        &|line| angles(line, &|a, b| (b, a)),
        "axes_swapped",
    );
    case(
        "half an hour of one day",
        &["--count", "12", "--days", "1", "--hours", "10-10.5"],
        &as_is,
        "undetermined",
    );
    insta::with_settings!({ omit_expression => true, prepend_module_to_snapshot => false }, {
        insta::assert_snapshot!("campaigns", said);
    });
}

/// Cells of a simple CSV line whose id may be quoted.
fn split(line: &str) -> Vec<String> {
    let quoted = line.strip_prefix('"').and_then(|rest| rest.split_once('"'));
    match quoted {
        Some((id, rest)) => {
            let mut cells = vec![format!("\"{id}\"")];
            cells.extend(rest[1..].split(',').map(str::to_owned));
            cells
        }
        None => line.split(',').map(str::to_owned).collect(),
    }
}

/// A field whose calibration takes some seconds.
fn long() -> Folder {
    let folder = Folder::new();
    let layout = [
        "simulate",
        "field",
        "--heliostats",
        "80",
        "--out",
        "all.csv",
    ];
    folder.run(&layout).good();
    let all = folder.read("all.csv");
    let north: Vec<&str> = all
        .lines()
        .enumerate()
        .filter(|(k, line)| {
            *k == 0 || line.split(',').nth(2).unwrap().parse::<f64>().unwrap() > 60.0
        })
        .map(|(_, line)| line)
        .collect();
    folder.write("heliostats.csv", north.join("\n"));
    simulate(
        &folder,
        &[
            "--random-errors",
            "--count",
            "150",
            "--outliers",
            "0.05",
            "--out",
            "seen.csv",
        ],
    );
    folder
}

fn lines_of_part(folder: &Folder) -> usize {
    let part = std::fs::read_to_string(folder.path().join("c.csv.part"));
    part.map_or(0, |text| text.matches('\n').count())
}

/// Starts a calibration and waits until some heliostats are finished.
fn begun(folder: &Folder, more: &[&str]) -> std::process::Child {
    let args = [CALIBRATE, &["--out", "c.csv", "--threads", "1"], more].concat();
    let before = lines_of_part(folder);
    let mut child = folder
        .command(&args)
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    let began = Instant::now();
    while lines_of_part(folder) < before + 3 {
        assert!(
            child.try_wait().unwrap().is_none(),
            "it was faster than this test"
        );
        assert!(began.elapsed() < Duration::from_secs(120));
        std::thread::sleep(Duration::from_millis(2));
    }
    child
}

#[cfg(unix)]
#[test]
fn a_killed_run_goes_on_to_the_same_bytes() {
    let folder = long();
    let reports = ["--rejected", "rejected.csv", "--report", "page.html"];
    let whole = calibrate(
        &folder,
        &[&["--out", "whole.csv", "--rejected", "all-rejected.csv"][..]].concat(),
    );
    assert!(whole.code() <= 1, "{}", whole.stderr());

    // Killed, twice; nothing that was finished is lost.
    let mut child = begun(&folder, &reports);
    child.kill().unwrap();
    child.wait().unwrap();
    let first = lines_of_part(&folder);
    assert!(first >= 3 && !folder.path().join("c.csv").exists());
    let mut child = begun(&folder, &[&["--resume"], &reports[..]].concat());
    child.kill().unwrap();
    child.wait().unwrap();
    let second = lines_of_part(&folder);
    assert!(second > first);

    // Without --resume, or as another run, nothing happens to it.
    let part = folder.read("c.csv.part");
    let refused = |more: &[&str]| {
        let run = calibrate(&folder, &[&["--out", "c.csv"], more].concat());
        assert_eq!(run.code(), 2, "{}", run.stderr());
        assert_eq!(folder.read("c.csv.part"), part);
        run.stderr()
    };
    assert!(refused(&[]).contains("--resume goes on from there"));
    let other = refused(&["--resume", "--solver", "gauss-newton"]);
    assert!(
        other.contains("other inputs, options or another build"),
        "{other}"
    );
    let seen = folder.read("seen.csv");
    folder.write("seen.csv", format!("{seen}\n"));
    assert!(refused(&["--resume"]).contains("other inputs"));
    folder.write("seen.csv", seen);

    // Any number of threads goes on with it, and a line cut short is done again.
    folder.write("c.csv.part", &part[..part.len() - 7]);
    let run = calibrate(
        &folder,
        &[
            &["--out", "c.csv", "--resume", "--threads", "3"],
            &reports[..],
        ]
        .concat(),
    );
    assert_eq!(run.code(), whole.code(), "{}", run.stderr());
    let said = format!("resumed: {} of ", second - 2);
    assert!(run.stderr().contains(&said), "{said}: {}", run.stderr());
    assert!(folder.read("c.csv") == folder.read("whole.csv"));
    assert!(folder.read("rejected.csv") == folder.read("all-rejected.csv"));
    // What the kills left of the page is gone too.
    let left = |folder: &Folder| -> Vec<_> {
        let names = folder.contents().into_keys();
        names
            .filter(|path| path.extension().is_some_and(|suffix| suffix == "part"))
            .collect()
    };
    assert_eq!(left(&folder), Vec::<std::path::PathBuf>::new());

    // Two runs at once on different outputs do not disturb each other.
    let mut one = begun(&folder, &reports);
    let args = [
        "--out",
        "d.csv",
        "--report",
        "other.html",
        "--rejected",
        "r.csv",
    ];
    let beside = calibrate(&folder, &args);
    assert_eq!(beside.code(), whole.code(), "{}", beside.stderr());
    assert_eq!(one.wait().unwrap().code(), Some(whole.code()));
    for name in ["c.csv", "d.csv"] {
        assert!(folder.read(name) == folder.read("whole.csv"), "{name}");
    }
    for name in ["rejected.csv", "r.csv"] {
        assert!(
            folder.read(name) == folder.read("all-rejected.csv"),
            "{name}"
        );
    }
    assert!(folder.read("page.html").ends_with("</html>\n"));
    assert!(folder.read("other.html").ends_with("</html>\n"));
    assert_eq!(left(&folder), Vec::<std::path::PathBuf>::new());
}

/// Another build of the same version may differ in the last digit: what it has finished is not mixed in.
#[cfg(unix)]
#[test]
fn another_build_does_not_go_on() {
    let folder = long();
    let mut child = begun(&folder, &[]);
    child.kill().unwrap();
    child.wait().unwrap();
    let part = folder.read("c.csv.part");
    // The same program with a byte more, which no loader looks at.
    let mut program = std::fs::read(env!("CARGO_BIN_EXE_helio-rs")).unwrap();
    program.push(0);
    let other = folder.path().join("other-build");
    std::fs::copy(env!("CARGO_BIN_EXE_helio-rs"), &other).unwrap();
    std::fs::write(&other, program).unwrap();
    let resume = [CALIBRATE, &["--out", "c.csv", "--resume"]].concat();
    let run = std::process::Command::new(&other)
        .args(&resume)
        .current_dir(folder.path())
        .output()
        .unwrap();
    let said = String::from_utf8(run.stderr).unwrap();
    assert_eq!(run.status.code(), Some(2), "{said}");
    assert!(said.contains("another build"), "{said}");
    assert_eq!(folder.read("c.csv.part"), part);
    assert!(folder.run(&resume).code() <= 1);
}

#[cfg(unix)]
#[test]
fn an_interrupted_run_keeps_what_is_finished() {
    let folder = long();
    let mut child = begun(&folder, &["--report", "page.html"]);
    let id = child.id().to_string();
    let kill = std::process::Command::new("kill")
        .args(["-INT", &id])
        .status();
    assert!(kill.unwrap().success());
    let code = child.wait().unwrap().code();
    let mut said = String::new();
    child
        .stderr
        .take()
        .unwrap()
        .read_to_string(&mut said)
        .unwrap();
    assert_eq!(code, Some(130), "{said}");
    assert!(
        said.contains("are finished in c.csv.part: repeat the command with --resume"),
        "{said}"
    );
    let names: Vec<_> = folder
        .contents()
        .into_keys()
        .map(|path| path.file_name().unwrap().to_owned())
        .collect();
    assert_eq!(
        names,
        [
            "all.csv",
            "c.csv.part",
            "field.toml",
            "heliostats.csv",
            "seen.csv"
        ]
    );
    calibrate(&folder, &["--resume", "--out", "c.csv", "-q"]);
    assert!(folder.path().join("c.csv").exists() && !folder.path().join("c.csv.part").exists());
}
