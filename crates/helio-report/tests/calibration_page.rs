//! Pages of calibrations from made-up numbers: odd ones, and as large as fields get. Each is also written to
//! the build's temporary folder, to be looked at.

mod common;

use common::{DAY_NS, Dice};
use helio_report::calibration::{
    CalibrationPage, EpochSection, HeliostatSection, HeliostatSummary, ParameterRow, ParameterUnit,
    Record, SECTIONS, SetChoice, SetRow, TargetOutline, Verdict, calibration_page, most_in_need,
};

const SLANT_M: f64 = 240.0;

/// A heliostat whose zero points jump `jumps` times in two years.
fn heliostat(id: &str, records: usize, jumps: usize, seed: u64) -> HeliostatSection {
    let mut dice = Dice(seed);
    let start = 19_153 * DAY_NS;
    let epochs = jumps + 1;
    let records: Vec<Record> = (0..records)
        .map(|i| {
            let part = i as f64 / records as f64;
            let hour_angle_deg = 60.0 * (2.0 * dice.roll() - 1.0);
            let measured_m = [1.2 * dice.normal(), 0.9 * dice.normal()];
            let epoch = ((part * epochs as f64) as usize).min(epochs - 1);
            let sigma_m = 0.0007 * SLANT_M;
            let rejected = dice.roll() < 0.04;
            let far = if rejected { 12.0 } else { 1.0 };
            let after_m = measured_m.map(|m| m + far * sigma_m * dice.normal());
            let before_m = [
                measured_m[0] + 4.5 + 0.03 * hour_angle_deg + epoch as f64,
                measured_m[1] - 2.0 + 0.02 * hour_angle_deg,
            ];
            let mrad = |from: [f64; 2]| {
                (from[0] - measured_m[0]).hypot(from[1] - measured_m[1]) / SLANT_M * 1e3
            };
            Record {
                label: format!("row {}", i + 2),
                target: ["upper", "lower", "board <3>"][i % 3].to_owned(),
                unix_ns: Some(
                    start
                        + (part * 720.0) as i64 * DAY_NS
                        + ((0.5 + hour_angle_deg / 360.0) * DAY_NS as f64) as i64,
                ),
                hour_angle_deg: Some(hour_angle_deg),
                sun_azimuth_deg: 180.0 + hour_angle_deg,
                sun_elevation_deg: 20.0 + 40.0 * dice.roll(),
                measured_m,
                before_m,
                after_m,
                before_mrad: mrad(before_m),
                after_mrad: mrad(after_m),
                epoch: (!rejected).then_some(epoch),
                rejected: rejected.then(|| "far from the others of its day".to_owned()),
            }
        })
        .collect();
    let rms = |of: fn(&Record) -> f64| {
        let used: Vec<f64> = records
            .iter()
            .filter(|r| r.rejected.is_none())
            .map(|r| of(r).powi(2))
            .collect();
        (used.iter().sum::<f64>() / used.len() as f64).sqrt()
    };
    let (before_rms_mrad, after_rms_mrad) = (rms(|r| r.before_mrad), rms(|r| r.after_mrad));
    let sections = (0..epochs)
        .map(|e| {
            let of = || records.iter().filter(|r| r.epoch == Some(e));
            EpochSection {
                from_unix_ns: of().filter_map(|r| r.unix_ns).min(),
                to_unix_ns: of().filter_map(|r| r.unix_ns).max(),
                observations: of().count(),
                beam_rms_mrad: after_rms_mrad,
                verdict: Verdict::Determined,
                words: "Determined: 0.21 mrad over the sun positions of a year.".to_owned(),
                year_pointing_mrad: Some(0.21),
                parameters: parameters(&mut dice, e),
                correlation: correlation(6, &mut dice),
                correlation_names: NAMES[..6].iter().map(|n| (*n).to_owned()).collect(),
                facts: vec![("condition".to_owned(), "38".to_owned())],
            }
        })
        .collect();
    HeliostatSection {
        id: id.to_owned(),
        verdict: Verdict::Determined,
        words: vec!["Determined by its records.".to_owned()],
        before_rms_mrad,
        after_rms_mrad,
        facts: vec![(
            "solver".to_owned(),
            "Hartley-Meyer, 7 iterations".to_owned(),
        )],
        records,
        epochs: sections,
        sets: vec![
            SetChoice {
                chosen: false,
                beam_rms_mrad: 0.74,
                unseen_rms_mrad: Some(0.8),
                sets: vec![SetRow {
                    observations: 140,
                    beam_rms_mrad: 0.74,
                    ..SetRow::default()
                }],
            },
            SetChoice {
                chosen: true,
                beam_rms_mrad: 0.61,
                unseen_rms_mrad: Some(0.72),
                sets: [(None, Some(-4.5)), (Some(-4.5), None)]
                    .map(|(hour_angle_from_deg, hour_angle_to_deg)| SetRow {
                        hour_angle_from_deg,
                        hour_angle_to_deg,
                        observations: 70,
                        beam_rms_mrad: 0.61,
                    })
                    .to_vec(),
            },
        ],
    }
}

