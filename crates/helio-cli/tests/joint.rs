//! `calibrate --joint` and `--update`: the field as one, from the command line to the files.

// Test helpers fail loudly; the lint knows only functions that are tests themselves.
#![allow(clippy::unwrap_used)]

mod common;

use std::collections::BTreeMap;
use std::path::Path;

use common::{FIELD, Folder, NOON, Run, rows};
use helio_calib::joint::simulate::{FieldCauses, FieldOptions, SimulatedField, simulate_field};
use helio_core::{PoseErrors, TrackingMode};

type Row = BTreeMap<String, String>;

/// Every so many heliostats of the example field, observed for a year.
fn seen(heliostats: &str, more: &[&str]) -> Folder {
    let folder = Folder::empty();
    let examples = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../examples");
    for name in ["field.toml", "heliostats.csv"] {
        std::fs::copy(examples.join(name), folder.path().join(name)).unwrap();
    }
    let args = [
        "simulate",
        "observations",
        "--field",
        "field.toml",
        "--heliostats",
        heliostats,
        "--random-errors",
        "--seed",
        "11",
        "--truth",
        "truth.csv",
        "--out",
        "seen.csv",
    ];
    folder.run(&[&args, more].concat()).good();
    folder
}

fn calibrate(folder: &Folder, more: &[&str]) -> Run {
    folder.run(&[&["calibrate", "--field", "field.toml"], more].concat())
}

fn number(row: &Row, name: &str) -> f64 {
    row[name]
        .parse()
        .unwrap_or_else(|_| panic!("{name}: {}", row[name]))
}

const DAY: &str = "2025-09-17";
const RECORDS: usize = 30;

/// A pitch-roll field of forty whose second axes sag, with targets that stand elsewhere, on disk: `seen.csv` and the
/// day after, `next.csv`. Of every ten heliostats the last three had 3 records, 1 and none.
fn sagging() -> (Folder, FieldOptions, SimulatedField) {
    let options = FieldOptions {
        heliostats: 40,
        records: RECORDS,
        next_day_records: 2,
        mode: TrackingMode::PitchRoll {
            axis_azimuth_rad: std::f64::consts::FRAC_PI_2,
        },
        causes: FieldCauses {
            pose_errors: PoseErrors {
                axis2_sag_rad: 3.6e-3,
                ..PoseErrors::NONE
            },
            target_shift_m: vec![[0.03, -0.05], [-0.04, 0.02], [0.06, 0.03]],
            ..FieldCauses::default()
        },
        outlier_probability: 0.01,
        ..FieldOptions::new(3).unwrap()
    };
    let field = simulate_field(&options).unwrap();
    let folder = Folder::empty();
    let mut toml = format!(
        "[site]\nname = \"Simulated\"\nlatitude_deg = {}\nlongitude_deg = {}\nelevation_m = 88.0\n",
        options.site.latitude_rad().to_degrees(),
        0.111_5_f64.to_degrees()
    );
    for (k, target) in options.targets.iter().enumerate() {
        let c = target.centre;
        toml += &format!(
            "[targets.board{k}]\ncentre_enu_m = [{:?}, {:?}, {:?}]\nnormal_enu = [0.0, 1.0, 0.0]\nwidth_m = 8.0\n\
             height_m = 7.0\n",
            c.east, c.north, c.up
        );
    }
    toml += "[heliostats]\ntable = \"heliostats.csv\"\naim = \"board0\"\nmode = \"pitch-roll\"\n\
             axis_azimuth_deg = 90\nmirror_offset_m = 0.18\n";
    folder.write("field.toml", toml);
    let mut layout = String::from("id,east_m,north_m,up_m\n");
    let head = "heliostat_id,time,axis1_deg,axis2_deg,target,u_m,v_m\n";
    let (mut seen, mut next) = (head.to_owned(), head.to_owned());
    for (k, heliostat) in field.heliostats.iter().enumerate() {
        let p = heliostat.mount.pivot;
        layout += &format!("S{k:02},{:?},{:?},{:?}\n", p.east, p.north, p.up);
        let kept = match k % 10 {
            7 => 3,
            8 => 1,
            9 => 0,
            _ => RECORDS,
        };
        for (record, o) in heliostat.observations.iter().enumerate() {
            let to = match record {
                record if record < kept => &mut seen,
                record if record >= RECORDS => &mut next,
                _ => continue,
            };
            *to += &format!(
                "S{k:02},{},{:?},{:?},board{},{:?},{:?}\n",
                helio_io::format_time(o.unix_ns.unwrap()),
                o.axis1_rad.to_degrees(),
                o.axis2_rad.to_degrees(),
                o.target,
                o.u_m,
                o.v_m
            );
        }
    }
    folder.write("heliostats.csv", layout);
    folder.write("seen.csv", seen);
    folder.write("next.csv", next);
    (folder, options, field)
}

/// The records of seen.csv from one time up to another.
fn part(folder: &Folder, name: &str, from: &str, to: &str) {
    let all = folder.read("seen.csv");
    let (header, records) = all.split_once('\n').unwrap();
    let column = header.split(',').position(|c| c == "time").unwrap();
    let mut out = format!("{header}\n");
    for line in records.lines() {
        let time = line.split(',').nth(column).unwrap();
        if from <= time && time < to {
            out.push_str(line);
            out.push('\n');
        }
    }
    folder.write(name, out);
}

fn bytes(folder: &Folder, name: &str) -> Vec<u8> {
    std::fs::read(folder.path().join(name)).unwrap()
}

const ANGLES: [&str; 4] = [
    "axis_nonorthogonality",
    "mirror_tilt",
    "azimuth_reference",
    "elevation_reference",
];

