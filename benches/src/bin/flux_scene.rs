//! Scenes for another ray tracer, with the map and the account that helio-flux gives them.
//!
//! ```text
//! flux_scene --scene plate|field|round [--rays N] [--threads N]
//! ```
//!
//! Prints one line of JSON: `peers/flux_mitsuba.py` traces what is in it by means of its own. `plate` is the folded-plate
//! concentrator of Yan 2022, `field` 30 heliostats that stand close under a low sun, `round` the same with slope errors
//! before a cylinder. Every facet is a mirror of its own, so that nothing but geometry says what is in whose way.
#![allow(clippy::print_stdout)]

use std::time::Instant;

use helio_bench::Options;
use helio_core::{Enu, EnuUnit, Field, Heliostat, TrackingMode};
use helio_flux::{
    Canting, ConvolveOptions, Element, FoldedPlate, Frustum, HeliostatMirror, OpticalError, Plane,
    RayOptions, Rays, Receiver, Scene, SunShape, convolve, field_mirrors, trace_rays,
};
use serde_json::{Value, json};

const DNI_W_M2: f64 = 1000.0;
const HALF_ANGLE_RAD: f64 = 4.65e-3;

/// What one of the scenes is made of.
struct Made {
    elements: Vec<Element>,
    receiver: Receiver,
    /// The same for the other tracer.
    described: Value,
    sun: [f64; 3],
    half_angle_rad: f64,
    slope_rms_rad: f64,
}

fn main() -> Result<(), String> {
    let options = Options::from_arguments(&["scene", "rays", "threads"])?;
    let rays: u64 = options.number("rays", 1 << 28)?;
    let threads: usize = options.number("threads", 2)?;
    let name = options.text("scene").unwrap_or("plate");
    let made = match name {
        "plate" => plate(),
        "field" => field(false),
        "round" => field(true),
        _ => return Err(format!("scene {name}: wanted plate, field or round")),
    }?;
    let sun_shape = SunShape::pillbox(made.half_angle_rad).map_err(text)?;
    let scene = Scene {
        elements: &made.elements,
        receiver: &made.receiver,
        sun: made.sun,
        dni_w_m2: DNI_W_M2,
        sun_shape: &sun_shape,
        optical_error: OpticalError::new(made.slope_rms_rad, 0.0).map_err(text)?,
    };
    let ray_options = RayOptions {
        rays: Rays::Total(rays),
        threads,
        ..RayOptions::default()
    };
    let start = Instant::now();
    let map = trace_rays(&scene, &ray_options).map_err(text)?;
    let seconds = start.elapsed().as_secs_f64();
    let account = map.account();
    let power = |irradiance_w_m2: &[f64]| -> Vec<f64> {
        let bins = irradiance_w_m2.iter().enumerate();
        bins.map(|(bin, flux)| flux * made.receiver.bin_area_m2(bin))
            .collect()
    };
    // The integral knows no shade.
    let exact = (name == "plate")
        .then(|| {
            let options = ConvolveOptions {
                points: 16,
                threads,
                ..ConvolveOptions::default()
            };
            convolve(&scene, &options).map(|map| power(map.irradiance_w_m2()))
        })
        .transpose()
        .map_err(text)?;
    let corners: Vec<_> = made.elements.iter().map(Element::corners_m).collect();
    let line = json!({
        "scene": name, "corners_m": corners, "receiver": made.described, "sun": made.sun, "dni_w_m2": DNI_W_M2,
        "half_angle_rad": made.half_angle_rad, "slope_rms_rad": made.slope_rms_rad, "rays": account.rays,
        "seconds": seconds, "incoming_w": account.incoming_w, "shaded_w": account.shaded_w,
        "blocked_w": account.blocked_w, "received_w": account.received_w,
        "power_w": power(map.irradiance_w_m2()), "power_by_integral_w": exact,
    });
    println!("{line}");
    Ok(())
}