const NAMES: [&str; 7] = [
    "pedestal tilt 1",
    "pedestal tilt 2",
    "azimuth reference",
    "non-orthogonality",
    "elevation reference",
    "mirror tilt",
    "mirror offset",
];

fn parameters(dice: &mut Dice, epoch: usize) -> Vec<ParameterRow> {
    let values = [0.13, -0.42, 124.351, 0.9, -3.27, 0.05, 0.175];
    NAMES
        .iter()
        .zip(values)
        .enumerate()
        .map(|(i, (name, value))| {
            let held = i == 6;
            let value =
                value + 0.02 * dice.normal() + if i == 2 { 0.3 * epoch as f64 } else { 0.0 };
            let error = 0.008 + 0.01 * dice.roll();
            ParameterRow {
                name: (*name).to_owned(),
                unit: if held {
                    ParameterUnit::Metres
                } else {
                    ParameterUnit::Degrees
                },
                value: if held { 0.175 } else { value },
                before: Some(if held { 0.175 } else { 0.0 }),
                standard_error: (!held).then_some(error),
                interval95: (!held).then_some([value - 2.0 * error, value + 2.0 * error]),
                held,
            }
        })
        .collect()
}

fn correlation(n: usize, dice: &mut Dice) -> Vec<Vec<f64>> {
    let below: Vec<f64> = (0..n * n)
        .map(|_| (0.6 * dice.normal()).clamp(-0.999, 0.999))
        .collect();
    let entry = |i: usize, j: usize| match i.cmp(&j) {
        std::cmp::Ordering::Equal => 1.0,
        std::cmp::Ordering::Less => below[i * n + j],
        std::cmp::Ordering::Greater => below[j * n + i],
    };
    (0..n)
        .map(|i| (0..n).map(|j| entry(i, j)).collect())
        .collect()
}

/// A field in rings around the tower.
fn field(n: usize) -> Vec<HeliostatSummary> {
    let mut dice = Dice(7);
    (0..n)
        .map(|i| {
            let radius = 60.0 + 12.0 * (i as f64).sqrt();
            let angle = i as f64 * 2.399_963;
            let verdict = match dice.roll() {
                r if r < 0.005 => Verdict::Failed,
                r if r < 0.02 => Verdict::Undetermined,
                r if r < 0.03 => Verdict::NotObserved,
                _ => Verdict::Determined,
            };
            HeliostatSummary {
                id: format!("H{:06}", i + 1),
                east_m: radius * angle.sin(),
                north_m: radius * angle.cos(),
                beam_rms_mrad: match verdict {
                    Verdict::Failed | Verdict::NotObserved => f64::NAN,
                    _ => 0.8 * (0.4 * dice.normal()).exp() + 0.3 * radius / (radius + 900.0),
                },
                verdict,
                observations: 50,
                rejected: usize::from(dice.roll() < 0.1),
                epochs: 1 + usize::from(dice.roll() < 0.01),
                remark: String::new(),
            }
        })
        .collect()
}

fn page(field: Vec<HeliostatSummary>, heliostats: Vec<HeliostatSection>) -> CalibrationPage {
    CalibrationPage {
        title: "Calibration of a made-up field".to_owned(),
        generated_utc: "2026-11-22 12:00 UTC".to_owned(),
        version: "helio-rs 0.1.0".to_owned(),
        facts: vec![
            ("field".to_owned(), "field.toml".to_owned()),
            ("observations".to_owned(), "observations.csv".to_owned()),
        ],
        findings: vec!["3 heliostats were seen on the wrong target.".to_owned()],
        field,
        tower_m: Some([0.0, 0.0]),
        targets: vec![
            TargetOutline {
                name: "upper".to_owned(),
                size_m: Some([7.0, 6.0]),
            },
            TargetOutline {
                name: "lower".to_owned(),
                size_m: None,
            },
        ],
        heliostats,
    }
}

/// Writes a page to be looked at, and checks what every page must keep.
fn drawn(name: &str, page: &CalibrationPage) -> String {
    let html = calibration_page(page);
    common::keep(name, &html, &["inf"]);
    html
}

#[test]
fn a_section_shows_everything() {
    let mut lines = field(400);
    for (line, id) in lines.iter_mut().zip(["A<1>", "BE&61"]) {
        line.id = id.to_owned();
    }
    let sections = vec![heliostat("A<1>", 145, 0, 1), heliostat("BE&61", 173, 4, 2)];
    let html = drawn("calibration", &page(lines, sections));
    for text in [
        "Heliostat A&lt;1&gt;",
        "Heliostat BE&amp;61",
        "board &lt;3&gt;",
        "Rejected records",
        "far from the others of its day",
        "Sets over the day",
        "azimuth reference, °",
        "epoch 2, from",
        "Correlations of the fitted parameters",
        "RMS over the field",
        "2 of 400 heliostats have a section below",
        "398 are left out, of which ",
    ] {
        assert!(html.contains(text), "{text}");
    }
    // Two pictures of the field and four of each heliostat; each has its title.
    assert_eq!(html.matches("<svg role=\"img\"").count(), 2 + 2 * 4);
    assert_eq!(html.matches("</title><desc>").count(), 2 + 2 * 4);
}