#[test]
fn following_half_the_records_comes_to_what_fitting_all_does() {
    // Without wrong records: of a doubtful one, half of the records may decide otherwise than all.
    let folder = seen("40", &["--count", "40"]);
    part(&folder, "first.csv", "2025-01", "2025-07");
    part(&folder, "second.csv", "2025-07", "2025-10");
    part(&folder, "third.csv", "2025-10", "2026");
    let joint = |more: &[&str]| calibrate(&folder, &[&["--joint"], more].concat()).good();
    joint(&["--observations", "seen.csv", "--out", "all.csv"]);
    joint(&[
        "--observations",
        "first.csv",
        "--out",
        "half.csv",
        "--state",
        "state.parquet",
    ]);
    for (name, out) in [("second.csv", "two.csv"), ("third.csv", "followed.csv")] {
        let args = [
            "--update",
            "state.parquet",
            "--observations",
            name,
            "--out",
            out,
        ];
        calibrate(&folder, &args).good();
    }
    let table = |name: &str| rows(&folder.read(name));
    let (all, half, followed) = (table("all.csv"), table("half.csv"), table("followed.csv"));
    assert_eq!((all.len(), half.len(), followed.len()), (500, 500, 500));
    let observed: Vec<usize> = (0..500)
        .filter(|&k| number(&all[k], "observations") > 0.0)
        .collect();
    assert!(observed.len() >= 35, "{}", observed.len());
    // root mean square of what the two say apart, in stated standard deviations
    let apart = |other: &[Row], name: &str| -> f64 {
        let squares: f64 = observed
            .iter()
            .map(|&k| {
                let degrees = |row: &Row| number(row, &format!("{name}_deg"));
                let mrad = 1e3 * (degrees(&all[k]) - degrees(&other[k])).to_radians();
                (mrad / number(&all[k], &format!("sigma_{name}_mrad"))).powi(2)
            })
            .sum();
        (squares / observed.len() as f64).sqrt()
    };
    for name in ANGLES {
        let (recursive, without) = (apart(&followed, name), apart(&half, name));
        println!("{name}: followed {recursive:.3} sigma, half of the records {without:.3} sigma");
        assert!(recursive < 0.5, "{name}: {recursive}");
        // the records after the first half are what brings them together
        assert!(recursive < 0.5 * without, "{name}: {recursive} {without}");
    }
    for &k in &observed {
        assert_eq!(
            number(&all[k], "observations") + number(&all[k], "rejected"),
            number(&followed[k], "observations") + number(&followed[k], "rejected"),
        );
        let ratio = number(&followed[k], "foretold_mrad") / number(&all[k], "foretold_mrad");
        assert!((0.7..1.4).contains(&ratio), "{ratio}");
    }
}

#[test]
fn the_truth_is_found_and_the_others_are_as_the_field() {
    let folder = seen("40", &["--count", "30"]);
    let run = calibrate(
        &folder,
        &[
            "--joint",
            "--observations",
            "seen.csv",
            "--out",
            "joint.csv",
            "--causes",
            "causes.csv",
            "--steps",
            "steps.csv",
        ],
    );
    run.good();
    let said = run.stderr();
    for words in [
        "records scatter by",
        "zero points wander by",
        "heliostats of this field",
        "500 rows: 500 ok",
    ] {
        assert!(said.contains(words), "{said}");
    }
    let found = rows(&folder.read("joint.csv"));
    let truth: BTreeMap<String, Row> = rows(&folder.read("truth.csv"))
        .into_iter()
        .map(|row| (row["id"].clone(), row))
        .collect();
    let (mut squares, mut count) = (0.0, 0.0);
    for row in &found {
        assert_eq!(row["status"], "ok");
        // Nothing of the kind was simulated, and nothing is claimed.
        assert_eq!(number(row, "axis1_sag_deg"), 0.0);
        assert_eq!(number(row, "axis2_sag_deg"), 0.0);
        assert_eq!(number(row, "jumps"), 0.0);
        if number(row, "observations") == 0.0 {
            // A few milliradians either way, and it is said.
            assert!(number(row, "foretold_mrad") > 5.0, "{row:?}");
            continue;
        }
        assert!(number(row, "foretold_mrad") < 2.0, "{row:?}");
        for name in ANGLES {
            let degrees = |row: &Row| number(row, &format!("{name}_deg"));
            let mrad = 1e3 * (degrees(row) - degrees(&truth[&row["id"]])).to_radians();
            squares += (mrad / number(row, &format!("sigma_{name}_mrad"))).powi(2);
            count += 1.0;
        }
    }
    let rms = (squares / count).sqrt();
    println!("errors in stated standard deviations, root mean square: {rms:.2}");
    assert!((0.6..1.4).contains(&rms), "{rms}");

    let causes = rows(&folder.read("causes.csv"));
    assert_eq!(causes.len(), 8);
    for cause in causes.iter().filter(|cause| cause["scope"] != "heliostat") {
        assert_eq!(
            (cause["admitted"].as_str(), number(cause, "value")),
            ("0", 0.0),
            "{cause:?}"
        );
    }
    let steps = rows(&folder.read("steps.csv"));
    let observed = found
        .iter()
        .map(|row| number(row, "observations") + number(row, "rejected"));
    assert_eq!(steps.len() as f64, observed.sum::<f64>());
    assert!(!steps[0].contains_key("alarm"));

    // What was written is what tracking takes: back through the truth the beams hit to what is foretold.
    let field = folder.read("field.toml");
    let with = |table: &str| {
        let line = format!("aim = \"receiver\"\ncalibration = \"{table}\"");
        folder.write("field.toml", field.replace("aim = \"receiver\"", &line));
    };
    with("joint.csv");
    folder
        .track(&[NOON, &["--out", "angles.csv"]].concat())
        .good();
    with("truth.csv");
    let predicted = folder.run(&["predict", "--field", "field.toml", "--angles", "angles.csv"]);
    let mut misses = 0;
    for row in rows(&predicted.good()) {
        if truth.contains_key(&row["id"]) {
            misses += usize::from(number(&row, "beam_error_mrad") > 1.5);
        }
    }
    // Those that no target faces have no observations either.
    assert!(misses <= 40 - count as usize / ANGLES.len(), "{misses}");
}

