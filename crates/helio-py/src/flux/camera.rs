//! From a camera's gray values to W/m², by one reading of a gauge.

use std::path::PathBuf;

use helio_flux::gauge::{GrayScale, GrayView, Reading};
use helio_io::{GrayPicture, TargetFlux, load_target};
use pyo3::prelude::*;

use crate::array::{Numbers, owned, wrong_shape};
use crate::failure::Failure;
use crate::guard::guarded;

/// Gray values of shape (rows, columns), the greatest of which a camera can give.
fn picture_of(gray: &Bound<'_, PyAny>, most: f64) -> Result<GrayPicture, Failure> {
    let numbers = Numbers::of(gray, "camera")?;
    let [rows, columns] = *numbers.shape() else {
        return Err(wrong_shape("camera", "(rows, columns)", numbers.shape()));
    };
    let gray = numbers.as_slice()?.to_vec();
    if let Some(bad) = gray.iter().position(|gray| !gray.is_finite()) {
        let message = format!(
            "row {}, column {}: {} is no gray value",
            bad / columns,
            bad % columns,
            gray[bad]
        );
        return Err(Failure::of("DataTypeError", "camera", message));
    }
    Ok(GrayPicture {
        rows,
        columns,
        gray,
        most,
    })
}

/// Flux of the pixels; gray scale; and of a target: its flux, u, v, and the area of a bin.
#[pyfunction]
pub(crate) fn _flux_camera<'py>(
    py: Python<'py>,
    path: Option<PathBuf>,
    gray: Option<&Bound<'py, PyAny>>,
    white: Option<f64>,
    gauge: [f64; 4],
    dark: f64,
    target: Option<PathBuf>,
) -> PyResult<Bound<'py, PyAny>> {
    guarded(|| {
        let picture = match (&path, gray) {
            (Some(path), _) => py.detach(|| GrayPicture::read(path))?,
            (None, Some(gray)) => picture_of(gray, white.unwrap_or(f64::NAN))?,
            (None, None) => return Err(Failure::of("OptionError", "camera", "there is none")),
        };
        let named = |message: String| match &path {
            Some(path) => Failure::new("ImageError", format!("{}: {message}", path.display())),
            None => Failure::of("ImageError", "camera", message),
        };
        let white = white.unwrap_or(picture.most);
        let [column_px, row_px, flux_w_m2, radius_px] = gauge;
        let reading = Reading {
            row_px,
            column_px,
            radius_px,
            flux_w_m2,
        };
        let (scale, image, seen) = py.detach(|| {
            let view = GrayView::new(picture.rows, picture.columns, &picture.gray)?;
            let scale = GrayScale::by_reading(&view, &reading, dark, white)
                .map_err(|error| named(error.to_string()))?;
            let image = scale.apply(&view);
            let target = target.as_deref().map(load_target).transpose()?;
            let size_px = [picture.rows, picture.columns];
            let seen = target
                .map(|target| TargetFlux::of(&target, size_px, &image.irradiance_w_m2))
                .transpose()
                .map_err(named)?;
            Ok::<_, Failure>((scale, image, seen))
        })?;
        let full: Vec<bool> = picture.gray.iter().map(|gray| *gray >= white).collect();
        let shape = [picture.rows, picture.columns];
        let target = match seen {
            None => py.None().into_bound(py),
            Some(seen) => of_target(py, seen)?,
        };
        let found = (
            owned(py, image.irradiance_w_m2, &shape)?,
            owned(py, full, &shape)?,
            scale.w_m2_per_gray,
            scale.dark_gray,
            scale.full_gray,
            target,
        );
        Ok(found.into_pyobject(py)?.into_any())
    })
}

fn of_target(py: Python<'_>, seen: TargetFlux) -> Result<Bound<'_, PyAny>, Failure> {
    let shape = [seen.rows, seen.columns];
    let bins = 0..seen.rows * seen.columns;
    let uv = |axis: usize| bins.clone().map(|bin| seen.uv_m(bin)[axis]).collect();
    let power_w: f64 = seen.known().map(|(_, flux)| flux * seen.bin_m2()).sum();
    let known = seen.known().count();
    let mean_w_m2 = seen.known().map(|(_, flux)| flux).sum::<f64>() / known as f64;
    let (u_m, v_m): (Vec<f64>, Vec<f64>) = (uv(0), uv(1));
    let bin_m2 = seen.bin_m2();
    let found = (
        owned(py, seen.flux_w_m2, &shape)?,
        owned(py, u_m, &shape)?,
        owned(py, v_m, &shape)?,
        bin_m2,
        power_w,
        mean_w_m2,
    );
    Ok(found.into_pyobject(py)?.into_any())
}
