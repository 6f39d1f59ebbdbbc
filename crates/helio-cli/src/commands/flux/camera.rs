//! From a camera's gray values to W/m², by one reading of a gauge.

use std::path::Path;

use helio_flux::gauge::{GrayScale, GrayView, LAMBERTIAN, LambertianCheck, Reading, direct_w_m2};
use helio_io::output::Cells;
use helio_io::{GrayPicture, TargetFlux, load_target};
use helio_report::flux::{GridMap, MapText, Surface};
use serde_json::{Value, json};

use super::outputs::Outputs;
use super::plots::{self, Plot};
use super::summary;
use crate::Outcome;
use crate::args::FluxArgs;
use crate::failure::Failure;
use crate::printer::{Counted, Printer};

/// Patches along each side of a view that is compared with another.
const PATCHES: usize = 8;
fn view(picture: &GrayPicture) -> Result<GrayView<'_, f64>, Failure> {
    Ok(GrayView::new(picture.rows, picture.columns, &picture.gray)?)
}

pub(super) fn run(frame: &Path, args: &FluxArgs, printer: &Printer) -> Result<Outcome, Failure> {
    let typed = &args.picture;
    let Some(gauge) = typed.gauge else {
        // The command line wants it.
        return Err(Failure::refused("--gauge is missing"));
    };
    let mut inputs = vec![frame.to_owned()];
    inputs.extend(typed.target.clone());
    inputs.extend(typed.views.iter().flatten().cloned());
    let outputs = Outputs::check(args, &inputs)?;
    let target = typed.target.as_deref().map(load_target).transpose()?;
    if args.plot.is_some() && target.is_none() {
        return Err(Failure::refused(
            "--plot: a picture has no metres of its own; wanted --target",
        ));
    }
    let picture = GrayPicture::read(frame)?;
    let white = typed.white.unwrap_or(picture.most);
    let reading = Reading {
        row_px: gauge.y_px,
        column_px: gauge.x_px,
        radius_px: gauge.radius_px,
        flux_w_m2: gauge.flux_w_m2,
    };
    let view = view(&picture)?;
    let scale = GrayScale::by_reading(&view, &reading, typed.dark, white)
        .map_err(|error| Failure::refused(format!("{}: {error}", frame.display())))?;
    let image = scale.apply(&view);
    let dni_w_m2 = match typed.global_diffuse_w_m2 {
        Some([global, diffuse]) => Some(direct_w_m2(global, diffuse)?),
        None => args.instead.dni_w_m2,
    };
    printer.say(format_args!(
        "one gray value is {:.4} W/m² above {}",
        scale.w_m2_per_gray, scale.dark_gray
    ));
    if image.full > 0 {
        printer.warn(format_args!(
            "{} full: there was at least as much as stands there",
            Counted(image.full, "pixel")
        ));
    }
    let check = match typed.views.as_deref() {
        Some([front, aside]) => Some(lambertian(front, aside, typed.dark, printer)?),
        _ => None,
    };
    let seen = match &target {
        Some(target) => {
            let size_px = [picture.rows, picture.columns];
            let seen = TargetFlux::of(target, size_px, &image.irradiance_w_m2);
            let refuse = |message| Failure::refused(format!("{}: {message}", frame.display()));
            Some(seen.map_err(refuse)?)
        }
        None => None,
    };
    let peak = peak_of(seen.as_ref(), &image.irradiance_w_m2, picture.columns);
    let suns = |flux: f64| dni_w_m2.filter(|dni| *dni > 0.0).map(|dni| flux / dni);
    let words = suns(peak.0).map_or(String::new(), |suns| format!(" ({suns:.2} suns)"));
    if peak.0 > 0.0 {
        printer.say(format_args!(
            "peak {}{words} at {}",
            summary::flux(peak.0),
            peak.1
        ));
    } else {
        printer.say(format_args!("no light on the target"));
    }
    let drawn = plots::draw(args, || plot(frame, seen.as_ref(), dni_w_m2))?;
    write_map(
        &outputs,
        args,
        &picture,
        &image.irradiance_w_m2,
        white,
        seen.as_ref(),
        printer,
    )?;
    if let Some(drawn) = drawn {
        drawn.write()?;
    }
    let found = json!({
        "frame": frame.display().to_string(),
        "rows": picture.rows,
        "columns": picture.columns,
        "gauge": {
            "x_px": gauge.x_px, "y_px": gauge.y_px, "radius_px": gauge.radius_px,
            "flux_w_m2": gauge.flux_w_m2,
        },
        "dark_gray": scale.dark_gray,
        "white_gray": scale.full_gray,
        "w_m2_per_gray": scale.w_m2_per_gray,
        "full_pixels": image.full,
        "dni_w_m2": dni_w_m2,
        "peak_flux_w_m2": peak.0,
        "peak_concentration": suns(peak.0),
        "target": seen.as_ref().map(|seen| json_of(seen, dni_w_m2)),
        "lambertian": check,
        "files": super::hashes(&inputs)?,
        "version": env!("CARGO_PKG_VERSION"),
    });
    outputs.summary(&found, printer)?;
    Ok(Outcome::Good)
}

