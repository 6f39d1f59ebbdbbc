//! Figures as pixels.

use std::sync::Arc;

use resvg::tiny_skia::{Pixmap, Transform};
use resvg::usvg::fontdb::Database;
use resvg::usvg::{Options, Tree};

use crate::{Figure, FigureError};

/// DejaVu Sans with Latin, Greek, Cyrillic and the signs of figures, see `fonts/README.md`.
const FONTS: [&[u8]; 2] = [
    include_bytes!("../fonts/DejaVuSans.ttf"),
    include_bytes!("../fonts/DejaVuSans-Bold.ttf"),
];
/// Most pixels of a picture.
const MOST: f64 = 2e8;

impl Figure {
    /// The figure as a PNG file of `scale` pixels for each of its own, in each direction: 1 for screens, 2 for paper.
    ///
    /// Text is set in a font that this crate carries, so that the same figure gives the same bytes on every machine.
    /// There only with the feature `png`.
    ///
    /// # Errors
    /// [`FigureError::BadValue`] for a scale that is not above 0 or gives more than 2e8 pixels or less than one,
    /// [`FigureError::Pixels`] if the painter refuses the figure.
    ///
    /// ```
    /// use helio_report::flux::{Convergence, Series, convergence};
    /// let figure = convergence(&Convergence {
    ///     title: "",
    ///     x_name: "rays",
    ///     y_name: "error",
    ///     series: &[Series { name: "a", x: &[1e3, 1e5], y: &[1e-1, 1e-2], fit: true }],
    /// })?;
    /// assert!(figure.to_png(1.0)?.starts_with(b"\x89PNG"));
    /// assert!(figure.to_png(-1.0).is_err());
    /// # Ok::<(), helio_report::FigureError>(())
    /// ```
    pub fn to_png(&self, scale: f64) -> Result<Vec<u8>, FigureError> {
        let sides = [self.width, self.height].map(|side| (side * scale).ceil());
        let pixels = sides[0] * sides[1];
        if !(scale > 0.0 && sides.iter().all(|s| *s >= 1.0) && pixels <= MOST) {
            return Err(FigureError::BadValue {
                what: "scale",
                wanted: "above 0, for one pixel to 2e8 of them",
                row: None,
                value: scale,
            });
        }
        let refused = |why: &dyn std::fmt::Display| FigureError::Pixels {
            why: why.to_string(),
        };
        let mut fonts = Database::new();
        for font in FONTS {
            fonts.load_font_data(font.to_vec());
        }
        fonts.set_sans_serif_family("DejaVu Sans");
        let options = Options {
            font_family: "DejaVu Sans".to_owned(),
            fontdb: Arc::new(fonts),
            ..Options::default()
        };
        let tree = Tree::from_str(&self.to_svg(), &options).map_err(|e| refused(&e))?;
        let mut pixmap = Pixmap::new(sides[0] as u32, sides[1] as u32)
            .ok_or_else(|| refused(&"no memory for them"))?;
        let scale = scale as f32;
        resvg::render(
            &tree,
            Transform::from_scale(scale, scale),
            &mut pixmap.as_mut(),
        );
        pixmap.encode_png().map_err(|e| refused(&e))
    }
}
