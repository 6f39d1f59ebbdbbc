//! From a solver's files to a flux map: a bent mirror of triangles, its model and its result in memory.
//!
//! ```text
//! flux_mesh [--across N] [--repeat R] [--threads N] [--rays N] [--write DIR]
//! ```
//!
//! Twice N times N/2 triangles; 198 makes 39,204, about the 39,224 of Yan 2022. With `--write` the model goes to
//! DIR/mesh.inp too, for `peers/mesh_meshio.py`, and nothing else is done. Prints a line of JSON: seconds of each part,
//! the least of R; rays per second; and the memory that the process has used at most, both texts and all meshes in it.
#![allow(clippy::print_stdout)]

use std::fmt::Write as _;
use std::time::Instant;

use helio_bench::{Options, memory_mib};
use helio_flux::deform::{PoseFit, SlopeErrors, reconstruct_poses, substitute_elements};
use helio_flux::mesh::frd::Step;
use helio_flux::mesh::{Mirror, MirrorOptions, Pick, ReadOptions, frd, inp};
use helio_flux::{
    Element, FluxMap, OpticalError, Plane, RayOptions, Rays, Receiver, Scene, SunShape, trace_rays,
};

fn main() -> Result<(), String> {
    let known = ["across", "repeat", "threads", "rays", "write"];
    let options = Options::from_arguments(&known)?;
    let across: usize = options.number("across", 198)?;
    let repeat: usize = options.number("repeat", 10)?;
    let threads: usize = options.number("threads", 2)?;
    let rays: u64 = options.number("rays", 1 << 26)?;
    let (model, result) = files(across);
    if let Some(folder) = options.text("write") {
        let path = std::path::Path::new(folder).join("mesh.inp");
        return std::fs::write(path, &model).map_err(text);
    }
    let mut least = [f64::INFINITY; 5];
    let mut last = None;
    for _ in 0..repeat.max(1) {
        let (times, done) = whole_way(&model, &result, threads, rays)?;
        for (least, time) in least.iter_mut().zip(times) {
            *least = least.min(time);
        }
        last = Some(done);
    }
    let Some((triangles, map)) = last else {
        return Err("no round".to_owned());
    };
    let [model_s, result_s, mirror_s, slopes_s, trace_s] = least;
    let account = map.account();
    println!(
        "{{\"peer\": \"helio_rs\", \"triangles\": {triangles}, \"model_mb\": {:.2}, \"result_mb\": {:.2}, \
         \"model_s\": {model_s:.5}, \"result_s\": {result_s:.5}, \"mirror_s\": {mirror_s:.5}, \
         \"both_methods_s\": {slopes_s:.5}, \"threads\": {threads}, \"rays\": {}, \"trace_s\": {trace_s:.5}, \
         \"mrays_per_s\": {:.1}, \"received_part\": {:.5}, \"memory_mib\": {}}}",
        model.len() as f64 / 1e6,
        result.len() as f64 / 1e6,
        account.rays,
        account.rays as f64 / trace_s / 1e6,
        account.received_w / account.incoming_w,
        memory_mib(),
    );
    Ok(())
}

/// Seconds of reading the model, reading the result, finding the mirror, both methods and tracing; how many triangles
/// the mirror has, and its map.
fn whole_way(
    model: &str,
    result: &str,
    threads: usize,
    rays: u64,
) -> Result<([f64; 5], (usize, FluxMap)), String> {
    let mut times = [0.0; 5];
    let mut start = Instant::now();
    let mut lap = |k: usize| {
        times[k] = start.elapsed().as_secs_f64();
        start = Instant::now();
    };
    let read = ReadOptions::default();
    let mut mesh = inp::mesh("mesh.inp", model.as_bytes(), &read).map_err(text)?;
    lap(0);
    let moved = frd::displacements("mesh.frd", result.as_bytes(), Step::Last, &read);
    mesh.displace(&moved.map_err(text)?);
    lap(1);
    let toward = MirrorOptions::toward([0.0, 0.0, 1.0]).map_err(text)?;
    let mirror = mesh.mirror(&Pick::ElementSet("GLASS"), &toward);
    let mirror = mirror.map_err(text)?;
    lap(2);
    let (largest_rad, elements) = both_methods(&mirror).map_err(text)?;
    lap(3);
    // u_z = 0.01 sin 3x: at most 0.03 on a mesh that is fine enough.
    if !(0.0295..0.0301).contains(&largest_rad) {
        return Err(format!(
            "largest slope error {largest_rad} rad, wanted 0.030"
        ));
    }
    let map = trace(&elements, threads, rays).map_err(text)?;
    lap(4);
    Ok((times, (elements.len(), map)))
}

