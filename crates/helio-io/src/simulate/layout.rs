//! Generated layouts as columns.

use helio_core::Enu;
use helio_core::layout::{Measures, fermat_spiral, radial_staggered};

/// How heliostats stand around the tower.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
#[non_exhaustive]
pub enum LayoutPattern {
    /// Rings, every other one turned by half a gap.
    #[default]
    RadialStaggered,
    /// A sunflower's spiral.
    FermatSpiral,
}

/// A generated layout: a row a heliostat.
#[derive(Debug, Clone, PartialEq)]
pub struct SimulatedLayout {
    /// Names, all of one length.
    pub ids: Vec<String>,
    /// East of the tower \[m\], whole millimetres.
    pub east_m: Vec<f64>,
    /// North of it \[m\].
    pub north_m: Vec<f64>,
    /// Above its foot \[m\].
    pub up_m: Vec<f64>,
}

impl SimulatedLayout {
    /// So many heliostats in a pattern; see [`helio_core::layout`].
    ///
    /// ```
    /// use helio_core::layout::Measures;
    /// use helio_io::{LayoutPattern, SimulatedLayout};
    /// let measures = Measures {
    ///     count: 10, tower_height_m: 120.0, mirror_width_m: 11.0, mirror_height_m: 10.0, up_m: 6.0,
    /// };
    /// let layout = SimulatedLayout::generate(LayoutPattern::FermatSpiral, &measures);
    /// assert_eq!((layout.ids[9].as_str(), layout.up_m[9]), ("H10", 6.0));
    /// ```
    #[must_use]
    pub fn generate(pattern: LayoutPattern, measures: &Measures) -> Self {
        let pivots = match pattern {
            LayoutPattern::RadialStaggered => radial_staggered(measures),
            LayoutPattern::FermatSpiral => fermat_spiral(measures),
        };
        // Nobody sets up a heliostat by less, and short numbers read well.
        let millimetres = |m: f64| (m * 1000.0).round() / 1000.0 + 0.0;
        let column = |of: fn(&Enu) -> f64| pivots.iter().map(|p| millimetres(of(p))).collect();
        let digits = pivots.len().to_string().len();
        Self {
            // All of the same length so that they sort.
            ids: (1..=pivots.len())
                .map(|i| format!("H{i:0digits$}"))
                .collect(),
            east_m: column(|p| p.east),
            north_m: column(|p| p.north),
            up_m: column(|p| p.up),
        }
    }

    /// The columns after `id`, as a layout file names them.
    #[must_use]
    pub fn columns(&self) -> [(&'static str, &[f64]); 3] {
        [
            ("east_m", &self.east_m),
            ("north_m", &self.north_m),
            ("up_m", &self.up_m),
        ]
    }
}