#[test]
fn records_count_once_and_the_same_records_give_the_same_bytes() {
    let folder = seen("20", &["--count", "20"]);
    part(&folder, "first.csv", "2025-01", "2025-09");
    part(&folder, "later.csv", "2025-09", "2026");
    part(&folder, "more.csv", "2025-06", "2026");
    let args = [
        "--joint",
        "--observations",
        "first.csv",
        "--state",
        "s.parquet",
        "--out",
    ];
    for (threads, out) in [("1", "one.csv"), ("4", "four.csv")] {
        calibrate(&folder, &[&args[..], &[out, "--threads", threads]].concat()).good();
        std::fs::copy(
            folder.path().join("s.parquet"),
            folder.path().join(format!("{out}.parquet")),
        )
        .unwrap();
    }
    assert!(bytes(&folder, "one.csv") == bytes(&folder, "four.csv"));
    assert!(bytes(&folder, "one.csv.parquet") == bytes(&folder, "four.csv.parquet"));
    let begun = bytes(&folder, "s.parquet");

    let update = |new: &str, more: &[&str]| {
        let args = [
            "--update",
            "s.parquet",
            "--observations",
            new,
            "--steps",
            "steps.csv",
            "--out",
            "table.csv",
        ];
        calibrate(&folder, &[&args, more].concat())
    };
    // To another file, the state stays.
    update("later.csv", &["--state", "to.parquet", "--threads", "3"]).good();
    assert!(bytes(&folder, "s.parquet") == begun);
    let (table, steps) = (bytes(&folder, "table.csv"), folder.read("steps.csv"));
    assert_eq!(
        steps.lines().count(),
        folder.read("later.csv").lines().count()
    );
    update("later.csv", &["--threads", "1"]).good();
    assert!(bytes(&folder, "s.parquet") == bytes(&folder, "to.parquet"));
    assert!(bytes(&folder, "table.csv") == table);
    let after = bytes(&folder, "s.parquet");

    // The same again: refused, and nothing has happened.
    folder.write("table.csv", "as it was");
    let again = update("later.csv", &[]);
    assert_eq!(again.code(), 2);
    assert!(
        again
            .stderr()
            .contains("taken in already; nothing was written"),
        "{}",
        again.stderr()
    );
    assert_eq!(folder.read("table.csv"), "as it was");
    assert!(bytes(&folder, "s.parquet") == after);

    // Old ones among new ones are left aside: it comes to the same state.
    folder.write("s.parquet", &begun);
    let run = update("more.csv", &[]);
    run.good();
    assert!(
        run.stderr().contains("left aside, as taken in already"),
        "{}",
        run.stderr()
    );
    assert!(bytes(&folder, "s.parquet") == after);
    assert_eq!(
        folder.read("steps.csv").lines().count(),
        steps.lines().count()
    );

    // A record of a time still to come moves nothing, neither the state nor its day.
    let in_future = |name: &str| {
        let table = folder.read(name);
        let line = table
            .lines()
            .nth(1)
            .unwrap()
            .replacen(",2025-", ",2200-", 1);
        folder.write("future.csv", format!("{table}{line}\n"));
        (table.lines().count() + 1).to_string()
    };
    let line = in_future("later.csv");
    folder.write("s.parquet", &begun);
    let run = update("future.csv", &["--rejected", "rejected.csv"]);
    run.good();
    assert!(bytes(&folder, "s.parquet") == after);
    assert_eq!(folder.read("steps.csv"), steps);
    let rejected = rows(&folder.read("rejected.csv"));
    let late = rejected
        .iter()
        .find(|row| row["reason"] == "in_future")
        .unwrap();
    assert_eq!(late["line"], line);
    assert!(run.stderr().contains("still to come"), "{}", run.stderr());
    in_future("first.csv");
    calibrate(
        &folder,
        &[
            &["--joint", "--observations", "future.csv"],
            &args[3..],
            &["f.csv"],
        ]
        .concat(),
    )
    .good();
    assert!(bytes(&folder, "s.parquet") == begun);
    let found = |name: &str| {
        let mut rows = rows(&folder.read(name));
        for row in &mut rows {
            row.remove("observations_hash");
        }
        rows
    };
    assert_eq!(found("f.csv"), found("one.csv"));

    // A table that cannot be written leaves the state.
    folder.write("s.parquet", &begun);
    let run = calibrate(
        &folder,
        &[
            "--update",
            "s.parquet",
            "--observations",
            "later.csv",
            "--out",
            "none/table.csv",
        ],
    );
    assert_eq!(run.code(), 2);
    assert!(bytes(&folder, "s.parquet") == begun);
}

#[test]
fn a_jump_is_named_and_the_rows_follow_it() {
    let jump = "2025-10-01T00:00:00Z,6,0";
    let folder = seen(
        "20",
        &["--count", "40", "--jump", jump, "--noise-mrad", "0.3"],
    );
    part(&folder, "first.csv", "2025-01", "2025-09");
    part(&folder, "later.csv", "2025-09", "2026");
    calibrate(
        &folder,
        &[
            "--joint",
            "--observations",
            "first.csv",
            "--state",
            "s.parquet",
            "--out",
            "first-table.csv",
        ],
    )
    .good();
    let run = calibrate(
        &folder,
        &[
            "--update",
            "s.parquet",
            "--observations",
            "later.csv",
            "--steps",
            "steps.csv",
            "--out",
            "table.csv",
        ],
    );
    run.good();
    let said = run.stderr();
    assert!(
        said.contains(": the zero point of axis 1 ") && said.contains("jumped by about +"),
        "{said}"
    );
    assert!(said.contains("\nalarms: "), "{said}");
    // all of them jumped at once, and the field is as foretold again
    assert!(said.contains("the field as a whole was off"), "{said}");
    let steps = rows(&folder.read("steps.csv"));
    let jumped: Vec<&Row> = steps
        .iter()
        .filter(|row| row["kind"] == "jump_axis1")
        .collect();
    let table: BTreeMap<String, Row> = rows(&folder.read("table.csv"))
        .into_iter()
        .map(|row| (row["id"].clone(), row))
        .collect();
    let before: BTreeMap<String, Row> = rows(&folder.read("first-table.csv"))
        .into_iter()
        .map(|row| (row["id"].clone(), row))
        .collect();
    // Not every one is looked at after the jump where it shows, but most are.
    assert!(jumped.len() >= 15, "{}", jumped.len());
    let mut off = Vec::new();
    for row in &jumped {
        assert!(row["time"].as_str() >= "2025-10-01", "{row:?}");
        assert!(
            number(row, "chi_squared") > 6.0 && number(row, "seen_mrad") > 1.0,
            "{row:?}"
        );
        let degrees =
            |table: &BTreeMap<String, Row>| number(&table[&row["id"]], "azimuth_reference_deg");
        off.push(1e3 * (degrees(&table) - degrees(&before)).to_radians() - 6.0);
    }
    off.sort_by(f64::total_cmp);
    let middle = off[off.len() / 2];
    println!(
        "{} jumps; off in the middle by {middle:.2} mrad",
        jumped.len()
    );
    assert!(middle.abs() < 1.5, "{middle}");
}

