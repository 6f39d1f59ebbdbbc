//! Pages of joint calibrations from made-up numbers: odd ones, and as large as fields get. Each is also
//! written to the build's temporary folder, to be looked at.

mod common;

use common::{DAY_NS, Dice};
use helio_report::joint::{
    CauseLine, HeliostatLine, JointPage, NumberLine, RecordLine, TRACKS, joint_page,
};

const NAMES: [&str; 7] = [
    "pedestal tilt along mount axis 1",
    "pedestal tilt along mount axis 2",
    "azimuth reference",
    "axis non-orthogonality",
    "elevation reference",
    "mirror tilt",
    "eccentricity of axis 2",
];
const SPREAD_MRAD: [f64; 7] = [12.0, 9.0, 3.0, 1.0, 6.0, 4.0, 1.0];
const MEAN_MRAD: [f64; 7] = [1.0, -4.0, 0.3, 0.0, -11.0, 2.0, 0.8];

/// A heliostat whose misses are `bold` times as large as stated.
fn heliostat(id: &str, records: usize, bold: f64, seed: u64) -> HeliostatLine {
    let mut dice = Dice(seed);
    let mut zero = [0.0; 2];
    let lines = (0..records)
        .map(|i| {
            // As uncertain as the field at first, then soon as the noise.
            let beam = 0.8 + 18.0 / (1.0 + i as f64).powi(2);
            let [a, c, r] = [beam, 0.6 * beam, 0.3];
            let (x, y) = (dice.normal(), dice.normal());
            let outlier = dice.roll() < 0.02;
            let far = if outlier { 9.0 } else { bold };
            let jumped = [dice.roll() < 0.01, dice.roll() < 0.004];
            for axis in 0..2 {
                let by = if jumped[axis] { 4.0 } else { 0.2 };
                zero[axis] = 0.9 * zero[axis] + by * dice.normal();
            }
            RecordLine {
                label: format!("row {}", i + 2),
                unix_ns: Some(19_153 * DAY_NS + (i as i64 * 7 + 1) * DAY_NS / 5),
                miss_mrad: [far * a * x, far * c * (r * x + (1.0 - r * r).sqrt() * y)],
                covariance_mrad2: [a * a, a * c * r, c * c],
                zero_mrad: zero,
                zero_sigma_mrad: [0.3, 0.5],
                outlier,
                jumped,
                in_doubt: jumped[0] && i + 6 >= records,
            }
        })
        .collect();
    HeliostatLine {
        id: id.to_owned(),
        observations: records,
        values_mrad: (0..7)
            .map(|k| MEAN_MRAD[k] + SPREAD_MRAD[k] * dice.normal())
            .collect(),
        sigmas_mrad: vec![0.4; 7],
        records: lines,
    }
}

fn cause(name: &str, unit: &str, value: f64, admitted: bool) -> CauseLine {
    CauseLine {
        name: name.to_owned(),
        scope: "field".to_owned(),
        unit: unit.to_owned(),
        value: if admitted { value } else { 0.0 },
        sigma: 0.04,
        spread: None,
        log_evidence: if admitted { 120.3 } else { -2.1 },
        admitted,
        turn_mrad: Some(if admitted { value.abs() } else { 0.0 }),
        worth_mrad: Some(if admitted { 0.8 * value.abs() } else { 0.0 }),
    }
}

fn page(heliostats: Vec<HeliostatLine>) -> JointPage {
    let mut covariance_mrad2 = vec![0.0; 49];
    for i in 0..7 {
        for j in 0..7 {
            let correlation = if i == j { 1.0 } else { -0.2 };
            covariance_mrad2[7 * i + j] = correlation * SPREAD_MRAD[i] * SPREAD_MRAD[j];
        }
    }
    JointPage {
        title: "A made-up field as one".to_owned(),
        generated_utc: "2026-11-22 12:00 UTC".to_owned(),
        version: "helio-rs 0.1.0".to_owned(),
        facts: vec![("field".to_owned(), "field.toml".to_owned())],
        findings: vec!["A finding of the caller.".to_owned()],
        causes: vec![
            cause("sun ahead of its recorded time", "s", 0.3, false),
            cause("sag of axis 2", "mrad", 3.61, true),
            cause("board <3>: shift to the right", "mm", -0.9, true),
        ],
        noise: vec![NumberLine {
            name: "scatter across the beam".to_owned(),
            value: 0.2213,
            unit: "mrad".to_owned(),
        }],
        followed: false,
        unknowns: NAMES.map(str::to_owned).to_vec(),
        mean_mrad: MEAN_MRAD.to_vec(),
        covariance_mrad2,
        heliostats,
    }
}