fn lambertian(front: &Path, aside: &Path, dark: f64, printer: &Printer) -> Result<Value, Failure> {
    let (one, other) = (GrayPicture::read(front)?, GrayPicture::read(aside)?);
    let check = LambertianCheck::of_views(&view(&one)?, &view(&other)?, PATCHES, dark).map_err(
        |error| {
            Failure::refused(format!(
                "{} and {}: {error}",
                front.display(),
                aside.display()
            ))
        },
    )?;
    printer.say(format_args!(
        "views differ by {:.2} % in the mean and by at most {:.2} % in {} patches: {} by the {:.1} % of Yan 2022",
        100.0 * check.of_means,
        100.0 * check.greatest,
        check.patches,
        if check.passes() {
            "Lambertian"
        } else {
            "not Lambertian"
        },
        100.0 * LAMBERTIAN
    ));
    Ok(json!({
        "of_means": check.of_means,
        "greatest": check.greatest,
        "patches": check.patches,
        "limit": LAMBERTIAN,
        "passes": check.passes(),
    }))
}

fn json_of(seen: &TargetFlux, dni_w_m2: Option<f64>) -> Value {
    let count = seen.known().count();
    let mean_w_m2 = seen.known().map(|(_, flux)| flux).sum::<f64>() / count as f64;
    let (most, at_m) = peak(seen);
    json!({
        "width_m": seen.size_m[0],
        "height_m": seen.size_m[1],
        "rows": seen.rows,
        "columns": seen.columns,
        "bins_not_seen": seen.flux_w_m2.len() - count,
        "power_w": seen.known().map(|(_, flux)| flux * seen.bin_m2()).sum::<f64>(),
        "mean_flux_w_m2": mean_w_m2,
        "mean_concentration": dni_w_m2.filter(|dni| *dni > 0.0).map(|dni| mean_w_m2 / dni),
        "peak_u_v_m": (most > 0.0).then_some(at_m),
    })
}

fn peak(seen: &TargetFlux) -> (f64, [f64; 2]) {
    let most = seen
        .known()
        .fold(None, |best: Option<(usize, f64)>, one| match best {
            Some(best) if best.1 >= one.1 => Some(best),
            _ => Some(one),
        });
    most.map_or((f64::NAN, [f64::NAN; 2]), |(bin, flux)| {
        (flux, seen.uv_m(bin))
    })
}

/// The greatest flux and where it is, in words.
fn peak_of(seen: Option<&TargetFlux>, flux_w_m2: &[f64], columns: usize) -> (f64, String) {
    if let Some(seen) = seen {
        let (flux, [u_m, v_m]) = peak(seen);
        return (flux, format!("u {u_m:.3} m, v {v_m:.3} m"));
    }
    let mut best = (f64::NEG_INFINITY, 0);
    for (pixel, &flux) in flux_w_m2.iter().enumerate() {
        if flux > best.0 {
            best = (flux, pixel);
        }
    }
    let (x, y) = (best.1 % columns, best.1 / columns);
    (best.0, format!("x {x} px, y {y} px"))
}

fn write_map(
    outputs: &Outputs<'_>,
    args: &FluxArgs,
    picture: &GrayPicture,
    flux_w_m2: &[f64],
    white: f64,
    seen: Option<&TargetFlux>,
    printer: &Printer,
) -> Result<(), Failure> {
    let Some(path) = &args.out else {
        return Ok(());
    };
    let format = outputs.table_format()?;
    let (count, columns) = seen.map_or((flux_w_m2.len(), picture.columns), |seen| {
        (seen.flux_w_m2.len(), seen.columns)
    });
    let whole = |of: &dyn Fn(usize) -> usize| -> Vec<Option<i64>> {
        (0..count).map(|k| i64::try_from(of(k)).ok()).collect()
    };
    let (rows, across) = (whole(&|k| k / columns), whole(&|k| k % columns));
    let places = [
        ("row", Cells::Whole(&rows)),
        ("column", Cells::Whole(&across)),
    ];
    match seen {
        Some(seen) => {
            let uv = |axis: usize| -> Vec<f64> { (0..count).map(|k| seen.uv_m(k)[axis]).collect() };
            let (u_m, v_m) = (uv(0), uv(1));
            let area_m2 = vec![seen.bin_m2(); count];
            let more = [
                ("u_m", Cells::Numbers(&u_m)),
                ("v_m", Cells::Numbers(&v_m)),
                ("area_m2", Cells::Numbers(&area_m2)),
                ("flux_w_m2", Cells::Numbers(&seen.flux_w_m2)),
            ];
            outputs.table(path, format, &[&places[..], &more].concat(), printer)
        }
        None => {
            let full: Vec<Option<i64>> = picture
                .gray
                .iter()
                .map(|gray| Some(i64::from(*gray >= white)))
                .collect();
            let more = [
                ("flux_w_m2", Cells::Numbers(flux_w_m2)),
                ("full", Cells::Whole(&full)),
            ];
            outputs.table(path, format, &[&places[..], &more].concat(), printer)
        }
    }
}

fn plot<'a>(
    frame: &Path,
    seen: Option<&TargetFlux>,
    dni_w_m2: Option<f64>,
) -> Result<Plot<'a>, Failure> {
    let Some(seen) = seen else {
        // Refused before.
        return Err(Failure::refused("--plot: wanted --target"));
    };
    let unseen = seen.flux_w_m2.iter().filter(|flux| flux.is_nan()).count();
    if unseen > 0 {
        return Err(Failure::refused(format!(
            "--plot: the picture does not show all of the target: {} are missing",
            Counted(unseen, "bin")
        )));
    }
    let title = format!("Flux in {}", frame.display());
    let grid = GridMap {
        text: MapText {
            title: &title,
            dni_w_m2,
            subtitle: "",
        },
        surface: Surface::Plane {
            width_m: seen.size_m[0],
            height_m: seen.size_m[1],
        },
        rows: seen.rows,
        columns: seen.columns,
        irradiance_w_m2: &seen.flux_w_m2,
    };
    Ok(Plot {
        figures: vec![plots::of_grid(&grid)?],
        title,
        ..Plot::default()
    })
}
