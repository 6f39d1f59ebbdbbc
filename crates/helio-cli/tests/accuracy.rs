//! `accuracy` and `simulate campaign` as people run them.

// Test helpers fail loudly; the lint knows only functions that are tests themselves.
#![allow(clippy::unwrap_used)]

mod common;

use common::{Folder, rows};
use serde_json::Value;

const EVALUATE: &[&str] = &[
    "accuracy",
    "--spots",
    "spots.csv",
    "--weather",
    "weather.csv",
    "--slant-m",
    "100",
];

fn campaign(more: &[&str]) -> Folder {
    let folder = Folder::empty();
    let make = [
        "simulate",
        "campaign",
        "--spots",
        "spots.csv",
        "--weather",
        "weather.csv",
    ];
    folder.run(&[&make, more].concat()).good();
    folder
}

/// The examples at the end of the help, as they stand there.
#[test]
fn the_examples_of_the_help_work() {
    for verb in [&["accuracy"][..], &["simulate", "campaign"]] {
        let folder = Folder::empty();
        let help = folder.run(&[verb, &["--help"]].concat()).good();
        let example = help
            .split("Example:")
            .nth(1)
            .unwrap()
            .replace("\n      ", " ");
        let commands: Vec<&str> = example
            .lines()
            .filter_map(|line| line.trim().strip_prefix("helio-rs "))
            .collect();
        assert!(!commands.is_empty(), "{help}");
        for command in commands {
            let args: Vec<&str> = command.split_whitespace().collect();
            folder.run(&args).good();
        }
    }
}

#[test]
fn verdicts_and_numbers_of_the_report() {
    for (gust, minutes, verdict) in [
        ("1", "40", "qualified"),
        ("4.5", "40", "not qualified"),
        ("1", "2", "not enough data"),
    ] {
        let folder = campaign(&["--gust-mrad", gust, "--minutes", minutes]);
        let more = ["--report", "r.html", "--out", "r.json", "--frames", "f.csv"];
        let run = folder.run(&[EVALUATE, &more].concat());
        assert_eq!(run.good(), "");
        assert!(
            run.stderr()
                .ends_with(&format!("{verdict} by T/GRLM 02-2014\n"))
        );
        let found: Value = serde_json::from_str(&folder.read("r.json")).unwrap();
        assert_eq!(found["verdict"], verdict);
        // the numbers again, from the rows
        let frames = rows(&folder.read("f.csv"));
        let etas: Vec<(f64, f64)> = frames
            .iter()
            .map(|row| {
                (
                    row["eta_mrad"].parse().unwrap(),
                    row["wind_m_s"].parse().unwrap(),
                )
            })
            .collect();
        let rms = (etas.iter().map(|(eta, _)| eta * eta).sum::<f64>() / etas.len() as f64).sqrt();
        let stated = found["figures"]["accuracy"]["mrad"].as_f64().unwrap();
        assert!((rms - stated).abs() < 1e-9, "{rms} {stated}");
        for share in found["shares"].as_array().unwrap() {
            let wind = share["wind_m_s"].as_f64().unwrap();
            let near: Vec<f64> = etas
                .iter()
                .filter(|(_, w)| (w - wind).abs() <= 1.0)
                .map(|(eta, _)| *eta)
                .collect();
            let within = near.iter().filter(|eta| **eta <= 3.5).count();
            assert_eq!(share["frames"], near.len());
            assert_eq!(share["within"], within);
        }
        let page = folder.read("r.html");
        let hash = found["files"][0]["sha256"].as_str().unwrap();
        assert_eq!(hash.len(), 64);
        assert!(page.contains(hash) && page.contains("clause by clause"));
        // what was not stated is no zero
        let accuracy = &found["figures"]["accuracy"];
        assert!(
            accuracy["sigma_slant_mrad"].is_null() && accuracy["sigma_centre_mrad"].is_number()
        );
        let unstated = "<td class=\"t\">… from the distance</td><td colspan=\"3\">not stated";
        assert!(page.contains(unstated));
    }
}