/// Of the heliostat that comes first, from its record `from` on, the first axis has lost 6 mrad; its records `kept`, and of
/// the others those before the last four.
fn jumped(folder: &Folder, name: &str, kept: std::ops::Range<usize>) -> String {
    let all = folder.read("seen.csv");
    let (header, records) = all.split_once('\n').unwrap();
    let column = |name: &str| header.split(',').position(|c| c == name).unwrap();
    let (id, axis1) = (column("heliostat_id"), column("axis1_deg"));
    let first = records.split(',').nth(id).unwrap().to_owned();
    let mut counts: BTreeMap<&str, usize> = BTreeMap::new();
    let mut out = format!("{header}\n");
    for line in records.lines() {
        let mut cells: Vec<String> = line.split(',').map(str::to_owned).collect();
        let count = counts.entry(line.split(',').nth(id).unwrap()).or_default();
        let record = *count;
        *count += 1;
        if cells[id] != first {
            if record < 8 && kept.start == 0 {
                out += &format!("{line}\n");
            }
            continue;
        }
        if record >= 8 {
            let degrees: f64 = cells[axis1].parse().unwrap();
            cells[axis1] = format!("{:?}", degrees + 6e-3_f64.to_degrees());
        }
        if kept.contains(&record) {
            out += &format!("{}\n", cells.join(","));
        }
    }
    folder.write(name, out);
    first
}

#[test]
fn a_late_jump_is_in_doubt_until_records_to_come_decide() {
    let folder = seen("20", &["--count", "20", "--noise-mrad", "0.3"]);
    let id = jumped(&folder, "first.csv", 0..10);
    let first = [
        "--joint",
        "--observations",
        "first.csv",
        "--state",
        "s.parquet",
        "--out",
        "table.csv",
        "--report",
        "page.html",
    ];
    let run = calibrate(&folder, &first);
    run.good();
    let jumps = |folder: &Folder| {
        let table = rows(&folder.read("table.csv"));
        let row = table.iter().find(|row| row["id"] == id).unwrap().clone();
        row["jumps"].clone()
    };
    // two records after it
    let may = format!("{id}: the zero point of axis 1 may have jumped by about +");
    let said = run.stderr();
    assert!(said.contains(&may), "{said}");
    assert!(
        said.contains(", 0 jumps of zero points and 1 in doubt"),
        "{said}"
    );
    assert!(
        folder
            .read("page.html")
            .contains("jumps: 0 and 1 in doubt.")
    );
    assert_eq!(jumps(&folder), "0");
    // what was said is not said again, nor counted, nor given a size that is no longer known
    let mut certain = 0;
    for record in 10..20 {
        jumped(&folder, "next.csv", record..record + 1);
        let next = [
            "--update",
            "s.parquet",
            "--observations",
            "next.csv",
            "--out",
            "table.csv",
        ];
        let run = calibrate(&folder, &next);
        run.good();
        let said = run.stderr();
        assert!(
            !said.contains("may have jumped") && !said.contains("by about"),
            "{said}"
        );
        certain += usize::from(said.contains(&format!(
            "{id}: the zero point of axis 1 jumped before 2025-"
        )));
        assert!(!said.contains("999"), "{said}");
    }
    assert_eq!(certain, 1);
    assert_eq!(jumps(&folder), "1");
}

#[test]
fn the_layout_may_grow_but_not_move() {
    let folder = seen("10", &["--count", "12"]);
    part(&folder, "first.csv", "2025-01", "2025-09");
    part(&folder, "later.csv", "2025-09", "2026");
    let layout = folder.read("heliostats.csv");
    let without: String = layout
        .lines()
        .filter(|line| !line.starts_with("H500,"))
        .map(|l| format!("{l}\n"))
        .collect();
    assert!(without.len() < layout.len());
    folder.write("heliostats.csv", &without);
    calibrate(
        &folder,
        &[
            "--joint",
            "--observations",
            "first.csv",
            "--state",
            "s.parquet",
            "--out",
            "table.csv",
        ],
    )
    .good();
    assert_eq!(rows(&folder.read("table.csv")).len(), 499);
    let update = || {
        calibrate(
            &folder,
            &[
                "--update",
                "s.parquet",
                "--observations",
                "later.csv",
                "--out",
                "table.csv",
            ],
        )
    };
    let begun = bytes(&folder, "s.parquet");
    folder.write("heliostats.csv", layout.replacen("H001,", "H001,1", 1));
    let refused = update();
    assert_eq!(refused.code(), 2);
    assert!(
        refused
            .stderr()
            .contains("heliostat `H001`: has its pivot at"),
        "{}",
        refused.stderr()
    );
    assert!(bytes(&folder, "s.parquet") == begun);

    folder.write("heliostats.csv", &layout);
    let run = update();
    run.good();
    assert!(
        run.stderr().contains("1 heliostat new to the state"),
        "{}",
        run.stderr()
    );
    let table = rows(&folder.read("table.csv"));
    assert_eq!((table.len(), table[499]["id"].as_str()), (500, "H500"));
    assert_eq!(number(&table[499], "observations"), 0.0);

    // One that is gone stays in the state and has no row.
    folder.write("heliostats.csv", &without);
    folder.write("s.parquet", &begun);
    update().good();
    assert_eq!(rows(&folder.read("table.csv")).len(), 499);
}

/// A state goes on neither with drives whose steps mean something else, nor where a byte of it is not as it was written.
#[test]
fn a_drive_that_changed_and_a_damaged_state_are_refused() {
    let (folder, ..) = sagging();
    let toml = folder.read("field.toml");
    let drive =
        "[heliostats.drive.axis2]\ntype = \"encoder\"\nsteps_per_deg = 5000\nzero_steps = 1200\n";
    let with = |drive: &str| folder.write("field.toml", format!("{toml}{drive}"));
    with(drive);
    let joint = [
        "--joint",
        "--observations",
        "seen.csv",
        "--state",
        "s.parquet",
    ];
    calibrate(&folder, &[&joint[..], &["--out", "t.csv"]].concat()).good();
    let begun = bytes(&folder, "s.parquet");
    let update = || {
        let args = [
            "--update",
            "s.parquet",
            "--observations",
            "next.csv",
            "--out",
            "t.csv",
        ];
        calibrate(&folder, &args)
    };
    let refused = |words: &str, state: &[u8]| {
        folder.write("t.csv", "as it was");
        let run = update();
        assert_eq!(run.code(), 2);
        assert!(run.stderr().contains(words), "{}", run.stderr());
        assert!(bytes(&folder, "s.parquet") == state);
        assert_eq!(folder.read("t.csv"), "as it was");
    };
    let wanted = "heliostat `S00`: has a drive of axis 2 that stands at ";
    with(&drive.replace("1200", "1300"));
    refused(wanted, &begun);
    with(&drive.replace("5000", "5001"));
    refused(wanted, &begun);
    with("");
    refused("has a drive of axis 2 there and none in this field", &begun);

    with(drive);
    // a digit of what is common
    let number = begun
        .windows(13)
        .position(|w| w == b"\"prior_sigma\"")
        .unwrap();
    let digit = (number + 14..)
        .find(|&k| begun[k].is_ascii_digit())
        .unwrap();
    let mut damaged = begun.clone();
    damaged[digit] = b'0' + (damaged[digit] - b'0' + 1) % 10;
    folder.write("s.parquet", &damaged);
    refused(
        "s.parquet: it is not as it was written: its checksum is",
        &damaged,
    );
    folder.write("s.parquet", &begun[..begun.len() / 2]);
    refused("s.parquet: it is not whole", &begun[..begun.len() / 2]);
    folder.write("s.parquet", &begun);
    update().good();
    // which state a table goes on from
    let hash = rows(&folder.read("t.csv"))[0]["options_hash"].clone();
    assert!(begun.windows(64).any(|w| w == hash.as_bytes()));
}

