//! Pages of flux runs.

use helio_flux::Account;
use helio_report::flux::{FluxPage, GridMap, MapText, Surface, Table, grid_map, page};

use super::common::keep;

fn account() -> Account {
    Account {
        mirror_w: 12_500.0,
        incoming_w: 10_000.0,
        shaded_w: 500.0,
        reflection_loss_w: 1_500.0,
        blocked_w: 250.0,
        spilled_w: 750.0,
        received_w: 7_000.0,
        rays: 4_000_000,
        turned_away: 3,
    }
}

#[test]
fn a_page_has_the_account_its_figures_and_nothing_from_outside() {
    let values: Vec<f64> = (0..64 * 64).map(|i| f64::from(i % 64)).collect();
    let map = GridMap {
        text: MapText {
            title: "Flux",
            dni_w_m2: None,
            subtitle: "",
        },
        surface: Surface::Plane {
            width_m: 1.0,
            height_m: 1.0,
        },
        rows: 64,
        columns: 64,
        irradiance_w_m2: &values,
    };
    let account = account();
    assert_eq!(account.unaccounted_w(), 0.0);
    let html = page(&FluxPage {
        title: "Run <1>".to_owned(),
        version: "helio-rs 0.0.0".to_owned(),
        generated_utc: "2026-11-23 06:00 UTC".to_owned(),
        facts: vec![("mesh".to_owned(), "a & b.inp".to_owned())],
        account: Some(&account),
        tables: vec![Table {
            title: "Slope errors".to_owned(),
            head: vec!["method".to_owned(), "RMS, mrad".to_owned()],
            rows: vec![vec!["elements".to_owned(), "20.1".to_owned()]],
        }],
        figures: vec![(grid_map(&map).unwrap(), "Seen from the field.".to_owned())],
        notes: vec!["Two faces were left out.".to_owned()],
    });
    keep("flux-page", &html, &["inf"]);
    for words in [
        "Run &lt;1&gt;",
        "a &amp; b.inp",
        "<td>shaded by other mirrors</td><td class=\"n\">0.5\u{202f}kW</td><td class=\"n\">5.00\u{202f}%</td>",
        "<b>7\u{202f}kW</b></td><td class=\"n\"><b>70.00\u{202f}%</b>",
        "12.5\u{202f}kW would fall; of that 56.00\u{202f}% is received",
        "4\u{202f}000\u{202f}000 rays were traced",
        "3 elements are turned away",
        "data:image/png;base64,",
        "Seen from the field.",
        "Two faces were left out.",
        "prefers-color-scheme",
    ] {
        assert!(html.contains(words), "{words}");
    }
}

#[test]
fn pages_of_nothing_are_pages() {
    let none = Account::default();
    for account in [None, Some(&none)] {
        let html = page(&FluxPage {
            account,
            ..FluxPage::default()
        });
        keep("flux-empty", &html, &["inf"]);
    }
}
