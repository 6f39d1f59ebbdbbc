//! The flux map of a field: 12,000 heliostats of 11 m by 10 m with 20 canted facets each, around a tower of 200 m.
//!
//! ```text
//! flux_field [--heliostats N] [--threads N] [--rays N] [--convolve POINTS]
//! ```
//!
//! Prints lines of JSON, for a flat receiver and a round one: how long the mirrors and the map took, and how far the
//! map is from the mean of four maps of other seeds; with `--convolve` the same by convolution, which leaves out shading
//! and blocking, against rays that do.
#![allow(clippy::print_stdout)]

use std::time::Instant;

use helio_bench::Options;
use helio_core::layout::{Measures, radial_staggered};
use helio_core::{Enu, EnuUnit, Field, Heliostat, TrackingMode};
use helio_flux::{
    Canting, ConvolveOptions, FluxMap, Frustum, HeliostatMirror, OpticalError, Plane, RayOptions,
    Rays, Receiver, Scene, SunShape, convolve, field_mirrors, trace_rays,
};

const UP_M: f64 = 200.0;

fn main() -> Result<(), String> {
    let options = Options::from_arguments(&["heliostats", "threads", "rays", "convolve"])?;
    let heliostats: usize = options.number("heliostats", 12_000)?;
    let threads: usize = options.number("threads", 2)?;
    let rays: u64 = options.number("rays", 20_000_000)?;
    let points: usize = options.number("convolve", 0)?;
    let measures = Measures {
        count: heliostats,
        tower_height_m: UP_M,
        mirror_width_m: 11.0,
        mirror_height_m: 10.0,
        up_m: 5.5,
    };
    let aim = Enu::new(0.0, 0.0, UP_M);
    let mut field = Field::new(TrackingMode::AzimuthElevation);
    for (k, pivot) in radial_staggered(&measures).into_iter().enumerate() {
        let heliostat = Heliostat::new(pivot, aim);
        field.push(&k.to_string(), heliostat).map_err(text)?;
    }
    let sun = EnuUnit::from_azimuth_elevation(3.5, 0.8);
    let mirror = HeliostatMirror {
        width_m: 11.0,
        height_m: 10.0,
        columns: 4,
        rows: 5,
        gap_m: 0.02,
        canting: Canting::ToAim,
        ..HeliostatMirror::default()
    };
    let start = Instant::now();
    let mirrors = field_mirrors(&field, sun, &mirror).map_err(text)?;
    let mirrors_s = start.elapsed().as_secs_f64();
    let grid = [64, 64];
    let down = [0.0, 0.5, -0.866];
    let plane =
        Plane::new([0.0, 0.0, UP_M], down, [-1.0, 0.0, 0.0], [20.0; 2], grid).map_err(text)?;
    let (base, up, north) = ([0.0, 0.0, UP_M - 10.0], [0.0, 0.0, 1.0], [0.0, 1.0, 0.0]);
    let round = Frustum::cylinder(base, up, north, 8.0, 20.0, grid).map_err(text)?;
    let sun_shape = SunShape::limb_darkened(4.65e-3).map_err(text)?;
    for (name, receiver) in [
        ("plane", Receiver::Plane(plane)),
        ("cylinder", Receiver::Frustum(round)),
    ] {
        let s = sun.as_enu();
        let scene = Scene {
            elements: &mirrors.elements,
            receiver: &receiver,
            sun: [s.east, s.north, s.up],
            dni_w_m2: 900.0,
            sun_shape: &sun_shape,
            optical_error: OpticalError::new(1.0e-3, 0.5e-3).map_err(text)?,
        };
        let ray_options = |rays, seed, occlusion| RayOptions {
            rays: Rays::Total(rays),
            seed,
            occlusion,
            threads,
            ..RayOptions::default()
        };
        let start = Instant::now();
        let map = trace_rays(&scene, &ray_options(rays, 0, true)).map_err(text)?;
        let seconds = start.elapsed().as_secs_f64();
        let a = map.account();
        let others = mean(&scene, |seed| ray_options(rays, seed, true))?;
        println!(
            "{{\"receiver\": \"{name}\", \"way\": \"rays\", \"heliostats\": {heliostats}, \"elements\": {}, \"threads\": {threads}, \
             \"rays\": {}, \"mirrors_s\": {mirrors_s:.3}, \"seconds\": {seconds:.3}, \"rms_of_peak\": {:.2e}, \
             \"worst_of_peak\": {:.2e}, \"shaded\": {:.4}, \"blocked\": {:.4}, \"spilled\": {:.4}, \"efficiency\": {:.4}}}",
            mirrors.elements.len(),
            a.rays,
            apart(&map, &others).0,
            apart(&map, &others).1,
            a.shaded_w / a.incoming_w,
            a.blocked_w / a.incoming_w,
            a.spilled_w / a.incoming_w,
            a.efficiency(),
        );
        if points == 0 {
            continue;
        }
        let start = Instant::now();
        let integral = convolve(
            &scene,
            &ConvolveOptions {
                points,
                threads,
                ..ConvolveOptions::default()
            },
        )
        .map_err(text)?;
        let seconds = start.elapsed().as_secs_f64();
        let others = mean(&scene, |seed| ray_options(rays, seed, false))?;
        println!(
            "{{\"receiver\": \"{name}\", \"way\": \"convolution\", \"points\": {points}, \"seconds\": {seconds:.3}, \
             \"rms_of_peak\": {:.2e}, \"worst_of_peak\": {:.2e}}}",
            apart(&integral, &others).0,
            apart(&integral, &others).1,
        );
    }
    Ok(())
}

/// Mean of the maps of four seeds.
fn mean(scene: &Scene<'_>, options: impl Fn(u64) -> RayOptions) -> Result<Vec<f64>, String> {
    let mut sum = vec![0.0; scene.receiver.bins()];
    for seed in 1..=4 {
        let map = trace_rays(scene, &options(seed)).map_err(text)?;
        for (to, from) in sum.iter_mut().zip(map.irradiance_w_m2()) {
            *to += 0.25 * from;
        }
    }
    Ok(sum)
}

/// Root mean square and greatest difference, over the peak.
fn apart(map: &FluxMap, others: &[f64]) -> (f64, f64) {
    let (mut squares, mut worst, mut peak) = (0.0, 0.0_f64, 0.0_f64);
    for (a, b) in map.irradiance_w_m2().iter().zip(others) {
        squares += (a - b) * (a - b);
        worst = worst.max((a - b).abs());
        peak = peak.max(*b);
    }
    ((squares / others.len() as f64).sqrt() / peak, worst / peak)
}

fn text(error: impl ToString) -> String {
    error.to_string()
}
