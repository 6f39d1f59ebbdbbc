//! `simulate images`, `spot` and `calibrate --spots`.

// Test helpers fail loudly; the lint knows only functions that are tests themselves.
#![allow(clippy::unwrap_used)]

mod common;

use std::collections::BTreeMap;
use std::io::Write;
use std::process::Stdio;

use common::{Folder, rows};

type Row = BTreeMap<String, String>;

fn number(row: &Row, name: &str) -> f64 {
    row[name]
        .parse()
        .unwrap_or_else(|_| panic!("{name} of {row:?}"))
}

fn simulated(args: &str) -> Folder {
    let folder = Folder::empty();
    let args: Vec<&str> = args.split_whitespace().collect();
    folder
        .run(&[&["simulate", "images", "--out", "f"], &args[..]].concat())
        .good();
    folder
}

fn spot(folder: &Folder, more: &[&str]) -> common::Run {
    folder.run(&[&["spot", "--target", "f/target.toml"], more].concat())
}

/// Distances from the truth \[m\].
fn misses(folder: &Folder, found: &str) -> Vec<f64> {
    let truth = rows(&folder.read("f/truth.csv"));
    rows(found)
        .iter()
        .zip(&truth)
        .map(|(found, truth)| {
            let off = |name| number(found, name) - number(truth, name);
            off("u_m").hypot(off("v_m"))
        })
        .collect()
}

#[test]
fn simulated_spots_are_found_where_they_are() {
    let folder = simulated("--frames 4 --seed 3 --turn-deg 12 --roll-deg 2 --distortion -0.05");
    for (more, within_m) in [
        (&[][..], 0.01),
        (&["--method", "standard", "--threshold", "multi:3"][..], 0.1),
    ] {
        let found = spot(&folder, &[&["f"], more].concat()).good();
        let misses = misses(&folder, &found);
        assert_eq!(misses.len(), 4);
        assert!(misses.iter().all(|&m| m < within_m), "{more:?} {misses:?}");
        for row in rows(&found) {
            assert_eq!(row["status"], "ok");
            assert!(row["flags"].contains("corners_given") && number(&row, "sigma_m") > 0.0);
        }
    }
}

#[test]
fn marks_are_looked_for_where_no_corners_are_given() {
    let folder =
        simulated("--frames 2 --seed 4 --turn-deg 12 --roll-deg 2 --find-marks --size 900x700");
    assert!(!folder.read("f/target.toml").contains("corners_px"));
    let found = spot(&folder, &["f"]).good();
    assert!(!found.contains("corners_given"));
    let misses = misses(&folder, &found);
    assert!(misses.iter().all(|&m| m < 0.02), "{misses:?}");
}

/// The range that the manual states; beyond it the target is not found, and no position is claimed.
#[test]
fn marks_are_found_in_the_range_stated() {
    for (pose, seen) in [
        ("--roll-deg 25", true),
        ("--turn-deg 40", true),
        ("--tilt-deg -40", true),
        ("--turn-deg -25 --tilt-deg 25 --roll-deg -10", true),
        ("--distortion -0.5", true),
        ("--distortion 0.5", true),
        ("--size 200x150", true),
        ("--roll-deg 30", false),
        ("--turn-deg 45", false),
    ] {
        let folder = simulated(&format!("--frames 3 --seed 11 --find-marks {pose}"));
        let run = spot(&folder, &["f"]);
        let found = rows(&run.stdout());
        if seen {
            assert!(
                found.iter().all(|row| row["status"] == "ok"),
                "{pose}: {found:?}"
            );
            let misses = misses(&folder, &run.stdout());
            assert!(misses.iter().all(|&m| m < 0.03), "{pose}: {misses:?}");
        } else {
            assert!(
                found.iter().all(|row| row["status"] == "no_target"),
                "{pose}"
            );
        }
    }
}