/// The same to the byte, whatever the name of the output.
#[test]
fn standard_output_has_what_the_file_has() {
    let folder = campaign(&["--minutes", "3"]);
    let said = folder.run(EVALUATE).good();
    folder
        .run(&[EVALUATE, &["--out", "r.json"]].concat())
        .good();
    assert_eq!(said, folder.read("r.json"));
}

#[test]
fn frames_left_out_are_told_by_reason() {
    let folder = campaign(&["--minutes", "3", "--empty", "0.1"]);
    // a gap of the weather from the 60th to the 151st second, low irradiance in the first ten
    let weather: Vec<String> = folder
        .read("weather.csv")
        .lines()
        .enumerate()
        .filter(|(line, _)| !(62..=151).contains(line))
        .map(|(line, text)| {
            if (1..=11).contains(&line) {
                let cells: Vec<&str> = text.split(',').collect();
                format!("{},{},299,{}", cells[0], cells[1], cells[3])
            } else {
                text.to_owned()
            }
        })
        .collect();
    folder.write("weather.csv", weather.join("\n"));
    let run = folder.run(EVALUATE);
    assert_eq!(run.code(), 1, "{}", run.stderr());
    let found: Value = serde_json::from_str(&run.stdout()).unwrap();
    let of = |status: &str| found["frames"][status].as_u64().unwrap();
    // the frames at the rows on either side, 91 s apart, have their weather
    assert_eq!(of("no_dni"), 15 * 91 - 1);
    assert!(of("low_dni") >= 150 && of("low_dni") < 166);
    assert!(of("empty") > 50);
    assert_eq!(of("ok") + of("no_dni") + of("low_dni") + of("empty"), 2700);
    assert!(
        run.stderr()
            .contains("left out: low_dni (irradiance too low)")
    );
}

#[test]
fn other_limits_and_a_campaign_file_are_taken() {
    let folder = campaign(&["--minutes", "10"]);
    folder.write(
        "limits.toml",
        "name = \"House rule\"\nangle_mrad = 2\nleast_dni_w_m2 = 200\ncoldest_air_c = -10\nwarmest_air_c = 40\n\
         wind_from_m_s = 0\nwind_to_m_s = 10\ncamera_bits = 8\ncamera_frames_per_s = 10\ncamera_width_px = 640\n\
         camera_height_px = 480\n[shares.only]\nwind_m_s = 5\nshare = 0.2\n",
    );
    folder.write(
        "campaign.toml",
        "laboratory = \"Optics <1>\"\n[heliostat]\nname = \"B7\"\n[camera]\nbits = 7\n[uncertainty]\nslant_m = 0.5\n",
    );
    let more = [
        "--limits",
        "limits.toml",
        "--campaign",
        "campaign.toml",
        "--heliostat-at-deg",
        "20,-35",
        "--report",
        "r.html",
    ];
    let found: Value =
        serde_json::from_str(&folder.run(&[EVALUATE, &more].concat()).good()).unwrap();
    assert_eq!(found["verdict"], "qualified");
    assert_eq!(found["shares"].as_array().unwrap().len(), 1);
    let clause = |number: &str| {
        let all = found["clauses"].as_array().unwrap();
        all.iter().find(|c| c["clause"] == number).unwrap()["outcome"].clone()
    };
    assert_eq!(
        (clause("5.3"), clause("8.2")),
        ("deviates".into(), "deviates".into())
    );
    let figures = &found["figures"];
    let accuracy = &figures["accuracy"];
    assert!(accuracy["sigma_slant_mrad"].as_f64().unwrap() > 0.004);
    let defined = &figures["accuracy_precision_bias_as_defined_mrad"][0];
    assert!(defined.as_f64().unwrap() < accuracy["mrad"].as_f64().unwrap());
    let page = folder.read("r.html");
    assert!(page.contains("Optics &lt;1&gt;") && page.contains("of heliostat B7"));
}