fn field(n: usize, records: usize, bold: f64) -> Vec<HeliostatLine> {
    (0..n)
        .map(|i| heliostat(&format!("H{:05}", i + 1), records, bold, i as u64 + 1))
        .collect()
}

/// Writes a page to be looked at, and checks what every page must keep.
fn drawn(name: &str, page: &JointPage) -> String {
    let html = joint_page(page);
    common::keep(name, &html, &["inf\"", "inf "]);
    html
}

/// The share that the table of ellipses prints for plain records \[%\].
fn printed_share(html: &str, stated: &str) -> f64 {
    let row = format!("<td class=\"n\">{stated} %</td><td class=\"n\">");
    let (_, rest) = html.split_once(&row).expect("a row of the table");
    let (number, _) = rest.split_once(" %").expect("a share");
    number.parse().expect("a number")
}

#[test]
fn a_page_shows_everything() {
    let mut lines = field(12, 150, 1.0);
    lines[0].id = "A<1>".to_owned();
    lines[1].id = "BE&61".to_owned();
    lines[2].records[70].outlier = true;
    lines[2].records[70].label = "row <72>".to_owned();
    let html = drawn("joint", &page(lines));
    for text in [
        "A&lt;1&gt;",
        "BE&amp;61",
        "board &lt;3&gt;: shift to the right",
        "row &lt;72&gt;",
        "3.610 ± 0.040 mrad",
        "A finding of the caller.",
        "Of 3 causes looked for the records speak for 2.",
        ">not admitted<",
        ">0.221<",
        "elevation reference, mrad",
        "axis 1 jumped",
        "What the words mean",
        "Heliostats: 12, observed: 12. Records: 1\u{202f}800,",
    ] {
        assert!(html.contains(text), "{text}");
    }
    // Causes, distribution, correlations, zero points, and two of what was foretold; each has its title.
    assert_eq!(html.matches("<svg role=\"img\"").count(), 6);
    assert_eq!(html.matches("</title><desc>").count(), 6);
    // By what they are worth, those not admitted last.
    let place = |text: &str| html.rfind(text).expect(text);
    assert!(place("sag of axis 2") < place("board &lt;3&gt;"));
    assert!(place("board &lt;3&gt;") < place("sun ahead"));
}

#[test]
fn shares_are_those_of_the_normal_distribution() {
    let right = drawn("joint-right", &page(field(40, 500, 1.0)));
    let bold = drawn("joint-bold", &page(field(40, 500, 2.0)));
    for stated in [50.0, 68.0, 80.0, 90.0, 95.0, 99.0_f64] {
        let text = format!("{stated:.0}");
        // some 19,000 records: 0.35 % is one standard error at most
        let share = printed_share(&right, &text);
        assert!((share - stated).abs() < 1.4, "{stated}: {share}");
        // Misses twice as large: as many inside as in the ellipse of half the radius.
        let half = 100.0 * (1.0 - (1.0 - 0.01 * stated).powf(0.25));
        let share = printed_share(&bold, &text);
        assert!((share - half).abs() < 1.4, "{stated}: {share}, {half}");
    }
}

#[test]
fn a_field_of_12_000_is_one_page_of_bearable_size() {
    let html = drawn("joint-12000", &page(field(12_000, 50, 1.0)));
    assert!(html.len() < 2_000_000, "{}", html.len());
    assert!(html.contains("24 of 12\u{202f}000 heliostats"));
    assert_eq!(html.matches(">50 records</text>").count(), TRACKS);
    assert_eq!(html.matches("earlier ones are not listed").count(), 2);
    assert!(html.contains("Values of 12\u{202f}000 observed heliostats, counted"));
}

#[test]
fn the_heliostat_missed_farthest_is_drawn() {
    let mut lines = field(200, 20, 1.0);
    lines[137] = heliostat("worst", 20, 5.0, 9);
    let html = drawn("joint-worst", &page(lines));
    assert!(html.contains(">worst</text>") && html.contains("<td>worst</td>"));
}