#[test]
fn any_number_of_threads_gives_the_same_bytes_in_the_order_of_the_frames() {
    let folder = simulated("--frames 5 --seed 2 --empty-every 2");
    let run = |threads: &str| {
        let run = spot(&folder, &["f/000004.png", "f", "--threads", threads]);
        assert_eq!(run.code(), 1, "two frames are empty");
        run.stdout()
    };
    let one = run("1");
    assert_eq!(one, run("3"));
    let names: Vec<String> = rows(&one).iter().map(|row| row["file"].clone()).collect();
    let status: Vec<String> = rows(&one).iter().map(|row| row["status"].clone()).collect();
    assert_eq!(names.len(), 5);
    assert!(names[0].ends_with("000004.png") && names[1].ends_with("000001.png"));
    assert_eq!(status, ["empty", "ok", "empty", "ok", "ok"]);
    let empty = &rows(&one)[0];
    assert!(empty["u_m"].is_empty() && empty["sigma_m"].is_empty());
}

#[test]
fn bad_frames_are_rows_and_stop_nobody() {
    let folder = simulated("--frames 2 --seed 2");
    folder.write("text.png", "this is no picture");
    let good = std::fs::read(folder.path().join("f/000001.png")).unwrap();
    folder.write("short.png", &good[..good.len() / 2]);
    folder.write("nothing.png", "");
    folder.write("bomb.pgm", "P5 40000 40000 255\n");
    let files = [
        "f/000001.png",
        "text.png",
        "short.png",
        "missing.png",
        "nothing.png",
        "bomb.pgm",
        "f/000002.png",
    ];
    let run = spot(&folder, &files);
    assert_eq!(run.code(), 1);
    let found = rows(&run.stdout());
    let status: Vec<&str> = found.iter().map(|row| row["status"].as_str()).collect();
    let bad = "unreadable";
    assert_eq!(status, ["ok", bad, bad, bad, bad, bad, "ok"]);
    for row in &found[1..6] {
        assert!(
            !row["reason"].is_empty() && row["u_m"].is_empty(),
            "{row:?}"
        );
    }
    assert!(found[3]["reason"].contains("cannot be read"));
    assert!(run.stderr().contains("5 of 7 frames"), "{}", run.stderr());
}

#[test]
fn raw_video_has_the_spots_of_its_frames_and_times() {
    let folder = simulated("--frames 3 --seed 6 --size 200x160");
    let files = rows(&spot(&folder, &["f"]).stdout());
    let mut video = Vec::new();
    for number in 1..=3 {
        let bytes = std::fs::read(folder.path().join(format!("f/00000{number}.png"))).unwrap();
        let limits = helio_spot::Limits::default();
        let helio_spot::Frame::Gray8(picture) = helio_spot::decode(&bytes, &limits).unwrap() else {
            panic!("8 bit wanted");
        };
        video.extend(picture.into_pixels());
    }
    video.extend([7; 100]);
    let args =
        "spot - --raw 200x160 --fps 25 --start 2026-06-21T14:00:00+02:00 --target f/target.toml";
    let args: Vec<&str> = args.split_whitespace().collect();
    let mut child = folder
        .command(&args)
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    child.stdin.take().unwrap().write_all(&video).unwrap();
    let run = common::Run(child.wait_with_output().unwrap());
    assert_eq!(run.code(), 1, "{}", run.stderr());
    let found = rows(&run.stdout());
    assert_eq!(found.len(), 4);
    for (video, file) in found.iter().zip(&files) {
        for name in ["u_m", "v_m", "sigma_m", "threshold"] {
            assert_eq!(video[name], file[name]);
        }
    }
    assert_eq!(found[1]["time"], "2026-06-21T12:00:00.04Z");
    assert_eq!(found[3]["status"], "unreadable");
    assert!(
        found[3]["reason"].contains("100 of its 32000 bytes"),
        "{:?}",
        found[3]
    );
}

