//! Pages of simulated tracking-accuracy campaigns: a good heliostat, a bad one, a short campaign and one without any
//! usable frame. Each is also written to the build's temporary folder, to be looked at.

mod common;

use common::keep;
use helio_report::accuracy::{AccuracyPage, accuracy_page};
use helio_spot::SpotStatus;
use helio_spot::accuracy::simulate::Campaign;
use helio_spot::accuracy::{
    Evaluation, Limits, Options, Setup, SpotRow, Statements, Uncertainty, Weather, evaluate,
};

struct Made {
    spots: Vec<SpotRow>,
    setup: Setup,
    limits: Limits,
    options: Options,
    found: Evaluation,
}

fn made(spots: Vec<SpotRow>, weather: Option<&Weather>) -> Made {
    let setup = Setup {
        aim_m: [0.0; 2],
        slant_m: 100.0,
        toward_heliostat: Some([0.3, 0.4, 0.9]),
        uncertainty: Uncertainty {
            slant_m: Some(0.1),
            scale: Some(0.002),
            survey_m: Some(0.004),
            centre_m: None,
        },
    };
    let (limits, options) = (Limits::grlm(), Options::default());
    let said = Statements {
        camera_bits: Some(8.0),
        wind_resolution_m_s: Some(1.0),
        ..Statements::default()
    };
    let found = evaluate(&spots, weather, &setup, &limits, &options, &said).expect("a campaign");
    Made {
        spots,
        setup,
        limits,
        options,
        found,
    }
}

fn page(name: &str, made: &Made) -> String {
    let html = accuracy_page(&AccuracyPage {
        title: "Tracking accuracy of heliostat <A1>".to_owned(),
        version: "helio-rs 0.0.0".to_owned(),
        generated_utc: "2026-11-23 06:00 UTC".to_owned(),
        facts: vec![
            ("laboratory".to_owned(), "Test & Co".to_owned()),
            ("distance".to_owned(), "100 m".to_owned()),
        ],
        evaluation: &made.found,
        spots: &made.spots,
        setup: &made.setup,
        limits: &made.limits,
        options: &made.options,
        instruments: vec![
            ["camera", "C", "", "17", "2026-01-05"].map(str::to_owned),
            ["wind", "A", "M", "", ""].map(str::to_owned),
        ],
        files: vec![("spots.csv".to_owned(), "0123456789abcdef".repeat(4))],
        notes: vec![],
    });
    keep(name, &html, &["inf"]);
    assert!(html.contains("heliostat &lt;A1&gt;") && html.contains("Test &amp; Co"));
    for word in [
        "<td>5.1 ",
        "<td>A.2 ",
        "Signatures",
        "SHA-256",
        "prefers-color-scheme",
    ] {
        assert!(html.contains(word), "{name}: {word}");
    }
    html
}

#[test]
fn each_verdict_has_its_page() {
    let good = Campaign {
        bias_mrad: [0.3, -0.2],
        gust_mrad: 1.3,
        empty: 0.0005,
        frames_per_s: 5.0,
        duration_s: 7200.0,
        ..Campaign::default()
    };
    let (bad, short) = (
        Campaign {
            gust_mrad: 4.0,
            ..good
        },
        Campaign {
            duration_s: 420.0,
            ..good
        },
    );
    for (name, campaign, words) in [
        ("accuracy-good", good, "<b>Qualified</b>"),
        ("accuracy-bad", bad, "<b>Not qualified</b>"),
        ("accuracy-short", short, "<b>Not enough data</b>"),
    ] {
        let (spots, weather) = campaign.simulate();
        let html = page(name, &made(spots, Some(&weather)));
        assert!(html.contains(words), "{name}");
        assert!(html.len() < 600_000, "{name}: {} bytes", html.len());
    }
}

#[test]
fn odd_campaigns_have_pages() {
    let spot = |second: i64, spot_m, status| SpotRow {
        unix_ns: Some(second * 1_000_000_000),
        spot_m,
        sigma_m: None,
        status,
    };
    let none = vec![
        spot(0, None, Some(SpotStatus::Empty)),
        spot(1, None, None),
        spot(2, None, Some(SpotStatus::NoTarget)),
    ];
    let html = page("accuracy-none", &made(none, None));
    assert!(html.contains("No frame was counted"));
    let one = vec![spot(0, Some([0.1, 0.0]), Some(SpotStatus::Ok))];
    page("accuracy-one", &made(one, None));
    let far = vec![
        spot(0, Some([0.0, 0.0]), Some(SpotStatus::Ok)),
        spot(1, Some([1e6, -1e6]), Some(SpotStatus::Ok)),
    ];
    page("accuracy-far", &made(far, None));
    let still = vec![spot(0, Some([0.0, 0.0]), Some(SpotStatus::Ok)); 40];
    page("accuracy-still", &made(still, None));
}
