//! SVG text: the few elements that the figures are made of.

use std::fmt::Write;

/// A drawing with its size in pixels.
#[derive(Debug, Clone, PartialEq)]
pub struct Figure {
    pub(crate) width: f64,
    pub(crate) height: f64,
    pub(crate) body: String,
}

const STYLE: &str = "font-family=\"system-ui,'Segoe UI',Helvetica,Arial,sans-serif\" \
                     font-size=\"12\" fill=\"#222\"";

impl Figure {
    pub(crate) fn new(width: f64, height: f64) -> Self {
        Self {
            width,
            height,
            body: String::new(),
        }
    }

    /// The figure as a complete SVG file.
    ///
    /// ```
    /// use helio_report::{Curve, CurveAxis, AngleCurves, angle_curves};
    /// let angles = [10.0, 11.0, 12.0];
    /// let figure = angle_curves(&AngleCurves {
    ///     title: "A1",
    ///     axis: CurveAxis::Row,
    ///     at: &[0, 1, 2],
    ///     curves: &[Curve { id: "A1", axis1_deg: &angles, axis2_deg: &angles, incidence_deg: &angles }],
    ///     axis1_turns: true,
    ///     axis_names: ["azimuth", "elevation"],
    /// })?;
    /// assert!(figure.to_svg().starts_with("<?xml"));
    /// # Ok::<(), helio_report::FigureError>(())
    /// ```
    #[must_use]
    pub fn to_svg(&self) -> String {
        format!(
            "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n{}\n",
            self.element()
        )
    }

    /// The `svg` element alone, to stand inside a page.
    #[must_use]
    pub fn element(&self) -> String {
        let (w, h) = (Short(self.width), Short(self.height));
        format!(
            "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{w}\" height=\"{h}\" \
             viewBox=\"0 0 {w} {h}\" {STYLE}>\n<rect width=\"{w}\" height=\"{h}\" \
             fill=\"#fff\"/>\n{}</svg>",
            self.body
        )
    }

    /// The element for HTML, where its namespace goes without saying.
    pub(crate) fn inline(&self) -> String {
        self.element()
            .replacen(" xmlns=\"http://www.w3.org/2000/svg\"", "", 1)
    }

    /// Adds markup as it is.
    pub(crate) fn raw(&mut self, markup: std::fmt::Arguments<'_>) {
        // Writing to a string cannot fail.
        let _ = writeln!(self.body, "{markup}");
    }

    pub(crate) fn text(&mut self, x: f64, y: f64, more: &str, text: &str) {
        let (x, y, text) = (Short(x), Short(y), Escaped(text));
        self.raw(format_args!(
            "<text x=\"{x}\" y=\"{y}\" {more}>{text}</text>"
        ));
    }

    pub(crate) fn line(&mut self, from: (f64, f64), to: (f64, f64), colour: &str) {
        let (x1, y1, x2, y2) = (Short(from.0), Short(from.1), Short(to.0), Short(to.1));
        self.raw(format_args!(
            "<path d=\"M{x1} {y1}L{x2} {y2}\" stroke=\"{colour}\" fill=\"none\"/>"
        ));
    }

    pub(crate) fn rect(&mut self, x: f64, y: f64, size: (f64, f64), more: &str) {
        let (x, y, w, h) = (Short(x), Short(y), Short(size.0), Short(size.1));
        self.raw(format_args!(
            "<rect x=\"{x}\" y=\"{y}\" width=\"{w}\" height=\"{h}\" {more}/>"
        ));
    }

    /// Round dots of one colour as a single path of zero-length strokes with round ends: ten
    /// bytes a dot. Places are whole tenths of a pixel.
    pub(crate) fn dots(&mut self, colour: &str, diameter: f64, dots: &[(i32, i32)]) {
        if dots.is_empty() {
            return;
        }
        let mut path = String::with_capacity(dots.len() * 10);
        let mut at = (0, 0);
        for &(x, y) in dots {
            let _ = write!(path, "m{} {}h0", x - at.0, y - at.1);
            at = (x, y);
        }
        let width = Short(diameter * 10.0);
        self.raw(format_args!(
            "<path transform=\"scale(.1)\" fill=\"none\" stroke=\"{colour}\" stroke-width=\"{width}\" \
             stroke-linecap=\"round\" d=\"{path}\"/>"
        ));
    }
}

/// Puts figures below each other, for files that hold one drawing only.
#[must_use]
pub fn stack(figures: &[Figure]) -> Figure {
    let width = figures.iter().map(|f| f.width).fold(0.0, f64::max);
    let height = figures.iter().map(|f| f.height).sum();
    let mut all = Figure::new(width, height);
    let mut y = 0.0;
    for figure in figures {
        let at = Short(y);
        let body = &figure.body;
        all.raw(format_args!(
            "<g transform=\"translate(0 {at})\">\n{body}</g>"
        ));
        y += figure.height;
    }
    all
}

/// A number with at most one decimal, which is finer than a screen shows.
pub(crate) struct Short(pub(crate) f64);

impl std::fmt::Display for Short {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        // Adding zero turns a negative zero into a plain one.
        let tenths = (self.0 * 10.0).round() + 0.0;
        if tenths % 10.0 == 0.0 {
            write!(f, "{}", tenths / 10.0)
        } else {
            write!(f, "{:.1}", tenths / 10.0)
        }
    }
}

/// Text that stands for itself in XML and HTML.
pub(crate) struct Escaped<'a>(pub(crate) &'a str);

impl std::fmt::Display for Escaped<'_> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        for c in self.0.chars() {
            match c {
                '&' => f.write_str("&amp;")?,
                '<' => f.write_str("&lt;")?,
                '>' => f.write_str("&gt;")?,
                '"' => f.write_str("&quot;")?,
                // XML 1.0 has no way at all to write these.
                c if c.is_control() && !matches!(c, '\t' | '\n' | '\r') => {
                    f.write_char('\u{fffd}')?
                }
                c => f.write_char(c)?,
            }
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_short_and_text_is_escaped() {
        assert_eq!(Short(12.0).to_string(), "12");
        assert_eq!(Short(-0.04).to_string(), "0");
        assert_eq!(Short(-1.26).to_string(), "-1.3");
        assert_eq!(
            Escaped("<A & \"B\">\u{1}").to_string(),
            "&lt;A &amp; &quot;B&quot;&gt;\u{fffd}"
        );
    }
}