#[test]
fn overlays_are_drawn_beside_the_frames() {
    let folder = simulated("--frames 2 --seed 1 --bits 16");
    for method in ["robust", "standard"] {
        spot(&folder, &["f", "--overlay", method, "--method", method]).good();
        for name in ["000001.png", "000002.png"] {
            let bytes = std::fs::read(folder.path().join(method).join(name)).unwrap();
            assert!(bytes.len() > 10_000);
        }
    }
    // Drawn again over what was drawn, and over nothing else.
    spot(&folder, &["f", "--overlay", "robust"]).good();
    std::fs::create_dir(folder.path().join("mine")).unwrap();
    folder.write("mine/000002.png", "mine");
    let run = spot(&folder, &["f", "--overlay", "mine"]);
    assert_eq!(run.code(), 2);
    assert!(
        run.stderr()
            .contains("is there already, and spot did not draw it"),
        "{}",
        run.stderr()
    );
    assert_eq!(folder.read("mine/000002.png"), "mine");
    let run = spot(&folder, &["f", "--overlay", "f"]);
    assert_eq!(run.code(), 2);
    assert!(
        run.stderr().contains("a frame that this run reads"),
        "{}",
        run.stderr()
    );
}

#[test]
fn wrong_calls_are_refused_with_what_is_wanted() {
    let folder = simulated("--frames 1");
    std::fs::create_dir(folder.path().join("empty")).unwrap();
    folder.write(
        "three.toml",
        "width_m = 8\nheight_m = 7\ncorners_px = [[0, 0], [9, 0], [9, 9]]\n",
    );
    let said = |args: &[&str]| {
        let run = folder.run(&[&["spot"], args].concat());
        assert_eq!(run.code(), 2, "{args:?}: {}", run.stderr());
        assert!(run.stdout().is_empty());
        run.stderr()
    };
    let t = ["--target", "f/target.toml"];
    let with = |args: &[&str]| said(&[&t, args].concat());
    assert!(with(&["empty"]).contains("without pictures"));
    assert!(with(&["*.gif"]).contains("no file matches"));
    assert!(with(&["-"]).contains("--raw WIDTHxHEIGHT"));
    assert!(with(&["f", "--raw", "8x8"]).contains("wanted - and no other file"));
    assert!(with(&["f", "--threshold", "fixed:80"]).contains("--method standard"));
    assert!(with(&["f", "--method", "standard", "--expected", "1,1"]).contains("--method robust"));
    assert!(with(&["f", "--threshold", "mean"]).contains("wanted otsu"));
    assert!(with(&["f", "--fps", "25"]).contains("--start"));
    assert!(with(&["f", "--fps", "25", "--start", "2026-06-21T12:00:00"]).contains("offset"));
    assert!(with(&["f", "--out", "f/000001.png", "--format", "csv"]).contains("this run reads it"));
    assert!(said(&["--target", "three.toml", "f"]).contains("three.toml:3:14"));
    assert!(with(&["-", "--raw", "65535x65535"]).contains("--raw"));
}

