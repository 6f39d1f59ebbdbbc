//! Records and the frames that belong to them, by name and by time.

use helio_io::{IoError, LeftAsideReason, Observations, load_observations_with_spots, load_spots};

use crate::files::Folder;

/// Reads a log and spots given apart, both without their headings.
fn joined(columns: &str, log: &str, spots: &str) -> Result<Observations, IoError> {
    let folder = Folder::of_field()
        .with("log.csv", format!("heliostat_id,target,{columns}\n{log}"))
        .with(
            "spots.csv",
            format!("file,time,u_m,v_m,sigma_m,status\n{spots}"),
        );
    let spots = load_spots(&folder.path("spots.csv"))?;
    load_observations_with_spots(&folder.path("log.csv"), Some(&spots), &folder.load()?)
}

fn by_name(names: &[&str], frames: &[&str]) -> Result<Observations, IoError> {
    let record = |(row, name): (usize, &&str)| {
        format!("A1,white,{name},2026-06-21T06:0{row}:00Z,17{row}.5,40.25\n")
    };
    let frame = |(row, name): (usize, &&str)| format!("{name},,0.{row},0.5,0.02,ok\n");
    joined(
        "file,time,axis1_deg,axis2_deg",
        &names.iter().enumerate().map(record).collect::<String>(),
        &frames.iter().enumerate().map(frame).collect::<String>(),
    )
}

/// Right of the target's centre, in tenths of a metre: which row of the spots it is.
fn frames_of(found: &Observations) -> Vec<f64> {
    let all = found.heliostats.iter().flat_map(|of| &of.observations);
    all.map(|seen| (10.0 * seen.u_m).round()).collect()
}

/// A frame of another folder is another frame.
#[test]
fn folders_of_names_must_agree() {
    let found = by_name(&["dayA/1.png", "dayB/2.png"], &["dayB/1.png", "dayB/2.png"]).unwrap();
    assert_eq!(frames_of(&found), [1.0]);
    assert_eq!(found.left_aside.len(), 1);
    assert_eq!(found.left_aside[0].record, 0);
    assert_eq!(found.left_aside[0].reason, LeftAsideReason::NoFrame);
    // as far as both tables name them
    let found = by_name(
        &["run/dayA/1.png", "2.png", "C:\\run\\dayB\\3.png"],
        &["dayB/3.png", "/data/run/dayA/1.png", "dayB/2.png"],
    )
    .unwrap();
    assert_eq!(frames_of(&found), [1.0, 2.0, 0.0]);
    assert!(found.left_aside.is_empty());
    // two days with frames of the same names
    let names = ["dayA/1.png", "dayB/1.png", "dayB/2.png", "dayA/2.png"];
    let frames = ["dayA/1.png", "dayA/2.png", "dayB/1.png", "dayB/2.png"];
    let found = by_name(&names, &frames).unwrap();
    assert_eq!(frames_of(&found), [0.0, 2.0, 3.0, 1.0]);
}

#[test]
fn names_that_may_mean_two_frames_are_refused() {
    for (name, frames) in [
        ("1.png", &["dayA/1.png", "dayB/1.png"][..]),
        ("dayA/1.png", &["x/dayA/1.png", "y/dayA/1.png"]),
        ("dayA/1.png", &["1.png", "x/dayA/1.png"]),
        ("1.png", &["1.png", "1.png"]),
    ] {
        let said = by_name(&[name], frames).unwrap_err().to_string();
        for words in [
            "log.csv:2",
            &format!("may be meant by `{name}`"),
            &format!("`{}` (line 2) and `{}` (line 3)", frames[0], frames[1]),
        ] {
            assert!(said.contains(words), "{words}: {said}");
        }
    }
}

const TIMED: &str = "time,axis1_deg,axis2_deg";