/// A target of which the state has no record yet: its shifts are learnt.
#[test]
fn a_target_may_come_later() {
    let (folder, options, _) = sagging();
    let seen = folder.read("seen.csv");
    let without: Vec<&str> = seen.lines().filter(|l| !l.contains(",board2,")).collect();
    assert!(without.len() < seen.lines().count());
    folder.write("seen.csv", without.join("\n") + "\n");
    let joint = [
        "--joint",
        "--observations",
        "seen.csv",
        "--state",
        "s.parquet",
    ];
    calibrate(&folder, &[&joint[..], &["--out", "t.csv"]].concat()).good();
    let begun = bytes(&folder, "s.parquet");
    let next = folder.read("next.csv");
    let (head, records) = next.split_once('\n').unwrap();
    let of = |board: &str| -> String {
        let lines = records.lines().filter(|l| l.contains(board));
        lines.fold(format!("{head}\n"), |all, line| all + line + "\n")
    };
    let update = |records: &str, more: &[&str]| {
        folder.write("new.csv", records);
        let args = ["--update", "s.parquet", "--observations", "new.csv"];
        let out = [
            "--out",
            "t.csv",
            "--causes",
            "causes.csv",
            "--report",
            "t.html",
        ];
        calibrate(&folder, &[&args[..], &out, more].concat())
    };
    let found = |target: &str| -> Vec<Row> {
        let causes = rows(&folder.read("causes.csv")).into_iter();
        causes.filter(|cause| cause["target"] == target).collect()
    };
    // Records on other targets need no room for it.
    let run = update(&of(",board0,"), &["--state", "other.parquet"]);
    run.good();
    assert!(
        !run.stderr().contains("new to the state"),
        "{}",
        run.stderr()
    );
    assert_eq!((found("board1").len(), found("board2").len()), (2, 0));

    for threads in ["1", "4"] {
        folder.write("s.parquet", &begun);
        let run = update(&next, &["--threads", threads]);
        run.good();
        let words = "target `board2` is new to the state: how its spots are shifted is learnt";
        assert!(run.stderr().contains(words), "{}", run.stderr());
        if threads == "1" {
            folder.write("one.parquet", bytes(&folder, "s.parquet"));
        }
    }
    assert!(bytes(&folder, "s.parquet") == bytes(&folder, "one.parquet"));
    let shifts = found("board2");
    assert_eq!(shifts.len(), 2);
    for (shift, truth) in shifts.iter().zip(options.causes.target_shift_m[2]) {
        let (value, sigma) = (number(shift, "value"), number(shift, "sigma"));
        println!(
            "{}: {value:.4} m, sigma {sigma:.4}, in truth {truth}",
            shift["cause"]
        );
        assert!(
            sigma < 0.03 && (value - truth).abs() < 3.0 * sigma,
            "{shift:?}"
        );
    }
    assert!(folder.read("t.html").contains("board2: shift to the right"));
    // It is one of the state's targets from now on, which must stay.
    let toml = folder.read("field.toml");
    let moved = toml.replace("[-17.6, ", "[-17.5, ");
    assert!(moved != toml);
    folder.write("field.toml", moved);
    let run = update(&next.replace("2025-09", "2025-10"), &[]);
    assert_eq!(run.code(), 2);
    assert!(
        run.stderr().contains("target `board2` has its centre at"),
        "{}",
        run.stderr()
    );
}

#[test]
fn what_does_not_go_together_is_refused_before_anything_is_read() {
    let folder = Folder::empty();
    let joint = ["--observations", "none.csv", "--joint"];
    let update = ["--observations", "none.csv", "--update", "none.parquet"];
    for (args, words) in [
        (&joint[..], &["--update", "s.parquet"][..]),
        (&joint, &["--plan", "3"]),
        (&update, &["--plan-date", "2026-06-21"]),
        (&["--observations", "none.csv"], &["--causes", "c.csv"]),
        (&["--observations", "none.csv"], &["--state", "s.parquet"]),
        (&["--observations", "none.csv"], &["--steps", "s.csv"]),
        (&["--observations", "none.csv"], &["--ahead", "2"]),
        (&joint, &["--ahead", "-1"]),
    ] {
        let run = calibrate(&folder, &[args, words].concat());
        assert_eq!(run.code(), 2, "{words:?}");
        let said = run.stderr();
        assert!(
            said.contains("Usage:") || said.contains("For more information"),
            "{said}"
        );
        assert!(!said.contains("no such file"), "{said}");
    }
    // Options of a fit heliostat by heliostat: each with the reason.
    let reasons = [
        (
            &["--solver", "gauss-newton"][..],
            "filtered record by record",
        ),
        (&["--solver", "hartley-meyer"], "filtered record by record"),
        (
            &["--residual", "beam"],
            "makes the miss across the beam small",
        ),
        (&["--robust", "huber"], "whether it is believed"),
        (&["--sets", "2"], "causes in common"),
        (&["--fit-mirror-offset"], "from the layout"),
        (&["--hold", "mirror_tilt"], "all six angles are found"),
        (
            &["--prior", "mirror_tilt=0:0.1"],
            "learns from all heliostats",
        ),
        (&["--resume", "--out", "c.csv"], "fitted in one piece"),
    ];
    for (more, why) in reasons {
        for (args, way) in [(&joint[..], "--joint"), (&update, "--update")] {
            let run = calibrate(&folder, &[args, more].concat());
            assert_eq!(run.code(), 2, "{more:?}");
            let said = run.stderr();
            let begin = format!("{} with {way}: ", more[0]);
            assert!(said.contains(&begin) && said.contains(why), "{said}");
        }
    }
    for more in ["--keep-all", "--no-jumps"] {
        let said = calibrate(&folder, &[&update[..], &[more]].concat()).stderr();
        assert!(
            said.contains("as the --joint that began it was told to"),
            "{said}"
        );
    }
    for (args, more, wanted) in [
        (
            &joint[..],
            &["--state", "-"][..],
            "--state: a state is a file",
        ),
        (
            &joint,
            &["--state", "x.csv", "--out", "x.csv"],
            "name the same file",
        ),
        (
            &joint,
            &["--steps", "x.csv", "--causes", "x.csv"],
            "name the same file",
        ),
        (&joint, &["--steps", "-"], "both name standard output"),
        (&update, &["--out", "none.parquet"], "name the same file"),
        (
            &joint,
            &["--steps", "x.txt"],
            "the suffix stands for no format",
        ),
        (
            &joint,
            &[
                "--rejected",
                "x.csv",
                "--plan-out",
                "x.csv",
                "--plan",
                "1",
                "--plan-date",
                "2026-06-21",
            ],
            "name the same file",
        ),
        (
            &update,
            &["--report", "x.html", "--causes", "x.html"],
            "name the same file",
        ),
    ] {
        let run = calibrate(&folder, &[args, more].concat());
        assert_eq!(run.code(), 2, "{more:?}");
        assert!(run.stderr().contains(wanted), "{more:?}: {}", run.stderr());
    }
}

