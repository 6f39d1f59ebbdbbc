//! Figures and the page of a run.

use std::path::Path;

use helio_flux::{Account, FluxMap};
use helio_io::{AtomicFile, FluxScene, SceneMethod, SunForm, write_file};
use helio_report::flux::{
    FluxPage, GridMap, MapText, Table, grid_map, grid_profiles, page, receiver_figure,
};
use helio_report::{Figure, FigureError, stack};

use super::outputs::suffix_is;
use crate::args::FluxArgs;
use crate::failure::Failure;
use crate::plan::made_at;
use crate::printer::Grouped;

/// Pixels of a PNG for one of the figure.
const PNG_SCALE: f64 = 2.0;

/// What a plot is made of.
#[derive(Default)]
pub(super) struct Plot<'a> {
    pub(super) title: String,
    pub(super) facts: Vec<(String, String)>,
    pub(super) account: Option<&'a Account>,
    pub(super) tables: Vec<Table>,
    pub(super) figures: Vec<(Figure, String)>,
    pub(super) notes: Vec<String>,
}

/// A plot that is drawn and not yet written.
pub(super) struct Drawn<'a> {
    path: &'a Path,
    bytes: Vec<u8>,
}

impl Drawn<'_> {
    pub(super) fn write(self) -> Result<(), Failure> {
        Ok(write_file(self.path, &self.bytes)?)
    }
}

/// Draws, if that is wanted; nothing is written yet.
pub(super) fn draw<'a>(
    args: &'a FluxArgs,
    plot: impl FnOnce() -> Result<Plot<'a>, Failure>,
) -> Result<Option<Drawn<'a>>, Failure> {
    let Some(path) = &args.plot else {
        return Ok(None);
    };
    AtomicFile::check(path)?;
    let plot = plot()?;
    let bytes = if suffix_is(path, &["html", "htm"]) {
        let whole = FluxPage {
            title: plot.title,
            version: format!("helio-rs {}", env!("CARGO_PKG_VERSION")),
            generated_utc: made_at(),
            facts: plot.facts,
            account: plot.account,
            tables: plot.tables,
            figures: plot.figures,
            notes: plot.notes,
        };
        page(&whole).into_bytes()
    } else {
        let figures: Vec<Figure> = plot.figures.into_iter().map(|(figure, _)| figure).collect();
        let all = stack(&figures);
        if suffix_is(path, &["png"]) {
            all.to_png(PNG_SCALE)?
        } else {
            all.to_svg().into_bytes()
        }
    };
    Ok(Some(Drawn { path, bytes }))
}

/// The figure of a receiver's map, with its caption.
pub(super) fn of_receiver(
    scene: &FluxScene,
    map: &FluxMap,
    title: &str,
) -> Result<(Figure, String), FigureError> {
    let text = MapText {
        title,
        dni_w_m2: (scene.sun.dni_w_m2 > 0.0).then_some(scene.sun.dni_w_m2),
        subtitle: "",
    };
    let figure = receiver_figure(&scene.receiver, map, &text)?;
    let caption = if map.peak().0 > 0.0 {
        "Irradiance of the receiver as someone facing it sees it, and along the row and the column of the peak."
    } else {
        "The receiver as someone facing it sees it: no light."
    };
    Ok((figure, caption.to_owned()))
}

/// The figure of a grid, with its caption.
pub(super) fn of_grid(grid: &GridMap<'_>) -> Result<(Figure, String), FigureError> {
    let figure = stack(&[grid_map(grid)?, grid_profiles(grid)?]);
    Ok((
        figure,
        "Irradiance of the target in the picture, and along the row and the column of the peak."
            .to_owned(),
    ))
}

/// What a page says of any scene.
pub(super) fn facts(scene: &FluxScene, sun: String) -> Vec<(String, String)> {
    let shape = match scene.sun.form {
        SunForm::Pillbox(rad) => format!("pillbox of {:.3} mrad", 1e3 * rad),
        SunForm::LimbDarkened(rad) => format!("limb-darkened disc of {:.3} mrad", 1e3 * rad),
        SunForm::Gaussian(rad) => format!("Gaussian of {:.3} mrad", 1e3 * rad),
        SunForm::Buie(ratio) => format!("disc and aureole, circumsolar ratio {ratio}"),
        other => other.as_str().to_owned(),
    };
    let error = &scene.mirror.error;
    let method = match scene.rays.method {
        SceneMethod::Convolve => "convolution, without shading and blocking".to_owned(),
        SceneMethod::Auto => format!(
            "rays or convolution, for an error of {} of the peak",
            scene.rays.error
        ),
        _ => format!(
            "{} rays, seed {}",
            Grouped(scene.rays.count),
            scene.rays.seed
        ),
    };
    vec![
        ("sun".to_owned(), format!("{sun}; {shape}")),
        (
            "direct normal irradiance".to_owned(),
            format!("{} W/m²", scene.sun.dni_w_m2),
        ),
        (
            "mirrors".to_owned(),
            format!(
                "reflectivity {}, slope error {} mrad, specularity {} mrad",
                scene.mirror.reflectivity,
                1e3 * error.slope_rms_rad(),
                1e3 * error.specularity_rms_rad()
            ),
        ),
        (
            "receiver".to_owned(),
            format!(
                "{:.4} m² in {} bins",
                scene.receiver.area_m2(),
                Grouped(scene.receiver.bins() as u64)
            ),
        ),
        ("method".to_owned(), method),
    ]
}