/// Bad input is refused by name, and nothing is left behind.
#[test]
fn bad_input_is_refused() {
    let with = |name: &str, text: &str, more: &[&str], words: &str| {
        let folder = campaign(&["--minutes", "1"]);
        if !name.is_empty() {
            folder.write(name, text);
        }
        let before = folder.contents();
        let run = folder.run(&[EVALUATE, more].concat());
        let said = run.stderr();
        assert_eq!((run.code(), run.stdout().as_str()), (2, ""), "{said}");
        assert!(said.contains(words), "wanted {words}: {said}");
        assert!(
            folder.contents() == before,
            "{words}: something was left behind"
        );
    };
    let spots = "file,time,u_m,v_m,status\n";
    let one = format!("{spots}a,2026-06-20T08:00:01Z,0,0,ok\n");
    with("spots.csv", &one.replace("01Z", "01"), &[], "no offset");
    with("spots.csv", spots, &[], "no rows");
    with("spots.csv", "", &[], "spots.csv");
    with(
        "spots.csv",
        "file,u_m,v_m,status\na,0,0,ok\n",
        &[],
        "no row has a time",
    );
    with("spots.csv", &one.replace(",ok", ",fine"), &[], "`fine`");
    with("spots.csv", &one.replace("u_m", "um"), &[], "u_m");
    with(
        "weather.csv",
        "time,wind\n2026-06-20T08:00:01Z,3\n",
        &[],
        "unknown column `wind`",
    );
    with(
        "weather.csv",
        "time,wind_m_s\n2026-06-20T08:00:01,3\n",
        &[],
        "no offset",
    );
    with("weather.csv", "time,wind_m_s\n", &[], "no rows");
    with(
        "limits.toml",
        "name = 3\n",
        &["--limits", "limits.toml"],
        "limits.toml",
    );
    with(
        "c.toml",
        "[camra]\n",
        &["--campaign", "c.toml"],
        "did you mean `camera`",
    );
    with("", "", &["--aim", "1"], "comma");
    with("", "", &["--confidence", "95"], "parts of one");
    with("", "", &["--out", "r.csv"], ".json");
    with("", "", &["--report", "r.pdf"], ".html");
    with("", "", &["--frames", "spots.csv"], "this run reads it");
    with(
        "",
        "",
        &["--frames", "x.json", "--out", "x.json"],
        "name the same file",
    );
    with("", "", &["--accept", "empty"], "possible values");
    let folder = campaign(&["--minutes", "1"]);
    let run = folder.run(&["accuracy", "--spots", "spots.csv", "--slant-m", "0"]);
    assert_eq!(run.code(), 2);
    assert!(
        run.stderr().contains("number of metres"),
        "{}",
        run.stderr()
    );
    let weather = ["--weather", "nowhere.csv", "--slant-m", "100"];
    let run = folder.run(&[&["accuracy", "--spots", "spots.csv"], &weather[..]].concat());
    assert_eq!(run.code(), 2);
    assert!(run.stderr().contains("nowhere.csv"), "{}", run.stderr());
}

/// Entered twice, frames are no more than entered once.
#[test]
fn frames_that_stand_twice_change_no_verdict() {
    let few = [
        "--minutes",
        "46",
        "--frames-per-s",
        "1",
        "--memory-s",
        "0.01",
        "--seed",
        "9",
    ];
    let folder = campaign(&few);
    let once = folder.run(EVALUATE);
    let spots = folder.read("spots.csv");
    let (_, body) = spots.split_once('\n').unwrap();
    folder.write("spots.csv", spots.clone() + body);
    let twice = folder.run(EVALUATE);
    assert_eq!((once.code(), twice.code()), (0, 1), "{}", twice.stderr());
    let [once, run] =
        [&once, &twice].map(|run| serde_json::from_str::<Value>(&run.stdout()).unwrap());
    assert_eq!(once["verdict"], "not enough data");
    for key in ["verdict", "shares", "figures", "histogram"] {
        assert_eq!(run[key], once[key], "{key}");
    }
    let rows = body.lines().count();
    assert_eq!(run["frames"]["repeated"], rows);
    let said = twice.stderr();
    assert!(
        said.contains(&format!(
            "rows that say again what an earlier one says of the same time, left out: {rows}"
        )),
        "{said}"
    );
}