/// A heliostat whose spots are simulated, drawn into frames, found again and fitted: nearly as from the spots
/// themselves.
#[test]
fn frames_lead_to_a_calibration() {
    let folder = Folder::new();
    let run = |line: &str| {
        let args: Vec<&str> = line.split_whitespace().collect();
        folder.run(&args)
    };
    run(
        "simulate observations --field field.toml --ids A1 --count 12 --seed 4 --random-errors \
         --noise-mrad 0.2 --out seen.csv",
    )
    .good();
    let seen = rows(&folder.read("seen.csv"));
    let mut log = String::from("heliostat_id,file,time,axis1_deg,axis2_deg\n");
    let mut spots = String::from("file,time,u_m,v_m,sigma_m,status\n");
    for (index, row) in seen.iter().enumerate() {
        let [time, one, two] = ["time", "axis1_deg", "axis2_deg"].map(|name| &row[name]);
        log += &format!("A1,{index}.png,{time},{one},{two}\n");
        let status = match index {
            3 => "cut",
            5 => "saturated",
            7 => "ambiguous",
            _ => "ok",
        };
        let (u_m, v_m) = (&row["u_m"], &row["v_m"]);
        match index {
            8 => spots += &format!("run/{index}.png,{time},,,,empty\n"),
            9 => {}
            _ => spots += &format!("run/{index}.png,{time},{u_m},{v_m},0.02,{status}\n"),
        }
    }
    folder.write("log.csv", &log);
    folder.write("spots.csv", &spots);
    let whole = "calibrate --field field.toml --observations log.csv --spots spots.csv --keep-all \
                 --rejected rejected.csv";
    let apart = rows(&run(whole).stdout());
    let reasons: Vec<(String, String)> = rows(&folder.read("rejected.csv"))
        .iter()
        .map(|row| (row["line"].clone(), row["reason"].clone()))
        .collect();
    let wanted = [
        (5, "spot_cut"),
        (9, "spot_ambiguous"),
        (10, "spot_empty"),
        (11, "no_frame"),
    ];
    let wanted: Vec<(String, String)> = wanted
        .map(|(line, word)| (line.to_string(), word.to_owned()))
        .to_vec();
    assert_eq!(reasons, wanted);
    // The same records in one table.
    let mut one = String::from("heliostat_id,time,axis1_deg,axis2_deg,u_m,v_m,sigma_m\n");
    for (_, row) in seen
        .iter()
        .enumerate()
        .filter(|(i, _)| ![3, 7, 8, 9].contains(i))
    {
        let cells = ["time", "axis1_deg", "axis2_deg", "u_m", "v_m"].map(|name| row[name].as_str());
        one += &format!("A1,{},0.02\n", cells.join(","));
    }
    folder.write("one.csv", &one);
    let together =
        rows(&run("calibrate --field field.toml --observations one.csv --keep-all").stdout());
    for name in [
        "observations",
        "azimuth_reference_deg",
        "mirror_tilt_deg",
        "rms_mrad",
        "condition",
    ] {
        assert_eq!(apart[0][name], together[0][name], "{name}");
    }
    // By time instead of names.
    let by_time = log.replace(",file", ",record_id");
    folder.write("log.csv", by_time);
    let timed = rows(&run(whole).stdout());
    assert_eq!(timed[0]["rms_mrad"], apart[0]["rms_mrad"]);
    // Nothing that fits.
    folder.write("log.csv", log.replace(".png", ".jpg"));
    let said = run(whole);
    assert_eq!(said.code(), 2);
    assert!(
        said.stderr()
            .contains("none of the 12 records belongs to a frame"),
        "{}",
        said.stderr()
    );
    folder.write(
        "log.csv",
        log.replace("A1,", "A1,0.1,0.2,")
            .replace("heliostat_id,", "heliostat_id,u_m,v_m,"),
    );
    assert!(
        run(whole).stderr().contains("given apart"),
        "{}",
        run(whole).stderr()
    );
}

#[test]
fn a_file_named_twice_is_taken_once() {
    let folder = simulated("--frames 3 --seed 2");
    folder.write("list.txt", "f/000003.png\nf/../f/000001.png\n");
    let run = spot(&folder, &["f", "f", "@list.txt"]);
    assert_eq!(rows(&run.good()).len(), 3);
    let said = spot(&folder, &["f", "f", "@list.txt"]).stderr();
    assert!(
        said.contains("warning: 5 files named more than once and taken once, first f/000001.png"),
        "{said}"
    );
    assert!(!spot(&folder, &["f"]).stderr().contains("warning"));
}

