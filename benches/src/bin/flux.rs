//! Rays of one flat facet onto a plane: the scene of `peers/flux_numba.py`.
//!
//! ```text
//! flux [--threads N] [--rays N] [--repeat R] [--seed S]
//! ```
//!
//! Prints lines of JSON: rays per second with rays made before (as in a loop over designs) and with their
//! making, the flux in the middle and what arrived.
#![allow(clippy::print_stdout)]

use std::time::Instant;

use helio_bench::Options;
use helio_core::SimdLevel;
use helio_flux::{
    Element, FluxMap, OpticalError, Plane, RayOptions, RaySet, Rays, Receiver, Scene, SunShape,
    trace_rays, trace_rays_with,
};

const BINS: usize = 64;

fn main() -> Result<(), String> {
    let options = Options::from_arguments(&["threads", "rays", "repeat", "seed"])?;
    let threads: usize = options.number("threads", 1)?;
    let rays: u64 = options.number("rays", 1 << 26)?;
    let repeat: usize = options.number("repeat", 20)?;
    let seed: u64 = options.number("seed", 0)?;
    let said = |error: helio_flux::FluxError| error.to_string();
    let (x, y) = (3.5, 3.0);
    let corners = [[-x, -y, 0.0], [x, -y, 0.0], [x, y, 0.0], [-x, y, 0.0]];
    let elements = [Element::quadrilateral(corners).map_err(said)?];
    let (down, right) = ([0.0, 0.0, -1.0], [1.0, 0.0, 0.0]);
    let plane = Plane::new([0.0, 0.0, 100.0], down, right, [15.0; 2], [BINS; 2]).map_err(said)?;
    let sun_shape = SunShape::pillbox(4.65e-3).map_err(said)?;
    let scene = Scene {
        elements: &elements,
        receiver: &Receiver::Plane(plane),
        sun: [0.0, 0.0, 1.0],
        dni_w_m2: 1000.0,
        sun_shape: &sun_shape,
        optical_error: OpticalError::NONE,
    };
    let options = RayOptions {
        rays: Rays::Total(rays),
        seed,
        threads,
        ..RayOptions::default()
    };
    let set = RaySet::new(&sun_shape, &OpticalError::NONE, seed, rays);
    let made = measure(repeat, rays, || trace_rays_with(&scene, &options, &set))?;
    let making = measure(repeat, rays, || trace_rays(&scene, &options))?;
    let map = trace_rays_with(&scene, &options, &set).map_err(said)?;
    let power_w = map.account().incoming_w;
    let bin_m2 = (15.0 / BINS as f64).powi(2);
    let middle: f64 = (24..40).flat_map(|row| &map.row_w_m2(row)[24..40]).sum();
    println!(
        "{{\"peer\": \"helio_rs\", \"version\": \"{}\", \"threads\": {threads}, \"rays\": {rays}, \"mrays_per_s\": {made:.1}, \
         \"mrays_per_s_with_set\": {making:.1}, \"middle\": {:e}, \"received\": {}}}",
        SimdLevel::best(),
        middle / 256.0 * bin_m2 / power_w,
        map.account().received_w / power_w,
    );
    Ok(())
}

/// Most rays \[10⁶/s\] of some calls.
fn measure(
    repeat: usize,
    rays: u64,
    mut call: impl FnMut() -> Result<FluxMap, helio_flux::FluxError>,
) -> Result<f64, String> {
    let mut best = f64::INFINITY;
    for _ in 0..repeat.max(1) {
        let start = Instant::now();
        call().map_err(|error| error.to_string())?;
        best = best.min(start.elapsed().as_secs_f64());
    }
    Ok(rays as f64 / best / 1e6)
}
