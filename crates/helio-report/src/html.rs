//! Self-contained HTML pages.

use std::fmt::Write;

use helio_core::Status;

use crate::svg::{Escaped, Figure};

/// A page with a heading, a few facts, a table of statuses and figures.
///
/// ```
/// use helio_core::Status;
/// let page = helio_report::Page {
///     title: "My field",
///     facts: &[("suns", "1".to_owned())],
///     statuses: &[(Status::Ok, 2)],
///     figures: &[],
/// };
/// assert!(page.to_html().contains("<h1>My field</h1>"));
/// ```
#[derive(Debug, Clone, Copy)]
pub struct Page<'a> {
    /// Heading.
    pub title: &'a str,
    /// What the reader should know, each with its name.
    pub facts: &'a [(&'a str, String)],
    /// Rows of each status.
    pub statuses: &'a [(Status, u64)],
    /// The drawings.
    pub figures: &'a [Figure],
}

const STYLE: &str = "body{font:15px/1.5 system-ui,'Segoe UI',Helvetica,Arial,sans-serif;\
                     max-width:900px;margin:2em auto;padding:0 1em;color:#222}\
                     table{border-collapse:collapse;margin:1em 0}\
                     th,td{padding:.25em .9em .25em 0;text-align:left;vertical-align:top}\
                     td.n{text-align:right;font-variant-numeric:tabular-nums}\
                     th{font-weight:600}thead th{border-bottom:1px solid #888}\
                     svg{max-width:100%;height:auto}footer{color:#666;font-size:.85em}";

impl Page<'_> {
    /// The page as a complete HTML file that needs nothing from outside.
    #[must_use]
    pub fn to_html(&self) -> String {
        let title = Escaped(self.title);
        let mut html = format!(
            "<!DOCTYPE html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n\
             <meta name=\"viewport\" content=\"width=device-width\">\n<title>{title}</title>\n\
             <style>{STYLE}</style>\n</head>\n<body>\n<h1>{title}</h1>\n<table>\n"
        );
        // Writing to a string cannot fail.
        for (name, text) in self.facts {
            let (name, text) = (Escaped(name), Escaped(text));
            let _ = writeln!(html, "<tr><th>{name}</th><td>{text}</td></tr>");
        }
        html.push_str("</table>\n");
        let rows: u64 = self.statuses.iter().map(|&(_, rows)| rows).sum();
        if rows > 0 {
            html.push_str(
                "<h2>Statuses</h2>\n<table>\n<thead><tr><th>status</th><th>rows</th>\
                 <th>share</th></tr></thead>\n",
            );
            for &(status, count) in self.statuses.iter().filter(|&&(_, count)| count > 0) {
                let share = 100.0 * count as f64 / rows as f64;
                let _ = writeln!(
                    html,
                    "<tr><td>{status}</td><td class=\"n\">{count}</td><td class=\"n\">{share:.1} %</td></tr>"
                );
            }
            html.push_str("</table>\n");
        }
        for figure in self.figures {
            let _ = writeln!(
                html,
                "<figure style=\"margin:1.5em 0\">{}</figure>",
                figure.element()
            );
        }
        let _ = write!(
            html,
            "<footer>helio-rs {}. Shading and blocking are not computed.</footer>\n</body>\n</html>\n",
            env!("CARGO_PKG_VERSION")
        );
        html
    }
}