/// Records without any scatter: there is no end to how small it may be.
#[test]
fn a_search_that_ended_early_is_said() {
    let stopped = |noise: &str| {
        let folder = seen("12", &["--count", "20", "--noise-mrad", noise]);
        let args = [
            "--joint",
            "--observations",
            "seen.csv",
            "--out",
            "joint.csv",
            "--report",
            "joint.html",
        ];
        let run = calibrate(&folder, &args);
        run.good();
        let words = "the search for noise and wander stopped before its end";
        let said = run.stderr().contains(&format!("warning: {words}"));
        assert_eq!(folder.read("joint.html").contains(words), said);
        said
    };
    assert!(stopped("0"));
    assert!(!stopped("0.5"));
}

#[test]
fn a_site_and_times_are_needed() {
    let folder = Folder::new();
    let seen = "heliostat_id,sun_azimuth_deg,sun_elevation_deg,axis1_deg,axis2_deg,target,u_m,v_m\n\
                A1,180,40,170,45,receiver,0.1,0.2\n";
    folder.write("seen.csv", seen);
    let joint = || calibrate(&folder, &["--joint", "--observations", "seen.csv"]);
    let said = joint().stderr();
    assert!(
        said.contains(
            "1 record has no time (first line 2, heliostat `A1`), and --joint needs times"
        ),
        "{said}"
    );
    let (_, rest) = FIELD.split_once("[targets").unwrap();
    folder.write("field.toml", format!("[targets{rest}"));
    let said = joint().stderr();
    assert!(said.contains("need the latitude from [site]"), "{said}");

    // A text file is no state.
    folder.write("field.toml", FIELD);
    let run = calibrate(
        &folder,
        &["--update", "seen.csv", "--observations", "seen.csv"],
    );
    assert_eq!(run.code(), 2);
    assert!(
        run.stderr().contains("it is no state of a followed field"),
        "{}",
        run.stderr()
    );
}

#[test]
fn the_field_as_one_has_a_page_a_plan_and_a_list_of_what_was_not_believed() {
    let (folder, options, _) = sagging();
    let run = calibrate(
        &folder,
        &[
            "--joint",
            "--observations",
            "seen.csv",
            "--out",
            "joint.csv",
            "--causes",
            "causes.csv",
            "--report",
            "joint.html",
            "--rejected",
            "rejected.csv",
            "--plan",
            "2",
            "--plan-date",
            DAY,
            "--plan-out",
            "plan.csv",
            "--state",
            "s.parquet",
            "--steps",
            "steps.csv",
        ],
    );
    run.good();
    let said = run.stderr();
    assert!(said.contains(" mrad, is worth "), "{said}");

    let causes = rows(&folder.read("causes.csv"));
    let sag = causes
        .iter()
        .find(|c| c["cause"] == "axis2_sag_rad")
        .unwrap();
    let true_sag = options.causes.pose_errors.axis2_sag_rad;
    assert!((number(sag, "value") - true_sag).abs() < 3.0 * number(sag, "sigma"));
    let (turn, worth) = (number(sag, "turn_mrad"), number(sag, "worth_mrad"));
    println!("the sag turns beams by {turn:.3} mrad and is worth {worth:.3}");
    assert!(0.5 < worth && worth < turn && turn < 5.0, "{worth} {turn}");
    for cause in causes.iter().filter(|c| c["admitted"] == "0") {
        assert_eq!(
            (number(cause, "turn_mrad"), number(cause, "value")),
            (0.0, 0.0)
        );
    }

    let page = folder.read("joint.html");
    for text in [
        "<h1>Simulated as one</h1>",
        "Heliostats: 40, observed: 36.",
        "sag of axis 2",
        "board1: shift to the right",
        "turn, mrad",
        "One record ahead, after a heliostat's first 6",
        "Inside the stated ellipse",
        "Zero points over time",
        "heliostats.csv",
    ] {
        assert!(page.contains(text), "{text}");
    }
    assert!(
        !page.contains("NaN") && page.len() < 1_000_000,
        "{}",
        page.len()
    );

    // What was not believed stands in both lists.
    let lines = |name: &str, of: &str| {
        let mut lines: Vec<String> = rows(&folder.read(name))
            .into_iter()
            .filter(|row| row[of] == "outlier")
            .map(|row| row["line"].clone())
            .collect();
        lines.sort();
        lines
    };
    let outliers = lines("steps.csv", "kind");
    assert!(outliers.len() > 4, "{}", outliers.len());
    assert_eq!(outliers, lines("rejected.csv", "reason"));
    let rejected = rows(&folder.read("rejected.csv"));
    assert_eq!(rejected.len(), outliers.len());
    assert!(rejected[0]["why"].contains("mrad from where it was expected"));

    // Two records are proposed for each, and lower what is not known, most where there is none.
    let plan = rows(&folder.read("plan.csv"));
    assert_eq!(plan.len(), 80);
    let table = rows(&folder.read("joint.csv"));
    let mut before_of = [0.0; 2];
    for (pair, of) in plan.chunks(2).zip(&table) {
        let [first, second] = pair else {
            unreachable!()
        };
        assert_eq!((&first["id"], &second["id"]), (&of["id"], &of["id"]));
        assert!(first["time"].starts_with(DAY) && first["target"].starts_with("board"));
        let [before, between, after] = [
            number(first, "year_pointing_before_mrad"),
            number(second, "year_pointing_before_mrad"),
            number(second, "year_pointing_after_mrad"),
        ];
        assert_eq!(between, number(first, "year_pointing_after_mrad"));
        assert!(
            before > between && between > after,
            "{before} {between} {after}"
        );
        // what the zero points wander by is not in it
        assert!(
            before < 1.02 * number(of, "year_pointing_mrad"),
            "{before} {of:?}"
        );
        before_of[usize::from(number(of, "observations") > 6.0)] += before;
        if of["id"].ends_with('9') {
            assert!(before > 10.0 && after < 0.3 * before, "{before} {after}");
        }
    }
    assert!(
        before_of[0] / 12.0 > 3.0 * before_of[1] / 28.0,
        "{before_of:?}"
    );

    for row in table.iter().filter(|row| number(row, "observations") > 6.0) {
        let ratio = number(row, "beam_rms_mrad") / number(row, "expected_mrad");
        assert!((0.4..2.0).contains(&ratio), "{row:?}");
        // boards are met at up to some 45 degrees
        let oblique = number(row, "rms_mrad") / number(row, "beam_rms_mrad");
        assert!((0.9..1.6).contains(&oblique), "{row:?}");
    }

    // Those known too badly are refused where that is asked for.
    let run = calibrate(
        &folder,
        &[
            "--joint",
            "--observations",
            "seen.csv",
            "--out",
            "strict.csv",
            "--max-year-pointing-mrad",
            "3",
            "--compare",
            "joint.csv",
        ],
    );
    assert_eq!(run.code(), 1);
    let said = run.stderr();
    assert!(said.contains("compared: "), "{said}");
    for (strict, row) in rows(&folder.read("strict.csv")).iter().zip(&table) {
        let good = number(row, "year_pointing_mrad") <= 3.0;
        assert_eq!(strict["status"], if good { "ok" } else { "undetermined" });
        assert_eq!(strict["mirror_tilt_deg"].is_empty(), !good);
        assert_eq!(strict["why"].is_empty(), good);
    }

    // Without outliers and jumps every record is believed.
    let args = [
        "--joint",
        "--observations",
        "seen.csv",
        "--out",
        "all.csv",
        "--keep-all",
        "--no-jumps",
        "--rejected",
        "none.csv",
    ];
    calibrate(&folder, &args).good();
    assert_eq!(rows(&folder.read("none.csv")).len(), 0);
}

