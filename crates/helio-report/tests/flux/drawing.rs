//! Reading a figure back.

use base64::Engine;
use helio_report::Figure;
use image::RgbImage;

/// A rectangle or a polygon with its colour: left, top, right, bottom.
#[derive(Debug, Clone, PartialEq)]
pub struct Cell {
    pub fill: String,
    pub edges: [f64; 4],
}

/// What a figure holds.
#[derive(Debug, Default)]
pub struct Drawing {
    pub cells: Vec<Cell>,
    pub texts: Vec<(f64, f64, String)>,
    /// Numbers on contours.
    pub levels: Vec<(f64, f64, String)>,
    /// Lines of contours, each of all its points.
    pub contours: Vec<Vec<Vec<(f64, f64)>>>,
    pub faces: Vec<Cell>,
    /// Strokes that are curves of plots, by their colour.
    pub curves: Vec<(String, Vec<(f64, f64)>)>,
    /// Middles of marks.
    pub marks: Vec<(f64, f64)>,
    pub image: Option<(RgbImage, [f64; 4])>,
    pub size: (f64, f64),
}

impl Drawing {
    pub fn says(&self, words: &str) -> bool {
        self.texts.iter().any(|(_, _, text)| text.contains(words))
    }
}

pub fn read(figure: &Figure) -> Drawing {
    let svg = figure.to_svg();
    assert!(!svg.contains("NaN") && !svg.contains("inf"), "{svg}");
    let document = roxmltree::Document::parse(&svg).expect("XML");
    let mut out = Drawing::default();
    let root = document.root_element();
    let number = |node: &roxmltree::Node<'_, '_>, name: &str| -> f64 {
        node.attribute(name).expect(name).parse().expect(name)
    };
    out.size = (number(&root, "width"), number(&root, "height"));
    for node in root.descendants().filter(roxmltree::Node::is_element) {
        let inside = node.parent_element().is_some_and(|p| p != root);
        match node.tag_name().name() {
            "text" => {
                let text = node.text().unwrap_or_default().to_owned();
                let (x, y) = (number(&node, "x"), number(&node, "y"));
                // all of it on the paper, as far as can be told without a font; turned text aside
                if node.attribute("transform").is_none() {
                    let width = 6.6 * text.chars().count() as f64;
                    let from = match node.attribute("text-anchor") {
                        Some("middle") => x - 0.5 * width,
                        Some("end") => x - width,
                        _ => x,
                    };
                    let right = from + width;
                    assert!(
                        from > -1.0 && right < out.size.0 + 40.0,
                        "{text}: {from} to {right}"
                    );
                    assert!(y > 8.0 && y < out.size.1, "{text}: {y}");
                }
                if node.attribute("class") == Some("level") {
                    out.levels.push((x, y, text));
                } else {
                    out.texts.push((x, y, text));
                }
            }
            "rect" if inside => {
                let (x, y) = (number(&node, "x"), number(&node, "y"));
                let (width, height) = (number(&node, "width"), number(&node, "height"));
                out.cells.push(Cell {
                    fill: node.attribute("fill").unwrap_or_default().to_owned(),
                    edges: [x, y, x + width, y + height],
                });
            }
            "image" => {
                let (x, y) = (number(&node, "x"), number(&node, "y"));
                let edges = [
                    x,
                    y,
                    x + number(&node, "width"),
                    y + number(&node, "height"),
                ];
                out.image = Some((decode(node.attribute("href").expect("href")), edges));
            }
            "path" => path(&node, inside, &mut out),
            _ => {}
        }
    }
    out
}

fn path(node: &roxmltree::Node<'_, '_>, inside: bool, out: &mut Drawing) {
    let d = node.attribute("d").unwrap_or_default();
    let stroke = node.attribute("stroke").unwrap_or_default().to_owned();
    if d.contains('m') {
        if d.contains("7 0h5") && stroke == "#000" {
            let at = d[1..].split_once('m').expect("a mark").0;
            let (x, y) = at.split_once(' ').expect("two numbers");
            out.marks
                .push((x.parse().expect("x"), y.parse().expect("y")));
        }
        return;
    }
    let lines: Vec<Vec<(f64, f64)>> = d
        .trim_end_matches('z')
        .split('M')
        .skip(1)
        .map(|line| {
            let point = |p: &str| {
                let (x, y) = p.split_once(' ')?;
                Some((x.parse().ok()?, y.parse().ok()?))
            };
            line.split('L').filter_map(point).collect()
        })
        .collect();
    if node.attribute("class") == Some("contour") {
        out.contours.push(lines);
    } else if inside && node.attribute("fill").is_some_and(|f| f.starts_with('#')) {
        let points = &lines[0];
        let edge = |value: fn(&(f64, f64)) -> f64, least: bool| {
            let all = points.iter().map(value);
            if least {
                all.fold(f64::INFINITY, f64::min)
            } else {
                all.fold(f64::NEG_INFINITY, f64::max)
            }
        };
        out.faces.push(Cell {
            fill: node.attribute("fill").unwrap_or_default().to_owned(),
            edges: [
                edge(|p| p.0, true),
                edge(|p| p.1, true),
                edge(|p| p.0, false),
                edge(|p| p.1, false),
            ],
        });
    } else if node.attribute("stroke-width") == Some("1.6") {
        out.curves
            .extend(lines.into_iter().map(|line| (stroke.clone(), line)));
    }
}

fn decode(href: &str) -> RgbImage {
    let text = href
        .strip_prefix("data:image/png;base64,")
        .expect("a PNG in the file");
    let bytes = base64::engine::general_purpose::STANDARD
        .decode(text)
        .expect("base64");
    image::load_from_memory(&bytes).expect("a PNG").into_rgb8()
}

/// Writes a figure to the build's temporary folder, to be looked at.
pub fn keep(name: &str, figure: &Figure) {
    let folder = std::path::Path::new(env!("CARGO_TARGET_TMPDIR"));
    std::fs::write(folder.join(format!("{name}.svg")), figure.to_svg()).expect("a folder");
    #[cfg(feature = "png")]
    {
        let png = figure.to_png(1.5).expect("a picture");
        std::fs::write(folder.join(format!("{name}.png")), png).expect("a folder");
    }
}