#[test]
fn no_target_says_why() {
    let folder = simulated("--frames 1 --seed 2 --size 300x220");
    let corners = |[left, top]: [f64; 2], side: f64, more: &str| {
        let (right, low) = (left + side, top + side);
        folder.write(
            "t.toml",
            format!(
                "width_m = 8\nheight_m = 7\n{more}corners_px = [[{left}, {top}], [{right}, {top}], \
                 [{right}, {low}], [{left}, {low}]]\n"
            ),
        );
    };
    for method in ["robust", "standard"] {
        let said = || {
            let args = ["spot", "--target", "t.toml", "--method", method, "f"];
            let row = rows(&folder.run(&args).stdout()).remove(0);
            (row["status"].clone(), row["reason"].clone())
        };
        corners([1000.0, 10.0], 100.0, "");
        let (status, reason) = said();
        assert_eq!(status, "no_target");
        assert!(
            reason.contains("outside the picture") && reason.contains("300 x 220"),
            "{method}: {reason}"
        );
        // Corners of frames of another size.
        corners(
            [60.0, 40.0],
            150.0,
            "frame_width_px = 1200\nframe_height_px = 880\n",
        );
        let (status, reason) = said();
        assert_eq!(status, "no_target");
        assert!(
            reason.contains("300 x 220") && reason.contains("1200 x 880"),
            "{method}: {reason}"
        );
        corners(
            [60.0, 40.0],
            150.0,
            "frame_width_px = 300\nframe_height_px = 220\n",
        );
        assert_ne!(said().0, "no_target");
    }
    for side in [2.0, 10.0] {
        corners([60.0, 40.0], side, "");
        let args = ["spot", "--target", "t.toml", "f"];
        let row = rows(&folder.run(&args).stdout()).remove(0);
        if row["status"] == "no_target" {
            assert!(row["reason"].contains("too few pixels"), "{row:?}");
        }
    }
}

/// Files at which decoders panic are rows, and nobody reads of panics.
#[test]
fn hostile_files_are_told_in_a_line() {
    let folder = simulated("--frames 1");
    let found = concat!(
        env!("CARGO_MANIFEST_DIR"),
        "/../helio-spot/tests/corpus/found/*"
    );
    let run = spot(&folder, &[found, "--quiet"]);
    assert_eq!(run.stderr(), "");
    let all = rows(&run.stdout());
    assert!(all.len() > 200);
    assert!(
        all.iter()
            .any(|row| row["reason"].contains("the decoder gave up"))
    );
    for row in all {
        assert!(row["reason"].chars().count() <= 200, "{row:?}");
        assert_eq!(
            row["status"] == "unreadable",
            !row["reason"].is_empty() && row["status"] != "no_target"
        );
    }
}

/// Frames of observations show their spots, and the log names the frames.
#[test]
fn frames_of_observations_show_their_spots() {
    let folder = Folder::empty();
    folder.write(
        "seen.csv",
        "heliostat_id,time,axis1_deg,axis2_deg,u_m,v_m,sigma_m\n\
         A1,2026-06-21T09:00:00Z,12.5,30,1.25,-0.5,0.01\nA1,2026-06-21T10:00:00Z,13.5,31,-1,0.75,0.01\n",
    );
    let args = [
        "simulate",
        "images",
        "--observations",
        "seen.csv",
        "--out",
        "f",
    ];
    folder.run(&args).good();
    let log = folder.read("f/log.csv");
    assert_eq!(
        log,
        "heliostat_id,time,axis1_deg,axis2_deg,file\nA1,2026-06-21T09:00:00Z,12.5,30,000001.png\n\
         A1,2026-06-21T10:00:00Z,13.5,31,000002.png\n"
    );
    let found = rows(&spot(&folder, &["f"]).good());
    for (row, [u_m, v_m]) in found.iter().zip([[1.25, -0.5], [-1.0, 0.75]]) {
        let off = (number(row, "u_m") - u_m).hypot(number(row, "v_m") - v_m);
        assert!(off < 0.01, "{row:?}");
    }
    let both = folder.run(&[&args[..], &["--frames", "3"]].concat());
    assert_eq!(both.code(), 2);
    folder.write("seen.csv", "heliostat_id,u_m,v_m\nA1,1,2\nA1,,\n");
    let run = folder.run(&args);
    assert!(run.stderr().contains("seen.csv:3"), "{}", run.stderr());
}