#[test]
fn a_caller_may_leave_records_out() {
    let mut lines = field(30, 60, 1.0);
    for line in &mut lines[10..] {
        line.records.clear();
    }
    // One that nobody ever observed.
    lines.push(HeliostatLine {
        id: "never".to_owned(),
        values_mrad: MEAN_MRAD.to_vec(),
        sigmas_mrad: SPREAD_MRAD.to_vec(),
        ..HeliostatLine::default()
    });
    let html = drawn("joint-part", &page(lines));
    assert!(html.contains("Heliostats: 31, observed: 30. Records: 1\u{202f}800,"));
    assert!(html.contains("outliers and jumps, are those of 600 of them."));
    assert!(html.contains("Left out, as never observed: 1."));
}

/// Of a field that is followed the records of a run come after others.
#[test]
fn records_are_the_last_of_a_heliostats_observations() {
    let mut lines = field(30, 4, 1.0);
    let few = drawn("joint-few", &page(lines.clone()));
    assert!(!few.contains("One record ahead, after"));
    for line in &mut lines {
        line.observations = 54;
    }
    let mut followed = page(lines);
    followed.followed = true;
    let html = drawn("joint-followed", &followed);
    assert!(
        html.contains("as known after each record") && few.contains("as all records tell them")
    );
    assert!(html.contains("One record ahead, after a heliostat's first 6"));
    // each of them is foretold from 50 records or more
    assert!(html.contains(">48–95</text>") && !html.contains(">3–5</text>"));
}

#[test]
fn odd_pages_are_drawn() {
    let html = drawn("joint-empty", &JointPage::default());
    for text in [
        "No causes were looked for",
        "There are no records",
        "No record was foretold",
    ] {
        assert!(html.contains(text), "{text}");
    }

    let mut none = page(Vec::new());
    none.causes.retain(|c| !c.admitted);
    drawn("joint-none", &none);

    // One heliostat with one record, which says nothing of its time.
    let mut one = page(vec![heliostat("only", 1, 1.0, 3)]);
    one.heliostats[0].records[0].unix_ns = None;
    let html = drawn("joint-one", &one);
    assert!(html.contains("no times known"));

    // All records are outliers, or after jumps.
    let mut doubted = page(vec![heliostat("a", 5, 1.0, 3), heliostat("b", 5, 1.0, 4)]);
    for record in &mut doubted.heliostats[0].records {
        record.outlier = true;
    }
    for record in &mut doubted.heliostats[1].records {
        record.jumped = [true; 2];
    }
    drawn("joint-doubted", &doubted);

    // Nothing but zeros.
    let mut still = page(vec![heliostat("still", 9, 1.0, 5); 2]);
    for record in still.heliostats.iter_mut().flat_map(|h| &mut h.records) {
        record.miss_mrad = [0.0; 2];
        record.zero_mrad = [0.0; 2];
        record.zero_sigma_mrad = [0.0; 2];
    }
    for cause in &mut still.causes {
        (cause.value, cause.sigma, cause.worth_mrad) = (0.0, 0.0, Some(0.0));
    }
    drawn("joint-still", &still);

    // Not a single finite number, and lists that are too short.
    let mut odd = page(field(3, 30, 1.0));
    for line in &mut odd.heliostats {
        line.values_mrad = vec![f64::NAN, f64::INFINITY];
        line.sigmas_mrad = vec![-1.0];
        for (i, record) in line.records.iter_mut().enumerate() {
            record.miss_mrad = [f64::NAN, f64::INFINITY];
            record.covariance_mrad2 = [[1.0, 2.0, 1.0], [f64::NAN; 3]][i % 2];
            record.zero_mrad = [f64::NAN, f64::NEG_INFINITY];
            record.zero_sigma_mrad = [f64::INFINITY; 2];
        }
    }
    for cause in &mut odd.causes {
        cause.value = f64::NAN;
        cause.sigma = f64::INFINITY;
        cause.spread = Some(f64::NAN);
        cause.log_evidence = f64::NEG_INFINITY;
        cause.worth_mrad = Some(f64::INFINITY);
        cause.turn_mrad = Some(f64::NAN);
    }
    odd.noise[0].value = f64::NAN;
    odd.mean_mrad = vec![f64::NAN; 2];
    odd.covariance_mrad2[0] = -1.0;
    odd.covariance_mrad2[8] = f64::NAN;
    drawn("joint-odd", &odd);
    odd.covariance_mrad2.clear();
    drawn("joint-odder", &odd);
}
