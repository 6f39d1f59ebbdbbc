//! The page of a flux run.

use std::fmt::Write;

use helio_flux::Account;

use super::units::{power, with};
use crate::calibration::page::{document, facts, figure, sentences};
use crate::calibration::plot::count;
use crate::svg::{Escaped, Figure};

/// What a flux run says.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct FluxPage<'a> {
    /// Heading.
    pub title: String,
    /// What made it, such as "helio-rs 0.4.0".
    pub version: String,
    /// When the page was made, as text; this crate has no clock.
    pub generated_utc: String,
    /// What the reader should know of the run, each with its name: files, sun, receiver, rays.
    pub facts: Vec<(String, String)>,
    /// Where the power went.
    pub account: Option<&'a Account>,
    /// Further tables.
    pub tables: Vec<Table>,
    /// Drawings, each with its caption.
    pub figures: Vec<(Figure, String)>,
    /// What else is to be known, in sentences: faults of the mesh, what was not computed.
    pub notes: Vec<String>,
}

/// A table of a page.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct Table {
    /// Heading above it.
    pub title: String,
    /// Names of the columns. The first column is text, the others are numbers.
    pub head: Vec<String>,
    /// Rows of cells; short rows leave the last cells empty.
    pub rows: Vec<Vec<String>>,
}

/// The page as a complete HTML file that needs nothing from outside.
///
/// ```
/// use helio_flux::Account;
/// use helio_report::flux::{FluxPage, page};
/// let account = Account { mirror_w: 1100.0, incoming_w: 1000.0, spilled_w: 400.0, received_w: 600.0, ..Account::default() };
/// let html = page(&FluxPage {
///     title: "A run".to_owned(),
///     account: Some(&account),
///     ..FluxPage::default()
/// });
/// assert!(html.contains("<h1>A run</h1>") && html.contains("60.00\u{202f}%"));
/// ```
#[must_use]
pub fn page(page: &FluxPage<'_>) -> String {
    let mut html = facts(&page.facts);
    if let Some(found) = page.account {
        html.push_str("<h2>Where the power went</h2>\n");
        html.push_str(&account(found));
    }
    for one in &page.tables {
        html.push_str(&table(one));
    }
    for (drawing, caption) in &page.figures {
        html.push_str(&figure(&drawing.inline(), caption));
    }
    if !page.notes.is_empty() {
        html.push_str("<h2>To be borne in mind</h2>\n");
        html.push_str(&sentences(&page.notes));
    }
    document(&page.title, &html, [&page.version, &page.generated_utc])
}

fn account(account: &Account) -> String {
    let unit = power(account.mirror_w.max(account.incoming_w));
    let share = |watts: f64| {
        if account.incoming_w > 0.0 {
            format!("{:.2}\u{202f}%", 100.0 * watts / account.incoming_w)
        } else {
            "–".to_owned()
        }
    };
    let mut html = String::from(
        "<div class=\"scroll\"><table><thead><tr><th>power</th><th class=\"n\"></th>\
         <th class=\"n\">of the incoming</th></tr></thead>\n",
    );
    for (name, watts, bold) in [
        (
            "incoming on the mirrors' apertures",
            account.incoming_w,
            true,
        ),
        ("shaded by other mirrors", account.shaded_w, false),
        ("lost at the reflection", account.reflection_loss_w, false),
        ("blocked by other mirrors", account.blocked_w, false),
        ("spilled beside the receiver", account.spilled_w, false),
        ("received", account.received_w, true),
    ] {
        let (open, close) = if bold { ("<b>", "</b>") } else { ("", "") };
        // Writing to a string cannot fail.
        let _ = writeln!(
            html,
            "<tr><td>{open}{name}{close}</td><td class=\"n\">{open}{}{close}</td><td class=\"n\">{open}{}{close}</td></tr>",
            with(watts, unit),
            share(watts)
        );
    }
    html.push_str("</table></div>\n");
    let mut words = vec![format!(
        "On mirrors square to the sun {} would fall; of that {:.2}\u{202f}% is received.",
        with(account.mirror_w, unit),
        100.0 * account.efficiency()
    )];
    if account.rays > 0 {
        let rays = usize::try_from(account.rays).unwrap_or(usize::MAX);
        words.push(format!("{} rays were traced.", count(rays)));
    } else {
        words.push("The map was integrated, not traced: without shading and blocking.".to_owned());
    }
    match account.turned_away {
        0 => {}
        1 => words.push("One element is turned away from the sun.".to_owned()),
        n => words.push(format!(
            "{} elements are turned away from the sun.",
            count(n)
        )),
    }
    let _ = writeln!(html, "<p>{}</p>", Escaped(&words.join(" ")));
    html
}

fn table(table: &Table) -> String {
    let class = |k: usize| if k == 0 { "" } else { " class=\"n\"" };
    let mut html = format!("<h2>{}</h2>\n", Escaped(&table.title));
    html.push_str("<div class=\"scroll\"><table><thead><tr>");
    for (k, name) in table.head.iter().enumerate() {
        // Names of columns may break: seven of them are wider than the page.
        let _ = write!(
            html,
            "<th{} style=\"white-space:normal;vertical-align:bottom\">{}</th>",
            class(k),
            Escaped(name)
        );
    }
    html.push_str("</tr></thead>\n");
    for row in &table.rows {
        html.push_str("<tr>");
        for (k, cell) in row.iter().enumerate() {
            let _ = write!(html, "<td{}>{}</td>", class(k), Escaped(cell));
        }
        html.push_str("</tr>\n");
    }
    html.push_str("</table></div>\n");
    html
}