/// Tables that were put together may hold a frame twice: the same row again is the same frame, by name and by time.
#[test]
fn a_row_of_the_spots_again_is_one_frame() {
    let log = "A1,white,2026-06-21T06:00:00Z,170.5,40.25";
    let row = "day/1.png,2026-06-21T06:00:00Z,0.3,0.5,0.02,ok\n";
    let other = "day/2.png,2026-06-21T06:01:00Z,0.4,0.5,0.02,ok\n";
    let spots = format!("{row}{other}{row}");
    let found = joined(TIMED, &format!("{log}\n"), &spots).unwrap();
    assert_eq!(frames_of(&found), [3.0]);
    let named = format!("{TIMED},file");
    let found = joined(&named, &format!("{log},1.png\n"), &spots).unwrap();
    assert_eq!(frames_of(&found), [3.0]);
    // and of another place another one
    let moved = row.replace("0.3,", "0.31,");
    joined(TIMED, &format!("{log}\n"), &(row.to_owned() + &moved)).unwrap_err();
    joined(
        &named,
        &format!("{log},1.png\n"),
        &(row.to_owned() + &moved),
    )
    .unwrap_err();
}

/// By time, two frames of which either may be meant are refused, and the nearer of two is taken.
#[test]
fn a_time_with_two_frames_is_refused() {
    let log = "A1,white,2026-06-21T06:00:00Z,170.5,40.25\n";
    let frame =
        |time: &str, row: usize| format!("{row}.png,2026-06-21T{time}Z,0.{row},0.5,0.02,ok\n");
    let two = |one: &str, other: &str| joined(TIMED, log, &(frame(one, 0) + &frame(other, 1)));
    for (one, other) in [
        ("06:00:00", "06:00:00"),
        ("06:00:00.2", "06:00:00.2"),
        ("05:59:59.9", "05:59:59.9"),
        ("06:00:00.1", "05:59:59.9"),
    ] {
        let said = two(one, other).unwrap_err().to_string();
        for words in [
            "log.csv:2",
            "equally near",
            "`0.png` (line 2) and `1.png` (line 3)",
            "`file`",
        ] {
            assert!(said.contains(words), "{one} {other}: {words}: {said}");
        }
    }
    let nearer = two("06:00:00.04", "06:00:00").unwrap();
    assert_eq!(frames_of(&nearer), [1.0]);
    let nearer = two("06:00:00.04", "05:59:59.9").unwrap();
    assert_eq!(frames_of(&nearer), [0.0]);
    // two frames of another time concern nobody
    let far = joined(
        TIMED,
        log,
        &(frame("06:00:00", 0) + &frame("07:00:00", 1) + &frame("07:00:00", 2)),
    );
    assert_eq!(frames_of(&far.unwrap()), [0.0]);
}

/// By time too, a frame shows one pose.
#[test]
fn a_frame_of_two_poses_is_refused_by_time() {
    let spots =
        "0.png,2026-06-21T06:00:00Z,0,0.5,0.02,ok\n1.png,2026-06-21T06:00:02Z,0.1,0.5,0.02,ok\n";
    let record =
        |second: &str, axis1: &str| format!("A1,white,2026-06-21T06:00:{second}Z,{axis1},40.25\n");
    for (second, axis1) in [("00", "171.5"), ("00.3", "170.5"), ("00.3", "170.6")] {
        let log = record("00", "170.5") + &record("02", "170.7") + &record(second, axis1);
        let said = joined(TIMED, &log, spots).unwrap_err().to_string();
        for words in [
            "log.csv:4",
            "`0.png` is that of another pose or time too (line 2)",
            "one record a frame",
        ] {
            assert!(said.contains(words), "{second} {axis1}: {words}: {said}");
        }
    }
    // the same record again is a duplicate as ever
    let log = record("00", "170.5") + &record("00", "170.5") + &record("02", "170.7");
    let found = joined(TIMED, &log, spots).unwrap();
    assert_eq!(frames_of(&found), [0.0, 1.0]);
    assert_eq!(
        found.left_aside[0].reason,
        LeftAsideReason::Duplicate { of: 0 }
    );
}
