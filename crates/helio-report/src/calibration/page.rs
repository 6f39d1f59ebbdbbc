//! The page around the figures.

use std::fmt::Write;

use super::plot::{count, mrad};
use super::{CalibrationPage, HeliostatSummary, Verdict, heliostat, overview};
use crate::svg::Escaped;

/// Colours by day, by night and on paper; everything else refers to them.
const STYLE: &str = "\
:root{color-scheme:light dark;--paper:#fff;--ink:#1d2126;--soft:#5c636b;--grid:#e7e9eb;--line:#8a9097;--bad:#c2185b;\
--good:#00795a;--warn:#a85b00;--none:#b9bec4;--c0:#0072b2;--c1:#d55e00;--c2:#009e73;--c3:#a64d84;--c4:#b88700;--c5:#4a5560}\
@media screen and (prefers-color-scheme:dark){:root{--paper:#14171a;--ink:#e4e7ea;--soft:#9aa2aa;--grid:#2a2f34;\
--line:#6d757d;--bad:#ff6d9e;--good:#3ecf9f;--warn:#f0a04b;--none:#545b62;--c0:#58b0e8;--c1:#ff8a3d;--c2:#33c99a;\
--c3:#dd8fc0;--c4:#e3b341;--c5:#aab4be}}\
body{font:15px/1.5 system-ui,'Segoe UI',Helvetica,Arial,sans-serif;max-width:960px;margin:2em auto;padding:0 1em;\
color:var(--ink);background:var(--paper)}\
h1{font-size:1.7em;margin:0 0 .6em}h2{font-size:1.3em;margin:2.2em 0 .6em}h3{font-size:1.05em;margin:1.6em 0 .4em}\
.scroll{overflow-x:auto}table{border-collapse:collapse;margin:.6em 0 1em}\
th,td{padding:.22em 1.1em .22em 0;text-align:left;vertical-align:top}\
th{font-weight:600}thead th{border-bottom:1px solid var(--line)}.facts th{font-weight:400;color:var(--soft);white-space:nowrap}\
.n{text-align:right;font-variant-numeric:tabular-nums}.n,.t{white-space:nowrap}\
a{color:var(--c0)}figure{margin:1.2em 0}figcaption,footer,.soft{color:var(--soft)}figcaption{font-size:.9em;max-width:75ch}\
footer{font-size:.85em;margin-top:3em}\
.badge{font-size:.8rem;font-weight:600;padding:.08em .6em;border:1px solid;border-radius:1em;white-space:nowrap;\
vertical-align:.12em}.good{color:var(--good)}.warn{color:var(--warn)}.wrong{color:var(--bad)}\
svg{max-width:100%;height:auto;display:block}svg svg{max-width:none}\
[role=img] text{font:12px system-ui,'Segoe UI',Helvetica,Arial,sans-serif;fill:var(--ink)}\
[role=img] .soft{fill:var(--soft)}[role=img] .name{font-weight:600;font-size:13px}[role=img] .small{font-size:11px}[role=img] .e{text-anchor:end}[role=img] .m{text-anchor:middle}\
[role=img] path{fill:none;stroke:var(--ink)}[role=img] .grid{stroke:var(--grid)}[role=img] .axis{stroke:var(--line)}\
[role=img] .frame{fill:none;stroke:var(--line)}[role=img] .cell{fill:var(--grid)}\
[role=img] .arrow{stroke-width:1.2;stroke-linejoin:round;stroke-opacity:.8}[role=img] .bar{stroke-width:1.6}\
[role=img] .outline{fill:none;stroke-dasharray:5 4;stroke-opacity:.8}[role=img] .open{fill:var(--paper)}\
[role=img] .jump{stroke-dasharray:4 3;stroke-width:1.4}[role=img] .bound{stroke:var(--bad);stroke-dasharray:4 3}[role=img] .bad{stroke:var(--bad);stroke-width:1.4}\
[role=img] .was{stroke:var(--soft);stroke-width:2}[role=img] .scale{stroke:var(--ink);stroke-width:3}\
[role=img] .tower{fill:var(--paper);stroke-width:1.5}\
[role=img] .dots{stroke-linecap:round}[role=img] .squares{stroke-linecap:square}\
[role=img] .dots.ring{stroke:var(--warn)}[role=img] .dots.failed{stroke:var(--bad)}[role=img] .dots.none{stroke:var(--none)}\
[role=img] .s0{stroke:var(--c0)}[role=img] .s1{stroke:var(--c1)}[role=img] .s2{stroke:var(--c2)}[role=img] .s3{stroke:var(--c3)}\
[role=img] .s4{stroke:var(--c4)}[role=img] .s5{stroke:var(--c5)}[role=img] .f0{fill:var(--c0)}[role=img] .f1{fill:var(--c1)}[role=img] .mark{stroke:none}\
.verdict{border:1.5px solid;border-radius:.5em;padding:.1em 1em;margin:0 0 1em}.verdict b{font-size:1.35em}\
.found{min-width:15em}.hash{min-width:18em;font:12px ui-monospace,Menlo,Consolas,monospace;overflow-wrap:anywhere}\
[role=img] .limit{stroke:var(--bad);stroke-width:2}[role=img] .whisker{stroke-width:1.4}[role=img] .col{stroke:none;fill:var(--c0);fill-opacity:.75}\
[role=img] .beyond{fill:var(--c1)}\
.sign div{display:grid;grid-template-columns:8em 1fr 8em 1fr;gap:0 1.5em;align-items:end;break-inside:avoid}\
.sign div p{margin:2.6em 0 0}.sign div p+p{border-top:1px solid var(--line);margin-top:3.6em}.sign span{color:var(--soft);font-size:.8em}\
@media (max-width:700px){table{display:block;overflow-x:auto}.wide{overflow-x:auto}.wide svg{max-width:none;width:720px}\
.sign div{grid-template-columns:1fr 1fr}}\
@media print{body{max-width:none;margin:0;font-size:11pt}figure,tr,h2,h3{break-inside:avoid}h2,h3{break-after:avoid}\
section.heliostat{break-before:page}a{color:inherit;text-decoration:none}}";

