//! What `choose_way` predicts, and what both ways take.
//!
//! ```text
//! flux_choice [--repeat R]
//! ```
//!
//! Prints lines of JSON: scene, elements, the error asked, rays and predicted seconds of one thread, and the least
//! seconds that both ways took with one thread. The constants of `choice.rs` are from here.
#![allow(clippy::print_stdout)]

use std::time::Instant;

use helio_bench::Options;
use helio_flux::{
    ConvolveOptions, Element, FluxError, FluxMap, FoldedPlate, Frustum, MeshReceiver, OpticalError,
    Plane, RayOptions, Rays, Receiver, Scene, SunShape, Way, Why, choose_way, convolve, trace_rays,
};

fn main() -> Result<(), String> {
    let options = Options::from_arguments(&["repeat"])?;
    let repeat: usize = options.number("repeat", 3)?;
    let scenes = scenes().map_err(text)?;
    let sun_shape = SunShape::pillbox(0.26_f64.to_radians()).map_err(text)?;
    for (name, elements, receiver) in &scenes {
        let scene = Scene {
            elements,
            receiver,
            sun: [0.0, 0.0, 1.0],
            dni_w_m2: 1000.0,
            sun_shape: &sun_shape,
            optical_error: OpticalError::NONE,
        };
        let least = |call: &dyn Fn() -> Result<FluxMap, FluxError>| {
            let mut seconds = f64::INFINITY;
            for _ in 0..repeat.max(1) {
                let start = Instant::now();
                call().map_err(text)?;
                seconds = seconds.min(start.elapsed().as_secs_f64());
            }
            Ok::<f64, String>(seconds)
        };
        for error in [0.05, 0.01, 0.002] {
            let choice = choose_way(&scene, error, 0, 1).map_err(text)?;
            let one = ConvolveOptions {
                threads: 1,
                ..ConvolveOptions::default()
            };
            let convolution_s = least(&|| convolve(&scene, &one))?;
            let (rays_s, counted_s) = match choice.why {
                Why::Sooner {
                    rays_s,
                    convolution_s,
                } => (rays_s, convolution_s.unwrap_or(f64::NAN)),
                _ => (f64::NAN, f64::NAN),
            };
            // as many as the predicted seconds tell of, where a convolution was chosen
            let rays = match choice.way {
                Way::Rays(rays) => rays,
                _ => 1 << 26,
            };
            let options = RayOptions {
                rays: Rays::Total(rays),
                threads: 1,
                ..RayOptions::default()
            };
            let traced_s = least(&|| trace_rays(&scene, &options))?;
            println!(
                "{{\"scene\": \"{name}\", \"elements\": {}, \"error\": {error}, \"way\": \"{:?}\", \"rays_predicted_s\": \
                 {rays_s:.4}, \"convolution_predicted_s\": {counted_s:.4}, \"convolution_s\": {convolution_s:.4}, \
                 \"rays\": {rays}, \"rays_s\": {traced_s:.4}}}",
                elements.len(),
                choice.way,
            );
        }
    }
    Ok(())
}

type Named = (&'static str, Vec<Element>, Receiver);

/// A facet, sixteen strips and forty-nine facets that may shade each other, each onto a receiver of every kind.
fn scenes() -> Result<Vec<Named>, FluxError> {
    let (down, right) = ([0.0, 0.0, -1.0], [1.0, 0.0, 0.0]);
    let facet = vec![square([0.0, 0.0], [3.5, 3.0])?];
    let strips = FoldedPlate::new(0.15, 0.2, 1.0, 8)?.elements(0.2)?;
    let mut apart = Vec::new();
    for k in 0..49 {
        let at = [3.0 * f64::from(k % 7) - 9.0, 3.0 * f64::from(k / 7) - 9.0];
        apart.push(square(at, [1.0, 1.0])?.with_mirror(k as u32));
    }
    let mut all = Vec::new();
    for (name, elements, up_m, side_m) in [
        ("facet", facet, 100.0, 15.0),
        ("strips", strips, 1.0, 0.3),
        ("49 facets", apart, 400.0, 25.0),
    ] {
        let plane = Plane::new([0.0, 0.0, up_m], down, right, [side_m; 2], [64; 2])?;
        all.push((name, elements.clone(), Receiver::Plane(plane)));
        let (base_m, axis) = ([0.0, -0.5 * side_m, up_m], [0.0, 1.0, 0.0]);
        let round = Frustum::cylinder(base_m, axis, down, 0.25 * side_m, side_m, [64; 2])?;
        all.push((name, elements.clone(), Receiver::Frustum(round)));
        let mut triangles = Vec::new();
        for k in 0..32 * 32 {
            let corner = |i: usize, j: usize| {
                let at = |n: usize| side_m * (n as f64 / 32.0 - 0.5);
                [at(k % 32 + i), at(k / 32 + j), up_m]
            };
            triangles.push([corner(0, 0), corner(1, 1), corner(1, 0)]);
            triangles.push([corner(0, 0), corner(0, 1), corner(1, 1)]);
        }
        all.push((
            name,
            elements,
            Receiver::Mesh(MeshReceiver::new(&triangles)?),
        ));
    }
    Ok(all)
}

fn square([x, y]: [f64; 2], [a, b]: [f64; 2]) -> Result<Element, FluxError> {
    Element::quadrilateral([
        [x - a, y - b, 0.0],
        [x + a, y - b, 0.0],
        [x + a, y + b, 0.0],
        [x - a, y + b, 0.0],
    ])
}

fn text(error: impl ToString) -> String {
    error.to_string()
}