/// Onto a square of 1 m in the focus of the paraboloid.
fn trace(
    elements: &[Element],
    threads: usize,
    rays: u64,
) -> Result<FluxMap, helio_flux::FluxError> {
    let focus = [0.0, 0.0, 3.0];
    let plane = Plane::new(focus, [0.5, 0.5, -1.0], [1.0, -1.0, 0.0], [1.0; 2], [64; 2])?;
    let scene = Scene {
        elements,
        receiver: &Receiver::Plane(plane),
        sun: [0.0, 0.0, 1.0],
        dni_w_m2: 1000.0,
        sun_shape: &SunShape::pillbox(4.65e-3)?,
        optical_error: OpticalError::NONE,
    };
    let options = RayOptions {
        rays: Rays::Total(rays),
        threads,
        ..RayOptions::default()
    };
    trace_rays(&scene, &options)
}

/// Both methods; the largest slope error of the first \[rad\], and its elements.
fn both_methods(mirror: &Mirror) -> Result<(f64, Vec<Element>), helio_flux::deform::DeformError> {
    let axis = [1.0, 0.0, 0.0];
    let loaded = substitute_elements(mirror)?;
    let slopes = SlopeErrors::new(&loaded, axis)?;
    let (rigid, _) = reconstruct_poses(mirror, PoseFit::LeastSquares)?;
    SlopeErrors::new(&rigid, axis)?;
    let elements = loaded.loaded().iter().flatten().copied().collect();
    Ok((slopes.max().map_or(0.0, |extreme| extreme.value), elements))
}

/// The model and the result of a paraboloid of 2 m that waves along x.
fn files(across: usize) -> (String, String) {
    let along = across / 2;
    let mut model = String::from("*NODE\n");
    let mut result = String::from(
        "    1C\n  100CL  101 1.000000000           1                     0    1           1\n \
         -4  DISP        4    1\n -5  D1          1    2    1    0\n",
    );
    let mut id = 0;
    for i in 0..=across {
        for j in 0..=along {
            id += 1;
            let (x, y) = (
                2.0 * i as f64 / across as f64,
                2.0 * j as f64 / along as f64,
            );
            let z = (x * x + y * y) / 12.0;
            let _ = writeln!(model, "{id},{x:.9},{y:.9},{z:.9}");
            let wave = exponential(0.01 * (3.0 * x).sin());
            let _ = writeln!(result, " -1{id:10}{0:>12}{0:>12}{wave:>12}", "0.00000E+00");
        }
    }
    result += " -3\n 9999\n";
    model += "*ELEMENT, TYPE=S3, ELSET=GLASS\n";
    let mut element = 0;
    for i in 0..across {
        for j in 0..along {
            let a = 1 + i * (along + 1) + j;
            let b = a + along + 1;
            element += 2;
            let _ = writeln!(model, "{},{a},{b},{}", element - 1, b + 1);
            let _ = writeln!(model, "{element},{a},{},{}", b + 1, a + 1);
        }
    }
    (model, result)
}

/// As C writes `%12.5E`.
fn exponential(value: f64) -> String {
    let text = format!("{value:.5E}");
    let (digits, exponent) = text.split_once('E').unwrap_or((&text, "0"));
    let (sign, power) = match exponent.strip_prefix('-') {
        Some(power) => ('-', power),
        None => ('+', exponent),
    };
    format!("{digits}E{sign}{power:0>2}")
}

fn text(error: impl ToString) -> String {
    error.to_string()
}