pub(crate) fn html(page: &CalibrationPage) -> String {
    let mut html = facts(&page.facts);
    html.push_str(&verdicts(&page.field));
    if !page.findings.is_empty() {
        html.push_str("<h2>Findings</h2>\n");
        html.push_str(&sentences(&page.findings));
    }
    if !page.field.is_empty() {
        html.push_str("<h2>The field</h2>\n");
        html.extend(overview::map(page));
        html.extend(overview::histogram(page));
    }
    html.push_str(&contents(page));
    for (number, section) in page.heliostats.iter().enumerate() {
        html.push_str(&heliostat::section(page, number, section));
    }
    document(&page.title, &html, [&page.version, &page.generated_utc])
}

/// A complete file around what a page holds; `made` says by what and when.
pub(crate) fn document(title: &str, body: &str, made: [&str; 2]) -> String {
    let title = Escaped(title);
    let made: Vec<&str> = made.into_iter().filter(|text| !text.is_empty()).collect();
    format!(
        "<!DOCTYPE html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n\
         <meta name=\"viewport\" content=\"width=device-width\">\n\
         <meta name=\"color-scheme\" content=\"light dark\">\n<title>{title}</title>\n\
         <style>{STYLE}</style>\n</head>\n<body>\n<h1>{title}</h1>\n{body}\
         <footer>{}</footer>\n</body>\n</html>\n",
        Escaped(&made.join(", "))
    )
}

/// A figure with its caption.
pub(crate) fn figure(svg: &str, caption: &str) -> String {
    format!(
        "<figure>\n{svg}<figcaption>{}</figcaption>\n</figure>\n",
        Escaped(caption)
    )
}

/// One sentence as a paragraph, several as a list.
pub(crate) fn sentences(sentences: &[String]) -> String {
    if let [one] = sentences {
        return format!("<p>{}</p>\n", Escaped(one));
    }
    let mut html = String::new();
    if !sentences.is_empty() {
        html.push_str("<ul>\n");
        for sentence in sentences {
            // Writing to a string cannot fail.
            let _ = writeln!(html, "<li>{}</li>", Escaped(sentence));
        }
        html.push_str("</ul>\n");
    }
    html
}

pub(crate) fn facts(facts: &[(String, String)]) -> String {
    let mut html = String::new();
    if facts.is_empty() {
        return html;
    }
    html.push_str("<table class=\"facts\">\n");
    for (name, text) in facts {
        let (name, text) = (Escaped(name), Escaped(text));
        let _ = writeln!(html, "<tr><th>{name}</th><td>{text}</td></tr>");
    }
    html.push_str("</table>\n");
    html
}