#[test]
fn a_followed_field_has_them_too() {
    let (folder, _, field) = sagging();
    let args = [
        "--joint",
        "--observations",
        "seen.csv",
        "--out",
        "joint.csv",
        "--state",
        "s.parquet",
    ];
    calibrate(&folder, &args).good();
    let run = calibrate(
        &folder,
        &[
            "--update",
            "s.parquet",
            "--observations",
            "next.csv",
            "--out",
            "followed.csv",
            "--causes",
            "causes.csv",
            "--report",
            "followed.html",
            "--rejected",
            "rejected.csv",
            "--compare",
            "joint.csv",
            "--plan",
            "1",
            "--plan-date",
            "2025-09-18",
            "--plan-out",
            "plan.csv",
        ],
    );
    run.good();
    assert!(
        run.stderr().contains("compared: 40 heliostats"),
        "{}",
        run.stderr()
    );
    let causes = rows(&folder.read("causes.csv"));
    let sag = causes
        .iter()
        .find(|c| c["cause"] == "axis2_sag_rad")
        .unwrap();
    assert!((number(sag, "value") - 3.6e-3).abs() < 3.0 * number(sag, "sigma"));
    assert_eq!(
        (sag["log_evidence"].as_str(), sag["admitted"].as_str()),
        ("", "1")
    );
    let page = folder.read("followed.html");
    let records = format!("are those of {} of them", field.heliostats.len() * 2);
    for text in [
        &records[..],
        "Zero points over time",
        "<h2>Findings</h2>",
        "not admitted",
    ] {
        assert!(page.contains(text), "{text}");
    }
    assert!(!page.contains("NaN") && !page.contains("turn, mrad"));
    assert_eq!(rows(&folder.read("plan.csv")).len(), 40);
}

/// Columns of the lines of a table of observations changed.
fn changed(folder: &Folder, from: &str, to: &str, mut change: impl FnMut(usize, &mut Vec<String>)) {
    let text = folder.read(from);
    let (head, lines) = text.split_once('\n').unwrap();
    let mut out = format!("{head}\n");
    for (k, line) in lines.lines().enumerate() {
        let mut cells: Vec<String> = line.split(',').map(str::to_owned).collect();
        change(k, &mut cells);
        out += &(cells.join(",") + "\n");
    }
    folder.write(to, out);
}

fn column(folder: &Folder, table: &str, name: &str) -> usize {
    let text = folder.read(table);
    let head = text.lines().next().unwrap();
    head.split(',').position(|column| column == name).unwrap()
}

/// A spot somewhere on the board.
fn elsewhere(cell: &mut String, k: usize) {
    *cell = format!("{}", (k * 7919 % 97) as f64 / 8.0 - 6.0);
}