/// 200 mm by 200 mm lit evenly, on a grid that shows their edges too.
fn plate() -> Result<Made, String> {
    let plate = FoldedPlate::new(0.15, 0.2, 1.0, 8).map_err(text)?;
    let (receiver, described) = plane([0.0, 0.0, 1.0], [0.0, 0.0, -1.0], [1.0, 0.0, 0.0], 0.3)?;
    Ok(Made {
        elements: plate.elements(0.2).map_err(text)?,
        receiver,
        described,
        sun: [0.0, 0.0, 1.0],
        half_angle_rad: 0.26_f64.to_radians(),
        slope_rms_rad: 0.0,
    })
}

/// Five rows of six heliostats north of a tower of 30 m, the sun at 15 degrees: much shade, and some blocking.
fn field(is_round: bool) -> Result<Made, String> {
    const AIM_M: f64 = 30.0;
    let mut field = Field::new(TrackingMode::AzimuthElevation);
    for row in 0..5 {
        for column in 0..6 {
            let east = 8.0 * (f64::from(column) - 2.5) + 4.0 * f64::from(row % 2);
            let pivot = Enu::new(east, 60.0 + 7.0 * f64::from(row), 3.0);
            let heliostat = Heliostat::new(pivot, Enu::new(0.0, 0.0, AIM_M));
            let name = format!("{row}-{column}");
            field.push(&name, heliostat).map_err(text)?;
        }
    }
    let sun = EnuUnit::from_azimuth_elevation(200_f64.to_radians(), 15_f64.to_radians());
    let mirror = HeliostatMirror {
        width_m: 6.0,
        height_m: 5.0,
        columns: 3,
        rows: 2,
        gap_m: 0.02,
        canting: Canting::ToAim,
        reflectivity: 1.0,
        ..HeliostatMirror::default()
    };
    let mirrors = field_mirrors(&field, sun, &mirror).map_err(text)?;
    let elements = mirrors.elements.iter().enumerate();
    let elements = elements.map(|(k, element)| element.with_mirror(k as u32));
    let (receiver, described) = if is_round {
        cylinder([0.0, 0.0, AIM_M - 4.0], 2.0, 8.0)?
    } else {
        plane([0.0, 0.0, AIM_M], [0.0, 1.0, -0.3], [-1.0, 0.0, 0.0], 6.0)?
    };
    let s = sun.as_enu();
    Ok(Made {
        elements: elements.collect(),
        receiver,
        described,
        sun: [s.east, s.north, s.up],
        half_angle_rad: HALF_ANGLE_RAD,
        slope_rms_rad: if is_round { 2.0e-3 } else { 0.0 },
    })
}

fn plane(
    centre_m: [f64; 3],
    normal: [f64; 3],
    right: [f64; 3],
    side_m: f64,
) -> Result<(Receiver, Value), String> {
    let grid = [64, 64];
    let plane = Plane::new(centre_m, normal, right, [side_m; 2], grid).map_err(text)?;
    let described = json!({
        "kind": "plane", "centre_m": centre_m, "right": plane.right(), "down": plane.down(),
        "normal": plane.normal(), "side_m": side_m, "rows": 64, "columns": 64,
    });
    Ok((Receiver::Plane(plane), described))
}

/// With its columns from the north.
fn cylinder(base_m: [f64; 3], radius_m: f64, height_m: f64) -> Result<(Receiver, Value), String> {
    let (axis, zero, grid) = ([0.0, 0.0, 1.0], [0.0, 1.0, 0.0], [32, 64]);
    let round = Frustum::cylinder(base_m, axis, zero, radius_m, height_m, grid).map_err(text)?;
    let described = json!({
        "kind": "cylinder", "base_m": base_m, "axis": axis, "zero": zero, "radius_m": radius_m,
        "height_m": height_m, "rows": 32, "columns": 64,
    });
    Ok((Receiver::Frustum(round), described))
}

fn text(error: impl ToString) -> String {
    error.to_string()
}