pub(crate) fn badge(verdict: Verdict) -> String {
    let class = match verdict {
        Verdict::Determined => "good",
        Verdict::Undetermined => "warn",
        Verdict::Failed => "wrong",
        Verdict::NotObserved => "soft",
    };
    format!("<b class=\"badge {class}\">{verdict}</b>")
}

/// How many heliostats got which verdict.
fn verdicts(field: &[HeliostatSummary]) -> String {
    let mut html = String::new();
    if field.is_empty() {
        html.push_str("<p>There are no heliostats.</p>\n");
        return html;
    }
    html.push_str(
        "<table><thead><tr><th>verdict</th><th class=\"n\">heliostats</th><th class=\"n\">share</th>\
         <th class=\"n\">records</th><th class=\"n\">rejected</th><th class=\"n\">with several sets</th></tr></thead>\n",
    );
    for verdict in [
        Verdict::Determined,
        Verdict::Undetermined,
        Verdict::Failed,
        Verdict::NotObserved,
    ] {
        let of = || field.iter().filter(|h| h.verdict == verdict);
        let number = of().count();
        if number > 0 {
            let share = 100.0 * number as f64 / field.len() as f64;
            let _ = writeln!(
                html,
                "<tr><td>{}</td><td class=\"n\">{}</td><td class=\"n\">{share:.1} %</td><td class=\"n\">{}</td>\
                 <td class=\"n\">{}</td><td class=\"n\">{}</td></tr>",
                badge(verdict),
                count(number),
                count(of().map(|h| h.observations).sum()),
                count(of().map(|h| h.rejected).sum()),
                count(of().filter(|h| h.epochs > 1).count()),
            );
        }
    }
    html.push_str("</table>\n");
    html
}

/// The table of the heliostats that have a section, and what was left out.
fn contents(page: &CalibrationPage) -> String {
    let mut html = String::new();
    if page.field.is_empty() && page.heliostats.is_empty() {
        return html;
    }
    html.push_str("<h2>Heliostats</h2>\n");
    let (shown, all) = (page.heliostats.len(), page.field.len());
    if shown < all {
        let with: std::collections::HashSet<&str> =
            page.heliostats.iter().map(|section| &*section.id).collect();
        let unobserved = page
            .field
            .iter()
            .filter(|line| line.verdict == Verdict::NotObserved && !with.contains(&*line.id))
            .count();
        let left_out = all - shown;
        let others = match unobserved {
            0 => format!("{} are left out.", count(left_out)),
            n if n == left_out => format!("The other {} were not observed.", count(n)),
            n => format!(
                "{} are left out, of which {} were not observed.",
                count(left_out),
                count(n)
            ),
        };
        let _ = writeln!(
            html,
            "<p>{} of {} heliostats have a section below: those asked for, and those in most need of attention \
             (without a result first, then undetermined, then by RMS). {others}</p>",
            count(shown),
            count(all),
        );
    }
    if shown == 0 {
        return html;
    }
    let lines: std::collections::HashMap<&str, &HeliostatSummary> =
        page.field.iter().map(|line| (&*line.id, line)).collect();
    let remark = |section: &super::HeliostatSection| {
        lines.get(&*section.id).map_or("", |line| &*line.remark)
    };
    let remarks = page.heliostats.iter().any(|s| !remark(s).is_empty());
    let remark_head = if remarks { "<th>remark</th>" } else { "" };
    let _ = writeln!(
        html,
        "<div class=\"scroll\"><table><thead><tr><th>heliostat</th><th>verdict</th><th class=\"n\">RMS before, mrad</th>\
         <th class=\"n\">after, mrad</th><th class=\"n\">records</th><th class=\"n\">rejected</th><th class=\"n\">sets</th>\
         {remark_head}</tr></thead>"
    );
    for (number, section) in page.heliostats.iter().enumerate() {
        let rejected = section
            .records
            .iter()
            .filter(|r| r.rejected.is_some())
            .count();
        let _ = writeln!(
            html,
            "<tr><td><a href=\"#h{number}\">{}</a></td><td>{}</td><td class=\"n\">{}</td><td class=\"n\">{}</td>\
             <td class=\"n\">{}</td><td class=\"n\">{}</td><td class=\"n\">{}</td><td>{}</td></tr>",
            Escaped(&section.id),
            badge(section.verdict),
            mrad(section.before_rms_mrad),
            mrad(section.after_rms_mrad),
            count(section.records.len()),
            count(rejected),
            section.epochs.len(),
            Escaped(remark(section))
        );
    }
    html.push_str("</table></div>\n");
    html
}