/// Heliostats that nothing fits, whose boards were swapped, and a record of a wrong date: in the rows, in words, in the
/// exit status.
#[test]
fn what_is_not_understood_is_said_of_its_row() {
    let folder = seen("20", &["--count", "30", "--noise-mrad", "0.4"]);
    let at = |name: &str| column(&folder, "seen.csv", name);
    let (id, time, target, u, v) = (
        at("heliostat_id"),
        at("time"),
        at("target"),
        at("u_m"),
        at("v_m"),
    );
    let ids: Vec<String> = {
        let mut ids: Vec<String> = rows(&folder.read("seen.csv"))
            .iter()
            .map(|row| row["heliostat_id"].clone())
            .collect();
        ids.dedup();
        ids
    };
    // the last two thirds are another heliostat's
    changed(&folder, "seen.csv", "bad.csv", |k, cells| {
        if cells[id] == ids[0] && k % 30 >= 12 {
            elsewhere(&mut cells[u], k);
            elsewhere(&mut cells[v], 3 * k + 1);
        }
        if cells[id] == ids[1] {
            let other = if cells[target] == "board-north" {
                "board-south"
            } else {
                "board-north"
            };
            cells[target] = other.to_owned();
        }
    });
    let joint = ["--joint", "--observations", "bad.csv", "--out", "t.csv"];
    let run = calibrate(
        &folder,
        &[&joint[..], &["--rejected", "rejected.csv"]].concat(),
    );
    assert_eq!(run.code(), 1, "{}", run.stderr());
    let said = run.stderr();
    assert!(said.contains(" ok, 2 unexplained; "), "{said}");
    assert!(!said.contains("the field as a whole was off"), "{said}");
    let table: BTreeMap<String, Row> = rows(&folder.read("t.csv"))
        .into_iter()
        .map(|row| (row["id"].clone(), row))
        .collect();
    let rejected = rows(&folder.read("rejected.csv"));
    for (k, id) in ids.iter().enumerate() {
        let row = &table[id];
        let status = if k < 2 { "unexplained" } else { "ok" };
        assert_eq!(row["status"], status, "{row:?}");
        let (used, not) = (number(row, "observations"), number(row, "rejected"));
        assert!((used + not - 30.0).abs() < 1e-9, "{row:?}");
        let listed = rejected.iter().filter(|one| one["id"] == *id);
        assert!((not - listed.count() as f64).abs() < 1e-9, "{row:?}");
    }
    assert_eq!(table[&ids[1]]["rejected"], "30");
    assert!(table[&ids[1]]["why"].contains("should not meet their targets"));

    // while following
    part(&folder, "first.csv", "2025-01", "2025-08");
    part(&folder, "later.csv", "2025-08", "2026");
    let joint = ["--joint", "--observations", "first.csv", "--out", "t.csv"];
    calibrate(&folder, &[&joint[..], &["--state", "s.parquet"]].concat()).good();
    let begun = bytes(&folder, "s.parquet");
    changed(&folder, "later.csv", "bad.csv", |k, cells| {
        if cells[id] == ids[0] {
            elsewhere(&mut cells[u], k);
            elsewhere(&mut cells[v], 3 * k + 1);
        }
    });
    let update = |records: &str| {
        let args = ["--update", "s.parquet", "--observations", records];
        calibrate(&folder, &[&args[..], &["--out", "t.csv"]].concat())
    };
    let run = update("bad.csv");
    assert_eq!(run.code(), 1, "{}", run.stderr());
    let said = run.stderr();
    let words = "its last three records in a row are not believed";
    assert!(said.contains(&format!("{}: alarm at 2025-", ids[0])) && said.contains(words));
    assert!(said.contains(" ok, 1 unexplained; "), "{said}");
    let table = rows(&folder.read("t.csv"));
    let row = table.iter().find(|row| row["id"] == ids[0]).unwrap();
    assert_eq!(row["status"], "unexplained");
    let not = number(row, "rejected");
    assert!(not > 3.0, "what is in doubt is rejected too: {row:?}");

    // a wrong date does not shut out what comes after it
    folder.write("s.parquet", &begun);
    changed(&folder, "later.csv", "dated.csv", |k, cells| {
        if k == 1 {
            cells[time] = "2026-10-01T12:00:00Z".to_owned();
        }
    });
    let run = update("dated.csv");
    run.good();
    let words = "1 record is dated more than 30 days after those of the other heliostats (first ";
    assert!(run.stderr().contains(words), "{}", run.stderr());
    assert!(run.stderr().contains("left aside"), "{}", run.stderr());
    changed(&folder, "later.csv", "next.csv", |_, cells| {
        cells[time] = cells[time].replacen("2025", "2026", 1);
    });
    // the sun stands elsewhere a year later, but nothing is taken for old
    assert!(!update("next.csv").stderr().contains("taken in already"));

    // no new records: what comes next is proposed all the same
    folder.write("s.parquet", &begun);
    assert_eq!(update("first.csv").code(), 2);
    let args = ["--update", "s.parquet", "--observations", "first.csv"];
    let plan = [
        "--plan",
        "1",
        "--plan-date",
        "2026-01-05",
        "--plan-out",
        "plan.csv",
        "--out",
        "t.csv",
    ];
    calibrate(&folder, &[&args[..], &plan].concat()).good();
    assert!(rows(&folder.read("plan.csv")).len() > 400);
}

/// A clock that is off for everybody: every row says so, as does the exit status.
#[test]
fn a_field_that_is_off_as_a_whole_is_said_and_not_believed() {
    let folder = seen("12", &["--count", "40", "--noise-mrad", "0.4"]);
    let time = column(&folder, "seen.csv", "time");
    part(&folder, "first.csv", "2025-01", "2025-10");
    part(&folder, "later.csv", "2025-10", "2026");
    let minutes_later = |_: usize, cells: &mut Vec<String>| {
        let ns = helio_io::parse_time(&cells[time]).unwrap() + 300_000_000_000;
        cells[time] = helio_io::format_time(ns);
    };
    changed(&folder, "later.csv", "off.csv", minutes_later);
    let of_first = folder.read("first.csv");
    let off = folder.read("off.csv");
    folder.write("all.csv", of_first + off.split_once('\n').unwrap().1);
    let joint = |records: &str| {
        let args = ["--joint", "--observations", records, "--out", "t.csv"];
        calibrate(&folder, &[&args[..], &["--state", "s.parquet"]].concat())
    };
    let observed = |records: &str| {
        let rows = rows(&folder.read(records));
        let ids: std::collections::BTreeSet<String> =
            rows.iter().map(|row| row["heliostat_id"].clone()).collect();
        ids
    };
    let not_ok = |run: &Run| {
        assert_eq!(run.code(), 1, "{}", run.stderr());
        let words = "the field as a whole was off: more than half of ";
        assert!(run.stderr().contains(words), "{}", run.stderr());
        let table = rows(&folder.read("t.csv"));
        let not = table.iter().filter(|row| row["status"] == "unexplained");
        not.map(|row| row["id"].clone())
            .collect::<std::collections::BTreeSet<_>>()
    };
    assert_eq!(not_ok(&joint("all.csv")), observed("all.csv"));
    joint("first.csv").good();
    let args = ["--update", "s.parquet", "--observations", "off.csv"];
    let run = calibrate(&folder, &[&args[..], &["--out", "t.csv"]].concat());
    assert_eq!(not_ok(&run), observed("off.csv"));
}