#[test]
fn somebodys_files_are_kept() {
    let folder = Folder::empty();
    std::fs::create_dir(folder.path().join("keep")).unwrap();
    folder.write("keep/target.toml", "width_m = 3\nheight_m = 3\n");
    let before = folder.contents();
    let run = folder.run(&["simulate", "images", "--frames", "1", "--out", "keep"]);
    assert_eq!(run.code(), 2);
    assert!(
        run.stderr().contains("holds target.toml"),
        "{}",
        run.stderr()
    );
    assert!(folder.contents() == before);
    assert_eq!(
        folder.read("keep/target.toml"),
        "width_m = 3\nheight_m = 3\n"
    );
    // Its own are made anew, as long as nobody changed them.
    folder.write(
        "seen.csv",
        "heliostat_id,axis1_deg,axis2_deg,u_m,v_m\nA1,12.5,30,1.25,-0.5\n",
    );
    let make = |more: &[&str]| {
        let line = ["simulate", "images", "--out", "mine", "--size", "200x160"];
        folder.run(&[&line[..], more].concat())
    };
    let logged: &[&str] = &["--observations", "seen.csv"];
    let frames = ["--frames", "3"];
    for more in [
        &frames[..],
        &["--frames", "1"],
        &frames,
        logged,
        logged,
        &["--frames", "1"],
    ] {
        make(more).good();
    }
    let names = || {
        let all = std::fs::read_dir(folder.path().join("mine")).unwrap();
        let mut names: Vec<_> = all.map(|entry| entry.unwrap().file_name()).collect();
        names.sort();
        names
    };
    // frames of the run before would be taken for some of this one
    assert_eq!(
        names(),
        ["000001.png", "log.csv", "target.toml", "truth.csv"]
    );
    let changed = |name: &str, text: &[u8], more: &[&str]| {
        let path = folder.path().join("mine").join(name);
        let before = std::fs::read(&path).ok();
        std::fs::write(&path, text).unwrap();
        let run = make(more);
        assert_eq!(run.code(), 2, "{name}");
        let said = run.stderr();
        assert!(
            said.contains(&format!("mine holds {name}, which")),
            "{said}"
        );
        assert_eq!(std::fs::read(&path).unwrap(), text, "{name}");
        match before {
            Some(before) => std::fs::write(&path, before).unwrap(),
            None => std::fs::remove_file(&path).unwrap(),
        }
    };
    let own = folder.read("mine/target.toml");
    let one: &[&str] = &["--frames", "1"];
    changed("target.toml", b"width_m = 3\nheight_m = 3\n", one);
    changed("target.toml", own.replace("= 8.0", "= 8.1").as_bytes(), one);
    changed("target.toml", format!("# mine\n{own}").as_bytes(), one);
    changed("truth.csv", b"file,u_m,v_m\n000001.png,0,0\n", one);
    changed("000003.png", b"mine", &["--frames", "4"]);
    make(logged).good();
    changed("log.csv", b"file\n000001.png\n", logged);
    // a truth.csv of somebody makes no folder ours
    folder.write("keep/truth.csv", "file,u_m,v_m\n000001.png,0,0\n");
    let run = folder.run(&["simulate", "images", "--frames", "1", "--out", "keep"]);
    assert_eq!(run.code(), 2);
    assert!(
        run.stderr().contains("keep holds target.toml"),
        "{}",
        run.stderr()
    );
    make(one).good();
    folder.write("file", "");
    let run = folder.run(&[
        "spot",
        "--target",
        "mine/target.toml",
        "mine",
        "--overlay",
        "file",
    ]);
    assert_eq!(run.code(), 2);
    assert!(
        run.stderr()
            .contains("--overlay: file is a file; wanted a folder"),
        "{}",
        run.stderr()
    );
}

