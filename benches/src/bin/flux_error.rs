//! Error against time, for rays and convolution: a flat facet, and the folded-plate concentrator of Yan 2022 as sixteen
//! flat strips and as meshes of the same strips.
//!
//! ```text
//! flux_error [--threads N] [--repeat R] [--most-rays N]
//! ```
//!
//! Prints lines of JSON: scene, elements, way, rays or points, least seconds of a call, rays per second, root mean square
//! error of the bins over the peak, and the memory that the process has used at most. The strips being flat, a mesh of
//! them has the same flux, which the convolution of the strips gives with 16 by 16 points for each bin.
#![allow(clippy::print_stdout)]

use std::time::Instant;

use helio_bench::{Options, memory_mib};
use helio_flux::{
    ConvolveOptions, Element, FluxError, FluxMap, FoldedPlate, OpticalError, Plane, RayOptions,
    Rays, Receiver, Scene, SunShape, convolve, trace_rays,
};

/// Sides of the strips' triangles \[m\]: 39,000 and ten times as many. The paper's mesh has 39,224.
const SIDES_M: [f64; 2] = [5.0e-3, 1.58e-3];

fn main() -> Result<(), String> {
    let options = Options::from_arguments(&["threads", "repeat", "most-rays"])?;
    let threads: usize = options.number("threads", 2)?;
    let repeat: usize = options.number("repeat", 3)?;
    let most: u64 = options.number("most-rays", 1 << 28)?;
    let half = [3.5, 3.0];
    let facet = rectangle(half).map_err(text)?;
    let down = [0.0, 0.0, -1.0];
    let right = [1.0, 0.0, 0.0];
    let far = Plane::new([0.0, 0.0, 100.0], down, right, [15.0; 2], [64; 2]).map_err(text)?;
    let near = Plane::new([0.0, 0.0, 1.0], down, right, [0.3; 2], [64; 2]).map_err(text)?;
    let (far, near) = (Receiver::Plane(far), Receiver::Plane(near));
    let plate = FoldedPlate::new(0.15, 0.2, 1.0, 8).map_err(text)?;
    let strips = plate.elements(0.2).map_err(text)?;
    let mut scenes = vec![
        ("facet", vec![facet], &far, vec![facet]),
        ("strips", strips.clone(), &near, strips.clone()),
    ];
    for side_m in SIDES_M {
        let mesh = mesh(&strips, side_m).map_err(text)?;
        scenes.push(("mesh", mesh, &near, strips.clone()));
    }
    for (name, elements, receiver, same) in &scenes {
        let sun_shape = SunShape::pillbox(0.26_f64.to_radians()).map_err(text)?;
        let scene = |elements| Scene {
            elements,
            receiver,
            sun: [0.0, 0.0, 1.0],
            dni_w_m2: 1000.0,
            sun_shape: &sun_shape,
            optical_error: OpticalError::NONE,
        };
        let fine = ConvolveOptions {
            points: 16,
            threads,
            ..ConvolveOptions::default()
        };
        let wanted = convolve(&scene(same), &fine).map_err(text)?;
        let say = |way: &str, count: u64, call: &dyn Fn() -> Result<FluxMap, FluxError>| {
            let mut seconds = f64::INFINITY;
            let mut error = 0.0;
            let mut rays = 0;
            for _ in 0..repeat.max(1) {
                let start = Instant::now();
                let map = call().map_err(text)?;
                seconds = seconds.min(start.elapsed().as_secs_f64());
                error = apart(&map, &wanted);
                rays = map.account().rays;
            }
            println!(
                "{{\"scene\": \"{name}\", \"elements\": {}, \"way\": \"{way}\", \"count\": {count}, \"rays\": {rays}, \
                 \"seconds\": {seconds:.6}, \"mrays_per_s\": {:.1}, \"rms_of_peak\": {error:.3e}, \"memory_mib\": {}}}",
                elements.len(),
                rays as f64 / seconds / 1e6,
                memory_mib(),
            );
            Ok::<(), String>(())
        };
        // Every element gets sixteen.
        let mut rays = (16 * elements.len() as u64)
            .next_power_of_two()
            .max(1 << 14);
        while rays <= most {
            let options = RayOptions {
                rays: Rays::Total(rays),
                threads,
                ..RayOptions::default()
            };
            say("rays", rays, &|| trace_rays(&scene(elements), &options))?;
            rays *= 4;
        }
        // One point a bin of 39,000 triangles takes seconds, of ten times as many minutes.
        let most_points = match elements.len() {
            0..=1000 => 8,
            1001..=100_000 => 1,
            _ => 0,
        };
        for points in [1, 2, 4, 8].into_iter().filter(|&p| p <= most_points) {
            let options = ConvolveOptions {
                points,
                threads,
                ..ConvolveOptions::default()
            };
            let call = || convolve(&scene(elements), &options);
            say("convolution", points as u64, &call)?;
        }
    }
    Ok(())
}

fn rectangle([x, y]: [f64; 2]) -> Result<Element, FluxError> {
    Element::quadrilateral([[-x, -y, 0.0], [x, -y, 0.0], [x, y, 0.0], [-x, y, 0.0]])
}

/// Every parallelogram cut into triangles with sides of about a length.
fn mesh(elements: &[Element], side_m: f64) -> Result<Vec<Element>, FluxError> {
    let mut out = Vec::new();
    for element in elements {
        let c = element.corners_m();
        let edge = |to: usize| -> [f64; 3] { std::array::from_fn(|k| c[to][k] - c[0][k]) };
        let count = |e: [f64; 3]| {
            let length_m = e.iter().map(|x| x * x).sum::<f64>().sqrt();
            (length_m / side_m).round().max(1.0) as usize
        };
        let (a, b) = (edge(1), edge(3));
        let (m, n) = (count(a), count(b));
        let at = |i: usize, j: usize| -> [f64; 3] {
            let (x, y) = (i as f64 / m as f64, j as f64 / n as f64);
            std::array::from_fn(|k| c[0][k] + x * a[k] + y * b[k])
        };
        for i in 0..m {
            for j in 0..n {
                let (p, q, r, s) = (at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1));
                for triangle in [[p, q, r], [p, r, s]] {
                    out.push(Element::triangle(triangle)?.with_mirror(element.mirror()));
                }
            }
        }
    }
    Ok(out)
}

/// Root mean square difference of the bins over the peak.
fn apart(map: &FluxMap, wanted: &FluxMap) -> f64 {
    let pairs = map.irradiance_w_m2().iter().zip(wanted.irradiance_w_m2());
    let squares: f64 = pairs.map(|(a, b)| (a - b) * (a - b)).sum();
    (squares / wanted.irradiance_w_m2().len() as f64).sqrt() / wanted.peak().0
}

fn text(error: impl ToString) -> String {
    error.to_string()
}