#[test]
fn parts_of_the_day_are_no_jumps() {
    let mut section = heliostat("A1", 80, 1, 4);
    let all = section.epochs[1].to_unix_ns;
    section.epochs[0].to_unix_ns = all;
    let html = drawn("calibration-sets", &page(field(3), vec![section]));
    assert!(html.contains("2 parts of the day have parameters of their own"));
    assert!(html.contains("<h3>Set 2</h3>") && html.contains(">set 1<"));
    assert!(!html.contains("jumped") && !html.contains("epoch 2"));
}

#[test]
fn a_field_of_170_000_is_one_page_of_bearable_size() {
    let lines = field(170_000);
    let chosen = most_in_need(&lines, SECTIONS, &["H000007", "not there"]);
    assert_eq!(chosen.len(), SECTIONS + 1);
    assert_eq!(lines[chosen[0]].id, "H000007");
    assert!(
        chosen[1..]
            .iter()
            .all(|&i| lines[i].verdict == Verdict::Failed)
    );
    let sections = chosen
        .iter()
        .map(|&i| heliostat(&lines[i].id, 50, 0, i as u64))
        .collect();
    let html = drawn("calibration-170000", &page(lines, sections));
    assert!(html.contains("41 of 170\u{202f}000 heliostats"));
    assert!(html.len() < 4_000_000, "{}", html.len());
}

#[test]
fn odd_pages_are_drawn() {
    drawn("calibration-empty", &CalibrationPage::default());

    let mut one = heliostat("only", 1, 0, 3);
    one.verdict = Verdict::Undetermined;
    let lines = vec![HeliostatSummary {
        id: "only".to_owned(),
        beam_rms_mrad: 0.0,
        verdict: Verdict::Undetermined,
        ..HeliostatSummary::default()
    }];
    let html = drawn("calibration-one", &page(lines.clone(), vec![one.clone()]));
    assert!(!html.contains("have a section below"));

    // Not a single finite number.
    let nothing = Record {
        unix_ns: None,
        hour_angle_deg: None,
        sun_azimuth_deg: f64::NAN,
        sun_elevation_deg: f64::NAN,
        measured_m: [f64::NAN; 2],
        before_m: [f64::INFINITY; 2],
        after_m: [f64::NAN; 2],
        before_mrad: f64::NAN,
        after_mrad: f64::NAN,
        ..one.records[0].clone()
    };
    // Known spots and residuals, but no sun and no time.
    let sunless = Record {
        measured_m: [1e9, -1e9],
        after_m: [1e9, -1e9],
        after_mrad: 0.0,
        ..nothing.clone()
    };
    let mut epoch = one.epochs[0].clone();
    epoch.from_unix_ns = None;
    epoch.to_unix_ns = None;
    epoch.correlation[1][0] = f64::NAN;
    epoch.correlation[0].pop();
    for row in &mut epoch.parameters {
        row.value = f64::NAN;
        row.interval95 = Some([f64::NEG_INFINITY, f64::INFINITY]);
        row.standard_error = Some(f64::INFINITY);
        row.before = Some(f64::NAN);
    }
    let section = |records: Vec<Record>, epochs| HeliostatSection {
        id: "odd".to_owned(),
        before_rms_mrad: f64::NAN,
        after_rms_mrad: f64::INFINITY,
        records,
        epochs,
        ..HeliostatSection::default()
    };
    let mut placeless = lines[0].clone();
    placeless.east_m = f64::NAN;
    placeless.beam_rms_mrad = f64::INFINITY;
    let sections = vec![
        section(vec![nothing], vec![epoch.clone(), epoch.clone()]),
        section(vec![sunless; 3], vec![epoch]),
        section(Vec::new(), Vec::new()),
    ];
    drawn("calibration-odd", &page(vec![placeless], sections));
}

#[test]
fn wild_numbers_do_not_hide_the_others() {
    let mut section = heliostat("wild", 60, 0, 5);
    section.records[10].before_m = [4e6, 3e12];
    section.records[11].rejected = Some("off by 900 mrad".to_owned());
    section.records[11].after_m = [210.0, 3.0];
    section.records[11].after_mrad = 900.0;
    section.sets.clear();
    let mut lines = field(30);
    lines[3].beam_rms_mrad = 4e5;
    let html = drawn("calibration-wild", &page(lines, vec![section]));
    assert!(html.contains(": 1 come from outside"));
    assert!(html.contains("Beyond the right edge: 1, up to"));
}