/// Times go by the place in the list, frames that cannot be read included; what is missing is told, and shifts nothing
/// with --numbered.
#[test]
fn missing_frames_shift_no_time_unsaid() {
    let folder = simulated("--frames 6 --seed 6 --size 200x160");
    let times = |more: &[&str]| -> (Vec<String>, String) {
        let line = ["f", "--fps", "2", "--start", "2026-06-21T12:00:00Z"];
        let run = spot(&folder, &[&line[..], more].concat());
        assert!(run.code() < 2, "{}", run.stderr());
        let all = rows(&run.stdout());
        let time =
            |row: &BTreeMap<String, String>| row["time"][17..].trim_end_matches('Z').to_owned();
        (all.iter().map(time).collect(), run.stderr())
    };
    folder.write("f/000002.png", "no picture");
    let (all, said) = times(&[]);
    assert_eq!(all, ["00", "00.5", "01", "01.5", "02", "02.5"]);
    assert!(!said.contains("numbers"), "{said}");
    assert_eq!(times(&["--numbered"]).0, all);
    // two frames are gone
    for name in ["f/000003.png", "f/000004.png"] {
        std::fs::remove_file(folder.path().join(name)).unwrap();
    }
    let (shifted, said) = times(&[]);
    assert_eq!(shifted, ["00", "00.5", "01", "01.5"]);
    for words in [
        "after f/000002.png comes f/000005.png (1 such place)",
        "--numbered",
    ] {
        assert!(said.contains(words), "{said}");
    }
    let (all, said) = times(&["--numbered"]);
    assert_eq!(all, ["00", "00.5", "02", "02.5"]);
    assert!(!said.contains("numbers"), "{said}");
    folder.write("f/later.png", "no picture");
    let line = "f --fps 2 --start 2026-06-21T12:00:00Z --numbered";
    let run = spot(&folder, &line.split_whitespace().collect::<Vec<_>>());
    assert_eq!(run.code(), 2);
    assert!(
        run.stderr().contains("f/later.png has no number"),
        "{}",
        run.stderr()
    );
}

/// A name is not enough where times tell otherwise, nor is one frame for several poses.
#[test]
fn frames_join_by_name_and_time() {
    let folder = Folder::new();
    let run = |line: &str| folder.run(&line.split_whitespace().collect::<Vec<_>>());
    run(
        "simulate observations --field field.toml --ids A1 --count 12 --seed 4 --random-errors \
         --noise-mrad 0.2 --out seen.csv",
    )
    .good();
    let seen = rows(&folder.read("seen.csv"));
    let write = |name: &dyn Fn(usize) -> String, time_of: &dyn Fn(usize) -> Option<usize>| {
        let mut log = String::from("heliostat_id,file,time,axis1_deg,axis2_deg\n");
        let mut spots = String::from("file,time,u_m,v_m,sigma_m,status\n");
        for (index, row) in seen.iter().enumerate() {
            let cell = |name: &str| row[name].clone();
            let named = name(index);
            log += &format!(
                "A1,{named},{},{},{}\n",
                cell("time"),
                cell("axis1_deg"),
                cell("axis2_deg")
            );
            let time = time_of(index).map_or(String::new(), |k| seen[k]["time"].clone());
            spots += &format!(
                "{index}.png,{time},{},{},0.02,ok\n",
                cell("u_m"),
                cell("v_m")
            );
        }
        folder.write("log.csv", log);
        folder.write("spots.csv", spots);
    };
    let whole = "calibrate --field field.toml --observations log.csv --spots spots.csv --keep-all";
    let own = |index: usize| format!("{index}.png");
    for times in [&Some as &dyn Fn(usize) -> Option<usize>, &|_| None] {
        write(&own, times);
        run(whole).good();
    }
    let refused = |words: &[&str]| {
        let run = run(whole);
        assert_eq!(run.code(), 2, "{}", run.stdout());
        for word in words {
            assert!(run.stderr().contains(word), "{word}: {}", run.stderr());
        }
    };
    // Frames of other times: as many records, each of the frame before.
    write(&own, &|index| Some((index + 1) % 12));
    refused(&["log.csv:2", "`0.png` was taken at", "wanted within 0.5 s"]);
    // All records of one frame.
    write(&|_| "0.png".to_owned(), &Some);
    refused(&["log.csv:3", "`0.png` was taken at"]);
    write(&|_| "0.png".to_owned(), &|_| None);
    refused(&["log.csv:3", "another pose or time too (line 2)"]);
}