/// Rows of one time that contradict each other: the JSON is the same whatever their order, and the program says which
/// rows they are.
#[test]
fn the_order_of_rows_changes_no_verdict() {
    let folder = campaign(&["--minutes", "10", "--frames-per-s", "2"]);
    let spots = folder.read("spots.csv");
    let (header, body) = spots.split_once('\n').unwrap();
    let mut lines: Vec<String> = body.lines().map(str::to_owned).collect();
    // another camera's frames of the same times, all of them beyond the angle
    let others: Vec<String> = lines
        .iter()
        .step_by(3)
        .map(|line| {
            let mut cells: Vec<&str> = line.split(',').collect();
            (cells[0], cells[9], cells[10]) = ("other", "0.9", "0.9");
            cells.join(",")
        })
        .collect();
    let count = others.len();
    lines.extend(others);
    let mut all = Vec::new();
    for turn in 0..3 {
        match turn {
            1 => lines.reverse(),
            2 => lines.rotate_left(500),
            _ => {}
        }
        folder.write("spots.csv", format!("{header}\n{}\n", lines.join("\n")));
        let run = folder.run(EVALUATE);
        assert_eq!(run.code(), 1, "{}", run.stderr());
        let mut found: Value = serde_json::from_str(&run.stdout()).unwrap();
        // the file's hash is another
        found["files"].take();
        assert_eq!(found["frames"]["contradicted"], 2 * count);
        all.push(found);
        let said = run.stderr();
        assert!(
            said.contains("first 2026-06-20T08:00:00Z (spots.csv, line"),
            "{said}"
        );
    }
    assert_eq!(all[0], all[1]);
    assert_eq!(all[0], all[2]);
}

/// A table shows how its spots were found, whatever is stated.
#[test]
fn the_method_is_that_of_the_table() {
    let folder = Folder::empty();
    let run = |line: &str| folder.run(&line.split_whitespace().collect::<Vec<_>>());
    run("simulate images --frames 3 --seed 1 --out f").good();
    folder.write("c.toml", "[measurement]\nspot_method = \"standard\"\n");
    for (method, outcome) in [
        ("robust", "deviates"),
        ("standard --threshold multi:3", "met"),
    ] {
        run(&format!(
            "spot f --target f/target.toml --fps 1 --start 2026-06-20T08:00:00Z --method {method} --out s.csv"
        ))
        .good();
        let found = run("accuracy --spots s.csv --slant-m 100 --campaign c.toml");
        let json: Value = serde_json::from_str(&found.stdout()).unwrap();
        for number in ["7.2", "A.2"] {
            let all = json["clauses"].as_array().unwrap();
            let clause = all.iter().find(|c| c["clause"] == number).unwrap();
            assert_eq!(clause["outcome"], outcome, "{method}: {clause}");
        }
        let warned = found
            .stderr()
            .contains("s.csv is of the method robust, though c.toml states standard");
        assert_eq!(warned, method == "robust", "{}", found.stderr());
    }
    // Blamed on the file that says it.
    folder.write("c.toml", "[uncertainty]\nslant_m = 50\n");
    let said = run("accuracy --spots s.csv --slant-m 100 --campaign c.toml").stderr();
    assert!(
        said.contains("c.toml: the uncertainty of the distance must be less than a tenth"),
        "{said}"
    );
}
